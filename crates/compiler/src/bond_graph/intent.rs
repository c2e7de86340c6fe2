//! What the modeller asks of causality: `prefer`, `causality`, `stroke`.

use std::collections::BTreeMap;

use super::builder::Builder;
use super::families::spelled;
use super::flatten::Word;
use super::scope::{Here, Node, no_indices};
use super::uses::Used;
use super::{ForcedCausality, ForcedStroke, PortCausality, PortRef, Preference};
use crate::algebra::Symbol;
use crate::ast::{self, Causality, StrokeBond};
use crate::diagnostic::{Diagnostic, codes};
use crate::span::Span;

impl<'a> Builder<'a, '_> {
    /// The entries of all `prefer` statements.
    pub fn preferences(&mut self) -> Vec<Preference> {
        let flat = self.flat;
        let mut found = Vec::new();
        for &(here, path) in &flat.prefer {
            let before = self.faults.len();
            if let Some(symbol) = self.preferred(here, path) {
                let name = format!("{}{}", flat.names.scopes[here.scope].prefix, self.written(here, path));
                found.push(Preference { name, symbol, span: path.span });
            }
            self.met_in(here, before);
        }
        found
    }

    /// A dotted name as it stands in results.
    pub fn written(&mut self, here: Here, path: &'a ast::Path) -> String {
        let mut parts: Vec<String> = Vec::with_capacity(path.parts.len());
        for part in &path.parts {
            let indices = self.repeats.indices(&self.flat.names, here, &part.indices).unwrap_or_default();
            parts.push(spelled(&part.name.text, &indices));
        }
        parts.join(".")
    }

    /// A dotted name as a node and the names that follow it.
    fn node_of(&mut self, here: Here, path: &'a ast::Path) -> Option<(Node, Vec<&'a ast::Name>)> {
        let uses = &mut self.uses;
        let visit = &mut |node, span| uses.add(Used::Node(node), span);
        match self.flat.names.walk(&mut self.repeats, here, path, visit) {
            Ok((node, used)) => {
                let rest = &path.parts[used..];
                if let Some((part, index)) = rest.iter().find_map(|p| Some((p, p.indices.first()?))) {
                    self.fault(no_indices(&part.name, index.span));
                    return None;
                }
                Some((node, rest.iter().map(|p| &p.name).collect()))
            }
            Err(fault) => {
                self.fault(*fault);
                None
            }
        }
    }

    fn preferred(&mut self, here: Here, path: &'a ast::Path) -> Option<Symbol> {
        let (node, rest) = self.node_of(here, path)?;
        let rest: Vec<&str> = rest.iter().map(|n| n.text.as_str()).collect();
        let wire = match (node, rest.as_slice()) {
            (Node::Broken, _) => return None,
            (Node::Bond(drawn), ["e" | "f"]) => self.wiring.of_drawn[drawn],
            (Node::Joint(joint), ["e" | "f"]) => self.wiring.of_joint[joint],
            (Node::Part(part), rest) => return self.preferred_part(part, rest, path.span),
            _ => {
                self.not_preferable(path.span, "this cannot be independent");
                return None;
            }
        }?;
        let pair = &self.pairs[wire];
        Some(if rest[0] == "e" { pair.effort } else { pair.flow })
    }

    fn not_preferable(&mut self, span: Span, why: &str) {
        self.fault(
            Diagnostic::error(codes::B010, "no variable to prefer", span, why)
                .hint("name a storage, the flow of a 1-junction or the effort of a 0-junction: `prefer spring, w.f`"),
        );
    }

    fn preferred_part(&mut self, part: usize, rest: &[&str], span: Span) -> Option<Symbol> {
        let p = self.part(part);
        let (port, variable) = match rest {
            [] => (None, None),
            [port] if self.port_named(part, port).is_some() => (self.port_named(part, port), None),
            [variable] => (None, Some(*variable)),
            [port, variable] => (self.port_named(part, port), Some(*variable)),
            _ => return None,
        };
        let slot = port.unwrap_or(0);
        let several = p.word.is_law() && p.ports.len() > 1 || p.word.is_two_port();
        if several && port.is_none() {
            self.not_preferable(span, "which port?");
            return None;
        }
        let own = match (p.word, variable) {
            (Word::I, None | Some("p" | "f")) | (Word::One, None | Some("f")) => "f",
            (Word::C, None | Some("q" | "e")) | (Word::Zero, None | Some("e")) => "e",
            (w, Some(v @ ("e" | "f"))) if !w.is_junction() => v,
            _ => {
                self.not_preferable(span, "not a variable that can be independent");
                return None;
            }
        };
        if p.word.is_junction() {
            return self.common_variable(part, own == "e");
        }
        let wire = self.wire_at(part, slot)?;
        Some(if own == "e" { self.pairs[wire].effort } else { self.pairs[wire].flow })
    }

    fn port_named(&self, part: usize, name: &str) -> Option<usize> {
        let p = self.part(part);
        match name {
            "in" if p.word.is_two_port() => Some(0),
            "out" if p.word.is_two_port() => Some(1),
            _ => p.ports.iter().position(|n| n.text == name),
        }
    }

    /// The entries of all `causality` statements.
    pub fn forced_causality(&mut self) -> Vec<ForcedCausality> {
        let flat = self.flat;
        let mut forced: Vec<ForcedCausality> = Vec::new();
        let mut first: BTreeMap<PortRef, usize> = BTreeMap::new();
        for &(here, entry) in &flat.causality {
            let before = self.faults.len();
            for port in self.forced_ports(here, entry) {
                let span = entry.element.span.to(entry.span);
                let causality = match entry.causality {
                    Causality::Integral => PortCausality::Integral,
                    Causality::Derivative => PortCausality::Derivative,
                    Causality::Resistive => PortCausality::Resistive,
                    Causality::Conductive => PortCausality::Conductive,
                };
                let at = *first.entry(port).or_insert(forced.len());
                match forced.get(at) {
                    Some(first) if first.causality == causality => {}
                    Some(first) => {
                        let d = Diagnostic::error(codes::B010, "one element is forced two ways", span, "forced again")
                            .also(first.span, "forced first");
                        self.fault(d.hint("remove one of them"));
                    }
                    None => forced.push(ForcedCausality { port, causality, span }),
                }
            }
            self.met_in(here, before);
        }
        forced
    }

    fn forced_ports(&mut self, here: Here, entry: &'a ast::ForcedCausality) -> Vec<PortRef> {
        let Some((node, rest)) = self.node_of(here, &entry.element) else { return Vec::new() };
        let Node::Part(part) = node else {
            if node != Node::Broken {
                self.not_forcible(entry, "not an element");
            }
            return Vec::new();
        };
        let p = self.part(part);
        let storage = matches!(entry.causality, Causality::Integral | Causality::Derivative);
        let fits = match p.word {
            Word::I | Word::C => storage,
            Word::R => !storage,
            _ => false,
        };
        if !fits {
            let what = format!("{} `{}`", p.word.text(), p.name);
            self.not_forcible(entry, &format!("this is {what}"));
            return Vec::new();
        }
        let ports = self.wiring.ports[part].len();
        match rest.as_slice() {
            [] => (0..ports).map(|port| Self::port_ref(part, port)).collect(),
            [port] => match self.port_named(part, &port.text) {
                Some(slot) => vec![Self::port_ref(part, slot)],
                None => {
                    let title = format!("`{}` has no port `{}`", p.name, port.text);
                    self.fault(Diagnostic::error(codes::N001, title, port.span, "not known"));
                    Vec::new()
                }
            },
            _ => Vec::new(),
        }
    }

    fn not_forcible(&mut self, entry: &ast::ForcedCausality, why: &str) {
        let d = Diagnostic::error(codes::B010, "this element cannot have that causality", entry.element.span, why);
        self.fault(
            d.note("I and C are integral or derivative; R is resistive (flow in) or conductive (effort in)")
                .hint("for other elements force a bond: `stroke a -> b at b`"),
        );
    }

    /// The entries of all `stroke` statements.
    pub fn forced_strokes(&mut self) -> Vec<ForcedStroke> {
        let flat = self.flat;
        let mut forced: Vec<ForcedStroke> = Vec::new();
        let mut sides: BTreeMap<(usize, bool), Span> = BTreeMap::new();
        for &(here, stroke, span) in &flat.strokes {
            let before = self.faults.len();
            if let Some((wire, at_to)) = self.stroke(here, stroke) {
                sides.entry((wire, at_to)).or_insert(span);
                match sides.get(&(wire, !at_to)) {
                    Some(first) => {
                        let d = Diagnostic::error(codes::B010, "one bond has a stroke at both ends", span, "here")
                            .also(*first, "and here");
                        self.fault(d.hint("remove one of them"));
                    }
                    None => forced.push(ForcedStroke { bond: Self::bond_id(wire), at_to, span }),
                }
            }
            self.met_in(here, before);
        }
        forced
    }

    /// The bond of a stroke, and whether the stroke is where the half arrow is.
    fn stroke(&mut self, here: Here, stroke: &'a ast::ForcedStroke) -> Option<(usize, bool)> {
        let wire = match &stroke.bond {
            StrokeBond::Between(from, to) => self.bond_between(here, from, to)?,
            StrokeBond::Named(name) => self.bond_named(here, name)?,
        };
        let (at, slot) = self.stroke_end(here, &stroke.at)?;
        let w = &self.wiring.wires[wire];
        let is = |end: (usize, usize)| end.0 == at && slot.is_none_or(|s| s == end.1);
        if is(w.to) {
            return Some((wire, true));
        }
        if is(w.from) {
            return Some((wire, false));
        }
        let names = (&self.part(w.from.0).name, &self.part(w.to.0).name);
        let d = Diagnostic::error(
            codes::B008,
            "the stroke is not at an end of its bond",
            stroke.at.span,
            "not an end of this bond",
        );
        self.fault(d.hint(format!("write `at {}` or `at {}`", names.0, names.1)));
        None
    }

    /// A part, and a port of it if one is named.
    fn stroke_end(&mut self, here: Here, path: &'a ast::Path) -> Option<(usize, Option<usize>)> {
        let (node, rest) = self.node_of(here, path)?;
        match (node, rest.as_slice()) {
            (Node::Part(part), []) => Some((part, None)),
            (Node::Part(part), [port]) if self.port_named(part, &port.text).is_some() => {
                Some((part, self.port_named(part, &port.text)))
            }
            (Node::Broken, _) => None,
            _ => {
                let d = Diagnostic::error(
                    codes::B008,
                    "a stroke sits at an element or junction",
                    path.span,
                    "not one of them",
                );
                self.fault(
                    d.hint("name the ends of the bond: `stroke a -> b at b`; inside a component, force it there"),
                );
                None
            }
        }
    }

    fn bond_named(&mut self, here: Here, part: &'a ast::PathPart) -> Option<usize> {
        let name = &part.name;
        let named = self.flat.names.scopes[here.scope].nodes.get(name.text.as_str()).map(|(node, _)| *node);
        let node = named.map(|node| self.flat.names.with_indices(&mut self.repeats, here, node, part));
        match node {
            Some(Err(fault)) => {
                self.fault(*fault);
                None
            }
            Some(Ok(Node::Bond(drawn))) => {
                named.into_iter().for_each(|node| self.uses.add(Used::Node(node), name.span));
                self.wiring.of_drawn[drawn]
            }
            _ => {
                let d = Diagnostic::error(
                    codes::B008,
                    format!("there is no bond `{}`", name.text),
                    name.span,
                    "not the name of a bond",
                );
                self.fault(d.hint(format!("name the bond where it is drawn: `a -> b as {}`", name.text)));
                None
            }
        }
    }

    /// The bond from one element to another.
    fn bond_between(&mut self, here: Here, from: &'a ast::Path, to: &'a ast::Path) -> Option<usize> {
        let (a, b) = (self.stroke_end(here, from), self.stroke_end(here, to));
        let ((a, a_slot), (b, b_slot)) = (a?, b?);
        let fits =
            |end: (usize, usize), part: usize, slot: Option<usize>| end.0 == part && slot.is_none_or(|s| s == end.1);
        let at = |part: usize| self.wiring.ports[part].iter().flatten().map(|(wire, _)| *wire);
        let small = if self.wiring.ports[a].len() <= self.wiring.ports[b].len() { a } else { b };
        let joining = |from: (usize, Option<usize>), to: (usize, Option<usize>)| -> Vec<usize> {
            let wires = &self.wiring.wires;
            at(small).filter(|w| fits(wires[*w].from, from.0, from.1) && fits(wires[*w].to, to.0, to.1)).collect()
        };
        let found = joining((a, a_slot), (b, b_slot));
        let span = from.span.to(to.span);
        match found.as_slice() {
            [wire] => Some(*wire),
            [] => {
                let (x, y) = (&self.part(a).name, &self.part(b).name);
                let d = Diagnostic::error(codes::B008, format!("there is no bond `{x} -> {y}`"), span, "not drawn");
                let d = match joining((b, b_slot), (a, a_slot)).first() {
                    Some(wire) => d
                        .also(self.wiring.wires[*wire].span, "it is drawn the other way")
                        .hint(format!("write `stroke {y} -> {x} at …`")),
                    None => d.hint("name the two ends of a bond, in the order of its half arrow"),
                };
                self.fault(d);
                None
            }
            several => {
                let mut d =
                    Diagnostic::error(codes::B009, "which of the parallel bonds?", span, "several bonds join these");
                for wire in several {
                    d = d.also(self.wiring.wires[*wire].span, "one of them");
                }
                self.fault(d.hint("name the bond where it is drawn, `a -> b as b1`, and write `stroke b1 at b`"));
                None
            }
        }
    }
}
