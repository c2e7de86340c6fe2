//! The linear equations of a balance of impulses: elimination with the greatest pivot there is each time, rows and columns
//! weighed so that the greatest entry of each is 1. The same operations stand in `emit/src/c/runtime/events.c`.

/// A pivot below this part of the greatest is none.
const RANK: f64 = 1e-11;

/// Rows of equations for unknowns, not less in number, with room for all of them.
#[derive(Debug, Clone, Default)]
pub(super) struct Elimination {
    /// How many unknowns there are.
    pub columns: usize,
    /// The matrix, row by row.
    pub matrix: Vec<f64>,
    /// What the equations miss.
    pub residual: Vec<f64>,
    /// The step that removes it.
    pub step: Vec<f64>,
    sizes: Vec<f64>,
    order: Vec<usize>,
}

impl Elimination {
    /// Room for so many equations and unknowns.
    pub fn new(rows: usize, columns: usize) -> Elimination {
        let room = |n: usize| Vec::with_capacity(n);
        Elimination {
            columns,
            matrix: room(rows * columns),
            residual: room(rows),
            step: room(columns),
            sizes: room(columns),
            order: Vec::with_capacity(columns),
        }
    }

    /// Equations without entries.
    pub fn clear(&mut self, rows: usize, columns: usize) {
        self.columns = columns;
        self.matrix.clear();
        self.matrix.resize(rows * columns, 0.0);
        self.residual.clear();
        self.residual.resize(rows, 0.0);
    }

    /// Finds the step, and spends matrix and residual for it; gives the rank. `None` if something is not finite.
    pub fn solve(&mut self) -> Option<usize> {
        if self.matrix.iter().chain(&self.residual).any(|v| !v.is_finite()) {
            return None;
        }
        self.weigh();
        let n = self.columns;
        self.order.clear();
        self.order.extend(0..n);
        let mut greatest = 0.0;
        for k in 0..n {
            let (row, column, pivot) = self.pivot(k);
            if k == 0 {
                greatest = pivot;
            }
            if pivot <= RANK * greatest {
                return Some(k);
            }
            self.exchange(k, row, column);
            self.eliminate(k);
        }
        self.step.clear();
        self.step.resize(n, 0.0);
        for i in (0..n).rev() {
            let mut sum = self.residual[i];
            for j in i + 1..n {
                sum -= self.matrix[i * n + j] * self.residual[j];
            }
            self.residual[i] = sum / self.matrix[i * n + i];
            let unknown = self.order[i];
            self.step[unknown] = self.residual[i] * self.sizes[unknown];
        }
        Some(n)
    }

    fn weigh(&mut self) {
        let n = self.columns;
        for (row, residual) in self.matrix.chunks_exact_mut(n.max(1)).zip(&mut self.residual) {
            let weight = inverse(row.iter().fold(0.0f64, |most, v| most.max(v.abs())));
            row.iter_mut().for_each(|v| *v *= weight);
            *residual = -*residual * weight;
        }
        self.sizes.clear();
        for j in 0..n {
            let size = inverse(self.matrix.iter().skip(j).step_by(n).fold(0.0f64, |most, v| most.max(v.abs())));
            self.matrix.iter_mut().skip(j).step_by(n).for_each(|v| *v *= size);
            self.sizes.push(size);
        }
    }

    /// The greatest entry from place `k` on, by row and column.
    fn pivot(&self, k: usize) -> (usize, usize, f64) {
        let n = self.columns;
        let mut found = (k, k, 0.0);
        for i in k..self.residual.len() {
            for j in k..n {
                let size = self.matrix[i * n + j].abs();
                if size > found.2 {
                    found = (i, j, size);
                }
            }
        }
        found
    }

    fn exchange(&mut self, k: usize, row: usize, column: usize) {
        let n = self.columns;
        for j in 0..n {
            self.matrix.swap(k * n + j, row * n + j);
        }
        for i in 0..self.residual.len() {
            self.matrix.swap(i * n + k, i * n + column);
        }
        self.residual.swap(k, row);
        self.order.swap(k, column);
    }

    fn eliminate(&mut self, k: usize) {
        let n = self.columns;
        for i in k + 1..self.residual.len() {
            let factor = self.matrix[i * n + k] / self.matrix[k * n + k];
            for j in k + 1..n {
                self.matrix[i * n + j] -= factor * self.matrix[k * n + j];
            }
            self.residual[i] -= factor * self.residual[k];
        }
    }
}

fn inverse(most: f64) -> f64 {
    if most > 0.0 { 1.0 / most } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn solved(matrix: &[f64], residual: &[f64], columns: usize) -> (Option<usize>, Vec<f64>) {
        let mut e = Elimination::new(residual.len(), columns);
        e.clear(residual.len(), columns);
        e.matrix.copy_from_slice(matrix);
        e.residual.copy_from_slice(residual);
        (e.solve(), e.step)
    }

    #[test]
    fn magnitudes_and_order_say_nothing() {
        // 2e9 y = 4e9, 1e-9 x + 1e-9 y = 3e-9.
        let (rank, step) = solved(&[0.0, 2e9, 1e-9, 1e-9], &[-4e9, -3e-9], 2);
        assert!(rank == Some(2) && step.iter().zip([1.0, 2.0]).all(|(a, b)| (a - b).abs() < 1e-15), "{step:?}");
        // One more that fits.
        assert_eq!(solved(&[1.0, 2.0], &[-3.0, -6.0], 1), (Some(1), vec![3.0]));
    }

    #[test]
    fn what_depends_on_each_other_has_less_rank() {
        assert_eq!(solved(&[1.0, 2.0, 2.0, 4.0], &[1.0, 2.0], 2).0, Some(1));
        assert_eq!(solved(&[0.0], &[1.0], 1).0, Some(0));
        assert_eq!(solved(&[f64::NAN], &[1.0], 1).0, None);
    }
}
