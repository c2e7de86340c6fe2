//! Steps of least norm to where the equations tell all unknowns. Far up an exponential law what other equations say is lost in
//! its rounding, and a whole step is noise: what is told moves and the rest stays, until the law has come down.

use super::correction::greatest;
use super::damped::Globalization;
use crate::bytecode::floating::Floating;
use crate::bytecode::frame::{Frame, entries};
use crate::bytecode::instruction::Solve;

/// Steps at most.
const STEPS: usize = 2_000;
/// What others leave of an equation is rounding below this part of it.
const ROUNDING: f64 = 4096.0 * f64::EPSILON;
/// Least damping factor.
const MIN_DAMPING: f64 = 1e-6;
/// How often rows and columns are scaled in turn.
const SCALINGS: usize = 3;

impl Frame {
    /// Steps of least norm from `newton.start` to where the Jacobian has full rank, and the damped iteration from there. Where it
    /// has so at once that has been tried.
    pub(super) fn iterate_by_least_norm(&mut self, solve: &Solve) -> bool {
        let newton = self.newton_of(solve);
        newton.x.copy_from_slice(&newton.start);
        if solve.right.len() == 1 || !newton.floating.equations.has_matrix() || !self.evaluate(solve, false) {
            return false;
        }
        for step in 0..STEPS {
            self.balance_equations(solve);
            let rank = self.newton_of(solve).floating.equations.eliminate();
            if rank == solve.right.len() {
                let newton = self.newton_of(solve);
                newton.start.copy_from_slice(&newton.x);
                return step > 0 && self.iterate(solve, Globalization::Damped).is_ok();
            }
            if !self.step_of_least_norm(solve, rank) {
                return false;
            }
        }
        false
    }

    /// Goes along the step of least norm, halved until it leaves less of the equations; whether it comes to that.
    fn step_of_least_norm(&mut self, solve: &Solve, rank: usize) -> bool {
        let before = self.left_of_equations(solve);
        let newton = self.newton_of(solve);
        newton.floating.equations.minimum_norm(rank, |_, _| {});
        let Floating { equations, scale, .. } = &newton.floating;
        for (&unknown, step) in equations.order.iter().zip(&equations.right) {
            newton.correction[unknown] = step * scale[unknown];
        }
        let mut damping = 1.0;
        while damping >= MIN_DAMPING && !self.is_exhausted(solve) {
            self.newton_of(solve).set_trial(damping);
            if self.evaluate(solve, true) && self.left_of_equations(solve) < before {
                self.newton_of(solve).accept_trial();
                return true;
            }
            damping *= 0.5;
        }
        false
    }

    /// The greatest residual at the point evaluated last, by the magnitudes of their rows where they were balanced last.
    fn left_of_equations(&self, solve: &Solve) -> f64 {
        let newton = &self.solvers[solve.block.0 as usize].newton;
        let rows = newton.offset.iter().zip(&newton.floating.rounding);
        let sizes = solve.right.iter().zip(rows).map(|(&v, (offset, row))| (self.r[v as usize] - offset).abs() / row);
        sizes.fold(0.0, greatest)
    }

    /// The linearised equations at the point evaluated last: rows and columns with greatest entries of 1, in units of what is
    /// rounding.
    fn balance_equations(&mut self, solve: &Solve) {
        let n = solve.right.len();
        let Frame { r, solvers, .. } = self;
        let newton = &mut solvers[solve.block.0 as usize].newton;
        let Floating { equations, scale, rounding: rows, .. } = &mut newton.floating;
        let most = &mut newton.simplified;
        let jacobian = || solve.pattern.places().zip(entries(solve, r));
        scale.fill(1.0);
        for _ in 0..SCALINGS {
            rows.fill(0.0);
            jacobian().for_each(|((i, j), entry)| rows[i] = greatest(rows[i], entry.abs() * scale[j]));
            rows.iter_mut().filter(|row| **row == 0.0).for_each(|row| *row = 1.0);
            most.fill(0.0);
            jacobian().for_each(|((i, j), entry)| most[j] = greatest(most[j], entry.abs() / rows[i]));
            scale.iter_mut().zip(&*most).filter(|(_, most)| **most > 0.0).for_each(|(scale, most)| *scale = 1.0 / most);
        }
        equations.clear();
        for (i, &right) in solve.right.iter().enumerate() {
            equations.right[i] = (newton.offset[i] - r[right as usize]) / rows[i] / ROUNDING;
        }
        for ((i, j), entry) in jacobian() {
            equations.matrix[i * n + j] = entry * scale[j] / rows[i] / ROUNDING;
        }
    }
}
