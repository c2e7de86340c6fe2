//! Steps as C functions: straight lines in chunks, what crosses from one to the next in the model's work array.

use halfarrow_compiler::algebra::Function as Elementary;
use halfarrow_compiler::program::{
    Arg, BlockId, Code, ConditionId, ConditionKind, EventTrigger, Local, Method, Op, Program, Step, Value,
};
use rustc_hash::{FxHashMap, FxHashSet};

use super::Export;
use super::blocks::Factored;
use super::derivatives::Expressions;
use super::function::{Function, Gives, Parameter};
use super::givens::Givens;
use super::header::comment;
use super::patterns::Patterns;
use super::variables::Variables;
use super::written::{Line, Needed, Part, Series, Variable, Written, needed, without_the_unread, written};
use crate::Real;

/// Steps in one C function: compilers take more than linear time for long ones.
const CHUNK: usize = 250;

/// How a function is called.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shape {
    /// Its parameters.
    pub parameters: &'static [Parameter],
    /// Whether it gives no status.
    pub void: bool,
    /// Time, where failures note it.
    pub time: Time,
    /// The givens that move, if derivatives are wanted.
    pub along: Option<Moving>,
    /// Whether what it gives is in double precision whatever real numbers are.
    pub wide: bool,
}

/// When a function fails.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Time {
    /// At the time for which it is called.
    Given,
    /// At any time.
    Always,
}

impl Time {
    /// In C.
    pub fn text(self) -> &'static str {
        match self {
            Time::Given => "t",
            Time::Always => "((double)NAN)",
        }
    }
}

/// What has derivatives.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Moving {
    /// The rate of time.
    pub time: Option<TimeRate>,
    pub inputs: bool,
    pub held: bool,
    pub conserved: bool,
    pub states: bool,
    /// What a Newton block reads from outside.
    pub outer: bool,
}

/// How fast time runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum TimeRate {
    /// One second a second.
    One,
    /// As the direction says.
    OfDirection,
}

/// Writes functions.
pub(super) struct Writer<'a> {
    pub program: &'a Program,
    /// The name of the model in capitals, before the codes of failures.
    pub capitals: String,
    pub givens: Givens<'a>,
    pub factored: Factored,
    /// Places of the work array taken so far.
    pub crossing: usize,
    variables: Variables,
    /// The size of real numbers.
    pub real: Real,
    /// Places of the array for what crosses in double precision, if real numbers are less.
    pub wide_crossing: usize,
    /// The Newton blocks in use, by which they are numbered.
    pub newton: &'a [BlockId],
    pub patterns: &'a Patterns,
}

impl<'a> Writer<'a> {
    pub fn new(export: &Export<'a>, name: &str, newton: &'a [BlockId], patterns: &'a Patterns) -> Writer<'a> {
        let Export { program, real, .. } = *export;
        let factored = Factored::of(program, real);
        let givens = Givens::new(program, real);
        let variables = Variables::of(program, &givens);
        let capitals = name.to_ascii_uppercase();
        Writer { program, capitals, givens, factored, crossing: 0, variables, real, wide_crossing: 0, newton, patterns }
    }

    /// The precision of what is in double precision, or in that of real numbers.
    pub fn precision_of(&self, wide: bool) -> Real {
        if wide { Real::Double } else { self.real }
    }

    /// A call that takes note of a failure and gives its code.
    pub fn failure(&self, code: &str, place: &dyn Part, time: Time) -> Written {
        written!("{}(m, {}_{}, {}, {})", needed("ha_fail"), self.capitals, code, place, time.text())
    }

    /// Lines that give up with a failure where a condition holds.
    pub fn fail_if(&self, condition: &Written, code: &str, place: &dyn Part, time: Time) -> Line {
        let failure = self.failure(code, place, time);
        Line::new(written!("    if ({}) {{\n        return {};\n    }}", condition, failure), 0)
    }

    /// Which locals are in double precision whatever real numbers are: those that follow from time and parameters alone,
    /// so that time has its digits in long runs.
    fn wide(&self, code: &Code) -> Vec<bool> {
        let mut wide = vec![false; code.values.len()];
        if self.real == Real::Double {
            return wide;
        }
        for step in &code.steps {
            let solved = matches!(
                step,
                Step::Solve(_) | Step::Op { op: Op::Table(..) | Op::TableSlope(..) | Op::TableCurvature(..), .. }
            );
            let all = self.all_timely(step, &wide);
            step.defines().iter().for_each(|out| wide[out.0 as usize] = all && !solved);
        }
        wide
    }

    /// Whether all that a step reads follows from time and parameters alone.
    fn all_timely(&self, step: &Step, wide: &[bool]) -> bool {
        let mut all = true;
        step.for_each_read(|a| {
            all &= match a {
                Arg::Given(value) => self.givens.is_timely(value),
                Arg::Local(i) => wide[i.0 as usize],
                Arg::Outer(_) | Arg::Guess(_) => false,
            }
        });
        all
    }

    /// The functions that compute code, of which the last has this name; `values` says where its outputs go, `rates` where
    /// their derivatives go, `kept` what it computes of what stands before other routines.
    pub fn function(
        &mut self,
        name: &str,
        shape: Shape,
        (code, kept): (&Code, &[(u32, Value)]),
        places: (&[String], &[String]),
    ) -> Vec<Function> {
        let chunks: Vec<&[Step]> = if code.steps.is_empty() { vec![&[]] } else { code.steps.chunks(CHUNK).collect() };
        let mut f = self.body(shape, (code, kept), &chunks, !places.1.is_empty());
        let mut functions = Vec::new();
        for (c, steps) in chunks.iter().enumerate() {
            f.chunk = c;
            f.turns = turns(steps);
            steps.iter().enumerate().for_each(|(i, step)| self.step(&mut f, step, c * CHUNK + i));
            self.outputs(&mut f, code, places, chunks.len());
            let called = if chunks.len() == 1 { name.to_string() } else { format!("{name}_{c}") };
            let mut lines = without_the_unread(std::mem::take(&mut f.lines));
            lines.extend(shape.parameters.iter().map(|p| Line::new(written!("    (void){};", p.name()), 0)));
            functions.push(self.finished(called, shape, lines));
        }
        if functions.len() > 1 {
            let lines = functions.iter().map(|f| self.chunk_call(shape, &f.name)).collect();
            functions.push(self.finished(name.to_string(), shape, lines));
        }
        functions
    }

    /// A function that is to be written, with a home for each local.
    fn body(&mut self, shape: Shape, (code, kept): (&Code, &[(u32, Value)]), chunks: &[&[Step]], rates: bool) -> Body {
        let mut f = Body {
            shape,
            moves: self.moves(code, shape, rates),
            wide: self.wide(code),
            read: read_of(code, kept),
            home: vec![0; code.values.len()],
            place: vec![usize::MAX; code.values.len()],
            rate_place: vec![usize::MAX; code.values.len()],
            chunk: 0,
            turns: FxHashMap::default(),
            names: self.variables.of_locals(code),
            kept: kept.iter().copied().collect(),
            lines: Vec::new(),
        };
        for (c, steps) in chunks.iter().enumerate() {
            steps.iter().flat_map(Step::defines).for_each(|out| f.home[out.0 as usize] = c);
        }
        for (c, steps) in chunks.iter().enumerate() {
            for step in *steps {
                step.for_each_read(|a| match a {
                    Arg::Local(i) if f.home[i.0 as usize] != c => self.cross(&mut f, i.0 as usize),
                    _ => {}
                });
            }
        }
        f
    }

    /// A function of these lines.
    fn finished(&self, name: String, shape: Shape, mut lines: Vec<Line>) -> Function {
        let gives = if shape.void { Gives::Nothing } else { Gives::Status };
        if lines.iter().any(|line| line.written.notes.reads.contains(&Variable::Status)) {
            lines.insert(0, Line::new(Written::of("    int status;"), 0));
        }
        if !shape.void {
            lines.push(Line::new(written!("    return {}_OK;", self.capitals), 0));
        }
        Function::new(name, gives, shape.parameters, self.real, &lines)
    }

    /// A call of a piece of a function.
    fn chunk_call(&self, shape: Shape, called: &str) -> Line {
        let arguments: Vec<&str> = shape.parameters.iter().map(|p| p.name()).collect();
        let call = written!("{}({})", Needed(called.to_string().into()), arguments.join(", "));
        Line::new(
            match shape.void {
                true => written!("    {};", call),
                false => written!(
                    "    {} = {};\n    if (status != {}_OK) {{\n        return status;\n    }}",
                    Variable::Status,
                    call,
                    self.capitals
                ),
            },
            0,
        )
    }

    fn cross(&mut self, f: &mut Body, local: usize) {
        if f.place[local] == usize::MAX {
            let crossing = if f.wide[local] { &mut self.wide_crossing } else { &mut self.crossing };
            f.place[local] = *crossing;
            *crossing += 1;
            if f.moves[local] {
                f.rate_place[local] = *crossing;
                *crossing += 1;
            }
        }
    }

    /// Which locals have derivatives that somebody asks for.
    fn moves(&self, code: &Code, shape: Shape, rates: bool) -> Vec<bool> {
        let mut moves = vec![false; code.values.len()];
        let Some(moving) = shape.along else { return moves };
        for step in &code.steps {
            let mut one = false;
            step.for_each_read(|a| {
                one |= match a {
                    Arg::Given(value) => self.givens.rate(value, moving).is_some(),
                    Arg::Local(i) => moves[i.0 as usize],
                    Arg::Outer(_) => moving.outer,
                    Arg::Guess(_) => false,
                }
            });
            let can = match step {
                Step::Op { op, .. } => op.moves(),
                Step::Solve(_) => true,
                Step::Parameter { .. } | Step::Guard { .. } => false,
            };
            step.defines().iter().for_each(|out| moves[out.0 as usize] = one && can);
        }
        let mut asked = vec![false; moves.len()];
        let ask = |asked: &mut Vec<bool>, a: Arg| {
            if let Arg::Local(i) = a {
                asked[i.0 as usize] = true;
            }
        };
        code.outputs.iter().filter(|_| rates).for_each(|&a| ask(&mut asked, a));
        for step in code.steps.iter().rev() {
            let wanted = step.defines().iter().any(|out| moves[out.0 as usize] && asked[out.0 as usize]);
            let condition = if let Step::Op { op, .. } = step { op.condition() } else { None };
            let timed = condition.is_some_and(|c| self.takes_rate(c, moving));
            if wanted || timed {
                match step {
                    Step::Op { op: Op::Select(_, a, b), .. } => [*a, *b].into_iter().for_each(|a| ask(&mut asked, a)),
                    _ => step.for_each_read(|a| ask(&mut asked, a)),
                }
            }
        }
        moves.iter().zip(&asked).map(|(moves, asked)| *moves && *asked).collect()
    }

    /// Whether a condition is taken with the rate of its operand: only what time alone moves is.
    fn takes_rate(&self, condition: ConditionId, moving: Moving) -> bool {
        moving.time.is_some() && self.program.conditions[condition].trigger != EventTrigger::State
    }

    fn outputs(&self, f: &mut Body, code: &Code, (values, rates): (&[String], &[String]), chunks: usize) {
        let wanted: Vec<(usize, Arg)> =
            code.outputs.iter().copied().enumerate().filter(|(_, a)| f.is_here(*a, chunks)).collect();
        for (i, a) in wanted {
            if let Some(place) = values.get(i) {
                let value = self.arg(f, a, f.shape.wide);
                f.assign(place, &value);
            }
            if let Some(place) = rates.get(i) {
                let zero = || Written::of(self.precision_of(f.shape.wide).number(0.0));
                let rate = self.rate(f, a, f.shape.wide).unwrap_or_else(zero);
                f.assign(place, &rate);
            }
        }
    }

    /// Puts what other routines and Newton blocks read where these find it, as soon as it is computed.
    fn keep(&self, f: &mut Body, out: u32) {
        let Some(&given) = f.kept.get(&out) else { return };
        let a = Arg::Local(Local(out));
        let (place, value) = (self.givens.written(given), self.arg(f, a, false));
        f.assign(&place.text, &value);
        if self.real == Real::Float {
            self.keep_exact(f, given, a);
        }
    }

    /// Keeps what follows from parameters in double precision too where that is read, and sees that it fits.
    fn keep_exact(&self, f: &mut Body, given: Value, a: Arg) {
        let value = self.arg(f, a, true);
        if self.givens.is_exact(given) {
            f.assign(&self.givens.wide_written(given).text, &value);
        }
        let parameter = match self.program.values.op(given) {
            Op::Parameter(i) => i as usize,
            _ => self.program.parameters.len(),
        };
        let unfit = written!("!{}({})", needed("ha_fits"), value);
        f.lines.push(self.fail_if(&unfit, "OUT_OF_RANGE", &parameter, f.shape.time));
    }

    /// A value, in double precision or in that of real numbers.
    fn arg(&self, f: &Body, a: Arg, wide: bool) -> Written {
        let (value, is_wide) = match a {
            Arg::Given(value) if wide => (self.givens.wide_written(value), true),
            Arg::Given(value) => (self.givens.written(value), self.givens.is_time(value)),
            Arg::Local(local) => {
                let i = local.0 as usize;
                let value = match (f.home[i] == f.chunk, f.wide[i]) {
                    (true, _) => written!("{}", Variable::Number(Series::Value(local.0))),
                    (false, true) => written!("m->wide[{}]", f.place[i]),
                    (false, false) => written!("m->w[{}]", f.place[i]),
                };
                (value, f.wide[i])
            }
            Arg::Outer(i) => (written!("o[{}]", i), false),
            Arg::Guess(i) => (written!("g[{}]", i), false),
        };
        self.cast(value, is_wide, wide)
    }

    fn cast(&self, value: Written, from_wide: bool, to_wide: bool) -> Written {
        match (self.precision_of(from_wide), self.precision_of(to_wide)) {
            (from, to) if from == to => value,
            (_, to) => written!("({}){}", to.kind(), value),
        }
    }

    /// The derivative, if it moves.
    fn rate(&self, f: &Body, a: Arg, wide: bool) -> Option<Written> {
        let moving = f.shape.along?;
        let (rate, is_wide) = match a {
            Arg::Given(value) => (self.givens.rate(value, moving)?, false),
            Arg::Local(local) if !f.moves[local.0 as usize] => return None,
            Arg::Local(local) => {
                let i = local.0 as usize;
                let (place, is_wide) = (f.rate_place[i], f.wide[i]);
                match f.home[i] == f.chunk {
                    true => (written!("{}", Variable::Number(Series::Rate(local.0))), is_wide),
                    false => (written!("m->{}[{}]", if is_wide { "wide" } else { "w" }, place), is_wide),
                }
            }
            Arg::Outer(i) => (moving.outer.then(|| written!("e[{}]", i))?, false),
            Arg::Guess(_) => return None,
        };
        Some(self.cast(rate, is_wide, wide))
    }

    /// Whether a step is computed in double precision, and whether its derivative is, if real numbers are less.
    fn precision(&self, f: &Body, step: &Step) -> (bool, bool) {
        let single = self.real == Real::Float;
        match step {
            Step::Op { op: Op::Sign(..) | Op::Floor(..), .. } => (single, single),
            Step::Op { op: Op::Table(..) | Op::TableSlope(..) | Op::TableCurvature(..), .. } => (single, false),
            Step::Guard { .. } => (single && self.all_timely(step, &f.wide), false),
            _ => {
                let wide = step.defines().first().is_some_and(|out| f.wide[out.0 as usize]);
                (wide, wide)
            }
        }
    }

    fn step(&self, f: &mut Body, step: &Step, place: usize) {
        let (wide, wide_rate) = self.precision(f, step);
        let mut reads = Reading::default();
        step.for_each_read(|a| {
            reads.values.push(self.arg(f, a, wide));
            reads.rates.push(self.rate(f, a, wide_rate));
        });
        match step {
            Step::Guard { guard, .. } => {
                let vanishes = self.vanishes(&reads.values, self.precision_of(wide));
                f.lines.push(self.fail_if(&vanishes, "VANISHED", guard, f.shape.time));
            }
            Step::Parameter { out, index, default: _ } => {
                let array = if self.real == Real::Float { "p_exact" } else { "p" };
                let value = written!("m->set[{0}] ? m->{1}[{0}] : {2}", index, array, reads.values[0]);
                self.put(f, out.0, &value, None);
            }
            Step::Solve(solve) => match solve.method {
                Method::Linear { .. } => self.linear(f, solve, &reads, place),
                Method::Newton { .. } => self.newton(f, solve, &reads, place),
            },
            Step::Op { out, op } => self.operation(f, (out.0, *op), &reads, place),
        }
    }

    /// Whether a divisor is rounding of what it is the sum of.
    fn vanishes(&self, values: &[Written], real: Real) -> Written {
        let (zero, rounding) = (real.number(0.0), real.number(64.0 * real.epsilon()));
        let (size, divisor, scale) = (real.function("fabs"), &values[0], &values[1]);
        written!("!({} != {} && {}({}) > {} * {})", divisor, zero, size, divisor, rounding, scale)
    }

    fn operation(&self, f: &mut Body, (out, op): (u32, Op<Arg>), reads: &Reading, place: usize) {
        let (a, d) = (&reads.values[..], &reads.rates[..]);
        match op {
            Op::Table(table, piece, _) => self.table(f, (out, 0), (&a[0], d[0].as_ref()), (table, piece, place)),
            Op::TableSlope(table, piece, _) => self.table(f, (out, 1), (&a[0], d[0].as_ref()), (table, piece, place)),
            Op::TableCurvature(table, piece, _) => {
                self.table(f, (out, 2), (&a[0], d[0].as_ref()), (table, piece, place));
            }
            Op::Sign(condition, _) | Op::Floor(condition, _) => {
                let taken = self.condition(f, condition, &a[0], d[0].as_ref());
                self.put(f, out, &self.cast(taken, true, f.wide[out as usize]), None);
            }
            Op::Call(function @ (Elementary::Sin | Elementary::Cos), angle) if f.turns.contains_key(&angle) => {
                let value = self.turn(f, (out, function), (&a[0], angle), place);
                let rate = self.derivative(f, out, op, reads);
                self.put(f, out, &value, rate.as_ref());
            }
            Op::Powi(..) => {
                let value = self.value(f, out, op, reads);
                self.put(f, out, &value, None);
                if let Some(rate) = self.derivative(f, out, op, reads) {
                    self.put_rate(f, out, &rate);
                }
            }
            _ => {
                let value = self.value(f, out, op, reads);
                let rate = self.derivative(f, out, op, reads);
                self.put(f, out, &value, rate.as_ref());
            }
        }
    }

    /// A plain operation, as the table says.
    fn value(&self, f: &mut Body, out: u32, op: Op<Arg>, reads: &Reading) -> Written {
        let real = self.precision_of(f.wide[out as usize]);
        let mut k = Expressions::new(&mut f.lines, Series::Value(out), real);
        let mut operands = reads.values.iter().map(|a| k.push(a.clone())).collect::<Vec<_>>().into_iter();
        let value = k.operation(op.map_operands(|_| operands.next().expect("as many as operands")));
        k.written(value)
    }

    /// The derivative of an operation by the rules of the table, if it moves.
    fn derivative(&self, f: &mut Body, out: u32, op: Op<Arg>, reads: &Reading) -> Option<Written> {
        if !f.moves[out as usize] {
            return None;
        }
        let real = self.precision_of(f.wide[out as usize]);
        let mut k = Expressions::new(&mut f.lines, Series::Rate(out), real);
        let value = k.push(written!("{}", Variable::Number(Series::Value(out))));
        let mut operands = reads.values.iter().zip(&reads.rates);
        let slope = op.derivative(&mut k, value, |k, _| {
            let (value, rate) = operands.next().expect("as many as operands");
            (k.push(value.clone()), rate.as_ref().map(|rate| k.push(rate.clone())))
        });
        slope.map(|slope| k.written(slope))
    }

    /// One of a sine and a cosine that are computed together.
    fn turn(
        &self,
        f: &mut Body,
        (out, function): (u32, Elementary),
        (a, angle): (&Written, Arg),
        place: usize,
    ) -> Written {
        let number = *f.turns.entry(angle).or_default().get_or_insert(place);
        let both = Variable::Array("h", number);
        if number == place {
            let real = self.precision_of(f.wide[out as usize]);
            let turn = Needed(real.function("ha_turn").into());
            f.line(written!("    {} {}[2];\n    {}({}, {});", real.kind(), both, turn, a, both), 2);
        }
        written!("{}[{}]", both, usize::from(function == Elementary::Cos))
    }

    fn condition(&self, f: &Body, id: ConditionId, a: &Written, d: Option<&Written>) -> Written {
        let condition = &self.program.conditions[id];
        let hold = match condition.trigger {
            EventTrigger::LinearTime | EventTrigger::CurvedTime => "m->clock_hold",
            EventTrigger::State => "m->state_hold",
            EventTrigger::RecordedOnly => "HA_FOLLOW",
        };
        let (plain, along, table) = match condition.kind {
            ConditionKind::Sign => ("ha_side", "ha_side_along", String::new()),
            ConditionKind::Floor => ("ha_whole", "ha_whole_along", String::new()),
            ConditionKind::Piece(table) => ("ha_piece", "ha_piece_along", format!("{table}, ")),
        };
        match d.filter(|_| f.shape.along.is_some_and(|moving| self.takes_rate(id, moving))) {
            Some(d) => written!("{}(m, {}, {}, {}{}, {}, t)", needed(along), hold, id.0, table, a, d),
            None => written!("{}(m, {}, {}, {}{})", needed(plain), hold, id.0, table, a),
        }
    }

    fn table(
        &self,
        f: &mut Body,
        (out, order): (u32, usize),
        (a, d): (&Written, Option<&Written>),
        (table, piece, number): (u32, Option<ConditionId>, usize),
    ) {
        let piece = match piece {
            Some(condition) => written!("(int){}", self.condition(f, condition, a, d)),
            None => written!("{}(&ha_tables[{}], {})", needed("ha_piece_of"), table, a),
        };
        let cubic = Variable::Array("q", number);
        f.line(written!("    {} {}[4];", self.real.kind(), cubic), 4);
        let look = needed("ha_table_on");
        f.line(written!("    {}(&{}[{}], {}, {}, {});", look, needed("ha_tables"), table, piece, a, cubic), 0);
        let along = Needed(self.real.function("ha_along").into());
        let rate = d.map(|d| written!("{}({}[{}], {})", along, cubic, order + 1, d));
        self.put(f, out, &written!("{}[{}]", cubic, order), rate.as_ref());
    }

    /// Declares what a step computes, and puts it where it is read elsewhere.
    pub fn put(&self, f: &mut Body, out: u32, value: &Written, rate: Option<&Written>) {
        let i = out as usize;
        let name = f.names[i].as_ref().map_or(String::new(), |name| format!(" /* {} */", comment(name)));
        self.declare(f, out, (Series::Value(out), value), (f.place[i], &name));
        self.keep(f, out);
        if let Some(rate) = rate {
            self.put_rate(f, out, rate);
        }
    }

    fn put_rate(&self, f: &mut Body, out: u32, rate: &Written) {
        self.declare(f, out, (Series::Rate(out), rate), (f.rate_place[out as usize], ""));
    }

    /// Declares a number of the precision of a local, with a comment, and stores it where it crosses to other chunks.
    fn declare(&self, f: &mut Body, out: u32, (series, value): (Series, &Written), (place, about): (usize, &str)) {
        let (wide, variable) = (f.wide[out as usize], Variable::Number(series));
        let kind = self.precision_of(wide).kind();
        f.constant(variable, written!("    const {} {} = {};{}", kind, variable, value, about), 1);
        if place != usize::MAX {
            let array = if wide { "wide" } else { "w" };
            f.assign(&format!("m->{array}[{place}]"), &written!("{}", variable));
        }
    }
}

/// A function while it is written.
pub(super) struct Body {
    pub shape: Shape,
    /// Which locals have derivatives that somebody asks for.
    pub moves: Vec<bool>,
    /// Which locals are in double precision whatever real numbers are.
    wide: Vec<bool>,
    /// Which are read.
    pub read: Vec<bool>,
    /// The chunk that computes each local.
    home: Vec<usize>,
    /// Where a local is kept that crosses from one chunk to another, and where its derivative is.
    place: Vec<usize>,
    rate_place: Vec<usize>,
    chunk: usize,
    /// Angles whose sine and cosine are both wanted in this chunk, with the number of the pair once it is computed.
    turns: FxHashMap<Arg, Option<usize>>,
    /// What the locals are in the model, where they have a name there.
    names: Vec<Option<String>>,
    /// What other routines read of what is computed.
    kept: FxHashMap<u32, Value>,
    pub lines: Vec<Line>,
}

impl Body {
    /// A line that declares so many numbers.
    pub fn line(&mut self, written: Written, numbers: usize) {
        self.lines.push(Line::new(written, numbers));
    }

    /// A line that declares a constant of so many numbers.
    pub fn constant(&mut self, variable: Variable, written: Written, numbers: usize) {
        self.lines.push(Line::constant(variable, written, numbers));
    }

    /// A line that puts a value somewhere.
    pub fn assign(&mut self, place: &str, value: &Written) {
        self.line(written!("    {} = {};", place, value), 0);
    }

    /// Whether what is computed by now first has this value; what no chunk computes stands in the last one.
    fn is_here(&self, a: Arg, chunks: usize) -> bool {
        match a {
            Arg::Local(i) => self.home[i.0 as usize] == self.chunk,
            _ => self.chunk + 1 == chunks,
        }
    }
}

/// What a step reads, in C: values and derivatives.
#[derive(Default)]
pub(super) struct Reading {
    pub values: Vec<Written>,
    pub rates: Vec<Option<Written>>,
}

/// Whether each local is read by a step or wanted.
fn read_of(code: &Code, kept: &[(u32, Value)]) -> Vec<bool> {
    let mut read = vec![false; code.values.len()];
    let mut mark = |a: Arg| {
        if let Arg::Local(i) = a {
            read[i.0 as usize] = true;
        }
    };
    code.steps.iter().for_each(|step| step.for_each_read(&mut mark));
    code.outputs.iter().copied().chain(kept.iter().map(|k| Arg::Local(Local(k.0)))).for_each(mark);
    read
}

/// The angles of which some steps want both sine and cosine.
fn turns(steps: &[Step]) -> FxHashMap<Arg, Option<usize>> {
    let of = |wanted: Elementary| {
        let angle = move |step: &Step| match step {
            Step::Op { op: Op::Call(f, a), .. } if *f == wanted => Some(*a),
            _ => None,
        };
        steps.iter().filter_map(angle).collect::<FxHashSet<Arg>>()
    };
    let cosines = of(Elementary::Cos);
    of(Elementary::Sin).into_iter().filter(|a| cosines.contains(a)).map(|a| (a, None)).collect()
}
