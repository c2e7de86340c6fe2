//! The linear equations of a step: one real and one complex matrix of the size of the system.

use faer::c64;

use crate::Sparsity;
use crate::linear::{ComplexLu, Lu, SparseLu};

/// Unknowns up to which dense matrices are faster, whatever the pattern.
const LARGEST_DENSE: usize = 32;

/// Part of all entries beyond which they are faster at any size.
const FULL: f64 = 0.25;

/// Times that rows and columns are balanced against each other.
const SWEEPS: usize = 12;

/// `factor · ∂F/∂y' + ∂F/∂y` for a real and a complex factor, and their triangular factors. Rows are measured by what
/// their equation adds up when each unknown has its scale, columns by their greatest entry then, so that pivots are chosen
/// alike whatever the units.
pub(super) struct Matrices {
    pattern: Sparsity,
    /// Factor of each column.
    columns: Vec<f64>,
    /// Factor of each row.
    rows: Vec<f64>,
    factors: Factors,
}

enum Factors {
    Dense { real: Lu, complex: ComplexLu },
    Sparse(Box<Sparse>),
}

/// Sparse matrices and their factors.
struct Sparse {
    real: SparseLu<f64>,
    complex: SparseLu<c64>,
    work: Vec<c64>,
}

/// Why there is no factorisation.
pub(super) struct NoPivot {
    /// The unknown for which no pivot is left, where that is known.
    pub(super) unknown: Option<usize>,
}

impl Matrices {
    /// For a pattern of so many equal blocks on the diagonal, of which one is factored.
    pub(super) fn new(pattern: &Sparsity, blocks: usize) -> Matrices {
        let pattern = &pattern.first_block(blocks);
        let size = pattern.states();
        let is_full = pattern.nonzeros() as f64 > FULL * (size * size) as f64;
        let factors = match size > LARGEST_DENSE && !is_full {
            true => Factors::Sparse(Box::new(Sparse {
                real: SparseLu::new(pattern),
                complex: SparseLu::new(pattern),
                work: vec![c64::default(); size],
            })),
            false => Factors::Dense { real: Lu::new(size), complex: ComplexLu::new(size) },
        };
        Matrices { pattern: pattern.clone(), columns: vec![1.0; size], rows: vec![1.0; size], factors }
    }

    /// Factors both matrices, for unknowns of these scales.
    pub(super) fn factor(
        &mut self,
        (dy, dyp): (&[f64], &[f64]),
        real: f64,
        complex: c64,
        scales: &[f64],
    ) -> Result<(), NoPivot> {
        self.measure(dy, dyp, real, scales);
        self.factor_scaled(dy, dyp, real, complex).or_else(|_| {
            // The scales may be far from what the equations make of each other.
            self.balance(dy, dyp, real);
            self.factor_scaled(dy, dyp, real, complex)
        })
    }

    fn factor_scaled(&mut self, dy: &[f64], dyp: &[f64], real: f64, complex: c64) -> Result<(), NoPivot> {
        let entries = self.pattern.entries().enumerate().map(|(place, (row, column))| {
            let scale = self.rows[row] * self.columns[column];
            (place, row, column, scale * dy[place], scale * dyp[place])
        });
        match &mut self.factors {
            Factors::Dense { real: matrix, complex: complex_matrix } => {
                matrix.clear();
                complex_matrix.clear();
                for (_, row, column, dy, dyp) in entries {
                    matrix.add(row, column, real * dyp + dy);
                    complex_matrix.set(row, column, complex * dyp + dy);
                }
                let factored = matrix.factor().and_then(|()| complex_matrix.factor());
                factored.map_err(|unknown| NoPivot { unknown: Some(unknown) })
            }
            Factors::Sparse(sparse) => {
                let (values, complex_values) = (sparse.real.values(), sparse.complex.values());
                for (place, _, _, dy, dyp) in entries {
                    values[place] = real * dyp + dy;
                    complex_values[place] = complex * dyp + dy;
                }
                let factored = sparse.real.factor() && sparse.complex.factor();
                factored.then_some(()).ok_or(NoPivot { unknown: None })
            }
        }
    }

    /// Reciprocal of what an equation adds up.
    pub(super) fn row_factor(&self, row: usize) -> f64 {
        self.rows[row % self.rows.len()]
    }

    /// Replaces `b` by the solution of the real equations.
    pub(super) fn solve_real(&mut self, b: &mut [f64]) {
        let size = self.rows.len().max(1);
        b.chunks_mut(size).for_each(|b| self.solve_real_block(b));
    }

    /// Replaces `re + i im` by the solution of the complex equations.
    pub(super) fn solve_complex(&mut self, re: &mut [f64], im: &mut [f64]) {
        let size = self.rows.len().max(1);
        re.chunks_mut(size).zip(im.chunks_mut(size)).for_each(|(re, im)| self.solve_complex_block(re, im));
    }

    fn solve_real_block(&mut self, b: &mut [f64]) {
        b.iter_mut().zip(&self.rows).for_each(|(b, row)| *b *= row);
        match &mut self.factors {
            Factors::Dense { real, .. } => real.solve(b),
            Factors::Sparse(sparse) => sparse.real.solve(b),
        }
        b.iter_mut().zip(&self.columns).for_each(|(b, column)| *b *= column);
    }

    fn solve_complex_block(&mut self, re: &mut [f64], im: &mut [f64]) {
        let scale = |b: &mut [f64], by: &[f64]| b.iter_mut().zip(by).for_each(|(b, by)| *b *= by);
        scale(re, &self.rows);
        scale(im, &self.rows);
        match &mut self.factors {
            Factors::Dense { complex, .. } => complex.solve(re, im),
            Factors::Sparse(sparse) => sparse.solve_complex(re, im),
        }
        scale(re, &self.columns);
        scale(im, &self.columns);
    }

    /// Takes factors that make the greatest entry of each row and column about 1, whatever the scales of the unknowns.
    fn balance(&mut self, dy: &[f64], dyp: &[f64], real: f64) {
        self.rows.fill(1.0);
        self.columns.fill(1.0);
        let (mut rows, mut columns) = (self.rows.clone(), self.columns.clone());
        for _ in 0..SWEEPS {
            rows.fill(0.0);
            columns.fill(0.0);
            for (place, (row, column)) in self.pattern.entries().enumerate() {
                let size = (real * dyp[place] + dy[place]).abs() * self.rows[row] * self.columns[column];
                rows[row] = size.max(rows[row]);
                columns[column] = size.max(columns[column]);
            }
            let shrink = |(factor, most): (&mut f64, &f64)| {
                if *most > 0.0 {
                    *factor /= most.sqrt();
                }
            };
            self.rows.iter_mut().zip(&rows).for_each(shrink);
            self.columns.iter_mut().zip(&columns).for_each(shrink);
        }
    }

    /// Takes the factors of rows and columns. A row or column of zeros keeps 1, and leaves no pivot.
    fn measure(&mut self, dy: &[f64], dyp: &[f64], real: f64, scales: &[f64]) {
        let size = |place: usize| (real * dyp[place] + dy[place]).abs();
        let reciprocal = |most: &mut f64| *most = if *most > 0.0 { most.recip() } else { 1.0 };
        self.rows.fill(0.0);
        for (place, (row, column)) in self.pattern.entries().enumerate() {
            self.rows[row] = self.rows[row].max(size(place) * scales[column]);
        }
        self.rows.iter_mut().for_each(reciprocal);
        self.columns.fill(0.0);
        for (place, (row, column)) in self.pattern.entries().enumerate() {
            self.columns[column] = self.columns[column].max(size(place) * self.rows[row]);
        }
        self.columns.iter_mut().for_each(reciprocal);
    }
}

impl Sparse {
    fn solve_complex(&mut self, re: &mut [f64], im: &mut [f64]) {
        self.work.iter_mut().zip(re.iter().zip(im.iter())).for_each(|(b, (re, im))| *b = c64::new(*re, *im));
        self.complex.solve(&mut self.work);
        self.work.iter().zip(re.iter_mut().zip(im)).for_each(|(b, (re, im))| (*re, *im) = (b.re, b.im));
    }
}
