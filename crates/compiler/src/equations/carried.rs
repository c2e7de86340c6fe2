//! Efforts in a loop that is closed at the rates.
//!
//! A constraint that acts on the rates of joints leaves the bonds of the loop without the force that closes it: what moves is
//! the same by virtual work, what the joints bear is not. Where sources say what the constraint puts on their bonds
//! (`carries`), each effort has a share by the rows of the junction structure: with the rates as they are, the efforts are
//! linear in those of the sources.

use std::collections::{BTreeMap, BTreeSet};

use super::definitions::Definitions;
use crate::algebra::{Expr, Symbol, ZERO};
use crate::causal_graph::CausalGraph;

/// Defines the share of each effort that has one; the shares, by the variables.
pub fn define(d: &mut Definitions, truth: &CausalGraph) -> BTreeMap<Symbol, Symbol> {
    let ports = &truth.ports;
    let mut shares: BTreeMap<Symbol, Symbol> = BTreeMap::new();
    for state in &ports.ports {
        let element = &truth.graph.elements[state.port.element];
        let Some(carried) = element.carries else { continue };
        // Of constraints that repeat each other one way to share the reaction is told, the one in which these carry nothing.
        let open = d.x.symbols_of(carried).into_iter().filter(|s| d.missing.contains_key(s));
        let open: BTreeMap<Symbol, Expr> = open.map(|s| (s, ZERO)).collect();
        let carried = if open.is_empty() { carried } else { d.x.substitute(carried, &open) };
        if !d.x.is_zero(carried) {
            shares.insert(state.input, share(d, state.input, carried));
        }
    }
    if shares.is_empty() {
        return shares;
    }
    let mut done: BTreeSet<Symbol> = BTreeSet::new();
    for &first in ports.definitions.keys() {
        let mut open = vec![first];
        while let Some((next, definition)) = ports.next_to_resolve(&mut open, |s| done.contains(s)) {
            done.insert(next);
            let mut terms = Vec::new();
            for (read, factor) in &definition.0 {
                if let Some(&own) = shares.get(read) {
                    let own = d.x.sym(own);
                    terms.push(d.x.mul(&[*factor, own]));
                }
            }
            if !terms.is_empty() {
                let sum = d.x.add(&terms);
                shares.insert(next, share(d, next, sum));
            }
        }
    }
    shares
}

/// A variable for the share in another one.
fn share(d: &mut Definitions, of: Symbol, value: Expr) -> Symbol {
    let name = format!("{}.carried", d.x.label(of));
    let share = d.x.fresh(&name, Default::default());
    d.set(share, value);
    share
}
