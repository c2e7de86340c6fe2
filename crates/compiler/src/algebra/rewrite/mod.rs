//! Expressions in their shortest form. There is one search, and two lengths by which a form is the shortest: as it is
//! evaluated, in programs, and in print, for people. The value and where it has one never change.

mod expanded;
mod factor;
mod flat;
mod least_length;
mod length;
mod nested;
mod trigonometric;

use super::exprs::Exprs;
use super::node::{Expr, Node};
use rustc_hash::{FxHashMap, FxHashSet};
use std::collections::BTreeSet;

/// Expressions that are longer than this are left as they are; their parts are not.
const LONGEST: u64 = 600;
/// Coefficients that are written longer than this are not put into others.
const BOUND: u64 = 80;

/// By what forms are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Length {
    /// Operands and operations, each time that they are written: what programs are made of.
    Evaluated,
    /// In print.
    Printed,
}

/// What the search for short forms remembers.
#[derive(Clone)]
pub(super) struct ShortForms {
    /// The shortest forms that are known, of expressions whose parts are short.
    known: FxHashMap<(Length, Expr), Expr>,
    /// The shortest forms to evaluate, of whatever was a part of what one was asked for.
    of_parts: FxHashMap<Expr, Expr>,
    /// Terms that may still be formed.
    left: u64,
}

impl Default for ShortForms {
    fn default() -> Self {
        ShortForms { known: FxHashMap::default(), of_parts: FxHashMap::default(), left: u64::MAX }
    }
}

impl ShortForms {
    /// Something new is known of expressions: other forms may hold now.
    pub fn forget(&mut self) {
        self.known.clear();
        self.of_parts.clear();
    }
}

impl Exprs {
    /// The shortest form to evaluate: multiplied out, common factors taken out, over one denominator, with
    /// `sin² + cos² = 1` and the sums of angles used. The value and where it has one never change: `q/q` stays unless
    /// `q` is known to be nonzero.
    pub fn simplify(&mut self, e: Expr) -> Expr {
        self.simplify_all(&[e])[0]
    }

    /// The shortest form to evaluate, as a [`whole`](Exprs::whole) where that is long: coefficients that are put into others
    /// would hold all before them.
    pub fn bounded(&mut self, e: Expr) -> Expr {
        let short = self.simplify(e);
        if self.written_length(short) > BOUND { self.whole(short) } else { short }
    }

    /// The expressions, each in its shortest form to evaluate: from the leaves to the roots, so that the parts of what is
    /// looked at are short already. What they share, and what was a part of others before, is looked at once.
    pub fn simplify_all(&mut self, roots: &[Expr]) -> Vec<Expr> {
        let mut of_parts = std::mem::take(&mut self.short_forms.of_parts);
        let order = self.around_wholes(roots, &|part| !of_parts.contains_key(&part));
        self.spend(order.len() as u64);
        for part in order {
            let short = match self.node(part) {
                Node::Whole(_) => part,
                _ => {
                    let rebuilt = self.rebuild(part, &|c| of_parts[&c]);
                    self.shortest_form(rebuilt, Length::Evaluated)
                }
            };
            of_parts.insert(part, short);
        }
        let short = roots.iter().map(|root| of_parts[root]).collect();
        if !self.search_is_over() {
            self.short_forms.of_parts = of_parts;
        }
        short
    }

    /// The expression as a textbook prints it: the shortest of itself, of all its terms over one denominator, and of
    /// the terms with equal denominators taken together, with common factors and squares of sums in the numerators. The
    /// value and where it has one never change.
    ///
    /// ```
    /// use halfarrow_compiler::algebra::{Exprs, Facts, PlainNames, ascii};
    /// let mut x = Exprs::default();
    /// let [a, b] = ["R1", "R2"].map(|name| x.symbol(name, Facts { positive: true, ..Facts::default() }));
    /// let [a, b] = [a, b].map(|s| x.sym(s));
    /// let (p, q) = (x.recip(a), x.recip(b));
    /// let sum = x.add(&[p, q]);
    /// let parallel = x.recip(sum);
    /// let e = x.textbook(parallel);
    /// assert_eq!(ascii(&x, e, &PlainNames(&x)), "R1*R2/(R1 + R2)");
    /// ```
    pub fn textbook(&mut self, e: Expr) -> Expr {
        self.in_print(e)
    }

    /// The search for one that is printed: a sum, product or power is read as a whole, with all the sums, products and powers
    /// in it.
    fn in_print(&mut self, root: Expr) -> Expr {
        let order = self.around_wholes(&[root], &|_| true);
        self.spend(order.len() as u64);
        let mut sought = FxHashSet::from_iter([root]);
        for &part in order.iter().filter(|&&part| !self.is_arithmetic(part)) {
            self.node(part).for_each_child(|c| {
                sought.insert(c);
            });
        }
        let mut new: FxHashMap<Expr, Expr> = FxHashMap::default();
        for part in order {
            if matches!(self.node(part), Node::Whole(_)) {
                new.insert(part, part);
                continue;
            }
            let rebuilt = self.rebuild(part, &|c| new[&c]);
            let short = if sought.contains(&part) { self.shortest_form(rebuilt, Length::Printed) } else { rebuilt };
            new.insert(part, short);
        }
        new[&root]
    }

    fn is_arithmetic(&self, e: Expr) -> bool {
        matches!(self.node(e), Node::Add(_) | Node::Mul(_) | Node::Pow(..))
    }

    /// The shortest form of one part; the known one where there is one, the part itself where the search is over.
    fn shortest_form(&mut self, e: Expr, by: Length) -> Expr {
        if !self.may_be_shorter(e, by) {
            return e;
        }
        if let Some(&known) = self.short_forms.known.get(&(by, e)) {
            return known;
        }
        if self.search_is_over() {
            return e;
        }
        let mut work = u64::from(self.entry(e).size);
        let forms = self.forms(e, by, &mut work);
        let short = self.shortest_of(e, forms, by);
        self.spend(work);
        if !self.search_is_over() {
            self.short_forms.known.insert((by, e), short);
        }
        short
    }

    fn may_be_shorter(&self, e: Expr, by: Length) -> bool {
        let other_forms = match by {
            Length::Evaluated => self.has_other_forms(e) && u64::from(self.entry(e).size) <= LONGEST,
            Length::Printed => self.is_arithmetic(e),
        };
        other_forms && self.length(e, by) <= LONGEST
    }

    /// The forms among which the shortest is. Where all parts are short the fractions in a part are told by its terms; print
    /// looks through fractions within fractions, and for what people expect to see together. `work` counts the terms that
    /// were formed.
    fn forms(&mut self, e: Expr, by: Length, work: &mut u64) -> Vec<Expr> {
        let mut forms = Vec::new();
        match by {
            Length::Evaluated => {
                self.expanded_forms(e, &mut forms, work);
                forms.extend(self.over_one_denominator(e, work));
                forms.extend(self.turned_fraction(e, work));
            }
            Length::Printed => {
                forms.push(self.by_denominators(e, work));
                for open in [true, false] {
                    forms.extend(self.over_one(e, open, work));
                }
            }
        }
        forms
    }

    /// The shortest of an expression and its other forms, the first among equals.
    fn shortest_of(&self, e: Expr, forms: Vec<Expr>, by: Length) -> Expr {
        std::iter::once(e).chain(forms).min_by_key(|form| self.length(*form, by)).unwrap_or(e)
    }

    fn length(&self, e: Expr, by: Length) -> u64 {
        match by {
            Length::Evaluated => self.written_length(e),
            Length::Printed => self.printed_length(e),
        }
    }

    /// Without terms `0 f` in which `f` reads parameters only and has a value at the given ones.
    pub fn without_settled_terms(&mut self, e: Expr) -> Expr {
        self.without_zero_terms(e, &|x, f| x.given_value(f).is_some_and(f64::is_finite))
    }

    /// The same, and without those in which `f` has a value wherever what is left has one.
    pub fn without_idle_terms(&mut self, e: Expr) -> Expr {
        let e = self.without_settled_terms(e);
        let left = self.without_zero_terms(e, &|_, _| true);
        if left == e {
            return e;
        }
        let needs = self.needs(left);
        self.without_zero_terms(e, &|x, f| x.needs(f).is_subset(&needs))
    }

    /// Without those terms `0 f` whose `f` may go.
    fn without_zero_terms(&mut self, e: Expr, may_go: &dyn Fn(&Exprs, Expr) -> bool) -> Expr {
        let order = self.below(&[e], &|_| true);
        let vanishes = |x: &Exprs, e: Expr| matches!(x.node(e), Node::Mul(_)) && x.coefficient(e).0.is_zero();
        if !order.iter().any(|&part| vanishes(self, part)) {
            return e;
        }
        let mut new: FxHashMap<Expr, Expr> = FxHashMap::default();
        for part in order {
            let goes = vanishes(self, part) && may_go(self, self.coefficient(part).1);
            let value = if goes { super::ZERO } else { self.rebuild(part, &|c| new[&c]) };
            new.insert(part, value);
        }
        new[&e]
    }

    /// What an expression needs to have a value: what is divided by, and other parts that have none everywhere.
    fn needs(&self, e: Expr) -> BTreeSet<Expr> {
        let need = |&part: &Expr| match *self.node(part) {
            Node::Pow(base, n) if self.is_number(n).is_some_and(|n| n.is_integer()) => {
                (!self.total(part)).then_some(base)
            }
            _ => (!self.total(part)).then_some(part),
        };
        // A sum or product has a value where its parts do.
        let own = |part: &Expr| !matches!(self.node(*part), Node::Add(_) | Node::Mul(_));
        self.below(&[e], &|_| true).iter().filter(|part| own(part)).filter_map(need).collect()
    }

    /// Bounds the search for short forms from now on: after so many terms have been formed, what [`Exprs::simplify`]
    /// and [`Exprs::textbook`] are given stays as it is. The same expressions always take the same number of terms, on
    /// every machine; about two million take a second.
    pub fn bound_search(&mut self, terms: u64) {
        self.short_forms.left = terms;
    }

    /// Whether the bound of [`Exprs::bound_search`] has been met.
    pub fn search_is_over(&self) -> bool {
        self.short_forms.left == 0
    }

    /// Terms that may still be formed before [`Exprs::search_is_over`].
    pub fn search_left(&self) -> u64 {
        self.short_forms.left
    }

    /// So many terms have been formed.
    pub(super) fn spend(&mut self, terms: u64) {
        if self.short_forms.left != u64::MAX {
            self.short_forms.left = self.short_forms.left.saturating_sub(terms);
        }
    }
}
