//! Model text to syntax tree.
//!
//! The tree is plain data with a [`Span`](crate::span::Span) on every part. It says what the text says and no more:
//! names are not looked up, units not read, files not opened.

mod counts;
mod format;
mod lexer;
mod parse;
mod text;
mod tree;

pub use counts::{Count, counts};
pub use format::format;
pub use parse::{MAX_DIAGNOSTICS, MAX_TEXT, Parsed, parse};
pub use tree::*;
