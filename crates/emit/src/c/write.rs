//! Steps as C functions: straight lines in chunks, what crosses from one to the next in the model's work array.

use std::fmt::Write;

use halfarrow_compiler::algebra::Function;
use halfarrow_compiler::program::{
    Arg, BlockId, Code, ConditionId, ConditionKind, EventTrigger, Local, Method, Op, Program, Step, Value,
};
use rustc_hash::{FxHashMap, FxHashSet};

use super::blocks::Factored;
use super::derivatives::{Expressions, expression, power};
use super::givens::Givens;
use super::header::comment;
use super::patterns::Patterns;
use super::variables::Variables;
use crate::Real;

/// Steps in one C function: compilers take more than linear time for long ones.
const CHUNK: usize = 250;

/// How a function is called.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shape {
    /// Its parameters.
    pub parameters: &'static str,
    /// What its chunks are called with.
    pub arguments: &'static str,
    /// Whether it gives no status.
    pub void: bool,
    /// Time, where failures note it.
    pub time: &'static str,
    /// The givens that move, if derivatives are wanted.
    pub along: Option<Moving>,
    /// Whether what it gives is in double precision whatever real numbers are.
    pub wide: bool,
}

/// What has derivatives.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Moving {
    /// The rate of time in C.
    pub time: Option<&'static str>,
    pub inputs: bool,
    pub held: bool,
    pub conserved: bool,
    pub states: bool,
    /// What a Newton block reads from outside.
    pub outer: bool,
}

/// Writes functions.
pub(super) struct Writer<'a> {
    pub program: &'a Program,
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

/// A number as C reads it back to the bit.
pub(super) fn number(value: f64) -> String {
    match value {
        v if v.is_nan() => "((double)NAN)".into(),
        v if v == f64::INFINITY => "HUGE_VAL".into(),
        v if v == f64::NEG_INFINITY => "(-HUGE_VAL)".into(),
        v if v.is_sign_negative() => format!("({v:?})"),
        v => format!("{v:?}"),
    }
}

/// Numbers as the lines of a table.
pub(super) fn numbers(values: &[f64]) -> String {
    match values {
        [] => "    0.0".into(),
        values => values
            .chunks(4)
            .map(|row| format!("    {}", row.iter().map(|&v| number(v)).collect::<Vec<_>>().join(", ")))
            .collect::<Vec<_>>()
            .join(",\n"),
    }
}

impl<'a> Writer<'a> {
    pub fn new(program: &'a Program, newton: &'a [BlockId], patterns: &'a Patterns, real: Real) -> Writer<'a> {
        let factored = Factored::of(program, real);
        let givens = Givens::new(program, real);
        let variables = Variables::of(program, &givens);
        Writer { program, givens, factored, crossing: 0, variables, real, wide_crossing: 0, newton, patterns }
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

    /// A function that computes code; `values` says where its outputs go, `rates` where their derivatives go, `kept` what it
    /// computes of what stands before other routines.
    pub fn function(
        &mut self,
        name: &str,
        shape: Shape,
        (code, kept): (&Code, &[(u32, Value)]),
        (values, rates): (&[String], &[String]),
    ) -> String {
        let moves = self.moves(code, shape, !rates.is_empty());
        let chunks: Vec<&[Step]> = if code.steps.is_empty() { vec![&[]] } else { code.steps.chunks(CHUNK).collect() };
        let mut f = Body {
            shape,
            moves,
            wide: self.wide(code),
            read: read_of(code, kept),
            home: vec![0; code.values.len()],
            place: vec![usize::MAX; code.values.len()],
            rate_place: vec![usize::MAX; code.values.len()],
            chunk: 0,
            turns: FxHashMap::default(),
            names: self.variables.of_locals(code),
            kept: kept.iter().copied().collect(),
            text: String::new(),
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
        let mut names = Vec::new();
        let mut text = String::new();
        let kind = if shape.void { "void" } else { "int" };
        for (c, steps) in chunks.iter().enumerate() {
            f.chunk = c;
            f.turns = turns(steps);
            f.text.clear();
            steps.iter().enumerate().for_each(|(i, step)| self.step(&mut f, step, c * CHUNK + i));
            self.outputs(&mut f, code, (values, rates), chunks.len());
            let called = if chunks.len() == 1 { name.to_string() } else { format!("{name}_{c}") };
            let _ = writeln!(text, "static {kind} {called}({})\n{{", shape.parameters);
            if !shape.void && f.text.contains("status") {
                text += "    int status;\n";
            }
            text += &without_the_unused(&f.text);
            for parameter in shape.arguments.split(", ") {
                let _ = writeln!(text, "    (void){parameter};");
            }
            text += if shape.void { "}\n\n" } else { "    return MODEL_OK;\n}\n\n" };
            names.push(called);
        }
        if chunks.len() > 1 {
            let _ = writeln!(text, "static {kind} {name}({})\n{{", shape.parameters);
            if !shape.void {
                text += "    int status;\n";
            }
            for called in &names {
                let _ = match shape.void {
                    true => writeln!(text, "    {called}({});", shape.arguments),
                    false => writeln!(
                        text,
                        "    status = {called}({});\n    if (status != MODEL_OK) {{\n        return status;\n    }}",
                        shape.arguments
                    ),
                };
            }
            text += if shape.void { "}\n\n" } else { "    return MODEL_OK;\n}\n\n" };
        }
        text
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
                let _ = writeln!(f.text, "    {place} = {value};");
            }
            if let Some(place) = rates.get(i) {
                let rate = self.rate(f, a, f.shape.wide).unwrap_or_else(|| "0.0".into());
                let _ = writeln!(f.text, "    {place} = {rate};");
            }
        }
    }

    /// Puts what other routines and Newton blocks read where these find it, as soon as it is computed.
    fn keep(&self, f: &mut Body, out: u32) {
        let Some(&given) = f.kept.get(&out) else { return };
        let a = Arg::Local(Local(out));
        let (place, value) = (self.givens.text(given), self.arg(f, a, false));
        let _ = writeln!(f.text, "    {place} = {value};");
        if self.real == Real::Float {
            self.keep_exact(f, given, a);
        }
    }

    /// Keeps what follows from parameters in double precision too where that is read, and sees that it fits.
    fn keep_exact(&self, f: &mut Body, given: Value, a: Arg) {
        let value = self.arg(f, a, true);
        if self.givens.is_exact(given) {
            let _ = writeln!(f.text, "    {} = {value};", self.givens.wide_text(given));
        }
        let parameter = match self.program.values.op(given) {
            Op::Parameter(i) => i as usize,
            _ => self.program.parameters.len(),
        };
        let _ = writeln!(
            f.text,
            "    if (!ha_fits({value})) {{\n        return ha_fail(m, MODEL_OUT_OF_RANGE, {parameter}, {});\n    }}",
            f.shape.time
        );
    }

    /// A value, in double precision or in that of real numbers.
    fn arg(&self, f: &Body, a: Arg, wide: bool) -> String {
        let (text, is_wide) = match a {
            Arg::Given(value) if wide => (self.givens.wide_text(value), true),
            Arg::Given(value) => (self.givens.text(value), self.givens.is_time(value)),
            Arg::Local(local) => {
                let i = local.0 as usize;
                let text = match (f.home[i] == f.chunk, f.wide[i]) {
                    (true, _) => format!("v{i}"),
                    (false, true) => format!("m->wide[{}]", f.place[i]),
                    (false, false) => format!("m->w[{}]", f.place[i]),
                };
                (text, f.wide[i])
            }
            Arg::Outer(i) => (format!("o[{i}]"), false),
            Arg::Guess(i) => (format!("g[{i}]"), false),
        };
        self.cast(text, is_wide, wide)
    }

    fn cast(&self, text: String, from_wide: bool, to_wide: bool) -> String {
        match (from_wide, to_wide) {
            _ if self.real == Real::Double => text,
            (true, false) => format!("ha_narrow({text})"),
            (false, true) => format!("ha_widen({text})"),
            _ => text,
        }
    }

    /// The derivative, if it moves.
    fn rate(&self, f: &Body, a: Arg, wide: bool) -> Option<String> {
        let moving = f.shape.along?;
        let (text, is_wide) = match a {
            Arg::Given(value) => (self.givens.rate(value, moving)?, false),
            Arg::Local(local) if !f.moves[local.0 as usize] => return None,
            Arg::Local(local) => {
                let i = local.0 as usize;
                let (place, is_wide) = (f.rate_place[i], f.wide[i]);
                match f.home[i] == f.chunk {
                    true => (format!("d{i}"), is_wide),
                    false => (format!("m->{}[{place}]", if is_wide { "wide" } else { "w" }), is_wide),
                }
            }
            Arg::Outer(i) => (moving.outer.then(|| format!("e[{i}]"))?, false),
            Arg::Guess(_) => return None,
        };
        Some(self.cast(text, is_wide, wide))
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
        let a = &reads.values;
        match step {
            Step::Guard { guard, .. } => {
                let rounding = 64.0 * if wide { f64::EPSILON } else { self.real.epsilon() };
                let holds = format!("{0} != 0.0 && fabs({0}) > {1} * {2}", a[0], number(rounding), a[1]);
                let holds = if wide { format!("HA_WIDE({holds})") } else { format!("({holds})") };
                let _ = writeln!(
                    f.text,
                    "    if (!{holds}) {{\n        return ha_fail(m, MODEL_VANISHED, {guard}, {});\n    }}",
                    f.shape.time
                );
            }
            Step::Parameter { out, index, default: _ } => {
                let given = format!("m->p{}[{index}]", if self.real == Real::Float { "_exact" } else { "" });
                self.put(f, out.0, &format!("m->set[{index}] ? {given} : {}", a[0]), None);
            }
            Step::Solve(solve) => match solve.method {
                Method::Linear { .. } => self.linear(f, solve, &reads, place),
                Method::Newton { .. } => self.newton(f, solve, &reads, place),
            },
            Step::Op { out, op } => self.operation(f, (out.0, *op), &reads, place),
        }
    }

    fn operation(&self, f: &mut Body, (out, op): (u32, Op<Arg>), reads: &Reading, place: usize) {
        let (a, d) = (&reads.values[..], &reads.rates[..]);
        match op {
            Op::Table(table, piece, _) => self.table(f, (out, 0), (&a[0], d[0].as_deref()), (table, piece, place)),
            Op::TableSlope(table, piece, _) => self.table(f, (out, 1), (&a[0], d[0].as_deref()), (table, piece, place)),
            Op::TableCurvature(table, piece, _) => {
                self.table(f, (out, 2), (&a[0], d[0].as_deref()), (table, piece, place));
            }
            Op::Sign(condition, _) | Op::Floor(condition, _) => {
                let taken = self.condition(f, condition, &a[0], d[0].as_deref());
                self.put(f, out, &self.cast(taken, true, f.wide[out as usize]), None);
            }
            Op::Call(function @ (Function::Sin | Function::Cos), angle) if f.turns.contains_key(&angle) => {
                let value = self.turn(f, (out, function), (&a[0], angle), place);
                let rate = self.derivative(f, out, op, reads);
                self.put(f, out, &value, rate.as_deref());
            }
            Op::Powi(n, _) => {
                let value = power(&mut f.text, (&format!("v{out}"), f.wide[out as usize]), &a[0], n);
                self.put(f, out, &value, None);
                if let Some(rate) = self.derivative(f, out, op, reads) {
                    self.put_rate(f, out, &rate);
                }
            }
            _ => {
                let mut operands = a.iter();
                let value = expression(op.map_operands(|_| operands.next().expect("as many as operands")));
                let rate = self.derivative(f, out, op, reads);
                self.put(f, out, &value, rate.as_deref());
            }
        }
    }

    /// The derivative of an operation by the rules of the table, if it moves.
    fn derivative(&self, f: &mut Body, out: u32, op: Op<Arg>, reads: &Reading) -> Option<String> {
        if !f.moves[out as usize] {
            return None;
        }
        let mut k = Expressions::new(&mut f.text, format!("d{out}"), f.wide[out as usize]);
        let value = k.whole(&format!("v{out}"));
        let mut operands = reads.values.iter().zip(&reads.rates);
        let slope = op.derivative(&mut k, value, |k, _| {
            let (value, rate) = operands.next().expect("as many as operands");
            (k.whole(value), rate.as_ref().map(|rate| k.whole(rate)))
        });
        slope.map(|slope| k.text(slope))
    }

    /// One of a sine and a cosine that are computed together.
    fn turn(&self, f: &mut Body, (out, function): (u32, Function), (a, angle): (&str, Arg), place: usize) -> String {
        let number = *f.turns.entry(angle).or_default().get_or_insert(place);
        if number == place {
            let call = format!("ha_turn({a}, h{place})");
            let _ = match f.wide[out as usize] {
                true => writeln!(f.text, "    ha_wide h{place}[2];\n    HA_WIDE({call});"),
                false => writeln!(f.text, "    double h{place}[2];\n    {call};"),
            };
        }
        format!("h{number}[{}]", usize::from(function == Function::Cos))
    }

    fn condition(&self, f: &Body, id: ConditionId, a: &str, d: Option<&str>) -> String {
        let condition = &self.program.conditions[id];
        let hold = match condition.trigger {
            EventTrigger::LinearTime | EventTrigger::CurvedTime => "m->clock_hold",
            EventTrigger::State => "m->state_hold",
            EventTrigger::RecordedOnly => "HA_FOLLOW",
        };
        let (name, table) = match condition.kind {
            ConditionKind::Sign => ("side", String::new()),
            ConditionKind::Floor => ("whole", String::new()),
            ConditionKind::Piece(table) => ("piece", format!("{table}, ")),
        };
        match d.filter(|_| f.shape.along.is_some_and(|moving| self.takes_rate(id, moving))) {
            Some(d) => format!("ha_{name}_along(m, {hold}, {}, {table}{a}, {d}, t)", id.0),
            None => format!("ha_{name}(m, {hold}, {}, {table}{a})", id.0),
        }
    }

    fn table(
        &self,
        f: &mut Body,
        (out, order): (u32, usize),
        (a, d): (&str, Option<&str>),
        (table, piece, number): (u32, Option<ConditionId>, usize),
    ) {
        let piece = match piece {
            Some(condition) => format!("(int){}", self.condition(f, condition, a, d)),
            None => format!("ha_piece_of(&ha_tables[{table}], {a})"),
        };
        let _ = writeln!(f.text, "    double q{number}[4];");
        let _ = writeln!(f.text, "    ha_table_on(&ha_tables[{table}], {piece}, {a}, q{number});");
        let rate = d.map(|d| format!("ha_along(q{number}[{}], {d})", order + 1));
        self.put(f, out, &format!("q{number}[{order}]"), rate.as_deref());
    }

    pub fn put(&self, f: &mut Body, out: u32, value: &str, rate: Option<&str>) {
        let name = f.names[out as usize].as_ref().map_or(String::new(), |name| format!(" /* {} */", comment(name)));
        let _ = match f.wide[out as usize] {
            true => writeln!(f.text, "    const ha_wide v{out} = HA_WIDE({value});{name}"),
            false => writeln!(f.text, "    const double v{out} = {value};{name}"),
        };
        if f.place[out as usize] != usize::MAX {
            let array = if f.wide[out as usize] { "wide" } else { "w" };
            let _ = writeln!(f.text, "    m->{array}[{}] = v{out};", f.place[out as usize]);
        }
        self.keep(f, out);
        if let Some(rate) = rate {
            self.put_rate(f, out, rate);
        }
    }

    fn put_rate(&self, f: &mut Body, out: u32, rate: &str) {
        let _ = match f.wide[out as usize] {
            true => writeln!(f.text, "    const ha_wide d{out} = HA_WIDE({rate});"),
            false => writeln!(f.text, "    const double d{out} = {rate};"),
        };
        if f.rate_place[out as usize] != usize::MAX {
            let array = if f.wide[out as usize] { "wide" } else { "w" };
            let _ = writeln!(f.text, "    m->{array}[{}] = d{out};", f.rate_place[out as usize]);
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
    pub text: String,
}

impl Body {
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
    pub values: Vec<String>,
    pub rates: Vec<Option<String>>,
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
    let of = |wanted: Function| {
        let angle = move |step: &Step| match step {
            Step::Op { op: Op::Call(f, a), .. } if *f == wanted => Some(*a),
            _ => None,
        };
        steps.iter().filter_map(angle).collect::<FxHashSet<Arg>>()
    };
    let cosines = of(Function::Cos);
    of(Function::Sin).into_iter().filter(|a| cosines.contains(a)).map(|a| (a, None)).collect()
}

/// The lines of straight code without values that no later line reads.
fn without_the_unused(text: &str) -> String {
    let mut seen: FxHashSet<&str> = FxHashSet::default();
    let mut kept = Vec::new();
    for line in text.lines().rev() {
        let code = line.split(" /* ").next().unwrap_or(line);
        let bare = code.trim_start();
        let declared = bare.strip_prefix("const double ").or_else(|| bare.strip_prefix("const ha_wide "));
        let declared = declared.and_then(|rest| rest.split([' ', '[']).next());
        if declared.is_some_and(|name| !seen.contains(name)) {
            continue;
        }
        seen.extend(code.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_')));
        kept.push(line);
    }
    kept.reverse();
    kept.iter().flat_map(|line| [line, "\n"]).collect()
}
