//! Integrates `x' = f(t, x)` or `F(t, y, y') = 0` and hands out samples. This crate has never heard of a bond: what it
//! integrates is a
//! [`System`] or an [`ImplicitSystem`], whose algebra, tables and units are the system's own affair.
#![forbid(unsafe_code)]

mod events;
mod failure;
pub mod fixed_step;
mod grid;
mod implicit;
mod implicit_system;
mod jacobian;
mod lu;
mod options;
mod radau;
pub mod real_time;
mod scene;
mod shared;
mod signal;
mod simulate;
mod sparsity;
mod system;
mod variable_step;
pub mod wide;

pub use failure::{Failure, Leap};
pub use implicit::simulate_implicit;
pub use implicit_system::ImplicitSystem;
pub use options::{AbsoluteTolerance, Method, Options};
pub use signal::{Signal, SignalError};
pub use simulate::{Crawl, Sink, Stopped, Summary, simulate};
pub use sparsity::Sparsity;
pub use system::System;
pub use variable_step::magnitudes;
