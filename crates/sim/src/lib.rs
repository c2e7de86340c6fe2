//! Integrates `x' = f(t, x)` and hands out samples. This crate has never heard of a bond: what it integrates is a
//! [`System`], whose algebra, tables and units are the system's own affair.
#![forbid(unsafe_code)]

mod events;
mod failure;
pub mod fixed_step;
mod grid;
mod jacobian;
mod lu;
mod options;
mod shared;
mod signal;
mod simulate;
mod sparsity;
mod system;
mod variable_step;

pub use failure::Failure;
pub use options::{AbsoluteTolerance, Method, Options};
pub use signal::{Signal, SignalError};
pub use simulate::{Sink, Stopped, Summary, simulate};
pub use sparsity::Sparsity;
pub use system::System;
