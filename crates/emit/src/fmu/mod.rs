//! Functional Mock-up Units 2.0 and 3.0, for model exchange and co-simulation in one: the C of a model with the functions
//! of the interface around it, and the description that importers read.
//!
//! Values are in SI units. Parameters given by other ones are calculated; the others can be tuned at run time, but for
//! those that delays and samples read.

mod dependence;
mod description;
#[cfg(feature = "fmu")]
mod package;
mod units;
mod variables;

use crate::c::flags::Flags;
use crate::c::template::{Filling, Words};
use crate::c::written::Written as Text;
use crate::c::{self, Cost};
use crate::{EmitError, File, Real};
use halfarrow_compiler::program::{EventTrigger, Program};
use variables::Variables;

/// Versions of the interface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Version {
    /// FMI 2.0.
    V2,
    /// FMI 3.0.
    V3,
}

/// What was written: everything but the binary.
#[derive(Debug, Clone, PartialEq)]
pub struct Written {
    /// The version.
    pub version: Version,
    /// The model identifier: the name of the library, and of the model in C.
    pub name: String,
    /// The description, the sources and what belongs to them.
    pub files: Vec<File>,
    /// Names of source files, to be compiled together.
    pub sources: Vec<String>,
    /// What a step of co-simulation costs at most.
    pub cost: Cost,
    /// Outputs: indices into `Program::observed`.
    pub recorded: Vec<usize>,
}

/// Writes an FMU with sources; `export.derivatives` is taken for granted.
///
/// # Errors
/// As [`c::write`].
pub fn write(export: &c::Export, version: Version) -> Result<Written, EmitError> {
    // What states are depends on the mode: variables of the machine are outputs.
    let program = without_names_of_states(export);
    let export = &c::Export { program: program.as_ref().unwrap_or(export.program), ..*export };
    // States are there anyway: outputs are what else is recorded.
    let is_state = |&&i: &&usize| export.program.states.iter().any(|s| *s.name == *export.program.observed[i].name);
    let at: Vec<usize> = (0..export.recorded.len()).filter(|&k| !is_state(&&export.recorded[k])).collect();
    let recorded: Vec<usize> = at.iter().map(|&k| export.recorded[k]).collect();
    let mut start = export.start.clone();
    start.observed = at.iter().map(|&k| start.observed.get(k).copied().unwrap_or(f64::NAN)).collect();
    let export = c::Export { recorded: &recorded, start: &start, derivatives: true, real: Real::Double, ..*export };
    let written = c::write(&export)?;
    let variables = Variables::of(&export);
    let api = match version {
        Version::V2 => include_str!("runtime/fmi2.c"),
        Version::V3 => include_str!("runtime/fmi3.c"),
    };
    let api = |token: &str| wrapper(api, &export, &variables, &written.name, token);
    let token = token(&[
        written.source.as_str(),
        api("TOKEN").as_str(),
        &description::description(&export, &variables, version, &written.name, ""),
    ]);
    let description = description::description(&export, &variables, version, &written.name, &token);
    let file = match version {
        Version::V2 => "fmi2.c",
        Version::V3 => "fmi3.c",
    };
    let sources = vec![format!("{}.c", written.name), file.to_string()];
    let mut files = vec![
        File::text("modelDescription.xml", description),
        File::text(format!("sources/{}.h", written.name), &*written.header),
        File::text(format!("sources/{}.c", written.name), &*written.source),
        File::text(format!("sources/{file}"), api(&token)),
    ];
    if version == Version::V3 {
        files.push(File::text("sources/buildDescription.xml", description::build(&written.name, &sources)));
    }
    Ok(Written { version, name: written.name, files, sources, cost: written.cost, recorded })
}

/// Header files to compile the sources with: no part of an FMU, importers have them.
pub fn headers(version: Version) -> Vec<File> {
    match version {
        Version::V2 => vec![
            File::text("fmi2Functions.h", include_str!("headers/fmi2Functions.h")),
            File::text("fmi2FunctionTypes.h", include_str!("headers/fmi2FunctionTypes.h")),
            File::text("fmi2TypesPlatform.h", include_str!("headers/fmi2TypesPlatform.h")),
        ],
        Version::V3 => vec![
            File::text("fmi3Functions.h", include_str!("headers/fmi3Functions.h")),
            File::text("fmi3FunctionTypes.h", include_str!("headers/fmi3FunctionTypes.h")),
            File::text("fmi3PlatformTypes.h", include_str!("headers/fmi3PlatformTypes.h")),
        ],
    }
}

/// The file of an FMU, with a binary for a platform if there is one.
///
/// `binary`: its path within the FMU, such as `binaries/x86_64-linux/name.so`, and its bytes.
#[cfg(feature = "fmu")]
pub fn package(written: &Written, binary: Option<File>) -> Vec<u8> {
    let mut files = written.files.clone();
    files.extend(binary);
    package::zip(&files)
}

/// Where the binary for a platform stands, by the names that Rust gives to operating system and architecture; `None` if
/// the interface does not know it.
pub fn binary_path(version: Version, name: &str, os: &str, architecture: &str) -> Option<String> {
    let ending = match os {
        "windows" => "dll",
        "macos" => "dylib",
        "linux" => "so",
        _ => return None,
    };
    let folder = match (version, os, architecture) {
        (Version::V2, "windows", "x86_64") => "win64".to_string(),
        (Version::V2, "windows", "x86") => "win32".to_string(),
        (Version::V2, "linux", "x86_64") => "linux64".to_string(),
        (Version::V2, "linux", "x86") => "linux32".to_string(),
        (Version::V2, "macos", "x86_64" | "aarch64") => "darwin64".to_string(),
        // FMI 2 has no name for it; importers that run there look for that of FMI 3.
        (_, "macos", other) => format!("{other}-darwin"),
        (_, os, other) => format!("{other}-{os}"),
    };
    Some(format!("binaries/{folder}/{name}.{ending}"))
}

/// A program whose states have numbers for names, where they are others in each mode.
fn without_names_of_states(export: &c::Export) -> Option<Program> {
    if !export.has_modes() {
        return None;
    }
    let mut program = export.program.clone();
    for (i, state) in program.states.iter_mut().enumerate() {
        (state.name, state.unit) = (format!("state {}", i + 1), None);
    }
    Some(program)
}

/// The functions of the interface around a model.
fn wrapper(text: &'static str, export: &c::Export, variables: &Variables, model: &str, token: &str) -> String {
    let modes = export.has_modes();
    let of_state = |p: &Program| p.conditions.values().any(|c| c.trigger == EventTrigger::State);
    let switches = of_state(export.program) || export.modes.iter().any(|mode| of_state(&mode.program));
    let clauses = !export.program.clauses.is_empty();
    let list = |values: Vec<String>| match values.is_empty() {
        true => "    0".to_string(),
        false => values.chunks(20).map(|row| format!("    {}", row.join(", "))).collect::<Vec<_>>().join(",\n"),
    };
    let words = [
        ("MODEL_TITLE", export.program.name.replace("*/", "* /")),
        ("TOKEN", token.to_string()),
        ("SETTABLE", list(variables.settable().iter().map(u8::to_string).collect())),
        ("NOMINALS", list(variables.nominals(export).iter().map(|v| format!("{v:?}")).collect())),
    ];
    let words = words.map(|(word, text)| (word, Text::of(text)));
    let mut filling = Filling {
        flags: Flags { switches, clauses, modes, moves: clauses || modes, ..Flags::default() },
        words: Words::from(words),
        model,
        real: Real::Double,
    };
    let common = filling.text(include_str!("runtime/common.c"));
    filling.words.insert("COMMON", Text::of(common.trim_end()));
    filling.text(text)
}

/// A token that tells one model from another: from all that is written, in the form of a GUID.
fn token(texts: &[&str]) -> String {
    let hash = |seed: u64| {
        let bytes = texts.iter().flat_map(|t| t.bytes());
        bytes.fold(seed, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3))
    };
    let (a, b) = (hash(0xcbf2_9ce4_8422_2325), hash(0x6c62_272e_07bb_0142));
    format!(
        "{{{:08x}-{:04x}-{:04x}-{:04x}-{:012x}}}",
        a >> 32,
        (a >> 16) & 0xffff,
        a & 0xffff,
        b >> 48,
        b & 0xffff_ffff_ffff
    )
}
