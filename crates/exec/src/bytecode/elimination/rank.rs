//! Elimination that finds the rank: the greatest pivot there is each time, rows and columns exchanged, down to pivots of 1,
//! which stand for rounding; then the shortest solution.

/// A scaled matrix with its right side: rows in units of their rounding, columns in magnitudes of their unknowns.
#[derive(Debug, Clone)]
pub(crate) struct RankRevealing {
    /// The matrix, row by row.
    pub matrix: Vec<f64>,
    /// The right side, then the solution by place.
    pub right: Vec<f64>,
    /// The unknown in each place.
    pub order: Vec<usize>,
    /// Directions of length 1 of which the equations say nothing, one after the other.
    free: Vec<f64>,
}

impl RankRevealing {
    /// For so many unknowns; without a matrix where `only_right`.
    pub fn new(size: usize, only_right: bool) -> RankRevealing {
        let square = vec![0.0; if only_right { 0 } else { size * size }];
        RankRevealing { matrix: square.clone(), right: vec![0.0; size], order: vec![0; size], free: square }
    }

    /// Whether there is a matrix.
    pub fn has_matrix(&self) -> bool {
        self.matrix.len() == self.order.len() * self.order.len()
    }

    /// Unknowns in their own places, an empty matrix.
    pub fn clear(&mut self) {
        self.order.iter_mut().enumerate().for_each(|(place, unknown)| *unknown = place);
        self.matrix.fill(0.0);
    }

    /// Eliminates; how many pivots there are.
    pub fn eliminate(&mut self) -> usize {
        let n = self.order.len();
        for k in 0..n {
            let (mut row, mut column, mut most) = (k, k, 1.0f64);
            for i in k..n {
                for j in k..n {
                    let size = self.matrix[i * n + j].abs();
                    if size > most {
                        (row, column, most) = (i, j, size);
                    }
                }
            }
            if most <= 1.0 {
                return k;
            }
            self.exchange(k, row, column);
            for i in k + 1..n {
                let factor = self.matrix[i * n + k] / self.matrix[k * n + k];
                for j in k + 1..n {
                    self.matrix[i * n + j] -= factor * self.matrix[k * n + j];
                }
                self.right[i] -= factor * self.right[k];
            }
        }
        n
    }

    fn exchange(&mut self, k: usize, row: usize, column: usize) {
        let n = self.order.len();
        for j in 0..n {
            self.matrix.swap(k * n + j, row * n + j);
        }
        for i in 0..n {
            self.matrix.swap(i * n + k, i * n + column);
        }
        self.right.swap(k, row);
        self.order.swap(k, column);
    }

    /// The last pivot of a matrix of full rank, which is the least.
    pub fn least_pivot(&self) -> f64 {
        self.matrix.last().map_or(f64::INFINITY, |pivot| pivot.abs())
    }

    /// Replaces the right-hand side by the solution of minimum norm, and calls `free` with each unknown and its component in
    /// each vector of an orthonormal basis of the null space.
    pub fn minimum_norm(&mut self, rank: usize, mut free: impl FnMut(usize, f64)) {
        let n = self.order.len();
        self.right[rank..].fill(0.0);
        back(&self.matrix, n, rank, &mut self.right);
        for place in rank..n {
            let (known, direction) = self.free.split_at_mut((place - rank) * n);
            let direction = &mut direction[..n];
            direction.fill(0.0);
            direction.iter_mut().take(rank).enumerate().for_each(|(i, v)| *v = -self.matrix[i * n + place]);
            back(&self.matrix, n, rank, direction);
            direction[place] = 1.0;
            known.chunks_exact(n).for_each(|other| take_off(direction, other));
            let length = dot(direction, direction).sqrt();
            direction.iter_mut().for_each(|v| *v /= length);
            take_off(&mut self.right, direction);
            direction.iter().zip(&self.order).for_each(|(&v, &unknown)| free(unknown, v));
        }
    }
}

/// Back substitution in the triangle of the first `rank` places.
fn back(matrix: &[f64], n: usize, rank: usize, b: &mut [f64]) {
    for i in (0..rank).rev() {
        let row = &matrix[i * n..][..rank];
        let (here, known) = b[i..rank].split_at_mut(1);
        row[i + 1..].iter().zip(known).for_each(|(a, known)| here[0] -= a * *known);
        here[0] /= row[i];
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sum = 0.0;
    a.iter().zip(b).for_each(|(a, b)| sum += a * b);
    sum
}

/// Subtracts the projection on a unit vector.
fn take_off(from: &mut [f64], along: &[f64]) {
    let share = dot(from, along);
    from.iter_mut().zip(along).for_each(|(v, a)| *v -= share * a);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shortest_of_many_solutions_is_found() {
        // 3 x + 4 y = 10 twice, and nothing of z.
        let mut equations = RankRevealing::new(3, false);
        equations.clear();
        for row in 0..2 {
            equations.matrix[row * 3..][..2].copy_from_slice(&[30.0, 40.0]);
            equations.right[row] = 100.0;
        }
        let rank = equations.eliminate();
        assert_eq!(rank, 1);
        let mut free = [0.0f64; 3];
        equations.minimum_norm(rank, |unknown, component| free[unknown] = free[unknown].max(component.abs()));
        let mut x = [0.0; 3];
        equations.order.iter().zip(&equations.right).for_each(|(&unknown, &value)| x[unknown] = value);
        for (x, wanted) in x.iter().zip([1.2, 1.6, 0.0]) {
            assert!((x - wanted).abs() < 1e-15, "{x} {wanted}");
        }
        assert!(free[2] == 1.0 && (free[0] - 0.8).abs() < 1e-15 && (free[1] - 0.6).abs() < 1e-15, "{free:?}");
    }

    #[test]
    fn of_full_rank_it_is_a_solution() {
        let mut equations = RankRevealing::new(2, false);
        equations.clear();
        equations.matrix.copy_from_slice(&[0.0, 8.0, 4.0, 2.0]);
        equations.right.copy_from_slice(&[8.0, 8.0]);
        assert_eq!(equations.eliminate(), 2);
        assert_eq!(equations.least_pivot(), 4.0);
        equations.minimum_norm(2, |_, _| unreachable!("full rank"));
        assert_eq!((equations.order, equations.right), (vec![1, 0], vec![1.0, 1.5]));
    }
}
