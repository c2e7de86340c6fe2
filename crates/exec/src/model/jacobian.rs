//! All derivatives of the rates by the states at once.

use super::system::What;
use super::{Model, Operations};
use crate::bytecode::{Layout, Routine};
use halfarrow_compiler::program::{JacobianEntry, Program, Value};
use halfarrow_sim::{Affected, Failure, Sparsity, System};
use std::sync::Arc;

/// The code of the derivatives, and where in the pattern each of them stands.
#[derive(Debug, Clone)]
pub(super) struct JacobianCode {
    pub routine: Routine,
    places: Vec<usize>,
}

impl JacobianCode {
    pub fn new(program: &Program, layout: &Layout, sparsity: &Sparsity, entries: &[JacobianEntry]) -> JacobianCode {
        let values: Vec<Value> = entries.iter().map(|e| e.value).collect();
        let place = |e: &JacobianEntry| sparsity.place(e.row as usize, e.column as usize);
        JacobianCode { routine: layout.guarded_routine(program, &values), places: entries.iter().map(place).collect() }
    }
}

/// Directions along which all derivatives may be taken without a look at what they would take at once: with fewer states
/// than that, implicit steps have the bits of exported C, which takes directions.
const FEW_DIRECTIONS: usize = 24;

/// Operations of a derivative along a direction for each one of the value.
const ALONG: usize = 2;

impl Model {
    /// Prepares for methods that ask for derivatives of the rates: has them all at once from now on where that takes fewer
    /// operations than along directions, as where many states meet in one sum.
    ///
    /// # Errors
    /// As [`set_up`](Model::set_up).
    pub fn prepare_derivatives(&mut self) -> Result<(), Failure> {
        let directions = self.code.sparsity.longest_row();
        if self.code.jacobian.is_some() || directions <= FEW_DIRECTIONS {
            return Ok(());
        }
        let mut other = Model::of(Arc::new(self.compiled.with_all_derivatives()))?;
        let along = ALONG * directions * self.operations().total();
        if other
            .code
            .jacobian
            .as_ref()
            .is_some_and(|at_once| Operations::of(&at_once.routine, &other.code.program).total() < along)
        {
            other.set_up(&self.setup)?;
            *self = other;
        }
        Ok(())
    }

    /// Writes the nonzeros in the order of the pattern; false if the model was made without them.
    pub(super) fn jacobian_at(&mut self, t: f64, x: &[f64], values: &mut [f64]) -> Result<bool, Failure> {
        if self.code.jacobian.is_none() {
            return Ok(false);
        }
        self.place(t, x);
        self.evaluate(What::Jacobian, false, t)?;
        if self.take_entries(values).is_some() {
            self.rates_at(t, x)?;
            self.place_beside(t, x);
            self.evaluate(What::Jacobian, false, t)?;
        }
        match self.take_entries(values) {
            None => Ok(true),
            Some(place) => {
                let row = self.code.sparsity.entries().nth(place).map_or(0, |(row, _)| row);
                let what = Affected::Other(format!("the derivative of the rate of {}", self.state_name(row)));
                Err(Failure::NotFinite { time: t, what })
            }
        }
    }
    /// Writes what the routine has computed; the first place that is not finite.
    fn take_entries(&self, values: &mut [f64]) -> Option<usize> {
        let code = self.code.jacobian.as_ref()?;
        values.fill(0.0);
        for (&place, &register) in code.places.iter().zip(&code.routine.outputs) {
            values[place] = self.frame.r[register as usize];
        }
        values.iter().position(|v| !v.is_finite())
    }
}
