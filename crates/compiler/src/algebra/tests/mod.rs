//! Laws of the kernel, one line each. Names that start with a capital are positive parameters.

mod laws;
mod numbers;
mod reader;
mod text;
mod zero;
