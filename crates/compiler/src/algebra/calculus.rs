//! Derivatives and substitution.

use super::evaluate::EvaluationOrder;
use super::exprs::{Exprs, MINUS_ONE, ONE, ZERO};
use super::fingerprint::POISON;
use super::node::{Comparison, Expr, Function, Node, Symbol};
use super::table::TableId;
use crate::ids::Id;
use rustc_hash::FxHashMap;
use std::collections::BTreeMap;

/// So many symbols are taken out of expressions one by one.
const FEW: usize = 8;

/// What a derivative is taken by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum By {
    /// A symbol, wherever it stands.
    Symbol(Symbol),
    /// Time, along a motion in which each symbol has its rate.
    Time,
}

impl Exprs {
    /// The partial derivative by a symbol, all others held. At corners it is the derivative of one side; `sign` and
    /// `floor` count as constant.
    ///
    /// ```
    /// use halfarrow_compiler::algebra::{Exprs, Facts, Function};
    /// let mut x = Exprs::default();
    /// let q = x.symbol("q", Facts::default());
    /// let e = x.sym(q);
    /// let sine = x.call(Function::Sin, &[e]);
    /// assert_eq!(x.derivative(sine, q), x.call(Function::Cos, &[e]));
    /// ```
    pub fn derivative(&mut self, e: Expr, symbol: Symbol) -> Expr {
        let by = By::Symbol(symbol);
        if let Some(&known) = self.derivatives.get(&(e, by)) {
            return known;
        }
        let order = self.reading_below(&[e], &|s| s == symbol, &|e| self.derivatives.contains_key(&(e, by)));
        for part in order {
            let slope = self.derivative_of_node(part, by);
            self.derivatives.insert((part, by), slope);
        }
        self.slope(e, by)
    }

    /// The parts of an expression whose derivative by time is not known yet, those within others first; what keeps its
    /// value is left out, as `varies` tells of symbols.
    pub fn undifferentiated(&self, e: Expr, varies: &dyn Fn(Symbol) -> bool) -> Vec<Expr> {
        self.reading_below(&[e], varies, &|part| self.known_rate(part).is_some())
    }

    /// The derivative of a part by time, from those of the parts that it is made of, as far as [`set_rate`](Exprs::set_rate)
    /// has told them; what it has not told keeps its value.
    pub fn rate_of_node(&mut self, part: Expr) -> Expr {
        self.derivative_of_node(part, By::Time)
    }

    /// The derivative of a part by time, if it was told.
    pub fn known_rate(&self, part: Expr) -> Option<Expr> {
        self.derivatives.get(&(part, By::Time)).copied()
    }

    /// Tells the derivative of a part by time.
    pub fn set_rate(&mut self, part: Expr, rate: Expr) {
        self.derivatives.insert((part, By::Time), rate);
    }

    /// Forgets all derivatives by time: they belong to one motion.
    pub fn forget_rates(&mut self) {
        self.derivatives.retain(|(_, by), _| *by != By::Time);
    }

    /// Whether an expression has wholes in it.
    pub fn has_wholes(&self, e: Expr) -> bool {
        self.around_wholes(&[e], &|_| true).iter().any(|&part| matches!(self.node(part), Node::Whole(_)))
    }

    /// The expression with expressions in place of symbols, all at once.
    pub fn substitute(&mut self, e: Expr, values: &BTreeMap<Symbol, Expr>) -> Expr {
        self.substitute_all(&[e], values)[0]
    }

    /// The expressions with expressions in place of symbols, all at once; what they share is rebuilt once.
    pub fn substitute_all(&mut self, roots: &[Expr], values: &BTreeMap<Symbol, Expr>) -> Vec<Expr> {
        let order = self.reading_below(roots, &|s| values.contains_key(&s), &|_| false);
        let mut new: FxHashMap<Expr, Expr> = FxHashMap::default();
        for part in order {
            let rebuilt = match self.node(part) {
                Node::Symbol(s) => values[s],
                _ => self.rebuild(part, &|c| new.get(&c).copied().unwrap_or(c)),
            };
            new.insert(part, rebuilt);
        }
        roots.iter().map(|r| new.get(r).copied().unwrap_or(*r)).collect()
    }

    /// The expression where a condition holds, or does not: with one side of each choice that goes by it.
    pub fn in_branch(&mut self, e: Expr, condition: Expr, holds: bool) -> Expr {
        let mut new: FxHashMap<Expr, Expr> = FxHashMap::default();
        for part in self.below(&[e], &|_| true) {
            let side = match *self.node(part) {
                Node::Select(c, a, b) if c == condition => Some(if holds { a } else { b }),
                _ => None,
            };
            let known = |c: Expr| new.get(&c).copied().unwrap_or(c);
            let made = match side {
                Some(side) => known(side),
                None => self.rebuild(part, &known),
            };
            new.insert(part, made);
        }
        new.get(&e).copied().unwrap_or(e)
    }

    /// The expressions without symbols that they read though their value does not depend on them: the distance of two points
    /// of a body does not depend on where the body is. `may_go` tells which symbols are looked at.
    ///
    /// ```
    /// use halfarrow_compiler::algebra::{Exprs, Facts, Function};
    /// let mut x = Exprs::default();
    /// let [phi, a] = ["phi", "a"].map(|name| x.symbol(name, Facts::default()));
    /// let [angle, a] = [phi, a].map(|s| x.sym(s));
    /// let [sine, cosine] = [Function::Sin, Function::Cos].map(|f| x.call(f, &[angle]));
    /// let [across, along] = [sine, cosine].map(|e| x.mul(&[a, e]));
    /// let squares = [across, along].map(|e| x.powi(e, 2));
    /// let sum = x.add(&squares);
    /// assert_eq!(x.without_idle(&[sum], &|s| s == phi), [x.powi(a, 2)]);
    /// ```
    pub fn without_idle(&mut self, roots: &[Expr], may_go: &dyn Fn(Symbol) -> bool) -> Vec<Expr> {
        let mut hardly_moved = EvaluationOrder::new(self, roots).hardly_moved(may_go);
        hardly_moved.sort_unstable_by_key(|moved| moved.0);
        let mut maybe: Vec<Vec<Symbol>> = vec![Vec::new(); roots.len()];
        hardly_moved.iter().for_each(|(symbol, members)| members.iter().for_each(|&i| maybe[i].push(*symbol)));
        let mut found = roots.to_vec();
        // Many of them mostly may go all at once: what carries a loop of a chain are all joints before it.
        let mut done = vec![false; roots.len()];
        for (symbols, members) in by_symbols(maybe).into_iter().filter(|(symbols, _)| symbols.len() > FEW) {
            let own: Vec<Expr> = members.iter().map(|&i| roots[i]).collect();
            let at = self.substitute_all(&own, &symbols.into_iter().map(|s| (s, ZERO)).collect());
            for (i, value) in members.into_iter().zip(at) {
                if self.has_value_of(value, roots[i]) {
                    // Where joints are not turned, lengths before them are numbers in several sums.
                    (found[i], done[i]) = (self.with_numbers_joined(value), true);
                }
            }
        }
        let mut idle: Vec<Vec<Symbol>> = vec![Vec::new(); roots.len()];
        for (symbol, members) in hardly_moved {
            let members: Vec<usize> = members.into_iter().filter(|&i| !done[i]).collect();
            let own: Vec<Expr> = members.iter().map(|&i| roots[i]).collect();
            let at = self.substitute_all(&own, &BTreeMap::from([(symbol, ZERO)]));
            for (i, (root, value)) in members.into_iter().zip(own.into_iter().zip(at)) {
                if value != root && self.has_value_of(value, root) {
                    idle[i].push(symbol);
                }
            }
        }
        for (symbols, members) in by_symbols(idle) {
            let mut own: Vec<Expr> = members.iter().map(|&i| roots[i]).collect();
            for symbol in symbols {
                // A quaternion of zeros turns nothing.
                for value in [ZERO, ONE] {
                    let at = self.substitute_all(&own, &BTreeMap::from([(symbol, value)]));
                    if own.iter().zip(&at).all(|(&own, &at)| self.has_value_of(at, own)) {
                        own = at;
                        break;
                    }
                }
            }
            members.into_iter().zip(own).for_each(|(i, e)| found[i] = e);
        }
        found
    }

    /// The expression with one number in the place of several that stand in a sum and in sums within it.
    fn with_numbers_joined(&mut self, e: Expr) -> Expr {
        let mut new: FxHashMap<Expr, Expr> = FxHashMap::default();
        for part in self.below(&[e], &|_| true) {
            let known = |c: Expr| new.get(&c).copied().unwrap_or(c);
            let mut made = self.rebuild(part, &known);
            if let Node::Add(terms) = self.node(made) {
                let terms = terms.clone();
                let sums: Vec<Option<[Expr; 2]>> = terms.iter().map(|&e| self.sum_with_number(e)).collect();
                let alone = terms.iter().filter(|&&e| self.is_number(e).is_some()).count();
                if alone + sums.iter().flatten().count() > 1 {
                    let parts = terms.iter().zip(&sums).flat_map(|(term, sum)| match sum {
                        Some(parts) => &parts[..],
                        None => std::slice::from_ref(term),
                    });
                    let parts: Vec<Expr> = parts.copied().collect();
                    made = self.add(&parts);
                }
            }
            new.insert(part, made);
        }
        new[&e]
    }

    /// The number in a sum, be it taken as a whole, and what is left of the sum, each times what that is multiplied by.
    fn sum_with_number(&mut self, e: Expr) -> Option<[Expr; 2]> {
        let (factor, sum) = self.coefficient(e);
        let (inner, whole) = if let Node::Whole(part) = self.node(sum) { (*part, true) } else { (sum, false) };
        let Node::Add(terms) = self.node(inner) else { return None };
        let terms = terms.to_vec();
        let (numbers, rest): (Vec<Expr>, Vec<Expr>) = terms.into_iter().partition(|&e| self.is_number(e).is_some());
        let &[number] = &numbers[..] else { return None };
        let rest = self.add(&rest);
        let rest = if whole { self.whole(rest) } else { rest };
        let factor = self.number(factor);
        Some([number, rest].map(|part| self.mul(&[factor, part])))
    }

    /// Whether the values in the prime field are the same, where there are any.
    fn has_value_of(&self, e: Expr, other: Expr) -> bool {
        let (own, other) = (self.fingerprint(e), self.fingerprint(other));
        own == other && !own.contains(&POISON)
    }

    /// The expression made anew from other parts.
    pub(super) fn rebuild(&mut self, e: Expr, part: &dyn Fn(Expr) -> Expr) -> Expr {
        match self.node(e) {
            Node::Number(_) | Node::Pi | Node::Symbol(_) => e,
            node => {
                let node = node.with_parts(part);
                self.made(node)
            }
        }
    }

    /// A node in canonical form.
    fn made(&mut self, node: Node) -> Expr {
        match node {
            Node::Number(value) => self.number(value),
            Node::Pi => self.pi(),
            Node::Symbol(symbol) => self.sym(symbol),
            Node::Add(terms) => self.add(&terms),
            Node::Mul(factors) => self.mul(&factors),
            Node::Pow(base, n) => self.pow(base, n),
            Node::Call(f, x) => self.call(f, &x),
            Node::Compare(c, a, b) => self.compare(c, a, b),
            Node::And(a, b) => self.and(a, b),
            Node::Or(a, b) => self.or(a, b),
            Node::Not(a) => self.not(a),
            Node::Select(c, a, b) => self.select(c, a, b),
            Node::Table(t, x) => self.table(t, x),
            Node::TableSlope(t, x) => self.table_slope(t, x),
            Node::Whole(part) => self.whole(part),
        }
    }

    /// An expression of a pool that has grown from a copy of this one, in this one. `None` if it reads what only that pool
    /// has: symbols, tables.
    ///
    /// ```
    /// use halfarrow_compiler::algebra::{Exprs, Facts};
    /// let mut x = Exprs::default();
    /// let q = x.symbol("q", Facts::default());
    /// let mut grown = x.clone();
    /// let (square, p) = (grown.sym(q), grown.symbol("p", Facts::default()));
    /// let (square, p) = (grown.powi(square, 2), grown.sym(p));
    /// let own = x.sym(q);
    /// assert_eq!(x.taken_from(&grown, square), Some(x.powi(own, 2)));
    /// assert_eq!(x.taken_from(&grown, p), None);
    /// ```
    pub fn taken_from(&mut self, grown: &Exprs, e: Expr) -> Option<Expr> {
        let common = self.len();
        let mut new: FxHashMap<Expr, Expr> = FxHashMap::default();
        for part in grown.below(&[e], &|part| part.index() >= common) {
            let node = match grown.node(part) {
                Node::Symbol(symbol) => {
                    let symbol = grown.untwinned(*symbol);
                    (symbol.index() < self.symbol_count()).then_some(Node::Symbol(symbol))?
                }
                Node::Table(table, _) | Node::TableSlope(table, _) if table.index() >= self.table_count() => {
                    return None;
                }
                node => node.with_parts(&|part| new.get(&part).copied().unwrap_or(part)),
            };
            new.insert(part, self.made(node));
        }
        Some(new.get(&e).copied().unwrap_or(e))
    }

    fn slope(&self, e: Expr, by: By) -> Expr {
        self.derivatives.get(&(e, by)).copied().unwrap_or(ZERO)
    }

    /// The derivative of a node whose parts have theirs.
    fn derivative_of_node(&mut self, e: Expr, by: By) -> Expr {
        match self.node(e).clone() {
            Node::Symbol(s) => {
                if By::Symbol(s) == by {
                    ONE
                } else {
                    ZERO
                }
            }
            Node::Add(terms) => {
                let slopes: Vec<Expr> = terms.iter().map(|&t| self.slope(t, by)).collect();
                self.add(&slopes)
            }
            Node::Mul(factors) => self.derivative_of_product(&factors, by),
            Node::Pow(base, n) => self.derivative_of_power(base, n, e, by),
            Node::Call(f, x) => {
                let mut terms = Vec::new();
                for (i, &argument) in x.iter().enumerate() {
                    let slope = self.slope(argument, by);
                    if slope != ZERO {
                        let partial = self.partial(f, &x, i, e);
                        terms.push(self.mul(&[partial, slope]));
                    }
                }
                self.add(&terms)
            }
            Node::Select(c, a, b) => {
                let (a, b) = (self.slope(a, by), self.slope(b, by));
                self.select(c, a, b)
            }
            Node::Table(t, x) => {
                let slope = self.table_slope(t, x);
                let inner = self.slope(x, by);
                self.mul(&[slope, inner])
            }
            Node::TableSlope(t, x) => {
                let inner = self.slope(x, by);
                let t = self.table_of_slopes(t);
                let slope = self.table_slope(t, x);
                self.mul(&[slope, inner])
            }
            Node::Whole(part) => {
                let slope = self.slope(part, by);
                self.whole(slope)
            }
            Node::Number(_) | Node::Pi | Node::Compare(..) | Node::And(..) | Node::Or(..) | Node::Not(_) => ZERO,
        }
    }

    fn derivative_of_product(&mut self, factors: &[Expr], by: By) -> Expr {
        let mut terms = Vec::new();
        for (i, &factor) in factors.iter().enumerate() {
            let slope = self.slope(factor, by);
            if slope != ZERO {
                let mut parts = factors.to_vec();
                parts[i] = slope;
                terms.push(self.mul(&parts));
            }
        }
        self.add(&terms)
    }

    fn derivative_of_power(&mut self, base: Expr, n: Expr, power: Expr, by: By) -> Expr {
        let (base_slope, n_slope) = (self.slope(base, by), self.slope(n, by));
        let mut terms = Vec::new();
        if base_slope != ZERO {
            let less = self.add(&[n, MINUS_ONE]);
            let lower = self.pow(base, less);
            terms.push(self.mul(&[n, lower, base_slope]));
        }
        if n_slope != ZERO {
            let log = self.call(Function::Log, &[base]);
            terms.push(self.mul(&[power, log, n_slope]));
        }
        self.add(&terms)
    }

    /// The derivative of a function by its argument with this index; `value` is the call itself.
    fn partial(&mut self, f: Function, x: &[Expr], index: usize, value: Expr) -> Expr {
        use Function::*;
        match f {
            Sin => self.call(Cos, x),
            Cos => {
                let sine = self.call(Sin, x);
                self.neg(sine)
            }
            Tan => self.one_plus_square(value, 1),
            Asin | Acos => {
                let square = self.one_plus_square(x[0], -1);
                let root = self.sqrt(square);
                let slope = self.recip(root);
                if f == Asin { slope } else { self.neg(slope) }
            }
            Atan => {
                let square = self.one_plus_square(x[0], 1);
                self.recip(square)
            }
            Atan2 => {
                let squares = [self.powi(x[0], 2), self.powi(x[1], 2)];
                let square = self.add(&squares);
                let other = if index == 0 { x[1] } else { self.neg(x[0]) };
                self.div(other, square)
            }
            Exp => value,
            Log => self.recip(x[0]),
            Log10 => {
                let ten = self.int(10);
                let log = self.call(Log, &[ten]);
                let scaled = self.mul(&[x[0], log]);
                self.recip(scaled)
            }
            Sqrt => {
                let root = self.recip(value);
                self.scale(&super::Rational::new(1, 2), root)
            }
            Abs => self.call(Sign, x),
            Sign | Floor => ZERO,
            Min | Max => {
                let first = self.compare(if f == Min { Comparison::Le } else { Comparison::Ge }, x[0], x[1]);
                if index == 0 { self.select(first, ONE, ZERO) } else { self.select(first, ZERO, ONE) }
            }
            Sinh => self.call(Cosh, x),
            Cosh => self.call(Sinh, x),
            Tanh => self.one_plus_square(value, -1),
            Mod if index == 0 => ONE,
            Mod => {
                let ratio = self.div(x[0], x[1]);
                let whole = self.call(Floor, &[ratio]);
                self.neg(whole)
            }
        }
    }

    /// `1 + sign * x^2`
    fn one_plus_square(&mut self, x: Expr, sign: i64) -> Expr {
        let square = self.powi(x, 2);
        let term = self.scale(&super::Rational::from(sign), square);
        self.add(&[ONE, term])
    }

    fn table_of_slopes(&mut self, table: TableId) -> TableId {
        if let Some(&known) = self.slope_tables.get(&table) {
            return known;
        }
        let slopes = self.table1d(table).derivative();
        let id = self.add_table(slopes);
        self.slope_tables.insert(table, id);
        id
    }
}

/// The numbers of those that have the same symbols, if they have any.
fn by_symbols(all: Vec<Vec<Symbol>>) -> BTreeMap<Vec<Symbol>, Vec<usize>> {
    let mut alike: BTreeMap<Vec<Symbol>, Vec<usize>> = BTreeMap::new();
    let some = all.into_iter().enumerate().filter(|(_, symbols)| !symbols.is_empty());
    some.for_each(|(i, symbols)| alike.entry(symbols).or_default().push(i));
    alike
}
