//! Which sides are passed without an event: those of roots at 0, as in `sign(a) sqrt(abs(a))`, and of their inverses, `a abs(a)`.
//!
//! Such a law is continuous, but infinitely steep at 0. Where states come to rest there, as the levels of two tanks do, each
//! side that is held leads to the other one, over and over.

use crate::algebra::{Comparison, Expr, Exprs, Function, Node};
use rustc_hash::{FxHashMap, FxHashSet};
use smallvec::SmallVec;

/// Functions and comparisons whose sides are passed without an event.
#[derive(Debug, Default)]
pub(super) struct FreeSides {
    /// Those that nothing reads but roots which are continuous where these change their side: `abs(a)` under a root, `sign(a)`
    /// beside one of `abs(a)`, `a > 0` where it chooses between roots of `a` and `-a`.
    pub steep: FxHashSet<Expr>,
    /// Those that squares with a sign read, `a abs(a)` and `sign(a) a^2`, which are smooth.
    pub smooth: FxHashSet<Expr>,
}

impl FreeSides {
    pub fn contains(&self, e: Expr) -> bool {
        self.steep.contains(&e) || self.smooth.contains(&e)
    }
}

/// The sides that are passed without an event. Where one side of a law is 0, as that of `max(a, 0)`, nothing but an event tells
/// what comes on the other. `exprs` is all that is evaluated, parts and wholes, `wholes` what is read by name;
/// `varies` tells what more than parameters determine.
pub(super) fn free_sides(x: &Exprs, exprs: &[Expr], wholes: &[Expr], varies: &dyn Fn(Expr) -> bool) -> FreeSides {
    let roots = Roots { x, varies };
    let sides: FxHashSet<Expr> = exprs.iter().copied().filter(|&e| roots.is_side(e)).collect();
    if sides.is_empty() {
        return FreeSides::default();
    }
    let wholes: FxHashSet<Expr> = wholes.iter().copied().collect();
    let mut readers: FxHashMap<Expr, Vec<Expr>> = FxHashMap::default();
    for &e in exprs {
        x.node(e).for_each_child(|part| {
            if sides.contains(&part) || matches!(x.node(part), Node::Mul(_)) {
                readers.entry(part).or_default().push(e);
            }
        });
    }
    let readers_of = |e: Expr| readers.get(&e).map_or(&[][..], Vec::as_slice);
    // What is read by name may be read by anybody.
    let all_read = |e: Expr, fits: &dyn Fn(Expr) -> bool| {
        !wholes.contains(&e) && !readers_of(e).is_empty() && readers_of(e).iter().all(|&reader| fits(reader))
    };
    let is_root_of = |e: Expr| move |reader: Expr| roots.under_root(reader) == Some(e);
    let leads_to_roots = |e: Expr| {
        let product = |reader: Expr| matches!(x.node(reader), Node::Mul(_)) && all_read(reader, &is_root_of(reader));
        move |reader: Expr| is_root_of(e)(reader) || product(reader)
    };
    let mut free = FreeSides::default();
    for e in sides {
        let steep = match x.node(e) {
            Node::Call(Function::Sign, _) => all_read(e, &|reader| roots.has_root_beside(reader, e)),
            Node::Compare(..) => all_read(e, &|reader| roots.chooses_between_roots(reader, e)),
            _ => all_read(e, &leads_to_roots(e)),
        };
        let smooth = match x.node(e) {
            Node::Call(Function::Sign, _) => {
                all_read(e, &|reader| roots.has_root_beside(reader, e) || roots.is_square(reader, e))
            }
            Node::Compare(..) => false,
            _ => all_read(e, &|reader| leads_to_roots(e)(reader) || roots.is_square(reader, e)),
        };
        if steep {
            free.steep.insert(e);
        } else if smooth {
            free.smooth.insert(e);
        }
    }
    free
}

#[derive(Clone, Copy)]
struct Roots<'a> {
    x: &'a Exprs,
    varies: &'a dyn Fn(Expr) -> bool,
}

impl Roots<'_> {
    fn is_side(&self, e: Expr) -> bool {
        match self.x.node(e) {
            Node::Call(Function::Abs | Function::Sign, a) => (self.varies)(a[0]),
            Node::Compare(..) => self.compared(e).is_some_and(self.varies),
            _ => false,
        }
    }

    fn is_zero(&self, e: Expr) -> bool {
        self.x.is_number(e).is_some_and(|n| n.is_zero())
    }

    /// What is compared with 0, to be greater or less.
    fn compared(&self, e: Expr) -> Option<Expr> {
        match self.x.node(e) {
            Node::Compare(Comparison::Eq | Comparison::Ne, ..) => None,
            Node::Compare(_, a, b) if self.is_zero(*b) => Some(*a),
            Node::Compare(_, a, b) if self.is_zero(*a) => Some(*b),
            _ => None,
        }
    }

    /// What a root, of whatever order, is taken of.
    fn under_root(&self, e: Expr) -> Option<Expr> {
        let Node::Pow(base, exponent) = self.x.node(e) else { return None };
        self.x.is_number(*exponent).is_some_and(|p| p.signum() > 0 && p.to_f64() < 1.0).then_some(*base)
    }

    fn factors(&self, e: Expr) -> SmallVec<[Expr; 4]> {
        match self.x.node(e) {
            Node::Mul(factors) => factors.iter().copied().collect(),
            _ => SmallVec::from_elem(e, 1),
        }
    }

    /// The factors that vary, without the magnitude that is taken of them: those of `2 a`, `-a` and `abs(a)` are the same.
    fn core(&self, e: Expr) -> SmallVec<[Expr; 4]> {
        let mut all = SmallVec::new();
        for factor in self.factors(e) {
            match self.x.node(factor) {
                Node::Call(Function::Abs, a) => all.extend(self.core(a[0])),
                _ if (self.varies)(factor) => all.push(factor),
                _ => {}
            }
        }
        all.sort_unstable();
        all
    }

    /// Whether a root of what has this core is a factor.
    fn has_root(&self, e: Expr, core: &[Expr]) -> bool {
        self.factors(e).iter().any(|&factor| self.under_root(factor).is_some_and(|base| self.core(base)[..] == *core))
    }

    fn has_root_beside(&self, product: Expr, sign: Expr) -> bool {
        let Node::Call(Function::Sign, a) = self.x.node(sign) else { return false };
        matches!(self.x.node(product), Node::Mul(_)) && self.has_root(product, &self.core(a[0]))
    }

    /// Whether a product has `abs(a)` and `a` for factors, or `sign(a)` and a square of `a`: a square with a sign, which is smooth.
    fn is_square(&self, product: Expr, side: Expr) -> bool {
        let Node::Call(f @ (Function::Abs | Function::Sign), a) = self.x.node(side) else { return false };
        let least = if *f == Function::Abs { 1 } else { 2 };
        let order = |factor: Expr| match self.x.node(factor) {
            Node::Pow(base, n) => (*base, self.x.is_number(*n).and_then(|n| n.as_integer()).unwrap_or(0)),
            _ => (factor, 1),
        };
        let factors = self.factors(product);
        let has = |part: &Expr| {
            factors.iter().any(|&factor| matches!(order(factor), (base, n) if base == *part && n >= least))
        };
        matches!(self.x.node(product), Node::Mul(_)) && self.core(a[0]).iter().all(has)
    }

    fn chooses_between_roots(&self, choice: Expr, comparison: Expr) -> bool {
        match (self.x.node(choice), self.compared(comparison)) {
            (Node::Select(condition, then, otherwise), Some(a)) if *condition == comparison => {
                let core = self.core(a);
                [then, otherwise].into_iter().all(|&branch| self.has_root(branch, &core))
            }
            _ => false,
        }
    }
}
