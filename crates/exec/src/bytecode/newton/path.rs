//! Whether a root is the continuation of the one at which the iteration started.

use super::correction::greatest;
use super::workspace::Newton;
use super::{CLOSE_TO_ROUNDING, REGULAR};
use crate::bytecode::frame::{Frame, entries};
use crate::bytecode::instruction::Solve;

/// Points at which the way from the start to a root is looked at.
pub(super) const PATH_POINTS: usize = 8;
/// The same where it may be long.
const PATH_POINTS_FINE: usize = 64;
/// A Jacobian whose entries change by less than this part of their row does not change.
const LINEAR: f64 = 1e-9;

impl Frame {
    /// Whether the root found is without doubt the continuation of the start: the first, undamped step contracted, and the
    /// first correction would be much the same with the Jacobian at the root.
    pub(super) fn is_continuation(&mut self, solve: &Solve) -> bool {
        let solver = &mut self.solvers[solve.block.0 as usize];
        let newton = &mut solver.newton;
        let rests = newton.rests || newton.first_correction.iter().all(|&first| first == 0.0);
        if !newton.contracts || rests {
            return newton.contracts;
        }
        let n = newton.x.len();
        newton.weigh_by_first_correction();
        let firsts = newton.first_correction.iter().zip(&newton.weight).map(|(first, weight)| first.abs() * weight);
        let most = firsts.fold(CLOSE_TO_ROUNDING, greatest);
        newton
            .simplified
            .iter_mut()
            .zip(newton.x.iter().zip(&newton.start))
            .for_each(|(way, (x, start))| *way = x - start);
        let mut off = newton.distance_from_first_correction();
        // What the first correction would have been with the last Jacobian; with the first one it is itself.
        if !newton.first_factors {
            newton.simplified.copy_from_slice(&newton.first_right);
            solver.factors.solve_once(&mut newton.simplified);
            off = off.max(newton.distance_from_first_correction());
        }
        newton.regular = off <= REGULAR * most;
        if !newton.following {
            return off <= 0.5 * most;
        }
        // And that of the Jacobian at the root where the iteration started.
        for i in 0..n {
            let (row, columns) = (solve.pattern.row(i), solve.pattern.columns());
            let terms = row.map(|e| newton.start_jacobian[e] * newton.first_correction[columns[e] as usize]);
            newton.simplified[i] = terms.sum();
        }
        solver.factors.solve_once(&mut newton.simplified);
        let off = off.max(newton.distance_from_first_correction());
        newton.regular = off <= REGULAR * most;
        off <= 0.5 * most
    }

    /// Whether the natural level function falls all the way from the start to the root, and the determinant of the Jacobian
    /// keeps its sign: no fold and no pole lies between them. Ends with an evaluation at the root.
    pub(super) fn path_is_regular(&mut self, solve: &Solve, points: usize) -> bool {
        let regular = self.path_is_regular_at(solve, points);
        regular & self.evaluate(solve, false)
    }

    fn path_is_regular_at(&mut self, solve: &Solve, points: usize) -> bool {
        // Measured by the Jacobian at the root, or where that is singular by that at the start.
        if ![1.0, 0.0].into_iter().any(|part| self.evaluate_on_path(solve, part) && self.factor(solve)) {
            return false;
        }
        self.newton_of(solve).weigh_by_correction();
        let mut before = f64::INFINITY;
        for point in 0..=points {
            if !self.evaluate_on_path(solve, point as f64 / points as f64) {
                return false;
            }
            let level = self.simplified_correction_norm(solve, true);
            if level.is_nan() || level > before * (1.0 + CLOSE_TO_ROUNDING) + CLOSE_TO_ROUNDING {
                return false;
            }
            before = level;
        }
        let mut sign = self.determinant_sign_at_start(solve);
        for point in 0..=points {
            let good = self.evaluate_on_path(solve, point as f64 / points as f64);
            // A point at which the Jacobian is singular, such as 0 of a cube, is no fold unless the sign changes there.
            if good && self.factor(solve) {
                let here = self.solvers[solve.block.0 as usize].factors.is_positive();
                if *sign.get_or_insert(here) != here {
                    return false;
                }
            }
        }
        true
    }

    /// Whether the determinant of the Jacobian is positive at the start, where that is a solution followed, and regular.
    fn determinant_sign_at_start(&mut self, solve: &Solve) -> Option<bool> {
        let solver = &mut self.solvers[solve.block.0 as usize];
        let entries = solver.newton.start_jacobian.iter().copied();
        (solver.newton.following && solver.factors.factor(entries).is_ok()).then(|| solver.factors.is_positive())
    }

    /// Whether the root found is without doubt the only one near the line to it. Ends with an evaluation at the root.
    pub(super) fn is_unique_near_path(&mut self, solve: &Solve) -> bool {
        let linear = self.is_linear_on_path(solve);
        (linear || self.path_is_regular_at(solve, PATH_POINTS_FINE)) & self.evaluate(solve, false)
    }

    /// Whether the Jacobian is the same all the way from the start to `x`: what differs is rounding.
    pub(super) fn is_linear_on_path(&mut self, solve: &Solve) -> bool {
        let n = solve.right.len();
        let mut same = true;
        for point in 0..=PATH_POINTS {
            same &= self.evaluate_on_path(solve, point as f64 / PATH_POINTS as f64);
            let Frame { r, solvers, .. } = self;
            let newton = &mut solvers[solve.block.0 as usize].newton;
            if point == 0 {
                newton.jacobian.iter_mut().zip(entries(solve, r)).for_each(|(j, entry)| *j = entry);
            }
            for row in (0..n).map(|i| solve.pattern.row(i)) {
                let (before, now) = (&newton.jacobian[row.clone()], &solve.matrix[row]);
                let most = before.iter().fold(0.0f64, |most, j| most.max(j.abs()));
                same &= before.iter().zip(now).all(|(j, &m)| (r[m as usize] - j).abs() <= LINEAR * most);
            }
        }
        same
    }

    /// Evaluates a point on the line from the start (0) to the root (1).
    fn evaluate_on_path(&mut self, solve: &Solve, part: f64) -> bool {
        let newton = self.newton_of(solve);
        for i in 0..newton.x.len() {
            let way = part * (newton.x[i] - newton.start[i]);
            // The root itself, and not what rounding makes of the way to it.
            newton.trial[i] = if part == 1.0 { newton.x[i] } else { newton.start[i] + way };
        }
        self.evaluate(solve, true)
    }
}

impl Newton {
    /// Scaled norm of the difference between `simplified` and the first correction.
    fn distance_from_first_correction(&self) -> f64 {
        let mut most: f64 = 0.0;
        for i in 0..self.simplified.len() {
            most = greatest(most, (self.simplified[i] - self.first_correction[i]).abs() * self.weight[i]);
        }
        most
    }
}
