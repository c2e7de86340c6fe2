//! What a run computed: a [`Trace`] of named columns with units, written as CSV, and the signals that go into a run,
//! read from CSV.
#![forbid(unsafe_code)]

mod csv;
mod input;
mod trace;
mod whole;

pub use csv::{csv_text, write_csv};
pub use input::{InputError, parse_inputs, read_inputs};
pub use trace::{Column, Trace};
pub use whole::{WriteError, write_whole};
