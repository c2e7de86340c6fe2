//! The matrix of an implicit step: the unit matrix less a multiple of the Jacobian.

use crate::jacobian::Jacobian;
use crate::linear::{Lu, SparseLu};
use crate::{Failure, Sparsity, System};

/// States up to which a dense matrix is faster, whatever the pattern.
const LARGEST_DENSE: usize = 24;

/// Part of all entries beyond which it is faster at any size.
const FULL: f64 = 0.25;

/// `1 - factor · ∂f/∂x` and its triangular factors; all memory is taken in [`new`](StepMatrix::new), unless a sparse matrix
/// needs its rows exchanged.
pub(super) struct StepMatrix {
    jacobian: Jacobian,
    /// Rows of one of the equal blocks on the diagonal.
    block: usize,
    /// Whether the matrix is the transposed one.
    transposed: bool,
    factors: Factors,
}

enum Factors {
    Dense(Lu),
    Sparse(Box<Sparse>),
}

impl StepMatrix {
    /// For a pattern of so many equal blocks on the diagonal, of which one is factored.
    pub(super) fn new(sparsity: &Sparsity, blocks: usize) -> StepMatrix {
        let jacobian = Jacobian::new(sparsity);
        let sparsity = &sparsity.first_block(blocks);
        let states = sparsity.states();
        let is_full = sparsity.nonzeros() as f64 > FULL * (states * states) as f64;
        StepMatrix {
            jacobian,
            block: states,
            transposed: false,
            factors: match states > LARGEST_DENSE && !is_full {
                true => Factors::Sparse(Box::new(Sparse::new(sparsity))),
                false => Factors::Dense(Lu::new(states)),
            },
        }
    }

    /// The same for the transposed matrix.
    pub(super) fn transposed(sparsity: &Sparsity) -> StepMatrix {
        let matrix = StepMatrix::new(&sparsity.transposed(), 1);
        StepMatrix { jacobian: Jacobian::new(sparsity), transposed: true, ..matrix }
    }

    /// Factors the matrix for the Jacobian at `(t, x)`, and shows its entries: `see(row, column, value)`.
    ///
    /// # Errors
    /// What the system reports, or no pivot is left.
    pub(super) fn factor(
        &mut self,
        system: &mut dyn System,
        t: f64,
        x: &[f64],
        factor: f64,
        mut see: impl FnMut(usize, usize, f64),
    ) -> Result<(), Failure> {
        let (block, transposed) = (self.block, self.transposed);
        match &mut self.factors {
            Factors::Dense(matrix) if transposed => {
                matrix.set_unit();
                self.jacobian.visit(system, t, x, |row, column, _, value| matrix.add(column, row, -factor * value))?;
                matrix.factor().map_err(|column| singular(t, Some(column), system))
            }
            Factors::Sparse(sparse) if transposed => {
                sparse.set_unit();
                self.jacobian.visit(system, t, x, |row, column, _, value| {
                    sparse.add_at((column, row), -factor * value);
                })?;
                sparse.lu.factor().then_some(()).ok_or_else(|| singular(t, None, system))
            }
            Factors::Dense(matrix) => {
                matrix.set_unit();
                self.jacobian.visit(system, t, x, |row, column, _, value| {
                    if column < block {
                        matrix.add(row, column, -factor * value);
                    }
                    see(row, column, value);
                })?;
                matrix.factor().map_err(|column| singular(t, Some(column), system))
            }
            Factors::Sparse(sparse) => {
                sparse.set_unit();
                self.jacobian.visit(system, t, x, |row, column, place, value| {
                    if column < block {
                        sparse.add(place, -factor * value);
                    }
                    see(row, column, value);
                })?;
                sparse.lu.factor().then_some(()).ok_or_else(|| singular(t, None, system))
            }
        }
    }

    /// Factors the matrix for a Jacobian with these nonzeros, in the order of its pattern.
    ///
    /// # Errors
    /// No pivot is left.
    pub(super) fn factor_values(
        &mut self,
        system: &dyn System,
        t: f64,
        values: &[f64],
        factor: f64,
    ) -> Result<(), Failure> {
        match &mut self.factors {
            Factors::Dense(matrix) => {
                matrix.set_unit();
                let entries = system.sparsity().entries().zip(values);
                entries.for_each(|((row, column), value)| matrix.add(row, column, -factor * value));
                matrix.factor().map_err(|column| singular(t, Some(column), system))
            }
            Factors::Sparse(sparse) => {
                sparse.set_unit();
                values.iter().enumerate().for_each(|(place, value)| sparse.add(place, -factor * value));
                sparse.lu.factor().then_some(()).ok_or_else(|| singular(t, None, system))
            }
        }
    }

    /// Replaces `b` by the solution.
    pub(super) fn solve(&mut self, b: &mut [f64]) {
        for b in b.chunks_mut(self.block.max(1)) {
            match &mut self.factors {
                Factors::Dense(matrix) => matrix.solve(b),
                Factors::Sparse(sparse) => sparse.lu.solve(b),
            }
        }
    }
}

/// No pivot is left for a state, or for one that is not known.
fn singular(time: f64, state: Option<usize>, system: &dyn System) -> Failure {
    let what = state.map_or("the step".into(), |state| format!("the step of {}", system.state_name(state)));
    Failure::Singular { time, what }
}

/// A sparse matrix and its factors.
struct Sparse {
    lu: SparseLu<f64>,
    pattern: Sparsity,
    /// Where the nonzeros of the Jacobian and the diagonal stand.
    places: Vec<usize>,
    diagonal: Vec<usize>,
}

impl Sparse {
    fn new(sparsity: &Sparsity) -> Sparse {
        let pattern = sparsity.with_diagonal();
        Sparse {
            lu: SparseLu::new(&pattern),
            places: sparsity.entries().map(|(row, column)| pattern.place(row, column)).collect(),
            diagonal: (0..sparsity.states()).map(|i| pattern.place(i, i)).collect(),
            pattern,
        }
    }

    fn set_unit(&mut self) {
        let values = self.lu.values();
        values.fill(0.0);
        self.diagonal.iter().for_each(|&place| values[place] = 1.0);
    }

    fn add(&mut self, place: usize, value: f64) {
        self.lu.values()[self.places[place]] += value;
    }

    fn add_at(&mut self, (row, column): (usize, usize), value: f64) {
        let place = self.pattern.place(row, column);
        self.lu.values()[place] += value;
    }
}
