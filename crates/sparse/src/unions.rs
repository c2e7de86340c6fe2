//! Which columns something reads, made of what its parts read.

use std::cmp::Reverse;
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

/// The columns of both, ascending.
fn merge(a: &[u32], b: &[u32], all: &mut Vec<u32>) {
    all.clear();
    all.reserve(a.len() + b.len());
    let (mut i, mut j) = (0, 0);
    while let (Some(&left), Some(&right)) = (a.get(i), b.get(j)) {
        all.push(left.min(right));
        i += usize::from(left <= right);
        j += usize::from(right <= left);
    }
    all.extend_from_slice(&a[i..]);
    all.extend_from_slice(&b[j..]);
}

#[cfg(test)]
mod tests {
    use super::*;

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
