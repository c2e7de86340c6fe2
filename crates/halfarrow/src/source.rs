//! Where models come from: texts in memory, or files below a folder.

use std::collections::BTreeMap;
use std::fmt;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use halfarrow_compiler::bond_graph::{FileError, Files, NoFiles};

use crate::components::WithLibraries;
use crate::error::Problem;
use crate::model::{read_text, utf8};

/// The text of a model, and the files that it may import and read tables from.
///
/// ```
/// use std::collections::BTreeMap;
/// use halfarrow::{Model, Source};
/// let parts = BTreeMap::from([("parts.bond".to_string(), "component Load(port p) { p -> 1:axis -> I:mass(2 kg) }\n".to_string())]);
/// let text = "model Drop\nimport \"parts.bond\"\nSe:weight(9.81 N) -> 1:axis -> Load:load\n";
/// let model = Model::new(Source::text("drop.bond", text).with_files(parts), &[])?;
/// assert_eq!(model.name(), "Drop");
/// # Ok::<(), halfarrow::Error>(())
/// ```
#[derive(Clone)]
pub struct Source {
    name: String,
    text: String,
    files: Arc<dyn Files + Send + Sync>,
}

impl Source {
    /// A text that stands alone. `name` is for messages, and the place beside which files are looked for.
    pub fn text(name: impl Into<String>, text: impl Into<String>) -> Source {
        Source { name: name.into(), text: text.into(), files: Arc::new(WithLibraries(NoFiles)) }
    }

    /// A file; what it imports lies in its folder or below.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn open(path: &Path) -> Result<Source, Problem> {
        Source::open_allowing(path, &[])
    }

    /// The same; what it imports may also lie in these folders or below.
    ///
    /// # Errors
    /// The file cannot be read, or a folder is none.
    pub fn open_allowing(path: &Path, folders: &[PathBuf]) -> Result<Source, Problem> {
        let text = read_text(path)?;
        let own = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let disk = folders.iter().try_fold(Disk::below(own)?, |disk, folder| disk.allow(folder))?;
        Ok(Source::text(path.to_string_lossy(), text).with_files(disk))
    }

    /// The same text with other files: a map from paths to texts, a [`Disk`], or what implements [`Files`].
    #[must_use]
    pub fn with_files(self, files: impl Files + Send + Sync + 'static) -> Source {
        Source { files: Arc::new(WithLibraries(files)), ..self }
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its text.
    pub fn content(&self) -> &str {
        &self.text
    }

    /// The files beside it.
    pub fn files(&self) -> &(dyn Files + Send + Sync) {
        &*self.files
    }

    /// The same, each file being read once: whoever asks again gets the same text.
    pub(crate) fn remembering(self) -> (Source, Arc<Remembered>) {
        let remembered = Arc::new(Remembered { files: self.files, known: Mutex::default() });
        (Source { files: Arc::clone(&remembered) as Arc<dyn Files + Send + Sync>, ..self }, remembered)
    }
}

impl fmt::Debug for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Source").field("name", &self.name).field("text", &self.text).finish_non_exhaustive()
    }
}

/// Files of the computer in some folders and below. Paths are as the operating system takes them; links that lead out
/// of the folders are not followed.
#[derive(Debug, Clone)]
pub struct Disk {
    roots: Vec<Root>,
}

/// A folder: as it was given, and without links.
#[derive(Debug, Clone)]
struct Root {
    given: PathBuf,
    real: PathBuf,
}

impl Disk {
    /// What lies in a folder and below.
    ///
    /// # Errors
    /// There is no such folder.
    pub fn below(folder: &Path) -> Result<Disk, Problem> {
        Disk { roots: Vec::new() }.allow(folder)
    }

    /// Also what lies in this folder and below.
    ///
    /// # Errors
    /// There is no such folder.
    pub fn allow(mut self, folder: &Path) -> Result<Disk, Problem> {
        let unreadable = |why: String| Problem::Unreadable { path: folder.into(), why };
        let real = folder.canonicalize().map_err(|why| unreadable(why.to_string()))?;
        if !real.is_dir() {
            return Err(unreadable("it is no folder".into()));
        }
        self.roots.push(Root { given: plain(folder), real });
        Ok(self)
    }

    fn refusal(&self, path: &str) -> FileError {
        let folder = Path::new(path).parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let roots: Vec<String> = self.roots.iter().map(|root| root.given.display().to_string()).collect();
        FileError::Refused {
            why: format!("it does not lie in the folder of the model or below: {}", roots.join(", ")),
            remedy: format!(
                "move it there, or allow its folder: `--allow {}`, in a program `Disk::allow`",
                folder.display()
            ),
        }
    }
}

impl Files for Disk {
    fn read(&self, path: &str) -> Result<String, FileError> {
        utf8(self.read_bytes(path)?).map_err(FileError::Unreadable)
    }

    fn read_bytes(&self, path: &str) -> Result<Vec<u8>, FileError> {
        let real = match Path::new(path).canonicalize() {
            Ok(real) => real,
            // Nobody learns here what there is elsewhere.
            Err(_) if !self.roots.iter().any(|root| plain(Path::new(path)).starts_with(&root.given)) => {
                return Err(self.refusal(path));
            }
            Err(why) if why.kind() == ErrorKind::NotFound => return Err(FileError::NotFound),
            Err(why) => return Err(FileError::Unreadable(why.to_string())),
        };
        if !self.roots.iter().any(|root| real.starts_with(&root.real)) {
            return Err(self.refusal(path));
        }
        std::fs::read(real).map_err(|why| FileError::Unreadable(why.to_string()))
    }
}

/// A path from the root of the file system, with `.` and `..` resolved by its text alone.
fn plain(path: &Path) -> PathBuf {
    let whole = std::path::absolute(path).unwrap_or_else(|_| path.into());
    let mut plain = PathBuf::new();
    for part in whole.components() {
        match part {
            std::path::Component::ParentDir => _ = plain.pop(),
            std::path::Component::CurDir => {}
            part => plain.push(part),
        }
    }
    plain
}

/// Files that stay as they were when they were read first.
pub(crate) struct Remembered {
    files: Arc<dyn Files + Send + Sync>,
    known: Mutex<BTreeMap<String, Result<String, FileError>>>,
}

impl Remembered {
    /// What was read, by path.
    pub fn texts(&self) -> BTreeMap<String, String> {
        let known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        known.iter().filter_map(|(path, read)| Some((path.clone(), read.clone().ok()?))).collect()
    }
}

impl Files for Remembered {
    fn read(&self, path: &str) -> Result<String, FileError> {
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        known.entry(path.to_string()).or_insert_with(|| self.files.read(path)).clone()
    }

    fn read_bytes(&self, path: &str) -> Result<Vec<u8>, FileError> {
        self.files.read_bytes(path)
    }

    fn library(&self, name: &str) -> Option<String> {
        self.files.library(name)
    }

    fn libraries(&self) -> Vec<String> {
        self.files.libraries()
    }
}
