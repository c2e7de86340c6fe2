//! Model text in, program out: no input or output of its own, no clock, no unsafe.
//!
//! The folders are the pipeline, in order: [`algebra`] is the kernel under all of them.
#![forbid(unsafe_code)]

pub mod algebra;
pub mod ast;
pub mod bond_graph;
pub mod causal_graph;
pub mod causal_paths;
pub mod compile;
pub mod continuation;
pub mod diagnostic;
pub mod equations;
pub mod ids;
pub mod program;
pub mod span;
pub mod textbook;
pub mod unit;

pub use halfarrow_sparse as sparse;
