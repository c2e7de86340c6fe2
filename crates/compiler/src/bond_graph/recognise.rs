//! Integrated signals that repeat what a storage stores: they are read off it and not integrated a second time.

use std::collections::BTreeMap;

use super::builder::Builder;
use super::{BondGraph, ElementId, IntegratedSignal, Kind, Meaning, Named, PortRef, SignalId, Storage, StorageLaw};
use crate::algebra::{Expr, Node, Symbol};
use crate::ids::{Id, Table};

impl Builder<'_, '_> {
    /// Takes the signals out of the graph that repeat a stored quantity up to a constant, which both start values must
    /// tell. Gives what takes their place; their names stay as named expressions.
    pub fn recognise_storages(
        &mut self,
        graph: &mut BondGraph,
        rates: &BTreeMap<Symbol, Expr>,
    ) -> BTreeMap<Symbol, Expr> {
        let mut replaced = BTreeMap::new();
        let mut kept: Table<SignalId, IntegratedSignal> = Table::new();
        for (_, signal) in std::mem::take(&mut graph.signals).iter() {
            let rate = self.exprs.substitute(signal.rate, rates);
            match self.repeated(graph, rate, signal.initial) {
                Some(value) => {
                    replaced.insert(signal.symbol, value);
                    self.meanings[signal.symbol.0 as usize] = None;
                    let (name, unit, span) = (signal.name.clone(), signal.unit.clone(), signal.span);
                    let doc = String::new();
                    graph.lets.push(Named { name, value, unit, unit_is_written: false, doc, span });
                }
                None => {
                    let id = kept.push(signal.clone());
                    let quantity = self.quantity(signal.symbol);
                    self.mean(signal.symbol, Meaning::Signal(id), quantity);
                }
            }
        }
        graph.signals = kept;
        graph.lets.sort_by_key(|l| l.span);
        replaced
    }

    /// The stored quantity, and a constant, that an integral of a rate is.
    fn repeated(&mut self, graph: &BondGraph, rate: Expr, start: Option<Expr>) -> Option<Expr> {
        let Node::Symbol(symbol) = self.exprs.node(rate) else { return None };
        let (port, storage) = self.storage_with_rate(graph, *symbol)?;
        let stored = storage.stored[port.port as usize];
        let z = graph.storage_symbols(port)?.0;
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
    fn storage_with_rate<'g>(&self, graph: &'g BondGraph, rate: Symbol) -> Option<(PortRef, &'g Storage)> {
        let (bond, flow) = match self.meaning(rate)? {
            Meaning::Flow(bond) => (bond, true),
            Meaning::Effort(bond) => (bond, false),
            _ => return None,
        };
        let at = |element: ElementId, port: u32| -> Option<(PortRef, &'g Storage)> {
            let storage = match &graph.elements[element].kind {
                Kind::Compliance(s) if flow => s,
                Kind::Inertance(s) if !flow => s,
                _ => return None,
            };
            let known = matches!(storage.laws[port as usize], StorageLaw::Known { .. });
            (!known).then_some((PortRef { element, port }, storage))
        };
        let b = &graph.bonds[bond];
        let direct = [b.to, b.from].into_iter().find_map(|p| at(p.element, p.port));
        let shares = |e: ElementId| matches!((&graph.elements[e].kind, flow), (Kind::One, true) | (Kind::Zero, false));
        let around = || {
            let junctions = [b.to, b.from].into_iter().filter(|p| shares(p.element));
            let bonds = junctions.flat_map(|p| graph.elements[p.element].ports.iter().map(|port| port.bond));
            bonds.filter(|other| other.index() != bond.index()).find_map(|other| {
                let other = &graph.bonds[other];
                [other.to, other.from].into_iter().find_map(|p| at(p.element, p.port))
            })
        };
        direct.or_else(around)
    }
}
