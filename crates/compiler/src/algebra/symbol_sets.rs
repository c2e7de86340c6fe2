//! Which symbols an expression reads: small sets, each held once.

use super::exprs::Exprs;
use super::fingerprint::mix;
use super::node::{Expr, Node, Symbol};
use hashbrown::HashTable;
use rustc_hash::{FxHashMap, FxHashSet};
use smallvec::SmallVec;

/// A set of symbols.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct SetId(u32);

/// Larger sets are not kept but found by walking the expression, down to what is taken as a whole: of that sets are kept up to
/// a larger size, as an entry of a rotation reads all joints on the way to its body.
const LARGEST: usize = 48;
const LARGEST_OF_WHOLE: usize = 4096;
/// Unions of so many symbols are made again and again: looking for them costs as much.
const SMALL: usize = 8;
const EMPTY: SetId = SetId(0);
const LARGE: SetId = SetId(1);
/// Sets of one symbol are numbered by it, from here on.
const SINGLES: u32 = 1 << 31;

#[derive(Clone)]
pub(super) struct SymbolSets {
    /// The members of all sets, one set after the other.
    members: Vec<Symbol>,
    /// Where each set ends; it starts where the one before it ends.
    ends: Vec<u32>,
    ids: HashTable<u32>,
    unions: FxHashMap<(SetId, SetId), SetId>,
    /// The symbols up to the last that is a set alone: the members of such sets.
    singles: Vec<Symbol>,
}

impl Default for SymbolSets {
    fn default() -> Self {
        let mut sets = SymbolSets {
            members: Vec::new(),
            ends: vec![0; 2],
            ids: HashTable::new(),
            unions: FxHashMap::default(),
            singles: Vec::new(),
        };
        sets.ids.insert_unique(hash_of(&[]), EMPTY.0, |_| hash_of(&[]));
        sets
    }
}

impl SymbolSets {
    fn get(&self, id: SetId) -> Option<&[Symbol]> {
        match id {
            LARGE => None,
            SetId(single @ SINGLES..) => self.singles.get((single - SINGLES) as usize).map(std::slice::from_ref),
            SetId(id) => Some(members(&self.members, &self.ends, id)),
        }
    }

    fn len(&self, id: SetId) -> usize {
        self.get(id).map_or(0, <[Symbol]>::len)
    }

    fn single(&mut self, symbol: Symbol) -> SetId {
        let known = self.singles.len() as u32;
        self.singles.extend((known..symbol.0 + 1).map(Symbol));
        SetId(SINGLES + symbol.0)
    }

    fn intern(&mut self, symbols: &[Symbol], largest: usize) -> SetId {
        match symbols {
            &[symbol] => return self.single(symbol),
            _ if symbols.len() > largest => return LARGE,
            _ => {}
        }
        let SymbolSets { members: all, ends, ids, .. } = self;
        let hash = hash_of(symbols);
        if let Some(&known) = ids.find(hash, |&id| members(all, ends, id) == symbols) {
            return SetId(known);
        }
        let id = u32::try_from(ends.len()).expect("fewer than 2^32 sets");
        all.extend_from_slice(symbols);
        ends.push(u32::try_from(all.len()).expect("fewer than 2^32 members of sets"));
        ids.insert_unique(hash, id, |&id| hash_of(members(all, ends, id)));
        SetId(id)
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
        if self.len(a) + self.len(b) <= SMALL || self.len(a).max(self.len(b)) > LARGEST {
            return self.union_of([a, b].into_iter());
        }
        let key = if a.0 < b.0 { (a, b) } else { (b, a) };
        if let Some(&known) = self.unions.get(&key) {
            return known;
        }
        let id = self.union_of([a, b].into_iter());
        self.unions.insert(key, id);
        id
    }

    /// The union of several sets at once, so that no set on the way to it is kept; a long one where it has the others.
    fn union_of(&mut self, sets: impl Iterator<Item = SetId>) -> SetId {
        let mut all: SmallVec<[Symbol; 16]> = SmallVec::new();
        let mut long = EMPTY;
        for set in sets {
            match self.get(set) {
                Some(symbols) if symbols.len() <= LARGEST => all.extend_from_slice(symbols),
                Some(_) if long == EMPTY || long == set => long = set,
                _ => return LARGE,
            }
        }
        all.sort_unstable();
        all.dedup();
        match self.get(long).filter(|long| !long.is_empty()) {
            Some(long_symbols) if all.iter().all(|s| long_symbols.binary_search(s).is_ok()) => long,
            Some(_) => LARGE,
            None => self.intern(&all, LARGEST),
        }
    }
}

fn members<'a>(all: &'a [Symbol], ends: &[u32], id: u32) -> &'a [Symbol] {
    let start = if id == 0 { 0 } else { ends[id as usize - 1] };
    &all[start as usize..ends[id as usize] as usize]
}

fn hash_of(symbols: &[Symbol]) -> u64 {
    symbols.iter().fold(0x5e75, |h, s| mix(h, u64::from(s.0)))
}

/// The symbols that an expression reads, ascending.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Symbols(SmallVec<[Symbol; 8]>);

impl Symbols {
    /// Whether the symbol is among them.
    pub fn contains(&self, symbol: &Symbol) -> bool {
        self.0.binary_search(symbol).is_ok()
    }
}

impl std::ops::Deref for Symbols {
    type Target = [Symbol];
    fn deref(&self) -> &[Symbol] {
        &self.0
    }
}

impl IntoIterator for Symbols {
    type Item = Symbol;
    type IntoIter = smallvec::IntoIter<[Symbol; 8]>;
    fn into_iter(self) -> Self::IntoIter {
        self.0.into_iter()
    }
}

impl Exprs {
    pub(super) fn symbols_of_node(&mut self, node: &Node) -> SetId {
        if let Node::Symbol(s) = node {
            return self.sets.single(*s);
        }
        if let Node::Whole(part) = node
            && self.entry(*part).symbols == LARGE
        {
            let symbols = self.symbols_of(*part);
            return self.sets.intern(&symbols, LARGEST_OF_WHOLE);
        }
        let (entries, sets) = (&self.entries, &mut self.sets);
        let of = |e: Expr| entries[e.0 as usize].symbols;
        if let Node::Add(parts) | Node::Mul(parts) = node
            && parts.len() > 2
        {
            return sets.union_of(parts.iter().map(|&e| of(e)));
        }
        let mut set = EMPTY;
        node.for_each_child(|c| set = sets.union(set, of(c)));
        set
    }

    /// The symbols that the expression reads.
    pub fn symbols_of(&self, e: Expr) -> Symbols {
        if let Some(small) = self.sets.get(self.entry(e).symbols) {
            return Symbols(SmallVec::from_slice(small));
        }
        let mut found = FxHashSet::default();
        self.walk(e, |pool, e| match pool.sets.get(pool.entry(e).symbols) {
            Some(small) => {
                found.extend(small);
                false
            }
            None => true,
        });
        let mut found: SmallVec<[Symbol; 8]> = found.into_iter().collect();
        found.sort_unstable();
        Symbols(found)
    }

    /// The symbols that several expressions read, some of them more than once. Parts that were `met` are passed over, and those
    /// that are met now are added: what expressions share is gone through once.
    pub fn symbols_met(&self, roots: &[Expr], met: &mut FxHashSet<Expr>) -> Vec<Symbol> {
        let mut found = Vec::new();
        for &root in roots {
            self.walk(root, |pool, part| {
                let small = pool.sets.get(pool.entry(part).symbols);
                let new = met.insert(part);
                found.extend(small.filter(|_| new).into_iter().flatten());
                new && small.is_none()
            });
        }
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
        if let Some(small) = self.sets.get(self.entry(e).symbols) {
            return small.iter().any(|&s| wanted(s));
        }
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
        let mut seen = Seen::default();
        seen.insert(e);
        let mut open: SmallVec<[Expr; FEW]> = SmallVec::from_slice(&[e]);
        while let Some(e) = open.pop() {
            self.node(e).for_each_child(|c| {
                if seen.insert(c) && enter(self, c) {
                    open.push(c);
                }
            });
        }
    }

    /// The entries below the given ones for which `keep` holds, parts before wholes; nothing below one that is not kept, and
    /// nothing that stands inside [`Node::Whole`].
    pub(super) fn around_wholes(&self, roots: &[Expr], keep: &dyn Fn(Expr) -> bool) -> SmallVec<[Expr; FEW]> {
        self.seen_below(roots, keep, &|node| !matches!(node, Node::Whole(_))).into_order()
    }

    /// The entries below the given ones for which `keep` holds, parts before wholes; nothing below one that is not kept.
    pub fn below(&self, roots: &[Expr], keep: &dyn Fn(Expr) -> bool) -> Vec<Expr> {
        self.seen_below(roots, keep, &|_| true).into_order().into_vec()
    }

    /// The entries below the given ones that read a symbol for which `wanted` holds, parts before wholes; those that are
    /// known, and what stands below them alone, are left out. Asking each entry by itself would walk through the same long
    /// expressions again and again.
    pub(super) fn reading_below(
        &self,
        roots: &[Expr],
        wanted: &dyn Fn(Symbol) -> bool,
        is_known: &dyn Fn(Expr) -> bool,
    ) -> Vec<Expr> {
        let small = |e: Expr| self.sets.get(self.entry(e).symbols);
        let may_read = |e: Expr| small(e).is_none_or(|small| small.iter().any(|&s| wanted(s)));
        let mut reading: FxHashSet<Expr> = FxHashSet::default();
        let mut order = self.below(roots, &|e| may_read(e) && !is_known(e));
        order.retain(|&e| {
            let mut reads = small(e).is_some();
            if !reads {
                self.node(e).for_each_child(|c| reads |= reading.contains(&c) || is_known(c));
            }
            if reads {
                reading.insert(e);
            }
            reads
        });
        order
    }

    fn seen_below(&self, roots: &[Expr], keep: &dyn Fn(Expr) -> bool, opens: &dyn Fn(&Node) -> bool) -> Seen {
        let mut seen = Seen::default();
        let mut open: SmallVec<[Expr; FEW]> = SmallVec::new();
        for &root in roots {
            if keep(root) && seen.insert(root) {
                open.push(root);
            }
        }
        while let Some(e) = open.pop() {
            let node = self.node(e);
            if opens(node) {
                node.for_each_child(|c| {
                    if keep(c) && seen.insert(c) {
                        open.push(c);
                    }
                });
            }
        }
        seen
    }
}

/// Up to so many entries are looked for one by one.
pub(super) const FEW: usize = 24;

/// From so many entries on each has a bit.
const MANY: usize = 4096;

/// Entries that were met: few in a row, more in a table, a part of the pool bit by bit.
#[derive(Default)]
struct Seen {
    few: SmallVec<[Expr; FEW]>,
    some: FxHashSet<Expr>,
    bits: Vec<u64>,
}

impl Seen {
    /// Whether it is new.
    fn insert(&mut self, e: Expr) -> bool {
        if !self.bits.is_empty() {
            return self.set(e);
        }
        if self.some.is_empty() {
            if self.few.contains(&e) {
                return false;
            }
            if self.few.len() < FEW {
                self.few.push(e);
                return true;
            }
            self.some.extend(self.few.drain(..));
        }
        if self.some.len() < MANY {
            return self.some.insert(e);
        }
        std::mem::take(&mut self.some).into_iter().for_each(|e| _ = self.set(e));
        self.set(e)
    }

    fn set(&mut self, e: Expr) -> bool {
        let (word, bit) = (e.0 as usize / 64, 1 << (e.0 % 64));
        if self.bits.len() <= word {
            self.bits.resize(word + 1, 0);
        }
        let new = self.bits[word] & bit == 0;
        self.bits[word] |= bit;
        new
    }

    fn into_order(self) -> SmallVec<[Expr; FEW]> {
        if !self.bits.is_empty() {
            let bits = self.bits.iter().zip(0u32..).flat_map(|(&word, i)| {
                (0..64).filter(move |bit| word >> bit & 1 == 1).map(move |bit| Expr(64 * i + bit))
            });
            return bits.collect();
        }
        let mut order = if self.some.is_empty() { self.few } else { self.some.into_iter().collect() };
        order.sort_unstable();
        order
    }
}

#[cfg(test)]
mod tests {
    use super::{Expr, FEW, MANY, Seen};

    #[test]
    fn entries_are_met_once_and_put_in_order_however_many_there_are() {
        for count in [FEW, MANY, 3 * MANY].map(|n| n as u32) {
            let mut seen = Seen::default();
            let new = (0..3 * count).filter(|i| seen.insert(Expr(i * 7 % count))).count();
            assert_eq!(new as u32, count);
            assert!(seen.into_order().iter().map(|e| e.0).eq(0..count));
        }
    }
}
