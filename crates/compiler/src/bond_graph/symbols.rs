//! Names people know for the variables of every bond, and which bonds share their units.

use std::collections::BTreeSet;
use std::rc::Rc;

use super::Meaning;
use super::builder::{Builder, Pair, Role};
use super::dimension::Quantity;
use super::flatten::Word;
use super::multibonds::part_name;
use crate::algebra::Facts;
use crate::unit::Dimension as Dim;

/// Sets joined step by step.
struct Sets(Vec<usize>);

impl Sets {
    fn find(&mut self, mut x: usize) -> usize {
        while self.0[x] != x {
            self.0[x] = self.0[self.0[x]];
            x = self.0[x];
        }
        x
    }
    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.find(a), self.find(b));
        let (low, high) = (a.min(b), a.max(b));
        self.0[high] = low;
    }
}

impl Builder<'_, '_> {
    /// Makes the symbols of all bonds and stored quantities. In the `parted` bonds a constraint acts.
    pub fn make_symbols(&mut self, parted: &BTreeSet<usize>) {
        let named = self.named_by_junctions(parted);
        let units = self.shared_units();
        let mut name = String::new();
        for (wire, (effort_in, flow_in)) in units.into_iter().enumerate() {
            self.name_of_bond(wire, false, named[wire][0], &mut name);
            let effort = self.fresh(&name, Facts::default());
            self.name_of_bond(wire, true, named[wire][1], &mut name);
            let flow = self.fresh(&name, Facts::default());
            self.mean(effort, Meaning::Effort(Self::bond_id(wire)), effort_in.clone());
            self.mean(flow, Meaning::Flow(Self::bond_id(wire)), flow_in.clone());
            self.pairs.push(Pair { effort, flow, effort_in, flow_in });
        }
        self.make_parted(parted);
        self.make_stored();
        self.make_reactions();
    }

    fn make_stored(&mut self) {
        // What one storage holds and the next one mostly have one dimension.
        let mut last: Option<(Rc<Quantity>, Rc<Quantity>)> = None;
        for part in 0..self.flat.parts.len() {
            let p = self.part(part);
            let letter = match p.word {
                Word::I => "p",
                Word::C => "q",
                _ => {
                    self.stored.push(Vec::new());
                    continue;
                }
            };
            let mut symbols = Vec::with_capacity(self.wiring.ports[part].len());
            for port in 0..self.wiring.ports[part].len() {
                let name = [&part_name(&p.name, &p.port_name(port)), ".", letter].concat();
                let symbol = self.fresh(&name, Facts::default());
                let rate = self.wire_at(part, port).map(|w| match p.word {
                    Word::I => self.pairs[w].effort_in.clone(),
                    _ => self.pairs[w].flow_in.clone(),
                });
                let quantity = match rate {
                    Some(rate) => match &last {
                        Some((known, quantity)) if Rc::ptr_eq(known, &rate) => quantity.clone(),
                        _ => {
                            let quantity = Rc::new(rate.times(&Quantity::of(Dim::SECOND)));
                            last = Some((rate, quantity.clone()));
                            quantity
                        }
                    },
                    None => Rc::new(Quantity::Any),
                };
                self.mean(symbol, Meaning::Stored(Self::port_ref(part, port)), quantity);
                symbols.push(symbol);
            }
            self.stored.push(symbols);
        }
    }

    /// The bond of every `constraint` will come after all that are drawn; its variables have names already.
    fn make_reactions(&mut self) {
        for held in &self.flat.constraints {
            let name = &held.name;
            let effort = self.fresh(&format!("{name}.e"), Facts::default());
            let flow = self.fresh(&format!("{name}.f"), Facts::default());
            self.play(effort, Role::Reaction, Quantity::Any);
            self.play(flow, Role::Reaction, Quantity::Any);
            let any = Rc::new(Quantity::Any);
            self.reactions.push(Pair { effort, flow, effort_in: any.clone(), flow_in: any });
        }
    }

    /// The junctions after which effort and flow of every bond are named.
    fn named_by_junctions(&self, parted: &BTreeSet<usize>) -> Vec<[Option<u32>; 2]> {
        let mut named = vec![[None; 2]; self.wiring.wires.len()];
        for (junction, p) in self.flat.parts.iter().enumerate().filter(|(_, p)| p.word.is_junction()) {
            let Some(wire) = self.representative(junction) else { continue };
            let w = &self.wiring.wires[wire];
            let inner = |end: (usize, usize)| self.part(end.0).word.is_inner();
            let elsewhere = parted.contains(&wire) && self.left_end(wire).0 == junction;
            if !inner(w.from) || !inner(w.to) || elsewhere {
                continue;
            }
            named[wire][usize::from(p.word == Word::One)] = Some(junction as u32);
        }
        named
    }

    /// What the effort or the flow of a bond is called, put into `name`.
    fn name_of_bond(&self, wire: usize, flow: bool, junction: Option<u32>, name: &mut String) {
        let w = &self.wiring.wires[wire];
        name.clear();
        let outer = |(part, _): (usize, usize)| !self.part(part).word.is_inner();
        let two_port = |(part, _): (usize, usize)| self.part(part).word.is_two_port();
        let find = |fits: &dyn Fn((usize, usize)) -> bool| [w.to, w.from].into_iter().find(|&end| fits(end));
        match (junction, find(&outer), w.name.as_str(), find(&two_port)) {
            (Some(junction), ..) => name.push_str(&self.part(junction as usize).name),
            (None, Some(end), ..) | (None, None, "", Some(end)) => self.push_port(end, name),
            (None, None, "", None) => {
                let letter = if flow { "f" } else { "e" };
                name.push_str(&self.unused(format!("{letter}{}", wire + 1)));
                return;
            }
            (None, None, own, _) => name.push_str(own),
        }
        name.push_str(if flow { ".f" } else { ".e" });
    }

    /// Adds the name of a port of a part.
    fn push_port(&self, (part, port): (usize, usize), name: &mut String) {
        let p = self.part(part);
        match p.port_name(port).as_str() {
            "" => name.push_str(&p.name),
            port => name.push_str(&part_name(&p.name, port)),
        }
    }

    /// The name, or one like it if a parameter or signal is called so.
    fn unused(&self, name: String) -> String {
        match self.flat.names.scopes[0].values.contains_key(name.as_str()) {
            true => self.unused(format!("{name}_")),
            false => name,
        }
    }

    /// Dimensions of effort and flow of every bond: bonds at one junction share them.
    fn shared_units(&mut self) -> Vec<(Rc<Quantity>, Rc<Quantity>)> {
        let wires = self.wiring.wires.len();
        let mut sets = Sets((0..wires).collect());
        for (part, p) in self.flat.parts.iter().enumerate().filter(|(_, p)| p.word.is_junction()) {
            let _ = p;
            let mut at = self.wiring.ports[part].iter().flatten().map(|(wire, _)| *wire);
            if let Some(first) = at.next() {
                at.for_each(|other| sets.join(first, other));
            }
        }
        let pseudo = self.pseudo_wires(&mut sets);
        let mut units: Vec<Option<(Rc<Quantity>, Rc<Quantity>)>> = vec![None; wires];
        for wire in 0..wires {
            let root = sets.find(wire);
            if units[root].is_none() {
                let flow = Quantity::var(self.dims.unknown());
                let effort = match pseudo[root] {
                    true => Quantity::var(self.dims.unknown()),
                    false => Quantity::of(Dim::WATT).over(&flow),
                };
                units[root] = Some((Rc::new(effort), Rc::new(flow)));
            }
            units[wire] = units[root].clone();
        }
        units.into_iter().map(|u| u.expect("every bond has its set")).collect()
    }

    /// Whether a bond carries no power: it, or one that shares its junctions, is drawn in a pseudo domain, or ends at an
    /// element declared there.
    fn pseudo_wires(&mut self, sets: &mut Sets) -> Vec<bool> {
        let mut pseudo = vec![false; self.wiring.wires.len()];
        for (wire, w) in self.wiring.wires.iter().enumerate() {
            let ends = [w.from.0, w.to.0];
            if w.pseudo || ends.iter().any(|p| self.part(*p).pseudo && !self.part(*p).word.is_two_port()) {
                let root = sets.find(wire);
                pseudo[root] = true;
            }
        }
        let shared: Vec<bool> = (0..pseudo.len()).map(|w| pseudo[sets.find(w)]).collect();
        self.pseudo.clone_from(&shared);
        shared
    }
}
