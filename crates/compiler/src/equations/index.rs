//! The differentiation index of a form and of each of its unknowns, and the counts of its equations.
//!
//! From the linearisation at the given parameters and an arbitrary state, or if that has a higher index than the form
//! promises, at the first of some others that has not: of the equations `E y' + A y = 0` and those
//! differentiated `k` times, an unknown has an index of at most `k` if they determine its rate. For semi-explicit systems
//! in Hessenberg form, which these are, that is the differentiation index.

use std::collections::{BTreeMap, BTreeSet};

use super::definitions::Definitions;
use super::{Algebraic, EquationStep, LinearBlock, NewtonBlock, State, StateKind};
use crate::algebra::{Expr, Symbol};
use crate::causal_paths::Count;
use crate::causal_paths::numeric::{Row, arbitrary, rank};

/// More unknowns than this are not examined: their index is what the form promises.
const EXAMINED: usize = 150;
/// Nothing here has a higher index.
const HIGHEST: u8 = 4;
/// Entries below this, in rows scaled to 1, count as zero.
const TINY: f64 = 1e-9;
/// What is left of a sum of terms that cancel, against their size.
const ROUNDING: f64 = 1e-13;

/// Sizes of the arbitrary states: an exponential law can be steep or flat beyond the digits at any one of them.
const SIZES: [f64; 4] = [1.0, 1e-1, 1e-2, 1e-4];

/// What the linearisation tells.
pub struct Indices {
    /// Index of the whole, 0 if all rates are determined.
    pub index: u8,
    /// Index of each unknown, at least 1.
    pub indices: Vec<u8>,
    /// Numbers of equations.
    pub counts: Count,
}

/// The index of a form that consists of these steps and residuals.
pub fn indices(
    d: &mut Definitions,
    states: &[State],
    algebraic: &[Algebraic],
    steps: &[EquationStep],
    residuals: &[Expr],
) -> Indices {
    let n = states.len() + algebraic.len();
    let storages = states.iter().filter(|s| s.kind != StateKind::Signal).count();
    let plain =
        Indices { index: 0, indices: vec![1; n], counts: Count { differential: storages, algebraic: algebraic.len() } };
    if residuals.is_empty() {
        return plain;
    }
    let promised = |indices: Vec<u8>| Indices { index: indices.iter().copied().max().unwrap_or(0), indices, ..plain };
    let promise = promised(promised_indices(d, states, algebraic, steps, residuals));
    if n > EXAMINED {
        return promise;
    }
    let mut first = None;
    for size in SIZES {
        let rows = Linearised::of(d, size, states, algebraic, steps).rows(states, residuals);
        let Some(found) = rows.map(|rows| indices_at(&rows, states, algebraic)) else { continue };
        if found.index <= promise.index {
            return found;
        }
        first = first.or(Some(found));
    }
    first.unwrap_or(promise)
}

/// What one linearisation tells.
fn indices_at(rows: &[Linear], states: &[State], algebraic: &[Algebraic]) -> Indices {
    let n = states.len() + algebraic.len();
    let storages = states.iter().filter(|s| s.kind != StateKind::Signal).count();
    let storage = |i: usize| states.get(i).is_some_and(|s| s.kind != StateKind::Signal);
    let ours = |row: &Linear| row.rates.iter().filter(|(i, _)| storage(**i)).map(|(&i, &e)| (i, e)).collect::<Row>();
    let differential = rank(rows.iter().map(ours).collect());
    let counts = Count { differential, algebraic: storages + algebraic.len() - differential };
    let mut indices = vec![HIGHEST; n];
    let mut index = HIGHEST;
    for k in 0..HIGHEST {
        let determined = determined(rows, n, k as usize);
        for (i, known) in determined.iter().enumerate() {
            if *known {
                indices[i] = indices[i].min(k.max(1));
            }
        }
        if determined.iter().all(|known| *known) {
            index = k;
            break;
        }
    }
    Indices { index, indices, counts }
}

/// What a form promises of its unknowns: multipliers hold relations among states, and with them break variables whose
/// equations read multipliers; other break variables hold among themselves.
fn promised_indices(
    d: &Definitions,
    states: &[State],
    algebraic: &[Algebraic],
    steps: &[EquationStep],
    residuals: &[Expr],
) -> Vec<u8> {
    let multipliers = algebraic.iter().filter(|a| matches!(a.cause, super::AlgebraicRole::Multiplier(_)));
    let mut higher: BTreeSet<Symbol> = multipliers.map(|a| a.symbol).collect();
    let own = &residuals[residuals.len() - algebraic.len()..];
    loop {
        let before = higher.len();
        let mut along = higher.clone();
        let reads = |along: &BTreeSet<Symbol>, e: &Expr| d.x.depends_on_any(*e, &|s| along.contains(&s));
        for step in steps {
            if step.expressions().iter().any(|e| reads(&along, e)) {
                along.extend(step.defined());
            }
        }
        higher.extend(algebraic.iter().zip(own).filter(|(_, e)| reads(&along, e)).map(|(a, _)| a.symbol));
        if higher.len() == before {
            break;
        }
    }
    let of = |a: &Algebraic| if higher.contains(&a.symbol) { 2 } else { 1 };
    states.iter().map(|_| 1).chain(algebraic.iter().map(of)).collect()
}

/// A gradient by unknowns and by rates; and the same with all terms of one sign, which tells what cancels.
#[derive(Debug, Clone, Default)]
struct Linear {
    values: Row,
    rates: Row,
    sizes: [Row; 2],
}

impl Linear {
    fn value(column: usize) -> Linear {
        let row = Row::from([(column, 1.0)]);
        Linear { values: row.clone(), rates: Row::new(), sizes: [row, Row::new()] }
    }

    fn rate(column: usize) -> Linear {
        let row = Row::from([(column, 1.0)]);
        Linear { values: Row::new(), rates: row.clone(), sizes: [Row::new(), row] }
    }

    fn add(&mut self, other: &Linear, factor: f64) {
        let [sizes, sizes_of_rates] = &mut self.sizes;
        for (mine, theirs, factor) in [
            (&mut self.values, &other.values, factor),
            (&mut self.rates, &other.rates, factor),
            (sizes, &other.sizes[0], factor.abs()),
            (sizes_of_rates, &other.sizes[1], factor.abs()),
        ] {
            for (&column, entry) in theirs {
                *mine.entry(column).or_insert(0.0) += factor * entry;
            }
        }
    }

    /// Whether the terms of an unknown or a rate cancel to rounding.
    fn cancels(&self) -> bool {
        let rows = [(&self.values, &self.sizes[0]), (&self.rates, &self.sizes[1])];
        rows.iter().any(|(row, sizes)| sizes.iter().any(|(c, size)| *size > 0.0 && row[c].abs() <= ROUNDING * size))
    }
}

/// The residuals whose terms of an unknown or a rate cancel to rounding at an arbitrary state.
pub fn cancelling(
    d: &mut Definitions,
    states: &[State],
    algebraic: &[Algebraic],
    steps: &[EquationStep],
    residuals: &[Expr],
) -> Vec<usize> {
    if residuals.is_empty() || states.len() + algebraic.len() > EXAMINED {
        return Vec::new();
    }
    let mut all = Linearised::of(d, SIZES[0], states, algebraic, steps);
    (0..residuals.len()).filter(|&i| all.gradient(residuals[i], &[]).cancels()).collect()
}

/// Values and gradients of all symbols.
struct Linearised<'d, 'a> {
    d: &'d mut Definitions<'a>,
    values: BTreeMap<Symbol, f64>,
    gradients: BTreeMap<Symbol, Linear>,
    /// Size of the arbitrary state.
    size: f64,
    good: bool,
}

impl<'d, 'a> Linearised<'d, 'a> {
    fn of(
        d: &'d mut Definitions<'a>,
        size: f64,
        states: &[State],
        algebraic: &[Algebraic],
        steps: &[EquationStep],
    ) -> Self {
        let mut all = Linearised { d, values: BTreeMap::new(), gradients: BTreeMap::new(), size, good: true };
        let unknowns = states.iter().map(|s| s.symbol).chain(algebraic.iter().map(|a| a.symbol));
        for (i, symbol) in unknowns.enumerate() {
            all.gradients.insert(symbol, Linear::value(i));
        }
        for (i, state) in states.iter().enumerate().filter(|(_, s)| !steps.iter().any(|step| step.defines(s.rate))) {
            all.gradients.insert(state.rate, Linear::rate(i));
        }
        steps.iter().for_each(|step| all.step(step));
        all
    }

    fn value(&self, e: Expr) -> f64 {
        let x = &self.d.x;
        x.eval(e, &mut |symbol| match self.values.get(&symbol) {
            Some(&value) => value,
            None => {
                x.facts(symbol).given.and_then(|g| x.given_value(g)).unwrap_or_else(|| self.size * arbitrary(symbol))
            }
        })
    }

    /// The gradient of an expression, the symbols in `held` not followed.
    fn gradient(&mut self, e: Expr, held: &[Symbol]) -> Linear {
        let mut sum = Linear::default();
        for symbol in self.d.x.symbols_of(e) {
            let Some(inner) = self.gradients.get(&symbol).filter(|_| !held.contains(&symbol)).cloned() else {
                continue;
            };
            let slope = self.slope(e, symbol);
            sum.add(&inner, slope);
        }
        sum
    }

    fn slope(&mut self, e: Expr, symbol: Symbol) -> f64 {
        let slope = self.d.x.derivative(e, symbol);
        let slope = self.value(slope);
        self.good &= slope.is_finite();
        slope
    }

    fn step(&mut self, step: &EquationStep) {
        match step {
            EquationStep::Assign { symbol, value } => {
                let gradient = self.gradient(*value, &[]);
                let value = self.value(*value);
                self.values.insert(*symbol, value);
                self.gradients.insert(*symbol, gradient);
            }
            EquationStep::Linear(block) => {
                let LinearBlock { unknowns, matrix, right, .. } = &**block;
                let n = unknowns.len().max(1);
                let dense = matrix.map(|&e| self.value(e)).dense(0.0);
                let a: Vec<Vec<f64>> = dense.chunks(n).map(<[f64]>::to_vec).collect();
                let b: Vec<f64> = right.iter().map(|&e| self.value(e)).collect();
                let Some(inverse) = inverse(&a) else {
                    self.good = false;
                    return;
                };
                for (&u, row) in unknowns.iter().zip(&inverse) {
                    self.values.insert(u, row.iter().zip(&b).map(|(m, b)| m * b).sum());
                }
                let mut moved = Vec::new();
                for (row, &right) in matrix.rows().zip(right) {
                    let mut gradient = self.gradient(right, &[]);
                    for (u, &e) in row.map(|(k, e)| (&unknowns[k], e)) {
                        let entry = self.gradient(e, &[]);
                        gradient.add(&entry, -self.values[u]);
                    }
                    moved.push(gradient);
                }
                self.solved(unknowns, &inverse, &moved);
            }
            EquationStep::Newton(block) => {
                let NewtonBlock { unknowns, body, residuals, .. } = &**block;
                let flat = super::blocks::substituted(&mut self.d.x, body, residuals);
                let slopes: Vec<Vec<f64>> =
                    flat.iter().map(|&r| unknowns.iter().map(|&u| self.slope(r, u)).collect()).collect();
                let moved: Vec<Linear> = flat
                    .iter()
                    .map(|&r| {
                        let mut negative = Linear::default();
                        negative.add(&self.gradient(r, unknowns), -1.0);
                        negative
                    })
                    .collect();
                match inverse(&slopes) {
                    Some(inverse) => self.solved(unknowns, &inverse, &moved),
                    None => self.good = false,
                }
            }
            EquationStep::Guard { .. } => {}
        }
    }

    fn solved(&mut self, unknowns: &[Symbol], inverse: &[Vec<f64>], right: &[Linear]) {
        for (&u, row) in unknowns.iter().zip(inverse) {
            let mut gradient = Linear::default();
            row.iter().zip(right).for_each(|(&m, r)| gradient.add(r, m));
            self.gradients.insert(u, gradient);
        }
    }

    /// The rows of the whole system: explicit rates, then residuals; `None` if something has no value.
    fn rows(mut self, states: &[State], residuals: &[Expr]) -> Option<Vec<Linear>> {
        let mut rows = Vec::new();
        for (i, state) in states.iter().enumerate() {
            let rate = self.gradients.get(&state.rate).cloned().unwrap_or_default();
            let free = rate.rates.len() == 1 && rate.rates.get(&i) == Some(&1.0) && rate.values.is_empty();
            if !free {
                let mut row = Linear::rate(i);
                row.add(&rate, -1.0);
                rows.push(row);
            }
        }
        for &residual in residuals {
            rows.push(self.gradient(residual, &[]));
        }
        let finite = rows.iter().all(|r| r.values.values().chain(r.rates.values()).all(|e| e.is_finite()));
        (self.good && finite).then_some(rows)
    }
}

impl EquationStep {
    /// Whether a symbol is among those that the step defines.
    pub(super) fn defines(&self, symbol: Symbol) -> bool {
        match self {
            EquationStep::Assign { symbol: own, .. } => *own == symbol,
            EquationStep::Linear(block) => block.unknowns.contains(&symbol),
            EquationStep::Newton(block) => {
                let NewtonBlock { unknowns, body, .. } = &**block;
                unknowns.contains(&symbol) || body.iter().any(|(own, _)| *own == symbol)
            }
            EquationStep::Guard { .. } => false,
        }
    }

    /// All expressions that the step evaluates for what it defines.
    pub fn expressions(&self) -> Vec<Expr> {
        match self {
            EquationStep::Assign { value, .. } => vec![*value],
            EquationStep::Linear(block) => {
                let entries = block.matrix.rows().flatten().map(|(_, e)| *e);
                entries.chain(block.right.iter().copied()).collect()
            }
            EquationStep::Newton(block) => {
                block.body.iter().map(|(_, e)| *e).chain(block.residuals.iter().copied()).collect()
            }
            EquationStep::Guard { .. } => Vec::new(),
        }
    }
}

/// Which rates the equations and their first `k` derivatives determine.
fn determined(rows: &[Linear], n: usize, k: usize) -> Vec<bool> {
    // Columns: the highest derivatives first, the rates last. The j-th derivative of a row reads y^(j+1) and y^(j).
    let column = |order: usize, i: usize| (k + 1 - order) * n + i;
    let mut matrix: Vec<Row> = Vec::new();
    for j in 0..=k {
        for row in rows {
            let mut entries: Row = row.rates.iter().map(|(&i, &e)| (column(j + 1, i), e)).collect();
            if j > 0 {
                entries.extend(row.values.iter().map(|(&i, &e)| (column(j, i), e)));
            }
            matrix.push(entries);
        }
    }
    let reduced = reduce(matrix, (k + 1) * n);
    (0..n)
        .map(|i| {
            let own = column(1, i);
            reduced.iter().any(|row| row.len() == 1 && row.contains_key(&own))
        })
        .collect()
}

/// Reduced row echelon form, columns ascending.
fn reduce(mut rows: Vec<Row>, columns: usize) -> Vec<Row> {
    let mut done: Vec<(usize, Row)> = Vec::new();
    scale(&mut rows);
    for column in 0..columns {
        let entry = |row: &Row| row.get(&column).map_or(0.0, |e| e.abs());
        let best = (0..rows.len()).max_by(|&a, &b| entry(&rows[a]).total_cmp(&entry(&rows[b])));
        let Some(best) = best.filter(|&b| entry(&rows[b]) > TINY) else { continue };
        let mut pivot = rows.swap_remove(best);
        let lead = pivot[&column];
        pivot.values_mut().for_each(|e| *e /= lead);
        for row in rows.iter_mut().chain(done.iter_mut().map(|d| &mut d.1)) {
            if let Some(factor) = row.remove(&column) {
                for (&other, entry) in pivot.iter().filter(|e| *e.0 != column) {
                    let mine = row.entry(other).or_insert(0.0);
                    let size = mine.abs().max((factor * entry).abs());
                    *mine -= factor * entry;
                    if mine.abs() <= TINY * size {
                        row.remove(&other);
                    }
                }
            }
        }
        rows.retain(|r| !r.is_empty());
        scale(&mut rows);
        done.push((column, pivot));
    }
    done.into_iter().map(|d| d.1).collect()
}

fn scale(rows: &mut [Row]) {
    for row in rows {
        let largest = row.values().fold(0.0f64, |most, e| most.max(e.abs()));
        row.values_mut().for_each(|e| *e /= largest);
        row.retain(|_, e| e.abs() > TINY);
    }
}

/// The inverse of a small matrix; `None` if it is singular.
fn inverse(matrix: &[Vec<f64>]) -> Option<Vec<Vec<f64>>> {
    let n = matrix.len();
    let unit = |i: usize| (0..n).map(move |j| f64::from(u8::from(i == j)));
    let mut rows: Vec<Vec<f64>> =
        matrix.iter().enumerate().map(|(i, r)| r.iter().copied().chain(unit(i)).collect()).collect();
    for c in 0..n {
        let best = (c..n).max_by(|&a, &b| rows[a][c].abs().total_cmp(&rows[b][c].abs()))?;
        rows.swap(c, best);
        let lead = rows[c][c];
        if lead == 0.0 || !lead.is_finite() {
            return None;
        }
        rows[c].iter_mut().for_each(|e| *e /= lead);
        let pivot = rows[c].clone();
        for (r, row) in rows.iter_mut().enumerate() {
            let factor = row[c];
            if r != c && factor != 0.0 {
                row.iter_mut().zip(&pivot).for_each(|(e, p)| *e -= factor * p);
            }
        }
    }
    Some(rows.into_iter().map(|r| r[n..].to_vec()).collect())
}
