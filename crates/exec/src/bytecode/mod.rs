//! The interpreter of routines.

mod abreast;
mod conditions;
mod floating;
mod frame;
mod lu;
mod newton;
mod operands;
mod packed;
mod wide;

pub(crate) use abreast::Abreast;
pub(crate) use conditions::{HeldConditions, Hold, piece_of, table_on};
pub(crate) use frame::{Frame, InnerCode, PIVOT_BELOW, Trouble, slope_of_power};
pub(crate) use lu::Lu;
pub(crate) use newton::Followed;
#[cfg(feature = "machine")]
pub(crate) use operands::{reads, written};
pub(crate) use packed::Packed;
pub(crate) use wide::{Lane, Line, WideFrame};
