//! Constraints on displacements, which hold after an event as before it.

use super::Model;
use crate::bytecode::{Layout, Routine};
use halfarrow_compiler::program::{BlockId, Program, Value};
use halfarrow_sim::Failure;
use std::ops::Range;

/// How far a constraint may be missed after an event, as part of its terms, if it was not before.
const MISSED: f64 = 1e-9;

/// The constraints on displacements as code: what vanishes.
#[derive(Debug, Clone)]
pub(super) struct PositionConstraints {
    residuals: Routine,
    names: Vec<String>,
    /// The states that each reads.
    reads: Vec<Vec<u32>>,
}

impl PositionConstraints {
    /// `None` where there are none, or no event that could move a position.
    pub fn of(program: &Program, layout: &Layout) -> Option<PositionConstraints> {
        let firm: Vec<_> = program.constraints_on_states().map(|(_, c)| c).collect();
        let residuals: Vec<Value> = firm.iter().map(|c| c.residual).collect();
        let moved = program.clauses.iter().any(|c| !c.actions.is_empty());
        let states = program.states.len() as u32;
        let reads = |reads: &[u32]| reads.iter().copied().filter(|u| *u < states).collect();
        (moved && !firm.is_empty()).then(|| PositionConstraints {
            residuals: layout.routine(program, &residuals),
            names: firm.iter().map(|c| c.name.clone()).collect(),
            reads: firm.iter().map(|c| reads(&c.reads)).collect(),
        })
    }

    pub fn routine(&self) -> &Routine {
        &self.residuals
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.names.len()
    }
}

/// How computed positions move: from step to step they are sought where that leads.
#[derive(Debug, Clone)]
pub(super) struct Motion {
    /// The blocks whose unknowns they are, and where their rates stand among the outputs.
    pub blocks: Vec<(BlockId, Range<usize>)>,
    pub rates: Routine,
    /// The blocks whose positions move no state.
    pub idle: Vec<BlockId>,
}

impl Motion {
    /// Of these blocks; `None` where there are none whose rates are known.
    pub fn of(program: &Program, layout: &Layout, blocks: &[BlockId]) -> Option<Motion> {
        let followed = program.motion_blocks(blocks);
        if followed.is_empty() {
            return None;
        }
        let of_states = program.routine(&program.states.iter().map(|s| s.rate).collect::<Vec<Value>>());
        let moves = |block: &BlockId| of_states.code.solves().any(|solve| solve.block == *block);
        let idle = followed.iter().filter(|block| !moves(block)).copied().collect();
        let rates = layout.routine(program, &program.rates_of_positions(&followed));
        let mut next = 0;
        let places = followed.into_iter().map(|id| {
            let first = next;
            next += program.blocks[id].size();
            (id, first..next)
        });
        Some(Motion { blocks: places.collect(), rates, idle })
    }
}

impl Model {
    /// Keeps in mind by how much each constraint on displacements is missed.
    pub(super) fn take_misses(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        let code = self.code.clone();
        let Some(constraints) = &code.positions else { return Ok(()) };
        self.miss_positions(t, x, constraints)?;
        let Model { events, frame, .. } = self;
        let outputs = constraints.residuals.outputs.iter();
        events.misses.iter_mut().zip(outputs).for_each(|(miss, &r)| *miss = frame.r[r as usize].abs());
        Ok(())
    }

    fn miss_positions(&mut self, t: f64, x: &[f64], constraints: &PositionConstraints) -> Result<(), Failure> {
        self.place(t, x);
        self.frame.run(&constraints.residuals).map_err(|error| self.failure(t, error))
    }

    /// Refuses new positions that a constraint does not allow.
    pub(super) fn refuse_broken_positions(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        let code = self.code.clone();
        let Some(constraints) = &code.positions else { return Ok(()) };
        let fits = |after: f64, before: f64, size: f64| after <= 2.0 * before + MISSED * size;
        for (i, &output) in constraints.residuals.outputs.iter().enumerate() {
            self.miss_positions(t, x, constraints)?;
            let (after, before) = (self.frame.r[output as usize].abs(), self.events.misses[i]);
            if fits(after, before, 0.0) {
                continue;
            }
            let mut size = 0.0;
            for &state in &constraints.reads[i] {
                self.place(t, x);
                self.still();
                self.frame.d[(self.code.layout.states + state) as usize] = 1.0;
                self.frame.run_along(&constraints.residuals).map_err(|error| self.failure(t, error))?;
                size += (self.frame.d[output as usize] * x[state as usize]).abs();
            }
            if !fits(after, before, size) {
                let name = &constraints.names[i];
                let reason = format!(
                    "the constraint {name} is missed by {after:.3e} then; reset all positions that it reads, so that they fit \
                     each other"
                );
                return Err(Failure::Reset { time: t, what: self.what_is_reset(), reason });
            }
        }
        Ok(())
    }
}
