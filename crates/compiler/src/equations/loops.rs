//! Loops of the junction structure that are solved by numbers while running.
//!
//! What a closed chain of bodies makes of its dependent speeds is a solution of linear equations, and so is what it makes of
//! the forces that close it. Written out, each coefficient is a quotient of determinants, and its time derivative several
//! times as long. Where a loop is torn at several variables, what each variable around it does to these stays a *gain*: an
//! unknown of linear equations, one set for each, all with the same matrix. Time derivatives of gains are solutions of the
//! same matrix again.

use std::collections::{BTreeMap, BTreeSet};

use super::blocks::{components, tear};
use super::definitions::{Definition, Definitions};
use super::forms::LinearForms;
use super::points::{POINTS, least_pivot, solved, somewhere};
use super::rows::Rows;
use crate::algebra::{Evaluator, Expr, NumericPoint, Symbol};
use crate::causal_graph::Combination;

/// Loops torn at fewer variables stay written out: their quotients are short.
const FEWEST: usize = 3;
/// A pivot is small below this part of the greatest one.
const REGULAR: f64 = 1e-3;
/// Values of formulas and of solutions are equal to so many digits.
const COMPARED: f64 = 1e-8;

/// Defines the variables of a loop by gains, if it is torn at several, and if their equations are regular at the start:
/// a formula may be so where the equations that it comes from are not.
pub fn by_gains(d: &mut Definitions, own: &[(Symbol, Combination)], rows: &mut Rows, point: &mut NumericPoint) {
    let members: BTreeSet<Symbol> = own.iter().map(|r| r.0).collect();
    let written: BTreeMap<Symbol, Definition> = own.iter().map(|(s, _)| (*s, d.of[s])).collect();
    let mut around: BTreeSet<Symbol> = BTreeSet::new();
    for (symbol, row) in own {
        around.extend(row.0.iter().map(|t| t.0).filter(|s| !members.contains(s) && !rows.is_zero(*s)));
        let definition = as_written(d, *symbol, row, rows);
        d.of.insert(*symbol, definition);
    }
    let symbols: Vec<Symbol> = members.iter().copied().collect();
    // Where terms cancel in a variable the loop is torn: what it depends on is known from its formula, in numbers rounding would
    // be left. Its row stays, since the others need not have a solution wherever all have one.
    let cancelling: BTreeSet<Symbol> = symbols.iter().copied().filter(|&s| rows.cancels(s)).collect();
    let mut torn = tear(d, &symbols, &cancelling);
    torn.extend(cancelling);
    torn.sort_unstable();
    torn.dedup();
    let gains = match torn.len() >= FEWEST {
        true => Beside::of(d, &torn, around.into_iter().collect(), rows).and_then(|beside| {
            let body: Vec<Symbol> = symbols.iter().copied().filter(|s| !torn.contains(s)).collect();
            let rows = linear_rows(d, &body, &torn, &beside)?;
            let same = (0..POINTS).all(|point| agrees(d, &written, &rows, (&torn, &beside.by), point));
            (same && is_regular(d, &rows, point)).then(|| gains(d, &rows, &torn, &beside))
        }),
        false => None,
    };
    let Some(gains) = gains else { return d.of.extend(written) };
    for (symbol, value) in gains {
        d.of.insert(symbol, value);
    }
}

/// What stands beside a loop.
struct Beside {
    /// The variables by which gains are taken.
    by: Vec<Symbol>,
    /// What variables that the loop reads are made of these, where they are others.
    before: Vec<(Symbol, Expr)>,
    /// For each variable at which the loop is torn the ones that it depends on.
    read: Vec<BTreeSet<Symbol>>,
}

impl Beside {
    /// The variables around a loop, or what elements give of which they are made where these are fewer. `None` if something
    /// cancels on the way to the variables at which it is torn: in the formulas it is gone, in numbers rounding would be left.
    fn of(d: &mut Definitions, torn: &[Symbol], around: Vec<Symbol>, rows: &mut Rows) -> Option<Beside> {
        let inputs: BTreeSet<Symbol> = around.iter().flat_map(|&s| rows.inputs_of(&mut d.x, s)).collect();
        let read: Vec<BTreeSet<Symbol>> =
            torn.iter().map(|&s| rows.inputs_of(&mut d.x, s).into_iter().collect()).collect();
        if inputs.len() >= around.len() {
            let all: BTreeSet<Symbol> = around.iter().copied().collect();
            let full = read.iter().all(|read| *read == inputs);
            return full.then(|| Beside { by: around, before: Vec::new(), read: vec![all; torn.len()] });
        }
        if !read.iter().all(|read| read.is_subset(&inputs)) {
            return None;
        }
        let mut before = Vec::with_capacity(around.len());
        for &symbol in around.iter().filter(|s| !inputs.contains(s)) {
            let row = rows.of(&mut d.x, symbol)?.clone();
            before.push((symbol, row.expr(&mut d.x)));
        }
        Some(Beside { by: inputs.into_iter().collect(), before, read })
    }
}

/// A variable by its row; as what makes the row vanish where that may have to be divided by.
fn as_written(d: &mut Definitions, symbol: Symbol, row: &Combination, rows: &Rows) -> Definition {
    let row = Combination(row.0.iter().filter(|t| !rows.is_zero(t.0)).copied().collect());
    let own = row.coefficient(symbol).and_then(|e| d.x.is_number(e).cloned());
    let sum = row.expr(&mut d.x);
    match own.filter(|own| !own.is_zero()) {
        Some(_) => match d.solve_for(sum, symbol) {
            Some(value) => Definition::Explicit(value),
            None => Definition::Implicit(sum),
        },
        None => Definition::Implicit(sum),
    }
}

/// Coefficients of the variables at which a loop is torn, then of those beside it, by their numbers.
type Row = BTreeMap<usize, Expr>;

/// The equations of the variables at which a loop is torn. `body`: the other variables of the loop.
fn linear_rows(d: &mut Definitions, body: &[Symbol], torn: &[Symbol], beside: &Beside) -> Option<Vec<Row>> {
    let mut values = beside.before.clone();
    values.extend(components(d, body).into_iter().map(|c| (c[0], d.of[&c[0]].expr())));
    let unknowns: Vec<Symbol> = torn.iter().chain(&beside.by).copied().collect();
    let forms = LinearForms::of_wholes(&mut d.x, &unknowns, &values)?;
    let mut rows = Vec::with_capacity(torn.len());
    for &symbol in torn {
        let residual = match d.of[&symbol] {
            Definition::Explicit(e) => {
                let own = d.x.sym(symbol);
                d.x.sub(own, e)
            }
            Definition::Implicit(e) => e,
        };
        let form = forms.of_expr(&mut d.x, residual)?;
        // What reads none of these is no row of the junction structure.
        if !d.x.is_zero(form.rest) {
            return None;
        }
        rows.push(form.coefficients);
    }
    Some(rows)
}

/// Whether these equations give the values of the formulas, where every other variable has a value of its own.
fn agrees(
    d: &Definitions,
    written: &BTreeMap<Symbol, Definition>,
    rows: &[Row],
    (torn, by): (&[Symbol], &[Symbol]),
    point: usize,
) -> bool {
    let formula = |s: Symbol| match written.get(&s).or_else(|| d.of.get(&s)) {
        Some(Definition::Explicit(e)) => Some(*e),
        _ => None,
    };
    let mut known: BTreeMap<Symbol, f64> = BTreeMap::new();
    let mut open: Vec<Symbol> = torn.iter().chain(by).copied().collect();
    while let Some(&symbol) = open.last() {
        let value = if known.contains_key(&symbol) { None } else { formula(symbol) };
        let missing =
            value.map(|e| d.x.symbols_of(e).into_iter().filter(|s| !known.contains_key(s)).collect::<Vec<_>>());
        match (value, missing) {
            (Some(_), Some(missing)) if !missing.is_empty() => {
                open.extend(missing);
                continue;
            }
            (Some(e), _) => {
                let mut at = |s: Symbol| known[&s];
                let value = Evaluator::new(&d.x, &mut at).value(e);
                known.insert(symbol, value);
            }
            _ => _ = known.entry(symbol).or_insert_with(|| somewhere(point, symbol)),
        }
        open.pop();
    }
    let mut at = |s: Symbol| known.get(&s).copied().unwrap_or_else(|| somewhere(point, s));
    let mut values = Evaluator::new(&d.x, &mut at);
    let (mut matrix, mut right) = (Vec::with_capacity(torn.len() * torn.len()), Vec::with_capacity(torn.len()));
    for row in rows {
        matrix.extend((0..torn.len()).map(|k| row.get(&k).map_or(0.0, |&e| values.value(e))));
        let terms = by.iter().enumerate().map(|(k, s)| (row.get(&(torn.len() + k)), known[s]));
        right.push(-terms.map(|(e, value)| e.map_or(0.0, |&e| values.value(e) * value)).sum::<f64>());
    }
    let found = solved(torn.len(), matrix, right);
    let close = |a: f64, b: f64| (a - b).abs() <= COMPARED * (a.abs() + b.abs() + 1.0);
    torn.iter().zip(found).all(|(s, value)| close(known[s], value))
}

/// Whether no pivot of these equations is small at the point.
fn is_regular(d: &Definitions, rows: &[Row], point: &mut NumericPoint) -> bool {
    let n = rows.len();
    let entry = |row: &Row, k: usize, point: &mut NumericPoint| row.get(&k).map_or(0.0, |&e| point.value(&d.x, e));
    let matrix = rows.iter().flat_map(|row| (0..n).map(|k| (row, k)).collect::<Vec<_>>());
    let matrix: Vec<f64> = matrix.map(|(row, k)| entry(row, k, point)).collect();
    least_pivot(n, matrix) > REGULAR
}

/// Definitions of the variables at which a loop is torn, and of their gains.
fn gains(d: &mut Definitions, rows: &[Row], torn: &[Symbol], beside: &Beside) -> Vec<(Symbol, Definition)> {
    let mut found = Vec::with_capacity(torn.len() * (beside.by.len() + 1));
    let mut sums: Vec<Vec<Expr>> = vec![Vec::new(); torn.len()];
    for (k, &by) in beside.by.iter().enumerate() {
        let place = torn.len() + k;
        if rows.iter().all(|row| !row.contains_key(&place)) {
            continue;
        }
        let gains: Vec<Symbol> = torn.iter().map(|&of| d.x.loop_gain(of, by)).collect();
        // In one order, so that their equations have one matrix, row by row.
        gains.iter().for_each(|&gain| _ = d.x.rate(gain));
        let values: Vec<Expr> = gains.iter().map(|&gain| d.x.sym(gain)).collect();
        for (row, &gain) in rows.iter().zip(&gains) {
            let mut terms: Vec<Expr> = row.get(&place).copied().into_iter().collect();
            for (other, &value) in values.iter().enumerate() {
                terms.extend(row.get(&other).map(|&coefficient| d.x.mul(&[coefficient, value])));
            }
            found.push((gain, Definition::Implicit(d.x.add(&terms))));
        }
        let own = d.x.sym(by);
        for ((sum, &value), read) in sums.iter_mut().zip(&values).zip(&beside.read) {
            if read.contains(&by) {
                sum.push(d.x.mul(&[value, own]));
            }
        }
    }
    for (&symbol, sum) in torn.iter().zip(&sums) {
        found.push((symbol, Definition::Explicit(d.x.add(sum))));
    }
    found
}
