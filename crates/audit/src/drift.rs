//! How far positions have drifted from the relations that their speeds keep.
//!
//! Where the relation has a closed form, it is what its value has changed by. Else it is the sum of what each interval between
//! samples adds: what the positions change by, less the integrals of their rates, times the factors of the relation there.

use crate::values::Values;
use halfarrow_compiler::algebra::{EvaluationOrder, Expr, Exprs, PlainNames, Symbol, ascii};
use halfarrow_compiler::bond_graph::{BondGraph, Integral, Meaning, velocity_relations};

/// How far positions have drifted from a relation that their speeds keep.
#[derive(Debug, Clone, PartialEq)]
pub struct Drift {
    /// The relation: what keeps its value, or a sum of rates that vanishes.
    pub relation: String,
    /// What is known of it.
    pub kind: DriftKind,
    /// What it has changed by at the end, in the unit of the relation; `None` where it binds no positions, or where what it
    /// reads was not recorded.
    pub value: Option<f64>,
    /// The greatest such change on the run.
    pub greatest: Option<f64>,
    /// Below this a drift says nothing.
    pub resolution: f64,
}

/// What is known of a relation between speeds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DriftKind {
    /// It is the rate of a function of the positions: drift is exact.
    Closed,
    /// It binds positions together with others, but has no closed form here: drift is measured along the run.
    Open,
    /// It is nonholonomic: it binds no positions, which so cannot drift from it.
    Nonholonomic,
    /// It was not decided whether it binds positions: drift is measured along the run.
    Undecided,
}

/// A relation, and what has been seen of it.
pub(crate) struct Relation {
    text: String,
    kind: DriftKind,
    /// Its value, where it has a closed form; else its factors.
    read: Vec<Expr>,
    /// The positions whose rates these multiply, with their rates.
    positions: Vec<(Symbol, Expr)>,
    /// What its value was before anything was seen, moved along with what events have changed.
    begin: Option<f64>,
    last: f64,
    greatest: f64,
    resolution: f64,
    known: bool,
}

/// The relations of a graph from which positions may drift; expressions are made in the pool.
pub(crate) fn relations(graph: &BondGraph, x: &mut Exprs) -> Vec<Relation> {
    let mut found = Vec::new();
    for relation in velocity_relations(x, graph) {
        let kind = match relation.integral {
            // How far it is missed is recorded as its own drift.
            Integral::Constraint(_) => continue,
            Integral::Closed(_) => DriftKind::Closed,
            Integral::Open => DriftKind::Open,
            Integral::Nonholonomic => DriftKind::Nonholonomic,
            Integral::Undecided => DriftKind::Undecided,
        };
        if relation.is_linear(x) {
            continue;
        }
        let expression = relation.expression(x, graph);
        let text = ascii(x, expression, &PlainNames(x));
        let (read, positions) = match relation.integral {
            Integral::Closed(value) => (vec![value], Vec::new()),
            _ => {
                let rates = relation.terms.iter().filter_map(|&(s, _)| Some((s, rate(graph, x, s)?)));
                let rates: Vec<(Symbol, Expr)> = rates.collect();
                (relation.terms.iter().map(|t| t.1).collect(), rates)
            }
        };
        let known = kind != DriftKind::Nonholonomic && (positions.is_empty() || positions.len() == read.len());
        let (begin, last, greatest, resolution) = (None, 0.0, 0.0, 0.0);
        found.push(Relation { text, kind, read, positions, begin, last, greatest, resolution, known });
    }
    found
}

/// The rate of a position, in flows.
fn rate(graph: &BondGraph, x: &mut Exprs, position: Symbol) -> Option<Expr> {
    match graph.variables.get(&position)?.meaning {
        Meaning::Signal(signal) => Some(graph.signals[signal].rate),
        Meaning::Stored(port) => graph.storage_symbols(port).map(|(_, rate)| x.sym(rate)),
        _ => None,
    }
}

impl Relation {
    /// Looks at the next part of a run, which begins with the last sample of the one before.
    pub fn take(&mut self, graph: &BondGraph, values: &Values) {
        if !self.known {
            return;
        }
        let seen = match self.kind {
            DriftKind::Closed => self.take_values(values),
            _ => self.take_changes(graph, values),
        };
        self.known = seen.is_some();
    }

    fn note(&mut self, drift: f64) {
        self.last = drift;
        self.greatest = self.greatest.max(drift.abs());
    }

    /// What its value changes by, but for what it changes by at once.
    fn take_values(&mut self, values: &Values) -> Option<()> {
        let reader = values.reader(&self.read).ok()?;
        let (mut room, mut before) = (Vec::new(), None);
        let mut begin = self.begin;
        for sample in 0..values.times.len() {
            let value = reader.values_in(&mut room, sample, &[])?[0];
            let at_once = sample > 0 && values.times[sample] <= values.times[sample - 1];
            let jump = if at_once { before.map_or(0.0, |before| value - before) } else { 0.0 };
            let from = begin.map_or(value, |begin: f64| begin + jump);
            begin = Some(from);
            self.note(value - from);
            self.resolution = self.resolution.max(f64::EPSILON * (value.abs() + from.abs()));
            before = Some(value);
        }
        self.begin = begin;
        Some(())
    }

    /// What positions change by and their rates do not tell, times the factors.
    fn take_changes(&mut self, graph: &BondGraph, values: &Values) -> Option<()> {
        let factors = values.reader(&self.read).ok()?;
        let rates: Vec<Expr> = self.positions.iter().map(|p| p.1).collect();
        let n = values.times.len();
        let order = EvaluationOrder::new(&graph.exprs, &rates);
        let known = |s: Symbol, sample: usize| match values.column(s) {
            Some(column) => Some(column[sample]),
            None if s == graph.time => Some(values.times[sample]),
            None => values.parameter(s),
        };
        let mut columns = vec![Vec::with_capacity(n); rates.len()];
        for sample in 0..n {
            let mut missing = false;
            let now = order.values(&mut |s| {
                known(s, sample).unwrap_or_else(|| {
                    missing = true;
                    f64::NAN
                })
            });
            if missing {
                return None;
            }
            columns.iter_mut().zip(now).for_each(|(column, value)| column.push(value));
        }
        let integrals: Vec<_> = columns.iter().map(|column| values.quadrature.integrate(column)).collect();
        let positions: Option<Vec<&[f64]>> = self.positions.iter().map(|p| values.column(p.0)).collect();
        let positions = positions?;
        let mut drift = self.last;
        let mut before = factors.values(0, &[])?;
        for sample in 1..n {
            let now = factors.values(sample, &[])?;
            if values.times[sample] > values.times[sample - 1] {
                for (k, (position, integral)) in positions.iter().zip(&integrals).enumerate() {
                    let factor = 0.5 * (before[k] + now[k]);
                    let change = position[sample] - position[sample - 1];
                    drift += factor * (change - (integral.values[sample] - integral.values[sample - 1]));
                    let doubt = integral.uncertainty[sample] - integral.uncertainty[sample - 1];
                    self.resolution += (factor * doubt).abs();
                }
            }
            self.note(drift);
            before = now;
        }
        Some(())
    }

    /// What was found; nothing where the relation has no value.
    pub fn finish(self) -> Drift {
        let known = self.known && self.last.is_finite();
        let of = |value: f64| known.then_some(value);
        let (value, greatest) = (of(self.last), of(self.greatest));
        Drift { relation: self.text, kind: self.kind, value, greatest, resolution: self.resolution }
    }
}
