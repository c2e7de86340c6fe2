//! Least squares of minimum norm, for rows and columns of any magnitude.

use faer::Mat;
use faer::linalg::solvers::Solve;

/// Singular values below this fraction of the greatest count as zero.
const RANK: f64 = 1e-11;

/// An unknown is weak if its entries are below this fraction of the greatest of their rows.
const WEAK: f64 = 1e-6;

/// Unknowns are kept out of a step that leaves no more than this part of the greatest residual without them.
const LEFT: f64 = 1e-9;

/// The shortest of the steps that reduce `jacobian · step + residual` most; rows and columns are weighed so that the
/// greatest entry of each is 1. Where it is one of many, weak unknowns stay where they are if the others do it: what moves
/// rates only by rounding would have to go far.
pub(super) struct MinimumNormStep {
    /// The step.
    pub step: Vec<f64>,
    /// Rank of the Jacobian.
    pub rank: usize,
    /// The weights of the rows.
    pub weights: Vec<f64>,
}

impl MinimumNormStep {
    /// Whether it removes the residuals, each in its weight, but for this part of the greatest.
    pub fn meets(&self, jacobian: &[f64], residual: &[f64], part: f64) -> bool {
        let weighed = |i: usize, value: f64| (value * self.weights[i]).abs();
        let most = residual.iter().enumerate().fold(0.0f64, |most, (i, r)| most.max(weighed(i, *r)));
        let left = |i: usize| {
            let row = &jacobian[i * self.step.len()..][..self.step.len()];
            residual[i] + row.iter().zip(&self.step).map(|(a, s)| a * s).sum::<f64>()
        };
        (0..residual.len()).all(|i| weighed(i, left(i)) <= part * most)
    }
}

/// Computes it; `jacobian` row by row. `None` if something is not finite or the singular values do not come out.
pub(super) fn step(jacobian: &[f64], residual: &[f64], columns: usize) -> Option<MinimumNormStep> {
    let rows = residual.len();
    let weights: Vec<f64> = match columns {
        0 => vec![1.0; rows],
        _ => jacobian.chunks(columns).map(|row| inverse(greatest(&mut row.iter().copied()))).collect(),
    };
    weighed_step(jacobian, residual, columns, weights)
}

/// The same with the weights of the rows given.
pub(super) fn weighed_step(
    jacobian: &[f64],
    residual: &[f64],
    columns: usize,
    weights: Vec<f64>,
) -> Option<MinimumNormStep> {
    let rows = residual.len();
    if rows == 0 || columns == 0 {
        return Some(MinimumNormStep { step: vec![0.0; columns], rank: 0, weights });
    }
    if jacobian.iter().chain(residual).any(|v| !v.is_finite()) {
        return None;
    }
    let weighed = |j: usize| (0..rows).map(move |i| (i, j));
    let sizes: Vec<f64> = (0..columns)
        .map(|j| inverse(greatest(&mut weighed(j).map(|(i, j)| jacobian[i * columns + j] * weights[i]))))
        .collect();
    let all = solve(jacobian, residual, weights, &sizes)?;
    let strong: Vec<f64> = sizes.iter().map(|&size| if size * WEAK < 1.0 { size } else { 0.0 }).collect();
    if all.rank == columns || strong == sizes {
        return Some(all);
    }
    let by_strong = solve(jacobian, residual, all.weights.clone(), &strong)?;
    let meets = by_strong.meets(jacobian, residual, LEFT);
    Some(if meets { MinimumNormStep { rank: all.rank, ..by_strong } } else { all })
}

/// The shortest step where unknowns count in parts of these sizes, without those of size 0.
fn solve(jacobian: &[f64], residual: &[f64], weights: Vec<f64>, sizes: &[f64]) -> Option<MinimumNormStep> {
    let (rows, columns) = (residual.len(), sizes.len());
    let matrix = Mat::from_fn(rows, columns, |i, j| jacobian[i * columns + j] * weights[i] * sizes[j]);
    let svd = matrix.thin_svd().ok()?;
    let (u, values, v) = (svd.U(), svd.S().column_vector(), svd.V());
    let limit = RANK * values.iter().fold(0.0f64, |most, s| most.max(*s));
    let rank = values.iter().filter(|s| **s > limit).count();
    let mut solution = vec![0.0; columns];
    if rank == rows && rank == columns {
        // One solution alone: elimination keeps its zeros.
        let mut x = Mat::from_fn(rows, 1, |i, _| -residual[i] * weights[i]);
        matrix.partial_piv_lu().solve_in_place(x.as_mut());
        let step = x.col(0).iter().zip(sizes).map(|(s, size)| s * size).collect();
        return Some(MinimumNormStep { step, rank, weights });
    }
    for k in (0..values.nrows()).filter(|&k| values[k] > limit) {
        let part = (0..rows).map(|i| -u[(i, k)] * residual[i] * weights[i]).sum::<f64>() / values[k];
        solution.iter_mut().enumerate().for_each(|(j, x)| *x += v[(j, k)] * part);
    }
    Some(MinimumNormStep { step: solution.iter().zip(sizes).map(|(s, size)| s * size).collect(), rank, weights })
}

fn greatest(values: &mut dyn Iterator<Item = f64>) -> f64 {
    values.fold(0.0f64, |most, v| most.max(v.abs()))
}

pub(super) fn inverse(most: f64) -> f64 {
    if most > 0.0 { 1.0 / most } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shortest_and_best() {
        let s = step(&[1.0, 1.0], &[-2.0], 2).unwrap();
        assert!(s.rank == 1 && s.step.iter().all(|x| (x - 1.0).abs() < 1e-15));
        // Two equations for one unknown, 1 = x and 3e-6 = 1e-6 x: each weighs as much as the other.
        let s = step(&[1.0, 1e-6], &[-1.0, -3e-6], 1).unwrap();
        assert!(s.rank == 1 && (s.step[0] - 2.0).abs() < 1e-14);
        assert!(step(&[f64::NAN], &[1.0], 1).is_none());
        // One equation for two of three unknowns.
        let mut jacobian = [0.0; 12];
        (jacobian[9], jacobian[11]) = (1.0, 0.5);
        let s = step(&jacobian, &[0.0, 0.0, 0.0, 1.0], 3).unwrap();
        assert!((s.step[0] + 0.5 * s.step[2] + 1.0).abs() < 1e-14, "{:?}", s.step);
        // What only rounding joins stays.
        let s = step(&[1.0, 0.0, 1e-17, 0.0, 2.0, 3e-18], &[1.0, 1.0], 3).unwrap();
        assert!(s.step[2] == 0.0 && (s.step[0] + 1.0).abs() < 1e-14, "{:?}", s.step);
        // What nothing else meets is met by the weak.
        let s = step(&[1.0, 0.0, 1e-9, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0], &[1.0, 0.0, 0.0], 3).unwrap();
        assert!(s.step[0].abs() < 1e-12 && (s.step[2] * 1e-9 + 1.0).abs() < 1e-12, "{:?}", s.step);
        // A pendulum on its way to rest: what should be 0 is.
        assert_eq!(step(&[0.0, 1.0, -2.0, -0.5], &[0.0, 1.0], 2).unwrap().step, [0.5, 0.0]);
    }
}
