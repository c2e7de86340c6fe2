//! A Jacobian at once where the system has it, else from directional derivatives, a group of columns at a time.

use crate::{Failure, Sparsity, System};

/// Rows up to this long have their columns grouped beforehand: that takes the square of their length, and what has longer
/// ones mostly has its Jacobian at once.
const LONG: usize = 256;

/// Part of the error that is allowed of a state by which slopes of steep laws are taken beside it: less than what Newton's method may leave, so that it ends where the
/// slope is steeper still, and so much that what it leaves tells how far it is from the solution.
const PART_OF_ERROR: f64 = 1e-3;

/// The golden ratio less 1: its multiples, less their whole parts, lie apart from each other.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// Computes the nonzeros of `∂f/∂x`; all memory is taken in [`new`](Jacobian::new), unless a long row asks for groups.
pub struct Jacobian {
    sparsity: Sparsity,
    groups: Option<Vec<Vec<usize>>>,
    direction: Vec<f64>,
    product: Vec<f64>,
    values: Vec<f64>,
    /// Errors that are allowed of each state, relative and absolute.
    allowed: Option<(f64, Vec<f64>)>,
    beside: Vec<f64>,
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
            allowed: None,
            beside: vec![0.0; states],
        }
    }

    /// The same for a method that allows errors, relative and absolute of each state.
    pub(crate) fn within(self, relative: f64, absolute: Vec<f64>) -> Jacobian {
        Jacobian { allowed: Some((relative, absolute)), ..self }
    }

    /// A point beside `x` where slopes of a [steep](System::is_steep) system are those over as much as may be off, no two states
    /// equally far; false where nobody has told how much that is. A slope without end would make every step seem to be solved.
    fn go_beside(&mut self, x: &[f64]) -> bool {
        let Some((relative, absolute)) = &self.allowed else { return false };
        for (i, ((beside, &x), absolute)) in self.beside.iter_mut().zip(x).zip(absolute).enumerate() {
            let far = PART_OF_ERROR * (absolute + relative * x.abs());
            *beside = x + far * (0.5 + (i as f64 * GOLDEN).fract());
        }
        true
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
        let x = if system.is_steep() && self.go_beside(x) { &self.beside } else { x };
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
