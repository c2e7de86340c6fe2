//! Sparse linear equations that may leave unknowns open.
//!
//! What is singular is bordered: an equation that follows from others is given up for the choice of an unknown that is
//! open, until what is left is regular. Source: [Govaerts], chapter 3.

use halfarrow_sim::{SparseLu, Sparsity};

/// A matrix whose rows and columns have a greatest entry of 1 is singular if some direction changes by less than this.
const SINGULAR: f64 = 1e-12;
/// What is added to the diagonal to find out where a matrix is singular.
const BESIDE: f64 = 1e-10;
/// Unknowns that may be open at most.
const MOST_OPEN: usize = 64;
/// Below this part of it, a direction lies in those before it.
const WITHIN: f64 = 1e-6;

/// Row, column and value.
pub(super) type Entry = (usize, usize, f64);

/// Square equations: entries, of which those in one place add up, and right sides.
pub(super) struct OpenEquations {
    pub entries: Vec<Entry>,
    pub right: Vec<f64>,
}

/// A solution, and the directions, orthonormal in the first `part` unknowns, along which there are others. The first `part`
/// unknowns of the solution are the shortest.
pub(super) struct Solution {
    pub x: Vec<f64>,
    pub open: Vec<Vec<f64>>,
}

impl OpenEquations {
    /// Solves them. `None` if too much is open, or something is not finite.
    pub fn solve(mut self, part: usize) -> Option<Solution> {
        let size = self.right.len();
        let scales = self.balance();
        let mut lu = self.regular();
        while lu.is_none() && self.right.len() < size + MOST_OPEN {
            let (equation, unknown) = self.weakest()?;
            let border = self.right.len();
            self.entries.extend([(equation, border, 1.0), (border, unknown, 1.0)]);
            self.right.push(0.0);
            lu = self.regular();
        }
        let mut lu = lu?;
        let mut solved = |mut b: Vec<f64>| {
            lu.solve(&mut b);
            b.iter_mut().zip(&scales).for_each(|(x, scale)| *x *= scale);
            b.truncate(part);
            b.iter().all(|x| x.is_finite()).then_some(b)
        };
        let unit = |border: usize| (0..self.right.len()).map(|i| f64::from(u8::from(i == border))).collect();
        let mut open: Vec<Vec<f64>> = Vec::new();
        for border in size..self.right.len() {
            let mut direction = solved(unit(border))?;
            let before = norm(&direction);
            (0..2).for_each(|_| open.iter().for_each(|other| take_off(&mut direction, other)));
            let length = norm(&direction);
            if length > WITHIN * before && length > 0.0 {
                direction.iter_mut().for_each(|d| *d /= length);
                open.push(direction);
            }
        }
        let mut x = solved(self.right.clone())?;
        open.iter().for_each(|direction| take_off(&mut x, direction));
        Some(Solution { x, open })
    }

    /// Divides rows, then columns by their greatest entries; what unknowns then count in.
    fn balance(&mut self) -> Vec<f64> {
        let rows = greatest(self.right.len(), self.entries.iter().map(|e| (e.0, e.2)));
        self.entries.iter_mut().for_each(|e| e.2 *= rows[e.0]);
        self.right.iter_mut().zip(&rows).for_each(|(b, row)| *b *= row);
        let columns = greatest(self.right.len(), self.entries.iter().map(|e| (e.1, e.2)));
        self.entries.iter_mut().for_each(|e| e.2 *= columns[e.1]);
        columns
    }

    /// The factors of the matrix, if it is regular.
    fn regular(&self) -> Option<SparseLu<f64>> {
        let mut lu = factors(self.right.len(), self.entries.iter().copied())?;
        (slowest(&mut lu, self.right.len()).0 > SINGULAR).then_some(lu)
    }

    /// An equation and an unknown without which less is open: where the directions are greatest that the matrix nearly
    /// takes to nothing, from the left and from the right.
    fn weakest(&self) -> Option<(usize, usize)> {
        let size = self.right.len();
        let mut next = numbers();
        let beside: Vec<Entry> = (0..size).map(|i| (i, i, BESIDE * (1.5 + next()))).collect();
        let greatest = |turned: bool| {
            let turn = |&(i, j, v): &Entry| if turned { (j, i, v) } else { (i, j, v) };
            let (_, v) = slowest(&mut factors(size, self.entries.iter().chain(&beside).map(turn))?, size);
            (0..size).max_by(|&a, &b| v[a].abs().total_cmp(&v[b].abs()).then(b.cmp(&a)))
        };
        Some((greatest(true)?, greatest(false)?))
    }
}

/// How little a direction of length 1 may change, and that direction: inverse iteration.
fn slowest(lu: &mut SparseLu<f64>, size: usize) -> (f64, Vec<f64>) {
    let mut next = numbers();
    let mut v: Vec<f64> = (0..size).map(|_| next()).collect();
    let mut least = 0.0;
    for _ in 0..3 {
        let length = norm(&v);
        v.iter_mut().for_each(|v| *v /= length);
        lu.solve(&mut v);
        least = 1.0 / norm(&v);
    }
    (least, v)
}

fn factors(size: usize, entries: impl Iterator<Item = Entry> + Clone) -> Option<SparseLu<f64>> {
    let mut columns = vec![Vec::new(); size];
    entries.clone().for_each(|(i, j, _)| columns[j].push(i));
    let pattern = Sparsity::from_columns(columns);
    let mut lu = SparseLu::new(&pattern);
    let values = lu.values();
    entries.for_each(|(i, j, v)| values[pattern.place(i, j)] += v);
    lu.factor().then_some(lu)
}

/// For each of the rows, or columns, one over the greatest entry.
pub(super) fn greatest(size: usize, entries: impl Iterator<Item = (usize, f64)>) -> Vec<f64> {
    let mut most = vec![0.0f64; size];
    entries.for_each(|(i, v)| most[i] = most[i].max(v.abs()));
    most.into_iter().map(super::super::minimum_norm::inverse).collect()
}

/// Numbers between -0.5 and 0.5, always the same.
fn numbers() -> impl FnMut() -> f64 {
    let mut seed = 1.0;
    move || {
        seed = (seed * 16807.0) % 2147483647.0;
        seed / 2147483647.0 - 0.5
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn norm(v: &[f64]) -> f64 {
    dot(v, v).sqrt()
}

/// Subtracts the projection on a unit vector.
fn take_off(from: &mut [f64], along: &[f64]) {
    let share = dot(from, along);
    from.iter_mut().zip(along).for_each(|(v, a)| *v -= share * a);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ring of `n` equal conductances, `leak` to ground at each node, fed at the first and emptied at the last.
    fn ring(n: usize, leak: f64) -> OpenEquations {
        let entries = (0..n).flat_map(|i| [(i, i, 2.0 + leak), (i, (i + 1) % n, -1.0), (i, (i + n - 1) % n, -1.0)]);
        let right = (0..n).map(|i| f64::from(u8::from(i == 0)) - f64::from(u8::from(i == n / 2)));
        OpenEquations { entries: entries.collect(), right: right.collect() }
    }

    #[test]
    fn what_is_regular_has_one_solution() {
        let found = ring(100, 0.1).solve(100).expect("regular");
        assert!(found.open.is_empty());
        let left = 2.1 * found.x[0] - found.x[1] - found.x[99] - 1.0;
        // Four terms of about 1, each with some rounding of its own.
        assert!(left.abs() < 16.0 * f64::EPSILON, "{left}");
    }

    /// Potentials without ground: any of them may be added to all, and the shortest has a mean of 0.
    #[test]
    fn what_is_open_is_found_and_the_shortest_taken() {
        let found = ring(100, 0.0).solve(100).expect("consistent");
        assert_eq!(found.open.len(), 1);
        assert!(found.open[0].iter().all(|v| (v.abs() - 0.1).abs() < 1e-12));
        let sum: f64 = found.x.iter().sum();
        assert!(sum.abs() < 1e-11 && (found.x[0] - found.x[50] - 25.0).abs() < 1e-11, "{sum} {}", found.x[0]);
    }

    #[test]
    fn several_directions_may_be_open() {
        let mut rings = ring(60, 0.0);
        for shift in [60, 120] {
            let other = ring(60, if shift == 60 { 0.0 } else { 1.0 });
            rings.entries.extend(other.entries.into_iter().map(|(i, j, v)| (i + shift, j + shift, v)));
            rings.right.extend(other.right);
        }
        assert_eq!(rings.solve(180).expect("consistent").open.len(), 2);
    }
}
