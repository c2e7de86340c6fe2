//! The system as all parts of a run share it.

use std::cell::{RefCell, RefMut};

use crate::scene::Scene;
use crate::{Failure, Sparsity, System};

/// A system that the run and the integrator's library both call, and the failure that the library cannot pass on.
pub(crate) struct Shared<'a> {
    system: RefCell<Counted<'a>>,
    failure: RefCell<Option<Failure>>,
    /// Which states have a rate, if some have none: their rates are to be 0.
    differential: Option<Vec<bool>>,
}

impl<'a> Shared<'a> {
    pub(crate) fn new(system: &'a mut dyn System) -> Shared<'a> {
        Shared { system: RefCell::new(Counted::new(system)), failure: RefCell::new(None), differential: None }
    }

    /// A system of which only the states marked have rates; those of the others have to be 0.
    pub(crate) fn semi_explicit(system: &'a mut dyn System, differential: Vec<bool>) -> Shared<'a> {
        Shared { differential: Some(differential), ..Shared::new(system) }
    }

    /// Which states have a rate, if some have none.
    pub(crate) fn differential(&self) -> Option<&[bool]> {
        self.differential.as_deref()
    }

    /// The system, to be given back before anybody else asks for it.
    pub(crate) fn system(&self) -> RefMut<'_, Counted<'a>> {
        self.system.borrow_mut()
    }

    /// The system as a run sees it.
    pub(crate) fn scene<'r>(&'r self) -> &'r RefCell<dyn Scene + 'r>
    where
        'a: 'r,
    {
        &self.system
    }

    /// Keeps a failure until somebody can return it.
    pub(crate) fn keep(&self, failure: Failure) {
        *self.failure.borrow_mut() = Some(failure);
    }

    /// Whether a failure is kept.
    pub(crate) fn has_failure(&self) -> bool {
        self.failure.borrow().is_some()
    }

    /// The failure kept, if any; it is kept no longer.
    pub(crate) fn take_failure(&self) -> Option<Failure> {
        self.failure.borrow_mut().take()
    }
}

/// A system whose evaluations are counted.
pub(crate) struct Counted<'a> {
    system: &'a mut dyn System,
    pub(crate) rates: usize,
    pub(crate) tangents: usize,
}

impl<'a> Counted<'a> {
    pub(crate) fn new(system: &'a mut dyn System) -> Counted<'a> {
        Counted { system, rates: 0, tangents: 0 }
    }
}

impl System for Counted<'_> {
    fn states(&self) -> usize {
        self.system.states()
    }
    fn state_name(&self, state: usize) -> String {
        self.system.state_name(state)
    }
    fn switch_name(&self, switch: usize) -> String {
        self.system.switch_name(switch)
    }
    fn observed_name(&self, value: usize) -> String {
        self.system.observed_name(value)
    }
    fn scales(&self) -> &[f64] {
        self.system.scales()
    }
    fn rates(&mut self, t: f64, x: &[f64], dx: &mut [f64]) -> Result<(), Failure> {
        self.rates += 1;
        self.system.rates(t, x, dx)
    }
    fn tangent(&mut self, t: f64, x: &[f64], v: &[f64], jv: &mut [f64]) -> Result<(), Failure> {
        self.tangents += 1;
        self.system.tangent(t, x, v, jv)
    }
    fn jacobian(&mut self, t: f64, x: &[f64], values: &mut [f64]) -> Result<bool, Failure> {
        self.system.jacobian(t, x, values)
    }
    fn drift(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        self.system.drift(t, x, out)
    }
    fn sparsity(&self) -> &Sparsity {
        self.system.sparsity()
    }
    fn observe(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        self.system.observe(t, x, out)
    }
    fn observed(&self) -> usize {
        self.system.observed()
    }
    fn next_jump(&mut self, t: f64) -> Option<f64> {
        self.system.next_jump(t)
    }
    fn is_corner(&mut self, t: f64) -> bool {
        self.system.is_corner(t)
    }
    fn cross_jump(&mut self, t: f64, x: &mut [f64]) -> Result<(), Failure> {
        self.system.cross_jump(t, x)
    }
    fn accept(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        self.system.accept(t, x)
    }
    fn switches(&self) -> usize {
        self.system.switches()
    }
    fn switch_values(&mut self, t: f64, x: &[f64], g: &mut [f64]) -> Result<(), Failure> {
        self.system.switch_values(t, x, g)
    }
}
