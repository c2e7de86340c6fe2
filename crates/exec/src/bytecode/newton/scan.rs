//! One equation in one unknown: a search for a change of sign over all magnitudes, then bisection.

use super::damped::Globalization;
use crate::bytecode::frame::{Frame, SolveError};
use crate::bytecode::instruction::Solve;

/// Powers of ten between which it is scanned, and points per power.
const SCANNED: (i32, i32, i32) = (-12, 12, 20);

impl Frame {
    /// A root anywhere, those near the previous solution first; left in `newton.x`.
    pub(super) fn scan(&mut self, solve: &Solve) -> bool {
        self.newton_of(solve).offset.fill(0.0);
        let middle = self.newton_of(solve).previous[0];
        let mut ends = [None; 2];
        for distance in scan_distances() {
            for (end, sign) in ends.iter_mut().zip([1.0, -1.0]) {
                let at = middle + sign * distance;
                let here = self.residual_at(solve, at);
                let before = std::mem::replace(end, here.map(|r| (at, r)));
                let (Some(r), Some(before)) = (here, before) else { continue };
                if r.signum() != before.1.signum() && self.bisect(solve, before, (at, r)) {
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

    /// Bisects an interval at whose ends the residual differs in sign. A pole is no root.
    pub(super) fn bisect(&mut self, solve: &Solve, mut a: (f64, f64), mut b: (f64, f64)) -> bool {
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
        self.newton_of(solve).start[0] = best.0;
        self.newton_of(solve).evaluations = 0;
        self.iterate(solve, Globalization::Damped).is_ok()
    }

    /// Where the residual of a block without root is least.
    pub(super) fn least_residual(&mut self, solve: &Solve) -> SolveError {
        let middle = self.newton_of(solve).previous[0];
        let mut best = (middle, self.residual_at(solve, middle).map_or(f64::INFINITY, f64::abs));
        for distance in scan_distances() {
            for at in [middle + distance, middle - distance] {
                let r = self.residual_at(solve, at).map_or(f64::INFINITY, f64::abs);
                if r < best.1 {
                    best = (at, r);
                }
            }
        }
        SolveError::NoSolution { block: solve.block.0, nearest: best.0, residual: best.1 }
    }
}

/// Distances from tiny to huge.
fn scan_distances() -> impl Iterator<Item = f64> {
    let (low, high, points) = SCANNED;
    std::iter::once(0.0)
        .chain((low * points..=high * points).map(move |k| crate::math::pow(10.0, f64::from(k) / f64::from(points))))
}
