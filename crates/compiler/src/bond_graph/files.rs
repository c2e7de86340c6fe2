//! Files that a model refers to: imports and tables. The compiler opens none itself.

use std::collections::BTreeMap;

/// Where imported models and tables come from.
pub trait Files {
    /// The text of a file. The path is the one written, seen from the folder of the file that names it, with `/`
    /// between folders; a path that is not found there is asked for once more as written (a library).
    ///
    /// # Errors
    /// Why it cannot be read.
    fn read(&self, path: &str) -> Result<String, FileError>;

    /// The bytes of a file that is no text. The path is one as in [`read`](Files::read).
    ///
    /// # Errors
    /// Why it cannot be read.
    fn read_bytes(&self, path: &str) -> Result<Vec<u8>, FileError> {
        self.read(path).map(String::into_bytes)
    }

    /// The text of a library, by its name as in `import std.electrical`.
    fn library(&self, _name: &str) -> Option<String> {
        None
    }

    /// The names of the libraries that there are.
    fn libraries(&self) -> Vec<String> {
        Vec::new()
    }
}

/// Why a file cannot be read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum FileError {
    /// There is none of that name.
    NotFound,
    /// It is there, but cannot be read as text; the system says why.
    Unreadable(String),
    /// It lies where the model may read nothing.
    Refused {
        /// Why.
        why: String,
        /// What can be done about it.
        remedy: String,
    },
}

impl FileError {
    /// What can be done about it.
    pub(super) fn remedy(&self) -> &str {
        match self {
            FileError::NotFound | FileError::Unreadable(_) => {
                "paths are seen from the folder of the file that names them"
            }
            FileError::Refused { remedy, .. } => remedy,
        }
    }
}

impl std::fmt::Display for FileError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            FileError::NotFound => f.write_str("there is no such file"),
            FileError::Unreadable(why) | FileError::Refused { why, .. } => f.write_str(why),
        }
    }
}

impl std::error::Error for FileError {}

/// No files at all: for models that stand alone.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoFiles;

impl Files for NoFiles {
    fn read(&self, _: &str) -> Result<String, FileError> {
        Err(FileError::NotFound)
    }
}

/// Files in memory, by path.
impl Files for BTreeMap<String, String> {
    fn read(&self, path: &str) -> Result<String, FileError> {
        self.get(path).cloned().ok_or(FileError::NotFound)
    }
}

/// `path` as seen from the folder of the file `from`, with `.` and `..` resolved where possible.
pub(super) fn beside(from: &str, path: &str) -> String {
    if path.starts_with('/') {
        return path.to_string();
    }
    let folder = from.rfind('/').map_or("", |slash| &from[..slash + 1]);
    let (root, rest) = folder.strip_prefix('/').map_or(("", folder), |rest| ("/", rest));
    let mut parts: Vec<&str> = Vec::new();
    for part in rest.split('/').chain(path.split('/')) {
        match part {
            "" | "." => {}
            ".." if parts.last().is_some_and(|p| *p != "..") => {
                parts.pop();
            }
            part => parts.push(part),
        }
    }
    format!("{root}{}", parts.join("/"))
}

/// Reads `path` beside `from`, else as written. Gives the path under which it was found, and the text.
///
/// # Errors
/// Why it cannot be read where it was looked for first.
pub(super) fn read_beside(files: &dyn Files, from: &str, path: &str) -> Result<(String, String), FileError> {
    let near = beside(from, path);
    match files.read(&near) {
        Ok(text) => Ok((near, text)),
        Err(why) if near == path => Err(why),
        Err(why) => files.read(path).map(|text| (path.to_string(), text)).map_err(|_| why),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_seen_from_the_folder_of_the_file_that_names_them() {
        assert_eq!(beside("models/car/main.bond", "tyre.bond"), "models/car/tyre.bond");
        assert_eq!(beside("models/car/main.bond", "../lib/./tyre.bond"), "models/lib/tyre.bond");
        assert_eq!(beside("main.bond", "../tyre.bond"), "../tyre.bond");
        assert_eq!(beside("/home/x/main.bond", "a.csv"), "/home/x/a.csv");
        assert_eq!(beside("main.bond", "/lib/a.csv"), "/lib/a.csv");
    }
}
