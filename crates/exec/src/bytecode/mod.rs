//! The interpreter of routines.

mod block_batch;
mod conditions;
mod elimination;
mod floating;
mod frame;
mod in_turns;
mod instruction;
mod newton;
mod orientation;
mod packed;
mod registers;
mod reverse;
mod wide;

pub(crate) use block_batch::BlockBatches;
#[cfg(feature = "machine")]
pub(crate) use conditions::table_on;
pub(crate) use conditions::{HeldConditions, Hold, piece_of};
pub(crate) use elimination::Lu;
pub(crate) use frame::{Frame, SolveError};
#[cfg(feature = "machine")]
pub(crate) use frame::{InnerCode, PIVOT_BELOW};
pub(crate) use in_turns::InTurns;
#[cfg(feature = "machine")]
pub(crate) use instruction::Register;
pub(crate) use instruction::{Instruction, Operation, Routine, Solve};
pub(crate) use newton::Followed;
pub(crate) use packed::Packed;
pub(crate) use registers::Layout;
pub(crate) use reverse::Weights;
pub(crate) use wide::{HasFrame, Vector, WideFrame};
