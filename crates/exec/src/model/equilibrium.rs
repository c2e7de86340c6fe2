//! Equilibria: Newton's method, and pseudo-transient continuation where it fails. Source: [KelleyKeyes].

use super::leaf::{Directions, Leaf};
use super::minimum_norm;
use super::{EquilibriumError, Model};
use halfarrow_sim::{Failure, System};

const ITERATIONS: usize = 200;
/// Rates below this fraction of the terms they are made of count as zero.
const AT_REST: f64 = 1e-9;
/// More states than this are not searched: the equations are dense.
const LARGEST: usize = 2000;
/// A constraint counts as kept if it is missed by less than this fraction of what its displacements come to.
const KEPT: f64 = 1e-8;

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

/// A state with its rates, the Jacobian row by row, and the directions in which constraints let it move.
struct LinearisedPoint {
    x: Vec<f64>,
    rates: Vec<f64>,
    jacobian: Vec<f64>,
    directions: Directions,
    /// The Jacobian along the directions.
    along: Vec<f64>,
}

/// The least rates of a search, all weighed as at its beginning.
struct LeastRates {
    weights: Vec<f64>,
    least: f64,
    rates: Vec<f64>,
    /// The terms that the rates were made of.
    scale: Vec<f64>,
}

impl LeastRates {
    fn new(weights: Vec<f64>) -> LeastRates {
        LeastRates { weights, least: f64::INFINITY, rates: Vec::new(), scale: Vec::new() }
    }

    fn update(&mut self, rates: &[f64], scale: &[f64]) {
        let size = rates.iter().zip(&self.weights).fold(0.0f64, |most, (r, w)| most.max((r * w).abs()));
        if size < self.least {
            (self.least, self.rates, self.scale) = (size, rates.to_vec(), scale.to_vec());
        }
    }
}

impl Model {
    /// The equilibrium nearest to `x` at time `t`, with inputs and conditions as they are then: Newton with the exact
    /// Jacobian, by way of pseudo-transient continuation where Newton alone does not get there; where that fails as well,
    /// by continuation: the loads that would hold `x` at rest are taken away little by little, and the equilibrium is followed,
    /// round folds too.
    ///
    /// The search goes only where the junction structure lets the states go from `x`: relations of displacements hold at
    /// the equilibrium as they do at `x`, those of constraints and those that the graph implies. `x` should keep the
    /// constraints.
    ///
    /// # Errors
    /// There is none near, or the model has no value on the way.
    pub fn equilibrium(&mut self, t: f64, x: &[f64]) -> Result<Equilibrium, EquilibriumError> {
        self.restart();
        if x.len() > LARGEST {
            return Err(EquilibriumError::TooLarge(x.len()));
        }
        let leaf = self.leaf(t, x);
        let leaf = leaf.as_ref();
        let refused = match self.settle(leaf, t, x).and_then(|found| self.audited(leaf, t, found)) {
            Err(EquilibriumError::Failure(failure)) => return Err(EquilibriumError::Failure(failure)),
            Err(refused) => refused,
            found => return found,
        };
        let released = self.release_loads(leaf, t, x);
        let settled = released.and_then(|near| self.settle(leaf, t, &near).ok());
        settled.and_then(|found| self.audited(leaf, t, found).ok()).ok_or(refused)
    }

    /// What was found, if the constraints are kept there.
    fn audited(&mut self, leaf: Option<&Leaf>, t: f64, found: Equilibrium) -> Result<Equilibrium, EquilibriumError> {
        let constraints = self.constraints();
        match self.unmet_constraint(&constraints, t, &found.x, leaf.map_or(&[], |leaf| &leaf.size), KEPT) {
            Some((name, miss)) => Err(EquilibriumError::Missed(name, miss)),
            None => Ok(found),
        }
    }

    /// Newton's method from `x`; where it fails pseudo-transient continuation, whose step grows as the rates shrink (switched
    /// evolution relaxation), until it is Newton's again.
    fn settle(&mut self, leaf: Option<&Leaf>, t: f64, x: &[f64]) -> Result<Equilibrium, EquilibriumError> {
        let n = x.len();
        let mut scale = vec![0.0f64; n];
        let mut pseudo_step = f64::INFINITY;
        let mut least: Option<LeastRates> = None;
        let mut at = self.point(leaf, t, x.to_vec()).map_err(EquilibriumError::Failure)?;
        for iteration in 0..ITERATIONS {
            let LinearisedPoint { x, rates, jacobian, directions, along } = &at;
            for (i, row) in jacobian.chunks(n.max(1)).enumerate() {
                let terms: f64 = row.iter().zip(x).map(|(j, x)| (j * x).abs()).sum();
                scale[i] = scale[i].max(rates[i].abs()).max(terms);
            }
            let newton = minimum_norm::step(along, rates, directions.count(n));
            let Some(newton) = newton else { break };
            let step = directions.step(&newton.step);
            // A rate that changes nothing in the shortest time that the model knows is none.
            let fastest = (0..n).map(|i| jacobian[i * n + i].abs()).fold(fastest_pair(jacobian, n), f64::max);
            let idle = |i: usize, part: f64| rates[i].abs() <= part * x[i].abs() * fastest;
            let stays = |i: usize| step[i].abs() <= 1e-13 * x[i].abs();
            let rests = |i: usize| rates[i].abs() <= 1e-15 * scale[i] || idle(i, 1e-15);
            if (0..n).all(stays) || (0..n).all(rests) {
                if (0..n).all(|i| rates[i].abs() <= AT_REST * scale[i] || idle(i, 1e-13)) {
                    return Ok(Equilibrium {
                        x: x.clone(),
                        free: directions.count(n) - newton.rank,
                        iterations: iteration,
                    });
                }
                if pseudo_step.is_infinite() {
                    break;
                }
            }
            let norm = |r: &[f64]| r.iter().zip(&newton.weights).map(|(r, w)| (r * w) * (r * w)).sum::<f64>().sqrt();
            let before = norm(rates);
            let least = least.get_or_insert_with(|| LeastRates::new(newton.weights.clone()));
            least.update(rates, &scale);
            let step = match pseudo_step.is_infinite() {
                true => step,
                false => pseudo_transient_step(&at, pseudo_step, n).unwrap_or(step),
            };
            let least_damping = if pseudo_step.is_infinite() { 1e-3 } else { 1e-9 };
            let mut damping = 1.0;
            let moved = loop {
                let part: Vec<f64> = step.iter().map(|s| damping * s).collect();
                let trial = self.moved(leaf, t, &at.x, &part);
                let kept = trial.filter(|trial| !self.leaves_constraints(leaf, t, trial));
                match kept.and_then(|trial| self.point(leaf, t, trial).ok()) {
                    Some(next) if norm(&next.rates) < before || !pseudo_step.is_infinite() => break Some(next),
                    _ if damping < least_damping => break None,
                    _ => damping *= 0.5,
                }
            };
            match moved {
                Some(next) => {
                    let gain = (before / norm(&next.rates).max(f64::MIN_POSITIVE)).clamp(0.3, 10.0);
                    pseudo_step *= gain;
                    pseudo_step = if pseudo_step > 1e12 { f64::INFINITY } else { pseudo_step };
                    at = next;
                }
                // Newton's method fails: follow the motion in pseudo-time, with a small step at first.
                None if pseudo_step.is_infinite() => {
                    let fastest = at.jacobian.iter().fold(0.0f64, |most, j| most.max(j.abs()));
                    pseudo_step = if fastest > 0.0 { 0.1 / fastest } else { break };
                }
                None => break,
            }
        }
        match least {
            Some(LeastRates { rates, scale, .. }) if !rates.is_empty() => self.no_equilibrium(&rates, &scale),
            _ => self.no_equilibrium(&at.rates, &scale),
        }
    }

    /// Whether a move has left a constraint: near a position where a form is singular a long one may.
    fn leaves_constraints(&mut self, leaf: Option<&Leaf>, t: f64, x: &[f64]) -> bool {
        leaf.is_some_and(|leaf| self.unmet_constraint(&leaf.constraints, t, x, &leaf.size, KEPT).is_some())
    }

    /// Rates and directions at a state.
    fn point(&mut self, leaf: Option<&Leaf>, t: f64, x: Vec<f64>) -> Result<LinearisedPoint, Failure> {
        let (rates, jacobian) = self.at_rest(t, &x)?;
        let without = || Failure::NotFinite { time: t, what: "what the states keep together".into() };
        let directions = self.directions(leaf, t, &x).ok_or_else(without)?;
        let along = directions.along(&jacobian, x.len());
        Ok(LinearisedPoint { x, rates, jacobian, directions, along })
    }

    fn no_equilibrium(&self, rates: &[f64], scale: &[f64]) -> Result<Equilibrium, EquilibriumError> {
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
            self.directional_derivative(t, x, &v, &mut jv)?;
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

/// A linearly implicit Euler step of length `pseudo_step` along the motion.
fn pseudo_transient_step(at: &LinearisedPoint, pseudo_step: f64, n: usize) -> Option<Vec<f64>> {
    let k = at.directions.count(n);
    let mut lu = crate::bytecode::Lu::new(k, false);
    for j in 0..k {
        let column: Vec<f64> = (0..n).map(|i| at.along[i * k + j]).collect();
        at.directions.parts(&column).iter().enumerate().for_each(|(i, a)| lu.matrix()[i * k + j] = -a);
        lu.matrix()[j * k + j] += 1.0 / pseudo_step;
    }
    lu.factor().ok()?;
    let mut step = at.directions.parts(&at.rates);
    lu.solve(&mut step);
    step.iter().all(|s| s.is_finite()).then(|| at.directions.step(&step))
}
