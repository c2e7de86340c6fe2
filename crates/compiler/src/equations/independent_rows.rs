//! Which of some rows of numbers are independent of those before them.

use std::collections::{BTreeMap, BTreeSet};

use crate::algebra::Symbol;

/// A linear combination of symbols.
pub(super) type Row = BTreeMap<Symbol, f64>;

/// What is below this part of the terms that it is the sum of counts as zero.
const ROUNDING: f64 = 1e-9;
/// A row's own symbol is its pivot unless another entry is that much greater.
const OWN: f64 = 10.0;
/// Rounds in which rows and columns are brought to like sizes.
const ROUNDS: usize = 6;

/// Brings the greatest entries of all rows and columns near to 1: what is told small no longer depends on units.
pub(super) fn equilibrate(rows: &mut [Row]) {
    let size = |most: f64| if most > 0.0 && most.is_finite() { most.sqrt() } else { 1.0 };
    for _ in 0..ROUNDS {
        let mut columns: BTreeMap<Symbol, f64> = BTreeMap::new();
        for (&s, v) in rows.iter().flatten() {
            let most = columns.entry(s).or_default();
            *most = most.max(v.abs());
        }
        for row in rows.iter_mut() {
            let most = size(row.values().fold(0.0f64, |most, v| most.max(v.abs())));
            row.iter_mut().for_each(|(s, v)| *v /= most * size(columns[s]));
        }
    }
}

/// Rows that are independent of each other, each solved for its pivot and free of the pivots of those before it.
#[derive(Default)]
pub(super) struct IndependentRows {
    rows: Vec<(Symbol, Row)>,
    place: BTreeMap<Symbol, usize>,
}

impl IndependentRows {
    /// Adds a row if it is independent of those that are there. `own` is the symbol it is to be solved for, if it can be.
    pub fn add(&mut self, mut row: Row, own: Option<Symbol>) -> bool {
        // What each entry is the sum of, in magnitude.
        let mut sizes: Row = row.iter().map(|(&s, v)| (s, v.abs())).collect();
        let mut open: BTreeSet<usize> = row.keys().filter_map(|s| self.place.get(s)).copied().collect();
        while let Some(k) = open.pop_first() {
            let (pivot, known) = &self.rows[k];
            let factor = row.remove(pivot).unwrap_or(0.0);
            if factor.abs() <= ROUNDING * sizes[pivot] {
                continue;
            }
            for (&s, v) in known {
                *row.entry(s).or_default() -= factor * v;
                *sizes.entry(s).or_default() += (factor * v).abs();
                open.extend(self.place.get(&s));
            }
        }
        row.retain(|s, v| v.abs() > ROUNDING * sizes[s]);
        let greatest = row.iter().fold(None, |most: Option<(Symbol, f64)>, (&s, &v)| match most {
            Some((_, m)) if m.abs() >= v.abs() => most,
            _ => Some((s, v)),
        });
        let Some(greatest) = greatest else { return false };
        let own = own.and_then(|s| Some((s, *row.get(&s)?))).filter(|(_, v)| OWN * v.abs() >= greatest.1.abs());
        let (pivot, value) = own.unwrap_or(greatest);
        row.remove(&pivot);
        row.values_mut().for_each(|v| *v /= value);
        self.place.insert(pivot, self.rows.len());
        self.rows.push((pivot, row));
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::algebra::{Exprs, Facts};

    fn added(rows: &[&[(usize, f64)]]) -> Vec<bool> {
        let mut x = Exprs::default();
        let symbols: Vec<Symbol> = (0..4).map(|i| x.symbol(&format!("s{i}"), Facts::default())).collect();
        let mut rows: Vec<Row> = rows.iter().map(|row| row.iter().map(|&(i, v)| (symbols[i], v)).collect()).collect();
        equilibrate(&mut rows);
        let mut known = IndependentRows::default();
        rows.into_iter().map(|row| known.add(row, None)).collect()
    }

    #[test]
    fn what_follows_is_not_added() {
        assert_eq!(added(&[&[(0, 1.0), (1, 1.0)], &[(1, 1.0), (2, 1.0)], &[(0, 1.0), (2, -1.0)]]), [true, true, false]);
        assert_eq!(added(&[&[(0, 0.1)], &[(1, 0.2), (0, 0.3)], &[(1, 0.7)], &[(3, 1.0)]]), [true, true, false, true]);
        assert_eq!(added(&[&[], &[(2, 0.0)]]), [false, false]);
    }

    /// The same in units that are decades apart.
    #[test]
    fn sizes_do_not_matter() {
        let (u, v, w) = (1e-13, 1e9, 1e5);
        let rows: [&[_]; 4] =
            [&[(0, u), (1, v)], &[(1, 2.0 * v * w), (2, w)], &[(0, u * w), (2, -0.5 * w)], &[(0, u * u), (1, -v * u)]];
        assert_eq!(added(&rows), [true, true, false, true]);
    }
}
