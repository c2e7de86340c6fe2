//! Derivatives of values, as values.

use super::calculus::{Calculus, Moving, sum};
use super::op::Op;
use super::values::{Reads, Values};
use super::{ConditionId, Value};
use crate::algebra::Function;
use rustc_hash::FxHashMap;
use smallvec::SmallVec;

impl Values {
    /// Derivatives of each of `wanted` by each of `guesses`, one column a guess. All of them were made after `from`.
    ///
    /// A value that reads guesses through one other value alone, its *root* (the argument of a law, say), is derived by
    /// that once for all guesses.
    pub(super) fn derivatives(&mut self, wanted: &[Value], guesses: &[Value], from: usize) -> Vec<Vec<Value>> {
        let (zero, one) = (self.number(0.0), self.number(1.0));
        let end = wanted.iter().map(|v| v.0 as usize + 1).max().unwrap_or(from);
        let inner: Vec<Value> =
            (from..end).map(|i| Value(i as u32)).filter(|v| self.reads(*v).includes(Reads::GUESS)).collect();
        let mut roots: FxHashMap<Value, Value> = guesses.iter().map(|&g| (g, g)).collect();
        let mut by_root: FxHashMap<Value, Value> = guesses.iter().map(|&g| (g, one)).collect();
        for &value in inner.iter().filter(|v| !guesses.contains(v)) {
            let mut read = Vec::new();
            self.op(value).for_each_operand(|o| read.extend(roots.get(&o)));
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
                roots.insert(value, root);
                by_root.insert(value, slope);
            }
        }
        let joints: Vec<Value> =
            inner.into_iter().filter(|v| roots.get(v) == Some(v) && !guesses.contains(v)).collect();
        let mut columns = Vec::with_capacity(guesses.len());
        for &guess in guesses {
            let mut slopes: FxHashMap<Value, Value> = FxHashMap::from_iter([(guess, one)]);
            for &value in &joints {
                let mut read: SmallVec<[(Value, Value); 3]> = SmallVec::new();
                self.op(value).for_each_operand(|o| {
                    if let Some(&slope) = roots.get(&o).and_then(|root| slopes.get(root)) {
                        read.push((o, slope));
                    }
                });
                if read.is_empty() {
                    continue;
                }
                read.iter_mut().for_each(|(o, slope)| *slope = self.times(by_root[o], *slope));
                let of = |o: Value| read.iter().find(|(v, _)| *v == o).map(|(_, slope)| *slope);
                if let Some(slope) = self.derivative(value, &of) {
                    slopes.insert(value, slope);
                }
            }
            let column = wanted.iter().map(|v| {
                let slope = roots.get(v).and_then(|root| slopes.get(root)).copied();
                slope.map_or(zero, |slope| self.times(by_root[v], slope))
            });
            columns.push(column.collect());
        }
        columns
    }

    /// Derivative of a value from those of its operands; `None` if it is zero.
    pub(super) fn derivative(&mut self, value: Value, d: &dyn Fn(Value) -> Option<Value>) -> Option<Value> {
        self.op(value).derivative(self, value, |_, operand| (operand, d(operand)))
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
        self.times(slope, rate)
    }
    fn along_power(&mut self, value: Value, (a, da): Moving<Self>, (b, db): Moving<Self>) -> Option<Value> {
        let left = da.map(|da| {
            let one = self.number(1.0);
            let less = self.minus(b, one);
            let power = self.op_of(Op::Pow(a, less));
            let slope = self.times(b, power);
            self.times(slope, da)
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
