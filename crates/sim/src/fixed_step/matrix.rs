//! The matrix of an implicit step: the unit matrix less a multiple of the Jacobian.

use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::prelude::Reborrow as _;
use faer::sparse::linalg::lu::{LuRef, NumericLu, SymbolicLu, factorize_symbolic_lu};
use faer::sparse::{SparseColMat, SymbolicSparseColMat};
use faer::{Conj, MatMut, Par};

use crate::jacobian::Jacobian;
use crate::lu::Lu;
use crate::{Failure, Sparsity, System};

/// States up to which a dense matrix is faster, whatever the pattern.
const LARGEST_DENSE: usize = 24;

/// Part of all entries beyond which it is faster at any size.
const FULL: f64 = 0.25;

/// `1 - factor · ∂f/∂x` and its triangular factors; all memory is taken in [`new`](StepMatrix::new), but for what the
/// sparse factors of the first steps take more.
pub(super) struct StepMatrix {
    jacobian: Jacobian,
    factors: Factors,
}

enum Factors {
    Dense(Lu),
    Sparse(Box<Sparse>),
}

impl StepMatrix {
    pub(super) fn new(sparsity: &Sparsity) -> StepMatrix {
        let states = sparsity.states();
        let is_full = sparsity.nonzeros() as f64 > FULL * (states * states) as f64;
        let sparse = (states > LARGEST_DENSE && !is_full).then(|| Sparse::new(sparsity)).flatten();
        StepMatrix {
            jacobian: Jacobian::new(sparsity),
            factors: sparse.map_or_else(|| Factors::Dense(Lu::new(states)), |sparse| Factors::Sparse(Box::new(sparse))),
        }
    }

    /// Factors the matrix for the Jacobian at `(t, x)`.
    ///
    /// # Errors
    /// What the system reports, or no pivot is left.
    pub(super) fn factor(&mut self, system: &mut dyn System, t: f64, x: &[f64], factor: f64) -> Result<(), Failure> {
        let singular = |state: Option<usize>, system: &dyn System| Failure::Singular {
            time: t,
            what: state.map_or("the step".into(), |state| format!("the step of {}", system.state_name(state))),
        };
        match &mut self.factors {
            Factors::Dense(matrix) => {
                matrix.set_unit();
                self.jacobian.visit(system, t, x, |row, column, _, value| matrix.add(row, column, -factor * value))?;
                matrix.factor().map_err(|column| singular(Some(column), system))
            }
            Factors::Sparse(sparse) => {
                sparse.set_unit();
                self.jacobian.visit(system, t, x, |_, _, place, value| sparse.add(place, -factor * value))?;
                sparse.factor().ok_or_else(|| singular(None, system))
            }
        }
    }

    /// Replaces `b` by the solution.
    pub(super) fn solve(&mut self, b: &mut [f64]) {
        match &mut self.factors {
            Factors::Dense(matrix) => matrix.solve(b),
            Factors::Sparse(sparse) => sparse.solve(b),
        }
    }
}

/// A sparse matrix and its factors; the choice of an order is made once.
struct Sparse {
    symbolic: SymbolicLu<usize>,
    matrix: SparseColMat<usize, f64>,
    /// Where the nonzeros of the Jacobian and the diagonal stand.
    places: Vec<usize>,
    diagonal: Vec<usize>,
    factors: NumericLu<usize, f64>,
    memory: MemBuffer,
}

impl Sparse {
    /// `None` if there is no memory for it.
    fn new(sparsity: &Sparsity) -> Option<Sparse> {
        let states = sparsity.states();
        let with_diagonal = Sparsity::from_columns((0..states).map(|column| {
            let mut rows = sparsity.column(column).to_vec();
            rows.push(column);
            rows
        }));
        let place = |row: usize, column: usize| {
            let found = with_diagonal.column(column).binary_search(&row).expect("a larger pattern");
            with_diagonal.places(column).start + found
        };
        let mut starts = vec![0];
        let mut rows = Vec::with_capacity(with_diagonal.nonzeros());
        for column in 0..states {
            rows.extend_from_slice(with_diagonal.column(column));
            starts.push(rows.len());
        }
        let structure = SymbolicSparseColMat::new_checked(states, states, starts, None, rows);
        let symbolic = factorize_symbolic_lu(structure.rb(), Default::default()).ok()?;
        let need = StackReq::any_of(&[
            symbolic.factorize_numeric_lu_scratch::<f64>(Par::Seq, Default::default()),
            symbolic.solve_in_place_scratch::<f64>(1, Par::Seq),
        ]);
        let mut sparse = Sparse {
            symbolic,
            matrix: SparseColMat::new(structure, vec![0.0; with_diagonal.nonzeros()]),
            places: sparsity.entries().map(|(row, column)| place(row, column)).collect(),
            diagonal: (0..states).map(|i| place(i, i)).collect(),
            factors: NumericLu::new(),
            memory: MemBuffer::try_new(need).ok()?,
        };
        // Takes the memory that a factorisation without exchanges needs.
        sparse.matrix.val_mut().fill(1e-3);
        sparse.diagonal.iter().for_each(|&place| sparse.matrix.val_mut()[place] = 1.0);
        sparse.factor()?;
        Some(sparse)
    }

    fn set_unit(&mut self) {
        let values = self.matrix.val_mut();
        values.fill(0.0);
        self.diagonal.iter().for_each(|&place| values[place] = 1.0);
    }

    fn add(&mut self, place: usize, value: f64) {
        self.matrix.val_mut()[self.places[place]] += value;
    }

    /// `None` if the matrix is singular.
    fn factor(&mut self) -> Option<()> {
        let stack = MemStack::new(&mut self.memory);
        let matrix = self.matrix.rb();
        self.symbolic.factorize_numeric_lu(&mut self.factors, matrix, Par::Seq, stack, Default::default()).ok()?;
        Some(())
    }

    fn solve(&mut self, b: &mut [f64]) {
        let factors = LuRef::new_unchecked(&self.symbolic, &self.factors);
        let rows = b.len();
        let b = MatMut::from_column_major_slice_mut(b, rows, 1);
        factors.solve_in_place_with_conj(Conj::No, b, Par::Seq, MemStack::new(&mut self.memory));
    }
}
