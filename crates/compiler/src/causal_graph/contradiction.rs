//! Contradictions between sources, constraints and forced strokes, and legal but suspicious structures, in physical words.

use std::collections::{BTreeMap, BTreeSet};

use super::assign::{imposes, outer_ports};
use super::ports::Solved;
use super::strokes::{Strokes, sits_here};
use super::{CausalGraph, Combination, Role};
use crate::algebra::{Expr, Exprs, PlainNames, Residue, Symbol, ascii};
use crate::bond_graph::{Bond, BondGraph, BondId, ElementId, Kind, Meaning, PortRef};
use crate::diagnostic::{Diagnostic, codes};
use crate::ids::Id;
use crate::ids::Map;
use crate::span::Span;

/// One demand on a stroke.
#[derive(Debug, Clone, Copy)]
struct Demand {
    bond: BondId,
    at_to: bool,
    span: Span,
    /// Whether what an element imposes makes it, not the modeller.
    imposed: bool,
}

/// Whether `stroke` or `causality` says anything about a part.
pub fn is_forced(graph: &BondGraph, members: &[ElementId]) -> bool {
    !demands_on(graph, members).is_empty()
}

/// Applies `stroke` and `causality` to one part; tells whether there were any. On conflict the smallest set is reported.
pub fn force_strokes(graph: &BondGraph, strokes: &mut Strokes, members: &[ElementId]) -> Result<bool, Box<Diagnostic>> {
    let forced = demands_on(graph, members);
    if forced.is_empty() {
        return Ok(false);
    }
    let mark = strokes.mark();
    let holds = |set: &[Demand], strokes: &mut Strokes| {
        let fine = set.iter().all(|d| strokes.set(d.bond, d.at_to).is_ok());
        strokes.undo(mark);
        fine
    };
    // Sources that contradict each other without any forced stroke are told by what they impose.
    let mut core = imposed_on(graph, members);
    if !holds(&core, strokes) {
        core.clear();
    }
    core.extend(forced.iter().copied());
    if holds(&core, strokes) {
        // What sources ask for is set with them.
        forced.iter().try_for_each(|d| strokes.set(d.bond, d.at_to)).expect("they hold together");
        return Ok(true);
    }
    // A minimal infeasible subset: drop each demand without which the rest is still contradictory.
    let mut i = 0;
    while i < core.len() {
        let mut fewer = core.clone();
        fewer.remove(i);
        if holds(&fewer, strokes) { i += 1 } else { core = fewer }
    }
    let bond = |d: &Demand| {
        let bond = &graph.bonds[d.bond];
        let name = |p: PortRef| graph.elements[p.element].name.clone();
        format!("{} -> {}", name(bond.from), name(bond.to))
    };
    // What the modeller has forced comes first.
    core.sort_by_key(|demand| demand.imposed);
    let Some(first) = core.first() else { unreachable!("an empty set contradicts nothing") };
    let title = match core.iter().filter(|demand| !demand.imposed).count() {
        1 => "this forced stroke cannot be: a source or constraint asks for the other one",
        _ => "these forced strokes cannot hold together",
    };
    let mut fault =
        Diagnostic::error(codes::C003, title, first.span, format!("this settles the stroke of {}", bond(first)));
    for other in &core[1..] {
        let what = if other.imposed { "what this imposes" } else { "this" };
        fault = fault.also(other.span, format!("{what} settles the stroke of {}", bond(other)));
    }
    Err(Box::new(fault
        .note("one bond sets the effort of a 0-junction, one sets the flow of a 1-junction; a TF passes causality on, a GY turns it")
        .hint(if core.iter().any(|demand| demand.imposed) { "leave out what is forced" } else { "leave out one of them" })))
}

/// What is forced can be met, and leaves bonds whose stroke can then sit at neither end.
pub fn leaves_no_way(graph: &BondGraph, members: &[ElementId]) -> Diagnostic {
    let demands = demands_on(graph, members);
    let span = demands.first().map_or(graph.elements[members[0]].span, |demand| demand.span);
    let mut fault = Diagnostic::error(
        codes::C003,
        "with what is forced here some bonds can have their stroke at neither end",
        span,
        "this settles a stroke",
    );
    for other in demands.iter().skip(1) {
        fault = fault.also(other.span, "this settles a stroke");
    }
    fault.hint("leave out one of them, or turn it round")
}

fn demands_on(graph: &BondGraph, members: &[ElementId]) -> Vec<Demand> {
    let inside = |e: ElementId| members.binary_search(&e).is_ok();
    let mut demands = Vec::new();
    for forced in &graph.forced_causality {
        if inside(forced.port.element) {
            let port = &graph.elements[forced.port.element].ports[forced.port.port as usize];
            let inertance = matches!(graph.elements[forced.port.element].kind, Kind::Inertance(_));
            let here = sits_here(forced.causality, inertance);
            demands.push(Demand { bond: port.bond, at_to: here == port.inward, span: forced.span, imposed: false });
        }
    }
    for forced in &graph.forced_strokes {
        if inside(graph.bonds[forced.bond].from.element) {
            demands.push(Demand { bond: forced.bond, at_to: forced.at_to, span: forced.span, imposed: false });
        }
    }
    demands
}

/// The strokes that sources and constraints ask for by what they impose.
fn imposed_on(graph: &BondGraph, members: &[ElementId]) -> Vec<Demand> {
    let demand = |port: PortRef| {
        let (effort, element) = (imposes(graph, port)?, &graph.elements[port.element]);
        let end = &element.ports[port.port as usize];
        Some(Demand { bond: end.bond, at_to: effort != end.inward, span: element.span, imposed: true })
    };
    outer_ports(graph, members).into_iter().filter_map(demand).collect()
}

/// Errors for relations among imposed variables that the structure implies and that do not hold.
pub fn demands(x: &mut Exprs, graph: &BondGraph, solved: &Solved) -> Vec<Diagnostic> {
    let mut faults = Vec::new();
    for demand in &solved.demands {
        if !holds(x, graph, solved, demand) {
            faults.push(contradiction(x, graph, solved, demand));
        }
    }
    faults
}

/// Whether a relation among imposed variables holds with the values that they are given.
fn holds(x: &mut Exprs, graph: &BondGraph, solved: &Solved, demand: &Combination) -> bool {
    let mut terms = Vec::new();
    for &(symbol, coefficient) in &demand.0 {
        let Some(value) = imposed_value(x, graph, solved, symbol) else { return false };
        terms.push(x.mul(&[coefficient, value]));
    }
    let sum = x.add(&terms);
    x.is_zero_given(sum)
}

/// The port that imposes a variable.
fn imposer(solved: &Solved, symbol: Symbol) -> Option<PortRef> {
    solved.ports.iter().find(|p| p.input == symbol).map(|p| p.port)
}

fn imposed_value(x: &mut Exprs, graph: &BondGraph, solved: &Solved, symbol: Symbol) -> Option<Expr> {
    let port = imposer(solved, symbol)?;
    Some(match graph.elements[port.element].kind {
        Kind::EffortSource { value } | Kind::FlowSource { value } => value,
        Kind::ZeroCompliance { flow } => flow,
        _ => x.int(0),
    })
}

fn contradiction(x: &mut Exprs, graph: &BondGraph, solved: &Solved, demand: &Combination) -> Diagnostic {
    let concerned: Vec<PortRef> = demand.0.iter().filter_map(|t| imposer(solved, t.0)).collect();
    let name = |p: &PortRef| graph.elements[p.element].name.as_str();
    let names: Vec<&str> = concerned.iter().map(name).collect();
    let span = |p: &PortRef| graph.elements[p.element].span;
    let relation = demand.expr(x);
    let relation = ascii(x, relation, &PlainNames(x));
    let last = concerned.last().copied().expect("a demand has terms");
    let effort = demand.0.iter().all(|t| matches!(meaning(graph, t.0), Some(Meaning::Effort(_))));
    let quantity = if effort { "effort" } else { "flow" };
    let shared = (concerned.len() == 2).then(|| shared_junction(graph, concerned[0], concerned[1])).flatten();
    let (code, title) = match (shared, concerned.len()) {
        (Some(junction), _) => {
            (codes::C001, format!("two sources set the {quantity} of junction {}", graph.elements[junction].name))
        }
        (None, 1) => (codes::C002, format!("the structure leaves {} no freedom", names[0])),
        (None, _) => (codes::C002, format!("{} cannot hold together", names.join(" and "))),
    };
    let sets = |p: &PortRef| format!("{} sets it here", name(p));
    let mut fault = Diagnostic::error(code, title, span(&last), sets(&last));
    for port in &concerned[..concerned.len() - 1] {
        fault = fault.also(span(port), sets(port));
    }
    let remedy = match (effort, concerned.len()) {
        (true, 2..) => "put an R between them, or make one of them an Sf",
        (false, 2..) => "put an R or a C between them, or make one of them an Se",
        _ => "put an R or a storage beside it, or take it away",
    };
    fault.note(format!("the junctions demand {relation} = 0")).hint(remedy)
}

fn meaning(graph: &BondGraph, symbol: Symbol) -> Option<Meaning> {
    graph.variables.get(&symbol).map(|v| v.meaning)
}

/// The junction that two one-ports stand at.
fn shared_junction(graph: &BondGraph, a: PortRef, b: PortRef) -> Option<ElementId> {
    let other = |p: PortRef| {
        let bond = &graph.bonds[graph.bond_of(p)];
        if bond.from == p { bond.to.element } else { bond.from.element }
    };
    (other(a) == other(b)).then(|| other(a))
}

/// Legal but suspicious: redundant constraints, storages fixed by sources alone, circulating variables, degenerate parameters.
pub fn warnings(causal: &CausalGraph) -> Vec<Diagnostic> {
    let mut all = Vec::new();
    let graph = &causal.graph;
    redundant(graph, causal, &mut all);
    fixed_storages(graph, causal, &mut all);
    circulating(graph, causal, &mut all);
    forced_otherwise(graph, causal, &mut all);
    preferred_in_vain(graph, causal, &mut all);
    if let Some(&first) = causal.ports.degenerate.first() {
        let text = ascii(&graph.exprs, first, &PlainNames(&graph.exprs));
        let span =
            graph.parameters.values().find(|p| graph.exprs.symbols_of(first).contains(&p.symbol)).map(|p| p.span);
        all.push(
            Diagnostic::warning(
                codes::C007,
                "the structure degenerates at the given parameters",
                span.unwrap_or_default(),
                "with this value",
            )
            .note(format!(
                "{text} = 0 here, and not in general: variables that are independent elsewhere depend on each other"
            ))
            .hint("if that is not meant, change one of the parameters"),
        );
    }
    all
}

/// `prefer` for what does not stay independent.
fn preferred_in_vain(graph: &BondGraph, causal: &CausalGraph, all: &mut Vec<Diagnostic>) {
    for preference in causal.ports.unmet.iter().map(|&i| &graph.preferences[i]) {
        let name = &preference.name;
        all.push(
            Diagnostic::warning(
                codes::C009,
                format!("{name} does not stay independent"),
                preference.span,
                "preferred here",
            )
            .note(
                "it follows from sources or from variables that are preferred before it, or the others divided by what \
                 vanishes at the start if it were kept",
            )
            .hint("leave it out, or put it first; where a modulus vanishes, start elsewhere"),
        );
    }
}

fn redundant(graph: &BondGraph, causal: &CausalGraph, all: &mut Vec<Diagnostic>) {
    for state in causal.ports.ports.iter().filter(|p| p.role == Role::Redundant) {
        let element = &graph.elements[state.port.element];
        all.push(
            Diagnostic::warning(
                codes::C004,
                format!("{} repeats what other sources or constraints impose", element.name),
                element.span,
                "it agrees with them",
            )
            .note("how they share the reaction is not determined; everything else is")
            .hint(format!("leave {} out, or take the reactions of least norm: simulate --minimum-norm", element.name)),
        );
    }
    for &constraint in &causal.ports.repeated {
        let constraint = &graph.constraints[constraint];
        all.push(
            Diagnostic::warning(
                codes::C004,
                format!("the constraint {} is kept by the others wherever the machine can be", constraint.name),
                constraint.span,
                "it takes nothing of the motion",
            )
            .note("how they share the reaction is not determined: the others carry all of it, this one nothing")
            .hint("leave it out, or take the reactions of least norm: simulate --minimum-norm"),
        );
    }
}

fn fixed_storages(graph: &BondGraph, causal: &CausalGraph, all: &mut Vec<Diagnostic>) {
    let mut x = graph.exprs.clone();
    let mut known = Map::new();
    let inputs: BTreeMap<Symbol, &super::PortState> = causal.ports.ports.iter().map(|p| (p.input, p)).collect();
    let mut moves = Moves { causal, inputs: &inputs, known: Map::new() };
    for state in causal.ports.ports.iter().filter(|p| p.role == Role::Dependent) {
        if moves.certainly(&mut x, state.output) {
            continue;
        }
        let row = causal.ports.resolve(&mut x, state.output, &mut known);
        let imposed = |t: &(Symbol, Expr)| inputs.get(&t.0).is_some_and(|p| p.role == Role::Source);
        if !row.0.iter().all(imposed) {
            continue;
        }
        let element = &graph.elements[state.port.element];
        let sources: Vec<&str> =
            row.0.iter().map(|t| graph.elements[inputs[&t.0].port.element].name.as_str()).collect();
        // A joint of a library that lets a body turn no way holds its inertia on purpose.
        let within = |name: &str| name.contains('.');
        if within(&element.name) && !sources.is_empty() && sources.iter().all(|source| within(source)) {
            continue;
        }
        let by = if sources.is_empty() {
            "the junctions hold it at zero".into()
        } else {
            format!("fixed by {}", sources.join(", "))
        };
        all.push(
            Diagnostic::warning(
                codes::C005,
                format!("{} stores only what it is given", element.name),
                element.span,
                by,
            )
            .note("it has no freedom of its own, and its reaction needs the time derivative of what fixes it")
            .hint("if that is not meant, put an R between them"),
        );
    }
}

/// Whether variables follow from anything but sources, found without writing them out: in a prime field, with sources 0
/// and random values of all else.
struct Moves<'a> {
    causal: &'a CausalGraph,
    inputs: &'a BTreeMap<Symbol, &'a super::PortState>,
    known: Map<Symbol, Option<Residue>>,
}

impl Moves<'_> {
    fn certainly(&mut self, x: &mut Exprs, symbol: Symbol) -> bool {
        let mut open = vec![symbol];
        while let Some((next, row)) = self.causal.ports.next_to_resolve(&mut open, |s| self.known.contains_key(s)) {
            let mut sum = Some(Residue::ZERO);
            for &(read, coefficient) in &row.0 {
                let value = match self.known.get(&read) {
                    Some(known) => *known,
                    None if self.inputs.get(&read).is_some_and(|p| p.role == Role::Source) => Some(Residue::ZERO),
                    None => {
                        let read = x.sym(read);
                        x.residue(read)
                    }
                };
                let term = x.residue(coefficient).zip(value).map(|(c, v)| c * v);
                sum = sum.zip(term).map(|(sum, term)| sum + term);
            }
            self.known.insert(next, sum);
        }
        self.known.get(&symbol).is_some_and(|sum| sum.is_some_and(|sum| !sum.vanishes()))
    }
}

/// Efforts and flows of bonds that nothing determines. How redundant sources share their reaction is told of these.
fn circulating(graph: &BondGraph, causal: &CausalGraph, all: &mut Vec<Diagnostic>) {
    let redundant = |s: &Symbol| causal.ports.ports.iter().any(|p| p.role == Role::Redundant && p.output == *s);
    let free: BTreeSet<Symbol> = causal.ports.undetermined.iter().copied().filter(|s| !redundant(s)).collect();
    let open = readers(causal, &free);
    let inner = |b: &Bond| [b.from, b.to].iter().all(|p| graph.elements[p.element].kind.is_inner());
    let concerned = |b: &Bond| inner(b) && (open.contains(&b.effort) || open.contains(&b.flow));
    let bonds: Vec<BondId> = graph.bonds.iter().filter(|(_, b)| concerned(b)).map(|(id, _)| id).collect();
    let Some(&first) = bonds.first() else { return };
    let efforts = bonds.iter().any(|&b| open.contains(&graph.bonds[b].effort));
    let flows = bonds.iter().any(|&b| open.contains(&graph.bonds[b].flow));
    let one = bonds.len() == 1;
    let what = match (efforts, flows) {
        (true, false) => {
            if one {
                "the effort"
            } else {
                "the efforts"
            }
        }
        (false, true) => {
            if one {
                "the flow"
            } else {
                "the flows"
            }
        }
        _ => "efforts and flows",
    };
    let (note, hint) = if close_a_ring(graph, &bonds) {
        why_in_a_ring(efforts, flows)
    } else {
        why_on_a_tree(efforts, flows, &lonely(graph, &bonds))
    };
    let numbers: Vec<String> = bonds.iter().map(|b| (b.index() + 1).to_string()).collect();
    let (bonds, are, here) = match one {
        true => ("bond", if efforts && flows { "are" } else { "is" }, "this one"),
        false => ("bonds", "are", "this is one of them"),
    };
    let title = format!("{what} of {bonds} {} {are} not determined", numbers.join(", "));
    all.push(Diagnostic::warning(codes::C006, title, graph.bonds[first].span, here).note(note).hint(hint));
}

/// These variables and all that read them, near or far.
fn readers(causal: &CausalGraph, free: &BTreeSet<Symbol>) -> BTreeSet<Symbol> {
    if free.is_empty() {
        return BTreeSet::new();
    }
    let mut by: BTreeMap<Symbol, Vec<Symbol>> = BTreeMap::new();
    for (&symbol, row) in &causal.ports.definitions {
        row.0.iter().for_each(|t| by.entry(t.0).or_default().push(symbol));
    }
    let (mut found, mut work) = (free.clone(), free.iter().copied().collect::<Vec<_>>());
    while let Some(symbol) = work.pop() {
        work.extend(by.get(&symbol).into_iter().flatten().copied().filter(|s| found.insert(*s)));
    }
    found
}

/// Whether some of these bonds form a ring.
fn close_a_ring(graph: &BondGraph, bonds: &[BondId]) -> bool {
    let mut set = petgraph::unionfind::UnionFind::<usize>::new(graph.elements.len());
    let ends = |b: &BondId| [graph.bonds[*b].from, graph.bonds[*b].to].map(|p| p.element.index());
    bonds.iter().map(ends).any(|[from, to]| !set.union(from, to))
}

/// The junctions with a single bond at the ends of these bonds, by name.
fn lonely(graph: &BondGraph, bonds: &[BondId]) -> Vec<String> {
    let mut found: BTreeSet<ElementId> = BTreeSet::new();
    for end in bonds.iter().flat_map(|&b| [graph.bonds[b].from.element, graph.bonds[b].to.element]) {
        let element = &graph.elements[end];
        if element.ports.len() == 1 && matches!(element.kind, Kind::Zero | Kind::One) {
            found.insert(end);
        }
    }
    found.into_iter().map(|e| graph.elements[e].name.clone()).collect()
}

fn why_in_a_ring(efforts: bool, flows: bool) -> (String, String) {
    let (note, hint) = match (efforts, flows) {
        (true, false) => (
            "nothing sets the level from which they are counted (a circuit without ground), or a ring of bonds passes \
             one on unchanged; all elements are determined",
            "to set the level, put a source `Se(0)` at one of the 0-junctions; in a ring, leave out one of the bonds",
        ),
        (false, true) => (
            "a flow can circulate in them: they form a ring that passes it on unchanged; all elements outside the ring \
             are determined",
            "leave out one of the bonds",
        ),
        _ => (
            "the bonds form a ring that passes them on unchanged; all elements outside the ring are determined",
            "leave out one of the bonds",
        ),
    };
    (note.into(), hint.into())
}

fn why_on_a_tree(efforts: bool, flows: bool, lonely: &[String]) -> (String, String) {
    let note = match (efforts, flows) {
        (true, false) => "nothing sets the level from which they are counted (a circuit without ground)",
        (false, true) => "nothing answers to how much flows there",
        _ => "nothing answers to them",
    };
    if lonely.is_empty() {
        let hint = match (efforts, flows) {
            (true, false) => "to set the level, put a source `Se(0)` at one of the 0-junctions",
            _ => "put an R or a storage at one of their junctions",
        };
        return (format!("{note}; all elements are determined"), hint.into());
    }
    let junctions = lonely.join(", ");
    let (ends, has, it) = if lonely.len() == 1 { ("s", "has", "it") } else { ("", "have", "them") };
    let note = format!(
        "{note}: {junctions} {has} a single bond, and demand{ends} only that the flow of a 0-junction, the effort of a \
         1-junction vanishes"
    );
    (note, format!("put an element at {junctions}, or leave {it} out"))
}

/// Storages drawn in derivative causality by force although they are independent.
fn forced_otherwise(graph: &BondGraph, causal: &CausalGraph, all: &mut Vec<Diagnostic>) {
    use crate::bond_graph::PortCausality::{Derivative, Integral};
    for forced in &graph.forced_causality {
        let role = causal.ports.of(forced.port).map(|p| p.role);
        let (drawn, truth) = match (forced.causality, role) {
            (Derivative, Some(Role::Independent)) => ("derivative", "independent"),
            (Integral, Some(Role::Dependent)) => ("integral", "dependent"),
            _ => continue,
        };
        let name = &graph.elements[forced.port.element].name;
        all.push(
            Diagnostic::warning(
                codes::C008,
                format!("{name} is drawn in {drawn} causality, but it is {truth}"),
                forced.span,
                "drawn so, as asked",
            )
            .note("the strokes and causal paths follow the drawing; the smallest equations follow what is true"),
        );
    }
}
