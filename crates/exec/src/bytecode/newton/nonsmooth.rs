//! Laws whose derivative jumps: a step to just beyond the nonsmooth point.

use super::damped::shortened;
use crate::bytecode::frame::Frame;
use crate::bytecode::instruction::Solve;

/// Between two points whose Jacobians differ by more than the first part of their rows lies a nonsmooth point; none if they
/// differ by less than the second.
const JACOBIAN_DIFFERS: f64 = 0.5;
const JACOBIAN_ALIKE: f64 = 1e-3;
/// Bisections of the way to it.
const BISECTIONS: usize = 60;

impl Frame {
    /// Goes along the correction, which is `norm` long, to just beyond where the Jacobian jumps: where the derivative of a law
    /// jumps, Newton's model ends. So near behind it the correction has become shorter by what was gone of it, whatever the
    /// laws do further on. Ends with an evaluation of the trial point, or at `x`.
    pub(super) fn crosses_nonsmooth_point(&mut self, solve: &Solve, norm: f64) -> bool {
        if !self.evaluate(solve, false) {
            return false;
        }
        self.store_jacobian(solve);
        let (mut before, mut beyond) = (0.0, 1.0);
        for _ in 0..BISECTIONS {
            self.newton_of(solve).set_trial(beyond);
            let finite = self.evaluate(solve, true);
            let change = if finite { self.jacobian_change(solve) } else { f64::INFINITY };
            match change {
                change if change > JACOBIAN_DIFFERS => {
                    let just_beyond = finite && beyond - before <= JACOBIAN_ALIKE * beyond;
                    if just_beyond && self.simplified_correction_norm(solve, false) <= shortened(beyond) * norm {
                        return true;
                    }
                    beyond = 0.5 * (before + beyond);
                }
                // No nonsmooth point: the Jacobian changes little by little, or not at all.
                change if change > JACOBIAN_ALIKE || before == 0.0 && beyond == 1.0 => break,
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

    /// How far the Jacobian evaluated last is from the one stored, relative to the entries of a row.
    fn jacobian_change(&self, solve: &Solve) -> f64 {
        let n = solve.right.len();
        let stored = &self.solvers[solve.block.0 as usize].newton.jacobian;
        let mut change: f64 = 0.0;
        for row in (0..n).map(|i| solve.pattern.row(i)) {
            let (before, now) = (&stored[row.clone()], &solve.matrix[row]);
            let most = before.iter().fold(f64::MIN_POSITIVE, |most, j| most.max(j.abs()));
            before.iter().zip(now).for_each(|(j, &m)| change = change.max((self.r[m as usize] - j).abs() / most));
        }
        change
    }
}
