//! What a run remembers.

use super::Model;
use super::clause_memory::ClauseMemory;
use super::clauses::Return;
use super::compiled::ModeId;
use super::exchanges::Steepest;
use super::history::{Delay, Sample};
use super::inputs::PointRange;
use super::modes::Extents;
use super::projection::Kept;
use crate::bytecode::{Followed, HeldConditions};
use halfarrow_compiler::bond_graph::HeldKind;

/// What a run remembers beside its state: signs of event indicators, solutions that nonlinear laws follow, histories of delays
/// and samples, intervals of input tables, the constants that its start has fixed.
///
/// A model with the same setup goes on from it with the same bits, in the run that it was taken from or in another one.
#[derive(Debug, Clone, PartialEq)]
pub struct Memory {
    /// What the model keeps by itself.
    run: Remembered,
    /// What the code keeps.
    conditions: HeldConditions,
    solutions: Vec<Followed>,
}

impl Memory {
    /// The mode that the run is in.
    pub fn mode(&self) -> ModeId {
        self.run.mode
    }
}

/// What a run remembers, but for what the code keeps at hand.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Remembered {
    pub mode: ModeId,
    /// Whether the run has begun: conditions are held.
    pub begun: bool,
    /// When the last event was handled, in s.
    pub crossed: f64,
    /// When the signs of event indicators were taken last.
    pub signs_taken: Option<f64>,
    /// When time moves a condition next, in s.
    pub clock_event: Option<f64>,
    /// The longest step that shows how sources swing, in s.
    pub longest_step: f64,
    /// Values of the conserved constants.
    pub conserved: Vec<f64>,
    /// Values of the positions that iterations determine, as the last start has found them.
    pub positions: Vec<f64>,
    /// These constants, positions and magnitudes of the first mode, in a run that has left it.
    pub first: Option<[Vec<f64>; 3]>,
    /// Typical magnitudes of the states.
    pub scales: Vec<f64>,
    pub delays_and_samples: Vec<DelayOrSample>,
    /// Of each clause of the program.
    pub clauses: Vec<ClauseMemory>,
    /// How great margins of set-valued laws have been.
    pub extents: Extents,
    /// Of each condition the magnitude below which its operand is on the side that is held.
    pub floors: Vec<f64>,
    /// What ratios between variables were divided by when it was last seen whether others should be independent.
    pub pivots: Vec<f64>,
    /// The greatest of these ratios then.
    pub steepest: Option<Steepest>,
    /// For each block of computed positions the greatest determinant of its equations since it was looked at, as a logarithm.
    pub determinants: Vec<f64>,
    /// What relations between positions keep.
    pub kept: Kept,
    /// Conditions that have made something happen and are about to hold no longer.
    pub returns: Vec<Return>,
    /// The piece of each input that holds.
    pub pieces: Vec<Option<PointRange>>,
}

/// The memory of a signal that is held from earlier times.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum DelayOrSample {
    Delay(Delay),
    Sample(Sample),
    /// What an event has set last.
    Discrete(f64),
}

impl Model {
    /// What the run remembers, to go on from later: see [`restore`](Model::restore).
    pub fn memory(&self) -> Memory {
        Memory {
            run: self.run.clone(),
            conditions: self.frame.conditions.held(),
            solutions: self.frame.solvers.iter().map(|solver| solver.newton.followed()).collect(),
        }
    }

    /// Goes on from what a run of this model remembered. Parameters, inputs and what is recorded stay as they are.
    ///
    /// # Panics
    /// If it is the memory of another model.
    pub fn restore(&mut self, memory: &Memory) {
        if self.run.mode != memory.run.mode {
            self.enter(memory.run.mode).expect("the mode has run with these parameters");
        }
        assert!(self.frame.solvers.len() == memory.solutions.len(), "the memory of another model");
        self.run.clone_from(&memory.run);
        self.frame.conditions.hold_again(&memory.conditions);
        self.frame.solvers.iter_mut().zip(&memory.solutions).for_each(|(solver, from)| solver.newton.follow_from(from));
        self.rated = None;
        self.place_constant_inputs();
    }

    /// Any solution of laws may come next.
    pub(super) fn leave_solutions(&mut self) {
        self.frame.solvers.iter_mut().for_each(|s| s.newton.leave());
    }

    /// Forgets the solutions of laws; positions are sought from where the start has found them.
    pub(super) fn forget_solutions(&mut self) {
        self.frame.solvers.iter_mut().for_each(|s| s.newton.forget());
        self.start_at_positions();
    }

    /// Positions are sought from where the start has found them.
    pub(super) fn start_at_positions(&mut self) {
        let Model { run, frame, code, .. } = self;
        for (position, &value) in code.program.positions.iter().zip(&run.positions) {
            let newton = &mut frame.solvers[position.block.0 as usize].newton;
            newton.start_at(position.unknown as usize, value);
        }
    }

    /// The next solution of a block of laws starts where its unknown `i` has this value.
    pub(super) fn start_solution(&mut self, block: usize, i: usize, value: f64) {
        self.frame.solvers[block].newton.start_at(i, value);
    }

    /// Whether a block is solved by Newton and has an unknown `i`.
    pub(super) fn is_unknown(&self, block: usize, i: usize) -> bool {
        self.frame.solvers[block].newton.previous.len() > i
    }

    /// Delays, samples and discrete variables as they are before a run.
    pub(super) fn empty_delays_and_samples(&self) -> Vec<DelayOrSample> {
        let code = &self.code;
        let time = |i: usize| code.layout.registers.get(code.program.held[i].time).map(|r| self.frame.r[r as usize]);
        let start = |i: usize| {
            let register = code.layout.registers.get(code.program.held[i].source);
            register.map_or(0.0, |register| self.frame.r[register as usize])
        };
        let held = code.program.held.iter().enumerate().map(|(i, h)| {
            let time = time(i).unwrap_or(f64::NAN);
            match h.kind {
                HeldKind::Delay => DelayOrSample::Delay(Delay::new(time)),
                HeldKind::Sample => DelayOrSample::Sample(Sample::new(time)),
                HeldKind::Discrete | HeldKind::Impulse => DelayOrSample::Discrete(start(i)),
            }
        });
        held.collect()
    }
}
