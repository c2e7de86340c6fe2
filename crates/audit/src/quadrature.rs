//! Integrals over samples.

/// An interval that is longer than both beside it by this factor stands apart.
const APART: f64 = 4.0;

/// Integrals from the first sample to each, and what they are uncertain by.
pub(crate) struct Integral {
    pub values: Vec<f64>,
    pub uncertainty: Vec<f64>,
}

/// Integrates samples: between jumps (times given twice) by the quintics through the six nearest samples; the
/// uncertainty is the sum of the differences to quartics, and to straight lines where samples are far apart.
pub(crate) fn integrate(times: &[f64], rates: &[f64]) -> Integral {
    let n = times.len();
    let mut integral = Integral { values: vec![0.0; n], uncertainty: vec![0.0; n] };
    let (mut start, mut end) = (0, 0);
    for k in 1..n {
        let (mut step, mut doubt) = (0.0, 0.0);
        if times[k] > times[k - 1] {
            if end < k {
                end = (k..n).find(|&j| j + 1 == n || times[j + 1] <= times[j]).unwrap_or(n - 1);
            }
            let fine = piece(times, rates, (start, end), k, MOST);
            step = fine;
            doubt = (fine - piece(times, rates, (start, end), k, 5)).abs();
            if end - start < 5 {
                doubt = doubt.max((fine - piece(times, rates, (start, end), k, (end - start).max(1))).abs());
            }
            if stands_apart(times, (start, end), k) {
                doubt = doubt.max((fine - piece(times, rates, (start, end), k, 2)).abs());
            }
        } else {
            start = k;
        }
        integral.values[k] = integral.values[k - 1] + step;
        integral.uncertainty[k] = integral.uncertainty[k - 1] + doubt;
    }
    integral
}

/// Whether the interval that ends at sample `k` is so much longer than those beside it that polynomials through their samples
/// tell little of it.
fn stands_apart(times: &[f64], (first, last): (usize, usize), k: usize) -> bool {
    let own = times[k] - times[k - 1];
    let beside = [(k - 1 > first).then(|| times[k - 1] - times[k - 2]), (k < last).then(|| times[k + 1] - times[k])];
    beside.into_iter().flatten().reduce(f64::max).is_some_and(|longest| own > APART * longest)
}

/// Samples that a polynomial goes through at most.
const MOST: usize = 6;

/// Integral from sample `k - 1` to `k` of the polynomial through up to `count` samples around them in `[first, last]`.
fn piece(times: &[f64], rates: &[f64], (first, last): (usize, usize), k: usize, count: usize) -> f64 {
    let count = count.min(last - first + 1);
    let low = (k as isize - (count as isize + 1) / 2).max(first as isize) as usize;
    let low = low.min(last + 1 - count);
    let (t, mut c) = (&times[low..low + count], [0.0; MOST]);
    c[..count].copy_from_slice(&rates[low..low + count]);
    for level in 1..count {
        for i in (level..count).rev() {
            c[i] = (c[i] - c[i - 1]) / (t[i] - t[i - level]);
        }
    }
    let at = |s: f64| (0..count).rev().fold(0.0, |sum, i| sum * (s - t[i]) + c[i]);
    gauss(times[k - 1], times[k], at)
}

/// Integral of a function by three points: exact for quintics.
pub(crate) fn gauss(from: f64, to: f64, mut f: impl FnMut(f64) -> f64) -> f64 {
    let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
    let away = half * 0.6f64.sqrt();
    half * (5.0 * f(middle - away) + 8.0 * f(middle) + 5.0 * f(middle + away)) / 9.0
}

#[cfg(test)]
#[allow(clippy::disallowed_methods, reason = "values to compare with")]
mod tests {
    use super::*;

    #[test]
    fn quintics_are_exact_and_jumps_are_kept_apart() {
        let mut times: Vec<f64> = (0..=10).map(|k| 0.1 * k as f64).collect();
        times.extend((0..=10).map(|k| 1.0 + 0.07 * k as f64));
        let f = |i: usize, t: f64| if i <= 10 { 6.0 * t.powi(5) } else { -2.0 * t };
        let rates: Vec<f64> = times.iter().enumerate().map(|(i, &t)| f(i, t)).collect();
        let integral = integrate(&times, &rates);
        assert!((integral.values[10] - 1.0).abs() < 1e-14);
        assert!((integral.values[21] - (1.0 - (1.7f64.powi(2) - 1.0))).abs() < 1e-13);
        assert!(integral.uncertainty[10] < 1e-3);
    }
}
