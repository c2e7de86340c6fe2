//! What a run computed: a [`Trace`] of named columns with units, written as CSV or Parquet or drawn as a plot, and the signals that go into a run,
//! read from CSV.
#![forbid(unsafe_code)]

mod chart;
mod csv;
mod input;
#[cfg(feature = "parquet")]
mod parquet;
#[cfg(not(feature = "parquet"))]
#[path = "parquet/absent.rs"]
mod parquet;
mod plot;
#[cfg(feature = "png")]
mod png;
#[cfg(not(feature = "png"))]
#[path = "png/absent.rs"]
mod png;
mod svg;
mod trace;
mod whole;

pub use chart::{Chart, Curve, Guide, Panel, Scale, ScaleKind, chart};
pub use csv::{CsvTable, csv_text, write_csv};
pub use input::{InputColumn, InputError, InputTable, parse_inputs, read_inputs};
pub use parquet::{ParquetTable, write_parquet};
pub use plot::{PlotOptions, plot, plot_runs};
pub use png::{PngError, png};
pub use trace::{Column, Trace};
pub use whole::{WriteError, write_whole};
