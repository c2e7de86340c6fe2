//! `new` and `fmt`: files of model text.

use std::fs::OpenOptions;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use halfarrow::{Error, Problem, format_text, read_text, write_whole};
use serde_json::json;

use crate::arguments;
use crate::screen;

/// A model to start from.
const STARTER: &str = include_str!("starter.bond");

/// Writes the starter model, or one of a family; never over a file.
pub fn new(arguments: &arguments::New) -> u8 {
    let written = start(arguments).and_then(|start| write_new(&start).map(|()| start.path));
    match written {
        Ok(path) => {
            let shown = path.display();
            let printed = match arguments.json {
                true => screen::print_json(&json!({"written": path})),
                false => screen::print(&format!(
                    "{shown} is written. Try:\n  halfarrow equations {shown}\n  halfarrow simulate {shown} --to 10\n"
                )),
            };
            screen::printed(printed, 0)
        }
        Err(problem) => screen::fail(&Error::Usage(problem), arguments.json),
    }
}

/// A file to begin with.
struct Start {
    path: PathBuf,
    text: String,
}

/// What is asked for. Of a family the name may be left out: then the first word is the number of cells.
fn start(arguments: &arguments::New) -> Result<Start, Problem> {
    let at = |name: &str| PathBuf::from(name).with_extension("bond");
    let Some(family) = arguments.family else {
        let path = at(&arguments.name);
        let text = STARTER.replacen("Starter", &model_name(&path), 1);
        return Ok(Start { path, text });
    };
    let (name, cells) = match &arguments.cells {
        Some(cells) => (arguments.name.as_str(), cells),
        None => (family.name(), &arguments.name),
    };
    let size = cells.parse().ok().filter(|&size: &usize| size > 0).ok_or_else(|| Problem::BadOption {
        reason: format!("`{cells}` is no number of cells: write `halfarrow new --family {} 100`", family.name()),
    })?;
    let path = at(name);
    let text = family.model(&model_name(&path), size);
    Ok(Start { path, text })
}

fn write_new(Start { path, text }: &Start) -> Result<(), Problem> {
    let file = OpenOptions::new().write(true).create_new(true).open(path);
    file.and_then(|mut file| file.write_all(text.as_bytes())).map_err(|why| {
        let why = match why.kind() {
            ErrorKind::AlreadyExists => "it is there already".to_string(),
            _ => why.to_string(),
        };
        Problem::Unwritable { path: path.clone(), why }
    })
}

/// `quarter-car.bond` is the model `QuarterCar`.
fn model_name(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let words = stem.split(|c: char| !c.is_alphanumeric()).filter(|w| !w.is_empty());
    let name: String = words
        .map(|word| {
            let first = word.chars().next().map_or(0, char::len_utf8);
            word[..first].to_uppercase() + &word[first..]
        })
        .collect();
    if name.starts_with(|c: char| c.is_ascii_alphabetic()) && name.is_ascii() { name } else { "Model".to_string() }
}

/// The canonical layout.
pub fn fmt(arguments: &arguments::Fmt) -> u8 {
    match laid_out(&arguments.model.file) {
        Ok((before, after)) => finish_fmt(arguments, &before, &after),
        Err(error) => screen::fail(&error, arguments.model.json),
    }
}

fn laid_out(path: &Path) -> Result<(String, String), Error> {
    let before = read_text(path)?;
    let after = format_text(&path.to_string_lossy(), &before)?;
    Ok((before, after))
}

fn finish_fmt(arguments: &arguments::Fmt, before: &str, after: &str) -> u8 {
    let path = &arguments.model.file;
    let changed = before != after;
    if arguments.write && changed {
        let written = write_whole(path, |out| out.write_all(after.as_bytes()));
        if let Err(why) = written {
            let problem = Problem::Unwritable { path: path.clone(), why: why.source.to_string() };
            return screen::fail(&Error::Usage(problem), arguments.model.json);
        }
    }
    if arguments.check && changed && !arguments.model.json {
        screen::note(&format!("{} is laid out differently: run `halfarrow fmt --write` on it", path.display()));
    }
    let printed = match () {
        () if arguments.model.json => screen::print_json(&json!({"changed": changed, "text": after})),
        () if !arguments.check && !arguments.write => screen::print(after),
        () => Ok(()),
    };
    screen::printed(printed, u8::from(arguments.check && changed))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn models_are_named_after_their_file() {
        assert_eq!(model_name(Path::new("a/quarter-car.bond")), "QuarterCar");
        assert_eq!(model_name(Path::new("x_1.bond")), "X1");
        assert_eq!(model_name(Path::new("1.bond")), "Model");
        assert_eq!(model_name(Path::new("µ.bond")), "Model");
    }
}
