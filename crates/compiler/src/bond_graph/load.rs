//! Imports: the files of a model, each read once.

use rustc_hash::FxHashMap;

use super::files::{FileError, Files, read_beside};
use crate::ast::{self, Ast, StatementKind};
use crate::diagnostic::{Diagnostic, Sources, codes};
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
    loader.known.insert(name, 0);
    loader.imports_of(0);
    Loaded { files: loader.trees, imports: loader.imports, faults: loader.faults }
}

struct Loader<'f> {
    files: &'f dyn Files,
    sources: &'f mut Sources,
    /// Index of the tree of every path that was read, or `None` if it could not be.
    known: FxHashMap<String, usize>,
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
                Some((path, span)) => {
                    if let Some(new) = self.import(tree, &path, span) {
                        stack.push((new, imports(&self.trees[new]).into_iter()));
                    }
                }
            }
        }
    }

    /// Reads one import; gives its tree if it is new.
    fn import(&mut self, from: usize, path: &str, span: Span) -> Option<usize> {
        let name = self.sources.name(self.trees[from].file).to_string();
        let near = super::files::beside(&name, path);
        if let Some(&tree) = self.known.get(&near).or_else(|| self.known.get(path)) {
            self.imports.push((self.trees[tree].file, span));
            self.check_circle(tree, from, span);
            return None;
        }
        if self.trees.len() >= MAX_FILES {
            let title = format!("more than {MAX_FILES} files are imported");
            self.faults.push(Diagnostic::error(codes::N013, title, span, "this one is too many"));
            return None;
        }
        match read_beside(self.files, &name, path) {
            Err(why) => {
                self.faults.push(unreadable(path, &near, &why, span));
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
                self.known.insert(found, tree);
                Some(tree)
            }
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
fn imports(tree: &Ast) -> Vec<(String, Span)> {
    let list = tree.statements.iter().filter_map(|s| match &s.kind {
        StatementKind::Import(i) => Some((i.path.text.clone(), i.path.span)),
        _ => None,
    });
    list.collect()
}

fn unreadable(path: &str, near: &str, why: &FileError, span: Span) -> Diagnostic {
    let d = Diagnostic::error(codes::N010, format!("`{path}` cannot be read"), span, why.to_string());
    d.note(format!("looked for at `{near}`")).hint(why.remedy())
}
