//! What is legal but odd about a graph.

use std::collections::{BTreeMap, BTreeSet};

use rustc_hash::FxHashSet;

use super::{Bond, BondGraph, Element, Kind, Meaning, Storage, StorageLaw};
use crate::algebra::{Expr, Symbol};
use crate::diagnostic::{Diagnostic, codes};
use crate::ids::Id;

/// The warnings of this stage, in the order of the elements: junctions that join nothing, parts that nothing connects,
/// fields whose laws come from no energy, displacements that inputs move.
pub fn warnings(graph: &BondGraph) -> Vec<Diagnostic> {
    let mut found = lonely_junctions(graph);
    found.extend(isolated_parts(graph));
    found.extend(fields_without_energy(graph));
    found.extend(displaced_by_inputs(graph));
    found
}

/// Storages whose displacement reads an input: its rate is part of their flow, and nothing in the text gives it. A source that
/// reads an input may be that rate.
fn displaced_by_inputs(graph: &BondGraph) -> Vec<Diagnostic> {
    let inputs: BTreeMap<Symbol, &str> = graph.inputs.values().map(|input| (input.symbol, &*input.name)).collect();
    let read = |e: Expr| graph.exprs.symbols_of(e).into_iter().find_map(|symbol| inputs.get(&symbol).copied());
    let leads = |element: &Element| match element.kind {
        Kind::FlowSource { value } | Kind::EffortSource { value } => read(value).is_some(),
        _ => false,
    };
    if inputs.is_empty() || graph.elements.values().any(leads) {
        return Vec::new();
    }
    let mut found = Vec::new();
    for element in graph.elements.values() {
        let (Kind::Inertance(storage) | Kind::Compliance(storage)) = &element.kind else { continue };
        let displaced = storage.laws.iter().find_map(|law| match law {
            StorageLaw::Known { displacement, .. } => read(*displacement),
            _ => None,
        });
        let Some(input) = displaced else { continue };
        let title = format!("the displacement of `{}` moves with the input `{input}`, its flow does not", element.name);
        found.push(
            Diagnostic::warning(codes::L016, title, element.span, "its rate and its flow part as the input moves")
                .note("what is constant is fine; where the input moves, a run is refused by its audit")
                .hint("join a source of flow to it that gives the rate, as another input"),
        );
    }
    found
}

/// Junctions with one bond: a 0 lets nothing flow, a 1 lets nothing push. One whose common variable something reads, as the
/// rate of an angle, is there for its name.
fn lonely_junctions(graph: &BondGraph) -> Vec<Diagnostic> {
    let alone = |e: &&Element| matches!(e.kind, Kind::Zero | Kind::One) && e.ports.len() == 1;
    let read: BTreeSet<Symbol> = match graph.elements.values().any(|e| alone(&e)) {
        true => graph.exprs.symbols_met(&graph.expressions(), &mut FxHashSet::default()).into_iter().collect(),
        false => BTreeSet::new(),
    };
    let named = |e: &Element| {
        let bond = &graph.bonds[e.ports[0].bond];
        read.contains(if matches!(e.kind, Kind::One) { &bond.flow } else { &bond.effort })
    };
    let lonely = graph.elements.values().filter(|e| alone(e) && !named(e));
    let warning = |e: &Element| {
        let (what, hint) = match e.kind {
            Kind::Zero => ("flow", "the flow of its bond is 0; remove the junction, or join more to it"),
            _ => ("effort", "the effort of its bond is 0; remove the junction, or join more to it"),
        };
        let title = format!("{}-junction `{}` has one bond", e.kind.word(), e.name);
        Diagnostic::warning(codes::B021, title, e.span, format!("no {what} can pass")).hint(hint)
    };
    lonely.map(warning).collect()
}

/// Parts that neither a bond nor a value that one reads of the other connects with the first part.
fn isolated_parts(graph: &BondGraph) -> Vec<Diagnostic> {
    let mut sets = Sets((0..graph.elements.len() + graph.signals.len() + graph.held.len()).collect());
    for bond in graph.bonds.values() {
        sets.join(bond.from.element.index(), bond.to.element.index());
    }
    let mut reads = Reads { graph, sets };
    for (id, element) in graph.elements.iter() {
        element.kind.expressions().into_iter().for_each(|e| reads.by(id.index(), e));
    }
    let elements = graph.elements.len();
    for (id, signal) in graph.signals.iter() {
        reads.by(elements + id.index(), signal.rate);
    }
    for (id, held) in graph.held.iter() {
        reads.by(elements + graph.signals.len() + id.index(), held.source);
    }
    for clause in &graph.clauses {
        clause.expressions().for_each(|e| reads.beside_each_other(e));
        clause.actions.iter().for_each(|a| reads.both(a.target, a.value));
    }
    graph.outputs.iter().for_each(|output| reads.beside_each_other(output.value));
    let mut sets = reads.sets;
    // A constraint that holds whatever moves is joined to nothing.
    let idle =
        |bond: &Bond| graph.elements[bond.from.element].ports.len() + graph.elements[bond.to.element].ports.len() == 2;
    for constraint in &graph.constraints {
        let bond = graph.elements[constraint.element].ports.first().map(|p| &graph.bonds[p.bond]);
        if bond.is_some_and(idle) {
            sets.join(0, constraint.element.index());
        }
    }
    let mut seen: BTreeMap<usize, &Element> = BTreeMap::new();
    for (id, element) in graph.elements.iter() {
        seen.entry(sets.find(id.index())).or_insert(element);
    }
    let mut parts: Vec<&Element> = seen.into_values().collect();
    parts.sort_by_key(|e| e.span);
    let main = parts.first().map(|e| e.span);
    let warning = |e: &&Element| {
        let title = format!("the part around `{}` is not connected with the rest", e.name);
        let d =
            Diagnostic::warning(codes::B020, title, e.span, "no bond and no signal leads from here to the first part");
        match main {
            Some(main) => d.also(main, "the first part").hint("join them, or make two models of them"),
            None => d,
        }
    };
    parts.iter().skip(1).map(warning).collect()
}

/// Which elements and signals one expression joins, because it reads them.
struct Reads<'g> {
    graph: &'g BondGraph,
    sets: Sets,
}

impl Reads<'_> {
    fn by(&mut self, reader: usize, expr: Expr) {
        for symbol in self.graph.exprs.symbols_of(expr) {
            self.symbol(reader, symbol);
        }
    }

    fn symbol(&mut self, reader: usize, symbol: Symbol) {
        if let Some(place) = self.place(symbol) {
            self.sets.join(reader, place);
        }
    }

    /// Whoever compares parts in one expression has put them beside each other.
    fn beside_each_other(&mut self, expr: Expr) {
        let read = self.graph.exprs.symbols_of(expr);
        let places: Vec<usize> = read.iter().filter_map(|&s| self.place(s)).collect();
        places.windows(2).for_each(|pair| self.sets.join(pair[0], pair[1]));
    }

    /// What an event changes, and what it reads for that.
    fn both(&mut self, target: Symbol, value: Expr) {
        let Some(place) = self.place(target) else { return };
        self.by(place, value);
    }

    /// Where a variable belongs.
    fn place(&self, symbol: Symbol) -> Option<usize> {
        let elements = self.graph.elements.len();
        match self.graph.variables.get(&symbol)?.meaning {
            Meaning::Effort(bond) | Meaning::Flow(bond) => Some(self.graph.bonds[bond].from.element.index()),
            Meaning::Stored(port) => Some(port.element.index()),
            Meaning::Signal(id) => Some(elements + id.index()),
            Meaning::Held(id) => Some(elements + self.graph.signals.len() + id.index()),
            Meaning::Rate(of) if of != symbol => self.place(of),
            _ => None,
        }
    }
}

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
        self.0[a.max(b)] = a.min(b);
    }
}

/// Fields whose laws have a Jacobian that is not symmetric: a cycle of motion would make or eat energy.
fn fields_without_energy(graph: &BondGraph) -> Vec<Diagnostic> {
    let mut found = Vec::new();
    let mut exprs = None;
    for element in graph.elements.values().filter(|e| e.ports.len() > 1) {
        let (Kind::Inertance(storage) | Kind::Compliance(storage)) = &element.kind else { continue };
        let pool = exprs.get_or_insert_with(|| graph.exprs.clone());
        let Some((i, j)) = asymmetric(graph, pool, element, storage) else { continue };
        let (a, b) = (&element.ports[i].name, &element.ports[j].name);
        let title = format!("the laws of {} `{}` come from no energy", element.kind.word(), element.name);
        found.push(
            Diagnostic::warning(codes::L005, title, element.span, format!("ports `{a}` and `{b}` do not act alike on one another"))
                .note(format!("the law of `{a}` by what `{b}` stores is not the law of `{b}` by what `{a}` stores: a cycle makes or eats energy"))
                .hint("give `energy = …`, or laws that are its derivatives, if the field is to conserve energy"),
        );
    }
    found
}

/// Two ports of a field whose laws do not fit one energy.
fn asymmetric(
    graph: &BondGraph,
    pool: &mut crate::algebra::Exprs,
    element: &Element,
    storage: &Storage,
) -> Option<(usize, usize)> {
    let compliance = matches!(element.kind, Kind::Compliance(_));
    let z = |port: usize| {
        let bond = &graph.bonds[element.ports[port].bond];
        if compliance { bond.effort } else { bond.flow }
    };
    let law = |port: usize| match storage.laws[port] {
        StorageLaw::Integral(e) => Some((e, true)),
        StorageLaw::Derivative(e) => Some((e, false)),
        _ => None,
    };
    for i in 0..element.ports.len() {
        for j in 0..i {
            let (Some((a, integral)), Some((b, also))) = (law(i), law(j)) else { continue };
            if integral != also {
                continue;
            }
            let variable = |port: usize| if integral { storage.stored[port] } else { z(port) };
            let cross = pool.derivative(a, variable(j));
            let back = pool.derivative(b, variable(i));
            let difference = pool.sub(cross, back);
            if !pool.is_zero(difference) && !pool.is_zero_given(difference) {
                return Some((j, i));
            }
        }
    }
    None
}
