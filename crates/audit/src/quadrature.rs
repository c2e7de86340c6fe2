//! Integrals over samples.

/// An interval that is longer than both beside it by this factor stands apart.
const APART: f64 = 4.0;

/// Integrals from the first sample to each, and what they are uncertain by.
#[derive(Default)]
pub(crate) struct Integral {
    pub values: Vec<f64>,
    pub uncertainty: Vec<f64>,
}

/// What samples weigh in integrals over them, which follows from their times alone: between jumps (times given twice) those of
/// the quintics through the six nearest samples; the uncertainty is the sum of the differences to quartics, and to straight
/// lines where samples are far apart.
pub(crate) struct Quadrature {
    intervals: Vec<Interval>,
}

/// What samples weigh in the integral over the interval before one of them.
struct Interval {
    /// The first sample that weighs.
    low: usize,
    /// The interval is so long, and as much a value weighs that is the same in all samples.
    length: f64,
    /// What the others weigh by their difference to the first.
    fine: Weights,
    /// The same of the differences to coarser rules.
    doubts: Vec<Weights>,
}

type Weights = [f64; MOST - 1];

impl Quadrature {
    /// The weights of samples at these times.
    pub fn new(times: &[f64]) -> Quadrature {
        let n = times.len();
        let mut intervals = Vec::with_capacity(n.saturating_sub(1));
        let (mut start, mut end) = (0, 0);
        for k in 1..n {
            if times[k] > times[k - 1] {
                if end < k {
                    end = (k..n).find(|&j| j + 1 == n || times[j + 1] <= times[j]).unwrap_or(n - 1);
                }
                intervals.push(Interval::new(times, (start, end), k));
            } else {
                start = k;
                intervals.push(Interval { low: k, length: 0.0, fine: [0.0; MOST - 1], doubts: Vec::new() });
            }
        }
        Quadrature { intervals }
    }

    /// Integrates values at these times.
    pub fn integrate(&self, rates: &[f64]) -> Integral {
        let mut integral = Integral::default();
        self.integrate_into(rates, &mut integral);
        integral
    }

    /// The same in memory that is used again.
    pub fn integrate_into(&self, rates: &[f64], integral: &mut Integral) {
        let Integral { values, uncertainty } = integral;
        values.clear();
        uncertainty.clear();
        let (mut value, mut doubt) = (0.0, 0.0);
        let begun = !rates.is_empty();
        values.extend(begun.then_some(value));
        uncertainty.extend(begun.then_some(doubt));
        for interval in &self.intervals {
            let (step, doubtful) = interval.integrate(rates);
            (value, doubt) = (value + step, doubt + doubtful);
            values.push(value);
            uncertainty.push(doubt);
        }
    }

    /// Whether a time is given twice.
    pub fn has_jumps(&self) -> bool {
        self.intervals.iter().any(|interval| interval.length == 0.0)
    }
}

impl Interval {
    fn new(times: &[f64], (start, end): (usize, usize), k: usize) -> Interval {
        let (low, count) = around((start, end), k, MOST);
        let weights = |most: usize| {
            let mut weights = [0.0; MOST - 1];
            let (first, count) = around((start, end), k, most);
            for j in first.max(low + 1)..first + count {
                weights[j - low - 1] = piece(times, (first, count), k, j);
            }
            weights
        };
        let fine = weights(count);
        let mut coarser = vec![5];
        if end - start < 5 {
            coarser.push((end - start).max(1));
        }
        if stands_apart(times, (start, end), k) {
            coarser.push(2);
        }
        let doubt = |most: usize| {
            let mut doubt = weights(most);
            doubt.iter_mut().zip(fine).for_each(|(w, fine)| *w = fine - *w);
            doubt
        };
        let doubts = coarser.into_iter().filter(|&most| most < count).map(doubt).collect();
        Interval { low, length: times[k] - times[k - 1], fine, doubts }
    }

    /// The integral, and how much of it is uncertain.
    fn integrate(&self, rates: &[f64]) -> (f64, f64) {
        if self.length == 0.0 {
            return (0.0, 0.0);
        }
        let first = rates[self.low];
        let mut others = [0.0; MOST - 1];
        others.iter_mut().zip(&rates[self.low + 1..]).for_each(|(other, rate)| *other = rate - first);
        let sum = |w: &Weights| {
            w[0] * others[0] + w[1] * others[1] + (w[2] * others[2] + w[3] * others[3]) + w[4] * others[4]
        };
        let doubt = self.doubts.iter().map(|weights| sum(weights).abs()).fold(0.0, f64::max);
        (self.length * first + sum(&self.fine), doubt)
    }
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

/// The first of up to `most` samples around the interval that ends at sample `k`, of those in a range, and how many they are.
fn around((first, last): (usize, usize), k: usize, most: usize) -> (usize, usize) {
    let count = most.min(last - first + 1);
    let low = (k as isize - (count as isize + 1) / 2).max(first as isize) as usize;
    (low.min(last + 1 - count), count)
}

/// Integral from sample `k - 1` to `k` of the polynomial that is 1 at sample `own` and 0 at the others of these.
fn piece(times: &[f64], (low, count): (usize, usize), k: usize, own: usize) -> f64 {
    let (t, mut c) = (&times[low..low + count], [0.0; MOST]);
    c[own - low] = 1.0;
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
        let integral = Quadrature::new(&times).integrate(&rates);
        assert!((integral.values[10] - 1.0).abs() < 1e-14);
        assert!((integral.values[21] - (1.0 - (1.7f64.powi(2) - 1.0))).abs() < 1e-13);
        assert!(integral.uncertainty[10] < 1e-3);
    }

    /// What does not change is certain to the last bit.
    #[test]
    fn constants_leave_no_doubt() {
        let times = [0.0, 0.1, 0.15, 0.15, 0.7, 0.8, 1.0, 1.1, 1.2, 1.9, 2.0];
        let integral = Quadrature::new(&times).integrate(&[0.3; 11]);
        assert!((integral.values[10] - 0.6).abs() < 1e-15);
        assert!(integral.uncertainty.iter().all(|u| *u == 0.0));
    }
}
