//! Sparse exact elimination, over expressions or over their values in a prime field.
//!
//! Pivots are taken class by class; within a class the simplest first (1 and -1, other numbers, parameters, what
//! depends on the state), then those that fill in least. Where a point is given, a pivot that varies and is small there
//! beside the rest of its row comes last.

use super::evaluate::Evaluator;
use super::exprs::{Exprs, MINUS_ONE, ONE, ZERO};
use super::node::{Expr, Node, Symbol};
use crate::ids::Map;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};
use std::fmt;

use rustc_hash::{FxHashMap, FxHashSet};

/// A linear relation: the sum of coefficient times column is zero. Sorted by column; no coefficient is zero.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct SparseRow<E = Expr>(pub Vec<(usize, E)>);

/// A column expressed by a row.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pivot<E = Expr> {
    /// The column.
    pub column: usize,
    /// The row, divided so that the coefficient of the column is 1.
    pub row: SparseRow<E>,
    /// What it was divided by.
    pub divisor: E,
    /// Which of the rows it was, before other pivots were taken off it.
    pub source: usize,
}

/// What elimination leaves.
#[derive(Debug, Clone)]
pub struct Elimination<E = Expr> {
    /// In the order of elimination: a row may hold the columns of later pivots, never of earlier ones.
    pub pivots: Vec<Pivot<E>>,
    /// The rows without a column of any class.
    pub rest: Vec<SparseRow<E>>,
    /// Divisors that are not known to be nonzero: they are watched while the program runs.
    pub watched: Vec<E>,
    /// Coefficients that are zero at the given parameters though not in general, taken as zero.
    pub degenerate: Vec<E>,
}

impl<E> Default for Elimination<E> {
    fn default() -> Self {
        Elimination { pivots: Vec::new(), rest: Vec::new(), watched: Vec::new(), degenerate: Vec::new() }
    }
}

/// How good a pivot is: less is better.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Quality {
    /// 1 or -1.
    Unit,
    /// Another number, or a value that nothing more is known of than that it is not zero.
    Number,
    /// Of parameters, known to be nonzero.
    Parameters,
    /// It varies, and is known to be nonzero.
    Nonzero,
    /// Of parameters, not known to be nonzero.
    DoubtfulParameters,
    /// It varies, and is not known to be nonzero.
    Doubtful,
    /// It is small at the point where pivots should not be.
    Vanishing,
}

/// Whether a coefficient is zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Zero {
    /// It is not.
    No,
    /// At the given parameters, though not in general.
    Given,
    /// Always.
    Always,
}

/// What elimination computes with: a pool of expressions, or a prime field.
pub trait Coefficients {
    /// A coefficient.
    type Entry: Copy + PartialEq + fmt::Debug;
    /// The coefficient 1.
    const ONE: Self::Entry;
    /// Whether it is zero.
    fn zero(&self, e: Self::Entry) -> Zero;
    /// How good a pivot it is, and how long it is written.
    fn quality(&self, e: Self::Entry) -> (Quality, u32);
    /// Whether it is small at a point, beside the greatest of its row.
    fn is_small(&self, point: &mut NumericPoint, row: &[(usize, Self::Entry)], e: Self::Entry) -> bool;
    /// It is taken as a pivot of this quality: what it is known by counts from now on, or it is watched, in this form.
    fn take_pivot(&mut self, e: Self::Entry, quality: Quality) -> Option<Self::Entry>;
    /// The sum.
    fn plus(&mut self, a: Self::Entry, b: Self::Entry) -> Self::Entry;
    /// The product.
    fn times(&mut self, a: Self::Entry, b: Self::Entry) -> Self::Entry;
    /// With its sign reversed.
    fn minus(&mut self, e: Self::Entry) -> Self::Entry;
    /// 1 divided by what is not zero.
    fn inverse(&mut self, e: Self::Entry) -> Self::Entry;
}

impl Coefficients for Exprs {
    type Entry = Expr;
    const ONE: Expr = ONE;

    fn zero(&self, e: Expr) -> Zero {
        if self.is_number(e).is_some() {
            return if e == ZERO { Zero::Always } else { Zero::No };
        }
        match (self.is_zero(e), self.is_zero_given(e)) {
            (true, _) => Zero::Always,
            (false, true) => Zero::Given,
            (false, false) => Zero::No,
        }
    }

    fn quality(&self, e: Expr) -> (Quality, u32) {
        if e == ONE || e == MINUS_ONE {
            return (Quality::Unit, 0);
        }
        if matches!(self.node(e), Node::Number(_)) {
            return (Quality::Number, 0);
        }
        let varies = self.depends_on_any(e, &|s| self.facts(s).given.is_none());
        let quality = match (varies, self.is_known_nonzero(e)) {
            (false, true) => Quality::Parameters,
            (true, true) => Quality::Nonzero,
            (false, false) => Quality::DoubtfulParameters,
            (true, false) => Quality::Doubtful,
        };
        (quality, self.entry(e).size)
    }

    fn is_small(&self, point: &mut NumericPoint, row: &[(usize, Expr)], e: Expr) -> bool {
        let own = point.value(self, e).abs();
        let most = row.iter().map(|&(_, e)| point.value(self, e).abs()).fold(0.0, nan_or_greater);
        own < SMALL * most || own == 0.0 || most.is_nan()
    }

    fn take_pivot(&mut self, e: Expr, quality: Quality) -> Option<Expr> {
        if quality < Quality::DoubtfulParameters {
            let _ = self.nonzero(e);
            return None;
        }
        self.assume_nonzero(e);
        // What is defined may be written shorter.
        let short = self.simplify(e);
        self.assume_nonzero(short);
        Some(short)
    }

    fn plus(&mut self, a: Expr, b: Expr) -> Expr {
        let sum = self.add(&[a, b]);
        if self.is_number(sum).is_some() { sum } else { self.bounded(sum) }
    }

    fn times(&mut self, a: Expr, b: Expr) -> Expr {
        self.mul(&[a, b])
    }

    fn minus(&mut self, e: Expr) -> Expr {
        self.neg(e)
    }

    fn inverse(&mut self, e: Expr) -> Expr {
        self.recip(e)
    }
}

/// A pivot that varies is small at a point below this fraction of the greatest entry of its row there.
const SMALL: f64 = 1e-2;

/// A point: values of symbols, and of the expressions that have been asked for.
#[derive(Debug, Clone, Default)]
pub struct NumericPoint {
    symbols: Map<Symbol, f64>,
    known: FxHashMap<Expr, f64>,
}

impl NumericPoint {
    /// Where the symbols have these values, and all others 1.
    pub fn new(symbols: Map<Symbol, f64>) -> NumericPoint {
        NumericPoint { symbols, known: FxHashMap::default() }
    }

    /// Moves the point.
    pub fn set(&mut self, values: impl IntoIterator<Item = (Symbol, f64)>) {
        self.symbols.extend(values);
        self.known.clear();
    }

    /// Says where the point is in a direction that no value so far depends on.
    pub fn place(&mut self, symbol: Symbol, value: f64) {
        self.symbols.insert(symbol, value);
    }

    /// The value of a symbol there.
    pub fn of(&self, symbol: Symbol) -> f64 {
        self.symbols.get(&symbol).copied().unwrap_or(1.0)
    }

    /// The value of an expression there; NaN where it is not defined.
    pub fn value(&mut self, x: &Exprs, e: Expr) -> f64 {
        let symbols = &self.symbols;
        let mut of = |s: Symbol| symbols.get(&s).copied().unwrap_or(1.0);
        let mut values = Evaluator::knowing(x, &mut of, std::mem::take(&mut self.known));
        let value = values.value(e);
        self.known = values.into_known();
        value
    }
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
pub fn eliminate<A: Coefficients>(
    x: &mut A,
    rows: Vec<SparseRow<A::Entry>>,
    classes: &[Vec<usize>],
) -> Elimination<A::Entry> {
    let mut work = Eliminator::new(x, rows, classes.iter().flatten().copied().max().map_or(0, |c| c + 1));
    for class in classes {
        work.eliminate(x, class);
    }
    work.finish()
}

/// An elimination under way, for those who choose the next class by what the last ones have left.
#[derive(Debug)]
pub struct Eliminator<A: Coefficients = Exprs> {
    rows: Vec<Vec<(usize, A::Entry)>>,
    active: Vec<bool>,
    /// The rows of a column; some may have lost it since, or stand there twice.
    column_rows: Vec<Vec<u32>>,
    /// Counts changes of a column, so that old entries of the heap are recognised.
    stamps: Vec<u32>,
    /// Where pivots should not be small.
    point: Option<NumericPoint>,
    /// Room for the next row.
    spare: Vec<(usize, A::Entry)>,
    done: Elimination<A::Entry>,
}

/// Quality, fill, column; then row and stamp. `row` is `None` as long as the entry is a lower bound.
type Candidate = Reverse<(Quality, usize, usize, u32, Option<u32>)>;

impl<A: Coefficients> Eliminator<A> {
    /// A system of rows over at least this many columns.
    pub fn new(x: &A, rows: Vec<SparseRow<A::Entry>>, columns: usize) -> Eliminator<A> {
        let columns = rows.iter().flat_map(|r| r.0.iter().map(|e| e.0 + 1)).max().unwrap_or(0).max(columns);
        let mut work = Eliminator {
            rows: Vec::with_capacity(rows.len()),
            active: vec![true; rows.len()],
            column_rows: vec![Vec::new(); columns],
            stamps: vec![0; columns],
            point: None,
            spare: Vec::new(),
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

    /// The same, with pivots that are not small at a point, where one is given, as far as there are any.
    pub fn near(mut self, point: impl Into<Option<NumericPoint>>) -> Eliminator<A> {
        self.point = point.into();
        self
    }

    /// The point again, with the values that were found there.
    pub fn take_point(&mut self) -> Option<NumericPoint> {
        self.point.take()
    }

    /// Whether a coefficient counts as zero.
    fn vanishes(&mut self, x: &A, e: A::Entry) -> bool {
        let zero = x.zero(e);
        if zero == Zero::Given {
            self.done.degenerate.push(e);
        }
        zero != Zero::No
    }

    /// Eliminates the columns of one class as far as rows hold them; gives the number of pivots.
    pub fn eliminate(&mut self, x: &mut A, columns: &[usize]) -> usize {
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
            self.decide(x, row as usize, column, quality);
            for touched in self.eliminate_column(x, row as usize, column) {
                self.stamps[touched] += 1;
                if open.contains(&touched) {
                    heap.push(self.bound(touched));
                }
            }
        }
        self.done.pivots.len() - before
    }

    /// Eliminates a column by a row that holds it.
    pub fn eliminate_by(&mut self, x: &mut A, column: usize, row: u32) {
        if let Some(e) = coefficient(&self.rows[row as usize], column) {
            self.decide(x, row as usize, column, x.quality(e).0);
        }
        for touched in self.eliminate_column(x, row as usize, column) {
            self.stamps[touched] += 1;
        }
    }

    /// What a column would be divided by if it were eliminated next; `None` if no row holds it.
    pub fn divisor(&mut self, x: &A, column: usize) -> Option<A::Entry> {
        let Reverse((.., row)) = self.best_row(x, column)?;
        coefficient(&self.rows[row? as usize], column)
    }

    fn bound(&self, column: usize) -> Candidate {
        let fill = self.column_rows[column].len().saturating_sub(1);
        Reverse((Quality::Unit, fill, column, self.stamps[column], None))
    }

    /// The best row to express the column by.
    fn best_row(&mut self, x: &A, column: usize) -> Option<Candidate> {
        let list = self.rows_of(column);
        let others = list.len().saturating_sub(1);
        let rows = &self.rows;
        let point = &mut self.point;
        let rated = list.iter().filter_map(|&r| {
            let row = &rows[r as usize];
            let e = coefficient(row, column)?;
            let (quality, size) = x.quality(e);
            let small = quality >= Quality::Nonzero && point.as_mut().is_some_and(|point| x.is_small(point, row, e));
            Some((if small { Quality::Vanishing } else { quality }, size, others * row.len(), r))
        });
        let (quality, _, fill, row) = rated.min()?;
        Some(Reverse((quality, fill, column, self.stamps[column], Some(row))))
    }

    /// The rows that hold a column.
    fn rows_of(&mut self, column: usize) -> Vec<u32> {
        let (active, rows) = (&self.active, &self.rows);
        self.column_rows[column].sort_unstable();
        self.column_rows[column].dedup();
        self.column_rows[column].retain(|&r| active[r as usize] && coefficient(&rows[r as usize], column).is_some());
        self.column_rows[column].clone()
    }

    /// A pivot is taken, and watched if need be.
    fn decide(&mut self, x: &mut A, row: usize, column: usize, quality: Quality) {
        let Some(e) = coefficient(&self.rows[row], column) else { return };
        self.done.watched.extend(x.take_pivot(e, quality));
    }

    /// Makes the row the pivot of the column and takes the column out of all other rows; the columns that changed.
    fn eliminate_column(&mut self, x: &mut A, row: usize, column: usize) -> Vec<usize> {
        let mut pivot = std::mem::take(&mut self.rows[row]);
        self.active[row] = false;
        let divisor = coefficient(&pivot, column).unwrap_or(A::ONE);
        if divisor != A::ONE {
            let inverse = x.inverse(divisor);
            for (c, e) in &mut pivot {
                *e = if *c == column { A::ONE } else { x.times(*e, inverse) };
            }
        }
        let touched = pivot.iter().map(|e| e.0).filter(|&c| c != column).collect();
        for other in std::mem::take(&mut self.column_rows[column]) {
            if self.active[other as usize] {
                self.subtract(x, other as usize, &pivot, column);
            }
        }
        self.done.pivots.push(Pivot { column, row: SparseRow(pivot), divisor, source: row });
        touched
    }

    /// Takes the pivot's column out of a row, which may have lost it already.
    fn subtract(&mut self, x: &mut A, other: usize, pivot: &[(usize, A::Entry)], column: usize) {
        let Ok(at) = self.rows[other].binary_search_by_key(&column, |e| e.0) else { return };
        let row = std::mem::take(&mut self.rows[other]);
        let minus = x.minus(row[at].1);
        let mut reduced = std::mem::take(&mut self.spare);
        reduced.clear();
        reduced.reserve(row.len() + pivot.len());
        // Rows may be long: what stands between two entries of the pivot is taken over in one go.
        let own = pivot.partition_point(|e| e.0 < column);
        for (mut rest, entries) in [(&row[..at], &pivot[..own]), (&row[at + 1..], &pivot[own + 1..])] {
            for &(c, e) in entries {
                let run = rest.iter().take_while(|e| e.0 < c).count();
                reduced.extend_from_slice(&rest[..run]);
                let before = rest.get(run).filter(|e| e.0 == c).map(|e| e.1);
                rest = &rest[run + usize::from(before.is_some())..];
                let change = x.times(minus, e);
                let after = before.map_or(change, |before| x.plus(before, change));
                if !self.vanishes(x, after) {
                    reduced.push((c, after));
                    if before.is_none() {
                        self.column_rows[c].push(other as u32);
                    }
                }
            }
            reduced.extend_from_slice(rest);
        }
        self.rows[other] = reduced;
        self.spare = row;
    }

    /// What has been eliminated, and what is left.
    pub fn finish(mut self) -> Elimination<A::Entry> {
        let rows = self.rows.into_iter().zip(&self.active);
        self.done.rest = rows.filter(|(r, active)| **active && !r.is_empty()).map(|(r, _)| SparseRow(r)).collect();
        self.done
    }
}

impl Eliminator {
    /// The row in which a column weighs most at the point, beside the other columns that have a weight, and how much: 1
    /// or less, where another one is greater. `None` if no row holds the column with a value that is finite and not 0.
    pub fn heaviest(&mut self, x: &Exprs, column: usize, weights: &BTreeMap<usize, f64>) -> Option<(f64, u32)> {
        let mut point = self.point.take()?;
        let mut best: Option<(f64, u32)> = None;
        for r in self.rows_of(column) {
            let row = &self.rows[r as usize];
            let mut size = |&(c, e): &(usize, Expr)| weights.get(&c).map_or(0.0, |w| (w * point.value(x, e)).abs());
            let own = row.iter().find(|entry| entry.0 == column).map_or(0.0, &mut size);
            let most = row.iter().filter(|entry| entry.0 != column).map(size).fold(own, nan_or_greater);
            let share = own / most;
            if own > 0.0 && share.is_finite() && best.is_none_or(|(known, _)| share > known) {
                best = Some((share, r));
            }
        }
        self.point = Some(point);
        best
    }
}

fn coefficient<E: Copy>(row: &[(usize, E)], column: usize) -> Option<E> {
    row.binary_search_by_key(&column, |e| e.0).ok().map(|i| row[i].1)
}

fn nan_or_greater(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }
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
