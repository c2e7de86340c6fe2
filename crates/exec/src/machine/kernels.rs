//! Functions that machine code calls.

use crate::bytecode::{piece_of, table_on};
use crate::math;
use halfarrow_compiler::algebra::{Function, Table1d};
use halfarrow_compiler::for_each_op;
use halfarrow_compiler::program::Op;
use halfarrow_compiler::program::calculus::{Calculus, Plain};

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

/// What an operation means, as a function of its operands; none if something is fixed in it besides them.
#[allow(unused_variables, reason = "what is fixed is not read")]
pub(super) fn of<A: Copy>(op: Op<A>) -> Option<usize> {
    macro_rules! kernel {
        ([] [$($a:ident)*] $meaning:expr) => {{
            extern "C" fn kernel($($a: f64),*) -> f64 {
                $meaning
            }
            Some(kernel as *const () as usize)
        }};
        ([$($part:ident)+] [$($a:ident)*] $meaning:expr) => { None };
    }
    macro_rules! kernels {
        (($k:ident $value:ident)
         given $given:tt
         plain { $($(#[$plain_doc:meta])* $plain:ident($($part:ident: $kind:ty),*) [$($a:ident $da:ident $A:ident),*] {
            cost: $cost:ident, value: $meaning:expr, text: $text:literal, c: $c:expr, derivative: $derivative:expr,
         })* }
         held $held:tt) => {
            match op {
                $(Op::$plain(..) => kernel!([$($part)*] [$($a)*] $meaning),)*
                _ => None,
            }
        };
    }
    for_each_op!(kernels)
}

/// Derivative of a power, of its value, `a`, `da`, `b`, `db`.
pub(super) fn slope_of_pow() -> usize {
    extern "C" fn kernel(value: f64, a: f64, da: f64, b: f64, db: f64) -> f64 {
        Plain.along_power(value, (a, Some(da)), (b, Some(db))).unwrap_or(0.0)
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
