//! Steps as C functions: straight lines in chunks, what crosses from one to the next in the model's work array.

use std::cell::RefCell;
use std::fmt::Write;

use halfarrow_compiler::algebra::Function;
use halfarrow_compiler::program::{
    Block, BlockId, Cause, ConditionId, ConditionKind, Layout, Program, Reads, Register,
};
use rustc_hash::{FxHashMap, FxHashSet};

use super::header::comment;
use super::slopes::{call, power, rate_of};
use super::ssa::{Act, Arg, Code, Step};
use super::variables::Variables;
use crate::Real;

/// Steps in one C function: compilers take more than linear time for long ones.
const CHUNK: usize = 250;

/// Symmetric linear equations of up to this many unknowns are written out.
const WRITTEN_OUT: usize = 6;

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
    /// The fixed registers that move, if derivatives are wanted: ranges within the direction.
    pub along: Option<Moving>,
    /// Whether what it gives is in double precision whatever real numbers are.
    pub wide: bool,
}

/// What has derivatives.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Moving {
    pub time: bool,
    pub inputs: bool,
    pub held: bool,
    pub conserved: bool,
    pub states: bool,
    /// What a Newton block reads from outside.
    pub outer: bool,
}

/// Numbers that `lu.c` takes for a matrix: twice the matrix, scales of rows, work, what is left, and in single precision the
/// magnitudes of columns.
pub(super) fn elimination_room(n: usize, real: Real) -> usize {
    2 * n * n + if real == Real::Double { 3 * n } else { 4 * n }
}

/// Where linear blocks with a constant matrix keep their factors.
#[derive(Debug, Clone, Default)]
pub(super) struct Factored {
    /// Number, first place and first place of the order of each such block.
    pub places: FxHashMap<u32, (usize, usize, usize)>,
    /// Numbers taken in all.
    pub size: usize,
    /// Places of orders taken in all.
    pub orders: usize,
}

/// Writes functions.
pub(super) struct Writer<'a> {
    pub program: &'a Program,
    pub layout: &'a Layout,
    /// The place in `m->c` of each fixed register computed from parameters.
    pub derived: FxHashMap<Register, usize>,
    constants: FxHashMap<Register, f64>,
    pub factored: Factored,
    /// Places of the work array taken so far.
    pub crossing: usize,
    variables: Variables,
    /// The size of real numbers.
    pub real: Real,
    /// Places of the array for what crosses in double precision, if real numbers are less.
    pub wide_crossing: usize,
    /// The place of each fixed register computed from parameters that is read in double precision.
    pub exact: RefCell<FxHashMap<Register, usize>>,
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
    pub fn new(program: &'a Program, layout: &'a Layout, real: Real) -> Writer<'a> {
        let constants: FxHashMap<Register, f64> = layout.constants.iter().copied().collect();
        let first = program.parameters.len() as Register;
        let computed = (first..layout.time).filter(|r| !constants.contains_key(r));
        let derived = computed.enumerate().map(|(place, r)| (r, place)).collect();
        let mut factored = Factored::default();
        for (id, block) in program.blocks.iter() {
            let Block::Linear { matrix, .. } = block else { continue };
            let n = block.size();
            if n > 1 && matrix.iter().all(|&v| program.values.reads(v) == Reads::PARAMETERS) {
                let number = factored.places.len();
                factored.places.insert(id.0, (number, factored.size, factored.orders));
                factored.size += elimination_room(n, real);
                factored.orders += n;
            }
        }
        let variables = Variables::of(program, layout);
        Writer {
            program,
            layout,
            derived,
            constants,
            factored,
            crossing: 0,
            variables,
            real,
            wide_crossing: 0,
            exact: RefCell::default(),
        }
    }

    /// A fixed register in C.
    pub fn fixed(&self, r: Register) -> String {
        let l = self.layout;
        match r {
            r if r < self.program.parameters.len() as Register => format!("m->p[{r}]"),
            r if r < l.time => match self.constants.get(&r) {
                Some(&value) => number(value),
                None => format!("m->c[{}]", self.derived[&r]),
            },
            r if r == l.time => "t".into(),
            r if r < l.held => format!("m->u[{}]", r - l.inputs),
            r if r < l.conserved => format!("m->z[{}]", r - l.held),
            r if r < l.states => format!("m->k[{}]", r - l.conserved),
            r => format!("x[{}]", r - l.states),
        }
    }

    /// A fixed register in C, in double precision.
    pub fn fixed_wide(&self, r: Register) -> String {
        let constant = self.constants.contains_key(&r);
        match r {
            _ if self.real == Real::Double || constant || r == self.layout.time => self.fixed(r),
            r if r < self.program.parameters.len() as Register => format!("m->p_exact[{r}]"),
            r if r < self.layout.time => {
                let mut exact = self.exact.borrow_mut();
                let next = exact.len();
                format!("m->c_exact[{}]", exact.entry(r).or_insert(next))
            }
            r => format!("ha_widen({})", self.fixed(r)),
        }
    }

    /// Which locals are in double precision whatever real numbers are: those that follow from time and parameters alone,
    /// so that time has its digits in long runs.
    fn wide(&self, code: &Code) -> Vec<bool> {
        let mut wide = vec![false; code.locals as usize];
        if self.real == Real::Double {
            return wide;
        }
        for step in &code.steps {
            let solved = matches!(
                step.act,
                Act::Linear(_) | Act::Newton(_) | Act::Table(..) | Act::TableSlope(..) | Act::TableCurvature(..)
            );
            let all = step.args.iter().all(|&a| match a {
                Arg::Fixed(r) => r <= self.layout.time,
                Arg::Local(i) => wide[i as usize],
                Arg::Outer(_) | Arg::Guess(_) => false,
            });
            step.outs.iter().for_each(|&out| wide[out as usize] = all && !solved);
        }
        wide
    }

    /// Whether a fixed register moves, and where it stands in the direction.
    fn fixed_rate(&self, r: Register, moving: Moving) -> Option<String> {
        let l = self.layout;
        let moves = match r {
            r if r < l.time => false,
            r if r == l.time => moving.time,
            r if r < l.held => moving.inputs,
            r if r < l.conserved => moving.held,
            r if r < l.states => moving.conserved,
            _ => moving.states,
        };
        moves.then(|| format!("e[{}]", r - l.time))
    }

    /// A function that computes code; `values` says where its outputs go, `rates` where their derivatives go.
    pub fn function(&mut self, name: &str, shape: Shape, code: &Code, values: &[String], rates: &[String]) -> String {
        let moves = self.moves(code, shape, !rates.is_empty());
        let chunks: Vec<&[Step]> = if code.steps.is_empty() { vec![&[]] } else { code.steps.chunks(CHUNK).collect() };
        let mut f = Body {
            shape,
            moves,
            wide: self.wide(code),
            read: code.read(),
            home: vec![0; code.locals as usize],
            place: vec![usize::MAX; code.locals as usize],
            rate_place: vec![usize::MAX; code.locals as usize],
            chunk: 0,
            turns: FxHashMap::default(),
            names: self.variables.of_locals(code),
            text: String::new(),
        };
        for (c, steps) in chunks.iter().enumerate() {
            steps.iter().flat_map(|s| &s.outs).for_each(|&out| f.home[out as usize] = c);
        }
        for (c, steps) in chunks.iter().enumerate() {
            for a in steps.iter().flat_map(|s| &s.args) {
                if let Arg::Local(i) = *a
                    && f.home[i as usize] != c
                {
                    self.cross(&mut f, i as usize);
                }
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
        let mut moves = vec![false; code.locals as usize];
        let Some(moving) = shape.along else { return moves };
        for step in &code.steps {
            let one = step.args.iter().any(|&a| match a {
                Arg::Fixed(r) => self.fixed_rate(r, moving).is_some(),
                Arg::Local(i) => moves[i as usize],
                Arg::Outer(_) => moving.outer,
                Arg::Guess(_) => false,
            });
            let none = matches!(
                step.act,
                Act::Positive | Act::Side(_) | Act::Floor(_) | Act::And | Act::Or | Act::Not | Act::Parameter(_)
            ) || matches!(step.act, Act::Call(Function::Sign | Function::Floor));
            step.outs.iter().for_each(|&out| moves[out as usize] = one && !none);
        }
        let mut asked = vec![false; moves.len()];
        let ask = |asked: &mut Vec<bool>, a: Arg| {
            if let Arg::Local(i) = a {
                asked[i as usize] = true;
            }
        };
        code.outputs.iter().filter(|_| rates).for_each(|&a| ask(&mut asked, a));
        for step in code.steps.iter().rev() {
            let wanted = step.outs.iter().any(|&out| moves[out as usize] && asked[out as usize]);
            let condition = match step.act {
                Act::Side(c)
                | Act::Floor(c)
                | Act::Table(_, Some(c))
                | Act::TableSlope(_, Some(c))
                | Act::TableCurvature(_, Some(c)) => Some(c),
                _ => None,
            };
            let timed = condition.is_some_and(|c| self.takes_rate(c, moving));
            let first = usize::from(step.act == Act::Select);
            if wanted || timed {
                step.args[first..].iter().for_each(|&a| ask(&mut asked, a));
            }
        }
        moves.iter().zip(&asked).map(|(moves, asked)| *moves && *asked).collect()
    }

    /// Whether a condition is taken with the rate of its operand: only what time alone moves is.
    fn takes_rate(&self, condition: ConditionId, moving: Moving) -> bool {
        moving.time && self.program.conditions[condition].cause != Cause::State
    }

    fn outputs(&self, f: &mut Body, code: &Code, (values, rates): (&[String], &[String]), chunks: usize) {
        let here = |a: Arg, f: &Body| match a {
            Arg::Local(i) => f.home[i as usize] == f.chunk,
            _ => f.chunk + 1 == chunks,
        };
        let wanted: Vec<(usize, Arg)> = code.outputs.iter().copied().enumerate().filter(|(_, a)| here(*a, f)).collect();
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
        let fixed: Vec<(Register, Arg)> = code.fixed.iter().copied().filter(|(_, a)| here(*a, f)).collect();
        for (r, a) in fixed {
            let (place, value) = (self.fixed(r), self.arg(f, a, false));
            let _ = writeln!(f.text, "    {place} = {value};");
            if self.real == Real::Float {
                self.keep_exact(f, r, a);
            }
        }
    }

    /// Keeps what follows from parameters in double precision too where that is read, and sees that it fits.
    fn keep_exact(&self, f: &mut Body, r: Register, a: Arg) {
        let value = self.arg(f, a, true);
        let count = self.program.parameters.len();
        if (r as usize) < count || self.exact.borrow().contains_key(&r) {
            let _ = writeln!(f.text, "    {} = {value};", self.fixed_wide(r));
        }
        let _ = writeln!(
            f.text,
            "    if (!ha_fits({value})) {{\n        return ha_fail(m, MODEL_OUT_OF_RANGE, {}, {});\n    }}",
            count.min(r as usize),
            f.shape.time
        );
    }

    /// A value, in double precision or in that of real numbers.
    fn arg(&self, f: &Body, a: Arg, wide: bool) -> String {
        let local = |i: u32| match (f.home[i as usize] == f.chunk, f.wide[i as usize]) {
            (true, _) => format!("v{i}"),
            (false, true) => format!("m->wide[{}]", f.place[i as usize]),
            (false, false) => format!("m->w[{}]", f.place[i as usize]),
        };
        let (text, is_wide) = match a {
            Arg::Fixed(r) if wide => (self.fixed_wide(r), true),
            Arg::Fixed(r) => (self.fixed(r), r == self.layout.time),
            Arg::Local(i) => (local(i), f.wide[i as usize]),
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
            Arg::Fixed(r) => (self.fixed_rate(r, moving)?, false),
            Arg::Local(i) if !f.moves[i as usize] => return None,
            Arg::Local(i) => {
                let (place, is_wide) = (f.rate_place[i as usize], f.wide[i as usize]);
                match f.home[i as usize] == f.chunk {
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
        let all = || {
            step.args.iter().all(|&a| {
                matches!(a, Arg::Local(i) if f.wide[i as usize]) || matches!(a, Arg::Fixed(r) if r <= self.layout.time)
            })
        };
        match step.act {
            Act::Side(_) | Act::Floor(_) => (single, single),
            Act::Table(..) | Act::TableSlope(..) | Act::TableCurvature(..) => (single, false),
            Act::Watch(_) => (single && all(), false),
            _ => {
                let wide = step.outs.first().is_some_and(|&out| f.wide[out as usize]);
                (wide, wide)
            }
        }
    }

    fn step(&self, f: &mut Body, step: &Step, place: usize) {
        let (wide, wide_rate) = self.precision(f, step);
        let a: Vec<String> = step.args.iter().map(|&a| self.arg(f, a, wide)).collect();
        let d: Vec<Option<String>> = step.args.iter().map(|&a| self.rate(f, a, wide_rate)).collect();
        match step.act {
            Act::Watch(watch) => {
                let rounding = 64.0 * if wide { f64::EPSILON } else { self.real.epsilon() };
                let holds = format!("{0} != 0.0 && fabs({0}) > {1} * {2}", a[0], number(rounding), a[1]);
                let holds = if wide { format!("HA_WIDE({holds})") } else { format!("({holds})") };
                let _ = writeln!(
                    f.text,
                    "    if (!{holds}) {{\n        return ha_fail(m, MODEL_VANISHED, {watch}, {});\n    }}",
                    f.shape.time
                );
            }
            Act::Linear(block) => self.linear(f, step, (&a, &d), (block.0, place)),
            Act::Newton(block) => self.newton(f, step, (&a, &d), (block.0, place)),
            Act::Table(table, piece) | Act::TableSlope(table, piece) | Act::TableCurvature(table, piece) => {
                self.table(f, step, (&a[0], d[0].as_deref()), (table, piece, place));
            }
            Act::Call(Function::Sin | Function::Cos) if f.turns.contains_key(&angle(step.args[0])) => {
                self.turn(f, step, (&a, &d), place);
            }
            _ => self.plain(f, step, &a, &d),
        }
    }

    /// One of a sine and a cosine that are computed together.
    fn turn(&self, f: &mut Body, step: &Step, (a, d): (&[String], &[Option<String>]), place: usize) {
        let out = step.outs[0];
        let pair = f.turns.entry(angle(step.args[0])).or_default();
        let number = *pair.get_or_insert(place);
        if number == place {
            let call = format!("ha_turn({}, h{place})", a[0]);
            let _ = match f.wide[out as usize] {
                true => writeln!(f.text, "    ha_wide h{place}[2];\n    HA_WIDE({call});"),
                false => writeln!(f.text, "    double h{place}[2];\n    {call};"),
            };
        }
        let value = format!("h{number}[{}]", usize::from(step.act == Act::Call(Function::Cos)));
        let rate = if f.moves[out as usize] { rate_of(step.act, a, d, &format!("v{out}")) } else { None };
        self.put(f, out, &value, rate.as_deref());
    }

    fn plain(&self, f: &mut Body, step: &Step, a: &[String], d: &[Option<String>]) {
        let out = step.outs[0];
        if let Act::Powi(n) = step.act {
            let wide = f.wide[out as usize];
            let value = power(&mut f.text, (&format!("v{out}"), wide), &a[0], n);
            self.put(f, out, &value, None);
            if f.moves[out as usize] {
                let below = power(&mut f.text, (&format!("d{out}"), wide), &a[0], n.saturating_sub(1));
                let slope = format!("{} * ({below})", number(f64::from(n)));
                let rate = d[0].as_ref().map(|d| format!("ha_along({slope}, {d})"));
                self.put_rate(f, out, &rate.unwrap_or_else(|| "0.0".into()));
            }
            return;
        }
        let value = self.value(f, (step.act, out), a, d);
        let rate = if f.moves[out as usize] { rate_of(step.act, a, d, &format!("v{out}")) } else { None };
        self.put(f, out, &value, rate.as_deref());
    }

    fn value(&self, f: &Body, (act, out): (Act, u32), a: &[String], d: &[Option<String>]) -> String {
        match act {
            Act::Neg => format!("-{}", a[0]),
            Act::Add => format!("{} + {}", a[0], a[1]),
            Act::Sub => format!("{} - {}", a[0], a[1]),
            Act::Mul => format!("{} * {}", a[0], a[1]),
            Act::Div => format!("{} / {}", a[0], a[1]),
            Act::Pow => format!("ha_pow({}, {})", a[0], a[1]),
            Act::Call(function) => call(function, &a[0]),
            Act::Call2(Function::Atan2) => format!("ha_atan2({}, {})", a[0], a[1]),
            Act::Call2(Function::Min) => format!("ha_min({}, {})", a[0], a[1]),
            Act::Call2(Function::Max) => format!("ha_max({}, {})", a[0], a[1]),
            Act::Call2(_) => format!("{0} - {1} * floor({0} / {1})", a[0], a[1]),
            Act::Positive => format!("{} > 0.0 ? 1.0 : 0.0", a[0]),
            Act::And => format!("{} != 0.0 && {} != 0.0 ? 1.0 : 0.0", a[0], a[1]),
            Act::Or => format!("{} != 0.0 || {} != 0.0 ? 1.0 : 0.0", a[0], a[1]),
            Act::Not => format!("{} == 0.0 ? 1.0 : 0.0", a[0]),
            Act::Select => format!("{} != 0.0 ? {} : {}", a[0], a[1], a[2]),
            Act::Parameter(index) => {
                let given = self.fixed_wide(index);
                format!("m->set[{index}] ? {given} : {}", a[0])
            }
            Act::Side(condition) | Act::Floor(condition) => {
                let taken = self.condition(f, condition, &a[0], d[0].as_deref());
                self.cast(taken, true, f.wide[out as usize])
            }
            Act::Powi(_) | Act::Watch(_) | Act::Linear(_) | Act::Newton(_) => unreachable!("written elsewhere"),
            Act::Table(..) | Act::TableSlope(..) | Act::TableCurvature(..) => unreachable!("written elsewhere"),
        }
    }

    fn condition(&self, f: &Body, id: ConditionId, a: &str, d: Option<&str>) -> String {
        let condition = &self.program.conditions[id];
        let hold = match condition.cause {
            Cause::Clock | Cause::Curve => "m->clock_hold",
            Cause::State => "m->state_hold",
            Cause::Shown => "HA_FOLLOW",
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
        step: &Step,
        (a, d): (&str, Option<&str>),
        (table, piece, number): (u32, Option<ConditionId>, usize),
    ) {
        let piece = match piece {
            Some(condition) => format!("(int){}", self.condition(f, condition, a, d)),
            None => format!("ha_piece_of(&ha_tables[{table}], {a})"),
        };
        let _ = writeln!(f.text, "    double q{number}[4];");
        let _ = writeln!(f.text, "    ha_table_on(&ha_tables[{table}], {piece}, {a}, q{number});");
        let at = match step.act {
            Act::TableSlope(..) => 1,
            Act::TableCurvature(..) => 2,
            _ => 0,
        };
        let rate = d.map(|d| format!("ha_along(q{number}[{}], {d})", at + 1));
        self.put(f, step.outs[0], &format!("q{number}[{at}]"), rate.as_deref());
    }

    fn linear(&self, f: &mut Body, step: &Step, (a, d): (&[String], &[Option<String>]), (block, number): (u32, usize)) {
        let n = step.outs.len();
        let fail = format!("        return ha_fail(m, MODEL_SINGULAR, {block}, {});\n    }}", f.shape.time);
        let moves = step.outs.iter().any(|&out| f.moves[out as usize]);
        if n == 1 {
            let _ = writeln!(f.text, "    if (!ha_is_pivot({})) {{\n{fail}", a[0]);
            let out = step.outs[0];
            if !f.read[out as usize] {
                return;
            }
            let rate = moves.then(|| {
                let right = d[1].clone().unwrap_or_else(|| "0.0".into());
                match &d[0] {
                    Some(da) => format!("({right} - {da} * v{out}) / {}", a[0]),
                    None => format!("{right} / {}", a[0]),
                }
            });
            return self.put(f, out, &format!("{} / {}", a[1], a[0]), rate.as_deref());
        }
        let (matrix, right) = a.split_at(n * n);
        let symmetric = self.program.blocks[BlockId(block)].is_symmetric();
        if symmetric && n <= WRITTEN_OUT && !moves && !self.factored.places.contains_key(&block) {
            f.text += &definite(matrix, right, (number, self.real.epsilon()), &fail);
            return self.solved(f, step, number);
        }
        let _ = writeln!(f.text, "    const double a{number}[] = {{{}}};", matrix.join(", "));
        let _ = writeln!(f.text, "    const double b{number}[] = {{{}}};", right.join(", "));
        let _ = writeln!(f.text, "    double s{number}[{n}];");
        let lu = match self.factored.places.get(&block) {
            Some((which, place, order)) => {
                let call =
                    format!("ha_linear_constant(m, {which}, {place}, {order}, {n}, a{number}, b{number}, s{number})");
                let _ = writeln!(f.text, "    if (!{call}) {{\n{fail}");
                format!("ha_lu_at(m->factors + {place}, m->factors_order + {order}, {n})")
            }
            None => {
                let _ = writeln!(f.text, "    if (!ha_linear(m, {n}, a{number}, b{number}, s{number})) {{\n{fail}");
                format!("ha_lu_at(m->work, m->order, {n})")
            }
        };
        if moves {
            let zero = |d: &Option<String>| d.clone().unwrap_or_else(|| "0.0".into());
            let (matrix, right) = d.split_at(n * n);
            let (matrix, right): (Vec<_>, Vec<_>) =
                (matrix.iter().map(zero).collect(), right.iter().map(zero).collect());
            let _ = writeln!(f.text, "    const double da{number}[] = {{{}}};", matrix.join(", "));
            let _ = writeln!(f.text, "    const double db{number}[] = {{{}}};", right.join(", "));
            let _ = writeln!(f.text, "    double ds{number}[{n}];");
            let _ = writeln!(f.text, "    ha_linear_rate({lu}, da{number}, db{number}, s{number}, ds{number});");
        }
        self.solved(f, step, number);
    }

    fn newton(&self, f: &mut Body, step: &Step, (a, d): (&[String], &[Option<String>]), (block, number): (u32, usize)) {
        let n = step.outs.len();
        let list = |values: Vec<String>| if values.is_empty() { "0.0".to_string() } else { values.join(", ") };
        let _ = writeln!(f.text, "    const double o{number}[] = {{{}}};", list(a.to_vec()));
        let _ = writeln!(f.text, "    double s{number}[{n}];");
        let which = format!("BLOCK_{block}_");
        if step.outs.iter().any(|&out| f.moves[out as usize]) {
            let rates = d.iter().map(|d| d.clone().unwrap_or_else(|| "0.0".into())).collect();
            let _ = writeln!(f.text, "    const double e{number}[] = {{{}}};", list(rates));
            let _ = writeln!(f.text, "    double ds{number}[{n}];");
            let _ = writeln!(
                f.text,
                "    status = ha_root_along(m, {which}, o{number}, e{number}, s{number}, ds{number});"
            );
        } else {
            let _ = writeln!(f.text, "    status = ha_find_root(m, {which}, o{number}, s{number});");
        }
        let _ = writeln!(
            f.text,
            "    if (status != MODEL_OK) {{\n        return ha_fail(m, status, {block}, {});\n    }}",
            f.shape.time
        );
        self.solved(f, step, number);
    }

    fn solved(&self, f: &mut Body, step: &Step, number: usize) {
        for (i, &out) in step.outs.iter().enumerate() {
            if f.read[out as usize] {
                let rate = f.moves[out as usize].then(|| format!("ds{number}[{i}]"));
                self.put(f, out, &format!("s{number}[{i}]"), rate.as_deref());
            }
        }
    }

    fn put(&self, f: &mut Body, out: u32, value: &str, rate: Option<&str>) {
        let name = f.names[out as usize].as_ref().map_or(String::new(), |name| format!(" /* {} */", comment(name)));
        let _ = match f.wide[out as usize] {
            true => writeln!(f.text, "    const ha_wide v{out} = HA_WIDE({value});{name}"),
            false => writeln!(f.text, "    const double v{out} = {value};{name}"),
        };
        if f.place[out as usize] != usize::MAX {
            let array = if f.wide[out as usize] { "wide" } else { "w" };
            let _ = writeln!(f.text, "    m->{array}[{}] = v{out};", f.place[out as usize]);
        }
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
struct Body {
    shape: Shape,
    moves: Vec<bool>,
    /// Which locals are in double precision whatever real numbers are.
    wide: Vec<bool>,
    read: Vec<bool>,
    /// The chunk that computes each local.
    home: Vec<usize>,
    /// Where a local is kept that crosses from one chunk to another, and where its derivative is.
    place: Vec<usize>,
    rate_place: Vec<usize>,
    chunk: usize,
    /// Angles whose sine and cosine are both wanted in this chunk, with the number of the pair once it is computed.
    turns: FxHashMap<Angle, Option<usize>>,
    /// What the locals are in the model, where they have a name there.
    names: Vec<Option<String>>,
    text: String,
}

/// What a sine reads, to tell equal ones.
type Angle = (u8, u32);

fn angle(a: Arg) -> Angle {
    match a {
        Arg::Fixed(r) => (0, r),
        Arg::Local(i) => (1, i),
        Arg::Outer(i) => (2, i),
        Arg::Guess(i) => (3, i),
    }
}

/// The angles of which some steps want both sine and cosine.
fn turns(steps: &[Step]) -> FxHashMap<Angle, Option<usize>> {
    let of = |wanted: Function| {
        let wanted = steps.iter().filter(move |s| s.act == Act::Call(wanted));
        wanted.map(|s| angle(s.args[0])).collect::<FxHashSet<Angle>>()
    };
    let cosines = of(Function::Cos);
    of(Function::Sin).into_iter().filter(|a| cosines.contains(a)).map(|a| (a, None)).collect()
}

/// Symmetric linear equations, solved as `lu.c` does where the matrix is definite; else by it. Solution in `s<number>`.
fn definite(matrix: &[String], right: &[String], (number, epsilon): (usize, f64), fail: &str) -> String {
    let n = right.len();
    let mut text = format!("    double s{number}[{n}];\n    {{\n");
    let mut line = |words: String| {
        let _ = writeln!(text, "        {words}");
    };
    line(format!("const double sign = copysign(1.0, {});", matrix[0]));
    let mut u: Vec<String> = matrix.to_vec();
    let mut good = Vec::new();
    for k in 0..n {
        line(format!("const double p{k} = sign * {};", u[k * n + k]));
        let rounding = self::number(epsilon * n as f64);
        good.push(format!("p{k} > 0.0 && p{k} > {rounding} * (sign * {}) && ha_finite(p{k})", matrix[k * n + k]));
        line(format!("const double i{k} = 1.0 / {};", u[k * n + k]));
        for j in k + 1..n {
            line(format!("const double f{k}_{j} = {} * i{k};", u[k * n + j]));
        }
        for j in k + 1..n {
            for i in j..n {
                line(format!("const double u{k}_{j}_{i} = {} - f{k}_{j} * {};", u[j * n + i], u[k * n + i]));
                u[j * n + i] = format!("u{k}_{j}_{i}");
            }
        }
    }
    line(format!("if ({}) {{", good.join(" && ")));
    right.iter().enumerate().for_each(|(i, b)| line(format!("    double x{i} = {b} + 0.0;")));
    for k in 0..n {
        (k + 1..n).for_each(|j| line(format!("    x{j} -= f{k}_{j} * x{k};")));
    }
    (0..n).for_each(|k| line(format!("    x{k} = x{k} * i{k} + 0.0;")));
    for k in (0..n).rev() {
        (0..k).for_each(|i| line(format!("    x{i} -= f{i}_{k} * x{k};")));
    }
    (0..n).for_each(|i| line(format!("    s{number}[{i}] = x{i};")));
    line("} else {".into());
    line(format!("    const double a[] = {{{}}};", matrix.join(", ")));
    line(format!("    const double b[] = {{{}}};", right.join(", ")));
    line(format!("    if (!ha_linear(m, {n}, a, b, s{number})) {{"));
    fail.lines().for_each(|l| line(l.to_string()));
    line("}".into());
    text += "    }\n";
    text
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
