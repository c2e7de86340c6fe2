//! Which routines of a model run as machine code.

use super::Model;
use super::inputs::InputSignal;
use super::recorded::Recorded;
use super::system::What;
use crate::machine::{Generator, MachineCode, MachineError};
use std::sync::Arc;

/// Machine code of routines, where it has been made; that of what is recorded lies with it. Shared by copies of a model.
#[derive(Debug, Clone, Default)]
pub(super) struct Codes {
    rates: Option<Arc<MachineCode>>,
    along: Option<Arc<MachineCode>>,
    indicators: Option<Arc<MachineCode>>,
    jacobian: Option<Arc<MachineCode>>,
}

impl Codes {
    /// The machine code of a routine, if there is any.
    pub fn of<'c>(&'c self, recorded: &'c Recorded, what: What, along: bool) -> Option<&'c Arc<MachineCode>> {
        match (what, along) {
            (What::Rates, false) => self.rates.as_ref(),
            (What::Rates, true) => self.along.as_ref(),
            (What::Recorded, false) => recorded.code.as_ref(),
            (What::Indicators, false) => self.indicators.as_ref(),
            (What::Jacobian, false) => self.jacobian.as_ref(),
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
        if !self.run.delays_and_samples.is_empty() || self.inputs().iter().any(InputSignal::moves) {
            self.place_time(t);
        }
        let Model { codes, frame, code, run, .. } = self;
        if !run.conserved.is_empty() {
            frame.r[code.layout.conserved as usize..][..run.conserved.len()].copy_from_slice(&run.conserved);
        }
        let Some(code) = &codes.rates else { return false };
        code.rates(frame, t, x, dx) && dx.iter().all(|rate| rate.is_finite())
    }

    /// Rates alone as machine code, as [`compile_machine`](Model::compile_machine) makes them.
    ///
    /// # Errors
    /// As there.
    pub fn compile_rates(&mut self) -> Result<(), MachineError> {
        let code = Generator::new()?.compile(&self.code.program, &self.code.layout, &self.code.rates, false)?;
        self.codes.rates = Some(Arc::new(code));
        Ok(())
    }

    /// From now on rates, recorded values and event indicators run as machine code: the same bits, sooner. It takes some
    /// 4 µs an instruction once; a model that is evaluated thousands of times gains.
    ///
    /// # Errors
    /// There is no machine code for this processor or in this build; the model runs on as it did.
    pub fn compile_machine(&mut self) -> Result<(), MachineError> {
        let mut generator = Generator::new()?;
        let code = &*self.code;
        let mut made = |routine, along| generator.compile(&code.program, &code.layout, routine, along).map(Arc::new);
        self.codes = Codes {
            rates: Some(made(&code.rates, false)?),
            along: None,
            indicators: if code.switching.is_empty() { None } else { Some(made(&code.indicators, false)?) },
            jacobian: code.jacobian.as_ref().map(|jacobian| made(&jacobian.routine, false)).transpose()?,
        };
        self.compile_recorded()
    }

    /// Makes machine code of what a run with fixed step needs if so many evaluations repay it; whether it did. Results are
    /// the same.
    pub fn compile_for(&mut self, evaluations: f64, derivatives: bool) -> bool {
        // Seconds to make the code, and saved by it, per instruction: about what docs/TESTING.md has.
        let instructions = self.code.rates.code.len() as f64;
        let (cost, gain) = (3e-4 + 6e-6 * instructions, 1e-9 * instructions);
        if evaluations * gain <= 2.0 * cost || self.compile_machine().is_err() {
            return false;
        }
        !derivatives || self.compile_directional().is_ok()
    }

    /// The same for derivatives along directions, which stiff methods ask for.
    ///
    /// # Errors
    /// As [`compile_machine`](Model::compile_machine).
    pub fn compile_directional(&mut self) -> Result<(), MachineError> {
        let code = Generator::new()?.compile(&self.code.program, &self.code.layout, &self.code.rates, true)?;
        self.codes.along = Some(Arc::new(code));
        Ok(())
    }

    /// Whether rates run as machine code.
    pub fn runs_machine_code(&self) -> bool {
        self.codes.rates.is_some()
    }

    /// The same for what is recorded.
    pub(super) fn compile_recorded(&mut self) -> Result<(), MachineError> {
        let Model { code, recorded, .. } = self;
        let made = Generator::new()?.compile(&code.program, &code.layout, &recorded.routine, false)?;
        Arc::make_mut(recorded).code = Some(Arc::new(made));
        Ok(())
    }
}
