//! Newton's method for a solve block: damped by the natural test, exact Jacobian, to rounding.
//!
//! A law may have several solutions. At the start of a run, and after a jump, any of them may be taken: the one that the
//! equations lead to from the last one, else the first one found. From then on it is *followed*: a solution counts as
//! the same only if the equations run straight towards it from the one accepted last, without a fold or a pole on the
//! way. What Newton finds elsewhere is not taken. So rates are those of one solution, and its slopes are the exact ones
//! of the implicit function theorem. Where the solution followed ends, the run stops.
//!
//! Everything depends on the accepted solution ([`Newton::memory`]) and the values the block reads, on nothing else.
//! Evaluations are bounded.

use super::floating::Floating;
use super::frame::{Frame, Trouble, entries};
use super::instruction::Solve;

/// Iterations of one attempt.
const ITERATIONS: usize = 100;
/// The same at the start and after jumps: from far up an exponential law every step takes off one constant of it only.
const ITERATIONS_AT_START: usize = 2_000;
/// Shortest fraction of a step that is tried.
const SHORTEST: f64 = 1e-12;
/// A relative step below this that no longer improves the residual is rounding.
pub(super) const SETTLED: f64 = 1e-9;
/// The same while a solution is followed.
const SHORTEST_FOLLOWING: f64 = 1e-6;
/// Shortest part of the way from one solution to the next that is gone at once.
const SHORTEST_STRIDE: f64 = 1e-6;
/// Part of the way below which a few looks tell whether it is straight: over a kink of a law no step contracts. The
/// solution must have moved by no more than `SHORT_MOVE` of its magnitude.
const SHORT_STRIDE: f64 = 1e-3;
const SHORT_MOVE: f64 = 1e-2;
/// Iterations of an attempt in a short stride, and the shortest fraction of a step.
const SHORT_ITERATIONS: usize = 10;
const SHORT_FRACTION: f64 = 0.1;
/// Contraction of the first step below which the solution is near without doubt.
pub(super) const NEAR: f64 = 0.25;
/// A step that shrinks as the last one did, with the same Jacobian, leaves about twice its square over the last: below
/// this, rounding.
pub(super) const FINISHED: f64 = 0.125 * f64::EPSILON;
/// A Jacobian whose entries change by more than this part of their row at once has a kink, by less than that none yet.
const OTHER_SLOPE: f64 = 0.5;
const SAME_SLOPE: f64 = 1e-3;
/// Halvings of the way to a kink.
const KINK_HALVINGS: usize = 60;
/// Residuals below this part of their terms are rounding.
const ROUNDING: f64 = 2.0 * f64::EPSILON;
/// Points at which the way to a solution that is not near is looked at.
const LOOKS: usize = 8;
/// The same where the way may be long.
const MORE_LOOKS: usize = 64;
/// A Jacobian whose entries change by less than this part of their row does not change.
const LINEAR: f64 = 1e-9;
/// Attempts from other points after those from the last solution and from zero, at the start and after jumps.
const OTHER_STARTS: [f64; 6] = [1e-3, -1e-3, 1.0, -1.0, 1e3, -1e3];
/// Evaluations of a block at most at the start and after jumps.
const MOST_AT_START: usize = 20_000;
/// Evaluations of a block at most at any other time, unless a bound is set.
pub(crate) const MOST: usize = 2_000;
/// Powers of ten between which one unknown is searched, and points a power.
const SEARCHED: (i32, i32, i32) = (-12, 12, 20);

/// Memory and working space of a Newton block.
#[derive(Debug, Clone)]
pub(crate) struct Newton {
    /// Where the next solution starts: part of the model's state.
    pub memory: Vec<f64>,
    /// Whether the memory is an accepted solution, which is followed.
    pub following: bool,
    /// Counts the changes of the memory, from 1 on.
    pub(super) version: u64,
    /// What the block read there, and the entries of its Jacobian, row by row: part of the model's state too.
    outer_memory: Vec<f64>,
    pub(super) jacobian_memory: Vec<f64>,
    /// The last solution found, what the block read there, and its Jacobian.
    pub x: Vec<f64>,
    pub(super) outer: Vec<f64>,
    pub(super) jacobian: Vec<f64>,
    /// Whether these go on from the present memory, with the present parameters and conditions.
    pub fresh: bool,
    /// Evaluations at most while following.
    pub(super) most: usize,
    pub(super) evaluations: usize,
    step: Vec<f64>,
    trial: Vec<f64>,
    pub(super) next: Vec<f64>,
    /// Greatest magnitude of each unknown so far.
    size: Vec<f64>,
    /// Magnitudes below which unknowns are rounding; 0 unless a solution is sought that is not found without them.
    pub(super) floor: Vec<f64>,
    /// What is subtracted from the residuals on the way from a point where they do not vanish.
    pub(super) offset: Vec<f64>,
    first: Vec<f64>,
    /// Where the attempt began: the last root on the way.
    pub(super) kept: Vec<f64>,
    /// Where the attempt began, while another way is looked at.
    began: Vec<f64>,
    /// The first step of the attempt: to first order the change of the solution.
    lead: Vec<f64>,
    /// Residuals where the attempt began, with the sign of a right-hand side.
    opening: Vec<f64>,
    /// The Jacobian of the root at which the attempt began, if it began at one.
    base: Vec<f64>,
    /// Magnitudes of the unknowns at the memory and where the attempt from there led.
    pub(super) span: Vec<f64>,
    /// Whether the first step, taken whole, left little to do.
    near: bool,
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
    /// Room for so many unknowns and entries of the Jacobian.
    pub fn new(size: usize, entries: usize) -> Newton {
        let (line, square) = (vec![0.0; size], vec![0.0; entries]);
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

    /// Gives an unknown that is 0, and stays so in the first step, the magnitude at which it would count in one of the
    /// equations: what little it moves afterwards is no failure of the step. The last of a flat law is such a one.
    fn weigh_what_rests(&mut self, solve: &Solve, r: &[f64]) {
        let n = self.x.len();
        for j in 0..n {
            if self.size[j] != 0.0 || self.step[j] != 0.0 {
                continue;
            }
            let mut least = f64::INFINITY;
            for row in 0..n {
                let (mut own, mut others) = (0.0, 0.0);
                for e in solve.pattern.row(row) {
                    let (k, entry) = (solve.pattern.columns()[e] as usize, r[solve.matrix[e] as usize].abs());
                    match k == j {
                        true => own = entry,
                        false => others += entry * self.size[k].max(self.step[k].abs()),
                    }
                }
                if own > 0.0 && others > 0.0 {
                    least = least.min(others / own);
                }
            }
            if least < f64::INFINITY {
                self.size[j] = least;
            }
        }
    }

    /// How far `next` is from the first step, measured as steps are.
    fn off_the_lead(&self) -> f64 {
        let mut most: f64 = 0.0;
        for i in 0..self.next.len() {
            let (lead, off) = (self.lead[i], (self.next[i] - self.lead[i]).abs());
            let size = self.size[i].max(lead.abs()).max(f64::MIN_POSITIVE);
            most = if off.is_nan() { f64::INFINITY } else { most.max(off / size) };
        }
        most
    }

    fn limit(&self) -> usize {
        if self.following { self.most } else { MOST_AT_START }
    }

    pub(super) fn exhausted(&self) -> bool {
        self.evaluations >= self.limit()
    }
}

/// An attempt that failed.
#[derive(Debug, Clone, Copy)]
struct Miss {
    iterations: usize,
    residual: f64,
}

/// Why the root that goes on from the last one was not found.
#[derive(Debug, Clone, Copy)]
enum Missed {
    /// There is another one.
    Elsewhere { unknown: usize, root: f64 },
    /// None was found.
    All(Miss),
}

impl Frame {
    /// Finds the root of a block that goes on from its memory, at a start any root; leaves it in `newton.x` and in the
    /// guesses.
    pub(super) fn find_root(&mut self, solve: &Solve) -> Result<(), Trouble> {
        if !self.has_root(solve) {
            self.find_root_alone(solve)?;
        }
        let Frame { r, solvers, .. } = self;
        let root = &solvers[solve.block.0 as usize].newton.x;
        solve.guess.iter().zip(root).for_each(|(&guess, &x)| r[guess as usize] = x);
        Ok(())
    }

    /// Whether the root is known, or has been found beside those of blocks of the same shape.
    fn has_root(&mut self, solve: &Solve) -> bool {
        if !self.is_fresh(solve) {
            self.solve_abreast(solve);
            return self.is_fresh(solve);
        }
        true
    }

    /// Puts the unknowns of a Newton block where they belong if its root needs no search of its own; whether it does not.
    #[inline]
    pub fn takes_root(&mut self, solve: &Solve) -> bool {
        if solve.guess.is_empty() || !self.has_root(solve) {
            return false;
        }
        let Frame { r, solvers, .. } = self;
        let root = &solvers[solve.block.0 as usize].newton.x;
        solve.unknowns.iter().zip(root).for_each(|(&out, &x)| r[out as usize] = x);
        true
    }

    /// Whether the root found last is the one sought: the block reads what it read then.
    fn is_fresh(&self, solve: &Solve) -> bool {
        let newton = &self.solvers[solve.block.0 as usize].newton;
        let same = |(value, &register): (&f64, &u32)| value.to_bits() == self.r[register as usize].to_bits();
        newton.fresh && newton.outer.iter().zip(&solve.outer).all(same)
    }

    fn find_root_alone(&mut self, solve: &Solve) -> Result<(), Trouble> {
        let Frame { r, solvers, .. } = self;
        let newton = &mut solvers[solve.block.0 as usize].newton;
        (newton.evaluations, newton.fresh) = (0, false);
        newton.floating.now.fill(false);
        newton.floor.fill(0.0);
        newton.outer.iter_mut().zip(&solve.outer).for_each(|(value, &register)| *value = r[register as usize]);
        if let Err(missed) = self.follow(solve)
            && (self.newton_of(solve).following || !self.search(solve))
        {
            return Err(self.trouble(solve, missed));
        }
        self.keep_jacobian(solve);
        self.newton_of(solve).fresh = !has_conditions(solve);
        Ok(())
    }

    /// Takes note of the Jacobian at the point evaluated last.
    fn keep_jacobian(&mut self, solve: &Solve) {
        let Frame { r, solvers, .. } = self;
        let newton = &mut solvers[solve.block.0 as usize].newton;
        newton.jacobian.iter_mut().zip(entries(solve, r)).for_each(|(j, entry)| *j = entry);
    }

    /// Why there is no root to go on with.
    fn trouble(&mut self, solve: &Solve, missed: Missed) -> Trouble {
        let (block, newton) = (solve.block.0, self.newton_of(solve));
        match missed {
            Missed::Elsewhere { unknown, root } => {
                Trouble::Ended { block, unknown, from: newton.memory[unknown], to: root }
            }
            Missed::All(_) if newton.exhausted() => Trouble::Bound { block, evaluations: newton.limit() },
            Missed::All(_) if solve.right.len() == 1 => match self.scan(solve) {
                true => {
                    let newton = self.newton_of(solve);
                    Trouble::Ended { block, unknown: 0, from: newton.memory[0], to: newton.x[0] }
                }
                false => self.nowhere(solve),
            },
            Missed::All(Miss { iterations, residual }) => Trouble::NoConvergence { block, iterations, residual },
        }
    }

    fn newton_of(&mut self, solve: &Solve) -> &mut Newton {
        &mut self.solvers[solve.block.0 as usize].newton
    }

    /// The root that goes on from the memory.
    fn follow(&mut self, solve: &Solve) -> Result<(), Missed> {
        let newton = self.newton_of(solve);
        newton.offset.fill(0.0);
        newton.kept.copy_from_slice(&newton.memory);
        newton.base.copy_from_slice(&newton.jacobian_memory);
        let first = self.attempt(solve, Trust::Damped);
        if first.is_ok() && (self.goes_on(solve) || self.newton_of(solve).following && self.is_the_only_one(solve))
            || self.stays(solve)
            || self.floats(solve)
        {
            return Ok(());
        }
        let newton = self.newton_of(solve);
        newton.floating.now.fill(false);
        for i in 0..newton.x.len() {
            newton.span[i] = newton.x[i].abs().max(newton.memory[i].abs());
        }
        let missed = match first {
            Ok(()) => self.elsewhere(solve),
            Err(miss) => Missed::All(miss),
        };
        if self.approach(solve) || self.follows_above_rounding(solve) { Ok(()) } else { Err(missed) }
    }

    /// The root that goes on from the memory, where an unknown that is 0 but for the rounding of others hides it: steps of
    /// such an unknown are never small against it, but they are against what rounding leaves of it.
    fn follows_above_rounding(&mut self, solve: &Solve) -> bool {
        if !self.newton_of(solve).following || !self.find_floors(solve) {
            return false;
        }
        let newton = self.newton_of(solve);
        newton.floating.now.fill(false);
        newton.offset.fill(0.0);
        newton.kept.copy_from_slice(&newton.memory);
        newton.base.copy_from_slice(&newton.jacobian_memory);
        let at_once = self.attempt(solve, Trust::Damped).is_ok();
        let found = at_once && (self.goes_on(solve) || self.is_the_only_one(solve)) || self.approach(solve);
        if !found {
            self.newton_of(solve).floor.fill(0.0);
        }
        found
    }

    /// Whether the memory still solves the equations to rounding: where an unknown is 0 but for the rounding of others,
    /// no step is small against it.
    fn stays(&mut self, solve: &Solve) -> bool {
        let n = solve.right.len();
        let newton = self.newton_of(solve);
        newton.trial.copy_from_slice(&newton.memory);
        if !self.evaluate(solve, true) {
            // Where a slope is infinite, as that of a root at 0, no step tells: the residuals do if they vanish.
            let vanishes = solve.right.iter().all(|&right| self.r[right as usize] == 0.0);
            let newton = self.newton_of(solve);
            newton.x.copy_from_slice(&newton.memory);
            return vanishes;
        }
        for i in 0..n {
            let Frame { r, solvers, .. } = &mut *self;
            let newton = &mut solvers[solve.block.0 as usize].newton;
            let row =
                solve.pattern.row(i).map(|e| (solve.matrix[e], newton.memory[solve.pattern.columns()[e] as usize]));
            let terms = row.fold(0.0, |sum, (m, x)| sum + (r[m as usize] * x).abs());
            newton.first[i] = r[solve.right[i] as usize];
            newton.span[i] = ROUNDING * terms;
        }
        // What the last digits of what the block reads make of the residuals.
        for &register in &solve.outer {
            let value = self.r[register as usize];
            self.r[register as usize] = value + ROUNDING * value;
            let finite = self.evaluate(solve, true);
            self.r[register as usize] = value;
            if !finite {
                return false;
            }
            for (i, &right) in solve.right.iter().enumerate() {
                let moved = self.r[right as usize];
                let newton = self.newton_of(solve);
                newton.span[i] += (moved - newton.first[i]).abs();
            }
        }
        let newton = self.newton_of(solve);
        if newton.first.iter().zip(&newton.span).any(|(residual, rounding)| residual.abs() > *rounding) {
            return false;
        }
        newton.x.copy_from_slice(&newton.memory);
        newton.trial.copy_from_slice(&newton.memory);
        self.evaluate(solve, true)
    }

    /// The root found is another one: the unknown that differs most.
    fn elsewhere(&mut self, solve: &Solve) -> Missed {
        let newton = self.newton_of(solve);
        let leap = |i: usize| (newton.x[i] - newton.memory[i]).abs() / newton.size[i].max(f64::MIN_POSITIVE);
        let unknown = (0..newton.x.len()).fold(0, |most, i| if leap(i) > leap(most) { i } else { most });
        Missed::Elsewhere { unknown, root: newton.x[unknown] }
    }

    /// Any root.
    fn search(&mut self, solve: &Solve) -> bool {
        let newton = self.newton_of(solve);
        newton.kept.copy_from_slice(&newton.memory);
        if self.attempt(solve, Trust::Damped).is_ok() || self.floats(solve) {
            return true;
        }
        for start in std::iter::once(0.0).chain(OTHER_STARTS) {
            self.newton_of(solve).kept.fill(start);
            if self.attempt(solve, Trust::Damped).is_ok() || self.floats(solve) {
                return true;
            }
        }
        self.newton_of(solve).floating.now.fill(false);
        solve.right.len() == 1 && self.scan(solve)
    }

    /// Goes from the memory in strides, each short enough to tell the root: along what the block has read and reads now,
    /// or from a point that is no root along the roots of `residual - (1 - s) residual(memory)`.
    fn approach(&mut self, solve: &Solve) -> bool {
        let newton = self.newton_of(solve);
        newton.offset.fill(0.0);
        newton.kept.copy_from_slice(&newton.memory);
        newton.base.copy_from_slice(&newton.jacobian_memory);
        newton.x.copy_from_slice(&newton.memory);
        if !newton.following && !self.evaluate(solve, false) {
            return false;
        }
        for (i, &right) in solve.right.iter().enumerate() {
            let residual = self.r[right as usize];
            self.newton_of(solve).first[i] = residual;
        }
        let (mut s, mut stride) = (0.0f64, 0.25f64);
        while stride > SHORTEST_STRIDE && !self.newton_of(solve).exhausted() {
            let next = (s + stride).min(1.0);
            self.go_to(solve, next);
            let short = stride <= SHORT_STRIDE;
            let trust = if short { Trust::Kink } else { Trust::Contraction };
            let found = self.attempt(solve, trust).is_ok();
            let goes_on =
                found && (self.goes_on(solve) || short && self.moves_little(solve) && self.is_straight(solve, LOOKS));
            if goes_on || self.floats(solve) {
                if goes_on {
                    self.newton_of(solve).floating.now.fill(false);
                }
                if next == 1.0 {
                    return true;
                }
                self.keep_jacobian(solve);
                let newton = self.newton_of(solve);
                newton.kept.copy_from_slice(&newton.x);
                newton.base.copy_from_slice(&newton.jacobian);
                (s, stride) = (next, 2.0 * stride);
            } else {
                stride *= 0.5;
            }
        }
        self.go_to(solve, 1.0);
        false
    }

    /// Sets what the block reads, or what is taken off its residuals, to a part of the way.
    fn go_to(&mut self, solve: &Solve, part: f64) {
        let Frame { r, solvers, .. } = self;
        let newton = &mut solvers[solve.block.0 as usize].newton;
        if !newton.following {
            newton.offset.iter_mut().zip(&newton.first).for_each(|(o, f)| *o = (1.0 - part) * f);
            return;
        }
        for (&register, (now, before)) in solve.outer.iter().zip(newton.outer.iter().zip(&newton.outer_memory)) {
            r[register as usize] = if part == 1.0 { *now } else { before + part * (now - before) };
        }
    }

    /// Whether the root found is without doubt the one that goes on from where the attempt began: the first step, taken
    /// whole, came near to it, and the Jacobian there is much the same as at the beginning.
    fn goes_on(&mut self, solve: &Solve) -> bool {
        let solver = &mut self.solvers[solve.block.0 as usize];
        let newton = &mut solver.newton;
        if !newton.near || newton.lead.iter().all(|&lead| lead == 0.0) {
            return newton.near;
        }
        let n = newton.x.len();
        let mut most = SETTLED;
        for i in 0..n {
            let lead = newton.lead[i].abs();
            most = most.max(lead / newton.size[i].max(lead).max(f64::MIN_POSITIVE));
            newton.next[i] = newton.x[i] - newton.kept[i];
        }
        let off = newton.off_the_lead();
        // What the first step would have been with the last Jacobian.
        newton.next.copy_from_slice(&newton.opening);
        solver.factors.solve(&mut newton.next);
        let off = off.max(newton.off_the_lead());
        if !newton.following {
            return off <= 0.5 * most;
        }
        // And that of the Jacobian at the root where it began.
        for i in 0..n {
            let row = solve.pattern.row(i).map(|e| (newton.base[e], newton.lead[solve.pattern.columns()[e] as usize]));
            newton.next[i] = row.map(|(j, lead)| j * lead).sum();
        }
        solver.factors.solve(&mut newton.next);
        off.max(newton.off_the_lead()) <= 0.5 * most
    }

    fn moves_little(&mut self, solve: &Solve) -> bool {
        let newton = self.newton_of(solve);
        let little = |i: usize| (newton.x[i] - newton.kept[i]).abs() <= SHORT_MOVE * newton.span[i];
        (0..newton.x.len()).all(little)
    }

    /// Whether the residuals shrink all the way from where the attempt began to the root, and the Jacobian never changes
    /// its orientation: no fold and no pole lies between them. Ends with an evaluation at the root.
    fn is_straight(&mut self, solve: &Solve, looks: usize) -> bool {
        let straight = self.is_straight_at(solve, looks);
        straight & self.evaluate(solve, false)
    }

    fn is_straight_at(&mut self, solve: &Solve, looks: usize) -> bool {
        // Measured by the Jacobian at the root, or where that is singular at the beginning.
        if ![1.0, 0.0].into_iter().any(|part| self.look(solve, part) && self.factor(solve)) {
            return false;
        }
        let mut before = f64::INFINITY;
        for look in 0..=looks {
            if !self.look(solve, look as f64 / looks as f64) {
                return false;
            }
            let rest = self.next_step(solve);
            if rest.is_nan() || rest > before * (1.0 + SETTLED) + SETTLED {
                return false;
            }
            before = rest;
        }
        let mut orientation = self.orientation_followed(solve);
        for look in 0..=looks {
            let good = self.look(solve, look as f64 / looks as f64);
            // A point at which the Jacobian is singular, such as 0 of a cube, is no fold unless its sign changes there.
            if good && self.factor(solve) {
                let here = self.solvers[solve.block.0 as usize].factors.is_positive();
                if *orientation.get_or_insert(here) != here {
                    return false;
                }
            }
        }
        true
    }

    /// The orientation of the Jacobian at the root from which the way leads, where that is followed and regular.
    fn orientation_followed(&mut self, solve: &Solve) -> Option<bool> {
        let solver = &mut self.solvers[solve.block.0 as usize];
        let base = solver.newton.base.iter().copied();
        (solver.newton.following && solver.factors.factor(base).is_ok()).then(|| solver.factors.is_positive())
    }

    /// Whether the root found is without doubt the only one near the way to it. Ends with an evaluation at the root.
    fn is_the_only_one(&mut self, solve: &Solve) -> bool {
        let linear = self.is_linear(solve);
        (linear || self.is_straight_at(solve, MORE_LOOKS)) & self.evaluate(solve, false)
    }

    /// Whether the Jacobian is the same all the way from where the attempt began to `x`: what differs is rounding.
    fn is_linear(&mut self, solve: &Solve) -> bool {
        let n = solve.right.len();
        let mut same = true;
        for look in 0..=LOOKS {
            same &= self.look(solve, look as f64 / LOOKS as f64);
            let Frame { r, solvers, .. } = self;
            let newton = &mut solvers[solve.block.0 as usize].newton;
            if look == 0 {
                newton.jacobian.iter_mut().zip(entries(solve, r)).for_each(|(j, entry)| *j = entry);
            }
            for row in (0..n).map(|i| solve.pattern.row(i)) {
                let (before, now) = (&newton.jacobian[row.clone()], &solve.matrix[row]);
                let most = before.iter().fold(0.0f64, |most, j| most.max(j.abs()));
                same &= before.iter().zip(now).all(|(j, &m)| (r[m as usize] - j).abs() <= LINEAR * most);
            }
        }
        same
    }

    /// Whether the Jacobian is the same at `x` and a whole step from there: that the step does not help is rounding.
    fn is_rounding(&mut self, solve: &Solve) -> bool {
        let newton = self.newton_of(solve);
        newton.began.copy_from_slice(&newton.kept);
        newton.kept.iter_mut().zip(newton.x.iter().zip(&newton.step)).for_each(|(k, (x, step))| *k = x + step);
        let linear = self.is_linear(solve);
        let newton = self.newton_of(solve);
        newton.kept.copy_from_slice(&newton.began);
        linear & self.evaluate(solve, false)
    }

    /// Evaluates a point on the way from where the attempt began (0) to the root (1).
    fn look(&mut self, solve: &Solve, part: f64) -> bool {
        let newton = self.newton_of(solve);
        for i in 0..newton.x.len() {
            newton.trial[i] = newton.kept[i] + part * (newton.x[i] - newton.kept[i]);
        }
        self.evaluate(solve, true)
    }

    /// Newton from `newton.kept`.
    fn attempt(&mut self, solve: &Solve, trust: Trust) -> Result<(), Miss> {
        let n = solve.right.len();
        let newton = self.newton_of(solve);
        // The way in short strides needs its share of the evaluations.
        let last = newton.evaluations + newton.limit() / 4;
        newton.x.copy_from_slice(&newton.kept);
        newton.near = true;
        newton.lead.fill(0.0);
        newton.opening.fill(0.0);
        (0..n).for_each(|i| newton.size[i] = newton.x[i].abs().max(newton.floor[i]));
        if !self.evaluate(solve, false) {
            return Err(Miss { iterations: 0, residual: f64::NAN });
        }
        let most = match trust {
            Trust::Kink => SHORT_ITERATIONS,
            _ if self.newton_of(solve).following => ITERATIONS,
            _ => ITERATIONS_AT_START,
        };
        for iteration in 0..most {
            if self.residual(solve) == 0.0 {
                return Ok(());
            }
            let newton = self.newton_of(solve);
            if newton.exhausted() || newton.evaluations > last {
                return Err(Miss { iterations: iteration, residual: self.residual(solve) });
            }
            if !self.factor(solve) {
                self.nudge(solve, iteration);
                if !self.evaluate(solve, false) {
                    return Err(Miss { iterations: iteration, residual: f64::NAN });
                }
                continue;
            }
            self.newton_step(solve);
            if iteration == 0 {
                let Frame { r, solvers, .. } = self;
                let newton = &mut solvers[solve.block.0 as usize].newton;
                newton.lead.copy_from_slice(&newton.step);
                for (i, &right) in solve.right.iter().enumerate() {
                    newton.opening[i] = newton.offset[i] - r[right as usize];
                }
                newton.weigh_what_rests(solve, r);
            }
            let size = self.relative_step(solve);
            if !size.is_finite() {
                break;
            }
            let (damped, near) = self.damped(solve, size, trust);
            self.newton_of(solve).near &= iteration > 0 || near;
            if trust == Trust::Contraction && !self.newton_of(solve).near {
                return Err(Miss { iterations: iteration + 1, residual: self.residual(solve) });
            }
            match damped {
                Damped::Done => return Ok(()),
                Damped::Moved => {}
                Damped::Stuck => {
                    return Err(Miss { iterations: iteration + 1, residual: self.residual(solve) });
                }
            }
        }
        Err(Miss { iterations: most, residual: self.residual(solve) })
    }

    /// Takes the step, or as much of it as makes the next one shorter; and whether all of it left little to do.
    fn damped(&mut self, solve: &Solve, size: f64, trust: Trust) -> (Damped, bool) {
        let mut fraction = 1.0;
        loop {
            let newton = self.newton_of(solve);
            for i in 0..newton.x.len() {
                newton.trial[i] = newton.x[i] + fraction * newton.step[i];
            }
            let finite = self.evaluate(solve, true);
            if finite {
                let next = self.next_step(solve);
                if next <= (1.0 - 0.25 * fraction) * size || size <= 2.0 * f64::EPSILON {
                    self.accept_trial(solve);
                    let near = fraction == 1.0 && (next <= NEAR * size || size <= SETTLED);
                    if near && next * next <= FINISHED * size {
                        self.take_next_step(solve);
                        return (Damped::Done, true);
                    }
                    return (if size <= 4.0 * f64::EPSILON { Damped::Done } else { Damped::Moved }, near);
                }
            }
            if size <= SETTLED {
                // Rounding keeps the step from shrinking: it is as good as it gets.
                self.evaluate(solve, false);
                return (Damped::Done, true);
            }
            fraction *= 0.5;
            let newton = self.newton_of(solve);
            let shortest = match trust {
                Trust::Kink => SHORT_FRACTION,
                _ if newton.following => SHORTEST_FOLLOWING,
                _ => SHORTEST,
            };
            if fraction < shortest || newton.exhausted() {
                if trust == Trust::Damped && self.crosses_kink(solve) {
                    self.accept_trial(solve);
                    return (Damped::Moved, false);
                }
                let rounding = self.is_rounding(solve) && self.is_near_rounding(solve) || self.is_at_rounding(solve);
                return if rounding { (Damped::Done, true) } else { (Damped::Stuck, false) };
            }
        }
    }

    /// Goes along the step to just beyond where the Jacobian changes, if no residual grows on that way: where a law has a
    /// kink, its slope before tells nothing of the way behind. Ends with an evaluation of the trial point, or at `x`.
    fn crosses_kink(&mut self, solve: &Solve) -> bool {
        if !self.evaluate(solve, false) {
            return false;
        }
        self.keep_jacobian(solve);
        let Frame { r, solvers, .. } = &mut *self;
        let newton = &mut solvers[solve.block.0 as usize].newton;
        for (i, &right) in solve.right.iter().enumerate() {
            newton.next[i] = (r[right as usize] - newton.offset[i]).abs();
        }
        let (mut before, mut beyond) = (0.0, 1.0);
        for _ in 0..KINK_HALVINGS {
            let newton = self.newton_of(solve);
            for i in 0..newton.x.len() {
                newton.trial[i] = newton.x[i] + beyond * newton.step[i];
            }
            let finite = self.evaluate(solve, true);
            let change = if finite { self.change_of_slope(solve) } else { f64::INFINITY };
            match change {
                change if change > OTHER_SLOPE => {
                    if beyond - before <= SAME_SLOPE * beyond && finite && self.has_less_left(solve) {
                        return true;
                    }
                    beyond = 0.5 * (before + beyond);
                }
                // No kink: the slope changes little by little, or not at all.
                change if change > SAME_SLOPE || before == 0.0 && beyond == 1.0 => break,
                _ => {
                    let end = beyond;
                    beyond += beyond - before;
                    before = end;
                }
            }
        }
        self.evaluate(solve, false);
        false
    }

    /// How far the Jacobian evaluated last is from the one kept, relative to the entries of a row.
    fn change_of_slope(&self, solve: &Solve) -> f64 {
        let n = solve.right.len();
        let kept = &self.solvers[solve.block.0 as usize].newton.jacobian;
        let mut change: f64 = 0.0;
        for row in (0..n).map(|i| solve.pattern.row(i)) {
            let (before, now) = (&kept[row.clone()], &solve.matrix[row]);
            let most = before.iter().fold(f64::MIN_POSITIVE, |most, j| most.max(j.abs()));
            before.iter().zip(now).for_each(|(j, &m)| change = change.max((self.r[m as usize] - j).abs() / most));
        }
        change
    }

    /// Whether no residual evaluated last is greater than those kept in `next`, and one is less.
    fn has_less_left(&self, solve: &Solve) -> bool {
        let newton = &self.solvers[solve.block.0 as usize].newton;
        let now = |i: usize| (self.r[solve.right[i] as usize] - newton.offset[i]).abs();
        (0..solve.right.len()).all(|i| now(i) <= newton.next[i])
            && (0..solve.right.len()).any(|i| now(i) < newton.next[i])
    }

    fn accept_trial(&mut self, solve: &Solve) {
        let newton = self.newton_of(solve);
        newton.x.copy_from_slice(&newton.trial);
        newton.size.iter_mut().zip(&newton.x).for_each(|(size, x)| *size = size.max(x.abs()));
    }

    /// Takes the step that would come next, with the Jacobian as it was before the last one.
    fn take_next_step(&mut self, solve: &Solve) {
        let newton = self.newton_of(solve);
        for i in 0..newton.x.len() {
            newton.x[i] += newton.next[i];
            newton.size[i] = newton.size[i].max(newton.x[i].abs());
        }
    }

    pub(super) fn evaluate_root(&mut self, solve: &Solve) -> bool {
        self.evaluate(solve, false)
    }

    pub(super) fn is_exhausted(&mut self, solve: &Solve) -> bool {
        self.newton_of(solve).exhausted()
    }

    /// Runs the code at `x` (or the trial point); whether residuals and Jacobian are finite.
    fn evaluate(&mut self, solve: &Solve, trial: bool) -> bool {
        let newton = self.newton_of(solve);
        newton.evaluations += 1;
        let newton = &self.solvers[solve.block.0 as usize].newton;
        let point = if trial { &newton.trial } else { &newton.x };
        solve.guess.iter().zip(point).for_each(|(&g, &x)| self.r[g as usize] = x);
        self.inner::<false>(solve);
        solve.matrix.iter().chain(&solve.right).all(|&v| self.r[v as usize].is_finite())
    }

    /// Greatest residual at the point evaluated last.
    fn residual(&self, solve: &Solve) -> f64 {
        let offset = &self.solvers[solve.block.0 as usize].newton.offset;
        let residuals = solve.right.iter().zip(offset).map(|(&v, o)| (self.r[v as usize] - o).abs());
        residuals.fold(0.0, f64::max)
    }

    pub(super) fn factor(&mut self, solve: &Solve) -> bool {
        let Frame { r, solvers, .. } = self;
        solvers[solve.block.0 as usize].factors.factor(entries(solve, r)).is_ok()
    }

    /// The Newton step at the point evaluated last.
    fn newton_step(&mut self, solve: &Solve) {
        let Frame { r, solvers, .. } = self;
        let solver = &mut solvers[solve.block.0 as usize];
        let newton = &mut solver.newton;
        for (i, &right) in solve.right.iter().enumerate() {
            newton.step[i] = newton.offset[i] - r[right as usize];
        }
        solver.factors.solve(&mut newton.step);
    }

    /// Greatest component of the step against its unknown.
    fn relative_step(&mut self, solve: &Solve) -> f64 {
        let newton = self.newton_of(solve);
        let mut most: f64 = 0.0;
        for i in 0..newton.step.len() {
            let size = newton.step[i].abs();
            if !size.is_finite() {
                return f64::NAN;
            }
            most = most.max(size / newton.size[i].max(size).max(f64::MIN_POSITIVE));
        }
        most
    }

    /// What the next step would be with the present Jacobian, measured as [`relative_step`](Self::relative_step) does.
    fn next_step(&mut self, solve: &Solve) -> f64 {
        let Frame { r, solvers, .. } = self;
        let solver = &mut solvers[solve.block.0 as usize];
        let newton = &mut solver.newton;
        for (i, &right) in solve.right.iter().enumerate() {
            newton.next[i] = newton.offset[i] - r[right as usize];
        }
        solver.factors.solve(&mut newton.next);
        let mut most: f64 = 0.0;
        for i in 0..newton.next.len() {
            let size = newton.size[i].max(newton.step[i].abs()).max(f64::MIN_POSITIVE);
            let next = newton.next[i].abs() / size;
            most = if next.is_nan() { f64::INFINITY } else { most.max(next) };
        }
        most
    }

    /// Leaves a point at which the Jacobian is singular.
    fn nudge(&mut self, solve: &Solve, iteration: usize) {
        let newton = self.newton_of(solve);
        newton.near = false;
        for (i, x) in newton.x.iter_mut().enumerate() {
            let away = 1e-3 * (1.0 + iteration as f64) * newton.size[i].max(1.0);
            *x += if i % 2 == iteration % 2 { away } else { 0.5 * away };
        }
    }
}

/// What an attempt may lead to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Trust {
    /// Any root that damped steps find.
    Damped,
    /// A root that few steps find.
    Kink,
    /// A root that the first step comes near to, or none.
    Contraction,
}

/// What became of a step.
enum Damped {
    Done,
    Moved,
    Stuck,
}

/// One equation in one unknown: a search over all magnitudes.
impl Frame {
    /// A root anywhere, those near the memory first; left in `newton.x`.
    fn scan(&mut self, solve: &Solve) -> bool {
        self.newton_of(solve).offset.fill(0.0);
        let middle = self.newton_of(solve).memory[0];
        let mut ends = [None; 2];
        for distance in distances() {
            for (end, sign) in ends.iter_mut().zip([1.0, -1.0]) {
                let at = middle + sign * distance;
                let here = self.residual_at(solve, at);
                let before = std::mem::replace(end, here.map(|r| (at, r)));
                let (Some(r), Some(before)) = (here, before) else { continue };
                if r.signum() != before.1.signum() && self.between(solve, before, (at, r)) {
                    return true;
                }
            }
        }
        false
    }

    fn residual_at(&mut self, solve: &Solve, at: f64) -> Option<f64> {
        let newton = self.newton_of(solve);
        newton.trial[0] = at;
        let finite = self.evaluate(solve, true);
        finite.then(|| self.r[solve.right[0] as usize])
    }

    /// Halves an interval at whose ends the residual differs in sign. A pole is no root.
    fn between(&mut self, solve: &Solve, mut a: (f64, f64), mut b: (f64, f64)) -> bool {
        let jump = a.1.abs().min(b.1.abs());
        for _ in 0..200 {
            let middle = 0.5 * (a.0 + b.0);
            if middle == a.0 || middle == b.0 {
                break;
            }
            let Some(r) = self.residual_at(solve, middle) else { return false };
            if r.signum() == a.1.signum() { a = (middle, r) } else { b = (middle, r) }
        }
        let best = if a.1.abs() < b.1.abs() { a } else { b };
        if best.1.abs() > jump {
            return false;
        }
        self.newton_of(solve).kept[0] = best.0;
        self.newton_of(solve).evaluations = 0;
        self.attempt(solve, Trust::Damped).is_ok()
    }

    /// Where the residual of a block without root is least.
    fn nowhere(&mut self, solve: &Solve) -> Trouble {
        let middle = self.newton_of(solve).memory[0];
        let mut best = (middle, self.residual_at(solve, middle).map_or(f64::INFINITY, f64::abs));
        for distance in distances() {
            for at in [middle + distance, middle - distance] {
                let r = self.residual_at(solve, at).map_or(f64::INFINITY, f64::abs);
                if r < best.1 {
                    best = (at, r);
                }
            }
        }
        Trouble::NoSolution { block: solve.block.0, nearest: best.0, residual: best.1 }
    }
}

/// Whether inner code reads conditions, which may be held or not.
pub(super) fn has_conditions(solve: &Solve) -> bool {
    solve.code.iter().any(|operation| operation.op.is_held())
}

/// Distances from tiny to huge.
fn distances() -> impl Iterator<Item = f64> {
    let (low, high, points) = SEARCHED;
    std::iter::once(0.0)
        .chain((low * points..=high * points).map(move |k| crate::math::pow(10.0, f64::from(k) / f64::from(points))))
}
