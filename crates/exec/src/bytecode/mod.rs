//! The interpreter of routines.

mod conditions;
mod frame;
mod lu;
mod newton;

pub(crate) use conditions::{Hold, piece_of};
pub(crate) use frame::{Frame, Trouble};
pub(crate) use lu::Lu;
