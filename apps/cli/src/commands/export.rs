//! `export`.

use std::fs;
use std::path::{Path, PathBuf};

use halfarrow::{Error, Export, ExportReport, File, FixedMethod, Problem, Real, Start, Target, write_whole};
use serde_json::json;

use super::analyse::form;
use super::{warn_of_step, with_model};
use crate::arguments::{self, FixedSolver};
use crate::screen;

/// Code for elsewhere.
pub fn export(arguments: &arguments::Export) -> u8 {
    with_model(&arguments.model, |model| {
        check_name(arguments)?;
        let asked = asked(arguments);
        let exported = model.export(&asked)?;
        let notes = match asked.target {
            Target::Casadi | Target::Latex => Vec::new(),
            _ => warn_of_step(model, asked.form, (asked.method, asked.step), Start::Given),
        };
        let written = write_files(arguments, &exported.files)?;
        match arguments.model.model.json {
            true => {
                let mut object = json!(exported.report);
                object["written"] = json!(written);
                object["notes"] = json!(notes);
                screen::print_json(&object)
            }
            false => screen::print(&summary(&exported.report, &written)),
        }?;
        Ok(0)
    })
}

fn asked(arguments: &arguments::Export) -> Export {
    Export {
        target: match arguments.target {
            arguments::Target::C => Target::C,
            arguments::Target::Fmu2 => Target::Fmu2,
            arguments::Target::Fmu3 => Target::Fmu3,
            arguments::Target::Casadi => Target::Casadi,
            arguments::Target::Latex => Target::Latex,
        },
        form: form(arguments.form),
        method: match arguments.method {
            FixedSolver::Euler => FixedMethod::Euler,
            FixedSolver::Heun => FixedMethod::Heun,
            FixedSolver::Rk4 => FixedMethod::Rk4,
            FixedSolver::ImplicitMidpoint => FixedMethod::ImplicitMidpoint,
            FixedSolver::LinearlyImplicitEuler => FixedMethod::LinearlyImplicitEuler,
            FixedSolver::LinearlyImplicitBdf2 => FixedMethod::LinearlyImplicitBdf2,
            FixedSolver::Rosenbrock => FixedMethod::Rosenbrock,
        },
        step: arguments.step,
        real: match arguments.real {
            arguments::Real::Double => Real::Double,
            arguments::Real::Float => Real::Float,
        },
        project: arguments.project,
        binary: !arguments.source_only,
    }
}

/// The ending that a single file has to have.
fn ending(target: arguments::Target) -> Option<&'static str> {
    match target {
        arguments::Target::C => None,
        arguments::Target::Fmu2 | arguments::Target::Fmu3 => Some("fmu"),
        arguments::Target::Casadi => Some("py"),
        arguments::Target::Latex => Some("tex"),
    }
}

fn check_name(arguments: &arguments::Export) -> Result<(), Problem> {
    let Some(ending) = ending(arguments.target) else { return Ok(()) };
    let extension = arguments.out.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
    match extension.as_deref() == Some(ending) {
        true => Ok(()),
        false => Err(Problem::UnknownKind { path: arguments.out.clone(), known: vec![ending] }),
    }
}

/// Writes one file under the name given, or several into the folder given.
fn write_files(arguments: &arguments::Export, files: &[File]) -> Result<Vec<PathBuf>, Error> {
    let unwritable = |path: &Path, why: String| Problem::Unwritable { path: path.into(), why };
    let single = ending(arguments.target).is_some();
    if !single {
        fs::create_dir_all(&arguments.out).map_err(|why| unwritable(&arguments.out, why.to_string()))?;
    }
    let mut written = Vec::new();
    for file in files {
        let path = if single { arguments.out.clone() } else { arguments.out.join(&file.path) };
        write_whole(&path, |out| out.write_all(&file.bytes))
            .map_err(|why| unwritable(&path, why.source.to_string()))?;
        written.push(path);
    }
    Ok(written)
}

fn summary(report: &ExportReport, written: &[PathBuf]) -> String {
    let mut text: String = written.iter().map(|path| format!("{} is written\n", path.display())).collect();
    if let (Some(method), Some(step)) = (report.method, report.step) {
        text += &format!("{method} with a step of {} s; what a step costs at most:\n", screen::short(step));
    }
    report.cost_text.iter().for_each(|line| text += &format!("    {line}\n"));
    text
}
