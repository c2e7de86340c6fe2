//! The commands: each gives its exit status.

mod analyse;
mod animation;
mod compare;
mod export;
mod files;
mod fit;
mod library;
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
pub use fit::fit;
pub use library::library;
pub use linearize::linearize;
pub use picture::draw;
pub use real_time::run;
pub use report::report;
pub use run::simulate;
pub use sweep::sweep;

use std::mem::ManuallyDrop;
use std::time::Instant;

use halfarrow::{Error, FixedMethod, Form, Model, Override, Problem, Source, StageTime, Start};

use crate::arguments::{FileArguments, ModelArguments};
use crate::page::Page;
use crate::screen;

/// Loads a model, shows what was noticed, and goes on; on an error gives its exit status.
fn with_model(arguments: &ModelArguments, go_on: impl FnOnce(&Model) -> Result<u8, Error>) -> u8 {
    let begun = Instant::now();
    let set = overrides(arguments);
    let loaded = source(&arguments.model).map_err(Error::from).and_then(|source| Model::new(source, &set));
    let outcome = loaded.and_then(|model| {
        // The process ends with the command: a large model is not given back piece by piece before.
        let model = ManuallyDrop::new(model);
        screen::warn(model.warnings());
        if let Some(absent) = model.absent() {
            return Err(absent.into());
        }
        let status = go_on(&model);
        if arguments.timings {
            note_timings(&model.timings(), begun);
        }
        status
    });
    outcome.unwrap_or_else(|error| screen::fail(&error, arguments.model.json))
}

/// Says what each stage took, what the rest of the command, and how much memory was in use after each.
fn note_timings(stages: &[StageTime], begun: Instant) {
    let whole = begun.elapsed().as_secs_f64();
    let rest = whole - stages.iter().map(|stage| stage.seconds).sum::<f64>();
    let megabytes = |bytes: usize| format!("{:.1}", bytes as f64 / 1e6);
    let row =
        |s: &StageTime| [s.stage.to_string(), screen::milliseconds(s.seconds), s.memory.map_or("-".into(), megabytes)];
    let last =
        [("else", rest), ("in all", whole)].map(|(name, s)| [name.to_string(), screen::milliseconds(s), String::new()]);
    let rows = stages.iter().map(row).chain(last);
    screen::note(Page::usual().table(["stage", "time (ms)", "memory after it (MB)"], rows).trim_end());
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
