//! Evaluations of a block, Newton corrections and their norms.
//!
//! The (ordinary) correction at `x` solves `J(x) dx = -F(x)`; the simplified correction at the trial point solves
//! `J(x) dx = -F(trial)` with the same factors, which makes it the measure of the natural monotonicity test.

use super::workspace::Newton;
use crate::bytecode::frame::{Frame, entries};
use crate::bytecode::instruction::Solve;

impl Frame {
    /// Runs the code at `x` (or the trial point); whether residuals and Jacobian are finite.
    pub(super) fn evaluate(&mut self, solve: &Solve, trial: bool) -> bool {
        let newton = self.newton_of(solve);
        newton.evaluations += 1;
        let newton = &self.solvers[solve.block.0 as usize].newton;
        let point = if trial { &newton.trial } else { &newton.x };
        solve.guess.iter().zip(point).for_each(|(&g, &x)| self.r[g as usize] = x);
        self.inner::<false>(solve);
        solve.matrix.iter().chain(&solve.right).all(|&v| self.r[v as usize].is_finite())
    }

    pub(in crate::bytecode) fn evaluate_root(&mut self, solve: &Solve) -> bool {
        self.evaluate(solve, false)
    }

    pub(in crate::bytecode) fn is_exhausted(&mut self, solve: &Solve) -> bool {
        self.newton_of(solve).exhausted()
    }

    /// Greatest residual at the point evaluated last.
    pub(super) fn residual(&self, solve: &Solve) -> f64 {
        let offset = &self.solvers[solve.block.0 as usize].newton.offset;
        let residuals = solve.right.iter().zip(offset).map(|(&v, o)| (self.r[v as usize] - o).abs());
        residuals.fold(0.0, f64::max)
    }

    /// Factors the Jacobian at the point evaluated last; whether it is regular.
    pub(in crate::bytecode) fn factor(&mut self, solve: &Solve) -> bool {
        let Frame { r, solvers, .. } = self;
        solvers[solve.block.0 as usize].factors.factor(entries(solve, r)).is_ok()
    }

    /// The Newton correction at the point evaluated last.
    pub(super) fn newton_correction(&mut self, solve: &Solve) {
        let Frame { r, solvers, .. } = self;
        let solver = &mut solvers[solve.block.0 as usize];
        let newton = &mut solver.newton;
        for (i, &right) in solve.right.iter().enumerate() {
            newton.correction[i] = newton.offset[i] - r[right as usize];
        }
        solver.factors.solve(&mut newton.correction);
    }

    /// Keeps the first correction and its right-hand side, from which the continuation is judged.
    pub(super) fn store_first_correction(&mut self, solve: &Solve) {
        let Frame { r, solvers, .. } = self;
        let newton = &mut solvers[solve.block.0 as usize].newton;
        newton.first_correction.copy_from_slice(&newton.correction);
        for (i, &right) in solve.right.iter().enumerate() {
            newton.first_right[i] = newton.offset[i] - r[right as usize];
        }
        newton.scale_unknowns_at_rest(solve, r);
    }

    /// Scaled maximum norm of the correction; NaN if it is not finite.
    pub(super) fn correction_norm(&mut self, solve: &Solve) -> f64 {
        let newton = self.newton_of(solve);
        let mut most: f64 = 0.0;
        for i in 0..newton.correction.len() {
            let size = newton.correction[i].abs();
            if !size.is_finite() {
                return f64::NAN;
            }
            most = most.max(size / newton.scale[i].max(size).max(f64::MIN_POSITIVE));
        }
        most
    }

    /// The simplified correction at the point evaluated last, by the Jacobian factored last, and its norm, scaled as
    /// [`correction_norm`](Self::correction_norm).
    pub(super) fn simplified_correction_norm(&mut self, solve: &Solve) -> f64 {
        let Frame { r, solvers, .. } = self;
        let solver = &mut solvers[solve.block.0 as usize];
        let newton = &mut solver.newton;
        for (i, &right) in solve.right.iter().enumerate() {
            newton.simplified[i] = newton.offset[i] - r[right as usize];
        }
        solver.factors.solve(&mut newton.simplified);
        let mut most: f64 = 0.0;
        for i in 0..newton.simplified.len() {
            let scale = newton.scale[i].max(newton.correction[i].abs()).max(f64::MIN_POSITIVE);
            let size = newton.simplified[i].abs() / scale;
            most = if size.is_nan() { f64::INFINITY } else { most.max(size) };
        }
        most
    }

    /// Leaves a point at which the Jacobian is singular.
    pub(super) fn perturb(&mut self, solve: &Solve, iteration: usize) {
        let newton = self.newton_of(solve);
        newton.contracts = false;
        for (i, x) in newton.x.iter_mut().enumerate() {
            let away = 1e-3 * (1.0 + iteration as f64) * newton.scale[i].max(1.0);
            *x += if i % 2 == iteration % 2 { away } else { 0.5 * away };
        }
    }
}

impl Newton {
    /// Goes to the start.
    pub(super) fn begin_iteration(&mut self) {
        self.x.copy_from_slice(&self.start);
        self.contracts = true;
        self.first_correction.fill(0.0);
        self.first_right.fill(0.0);
        for i in 0..self.x.len() {
            self.scale[i] = self.x[i].abs().max(self.floor[i]);
        }
    }

    /// The trial point: `x` and this part of the correction.
    pub(super) fn set_trial(&mut self, damping: f64) {
        for i in 0..self.x.len() {
            self.trial[i] = self.x[i] + damping * self.correction[i];
        }
    }

    pub(super) fn accept_trial(&mut self) {
        self.x.copy_from_slice(&self.trial);
        self.scale.iter_mut().zip(&self.x).for_each(|(scale, x)| *scale = scale.max(x.abs()));
    }

    pub(super) fn add_simplified_correction(&mut self) {
        for i in 0..self.x.len() {
            self.x[i] += self.simplified[i];
            self.scale[i] = self.scale[i].max(self.x[i].abs());
        }
    }

    /// Gives an unknown that is 0, and stays so in the first correction, the magnitude at which it would count in one of
    /// the equations: small changes of it afterwards are no failure of the step. The unknown of a flat law may be one.
    fn scale_unknowns_at_rest(&mut self, solve: &Solve, r: &[f64]) {
        let n = self.x.len();
        for j in 0..n {
            if self.scale[j] != 0.0 || self.correction[j] != 0.0 {
                continue;
            }
            let mut least = f64::INFINITY;
            for row in 0..n {
                let (mut own, mut others) = (0.0, 0.0);
                for e in solve.pattern.row(row) {
                    let (k, entry) = (solve.pattern.columns()[e] as usize, r[solve.matrix[e] as usize].abs());
                    match k == j {
                        true => own = entry,
                        false => others += entry * self.scale[k].max(self.correction[k].abs()),
                    }
                }
                if own > 0.0 && others > 0.0 {
                    least = least.min(others / own);
                }
            }
            if least < f64::INFINITY {
                self.scale[j] = least;
            }
        }
    }
}
