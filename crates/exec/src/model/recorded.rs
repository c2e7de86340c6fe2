//! What a run records, and the code for it.

use super::compiled::Mode;
use super::positions::Motion;
use super::{Model, RecordError};
use crate::bytecode::{BlockBatches, Routine};
use halfarrow_compiler::bond_graph::HeldKind;
use halfarrow_compiler::program::{BlockId, Op, Value};
use rustc_hash::{FxHashMap, FxHashSet};
use std::sync::Arc;

/// A choice of what is recorded. Never changed; shared by copies of a model.
#[derive(Debug, Clone, Default)]
pub(super) struct Recorded {
    /// Indices into the program's observed values.
    pub chosen: Vec<usize>,
    pub routine: Routine,
    /// Newton blocks of it that are solved together.
    pub batches: Option<Arc<BlockBatches>>,
    /// Newton blocks that it needs and no rate does.
    pub blocks: Vec<BlockId>,
    /// How the positions among their unknowns move.
    pub motion: Option<Motion>,
}

impl Recorded {
    pub fn new(mode: &Mode, chosen: Vec<usize>) -> Recorded {
        let value = |&i: &usize| mode.program.observed[i].value.clone().ok();
        let wanted: Vec<Value> = chosen.iter().filter_map(value).collect();
        let routine = mode.layout.guarded_routine(&mode.program, &wanted);
        let of_rates: FxHashSet<BlockId> = mode.rates.solves.iter().map(|s| s.block).collect();
        let newton = routine.solves.iter().filter(|s| !s.guess.is_empty()).map(|s| s.block);
        let blocks: Vec<BlockId> = newton.filter(|block| !of_rates.contains(block)).collect();
        let motion = Motion::of(&mode.program, &mode.layout, &blocks);
        let batches = BlockBatches::of(&mode.program, &mode.layout, &routine).map(Arc::new);
        Recorded { chosen, routine, batches, blocks, motion }
    }

    /// What is recorded where nothing is asked for.
    pub fn by_default(mode: &Mode) -> Recorded {
        let defaults = mode.program.observed.iter().enumerate().filter(|(_, o)| o.default && o.value.is_ok());
        Recorded::new(mode, defaults.map(|(i, _)| i).collect())
    }
}

impl Model {
    /// Chooses what is recorded, in this order.
    ///
    /// # Errors
    /// The first name that is unknown or has no value.
    pub fn record(&mut self, names: &[&str]) -> Result<(), RecordError> {
        let observed = &self.code.program.observed;
        let mut index_of: FxHashMap<&str, usize> = FxHashMap::default();
        observed.iter().enumerate().for_each(|(i, o)| _ = index_of.entry(&*o.name).or_insert(i));
        let mut chosen = Vec::with_capacity(names.len());
        for &name in names {
            let index = index_of.get(name).or_else(|| index_of.get(with_letters(name).as_str()));
            let index = *index.ok_or_else(|| RecordError::Unknown(name.to_string()))?;
            if let Err(why) = &observed[index].value {
                return Err(RecordError::Unavailable(name.to_string(), why.clone()));
            }
            chosen.push(index);
        }
        self.take_recorded(Recorded::new(&self.code, chosen));
        Ok(())
    }

    /// Chooses what is recorded, by indices of what has a value into
    /// [`Program::observed`](halfarrow_compiler::program::Program).
    pub fn record_these(&mut self, observed: Vec<usize>) {
        self.take_recorded(Recorded::new(&self.code, observed));
    }

    /// Everything that has a value, in the order of the program.
    pub fn record_all(&mut self) {
        let available = self.code.program.observed.iter().enumerate().filter(|(_, o)| o.value.is_ok());
        self.record_these(available.map(|(i, _)| i).collect());
    }

    /// Records what tells the impulses of resets too, behind everything else.
    pub fn record_impulses(&mut self) {
        let program = &self.code.program;
        let tells = |value: Value| match program.values.op(value) {
            Op::Held(held) => program.held[held as usize].kind == HeldKind::Impulse,
            _ => false,
        };
        let known = &self.recorded.chosen;
        let all = program.observed.iter().enumerate().filter(|(_, o)| o.value.as_ref().is_ok_and(|&v| tells(v)));
        let more: Vec<usize> = all.map(|(i, _)| i).filter(|i| !known.contains(i)).collect();
        if !more.is_empty() {
            self.take_recorded(Recorded::new(&self.code, [&known[..], &more].concat()));
        }
    }

    /// Indices into [`Program::observed`](halfarrow_compiler::program::Program) of what is recorded.
    pub fn recorded(&self) -> &[usize] {
        &self.recorded.chosen
    }

    /// Makes room for it; what ran as machine code does so again.
    fn take_recorded(&mut self, recorded: Recorded) {
        self.recorded = Arc::new(recorded);
        self.reserve_recorded();
        self.recorded_anew();
    }

    pub(super) fn reserve_recorded(&mut self) {
        self.frame.reserve(&self.recorded.routine);
        self.recorded.motion.iter().for_each(|motion| self.frame.reserve(&motion.rates));
        let Mode { batches, solution_batches, .. } = &*self.code;
        for batches in [batches, solution_batches, &self.recorded.batches].into_iter().flatten() {
            self.frame.reserve_batches(batches);
        }
    }
}

/// A name with its strands by their letters: `body.v[2].f` is `body.v.y.f` where a multibond is no wider than three.
fn with_letters(name: &str) -> String {
    ["x", "y", "z"]
        .iter()
        .enumerate()
        .fold(name.to_string(), |name, (at, letter)| name.replace(&format!("[{}]", at + 1), &format!(".{letter}")))
}
