//! Short forms that are known already, and how much work may still go into the search for others.

use super::exprs::Exprs;
use super::node::Expr;
use rustc_hash::FxHashMap;

/// What the search for short forms remembers.
#[derive(Clone)]
pub(super) struct ShortForms {
    /// Expressions with their shortest forms by factors and terms.
    factored: FxHashMap<Expr, Expr>,
    /// Expressions with their shortest forms over one denominator.
    over_one: FxHashMap<Expr, Expr>,
    /// Terms that may still be formed.
    left: u64,
}

/// Ways of being short.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Way {
    Factored,
    OverOne,
}

impl Default for ShortForms {
    fn default() -> Self {
        ShortForms { factored: FxHashMap::default(), over_one: FxHashMap::default(), left: u64::MAX }
    }
}

impl ShortForms {
    fn of(&mut self, way: Way) -> &mut FxHashMap<Expr, Expr> {
        match way {
            Way::Factored => &mut self.factored,
            Way::OverOne => &mut self.over_one,
        }
    }

    /// Something new is known of expressions: other forms may hold now.
    pub fn forget(&mut self) {
        self.factored.clear();
        self.over_one.clear();
    }
}

impl Exprs {
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

    /// The short form by `search`, which also tells the terms that it took; the known one where there is one, the
    /// expression itself where the search is over.
    pub(super) fn short_form(&mut self, e: Expr, way: Way, search: impl FnOnce(&mut Self) -> (Expr, u64)) -> Expr {
        if let Some(&known) = self.short_forms.of(way).get(&e) {
            return known;
        }
        if self.search_is_over() {
            return e;
        }
        let (short, work) = search(self);
        self.spend(work);
        if !self.search_is_over() {
            self.short_forms.of(way).insert(e, short);
        }
        short
    }

    /// So many terms have been formed.
    pub(super) fn spend(&mut self, terms: u64) {
        if self.short_forms.left != u64::MAX {
            self.short_forms.left = self.short_forms.left.saturating_sub(terms);
        }
    }
}
