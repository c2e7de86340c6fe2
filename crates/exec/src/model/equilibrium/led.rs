//! Of many places of rest that to which the motion leads.
//!
//! Where the linearised motion `x' = A x + r` has places of rest on a line or plane, what no derivative changes stays as it is on
//! the way there: with `L` and `N` the left and right null spaces of `A`, the step `s` has `A s = -r` and `Lᵀ s = 0`. So wheels
//! that nothing turns stay, and tyres are deflected by as much as what stands on them has moved. Where a motion would go on for
//! ever (`Lᵀ N` is singular, as that of a body that nothing slows down) there is no such step.
//! Source: [BIG], group inverse.

use super::open_equations::greatest;
use faer::Mat;

/// Singular values below this fraction of the greatest count as zero.
const RANK: f64 = 1e-11;
/// Where null spaces are nearer than this to a right angle, the motion goes on and on.
const ASIDE: f64 = 1e-6;

/// From any `step` to rest to that which the motion makes, as far as it comes to rest at all; `derivatives` of the rates, row by
/// row. `None` if that does not come out.
pub(super) fn led(derivatives: &[f64], step: &mut [f64]) -> Option<()> {
    let n = step.len();
    let entries = || (0..n).flat_map(|i| (0..n).map(move |j| (i, j))).zip(derivatives).filter(|e| *e.1 != 0.0);
    // What each state counts as one of, and each rate: the matrix stays similar to what it was under the former.
    let sizes = greatest(n, entries().map(|((_, j), v)| (j, *v)));
    let rows = greatest(n, entries().map(|((i, j), v)| (i, v * sizes[j])));
    let matrix = Mat::from_fn(n, n, |i, j| derivatives[i * n + j] * rows[i] * sizes[j]);
    let svd = matrix.svd().ok()?;
    let values: Vec<f64> = svd.S().column_vector().iter().copied().collect();
    let limit = RANK * values.iter().fold(0.0f64, |most, s| most.max(*s));
    let rank = values.iter().filter(|s| **s > limit).count();
    let free = n - rank;
    // In states as parts of their sizes.
    let right = Mat::from_fn(n, free, |j, k| svd.V()[(j, rank + k)]);
    let left = Mat::from_fn(n, free, |i, k| svd.U()[(i, rank + k)] * rows[i] * sizes[i]).qr().compute_thin_Q();
    let meeting = (left.transpose() * &right).svd().ok()?;
    let moved = Mat::from_fn(n, 1, |j, _| step[j] / sizes[j]);
    let changed = meeting.U().transpose() * (left.transpose() * moved);
    let back = |k: usize| match meeting.S().column_vector()[k] {
        cosine if cosine > ASIDE => changed[(k, 0)] / cosine,
        _ => 0.0,
    };
    let back = &right * (meeting.V() * Mat::from_fn(free, 1, |k, _| back(k)));
    step.iter_mut().enumerate().for_each(|(j, s)| *s -= back[(j, 0)] * sizes[j]);
    step.iter().all(|s| s.is_finite()).then_some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two tanks and a pipe: `x' = (y - x)/2, y' = 3 (x - y)`. What both hold, `6 x + y`, stays.
    #[test]
    fn what_no_derivative_changes_stays() {
        // From (1, 0) to rest at a level of 6/7; the shortest step goes to 1/2.
        let mut step = [-0.5, 0.5];
        led(&[-0.5, 0.5, 3.0, -3.0], &mut step).expect("it comes out");
        assert!((step[0] + 1.0 / 7.0).abs() < 1e-15 && (step[1] - 6.0 / 7.0).abs() < 1e-15, "{step:?}");
    }

    /// A body that nothing slows down has no place of rest to which it comes: `x' = v, v' = 0`.
    #[test]
    fn what_goes_on_for_ever_is_left_as_it_is() {
        let mut step = [0.25, -1.0];
        led(&[0.0, 1.0, 0.0, 0.0], &mut step).expect("it comes out");
        assert_eq!(step, [0.25, -1.0]);
    }
}
