//! Which routines of a model run as machine code, and from when on.

use super::Model;
use super::compiled::Mode;
use super::inputs::InputSignal;
use super::recorded::Recorded;
use super::system::What;
use crate::bytecode::{InTurns, Routine};
use crate::machine::{Generator, MachineCode, MachineError};
use std::sync::Arc;

/// How a model is run. Results are the same to the last bit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Execution {
    /// Machine code of each routine that is evaluated so often that making it is repaid, bytecode of the others.
    #[default]
    Auto,
    /// Bytecode.
    Bytecode,
    /// Machine code of whatever is evaluated.
    Machine,
}

/// How often a run evaluates, at least, where that is known before.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Expected {
    /// Evaluations of the rates.
    pub rates: f64,
    /// Steps: evaluations of what is recorded, of event indicators, and of derivatives by implicit methods.
    pub steps: f64,
}

/// What of a model is evaluated by a routine of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Evaluated {
    /// Rates, or residuals.
    Rates,
    /// Rates and their derivatives along a direction.
    Directions,
    /// What is recorded.
    Recorded,
    /// Event indicators.
    Indicators,
    /// All derivatives of the rates at once.
    Jacobian,
    /// How positions that constraints determine move, at the end of each step.
    Motion,
    /// What is divided by where other variables could be independent, at the end of each step.
    Pivots,
    /// Solutions of nonlinear laws, at the end of each step.
    Solutions,
}

/// How a routine was run, and why.
#[derive(Debug, Clone, PartialEq)]
pub struct Executed {
    /// What it evaluates.
    pub what: Evaluated,
    /// Its instructions; those of solve blocks, which the bytecode's solvers run in any case, count once.
    pub instructions: usize,
    /// Evaluations after which machine code of it has repaid the time to make it, by the count of instructions.
    pub repaid_after: u64,
    /// Evaluations by bytecode, before there was machine code if it was made.
    pub by_bytecode: u64,
    /// Whether machine code of it was made.
    pub machine: bool,
    /// Whether equal cells were gone through together.
    pub in_turns: bool,
    /// Why.
    pub reason: Reason,
}

/// Why a routine was run as it was.
#[derive(Debug, Clone, PartialEq)]
pub enum Reason {
    /// It was asked for.
    Asked,
    /// So many evaluations were to come.
    Expected(f64),
    /// Evaluations were counted.
    Counted,
    /// There is no machine code.
    Refused(MachineError),
}

/// A routine: its machine code, where there is any, and when it is made.
#[derive(Debug, Clone, Default)]
struct Tier {
    code: Option<Arc<MachineCode>>,
    /// The routine in turns, where equal cells make most of it; and whether that was looked at.
    in_turns: Option<Arc<InTurns>>,
    looked: bool,
    /// Evaluations by bytecode after which it is made; `None`: never.
    after: Option<u64>,
    by_bytecode: u64,
    refused: Option<MachineError>,
}

/// All routines. Copies of a model share what was made before.
#[derive(Debug, Clone, Default)]
pub(super) struct Tiers {
    of: [Tier; 8],
    execution: Execution,
    expected: Option<Expected>,
}

const ALL: [Evaluated; 8] = [
    Evaluated::Rates,
    Evaluated::Directions,
    Evaluated::Recorded,
    Evaluated::Indicators,
    Evaluated::Jacobian,
    Evaluated::Motion,
    Evaluated::Pivots,
    Evaluated::Solutions,
];

impl Evaluated {
    /// What it is called.
    pub fn name(self) -> &'static str {
        match self {
            Evaluated::Rates => "rates",
            Evaluated::Directions => "directional derivatives",
            Evaluated::Recorded => "recorded",
            Evaluated::Indicators => "event indicators",
            Evaluated::Jacobian => "jacobian",
            Evaluated::Motion => "rates of positions",
            Evaluated::Pivots => "pivots",
            Evaluated::Solutions => "solutions",
        }
    }

    /// What a routine evaluates; none has machine code of recorded values with their derivatives.
    fn by(what: What, along: bool) -> Option<Evaluated> {
        match (what, along) {
            (What::Rates, false) => Some(Evaluated::Rates),
            (What::Rates, true) => Some(Evaluated::Directions),
            (What::Recorded, false) => Some(Evaluated::Recorded),
            (What::Indicators, false) => Some(Evaluated::Indicators),
            (What::Jacobian, false) => Some(Evaluated::Jacobian),
            (What::Motion, false) => Some(Evaluated::Motion),
            (What::Pivots, false) => Some(Evaluated::Pivots),
            (What::Solutions, false) => Some(Evaluated::Solutions),
            (_, true) => None,
        }
    }

    fn routine<'m>(self, mode: &'m Mode, recorded: &'m Recorded) -> Option<&'m Routine> {
        match self {
            Evaluated::Rates | Evaluated::Directions => Some(&mode.rates),
            Evaluated::Recorded => Some(&recorded.routine),
            Evaluated::Indicators => (!mode.switching.is_empty()).then_some(&mode.indicators),
            Evaluated::Jacobian => mode.jacobian.as_ref().map(|jacobian| &jacobian.routine),
            Evaluated::Motion => mode.motion.as_ref().map(|motion| &motion.rates),
            Evaluated::Pivots => mode.exchanges.as_ref().map(|ratios| &ratios.pivots),
            Evaluated::Solutions => mode.solutions.as_ref(),
        }
    }
}

impl Tiers {
    /// The routine in turns, if equal cells make most of it.
    pub fn in_turns(&self, what: What, along: bool) -> Option<&Arc<InTurns>> {
        self.of[Evaluated::by(what, along)? as usize].in_turns.as_ref()
    }

    /// The machine code of a routine, if there is any.
    pub fn code(&self, what: What, along: bool) -> Option<&Arc<MachineCode>> {
        self.of[Evaluated::by(what, along)? as usize].code.as_ref()
    }
}

/// Routines of fewer instructions stay at hand.
const LONG: usize = 4096;
/// Evaluations after which it is looked for equal cells, which takes as long as some of them.
const LOOKED_AT_AFTER: u64 = 24;

/// Instructions of a routine; blocks that the solver solves count by their inner code.
fn instructions(routine: &Routine) -> usize {
    routine.code.len() + routine.solves.iter().map(|solve| solve.code.len()).sum::<usize>()
}

/// Evaluations after which machine code is repaid, by what making it takes and what it saves: nanoseconds to begin with and
/// for each instruction, about what docs/TESTING.md has. One core makes it; more of them are a gain that is not counted on,
/// so that the choice is the same everywhere.
fn repaid_after(what: Evaluated, instructions: usize) -> u64 {
    const BEGIN: f64 = 3e5;
    const MAKE: f64 = 6e3;
    const SAVE: f64 = 1.0;
    // Certain to be repaid: twice over.
    const SURELY: f64 = 2.0;
    // A derivative takes some three operations for each one.
    let own = if what == Evaluated::Directions { 3.0 } else { 1.0 };
    let instructions = own * instructions.max(1) as f64;
    (SURELY * (BEGIN + MAKE * instructions) / (SAVE * instructions)).ceil() as u64
}

impl Model {
    /// How it runs from now on, given what is known of how often it will be evaluated. Machine code is made where an
    /// evaluation asks for it first, of nothing else.
    ///
    /// # Errors
    /// There is no machine code for this processor or in this build, and it is asked for.
    pub fn execute(&mut self, execution: Execution, expected: Option<Expected>) -> Result<(), MachineError> {
        if execution == Execution::Machine {
            Generator::new()?;
        }
        self.tiers = Tiers { execution, expected, ..Tiers::default() };
        for what in ALL {
            let Some(routine) = what.routine(&self.code, &self.recorded) else { continue };
            let repaid = repaid_after(what, instructions(routine));
            self.tiers.of[what as usize].after = match (execution, expected) {
                (Execution::Bytecode, _) => None,
                (Execution::Machine, _) => Some(0),
                (Execution::Auto, None) => Some(repaid),
                (Execution::Auto, Some(expected)) => (expected.of(what) > repaid as f64).then_some(0),
            };
        }
        Ok(())
    }

    /// How the routines that were evaluated have been run.
    pub fn executed(&self) -> Vec<Executed> {
        let executed = |what: Evaluated| {
            let (tier, routine) = (&self.tiers.of[what as usize], what.routine(&self.code, &self.recorded)?);
            let ran = tier.code.is_some() || tier.by_bytecode > 0;
            let instructions = instructions(routine);
            let reason = match (&tier.refused, self.tiers.execution, self.tiers.expected) {
                (Some(why), ..) => Reason::Refused(why.clone()),
                (None, Execution::Bytecode | Execution::Machine, _) => Reason::Asked,
                (None, Execution::Auto, Some(expected)) => Reason::Expected(expected.of(what)),
                (None, Execution::Auto, None) => Reason::Counted,
            };
            ran.then(|| Executed {
                what,
                instructions,
                repaid_after: repaid_after(what, instructions),
                by_bytecode: tier.by_bytecode,
                machine: tier.code.is_some(),
                in_turns: tier.in_turns.is_some(),
                reason,
            })
        };
        ALL.into_iter().filter_map(executed).collect()
    }

    /// Counts an evaluation by bytecode; makes machine code first where it is time to.
    pub(super) fn before_evaluation(&mut self, what: What, along: bool) {
        let Some(what) = Evaluated::by(what, along) else { return };
        let tier = &mut self.tiers.of[what as usize];
        if tier.code.is_some() {
            return;
        }
        // Where it is known how often a run evaluates, nothing is made in the middle of it.
        let is_due = match self.tiers.expected {
            Some(expected) => expected.of(what) > LOOKED_AT_AFTER as f64,
            None => tier.by_bytecode >= LOOKED_AT_AFTER,
        };
        if !tier.looked && is_due && self.tiers.execution != Execution::Machine {
            self.look_for_turns(what);
        }
        let tier = &mut self.tiers.of[what as usize];
        if tier.in_turns.is_some() {
            tier.by_bytecode += 1;
            return;
        }
        if tier.after.is_none_or(|after| tier.by_bytecode < after) {
            tier.by_bytecode += 1;
            return;
        }
        if let Err(why) = self.make(what) {
            let tier = &mut self.tiers.of[what as usize];
            (tier.refused, tier.after) = (Some(why), None);
            tier.by_bytecode += 1;
        }
    }

    /// Looks whether equal cells make most of a long routine, and goes through them together from now on.
    fn look_for_turns(&mut self, what: Evaluated) {
        let tier = &mut self.tiers.of[what as usize];
        tier.looked = true;
        let Some(routine) = what.routine(&self.code, &self.recorded).filter(|r| r.code.len() >= LONG) else { return };
        let made = || InTurns::of(&self.code.program, &self.code.layout, routine).map(Arc::new);
        let in_turns = match what {
            Evaluated::Rates | Evaluated::Directions => self.code.rates_in_turns.get_or_init(made).clone(),
            _ => made(),
        };
        if let Some(in_turns) = &in_turns {
            self.frame.reserve_in_turns(in_turns);
        }
        tier.in_turns = in_turns;
    }

    /// Rates by machine code from where time and states are given; false if that does not do.
    #[inline]
    pub(super) fn rates_directly(&mut self, t: f64, x: &[f64], dx: &mut [f64]) -> bool {
        if self.tiers.of[Evaluated::Rates as usize].code.is_none() {
            return false;
        }
        if !self.run.delays_and_samples.is_empty() || self.inputs().iter().any(InputSignal::moves) {
            self.place_time(t);
        }
        let Model { tiers, frame, code, run, .. } = self;
        if !run.conserved.is_empty() {
            frame.r[code.layout.conserved as usize..][..run.conserved.len()].copy_from_slice(&run.conserved);
        }
        let Some(code) = &tiers.of[Evaluated::Rates as usize].code else { return false };
        code.rates(frame, t, x, dx) && dx.iter().all(|rate| rate.is_finite())
    }

    /// Rates alone as machine code, as [`compile_machine`](Model::compile_machine) makes them.
    ///
    /// # Errors
    /// As there.
    pub fn compile_rates(&mut self) -> Result<(), MachineError> {
        self.make(Evaluated::Rates)
    }

    /// From now on rates, recorded values, event indicators and the Jacobian run as machine code: the same bits, sooner. Made
    /// at once; [`execute`](Model::execute) makes what is needed where it is.
    ///
    /// # Errors
    /// There is no machine code for this processor or in this build; the model runs on as it did.
    pub fn compile_machine(&mut self) -> Result<(), MachineError> {
        let all = ALL.into_iter().filter(|what| *what != Evaluated::Directions);
        all.filter(|what| what.routine(&self.code, &self.recorded).is_some())
            .collect::<Vec<_>>()
            .into_iter()
            .try_for_each(|what| self.make(what))
    }

    /// The same for derivatives along directions, which stiff methods ask for.
    ///
    /// # Errors
    /// As [`compile_machine`](Model::compile_machine).
    pub fn compile_directional(&mut self) -> Result<(), MachineError> {
        self.make(Evaluated::Directions)
    }

    /// Whether rates run as machine code.
    pub fn runs_machine_code(&self) -> bool {
        self.tiers.of[Evaluated::Rates as usize].code.is_some()
    }

    /// Something else is recorded; what ran as machine code does so again.
    pub(super) fn recorded_anew(&mut self) {
        let tier = &mut self.tiers.of[Evaluated::Recorded as usize];
        (tier.in_turns, tier.looked) = (None, false);
        if tier.code.take().is_some() {
            // Without it the bytecode goes on recording.
            let _ = self.make(Evaluated::Recorded);
        }
    }

    fn make(&mut self, what: Evaluated) -> Result<(), MachineError> {
        let Some(routine) = what.routine(&self.code, &self.recorded) else { return Ok(()) };
        let along = what == Evaluated::Directions;
        let made = Generator::new()?.compile(&self.code.program, &self.code.layout, routine, along)?;
        self.tiers.of[what as usize].code = Some(Arc::new(made));
        Ok(())
    }
}

impl Expected {
    fn of(&self, what: Evaluated) -> f64 {
        if what == Evaluated::Rates { self.rates } else { self.steps }
    }
}
