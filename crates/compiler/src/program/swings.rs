//! What turns round and round, arguments of sines and cosines, and edges in time that events move.

use super::op::Op;
use super::triggers::linear_in_time;
use super::values::Reads;
use super::{Condition, EventTrigger, Program, Value};
use crate::algebra::Function;
use crate::ids::Id;

impl Program {
    /// The angles, arguments of sines and cosines, that these values are computed from, but for what parameters alone
    /// determine and for what iterations try: where they go far, the values may go to and fro any number of times.
    pub fn angles(&self, wanted: &[Value]) -> Vec<Value> {
        let live = self.dataflow().live(wanted, false);
        let varies =
            |v: Value| self.values.reads(v) != Reads::PARAMETERS && !self.values.reads(v).includes(Reads::GUESS);
        let angle = |(v, op): (Value, Op)| match op {
            Op::Call(Function::Sin | Function::Cos, angle) if live[v.index()] && varies(angle) => Some(angle),
            _ => None,
        };
        let mut angles: Vec<Value> = self.values.iter().filter_map(angle).collect();
        angles.sort_unstable();
        angles.dedup();
        angles
    }

    /// Those of them that time alone turns, in proportion to it: of sources that swing.
    pub fn turned_by_time(&self, wanted: &[Value]) -> Vec<Value> {
        let mut angles = self.angles(wanted);
        if !angles.is_empty() {
            let linear = linear_in_time(self.dataflow(), &self.tables);
            angles.retain(|angle| linear[angle.index()]);
        }
        angles
    }

    /// Whether there are edges in time that an event moves: conditions on time and discrete variables alone, as those of a pulse
    /// whose width is set by a `when`. They are known as exactly as time is, so that methods of fixed step meet them too.
    pub fn has_moved_edges(&self) -> bool {
        let moved = |condition: &Condition| {
            if condition.trigger != EventTrigger::State {
                return false;
            }
            let (mut by_time, mut by_event) = (false, false);
            for op in self.dataflow().varying(&[condition.operand]) {
                match op {
                    Op::Time => by_time = true,
                    Op::Held(held) if self.held[held as usize].kind.is_discrete() => by_event = true,
                    Op::Held(_) | Op::State(_) | Op::Rate(_) | Op::Input(_) | Op::Conserved(_) | Op::Solution(..) => {
                        return false;
                    }
                    _ => {}
                }
            }
            by_time && by_event
        };
        self.conditions.values().any(moved)
    }
}
