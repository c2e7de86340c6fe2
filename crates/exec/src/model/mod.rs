//! A program with everything it needs to run.

mod clock;
mod equilibrium;
mod errors;
mod events;
mod explain;
mod history;
mod implicit;
mod inputs;
mod jacobian;
mod jumps;
mod leaf;
mod linear;
mod loads;
mod machine;
mod minimum_norm;
mod operations;
mod start;
mod system;
mod wide;

pub use equilibrium::Equilibrium;
pub use errors::{EquilibriumError, InputError, ParameterError, RecordError, StartConflict, StartError, StartValue};
pub use implicit::ImplicitModel;
pub use linear::Linearised;
pub use operations::Operations;
pub use wide::WideModel;

use crate::bytecode::{Abreast, Frame, Hold, Trouble};
use clock::Clock;
use halfarrow_compiler::bond_graph::HeldKind;
use halfarrow_compiler::program::{
    Assumption, BlockId, Cause, ConditionId, Entry, Layout, Program, Reads, Routine, Value, first_of,
};
use halfarrow_sim::{Failure, Leap, Sparsity};
use history::{Delay, Sample};
use inputs::Signal;
use jacobian::Slopes;
use jumps::Kept;
use machine::Codes;
use std::sync::Arc;

/// A model that runs: a program, the values of its parameters, what is connected to its inputs, and its memory.
///
/// [`initialise`](Model::initialise) gives the state to start from; after it the model is a
/// [`System`](halfarrow_sim::System) to integrate.
#[derive(Debug, Clone)]
pub struct Model {
    program: Program,
    layout: Layout,
    preamble: Routine,
    rates: Routine,
    observe: Routine,
    switching: Routine,
    sources: Routine,
    frame: Frame,
    /// Newton blocks that are solved together: of the rates, and of what is recorded.
    abreast: (Option<Arc<Abreast>>, Option<Arc<Abreast>>),
    codes: Codes,
    recorded: Vec<usize>,
    /// Conditions of the state that are offered as switching functions.
    switches: Vec<ConditionId>,
    clock: Clock,
    inputs: Vec<Signal>,
    held: Vec<Held>,
    sparsity: Sparsity,
    /// Derivatives of the rates, if they are computed at once.
    slopes: Option<Slopes>,
    scales: Vec<f64>,
    /// Whether somebody asks for the scales: explicit methods of fixed step do not.
    scaled: bool,
    /// When the sides of switching functions were taken last.
    sides_taken: Option<f64>,
    /// Values of the conserved constants.
    conserved: Vec<f64>,
    /// States that jump with a source, if there are any.
    kept: Option<Kept>,
    dx: Vec<f64>,
    /// A state beside another one.
    beside: Vec<f64>,
    /// Newton blocks that recorded values need and no rate does.
    shown_blocks: Vec<BlockId>,
    /// Whether the run has begun: conditions are held.
    begun: bool,
    /// When the last jump was crossed, in s.
    crossed: f64,
    /// Computes what is assumed of parameters, each value with its scale.
    assumed: Routine,
    /// The number of the first assumption that the parameters break.
    broken: Option<usize>,
    /// The time of the rates that stand in the registers, those of the states that stand there, if nothing has been done
    /// since.
    rated: Option<f64>,
}

/// What a held signal remembers.
#[derive(Debug, Clone)]
enum Held {
    Delay(Delay),
    Sample(Sample),
}

impl Model {
    /// Makes a program ready to run, with all parameters at their defaults, recording what is recorded by default.
    ///
    /// # Errors
    /// Equations of parameters alone that have no solution.
    pub fn new(program: Program) -> Result<Model, Failure> {
        Model::made_of(program, None)
    }

    /// The same, with all derivatives of the rates by the states at once: [`System::jacobian`](halfarrow_sim::System)
    /// has them. Without it they come from directions, a group of columns at a time, as [`Model::new`] leaves it.
    ///
    /// # Errors
    /// As [`Model::new`].
    pub fn with_jacobian(program: Program) -> Result<Model, Failure> {
        let differentiated = program.jacobian();
        Model::made_of(differentiated.program, Some(differentiated.entries))
    }

    fn made_of(program: Program, entries: Option<Vec<Entry>>) -> Result<Model, Failure> {
        let derivatives = entries.iter().flatten().map(|e| e.value);
        let layout = program.layout_with(&derivatives.chain(program.relations.values()).collect::<Vec<_>>());
        let rates: Vec<Value> = program.states.iter().map(|s| s.rate).collect();
        let rates = program.watched_routine(&layout, &rates);
        let preamble = program.preamble(&layout);
        let sources: Vec<Value> = program.held.iter().map(|h| h.source).collect();
        let sources = program.routine(&layout, &sources);
        let of = |wanted: Cause| program.conditions.iter().filter(move |(_, c)| c.cause == wanted);
        let switches: Vec<ConditionId> = of(Cause::State).map(|(id, _)| id).collect();
        let operands: Vec<Value> = of(Cause::State).map(|(_, c)| c.operand).collect();
        let switching = program.routine(&layout, &operands);
        let clock = Clock::new(&program, &layout);
        let mut frame = Frame::new(&program, &layout, layout.size);
        let assumed: Vec<Value> = program.assumptions.iter().flat_map(|a| [a.value, a.scale]).collect();
        let assumed = program.routine(&layout, &assumed);
        let sparsity = sparsity_of(&program);
        let slopes = entries.map(|entries| Slopes::new(&program, &layout, &sparsity, &entries));
        let kept = Kept::of(&program, &layout);
        let more = slopes.as_ref().map(|s| &s.routine).into_iter().chain(kept.as_ref().map(Kept::routine));
        for routine in [&rates, &preamble, &assumed, &sources, &switching, clock.routine()].into_iter().chain(more) {
            frame.reserve(routine);
        }
        let n = program.states.len();
        let mut model = Model {
            sparsity,
            slopes,
            inputs: program.inputs.iter().map(|_| Signal::default()).collect(),
            held: Vec::new(),
            scales: vec![0.0; n],
            scaled: true,
            sides_taken: None,
            conserved: vec![0.0; program.conserved.len()],
            kept,
            dx: vec![0.0; n],
            beside: vec![0.0; n],
            shown_blocks: Vec::new(),
            begun: false,
            crossed: f64::NEG_INFINITY,
            rated: None,
            assumed,
            broken: None,
            observe: Routine::default(),
            recorded: Vec::new(),
            layout,
            preamble,
            rates,
            switching,
            sources,
            frame,
            abreast: (None, None),
            codes: Codes::default(),
            switches,
            clock,
            program,
        };
        let defaults = model.program.observed.iter().enumerate().filter(|(_, o)| o.default && o.value.is_ok());
        model.recorded = defaults.map(|(i, _)| i).collect();
        model.abreast.0 = model.abreast_of(&model.rates);
        model.choose_recorded();
        model.parameters_changed()?;
        Ok(model)
    }

    /// The program.
    pub fn program(&self) -> &Program {
        &self.program
    }

    /// Sets a parameter, in SI units; parameters given by it follow. The run starts anew.
    ///
    /// Where the value breaks what the equations rest on ([`broken`](Model::broken)), no run starts until other
    /// parameters mend it.
    ///
    /// # Errors
    /// There is no such parameter, it is a constant, the value is not finite, or nothing can be solved with it.
    pub fn set_parameter(&mut self, name: &str, value: f64) -> Result<(), ParameterError> {
        self.place_parameter(name, value)?;
        self.parameters_changed().map_err(ParameterError::Unsolvable)
    }

    /// Sets several parameters at once: what the values on the way would break counts for nothing.
    ///
    /// # Errors
    /// As [`set_parameter`](Model::set_parameter).
    pub fn set_parameters<'a>(
        &mut self,
        values: impl IntoIterator<Item = (&'a str, f64)>,
    ) -> Result<(), ParameterError> {
        for (name, value) in values {
            self.place_parameter(name, value)?;
        }
        self.parameters_changed().map_err(ParameterError::Unsolvable)
    }

    fn place_parameter(&mut self, name: &str, value: f64) -> Result<(), ParameterError> {
        let found = self.program.parameters.iter().position(|p| p.name == name);
        let index = found.ok_or_else(|| ParameterError::Unknown(name.to_string()))?;
        if self.program.parameters[index].constant {
            return Err(ParameterError::Constant(name.to_string()));
        }
        if !value.is_finite() {
            return Err(ParameterError::NotFinite(name.to_string()));
        }
        self.frame.set[index] = Some(value);
        Ok(())
    }

    /// What the equations rest on and the parameters break, if they do: then these equations are not those of the model.
    pub fn broken(&self) -> Option<Failure> {
        let assumption = &self.program.assumptions[self.broken?];
        Some(Failure::Structure { assumed: assumption.text.clone() })
    }

    /// The present value of a parameter or constant, in SI units.
    pub fn parameter(&self, name: &str) -> Option<f64> {
        let index = self.program.parameters.iter().position(|p| p.name == name)?;
        Some(self.frame.r[self.layout.parameters as usize + index])
    }

    /// Values of the conserved constants, as the last start has fixed them.
    pub fn conserved(&self) -> &[f64] {
        &self.conserved
    }

    /// What a value of parameters alone comes to: a delay, the default of an input.
    pub fn constant(&self, value: Value) -> Option<f64> {
        let register = *self.layout.registers.get(&value)?;
        (self.program.values.reads(value) == Reads::PARAMETERS).then(|| self.frame.r[register as usize])
    }

    /// All values that follow from parameters alone, as they stand in the equations.
    pub fn derived(&self) -> &[f64] {
        &self.frame.r[self.program.parameters.len()..self.layout.time as usize]
    }

    /// Connects a table of values over time to an input: straight lines between the points, the first value before
    /// them, the last one after them. A time given twice is a jump.
    ///
    /// # Errors
    /// There is no such input, or the points are no function of time.
    pub fn connect(&mut self, input: &str, times: &[f64], values: &[f64]) -> Result<(), InputError> {
        let found = self.program.inputs.iter().position(|i| i.name == input);
        let index = found.ok_or_else(|| InputError::Unknown(input.to_string()))?;
        self.inputs[index] = Signal::table(times, values).map_err(|why| InputError::Points(input.to_string(), why))?;
        self.restart();
        Ok(())
    }

    /// Sets an input to which nothing is connected, by its number in the program, in SI units: from now on it has this
    /// value. For runs in real time, between steps; takes no memory.
    pub fn set_input(&mut self, input: usize, value: f64) {
        self.inputs[input].set_default(value);
        self.place_constant_inputs();
    }

    /// Chooses what is recorded, in this order.
    ///
    /// # Errors
    /// The first name that is unknown or has no value.
    pub fn record(&mut self, names: &[&str]) -> Result<(), RecordError> {
        let mut chosen = Vec::with_capacity(names.len());
        for &name in names {
            let found = self.program.observed.iter().position(|o| o.name == name);
            let index = found.ok_or_else(|| RecordError::Unknown(name.to_string()))?;
            if let Err(why) = &self.program.observed[index].value {
                return Err(RecordError::Unavailable(name.to_string(), why.clone()));
            }
            chosen.push(index);
        }
        self.recorded = chosen;
        self.choose_recorded();
        Ok(())
    }

    /// Everything that has a value, in the order of the program.
    pub fn record_all(&mut self) {
        let available = self.program.observed.iter().enumerate().filter(|(_, o)| o.value.is_ok());
        self.recorded = available.map(|(i, _)| i).collect();
        self.choose_recorded();
    }

    /// Indices into [`Program::observed`] of what is recorded.
    pub fn recorded(&self) -> &[usize] {
        &self.recorded
    }

    /// Bounds the evaluations of each block of nonlinear equations, every time it is solved while running: what needs more
    /// stops the run and says so. For real time; without it the bound is 2000. The start of a run and its jumps may
    /// take more.
    pub fn bound_iterations(&mut self, most: usize) {
        self.frame.solvers.iter_mut().for_each(|s| s.newton.bound(most.max(1)));
    }

    /// Unknowns of nonlinear laws that nothing determined somewhere on the run, such as the voltage of a node between
    /// diodes that block: there each stayed where it was.
    pub fn floating(&self) -> Vec<String> {
        let blocks = self.program.blocks.iter().zip(&self.frame.solvers);
        let named = blocks.flat_map(|((_, block), solver)| {
            let ever = solver.newton.floating.ever.iter().enumerate().filter(|(_, ever)| **ever);
            ever.map(|(i, _)| block.unknown(i).to_string())
        });
        named.collect()
    }

    /// Forgets a run: the next crossing is its start. Parameters, inputs and conserved constants stay.
    pub fn restart(&mut self) {
        self.begun = false;
        self.crossed = f64::NEG_INFINITY;
        self.sides_taken = None;
        self.follow();
        self.inputs.iter_mut().for_each(Signal::release);
        self.place_constant_inputs();
        self.frame.solvers.iter_mut().for_each(|s| s.newton.forget());
        let time = |i: usize| self.layout.registers.get(&self.program.held[i].time).map(|&r| self.frame.r[r as usize]);
        let held = self.program.held.iter().enumerate().map(|(i, h)| {
            let time = time(i).unwrap_or(f64::NAN);
            match h.kind {
                HeldKind::Delay => Held::Delay(Delay::new(time)),
                HeldKind::Sample => Held::Sample(Sample::new(time)),
            }
        });
        self.held = held.collect();
    }

    fn follow(&mut self) {
        self.rated = None;
        self.frame.conditions.clock = Hold::Follow;
        self.frame.conditions.state = Hold::Follow;
    }

    fn parameters_changed(&mut self) -> Result<(), Failure> {
        self.frame.parameters_changed();
        self.frame.solvers.iter_mut().for_each(|s| s.newton.forget());
        let run = self.frame.run(&self.preamble);
        run.map_err(|trouble| self.failure(f64::NAN, trouble))?;
        self.broken = self.first_broken().map_err(|trouble| self.failure(f64::NAN, trouble))?;
        if let Some(failure) = self.violated_always() {
            return Err(failure);
        }
        for (i, input) in self.program.inputs.iter().enumerate() {
            if let Some(&register) = self.layout.registers.get(&input.default) {
                self.inputs[i].set_default(self.frame.r[register as usize]);
            }
        }
        self.restart();
        Ok(())
    }

    /// The number of the first assumption that does not hold.
    fn first_broken(&mut self) -> Result<Option<usize>, Trouble> {
        if self.program.assumptions.is_empty() {
            return Ok(None);
        }
        self.frame.run(&self.assumed)?;
        let of = |i: usize| self.frame.r[self.assumed.outputs[i] as usize];
        let broken = |(i, a): &(usize, &Assumption)| !a.holds_of(of(2 * i), of(2 * i + 1));
        Ok(self.program.assumptions.iter().enumerate().find(broken).map(|(i, _)| i))
    }

    fn abreast_of(&self, routine: &Routine) -> Option<Arc<Abreast>> {
        Abreast::of(&self.program, routine).map(Arc::new)
    }

    fn choose_recorded(&mut self) {
        let value = |&i: &usize| self.program.observed[i].value.clone().ok();
        let wanted: Vec<Value> = self.recorded.iter().filter_map(value).collect();
        self.observe = self.program.watched_routine(&self.layout, &wanted);
        self.frame.reserve(&self.observe);
        self.abreast.1 = self.abreast_of(&self.observe);
        for abreast in [&self.abreast.0, &self.abreast.1].into_iter().flatten() {
            self.frame.reserve_abreast(abreast);
        }
        self.recorded_changed();
        let of_rates = |block: BlockId| self.rates.solves.iter().any(|s| s.block == block);
        let newton = self.observe.solves.iter().filter(|s| !s.guess.is_empty()).map(|s| s.block);
        self.shown_blocks = newton.filter(|&block| !of_rates(block)).collect();
    }

    /// Puts time, inputs, held signals, constants and states where routines read them.
    fn place(&mut self, t: f64, x: &[f64]) {
        self.place_time(t);
        let (states, conserved) = (self.layout.states as usize, self.layout.conserved as usize);
        self.frame.r[states..states + x.len()].copy_from_slice(x);
        self.frame.r[conserved..conserved + self.conserved.len()].copy_from_slice(&self.conserved);
    }

    /// Inputs to which nothing is connected stand in their registers all the time.
    fn place_constant_inputs(&mut self) {
        for (i, signal) in self.inputs.iter().enumerate().filter(|(_, signal)| !signal.moves()) {
            self.frame.r[self.layout.inputs as usize + i] = signal.at(0.0).0;
        }
    }

    fn place_time(&mut self, t: f64) {
        let Model { frame, layout, inputs, held, crossed, rated, .. } = self;
        *rated = None;
        frame.r[layout.time as usize] = t;
        for (i, signal) in inputs.iter().enumerate() {
            frame.r[layout.inputs as usize + i] = signal.at(t).0;
        }
        for (i, held) in held.iter().enumerate() {
            frame.r[layout.held as usize + i] = match held {
                Held::Delay(delay) => delay.at(t, *crossed).0,
                Held::Sample(sample) => sample.value,
            };
        }
    }

    /// Sets the direction of derivatives: nothing moves.
    fn still(&mut self) {
        let fixed = self.layout.time as usize..self.layout.size as usize;
        self.frame.d[fixed].fill(0.0);
    }

    /// What stopped a routine, for the modeller.
    fn failure(&self, time: f64, trouble: Trouble) -> Failure {
        let block = |block: u32| &self.program.blocks[BlockId(block)];
        let what = |b: u32| first_of(block(b).elements());
        let unknown = |b: u32, unknown: usize| block(b).unknown(unknown).to_string();
        match trouble {
            Trouble::Vanished { watch } => {
                let watch = &self.program.watches[watch as usize];
                Failure::Vanished { time, what: first_of(&watch.elements), divisor: watch.divisor.clone() }
            }
            Trouble::Singular { block } => Failure::Singular { time, what: what(block) },
            Trouble::NoConvergence { block, iterations, residual } => {
                Failure::NoConvergence { time, what: what(block), iterations, residual }
            }
            Trouble::NoSolution { block, nearest, residual } => {
                let name = unknown(block, 0);
                let reason = format!(
                    "no value of {name} solves its equation; {name} = {nearest:.3} comes nearest and leaves {residual:.3e}"
                );
                Failure::OutOfDomain { time, what: what(block), reason }
            }
            Trouble::Ended { block, unknown: index, from, to } => {
                let leap = Leap { unknown: unknown(block, index), from, to };
                Failure::Branch { time, what: what(block), leap: Box::new(leap) }
            }
            Trouble::Bound { block, evaluations } => Failure::Bound { time, what: what(block), most: evaluations },
        }
    }
}

fn sparsity_of(program: &Program) -> Sparsity {
    let mut columns = vec![Vec::new(); program.states.len()];
    for (row, reads) in program.dependence.iter().enumerate() {
        reads.iter().for_each(|&column| columns[column as usize].push(row));
    }
    Sparsity::from_columns(columns)
}
