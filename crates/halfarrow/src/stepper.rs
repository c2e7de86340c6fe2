//! A run in the hands of the caller: stepped, read, set, saved and taken up again.

use std::sync::Arc;

use halfarrow_compiler::equations::Form;
use halfarrow_compiler::program::Program;
use halfarrow_compiler::unit::Unit;
use halfarrow_exec as exec;
use halfarrow_sim::fixed_step::{FixedMethod, History};
use halfarrow_sim::{Events as _, Method, Position, Stepwise, tick};

use crate::compiled::Compiled;
use crate::drift::{DriftReport, drifts_at};
use crate::error::{Error, Problem};
use crate::model::Model;
use crate::run::{Start, projected, refused};
use crate::sweep::known_parameter;

/// A run by a method of fixed step that goes on as far as it is told, and can be read and set in between. Values of inputs
/// and of what is read are in the units that their declarations give, times in s.
///
/// ```
/// use halfarrow::{FixedMethod, Form, Model, Start};
/// let text = "model Cart\ninput push : N = 0\nSe:hand(push) -> 1:axis -> I:cart(2 kg)\naxis -> R:drag(1 N.s/m)\n";
/// let cart = Model::from_text("cart.bond", text, &[])?.compile(Form::Minimal)?;
/// let mut run = cart.stepper(FixedMethod::Rk4, 1e-3, Start::Given)?;
/// run.set_input("push", 3.0)?;
/// run.advance(1000)?;
/// let saved = run.save();
/// run.advance(1000)?;
/// let later = run.read("cart.f")?;
/// run.restore(&saved)?;
/// assert_eq!(run.time(), 1.0);
/// run.advance(1000)?;
/// assert_eq!(run.read("cart.f")?.to_bits(), later.to_bits());
/// # Ok::<(), halfarrow::Error>(())
/// ```
pub struct Stepper {
    system: exec::Model,
    run: Stepwise,
    of: RunKind,
    /// Steps since `from`.
    steps: u64,
    /// Where they are counted from.
    from: f64,
    x: Vec<f64>,
    /// Inputs that were set, in SI units.
    inputs: Vec<Option<f64>>,
    /// What was read last, by its index; all of it is computed together.
    values: Vec<f64>,
}

/// What runs have in common of which one can go on where another stands.
#[derive(Debug, Clone)]
struct RunKind {
    model: Model,
    /// The states of the equations as they are compiled.
    states: Arc<[String]>,
    method: FixedMethod,
    project: bool,
    step: f64,
}

impl RunKind {
    /// Why a run of this kind cannot go on where one of the other kind stands, if it cannot.
    fn differs_from(&self, other: &RunKind) -> Option<String> {
        if !self.model.has_text_of(&other.model) || self.states != other.states {
            return Some(format!("it is of another model, `{}`", other.model.name()));
        }
        if self.method != other.method || self.project != other.project {
            return Some("it is of a run by another method".into());
        }
        (self.step != other.step)
            .then(|| format!("it is of a run with steps of {} s, those of this one take {} s", other.step, self.step))
    }
}

/// Where a run stands, with its parameters and inputs.
#[derive(Debug, Clone)]
pub struct Snapshot {
    of: RunKind,
    setup: exec::Setup,
    memory: exec::Memory,
    position: Position,
    history: Option<History>,
    steps: u64,
    from: f64,
    x: Vec<f64>,
    inputs: Vec<Option<f64>>,
}

impl Compiled {
    /// Begins a run that is taken step by step, `step` in s each. The form has to be the minimal one.
    ///
    /// # Errors
    /// The form is another one, the step is no time, or there is no start.
    pub fn stepper(&self, method: FixedMethod, step: f64, start: Start) -> Result<Stepper, Error> {
        self.stepper_projecting(method, step, start, false)
    }

    /// The same run with positions that only speeds keep together put back onto the relations between them after each step,
    /// if it is to `project`.
    ///
    /// # Errors
    /// As [`stepper`](Compiled::stepper), or something cannot be put back.
    pub fn stepper_projecting(
        &self,
        method: FixedMethod,
        step: f64,
        start: Start,
        project: bool,
    ) -> Result<Stepper, Error> {
        let bad = |reason: String| Err(Problem::BadOption { reason }.into());
        if self.form() != Form::Minimal {
            return bad(format!("step by step a model runs in the form minimal, not in {}", self.form().name()));
        }
        if !(step.is_finite() && step > 0.0) {
            return bad(format!("a step takes {step} s: it has to be above 0"));
        }
        let mut system = self.minimal().clone();
        let mut x = self.model().start(&mut system, start)?;
        // Nothing is recorded unless it is read, which cannot fail.
        let _ = system.record(&[]);
        projected(system.program(), project, Method::Fixed(method))?;
        system.tell_drift(true);
        let mut run = Stepwise::new(method, 0.0, &system).projecting(project);
        system.begin_at_positions(0.0, &mut x);
        run.start(&mut system, &mut x).map_err(|stopped| self.model().stopped_at(stopped))?;
        let inputs = vec![None; system.program().inputs.len()];
        let states = self.minimal().program().states.iter().map(|state| state.name.clone()).collect();
        let of = RunKind { model: self.model().clone(), states, method, project, step };
        Ok(Stepper { of, system, run, steps: 0, from: 0.0, x, inputs, values: Vec::new() })
    }
}

impl Stepper {
    /// How far the run has come, in s.
    pub fn time(&self) -> f64 {
        self.run.time()
    }

    /// The length of a step, in s.
    pub fn step(&self) -> f64 {
        self.of.step
    }

    /// Goes on by so many steps.
    ///
    /// # Errors
    /// The run stops; it stands at the last state that it reached.
    pub fn advance(&mut self, steps: u64) -> Result<(), Error> {
        for _ in 0..steps {
            // Steps are counted, not added up: a day of 1 ms is a day.
            let to = tick(self.from, self.of.step, (self.steps + 1) as f64);
            let done = self.run.advance(&mut self.system, to, &mut self.x);
            done.map_err(|stopped| self.of.model.stopped_at(stopped))?;
            self.steps += 1;
        }
        Ok(())
    }

    /// Sets an input: from now on it has this value.
    ///
    /// # Errors
    /// There is no such input, or the value is not finite.
    pub fn set_input(&mut self, name: &str, value: f64) -> Result<(), Problem> {
        let known = &self.system.program().inputs;
        let Some(index) = known.iter().position(|i| i.name == name) else {
            return Err(Problem::UnknownInput {
                name: name.into(),
                known: known.iter().map(|i| i.name.clone()).collect(),
            });
        };
        finite(name, value)?;
        let unit = known[index].unit.as_ref().or(known[index].deduced.as_ref());
        let value = unit.filter(|unit| !unit.is_si()).map_or(value, |unit| unit.to_si_f64(value));
        self.inputs[index] = Some(value);
        self.system.set_input(index, value);
        Ok(())
    }

    /// Sets a parameter, in SI units: an event at the present time. States keep their values, delays and samples begin anew.
    ///
    /// # Errors
    /// There is no such parameter, or the equations do not hold with this value; then it stays as it was.
    pub fn set_parameter(&mut self, name: &str, value: f64) -> Result<(), Error> {
        known_parameter(&self.system, name)?;
        finite(name, value)?;
        let before = self.save();
        let bad = |reason: String| Error::from(Problem::BadOption { reason });
        let placed = self.system.set_parameter(name, value).map_err(|why| bad(why.to_string()));
        let held = placed.and_then(|()| self.system.broken().map_or(Ok(()), |failure| Err(bad(failure.to_string()))));
        let taken = held.and_then(|()| self.take_up());
        if taken.is_err() {
            self.restore(&before)?;
        }
        taken
    }

    /// The value of a parameter or constant, in SI units; `None` if there is none of that name.
    pub fn parameter(&self, name: &str) -> Option<f64> {
        self.system.parameter(name)
    }

    /// The present value of what can be recorded.
    ///
    /// # Errors
    /// There is nothing of that name, or it has no value.
    pub fn read(&mut self, name: &str) -> Result<f64, Error> {
        let place = match self.place(name) {
            Some(place) => place,
            None => self.take_along(name)?,
        };
        self.values.resize(self.system.recorded().len(), 0.0);
        let seen = self.system.observe(self.run.time(), &self.x, &mut self.values);
        seen.map_err(|failure| self.of.model.stopped(failure))?;
        let unit = self.system.program().observed[self.system.recorded()[place]].unit.as_ref();
        Ok(unit.filter(|unit| !unit.is_si()).map_or(self.values[place], |unit| unit.from_si_f64(self.values[place])))
    }

    /// How far positions have drifted by now from what only their speeds keep, since the start or the last parameter that was
    /// set.
    pub fn drift(&mut self) -> Vec<DriftReport> {
        drifts_at(&mut self.system, self.run.time(), &self.x)
    }

    /// Names of all that can be read, with their units.
    pub fn readable(&self) -> impl Iterator<Item = (&str, Option<&Unit>)> {
        let program: &Program = self.system.program();
        program.observed.iter().filter(|o| o.value.is_ok()).map(|o| (&*o.name, o.unit.as_ref()))
    }

    /// All that the run needs to go on from here.
    pub fn save(&self) -> Snapshot {
        Snapshot {
            of: self.of.clone(),
            setup: self.system.setup().clone(),
            memory: self.system.memory(),
            position: self.run.position().clone(),
            history: self.run.history().cloned(),
            steps: self.steps,
            from: self.from,
            x: self.x.clone(),
            inputs: self.inputs.clone(),
        }
    }

    /// Goes on from there, with the same bits. The snapshot is of this run, or of another one of the same compiled model with
    /// the same method and step.
    ///
    /// # Errors
    /// It is of another model, method or step.
    pub fn restore(&mut self, saved: &Snapshot) -> Result<(), Error> {
        if let Some(reason) = self.of.differs_from(&saved.of) {
            let reason = format!("the snapshot does not fit this run: {reason}");
            return Err(Problem::BadOption { reason }.into());
        }
        self.system.set_up(&saved.setup).map_err(|failure| self.of.model.stopped(failure))?;
        self.inputs.clone_from(&saved.inputs);
        self.place_inputs();
        self.system.restore(&saved.memory);
        self.run.restore(&saved.position, saved.history.as_ref());
        self.x.clone_from(&saved.x);
        (self.steps, self.from) = (saved.steps, saved.from);
        Ok(())
    }

    /// Goes on from the present state with other parameters.
    fn take_up(&mut self) -> Result<(), Error> {
        self.place_inputs();
        (self.from, self.steps) = (self.time(), 0);
        self.run = Stepwise::new(self.of.method, self.from, &self.system).projecting(self.of.project);
        self.run.start(&mut self.system, &mut self.x).map_err(|stopped| self.of.model.stopped_at(stopped))
    }

    fn place_inputs(&mut self) {
        for (i, value) in self.inputs.iter().enumerate() {
            if let Some(value) = value {
                self.system.set_input(i, *value);
            }
        }
    }

    /// Where a variable stands among those that are computed.
    fn place(&self, name: &str) -> Option<usize> {
        let observed = &self.system.program().observed;
        self.system.recorded().iter().position(|&i| *observed[i].name == *name)
    }

    /// Adds a variable to those that are computed; gives its place.
    fn take_along(&mut self, name: &str) -> Result<usize, Problem> {
        let observed = &self.system.program().observed;
        let mut names: Vec<String> = self.system.recorded().iter().map(|&i| observed[i].name.to_string()).collect();
        names.push(name.to_string());
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        self.system.record(&names).map_err(|error| refused(&self.system, error))?;
        Ok(names.len() - 1)
    }
}

fn finite(name: &str, value: f64) -> Result<(), Problem> {
    match value.is_finite() {
        true => Ok(()),
        false => Err(Problem::BadOption { reason: format!("`{name}` is {value}: it has to be finite") }),
    }
}
