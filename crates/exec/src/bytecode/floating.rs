//! Newton blocks whose Jacobian is rank deficient to working precision: where diodes block, their conductance lies below
//! the rounding error of the currents, and the potential of a node between them is not determined: it floats.
//!
//! A point is a solution where each residual is below a bound on its rounding error. Steps are minimum-norm solutions of
//! the linearised equations, scaled by these bounds and by the magnitudes of the unknowns and truncated at their numerical
//! rank: what the equations do not determine keeps its value.

use super::elimination::RankRevealing;
use super::frame::{Frame, entries};
use super::instruction::{Operation, Solve};
use super::newton::CLOSE_TO_ROUNDING;
use halfarrow_compiler::program::Op;

/// A residual below this fraction of the sum of its terms' magnitudes is rounding error.
const ROUNDING: f64 = 8.0 * f64::EPSILON;
/// A point where residuals exceed their rounding error by more than this factor is no solution, even if steps stagnate.
const STAGNATION_LIMIT: f64 = 1e6;
/// Most steps of the rank-deficient iteration.
const STEPS: usize = 30;
/// The residuals' norm after a step is at most this fraction of that before.
const CONTRACTION: f64 = 0.75;
/// Sparse blocks of more unknowns are not examined for floating unknowns: elimination of the full matrix takes a time in
/// proportion to the cube of their number.
const LARGEST_SPARSE: usize = 200;
/// An unknown floats if its component in a unit vector of the null space is at least this large.
const NULL_SPACE_COMPONENT: f64 = 0.1;

/// Workspace of a block, and the unknowns found to float.
#[derive(Debug, Clone)]
pub(crate) struct Floating {
    /// Bounds on the rounding errors of the residuals.
    pub(super) rounding: Vec<f64>,
    /// The linear equations of a step, in scaled unknowns.
    pub(super) equations: RankRevealing,
    /// Scales of the unknowns.
    pub(super) scale: Vec<f64>,
    /// Which unknowns float at the solution found last.
    pub now: Vec<bool>,
    /// Which have floated in an accepted solution.
    pub ever: Vec<bool>,
}

impl Floating {
    /// Workspace for a block of `size` unknowns whose Jacobian is factored as a sparse matrix or a full one. Large sparse
    /// blocks get no full matrix, and their unknowns are taken as determined.
    pub fn new(size: usize, sparse: bool) -> Floating {
        Floating {
            rounding: vec![0.0; size],
            equations: RankRevealing::new(size, sparse && size > LARGEST_SPARSE),
            scale: vec![0.0; size],
            now: vec![false; size],
            ever: vec![false; size],
        }
    }

    /// Records the floating unknowns of the accepted solution.
    pub fn accept(&mut self) {
        self.ever.iter_mut().zip(&self.now).for_each(|(ever, now)| *ever |= now);
    }

    /// Maximum norm of the residuals, each divided by its rounding error; infinite if one is not finite.
    fn residual_norm(&self) -> f64 {
        self.equations.right.iter().fold(0.0, |most, r| if r.is_finite() { r.abs().max(most) } else { f64::INFINITY })
    }

    /// Whether the matrix is rank deficient to the precision at which a step counts as converged, judged by its least pivot.
    fn is_rank_deficient(&self, rank: usize) -> bool {
        rank < self.now.len() || self.equations.least_pivot() < 1.0 / CLOSE_TO_ROUNDING
    }

    /// Replaces the right-hand side by the minimum-norm step, in the order of elimination, and finds the floating unknowns.
    fn minimum_norm_step(&mut self, rank: usize) {
        let Floating { equations, now, .. } = self;
        now.fill(false);
        equations.minimum_norm(rank, |unknown, component| now[unknown] |= component.abs() >= NULL_SPACE_COMPONENT);
    }
}

impl Frame {
    /// Whether the residuals at `newton.x`, evaluated last, are within their rounding errors.
    pub(super) fn is_at_rounding(&mut self, solve: &Solve) -> bool {
        self.scale_equations(solve);
        self.floating_of(solve).residual_norm() <= 1.0
    }

    /// Whether they are within the rounding error that their inputs may carry: [`STAGNATION_LIMIT`] times their own.
    pub(super) fn is_near_rounding(&mut self, solve: &Solve) -> bool {
        self.scale_equations(solve);
        self.floating_of(solve).residual_norm() <= STAGNATION_LIMIT
    }

    /// Rank-deficient Newton iteration from `newton.start` to residuals within their rounding errors. Fails as soon as the
    /// Jacobian has full rank. Ends with an evaluation at the solution.
    pub(super) fn solve_rank_deficient(&mut self, solve: &Solve) -> bool {
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
            self.scale_equations(solve);
            let floating = self.floating_of(solve);
            let norm = floating.residual_norm();
            if !floating.equations.matrix.iter().all(|a| a.is_finite()) || norm > CONTRACTION * before && norm > 1.0 {
                return false;
            }
            let rank = floating.equations.eliminate();
            if !floating.is_rank_deficient(rank) {
                return false;
            }
            floating.minimum_norm_step(rank);
            if norm <= 1.0 {
                return true;
            }
            let newton = &mut self.solvers[solve.block.0 as usize].newton;
            let floating = &newton.floating;
            for (&unknown, step) in floating.equations.order.iter().zip(&floating.equations.right) {
                newton.x[unknown] += step * floating.scale[unknown];
            }
            before = norm;
        }
        false
    }

    /// The error of each unknown at the previous solution that the rounding errors of the residuals cause, through the inverse
    /// of the Jacobian; as the scale by which a step of that size counts as converged. Whether one exceeds its unknown's scale.
    pub(super) fn find_rounding_floors(&mut self, solve: &Solve) -> bool {
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
        let mut exceeds = false;
        for (floor, scale) in newton.floor.iter_mut().zip(&mut newton.magnitude) {
            *floor /= CLOSE_TO_ROUNDING;
            exceeds |= *floor > *scale;
            *scale = scale.max(*floor);
        }
        let found = exceeds && newton.floor.iter().all(|floor| floor.is_finite());
        if !found {
            newton.floor.fill(0.0);
        }
        found
    }

    fn floating_of(&mut self, solve: &Solve) -> &mut Floating {
        &mut self.solvers[solve.block.0 as usize].newton.floating
    }

    /// Right-hand side and matrix at the point evaluated last, rows divided by their rounding errors, columns by the inverse
    /// scales of their unknowns.
    fn scale_equations(&mut self, solve: &Solve) {
        self.sum_terms(solve);
        let n = solve.right.len();
        let Frame { r, solvers, terms, .. } = self;
        let newton = &mut solvers[solve.block.0 as usize].newton;
        let largest = newton.x.iter().chain(&newton.previous).fold(0.0f64, |most, x| most.max(x.abs()));
        let floating = &mut newton.floating;
        for j in 0..n {
            let size = newton.x[j].abs().max(newton.previous[j].abs());
            let unknown = if largest > 0.0 { largest } else { 1.0 };
            floating.scale[j] = if size > 0.0 { size } else { unknown };
        }
        floating.equations.clear();
        for (i, &right) in solve.right.iter().enumerate() {
            let rounding = ROUNDING * terms[right as usize];
            floating.rounding[i] = if rounding > 0.0 { rounding } else { f64::MIN_POSITIVE };
            floating.equations.right[i] = (newton.offset[i] - r[right as usize]) / floating.rounding[i];
        }
        let (entries, whole) = (solve.pattern.places().zip(entries(solve, r)), floating.equations.has_matrix());
        for ((i, j), entry) in entries.filter(|_| whole) {
            floating.equations.matrix[i * n + j] = entry * floating.scale[j] / floating.rounding[i];
        }
    }

    /// Evaluates a block again, and for each value the sum of the magnitudes of its terms: running error analysis.
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

    /// The sum of the magnitudes of an operation's terms; `None` where that is the magnitude of its value.
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
