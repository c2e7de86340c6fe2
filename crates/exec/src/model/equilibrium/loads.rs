//! Continuation of equilibria under smaller and smaller loads, from the start to where nothing but the model itself acts: by
//! arclength, hence round folds. Source: [Deuflhard], chapter 5.

use super::super::{Model, minimum_norm};
use super::leaf::{Directions, Leaf, leading_rows};

/// Steps along the path, and states up to which one is followed.
const PATH_STEPS: usize = 400;
const MOST_FOLLOWED: usize = 200;

/// What stays the same along the path.
struct LoadPath<'a> {
    leaf: Option<&'a Leaf>,
    inert: &'a [bool],
    t: f64,
    /// The rates at the start: the loads that hold it at rest, but for their sign.
    load: Vec<f64>,
    /// The rates that have to vanish: as many as there are directions.
    rows: Vec<usize>,
    /// The scale of each state.
    size: Vec<f64>,
}

/// A point of the path.
#[derive(Clone)]
struct PathPoint {
    x: Vec<f64>,
    /// The path parameter: how much of the loads is gone.
    part: f64,
}

impl Model {
    /// A point near the equilibrium that the start `x` is joined to by equilibria under smaller and smaller loads:
    /// `f(x) = (1 - λ) f(start)` from `λ = 0` to 1, along the path. `None` if the path does not lead there.
    pub(super) fn release_loads(
        &mut self,
        (leaf, inert): (Option<&Leaf>, &[bool]),
        t: f64,
        start: &[f64],
    ) -> Option<Vec<f64>> {
        let n = start.len();
        if n > MOST_FOLLOWED {
            return None;
        }
        let (load, jacobian) = self.at_rest(t, start).ok()?;
        // States in parts of their magnitude, so that a length along the path means something.
        let size = leaf.map_or_else(|| self.sizes(t, start), |leaf| leaf.size.clone());
        let rows = match self.directions(leaf, t, start)? {
            Directions::All => (0..n).collect(),
            // Nothing can move.
            directions if directions.count(n) == 0 => return None,
            directions => leading_rows(&directions.along(&jacobian, n), directions.count(n)),
        };
        if rows.is_empty() {
            // Nothing changes any rate.
            return None;
        }
        let path = LoadPath { leaf, inert, t, load, rows, size };
        let mut point = PathPoint { x: start.to_vec(), part: 0.0 };
        // The direction: states in parts of their size, then the part of the loads.
        let mut along: Vec<f64> = (0..=n).map(|i| f64::from(u8::from(i == n))).collect();
        let mut path_step = 0.05;
        for _ in 0..PATH_STEPS {
            let (_, jacobian, directions) = self.homotopy(&path, &point)?;
            along = tangent(&path, &jacobian, &along, &directions, n)?;
            // Not beyond the end.
            let beyond = point.part + path_step * along[n] > 1.0;
            let reach = if beyond { (1.0 - point.part) / along[n] } else { path_step };
            let step: Vec<f64> = along[..n].iter().zip(&path.size).map(|(a, s)| reach * a * s).collect();
            let moved = self.moved(leaf, t, &point.x, &step);
            let trial = moved.map(|x| PathPoint { x, part: point.part + reach * along[n] });
            match trial.and_then(|trial| self.correct(&path, trial)) {
                Some((next, iterations)) => {
                    point = next;
                    if point.part >= 1.0 - 1e-9 {
                        return Some(point.x);
                    }
                    path_step = if iterations <= 3 { (1.6 * path_step).min(5.0) } else { path_step };
                }
                None if path_step > 1e-7 => path_step *= 0.4,
                None => return None,
            }
        }
        None
    }

    /// Corrector: Newton's method of minimum norm back to the path, with how many iterations it took.
    fn correct(&mut self, path: &LoadPath, mut point: PathPoint) -> Option<(PathPoint, usize)> {
        let mut last = f64::INFINITY;
        for iteration in 1..=8 {
            let (residual, jacobian, directions) = self.homotopy(path, &point)?;
            let columns = jacobian.len() / residual.len().max(1);
            let step = minimum_norm::step(&jacobian, &residual, columns)?.step;
            let states = states_of(path, &directions, &step[..columns - 1]);
            point = PathPoint {
                x: self.moved(path.leaf, path.t, &point.x, &states)?,
                part: point.part + step[columns - 1],
            };
            let length = step.iter().map(|s| s * s).sum::<f64>().sqrt();
            if length < 1e-10 {
                return Some((point, iteration));
            }
            if !length.is_finite() || length > 2.0 * last {
                return None;
            }
            last = length;
        }
        None
    }

    /// `f(x) - (1 - λ) load` and its derivatives along the directions, in parts of sizes, and by `λ`, row by row.
    fn homotopy(&mut self, path: &LoadPath, point: &PathPoint) -> Option<(Vec<f64>, Vec<f64>, Directions)> {
        let n = point.x.len();
        let (rates, mut jacobian) = self.at_rest(path.t, &point.x).ok()?;
        jacobian.iter_mut().enumerate().filter(|(at, _)| path.inert[at % n]).for_each(|(_, v)| *v = 0.0);
        let directions = self.directions(path.leaf, path.t, &point.x)?;
        let columns = directions.count(n);
        let mut along = directions.along(&jacobian, n);
        if matches!(directions, Directions::All) {
            along.chunks_mut(n.max(1)).for_each(|row| row.iter_mut().zip(&path.size).for_each(|(v, s)| *v *= s));
        }
        let residual = path.rows.iter().map(|&i| rates[i] - (1.0 - point.part) * path.load[i]).collect();
        let jacobian = path.rows.iter().flat_map(|&i| {
            let row = along[i * columns..][..columns].iter().copied();
            row.chain([path.load[i]])
        });
        Some((residual, jacobian.collect(), directions))
    }
}

/// The step of the states that goes so far along the directions.
fn states_of(path: &LoadPath, directions: &Directions, along: &[f64]) -> Vec<f64> {
    match directions {
        Directions::All => along.iter().zip(&path.size).map(|(a, s)| a * s).collect(),
        directions => directions.step(along),
    }
}

/// Predictor: the tangent of the path, which is `before` less its projection on the row space of the Jacobian.
fn tangent(path: &LoadPath, jacobian: &[f64], before: &[f64], directions: &Directions, n: usize) -> Option<Vec<f64>> {
    let columns = directions.count(n) + 1;
    let states: Vec<f64> = before[..n].iter().zip(&path.size).map(|(b, s)| b * s).collect();
    let mut inside = match directions {
        Directions::All => before[..n].to_vec(),
        directions => directions.parts(&states),
    };
    inside.push(before[n]);
    let seen: Vec<f64> =
        jacobian.chunks(columns).map(|row| row.iter().zip(&inside).map(|(s, b)| s * b).sum::<f64>()).collect();
    let back = minimum_norm::step(jacobian, &seen, columns)?.step;
    inside.iter_mut().zip(&back).for_each(|(a, b)| *a += b);
    let part = inside[columns - 1];
    let states = states_of(path, directions, &inside[..columns - 1]);
    let mut along: Vec<f64> = states.iter().zip(&path.size).map(|(a, s)| a / s).collect();
    along.push(part);
    let length = along.iter().map(|a| a * a).sum::<f64>().sqrt();
    (length > 1e-12 && length.is_finite()).then(|| along.iter().map(|a| a / length).collect())
}
