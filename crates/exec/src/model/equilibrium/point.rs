//! A state with what the next step of a search is made of.

use super::super::{Model, minimum_norm};
use super::leaf::{Directions, Leaf};
use super::open_equations::{Entry, OpenEquations, greatest};
use super::tangent::Tangent;
use super::{FEW_STATES, led};
use halfarrow_sim::{Failure, Jacobian};

/// Derivatives below this fraction of the greatest of their rate, or by their state, are rounding.
pub(super) const LOST: f64 = 1e-12;

/// A state with its rates, their derivatives, and the ways in which constraints let it move.
pub(super) struct LinearisedPoint {
    pub x: Vec<f64>,
    pub rates: Vec<f64>,
    /// The derivatives: row, column and value.
    jacobian: Vec<Entry>,
    ways: Ways,
}

/// The ways in which a state may move.
enum Ways {
    /// Few states: along these directions, with the Jacobian along them.
    Full { directions: Directions, along: Vec<f64> },
    /// Many: all, or those within a leaf, with the sizes of the states.
    Sparse(Option<(Tangent, Vec<f64>)>),
}

/// A step to where the rates vanish, were they linear: the shortest.
pub(super) struct NewtonStep {
    pub step: Vec<f64>,
    /// How many combinations of states do not change the rates.
    pub free: usize,
    /// What the rates count.
    pub weights: Vec<f64>,
}

impl LinearisedPoint {
    /// Whether there is a state that no rate changes with, or a rate that changes with no state, at this point.
    pub fn has_flat_state(&self) -> bool {
        let n = self.x.len();
        let (mut rows, mut columns) = (vec![false; n], vec![false; n]);
        for (row, column, value) in self.entries() {
            rows[row] |= value != 0.0;
            columns[column] |= value != 0.0;
        }
        rows.contains(&false) || columns.contains(&false)
    }

    /// The derivatives: row, column and value.
    pub fn entries(&self) -> impl Iterator<Item = Entry> + '_ {
        self.jacobian.iter().copied()
    }

    /// The fastest rate of a state by itself, or at which two states exchange what they hold.
    pub fn fastest_pair(&self) -> f64 {
        let place = |i: usize, j: usize| self.jacobian.binary_search_by_key(&(j, i), |e| (e.1, e.0));
        let turned = |&(i, j, v): &Entry| place(j, i).map_or(0.0, |at| exchanged(v, self.jacobian[at].2));
        self.jacobian.iter().map(turned).fold(0.0f64, f64::max)
    }

    /// What rates and states count, so that the greatest derivative of each rate and by each state is 1 or less.
    pub fn weights(&self) -> (Vec<f64>, Vec<f64>) {
        let states = self.x.len();
        let rows = greatest(states, self.entries().map(|(i, _, v)| (i, v)));
        let columns = greatest(states, self.entries().map(|(i, j, v)| (j, rows[i] * v)));
        (rows, columns)
    }

    /// The step of Newton's method: of many the shortest, or of few states that which the motion makes, if there is one. `None` if
    /// it does not come out.
    pub fn newton_step(&self, led: bool) -> Option<NewtonStep> {
        match &self.ways {
            Ways::Full { directions, along } => {
                let count = directions.count(self.x.len());
                let mut newton = minimum_norm::step(along, &self.rates, count)?;
                let free = count - newton.rank;
                if led && free > 0 {
                    let mut step = newton.step.clone();
                    if led::led(&self.square(directions, along), &mut step).is_some() {
                        newton.step = step;
                    }
                }
                Some(NewtonStep { step: directions.step(&newton.step), free, weights: newton.weights })
            }
            Ways::Sparse(within) => {
                let (step, free) = self.sparse_step(within.as_ref(), 0.0)?;
                let moved = |j: usize| within.as_ref().map_or(1.0, |within| within.1[j]);
                let weights = greatest(self.x.len(), self.entries().map(|(i, j, v)| (i, v * moved(j))));
                Some(NewtonStep { step, free, weights })
            }
        }
    }

    /// A linearly implicit Euler step of length `pseudo_step` along the motion.
    pub fn pseudo_transient_step(&self, pseudo_step: f64) -> Option<Vec<f64>> {
        let (directions, along) = match &self.ways {
            Ways::Full { directions, along } => (directions, along),
            Ways::Sparse(within) => return Some(self.sparse_step(within.as_ref(), 1.0 / pseudo_step)?.0),
        };
        let k = directions.count(self.x.len());
        let mut lu = crate::bytecode::Lu::new(k, false);
        self.square(directions, along).into_iter().enumerate().for_each(|(at, v)| lu.matrix()[at] = -v);
        (0..k).for_each(|j| lu.matrix()[j * k + j] += 1.0 / pseudo_step);
        lu.factor().ok()?;
        let mut step = directions.parts(&self.rates);
        lu.solve(&mut step);
        step.iter().all(|s| s.is_finite()).then(|| directions.step(&step))
    }

    /// How fast what moves along a direction moves along each: row by row.
    fn square(&self, directions: &Directions, along: &[f64]) -> Vec<f64> {
        let n = self.x.len();
        let k = directions.count(n);
        let mut square = vec![0.0; k * k];
        for j in 0..k {
            let column: Vec<f64> = (0..n).map(|i| along[i * k + j]).collect();
            directions.parts(&column).into_iter().enumerate().for_each(|(i, a)| square[i * k + j] = a);
        }
        square
    }

    /// The shortest step with `(J - slowed) step = -rates`, and how many combinations of states are open.
    fn sparse_step(&self, within: Option<&(Tangent, Vec<f64>)>, slowed: f64) -> Option<(Vec<f64>, usize)> {
        let states = self.x.len();
        let (rows, columns) = match within {
            Some((_, size)) => (size.iter().map(|size| 1.0 / size).collect(), size.clone()),
            None => self.weights(),
        };
        let slowing = (0..states).filter(|_| slowed != 0.0).map(|i| (i, i, -slowed));
        let entries = self.entries().chain(slowing).map(|(i, j, v)| (i, j, rows[i] * v * columns[j]));
        let right = self.rates.iter().zip(&rows).map(|(rate, row)| -rate * row);
        let equations = match within {
            Some((tangent, _)) => tangent.equations(entries, right),
            None => OpenEquations { entries: entries.collect(), right: right.collect() },
        };
        let mut found = equations.solve(states)?;
        found.x.iter_mut().zip(&columns).for_each(|(x, size)| *x *= size);
        Some((found.x, found.open.len()))
    }
}

impl Model {
    /// Which states are inert at `x`, as the spin of a wheel at rest that no axle holds: they change nothing but for rounding.
    pub(super) fn inert(&mut self, jacobian: &mut Jacobian, t: f64, x: &[f64]) -> Result<Vec<bool>, Failure> {
        let entries = self.derivatives(jacobian, t, x)?;
        let rows = greatest(x.len(), entries.iter().map(|&(i, _, v)| (i, v)));
        let columns = greatest(x.len(), entries.iter().map(|&(_, j, v)| (j, v)));
        // How much a state stands out among those that change a rate, and its rate among those that a state changes.
        let (mut changes, mut changed) = (vec![0.0f64; x.len()], vec![0.0f64; x.len()]);
        for (i, j, v) in entries {
            changes[j] = changes[j].max((v * rows[i]).abs());
            changed[i] = changed[i].max((v * columns[j]).abs());
        }
        // The product is the same in whatever unit the state is counted.
        Ok(changes.iter().zip(&changed).map(|(a, b)| a * b < LOST * LOST).collect())
    }

    /// Rates and ways at a state; inert states stay.
    pub(super) fn point(
        &mut self,
        jacobian: &mut Jacobian,
        (leaf, inert): (Option<&Leaf>, &[bool]),
        t: f64,
        x: Vec<f64>,
    ) -> Result<LinearisedPoint, Failure> {
        self.rates_at(t, &x)?;
        self.keep_positions();
        let rates = self.dx.clone();
        let mut entries = self.derivatives(jacobian, t, &x)?;
        entries.retain(|entry| !inert[entry.1]);
        entries.sort_unstable_by_key(|e| (e.1, e.0));
        let ways = match x.len() > FEW_STATES {
            true => self.sparse_ways(leaf, t, &x),
            false => self.full_ways(leaf, t, &x, &entries),
        };
        let without = || Failure::NotFinite { time: t, what: "what the states keep together".into() };
        Ok(LinearisedPoint { ways: ways.ok_or_else(without)?, x, rates, jacobian: entries })
    }

    fn sparse_ways(&mut self, leaf: Option<&Leaf>, t: f64, x: &[f64]) -> Option<Ways> {
        let Some(leaf) = leaf else { return Some(Ways::Sparse(None)) };
        Some(Ways::Sparse(Some((self.tangent(leaf, t, x)?, leaf.size.clone()))))
    }

    fn full_ways(&mut self, leaf: Option<&Leaf>, t: f64, x: &[f64], jacobian: &[Entry]) -> Option<Ways> {
        let directions = self.directions(leaf, t, x)?;
        let along = directions.along(&row_by_row(jacobian, x.len()), x.len());
        Some(Ways::Full { directions, along })
    }

    /// Rates and, row by row, their derivatives.
    pub(in crate::model) fn at_rest(&mut self, t: f64, x: &[f64]) -> Result<(Vec<f64>, Vec<f64>), Failure> {
        self.rates_at(t, x)?;
        let rates = self.dx.clone();
        let mut jacobian = Jacobian::new(&self.code.sparsity);
        let entries = self.derivatives(&mut jacobian, t, x)?;
        Ok((rates, row_by_row(&entries, x.len())))
    }

    /// The derivatives of rates: row, column and value.
    fn derivatives(&mut self, jacobian: &mut Jacobian, t: f64, x: &[f64]) -> Result<Vec<Entry>, Failure> {
        let mut entries = Vec::with_capacity(self.code.sparsity.nonzeros());
        jacobian.visit(self, t, x, |row, column, _, value| entries.push((row, column, value)))?;
        Ok(entries)
    }
}

/// How fast two states exchange what they hold, by how they act on each other; also where the product of both is no number.
pub(in crate::model) fn exchanged(a: f64, b: f64) -> f64 {
    match (a * b).abs() {
        product if product.is_finite() => product.sqrt(),
        _ => a.abs().sqrt() * b.abs().sqrt(),
    }
}

fn row_by_row(entries: &[Entry], states: usize) -> Vec<f64> {
    let mut all = vec![0.0; states * states];
    entries.iter().for_each(|&(i, j, v)| all[i * states + j] = v);
    all
}
