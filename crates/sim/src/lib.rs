//! Integrates `x' = f(t, x)` or `F(t, y, y') = 0` and hands out samples. This crate has never heard of a bond: what it
//! integrates is a
//! [`System`] or an [`ImplicitSystem`] with [`Events`], whose algebra, tables and units are the system's own affair.
#![forbid(unsafe_code)]

mod adjoint;
mod driver;
mod events;
mod failure;
pub mod fixed_step;
mod implicit;
mod implicit_system;
mod jacobian;
mod linear;
mod options;
mod radau;
pub mod real_time;
mod shared;
mod signal;
mod simulate;
mod sparsity;
mod stepwise;
mod system;
mod variable_step;
pub mod wide;

pub use adjoint::{Backwards, Transposed, follow_back};
pub use driver::{Crawl, INSIDE, Nobody, Position, Sink, Stopped, Summary, inside, tick};
pub use events::{Events, StepEnd};
pub use failure::{Affected, Failure, Leap};
pub use implicit::simulate_implicit;
pub use implicit_system::{HybridImplicitSystem, ImplicitSystem, halves, halves_mut};
pub use jacobian::Jacobian;
pub use linear::{Number, SparseLu};
pub use options::{AbsoluteTolerance, Method, Options};
pub use signal::{Signal, SignalError};
pub use simulate::simulate;
pub use sparsity::Sparsity;
pub use stepwise::Stepwise;
pub use system::{HybridSystem, System};
pub use variable_step::magnitudes;
