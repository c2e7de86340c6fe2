//! Rows and columns in pairs: a maximum matching, by shortest exchanges.

use std::collections::{BTreeMap, VecDeque};

/// Rows and columns, joined in pairs.
#[derive(Debug)]
pub struct Matching {
    /// The row of each column.
    pub row_of: Vec<Option<usize>>,
    /// The column of each row.
    pub column_of: Vec<Option<usize>>,
}

impl Matching {
    /// So many rows and columns, none of them joined.
    pub fn new(size: usize) -> Matching {
        Matching { row_of: vec![None; size], column_of: vec![None; size] }
    }

    /// Joins a row and a column.
    pub fn join(&mut self, row: usize, column: usize) {
        (self.row_of[column], self.column_of[row]) = (Some(row), Some(column));
    }

    /// Finds a column for a row that has none, if rows that have one can move over: the shortest such exchange.
    pub fn augment(&mut self, row: usize, edges: &[Vec<usize>]) {
        if self.column_of[row].is_some() {
            return;
        }
        let mut reached_by: BTreeMap<usize, usize> = BTreeMap::new();
        let mut queue = VecDeque::from([row]);
        while let Some(from) = queue.pop_front() {
            for &column in &edges[from] {
                if reached_by.contains_key(&column) {
                    continue;
                }
                reached_by.insert(column, from);
                match self.row_of[column] {
                    Some(holder) => queue.push_back(holder),
                    None => return self.exchange(column, &reached_by),
                }
            }
        }
    }

    fn exchange(&mut self, mut column: usize, reached_by: &BTreeMap<usize, usize>) {
        loop {
            let row = reached_by[&column];
            let before = self.column_of[row];
            self.join(row, column);
            match before {
                Some(next) => column = next,
                None => return,
            }
        }
    }
}
