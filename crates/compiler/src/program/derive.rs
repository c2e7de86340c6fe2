//! Derivatives of values by the guesses of a Newton block, as values.

use super::Value;
use super::lower::Lowering;
use super::values::{Op, Reads};
use crate::algebra::Function;
use rustc_hash::FxHashMap;

impl Lowering<'_> {
    /// Derivative of each of `wanted` by `guess`. All of them were made after `from`.
    pub fn derivatives(&mut self, wanted: &[Value], guess: Value, from: usize) -> Vec<Value> {
        let zero = self.constant(0.0);
        let one = self.constant(1.0);
        let end = wanted.iter().map(|v| v.0 as usize + 1).max().unwrap_or(from);
        let mut slopes: FxHashMap<Value, Value> = FxHashMap::from_iter([(guess, one)]);
        for index in from..end {
            let value = Value(index as u32);
            if self.values.reads(value).includes(Reads::GUESS)
                && let Some(slope) = self.slope(value, &slopes)
            {
                slopes.entry(value).or_insert(slope);
            }
        }
        wanted.iter().map(|v| slopes.get(v).copied().unwrap_or(zero)).collect()
    }

    /// Derivative of a value from those of its operands; `None` if it is zero.
    fn slope(&mut self, value: Value, slopes: &FxHashMap<Value, Value>) -> Option<Value> {
        let d = |v: Value| slopes.get(&v).copied();
        match self.values.op(value) {
            Op::Neg(a) => Some(self.neg(d(a)?)),
            Op::Add(a, b) => self.plus(d(a), d(b)),
            Op::Sub(a, b) => {
                let minus = d(b).map(|b| self.neg(b));
                self.plus(d(a), minus)
            }
            Op::Mul(a, b) => {
                let left = d(a).map(|da| self.mul(da, b));
                let right = d(b).map(|db| self.mul(a, db));
                self.plus(left, right)
            }
            Op::Div(a, b) => {
                let minus = d(b).map(|db| self.mul(value, db)).map(|product| self.neg(product));
                let numerator = self.plus(d(a), minus)?;
                Some(self.div(numerator, b))
            }
            Op::Powi(a, n) => {
                let (da, factor) = (d(a)?, self.constant(f64::from(n)));
                let power = self.powi(a, n - 1);
                let slope = self.mul(factor, power);
                Some(self.mul(slope, da))
            }
            Op::Pow(a, b) => self.slope_of_power(value, a, b, d(a), d(b)),
            Op::Call(f, a) => {
                let da = d(a)?;
                let slope = self.slope_of_call(f, value, a)?;
                Some(self.mul(slope, da))
            }
            Op::Call2(Function::Atan2, y, x) => {
                let (xx, yy) = (self.mul(x, x), self.mul(y, y));
                let square = self.add(xx, yy);
                let left = d(y).map(|dy| self.mul(x, dy));
                let right = d(x).map(|dx| self.mul(y, dx)).map(|product| self.neg(product));
                let numerator = self.plus(left, right)?;
                Some(self.div(numerator, square))
            }
            Op::Select(c, a, b) => {
                let zero = self.constant(0.0);
                if d(a).is_none() && d(b).is_none() {
                    return None;
                }
                Some(self.select(c, d(a).unwrap_or(zero), d(b).unwrap_or(zero)))
            }
            Op::Table(table, piece, a) => {
                let (da, slope) = (d(a)?, self.op(Op::TableSlope(table, piece, a)));
                Some(self.mul(slope, da))
            }
            _ => None,
        }
    }

    fn plus(&mut self, a: Option<Value>, b: Option<Value>) -> Option<Value> {
        match (a, b) {
            (Some(a), Some(b)) => Some(self.add(a, b)),
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
            let one = self.constant(1.0);
            let less = self.sub(b, one);
            let power = self.op(Op::Pow(a, less));
            let slope = self.mul(b, power);
            self.mul(slope, da)
        });
        let right = db.map(|db| {
            let log = self.op(Op::Call(Function::Log, a));
            let slope = self.mul(value, log);
            self.mul(slope, db)
        });
        self.plus(left, right)
    }

    /// Derivative of `value = f(a)` by `a`; `None` if it is zero.
    fn slope_of_call(&mut self, f: Function, value: Value, a: Value) -> Option<Value> {
        use Function::*;
        let one = self.constant(1.0);
        let over = |this: &mut Self, n: Value, d: Value| this.div(n, d);
        Some(match f {
            Sin => self.op(Op::Call(Cos, a)),
            Cos => {
                let sin = self.op(Op::Call(Sin, a));
                self.neg(sin)
            }
            Tan => {
                let square = self.mul(value, value);
                self.add(one, square)
            }
            Asin | Acos => {
                let square = self.mul(a, a);
                let rest = self.sub(one, square);
                let root = self.op(Op::Call(Sqrt, rest));
                let slope = over(self, one, root);
                if f == Asin { slope } else { self.neg(slope) }
            }
            Atan => {
                let square = self.mul(a, a);
                let sum = self.add(one, square);
                over(self, one, sum)
            }
            Exp => value,
            Log => over(self, one, a),
            Log10 => {
                let ten = self.constant(std::f64::consts::LN_10);
                let product = self.mul(a, ten);
                over(self, one, product)
            }
            Sqrt => {
                let twice = self.add(value, value);
                over(self, one, twice)
            }
            Abs => self.op(Op::Call(Sign, a)),
            Sinh => self.op(Op::Call(Cosh, a)),
            Cosh => self.op(Op::Call(Sinh, a)),
            Tanh => {
                let square = self.mul(value, value);
                self.sub(one, square)
            }
            Sign | Floor | Atan2 | Min | Max | Mod => return None,
        })
    }
}
