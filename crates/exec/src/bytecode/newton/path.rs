//! Whether a root goes on from the one where the attempt began.

use super::SETTLED;
use super::workspace::Newton;
use crate::bytecode::frame::Frame;
use crate::bytecode::instruction::Solve;

/// Points at which the way to a solution that is not near is looked at.
pub(super) const LOOKS: usize = 8;
/// The same where the way may be long.
const MORE_LOOKS: usize = 64;
/// A Jacobian whose entries change by less than this part of their row does not change.
const LINEAR: f64 = 1e-9;

impl Frame {
    /// Whether the root found is without doubt the one that goes on from where the attempt began: the first step, taken
    /// whole, came near to it, and the Jacobian there is much the same as at the beginning.
    pub(super) fn goes_on(&mut self, solve: &Solve) -> bool {
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
        solver.lu.solve(&mut newton.next);
        let off = off.max(newton.off_the_lead());
        if !newton.following {
            return off <= 0.5 * most;
        }
        // And that of the Jacobian at the root where it began.
        for i in 0..n {
            newton.next[i] = newton.base[i * n..][..n].iter().zip(&newton.lead).map(|(j, lead)| j * lead).sum();
        }
        solver.lu.solve(&mut newton.next);
        off.max(newton.off_the_lead()) <= 0.5 * most
    }

    /// Whether the residuals shrink all the way from where the attempt began to the root, and the Jacobian never changes
    /// its orientation: no fold and no pole lies between them. Ends with an evaluation at the root.
    pub(super) fn is_straight(&mut self, solve: &Solve, looks: usize) -> bool {
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
                let here = self.solvers[solve.block.0 as usize].lu.is_positive();
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
        solver.lu.matrix().copy_from_slice(&solver.newton.base);
        (solver.newton.following && solver.lu.factor().is_ok()).then(|| solver.lu.is_positive())
    }

    /// Whether the root found is without doubt the only one near the way to it. Ends with an evaluation at the root.
    pub(super) fn is_the_only_one(&mut self, solve: &Solve) -> bool {
        let linear = self.is_linear(solve);
        (linear || self.is_straight_at(solve, MORE_LOOKS)) & self.evaluate(solve, false)
    }

    /// Whether the Jacobian is the same all the way from where the attempt began to `x`: what differs is rounding.
    pub(super) fn is_linear(&mut self, solve: &Solve) -> bool {
        let n = solve.right.len();
        let mut same = true;
        for look in 0..=LOOKS {
            same &= self.look(solve, look as f64 / LOOKS as f64);
            let Frame { r, solvers, .. } = self;
            let newton = &mut solvers[solve.block.0 as usize].newton;
            if look == 0 {
                newton.jacobian.iter_mut().zip(&solve.matrix).for_each(|(j, &m)| *j = r[m as usize]);
            }
            for (row, entries) in newton.jacobian.chunks(n).zip(solve.matrix.chunks(n)) {
                let most = row.iter().fold(0.0f64, |most, j| most.max(j.abs()));
                same &= row.iter().zip(entries).all(|(j, &m)| (r[m as usize] - j).abs() <= LINEAR * most);
            }
        }
        same
    }

    /// Evaluates a point on the way from where the attempt began (0) to the root (1).
    fn look(&mut self, solve: &Solve, part: f64) -> bool {
        let newton = self.newton_of(solve);
        for i in 0..newton.x.len() {
            newton.trial[i] = newton.kept[i] + part * (newton.x[i] - newton.kept[i]);
        }
        self.evaluate(solve, true)
    }
}

impl Newton {
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
}
