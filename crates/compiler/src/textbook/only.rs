//! A part of a page: the equations of what is asked for.

use std::collections::BTreeSet;

use super::display::{Dependent, Shown, ShownDefinition};
use crate::algebra::{Expr, Symbol};
use crate::equations::Definition;

/// The equations that tell these variables, of states their rates, and what stands behind the names in them. A variable that the page
/// has put into other equations gets the definition of its own, with those that this reads, down to the states.
pub fn only(mut shown: Shown, asked: &[Symbol]) -> Shown {
    let x = &shown.equations.graph.exprs;
    let of_state = shown.equations.states.iter().filter(|state| asked.contains(&state.symbol)).map(|state| state.rate);
    let wanted: BTreeSet<Symbol> = asked.iter().copied().chain(of_state).collect();
    let reads = |e: Expr| x.symbols_of(e);
    let tells = |left: Expr| reads(left).iter().any(|s| wanted.contains(s));
    let mut told: BTreeSet<Symbol> = shown.display.iter().flat_map(|row| reads(row.left)).collect();
    told.extend(shown.definitions.iter().map(|d| d.symbol).chain(shown.dependent.iter().map(|d| d.variable)));
    told.extend(shown.equations.states.iter().map(|state| state.symbol));
    shown.display.retain(|row| tells(row.left));
    shown.dependent.retain(|row| wanted.contains(&row.variable));
    let dependent = shown.dependent.iter().map(|&Dependent { variable: symbol, value }| definition(symbol, value));
    let put_in: Vec<Symbol> = wanted.iter().copied().filter(|s| !told.contains(s)).collect();
    let added: Vec<ShownDefinition> = definitions_of(&shown, &put_in, &told).into_iter().chain(dependent).collect();
    let mut read: BTreeSet<Symbol> = wanted.clone();
    let sides = shown.display.iter().flat_map(|row| [row.left, row.right]);
    read.extend(sides.chain(added.iter().map(|d| d.value)).flat_map(reads));
    // What is defined first is read by what comes later.
    for definition in shown.definitions.iter().rev() {
        if read.contains(&definition.symbol) {
            read.extend(reads(definition.value));
        }
    }
    let meant = |symbol: &Symbol| read.contains(symbol);
    shown.sources.retain(|(symbol, _)| meant(symbol));
    shown.equations.meanings.retain(|(symbol, _)| meant(symbol));
    shown.equations.conserved.retain(|c| meant(&c.symbol));
    shown.definitions.retain(|d| read.contains(&d.symbol));
    shown.definitions.iter_mut().for_each(|d| d.of_dependent = false);
    shown.definitions.extend(added);
    shown.with_vectors()
}

fn definition(symbol: Symbol, value: Expr) -> ShownDefinition {
    ShownDefinition { symbol, value, closed: value, of_dependent: false }
}

/// The definitions of variables, each behind those that it reads.
fn definitions_of(shown: &Shown, symbols: &[Symbol], told: &BTreeSet<Symbol>) -> Vec<ShownDefinition> {
    let x = &shown.equations.graph.exprs;
    let value = |s: Symbol| match shown.equations.definitions.get(&s) {
        Some(Definition::Explicit(value)) if !told.contains(&s) => Some(*value),
        _ => None,
    };
    let (mut found, mut done) = (Vec::new(), BTreeSet::new());
    let mut open: Vec<(Symbol, bool)> = symbols.iter().rev().map(|&s| (s, false)).collect();
    while let Some((symbol, ready)) = open.pop() {
        let Some(value) = value(symbol) else { continue };
        if ready {
            found.push(definition(symbol, value));
        } else if done.insert(symbol) {
            open.push((symbol, true));
            open.extend(x.symbols_of(value).into_iter().map(|s| (s, false)));
        }
    }
    found
}
