//! Relations between speeds that the junction structure implies, `Σ c_i(q) q_i' = 0`, and which of them are relations of
//! positions: differentials of a function, or integrable all together (Frobenius). Source: `method.md`, 5.4.

use std::collections::{BTreeMap, BTreeSet};

use super::{BondGraph, Constraint, HeldKind, Kind, Meaning, StorageLaw};
use crate::algebra::{
    EvaluationOrder, Evaluator, Expr, Exprs, Node, ONE, SparseRow, Symbol, ZERO, back_substitute, eliminate, somewhere,
};
use crate::sparse::Matching;

/// Parts with more flows than this are searched for rows that are one too many by their structure alone.
const LARGE: usize = 600;
/// Parts in which more flows and rates are left then are not searched.
const MOST: usize = 2000;
/// Relations of a part with more rates than this are tested for being integrable together by values alone,
const TESTED: usize = 24;
/// and with more than this not at all.
const TESTED_BY_VALUES: usize = 400;
/// Points at which they are tested by values.
const POINTS: u64 = 3;
/// A sum above this part of its terms does not vanish,
const CLEARLY: f64 = 1e-5;
/// and one below this part at all points does.
const ROUNDING: f64 = 1e-9;

/// A relation between the rates of positions.
#[derive(Debug, Clone, PartialEq)]
pub struct VelocityRelation {
    /// The positions, integrated signals and displacements, with what their rates are multiplied by. The sum of the
    /// products vanishes.
    pub terms: Vec<(Symbol, Expr)>,
    /// What is known of it.
    pub integral: Integral,
}

/// Whether a relation between rates is one between positions.
#[derive(Debug, Clone, PartialEq)]
pub enum Integral {
    /// It is a `constraint` on displacements, by its number.
    Constraint(usize),
    /// It is the rate of this expression, which keeps its value.
    Closed(Expr),
    /// It holds a relation between positions, together with the others of its part, which has no closed form here.
    Open,
    /// It leaves all positions within reach: it is nonholonomic.
    Nonholonomic,
    /// It was not decided, as it reads what is no position, or too many of them.
    Undecided,
}

impl VelocityRelation {
    /// What keeps its value, or vanishes, as an expression of positions or of their rates.
    pub fn expression(&self, x: &mut Exprs, graph: &BondGraph) -> Expr {
        match self.integral {
            Integral::Constraint(number) => graph.constraints[number].expr,
            Integral::Closed(potential) => x.textbook(potential),
            _ => {
                let mut products = Vec::new();
                for &(symbol, factor) in &self.terms {
                    let rate = x.rate(symbol);
                    let rate = x.sym(rate);
                    products.push(x.mul(&[factor, rate]));
                }
                let sum = x.add(&products);
                x.textbook(sum)
            }
        }
    }

    /// Whether every method keeps it to rounding, as it is linear with constant factors.
    pub fn is_linear(&self, x: &Exprs) -> bool {
        !matches!(self.integral, Integral::Constraint(_)) && self.terms.iter().all(|t| is_fixed(x, t.1))
    }
}

/// Whether an expression reads parameters alone.
fn is_fixed(x: &Exprs, e: Expr) -> bool {
    !x.depends_on_any(e, &|s| x.facts(s).given.is_none())
}

/// Finds the relations of a graph whose moduli read positions; the expressions are made in the pool. Parts whose ratios are
/// all constant are left out: what they relate every method keeps.
///
/// What sources impose counts as free: it is followed at the accuracy of the method. So does what set-valued laws hold: they
/// let go.
pub fn velocity_relations(x: &mut Exprs, graph: &BondGraph) -> Vec<VelocityRelation> {
    if !has_moving_ratios(x, graph) {
        return Vec::new();
    }
    x.tried(|x| {
        let mut rows = Rows::of(x, graph);
        let parts = rows.parts();
        let mut found = Vec::new();
        for part in parts {
            found.extend(rows.relations_of(x, graph, part));
        }
        found
    })
}

/// Whether a ratio of flows reads what moves.
fn has_moving_ratios(x: &Exprs, graph: &BondGraph) -> bool {
    let moves = |s: Symbol| is_position(graph, s);
    let ratio = |kind: &Kind| matches!(kind, Kind::Transformer { .. } | Kind::MatrixTransformer(_));
    let modulus = |kind: &Kind| ratio(kind) && kind.moduli().into_iter().any(|e| x.depends_on_any(e, &moves));
    graph.elements.values().any(|e| modulus(&e.kind))
        || graph.signals.values().any(|s| {
            let flow = |s: Symbol| matches!(meaning(graph, s), Some(Meaning::Flow(_)));
            x.depends_on_any(s.rate, &moves) && x.depends_on_any(s.rate, &flow)
        })
}

fn meaning(graph: &BondGraph, symbol: Symbol) -> Option<Meaning> {
    graph.variables.get(&symbol).map(|v| v.meaning)
}

/// Whether a symbol is a coordinate that may move by itself.
fn is_position(graph: &BondGraph, symbol: Symbol) -> bool {
    matches!(meaning(graph, symbol), Some(Meaning::Signal(_) | Meaning::Stored(_)))
}

/// Rows in flows and in rates of positions.
#[derive(Default)]
struct Rows {
    rows: Vec<SparseRow>,
    /// What each column is: a flow, or the position whose rate it is.
    columns: Vec<Symbol>,
    of: BTreeMap<Symbol, usize>,
    positions: BTreeSet<usize>,
    /// Constraints on displacements, with their gradients.
    constraints: Vec<(usize, Vec<(Symbol, Expr)>)>,
}

impl Rows {
    fn of(x: &mut Exprs, graph: &BondGraph) -> Rows {
        let mut rows = Rows::default();
        let constraints: BTreeMap<_, _> =
            graph.constraints.iter().enumerate().filter(|(_, c)| c.holonomic).map(|(k, c)| (c.element, k)).collect();
        let branching: BTreeSet<_> = graph.set_valued.iter().map(|law| law.element).collect();
        for (id, element) in graph.elements.iter().filter(|(id, _)| !branching.contains(id)) {
            let minus = x.int(-1);
            let flow = |port: usize| graph.bonds[element.ports[port].bond].flow;
            match element.kind {
                Kind::One => {
                    for k in 1..element.ports.len() {
                        rows.push(x, vec![(flow(0), ONE), (flow(k), minus)]);
                    }
                }
                Kind::Zero => {
                    let terms = element.ports.iter().enumerate();
                    let terms = terms.map(|(k, p)| (flow(k), if p.inward { ONE } else { minus })).collect();
                    rows.push(x, terms);
                }
                Kind::Transformer { modulus } => {
                    let (over, under) = x.over_and_under(modulus);
                    let over = x.neg(over);
                    rows.push(x, vec![(flow(1), under), (flow(0), over)]);
                }
                Kind::MatrixTransformer(_) => {
                    for row in element.kind.two_port_rows().into_iter().filter(|row| !row.effort) {
                        let terms = row.terms.into_iter().map(|(port, e)| (flow(port), x.neg(e)));
                        let terms = std::iter::once((flow(row.port), ONE)).chain(terms).collect();
                        rows.push(x, terms);
                    }
                }
                Kind::EffortDetector => rows.push(x, vec![(flow(0), ONE)]),
                Kind::ZeroCompliance { .. } if constraints.contains_key(&id) => {
                    let number = constraints[&id];
                    rows.constrain(x, graph, number, &graph.constraints[number]);
                }
                Kind::FlowSource { value } | Kind::ZeroCompliance { flow: value } => {
                    if let Some(mut terms) = in_flows(x, graph, value) {
                        terms.push((flow(0), minus));
                        rows.push(x, terms);
                    }
                }
                Kind::Compliance(ref storage) => {
                    for (port, (&stored, law)) in storage.stored.iter().zip(&storage.laws).enumerate() {
                        if !matches!(law, StorageLaw::Known { .. }) {
                            let column = rows.position(stored);
                            rows.push_columns(x, vec![(flow(port), ONE)], Some((column, minus)));
                        }
                    }
                }
                _ => {}
            }
        }
        for signal in graph.signals.values() {
            if let Some(terms) = in_flows(x, graph, signal.rate).filter(|terms| !terms.is_empty()) {
                let minus = x.int(-1);
                let column = rows.position(signal.symbol);
                rows.push_columns(x, terms, Some((column, minus)));
            }
        }
        rows
    }

    fn column(&mut self, symbol: Symbol) -> usize {
        let next = self.columns.len();
        let column = *self.of.entry(symbol).or_insert(next);
        if column == next {
            self.columns.push(symbol);
        }
        column
    }

    fn position(&mut self, symbol: Symbol) -> usize {
        let column = self.column(symbol);
        self.positions.insert(column);
        column
    }

    fn push(&mut self, x: &mut Exprs, terms: Vec<(Symbol, Expr)>) {
        self.push_columns(x, terms, None);
    }

    fn push_columns(&mut self, x: &mut Exprs, terms: Vec<(Symbol, Expr)>, rate: Option<(usize, Expr)>) {
        let mut row: BTreeMap<usize, Expr> = rate.into_iter().collect();
        for (symbol, e) in terms {
            let column = self.column(symbol);
            let sum = row.get(&column).map_or(e, |&own| x.add(&[own, e]));
            row.insert(column, sum);
        }
        row.retain(|_, e| !x.is_zero(*e));
        self.rows.push(SparseRow(row.into_iter().collect()));
    }

    /// The gradient of a constraint, as a row of rates alone.
    fn constrain(&mut self, x: &mut Exprs, graph: &BondGraph, number: usize, constraint: &Constraint) {
        let read = x.symbols_of(constraint.expr);
        let positions: Vec<Symbol> = read.into_iter().filter(|&s| is_position(graph, s)).collect();
        let gradient: Vec<(Symbol, Expr)> =
            positions.into_iter().map(|s| (s, x.derivative(constraint.expr, s))).collect();
        self.constraints.push((number, gradient));
    }

    /// Rows that hang together by their flows and rates.
    fn parts(&self) -> Vec<Vec<usize>> {
        let mut group: Vec<usize> = (0..self.columns.len()).collect();
        fn root(group: &mut [usize], mut c: usize) -> usize {
            while group[c] != c {
                group[c] = group[group[c]];
                c = group[c];
            }
            c
        }
        let mut join = |columns: &[usize]| {
            for pair in columns.windows(2) {
                let (a, b) = (root(&mut group, pair[0]), root(&mut group, pair[1]));
                group[a.max(b)] = a.min(b);
            }
        };
        self.rows.iter().for_each(|row| join(&row.0.iter().map(|e| e.0).collect::<Vec<_>>()));
        for (_, gradient) in &self.constraints {
            join(&gradient.iter().filter_map(|(s, _)| self.of.get(s).copied()).collect::<Vec<_>>());
        }
        let mut parts: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (number, row) in self.rows.iter().enumerate() {
            if let Some(&(column, _)) = row.0.first() {
                parts.entry(root(&mut group, column)).or_default().push(number);
            }
        }
        parts.into_values().collect()
    }

    /// The relations among the rates of a part.
    fn relations_of(&mut self, x: &mut Exprs, graph: &BondGraph, part: Vec<usize>) -> Vec<VelocityRelation> {
        let rows: Vec<SparseRow> = part.iter().map(|&r| self.rows[r].clone()).collect();
        if rows.iter().flat_map(|r| &r.0).all(|e| is_fixed(x, e.1)) {
            return Vec::new();
        }
        let rows = if flows_in(&rows, &self.positions).len() > LARGE { self.one_too_many(rows) } else { rows };
        let flows = flows_in(&rows, &self.positions);
        if flows.len() > MOST {
            return Vec::new();
        }
        let done = eliminate(x, rows, &[flows.into_iter().collect()]);
        let within: BTreeSet<usize> = part.iter().flat_map(|&r| self.rows[r].0.iter().map(|e| e.0)).collect();
        let mut found: Vec<VelocityRelation> = Vec::new();
        for (number, gradient) in &self.constraints {
            if gradient.iter().any(|(s, _)| self.of.get(s).is_some_and(|c| within.contains(c))) {
                found.push(VelocityRelation { terms: gradient.clone(), integral: Integral::Constraint(*number) });
            }
        }
        for row in done.rest {
            let terms: Vec<(Symbol, Expr)> = row.0.iter().map(|&(c, e)| (self.columns[c], e)).collect();
            found.push(match done.degenerate.is_empty() {
                true => classified(x, graph, terms),
                // With other parameters it has more terms.
                false => VelocityRelation { terms, integral: Integral::Undecided },
            });
        }
        if found.iter().any(|relation| relation.integral == Integral::Open) {
            test_together(x, graph, &mut found);
        }
        found
    }

    /// The rows from which one can come to a row too many by exchanges: the others have a flow each to themselves.
    fn one_too_many(&self, rows: Vec<SparseRow>) -> Vec<SparseRow> {
        let edges: Vec<Vec<usize>> = rows
            .iter()
            .map(|row| row.0.iter().map(|e| e.0).filter(|c| !self.positions.contains(c)).collect())
            .collect();
        let mut matching = Matching::new(self.columns.len().max(rows.len()));
        matching.complete(&edges);
        let mut open: Vec<usize> = (0..rows.len()).filter(|&r| matching.column_of[r].is_none()).collect();
        let mut reached: BTreeSet<usize> = open.iter().copied().collect();
        while let Some(row) = open.pop() {
            for &column in &edges[row] {
                open.extend(matching.row_of[column].filter(|&r| reached.insert(r)));
            }
        }
        rows.into_iter().enumerate().filter(|(r, _)| reached.contains(r)).map(|(_, row)| row).collect()
    }
}

fn flows_in(rows: &[SparseRow], positions: &BTreeSet<usize>) -> BTreeSet<usize> {
    rows.iter().flat_map(|r| r.0.iter().map(|e| e.0)).filter(|c| !positions.contains(c)).collect()
}

/// An expression as a combination of flows and nothing else; `None` if it is none.
fn in_flows(x: &mut Exprs, graph: &BondGraph, e: Expr) -> Option<Vec<(Symbol, Expr)>> {
    let flow = |s: &Symbol| matches!(meaning(graph, *s), Some(Meaning::Flow(_)));
    let flows: Vec<Symbol> = x.symbols_of(e).into_iter().filter(flow).collect();
    let (coefficients, rest) = x.linear_in(e, &flows)?;
    x.is_zero(rest).then(|| flows.into_iter().zip(coefficients).collect())
}

/// A relation as it stands, or multiplied by what makes a differential of it.
fn classified(x: &mut Exprs, graph: &BondGraph, terms: Vec<(Symbol, Expr)>) -> VelocityRelation {
    if terms.iter().any(|t| x.depends_on_any(t.1, &|s| !is_coordinate(x, graph, s))) {
        return VelocityRelation { terms, integral: Integral::Undecided };
    }
    if let Some(found) = closed(x, graph, &terms) {
        return found;
    }
    // Elimination leaves factors on both sides of the line.
    let short: Option<Vec<(Symbol, Expr)>> = terms.iter().map(|&(s, e)| Some((s, in_lowest_terms(x, e)?))).collect();
    let Some(short) = short.filter(|short| *short != terms) else {
        return VelocityRelation { terms, integral: Integral::Open };
    };
    let mut below: Vec<Expr> = short.iter().flat_map(|t| divisors(x, t.1)).collect();
    below.sort();
    below.dedup();
    let below = x.mul(&below);
    let whole: Vec<(Symbol, Expr)> = short
        .iter()
        .map(|&(s, e)| {
            let product = x.mul(&[below, e]);
            (s, in_lowest_terms(x, product).unwrap_or(product))
        })
        .collect();
    let found = closed(x, graph, &whole).or_else(|| closed(x, graph, &short));
    // Without a line there is a value everywhere.
    found.unwrap_or(VelocityRelation { terms: whole, integral: Integral::Open })
}

/// What stands under the line of a product.
fn divisors(x: &mut Exprs, e: Expr) -> Vec<Expr> {
    let factors = match x.node(e) {
        Node::Mul(factors) => factors.to_vec(),
        _ => vec![e],
    };
    let inverse = |factor: Expr| match *x.node(factor) {
        Node::Pow(base, n) if x.is_number(n).is_some_and(|n| n.signum() < 0) => {
            let n = x.neg(n);
            Some(x.pow(base, n))
        }
        _ => None,
    };
    factors.into_iter().filter_map(inverse).collect()
}

fn in_lowest_terms(x: &mut Exprs, e: Expr) -> Option<Expr> {
    let lowest = x.lowest_terms(e)?;
    Some(lowest.below.into_iter().fold(lowest.above, |above, (factor, power)| {
        let power = x.int(power.into());
        let below = x.pow(factor, power);
        x.div(above, below)
    }))
}

/// A relation as it stands, or multiplied by what makes a differential of it with a closed form, if there is one.
fn closed(x: &mut Exprs, graph: &BondGraph, terms: &[(Symbol, Expr)]) -> Option<VelocityRelation> {
    let all: Vec<Symbol> = coordinates(x, graph, [terms]).into_iter().collect();
    let points: Option<Vec<FormAt>> = (0..POINTS).map(|number| FormAt::new(x, &all, terms, number)).collect();
    let divisors = terms.iter().filter(|t| !is_fixed(x, t.1)).map(|&t| Some(t)).collect::<Vec<_>>();
    for divisor in std::iter::once(None).chain(divisors) {
        // What is no differential is mostly told by values.
        let place = divisor.and_then(|(symbol, _)| all.binary_search(&symbol).ok());
        let told = points.iter().flatten().try_fold(true, |exact, point| match point.is_exact(place) {
            Some(false) => Err(false),
            told => Ok(exact && told.is_some()),
        });
        if told == Err(false) {
            continue;
        }
        let factor = divisor.map(|(_, e)| x.recip(e));
        let scaled: Vec<(Symbol, Expr)> = terms
            .iter()
            .map(|&(s, e)| {
                let product = factor.map_or(e, |factor| x.mul(&[factor, e]));
                (s, x.simplify(product))
            })
            .collect();
        let known = points.is_some() && told == Ok(true);
        if (known || is_exact(x, graph, &scaled))
            && let Some(potential) = x.potential(&scaled)
        {
            return Some(VelocityRelation { terms: scaled, integral: Integral::Closed(potential) });
        }
    }
    None
}

/// Whether a symbol is a position, a parameter, time, or what events alone change.
fn is_coordinate(x: &Exprs, graph: &BondGraph, symbol: Symbol) -> bool {
    match meaning(graph, symbol) {
        Some(Meaning::Held(held)) => graph.held[held].kind != HeldKind::Delay,
        Some(Meaning::Time) => true,
        _ => is_position(graph, symbol) || x.facts(symbol).given.is_some(),
    }
}

/// The coordinates that relations read or move: positions and time.
fn coordinates<'r>(
    x: &Exprs,
    graph: &BondGraph,
    relations: impl IntoIterator<Item = &'r [(Symbol, Expr)]>,
) -> BTreeSet<Symbol> {
    let mut all = BTreeSet::new();
    for &(symbol, e) in relations.into_iter().flatten() {
        all.insert(symbol);
        all.extend(x.symbols_of(e).into_iter().filter(|&s| s == graph.time || is_position(graph, s)));
    }
    all
}

/// Whether a form is closed: `∂c_i/∂q_j = ∂c_j/∂q_i` for all coordinates.
fn is_exact(x: &mut Exprs, graph: &BondGraph, terms: &[(Symbol, Expr)]) -> bool {
    let all: Vec<Symbol> = coordinates(x, graph, [terms]).into_iter().collect();
    let of: BTreeMap<Symbol, Expr> = terms.iter().copied().collect();
    let pairs = all.iter().enumerate().flat_map(|(k, &a)| all[..k].iter().map(move |&b| (a, b)));
    pairs.into_iter().all(|(a, b)| {
        let curl = curl(x, &of, a, b);
        x.is_zero(curl)
    })
}

/// `∂c_b/∂a - ∂c_a/∂b`.
fn curl(x: &mut Exprs, of: &BTreeMap<Symbol, Expr>, a: Symbol, b: Symbol) -> Expr {
    let coefficient = |s: Symbol| of.get(&s).copied().unwrap_or(ZERO);
    let (first, second) = (x.derivative(coefficient(b), a), x.derivative(coefficient(a), b));
    x.sub(first, second)
}

/// Decides of the relations without a closed form whether they are integrable with all others of their part: no two
/// motions that keep all of them lead, one after the other, out of them (Frobenius).
fn test_together(x: &mut Exprs, graph: &BondGraph, relations: &mut [VelocityRelation]) {
    let forms: Vec<&[(Symbol, Expr)]> = relations.iter().map(|r| r.terms.as_slice()).collect();
    let all: Vec<Symbol> = coordinates(x, graph, forms).into_iter().collect();
    let undecided = relations.iter().any(|r| r.integral == Integral::Undecided) || all.len() > TESTED_BY_VALUES;
    let place: BTreeMap<Symbol, usize> = all.iter().enumerate().map(|(k, &s)| (s, k)).collect();
    let rows = |relation: &VelocityRelation| {
        let mut row: Vec<(usize, Expr)> = relation.terms.iter().map(|&(s, e)| (place[&s], e)).collect();
        row.sort_unstable_by_key(|e| e.0);
        SparseRow(row)
    };
    let open = |r: &VelocityRelation| r.integral == Integral::Open;
    if undecided {
        relations.iter_mut().filter(|r| open(r)).for_each(|r| r.integral = Integral::Undecided);
        return;
    }
    let done = eliminate(x, relations.iter().map(rows).collect(), &[(0..all.len()).collect()]);
    let pivots: BTreeSet<usize> = done.pivots.iter().map(|p| p.column).collect();
    let free: Vec<usize> = (0..all.len()).filter(|c| !pivots.contains(c)).collect();
    let mut expressed = back_substitute(&done);
    // How each coordinate moves with those that are free.
    let moves: Vec<BTreeMap<usize, Expr>> =
        (0..all.len()).map(|c| expressed.express(x, c).0.into_iter().collect()).collect();
    let mut leaves: Vec<bool> = Vec::new();
    for relation in relations.iter() {
        let of: BTreeMap<Symbol, Expr> = relation.terms.iter().copied().collect();
        let leads_out = || match leads_out_by_values(x, &all, &relation.terms, (&free, &moves)) {
            None if all.len() <= TESTED => Some(leads_out(x, &all, &of, (&free, &moves))),
            told => told,
        };
        match open(relation).then(leads_out) {
            Some(None) => {
                relations.iter_mut().filter(|r| open(r)).for_each(|r| r.integral = Integral::Undecided);
                return;
            }
            told => leaves.push(told.flatten().unwrap_or(false)),
        }
    }
    let any = leaves.iter().any(|l| *l);
    for (relation, leaves) in relations.iter_mut().zip(leaves) {
        if relation.integral == Integral::Open && any {
            relation.integral = if leaves { Integral::Nonholonomic } else { Integral::Undecided };
        }
    }
}

/// Whether the curl of a form does not vanish on two motions that keep all relations, by its values at a few points; `None` where
/// these do not tell.
fn leads_out_by_values(
    x: &Exprs,
    all: &[Symbol],
    terms: &[(Symbol, Expr)],
    (free, moves): (&[usize], &[BTreeMap<usize, Expr>]),
) -> Option<bool> {
    let (n, m) = (all.len(), free.len());
    let mut vanishes = true;
    for number in 0..POINTS {
        let form = FormAt::new(x, all, terms, number)?;
        let curl: Vec<(f64, f64)> =
            (0..n).flat_map(|a| (0..n).map(move |b| (a, b))).map(|(a, b)| form.curl(a, b, None)).collect();
        let mut at = |s: Symbol| somewhere(number, s);
        let mut values = Evaluator::new(x, &mut at);
        let moves: Vec<Vec<(usize, f64)>> = moves
            .iter()
            .map(|row| row.iter().filter_map(|(c, &e)| Some((free.binary_search(c).ok()?, values.value(e)))).collect())
            .collect();
        let mut along = vec![(0.0, 0.0); n * m];
        for a in 0..n {
            for (b, row) in moves.iter().enumerate().filter(|(b, _)| curl[a * n + b].1 > 0.0) {
                for &(f, value) in row {
                    along[a * m + f].0 += curl[a * n + b].0 * value;
                    along[a * m + f].1 += curl[a * n + b].1 * value.abs();
                }
            }
        }
        for first in 0..m {
            let mut sums = vec![(0.0, 0.0); first];
            for (a, row) in moves.iter().enumerate() {
                let Some(&(_, value)) = row.iter().find(|entry| entry.0 == first) else { continue };
                for (second, sum) in sums.iter_mut().enumerate() {
                    sum.0 += value * along[a * m + second].0;
                    sum.1 += value.abs() * along[a * m + second].1;
                }
            }
            for sum in sums {
                match is_zero_beside_its_terms(sum) {
                    Some(false) => return Some(true),
                    zero => vanishes &= zero.is_some(),
                }
            }
        }
    }
    vanishes.then_some(false)
}

/// Whether a sum vanishes, by its value and the sum of the sizes of its terms; `None` where rounding may be all there is, or not.
fn is_zero_beside_its_terms((sum, size): (f64, f64)) -> Option<bool> {
    match sum.abs() / size {
        _ if size == 0.0 => Some(true),
        part if part > CLEARLY => Some(false),
        part => (part <= ROUNDING).then_some(true),
    }
}

/// A form at a point: the coefficients of its coordinates, and how steep each is in all of them.
struct FormAt {
    values: Vec<f64>,
    /// By rows of the coefficients.
    slopes: Vec<f64>,
}

impl FormAt {
    /// The form with these terms; `None` where a coefficient has corners.
    fn new(x: &Exprs, all: &[Symbol], terms: &[(Symbol, Expr)], number: u64) -> Option<FormAt> {
        let (n, place) = (all.len(), |s: &Symbol| all.binary_search(s).ok());
        let coefficients: Vec<Expr> = terms.iter().map(|t| t.1).collect();
        let order = EvaluationOrder::new(x, &coefficients);
        let columns: Vec<Option<usize>> = order.symbols().iter().map(place).collect();
        let mut room = Vec::new();
        let found = order.values_in(&mut room, |k| [somewhere(number, order.symbols()[k])]);
        let mut form = FormAt { values: vec![0.0; n], slopes: vec![0.0; n * n] };
        for ((symbol, _), value) in terms.iter().zip(found) {
            form.values[place(symbol)?] = value[0];
        }
        let mut weights = vec![0.0; terms.len()];
        for (k, (symbol, _)) in terms.iter().enumerate() {
            weights[k] = 1.0;
            let row = place(symbol)?;
            for (column, slope) in columns.iter().zip(order.slopes(&room, &weights)?) {
                column.iter().for_each(|column| form.slopes[row * n + column] = slope);
            }
            weights[k] = 0.0;
        }
        Some(form)
    }

    /// `∂c_b/∂a - ∂c_a/∂b`, with the sum of the sizes of its terms; of the form divided by one of its coefficients, if so.
    fn curl(&self, a: usize, b: usize, divided_by: Option<usize>) -> (f64, f64) {
        let n = self.values.len();
        let slope = |of: usize, by: usize| match divided_by {
            None => (self.slopes[of * n + by], self.slopes[of * n + by].abs()),
            Some(k) => {
                let below = self.values[k];
                let (own, moved) = (self.slopes[of * n + by], self.values[of] * self.slopes[k * n + by] / below);
                ((own - moved) / below, (own.abs() + moved.abs()) / below.abs())
            }
        };
        let (first, second) = (slope(b, a), slope(a, b));
        (first.0 - second.0, first.1 + second.1)
    }

    /// Whether all curls vanish; `None` where some may.
    fn is_exact(&self, divided_by: Option<usize>) -> Option<bool> {
        let mut told = Some(true);
        for a in 0..self.values.len() {
            for b in 0..a {
                match is_zero_beside_its_terms(self.curl(a, b, divided_by)) {
                    Some(false) => return Some(false),
                    zero => told = told.and(zero),
                }
            }
        }
        told
    }
}

/// Whether the curl of a form does not vanish on two motions that keep all relations.
fn leads_out(
    x: &mut Exprs,
    all: &[Symbol],
    of: &BTreeMap<Symbol, Expr>,
    (free, moves): (&[usize], &[BTreeMap<usize, Expr>]),
) -> bool {
    let mut curls = Vec::new();
    for a in 0..all.len() {
        for b in 0..a {
            let curl = curl(x, of, all[a], all[b]);
            if !x.is_zero(curl) {
                curls.push((a, b, curl));
            }
        }
    }
    for (k, &first) in free.iter().enumerate() {
        for &second in &free[..k] {
            let mut terms = Vec::new();
            for &(a, b, curl) in &curls {
                for (one, other, sign) in [(first, second, 1), (second, first, -1)] {
                    if let (Some(&by), Some(&along)) = (moves[a].get(&one), moves[b].get(&other)) {
                        let sign = x.int(sign);
                        terms.push(x.mul(&[sign, curl, by, along]));
                    }
                }
            }
            let sum = x.add(&terms);
            if !x.is_zero(sum) {
                return true;
            }
        }
    }
    false
}
