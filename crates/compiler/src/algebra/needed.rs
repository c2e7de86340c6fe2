//! What must hold of parameters for what was decided of expressions.

use std::collections::BTreeMap;

use rustc_hash::FxHashMap;

use super::assumptions::{Assumption, Decided, Holds};
use super::exprs::Exprs;
use super::fingerprint::mix;
use super::node::{Expr, Node, Symbol};
use super::properties::Signs;
use super::rational::Rational;

/// Parameters of an expression up to which the weakest signs that it needs are searched for; above, all keep theirs.
const SEARCHED: usize = 6;

/// Divisors with more parts are left to the watch of the run.
const LONGEST_DIVISOR: u32 = 100;

/// The signs that parameters need to have.
type Needed = BTreeMap<Symbol, Signs>;

impl Exprs {
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
        if compound.is_empty() {
            return needed;
        }
        // With what single parameters need most claims hold: these are told in one go.
        let mut signs = self.all_signs_by(&needed, may_change);
        for (e, claim) in compound {
            if signs[e.0 as usize].within(claim) {
                continue;
            }
            let below = self.below(&[e], &|_| true);
            let mut look = |needed: &Needed| {
                let found = self.signs_by(&below, needed, may_change);
                found.into_iter().for_each(|(part, sign)| signs[part.0 as usize] = sign);
                signs[e.0 as usize]
            };
            if !look(&needed).within(claim) {
                self.raise(e, &below, claim, &mut needed, may_change);
                look(&needed);
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
            let signs = self.sign_by(e, &|c| known[&c], needed, may_change);
            known.insert(e, signs);
        }
        known
    }

    /// The same for all expressions, by their numbers.
    fn all_signs_by(&self, needed: &Needed, may_change: &dyn Fn(Symbol) -> bool) -> Vec<Signs> {
        let mut known: Vec<Signs> = Vec::with_capacity(self.len());
        for e in (0..self.len() as u32).map(Expr) {
            let signs = self.sign_by(e, &|c| known[c.0 as usize], needed, may_change);
            known.push(signs);
        }
        known
    }

    fn sign_by(
        &self,
        e: Expr,
        known: &dyn Fn(Expr) -> Signs,
        needed: &Needed,
        may_change: &dyn Fn(Symbol) -> bool,
    ) -> Signs {
        let signs = match &self.entry(e).node {
            Node::Symbol(s) if self.facts(*s).given.is_some() && may_change(*s) => {
                needed.get(s).copied().unwrap_or(Signs::ANY)
            }
            node => self.signs_of(node, known),
        };
        if self.assumptions.is_divisor(e) { signs.and(Signs::NOT_ZERO) } else { signs }
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
