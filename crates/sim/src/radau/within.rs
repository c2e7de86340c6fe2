//! What is true inside the last step.
//!
//! Its polynomial has order 3, that of the error estimate, and where the system is stiff nothing controls it. So where it
//! will not do, the step is made again from its start to the time in question, which gives all digits of the method.

use super::{Radau, StepError, norm};
use crate::ImplicitSystem;

/// Part of the tolerance that the polynomial may be off.
const ALLOWED: f64 = 0.5;

impl Radau {
    /// Unknowns at a time inside the last step, by its polynomial.
    pub(crate) fn interpolate(&self, t: f64, y: &mut [f64]) {
        if t >= self.t { y.copy_from_slice(&self.y) } else { self.last.state(t, y) }
    }

    /// Rates at a time inside the last step, by its polynomial.
    pub(crate) fn rates_between(&self, t: f64, yp: &mut [f64]) {
        if t >= self.t { yp.copy_from_slice(&self.yp) } else { self.last.rates(t, yp) }
    }

    /// Whether the polynomial meets the tolerance that the user gave at a time inside the last step.
    pub(crate) fn meets_tolerance(&mut self, t: f64) -> bool {
        if t >= self.t {
            return true;
        }
        if !self.last.doubt(&mut self.error) {
            return false;
        }
        for (i, allowed) in self.allowed.iter_mut().enumerate() {
            *allowed = (self.absolute[i] + self.relative * self.y[i].abs()) / self.tightened;
        }
        norm(&[&self.error], &self.allowed) <= ALLOWED
    }

    /// Makes the last step again from its start to a time inside it, and writes the unknowns and rates there. `false` if
    /// that cannot be done; the method goes on from the end of the whole step in any case.
    pub(crate) fn visit(&mut self, system: &mut dyn ImplicitSystem, t: f64, y: &mut [f64], yp: &mut [f64]) -> bool {
        if t >= self.t {
            y.copy_from_slice(&self.y);
            yp.copy_from_slice(&self.yp);
            return true;
        }
        let (end, convergence) = (self.t, self.newton);
        let made = self.again(system, t).is_ok();
        std::mem::swap(&mut self.y, self.last.start_values());
        if made {
            self.last.increments_to(t, &self.z, y, yp);
        }
        (self.t, self.newton) = (end, convergence);
        made
    }

    /// Makes the last step again from its start so that it ends at a time inside it. `false` if that cannot be done.
    pub(crate) fn shorten(&mut self, system: &mut dyn ImplicitSystem, t: f64) -> bool {
        if t >= self.t {
            return true;
        }
        let (end, convergence) = (self.t, self.newton);
        let made = self.again(system, t).is_ok();
        std::mem::swap(&mut self.y, self.last.start_values());
        (self.t, self.newton) = (end, convergence);
        if made {
            self.last.end_at(t, &mut self.z);
            self.t = t;
            self.y.copy_from_slice(self.last.start_values());
            self.last.end(&mut self.y, &mut self.yp);
        }
        made
    }

    /// Solves the equations of a step from the start of the last one to `t`, and stays at that start.
    fn again(&mut self, system: &mut dyn ImplicitSystem, t: f64) -> Result<usize, StepError> {
        std::mem::swap(&mut self.y, self.last.start_values());
        self.t = self.last.start();
        let h = t - self.t;
        self.allow(h);
        self.refactor(system, h)?;
        self.last.shortened(h, &mut self.z);
        self.iterate(system, h)
    }
}
