//! Newton's method for a solve block: damped by the restricted natural monotonicity test, with the exact Jacobian, to
//! rounding; and numerical continuation, which keeps a run on one solution. Source: [Deuflhard], chapter 3 (global Newton
//! methods, error oriented: NLEQ-ERR) and chapter 5 (continuation methods).
//!
//! Nonlinear laws may have several solutions. At the start of a run, and after an event, any of them may be taken: the
//! one that continues the previous solution, else the first one found. From then on the solution is *followed*: a root
//! counts as its continuation only if Newton's method contracts towards it from the previous solution at once, or if a
//! path of roots without fold or pole leads there. Other roots are not taken. So rates are those of one solution, and
//! their derivatives are the exact ones of the implicit function theorem. Where the solution followed ends, the run
//! stops.
//!
//! The steps, in the order in which [`search`] takes them:
//!
//! 1. [`damped`]: damped Newton iteration from the previous solution; [`correction`] has its corrections and norms.
//! 2. [`path`]: is the root found the continuation of the previous solution?
//! 3. [`rounding`]: the previous solution may still be a root to rounding; also `floating`, for unknowns that no equation
//!    determines.
//! 4. [`continuation`]: if not, a path of roots is followed, its step length doubled and halved.
//! 5. [`search`], [`scan`], [`least_norm`]: at the start and after events, iterations from other points, and from where
//!    rounding hides some of the equations.
//!
//! [`positions`] that constraints determine go where their motion leads. [`nonsmooth`] is for laws whose derivative jumps.
//!
//! Everything depends on the previous solution ([`Newton::previous`]) and the values the block reads, on nothing else.
//! Evaluations are bounded.

mod continuation;
mod correction;
mod damped;
mod least_norm;
mod nonsmooth;
mod path;
mod positions;
mod rounding;
mod scan;
mod search;
mod workspace;

pub(super) use damped::{CONTRACTION, CONVERGED, LEAST_CORRECTION};
pub(crate) use workspace::{Followed, Newton};

/// A correction below this part of the unknowns that no longer gets shorter is rounding.
pub(in crate::bytecode) const CLOSE_TO_ROUNDING: f64 = 1e-9;
/// A way to a root is far from where the Jacobian is singular if it is at most this part of the distance.
const REGULAR: f64 = 0.01;
