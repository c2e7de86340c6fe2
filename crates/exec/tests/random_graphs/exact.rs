//! The raw equations of a graph in exact numbers: every junction and element row by row, no causality, no formulation.

use std::collections::BTreeMap;

use num_bigint::BigInt;
use num_rational::BigRational;
use num_traits::{One, ToPrimitive, Zero};

use crate::graph::{Graph, Kind, Modulus, Number, Random, Reading, Resisting, Signal};

pub type Exact = BigRational;

type Row = BTreeMap<usize, Exact>;

/// What the raw equations say about a graph.
pub struct Count {
    /// Whether the sources can hold together.
    pub consistent: bool,
    /// Whether the pencil of what is consistent is regular.
    pub regular: bool,
    /// For every bond whether its effort and its flow are determined.
    pub determined: Vec<(bool, bool)>,
    /// Coefficients of `det(s E - A)`, constant first; its degree is the number of finite eigenvalues.
    pub polynomial: Vec<Exact>,
}

impl Count {
    /// Number of dynamic degrees of freedom.
    pub fn degree(&self) -> usize {
        self.polynomial.len().saturating_sub(1)
    }
}

fn exact(number: Number) -> Exact {
    Exact::new(BigInt::from(number.top), BigInt::from(number.bottom))
}

/// A random rational, generic enough that nothing vanishes by chance.
fn generic(random: &mut Random) -> Exact {
    Exact::new(BigInt::from(random.below(1_000_003) + 1), BigInt::from(random.below(999_983) + 1))
}

/// Builds and counts. Laws that are not linear count with random positive slopes, moduli that vary with values at
/// random states.
pub fn count(graph: &Graph, random: &mut Random) -> Count {
    let storages = graph.storages();
    let n = storages.len();
    let mut columns = Columns { graph, storages: &storages, bonds: graph.bonds.len() };
    let mut rows = columns.rows(random);
    let bond_columns = 2 * graph.bonds.len();
    let pivots = reduce(&mut rows, 0..bond_columns);
    let is_free = |c: usize| !pivots.contains_key(&c) && !columns.is_replaced(c);
    let known = |c: usize| match pivots.get(&c) {
        Some(&row) => rows[row].keys().all(|&other| other == c || other >= bond_columns || !is_free(other)),
        None => columns.is_replaced(c),
    };
    let determined = (0..graph.bonds.len()).map(|b| (known(2 * b), known(2 * b + 1))).collect();
    let used: Vec<usize> = pivots.values().copied().collect();
    let mut rest: Vec<Row> = (0..rows.len()).filter(|r| !used.contains(r)).map(|r| rows[r].clone()).collect();
    let pivots = reduce(&mut rest, bond_columns..bond_columns + 2 * n);
    let kept: Vec<usize> = pivots.values().copied().collect();
    let consistent = (0..rest.len()).filter(|r| !kept.contains(r)).all(|r| rest[r].is_empty());
    let pencil: Vec<&Row> = kept.iter().map(|&r| &rest[r]).collect();
    let entry = |row: &Row, c: usize| row.get(&c).cloned().unwrap_or_else(Exact::zero);
    let matrix = |offset: usize| -> Vec<Vec<Exact>> {
        pencil.iter().map(|row| (0..n).map(|i| entry(row, bond_columns + offset + i)).collect()).collect()
    };
    // Rows read e X' + a X + … = 0.
    let (e, a) = (matrix(0), matrix(n));
    let polynomial = if pencil.len() == n { determinant_polynomial(&e, &a) } else { Vec::new() };
    Count { consistent, regular: !polynomial.is_empty(), determined, polynomial }
}

/// Which column is which: bonds' efforts and flows, then rates, stored quantities, then what is given.
struct Columns<'a> {
    graph: &'a Graph,
    storages: &'a [usize],
    bonds: usize,
}

impl Columns<'_> {
    fn is_replaced(&self, column: usize) -> bool {
        column < 2 * self.bonds && self.storages.iter().any(|&s| self.graph.bond_of(s) == Some(column / 2))
    }

    fn rows(&mut self, random: &mut Random) -> Vec<Row> {
        let graph = self.graph;
        let base = 2 * self.bonds;
        let n = self.storages.len();
        let (constant, sine, inputs) = (base + 2 * n, base + 2 * n + 1, base + 2 * n + 2);
        let one = Exact::one;
        let mut signals: BTreeMap<(Option<usize>, usize, bool), Exact> = BTreeMap::new();
        let mut rows: Vec<Row> = Vec::new();
        let mut replaced: BTreeMap<usize, (usize, Exact)> = BTreeMap::new();
        for (i, &s) in self.storages.iter().enumerate() {
            let bond = graph.bond_of(s).expect("used");
            let (rate, stored) = (base + i, base + n + i);
            let (e, f) = (2 * bond, 2 * bond + 1);
            match graph.nodes[s].kind {
                Kind::Inertance(law) => {
                    let slope = if law.cubic.is_some() { generic(random) } else { exact(law.size).recip() };
                    replaced.insert(e, (rate, one()));
                    replaced.insert(f, (stored, slope));
                }
                Kind::Compliance(law) => {
                    let slope = if law.cubic.is_some() { generic(random) } else { exact(law.size) };
                    replaced.insert(f, (rate, one()));
                    replaced.insert(e, (stored, slope));
                }
                _ => unreachable!("a storage"),
            }
        }
        let mut modulus = |m: Modulus, random: &mut Random| match m {
            Modulus::Constant(number) => exact(number),
            Modulus::Varying { a, b, of, sine } => {
                let key = match of {
                    Reading::Stored(n) => (None, n, sine),
                    Reading::Integral(n) => (Some(0), n, sine),
                };
                let value = signals.entry(key).or_insert_with(|| generic(random)).clone();
                exact(a) + exact(b) * value
            }
        };
        for (node, it) in graph.nodes.iter().enumerate() {
            let at = graph.bonds_at(node);
            let Some(&(first, _)) = at.first() else { continue };
            let e = |b: usize| 2 * b;
            let f = |b: usize| 2 * b + 1;
            let signed = |inward: bool| if inward { one() } else { -one() };
            let source = |column: usize, signal: Signal| match signal {
                Signal::Waving(a, b) => vec![(column, one()), (constant, -exact(a)), (sine, -exact(b))],
                Signal::Input(_) => vec![(column, one()), (inputs + node, -one())],
                Signal::Sensed(a, b, junction) => {
                    let bond = graph.bonds_at(junction)[0].0;
                    let read = if matches!(graph.nodes[junction].kind, Kind::Zero) { e(bond) } else { f(bond) };
                    vec![(column, one()), (constant, -exact(a)), (read, -exact(b))]
                }
            };
            let mut add = |terms: Vec<(usize, Exact)>| {
                let mut row = Row::new();
                for (column, factor) in terms {
                    let (column, factor) = match replaced.get(&column) {
                        Some((other, by)) => (*other, factor * by),
                        None => (column, factor),
                    };
                    let sum = row.remove(&column).unwrap_or_else(Exact::zero) + factor;
                    if !sum.is_zero() {
                        row.insert(column, sum);
                    }
                }
                rows.push(row);
            };
            match it.kind {
                Kind::Zero => {
                    at[1..].iter().for_each(|&(b, _)| add(vec![(e(first), one()), (e(b), -one())]));
                    add(at.iter().map(|&(b, inward)| (f(b), signed(inward))).collect());
                }
                Kind::One => {
                    at[1..].iter().for_each(|&(b, _)| add(vec![(f(first), one()), (f(b), -one())]));
                    add(at.iter().map(|&(b, inward)| (e(b), signed(inward))).collect());
                }
                Kind::Transformer(m) | Kind::Gyrator(m) => {
                    let input = at.iter().find(|b| b.1).expect("a bond in").0;
                    let output = at.iter().find(|b| !b.1).expect("a bond out").0;
                    let m = modulus(m, random);
                    if matches!(it.kind, Kind::Transformer(_)) {
                        add(vec![(e(input), one()), (e(output), -m.clone())]);
                        add(vec![(f(output), one()), (f(input), -m)]);
                    } else {
                        add(vec![(e(input), one()), (f(output), -m.clone())]);
                        add(vec![(e(output), one()), (f(input), -m)]);
                    }
                }
                Kind::Effort(s) => add(source(e(first), s)),
                Kind::Flow(s) => add(source(f(first), s)),
                Kind::Held => add(vec![(f(first), one())]),
                Kind::Inertance(_) | Kind::Compliance(_) => {}
                Kind::Resistor(law) => {
                    let r = match law {
                        Resisting::Resistance(r) => exact(r),
                        Resisting::Conductance(g) => exact(g).recip(),
                        Resisting::CubicEffort(..) | Resisting::CubicFlow(..) => generic(random),
                    };
                    add(vec![(e(first), one()), (f(first), -r)]);
                }
            }
        }
        rows
    }
}

/// Reduced row echelon form as far as these columns go. Pivot column to row.
fn reduce(rows: &mut [Row], columns: std::ops::Range<usize>) -> BTreeMap<usize, usize> {
    let mut pivots: BTreeMap<usize, usize> = BTreeMap::new();
    let mut used = vec![false; rows.len()];
    for column in columns {
        let candidates = (0..rows.len()).filter(|&r| !used[r] && rows[r].contains_key(&column));
        let Some(pivot) = candidates.min_by_key(|&r| rows[r].len()) else { continue };
        used[pivot] = true;
        pivots.insert(column, pivot);
        let by = rows[pivot][&column].recip();
        rows[pivot].values_mut().for_each(|v| *v *= &by);
        let row = rows[pivot].clone();
        for r in (0..rows.len()).filter(|&r| r != pivot) {
            let Some(factor) = rows[r].get(&column).cloned() else { continue };
            for (c, value) in &row {
                let sum = rows[r].remove(c).unwrap_or_else(Exact::zero) - &factor * value;
                if !sum.is_zero() {
                    rows[r].insert(*c, sum);
                }
            }
        }
    }
    pivots
}

/// Coefficients of `det(s e + a)`, constant first, without vanishing leading ones; empty if it vanishes everywhere.
fn determinant_polynomial(e: &[Vec<Exact>], a: &[Vec<Exact>]) -> Vec<Exact> {
    let n = e.len();
    let point = |k: usize| Exact::from_integer(BigInt::from(k));
    let at = |k: usize| {
        let s = point(k);
        let row = |i: usize| (0..n).map(|j| &s * &e[i][j] + &a[i][j]).collect();
        determinant((0..n).map(row).collect())
    };
    // Newton's divided differences, then Horner.
    let mut table: Vec<Exact> = (0..=n).map(at).collect();
    for order in 1..=n {
        for k in (order..=n).rev() {
            table[k] = (&table[k] - &table[k - 1]) / point(order);
        }
    }
    let mut polynomial = vec![Exact::zero(); n + 1];
    for k in (0..=n).rev() {
        for i in (1..=n).rev() {
            polynomial[i] = &polynomial[i - 1] - &polynomial[i] * point(k);
        }
        polynomial[0] = &table[k] - &polynomial[0] * point(k);
    }
    while polynomial.last().is_some_and(Zero::is_zero) {
        polynomial.pop();
    }
    polynomial
}

fn determinant(mut m: Vec<Vec<Exact>>) -> Exact {
    let n = m.len();
    let mut result = Exact::one();
    for k in 0..n {
        let Some(pivot) = (k..n).find(|&r| !m[r][k].is_zero()) else { return Exact::zero() };
        if pivot != k {
            m.swap(pivot, k);
            result = -result;
        }
        result *= &m[k][k];
        let head = m[k].clone();
        for row in m[k + 1..].iter_mut().filter(|row| !row[k].is_zero()) {
            let factor = &row[k] / &head[k];
            for (value, above) in row[k + 1..].iter_mut().zip(&head[k + 1..]) {
                *value -= &factor * above;
            }
        }
    }
    result
}

/// An exact number as the nearest machine number.
pub fn float(value: &Exact) -> f64 {
    value.to_f64().expect("finite")
}
