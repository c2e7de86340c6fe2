//! Gradients: a run followed backwards, from what its samples weigh to what each quantity weighs that it is varied by.

use super::tape::{From, Point, Sample, Tape};
use crate::bytecode::{Hold, Routine, Weights};
use crate::model::Model;
use crate::model::compiled::Mode;
use halfarrow_sim::fixed_step::StepBack;
use halfarrow_sim::{Backwards, Failure, Method, Sparsity, System, Transposed, follow_back};
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

/// Points between which the states are a polynomial, where their rates would be less exact than they are.
const NEIGHBOURS: usize = 6;
/// Ends of steps kept, of those gone back through last.
const KEPT: usize = 16;

/// What samples weigh.
#[derive(Debug, Clone, Copy)]
pub struct SampleWeights<'w> {
    /// The first recorded value that has a weight.
    pub first: usize,
    /// Row by row those of the values of a sample.
    pub values: &'w [f64],
    /// Those of the times of samples that move with events; empty if no sample moves.
    pub times: &'w [f64],
}

impl SampleWeights<'_> {
    /// Those of the values of a sample, by its number among so many.
    fn of(&self, sample: usize, samples: usize) -> &[f64] {
        let each = self.values.len() / samples.max(1);
        &self.values[sample * each..][..each]
    }
}

impl Tape {
    /// The number of samples.
    pub fn samples(&self) -> usize {
        self.samples.len()
    }

    /// The derivatives, by each quantity that the model is varied by, of the sum of all recorded values from `first` on, each
    /// times its weight: row by row those of a sample; and of the times of samples that events were taken at, which move with
    /// these, each times its own, where there are any. The run was made by the `method`; one of variable step is followed
    /// back to the relative error `rtol`, and its states have no rates to build on where it is `stiff`.
    ///
    /// # Errors
    /// There is no derivative somewhere, or what the model reports.
    pub fn gradient(
        &self,
        model: &mut Model,
        weights: &SampleWeights<'_>,
        (method, stiff): (Method, bool),
        rtol: f64,
    ) -> Result<Vec<f64>, Failure> {
        let start = self.start.as_ref().expect("the run has begun");
        let kept = model.variation.take();
        let mut back = Back::new(model, self, stiff);
        let found = back.follow(weights, method, rtol);
        let gathered = std::mem::take(&mut back.gathered);
        let (states, direct) = (std::mem::take(&mut back.weights_of_states), std::mem::take(&mut back.direct));
        model.variation = kept;
        found?;
        // What does not move has no part, even where its weight is infinite.
        let sum = |weights: &[f64], moves: &[f64]| -> f64 {
            weights.iter().zip(moves).filter(|(_, moves)| **moves != 0.0).map(|(w, moves)| w * moves).sum()
        };
        let layout = &model.code.layout;
        let part = |from: u32| &gathered[from as usize..];
        let gradient = (0..start.states.len()).map(|j| {
            direct[j]
                + sum(&states, &start.states[j])
                + sum(&gathered[..layout.time as usize], &start.fixed[j])
                + sum(part(layout.inputs), &start.inputs[j])
                + sum(part(layout.held), &start.held[j])
                + sum(part(layout.conserved), &start.conserved[j])
        });
        let gradient: Vec<f64> = gradient.collect();
        match gradient.iter().position(|slope| !slope.is_finite()) {
            None => Ok(gradient),
            Some(j) => {
                let name = &model.varied_by()[j];
                Err(Model::without_derivative(
                    self.points.first().map_or(0.0, |point| point.t),
                    format!("the weighted sum by {name}"),
                    "it is not a finite number",
                ))
            }
        }
    }
}

/// On the way back.
struct Back<'m> {
    model: &'m mut Model,
    mode: Arc<Mode>,
    tape: &'m Tape,
    stiff: bool,
    /// The rates, and what is recorded, with every value kept.
    rates: Routine,
    recorded: Routine,
    weights: Weights,
    /// What states weigh, and what stands in the registers before them.
    weights_of_states: Vec<f64>,
    gathered: Vec<f64>,
    /// What quantities weigh by what events make of them.
    direct: Vec<f64>,
    /// Registers before the states that the rates read, but for time: the constants of a step; and their magnitudes.
    read: Vec<u32>,
    constants: Vec<f64>,
    magnitudes: Vec<f64>,
    transposed: Sparsity,
    /// The point whose memory the model has.
    at: Option<usize>,
    /// The points between which no event lies, where the way back is.
    smooth: Range<usize>,
    ends: BTreeMap<usize, End>,
    x: Vec<f64>,
}

/// Rates and second derivatives at a point.
#[derive(Debug, Clone)]
struct End {
    rates: Vec<f64>,
    turns: Vec<f64>,
}

impl<'m> Back<'m> {
    fn new(model: &'m mut Model, tape: &'m Tape, stiff: bool) -> Back<'m> {
        let mode = model.code.clone();
        let layout = &mode.layout;
        let rates = layout.keeping(&mode.rates.source);
        let recorded = layout.keeping(&model.recorded.routine.source);
        model.frame.reserve(&rates);
        model.frame.reserve(&recorded);
        let mut is_read = vec![false; layout.states as usize];
        rates.for_each_read(|register| {
            if let Some(read) = is_read.get_mut(register as usize) {
                *read = true;
            }
        });
        is_read[layout.time as usize] = false;
        let constant: Vec<u32> = layout.constants.iter().map(|&(register, _)| register).collect();
        constant.iter().for_each(|&register| is_read[register as usize] = false);
        let moving = model.inputs().iter().enumerate().filter(|(_, signal)| !signal.is_constant()).map(|(i, _)| i);
        moving.for_each(|i| is_read[layout.inputs as usize + i] = false);
        let read: Vec<u32> = (0..layout.states).filter(|&register| is_read[register as usize]).collect();
        let n = model.states();
        let known = |i: usize| tape.points.iter().fold(model.scales()[i], |most, point| most.max(point.x[i].abs()));
        Back {
            magnitudes: (0..n).map(known).collect(),
            transposed: model.sparsity().transposed(),
            weights: Weights::default(),
            weights_of_states: vec![0.0; n],
            gathered: vec![0.0; layout.states as usize],
            direct: vec![0.0; tape.start.as_ref().map_or(0, |start| start.states.len())],
            constants: vec![0.0; read.len()],
            read,
            stiff,
            rates,
            recorded,
            at: None,
            smooth: tape.points.len()..tape.points.len(),
            ends: BTreeMap::new(),
            x: vec![0.0; n],
            mode,
            model,
            tape,
        }
    }

    fn follow(&mut self, weights: &SampleWeights<'_>, method: Method, rtol: f64) -> Result<(), Failure> {
        let mut states = std::mem::take(&mut self.weights_of_states);
        let found = self.follow_to_start(weights, (method, rtol), &mut states);
        self.weights_of_states = states;
        found
    }

    /// From the end of the run to its start.
    fn follow_to_start(
        &mut self,
        weights: &SampleWeights<'_>,
        (method, rtol): (Method, f64),
        states: &mut [f64],
    ) -> Result<(), Failure> {
        let tape = self.tape;
        let mut samples = (0..tape.samples.len()).rev().peekable();
        let mut steps = match method {
            Method::Fixed(method) => Some(StepBack::new(method, self.model.sparsity())),
            _ => None,
        };
        let mut k = tape.points.len();
        while let Some(point) = k.checked_sub(1).map(|k| &tape.points[k]) {
            k -= 1;
            if self.smooth.start > k {
                self.smooth = self.around(k);
            }
            let instant = self.weight_of_instant(k, weights)?;
            // What is sampled where the run stands.
            let stands = |sample: &Sample| sample.after == k && sample.inside.is_none();
            while let Some(sample) = samples.next_if(|&s| stands(&tape.samples[s])) {
                self.weigh_sample(sample, weights, states)?;
            }
            match (&point.from, &mut steps) {
                (From::Start, _) => return Ok(()),
                (From::Switch, _) => {}
                (From::Event(moves), _) => self.back_through_event(moves, instant, states),
                (From::Step, Some(steps)) => self.back_over_step(steps, k, states)?,
                (From::Step, None) => {
                    // As far as nothing is sampled and nothing happens.
                    let mut to = k - 1;
                    let due = samples.peek().map_or(0, |&s| tape.samples[s].after);
                    while to > due && matches!(tape.points[to].from, From::Step) {
                        to -= 1;
                    }
                    let mut t = point.t;
                    while let Some(sample) = samples.next_if(|&s| tape.samples[s].after == k) {
                        self.along((t, tape.samples[sample].t), (method, rtol), states)?;
                        self.weigh_sample(sample, weights, states)?;
                        t = tape.samples[sample].t;
                    }
                    self.along((t, tape.points[to].t), (method, rtol), states)?;
                    k = to + 1;
                }
            }
        }
        Ok(())
    }

    /// The points around one between which no event lies.
    fn around(&self, k: usize) -> Range<usize> {
        let points = &self.tape.points;
        let start = (0..=k).rev().find(|&i| !matches!(points[i].from, From::Step)).unwrap_or(0);
        start..k + 1
    }

    /// Has the model remember what it did at a point.
    fn remember(&mut self, point: usize) {
        if self.at != Some(point) {
            self.model.restore(&self.tape.points[point].memory);
            self.at = Some(point);
        }
    }

    /// What the instant of an event weighs, by which the run came to a point: by the times of the samples before and behind it, and
    /// by the values that these have then, which follow the run. Derivatives of values are those at times that stand still.
    fn weight_of_instant(&mut self, k: usize, weights: &SampleWeights<'_>) -> Result<f64, Failure> {
        let (points, samples) = (&self.tape.points, &self.tape.samples);
        if weights.times.is_empty() || !matches!(points[k].from, From::Event(_)) {
            return Ok(0.0);
        }
        let t = points[k].t;
        // What stands between two events of one instant goes with the first.
        let first = matches!(points[k - 1].from, From::Event(_)) && points[k - 1].t == t;
        let there = |s: &Sample| s.t == t && s.inside.is_none() && (s.after == k || s.after == k - 1 && !first);
        let near = samples.partition_point(|s| s.after + 1 < k)..samples.partition_point(|s| s.after <= k);
        let mut weight = 0.0;
        for number in near {
            let sample = &samples[number];
            if !there(sample) {
                continue;
            }
            weight += weights.times[number] + self.drift(sample, (weights.first, weights.of(number, samples.len())))?;
        }
        Ok(weight)
    }

    /// How the weighted sum of the values of a sample moves in time.
    fn drift(&mut self, sample: &Sample, (first, weights): (usize, &[f64])) -> Result<f64, Failure> {
        if weights.iter().all(|&weight| weight == 0.0) {
            return Ok(0.0);
        }
        let x = &self.tape.points[sample.after].x;
        self.remember(sample.after);
        let mut rates = vec![0.0; x.len()];
        self.model.rates(sample.t, x, &mut rates)?;
        self.model.place(sample.t, x);
        self.model.still();
        self.model.let_time_pass(sample.t);
        let Model { frame, recorded, code, .. } = &mut *self.model;
        frame.d[code.layout.states as usize..][..rates.len()].copy_from_slice(&rates);
        frame.begin(None);
        let run = frame.run_along(&recorded.routine);
        let slopes = recorded.routine.outputs[first..].iter().map(|&output| frame.d[output as usize]);
        let sum = slopes.zip(weights).filter(|(_, weight)| **weight != 0.0).map(|(slope, weight)| slope * weight).sum();
        self.model.rated = None;
        run.map_err(|error| self.model.failure(sample.t, error))?;
        Ok(sum)
    }

    /// What the samples of recorded values weigh.
    fn weigh_sample(&mut self, number: usize, all: &SampleWeights<'_>, states: &mut [f64]) -> Result<(), Failure> {
        let (sample, first) = (&self.tape.samples[number], all.first);
        let weights = all.of(number, self.tape.samples.len());
        if weights.iter().all(|&weight| weight == 0.0) {
            return Ok(());
        }
        let point = &self.tape.points[sample.after];
        let x = sample.inside.as_ref().unwrap_or(&point.x);
        self.remember(if sample.inside.is_some() { sample.after - 1 } else { sample.after });
        self.model.place(sample.t, x);
        run_keeping(self.model, &self.recorded, sample.t)?;
        let before = std::iter::repeat_n(0.0, first);
        let run = self.model.frame.run_back(&self.recorded, before.chain(weights.iter().copied()), &mut self.weights);
        run.map_err(|error| self.model.failure(sample.t, error))?;
        let own = self.mode.layout.states;
        states.iter_mut().zip(own..).for_each(|(state, register)| *state += self.weights.of(register));
        self.gathered.iter_mut().zip(0..).for_each(|(weight, register)| *weight += self.weights.of(register));
        finite(self.model, sample.t, states)
    }

    fn back_through_event(&mut self, moves: &[Vec<f64>], instant: f64, states: &mut [f64]) {
        let layout = &self.mode.layout;
        let [n, m, h] = [states.len(), self.model.run.conserved.len(), self.mode.program.held.len()];
        let (conserved, held) = (layout.conserved as usize, layout.held as usize);
        let after: Vec<f64> = states
            .iter()
            .chain(&self.gathered[conserved..conserved + m])
            .chain(&self.gathered[held..held + h])
            .chain([&instant])
            .copied()
            .collect();
        let weigh = |row: &Vec<f64>| -> f64 {
            row.iter().zip(&after).filter(|(moved, _)| **moved != 0.0).map(|(moved, w)| moved * w).sum()
        };
        let mut weights = moves.iter().map(weigh);
        states.iter_mut().zip(&mut weights).for_each(|(state, weight)| *state = weight);
        self.gathered[conserved..conserved + m].iter_mut().zip(&mut weights).for_each(|(c, weight)| *c = weight);
        self.gathered[held..held + h].iter_mut().zip(&mut weights).for_each(|(h, weight)| *h = weight);
        debug_assert!(moves.len() == n + m + h + self.direct.len());
        self.direct.iter_mut().zip(weights).for_each(|(direct, weight)| *direct += weight);
    }

    fn back_over_step(&mut self, steps: &mut StepBack, k: usize, states: &mut [f64]) -> Result<(), Failure> {
        self.remember(k - 1);
        let (from, to) = (&self.tape.points[k - 1], &self.tape.points[k]);
        let mut gathered = vec![0.0; self.read.len()];
        let found = steps.step(self, (from.t, to.t), (&from.x, &to.x), states, &mut gathered);
        self.gather(&gathered, false);
        found.and_then(|()| finite(self.model, from.t, states))
    }

    /// Adds up what the constants of a step weigh, or takes it for all that they weigh.
    fn gather(&mut self, gathered: &[f64], all: bool) {
        for (&register, weight) in self.read.iter().zip(gathered) {
            let own = &mut self.gathered[register as usize];
            *own = if all { *weight } else { *own + weight };
        }
    }

    /// Along the path of a method of variable step.
    fn along(
        &mut self,
        (from, to): (f64, f64),
        (method, rtol): (Method, f64),
        states: &mut [f64],
    ) -> Result<(), Failure> {
        if from <= to {
            return Ok(());
        }
        let mut gathered: Vec<f64> = self.read.iter().map(|&register| self.gathered[register as usize]).collect();
        self.constants = self.read.iter().map(|&register| self.model.frame.r[register as usize]).collect();
        let method = if self.stiff { Method::Radau } else { method };
        let method = if method == Method::Auto { Method::Explicit } else { method };
        let found = follow_back(self, (from, to), (method, rtol), states, &mut gathered);
        self.gather(&gathered, true);
        found
    }

    /// The step that a time lies in, by the point at its end.
    fn step_at(&self, t: f64) -> usize {
        let range = self.smooth.clone();
        let later = self.tape.points[range.clone()].partition_point(|point| point.t < t);
        (range.start + later).clamp(range.start + 1, range.end - 1)
    }

    /// The states at a time on the way, with what the model remembers there.
    fn place_on_path(&mut self, t: f64) -> Result<(), Failure> {
        let k = self.step_at(t);
        let mut x = std::mem::take(&mut self.x);
        let found = match self.stiff {
            true => {
                self.between_neighbours(k, t, &mut x);
                Ok(())
            }
            false => self.between_ends(k, t, &mut x),
        };
        self.remember(k - 1);
        self.model.place(t, &x);
        self.x = x;
        found
    }

    /// The polynomial of degree 5 that has states, rates and second derivatives of both ends of a step.
    fn between_ends(&mut self, k: usize, t: f64, x: &mut [f64]) -> Result<(), Failure> {
        let later = self.end_of(k, k)?;
        let sooner = self.end_of(k, k - 1)?;
        let [from, to] = [k - 1, k].map(|k| &self.tape.points[k]);
        let h = to.t - from.t;
        let s = ((t - from.t) / h).clamp(0.0, 1.0);
        let rest = 1.0 - s;
        // Of the end; those of the start mirror them.
        let value = |s: f64| s * s * s * (10.0 + s * (6.0 * s - 15.0));
        let slope = |s: f64| s * s * s * (s - 1.0) * (4.0 - 3.0 * s);
        let turn = |s: f64| 0.5 * s * s * s * (1.0 - s) * (1.0 - s);
        for (i, x) in x.iter_mut().enumerate() {
            *x = from.x[i]
                + value(s) * (to.x[i] - from.x[i])
                + h * (slope(s) * later.rates[i] - slope(rest) * sooner.rates[i])
                + h * h * (turn(s) * later.turns[i] + turn(rest) * sooner.turns[i]);
        }
        Ok(())
    }

    /// Rates and second derivatives at an end of step `k`.
    fn end_of(&mut self, k: usize, end: usize) -> Result<End, Failure> {
        // The same point may have other rates in the step before: at the point of an event there is none.
        if let Some(end) = self.ends.get(&end) {
            return Ok(end.clone());
        }
        self.remember(k - 1);
        let Point { t, x, .. } = &self.tape.points[end];
        let mut found = End { rates: vec![0.0; x.len()], turns: vec![0.0; x.len()] };
        self.model.rates(*t, x, &mut found.rates)?;
        self.model.directional_derivative(*t, x, &found.rates, &mut found.turns)?;
        let mut by_time = vec![0.0; x.len()];
        self.model.time_derivative(*t, x, &mut by_time)?;
        found.turns.iter_mut().zip(by_time).for_each(|(turn, by_time)| *turn += by_time);
        self.ends.insert(end, found.clone());
        while self.ends.len() > KEPT {
            self.ends.pop_last();
        }
        Ok(found)
    }

    /// The polynomial through the points around a step.
    fn between_neighbours(&self, k: usize, t: f64, x: &mut [f64]) {
        let range = self.smooth.clone();
        let count = NEIGHBOURS.min(range.len());
        let start = (k + 1).saturating_sub(count / 2 + 1).clamp(range.start, range.end - count);
        let points = &self.tape.points[start..start + count];
        x.fill(0.0);
        for (i, point) in points.iter().enumerate() {
            let others = points.iter().enumerate().filter(|(j, _)| *j != i);
            let weight: f64 = others.map(|(_, other)| (t - other.t) / (point.t - other.t)).product();
            x.iter_mut().zip(&point.x).for_each(|(x, own)| *x += weight * own);
        }
    }

    /// Transposed products with the derivatives of the rates where the model is placed.
    fn back_through_rates(
        &mut self,
        t: f64,
        w: &[f64],
        (states, constants): (&mut [f64], &mut [f64]),
        add: bool,
    ) -> Result<(), Failure> {
        run_keeping(self.model, &self.rates, t)?;
        let run = self.model.frame.run_back(&self.rates, w.iter().copied(), &mut self.weights);
        run.map_err(|error| self.model.failure(t, error))?;
        let own = self.mode.layout.states;
        states.iter_mut().zip(own..).for_each(|(state, register)| *state = self.weights.of(register));
        for (constant, &register) in constants.iter_mut().zip(&self.read) {
            *constant = self.weights.of(register) + if add { *constant } else { 0.0 };
        }
        finite(self.model, t, states)
    }
}

/// Runs a routine that keeps its values, with conditions as held, or where that has no value as they are.
fn run_keeping(model: &mut Model, routine: &Routine, t: f64) -> Result<(), Failure> {
    let once = |model: &mut Model| {
        model.rated = None;
        model.frame.inner = None;
        model.frame.begin(None);
        let run = model.frame.run(routine);
        run.map(|()| routine.outputs.iter().all(|&output| model.frame.r[output as usize].is_finite()))
    };
    let first = once(model);
    let held = model.frame.conditions.state == Hold::Keep && !model.code.switching.is_empty();
    if !held || matches!(first, Ok(true)) {
        return first.map(|_| ()).map_err(|error| model.failure(t, error));
    }
    model.frame.conditions.state = Hold::Follow;
    let second = once(model);
    model.frame.conditions.state = Hold::Keep;
    second.map(|_| ()).map_err(|error| model.failure(t, error))
}

/// That all states have finite weights.
fn finite(model: &Model, t: f64, states: &[f64]) -> Result<(), Failure> {
    match states.iter().position(|weight| !weight.is_finite()) {
        None => Ok(()),
        Some(state) => {
            let what = format!("what is recorded later by {}", model.state_name(state));
            Err(Model::without_derivative(t, what, "it is not a finite number there"))
        }
    }
}

impl Transposed for Back<'_> {
    fn system(&mut self) -> &mut dyn System {
        self.model
    }

    fn transposed(
        &mut self,
        t: f64,
        x: &[f64],
        w: &[f64],
        states: &mut [f64],
        constants: &mut [f64],
    ) -> Result<(), Failure> {
        self.model.place(t, x);
        self.back_through_rates(t, w, (states, constants), true)
    }
}

impl Backwards for Back<'_> {
    fn state_name(&self, state: usize) -> String {
        self.model.state_name(state)
    }

    fn magnitudes(&self) -> &[f64] {
        &self.magnitudes
    }

    fn constants(&self) -> &[f64] {
        &self.constants
    }

    fn sparsity(&self) -> &Sparsity {
        &self.transposed
    }

    fn products(&mut self, t: f64, w: &[f64], states: &mut [f64], constants: &mut [f64]) -> Result<(), Failure> {
        self.place_on_path(t)?;
        self.back_through_rates(t, w, (states, constants), false)
    }
}
