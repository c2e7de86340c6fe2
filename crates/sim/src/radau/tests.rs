//! Work and error as published for RADAU5, order of convergence.

use super::*;
use crate::Sparsity;

/// Residuals, and both derivatives row by row.
type Residual = fn(f64, &[f64], &[f64], &mut [f64]);
type Derivatives = fn(f64, &[f64], &[f64], &mut [f64], &mut [f64]);

/// A system with a dense pattern.
struct Dense {
    index: Vec<u8>,
    scales: Vec<f64>,
    sparsity: Sparsity,
    residual: Residual,
    derivatives: Derivatives,
    residuals: usize,
}

impl Dense {
    fn new(index: &[u8], residual: Residual, derivatives: Derivatives) -> Dense {
        let size = index.len();
        let (scales, sparsity) = (vec![0.0; size], Sparsity::dense(size));
        Dense { index: index.to_vec(), scales, sparsity, residual, derivatives, residuals: 0 }
    }
}

impl ImplicitSystem for Dense {
    fn unknowns(&self) -> usize {
        self.index.len()
    }
    fn scales(&self) -> &[f64] {
        &self.scales
    }
    fn index(&self, unknown: usize) -> u8 {
        self.index[unknown]
    }
    fn residual(&mut self, t: f64, y: &[f64], yp: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        self.residuals += 1;
        (self.residual)(t, y, yp, out);
        Ok(())
    }
    fn sparsity(&self) -> &Sparsity {
        &self.sparsity
    }
    fn jacobian(&mut self, t: f64, y: &[f64], yp: &[f64], dy: &mut [f64], dyp: &mut [f64]) -> Result<(), Failure> {
        let size = self.index.len();
        let (mut by_rows, mut rates_by_rows) = (vec![0.0; size * size], vec![0.0; size * size]);
        (self.derivatives)(t, y, yp, &mut by_rows, &mut rates_by_rows);
        for (place, (row, column)) in self.sparsity.entries().enumerate() {
            dy[place] = by_rows[row * size + column];
            dyp[place] = rates_by_rows[row * size + column];
        }
        Ok(())
    }
    fn semi_explicit(&self) -> Option<&[bool]> {
        Some(&[])
    }
    fn observe(&mut self, _: f64, _: &[f64], _: &[f64], _: &mut [f64]) -> Result<(), Failure> {
        Ok(())
    }
    fn observed(&self) -> usize {
        0
    }
    fn next_jump(&mut self, _: f64) -> Option<f64> {
        None
    }
    fn cross_jump(&mut self, _: f64, _: &mut [f64], _: &mut [f64]) -> Result<(), Failure> {
        Ok(())
    }
    fn accept(&mut self, _: f64, _: &[f64], _: &[f64]) -> Result<(), Failure> {
        Ok(())
    }
    fn switches(&self) -> usize {
        0
    }
    fn switch_values(&mut self, _: f64, _: &[f64], _: &[f64], _: &mut [f64]) -> Result<(), Failure> {
        Ok(())
    }
}

/// Runs from 0 to `to`.
fn run(system: &mut Dense, relative: f64, absolute: f64, (y, yp): (&[f64], &[f64]), h: f64, to: f64) -> Radau {
    let mut radau = Radau::new(system, relative, &vec![absolute; y.len()]);
    radau.restart(0.0, y, yp, h);
    while radau.time() < to {
        radau.step(system, to).unwrap();
    }
    radau
}

const VAN_DER_POL: f64 = 1e-6;

fn van_der_pol() -> Dense {
    Dense::new(
        &[1, 1],
        |_, y, yp, out| {
            out[0] = yp[0] - y[1];
            out[1] = yp[1] - ((1.0 - y[0] * y[0]) * y[1] - y[0]) / VAN_DER_POL;
        },
        |_, y, _, dy, dyp| {
            dy.copy_from_slice(&[
                0.0,
                -1.0,
                (2.0 * y[0] * y[1] + 1.0) / VAN_DER_POL,
                -(1.0 - y[0] * y[0]) / VAN_DER_POL,
            ]);
            dyp.copy_from_slice(&[1.0, 0.0, 0.0, 1.0]);
        },
    )
}

#[test]
fn van_der_pol_takes_the_published_work() {
    let mut system = van_der_pol();
    let radau = run(&mut system, 1e-4, 1e-4, (&[2.0, -0.6], &[-0.6, -0.2 / VAN_DER_POL]), 1e-6, 2.0);
    // 242 accepted, 8 rejected, 280 in all, 162 Jacobians, 253 factorisations, 668 iterations; 2248 right sides count one
    // for each accepted step, not for each attempt. Source: [russell].
    let work = radau.work();
    assert_eq!((work.accepted, work.rejected, work.jacobians, work.iterations), (242, 8, 162, 668), "{work:?}");
    assert!(work.factorisations.abs_diff(253) <= 1 && work.residuals == system.residuals, "{work:?}");
    assert!(
        (radau.state()[0] - 1.706163410178079).abs() < 1e-12 && (radau.state()[1] + 0.8927971289301175).abs() < 1e-11
    );
}

fn robertson() -> Dense {
    Dense::new(
        &[1, 1, 1],
        |_, y, yp, out| {
            let (slow, fast, back) = (0.04 * y[0], 3e7 * y[1] * y[1], 1e4 * y[1] * y[2]);
            out.copy_from_slice(&[yp[0] - back + slow, yp[1] - slow + back + fast, yp[2] - fast]);
        },
        |_, y, _, dy, dyp| {
            dy.copy_from_slice(&[
                0.04,
                -1e4 * y[2],
                -1e4 * y[1],
                -0.04,
                1e4 * y[2] + 6e7 * y[1],
                1e4 * y[1],
                0.0,
                -6e7 * y[1],
                0.0,
            ]);
            dyp.copy_from_slice(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
        },
    )
}

#[test]
fn robertson_takes_the_published_work() {
    let mut system = robertson();
    let radau = run(&mut system, 1e-2, 1e-8, (&[1.0, 0.0, 0.0], &[-0.04, 0.04, 0.0]), 1e-6, 0.3);
    // Source: [russell].
    let work = radau.work();
    assert_eq!((work.accepted, work.rejected, work.jacobians, work.factorisations), (15, 1, 8, 15), "{work:?}");
    assert_eq!((work.iterations, work.residuals), (24, 88), "{work:?}");
    let published = [9.886740138499884e-1, 3.44772047178207e-5, 1.12915089452939e-2];
    radau.state().iter().zip(published).for_each(|(y, published)| assert!((y - published).abs() < 1e-14, "{y:e}"));
    assert!((radau.next_step() / 8.160578540333708e-1 - 1.0).abs() < 1e-10);
}
