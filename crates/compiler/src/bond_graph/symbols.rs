//! Names people know for the variables of every bond, and which bonds share their units.

use std::collections::BTreeSet;

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
        let names = self.bond_names(parted);
        let units = self.shared_units();
        for (wire, (effort, flow)) in names.into_iter().enumerate() {
            let effort = self.fresh(&effort, Facts::default());
            let flow = self.fresh(&flow, Facts::default());
            let (effort_in, flow_in) = units[wire].clone();
            self.mean(effort, Meaning::Effort(Self::bond_id(wire)), effort_in.clone());
            self.mean(flow, Meaning::Flow(Self::bond_id(wire)), flow_in.clone());
            self.pairs.push(Pair { effort, flow, effort_in, flow_in });
        }
        self.make_parted(parted);
        self.make_stored();
        self.make_reactions();
    }

    fn make_stored(&mut self) {
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
            let mut symbols = Vec::new();
            for port in 0..self.wiring.ports[part].len() {
                let name = [&part_name(&p.name, &p.port_name(port)), ".", letter].concat();
                let symbol = self.fresh(&name, Facts::default());
                let rate = self.wire_at(part, port).map(|w| match p.word {
                    Word::I => self.pairs[w].effort_in.clone(),
                    _ => self.pairs[w].flow_in.clone(),
                });
                let quantity = rate.map_or(Quantity::Any, |r| r.times(&Quantity::of(Dim::SECOND)));
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
            self.reactions.push(Pair { effort, flow, effort_in: Quantity::Any, flow_in: Quantity::Any });
        }
    }

    /// Names of effort and flow of every bond.
    fn bond_names(&self, parted: &BTreeSet<usize>) -> Vec<(String, String)> {
        let mut names: Vec<(String, String)> = (0..self.wiring.wires.len()).map(|w| self.bond_name(w)).collect();
        for (junction, p) in self.flat.parts.iter().enumerate().filter(|(_, p)| p.word.is_junction()) {
            let Some(wire) = self.representative(junction) else { continue };
            let w = &self.wiring.wires[wire];
            let inner = |end: (usize, usize)| self.part(end.0).word.is_inner();
            let elsewhere = parted.contains(&wire) && self.left_end(wire).0 == junction;
            if !inner(w.from) || !inner(w.to) || elsewhere {
                continue;
            }
            match p.word {
                Word::One => names[wire].1 = [&p.name, ".f"].concat(),
                _ => names[wire].0 = [&p.name, ".e"].concat(),
            }
        }
        names
    }

    fn bond_name(&self, wire: usize) -> (String, String) {
        let w = &self.wiring.wires[wire];
        let two_port = |(part, port): (usize, usize)| {
            let p = self.part(part);
            p.word.is_two_port().then(|| part_name(&p.name, &p.port_name(port)))
        };
        let named = (!w.name.is_empty()).then(|| w.name.clone());
        let base = self.outer_end(wire).or(named).or_else(|| two_port(w.to)).or_else(|| two_port(w.from));
        match base {
            Some(base) => ([&base, ".e"].concat(), [&base, ".f"].concat()),
            None => (self.unused(format!("e{}", wire + 1)), self.unused(format!("f{}", wire + 1))),
        }
    }

    /// The name, or one like it if a parameter or signal is called so.
    fn unused(&self, name: String) -> String {
        match self.flat.names.scopes[0].values.contains_key(name.as_str()) {
            true => self.unused(format!("{name}_")),
            false => name,
        }
    }

    /// Name of the port of the element at the end of a bond that is outside of the junction structure.
    fn outer_end(&self, wire: usize) -> Option<String> {
        let w = &self.wiring.wires[wire];
        [w.to, w.from].into_iter().find_map(|(part, port)| {
            let p = self.part(part);
            if p.word.is_junction() || p.word.is_two_port() {
                return None;
            }
            Some(part_name(&p.name, &p.port_name(port)))
        })
    }

    /// Dimensions of effort and flow of every bond: bonds at one junction share them.
    fn shared_units(&mut self) -> Vec<(Quantity, Quantity)> {
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
        let mut units: Vec<Option<(Quantity, Quantity)>> = vec![None; wires];
        for wire in 0..wires {
            let root = sets.find(wire);
            if units[root].is_none() {
                let flow = Quantity::var(self.dims.unknown());
                let effort = match pseudo[root] {
                    true => Quantity::var(self.dims.unknown()),
                    false => Quantity::of(Dim::WATT).over(&flow),
                };
                units[root] = Some((effort, flow));
            }
            units[wire] = units[root].clone();
        }
        units.into_iter().map(|u| u.unwrap_or((Quantity::Any, Quantity::Any))).collect()
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
