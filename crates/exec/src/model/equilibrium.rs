//! Where everything is at rest.

use super::minimum_norm;
use super::{EquilibriumError, Model};
use halfarrow_sim::{Failure, System};

const ITERATIONS: usize = 200;
/// Rates below this fraction of the terms they are made of count as zero.
const AT_REST: f64 = 1e-9;
/// Strides along a curve of equilibria, and states up to which one is followed.
const STRIDES: usize = 400;
const MOST_FOLLOWED: usize = 200;
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
    /// Jacobian, by way of a damped motion where Newton alone does not get there; where that fails as well, the loads
    /// that would hold `x` at rest are taken away little by little, and the equilibrium is followed, round folds too.
    ///
    /// # Errors
    /// There is none near, or the model has no value on the way.
    pub fn equilibrium(&mut self, t: f64, x: &[f64]) -> Result<Equilibrium, EquilibriumError> {
        self.restart();
        let refused = match self.settle(t, x) {
            Err(EquilibriumError::None(left)) => EquilibriumError::None(left),
            settled => return settled,
        };
        let released = self.release_loads(t, x);
        released.and_then(|near| self.settle(t, &near).ok()).ok_or(refused)
    }

    /// A point near the equilibrium that the start `x` is joined to by equilibria under smaller and smaller loads:
    /// `f(x) = (1 - λ) f(start)` from `λ = 0` to 1, along the curve. `None` if the curve does not lead there.
    fn release_loads(&mut self, t: f64, start: &[f64]) -> Option<Vec<f64>> {
        let n = start.len();
        if n > MOST_FOLLOWED {
            return None;
        }
        let (load, _) = self.at_rest(t, start).ok()?;
        // States in parts of their magnitude, so that a length along the curve means something.
        let size = self.magnitudes(t, start);
        let least = size.iter().copied().filter(|s| *s > 0.0).fold(f64::INFINITY, f64::min);
        let size: Vec<f64> = size.into_iter().map(|s| if s > 0.0 { s } else { least.min(1.0) }).collect();
        let (mut z, mut part) = (vec![0.0; n], 0.0);
        let mut along: Vec<f64> = (0..=n).map(|i| f64::from(u8::from(i == n))).collect();
        let mut stride = 0.05;
        for _ in 0..STRIDES {
            let slopes = self.held(t, start, &size, &load, &z, part)?.1;
            along = tangent(&slopes, &along, n)?;
            let trial = |stride: f64| -> (Vec<f64>, f64) {
                let moved = z.iter().zip(&along).map(|(z, a)| z + stride * a).collect();
                (moved, part + stride * along[n])
            };
            // Not beyond the end.
            let reach = if part + stride * along[n] > 1.0 { (1.0 - part) / along[n] } else { stride };
            let (mut at, mut lambda) = trial(reach);
            match self.correct(t, start, &size, &load, &mut at, &mut lambda) {
                Some(iterations) => {
                    (z, part) = (at, lambda);
                    if part >= 1.0 - 1e-9 {
                        return Some(start.iter().zip(&size).zip(&z).map(|((x, s), z)| x + s * z).collect());
                    }
                    stride = if iterations <= 3 { (1.6 * stride).min(5.0) } else { stride };
                }
                None if stride > 1e-7 => stride *= 0.4,
                None => return None,
            }
        }
        None
    }

    /// Newton of least steps back to the curve; how many iterations it took.
    fn correct(
        &mut self,
        t: f64,
        start: &[f64],
        size: &[f64],
        load: &[f64],
        z: &mut [f64],
        part: &mut f64,
    ) -> Option<usize> {
        let n = start.len();
        let mut last = f64::INFINITY;
        for iteration in 1..=8 {
            let (miss, slopes) = self.held(t, start, size, load, z, *part)?;
            let step = minimum_norm::step(&slopes, &miss, n + 1)?.step;
            z.iter_mut().zip(&step).for_each(|(z, s)| *z += s);
            *part += step[n];
            let length = step.iter().map(|s| s * s).sum::<f64>().sqrt();
            if length < 1e-10 {
                return Some(iteration);
            }
            if !length.is_finite() || length > 2.0 * last {
                return None;
            }
            last = length;
        }
        None
    }

    /// `f(x) - (1 - λ) load` and its derivatives by the scaled states and `λ`, row by row.
    fn held(
        &mut self,
        t: f64,
        start: &[f64],
        size: &[f64],
        load: &[f64],
        z: &[f64],
        part: f64,
    ) -> Option<(Vec<f64>, Vec<f64>)> {
        let n = start.len();
        let x: Vec<f64> = start.iter().zip(size).zip(z).map(|((x, s), z)| x + s * z).collect();
        let (rates, jacobian) = self.at_rest(t, &x).ok()?;
        let miss = rates.iter().zip(load).map(|(r, l)| r - (1.0 - part) * l).collect();
        let entry = |i: usize, j: usize| if j < n { jacobian[i * n + j] * size[j] } else { load[i] };
        let slopes = (0..n).flat_map(|i| (0..=n).map(move |j| (i, j))).map(|(i, j)| entry(i, j)).collect();
        Some((miss, slopes))
    }

    /// Newton from `x`, by way of a damped motion.
    fn settle(&mut self, t: f64, x: &[f64]) -> Result<Equilibrium, EquilibriumError> {
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
            // A rate that changes nothing in the shortest time that the model knows is none.
            let fastest = (0..n).map(|i| jacobian[i * n + i].abs()).fold(fastest_pair(&jacobian, n), f64::max);
            let idle = |i: usize, part: f64| rates[i].abs() <= part * x[i].abs() * fastest;
            let stays = |i: usize| newton.step[i].abs() <= 1e-13 * x[i].abs();
            let rests = |i: usize| rates[i].abs() <= 1e-15 * scale[i] || idle(i, 1e-15);
            if (0..n).all(stays) || (0..n).all(rests) {
                if (0..n).all(|i| rates[i].abs() <= AT_REST * scale[i] || idle(i, 1e-13)) {
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

/// The fastest rate at which two states exchange what they hold.
fn fastest_pair(jacobian: &[f64], n: usize) -> f64 {
    let pair = |i: usize, j: usize| (jacobian[i * n + j] * jacobian[j * n + i]).abs().sqrt();
    (0..n).flat_map(|i| (0..i).map(move |j| (i, j))).fold(0.0f64, |most, (i, j)| most.max(pair(i, j)))
}

/// The direction in which the curve goes on from where it went along `before`: what is left of that when all is taken away
/// that the slopes see.
fn tangent(slopes: &[f64], before: &[f64], n: usize) -> Option<Vec<f64>> {
    let seen: Vec<f64> =
        slopes.chunks(n + 1).map(|row| row.iter().zip(before).map(|(s, b)| s * b).sum::<f64>()).collect();
    let back = minimum_norm::step(slopes, &seen, n + 1)?.step;
    let along: Vec<f64> = before.iter().zip(&back).map(|(a, b)| a + b).collect();
    let length = along.iter().map(|a| a * a).sum::<f64>().sqrt();
    (length > 1e-12 && length.is_finite()).then(|| along.iter().map(|a| a / length).collect())
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
