//! Files of a model, from disk.

use std::io::ErrorKind;

use halfarrow_compiler::bond_graph::{FileError, Files};

use crate::model::utf8;

/// The files of the computer, paths as the operating system takes them.
#[derive(Debug, Clone, Copy, Default)]
pub struct Disk;

impl Files for Disk {
    fn read(&self, path: &str) -> Result<String, FileError> {
        let bytes = std::fs::read(path).map_err(|why| match why.kind() {
            ErrorKind::NotFound => FileError::NotFound,
            _ => FileError::Unreadable(why.to_string()),
        })?;
        utf8(bytes).map_err(FileError::Unreadable)
    }
}
