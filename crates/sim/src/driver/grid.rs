//! Times at equal distances.

/// Distances this small, relative to the spacing, are taken for rounding.
const SLACK: f64 = 1e-9;

/// Where samples inside of a step stand, as parts of it: with its ends the points of Lobatto's quadrature with five points,
/// through which a polynomial of degree four goes.
pub const INSIDE: [f64; 3] = [0.172_673_164_646_011_43, 0.5, 0.827_326_835_353_988_6];

/// The times of these samples in the step from `start` to `end`.
pub fn inside(start: f64, end: f64) -> [f64; 3] {
    INSIDE.map(|part| start + part * (end - start))
}

/// The time `from + index · every`: the nearest number to what is meant where `1 / every` is whole, so that 7 · 0.01 is 0.07.
pub fn tick(from: f64, every: f64, index: f64) -> f64 {
    let per_second = (1.0 / every).round();
    let whole = per_second >= 1.0 && 1.0 / per_second == every;
    from + if whole { index / per_second } else { index * every }
}

/// The [`tick`]s, or given times, walked through in order.
pub(crate) struct Grid {
    from: f64,
    /// Time between ticks; the least between given times.
    every: f64,
    next: f64,
    index: f64,
    /// Given times, and the place of the next one.
    given: Option<(Vec<f64>, usize)>,
}

impl Grid {
    pub(crate) fn new(from: f64, every: f64) -> Grid {
        Grid { from, every, next: from, index: 0.0, given: None }
    }

    /// These times, which ascend.
    pub(crate) fn at(times: Vec<f64>) -> Grid {
        let least = times.windows(2).map(|t| t[1] - t[0]).fold(f64::INFINITY, f64::min);
        let every = if least.is_finite() { least } else { 0.0 };
        let next = times.first().copied().unwrap_or(f64::INFINITY);
        Grid { from: next, every, next, index: 0.0, given: Some((times, 0)) }
    }

    /// The first time not yet passed.
    pub(crate) fn next(&self) -> f64 {
        self.next
    }

    /// How much may be rounding.
    pub(crate) fn slack(&self) -> f64 {
        SLACK * self.every
    }

    /// Whether `t` is the next time or beyond it, to rounding.
    pub(crate) fn is_due(&self, t: f64) -> bool {
        self.next <= t + self.slack()
    }

    /// Passes all times up to `t`.
    pub(crate) fn pass(&mut self, t: f64) {
        let slack = self.slack();
        if let Some((times, next)) = &mut self.given {
            *next += times[*next..].iter().take_while(|time| **time <= t + slack).count();
            self.next = times.get(*next).copied().unwrap_or(f64::INFINITY);
            return;
        }
        while self.is_due(t) {
            self.index = (self.index + 1.0).max(((t - self.from) / self.every).floor());
            self.next = tick(self.from, self.every, self.index);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gives_the_nearest_numbers() {
        let mut grid = Grid::new(0.0, 0.01);
        let mut times = vec![];
        while grid.next() <= 0.1 {
            times.push(grid.next());
            grid.pass(grid.next());
        }
        assert_eq!(times, [0.0, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 0.09, 0.1]);
    }

    #[test]
    fn given_times_are_walked_through() {
        let mut grid = Grid::at(vec![0.1, 0.3, 0.35, 2.0]);
        let mut times = vec![];
        while grid.next().is_finite() {
            times.push(grid.next());
            grid.pass(grid.next() - 1e-12);
        }
        assert_eq!(times, [0.1, 0.3, 0.35, 2.0]);
    }

    #[test]
    fn passes_what_is_within_rounding() {
        let mut grid = Grid::new(0.0, 0.1);
        grid.pass(0.30000000000000004);
        assert_eq!(grid.next(), 0.4);
        grid.pass(0.4 - 1e-14);
        assert_eq!(grid.next(), 0.5);
        grid.pass(1000.0);
        assert_eq!(grid.next(), 1000.1);
    }
}
