//! Functions that machine code calls.

use crate::bytecode::{piece_of, slope_of_power, table_on};
use crate::math;
use halfarrow_compiler::algebra::{Function, Table1d};

/// A function of one argument.
pub(super) fn one(f: Function) -> usize {
    macro_rules! kernels {
        ($($name:ident),*) => { match f {
            $(Function::$name => {
                extern "C" fn kernel(x: f64) -> f64 { math::call(Function::$name, x) }
                kernel as extern "C" fn(f64) -> f64 as usize
            })*
            Function::Atan2 | Function::Min | Function::Max | Function::Mod => unreachable!("it takes two arguments"),
        } };
    }
    kernels!(Sin, Cos, Tan, Asin, Acos, Atan, Exp, Log, Log10, Sqrt, Abs, Sign, Sinh, Cosh, Tanh, Floor)
}

/// Its derivative, of argument and value.
pub(super) fn slope_of_one(f: Function) -> usize {
    macro_rules! kernels {
        ($($name:ident),*) => { match f {
            $(Function::$name => {
                extern "C" fn kernel(x: f64, value: f64) -> f64 { math::slope(Function::$name, x, value) }
                kernel as extern "C" fn(f64, f64) -> f64 as usize
            })*
            Function::Atan2 | Function::Min | Function::Max | Function::Mod => unreachable!("it takes two arguments"),
        } };
    }
    kernels!(Sin, Cos, Tan, Asin, Acos, Atan, Exp, Log, Log10, Sqrt, Abs, Sign, Sinh, Cosh, Tanh, Floor)
}

/// A function of two arguments.
pub(super) fn two(f: Function) -> usize {
    macro_rules! kernels {
        ($($name:ident),*) => { match f {
            $(Function::$name => {
                extern "C" fn kernel(x: f64, y: f64) -> f64 { math::call2(Function::$name, x, y) }
                kernel as extern "C" fn(f64, f64) -> f64 as usize
            })*
            _ => unreachable!("it takes one argument"),
        } };
    }
    kernels!(Atan2, Min, Max, Mod)
}

/// Its derivative, of `x`, `dx`, `y`, `dy`.
pub(super) fn slope_of_two(f: Function) -> usize {
    macro_rules! kernels {
        ($($name:ident),*) => { match f {
            $(Function::$name => {
                extern "C" fn kernel(x: f64, dx: f64, y: f64, dy: f64) -> f64 {
                    math::slope2(Function::$name, (x, dx), (y, dy))
                }
                kernel as extern "C" fn(f64, f64, f64, f64) -> f64 as usize
            })*
            _ => unreachable!("it takes one argument"),
        } };
    }
    kernels!(Atan2, Min, Max, Mod)
}

/// `x` to the power `y`.
pub(super) fn power() -> usize {
    extern "C" fn kernel(x: f64, y: f64) -> f64 {
        math::pow(x, y)
    }
    kernel as extern "C" fn(f64, f64) -> f64 as usize
}

/// Derivative of a power, of its value, `a`, `da`, `b`, `db`.
pub(super) fn slope_of_pow() -> usize {
    extern "C" fn kernel(value: f64, a: f64, da: f64, b: f64, db: f64) -> f64 {
        slope_of_power(value, (a, da), (b, db))
    }
    kernel as extern "C" fn(f64, f64, f64, f64, f64) -> f64 as usize
}

/// Derivative number `order` of a table at `x`, on a piece or, where that is below 0, on the piece that `x` is in.
pub(super) fn table() -> usize {
    extern "C" fn kernel(tables: *const Table1d, index: u64, order: u64, piece: f64, x: f64) -> f64 {
        // SAFETY: code passes on the pointer it got and a number below that of the program's tables.
        #[allow(unsafe_code)]
        let table = unsafe { super::memory::table_at(tables, index) };
        let piece = if piece < 0.0 { piece_of(table, x) } else { piece as usize };
        table_on(table, piece, x)[order as usize]
    }
    kernel as extern "C" fn(*const Table1d, u64, u64, f64, f64) -> f64 as usize
}

/// The piece of a table that `x` is in.
pub(super) fn piece() -> usize {
    extern "C" fn kernel(tables: *const Table1d, index: u64, x: f64) -> f64 {
        // SAFETY: code passes on the pointer it got and a number below that of the program's tables.
        #[allow(unsafe_code)]
        let table = unsafe { super::memory::table_at(tables, index) };
        piece_of(table, x) as f64
    }
    kernel as extern "C" fn(*const Table1d, u64, f64) -> f64 as usize
}
