//! Linearly implicit methods: one matrix and a fixed number of stages a step, no iteration. For stiff models in real
//! time.
//!
//! With `M = 1 - h γ ∂f/∂x`, the stages solve
//! `M U_i = h γ (f(t + α_i h, x + Σ a_ij U_j) + Σ c_ij U_j / h + h γ_i ∂f/∂t)`, and the step ends at `x + Σ m_i U_i`.
//! Source: [HW], section IV.7, in the variables that need no product with the Jacobian.

use super::matrix::StepMatrix;
use crate::{Failure, Sparsity, System};

/// Coefficients of a method.
#[derive(Debug)]
pub(super) struct Rosenbrock {
    gamma: f64,
    /// Where in the step each stage stands.
    nodes: &'static [f64],
    /// What each stage takes of the derivative by time.
    time_weights: &'static [f64],
    /// Weights of the earlier stages in the state of each.
    stages: &'static [&'static [f64]],
    /// Weights of the earlier stages on the right side of each.
    right: &'static [&'static [f64]],
    /// Weights of the stages in the step.
    weights: &'static [f64],
    /// Stages at the same point as the one before, which need no rates of their own.
    repeats: &'static [bool],
}

/// Linearly implicit Euler: order 1, L-stable.
pub(super) const LINEARLY_IMPLICIT_EULER: Rosenbrock = Rosenbrock {
    gamma: 1.0,
    nodes: &[0.0],
    time_weights: &[1.0],
    stages: &[&[]],
    right: &[&[]],
    weights: &[1.0],
    repeats: &[false],
};

/// RODAS3: order 3, L-stable and stiffly accurate, 3 evaluations of the rates. Source: [Sandu].
pub(super) const RODAS3: Rosenbrock = Rosenbrock {
    gamma: 0.5,
    nodes: &[0.0, 0.0, 1.0, 1.0],
    time_weights: &[0.5, 1.5, 0.0, 0.0],
    stages: &[&[], &[0.0], &[2.0, 0.0], &[2.0, 0.0, 1.0]],
    right: &[&[], &[4.0], &[1.0, -1.0], &[1.0, -1.0, -8.0 / 3.0]],
    weights: &[2.0, 0.0, 1.0, 1.0],
    repeats: &[false, true, false, false],
};

/// Working space of a linearly implicit method.
pub(super) struct LinearlyImplicit {
    method: &'static Rosenbrock,
    matrix: StepMatrix,
    /// The stages, one vector after the other.
    stages: Vec<f64>,
    rates: Vec<f64>,
    time_derivative: Vec<f64>,
}

impl LinearlyImplicit {
    pub(super) fn new(method: &'static Rosenbrock, sparsity: &Sparsity) -> LinearlyImplicit {
        let states = sparsity.states();
        LinearlyImplicit {
            method,
            matrix: StepMatrix::new(sparsity, 1),
            stages: vec![0.0; method.nodes.len() * states],
            rates: vec![0.0; states],
            time_derivative: vec![0.0; states],
        }
    }

    /// Writes the end of the step to `end`.
    pub(super) fn step(
        &mut self,
        system: &mut dyn System,
        t: f64,
        h: f64,
        x: &[f64],
        end: &mut [f64],
    ) -> Result<(), Failure> {
        let (method, n) = (self.method, x.len());
        let scale = h * method.gamma;
        system.time_derivative(t, x, &mut self.time_derivative)?;
        self.matrix.factor(system, t, x, scale, |_, _, _| {})?;
        for stage in 0..method.nodes.len() {
            let (earlier, rest) = self.stages.split_at_mut(stage * n);
            let own = &mut rest[..n];
            if !method.repeats[stage] {
                combine(x, method.stages[stage], earlier, end);
                system.rates(t + method.nodes[stage] * h, end, &mut self.rates)?;
            }
            for (i, own) in own.iter_mut().enumerate() {
                let weights = method.right[stage].iter().enumerate();
                let sum: f64 = weights.map(|(j, c)| c * earlier[j * n + i]).sum();
                let by_time = method.time_weights[stage] * h * self.time_derivative[i];
                *own = scale * (self.rates[i] + by_time) + method.gamma * sum;
            }
            self.matrix.solve(own);
        }
        combine(x, method.weights, &self.stages, end);
        Ok(())
    }
}

/// `out = x + Σ weight · stage`, the stages being one vector after the other.
fn combine(x: &[f64], weights: &[f64], stages: &[f64], out: &mut [f64]) {
    for (i, out) in out.iter_mut().enumerate() {
        let sum: f64 = weights.iter().enumerate().map(|(j, weight)| weight * stages[j * x.len() + i]).sum();
        *out = x[i] + sum;
    }
}
