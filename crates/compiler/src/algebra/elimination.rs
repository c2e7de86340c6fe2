//! Sparse exact elimination.
//!
//! Pivots are taken class by class; within a class the simplest first (1 and -1, other numbers, parameters, what
//! depends on the state), then those that fill in least.

use super::exprs::{Exprs, MINUS_ONE, ONE, ZERO};
use super::node::{Expr, Node};
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

use rustc_hash::FxHashSet;

/// A linear relation: the sum of coefficient times column is zero. Sorted by column; no coefficient is zero.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct SparseRow(pub Vec<(usize, Expr)>);

/// A column expressed by a row.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pivot {
    /// The column.
    pub column: usize,
    /// The row, divided so that the coefficient of the column is 1.
    pub row: SparseRow,
    /// What it was divided by.
    pub divisor: Expr,
}

/// What elimination leaves.
#[derive(Debug, Clone, Default)]
pub struct Elimination {
    /// In the order of elimination: a row may hold the columns of later pivots, never of earlier ones.
    pub pivots: Vec<Pivot>,
    /// The rows without a column of any class.
    pub rest: Vec<SparseRow>,
    /// Divisors that are not known to be nonzero: they are watched while the program runs.
    pub watched: Vec<Expr>,
    /// Coefficients that are zero at the given parameters though not in general, taken as zero.
    pub degenerate: Vec<Expr>,
}

/// How good a pivot is: less is better.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Quality {
    Unit,
    Number,
    Parameters,
    Nonzero,
    DoubtfulParameters,
    Doubtful,
}

/// Eliminates columns from rows. `classes` are the columns that may be pivots, those of an earlier class first; other
/// columns stay.
///
/// ```
/// use halfarrow_compiler::algebra::{eliminate, Exprs, SparseRow};
/// let mut x = Exprs::default();
/// let (one, two) = (x.int(1), x.int(2));
/// let rows = vec![SparseRow(vec![(0, one), (1, two)]), SparseRow(vec![(0, one), (2, one)])];
/// let done = eliminate(&mut x, rows, &[vec![0, 1]]);
/// assert_eq!(done.pivots.len(), 2);
/// ```
pub fn eliminate(x: &mut Exprs, rows: Vec<SparseRow>, classes: &[Vec<usize>]) -> Elimination {
    let mut work = Eliminator::new(x, rows, classes.iter().flatten().copied().max().map_or(0, |c| c + 1));
    for class in classes {
        work.eliminate(x, class);
    }
    work.finish()
}

/// An elimination under way, for those who choose the next class by what the last ones have left.
#[derive(Debug, Clone)]
pub struct Eliminator {
    rows: Vec<Vec<(usize, Expr)>>,
    active: Vec<bool>,
    /// The rows of a column; some may have lost it since, or stand there twice.
    column_rows: Vec<Vec<u32>>,
    /// Counts changes of a column, so that old entries of the heap are recognised.
    stamps: Vec<u32>,
    done: Elimination,
}

/// Quality, fill, column; then row and stamp. `row` is `None` as long as the entry is a lower bound.
type Candidate = Reverse<(Quality, usize, usize, u32, Option<u32>)>;

impl Eliminator {
    /// A system of rows over at least this many columns.
    pub fn new(x: &mut Exprs, rows: Vec<SparseRow>, columns: usize) -> Eliminator {
        let columns = rows.iter().flat_map(|r| r.0.iter().map(|e| e.0 + 1)).max().unwrap_or(0).max(columns);
        let mut work = Eliminator {
            rows: Vec::with_capacity(rows.len()),
            active: vec![true; rows.len()],
            column_rows: vec![Vec::new(); columns],
            stamps: vec![0; columns],
            done: Elimination::default(),
        };
        for (i, row) in rows.into_iter().enumerate() {
            let mut kept = row.0;
            kept.retain(|&(_, e)| !work.vanishes(x, e));
            kept.iter().for_each(|&(c, _)| work.column_rows[c].push(i as u32));
            work.rows.push(kept);
        }
        work
    }

    /// Whether a coefficient counts as zero.
    fn vanishes(&mut self, x: &Exprs, e: Expr) -> bool {
        if x.is_number(e).is_some() {
            return e == ZERO;
        }
        if x.is_zero(e) {
            return true;
        }
        let degenerate = x.is_zero_given(e);
        if degenerate {
            self.done.degenerate.push(e);
        }
        degenerate
    }

    /// Eliminates the columns of one class as far as rows hold them; gives the number of pivots.
    pub fn eliminate(&mut self, x: &mut Exprs, columns: &[usize]) -> usize {
        let before = self.done.pivots.len();
        let mut open: FxHashSet<usize> = columns.iter().copied().collect();
        let mut heap: BinaryHeap<Candidate> = columns.iter().map(|&c| self.bound(c)).collect();
        while let Some(Reverse((quality, _, column, stamp, row))) = heap.pop() {
            if !open.contains(&column) || stamp != self.stamps[column] {
                continue;
            }
            let Some(row) = row else {
                if let Some(exact) = self.best_row(x, column) {
                    heap.push(exact);
                }
                continue;
            };
            open.remove(&column);
            if quality >= Quality::DoubtfulParameters {
                self.watch(x, row as usize, column);
            }
            for touched in self.eliminate_column(x, row as usize, column) {
                self.stamps[touched] += 1;
                if open.contains(&touched) {
                    heap.push(self.bound(touched));
                }
            }
        }
        self.done.pivots.len() - before
    }

    /// What a column would be divided by if it were eliminated next; `None` if no row holds it.
    pub fn divisor(&mut self, x: &Exprs, column: usize) -> Option<Expr> {
        let Reverse((.., row)) = self.best_row(x, column)?;
        coefficient(&self.rows[row? as usize], column)
    }

    fn bound(&self, column: usize) -> Candidate {
        let fill = self.column_rows[column].len().saturating_sub(1);
        Reverse((Quality::Unit, fill, column, self.stamps[column], None))
    }

    /// The best row to express the column by.
    fn best_row(&mut self, x: &Exprs, column: usize) -> Option<Candidate> {
        let (active, rows) = (&self.active, &self.rows);
        self.column_rows[column].sort_unstable();
        self.column_rows[column].dedup();
        self.column_rows[column].retain(|&r| active[r as usize] && coefficient(&rows[r as usize], column).is_some());
        let list = &self.column_rows[column];
        let others = list.len().saturating_sub(1);
        let rated = list.iter().filter_map(|&r| {
            let row = &rows[r as usize];
            let e = coefficient(row, column)?;
            let (quality, size) = quality(x, e);
            Some((quality, size, others * row.len(), r))
        });
        let (quality, _, fill, row) = rated.min()?;
        Some(Reverse((quality, fill, column, self.stamps[column], Some(row))))
    }

    fn watch(&mut self, x: &mut Exprs, row: usize, column: usize) {
        if let Some(e) = coefficient(&self.rows[row], column) {
            x.assume_nonzero(e);
            // What is defined may be written shorter.
            let short = x.simplify(e);
            x.assume_nonzero(short);
            self.done.watched.push(short);
        }
    }

    /// Makes the row the pivot of the column and takes the column out of all other rows; the columns that changed.
    fn eliminate_column(&mut self, x: &mut Exprs, row: usize, column: usize) -> Vec<usize> {
        let mut pivot = std::mem::take(&mut self.rows[row]);
        self.active[row] = false;
        let divisor = coefficient(&pivot, column).unwrap_or(ONE);
        if divisor != ONE {
            let inverse = x.recip(divisor);
            for (c, e) in &mut pivot {
                *e = if *c == column { ONE } else { x.mul(&[*e, inverse]) };
            }
        }
        let touched = pivot.iter().map(|e| e.0).filter(|&c| c != column).collect();
        for other in std::mem::take(&mut self.column_rows[column]) {
            if self.active[other as usize] {
                self.subtract(x, other as usize, &pivot, column);
            }
        }
        self.done.pivots.push(Pivot { column, row: SparseRow(pivot), divisor });
        touched
    }

    /// Takes the pivot's column out of a row, which may have lost it already.
    fn subtract(&mut self, x: &mut Exprs, other: usize, pivot: &[(usize, Expr)], column: usize) {
        let mut row = std::mem::take(&mut self.rows[other]);
        if let Ok(at) = row.binary_search_by_key(&column, |e| e.0) {
            let minus = x.neg(row.remove(at).1);
            for &(c, e) in pivot.iter().filter(|e| e.0 != column) {
                let change = x.mul(&[minus, e]);
                self.add_entry(x, &mut row, c, change, other as u32);
            }
        }
        self.rows[other] = row;
    }

    fn add_entry(&mut self, x: &mut Exprs, row: &mut Vec<(usize, Expr)>, column: usize, change: Expr, id: u32) {
        match row.binary_search_by_key(&column, |e| e.0) {
            Ok(at) => {
                let sum = x.add(&[row[at].1, change]);
                let sum = if x.is_number(sum).is_some() { sum } else { x.simplify(sum) };
                if self.vanishes(x, sum) {
                    row.remove(at);
                } else {
                    row[at].1 = sum;
                }
            }
            Err(at) => {
                if !self.vanishes(x, change) {
                    row.insert(at, (column, change));
                    self.column_rows[column].push(id);
                }
            }
        }
    }

    /// What has been eliminated, and what is left.
    pub fn finish(mut self) -> Elimination {
        let rows = self.rows.into_iter().zip(&self.active);
        self.done.rest = rows.filter(|(r, active)| **active && !r.is_empty()).map(|(r, _)| SparseRow(r)).collect();
        self.done
    }
}

fn coefficient(row: &[(usize, Expr)], column: usize) -> Option<Expr> {
    row.binary_search_by_key(&column, |e| e.0).ok().map(|i| row[i].1)
}

/// How good a pivot is, and how long it is written.
fn quality(x: &Exprs, e: Expr) -> (Quality, u32) {
    if e == ONE || e == MINUS_ONE {
        return (Quality::Unit, 0);
    }
    if matches!(x.node(e), Node::Number(_)) {
        return (Quality::Number, 0);
    }
    let varies = x.depends_on_any(e, &|s| x.facts(s).given.is_none());
    let quality = match (varies, x.nonzero(e)) {
        (false, true) => Quality::Parameters,
        (true, true) => Quality::Nonzero,
        (false, false) => Quality::DoubtfulParameters,
        (true, false) => Quality::Doubtful,
    };
    (quality, x.entry(e).size)
}

/// Columns expressed by those that are no pivots, worked out when asked for and kept.
#[derive(Debug, Clone)]
pub struct BackSubstitution<'a> {
    elimination: &'a Elimination,
    pivot_of: BTreeMap<usize, usize>,
    known: BTreeMap<usize, SparseRow>,
}

/// Expresses pivot columns by the columns that are none.
pub fn back_substitute(elimination: &Elimination) -> BackSubstitution<'_> {
    let pivot_of = elimination.pivots.iter().enumerate().map(|(i, p)| (p.column, i)).collect();
    BackSubstitution { elimination, pivot_of, known: BTreeMap::new() }
}

impl BackSubstitution<'_> {
    /// The column as the sum of coefficient times column over columns that are no pivots; one of these is itself.
    pub fn express(&mut self, x: &mut Exprs, column: usize) -> SparseRow {
        let mut open = vec![column];
        while let Some(&column) = open.last() {
            if self.known.contains_key(&column) {
                open.pop();
                continue;
            }
            let missing = self.missing(column);
            if missing.is_empty() {
                let row = self.combine(x, column);
                self.known.insert(column, row);
                open.pop();
            } else {
                open.extend(missing);
            }
        }
        self.known[&column].clone()
    }

    fn missing(&self, column: usize) -> Vec<usize> {
        let Some(&pivot) = self.pivot_of.get(&column) else { return Vec::new() };
        let row = &self.elimination.pivots[pivot].row.0;
        row.iter().map(|e| e.0).filter(|c| *c != column && !self.known.contains_key(c)).collect()
    }

    fn combine(&self, x: &mut Exprs, column: usize) -> SparseRow {
        let Some(&pivot) = self.pivot_of.get(&column) else { return SparseRow(vec![(column, ONE)]) };
        let mut sums: BTreeMap<usize, Vec<Expr>> = BTreeMap::new();
        for &(c, e) in &self.elimination.pivots[pivot].row.0 {
            if c == column {
                continue;
            }
            let minus = x.neg(e);
            for &(free, coefficient) in &self.known[&c].0 {
                sums.entry(free).or_default().push(x.mul(&[minus, coefficient]));
            }
        }
        let row = sums.into_iter().map(|(c, terms)| (c, x.add(&terms)));
        SparseRow(row.collect::<Vec<_>>().into_iter().filter(|&(_, e)| !x.is_zero(e)).collect())
    }
}
