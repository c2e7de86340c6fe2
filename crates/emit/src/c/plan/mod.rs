//! All functions of a model, and the source that they make.

mod routines;
mod words;

use std::rc::Rc;

use halfarrow_compiler::algebra::math;
use halfarrow_compiler::bond_graph::HeldKind;
use halfarrow_compiler::program;
use halfarrow_compiler::program::{
    Assumption, Block, BlockId, Code, ConditionId, ConditionKind, DomainKind, EventTrigger, Holds, Program, Reads,
    Routine, Value,
};

use super::blocks::{elimination_room, full_room};
use super::cost::{Cost, OperationCount};
use super::flags::Flags;
use super::fragment::{Fragment, assembled};
use super::function::{self, Function, Gives, Parameter};
use super::patterns::Patterns;
use super::start::{self, Group, Pass};
use super::template::Filling;
use super::terms;
use super::write::{Moving, Shape, Time, TimeRate, Writer};
use super::written::{Line, Needed, Written, needed, written};
use super::{Export, messages};
use crate::{EmitError, Method, Real};
use routines::{Routines, newton_of};

/// A sum of floats below this fraction of its terms is rounding of the operations that lead to it.
const ROUNDING_OF_FLOATS: f64 = 1e-5;

/// The search of the solutions of nonlinear blocks.
const NEWTON: &str = concat!(
    include_str!("../runtime/newton/workspace.c"),
    include_str!("../runtime/newton/correction.c"),
    include_str!("../runtime/newton/floating.c"),
    include_str!("../runtime/newton/damped.c"),
    include_str!("../runtime/newton/continuation.c"),
    include_str!("../runtime/newton/search.c"),
);

/// Points that all delays together may keep.
const MOST_POINTS: f64 = 1e6;

const PLAIN: Shape = Shape {
    parameters: &[Parameter::Model, Parameter::Wide("t"), Parameter::Reals("x"), Parameter::RealsOut("out")],
    void: false,
    time: Time::Given,
    along: None,
    wide: false,
};
const ALONG: Shape = Shape {
    parameters: &[
        Parameter::Model,
        Parameter::Wide("t"),
        Parameter::Reals("x"),
        Parameter::Reals("e"),
        Parameter::RealsOut("out"),
        Parameter::RealsOut("rates"),
    ],
    ..PLAIN
};
/// What moves with time alone.
const CLOCK: Shape = Shape {
    parameters: &[Parameter::Model, Parameter::Wide("t"), Parameter::WideOut("out"), Parameter::WideOut("rates")],
    wide: true,
    ..PLAIN
};
/// What parameters determine.
const PREAMBLE: Shape = Shape { parameters: &[Parameter::Model], time: Time::Always, ..PLAIN };
/// A Newton block: residuals and their Jacobian.
const BLOCK: Shape = Shape {
    parameters: &[
        Parameter::Model,
        Parameter::Reals("o"),
        Parameter::Reals("g"),
        Parameter::RealsOut("right"),
        Parameter::RealsOut("matrix"),
    ],
    void: true,
    ..PLAIN
};
/// Of what its residuals are the sums.
const BLOCK_TERMS: Shape = Shape {
    parameters: &[Parameter::Model, Parameter::Reals("o"), Parameter::Reals("g"), Parameter::RealsOut("terms")],
    ..BLOCK
};
/// Rates of its residuals.
const BLOCK_ALONG: Shape = Shape {
    parameters: &[
        Parameter::Model,
        Parameter::Reals("o"),
        Parameter::Reals("e"),
        Parameter::Reals("g"),
        Parameter::RealsOut("rates"),
    ],
    ..BLOCK
};

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
    /// Newton blocks in use.
    pub newton: Vec<BlockId>,
    /// Where the matrices of solve blocks have entries.
    pub patterns: Rc<Patterns>,
    reads: Vec<usize>,
    rates_blocks: Vec<BlockId>,
    shown_blocks: Vec<BlockId>,
    /// What the sizes of arrays in the model are.
    pub sizes: Sizes,
    passes: Vec<Pass>,
    pub groups: Vec<Group>,
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
    /// First places in directions of inputs, held signals, conserved constants and states, and the number of places.
    pub directions: [usize; 5],
    pub indicators: usize,
}

/// What functions cost.
#[derive(Debug, Clone, Default)]
struct Works {
    rates: OperationCount,
    observe: OperationCount,
    switching: OperationCount,
    sources: OperationCount,
    directional: OperationCount,
    clock: OperationCount,
}

/// Values of parameters alone, from where the preamble leaves them.
fn of_parameters(writer: &Writer, name: &str, values: impl Iterator<Item = Value>, wide: bool) -> Function {
    let out = if wide { Parameter::WideOut("out") } else { Parameter::RealsOut("out") };
    let value = |value| if wide { writer.givens.wide_written(value) } else { writer.givens.written(value) };
    let line = |(i, v)| Line::new(written!("    out[{}] = {};", i, value(v)), 0);
    let mut lines: Vec<Line> = values.enumerate().map(line).collect();
    lines.extend(["    (void)m;", "    (void)out;"].map(|line| Line::new(Written::of(line), 0)));
    Function::new(name.into(), Gives::Nothing, &[Parameter::ConstModel, out], writer.real, &lines)
}

impl<'a> Plan<'a> {
    pub fn new(export: &'a Export<'a>, name: &str) -> Result<Plan<'a>, EmitError> {
        let program = export.program;
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
            samples: held(program, HeldKind::Sample),
            newton: Vec::new(),
            patterns: Rc::new(Patterns::of(program)),
            reads: Vec::new(),
            rates_blocks: Vec::new(),
            shown_blocks: Vec::new(),
            sizes: Sizes::default(),
            passes: Vec::new(),
            groups: Vec::new(),
            works: Works::default(),
        };
        (plan.passes, plan.groups) = start::plan(program);
        plan.write_functions();
        Ok(plan)
    }

    fn write_functions(&mut self) {
        let program = self.program;
        let routines = Routines::of(self);
        let blocks = routines.newton();
        let used: Vec<BlockId> = blocks.keys().copied().collect();
        let patterns = Rc::clone(&self.patterns);
        let mut writer = Writer::new(self.export, &self.name, &used, &patterns);
        let values = |prefix: &str, n: usize| -> Vec<String> { (0..n).map(|i| format!("{prefix}[{i}]")).collect() };
        let numbers = |r: &Routine| newton_of(&r.code).map(|s| s.block).collect::<Vec<_>>();
        self.rates_blocks = numbers(&routines.rates);
        self.shown_blocks = numbers(&routines.observe);
        self.shown_blocks.retain(|block| !self.rates_blocks.contains(block));

        let mut functions = vec![
            of_parameters(&writer, "ha_defaults_code", program.inputs.iter().map(|i| i.default), false),
            of_parameters(&writer, "ha_times_code", program.held.iter().map(|h| h.time), true),
            of_parameters(&writer, "ha_asked_code", program.start.iter().map(|c| c.asked), false),
        ];
        let plain = |writer: &mut Writer, name: &str, routine: &Routine| {
            let n = routine.code.outputs.len();
            writer.function(name, PLAIN, (&routine.code, &[]), (&values("out", n), &[]))
        };
        functions.extend(plain(&mut writer, "ha_rates_code", &routines.rates));
        functions.extend(plain(&mut writer, "ha_observe_code", &routines.observe));
        functions.extend(plain(&mut writer, "ha_switching_code", &routines.switching));
        functions.extend(plain(&mut writer, "ha_domains_code", &routines.domains));
        functions.extend(self.domain_checks(&writer));
        functions.extend(self.assumption_checks(&writer));

        let along = |writer: &mut Writer, name: &str, shape: Shape, routine: &Routine, moving: Moving| {
            let n = routine.code.outputs.len();
            let shape = Shape { along: Some(moving), ..shape };
            writer.function(name, shape, (&routine.code, &[]), (&values("out", n), &values("rates", n)))
        };
        let runs = Moving { time: Some(TimeRate::One), ..Moving::default() };
        functions.extend(along(&mut writer, "ha_clock_code", CLOCK, &routines.clock, runs));
        let run =
            Moving { time: Some(TimeRate::OfDirection), inputs: true, held: true, states: true, ..Moving::default() };
        functions.extend(along(&mut writer, "ha_sources_along", ALONG, &routines.sources, run));
        let directional = Moving { inputs: self.export.derivatives, states: true, ..Moving::default() };
        functions.extend(along(&mut writer, "ha_rates_along", ALONG, &routines.rates, directional));
        if self.export.method.is_linearly_implicit() {
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

        self.reads = blocks.values().map(|(outer, _)| outer.len()).collect();
        for (i, (block, (_, code))) in blocks.iter().enumerate() {
            let block = block_functions(&mut writer, i, program.blocks[*block].size(), code);
            self.functions.extend(block);
        }

        // Last, once it is known what is read in double precision.
        let preamble = Code { outputs: Vec::new(), ..routines.preamble.code.clone() };
        let preamble = writer.function("ha_preamble_code", PREAMBLE, (&preamble, &routines.kept()), (&[], &[]));
        let work = |routine: &Routine| OperationCount::of(program, &routine.code);
        self.works = Works {
            rates: work(&routines.rates),
            observe: work(&routines.observe),
            switching: work(&routines.switching),
            sources: work(&routines.sources),
            directional: work(&routines.rates).along(),
            clock: work(&routines.clock).along(),
        };
        self.newton = used.clone();
        self.find_sizes(&writer);
        self.functions.extend(preamble.into_iter().chain(functions));
    }

    /// Which domain an argument has to lie in, and the check of those that parameters alone decide.
    fn domain_checks(&self, writer: &Writer) -> [Function; 2] {
        let (program, real) = (self.program, writer.real);
        let mut cases = vec![Written::of("    switch (domain) {")];
        let mut checks = Vec::new();
        for (i, domain) in program.domains.iter().enumerate() {
            let holds = match domain.kind {
                DomainKind::Positive => format!("a > {}", real.number(0.0)),
                DomainKind::NotNegative => format!("a >= {}", real.number(0.0)),
                DomainKind::Within(low, high) => format!("{} <= a && a <= {}", real.number(low), real.number(high)),
            };
            cases.push(written!("    case {}:\n        return {};", i, holds));
            if program.values.reads(domain.argument) == Reads::PARAMETERS {
                let a = writer.givens.written(domain.argument);
                let finite = Needed(real.function("ha_finite").into());
                let beyond = written!("{}({}) && !{}({}, {})", finite, a, needed("ha_is_within"), i, a);
                checks.push(writer.fail_if(&beyond, "OUT_OF_DOMAIN", &i, Time::Always));
            }
        }
        cases.push(Written::of("    default:\n        return a == a;\n    }"));
        checks.push(Line::new(written!("    return {}_OK;", writer.capitals), 0));
        let cases: Vec<Line> = cases.into_iter().map(|case| Line::new(case, 0)).collect();
        let argument = [Parameter::Int("domain"), Parameter::Real("a")];
        [
            Function::new("ha_is_within".into(), Gives::Status, &argument, real, &cases),
            Function::new("ha_check_domains".into(), Gives::Status, &[Parameter::Model], real, &checks),
        ]
    }

    /// The number from 1 of the first assumption that parameters break, 0 if there is none.
    fn assumption_checks(&self, writer: &Writer) -> Option<Function> {
        if self.program.assumptions.is_empty() {
            return None;
        }
        let rounding = writer.real.number(match writer.real {
            Real::Double => Assumption::ROUNDING,
            Real::Float => ROUNDING_OF_FLOATS,
        });
        let zero = writer.real.number(0.0);
        let check = |(i, a): (usize, &Assumption)| {
            let (v, s) = (writer.givens.written(a.value), writer.givens.written(a.scale));
            let holds = match a.holds {
                Holds::Zero => format!("{v} <= {rounding} * {s} && -{v} <= {rounding} * {s}"),
                Holds::NotZero => format!("{v} > {rounding} * {s} || -{v} > {rounding} * {s}"),
                Holds::Positive => format!("{v} > {zero}"),
                Holds::NotNegative => format!("{v} >= {zero}"),
            };
            Line::new(written!("    if (!({})) {{\n        return {};\n    }}", holds, i + 1), 0)
        };
        let mut lines: Vec<Line> = self.program.assumptions.iter().enumerate().map(check).collect();
        lines.push(Line::new(Written::of("    return 0;"), 0));
        Some(Function::new("ha_broken".into(), Gives::Status, &[Parameter::ConstModel], writer.real, &lines))
    }

    fn find_sizes(&mut self, writer: &Writer) {
        let program = self.program;
        let lu = |b: &Block| elimination_room(b, self.export.real);
        let order = |b: &Block| b.size() + usize::from(b.matrix().factors.is_some());
        let linear: Vec<&Block> = program.blocks.values().filter(|b| matches!(b, Block::Linear { .. })).collect();
        let newton: Vec<(&Block, usize)> =
            self.newton.iter().zip(&self.reads).map(|(b, &reads)| (&program.blocks[*b], reads)).collect();
        let entries = |b: &Block| b.matrix().values.pattern().len();
        let memory = |&(b, reads): &(&Block, usize)| 2 * (b.size() + reads + entries(b));
        let work = |&(b, reads): &(&Block, usize)| 17 * b.size() + reads + 2 * entries(b) + full_room(b) + lu(b);
        let all = linear.iter().copied().chain(newton.iter().map(|b| b.0));
        self.sizes = Sizes {
            derived: writer.givens.derived(),
            exact: writer.givens.exact(),
            wide: writer.wide_crossing,
            crossing: writer.crossing,
            memory: newton.iter().map(memory).sum(),
            work: newton.iter().map(work).chain(linear.iter().map(|b| lu(b))).max().unwrap_or(0),
            order: all.map(order).max().unwrap_or(0),
            factors: writer.factored.size,
            factors_order: writer.factored.orders,
            factored: writer.factored.places.len(),
            directions: writer.givens.directions(),
            indicators: self.switches.iter().map(|&c| program.conditions[c].kind.switches()).sum(),
        };
    }

    /// The functions of the equations.
    pub fn functions(&self) -> &[Function] {
        &self.functions
    }

    /// With what templates are filled, and with what those that compute in double precision whatever real numbers are.
    fn fillings(&self, obligations: String) -> [Filling<'_>; 2] {
        let mut words = self.words();
        words.insert("OBLIGATION_LINES", Written::of(obligations));
        words.insert("MODEL_TITLE", Written::of(super::header::comment(&self.program.name)));
        let filling = |real| Filling { flags: self.flags(), words: words.clone(), model: &self.name, real };
        [filling(self.export.real), filling(Real::Double)]
    }

    /// The source file; at its head stands what it keeps to.
    pub fn source(&self, obligations: String) -> String {
        let [filling, wide] = self.fillings(obligations);
        let mut all = filling.fragments(include_str!("../runtime/top.c"));
        let mut put = |fragments: Vec<Fragment>| all.extend(fragments);
        put(wide.fragments(math::C_SOURCE));
        put(vec![Fragment::section("small things")]);
        if self.export.real == Real::Float {
            put(wide.fragments(math::C_SOURCE_SINGLE));
            put(wide.fragments(include_str!("../runtime/small.c")));
        }
        put(filling.fragments(include_str!("../runtime/small.c")));
        put(filling.fragments(include_str!("../runtime/helpers.c")));
        if self.sizes.order > 0 {
            put(filling.fragments(include_str!("../runtime/lu.c")));
        }
        if !self.newton.is_empty() {
            put(filling.fragments(NEWTON));
        }
        put(filling.fragments(include_str!("../runtime/tables.c")));
        put(wide.fragments(include_str!("../runtime/conditions.c")));
        put(vec![Fragment::section("the equations")]);
        put(self.functions.iter().cloned().map(Fragment::from).collect());
        if !self.clocks.is_empty() {
            put(wide.fragments(include_str!("../runtime/clock.c")));
        }
        put(filling.fragments(include_str!("../runtime/held.c")));
        put(filling.fragments(include_str!("../runtime/system.c")));
        if self.export.method.is_implicit() {
            put(filling.fragments(include_str!("../runtime/matrix.c")));
        }
        put(filling.fragments(include_str!("../runtime/advance.c")));
        put(filling.fragments(match self.export.method {
            Method::ImplicitMidpoint => include_str!("../runtime/midpoint.c"),
            method if method.is_linearly_implicit() => include_str!("../runtime/rosenbrock.c"),
            _ => include_str!("../runtime/explicit.c"),
        }));
        put(filling.fragments(include_str!("../runtime/step.c")));
        put(filling.fragments(include_str!("../runtime/start.c")));
        if self.solves_start() {
            put(filling.fragments(include_str!("../runtime/start_solve.c")));
        }
        put(filling.fragments(include_str!("../runtime/begin.c")));
        put(messages::messages(self));
        assembled(&all)
    }

    fn kinds(&self) -> impl Iterator<Item = ConditionKind> + '_ {
        self.program.conditions.values().map(|c| c.kind)
    }

    /// What the model has.
    pub fn flags(&self) -> Flags {
        let Plan { export, program: p, .. } = *self;
        let held = !p.held.is_empty();
        let time_derivative = export.method.is_linearly_implicit();
        let always = |d: &program::LawDomain| p.values.reads(d.argument) == Reads::PARAMETERS;
        Flags {
            single: export.real == Real::Float,
            states: !p.states.is_empty(),
            inputs: !p.inputs.is_empty(),
            parameters: !p.parameters.is_empty(),
            outputs: !export.recorded.is_empty(),
            conserved: !p.conserved.is_empty(),
            tables: !p.tables.is_empty(),
            conditions: !p.conditions.is_empty(),
            sign_conditions: self.kinds().any(|k| k == ConditionKind::Sign),
            floor_conditions: self.kinds().any(|k| k == ConditionKind::Floor),
            piece_conditions: self.kinds().any(|k| matches!(k, ConditionKind::Piece(_))),
            clocks: !self.clocks.is_empty(),
            curves: self.clocks.iter().any(|&c| p.conditions[c].trigger == EventTrigger::CurvedTime),
            switches: !self.switches.is_empty(),
            held,
            delays: !self.delays.is_empty(),
            samples: !self.samples.is_empty(),
            only_samples: held && self.delays.is_empty(),
            newton: !self.newton.is_empty(),
            sparse: self.patterns.any_sparse(),
            newton_single: self.newton.iter().any(|&b| p.blocks[b].size() == 1),
            follows: !(self.rates_blocks.is_empty() && self.shown_blocks.is_empty()),
            rates_newton: !self.rates_blocks.is_empty(),
            shown_newton: !self.shown_blocks.is_empty(),
            domains: !p.domains.is_empty(),
            domains_always: p.domains.iter().any(always),
            assumptions: !p.assumptions.is_empty(),
            directional_derivative: self.has_directional_derivative(),
            derivatives: export.derivatives,
            time_derivative,
            time_passes: time_derivative || held,
            linear_constant: self.sizes.factored > 0,
            solves_start: self.solves_start(),
            guesses: !p.guesses.is_empty(),
            start_groups: self.groups.iter().any(|g| g.together),
        }
    }

    /// Whether a start may differ from the exported one.
    pub fn solves_start(&self) -> bool {
        !(self.program.start.is_empty() && self.program.guesses.is_empty())
    }

    /// Whether the rates have a function for their derivatives.
    pub fn has_directional_derivative(&self) -> bool {
        self.export.derivatives || self.export.method.is_implicit()
    }

    /// Rows of the nonzeros of each column of the Jacobian.
    pub fn columns(&self) -> Vec<Vec<usize>> {
        let mut columns = vec![Vec::new(); self.program.states.len()];
        for (row, reads) in self.program.dependence.iter().enumerate() {
            reads.iter().for_each(|&column| columns[column as usize].push(row));
        }
        columns
    }

    /// Columns in groups, no two of a group with a nonzero in the same row; as `halfarrow_sim::Sparsity::groups`.
    fn column_groups(&self) -> Vec<Vec<usize>> {
        let mut groups: Vec<Vec<usize>> = Vec::new();
        let mut taken: Vec<Vec<bool>> = Vec::new();
        for (column, rows) in self.columns().iter().enumerate() {
            let free = taken.iter().position(|taken| rows.iter().all(|&row| !taken[row]));
            let group = free.unwrap_or_else(|| {
                groups.push(Vec::new());
                taken.push(vec![false; self.program.states.len()]);
                groups.len() - 1
            });
            groups[group].push(column);
            rows.iter().for_each(|&row| taken[group][row] = true);
        }
        groups
    }

    /// What a step costs at most.
    pub fn cost(&self) -> Cost {
        let w = &self.works;
        let method = self.export.method;
        let n = self.program.states.len() as u64;
        let mut step = match method {
            Method::ImplicitMidpoint => {
                let groups = self.column_groups().len() as u64;
                let mut one = w.rates.clone() + w.directional.clone() * groups;
                one.operations += n * n * n + 4 * n * n;
                one * 20
            }
            Method::LinearlyImplicitEuler | Method::Rosenbrock => {
                let (groups, stages) = (self.column_groups().len() as u64, method.stages() as u64);
                let mut all = w.rates.clone() * stages + w.directional.clone() * (groups + 1);
                all.operations += n * n * n + 4 * n * n + stages * (2 * n * n + (2 * stages + 4) * n);
                all
            }
            _ => {
                let stages = method.stages() as u64;
                let mut all = w.rates.clone() * stages;
                all.operations += stages * (stages + 3) * n;
                all
            }
        };
        step = step + w.switching.clone() + w.observe.clone();
        let follows = |blocks: &[BlockId], work: &OperationCount| {
            if blocks.is_empty() { OperationCount::default() } else { work.clone() }
        };
        let followed = follows(&self.rates_blocks, &w.rates) + follows(&self.shown_blocks, &w.observe);
        let sources = if self.delays.is_empty() {
            OperationCount::default()
        } else {
            w.rates.clone() + w.sources.clone().along()
        };
        step = step + followed.clone() + sources.clone();
        let held = self.program.held.len() as u64;
        let curves =
            self.clocks.iter().filter(|&&c| self.program.conditions[c].trigger == EventTrigger::CurvedTime).count()
                as u64;
        let looks = 2 + curves * (2 * 4000 + 4 * 2200);
        let clock = if self.clocks.is_empty() { OperationCount::default() } else { w.clock.clone() * looks };
        let sampled = (w.rates.clone() + w.sources.clone().along()) * if held > 0 { held.max(1) } else { 0 };
        let jump = clock + sampled + w.switching.clone() * 2 + sources + followed;
        Cost::new(step, jump, self)
    }
}

/// The functions of a Newton block.
fn block_functions(writer: &mut Writer, number: usize, n: usize, code: &Code) -> Vec<Function> {
    let list = |prefix: &str, n: usize| -> Vec<String> { (0..n).map(|i| format!("{prefix}[{i}]")).collect() };
    let mut values = list("right", n);
    values.extend(list("matrix", code.outputs.len() - n));
    let mut functions = writer.function(&format!("ha_block_{number}"), BLOCK, (code, &[]), (&values, &[]));
    let sums = terms::terms_of(code, n);
    let name = format!("ha_block_{number}_terms");
    functions.extend(writer.function(&name, BLOCK_TERMS, (&sums, &[]), (&list("terms", n), &[])));
    let residuals = Code { outputs: code.outputs[..n].to_vec(), ..code.clone() };
    let residuals = terms::without_the_unread(residuals);
    let along = Shape { along: Some(Moving { outer: true, ..Moving::default() }), ..BLOCK_ALONG };
    let name = format!("ha_block_{number}_along");
    functions.extend(writer.function(&name, along, (&residuals, &[]), (&[], &list("rates", n))));
    functions
}

/// How the functions of a Newton block are declared, before they are there.
fn block_declarations(number: usize, real: Real) -> String {
    let shapes = [("", BLOCK), ("_along", BLOCK_ALONG), ("_terms", BLOCK_TERMS)];
    let declared = shapes.map(|(kind, shape)| {
        let name = format!("ha_block_{number}{kind}");
        function::declaration(&name, Gives::Nothing, shape.parameters, real) + ";\n"
    });
    declared.concat()
}

fn held(program: &Program, kind: HeldKind) -> Vec<usize> {
    program.held.iter().enumerate().filter(|(_, h)| h.kind == kind).map(|(i, _)| i).collect()
}

fn delays(export: &Export) -> Result<Vec<(usize, usize)>, EmitError> {
    let room = |i: usize| {
        let time = export.start.times.get(i).copied().unwrap_or(0.0);
        let points = 2.0 * (time / export.step).ceil() + 64.0;
        match points <= MOST_POINTS {
            true => Ok((i, points as usize)),
            false => Err(EmitError::Delay(export.program.held[i].name.clone(), points)),
        }
    };
    held(export.program, HeldKind::Delay).into_iter().map(room).collect()
}
