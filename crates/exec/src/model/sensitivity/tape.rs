//! A run that can be followed backwards: where its steps ended, what its events made of all that moves, when it was sampled.

use super::{Quantity, Variation};
use crate::model::{Memory, Model};
use halfarrow_sim::{Events, Failure, Sparsity, StepEnd, System};
use std::cell::Cell;
use std::rc::Rc;
use std::sync::Arc;

/// Directions that an event is differentiated along at once.
const TOGETHER: usize = 64;

/// What a run leaves behind.
#[derive(Debug, Clone, Default)]
pub struct Tape {
    pub(super) points: Vec<Point>,
    pub(super) samples: Vec<Sample>,
    pub(super) start: Option<StartMoves>,
}

/// Where a run stood.
#[derive(Debug, Clone)]
pub(super) struct Point {
    pub t: f64,
    pub x: Vec<f64>,
    /// What the run remembered there.
    pub memory: Arc<Memory>,
    pub from: From,
}

/// How a run came to a point from the one before.
#[derive(Debug, Clone)]
pub(super) enum From {
    /// It began there.
    Start,
    /// By a step.
    Step,
    /// By an event that changes no derivative.
    Switch,
    /// By an event: row by row the derivatives of states, conserved constants and held signals after it, and of its instant,
    /// by each of these before it, then by each quantity.
    Event(Vec<Vec<f64>>),
}

/// A sample, and the point that the run had come to when it was taken; if that is later, the states between the points.
#[derive(Debug, Clone)]
pub(super) struct Sample {
    pub t: f64,
    pub after: usize,
    pub inside: Option<Vec<f64>>,
}

/// How the start moves with each quantity.
#[derive(Debug, Clone)]
pub(super) struct StartMoves {
    pub fixed: Vec<Vec<f64>>,
    pub inputs: Vec<Vec<f64>>,
    pub held: Vec<Vec<f64>>,
    pub conserved: Vec<Vec<f64>>,
    pub states: Vec<Vec<f64>>,
}

/// A model that has been told by what it is varied, and has been started: a run of it can be followed backwards.
pub struct Taped<'m> {
    model: &'m mut Model,
    tape: Tape,
    /// What the start made of the quantities.
    variation: Option<Box<Variation>>,
    /// Whether what the model remembers changes from step to step.
    follows: bool,
    /// Whatever was observed, sampled or not, and how often.
    observed: Vec<Sample>,
    observations: Rc<Cell<usize>>,
}

impl<'m> Taped<'m> {
    /// Of a model that is varied.
    pub fn new(model: &'m mut Model) -> Taped<'m> {
        let follows = model.follows_solutions_at_all();
        let (observed, observations) = (Vec::new(), Rc::default());
        Taped { model, tape: Tape::default(), variation: None, follows, observed, observations }
    }

    /// How often values have been observed: whoever takes samples notes the number of each.
    pub fn observations(&self) -> Rc<Cell<usize>> {
        Rc::clone(&self.observations)
    }

    /// What the run has left behind, sampled by the observations of these numbers, from 1 on.
    pub fn into_tape(self, sampled: &[usize]) -> Tape {
        let Taped { mut tape, observed, .. } = self;
        tape.samples = sampled.iter().map(|&number| observed[number - 1].clone()).collect();
        tape
    }

    fn note(&mut self, t: f64, x: &[f64], from: From) {
        let memory = match self.tape.points.last() {
            Some(last) if !self.follows && matches!(from, From::Step) => Arc::clone(&last.memory),
            _ => Arc::new(self.model.memory()),
        };
        self.tape.points.push(Point { t, x: x.to_vec(), memory, from });
    }

    fn begin(&mut self, t: f64, x: &mut [f64]) -> Result<(), Failure> {
        let variation = self.model.variation.as_ref().expect("it is varied");
        let mut moved: Vec<f64> = variation.states.concat();
        self.model.handle_varied(t, x, &mut moved)?;
        let variation = self.model.variation.as_ref().expect("it is varied");
        self.tape.start = Some(StartMoves {
            fixed: variation.fixed.clone(),
            inputs: variation.inputs.clone(),
            held: variation.held.clone(),
            conserved: variation.conserved.clone(),
            states: moved.chunks(x.len().max(1)).map(<[f64]>::to_vec).collect(),
        });
        self.variation.clone_from(&self.model.variation);
        self.note(t, x, From::Start);
        Ok(())
    }

    /// Handles an event that leaves all that moves as it moved: nothing but the rates is other after it, and those do not
    /// jump. Whether it is one; any other is left to be handled.
    fn pass_switch(&mut self, t: f64, x: &[f64]) -> Result<bool, Failure> {
        let code = self.model.code.clone();
        if !code.program.clauses.is_empty() || !code.program.conserved.is_empty() || !code.program.held.is_empty() {
            return Ok(false);
        }
        let memory = self.model.memory();
        let kept = self.model.variation.take();
        let (mut before, mut after, mut moved) = (vec![0.0; x.len()], vec![0.0; x.len()], x.to_vec());
        let found = self.model.rates(t, x, &mut before).and_then(|()| {
            self.model.handle_event(t, &mut moved)?;
            self.model.rates(t, &moved, &mut after)
        });
        self.model.variation = kept;
        found?;
        let is_same = |(a, b): (&f64, &f64)| (a - b).abs() <= super::instant::SMOOTH * a.abs().max(b.abs());
        let same_mode = self.model.run.mode == memory.mode();
        let is_switch = same_mode && moved == x && before.iter().zip(&after).all(is_same);
        match is_switch {
            true => self.note(t, x, From::Switch),
            false => self.model.restore(&memory),
        }
        Ok(is_switch)
    }

    /// Handles an event along every direction, some at a time, each time from what the run remembered before it.
    fn pass_event(&mut self, t: f64, x: &mut [f64]) -> Result<(), Failure> {
        if self.pass_switch(t, x)? {
            return Ok(());
        }
        let (memory, before) = (self.model.memory(), x.to_vec());
        let own = self.variation.clone().expect("the run has begun");
        let [n, m, h] = [x.len(), own.conserved.first().map_or(0, Vec::len), own.held.first().map_or(0, Vec::len)];
        let rows = n + m + h + own.by.len();
        let mut moves = Vec::with_capacity(rows);
        for first in (0..rows).step_by(TOGETHER) {
            if first > 0 {
                self.model.restore(&memory);
                x.copy_from_slice(&before);
            }
            let directions: Vec<usize> = (first..rows.min(first + TOGETHER)).collect();
            let mut moved = self.vary_along(&own, &directions, [n, m, h]);
            self.model.handle_varied(t, x, &mut moved)?;
            let variation = self.model.variation.as_ref().expect("it was put there");
            moves.extend((0..directions.len()).map(|j| {
                let states = &moved[j * n..][..n];
                [states, &variation.conserved[j], &variation.held[j], &variation.passed[j..=j]].concat()
            }));
        }
        self.model.variation = Some(own);
        self.note(t, x, From::Event(moves));
        Ok(())
    }

    /// Has the model varied along these directions: states, conserved constants, held signals, then quantities. How the
    /// states move.
    fn vary_along(&mut self, own: &Variation, directions: &[usize], [n, m, h]: [usize; 3]) -> Vec<f64> {
        let rows = |length: usize| vec![vec![0.0; length]; directions.len()];
        let mut variation = Variation {
            by: vec![Quantity::Nothing; directions.len()],
            names: vec![String::new(); directions.len()],
            fixed: rows(0),
            inputs: rows(own.inputs.first().map_or(0, Vec::len)),
            held: rows(h),
            conserved: rows(m),
            states: rows(n),
            instant: vec![0.0; directions.len()],
            passed: vec![0.0; directions.len()],
            sums: rows(0),
            stored: rows(own.stored.first().map_or(0, Vec::len)),
            values: rows(own.values.first().map_or(0, Vec::len)),
            outlived: false,
        };
        let still = own.fixed.first().map_or(0, Vec::len);
        for (row, &direction) in directions.iter().enumerate() {
            variation.fixed[row] = vec![0.0; still];
            if direction < n {
                variation.states[row][direction] = 1.0;
                variation.names[row] = format!("{} before", self.model.state_name(direction));
            } else if direction < n + m {
                variation.conserved[row][direction - n] = 1.0;
                variation.names[row] = "a conserved sum before".into();
            } else if direction < n + m + h {
                variation.held[row][direction - n - m] = 1.0;
                variation.names[row] = format!("{} before", self.model.code.program.held[direction - n - m].name);
            } else {
                let quantity = direction - n - m - h;
                variation.by[row] = own.by[quantity];
                variation.names[row].clone_from(&own.names[quantity]);
                variation.fixed[row].clone_from(&own.fixed[quantity]);
                variation.inputs[row].clone_from(&own.inputs[quantity]);
            }
        }
        let states = variation.states.concat();
        self.model.variation = Some(Box::new(variation));
        states
    }
}

impl System for Taped<'_> {
    fn states(&self) -> usize {
        self.model.states()
    }

    fn state_name(&self, state: usize) -> String {
        self.model.state_name(state)
    }

    fn scales(&self) -> &[f64] {
        self.model.scales()
    }

    fn rates(&mut self, t: f64, x: &[f64], dx: &mut [f64]) -> Result<(), Failure> {
        self.model.rates(t, x, dx)
    }

    fn directional_derivative(&mut self, t: f64, x: &[f64], v: &[f64], jv: &mut [f64]) -> Result<(), Failure> {
        self.model.directional_derivative(t, x, v, jv)
    }

    fn time_derivative(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        self.model.time_derivative(t, x, out)
    }

    fn is_steep(&self) -> bool {
        self.model.is_steep()
    }

    fn sparsity(&self) -> &Sparsity {
        self.model.sparsity()
    }

    fn jacobian(&mut self, t: f64, x: &[f64], values: &mut [f64]) -> Result<bool, Failure> {
        self.model.jacobian(t, x, values)
    }
}

impl Events for Taped<'_> {
    fn next_time_event(&mut self, t: f64) -> Option<f64> {
        self.model.next_time_event(t)
    }

    fn is_corner(&mut self, t: f64) -> bool {
        self.model.is_corner(t)
    }

    fn indicators(&self) -> usize {
        self.model.indicators()
    }

    fn indicator_name(&self, indicator: usize) -> String {
        self.model.indicator_name(indicator)
    }

    fn angles(&self, angles: &mut Vec<f64>) {
        self.model.angles(angles);
    }

    fn event_indicators(&mut self, t: f64, x: &[f64], g: &mut [f64]) -> Result<(), Failure> {
        self.model.event_indicators(t, x, g)
    }

    fn handle_event(&mut self, t: f64, x: &mut [f64]) -> Result<(), Failure> {
        match self.tape.points.is_empty() {
            true => self.begin(t, x),
            false => self.pass_event(t, x),
        }
    }

    fn exchange_independent(&mut self, t: f64, x: &mut [f64], step: StepEnd) -> Result<bool, Failure> {
        match self.model.exchange_independent(t, x, step)? {
            true => Err(Model::in_other_variables(t)),
            false => Ok(false),
        }
    }

    fn note_magnitudes(&mut self, t: f64, x: &[f64], magnitudes: &[f64]) -> Result<(), Failure> {
        self.model.note_magnitudes(t, x, magnitudes)
    }

    fn looks_between(&self) -> bool {
        self.model.looks_between()
    }

    /// As where the run is differentiated forwards.
    fn locates_crossings(&self) -> bool {
        self.model.indicators() > 0
    }

    fn try_end(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        self.model.try_end(t, x)
    }

    fn longest_step(&self) -> f64 {
        self.model.longest_step()
    }

    fn stands_still(&self) -> bool {
        self.model.stands_still()
    }

    fn accept(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        self.model.accept(t, x)?;
        if self.tape.points.last().is_some_and(|last| last.t < t) {
            self.note(t, x, From::Step);
        }
        Ok(())
    }

    fn observed(&self) -> usize {
        self.model.observed()
    }

    fn observed_name(&self, value: usize) -> String {
        self.model.observed_name(value)
    }

    fn passed_pole(&mut self, t: f64) -> Result<(), Failure> {
        self.model.passed_pole(t)
    }

    fn observe(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        let after = self.tape.points.len().saturating_sub(1);
        let inside = self.tape.points.get(after).is_some_and(|point| t < point.t).then(|| x.to_vec());
        self.observed.push(Sample { t, after, inside });
        self.observations.set(self.observed.len());
        self.model.observe(t, x, out)
    }
}
