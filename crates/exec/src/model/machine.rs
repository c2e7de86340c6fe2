//! Which routines of a model run as machine code.

use super::Model;
use super::inputs::Signal;
use super::system::What;
use crate::machine::{Code, Generator, MachineError};
use std::sync::Arc;

/// Machine code of routines, where it has been made.
#[derive(Debug, Clone, Default)]
pub(super) struct Codes {
    rates: Option<Arc<Code>>,
    along: Option<Arc<Code>>,
    recorded: Option<Arc<Code>>,
    switches: Option<Arc<Code>>,
    slopes: Option<Arc<Code>>,
}

impl Codes {
    pub fn of(&self, what: What, along: bool) -> Option<&Arc<Code>> {
        match (what, along) {
            (What::Rates, false) => self.rates.as_ref(),
            (What::Rates, true) => self.along.as_ref(),
            (What::Recorded, false) => self.recorded.as_ref(),
            (What::Switches, false) => self.switches.as_ref(),
            (What::Slopes, false) => self.slopes.as_ref(),
            (_, true) => None,
        }
    }
}

impl Model {
    /// Rates by machine code from where time and states are given; false if that does not do.
    #[inline]
    pub(super) fn rates_directly(&mut self, t: f64, x: &[f64], dx: &mut [f64]) -> bool {
        if self.codes.rates.is_none() {
            return false;
        }
        if !self.held.is_empty() || self.inputs.iter().any(Signal::moves) {
            self.place_time(t);
        }
        let Model { codes, frame, layout, conserved, .. } = self;
        if !conserved.is_empty() {
            frame.r[layout.conserved as usize..][..conserved.len()].copy_from_slice(conserved);
        }
        let Some(code) = &codes.rates else { return false };
        code.rates(frame, t, x, dx) && dx.iter().all(|rate| rate.is_finite())
    }

    /// Rates alone as machine code, as [`compile_machine`](Model::compile_machine) makes them.
    ///
    /// # Errors
    /// As there.
    pub fn compile_rates(&mut self) -> Result<(), MachineError> {
        let code = Generator::new()?.compile(&self.program, &self.layout, &self.rates, false)?;
        self.codes.rates = Some(Arc::new(code));
        Ok(())
    }

    /// From now on rates, recorded values and switching functions run as machine code: the same bits, sooner. It takes some
    /// 4 µs an instruction once; a model that is evaluated thousands of times gains.
    ///
    /// # Errors
    /// There is no machine code for this processor or in this build; the model runs on as it did.
    pub fn compile_machine(&mut self) -> Result<(), MachineError> {
        let mut generator = Generator::new()?;
        let Model { program, layout, rates, switching, slopes, .. } = &*self;
        let mut made = |routine, along| generator.compile(program, layout, routine, along).map(Arc::new);
        let codes = Codes {
            rates: Some(made(rates, false)?),
            along: None,
            recorded: None,
            switches: if switching.outputs.is_empty() { None } else { Some(made(switching, false)?) },
            slopes: slopes.as_ref().map(|slopes| made(&slopes.routine, false)).transpose()?,
        };
        self.codes = codes;
        self.compile_recorded(&mut generator)
    }

    /// Makes machine code of what a run with fixed step needs if so many evaluations repay it; whether it did. Results are
    /// the same.
    pub fn compile_for(&mut self, evaluations: f64, derivatives: bool) -> bool {
        // Seconds to make the code, and saved by it, per instruction: about what docs/TESTING.md has.
        let instructions = self.rates.code.len() as f64;
        let (cost, gain) = (3e-4 + 6e-6 * instructions, 1e-9 * instructions);
        if evaluations * gain <= 2.0 * cost || self.compile_machine().is_err() {
            return false;
        }
        !derivatives || self.compile_tangent().is_ok()
    }

    /// The same for derivatives along directions, which stiff methods ask for.
    ///
    /// # Errors
    /// As [`compile_machine`](Model::compile_machine).
    pub fn compile_tangent(&mut self) -> Result<(), MachineError> {
        let code = Generator::new()?.compile(&self.program, &self.layout, &self.rates, true)?;
        self.codes.along = Some(Arc::new(code));
        Ok(())
    }

    /// Whether rates run as machine code.
    pub fn runs_machine_code(&self) -> bool {
        self.codes.rates.is_some()
    }

    fn compile_recorded(&mut self, generator: &mut Generator) -> Result<(), MachineError> {
        let code = generator.compile(&self.program, &self.layout, &self.observe, false)?;
        self.codes.recorded = Some(Arc::new(code));
        Ok(())
    }

    /// What is recorded has changed.
    pub(super) fn recorded_changed(&mut self) {
        if self.codes.recorded.take().is_some() {
            // Without it the bytecode goes on recording.
            let _ = Generator::new().and_then(|mut generator| self.compile_recorded(&mut generator));
        }
    }
}
