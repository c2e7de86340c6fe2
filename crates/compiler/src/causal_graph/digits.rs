//! Loss of digits by a choice of causality: growth of rounding errors from the inputs to the outputs.
//!
//! A junction structure loses no digits as long as its entries are near 1, with every port scaled by its own law:
//! efforts by `√(e/f)` of a resistor, co-energies by `√(X/z)` of a storage. Source: `method.md`, 5.1 and 5.2.

use std::collections::{BTreeMap, BTreeSet};

use petgraph::unionfind::UnionFind;

use super::ports::Solved;
use super::{Combination, Role};
use crate::algebra::{Expr, Exprs, Node, NumericPoint, Symbol};
use crate::bond_graph::{BondGraph, Kind, PortRef, ResistorLaw, StorageLaw};

/// Error growth above which another causality is sought.
pub(super) const COSTLY: f64 = 1e4;
/// Larger groups of storages that depend on each other are not examined.
const GROUP_AT_MOST: usize = 100;
/// A divisor below this fraction of the sum of its terms' magnitudes counts as zero.
const VANISHING: f64 = 1e-9;

/// The slope of a law at a point: `X/z` of a storage, `e/f` of a resistor.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slope {
    /// Its magnitude; finite, above 0.
    pub size: f64,
    /// Whether it is constant.
    pub straight: bool,
}

/// The slope of the law of a port; `None` if it has none, or one that is zero or not finite.
pub(super) fn slope(x: &Exprs, graph: &BondGraph, point: &NumericPoint, port: PortRef) -> Option<Slope> {
    let element = &graph.elements[port.element];
    let bond = &graph.bonds[graph.bond_of(port)];
    let index = port.port as usize;
    let (law, by, inverse) = match &element.kind {
        Kind::Resistor(laws) | Kind::SkewGyrator(laws) => match laws[index] {
            ResistorLaw::Resistive(e) => (e, bond.flow, false),
            ResistorLaw::Conductive(f) => (f, bond.effort, true),
            ResistorLaw::Implicit(_) => return None,
        },
        Kind::Inertance(storage) | Kind::Compliance(storage) => match storage.laws[index] {
            StorageLaw::Integral(e) => (e, storage.stored[index], true),
            StorageLaw::Derivative(e) if matches!(element.kind, Kind::Inertance(_)) => (e, bond.flow, false),
            StorageLaw::Derivative(e) => (e, bond.effort, false),
            _ => return None,
        },
        _ => return None,
    };
    let at = |v: f64| x.eval(law, &mut |s| if s == by { v } else { point.of(s) });
    let (here, step) = (point.of(by), 1e-3 * point.of(by).abs().max(1.0));
    let steep = |v: f64| ((at(v + step) - at(v - step)) / (2.0 * step)).abs();
    let size = steep(here);
    let straight = (steep(here + 2.0) - size).abs() <= 1e-6 * size;
    let size = if inverse { 1.0 / size } else { size };
    (size.is_finite() && size > 0.0).then_some(Slope { size, straight })
}

/// The magnitude of the slope of a port's law at a point, as [`slope`] has it.
pub(crate) fn magnitude_of_slope(x: &Exprs, graph: &BondGraph, point: &NumericPoint, port: PortRef) -> Option<f64> {
    slope(x, graph, point, port).map(|slope| slope.size)
}

/// The growth factor of rounding errors in a part with this causality; infinite where a divisor vanishes.
pub(super) fn cost(x: &Exprs, graph: &BondGraph, solved: &Solved, point: &mut NumericPoint) -> f64 {
    if solved.watched.iter().any(|&divisor| vanishes(x, divisor, point)) {
        return f64::INFINITY;
    }
    let definitions = solved.definitions.iter().map(|(s, row)| (*s, row));
    let mut rows = Rows { of: definitions.collect(), known: BTreeMap::new() };
    let finite = solved.definitions.iter().flat_map(|(_, row)| &row.0).all(|t| point.value(x, t.1).is_finite());
    if !finite {
        return f64::INFINITY;
    }
    let worse = |a: f64, b: f64| if a.is_nan() || b.is_nan() { f64::INFINITY } else { a.max(b) };
    let laws = cost_of_laws(x, graph, solved, point, &mut rows);
    worse(laws, cost_of_storages(x, graph, solved, point, &mut rows))
}

/// Whether a divisor is zero within rounding error at a point.
pub(crate) fn vanishes(x: &Exprs, divisor: Expr, point: &mut NumericPoint) -> bool {
    match x.node(divisor) {
        Node::Mul(factors) => factors.iter().any(|&f| vanishes(x, f, point)),
        Node::Pow(base, _) => vanishes(x, *base, point),
        Node::Whole(part) => vanishes(x, *part, point),
        Node::Add(_) | Node::Call(..) => {
            let size = natural_size(x, divisor, point, &mut BTreeMap::new());
            point.value(x, divisor).abs() <= VANISHING * size
        }
        _ => point.value(x, divisor) == 0.0,
    }
}

/// The size that an expression would have if its terms did not cancel and its functions, of angles for the most part, were 1.
fn natural_size(x: &Exprs, e: Expr, point: &mut NumericPoint, known: &mut BTreeMap<Expr, f64>) -> f64 {
    if let Some(&size) = known.get(&e) {
        return size;
    }
    let size = match x.node(e) {
        Node::Add(terms) => terms.iter().map(|&t| natural_size(x, t, point, known)).sum(),
        Node::Mul(factors) => factors.iter().map(|&f| natural_size(x, f, point, known)).product(),
        Node::Pow(base, exponent) => {
            let exponent = x.is_number(*exponent).and_then(|n| n.small());
            let whole = exponent.filter(|(n, of)| *of == 1 && n.unsigned_abs() <= 8);
            let Some((n, _)) = whole else { return point.value(x, e).abs() };
            let base = natural_size(x, *base, point, known);
            let power: f64 = (0..n.unsigned_abs()).map(|_| base).product();
            if n < 0 { 1.0 / power } else { power }
        }
        Node::Call(..) => 1.0_f64.max(point.value(x, e).abs()),
        Node::Whole(part) => natural_size(x, *part, point, known),
        _ => point.value(x, e).abs(),
    };
    known.insert(e, size);
    size
}

/// Definitions at a point as numeric combinations of inputs alone.
struct Rows<'a> {
    of: BTreeMap<Symbol, &'a Combination>,
    known: BTreeMap<Symbol, BTreeMap<Symbol, f64>>,
}

impl Rows<'_> {
    fn row(&mut self, x: &Exprs, point: &mut NumericPoint, symbol: Symbol) -> BTreeMap<Symbol, f64> {
        let mut stack = vec![symbol];
        while let Some(&top) = stack.last() {
            let Some(&definition) = self.of.get(&top).filter(|_| !self.known.contains_key(&top)) else {
                stack.pop();
                continue;
            };
            let before = stack.len();
            stack.extend(
                definition.0.iter().map(|t| t.0).filter(|s| self.of.contains_key(s) && !self.known.contains_key(s)),
            );
            if stack.len() == before {
                let mut sum: BTreeMap<Symbol, f64> = BTreeMap::new();
                for &(read, e) in &definition.0 {
                    let factor = point.value(x, e);
                    match self.known.get(&read) {
                        Some(row) => row.iter().for_each(|(&s, v)| *sum.entry(s).or_default() += factor * v),
                        None => *sum.entry(read).or_default() += factor,
                    }
                }
                self.known.insert(top, sum);
                stack.pop();
            }
        }
        self.known.get(&symbol).cloned().unwrap_or_else(|| BTreeMap::from([(symbol, 1.0)]))
    }
}

/// The largest loop gain between two linear laws, each scaled by its slope: the square of the entry between them. The result
/// `1 + gain` then loses the digits of 1.
fn cost_of_laws(x: &Exprs, graph: &BondGraph, solved: &Solved, point: &mut NumericPoint, rows: &mut Rows) -> f64 {
    let laws = solved.ports.iter().filter(|p| matches!(p.role, Role::Algebraic(_)));
    let weighed = laws.filter_map(|p| {
        let slope = slope(x, graph, point, p.port).filter(|s| s.straight)?;
        let effort_given = graph.bonds[graph.bond_of(p.port)].effort == p.input;
        // The factor by which a variable gets the unit of the square root of power.
        let effort = 1.0 / slope.size.sqrt();
        Some((p, if effort_given { (effort, 1.0 / effort) } else { (1.0 / effort, effort) }))
    });
    let weighed: Vec<_> = weighed.collect();
    let inputs: BTreeMap<Symbol, f64> = weighed.iter().map(|(p, (input, _))| (p.input, *input)).collect();
    let mut most = 1.0f64;
    for (port, (_, output)) in &weighed {
        let row = rows.row(x, point, port.output);
        let entries = row.iter().filter_map(|(s, v)| Some((output * v / inputs.get(s)?).abs()));
        most = entries.map(|entry| entry * entry).fold(most, f64::max);
    }
    most
}

/// The error growth of the matrix `M_i + Sᵀ M_d S`, scaled to a unit diagonal: the inverse of its least pivot.
fn cost_of_storages(x: &Exprs, graph: &BondGraph, solved: &Solved, point: &mut NumericPoint, rows: &mut Rows) -> f64 {
    let mass = |point: &NumericPoint, port: PortRef| slope(x, graph, point, port).map_or(1.0, |s| s.size);
    let independent = solved.ports.iter().filter(|p| p.role == Role::Independent);
    let mut masses: Vec<(Symbol, f64)> = independent.map(|p| (p.input, mass(point, p.port))).collect();
    masses.extend(solved.virtual_speeds.iter().map(|v| (v.speed, 0.0)));
    let index: BTreeMap<Symbol, usize> = masses.iter().enumerate().map(|(i, m)| (m.0, i)).collect();
    let mut set = UnionFind::<usize>::new(masses.len());
    let mut dependent: Vec<(f64, Vec<(usize, f64)>)> = Vec::new();
    for port in solved.ports.iter().filter(|p| p.role == Role::Dependent) {
        let row = rows.row(x, point, port.output);
        let row: Vec<(usize, f64)> = row.iter().filter_map(|(s, &v)| Some((*index.get(s)?, v))).collect();
        row.windows(2).for_each(|w| _ = set.union(w[0].0, w[1].0));
        dependent.push((mass(point, port.port), row));
    }
    let mut groups: BTreeMap<usize, BTreeSet<usize>> = BTreeMap::new();
    for &(i, _) in dependent.iter().flat_map(|d| &d.1) {
        groups.entry(set.find(i)).or_default().insert(i);
    }
    let mut most = 1.0f64;
    for members in groups.into_values().filter(|g| g.len() <= GROUP_AT_MOST) {
        let place: BTreeMap<usize, usize> = members.iter().enumerate().map(|(k, &i)| (i, k)).collect();
        let mut matrix = vec![vec![0.0; members.len()]; members.len()];
        members.iter().enumerate().for_each(|(k, &i)| matrix[k][k] = masses[i].1);
        for (mass, row) in dependent.iter().filter(|d| d.1.iter().any(|(i, _)| place.contains_key(i))) {
            for (i, a) in row {
                row.iter().for_each(|(j, b)| matrix[place[i]][place[j]] += mass * a * b);
            }
        }
        most = most.max(1.0 / least_pivot(matrix));
    }
    most
}

/// The least pivot of a symmetric matrix with its diagonal made 1; 0 if it is not definite.
fn least_pivot(mut a: Vec<Vec<f64>>) -> f64 {
    let n = a.len();
    let scale: Vec<f64> = (0..n).map(|i| 1.0 / a[i][i].sqrt()).collect();
    a.iter_mut().zip(&scale).for_each(|(row, si)| row.iter_mut().zip(&scale).for_each(|(v, sj)| *v *= si * sj));
    let mut least = 1.0f64;
    for k in 0..n {
        let pivot = a[k][k];
        if !(pivot > 0.0 && pivot.is_finite()) {
            return 0.0;
        }
        least = least.min(pivot);
        let (above, below) = a.split_at_mut(k + 1);
        for row in below {
            let factor = row[k] / pivot;
            row.iter_mut().zip(&above[k]).skip(k).for_each(|(v, p)| *v -= factor * p);
        }
    }
    least
}
