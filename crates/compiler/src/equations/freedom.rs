//! Freedom that the start values leave is zero in the storages, or what is guessed of them.
//!
//! Storage by storage in the order of the model: each starts empty if that is independent of what is given and of those
//! before it. So what the start is does not depend on the form, nor on the variables that stay independent in it. Where
//! zeros of the unknowns do the same, nothing is said.

use std::collections::{BTreeMap, BTreeSet};

use super::InitialCondition;
use super::blocks::{components, is_direct};
use super::definitions::{Definition, Definitions};
use super::independent_rows::{Row, equilibrate, independent};
use super::points::solved;
use crate::algebra::{Expr, Exprs, NumericPoint, Symbol, ZERO};
use crate::bond_graph::{Guess, Meaning};
use crate::causal_graph::start_point::{self, start_point};
use crate::causal_graph::{CausalGraph, Role};

/// A state that is a sum of stored quantities.
pub(super) struct Sum {
    /// The co-energy variable of the storage that it is kept for, or a common variable without one.
    pub speed: Symbol,
}

/// A time at which no source is zero by chance, and a number that stands for what is not known to be zero.
const SOME_TIME: f64 = 0.7361;
const SOME_NUMBER: f64 = 0.5813;
/// Of more variables that define each other no values are sought where slopes are taken.
const MOST_TOGETHER: usize = 64;
/// Slopes of a loop below this part of its greatest one are rounding.
const IDLE: f64 = 1e-9;
/// Newton's iterations for them, and by which part they may still move.
const ITERATIONS: usize = 8;
const CLOSE: f64 = 1e-12;

/// The conditions that are missing: `storage = 0`, or its guess. `given` is what the start has to satisfy anyway.
pub(super) fn conditions(
    d: &mut Definitions,
    causal: &CausalGraph,
    sums: &[Sum],
    given: &[InitialCondition],
) -> Vec<InitialCondition> {
    let mut empty = guessed_signals(d);
    empty.extend(guessed_flows(d));
    let stored = storages(d, causal, sums).into_iter().filter(|s| !empty.contains(s)).collect::<Vec<_>>();
    empty.extend(stored);
    let guessed: BTreeMap<Expr, Expr> = d.graph.guesses.iter().map(|g| (g.what, g.value)).collect();
    let value = |x: &mut Exprs, s: Symbol| guessed.get(&x.sym(s)).copied().unwrap_or(ZERO);
    let wanted: Vec<(Symbol, Expr)> = empty.into_iter().map(|s| (s, value(&mut d.x, s))).collect();
    let mut weak = Vec::new();
    for (symbol, value) in Freedom::new(d, &wanted, given).missing(d, &wanted, given) {
        let own = d.x.sym(symbol);
        weak.push(InitialCondition {
            residual: d.x.sub(own, value),
            name: d.x.name(symbol).to_string(),
            value,
            firm: false,
            weak: true,
            span: Default::default(),
        });
    }
    weak
}

/// Integrated signals that are guessed: what nothing determines stays where it is guessed, before storages are empty.
fn guessed_signals(d: &Definitions) -> Vec<Symbol> {
    let is_signal = |s: &Symbol| matches!(d.meaning(*s), Some(Meaning::Signal(_))) && !d.missing.contains_key(s);
    d.graph.guesses.iter().flat_map(|g| d.x.symbols_of(g.what)).filter(is_signal).collect()
}

/// Common flows of junctions that are guessed; those guessed to be 0, as what is not given is, after the others.
fn guessed_flows(d: &Definitions) -> Vec<Symbol> {
    let is_flow = |s: &Symbol| matches!(d.meaning(*s), Some(Meaning::Flow(_))) && !d.missing.contains_key(s);
    let (zero, given): (Vec<&Guess>, Vec<&Guess>) = d.graph.guesses.iter().partition(|g| g.value == ZERO);
    given.into_iter().chain(zero).flat_map(|g| d.x.symbols_of(g.what)).filter(is_flow).collect()
}

/// What the storages hold, in the order of the model; then speeds (or efforts) that are kept without one.
fn storages(d: &Definitions, causal: &CausalGraph, sums: &[Sum]) -> Vec<Symbol> {
    let stored = start_point::storages(d.graph).flat_map(|storage| &storage.stored);
    let ports = causal.ports.ports.iter().filter(|p| p.role == Role::Independent);
    let inputs: BTreeSet<Symbol> = ports.map(|p| p.input).collect();
    let alone = sums.iter().map(|s| s.speed).filter(|s| !inputs.contains(s) && d.of.contains_key(s));
    let has_value = |s: &Symbol| !d.missing.contains_key(s);
    stored.copied().chain(alone).filter(has_value).collect()
}

/// What the start conditions and storages read, and what of it is open once the conditions with one unknown are solved.
struct Freedom {
    /// What definitions read, of unknowns and of what is defined; those read come before those that read them.
    reads: Vec<(Symbol, Vec<Symbol>)>,
    /// What reads an unknown that is open.
    open: BTreeSet<Symbol>,
    /// The unknowns that conditions with one unknown determine.
    closed: BTreeSet<Symbol>,
    /// Where slopes are taken: what is given has its value.
    point: NumericPoint,
}

impl Freedom {
    fn new(d: &Definitions, wanted: &[(Symbol, Expr)], given: &[InitialCondition]) -> Freedom {
        let roots = given.iter().flat_map(|g| d.x.symbols_of(g.residual)).chain(wanted.iter().map(|w| w.0));
        let (open, closed) = (BTreeSet::new(), BTreeSet::new());
        let mut found = Freedom { reads: reached(d, roots), open, closed, point: start_point(&d.x, d.graph) };
        found.closed = found.closed(d, given);
        let is_open = |s: Symbol| is_unknown(d, s) && !found.closed.contains(&s);
        found.open = found.reads.iter().map(|r| r.0).filter(|&s| is_open(s)).collect();
        found.spread();
        found
    }

    /// Whatever reads what is open is open.
    fn spread(&mut self) {
        loop {
            let before = self.open.len();
            for (symbol, reads) in &self.reads {
                if reads.iter().any(|s| self.open.contains(s)) {
                    self.open.insert(*symbol);
                }
            }
            if self.open.len() == before {
                return;
            }
        }
    }

    /// The unknowns that conditions with one unknown determine.
    fn closed(&self, d: &Definitions, given: &[InitialCondition]) -> BTreeSet<Symbol> {
        let mut closed = BTreeSet::new();
        let mut waiting: Vec<BTreeSet<Symbol>> = given.iter().map(|g| self.unknowns(d, g.residual)).collect();
        loop {
            let before = closed.len();
            waiting.iter_mut().for_each(|reads| reads.retain(|s| !closed.contains(s)));
            closed.extend(waiting.iter().filter(|reads| reads.len() == 1).flatten());
            if closed.len() == before {
                return closed;
            }
        }
    }

    /// The unknowns that an expression reads.
    fn unknowns(&self, d: &Definitions, e: Expr) -> BTreeSet<Symbol> {
        behind(d, e).into_iter().filter(|&s| is_unknown(d, s)).collect()
    }

    /// The storages that have to be told to be empty (or as guessed).
    fn missing(
        mut self,
        d: &Definitions,
        wanted: &[(Symbol, Expr)],
        given: &[InitialCondition],
    ) -> Vec<(Symbol, Expr)> {
        let holds = self.zero_definitions(d);
        let parts = self.parts(d, given);
        let of = |s: &Symbol| parts.get(s).copied();
        let mut moved: BTreeSet<Symbol> = self.open.iter().filter(|s| !holds.contains(s)).filter_map(of).collect();
        moved.extend(given.iter().flat_map(|g| d.x.symbols_of(g.residual)).filter_map(|s| of(&s)));
        moved.extend(wanted.iter().filter(|w| w.1 != ZERO).filter_map(|w| of(&w.0)));
        if moved.is_empty() {
            return Vec::new();
        }
        self.open.retain(|s| moved.contains(&parts[s]));
        let wanted: Vec<(Symbol, Expr)> = wanted.iter().filter(|w| self.open.contains(&w.0)).copied().collect();
        let mut chosen = self.independent(d, &wanted, given);
        self.leave_out_what_is_zero(d, &mut chosen, given, &holds);
        chosen
    }

    /// Definitions that hold where all that is open is zero. What a charge is of which the voltage is given, the point does not say.
    fn zero_definitions(&self, d: &Definitions) -> BTreeSet<Symbol> {
        let mut zero = self.point.clone();
        let given = start_point::storages(d.graph).flat_map(|storage| &storage.initial).map(|initial| initial.symbol);
        let given: BTreeSet<Symbol> = given.collect();
        zero.set([(d.graph.time, SOME_TIME)]);
        zero.set(self.closed.difference(&given).map(|&s| (s, SOME_NUMBER)));
        zero.set(self.open.iter().map(|&s| (s, 0.0)));
        let definition = |s: &Symbol| d.of.get(s).copied().filter(|_| !is_unknown(d, *s));
        let mut holds = |s: &Symbol| definition(s).is_none_or(|of| zero.value(&d.x, of.expr()) == 0.0);
        self.open.iter().copied().filter(|s| holds(s)).collect()
    }

    /// For everything that is open one of those that it hangs together with.
    fn parts(&self, d: &Definitions, given: &[InitialCondition]) -> BTreeMap<Symbol, Symbol> {
        let mut leader: BTreeMap<Symbol, Symbol> = self.open.iter().map(|&s| (s, s)).collect();
        let mut join = |together: &[Symbol]| {
            for pair in together.windows(2) {
                let (a, b) = (find(&mut leader, pair[0]), find(&mut leader, pair[1]));
                leader.insert(a.max(b), a.min(b));
            }
        };
        let open = |s: &Symbol| self.open.contains(s);
        for (symbol, reads) in self.reads.iter().filter(|r| open(&r.0)) {
            join(&reads.iter().copied().filter(open).chain([*symbol]).collect::<Vec<_>>());
        }
        for condition in given {
            join(&d.x.symbols_of(condition.residual).iter().copied().filter(open).collect::<Vec<_>>());
        }
        self.open.iter().map(|&s| (s, find(&mut leader, s))).collect()
    }

    /// Moves the point where slopes are taken to what definitions make of it: of moduli that several rows share, of gains of
    /// loops, and of all that is not open. Read as 1, they would let independent rows of a rotation look dependent.
    fn follow_definitions(&mut self, d: &Definitions, x: &mut Exprs) {
        self.point.set([]);
        let follows = |s: &Symbol| {
            d.of.contains_key(s) && !is_unknown(d, *s) && (d.meaning(*s).is_none() || !self.open.contains(s))
        };
        let symbols: Vec<Symbol> = self.reads.iter().map(|r| r.0).filter(follows).collect();
        for together in components(d, &symbols) {
            match together[..] {
                [only] if is_direct(d, only) => {
                    let value = self.point.value(x, d.of[&only].expr());
                    self.point.place(only, value);
                }
                _ => self.follow_loop(d, x, &together),
            }
        }
    }

    /// The same for what is defined by each other: linear equations, or Newton's method from where it is.
    fn follow_loop(&mut self, d: &Definitions, x: &mut Exprs, together: &[Symbol]) {
        let n = together.len();
        if n > MOST_TOGETHER {
            return;
        }
        for _ in 0..ITERATIONS {
            let (mut matrix, mut missed) = (vec![0.0; n * n], vec![0.0; n]);
            for (row, &symbol) in together.iter().enumerate() {
                let definition = d.of[&symbol];
                let own = matches!(definition, Definition::Explicit(_));
                let value = self.point.value(x, definition.expr());
                missed[row] = value - if own { self.point.of(symbol) } else { 0.0 };
                for (column, &by) in together.iter().enumerate() {
                    let slope = x.derivative(definition.expr(), by);
                    let slope = self.point.value(x, slope);
                    matrix[row * n + column] = slope - f64::from(u8::from(own && row == column));
                }
            }
            let step = solved(n, matrix, missed);
            if !step.iter().all(|s| s.is_finite()) {
                return;
            }
            let moved: Vec<(Symbol, f64)> =
                together.iter().zip(&step).map(|(&s, v)| (s, self.point.of(s) - v)).collect();
            let arrived = moved.iter().zip(&step).all(|((_, at), step)| step.abs() <= CLOSE * (1.0 + at.abs()));
            self.point.set(moved);
            if arrived {
                return;
            }
        }
    }

    /// The storages whose being empty is independent of definitions, of what is given, and of the storages before them.
    fn independent(
        &mut self,
        d: &Definitions,
        wanted: &[(Symbol, Expr)],
        given: &[InitialCondition],
    ) -> Vec<(Symbol, Expr)> {
        let mut x = d.x.clone();
        self.follow_definitions(d, &mut x);
        let mut rows = Vec::new();
        let mut own = Vec::new();
        for (symbol, _) in self.reads.iter().filter(|r| self.open.contains(&r.0)) {
            let Some(definition) = d.of.get(symbol).filter(|_| !is_unknown(d, *symbol)) else { continue };
            let mut row = slopes(&mut x, definition.expr(), &self.open, &mut self.point);
            if let Definition::Explicit(_) = definition {
                *row.entry(*symbol).or_default() -= 1.0;
            }
            rows.push(row);
            own.push(Some(*symbol));
        }
        let closing: BTreeSet<Expr> = d.graph.constraints.iter().filter(|c| c.holonomic).map(|c| c.expr).collect();
        for condition in given {
            let mut row = slopes(&mut x, condition.residual, &self.open, &mut self.point);
            if closing.contains(&condition.residual) {
                leave_out_what_is_idle(&mut row);
            }
            rows.push(row);
            own.push(None);
        }
        rows.extend(wanted.iter().map(|&(s, _)| Row::from([(s, 1.0)])));
        own.extend(wanted.iter().map(|_| None));
        equilibrate(&mut rows);
        let added = independent(&rows.into_iter().zip(own).collect::<Vec<_>>());
        let first = added.len() - wanted.len();
        wanted.iter().zip(&added[first..]).filter(|(_, added)| **added).map(|(w, _)| *w).collect()
    }

    /// Unknowns that nothing else is said of are zero, and the storages that only they move are empty then.
    fn leave_out_what_is_zero(
        &self,
        d: &Definitions,
        chosen: &mut Vec<(Symbol, Expr)>,
        given: &[InitialCondition],
        holds: &BTreeSet<Symbol>,
    ) {
        let open = |s: &Symbol| self.open.contains(s) && is_unknown(d, *s);
        let behind_all: Vec<BTreeSet<Symbol>> =
            chosen.iter().map(|&(s, _)| behind_symbols(d, [s].into_iter())).collect();
        let mut times: BTreeMap<Symbol, usize> = BTreeMap::new();
        for reads in given.iter().map(|g| behind(d, g.residual)).chain(behind_all.iter().cloned()) {
            reads.into_iter().filter(open).for_each(|s| *times.entry(s).or_default() += 1);
        }
        let is_zero = |((_, value), behind): (&(Symbol, Expr), &BTreeSet<Symbol>)| {
            let unknowns: Vec<&Symbol> = behind.iter().filter(|s| open(s)).collect();
            let alone = matches!(unknowns[..], [only] if times[only] == 1);
            alone && *value == ZERO && behind.iter().filter(|s| self.open.contains(s)).all(|s| holds.contains(s))
        };
        let needed: Vec<bool> = chosen.iter().zip(&behind_all).map(|both| !is_zero(both)).collect();
        let mut needed = needed.into_iter();
        chosen.retain(|_| needed.next().unwrap_or(true));
    }
}

/// A state, a constant, or a position that is found by iteration.
fn is_unknown(d: &Definitions, s: Symbol) -> bool {
    d.constants.contains(&s) || d.positions.contains(&s) || (d.states.contains_key(&s) && !d.of.contains_key(&s))
}

/// What an expression reads, through definitions.
fn behind(d: &Definitions, e: Expr) -> BTreeSet<Symbol> {
    behind_symbols(d, d.x.symbols_of(e).iter().copied())
}

fn behind_symbols(d: &Definitions, symbols: impl Iterator<Item = Symbol>) -> BTreeSet<Symbol> {
    reached(d, symbols).into_iter().map(|r| r.0).collect()
}

/// Unknowns and what is defined, of all that is read; each with what it reads, those read first as far as they can be.
fn reached(d: &Definitions, roots: impl Iterator<Item = Symbol>) -> Vec<(Symbol, Vec<Symbol>)> {
    let known = |s: &Symbol| is_unknown(d, *s) || d.of.contains_key(s);
    let reads = |s: Symbol| -> Vec<Symbol> {
        match d.of.get(&s) {
            Some(of) if !is_unknown(d, s) => d.x.symbols_of(of.expr()).iter().copied().filter(known).collect(),
            _ => Vec::new(),
        }
    };
    let mut all = Vec::new();
    let mut seen = BTreeSet::new();
    for root in roots.filter(known) {
        let mut stack: Vec<(Symbol, Vec<Symbol>, usize)> = Vec::new();
        if seen.insert(root) {
            stack.push((root, reads(root), 0));
        }
        while let Some((symbol, below, next)) = stack.last_mut() {
            match below.get(*next).copied() {
                Some(read) => {
                    *next += 1;
                    if seen.insert(read) {
                        stack.push((read, reads(read), 0));
                    }
                }
                None => {
                    all.push((*symbol, std::mem::take(below)));
                    stack.pop();
                }
            }
        }
    }
    all
}

/// The derivatives of an expression by what is open, as numbers.
fn slopes(x: &mut Exprs, e: Expr, open: &BTreeSet<Symbol>, point: &mut NumericPoint) -> Row {
    let read: Vec<Symbol> = x.symbols_of(e).iter().copied().filter(|s| open.contains(s)).collect();
    let mut slope = |s: Symbol| {
        let slope = x.derivative(e, s);
        // Where a slope has no value it is some number: it is not known to be 0.
        Some(point.value(x, slope)).filter(|v| v.is_finite()).unwrap_or(1.0)
    };
    read.into_iter().map(|s| (s, slope(s))).collect()
}

/// What does not move a closed loop where it stands is not determined by it, as the angle of a rod about the ball at its end: its
/// slope is rounding there.
fn leave_out_what_is_idle(row: &mut Row) {
    let most = row.values().fold(0.0f64, |most, v| most.max(v.abs()));
    row.retain(|_, v| v.abs() > IDLE * most);
}

/// The least symbol of those that hang together with one, with the way to it shortened.
fn find(leader: &mut BTreeMap<Symbol, Symbol>, mut s: Symbol) -> Symbol {
    while leader[&s] != s {
        let above = leader[&leader[&s]];
        leader.insert(s, above);
        s = above;
    }
    s
}
