//! What can be wrong with what a model is given.

use halfarrow_compiler::program::Unavailable;
use halfarrow_compiler::span::Span;
use halfarrow_sim::Failure;
use std::fmt;

/// A parameter that cannot be set.
#[derive(Debug, Clone, PartialEq)]
pub enum ParameterError {
    /// There is none of that name.
    Unknown(String),
    /// It is declared `const`.
    Constant(String),
    /// It shapes the model, which has another value of it.
    Shapes(String),
    /// The value is not finite.
    NotFinite(String),
    /// With this value the equations of parameters have no solution.
    Unsolvable(Failure),
}

impl fmt::Display for ParameterError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ParameterError::Unknown(name) => write!(f, "there is no parameter `{name}`"),
            ParameterError::Constant(name) => write!(f, "`{name}` is a const: declare it as param to set it"),
            ParameterError::Shapes(name) => {
                write!(f, "`{name}` shapes the model: another value needs the model compiled anew, as by --set")
            }
            ParameterError::NotFinite(name) => write!(f, "the value of `{name}` is not a finite number"),
            ParameterError::Unsolvable(failure) => failure.fmt(f),
        }
    }
}

impl std::error::Error for ParameterError {}

/// An input that cannot be connected.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum InputError {
    /// There is none of that name.
    Unknown(String),
    /// Its points are no function of time: which one, and why.
    Points(String, String),
}

impl fmt::Display for InputError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            InputError::Unknown(name) => write!(f, "there is no input `{name}`"),
            InputError::Points(name, why) => {
                write!(f, "the values for the input `{name}` are no function of time: {why}")
            }
        }
    }
}

impl std::error::Error for InputError {}

/// A variable that cannot be recorded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum RecordError {
    /// There is none of that name.
    Unknown(String),
    /// It has no value.
    Unavailable(String, Unavailable),
}

impl fmt::Display for RecordError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            RecordError::Unknown(name) => write!(f, "there is no variable `{name}` to record"),
            RecordError::Unavailable(name, why) => write!(f, "`{name}` cannot be recorded: {why}"),
        }
    }
}

impl std::error::Error for RecordError {}

/// A start value that takes part in a contradiction.
#[derive(Debug, Clone, PartialEq)]
pub struct StartValue {
    /// The variable, as `I1.f`.
    pub name: String,
    /// What is asked for.
    pub asked: f64,
    /// What would fit: the start that misses all of them by as little as possible.
    pub fitting: f64,
    /// Where it stands.
    pub span: Span,
}

/// Start values that cannot hold together.
#[derive(Debug, Clone, PartialEq)]
pub struct StartConflict {
    /// All that take part.
    pub values: Vec<StartValue>,
    /// Names of the unknowns that were searched with them.
    pub searched: Vec<String>,
}

/// Why there is no start.
#[derive(Debug, Clone, PartialEq)]
pub enum StartError {
    /// Start values contradict each other, or what the model imposes.
    Conflict(StartConflict),
    /// The start values are curves that the iteration did not bring together.
    NotFound {
        /// Names of the start values and constraints.
        conditions: Vec<String>,
        /// Names of the unknowns that were searched.
        searched: Vec<String>,
    },
    /// A start value is no number.
    NoNumber {
        /// The variable, as `I1.f`.
        name: String,
        /// What it comes to.
        value: f64,
        /// Where it stands.
        span: Span,
    },
    /// The model has no value at the start.
    Failure(Failure),
}

impl fmt::Display for StartError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            StartError::Conflict(conflict) => {
                write!(f, "these start values contradict each other or a constraint:")?;
                for v in &conflict.values {
                    write!(f, " {} = {} (fitting: {});", v.name, v.asked, v.fitting)?;
                }
                write!(f, " leave out one of them or give fitting ones")
            }
            StartError::NotFound { conditions, .. } => {
                write!(f, "no start was found with {}: give start values nearer to each other", conditions.join(", "))
            }
            StartError::NoNumber { name, value, .. } => {
                write!(f, "the start value of {name} comes to {value}: it has to be a finite number")
            }
            StartError::Failure(failure) => failure.fmt(f),
        }
    }
}

impl std::error::Error for StartError {}

/// Why there is no equilibrium.
#[derive(Debug, Clone, PartialEq)]
pub enum EquilibriumError {
    /// Something always moves: the states with the greatest rates at the nearest point found, with these rates.
    None(Vec<(String, f64)>),
    /// Where all is at rest, this constraint is missed by so much.
    Missed(String, f64),
    /// Where all is at rest, branches of these set-valued laws have ended.
    Ended(Vec<String>),
    /// Where all the rest is at rest, signals that are held set it in motion: these are there.
    Held(Vec<String>),
    /// The relations that the structure implies among its states are too long to be written out.
    Relations,
    /// The model has no value on the way.
    Failure(Failure),
}

impl fmt::Display for EquilibriumError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            EquilibriumError::None(rates) => {
                write!(f, "no equilibrium was found: at the nearest point")?;
                for (i, (name, rate)) in rates.iter().enumerate() {
                    write!(f, "{} {name} still changes at {rate:e} a second", if i == 0 { "" } else { " and" })?;
                }
                write!(
                    f,
                    "; a source that drives it for ever, a momentum that nothing takes, or a spring that is missing may be the reason"
                )
            }
            EquilibriumError::Missed(constraint, miss) => write!(
                f,
                "no equilibrium was found: where all rates vanish the constraint {constraint} is missed by {miss:e}; start nearer to the position that is meant, by start values or `guess`"
            ),
            EquilibriumError::Ended(laws) => write!(
                f,
                "no equilibrium was found: where the branches with which the model begins are at rest, {} would have another; \
                 let it come to rest in a run, and start there",
                laws.join(", ")
            ),
            EquilibriumError::Held(signals) => write!(
                f,
                "no equilibrium was found: where all else is at rest, what is held ({}) is another value in a run, which sets it in \
                 motion; give it the value of rest at the start, or let it come to rest in a run and start there",
                signals.join(", ")
            ),
            EquilibriumError::Relations => write!(
                f,
                "no equilibrium was looked for: the bodies of this model hang together in so many ways that the relations which their motion keeps are too long to be written out; let it come to rest in a run with more damping, and start there"
            ),
            EquilibriumError::Failure(failure) => failure.fmt(f),
        }
    }
}

impl std::error::Error for EquilibriumError {}
