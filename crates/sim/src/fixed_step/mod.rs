//! Methods with a step of fixed length, for reproducible runs and real time. A step only computes.
//!
//! Time events are met exactly, by a shorter step. Zero crossings of laws are not located: the step in which one lies is
//! finished in the old mode, and the new one holds from its end on. That costs at most an error of the order of the step where
//! the rates jump, of its square where they only bend. Where a crossing changes states or discrete variables it is located, by
//! shorter steps from the same start, in a number of them that is bounded.

mod back;
mod bdf2;
mod implicit_midpoint;
mod matrix;
mod rosenbrock;
mod ticks;

use crate::{Affected, Failure, Sparsity, System};
pub use back::StepBack;
pub use bdf2::History;
use bdf2::LinearlyImplicitBdf2;
use implicit_midpoint::ImplicitMidpoint;
use rosenbrock::{LINEARLY_IMPLICIT_EULER, LinearlyImplicit, RODAS3, Rosenbrock};
pub(crate) use ticks::{Ticks, target};

/// A method of fixed step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FixedMethod {
    /// Explicit Euler: order 1, 1 evaluation of the rates a step.
    Euler,
    /// Heun, the explicit trapezoidal rule: order 2, 2 evaluations.
    Heun,
    /// The classical Runge-Kutta method: order 4, 4 evaluations.
    Rk4,
    /// Implicit midpoint rule: order 2, A-stable, symplectic; keeps every quadratic invariant, so also the energy of a
    /// linear conservative machine. Newton with the exact Jacobian, at most 20 iterations a step.
    ImplicitMidpoint,
    /// Linearly implicit Euler: order 1, L-stable. 1 evaluation, 1 Jacobian, 1 factorisation a step, no iteration.
    LinearlyImplicitEuler,
    /// Linearly implicit BDF of two steps: order 2, L-stable where the Jacobian changes slowly, which is kept until it is another
    /// one along the way. 1 evaluation and 1 solution a step; every 8 steps 1 directional derivative, or another evaluation.
    LinearlyImplicitBdf2,
    /// The Rosenbrock method RODAS3: order 3, L-stable, for stiff systems in real time. 3 evaluations, 1 Jacobian,
    /// 1 factorisation and 4 solutions a step, no iteration.
    Rosenbrock,
}

impl FixedMethod {
    /// Evaluations of the rates a step, of an implicit method about.
    pub fn evaluations(self) -> f64 {
        match self {
            FixedMethod::Euler => 1.0,
            FixedMethod::Heun | FixedMethod::LinearlyImplicitBdf2 => 2.0,
            _ => 4.0,
        }
    }

    /// Whether it solves for the end of a step.
    pub fn is_implicit(self) -> bool {
        !matches!(self, FixedMethod::Euler | FixedMethod::Heun | FixedMethod::Rk4)
    }

    /// Whether it asks for the whole Jacobian at each step.
    pub fn takes_jacobian(self) -> bool {
        self.is_implicit() && self != FixedMethod::LinearlyImplicitBdf2
    }
}

/// Takes steps; all memory is taken in [`new`](FixedStep::new).
pub struct FixedStep {
    tableau: Option<&'static Tableau>,
    /// Rates of each stage, one after the other.
    stages: Vec<f64>,
    trial: Vec<f64>,
    implicit: Option<Implicit>,
}

enum Implicit {
    Midpoint(ImplicitMidpoint),
    Linearly(LinearlyImplicit),
    Bdf2(Box<LinearlyImplicitBdf2>),
}

/// An explicit Runge-Kutta method without needless stages.
pub(crate) struct Tableau {
    /// Where in the step each stage stands.
    pub nodes: &'static [f64],
    /// Weights of the earlier rates in each stage.
    pub stages: &'static [&'static [f64]],
    /// Weights of the rates in the step.
    pub weights: &'static [f64],
}

const EULER: Tableau = Tableau { nodes: &[0.0], stages: &[&[]], weights: &[1.0] };
const HEUN: Tableau = Tableau { nodes: &[0.0, 1.0], stages: &[&[], &[1.0]], weights: &[0.5, 0.5] };
const RK4: Tableau = Tableau {
    nodes: &[0.0, 0.5, 0.5, 1.0],
    stages: &[&[], &[0.5], &[0.0, 0.5], &[0.0, 0.0, 1.0]],
    weights: &[1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0],
};

impl FixedMethod {
    pub(crate) fn tableau(self) -> Option<&'static Tableau> {
        match self {
            FixedMethod::Euler => Some(&EULER),
            FixedMethod::Heun => Some(&HEUN),
            FixedMethod::Rk4 => Some(&RK4),
            FixedMethod::ImplicitMidpoint
            | FixedMethod::LinearlyImplicitEuler
            | FixedMethod::LinearlyImplicitBdf2
            | FixedMethod::Rosenbrock => None,
        }
    }

    fn implicit(self, sparsity: &Sparsity, blocks: usize) -> Option<Implicit> {
        let linearly = |method: &'static Rosenbrock| Implicit::Linearly(LinearlyImplicit::new(method, sparsity));
        match self {
            FixedMethod::Euler | FixedMethod::Heun | FixedMethod::Rk4 => None,
            FixedMethod::ImplicitMidpoint => Some(Implicit::Midpoint(ImplicitMidpoint::new(sparsity, blocks))),
            FixedMethod::LinearlyImplicitEuler => Some(linearly(&LINEARLY_IMPLICIT_EULER)),
            FixedMethod::LinearlyImplicitBdf2 => Some(Implicit::Bdf2(Box::new(LinearlyImplicitBdf2::new(sparsity)))),
            FixedMethod::Rosenbrock => Some(linearly(&RODAS3)),
        }
    }
}

impl FixedStep {
    /// A method for systems whose Jacobian has this pattern.
    pub fn new(method: FixedMethod, sparsity: &Sparsity) -> FixedStep {
        FixedStep::of_blocks(method, sparsity, 1)
    }

    /// The same where the Jacobian is made of so many equal blocks on its diagonal.
    pub fn of_blocks(method: FixedMethod, sparsity: &Sparsity, blocks: usize) -> FixedStep {
        let tableau = method.tableau();
        FixedStep {
            tableau,
            stages: vec![0.0; tableau.map_or(0, |tableau| tableau.nodes.len()) * sparsity.states()],
            trial: vec![0.0; sparsity.states()],
            implicit: method.implicit(sparsity, blocks),
        }
    }

    /// Moves `x` from `t` to `t + h`, in the system's present mode. No event may lie inside the step. Does not allocate
    /// unless it fails.
    ///
    /// # Errors
    /// What the system reports, a state that is no longer finite, or Newton without convergence. `x` is then unchanged.
    pub fn step(&mut self, system: &mut dyn System, t: f64, h: f64, x: &mut [f64]) -> Result<(), Failure> {
        self.advance(system, t, h, x)?;
        x.copy_from_slice(self.advanced());
        Ok(())
    }

    /// Does beforehand what only the first of steps of this length takes.
    pub fn prepare(&mut self, system: &mut dyn System, t: f64, h: f64, x: &[f64]) {
        if let Some(Implicit::Bdf2(method)) = &mut self.implicit {
            method.prepare(system, (t, h), x);
        }
    }

    /// A step in vain, so that what it takes is at hand; of a method that remembers steps about what it would take. Nothing is
    /// moved but `x`.
    ///
    /// # Errors
    /// As [`step`](FixedStep::step).
    pub fn rehearse(&mut self, system: &mut dyn System, t: f64, h: f64, x: &mut [f64]) -> Result<(), Failure> {
        match &mut self.implicit {
            Some(Implicit::Bdf2(method)) => method.rehearse(system, t, x, &mut self.trial),
            _ => self.step(system, t, h, x),
        }
    }

    /// Something happens where the run stands: what the method remembers of earlier steps tells nothing of what comes.
    pub fn leave(&mut self) {
        if let Some(Implicit::Bdf2(method)) = &mut self.implicit {
            method.leave();
        }
    }

    /// What the method remembers of earlier steps, if it does.
    pub fn history(&self) -> Option<&History> {
        match &self.implicit {
            Some(Implicit::Bdf2(method)) => Some(method.history()),
            _ => None,
        }
    }

    /// Goes on as it would have gone on there.
    pub fn restore(&mut self, history: &History) {
        if let Some(Implicit::Bdf2(method)) = &mut self.implicit {
            method.restore(history);
        }
    }

    /// The state where the last step ended.
    pub(crate) fn advanced(&self) -> &[f64] {
        &self.trial
    }

    /// Takes over the state where a step has ended that was made elsewhere.
    pub(crate) fn take_over(&mut self, state: impl Iterator<Item = f64>) {
        self.trial.iter_mut().zip(state).for_each(|(trial, value)| *trial = value);
    }

    /// As [`step`](FixedStep::step), but leaves the state to [`advanced`](FixedStep::advanced).
    pub(crate) fn advance(&mut self, system: &mut dyn System, t: f64, h: f64, x: &[f64]) -> Result<(), Failure> {
        match (self.tableau, &mut self.implicit) {
            (Some(tableau), _) => self.explicit(tableau, system, t, h, x)?,
            (None, Some(Implicit::Midpoint(midpoint))) => midpoint.step(system, t, h, x, &mut self.trial)?,
            (None, Some(Implicit::Linearly(method))) => method.step(system, t, h, x, &mut self.trial)?,
            (None, Some(Implicit::Bdf2(method))) => method.step(system, t, h, x, &mut self.trial)?,
            (None, None) => {}
        }
        self.check(system, t + h)
    }

    /// Whether the state is finite where the last step ended.
    pub(crate) fn check(&self, system: &dyn System, end: f64) -> Result<(), Failure> {
        match self.trial.iter().position(|value| !value.is_finite()) {
            Some(state) => Err(Failure::NotFinite { time: end, what: Affected::variable(system.state_name(state)) }),
            None => Ok(()),
        }
    }

    fn explicit(
        &mut self,
        tableau: &Tableau,
        system: &mut dyn System,
        t: f64,
        h: f64,
        x: &[f64],
    ) -> Result<(), Failure> {
        let n = x.len();
        for (stage, (node, weights)) in tableau.nodes.iter().zip(tableau.stages).enumerate() {
            let (earlier, rest) = self.stages.split_at_mut(stage * n);
            advance(x, h, weights, earlier, &mut self.trial);
            system.rates(t + node * h, &self.trial, &mut rest[..n])?;
        }
        advance(x, h, tableau.weights, &self.stages, &mut self.trial);
        Ok(())
    }
}

/// `out = x + h · Σ weight · rates`, `rates` being one vector after the other.
fn advance(x: &[f64], h: f64, weights: &[f64], rates: &[f64], out: &mut [f64]) {
    out.fill(-0.0);
    for (weight, rates) in weights.iter().zip(rates.chunks_exact(x.len().max(1))) {
        out.iter_mut().zip(rates).for_each(|(sum, rate)| *sum += weight * rate);
    }
    out.iter_mut().zip(x).for_each(|(sum, x)| *sum = x + h * *sum);
}
