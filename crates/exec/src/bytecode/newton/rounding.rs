//! Roots that no step tells, since it is rounding.

use crate::bytecode::frame::Frame;
use crate::bytecode::instruction::Solve;

/// Residuals below this part of their terms are rounding.
const ROUNDING: f64 = 2.0 * f64::EPSILON;

impl Frame {
    /// Whether the memory still solves the equations to rounding: where an unknown is 0 but for the rounding of others,
    /// no step is small against it.
    pub(super) fn stays(&mut self, solve: &Solve) -> bool {
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
            let entries = solve.matrix[i * n..][..n].iter().zip(&newton.memory);
            let terms = entries.fold(0.0, |sum, (&m, x)| sum + (r[m as usize] * x).abs());
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

    /// Whether the Jacobian is the same at `x` and a whole step from there: that the step does not help is rounding.
    pub(super) fn is_rounding(&mut self, solve: &Solve) -> bool {
        let newton = self.newton_of(solve);
        newton.began.copy_from_slice(&newton.kept);
        newton.kept.iter_mut().zip(newton.x.iter().zip(&newton.step)).for_each(|(k, (x, step))| *k = x + step);
        let linear = self.is_linear(solve);
        let newton = self.newton_of(solve);
        newton.kept.copy_from_slice(&newton.began);
        linear & self.evaluate(solve, false)
    }
}
