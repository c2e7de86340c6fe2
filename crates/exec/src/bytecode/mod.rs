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
#[cfg(feature = "machine")]
pub(crate) use conditions::table_on;
pub(crate) use conditions::{Hold, piece_of};
pub(crate) use frame::{Frame, Trouble};
#[cfg(feature = "machine")]
pub(crate) use frame::{InnerCode, PIVOT_BELOW, slope_of_power};
pub(crate) use lu::Lu;
#[cfg(feature = "machine")]
pub(crate) use operands::{reads, written};
pub(crate) use packed::Packed;
pub(crate) use wide::{Lane, Line, WideFrame};
