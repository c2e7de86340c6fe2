//! Integrates `x' = f(t, x)` and hands out samples. This crate has never heard of a bond: what it integrates is a
//! [`System`], whose algebra, tables and units are the system's own affair.
#![forbid(unsafe_code)]

mod failure;
mod sparsity;
mod system;

pub use failure::Failure;
pub use sparsity::Sparsity;
pub use system::System;
