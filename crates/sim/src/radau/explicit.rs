//! An explicit system in implicit form.

use crate::jacobian::Jacobian;
use crate::shared::Shared;
use crate::{Failure, ImplicitSystem, Sparsity, System};

/// `F = y' - f(t, y)`.
pub(crate) struct Explicit<'s> {
    shared: &'s Shared<'s>,
    jacobian: Jacobian,
    /// That of the system, and the diagonal.
    sparsity: Sparsity,
    /// Place of each nonzero of the system in that pattern.
    places: Vec<usize>,
    /// Place of each entry of the diagonal.
    diagonal: Vec<usize>,
    scales: Vec<f64>,
    /// All of them.
    differential: Vec<bool>,
}

impl<'s> Explicit<'s> {
    /// For a method that allows these errors, relative and absolute of each state.
    pub(crate) fn new(shared: &'s Shared<'s>, (relative, absolute): (f64, &[f64])) -> Explicit<'s> {
        let system = shared.system();
        let own = system.sparsity();
        let sparsity = own.with_diagonal();
        Explicit {
            jacobian: Jacobian::new(own).within(relative, absolute.to_vec()),
            places: own.entries().map(|(row, column)| sparsity.place(row, column)).collect(),
            diagonal: (0..system.states()).map(|i| sparsity.place(i, i)).collect(),
            scales: system.scales().to_vec(),
            differential: vec![true; system.states()],
            sparsity,
            shared,
        }
    }
}

impl ImplicitSystem for Explicit<'_> {
    fn unknowns(&self) -> usize {
        self.diagonal.len()
    }
    fn unknown_name(&self, unknown: usize) -> String {
        self.shared.system().state_name(unknown)
    }
    fn equation_name(&self, equation: usize) -> String {
        format!("the rate of {}", self.unknown_name(equation))
    }
    fn scales(&mut self, _: f64, _: f64) -> Result<Vec<f64>, Failure> {
        Ok(self.scales.clone())
    }
    fn index(&self, _: usize) -> u8 {
        1
    }
    fn residual(&mut self, t: f64, y: &[f64], yp: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        self.shared.system().rates(t, y, out)?;
        out.iter_mut().zip(yp).for_each(|(out, yp)| *out = yp - *out);
        Ok(())
    }
    fn is_steep(&self) -> bool {
        self.shared.system().is_steep()
    }
    fn sparsity(&self) -> &Sparsity {
        &self.sparsity
    }
    fn blocks(&self) -> usize {
        self.shared.system().blocks()
    }
    fn jacobian(&mut self, t: f64, y: &[f64], _: &[f64], dy: &mut [f64], dyp: &mut [f64]) -> Result<(), Failure> {
        dy.fill(0.0);
        dyp.fill(0.0);
        self.diagonal.iter().for_each(|&place| dyp[place] = 1.0);
        let places = &self.places;
        let system = &mut *self.shared.system();
        self.jacobian.visit(system, t, y, |_, _, place, value| dy[places[place]] = -value)
    }
    fn semi_explicit(&self) -> Option<&[bool]> {
        Some(&self.differential)
    }
}
