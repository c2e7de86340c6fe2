//! What a run computed: a [`Trace`] of named columns with units, written as CSV or drawn as a plot, and the signals that go into a run,
//! read from CSV.
#![forbid(unsafe_code)]

mod csv;
mod input;
mod plot;
#[cfg(feature = "png")]
mod png;
mod trace;
mod whole;

pub use csv::{csv_text, write_csv};
pub use input::{InputError, parse_inputs, read_inputs};
pub use plot::plot;
#[cfg(feature = "png")]
pub use png::{PngError, png};
pub use trace::{Column, Trace};
pub use whole::{WriteError, write_whole};
