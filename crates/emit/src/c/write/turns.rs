//! What cells of a model have in common as loops: which steps are alike, and a turn of those that are.

use halfarrow_compiler::algebra::Function as Elementary;
use halfarrow_compiler::program::{Arg, Code, Method, Op, Repetition, Step};
use rustc_hash::FxHashMap;
use std::collections::BTreeMap;

use super::steps::{turns, what_fails};
use super::{Body, Place, Reading, Spot, Writer};
use crate::c::written::{Line, Series, Variable, Written, written};

/// What a step does, and where what it reads stands: of its array, whether in double precision, the array of its derivative.
type Class = (&'static str, bool, Option<&'static str>);

/// What is the same in all steps that a line of a loop may stand for.
#[derive(PartialEq, Eq, Hash)]
struct Kind {
    does: Does,
    is_wide: bool,
    moves: bool,
    is_read: bool,
    /// Whether it is kept for others, and whether in double precision too.
    kept: Option<bool>,
    /// The arrays in which it is wanted.
    outputs: Vec<&'static str>,
}

#[derive(PartialEq, Eq, Hash)]
enum Does {
    Op(Op<Class>),
    Guard([Class; 2]),
    Quotient([Class; 2]),
    /// What no other step does.
    Only(usize),
}

/// How something that a step reads depends on the turn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Operand {
    /// It is what the same turn has found.
    OfTurn,
    /// It is the same in all turns.
    Same,
    /// It is what the turn before has found: in all turns this local of the first one.
    OfTurnBefore(usize),
    /// Another in each turn.
    Varying,
}

/// What the steps that stand in a place of the turns read there, operand by operand.
pub(super) fn operands(code: &Code, r: Repetition, at: usize) -> Vec<Vec<Arg>> {
    let mut all: Vec<Vec<Arg>> = Vec::new();
    for turn in 0..r.turns {
        let mut operand = 0;
        code.steps[at + turn * r.length].for_each_read(|a| {
            if turn == 0 {
                all.push(Vec::with_capacity(r.turns));
            }
            all[operand].push(a);
            operand += 1;
        });
    }
    all
}

/// How an operand depends on the turn.
pub(super) fn operand(f: &Body, r: Repetition, args: &[Arg]) -> Operand {
    match first_definition(f, r, args) {
        Some(at) if (r.first..r.first + r.length).contains(&at) => return Operand::OfTurn,
        Some(at) if at < r.first && at + r.length >= r.first => {
            // What stands before the loop may be one of several that a step finds.
            if let Some(Arg::Local(next)) = args.get(1) {
                return Operand::OfTurnBefore(next.0 as usize);
            }
        }
        _ => {}
    }
    let of_loop = |i: usize| (r.first..r.end()).contains(&f.definition[i]);
    match args[0] {
        Arg::Local(i) if of_loop(i.0 as usize) => Operand::Varying,
        first if args.iter().all(|a| *a == first) => Operand::Same,
        _ => Operand::Varying,
    }
}

/// The step that defines an operand of the first turn, if in all turns it is as far from them.
pub(super) fn first_definition(f: &Body, r: Repetition, args: &[Arg]) -> Option<usize> {
    let of = |a: &Arg| if let Arg::Local(i) = a { Some(f.definition[i.0 as usize]) } else { None };
    let first = of(args.first()?)?;
    let follows = |(turn, a): (usize, &Arg)| of(a) == Some(first + turn * r.length);
    args.iter().enumerate().all(follows).then_some(first)
}

impl Writer<'_> {
    /// Where the steps of a function repeat each other.
    pub(super) fn repetitions(&self, f: &Body, places: (&[Place], &[Place])) -> Vec<Repetition> {
        if !Repetition::may_pay(f.code.steps.len()) {
            return Vec::new();
        }
        let mut known: FxHashMap<Kind, u32> = FxHashMap::default();
        let mut kind = |at: usize| {
            let next = known.len() as u32;
            *known.entry(self.kind(f, at, places)).or_insert(next)
        };
        let kinds: Vec<u32> = (0..f.code.steps.len()).map(&mut kind).collect();
        f.code.repetitions(&kinds)
    }

    fn kind(&self, f: &Body, at: usize, (values, rates): (&[Place], &[Place])) -> Kind {
        let step = &f.code.steps[at];
        let (wide, _) = self.precision(f, step);
        let class = |a: Arg| {
            let array = |spot: &Spot| match spot {
                Spot::Number(_) => "",
                Spot::Place(place) => place.array,
                Spot::Written(_) => "t",
            };
            let (spot, is_wide) = self.spot(f, a, wide);
            (array(&spot), is_wide, self.rate_spot(f, a).map(|(rate, _)| array(&rate)))
        };
        let does = match step {
            Step::Op { op, .. } => Does::Op(op.map_operands(class)),
            Step::Guard { pivot, scale, .. } => Does::Guard([class(*pivot), class(*scale)]),
            Step::Solve(solve) => match &solve.method {
                Method::Linear { matrix, right, .. } if solve.unknowns.len() == 1 => {
                    Does::Quotient([class(matrix[0]), class(right[0])])
                }
                _ => Does::Only(at),
            },
            Step::Parameter { .. } => Does::Only(at),
        };
        let Some(out) = step.defines().first().map(|out| out.0) else {
            return Kind { does, is_wide: wide, moves: false, is_read: false, kept: None, outputs: Vec::new() };
        };
        let i = out as usize;
        let wanted = f.outputs[i].iter().flat_map(|&o| [values.get(o), rates.get(o)]).flatten();
        Kind {
            does,
            is_wide: f.wide[i],
            moves: f.moves[i],
            is_read: f.read[i],
            kept: f.kept.get(&out).map(|&given| self.givens.is_exact(given)),
            outputs: wanted.map(|place| place.array).collect(),
        }
    }

    /// A loop.
    pub(super) fn turn_loop(&self, f: &mut Body, r: Repetition, places: (&[Place], &[Place])) {
        let before = std::mem::take(&mut f.lines);
        f.turning = Some(r);
        (r.first..r.first + r.length).for_each(|at| name_by_ends(f, at));
        let angles = std::mem::replace(&mut f.turns, common_angles(f.code, r));
        (r.first..r.first + r.length).for_each(|at| self.step(f, at));
        (r.first..r.first + r.length).for_each(|at| self.outputs_of_turn(f, at, places));
        let carried = carried(f, r);
        carried.keys().for_each(|&local| go_on(f, local));
        f.turns = angles;
        f.turning = None;
        let body = std::mem::replace(&mut f.lines, before);
        carried.into_iter().for_each(|(local, start)| self.begin(f, local, start));
        self.in_loop(f, r.turns, body);
    }

    /// Lines with so many turns.
    pub(super) fn in_loop(&self, f: &mut Body, turns: usize, body: Vec<Line>) {
        std::mem::take(&mut f.tables.declared).into_iter().for_each(|table| f.line(table, 0));
        f.line(written!("    for ({0} = 0; {0} < {1}; ++{0}) {{", Variable::Turn, turns), 0);
        f.lines.extend(body.into_iter().map(indented));
        f.line(Written::of("    }"), 0);
    }

    /// What a step reads in all turns.
    pub(super) fn reading_in_turns(
        &self,
        f: &mut Body,
        (r, at): (Repetition, usize),
        (wide, wide_rate): (bool, bool),
    ) -> Reading {
        let numbers: Vec<usize> = f.turns_of(at).map(what_fails).collect();
        let mut reads = Reading { which: f.tables.index(&numbers), values: Vec::new(), rates: Vec::new() };
        for args in operands(f.code, r, at) {
            let how = operand(f, r, &args);
            if let Operand::OfTurnBefore(local) = how {
                let [value, rate] = before(local);
                reads.values.push(self.cast(written!("{}", value), f.wide[local], wide));
                let moves = f.moves[local];
                reads.rates.push(moves.then(|| self.cast(written!("{}", rate), f.wide[local], wide_rate)));
            } else if how == Operand::Varying {
                let spots = args.iter().map(|&a| self.spot(f, a, wide)).collect();
                reads.values.push(self.series(f, spots, wide));
                let rates: Option<Vec<(Spot, bool)>> = args.iter().map(|&a| self.rate_spot(f, a)).collect();
                reads.rates.push(rates.map(|spots| self.series(f, spots, wide_rate)));
            } else {
                reads.values.push(self.arg(f, args[0], wide));
                reads.rates.push(self.rate(f, args[0], wide_rate));
            }
        }
        reads
    }

    /// Declares what the turn before has found of a local, as the first turn reads it.
    fn begin(&self, f: &mut Body, local: usize, start: Arg) {
        let wide = f.wide[local];
        let kind = self.precision_of(wide).kind();
        let [value, rate] = before(local);
        let start_value = self.arg(f, start, wide);
        f.constant(value, written!("    {} {} = {};", kind, value.to_string(), start_value), 1);
        if let Some(start_rate) = self.rate(f, start, wide).filter(|_| f.moves[local]) {
            f.constant(rate, written!("    {} {} = {};", kind, rate.to_string(), start_rate), 1);
        }
    }

    /// What stands in these places in the turns of a loop, or in the one place where there is no loop.
    pub(super) fn series(&self, f: &mut Body, spots: Vec<(Spot, bool)>, wide: bool) -> Written {
        let is_wide = spots[0].1;
        let real = self.precision_of(is_wide);
        let value = match &spots[0].0 {
            first if spots.len() == 1 => first.clone().written(real),
            Spot::Number(_) => {
                let number = |spot: &(Spot, bool)| if let Spot::Number(value) = spot.0 { value } else { f64::NAN };
                f.tables.number(&spots.iter().map(number).collect::<Vec<_>>(), real)
            }
            Spot::Place(Place { array, .. }) => {
                let index = |spot: &(Spot, bool)| if let Spot::Place(p) = &spot.0 { p.index } else { usize::MAX };
                written!("{}[{}]", array, f.tables.index(&spots.iter().map(index).collect::<Vec<_>>()))
            }
            Spot::Written(written) => written.clone(),
        };
        self.cast(value, is_wide, wide)
    }

    /// Puts what is wanted of a turn where it is wanted.
    fn outputs_of_turn(&self, f: &mut Body, at: usize, (values, rates): (&[Place], &[Place])) {
        let Some(&out) = f.code.steps[at].defines().first() else { return };
        for which in 0..f.outputs[out.0 as usize].len() {
            let of = |step: &Step| f.outputs[step.defines()[0].0 as usize][which];
            let wanted: Vec<usize> = f.turns_of(at).map(of).collect();
            if !values.is_empty() {
                let place = self.series(f, wanted.iter().map(|&i| (Spot::Place(values[i]), false)).collect(), false);
                let value = self.arg(f, Arg::Local(out), f.shape.wide);
                f.assign(&place, &value);
            }
            if !rates.is_empty() {
                let place = self.series(f, wanted.iter().map(|&i| (Spot::Place(rates[i]), false)).collect(), false);
                let rate = self.rate_or_zero(f, Arg::Local(out));
                f.assign(&place, &rate);
            }
        }
    }
}

/// What turns read of the turn before, with what the first one reads.
pub(super) fn carried(f: &Body, r: Repetition) -> BTreeMap<usize, Arg> {
    let all = (r.first..r.first + r.length).flat_map(|at| operands(f.code, r, at));
    let of = |args: Vec<Arg>| match operand(f, r, &args) {
        Operand::OfTurnBefore(local) => Some((local, args[0])),
        _ => None,
    };
    all.filter_map(of).collect()
}

/// What was found of a local in the turn before, and its derivative.
pub(super) fn before(local: usize) -> [Variable; 2] {
    let local = local as u32;
    [Series::Before(local), Series::RateBefore(local)].map(Variable::Number)
}

/// Keeps a value, and its derivative, for the next turn.
fn go_on(f: &mut Body, local: usize) {
    let found = [Series::Value(local as u32), Series::Rate(local as u32)].map(Variable::Number);
    for (to, from) in before(local).into_iter().zip(found).take(1 + usize::from(f.moves[local])) {
        f.constant(to, written!("    {} = {};", to.to_string(), from), 0);
    }
}

/// The angles of which all turns want both sine and cosine.
fn common_angles(code: &Code, r: Repetition) -> FxHashMap<Arg, Option<usize>> {
    let steps = r.first..r.first + r.length;
    let mut angles = turns(code.steps[steps.clone()].iter());
    angles.retain(|angle, _| {
        let reads = |at: &usize| {
            matches!(&code.steps[*at], Step::Op { op: Op::Call(Elementary::Sin | Elementary::Cos, a), .. } if a == angle)
        };
        let mut all = steps.clone().filter(reads).map(|at| operands(code, r, at).remove(0));
        let first = all.next();
        all.all(|args| Some(args) == first)
    });
    angles
}

/// Gives what a line finds the names that it has in the first and in the last turn.
fn name_by_ends(f: &mut Body, at: usize) {
    let ends = [f.turns_of(at).next(), f.turns_of(at).last()];
    let locals = ends.map(|step| step.and_then(|step| step.defines().first()).map(|out| out.0 as usize));
    let [Some(first), Some(last)] = locals else { return };
    f.names[first] = match (&f.names[first], &f.names[last]) {
        (Some(a), Some(b)) if a != b => Some(format!("{a} ... {b}")),
        (Some(a), Some(_)) => Some(a.clone()),
        _ => None,
    };
}

fn indented(mut line: Line) -> Line {
    line.written.text = format!("    {}", line.written.text.replace('\n', "\n    "));
    line
}
