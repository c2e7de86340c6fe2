//! Radau IIA of order 5: implicit, stiffly accurate, for stiff and implicit systems up to index 3. Source: [HW], IV.8.
//!
//! Unknown are the increments `z_i` of the three stages: `F(t + c_i h, y + z_i, (1/h) Σ_j w_ij z_j) = 0` with `w` the
//! inverse of the matrix of the method. Simplified Newton multiplies these equations by the transformation that makes `w`
//! block diagonal, so that a step needs one real and one complex factorisation of `factor · ∂F/∂y' + ∂F/∂y`, not one
//! three times as large. One formulation serves explicit, semi-explicit and fully implicit systems.

mod collocation;
mod control;
mod explicit;
mod matrices;
mod newton;
mod tableau;
#[cfg(test)]
mod tests;
mod within;

use faer::c64;

use crate::{Failure, ImplicitSystem, Sparsity, Summary};
use collocation::Collocation;
use control::Control;
pub(crate) use explicit::Explicit;
use matrices::Matrices;
use tableau::{ALPHA, BETA, ERROR, REAL, STAGES};

/// The increments of all unknowns at each stage, or anything else of that shape.
type Stages = [Vec<f64>; STAGES];

/// Singular matrices in one step after which there is no hope.
const MOST_SINGULAR: usize = 5;

/// Relative change of the step up to which the factors are kept, where Newton converges fast.
const KEPT_CHANGE: f64 = 1.2;

/// Rate of convergence below which the Jacobian is kept for the next step.
const FAST: f64 = 1e-3;

/// A step this little longer than planned is made rather than one more.
const STRETCH: f64 = 1.0001;

/// Errors beyond this part of what is allowed are looked at for rounding: they would keep steps from growing.
const TOLD: f64 = 0.03;

/// What the method did, beside steps and residuals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct RadauCounts {
    /// Accepted steps.
    pub(crate) accepted: usize,
    /// Steps whose error was too large.
    pub(crate) rejected: usize,
    /// Steps given up because Newton did not converge or the system failed.
    pub(crate) given_up: usize,
    /// Jacobians.
    pub(crate) jacobians: usize,
    /// Factorisations, a real and a complex one counted together.
    pub(crate) factorisations: usize,
    /// Newton iterations.
    pub(crate) iterations: usize,
    /// Residuals.
    pub(crate) residuals: usize,
}

impl RadauCounts {
    /// Adds it to the work of a run, but for steps and residuals.
    pub(crate) fn add_to(&self, counts: &mut Summary) {
        counts.rejected += self.rejected + self.given_up;
        counts.jacobians += self.jacobians;
        counts.factorisations += self.factorisations;
        counts.iterations += self.iterations;
    }
}

/// The method at work on one system. All memory is taken in [`new`](Radau::new).
pub(crate) struct Radau {
    /// The inverse of the matrix of the method.
    inverse: [[f64; STAGES]; STAGES],
    relative: f64,
    absolute: Vec<f64>,
    /// How much tighter these are than what the user gave.
    tightened: f64,
    index: Vec<u8>,
    /// Error that Newton may leave, relative to the tolerance.
    newton_tolerance: f64,
    t: f64,
    y: Vec<f64>,
    yp: Vec<f64>,
    /// Length of the step to try next, in s.
    h: f64,
    last: Collocation,
    /// Increments of the step that is tried.
    z: Stages,
    /// Newton's right side, then its correction.
    correction: Stages,
    trial: Vec<f64>,
    trial_rates: Vec<f64>,
    error: Vec<f64>,
    /// What is allowed of each unknown.
    allowed: Vec<f64>,
    /// What Newton should reach of it, where that is less: errors of rates in a constraint add up from step to step, though
    /// the constraint holds.
    wanted: Option<Vec<f64>>,
    dy: Vec<f64>,
    dyp: Vec<f64>,
    /// For each equation how much the values allowed of its unknowns, and the rates of these, make of it in a step.
    rates_of_change: Vec<[f64; 2]>,
    /// What roundings make of each unknown of a step; room for what each equation adds up, and for what one of it moves.
    noise: Vec<f64>,
    sums: Vec<f64>,
    moved: Vec<f64>,
    /// Whether rates are known to enter linearly.
    linear_in_rates: bool,
    /// Whether the first step goes along the rates at its start.
    straight: bool,
    /// Columns of `∂F/∂y'` that hold anything.
    has_rate: Vec<bool>,
    matrices: Matrices,
    jacobian: JacobianAge,
    /// Step that the factors are made for.
    factored: Option<f64>,
    newton: newton::Convergence,
    control: Control,
    work: RadauCounts,
}

/// A slope that moves an unknown in a step by so many times what it is taken from is steep, and so is one that is so many
/// times another.
const STEEP: f64 = 1e3;

fn finite(values: &[f64]) -> bool {
    values.iter().all(|value| value.is_finite())
}

/// Where the Jacobian was taken.
#[derive(Clone, Copy, PartialEq, Eq)]
enum JacobianAge {
    /// It has to be taken anew.
    Stale,
    /// At the start of an earlier step.
    Old,
    /// At the start of this step.
    Fresh,
}

impl Radau {
    /// Tolerances are those that the user gives; the method tightens them as is its custom.
    pub(crate) fn new(system: &dyn ImplicitSystem, relative: f64, absolute: &[f64]) -> Radau {
        let size = system.unknowns();
        let nonzeros = system.sparsity().nonzeros();
        let vector = || vec![0.0; size];
        let stages = || [vector(), vector(), vector()];
        let mut radau = Radau {
            inverse: tableau::NODES.map(tableau::rate_weights),
            relative: 0.0,
            absolute: vector(),
            tightened: 1.0,
            index: (0..size).map(|unknown| system.index(unknown)).collect(),
            newton_tolerance: 0.0,
            t: 0.0,
            y: vector(),
            yp: vector(),
            h: 0.0,
            last: Collocation::new(size),
            z: stages(),
            correction: stages(),
            trial: vector(),
            trial_rates: vector(),
            error: vector(),
            allowed: vector(),
            wanted: (0..size).any(|unknown| system.index(unknown) > 1).then(vector),
            rates_of_change: vec![[0.0; 2]; size],
            noise: vector(),
            sums: vector(),
            moved: vector(),
            dy: vec![0.0; nonzeros],
            dyp: vec![0.0; nonzeros],
            linear_in_rates: system.semi_explicit().is_some(),
            straight: false,
            has_rate: vec![false; size],
            matrices: Matrices::new(system.sparsity(), system.blocks()),
            jacobian: JacobianAge::Stale,
            factored: None,
            newton: newton::Convergence::default(),
            control: Control::default(),
            work: RadauCounts::default(),
        };
        radau.set_tolerances(relative, absolute);
        radau
    }

    /// Changes the tolerances. The error of a step is that of a formula of order 3, much larger than that of the
    /// solution: so they are taken to the power 2/3.
    pub(crate) fn set_tolerances(&mut self, relative: f64, absolute: &[f64]) {
        let tightened = 0.1 * libm::pow(relative, 2.0 / 3.0);
        self.relative = tightened;
        self.tightened = tightened / relative;
        self.absolute.iter_mut().zip(absolute).for_each(|(own, given)| *own = tightened * (given / relative));
        self.newton_tolerance = tightened.sqrt().min(0.03).max(10.0 * f64::EPSILON / tightened);
    }

    /// Starts anew at `(t, y, y')` with a first step of about `h`.
    pub(crate) fn restart(&mut self, t: f64, y: &[f64], yp: &[f64], h: f64) {
        self.stand(t, y, yp, h);
        self.last.forget();
        self.control = Control::default();
        self.straight = !self.linear_in_rates;
        self.newton = newton::Convergence::default();
    }

    /// Goes on at `(t, y, y')`, where the last step ended, with a step of at most `h`; `F` may change otherwise than before.
    pub(crate) fn resume(&mut self, t: f64, y: &[f64], yp: &[f64], h: f64) {
        self.stand(t, y, yp, h);
    }

    fn stand(&mut self, t: f64, y: &[f64], yp: &[f64], h: f64) {
        self.t = t;
        self.y.copy_from_slice(y);
        self.yp.copy_from_slice(yp);
        self.h = h;
        self.jacobian = JacobianAge::Stale;
    }

    pub(crate) fn time(&self) -> f64 {
        self.t
    }

    /// Where the last step started.
    pub(crate) fn start(&self) -> f64 {
        self.last.start()
    }

    /// Length of the step to come, as far as is known.
    pub(crate) fn next_step(&self) -> f64 {
        self.h
    }

    pub(crate) fn state(&self) -> &[f64] {
        &self.y
    }

    /// Rates at the end of the last step, from its polynomial.
    pub(crate) fn rates(&self) -> &[f64] {
        &self.yp
    }

    /// Makes the rates of algebraic unknowns 0.
    pub(crate) fn forget_algebraic(&self, yp: &mut [f64]) {
        yp.iter_mut().zip(&self.has_rate).filter(|(_, has_rate)| !**has_rate).for_each(|(rate, _)| *rate = 0.0);
    }

    /// The rates at `(t, y, y')`, but 0 for algebraic unknowns.
    ///
    /// # Errors
    /// What the system reports.
    pub(crate) fn rates_alone(
        &mut self,
        system: &mut dyn ImplicitSystem,
        t: f64,
        y: &[f64],
        yp: &[f64],
    ) -> Result<Vec<f64>, Failure> {
        self.take_jacobian(system, t, y, yp)?;
        let mut rates = yp.to_vec();
        self.forget_algebraic(&mut rates);
        Ok(rates)
    }

    /// What an unknown below its tolerance is says nothing: where a slope by it is steep there and far less so at the
    /// tolerance, as that of a root at 0, the Jacobian is taken at the tolerance. With the steep one every step would
    /// seem to be solved.
    fn bound_slopes(&mut self, system: &mut dyn ImplicitSystem, t: f64, y: &[f64], yp: &[f64]) {
        let tolerance = |i: usize| self.absolute[i] / self.tightened;
        let steep = |&(place, (_, i)): &(usize, (usize, usize))| {
            y[i].abs() < tolerance(i) && (self.dy[place] * self.h).abs() > STEEP
        };
        let steep: Vec<(usize, (usize, usize))> = system.sparsity().entries().enumerate().filter(steep).collect();
        if steep.is_empty() {
            return;
        }
        let mut beside = y.to_vec();
        for &(_, (_, i)) in &steep {
            beside[i] = tolerance(i).copysign(if y[i] == 0.0 { yp[i] } else { y[i] });
        }
        let (mut dy, mut dyp) = (vec![0.0; self.dy.len()], vec![0.0; self.dyp.len()]);
        let taken = system.jacobian(t, &beside, yp, &mut dy, &mut dyp).is_ok() && finite(&dy) && finite(&dyp);
        if taken && steep.iter().any(|&(place, _)| self.dy[place].abs() > STEEP * dy[place].abs()) {
            (self.dy, self.dyp) = (dy, dyp);
        }
    }

    /// Takes the Jacobian at `(t, y, y')`, and finds the unknowns that have rates.
    fn take_jacobian(&mut self, system: &mut dyn ImplicitSystem, t: f64, y: &[f64], yp: &[f64]) -> Result<(), Failure> {
        system.jacobian(t, y, yp, &mut self.dy, &mut self.dyp)?;
        self.work.jacobians += 1;
        if !(finite(&self.dy) && finite(&self.dyp)) {
            return Err(Failure::NotFinite { time: t, what: "a derivative of the equations".into() });
        }
        self.bound_slopes(system, t, y, yp);
        self.has_rate.fill(false);
        for (place, (_, column)) in system.sparsity().entries().enumerate() {
            self.has_rate[column] |= self.dyp[place] != 0.0;
        }
        Ok(())
    }

    pub(crate) fn work(&self) -> RadauCounts {
        self.work
    }

    /// Takes one step that meets the tolerances and ends at `stop` at the latest.
    ///
    /// # Errors
    /// No step is short enough: what the system reported last, or what Newton was left with.
    pub(crate) fn step(&mut self, system: &mut dyn ImplicitSystem, stop: f64) -> Result<(), Failure> {
        let (mut singular, mut failure, mut slow) = (0, None, false);
        loop {
            let reaches = self.t + STRETCH * self.h >= stop;
            let h = if reaches { stop - self.t } else { self.h };
            if 0.1 * h <= self.t.abs() * f64::EPSILON || h.is_nan() || h < f64::MIN_POSITIVE {
                return Err(match failure {
                    Some(failure) => failure,
                    None if slow => self.without_convergence(system),
                    None => Failure::StepTooSmall { time: self.t, step: h },
                });
            }
            match self.attempt(system, h) {
                Ok(newton_iterations) => {
                    let error = self.estimate(system, h);
                    let next = self.control.next_step_size(h, error, newton_iterations);
                    if error < 1.0 {
                        self.accept(if reaches { stop } else { self.t + h }, h, next);
                        return Ok(());
                    }
                    (failure, slow) = (None, false);
                    self.work.rejected += usize::from(self.work.accepted > 0);
                    self.h = next;
                    self.renew_jacobian();
                }
                Err(StepError::Slow { shorten }) => {
                    self.start_otherwise();
                    if system.is_steep() {
                        // Where states come to rest the last step leads far beyond.
                        self.last.forget();
                    }
                    self.h = shorten * h;
                    (failure, slow) = (None, true);
                }
                Err(StepError::Failed(reason)) => {
                    self.start_otherwise();
                    singular += usize::from(matches!(reason, Failure::Singular { .. }));
                    if singular >= MOST_SINGULAR {
                        return Err(reason);
                    }
                    self.h = 0.5 * h;
                    failure = Some(reason);
                }
            }
        }
    }

    /// Tells where Newton was left with the greatest residual, relative to what its equation adds up.
    fn without_convergence(&mut self, system: &mut dyn ImplicitSystem) -> Failure {
        let (time, iterations) = (self.t, newton::MOST_ITERATIONS);
        let mut residual = vec![0.0; self.y.len()];
        if let Err(failure) = system.residual(time, &self.trial, &self.trial_rates, &mut residual) {
            return failure;
        }
        let size = |row: usize| (residual[row] * self.matrices.row_factor(row)).abs();
        let worst = (0..residual.len()).fold(0, |worst, row| if size(row) > size(worst) { row } else { worst });
        let residual = residual.get(worst).map_or(0.0, |residual| residual.abs());
        Failure::NoConvergence { time, what: system.equation_name(worst), iterations, residual }
    }

    /// Newton was in vain with what it started from.
    fn start_otherwise(&mut self) {
        self.straight = !self.straight;
        self.control.rejected();
        self.work.given_up += 1;
        self.renew_jacobian();
    }

    /// A Jacobian of an earlier step may be the cause of the trouble.
    fn renew_jacobian(&mut self) {
        if self.jacobian == JacobianAge::Old {
            self.jacobian = JacobianAge::Stale;
        }
    }

    /// Solves the equations of a step; the number of iterations that took.
    fn attempt(&mut self, system: &mut dyn ImplicitSystem, h: f64) -> Result<usize, StepError> {
        self.renew(system)?;
        self.allow(h);
        self.refactor(system, h)?;
        match self.last.ends_at(self.t) {
            true => self.last.extrapolate(h, &mut self.z),
            false => self.begin_interval(h),
        }
        self.iterate(system, h)
    }

    /// What is allowed of each unknown in a step of `h`; those of higher index are allowed more.
    fn allow(&mut self, h: f64) {
        let shorter = h.min(1.0);
        let more = [1.0, shorter.recip(), (shorter * shorter).recip()];
        for (i, allowed) in self.allowed.iter_mut().enumerate() {
            let index = usize::from(self.index[i]).clamp(1, more.len());
            *allowed = (self.absolute[i] + self.relative * self.y[i].abs()) * more[index - 1];
            if let Some(wanted) = &mut self.wanted {
                let most = if self.has_rate[i] { 1 } else { 2 };
                wanted[i] = *allowed / more[index - 1] * more[index.min(most) - 1];
            }
        }
    }

    /// Takes the Jacobian, if needed.
    fn renew(&mut self, system: &mut dyn ImplicitSystem) -> Result<(), StepError> {
        if self.jacobian == JacobianAge::Stale {
            let (y, yp) = (std::mem::take(&mut self.y), std::mem::take(&mut self.yp));
            let taken = self.take_jacobian(system, self.t, &y, &yp);
            (self.y, self.yp) = (y, yp);
            taken.map_err(StepError::Failed)?;
            self.jacobian = JacobianAge::Fresh;
            self.factored = None;
        }
        Ok(())
    }

    /// Factors for a step of `h`, unless that is done.
    fn refactor(&mut self, system: &dyn ImplicitSystem, h: f64) -> Result<(), StepError> {
        if self.factored != Some(h) {
            self.factored = None;
            let complex = c64::new(ALPHA / h, BETA / h);
            self.work.factorisations += 1;
            let factored = self.matrices.factor((&self.dy, &self.dyp), REAL / h, complex, &self.allowed);
            factored.map_err(|no_pivot| {
                let name = |unknown| format!("the step of {}", system.unknown_name(unknown));
                let what = no_pivot.unknown.map_or("the equations of the step".into(), name);
                StepError::Failed(Failure::Singular { time: self.t, what })
            })?;
            self.factored = Some(h);
        }
        Ok(())
    }

    /// Increments in the first step: 0 where rates enter linearly, so that what is stiff may be off its slow motion; else
    /// along the rates at its start, as a law may have several solutions. The other way round after a failure.
    fn begin_interval(&mut self, h: f64) {
        for (z, node) in self.z.iter_mut().zip(tableau::NODES) {
            for (i, z) in z.iter_mut().enumerate() {
                *z = if self.straight && self.has_rate[i] { node * h * self.yp[i] } else { 0.0 };
            }
        }
    }

    /// The error of the step relative to what is allowed: the embedded formula of order 3, filtered by the real matrix.
    fn estimate(&mut self, system: &mut dyn ImplicitSystem, h: f64) -> f64 {
        for (i, rate) in self.trial_rates.iter_mut().enumerate() {
            *rate = -(0..STAGES).map(|stage| ERROR[stage] * self.z[stage][i]).sum::<f64>() / h;
        }
        self.trial.copy_from_slice(&self.y);
        let first = self.filtered(system);
        if first < 1.0 || !self.control.is_doubtful() {
            return first;
        }
        // What is stiff but smooth is told from what is not by the same formula at the end of its own correction.
        self.trial.iter_mut().zip(&self.y).zip(&self.error).for_each(|((trial, y), error)| *trial = y + error);
        self.filtered(system).min(first)
    }

    /// The norm of what the real matrix makes of the residual at the trial values, which is left in `error`.
    fn filtered(&mut self, system: &mut dyn ImplicitSystem) -> f64 {
        self.work.residuals += 1;
        if system.residual(self.t, &self.trial, &self.trial_rates, &mut self.error).is_err() {
            return f64::INFINITY;
        }
        self.error.iter_mut().for_each(|error| *error = -*error);
        self.matrices.solve_real(&mut self.error);
        let mut size = norm(&[&self.error], &self.allowed);
        if size > TOLD && self.wanted.is_some() {
            // What rounding alone makes of an unknown that does not act back on the motion is no error of the step.
            self.take_noise(system);
            let told = |(i, (error, noise)): (usize, (&mut f64, &f64))| {
                if self.index[i] > 1 && error.abs() <= *noise {
                    *error = 0.0;
                }
            };
            self.error.iter_mut().zip(&self.noise).enumerate().for_each(told);
            size = norm(&[&self.error], &self.allowed);
        }
        if size.is_nan() { f64::INFINITY } else { size.max(1e-10) }
    }

    /// Moves to the end of the step, with `next` for the next one.
    fn accept(&mut self, end: f64, h: f64, next: f64) {
        self.last.take(self.t, end, &self.y, &mut self.z);
        self.t = end;
        self.last.end(&mut self.y, &mut self.yp);
        self.work.accepted += 1;
        let fast = self.newton.rate() <= FAST;
        let kept = fast && (1.0..=KEPT_CHANGE).contains(&(next / h));
        self.h = if kept { h } else { next };
        self.jacobian = if fast { JacobianAge::Old } else { JacobianAge::Stale };
    }
}

/// Replaces `b` by the solution of sparse linear equations. `false` if they have none.
pub(crate) fn solve(pattern: &Sparsity, matrix: &[f64], b: &mut [f64]) -> bool {
    let (mut matrices, none) = (Matrices::new(pattern, 1), vec![0.0; matrix.len()]);
    let factored = matrices.factor((matrix, &none), 0.0, c64::new(0.0, 0.0), &vec![1.0; b.len()]);
    factored.is_ok() && {
        matrices.solve_real(b);
        true
    }
}

/// Why a step cannot be made as it is.
enum StepError {
    /// Newton converges too slowly or not at all.
    Slow {
        /// By how much the step has to be shortened.
        shorten: f64,
    },
    /// The system failed, or a matrix is singular.
    Failed(Failure),
}

/// Root of the mean square of all values, each relative to what is allowed of it.
fn norm(values: &[&[f64]], allowed: &[f64]) -> f64 {
    let square = |(value, allowed): (&f64, &f64)| (value / allowed) * (value / allowed);
    let sum = |values: &&[f64]| values.iter().zip(allowed).map(square).sum::<f64>();
    (values.iter().map(sum).sum::<f64>() / (values.len() * allowed.len()).max(1) as f64).sqrt()
}
