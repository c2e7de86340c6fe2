//! Kinks of a law on the way.

use crate::bytecode::frame::Frame;
use crate::bytecode::instruction::Solve;

/// A Jacobian whose entries change by more than this part of their row at once has a kink, by less than that none yet.
const OTHER_SLOPE: f64 = 0.5;
const SAME_SLOPE: f64 = 1e-3;
/// Halvings of the way to a kink.
const KINK_HALVINGS: usize = 60;

impl Frame {
    /// Goes along the step to just beyond where the Jacobian changes, if no residual grows on that way: where a law has a
    /// kink, its slope before tells nothing of the way behind. Ends with an evaluation of the trial point, or at `x`.
    pub(super) fn crosses_kink(&mut self, solve: &Solve) -> bool {
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
        for (row, entries) in kept.chunks(n).zip(solve.matrix.chunks(n)) {
            let most = row.iter().fold(f64::MIN_POSITIVE, |most, j| most.max(j.abs()));
            row.iter().zip(entries).for_each(|(j, &m)| change = change.max((self.r[m as usize] - j).abs() / most));
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
}
