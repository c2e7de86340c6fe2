//! What a Newton block remembers, and what it works with.

use crate::bytecode::floating::Floating;

/// Evaluations of a block at most at the start and after jumps.
const MOST_AT_START: usize = 20_000;
/// Evaluations of a block at most at any other time, unless a bound is set.
pub(crate) const MOST: usize = 2_000;

/// Memory and working space of a Newton block.
#[derive(Debug, Clone)]
pub(crate) struct Newton {
    /// Where the next solution starts: part of the model's state.
    pub memory: Vec<f64>,
    /// Whether the memory is an accepted solution, which is followed.
    pub following: bool,
    /// Counts the changes of the memory, from 1 on.
    pub(in crate::bytecode) version: u64,
    /// What the block read there, and its Jacobian, row by row: part of the model's state too.
    pub(super) outer_memory: Vec<f64>,
    pub(in crate::bytecode) jacobian_memory: Vec<f64>,
    /// The last solution found, what the block read there, and its Jacobian.
    pub x: Vec<f64>,
    pub(in crate::bytecode) outer: Vec<f64>,
    pub(in crate::bytecode) jacobian: Vec<f64>,
    /// Whether these go on from the present memory, with the present parameters and conditions.
    pub fresh: bool,
    /// Evaluations at most while following.
    pub(in crate::bytecode) most: usize,
    pub(in crate::bytecode) evaluations: usize,
    pub(super) step: Vec<f64>,
    pub(super) trial: Vec<f64>,
    pub(in crate::bytecode) next: Vec<f64>,
    /// Greatest magnitude of each unknown so far.
    pub(super) size: Vec<f64>,
    /// Magnitudes below which unknowns are rounding; 0 unless a solution is sought that is not found without them.
    pub(in crate::bytecode) floor: Vec<f64>,
    /// What is subtracted from the residuals on the way from a point where they do not vanish.
    pub(in crate::bytecode) offset: Vec<f64>,
    pub(super) first: Vec<f64>,
    /// Where the attempt began: the last root on the way.
    pub(in crate::bytecode) kept: Vec<f64>,
    /// Where the attempt began, while another way is looked at.
    pub(super) began: Vec<f64>,
    /// The first step of the attempt: to first order the change of the solution.
    pub(super) lead: Vec<f64>,
    /// Residuals where the attempt began, with the sign of a right-hand side.
    pub(super) opening: Vec<f64>,
    /// The Jacobian of the root at which the attempt began, if it began at one.
    pub(super) base: Vec<f64>,
    /// Magnitudes of the unknowns at the memory and where the attempt from there led.
    pub(in crate::bytecode) span: Vec<f64>,
    /// Whether the first step, taken whole, left little to do.
    pub(super) near: bool,
    /// What nothing tells.
    pub floating: Floating,
}

/// What a Newton block remembers of a run.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Followed {
    memory: Vec<f64>,
    following: bool,
    /// What the block read at the accepted solution, and its Jacobian there.
    outer: Vec<f64>,
    jacobian: Vec<f64>,
    /// Unknowns that have floated.
    floated: Vec<bool>,
}

impl Newton {
    pub fn new(size: usize) -> Newton {
        let (line, square) = (vec![0.0; size], vec![0.0; size * size]);
        Newton {
            memory: line.clone(),
            version: 1,
            following: false,
            outer_memory: Vec::new(),
            jacobian_memory: square.clone(),
            x: line.clone(),
            outer: Vec::new(),
            jacobian: square.clone(),
            fresh: false,
            most: MOST,
            evaluations: 0,
            step: line.clone(),
            trial: line.clone(),
            next: line.clone(),
            size: line.clone(),
            floor: line.clone(),
            offset: line.clone(),
            first: line.clone(),
            kept: line.clone(),
            began: line.clone(),
            lead: line.clone(),
            opening: line.clone(),
            span: line,
            base: square,
            near: false,
            floating: Floating::new(size),
        }
    }

    /// Makes room for so many values that the block reads.
    pub fn reserve(&mut self, outer: usize) {
        self.outer.resize(outer, 0.0);
        self.outer_memory.resize(outer, 0.0);
    }

    /// Forgets the run.
    pub fn forget(&mut self) {
        self.memory.fill(0.0);
        self.version += 1;
        self.floating.ever.fill(false);
        self.leave();
    }

    /// Any solution may come next.
    pub fn leave(&mut self) {
        (self.following, self.fresh) = (false, false);
    }

    /// The next solution starts where unknown `i` has this value.
    pub fn start_at(&mut self, i: usize, value: f64) {
        (self.memory[i], self.fresh) = (value, false);
        self.version += 1;
    }

    /// Evaluations at most while following.
    pub fn bound(&mut self, most: usize) {
        (self.most, self.fresh) = (most, false);
    }

    /// Goes on with the solution found last.
    pub fn accept(&mut self) {
        self.version += 1;
        self.floating.accept();
        self.memory.copy_from_slice(&self.x);
        self.outer_memory.copy_from_slice(&self.outer);
        self.jacobian_memory.copy_from_slice(&self.jacobian);
        (self.following, self.fresh) = (true, false);
    }

    /// What it remembers of the run.
    pub fn followed(&self) -> Followed {
        Followed {
            memory: self.memory.clone(),
            following: self.following,
            outer: self.outer_memory.clone(),
            jacobian: self.jacobian_memory.clone(),
            floated: self.floating.ever.clone(),
        }
    }

    /// Goes on from what it remembered.
    pub fn follow_from(&mut self, from: &Followed) {
        self.version += 1;
        self.memory.copy_from_slice(&from.memory);
        self.outer_memory.copy_from_slice(&from.outer);
        self.jacobian_memory.copy_from_slice(&from.jacobian);
        self.floating.ever.copy_from_slice(&from.floated);
        (self.following, self.fresh) = (from.following, false);
    }

    pub(super) fn limit(&self) -> usize {
        if self.following { self.most } else { MOST_AT_START }
    }

    pub(in crate::bytecode) fn exhausted(&self) -> bool {
        self.evaluations >= self.limit()
    }
}
