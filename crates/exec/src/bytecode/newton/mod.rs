//! Newton's method for a solve block: damped by the natural test, exact Jacobian, to rounding.
//!
//! A law may have several solutions. At the start of a run, and after a jump, any of them may be taken: the one that the
//! equations lead to from the last one, else the first one found. From then on it is *followed*: a solution counts as
//! the same only if the equations run straight towards it from the one accepted last, without a fold or a pole on the
//! way. What Newton finds elsewhere is not taken. So rates are those of one solution, and its slopes are the exact ones
//! of the implicit function theorem. Where the solution followed ends, the run stops.
//!
//! Everything depends on the accepted solution ([`Newton::memory`]) and the values the block reads, on nothing else.
//! Evaluations are bounded.

mod attempt;
mod continuation;
mod nonsmooth;
mod path;
mod rounding;
mod scan;
mod search;
mod workspace;

pub(super) use attempt::{FINISHED, NEAR};
pub(crate) use workspace::{Followed, Newton};

/// A relative step below this that no longer improves the residual is rounding.
pub(in crate::bytecode) const SETTLED: f64 = 1e-9;
