//! The system as all parts of a run share it.

use std::cell::{RefCell, RefMut};

use crate::events::Events;
use crate::variable_step::KeptFactors;
use crate::{Failure, HybridSystem, Sparsity, System};

/// A system that the run and the integrator's library both call, and the failure that the library cannot pass on.
pub(crate) struct Shared<'a> {
    system: RefCell<Counted<'a>>,
    failure: RefCell<Option<Failure>>,
    /// Which states have a rate, if some have none: their rates are to be 0.
    differential: Option<Vec<bool>>,
    kept_factors: KeptFactors,
}

impl<'a> Shared<'a> {
    pub(crate) fn new(system: &'a mut dyn HybridSystem) -> Shared<'a> {
        Shared {
            system: RefCell::new(Counted::new(system)),
            failure: RefCell::new(None),
            differential: None,
            kept_factors: KeptFactors::default(),
        }
    }

    /// A system of which only the states marked have rates; those of the others have to be 0.
    pub(crate) fn semi_explicit(system: &'a mut dyn HybridSystem, differential: Vec<bool>) -> Shared<'a> {
        Shared { differential: Some(differential), ..Shared::new(system) }
    }

    /// Which states have a rate, if some have none.
    pub(crate) fn differential(&self) -> Option<&[bool]> {
        self.differential.as_deref()
    }

    /// Sparse factors of the steps so far, for those after a restart.
    pub(crate) fn kept_factors(&self) -> &KeptFactors {
        &self.kept_factors
    }

    /// The system, to be given back before anybody else asks for it.
    pub(crate) fn system(&self) -> RefMut<'_, Counted<'a>> {
        self.system.borrow_mut()
    }

    /// Its events, likewise.
    pub(crate) fn events(&self) -> RefMut<'_, dyn Events + '_> {
        RefMut::map(self.system(), |counted| -> &mut (dyn Events + '_) { counted.events() })
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
    system: &'a mut dyn HybridSystem,
    work: Work,
}

/// What was evaluated.
#[derive(Clone, Debug, Default)]
pub(crate) struct Work {
    pub(crate) rates: usize,
    pub(crate) tangents: usize,
    /// Where the rates had no finite value last.
    pub(crate) without_rates: Option<(f64, Vec<f64>)>,
}

impl Work {
    /// Both, one after the other.
    pub(crate) fn add(&mut self, later: Work) {
        self.rates += later.rates;
        self.tangents += later.tangents;
        self.without_rates = later.without_rates.or_else(|| self.without_rates.take());
    }
}

impl<'a> Counted<'a> {
    pub(crate) fn new(system: &'a mut dyn HybridSystem) -> Counted<'a> {
        Counted { system, work: Work::default() }
    }

    /// What was evaluated so far.
    pub(crate) fn work(&self) -> Work {
        self.work.clone()
    }

    pub(crate) fn events(&mut self) -> &mut (dyn Events + 'a) {
        &mut *self.system
    }
}

impl System for Counted<'_> {
    fn states(&self) -> usize {
        self.system.states()
    }
    fn state_name(&self, state: usize) -> String {
        self.system.state_name(state)
    }
    fn scales(&self) -> &[f64] {
        self.system.scales()
    }
    fn rates(&mut self, t: f64, x: &[f64], dx: &mut [f64]) -> Result<(), Failure> {
        self.work.rates += 1;
        let done = self.system.rates(t, x, dx);
        if matches!(done, Err(Failure::NotFinite { .. })) {
            self.work.without_rates = Some((t, x.to_vec()));
        }
        done
    }
    fn directional_derivative(&mut self, t: f64, x: &[f64], v: &[f64], jv: &mut [f64]) -> Result<(), Failure> {
        self.work.tangents += 1;
        self.system.directional_derivative(t, x, v, jv)
    }
    fn time_derivative(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        self.system.time_derivative(t, x, out)
    }
    fn compares_rates(&self) -> bool {
        self.system.compares_rates()
    }
    fn is_steep(&self) -> bool {
        self.system.is_steep()
    }
    fn sparsity(&self) -> &Sparsity {
        self.system.sparsity()
    }
    fn blocks(&self) -> usize {
        self.system.blocks()
    }
    fn jacobian(&mut self, t: f64, x: &[f64], values: &mut [f64]) -> Result<bool, Failure> {
        self.system.jacobian(t, x, values)
    }
}
