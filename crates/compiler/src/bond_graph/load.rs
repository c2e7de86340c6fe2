//! Imports: the files of a model, each read once.

use rustc_hash::FxHashMap;

use super::files::{FileError, Files, read_beside};
use crate::ast::{self, Ast, StatementKind};
use crate::diagnostic::{Diagnostic, Sources, codes, nearest};
use crate::span::{FileId, Span};

/// The greatest number of files of a model.
const MAX_FILES: usize = 1000;

/// The files of a model, the main one first, and what is wrong with the others.
pub(super) struct Loaded {
    /// The trees.
    pub files: Vec<Ast>,
    /// Where files are imported.
    pub imports: Vec<(FileId, Span)>,
    /// Faults of imports and of the syntax of imported files.
    pub faults: Vec<Diagnostic>,
}

/// Reads what the main file imports, and what that imports.
pub(super) fn load(main: Ast, sources: &mut Sources, files: &dyn Files) -> Loaded {
    let mut loader = Loader {
        files,
        sources,
        known: FxHashMap::default(),
        open: vec![true],
        imported_at: vec![None],
        trees: vec![main],
        imports: Vec::new(),
        faults: Vec::new(),
    };
    let name = loader.sources.name(loader.trees[0].file).to_string();
    loader.known.insert((false, name), 0);
    loader.imports_of(0);
    Loaded { files: loader.trees, imports: loader.imports, faults: loader.faults }
}

struct Loader<'f> {
    files: &'f dyn Files,
    sources: &'f mut Sources,
    /// Index of the tree of every library (true) and file that was read, by its name or path.
    known: FxHashMap<(bool, String), usize>,
    /// Whether the imports of the tree are being followed.
    open: Vec<bool>,
    /// The import that brought the tree, and the tree that it stands in.
    imported_at: Vec<Option<(usize, Span)>>,
    trees: Vec<Ast>,
    imports: Vec<(FileId, Span)>,
    faults: Vec<Diagnostic>,
}

impl Loader<'_> {
    fn imports_of(&mut self, tree: usize) {
        // Depth first without recursion: the stack holds what is still to be imported.
        let mut stack = vec![(tree, imports(&self.trees[tree]).into_iter())];
        while let Some((tree, rest)) = stack.last_mut() {
            let tree = *tree;
            match rest.next() {
                None => {
                    self.open[tree] = false;
                    stack.pop();
                }
                Some(import) => {
                    if let Some(new) = self.import(tree, &import) {
                        stack.push((new, imports(&self.trees[new]).into_iter()));
                    }
                }
            }
        }
    }

    /// Reads one import; gives its tree if it is new.
    fn import(&mut self, from: usize, import: &ast::Import) -> Option<usize> {
        let (path, span, library) = (import.path.text.as_str(), import.path.span, import.library);
        let name = self.sources.name(self.trees[from].file).to_string();
        let near = if library { path.to_string() } else { super::files::beside(&name, path) };
        let known = |path: &str| self.known.get(&(library, path.to_string()));
        if let Some(&tree) = known(&near).or_else(|| known(path)) {
            self.imports.push((self.trees[tree].file, span));
            self.check_circle(tree, from, span);
            return None;
        }
        if self.trees.len() >= MAX_FILES {
            let title = format!("more than {MAX_FILES} files are imported");
            self.faults.push(Diagnostic::error(codes::N013, title, span, "this one is too many"));
            return None;
        }
        let read = match library {
            true => self.files.library(path).map(|text| (near, text)).ok_or_else(|| self.no_library(path, span)),
            false => read_beside(self.files, &name, path).map_err(|why| unreadable(path, &near, &why, span)),
        };
        match read {
            Err(fault) => {
                self.faults.push(fault);
                None
            }
            Ok((found, text)) => {
                let file = self.sources.add(found.clone(), text);
                let parsed = ast::parse(self.sources.text(file), file);
                // A file that is imported needs no model line.
                self.faults.extend(parsed.diagnostics.into_iter().filter(|d| d.code != codes::S005));
                self.trees.push(parsed.ast);
                self.open.push(true);
                self.imported_at.push(Some((from, span)));
                let tree = self.trees.len() - 1;
                self.imports.push((file, span));
                self.known.insert((library, found), tree);
                Some(tree)
            }
        }
    }

    fn no_library(&self, name: &str, span: Span) -> Diagnostic {
        let all = self.files.libraries();
        let d = Diagnostic::error(codes::N010, format!("there is no library `{name}`"), span, "not known");
        let d = if all.is_empty() { d } else { d.note(format!("there are {}", all.join(", "))) };
        match nearest(name, all.iter().map(String::as_str)) {
            Some(near) => d.hint(format!("did you mean `{near}`?")),
            None => d.hint("a file is imported by its path, in quotes: `import \"file.bond\"`"),
        }
    }

    /// A file that is still being imported imports itself, perhaps through others.
    fn check_circle(&mut self, tree: usize, from: usize, span: Span) {
        if !self.open[tree] {
            return;
        }
        let mut around = vec![self.sources.name(self.trees[tree].file).to_string()];
        let mut at = from;
        let mut d = Diagnostic::error(codes::N011, "imports run in a circle", span, "this closes the circle");
        while at != tree {
            around.push(self.sources.name(self.trees[at].file).to_string());
            let Some((outer, place)) = self.imported_at[at] else { break };
            d = d.also(place, "imported here");
            at = outer;
        }
        around.push(around[0].clone());
        around.reverse();
        let hint = "put what both need into a third file";
        self.faults.push(d.note(around.join(" -> ")).hint(hint));
    }
}

/// The imports of a file.
fn imports(tree: &Ast) -> Vec<ast::Import> {
    let list = tree.statements.iter().filter_map(|s| match &s.kind {
        StatementKind::Import(i) => Some(i.clone()),
        _ => None,
    });
    list.collect()
}

fn unreadable(path: &str, near: &str, why: &FileError, span: Span) -> Diagnostic {
    let d = Diagnostic::error(codes::N010, format!("`{path}` cannot be read"), span, why.to_string());
    d.note(format!("looked for at `{near}`")).hint(why.remedy())
}
