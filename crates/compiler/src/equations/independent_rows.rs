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

/// Which rows are independent of those before them. Each is solved for its own symbol, if it can be, where it has one.
pub(super) fn independent(rows: &[(Row, Option<Symbol>)]) -> Vec<bool> {
    let mut columns: Vec<Symbol> = rows.iter().flat_map(|(row, _)| row.keys().copied()).collect();
    columns.sort_unstable();
    columns.dedup();
    let place = |s: &Symbol| columns.binary_search(s).ok();
    let mut known = IndependentRows::new(columns.len());
    let mut add = |(row, own): &(Row, Option<Symbol>)| {
        let row = row.iter().map(|(s, &v)| (place(s).expect("all symbols have a column"), v));
        known.add(row, own.as_ref().and_then(place))
    };
    rows.iter().map(&mut add).collect()
}

/// Rows that are independent of each other, each solved for its pivot and free of the pivots of those before it.
struct IndependentRows {
    rows: Vec<(usize, Vec<(usize, f64)>)>,
    /// The row of each pivot.
    place: Vec<Option<usize>>,
    /// The row that is being reduced, with what each entry is the sum of, in magnitude; entries by column, where there are any.
    values: Vec<Option<(f64, f64)>>,
}

impl IndependentRows {
    fn new(columns: usize) -> IndependentRows {
        IndependentRows { rows: Vec::new(), place: vec![None; columns], values: vec![None; columns] }
    }

    /// Adds a row if it is independent of those that are there. `own` is the column it is to be solved for, if it can be.
    fn add(&mut self, row: impl Iterator<Item = (usize, f64)>, own: Option<usize>) -> bool {
        let (mut met, mut open) = (Vec::new(), BTreeSet::new());
        for (column, value) in row {
            self.values[column] = Some((value, value.abs()));
            met.push(column);
            open.extend(self.place[column]);
        }
        while let Some(k) = open.pop_first() {
            let (pivot, known) = &self.rows[k];
            let Some((factor, size)) = self.values[*pivot].take() else { continue };
            if factor.abs() <= ROUNDING * size {
                continue;
            }
            for &(column, v) in known {
                match &mut self.values[column] {
                    Some((value, size)) => {
                        *value -= factor * v;
                        *size += (factor * v).abs();
                    }
                    none => {
                        *none = Some((-(factor * v), (factor * v).abs()));
                        met.push(column);
                        open.extend(self.place[column]);
                    }
                }
            }
        }
        met.sort_unstable();
        let left = met.into_iter().filter_map(|column| Some((column, self.values[column].take()?)));
        let told = left.filter(|(_, (value, size))| value.abs() > ROUNDING * size);
        let mut row: Vec<(usize, f64)> = told.map(|(column, (value, _))| (column, value)).collect();
        let greatest = row.iter().fold(None, |most: Option<(usize, f64)>, &(c, v)| match most {
            Some((_, m)) if m.abs() >= v.abs() => most,
            _ => Some((c, v)),
        });
        let Some(greatest) = greatest else { return false };
        let own = own.and_then(|own| row.iter().find(|entry| entry.0 == own).copied());
        let (pivot, value) = own.filter(|(_, v)| OWN * v.abs() >= greatest.1.abs()).unwrap_or(greatest);
        row.retain(|entry| entry.0 != pivot);
        row.iter_mut().for_each(|entry| entry.1 /= value);
        self.place[pivot] = Some(self.rows.len());
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
        independent(&rows.into_iter().map(|row| (row, None)).collect::<Vec<_>>())
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
