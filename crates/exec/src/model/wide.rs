//! Several sets of parameters at once.

use super::Model;
use super::compiled::{Mode, ModeId};
use super::recorded::Recorded;
use super::system::What;
use crate::bytecode::Routine;
use crate::bytecode::{Frame, HasFrame, Packed, Vector, WideFrame};
use halfarrow_sim::wide::{LANES, Wide, WideSystem};
use halfarrow_sim::{Events as _, Failure, HybridSystem, System as _};
use std::sync::Arc;

/// A model in as many copies as there are lanes, each with parameters, inputs, start and memory of its own, whose rates
/// and recorded values are computed together, of those that are in one mode.
///
/// Every lane does what its model does alone, to the last bit.
#[derive(Debug, Clone)]
pub struct WideModel {
    models: Vec<Model>,
    /// The modes that have been met.
    modes: Vec<WideMode>,
    /// State and values of one lane.
    state: Vec<f64>,
    values: Vec<f64>,
}

/// What lanes of one mode share: the code, and what is recorded, both packed for lanes.
#[derive(Debug, Clone)]
struct WideMode {
    mode: ModeId,
    frame: WideFrame<LANES>,
    code: Arc<Mode>,
    recorded: Arc<Recorded>,
    rates: Packed,
    observe: Packed,
    /// Lanes whose parameters, and what follows from them, stand in the registers.
    taken: [bool; LANES],
}

impl WideMode {
    /// The mode that a model is in, recording what it records.
    fn of(model: &Model) -> WideMode {
        let mut frame = WideFrame::default();
        let (code, recorded) = (model.code.clone(), model.recorded.clone());
        let rates = Packed::new(&code.layout, &code.rates);
        let observe = Packed::new(&code.layout, &recorded.routine);
        frame.reserve(rates.slots.max(observe.slots).max(code.layout.size as usize));
        WideMode { mode: model.run.mode, frame, code, recorded, rates, observe, taken: [false; LANES] }
    }

    /// Takes up what the model of a lane has been set to: parameters, constants and what follows from them.
    fn take(&mut self, lane: usize, model: &Model) {
        if !self.taken[lane] {
            let own = &model.frame.r[..self.code.layout.size as usize];
            self.frame.r.iter_mut().zip(own).for_each(|(r, own)| r[lane] = *own);
            self.taken[lane] = true;
        }
    }

    /// Puts time, inputs, held signals, constants and states where routines read them.
    fn place(&mut self, models: &mut [Model], t: &Wide, x: &[Wide], wanted: &[bool; LANES]) {
        let WideMode { frame, code, recorded, .. } = self;
        let (states, time) = (code.layout.states as usize, code.layout.time as usize);
        frame.r[states..].iter_mut().zip(x).for_each(|(r, x)| *r = Vector(*x));
        frame.r[time] = Vector(*t);
        let follows = code.motion.is_some() || recorded.motion.is_some();
        let given = states > time + 1;
        if !follows && !given {
            return; // no inputs, held signals or constants
        }
        for (lane, model) in models.iter_mut().enumerate().filter(|(lane, _)| wanted[*lane]) {
            // Positions are sought where their motion leads until then.
            model.frame.r[time] = t[lane];
            if !given {
                continue;
            }
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
}

impl WideModel {
    /// The same model in every lane, recording what it records.
    pub fn new(model: &Model) -> WideModel {
        let mut lane = model.clone();
        lane.scaled = false;
        let (modes, state) = (vec![WideMode::of(&lane)], vec![0.0; model.states()]);
        WideModel { models: vec![lane; LANES], modes, state, values: Vec::new() }
    }

    /// The model of a lane, to set its parameters and inputs and to find its start, not to choose what is recorded. Call
    /// [`begin`](WideModel::begin) after it.
    pub fn model(&mut self, lane: usize) -> &mut Model {
        &mut self.models[lane]
    }

    /// Takes up what the models of the lanes have been set to.
    pub fn begin(&mut self) {
        self.modes.iter_mut().for_each(|mode| mode.taken = [false; LANES]);
    }

    /// The place of the mode that a lane is in, among those that have been met.
    fn mode_of(&mut self, lane: usize) -> usize {
        let model = &self.models[lane];
        self.modes.iter().position(|mode| mode.mode == model.run.mode).unwrap_or_else(|| {
            self.modes.push(WideMode::of(model));
            self.modes.len() - 1
        })
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
        let mut good: [bool; LANES] = std::array::from_fn(|lane| failures[lane].is_none());
        let wanted = good;
        let Some(first) = good.iter().position(|good| *good) else { return };
        let number = self.mode_of(first);
        let WideModel { models, modes, .. } = self;
        let mode = &mut modes[number];
        (0..LANES).filter(|&lane| wanted[lane]).for_each(|lane| mode.take(lane, &models[lane]));
        mode.place(models, t, x, &wanted);
        let WideMode { frame, code, recorded, rates, observe, .. } = mode;
        let (routine, packed) = match what {
            What::Rates => (&code.rates, &*rates),
            _ => (&recorded.routine, &*observe),
        };
        frame.run(routine, packed, models, &mut good);
        for (out, &slot) in out.iter_mut().zip(&packed.outputs) {
            *out = frame.r[slot as usize].0;
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

    fn mode(&self, lane: usize) -> u32 {
        self.models[lane].run.mode.0
    }

    fn may_change_mode(&self) -> bool {
        self.models[0].may_change_mode()
    }

    fn remembers(&self) -> bool {
        let newton = |routine: &Routine| routine.solves.iter().any(|solve| !solve.guess.is_empty());
        let WideMode { code, recorded, .. } = &self.modes[0];
        newton(&code.rates) || newton(&recorded.routine) || !self.models[0].run.delays_and_samples.is_empty()
    }
}
