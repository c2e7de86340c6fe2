//! What is connected to inputs.

use std::sync::Arc;

/// A signal over time: constant, or points with straight lines between them.
///
/// Between two corners it is one straight line, which is evaluated beyond its ends as it is inside.
#[derive(Debug, Clone, Default)]
pub(super) struct InputSignal {
    default: f64,
    times: Arc<[f64]>,
    values: Arc<[f64]>,
}

/// The points (first and last index) between which a held line runs.
pub(super) type PointRange = (usize, usize);

impl InputSignal {
    /// A signal through points; times ascend, a time given twice is a jump.
    pub fn table(times: &[f64], values: &[f64]) -> Result<InputSignal, String> {
        if times.len() != values.len() {
            return Err(format!("{} times but {} values", times.len(), values.len()));
        }
        if times.is_empty() {
            return Err("there are none".to_string());
        }
        if let Some(i) = times.iter().zip(values).position(|(t, v)| !t.is_finite() || !v.is_finite()) {
            return Err(format!("point {} is not finite", i + 1));
        }
        if let Some(i) = (1..times.len()).find(|&i| times[i] < times[i - 1]) {
            return Err(format!("time goes back from {} s to {} s", times[i - 1], times[i]));
        }
        if let Some(i) = (2..times.len()).find(|&i| times[i] == times[i - 2]) {
            return Err(format!("{} s stands there more than twice", times[i]));
        }
        Ok(InputSignal { default: 0.0, times: times.into(), values: values.into() })
    }

    /// The value where nothing is connected.
    pub fn set_default(&mut self, value: f64) {
        self.default = value;
    }

    /// Whether it has one value at all times.
    pub fn is_constant(&self) -> bool {
        self.times.len() <= 1
    }

    /// Whether something is connected.
    pub fn moves(&self) -> bool {
        !self.times.is_empty()
    }

    /// Value and slope at `t`, on a piece, or where none is held on that of the points around.
    #[inline]
    pub fn at(&self, t: f64, piece: Option<PointRange>) -> (f64, f64) {
        if self.times.is_empty() { (self.default, 0.0) } else { self.among_points(t, piece) }
    }

    fn among_points(&self, t: f64, piece: Option<PointRange>) -> (f64, f64) {
        let n = self.times.len();
        match piece {
            Some((first, last)) if first == last => (self.values[first], 0.0),
            Some((first, last)) => {
                let k = self.times[..=last].partition_point(|&p| p <= t).clamp(first + 1, last) - 1;
                self.line(k, t)
            }
            None => match self.times.partition_point(|&p| p <= t) {
                0 => (self.values[0], 0.0),
                k if k == n => (self.values[n - 1], 0.0),
                k => self.line(k - 1, t),
            },
        }
    }

    /// The line that begins at `t` or runs through it, if something is connected.
    pub fn piece(&self, t: f64) -> Option<PointRange> {
        let n = self.times.len();
        if n == 0 {
            return None;
        }
        let after = self.times.partition_point(|&p| p <= t);
        if after == 0 || after == n {
            let end = if after == 0 { 0 } else { n - 1 };
            return Some((end, end));
        }
        let last = (after..n).find(|&k| self.is_corner(k)).unwrap_or(n - 1);
        Some((after - 1, last))
    }

    /// The first corner after `t`.
    pub fn next_corner(&self, t: f64) -> Option<f64> {
        let after = self.times.partition_point(|&p| p <= t);
        (after..self.times.len()).find(|&k| self.is_corner(k)).map(|k| self.times[k])
    }

    /// Whether it bends or jumps at `t`.
    pub fn is_corner_at(&self, t: f64) -> bool {
        (0..self.times.len()).any(|k| self.times[k] == t && self.is_corner(k))
    }

    /// Whether it jumps at `t`: two points stand there.
    pub fn jumps_at(&self, t: f64) -> bool {
        let after = self.times.partition_point(|&p| p <= t);
        after >= 2 && self.times[after - 1] == t && self.times[after - 2] == t
    }

    fn line(&self, k: usize, t: f64) -> (f64, f64) {
        let slope = self.slope(k);
        // From the nearer end, so that points are met exactly.
        let near = if t - self.times[k] <= self.times[k + 1] - t { k } else { k + 1 };
        (self.values[near] + slope * (t - self.times[near]), slope)
    }

    fn slope(&self, k: usize) -> f64 {
        (self.values[k + 1] - self.values[k]) / (self.times[k + 1] - self.times[k])
    }

    /// Whether the signal bends or jumps at a point; it is constant beyond its ends.
    fn is_corner(&self, k: usize) -> bool {
        let n = self.times.len();
        let jumps = |a: usize, b: usize| self.times[a] == self.times[b];
        if (k > 0 && jumps(k - 1, k)) || (k + 1 < n && jumps(k, k + 1)) {
            return true;
        }
        let before = if k == 0 { 0.0 } else { self.slope(k - 1) };
        let after = if k + 1 == n { 0.0 } else { self.slope(k) };
        (after - before).abs() > 1e-12 * after.abs().max(before.abs())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn jumps_have_two_sides() {
        let signal = InputSignal::table(&[0.0, 1.0, 1.0, 2.0], &[0.0, 1.0, 5.0, 5.0]).unwrap();
        assert_eq!(signal.next_corner(-1.0), Some(0.0));
        let on = |start: f64, t: f64| signal.at(t, signal.piece(start));
        assert_eq!((on(0.0, 0.5), on(0.0, 1.0)), ((0.5, 1.0), (1.0, 1.0)));
        assert_eq!(signal.next_corner(0.0), Some(1.0));
        assert_eq!((on(1.0, 1.0), on(1.0, 1.5)), ((5.0, 0.0), (5.0, 0.0)));
        assert_eq!(signal.next_corner(1.0), Some(2.0).filter(|_| signal.is_corner(3)));
        assert_eq!((on(3.0, 3.0), signal.next_corner(3.0)), ((5.0, 0.0), None));
    }

    #[test]
    fn points_on_a_line_are_no_corners() {
        let signal = InputSignal::table(&[0.0, 1.0, 2.0, 3.0], &[0.0, 1.0, 2.0, 0.0]).unwrap();
        assert_eq!(signal.next_corner(0.0), Some(2.0));
        assert!((0..5).all(|t| !signal.jumps_at(f64::from(t))));
        let stair = InputSignal::table(&[0.0, 1.0, 1.0, 2.0], &[0.0, 1.0, 5.0, 5.0]).unwrap();
        assert_eq!([0.0, 1.0, 1.5, 2.0].map(|t| stair.jumps_at(t)), [false, true, false, false]);
    }

    #[test]
    fn refuses_what_is_no_function_of_time() {
        assert!(InputSignal::table(&[1.0, 0.0], &[0.0, 0.0]).unwrap_err().contains("goes back"));
        assert!(InputSignal::table(&[1.0, 1.0, 1.0], &[0.0; 3]).unwrap_err().contains("twice"));
        assert!(InputSignal::table(&[1.0, f64::NAN], &[0.0; 2]).unwrap_err().contains("not finite"));
    }
}
