//! Several sets of parameters at once.

use super::Model;
use super::compiled::Mode;
use super::recorded::Recorded;
use super::system::What;
use crate::bytecode::Routine;
use crate::bytecode::{Frame, HasFrame, Packed, Vector, WideFrame};
use halfarrow_sim::wide::{LANES, Wide, WideSystem};
use halfarrow_sim::{Events as _, Failure, HybridSystem, System as _};
use std::sync::Arc;

/// A model in as many copies as there are lanes, each with parameters, inputs, start and memory of its own, whose rates
/// and recorded values are computed together.
///
/// Every lane does what its model does alone, to the last bit.
#[derive(Debug, Clone)]
pub struct WideModel {
    models: Vec<Model>,
    frame: WideFrame<LANES>,
    /// What they share: the code, and what is recorded, both packed for lanes.
    code: Arc<Mode>,
    recorded: Arc<Recorded>,
    rates: Packed,
    observe: Packed,
    /// State and values of one lane.
    state: Vec<f64>,
    values: Vec<f64>,
}

impl WideModel {
    /// The same model in every lane, recording what it records.
    pub fn new(model: &Model) -> WideModel {
        let mut frame = WideFrame::default();
        let (code, recorded) = (model.code.clone(), model.recorded.clone());
        let rates = Packed::new(&code.layout, &code.rates);
        let observe = Packed::new(&code.layout, &recorded.routine);
        frame.reserve(rates.slots.max(observe.slots).max(code.layout.size as usize));
        let mut lane = model.clone();
        lane.scaled = false;
        let mut wide = WideModel {
            models: vec![lane; LANES],
            frame,
            code,
            recorded,
            rates,
            observe,
            state: vec![0.0; model.states()],
            values: Vec::new(),
        };
        wide.begin();
        wide
    }

    /// The model of a lane, to set its parameters and inputs and to find its start, not to choose what is recorded. Call
    /// [`begin`](WideModel::begin) after it.
    pub fn model(&mut self, lane: usize) -> &mut Model {
        &mut self.models[lane]
    }

    /// Takes up what the models of the lanes have been set to: parameters, constants and what follows from them.
    pub fn begin(&mut self) {
        for register in 0..self.code.layout.size as usize {
            self.frame.r[register] = Vector(std::array::from_fn(|lane| self.models[lane].frame.r[register]));
        }
    }

    /// Puts time, inputs, held signals, constants and states where routines read them.
    fn place(&mut self, t: &Wide, x: &[Wide]) {
        let WideModel { models, frame, code, recorded, .. } = self;
        let (states, time) = (code.layout.states as usize, code.layout.time as usize);
        frame.r[states..].iter_mut().zip(x).for_each(|(r, x)| *r = Vector(*x));
        frame.r[time] = Vector(*t);
        if code.motion.is_some() || recorded.motion.is_some() {
            // Positions are sought where their motion leads until then.
            models.iter_mut().zip(t).for_each(|(model, &t)| model.frame.r[time] = t);
        }
        if states == time + 1 {
            return; // no inputs, held signals or constants
        }
        for (lane, model) in models.iter_mut().enumerate() {
            model.place_time(t[lane]);
            let conserved = code.layout.conserved as usize;
            for register in time + 1..conserved {
                frame.r[register][lane] = model.frame.r[register];
            }
            for (i, value) in model.run.conserved.iter().enumerate() {
                frame.r[conserved + i][lane] = *value;
            }
        }
    }

    /// The lane as it would do it alone: what it gives, or why it fails. Beyond a switch it may take the other side.
    fn alone(
        &mut self,
        lane: usize,
        what: What,
        t: f64,
        x: &[Wide],
        out: &mut [Wide],
        failures: &mut [Option<Failure>; LANES],
    ) {
        let WideModel { models, state, values, .. } = self;
        state.iter_mut().zip(x).for_each(|(state, x)| *state = x[lane]);
        values.resize(out.len(), 0.0);
        let done = match what {
            What::Rates => models[lane].rates(t, state, values),
            _ => models[lane].observe(t, state, values),
        };
        match done {
            Ok(()) => out.iter_mut().zip(values).for_each(|(out, value)| out[lane] = *value),
            Err(failure) => failures[lane] = Some(failure),
        }
    }

    fn together(
        &mut self,
        what: What,
        t: &Wide,
        x: &[Wide],
        out: &mut [Wide],
        failures: &mut [Option<Failure>; LANES],
    ) {
        self.place(t, x);
        let mut good: [bool; LANES] = std::array::from_fn(|lane| failures[lane].is_none());
        let wanted = good;
        let (routine, packed) = match what {
            What::Rates => (&self.code.rates, &self.rates),
            _ => (&self.recorded.routine, &self.observe),
        };
        self.frame.run(routine, packed, &mut self.models, &mut good);
        for (out, &slot) in out.iter_mut().zip(&packed.outputs) {
            *out = self.frame.r[slot as usize].0;
            (0..LANES).for_each(|lane| good[lane] &= out[lane].is_finite());
        }
        for lane in (0..LANES).filter(|&lane| wanted[lane] && !good[lane]) {
            self.alone(lane, what, t[lane], x, out, failures);
        }
    }
}

impl HasFrame for Model {
    #[inline]
    fn frame(&mut self) -> &mut Frame {
        self.rated = None;
        &mut self.frame
    }
}

impl WideSystem for WideModel {
    fn lane(&mut self, lane: usize) -> &mut dyn HybridSystem {
        &mut self.models[lane]
    }

    fn rates(&mut self, t: &Wide, x: &[Wide], dx: &mut [Wide], failures: &mut [Option<Failure>; LANES]) {
        self.together(What::Rates, t, x, dx, failures);
    }

    fn observe(&mut self, t: &Wide, x: &[Wide], out: &mut [Wide], failures: &mut [Option<Failure>; LANES]) {
        self.together(What::Recorded, t, x, out, failures);
    }

    fn remembers(&self) -> bool {
        let newton = |routine: &Routine| routine.solves.iter().any(|solve| !solve.guess.is_empty());
        newton(&self.code.rates) || newton(&self.recorded.routine) || !self.models[0].run.delays_and_samples.is_empty()
    }
}
