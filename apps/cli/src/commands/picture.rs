//! `draw`, and the writing of pictures.

use std::path::Path;

use halfarrow::{Error, Picture, Problem, write_whole};
use serde_json::json;

use super::with_model;
use crate::arguments;
use crate::screen;

/// The bond graph.
pub fn draw(arguments: &arguments::Draw) -> u8 {
    with_model(&arguments.model, |model| {
        let picture = model.draw()?;
        arguments.out.iter().try_for_each(|path| write_picture(&picture, path))?;
        match arguments.model.model.json {
            true => screen::print_json(&json!({"written": arguments.out})),
            false => arguments
                .out
                .iter()
                .try_for_each(|path| screen::print(&format!("{} is written\n", path.display()))),
        }?;
        Ok(0)
    })
}

/// Writes a picture as SVG or PNG, as the name says.
pub fn write_picture(picture: &Picture, path: &Path) -> Result<(), Error> {
    let bytes = match kind_of(path)? {
        Kind::Svg => picture.svg.clone().into_bytes(),
        Kind::Png => picture.to_png()?,
    };
    let written = write_whole(path, |out| out.write_all(&bytes));
    written.map_err(|why| Problem::Unwritable { path: path.into(), why: why.source.to_string() }.into())
}

enum Kind {
    Svg,
    Png,
}

fn kind_of(path: &Path) -> Result<Kind, Problem> {
    match path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).as_deref() {
        Some("svg") => Ok(Kind::Svg),
        Some("png") => Ok(Kind::Png),
        _ => Err(Problem::UnknownKind { path: path.into(), known: vec!["svg", "png"] }),
    }
}

/// That pictures can be written under these names, before anything is computed.
pub fn check_names(paths: &[std::path::PathBuf]) -> Result<(), Problem> {
    paths.iter().try_for_each(|path| kind_of(path).map(|_| ()))
}
