//! All functions of a model, and the source that they make.

mod beside;
mod checks;
mod events;
mod modes;
mod relations;
mod routines;
mod shapes;
mod source;
mod step_order;
mod words;
mod work;

use std::rc::Rc;

use halfarrow_compiler::bond_graph::HeldKind;
use halfarrow_compiler::program::{
    Block, BlockId, Code, ConditionId, EventTrigger, Program, Ratios, Routine, Step, Trigger,
};

use super::Export;
use super::blocks::{elimination_room, full_room};
use super::cost::{MOST_EVENTS, OperationCount};
use super::function::Function;
use super::patterns::Patterns;
use super::start::{self, Group, Pass};
use super::write::{Moving, Place, Shape, TimeRate, Writer};
use crate::EmitError;
pub(super) use beside::Beside;
use beside::BesideRoutines;
pub(super) use events::EventTables;
pub(super) use modes::{ModeTables, Modes};
pub(super) use routines::Ahead;
use routines::{Routines, newton_of};
use shapes::{ALONG, CLOCK, PLAIN, PREAMBLE, block_functions, of_parameters};
pub(super) use step_order::StepOrder;

/// Points that all delays together may keep.
const MOST_POINTS: f64 = 1e6;

/// The functions of a model.
pub(super) struct Plan<'a> {
    pub export: &'a Export<'a>,
    pub program: &'a Program,
    pub name: String,
    /// Functions in C.
    functions: Vec<Function>,
    /// Conditions of the state, in order.
    pub switches: Vec<ConditionId>,
    /// Conditions of time, in order.
    clocks: Vec<ConditionId>,
    /// Delays: held signals, and the room of each.
    pub delays: Vec<(usize, usize)>,
    /// Samples: held signals.
    pub samples: Vec<usize>,
    /// Discrete variables and impulses: held signals.
    pub discretes: Vec<usize>,
    /// What happens at events.
    pub events: EventTables,
    /// Where this mode ends, and what is carried to the next one, if the model has several.
    pub mode: Option<ModeTables<'a>>,
    /// Variables that could be independent in place of others, where code keeps those that are: it stops where these do not tell
    /// the motion.
    pub watched: Option<Ratios>,
    /// Whether runs begin in this mode.
    first: bool,
    /// Newton blocks in use.
    pub newton: Vec<BlockId>,
    /// Where the matrices of solve blocks have entries.
    pub patterns: Rc<Patterns>,
    reads: Vec<usize>,
    /// Whether the code of each reads conditions.
    conditional: Vec<bool>,
    /// Unknowns of those that rates read.
    pub(super) solutions: usize,
    rates_blocks: Vec<BlockId>,
    shown_blocks: Vec<BlockId>,
    /// Newton blocks of positions whose motion is followed.
    pub(super) motion_blocks: Vec<BlockId>,
    /// How many of them, the first ones, rates read.
    motion_of_rates: usize,
    /// Whether something that is looked at may jump with an input.
    inputs_jump: bool,
    /// What is found where a step ends, if that saves much.
    pub ahead: Option<Ahead>,
    /// What rates beside a state have in common, if that saves much.
    pub beside: Option<Beside>,
    /// What the sizes of arrays in the model are.
    pub sizes: Sizes,
    passes: Vec<Pass>,
    pub groups: Vec<Group>,
    /// How the matrix of an implicit step is eliminated, if that is sparse.
    pub step_order: Option<StepOrder>,
    works: Works,
}

/// Sizes of arrays.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Sizes {
    pub derived: usize,
    /// Of those computed from parameters that are read in double precision, and of what crosses in it.
    pub exact: usize,
    pub wide: usize,
    pub crossing: usize,
    pub memory: usize,
    pub work: usize,
    pub order: usize,
    pub factors: usize,
    pub factors_order: usize,
    pub factored: usize,
    /// First places in directions of inputs, held signals, conserved constants, states and positions, and the number of
    /// places.
    pub directions: [usize; 6],
    pub indicators: usize,
}

/// What functions cost.
#[derive(Debug, Clone, Default)]
struct Works {
    rates: OperationCount,
    solutions: OperationCount,
    observe: OperationCount,
    switching: OperationCount,
    /// What is found where a step ends, and rates of that.
    ahead: OperationCount,
    sources: OperationCount,
    returns: OperationCount,
    directional: OperationCount,
    clock: OperationCount,
    /// A round of what happens at events.
    round: OperationCount,
    /// A look whether the independent variables tell the motion.
    watched: OperationCount,
}

impl<'a> Plan<'a> {
    /// The plan of a program; of a mode of set-valued laws with what all modes have in common. Runs begin in the first one.
    pub fn new(
        export: &'a Export<'a>,
        name: &str,
        modes: Option<&'a Modes>,
        first: bool,
    ) -> Result<Plan<'a>, EmitError> {
        let program = export.program;
        let mode = modes.map(|modes| ModeTables {
            modes,
            bounds: program.bounds().unwrap_or_default(),
            ratios: program.ratios().filter(|_| modes.exchanged() > 0),
        });
        let of = |wanted: fn(EventTrigger) -> bool| -> Vec<ConditionId> {
            program.conditions.iter().filter(|(_, c)| wanted(c.trigger)).map(|(id, _)| id).collect()
        };
        let mut plan = Plan {
            export,
            program,
            name: name.to_string(),
            functions: Vec::new(),
            switches: of(|trigger| trigger == EventTrigger::State),
            clocks: of(|trigger| matches!(trigger, EventTrigger::LinearTime | EventTrigger::CurvedTime)),
            delays: delays(export)?,
            samples: held(program, |kind| kind == HeldKind::Sample),
            discretes: held(program, HeldKind::is_discrete),
            events: EventTables::of(program),
            watched: if mode.is_some() { None } else { program.ratios() },
            mode,
            first,
            newton: Vec::new(),
            patterns: Rc::new(Patterns::of(program)),
            reads: Vec::new(),
            conditional: Vec::new(),
            solutions: 0,
            rates_blocks: Vec::new(),
            shown_blocks: Vec::new(),
            motion_blocks: Vec::new(),
            motion_of_rates: 0,
            inputs_jump: program.inputs_jump(),
            ahead: None,
            beside: None,
            sizes: Sizes::default(),
            passes: Vec::new(),
            groups: Vec::new(),
            step_order: None,
            works: Works::default(),
        };
        if first {
            (plan.passes, plan.groups) = start::plan(program);
        }
        if export.method.is_implicit() {
            plan.step_order = StepOrder::of(&plan.columns());
        }
        plan.write_functions();
        Ok(plan)
    }

    fn write_functions(&mut self) {
        let program = self.program;
        let routines = Routines::of(self).with_ahead(self);
        let blocks = routines.newton();
        let used: Vec<BlockId> = blocks.keys().copied().collect();
        let patterns = Rc::clone(&self.patterns);
        let mut writer = Writer::new(self.export, &self.name, &used, &patterns);
        let numbers = |r: &Routine| newton_of(&r.code).map(|s| s.block).collect::<Vec<_>>();
        self.rates_blocks = numbers(&routines.rates);
        self.shown_blocks = numbers(&routines.observe);
        let [of_rates, of_shown] = [&self.rates_blocks, &self.shown_blocks].map(|among| program.motion_blocks(among));
        self.motion_of_rates = of_rates.len();
        self.motion_blocks = [of_rates, of_shown].concat();
        self.shown_blocks.retain(|block| !self.rates_blocks.contains(block));

        let mut functions = vec![
            of_parameters(&writer, "ha_defaults_code", program.inputs.iter().map(|i| i.default), false),
            of_parameters(&writer, "ha_times_code", program.held.iter().map(|h| h.time), true),
            of_parameters(&writer, "ha_asked_code", program.start.iter().map(|c| c.asked), false),
            of_parameters(&writer, "ha_discretes_code", self.discretes.iter().map(|&i| program.held[i].source), false),
            of_parameters(&writer, "ha_periods_code", self.events.periods(program), true),
        ];
        let plain = |writer: &mut Writer, name: &str, routine: &Routine| {
            let n = routine.code.outputs.len();
            writer.function(name, PLAIN, (&routine.code, &[]), (&Place::first("out", n), &[]))
        };
        match Beside::of(self, &routines.rates) {
            None => functions.extend(plain(&mut writer, "ha_rates_code", &routines.rates)),
            Some((beside, BesideRoutines { common, parts })) => {
                functions.extend(plain(&mut writer, "ha_common_code", &common));
                writer.givens.found = beside.places().collect();
                for (part, routine) in parts.iter().enumerate() {
                    functions.extend(plain(&mut writer, &beside::code_of(part), routine));
                }
                writer.givens.found.clear();
                self.beside = Some(beside);
            }
        }
        functions.extend(plain(&mut writer, "ha_observe_code", &routines.observe));
        functions.extend(plain(&mut writer, "ha_solutions_code", &routines.solutions));
        functions.extend(plain(&mut writer, "ha_motion_code", &routines.motion));
        functions.extend(plain(&mut writer, "ha_shown_motion_code", &routines.shown_motion));
        functions.extend(plain(&mut writer, "ha_switching_code", &routines.switching));
        if let Some((ahead, [found, rest])) = &routines.ahead {
            functions.extend(plain(&mut writer, "ha_ahead_code", found));
            writer.givens.found = ahead.places().collect();
            functions.extend(plain(&mut writer, "ha_rates_ahead_code", rest));
            writer.givens.found.clear();
            self.ahead = Some(ahead.clone());
        }
        functions.extend(plain(&mut writer, "ha_domains_code", &routines.domains));
        functions.extend(plain(&mut writer, "ha_becomes_code", &routines.becomes));
        for (i, clause) in routines.clauses.iter().enumerate() {
            functions.extend(plain(&mut writer, &events::code_of(i), clause));
        }
        functions.extend(plain(&mut writer, "ha_stored_code", &routines.stored));
        if let Some(mode) = &self.mode {
            functions.extend(plain(&mut writer, "ha_values_code", &routines.carried));
            if mode.has_laws() {
                functions.extend(plain(&mut writer, "ha_compared_code", &routines.compared));
            }
        }
        if self.ratios().is_some() {
            functions.extend(plain(&mut writer, "ha_pivots_code", &routines.pivots));
        }
        functions.extend(plain(&mut writer, "ha_relations_code", &routines.relations));
        functions.extend(self.domain_checks(&writer));
        functions.extend(self.assumption_checks(&writer));

        let along = |writer: &mut Writer, name: &str, shape: Shape, routine: &Routine, moving: Moving| {
            let n = routine.code.outputs.len();
            let shape = Shape { along: Some(moving), ..shape };
            writer.function(name, shape, (&routine.code, &[]), (&Place::first("out", n), &Place::first("rates", n)))
        };
        let runs = Moving { time: Some(TimeRate::One), ..Moving::default() };
        functions.extend(along(&mut writer, "ha_clock_code", CLOCK, &routines.clock, runs));
        let run =
            Moving { time: Some(TimeRate::OfDirection), inputs: true, held: true, states: true, ..Moving::default() };
        functions.extend(along(&mut writer, "ha_sources_along", ALONG, &routines.sources, run));
        functions.extend(along(&mut writer, "ha_returns_along", ALONG, &routines.returns, run));
        if self.mode.as_ref().is_some_and(ModeTables::has_laws) {
            functions.extend(along(&mut writer, "ha_margins_along", ALONG, &routines.margins, run));
        }
        let directional = Moving { inputs: self.export.derivatives, states: true, ..Moving::default() };
        functions.extend(along(&mut writer, "ha_rates_along", ALONG, &routines.rates, directional));
        if self.export.method.takes_time_derivative() {
            let time_derivative = Moving { time: Some(TimeRate::OfDirection), held: true, ..Moving::default() };
            functions.extend(along(&mut writer, "ha_rates_by_time", ALONG, &routines.rates, time_derivative));
        }
        if self.export.derivatives {
            functions.extend(along(&mut writer, "ha_observe_along", ALONG, &routines.observe, directional));
        }
        let begin = Moving { conserved: true, states: true, ..Moving::default() };
        for (name, routine) in &routines.starts {
            functions.extend(along(&mut writer, name, ALONG, routine, begin));
        }
        if self.mode.is_some() {
            functions.extend(along(&mut writer, "ha_open_along", ALONG, &routines.open, begin));
        }
        if self.ratios().is_some() {
            functions.extend(along(&mut writer, "ha_ratios_along", ALONG, &routines.ratios, begin));
        }
        functions.extend(along(&mut writer, "ha_impulses_along", ALONG, &routines.impulses, begin));
        functions.extend(along(&mut writer, "ha_positions_along", ALONG, &routines.positions, begin));

        self.reads = blocks.values().map(|(outer, _)| outer.len()).collect();
        let reads_conditions =
            |code: &Code| code.steps.iter().any(|s| matches!(s, Step::Op { op, .. } if op.is_held()));
        self.conditional = blocks.values().map(|(_, code)| reads_conditions(code)).collect();
        self.solutions = routines.solutions.code.outputs.len();
        for (i, (block, (_, code))) in blocks.iter().enumerate() {
            let pattern = program.blocks[*block].matrix().values.pattern();
            self.functions.extend(block_functions(&mut writer, i, pattern, code));
        }

        // Last, once it is known what is read in double precision.
        let preamble = Code { outputs: Vec::new(), ..routines.preamble.code.clone() };
        let preamble = writer.function("ha_preamble_code", PREAMBLE, (&preamble, &routines.kept()), (&[], &[]));
        let work = |routine: &Routine| OperationCount::of(program, &routine.code);
        self.works = Works {
            rates: work(&routines.rates),
            observe: work(&routines.observe),
            solutions: work(&routines.solutions),
            switching: work(&routines.switching),
            ahead: routines
                .ahead
                .as_ref()
                .map_or_else(OperationCount::default, |(_, [found, rest])| work(found) + work(rest)),
            sources: work(&routines.sources),
            returns: work(&routines.returns).along(),
            directional: work(&routines.rates).along(),
            clock: work(&routines.clock).along(),
            round: self.round(&routines),
            watched: self.watching(&routines),
        };
        self.newton = used.clone();
        self.find_sizes(&writer);
        self.functions.extend(preamble.into_iter().chain(functions));
    }

    fn find_sizes(&mut self, writer: &Writer) {
        let program = self.program;
        let lu = |b: &Block| elimination_room(b, self.export.real);
        let order = |b: &Block| b.size() + usize::from(b.matrix().factors.is_some());
        let linear: Vec<&Block> = program.blocks.values().filter(|b| matches!(b, Block::Linear { .. })).collect();
        let newton: Vec<(&Block, usize)> =
            self.newton.iter().zip(&self.reads).map(|(b, &reads)| (&program.blocks[*b], reads)).collect();
        let entries = |b: &Block| b.matrix().values.pattern().len();
        let work = |&(b, reads): &(&Block, usize)| 19 * b.size() + reads + 2 * entries(b) + full_room(b) + lu(b);
        let all = linear.iter().copied().chain(newton.iter().map(|b| b.0));
        self.sizes = Sizes {
            derived: writer.givens.derived(),
            exact: writer.givens.exact(),
            wide: writer.wide_crossing,
            crossing: writer.crossing,
            memory: self.memory_sizes().sum(),
            work: newton.iter().map(work).chain(linear.iter().map(|b| lu(b))).max().unwrap_or(0),
            order: all.map(order).max().unwrap_or(0),
            factors: writer.factored.size,
            factors_order: writer.factored.orders,
            factored: writer.factored.places.len(),
            directions: writer.givens.directions(),
            indicators: self.switches.iter().map(|&c| program.conditions[c].kind.switches()).sum(),
        };
    }

    /// How fast variables move against those that are independent: of a mode, or of the equations that code keeps.
    pub fn ratios(&self) -> Option<&Ratios> {
        self.mode.as_ref().and_then(|mode| mode.ratios.as_ref()).or(self.watched.as_ref())
    }

    /// Whether a position may be passed at which the independent variables do not tell the motion.
    pub fn may_pass(&self) -> bool {
        self.watched.is_some() || self.mode.as_ref().is_some_and(|mode| mode.modes.exchanged() > 0)
    }

    /// The functions of the equations.
    pub fn functions(&self) -> &[Function] {
        &self.functions
    }

    /// What it takes to look whether the independent variables tell the motion.
    fn watching(&self, routines: &Routines) -> OperationCount {
        let work = |routine: &Routine| OperationCount::of(self.program, &routine.code);
        let Some(ratios) = &self.watched else { return OperationCount::default() };
        let (n, m) = (ratios.independent.len() as u64, ratios.dependent.len() as u64);
        let mut all = work(&routines.pivots) + work(&routines.ratios).along() * n;
        all.operations += n * n * n + 4 * n * m * (n + 1) + 4 * ratios.pivots.len() as u64;
        all.divisions += n + n * m;
        all
    }

    /// What a round of what happens at events takes at most.
    fn round(&self, routines: &Routines) -> OperationCount {
        let work = |routine: &Routine| OperationCount::of(self.program, &routine.code);
        let mut round = routines.clauses.iter().fold(work(&routines.becomes), |sum, clause| sum + work(clause));
        let unknowns = self.events.unknowns.len().max(1) as u64;
        round = round + work(&routines.stored) + work(&routines.impulses).along() * (51 * unknowns);
        let positions = self.events.positions.iter().map(|reads| reads.len() as u64 + 2).sum();
        let size = (self.events.equations() * self.events.columns() * self.events.columns()) as u64;
        round.operations += 50 * 2 * size;
        round + work(&routines.positions).along() * positions
    }

    /// Whether crossings are located within steps, since something happens there.
    pub fn locates(&self) -> bool {
        let happens = !self.events.conditional.is_empty() || self.program.has_moved_edges();
        happens && !self.switches.is_empty()
    }

    /// Whether a start may differ from the exported one.
    pub fn solves_start(&self) -> bool {
        self.first && !(self.program.start.is_empty() && self.program.guesses.is_empty())
    }

    /// Whether the rates have a function for their derivatives.
    pub fn has_directional_derivative(&self) -> bool {
        let method = self.export.method;
        self.export.derivatives || method.takes_derivatives() || (method.keeps_steps() && !self.compares_rates())
    }

    /// Whether steps compare rates in place of exact derivatives.
    pub fn compares_rates(&self) -> bool {
        self.export.method.keeps_steps() && self.program.is_long()
    }

    /// The number of steps in which the columns of a new Jacobian are found, as by `halfarrow_sim::fixed_step`; none where one finds all.
    pub fn steps_to_find(&self) -> Option<usize> {
        let groups = if self.export.method.keeps_steps() { self.column_groups().len() } else { 0 };
        (groups > 3).then(|| groups.div_ceil(3).min(16))
    }
}

fn held(program: &Program, wanted: impl Fn(HeldKind) -> bool) -> Vec<usize> {
    program.held.iter().enumerate().filter(|(_, h)| wanted(h.kind)).map(|(i, _)| i).collect()
}

fn delays(export: &Export) -> Result<Vec<(usize, usize)>, EmitError> {
    // Crossings that are located add points, each on both of its sides.
    let conditional = export.program.clauses.iter().any(|c| matches!(c.trigger, Trigger::Becomes(_)));
    let events = if conditional { 2.0 * MOST_EVENTS as f64 } else { 64.0 };
    let room = |i: usize| {
        let time = export.start.times.get(i).copied().unwrap_or(0.0);
        let points = 2.0 * (time / export.step).ceil() + events;
        match points <= MOST_POINTS {
            true => Ok((i, points as usize)),
            false => Err(EmitError::Delay(export.program.held[i].name.clone(), points)),
        }
    };
    held(export.program, |kind| kind == HeldKind::Delay).into_iter().map(room).collect()
}
