//! A Jacobian at once where the system has it, else from directional derivatives, a group of columns at a time.

use crate::{Failure, Sparsity, System};

/// Rows up to this long have their columns grouped beforehand: that takes the square of their length, and what has longer
/// ones mostly has its Jacobian at once.
const LONG: usize = 256;

/// Computes the nonzeros of `∂f/∂x`; all memory is taken in [`new`](Jacobian::new), unless a long row asks for groups.
pub struct Jacobian {
    sparsity: Sparsity,
    groups: Option<Vec<Vec<usize>>>,
    direction: Vec<f64>,
    product: Vec<f64>,
    values: Vec<f64>,
}

impl Jacobian {
    /// For systems whose Jacobian has this pattern.
    pub fn new(sparsity: &Sparsity) -> Jacobian {
        let states = sparsity.states();
        Jacobian {
            sparsity: sparsity.clone(),
            groups: (sparsity.longest_row() <= LONG).then(|| sparsity.groups()),
            direction: vec![0.0; states],
            product: vec![0.0; states],
            values: vec![0.0; sparsity.nonzeros()],
        }
    }

    /// Calls `entry(row, column, place, value)` for every nonzero of the Jacobian at `(t, x)`; `place` is its number in
    /// the order of the pattern.
    ///
    /// # Errors
    /// What the system reports.
    pub fn visit(
        &mut self,
        system: &mut dyn System,
        t: f64,
        x: &[f64],
        mut entry: impl FnMut(usize, usize, usize, f64),
    ) -> Result<(), Failure> {
        if system.jacobian(t, x, &mut self.values)? {
            for column in 0..self.sparsity.states() {
                for (place, &row) in self.sparsity.places(column).zip(self.sparsity.column(column)) {
                    entry(row, column, place, self.values[place]);
                }
            }
            return Ok(());
        }
        let sparsity = &self.sparsity;
        for group in &*self.groups.get_or_insert_with(|| sparsity.groups()) {
            self.direction.fill(0.0);
            group.iter().for_each(|&column| self.direction[column] = 1.0);
            system.directional_derivative(t, x, &self.direction, &mut self.product)?;
            for &column in group {
                for (place, &row) in self.sparsity.places(column).zip(self.sparsity.column(column)) {
                    entry(row, column, place, self.product[row]);
                }
            }
        }
        Ok(())
    }
}
