//! An estimate of the start point before there are equations: the size of pivots there decides which variables stay
//! independent.

use std::collections::BTreeSet;

use crate::algebra::{EvaluationOrder, Expr, Exprs, Node, NumericPoint, Symbol, ZERO};
use crate::bond_graph::{BondGraph, Guess, Kind, Meaning, Storage, StorageLaw};
use crate::ids::Map;

/// Values of all variables of a graph at the start: given positions, and for the others a solution of the constraints.
/// Efforts and flows without a start value are taken as 1: they are not known yet, and no choice may depend on their being 0.
pub(crate) fn start_point(x: &Exprs, graph: &BondGraph) -> NumericPoint {
    NumericPoint::new(start_values(x, graph))
}

/// The same by symbol.
pub(super) fn start_values(x: &Exprs, graph: &BondGraph) -> Map<Symbol, f64> {
    let mut values: Map<Symbol, f64> = Map::with_capacity(x.symbol_count());
    for parameter in graph.parameters.values() {
        values.insert(parameter.symbol, x.given_value(parameter.value).unwrap_or(1.0));
    }
    let mut open = BTreeSet::new();
    for (&symbol, variable) in &graph.variables {
        match variable.meaning {
            Meaning::Signal(_) | Meaning::Stored(_) => {
                open.insert(symbol);
                values.insert(symbol, 0.0);
            }
            Meaning::Time => _ = values.insert(symbol, 0.0),
            _ => {}
        }
    }
    let read = |values: &Map<Symbol, f64>, e: Expr| x.eval(e, &mut |s| values.get(&s).copied().unwrap_or(1.0));
    for input in graph.inputs.values() {
        values.insert(input.symbol, read(&values, input.default));
    }
    for (symbol, e) in given(graph) {
        values.insert(symbol, read(&values, e));
        open.remove(&symbol);
    }
    // What no constraint reads begins where it is guessed.
    values.extend(guessed(x, graph, &values).into_iter().filter(|(s, _)| open.contains(s)));
    match &graph.point {
        Some(point) => values.extend(point.iter().map(|(&s, &v)| (s, v))),
        None => close(x, graph, &open, &mut values),
    }
    for held in graph.held.values() {
        values.insert(held.symbol, read(&values, held.source));
    }
    for (symbol, displacement) in known_displacements(graph) {
        values.insert(symbol, read(&values, displacement));
    }
    values
}

/// What is guessed of single variables.
fn guessed(x: &Exprs, graph: &BondGraph, values: &Map<Symbol, f64>) -> Vec<(Symbol, f64)> {
    let read = |e: Expr| x.eval(e, &mut |s| values.get(&s).copied().unwrap_or(1.0));
    let guessed = |g: &Guess| match x.node(g.what) {
        &Node::Symbol(symbol) => Some((symbol, read(g.value))),
        _ => None,
    };
    graph.guesses.iter().filter_map(guessed).collect()
}

/// Start values as they stand in the model.
fn given(graph: &BondGraph) -> Vec<(Symbol, Expr)> {
    let signals = graph.signals.values().filter_map(|s| Some((s.symbol, s.initial?)));
    let stored = storages(graph).flat_map(|storage| storage.initial.iter().map(|i| (i.symbol, i.value)));
    signals.chain(stored).collect()
}

/// All storages of a graph.
pub(crate) fn storages(graph: &BondGraph) -> impl Iterator<Item = &Storage> {
    graph.elements.values().filter_map(|element| match &element.kind {
        Kind::Inertance(storage) | Kind::Compliance(storage) => Some(&**storage),
        _ => None,
    })
}

fn known_displacements(graph: &BondGraph) -> Vec<(Symbol, Expr)> {
    let laws = storages(graph).flat_map(|s| s.laws.iter().zip(&s.stored));
    laws.filter_map(|(law, &stored)| match law {
        StorageLaw::Known { displacement, .. } => Some((stored, *displacement)),
        _ => None,
    })
    .collect()
}

/// First guesses for open positions, tried in turn: a constraint may have a vanishing gradient at one of them.
const BEGINNINGS: [f64; 3] = [0.0, 1e-3, 1.0];
const ITERATIONS: usize = 60;

/// Finds the open positions that constraints on displacements read.
fn close(x: &Exprs, graph: &BondGraph, open: &BTreeSet<Symbol>, values: &mut Map<Symbol, f64>) {
    let constraints: Vec<Expr> = graph.constraints.iter().filter(|c| c.holonomic).map(|c| c.expr).collect();
    let read: BTreeSet<Symbol> =
        constraints.iter().flat_map(|&e| x.symbols_of(e)).filter(|s| open.contains(s)).collect();
    if read.is_empty() {
        return;
    }
    let unknowns: Vec<Symbol> = read.into_iter().collect();
    let mut x = x.clone();
    let slopes = slopes(&mut x, &constraints, &unknowns);
    let constraints = Constraints::new(&x, &constraints, &slopes, &unknowns);
    let mut best: Option<(f64, Vec<f64>)> = None;
    let guessed = guessed(&x, graph, values);
    for beginning in BEGINNINGS {
        unknowns.iter().for_each(|&s| _ = values.insert(s, beginning));
        values.extend(guessed.iter().filter(|(s, _)| unknowns.contains(s)).copied());
        let missed = approach(&constraints, values);
        if best.as_ref().is_none_or(|(known, _)| missed < *known) {
            best = Some((missed, unknowns.iter().map(|s| values[s]).collect()));
        }
        if missed < 1e-9 {
            break;
        }
    }
    if let Some((_, found)) = best {
        unknowns.iter().zip(found).for_each(|(&s, v)| _ = values.insert(s, v));
    }
}

/// Derivatives of constraints by unknowns, each with its row and column, those that vanish left out.
fn slopes(x: &mut Exprs, constraints: &[Expr], unknowns: &[Symbol]) -> Vec<(usize, usize, Expr)> {
    let mut slopes = Vec::new();
    for (i, &constraint) in constraints.iter().enumerate() {
        let read = x.symbols_of(constraint);
        for (j, &unknown) in unknowns.iter().enumerate().filter(|u| read.contains(u.1)) {
            let slope = x.derivative(constraint, unknown);
            slopes.extend((slope != ZERO).then_some((i, j, slope)));
        }
    }
    slopes
}

/// Constraints on displacements, and what is needed to come nearer to them.
struct Constraints<'a> {
    unknowns: &'a [Symbol],
    residuals: EvaluationOrder<'a>,
    slopes: EvaluationOrder<'a>,
    /// Row and column of each slope.
    places: Vec<(usize, usize)>,
    rows: usize,
}

impl<'a> Constraints<'a> {
    fn new(x: &'a Exprs, constraints: &[Expr], slopes: &[(usize, usize, Expr)], unknowns: &'a [Symbol]) -> Self {
        let derivatives: Vec<Expr> = slopes.iter().map(|slope| slope.2).collect();
        Constraints {
            unknowns,
            residuals: EvaluationOrder::new(x, constraints),
            slopes: EvaluationOrder::new(x, &derivatives),
            places: slopes.iter().map(|slope| (slope.0, slope.1)).collect(),
            rows: constraints.len(),
        }
    }

    fn residuals(&self, values: &Map<Symbol, f64>) -> Vec<f64> {
        self.residuals.values(&mut |s| values.get(&s).copied().unwrap_or(1.0))
    }

    fn jacobian(&self, values: &Map<Symbol, f64>) -> Vec<Vec<f64>> {
        let mut jacobian = vec![vec![0.0; self.unknowns.len()]; self.rows];
        let slopes = self.slopes.values(&mut |s| values.get(&s).copied().unwrap_or(1.0));
        self.places.iter().zip(slopes).for_each(|(&(i, j), slope)| jacobian[i][j] = slope);
        jacobian
    }
}

/// Damped minimum-norm steps towards the constraints; the residual that remains.
fn approach(constraints: &Constraints, values: &mut Map<Symbol, f64>) -> f64 {
    let mut residual = constraints.residuals(values);
    for _ in 0..ITERATIONS {
        let Some(step) = least_step(&constraints.jacobian(values), &residual) else { break };
        let from: Vec<f64> = constraints.unknowns.iter().map(|s| values[s]).collect();
        let mut fraction = 1.0;
        loop {
            let moved = from.iter().zip(&step).map(|(from, step)| from - fraction * step);
            constraints.unknowns.iter().zip(moved).for_each(|(&s, value)| _ = values.insert(s, value));
            let left = constraints.residuals(values);
            if size(&left) < size(&residual) {
                residual = left;
                break;
            }
            fraction *= 0.5;
            if fraction < 1e-6 {
                constraints.unknowns.iter().zip(from).for_each(|(&s, value)| _ = values.insert(s, value));
                return size(&residual);
            }
        }
    }
    size(&residual)
}

fn size(residual: &[f64]) -> f64 {
    let sum: f64 = residual.iter().map(|r| r * r).sum();
    if sum.is_nan() { f64::INFINITY } else { sum.sqrt() }
}

/// The minimum-norm solution of `jacobian · step = residual`: `Jᵀ (J Jᵀ)⁻¹ residual`, regularised by a small multiple of the
/// unit matrix where equations are redundant.
pub(super) fn least_step(jacobian: &[Vec<f64>], residual: &[f64]) -> Option<Vec<f64>> {
    let n = jacobian.len();
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut gram: Vec<Vec<f64>> =
        (0..n).map(|i| (0..n).map(|j| product(&jacobian[i], &jacobian[j])).collect()).collect();
    let most = (0..n).fold(0.0f64, |most, i| most.max(gram[i][i]));
    (0..n).for_each(|i| gram[i][i] += 1e-13 * most);
    let weights = solve(gram, residual.to_vec())?;
    let columns = jacobian.first().map_or(0, Vec::len);
    Some((0..columns).map(|j| (0..n).map(|i| jacobian[i][j] * weights[i]).sum()).collect())
}

/// Gaussian elimination with partial pivoting; `None` if the matrix is singular.
fn solve(mut a: Vec<Vec<f64>>, mut b: Vec<f64>) -> Option<Vec<f64>> {
    let n = b.len();
    for k in 0..n {
        let pivot = (k..n).max_by(|&i, &j| a[i][k].abs().total_cmp(&a[j][k].abs()))?;
        if a[pivot][k] == 0.0 || !a[pivot][k].is_finite() {
            return None;
        }
        a.swap(k, pivot);
        b.swap(k, pivot);
        for i in k + 1..n {
            let factor = a[i][k] / a[k][k];
            let (above, below) = a.split_at_mut(i);
            below[0].iter_mut().zip(&above[k]).skip(k).for_each(|(a, p)| *a -= factor * p);
            b[i] -= factor * b[k];
        }
    }
    for k in (0..n).rev() {
        let rest: f64 = (k + 1..n).map(|j| a[k][j] * b[j]).sum();
        b[k] = (b[k] - rest) / a[k][k];
    }
    Some(b)
}
