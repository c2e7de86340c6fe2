//! Rows and columns in pairs: a maximum matching, by shortest exchanges.

use std::collections::VecDeque;

/// Rows and columns, joined in pairs.
#[derive(Debug)]
pub struct Matching {
    /// The row of each column.
    pub row_of: Vec<Option<usize>>,
    /// The column of each row.
    pub column_of: Vec<Option<usize>>,
}

/// What a search for an exchange has come by.
struct Search {
    /// The last search that reached a column, and the row that it came from.
    reached: Vec<(u32, usize)>,
    search: u32,
}

/// Of columns from which no exchange leads on: what a search without an end has reached is closed to all later ones.
const CLOSED: u32 = u32::MAX;

impl Matching {
    /// So many rows and columns, none of them joined.
    pub fn new(size: usize) -> Matching {
        Matching { row_of: vec![None; size], column_of: vec![None; size] }
    }

    /// Joins a row and a column.
    pub fn join(&mut self, row: usize, column: usize) {
        (self.row_of[column], self.column_of[row]) = (Some(row), Some(column));
    }

    /// Finds columns for the rows that have none, each among its own, as far as rows that have one can move over: one row
    /// after the other, the shortest such exchange for each.
    ///
    /// ```
    /// use halfarrow_sparse::Matching;
    /// let mut matching = Matching::new(3);
    /// matching.complete(&[vec![0], vec![0, 1], vec![0, 1]]);
    /// assert_eq!(matching.column_of, [Some(0), Some(1), None]);
    /// ```
    pub fn complete(&mut self, columns: &[Vec<usize>]) {
        let mut search = Search { reached: vec![(0, 0); self.row_of.len()], search: 0 };
        for row in 0..columns.len() {
            if self.column_of[row].is_none() {
                self.augment(row, columns, &mut search);
            }
        }
    }

    fn augment(&mut self, row: usize, columns: &[Vec<usize>], search: &mut Search) {
        search.search += 1;
        let mut queue = VecDeque::from([row]);
        let mut met = Vec::new();
        while let Some(from) = queue.pop_front() {
            for &column in &columns[from] {
                let reached = &mut search.reached[column];
                if reached.0 == search.search || reached.0 == CLOSED {
                    continue;
                }
                *reached = (search.search, from);
                met.push(column);
                match self.row_of[column] {
                    Some(holder) => queue.push_back(holder),
                    None => return self.exchange(column, &search.reached),
                }
            }
        }
        met.into_iter().for_each(|column| search.reached[column].0 = CLOSED);
    }

    fn exchange(&mut self, mut column: usize, reached: &[(u32, usize)]) {
        loop {
            let row = reached[column].1;
            let before = self.column_of[row];
            self.join(row, column);
            match before {
                Some(next) => column = next,
                None => return,
            }
        }
    }
}
