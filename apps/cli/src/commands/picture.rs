//! `draw`, and the writing of pictures.

use std::collections::BTreeMap;
use std::path::Path;

use halfarrow::{DrawOptions, DrawnPaths, Error, Picture, Problem, positions, write_whole};
use serde_json::json;

use super::with_model;
use crate::arguments;
use crate::screen;

/// The bond graph.
pub fn draw(arguments: &arguments::Draw) -> u8 {
    with_model(&arguments.model, |model| {
        let picture = model.in_mode(&arguments.branches.mode)?.draw(&options(arguments)?)?;
        arguments.out.iter().try_for_each(|path| write_picture(&picture, path))?;
        match arguments.model.model.json {
            true => screen::print_json(&json!({"written": arguments.out})),
            false => {
                arguments.out.iter().try_for_each(|path| screen::print(&format!("{} is written\n", path.display())))
            }
        }?;
        Ok(0)
    })
}

/// What the command line asks for.
fn options(arguments: &arguments::Draw) -> Result<DrawOptions, Problem> {
    let paths = match (arguments.no_paths, &arguments.paths[..]) {
        (true, _) => DrawnPaths::Numbers(Vec::new()),
        (_, []) => DrawOptions::default().paths,
        (_, numbers) => DrawnPaths::Numbers(numbers.to_vec()),
    };
    let keep = arguments.keep.as_deref().map(kept).transpose()?.unwrap_or_default();
    Ok(DrawOptions {
        paths,
        laws: !arguments.no_laws,
        first_cells: arguments.first_cells,
        expand: arguments.expand,
        keep,
    })
}

/// Where elements stand in an earlier drawing.
fn kept(path: &Path) -> Result<BTreeMap<String, [f64; 2]>, Problem> {
    let svg =
        std::fs::read_to_string(path).map_err(|why| Problem::Unreadable { path: path.into(), why: why.to_string() })?;
    let found = positions(&svg);
    match found.is_empty() {
        true => Err(Problem::BadInput {
            path: path.into(),
            faults: vec!["it is no drawing by `halfarrow draw`, as SVG: no element has a place in it".to_string()],
        }),
        false => Ok(found),
    }
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
