//! What of a model never changes: its programs and the code made of them, shared by everything that runs it.

use super::clauses::Clauses;
use super::clock::Clock;
use super::exchanges::Ratios;
use super::impulses::ImpulseBalance;
use super::jacobian::JacobianCode;
use super::jumps::ConservedSums;
use super::margins::Bounds;
use super::positions::{Motion, PositionConstraints};
use crate::bytecode::{BlockBatches, InTurns, Layout, Routine};
use halfarrow_compiler::algebra::Symbol;
use halfarrow_compiler::program::{BlockId, ConditionId, EventTrigger, JacobianEntry, Op, Program, Value};
use halfarrow_sim::Sparsity;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// The number of a mode: of one structure of a model among those that its events lead to.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct ModeId(pub u32);

/// Makes programs of a model in which other variables stay independent.
pub trait Alternatives: std::fmt::Debug + Send + Sync {
    /// The program in which set-valued laws have these branches and these variables stay independent, as far as they can,
    /// decided at these values of the variables of the graph.
    ///
    /// # Errors
    /// There is none: why.
    fn program(
        &self,
        branches: &[u32],
        independent: &[Symbol],
        point: &BTreeMap<Symbol, f64>,
    ) -> Result<Program, String>;

    /// How many states a mode has at most: all of them are given so many. `None`: each mode has its own number of unknowns.
    fn most_states(&self) -> Option<usize>;
}

/// A model as code: the same for all threads, lanes and runs, whatever their parameters, inputs and states.
///
/// It has a list of modes: the one in which runs begin, and those to which they change where its independent variables do
/// not serve any longer, each made when it is first met. [`Memory`](super::Memory) says which of them it belongs to.
#[derive(Debug)]
pub struct Compiled {
    first: Arc<Mode>,
    alternatives: Option<Arc<dyn Alternatives>>,
    others: Mutex<Others>,
}

/// Modes besides the first.
#[derive(Debug, Default)]
struct Others {
    modes: Vec<Arc<Mode>>,
    /// The mode that this is asked of; `None` where there is none.
    of: BTreeMap<Key, Option<ModeId>>,
    /// Determinants of the equations of computed positions where a mode was entered first, as logarithms.
    determinants: BTreeMap<ModeId, Vec<f64>>,
    /// Why these branches have no equations.
    without: BTreeMap<Vec<u32>, String>,
}

/// What a mode is looked up by.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
struct Key {
    /// Branches of set-valued laws.
    branches: Vec<u32>,
    /// What stays independent.
    independent: Vec<Symbol>,
    /// What its states tell, where that was decided at a point.
    told: Option<Vec<Symbol>>,
}

impl Compiled {
    /// The code of a program. Derivatives of the rates come from directions, a group of columns at a time.
    pub fn new(program: Program) -> Compiled {
        Compiled::of(Mode::new(program, None, false))
    }

    /// The same with the code of all derivatives of the rates by the states at once:
    /// [`System::jacobian`](halfarrow_sim::System) has them.
    pub fn with_jacobian(program: Program) -> Compiled {
        let differentiated = program.jacobian();
        Compiled::of(Mode::new(differentiated.program, Some(differentiated.entries), false))
    }

    fn of(first: Mode) -> Compiled {
        Compiled { first: Arc::new(first), alternatives: None, others: Mutex::default() }
    }

    /// The same code with that of all derivatives of the rates at once.
    pub(super) fn with_all_derivatives(&self) -> Compiled {
        let alternatives = self.alternatives.clone();
        Compiled { alternatives, ..Compiled::with_jacobian(self.first.program.clone()) }
    }

    /// The same where runs may change to other independent variables.
    #[must_use]
    pub fn with_alternatives(self, alternatives: Arc<dyn Alternatives>) -> Compiled {
        let program = &self.first.program;
        let most = alternatives.most_states().filter(|most| program.states.len() < *most);
        let first = match most.filter(|_| !program.set_valued.is_empty()) {
            None => self.first,
            Some(most) => Arc::new(Mode::of(program.clone().with_idle_states(most), &self.first)),
        };
        Compiled { first, alternatives: Some(alternatives), others: self.others }
    }

    /// Whether runs may change to other independent variables.
    pub(super) fn has_alternatives(&self) -> bool {
        self.alternatives.is_some()
    }

    /// The mode in which a run begins.
    pub(super) fn first(&self) -> &Arc<Mode> {
        &self.first
    }

    pub(super) fn mode(&self, mode: ModeId) -> Arc<Mode> {
        match mode.0 {
            0 => self.first.clone(),
            number => self.others().modes[number as usize - 1].clone(),
        }
    }

    /// The mode in which these variables stay independent, made at a point if it is not there yet; the branches of set-valued
    /// laws are those of `present`.
    pub(super) fn with_independent(
        &self,
        present: &Mode,
        wanted: &[Symbol],
        point: &BTreeMap<Symbol, f64>,
    ) -> Option<ModeId> {
        let branches = present.program.branches();
        self.mode_of(Key { branches, independent: wanted.to_vec(), told: None }, point)
    }

    /// The mode with the branches of `present` in which these variables stay independent, made at the first of these points at
    /// which they can be. `None` if they can at none.
    pub(super) fn with_independent_near(
        &self,
        present: &Mode,
        wanted: &[Symbol],
        points: &[BTreeMap<Symbol, f64>],
    ) -> Option<ModeId> {
        let key = Key { branches: present.program.branches(), independent: wanted.to_vec(), told: None };
        if let Some(known) = self.others().of.get(&key) {
            return *known;
        }
        let alternatives = self.alternatives.as_ref()?;
        let made = points.iter().find_map(|point| {
            let program = self.fitting(alternatives.program(&key.branches, wanted, point).ok())?;
            let mut own: Vec<Symbol> = program.exchanges.independent.iter().map(|e| e.symbol).collect();
            own.sort_unstable();
            // Where nothing that is divided by varies no others can be independent, nor are any told.
            let exchanges = &present.program.exchanges;
            let known = || exchanges.independent.iter().chain(&exchanges.dependent);
            let told = |symbol: &Symbol| known().any(|e| e.symbol == *symbol && program.tracked.contains(&e.told_by));
            let fits = own == wanted || own.is_empty() && wanted.iter().all(told);
            fits.then_some(program)
        });
        self.added(key, made)
    }

    /// The mode in which the branches of `present` hold, these variables stay independent, and positions follow from others as
    /// is best at a point. `None` if they do so in `present`.
    pub(super) fn decided_at(
        &self,
        point: &BTreeMap<Symbol, f64>,
        present: &Mode,
        independent: Vec<Symbol>,
    ) -> Option<ModeId> {
        let branches = present.program.branches();
        let program = self.fitting(self.alternatives.as_ref()?.program(&branches, &independent, point).ok())?;
        if program.tracked == present.program.tracked {
            return None;
        }
        let key = Key { branches, independent, told: Some(program.tracked.clone()) };
        let known = self.others().of.get(&key).copied();
        known.unwrap_or_else(|| self.added(key, Some(program)))
    }

    /// The mode in which set-valued laws have these branches, made if it is not there yet.
    pub(super) fn in_mode(&self, branches: &[u32]) -> Option<ModeId> {
        if self.first.program.set_valued.iter().map(|law| law.present).eq(branches.iter().copied()) {
            return Some(ModeId::default());
        }
        let key = Key { branches: branches.to_vec(), independent: Vec::new(), told: None };
        self.mode_of(key, &BTreeMap::new())
    }

    /// The mode in which set-valued laws have these branches and the variables stay independent that `present` was entered
    /// with, where other ones than the first have taken over; made at a point if it is not there yet.
    pub(super) fn in_mode_from(
        &self,
        present: ModeId,
        branches: &[u32],
        point: &BTreeMap<Symbol, f64>,
    ) -> Option<ModeId> {
        let entered = |(key, mode): (&Key, &Option<ModeId>)| (*mode == Some(present)).then(|| key.independent.clone());
        let wanted = self.others().of.iter().find_map(entered).filter(|wanted| !wanted.is_empty());
        let key = |independent| Key { branches: branches.to_vec(), independent, told: None };
        let mode = wanted.and_then(|wanted| self.mode_of(key(wanted), point));
        mode.or_else(|| self.in_mode(branches))
    }

    /// Puts determinants of a mode where it was entered first in the place of those where it has been entered now.
    pub(super) fn compare_with(&self, mode: ModeId, now: &mut Vec<f64>) {
        let mut others = self.others();
        now.clone_from(others.determinants.entry(mode).or_insert_with(|| now.clone()));
    }

    fn mode_of(&self, key: Key, point: &BTreeMap<Symbol, f64>) -> Option<ModeId> {
        if let Some(known) = self.others().of.get(&key) {
            return *known;
        }
        let program = self.alternatives.as_ref()?.program(&key.branches, &key.independent, point);
        if let Err(why) = &program {
            self.others().without.insert(key.branches.clone(), why.clone());
        }
        let program = self.fitting(program.ok());
        self.added(key, program)
    }

    /// Why some branches of set-valued laws have no equations, of those that differ least from these.
    pub(super) fn why_without(&self, present: &[u32]) -> Option<(Vec<u32>, String)> {
        let others = self.others();
        let apart = |branches: &[u32]| branches.iter().zip(present).filter(|(a, b)| a != b).count();
        let without = others.without.iter().filter(|(branches, _)| branches[..] != *present);
        let nearest = without.min_by_key(|(branches, _)| apart(branches));
        nearest.map(|(branches, why)| (branches.clone(), why.clone()))
    }

    /// A program with as many states as all modes have; `None` if it does not fit.
    fn fitting(&self, program: Option<Program>) -> Option<Program> {
        let states = self.first.program.states.len();
        let fits = |p: &Program| p.states.len() == states || !p.set_valued.is_empty() && p.states.len() < states;
        match self.alternatives.as_ref()?.most_states() {
            Some(_) => program.filter(fits).map(|program| program.with_idle_states(states)),
            None => program,
        }
    }

    fn added(&self, key: Key, program: Option<Program>) -> Option<ModeId> {
        let mode = program.map(|program| Mode::of(program, &self.first));
        let mut others = self.others();
        let id = mode.map(|mode| {
            others.modes.push(Arc::new(mode));
            ModeId(others.modes.len() as u32)
        });
        others.of.insert(key, id);
        id
    }

    fn others(&self) -> std::sync::MutexGuard<'_, Others> {
        // What is in it is whole at any time.
        self.others.lock().unwrap_or_else(PoisonError::into_inner)
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
    /// The rates in turns, where equal cells make most of them; as soon as somebody has asked.
    pub rates_in_turns: OnceLock<Option<Arc<InTurns>>>,
    /// Computes the solutions of the Newton blocks that rates read, and no more, if there are any.
    pub solutions: Option<Routine>,
    /// The Jacobian of the rates, if it is computed at once.
    pub jacobian: Option<JacobianCode>,
    pub sparsity: Sparsity,
    /// Newton blocks of the rates that are solved together, and of the solutions.
    pub batches: Option<Arc<BlockBatches>>,
    pub solution_batches: Option<Arc<BlockBatches>>,
    /// Conditions of the state, whose operands are the event indicators.
    pub switching: Vec<ConditionId>,
    /// Computes these operands, and behind them the angles that they read.
    pub indicators: Routine,
    pub clock: Clock,
    /// Whether events move edges in time.
    pub moved_edges: bool,
    /// Computes what is delayed or sampled.
    pub sources: Routine,
    /// States that jump with a source, if there are any.
    pub kept: Option<ConservedSums>,
    pub clauses: Clauses,
    /// How storages change at events, where they do.
    pub impulses: Option<ImpulseBalance>,
    /// Constraints that events may break.
    pub positions: Option<PositionConstraints>,
    /// How the computed positions move that rates read.
    pub motion: Option<Motion>,
    /// Variables that could be independent in place of others, where some could.
    pub exchanges: Option<Ratios>,
    /// Where the branches of set-valued laws end.
    pub bounds: Option<Bounds>,
}

impl Mode {
    /// A program as code, with all derivatives at once where `other` has them.
    fn of(program: Program, other: &Mode) -> Mode {
        match other.jacobian {
            None => Mode::new(program, None, true),
            Some(_) => {
                let differentiated = program.jacobian();
                Mode::new(differentiated.program, Some(differentiated.entries), true)
            }
        }
    }

    /// `later`: runs change to it, and may leave it again.
    fn new(program: Program, entries: Option<Vec<JacobianEntry>>, later: bool) -> Mode {
        let derivatives = entries.iter().flatten().map(|e| e.value);
        let kept = program.position_relations.iter().flat_map(|r| r.values());
        // Where branches end, or others become independent, all variables of the graph are taken over into the next mode.
        let exchanged = !program.exchanges.independent.is_empty() || !program.positions.is_empty();
        let changes = later || !program.set_valued.is_empty() || exchanged;
        let carried = program.variables.values().copied().filter(|_| changes);
        let more: Vec<Value> = derivatives.chain(program.relations.values()).chain(kept).chain(carried).collect();
        let layout = Layout::new(&program, &more);
        let rates: Vec<Value> = program.states.iter().map(|s| s.rate).collect();
        let rates = layout.guarded_routine(&program, &rates);
        let sources: Vec<Value> = program.held.iter().map(|h| h.source).collect();
        let of_state = || program.conditions.iter().filter(|(_, c)| c.trigger == EventTrigger::State);
        let operands: Vec<Value> = of_state().map(|(_, c)| c.operand).collect();
        let angles = program.angles(&operands);
        let seen: Vec<Value> = program.states.iter().map(|s| s.rate).chain(operands.iter().copied()).collect();
        let assumed: Vec<Value> = program.assumptions.iter().flat_map(|a| [a.value, a.scale]).collect();
        let sparsity = sparsity_of(&program);
        let read: Vec<BlockId> = rates.solves.iter().map(|solve| solve.block).collect();
        let motion = Motion::of(&program, &layout, &read);
        let solutions = solutions_of(&program, &layout, &rates);
        let batches = |routine: &Routine| BlockBatches::of(&program, &layout, routine).map(Arc::new);
        Mode {
            preamble: layout.preamble(&program),
            assumed: layout.routine(&program, &assumed),
            jacobian: entries.map(|entries| JacobianCode::new(&program, &layout, &sparsity, &entries)),
            sparsity,
            batches: batches(&rates),
            solution_batches: solutions.as_ref().and_then(batches),
            rates,
            rates_in_turns: OnceLock::new(),
            solutions,
            switching: of_state().map(|(id, _)| id).collect(),
            indicators: layout.routine(&program, &[&operands[..], &angles].concat()),
            moved_edges: program.has_moved_edges(),
            clock: Clock::new(&program, &layout, &seen),
            sources: layout.routine(&program, &sources),
            kept: ConservedSums::of(&program, &layout),
            clauses: Clauses::of(&program, &layout),
            impulses: ImpulseBalance::of(&program, &layout),
            positions: PositionConstraints::of(&program, &layout),
            motion,
            exchanges: Ratios::of(&program, &layout),
            bounds: Bounds::of(&program, &layout),
            layout,
            program,
        }
    }

    /// The register of the number whose sign the condition of a clause is, if it is one of the state.
    pub fn sign_of(&self, clause: usize) -> Option<u32> {
        let Op::Sign(condition, _) = self.program.values.op(self.program.clauses[clause].trigger.value()) else {
            return None;
        };
        let place = self.switching.iter().position(|c| *c == condition)?;
        Some(self.indicators.outputs[place])
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
            .chain(self.positions.as_ref().map(PositionConstraints::routine))
            .chain(self.motion.as_ref().map(|motion| &motion.rates))
            .chain(&self.solutions)
            .chain(self.exchanges.iter().flat_map(Ratios::routines))
            .chain(self.bounds.iter().flat_map(Bounds::routines));
        [rates, preamble, assumed, sources, indicators].into_iter().chain(clock.routines()).chain(more)
    }
}

/// What computes the unknowns of the Newton blocks of a routine, if it has any.
fn solutions_of(program: &Program, layout: &Layout, rates: &Routine) -> Option<Routine> {
    let newton: Vec<BlockId> = rates.solves.iter().filter(|s| !s.guess.is_empty()).map(|s| s.block).collect();
    (!newton.is_empty()).then(|| layout.routine(program, &program.unknowns_of(&newton)))
}

fn sparsity_of(program: &Program) -> Sparsity {
    let mut columns = vec![Vec::new(); program.states.len()];
    for (row, reads) in program.dependence.iter().enumerate() {
        reads.iter().for_each(|&column| columns[column as usize].push(row));
    }
    Sparsity::from_columns(columns)
}
