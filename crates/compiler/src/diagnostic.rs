//! What is told to the modeller: place, what, why, what to do.

pub mod codes;
mod render;

use crate::span::{FileId, Span};
pub use codes::DiagnosticCode;
pub use render::{render, to_json};

/// How bad it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Severity {
    /// The model cannot be used.
    Error,
    /// Legal, but odd.
    Warning,
}

/// A place in the model and what is to be said about it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Label {
    /// The place.
    pub span: Span,
    /// What is the matter there; may be empty.
    pub text: String,
}

/// One fault or oddity of a model.
///
/// ```
/// use halfarrow_compiler::diagnostic::{Diagnostic, codes};
/// use halfarrow_compiler::span::Span;
/// let d = Diagnostic::error(codes::S001, "a value is missing", Span::default(), "here")
///     .hint("write a number or a name");
/// assert_eq!(d.code.name, "S001");
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Diagnostic {
    /// How bad it is.
    pub severity: Severity,
    /// Which fault; see [`codes`].
    pub code: DiagnosticCode,
    /// What is wrong, in modelling words.
    pub title: String,
    /// The place.
    pub primary: Label,
    /// Other places that matter.
    pub others: Vec<Label>,
    /// Why.
    pub notes: Vec<String>,
    /// What to do.
    pub hint: Option<String>,
}

impl Diagnostic {
    /// An error at a place.
    pub fn error(code: DiagnosticCode, title: impl Into<String>, span: Span, text: impl Into<String>) -> Diagnostic {
        Diagnostic {
            severity: Severity::Error,
            code,
            title: title.into(),
            primary: Label { span, text: text.into() },
            others: Vec::new(),
            notes: Vec::new(),
            hint: None,
        }
    }

    /// A warning at a place.
    pub fn warning(code: DiagnosticCode, title: impl Into<String>, span: Span, text: impl Into<String>) -> Diagnostic {
        Diagnostic { severity: Severity::Warning, ..Diagnostic::error(code, title, span, text) }
    }

    /// The same, with one more place.
    pub fn also(mut self, span: Span, text: impl Into<String>) -> Diagnostic {
        self.others.push(Label { span, text: text.into() });
        self
    }

    /// The same, with one more reason.
    pub fn note(mut self, text: impl Into<String>) -> Diagnostic {
        self.notes.push(text.into());
        self
    }

    /// The same, with what to do.
    pub fn hint(mut self, text: impl Into<String>) -> Diagnostic {
        self.hint = Some(text.into());
        self
    }

    /// Whether the model cannot be used.
    pub fn is_error(&self) -> bool {
        self.severity == Severity::Error
    }
}

/// Several diagnostics, as a stage returns them when there is an error among them.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Diagnostics(pub Vec<Diagnostic>);

impl Diagnostics {
    /// Whether the model cannot be used.
    pub fn has_errors(&self) -> bool {
        self.0.iter().any(Diagnostic::is_error)
    }
}

impl From<Diagnostic> for Diagnostics {
    fn from(one: Diagnostic) -> Self {
        Diagnostics(vec![one])
    }
}

impl From<Vec<Diagnostic>> for Diagnostics {
    fn from(several: Vec<Diagnostic>) -> Self {
        Diagnostics(several)
    }
}

impl std::fmt::Display for Diagnostics {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (i, d) in self.0.iter().enumerate() {
            let severity = if d.is_error() { "error" } else { "warning" };
            let end = if i + 1 < self.0.len() { "\n" } else { "" };
            write!(f, "{severity}[{}]: {}{end}", d.code.name, d.title)?;
        }
        Ok(())
    }
}

impl std::error::Error for Diagnostics {}

/// The names and texts of the files of a model, by [`FileId`].
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Sources {
    files: Vec<(String, String)>,
}

impl Sources {
    /// No files yet.
    pub fn new() -> Sources {
        Sources::default()
    }

    /// Adds a file; the first one is the main file.
    pub fn add(&mut self, name: impl Into<String>, text: impl Into<String>) -> FileId {
        self.files.push((name.into(), text.into()));
        FileId(u32::try_from(self.files.len() - 1).expect("fewer than 2^32 files"))
    }

    /// The name under which the file was read; empty if there is no such file.
    pub fn name(&self, file: FileId) -> &str {
        self.files.get(file.0 as usize).map_or("", |(name, _)| name)
    }

    /// The text of the file; empty if there is no such file.
    pub fn text(&self, file: FileId) -> &str {
        self.files.get(file.0 as usize).map_or("", |(_, text)| text)
    }

    /// The texts of all files, in order.
    pub fn texts(&self) -> impl ExactSizeIterator<Item = &str> {
        self.files.iter().map(|(_, text)| text.as_str())
    }

    /// The text at a place; empty if there is none.
    pub fn slice(&self, span: Span) -> &str {
        self.text(span.file).get(span.start as usize..span.end as usize).unwrap_or("")
    }
}

/// The candidate that is most like a misspelt name, if one is near enough to be meant.
///
/// ```
/// use halfarrow_compiler::diagnostic::nearest;
/// assert_eq!(nearest("spirng", ["damper", "spring"]), Some("spring"));
/// assert_eq!(nearest("x", ["damper", "spring"]), None);
/// ```
pub fn nearest<'c>(name: &str, candidates: impl IntoIterator<Item = &'c str>) -> Option<&'c str> {
    let length = name.chars().count();
    candidates
        .into_iter()
        .filter(|c| *c != name && c.chars().count().abs_diff(length) <= 3)
        .map(|c| (edits(name, c), c))
        .filter(|(edits, c)| *edits <= length.max(c.chars().count()) / 3)
        .min()
        .map(|(_, c)| c)
}

/// Edits between two names; a change of case counts as none.
fn edits(a: &str, b: &str) -> usize {
    strsim::osa_distance(&a.to_lowercase(), &b.to_lowercase())
}
