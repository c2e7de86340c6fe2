//! The binary of an FMU, by the C compiler of this machine.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::Command;

use halfarrow_emit::File;
use halfarrow_emit::fmu::{self, Version, Written};

use crate::error::Problem;

/// The shared library of an FMU for this machine, at its place within the FMU. The compiler is what `CC` names, else `cc`.
///
/// # Errors
/// There is no compiler, it refuses the sources, or the interface does not know this machine.
pub(crate) fn library(written: &Written, version: Version) -> Result<File, Problem> {
    let (os, architecture) = (std::env::consts::OS, std::env::consts::ARCH);
    let path = fmu::binary_path(version, &written.name, os, architecture)
        .ok_or_else(|| Problem::NoLibrary { why: format!("FMUs have no binaries for {os}") })?;
    let folder = Folder::new(&written.name)?;
    let sources = written.files.iter().filter(|f| f.path.starts_with("sources/"));
    for file in sources.chain(&fmu::headers(version)) {
        let name = file.path.trim_start_matches("sources/");
        fs::write(folder.0.join(name), &file.bytes).map_err(|why| unwritable(&folder.0.join(name), &why))?;
    }
    compile(&folder.0, &written.sources)?;
    let library = folder.0.join(LIBRARY);
    let bytes = fs::read(&library).map_err(|why| Problem::Unreadable { path: library, why: why.to_string() })?;
    Ok(File { path, bytes })
}

const LIBRARY: &str = "library";

fn compile(folder: &Path, sources: &[String]) -> Result<(), Problem> {
    let compiler = std::env::var("CC").unwrap_or_else(|_| "cc".to_string());
    let output = Command::new(&compiler)
        .current_dir(folder)
        .args(["-std=c99", "-O2", "-fPIC", "-shared", "-ffp-contract=off", "-fvisibility=hidden", "-I."])
        .args(sources)
        .args(["-o", LIBRARY, "-lm"])
        .output();
    let output = output.map_err(|why| {
        let why = match why.kind() {
            ErrorKind::NotFound => {
                format!("there is no C compiler called `{compiler}` (the variable CC names another one)")
            }
            _ => format!("{compiler}: {why}"),
        };
        Problem::NoLibrary { why }
    })?;
    match output.status.success() {
        true => Ok(()),
        false => {
            let said = String::from_utf8_lossy(&output.stderr);
            let said: Vec<&str> = said.lines().take(10).collect();
            Err(Problem::NoLibrary { why: format!("{compiler} refuses the sources:\n{}", said.join("\n")) })
        }
    }
}

/// A folder of this run's own, removed when it is done.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Result<Folder, Problem> {
        let base = std::env::temp_dir();
        for attempt in 0..1000 {
            let path = base.join(format!("halfarrow-{name}-{}-{attempt}", std::process::id()));
            match fs::create_dir(&path) {
                Ok(()) => return Ok(Folder(path)),
                Err(why) if why.kind() == ErrorKind::AlreadyExists => {}
                Err(why) => return Err(unwritable(&path, &why)),
            }
        }
        Err(Problem::NoLibrary { why: format!("no folder can be made in {}", base.display()) })
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0); // what is left is in the folder for temporary files
    }
}

fn unwritable(path: &Path, why: &std::io::Error) -> Problem {
    Problem::Unwritable { path: path.into(), why: why.to_string() }
}
