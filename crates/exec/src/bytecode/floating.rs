//! Newton blocks in which nothing tells an unknown: where diodes block, what is left of a slope lies below the rounding
//! of the currents, and a node between them floats.
//!
//! A residual at the rounding of its terms is a solution. What the equations tell of the unknowns is solved for, of the
//! rest the shortest change is taken: it stays where it was.

use super::elimination::RankRevealing;
use super::frame::{Frame, entries};
use super::instruction::{Operation, Solve};
use super::newton::CLOSE_TO_ROUNDING;
use halfarrow_compiler::program::Op;

/// A residual below this part of its terms is rounding.
const ROUNDING: f64 = 8.0 * f64::EPSILON;
/// Residuals above this many times their rounding are none, whatever steps do.
const BORROWED: f64 = 1e6;
/// Steps at most.
const STEPS: usize = 30;
/// By how much the residuals have to shrink in a step.
const SHRINKS: f64 = 0.75;
/// Sparse blocks of more unknowns are not searched for unknowns that float: that takes the cube of their number.
const LARGEST_SPARSE: usize = 200;
/// Share in an undetermined direction from which on an unknown is said to float.
const SHARE: f64 = 0.1;

/// Working space of a block, and what was found of it.
#[derive(Debug, Clone)]
pub(crate) struct Floating {
    /// What the residuals are the sums of, in magnitude.
    terms: Vec<f64>,
    /// The linear equations of a step.
    equations: RankRevealing,
    /// Magnitudes of the unknowns.
    size: Vec<f64>,
    /// Which unknowns float at the root found last.
    pub now: Vec<bool>,
    /// Which have floated in an accepted solution.
    pub ever: Vec<bool>,
}

impl Floating {
    /// Room for so many unknowns of a matrix that is factored as a sparse one or not: large sparse ones have no full matrix,
    /// and no unknown of theirs floats.
    pub fn new(size: usize, sparse: bool) -> Floating {
        Floating {
            terms: vec![0.0; size],
            equations: RankRevealing::new(size, sparse && size > LARGEST_SPARSE),
            size: vec![0.0; size],
            now: vec![false; size],
            ever: vec![false; size],
        }
    }

    /// Takes note of what floats in the solution that is accepted.
    pub fn accept(&mut self) {
        self.ever.iter_mut().zip(&self.now).for_each(|(ever, now)| *ever |= now);
    }

    /// Greatest residual in units of its rounding; infinite if something is not finite.
    fn rest(&self) -> f64 {
        self.equations.right.iter().fold(0.0, |most, r| if r.is_finite() { r.abs().max(most) } else { f64::INFINITY })
    }

    /// Whether after elimination the least pivot tells no more digits of its unknown than a step needs to be settled.
    fn is_weak(&self, rank: usize) -> bool {
        rank < self.now.len() || self.equations.least_pivot() < 1.0 / CLOSE_TO_ROUNDING
    }

    /// Replaces the right side by the shortest step, in places, and tells which unknowns float.
    fn shortest(&mut self, rank: usize) {
        let Floating { equations, now, .. } = self;
        now.fill(false);
        equations.shortest(rank, |unknown, share| now[unknown] |= share.abs() >= SHARE);
    }
}

impl Frame {
    /// Whether the residuals at `newton.x`, evaluated last, are rounding.
    pub(super) fn is_at_rounding(&mut self, solve: &Solve) -> bool {
        self.measure(solve);
        self.floating_of(solve).rest() <= 1.0
    }

    /// Whether they are not far above that: rounding that came from elsewhere.
    pub(super) fn is_near_rounding(&mut self, solve: &Solve) -> bool {
        self.measure(solve);
        self.floating_of(solve).rest() <= BORROWED
    }

    /// From `newton.start` in steps by what the equations tell of the unknowns, to where the residuals are rounding; only
    /// as long as something is hardly told. Ends with an evaluation at the root.
    pub(super) fn floats(&mut self, solve: &Solve) -> bool {
        let newton = &mut self.solvers[solve.block.0 as usize].newton;
        newton.x.copy_from_slice(&newton.start);
        if !newton.floating.equations.has_matrix() {
            return false;
        }
        let mut before = f64::INFINITY;
        for _ in 0..STEPS {
            if self.is_exhausted(solve) || !self.evaluate_root(solve) {
                return false;
            }
            self.measure(solve);
            let floating = self.floating_of(solve);
            let rest = floating.rest();
            if !floating.equations.matrix.iter().all(|a| a.is_finite()) || rest > SHRINKS * before && rest > 1.0 {
                return false;
            }
            let rank = floating.equations.eliminate();
            if !floating.is_weak(rank) {
                return false;
            }
            floating.shortest(rank);
            if rest <= 1.0 {
                return true;
            }
            let newton = &mut self.solvers[solve.block.0 as usize].newton;
            let floating = &newton.floating;
            for (&unknown, step) in floating.equations.order.iter().zip(&floating.equations.right) {
                newton.x[unknown] += step * floating.size[unknown];
            }
            before = rest;
        }
        false
    }

    /// What the rounding of residuals at the memory makes of each unknown, as the magnitude of which that is settled; whether
    /// one of them is greater than its unknown.
    pub(super) fn find_floors(&mut self, solve: &Solve) -> bool {
        let newton = &mut self.solvers[solve.block.0 as usize].newton;
        newton.x.copy_from_slice(&newton.previous);
        if self.is_exhausted(solve) || !self.evaluate_root(solve) || !self.factor(solve) {
            return false;
        }
        self.sum_terms(solve);
        let Frame { solvers, terms, .. } = self;
        let solver = &mut solvers[solve.block.0 as usize];
        let newton = &mut solver.newton;
        newton.floor.fill(0.0);
        for (j, &right) in solve.right.iter().enumerate() {
            newton.simplified.fill(0.0);
            newton.simplified[j] = ROUNDING * terms[right as usize];
            solver.factors.solve(&mut newton.simplified);
            newton.floor.iter_mut().zip(&newton.simplified).for_each(|(floor, part)| *floor += part.abs());
        }
        let mut hidden = false;
        for (floor, span) in newton.floor.iter_mut().zip(&mut newton.magnitude) {
            *floor /= CLOSE_TO_ROUNDING;
            hidden |= *floor > *span;
            *span = span.max(*floor);
        }
        let found = hidden && newton.floor.iter().all(|floor| floor.is_finite());
        if !found {
            newton.floor.fill(0.0);
        }
        found
    }

    fn floating_of(&mut self, solve: &Solve) -> &mut Floating {
        &mut self.solvers[solve.block.0 as usize].newton.floating
    }

    /// Right side and matrix at the point evaluated last, rows in units of their rounding.
    fn measure(&mut self, solve: &Solve) {
        self.sum_terms(solve);
        let n = solve.right.len();
        let Frame { r, solvers, terms, .. } = self;
        let newton = &mut solvers[solve.block.0 as usize].newton;
        let largest = newton.x.iter().chain(&newton.previous).fold(0.0f64, |most, x| most.max(x.abs()));
        let floating = &mut newton.floating;
        for j in 0..n {
            let size = newton.x[j].abs().max(newton.previous[j].abs());
            let unknown = if largest > 0.0 { largest } else { 1.0 };
            floating.size[j] = if size > 0.0 { size } else { unknown };
        }
        floating.equations.clear();
        for (i, &right) in solve.right.iter().enumerate() {
            let rounding = ROUNDING * terms[right as usize];
            floating.terms[i] = if rounding > 0.0 { rounding } else { f64::MIN_POSITIVE };
            floating.equations.right[i] = (newton.offset[i] - r[right as usize]) / floating.terms[i];
        }
        let (entries, whole) = (solve.pattern.places().zip(entries(solve, r)), floating.equations.has_matrix());
        for ((i, j), entry) in entries.filter(|_| whole) {
            floating.equations.matrix[i * n + j] = entry * floating.size[j] / floating.terms[i];
        }
    }

    /// Runs the code of a block again, and adds up what its values are the sums of, in magnitude.
    fn sum_terms(&mut self, solve: &Solve) {
        self.terms.iter_mut().zip(&self.r).for_each(|(terms, value)| *terms = value.abs());
        let point = &self.solvers[solve.block.0 as usize].newton.x;
        solve.guess.iter().zip(point).for_each(|(&g, &x)| {
            (self.r[g as usize], self.terms[g as usize]) = (x, x.abs());
        });
        for operation in &solve.code {
            let terms = self.terms_of(operation);
            self.plain::<false>(std::slice::from_ref(operation));
            let out = operation.out as usize;
            self.terms[out] = terms.unwrap_or(self.r[out].abs());
        }
    }

    /// What an operation adds up, in magnitude, before it is done; `None` where that is its value.
    fn terms_of(&self, operation: &Operation) -> Option<f64> {
        let t = |r: u32| self.terms[r as usize];
        match operation.op {
            Op::Add(a, b) | Op::Sub(a, b) => Some(t(a) + t(b)),
            Op::Neg(a) => Some(t(a)),
            Op::Mul(a, b) => Some(t(a) * t(b)),
            Op::Div(a, b) => Some(t(a) / self.r[b as usize].abs()),
            _ => None,
        }
    }
}
