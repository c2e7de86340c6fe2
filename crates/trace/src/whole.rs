//! Files that are written whole or not at all.

use std::fmt;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// A file could not be written. What stood there before is unchanged.
#[derive(Debug)]
pub struct WriteError {
    /// The file.
    pub path: PathBuf,
    /// Why.
    pub source: io::Error,
}

/// Writes a file through a neighbour of another name that takes its place when it is complete, so that nobody ever
/// finds half of it. What is no ordinary file, such as a pipe or a terminal, is written to directly.
///
/// # Errors
/// The folder does not exist, the disk is full, and the like.
pub fn write_whole(
    path: &Path,
    fill: impl FnOnce(&mut (dyn Write + Send)) -> io::Result<()>,
) -> Result<(), WriteError> {
    let ordinary = fs::metadata(path).map_or(true, |metadata| metadata.is_file());
    let written = if ordinary { replace(path, fill) } else { File::create(path).and_then(|file| fill_up(file, fill)) };
    written.map_err(|source| WriteError { path: path.to_owned(), source })
}

fn replace(path: &Path, fill: impl FnOnce(&mut (dyn Write + Send)) -> io::Result<()>) -> io::Result<()> {
    let name = path.file_name().ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "it has no file name"))?;
    let mut neighbour = std::ffi::OsString::from(".");
    neighbour.push(name);
    neighbour.push(format!(".{}.part", std::process::id()));
    let neighbour = path.with_file_name(neighbour);
    let written =
        File::create(&neighbour).and_then(|file| fill_up(file, fill)).and_then(|()| fs::rename(&neighbour, path));
    if written.is_err() {
        let _ = fs::remove_file(&neighbour); // it may not be there; the first error is the one to tell
    }
    written
}

fn fill_up(file: File, fill: impl FnOnce(&mut (dyn Write + Send)) -> io::Result<()>) -> io::Result<()> {
    let ordinary = file.metadata()?.is_file();
    let mut writer = BufWriter::new(file);
    fill(&mut writer)?;
    let file = writer.into_inner().map_err(io::IntoInnerError::into_error)?;
    if ordinary { file.sync_all() } else { Ok(()) }
}

impl fmt::Display for WriteError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let folder = self.path.parent().filter(|folder| !folder.as_os_str().is_empty() && !folder.exists());
        write!(f, "{} cannot be written: ", self.path.display())?;
        match folder {
            Some(folder) => write!(f, "the folder {} does not exist; make it first", folder.display()),
            None => self.source.fmt(f),
        }
    }
}

impl std::error::Error for WriteError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        Some(&self.source)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_what_was_there() {
        let folder = temp_dir::TempDir::new().unwrap();
        let path = folder.path().join("x.csv");
        write_whole(&path, |out| out.write_all(b"old")).unwrap();
        let failed = write_whole(&path, |out| {
            out.write_all(b"new")?;
            Err(io::Error::other("the run failed"))
        });
        assert_eq!(failed.unwrap_err().source.to_string(), "the run failed");
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is left behind");
    }

    #[test]
    fn a_missing_folder_is_named() {
        let folder = temp_dir::TempDir::new().unwrap();
        let error = write_whole(&folder.path().join("no/x.csv"), |_| Ok(())).unwrap_err().to_string();
        assert!(error.ends_with("no does not exist; make it first"), "{error}");
    }
}
