//! What can stand on the command line.

use std::path::PathBuf;

use clap::builder::Styles;
use clap::{Args, Parser, Subcommand, ValueEnum};
use halfarrow::Family;

/// Bond graphs: causality, zero-order causal paths, the smallest equations, and what they do.
#[derive(Debug, Parser)]
#[command(name = "halfarrow", version, styles = Styles::plain(), arg_required_else_help = true)]
#[command(after_help = "\
Exit status: 0 fine, 1 the model is at fault, 2 wrong usage or a file that cannot be written, 3 the run failed or its audit refuses it.
Example:
  halfarrow new car && halfarrow simulate car.bond --to 10 --plot car.svg")]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Write a commented starter model that runs at once
    #[command(after_help = "\
Examples:
  halfarrow new car                        writes car.bond
  halfarrow new --family ladder 1000       writes ladder.bond with 1000 sections; also mesh, beam, chain, grid, fourbars
  halfarrow new --family grid plate 100    writes plate.bond")]
    New(New),
    /// Report everything that is wrong with a model, and what is odd
    #[command(after_help = "Example:\n  halfarrow check car.bond")]
    Check(ModelArguments),
    /// Print a model in the canonical layout
    #[command(after_help = "\
Examples:
  halfarrow fmt car.bond             prints it
  halfarrow fmt --write car.bond     rewrites the file
  halfarrow fmt --check car.bond     exit status 1 if the layout differs")]
    Fmt(Fmt),
    /// List the components that come with the program, or show one
    #[command(after_help = "\
Examples:
  halfarrow library                        all, by the library that has them
  halfarrow library hydraulic              those of std.hydraulic
  halfarrow library electrical.DCMotor     its law, ports, parameters and text")]
    Library(Library),
    /// Print what a stage of the compiler makes of a model
    #[command(after_help = "Example:\n  halfarrow show causal_graph car.bond")]
    Show(Show),
    /// List zero-order causal paths, dependent storages and conserved quantities
    #[command(after_help = "Example:\n  halfarrow loops car.bond --set b=600")]
    Loops(Loops),
    /// Print the equations
    #[command(after_help = "\
Examples:
  halfarrow equations car.bond
  halfarrow equations line.bond --only C3.q,R3.f
  halfarrow equations car.bond --form inverted --format latex > car.tex")]
    Equations(Equations),
    /// Put all formulations beside each other: size, cost, time at equal error, agreement
    #[command(after_help = "\
Examples:
  halfarrow compare car.bond
  halfarrow compare car.bond --to 10 --error 1e-8 --plot work.svg")]
    Compare(Compare),
    /// Linearise: matrices A B C D, poles, zeros, frequency response, controllability, observability
    #[command(after_help = "\
Examples:
  halfarrow linearize car.bond --at equilibrium --plot bode.svg
  halfarrow linearize car.bond --at 2.5 --inputs road --outputs travel,body.f --nyquist nyquist.svg
  halfarrow linearize car.bond --symbolic")]
    Linearize(Linearize),
    /// Compute a trajectory
    #[command(after_help = "\
Examples:
  halfarrow simulate car.bond --to 10
  halfarrow simulate car.bond --to 10 --every 0.01 --out car.csv --plot car.svg
  halfarrow simulate car.bond --to 10s --set ks=20e3 --input road=road.csv --record body.f,damper.e
  halfarrow simulate car.bond --to 10 --solver rk4 --step 1e-3 --out -")]
    Simulate(Box<Simulate>),
    /// Write one page with everything: drawing, causality, paths, equations, comparison, plots, audit
    #[command(after_help = "\
Examples:
  halfarrow report car.bond --out car.html
  halfarrow report car.bond --to 10 --without-comparison --out car.html")]
    Report(Report),
    /// Find parameters from measurements, by least squares with exact derivatives
    #[command(after_help = "\
The data are a CSV file with a column t and those that are compared, in the units of the variables unless its second line
says others. A start value is fitted by the name of its variable: spring.q(0).
Examples:
  halfarrow fit car.bond --data test.csv --outputs travel=z_meas --params 'ks=5 kN/m:50 kN/m,b' --input road=road.csv
  halfarrow fit car.bond --data test.csv --outputs travel=z_meas --sigma travel=1e-3 --params 'ks,b,spring.q(0)' --json")]
    Fit(Box<Fit>),
    /// Run a model with many sets of parameters, on all cores
    #[command(after_help = "\
Writes a row for each set: its number, its parameters, what is kept of the run, and failed = 1 where it did not come to
its end. With euler, heun or rk4 sixteen sets run at once. A sweep that was interrupted goes on where it stopped.
What can be kept: initial, final, min, max, max_abs, mean, rms, time_of_max.
Examples:
  halfarrow sweep car.bond --vary 'ks=lin(10 kN/m,30 kN/m,100)' --vary 'b=log(100,3000,20)' --to 10 --step 1ms \\
      --reduce \"max_abs(body.f),final(spring.q)\" --out sweep.parquet
  halfarrow sweep car.bond --samples sets.csv --to 10 --solver auto --out sweep.csv")]
    Sweep(Box<Sweep>),
    /// Run against the wall clock: a step of fixed length each tick
    #[command(after_help = "\
Inputs and outputs are text with commas between the values: inputs in the order of the model or as name=value, outputs
after the time. The last input before a tick counts. A tick that ends after the next is due is a miss.
Examples:
  halfarrow run car.bond --rate 1kHz --for 60
  halfarrow run car.bond --rate 1kHz --input udp://127.0.0.1:5000 --output udp://127.0.0.1:5001 --record body.f
  halfarrow run car.bond --rate 500Hz --input road=road.csv --solver rosenbrock --json")]
    Run(Box<RunArguments>),
    /// Draw the bond graph with its causal strokes and paths
    #[command(after_help = "\
Examples:
  halfarrow draw car.bond --out car.svg
  halfarrow draw car.bond --out plain.svg --no-paths --no-laws
  halfarrow draw car.bond --out new.svg --keep car.svg --paths 1,3")]
    Draw(Draw),
    /// Write the model as code for elsewhere
    #[command(after_help = "\
Examples:
  halfarrow export c car.bond --out car                C99 into the folder car, with a CMake file
  halfarrow export c car.bond --out car --method heun --step 0.5e-3
  halfarrow export c car.bond --out car --real float   in single precision, for a microcontroller
  halfarrow export fmu3 car.bond --out car.fmu         with a binary by the C compiler cc, or what CC names
  halfarrow export fmu2 car.bond --out car.fmu --source-only
  halfarrow export casadi car.bond --out car.py        for optimal control
  halfarrow export latex car.bond --out car.tex        the equations as a document")]
    Export(Export),
}

/// A model and how to answer.
#[derive(Debug, Args)]
pub struct FileArguments {
    /// The model
    pub file: PathBuf,
    /// Print one JSON object (docs/json.md)
    #[arg(long)]
    pub json: bool,
    /// Let the model import and read tables from this folder too, beside that of its file; may be repeated
    #[arg(long, value_name = "FOLDER")]
    pub allow: Vec<PathBuf>,
}

/// A model, perhaps with other parameters.
#[derive(Debug, Args)]
pub struct ModelArguments {
    #[command(flatten)]
    pub model: FileArguments,
    /// Set a parameter, as in `k=3` or `k=18 kN/m`; may be repeated
    #[arg(long, value_name = "NAME=VALUE", value_parser = pair)]
    pub set: Vec<(String, String)>,
    /// Say on stderr what each stage took, and the memory in use after it
    #[arg(long)]
    pub timings: bool,
}

/// How wide what is printed may be.
#[derive(Debug, Args)]
pub struct PageArguments {
    /// Columns that tables and equations take at most [default: COLUMNS, else those of the terminal, else 80]
    #[arg(long, value_name = "COLUMNS")]
    pub width: Option<usize>,
}

/// `new`.
#[derive(Debug, Args)]
pub struct New {
    /// Name of the model; the file is NAME.bond. With --family it may be left out
    pub name: String,
    /// Write a model of this family instead, whose size is a parameter: to see how cost grows
    #[arg(long, value_name = "FAMILY", value_parser = family)]
    pub family: Option<Family>,
    /// Number of cells of the family, along a side of a mesh or grid
    #[arg(value_name = "N", requires = "family")]
    pub cells: Option<String>,
    /// Print one JSON object (docs/json.md)
    #[arg(long)]
    pub json: bool,
}

/// `fmt`.
#[derive(Debug, Args)]
pub struct Fmt {
    #[command(flatten)]
    pub model: FileArguments,
    /// Rewrite the file instead of printing
    #[arg(long, conflicts_with = "check")]
    pub write: bool,
    /// Print nothing; exit status 1 if the layout differs
    #[arg(long)]
    pub check: bool,
}

/// `library`.
#[derive(Debug, Args)]
pub struct Library {
    /// A library or a component
    pub name: Option<String>,
    #[command(flatten)]
    pub page: PageArguments,
    /// Print one JSON object (docs/json.md)
    #[arg(long)]
    pub json: bool,
}

/// `show`.
#[derive(Debug, Args)]
pub struct Show {
    /// The stage
    pub stage: Stage,
    #[command(flatten)]
    pub model: ModelArguments,
    #[command(flatten)]
    pub branches: ModeArguments,
}

/// Stages that can be shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
#[value(rename_all = "snake_case")]
pub enum Stage {
    /// The syntax tree
    Ast,
    /// Elements, bonds and laws, flattened, in SI
    BondGraph,
    /// The same with causal strokes and the causality of every port
    CausalGraph,
    /// Zero-order causal paths
    CausalPaths,
    /// Equations in evaluation order
    Equations,
    /// What is evaluated while running
    Program,
}

/// Branches of set-valued laws.
#[derive(Debug, Args)]
pub struct ModeArguments {
    /// Branches of set-valued laws, as in `d1=on,d2=off`; the others have those with which runs begin
    #[arg(long, value_name = "BRANCHES")]
    pub mode: Vec<String>,
}

/// `loops`.
#[derive(Debug, Args)]
pub struct Loops {
    #[command(flatten)]
    pub model: ModelArguments,
    #[command(flatten)]
    pub branches: ModeArguments,
    #[command(flatten)]
    pub page: PageArguments,
}

/// Forms of the equations.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Form {
    /// One explicit equation for each independent variable, nothing else
    Minimal,
    /// One explicit equation for each independent speed, no momenta as states
    Kane,
    /// Storages on zero-order paths in derivative causality: implicit equations
    Inverted,
    /// The classical form: integral causality, break variables and multipliers
    Break,
    /// The classical form with resistors first, storages as they come
    Relaxed,
    /// All storages as states, a multiplier for every constraint
    Lagrange,
    /// All storages as states, a stiff spring with a damper for every constraint
    Stiff,
}

/// Ways of writing equations.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// Unicode, as in a textbook
    Text,
    /// LaTeX
    Latex,
    /// One JSON object
    Json,
}

/// `equations`.
#[derive(Debug, Args)]
pub struct Equations {
    #[command(flatten)]
    pub model: ModelArguments,
    #[command(flatten)]
    pub branches: ModeArguments,
    #[command(flatten)]
    pub page: PageArguments,
    /// The formulation
    #[arg(long, default_value = "minimal")]
    pub form: Form,
    /// Only the equations of these variables: names with commas between them
    #[arg(long, value_name = "NAMES")]
    pub only: Vec<String>,
    /// How to write them
    #[arg(long, default_value = "text")]
    pub format: Format,
    /// All of them, however long; else of more than 2000 lines of text the short ones and a summary
    #[arg(long)]
    pub all: bool,
    /// Write them, all of them, into this file
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
}

/// Methods of integration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
#[value(rename_all = "snake_case")]
pub enum Solver {
    /// Explicit with variable step, and BDF when the model proves stiff
    Auto,
    /// Runge-Kutta of order 5(4), variable step
    Explicit,
    /// Backward differentiation formulas, variable step, for stiff models
    Bdf,
    /// Radau IIA of order 5, variable step, for stiff models and the only one for implicit forms
    Radau,
    /// Order 1, fixed step
    Euler,
    /// Order 2, fixed step
    Heun,
    /// Order 4, fixed step
    Rk4,
    /// Order 2, implicit, fixed step
    ImplicitMidpoint,
    /// Order 1, linearly implicit, fixed step, for stiff models
    LinearlyImplicitEuler,
    /// Order 2, linearly implicit, fixed step, for stiff models in real time: one evaluation a step, a Jacobian that is kept
    LinearlyImplicitBdf2,
    /// Order 3, linearly implicit, fixed step, for stiff models
    Rosenbrock,
}

/// What evaluates a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Exec {
    /// Machine code of what is evaluated so often that making it is repaid; the choice and why stand under --timings
    Auto,
    /// Bytecode
    Bytecode,
    /// Machine code, of x86-64 and AArch64
    Machine,
}

/// What large residuals count.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Loss {
    /// Their squares
    Linear,
    /// 2 (sqrt(1 + z) - 1) of the square z: like magnitudes
    SoftL1,
    /// Their squares up to the scale, then like magnitudes
    Huber,
    /// ln(1 + z)
    Cauchy,
    /// arctan z: not more than a bound
    Arctan,
}

/// How to find the start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Start {
    /// As the model says
    Given,
    /// At rest: all rates are zero
    Equilibrium,
}

/// `simulate`.
#[derive(Debug, Args)]
pub struct Simulate {
    #[command(flatten)]
    pub model: ModelArguments,
    #[command(flatten)]
    pub page: PageArguments,
    /// End of the run, in s or with a unit (`10`, `500ms`); it begins at 0
    #[arg(long, value_name = "TIME", value_parser = duration, allow_hyphen_values = true)]
    pub to: f64,
    /// Time between recorded points, in s; without it every step is recorded, of methods of variable step with three points
    /// inside (of the first 2000 steps, with up to 500 variables of at most 20,000)
    #[arg(long, value_name = "TIME", value_parser = duration, allow_hyphen_values = true)]
    pub every: Option<f64>,
    /// The formulation
    #[arg(long, default_value = "minimal")]
    pub form: Form,
    /// Form stiff: square of the ratio of the springs' frequency to the model's own fastest rate [default: 1e6]
    #[arg(long, value_name = "RATIO")]
    pub stiffness: Option<f64>,
    /// Form stiff: damping of the springs, 1 is critical [default: 1]
    #[arg(long, value_name = "RATIO")]
    pub damping: Option<f64>,
    /// The method
    #[arg(long, default_value = "auto")]
    pub solver: Solver,
    /// Step of a method with fixed step, longest step of the others, in s
    #[arg(long, value_name = "TIME", value_parser = duration, allow_hyphen_values = true)]
    pub step: Option<f64>,
    /// Relative error allowed in a step
    #[arg(long, default_value_t = 1e-6, allow_negative_numbers = true)]
    pub rtol: f64,
    /// Absolute error allowed in a step, in the unit of each state [default: scaled to each state]
    #[arg(long, allow_negative_numbers = true)]
    pub atol: Option<f64>,
    /// Differentiate what is recorded by parameters, start values (`body.q(0)`) and constant inputs, exactly: columns
    /// `d(body.f)/d(ks)`; may be repeated
    #[arg(long, value_name = "NAMES")]
    pub sensitivity: Vec<String>,
    /// Differentiate one number that the run comes to, such as `rms(travel)` or `final(body.f)`, by what --sensitivity names, else
    /// by all parameters, at the cost of a few runs
    #[arg(long, value_name = "NUMBER")]
    pub gradient: Option<String>,
    /// Put positions that only speeds keep together back onto the relations between them after each step
    #[arg(long)]
    pub project: bool,
    /// Record reactions that are not unique, of constraints that repeat others, as those of least norm
    #[arg(long)]
    pub minimum_norm: bool,
    /// Give an input by a CSV file: a column `t` and one named as the input, linear between its rows; may be repeated
    #[arg(long, value_name = "NAME=FILE", value_parser = pair)]
    pub input: Vec<(String, String)>,
    /// What evaluates the model: bytecode, machine code, or what is sooner done. Results are the same to the last bit
    #[arg(long, default_value = "auto")]
    pub exec: Exec,
    /// Where to start
    #[arg(long, default_value = "given")]
    pub start: Start,
    /// What to record instead of states and outputs: names with commas between them, or `all`
    #[arg(long, value_name = "NAMES")]
    pub record: Vec<String>,
    /// Where to write the trajectory: a .csv or .parquet file, or `-` for CSV on stdout; may be repeated
    #[arg(long, value_name = "FILE")]
    pub out: Vec<PathBuf>,
    /// Write the units as a second header line of CSV
    #[arg(long)]
    pub units: bool,
    /// Where to plot it: a .svg or .png file; may be repeated
    #[arg(long, value_name = "FILE")]
    pub plot: Vec<PathBuf>,
    /// What to plot instead of all that is recorded: names with commas between them
    #[arg(long, value_name = "NAMES", requires = "plot")]
    pub plot_vars: Vec<String>,
    /// What goes to the right in the plot instead of the time: a name
    #[arg(long, value_name = "NAME", requires = "plot")]
    pub plot_x: Option<String>,
    /// Axes of the plot that are logarithmic
    #[arg(long, requires = "plot")]
    pub plot_log: Option<PlotLog>,
    /// A run to plot over this one: a .csv file of an earlier run, or the same run with other parameters, as in
    /// `ks=20e3,b=500`; may be repeated
    #[arg(long, value_name = "RUN", requires = "plot")]
    pub overlay: Vec<String>,
    /// Where to draw the bond graph: a .svg or .png file; may be repeated
    #[arg(long, value_name = "FILE")]
    pub draw: Vec<PathBuf>,
    /// Where to show the machine as it moves: a .html file, with plots beside it, that opens without a network; results
    /// are taken 60 times a second where --every does not say. What has a shape is shown: bodies and joints of
    /// std.multibody and std.planar, and what the model says of its own (`shape`)
    #[arg(long, value_name = "FILE")]
    pub animate: Vec<PathBuf>,
}

/// Axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum PlotLog {
    /// The one to the right
    X,
    /// The one upwards
    Y,
    /// Both
    Xy,
}

/// `compare`.
#[derive(Debug, Args)]
pub struct Compare {
    #[command(flatten)]
    pub model: ModelArguments,
    #[command(flatten)]
    pub page: PageArguments,
    /// End of the runs, in s [default: ten times the slowest time of the motion near the start]
    #[arg(long, value_name = "TIME", value_parser = duration, allow_hyphen_values = true)]
    pub to: Option<f64>,
    /// Error at which times are compared, relative to the greatest magnitude of each variable
    #[arg(long, default_value_t = 1e-6, allow_negative_numbers = true)]
    pub error: f64,
    /// Give an input by a CSV file: a column `t` and one named as the input, linear between its rows; may be repeated
    #[arg(long, value_name = "NAME=FILE", value_parser = pair)]
    pub input: Vec<(String, String)>,
    /// Runs whose median counts as the time
    #[arg(long, default_value_t = 7)]
    pub repeats: usize,
    /// Time of a run, in s, beyond which no tighter tolerance is tried
    #[arg(long, value_name = "TIME", default_value = "20", value_parser = duration, allow_hyphen_values = true)]
    pub patience: f64,
    /// Time for all of it, in s: what it does not suffice for is left out [default: as long as it takes]
    #[arg(long, value_name = "TIME")]
    pub budget: Option<f64>,
    /// Where to plot work against error: a .svg or .png file; may be repeated
    #[arg(long, value_name = "FILE")]
    pub plot: Vec<PathBuf>,
}

/// `linearize`.
#[derive(Debug, Args)]
pub struct Linearize {
    #[command(flatten)]
    pub model: ModelArguments,
    #[command(flatten)]
    pub page: PageArguments,
    /// Where: `start`, `equilibrium` (near the start) or the time in s that a run has reached
    #[arg(long, default_value = "start", value_parser = point)]
    pub at: Point,
    /// Inputs: declared ones, and sources by their names, to whose value the input is added [default: the declared ones, else
    /// the sources in the model itself, not within its parts]
    #[arg(long, value_name = "NAMES")]
    pub inputs: Vec<String>,
    /// Outputs: anything that can be recorded [default: the declared ones, else the states]
    #[arg(long, value_name = "NAMES")]
    pub outputs: Vec<String>,
    /// Tell matrices and transfer functions as expressions too
    #[arg(long)]
    pub symbolic: bool,
    /// Give an input by a CSV file: a column `t` and one named as the input, linear between its rows; may be repeated
    #[arg(long, value_name = "NAME=FILE", value_parser = pair)]
    pub input: Vec<(String, String)>,
    /// Where to draw the Bode plot: a .svg or .png file; may be repeated
    #[arg(long, value_name = "FILE")]
    pub plot: Vec<PathBuf>,
    /// Where to draw the Nyquist plot: a .svg or .png file; may be repeated
    #[arg(long, value_name = "FILE")]
    pub nyquist: Vec<PathBuf>,
}

/// Where to linearise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Point {
    /// At the start.
    Start,
    /// At rest.
    Equilibrium,
    /// Where a run is at this time, in s.
    Time(f64),
}

/// `report`.
#[derive(Debug, Args)]
pub struct Report {
    #[command(flatten)]
    pub model: ModelArguments,
    /// Where to write the page: a .html file
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// End of the runs, in s [default: ten times the slowest time of the motion near the start]
    #[arg(long, value_name = "TIME", value_parser = duration, allow_hyphen_values = true)]
    pub to: Option<f64>,
    /// Give an input by a CSV file: a column `t` and one named as the input, linear between its rows; may be repeated
    #[arg(long, value_name = "NAME=FILE", value_parser = pair)]
    pub input: Vec<(String, String)>,
    /// Error at which forms are compared, relative to the greatest magnitude of each variable
    #[arg(long, default_value_t = 1e-6, allow_negative_numbers = true)]
    pub error: f64,
    /// Time for comparing forms, in s: what it does not suffice for is left out, and said in the page
    #[arg(long, value_name = "TIME", default_value_t = 10.0)]
    pub compare_budget: f64,
    /// Leave out the comparison of forms, which takes time
    #[arg(long)]
    pub without_comparison: bool,
}

/// `fit`.
#[derive(Debug, Args)]
pub struct Fit {
    #[command(flatten)]
    pub model: ModelArguments,
    /// What was measured: a CSV file; may be repeated: runs that are fitted at once
    #[arg(long, value_name = "FILE", required = true)]
    pub data: Vec<PathBuf>,
    /// Variables with the columns that are measurements of them, as in `travel=z_meas,body.f=v_meas`; may be repeated
    #[arg(long, value_name = "VARIABLE=COLUMN", required = true)]
    pub outputs: Vec<String>,
    /// Parameters to fit, with bounds where there are some, as in `ks=5e3:50e3,b`; may be repeated
    #[arg(long, value_name = "NAMES", required = true)]
    pub params: Vec<String>,
    /// Standard deviations of the measurements, as in `travel=1e-3`, or `travel=@s` for the column s of the data, for all outputs
    /// [default: estimated]
    #[arg(long, value_name = "VARIABLE=NUMBER")]
    pub sigma: Vec<String>,
    /// How many searches are made: from the first guesses, then from points between the bounds
    #[arg(long, value_name = "NUMBER", default_value_t = 1)]
    pub starts: usize,
    /// What large residuals count
    #[arg(long, default_value = "linear")]
    pub loss: Loss,
    /// From how many standard deviations on a residual is large
    #[arg(long, value_name = "NUMBER", default_value_t = 1.0, allow_negative_numbers = true)]
    pub loss_scale: f64,
    /// Parameters whose profile is wanted: the best fit for other values of each
    #[arg(long, value_name = "NAMES")]
    pub profile: Vec<String>,
    /// Where to draw measurements, the fitted model and what is left over: a .svg or .png file; may be repeated
    #[arg(long, value_name = "FILE")]
    pub plot: Vec<PathBuf>,
    /// End of each run, in s [default: the last time of the data]
    #[arg(long, value_name = "TIME", value_parser = duration, allow_hyphen_values = true)]
    pub to: Option<f64>,
    /// The method
    #[arg(long, default_value = "auto")]
    pub solver: Solver,
    /// Step of a method with fixed step, longest step of the others, in s
    #[arg(long, value_name = "TIME", value_parser = duration, allow_hyphen_values = true)]
    pub step: Option<f64>,
    /// Relative error allowed in a step of a method with variable step
    #[arg(long, default_value_t = 1e-8, allow_negative_numbers = true)]
    pub rtol: f64,
    /// Relative change of the sum of squares and of the parameters at which the search ends
    #[arg(long, default_value_t = 1e-10, allow_negative_numbers = true)]
    pub tolerance: f64,
    /// Give an input by a CSV file with a column `t` and one named as the input, or as in `road=@z` by the column z of each file of
    /// data; may be repeated
    #[arg(long, value_name = "NAME=FILE", value_parser = pair)]
    pub input: Vec<(String, String)>,
    /// Where each run starts
    #[arg(long, default_value = "given")]
    pub start: Start,
    /// What evaluates the model: bytecode, machine code, or what is sooner done. Results are the same to the last bit
    #[arg(long, default_value = "auto")]
    pub exec: Exec,
}

/// `sweep`.
#[derive(Debug, Args)]
pub struct Sweep {
    #[command(flatten)]
    pub model: ModelArguments,
    /// Values of a parameter: `k=lin(FROM,TO,NUMBER)`, `k=log(FROM,TO,NUMBER)` or `k=list(A,B,..)`; may be repeated: every
    /// value with every value of the others
    #[arg(long, value_name = "NAME=VALUES")]
    pub vary: Vec<String>,
    /// Sets of parameters: a .csv file whose columns are called as they
    #[arg(long, value_name = "FILE")]
    pub samples: Option<PathBuf>,
    /// What to keep of each run, as in `max(body.f),final(spring.q)` [default: the last value of states and outputs]
    #[arg(long, value_name = "REDUCTIONS")]
    pub reduce: Vec<String>,
    /// End of each run, in s
    #[arg(long, value_name = "TIME", value_parser = duration, allow_hyphen_values = true)]
    pub to: f64,
    /// Time between the samples that are kept or reduced, in s; without it every step is one, and what is greatest and what
    /// means are is that of the motion between them too, where the method knows it (those of variable step)
    #[arg(long, value_name = "TIME", value_parser = duration, allow_hyphen_values = true)]
    pub every: Option<f64>,
    /// The method
    #[arg(long, default_value = "rk4")]
    pub solver: Solver,
    /// Step of a method with fixed step, longest step of the others, in s
    #[arg(long, value_name = "TIME", value_parser = duration, allow_hyphen_values = true)]
    pub step: Option<f64>,
    /// Relative error allowed in a step of a method with variable step
    #[arg(long, default_value_t = 1e-6, allow_negative_numbers = true)]
    pub rtol: f64,
    /// Put positions that only speeds keep together back onto the relations between them after each step
    #[arg(long)]
    pub project: bool,
    /// Give an input by a CSV file: a column `t` and one named as the input; may be repeated
    #[arg(long, value_name = "NAME=FILE", value_parser = pair)]
    pub input: Vec<(String, String)>,
    /// What evaluates the model: bytecode, machine code, or what is sooner done. Results are the same to the last bit
    #[arg(long, default_value = "auto")]
    pub exec: Exec,
    /// Where to start
    #[arg(long, default_value = "given")]
    pub start: Start,
    /// Where to write the rows: a .parquet or .csv file
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Write the units as a second header line of CSV
    #[arg(long)]
    pub units: bool,
    /// Begin anew, whatever an interrupted sweep has left
    #[arg(long)]
    pub restart: bool,
}

/// What to do when a tick takes too long.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum OnMiss {
    /// Run the late ticks without a pause
    CatchUp,
    /// Leave the late ticks out: the model falls behind the clock
    Skip,
}

/// `run`.
#[derive(Debug, Args)]
pub struct RunArguments {
    #[command(flatten)]
    pub model: ModelArguments,
    #[command(flatten)]
    pub page: PageArguments,
    /// Ticks a second, as in `1kHz`, `500 Hz` or `500`
    #[arg(long, value_name = "FREQUENCY")]
    pub rate: String,
    /// Length of the run in s of the model; without it, until it is interrupted
    #[arg(long = "for", value_name = "TIME", value_parser = duration, allow_hyphen_values = true)]
    pub length: Option<f64>,
    /// Where inputs come from: `udp://ADDRESS:PORT`, `stdin`, NAME=FILE, or a .csv file with columns called as inputs; may
    /// be repeated
    #[arg(long, value_name = "SOURCE")]
    pub input: Vec<String>,
    /// Where values are sent after every tick: `udp://ADDRESS:PORT`
    #[arg(long, value_name = "TARGET")]
    pub output: Option<String>,
    /// What to send instead of states and outputs: names with commas between them, or `all`
    #[arg(long, value_name = "NAMES")]
    pub record: Vec<String>,
    /// The method, one with fixed step
    #[arg(long, default_value = "heun")]
    pub solver: Solver,
    /// Where to start
    #[arg(long, default_value = "given")]
    pub start: Start,
    /// What to do when a tick takes too long
    #[arg(long, default_value = "catch-up")]
    pub on_miss: OnMiss,
    /// Put positions that only speeds keep together back onto the relations between them after each step
    #[arg(long)]
    pub project: bool,
    /// Evaluations at most each time nonlinear equations are solved; more stop the run
    #[arg(long, default_value_t = 50)]
    pub bound: usize,
    /// What evaluates the model: bytecode, machine code, or machine code wherever there is any. Results are the same to the
    /// last bit
    #[arg(long, default_value = "auto")]
    pub exec: Exec,
}

/// `draw`.
#[derive(Debug, Args)]
pub struct Draw {
    #[command(flatten)]
    pub model: ModelArguments,
    #[command(flatten)]
    pub branches: ModeArguments,
    /// Where to draw it: a .svg or .png file; may be repeated
    #[arg(long, value_name = "FILE", required = true)]
    pub out: Vec<PathBuf>,
    /// Draw no causal paths
    #[arg(long, conflicts_with = "paths")]
    pub no_paths: bool,
    /// Draw these causal paths, by their numbers in the drawing, as in `1,3` [default: the first 12]
    #[arg(long, value_name = "NUMBERS", value_delimiter = ',')]
    pub paths: Vec<usize>,
    /// Leave out laws and values of the elements
    #[arg(long)]
    pub no_laws: bool,
    /// Of the cells of a `for` that are made alike draw the first alone
    #[arg(long)]
    pub first_cells: bool,
    /// Draw the bonds of a multibond one by one
    #[arg(long)]
    pub expand: bool,
    /// An earlier drawing, as .svg: elements that are in it stay where they are there, as seen from each other
    #[arg(long, value_name = "FILE")]
    pub keep: Option<PathBuf>,
}

/// What can be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Target {
    /// C99: header, source, main.c and CMakeLists.txt in a folder
    C,
    /// A Functional Mock-up Unit 2.0: model exchange and co-simulation
    Fmu2,
    /// A Functional Mock-up Unit 3.0: model exchange and co-simulation
    Fmu3,
    /// Rates and outputs as functions of CasADi, a file of Python
    Casadi,
    /// The equations as a LaTeX document
    Latex,
}

/// Methods with fixed step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
#[value(rename_all = "snake_case")]
pub enum FixedSolver {
    /// Order 1
    Euler,
    /// Order 2
    Heun,
    /// Order 4
    Rk4,
    /// Order 2, implicit
    ImplicitMidpoint,
    /// Order 1, linearly implicit, for stiff models
    LinearlyImplicitEuler,
    /// Order 2, linearly implicit, for stiff models: one evaluation a step, a Jacobian that is kept
    LinearlyImplicitBdf2,
    /// Order 3, linearly implicit, for stiff models
    Rosenbrock,
}

/// `export`.
#[derive(Debug, Args)]
pub struct Export {
    /// What to write
    pub target: Target,
    #[command(flatten)]
    pub model: ModelArguments,
    /// Where to write it: a folder, or a file
    #[arg(long, value_name = "PATH")]
    pub out: PathBuf,
    /// The formulation; code takes minimal and kane
    #[arg(long, default_value = "minimal")]
    pub form: Form,
    /// The method of a step
    #[arg(long, default_value = "rk4")]
    pub method: FixedSolver,
    /// The length of a step, in s
    #[arg(long, value_name = "TIME", default_value = "1e-3", value_parser = duration, allow_hyphen_values = true)]
    pub step: f64,
    /// The real numbers of C
    #[arg(long, default_value = "double")]
    pub real: Real,
    /// Put positions that only speeds keep together back onto the relations between them after each step
    #[arg(long)]
    pub project: bool,
    /// FMUs: no binary for this machine, sources alone
    #[arg(long)]
    pub source_only: bool,
}

/// Real numbers of C.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Real {
    /// Double precision, with the bits of `simulate`
    Double,
    /// Single precision, for processors that compute in it; time stays double
    Float,
}

/// Reads `start`, `equilibrium` or a time.
fn point(text: &str) -> Result<Point, String> {
    match text {
        "start" => Ok(Point::Start),
        "equilibrium" => Ok(Point::Equilibrium),
        _ => duration(text).map(Point::Time).map_err(|_| format!("`{text}` is neither start, equilibrium nor a time")),
    }
}

/// Reads `name=value`.
fn pair(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.trim().is_empty() && !value.trim().is_empty() => {
            Ok((name.trim().to_string(), value.trim().to_string()))
        }
        _ => Err(format!("`{text}` is not of the form name=value")),
    }
}

/// Reads the name of a family.
fn family(text: &str) -> Result<Family, String> {
    let known = || Family::ALL.map(Family::name).join(", ");
    let named = Family::ALL.into_iter().find(|family| family.name() == text);
    named.ok_or_else(|| format!("there are {}", known()))
}

/// Reads a time in s, with or without a unit.
fn duration(text: &str) -> Result<f64, String> {
    match halfarrow::duration(text) {
        Some(time) if time.is_finite() && time >= 0.0 => Ok(time),
        Some(_) => Err("a time cannot be negative or infinite".to_owned()),
        None => Err("it is no time: write `0.5`, `500ms` or `2 min`".to_owned()),
    }
}
