//! What is taken for granted of expressions, and what was decided by the values that parameters have.
//!
//! Both are a value apart from the expressions: who tries something and gives it up goes on with what was assumed before,
//! and what is known of an expression follows from what is assumed, whenever it was made. Every answer that parameters'
//! values made, be it that an expression is above zero or that it vanishes, stands there with the expression it was about.
//! In the end these are brought down to what must hold of parameters alone (`needed.rs`).

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use rustc_hash::{FxHashMap, FxHashSet};

use super::exprs::Exprs;
use super::listed::ListedAssumptions;
use super::node::{Expr, Function, Node};
use super::properties::{Known, Signs};

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
    decided: Vec<Eight>,
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
#[derive(Debug, Clone, Copy)]
pub(super) struct Decided(u8);

/// What has been decided of eight expressions in a row: who tries something takes all of it along, again and again.
#[derive(Debug, Default)]
struct Eight(AtomicU64);

impl Clone for Eight {
    fn clone(&self) -> Eight {
        Eight(AtomicU64::new(self.0.load(Ordering::Relaxed)))
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

    pub(super) fn has(self, what: u8) -> bool {
        self.0 & what != 0
    }

    /// The signs that were read out of what is known.
    pub(super) fn claims(self) -> impl Iterator<Item = Signs> + use<> {
        let all =
            [(Self::NOT_ZERO, Signs::NOT_ZERO), (Self::POSITIVE, Signs::PLUS), (Self::NOT_NEGATIVE, Signs::NOT_MINUS)];
        all.into_iter().filter(move |(what, _)| self.has(*what)).map(|(_, signs)| signs)
    }
}

impl Assumptions {
    /// Room for the decisions on so many expressions.
    pub(super) fn cover(&mut self, entries: usize) {
        self.decided.resize_with(entries.div_ceil(8), Eight::default);
    }

    pub(super) fn decide(&self, e: Expr, what: u8) {
        if !self.decided(e).has(what) {
            self.decided[e.0 as usize / 8].0.fetch_or(u64::from(what) << (8 * (e.0 % 8)), Ordering::Relaxed);
        }
    }

    pub(super) fn decided(&self, e: Expr) -> Decided {
        let eight = self.decided[e.0 as usize / 8].0.load(Ordering::Relaxed);
        Decided((eight >> (8 * (e.0 % 8))) as u8)
    }

    /// The expressions of which this was decided, parts before wholes.
    pub(super) fn all_decided(&self, what: u8) -> Vec<Expr> {
        (0..8 * self.decided.len() as u32).map(Expr).filter(|&e| self.decided(e).has(what)).collect()
    }

    /// Takes what is listed for assumed.
    pub(super) fn list(&mut self, listed: &ListedAssumptions) {
        self.divisors.extend(&listed.divisors);
        self.defined.extend(&listed.defined);
        listed.decided.iter().for_each(|&(e, what)| self.decide(e, what));
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

impl Exprs {
    /// What was assumed, as a list.
    pub fn listed_assumptions(&self) -> ListedAssumptions {
        let sorted = |set: &FxHashSet<Expr>| {
            let mut all: Vec<Expr> = set.iter().copied().collect();
            all.sort_unstable();
            all
        };
        let decided = (0..self.len() as u32).map(|e| (Expr(e), self.assumptions.decided(Expr(e)).0));
        ListedAssumptions {
            divisors: sorted(&self.assumptions.divisors),
            defined: sorted(&self.assumptions.defined),
            decided: decided.filter(|(_, what)| *what != 0).collect(),
        }
    }

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
}
