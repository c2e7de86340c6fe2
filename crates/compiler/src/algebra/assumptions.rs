//! What is taken for granted of expressions, and what was decided by the values that parameters have.
//!
//! Both are a value apart from the expressions: who tries something and gives it up goes on with what was assumed before,
//! and what is known of an expression follows from what is assumed, whenever it was made. Every answer that parameters'
//! values made, be it that an expression is above zero or that it vanishes, stands there with the expression it was about.
//! In the end these are brought down to what must hold of parameters alone.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use rustc_hash::{FxHashMap, FxHashSet};

use super::exprs::Exprs;
use super::fingerprint::mix;
use super::node::{Expr, Function, Node, Symbol};
use super::properties::{Known, Signs};
use super::rational::Rational;

/// Something that must hold of parameters for what was derived from an expression.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Assumption {
    /// An expression of parameters.
    pub expr: Expr,
    /// What holds of it.
    pub holds: Holds,
}

/// What is assumed of a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Holds {
    /// It vanishes.
    Zero,
    /// It does not vanish.
    NotZero,
    /// It is above zero.
    Positive,
    /// It is not below zero.
    NotNegative,
}

/// What is assumed of the expressions of a pool.
#[derive(Debug, Default)]
pub struct Assumptions {
    /// What was divided by without a proof that it does not vanish, with its factors.
    divisors: FxHashSet<Expr>,
    /// What is defined because it is a part of what was divided by.
    defined: FxHashSet<Expr>,
    /// Of each expression what has been decided by the values of parameters.
    decided: Vec<Decided>,
    /// What the divisors tell of other expressions, as far as it was looked for.
    found: Mutex<FxHashMap<Expr, Known>>,
}

impl Clone for Assumptions {
    fn clone(&self) -> Assumptions {
        let Assumptions { divisors, defined, decided, found: _ } = self;
        let (divisors, defined, decided) = (divisors.clone(), defined.clone(), decided.clone());
        Assumptions { divisors, defined, decided, found: Mutex::default() }
    }
}

/// What has been decided of an expression: a set of the answers below.
#[derive(Debug, Default)]
pub(super) struct Decided(AtomicU8);

impl Clone for Decided {
    fn clone(&self) -> Decided {
        Decided(AtomicU8::new(self.0.load(Ordering::Relaxed)))
    }
}

impl Decided {
    pub const NOT_ZERO: u8 = 1;
    pub const POSITIVE: u8 = 2;
    pub const NOT_NEGATIVE: u8 = 4;
    /// It vanishes at the given parameters, and not in general.
    pub const ZERO: u8 = 8;
    /// It has a value.
    pub const TOTAL: u8 = 16;
    /// It is above zero at the given parameters, whatever its signs tell.
    pub const GIVEN_POSITIVE: u8 = 32;
    /// It is not zero at the given parameters, whatever its signs tell.
    pub const GIVEN_NOT_ZERO: u8 = 64;

    fn add(&self, what: u8) {
        if !self.has(what) {
            self.0.fetch_or(what, Ordering::Relaxed);
        }
    }

    fn has(&self, what: u8) -> bool {
        self.0.load(Ordering::Relaxed) & what != 0
    }

    /// The signs that were read out of what is known.
    fn claims(&self) -> impl Iterator<Item = Signs> + use<> {
        let all =
            [(Self::NOT_ZERO, Signs::NOT_ZERO), (Self::POSITIVE, Signs::PLUS), (Self::NOT_NEGATIVE, Signs::NOT_MINUS)];
        let own = self.0.load(Ordering::Relaxed);
        all.into_iter().filter(move |(what, _)| own & what != 0).map(|(_, signs)| signs)
    }
}

impl Assumptions {
    /// Room for the decisions on so many expressions.
    pub(super) fn cover(&mut self, entries: usize) {
        self.decided.resize_with(entries, Decided::default);
    }

    pub(super) fn decide(&self, e: Expr, what: u8) {
        self.decided[e.0 as usize].add(what);
    }

    fn decided(&self, e: Expr) -> &Decided {
        &self.decided[e.0 as usize]
    }

    /// The expressions of which this was decided, parts before wholes.
    fn all_decided(&self, what: u8) -> Vec<Expr> {
        (0..self.decided.len() as u32).map(Expr).filter(|&e| self.decided(e).has(what)).collect()
    }

    pub(super) fn has_divisors(&self) -> bool {
        !self.divisors.is_empty() || !self.defined.is_empty()
    }

    pub(super) fn is_divisor(&self, e: Expr) -> bool {
        self.divisors.contains(&e)
    }

    pub(super) fn is_defined(&self, e: Expr) -> bool {
        self.defined.contains(&e)
    }

    pub(super) fn found(&self) -> MutexGuard<'_, FxHashMap<Expr, Known>> {
        self.found.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Parameters of an expression up to which the weakest signs that it needs are searched for; above, all keep theirs.
const SEARCHED: usize = 6;

/// Divisors with more parts are left to the watch of the run.
const LONGEST_DIVISOR: u32 = 100;

/// The signs that parameters need to have.
type Needed = BTreeMap<Symbol, Signs>;

impl Exprs {
    /// What is assumed at present, to [go on with](Exprs::suppose) once more.
    pub fn assumed(&self) -> Assumptions {
        self.assumptions.clone()
    }

    /// From now on these are the assumptions: those of this pool at an earlier time, or of one that it was made from.
    pub fn suppose(&mut self, assumptions: Assumptions) {
        self.assumptions = assumptions;
        self.assumptions.cover(self.entries.len());
        self.forget_forms();
    }

    /// What is found by something that is given up afterwards: nothing is assumed for its sake.
    pub fn tried<T>(&mut self, attempt: impl FnOnce(&mut Exprs) -> T) -> T {
        let before = self.assumed();
        let found = attempt(self);
        self.suppose(before);
        found
    }

    /// What is found by something that counts if it comes to an end, and else leaves nothing assumed.
    pub fn if_found<T>(&mut self, search: impl FnOnce(&mut Exprs) -> Option<T>) -> Option<T> {
        let before = self.assumed();
        let found = search(self);
        if found.is_none() {
            self.suppose(before);
        }
        found
    }

    /// No divisor that reads more than parameters is assumed any more, but for those that were before: nobody watches the
    /// others. What was decided stays decided.
    pub fn forget_unwatched(&mut self, before: &Assumptions) {
        let mut assumptions = std::mem::take(&mut self.assumptions);
        let varies = |e: Expr| self.depends_on_any(e, &|s| self.facts(s).given.is_none());
        assumptions.divisors.retain(|&e| before.is_divisor(e) || !varies(e));
        assumptions.defined.retain(|&e| before.is_defined(e) || !varies(e));
        assumptions.found().clear();
        self.assumptions = assumptions;
        self.forget_forms();
    }

    /// What was worked out under other assumptions.
    fn forget_forms(&mut self) {
        self.short_forms.forget();
        self.derivatives.clear();
    }

    /// From now on the expression counts as defined and nonzero: it is watched while the program runs. Its factors are
    /// nonzero too.
    pub fn assume_nonzero(&mut self, e: Expr) {
        self.forget_forms();
        self.assume_factors(e);
        self.assumptions.found().clear();
    }

    fn assume_factors(&mut self, e: Expr) {
        self.assume_defined(e);
        let monomial = self.entry(e).monomial;
        let (_, primitive) = self.primitive(monomial);
        for e in [e, monomial, primitive] {
            if !self.entry(e).properties.known.signs.within(Signs::NOT_ZERO) {
                self.assumptions.divisors.insert(e);
            }
        }
        let _ = self.nonzero(e);
        let mut parts = Vec::new();
        match self.node(monomial) {
            Node::Mul(factors) => parts.extend_from_slice(factors),
            Node::Pow(base, _) => parts.push(*base),
            _ => {}
        }
        parts.into_iter().for_each(|part| self.assume_factors(part));
    }

    /// What is finite has finite parts; only what a condition chooses may be undefined.
    fn assume_defined(&mut self, e: Expr) {
        let chosen =
            |x: &Exprs, e: Expr| matches!(x.node(e), Node::Select(..) | Node::Call(Function::Min | Function::Max, _));
        let mut open = vec![e];
        while let Some(e) = open.pop() {
            if !self.entry(e).properties.known.total && !chosen(self, e) && self.assumptions.defined.insert(e) {
                self.node(e).for_each_child(|c| open.push(c));
            }
        }
    }

    /// An expression is taken as zero since it is so at the given parameters.
    pub fn decide_zero(&self, e: Expr) {
        if !self.is_constant(e) {
            self.assumptions.decide(e, Decided::ZERO);
        }
    }

    /// An expression of parameters is taken as above zero since it is so at their values.
    pub fn decide_positive(&self, e: Expr) {
        if !self.positive(e) {
            self.assumptions.decide(e, Decided::GIVEN_POSITIVE);
        }
    }

    /// An expression of parameters is taken as other than zero since it is so at their values.
    pub fn decide_nonzero(&self, e: Expr) {
        if !self.nonzero(e) {
            self.assumptions.decide(e, Decided::GIVEN_NOT_ZERO);
        }
    }

    /// All that has been decided in this pool by the values of parameters that may change, as assumptions on these
    /// parameters alone: signs first, in the order of the parameters, then what vanishes, then what was divided by. What an expression of other
    /// symbols was decided for is asked at an arbitrary point of them.
    pub fn assumptions(&mut self, may_change: &dyn Fn(Symbol) -> bool) -> Vec<Assumption> {
        let zeros = self.zeros(may_change);
        let divisors = self.watched_divisors(may_change);
        let needed = self.needed_signs(may_change);
        let given = self.given_signs(may_change);
        let mut all = Vec::with_capacity(needed.len() + zeros.len());
        for (symbol, signs) in needed {
            let holds = match signs {
                Signs::PLUS => Holds::Positive,
                Signs::NOT_MINUS => Holds::NotNegative,
                Signs::NOT_ZERO => Holds::NotZero,
                _ => continue,
            };
            all.push(Assumption { expr: self.sym(symbol), holds });
        }
        all.extend(given);
        all.extend(zeros.into_iter().map(|expr| Assumption { expr, holds: Holds::Zero }));
        all.extend(divisors.into_iter().map(|expr| Assumption { expr, holds: Holds::NotZero }));
        all
    }

    fn changing(&self, e: Expr, may_change: &dyn Fn(Symbol) -> bool) -> Vec<Symbol> {
        self.symbols_of(e).into_iter().filter(|&s| self.facts(s).given.is_some() && may_change(s)).collect()
    }

    /// What vanishes by the values of parameters, without numbers before it, each once.
    fn zeros(&mut self, may_change: &dyn Fn(Symbol) -> bool) -> Vec<Expr> {
        let mut zeros = Vec::new();
        for e in self.assumptions.all_decided(Decided::ZERO) {
            for e in self.vanishing_factor(e, may_change) {
                let (_, primitive) = self.primitive(e);
                if !zeros.contains(&primitive) && !self.is_constant(primitive) {
                    zeros.push(primitive);
                }
            }
        }
        zeros
    }

    /// What was divided by without a proof that it does not vanish, of parameters alone: what reads states is watched while
    /// the program runs.
    fn watched_divisors(&mut self, may_change: &dyn Fn(Symbol) -> bool) -> Vec<Expr> {
        let of_parameters = |x: &Exprs, e: Expr| x.symbols_of(e).into_iter().all(|s| x.facts(s).given.is_some());
        let part = |x: &Exprs, e: Expr| {
            x.assumptions.is_divisor(e)
                && x.entry(e).size <= LONGEST_DIVISOR
                && !matches!(x.node(e), Node::Mul(_) | Node::Pow(..))
                && of_parameters(x, e)
                && !x.changing(e, may_change).is_empty()
        };
        let noted: Vec<Expr> = (0..self.len() as u32).map(Expr).filter(|&e| part(self, e)).collect();
        let mut divisors = Vec::new();
        for e in noted {
            let (_, primitive) = self.primitive(e);
            let sound = self.given_value(primitive).is_some_and(|v| v.is_finite() && v != 0.0);
            if sound && !divisors.contains(&primitive) {
                divisors.push(primitive);
            }
        }
        divisors
    }

    /// The expression in parameters alone, the other symbols at an arbitrary point.
    fn at_arbitrary_point(&mut self, e: Expr) -> Expr {
        let others = self.symbols_of(e).into_iter().filter(|&s| self.facts(s).given.is_none());
        let point: Vec<(Symbol, Rational)> = others.map(|s| (s, arbitrary(self.label(s)))).collect();
        let point = point.into_iter().map(|(s, value)| (s, self.number(value))).collect();
        self.substitute(e, &point)
    }

    /// The factor for which an expression vanishes, in parameters alone; nothing if none of these may change. Where it
    /// cannot be told, each parameter is to keep its value.
    fn vanishing_factor(&mut self, e: Expr, may_change: &dyn Fn(Symbol) -> bool) -> Vec<Expr> {
        let factor = match self.node(e) {
            Node::Mul(factors) => factors.iter().copied().find(|&f| self.is_zero_given(f)).unwrap_or(e),
            _ => e,
        };
        let factor = match *self.node(factor) {
            Node::Pow(base, _) if self.is_zero_given(base) => base,
            _ => factor,
        };
        let parameters = self.changing(factor, may_change);
        if parameters.is_empty() {
            return Vec::new();
        }
        let at_point = self.at_arbitrary_point(factor);
        if self.given_value(at_point).is_some_and(f64::is_finite) {
            return vec![at_point];
        }
        parameters.into_iter().filter_map(|s| self.kept(s)).collect()
    }

    /// What vanishes as long as a parameter keeps its value.
    fn kept(&mut self, parameter: Symbol) -> Option<Expr> {
        let symbol = self.sym(parameter);
        let value = self.given_value(symbol).filter(|v| v.is_finite())?;
        let value = self.float(value);
        Some(self.sub(symbol, value))
    }

    /// The signs of parameters that all claims rest on, as weak as they may be.
    fn needed_signs(&self, may_change: &dyn Fn(Symbol) -> bool) -> Needed {
        let mut needed = Needed::new();
        let mut compound = Vec::new();
        for (e, claim) in self.claimed() {
            match self.node(e) {
                Node::Symbol(s) if may_change(*s) && self.facts(*s).given.is_some() => need(&mut needed, *s, claim),
                Node::Symbol(_) => {}
                _ => compound.push((e, claim)),
            }
        }
        // With what single parameters need most claims hold: these are told in one go.
        let mut signs = self.signs_by(&(0..self.len() as u32).map(Expr).collect::<Vec<_>>(), &needed, may_change);
        for (e, claim) in compound {
            if signs[&e].within(claim) {
                continue;
            }
            let below = self.below(&[e], &|_| true);
            signs.extend(self.signs_by(&below, &needed, may_change));
            if !signs[&e].within(claim) {
                self.raise(e, &below, claim, &mut needed, may_change);
                signs.extend(self.signs_by(&below, &needed, may_change));
            }
        }
        needed
    }

    /// All that has been said of signs, parts before wholes: what was asked, and what expressions that count as defined rest on.
    fn claimed(&self) -> Vec<(Expr, Signs)> {
        let asked = (0..self.len() as u32).map(Expr);
        let mut all: Vec<(Expr, Signs)> =
            asked.flat_map(|e| self.assumptions.decided(e).claims().map(move |claim| (e, claim))).collect();
        let defined = self.assumptions.all_decided(Decided::TOTAL);
        let rests_on = |&e: &Expr| {
            let (part, signs) = self.needed_for_a_value(self.node(e))?;
            (!self.assumptions.is_defined(e)).then_some((part, signs))
        };
        all.extend(self.below(&defined, &|e| !self.is_constant(e)).iter().filter_map(rests_on));
        all.sort_by_key(|claim| claim.0);
        all
    }

    /// What values alone told of signs, in parameters alone.
    fn given_signs(&self, may_change: &dyn Fn(Symbol) -> bool) -> Vec<Assumption> {
        let all = [(Decided::GIVEN_POSITIVE, Holds::Positive), (Decided::GIVEN_NOT_ZERO, Holds::NotZero)];
        let of =
            |(what, holds)| self.assumptions.all_decided(what).into_iter().map(move |expr| Assumption { expr, holds });
        all.into_iter().flat_map(of).filter(|a| !self.changing(a.expr, may_change).is_empty()).collect()
    }

    /// Asks as little as possible more of the parameters of an expression, so that a claim on its sign holds.
    fn raise(&self, e: Expr, below: &[Expr], claim: Signs, needed: &mut Needed, may_change: &dyn Fn(Symbol) -> bool) {
        let parameters = self.changing(e, may_change);
        let mut tried = needed.clone();
        parameters.iter().for_each(|&s| need(&mut tried, s, self.facts_of(s)));
        if !self.signs_by(below, &tried, may_change)[&e].within(claim) {
            return; // what is watched makes it true, or what is known of other symbols
        }
        for &s in parameters.iter().filter(|_| parameters.len() <= SEARCHED) {
            let full = tried[&s];
            for weaker in [Signs::ANY, Signs::NOT_MINUS, Signs::NOT_ZERO] {
                let least = needed.get(&s).copied().unwrap_or(Signs::ANY);
                tried.insert(s, least.and(weaker));
                if self.signs_by(below, &tried, may_change)[&e].within(claim) {
                    break;
                }
                tried.insert(s, full);
            }
        }
        *needed = tried;
    }

    fn facts_of(&self, s: Symbol) -> Signs {
        match self.facts(s) {
            f if f.positive => Signs::PLUS,
            f if f.nonzero => Signs::NOT_ZERO,
            _ => Signs::ANY,
        }
    }

    /// The signs of expressions in the order of their ids, if of parameters that may change no more is known than this.
    fn signs_by(&self, order: &[Expr], needed: &Needed, may_change: &dyn Fn(Symbol) -> bool) -> FxHashMap<Expr, Signs> {
        let mut known: FxHashMap<Expr, Signs> = FxHashMap::default();
        for &e in order {
            let entry = self.entry(e);
            let mut signs = match &entry.node {
                Node::Symbol(s) if self.facts(*s).given.is_some() && may_change(*s) => {
                    needed.get(s).copied().unwrap_or(Signs::ANY)
                }
                node => self.signs_of(node, &|c| known[&c]),
            };
            if self.assumptions.is_divisor(e) {
                signs = signs.and(Signs::NOT_ZERO);
            }
            known.insert(e, signs);
        }
        known
    }
}

fn need(needed: &mut Needed, s: Symbol, signs: Signs) {
    let known = needed.entry(s).or_insert(Signs::ANY);
    *known = known.and(signs);
}

/// A number between 0.3 and 1.7, the same for the same name.
fn arbitrary(name: &str) -> Rational {
    let seed = name.bytes().fold(0x9a7, |h, b| mix(h, u64::from(b)));
    Rational::new(300_000 + ((seed >> 20) % 1_400_000) as i64, 1_000_003)
}
