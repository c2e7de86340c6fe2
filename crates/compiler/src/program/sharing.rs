//! What products and sums have in common is computed once.
//!
//! A product is a bag of factors, a sum one of terms. The pair of factors (or terms) that most of them have becomes one
//! factor of its own, then the next, until no pair is found twice: `r x sin a/h` in `m r x sin a/h` and `r x sin a w/h`.
//! What parameters alone make is taken together first, as it is computed once for a set of parameters; reciprocals of what
//! several products are divided by are computed once, too. No product or sum gets longer by it.
//! Source: greedy elimination of common pairs, as [Breuer] has it.

use crate::algebra::{Expr, Exprs, Node, Rational};
use hashbrown::HashTable;
use rustc_hash::{FxBuildHasher, FxHashMap, FxHashSet};
use smallvec::SmallVec;
use std::collections::BinaryHeap;
use std::hash::BuildHasher;

/// A factor or term.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) enum Unit {
    /// A factor.
    Whole(Expr),
    /// One over a factor.
    Inverse(Expr),
    /// What parameters alone make of a product: a number above zero times factors.
    Product(Box<(Rational, Vec<UnitId>)>),
    /// A term without its sign.
    Size(Expr),
    /// A sum of terms of parameters alone, each with whether it is subtracted.
    Sum(Box<[(bool, UnitId)]>),
    /// Two factors; or two terms, with whether the second is subtracted.
    Pair(UnitId, UnitId, bool),
}

/// The place of a unit.
pub(super) type UnitId = u32;

/// What a product or sum is made of: each part with whether it is subtracted (of a product: whether the whole is).
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Parts {
    /// Of a product: its sign is turned.
    pub minus: bool,
    /// Factors, or terms with whether they are subtracted.
    pub units: Bag,
}

/// Factors or terms, two of them held in place.
pub(super) type Bag = SmallVec<[(bool, UnitId); 2]>;

/// How products and sums are put together.
#[derive(Debug, Default)]
pub(super) struct Sharing {
    pub units: Vec<Unit>,
    /// Products and sums, in the order of their expressions.
    all: Vec<(Expr, Parts)>,
    /// Expressions of which more than one product takes the reciprocal.
    pub reciprocals: FxHashSet<Expr>,
    known: HashTable<UnitId>,
    /// The first of terms that differ in sign alone.
    sizes: HashTable<Expr>,
}

/// Products and sums of more parts than this are left as they are.
const LONGEST: usize = 24;
/// Powers up to this are as many factors.
const HIGHEST: u64 = 4;

/// How the products and sums among `exprs` are put together; `varies` tells what is no parameter.
pub(super) fn share(x: &Exprs, exprs: &[Expr], varies: &dyn Fn(Expr) -> bool) -> Sharing {
    let mut sharing = Sharing::default();
    let (mut products, mut sums) = (Vec::new(), Vec::new());
    for &e in exprs {
        match x.node(e) {
            Node::Mul(factors) if factors.len() <= LONGEST && varies(e) => {
                products.push((e, sharing.product(x, factors, varies)));
            }
            Node::Add(terms) if terms.len() <= LONGEST && varies(e) => sums.push((e, sharing.sum(x, terms, varies))),
            _ => {}
        }
    }
    sharing.pair_up(&mut products);
    sharing.pair_up(&mut sums);
    let mut uses: FxHashMap<Expr, usize> = FxHashMap::default();
    let mut counted: FxHashSet<UnitId> = FxHashSet::default();
    let mut open: Vec<UnitId> = products.iter().flat_map(|(_, p)| &p.units).map(|u| u.1).collect();
    while let Some(unit) = open.pop() {
        match sharing.units[unit as usize] {
            Unit::Inverse(e) => *uses.entry(e).or_default() += 1,
            Unit::Pair(a, b, _) if counted.insert(unit) => open.extend([a, b]),
            _ => {}
        }
    }
    sharing.reciprocals = uses.into_iter().filter(|(_, count)| *count > 1).map(|(e, _)| e).collect();
    products.extend(sums);
    products.sort_by_key(|whole| whole.0);
    sharing.all = products;
    sharing
}

impl Sharing {
    /// How a product or sum is put together, if it is.
    pub fn parts(&self, e: Expr) -> Option<&Parts> {
        self.all.binary_search_by_key(&e, |whole| whole.0).ok().map(|at| &self.all[at].1)
    }

    fn unit(&mut self, unit: Unit) -> UnitId {
        let Sharing { units, known, .. } = self;
        let hash = |unit: &Unit| FxBuildHasher.hash_one(unit);
        let at = hash(&unit);
        if let Some(&known) = known.find(at, |&id| units[id as usize] == unit) {
            return known;
        }
        let id = units.len() as UnitId;
        units.push(unit);
        known.insert_unique(at, id, |&id| hash(&units[id as usize]));
        id
    }

    /// The first of the terms that differ from this one in sign alone.
    fn first_of_size(&mut self, x: &Exprs, term: Expr) -> Expr {
        let hash = |term: &Expr| FxBuildHasher.hash_one(size(x, term));
        let (at, own) = (hash(&term), size(x, &term));
        if let Some(&first) = self.sizes.find(at, |first| size(x, first) == own) {
            return first;
        }
        self.sizes.insert_unique(at, term, hash);
        term
    }

    fn product(&mut self, x: &Exprs, factors: &[Expr], varies: &dyn Fn(Expr) -> bool) -> Parts {
        let (mut minus, mut number) = (false, Rational::from(1));
        let (mut fixed, mut units) = (Bag::new(), Bag::new());
        for &factor in factors {
            if let Some(n) = x.is_number(factor) {
                (minus, number) = (n.signum() < 0, n.abs());
                continue;
            }
            let (unit, count) = match x.node(factor) {
                Node::Pow(base, exponent) => match x.is_number(*exponent).and_then(|n| n.small()) {
                    Some((n, 1)) if n.unsigned_abs() <= HIGHEST => {
                        (if n > 0 { Unit::Whole(*base) } else { Unit::Inverse(*base) }, n.unsigned_abs())
                    }
                    _ => (Unit::Whole(factor), 1),
                },
                _ => (Unit::Whole(factor), 1),
            };
            let unit = self.unit(unit);
            let place = if varies(factor) { &mut units } else { &mut fixed };
            place.extend(std::iter::repeat_n((false, unit), count as usize));
        }
        if !(number.is_one() && fixed.is_empty()) {
            let fixed = fixed.into_iter().map(|f| f.1).collect();
            units.insert(0, (false, self.unit(Unit::Product(Box::new((number, fixed))))));
        }
        Parts { minus, units }
    }

    fn sum(&mut self, x: &Exprs, terms: &[Expr], varies: &dyn Fn(Expr) -> bool) -> Parts {
        let (mut fixed, mut units) = (Bag::new(), Bag::new());
        for &term in terms {
            let minus = match x.node(term) {
                Node::Number(n) => n.signum() < 0,
                Node::Mul(factors) => x.is_number(factors[0]).is_some_and(|n| n.signum() < 0),
                _ => false,
            };
            let first = self.first_of_size(x, term);
            let part = (minus, self.unit(Unit::Size(first)));
            if varies(term) { units.push(part) } else { fixed.push(part) }
        }
        match fixed.len() {
            0 => {}
            1 => units.push(fixed[0]),
            _ => units.push((false, self.unit(Unit::Sum(fixed.into_vec().into())))),
        }
        Parts { minus: false, units }
    }

    /// Makes units of the pairs that are found more than once.
    fn pair_up(&mut self, bags: &mut [(Expr, Parts)]) {
        let mut count: FxHashMap<Pair, usize> = FxHashMap::default();
        let mut where_: Vec<SmallVec<[u32; 4]>> = vec![SmallVec::new(); self.units.len()];
        for (i, (_, bag)) in bags.iter().enumerate() {
            bag.units.iter().for_each(|u| where_[u.1 as usize].push(i as u32));
        }
        // A pair with what is there once is never found twice.
        let often = |unit: UnitId| where_[unit as usize].len() > 1;
        for (_, bag) in bags.iter() {
            let shared: Bag = bag.units.iter().copied().filter(|unit| often(unit.1)).collect();
            pairs(&shared).into_iter().for_each(|(pair, n)| *count.entry(pair).or_default() += n);
        }
        // Most found first; among equals the first.
        let entry = |pair: Pair, n: usize| (n, std::cmp::Reverse(pair));
        let mut heap: BinaryHeap<_> = count.iter().filter(|c| *c.1 > 1).map(|(&p, &n)| entry(p, n)).collect();
        while let Some((n, std::cmp::Reverse(pair))) = heap.pop() {
            let now = count.get(&pair).copied().unwrap_or(0);
            if now != n {
                if now > 1 && now < n {
                    heap.push(entry(pair, now));
                }
                continue;
            }
            let new = self.unit(Unit::Pair(pair.0, pair.1, pair.2));
            where_.resize(self.units.len(), SmallVec::new());
            let (first, second) = (&where_[pair.0 as usize], &where_[pair.1 as usize]);
            let mut at = if first.len() <= second.len() { first.to_vec() } else { second.to_vec() };
            at.dedup();
            let mut risen = FxHashSet::default();
            for i in at {
                let units = &mut bags[i as usize].1.units;
                let before = pairs(units);
                if before.binary_search_by_key(&pair, |p| p.0).is_err() {
                    continue;
                }
                while take(units, pair, new) {}
                for (pair, n) in before {
                    if let Some(count) = count.get_mut(&pair) {
                        *count -= n;
                    }
                }
                for (pair, n) in pairs(units) {
                    *count.entry(pair).or_default() += n;
                    risen.insert(pair);
                }
                let there = &mut where_[new as usize];
                if there.last() != Some(&i) {
                    there.push(i);
                }
            }
            heap.extend(risen.into_iter().filter_map(|p| Some(entry(p, count.get(&p).copied().filter(|&n| n > 1)?))));
        }
    }
}

/// A term without its sign: the size of its number, and its factors.
fn size<'x>(x: &'x Exprs, term: &'x Expr) -> (Rational, &'x [Expr]) {
    match x.node(*term) {
        Node::Number(n) => (n.abs(), &[]),
        Node::Mul(factors) => match x.is_number(factors[0]) {
            Some(n) => (n.abs(), &factors[1..]),
            None => (Rational::from(1), factors),
        },
        _ => (Rational::from(1), std::slice::from_ref(term)),
    }
}

/// Two units, the lesser one first, and whether one of them is subtracted.
type Pair = (UnitId, UnitId, bool);

/// How often each pair can be taken out of a bag, in the order of the pairs.
fn pairs(units: &[(bool, UnitId)]) -> SmallVec<[(Pair, usize); 6]> {
    let mut found = SmallVec::new();
    if units.len() < 2 {
        return found;
    }
    let mut sorted: SmallVec<[(UnitId, bool); 8]> = units.iter().map(|&(minus, unit)| (unit, minus)).collect();
    sorted.sort_unstable();
    let mut often: SmallVec<[((UnitId, bool), usize); 8]> = SmallVec::new();
    for unit in sorted {
        match often.last_mut() {
            Some((last, n)) if *last == unit => *n += 1,
            _ => often.push((unit, 1)),
        }
    }
    for (i, &((a, a_minus), n)) in often.iter().enumerate() {
        if n > 1 && !a_minus {
            found.push(((a, a, false), n / 2));
        }
        for &((b, b_minus), m) in &often[i + 1..] {
            if a != b {
                found.push(((a, b, a_minus != b_minus), n.min(m)));
            }
        }
    }
    // A term that is both added and subtracted makes a pair twice.
    found.sort_unstable();
    found.dedup_by(|next, first| {
        let same = next.0 == first.0;
        if same {
            first.1 += next.1;
        }
        same
    });
    found
}

/// Puts `new` in the place of a pair, once; whether the pair was there.
fn take(units: &mut Bag, (a, b, turned): Pair, new: UnitId) -> bool {
    for i in (0..units.len()).filter(|&i| units[i].1 == a).collect::<Vec<_>>() {
        let minus = units[i].0;
        if a == b && minus {
            continue;
        }
        let other = (0..units.len()).find(|&j| j != i && units[j] == (minus != turned, b));
        if let Some(j) = other {
            units[i.min(j)] = (minus, new);
            units.remove(i.max(j));
            return true;
        }
    }
    false
}
