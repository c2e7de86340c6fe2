//! Where a Jacobian may be nonzero.

/// Rows of the nonzeros of each column of a square matrix, columns in order, rows ascending.
///
/// ```
/// let chain = halfarrow_sim::Sparsity::from_columns([vec![1, 0], vec![1]]);
/// assert_eq!(chain.column(0), [0, 1]);
/// assert_eq!((chain.states(), chain.nonzeros()), (2, 3));
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sparsity {
    starts: Vec<usize>,
    rows: Vec<usize>,
}

impl Sparsity {
    /// The pattern with these rows in each column, in any order; a row given twice counts once.
    ///
    /// # Panics
    /// If a row is not below the number of columns.
    pub fn from_columns(columns: impl IntoIterator<Item = Vec<usize>>) -> Sparsity {
        let (mut starts, mut rows) = (vec![0], Vec::new());
        for mut column in columns {
            column.sort_unstable();
            column.dedup();
            rows.extend(column);
            starts.push(rows.len());
        }
        assert!(rows.iter().all(|&row| row < starts.len() - 1), "a row beyond the size of the square matrix");
        Sparsity { starts, rows }
    }

    /// The full pattern of `states` rows and columns.
    pub fn dense(states: usize) -> Sparsity {
        Sparsity::from_columns((0..states).map(|_| (0..states).collect()))
    }

    /// The first of so many equal blocks on the diagonal.
    pub fn first_block(&self, blocks: usize) -> Sparsity {
        let columns = self.states() / blocks.max(1);
        Sparsity::from_columns((0..columns).map(|column| self.column(column).to_vec()))
    }

    /// The pattern with rows for columns.
    pub fn transposed(&self) -> Sparsity {
        let mut columns = vec![Vec::new(); self.states()];
        self.entries().for_each(|(row, column)| columns[row].push(column));
        Sparsity::from_columns(columns)
    }

    /// Number of columns, which is that of the rows.
    pub fn states(&self) -> usize {
        self.starts.len() - 1
    }

    /// Number of nonzeros.
    pub fn nonzeros(&self) -> usize {
        self.rows.len()
    }

    /// Rows of the nonzeros of one column, ascending.
    pub fn column(&self, column: usize) -> &[usize] {
        &self.rows[self.starts[column]..self.starts[column + 1]]
    }

    /// Numbers of the nonzeros of one column, counted over all columns.
    pub fn places(&self, column: usize) -> std::ops::Range<usize> {
        self.starts[column]..self.starts[column + 1]
    }

    /// The number of the nonzero in a row and column.
    ///
    /// # Panics
    /// If there is none.
    pub fn place(&self, row: usize, column: usize) -> usize {
        self.find(row, column).expect("a nonzero of the pattern")
    }

    /// The number of the nonzero in a row and column, if there is one.
    pub fn find(&self, row: usize, column: usize) -> Option<usize> {
        self.column(column).binary_search(&row).ok().map(|found| self.places(column).start + found)
    }

    /// The pattern with the whole diagonal.
    pub fn with_diagonal(&self) -> Sparsity {
        Sparsity::from_columns((0..self.states()).map(|column| [self.column(column), &[column]].concat()))
    }

    /// Columns in groups, no two of a group with a nonzero in the same row: one directional derivative gives all columns
    /// of a group. Greedy, in order; at least as many groups as the [longest row](Sparsity::longest_row) has nonzeros, at
    /// most as many as columns.
    pub fn groups(&self) -> Vec<Vec<usize>> {
        let mut groups: Vec<Vec<usize>> = Vec::new();
        let mut in_row: Vec<Vec<usize>> = vec![Vec::new(); self.states()];
        // For each group the last column that does not fit in it.
        let mut barred: Vec<usize> = Vec::new();
        for column in 0..self.states() {
            let rows = self.column(column);
            rows.iter().flat_map(|&row| &in_row[row]).for_each(|&group| barred[group] = column);
            let group = barred.iter().position(|&last| last != column).unwrap_or_else(|| {
                groups.push(Vec::new());
                barred.push(usize::MAX);
                groups.len() - 1
            });
            groups[group].push(column);
            rows.iter().for_each(|&row| in_row[row].push(group));
        }
        groups
    }

    /// Number of nonzeros in the row that has most.
    pub fn longest_row(&self) -> usize {
        let mut lengths = vec![0; self.states()];
        self.rows.iter().for_each(|&row| lengths[row] += 1);
        lengths.into_iter().max().unwrap_or(0)
    }

    /// All nonzeros as (row, column), column by column.
    pub fn entries(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        (0..self.states()).flat_map(|column| self.column(column).iter().map(move |&row| (row, column)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_of_a_group_share_no_row() {
        let chain = Sparsity::from_columns((0..100).map(|i: usize| (i.saturating_sub(1)..(i + 2).min(100)).collect()));
        assert_eq!((chain.groups().len(), chain.longest_row()), (3, 3));
        let star = Sparsity::from_columns((0..50).map(|i| vec![0, i]));
        assert_eq!((star.groups().len(), star.longest_row()), (50, 50));
        let comb = Sparsity::from_columns((0..60).map(|i: usize| vec![i, (7 * i) % 60, (i * i) % 60]));
        let groups = comb.groups();
        assert_eq!(groups.iter().map(Vec::len).sum::<usize>(), 60);
        for group in groups {
            let mut rows: Vec<usize> = group.iter().flat_map(|&column| comb.column(column)).copied().collect();
            let all = rows.len();
            rows.sort_unstable();
            rows.dedup();
            assert_eq!(rows.len(), all);
        }
    }
}
