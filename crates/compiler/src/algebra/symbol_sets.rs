//! Which symbols an expression reads: small sets, each held once.

use super::exprs::Exprs;
use super::node::{Expr, Node, Symbol};
use rustc_hash::{FxHashMap, FxHashSet};
use std::collections::BTreeSet;
use std::sync::Arc;

/// A set of symbols.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct SetId(u32);

/// Larger sets are not kept but found by walking the expression.
const LARGEST: usize = 48;
const EMPTY: SetId = SetId(0);
const LARGE: SetId = SetId(1);

#[derive(Clone)]
pub(super) struct SymbolSets {
    sets: Vec<Arc<[Symbol]>>,
    ids: FxHashMap<Arc<[Symbol]>, SetId>,
    unions: FxHashMap<(SetId, SetId), SetId>,
}

impl Default for SymbolSets {
    fn default() -> Self {
        let none: Arc<[Symbol]> = Arc::from([]);
        SymbolSets {
            sets: vec![none.clone(), none.clone()],
            ids: FxHashMap::from_iter([(none, EMPTY)]),
            unions: FxHashMap::default(),
        }
    }
}

impl SymbolSets {
    fn get(&self, id: SetId) -> Option<&[Symbol]> {
        (id != LARGE).then(|| &*self.sets[id.0 as usize])
    }

    fn intern(&mut self, symbols: Vec<Symbol>) -> SetId {
        if symbols.len() > LARGEST {
            return LARGE;
        }
        if let Some(&id) = self.ids.get(symbols.as_slice()) {
            return id;
        }
        let id = SetId(u32::try_from(self.sets.len()).expect("fewer than 2^32 sets"));
        let set: Arc<[Symbol]> = symbols.into();
        self.sets.push(set.clone());
        self.ids.insert(set, id);
        id
    }

    fn union(&mut self, a: SetId, b: SetId) -> SetId {
        if a == b || b == EMPTY {
            return a;
        }
        if a == EMPTY {
            return b;
        }
        if a == LARGE || b == LARGE {
            return LARGE;
        }
        let key = if a.0 < b.0 { (a, b) } else { (b, a) };
        if let Some(&known) = self.unions.get(&key) {
            return known;
        }
        let mut both: Vec<Symbol> = [a, b].iter().flat_map(|s| self.sets[s.0 as usize].iter().copied()).collect();
        both.sort_unstable();
        both.dedup();
        let id = self.intern(both);
        self.unions.insert(key, id);
        id
    }
}

impl Exprs {
    pub(super) fn symbols_of_node(&mut self, node: &Node) -> SetId {
        if let Node::Symbol(s) = node {
            return self.sets.intern(vec![*s]);
        }
        let mut set = EMPTY;
        let entries = &self.entries;
        let sets = &mut self.sets;
        node.for_each_child(|c| set = sets.union(set, entries[c.0 as usize].symbols));
        set
    }

    /// The symbols that the expression reads.
    pub fn symbols_of(&self, e: Expr) -> BTreeSet<Symbol> {
        let mut found = BTreeSet::new();
        self.walk(e, |pool, e| match pool.sets.get(pool.entry(e).symbols) {
            Some(small) => {
                found.extend(small);
                false
            }
            None => true,
        });
        found
    }

    /// Whether the expression reads no symbol.
    pub fn is_constant(&self, e: Expr) -> bool {
        self.entry(e).symbols == EMPTY
    }

    /// Whether the symbol stands in the expression.
    pub fn depends_on(&self, e: Expr, symbol: Symbol) -> bool {
        self.depends_on_any(e, &|s| s == symbol)
    }

    /// Whether a symbol for which `wanted` holds stands in the expression.
    pub fn depends_on_any(&self, e: Expr, wanted: &dyn Fn(Symbol) -> bool) -> bool {
        let mut found = false;
        self.walk(e, |pool, e| match pool.sets.get(pool.entry(e).symbols) {
            Some(small) => {
                found |= small.iter().any(|&s| wanted(s));
                false
            }
            None => !found,
        });
        found
    }

    /// Calls `enter` once for every entry below `e`, itself included, as long as it answers true for those above.
    pub(super) fn walk(&self, e: Expr, mut enter: impl FnMut(&Self, Expr) -> bool) {
        if !enter(self, e) {
            return;
        }
        let mut seen = FxHashSet::from_iter([e]);
        let mut open = vec![e];
        while let Some(e) = open.pop() {
            self.node(e).for_each_child(|c| {
                if seen.insert(c) && enter(self, c) {
                    open.push(c);
                }
            });
        }
    }

    /// The entries below the given ones for which `keep` holds, parts before wholes; nothing below one that is not kept.
    pub(super) fn below(&self, roots: &[Expr], keep: &dyn Fn(Expr) -> bool) -> Vec<Expr> {
        let mut seen: FxHashSet<Expr> = roots.iter().copied().filter(|&r| keep(r)).collect();
        let mut open: Vec<Expr> = seen.iter().copied().collect();
        while let Some(e) = open.pop() {
            self.node(e).for_each_child(|c| {
                if keep(c) && seen.insert(c) {
                    open.push(c);
                }
            });
        }
        let mut order: Vec<Expr> = seen.into_iter().collect();
        order.sort_unstable();
        order
    }
}
