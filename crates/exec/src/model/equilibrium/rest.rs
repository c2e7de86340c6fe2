//! When a state counts as one of rest: rates are compared with the terms that they are made of.

use super::point::{LOST, LinearisedPoint};

/// Rates below this fraction of their own terms count as zero.
const AT_REST: f64 = 1e-9;
/// Steps below this fraction of what they are steps of lead no further.
const NEAR: f64 = 1e-7;
/// Rates below this fraction of the greatest terms of what they are joined to are rounding: normwise backward error. Source:
/// [Higham], chapter 7.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// A rate that was so many times above what counts as zero where the search began is none where it is not less than
const CLEARLY: f64 = 1e3;
/// and more than this part of the greatest rate there, as rates count,
const BESIDE_OTHERS: f64 = 1e-6;
/// this part of what it was: what adds up far away, where a spring leads from one great number to another, tells nothing.
const UNCHANGED: f64 = 0.1;

/// What the rates of a search are compared with.
pub(super) struct Rest {
    /// The greatest terms of each rate on the way.
    terms: Vec<f64>,
    /// The terms that each rate would have if all that is joined to it were as great as the greatest of it.
    joined: Vec<f64>,
    /// The fastest rate of the model, in 1/s.
    fastest: f64,
    /// Where the search began, and the rates there.
    start: Vec<f64>,
    first: Vec<f64>,
    /// Which of them were clearly more than zero.
    moved_first: Vec<bool>,
}

impl Rest {
    /// Of a search that begins at `x`.
    pub fn new(x: &[f64]) -> Rest {
        Rest {
            terms: vec![0.0; x.len()],
            joined: vec![0.0; x.len()],
            fastest: 0.0,
            start: x.to_vec(),
            first: Vec::new(),
            moved_first: Vec::new(),
        }
    }

    /// Takes a point of the search into account.
    pub fn see(&mut self, at: &LinearisedPoint) {
        let mut terms: Vec<f64> = vec![0.0; at.x.len()];
        let weights = at.weights();
        // A derivative that is rounding beside the others of its rate makes no term, however far a search has moved the state.
        let counts = |i: usize, v: f64| (weights.0[i] * v).abs() > LOST;
        at.entries().filter(|&(i, _, v)| counts(i, v)).for_each(|(i, j, v)| terms[i] += (v * at.x[j]).abs());
        for ((most, own), rate) in self.terms.iter_mut().zip(terms).zip(&at.rates) {
            *most = most.max(rate.abs()).max(own);
        }
        self.fastest = at.fastest_pair();
        self.joined = joined(at, &weights);
        if self.first.is_empty() {
            self.first.clone_from(&at.rates);
            let size = |i: usize| (weights.0[i] * at.rates[i]).abs();
            let most = (0..at.x.len()).map(size).filter(|size| size.is_finite()).fold(0.0f64, f64::max);
            let clearly = |i: usize| size(i) > BESIDE_OTHERS * most && self.moves(i, at.rates[i] / CLEARLY);
            self.moved_first = (0..at.x.len()).map(clearly).collect();
        }
    }

    /// Whether all rates vanish as far as their own terms tell.
    pub fn is_exact(&self, at: &LinearisedPoint) -> bool {
        (0..at.x.len()).all(|i| at.rates[i].abs() <= 1e-15 * self.terms[i] || self.is_idle(at, i, 1e-15))
    }

    /// Whether all rates are as good as zero.
    pub fn is_reached(&self, at: &LinearisedPoint) -> bool {
        let moves = |i: usize| self.is_unchanged(&at.rates, i) || self.moves(i, at.rates[i]);
        (0..at.x.len()).all(|i| !moves(i) || self.is_idle(at, i, 1e-13))
    }

    /// Whether any of these rates is about what it was where the search began, and was more than zero there.
    pub fn are_unchanged(&self, rates: &[f64]) -> bool {
        (0..rates.len()).any(|i| self.is_unchanged(rates, i))
    }

    fn is_unchanged(&self, rates: &[f64], i: usize) -> bool {
        self.moved_first[i] && rates[i].abs() > UNCHANGED * self.first[i].abs()
    }

    /// Whether a step leads hardly further, beside where the search stands and where it began. Rates tell that by themselves
    /// only where they have been about linear: those of a diode are small beside what they were long before they vanish, and
    /// those of bodies far apart get less and less.
    pub fn is_near(&self, at: &LinearisedPoint, step: &[f64]) -> bool {
        // Rates that vanish beside what they add up where the search stands need no word of where it has been.
        let mut here = Rest::new(&self.start);
        here.see(at);
        if here.is_reached(at) {
            return true;
        }
        let size = |i: usize| at.x[i].abs().max(self.start[i].abs());
        let columns = at.weights().1;
        let mut component = components(at);
        let mut greatest = vec![0.0f64; step.len()];
        for (i, column) in columns.iter().enumerate() {
            let own = root(&mut component, i);
            greatest[own] = greatest[own].max(size(i) / column);
        }
        let alone = self.steps_alone(at);
        (0..step.len()).all(|i| {
            let joined = columns[i] * greatest[root(&mut component, i)];
            let own = if size(i) > 0.0 { size(i) } else { joined };
            step[i].abs() <= NEAR * size(i).max(joined) && alone[i] <= NEAR * own
        })
    }

    /// How far each state by itself is from where the rate vanishes that it changes most, as far as that rate is more than rounding:
    /// a step that rates hardly tell any more is none of those that solve for all of them.
    fn steps_alone(&self, at: &LinearisedPoint) -> Vec<f64> {
        let n = at.x.len();
        let rows = at.weights().0;
        let (mut most, mut alone, mut terms) = (vec![0.0f64; n], vec![0.0f64; n], vec![0.0f64; n]);
        let mut told = vec![false; n];
        at.entries().for_each(|(i, j, v)| terms[i] += (v * at.x[j]).abs());
        for (i, j, v) in at.entries().filter(|e| e.2 != 0.0) {
            told[i] = true;
            let weight = (rows[i] * v).abs();
            if weight > most[j] {
                let counts = at.rates[i].abs() > LOST * terms[i];
                (most[j], alone[j]) = (weight, if counts { (at.rates[i] / v).abs() } else { 0.0 });
            }
        }
        for (i, rate) in at.rates.iter().enumerate() {
            // What moves as at the beginning, whatever the states are.
            if !told[i] && rate.abs() > AT_REST * self.first[i].abs() && !self.is_idle(at, i, 1e-13) {
                alone[i] = f64::INFINITY;
            }
        }
        alone
    }

    /// Whether a rate changes nothing in the shortest time that the model knows.
    fn is_idle(&self, at: &LinearisedPoint, i: usize, part: f64) -> bool {
        at.rates[i].abs() <= part * at.x[i].abs() * self.fastest
    }

    fn moves(&self, i: usize, rate: f64) -> bool {
        rate.abs() > AT_REST * self.terms[i] && rate.abs() > ROUNDING * self.joined[i]
    }

    /// The states that move most, with their rates.
    pub fn moving(&self, rates: &[f64]) -> Vec<(usize, f64)> {
        let mut worst: Vec<usize> = (0..rates.len()).filter(|&i| self.moves(i, rates[i])).collect();
        let share = |i: usize| rates[i].abs() / self.terms[i].max(f64::MIN_POSITIVE);
        worst.sort_by(|&a, &b| share(b).total_cmp(&share(a)).then(a.cmp(&b)));
        worst.truncate(3);
        worst.into_iter().map(|i| (i, rates[i])).collect()
    }
}

/// What the terms of each rate would add up to, were all states that are joined by rates as great as the greatest of them,
/// where each counts by what it does to rates.
fn joined(at: &LinearisedPoint, (rows, columns): &(Vec<f64>, Vec<f64>)) -> Vec<f64> {
    let mut component = components(at);
    let mut greatest = vec![0.0f64; at.x.len()];
    for (i, x) in at.x.iter().enumerate() {
        let own = root(&mut component, i);
        greatest[own] = greatest[own].max(x.abs() / columns[i]);
    }
    let mut joined = vec![0.0; at.x.len()];
    at.entries().for_each(|(i, j, v)| joined[i] += (rows[i] * v * columns[j]).abs());
    let scaled = |(i, sum): (usize, f64)| sum / rows[i] * greatest[root(&mut component, i)];
    joined.into_iter().enumerate().map(scaled).collect()
}

/// States joined by rates, see [`root`].
fn components(at: &LinearisedPoint) -> Vec<usize> {
    let mut component: Vec<usize> = (0..at.x.len()).collect();
    at.entries().filter(|e| e.2 != 0.0).for_each(|(i, j, _)| {
        let (a, b) = (root(&mut component, i), root(&mut component, j));
        component[a.max(b)] = a.min(b);
    });
    component
}

/// The least state that is joined to this one.
fn root(component: &mut [usize], mut i: usize) -> usize {
    while component[i] != i {
        component[i] = component[component[i]];
        i = component[i];
    }
    i
}
