//! The state and the workspace of a Newton block.

use super::positions::Motion;
use crate::bytecode::floating::Floating;

/// Evaluations of a block at most at the start and after jumps.
const EVALUATIONS_AT_START: usize = 20_000;
/// Evaluations of a block at most at any other time, unless a bound is set.
pub(crate) const EVALUATIONS: usize = 2_000;

/// State and workspace of a Newton block. Vectors have one entry per unknown, matrices those of the pattern.
#[derive(Debug, Clone)]
pub(crate) struct Newton {
    /// The previous solution, from which the next one starts: part of the model's state.
    pub previous: Vec<f64>,
    /// Whether it is an accepted solution, which is followed.
    pub following: bool,
    /// Whether it solves the equations where the block reads what it read there, with the present parameters and whatever
    /// conditions.
    settled: bool,
    /// Counts its changes, from 1 on.
    pub(in crate::bytecode) version: u64,
    /// What the block read there, and its Jacobian: part of the model's state too.
    pub(in crate::bytecode) previous_outer: Vec<f64>,
    pub(in crate::bytecode) previous_jacobian: Vec<f64>,
    /// The last solution found, what the block read there, and its Jacobian.
    pub x: Vec<f64>,
    pub(in crate::bytecode) outer: Vec<f64>,
    pub(in crate::bytecode) jacobian: Vec<f64>,
    /// Whether these continue the previous solution as it is, with the present parameters and conditions.
    pub fresh: bool,
    /// Evaluations at most while following.
    pub(in crate::bytecode) evaluation_limit: usize,
    pub(in crate::bytecode) evaluations: usize,
    /// The Newton correction at `x`.
    pub(super) correction: Vec<f64>,
    /// The point that is tried.
    pub(super) trial: Vec<f64>,
    /// The simplified correction at the trial point; right-hand sides elsewhere.
    pub(in crate::bytecode) simplified: Vec<f64>,
    /// Scale of norms: greatest magnitude of each unknown so far.
    pub(super) scale: Vec<f64>,
    /// The inverse of the scale of each unknown, or of its correction where that is greater.
    pub(super) weight: Vec<f64>,
    /// Least scales, below which unknowns are rounding; 0 unless a solution is sought that is not found without them.
    pub(in crate::bytecode) floor: Vec<f64>,
    /// What is subtracted from the residuals: the Newton homotopy `F(x) = (1 - s) F(previous)`.
    pub(in crate::bytecode) offset: Vec<f64>,
    /// Residuals at the previous solution.
    pub(super) previous_residual: Vec<f64>,
    /// Where the iteration starts: the last root on the path.
    pub(in crate::bytecode) start: Vec<f64>,
    /// The start, while another path is looked at.
    pub(super) saved_start: Vec<f64>,
    /// The first correction: to first order the change of the solution.
    pub(super) first_correction: Vec<f64>,
    /// Its right-hand side.
    pub(super) first_right: Vec<f64>,
    /// The Jacobian at the start, if that is a root.
    pub(super) start_jacobian: Vec<f64>,
    /// Magnitudes of the unknowns: the previous solution, or where the iteration from there led.
    pub(in crate::bytecode) magnitude: Vec<f64>,
    /// Whether the factors at hand are those of the first correction.
    pub(super) first_factors: bool,
    /// Whether the root is where the iteration began, but for a first correction that is rounding.
    pub(super) rests: bool,
    /// Whether the first step, undamped, contracted by [`CONTRACTION`](super::CONTRACTION).
    pub(super) contracts: bool,
    /// Whether its unknowns are positions that constraints determine.
    pub(in crate::bytecode) positions: bool,
    /// Of positions: how they move at the previous solution, and where that leads.
    pub motion: Motion,
    pub(super) expected: Vec<f64>,
    /// Whether the last way of positions was short.
    pub(super) short: bool,
    /// Whether the way was a small part of the distance from where the Jacobian is singular.
    pub(super) regular: bool,
    /// Whether the laws had a value where an iteration began, since a root is sought.
    pub(super) valued: bool,
    /// Unknowns that no equation determines.
    pub floating: Floating,
}

/// The state of a Newton block in a run.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Followed {
    motion: Motion,
    previous: Vec<f64>,
    following: bool,
    settled: bool,
    /// What the block read at the accepted solution, and its Jacobian there.
    outer: Vec<f64>,
    jacobian: Vec<f64>,
    /// Unknowns that have floated.
    floated: Vec<bool>,
}

impl Newton {
    /// Room for so many unknowns and entries of the Jacobian, which is factored as a sparse matrix or not.
    pub fn new(size: usize, entries: usize, sparse: bool) -> Newton {
        let (line, matrix) = (vec![0.0; size], vec![0.0; entries]);
        Newton {
            previous: line.clone(),
            expected: line.clone(),
            short: true,
            regular: false,
            version: 1,
            following: false,
            settled: false,
            previous_outer: Vec::new(),
            previous_jacobian: matrix.clone(),
            x: line.clone(),
            outer: Vec::new(),
            jacobian: matrix.clone(),
            fresh: false,
            evaluation_limit: EVALUATIONS,
            evaluations: 0,
            correction: line.clone(),
            trial: line.clone(),
            simplified: line.clone(),
            scale: line.clone(),
            weight: line.clone(),
            floor: line.clone(),
            offset: line.clone(),
            previous_residual: line.clone(),
            start: line.clone(),
            saved_start: line.clone(),
            first_correction: line.clone(),
            first_right: line.clone(),
            magnitude: line,
            start_jacobian: matrix,
            positions: false,
            motion: Motion::default(),
            first_factors: false,
            rests: false,
            contracts: false,
            valued: false,
            floating: Floating::new(size, sparse),
        }
    }

    /// Makes room for so many values that the block reads.
    pub fn reserve(&mut self, outer: usize) {
        self.outer.resize(outer, 0.0);
        self.previous_outer.resize(outer, 0.0);
    }

    /// Forgets the run.
    pub fn forget(&mut self) {
        self.previous.fill(0.0);
        self.version += 1;
        self.floating.ever.fill(false);
        self.settled = false;
        self.leave();
    }

    /// Any solution may come next.
    pub fn leave(&mut self) {
        (self.following, self.fresh, self.motion.known) = (false, false, false);
    }

    /// The next solution starts where unknown `i` has this value.
    pub fn start_at(&mut self, i: usize, value: f64) {
        (self.previous[i], self.fresh, self.settled) = (value, false, false);
        self.version += 1;
    }

    /// Evaluations at most while following.
    pub fn bound(&mut self, most: usize) {
        (self.evaluation_limit, self.fresh) = (most, false);
    }

    /// Evaluations at most while following.
    pub fn most(&self) -> usize {
        self.evaluation_limit
    }

    /// The solution found last becomes the previous one, and is followed.
    pub fn accept(&mut self) {
        self.version += 1;
        self.floating.accept();
        if self.motion.known {
            self.motion.left.clone_from(&self.previous);
        }
        self.previous.copy_from_slice(&self.x);
        self.previous_outer.copy_from_slice(&self.outer);
        self.previous_jacobian.copy_from_slice(&self.jacobian);
        // Where the block reads the same, it goes on from itself; positions are refined, and their way is looked at, once
        // more where the Jacobian may be singular near by.
        let settled = self.fresh && (self.regular || !self.positions);
        (self.following, self.settled, self.fresh, self.short) = (true, settled, settled, true);
    }

    /// The state, to be restored.
    pub fn followed(&self) -> Followed {
        Followed {
            motion: self.motion.clone(),
            previous: self.previous.clone(),
            following: self.following,
            settled: self.settled,
            outer: self.previous_outer.clone(),
            jacobian: self.previous_jacobian.clone(),
            floated: self.floating.ever.clone(),
        }
    }

    /// Restores a state.
    pub fn follow_from(&mut self, from: &Followed) {
        self.version += 1;
        self.motion.clone_from(&from.motion);
        self.previous.copy_from_slice(&from.previous);
        self.previous_outer.copy_from_slice(&from.outer);
        self.previous_jacobian.copy_from_slice(&from.jacobian);
        self.floating.ever.copy_from_slice(&from.floated);
        (self.following, self.settled, self.fresh) = (from.following, from.settled, false);
    }

    /// Whether the block, which reads these values, reads what it read at the previous solution, and that is one.
    #[inline]
    pub(in crate::bytecode) fn rests(&self, reads: impl Iterator<Item = f64>) -> bool {
        self.settled && self.previous_outer.iter().zip(reads).all(|(before, now)| before.to_bits() == now.to_bits())
    }

    /// The previous solution is the one found.
    pub(super) fn rest(&mut self) {
        self.x.copy_from_slice(&self.previous);
        self.outer.copy_from_slice(&self.previous_outer);
        self.jacobian.copy_from_slice(&self.previous_jacobian);
        self.floating.now.fill(false);
        (self.evaluations, self.fresh, self.short, self.regular) = (0, true, true, true);
    }

    /// The next iteration starts at the previous solution.
    pub(super) fn start_at_previous(&mut self) {
        self.offset.fill(0.0);
        self.start.copy_from_slice(&self.previous);
        self.start_jacobian.copy_from_slice(&self.previous_jacobian);
    }

    pub(super) fn limit(&self) -> usize {
        if self.following { self.evaluation_limit } else { EVALUATIONS_AT_START }
    }

    pub(in crate::bytecode) fn exhausted(&self) -> bool {
        self.evaluations >= self.limit()
    }
}
