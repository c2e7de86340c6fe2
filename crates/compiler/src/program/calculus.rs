//! The rules of derivatives, once for all who derive: along a direction in numbers, as values of a program, as machine
//! code, as C.
//!
//! A rule takes what the operation reads and the derivatives of that, `None` where nothing moves, and gives the derivative.

use super::ConditionId;
use crate::algebra::{Function, math};

/// Those who derive: what numbers are to them, and how they compute with them.
pub trait Calculus {
    /// A number, or what stands for one.
    type Number: Copy;
    /// A constant.
    fn number(&mut self, value: f64) -> Self::Number;
    /// `-a`.
    fn neg(&mut self, a: Self::Number) -> Self::Number;
    /// `a + b`.
    fn add(&mut self, a: Self::Number, b: Self::Number) -> Self::Number;
    /// `a - b`.
    fn sub(&mut self, a: Self::Number, b: Self::Number) -> Self::Number;
    /// `a * b`.
    fn mul(&mut self, a: Self::Number, b: Self::Number) -> Self::Number;
    /// `a / b`.
    fn div(&mut self, a: Self::Number, b: Self::Number) -> Self::Number;
    /// `a^n`.
    fn powi(&mut self, a: Self::Number, n: u32) -> Self::Number;
    /// A function of one argument.
    fn call(&mut self, f: Function, a: Self::Number) -> Self::Number;
    /// `a` where the truth value `c` is not 0, else `b`.
    fn select(&mut self, c: Self::Number, a: Self::Number, b: Self::Number) -> Self::Number;
    /// A slope times a rate; what does not move has no rate even where the slope is infinite.
    fn along(&mut self, slope: impl FnOnce(&mut Self) -> Self::Number, rate: Self::Number) -> Self::Number;
    /// The derivative of `value = a^b`, where nothing moves or `value` vanishes without the logarithm.
    fn along_power(&mut self, value: Self::Number, a: Moving<Self>, b: Moving<Self>) -> Option<Self::Number>;
    /// A derivative of a table at `a`, by its order.
    fn table(&mut self, table: (u32, Option<ConditionId>), order: u32, a: Self::Number) -> Self::Number;
}

/// A number with its rate.
pub type Moving<K> = (<K as Calculus>::Number, Option<<K as Calculus>::Number>);

type Rate<K> = Option<<K as Calculus>::Number>;

/// Of what jumps only: none.
pub fn none<K: Calculus, const N: usize>(_: &mut K, _: [Rate<K>; N]) -> Rate<K> {
    None
}

/// Of `-a`.
pub fn opposite<K: Calculus>(k: &mut K, da: Rate<K>) -> Rate<K> {
    da.map(|da| k.neg(da))
}

/// Of `a + b`.
pub fn sum<K: Calculus>(k: &mut K, da: Rate<K>, db: Rate<K>) -> Rate<K> {
    match (da, db) {
        (Some(da), Some(db)) => Some(k.add(da, db)),
        (one, other) => one.or(other),
    }
}

/// Of `a - b`.
pub fn difference<K: Calculus>(k: &mut K, da: Rate<K>, db: Rate<K>) -> Rate<K> {
    match (da, db) {
        (Some(da), Some(db)) => Some(k.sub(da, db)),
        (None, db) => opposite(k, db),
        (da, None) => da,
    }
}

/// Of `a b`.
pub fn of_product<K: Calculus>(k: &mut K, (a, da): Moving<K>, (b, db): Moving<K>) -> Rate<K> {
    let left = da.map(|da| k.along(|_| b, da));
    let right = db.map(|db| k.along(|_| a, db));
    sum(k, left, right)
}

/// Of `value = a / b`.
pub fn of_quotient<K: Calculus>(k: &mut K, value: K::Number, da: Rate<K>, (b, db): Moving<K>) -> Rate<K> {
    let moved = db.map(|db| k.along(|_| value, db));
    let above = difference(k, da, moved)?;
    Some(k.div(above, b))
}

/// Of `a^n`.
pub fn of_whole_power<K: Calculus>(k: &mut K, n: u32, (a, da): Moving<K>) -> Rate<K> {
    let slope = |k: &mut K| {
        let (factor, power) = (k.number(f64::from(n)), k.powi(a, n - 1));
        k.mul(factor, power)
    };
    da.map(|da| k.along(slope, da))
}

/// Of `value = a^b`.
pub fn of_power<K: Calculus>(k: &mut K, value: K::Number, a: Moving<K>, b: Moving<K>) -> Rate<K> {
    if a.1.is_none() && b.1.is_none() { None } else { k.along_power(value, a, b) }
}

/// Of `atan2(a, b)`.
pub fn of_angle<K: Calculus>(k: &mut K, (a, da): Moving<K>, (b, db): Moving<K>) -> Rate<K> {
    let (left, right) = (da.map(|da| k.mul(b, da)), db.map(|db| k.mul(a, db)));
    let above = difference(k, left, right)?;
    let (aa, bb) = (k.mul(a, a), k.mul(b, b));
    let square = k.add(aa, bb);
    Some(k.div(above, square))
}

/// Of `a` or `b`, as `c` says.
pub fn of_choice<K: Calculus>(k: &mut K, (c, _): Moving<K>, da: Rate<K>, db: Rate<K>) -> Rate<K> {
    if da.is_none() && db.is_none() {
        return None;
    }
    let (da, db) = (da.unwrap_or_else(|| k.number(0.0)), db.unwrap_or_else(|| k.number(0.0)));
    Some(k.select(c, da, db))
}

/// Of a table whose derivative of this order is its slope.
pub fn of_table<K: Calculus>(k: &mut K, table: (u32, Option<ConditionId>), order: u32, (a, da): Moving<K>) -> Rate<K> {
    da.map(|da| k.along(|k| k.table(table, order, a), da))
}

/// Of `value = f(a)`.
pub fn of_call<K: Calculus>(k: &mut K, f: Function, value: K::Number, (a, da): Moving<K>) -> Rate<K> {
    if matches!(f, Function::Sign | Function::Floor) {
        return None;
    }
    da.map(|da| k.along(|k| slope_of_call(k, f, value, a), da))
}

/// Derivative of `value = f(a)` by `a`.
fn slope_of_call<K: Calculus>(k: &mut K, f: Function, value: K::Number, a: K::Number) -> K::Number {
    use Function::*;
    let one = |k: &mut K| k.number(1.0);
    let inverse = |k: &mut K, a: K::Number| {
        let one = k.number(1.0);
        k.div(one, a)
    };
    match f {
        Sin => k.call(Cos, a),
        Cos => {
            let sine = k.call(Sin, a);
            k.neg(sine)
        }
        Tan => {
            let (one, square) = (one(k), k.mul(value, value));
            k.add(one, square)
        }
        Asin | Acos => {
            let (one, square) = (one(k), k.mul(a, a));
            let rest = k.sub(one, square);
            let root = k.call(Sqrt, rest);
            let slope = inverse(k, root);
            if f == Asin { slope } else { k.neg(slope) }
        }
        Atan => {
            let (one, square) = (one(k), k.mul(a, a));
            let sum = k.add(one, square);
            inverse(k, sum)
        }
        Exp => value,
        Log => inverse(k, a),
        Log10 => {
            let ten = k.number(std::f64::consts::LN_10);
            let product = k.mul(a, ten);
            inverse(k, product)
        }
        Sqrt => {
            let half = k.number(0.5);
            k.div(half, value)
        }
        Abs => k.call(Sign, a),
        Sinh => k.call(Cosh, a),
        Cosh => k.call(Sinh, a),
        Tanh => {
            let (one, square) = (one(k), k.mul(value, value));
            k.sub(one, square)
        }
        Sign | Floor => k.number(0.0),
        Atan2 | Min | Max | Mod => unreachable!("{} is no call of one argument", f.name()),
    }
}

/// Numbers themselves.
#[derive(Debug, Clone, Copy, Default)]
pub struct Plain;

impl Calculus for Plain {
    type Number = f64;
    #[inline]
    fn number(&mut self, value: f64) -> f64 {
        value
    }
    #[inline]
    fn neg(&mut self, a: f64) -> f64 {
        -a
    }
    #[inline]
    fn add(&mut self, a: f64, b: f64) -> f64 {
        a + b
    }
    #[inline]
    fn sub(&mut self, a: f64, b: f64) -> f64 {
        a - b
    }
    #[inline]
    fn mul(&mut self, a: f64, b: f64) -> f64 {
        a * b
    }
    #[inline]
    fn div(&mut self, a: f64, b: f64) -> f64 {
        a / b
    }
    #[inline]
    fn powi(&mut self, a: f64, n: u32) -> f64 {
        math::powi(a, n)
    }
    #[inline]
    fn call(&mut self, f: Function, a: f64) -> f64 {
        math::call(f, a)
    }
    #[inline]
    fn select(&mut self, c: f64, a: f64, b: f64) -> f64 {
        if c != 0.0 { a } else { b }
    }
    #[inline]
    fn along(&mut self, slope: impl FnOnce(&mut Self) -> f64, rate: f64) -> f64 {
        if rate == 0.0 { 0.0 } else { slope(self) * rate }
    }
    fn along_power(&mut self, value: f64, (a, da): Moving<Self>, (b, db): Moving<Self>) -> Option<f64> {
        let (da, db) = (da.unwrap_or(0.0), db.unwrap_or(0.0));
        let base = if da == 0.0 { 0.0 } else { b * math::pow(a, b - 1.0) * da };
        let exponent = if db == 0.0 || value == 0.0 { 0.0 } else { value * math::call(Function::Log, a) * db };
        Some(base + exponent)
    }
    fn table(&mut self, _: (u32, Option<ConditionId>), _: u32, _: f64) -> f64 {
        unreachable!("whoever has tables derives them")
    }
}

/// No numbers: only whether something moves.
pub(super) struct Whether;

impl Calculus for Whether {
    type Number = ();
    fn number(&mut self, _: f64) {}
    fn neg(&mut self, (): ()) {}
    fn add(&mut self, (): (), (): ()) {}
    fn sub(&mut self, (): (), (): ()) {}
    fn mul(&mut self, (): (), (): ()) {}
    fn div(&mut self, (): (), (): ()) {}
    fn powi(&mut self, (): (), _: u32) {}
    fn call(&mut self, _: Function, (): ()) {}
    fn select(&mut self, (): (), (): (), (): ()) {}
    fn along(&mut self, _: impl FnOnce(&mut Self), (): ()) {}
    fn along_power(&mut self, (): (), _: Moving<Self>, _: Moving<Self>) -> Option<()> {
        Some(())
    }
    fn table(&mut self, _: (u32, Option<ConditionId>), _: u32, (): ()) {}
}
