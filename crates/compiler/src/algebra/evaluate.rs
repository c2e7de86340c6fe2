//! Values in floating point.

use super::exprs::Exprs;
use super::fingerprint::scattered;
use super::math;
use super::node::{Expr, Function, Node, Symbol};
use rustc_hash::FxHashMap;

/// Values of expressions at one point; what they share is evaluated once.
///
/// ```
/// use halfarrow_compiler::algebra::{Evaluator, Exprs, Facts};
/// let mut x = Exprs::default();
/// let q = x.symbol("q", Facts::default());
/// let e = x.sym(q);
/// let square = x.powi(e, 2);
/// let mut at = |_| 3.0;
/// let mut values = Evaluator::new(&x, &mut at);
/// assert_eq!((values.value(e), values.value(square)), (3.0, 9.0));
/// ```
pub struct Evaluator<'a> {
    pool: &'a Exprs,
    symbols: &'a mut dyn FnMut(Symbol) -> f64,
    values: FxHashMap<Expr, f64>,
}

impl<'a> Evaluator<'a> {
    /// At the point where the symbols have these values.
    pub fn new(pool: &'a Exprs, symbols: &'a mut dyn FnMut(Symbol) -> f64) -> Self {
        Evaluator { pool, symbols, values: FxHashMap::default() }
    }

    /// At such a point, with values that are known from before, of the same pool at the same point.
    pub fn knowing(pool: &'a Exprs, symbols: &'a mut dyn FnMut(Symbol) -> f64, known: FxHashMap<Expr, f64>) -> Self {
        Evaluator { pool, symbols, values: known }
    }

    /// All values that are known now.
    pub fn into_known(self) -> FxHashMap<Expr, f64> {
        self.values
    }

    /// The value of an expression; NaN where it is not defined.
    pub fn value(&mut self, e: Expr) -> f64 {
        if let Some(&known) = self.values.get(&e) {
            return known;
        }
        let values = &self.values;
        for part in self.pool.below(&[e], &|e| !values.contains_key(&e)) {
            let value = match self.pool.node(part) {
                Node::Symbol(s) => (self.symbols)(*s),
                node => node_value(self.pool, node, |_, part| [self.values[&part]])[0],
            };
            self.values.insert(part, value);
        }
        self.values[&e]
    }
}

/// Expressions that are evaluated at many points, in an order that is worked out once.
///
/// ```
/// use halfarrow_compiler::algebra::{EvaluationOrder, Exprs, Facts};
/// let mut x = Exprs::default();
/// let q = x.symbol("q", Facts::default());
/// let e = x.sym(q);
/// let square = x.powi(e, 2);
/// let order = EvaluationOrder::new(&x, &[square, e]);
/// assert_eq!(order.values(&mut |_| 3.0), [9.0, 3.0]);
/// assert_eq!(order.values(&mut |_| 4.0), [16.0, 4.0]);
/// ```
#[derive(Debug, Clone)]
pub struct EvaluationOrder<'a> {
    pool: &'a Exprs,
    /// What is evaluated, parts before wholes.
    order: Vec<Evaluated<'a>>,
    /// Where the values of the parts of each stand, one after another.
    parts: Vec<u32>,
    symbols: Vec<Symbol>,
    /// Where the values of the expressions stand.
    wanted: Vec<usize>,
}

/// As many symbols are moved together.
const LANES: usize = 8;
/// Values that differ by more than this part of them are different,
const CLEARLY: f64 = 1e-6;
/// and differences below so many times the error that rounding mostly leaves in them are none.
const ROUNDING: f64 = 1e4;

/// A value between 1 and 2, as good as random: that of a symbol at the point of this number.
pub fn somewhere(number: u64, symbol: Symbol) -> f64 {
    scattered(number + 0x51de, u64::from(symbol.0))
}

/// How a value comes about.
#[derive(Debug, Clone)]
enum Evaluated<'a> {
    Number(f64),
    /// By its place among the symbols.
    Symbol(usize),
    /// With the place of its first part.
    Node(&'a Node, usize),
}

impl<'a> EvaluationOrder<'a> {
    /// Of these expressions.
    pub fn new(pool: &'a Exprs, wanted: &[Expr]) -> Self {
        let below = pool.below(wanted, &|_| true);
        let wanted = wanted.iter().map(|&e| place(&below, e)).collect();
        let (mut parts, mut symbols) = (Vec::new(), Vec::new());
        let evaluated = |&e: &Expr| match (pool.is_number(e), pool.node(e)) {
            (Some(number), _) => Evaluated::Number(number.to_f64()),
            (None, Node::Symbol(symbol)) => {
                symbols.push(*symbol);
                Evaluated::Symbol(symbols.len() - 1)
            }
            (None, node) => {
                let first = parts.len();
                node.for_each_child(|part| parts.push(place(&below, part) as u32));
                Evaluated::Node(node, first)
            }
        };
        let order = below.iter().map(evaluated).collect();
        EvaluationOrder { pool, order, parts, symbols, wanted }
    }

    /// The symbols that they read, in the order in which these are asked for.
    pub fn symbols(&self) -> &[Symbol] {
        &self.symbols
    }

    /// Their values at given values of symbols; NaN where one is not defined. Each symbol is asked for once.
    pub fn values(&self, symbols: &mut dyn FnMut(Symbol) -> f64) -> Vec<f64> {
        let mut room = Vec::new();
        self.values_in(&mut room, |k| [symbols(self.symbols[k])]).iter().map(|&[value]| value).collect()
    }

    /// The same at `N` points at once in memory that is used again, with each symbol by its place among
    /// [`symbols`](Self::symbols). The bits do not depend on how many points there are.
    pub fn values_in<'r, const N: usize>(
        &self,
        room: &'r mut Vec<[f64; N]>,
        mut symbol: impl FnMut(usize) -> [f64; N],
    ) -> &'r [[f64; N]] {
        room.clear();
        for evaluated in &self.order {
            let value = match *evaluated {
                Evaluated::Number(number) => [number; N],
                Evaluated::Symbol(k) => symbol(k),
                Evaluated::Node(node, first) => {
                    node_value(self.pool, node, |k, _| room[self.parts[first + k] as usize])
                }
            };
            room.push(value);
        }
        self.wanted.iter().for_each(|&at| room.push(room[at]));
        &room[self.order.len()..]
    }

    /// For each symbol that `may_go` the expressions in which it stands though their values hardly differ where it has another
    /// value: all others depend on it. A few symbols are looked at together.
    pub fn hardly_moved(&self, may_go: &dyn Fn(Symbol) -> bool) -> Vec<(Symbol, Vec<usize>)> {
        let (mut room, mut reads) = (Vec::new(), vec![0u8; self.order.len()]);
        let anywhere: Vec<f64> = self.symbols.iter().map(|&symbol| somewhere(0, symbol)).collect();
        self.values_in(&mut room, |k| [anywhere[k]]);
        let here: Vec<f64> = self.wanted.iter().map(|&at| room[at][0]).collect();
        let errors = self.errors(&room);
        let symbols: Vec<usize> = (0..self.symbols.len()).filter(|&k| may_go(self.symbols[k])).collect();
        let mut found = Vec::with_capacity(symbols.len());
        let mut lanes = Vec::new();
        for together in symbols.chunks(LANES) {
            let lane_of = |k: usize| together.binary_search(&k).ok();
            let there = self.values_in(&mut lanes, |k| {
                let mut values = [anywhere[k]; LANES];
                lane_of(k).into_iter().for_each(|lane| values[lane] = somewhere(1, self.symbols[k]));
                values
            });
            for (at, evaluated) in self.order.iter().enumerate() {
                reads[at] = match *evaluated {
                    Evaluated::Number(_) => 0,
                    Evaluated::Symbol(k) => lane_of(k).map_or(0, |lane| 1 << lane),
                    Evaluated::Node(node, first) => {
                        let mut parts = first..;
                        let mut all = 0;
                        node.for_each_child(|_| all |= parts.next().map_or(0, |k| reads[self.parts[k] as usize]));
                        all
                    }
                };
            }
            for (lane, &k) in together.iter().enumerate() {
                let is_near = |e: usize| {
                    let (one, other) = (here[e], there[e][lane]);
                    let apart =
                        (one - other).abs() > CLEARLY * (one.abs() + other.abs()) + ROUNDING * errors[self.wanted[e]];
                    reads[self.wanted[e]] >> lane & 1 == 1 && !apart
                };
                found.push((self.symbols[k], (0..self.wanted.len()).filter(|&e| is_near(e)).collect()));
            }
        }
        found
    }

    /// The error that rounding mostly leaves in each value, as the root of a sum of squares: errors of different roundings hardly
    /// ever add up, and of bounds that let them nothing would be left after some dozen rotations.
    fn errors(&self, room: &[[f64; 1]]) -> Vec<f64> {
        let square = |value: f64| value * value;
        let mut squares: Vec<f64> = Vec::with_capacity(self.order.len());
        for (at, evaluated) in self.order.iter().enumerate() {
            let error = match *evaluated {
                Evaluated::Number(number) => square(f64::EPSILON * number),
                Evaluated::Symbol(_) => 0.0,
                Evaluated::Node(node, first) => {
                    let value = |k: usize| room[self.parts[first + k] as usize][0];
                    let error = |k: usize| squares[self.parts[first + k] as usize];
                    let own = square(f64::EPSILON * room[at][0]);
                    match node {
                        Node::Add(terms) => (0..terms.len()).map(|k| error(k) + square(f64::EPSILON * value(k))).sum(),
                        Node::Mul(factors) => {
                            let others = |k: usize| (0..factors.len()).filter(move |&other| other != k).map(value);
                            own + (0..factors.len()).map(|k| error(k) * square(others(k).product())).sum::<f64>()
                        }
                        Node::Whole(_) => error(0),
                        _ => {
                            let mut parts = 0..;
                            let mut sum = own;
                            node.for_each_child(|_| {
                                let k = parts.next().unwrap_or_default();
                                let steep = square(room[at][0] / value(k));
                                sum += error(k) * if steep.is_finite() { steep.max(1.0) } else { 1.0 };
                            });
                            sum
                        }
                    }
                }
            };
            squares.push(error);
        }
        squares.into_iter().map(f64::sqrt).collect()
    }

    /// The slopes of the sum of all expressions, each times a weight, by each of the symbols, at the point whose values
    /// [`values_in`](Self::values_in) has left in `room`: all of them for some times what one evaluation takes. `None` where
    /// something may have a corner or a jump.
    ///
    /// ```
    /// use halfarrow_compiler::algebra::{EvaluationOrder, Exprs, Facts};
    /// let mut x = Exprs::default();
    /// let [a, b] = ["a", "b"].map(|name| x.symbol(name, Facts::default()));
    /// let [a, b] = [a, b].map(|s| x.sym(s));
    /// let product = x.mul(&[a, b]);
    /// let square = x.powi(a, 2);
    /// let order = EvaluationOrder::new(&x, &[product, square]);
    /// let mut room = Vec::new();
    /// order.values_in(&mut room, |k| [[3.0], [4.0]][k]);
    /// assert_eq!(order.slopes(&room, &[1.0, 10.0]), Some(vec![4.0 + 60.0, 3.0]));
    /// ```
    pub fn slopes(&self, room: &[[f64; 1]], weights: &[f64]) -> Option<Vec<f64>> {
        let mut slopes = vec![0.0; self.order.len()];
        self.wanted.iter().zip(weights).for_each(|(&at, weight)| slopes[at] += weight);
        let mut by_symbol = vec![0.0; self.symbols.len()];
        for (at, evaluated) in self.order.iter().enumerate().rev() {
            let own = slopes[at];
            match *evaluated {
                Evaluated::Number(_) => {}
                Evaluated::Symbol(k) => by_symbol[k] = own,
                Evaluated::Node(..) if own == 0.0 => {}
                Evaluated::Node(node, first) => {
                    let part = |k: usize| self.parts[first + k] as usize;
                    self.pass_on(node, own, &|k| room[part(k)][0], room[at][0], &mut |k, slope| {
                        slopes[part(k)] += slope
                    })?;
                }
            }
        }
        Some(by_symbol)
    }

    /// Passes the slope of a value on to its parts; `at` tells the values of these.
    fn pass_on(
        &self,
        node: &Node,
        own: f64,
        at: &dyn Fn(usize) -> f64,
        value: f64,
        to: &mut dyn FnMut(usize, f64),
    ) -> Option<()> {
        match node {
            Node::Number(_) | Node::Pi => {}
            Node::Add(terms) => (0..terms.len()).for_each(|k| to(k, own)),
            Node::Mul(factors) => {
                for k in 0..factors.len() {
                    to(k, (0..factors.len()).filter(|&j| j != k).fold(own, |product, j| product * at(j)));
                }
            }
            Node::Pow(_, n) => {
                let n = self.pool.is_number(*n)?;
                let less = n.small().map(|(above, under)| (above - under, under));
                let [below] = power([at(0)], less, [n.to_f64() - 1.0]);
                to(0, own * n.to_f64() * below);
            }
            Node::Call(f, _) => {
                let [by_first, by_second] = f.slopes(at(0), || at(1), value)?;
                to(0, own * by_first);
                if *f == Function::Atan2 {
                    to(1, own * by_second);
                }
            }
            Node::Whole(_) => to(0, own),
            _ => return None,
        }
        Some(())
    }
}

impl Function {
    /// The slopes by its arguments where it has this value; `None` of functions with corners or jumps.
    fn slopes(self, x: f64, y: impl FnOnce() -> f64, value: f64) -> Option<[f64; 2]> {
        let slope = match self {
            Function::Sin => Function::Cos.value(x, 0.0),
            Function::Cos => -Function::Sin.value(x, 0.0),
            Function::Tan => 1.0 + value * value,
            Function::Asin => 1.0 / (1.0 - x * x).sqrt(),
            Function::Acos => -1.0 / (1.0 - x * x).sqrt(),
            Function::Atan => 1.0 / (1.0 + x * x),
            Function::Atan2 => {
                let other = y();
                let square = x * x + other * other;
                return Some([other / square, -x / square]);
            }
            Function::Exp => value,
            Function::Log => 1.0 / x,
            Function::Log10 => 1.0 / (x * std::f64::consts::LN_10),
            Function::Sqrt => 0.5 / value,
            Function::Sinh => Function::Cosh.value(x, 0.0),
            Function::Cosh => Function::Sinh.value(x, 0.0),
            Function::Tanh => 1.0 - value * value,
            Function::Abs | Function::Sign | Function::Min | Function::Max | Function::Floor | Function::Mod => {
                return None;
            }
        };
        Some([slope, 0.0])
    }
}

/// The place of an expression in an ascending list that holds it.
fn place(order: &[Expr], e: Expr) -> usize {
    order.binary_search(&e).expect("parts are evaluated before wholes")
}

impl Exprs {
    /// The value of an expression at given values of its symbols; NaN where it is not defined.
    pub fn eval(&self, e: Expr, symbols: &mut dyn FnMut(Symbol) -> f64) -> f64 {
        Evaluator::new(self, symbols).value(e)
    }

    /// The value at the given parameters; `None` if the expression reads anything that is not given.
    pub fn given_value(&self, e: Expr) -> Option<f64> {
        // What a parameter is given by was there before the parameter: no cycles.
        let mut known = self.told.given();
        let mut open: Vec<Symbol> = self.symbols_of(e).into_iter().collect();
        while let Some(&symbol) = open.last() {
            if known.contains_key(&symbol) {
                open.pop();
                continue;
            }
            let given = self.facts(symbol).given?;
            let before = open.len();
            open.extend(self.symbols_of(given).into_iter().filter(|s| !known.contains_key(s)));
            if open.len() == before {
                let value = self.eval(given, &mut |s| known[&s]);
                known.insert(symbol, value);
                open.pop();
            }
        }
        Some(self.eval(e, &mut |s| known[&s]))
    }
}

/// The values of a node that is no symbol at `N` points from the values of its parts, each asked for by its place among them
/// and itself.
fn node_value<const N: usize>(pool: &Exprs, node: &Node, at: impl Fn(usize, Expr) -> [f64; N]) -> [f64; N] {
    let truth = |a: [f64; N], b: [f64; N], holds: &dyn Fn(f64, f64) -> bool| zip(a, b, |a, b| f64::from(holds(a, b)));
    let joined = |parts: &[Expr], start: f64, join: fn(f64, f64) -> f64| {
        parts.iter().enumerate().fold([start; N], |all, (k, &part)| zip(all, at(k, part), join))
    };
    match node {
        Node::Number(value) => [value.to_f64(); N],
        Node::Pi => [std::f64::consts::PI; N],
        Node::Symbol(_) => [f64::NAN; N],
        Node::Add(terms) => joined(terms, -0.0, |a, b| a + b),
        Node::Mul(factors) => joined(factors, 1.0, |a, b| a * b),
        Node::Pow(base, n) => power(at(0, *base), pool.is_number(*n).and_then(|n| n.small()), at(1, *n)),
        Node::Call(f, x) => match x.get(1) {
            Some(&y) => zip(at(0, x[0]), at(1, y), |x, y| f.value(x, y)),
            None => math::call_lanes(*f, &at(0, x[0])),
        },
        Node::Compare(c, a, b) => truth(at(0, *a), at(1, *b), &|a, b| c.holds(&a, &b)),
        Node::And(a, b) => truth(at(0, *a), at(1, *b), &|a, b| a != 0.0 && b != 0.0),
        Node::Or(a, b) => truth(at(0, *a), at(1, *b), &|a, b| a != 0.0 || b != 0.0),
        Node::Not(a) => at(0, *a).map(|a| f64::from(a == 0.0)),
        Node::Select(c, a, b) => {
            let (c, a, b) = (at(0, *c), at(1, *a), at(2, *b));
            std::array::from_fn(|i| if c[i] != 0.0 { a[i] } else { b[i] })
        }
        Node::Table(t, x) => at(0, *x).map(|x| pool.table1d(*t).value(x)),
        Node::TableSlope(t, x) => at(0, *x).map(|x| pool.table1d(*t).slope(x)),
        Node::Whole(a) => at(0, *a),
    }
}

fn zip<const N: usize>(a: [f64; N], b: [f64; N], join: impl Fn(f64, f64) -> f64) -> [f64; N] {
    std::array::from_fn(|i| join(a[i], b[i]))
}

fn power<const N: usize>(base: [f64; N], exact: Option<(i64, i64)>, n: [f64; N]) -> [f64; N] {
    match exact {
        Some((n, 1)) => base.map(|base| math::whole_power(base, n)),
        Some((1, 2)) => base.map(|base| Function::Sqrt.value(base, 0.0)),
        Some((-1, 2)) => base.map(|base| 1.0 / base.sqrt()),
        _ => math::pow_lanes(&base, &n),
    }
}
