//! Forward sensitivities: how a run moves with parameters, start values and constant inputs, by the exact derivatives of its
//! program along directions.
//!
//! Beside the states `x` stand their derivatives `s = ∂x/∂θ`, with `s' = (∂f/∂x) s + ∂f/∂θ`: together one [`System`], which every
//! method integrates as any other. Its Jacobian is given as the blocks `∂f/∂x` along its diagonal alone: Newton solves for the
//! derivatives right after the states by the same factors, and second derivatives are not needed. At events see [`instant`]. Source: [MalyPetzold].

mod back;
mod instant;
mod start;
mod tape;

pub use back::SampleWeights;
pub use tape::{Tape, Taped};

use super::Model;
use crate::bytecode::Routine;
use halfarrow_compiler::bond_graph::HeldKind;
use halfarrow_compiler::program::Holds;
use halfarrow_sim::{Events, Failure, Jacobian, Sparsity, StepEnd, System};
use std::sync::Arc;

/// What a run may be differentiated by, by its number in the program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// A parameter, those that are given by it included.
    Parameter(usize),
    /// The value that a condition of the start asks for.
    Start(usize),
    /// The start value of a state of which no condition says anything.
    State(usize),
    /// An input that is constant.
    Input(usize),
    /// Nothing that has a name: what moves is said otherwise.
    Nothing,
}

/// How all that a run carries moves with each of some quantities.
#[derive(Debug, Clone)]
pub(super) struct Variation {
    by: Vec<Quantity>,
    names: Vec<String>,
    /// What follows from parameters alone, in the order of its registers.
    fixed: Vec<Vec<f64>>,
    inputs: Vec<Vec<f64>>,
    held: Vec<Vec<f64>>,
    conserved: Vec<Vec<f64>>,
    /// The states: at the start; at an event along its moving instant.
    states: Vec<Vec<f64>>,
    /// The instant of the event that is handled, and that of the last one that was.
    instant: Vec<f64>,
    passed: Vec<f64>,
    /// What is known before a round of events: sums, what storages keep, the new values of all actions.
    sums: Vec<Vec<f64>>,
    stored: Vec<Vec<f64>>,
    values: Vec<Vec<f64>>,
    /// Whether other variables should be independent by now, to which derivatives are not taken over.
    pub(super) outlived: bool,
}

impl Model {
    /// From now on what starts and runs carry moves with these quantities too, of these names; parameters and inputs are set
    /// before.
    ///
    /// # Errors
    /// Something has no derivative: in words, with the quantity.
    pub fn vary(&mut self, by: &[Quantity], names: &[String]) -> Result<(), String> {
        let code = self.code.clone();
        if let Some(delay) = code.program.held.iter().find(|h| h.kind == HeldKind::Delay) {
            return Err(format!("`{}` is a delayed signal, through which derivatives are not followed", delay.name));
        }
        let (count, program) = (by.len(), &code.program);
        let rows = |n: usize| vec![vec![0.0; n]; count];
        let mut variation = Box::new(Variation {
            by: by.to_vec(),
            names: names.to_vec(),
            fixed: Vec::with_capacity(count),
            inputs: rows(program.inputs.len()),
            held: rows(program.held.len()),
            conserved: rows(program.conserved.len()),
            states: rows(program.states.len()),
            instant: vec![0.0; count],
            passed: vec![0.0; count],
            sums: rows(0),
            stored: rows(program.jumps.as_ref().map_or(0, |j| j.stored.len())),
            values: rows(self.events.values.len()),
            outlived: false,
        });
        for (j, quantity) in by.iter().enumerate() {
            let fixed = self.vary_fixed(*quantity, &names[j])?;
            for (i, (input, signal)) in program.inputs.iter().zip(&self.setup.inputs).enumerate() {
                variation.inputs[j][i] = match *quantity {
                    Quantity::Input(own) if own == i => match signal.is_constant() {
                        true => 1.0,
                        false => return Err(format!("{} is given over time: it is no number to vary", names[j])),
                    },
                    _ if signal.moves() => 0.0,
                    _ => code.layout.registers.get(input.default).map_or(0.0, |r| fixed[r as usize]),
                };
            }
            variation.fixed.push(fixed);
        }
        self.variation = Some(variation);
        Ok(())
    }

    /// How what follows from parameters alone moves with a quantity.
    fn vary_fixed(&mut self, quantity: Quantity, name: &str) -> Result<Vec<f64>, String> {
        let code = self.code.clone();
        let fixed = code.layout.time as usize;
        let Quantity::Parameter(index) = quantity else { return Ok(vec![0.0; fixed]) };
        self.frame.varied = Some(index as u32);
        self.frame.d.fill(0.0);
        let run = self.frame.run_along(&code.preamble).and_then(|()| self.frame.run_along(&code.assumed));
        self.frame.varied = None;
        let moved = self.frame.d[..fixed].to_vec();
        let assumed: Vec<(f64, f64)> = code.assumed.outputs.chunks(2).map(|o| self.frame.pair(o[0])).collect();
        self.frame.d.fill(0.0);
        run.map_err(|error| self.failure(f64::NAN, error).to_string())?;
        let leaves = |(a, (value, slope)): &(&halfarrow_compiler::program::Assumption, (f64, f64))| match a.holds {
            Holds::Zero => *slope != 0.0,
            Holds::NotNegative => *value == 0.0 && *slope != 0.0,
            Holds::NotZero | Holds::Positive => false,
        };
        if let Some((assumption, _)) = code.program.assumptions.iter().zip(assumed).find(leaves) {
            return Err(format!(
                "the equations rest on `{}`, which holds no longer where {name} moves: there is no derivative by {name}",
                assumption.text
            ));
        }
        match moved.iter().all(|d| d.is_finite()) {
            true => Ok(moved),
            false => Err(format!("what follows from {name} has no finite derivative by it at this value")),
        }
    }

    /// Names of what it is varied by; none in most runs.
    pub fn varied_by(&self) -> &[String] {
        self.variation.as_ref().map_or(&[], |variation| &variation.names)
    }

    /// Runs a routine at `(t, x)` along quantity `j`, where the states move by `states` and the instant by `instant`: the
    /// derivatives of what it gives.
    fn run_varied(
        &mut self,
        j: usize,
        (t, x): (f64, &[f64]),
        (states, instant): (&[f64], f64),
        routine: &Routine,
    ) -> Result<Vec<f64>, Failure> {
        self.place(t, x);
        self.run_placed(j, t, (states, instant), routine)
    }

    /// The same at what is placed.
    fn run_placed(
        &mut self,
        j: usize,
        t: f64,
        (states, instant): (&[f64], f64),
        routine: &Routine,
    ) -> Result<Vec<f64>, Failure> {
        self.still();
        if instant != 0.0 {
            self.let_time_pass(t);
            let moving = self.code.layout.time as usize..self.code.layout.conserved as usize;
            self.frame.d[moving].iter_mut().for_each(|d| *d *= instant);
        }
        let Model { frame, code, variation, .. } = self;
        let variation = variation.as_ref().expect("asked for in runs that are varied only");
        let layout = &code.layout;
        let add = |d: &mut [f64], first: u32, by: &[f64]| {
            d[first as usize..].iter_mut().zip(by).for_each(|(d, by)| *d += by);
        };
        frame.d[..layout.time as usize].copy_from_slice(&variation.fixed[j]);
        add(&mut frame.d, layout.inputs, &variation.inputs[j]);
        add(&mut frame.d, layout.held, &variation.held[j]);
        add(&mut frame.d, layout.conserved, &variation.conserved[j]);
        add(&mut frame.d, layout.states, states);
        frame.begin(None);
        let run = frame.run_along(routine);
        let slopes = routine.outputs.iter().map(|&r| frame.d[r as usize]).collect();
        // All others run along directions in which parameters stay.
        frame.d[..layout.time as usize].fill(0.0);
        self.rated = None;
        run.map(|()| slopes).map_err(|error| self.failure(t, error))
    }

    /// Why a run that is followed by derivatives could not be followed any further at `time`, if it needed other independent
    /// variables by then: these are not taken over into them. What else stops a run, its user for one, is the reason itself.
    pub fn end_of_derivatives(&self, failure: &Failure, time: f64) -> Option<Failure> {
        let lost = matches!(
            failure,
            Failure::Singular { .. }
                | Failure::NoConvergence { .. }
                | Failure::Branch { .. }
                | Failure::OffMotion { .. }
                | Failure::Bound { .. }
                | Failure::StepTooSmall { .. }
        );
        let outlived = self.variation.as_ref().is_some_and(|variation| variation.outlived);
        (lost && outlived).then(|| Model::in_other_variables(time))
    }

    /// That there is no derivative where other variables become independent.
    fn in_other_variables(time: f64) -> Failure {
        let reason =
            "the run goes on with other independent variables there, and derivatives are not taken over into these";
        Model::without_derivative(time, "the motion", reason)
    }

    /// That there is no derivative.
    fn without_derivative(time: f64, what: impl Into<String>, reason: impl Into<String>) -> Failure {
        Failure::NotDifferentiable { time, what: what.into(), reason: reason.into() }
    }
}

/// A model that is varied, as a system to integrate: its states, then their derivatives, quantity by quantity. What it
/// records is followed by the derivatives of the last recorded values, quantity by quantity.
pub struct Varied<'m> {
    model: &'m mut Model,
    /// How many states there are, and the first recorded value that is differentiated.
    n: usize,
    first: usize,
    sparsity: Sparsity,
    scales: Vec<f64>,
    jacobian: Jacobian,
}

impl<'m> Varied<'m> {
    /// Of a model that has been told what by, and has been started; recorded values from `first` on are differentiated.
    pub fn new(model: &'m mut Model, first: usize) -> Varied<'m> {
        let variation = model.variation.as_ref().expect("it is varied");
        let (n, count) = (model.states(), variation.by.len());
        let mut scales = model.scales().to_vec();
        for &quantity in &variation.by {
            let size = model.size_of(quantity);
            scales.extend((0..n).map(|i| if size > 0.0 { model.scales()[i] / size } else { 0.0 }));
        }
        let own = model.sparsity();
        let column = |c: usize| own.column(c % n).iter().map(|row| row + (c / n) * n).collect::<Vec<usize>>();
        let sparsity = Sparsity::from_columns((0..n * (count + 1)).map(column));
        let jacobian = Jacobian::new(own);
        Varied { n, first, sparsity, scales, jacobian, model }
    }

    /// Where a run from `x` begins.
    pub fn point(&self, x: &[f64]) -> Vec<f64> {
        let variation = self.model.variation.as_ref().expect("it is varied");
        x.iter().chain(variation.states.iter().flatten()).copied().collect()
    }

    /// How many recorded values are differentiated.
    fn differentiated(&self) -> usize {
        self.model.observed() - self.first
    }

    fn by(&self, j: usize) -> &str {
        &self.model.varied_by()[j]
    }

    /// The number of quantities.
    fn count(&self) -> usize {
        self.model.varied_by().len()
    }
}

impl Model {
    /// The present value of a parameter or a constant input, in SI units.
    pub fn value_of(&self, quantity: Quantity) -> Option<f64> {
        match quantity {
            Quantity::Parameter(index) => Some(self.frame.r[self.code.layout.parameters as usize + index]),
            Quantity::Input(index) => Some(self.frame.r[self.code.layout.inputs as usize + index]),
            Quantity::Start(_) | Quantity::State(_) | Quantity::Nothing => None,
        }
    }

    /// The magnitude of a quantity, 0 where it is not known.
    pub fn size_of(&self, quantity: Quantity) -> f64 {
        let register = |r: Option<u32>| r.map_or(0.0, |r| self.frame.r[r as usize].abs());
        let layout = &self.code.layout;
        match quantity {
            Quantity::Parameter(index) => register(Some(layout.parameters + index as u32)),
            Quantity::Input(index) => register(Some(layout.inputs + index as u32)),
            Quantity::Nothing => 0.0,
            Quantity::State(index) => self.run.scales.get(index).copied().unwrap_or(0.0),
            Quantity::Start(index) => register(layout.registers.get(self.code.program.start[index].asked)),
        }
    }
}

impl System for Varied<'_> {
    fn states(&self) -> usize {
        self.scales.len()
    }

    fn state_name(&self, state: usize) -> String {
        let name = self.model.state_name(state % self.n);
        if state < self.n { name } else { format!("d({name})/d({})", self.by(state / self.n - 1)) }
    }

    fn scales(&self) -> &[f64] {
        &self.scales
    }

    fn rates(&mut self, t: f64, y: &[f64], dy: &mut [f64]) -> Result<(), Failure> {
        let n = self.n;
        let (x, s) = y.split_at(n);
        self.model.rates(t, x, &mut dy[..n])?;
        let code = Arc::clone(&self.model.code);
        for j in 0..self.count() {
            let slopes = self.model.run_varied(j, (t, x), (&s[j * n..][..n], 0.0), &code.rates)?;
            for (i, slope) in slopes.into_iter().enumerate() {
                dy[(j + 1) * n + i] = slope;
                if !slope.is_finite() {
                    let what = format!("the rate of {} by {}", self.model.state_name(i), self.by(j));
                    return Err(Model::without_derivative(t, what, "it is not a finite number there"));
                }
            }
        }
        Ok(())
    }

    /// Along the diagonal blocks alone.
    fn directional_derivative(&mut self, t: f64, y: &[f64], v: &[f64], jv: &mut [f64]) -> Result<(), Failure> {
        let n = self.n;
        let blocks = v.chunks(n).zip(jv.chunks_mut(n));
        blocks.into_iter().try_for_each(|(v, jv)| self.model.directional_derivative(t, &y[..n], v, jv))
    }

    /// Asked for by linearly implicit methods alone, which need second derivatives besides.
    fn time_derivative(&mut self, t: f64, _: &[f64], _: &mut [f64]) -> Result<(), Failure> {
        let reason = "linearly implicit methods need second derivatives of the model: take implicit-midpoint or radau";
        Err(Model::without_derivative(t, "the step", reason))
    }

    fn sparsity(&self) -> &Sparsity {
        &self.sparsity
    }

    /// One for the states, and the same for the derivatives by each quantity.
    fn blocks(&self) -> usize {
        self.count() + 1
    }

    fn jacobian(&mut self, t: f64, y: &[f64], values: &mut [f64]) -> Result<bool, Failure> {
        let nonzeros = values.len() / (self.count() + 1);
        let Varied { jacobian, model, n, .. } = self;
        let (first, copies) = values.split_at_mut(nonzeros);
        jacobian.visit(&mut **model, t, &y[..*n], |_, _, place, value| first[place] = value)?;
        copies.chunks_mut(nonzeros.max(1)).for_each(|copy| copy.copy_from_slice(first));
        Ok(true)
    }
}

impl Events for Varied<'_> {
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

    fn event_indicators(&mut self, t: f64, y: &[f64], g: &mut [f64]) -> Result<(), Failure> {
        self.model.event_indicators(t, &y[..self.n], g)
    }

    fn handle_event(&mut self, t: f64, y: &mut [f64]) -> Result<(), Failure> {
        let (x, s) = y.split_at_mut(self.n);
        self.model.handle_varied(t, x, s)
    }

    fn exchange_independent(&mut self, t: f64, y: &mut [f64], step: StepEnd) -> Result<bool, Failure> {
        if !self.model.exchange_independent(t, &mut y[..self.n], step)? {
            return Ok(false);
        }
        Err(Model::in_other_variables(t))
    }

    fn note_magnitudes(&mut self, t: f64, y: &[f64], magnitudes: &[f64]) -> Result<(), Failure> {
        self.model.note_magnitudes(t, &y[..self.n], &magnitudes[..self.n])
    }

    fn looks_between(&self) -> bool {
        self.model.looks_between()
    }

    /// What happens where the run switches moves with the instant: it is located by every method.
    fn locates_crossings(&self) -> bool {
        self.model.indicators() > 0
    }

    fn try_end(&mut self, t: f64, y: &[f64]) -> Result<(), Failure> {
        self.model.try_end(t, &y[..self.n])
    }

    fn longest_step(&self) -> f64 {
        self.model.longest_step()
    }

    fn stands_still(&self) -> bool {
        self.model.stands_still()
    }

    fn accept(&mut self, t: f64, y: &[f64]) -> Result<(), Failure> {
        self.model.accept(t, &y[..self.n])
    }

    fn observed(&self) -> usize {
        self.model.observed() + self.count() * self.differentiated()
    }

    fn observed_name(&self, value: usize) -> String {
        match value.checked_sub(self.model.observed()) {
            None => self.model.observed_name(value),
            Some(k) => {
                let (j, i) = (k / self.differentiated(), k % self.differentiated());
                format!("d({})/d({})", self.model.observed_name(self.first + i), self.by(j))
            }
        }
    }

    fn passed_pole(&mut self, t: f64) -> Result<(), Failure> {
        self.model.passed_pole(t)
    }

    fn observe(&mut self, t: f64, y: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        let (n, own, each) = (self.n, self.model.observed(), self.differentiated());
        let (x, s) = y.split_at(n);
        self.model.observe(t, x, &mut out[..own])?;
        let recorded = Arc::clone(&self.model.recorded);
        for j in 0..self.count() {
            let slopes = self.model.run_varied(j, (t, x), (&s[j * n..][..n], 0.0), &recorded.routine)?;
            for (i, &slope) in slopes[self.first..].iter().enumerate() {
                out[own + j * each + i] = slope;
                if !slope.is_finite() {
                    let what = format!("{} by {}", self.model.observed_name(self.first + i), self.by(j));
                    return Err(Model::without_derivative(t, what, "it is not a finite number there"));
                }
            }
        }
        Ok(())
    }
}
