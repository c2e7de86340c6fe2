//! States that stand still: modes of one model have vectors of states of one length.

use super::op::{Bits, Op};
use super::{Program, Reads, State};

impl Program {
    /// The same with states behind the others that stand still at 0, until it has so many.
    #[must_use]
    pub fn with_idle_states(mut self, states: usize) -> Program {
        let own = self.states.len();
        let Some(idle) = states.checked_sub(own).filter(|idle| *idle > 0) else { return self };
        let rate = self.values.add(Op::Constant(Bits::of(0.0)), Reads::PARAMETERS);
        for number in 0..idle {
            self.states.push(State { name: format!("idle {}", number + 1), rate, unit: None });
            self.dependence.push(Vec::new());
        }
        // Conserved constants and positions are counted behind all states.
        let behind = |unknown: &mut u32| *unknown += if *unknown as usize >= own { idle as u32 } else { 0 };
        self.start.iter_mut().flat_map(|c| &mut c.reads).for_each(behind);
        self.guesses.iter_mut().flat_map(|g| g.reads.iter_mut().chain([&mut g.unknown])).for_each(behind);
        self.jumps.iter_mut().flat_map(|j| &mut j.unknowns).for_each(behind);
        self
    }
}
