//! Conserved quantities: constant combinations of stored quantities that nothing can change. Source: `method.md`, 5.7.

use std::collections::BTreeMap;

use super::Conserved;
use super::minimal::Assembled;
use super::rows::without_own;
use crate::algebra::{Expr, SparseRow, Symbol};
use crate::causal_graph::{Combination, Role, circuits};

/// A balance, written out: `quantity' = row`.
struct BalanceRow {
    /// The state that stands for it.
    state: Symbol,
    quantity: Expr,
    /// Its rate, over inputs of the junction structure other than rates of dependent storages.
    row: Combination,
}

/// Of more balances than this those keep their states by which the others are shortest: in the order of the model the length
/// of a rope may be a sum along the whole machine.
const MANY: usize = 32;

/// Finds them, and makes each a constant in place of one state, at most so many.
///
/// With `exchanged`, as independent variables may change places while running, storages that follow others by ratios that
/// vary keep their states: which constants can stand for a state would change with them.
pub fn eliminate(assembled: &mut Assembled, most: usize, exchanged: bool) -> Vec<Conserved> {
    let balances = entangled(assembled, exchanged);
    let rows = constant_rows(assembled, &balances);
    let columns: Vec<Vec<usize>> = rows.iter().map(|row| row.iter().map(|e| e.0).collect()).collect();
    let left = without_own(&columns);
    let core: Vec<usize> = (0..rows.len()).filter(|&r| left[r]).collect();
    let mut found = Vec::new();
    for (own, vector) in null_vectors(assembled, &rows, &core) {
        if found.len() == most {
            break;
        }
        found.extend(replace(assembled, &balances, (own, &vector), found.len() + 1));
    }
    found
}

/// The balances that may share all that changes them.
fn entangled(assembled: &mut Assembled, exchanged: bool) -> Vec<BalanceRow> {
    let mut balances = std::mem::take(&mut assembled.balances);
    if exchanged {
        balances.retain(|balance| assembled.follows_constantly(balance));
    }
    let rates: Vec<[Symbol; 1]> = balances.iter().map(|balance| [balance.rate]).collect();
    let entangled = assembled.rows.entangled(&rates, |input| input.role != Role::Dependent);
    let open = balances.into_iter().zip(entangled).filter(|b| b.1);
    let open = open.filter_map(|(balance, _)| {
        let (quantity, row) = assembled.written_out(&balance)?;
        Some(BalanceRow { state: balance.state, quantity, row })
    });
    open.collect()
}

/// Rows over columns that are an input times its non-constant factor, with constant coefficients.
fn constant_rows(assembled: &mut Assembled, balances: &[BalanceRow]) -> Vec<Vec<(usize, Expr)>> {
    let mut columns: BTreeMap<(Symbol, Option<Expr>), usize> = BTreeMap::new();
    let one = assembled.d.x.int(1);
    let mut rows = Vec::with_capacity(balances.len());
    for balance in balances {
        let mut row = Vec::with_capacity(balance.row.0.len());
        for &(symbol, coefficient) in &balance.row.0 {
            let constant = assembled.d.is_constant(coefficient);
            let next = columns.len();
            let key = (symbol, (!constant).then_some(coefficient));
            let column = *columns.entry(key).or_insert(next);
            row.push((column, if constant { coefficient } else { one }));
        }
        row.sort_by_key(|e| e.0);
        rows.push(row);
    }
    rows
}

/// A combination of balances that vanishes: the one that follows from the others, and all, by their numbers, with factors.
type NullVector = (usize, Vec<(usize, Expr)>);

/// Combinations of rows that vanish.
fn null_vectors(assembled: &mut Assembled, rows: &[Vec<(usize, Expr)>], core: &[usize]) -> Vec<NullVector> {
    let mut transposed: BTreeMap<usize, Vec<(usize, Expr)>> = BTreeMap::new();
    for (k, &row) in core.iter().enumerate() {
        for &(column, e) in &rows[row] {
            transposed.entry(column).or_default().push((k, e));
        }
    }
    let x = &mut assembled.d.x;
    let transposed = transposed.into_values().map(SparseRow).collect();
    let classes = match core.len() > MANY {
        true => vec![(0..core.len()).collect()],
        false => (0..core.len()).map(|k| vec![k]).collect::<Vec<_>>(),
    };
    let reduced = circuits(x, transposed, &classes);
    let one = x.int(1);
    let mut pivot = vec![false; core.len()];
    let mut vectors: BTreeMap<usize, Vec<(usize, Expr)>> = BTreeMap::new();
    for (leading, row) in &reduced {
        pivot[*leading] = true;
        for &(k, e) in row.0.iter().filter(|t| t.0 != *leading) {
            let factor = x.neg(e);
            vectors.entry(k).or_default().push((core[*leading], factor));
        }
    }
    for k in (0..core.len()).filter(|&k| !pivot[k]) {
        vectors.entry(k).or_default().push((core[k], one));
    }
    for vector in vectors.values_mut() {
        vector.sort_by_key(|t| t.0);
    }
    vectors.into_iter().map(|(k, vector)| (core[k], vector)).collect()
}

/// Replaces one state of a conserved combination by the constant, that of the balance which follows from the others if it
/// can be solved for. `None` if no state can.
fn replace(
    assembled: &mut Assembled,
    balances: &[BalanceRow],
    (own, vector): (usize, &[(usize, Expr)]),
    number: usize,
) -> Option<Conserved> {
    let mut terms = Vec::new();
    for &(b, factor) in vector {
        terms.push(assembled.d.x.mul(&[factor, balances[b].quantity]));
    }
    let value = assembled.d.x.add(&terms);
    let symbol = assembled.d.x.fresh(&format!("K{number}"), Default::default());
    let constant = assembled.d.x.sym(symbol);
    let residual = assembled.d.x.sub(value, constant);
    for b in std::iter::once(own).chain(vector.iter().rev().map(|t| t.0)) {
        let state = balances[b].state;
        if let Some(solution) = assembled.d.solve_for(residual, state) {
            let chosen = assembled.states.iter().position(|s| s.symbol == state)?;
            let replaced = assembled.states.remove(chosen).tracked;
            assembled.d.states.remove(&state);
            assembled.d.constants.insert(symbol);
            assembled.d.set(state, solution);
            let name = assembled.d.x.name(symbol).to_string();
            return Some(Conserved { symbol, name, value, replaced });
        }
    }
    None
}
