//! Elements and bonds: as they are drawn, and with the constraints that are built into them.

use std::sync::Arc;

use rustc_hash::FxHashMap;

use super::assemble::cell_of;
use super::builder::Builder;
use super::multibonds::Width;
use super::wire::Wire;
use super::{Bond, BondId, Element, ElementId, Kind, Port, PortRef};
use crate::algebra::Symbol;
use crate::ids::{Id, Map, Table};
use crate::span::Span;

/// The elements and bonds of a graph.
pub(super) struct Structure {
    pub elements: Table<ElementId, Element>,
    pub bonds: Table<BondId, Bond>,
    /// The bond that stands for each drawn junction.
    pub common: Map<ElementId, BondId>,
}

/// Texts that elements of one statement, or of one component, have in common.
#[derive(Default)]
struct Texts<'a> {
    labels: FxHashMap<Span, Arc<str>>,
    components: FxHashMap<&'a str, Arc<str>>,
}

impl<'a> Builder<'a, '_> {
    /// What is drawn, with the laws of its elements.
    pub fn drawn(&self, kinds: Vec<Kind>) -> Structure {
        let mut texts = Texts::default();
        Structure {
            elements: kinds.into_iter().enumerate().map(|(part, kind)| self.element(part, kind, &mut texts)).collect(),
            bonds: self.wiring.wires.iter().enumerate().map(|(wire, w)| self.bond(wire, w)).collect(),
            common: self.common_bonds(),
        }
    }

    fn element(&self, part: usize, kind: Kind, texts: &mut Texts<'a>) -> Element {
        let p = self.part(part);
        let wires = self.wiring.ports[part].iter().flatten().enumerate();
        let mut ports = Vec::with_capacity(self.wiring.ports[part].len());
        ports.extend(wires.map(|(port, (wire, inward))| Port {
            name: p.port_name(port),
            bond: Self::bond_id(*wire),
            inward: *inward,
        }));
        let cell = cell_of(self.flat.names.turn_around(p.here));
        let label = texts.labels.entry(p.ast.span).or_insert_with(|| self.label(part).into()).clone();
        let name = p.name.clone();
        let strand = match p.width {
            Width::Strand(at, of) => Some((at as u32, of as u32)),
            _ => None,
        };
        let component = self.flat.names.scopes[p.here.scope].instance.map_or("", |(component, _)| &component.name.text);
        let component = texts.components.entry(component).or_insert_with(|| component.into()).clone();
        let carries = self.carried.get(&part).copied();
        Element { name, kind, ports, span: p.ast.span, label, cell, component, strand, carries }
    }

    fn bond(&self, wire: usize, w: &Wire) -> Bond {
        Bond {
            from: Self::port_ref(w.from.0, w.from.1),
            to: Self::port_ref(w.to.0, w.to.1),
            name: w.name.clone(),
            effort: self.pairs[wire].effort,
            flow: self.pairs[wire].flow,
            pseudo: self.pseudo[wire],
            span: w.span,
        }
    }
}

impl Structure {
    /// A new element without bonds.
    pub fn add(&mut self, name: String, kind: Kind, span: Span, label: String) -> ElementId {
        self.elements.push(Element {
            name,
            kind,
            ports: Vec::new(),
            span,
            label: label.into(),
            cell: None,
            component: "".into(),
            strand: None,
            carries: None,
        })
    }

    /// A new bond between two elements, at new ports of these names.
    pub fn join(
        &mut self,
        from: (ElementId, &str),
        to: (ElementId, &str),
        (effort, flow): (Symbol, Symbol),
        span: Span,
    ) -> BondId {
        let bond = BondId::new(self.bonds.len());
        let (from, to) = (self.new_port(from, bond, false), self.new_port(to, bond, true));
        self.bonds.push(Bond { from, to, name: String::new(), effort, flow, pseudo: false, span })
    }

    fn new_port(&mut self, (element, name): (ElementId, &str), bond: BondId, inward: bool) -> PortRef {
        let ports = &mut self.elements[element].ports;
        ports.push(Port { name: name.to_string(), bond, inward });
        PortRef { element, port: ports.len() as u32 - 1 }
    }

    /// Puts a new 1-junction into a bond. The bond keeps its `from` or its `to`; a new one, with these variables, leads
    /// to the other.
    pub fn split(
        &mut self,
        bond: BondId,
        name: String,
        keeps_from: bool,
        (effort, flow): (Symbol, Symbol),
        span: Span,
    ) -> ElementId {
        let new = BondId::new(self.bonds.len());
        let junction = self.add(name, Kind::One, span, String::new());
        let at = self.new_port((junction, ""), bond, keeps_from);
        let far = self.new_port((junction, ""), new, !keeps_from);
        let whole = &mut self.bonds[bond];
        let moved = std::mem::replace(if keeps_from { &mut whole.to } else { &mut whole.from }, at);
        let pseudo = whole.pseudo;
        self.elements[moved.element].ports[moved.port as usize].bond = new;
        if let Some(common) = self.common.get_mut(&moved.element).filter(|common| **common == bond) {
            *common = new;
        }
        let (from, to) = if keeps_from { (far, moved) } else { (moved, far) };
        self.bonds.push(Bond { from, to, name: String::new(), effort, flow, pseudo, span });
        junction
    }

    /// The name, or one like it if an element of the same statement has it.
    pub fn unused(&self, name: &str, span: Span) -> String {
        let is_free = |name: &String| !self.elements.values().any(|e| e.span == span && e.name == *name);
        let numbered = (2..).map(|n| format!("{name}_{n}"));
        std::iter::once(name.to_string()).chain(numbered).find(is_free).unwrap_or_default()
    }

    /// The co-energy variable of a storage port: the flow of an `I`, the effort of a `C`.
    pub fn co_energy(&self, port: PortRef) -> Option<Symbol> {
        let element = &self.elements[port.element];
        let bond = &self.bonds[element.ports[port.port as usize].bond];
        match element.kind {
            Kind::Inertance(_) => Some(bond.flow),
            Kind::Compliance(_) => Some(bond.effort),
            _ => None,
        }
    }

    /// Effort and flow of the first bond of a 1-junction.
    pub fn variables_of_one(&self, element: ElementId) -> Option<(Symbol, Symbol)> {
        let first = self.elements[element].ports.first()?.bond;
        let bond = self.bonds.get(first).filter(|_| matches!(self.elements[element].kind, Kind::One))?;
        Some((bond.effort, bond.flow))
    }
}
