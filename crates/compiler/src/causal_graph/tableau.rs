//! Exact elimination of the junction structure, one column at a time.

use std::collections::BTreeSet;

use crate::algebra::{Expr, Exprs};

/// The rows that remain of a linear system, and the pivots taken so far. Rows are sorted by column and hold no zero.
pub struct Tableau {
    rows: Vec<Vec<(usize, Expr)>>,
    /// For every column the rows that may hold it (some no longer do).
    holders: Vec<BTreeSet<usize>>,
    /// Column and the row that defines it: `column + Σ entries = 0`.
    pub pivots: Vec<(usize, Vec<(usize, Expr)>)>,
    /// Divisors that are not known to be nonzero.
    pub watched: Vec<Expr>,
    /// Entries that vanish at the given parameters only.
    pub degenerate: Vec<Expr>,
}

impl Tableau {
    /// A system of `rows` over `columns` columns, each row `Σ entries = 0`.
    pub fn new(columns: usize, rows: Vec<Vec<(usize, Expr)>>) -> Self {
        let mut holders = vec![BTreeSet::new(); columns];
        for (r, row) in rows.iter().enumerate() {
            for &(c, _) in row {
                holders[c].insert(r);
            }
        }
        Tableau { rows, holders, pivots: Vec::new(), watched: Vec::new(), degenerate: Vec::new() }
    }

    /// Eliminates these columns, those in few rows first; columns that cannot be eliminated are left alone.
    pub fn eliminate(&mut self, x: &mut Exprs, columns: &[usize]) {
        let mut heap: BTreeSet<(usize, usize)> = columns.iter().map(|&c| (self.holders[c].len(), c)).collect();
        while let Some((count, column)) = heap.pop_first() {
            let now = self.holders[column].len();
            if now > count && heap.first().is_some_and(|&(least, _)| least < now) {
                heap.insert((now, column));
                continue;
            }
            self.pivot(x, column);
        }
    }

    /// Solves one row for this column and removes the column from all others. `false` if no row holds it.
    pub fn pivot(&mut self, x: &mut Exprs, column: usize) -> bool {
        let Some(row) = self.best_row(x, column) else { return false };
        let pivot_row = std::mem::take(&mut self.rows[row]);
        for &(c, _) in &pivot_row {
            self.holders[c].remove(&row);
        }
        let divisor = entry(&pivot_row, column).expect("chosen because it holds the column");
        if x.is_number(divisor).is_none() {
            if !x.nonzero(divisor) {
                self.watched.push(divisor);
            }
            x.assume_nonzero(divisor);
        }
        let inverse = x.recip(divisor);
        let normal: Vec<(usize, Expr)> =
            pivot_row.iter().filter(|(c, _)| *c != column).map(|&(c, e)| (c, tidy(x, &[e, inverse]))).collect();
        for other in std::mem::take(&mut self.holders[column]) {
            let factor = entry(&self.rows[other], column).expect("holders are exact");
            self.subtract(x, other, column, factor, &normal);
        }
        self.pivots.push((column, normal));
        true
    }

    /// The coefficient of a column in the row that would be its pivot, without taking it.
    pub fn candidate(&self, x: &Exprs, column: usize) -> Option<Expr> {
        self.best_row(x, column).and_then(|row| entry(&self.rows[row], column))
    }

    /// The rows that are left.
    pub fn rest(&self) -> impl Iterator<Item = &Vec<(usize, Expr)>> {
        self.rows.iter().filter(|r| !r.is_empty())
    }

    fn best_row(&self, x: &Exprs, column: usize) -> Option<usize> {
        let rank = |&row: &usize| {
            let e = entry(&self.rows[row], column).expect("holders are exact");
            (difficulty(x, e), self.rows[row].len(), row)
        };
        self.holders[column].iter().copied().min_by_key(rank)
    }

    /// `rows[row] -= factor · (column + normal)`.
    fn subtract(&mut self, x: &mut Exprs, row: usize, column: usize, factor: Expr, normal: &[(usize, Expr)]) {
        let old = std::mem::take(&mut self.rows[row]);
        let minus = x.neg(factor);
        let mut new = Vec::with_capacity(old.len() + normal.len());
        let (mut i, mut j) = (0, 0);
        while i < old.len() || j < normal.len() {
            let left = old.get(i).map_or(usize::MAX, |e| e.0);
            let right = normal.get(j).map_or(usize::MAX, |e| e.0);
            if left < right {
                if left != column {
                    new.push(old[i]);
                }
                i += 1;
                continue;
            }
            let product = tidy(x, &[minus, normal[j].1]);
            let value = if left == right {
                i += 1;
                let sum = x.add(&[old[i - 1].1, product]);
                settle(x, sum)
            } else {
                product
            };
            j += 1;
            if self.vanishes(x, value) {
                self.holders[right].remove(&row);
            } else {
                self.holders[right].insert(row);
                new.push((right, value));
            }
        }
        self.rows[row] = new;
    }

    fn vanishes(&mut self, x: &Exprs, e: Expr) -> bool {
        if x.is_zero(e) {
            return true;
        }
        let degenerate = x.is_zero_given(e);
        if degenerate {
            self.degenerate.push(e);
        }
        degenerate
    }
}

fn entry(row: &[(usize, Expr)], column: usize) -> Option<Expr> {
    row.binary_search_by_key(&column, |e| e.0).ok().map(|i| row[i].1)
}

/// How unwelcome an entry is as a divisor: ±1, numbers, known to be nonzero, anything else.
fn difficulty(x: &Exprs, e: Expr) -> u8 {
    match x.is_number(e) {
        Some(n) if n.abs().is_one() => 0,
        Some(_) => 1,
        None if x.nonzero(e) => 2,
        None => 3,
    }
}

fn tidy(x: &mut Exprs, factors: &[Expr]) -> Expr {
    let product = x.mul(factors);
    settle(x, product)
}

/// Brings an entry to its simple form; numbers and symbols are simple already.
fn settle(x: &mut Exprs, e: Expr) -> Expr {
    if x.is_number(e).is_some() { e } else { x.simplify(e) }
}
