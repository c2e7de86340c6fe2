//! What moves conditions: time alone, or states, and then whether a rate is moved by them.

use super::dataflow::Dataflow;
use super::op::Op;
use super::values::Reads;
use super::{Condition, ConditionId, ConditionKind, EventTrigger, Value};
use crate::algebra::{Interpolation, Table1d};
use crate::ids::{Id, Table};

/// Conditions with what moves them; `integrated` are the values whose bends are events, and `nonsmooth` conditions that
/// are met inside of Newton blocks.
pub(super) fn conditions(
    flow: Dataflow<'_>,
    tables: &[Table1d],
    found: &Table<ConditionId, (Value, ConditionKind)>,
    integrated: Vec<Value>,
    nonsmooth: &[ConditionId],
) -> Table<ConditionId, Condition> {
    let degrees = degrees(flow, tables);
    let events = events(flow, found, integrated, nonsmooth);
    let trigger = |id: ConditionId, operand: Value| match degrees[operand.index()] {
        _ if events[id.index()] => EventTrigger::State,
        _ if flow.values.reads(operand).includes(Reads::STATE) => EventTrigger::RecordedOnly,
        Degree::Curve => EventTrigger::CurvedTime,
        _ => EventTrigger::LinearTime,
    };
    let of = |(id, &(operand, kind))| Condition { operand, kind, trigger: trigger(id, operand) };
    found.iter().map(of).collect()
}

/// For each condition whether states move it and what is integrated reads it, or a condition that is such an event.
fn events(
    flow: Dataflow<'_>,
    found: &Table<ConditionId, (Value, ConditionKind)>,
    mut integrated: Vec<Value>,
    nonsmooth: &[ConditionId],
) -> Vec<bool> {
    let of_state = |c: &ConditionId| flow.values.reads(found[*c].0).includes(Reads::STATE);
    let mut events = vec![false; found.len()];
    let mut more: Vec<ConditionId> = nonsmooth.iter().copied().filter(of_state).collect();
    loop {
        more.iter().for_each(|c| events[c.index()] = true);
        integrated.extend(more.iter().map(|&c| found[c].0));
        let read = flow.varying(&integrated).filter_map(|op| op.condition());
        more = read.filter(|c| of_state(c) && !events[c.index()]).collect();
        if more.is_empty() {
            return events;
        }
    }
}

/// Which values time alone moves, each in proportion to it.
pub(super) fn linear_in_time(flow: Dataflow<'_>, tables: &[Table1d]) -> Vec<bool> {
    degrees(flow, tables).into_iter().map(|degree| degree == Degree::Line).collect()
}

/// How a value depends on time while conditions are held.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Degree {
    Constant,
    Line,
    Curve,
}

/// How each value depends on time.
fn degrees(flow: Dataflow<'_>, tables: &[Table1d]) -> Vec<Degree> {
    let mut degrees: Vec<Degree> = Vec::with_capacity(flow.values.len());
    for (value, op) in flow.values.iter() {
        let of = |v: Value| degrees[v.index()];
        let degree = match op {
            _ if flow.values.reads(value) == Reads::PARAMETERS => Degree::Constant,
            Op::Time => Degree::Line,
            Op::Sign(..) | Op::Floor(..) => Degree::Constant,
            Op::Neg(a) => of(a),
            Op::Add(a, b) | Op::Sub(a, b) => of(a).max(of(b)),
            Op::Mul(a, b) if of(a) == Degree::Constant => of(b),
            Op::Mul(a, b) | Op::Div(a, b) if of(b) == Degree::Constant => of(a),
            Op::Select(c, a, b) if of(c) == Degree::Constant => of(a).max(of(b)),
            Op::Table(t, Some(_), a) if tables[t as usize].interpolation() != Interpolation::Cubic => of(a),
            Op::TableSlope(t, Some(_), _) if tables[t as usize].interpolation() != Interpolation::Cubic => {
                Degree::Constant
            }
            Op::Guess(..) | Op::Solution(..) => Degree::Curve,
            Op::Input(_) | Op::Held(_) | Op::Conserved(_) | Op::State(_) => Degree::Curve,
            _ => {
                let mut most = Degree::Constant;
                op.for_each_operand(|v| most = most.max(of(v)));
                if most == Degree::Constant { most } else { Degree::Curve }
            }
        };
        degrees.push(degree);
    }
    degrees
}
