//! What moves, and its derivatives.

use halfarrow_compiler::program::{Arg, Code, ConditionId, EventTrigger, Op, Step};

use super::{Body, Moving, Place, Reading, Shape, Spot, Writer, crossed};
use crate::c::derivatives::Expressions;
use crate::c::written::{Series, Variable, Written, written};

impl Writer<'_> {
    /// Which locals have derivatives that somebody asks for.
    pub(super) fn moves(&self, code: &Code, shape: Shape, rates: bool) -> Vec<bool> {
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
    pub(super) fn takes_rate(&self, condition: ConditionId, moving: Moving) -> bool {
        moving.time.is_some() && self.program.conditions[condition].trigger != EventTrigger::State
    }

    /// The derivative, if it moves.
    pub(super) fn rate(&self, f: &Body, a: Arg, wide: bool) -> Option<Written> {
        let (spot, is_wide) = self.rate_spot(f, a)?;
        let rate = match a {
            Arg::Local(local) if f.is_variable(local.0 as usize) => {
                written!("{}", f.variables(local.0 as usize)[1])
            }
            _ => spot.written(self.precision_of(is_wide)),
        };
        Some(self.cast(rate, is_wide, wide))
    }

    /// Where the derivative stands, if it moves, and whether that is in double precision; of a variable, where it is kept.
    pub(super) fn rate_spot(&self, f: &Body, a: Arg) -> Option<(Spot, bool)> {
        let moving = f.shape.along?;
        match a {
            Arg::Given(value) => Some((self.givens.rate(value, moving)?, false)),
            Arg::Local(local) => {
                let i = local.0 as usize;
                f.moves[i].then(|| (Spot::Place(crossed(f, f.rate_place[i], i)), f.wide[i]))
            }
            Arg::Outer(i) => moving.outer.then_some((Spot::Place(Place { array: "e", index: i as usize }), false)),
            Arg::Guess(_) => None,
        }
    }

    /// The derivative of an operation by the rules of the table, if it moves.
    pub(super) fn derivative(&self, f: &mut Body, out: u32, op: Op<Arg>, reads: &Reading) -> Option<Written> {
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
}
