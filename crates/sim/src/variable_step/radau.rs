//! Radau IIA on the states of an explicit system.

use super::Integrator;
use super::tolerances::Tolerances;
use crate::radau::{Explicit, Radau};
use crate::shared::Shared;
use crate::{Failure, ImplicitSystem, Summary, System};

/// The method, and the system in the form that it asks for.
pub(super) struct OnStates<'s> {
    shared: &'s Shared<'s>,
    system: Explicit<'s>,
    radau: Radau,
    rates: Vec<f64>,
}

impl<'s> OnStates<'s> {
    pub(super) fn new(shared: &'s Shared<'s>, tolerances: &Tolerances) -> OnStates<'s> {
        let (relative, absolute) = (tolerances.relative(), tolerances.absolute(1.0));
        let system = Explicit::new(shared, (relative, &absolute));
        let radau = Radau::new(&system, relative, &absolute);
        OnStates { shared, rates: vec![0.0; system.unknowns()], system, radau }
    }
}

impl Integrator for OnStates<'_> {
    /// That of the error estimate.
    fn first_order(&self) -> usize {
        3
    }
    fn restart(&mut self, t: f64, x: &[f64], dx: &[f64], h: f64) -> Result<(), Failure> {
        self.radau.restart(t, x, dx, h);
        Ok(())
    }
    fn resume(&mut self, t: f64, x: &[f64], dx: &[f64], h: f64) -> Result<(), Failure> {
        self.radau.resume(t, x, dx, h);
        Ok(())
    }
    fn step(&mut self, stop: f64) -> Result<(), Failure> {
        self.radau.step(&mut self.system, stop)
    }
    fn time(&self) -> f64 {
        self.radau.time()
    }
    fn start(&self) -> f64 {
        self.radau.start()
    }
    fn next_step(&self) -> f64 {
        self.radau.next_step()
    }
    fn state(&self) -> &[f64] {
        self.radau.state()
    }
    fn end_rates(&self, dx: &mut [f64]) -> Result<(), Failure> {
        self.shared.system().rates(self.radau.time(), self.radau.state(), dx)
    }
    fn interpolate(&mut self, t: f64, x: &mut [f64]) {
        self.radau.interpolate(t, x);
    }
    fn interpolate_to_end_accuracy(&mut self, t: f64, x: &mut [f64]) {
        let exact = !self.radau.meets_tolerance(t) && self.radau.visit(&mut self.system, t, x, &mut self.rates);
        if !exact {
            self.radau.interpolate(t, x);
        }
    }
    fn shorten(&mut self, t: f64) -> bool {
        self.radau.shorten(&mut self.system, t)
    }
    fn rejected(&self) -> usize {
        self.radau.work().rejected + self.radau.work().given_up
    }
    fn add_work(&self, counts: &mut Summary) {
        self.radau.work().add_to(counts);
    }
}
