//! What a run asks of a system between its steps.

use crate::{Failure, ImplicitSystem, System};

/// Jumps, switches and recorded values of a system. A *point* is its state; in implicit form it is all unknowns, then all
/// their rates.
pub(crate) trait Scene {
    /// How messages name a value of a point.
    fn name(&self, value: usize) -> String;
    /// As in [`System`].
    fn switch_name(&self, switch: usize) -> String;
    /// As in [`System`].
    fn observed_name(&self, value: usize) -> String;
    /// As in [`System`].
    fn observe(&mut self, t: f64, point: &[f64], out: &mut [f64]) -> Result<(), Failure>;
    /// As in [`System`].
    fn observed(&self) -> usize;
    /// As in [`System`].
    fn next_jump(&mut self, t: f64) -> Option<f64>;
    /// As in [`System`].
    fn is_corner(&mut self, t: f64) -> bool;
    /// As in [`System`].
    fn cross_jump(&mut self, t: f64, point: &mut [f64]) -> Result<(), Failure>;
    /// As in [`System`].
    fn accept(&mut self, t: f64, point: &[f64]) -> Result<(), Failure>;
    /// As in [`System`].
    fn switches(&self) -> usize;
    /// As in [`System`].
    fn switch_values(&mut self, t: f64, point: &[f64], g: &mut [f64]) -> Result<(), Failure>;
}

impl Scene for crate::shared::Counted<'_> {
    fn name(&self, value: usize) -> String {
        self.state_name(value)
    }
    fn switch_name(&self, switch: usize) -> String {
        System::switch_name(self, switch)
    }
    fn observed_name(&self, value: usize) -> String {
        System::observed_name(self, value)
    }
    fn observe(&mut self, t: f64, point: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        System::observe(self, t, point, out)
    }
    fn observed(&self) -> usize {
        System::observed(self)
    }
    fn next_jump(&mut self, t: f64) -> Option<f64> {
        System::next_jump(self, t)
    }
    fn is_corner(&mut self, t: f64) -> bool {
        System::is_corner(self, t)
    }
    fn cross_jump(&mut self, t: f64, point: &mut [f64]) -> Result<(), Failure> {
        System::cross_jump(self, t, point)
    }
    fn accept(&mut self, t: f64, point: &[f64]) -> Result<(), Failure> {
        System::accept(self, t, point)
    }
    fn switches(&self) -> usize {
        System::switches(self)
    }
    fn switch_values(&mut self, t: f64, point: &[f64], g: &mut [f64]) -> Result<(), Failure> {
        System::switch_values(self, t, point, g)
    }
}

/// A system in implicit form as a scene.
pub(crate) struct Implicit<'a>(pub(crate) &'a mut dyn ImplicitSystem);

impl Scene for Implicit<'_> {
    fn name(&self, value: usize) -> String {
        let unknowns = self.0.unknowns();
        match value < unknowns {
            true => self.0.unknown_name(value),
            false => format!("the rate of {}", self.0.unknown_name(value - unknowns)),
        }
    }
    fn switch_name(&self, switch: usize) -> String {
        self.0.switch_name(switch)
    }
    fn observed_name(&self, value: usize) -> String {
        self.0.observed_name(value)
    }
    fn observe(&mut self, t: f64, point: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        let (y, yp) = halves(point);
        self.0.observe(t, y, yp, out)
    }
    fn observed(&self) -> usize {
        self.0.observed()
    }
    fn next_jump(&mut self, t: f64) -> Option<f64> {
        self.0.next_jump(t)
    }
    fn is_corner(&mut self, t: f64) -> bool {
        self.0.is_corner(t)
    }
    fn cross_jump(&mut self, t: f64, point: &mut [f64]) -> Result<(), Failure> {
        let (y, yp) = halves_mut(point);
        self.0.cross_jump(t, y, yp)
    }
    fn accept(&mut self, t: f64, point: &[f64]) -> Result<(), Failure> {
        let (y, yp) = halves(point);
        self.0.accept(t, y, yp)
    }
    fn switches(&self) -> usize {
        self.0.switches()
    }
    fn switch_values(&mut self, t: f64, point: &[f64], g: &mut [f64]) -> Result<(), Failure> {
        let (y, yp) = halves(point);
        self.0.switch_values(t, y, yp, g)
    }
}

/// The unknowns and the rates of a point of a system in implicit form.
pub(crate) fn halves(point: &[f64]) -> (&[f64], &[f64]) {
    point.split_at(point.len() / 2)
}

/// As [`halves`].
pub(crate) fn halves_mut(point: &mut [f64]) -> (&mut [f64], &mut [f64]) {
    let half = point.len() / 2;
    point.split_at_mut(half)
}
