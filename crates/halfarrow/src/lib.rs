//! Bond graphs from text to trajectory: load a model, ask it for its causal loops, its equations, its picture, its motion.
//!
//! ```
//! use halfarrow::{Form, Input, Model, Run, Source};
//! // A model from memory; `Source::open` takes a file, and what lies beside it.
//! let text = "model Cart\ninput push : N = 0\nSe:hand(push) -> 1:axis -> I:cart(2 kg)\naxis -> R:drag(1 N.s/m)\n";
//! let cart = Model::new(Source::text("cart.bond", text), &[])?;
//! assert!(cart.check()?.diagnostics.0.is_empty());
//! // Equations are derived once, and run as often as wanted.
//! let cart = cart.compile(Form::Minimal)?;
//! let push = Input::sampled(4.0, 0.5, |t| if t < 2.0 { 3.0 } else { 0.0 });
//! let run = Run { to: 4.0, inputs: vec![("push".into(), push)], ..Run::default() };
//! let result = cart.simulate(&run, &mut |_| true)?;
//! // Columns in memory, with names and units.
//! let speed = result.trace.columns[0].values.last().unwrap();
//! assert!(*speed > 0.0 && *speed < 3.0);
//! # Ok::<(), halfarrow::Error>(())
//! ```
//!
//! What is heavy is a feature, all of them on by default: `animation` (pages that move), `machine` (machine code), `parquet`,
//! `png`, `fmu`, `real_time`.
//! Without them the library builds for `wasm32-unknown-unknown`; what a build lacks it says where it is asked for.
#![forbid(unsafe_code)]

mod advice;
mod alternatives;
mod animation;
mod audited;
mod check;
mod clock;
mod compare;
mod compiled;
mod components;
mod cost;
mod draw;
mod drift;
mod equations;
mod error;
mod execution;
mod export;
mod families;
mod fit;
mod gradient;
mod halving;
mod input;
mod interface;
#[cfg(feature = "fmu")]
mod library;
mod linear_algebra;
mod linearize;
mod loops;
mod model;
mod modes;
mod names;
mod objective;
mod pieces;
mod quantity;
#[cfg(feature = "real_time")]
mod real_time;
mod report;
mod run;
mod sensitivity;
mod source;
mod stage;
mod stepper;
mod sweep;
mod table_file;
mod verdict;
#[cfg(feature = "real_time")]
mod wall_clock;
mod watch;

pub use animation::{Body, Curve, FRAMES_PER_SECOND, Form as BodyForm, Link, Mesh, Scene};
pub use audited::{AuditReport, Deviation};
pub use check::CheckReport;
pub use compare::{
    Compare, CompareReport, ComparedForms, Convergence, OperationsReport, ReferenceReport, Row, SolvedBlocks, TimedRun,
};
pub use compiled::Compiled;
pub use components::{Component, Entry, Library};
pub use draw::{NamedRuns, Picture};
pub use drift::{DriftReport, SweepDrift};
pub use equations::{AlgebraicReport, Breaks, BriefEquations, EquationsReport, EquationsSize, Length, StateReport};
pub use error::{Error, Problem};
pub use execution::RoutineReport;
pub use export::{CostReport, Export, ExportReport, Exported, Target};
pub use families::Family;
pub use fit::{Beginning, Estimate, Fit, FitParameter, FitReport, FittedRun, Loss, Profile, Sigma};
pub use gradient::{Gradient, Objective, Slope, Weighed};
pub use halfarrow_compiler::bond_graph::NameKind;
pub use halfarrow_compiler::bond_graph::{FileError, Files, NoFiles, Override};
pub use halfarrow_compiler::compile::Found;
pub use halfarrow_compiler::equations::Form;
pub use halfarrow_draw::{DrawOptions, DrawnPaths, positions};
pub use halfarrow_emit::{File, Real};
pub use halfarrow_exec::Execution;
pub use halfarrow_sim::fixed_step::FixedMethod;
pub use halfarrow_sim::real_time::{OnMiss, Statistics};
pub use halfarrow_sim::{Failure, Method};
pub use halfarrow_trace::{Column, PlotOptions, Trace, WriteError, csv_text, write_csv, write_parquet, write_whole};
pub use input::Input;
pub use interface::{Interface, InterfaceInput, InterfaceParameter, InterfaceVariable};
pub use linearize::{
    Linearize, LinearizeReport, Mode, Point, ReachReport, Response, Stability, StateAt, SymbolicReport, Terminal,
    TransferFunction,
};
pub use loops::{ComponentReport, ConservedReport, Count, Counts, LoopReport, LoopsReport, StateMatrix, StorageReport};
pub use model::{Model, format_text, read_text};
pub use names::{Name, Place, listed};
pub use pieces::extremes;
pub use quantity::{duration, frequency};
#[cfg(feature = "real_time")]
pub use real_time::{Durations, Feed, ModesReport, RealTimeReport, RealTimeRun};
pub use report::{Page, Report};
pub use run::{Progress, Record, Run, RunReport, Simulated, Start, StateTolerance, Stopped, Timings};
pub use source::{Disk, Source};
pub use stage::Stage;
pub use stepper::{Snapshot, Stepper};
pub use sweep::{
    Part, Reduce, Reduction, Samples, SetFailure, SetMiss, Sweep, SweepAudit, SweepReport, SweepTable, Vary,
};
pub use table_file::read_trace;
pub use verdict::Verdict;
pub use watch::StageTime;
