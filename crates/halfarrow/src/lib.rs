//! Bond graphs from text to trajectory: load a model, ask it for its causal loops, its equations, its picture, its motion.
//!
//! ```
//! use halfarrow::{Model, Run};
//! let model = Model::from_text("drop.bond", "model Drop\nSe:weight(9.81 N) -> I:mass(1 kg)\n", &[])?;
//! let run = Run { to: 2.0, ..Run::default() };
//! let result = model.simulate(&run, &mut |_| true)?;
//! let speed = result.trace.columns[0].values.last().unwrap();
//! assert!((speed - 9.81 * 2.0).abs() < 1e-6);
//! # Ok::<(), halfarrow::Error>(())
//! ```
#![forbid(unsafe_code)]

mod advice;
mod audited;
mod check;
mod compare;
mod cost;
mod disk;
mod draw;
mod equations;
mod error;
mod export;
mod library;
mod linear_algebra;
mod linearize;
mod loops;
mod model;
mod real_time;
mod report;
mod run;
mod stage;
mod sweep;
mod table_file;
mod verdict;
mod wall_clock;

pub use audited::{AuditReport, Miss};
pub use check::CheckReport;
pub use compare::{Compare, CompareReport, Convergence, OperationsReport, ReferenceReport, Row, TimedRun};
pub use draw::{NamedRuns, Picture};
pub use equations::{AlgebraicReport, Breaks, EquationsReport, StateReport};
pub use error::{Error, Problem};
pub use export::{CostReport, Export, ExportReport, Exported, Target};
pub use halfarrow_compiler::bond_graph::Override;
pub use halfarrow_compiler::compile::Found;
pub use halfarrow_compiler::equations::Form;
pub use halfarrow_draw::{DrawOptions, DrawnPaths, positions};
pub use halfarrow_emit::{File, Real};
pub use halfarrow_sim::fixed_step::FixedMethod;
pub use halfarrow_sim::real_time::{OnMiss, Statistics};
pub use halfarrow_sim::{Failure, Method};
pub use halfarrow_trace::{Column, PlotOptions, Trace, WriteError, csv_text, write_csv, write_parquet, write_whole};
pub use linearize::{
    Linearize, LinearizeReport, Mode, Point, ReachReport, Response, Stability, StateAt, SymbolicReport, Terminal,
    TransferFunction,
};
pub use loops::{ComponentReport, ConservedReport, Count, Counts, LoopReport, LoopsReport, StateMatrix, StorageReport};
pub use model::{Model, format_text, read_text};
pub use real_time::{Durations, RealTimeReport, RealTimeRun, Source, duration, frequency};
pub use report::{Page, Report};
pub use run::{Progress, Record, Run, RunReport, Simulated, Start, StateTolerance, Stopped, Timings};
pub use stage::Stage;
pub use sweep::{Reduce, Reduction, Samples, SetFailure, SetMiss, Sweep, SweepAudit, SweepReport, Vary};
pub use table_file::read_trace;
pub use verdict::Verdict;
