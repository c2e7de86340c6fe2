//! A model that can be asked.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use halfarrow_compiler::ast;
use halfarrow_compiler::bond_graph::{BondGraph, FileError, Override};
use halfarrow_compiler::causal_graph::{self, CausalGraph, assign_causality};
use halfarrow_compiler::causal_paths::{CausalPaths, find_paths};
use halfarrow_compiler::compile::{self, Found, Reached, Read, Text};
use halfarrow_compiler::continuation::Family;
use halfarrow_compiler::diagnostic::{Diagnostics, Sources};
use halfarrow_compiler::equations::{Equations, Form, derive_equations};
use halfarrow_compiler::program::{Program, schedule};
use halfarrow_compiler::span::FileId;

use crate::error::{Error, Problem};
use crate::source::{Remembered, Source};
use crate::watch::{StageTime, Watch};

/// A model without errors in its text, its names, its units and its bonds, and what was noticed in it.
#[derive(Debug, Clone)]
pub struct Model {
    pub(crate) graph: Arc<BondGraph>,
    /// What the graph is the continuation of, if it is one.
    pub(crate) family: Option<Arc<Continued>>,
    pub(crate) found: Found,
    pub(crate) watch: Watch,
    origin: Arc<Origin>,
}

/// What a model was made of.
struct Origin {
    source: Source,
    files: Arc<Remembered>,
    overrides: Vec<Override>,
}

/// Smaller models that one continues, and the program of its minimal form until somebody takes it.
pub(crate) struct Continued {
    family: Family,
    minimal: Mutex<Option<Program>>,
    /// Whether there was one.
    has_minimal: bool,
}

impl Continued {
    /// The family of a model, if there is one, and the model as its continuation. The program is made beside the graph.
    fn of(text: Text<'_>, read: &Read) -> Option<(Continued, Reached<BondGraph>)> {
        let mut family = Family::of(text, read)?;
        loop {
            let (reached, minimal) = rayon::join(|| family.bond_graph(), || family.program(Form::Minimal));
            if let Some(reached) = reached {
                let has_minimal = minimal.is_some();
                return Some((Continued { family, minimal: Mutex::new(minimal), has_minimal }, reached));
            }
            family = family.larger(text, read)?;
        }
    }

    /// The program of the minimal form, if it was made and is there yet.
    fn minimal(&self, form: Form) -> Option<Program> {
        let mut minimal = self.minimal.lock().unwrap_or_else(PoisonError::into_inner);
        minimal.take_if(|_| form == Form::Minimal)
    }
}

impl std::fmt::Debug for Continued {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:?}", self.family)
    }
}

impl std::fmt::Debug for Origin {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:?} with {:?}", self.source, self.overrides)
    }
}

impl Model {
    /// A model from its source; `set` replaces values of parameters.
    ///
    /// # Errors
    /// The model has errors.
    pub fn new(source: Source, set: &[Override]) -> Result<Model, Error> {
        let (source, files) = source.remembering();
        Model::read(source, files, set.to_vec())
    }

    /// Reads a model from disk, with what it imports from the folder of the file and below; `set` replaces values of
    /// parameters.
    ///
    /// # Errors
    /// The file cannot be read, or the model has errors.
    pub fn load(path: &Path, set: &[Override]) -> Result<Model, Error> {
        Model::new(Source::open(path)?, set)
    }

    /// A model from its text, which stands alone. `name` is for messages.
    ///
    /// # Errors
    /// The model has errors.
    pub fn from_text(name: &str, text: &str, set: &[Override]) -> Result<Model, Error> {
        Model::new(Source::text(name, text), set)
    }

    fn read(source: Source, files: Arc<Remembered>, overrides: Vec<Override>) -> Result<Model, Error> {
        let text = Text { name: source.name(), text: source.content(), files: source.files(), overrides: &overrides };
        let watch = Watch::default();
        let read = watch.time("ast", || compile::read(text));
        let (family, Reached { ir: graph, found }) = watch.time("bond_graph", || match Continued::of(text, &read) {
            Some((family, reached)) => Ok((Some(Arc::new(family)), reached)),
            None => compile::bond_graph_of(read, text).map(|reached| (None, reached)),
        })?;
        let origin = Arc::new(Origin { source, files, overrides });
        Ok(Model { graph: Arc::new(graph), family, found, watch, origin })
    }

    /// The same model with other values of parameters in the place of those that it has. Files are not read again.
    ///
    /// # Errors
    /// The model has errors with these values.
    pub fn with(&self, set: &[Override]) -> Result<Model, Error> {
        let Origin { source, files, overrides } = &*self.origin;
        let kept = overrides.iter().filter(|o| !set.iter().any(|s| s.name == o.name));
        let all: Vec<Override> = kept.chain(set).cloned().collect();
        Model::read(source.clone(), Arc::clone(files), all)
    }

    /// The same model with another graph.
    pub(crate) fn with_graph(&self, graph: BondGraph) -> Model {
        Model { graph: Arc::new(graph), family: None, ..self.clone() }
    }

    /// Its text, and the files that it read: the same model can be made of them elsewhere.
    pub fn source(&self) -> Source {
        let Origin { source, files, .. } = &*self.origin;
        Source::text(source.name(), source.content()).with_files(files.texts())
    }

    /// Whether it was read from the same texts.
    pub(crate) fn has_text_of(&self, other: &Model) -> bool {
        let (own, others) = (&self.origin, &other.origin);
        let same = || own.source.content() == others.source.content() && own.files.texts() == others.files.texts();
        Arc::ptr_eq(own, others) || same()
    }

    /// The bytes of a file, whose path is seen from where its text is.
    pub(crate) fn source_bytes(&self, path: &str) -> Result<Vec<u8>, FileError> {
        self.origin.source.files().read_bytes(path)
    }

    /// The files that it read, by path, libraries that come with the program apart.
    pub fn files(&self) -> BTreeMap<String, String> {
        self.origin.files.texts()
    }

    /// The values of parameters that were replaced.
    pub fn overrides(&self) -> &[Override] {
        &self.origin.overrides
    }

    /// Its name, as the text says.
    pub fn name(&self) -> &str {
        &self.graph.name
    }

    /// Why there is nothing to ask of it: the file has only components.
    pub fn absent(&self) -> Option<Problem> {
        if !self.graph.name.is_empty() || self.graph.elements.iter().next().is_some() {
            return None;
        }
        let source = &self.origin.source;
        let read = ast::parse(source.content(), FileId(0)).ast;
        let component = |statement: &ast::Statement| match &statement.kind {
            ast::StatementKind::Component(component) => Some(component.name.text.clone()),
            _ => None,
        };
        let components: Vec<String> = read.statements.iter().filter_map(component).collect();
        let name = source.name().to_string();
        (!components.is_empty()).then_some(Problem::NoModel { name, components })
    }

    /// Everything that is odd about it: warnings of all stages.
    ///
    /// # Errors
    /// The model has errors that only later stages find.
    pub fn check(&self) -> Result<Found, Error> {
        let causal = self.causal_graph()?;
        let mut found = self.found.clone();
        found.diagnostics.0.extend(causal_graph::warnings(&causal));
        let equations = self.watch.time("equations", || derive_equations(&causal, Form::Minimal));
        let equations = equations.map_err(|errors| {
            let mut all = found.clone();
            all.diagnostics.0.extend(errors.0);
            Error::Model(all)
        })?;
        self.check_start(&equations)?;
        Ok(found)
    }

    /// What was noticed in its text, names, units and bonds.
    pub fn warnings(&self) -> &Found {
        &self.found
    }

    pub(crate) fn causal_graph(&self) -> Result<CausalGraph, Error> {
        self.watch.time("causal_graph", || assign_causality(&self.graph)).map_err(|errors| self.fault(errors))
    }

    pub(crate) fn equations_in(&self, form: Form) -> Result<Equations, Error> {
        self.equations_of(&self.causal_graph()?, form)
    }

    pub(crate) fn equations_of(&self, causal: &CausalGraph, form: Form) -> Result<Equations, Error> {
        self.watch.time("equations", || derive_equations(causal, form)).map_err(|errors| self.fault(errors))
    }

    pub(crate) fn paths_of(&self, causal: &CausalGraph) -> CausalPaths {
        self.watch.time("causal_paths", || find_paths(causal))
    }

    /// The same model without smaller ones that it continues.
    pub(crate) fn as_it_stands(&self) -> Model {
        Model { family: None, ..self.clone() }
    }

    /// The program of a model that continues smaller ones, as the continuation of theirs.
    pub(crate) fn continued_program(&self, form: Form) -> Option<Program> {
        let own = self.family.as_ref()?;
        if let Some(minimal) = own.minimal(form) {
            return Some(minimal);
        }
        let Origin { source, overrides, .. } = &*self.origin;
        let text = Text { name: source.name(), text: source.content(), files: source.files(), overrides };
        let again = form != Form::Minimal || own.has_minimal;
        let first = again.then(|| own.family.program(form)).flatten();
        first.or_else(|| own.family.larger(text, &compile::read(text))?.program(form))
    }

    pub(crate) fn program_of(&self, equations: &Equations) -> Program {
        self.watch.time("program", || schedule(equations))
    }

    /// How many expressions its bond graph is made of: what it takes to read it, as a count.
    pub fn expressions(&self) -> usize {
        self.graph.exprs.len()
    }

    /// What the stages took so far that this model, or a copy of it, went through.
    pub fn timings(&self) -> Vec<StageTime> {
        self.watch.noted()
    }

    /// Does something with the model, and notes under a name what it took.
    pub fn timed<T>(&self, stage: &'static str, work: impl FnOnce() -> T) -> T {
        self.watch.time(stage, work)
    }

    /// Errors of a later stage, with the warnings before them.
    pub(crate) fn fault(&self, errors: Diagnostics) -> Error {
        let mut found = self.found.clone();
        found.diagnostics.0.extend(errors.0);
        Error::Model(found)
    }
}

/// The text of a model in canonical layout. `name` is for messages.
///
/// # Errors
/// The text has errors.
pub fn format_text(name: &str, text: &str) -> Result<String, Error> {
    ast::format(text).map_err(|errors| {
        let mut sources = Sources::new();
        sources.add(name, text);
        Error::Model(Found { diagnostics: Diagnostics(errors), sources, ..Found::default() })
    })
}

/// The text of a file.
///
/// # Errors
/// It cannot be read, or is not UTF-8; then the words say where.
pub fn read_text(path: &Path) -> Result<String, Problem> {
    let unreadable = |why: String| Problem::Unreadable { path: path.into(), why };
    let bytes = std::fs::read(path).map_err(|why| unreadable(why.to_string()))?;
    utf8(bytes).map_err(unreadable)
}

/// Text of bytes; in the error the place of the first one that is no UTF-8.
pub(crate) fn utf8(bytes: Vec<u8>) -> Result<String, String> {
    String::from_utf8(bytes).map_err(|why| {
        let (sound, rest) = why.as_bytes().split_at(why.utf8_error().valid_up_to());
        let line = 1 + sound.iter().filter(|b| **b == b'\n').count();
        let begun = sound.rsplit(|b| *b == b'\n').next().unwrap_or_default();
        let column = 1 + String::from_utf8_lossy(begun).chars().count();
        let byte = rest.first().copied().unwrap_or_default();
        format!("the byte 0x{byte:02x} at line {line}, column {column} is not UTF-8: save the file in this encoding")
    })
}
