//! Which columns something reads, made of what its parts read.

use std::cmp::{Ordering, Reverse};
use std::rc::Rc;

use rustc_hash::FxHashMap;
use smallvec::SmallVec;

/// Numbers of columns, ascending; whoever reads the same ones may share them.
pub type Columns = Rc<[u32]>;

/// The parts of a union, and where each stands.
type Parts = SmallVec<[Columns; 4]>;
type Addresses = SmallVec<[usize; 4]>;

/// Unions of fewer columns than this are found faster than they are looked up.
const FEW: usize = 32;
/// As many columns are compared at once.
const LANES: usize = 16;

/// Unions of columns; what has been found once is not found again.
#[derive(Debug, Default)]
pub struct Unions {
    /// By the addresses of the parts, which are kept so that nothing else comes to stand there.
    known: FxHashMap<Addresses, (Parts, Columns)>,
    merged: [Vec<u32>; 2],
}

impl Unions {
    /// The union of all parts: one of them, where it has all columns.
    ///
    /// ```
    /// use halfarrow_sparse::{Columns, Unions};
    /// let (a, b) = (Columns::from([1, 4]), Columns::from([2, 4, 7]));
    /// assert_eq!(*Unions::default().of([&a, &b]), [1, 2, 4, 7]);
    /// ```
    pub fn of<'a>(&mut self, parts: impl IntoIterator<Item = &'a Columns>) -> Columns {
        let mut parts: SmallVec<[&Columns; 4]> = parts.into_iter().filter(|part| !part.is_empty()).collect();
        let address = |part: &Columns| part.as_ptr() as usize;
        parts.sort_unstable_by_key(|part| (Reverse(part.len()), address(part)));
        parts.dedup_by(|a, b| Rc::ptr_eq(a, b));
        let [first, rest @ ..] = &parts[..] else { return Columns::from([]) };
        if rest.is_empty() {
            return Columns::clone(first);
        }
        let many = first.len() >= FEW;
        let key: Addresses = parts.iter().filter(|_| many).map(|part| address(part)).collect();
        if many && let Some((_, known)) = self.known.get(&key) {
            return Columns::clone(known);
        }
        let [all, next] = &mut self.merged;
        all.clear();
        all.extend_from_slice(first);
        for part in rest {
            merge(all, part, next);
            std::mem::swap(all, next);
        }
        let union = if all.len() == first.len() { Columns::clone(first) } else { Columns::from(&all[..]) };
        if many {
            self.known.insert(key, (parts.iter().map(|&part| Columns::clone(part)).collect(), Columns::clone(&union)));
        }
        union
    }
}

/// The columns of both, ascending. What parts have alike, and what one has before the other goes on, is taken over in one go:
/// in a chain each part has all that the one before it has.
fn merge(mut a: &[u32], mut b: &[u32], all: &mut Vec<u32>) {
    all.clear();
    all.reserve(a.len() + b.len());
    while let (Some(&left), Some(&right)) = (a.first(), b.first()) {
        let (own, other) = match left.cmp(&right) {
            Ordering::Less => (run_below(a, right), 0),
            Ordering::Greater => (0, run_below(b, left)),
            Ordering::Equal => {
                let alike = alike(a, b);
                all.extend_from_slice(&a[..alike]);
                (a, b) = (&a[alike..], &b[alike..]);
                continue;
            }
        };
        all.extend_from_slice(&a[..own]);
        all.extend_from_slice(&b[..other]);
        (a, b) = (&a[own..], &b[other..]);
    }
    all.extend_from_slice(a);
    all.extend_from_slice(b);
}

/// How many of the columns at the beginning are below a number, the first of them being so.
fn run_below(columns: &[u32], end: u32) -> usize {
    let mut step = 1;
    while columns.get(step).is_some_and(|&c| c < end) {
        step *= 2;
    }
    step / 2 + columns[step / 2..columns.len().min(step)].partition_point(|&c| c < end)
}

/// How many columns at the beginning are the same.
fn alike(a: &[u32], b: &[u32]) -> usize {
    let whole = a.chunks(LANES).zip(b.chunks(LANES)).take_while(|(a, b)| a == b).map(|(a, _)| a.len()).sum::<usize>();
    let rest = a[whole..].iter().zip(&b[whole..]).take_while(|(a, b)| a == b).count();
    whole + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Any two sets, beside what a tree makes of them.
    #[test]
    fn merged_runs_are_unions() {
        let mut seed = 1u64;
        let mut next = |below: u64| {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 33) % below
        };
        let mut found = Vec::new();
        for _ in 0..500 {
            let kept = [1 + next(9), 1 + next(9)];
            let [a, b] = kept.map(|k| (0..next(90) as u32).filter(|_| next(k) == 0).collect::<Vec<u32>>());
            merge(&a, &b, &mut found);
            let union: std::collections::BTreeSet<u32> = a.iter().chain(&b).copied().collect();
            assert_eq!(found, Vec::from_iter(union), "{a:?} {b:?}");
        }
    }

    #[test]
    fn what_has_all_columns_is_shared_and_nothing_is_lost() {
        let mut unions = Unions::default();
        let set = |from: u32, to: u32| -> Columns { (from..to).collect() };
        for long in [8, 100] {
            let (whole, first, second, none) = (set(0, long), set(0, long / 2), set(long / 3, long), set(0, 0));
            for _ in 0..2 {
                assert!(Rc::ptr_eq(&unions.of([&first, &whole, &none, &second]), &whole));
                assert_eq!(unions.of([&second, &first]), whole);
            }
            assert_eq!(unions.of([&none]), none);
        }
    }
}
