//! Square matrices of which only the entries that may differ from 0 are kept, and the order in which they are eliminated.
#![forbid(unsafe_code)]

mod height;
mod matching;
mod symbolic;
mod unions;

pub use matching::{Joining, Matching};
pub use symbolic::{SymbolicFactors, full_operations};
pub use unions::{Columns, Unions};

use std::ops::Range;
use std::sync::Arc;

/// Where the entries of a square matrix stand: row by row, in a row by column.
#[derive(Debug, Clone, Default, PartialEq, Eq, Hash)]
pub struct Pattern {
    /// For each row its first entry, and at the end the number of entries.
    starts: Vec<u32>,
    /// For each entry its column.
    columns: Vec<u32>,
}

impl Pattern {
    /// The pattern with these columns in each row, which ascend.
    pub fn new<R: IntoIterator<Item = usize>>(rows: impl IntoIterator<Item = R>) -> Pattern {
        let mut pattern = Pattern { starts: vec![0], columns: Vec::new() };
        for row in rows {
            pattern.columns.extend(row.into_iter().map(|column| column as u32));
            pattern.starts.push(pattern.columns.len() as u32);
        }
        pattern
    }

    /// Number of rows, and of columns.
    pub fn size(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// Number of entries.
    pub fn len(&self) -> usize {
        self.columns.len()
    }

    /// Whether there are no entries.
    pub fn is_empty(&self) -> bool {
        self.columns.is_empty()
    }

    /// For each row its first entry, and at the end the number of entries.
    pub fn starts(&self) -> &[u32] {
        &self.starts
    }

    /// For each entry its column.
    pub fn columns(&self) -> &[u32] {
        &self.columns
    }

    /// The entries of a row.
    pub fn row(&self, row: usize) -> Range<usize> {
        self.starts[row] as usize..self.starts[row + 1] as usize
    }

    /// The columns of the entries of a row.
    pub fn columns_of(&self, row: usize) -> &[u32] {
        &self.columns[self.row(row)]
    }

    /// The entry in this place, if there is one.
    pub fn entry(&self, row: usize, column: usize) -> Option<usize> {
        let place = self.columns_of(row).binary_search(&(column as u32)).ok()?;
        Some(self.row(row).start + place)
    }

    /// Row and column of each entry.
    pub fn places(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        (0..self.size()).flat_map(|row| self.columns_of(row).iter().map(move |&column| (row, column as usize)))
    }
}

/// A square matrix of which the entries of a [`Pattern`] are kept.
#[derive(Debug, Clone, PartialEq)]
pub struct SparseMatrix<T> {
    pattern: Arc<Pattern>,
    entries: Vec<T>,
}

impl<T> SparseMatrix<T> {
    /// The matrix with an entry in every place.
    pub fn full(rows: Vec<Vec<T>>) -> SparseMatrix<T> {
        SparseMatrix::new(rows.into_iter().map(|row| row.into_iter().enumerate()))
    }

    /// The matrix with these rows: columns, which ascend, and entries.
    pub fn new<R: IntoIterator<Item = (usize, T)>>(rows: impl IntoIterator<Item = R>) -> SparseMatrix<T> {
        let mut entries = Vec::new();
        let columns = rows.into_iter().map(|row| {
            let (columns, own): (Vec<usize>, Vec<T>) = row.into_iter().unzip();
            entries.extend(own);
            columns
        });
        let pattern = Arc::new(Pattern::new(columns));
        SparseMatrix { pattern, entries }
    }

    /// Number of rows, and of columns.
    pub fn size(&self) -> usize {
        self.pattern.size()
    }

    /// Where the entries stand.
    pub fn pattern(&self) -> &Arc<Pattern> {
        &self.pattern
    }

    /// The entries, row by row.
    pub fn entries(&self) -> &[T] {
        &self.entries
    }

    /// Columns and entries of a row.
    pub fn row(&self, row: usize) -> impl Iterator<Item = (usize, &T)> {
        let columns = self.pattern.columns_of(row).iter().map(|&column| column as usize);
        columns.zip(&self.entries[self.pattern.row(row)])
    }

    /// Columns and entries of all rows.
    pub fn rows(&self) -> impl Iterator<Item = impl Iterator<Item = (usize, &T)>> {
        (0..self.size()).map(|row| self.row(row))
    }

    /// The entry in this place, if there is one.
    pub fn get(&self, row: usize, column: usize) -> Option<&T> {
        self.pattern.entry(row, column).map(|entry| &self.entries[entry])
    }

    /// The matrix with other entries in the same places.
    pub fn map<U>(&self, to: impl FnMut(&T) -> U) -> SparseMatrix<U> {
        SparseMatrix { pattern: Arc::clone(&self.pattern), entries: self.entries.iter().map(to).collect() }
    }

    /// All places row by row, with `zero` where no entry stands.
    pub fn dense(&self, zero: T) -> Vec<T>
    where
        T: Clone,
    {
        let n = self.size();
        let mut all = vec![zero; n * n];
        self.pattern.places().zip(&self.entries).for_each(|((row, column), e)| all[row * n + column] = e.clone());
        all
    }
}

impl<T: PartialEq> SparseMatrix<T> {
    /// Whether it is its own mirror image.
    pub fn is_symmetric(&self) -> bool {
        let mut places = self.pattern.places().zip(&self.entries);
        places.all(|((row, column), e)| column >= row || self.get(column, row) == Some(e))
            && self.pattern.places().all(|(row, column)| column <= row || self.pattern.entry(column, row).is_some())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_are_found_where_they_stand() {
        let matrix = SparseMatrix::new([vec![(0, 1.0), (2, 2.0)], vec![], vec![(0, 2.0), (2, 3.0)]]);
        assert_eq!((matrix.size(), matrix.pattern().len()), (3, 4));
        assert_eq!((matrix.get(0, 2), matrix.get(1, 1)), (Some(&2.0), None));
        assert_eq!(matrix.dense(0.0), [1.0, 0.0, 2.0, 0.0, 0.0, 0.0, 2.0, 0.0, 3.0]);
        assert!(matrix.is_symmetric());
        assert!(!SparseMatrix::new([vec![(1, 1.0)], vec![]]).is_symmetric());
        assert!(!SparseMatrix::new([vec![(1, 1.0)], vec![(0, 2.0)]]).is_symmetric());
    }
}
