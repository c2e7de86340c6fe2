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

/// Rows that find columns one after the other, in an order that the caller chooses.
///
/// A row that finds none now finds none later, and which rows have one does not depend on the columns that were found for
/// those before.
#[derive(Debug)]
pub struct Joining<'a> {
    /// The pairs so far.
    pub pairs: Matching,
    /// The columns that each row may have.
    columns: &'a [Vec<usize>],
    search: Search,
}

impl<'a> Joining<'a> {
    /// Rows that may have these columns, of so many.
    pub fn new(columns: &'a [Vec<usize>], size: usize) -> Joining<'a> {
        Joining {
            pairs: Matching { row_of: vec![None; size], column_of: vec![None; columns.len()] },
            columns,
            search: Search::new(size),
        }
    }

    /// Finds a column for a row that has none, if need be by the shortest way of other rows to columns next to theirs.
    ///
    /// ```
    /// use halfarrow_sparse::Joining;
    /// let columns = [vec![0], vec![0, 1], vec![0, 1]];
    /// let mut joining = Joining::new(&columns, 2);
    /// assert_eq!([1, 0, 2].map(|row| joining.join(row)), [true, true, false]);
    /// ```
    pub fn join(&mut self, row: usize) -> bool {
        let free = self.free(row);
        if let Some(column) = free {
            self.pairs.exchange(column, &self.search.reached);
        }
        free.is_some()
    }

    /// Whether there is a column for a row that has none.
    pub fn finds(&mut self, row: usize) -> bool {
        self.free(row).is_some()
    }

    fn free(&mut self, row: usize) -> Option<usize> {
        self.pairs.free(row, self.columns, &mut self.search)
    }
}

/// What a search for an exchange has come by.
#[derive(Debug)]
struct Search {
    /// The last search that reached a column, and the row that it came from.
    reached: Vec<(u32, usize)>,
    search: u32,
}

impl Search {
    fn new(columns: usize) -> Search {
        Search { reached: vec![(0, 0); columns], search: 0 }
    }
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
        let mut search = Search::new(self.row_of.len());
        for row in 0..columns.len() {
            if self.column_of[row].is_none()
                && let Some(column) = self.free(row, columns, &mut search)
            {
                self.exchange(column, &search.reached);
            }
        }
    }

    /// The column at the end of the shortest exchange that gives the row one.
    fn free(&self, row: usize, columns: &[Vec<usize>], search: &mut Search) -> Option<usize> {
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
                    None => return Some(column),
                }
            }
        }
        met.into_iter().for_each(|column| search.reached[column].0 = CLOSED);
        None
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
