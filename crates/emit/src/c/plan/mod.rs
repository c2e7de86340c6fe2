//! All functions of a model, and the source that they make.

mod words;

use std::collections::{BTreeMap, BTreeSet};

use halfarrow_compiler::algebra::math;
use halfarrow_compiler::bond_graph::HeldKind;
use halfarrow_compiler::program::{
    Assumption, Block, BlockId, Cause, ConditionId, ConditionKind, DomainKind, Holds, Layout, Program, Reads, Routine,
    Value,
};

use super::cost::{Cost, Work};
use super::ssa::{self, Code, Inner};
use super::start::{self, Group, Pass};
use super::write::{Moving, Shape, Writer, elimination_room, number};
use super::{Export, messages, real, template};
use crate::{EmitError, Method, Real};

/// A sum of floats below this fraction of its terms is rounding of the operations that lead to it.
const ROUNDING_OF_FLOATS: f64 = 1e-5;

/// Points that all delays together may keep.
const MOST_POINTS: f64 = 1e6;

const PLAIN: Shape = Shape {
    parameters: "ha_model *m, ha_wide t, const double *x, double *out",
    arguments: "m, t, x, out",
    void: false,
    time: "t",
    along: None,
    wide: false,
};
const ALONG: Shape = Shape {
    parameters: "ha_model *m, ha_wide t, const double *x, const double *e, double *out, double *rates",
    arguments: "m, t, x, e, out, rates",
    ..PLAIN
};

/// The functions of a model.
pub(super) struct Plan<'a> {
    pub export: &'a Export<'a>,
    pub program: &'a Program,
    pub name: String,
    pub layout: Layout,
    /// Functions in C.
    functions: String,
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
    pub direction: usize,
    pub indicators: usize,
}

/// What functions cost.
#[derive(Debug, Clone, Default)]
struct Works {
    rates: Work,
    observe: Work,
    switching: Work,
    sources: Work,
    tangent: Work,
    clock: Work,
}

impl<'a> Plan<'a> {
    pub fn new(export: &'a Export<'a>, name: &str) -> Result<Plan<'a>, EmitError> {
        let program = export.program;
        let of = |wanted: fn(Cause) -> bool| -> Vec<ConditionId> {
            program.conditions.iter().filter(|(_, c)| wanted(c.cause)).map(|(id, _)| id).collect()
        };
        let mut plan = Plan {
            export,
            program,
            name: name.to_string(),
            layout: program.layout(),
            functions: String::new(),
            switches: of(|cause| cause == Cause::State),
            clocks: of(|cause| matches!(cause, Cause::Clock | Cause::Curve)),
            delays: delays(export)?,
            samples: held(program, HeldKind::Sample),
            newton: Vec::new(),
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
        let layout = self.layout.clone();
        let mut writer = Writer::new(program, &layout, self.export.real);
        let mut inner = Inner::default();
        let mut text = String::new();
        let values = |prefix: &str, n: usize| -> Vec<String> { (0..n).map(|i| format!("{prefix}[{i}]")).collect() };

        let preamble = ssa::of_routine(program, &layout, &program.preamble(&layout), &mut inner);
        let preamble = Code { outputs: Vec::new(), ..preamble };
        text += &self.of_parameters(&writer, "ha_defaults_code", program.inputs.iter().map(|i| i.default), false);
        text += &self.of_parameters(&writer, "ha_times_code", program.held.iter().map(|h| h.time), true);
        text += &self.of_parameters(&writer, "ha_asked_code", program.start.iter().map(|c| c.asked), false);

        let rates: Vec<Value> = program.states.iter().map(|s| s.rate).collect();
        let rates = program.watched_routine(&layout, &rates);
        let wanted = self.export.recorded.iter().filter_map(|&i| program.observed[i].value.clone().ok());
        let observe = program.watched_routine(&layout, &wanted.collect::<Vec<_>>());
        let operands = |ids: &[ConditionId]| ids.iter().map(|&c| program.conditions[c].operand).collect::<Vec<_>>();
        let switching = program.routine(&layout, &operands(&self.switches));
        let clock = program.routine(&layout, &operands(&self.clocks));
        let sources = program.routine(&layout, &program.held.iter().map(|h| h.source).collect::<Vec<_>>());
        let domains = program.routine(&layout, &program.domains.iter().map(|d| d.argument).collect::<Vec<_>>());
        let newton = |r: &Routine| r.solves.iter().filter(|s| !s.guess.is_empty()).map(|s| s.block).collect::<Vec<_>>();
        self.rates_blocks = newton(&rates);
        self.shown_blocks = newton(&observe).into_iter().filter(|b| !self.rates_blocks.contains(b)).collect();

        let mut blocks = BTreeMap::new();
        for solve in rates.solves.iter().chain(&observe.solves).chain(&switching.solves).chain(&sources.solves) {
            blocks.insert(solve.block, solve.outer.len());
        }
        let mut plain = |writer: &mut Writer, inner: &mut Inner, name: &str, routine: &Routine| {
            let code = ssa::of_routine(program, &layout, routine, inner);
            routine.solves.iter().for_each(|s| {
                blocks.insert(s.block, s.outer.len());
            });
            let text = writer.function(name, PLAIN, &code, &values("out", code.outputs.len()), &[]);
            (text, code)
        };
        let (body, code) = plain(&mut writer, &mut inner, "ha_rates_code", &rates);
        text += &body;
        let rates_code = code;
        let (body, code) = plain(&mut writer, &mut inner, "ha_observe_code", &observe);
        text += &body;
        let observe_code = code;
        let (body, code) = plain(&mut writer, &mut inner, "ha_switching_code", &switching);
        text += &body;
        let switching_code = code;
        text += &plain(&mut writer, &mut inner, "ha_domains_code", &domains).0;
        text += &self.domain_checks(&writer, &domains);
        text += &self.assumption_checks(&writer);

        let along = |writer: &mut Writer, name: &str, code: &Code, moving: Moving| {
            let shape = Shape { along: Some(moving), ..ALONG };
            writer.function(name, shape, code, &values("out", code.outputs.len()), &values("rates", code.outputs.len()))
        };
        let of = |routine: &Routine, inner: &mut Inner| ssa::of_routine(program, &layout, routine, inner);
        let clock_code = of(&clock, &mut inner);
        let shape = Shape {
            parameters: "ha_model *m, ha_wide t, ha_wide *out, ha_wide *rates",
            arguments: "m, t, out, rates",
            along: Some(Moving { time: true, ..Moving::default() }),
            wide: true,
            ..PLAIN
        };
        let n = clock_code.outputs.len();
        let body = writer.function("ha_clock_code", shape, &clock_code, &values("out", n), &values("rates", n));
        // Time runs at one second a second.
        text += &body.replace("e[0]", "1.0");
        let sources_code = of(&sources, &mut inner);
        let run = Moving { time: true, inputs: true, held: true, states: true, ..Moving::default() };
        text += &along(&mut writer, "ha_sources_along", &sources_code, run);
        let tangent = Moving { inputs: self.export.derivatives, states: true, ..Moving::default() };
        text += &along(&mut writer, "ha_rates_along", &rates_code, tangent);
        if self.export.method.is_linearly_implicit() {
            let drift = Moving { time: true, held: true, ..Moving::default() };
            text += &along(&mut writer, "ha_rates_drift", &rates_code, drift);
        }
        if self.export.derivatives {
            text += &along(&mut writer, "ha_observe_along", &observe_code, tangent);
        }
        let begin = Moving { conserved: true, states: true, ..Moving::default() };
        let residuals =
            |conditions: &[usize]| conditions.iter().map(|&c| program.start[c].residual).collect::<Vec<_>>();
        let passes = self.passes.iter().enumerate().map(|(i, p)| ("pass", i, residuals(&p.conditions)));
        let groups = self.groups.iter().enumerate().filter(|(_, g)| g.together);
        let groups = groups.map(|(i, g)| ("group", i, residuals(&g.conditions)));
        let guesses = program.guesses.iter().enumerate().map(|(i, g)| ("guess", i, vec![g.residual]));
        for (kind, number, wanted) in passes.chain(groups).chain(guesses) {
            let routine = program.routine(&layout, &wanted);
            routine.solves.iter().for_each(|s| {
                blocks.insert(s.block, s.outer.len());
            });
            let code = of(&routine, &mut inner);
            text += &along(&mut writer, &format!("ha_start_{kind}_{number}"), &code, begin);
        }

        // Last, once it is known what is read in double precision.
        let shape = Shape { parameters: "ha_model *m", arguments: "m", time: "HA_WIDE((double)NAN)", ..PLAIN };
        text = writer.function("ha_preamble_code", shape, &preamble, &[], &[]) + &text;

        let used: Vec<BlockId> = {
            let mut used: Vec<BlockId> = inner.keys().copied().collect();
            used.sort_unstable();
            used
        };
        self.reads = used.iter().map(|b| blocks.get(b).copied().unwrap_or(0)).collect();
        let mut block_text = String::new();
        for (i, block) in used.iter().enumerate() {
            block_text += &self.block(&mut writer, i, program.blocks[*block].size(), &inner[block]);
        }
        self.newton = used;
        self.works = Works {
            rates: Work::of(program, &rates_code, &inner),
            observe: Work::of(program, &observe_code, &inner),
            switching: Work::of(program, &switching_code, &inner),
            sources: Work::of(program, &sources_code, &inner),
            tangent: Work::of(program, &rates_code, &inner).along(),
            clock: Work::of(program, &clock_code, &inner).along(),
        };
        self.find_sizes(&writer);
        let whole = block_text + &text;
        self.functions = self.with_block_numbers(&whole);
    }

    /// Values of parameters alone, from where the preamble leaves them.
    fn of_parameters(&self, writer: &Writer, name: &str, values: impl Iterator<Item = Value>, wide: bool) -> String {
        let kind = if wide { "ha_wide" } else { "double" };
        let mut text = format!("static void {name}(const ha_model *m, {kind} *out)\n{{\n");
        for (i, value) in values.enumerate() {
            let place = self.layout.registers.get(&value).map_or("0.0".into(), |&r| match wide {
                true => format!("HA_WIDE({})", writer.fixed_wide(r)),
                false => writer.fixed(r),
            });
            text += &format!("    out[{i}] = {place};\n");
        }
        text + "    (void)m;\n    (void)out;\n}\n\n"
    }

    /// The functions of a Newton block.
    fn block(&self, writer: &mut Writer, number: usize, n: usize, code: &Code) -> String {
        let shape = Shape {
            parameters: "ha_model *m, const double *o, const double *g, double *right, double *matrix",
            arguments: "m, o, g, right, matrix",
            void: true,
            time: "0.0",
            along: None,
            wide: false,
        };
        let right = (0..n).map(|i| format!("right[{i}]"));
        let values: Vec<String> = right.chain((0..n * n).map(|i| format!("matrix[{i}]"))).collect();
        let mut text = writer.function(&format!("ha_block_{number}"), shape, code, &values, &[]);
        let terms = Shape {
            parameters: "ha_model *m, const double *o, const double *g, double *terms",
            arguments: "m, o, g, terms",
            ..shape
        };
        let values: Vec<String> = (0..n).map(|i| format!("terms[{i}]")).collect();
        text += &writer.function(&format!("ha_block_{number}_terms"), terms, &ssa::terms_of(code, n), &values, &[]);
        let shape = Shape {
            parameters: "ha_model *m, const double *o, const double *e, const double *g, double *rates",
            arguments: "m, o, e, g, rates",
            along: Some(Moving { outer: true, ..Moving::default() }),
            ..shape
        };
        let residuals = Code { outputs: code.outputs[..n].to_vec(), ..code.clone() }.without_the_unread();
        let rates: Vec<String> = (0..n).map(|i| format!("rates[{i}]")).collect();
        text += &writer.function(&format!("ha_block_{number}_along"), shape, &residuals, &[], &rates);
        text
    }

    /// Which domain an argument has to lie in, and the check of those that parameters alone decide.
    fn domain_checks(&self, writer: &Writer, routine: &Routine) -> String {
        let mut text = String::from("static int ha_is_within(int domain, double a)\n{\n    switch (domain) {\n");
        for (i, domain) in self.program.domains.iter().enumerate() {
            let holds = match domain.kind {
                DomainKind::Positive => "a > 0.0".to_string(),
                DomainKind::NotNegative => "a >= 0.0".to_string(),
                DomainKind::Within(low, high) => format!("{} <= a && a <= {}", number(low), number(high)),
            };
            text += &format!("    case {i}:\n        return {holds};\n");
        }
        text += "    default:\n        return a == a;\n    }\n}\n\nstatic int ha_check_domains(ha_model *m)\n{\n";
        for (i, domain) in self.program.domains.iter().enumerate() {
            if self.program.values.reads(domain.argument) == Reads::PARAMETERS {
                let a = writer.fixed(routine.outputs[i]);
                text += &format!(
                    "    if (ha_finite({a}) && !ha_is_within({i}, {a})) {{\n        return ha_fail(m, MODEL_OUT_OF_DOMAIN, {i}, HA_WIDE((double)NAN));\n    }}\n"
                );
            }
        }
        text + "    return MODEL_OK;\n}\n\n"
    }

    /// The number from 1 of the first assumption that parameters break, 0 if there is none.
    fn assumption_checks(&self, writer: &Writer) -> String {
        if self.program.assumptions.is_empty() {
            return String::new();
        }
        let fixed = |value: Value| writer.fixed(self.layout.registers[&value]);
        let rounding = number(match self.export.real {
            Real::Double => Assumption::ROUNDING,
            Real::Float => ROUNDING_OF_FLOATS,
        });
        let mut text = String::from("static int ha_broken(const ha_model *m)\n{\n");
        for (i, a) in self.program.assumptions.iter().enumerate() {
            let (v, s) = (fixed(a.value), fixed(a.scale));
            let holds = match a.holds {
                Holds::Zero => format!("{v} <= {rounding} * {s} && -{v} <= {rounding} * {s}"),
                Holds::NotZero => format!("{v} > {rounding} * {s} || -{v} > {rounding} * {s}"),
                Holds::Positive => format!("{v} > 0.0"),
                Holds::NotNegative => format!("{v} >= 0.0"),
            };
            text += &format!("    if (!({holds})) {{\n        return {};\n    }}\n", i + 1);
        }
        text + "    return 0;\n}\n\n"
    }

    fn find_sizes(&mut self, writer: &Writer) {
        let program = self.program;
        let linear = program.blocks.values().filter(|b| matches!(b, Block::Linear { .. })).map(Block::size);
        let most_linear = linear.max().unwrap_or(0);
        let newton: Vec<(usize, usize)> =
            self.newton.iter().zip(&self.reads).map(|(b, &reads)| (program.blocks[*b].size(), reads)).collect();
        let lu = |n: usize| elimination_room(n, self.export.real);
        let work = |&(n, reads): &(usize, usize)| 17 * n + reads + 4 * n * n + lu(n);
        self.sizes = Sizes {
            derived: writer.derived.len(),
            exact: writer.exact.borrow().len(),
            wide: writer.wide_crossing,
            crossing: writer.crossing,
            memory: newton.iter().map(|(n, reads)| 2 * (n + reads + n * n)).sum(),
            work: newton.iter().map(work).max().unwrap_or(0).max(lu(most_linear)),
            order: newton.iter().map(|b| b.0).max().unwrap_or(0).max(most_linear),
            factors: writer.factored.size,
            factors_order: writer.factored.orders,
            factored: writer.factored.places.len(),
            direction: (self.layout.rates - self.layout.time) as usize,
            indicators: self.switches.iter().map(|&c| program.conditions[c].kind.switches()).sum(),
        };
    }

    fn with_block_numbers(&self, text: &str) -> String {
        let words: BTreeMap<String, String> =
            self.newton.iter().enumerate().map(|(i, b)| (format!("BLOCK_{}_", b.0), i.to_string())).collect();
        template::fill(text, &words)
    }

    /// The functions of the equations.
    pub fn functions(&self) -> &str {
        &self.functions
    }

    /// The source file; at its head stands what it keeps to.
    pub fn source(&self, obligations: &str) -> String {
        let (flags, mut words) = (self.flags(), self.words());
        words.insert("OBLIGATION_LINES".into(), obligations.to_string());
        words.insert("MODEL_TITLE".into(), super::header::comment(&self.program.name));
        let size = self.export.real;
        let filled = |text: &str| template::fill(&template::choose(text, &flags), &words);
        let piece = |text: &str| real::of(&filled(text), size);
        let mut text = piece(include_str!("../runtime/top.c"));
        text += math::C_SOURCE;
        text += "\n/* ---- small things ---- */\n\n";
        if size == Real::Float {
            text += math::C_SOURCE_SINGLE;
            text += &real::wide(&filled(include_str!("../runtime/small.c")), size);
        }
        text += &piece(include_str!("../runtime/small.c"));
        text += &piece(include_str!("../runtime/helpers.c"));
        if self.sizes.order > 0 {
            text += &piece(include_str!("../runtime/lu.c"));
        }
        if !self.newton.is_empty() {
            text += &piece(include_str!("../runtime/newton.c"));
        }
        text += &piece(include_str!("../runtime/tables.c"));
        text += &real::wide(&filled(include_str!("../runtime/conditions.c")), size);
        text += "\n/* ---- the equations ---- */\n\n";
        text += &real::of(&self.functions, size);
        if !self.clocks.is_empty() {
            text += &real::wide(&filled(include_str!("../runtime/clock.c")), size);
        }
        text += &piece(include_str!("../runtime/held.c"));
        text += &piece(include_str!("../runtime/system.c"));
        if self.export.method.is_implicit() {
            text += &piece(include_str!("../runtime/matrix.c"));
        }
        text += &piece(include_str!("../runtime/advance.c"));
        let method = match self.export.method {
            Method::ImplicitMidpoint => include_str!("../runtime/midpoint.c"),
            method if method.is_linearly_implicit() => include_str!("../runtime/rosenbrock.c"),
            _ => include_str!("../runtime/explicit.c"),
        };
        text += &piece(method);
        text += &piece(include_str!("../runtime/step.c"));
        let begin = piece(include_str!("../runtime/start.c"));
        let solve = if self.solves_start() { piece(include_str!("../runtime/start_solve.c")) } else { String::new() };
        text += &begin.replace("START_CODE\n", &solve);
        text += &messages::messages(self);
        let text =
            template::name(&text, &self.name).replace("#include \"NAME.h\"", &format!("#include \"{}.h\"", self.name));
        let mut tidy = template::without_empty_sections(&template::without_the_uncalled(&text));
        while tidy.contains("\n\n\n") {
            tidy = tidy.replace("\n\n\n", "\n\n");
        }
        tidy
    }

    fn kinds(&self) -> impl Iterator<Item = ConditionKind> + '_ {
        self.program.conditions.values().map(|c| c.kind)
    }

    fn flags(&self) -> BTreeSet<&'static str> {
        let held = !self.program.held.is_empty();
        let conditions = &self.program.conditions;
        let drift = self.export.method.is_linearly_implicit();
        let all: [(&str, bool); 36] = [
            ("single", self.export.real == Real::Float),
            ("tables", !self.program.tables.is_empty()),
            ("conditions", !conditions.is_empty()),
            ("conditions_along", !conditions.is_empty()),
            ("borders", !conditions.is_empty()),
            ("sign_conditions", self.kinds().any(|k| k == ConditionKind::Sign)),
            ("floor_conditions", self.kinds().any(|k| k == ConditionKind::Floor)),
            ("piece_conditions", self.kinds().any(|k| matches!(k, ConditionKind::Piece(_)))),
            ("clocks", !self.clocks.is_empty()),
            ("curves", self.clocks.iter().any(|&c| conditions[c].cause == Cause::Curve)),
            ("switches", !self.switches.is_empty()),
            ("held", held),
            ("delays", !self.delays.is_empty()),
            ("samples", !self.samples.is_empty()),
            ("only_samples", held && self.delays.is_empty()),
            ("newton", !self.newton.is_empty()),
            ("newton_along", true),
            ("newton_single", self.newton.iter().any(|&b| self.program.blocks[b].size() == 1)),
            ("follows", !(self.rates_blocks.is_empty() && self.shown_blocks.is_empty())),
            ("rates_newton", !self.rates_blocks.is_empty()),
            ("shown_newton", !self.shown_blocks.is_empty()),
            ("domains", !self.program.domains.is_empty()),
            (
                "domains_always",
                self.program.domains.iter().any(|d| self.program.values.reads(d.argument) == Reads::PARAMETERS),
            ),
            ("assumptions", !self.program.assumptions.is_empty()),
            ("outputs", !self.export.recorded.is_empty()),
            ("tangent", self.has_tangent()),
            ("derivatives", self.export.derivatives),
            ("drift", drift),
            ("time_passes", drift || held),
            ("conserved", !self.program.conserved.is_empty()),
            ("inputs", !self.program.inputs.is_empty()),
            ("parameters", !self.program.parameters.is_empty()),
            ("linear_constant", self.sizes.factored > 0),
            ("solves_start", self.solves_start()),
            ("guesses", !self.program.guesses.is_empty()),
            ("start_groups", self.groups.iter().any(|g| g.together)),
        ];
        all.into_iter().filter(|(_, holds)| *holds).map(|(flag, _)| flag).collect()
    }

    /// Whether a start may differ from the exported one.
    pub fn solves_start(&self) -> bool {
        !(self.program.start.is_empty() && self.program.guesses.is_empty())
    }

    /// Whether the rates have a function for their derivatives.
    pub fn has_tangent(&self) -> bool {
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
                let mut one = w.rates.clone() + w.tangent.clone() * groups;
                one.operations += n * n * n + 4 * n * n;
                one * 20
            }
            Method::LinearlyImplicitEuler | Method::Rosenbrock => {
                let (groups, stages) = (self.column_groups().len() as u64, method.stages() as u64);
                let mut all = w.rates.clone() * stages + w.tangent.clone() * (groups + 1);
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
        let follows = |blocks: &[BlockId], work: &Work| if blocks.is_empty() { Work::default() } else { work.clone() };
        let followed = follows(&self.rates_blocks, &w.rates) + follows(&self.shown_blocks, &w.observe);
        let sources =
            if self.delays.is_empty() { Work::default() } else { w.rates.clone() + w.sources.clone().along() };
        step = step + followed.clone() + sources.clone();
        let held = self.program.held.len() as u64;
        let curves = self.clocks.iter().filter(|&&c| self.program.conditions[c].cause == Cause::Curve).count() as u64;
        let looks = 2 + curves * (2 * 4000 + 4 * 2200);
        let clock = if self.clocks.is_empty() { Work::default() } else { w.clock.clone() * looks };
        let sampled = (w.rates.clone() + w.sources.clone().along()) * if held > 0 { held.max(1) } else { 0 };
        let jump = clock + sampled + w.switching.clone() * 2 + sources + followed;
        Cost::new(step, jump, self)
    }
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
