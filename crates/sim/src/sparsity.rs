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
        let found = self.column(column).binary_search(&row).expect("a nonzero of the pattern");
        self.places(column).start + found
    }

    /// The pattern with the whole diagonal.
    pub fn with_diagonal(&self) -> Sparsity {
        Sparsity::from_columns((0..self.states()).map(|column| [self.column(column), &[column]].concat()))
    }

    /// Columns in groups, no two of a group with a nonzero in the same row: one directional derivative gives all columns
    /// of a group. Greedy, in order; at most as many groups as columns.
    pub fn groups(&self) -> Vec<Vec<usize>> {
        let mut groups: Vec<Vec<usize>> = Vec::new();
        let mut taken: Vec<Vec<bool>> = Vec::new();
        for column in 0..self.states() {
            let rows = self.column(column);
            let free = taken.iter().position(|taken| rows.iter().all(|&row| !taken[row]));
            let group = free.unwrap_or_else(|| {
                groups.push(Vec::new());
                taken.push(vec![false; self.states()]);
                groups.len() - 1
            });
            groups[group].push(column);
            rows.iter().for_each(|&row| taken[group][row] = true);
        }
        groups
    }

    /// All nonzeros as (row, column), column by column.
    pub fn entries(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        (0..self.states()).flat_map(|column| self.column(column).iter().map(move |&row| (row, column)))
    }
}
