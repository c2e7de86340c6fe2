//! The components that come with the program: model text, imported by name.

use halfarrow_compiler::ast::{self, Declaration, StatementKind};
use halfarrow_compiler::bond_graph::{FileError, Files};
use halfarrow_compiler::span::FileId;
use halfarrow_compiler::unit::Unit;
use serde::Serialize;

use crate::error::Problem;

/// The files, by the names under which they are imported.
const TEXTS: [(&str, &str); 8] = [
    ("std.electrical", include_str!("../../../library/std/electrical.bond")),
    ("std.mechanical", include_str!("../../../library/std/mechanical.bond")),
    ("std.multibody", include_str!("../../../library/std/multibody.bond")),
    ("std.planar", include_str!("../../../library/std/planar.bond")),
    ("std.vehicle", include_str!("../../../library/std/vehicle.bond")),
    ("std.hydraulic", include_str!("../../../library/std/hydraulic.bond")),
    ("std.thermal", include_str!("../../../library/std/thermal.bond")),
    ("std.signals", include_str!("../../../library/std/signals.bond")),
];

/// A file of components: `import std.electrical`.
#[derive(Debug, Clone, Serialize)]
pub struct Library {
    /// The name under which it is imported.
    pub name: String,
    /// What holds for all of its components.
    pub about: String,
    /// Its components, in the order of the file.
    pub components: Vec<Component>,
}

/// A component of a library.
#[derive(Debug, Clone, Serialize)]
pub struct Component {
    /// Its name, used as a kind: `Resistor`.
    pub name: String,
    /// What it is, in one line.
    pub doc: String,
    /// The law that it obeys, and where that is taken from, as they stand above it.
    pub law: String,
    /// Where bonds end.
    pub ports: Vec<Entry>,
    /// Its parameters.
    pub parameters: Vec<Entry>,
    /// What it is made for, of numbers and parameters.
    pub constants: Vec<Entry>,
    /// The signals that it reads.
    pub inputs: Vec<Entry>,
    /// The signals that it gives.
    pub outputs: Vec<Entry>,
    /// Its text.
    pub text: String,
}

/// A name in the head of a component.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Entry {
    /// The name.
    pub name: String,
    /// Its default, as written; for an output, nothing.
    pub default: Option<String>,
    /// Its unit, as written.
    pub unit: Option<String>,
    /// What it is.
    pub doc: String,
}

impl Library {
    /// All libraries that come with the program.
    ///
    /// ```
    /// let motor = halfarrow::Library::all().into_iter().flat_map(|l| l.components).find(|c| c.name == "DCMotor");
    /// assert_eq!(motor.unwrap().ports.len(), 2);
    /// ```
    pub fn all() -> Vec<Library> {
        TEXTS.iter().map(|(name, text)| Library::of(name, text)).collect()
    }

    /// The text of the library with that name.
    pub fn text(name: &str) -> Option<&'static str> {
        TEXTS.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
    }

    /// What a name means: nothing all libraries, `electrical` or `std.electrical` one of them, `electrical.DCMotor`, with or
    /// without `std.`, or `DCMotor` that library with this component alone.
    ///
    /// # Errors
    /// Neither a library nor a component has that name.
    pub fn named(name: &str) -> Result<Vec<Library>, Problem> {
        let plain = name.strip_prefix("std.").unwrap_or(name);
        if plain.is_empty() || plain == "std" {
            return Ok(Library::all());
        }
        let mut found = Vec::new();
        for library in Library::all() {
            let short = library.name.trim_start_matches("std.").to_string();
            let means =
                |c: &Component| plain == c.name || plain.strip_prefix(&format!("{short}.")) == Some(c.name.as_str());
            if short == plain {
                return Ok(vec![library]);
            }
            if library.components.iter().any(means) {
                let components = library.components.iter().filter(|c| means(c)).cloned().collect();
                found.push(Library { components, ..library });
            }
        }
        if found.is_empty() { Err(unknown(name, plain)) } else { Ok(found) }
    }

    fn of(name: &str, text: &str) -> Library {
        let tree = ast::parse(text, FileId(0)).ast;
        let components = tree.statements.iter().filter_map(|s| match &s.kind {
            StatementKind::Component(c) => Some(Component::of(c, text, (s.span.start as usize, s.span.end as usize))),
            _ => None,
        });
        let about: Vec<&str> = text.lines().map_while(|line| line.strip_prefix("//")).map(str::trim).collect();
        Library { name: name.into(), about: about.join(" "), components: components.collect() }
    }
}

/// That there is nothing of this name, and what is near.
fn unknown(name: &str, plain: &str) -> Problem {
    let all = Library::all();
    let short = |l: &Library| l.name.trim_start_matches("std.").to_string();
    let last = plain.rsplit('.').next().unwrap_or(plain);
    let libraries: Vec<String> = all.iter().map(short).collect();
    let components = all
        .iter()
        .flat_map(|l| l.components.iter().map(move |c| (c.name.as_str(), format!("{}.{}", short(l), c.name))));
    let known: Vec<(&str, String)> = libraries.iter().map(|l| (l.as_str(), l.clone())).chain(components).collect();
    let near = halfarrow_compiler::diagnostic::nearest(last, known.iter().map(|(word, _)| *word));
    let near = near.and_then(|near| known.iter().find(|(word, _)| *word == near));
    let hint = match near {
        Some((_, full)) => format!("did you mean `{full}`?"),
        None => format!("there are {}; `halfarrow library` lists what is in them", libraries.join(", ")),
    };
    Problem::BadOption { reason: format!("no library and no component has the name `{name}`: {hint}") }
}

impl Component {
    fn of(c: &ast::Component, text: &str, (start, end): (usize, usize)) -> Component {
        let above = text[..start].trim_end_matches(['\n', ' ']).lines().rev();
        let mut law: Vec<&str> = above.map_while(|line| line.strip_prefix("//")).map(str::trim).collect();
        law.reverse();
        // A line for each sentence that begins with a word and a colon: `Law: ...`, `Source: ...`.
        let law = law.iter().fold(String::new(), |all, line| match (all.is_empty(), line.starts_with("Source:")) {
            (true, _) => (*line).to_string(),
            (_, true) => format!("{all}\n{line}"),
            _ => format!("{all} {line}"),
        });
        let entries = |list: &[Declaration]| list.iter().map(|d| Entry::of(d, text)).collect::<Vec<_>>();
        let outputs = entries(&c.outs).into_iter().map(|e| Entry { default: None, ..e }).collect();
        Component {
            name: c.name.text.clone(),
            doc: c.doc.as_ref().map(|d| d.text.clone()).unwrap_or_default(),
            law,
            ports: entries(&c.ports),
            parameters: entries(&c.params),
            constants: entries(&c.consts),
            inputs: entries(&c.ins),
            outputs,
            text: text[start..end].to_string(),
        }
    }

    /// What stands in its head, by the words for it.
    pub fn groups(&self) -> [(&'static str, &[Entry]); 5] {
        [
            ("port", &self.ports),
            ("param", &self.parameters),
            ("const", &self.constants),
            ("in", &self.inputs),
            ("out", &self.outputs),
        ]
    }

    /// How it is written with what it needs: `Resistor:name(r = …)`. Bundles, such as frames, come along bonds.
    pub fn usage(&self) -> String {
        let all = self.parameters.iter().chain(&self.constants).chain(&self.inputs);
        let is_bundle = |e: &Entry| e.unit.as_ref().is_some_and(|unit| Unit::parse(unit).is_err());
        let needed = all.filter(|e| e.default.is_none() && !is_bundle(e));
        let needed: Vec<String> = needed.map(|e| format!("{} = …", e.name)).collect();
        match needed.is_empty() {
            true => format!("{}:name", self.name),
            false => format!("{}:name({})", self.name, needed.join(", ")),
        }
    }
}

impl Entry {
    fn of(d: &Declaration, text: &str) -> Entry {
        let written = |span: halfarrow_compiler::span::Span| text[span.start as usize..span.end as usize].to_string();
        Entry {
            name: d.name.text.clone(),
            default: d.value.as_ref().map(|value| written(value.span)),
            unit: d.unit.as_ref().map(|unit| unit.text.clone()),
            doc: d.doc.as_ref().map(|doc| doc.text.clone()).unwrap_or_default(),
        }
    }
}

/// Files, and beside them the libraries that come with the program.
pub(crate) struct WithLibraries<F>(pub F);

impl<F: Files> Files for WithLibraries<F> {
    fn read(&self, path: &str) -> Result<String, FileError> {
        self.0.read(path)
    }

    fn read_bytes(&self, path: &str) -> Result<Vec<u8>, FileError> {
        self.0.read_bytes(path)
    }

    fn library(&self, name: &str) -> Option<String> {
        self.0.library(name).or_else(|| Library::text(name).map(str::to_string))
    }

    fn libraries(&self) -> Vec<String> {
        let mut names = self.0.libraries();
        names.extend(TEXTS.iter().map(|(name, _)| (*name).to_string()));
        names.sort();
        names.dedup();
        names
    }
}
