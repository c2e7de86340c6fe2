//! How much of the rates is rounding: an error below it cannot be told from none.

use crate::System;

/// Points at which the rates are compared.
const POINTS: usize = 9;

/// Distance between two of them, relative to the states and to time: some rounding errors of them, far below what bends.
const APART: f64 = 64.0 * f64::EPSILON;

/// Differences of differences that are taken: nothing smooth is left in them.
const DIFFERENCES: usize = 4;

/// The mean square of such a difference of independent errors of size 1: the sum of the squares of 1, 4, 6, 4 and 1.
const GROWN: f64 = 70.0;

/// Rounding error of each rate at `(t, x)`: what the rates at points very near to each other have that no smooth function
/// has. `None` where the system has no rates. Source: [MoreWild], section 4.
///
/// `magnitudes`: of each state, to move those that are 0.
pub(super) fn rounding(system: &mut dyn System, t: f64, x: &[f64], magnitudes: &[f64]) -> Option<Vec<f64>> {
    let states = x.len();
    let mut rates = vec![0.0; POINTS * states];
    for (point, rates) in rates.chunks_exact_mut(states.max(1)).enumerate() {
        let way = point as f64 * APART;
        let near: Vec<f64> = x.iter().zip(magnitudes).map(|(x, magnitude)| x + way * x.abs().max(*magnitude)).collect();
        system.rates(t * (1.0 + way), &near, rates).ok()?;
    }
    let of_state = |state: usize| {
        let values: Vec<f64> = (0..POINTS).map(|point| rates[point * states + state]).collect();
        scatter(values)
    };
    Some((0..states).map(of_state).collect())
}

/// Size of the errors of values that lie on a smooth curve.
fn scatter(mut values: Vec<f64>) -> f64 {
    for _ in 0..DIFFERENCES {
        values = values.windows(2).map(|pair| pair[1] - pair[0]).collect();
    }
    let square = values.iter().map(|value| value * value).sum::<f64>() / (GROWN * values.len() as f64);
    if square.is_finite() { square.sqrt() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_has_no_scatter_and_errors_have_theirs() {
        let cubic = |i: usize| {
            let x = i as f64;
            x * x * x - 2.0 * x
        };
        assert_eq!(scatter((0..POINTS).map(cubic).collect()), 0.0);
        // Errors of 1 with signs that follow no rule.
        let error = |i: usize| [1.0, -1.0, -1.0, 1.0, 1.0, 1.0, -1.0, 1.0, -1.0][i];
        let found = scatter((0..POINTS).map(|i| cubic(i) + 1e-6 * error(i)).collect());
        assert!((0.3e-6..3e-6).contains(&found), "{found:e}");
    }
}
