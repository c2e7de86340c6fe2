//! Relations between positions that only speeds keep, onto which positions are put back.

use halfarrow_compiler::program::{PositionRelation, Routine};

use super::Plan;
use crate::c::cost::OperationCount;

/// Iterations of a projection, and evaluations of the relations at most.
const ITERATIONS: u64 = 12;
const EVALUATIONS: u64 = ITERATIONS + 2;

impl Plan<'_> {
    /// The relations, if positions are put back.
    pub(in crate::c) fn relations(&self) -> &[PositionRelation] {
        if self.export.project { &self.program.position_relations } else { &[] }
    }

    /// What computes them.
    pub(super) fn relations_routine(&self) -> Routine {
        self.program.routine(&self.relations().iter().flat_map(PositionRelation::values).collect::<Vec<_>>())
    }

    /// Where the value of each relation stands among what is computed; its slopes follow.
    fn relation_starts(&self) -> Vec<usize> {
        let mut starts = vec![0];
        for relation in self.relations() {
            starts.push(starts[starts.len() - 1] + 1 + relation.slopes.len());
        }
        starts
    }

    /// How many numbers are computed.
    pub(in crate::c) fn relation_values(&self) -> usize {
        self.relation_starts().last().copied().unwrap_or(0)
    }

    /// Words of the runtime: how many there are.
    pub(super) fn relation_sizes(&self) -> [(&'static str, usize); 2] {
        [("RELATIONS", self.relations().len()), ("RELATION_OUT", self.relation_values())]
    }

    /// Words of the runtime: tables.
    pub(super) fn relation_words(&self) -> [(&'static str, Vec<String>); 3] {
        let states = self.relations().iter().flat_map(|r| r.slopes.iter().map(|s| s.0.to_string()));
        let vanishes = self.relations().iter().map(|r| u8::from(r.vanishes).to_string());
        [
            ("RELATION_STARTS", self.relation_starts().iter().map(usize::to_string).collect()),
            ("RELATION_STATES", states.collect()),
            ("RELATION_VANISHES", vanishes.collect()),
        ]
    }

    /// What putting back takes at most at the end of a step.
    pub(super) fn putting_back(&self) -> OperationCount {
        let (rows, states) = (self.relations().len() as u64, self.program.states.len() as u64);
        if rows == 0 {
            return OperationCount::default();
        }
        let mut all = OperationCount::of(self.program, &self.relations_routine().code) * EVALUATIONS;
        // Rows are weighed, measured once for each that is taken, and made orthogonal twice.
        all.operations += ITERATIONS * rows * states * (6 + 2 * rows + 8 * rows) + EVALUATIONS * 6 * rows * states;
        all.divisions += ITERATIONS * (2 * rows * states + rows * (rows + 3));
        all
    }
}
