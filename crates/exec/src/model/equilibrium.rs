//! Where everything is at rest.

use super::minimum_norm;
use super::{EquilibriumError, Model};
use halfarrow_sim::{Failure, System};

const ITERATIONS: usize = 200;
/// Rates below this fraction of the terms they are made of count as zero.
const AT_REST: f64 = 1e-9;
/// More states than this are not searched: the equations are dense.
const LARGEST: usize = 2000;

/// A state at rest.
#[derive(Debug, Clone, PartialEq)]
pub struct Equilibrium {
    /// The state.
    pub x: Vec<f64>,
    /// How many combinations of states may have any value: 0 if the equilibrium stands alone, 1 on a line of them, of
    /// which this is one near the start values.
    pub free: usize,
    /// Iterations made.
    pub iterations: usize,
}

impl Model {
    /// The equilibrium nearest to `x` at time `t`, with inputs and conditions as they are then: Newton with the exact
    /// Jacobian, by way of a damped motion where Newton alone does not get there.
    ///
    /// # Errors
    /// There is none near, or the model has no value on the way.
    pub fn equilibrium(&mut self, t: f64, x: &[f64]) -> Result<Equilibrium, EquilibriumError> {
        self.restart();
        let n = x.len();
        if n > LARGEST {
            return Err(EquilibriumError::TooLarge(n));
        }
        let mut x = x.to_vec();
        let mut scale = vec![0.0f64; n];
        let mut pull = f64::INFINITY;
        let (mut rates, mut jacobian) = self.at_rest(t, &x).map_err(EquilibriumError::Failure)?;
        for iteration in 0..ITERATIONS {
            for (i, row) in jacobian.chunks(n.max(1)).enumerate() {
                let terms: f64 = row.iter().zip(&x).map(|(j, x)| (j * x).abs()).sum();
                scale[i] = scale[i].max(rates[i].abs()).max(terms);
            }
            let newton = minimum_norm::step(&jacobian, &rates, n);
            let Some(newton) = newton else { break };
            let settled = newton.step.iter().zip(&x).all(|(s, x)| s.abs() <= 1e-13 * x.abs())
                || rates.iter().all(|&rate| rate == 0.0);
            if settled || rates.iter().zip(&scale).all(|(r, s)| r.abs() <= 1e-15 * s) {
                if rates.iter().zip(&scale).all(|(r, s)| r.abs() <= AT_REST * s) {
                    return Ok(Equilibrium { x, free: n - newton.rank, iterations: iteration });
                }
                if pull.is_infinite() {
                    break;
                }
            }
            let norm = |r: &[f64]| r.iter().zip(&newton.weights).map(|(r, w)| (r * w) * (r * w)).sum::<f64>().sqrt();
            let before = norm(&rates);
            let step = match pull.is_infinite() {
                true => newton.step.clone(),
                false => damped_motion(&jacobian, &rates, pull, n).unwrap_or_else(|| newton.step.clone()),
            };
            let shortest = if pull.is_infinite() { 1e-3 } else { 1e-9 };
            let mut fraction = 1.0;
            let moved = loop {
                let trial: Vec<f64> = x.iter().zip(&step).map(|(x, s)| x + fraction * s).collect();
                match self.at_rest(t, &trial) {
                    Ok(next) if norm(&next.0) < before || !pull.is_infinite() => break Some((trial, next)),
                    _ if fraction < shortest => break None,
                    _ => fraction *= 0.5,
                }
            };
            match moved {
                Some((trial, next)) => {
                    let gain = (before / norm(&next.0).max(f64::MIN_POSITIVE)).clamp(0.3, 10.0);
                    pull *= gain;
                    pull = if pull > 1e12 { f64::INFINITY } else { pull };
                    x = trial;
                    (rates, jacobian) = next;
                }
                // Newton is stuck: follow the motion, strongly damped at first.
                None if pull.is_infinite() => {
                    let fastest = jacobian.iter().fold(0.0f64, |most, j| most.max(j.abs()));
                    pull = if fastest > 0.0 { 0.1 / fastest } else { break };
                }
                None => break,
            }
        }
        self.nowhere(&rates, &scale)
    }

    fn nowhere(&self, rates: &[f64], scale: &[f64]) -> Result<Equilibrium, EquilibriumError> {
        let mut worst: Vec<usize> = (0..rates.len()).filter(|&i| rates[i].abs() > AT_REST * scale[i]).collect();
        let share = |i: usize| rates[i].abs() / scale[i].max(f64::MIN_POSITIVE);
        worst.sort_by(|&a, &b| share(b).total_cmp(&share(a)).then(a.cmp(&b)));
        worst.truncate(3);
        Err(EquilibriumError::None(worst.into_iter().map(|i| (self.state_name(i), rates[i])).collect()))
    }

    /// Rates and, row by row, their derivatives.
    pub(super) fn at_rest(&mut self, t: f64, x: &[f64]) -> Result<(Vec<f64>, Vec<f64>), Failure> {
        let n = x.len();
        self.rates_at(t, x)?;
        let rates = self.dx.clone();
        let (mut jacobian, mut v, mut jv) = (vec![0.0; n * n], vec![0.0; n], vec![0.0; n]);
        for j in 0..n {
            v[j] = 1.0;
            self.tangent(t, x, &v, &mut jv)?;
            v[j] = 0.0;
            (0..n).for_each(|i| jacobian[i * n + j] = jv[i]);
        }
        Ok((rates, jacobian))
    }
}

/// An implicit Euler step of length `pull` along the motion.
fn damped_motion(jacobian: &[f64], rates: &[f64], pull: f64, n: usize) -> Option<Vec<f64>> {
    let mut lu = crate::bytecode::Lu::new(n, false);
    lu.matrix().iter_mut().zip(jacobian).for_each(|(a, j)| *a = -j);
    (0..n).for_each(|i| lu.matrix()[i * n + i] += 1.0 / pull);
    lu.factor().ok()?;
    let mut step = rates.to_vec();
    lu.solve(&mut step);
    step.iter().all(|s| s.is_finite()).then_some(step)
}
