//! The interpreter of routines.

mod conditions;
mod frame;
mod lu;
mod newton;
mod wide;

pub(crate) use conditions::{Hold, piece_of, table_on};
pub(crate) use frame::{Frame, InnerCode, PIVOT_BELOW, Trouble, slope_of_power};
pub(crate) use lu::Lu;
pub(crate) use wide::{Lane, WideFrame};
