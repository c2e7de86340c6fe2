//! Every law of every junction and element, at every sample.

use crate::constraints::Share;
use crate::on_all_cores::on_all_cores;
use crate::scales::{Quantity, Scale, Scales, Settled, Term};
use crate::terms::Terms;
use crate::values::{Line, Reader, Values};
use crate::worst::{Raw, Worst};
use halfarrow_compiler::algebra::{Expr, Exprs, Node, ONE, Symbol};
use halfarrow_compiler::bond_graph::{BondGraph, BondId, Element, Kind, ResistorLaw, StorageLaw, TwoPortRow};
use smallvec::SmallVec;
use std::collections::{BTreeMap, BTreeSet};

/// Columns with signs.
type Signed<'a> = SmallVec<[(f64, &'a [f64]); 3]>;

/// A law in values: what stands against what, and the quantity that it is about.
enum Law<'a> {
    /// Signed columns sum to zero.
    Sum { terms: Signed<'a>, what: &'static str, of: Quantity },
    /// A recorded column is a sum of numbers times others.
    Line { left: &'a [f64], right: Line<'a>, what: &'static str, of: Quantity },
    /// A recorded column has the value of an expression.
    Value { left: &'a [f64], right: Expr, what: &'static str, of: Quantity },
    /// Signed columns sum to an expression times another.
    Product {
        left: Signed<'a>,
        factor: Expr,
        /// What they are multiplied by themselves.
        divisor: Option<Expr>,
        right: (&'a [f64], Quantity),
        what: &'static str,
        of: Quantity,
    },
    /// A column is a sum of expressions times columns.
    Row { left: &'a [f64], factors: Vec<Expr>, right: Vec<(&'a [f64], Quantity)>, what: &'static str, of: Quantity },
    /// An expression vanishes.
    Zero { expr: Expr, what: &'static str },
}

impl Law<'_> {
    /// What it says something of.
    fn what(&self) -> &'static str {
        let (Law::Sum { what, .. }
        | Law::Line { what, .. }
        | Law::Value { what, .. }
        | Law::Product { what, .. }
        | Law::Row { what, .. }
        | Law::Zero { what, .. }) = self;
        what
    }

    /// The quantity that it is about as a term of its scale, if it is about one.
    fn natural(&self) -> Option<Term> {
        match self {
            Law::Sum { of, .. }
            | Law::Line { of, .. }
            | Law::Value { of, .. }
            | Law::Product { of, .. }
            | Law::Row { of, .. } => Some(Term::of(*of, 1.0)),
            Law::Zero { .. } => None,
        }
    }
}

/// Moduli that are written as quotients whose divisor may vanish: what stands over and under the line.
pub(crate) type Quotients = BTreeMap<Expr, (Expr, Expr)>;

/// Those of a graph, with their parts in the pool.
pub(crate) fn quotients(graph: &BondGraph, x: &mut Exprs) -> Quotients {
    let modulus = |element: &Element| match element.kind {
        Kind::Transformer { modulus } | Kind::Gyrator { modulus } => Some(modulus),
        _ => None,
    };
    let all = graph.elements.values().filter_map(modulus).map(|modulus| (modulus, x.over_and_under(modulus)));
    all.filter(|(_, (_, under))| *under != ONE).collect()
}

/// The elements whose laws have one branch.
fn fixed(graph: &BondGraph) -> Vec<&Element> {
    let set_valued: BTreeSet<_> = graph.set_valued.iter().map(|law| law.element).collect();
    graph.elements.iter().filter(|(id, _)| !set_valued.contains(id)).map(|(_, element)| element).collect()
}

/// Laws with expressions that are read together at most: what bounds the memory of large models.
const TOGETHER: usize = 4096;

/// Takes note of the law whose miss is greatest.
pub(crate) fn residual(
    (graph, shares, quotients): (&BondGraph, &[Share], &Quotients),
    values: &Values,
    (scales, settled): (&Scales, &Settled),
    worst: &mut Worst,
    unchecked: &mut Vec<String>,
) {
    let mut check = Check::new(graph, values, (scales, settled));
    for (name, symbol, left, right) in values.same() {
        let of = scales.of(graph, symbol);
        check.sum(name, &[(1.0, left), (-1.0, right)], "two names of one variable", of);
    }
    let Check { worst: names, laws: mut before, .. } = check;
    worst.absorb(0, names, settled);
    let of_elements = on_all_cores(&fixed(graph), values, |elements, values| {
        let mut check = Check::new(graph, values, (scales, settled));
        let unchecked = check.elements(elements, quotients);
        (check.worst, check.laws, unchecked)
    });
    for (found, laws, missing) in of_elements {
        worst.absorb(before, found, settled);
        before += laws;
        unchecked.extend(missing);
    }
    let mut check = Check::new(graph, values, (scales, settled));
    let mut written = Vec::new();
    for share in shares {
        let name = &graph.elements[share.junction].name;
        let checked = match share_of_constraint(values, scales, share) {
            Some(law) => check.law(name, law, &mut written).map_err(|missing| format!("{missing} is not known")),
            None => Err("not all of its efforts are known".to_string()),
        };
        if let Err(why) = checked {
            unchecked.push(format!("a constraint at {name}: {why}"));
        }
    }
    check.written(&written);
    worst.absorb(before, check.worst, settled);
}

/// What a constraint puts on a junction.
fn share_of_constraint<'a>(values: &Values<'a>, scales: &Scales, share: &Share) -> Option<Law<'a>> {
    let column = |&(sign, bond): &(f64, BondId)| Some((sign, values.effort(bond)?));
    let left = share.bonds.iter().map(column).collect::<Option<_>>()?;
    let multiplier = scales.of_bond(share.multiplier, false);
    let of = share.bonds.first().map_or(multiplier, |b| scales.of_bond(b.1, false));
    let right = (values.effort(share.multiplier)?, multiplier);
    Some(Law::Product { left, factor: share.factor, divisor: None, right, what: "what a constraint puts on it", of })
}

/// How much the variables of each law make of each other, at the sample in the middle: pairs with weights.
pub(crate) fn links(
    (graph, quotients): (&BondGraph, &Quotients),
    values: &Values,
    scales: &Scales,
    settled: &Settled,
) -> Vec<Link> {
    // Junctions make nothing of each other's variables that has another size.
    let mut elements = fixed(graph);
    elements.retain(|element| !matches!(element.kind, Kind::Zero | Kind::One));
    on_all_cores(&elements, values, |elements, values| {
        links_of(elements, (graph, quotients), values, (scales, settled))
    })
    .concat()
}

/// Those of some elements.
fn links_of(
    elements: &[&Element],
    (graph, quotients): (&BondGraph, &Quotients),
    values: &Values,
    (scales, settled): (&Scales, &Settled),
) -> Vec<Link> {
    let mut links = Vec::new();
    let middle = values.times.len() / 2;
    let mut laws = Laws { graph, values, scales, quotients, laws: Vec::new(), missing: false };
    for element in elements {
        laws.of(element);
        for law in laws.laws.drain(..) {
            match law {
                Law::Line { right, of, .. } => {
                    links.push(Link { of, from: Quantity::Number, weight: right.magnitude(middle), straight: false });
                    let slopes = slopes_of(&right, graph, (scales, settled));
                    let tells = tells(settled, slopes.clone());
                    links.extend(slopes.map(|(from, weight)| Link { of, from, weight, straight: tells(from, weight) }));
                }
                Law::Value { right, of, .. } => {
                    let mut parts = vec![right];
                    let terms = Terms::of(&graph.exprs, right, &mut parts);
                    let Ok(reader) = values.reader(&parts) else { continue };
                    let weight = reader.values(middle, &[]).map_or(0.0, |v| terms.magnitude(&v));
                    links.push(Link { of, from: Quantity::Number, weight, straight: false });
                    let slopes = |at: &[(Symbol, f64)]| {
                        made_by(graph, (scales, settled), &reader, (middle, at), |v| v[0], |_| vec![1.0])
                    };
                    let near = slopes(&[]);
                    let tells = tells(settled, near.iter().copied());
                    let written = is_written_straight(&graph.exprs, right, reader.moves());
                    let ways: &[f64] = if written { &[] } else { &[1.0, -1.0] };
                    // Where it has no value there, it is no straight line.
                    let far: Vec<_> =
                        ways.iter().map(|&way| slopes(&far(graph, (scales, settled), &reader, way))).collect();
                    links.extend(near.iter().enumerate().map(|(i, &(from, weight))| {
                        let same = far.iter().all(|far| far.get(i).is_some_and(|far| is_same(weight, far.1)));
                        Link { of, from, weight, straight: same && tells(from, weight) }
                    }));
                }
                Law::Product { factor, divisor, right: (right, from), of, .. } => {
                    let parts: Vec<Expr> = [factor].into_iter().chain(divisor).collect();
                    let Ok(reader) = values.reader(&parts) else { continue };
                    let quotient = |v: &[f64]| v[1..].first().map_or(v[0], |divisor| v[0] / divisor);
                    let weight = reader.values(middle, &[]).map_or(0.0, |v| quotient(&v).abs());
                    let straight = reader.moves().is_empty() || !settled.is_lost(weight, from, of);
                    links.push(Link { of, from, weight, straight });
                    // A modulus that vanishes passes nothing on, but moves with what it reads.
                    let made = |v: &[f64]| quotient(v) * right[middle];
                    let weights = |v: &[f64]| match v[..] {
                        [over, under, ..] => vec![right[middle] / under, -right[middle] * over / (under * under)],
                        _ => vec![right[middle]],
                    };
                    let moved = made_by(graph, (scales, settled), &reader, (middle, &[]), made, weights);
                    links.extend(moved.into_iter().map(|(from, weight)| Link { of, from, weight, straight: false }));
                }
                Law::Row { factors, right, of, .. } => {
                    let Ok(reader) = values.reader(&factors) else { continue };
                    let weights = reader.values(middle, &[]).unwrap_or_default();
                    let terms = || right.iter().zip(&weights).map(|((_, from), weight)| (*from, weight.abs()));
                    let tells = tells(settled, terms());
                    let fixed = reader.moves().is_empty();
                    links.extend(terms().map(|(from, weight)| {
                        let straight = tells(from, weight) && (fixed || !settled.is_lost(weight, from, of));
                        Link { of, from, weight, straight }
                    }));
                    let made = |v: &[f64]| v.iter().zip(&right).map(|(f, (column, _))| f * column[middle]).sum();
                    let weights = |_: &[f64]| right.iter().map(|(column, _)| column[middle]).collect();
                    let moved = made_by(graph, (scales, settled), &reader, (middle, &[]), made, weights);
                    links.extend(moved.into_iter().map(|(from, weight)| Link { of, from, weight, straight: false }));
                }
                Law::Sum { .. } | Law::Zero { .. } => {}
            }
        }
    }
    links
}

/// What a sum of numbers times variables makes of each quantity that there is something of.
fn slopes_of<'l>(
    line: &'l Line,
    graph: &'l BondGraph,
    (scales, settled): (&'l Scales, &'l Settled),
) -> impl Iterator<Item = (Quantity, f64)> + Clone + 'l {
    let slopes = line.slopes().map(|(symbol, slope)| (scales.of(graph, symbol), slope));
    slopes.filter(|(from, _)| settled.of(*from) > 0.0)
}

/// Which terms of a sum tell how great their variables are: those that are not lost in the others, such as what an
/// entry of a rotation passes on that is 0 but for rounding.
fn tells(settled: &Settled, terms: impl Iterator<Item = (Quantity, f64)>) -> impl Fn(Quantity, f64) -> bool {
    let size = |from: Quantity, weight: f64| weight * settled.beside(from);
    let greatest = terms.fold(0.0f64, |most, (from, weight)| most.max(size(from, weight)));
    move |from, weight| size(from, weight) >= LOST * greatest
}

/// Everything that a law reads at its size, to one side or the other: what it makes of a variable there is as here if it is a
/// straight line in it, and no other variable tells how steep, as the load of a tyre does that has left the ground.
fn far(graph: &BondGraph, (scales, settled): (&Scales, &Settled), reader: &Reader, way: f64) -> Vec<(Symbol, f64)> {
    reader.moves().iter().map(|&symbol| (symbol, way * settled.of(scales.of(graph, symbol)))).collect()
}

/// Whether an expression is, as it is written, a sum of these symbols times what none of them moves.
fn is_written_straight(x: &Exprs, e: Expr, moves: &[Symbol]) -> bool {
    let moved = |e: Expr| x.depends_on_any(e, &|symbol| moves.contains(&symbol));
    let is_straight = |term: Expr| {
        let factors = match x.node(term) {
            Node::Mul(factors) => &factors[..],
            _ => &[term][..],
        };
        let mut moved = factors.iter().filter(|&&factor| moved(factor));
        moved.next().is_none_or(|&own| matches!(x.node(own), Node::Symbol(_))) && moved.next().is_none()
    };
    match x.node(e) {
        Node::Add(terms) => terms.iter().all(|&term| is_straight(term)),
        _ => is_straight(e),
    }
}

fn is_same(near: f64, far: f64) -> bool {
    (near - far).abs() <= STRAIGHT * near
}

/// A law by which one quantity makes so much of another.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Link {
    pub of: Quantity,
    pub from: Quantity,
    pub weight: f64,
    /// Whether the law is a straight line in it, so that it tells the other way round as well.
    pub straight: bool,
}

/// Collects the laws of an element.
struct Laws<'a, 'b> {
    graph: &'b BondGraph,
    values: &'b Values<'a>,
    scales: &'b Scales,
    quotients: &'b Quotients,
    laws: Vec<Law<'a>>,
    missing: bool,
}

impl<'a> Laws<'a, '_> {
    fn of(&mut self, element: &Element) {
        let bond = |port: usize| element.ports[port].bond;
        match &element.kind {
            Kind::Zero => {
                self.common(element, false);
                self.sum(element, true);
            }
            Kind::One => {
                self.common(element, true);
                self.sum(element, false);
            }
            Kind::EffortSource { value } => self.value(bond(0), false, *value, "its effort"),
            Kind::FlowSource { value } => self.value(bond(0), true, *value, "its flow"),
            Kind::ZeroCompliance { flow } => self.value(bond(0), true, *flow, "the flow it holds"),
            Kind::ResidualEffort { residual: Some(expr) } | Kind::ResidualFlow { residual: Some(expr) } => {
                self.laws.push(Law::Zero { expr: *expr, what: "its residual" });
            }
            Kind::ResidualEffort { residual: None } | Kind::EffortDetector => self.vanishes(bond(0), true, "its flow"),
            Kind::ResidualFlow { residual: None } | Kind::FlowDetector => self.vanishes(bond(0), false, "its effort"),
            Kind::Transformer { modulus } => {
                self.two_port(bond(0), bond(1), *modulus, false);
            }
            Kind::Gyrator { modulus } => {
                self.two_port(bond(0), bond(1), *modulus, true);
            }
            Kind::MatrixTransformer(_) | Kind::MatrixGyrator(_) => {
                for row in element.kind.two_port_rows() {
                    self.row(element, &row);
                }
            }
            Kind::Resistor(laws) | Kind::SkewGyrator(laws) => {
                for (port, law) in laws.iter().enumerate() {
                    match *law {
                        ResistorLaw::Resistive(e) => self.value(bond(port), false, e, "its law"),
                        ResistorLaw::Conductive(f) => self.value(bond(port), true, f, "its law"),
                        ResistorLaw::Implicit(expr) => self.laws.push(Law::Zero { expr, what: "its law" }),
                    }
                }
            }
            Kind::Inertance(storage) | Kind::Compliance(storage) => {
                let flow_is_z = matches!(element.kind, Kind::Inertance(_));
                for (port, law) in storage.laws.iter().enumerate() {
                    match *law {
                        StorageLaw::Integral(z) => self.value(bond(port), flow_is_z, z, "its law"),
                        StorageLaw::Derivative(x) => self.stored(storage.stored[port], x),
                        StorageLaw::Implicit(expr) => self.laws.push(Law::Zero { expr, what: "its law" }),
                        StorageLaw::Known { displacement, law } => {
                            self.stored(storage.stored[port], displacement);
                            self.value(bond(port), flow_is_z, law, "its law");
                        }
                    }
                }
            }
        }
    }

    fn column(&mut self, bond: BondId, flow: bool) -> Option<&'a [f64]> {
        let column = if flow { self.values.flow(bond) } else { self.values.effort(bond) };
        self.missing |= column.is_none();
        column
    }

    fn common(&mut self, element: &Element, flow: bool) {
        let what = if flow { "its common flow" } else { "its common effort" };
        let of = self.scales.of_bond(element.ports[0].bond, flow);
        let mut before: Option<&[f64]> = None;
        for port in &element.ports {
            let Some(own) = self.column(port.bond, flow) else { continue };
            // What is recorded once for all of them is common without saying.
            if let Some(other) = before.filter(|other| !std::ptr::eq(*other, own)) {
                self.laws.push(Law::Sum { terms: [(1.0, other), (-1.0, own)].into_iter().collect(), what, of });
            }
            before = Some(own);
        }
    }

    fn sum(&mut self, element: &Element, flow: bool) {
        let what = if flow { "the sum of its flows" } else { "the sum of its efforts" };
        let sign = |inward: bool| if inward { 1.0 } else { -1.0 };
        let known = element.ports.iter().filter_map(|p| Some((sign(p.inward), self.column(p.bond, flow)?)));
        let terms: Signed = known.collect();
        if terms.len() == element.ports.len() {
            let of = self.scales.of_bond(element.ports[0].bond, flow);
            self.laws.push(Law::Sum { terms, what, of });
        }
    }

    fn value(&mut self, bond: BondId, flow: bool, right: Expr, what: &'static str) {
        if let Some(left) = self.column(bond, flow) {
            let of = self.scales.of_bond(bond, flow);
            self.told(left, right, what, of);
        }
    }

    /// A column that has the value of an expression.
    fn told(&mut self, left: &'a [f64], right: Expr, what: &'static str, of: Quantity) {
        self.laws.push(match self.values.line(right) {
            Some(right) => Law::Line { left, right, what, of },
            None => Law::Value { left, right, what, of },
        });
    }

    fn vanishes(&mut self, bond: BondId, flow: bool, what: &'static str) {
        if let Some(column) = self.column(bond, flow) {
            let of = self.scales.of_bond(bond, flow);
            self.laws.push(Law::Sum { terms: [(1.0, column)].into_iter().collect(), what, of });
        }
    }

    fn stored(&mut self, symbol: Symbol, right: Expr) {
        match self.values.column(symbol) {
            Some(left) => {
                let of = self.scales.of(self.graph, symbol);
                self.told(left, right, "its stored quantity", of);
            }
            None => self.missing = true,
        }
    }

    /// One equation of a wide two-port.
    fn row(&mut self, element: &Element, row: &TwoPortRow) {
        let bond = |port: usize| element.ports[port].bond;
        let left = self.column(bond(row.port), !row.effort);
        let terms = row.terms.iter().map(|&(port, _)| {
            let of = self.scales.of_bond(bond(port), !row.of_efforts);
            self.column(bond(port), !row.of_efforts).map(|column| (column, of))
        });
        let right: Option<Vec<(&[f64], Quantity)>> = terms.collect();
        if let (Some(left), Some(right)) = (left, right) {
            let what = if row.effort { "its efforts" } else { "its flows" };
            let factors = row.terms.iter().map(|t| t.1).collect();
            let of = self.scales.of_bond(bond(row.port), !row.effort);
            self.laws.push(Law::Row { left, factors, right, what, of });
        }
    }

    /// `e_in = m e_out, f_out = m f_in`, or `e_in = r f_out, e_out = r f_in`.
    fn two_port(&mut self, input: BondId, output: BondId, factor: Expr, gyrator: bool) {
        let rows = match gyrator {
            false => [(input, false, output, false), (output, true, input, true)],
            true => [(input, false, output, true), (output, false, input, true)],
        };
        for (left, left_flow, right, right_flow) in rows {
            let what = if left_flow { "its flows" } else { "its efforts" };
            let of = self.scales.of_bond(left, left_flow);
            let other = self.scales.of_bond(right, right_flow);
            if let (Some(left), Some(right)) = (self.column(left, left_flow), self.column(right, right_flow)) {
                let quotient = self.quotients.get(&factor).map(|&(over, under)| (over, Some(under)));
                let (factor, divisor) = quotient.unwrap_or((factor, None));
                let left = [(1.0, left)].into_iter().collect();
                self.laws.push(Law::Product { left, factor, divisor, right: (right, other), what, of });
            }
        }
    }
}

/// A law with expressions, and what reads them.
struct Written<'v, 'a> {
    name: &'v str,
    law: Law<'a>,
    reader: Reader<'v, 'a>,
    /// Which of all laws it is.
    number: usize,
    /// The least that a miss counts relative to.
    scale: Scale,
    /// Of a product, how great what is multiplied is beside what it makes.
    ratio: f64,
}

impl Written<'_, '_> {
    /// By how much it is missed at a sample where its expressions have these values.
    fn miss(&self, sample: usize, v: &[f64]) -> f64 {
        match &self.law {
            Law::Sum { .. } | Law::Line { .. } => unreachable!("it has no expressions"),
            Law::Value { left, .. } => left[sample] - v[0],
            Law::Product { left, right: (right, _), .. } => {
                let sum = left.iter().map(|(sign, column)| sign * column[sample]).sum::<f64>();
                let made = v[0] * right[sample];
                match v[1..].first() {
                    None => sum - made,
                    // Where the divisor vanishes, what is divided does.
                    Some(divisor) => {
                        (divisor * sum - made) / divisor.abs().max(v[0].abs() * self.ratio).max(f64::MIN_POSITIVE)
                    }
                }
            }
            Law::Row { left, right, .. } => {
                let made = v.iter().zip(right).map(|(factor, (column, _))| factor * column[sample]);
                left[sample] - made.sum::<f64>()
            }
            Law::Zero { .. } => v.iter().sum(),
        }
    }

    /// Further terms of its scale there, besides what its variables make of it.
    fn terms(&self, values: &Values, sample: usize, v: &[f64]) -> Vec<Term> {
        match &self.law {
            Law::Sum { .. } | Law::Line { .. } | Law::Zero { .. } => Vec::new(),
            Law::Value { right, .. } => {
                let mut parts = Vec::new();
                let terms = Terms::of(values.exprs(), *right, &mut parts);
                let parts = values.reader(&parts).ok().and_then(|reader| reader.values(sample, &[]));
                parts.map(|v| Term::beside(Quantity::Number, terms.magnitude(&v))).into_iter().collect()
            }
            Law::Product { right: (_, other), .. } => vec![Term::beside(*other, v[0].abs())],
            Law::Row { right, .. } => {
                v.iter().zip(right).map(|(factor, (_, other))| Term::beside(*other, factor.abs())).collect()
            }
        }
    }
}

/// Laws at every sample.
struct Check<'a, 'b> {
    graph: &'b BondGraph,
    values: &'b Values<'a>,
    scales: &'b Scales,
    settled: &'b Settled,
    worst: Worst,
    /// How many laws there were.
    laws: usize,
    /// By how much one is missed, sample by sample.
    row: Vec<f64>,
}

impl<'a, 'b> Check<'a, 'b> {
    fn new(graph: &'b BondGraph, values: &'b Values<'a>, (scales, settled): (&'b Scales, &'b Settled)) -> Self {
        Check { graph, values, scales, settled, worst: Worst::default(), laws: 0, row: Vec::new() }
    }

    /// Checks the laws of elements; says what could not be checked.
    fn elements(&mut self, elements: &[&'b Element], quotients: &Quotients) -> Vec<String> {
        let (mut unchecked, mut written) = (Vec::new(), Vec::new());
        let Check { graph, values, scales, .. } = *self;
        let mut laws = Laws { graph, values, scales, quotients, laws: Vec::new(), missing: false };
        for &element in elements {
            laws.of(element);
            if std::mem::take(&mut laws.missing) {
                unchecked.push(format!("laws of {}: not all of its efforts and flows are known", element.name));
            }
            for law in laws.laws.drain(..) {
                if let Err(missing) = self.law(&element.name, law, &mut written) {
                    unchecked.push(format!("a law of {}: {missing} is not known", element.name));
                }
            }
            if written.len() >= TOGETHER {
                self.written(&written);
                written.clear();
            }
        }
        self.written(&written);
        unchecked
    }

    /// Checks a law of columns alone; those with expressions are gathered.
    fn law(&mut self, name: &'b str, law: Law<'a>, written: &mut Vec<Written<'b, 'a>>) -> Result<(), String> {
        let parts = match &law {
            Law::Sum { terms, what, of } => {
                self.sum(name, terms, what, *of);
                return Ok(());
            }
            Law::Line { left, right, what, of } => {
                self.line(name, (left, right), what, *of);
                return Ok(());
            }
            Law::Value { right, .. } => vec![*right],
            Law::Product { factor, divisor, .. } => [*factor].into_iter().chain(*divisor).collect(),
            Law::Row { factors, .. } => factors.clone(),
            Law::Zero { expr, .. } => match self.graph.exprs.node(*expr) {
                Node::Add(terms) => terms.to_vec(),
                _ => vec![*expr],
            },
        };
        let reader = self.values.reader(&parts)?;
        let settled = self.settled;
        let ratio = match &law {
            Law::Product { right: (_, other), of, .. } if settled.of(*of) > 0.0 => settled.of(*other) / settled.of(*of),
            _ => 0.0,
        };
        let scale = settled.scale(law.natural().as_slice());
        self.laws += 1;
        written.push(Written { name, law, reader, number: self.laws, scale, ratio });
        Ok(())
    }

    fn sum(&mut self, name: &str, terms: &[(f64, &[f64])], what: &str, of: Quantity) {
        self.laws += 1;
        let natural = Term::of(of, 1.0);
        let scale = self.settled.scale(&[natural]);
        let Check { values, settled, .. } = *self;
        let row = &mut self.row;
        row.clear();
        row.resize(values.times.len(), -0.0);
        for &(sign, column) in terms {
            row.iter_mut().zip(column).for_each(|(sum, value)| *sum += sign * value);
        }
        let raw = |k: usize, miss: f64| raw(miss, values.times[k], name, what, vec![natural]);
        self.worst.note_row(self.laws, row, scale, settled, raw);
    }

    /// A column that is a sum of numbers times others.
    fn line(&mut self, name: &str, (left, right): (&[f64], &Line), what: &str, of: Quantity) {
        self.laws += 1;
        let Check { graph, values, scales, settled, .. } = *self;
        let natural = Term::of(of, 1.0);
        let scale = settled.scale(&[natural]);
        let row = &mut self.row;
        right.values(values.times.len(), row);
        row.iter_mut().zip(left).for_each(|(value, left)| *value = left - *value);
        self.worst.note_row(self.laws, row, scale, settled, |k, miss| {
            let slopes = slopes_of(right, graph, (scales, settled));
            let terms = [natural, Term::beside(Quantity::Number, right.magnitude(k))].into_iter();
            let terms = terms.chain(slopes.map(|(from, slope)| Term::beside(from, slope))).collect();
            raw(miss, values.times[k], name, what, terms)
        });
    }

    /// Laws with expressions: what they read has much in common.
    fn written(&mut self, laws: &[Written<'b, 'a>]) {
        let values = self.values;
        let (together, alone): (Vec<&Written>, Vec<&Written>) = laws.iter().partition(|law| law.reader.is_at_samples());
        let readers: Vec<&Reader> = together.iter().map(|law| &law.reader).collect();
        let all = values.together(&readers);
        let samples = values.times.len();
        let mut zeros = vec![Vec::new(); together.len()];
        all.read(|law, sample, v| match together[law].law {
            Law::Zero { .. } => zeros[law].push(v.to_vec()),
            _ => self.at(together[law], sample, v),
        });
        together.into_iter().zip(zeros).filter(|law| !law.1.is_empty()).for_each(|(law, found)| self.zero(law, &found));
        for law in alone {
            let found = (0..samples).map(|sample| law.reader.values(sample, &[]).unwrap_or_default());
            match law.law {
                Law::Zero { .. } => self.zero(law, &found.collect::<Vec<_>>()),
                _ => (0..samples).zip(found).for_each(|(k, v)| self.at(law, k, &v)),
            }
        }
    }

    /// A law that something is measured in, at a sample where its expressions have these values.
    fn at(&mut self, law: &Written, sample: usize, v: &[f64]) {
        let reader = &law.reader;
        if reader.is_beyond(sample) || reader.is_unclear(sample) {
            return;
        }
        let (graph, values, scales, settled) = (self.graph, self.values, self.scales, self.settled);
        let miss = |v: &[f64]| law.miss(sample, v);
        let off = self.least(reader, sample, miss(v), miss);
        self.worst.note_of(law.number, off, law.scale, settled, || {
            let mut terms: Vec<Term> = law.law.natural().into_iter().collect();
            terms.extend(law.terms(values, sample, v));
            let all = sensitivities(graph, scales, settled, reader, sample, miss);
            terms.extend(all.into_iter().map(|(quantity, weight)| Term::beside(quantity, weight)));
            raw(off, values.times[sample], law.name, law.law.what(), terms)
        });
    }

    /// What a law is missed by: after a jump, where a condition may stand on its border, in the branch that holds best.
    /// The run has decided by where it came from, which no sample tells.
    fn least(&self, reader: &Reader, sample: usize, here: f64, miss: impl Fn(&[f64]) -> f64) -> f64 {
        if !reader.jumps_at(sample) {
            return here;
        }
        let beside = |&symbol: &Symbol| {
            let by = BORDER * self.settled.of(self.scales.of(self.graph, symbol));
            [by, -by].map(|by| reader.values(sample, &[(symbol, by)]).map_or(here, |v| miss(&v)))
        };
        reader
            .moves()
            .iter()
            .flat_map(beside)
            .fold(here, |least, off| if off.abs() < least.abs() { off } else { least })
    }

    /// An expression that vanishes: relative to its terms where it has several, else to what its variables make of it. `found` are
    /// the values of its terms, sample by sample.
    fn zero(&mut self, law: &Written, found: &[Vec<f64>]) {
        let (graph, values, scales, settled) = (self.graph, self.values, self.scales, self.settled);
        let reader = &law.reader;
        let counts = |sample: &usize| !reader.is_unclear(*sample) && !reader.is_beyond(*sample);
        let several = found.iter().any(|v| v.len() > 1);
        let size = |v: &Vec<f64>| v.iter().fold(0.0f64, |most, v| most.max(v.abs()));
        let greatest = (0..found.len()).filter(counts).map(|k| size(&found[k])).fold(0.0, f64::max);
        let natural = Term::of(Quantity::Number, if several { greatest } else { 0.0 });
        let scale = settled.scale(&[natural]);
        for k in (0..found.len()).filter(counts) {
            let miss = |v: &[f64]| law.miss(k, v);
            let off = self.least(reader, k, miss(&found[k]), miss);
            self.worst.note_of(law.number, off, scale, settled, || {
                let all = sensitivities(graph, scales, settled, reader, k, miss);
                let term = if several { Term::beside } else { Term::of };
                let terms = all.into_iter().map(|(quantity, weight)| term(quantity, weight));
                let terms = [natural].into_iter().chain(terms).collect();
                raw(off, values.times[k], law.name, law.law.what(), terms)
            });
        }
    }
}

pub(crate) fn raw(miss: f64, time: f64, name: &str, what: &str, terms: Vec<Term>) -> Raw {
    Raw { miss, resolution: 0.0, time, place: format!("{name}: {what}"), terms }
}

/// Part of its scale by which a variable may lie beside the border at which a run has changed its branch: rounding.
const BORDER: f64 = 1e-12;

/// A law is a straight line if its slope differs by no more than this part where all that it reads is moved by its size.
const STRAIGHT: f64 = 0.1;

/// Terms below this part of the greatest of their sum are lost in it.
const LOST: f64 = 1e-3;

/// Of so many variables differences tell how steep an expression is in each.
const FEW: usize = 8;

/// Part of its scale by which a variable is moved to see what changes with it.
const MOVED: f64 = 1e-6;

/// What is read at a sample, with how much `of` it changes with each of its variables.
pub(crate) fn sensitivities(
    graph: &BondGraph,
    scales: &Scales,
    settled: &Settled,
    reader: &Reader,
    sample: usize,
    of: impl Fn(&[f64]) -> f64,
) -> Vec<(Quantity, f64)> {
    moved_by(graph, (scales, settled), reader, (sample, &[]), of)
}

/// The same where variables are moved so far. `of` is a sum of what is read, each times a weight, to first order: of many
/// variables, as a chain of joints has, slopes tell it all at once.
fn made_by(
    graph: &BondGraph,
    (scales, settled): (&Scales, &Settled),
    reader: &Reader,
    (sample, from): (usize, &[(Symbol, f64)]),
    of: impl Fn(&[f64]) -> f64,
    weights: impl FnOnce(&[f64]) -> Vec<f64>,
) -> Vec<(Quantity, f64)> {
    let many = reader.moves().len() > FEW;
    let Some(slopes) = many.then(|| reader.slopes((sample, from), weights)).flatten() else {
        return moved_by(graph, (scales, settled), reader, (sample, from), of);
    };
    let all = reader.moves().iter().zip(slopes).map(|(&symbol, slope)| (scales.of(graph, symbol), slope.abs()));
    all.filter(|(quantity, _)| settled.of(*quantity) > 0.0).collect()
}

/// The same by differences.
fn moved_by(
    graph: &BondGraph,
    (scales, settled): (&Scales, &Settled),
    reader: &Reader,
    (sample, from): (usize, &[(Symbol, f64)]),
    of: impl Fn(&[f64]) -> f64,
) -> Vec<(Quantity, f64)> {
    let (mut moved, mut room) = (from.to_vec(), Vec::new());
    let Some(here) = reader.values_in(&mut room, sample, &moved).map(&of) else { return Vec::new() };
    let mut weight = |symbol: Symbol| {
        let quantity = scales.of(graph, symbol);
        let by = MOVED * settled.of(quantity);
        let mut change = |by: f64| {
            moved.push((symbol, by));
            let there = reader.values_in(&mut room, sample, &moved).map(&of);
            moved.pop();
            there.map(|there| (there - here).abs()).filter(|c| c.is_finite())
        };
        let most = [by, -by].into_iter().filter_map(&mut change).fold(0.0f64, f64::max);
        (by > 0.0).then(|| (quantity, most / by))
    };
    reader.moves().iter().copied().filter_map(&mut weight).collect()
}
