//! Functions given by points.

use crate::ids::id;

id! {
    /// A table registered in the pool.
    TableId
}

/// What happens between the points of a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Interpolation {
    /// Straight lines.
    Linear,
    /// Cubics with a continuous slope that never overshoot (Fritsch and Carlson; slopes as in `pchip`).
    Cubic,
    /// The value of the last point passed.
    Step,
}

/// What happens beyond the ends of a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Outside {
    /// Not a number: the run stops.
    Error,
    /// The value at the end.
    Clamp,
    /// The first or last piece goes on.
    Extrapolate,
}

/// Why a table was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TableError {
    /// It needs two points at least (a step one).
    TooShort,
    /// There are not as many values as arguments.
    Lengths,
    /// The argument with this index is not above the one before.
    NotIncreasing(usize),
    /// The point with this index is not finite.
    NotFinite(usize),
}

/// A function of one variable given by points: on each interval a cubic in the distance from its left end.
///
/// ```
/// use halfarrow_compiler::algebra::{Interpolation, Outside, Table1d};
/// let t = Table1d::new(vec![0.0, 1.0, 3.0], vec![0.0, 2.0, 4.0], Interpolation::Linear, Outside::Clamp).unwrap();
/// assert_eq!((t.value(0.5), t.slope(2.0), t.value(9.0)), (1.0, 1.0, 4.0));
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Table1d {
    x: Vec<f64>,
    y: Vec<f64>,
    interpolation: Interpolation,
    outside: Outside,
    /// Coefficients of 1, d, d², d³ on the interval that starts at `x[i]`; the last holds from the last point on.
    pieces: Vec<[f64; 4]>,
}

impl Table1d {
    /// A table through the points `(x, y)`, `x` increasing.
    pub fn new(
        x: Vec<f64>,
        y: Vec<f64>,
        interpolation: Interpolation,
        outside: Outside,
    ) -> Result<Table1d, TableError> {
        check(&x, &y, interpolation)?;
        let pieces = match interpolation {
            Interpolation::Linear => lines(&x, &y),
            Interpolation::Cubic => cubics(&x, &y),
            Interpolation::Step => y.iter().map(|&y| [y, 0.0, 0.0, 0.0]).collect(),
        };
        Ok(Table1d { x, y, interpolation, outside, pieces })
    }

    /// The arguments of its points.
    pub fn x(&self) -> &[f64] {
        &self.x
    }

    /// The values at its points.
    pub fn y(&self) -> &[f64] {
        &self.y
    }

    /// What happens between the points.
    pub fn interpolation(&self) -> Interpolation {
        self.interpolation
    }

    /// What happens beyond the ends.
    pub fn outside(&self) -> Outside {
        self.outside
    }

    /// For each point the coefficients of 1, d, d², d³, where d is the distance from the point: valid up to the next.
    pub fn pieces(&self) -> &[[f64; 4]] {
        &self.pieces
    }

    /// Its value at `x`.
    pub fn value(&self, x: f64) -> f64 {
        let Some((d, c)) = self.locate(x) else { return f64::NAN };
        ((c[3] * d + c[2]) * d + c[1]) * d + c[0]
    }

    /// Its slope at `x`; at a corner the one to the right.
    pub fn slope(&self, x: f64) -> f64 {
        let beyond = x < self.x[0] || x > self.x[self.x.len() - 1];
        if beyond && self.outside == Outside::Clamp {
            return 0.0;
        }
        let Some((d, c)) = self.locate(x) else { return f64::NAN };
        (3.0 * c[3] * d + 2.0 * c[2]) * d + c[1]
    }

    /// Whether the values only rise, or only fall, from each point to the next.
    pub fn strictly_monotone(&self) -> bool {
        self.interpolation != Interpolation::Step
            && (self.y.windows(2).all(|w| w[0] < w[1]) || self.y.windows(2).all(|w| w[0] > w[1]))
    }

    /// The table that undoes this one: for straight lines that only rise or only fall. A clamped table is undone
    /// between its ends only.
    pub fn inverse(&self) -> Option<Table1d> {
        if self.interpolation != Interpolation::Linear || !self.strictly_monotone() {
            return None;
        }
        let outside = if self.outside == Outside::Extrapolate { Outside::Extrapolate } else { Outside::Error };
        let (mut x, mut y) = (self.y.clone(), self.x.clone());
        if x[0] > x[1] {
            x.reverse();
            y.reverse();
        }
        Table1d::new(x, y, Interpolation::Linear, outside).ok()
    }

    /// The table of its slopes.
    pub fn derivative(&self) -> Table1d {
        let pieces: Vec<_> = self.pieces.iter().map(|c| [c[1], 2.0 * c[2], 3.0 * c[3], 0.0]).collect();
        let y = self.x.iter().map(|&x| self.slope(x)).collect();
        let interpolation = Interpolation::Step;
        Table1d { x: self.x.clone(), y, interpolation, outside: self.outside, pieces }
    }

    fn locate(&self, x: f64) -> Option<(f64, &[f64; 4])> {
        let last = self.x.len() - 1;
        if x.is_nan() {
            return None;
        }
        let beyond = x < self.x[0] || x > self.x[last];
        let x = match self.outside {
            Outside::Error if beyond => return None,
            Outside::Clamp => x.clamp(self.x[0], self.x[last]),
            _ => x,
        };
        let i = self.x.partition_point(|&p| p <= x).saturating_sub(1);
        Some((x - self.x[i], &self.pieces[i]))
    }
}

fn check(x: &[f64], y: &[f64], interpolation: Interpolation) -> Result<(), TableError> {
    if x.len() != y.len() {
        return Err(TableError::Lengths);
    }
    if x.len() < if interpolation == Interpolation::Step { 1 } else { 2 } {
        return Err(TableError::TooShort);
    }
    if let Some(i) = x.iter().zip(y).position(|(x, y)| !x.is_finite() || !y.is_finite()) {
        return Err(TableError::NotFinite(i));
    }
    match (1..x.len()).find(|&i| x[i] <= x[i - 1]) {
        Some(i) => Err(TableError::NotIncreasing(i)),
        None => Ok(()),
    }
}

fn lines(x: &[f64], y: &[f64]) -> Vec<[f64; 4]> {
    let mut pieces: Vec<_> =
        (1..x.len()).map(|i| [y[i - 1], (y[i] - y[i - 1]) / (x[i] - x[i - 1]), 0.0, 0.0]).collect();
    let last = pieces[pieces.len() - 1];
    pieces.push([y[y.len() - 1], last[1], 0.0, 0.0]);
    pieces
}

fn cubics(x: &[f64], y: &[f64]) -> Vec<[f64; 4]> {
    let n = x.len();
    let h: Vec<f64> = x.windows(2).map(|w| w[1] - w[0]).collect();
    let m: Vec<f64> = (1..n).map(|i| (y[i] - y[i - 1]) / h[i - 1]).collect();
    let slopes = monotone_slopes(&h, &m);
    let mut pieces: Vec<_> = (0..n - 1)
        .map(|i| {
            let (a, b) = (slopes[i], slopes[i + 1]);
            [y[i], a, (3.0 * m[i] - 2.0 * a - b) / h[i], (a + b - 2.0 * m[i]) / (h[i] * h[i])]
        })
        .collect();
    let [_, _, c, d] = pieces[n - 2];
    pieces.push([y[n - 1], slopes[n - 1], c + 3.0 * d * h[n - 2], d]);
    pieces
}

/// Slopes at the points such that no piece overshoots; `h` widths, `m` mean slopes of the intervals.
fn monotone_slopes(h: &[f64], m: &[f64]) -> Vec<f64> {
    let n = m.len();
    if n == 1 {
        return vec![m[0]; 2];
    }
    let inner = (1..n).map(|i| {
        if m[i - 1] * m[i] <= 0.0 {
            return 0.0;
        }
        let (w, v) = (2.0 * h[i] + h[i - 1], h[i] + 2.0 * h[i - 1]);
        (w + v) / (w / m[i - 1] + v / m[i])
    });
    let first = end_slope(h[0], h[1], m[0], m[1]);
    let last = end_slope(h[n - 1], h[n - 2], m[n - 1], m[n - 2]);
    std::iter::once(first).chain(inner).chain(std::iter::once(last)).collect()
}

fn end_slope(h: f64, next: f64, m: f64, beyond: f64) -> f64 {
    let slope = ((2.0 * h + next) * m - h * beyond) / (h + next);
    if slope * m <= 0.0 {
        0.0
    } else if m * beyond <= 0.0 && slope.abs() > 3.0 * m.abs() {
        3.0 * m
    } else {
        slope
    }
}
