//! Programs as files for elsewhere, in memory: [`c`] writes C99, [`fmu`] Functional Mock-up
//! Units around it, [`casadi`] functions of CasADi, [`latex`] a document of the equations.
//!
//! What is written computes what the interpreter computes, to the last bit: the same operations in the same order.
#![forbid(unsafe_code)]

pub mod c;
pub mod casadi;
pub mod fmu;
pub mod latex;
mod names;

use std::fmt;

/// A file in memory.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct File {
    /// Its path, with `/` between folders.
    pub path: String,
    /// What it holds.
    pub bytes: Vec<u8>,
}

impl File {
    /// A file of text.
    pub fn text(path: impl Into<String>, text: impl Into<String>) -> File {
        File { path: path.into(), bytes: text.into().into_bytes() }
    }
}

/// Fixed-step methods; see `halfarrow_sim::fixed_step`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Explicit Euler.
    Euler,
    /// Heun, the explicit trapezoidal rule.
    Heun,
    /// The classical Runge-Kutta method.
    Rk4,
    /// The implicit midpoint rule, at most 20 Newton iterations a step.
    ImplicitMidpoint,
    /// Linearly implicit Euler.
    LinearlyImplicitEuler,
    /// Linearly implicit BDF of two steps, with a Jacobian that is kept.
    LinearlyImplicitBdf2,
    /// RODAS3, a linearly implicit method of order 3.
    Rosenbrock,
}

impl Method {
    /// All of them.
    pub const ALL: [Method; 7] = [
        Method::Euler,
        Method::Heun,
        Method::Rk4,
        Method::ImplicitMidpoint,
        Method::LinearlyImplicitEuler,
        Method::LinearlyImplicitBdf2,
        Method::Rosenbrock,
    ];

    /// Its name, as on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Method::Euler => "euler",
            Method::Heun => "heun",
            Method::Rk4 => "rk4",
            Method::ImplicitMidpoint => "implicit_midpoint",
            Method::LinearlyImplicitEuler => "linearly_implicit_euler",
            Method::LinearlyImplicitBdf2 => "linearly_implicit_bdf2",
            Method::Rosenbrock => "rosenbrock",
        }
    }

    /// Stages of a step; of the midpoint rule of an iteration.
    pub fn stages(self) -> usize {
        match self {
            Method::Euler | Method::ImplicitMidpoint | Method::LinearlyImplicitEuler | Method::LinearlyImplicitBdf2 => {
                1
            }
            Method::Heun => 2,
            Method::Rk4 | Method::Rosenbrock => 4,
        }
    }

    /// Whether a step takes a matrix.
    pub fn is_implicit(self) -> bool {
        self.takes_derivatives() || self.keeps_steps()
    }

    /// Whether a step takes derivatives by the states.
    pub fn takes_derivatives(self) -> bool {
        self == Method::ImplicitMidpoint || self.takes_time_derivative()
    }

    /// Whether it takes them by the states and by time: one matrix a step, and no iteration.
    pub fn takes_time_derivative(self) -> bool {
        matches!(self, Method::LinearlyImplicitEuler | Method::Rosenbrock)
    }

    /// Whether it goes on from what it keeps of earlier steps.
    pub fn keeps_steps(self) -> bool {
        self == Method::LinearlyImplicitBdf2
    }
}

/// Real numbers of exported C.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Real {
    /// `double`, with the bits of the interpreter.
    #[default]
    Double,
    /// `float`; time, and what follows from it or from parameters alone, in `double`.
    Float,
}

impl Real {
    /// Its name, as on the command line and in C.
    pub fn name(self) -> &'static str {
        match self {
            Real::Double => "double",
            Real::Float => "float",
        }
    }

    /// The distance from 1 to the next number.
    pub fn epsilon(self) -> f64 {
        match self {
            Real::Double => f64::EPSILON,
            Real::Float => f64::from(f32::EPSILON),
        }
    }

    /// Whether a number is held with all digits: it is neither too great nor too close to zero. What is not finite is no
    /// number.
    pub fn holds(self, value: f64) -> bool {
        let size = value.abs();
        let range = f64::from(f32::MIN_POSITIVE)..=f64::from(f32::MAX);
        self == Real::Double || value == 0.0 || !value.is_finite() || range.contains(&size)
    }
}

/// The model at the start of a run at time 0 with all parameters and inputs at their defaults.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Start {
    /// Its states.
    pub states: Vec<f64>,
    /// Its conserved constants.
    pub conserved: Vec<f64>,
    /// Its positions that iterations determine.
    pub positions: Vec<f64>,
    /// Typical magnitudes of its states, 0 where unknown.
    pub scales: Vec<f64>,
    /// Magnitudes to which its states grow in a run, 0 where unknown: told to importers of FMUs where `scales` knows none.
    pub grown: Vec<f64>,
    /// Delays and periods of its held signals, in s.
    pub times: Vec<f64>,
    /// Values of its parameters.
    pub parameters: Vec<f64>,
    /// Values that follow from parameters alone, as they stand in the equations.
    pub derived: Vec<f64>,
    /// Values of its inputs.
    pub inputs: Vec<f64>,
    /// What is recorded, at the start; NaN where it has no value.
    pub observed: Vec<f64>,
}

/// Why a program cannot be written.
#[derive(Debug, Clone, PartialEq)]
pub enum EmitError {
    /// Its equations are no explicit rates.
    Implicit,
    /// States that a jump of a source changes: their names.
    Jumps(Vec<String>),
    /// The balance of impulses at events has more unknowns than there is room for: how many.
    Impulses(usize),
    /// The step is not a finite number above zero.
    Step(f64),
    /// A value does not fit real numbers of single precision: what it is, and the value.
    Range(String, f64),
    /// What happens at events, or is held from earlier times: names.
    Events(Vec<String>),
    /// Set-valued laws, whose margins need double precision.
    SingleModes,
    /// A method that compares rates beside a state, for which single precision has too few digits.
    SingleDifferences,
    /// A delay would keep too many points with this step: its name, and how many.
    Delay(String, f64),
}

impl fmt::Display for EmitError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            EmitError::Implicit => f.write_str("only explicit equations are exported: use the form minimal or kane"),
            EmitError::Jumps(states) => write!(
                f,
                "a source or a law that jumps changes {}, which are states of this form: export the form minimal, whose states do not jump",
                states.join(", ")
            ),
            EmitError::Impulses(unknowns) => write!(
                f,
                "what `when` resets, or changes of what moves together, is balanced over {unknowns} unknowns at once; exported \
                 code has room for {} of them: leave out the resets, or export a part of the model",
                c::MOST_BALANCED
            ),
            EmitError::Step(step) => write!(f, "the step is {step}: it has to be a finite number above zero"),
            EmitError::Range(what, value) => write!(
                f,
                "{what} is {value:?} in SI units, which does not fit `float`: its numbers are from {:?} to {:?} in size; export with `--real double`, or change the value",
                f32::MIN_POSITIVE,
                f32::MAX
            ),
            EmitError::Events(names) => write!(
                f,
                "{} would have to happen while an integrator runs, and functions of CasADi have no memory: leave that out of what \
                 is exported, or export c, fmu2 or fmu3",
                names.iter().take(5).map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
            ),
            EmitError::SingleModes => f.write_str(
                "the model has set-valued laws: where their branches end is told from rounding in double precision only; export \
                 with `--real double`",
            ),
            EmitError::SingleDifferences => f.write_str(
                "linearly_implicit_bdf2 takes differences of rates, for which single precision has too few digits: export with \
                 `--real double`, or with `--method linearly_implicit_euler`",
            ),
            EmitError::Delay(name, points) => write!(
                f,
                "{name} would keep {points:.0} points with this step: there is no heap to put them on; choose a longer step"
            ),
        }
    }
}

impl std::error::Error for EmitError {}
