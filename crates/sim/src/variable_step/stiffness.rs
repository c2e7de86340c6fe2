//! Whether an explicit method is held back by stability instead of accuracy.

use super::tolerances::Tolerances;
use crate::System;

/// Accepted steps between two checks.
const EVERY: usize = 10;

/// The same where there are many states: a sparse implicit step costs little more than an explicit one, and a large network
/// that is not stiff is rare.
const EVERY_OF_LARGE: usize = 3;

/// States from which on they are many.
const LARGE: usize = 200;

/// Step times spectral radius beyond which only stability can limit the step: on oscillations that accuracy limits it
/// stays below 1.
const STABILITY_LIMIT: f64 = 2.0;

/// Looks in a row that must find stiffness.
const CHECKS: usize = 4;

/// Steps in a row in which a state turns round, give or take some, that nothing but a law that is infinitely steep there makes it do:
/// it goes to and fro by the error that is allowed. How steep that law is says nothing, since the steps are as long as it lets them be.
const TURNS: u8 = 16;

/// Part of the relative tolerance of its magnitude that a state moves by at least in such a step.
const TURNED: f64 = 1e-4;

/// Steps still to come below which a change of method does not pay.
const WORTH_A_CHANGE: f64 = 200.0;

/// Follows the spectral radius of the Jacobian by power iteration, one product a look.
pub(super) struct Stiffness {
    steps: usize,
    checks: usize,
    vector: Vec<f64>,
    product: Vec<f64>,
    /// Of each state the last value, by how much it has moved, and how often it has turned round.
    last: Vec<f64>,
    moved: Vec<f64>,
    turns: Vec<u8>,
}

impl Stiffness {
    pub(super) fn new(tolerances: &Tolerances) -> Stiffness {
        // Any start will do that has a part along every eigenvector.
        let start =
            |(i, magnitude): (usize, &f64)| magnitude * (1.0 + (i % 7) as f64) * if i % 2 == 0 { 1.0 } else { -1.0 };
        let vector: Vec<f64> = tolerances.magnitudes().iter().enumerate().map(start).collect();
        let none = vec![0.0; vector.len()];
        let turns = vec![0; vector.len()];
        Stiffness { steps: 0, checks: 0, product: none.clone(), vector, last: none.clone(), moved: none, turns }
    }

    /// Takes notice of an accepted step of length `h` to `(t, x)`, `remaining` s before the next stop. `true` if the
    /// stiff method should take over.
    pub(super) fn watch(
        &mut self,
        system: &mut dyn System,
        tolerances: &Tolerances,
        (t, x): (f64, &[f64]),
        h: f64,
        remaining: f64,
    ) -> bool {
        self.steps += 1;
        let pays = remaining > WORTH_A_CHANGE * h;
        if system.is_steep() && self.goes_to_and_fro(tolerances, x) && pays {
            return true;
        }
        let every = if self.vector.len() < LARGE { EVERY } else { EVERY_OF_LARGE };
        if !self.steps.is_multiple_of(every) {
            return false;
        }
        let radius = self.radius(system, tolerances, t, x).unwrap_or(0.0);
        self.checks = if h * radius > STABILITY_LIMIT { self.checks + 1 } else { 0 };
        self.checks >= CHECKS && pays
    }

    /// Whether a state has turned round in most of the last steps, the last of which has led to `x`.
    fn goes_to_and_fro(&mut self, tolerances: &Tolerances, x: &[f64]) -> bool {
        let Stiffness { last, moved, turns, .. } = self;
        let least = TURNED * tolerances.relative();
        let mut most = 0;
        for (((x, last), (moved, turns)), magnitude) in
            x.iter().zip(last).zip(moved.iter_mut().zip(turns)).zip(tolerances.magnitudes())
        {
            let moves = x - std::mem::replace(last, *x);
            let turned = moves * *moved < 0.0 && moves.abs() > least * magnitude;
            *turns = if turned { turns.saturating_add(1) } else { turns.saturating_sub(2) };
            *moved = moves;
            most = most.max(*turns);
        }
        most >= TURNS
    }

    /// Growth of the vector under the Jacobian; `None` where that cannot be had.
    fn radius(&mut self, system: &mut dyn System, tolerances: &Tolerances, t: f64, x: &[f64]) -> Option<f64> {
        system.directional_derivative(t, x, &self.vector, &mut self.product).ok()?;
        let size = |v: &[f64]| {
            let parts = v.iter().zip(tolerances.magnitudes()).map(|(v, magnitude)| v / magnitude);
            parts.map(|part| part * part).sum::<f64>().sqrt()
        };
        let (before, after) = (size(&self.vector), size(&self.product));
        if !(after.is_finite() && after > 0.0) {
            return None;
        }
        self.vector.iter_mut().zip(&self.product).for_each(|(v, product)| *v = product / after);
        Some(after / before)
    }
}
