//! Integrated signals that repeat what a storage stores: they are read off it and not integrated a second time.

use std::collections::BTreeMap;

use super::builder::{Builder, NamedDraft, SignalDraft};
use super::dimension::Quantity;
use super::structure::Structure;
use super::{ElementId, IntegratedSignal, Kind, Meaning, PortRef, SignalId, Storage, StorageLaw};
use crate::algebra::{Expr, Node, Symbol};
use crate::ids::{Id, Table};

impl Builder<'_, '_> {
    /// Tells the signals that repeat a stored quantity up to a constant, which both start values must tell, from those that
    /// are integrated. The names of the former stay as named expressions. Gives the integrated ones, and what takes the place
    /// of the others; `None` if one has no rate.
    pub fn recognise_storages(
        &mut self,
        structure: &Structure,
        rates: &BTreeMap<Symbol, Expr>,
    ) -> Option<(Table<SignalId, IntegratedSignal>, BTreeMap<Symbol, Expr>)> {
        let mut replaced = BTreeMap::new();
        let mut kept: Vec<IntegratedSignal> = Vec::new();
        let signals = std::mem::take(&mut self.signals).into_values().enumerate();
        for (at, SignalDraft { name, symbol, rate, initial, unit, span }) in signals {
            let written = rate?;
            let rate = self.exprs.substitute(written, rates);
            let own_way = self.reset.contains(&symbol);
            match if own_way { None } else { self.repeated(structure, rate, initial) } {
                Some(value) => {
                    replaced.insert(symbol, value);
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
        Some((kept.into_iter().collect(), replaced))
    }

    /// The stored quantity, and a constant, that an integral of a rate is.
    fn repeated(&mut self, structure: &Structure, rate: Expr, start: Option<Expr>) -> Option<Expr> {
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
                Some(self.exprs.add(&[x, offset]))
            }
            (None, None) if !other => Some(x),
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
