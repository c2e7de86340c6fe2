//! Roots at which corrections are rounding.

use crate::bytecode::frame::Frame;
use crate::bytecode::instruction::Solve;

/// Residuals below this part of their terms are rounding.
const ROUNDING: f64 = 2.0 * f64::EPSILON;

impl Frame {
    /// Whether the previous solution still solves the equations to rounding: where an unknown is 0 but for the rounding of
    /// others, no correction is small against it.
    pub(super) fn previous_is_root(&mut self, solve: &Solve) -> bool {
        let n = solve.right.len();
        let newton = self.newton_of(solve);
        newton.trial.copy_from_slice(&newton.previous);
        if !self.evaluate(solve, true) {
            // Where a derivative is infinite, as that of a root at 0, there is no correction: the residuals tell.
            let vanishes = solve.right.iter().all(|&right| self.r[right as usize] == 0.0);
            let newton = self.newton_of(solve);
            newton.x.copy_from_slice(&newton.previous);
            return vanishes;
        }
        for i in 0..n {
            let Frame { r, solvers, .. } = &mut *self;
            let newton = &mut solvers[solve.block.0 as usize].newton;
            let row =
                solve.pattern.row(i).map(|e| (solve.matrix[e], newton.previous[solve.pattern.columns()[e] as usize]));
            let terms = row.fold(0.0, |sum, (m, x)| sum + (r[m as usize] * x).abs());
            newton.previous_residual[i] = r[solve.right[i] as usize];
            newton.magnitude[i] = ROUNDING * terms;
        }
        // Change of the residuals by the last digits of what the block reads.
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
                newton.magnitude[i] += (moved - newton.previous_residual[i]).abs();
            }
        }
        let newton = self.newton_of(solve);
        let mut residuals = newton.previous_residual.iter().zip(&newton.magnitude);
        if residuals.any(|(residual, rounding)| residual.abs() > *rounding) {
            return false;
        }
        newton.x.copy_from_slice(&newton.previous);
        newton.trial.copy_from_slice(&newton.previous);
        self.evaluate(solve, true)
    }

    /// Whether the Jacobian is the same at `x` and a whole correction from there: that it does not help is rounding.
    pub(super) fn stagnates_at_rounding(&mut self, solve: &Solve) -> bool {
        let newton = self.newton_of(solve);
        newton.saved_start.copy_from_slice(&newton.start);
        newton.start.iter_mut().zip(newton.x.iter().zip(&newton.correction)).for_each(|(k, (x, step))| *k = x + step);
        let linear = self.is_linear_on_path(solve);
        let newton = self.newton_of(solve);
        newton.start.copy_from_slice(&newton.saved_start);
        linear & self.evaluate(solve, false)
    }
}
