//! The model as a system to integrate.

use super::{DelayOrSample, Model};
use crate::bytecode::{Hold, SolveError};
use halfarrow_sim::{Affected, Failure, Sparsity, System};

/// How far beside a state the derivative is taken where it is infinite: this part of the state and of its change in a second.
const BESIDE: f64 = 1e-8;

/// Which routine is run.
#[derive(Debug, Clone, Copy)]
pub(super) enum What {
    Rates,
    /// The solutions of the Newton blocks that rates read, if there are any.
    Solutions,
    Recorded,
    Indicators,
    /// The Jacobian of the rates, if the model has its code.
    Jacobian,
    /// The rates of positions that constraints determine, if there are any.
    Motion,
    /// What is divided by where other variables could be independent, if there are any.
    Pivots,
}

impl Model {
    pub(super) fn once(&mut self, what: What, along: bool) -> Result<bool, SolveError> {
        self.before_evaluation(what, along);
        let routine = match what {
            What::Rates => &self.code.rates,
            What::Solutions => self.code.solutions.as_ref().expect("asked for only where they are"),
            What::Recorded => &self.recorded.routine,
            What::Indicators => &self.code.indicators,
            What::Jacobian => &self.code.jacobian.as_ref().expect("asked for only where they are").routine,
            What::Motion => &self.code.motion.as_ref().expect("asked for only where they are").rates,
            What::Pivots => &self.code.exchanges.as_ref().expect("asked for only where they are").pivots,
        };
        self.frame.begin(match what {
            What::Rates => self.code.batches.as_ref(),
            What::Solutions => self.code.solution_batches.as_ref(),
            What::Recorded => self.recorded.batches.as_ref(),
            What::Indicators | What::Jacobian | What::Motion | What::Pivots => None,
        });
        match (self.tiers.code(what, along), self.tiers.in_turns(what, along), along) {
            (Some(code), ..) => code.run(&mut self.frame, routine)?,
            (None, Some(in_turns), false) => self.frame.run_in_turns::<false>(in_turns)?,
            (None, Some(in_turns), true) => self.frame.run_in_turns::<true>(in_turns)?,
            (None, None, false) => self.frame.run(routine)?,
            (None, None, true) => self.frame.run_along(routine)?,
        }
        let registers = if along { &self.frame.d } else { &self.frame.r };
        Ok(routine.outputs.iter().all(|&out| registers[out as usize].is_finite()))
    }

    /// Runs a routine with conditions as held. Beyond a zero crossing the held branch may have no value any more: then the
    /// conditions are followed instead.
    pub(super) fn evaluate(&mut self, what: What, along: bool, t: f64) -> Result<(), Failure> {
        let first = self.once(what, along);
        let held = self.frame.conditions.state == Hold::Keep && !self.code.switching.is_empty();
        if !held || matches!(first, Ok(true)) {
            return first.map(|_| ()).map_err(|error| self.failure(t, error));
        }
        self.frame.conditions.state = Hold::Follow;
        let second = self.once(what, along);
        let good = matches!(second, Ok(true));
        let last = if good {
            second
        } else {
            self.frame.conditions.state = Hold::Keep;
            self.once(what, along)
        };
        self.frame.conditions.state = Hold::Keep;
        last.map(|_| ()).map_err(|error| self.failure(t, error))
    }

    /// Runs the rates at `(t, x)` and leaves them in `dx`.
    pub(super) fn rates_at(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        let mut dx = std::mem::take(&mut self.dx);
        let result = self.rates(t, x, &mut dx);
        self.dx = dx;
        result
    }

    /// Finds the solutions of the Newton blocks that rates read at `(t, x)`, if there are any.
    pub(super) fn solve_at(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        if self.code.solutions.is_none() {
            return Ok(());
        }
        self.place(t, x);
        self.evaluate(What::Solutions, false, t)?;
        self.rated = Some(t);
        Ok(())
    }

    /// Sets the direction of derivatives to that of time: inputs and held signals move, states do not.
    pub(super) fn let_time_pass(&mut self, t: f64) {
        let Model { frame, code, setup, run, .. } = self;
        let layout = &code.layout;
        frame.d[layout.time as usize] = 1.0;
        for (i, (signal, piece)) in setup.inputs.iter().zip(&run.pieces).enumerate() {
            frame.d[layout.inputs as usize + i] = signal.at(t, *piece).1;
        }
        for (i, held) in run.delays_and_samples.iter().enumerate() {
            let slope = if let DelayOrSample::Delay(delay) = held { delay.at(t, run.crossed).1 } else { 0.0 };
            frame.d[layout.held as usize + i] = slope;
        }
    }

    /// Derivative of rates and residuals along a direction of the free rates, at what was placed last.
    pub(super) fn derivative_by_rates(&mut self, t: f64, y: &[f64], v: &[f64], jv: &mut [f64]) -> Result<(), Failure> {
        self.place(t, y);
        self.still();
        self.along(t, y, self.code.layout.rates, v, jv)
    }

    /// Derivative of rates and residuals along a direction in the fixed registers from `first` on.
    fn along(&mut self, t: f64, x: &[f64], first: u32, v: &[f64], jv: &mut [f64]) -> Result<(), Failure> {
        self.frame.d[first as usize..][..v.len()].copy_from_slice(v);
        self.derivative_along(t, x, jv)
    }

    /// Derivative of the rates along the direction that is set. Where the derivative of a law is infinite it is that a little
    /// beside.
    fn derivative_along(&mut self, t: f64, x: &[f64], jv: &mut [f64]) -> Result<(), Failure> {
        self.evaluate(What::Rates, true, t)?;
        if self.take_derivatives(jv).is_none() {
            return Ok(());
        }
        self.place_beside(t, x);
        self.evaluate(What::Rates, true, t)?;
        match self.take_derivatives(jv) {
            None => Ok(()),
            Some(state) => {
                let what = Affected::Other(format!("the derivative of the rate of {}", self.state_name(state)));
                Err(Failure::NotFinite { time: t, what })
            }
        }
    }

    /// Writes the derivatives of the rates; the first state for whose rate there is none.
    fn take_derivatives(&self, jv: &mut [f64]) -> Option<usize> {
        jv.iter_mut().zip(&self.code.rates.outputs).for_each(|(jv, &register)| *jv = self.frame.d[register as usize]);
        jv.iter().position(|slope| !slope.is_finite())
    }

    /// Puts states in their registers that are a little further on the way that the rates, evaluated last, lead, equal ones not
    /// equally far.
    pub(super) fn place_beside(&mut self, t: f64, x: &[f64]) {
        let mut beside = std::mem::take(&mut self.beside);
        let states = x.len() as f64;
        for (i, ((beside, x), &register)) in beside.iter_mut().zip(x).zip(&self.code.rates.outputs).enumerate() {
            let rate = self.frame.r[register as usize];
            let rate = if rate.is_finite() { rate } else { 0.0 };
            let size = if rate < 0.0 { -x.abs() } else { x.abs() };
            let way = BESIDE * (size + rate);
            let farther = 1.0 + i as f64 / states;
            *beside = x + farther * if way == 0.0 { BESIDE * BESIDE } else { way };
        }
        self.place(t, &beside);
        self.beside = beside;
    }

    /// Whether there are laws solved by Newton, whose last solution decides which one comes next.
    pub(super) fn follows_solutions_at_all(&self) -> bool {
        !self.recorded.blocks.is_empty() || self.code.solutions.is_some()
    }
}

impl System for Model {
    fn states(&self) -> usize {
        self.code.program.states.len()
    }

    fn state_name(&self, state: usize) -> String {
        self.code.program.states[state].name.clone()
    }

    fn scales(&self) -> &[f64] {
        &self.run.scales
    }

    fn rates(&mut self, t: f64, x: &[f64], dx: &mut [f64]) -> Result<(), Failure> {
        if self.rates_directly(t, x, dx) {
            return Ok(());
        }
        self.place(t, x);
        self.evaluate(What::Rates, false, t)?;
        for (state, (dx, &register)) in dx.iter_mut().zip(&self.code.rates.outputs).enumerate() {
            *dx = self.frame.r[register as usize];
            if !dx.is_finite() {
                let what = Affected::Rate(self.state_name(state));
                return Err(self.explain(t).unwrap_or(Failure::NotFinite { time: t, what }));
            }
        }
        self.rated = Some(t);
        Ok(())
    }

    fn directional_derivative(&mut self, t: f64, x: &[f64], v: &[f64], jv: &mut [f64]) -> Result<(), Failure> {
        self.place(t, x);
        self.still();
        self.along(t, x, self.code.layout.states, v, jv)
    }

    fn time_derivative(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        self.place(t, x);
        self.still();
        self.let_time_pass(t);
        self.derivative_along(t, x, out)
    }

    fn compares_rates(&self) -> bool {
        self.code.program.is_long()
    }

    fn is_steep(&self) -> bool {
        self.code.program.steep
    }

    fn sparsity(&self) -> &Sparsity {
        &self.code.sparsity
    }

    fn jacobian(&mut self, t: f64, x: &[f64], values: &mut [f64]) -> Result<bool, Failure> {
        self.jacobian_at(t, x, values)
    }
}
