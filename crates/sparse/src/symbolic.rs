//! The symbolic factorisation of a sparse matrix: which row and column are eliminated when, and where factors have entries.
//!
//! Rows are matched to columns so that no pivot is missing, and the pairs put into an order of approximate minimum degree
//! (Amestoy, Davis and Duff, SIAM Journal on Matrix Analysis and Applications 17, 1996). The order is fixed before any
//! value is known; whoever computes the factors has to see to it that pivots are good. Long chains are eliminated from both
//! ends, see [`height`].

use super::{Matching, Pattern, height};
use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

/// Matrices of up to this many rows are better treated as full ones,
const SMALL: usize = 12;
/// and those for which a full one takes less than this many times the operations.
const GAIN: u64 = 4;

/// The order of an elimination, and the entries of its factors `L U`: ones stand on the diagonal of `L`. A *place* is a
/// position in the order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SymbolicFactors {
    /// The row that stands in each place.
    pub rows: Vec<u32>,
    /// The column that stands in each place.
    pub columns: Vec<u32>,
    /// Whether rows are exchanged for one another an odd number of times.
    pub odd: bool,
    /// The entries of `L` left of the diagonal, by place.
    pub lower: Pattern,
    /// The entries of `U` right of the diagonal, by place.
    pub upper: Pattern,
    /// The entries of the matrix, rows and columns by place.
    pub matrix: Pattern,
    /// For each entry in the pattern of the matrix its number there.
    pub positions: Vec<u32>,
}

impl SymbolicFactors {
    /// The factors of a matrix with this pattern, if that is large and they are sparse; `None` too if it is singular
    /// whatever its entries are.
    pub fn of_large(pattern: &Pattern) -> Option<SymbolicFactors> {
        SymbolicFactors::of_large_within(pattern, u64::MAX)
    }

    /// The same; `None` too if rows take off more than so many operations from others, which is found out on the way.
    pub fn of_large_within(pattern: &Pattern, most: u64) -> Option<SymbolicFactors> {
        if pattern.size() <= SMALL {
            return None;
        }
        let full = full_operations(pattern.size());
        let factors = SymbolicFactors::within(pattern, most.min(full / GAIN))?;
        (GAIN * factors.operations() < full).then(|| factors.lowered(pattern))
    }

    /// The factors of a matrix with this pattern; `None` if it is singular whatever its entries are.
    pub fn new(pattern: &Pattern) -> Option<SymbolicFactors> {
        SymbolicFactors::within(pattern, u64::MAX)
    }

    /// The same; `None` too if rows take off more than so many operations from others, which is found out on the way.
    fn within(pattern: &Pattern, most: u64) -> Option<SymbolicFactors> {
        let row_of = matched(pattern)?;
        let order = minimum_degree(pattern, &row_of);
        SymbolicFactors::ordered(pattern, (&row_of, &order), most)
    }

    /// The factors in an order of the same fill in which fewer steps wait for each other, if long chains of them do.
    fn lowered(self, pattern: &Pattern) -> SymbolicFactors {
        if 2 * self.height() < self.rows.len() {
            return self;
        }
        let mut row_of = vec![0; self.rows.len()];
        self.rows.iter().zip(&self.columns).for_each(|(&row, &column)| row_of[column as usize] = row as usize);
        let steps = height::lower(&filled(pattern, &row_of, &self));
        let order = steps.map(|steps| steps.into_iter().map(|place| self.columns[place] as usize).collect::<Vec<_>>());
        let other = order.and_then(|order| SymbolicFactors::ordered(pattern, (&row_of, &order), u64::MAX));
        other.filter(|other| other.operations() <= self.operations()).unwrap_or(self)
    }

    /// The same in this order of columns, each with its row.
    fn ordered(pattern: &Pattern, (row_of, order): (&[usize], &[usize]), most: u64) -> Option<SymbolicFactors> {
        let mut place_of = vec![0; order.len()];
        order.iter().enumerate().for_each(|(place, &column)| place_of[column] = place);
        let (mut lower, mut upper, mut matrix) = (Vec::new(), Vec::<Vec<usize>>::new(), Vec::new());
        let (mut positions, mut known) = (vec![0; pattern.len()], 0..);
        let (mut fill, mut operations) = (Fill::new(order.len()), 0);
        for (place, &column) in order.iter().enumerate() {
            let row = row_of[column];
            let mut own: Vec<(usize, usize)> =
                pattern.row(row).map(|e| (place_of[pattern.columns()[e] as usize], e)).collect();
            own.sort_unstable();
            own.iter().zip(known.by_ref()).for_each(|(e, number)| positions[e.1] = number);
            let (before, after) = fill.row(own.iter().map(|e| e.0), place, &upper);
            operations += before.iter().map(|&k| 1 + 2 * upper[k].len() as u64).sum::<u64>();
            if operations > most {
                return None;
            }
            lower.push(before);
            upper.push(after);
            matrix.push(own.into_iter().map(|e| e.0).collect::<Vec<_>>());
        }
        let rows = order.iter().map(|&column| row_of[column] as u32).collect();
        Some(SymbolicFactors {
            rows,
            columns: order.iter().map(|&column| column as u32).collect(),
            odd: is_odd(row_of),
            lower: Pattern::new(lower),
            upper: Pattern::new(upper),
            matrix: Pattern::new(matrix),
            positions,
        })
    }

    /// The most steps of elimination that wait for each other.
    fn height(&self) -> usize {
        let mut height = vec![1; self.rows.len()];
        for place in 0..self.rows.len() {
            if let Some(&next) = self.upper.columns_of(place).first() {
                height[next as usize] = height[next as usize].max(height[place] + 1);
            }
        }
        height.into_iter().max().unwrap_or(0)
    }

    /// For each entry of `L` the one of `U` that mirrors it: of a symmetric pattern with a full diagonal, whose rows and
    /// columns have one order.
    pub fn mirror(&self) -> Option<Vec<u32>> {
        if self.rows != self.columns || self.lower.len() != self.upper.len() {
            return None;
        }
        let whole = (0..self.rows.len()).all(|place| self.matrix.entry(place, place).is_some());
        let mirrored = self.lower.places().map(|(row, column)| self.upper.entry(column, row).map(|e| e as u32));
        if whole { mirrored.collect() } else { None }
    }

    /// Additions and products to factor the matrix, to solve with the factors and to refine the solution once.
    pub fn operations(&self) -> u64 {
        let rows = self.lower.columns().iter().map(|&k| 1 + 2 * self.upper.columns_of(k as usize).len() as u64);
        let factors = 2 * (self.lower.len() + self.upper.len() + self.rows.len());
        rows.sum::<u64>() + 2 * factors as u64 + 2 * self.matrix.len() as u64
    }
}

/// Additions and products to solve equations with a full matrix of `n` rows once.
pub fn full_operations(n: usize) -> u64 {
    let n = n as u64;
    2 * n * n * n / 3 + 6 * n * n
}

/// A row for each column: its own, as far as there is an entry on the diagonal.
fn matched(pattern: &Pattern) -> Option<Vec<usize>> {
    let n = pattern.size();
    let edges: Vec<Vec<usize>> =
        (0..n).map(|row| pattern.columns_of(row).iter().map(|&c| c as usize).collect()).collect();
    let mut matching = Matching::new(n);
    (0..n).filter(|&i| pattern.entry(i, i).is_some()).for_each(|i| matching.join(i, i));
    matching.complete(&edges);
    matching.row_of.into_iter().collect()
}

/// Columns in an order of approximate minimum degree, each with its row.
fn minimum_degree(pattern: &Pattern, row_of: &[usize]) -> Vec<usize> {
    let mut starts = vec![0isize];
    let mut columns: Vec<isize> = Vec::with_capacity(pattern.len());
    for &row in row_of {
        columns.extend(pattern.columns_of(row).iter().map(|&column| column as isize));
        starts.push(columns.len() as isize);
    }
    let found = amd::order(row_of.len() as isize, &starts, &columns, &amd::Control::default());
    let (order, _, _) = found.expect("the pattern of a matrix");
    order.into_iter().map(|column| column as usize).collect()
}

/// Where a symmetric matrix that has these entries and their mirror images would be filled: for each place those behind it.
fn filled(pattern: &Pattern, row_of: &[usize], factors: &SymbolicFactors) -> Vec<Vec<usize>> {
    let n = row_of.len();
    let mut place_of = vec![0; n];
    factors.columns.iter().enumerate().for_each(|(place, &column)| place_of[column as usize] = place);
    let mut before: Vec<Vec<usize>> = vec![Vec::new(); n];
    let mut behind: Vec<Vec<usize>> = vec![Vec::new(); n];
    for (place, &column) in factors.columns.iter().enumerate() {
        for &other in pattern.columns_of(row_of[column as usize]) {
            let other = place_of[other as usize];
            let (first, last) = (place.min(other), place.max(other));
            before[last].push(first);
            behind[first].push(last);
        }
    }
    let mut upper: Vec<Vec<usize>> = Vec::with_capacity(n);
    let mut fill = Fill::new(n);
    for place in 0..n {
        let own = before[place].iter().chain(&behind[place]).copied();
        upper.push(fill.row(own, place, &upper).1);
    }
    upper
}

/// What elimination makes of the columns of rows.
struct Fill {
    /// For each column the last row that has it.
    seen: Vec<usize>,
    /// Columns before the place of the row that are still to be eliminated.
    open: BinaryHeap<Reverse<usize>>,
}

impl Fill {
    fn new(size: usize) -> Fill {
        Fill { seen: vec![usize::MAX; size], open: BinaryHeap::new() }
    }

    /// The columns of a row before its own place, and those behind it, ascending.
    fn row(
        &mut self,
        columns: impl Iterator<Item = usize>,
        place: usize,
        upper: &[Vec<usize>],
    ) -> (Vec<usize>, Vec<usize>) {
        let (mut before, mut after) = (Vec::new(), Vec::new());
        columns.for_each(|column| self.meet(column, place, &mut after));
        while let Some(Reverse(k)) = self.open.pop() {
            upper[k].iter().for_each(|&column| self.meet(column, place, &mut after));
            before.push(k);
        }
        after.sort_unstable();
        (before, after)
    }

    fn meet(&mut self, column: usize, place: usize, after: &mut Vec<usize>) {
        if std::mem::replace(&mut self.seen[column], place) == place {
            return;
        }
        match column.cmp(&place) {
            Ordering::Less => self.open.push(Reverse(column)),
            Ordering::Equal => {}
            Ordering::Greater => after.push(column),
        }
    }
}

/// Whether a permutation is made of an odd number of exchanges.
fn is_odd(permutation: &[usize]) -> bool {
    let mut seen = vec![false; permutation.len()];
    let mut odd = false;
    for start in 0..permutation.len() {
        let mut at = start;
        while !std::mem::replace(&mut seen[at], true) {
            at = permutation[at];
            odd ^= at != start;
        }
    }
    odd
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Nodes of a square net, each joined to its neighbours.
    fn net(n: usize) -> Pattern {
        let near = move |a: usize, b: usize| {
            let ((i, j), (k, l)) = ((a / n, a % n), (b / n, b % n));
            i.abs_diff(k) + j.abs_diff(l) <= 1
        };
        Pattern::new((0..n * n).map(|a| (0..n * n).filter(move |&b| near(a, b))))
    }

    #[test]
    fn a_chain_fills_nothing_in() {
        let n = 100;
        let chain = Pattern::new((0..n).map(|i: usize| i.saturating_sub(1)..n.min(i + 2)));
        let factors = SymbolicFactors::of_large(&chain).expect("it is large");
        assert_eq!((factors.lower.len(), factors.upper.len()), (n - 1, n - 1));
        assert!(!factors.odd);
    }

    #[test]
    fn a_chain_is_eliminated_from_both_ends() {
        let n = 100;
        let chain = Pattern::new((0..n).map(|i: usize| i.saturating_sub(1)..n.min(i + 2)));
        let factors = SymbolicFactors::of_large(&chain).expect("it is large");
        assert!(factors.height() <= n / 2 + 2);
    }

    #[test]
    fn a_net_costs_less_than_its_square() {
        let costs: Vec<u64> =
            [10, 20, 40].iter().map(|&n| SymbolicFactors::new(&net(n)).expect("regular").operations()).collect();
        // Twice as wide: eight times at best, sixteen times as a band.
        assert!(costs.windows(2).all(|c| c[1] < 11 * c[0]), "{costs:?}");
    }

    #[test]
    fn rows_are_exchanged_where_the_diagonal_is_empty() {
        let swap = Pattern::new([vec![1], vec![0]]);
        let factors = SymbolicFactors::new(&swap).expect("regular");
        assert!(factors.odd);
        assert!(factors.rows.iter().zip(&factors.columns).all(|(row, column)| row + column == 1));
        assert_eq!(SymbolicFactors::new(&Pattern::new([vec![0], vec![0]])), None);
        assert!(!is_odd(&[1, 2, 0]) && is_odd(&[0, 2, 1]));
    }

    #[test]
    fn full_and_small_ones_are_left() {
        assert_eq!(SymbolicFactors::of_large(&Pattern::new((0..60).map(|_| 0..60))), None);
        assert_eq!(SymbolicFactors::of_large(&net(3)), None);
        assert!(SymbolicFactors::of_large(&net(10)).is_some());
    }
}
