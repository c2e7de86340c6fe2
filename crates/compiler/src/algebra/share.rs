//! Parts that several expressions have in common.

use super::exprs::Exprs;
use super::node::{Expr, Node, Symbol};
use rustc_hash::FxHashMap;
use std::collections::BTreeMap;

/// Parts that are shorter than this in print get no name: `sin(a - b)`.
const SHORTEST: u64 = 12;
/// But for those that stand so often, and are no shorter than this: `a^2 + b^2 + c^2`.
const OFTEN: u64 = 6;
const SHORTEST_OFTEN: u64 = 8;
/// What names have to save in print, that of their definition taken off.
const SAVED: u64 = 20;

/// Expressions with names in place of what they share.
#[derive(Debug, Clone)]
pub struct Shared {
    /// The expressions, in the order in which they were given.
    pub roots: Vec<Expr>,
    /// What the names stand for; each reads only names before it.
    pub definitions: Vec<(Symbol, Expr)>,
}

impl Exprs {
    /// How often each symbol stands in the expressions, those of shared parts once.
    pub fn symbol_uses(&self, roots: &[Expr]) -> BTreeMap<Symbol, u32> {
        let mut uses = BTreeMap::new();
        let mut note = |e: Expr| {
            if let Node::Symbol(symbol) = *self.node(e) {
                *uses.entry(symbol).or_insert(0) += 1;
            }
        };
        roots.iter().for_each(|&root| note(root));
        for part in self.below(roots, &|_| true) {
            self.node(part).for_each_child(&mut note);
        }
        uses
    }

    /// The expressions with names for the parts that stand in them more than once, where that saves print. `name` gives
    /// the next name, `short` the form in which a part is printed.
    pub fn share(
        &mut self,
        roots: &[Expr],
        name: &mut dyn FnMut(&mut Exprs) -> Symbol,
        short: &mut dyn FnMut(&mut Exprs, Expr) -> Expr,
    ) -> Shared {
        let uses = self.part_uses(roots);
        let mut new: FxHashMap<Expr, Expr> = FxHashMap::default();
        let mut named: FxHashMap<Expr, Expr> = FxHashMap::default();
        let mut definitions = Vec::new();
        for part in self.below(roots, &|_| true) {
            let rebuilt = self.rebuild(part, &|c| new[&c]);
            let (number, own) = self.coefficient(part);
            let times = uses.get(&own).copied().unwrap_or(0);
            if !self.may_have_name(own) || times < 2 || number.is_zero() || self.is_number(rebuilt).is_some() {
                new.insert(part, rebuilt);
                continue;
            }
            let value = match named.get(&own) {
                Some(&known) => known,
                None => {
                    let unit = number.recip().map_or(rebuilt, |inverse| self.scale(&inverse, rebuilt));
                    // What is kept whole stands in print as its part.
                    let part = if let Node::Whole(part) = *self.node(unit) { part } else { unit };
                    let shown = short(self, part);
                    let value = if self.saves(shown, times) {
                        let symbol = name(self);
                        definitions.push((symbol, shown));
                        self.sym(symbol)
                    } else {
                        unit
                    };
                    named.insert(own, value);
                    value
                }
            };
            let value = self.scale(&number, value);
            new.insert(part, value);
        }
        Shared { roots: roots.iter().map(|r| new[r]).collect(), definitions }
    }

    /// How often each part stands in other parts, numbers before products left out; a power counts for its base.
    fn part_uses(&self, roots: &[Expr]) -> FxHashMap<Expr, u32> {
        let mut uses: FxHashMap<Expr, u32> = FxHashMap::default();
        let mut note = |e: Expr| {
            let own = self.coefficient(e).1;
            *uses.entry(self.base_of_power(own).unwrap_or(own)).or_insert(0) += 1;
        };
        roots.iter().for_each(|&root| note(root));
        for part in self.below(roots, &|_| true) {
            if self.base_of_power(part).is_none() {
                self.node(part).for_each_child(&mut note);
            }
        }
        uses
    }

    /// The base of a power with a number for its exponent.
    fn base_of_power(&self, e: Expr) -> Option<Expr> {
        match *self.node(e) {
            Node::Pow(base, n) => self.is_number(n).map(|_| base),
            _ => None,
        }
    }

    /// Sums, products and functions may, and what is kept whole; of powers their bases.
    fn may_have_name(&self, e: Expr) -> bool {
        use Node::{Add, Call, Mul, Pow, Whole};
        let compound = matches!(self.node(e), Add(_) | Mul(_) | Pow(..) | Call(..) | Whole(_));
        compound && self.base_of_power(e).is_none()
    }

    /// Whether a name for what stands so often saves print.
    fn saves(&self, e: Expr, times: u32) -> bool {
        let (length, times) = (self.printed_length(e), u64::from(times));
        let shortest = if times >= OFTEN { SHORTEST_OFTEN } else { SHORTEST };
        length >= shortest && (times - 1).saturating_mul(length) > 2 * times + 3 + SAVED
    }
}
