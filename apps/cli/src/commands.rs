//! The commands: each gives its exit status.

mod analyse;
mod compare;
mod export;
mod files;
mod linearize;
mod picture;
mod plots;
mod real_time;
mod report;
mod run;
mod sweep;

pub use analyse::{check, equations, loops, show};
pub use compare::compare;
pub use export::export;
pub use files::{fmt, new};
pub use linearize::linearize;
pub use picture::draw;
pub use real_time::run;
pub use report::report;
pub use run::simulate;
pub use sweep::sweep;

use halfarrow::{Error, FixedMethod, Form, Model, Override, Problem, Source, Start};

use crate::arguments::{FileArguments, ModelArguments};
use crate::screen;

/// Loads a model, shows what was noticed, and goes on; on an error gives its exit status.
fn with_model(arguments: &ModelArguments, go_on: impl FnOnce(&Model) -> Result<u8, Error>) -> u8 {
    let set = overrides(arguments);
    let loaded = source(&arguments.model).map_err(Error::from).and_then(|source| Model::new(source, &set));
    let outcome = loaded.and_then(|model| {
        screen::warn(model.warnings());
        go_on(&model)
    });
    outcome.unwrap_or_else(|error| screen::fail(&error, arguments.model.json))
}

/// The model that is asked for, and what it may read.
fn source(arguments: &FileArguments) -> Result<Source, Problem> {
    Source::open_allowing(&arguments.file, &arguments.allow)
}

/// Says, before anything is done with it, if a fixed step is too long for what the model does at its start; gives what was said.
fn warn_of_step(model: &Model, form: Form, (method, step): (FixedMethod, f64), start: Start) -> Vec<String> {
    let said: Vec<String> = model.step_advice(form, method, step, start).into_iter().collect();
    said.iter().for_each(|note| screen::note(&format!("warning: {note}")));
    said
}

/// What `--set` gives.
fn overrides(arguments: &ModelArguments) -> Vec<Override> {
    let given = arguments.set.iter();
    given.map(|(name, value)| Override { name: name.clone(), value: value.clone() }).collect()
}
