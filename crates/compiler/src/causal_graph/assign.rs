//! The stage: strokes by propagation (sequential causality assignment) where that is exact, elimination elsewhere.

use std::collections::{BTreeMap, BTreeSet};

use super::by_size::better_by_size;
use super::ports::{CausalityPreferences, Solved, Virtual, is_imposed, solve_part};
use super::repeated::without_repeated;
use super::signals::{NodeId, signal_graph};
use super::start_point::start_point;
use super::strokes::{Strokes, parts, sits_here};
use super::verify::verify;
use super::{CausalGraph, Combination, Kept, Ports, Role, Stroke, break_set, contradiction, digits, local};
use crate::algebra::{Exprs, NumericPoint, Residue, Symbol};
use crate::bond_graph::{BondGraph, BondId, ElementId, Kind, Meaning, PortCausality, PortRef, ResistorLaw};
use crate::diagnostic::{Diagnostic, Diagnostics};
use crate::ids::{Id, Map, Table};

/// Assigns causality: the exact one of every port, and a stroke on every determined bond.
///
/// Errors: sources, constraints or forced strokes that cannot hold together, with the smallest set that cannot.
/// Source: `method.md`, section 2 and 5.1.
pub fn assign_causality(graph: &BondGraph) -> Result<CausalGraph, Diagnostics> {
    let (graph, repeated) = without_repeated(graph);
    let graph = &graph;
    let mut x = graph.exprs.clone();
    let wanted = StoragePreferences::of(&mut x, graph);
    let mut strokes = Strokes::new(graph);
    let mut ports = Ports::default();
    let mut faults = Vec::new();
    let mut undrawn = BTreeSet::new();
    let mut point = start_point(&x, graph);
    for members in parts(graph) {
        let mut part = ConnectedPart {
            x: &mut x,
            graph,
            wanted: &wanted,
            members: &members,
            laws: BTreeMap::new(),
            kept: Vec::new(),
            near: Some(point.clone()),
        };
        match part.assign_well_conditioned(&mut strokes, &mut point) {
            Ok(solved) => {
                undrawn.extend(solved.undetermined.iter().copied());
                merge(&mut ports, solved);
            }
            Err(more) => faults.extend(more),
        }
    }
    if !faults.is_empty() {
        return Err(Diagnostics(faults));
    }
    ports.repeated = repeated;
    ports.unmet = wanted.unmet(&x, &ports);
    ports.kept = wanted.why;
    ports.ports.sort_by_key(|p| p.port);
    let mut strokes = strokes.table();
    erase(graph, &mut strokes, &undrawn);
    let causal = CausalGraph { graph: graph.with_exprs(x), strokes, ports };
    debug_assert_eq!(verify(&causal), Ok(()), "{}", graph.name);
    Ok(causal)
}

/// A connected part during assignment, with the causality chosen for some of its algebraic laws.
struct ConnectedPart<'a> {
    x: &'a mut Exprs,
    graph: &'a BondGraph,
    wanted: &'a StoragePreferences,
    members: &'a [ElementId],
    laws: BTreeMap<PortRef, PortCausality>,
    /// Junctions whose variable turned out independent without a storage.
    kept: Vec<ElementId>,
    /// Where pivots should not be small.
    near: Option<NumericPoint>,
}

/// Up to this many laws on causal loops all combinations of their causalities are tried; above, they are inverted one at a
/// time.
const TRIED_TOGETHER: usize = 8;
/// Parts with more elements than this keep the causality that propagation gives.
const TURNED_AT_MOST: usize = 600;

impl ConnectedPart<'_> {
    /// Assigns the part. Where the causality found amplifies rounding errors at the start, inputs are chosen by the size of
    /// pivots instead.
    fn assign_well_conditioned(
        &mut self,
        strokes: &mut Strokes,
        point: &mut NumericPoint,
    ) -> Result<Solved, Vec<Diagnostic>> {
        let mark = strokes.mark();
        let before = self.x.assumed();
        let solved = self.assign_with_fewest_breaks(strokes)?;
        let (graph, members) = (self.graph, self.members);
        if members.len() > TURNED_AT_MOST || contradiction::is_forced(graph, members) {
            return Ok(solved);
        }
        let cost = digits::cost(self.x, graph, &solved, point);
        if cost < digits::COSTLY {
            return Ok(solved);
        }
        self.laws.clear();
        let with_solved = self.x.assumed();
        self.x.suppose(before.clone());
        let (_, preferences) = self.solve(&Strokes::new(graph), false);
        self.x.suppose(before);
        let Some(by_size) = better_by_size(self.x, graph, members, &preferences, point, (&solved, cost)) else {
            self.x.suppose(with_solved);
            return Ok(solved);
        };
        strokes.undo(mark);
        draw_truth(graph, strokes, members, &by_size);
        Ok(by_size)
    }

    /// Assigns the part, with laws on causal loops inverted such that the fewest break variables are needed.
    fn assign_with_fewest_breaks(&mut self, strokes: &mut Strokes) -> Result<Solved, Vec<Diagnostic>> {
        let mark = strokes.mark();
        let assumed = self.x.assumed();
        let solved = self.assign(strokes)?;
        if self.members.len() > TURNED_AT_MOST || !strokes.is_complete(self.members) {
            return Ok(solved);
        }
        let table = strokes.table();
        let turnable = self.laws_on_loops(&table);
        if turnable.is_empty() {
            return Ok(solved);
        }
        let drawn: BTreeMap<PortRef, bool> =
            outer_ports(self.graph, self.members).into_iter().filter_map(|p| Some((p, strokes.at(p)?))).collect();
        self.kept = strokes.kept(self.members);
        strokes.undo(mark);
        let start = turnable.keys().map(|&p| (p, drawn[&p])).collect();
        let before = (loop_size(self.graph, &table, turned(self.graph, &turnable, &start)), start);
        let best = self.best_laws(strokes, &drawn, &turnable, before);
        strokes.undo(mark);
        self.laws = best.iter().map(|(&p, &here)| (p, causality_of(here))).collect();
        self.x.suppose(assumed);
        self.assign(strokes)
    }

    /// Invertible laws whose port signals lie on a causal loop, and whether they are linear.
    fn laws_on_loops(&mut self, table: &Table<BondId, Stroke>) -> BTreeMap<PortRef, bool> {
        let signals = signal_graph(self.graph, table);
        let looped: BTreeSet<usize> =
            break_set::cyclic_components(&signals.algebraic_successors()).into_iter().flatten().collect();
        if looped.is_empty() {
            return BTreeMap::new();
        }
        let ports = outer_ports(self.graph, self.members);
        let on_loop = |p: &PortRef| {
            let bond = self.graph.bond_of(*p);
            matches!(self.graph.elements[p.element].kind, Kind::Resistor(_) | Kind::SkewGyrator(_))
                && [NodeId::effort(bond), NodeId::flow(bond)].iter().any(|n| looped.contains(&n.index()))
        };
        let found: Vec<PortRef> = ports.into_iter().filter(on_loop).collect();
        found.into_iter().filter_map(|p| Some((p, self.linear_if_invertible(p)?))).collect()
    }

    /// Whether a law is linear; `None` if it cannot be used in both causalities.
    fn linear_if_invertible(&mut self, port: PortRef) -> Option<bool> {
        let (Kind::Resistor(laws) | Kind::SkewGyrator(laws)) = &self.graph.elements[port.element].kind else {
            return None;
        };
        let bond = &self.graph.bonds[self.graph.bond_of(port)];
        let (given, law, wanted) = match laws[port.port as usize] {
            ResistorLaw::Resistive(e) => (bond.effort, e, bond.flow),
            ResistorLaw::Conductive(f) => (bond.flow, f, bond.effort),
            ResistorLaw::Implicit(_) => return Some(true),
        };
        let given = self.x.sym(given);
        let residual = self.x.sub(given, law);
        self.x.tried(|x| x.solve_for(residual, wanted).map(|_| x.linear_in(residual, &[wanted]).is_some()))
    }

    /// The causality of laws that leaves the smallest loops, found by trial on the strokes.
    fn best_laws(
        &mut self,
        strokes: &mut Strokes,
        drawn: &BTreeMap<PortRef, bool>,
        turnable: &BTreeMap<PortRef, bool>,
        before: (Loops, Choice),
    ) -> Choice {
        let start = before.1.clone();
        let mut best = before;
        let mut consider = |choice: Choice, best: &mut (Loops, Choice)| {
            let turned = turned(self.graph, turnable, &choice);
            if let Some(size) = self.try_laws(strokes, drawn, &choice, turned)
                && size < best.0
            {
                *best = (size, choice);
            }
        };
        if turnable.len() <= TRIED_TOGETHER {
            for mask in 1..1usize << turnable.len() {
                let turned = |(i, (p, here)): (usize, (&PortRef, &bool))| (*p, *here != (mask >> i & 1 == 1));
                consider(start.iter().enumerate().map(turned).collect(), &mut best);
            }
        } else {
            for port in turnable.keys() {
                let mut choice = best.1.clone();
                choice.entry(*port).and_modify(|here| *here = !*here);
                consider(choice, &mut best);
            }
        }
        best.1
    }

    /// Break variables and signals on loops with these strokes at the laws, all else that matters as drawn before.
    fn try_laws(
        &mut self,
        strokes: &mut Strokes,
        drawn: &BTreeMap<PortRef, bool>,
        choice: &Choice,
        turned: usize,
    ) -> Option<Loops> {
        let mark = strokes.mark();
        let mut fine = contradiction::force_strokes(self.graph, strokes, self.members).is_ok();
        let is_law =
            |p: &PortRef| matches!(self.graph.elements[p.element].kind, Kind::Resistor(_) | Kind::SkewGyrator(_));
        fine = fine && strokes.keep(&self.kept).is_ok();
        fine = fine && drawn.iter().filter(|(p, _)| !is_law(p)).all(|(&p, &here)| strokes.set_at(p, here).is_ok());
        fine = fine && choice.iter().all(|(&p, &here)| strokes.set_at(p, here).is_ok());
        for (&port, &here) in drawn {
            if fine && strokes.at(port).is_none() {
                fine = strokes.set_at(port, here).is_ok() || strokes.set_at(port, !here).is_ok();
            }
        }
        fine = fine && strokes.complete(self.members).is_ok() && strokes.is_complete(self.members);
        let size = fine.then(|| loop_size(self.graph, &strokes.table(), turned));
        strokes.undo(mark);
        size
    }

    /// Assigns the part with the laws as they are preferred.
    fn assign(&mut self, strokes: &mut Strokes) -> Result<Solved, Vec<Diagnostic>> {
        let (graph, members) = (self.graph, self.members);
        strokes.release(members);
        let forced = contradiction::force_strokes(graph, strokes, members).map_err(|fault| vec![*fault])?;
        let mark = strokes.mark();
        let drawn = self.propagate(strokes);
        let plain = drawn && !forced && !self.wanted.concerns(members) && is_plain(self.x, graph, members);
        if plain && let Some((definitions, watched)) = self.x.if_found(|x| whole_truth(x, graph, members, strokes)) {
            let ports = local::roles(graph, members, &|p| strokes.at(p));
            return Ok(Solved { ports, definitions, watched, ..Solved::default() });
        }
        let (solved, _) = self.solve(strokes, forced);
        let faults = contradiction::demands(self.x, graph, &solved);
        if !faults.is_empty() {
            return Err(faults);
        }
        if !(forced && drawn) {
            strokes.undo(mark);
            draw_truth(graph, strokes, members, &solved);
            // What is undetermined has no stroke in any case.
            if forced && solved.undetermined.is_empty() && !strokes.is_complete(members) {
                return Err(vec![contradiction::leaves_no_way(graph, members)]);
            }
        } else if !solved.virtual_speeds.is_empty() {
            self.draw_kept_if_allowed(strokes, mark, &solved);
        }
        Ok(solved)
    }

    /// Draws kept variables as sources at their junctions, if the forced strokes leave room for that.
    fn draw_kept_if_allowed(&mut self, strokes: &mut Strokes, mark: usize, solved: &Solved) {
        strokes.undo(mark);
        draw_truth(self.graph, strokes, self.members, solved);
        if strokes.kept(self.members).is_empty() || !strokes.is_complete(self.members) {
            strokes.undo(mark);
            strokes.release(self.members);
            self.propagate(strokes);
        }
    }

    /// The causality of an algebraic law: the one chosen, else the one in which it is written.
    fn wish(&self, port: PortRef) -> PortCausality {
        self.laws.get(&port).copied().unwrap_or_else(|| preferred(self.graph, port))
    }
}

/// The cost of causal loops, in lexicographic order: break variables, signals on loops without a law, nonlinear laws used in
/// the inverse causality, signals on any loop.
///
/// Loops without a law are those whose determinant can vanish; dividing by it makes equations singular even where the model
/// is regular. Source: `method.md`, section 3 and 5.1.
type Loops = (usize, usize, usize, usize);

fn loop_size(graph: &BondGraph, table: &Table<BondId, Stroke>, turned: usize) -> Loops {
    let mut successors = signal_graph(graph, table).algebraic_successors();
    let size = |s: &[Vec<u32>]| break_set::cyclic_components(s).iter().map(Vec::len).sum();
    let (breaks, looped) = (break_set::count(&successors), size(&successors));
    for element in graph.elements.values().filter(|e| matches!(e.kind, Kind::Resistor(_) | Kind::SkewGyrator(_))) {
        for port in &element.ports {
            successors[NodeId::effort(port.bond).index()].clear();
            successors[NodeId::flow(port.bond).index()].clear();
        }
    }
    (breaks, size(&successors), turned, looped)
}

/// For each law whether its stroke sits at it.
type Choice = BTreeMap<PortRef, bool>;

/// Number of nonlinear laws that a choice uses in the inverse causality.
fn turned(graph: &BondGraph, linear: &BTreeMap<PortRef, bool>, choice: &Choice) -> usize {
    let against = |(p, here): &(&PortRef, &bool)| !linear[p] && causality_of(**here) != preferred(graph, **p);
    choice.iter().filter(against).count()
}

fn causality_of(here: bool) -> PortCausality {
    if here { PortCausality::Conductive } else { PortCausality::Resistive }
}

/// Variables with priority as independent ones over the order of the model.
#[derive(Default)]
struct StoragePreferences {
    independent: Vec<PortRef>,
    virtual_speeds: Vec<Virtual>,
    why: BTreeMap<Symbol, Kept>,
    /// The variables that satisfy each `prefer`.
    asked: Vec<Vec<Symbol>>,
}

impl StoragePreferences {
    /// `prefer`, then common variables of junctions whose integrals occur in moduli. Source: `method.md`, 5.2.
    fn of(x: &mut Exprs, graph: &BondGraph) -> StoragePreferences {
        let mut wanted = StoragePreferences::default();
        for preference in &graph.preferences {
            let asked = wanted.add(x, graph, preference.symbol, Kept::Preferred);
            wanted.asked.push(asked);
        }
        for symbol in integrated_in_moduli(x, graph) {
            wanted.add(x, graph, symbol, Kept::IntegralInModulus);
        }
        wanted
    }

    /// Gives a variable priority as an independent one; the symbols of which one then stays independent.
    fn add(&mut self, x: &mut Exprs, graph: &BondGraph, symbol: Symbol, why: Kept) -> Vec<Symbol> {
        let (bond, flow) = match graph.variables.get(&symbol).map(|v| v.meaning) {
            Some(Meaning::Flow(bond)) => (bond, true),
            Some(Meaning::Effort(bond)) => (bond, false),
            _ => return Vec::new(),
        };
        let ends = [graph.bonds[bond].from, graph.bonds[bond].to];
        let Some(junction) = graph.junction_of(bond, flow) else {
            let own = ends.into_iter().filter(|&p| gives(graph, p, flow));
            return own.filter_map(|port| self.keep(graph, port, why)).collect();
        };
        let own = ends.iter().copied().find(|&p| gives(graph, p, flow));
        let opposite = |bond: BondId| {
            let b = &graph.bonds[bond];
            if b.from.element == junction { b.to } else { b.from }
        };
        let neighbours = graph.elements[junction].ports.iter().map(|p| opposite(p.bond));
        match own.or_else(|| neighbours.into_iter().find(|&p| gives(graph, p, flow))) {
            Some(port) => self.keep(graph, port, why).into_iter().collect(),
            None if self.virtual_speeds.iter().any(|v| v.junction == junction) => {
                self.virtual_speeds.iter().filter(|v| v.junction == junction).map(|v| v.speed).collect()
            }
            None => {
                let (speed, reaction) = kept_variable(x, graph, junction, flow);
                self.why.insert(speed, why);
                let preferred = matches!(why, Kept::Preferred);
                self.virtual_speeds.push(Virtual { junction, speed, reaction, preferred });
                vec![speed]
            }
        }
    }

    fn keep(&mut self, graph: &BondGraph, port: PortRef, why: Kept) -> Option<Symbol> {
        let z = graph.storage_symbols(port).map(|(z, _)| z);
        if !self.independent.contains(&port) {
            self.independent.push(port);
            self.why.extend(z.map(|z| (z, why)));
        }
        z
    }

    /// The numbers of the `prefer`s that are not satisfied.
    fn unmet(&self, x: &Exprs, ports: &Ports) -> Vec<usize> {
        let own = |s: Symbol| x.untwinned(s);
        let independent = ports.ports.iter().filter(|p| p.role == Role::Independent).map(|p| p.input);
        let kept: BTreeSet<Symbol> = independent.chain(ports.virtual_speeds.iter().map(|v| v.speed)).map(own).collect();
        let missed = |asked: &[Symbol]| !asked.is_empty() && !asked.iter().any(|&s| kept.contains(&own(s)));
        (0..self.asked.len()).filter(|&i| missed(&self.asked[i])).collect()
    }

    fn concerns(&self, members: &[ElementId]) -> bool {
        let inside = |e: &ElementId| members.binary_search(e).is_ok();
        self.independent.iter().any(|p| inside(&p.element)) || self.virtual_speeds.iter().any(|v| inside(&v.junction))
    }
}

/// The common variable of a junction that stays independent, and its conjugate; as its twin where the graph has the variable
/// already.
pub(super) fn kept_variable(x: &mut Exprs, graph: &BondGraph, junction: ElementId, flow: bool) -> (Symbol, Symbol) {
    let element = &graph.elements[junction];
    let (own, conjugate) = if flow { ("f", "e") } else { ("e", "f") };
    let name = format!("{}.{own}", element.name);
    let variables = element.ports.iter().map(|p| &graph.bonds[p.bond]).map(|b| if flow { b.flow } else { b.effort });
    let speed = match x.find_symbol(&name).filter(|&s| variables.into_iter().any(|own| own == s)) {
        Some(common) => x.twin(common),
        None => x.fresh(&name, Default::default()),
    };
    (speed, x.reaction(speed, &format!("{}.{conjugate}", element.name)))
}

/// Whether a port belongs to a storage whose co-energy variable is a flow (or an effort).
fn gives(graph: &BondGraph, port: PortRef, flow: bool) -> bool {
    !is_imposed(graph, port)
        && matches!(
            (&graph.elements[port.element].kind, flow),
            (Kind::Inertance(_), true) | (Kind::Compliance(_), false)
        )
}

/// Bond variables whose integrals (as integrated signals) the moduli read.
fn integrated_in_moduli(x: &Exprs, graph: &BondGraph) -> Vec<Symbol> {
    let mut found = Vec::new();
    for element in graph.elements.values() {
        let moduli = element.kind.moduli();
        for symbol in moduli.into_iter().flat_map(|modulus| x.symbols_of(modulus)) {
            let Some(Meaning::Signal(signal)) = graph.variables.get(&symbol).map(|v| v.meaning) else { continue };
            let read = x.symbols_of(graph.signals[signal].rate);
            let bonds = |s: &Symbol| {
                matches!(graph.variables.get(s).map(|v| v.meaning), Some(Meaning::Flow(_) | Meaning::Effort(_)))
            };
            let mut read = read.into_iter();
            if let (Some(only), None) = (read.next(), read.next())
                && bonds(&only)
                && !found.contains(&only)
            {
                found.push(only);
            }
        }
    }
    found
}

impl ConnectedPart<'_> {
    /// Sequential causality assignment (SCAP). `false` if it ends in a contradiction; then the strokes are partial.
    fn propagate(&mut self, strokes: &mut Strokes) -> bool {
        let graph = self.graph;
        let ports = outer_ports(graph, self.members);
        let leading: Vec<PortRef> = ports.iter().copied().filter(|&p| self.leads(p)).collect();
        let either = |strokes: &mut Strokes, port: PortRef, here: bool| {
            strokes.at(port).is_some() || strokes.set_at(port, here).is_ok() || strokes.set_at(port, !here).is_ok()
        };
        let imposing = |p: &PortRef| imposes(graph, *p).map(|effort| (*p, !effort));
        let storage = |p: &PortRef| match &graph.elements[p.element].kind {
            _ if imposes(graph, *p).is_some() => None,
            Kind::Inertance(_) => Some((*p, sits_here(PortCausality::Integral, true))),
            Kind::Compliance(_) => Some((*p, sits_here(PortCausality::Integral, false))),
            _ => None,
        };
        ports.iter().filter_map(imposing).all(|(p, here)| strokes.set_at(p, here).is_ok())
            && ports.iter().filter_map(storage).all(|(p, here)| either(strokes, p, here))
            && self.laws.keys().all(|&p| either(strokes, p, sits_here(self.wish(p), false)))
            && leading.into_iter().all(|p| either(strokes, p, sits_here(self.wish(p), false)))
            && ports.iter().all(|&p| either(strokes, p, sits_here(self.wish(p), false)))
            && (strokes.is_complete(self.members)
                || (strokes.complete(self.members).is_ok() && strokes.is_complete(self.members)))
    }

    /// Whether a nonlinear law in its written causality determines the common variable of its junction. Such laws come first,
    /// so that other laws read a variable of their own junction, not one at the end of a causal chain.
    fn leads(&mut self, port: PortRef) -> bool {
        let (Kind::Resistor(laws) | Kind::SkewGyrator(laws)) = &self.graph.elements[port.element].kind else {
            return false;
        };
        let bond = &self.graph.bonds[self.graph.bond_of(port)];
        let other = if bond.from == port { bond.to } else { bond.from };
        let (law, read) = match (laws[port.port as usize], &self.graph.elements[other.element].kind) {
            (ResistorLaw::Resistive(e), Kind::Zero) => (e, bond.flow),
            (ResistorLaw::Conductive(f), Kind::One) => (f, bond.effort),
            _ => return false,
        };
        self.x.linear_in(law, &[read]).is_none()
    }

    /// Exact elimination, with virtual speeds that are combinations of co-energy and imposed variables; and the preferences
    /// that it used.
    fn solve(&mut self, strokes: &Strokes, forced: bool) -> (Solved, CausalityPreferences) {
        let (graph, members) = (self.graph, self.members);
        let inside = |e: ElementId| members.binary_search(&e).is_ok();
        let independent = self.wanted.independent.iter().copied().filter(|p| inside(p.element)).collect();
        let mut preferences = CausalityPreferences { independent, ..CausalityPreferences::default() };
        for port in outer_ports(graph, members) {
            match &graph.elements[port.element].kind {
                kind @ (Kind::Inertance(_) | Kind::Compliance(_)) => {
                    let integral = sits_here(PortCausality::Integral, matches!(kind, Kind::Inertance(_)));
                    if forced && strokes.at(port) == Some(!integral) {
                        preferences.derivative.push(port);
                    }
                }
                _ => {
                    let drawn = strokes.at(port).map(causality_of);
                    preferences.algebraic.insert(port, drawn.unwrap_or_else(|| self.wish(port)));
                }
            }
        }
        let before = self.x.assumed();
        let mut first = solve_part(self.x, graph, members, &preferences, self.near.as_ref());
        let reading = self.sources_of_rates(&first);
        if !reading.is_empty() {
            preferences.sources_as_laws = reading;
            self.x.suppose(before.clone());
            first = solve_part(self.x, graph, members, &preferences, self.near.as_ref());
        }
        let speeds: Vec<Virtual> = self.wanted.virtual_speeds.iter().copied().filter(|v| inside(v.junction)).collect();
        if !speeds.is_empty() {
            let mut span = Span::of(graph, &first);
            preferences.virtual_speeds = speeds.into_iter().filter(|v| span.holds(self.x, v)).collect();
            if !preferences.virtual_speeds.is_empty() {
                self.x.suppose(before);
                return (solve_part(self.x, graph, members, &preferences, self.near.as_ref()), preferences);
            }
        }
        (first, preferences)
    }

    /// Sources whose value reads the rate of a storage that they (or others) determine: `Se(1 - 2*c.f)` on the compliance `c`.
    /// Such a source imposes nothing; it is an algebraic law between effort and flow.
    fn sources_of_rates(&mut self, solved: &Solved) -> BTreeSet<PortRef> {
        let rates: BTreeSet<Symbol> =
            solved.ports.iter().filter(|p| p.role == Role::Dependent).map(|p| p.input).collect();
        let mut found = BTreeSet::new();
        if rates.is_empty() {
            return found;
        }
        let ports = Ports { definitions: solved.definitions.iter().cloned().collect(), ..Ports::default() };
        let mut known = Map::new();
        for state in solved.ports.iter().filter(|p| p.role == Role::Source) {
            let (Kind::EffortSource { value } | Kind::FlowSource { value }) =
                self.graph.elements[state.port.element].kind
            else {
                continue;
            };
            for symbol in self.x.symbols_of(value) {
                let row = ports.resolve(self.x, symbol, &mut known);
                if row.0.iter().any(|t| rates.contains(&t.0)) {
                    found.insert(state.port);
                }
            }
        }
        found
    }
}

pub(super) fn outer_ports(graph: &BondGraph, members: &[ElementId]) -> Vec<PortRef> {
    let outer = members.iter().filter(|&&m| !graph.elements[m].kind.is_inner());
    outer
        .flat_map(|&element| (0..graph.elements[element].ports.len() as u32).map(move |port| PortRef { element, port }))
        .collect()
}

/// Strokes of a part by sequential assignment alone; `None` if that ends in a contradiction.
pub(super) fn sequential(graph: &BondGraph, members: &[ElementId]) -> Option<Table<BondId, Stroke>> {
    let mut x = graph.exprs.clone();
    let wanted = StoragePreferences::default();
    let mut part = ConnectedPart {
        x: &mut x,
        graph,
        wanted: &wanted,
        members,
        laws: BTreeMap::new(),
        kept: Vec::new(),
        near: None,
    };
    let mut strokes = Strokes::new(graph);
    contradiction::force_strokes(graph, &mut strokes, members).ok()?;
    part.propagate(&mut strokes).then(|| strokes.table())
}

/// Whether a port imposes an effort (`true`) or a flow (`false`) as drawn, or neither.
pub(super) fn imposes(graph: &BondGraph, port: PortRef) -> Option<bool> {
    match graph.elements[port.element].kind {
        Kind::EffortSource { .. } | Kind::FlowDetector | Kind::ResidualEffort { .. } => Some(true),
        Kind::FlowSource { .. } | Kind::ZeroCompliance { .. } | Kind::EffortDetector | Kind::ResidualFlow { .. } => {
            Some(false)
        }
        Kind::Compliance(_) if is_imposed(graph, port) => Some(true),
        _ => None,
    }
}

/// The preferred causality of an algebraic law: the one in which it is written.
pub(super) fn preferred(graph: &BondGraph, port: PortRef) -> PortCausality {
    match &graph.elements[port.element].kind {
        Kind::Resistor(laws) | Kind::SkewGyrator(laws) => match laws[port.port as usize] {
            ResistorLaw::Conductive(_) => PortCausality::Conductive,
            _ => PortCausality::Resistive,
        },
        _ => PortCausality::Resistive,
    }
}

/// Whether the part has nothing that requires exact elimination: residual sinks, matrices, or moduli that vanish.
fn is_plain(x: &mut Exprs, graph: &BondGraph, members: &[ElementId]) -> bool {
    members.iter().all(|&m| match graph.elements[m].kind {
        Kind::ResidualEffort { .. } | Kind::ResidualFlow { .. } => false,
        Kind::MatrixTransformer(_) | Kind::MatrixGyrator(_) => false,
        Kind::Transformer { modulus } | Kind::Gyrator { modulus } => {
            let (over, under) = x.over_and_under(modulus);
            !x.is_zero_given(over) && !x.is_zero_given(under)
        }
        _ => true,
    })
}

/// Whether the value of a source reads efforts or flows.
fn reads_bonds(x: &Exprs, graph: &BondGraph, element: ElementId) -> bool {
    let (Kind::EffortSource { value } | Kind::FlowSource { value }) = graph.elements[element].kind else {
        return false;
    };
    x.depends_on_any(value, &|s| {
        matches!(graph.variables.get(&s).map(|v| v.meaning), Some(Meaning::Effort(_) | Meaning::Flow(_)))
    })
}

/// The definitions that the strokes imply, where they are exact: on trees, and on parts with rings in which all storages are
/// in integral causality and no causal loop exists.
fn whole_truth(
    x: &mut Exprs,
    graph: &BondGraph,
    members: &[ElementId],
    strokes: &Strokes,
) -> Option<local::Definitions> {
    let bonds: usize = members.iter().map(|&m| graph.elements[m].ports.len()).sum::<usize>() / 2;
    let tree = bonds + 1 == members.len();
    let sensing = members.iter().any(|&m| reads_bonds(x, graph, m));
    if (!tree || sensing) && local::roles(graph, members, &|p| strokes.at(p)).iter().any(|p| p.role == Role::Dependent)
    {
        return None;
    }
    let (definitions, divisors) = local::definitions(x, graph, members, &|p| strokes.at(p), &[]);
    (tree || is_triangular(&definitions)).then_some((definitions, divisors))
}

/// Whether the definitions are acyclic.
pub(super) fn is_triangular(definitions: &[(Symbol, Combination)]) -> bool {
    let index: BTreeMap<Symbol, usize> = definitions.iter().enumerate().map(|(i, d)| (d.0, i)).collect();
    let mut waits = vec![0usize; definitions.len()];
    let mut readers: Vec<Vec<usize>> = vec![Vec::new(); definitions.len()];
    for (i, (_, combination)) in definitions.iter().enumerate() {
        for read in combination.0.iter().filter_map(|t| index.get(&t.0)) {
            waits[i] += 1;
            readers[*read].push(i);
        }
    }
    let mut ready: Vec<usize> = (0..definitions.len()).filter(|&i| waits[i] == 0).collect();
    let mut done = 0;
    while let Some(i) = ready.pop() {
        done += 1;
        for &reader in &readers[i] {
            waits[reader] -= 1;
            if waits[reader] == 0 {
                ready.push(reader);
            }
        }
    }
    done == definitions.len()
}

/// What co-energy variables and imposed variables span.
struct Span<'a> {
    graph: &'a BondGraph,
    ports: Ports,
    /// Roles of ports by the variables that they are given.
    roles: BTreeMap<Symbol, Role>,
    shares: Map<Symbol, Option<Shares>>,
    known: Map<Symbol, Combination>,
}

/// Sums of what a variable is made of, coefficients times random numbers: one vanishes only if there is nothing of its kind.
#[derive(Clone, Copy)]
struct Shares {
    independent: Residue,
    /// What neither independent storages nor sources give.
    others: Residue,
}

impl<'a> Span<'a> {
    fn of(graph: &'a BondGraph, solved: &Solved) -> Span<'a> {
        Span {
            graph,
            ports: Ports { definitions: solved.definitions.iter().cloned().collect(), ..Ports::default() },
            roles: solved.ports.iter().map(|p| (p.input, p.role)).collect(),
            shares: Map::new(),
            known: Map::new(),
        }
    }

    /// Whether the common variable of a junction is a combination of them, not of imposed variables alone.
    fn holds(&mut self, x: &mut Exprs, speed: &Virtual) -> bool {
        let junction = &self.graph.elements[speed.junction];
        let bond = &self.graph.bonds[junction.ports[0].bond];
        let common = if matches!(junction.kind, Kind::One) { bond.flow } else { bond.effort };
        if let Some(shares) = self.shares_of(x, common) {
            return shares.others.vanishes() && !shares.independent.vanishes();
        }
        let row = self.ports.resolve(x, common, &mut self.known);
        let roles: Option<Vec<Role>> = row.0.iter().map(|t| self.roles.get(&t.0).copied()).collect();
        let spanning = |role: &Role| matches!(role, Role::Independent | Role::Source | Role::Redundant);
        roles.is_some_and(|roles| roles.iter().all(spanning) && roles.contains(&Role::Independent))
    }

    /// What a variable is made of; `None` if coefficients have no values in the prime field. Its row, which in a chain is as
    /// long as the way to the ground, is not written out.
    fn shares_of(&mut self, x: &Exprs, symbol: Symbol) -> Option<Shares> {
        let mut open = vec![symbol];
        while let Some((next, definition)) = self.ports.next_to_resolve(&mut open, |s| self.shares.contains_key(s)) {
            let mut sum = Some(Shares { independent: Residue::ZERO, others: Residue::ZERO });
            for &(s, coefficient) in &definition.0 {
                let own = self.shares.get(&s).copied().unwrap_or_else(|| Some(self.shares_of_input(s)));
                sum = sum.zip(own).zip(x.residue(coefficient)).map(|((sum, own), factor)| Shares {
                    independent: sum.independent + factor * own.independent,
                    others: sum.others + factor * own.others,
                });
            }
            self.shares.insert(next, sum);
        }
        self.shares.get(&symbol).copied().unwrap_or_else(|| Some(self.shares_of_input(symbol)))
    }

    fn shares_of_input(&self, symbol: Symbol) -> Shares {
        let (own, none) = (Residue::random(u64::from(symbol.0)), Residue::ZERO);
        match self.roles.get(&symbol) {
            Some(Role::Independent) => Shares { independent: own, others: none },
            Some(Role::Source | Role::Redundant) => Shares { independent: none, others: none },
            _ => Shares { independent: none, others: own },
        }
    }
}

/// Strokes from the exact causality of the ports; bonds that it leaves open are completed by a matching.
fn draw_truth(graph: &BondGraph, strokes: &mut Strokes, members: &[ElementId], solved: &Solved) {
    for &symbol in &solved.undetermined {
        if let Some(Meaning::Effort(bond) | Meaning::Flow(bond)) = graph.variables.get(&symbol).map(|v| v.meaning)
            && is_inner_bond(graph, bond)
        {
            strokes.leave_out(bond);
        }
    }
    strokes.release(members);
    let kept: Vec<ElementId> = solved.virtual_speeds.iter().map(|v| v.junction).collect();
    let _ = strokes.keep(&kept);
    for state in &solved.ports {
        let inertance = matches!(graph.elements[state.port.element].kind, Kind::Inertance(_));
        let here = match (imposes(graph, state.port), state.role) {
            // A source whose value depends on its own variable is a law, and has the stroke of one.
            (_, Role::Algebraic(causality)) => sits_here(causality, false),
            (Some(effort), _) => !effort,
            (None, Role::Independent) => sits_here(PortCausality::Integral, inertance),
            (None, Role::Dependent) => sits_here(PortCausality::Derivative, inertance),
            (None, Role::Source | Role::Redundant) => continue,
        };
        // Where a flow circulates, strokes cannot always show the causality of the ports.
        let _ = strokes.set_at(state.port, here);
    }
    let _ = strokes.complete(members);
}

fn is_inner_bond(graph: &BondGraph, bond: BondId) -> bool {
    let bond = &graph.bonds[bond];
    [bond.from, bond.to].iter().all(|p| graph.elements[p.element].kind.is_inner())
}

/// Bonds whose effort or flow is undetermined have no stroke, those at sources excepted.
fn erase(graph: &BondGraph, strokes: &mut Table<BondId, Stroke>, undetermined: &BTreeSet<Symbol>) {
    for (id, bond) in graph.bonds.iter() {
        if is_inner_bond(graph, id) && (undetermined.contains(&bond.effort) || undetermined.contains(&bond.flow)) {
            strokes[id] = Stroke::Undetermined;
        }
    }
}

fn merge(ports: &mut Ports, solved: Solved) {
    ports.ports.extend(solved.ports);
    ports.definitions.extend(solved.definitions);
    ports.loops.extend(solved.loops);
    ports.watched.extend(solved.watched);
    ports.degenerate.extend(solved.degenerate);
    ports.undetermined.extend(solved.undetermined);
    ports.virtual_speeds.extend(solved.virtual_speeds);
    ports.demands.extend(solved.demands);
}
