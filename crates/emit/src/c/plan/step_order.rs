//! The order in which the matrix of an implicit step is eliminated, where it is large and sparse: fixed when the code is
//! written, as `halfarrow_sim` fixes it when a run begins.

use halfarrow_compiler::sparse::{Pattern, SymbolicFactors};

use crate::c::patterns::FULL_AT_MOST;

/// States up to which a full matrix is faster, whatever the pattern; as in `halfarrow_sim`.
const LARGEST_FULL: usize = 24;

/// One entry in so many is as good as full.
const FULL: usize = 4;

/// A sparse matrix with its whole diagonal, column by column, and the entries of its factors.
pub(in crate::c) struct StepOrder {
    /// Row of each entry, column by column.
    columns: Vec<Vec<usize>>,
    pub factors: SymbolicFactors,
    /// For each entry in the order of elimination its place column by column.
    from: Vec<u32>,
}

impl StepOrder {
    /// For a Jacobian with these rows in each column; `None` where a full matrix does better.
    pub fn of(jacobian: &[Vec<usize>]) -> Option<StepOrder> {
        let states = jacobian.len();
        let nonzeros: usize = jacobian.iter().map(Vec::len).sum();
        if states <= LARGEST_FULL || FULL * nonzeros > states * states {
            return None;
        }
        let with_diagonal = |(column, rows): (usize, &Vec<usize>)| {
            let mut rows = [&rows[..], &[column]].concat();
            rows.sort_unstable();
            rows.dedup();
            rows
        };
        let columns: Vec<Vec<usize>> = jacobian.iter().enumerate().map(with_diagonal).collect();
        let mut rows: Vec<Vec<(usize, u32)>> = vec![Vec::new(); states];
        let entries = columns.iter().enumerate().flat_map(|(column, rows)| rows.iter().map(move |&row| (row, column)));
        entries.zip(0..).for_each(|((row, column), place)| rows[row].push((column, place)));
        let factors = SymbolicFactors::new(&Pattern::new(rows.iter().map(|row| row.iter().map(|entry| entry.0))))?;
        let mut from = vec![0; factors.positions.len()];
        let places = rows.iter().flatten().map(|entry| entry.1);
        places.zip(&factors.positions).for_each(|(place, &position)| from[position as usize] = place);
        Some(StepOrder { columns, factors, from })
    }

    /// Entries of the matrix.
    pub fn entries(&self) -> usize {
        self.from.len()
    }

    /// Whether there is room for a full matrix, which is taken where the pivots of the order do not do.
    pub fn has_full(&self) -> bool {
        self.columns.len() <= FULL_AT_MOST
    }

    /// Operations at most to factor the matrix, to try the factors and to solve with them so many times.
    pub fn operations(&self, solutions: u64) -> u64 {
        let n = self.columns.len() as u64;
        let full = if self.has_full() { n * n * n + (4 + 2 * solutions) * n * n } else { 0 };
        let solution = 2 * (self.factors.lower.len() + self.factors.upper.len()) as u64 + 2 * n;
        self.factors.operations() + 6 * self.entries() as u64 + (solutions + 1) * solution + full
    }

    /// The tables, by the words that stand for them.
    pub fn tables(&self) -> [(&'static str, Vec<u32>); 11] {
        let starts = std::iter::once(0).chain(self.columns.iter().scan(0, |sum, rows| {
            *sum += rows.len() as u32;
            Some(*sum)
        }));
        let place = |(column, rows): (usize, &Vec<usize>)| rows.iter().position(|&row| row == column);
        let ends = starts.clone();
        let diagonal = self.columns.iter().enumerate().map(place).zip(ends);
        let f = &self.factors;
        [
            ("STEP_STARTS", starts.collect()),
            ("STEP_ROWS", self.columns.iter().flatten().map(|&row| row as u32).collect()),
            ("STEP_DIAGONAL", diagonal.map(|(place, start)| start + place.unwrap_or(0) as u32).collect()),
            ("STEP_FROM", self.from.clone()),
            ("STEP_MATRIX_STARTS", f.matrix.starts().to_vec()),
            ("STEP_MATRIX", f.matrix.columns().to_vec()),
            ("STEP_LOWER_STARTS", f.lower.starts().to_vec()),
            ("STEP_LOWER", f.lower.columns().to_vec()),
            ("STEP_UPPER_STARTS", f.upper.starts().to_vec()),
            ("STEP_UPPER", f.upper.columns().to_vec()),
            ("STEP_ORDER", f.rows.iter().chain(&f.columns).copied().collect()),
        ]
    }

    /// For each entry of the Jacobian, column by column, its place in the matrix.
    pub fn places(&self, jacobian: &[Vec<usize>]) -> Vec<u32> {
        let mut start = 0;
        let mut places = Vec::new();
        for (rows, own) in jacobian.iter().zip(&self.columns) {
            places.extend(rows.iter().map(|row| start + own.binary_search(row).unwrap_or(0) as u32));
            start += own.len() as u32;
        }
        places
    }
}
