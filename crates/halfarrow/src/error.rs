//! What can go wrong, and whose fault it is.

use std::fmt;
use std::path::{Path, PathBuf};

use halfarrow_compiler::compile::Found;
use halfarrow_compiler::diagnostic::{codes, to_json};
use serde_json::{Value, json};

use crate::run::Stopped;

/// Why there is no result.
#[derive(Debug)]
pub enum Error {
    /// A model with errors.
    Model(Found),
    /// Something was asked that cannot be.
    Usage(Problem),
    /// A run that stopped before its end, with what was computed so far.
    Run(Box<Stopped>),
    /// A sweep that was stopped as asked; what is done is kept beside its file.
    Interrupted {
        /// Sets that are done.
        done: usize,
        /// Sets of the sweep.
        sets: usize,
    },
}

/// Something asked that cannot be.
#[derive(Debug, Clone, PartialEq)]
pub enum Problem {
    /// A file that cannot be read.
    Unreadable {
        /// Which file.
        path: PathBuf,
        /// What the system says.
        why: String,
    },
    /// A file that cannot be written.
    Unwritable {
        /// Which file.
        path: PathBuf,
        /// What the system says.
        why: String,
    },
    /// A file that has no model in it, only components.
    NoModel {
        /// Which file.
        name: String,
        /// The components in it.
        components: Vec<String>,
    },
    /// A variable that is asked for and does not exist.
    UnknownVariable {
        /// As asked for.
        name: String,
        /// The most similar one there is.
        nearest: Option<String>,
    },
    /// A variable to record that has no value.
    Unavailable {
        /// Its name.
        name: String,
        /// Why.
        reason: String,
    },
    /// An input to connect that does not exist.
    UnknownInput {
        /// As asked for.
        name: String,
        /// The inputs of the model.
        known: Vec<String>,
    },
    /// A file for an input that does not hold it.
    BadInput {
        /// Which file.
        path: PathBuf,
        /// What is wrong with it.
        faults: Vec<String>,
    },
    /// A number among the options that makes no sense.
    BadOption {
        /// Which, and what it has to be.
        reason: String,
    },
    /// A method with fixed step and no step.
    NoStep,
    /// A picture that cannot be made of pixels.
    NoPng {
        /// Why.
        why: String,
    },
    /// An FMU without its binary.
    NoLibrary {
        /// Why.
        why: String,
    },
    /// A file to be written whose ending says nothing.
    UnknownKind {
        /// Which file.
        path: PathBuf,
        /// The endings that are known.
        known: Vec<&'static str>,
    },
    /// Matrices of a model near a point that do not exist.
    NoMatrices {
        /// Why.
        reason: String,
    },
    /// Something that this build was made without.
    NotBuilt {
        /// What it cannot do, as in `write FMUs`.
        what: &'static str,
        /// The Cargo feature that it lacks.
        feature: &'static str,
    },
    /// A picture of a machine of which nothing has a shape.
    NoShapes,
    /// A start at rest where there is none.
    NoEquilibrium {
        /// Why there is none.
        reason: String,
    },
}

impl Error {
    /// Exit status of the command line: 1 the model is at fault, 2 wrong usage, 3 the run failed.
    pub fn exit_status(&self) -> u8 {
        match self {
            Error::Model(found) if found.diagnostics.0.iter().any(|d| d.is_error() && d.code == codes::N019) => 2,
            Error::Model(_) => 1,
            Error::Usage(_) => 2,
            Error::Run(_) | Error::Interrupted { .. } => 3,
        }
    }

    /// The message for people, with the lines of the model; `color` adds terminal colours.
    pub fn render(&self, color: bool) -> String {
        match self {
            Error::Model(found) => found.render(color),
            other => format!("error: {other}\n"),
        }
    }

    /// The message for programs: `error`, and the `diagnostics` of a faulty model.
    pub fn to_json(&self) -> Value {
        match self {
            Error::Model(found) => {
                json!({"error": "the model has errors", "diagnostics": to_json(&found.diagnostics, &found.sources)})
            }
            Error::Interrupted { done, sets } => json!({"error": self.to_string(), "sets": sets, "done": done}),
            other => json!({"error": other.to_string()}),
        }
    }
}

impl From<Found> for Error {
    fn from(found: Found) -> Error {
        Error::Model(found)
    }
}

impl From<Problem> for Error {
    fn from(problem: Problem) -> Error {
        Error::Usage(problem)
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Error::Model(found) => found.diagnostics.fmt(f),
            Error::Usage(problem) => problem.fmt(f),
            Error::Run(stopped) => stopped.fmt(f),
            Error::Interrupted { done, sets } => {
                write!(f, "stopped as asked: {done} of {sets} sets are done; the same command goes on from there")
            }
        }
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Problem::Unreadable { path, why } => write!(f, "{} cannot be read: {why}", path.display()),
            Problem::Unwritable { path, why } => write!(f, "{} cannot be written: {why}", path.display()),
            Problem::NoModel { name, components } => {
                let file = Path::new(name).file_name().map_or(name.as_str().into(), |file| file.to_string_lossy());
                let used = components.first().map_or("a component of it".to_string(), |c| format!("`{c}:name`"));
                write!(
                    f,
                    "there is no model in {name}, only components: write one in a file beside it that begins with `model \
                     Name`, has `import \"{file}\"` and uses {used}"
                )
            }
            Problem::UnknownVariable { name, nearest } => {
                write!(f, "there is no variable `{name}`")?;
                match nearest {
                    Some(nearest) => write!(f, "; did you mean `{nearest}`?"),
                    None => write!(f, "; `--record all` shows what there is"),
                }
            }
            Problem::Unavailable { name, reason } => write!(f, "`{name}` cannot be recorded: {reason}"),
            Problem::UnknownInput { name, known } if known.is_empty() => {
                write!(f, "there is no input `{name}`: the model has none")
            }
            Problem::UnknownInput { name, known } => {
                write!(f, "there is no input `{name}`; the model has {}", known.join(", "))
            }
            Problem::BadInput { path, faults } => {
                let path = path.display();
                faults
                    .iter()
                    .enumerate()
                    .try_for_each(|(i, fault)| write!(f, "{}{path}: {fault}", if i == 0 { "" } else { "\n" }))
            }
            Problem::BadOption { reason } => f.write_str(reason),
            Problem::NoPng { why } => write!(f, "no PNG can be made: {why}"),
            Problem::NoLibrary { why } => {
                write!(f, "no binary can be made for the FMU: {why}; `--source-only` writes it with its sources alone")
            }
            Problem::UnknownKind { path, known } => {
                let known: Vec<String> = known.iter().map(|k| format!(".{k}")).collect();
                write!(
                    f,
                    "the name {} does not say what to write: let it end in {}",
                    path.display(),
                    known.join(" or ")
                )
            }
            Problem::NoMatrices { reason } => write!(f, "the model cannot be linearised: {reason}"),
            Problem::NotBuilt { what, feature } => {
                write!(f, "this build cannot {what}: it was made without the feature `{feature}`")
            }
            Problem::NoEquilibrium { reason } => write!(f, "no start at rest: {reason}"),
            Problem::NoShapes => f.write_str(
                "there is nothing to show: nothing in this model has a shape; take bodies and joints of std.multibody or \
                 std.planar, which have, or write where something is and what it looks like, as in \
                 `shape box:cart(r = [x, 0, 0], R = 0, size = [0.4, 0.2, 0.2])`",
            ),
            Problem::NoStep => f.write_str("this solver has a fixed step: give it with --step, as in `--step 1e-3`"),
        }
    }
}

impl std::error::Error for Error {}
impl std::error::Error for Problem {}
