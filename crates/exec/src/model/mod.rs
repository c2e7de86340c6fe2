//! A model that runs: what never changes of it ([`Compiled`]), what is set ([`Setup`]), what a run remembers ([`Memory`]), and
//! the registers on which all of it is computed.

mod clause_memory;
mod clauses;
mod clock;
mod compiled;
mod equilibrium;
mod errors;
mod events;
mod exchanges;
mod explain;
mod history;
mod implicit;
mod impulse_elimination;
mod impulses;
mod inputs;
mod jacobian;
mod jumps;
mod linear;
mod machine;
mod margins;
mod memory;
mod minimum_norm;
mod modes;
mod operations;
mod positions;
mod projection;
mod recorded;
mod sensitivity;
mod setup;
mod shares;
mod start;
mod system;
mod wide;

pub use compiled::{Alternatives, Compiled, ModeId};
pub use equilibrium::Equilibrium;
pub use errors::{EquilibriumError, InputError, ParameterError, RecordError, StartConflict, StartError, StartValue};
pub use implicit::{ImplicitMemory, ImplicitModel};
pub use linear::Linearised;
pub use machine::{Evaluated, Executed, Execution, Expected, Reason};
pub use memory::Memory;
pub use modes::ModeProgram;
pub use operations::Operations;
pub use projection::Drifted;
pub use sensitivity::{Quantity, SampleWeights, Tape, Taped, Varied};
pub use setup::Setup;
pub use wide::WideModel;

use crate::bytecode::{Frame, Hold, SolveError};
use clauses::EventWork;
use compiled::Mode;
use exchanges::Ratios;
use halfarrow_compiler::program::{Assumption, BlockId, Program, Reads, Value, first_of};
use halfarrow_sim::{Failure, Leap};
use inputs::InputSignal;
use machine::Tiers;
use memory::{DelayOrSample, Remembered};
use modes::Extents;
use projection::{Kept, Projection};
use recorded::Recorded;
use shares::Shares;
use std::sync::Arc;

/// A model that runs: code, the values of its parameters, what is connected to its inputs, and what its run remembers.
///
/// [`initialise`](Model::initialise) gives the state to start from; after it the model is a
/// [`System`](halfarrow_sim::System) with [`Events`](halfarrow_sim::Events) to integrate. Copies share the code.
#[derive(Debug, Clone)]
pub struct Model {
    compiled: Arc<Compiled>,
    /// The code of the present mode.
    code: Arc<Mode>,
    recorded: Arc<Recorded>,
    tiers: Tiers,
    setup: Setup,
    run: Remembered,
    frame: Frame,
    /// What is computed at events.
    events: EventWork,
    /// How positions are put back onto the relations between them, in runs that do so.
    projection: Option<Projection>,
    /// Whether a run notes what its positions keep.
    tells_drift: bool,
    /// How reactions that are not unique are shared where they are recorded, if anybody asks for it.
    shares: Option<Box<Shares>>,
    /// How all that the run carries moves with some quantities, if anybody asks for it.
    variation: Option<Box<sensitivity::Variation>>,
    /// Whether another form of the model tells what happens at events.
    led: bool,
    /// Whether somebody asks for the scales: explicit methods of fixed step do not.
    scaled: bool,
    dx: Vec<f64>,
    /// A state beside another one.
    beside: Vec<f64>,
    /// Whether the mode has changed at the last event.
    switched: bool,
    /// The number of the first assumption that the parameters break.
    broken: Option<usize>,
    /// The time of the rates that stand in the registers, those of the states that stand there, if nothing has been done
    /// since.
    rated: Option<f64>,
}

impl Model {
    /// Makes a program ready to run, with all parameters at their defaults, recording what is recorded by default.
    ///
    /// # Errors
    /// Equations of parameters alone that have no solution.
    pub fn new(program: Program) -> Result<Model, Failure> {
        Model::of(Arc::new(Compiled::new(program)))
    }

    /// The same, with all derivatives of the rates by the states at once: [`System::jacobian`](halfarrow_sim::System)
    /// has them. Without it they come from directions, a group of columns at a time, as [`Model::new`] leaves it.
    ///
    /// # Errors
    /// As [`Model::new`].
    pub fn with_jacobian(program: Program) -> Result<Model, Failure> {
        Model::of(Arc::new(Compiled::with_jacobian(program)))
    }

    /// One more that runs this code, with all parameters at their defaults, recording what is recorded by default.
    ///
    /// # Errors
    /// As [`Model::new`].
    pub fn of(compiled: Arc<Compiled>) -> Result<Model, Failure> {
        let code = compiled.first().clone();
        let mut frame = Frame::new(&code.program, &code.layout, code.layout.size);
        code.routines().for_each(|routine| frame.reserve(routine));
        let n = code.program.states.len();
        let run = Remembered {
            mode: ModeId::default(),
            begun: false,
            crossed: f64::NEG_INFINITY,
            signs_taken: None,
            clock_event: None,
            longest_step: f64::INFINITY,
            conserved: vec![0.0; code.program.conserved.len()],
            positions: vec![0.0; code.program.positions.len()],
            first: None,
            scales: vec![0.0; n],
            delays_and_samples: Vec::new(),
            clauses: Vec::new(),
            extents: Extents::default(),
            returns: Vec::with_capacity(code.clauses.conditional.len()),
            floors: vec![0.0; code.program.conditions.len()],
            pivots: Vec::with_capacity(code.exchanges.as_ref().map_or(0, Ratios::divisors)),
            steepest: None,
            determinants: Vec::new(),
            kept: Kept::default(),
            pieces: vec![None; code.program.inputs.len()],
        };
        let mut model = Model {
            recorded: Arc::new(Recorded::by_default(&code)),
            tiers: Tiers::default(),
            setup: Setup::new(&compiled),
            run,
            frame,
            events: EventWork::of(&code),
            projection: None,
            tells_drift: false,
            shares: None,
            variation: None,
            led: false,
            scaled: true,
            dx: vec![0.0; n],
            beside: vec![0.0; n],
            switched: false,
            broken: None,
            rated: None,
            compiled,
            code,
        };
        model.reserve_recorded();
        model.parameters_changed()?;
        Ok(model)
    }

    /// What never changes of it, to be shared with others.
    pub fn compiled(&self) -> &Arc<Compiled> {
        &self.compiled
    }

    /// The program.
    pub fn program(&self) -> &Program {
        &self.code.program
    }

    /// Parameters and inputs, as they are set.
    pub fn setup(&self) -> &Setup {
        &self.setup
    }

    /// Takes over parameters and inputs. The run starts anew.
    ///
    /// # Errors
    /// Nothing can be solved with them.
    pub fn set_up(&mut self, setup: &Setup) -> Result<(), Failure> {
        self.setup.clone_from(setup);
        self.parameters_changed()
    }

    /// Sets a parameter, in SI units; parameters given by it follow. The run starts anew.
    ///
    /// Where the value breaks what the equations rest on ([`broken`](Model::broken)), no run starts until other
    /// parameters mend it.
    ///
    /// # Errors
    /// There is no such parameter, it is a constant, the value is not finite, or nothing can be solved with it.
    pub fn set_parameter(&mut self, name: &str, value: f64) -> Result<(), ParameterError> {
        self.setup.set_parameter(&self.compiled, name, value)?;
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
            self.setup.set_parameter(&self.compiled, name, value)?;
        }
        self.parameters_changed().map_err(ParameterError::Unsolvable)
    }

    /// What the equations rest on and the parameters break, if they do: then these equations are not those of the model.
    pub fn broken(&self) -> Option<Failure> {
        let assumption = &self.code.program.assumptions[self.broken?];
        Some(Failure::Structure { assumed: assumption.text.clone() })
    }

    /// The present value of a parameter or constant, in SI units.
    pub fn parameter(&self, name: &str) -> Option<f64> {
        let index = self.code.program.parameters.iter().position(|p| p.name == name)?;
        Some(self.frame.r[self.code.layout.parameters as usize + index])
    }

    /// Values of the conserved constants, as the last start has fixed them.
    pub fn conserved(&self) -> &[f64] {
        &self.run.conserved
    }

    /// Values of the positions that iterations determine, as the last start has found them.
    pub fn positions(&self) -> &[f64] {
        &self.run.positions
    }

    /// The unknowns of solve blocks as they were found last, block by block.
    pub fn solutions(&self) -> Vec<Vec<f64>> {
        self.frame.solvers.iter().map(|solver| solver.found().to_vec()).collect()
    }

    /// What a value of parameters alone comes to: a delay, the default of an input.
    pub fn constant(&self, value: Value) -> Option<f64> {
        let register = self.code.layout.registers.get(value)?;
        (self.code.program.values.reads(value) == Reads::PARAMETERS).then(|| self.frame.r[register as usize])
    }

    /// All values that follow from parameters alone, as they stand in the equations.
    pub fn derived(&self) -> &[f64] {
        &self.frame.r[self.code.program.parameters.len()..self.code.layout.time as usize]
    }

    /// Connects a table of values over time to an input: straight lines between the points, the first value before
    /// them, the last one after them. A time given twice is a jump.
    ///
    /// # Errors
    /// There is no such input, or the points are no function of time.
    pub fn connect(&mut self, input: &str, times: &[f64], values: &[f64]) -> Result<(), InputError> {
        self.setup.connect(&self.compiled, input, times, values)?;
        self.restart();
        Ok(())
    }

    /// Sets an input to which nothing is connected, by its number in the program, in SI units: from now on it has this
    /// value. For runs in real time, between steps; takes no memory.
    pub fn set_input(&mut self, input: usize, value: f64) {
        self.setup.inputs[input].set_default(value);
        self.place_constant_inputs();
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
        let blocks = self.code.program.blocks.iter().zip(&self.frame.solvers);
        let named = blocks.flat_map(|((_, block), solver)| {
            let ever = solver.newton.floating.ever.iter().enumerate().filter(|(_, ever)| **ever);
            ever.map(|(i, _)| block.unknown(i).to_string())
        });
        named.collect()
    }

    /// Forgets a run: the next event is its start. Parameters, inputs and conserved constants stay.
    pub fn restart(&mut self) {
        if self.run.mode != ModeId::default() {
            self.enter(ModeId::default()).expect("it has run with these parameters");
        }
        self.run.kept = Kept::default();
        self.run.begun = false;
        self.run.crossed = f64::NEG_INFINITY;
        self.run.signs_taken = None;
        self.follow();
        self.run.pieces.fill(None);
        self.place_constant_inputs();
        self.forget_solutions();
        self.run.delays_and_samples = self.empty_delays_and_samples();
        self.run.clauses = self.clauses_at_rest();
        self.run.extents = Extents::default();
        self.run.returns.clear();
        self.run.floors.fill(0.0);
    }

    fn follow(&mut self) {
        self.rated = None;
        self.frame.conditions.clock = Hold::Follow;
        self.frame.conditions.state = Hold::Follow;
    }

    fn parameters_changed(&mut self) -> Result<(), Failure> {
        if self.run.mode != ModeId::default() {
            self.enter(ModeId::default())?;
        }
        self.variation = None;
        self.frame.set.clone_from(&self.setup.parameters);
        self.frame.parameters_changed();
        self.forget_solutions();
        let run = self.frame.run(&self.code.preamble);
        run.map_err(|error| self.failure(f64::NAN, error))?;
        self.broken = self.first_broken().map_err(|error| self.failure(f64::NAN, error))?;
        if let Some(failure) = self.violated_always() {
            return Err(failure);
        }
        let inputs = &mut self.setup.inputs;
        for (signal, input) in inputs.iter_mut().zip(&self.code.program.inputs) {
            if let Some(register) = self.code.layout.registers.get(input.default) {
                signal.set_default(self.frame.r[register as usize]);
            }
        }
        self.restart();
        Ok(())
    }

    /// The number of the first assumption that does not hold.
    fn first_broken(&mut self) -> Result<Option<usize>, SolveError> {
        if self.code.program.assumptions.is_empty() {
            return Ok(None);
        }
        self.frame.run(&self.code.assumed)?;
        let of = |i: usize| self.frame.r[self.code.assumed.outputs[i] as usize];
        let broken = |(i, a): &(usize, &Assumption)| !a.holds_of(of(2 * i), of(2 * i + 1));
        Ok(self.code.program.assumptions.iter().enumerate().find(broken).map(|(i, _)| i))
    }

    /// Puts time, inputs, held signals, constants and states where routines read them.
    fn place(&mut self, t: f64, x: &[f64]) {
        self.place_time(t);
        let layout = &self.code.layout;
        let (states, conserved) = (layout.states as usize, layout.conserved as usize);
        self.frame.r[states..states + x.len()].copy_from_slice(x);
        self.frame.r[conserved..conserved + self.run.conserved.len()].copy_from_slice(&self.run.conserved);
    }

    /// What is connected to the inputs.
    fn inputs(&self) -> &[InputSignal] {
        &self.setup.inputs
    }

    /// Inputs to which nothing is connected stand in their registers all the time.
    fn place_constant_inputs(&mut self) {
        let first = self.code.layout.inputs as usize;
        let inputs = self.setup.inputs.iter().enumerate();
        inputs.filter(|(_, signal)| !signal.moves()).for_each(|(i, s)| self.frame.r[first + i] = s.at(0.0, None).0);
    }

    fn place_time(&mut self, t: f64) {
        self.rated = None;
        let Model { frame, code, setup, run, .. } = self;
        let layout = &code.layout;
        frame.r[layout.time as usize] = t;
        for (i, (signal, piece)) in setup.inputs.iter().zip(&run.pieces).enumerate() {
            frame.r[layout.inputs as usize + i] = signal.at(t, *piece).0;
        }
        for (i, held) in run.delays_and_samples.iter().enumerate() {
            frame.r[layout.held as usize + i] = match held {
                DelayOrSample::Delay(delay) => delay.at(t, run.crossed).0,
                DelayOrSample::Sample(sample) => sample.value,
                DelayOrSample::Discrete(value) => *value,
            };
        }
    }

    /// Sets the direction of derivatives: nothing moves.
    fn still(&mut self) {
        let fixed = self.code.layout.time as usize..self.code.layout.size as usize;
        self.frame.d[fixed].fill(0.0);
    }

    /// What stopped a routine, for the modeller.
    fn failure(&self, time: f64, error: SolveError) -> Failure {
        let block = |block: u32| &self.code.program.blocks[BlockId(block)];
        let what = |b: u32| first_of(block(b).elements());
        let unknown = |b: u32, unknown: usize| block(b).unknown(unknown).to_string();
        match error {
            SolveError::Vanished { guard } => {
                let guard = &self.code.program.pivot_guards[guard as usize];
                Failure::Vanished { time, what: first_of(&guard.elements), divisor: guard.divisor.clone() }
            }
            SolveError::Singular { block } => Failure::Singular { time, what: what(block) },
            SolveError::NoConvergence { block, iterations, residual } => {
                Failure::NoConvergence { time, what: what(block), iterations, residual }
            }
            SolveError::NoSolution { block, nearest, residual } => {
                let name = unknown(block, 0);
                let reason = format!(
                    "no value of {name} solves its equation; {name} = {nearest:.3} comes nearest and leaves {residual:.3e}"
                );
                Failure::OutOfDomain { time, what: what(block), reason }
            }
            SolveError::Ended { block, unknown: index, from, to } => {
                let leap = Leap { unknown: unknown(block, index), from, to };
                Failure::Branch { time, what: what(block), leap: Box::new(leap) }
            }
            SolveError::OffMotion { block } => Failure::OffMotion { time, what: what(block) },
            SolveError::Bound { block, evaluations } => Failure::Bound { time, what: what(block), most: evaluations },
        }
    }
}
