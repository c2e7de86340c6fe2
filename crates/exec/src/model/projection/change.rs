//! The least change of unknowns by which linear equations are met, of rows and columns of any magnitude. Takes no memory.
//!
//! Rows are made orthogonal one after the other, the longest first (Gram-Schmidt, twice); the change is the sum of what each
//! asks for beyond those before it. Rows that follow from others ask for nothing. Source: [GVL], 5.2.

/// What is left of a row that others tell below this part of it is rounding.
const RANK: f64 = 1e-11;

/// Room for equations.
#[derive(Debug, Clone)]
pub(super) struct LeastChange {
    unknowns: usize,
    /// What counts as one of each unknown.
    sizes: Vec<f64>,
    /// The rows in these, each of length 1 or what is left of it.
    rows: Vec<f64>,
    /// What is missing in each row.
    missing: Vec<f64>,
    taken: Vec<bool>,
    step: Vec<f64>,
}

impl LeastChange {
    pub fn new(equations: usize, unknowns: usize) -> LeastChange {
        LeastChange {
            unknowns,
            sizes: vec![1.0; unknowns],
            rows: vec![0.0; equations * unknowns],
            missing: vec![0.0; equations],
            taken: vec![false; equations],
            step: vec![0.0; unknowns],
        }
    }

    /// The shortest of the changes that meet `slopes · step + by = 0`, each unknown counting in parts of its size; `None` if
    /// something is not finite.
    pub fn find(&mut self, slopes: &[f64], by: &[f64], sizes: impl Iterator<Item = f64>) -> Option<&[f64]> {
        if slopes.iter().chain(by).any(|value| !value.is_finite()) {
            return None;
        }
        self.sizes.iter_mut().zip(sizes).for_each(|(own, size)| *own = size);
        self.weigh(slopes, by);
        self.taken.fill(false);
        self.step.fill(0.0);
        while let Some((row, length)) = self.longest() {
            if length <= RANK {
                break;
            }
            self.take(row, length);
        }
        self.step.iter_mut().zip(&self.sizes).for_each(|(step, size)| *step *= size);
        Some(&self.step)
    }

    /// Rows in parts of the unknowns, each of length 1.
    fn weigh(&mut self, slopes: &[f64], by: &[f64]) {
        let n = self.unknowns;
        for (k, by) in by.iter().enumerate() {
            let row = &mut self.rows[k * n..][..n];
            for (entry, (slope, size)) in row.iter_mut().zip(slopes[k * n..].iter().zip(&self.sizes)) {
                *entry = slope * size;
            }
            let length = dot(row, row).sqrt();
            let weight = if length > 0.0 { 1.0 / length } else { 0.0 };
            row.iter_mut().for_each(|entry| *entry *= weight);
            self.missing[k] = -by * weight;
        }
    }

    /// The longest row that is not taken yet.
    fn longest(&self) -> Option<(usize, f64)> {
        let n = self.unknowns;
        let open = (0..self.taken.len()).filter(|&k| !self.taken[k]);
        let lengths = open.map(|k| (k, dot(&self.rows[k * n..][..n], &self.rows[k * n..][..n]).sqrt()));
        lengths.fold(
            None,
            |most: Option<(usize, f64)>, one| if most.is_none_or(|m| one.1 > m.1) { Some(one) } else { most },
        )
    }

    /// Goes along a row as far as it asks for, and takes its direction out of those that are left.
    fn take(&mut self, row: usize, length: f64) {
        let n = self.unknowns;
        self.taken[row] = true;
        let wanted = self.missing[row] / length;
        self.rows[row * n..][..n].iter_mut().for_each(|entry| *entry /= length);
        for (step, entry) in self.step.iter_mut().zip(&self.rows[row * n..][..n]) {
            *step += wanted * entry;
        }
        for other in (0..self.taken.len()).filter(|&k| !self.taken[k]) {
            // Twice: what the first time leaves of the direction is rounding.
            for _ in 0..2 {
                let along = dot(&self.rows[row * n..][..n], &self.rows[other * n..][..n]);
                for i in 0..n {
                    self.rows[other * n + i] -= along * self.rows[row * n + i];
                }
                self.missing[other] -= along * wanted;
            }
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn least(slopes: &[f64], by: &[f64], sizes: &[f64]) -> Vec<f64> {
        let mut change = LeastChange::new(by.len(), sizes.len());
        change.find(slopes, by, sizes.iter().copied()).expect("numbers").to_vec()
    }

    fn near(a: &[f64], b: &[f64]) {
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-14 * (1.0 + b.abs())), "{a:?} {b:?}");
    }

    #[test]
    fn the_shortest_change_that_meets_all() {
        near(&least(&[1.0, 1.0], &[-2.0], &[1.0, 1.0]), &[1.0, 1.0]);
        // Of an unknown that counts half as much the change is a quarter of it.
        near(&least(&[1.0, 1.0], &[-5.0], &[2.0, 1.0]), &[4.0, 1.0]);
        // Three unknowns, two equations: the least of x + y + z = 6 and x - z = 2 is (3, 2, 1).
        near(&least(&[1.0, 1.0, 1.0, 1.0, 0.0, -1.0], &[-6.0, -2.0], &[1.0; 3]), &[3.0, 2.0, 1.0]);
        // A row that repeats others by another factor asks for nothing.
        near(&least(&[1.0, 1.0, 1e6, 1e6], &[-2.0, -2e6], &[1.0, 1.0]), &[1.0, 1.0]);
        // Rows that are nearly the same tell as much less as they differ less.
        let e = 1e-7;
        let found = least(&[1.0, 0.0, 1.0, e], &[-1.0, -1.0 - 3.0 * e], &[1.0, 1.0]);
        assert!((found[0] - 1.0).abs() < 1e-14 && (found[1] - 3.0).abs() < 4.0 * f64::EPSILON / e, "{found:?}");
        assert!(LeastChange::new(1, 1).find(&[f64::NAN], &[1.0], [1.0].into_iter()).is_none());
    }
}
