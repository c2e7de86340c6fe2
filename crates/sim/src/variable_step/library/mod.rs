//! The methods of the library diffsol behind our own trait. Nothing outside this folder names it.

mod equations;
mod sparse_lu;

use diffsol::error::DiffsolError;
use diffsol::ode_solver::state::StateCommon;
use diffsol::{
    Bdf, BdfState, DefaultDenseMatrix, FaerSparseMat, InitialConditionSolverOptions, Matrix, NalgebraLU, NalgebraMat,
    OdeSolverMethod, OdeSolverOptions, OdeSolverProblem, OdeSolverState, RkState, Tableau, Vector,
};

use super::Integrator;
use super::tolerances::Tolerances;
use crate::shared::Shared;
use crate::{Affected, Failure, Summary, System};
use equations::Equations;
pub(crate) use sparse_lu::KeptFactors;
use sparse_lu::SparseLu;

/// States up to which dense matrices are faster.
const LARGEST_DENSE: usize = 60;

/// Why there is a solver: the first call is always a restart.
const STARTED: &str = "an integrator is started before its first step";

/// Tolerance of the backward differentiation formulas relative to what the user gave: their errors add up over many
/// short steps, far more than those of the explicit pair.
const BDF_SHARE: f64 = 0.1;

/// Relative tolerance below which rounding takes over.
const LEAST: f64 = 1e-13;

/// Error tests failed in one step after which there is no hope.
const MOST_REJECTIONS: usize = 25;

/// Times an explicit step may be shortened tenfold because the system fails in it.
const MOST_RETREATS: usize = 16;

/// Calls `work` with the explicit pair of order 5(4) of Tsitouras, which interpolates with order 4.
pub(super) fn with_explicit<'s, R>(
    shared: &'s Shared<'s>,
    tolerances: &Tolerances,
    work: impl FnOnce(&mut dyn Integrator) -> R,
) -> R {
    let problem = problem::<NalgebraMat<f64>>(shared, tolerances, None);
    let make = |state: RkState<_>| problem.explicit_rk_solver(state, Tableau::tsit45());
    work(&mut Driven::new(&problem, make, true))
}

/// Calls `work` with the backward differentiation formulas of order 1 to 5.
pub(super) fn with_bdf<'s, R>(
    shared: &'s Shared<'s>,
    tolerances: &Tolerances,
    work: impl FnOnce(&mut dyn Integrator) -> R,
) -> R {
    let states = shared.system().states();
    if states <= LARGEST_DENSE {
        let problem = problem::<NalgebraMat<f64>>(shared, tolerances, Some(BDF_SHARE));
        work(&mut Driven::new(&problem, |state: BdfState<_>| problem.bdf_solver::<NalgebraLU<f64>>(state), false))
    } else {
        let problem = problem::<FaerSparseMat<f64>>(shared, tolerances, Some(BDF_SHARE));
        let make = |state: BdfState<_>| -> Result<Bdf<'_, Equations<'s, FaerSparseMat<f64>>, SparseLu>, DiffsolError> {
            Bdf::new(&problem, state, SparseLu::after(shared.kept_factors()))
        };
        work(&mut Driven::new(&problem, make, false))
    }
}

fn problem<'s, M: Matrix<T = f64>>(
    shared: &'s Shared<'s>,
    tolerances: &Tolerances,
    implicit_share: Option<f64>,
) -> OdeSolverProblem<Equations<'s, M>> {
    let share = implicit_share.unwrap_or(1.0);
    let relative = (share * tolerances.relative()).max(LEAST);
    OdeSolverProblem {
        eqn: Equations::new(shared, implicit_share.map(|share| (relative, tolerances.absolute(share)))),
        rtol: relative,
        atol: M::V::from_vec(tolerances.absolute(share), M::C::default()),
        t0: 0.0,
        h0: 1.0,
        integrate_out: false,
        sens_rtol: None,
        sens_atol: None,
        out_rtol: None,
        out_atol: None,
        param_rtol: None,
        param_atol: None,
        ic_options: InitialConditionSolverOptions::default(),
        ode_options: OdeSolverOptions {
            max_error_test_failures: MOST_REJECTIONS,
            max_nonlinear_solver_failures: usize::MAX,
            min_timestep: f64::MIN_POSITIVE,
            ..OdeSolverOptions::default()
        },
    }
}

/// A solver of the library, made anew at each restart.
struct Driven<'p, 's, M: Matrix<T = f64>, S, F> {
    problem: &'p OdeSolverProblem<Equations<'s, M>>,
    make: F,
    solver: Option<S>,
    /// Where the last step started.
    start: f64,
    x: Vec<f64>,
    between: M::V,
    explicit: bool,
    /// Rates where the step to come starts.
    rates: Vec<f64>,
    /// Steps rejected by solvers that are gone, and in retreats.
    rejected: usize,
    /// Factorisations by solvers that are gone.
    factorisations: usize,
}

impl<'p, 's, M, S, F> Driven<'p, 's, M, S, F>
where
    M: Matrix<T = f64>,
    M::V: DefaultDenseMatrix,
    S: OdeSolverMethod<'p, Equations<'s, M>>,
    F: Fn(S::State) -> Result<S, DiffsolError>,
{
    fn new(problem: &'p OdeSolverProblem<Equations<'s, M>>, make: F, explicit: bool) -> Self {
        let states = problem.eqn.shared().system().states();
        Driven {
            problem,
            make,
            solver: None,
            explicit,
            rates: vec![0.0; states],
            start: 0.0,
            x: vec![0.0; states],
            between: M::V::zeros(states, M::C::default()),
            rejected: 0,
            factorisations: 0,
        }
    }

    fn solver(&self) -> &S {
        self.solver.as_ref().expect(STARTED)
    }

    fn rejected_by_solver(&self) -> usize {
        self.solver.as_ref().map_or(0, |solver| {
            let statistics = solver.get_statistics();
            statistics.number_of_error_test_failures + statistics.number_of_nonlinear_solver_fails
        })
    }

    fn factorisations_by_solver(&self) -> usize {
        self.solver.as_ref().map_or(0, |solver| solver.get_statistics().number_of_linear_solver_setups)
    }

    fn shared(&self) -> &'s Shared<'s> {
        self.problem.eqn.shared()
    }

    /// Where the step of the library ended; `None` if it failed. An explicit step in which the system failed or a state
    /// overflowed counts as failed even where the library accepts it: its error norm overlooks what is not a number.
    fn try_step(&mut self, stop: f64) -> Option<f64> {
        let (explicit, shared) = (self.explicit, self.shared());
        let solver = self.solver.as_mut().expect(STARTED);
        solver.set_stop_time(stop).and_then(|()| solver.step()).ok()?;
        let (time, y) = (solver.state().t, solver.state().y);
        let escaped = (0..self.x.len()).find(|&state| !y.get_index(state).is_finite());
        if let Some(state) = escaped.filter(|_| !shared.has_failure()) {
            shared.keep(Failure::NotFinite { time, what: Affected::variable(shared.system().state_name(state)) });
        }
        (escaped.is_none() && !(explicit && shared.has_failure())).then_some(time)
    }

    /// Goes back to the start of a step in which the system failed, for one of length `step`.
    fn retreat(&mut self, time: f64, step: f64) -> Result<(), Failure> {
        self.rejected += 1;
        let (x, rates) = (self.x.clone(), self.rates.clone());
        self.restart(time, &x, &rates, step)
    }

    /// What the failed step means to the modeller.
    fn failure(&self, time: f64, step: f64) -> Failure {
        self.shared().take_failure().unwrap_or(Failure::StepTooSmall { time, step })
    }
}

impl<'p, 's, M, S, F> Integrator for Driven<'p, 's, M, S, F>
where
    M: Matrix<T = f64>,
    M::V: DefaultDenseMatrix,
    S: OdeSolverMethod<'p, Equations<'s, M>>,
    F: Fn(S::State) -> Result<S, DiffsolError>,
{
    fn first_order(&self) -> usize {
        if self.explicit { 5 } else { 1 }
    }

    fn sees_ends_alone(&self) -> bool {
        !self.explicit
    }

    fn restart(&mut self, t: f64, x: &[f64], dx: &[f64], h: f64) -> Result<(), Failure> {
        let vector = |values: &[f64]| M::V::from_slice(values, M::C::default());
        let none = || M::V::zeros(0, M::C::default());
        let state = StateCommon {
            y: vector(x),
            dy: vector(dx),
            g: none(),
            dg: none(),
            s: none(),
            ds: none(),
            sg: none(),
            dsg: none(),
            t,
            h,
        };
        self.rejected += self.rejected_by_solver();
        self.factorisations += self.factorisations_by_solver();
        self.x.copy_from_slice(x);
        self.start = t;
        self.solver = (self.make)(S::State::new_from_common(state)).ok();
        match self.solver {
            Some(_) => Ok(()),
            None => Err(self.failure(t, h)),
        }
    }

    /// The formulas of many steps keep their history: a corner costs them less than a new start at order 1.
    fn resume(&mut self, t: f64, x: &[f64], dx: &[f64], h: f64) -> Result<(), Failure> {
        if self.explicit { self.restart(t, x, dx, h) } else { Ok(()) }
    }

    fn continue_at(&mut self, t: f64, x: &[f64], h: f64) -> Result<(), Failure> {
        if !self.explicit {
            return Ok(());
        }
        let mut rates = vec![0.0; x.len()];
        self.end_rates(&mut rates)?;
        self.restart(t, x, &rates, h)
    }

    fn end_rates(&self, dx: &mut [f64]) -> Result<(), Failure> {
        if self.explicit {
            copy(self.solver().state().dy, dx);
            return Ok(());
        }
        self.shared().system().rates(self.time(), &self.x, dx)
    }

    fn step(&mut self, stop: f64) -> Result<(), Failure> {
        for retreat in 0.. {
            let (start, h) = (self.time(), self.next_step());
            copy(self.solver.as_ref().expect(STARTED).state().dy, &mut self.rates);
            self.shared().take_failure();
            if self.try_step(stop).is_some_and(|time| time > start) {
                self.start = start;
                copy(self.solver.as_ref().expect(STARTED).state().y, &mut self.x);
                break;
            }
            let failure = self.failure(start, h);
            let hopeless = matches!(failure, Failure::StepTooSmall { .. }) || start + 0.1 * h <= start;
            if !self.explicit || hopeless || retreat == MOST_RETREATS {
                return Err(failure);
            }
            self.retreat(start, 0.1 * h)?;
        }
        Ok(())
    }

    fn time(&self) -> f64 {
        self.solver().state().t
    }

    fn start(&self) -> f64 {
        self.start
    }

    fn next_step(&self) -> f64 {
        self.solver().state().h
    }

    fn state(&self) -> &[f64] {
        &self.x
    }

    fn interpolate(&mut self, t: f64, x: &mut [f64]) {
        let solver = self.solver.as_ref().expect(STARTED);
        let inside = t.clamp(self.start, solver.state().t);
        match solver.interpolate_inplace(inside, &mut self.between) {
            Ok(()) => copy(&self.between, x),
            Err(_) => x.fill(f64::NAN),
        }
    }

    fn rejected(&self) -> usize {
        self.rejected + self.rejected_by_solver()
    }

    fn add_work(&self, counts: &mut Summary) {
        counts.rejected += self.rejected();
        counts.factorisations += self.factorisations + self.factorisations_by_solver();
    }
}

fn copy<V: Vector<T = f64>>(from: &V, to: &mut [f64]) {
    to.iter_mut().enumerate().for_each(|(i, to)| *to = from.get_index(i));
}
