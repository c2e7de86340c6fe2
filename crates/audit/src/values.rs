//! Recorded values by symbol.

use crate::Run;
use crate::lanes::greatest_product;
use crate::quadrature::Quadrature;
use halfarrow_compiler::algebra::{EvaluationOrder, Expr, Exprs, Function, Node, Symbol};
use halfarrow_compiler::bond_graph::{BondGraph, BondId, Kind, Meaning, Port, PortRef};
use rustc_hash::FxHashMap;
use smallvec::SmallVec;
use std::cell::{OnceCell, RefCell};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::Arc;

/// The names of the variables that an audit reads, as `--record` takes them, each once in alphabetical order: all efforts, flows
/// and stored quantities of elements, junctions and named bonds, integrated signals, inputs and held signals.
pub fn wanted(graph: &BondGraph) -> Vec<String> {
    let mut all = BTreeSet::new();
    variables(graph, &mut |name, _| {
        all.insert(name.to_string());
    });
    all.into_iter().collect()
}

/// Calls `visit` with the variables that an audit reads: the name that each is recorded by, and what it says the value of.
pub(crate) fn variables(graph: &BondGraph, visit: &mut dyn FnMut(&str, &[Symbol])) {
    let mut name = String::new();
    let mut visit = |parts: [&str; 4], symbols: &[Symbol]| {
        name.clear();
        name.extend(parts);
        visit(&name, symbols);
    };
    let dot = |port: &str| if port.is_empty() { "" } else { "." };
    for element in graph.elements.values().filter(|e| !matches!(e.kind, Kind::Zero | Kind::One)) {
        for (index, port) in element.ports.iter().enumerate() {
            let (bond, own, port) = (&graph.bonds[port.bond], element.name.as_str(), port.name.as_str());
            visit([own, dot(port), port, ".e"], &[bond.effort]);
            visit([own, dot(port), port, ".f"], &[bond.flow]);
            match &element.kind {
                Kind::Inertance(s) => visit([own, dot(port), port, ".p"], &[s.stored[index]]),
                Kind::Compliance(s) => visit([own, dot(port), port, ".q"], &[s.stored[index]]),
                _ => {}
            }
        }
    }
    for bond in graph.bonds.values().filter(|b| !b.name.is_empty()) {
        visit([&bond.name, "", "", ".e"], &[bond.effort]);
        visit([&bond.name, "", "", ".f"], &[bond.flow]);
    }
    graph.signals.values().for_each(|s| visit([&s.name, "", "", ""], &[s.symbol]));
    graph.inputs.values().for_each(|i| visit([&i.name, "", "", ""], &[i.symbol]));
    graph.held.values().for_each(|h| visit([&h.name, "", "", ""], &[h.symbol]));
    let mut common = Vec::new();
    for element in graph.elements.values() {
        let flow = match element.kind {
            Kind::Zero => false,
            Kind::One => true,
            _ => continue,
        };
        for ports in element.ports.chunk_by(|a, b| a.name == b.name) {
            let (own, port) = (element.name.as_str(), ports[0].name.as_str());
            let symbol = |port: &Port| if flow { graph.bonds[port.bond].flow } else { graph.bonds[port.bond].effort };
            common.clear();
            common.extend(ports.iter().map(symbol));
            visit([own, dot(port), port, if flow { ".f" } else { ".e" }], &common);
        }
    }
}

/// Which recorded column tells which variable.
pub(crate) struct Columns {
    /// By symbol.
    of: Vec<u32>,
    /// Columns that say the same as that of a symbol: the symbol, they, and that one.
    same: Vec<(Symbol, u32, u32)>,
}

/// The column of what is not recorded.
const NONE: u32 = u32::MAX;

impl Columns {
    /// `column_of` tells the column that is recorded under a name.
    pub fn new(graph: &BondGraph, column_of: &mut dyn FnMut(&str) -> Option<usize>) -> Columns {
        let mut columns = Columns { of: vec![NONE; graph.exprs.symbol_count()], same: Vec::new() };
        variables(graph, &mut |name, symbols| {
            let Some(column) = column_of(name) else { return };
            for &symbol in symbols {
                match &mut columns.of[symbol.0 as usize] {
                    unknown @ &mut NONE => *unknown = column as u32,
                    known if *known == column as u32 => {}
                    known => columns.same.push((symbol, column as u32, *known)),
                }
            }
        });
        // A bond that was not recorded itself has the common variable of a junction it ends at.
        for element in graph.elements.values() {
            let symbol = |port: &Port| match element.kind {
                Kind::Zero => Some(graph.bonds[port.bond].effort),
                Kind::One => Some(graph.bonds[port.bond].flow),
                _ => None,
            };
            let all = || element.ports.iter().filter_map(symbol).map(|s| s.0 as usize);
            let Some(common) = all().map(|s| columns.of[s]).find(|&column| column != NONE) else { continue };
            all().for_each(|s| {
                if columns.of[s] == NONE {
                    columns.of[s] = common;
                }
            });
        }
        columns
    }
}

/// The side of a jump that a sample shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Side {
    Before,
    After,
    Inside,
}

/// Borders in an expression, where its value jumps or has a kink.
#[derive(Debug, Clone, Copy, Default)]
struct Borders {
    /// Whether time moves it, and whether what is recorded does.
    by_time: bool,
    by_state: bool,
    /// Whether it jumps where what is recorded crosses a border, and whether it has a kink there.
    jumps: bool,
    bends: bool,
    /// Whether it jumps at some time.
    timed: bool,
}

impl Borders {
    fn or(self, other: Borders) -> Borders {
        Borders {
            by_time: self.by_time || other.by_time,
            by_state: self.by_state || other.by_state,
            jumps: self.jumps || other.jumps,
            bends: self.bends || other.bends,
            timed: self.timed || other.timed,
        }
    }
}

/// Recorded values by symbol, with what the junctions say of unnamed bonds between them.
pub(crate) struct Values<'a> {
    graph: &'a BondGraph,
    pub times: &'a [f64],
    /// What the samples weigh in integrals.
    pub quadrature: Arc<Quadrature>,
    of: &'a Columns,
    columns: &'a [&'a [f64]],
    names: &'a [Arc<str>],
    parameters: Arc<FxHashMap<Symbol, f64>>,
    /// Borders in expressions, as far as they are known.
    borders: RefCell<FxHashMap<Expr, Borders>>,
    /// Values of expressions that parameters alone tell, as far as they were asked for; `None` of those that read more.
    numbers: RefCell<FxHashMap<Expr, Option<f64>>>,
}

impl<'a> Values<'a> {
    pub fn new(graph: &'a BondGraph, of: &'a Columns, run: &Run<'a>) -> Values<'a> {
        let parameters = graph.parameters.values();
        let parameters = parameters.filter_map(|p| Some((p.symbol, *run.parameters.get(&p.name)?)));
        Values {
            graph,
            times: run.times,
            quadrature: Arc::new(Quadrature::new(run.times)),
            of,
            columns: run.columns,
            names: run.names,
            parameters: Arc::new(parameters.collect()),
            borders: RefCell::default(),
            numbers: RefCell::default(),
        }
    }

    /// The same for another thread: what is known of expressions is found anew.
    pub fn beside_these(&self) -> Values<'a> {
        Values {
            quadrature: self.quadrature.clone(),
            parameters: self.parameters.clone(),
            borders: RefCell::default(),
            numbers: RefCell::default(),
            ..*self
        }
    }

    /// Columns that say the same as that of a symbol: their names, the symbol, and both.
    pub fn same(&self) -> impl Iterator<Item = (&'a str, Symbol, &'a [f64], &'a [f64])> + '_ {
        let column = |at: u32| self.columns[at as usize];
        self.of.same.iter().map(move |&(symbol, own, known)| {
            let name: &'a str = &self.names[own as usize];
            (name, symbol, column(own), column(known))
        })
    }

    pub fn effort(&self, bond: BondId) -> Option<&'a [f64]> {
        self.column(self.graph.bonds[bond].effort)
    }

    pub fn flow(&self, bond: BondId) -> Option<&'a [f64]> {
        self.column(self.graph.bonds[bond].flow)
    }

    pub fn parameter(&self, symbol: Symbol) -> Option<f64> {
        self.parameters.get(&symbol).copied()
    }

    pub fn column(&self, symbol: Symbol) -> Option<&'a [f64]> {
        self.place(symbol).map(|at| self.columns[at])
    }

    /// Which of the columns has the values of a symbol.
    pub fn place(&self, symbol: Symbol) -> Option<usize> {
        self.of.of.get(symbol.0 as usize).filter(|&&at| at != NONE).map(|&at| at as usize)
    }

    /// Everything that is recorded.
    pub fn recorded_columns(&self) -> &'a [&'a [f64]] {
        self.columns
    }

    /// Power into the element at a port, sample by sample, in `power`; `None` where it is not known.
    pub fn power(&self, port: PortRef, power: &mut Vec<f64>) -> Option<()> {
        let at = &self.graph.elements[port.element].ports[port.port as usize];
        let sign = if at.inward { 1.0 } else { -1.0 };
        power.clear();
        match (self.effort(at.bond), self.flow(at.bond)) {
            (Some(e), Some(f)) => power.extend(e.iter().zip(f).map(|(e, f)| sign * e * f)),
            // An undetermined effort does no work where nothing flows, and the other way round.
            (None, Some(zero)) | (Some(zero), None) if zero.iter().all(|&v| v == 0.0) => power.extend_from_slice(zero),
            _ => return None,
        }
        Some(())
    }

    /// The greatest power at a port, whichever way; 0 where it is not known.
    pub fn greatest_power(&self, port: PortRef) -> f64 {
        let bond = self.graph.bond_of(port);
        let (Some(e), Some(f)) = (self.effort(bond), self.flow(bond)) else { return 0.0 };
        greatest_product(e, f)
    }

    /// An expression that is written as a sum of numbers times different recorded variables.
    pub fn line(&self, e: Expr) -> Option<Line<'a>> {
        let x = &self.graph.exprs;
        let terms = match x.node(e) {
            Node::Add(terms) => &terms[..],
            _ => &[e][..],
        };
        let terms: SmallVec<[LineTerm; 2]> = terms.iter().map(|&term| self.line_term(term)).collect::<Option<_>>()?;
        let moves = |k: usize| terms[k].moved.map(|(symbol, _)| symbol);
        let repeats = |k: usize| moves(k).is_some() && (0..k).any(|other| moves(other) == moves(k));
        (!(1..terms.len()).any(repeats)).then_some(Line { terms })
    }

    fn line_term(&self, term: Expr) -> Option<LineTerm<'a>> {
        let x = &self.graph.exprs;
        let factors = match x.node(term) {
            Node::Mul(factors) => &factors[..],
            _ => &[term][..],
        };
        let mut found = LineTerm { before: 1.0, moved: None, behind: SmallVec::new() };
        for &factor in factors {
            match (self.number(factor), x.node(factor)) {
                (Some(number), _) if found.moved.is_none() => found.before *= number,
                (Some(number), _) => found.behind.push(number),
                (None, &Node::Symbol(symbol)) if found.moved.is_none() => {
                    found.moved = Some((symbol, self.recorded(symbol).filter(|_| self.rate_of(symbol).is_none())?));
                }
                _ => return None,
            }
        }
        Some(found)
    }

    /// The value of what parameters alone tell.
    fn number(&self, e: Expr) -> Option<f64> {
        match self.graph.exprs.node(e) {
            Node::Symbol(symbol) => return self.parameter(*symbol),
            Node::Number(number) => return Some(number.to_f64()),
            _ => {}
        }
        *self.numbers.borrow_mut().entry(e).or_insert_with(|| {
            let order = EvaluationOrder::new(&self.graph.exprs, &[e]);
            let given = order.symbols().iter().all(|symbol| self.parameters.contains_key(symbol));
            given.then(|| order.values(&mut |symbol| self.parameter(symbol).unwrap_or(f64::NAN))[0])
        })
    }

    /// Reads expressions at samples; the name of what is missing if they read something that was not recorded.
    pub fn reader(&self, wanted: &[Expr]) -> Result<Reader<'_, 'a>, String> {
        let x = &self.graph.exprs;
        let mut read: Vec<Symbol> = wanted.iter().flat_map(|&e| x.symbols_of(e)).collect();
        read.sort_unstable();
        read.dedup();
        // A rate of an integrated signal is the expression that it was declared with.
        let mut rates: BTreeMap<Symbol, Expr> = BTreeMap::new();
        loop {
            let new = |s: &Symbol| if rates.contains_key(s) { None } else { Some((*s, self.rate_of(*s)?)) };
            let more: Vec<(Symbol, Expr)> = read.iter().filter_map(new).collect();
            if more.is_empty() {
                break;
            }
            for (symbol, rate) in more {
                rates.insert(symbol, rate);
                read.extend(x.symbols_of(rate));
            }
            read.sort_unstable();
            read.dedup();
        }
        let known = |s: &Symbol| {
            *s == self.graph.time
                || self.parameters.contains_key(s)
                || rates.contains_key(s)
                || self.recorded(*s).is_some()
        };
        if let Some(missing) = read.iter().find(|s| !known(s)) {
            return Err(x.name(*missing).to_string());
        }
        let piecewise: Vec<Expr> = wanted.iter().copied().filter(|&e| x.is_piecewise(e)).collect();
        let Borders { jumps: jumpy, bends: bent, timed, .. } = self.borders(&piecewise);
        let moves = read.iter().copied().filter(|s| !rates.contains_key(s) && self.recorded(*s).is_some()).collect();
        let rates = rates.into_iter().collect();
        Ok(Reader { values: self, wanted: wanted.to_vec(), rates, read: OnceCell::new(), moves, jumpy, bent, timed })
    }

    /// Expressions with where their symbols are, all of which are known; those of `rates` by their place there.
    fn read(&self, wanted: &[Expr], rates: &[(Symbol, Expr)]) -> Read<'a> {
        let order = EvaluationOrder::new(&self.graph.exprs, wanted);
        let source = |&s: &Symbol| match (rates.binary_search_by_key(&s, |rate| rate.0), self.recorded(s)) {
            _ if s == self.graph.time => Source::Time,
            (Ok(rate), _) => Source::Rate(rate),
            (Err(_), Some(column)) => Source::Column(s, column),
            (Err(_), None) => Source::Number(self.parameter(s).unwrap_or(f64::NAN)),
        };
        Read { sources: order.symbols().iter().map(source).collect(), order }
    }

    /// What several readers read, evaluated together; those of times beside jumps read by themselves.
    pub fn together(&self, readers: &[&Reader<'_, 'a>]) -> Together<'_, 'a> {
        let mut wanted = Vec::new();
        let mut rates: Vec<(Symbol, Expr)> = Vec::new();
        let places = readers.iter().map(|reader| {
            rates.extend(reader.rates.iter().copied());
            wanted.extend(&reader.wanted);
            wanted.len() - reader.wanted.len()..wanted.len()
        });
        let places = places.collect();
        rates.sort_unstable();
        rates.dedup();
        let read = Reads::new(self, &wanted, &rates);
        Together { values: self, places, read }
    }

    /// The column of a symbol, or of the effort or flow that it is the rate of a stored quantity as.
    fn recorded(&self, symbol: Symbol) -> Option<&'a [f64]> {
        self.column(symbol).or_else(|| self.column(self.same_as(symbol)?))
    }

    /// The expressions of the graph.
    pub fn exprs(&self) -> &'a Exprs {
        &self.graph.exprs
    }

    /// On which side of a jump a sample stands. The start is the far side of one, and so is a single sample at the time
    /// of a jump; the latter cannot be told from others, but a little later is as good there. What stands beside a jump by
    /// rounding is on the side where it stands.
    fn side(&self, sample: usize) -> Side {
        let same = |a: usize, b: usize| b < self.times.len() && self.times[a] == self.times[b];
        let beside = |a: usize, b: usize| self.times[b] - self.times[a] <= reach(self.times[b]);
        match () {
            () if same(sample, sample + 1) => Side::Before,
            () if sample > 0 && same(sample - 1, sample) => Side::After,
            () if sample > 1 && same(sample - 2, sample - 1) && beside(sample - 1, sample) => Side::After,
            () if same(sample + 1, sample + 2) && beside(sample, sample + 1) => Side::Before,
            () if sample + 1 == self.times.len() => Side::Inside,
            () => Side::After,
        }
    }

    /// A time so near to that of a sample, on its side of a jump, that there is no other between them.
    fn beside(&self, sample: usize) -> f64 {
        let t = self.times[sample];
        let halfway = |other: &f64| 0.5 * (t + other);
        match self.side(sample) {
            // A run that ends at a jump stands before it.
            Side::Before | Side::Inside => {
                let before = self.times[..sample].iter().rev().find(|&&other| other < t);
                (t - reach(t)).max(before.map_or(f64::NEG_INFINITY, halfway))
            }
            Side::After => {
                let behind = self.times[sample..].iter().find(|&&other| other > t);
                (t + reach(t)).min(behind.map_or(f64::INFINITY, halfway))
            }
        }
    }

    /// Whether a sample stands before a jump at its time.
    pub fn is_before_jump(&self, sample: usize) -> bool {
        self.side(sample) == Side::Before
    }

    /// What borders there are in any of these expressions.
    fn borders(&self, wanted: &[Expr]) -> Borders {
        let (x, mut known) = (&self.graph.exprs, self.borders.borrow_mut());
        for part in x.below(wanted, &|e| !known.contains_key(&e)) {
            let node = x.node(part);
            let mut found = Borders::default();
            if let Node::Symbol(s) = node {
                (found.by_time, found.by_state) = match *s {
                    time if time == self.graph.time => (true, false),
                    s => (false, !self.parameters.contains_key(&s)),
                };
            }
            node.for_each_child(|child| found = found.or(known[&child]));
            let jumps = match node {
                Node::Compare(..) | Node::Table(..) | Node::TableSlope(..) => true,
                Node::Call(function, _) => matches!(function, Function::Sign | Function::Floor | Function::Mod),
                _ => false,
            };
            found.jumps |= jumps && found.by_state;
            found.timed |= jumps && found.by_time;
            let bends = matches!(node, Node::Call(Function::Min | Function::Max | Function::Abs, _));
            found.bends |= bends && found.by_state;
            known.insert(part, found);
        }
        wanted.iter().fold(Borders::default(), |all, e| all.or(known[e]))
    }

    /// What a rate is: the expression of an integrated signal.
    fn rate_of(&self, symbol: Symbol) -> Option<Expr> {
        let Meaning::Rate(of) = self.graph.variables.get(&symbol)?.meaning else { return None };
        match self.graph.variables.get(&of)?.meaning {
            Meaning::Signal(signal) => Some(self.graph.signals[signal].rate),
            _ => None,
        }
    }

    /// The effort or flow that the rate of a stored quantity is.
    fn same_as(&self, symbol: Symbol) -> Option<Symbol> {
        let Meaning::Rate(of) = self.graph.variables.get(&symbol)?.meaning else { return None };
        match self.graph.variables.get(&of)?.meaning {
            Meaning::Stored(port) => Some(self.graph.storage_symbols(port)?.1),
            _ => None,
        }
    }
}

/// A sum of numbers times different recorded variables.
pub(crate) struct Line<'a> {
    terms: SmallVec<[LineTerm<'a>; 2]>,
}

/// A number times a recorded variable, or alone, as factors in the order in which they are written.
struct LineTerm<'a> {
    before: f64,
    moved: Option<(Symbol, &'a [f64])>,
    behind: SmallVec<[f64; 2]>,
}

impl LineTerm<'_> {
    fn times(&self, moved: f64) -> f64 {
        self.behind.iter().fold(self.before * moved, |value, factor| value * factor)
    }

    fn at(&self, sample: usize) -> f64 {
        self.with(|column| column[sample])
    }

    /// Adds its values to those in the row, sample by sample.
    fn add_to(&self, row: &mut [f64]) {
        match self.moved {
            None => row.iter_mut().for_each(|sum| *sum += self.before),
            Some((_, column)) => row.iter_mut().zip(column).for_each(|(sum, &moved)| *sum += self.times(moved)),
        }
    }

    /// Its value where the variable has this one of its column.
    fn with(&self, of: impl Fn(&[f64]) -> f64) -> f64 {
        self.moved.map_or(self.before, |(_, column)| self.times(of(column)))
    }
}

impl Line<'_> {
    /// Its values at all samples, to the bits of a [`Reader`], in `row`.
    pub fn values(&self, samples: usize, row: &mut Vec<f64>) {
        row.clear();
        row.resize(samples, -0.0);
        self.terms.iter().for_each(|term| term.add_to(row));
    }

    /// Its value where all variables in it have this one.
    pub fn where_all_are(&self, value: f64) -> f64 {
        self.terms.iter().fold(-0.0, |sum, term| sum + term.with(|_| value))
    }

    /// The sum of the magnitudes of its terms at a sample.
    pub fn magnitude(&self, sample: usize) -> f64 {
        self.terms.iter().map(|term| term.at(sample).abs()).sum()
    }

    /// The variables with how steep it is in each, whichever way.
    pub fn slopes(&self) -> impl Iterator<Item = (Symbol, f64)> + Clone + '_ {
        self.terms.iter().filter_map(|term| Some((term.moved?.0, term.times(1.0).abs())))
    }
}

/// Expressions at samples.
pub(crate) struct Reader<'v, 'a> {
    values: &'v Values<'a>,
    wanted: Vec<Expr>,
    /// Rates of integrated signals among what is read.
    rates: Vec<(Symbol, Expr)>,
    /// In what order, made when it is asked for first.
    read: OnceCell<Reads<'a>>,
    /// Recorded symbols among what is read.
    moves: Vec<Symbol>,
    /// Whether a value jumps with the state, and with time.
    jumpy: bool,
    timed: bool,
    /// Whether a value has a kink where the state crosses a border.
    bent: bool,
}

/// Expressions with where the values of their symbols are, and rates of integrated signals among these.
struct Reads<'a> {
    wanted: Read<'a>,
    rates: Vec<Read<'a>>,
}

impl<'a> Reads<'a> {
    fn new(values: &Values<'a>, wanted: &[Expr], rates: &[(Symbol, Expr)]) -> Reads<'a> {
        let read = |wanted: &[Expr]| values.read(wanted, rates);
        Reads { wanted: read(wanted), rates: rates.iter().map(|&(_, rate)| read(&[rate])).collect() }
    }

    /// The values at samples and times; `column` gives those of a recorded symbol.
    fn at<'r, const N: usize>(
        &self,
        read: &Read<'a>,
        room: &'r mut Vec<[f64; N]>,
        t: [f64; N],
        column: &dyn Fn(Symbol, &'a [f64]) -> [f64; N],
    ) -> &'r [[f64; N]] {
        read.order.values_in(room, |k| match read.sources[k] {
            Source::Time => t,
            Source::Rate(rate) => self.at(&self.rates[rate], &mut Vec::new(), t, column)[0],
            Source::Column(symbol, values) => column(symbol, values),
            Source::Number(number) => [number; N],
        })
    }
}

/// Expressions with where the values of their symbols are.
struct Read<'a> {
    order: EvaluationOrder<'a>,
    sources: Vec<Source<'a>>,
}

/// What several readers read: what they have in common is evaluated once, at several samples at once.
pub(crate) struct Together<'v, 'a> {
    values: &'v Values<'a>,
    /// Where the values of each reader stand.
    places: Vec<Range<usize>>,
    read: Reads<'a>,
}

impl Together<'_, '_> {
    /// The values of all readers at all samples: `found(reader, sample, values)`, a few samples at a time, for each reader in turn.
    pub fn read(&self, mut found: impl FnMut(usize, usize, &[f64])) {
        // Few samples, as long rows of short runs have, take little memory.
        match self.values.times.len() {
            ..8 => self.read_by::<2>(&mut found),
            _ => self.read_by::<8>(&mut found),
        }
    }

    fn read_by<const N: usize>(&self, found: &mut impl FnMut(usize, usize, &[f64])) {
        let (samples, mut room) = (self.values.times.len(), Vec::new());
        for from in (0..samples).step_by(N) {
            self.read_some::<N>(from..samples.min(from + N), &mut room, found);
        }
    }

    fn read_some<const N: usize>(
        &self,
        samples: Range<usize>,
        room: &mut Vec<[f64; N]>,
        found: &mut impl FnMut(usize, usize, &[f64]),
    ) {
        let last = samples.end - 1;
        let at: [usize; N] = std::array::from_fn(|i| last.min(samples.start + i));
        let t = at.map(|sample| self.values.times[sample]);
        let all = self.read.at(&self.read.wanted, room, t, &|_, column| at.map(|sample| column[sample]));
        let mut values = Vec::new();
        for (reader, place) in self.places.iter().enumerate() {
            for (i, sample) in samples.clone().enumerate() {
                values.clear();
                values.extend(all[place.clone()].iter().map(|lanes| lanes[i]));
                found(reader, sample, &values);
            }
        }
    }
}

/// How far from a jump in time values are on one side of it for certain.
fn reach(t: f64) -> f64 {
    32.0 * f64::EPSILON * t.abs().max(f64::MIN_POSITIVE)
}

/// Where the value of a symbol is.
enum Source<'a> {
    Time,
    /// By its place among the rates.
    Rate(usize),
    Column(Symbol, &'a [f64]),
    Number(f64),
}

impl Reader<'_, '_> {
    /// What the values depend on, besides time and parameters.
    pub fn moves(&self) -> &[Symbol] {
        &self.moves
    }

    /// Whether a sample stands behind a jump at its time, and a value jumps with the state.
    pub fn jumps_at(&self, sample: usize) -> bool {
        let times = self.values.times;
        self.jumpy && (sample == 0 || times[sample] == times[sample - 1])
    }

    /// Whether a sample stands before a switch, and a value has a kink: a step of fixed length holds the old branch to its end,
    /// and is then beyond the border.
    pub fn is_beyond(&self, sample: usize) -> bool {
        self.bent && self.values.is_before_jump(sample)
    }

    /// Whether it can be read together with others: at the times of the samples.
    pub fn is_at_samples(&self) -> bool {
        !self.timed
    }

    /// Whether a sample stands before a jump, and a value jumps with the state: there the state stands just beyond the border
    /// while the old law still holds.
    pub fn is_unclear(&self, sample: usize) -> bool {
        self.jumpy && self.values.is_before_jump(sample)
    }

    /// The values at a sample, symbols moved by so much; `None` where the law is not clear.
    pub fn values(&self, sample: usize, moved: &[(Symbol, f64)]) -> Option<Vec<f64>> {
        self.values_in(&mut Vec::new(), sample, moved).map(<[f64]>::to_vec)
    }

    /// How steep a sum of the values, each times a weight, is in each of the variables that [move](Self::moves) them, at a
    /// sample, symbols moved by so much. `weights` gives them from the values. `None` where only differences tell.
    pub fn slopes(
        &self,
        (sample, moved): (usize, &[(Symbol, f64)]),
        weights: impl FnOnce(&[f64]) -> Vec<f64>,
    ) -> Option<Vec<f64>> {
        if !self.rates.is_empty() || self.timed {
            return None;
        }
        let mut room = Vec::new();
        let weights = weights(self.values_in(&mut room, sample, moved)?);
        let read = &self.read.get()?.wanted;
        let by_symbol = read.order.slopes(&room, &weights)?;
        let mut slopes = vec![0.0; self.moves.len()];
        for (symbol, slope) in read.order.symbols().iter().zip(by_symbol) {
            if let Ok(at) = self.moves.binary_search(symbol) {
                slopes[at] = slope;
            }
        }
        slopes.iter().all(|slope| slope.is_finite()).then_some(slopes)
    }

    /// The same as [`values`](Self::values) in memory that is used again.
    pub fn values_in<'r>(
        &self,
        room: &'r mut Vec<[f64; 1]>,
        sample: usize,
        moved: &[(Symbol, f64)],
    ) -> Option<&'r [f64]> {
        if self.is_unclear(sample) {
            return None;
        }
        let values = self.values;
        let t = if self.timed { values.beside(sample) } else { values.times[sample] };
        let read = self.read.get_or_init(|| Reads::new(values, &self.wanted, &self.rates));
        let column = |symbol: Symbol, column: &[f64]| {
            [moved.iter().filter(|(s, _)| *s == symbol).fold(column[sample], |at, (_, by)| at + by)]
        };
        // Behind the last sample tables may have ended.
        let ends = sample + 1 == values.times.len() && t > values.times[sample];
        let has_value = |found: &[[f64; 1]]| found.as_flattened().iter().all(|value| !value.is_nan());
        if ends && !has_value(read.at(&read.wanted, room, [t], &column)) {
            return Some(read.at(&read.wanted, room, [values.times[sample]], &column).as_flattened());
        }
        Some(read.at(&read.wanted, room, [t], &column).as_flattened())
    }
}
