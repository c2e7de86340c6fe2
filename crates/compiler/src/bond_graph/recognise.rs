//! Integrated signals that repeat what a storage stores: they are read off it and not integrated a second time.

use std::collections::BTreeMap;

use super::builder::{Builder, NamedDraft, SignalDraft};
use super::dimension::Quantity;
use super::structure::Structure;
use super::{
    BondGraph, Constraint, ElementId, IntegratedSignal, Kind, Meaning, PortRef, SignalId, Storage, StorageLaw,
};
use crate::algebra::{Expr, Node, Symbol, ZERO};
use crate::diagnostic::{Diagnostic, codes};
use crate::ids::{Id, Table};
use crate::span::Span;

/// What tells the integrated signals.
pub(super) struct Recognised {
    pub signals: Table<SignalId, IntegratedSignal>,
    /// What takes the place of those that repeat a stored quantity.
    pub repeated: BTreeMap<Symbol, Expr>,
    /// Those among them of which neither has a start value.
    pub unstarted: Vec<Unstarted>,
}

/// A signal that repeats the stored quantity of a storage that pushes nothing where this is 0, neither with a start value.
pub(super) struct Unstarted {
    signal: (Symbol, Span),
    stored: Symbol,
    storage: ElementId,
}

impl Unstarted {
    /// What a constraint brings together at the start is strained or moves then, of which the text does not speak.
    pub fn warning(&self, graph: &BondGraph) -> Option<Diagnostic> {
        let x = &graph.exprs;
        let read = |c: &&Constraint| c.holonomic && x.symbols_of(c.expr).contains(&self.stored);
        let constraint = graph.constraints.iter().find(read)?;
        let (signal, stored) = (x.name(self.signal.0), x.name(self.stored));
        let (storage, relation) = (&graph.elements[self.storage].name, &constraint.name);
        let title = format!("`{storage}` begins with what constraints make of `{signal}`");
        let what = format!("the same as `{stored}`, of which no start value is given");
        let start = if matches!(graph.elements[self.storage].kind, Kind::Compliance(_)) { "q0" } else { "p0" };
        let hint = format!(
            "if `{storage}` holds nothing at the start, give it `{start} = 0`; if it holds nothing where `{signal}` is 0, \
             read `{stored}` in the place of `{signal}`"
        );
        let warning = Diagnostic::warning(codes::I008, title, self.signal.1, what);
        Some(warning.also(constraint.span, format!("`{relation}` puts it somewhere at the start")).hint(hint))
    }
}

impl Builder<'_, '_> {
    /// Tells the signals that repeat a stored quantity up to a constant, which both start values must tell, from those that
    /// are integrated. The names of the former stay as named expressions. `None` if one has no rate.
    pub fn recognise_storages(&mut self, structure: &Structure, rates: &BTreeMap<Symbol, Expr>) -> Option<Recognised> {
        let (mut repeated, mut unstarted) = (BTreeMap::new(), Vec::new());
        let mut kept: Vec<IntegratedSignal> = Vec::new();
        let signals = std::mem::take(&mut self.signals).into_values().enumerate();
        for (at, SignalDraft { name, symbol, rate, initial, unit, span }) in signals {
            let written = rate?;
            let rate = self.exprs.substitute(written, rates);
            let own_way = self.reset.contains(&symbol);
            match if own_way { None } else { self.repeated(structure, rate, initial) } {
                Some((value, port)) => {
                    repeated.insert(symbol, value);
                    if initial.is_none() {
                        unstarted.extend(self.unstarted(structure, (symbol, span), port));
                    }
                    self.roles[symbol.0 as usize] = None;
                    let (doc, quantity) = (String::new(), Quantity::Any);
                    let place = (span, at);
                    self.lets.push(NamedDraft { name, value, unit, unit_is_written: false, quantity, doc, place });
                }
                None => {
                    self.mean(symbol, Meaning::Signal(SignalId::new(kept.len())), self.quantity(symbol));
                    kept.push(IntegratedSignal { name, symbol, rate: written, initial, unit, span });
                }
            }
        }
        Some(Recognised { signals: kept.into_iter().collect(), repeated, unstarted })
    }

    /// A signal that is the stored quantity at this port, if the storage pushes nothing where that is 0.
    fn unstarted(&mut self, structure: &Structure, signal: (Symbol, Span), port: PortRef) -> Option<Unstarted> {
        let (Kind::Compliance(storage) | Kind::Inertance(storage)) = &structure.elements[port.element].kind else {
            return None;
        };
        let stored = storage.stored[port.port as usize];
        let relaxed = match storage.laws[port.port as usize] {
            StorageLaw::Integral(law) => {
                let at_zero = BTreeMap::from_iter(storage.stored.iter().map(|&stored| (stored, ZERO)));
                let pushes = self.exprs.substitute(law, &at_zero);
                self.exprs.is_zero(pushes)
            }
            _ => false,
        };
        relaxed.then_some(Unstarted { signal, stored, storage: port.element })
    }

    /// The stored quantity, and a constant, that an integral of a rate is, with the port at which it is stored.
    fn repeated(&mut self, structure: &Structure, rate: Expr, start: Option<Expr>) -> Option<(Expr, PortRef)> {
        let Node::Symbol(symbol) = self.exprs.node(rate) else { return None };
        let (port, storage) = self.storage_with_rate(structure, *symbol)?;
        let stored = storage.stored[port.port as usize];
        if self.reset.contains(&stored) {
            return None;
        }
        let z = structure.co_energy(port)?;
        let own = storage.initial.iter().find(|i| i.symbol == stored).map(|i| i.value);
        let other = storage.initial.iter().any(|i| i.symbol == z);
        let x = self.exprs.sym(stored);
        match (start, own) {
            (Some(start), Some(own)) => {
                // What cancels has a value wherever the start values have one.
                let offset = self.exprs.sub(start, own);
                let offset = self.exprs.without_settled_terms(offset);
                Some((self.exprs.add(&[x, offset]), port))
            }
            (None, None) if !other => Some((x, port)),
            _ => None,
        }
    }

    /// The storage whose stored quantity has this rate: a C at a bond or 1-junction with this flow, an I at a bond or
    /// 0-junction with this effort.
    fn storage_with_rate<'g>(&self, structure: &'g Structure, rate: Symbol) -> Option<(PortRef, &'g Storage)> {
        let (bond, flow) = match self.meaning(rate)? {
            Meaning::Flow(bond) => (bond, true),
            Meaning::Effort(bond) => (bond, false),
            _ => return None,
        };
        let at = |element: ElementId, port: u32| -> Option<(PortRef, &'g Storage)> {
            let storage = match &structure.elements[element].kind {
                Kind::Compliance(s) if flow => s,
                Kind::Inertance(s) if !flow => s,
                _ => return None,
            };
            let known = matches!(storage.laws[port as usize], StorageLaw::Known { .. });
            (!known).then_some((PortRef { element, port }, storage))
        };
        let b = &structure.bonds[bond];
        let direct = [b.to, b.from].into_iter().find_map(|p| at(p.element, p.port));
        let shares =
            |e: ElementId| matches!((&structure.elements[e].kind, flow), (Kind::One, true) | (Kind::Zero, false));
        let around = || {
            let junctions = [b.to, b.from].into_iter().filter(|p| shares(p.element));
            let bonds = junctions.flat_map(|p| structure.elements[p.element].ports.iter().map(|port| port.bond));
            bonds.filter(|other| other.index() != bond.index()).find_map(|other| {
                let other = &structure.bonds[other];
                [other.to, other.from].into_iter().find_map(|p| at(p.element, p.port))
            })
        };
        direct.or_else(around)
    }
}
