//! Steps followed backwards: the transposed derivative of the step that was taken.

use super::matrix::StepMatrix;
use super::{FixedMethod, Tableau, advance};
use crate::adjoint::Transposed;
use crate::{Failure, Sparsity};

/// Takes weights back over steps; all memory is taken in [`new`](StepBack::new).
pub struct StepBack {
    tableau: Option<&'static Tableau>,
    middle: Option<Box<StepMatrix>>,
    /// The rates of the stages, one after the other; then what each stage weighs.
    stages: Vec<f64>,
    weights: Vec<f64>,
    point: Vec<f64>,
    weight: Vec<f64>,
}

impl StepBack {
    /// For a method that [goes back](FixedMethod::goes_back), and systems whose Jacobian has this pattern.
    pub fn new(method: FixedMethod, sparsity: &Sparsity) -> StepBack {
        let (tableau, n) = (method.tableau(), sparsity.states());
        let stages = vec![0.0; tableau.map_or(0, |tableau| tableau.nodes.len()) * n];
        StepBack {
            tableau,
            middle: tableau.is_none().then(|| Box::new(StepMatrix::transposed(sparsity))),
            weights: stages.clone(),
            stages,
            point: vec![0.0; n],
            weight: vec![0.0; n],
        }
    }

    /// Takes the weights of states and constants back over the step that went from `(from, x)` to `(to, end)`.
    ///
    /// # Errors
    /// What the system reports.
    pub fn step(
        &mut self,
        system: &mut dyn Transposed,
        (from, to): (f64, f64),
        (x, end): (&[f64], &[f64]),
        states: &mut [f64],
        constants: &mut [f64],
    ) -> Result<(), Failure> {
        let (t, h) = (from, to - from);
        match (self.tableau, &mut self.middle) {
            (Some(tableau), _) => self.explicit(tableau, system, (t, h), x, states, constants),
            // `X = x + h/2 f(X)`, `end = 2 X - x`.
            (None, Some(matrix)) => {
                (0..x.len()).for_each(|i| self.point[i] = 0.5 * (x[i] + end[i]));
                matrix.factor(system.system(), t + 0.5 * h, &self.point, 0.5 * h, |_, _, _| {})?;
                self.weight.copy_from_slice(states);
                matrix.solve(&mut self.weight);
                for (state, middle) in states.iter_mut().zip(&self.weight) {
                    *state = 2.0 * middle - *state;
                }
                self.weight.iter_mut().for_each(|w| *w *= h);
                let StepBack { point, weight, weights, .. } = self;
                weights.resize(x.len(), 0.0);
                system.transposed(t + 0.5 * h, point, weight, weights, constants)
            }
            (None, None) => unreachable!("every method that goes back is one of these"),
        }
    }

    fn explicit(
        &mut self,
        tableau: &Tableau,
        system: &mut dyn Transposed,
        (t, h): (f64, f64),
        x: &[f64],
        states: &mut [f64],
        constants: &mut [f64],
    ) -> Result<(), Failure> {
        let (n, count) = (x.len(), tableau.nodes.len());
        for stage in 0..count - 1 {
            let (earlier, rest) = self.stages.split_at_mut(stage * n);
            advance(x, h, tableau.stages[stage], earlier, &mut self.point);
            system.system().rates(t + tableau.nodes[stage] * h, &self.point, &mut rest[..n])?;
        }
        for stage in (0..count).rev() {
            let (own, later) = self.weights[stage * n..].split_at_mut(n);
            self.weight.iter_mut().zip(&*states).for_each(|(w, state)| *w = h * tableau.weights[stage] * state);
            for (after, weights) in (stage + 1..).zip(later.chunks_exact(n.max(1))) {
                let factor = h * tableau.stages[after].get(stage).copied().unwrap_or(0.0);
                self.weight.iter_mut().zip(weights).for_each(|(w, later)| *w += factor * later);
            }
            advance(x, h, tableau.stages[stage], &self.stages[..stage * n], &mut self.point);
            system.transposed(t + tableau.nodes[stage] * h, &self.point, &self.weight, own, constants)?;
        }
        for weights in self.weights.chunks_exact(n.max(1)).take(count) {
            states.iter_mut().zip(weights).for_each(|(state, w)| *state += w);
        }
        Ok(())
    }
}
