//! The directed graph of signals: two a bond, an edge from what an element reads to what it sets.
//!
//! It follows the drawn strokes. Storages cut it where they are drawn in integral causality; their edges are kept, by
//! kind, for the paths between storages. A law in inverse causality has an edge too, with its local gain.
//! Source: `method.md`, section 3.

use std::collections::BTreeMap;

use super::Stroke;
use super::two_ports::{self, Given};
use crate::algebra::{Expr, Exprs, Symbol};
use crate::bond_graph::{
    BondGraph, BondId, Element, ElementId, Kind, Meaning, Port, PortRef, ResistorLaw, Storage, StorageLaw, TwoPortRow,
};
use crate::ids::{Id, Table, id};

id!(
    /// A signal: effort (`2 b`) or flow (`2 b + 1`) of bond `b`.
    NodeId
);

/// The directed graph of signals.
#[derive(Debug, Clone)]
pub struct SignalGraph {
    /// The edges, by start, then end; one at most from one node to another.
    pub edges: Vec<SignalEdge>,
    /// Where the edges of each node start in `edges`; one more at the end.
    first: Vec<u32>,
}

/// An edge: `element` reads `from` and sets `to`.
#[derive(Debug, Clone)]
pub struct SignalEdge {
    /// What is read.
    pub from: NodeId,
    /// What is set.
    pub to: NodeId,
    /// Who reads and sets.
    pub element: ElementId,
    /// What kind of reading it is.
    pub kind: EdgeKind,
    /// How much of it arrives, see [`SignalGraph::gain`].
    gain: Gain,
}

/// Kinds of edges. All but the last two are algebraic.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum EdgeKind {
    /// A junction, transformer or gyrator.
    Structure,
    /// An algebraic law between the variables of one port.
    Law,
    /// An algebraic law from one port of a field to another.
    Across,
    /// A law, value or modulus that reads a variable of another element.
    Modulation,
    /// A storage in derivative causality: what is set is the time derivative of what is read.
    Derivative,
    /// A storage in integral causality: what is set is the time integral of what is read.
    Integral,
}

/// How to make the gain of an edge; the expressions themselves are made only when asked for.
#[derive(Debug, Clone, PartialEq)]
enum Gain {
    Plus,
    Minus,
    /// `m`.
    Modulus(Expr),
    /// `1/m`.
    Inverse(Expr),
    /// `d(m)/d(read) * by`, or `d(1/m)/d(read) * by`.
    ModulusSlope {
        modulus: Expr,
        inverse: bool,
        read: Symbol,
        by: Symbol,
    },
    /// What `relation` makes of `read` in `set`.
    Slope {
        relation: Relation,
        set: Symbol,
        read: Symbol,
    },
    /// One after the other.
    Product(Vec<Gain>),
    /// Side by side.
    Sum(Vec<Gain>),
}

/// `output = expr`, or `0 = expr`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Relation {
    output: Option<Symbol>,
    expr: Expr,
}

impl NodeId {
    /// The effort of a bond.
    pub fn effort(bond: BondId) -> NodeId {
        NodeId(2 * bond.0)
    }
    /// The flow of a bond.
    pub fn flow(bond: BondId) -> NodeId {
        NodeId(2 * bond.0 + 1)
    }
    /// The bond.
    pub fn bond(self) -> BondId {
        BondId(self.0 / 2)
    }
    /// Whether it is the effort of its bond.
    pub fn is_effort(self) -> bool {
        self.0.is_multiple_of(2)
    }
    /// The other variable of its bond.
    pub fn conjugate(self) -> NodeId {
        NodeId(self.0 ^ 1)
    }
    /// Its symbol.
    pub fn symbol(self, graph: &BondGraph) -> Symbol {
        let bond = &graph.bonds[self.bond()];
        if self.is_effort() { bond.effort } else { bond.flow }
    }
}

impl EdgeKind {
    /// Whether what is set follows at once from what is read.
    pub fn is_algebraic(self) -> bool {
        !matches!(self, EdgeKind::Derivative | EdgeKind::Integral)
    }
}

/// The directed graph of signals of a graph with strokes. Bonds without a stroke have no edges. Linear time.
pub fn signal_graph(graph: &BondGraph, strokes: &Table<BondId, Stroke>) -> SignalGraph {
    let mut builder = Builder { graph, strokes, edges: Vec::with_capacity(6 * graph.bonds.len()) };
    for (id, element) in graph.elements.iter() {
        builder.element(id, element);
    }
    SignalGraph::new(merge(builder.edges), 2 * graph.bonds.len())
}

impl SignalGraph {
    fn new(edges: Vec<SignalEdge>, nodes: usize) -> SignalGraph {
        let mut first = vec![0; nodes + 1];
        for edge in &edges {
            first[edge.from.index() + 1] += 1;
        }
        for node in 0..nodes {
            first[node + 1] += first[node];
        }
        SignalGraph { edges, first }
    }

    /// Number of signals, two a bond.
    pub fn node_count(&self) -> usize {
        self.first.len() - 1
    }

    /// The edges that leave a signal.
    pub fn edges_from(&self, node: NodeId) -> &[SignalEdge] {
        &self.edges[self.first[node.index()] as usize..self.first[node.index() + 1] as usize]
    }

    /// The edge between two signals, if there is one.
    pub fn edge(&self, from: NodeId, to: NodeId) -> Option<&SignalEdge> {
        let edges = self.edges_from(from);
        edges.binary_search_by_key(&to, |edge| edge.to).ok().map(|at| &edges[at])
    }

    /// The algebraic edges as lists of successors, by index of the signal.
    pub fn algebraic_successors(&self) -> Vec<Vec<u32>> {
        let heads = |node| {
            let edges = self.edges_from(NodeId::new(node)).iter();
            edges.filter(|edge| edge.kind.is_algebraic()).map(|edge| edge.to.0).collect()
        };
        (0..self.node_count()).map(heads).collect()
    }

    /// The priority of each signal as a break variable, 0 first: outputs of resistors, then common variables of junctions,
    /// then the others.
    pub fn break_ranks(&self) -> Vec<u8> {
        let mut ranks = vec![2; self.node_count()];
        for edge in &self.edges {
            match edge.kind {
                EdgeKind::Structure
                    if matches!(edge.gain, Gain::Plus) && edge.from.is_effort() == edge.to.is_effort() =>
                {
                    let rank = &mut ranks[edge.from.index()];
                    *rank = (*rank).min(1);
                }
                EdgeKind::Law | EdgeKind::Across => ranks[edge.to.index()] = 0,
                _ => {}
            }
        }
        ranks
    }

    /// The gain of an edge: of a linear element its parameter or modulus, else the local slope. Not simplified.
    ///
    /// Orders in time are left out: the gain of a storage is that between its stored quantity and its co-energy.
    pub fn gain(&self, edge: &SignalEdge, exprs: &mut Exprs) -> Expr {
        edge.gain.expr(exprs)
    }
}

impl Gain {
    fn expr(&self, exprs: &mut Exprs) -> Expr {
        match self {
            Gain::Plus => exprs.int(1),
            Gain::Minus => exprs.int(-1),
            Gain::Modulus(m) => *m,
            Gain::Inverse(m) => {
                let (over, under) = exprs.over_and_under(*m);
                exprs.div(under, over)
            }
            Gain::ModulusSlope { modulus, inverse, read, by } => {
                let slope = modulus_slope(*modulus, *inverse, *read, exprs);
                let by = exprs.sym(*by);
                exprs.mul(&[slope, by])
            }
            Gain::Slope { relation, set, read } => relation.slope(*set, *read, exprs),
            Gain::Product(gains) => {
                let factors: Vec<Expr> = gains.iter().map(|gain| gain.expr(exprs)).collect();
                exprs.mul(&factors)
            }
            Gain::Sum(gains) => {
                let terms: Vec<Expr> = gains.iter().map(|gain| gain.expr(exprs)).collect();
                exprs.add(&terms)
            }
        }
    }
}

fn modulus_slope(modulus: Expr, inverse: bool, read: Symbol, exprs: &mut Exprs) -> Expr {
    let value = if inverse { Gain::Inverse(modulus).expr(exprs) } else { modulus };
    exprs.derivative(value, read)
}

impl Relation {
    /// `d(set)/d(read)` with all else held.
    fn slope(self, set: Symbol, read: Symbol, exprs: &mut Exprs) -> Expr {
        let reading = self.residual_slope(read, exprs);
        let setting = self.residual_slope(set, exprs);
        let quotient = exprs.div(reading, setting);
        exprs.neg(quotient)
    }

    /// Slope of `output - expr`, or of `expr`.
    fn residual_slope(self, symbol: Symbol, exprs: &mut Exprs) -> Expr {
        let slope = exprs.derivative(self.expr, symbol);
        match self.output {
            None => slope,
            Some(output) if output == symbol => {
                let one = exprs.int(1);
                exprs.sub(one, slope)
            }
            Some(_) => exprs.neg(slope),
        }
    }

    fn symbols(self, exprs: &Exprs) -> Vec<Symbol> {
        let mut symbols: Vec<Symbol> = exprs.symbols_of(self.expr).into_iter().chain(self.output).collect();
        symbols.sort_unstable();
        symbols.dedup();
        symbols
    }
}

/// One edge for each pair of signals; the gains of parallel ones add up.
fn merge(mut edges: Vec<SignalEdge>) -> Vec<SignalEdge> {
    edges.sort_by_key(|edge| (edge.from, edge.to, edge.kind));
    let mut merged: Vec<SignalEdge> = Vec::with_capacity(edges.len());
    for edge in edges {
        match merged.last_mut() {
            Some(last) if (last.from, last.to) == (edge.from, edge.to) => last.join(edge),
            _ => merged.push(edge),
        }
    }
    merged
}

impl SignalEdge {
    /// Adds a parallel edge. Kinds are in ascending order: the algebraic part of a mixed pair is the one that counts.
    fn join(&mut self, other: SignalEdge) {
        if other.kind.is_algebraic() != self.kind.is_algebraic() {
            return;
        }
        match &mut self.gain {
            Gain::Sum(gains) => gains.push(other.gain),
            gain => *gain = Gain::Sum(vec![gain.clone(), other.gain]),
        }
    }
}

/// A signal that an expression reads, directly or through what stands between.
struct Reading {
    node: NodeId,
    /// The symbol in the expression.
    symbol: Symbol,
    /// From the signal to the symbol.
    links: Vec<Gain>,
}

struct Builder<'a> {
    graph: &'a BondGraph,
    strokes: &'a Table<BondId, Stroke>,
    edges: Vec<SignalEdge>,
}

impl Builder<'_> {
    fn element(&mut self, id: ElementId, element: &Element) {
        match &element.kind {
            Kind::Zero => self.junction(id, &element.ports, true),
            Kind::One => self.junction(id, &element.ports, false),
            Kind::Transformer { modulus } => self.transformer(id, &element.ports, *modulus),
            Kind::Gyrator { modulus } => self.gyrator(id, &element.ports, *modulus),
            Kind::MatrixTransformer(_) | Kind::MatrixGyrator(_) => {
                self.wide_two_port(id, &element.ports, &element.kind.two_port_rows());
            }
            Kind::Resistor(laws) | Kind::SkewGyrator(laws) => self.resistor(id, &element.ports, laws),
            Kind::Inertance(storage) => self.storage(id, element, storage),
            Kind::Compliance(storage) => self.storage(id, element, storage),
            Kind::EffortSource { value } => self.source(id, &element.ports[0], *value, true),
            Kind::FlowSource { value } | Kind::ZeroCompliance { flow: value } => {
                self.source(id, &element.ports[0], *value, false)
            }
            Kind::ResidualEffort { .. } | Kind::ResidualFlow { .. } | Kind::EffortDetector | Kind::FlowDetector => {}
        }
    }

    fn push(&mut self, element: ElementId, from: NodeId, to: NodeId, kind: EdgeKind, gain: Gain) {
        let drawn = |node: NodeId| self.strokes[node.bond()] != Stroke::Undetermined;
        if drawn(from) && drawn(to) {
            self.edges.push(SignalEdge { from, to, element, kind, gain });
        }
    }

    /// Whether the effort of the bond at `port` runs towards the element; `None` without a stroke.
    fn effort_in(&self, port: &Port) -> Option<bool> {
        match self.strokes[port.bond] {
            Stroke::Undetermined => None,
            Stroke::To => Some(port.inward),
            Stroke::From => Some(!port.inward),
        }
    }

    /// The variable that the element sets at a port.
    fn output(&self, port: &Port) -> Option<NodeId> {
        self.effort_in(port).map(|into| if into { NodeId::flow(port.bond) } else { NodeId::effort(port.bond) })
    }

    /// 0-junctions (`zero`) hand on one effort and add up flows, 1-junctions the other way round.
    fn junction(&mut self, id: ElementId, ports: &[Port], zero: bool) {
        let Some(master) = ports.iter().position(|port| self.effort_in(port) == Some(zero)) else { return };
        let common = |bond| if zero { NodeId::effort(bond) } else { NodeId::flow(bond) };
        let setter = &ports[master];
        for (at, port) in ports.iter().enumerate() {
            if at == master || self.effort_in(port) != Some(!zero) {
                continue;
            }
            let (from, to) = (common(setter.bond), common(port.bond));
            self.push(id, from, to, EdgeKind::Structure, Gain::Plus);
            let sign = if setter.inward == port.inward { Gain::Minus } else { Gain::Plus };
            self.push(id, to.conjugate(), from.conjugate(), EdgeKind::Structure, sign);
        }
    }

    /// `e_in = m e_out`, `f_out = m f_in`, or both inverted.
    fn transformer(&mut self, id: ElementId, ports: &[Port], modulus: Expr) {
        let (Some(into), Some(out)) = (self.effort_in(&ports[0]), self.effort_in(&ports[1])) else { return };
        if into == out {
            return;
        }
        let (near, far) = (ports[0].bond, ports[1].bond);
        let pairs = [(NodeId::effort(far), NodeId::effort(near)), (NodeId::flow(near), NodeId::flow(far))];
        for (read, set) in pairs {
            let (read, set) = if into { (set, read) } else { (read, set) };
            self.modulated(id, read, set, modulus, into);
        }
    }

    /// `e_in = r f_out`, `e_out = r f_in`, or both inverted.
    fn gyrator(&mut self, id: ElementId, ports: &[Port], modulus: Expr) {
        let (Some(into), Some(out)) = (self.effort_in(&ports[0]), self.effort_in(&ports[1])) else { return };
        if into != out {
            return;
        }
        let (near, far) = (ports[0].bond, ports[1].bond);
        let pairs = [(NodeId::flow(far), NodeId::effort(near)), (NodeId::flow(near), NodeId::effort(far))];
        for (read, set) in pairs {
            let (read, set) = if into { (set, read) } else { (read, set) };
            self.modulated(id, read, set, modulus, into);
        }
    }

    /// Sums over one side for each variable of the other, some of them solved for one of their terms.
    fn wide_two_port(&mut self, id: ElementId, ports: &[Port], rows: &[TwoPortRow]) {
        let given = two_ports::given(rows, &|port| self.effort_in(&ports[port]).map(|into| !into));
        let node = |port: usize, effort: bool| match effort {
            true => NodeId::effort(ports[port].bond),
            false => NodeId::flow(ports[port].bond),
        };
        for (row, given) in rows.iter().zip(given) {
            let own = node(row.port, row.effort);
            let (set, before) = match given {
                None => continue,
                Some(Given::Own) => (own, Vec::new()),
                Some(Given::Term(at)) => {
                    let (port, coefficient) = row.terms[at];
                    let set = node(port, row.of_efforts);
                    self.push(id, own, set, EdgeKind::Structure, Gain::Inverse(coefficient));
                    (set, vec![Gain::Minus, Gain::Inverse(coefficient)])
                }
            };
            let through = |gain: Gain| match before.is_empty() {
                true => gain,
                false => Gain::Product(before.iter().cloned().chain([gain]).collect()),
            };
            for &(port, coefficient) in &row.terms {
                let read = node(port, row.of_efforts);
                if read != set {
                    self.push(id, read, set, EdgeKind::Structure, through(Gain::Modulus(coefficient)));
                }
                let by = read.symbol(self.graph);
                for reading in self.readings_of(coefficient) {
                    let slope = Gain::ModulusSlope { modulus: coefficient, inverse: false, read: reading.symbol, by };
                    self.push(id, reading.node, set, EdgeKind::Modulation, through(reading.after(slope)));
                }
            }
        }
    }

    /// `set = modulus * read`, or `set = read / modulus`, where the modulus may read signals itself.
    fn modulated(&mut self, id: ElementId, read: NodeId, set: NodeId, modulus: Expr, inverse: bool) {
        let gain = if inverse { Gain::Inverse(modulus) } else { Gain::Modulus(modulus) };
        self.push(id, read, set, EdgeKind::Structure, gain);
        let by = read.symbol(self.graph);
        for reading in self.readings_of(modulus) {
            let slope = Gain::ModulusSlope { modulus, inverse, read: reading.symbol, by };
            self.push(id, reading.node, set, EdgeKind::Modulation, reading.after(slope));
        }
    }

    fn source(&mut self, id: ElementId, port: &Port, value: Expr, effort: bool) {
        if self.effort_in(port) != Some(!effort) {
            return;
        }
        let set = if effort { NodeId::effort(port.bond) } else { NodeId::flow(port.bond) };
        let symbol = set.symbol(self.graph);
        let relation = Relation { output: Some(symbol), expr: value };
        for reading in self.readings_of(value) {
            let slope = Gain::Slope { relation, set: symbol, read: reading.symbol };
            self.push(id, reading.node, set, EdgeKind::Modulation, reading.after(slope));
        }
    }

    fn resistor(&mut self, id: ElementId, ports: &[Port], laws: &[ResistorLaw]) {
        let relations: Vec<Relation> =
            ports.iter().zip(laws).map(|(port, law)| self.resistor_relation(port, law)).collect();
        for (port, relation) in self.setters(ports, &relations) {
            let Some(set) = self.output(&ports[port]) else { continue };
            self.law_edges(id, ports, port, set, relation);
        }
    }

    fn resistor_relation(&self, port: &Port, law: &ResistorLaw) -> Relation {
        let bond = &self.graph.bonds[port.bond];
        match *law {
            ResistorLaw::Resistive(expr) => Relation { output: Some(bond.effort), expr },
            ResistorLaw::Conductive(expr) => Relation { output: Some(bond.flow), expr },
            ResistorLaw::Implicit(expr) => Relation { output: None, expr },
        }
    }

    /// Which law sets the output of which port: a matching, each port its own law if possible.
    fn setters(&self, ports: &[Port], relations: &[Relation]) -> Vec<(usize, Relation)> {
        if let [only] = relations {
            return vec![(0, *only)];
        }
        let wants = |port: &Port| {
            let output = self.output(port).map(|node| node.symbol(self.graph));
            let holds = |r: &Relation| output.is_some_and(|output| r.symbols(&self.graph.exprs).contains(&output));
            (0..relations.len()).filter(|&law| holds(&relations[law])).collect()
        };
        let wanted: Vec<Vec<usize>> = ports.iter().map(wants).collect();
        let taken = matching(&wanted, relations.len());
        taken.iter().enumerate().filter_map(|(law, port)| port.map(|port| (port, relations[law]))).collect()
    }

    fn law_edges(&mut self, id: ElementId, ports: &[Port], port: usize, set: NodeId, relation: Relation) {
        let symbol = set.symbol(self.graph);
        for reading in self.readings(&relation, symbol) {
            let bond = reading.node.bond();
            let kind = if bond == ports[port].bond {
                EdgeKind::Law
            } else if ports.iter().any(|port| port.bond == bond) {
                EdgeKind::Across
            } else {
                EdgeKind::Modulation
            };
            let slope = Gain::Slope { relation, set: symbol, read: reading.symbol };
            self.push(id, reading.node, set, kind, reading.after(slope));
        }
    }

    fn storage(&mut self, id: ElementId, element: &Element, storage: &Storage) {
        for (port, law) in storage.laws.iter().enumerate() {
            self.storage_port(id, element, storage, port, law);
        }
    }

    fn storage_port(&mut self, id: ElementId, element: &Element, storage: &Storage, port: usize, law: &StorageLaw) {
        let place = PortRef { element: id, port: port as u32 };
        let Some((co_energy, rate)) = self.storage_nodes(place) else { return };
        let Some(integral) = self.is_integral(place) else { return };
        let stored = storage.stored[port];
        let relation = self.storage_relation(place, stored, law);
        let (set, symbol) = if integral { (co_energy, co_energy.symbol(self.graph)) } else { (rate, stored) };
        if matches!(law, StorageLaw::Known { .. }) && !integral {
            return;
        }
        for read in relation.symbols(&self.graph.exprs).into_iter().filter(|&read| read != symbol) {
            let slope = Gain::Slope { relation, set: symbol, read };
            let other = storage.stored.iter().position(|&s| s == read);
            if let (Some(other), false) = (other, matches!(law, StorageLaw::Known { .. })) {
                let Some((_, from)) = self.storage_nodes(PortRef { element: id, port: other as u32 }) else { continue };
                let kind = if integral { EdgeKind::Integral } else { EdgeKind::Across };
                self.push(id, from, set, kind, slope);
                continue;
            }
            for reading in self.reading_of_symbol(read) {
                let own = element.ports.iter().any(|port| port.bond == reading.node.bond());
                let kind = match (integral, own) {
                    (false, _) => EdgeKind::Derivative,
                    (true, true) => EdgeKind::Across,
                    (true, false) => EdgeKind::Modulation,
                };
                self.push(id, reading.node, set, kind, reading.after(slope.clone()));
            }
        }
    }

    fn storage_relation(&self, place: PortRef, stored: Symbol, law: &StorageLaw) -> Relation {
        let co_energy = self.storage_nodes(place).map(|(z, _)| z.symbol(self.graph));
        match *law {
            StorageLaw::Integral(expr) | StorageLaw::Known { law: expr, .. } => Relation { output: co_energy, expr },
            StorageLaw::Derivative(expr) => Relation { output: Some(stored), expr },
            StorageLaw::Implicit(expr) => Relation { output: None, expr },
        }
    }

    /// Co-energy variable and rate of a port of a storage.
    fn storage_nodes(&self, place: PortRef) -> Option<(NodeId, NodeId)> {
        let bond = self.graph.bond_of(place);
        match self.graph.elements[place.element].kind {
            Kind::Inertance(_) => Some((NodeId::flow(bond), NodeId::effort(bond))),
            Kind::Compliance(_) => Some((NodeId::effort(bond), NodeId::flow(bond))),
            _ => None,
        }
    }

    fn is_integral(&self, place: PortRef) -> Option<bool> {
        let port = &self.graph.elements[place.element].ports[place.port as usize];
        let set = self.output(port)?;
        self.storage_nodes(place).map(|(co_energy, _)| set == co_energy)
    }

    fn readings(&self, relation: &Relation, set: Symbol) -> Vec<Reading> {
        let symbols = relation.symbols(&self.graph.exprs).into_iter().filter(|&read| read != set);
        symbols.flat_map(|read| self.reading_of_symbol(read)).collect()
    }

    fn readings_of(&self, expr: Expr) -> Vec<Reading> {
        let symbols = self.graph.exprs.symbols_of(expr);
        symbols.into_iter().flat_map(|symbol| self.reading_of_symbol(symbol)).collect()
    }

    fn reading_of_symbol(&self, symbol: Symbol) -> Vec<Reading> {
        let mut found = Vec::new();
        self.follow(symbol, symbol, &mut Vec::new(), &mut Vec::new(), &mut found);
        found
    }

    /// Follows a symbol to the bond variables that it depends on without delay.
    fn follow(
        &self,
        symbol: Symbol,
        top: Symbol,
        links: &mut Vec<Gain>,
        seen: &mut Vec<Symbol>,
        found: &mut Vec<Reading>,
    ) {
        let Some(variable) = self.graph.variables.get(&symbol) else { return };
        if seen.contains(&symbol) {
            return;
        }
        let mut end = |node| found.push(Reading { node, symbol: top, links: links.clone() });
        match variable.meaning {
            Meaning::Effort(bond) => end(NodeId::effort(bond)),
            Meaning::Flow(bond) => end(NodeId::flow(bond)),
            Meaning::Rate(of) => match self.graph.variables.get(&of).map(|v| v.meaning) {
                Some(Meaning::Stored(place)) => {
                    if let Some((_, rate)) = self.storage_nodes(place) {
                        end(rate);
                    }
                }
                Some(Meaning::Signal(signal)) => {
                    let relation = Relation { output: Some(symbol), expr: self.graph.signals[signal].rate };
                    self.follow_relation(relation, symbol, top, links, seen, found);
                }
                _ => {}
            },
            Meaning::Stored(place) => {
                if let Some(relation) = self.algebraic_stored(place, symbol) {
                    self.follow_relation(relation, symbol, top, links, seen, found);
                }
            }
            Meaning::Time | Meaning::Parameter(_) | Meaning::Input(_) | Meaning::Signal(_) | Meaning::Held(_) => {}
        }
    }

    fn follow_relation(
        &self,
        relation: Relation,
        set: Symbol,
        top: Symbol,
        links: &mut Vec<Gain>,
        seen: &mut Vec<Symbol>,
        found: &mut Vec<Reading>,
    ) {
        seen.push(set);
        for read in relation.symbols(&self.graph.exprs).into_iter().filter(|&read| read != set) {
            links.push(Gain::Slope { relation, set, read });
            self.follow(read, top, links, seen, found);
            links.pop();
        }
        seen.pop();
    }

    /// How a stored quantity follows at once from signals: known displacements, and storages in derivative causality.
    fn algebraic_stored(&self, place: PortRef, stored: Symbol) -> Option<Relation> {
        let (Kind::Inertance(storage) | Kind::Compliance(storage)) = &self.graph.elements[place.element].kind else {
            return None;
        };
        match &storage.laws[place.port as usize] {
            StorageLaw::Known { displacement, .. } => Some(Relation { output: Some(stored), expr: *displacement }),
            law => (self.is_integral(place) == Some(false)).then(|| self.storage_relation(place, stored, law)),
        }
    }
}

impl Reading {
    /// The gain from the signal through the links to what `slope` sets.
    fn after(&self, slope: Gain) -> Gain {
        if self.links.is_empty() {
            return slope;
        }
        Gain::Product(std::iter::once(slope).chain(self.links.iter().cloned()).collect())
    }
}

/// A maximum matching of takers to `n` things, by the things that each admits; entry `i` is the taker of thing `i`.
fn matching(wanted: &[Vec<usize>], n: usize) -> Vec<Option<usize>> {
    let mut got = vec![None; n];
    for taker in 0..wanted.len() {
        if wanted[taker].contains(&taker) && got[taker].is_none() {
            got[taker] = Some(taker);
        }
    }
    for taker in 0..wanted.len() {
        if !got.contains(&Some(taker)) {
            give(taker, wanted, &mut got, &mut BTreeMap::new());
        }
    }
    got
}

fn give(taker: usize, wanted: &[Vec<usize>], got: &mut [Option<usize>], tried: &mut BTreeMap<usize, ()>) -> bool {
    for &thing in &wanted[taker] {
        if tried.insert(thing, ()).is_some() {
            continue;
        }
        if got[thing].is_none_or(|other| give(other, wanted, got, tried)) {
            got[thing] = Some(taker);
            return true;
        }
    }
    false
}
