//! Derivatives of values, as values.

use super::calculus::{Calculus, Moving, sum};
use super::op::Op;
use super::values::{Reads, Values};
use super::{ConditionId, Value};
use crate::algebra::Function;
use rustc_hash::FxHashMap;
use smallvec::SmallVec;
use std::collections::{BTreeMap, BTreeSet};

impl Values {
    /// Derivatives of each of `wanted` by each of `guesses`: for each guess those that are not zero, with their places in
    /// `wanted`. All of them were made after `from`.
    ///
    /// A value that reads guesses through one other value alone, its *root* (the argument of a law, say), is derived by
    /// that once for all guesses.
    pub(super) fn derivatives(&mut self, wanted: &[Value], guesses: &[Value], from: usize) -> Vec<Vec<(usize, Value)>> {
        let one = self.number(1.0);
        let end = wanted.iter().map(|v| v.0 as usize + 1).max().unwrap_or(from);
        let mut roots: FxHashMap<Value, Value> = guesses.iter().map(|&g| (g, g)).collect();
        let mut by_root: FxHashMap<Value, Value> = guesses.iter().map(|&g| (g, one)).collect();
        // What reads several roots, by each of these.
        let mut joints: FxHashMap<Value, Vec<Value>> = FxHashMap::default();
        for value in (from..end).map(|i| Value(i as u32)) {
            if by_root.contains_key(&value) || !self.reads(value).includes(Reads::GUESS) {
                continue;
            }
            let mut read: SmallVec<[Value; 3]> = SmallVec::new();
            self.op(value).for_each_operand(|o| read.extend(roots.get(&o).copied()));
            let root = match read.first() {
                None => continue,
                Some(&first) if read.iter().all(|&r| r == first) => first,
                Some(_) => value,
            };
            let slope = match root == value {
                true => Some(one),
                false => self.derivative(value, &|o| by_root.get(&o).filter(|_| roots.contains_key(&o)).copied()),
            };
            if let Some(slope) = slope {
                if root == value {
                    read.into_iter().for_each(|root| joints.entry(root).or_default().push(value));
                }
                roots.insert(value, root);
                by_root.insert(value, slope);
            }
        }
        let mut places: FxHashMap<Value, Vec<usize>> = FxHashMap::default();
        for (place, value) in wanted.iter().enumerate() {
            roots.get(value).into_iter().for_each(|&root| places.entry(root).or_default().push(place));
        }
        let mut columns = Vec::with_capacity(guesses.len());
        for &guess in guesses {
            let mut slopes: BTreeMap<Value, Value> = BTreeMap::from([(guess, one)]);
            let mut open: BTreeSet<Value> = joints.get(&guess).into_iter().flatten().copied().collect();
            while let Some(value) = open.pop_first() {
                let mut read: SmallVec<[(Value, Value); 3]> = SmallVec::new();
                self.op(value).for_each_operand(|o| {
                    if let Some(&slope) = roots.get(&o).and_then(|root| slopes.get(root)) {
                        read.push((o, slope));
                    }
                });
                read.iter_mut().for_each(|(o, slope)| *slope = self.times(by_root[o], *slope));
                let of = |o: Value| read.iter().find(|(v, _)| *v == o).map(|(_, slope)| *slope);
                if let Some(slope) = self.derivative(value, &of) {
                    slopes.insert(value, slope);
                    open.extend(joints.get(&value).into_iter().flatten());
                }
            }
            let at = |root| places.get(root).into_iter().flatten().copied();
            let reached = slopes.iter().flat_map(|(root, &slope)| at(root).map(move |place| (place, slope)));
            let mut column: Vec<(usize, Value)> = reached.collect();
            column.sort_unstable_by_key(|entry| entry.0);
            column.iter_mut().for_each(|(place, slope)| *slope = self.times(by_root[&wanted[*place]], *slope));
            columns.push(column);
        }
        columns
    }

    /// Derivative of a value from those of its operands; `None` if it is zero.
    pub(super) fn derivative(&mut self, value: Value, d: &dyn Fn(Value) -> Option<Value>) -> Option<Value> {
        self.op(value).derivative(self, value, |_, operand| (operand, d(operand)))
    }

    /// A slope times a rate: none where nothing moves, as on the side of a root of `max(a, 0)` on which that is 0, even if the slope
    /// has no end there.
    fn product_of_slope(&mut self, slope: Value, rate: Value) -> Value {
        let zero = Values::number(self, 0.0);
        match self.op(rate) {
            Op::Select(c, a, b) if (a == zero || b == zero) && self.may_be_infinite(slope) => {
                let [a, b] = [a, b].map(|side| if side == zero { zero } else { self.times(slope, side) });
                Values::select(self, c, a, b)
            }
            _ => self.times(slope, rate),
        }
    }

    fn may_be_infinite(&self, slope: Value) -> bool {
        match self.op(slope) {
            Op::Div(..) | Op::Pow(..) => true,
            Op::Neg(a) => self.may_be_infinite(a),
            Op::Mul(a, b) => self.may_be_infinite(a) || self.may_be_infinite(b),
            _ => false,
        }
    }
}

/// Values as numbers: what is trivial is left out.
impl Calculus for Values {
    type Number = Value;
    fn number(&mut self, value: f64) -> Value {
        Values::number(self, value)
    }
    fn neg(&mut self, a: Value) -> Value {
        Values::neg(self, a)
    }
    fn add(&mut self, a: Value, b: Value) -> Value {
        self.plus(a, b)
    }
    fn sub(&mut self, a: Value, b: Value) -> Value {
        self.minus(a, b)
    }
    fn mul(&mut self, a: Value, b: Value) -> Value {
        self.times(a, b)
    }
    fn div(&mut self, a: Value, b: Value) -> Value {
        self.over(a, b)
    }
    fn powi(&mut self, a: Value, n: u32) -> Value {
        Values::powi(self, a, n)
    }
    fn call(&mut self, f: Function, a: Value) -> Value {
        self.op_of(Op::Call(f, a))
    }
    fn select(&mut self, c: Value, a: Value, b: Value) -> Value {
        Values::select(self, c, a, b)
    }
    fn along(&mut self, slope: impl FnOnce(&mut Self) -> Value, rate: Value) -> Value {
        let slope = slope(self);
        self.product_of_slope(slope, rate)
    }
    fn along_power(&mut self, value: Value, (a, da): Moving<Self>, (b, db): Moving<Self>) -> Option<Value> {
        let left = da.map(|da| {
            let one = self.number(1.0);
            let less = self.minus(b, one);
            let power = self.op_of(Op::Pow(a, less));
            let slope = self.times(b, power);
            self.product_of_slope(slope, da)
        });
        let right = db.map(|db| {
            let log = self.op_of(Op::Call(Function::Log, a));
            let slope = self.times(value, log);
            self.times(slope, db)
        });
        sum(self, left, right)
    }
    fn table(&mut self, (table, piece): (u32, Option<ConditionId>), order: u32, a: Value) -> Value {
        match order {
            1 => self.op_of(Op::TableSlope(table, piece, a)),
            2 => self.op_of(Op::TableCurvature(table, piece, a)),
            _ => panic!("no third derivative of a table is ever taken"),
        }
    }
}
