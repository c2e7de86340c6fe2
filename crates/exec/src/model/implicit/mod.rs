//! Any form of a graph as a system `F(t, y, y') = 0`, with the minimal form beside it: that knows what is consistent.

mod consistent;
mod modes;
mod state_map;
mod system;

use super::{
    Alternatives, Compiled, Executed, Execution, Expected, InputError, Memory, Model, Operations, ParameterError,
    RecordError, StartError,
};
use crate::machine::MachineError;
use halfarrow_compiler::program::Program;
use halfarrow_sim::{Events as _, Failure, ImplicitSystem as _, System};
use modes::Maps;
use state_map::{StateMap, without_rates_of_inputs};
use std::sync::Arc;

/// A form of a graph as a system in implicit form.
///
/// The same bytecode and the same exact derivatives serve every form: explicit ones are `y' - f(t, y)`. Consistent values
/// come from the minimal form of the same graph, the `reference`: the forms share the variables of the graph, so that
/// each unknown, multipliers and break variables included, is evaluated there.
#[derive(Debug, Clone)]
pub struct ImplicitModel {
    form: Model,
    reference: Model,
    map: Arc<StateMap>,
    maps: Arc<Maps>,
    /// The state of the reference.
    x: Vec<f64>,
    begun: bool,
    /// Whether the run has been told how great its unknowns are.
    scaled: bool,
    /// The unknowns and their rates in the mode to which the last event has led, until the method goes on from them.
    entered: Option<Vec<f64>>,
}

/// What a run of a form remembers, and the minimal form beside it.
#[derive(Debug, Clone, PartialEq)]
pub struct ImplicitMemory {
    form: Memory,
    reference: Memory,
    x: Vec<f64>,
    begun: bool,
    entered: Option<Vec<f64>>,
}

impl ImplicitModel {
    /// Makes a form ready to run. `reference` is the minimal form of the same graph.
    ///
    /// # Errors
    /// Equations of parameters alone that have no solution.
    pub fn new(mut program: Program, reference: Model) -> Result<ImplicitModel, Failure> {
        without_rates_of_inputs(&mut program, reference.program());
        Ok(ImplicitModel::of(Model::new(program)?, reference))
    }

    /// The same in all modes of set-valued laws: programs of the form in these come from `alternatives`, and `reference`
    /// finds which of them holds.
    ///
    /// # Errors
    /// As [`new`](ImplicitModel::new).
    pub fn with_modes(
        mut program: Program,
        alternatives: Arc<dyn Alternatives>,
        mut reference: Model,
    ) -> Result<ImplicitModel, Failure> {
        without_rates_of_inputs(&mut program, reference.program());
        // What has no value in some mode is no reason to leave that out.
        let _ = reference.record(&[]);
        let compiled = Compiled::new(program).with_alternatives(alternatives);
        Ok(ImplicitModel::of(Model::of(Arc::new(compiled))?, reference))
    }

    fn of(mut form: Model, mut reference: Model) -> ImplicitModel {
        let modes = !reference.code.program.set_valued.is_empty();
        form.led = modes || form.code.program.implicit.is_some();
        let map = Arc::new(StateMap::new(&mut form, &mut reference));
        let x = vec![0.0; reference.states()];
        form.restart();
        ImplicitModel { form, reference, map, maps: Arc::default(), x, begun: false, scaled: false, entered: None }
    }

    /// The program of the form.
    pub fn program(&self) -> &Program {
        self.form.program()
    }

    /// What one evaluation of the residuals takes.
    pub fn operations(&self) -> Operations {
        let mut counted = self.form.operations();
        counted.additions += self.map.equations.explicit.iter().filter(|explicit| **explicit).count();
        counted
    }

    /// As [`Model::floating`].
    pub fn floating(&self) -> Vec<String> {
        self.form.floating()
    }

    /// The minimal form beside it.
    pub fn reference(&self) -> &Model {
        &self.reference
    }

    /// The minimal form beside it, to start it: [`start_at`](ImplicitModel::start_at) goes on from its state.
    pub fn reference_mut(&mut self) -> &mut Model {
        &mut self.reference
    }

    /// The fastest rate of the minimal form linearised at the state `x`, in 1/s: of one state by itself, or of two that
    /// exchange energy. `None` where it has none.
    pub fn fastest_rate(&mut self, t: f64, x: &[f64]) -> Option<f64> {
        let n = x.len();
        let (_, jacobian) = self.reference.at_rest(t, x).ok()?;
        let pair = |i: usize, j: usize| (jacobian[i * n + j] * jacobian[j * n + i]).abs().sqrt();
        let fastest =
            (0..n).flat_map(|i| (0..=i).map(move |j| (i, j))).fold(0.0f64, |most, (i, j)| most.max(pair(i, j)));
        (fastest > 0.0 && fastest.is_finite()).then_some(fastest)
    }

    /// The form alone, as it stands. A form with explicit equations is a [`System`]; others are not.
    pub fn into_form(self) -> Model {
        self.form
    }

    /// As [`Model::set_parameter`], for both forms. A parameter that only the form has is set there.
    ///
    /// # Errors
    /// As [`Model::set_parameter`].
    pub fn set_parameter(&mut self, name: &str, value: f64) -> Result<(), ParameterError> {
        self.begun = false;
        match self.reference.set_parameter(name, value) {
            Ok(()) | Err(ParameterError::Unknown(_)) => self.form.set_parameter(name, value),
            Err(error) => Err(error),
        }
    }

    /// As [`Model::set_parameter`], for a parameter that the form alone has, by its number; the minimal form keeps its state.
    ///
    /// # Errors
    /// As [`Model::set_parameter`].
    pub fn set_form_parameter(&mut self, index: usize, value: f64) -> Result<(), ParameterError> {
        self.begun = false;
        let name = self.form.program().parameters[index].name.clone();
        self.form.set_parameter(&name, value)
    }

    /// The present value of a parameter of the form, by its number.
    pub fn parameter(&self, index: usize) -> Option<f64> {
        let name = &self.form.program().parameters.get(index)?.name;
        self.form.parameter(name)
    }

    /// As [`Model::connect`], for both forms.
    ///
    /// # Errors
    /// As [`Model::connect`].
    pub fn connect(&mut self, input: &str, times: &[f64], values: &[f64]) -> Result<(), InputError> {
        self.begun = false;
        self.reference.connect(input, times, values)?;
        self.form.connect(input, times, values)
    }

    /// As [`Model::record`].
    ///
    /// # Errors
    /// As [`Model::record`].
    pub fn record(&mut self, names: &[&str]) -> Result<(), RecordError> {
        self.form.record(names)
    }

    /// As [`Model::record_these`].
    pub fn record_these(&mut self, observed: Vec<usize>) {
        self.form.record_these(observed);
    }

    /// As [`Model::record_all`].
    pub fn record_all(&mut self) {
        self.form.record_all();
    }

    /// As [`Model::execute`], for both forms.
    ///
    /// # Errors
    /// As [`Model::execute`].
    pub fn execute(&mut self, execution: Execution, expected: Option<Expected>) -> Result<(), MachineError> {
        self.reference.execute(execution, expected)?;
        self.form.execute(execution, expected)
    }

    /// Machine code of the form, as [`Model::compile_machine`] and [`Model::compile_directional`] make it.
    ///
    /// # Errors
    /// As [`Model::compile_machine`].
    pub fn compile_machine(&mut self) -> Result<(), MachineError> {
        self.form.compile_machine()?;
        self.form.compile_directional()
    }

    /// How the form has been run.
    pub fn executed(&self) -> Vec<Executed> {
        self.form.executed()
    }

    /// Indices into [`Program::observed`] of what is recorded.
    pub fn recorded(&self) -> &[usize] {
        self.form.recorded()
    }

    /// What the run remembers, as [`Model::memory`].
    pub fn memory(&self) -> ImplicitMemory {
        let ImplicitModel { form, reference, x, begun, entered, .. } = self;
        let (x, entered) = (x.clone(), entered.clone());
        ImplicitMemory { form: form.memory(), reference: reference.memory(), x, begun: *begun, entered }
    }

    /// Goes on from it, as [`Model::restore`].
    ///
    /// # Panics
    /// If it is the memory of another model.
    pub fn restore(&mut self, memory: &ImplicitMemory) {
        self.form.restore(&memory.form);
        self.reference.restore(&memory.reference);
        self.x.copy_from_slice(&memory.x);
        self.begun = memory.begun;
        self.entered.clone_from(&memory.entered);
        if self.has_modes() {
            self.take_map(f64::NAN).expect("the form has run in this mode");
        }
    }

    /// Unknowns and their rates at the start of a run at `t`, those of the minimal form. Unknowns that it does not know (a
    /// reaction to an input whose rate nobody gives) are 0.
    ///
    /// # Errors
    /// As [`Model::initialise`].
    pub fn initialise(&mut self, t: f64) -> Result<(Vec<f64>, Vec<f64>), StartError> {
        let x = self.reference.initialise(t)?;
        self.start_at(t, &x).map_err(StartError::Failure)
    }

    /// Unknowns and their rates where the minimal form has the state `x` at the start of a run.
    ///
    /// # Errors
    /// As [`Model::rates`](System::rates).
    pub fn start_at(&mut self, t: f64, x: &[f64]) -> Result<(Vec<f64>, Vec<f64>), Failure> {
        self.form.restart();
        if let Some(failure) = self.form.broken() {
            return Err(failure);
        }
        (self.begun, self.scaled, self.entered) = (false, false, None);
        self.x.copy_from_slice(x);
        self.reference.handle_event(t, &mut self.x)?;
        self.follow_mode(t)?;
        let n = self.unknowns();
        let (mut y, mut yp) = (vec![0.0; n], vec![0.0; n]);
        if self.map.twin {
            self.form.run.conserved.copy_from_slice(&self.reference.run.conserved);
        }
        self.guess(t)?;
        self.take_over(t, &mut y)?;
        self.form.handle_event(t, &mut y)?;
        if self.form.take_discretes(&self.reference) {
            self.take_over(t, &mut y)?;
            self.form.handle_event(t, &mut y)?;
        }
        self.take_rates(t, &y, &mut yp)?;
        self.settle(t, &mut y, &mut yp)?;
        self.begun = true;
        Ok((y, yp))
    }

    /// Unknowns and their rates where the minimal form has the state `x`, in the present mode of both.
    ///
    /// # Errors
    /// As [`Model::rates`](System::rates).
    pub fn at(&mut self, t: f64, x: &[f64], y: &mut [f64], yp: &mut [f64]) -> Result<(), Failure> {
        self.x.copy_from_slice(x);
        // The state may be far from the last one.
        for model in [&mut self.reference, &mut self.form] {
            model.leave_solutions();
        }
        self.guess(t)?;
        self.take_over(t, y)?;
        self.take_rates(t, y, yp)?;
        self.settle(t, y, yp)
    }
}
