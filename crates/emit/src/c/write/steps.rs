//! Steps in C, one by one.

use halfarrow_compiler::algebra::Function as Elementary;
use halfarrow_compiler::program::{Arg, ConditionId, ConditionKind, EventTrigger, Method, Op, Step};
use rustc_hash::{FxHashMap, FxHashSet};

use super::place::along;
use super::{Body, Place, Reading, Spot, Writer, crossed};
use crate::Real;
use crate::c::derivatives::Expressions;
use crate::c::header::comment;
use crate::c::written::{Needed, Series, Variable, Written, needed, written};

impl Writer<'_> {
    pub(super) fn step(&self, f: &mut Body, place: usize) {
        let step = &f.code.steps[place];
        let (wide, wide_rate) = self.precision(f, step);
        let reads = match f.turning {
            None => self.reading(f, step, (wide, wide_rate)),
            Some(r) => self.reading_in_turns(f, (r, place), (wide, wide_rate)),
        };
        match step {
            Step::Guard { .. } => {
                let vanishes = self.vanishes(&reads.values, self.precision_of(wide));
                f.lines.push(self.fail_if(&vanishes, "VANISHED", &reads.which, f.shape.time));
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

    fn reading(&self, f: &Body, step: &Step, (wide, wide_rate): (bool, bool)) -> Reading {
        let which = written!("{}", what_fails(step));
        let mut reads = Reading { which, values: Vec::new(), rates: Vec::new() };
        step.for_each_read(|a| {
            reads.values.push(self.arg(f, a, wide));
            reads.rates.push(self.rate(f, a, wide_rate));
        });
        reads
    }

    /// Whether a divisor is rounding of what it is the sum of.
    pub(super) fn vanishes(&self, values: &[Written], real: Real) -> Written {
        let (zero, rounding) = (real.number(0.0), real.number(64.0 * real.epsilon()));
        let (size, divisor, scale) = (real.function("fabs"), &values[0], &values[1]);
        written!("!({} != {} && {}({}) > {} * {})", divisor, zero, size, divisor, rounding, scale)
    }

    pub(super) fn operation(&self, f: &mut Body, (out, op): (u32, Op<Arg>), reads: &Reading, place: usize) {
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
    pub(super) fn value(&self, f: &mut Body, out: u32, op: Op<Arg>, reads: &Reading) -> Written {
        let real = self.precision_of(f.wide[out as usize]);
        let mut k = Expressions::new(&mut f.lines, Series::Value(out), real);
        let mut operands = reads.values.iter().map(|a| k.push(a.clone())).collect::<Vec<_>>().into_iter();
        let value = k.operation(op.map_operands(|_| operands.next().expect("as many as operands")));
        k.written(value)
    }

    /// One of a sine and a cosine that are computed together.
    pub(super) fn turn(
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

    pub(super) fn condition(&self, f: &Body, id: ConditionId, a: &Written, d: Option<&Written>) -> Written {
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

    pub(super) fn table(
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

    /// A value, in double precision or in that of real numbers.
    pub(super) fn arg(&self, f: &Body, a: Arg, wide: bool) -> Written {
        let (spot, is_wide) = self.spot(f, a, wide);
        let value = match a {
            Arg::Local(local) if f.is_variable(local.0 as usize) => {
                written!("{}", f.variables(local.0 as usize)[0])
            }
            _ => spot.written(self.precision_of(is_wide)),
        };
        self.cast(value, is_wide, wide)
    }

    /// Where a value stands, and whether that is in double precision; of a variable, where it is kept.
    pub(super) fn spot(&self, f: &Body, a: Arg, wide: bool) -> (Spot, bool) {
        let place = |array, index: u32| (Spot::Place(Place { array, index: index as usize }), false);
        match a {
            Arg::Given(value) if wide => self.givens.wide_spot(value),
            Arg::Given(value) => (self.givens.spot(value), self.givens.is_time(value)),
            Arg::Local(local) => {
                let i = local.0 as usize;
                (Spot::Place(crossed(f, f.place[i], i)), f.wide[i])
            }
            Arg::Outer(i) => place("o", i),
            Arg::Guess(i) => place("g", i),
        }
    }

    /// Declares what a step computes, and puts it where it is read elsewhere.
    pub(in crate::c) fn put(&self, f: &mut Body, out: u32, value: &Written, rate: Option<&Written>) {
        let i = out as usize;
        let name = f.names[i].as_ref().map_or(String::new(), |name| format!(" /* {} */", comment(name)));
        self.declare(f, out, (Series::Value(out), value), (f.place[i], &name));
        self.keep(f, out);
        if let Some(rate) = rate {
            self.put_rate(f, out, rate);
        }
    }

    pub(super) fn put_rate(&self, f: &mut Body, out: u32, rate: &Written) {
        self.declare(f, out, (Series::Rate(out), rate), (f.rate_place[out as usize], ""));
    }

    /// Declares a number of the precision of a local, with a comment, and stores it where it crosses to other chunks.
    pub(super) fn declare(
        &self,
        f: &mut Body,
        out: u32,
        (series, value): (Series, &Written),
        (place, about): (usize, &str),
    ) {
        let (wide, variable) = (f.wide[out as usize], Variable::Number(series));
        let kind = self.precision_of(wide).kind();
        f.constant(variable, written!("    const {} {} = {};{}", kind, variable, value, about), 1);
        if place != usize::MAX {
            let array = if wide { "wide" } else { "w" };
            let index = along(f, place);
            f.assign(&written!("m->{}[{}]", array, index), &written!("{}", variable));
        }
    }
}

/// The number of what fails if a step does.
pub(super) fn what_fails(step: &Step) -> usize {
    match step {
        Step::Guard { guard, .. } => *guard as usize,
        Step::Solve(solve) => solve.block.0 as usize,
        _ => 0,
    }
}

/// The angles of which some steps want both sine and cosine.
pub(super) fn turns<'s>(steps: impl Iterator<Item = &'s Step> + Clone) -> FxHashMap<Arg, Option<usize>> {
    let of = |wanted: Elementary| {
        let angle = move |step: &Step| match step {
            Step::Op { op: Op::Call(f, a), .. } if *f == wanted => Some(*a),
            _ => None,
        };
        steps.clone().filter_map(angle).collect::<FxHashSet<Arg>>()
    };
    let cosines = of(Elementary::Cos);
    of(Elementary::Sin).into_iter().filter(|a| cosines.contains(a)).map(|a| (a, None)).collect()
}
