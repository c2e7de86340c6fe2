//! Derivatives of values, as values.

use super::Value;
use super::values::{Op, Reads, Values};
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
                false => self.slope(value, &|o| by_root.get(&o).filter(|_| roots.contains_key(&o)).copied()),
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
                if let Some(slope) = self.slope(value, &of) {
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
    pub(super) fn slope(&mut self, value: Value, d: &dyn Fn(Value) -> Option<Value>) -> Option<Value> {
        match self.op(value) {
            Op::Neg(a) => Some(self.neg(d(a)?)),
            Op::Add(a, b) => self.plus_some(d(a), d(b)),
            Op::Sub(a, b) => {
                let minus = d(b).map(|b| self.neg(b));
                self.plus_some(d(a), minus)
            }
            Op::Mul(a, b) => {
                let left = d(a).map(|da| self.times(da, b));
                let right = d(b).map(|db| self.times(a, db));
                self.plus_some(left, right)
            }
            Op::Div(a, b) => {
                let minus = d(b).map(|db| self.times(value, db)).map(|product| self.neg(product));
                let numerator = self.plus_some(d(a), minus)?;
                Some(self.over(numerator, b))
            }
            Op::Powi(a, n) => {
                let (da, factor) = (d(a)?, self.number(f64::from(n)));
                let power = self.powi(a, n - 1);
                let slope = self.times(factor, power);
                Some(self.times(slope, da))
            }
            Op::Pow(a, b) => self.slope_of_power(value, a, b, d(a), d(b)),
            Op::Call(f, a) => {
                let da = d(a)?;
                let slope = self.slope_of_call(f, value, a)?;
                Some(self.times(slope, da))
            }
            Op::Call2(Function::Atan2, y, x) => {
                let (xx, yy) = (self.times(x, x), self.times(y, y));
                let square = self.plus(xx, yy);
                let left = d(y).map(|dy| self.times(x, dy));
                let right = d(x).map(|dx| self.times(y, dx)).map(|product| self.neg(product));
                let numerator = self.plus_some(left, right)?;
                Some(self.over(numerator, square))
            }
            Op::Select(c, a, b) => {
                let zero = self.number(0.0);
                if d(a).is_none() && d(b).is_none() {
                    return None;
                }
                Some(self.select(c, d(a).unwrap_or(zero), d(b).unwrap_or(zero)))
            }
            Op::Table(table, piece, a) => {
                let (da, slope) = (d(a)?, self.op_of(Op::TableSlope(table, piece, a)));
                Some(self.times(slope, da))
            }
            Op::TableSlope(table, piece, a) => {
                let (da, slope) = (d(a)?, self.op_of(Op::TableCurvature(table, piece, a)));
                Some(self.times(slope, da))
            }
            Op::TableCurvature(..) => panic!("no third derivative of a table is ever taken"),
            _ => None,
        }
    }

    pub(super) fn plus_some(&mut self, a: Option<Value>, b: Option<Value>) -> Option<Value> {
        match (a, b) {
            (Some(a), Some(b)) => Some(self.plus(a, b)),
            (one, other) => one.or(other),
        }
    }

    fn slope_of_power(
        &mut self,
        value: Value,
        a: Value,
        b: Value,
        da: Option<Value>,
        db: Option<Value>,
    ) -> Option<Value> {
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
        self.plus_some(left, right)
    }

    /// Derivative of `value = f(a)` by `a`; `None` if it is zero.
    fn slope_of_call(&mut self, f: Function, value: Value, a: Value) -> Option<Value> {
        use Function::*;
        let one = self.number(1.0);
        let over = |this: &mut Self, n: Value, d: Value| this.over(n, d);
        Some(match f {
            Sin => self.op_of(Op::Call(Cos, a)),
            Cos => {
                let sin = self.op_of(Op::Call(Sin, a));
                self.neg(sin)
            }
            Tan => {
                let square = self.times(value, value);
                self.plus(one, square)
            }
            Asin | Acos => {
                let square = self.times(a, a);
                let rest = self.minus(one, square);
                let root = self.op_of(Op::Call(Sqrt, rest));
                let slope = over(self, one, root);
                if f == Asin { slope } else { self.neg(slope) }
            }
            Atan => {
                let square = self.times(a, a);
                let sum = self.plus(one, square);
                over(self, one, sum)
            }
            Exp => value,
            Log => over(self, one, a),
            Log10 => {
                let ten = self.number(std::f64::consts::LN_10);
                let product = self.times(a, ten);
                over(self, one, product)
            }
            Sqrt => {
                let twice = self.plus(value, value);
                over(self, one, twice)
            }
            Abs => self.op_of(Op::Call(Sign, a)),
            Sinh => self.op_of(Op::Call(Cosh, a)),
            Cosh => self.op_of(Op::Call(Sinh, a)),
            Tanh => {
                let square = self.times(value, value);
                self.minus(one, square)
            }
            Sign | Floor | Atan2 | Min | Max | Mod => return None,
        })
    }
}
