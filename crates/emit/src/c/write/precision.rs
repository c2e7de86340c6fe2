//! What is in double precision whatever real numbers are.

use halfarrow_compiler::program::{Arg, Code, Op, Step};

use super::{Body, Writer};
use crate::Real;
use crate::c::written::{Written, written};

impl Writer<'_> {
    /// The precision of what is in double precision, or in that of real numbers.
    pub(in crate::c) fn precision_of(&self, wide: bool) -> Real {
        if wide { Real::Double } else { self.real }
    }

    /// Which locals are in double precision whatever real numbers are: those that follow from time and parameters alone,
    /// so that time has its digits in long runs.
    pub(super) fn wide(&self, code: &Code) -> Vec<bool> {
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
    pub(super) fn all_timely(&self, step: &Step, wide: &[bool]) -> bool {
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

    /// Whether a step is computed in double precision, and whether its derivative is, if real numbers are less.
    pub(super) fn precision(&self, f: &Body, step: &Step) -> (bool, bool) {
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

    pub(super) fn cast(&self, value: Written, from_wide: bool, to_wide: bool) -> Written {
        cast(value, self.precision_of(from_wide), self.precision_of(to_wide))
    }
}

/// A value of one precision in another.
pub(in crate::c) fn cast(value: Written, from: Real, to: Real) -> Written {
    if from == to { value } else { written!("({}){}", to.kind(), value) }
}
