//! Relations among states that hold whatever the laws of elements say, and moves that keep them. Moves are integrated by
//! extrapolation of the midpoint rule. Source: [HNW], II.9.
//!
//! A state may go wherever the junction structure lets its rate point, `Σ factor · X' = Σ coefficient · drive`, for any
//! values of the drives. Starting from one state that is a leaf of the states, with fewer dimensions than states where
//! relations hold. Closed forms of the relations are not needed: a direction is carried along the leaf by integrating what
//! of it lies in the leaf.

use super::super::start::ConstraintResidual;
use super::super::{Model, minimum_norm};
use super::FEW_STATES;
use super::open_equations::{Entry, greatest};
use super::tangent::Tangent;
use crate::bytecode::Routine;
use faer::Mat;
use halfarrow_compiler::program::Op;
use std::ops::Range;

/// Singular values below this fraction of the greatest count as zero.
const RANK: f64 = 1e-10;
/// Error of a move, as a part of it.
const ERROR: f64 = 1e-13;
/// Parts of a move, and columns of the extrapolation of one part.
const PARTS: usize = 100;
const COLUMNS: usize = 9;
/// From this column on, a part with more error than this is too long.
const HOPELESS: (usize, f64) = (4, 1e-3);
/// Least part of a move.
const SHORTEST: f64 = 1e-4;
/// Sums below this part of their terms are rounding.
const CANCELLED: f64 = 1e-13;
/// Shares below this of a row in a combination of rows are rounding.
const STANDS: f64 = 1e-12;
/// Magnitudes of states below this part of the greatest are what rounding left.
const NOISE: f64 = 1e-14;

/// The leaf that a state is on.
pub(super) struct Leaf {
    routine: Routine,
    rows: Vec<RelationRow>,
    drives: usize,
    /// The scale of each state.
    pub size: Vec<f64>,
    /// The constraints on displacements, whose closed form is known.
    pub constraints: Vec<ConstraintResidual>,
}

/// Where the values of a row stand among the outputs of the routine: a factor and a quantity in turn; coefficients.
struct RelationRow {
    quantity: Range<usize>,
    /// The state that a quantity is, if it is one.
    state: Vec<Option<usize>>,
    by: Range<usize>,
    drives: Vec<usize>,
}

/// Directions in which states may go: all of them, or the columns of a matrix that are orthonormal where each state counts
/// in parts of its size.
pub(in crate::model) enum Directions {
    /// Every state by itself.
    All,
    /// Row by row, a row for each state.
    Basis { columns: usize, basis: Vec<f64>, size: Vec<f64> },
}

impl Directions {
    /// How many there are.
    pub fn count(&self, states: usize) -> usize {
        match self {
            Directions::All => states,
            Directions::Basis { columns, .. } => *columns,
        }
    }

    /// Derivatives along the directions, from those by the states: row by row.
    pub fn along(&self, jacobian: &[f64], states: usize) -> Vec<f64> {
        let Directions::Basis { columns, basis, size } = self else { return jacobian.to_vec() };
        // What cancels but for rounding is nothing: a row may hold no more.
        let entry = |row: &[f64], k: usize| -> f64 {
            let terms = (0..states).filter(|&j| row[j] != 0.0).map(|j| row[j] * size[j] * basis[j * columns + k]);
            let (sum, most) = terms.fold((0.0, 0.0), |(sum, most): (f64, f64), term| (sum + term, most + term.abs()));
            if sum.abs() > CANCELLED * most { sum } else { 0.0 }
        };
        jacobian.chunks(states.max(1)).flat_map(|row| (0..*columns).map(move |k| entry(row, k))).collect()
    }

    /// The states' part of a step along the directions.
    pub fn step(&self, along: &[f64]) -> Vec<f64> {
        let Directions::Basis { columns, basis, size } = self else { return along.to_vec() };
        let part = |(row, size): (&[f64], &f64)| row.iter().zip(along).map(|(b, a)| b * a).sum::<f64>() * size;
        if *columns == 0 {
            return vec![0.0; size.len()];
        }
        basis.chunks(*columns).zip(size).map(part).collect()
    }

    /// How far a step of the states goes along each way.
    pub fn parts(&self, step: &[f64]) -> Vec<f64> {
        let Directions::Basis { columns, basis, size } = self else { return step.to_vec() };
        let scaled: Vec<f64> = step.iter().zip(size).map(|(s, size)| s / size).collect();
        let part = |k: usize| scaled.iter().enumerate().map(|(j, s)| basis[j * columns + k] * s).sum();
        (0..*columns).map(part).collect()
    }
}

impl Model {
    /// The leaf of `x`, if states keep relations at all.
    pub(super) fn leaf(&mut self, t: f64, x: &[f64]) -> Option<Leaf> {
        self.leaf_by(t, x, |model| model.sizes(t, x))
    }

    /// The same where `own` tells what those states count as one of that stand in no relation.
    fn leaf_by(&mut self, t: f64, x: &[f64], own: impl FnOnce(&mut Model) -> Vec<f64>) -> Option<Leaf> {
        if self.code.program.relations.rows.is_empty() {
            return None;
        }
        let mut wanted = Vec::new();
        let mut rows = Vec::new();
        for row in &self.code.program.relations.rows {
            let first = wanted.len();
            wanted.extend(row.quantity.iter().flat_map(|&(factor, quantity)| [factor, quantity]));
            let second = wanted.len();
            wanted.extend(row.by.iter().map(|b| b.1));
            let state = |&(_, quantity): &(_, _)| match self.code.program.values.op(quantity) {
                Op::State(i) => Some(i as usize),
                _ => None,
            };
            rows.push(RelationRow {
                quantity: first..second,
                state: row.quantity.iter().map(state).collect(),
                by: second..wanted.len(),
                drives: row.by.iter().map(|b| b.0).collect(),
            });
        }
        let routine = self.routine_for(&wanted);
        let mut leaf = Leaf {
            routine,
            rows,
            drives: self.code.program.relations.drives,
            size: vec![1.0; x.len()],
            constraints: self.constraints(),
        };
        let own = own(self);
        leaf.size = match self.structure(&leaf, t, x) {
            Some(rows) => {
                let reached = |(reach, own): (f64, f64)| if reach > 0.0 && reach.is_finite() { reach } else { own };
                rows.reaches().into_iter().zip(own).map(reached).collect()
            }
            None => own,
        };
        Some(leaf)
    }

    /// What each state counts as one of: its magnitude; where nothing but rounding tells it, the least of the others or 1.
    pub(in crate::model) fn sizes(&mut self, t: f64, x: &[f64]) -> Vec<f64> {
        let size = self.magnitudes(t, x);
        let noise = NOISE * size.iter().fold(0.0f64, |most, s| most.max(*s));
        let least = size.iter().copied().filter(|s| *s > noise).fold(f64::INFINITY, f64::min);
        size.into_iter().map(|s| if s > noise { s } else { least.min(1.0) }).collect()
    }

    /// The directions from `x` along its leaf before any magnitude is known. `None` if something has no value there, or if
    /// the leaf is not written out.
    pub(in crate::model) fn first_directions(&mut self, t: f64, x: &[f64]) -> Option<Directions> {
        if self.code.program.relations.unwritten {
            return None;
        }
        let leaf = self.leaf_by(t, x, |_| vec![1.0; x.len()]);
        self.directions(leaf.as_ref(), t, x)
    }

    /// The directions from `x` along the leaf. `None` if something has no value there.
    pub(super) fn directions(&mut self, leaf: Option<&Leaf>, t: f64, x: &[f64]) -> Option<Directions> {
        let Some(leaf) = leaf else { return Some(Directions::All) };
        let n = x.len();
        let kept = kept(&self.tangent(leaf, t, x)?)?;
        // A state in no relation is a direction by itself.
        let (joined, alone): (Vec<usize>, Vec<usize>) =
            (0..n).partition(|&j| (0..kept.nrows()).any(|i| kept[(i, j)] != 0.0));
        let svd = Mat::from_fn(kept.nrows(), joined.len(), |i, a| kept[(i, joined[a])]).svd().ok()?;
        let (values, v) = (svd.S().column_vector(), svd.V());
        let rank = rank_of(&values.iter().copied().collect::<Vec<_>>());
        let columns = n - rank;
        let mut basis = vec![0.0; n * columns];
        alone.iter().enumerate().for_each(|(k, &j)| basis[j * columns + k] = 1.0);
        for (a, &j) in joined.iter().enumerate() {
            // A state that no way moves but by rounding stays.
            let ways = (rank..joined.len()).map(|k| if v[(a, k)].abs() > CANCELLED { v[(a, k)] } else { 0.0 });
            basis[j * columns + alone.len()..][..joined.len() - rank].copy_from_slice(&ways.collect::<Vec<_>>());
        }
        Some(Directions::Basis { columns, basis, size: leaf.size.clone() })
    }

    /// Where `x` comes to along `step`: there, or along the leaf. `None` if the way does not lead so far.
    pub(super) fn moved(&mut self, leaf: Option<&Leaf>, t: f64, x: &[f64], step: &[f64]) -> Option<Vec<f64>> {
        let Some(leaf) = leaf else { return Some(x.iter().zip(step).map(|(x, s)| x + s).collect()) };
        let direction: Vec<f64> = step.iter().zip(&leaf.size).map(|(s, size)| s / size).collect();
        let (mut z, mut gone, mut piece) = (vec![0.0; x.len()], 0.0f64, 1.0f64);
        for _ in 0..PARTS {
            let length = piece.min(1.0 - gone);
            match self.piece(leaf, t, x, &direction, &z, length) {
                Some((next, columns)) => {
                    z = next;
                    gone += length;
                    if 1.0 - gone <= f64::EPSILON {
                        return Some(x.iter().zip(&z).zip(&leaf.size).map(|((x, z), size)| x + z * size).collect());
                    }
                    piece = if columns < COLUMNS - 1 { 2.0 * length } else { length };
                }
                None if length > SHORTEST => piece = 0.25 * length,
                None => return None,
            }
        }
        None
    }

    /// A piece of a move by extrapolation of the midpoint rule, with the number of columns that it took. `None` if it is
    /// too long.
    fn piece(
        &mut self,
        leaf: &Leaf,
        t: f64,
        x: &[f64],
        direction: &[f64],
        z: &[f64],
        length: f64,
    ) -> Option<(Vec<f64>, usize)> {
        let mut table: Vec<Vec<f64>> = Vec::new();
        let first = self.within(leaf, t, x, direction, z)?;
        let whole = length * direction.iter().fold(f64::MIN_POSITIVE, |most, d| most.max(d.abs()));
        for column in 0..COLUMNS {
            let count = 2 * (column + 1);
            let mut row = self.midpoints(leaf, t, x, direction, (z, &first), length, count)?;
            let mut next = Vec::with_capacity(column + 1);
            for (k, before) in table.iter().enumerate() {
                let ratio = count as f64 / (2 * (column - k)) as f64;
                let better: Vec<f64> =
                    row.iter().zip(before).map(|(new, old)| new + (new - old) / (ratio * ratio - 1.0)).collect();
                next.push(std::mem::replace(&mut row, better));
            }
            next.push(row);
            let [.., last, best] = &next[..] else {
                table = next;
                continue;
            };
            let error = last.iter().zip(best).map(|(a, b)| (a - b).abs() / whole).fold(0.0f64, f64::max);
            if error <= ERROR {
                return Some((best.clone(), column));
            }
            if !error.is_finite() || (column >= HOPELESS.0 && error > HOPELESS.1) {
                return None;
            }
            table = next;
        }
        None
    }

    /// The midpoint rule in `count` substeps.
    #[allow(clippy::too_many_arguments, reason = "a point, a direction and a length")]
    fn midpoints(
        &mut self,
        leaf: &Leaf,
        t: f64,
        x: &[f64],
        direction: &[f64],
        (z, first): (&[f64], &[f64]),
        length: f64,
        count: usize,
    ) -> Option<Vec<f64>> {
        let substep = length / count as f64;
        let onward = |z: &[f64], rate: &[f64], by: f64| -> Vec<f64> {
            z.iter().zip(rate).map(|(z, rate)| z + by * rate).collect()
        };
        let (mut before, mut here) = (z.to_vec(), onward(z, first, substep));
        for _ in 1..count {
            let rate = self.within(leaf, t, x, direction, &here)?;
            let next = onward(&before, &rate, 2.0 * substep);
            before = std::mem::replace(&mut here, next);
        }
        Some(here)
    }

    /// What of a direction lies in the leaf at `x + z`.
    fn within(&mut self, leaf: &Leaf, t: f64, x: &[f64], direction: &[f64], z: &[f64]) -> Option<Vec<f64>> {
        let at: Vec<f64> = x.iter().zip(z).zip(&leaf.size).map(|((x, z), size)| x + z * size).collect();
        let rows = self.tangent(leaf, t, &at)?;
        if x.len() > FEW_STATES {
            return rows.within(direction);
        }
        let svd = kept(&rows)?.thin_svd().ok()?;
        let (values, v) = (svd.S().column_vector(), svd.V());
        let mut inside = direction.to_vec();
        for k in 0..rank_of(&values.iter().copied().collect::<Vec<_>>()) {
            let part: f64 = direction.iter().enumerate().map(|(j, d)| v[(j, k)] * d).sum();
            inside.iter_mut().enumerate().for_each(|(j, d)| *d -= v[(j, k)] * part);
        }
        Some(inside)
    }

    /// The moves from `x` that the leaf allows. `None` if something has no value there.
    pub(super) fn tangent(&mut self, leaf: &Leaf, t: f64, x: &[f64]) -> Option<Tangent> {
        Some(self.structure(leaf, t, x)?.balanced())
    }

    /// Quantities by states in parts of their size, and by drives: both sides of the rows. Of few states what moves the quantities
    /// of a row that keeps nothing is left out.
    fn structure(&mut self, leaf: &Leaf, t: f64, x: &[f64]) -> Option<Tangent> {
        self.place(t, x);
        self.frame.run(&leaf.routine).ok()?;
        let values: Vec<f64> = leaf.routine.outputs.iter().map(|&r| self.frame.r[r as usize]).collect();
        if values.iter().any(|v| !v.is_finite()) {
            return None;
        }
        let (mut moves, mut by): (Vec<Entry>, Vec<Entry>) = (Vec::new(), Vec::new());
        for (i, row) in leaf.rows.iter().enumerate() {
            by.extend(row.by.clone().zip(&row.drives).map(|(at, &k)| (i, k, values[at])));
            for (at, state) in row.quantity.clone().step_by(2).zip(&row.state) {
                moves.extend(state.map(|j| (i, j, values[at] * leaf.size[j])));
            }
        }
        let follows: Vec<bool> = leaf.rows.iter().map(|row| row.state.iter().any(Option::is_none)).collect();
        let keeps = match follows.contains(&true) && x.len() <= FEW_STATES {
            true => keeping(leaf.rows.len(), leaf.drives, &by)?,
            false => follows.clone(),
        };
        let followers: Vec<usize> = (0..leaf.rows.len()).filter(|&i| follows[i] && keeps[i]).collect();
        for j in (0..x.len()).filter(|_| !followers.is_empty()) {
            self.place(t, x);
            self.still();
            self.frame.d[self.code.layout.states as usize + j] = 1.0;
            self.frame.run_along(&leaf.routine).ok()?;
            for &i in &followers {
                let row = &leaf.rows[i];
                let quantities = row.quantity.clone().step_by(2).zip(&row.state).filter(|(_, state)| state.is_none());
                let slope = |at: usize| self.frame.d[leaf.routine.outputs[at + 1] as usize];
                let moved = quantities.map(|(at, _)| (i, j, values[at] * slope(at) * leaf.size[j]));
                moves.extend(moved.filter(|entry| entry.2 != 0.0));
            }
        }
        let finite = moves.iter().all(|entry| entry.2.is_finite());
        finite.then(|| Tangent::new((leaf.rows.len(), x.len(), leaf.drives), moves, by))
    }
}

/// The rows whose product with any way vanishes, by states in parts of their size.
fn kept(rows: &Tangent) -> Option<Mat<f64>> {
    let mut moves = Mat::<f64>::zeros(rows.rows, rows.states);
    let mut drives = Mat::<f64>::zeros(rows.rows, rows.drives);
    rows.moves.iter().for_each(|&(i, j, v)| moves[(i, j)] += v);
    rows.by.iter().for_each(|&(i, k, v)| drives[(i, k)] += v);
    let out_of_reach = out_of_reach(&drives)?;
    let sum = |a: usize, j: usize| (0..rows.rows).map(|i| out_of_reach[(i, a)] * moves[(i, j)]).sum();
    Some(Mat::from_fn(out_of_reach.ncols(), rows.states, sum))
}

/// What the drives cannot do: combinations of rows from which all of them vanish, column by column.
fn out_of_reach(drives: &Mat<f64>) -> Option<Mat<f64>> {
    let (rows, columns) = drives.shape();
    if columns == 0 {
        return Some(Mat::identity(rows, rows));
    }
    let svd = if rows <= columns { drives.thin_svd() } else { drives.svd() }.ok()?;
    let rank = rank_of(&svd.S().column_vector().iter().copied().collect::<Vec<_>>());
    Some(Mat::from_fn(rows, rows - rank, |i, a| svd.U()[(i, rank + a)]))
}

/// Which rows stand in a combination that no drive moves.
fn keeping(rows: usize, drives: usize, by: &[Entry]) -> Option<Vec<bool>> {
    let scales = greatest(rows, by.iter().map(|e| (e.0, e.2)));
    let mut matrix = Mat::<f64>::zeros(rows, drives);
    by.iter().for_each(|&(i, k, v)| matrix[(i, k)] += v * scales[i]);
    let out_of_reach = out_of_reach(&matrix)?;
    let stands = |i: usize| (0..out_of_reach.ncols()).any(|a| out_of_reach[(i, a)].abs() > STANDS);
    Some((0..rows).map(stands).collect())
}

fn rank_of(values: &[f64]) -> usize {
    let limit = RANK * values.iter().fold(0.0f64, |most, s| most.max(*s));
    values.iter().filter(|&&s| s > limit).count()
}

/// The rows of a matrix that determine a step along all its columns best: as many as columns, or fewer.
pub(super) fn leading_rows(matrix: &[f64], columns: usize) -> Vec<usize> {
    let rows = matrix.len() / columns.max(1);
    let mut left: Vec<Vec<f64>> = (0..rows).map(|i| matrix[i * columns..][..columns].to_vec()).collect();
    for row in &mut left {
        let most = row.iter().fold(0.0f64, |most, v| most.max(v.abs()));
        row.iter_mut().for_each(|v| *v *= minimum_norm::inverse(most));
    }
    let mut chosen = Vec::new();
    while chosen.len() < columns {
        let length = |i: usize| left[i].iter().map(|v| v * v).sum::<f64>();
        let best =
            (0..rows).filter(|i| !chosen.contains(i)).max_by(|&a, &b| length(a).total_cmp(&length(b)).then(b.cmp(&a)));
        let Some(best) = best.filter(|&i| length(i) > 1e-20) else { break };
        let unit: Vec<f64> = left[best].iter().map(|v| v / length(best).sqrt()).collect();
        for row in &mut left {
            let part: f64 = row.iter().zip(&unit).map(|(a, b)| a * b).sum();
            row.iter_mut().zip(&unit).for_each(|(v, u)| *v -= part * u);
        }
        chosen.push(best);
    }
    chosen.sort_unstable();
    chosen
}
