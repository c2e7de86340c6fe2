//! Expressions to values.

use super::op::Op;
use super::roots::FreeSides;
use super::sharing::{Sharing, Unit, UnitId};
use super::values::{Reads, Values};
use super::{BlockId, ConditionId, ConditionKind, Value};
use crate::algebra::{Comparison, Expr, Exprs, Function, Interpolation, Node, Outside, Rational, Symbol, TableId};
use crate::ids::Table;
use rustc_hash::{FxHashMap, FxHashSet};
use smallvec::SmallVec;
use std::rc::Rc;

/// Values made of expressions so far.
pub(super) struct Lowering<'a> {
    exprs: &'a Exprs,
    pub values: Values,
    /// What conditions read, and how they decide.
    pub conditions: Table<ConditionId, (Value, ConditionKind)>,
    condition_of: FxHashMap<(Value, ConditionKind), ConditionId>,
    symbols: Vec<Option<Value>>,
    known: Vec<Option<Value>>,
    /// Sums whose sine and cosine are made of those of their terms.
    sums: FxHashSet<Expr>,
    /// Functions and comparisons whose sides are passed without an event, and whether one of them stands in an iteration: what that
    /// solves may be as steep as its inverse.
    free: FreeSides,
    iterated: bool,
    /// Whether what is being lowered is one of them.
    passing: bool,
    sharing: Rc<Sharing>,
    /// Symbols and expressions of the Newton block that is being lowered.
    inner: Option<Inner>,
}

#[derive(Default)]
struct Inner {
    symbols: FxHashMap<Symbol, Value>,
    known: FxHashMap<Expr, Value>,
    piecewise: bool,
}

impl<'a> Lowering<'a> {
    /// `sums`: those of angles that are taken apart; `free`: what [`free_sides`](super::roots::free_sides) gives.
    pub fn new(exprs: &'a Exprs, (sums, free): (FxHashSet<Expr>, FreeSides), sharing: Sharing) -> Self {
        Lowering {
            exprs,
            values: Values::default(),
            conditions: Table::new(),
            condition_of: FxHashMap::default(),
            symbols: vec![None; exprs.symbol_count()],
            known: vec![None; exprs.len()],
            sums,
            free,
            iterated: false,
            passing: false,
            sharing: Rc::new(sharing),
            inner: None,
        }
    }

    /// From now on `symbol` means `value`; inside a Newton block, until it ends.
    pub fn define(&mut self, symbol: Symbol, value: Value) {
        match &mut self.inner {
            Some(inner) => {
                inner.symbols.insert(symbol, value);
            }
            None => self.symbols[symbol.0 as usize] = Some(value),
        }
    }

    /// What a symbol means, if it is defined.
    pub fn defined(&self, symbol: Symbol) -> Option<Value> {
        let inner = self.inner.as_ref().and_then(|inner| inner.symbols.get(&symbol).copied());
        inner.or(self.symbols[symbol.0 as usize])
    }

    /// Begins a Newton block: gives its guesses.
    pub fn begin_newton(&mut self, block: BlockId, unknowns: &[Symbol]) -> Vec<Value> {
        self.inner = Some(Inner::default());
        let guess = |i: usize| Op::Guess(block, i as u32);
        let guesses: Vec<Value> = (0..unknowns.len()).map(|i| self.values.add(guess(i), Reads::GUESS)).collect();
        unknowns.iter().zip(&guesses).for_each(|(&symbol, &value)| self.define(symbol, value));
        guesses
    }

    /// Ends it; whether conditions were met in it.
    pub fn end_newton(&mut self) -> bool {
        self.inner.take().is_some_and(|inner| inner.piecewise)
    }

    /// The value of an expression whose symbols are all defined.
    ///
    /// # Panics
    /// If one is not: the steps are out of order.
    pub fn value(&mut self, e: Expr) -> Value {
        if let Some(known) = self.known(e) {
            return known;
        }
        let mut ready = true;
        self.exprs.node(e).for_each_child(|c| ready &= self.known(c).is_some());
        if ready {
            return self.node_of(e);
        }
        self.missing_below(e).into_iter().for_each(|part| {
            self.node_of(part);
        });
        self.known(e).expect("an expression is lowered after its parts")
    }

    /// Lowers an expression whose parts are lowered.
    fn node_of(&mut self, e: Expr) -> Value {
        self.passing = self.passes_freely(e);
        self.iterated |= self.inner.is_some() && self.free.contains(e);
        let value = self.node(e);
        match &mut self.inner {
            Some(inner) => {
                inner.known.insert(e, value);
            }
            None => self.known[e.0 as usize] = Some(value),
        }
        value
    }

    fn known(&self, e: Expr) -> Option<Value> {
        self.known[e.0 as usize].or_else(|| self.inner.as_ref().and_then(|inner| inner.known.get(&e).copied()))
    }

    /// What is not lowered yet at and below `e`, parts before wholes.
    fn missing_below(&self, e: Expr) -> Vec<Expr> {
        self.exprs.below(&[e], &|e| self.known(e).is_none())
    }

    fn node(&mut self, e: Expr) -> Value {
        let exprs = self.exprs;
        let of = |this: &Self, e: Expr| this.known(e).expect("parts stand before wholes");
        match exprs.node(e) {
            Node::Number(number) => self.number(number),
            Node::Pi => self.constant(std::f64::consts::PI),
            Node::Symbol(symbol) => self
                .defined(*symbol)
                .unwrap_or_else(|| panic!("{} is read before a step defines it", exprs.label(*symbol))),
            Node::Add(terms) => self.sum(e, terms),
            Node::Mul(factors) => self.product(e, factors, false),
            Node::Pow(base, exponent) => {
                let (numerator, denominator) = self.power(*base, *exponent);
                self.quotient(numerator, denominator)
            }
            Node::Call(f @ (Function::Sin | Function::Cos), arguments) if self.sums.contains(&arguments[0]) => {
                let (sine, cosine) = self.turned(arguments[0]);
                if *f == Function::Sin { sine } else { cosine }
            }
            Node::Call(f, arguments) => {
                let a = of(self, arguments[0]);
                let b = arguments.get(1).map(|&b| of(self, b));
                self.call(*f, a, b)
            }
            Node::Compare(relation, a, b) => {
                let (a, b) = (of(self, *a), of(self, *b));
                self.compare(*relation, a, b)
            }
            Node::And(a, b) => self.op(Op::And(of(self, *a), of(self, *b))),
            Node::Or(a, b) => self.op(Op::Or(of(self, *a), of(self, *b))),
            Node::Not(a) => self.op(Op::Not(of(self, *a))),
            Node::Select(c, a, b) => self.select(of(self, *c), of(self, *a), of(self, *b)),
            Node::Table(table, x) => {
                let x = of(self, *x);
                let piece = self.piece(*table, x);
                self.op(Op::Table(table.0, piece, x))
            }
            Node::TableSlope(table, x) => {
                let x = of(self, *x);
                let piece = self.piece(*table, x);
                self.op(Op::TableSlope(table.0, piece, x))
            }
            Node::Whole(part) => of(self, *part),
        }
    }

    fn number(&mut self, number: &Rational) -> Value {
        self.constant(number.to_f64())
    }

    fn sum(&mut self, e: Expr, terms: &[Expr]) -> Value {
        let sharing = Rc::clone(&self.sharing);
        let parts = match sharing.parts(e) {
            Some(parts) => parts.units.iter().map(|&(minus, unit)| (minus, self.term(unit))).collect(),
            None => terms.iter().map(|&t| self.magnitude(t)).collect(),
        };
        self.total(parts)
    }

    /// The sum of terms, each with whether it is subtracted.
    fn total(&mut self, mut parts: SmallVec<[(bool, Value); 4]>) -> Value {
        // A term that is added goes first, so that nothing need be negated.
        if let Some(first) = parts.iter().position(|&(minus, _)| !minus) {
            parts[..=first].rotate_right(1);
        }
        let (minus, first) = parts[0];
        let start = if minus { self.neg(first) } else { first };
        parts[1..].iter().fold(start, |sum, &(minus, term)| match minus {
            true => self.sub(sum, term),
            false => self.add(sum, term),
        })
    }

    /// A term of a sum.
    fn term(&mut self, unit: UnitId) -> Value {
        match Rc::clone(&self.sharing).units[unit as usize] {
            Unit::Pair(a, b, turned) => {
                let parts = [(false, self.term(a)), (turned, self.term(b))];
                self.total(parts.as_slice().into())
            }
            Unit::Sum(ref terms) => {
                let parts = terms.iter().map(|&(minus, unit)| (minus, self.term(unit))).collect();
                self.total(parts)
            }
            Unit::Size(term) => match self.exprs.node(term) {
                Node::Mul(factors) => self.product(term, factors, true),
                Node::Number(n) => self.number(&n.abs()),
                _ => self.known(term).expect("parts stand before wholes"),
            },
            Unit::Whole(_) | Unit::Inverse(_) | Unit::Product(..) => unreachable!("these are no terms"),
        }
    }

    /// A factor of a product: numerator and denominator.
    fn factor(&mut self, unit: UnitId) -> (Option<Value>, Option<Value>) {
        match Rc::clone(&self.sharing).units[unit as usize] {
            Unit::Whole(e) => (Some(self.known(e).expect("parts stand before wholes")), None),
            Unit::Inverse(e) => {
                let value = self.known(e).expect("parts stand before wholes");
                match self.sharing.reciprocals.contains(&e) {
                    true => (Some(self.quotient(None, Some(value))), None),
                    false => (None, Some(value)),
                }
            }
            Unit::Pair(a, b, _) => match self.factors(&[a, b]) {
                (Some(above), below) => (Some(self.quotient(Some(above), below)), None),
                below => below,
            },
            Unit::Product(ref product) => {
                let (number, factors) = &**product;
                let number = if number.is_one() { None } else { Some(self.number(number)) };
                let (above, below) = self.factors(factors);
                let above = self.times(number, above);
                (Some(self.quotient(above, below)), None)
            }
            Unit::Sum(_) | Unit::Size(_) => unreachable!("these are no factors"),
        }
    }

    fn factors(&mut self, units: &[UnitId]) -> (Option<Value>, Option<Value>) {
        let (mut numerator, mut denominator) = (None, None);
        for &unit in units {
            let (above, below) = self.factor(unit);
            numerator = self.times(numerator, above);
            denominator = self.times(denominator, below);
        }
        (numerator, denominator)
    }

    /// Sine and cosine of a sum from those of its terms.
    fn turned(&mut self, sum: Expr) -> (Value, Value) {
        let Node::Add(terms) = self.exprs.node(sum) else { panic!("only sums are taken apart") };
        let mut all: Option<(Value, Value)> = None;
        for &term in terms {
            let (minus, angle) = self.magnitude(term);
            let (sine, cosine) = (self.op(Op::Call(Function::Sin, angle)), self.op(Op::Call(Function::Cos, angle)));
            all = Some(match all {
                None => (if minus { self.neg(sine) } else { sine }, cosine),
                Some((s, c)) => {
                    let (sc, cs) = (self.mul(s, cosine), self.mul(c, sine));
                    let (cc, ss) = (self.mul(c, cosine), self.mul(s, sine));
                    match minus {
                        true => (self.sub(sc, cs), self.add(cc, ss)),
                        false => (self.add(sc, cs), self.sub(cc, ss)),
                    }
                }
            });
        }
        all.expect("a sum has terms")
    }

    /// Whether a term is subtracted, and the value that is.
    fn magnitude(&mut self, term: Expr) -> (bool, Value) {
        let exprs = self.exprs;
        let negative = |e: Expr| exprs.is_number(e).is_some_and(|n| n.signum() < 0);
        match exprs.node(term) {
            Node::Mul(factors) if negative(factors[0]) => (true, self.product(term, factors, true)),
            Node::Number(n) if n.signum() < 0 => (true, self.number(&n.abs())),
            _ => (false, self.known(term).expect("parts stand before wholes")),
        }
    }

    /// The product, with the sign of its number left out if `absolute`.
    fn product(&mut self, e: Expr, factors: &[Expr], absolute: bool) -> Value {
        if let Some(parts) = Rc::clone(&self.sharing).parts(e) {
            let units: SmallVec<[UnitId; 8]> = parts.units.iter().map(|u| u.1).collect();
            let (numerator, denominator) = self.factors(&units);
            let value = self.quotient(numerator, denominator);
            return if parts.minus && !absolute { self.neg(value) } else { value };
        }
        let (mut numerator, mut denominator, mut minus) = (None, None, false);
        for &factor in factors {
            let (above, below) = match self.exprs.node(factor) {
                Node::Number(n) => {
                    let size = n.abs();
                    minus = n.signum() < 0 && !absolute;
                    (if size.is_one() { None } else { Some(self.number(&size)) }, None)
                }
                Node::Pow(base, exponent) => self.power(*base, *exponent),
                _ => (Some(self.known(factor).expect("parts stand before wholes")), None),
            };
            numerator = self.times(numerator, above);
            denominator = self.times(denominator, below);
        }
        let value = self.quotient(numerator, denominator);
        if minus { self.neg(value) } else { value }
    }

    fn times(&mut self, a: Option<Value>, b: Option<Value>) -> Option<Value> {
        match (a, b) {
            (Some(a), Some(b)) => Some(self.mul(a, b)),
            (one, other) => one.or(other),
        }
    }

    fn quotient(&mut self, numerator: Option<Value>, denominator: Option<Value>) -> Value {
        match (numerator, denominator) {
            (Some(n), Some(d)) => self.div(n, d),
            (Some(n), None) => n,
            (None, d) => {
                let one = self.constant(1.0);
                d.map_or(one, |d| self.div(one, d))
            }
        }
    }

    /// A power as a numerator or a denominator.
    fn power(&mut self, base: Expr, exponent: Expr) -> (Option<Value>, Option<Value>) {
        let a = self.known(base).expect("parts stand before wholes");
        let small = self.exprs.is_number(exponent).and_then(|n| n.small());
        let value = match small {
            Some((n, 1)) if n.unsigned_abs() <= 64 => self.powi(a, n.unsigned_abs() as u32),
            Some((1 | -1, 2)) => {
                let a = self.rooted(base, a);
                self.op(Op::Call(Function::Sqrt, a))
            }
            Some((3 | -3, 2)) => {
                let a = self.rooted(base, a);
                let root = self.op(Op::Call(Function::Sqrt, a));
                self.mul(a, root)
            }
            _ => {
                let b = self.known(exponent).expect("parts stand before wholes");
                let a = self.rooted(base, a);
                let value = self.op(Op::Pow(a, b));
                return (Some(value), None);
            }
        };
        match small {
            Some((n, _)) if n < 0 => (None, Some(value)),
            _ => (Some(value), None),
        }
    }

    /// What a root is taken of. What is never below 0, as `abs(e)` and `max(e, 0)`, is so by rounding where a side of them is held
    /// and time alone has come to where the other one begins. Steps of states that go further are to have no value there.
    fn rooted(&mut self, base: Expr, a: Value) -> Value {
        let timed = self.holds(a) && !self.values.reads(a).includes(Reads::STATE);
        let may_be_below = timed && self.exprs.nonnegative(base) && !self.exprs.corners(base).is_empty();
        if may_be_below { self.op(Op::Call(Function::Abs, a)) } else { a }
    }

    /// Whether a side is passed without an event, since states take it there. Where time alone does, the event is known
    /// beforehand.
    fn passes_freely(&self, e: Expr) -> bool {
        let moves = |part| self.known(part).is_some_and(|part| self.values.reads(part).includes(Reads::STATE));
        let mut moved = false;
        if self.free.contains(e) {
            self.exprs.node(e).for_each_child(|part| moved |= moves(part));
        }
        moved
    }

    /// Whether any of them is.
    pub fn is_steep(&self) -> bool {
        self.iterated || self.free.steep.iter().any(|&e| self.passes_freely(e))
    }

    /// All values and conditions; what else is known of expressions takes no memory from then on.
    pub fn into_values(self) -> (Values, Table<ConditionId, (Value, ConditionKind)>) {
        let Lowering { mut values, conditions, .. } = self;
        values.settle();
        (values, conditions)
    }

    fn call(&mut self, f: Function, a: Value, b: Option<Value>) -> Value {
        match (f, b) {
            (Function::Mod, Some(b)) => {
                let ratio = self.div(a, b);
                let whole = self.floor(ratio);
                let product = self.mul(b, whole);
                self.sub(a, product)
            }
            (Function::Floor, _) => self.floor(a),
            (Function::Abs, _) if self.holds(a) => {
                let (side, minus) = (self.side(a), self.neg(a));
                self.select(side, a, minus)
            }
            (Function::Sign, _) if self.holds(a) => {
                let minus = self.neg(a);
                let (plus, minus) = (self.side(a), self.side(minus));
                self.sub(plus, minus)
            }
            (Function::Min | Function::Max, Some(b)) => {
                let difference = if f == Function::Min { self.sub(b, a) } else { self.sub(a, b) };
                let side = self.side(difference);
                self.select(side, a, b)
            }
            (_, Some(b)) => self.op(Op::Atan2(a, b)),
            (f, None) => {
                self.note_piecewise(f, a);
                self.op(Op::Call(f, a))
            }
        }
    }

    fn note_piecewise(&mut self, f: Function, a: Value) {
        let guessed = self.values.reads(a).includes(Reads::GUESS);
        if let Some(inner) = &mut self.inner {
            inner.piecewise |= guessed && matches!(f, Function::Abs | Function::Sign);
        }
    }

    fn compare(&mut self, relation: Comparison, a: Value, b: Value) -> Value {
        let above = self.sub(a, b);
        let below = self.sub(b, a);
        match relation {
            Comparison::Gt => self.side(above),
            Comparison::Lt => self.side(below),
            Comparison::Le => {
                let side = self.side(above);
                self.op(Op::Not(side))
            }
            Comparison::Ge => {
                let side = self.side(below);
                self.op(Op::Not(side))
            }
            Comparison::Eq | Comparison::Ne => {
                let (above, below) = (self.side(above), self.side(below));
                let differ = self.op(Op::Or(above, below));
                if relation == Comparison::Ne { differ } else { self.op(Op::Not(differ)) }
            }
        }
    }

    /// Whether conditions on the value are held: it varies and is no guess.
    fn holds(&self, a: Value) -> bool {
        let reads = self.values.reads(a);
        !self.passing && reads != Reads::PARAMETERS && !reads.includes(Reads::GUESS)
    }

    fn side(&mut self, a: Value) -> Value {
        if self.holds(a) {
            let condition = self.condition(a, ConditionKind::Sign);
            return self.op(Op::Sign(condition, a));
        }
        if let Some(inner) = &mut self.inner {
            inner.piecewise = true;
        }
        self.op(Op::Positive(a))
    }

    fn floor(&mut self, a: Value) -> Value {
        if self.holds(a) {
            let condition = self.condition(a, ConditionKind::Floor);
            return self.op(Op::Floor(condition, a));
        }
        self.op(Op::Call(Function::Floor, a))
    }

    /// The condition that holds the piece of a table, where it needs one: a smooth table read by the state has none.
    fn piece(&mut self, table: TableId, x: Value) -> Option<ConditionId> {
        let shape = self.exprs.table1d(table);
        let smooth = shape.interpolation() == Interpolation::Cubic && shape.outside() != Outside::Clamp;
        let needed = self.holds(x) && !(smooth && self.values.reads(x).includes(Reads::STATE));
        needed.then(|| self.condition(x, ConditionKind::Piece(table.0)))
    }

    fn condition(&mut self, operand: Value, kind: ConditionKind) -> ConditionId {
        if let Some(&known) = self.condition_of.get(&(operand, kind)) {
            return known;
        }
        let id = self.conditions.push((operand, kind));
        self.condition_of.insert((operand, kind), id);
        id
    }
}

/// Operations on values.
impl Lowering<'_> {
    pub fn op(&mut self, op: Op) -> Value {
        self.values.op_of(op)
    }
    pub fn constant(&mut self, value: f64) -> Value {
        self.values.number(value)
    }
    fn neg(&mut self, a: Value) -> Value {
        self.values.neg(a)
    }
    pub fn add(&mut self, a: Value, b: Value) -> Value {
        self.values.plus(a, b)
    }
    fn sub(&mut self, a: Value, b: Value) -> Value {
        self.values.minus(a, b)
    }
    fn mul(&mut self, a: Value, b: Value) -> Value {
        self.values.times(a, b)
    }
    fn div(&mut self, a: Value, b: Value) -> Value {
        self.values.over(a, b)
    }
    fn powi(&mut self, a: Value, n: u32) -> Value {
        self.values.powi(a, n)
    }
    fn select(&mut self, condition: Value, then: Value, other: Value) -> Value {
        self.values.select(condition, then, other)
    }
}
