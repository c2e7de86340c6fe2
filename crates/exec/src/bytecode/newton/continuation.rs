//! Continuation: from root to root along a path, with a step length that doubles and halves.

use super::damped::Globalization;
use super::path::PATH_POINTS;
use crate::bytecode::frame::Frame;
use crate::bytecode::instruction::Solve;

/// Least step of the path parameter, which is 0 at the previous solution and 1 at the next.
const MIN_PATH_STEP: f64 = 1e-6;
/// Step of the path parameter below which a few points tell whether the path is regular: over a nonsmooth point of a law
/// no step contracts. The solution must have moved by no more than `SHORT_MOVE` of its magnitude.
const SHORT_PATH_STEP: f64 = 1e-3;
const SHORT_MOVE: f64 = 1e-2;

impl Frame {
    /// Follows a path of roots from the previous solution, in steps short enough to tell the root: its parameter `s` blends
    /// what the block read then into what it reads now; from a point that is no root, the path is that of the Newton
    /// homotopy `F(x) = (1 - s) F(previous)`.
    pub(super) fn continue_in_steps(&mut self, solve: &Solve) -> bool {
        let newton = self.newton_of(solve);
        newton.start_at_previous();
        newton.x.copy_from_slice(&newton.previous);
        if !newton.following && !self.evaluate(solve, false) {
            return false;
        }
        for (i, &right) in solve.right.iter().enumerate() {
            let residual = self.r[right as usize];
            self.newton_of(solve).previous_residual[i] = residual;
        }
        let (mut s, mut path_step) = (0.0f64, 0.25f64);
        while path_step > MIN_PATH_STEP && !self.newton_of(solve).exhausted() {
            let next = (s + path_step).min(1.0);
            self.set_path_parameter(solve, next);
            let short = path_step <= SHORT_PATH_STEP;
            let globalization = if short { Globalization::Brief } else { Globalization::Local };
            let found = self.iterate(solve, globalization).is_ok();
            let is_continuation = found
                && (self.is_continuation(solve)
                    || short && self.moves_little(solve) && self.path_is_regular(solve, PATH_POINTS));
            if is_continuation || self.solve_rank_deficient(solve) {
                if is_continuation {
                    self.newton_of(solve).floating.now.fill(false);
                }
                if next == 1.0 {
                    return true;
                }
                self.store_jacobian(solve);
                let newton = self.newton_of(solve);
                newton.start.copy_from_slice(&newton.x);
                newton.start_jacobian.copy_from_slice(&newton.jacobian);
                (s, path_step) = (next, 2.0 * path_step);
            } else {
                path_step *= 0.5;
            }
        }
        self.set_path_parameter(solve, 1.0);
        false
    }

    /// Sets what the block reads, or the offset of its residuals, to their values at `s`.
    fn set_path_parameter(&mut self, solve: &Solve, s: f64) {
        let Frame { r, solvers, .. } = self;
        let newton = &mut solvers[solve.block.0 as usize].newton;
        if !newton.following {
            newton.offset.iter_mut().zip(&newton.previous_residual).for_each(|(o, f)| *o = (1.0 - s) * f);
            return;
        }
        for (&register, (now, before)) in solve.outer.iter().zip(newton.outer.iter().zip(&newton.previous_outer)) {
            r[register as usize] = if s == 1.0 { *now } else { before + s * (now - before) };
        }
    }

    fn moves_little(&mut self, solve: &Solve) -> bool {
        let newton = self.newton_of(solve);
        let little = |i: usize| (newton.x[i] - newton.start[i]).abs() <= SHORT_MOVE * newton.magnitude[i];
        (0..newton.x.len()).all(little)
    }
}
