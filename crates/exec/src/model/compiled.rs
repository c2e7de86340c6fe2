//! What of a model never changes: its programs and the code made of them, shared by everything that runs it.

use super::clauses::Clauses;
use super::clock::Clock;
use super::impulses::ImpulseBalance;
use super::jacobian::JacobianCode;
use super::jumps::ConservedSums;
use super::positions::PositionConstraints;
use crate::bytecode::{BlockBatches, Layout, Routine};
use halfarrow_compiler::program::{ConditionId, EventTrigger, JacobianEntry, Program, Value};
use halfarrow_sim::Sparsity;
use std::sync::Arc;

/// The number of a mode: of one structure of a model among those that its events lead to.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct ModeId(pub u32);

/// A model as code: the same for all threads, lanes and runs, whatever their parameters, inputs and states.
///
/// It has a list of modes, one so far. [`Setup`](super::Setup) and [`Memory`](super::Memory) say which of its modes they
/// belong to.
#[derive(Debug)]
pub struct Compiled {
    modes: Vec<Arc<Mode>>,
}

impl Compiled {
    /// The code of a program. Derivatives of the rates come from directions, a group of columns at a time.
    pub fn new(program: Program) -> Compiled {
        Compiled { modes: vec![Arc::new(Mode::new(program, None))] }
    }

    /// The same with the code of all derivatives of the rates by the states at once:
    /// [`System::jacobian`](halfarrow_sim::System) has them.
    pub fn with_jacobian(program: Program) -> Compiled {
        let differentiated = program.jacobian();
        Compiled { modes: vec![Arc::new(Mode::new(differentiated.program, Some(differentiated.entries)))] }
    }

    /// The mode in which a run begins.
    pub fn first(&self) -> ModeId {
        ModeId::default()
    }

    /// The program of a mode.
    pub fn program(&self, mode: ModeId) -> &Program {
        &self.mode(mode).program
    }

    pub(super) fn mode(&self, mode: ModeId) -> &Arc<Mode> {
        &self.modes[mode.0 as usize]
    }

    /// All of them, in order.
    pub(super) fn modes(&self) -> impl Iterator<Item = &Mode> {
        self.modes.iter().map(Arc::as_ref)
    }
}

/// The program of a mode, and the routines made of it.
#[derive(Debug)]
pub(super) struct Mode {
    pub program: Program,
    pub layout: Layout,
    /// Computes what follows from parameters alone.
    pub preamble: Routine,
    /// Computes what is assumed of parameters, each value with its scale.
    pub assumed: Routine,
    pub rates: Routine,
    /// The Jacobian of the rates, if it is computed at once.
    pub jacobian: Option<JacobianCode>,
    pub sparsity: Sparsity,
    /// Newton blocks of the rates that are solved together.
    pub batches: Option<Arc<BlockBatches>>,
    /// Conditions of the state, whose operands are the event indicators.
    pub switching: Vec<ConditionId>,
    /// Computes these operands.
    pub indicators: Routine,
    pub clock: Clock,
    /// Computes what is delayed or sampled.
    pub sources: Routine,
    /// States that jump with a source, if there are any.
    pub kept: Option<ConservedSums>,
    pub clauses: Clauses,
    /// How storages change at events, where they do.
    pub impulses: Option<ImpulseBalance>,
    /// Constraints that events may break.
    pub positions: Option<PositionConstraints>,
}

impl Mode {
    fn new(program: Program, entries: Option<Vec<JacobianEntry>>) -> Mode {
        let derivatives = entries.iter().flatten().map(|e| e.value);
        let layout = Layout::new(&program, &derivatives.chain(program.relations.values()).collect::<Vec<_>>());
        let rates: Vec<Value> = program.states.iter().map(|s| s.rate).collect();
        let rates = layout.guarded_routine(&program, &rates);
        let sources: Vec<Value> = program.held.iter().map(|h| h.source).collect();
        let of_state = || program.conditions.iter().filter(|(_, c)| c.trigger == EventTrigger::State);
        let operands: Vec<Value> = of_state().map(|(_, c)| c.operand).collect();
        let assumed: Vec<Value> = program.assumptions.iter().flat_map(|a| [a.value, a.scale]).collect();
        let sparsity = sparsity_of(&program);
        Mode {
            preamble: layout.preamble(&program),
            assumed: layout.routine(&program, &assumed),
            jacobian: entries.map(|entries| JacobianCode::new(&program, &layout, &sparsity, &entries)),
            sparsity,
            batches: BlockBatches::of(&program, &layout, &rates).map(Arc::new),
            rates,
            switching: of_state().map(|(id, _)| id).collect(),
            indicators: layout.routine(&program, &operands),
            clock: Clock::new(&program, &layout),
            sources: layout.routine(&program, &sources),
            kept: ConservedSums::of(&program, &layout),
            clauses: Clauses::of(&program, &layout),
            impulses: ImpulseBalance::of(&program, &layout),
            positions: PositionConstraints::of(&program, &layout),
            layout,
            program,
        }
    }

    /// Everything that runs on registers.
    pub fn routines(&self) -> impl Iterator<Item = &Routine> {
        let Mode { rates, preamble, assumed, sources, indicators, clock, .. } = self;
        let more = self
            .jacobian
            .as_ref()
            .map(|j| &j.routine)
            .into_iter()
            .chain(self.kept.as_ref().map(ConservedSums::routine))
            .chain(self.clauses.routines())
            .chain(self.impulses.as_ref().map(ImpulseBalance::routine))
            .chain(self.positions.as_ref().map(PositionConstraints::routine));
        [rates, preamble, assumed, sources, indicators, clock.routine()].into_iter().chain(more)
    }
}

fn sparsity_of(program: &Program) -> Sparsity {
    let mut columns = vec![Vec::new(); program.states.len()];
    for (row, reads) in program.dependence.iter().enumerate() {
        reads.iter().for_each(|&column| columns[column as usize].push(row));
    }
    Sparsity::from_columns(columns)
}
