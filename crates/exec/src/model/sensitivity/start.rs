//! How the start of a run moves: what is found by equations moves so that these go on to hold.

use super::super::minimum_norm;
use super::super::{DelayOrSample, Model, StartError};
use super::Quantity;
use halfarrow_compiler::bond_graph::HeldKind;
use halfarrow_compiler::program::StartGroup;
use halfarrow_sim::Failure;

/// What equations may miss after they were differentiated, as part of their terms.
const MET: f64 = 1e-8;
/// Passes over start and held signals, which read each other.
const PASSES: usize = 20;

impl Model {
    /// Differentiates the start that was found at `t`.
    pub(in crate::model) fn vary_start(&mut self, t: f64, x: &[f64]) -> Result<(), StartError> {
        let Some(variation) = self.variation.as_deref() else { return Ok(()) };
        let count = variation.by.len();
        let z: Vec<f64> = x.iter().chain(&self.run.conserved).chain(&self.run.positions).copied().collect();
        let states = x.len();
        for _ in 0..PASSES {
            let mut moved = vec![vec![0.0; z.len()]; count];
            self.vary_guessed(t, &z, &mut moved).map_err(StartError::Failure)?;
            let by = self.variation.iter().flat_map(|variation| &variation.by);
            for (moved, quantity) in moved.iter_mut().zip(by) {
                if let Quantity::State(i) = *quantity {
                    moved[i] = 1.0;
                }
            }
            for group in self.code.program.start_groups() {
                self.vary_group(t, &z, &group, &mut moved)?;
            }
            let variation = self.variation.as_mut().expect("it is varied");
            for (j, z) in moved.iter().enumerate() {
                variation.states[j].copy_from_slice(&z[..states]);
                let conserved = variation.conserved[j].len();
                variation.conserved[j].copy_from_slice(&z[states..][..conserved]);
            }
            if !self.vary_held(t, x).map_err(StartError::Failure)? {
                break;
            }
        }
        Ok(())
    }

    /// Unknowns that stay where they are guessed move with the guess; where equations determine them that is overwritten.
    fn vary_guessed(&mut self, t: f64, z: &[f64], moved: &mut [Vec<f64>]) -> Result<(), Failure> {
        for guess in self.code.program.guesses.clone() {
            let routine = self.start_routine(&[guess.residual]);
            self.residuals(t, &routine, z, Some(&[guess.unknown as usize]))?;
            let slope = self.frame.d[routine.outputs[0] as usize];
            let still = vec![0.0; self.code.program.states.len()];
            for (j, moved) in moved.iter_mut().enumerate() {
                self.residuals(t, &routine, z, None)?;
                let moves = self.run_placed(j, t, (&still, 0.0), &routine)?;
                let place = -moves[0] / slope;
                moved[guess.unknown as usize] = if place.is_finite() { place } else { 0.0 };
            }
        }
        Ok(())
    }

    /// Differentiates the unknowns of a group of start conditions.
    fn vary_group(&mut self, t: f64, z: &[f64], group: &StartGroup, moved: &mut [Vec<f64>]) -> Result<(), StartError> {
        let routine = self.routine_of(group);
        let without = |name: String, reason: &str| StartError::Failure(Model::without_derivative(t, name, reason));
        let names = |model: &Model, group: &StartGroup| model.names_of(group.unknowns.iter().copied()).join(", ");
        let Some((residual, jacobian)) = self.linearised(t, &routine, group, z) else {
            return Err(without(names(self, group), "its start conditions have no finite derivative there"));
        };
        let (n, unmet) = (group.unknowns.len(), self.unmet((group, &routine), z, &residual, &jacobian));
        // Freedom that nobody asked for has given way.
        let rows: Vec<usize> = (0..residual.len()).filter(|i| !unmet.contains(i)).collect();
        let matrix: Vec<f64> = rows.iter().flat_map(|&i| jacobian[i * n..][..n].iter().copied()).collect();
        let still = vec![0.0; self.code.program.states.len()];
        for (j, moved) in moved.iter_mut().enumerate() {
            self.residuals(t, &routine, z, None).map_err(StartError::Failure)?;
            let slopes = self.run_placed(j, t, (&still, 0.0), &routine).map_err(StartError::Failure)?;
            let quantity = self.variation.as_ref().expect("it is varied").by[j];
            let asked = |c: usize| if quantity == Quantity::Start(c) { 1.0 } else { 0.0 };
            let slopes: Vec<f64> = rows.iter().map(|&i| slopes[i] - asked(group.conditions[i])).collect();
            if unmet.iter().any(|&i| asked(group.conditions[i]) != 0.0) {
                return Err(without(names(self, group), "the start value gives way to others that are given"));
            }
            let Some(found) = minimum_norm::step(&matrix, &slopes, n) else {
                return Err(without(names(self, group), "its start has no finite derivative"));
            };
            if found.rank < n && slopes.iter().any(|s| *s != 0.0) {
                let reason = "start values leave it open how they move together: give more of them";
                return Err(without(names(self, group), reason));
            }
            if !found.meets(&matrix, &slopes, MET) {
                let reason = "more start values are given than fit: what is varied would contradict the others";
                return Err(without(names(self, group), reason));
            }
            if found.rank == n {
                group.unknowns.iter().zip(&found.step).for_each(|(&u, step)| moved[u as usize] = *step);
            }
        }
        Ok(())
    }

    /// Differentiates signals that are held from the start on; whether any moves otherwise than before.
    pub(in crate::model) fn vary_held(&mut self, t: f64, x: &[f64]) -> Result<bool, Failure> {
        let code = self.code.clone();
        let Some(variation) = self.variation.as_deref() else { return Ok(false) };
        let mut changed = false;
        for j in 0..variation.by.len() {
            let own = self.states_of(j);
            let slopes = self.run_varied(j, (t, x), (&own, self.instant_of(j)), &code.sources)?;
            let kinds = self.run.delays_and_samples.iter();
            let moves: Vec<bool> = kinds.map(|held| !matches!(held, DelayOrSample::Delay(_))).collect();
            let held = &mut self.variation.as_mut().expect("it is varied").held[j];
            for ((own, slope), _) in held.iter_mut().zip(slopes).zip(moves).filter(|(_, moves)| *moves) {
                changed |= *own != slope;
                *own = slope;
            }
        }
        Ok(changed)
    }

    /// Differentiates an equilibrium: it goes on to be one.
    pub(in crate::model) fn vary_rest(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        if self.variation.is_none() || x.is_empty() {
            return Ok(());
        }
        let code = self.code.clone();
        if let Some(held) = code.program.held.iter().find(|h| h.kind == HeldKind::Sample) {
            let reason = "how an equilibrium moves where signals are sampled is not followed";
            return Err(Model::without_derivative(t, held.name.clone(), reason));
        }
        let (_, jacobian) = self.at_rest(t, x)?;
        let still = vec![0.0; x.len()];
        for j in 0..self.varied_by().len() {
            let slopes = self.run_varied(j, (t, x), (&still, 0.0), &code.rates)?;
            let found = minimum_norm::step(&jacobian, &slopes, x.len()).filter(|found| found.rank == x.len());
            let Some(found) = found else {
                let reason =
                    "it does not stand alone, and how it moves along with what the states keep is not followed";
                return Err(Model::without_derivative(t, "the equilibrium", reason));
            };
            self.variation.as_mut().expect("it is varied").states[j] = found.step;
        }
        Ok(())
    }

    /// How the states move, as far as is known.
    pub(super) fn states_of(&self, j: usize) -> Vec<f64> {
        self.variation.as_ref().map_or(Vec::new(), |variation| variation.states[j].clone())
    }

    /// How the instant moves that is handled.
    pub(super) fn instant_of(&self, j: usize) -> f64 {
        self.variation.as_ref().map_or(0.0, |variation| variation.instant[j])
    }
}
