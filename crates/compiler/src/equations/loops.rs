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
use super::rows::Rows;
use crate::algebra::{Expr, Symbol};
use crate::causal_graph::Combination;

/// Loops torn at fewer variables stay written out: their quotients are short.
const FEWEST: usize = 3;

/// Defines the variables of a loop by gains, if it is torn at several.
pub fn by_gains(d: &mut Definitions, own: &[(Symbol, Combination)], rows: &mut Rows) {
    let members: BTreeSet<Symbol> = own.iter().map(|r| r.0).collect();
    let written: BTreeMap<Symbol, Definition> = own.iter().map(|(s, _)| (*s, d.of[s])).collect();
    let mut around: BTreeSet<Symbol> = BTreeSet::new();
    for (symbol, row) in own {
        around.extend(row.0.iter().map(|t| t.0).filter(|s| !members.contains(s) && !rows.is_zero(*s)));
        let definition = as_written(d, *symbol, row, rows);
        d.of.insert(*symbol, definition);
    }
    let symbols: Vec<Symbol> = members.iter().copied().collect();
    let torn = tear(d, &symbols, &BTreeSet::new());
    let gains = match torn.len() >= FEWEST {
        true => {
            let (around, before) = by_inputs(d, around.into_iter().collect(), rows);
            gains(d, &symbols, &torn, around, before)
        }
        false => None,
    };
    let Some(gains) = gains else { return d.of.extend(written) };
    for (symbol, value) in gains {
        d.of.insert(symbol, value);
    }
}

/// The variables around a loop, or what elements give of which they are made where these are fewer, with what they are then.
fn by_inputs(d: &mut Definitions, around: Vec<Symbol>, rows: &mut Rows) -> (Vec<Symbol>, Vec<(Symbol, Expr)>) {
    let inputs: BTreeSet<Symbol> = around.iter().flat_map(|&s| rows.inputs_of(&mut d.x, s)).collect();
    if inputs.len() >= around.len() {
        return (around, Vec::new());
    }
    let mut before = Vec::with_capacity(around.len());
    for &symbol in around.iter().filter(|s| !inputs.contains(s)) {
        let Some(row) = rows.of(&mut d.x, symbol).cloned() else { return (around, Vec::new()) };
        before.push((symbol, row.expr(&mut d.x)));
    }
    (inputs.into_iter().collect(), before)
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

/// Definitions of the variables at which a loop is torn, of their gains, and of names for parts of these. `around`: what the
/// gains are taken by, `before`: what variables that the loop reads are made of these.
fn gains(
    d: &mut Definitions,
    symbols: &[Symbol],
    torn: &[Symbol],
    around: Vec<Symbol>,
    before: Vec<(Symbol, Expr)>,
) -> Option<Vec<(Symbol, Definition)>> {
    let rest: Vec<Symbol> = symbols.iter().copied().filter(|s| !torn.contains(s)).collect();
    let mut body = before;
    body.extend(components(d, &rest).into_iter().map(|c| (c[0], d.of[&c[0]].expr())));
    let unknowns: Vec<Symbol> = torn.iter().chain(&around).copied().collect();
    let forms = LinearForms::new(&mut d.x, &unknowns, &body)?;
    let mut rows = Vec::with_capacity(torn.len());
    for &symbol in torn {
        let residual = match d.of[&symbol] {
            Definition::Explicit(e) => {
                let own = d.x.sym(symbol);
                d.x.sub(own, e)
            }
            Definition::Implicit(e) => e,
        };
        rows.push(forms.of_expr(&mut d.x, residual)?.coefficients);
    }
    let mut found: Vec<(Symbol, Definition)> = forms.named.iter().map(|&(s, e)| (s, Definition::Explicit(e))).collect();
    let mut sums: Vec<Vec<Expr>> = vec![Vec::new(); torn.len()];
    for (k, &by) in around.iter().enumerate() {
        if rows.iter().all(|row| !row.contains_key(&(torn.len() + k))) {
            continue;
        }
        let gains: Vec<Symbol> = torn.iter().map(|&of| d.x.gain(of, by)).collect();
        // In one order, so that their equations have one matrix, row by row.
        gains.iter().for_each(|&gain| _ = d.x.rate(gain));
        let by = d.x.sym(by);
        for (row, (gain, sum)) in rows.iter().zip(gains.iter().zip(&mut sums)) {
            let mut terms: Vec<Expr> = row.get(&(torn.len() + k)).copied().into_iter().collect();
            for (other, &own) in gains.iter().enumerate() {
                if let Some(&coefficient) = row.get(&other) {
                    let own = d.x.sym(own);
                    terms.push(d.x.mul(&[coefficient, own]));
                }
            }
            found.push((*gain, Definition::Implicit(d.x.add(&terms))));
            let own = d.x.sym(*gain);
            sum.push(d.x.mul(&[own, by]));
        }
    }
    for (&symbol, sum) in torn.iter().zip(&sums) {
        found.push((symbol, Definition::Explicit(d.x.add(sum))));
    }
    Some(found)
}
