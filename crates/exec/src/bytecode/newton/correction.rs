//! Evaluations of a block, Newton corrections and their norms.
//!
//! The (ordinary) correction at `x` solves `J(x) dx = -F(x)`; the simplified correction at the trial point solves
//! `J(x) dx = -F(trial)` with the same factors, which makes it the measure of the natural monotonicity test. Those of
//! sparse blocks are not refined: what the solution of one misses, the next one finds.

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
        all_finite(&solve.matrix, &self.r) && all_finite(&solve.right, &self.r)
    }

    pub(in crate::bytecode) fn evaluate_root(&mut self, solve: &Solve) -> bool {
        self.evaluate(solve, false)
    }

    pub(in crate::bytecode) fn is_exhausted(&mut self, solve: &Solve) -> bool {
        self.newton_of(solve).exhausted()
    }

    /// Whether all residuals at the point evaluated last are 0.
    pub(super) fn vanishes(&self, solve: &Solve) -> bool {
        let offset = &self.solvers[solve.block.0 as usize].newton.offset;
        solve.right.iter().zip(offset).all(|(&right, &offset)| self.r[right as usize] == offset)
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
        solver.factors.solve_once(&mut newton.correction);
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

    /// Scaled maximum norm of the correction; NaN if it is not finite. What its unknowns are scaled by is kept.
    pub(super) fn correction_norm(&mut self, solve: &Solve) -> f64 {
        let newton = self.newton_of(solve);
        newton.weigh_by_correction();
        let sizes = newton.correction.iter().zip(&newton.weight).map(|(step, weight)| step.abs() * weight);
        let most = sizes.fold(0.0, greatest);
        if most < f64::INFINITY { most } else { f64::NAN }
    }

    /// The simplified correction at the point evaluated last, by the Jacobian factored last, and its norm, scaled as
    /// [`weigh_by_correction`](Newton::weigh_by_correction) has said.
    pub(super) fn simplified_correction_norm(&mut self, solve: &Solve, refined: bool) -> f64 {
        let Frame { r, solvers, .. } = self;
        let solver = &mut solvers[solve.block.0 as usize];
        let newton = &mut solver.newton;
        for (i, &right) in solve.right.iter().enumerate() {
            newton.simplified[i] = newton.offset[i] - r[right as usize];
        }
        match refined {
            true => solver.factors.solve(&mut newton.simplified),
            false => solver.factors.solve_once(&mut newton.simplified),
        }
        let sizes = newton.simplified.iter().zip(&newton.weight).map(|(s, weight)| s.abs() * weight);
        sizes.fold(0.0, greatest)
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

/// The greater one, infinite where the second is no number. A branch that is seldom taken waits for nothing.
#[inline]
pub(super) fn greatest(most: f64, size: f64) -> f64 {
    match size <= most {
        true => most,
        false if size.is_nan() => f64::INFINITY,
        false => size,
    }
}

/// The inverse of the magnitude of each unknown, or of its step where that is greater.
fn weigh(weight: &mut [f64], scale: &[f64], steps: &[f64]) {
    for (weight, (scale, step)) in weight.iter_mut().zip(scale.iter().zip(steps)) {
        *weight = 1.0 / scale.max(step.abs()).max(f64::MIN_POSITIVE);
    }
}

/// Adds steps, with the magnitudes to which they lead.
fn go_on(x: &mut [f64], scale: &mut [f64], steps: &[f64]) {
    for ((x, scale), step) in x.iter_mut().zip(scale).zip(steps) {
        *x += step;
        *scale = scale.max(x.abs());
    }
}

/// Whether these registers are finite: 0 times what is not is no number.
fn all_finite(registers: &[u32], r: &[f64]) -> bool {
    let rest = |v: u32| 0.0 * r[v as usize];
    let (groups, others) = registers.as_chunks::<4>();
    let mut sums = [0.0; 4];
    groups.iter().for_each(|group| (0..4).for_each(|i| sums[i] += rest(group[i])));
    others.iter().fold(sums.iter().sum(), |sum: f64, &v| sum + rest(v)) == 0.0
}

impl Newton {
    /// Scales unknowns by their magnitudes so far, or by their corrections where these are greater.
    pub(super) fn weigh_by_correction(&mut self) {
        weigh(&mut self.weight, &self.scale, &self.correction);
    }

    /// The same by the first corrections.
    pub(super) fn weigh_by_first_correction(&mut self) {
        weigh(&mut self.weight, &self.scale, &self.first_correction);
    }

    /// Goes to the start.
    pub(super) fn begin_iteration(&mut self) {
        self.x.copy_from_slice(&self.start);
        (self.contracts, self.rests) = (true, false);
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

    /// Goes on by the correction.
    pub(super) fn add_correction(&mut self) {
        go_on(&mut self.x, &mut self.scale, &self.correction);
    }

    pub(super) fn add_simplified_correction(&mut self) {
        go_on(&mut self.x, &mut self.scale, &self.simplified);
    }

    /// Gives an unknown that is 0, and stays so in the first correction, the magnitude at which it would count in one of
    /// the equations: small changes of it afterwards are no failure of the step. The unknown of a flat law may be one.
    fn scale_unknowns_at_rest(&mut self, solve: &Solve, r: &[f64]) {
        let Newton { scale, correction, simplified: least, .. } = self;
        if scale.iter().zip(&*correction).all(|(&scale, &step)| scale != 0.0 || step != 0.0) {
            return;
        }
        least.fill(f64::INFINITY);
        for row in (0..scale.len()).map(|row| solve.pattern.row(row)) {
            let entries = row.map(|e| (solve.pattern.columns()[e] as usize, r[solve.matrix[e] as usize].abs()));
            // What rests adds nothing.
            let others = entries.clone().fold(0.0, |sum, (k, entry)| sum + entry * scale[k].max(correction[k].abs()));
            for (k, own) in entries.filter(|&(_, own)| own > 0.0 && others > 0.0) {
                least[k] = least[k].min(others / own);
            }
        }
        for ((scale, &step), &least) in scale.iter_mut().zip(&*correction).zip(&*least) {
            if *scale == 0.0 && step == 0.0 && least < f64::INFINITY {
                *scale = least;
            }
        }
    }
}
