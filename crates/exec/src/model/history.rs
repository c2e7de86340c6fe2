//! Signals read from earlier times.

use std::collections::VecDeque;

/// A signal as it was some time ago: cubics through recorded values and slopes.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Delay {
    /// The delay in s.
    pub time: f64,
    points: VecDeque<Point>,
    /// When the run began, in s.
    start: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Point {
    t: f64,
    value: f64,
    slope: f64,
    /// Whether it is the far side of a jump: the point before stands at the same time.
    jump: bool,
}

impl Delay {
    pub fn new(time: f64) -> Delay {
        Delay { time, points: VecDeque::with_capacity(64), start: f64::NAN }
    }

    pub fn begin(&mut self, t: f64, value: f64, slope: f64) {
        self.start = t;
        self.points.clear();
        self.points.push_back(Point { t, value, slope, jump: false });
    }

    /// The signal has come to a value, smoothly.
    pub fn append(&mut self, t: f64, value: f64, slope: f64) {
        let Some(&before) = self.points.back() else { return self.begin(t, value, slope) };
        if t > before.t {
            self.points.push_back(Point { t, value, slope, jump: false });
        }
        // Samples within the step that ends here still read what it began with; what is older by the delay is read no more,
        // but for the point before it, which bounds a piece.
        while self.points.len() > 3 && self.points[2].t + self.time < before.t {
            self.points.pop_front();
        }
    }

    /// The signal has jumped at the time of the last point, or changed its slope.
    pub fn jump(&mut self, t: f64, value: f64, slope: f64) {
        let Some(&last) = self.points.back() else { return self.begin(t, value, slope) };
        let same = last.value == value && last.slope == slope;
        if !same && !last.jump {
            self.points.push_back(Point { t: last.t, value, slope, jump: true });
        } else if !same && let Some(last) = self.points.back_mut() {
            (last.value, last.slope) = (value, slope);
        }
    }

    /// Value and slope at `t`, where the last jump was crossed at `crossed`.
    pub fn at(&self, t: f64, crossed: f64) -> (f64, f64) {
        let Some(first) = self.points.front() else { return (0.0, 0.0) };
        let s = t - self.time;
        let arrived = |p: &Point| p.t + self.time <= crossed;
        let mut k = self.points.partition_point(|p| p.t <= s);
        // Rounding of `t - time` must not decide on which side of a jump we are.
        while k < self.points.len() && self.points[k].jump && arrived(&self.points[k]) {
            k += 1;
        }
        if k + 1 < self.points.len() && self.points[k + 1].jump && arrived(&self.points[k + 1]) {
            k += 2;
        }
        while k > 0 && self.points[k - 1].jump && !arrived(&self.points[k - 1]) {
            k -= 1;
        }
        match (k, self.points.get(k)) {
            (0, _) => (first.value, 0.0),
            (k, Some(next)) if next.t > self.points[k - 1].t => cubic(&self.points[k - 1], next, s),
            (k, _) if k >= 2 && self.points[k - 2].t < self.points[k - 1].t && self.points[k - 1].t >= s => {
                cubic(&self.points[k - 2], &self.points[k - 1], s)
            }
            (k, _) => {
                let last = &self.points[k - 1];
                (last.value + last.slope * (s - last.t), last.slope)
            }
        }
    }

    /// The next time after `t` at which a jump arrives or a step has to end because nothing later is recorded yet.
    pub fn next_time_event(&self, t: f64) -> Option<f64> {
        let arrival = self.points.iter().filter(|p| p.jump).map(|p| p.t + self.time).find(|&a| a > t);
        let whole = ((t - self.start) / self.time).floor() + 1.0;
        let horizon = [whole, whole + 1.0].into_iter().map(|k| self.start + k * self.time).find(|&h| h > t);
        match (arrival, horizon) {
            (Some(a), Some(h)) => Some(a.min(h)),
            (one, other) => one.or(other),
        }
    }
}

fn cubic(a: &Point, b: &Point, s: f64) -> (f64, f64) {
    let h = b.t - a.t;
    let u = (s - a.t) / h;
    let (v, rise) = (1.0 - u, b.value - a.value);
    let value = a.value + rise * u * u * (3.0 - 2.0 * u) + h * u * v * (v * a.slope - u * b.slope);
    let slope = 6.0 * u * v * rise / h + (1.0 - 4.0 * u + 3.0 * u * u) * a.slope + u * (3.0 * u - 2.0) * b.slope;
    (value, slope)
}

/// A signal sampled at multiples of a period.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Sample {
    period: f64,
    /// The value held.
    pub value: f64,
    /// Number of the next sample.
    next: f64,
}

impl Sample {
    pub fn new(period: f64) -> Sample {
        Sample { period, value: 0.0, next: f64::NAN }
    }

    pub fn begin(&mut self, t: f64, value: f64) {
        self.value = value;
        self.next = (t / self.period).floor();
        self.pass(t);
    }

    /// When the next sample is taken, in s.
    pub fn next_time(&self) -> f64 {
        self.next * self.period
    }

    /// Whether a sample is due.
    pub fn is_due(&self, t: f64) -> bool {
        t >= self.next_time()
    }

    /// Samples up to `t` are taken.
    pub fn pass(&mut self, t: f64) {
        while self.period > 0.0 && self.next_time() <= t {
            self.next += 1.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_within_the_last_step_are_read_as_they_were() {
        let mut delay = Delay::new(0.5);
        let f = |t: f64| (t * t * t, 3.0 * t * t);
        delay.begin(0.0, 0.0, 0.0);
        for k in 1..=40 {
            let (from, t) = (0.1 * f64::from(k - 1), 0.1 * f64::from(k));
            delay.append(t, f(t).0, f(t).1);
            let within = from + 0.03;
            assert!(within < 0.5 || (delay.at(within, 0.0).0 - f(within - 0.5).0).abs() < 1e-12, "{within}");
        }
        // The last step may be as long as the delay.
        delay.append(4.5, f(4.5).0, f(4.5).1);
        assert!((delay.at(4.01, 0.0).0 - f(3.51).0).abs() < 1e-12);
    }

    #[test]
    fn cubics_are_followed_exactly() {
        let f = |t: f64| (t * t * t - t, 3.0 * t * t - 1.0);
        let mut delay = Delay::new(1.0);
        delay.begin(0.0, 0.0, -1.0);
        for k in 1..=10 {
            let t = 0.3 * k as f64;
            delay.append(t, f(t).0, f(t).1);
        }
        for t in [2.9, 3.1, 3.77] {
            let (value, slope) = delay.at(t, 0.0);
            let exact = f(t - 1.0);
            assert!((value - exact.0).abs() < 1e-13 && (slope - exact.1).abs() < 1e-12, "{t}: {value} {exact:?}");
        }
        assert_eq!(delay.next_time_event(0.5), Some(1.0));
    }

    #[test]
    fn a_jump_arrives_when_it_is_crossed() {
        let mut delay = Delay::new(0.1);
        delay.begin(0.0, 1.0, 0.0);
        delay.append(0.05, 1.0, 0.0);
        delay.jump(0.05, 7.0, 0.0);
        delay.append(0.12, 7.0, 0.0);
        let arrival = 0.05 + 0.1;
        assert_eq!(delay.next_time_event(0.12), Some(arrival));
        assert_eq!(delay.at(arrival, 0.1).0, 1.0);
        assert_eq!(delay.at(arrival + 1e-9, 0.1).0, 1.0);
        assert_eq!(delay.at(arrival, arrival).0, 7.0);
        assert_eq!(delay.at(arrival - 1e-17, arrival).0, 7.0);
        assert_eq!(delay.at(0.05, 0.0).0, 1.0);
    }

    #[test]
    fn samples_stand_at_multiples() {
        let mut sample = Sample::new(0.1);
        sample.begin(0.25, 4.0);
        assert!((sample.next_time() - 0.3).abs() < 1e-15);
        assert!(!sample.is_due(0.29) && sample.is_due(3.0 * 0.1));
        sample.pass(3.0 * 0.1);
        assert_eq!(sample.next_time(), 4.0 * 0.1);
    }
}
