//! Equilibria under smaller and smaller loads, from the start to where nothing but the model itself acts.

use super::leaf::{Leaf, Ways, leading_rows};
use super::{Model, minimum_norm};

/// Strides along the curve, and states up to which one is followed.
const STRIDES: usize = 400;
const MOST_FOLLOWED: usize = 200;

/// What stays the same along the curve.
struct Curve<'a> {
    leaf: Option<&'a Leaf>,
    t: f64,
    /// The rates at the start: the loads that hold it at rest, but for their sign.
    load: Vec<f64>,
    /// The rates that are looked at: as many as there are ways.
    rows: Vec<usize>,
    /// What each state counts as one of, where it moves by itself.
    size: Vec<f64>,
}

/// A point of the curve.
#[derive(Clone)]
struct Place {
    x: Vec<f64>,
    /// How much of the loads is gone.
    part: f64,
}

impl Model {
    /// A point near the equilibrium that the start `x` is joined to by equilibria under smaller and smaller loads:
    /// `f(x) = (1 - λ) f(start)` from `λ = 0` to 1, along the curve. `None` if the curve does not lead there.
    pub(super) fn release_loads(&mut self, leaf: Option<&Leaf>, t: f64, start: &[f64]) -> Option<Vec<f64>> {
        let n = start.len();
        if n > MOST_FOLLOWED {
            return None;
        }
        let (load, jacobian) = self.at_rest(t, start).ok()?;
        // States in parts of their magnitude, so that a length along the curve means something.
        let size = leaf.map_or_else(|| self.sizes(t, start), |leaf| leaf.size.clone());
        let rows = match self.ways(leaf, t, start)? {
            Ways::All => (0..n).collect(),
            // Nothing can move.
            ways if ways.count(n) == 0 => return None,
            ways => leading_rows(&ways.along(&jacobian, n), ways.count(n)),
        };
        if rows.is_empty() {
            // Nothing changes any rate.
            return None;
        }
        let curve = Curve { leaf, t, load, rows, size };
        let mut place = Place { x: start.to_vec(), part: 0.0 };
        // The direction: states in parts of their size, then the part of the loads.
        let mut along: Vec<f64> = (0..=n).map(|i| f64::from(u8::from(i == n))).collect();
        let mut stride = 0.05;
        for _ in 0..STRIDES {
            let (_, slopes, ways) = self.held(&curve, &place)?;
            along = tangent(&curve, &slopes, &along, &ways, n)?;
            // Not beyond the end.
            let beyond = place.part + stride * along[n] > 1.0;
            let reach = if beyond { (1.0 - place.part) / along[n] } else { stride };
            let step: Vec<f64> = along[..n].iter().zip(&curve.size).map(|(a, s)| reach * a * s).collect();
            let moved = self.moved(leaf, t, &place.x, &step);
            let trial = moved.map(|x| Place { x, part: place.part + reach * along[n] });
            match trial.and_then(|trial| self.correct(&curve, trial)) {
                Some((next, iterations)) => {
                    place = next;
                    if place.part >= 1.0 - 1e-9 {
                        return Some(place.x);
                    }
                    stride = if iterations <= 3 { (1.6 * stride).min(5.0) } else { stride };
                }
                None if stride > 1e-7 => stride *= 0.4,
                None => return None,
            }
        }
        None
    }

    /// Newton of least steps back to the curve, with how many iterations it took.
    fn correct(&mut self, curve: &Curve, mut place: Place) -> Option<(Place, usize)> {
        let mut last = f64::INFINITY;
        for iteration in 1..=8 {
            let (miss, slopes, ways) = self.held(curve, &place)?;
            let columns = slopes.len() / miss.len().max(1);
            let step = minimum_norm::step(&slopes, &miss, columns)?.step;
            let states = states_of(curve, &ways, &step[..columns - 1]);
            place =
                Place { x: self.moved(curve.leaf, curve.t, &place.x, &states)?, part: place.part + step[columns - 1] };
            let length = step.iter().map(|s| s * s).sum::<f64>().sqrt();
            if length < 1e-10 {
                return Some((place, iteration));
            }
            if !length.is_finite() || length > 2.0 * last {
                return None;
            }
            last = length;
        }
        None
    }

    /// `f(x) - (1 - λ) load` and its derivatives along the ways, in parts of sizes, and by `λ`, row by row.
    fn held(&mut self, curve: &Curve, place: &Place) -> Option<(Vec<f64>, Vec<f64>, Ways)> {
        let n = place.x.len();
        let (rates, jacobian) = self.at_rest(curve.t, &place.x).ok()?;
        let ways = self.ways(curve.leaf, curve.t, &place.x)?;
        let columns = ways.count(n);
        let mut along = ways.along(&jacobian, n);
        if matches!(ways, Ways::All) {
            along.chunks_mut(n.max(1)).for_each(|row| row.iter_mut().zip(&curve.size).for_each(|(v, s)| *v *= s));
        }
        let miss = curve.rows.iter().map(|&i| rates[i] - (1.0 - place.part) * curve.load[i]).collect();
        let slopes = curve.rows.iter().flat_map(|&i| {
            let row = along[i * columns..][..columns].iter().copied();
            row.chain([curve.load[i]])
        });
        Some((miss, slopes.collect(), ways))
    }
}

/// The step of the states that goes so far along the ways.
fn states_of(curve: &Curve, ways: &Ways, along: &[f64]) -> Vec<f64> {
    match ways {
        Ways::All => along.iter().zip(&curve.size).map(|(a, s)| a * s).collect(),
        ways => ways.step(along),
    }
}

/// The direction in which the curve goes on from where it went along `before`: what is left of that when all is taken away
/// that the slopes see.
fn tangent(curve: &Curve, slopes: &[f64], before: &[f64], ways: &Ways, n: usize) -> Option<Vec<f64>> {
    let columns = ways.count(n) + 1;
    let states: Vec<f64> = before[..n].iter().zip(&curve.size).map(|(b, s)| b * s).collect();
    let mut inside = match ways {
        Ways::All => before[..n].to_vec(),
        ways => ways.parts(&states),
    };
    inside.push(before[n]);
    let seen: Vec<f64> =
        slopes.chunks(columns).map(|row| row.iter().zip(&inside).map(|(s, b)| s * b).sum::<f64>()).collect();
    let back = minimum_norm::step(slopes, &seen, columns)?.step;
    inside.iter_mut().zip(&back).for_each(|(a, b)| *a += b);
    let part = inside[columns - 1];
    let states = states_of(curve, ways, &inside[..columns - 1]);
    let mut along: Vec<f64> = states.iter().zip(&curve.size).map(|(a, s)| a / s).collect();
    along.push(part);
    let length = along.iter().map(|a| a * a).sum::<f64>().sqrt();
    (length > 1e-12 && length.is_finite()).then(|| along.iter().map(|a| a / length).collect())
}
