//! Laws of the kernel, one line each. Names that start with a capital are positive parameters.

mod antiderivative;
mod assumptions;
mod eliminate;
mod laws;
mod numbers;
mod random;
mod reader;
mod rewrite;
mod symbols;
mod text;

mod zero;
