//! The causality of ports by exact elimination. Source: `method.md`, 5.1.

use std::collections::{BTreeMap, BTreeSet};

use super::matched::{Block, BlockRows, block_rows, matched_rows};
use super::{Combination, LoopRows, PortState, Role, Terms};
use crate::algebra::{
    Assumptions, Coefficients, Elimination, Eliminator, Expr, Exprs, NumericPoint, ONE, SparseRow, Symbol,
    back_substitute, eliminate,
};
use crate::bond_graph::{BondGraph, ElementId, Kind, PortCausality, PortRef};

/// Preferences and conditions for the elimination, beyond the graph itself.
#[derive(Debug, Clone, Default)]
pub struct CausalityPreferences {
    /// Storages that become dependent in preference to others (drawn in derivative causality).
    pub derivative: Vec<PortRef>,
    /// Preferred causality of algebraic ports.
    pub algebraic: BTreeMap<PortRef, PortCausality>,
    /// Sources treated as laws between effort and flow, since their values depend on the variables that they impose.
    pub sources_as_laws: BTreeSet<PortRef>,
    /// Storages that stay independent, with the highest priority.
    pub independent: Vec<PortRef>,
    /// Common variables of junctions that stay independent although no storage has them as co-energy variable.
    pub virtual_speeds: Vec<Virtual>,
    /// Constraints that repeat others, each with whether its effort (or its flow) is taken as zero.
    pub dropped: BTreeMap<PortRef, bool>,
    /// Storages give their rate rather than their co-energy variable: derivative causality is preferred.
    pub derivative_first: bool,
}

/// A variable that is independent without a storage: a storage of value zero stands for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Virtual {
    /// The 1-junction (flow) or 0-junction (effort).
    pub junction: ElementId,
    /// Symbol of the common variable.
    pub speed: Symbol,
    /// Symbol of the conjugate, which vanishes.
    pub reaction: Symbol,
    /// Whether the modeller prefers it; then it stands in the order of what is preferred.
    pub preferred: bool,
}

/// The solved part of the junction structure.
#[derive(Debug, Default)]
pub struct Solved {
    /// The ports with their roles, in order.
    pub ports: Vec<PortState>,
    /// The virtual speeds that turned out independent.
    pub virtual_speeds: Vec<Virtual>,
    /// Triangular definitions, as short as the elements write them where that can be.
    pub definitions: Vec<(Symbol, Combination)>,
    /// Loops of definitions, each as the elements write it.
    pub loops: Vec<LoopRows>,
    /// Relations among source variables alone that the structure implies: each `Σ = 0` with minimal support.
    pub demands: Vec<Combination>,
    /// Divisors to be guarded during a run.
    pub watched: Vec<Expr>,
    /// Entries that vanish at the given parameters only.
    pub degenerate: Vec<Expr>,
    /// Variables that are not determined.
    pub undetermined: Vec<Symbol>,
}

impl Solved {
    /// Whether no fewer variables are determined than by another solution, and no fewer are independent. At a point where
    /// a modulus vanishes one that is chosen there may have less.
    pub fn tells_as_much_as(&self, other: &Solved) -> bool {
        let independent = |solved: &Solved| {
            let storages = solved.ports.iter().filter(|p| p.role == Role::Independent).count();
            storages + solved.virtual_speeds.len()
        };
        self.undetermined.len() <= other.undetermined.len() && independent(self) >= independent(other)
    }
}

/// Which of effort and flow.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Which {
    Effort,
    Flow,
}

/// What an element imposes on the junction structure, in classes of priority.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Offer {
    /// A variable is imposed.
    Imposed(Which),
    /// A storage with this co-energy variable.
    Storage(Which),
    /// A law that admits either variable as input, perhaps with a preference.
    Law,
    /// A storage of value zero.
    Virtual(Which),
}

impl Offer {
    /// A storage that gives its rate.
    fn in_derivative_causality(self) -> Offer {
        match self {
            Offer::Storage(Which::Effort) => Offer::Storage(Which::Flow),
            Offer::Storage(Which::Flow) => Offer::Storage(Which::Effort),
            other => other,
        }
    }
}

/// A port of the junction structure, with the columns of its variables; a virtual speed is on no port of an element.
pub(super) struct NetPort {
    pub port: Option<PortRef>,
    pub effort: usize,
    pub flow: usize,
    pub offer: Offer,
}

/// How definitions are written.
pub(super) enum Way {
    /// As short as the elements write them where that can be, else loop by loop where that is shorter; with what was assumed
    /// before the elimination.
    Short(Assumptions),
    /// As short as the elements write them where that can be.
    BySize,
    /// As elimination leaves them.
    Eliminated,
}

/// The rows of a junction structure.
pub(super) struct Net {
    pub symbols: Vec<Symbol>,
    column: BTreeMap<Symbol, usize>,
    pub rows: Vec<SparseRow>,
    pub ports: Vec<NetPort>,
    /// Columns of bonds between junctions and two-ports.
    pub inner: Vec<usize>,
}

/// Parts with more elements than this are solved by the roles of their ports alone, if they can be: elimination fills the
/// rows of a chain in.
const LARGE: usize = 600;
/// Loops of more variables than this, solved one by one, take more operations than what elimination leaves of them, which
/// knows their common divisors. Parts with such loops are eliminated up to a larger size.
const LONG_LOOP: usize = 8;
const LARGE_WITH_LONG_LOOPS: usize = 1500;
/// As many elements a wide two-port counts for.
const WIDE: usize = 60;

/// Solves the junction structure of one connected part. Definitions are as short as the elements write them where that
/// can be. Pivots of large loops are such as are not small at `point`.
pub fn solve_part(
    x: &mut Exprs,
    graph: &BondGraph,
    members: &[ElementId],
    preferences: &CausalityPreferences,
    point: Option<&NumericPoint>,
) -> Solved {
    let before = x.assumed();
    let net = Net::new(x, graph, members, preferences);
    let wide = |e: &&ElementId| matches!(graph.elements[**e].kind, Kind::MatrixTransformer(_) | Kind::MatrixGyrator(_));
    let wide = members.iter().filter(wide).count();
    if members.len() + WIDE * wide > LARGE
        && let Some(solved) = net.solved_by_roles(x, preferences, point)
    {
        let long = solved.loops.iter().any(|rows| rows.len() > LONG_LOOP);
        if !long || wide > 0 || members.len() > LARGE_WITH_LONG_LOOPS {
            return solved;
        }
        x.suppose(before.clone());
    }
    net.solved_exactly(x, preferences, before)
}

/// The same, with definitions as elimination leaves them: by fewer variables, and longer.
pub fn solve_part_at_length(
    x: &mut Exprs,
    graph: &BondGraph,
    members: &[ElementId],
    preferences: &CausalityPreferences,
) -> Solved {
    let net = Net::new(x, graph, members, preferences);
    let (done, outputs) = net.eliminated(x, preferences);
    net.solved(x, done, &outputs, preferences, Way::Eliminated)
}

impl NetPort {
    pub fn column(&self, effort: bool) -> usize {
        if effort { self.effort } else { self.flow }
    }
    /// The column of the variable that the element imposes in its preferred causality.
    pub fn given(&self) -> usize {
        match self.offer {
            Offer::Imposed(which) | Offer::Storage(which) | Offer::Virtual(which) => {
                self.column(which == Which::Effort)
            }
            Offer::Law => self.effort,
        }
    }
    pub fn conjugate(&self) -> usize {
        self.effort + self.flow - self.given()
    }
    /// The column of the conjugate, which the structure determines.
    pub fn output(&self, role: Role) -> usize {
        match role {
            Role::Source | Role::Redundant | Role::Independent => self.conjugate(),
            Role::Dependent => self.given(),
            Role::Algebraic(causality) => self.column(causality == PortCausality::Conductive),
        }
    }
}

impl Net {
    pub fn new(x: &mut Exprs, graph: &BondGraph, members: &[ElementId], preferences: &CausalityPreferences) -> Net {
        let mut net = Net {
            symbols: Vec::new(),
            column: BTreeMap::new(),
            rows: Vec::new(),
            ports: Vec::new(),
            inner: Vec::new(),
        };
        let one = x.int(1);
        let minus = x.int(-1);
        for &element in members {
            if !graph.elements[element].kind.is_inner() {
                net.add_ports(x, graph, element, one, minus, preferences);
            }
        }
        let outer = net.symbols.len();
        for &element in members {
            let speed = preferences.virtual_speeds.iter().find(|v| v.junction == element);
            net.add_rows(x, graph, element, one, minus, speed);
        }
        let virtuals: Vec<usize> = net.ports.iter().flat_map(|p| [p.effort, p.flow]).filter(|&c| c >= outer).collect();
        net.inner = (outer..net.symbols.len()).filter(|c| !virtuals.contains(c)).collect();
        net
    }

    fn of(&mut self, symbol: Symbol) -> usize {
        let next = self.symbols.len();
        *self.column.entry(symbol).or_insert_with(|| {
            self.symbols.push(symbol);
            next
        })
    }

    /// Columns of the ports of an element. Where two elements meet on one bond the second gets variables of its own.
    fn add_ports(
        &mut self,
        x: &mut Exprs,
        graph: &BondGraph,
        element: ElementId,
        one: Expr,
        minus: Expr,
        preferences: &CausalityPreferences,
    ) {
        for (index, port) in graph.elements[element].ports.iter().enumerate() {
            let bond = &graph.bonds[port.bond];
            let (mut effort, mut flow) = (bond.effort, bond.flow);
            if self.column.contains_key(&effort) {
                (effort, flow) = (x.twin(effort), x.twin(flow));
                for (own, common) in [(effort, bond.effort), (flow, bond.flow)] {
                    let mut row = vec![(self.of(own), one), (self.of(common), minus)];
                    row.sort_by_key(|e| e.0);
                    self.rows.push(SparseRow(row));
                }
            }
            let port = PortRef { element, port: index as u32 };
            let law = preferences.sources_as_laws.contains(&port);
            let offer = match preferences.dropped.get(&port) {
                Some(true) => Offer::Imposed(Which::Effort),
                Some(false) => Offer::Imposed(Which::Flow),
                None if law => Offer::Law,
                None => offer(graph, port),
            };
            let offer = if preferences.derivative_first { offer.in_derivative_causality() } else { offer };
            let (effort, flow) = (self.of(effort), self.of(flow));
            self.ports.push(NetPort { port: Some(port), effort, flow, offer });
        }
    }

    /// Rows of a junction or two-port.
    fn add_rows(
        &mut self,
        x: &mut Exprs,
        graph: &BondGraph,
        element: ElementId,
        one: Expr,
        minus: Expr,
        speed: Option<&Virtual>,
    ) {
        let ports = &graph.elements[element].ports;
        let mut columns: Vec<(usize, usize, Expr)> = Vec::with_capacity(ports.len() + 1);
        for port in ports {
            let bond = &graph.bonds[port.bond];
            columns.push((self.of(bond.effort), self.of(bond.flow), if port.inward { one } else { minus }));
        }
        match graph.elements[element].kind {
            Kind::Zero => {
                if let Some(v) = speed {
                    let (effort, flow) = (self.of(v.speed), self.of(v.reaction));
                    self.ports.push(NetPort { port: None, effort, flow, offer: Offer::Virtual(Which::Effort) });
                    columns.push((effort, flow, minus));
                }
                self.junction(columns.iter().map(|c| (c.0, c.1, c.2)).collect(), one, minus);
            }
            Kind::One => {
                if let Some(v) = speed {
                    let (effort, flow) = (self.of(v.reaction), self.of(v.speed));
                    self.ports.push(NetPort { port: None, effort, flow, offer: Offer::Virtual(Which::Flow) });
                    columns.push((effort, flow, minus));
                }
                self.junction(columns.iter().map(|c| (c.1, c.0, c.2)).collect(), one, minus);
            }
            Kind::Transformer { modulus } => {
                let (m, under) = x.over_and_under(modulus);
                let m = x.neg(m);
                self.push(vec![(columns[0].0, under), (columns[1].0, m)]);
                self.push(vec![(columns[1].1, under), (columns[0].1, m)]);
            }
            Kind::Gyrator { modulus } => {
                let (r, under) = x.over_and_under(modulus);
                let r = x.neg(r);
                self.push(vec![(columns[0].0, under), (columns[1].1, r)]);
                self.push(vec![(columns[1].0, under), (columns[0].1, r)]);
            }
            Kind::MatrixTransformer(_) | Kind::MatrixGyrator(_) => {
                let column = |port: usize, effort: bool| if effort { columns[port].0 } else { columns[port].1 };
                for row in graph.elements[element].kind.two_port_rows() {
                    let own = (column(row.port, row.effort), one);
                    let terms = row.terms.into_iter().map(|(port, e)| (column(port, row.of_efforts), x.neg(e)));
                    let terms = std::iter::once(own).chain(terms).collect();
                    self.push(terms);
                }
            }
            _ => {}
        }
    }

    /// Rows of a junction: the first variable of each triple is common, the second ones sum to zero with their signs.
    fn junction(&mut self, columns: Vec<(usize, usize, Expr)>, one: Expr, minus: Expr) {
        for pair in columns.windows(2) {
            self.push(vec![(pair[0].0, one), (pair[1].0, minus)]);
        }
        self.push(columns.iter().map(|c| (c.1, c.2)).collect());
    }

    /// Adds a row; a bond from an element to itself would name a column twice and is refused before.
    fn push(&mut self, mut row: Vec<(usize, Expr)>) {
        row.sort_by_key(|e| e.0);
        if row.windows(2).all(|w| w[0].0 != w[1].0) {
            self.rows.push(SparseRow(row));
        }
    }

    pub fn ports_where(&self, test: impl Fn(Offer) -> bool) -> Vec<usize> {
        (0..self.ports.len()).filter(|&p| test(self.ports[p].offer)).collect()
    }

    /// Storages in descending priority as independent ones.
    pub fn storage_order(&self, preferences: &CausalityPreferences) -> Vec<usize> {
        let mut order = self.ports_where(|o| matches!(o, Offer::Storage(_) | Offer::Virtual(_)));
        let speeds = &preferences.virtual_speeds;
        let asked = |p: usize| {
            let speed = self.symbols[self.ports[p].given()];
            speeds.iter().position(|v| v.preferred && v.speed == speed).unwrap_or(speeds.len())
        };
        order.sort_by_key(|&p| match self.ports[p].port {
            None => (1, asked(p), p),
            Some(port) => match preferences.independent.iter().position(|&i| i == port) {
                Some(rank) => (0, rank, p),
                None => (2 + usize::from(preferences.derivative.contains(&port)), 0, p),
            },
        });
        order
    }

    fn combination(&self, row: &[(usize, Expr)]) -> Combination {
        let mut terms: Terms = row.iter().map(|&(c, e)| (self.symbols[c], e)).collect();
        terms.sort_by_key(|t| t.0);
        Combination(terms)
    }

    /// A column as a combination of others, by their symbols.
    pub(super) fn definition(&self, (column, row): (usize, Vec<(usize, Expr)>)) -> (Symbol, Combination) {
        (self.symbols[column], self.combination(&row))
    }

    /// A loop by its symbols.
    pub(super) fn loop_rows(&self, block: Block) -> LoopRows {
        block.into_iter().map(|(column, row)| (self.symbols[column], self.combination(&row.0))).collect()
    }

    /// The result of an elimination as roles, definitions and relations.
    pub fn solved(
        &self,
        x: &mut Exprs,
        done: Elimination,
        outputs: &BTreeMap<usize, Role>,
        preferences: &CausalityPreferences,
        way: Way,
    ) -> Solved {
        let mut used: Vec<usize> = done.rest.iter().flat_map(|row| &row.0).map(|e| e.0).collect();
        used.sort_unstable();
        used.dedup();
        let one_by_one: Vec<Vec<usize>> = used.into_iter().map(|column| vec![column]).collect();
        let demands = circuits(x, done.rest.clone(), &one_by_one);
        let demands = demands.into_iter().map(|(_, row)| self.combination(&row.0)).collect();
        let mut solved = Solved { demands, ..Solved::default() };
        self.report(done, outputs, preferences, (&mut solved, way), x);
        solved
    }

    /// Inputs and outputs of the ports, with their roles.
    pub(super) fn report_ports(
        &self,
        outputs: &BTreeMap<usize, Role>,
        preferences: &CausalityPreferences,
        solved: &mut Solved,
    ) {
        for (&p, &role) in outputs {
            let port = &self.ports[p];
            let output = port.output(role);
            let input = port.effort + port.flow - output;
            match port.port {
                Some(port) => solved.ports.push(PortState {
                    port,
                    role,
                    input: self.symbols[input],
                    output: self.symbols[output],
                }),
                None if role == Role::Independent => solved
                    .virtual_speeds
                    .extend(preferences.virtual_speeds.iter().filter(|v| v.speed == self.symbols[input])),
                // Entries that do not lead a row have been eliminated from this one.
                None => solved.definitions.push((self.symbols[input], Combination::default())),
            }
        }
    }

    fn report(
        &self,
        done: Elimination,
        outputs: &BTreeMap<usize, Role>,
        preferences: &CausalityPreferences,
        (solved, way): (&mut Solved, Way),
        x: &mut Exprs,
    ) {
        self.report_ports(outputs, preferences, solved);
        let mut defined = vec![false; self.symbols.len()];
        done.pivots.iter().for_each(|pivot| defined[pivot.column] = true);
        let all = self.inner.iter().all(|&c| defined[c]) && !outputs.values().any(|&role| role == Role::Redundant);
        let exact = all && done.degenerate.is_empty();
        let regular = x.if_found(|x| regular_rows(x, &done));
        let (short, before) = match way {
            Way::Short(before) => (true, Some(before)),
            Way::BySize => (true, None),
            Way::Eliminated => (false, None),
        };
        let matched = match short && exact && regular.is_none() {
            true => x.if_found(|x| matched_rows(x, &self.rows, &done)),
            false => None,
        };
        let parts = exact && matched.is_none() && done.watched.iter().any(|&e| is_divided(x, e));
        let whole = matched.unwrap_or_else(|| reduced_rows(x, &done, regular.as_ref()));
        let (rows, watched) = match before.filter(|_| parts).and_then(|before| self.parted(x, &done, before, &whole)) {
            Some(BlockRows { rows, loops, divisors, .. }) => {
                solved.loops = loops.into_iter().map(|block| self.loop_rows(block)).collect();
                (rows, divisors)
            }
            None => (whole, regular.map_or(done.watched, |regular| vec![regular.determinant])),
        };
        solved.definitions.extend(rows.into_iter().map(|row| self.definition(row)));
        let free = |&c: &usize| !defined[c];
        solved.undetermined = self.inner.iter().copied().filter(free).map(|c| self.symbols[c]).collect();
        for (&p, &role) in outputs {
            if role == Role::Redundant {
                solved.undetermined.push(self.symbols[self.ports[p].conjugate()]);
            }
        }
        solved.watched = watched;
        solved.degenerate = done.degenerate;
    }
}

impl Net {
    /// The part solved by elimination of expressions; `before`: what was assumed before it.
    pub(super) fn solved_exactly(
        &self,
        x: &mut Exprs,
        preferences: &CausalityPreferences,
        before: Assumptions,
    ) -> Solved {
        let (done, outputs) = self.eliminated(x, preferences);
        self.solved(x, done, &outputs, preferences, Way::Short(before))
    }

    /// The rows with one variable of every port eliminated; the roles of ports, by their numbers.
    fn eliminated(&self, x: &mut Exprs, preferences: &CausalityPreferences) -> (Elimination, BTreeMap<usize, Role>) {
        let causality = |x: &Exprs, port: &NetPort, divisors: [Option<Expr>; 2]| {
            law_causality(port, divisors.map(|e| e.map(|e| super::magnitude(x, e))), preferences)
        };
        self.eliminated_over(x, self.rows.clone(), preferences, causality)
    }

    /// The same over any coefficients. `causality` chooses that of a law by what its effort, or its flow, would be divided by.
    pub(super) fn eliminated_over<A: Coefficients>(
        &self,
        x: &mut A,
        rows: Vec<SparseRow<A::Entry>>,
        preferences: &CausalityPreferences,
        mut causality: impl FnMut(&A, &NetPort, [Option<A::Entry>; 2]) -> PortCausality,
    ) -> (Elimination<A::Entry>, BTreeMap<usize, Role>) {
        let mut work = Eliminator::new(x, rows, self.symbols.len());
        work.eliminate(x, &self.inner);

        // Pivots are taken in ascending priority as inputs: reactions, rates, laws, co-energies. Pivot columns are outputs.
        let imposed: Vec<usize> = self.ports_where(|o| matches!(o, Offer::Imposed(_)));
        let storages = self.storage_order(preferences);
        let laws = self.ports_where(|o| o == Offer::Law);
        let mut outputs: BTreeMap<usize, Role> = BTreeMap::new();
        for &p in &imposed {
            let determined = work.eliminate(x, &[self.ports[p].conjugate()]) == 1;
            outputs.insert(p, if determined { Role::Source } else { Role::Redundant });
        }
        for &p in &storages {
            work.eliminate(x, &[self.ports[p].conjugate()]);
        }
        for &p in laws.iter().rev() {
            let port = &self.ports[p];
            let divisors = [port.effort, port.flow].map(|column| work.divisor(x, column));
            let causality = causality(x, port, divisors);
            work.eliminate(x, &[port.column(causality == PortCausality::Conductive)]);
            outputs.insert(p, Role::Algebraic(causality));
        }
        for &p in storages.iter().rev() {
            let dependent = work.eliminate(x, &[self.ports[p].given()]) == 1;
            outputs.insert(p, if dependent { Role::Dependent } else { Role::Independent });
        }
        (work.finish(), outputs)
    }

    /// The rows block by block, if several blocks have divisors of their own and that is less than half as long. What is
    /// assumed is then what was assumed `before` the elimination, and these divisors.
    fn parted(
        &self,
        x: &mut Exprs,
        done: &Elimination,
        before: Assumptions,
        whole: &[(usize, Vec<(usize, Expr)>)],
    ) -> Option<BlockRows> {
        let eliminated = x.assumed();
        x.suppose(before);
        let parted = block_rows(x, &self.rows, done, usize::MAX, None);
        let parted = parted.filter(|p| p.divisors.len() > 1 && 2 * length(x, &p.rows) < length(x, whole));
        if parted.is_none() {
            x.suppose(eliminated);
        }
        parted
    }
}

/// What an outer port imposes on the junction structure.
fn offer(graph: &BondGraph, port: PortRef) -> Offer {
    use crate::bond_graph::StorageLaw::Known;
    let index = port.port as usize;
    match &graph.elements[port.element].kind {
        Kind::EffortSource { .. } | Kind::FlowDetector => Offer::Imposed(Which::Effort),
        Kind::ResidualFlow { residual: None } => Offer::Imposed(Which::Effort),
        Kind::FlowSource { .. } | Kind::ZeroCompliance { .. } | Kind::EffortDetector => Offer::Imposed(Which::Flow),
        Kind::ResidualEffort { residual: None } => Offer::Imposed(Which::Flow),
        Kind::Compliance(s) if matches!(s.laws[index], Known { .. }) => Offer::Imposed(Which::Effort),
        Kind::Inertance(_) => Offer::Storage(Which::Flow),
        Kind::Compliance(_) => Offer::Storage(Which::Effort),
        _ => Offer::Law,
    }
}

/// The causality of an algebraic port: the one preferred for if it is admissible and well conditioned. `effort`, `flow`: how
/// great the divisor is, if there is one.
pub(super) fn law_causality(
    port: &NetPort,
    [effort, flow]: [Option<f64>; 2],
    preferences: &CausalityPreferences,
) -> PortCausality {
    let wish = port.port.and_then(|p| preferences.algebraic.get(&p).copied()).unwrap_or(PortCausality::Resistive);
    match (effort, flow) {
        (Some(_), None) => PortCausality::Conductive,
        (None, Some(_)) => PortCausality::Resistive,
        (Some(effort), Some(flow)) => match wish {
            PortCausality::Conductive if effort < 1e-3 * flow => PortCausality::Resistive,
            PortCausality::Conductive => PortCausality::Conductive,
            _ if flow < 1e-3 * effort => PortCausality::Conductive,
            _ => PortCausality::Resistive,
        },
        (None, None) => wish,
    }
}

/// Pivot columns as combinations of the other entries in their rows.
fn reduced_rows(x: &mut Exprs, done: &Elimination, regular: Option<&RegularRows>) -> Vec<(usize, Vec<(usize, Expr)>)> {
    let mut rows = Vec::with_capacity(done.pivots.len());
    for (i, pivot) in done.pivots.iter().enumerate() {
        let others = pivot.row.0.iter().filter(|e| e.0 != pivot.column);
        let row = match regular {
            Some(regular) => regular.rows[i].0.clone(),
            None => others.map(|&(c, e)| (c, settled(x, e))).collect(),
        };
        rows.push((pivot.column, row));
    }
    rows
}

/// How long rows are in print.
fn length(x: &Exprs, rows: &[(usize, Vec<(usize, Expr)>)]) -> u64 {
    rows.iter().flat_map(|row| &row.1).map(|entry| x.printed_length(entry.1)).sum()
}

/// Whether an expression is a fraction.
fn is_divided(x: &mut Exprs, e: Expr) -> bool {
    x.lowest_terms(e).is_some_and(|l| !l.below.is_empty())
}

/// Pivot columns as combinations of the columns without a pivot.
pub(super) struct RegularRows {
    /// A row for each pivot.
    pub rows: Vec<SparseRow>,
    /// The junction structure is regular where this is not zero.
    pub determinant: Expr,
}

/// The rows of an elimination without divisors that only the order of elimination introduced: where one pivot is divided by
/// another, not each of them has to be nonzero but their product, the determinant. `None` if no divisor can be dropped, or
/// if the search would take too long.
pub(super) fn regular_rows(x: &mut Exprs, done: &Elimination) -> Option<RegularRows> {
    if !done.watched.iter().any(|&e| is_divided(x, e)) {
        return None;
    }
    let product = x.mul(&done.watched);
    let determinant = x.lowest_terms(product).filter(|l| l.below.is_empty())?.above;
    x.assume_nonzero(determinant);
    let mut substitution = back_substitute(done);
    let mut rows = Vec::with_capacity(done.pivots.len());
    for pivot in &done.pivots {
        let mut row = substitution.express(x, pivot.column).0;
        for (_, e) in &mut row {
            *e = continuous(x, *e)?;
        }
        row.retain(|&(_, e)| !x.is_zero(e));
        rows.push(SparseRow(row));
    }
    Some(RegularRows { rows, determinant })
}

/// The entry as a fraction in lowest terms.
fn continuous(x: &mut Exprs, e: Expr) -> Option<Expr> {
    if x.is_number(e).is_some() {
        return Some(e);
    }
    let lowest = x.lowest_terms(e)?;
    let below: Vec<Expr> = lowest.below.iter().map(|&(factor, power)| x.powi(factor, power.into())).collect();
    below.iter().for_each(|&factor| x.assume_nonzero(factor));
    let below = x.mul(&below);
    let fraction = x.div(lowest.above, below);
    Some(x.simplify(fraction))
}

/// An entry with its sign reversed, simplified.
pub(super) fn settled(x: &mut Exprs, e: Expr) -> Expr {
    let minus = x.neg(e);
    if x.is_number(minus).is_some() { minus } else { x.simplify(minus) }
}

/// Fully reduces rows: each of the results is a relation of minimal support, with the column that leads it. `classes`: the
/// columns that may lead one, those of an earlier class first.
pub(crate) fn circuits(x: &mut Exprs, rows: Vec<SparseRow>, classes: &[Vec<usize>]) -> Vec<(usize, SparseRow)> {
    let done = eliminate(x, rows, classes);
    let mut reduced = back_substitute(&done);
    let mut relations = Vec::with_capacity(done.pivots.len());
    for pivot in &done.pivots {
        let mut row: Vec<(usize, Expr)> =
            reduced.express(x, pivot.column).0.into_iter().map(|(c, e)| (c, x.neg(e))).collect();
        row.push((pivot.column, ONE));
        row.sort_by_key(|e| e.0);
        relations.push((pivot.column, SparseRow(row)));
    }
    relations
}

/// The rank of a matrix, given by rows without zeros, at the given parameters.
pub(crate) fn rank_given(x: &mut Exprs, columns: usize, rows: Vec<SparseRow>) -> usize {
    eliminate(x, rows, &[(0..columns).collect()]).pivots.len()
}

/// Whether a port has its effort (`true`) or its flow (`false`) imposed.
pub fn imposes_effort(graph: &BondGraph, port: PortRef) -> Option<bool> {
    match offer(graph, port) {
        Offer::Imposed(which) => Some(which == Which::Effort),
        _ => None,
    }
}

/// Whether a port has its variable imposed: sources, constraints, detectors, compliances of known displacement.
pub fn is_imposed(graph: &BondGraph, port: PortRef) -> bool {
    matches!(offer(graph, port), Offer::Imposed(_))
}
