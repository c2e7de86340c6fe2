//! From statements to flat lists: every instance of a component becomes a scope with its own elements and bonds.

use std::borrow::Cow;

use rustc_hash::FxHashMap;

use super::counted::{Counted, Counting};
use super::families::{Indices, spell};
use super::faults::Faults;
use super::files::Files;
use super::multibonds::Width;
use super::overrides::Given;
use super::port_kinds::Frame;
use super::repeat::{MAX_TURNS, Repeats};
use super::scope::{DeclKind, Here, Names, Node, Scope, ScopeId};
use super::uses::Uses;
use crate::ast::{self, StatementKind};
use crate::diagnostic::{Diagnostic, codes};
use crate::span::Span;

/// The greatest number of elements and junctions of a model.
pub(super) const MAX_PARTS: usize = 2_000_000;
/// The greatest number of instances of components.
const MAX_INSTANCES: usize = 500_000;

/// The words for elements and junctions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Word {
    Zero,
    One,
    Se,
    Sf,
    I,
    C,
    R,
    Sw,
    Tf,
    Gy,
    /// A gyrator of one port, with a skew matrix as modulus: `GY[3]`.
    Skew,
    Zc,
    ResidualSe,
    ResidualSf,
    De,
    Df,
}

/// All words for kinds, as written.
pub(super) const WORDS: [(&str, Word); 19] = [
    ("0", Word::Zero),
    ("1", Word::One),
    ("Se", Word::Se),
    ("Sf", Word::Sf),
    ("I", Word::I),
    ("C", Word::C),
    ("R", Word::R),
    ("Sw", Word::Sw),
    ("TF", Word::Tf),
    ("GY", Word::Gy),
    ("ZC", Word::Zc),
    ("rSe", Word::ResidualSe),
    ("rSf", Word::ResidualSf),
    ("De", Word::De),
    ("Df", Word::Df),
    ("MSe", Word::Se),
    ("MSf", Word::Sf),
    ("MTF", Word::Tf),
    ("MGY", Word::Gy),
];

impl Word {
    /// The kind with that word.
    pub fn of(text: &str) -> Option<Word> {
        WORDS.iter().find(|(word, _)| *word == text).map(|(_, kind)| *kind)
    }
    /// The word as people write it.
    pub fn text(self) -> &'static str {
        if self == Word::Skew {
            return Word::Gy.text();
        }
        WORDS.iter().find(|(_, kind)| *kind == self).map_or("", |(word, _)| word)
    }
    /// The word with its article.
    pub fn with_article(self) -> String {
        let article =
            if matches!(self, Word::I | Word::R | Word::Se | Word::Sf | Word::Sw | Word::ResidualSe | Word::ResidualSf)
            {
                "an"
            } else {
                "a"
            };
        format!("{article} {}", self.text())
    }
    /// Whether it is a junction.
    pub fn is_junction(self) -> bool {
        matches!(self, Word::Zero | Word::One)
    }
    /// Whether it is a `TF` or `GY`.
    pub fn is_two_port(self) -> bool {
        matches!(self, Word::Tf | Word::Gy)
    }
    /// Whether it belongs to the junction structure.
    pub fn is_inner(self) -> bool {
        self.is_junction() || self.is_two_port()
    }
    /// Whether it is an `I`, `C`, `R`, `Sw` or a gyrator of one port: power is positive into it. The first three may be
    /// fields.
    pub fn is_law(self) -> bool {
        matches!(self, Word::I | Word::C | Word::R | Word::Sw | Word::Skew)
    }
}

/// An element or junction.
pub(super) struct Part<'a> {
    /// Its full name.
    pub name: String,
    /// Where it belongs.
    pub here: Here,
    /// Its kind.
    pub word: Word,
    /// The ports of a field, empty when none are listed.
    pub ports: Cow<'a, [ast::Name]>,
    /// How many bonds side by side end at it.
    pub width: Width,
    /// As written.
    pub ast: &'a ast::Element,
    /// Whether it stands in a `domain … pseudo`.
    pub pseudo: bool,
}

/// A port of an instance: where a bond from outside and one from inside become one.
pub(super) struct Joint {
    /// The scope of the instance.
    pub instance: ScopeId,
    /// Its name.
    pub name: String,
    /// Where it is declared.
    pub span: Span,
    /// Whether nothing needs to be joined to it.
    pub open: bool,
}

/// A `constraint`.
pub(super) struct Held<'a> {
    /// Its full name.
    pub name: String,
    /// Where it belongs.
    pub here: Here,
    /// As written.
    pub ast: &'a ast::Constraint,
    /// The whole statement.
    pub span: Span,
}

/// A `when`.
pub(super) struct Clause<'a> {
    /// Where it belongs.
    pub here: Here,
    /// As written.
    pub ast: &'a ast::When,
    /// The whole statement.
    pub span: Span,
}

/// A `shape`.
pub(super) struct Pictured<'a> {
    /// Its full name.
    pub name: String,
    /// Where it belongs.
    pub here: Here,
    /// As written.
    pub ast: &'a ast::Element,
}

/// A bond as drawn, perhaps ending at ports of components.
pub(super) struct Drawn {
    /// Where it starts.
    pub from: End,
    /// Where the half arrow points.
    pub to: End,
    /// Its name, else empty.
    pub name: String,
    /// Where it belongs.
    pub here: Here,
    /// Whether it stands in a `domain … pseudo`.
    pub pseudo: bool,
    /// Where it is written.
    pub span: Span,
}

/// One end of a drawn bond.
#[derive(Debug, Clone, Copy)]
pub(super) struct End {
    /// What it is.
    pub at: At,
    /// Where it is written.
    pub span: Span,
}

/// What a drawn bond ends at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum At {
    /// An element: index into the parts, and the place of the named port in the list of its ports.
    Part(usize, Option<usize>),
    /// A port of an instance, from outside.
    Outside(usize),
    /// A port of the component, from inside.
    Inside(usize),
    /// Nothing: a port of an instance that is left open.
    Open,
    /// Nothing that is known; said already.
    Broken,
}

/// A model as flat lists.
#[derive(Default)]
pub(super) struct Flat<'a> {
    pub names: Names<'a>,
    pub parts: Vec<Part<'a>>,
    pub joints: Vec<Joint>,
    pub drawn: Vec<Drawn>,
    pub prefer: Vec<(Here, &'a ast::Path)>,
    pub causality: Vec<(Here, &'a ast::ForcedCausality)>,
    pub strokes: Vec<(Here, &'a ast::ForcedStroke, Span)>,
    pub guesses: Vec<(Here, &'a ast::Guess)>,
    pub constraints: Vec<Held<'a>>,
    pub clauses: Vec<Clause<'a>>,
    pub shapes: Vec<Pictured<'a>>,
    pub faults: Faults,
    /// Where names are used that say what there is and how it is joined.
    pub uses: Uses,
    /// The turns of repetitions, and what shapes the model.
    pub repeats: Repeats<'a>,
    /// Whether it is not known what there is: the rest of the model cannot be judged.
    pub lost: bool,
    pub chains: Vec<(Here, &'a ast::Chain, bool)>,
    /// The ports with signals, and the junctions of such, by their scopes.
    pub frames: FxHashMap<ScopeId, Frame<'a>>,
    pub full: bool,
    /// Where libraries come from.
    pub files: Option<&'a dyn Files>,
}

/// Flattens the files of a model, the main one first, with new values of parameters.
pub(super) fn flatten<'a>(
    trees: &'a [ast::Ast],
    given: &'a [Given],
    files: &'a dyn Files,
    counting: Option<Counting<'a>>,
) -> Flat<'a> {
    let mut flat = Flat { files: Some(files), ..Flat::default() };
    flat.repeats.counted = counting.map(Counted::new);
    flat.names.overrides = given.iter().map(|g| (g.name.as_str(), &g.value)).collect();
    flat.names.scopes.push(Scope {
        prefix: String::new(),
        parent: None,
        instance: None,
        user: Here::of(0),
        depth: 0,
        values: FxHashMap::default(),
        nodes: FxHashMap::default(),
        components: FxHashMap::default(),
    });
    for file in trees {
        flat.components(0, &file.statements);
    }
    for (i, file) in trees.iter().enumerate() {
        if i > 0 {
            flat.refuse_in_import(&file.statements);
        }
        flat.fill(Here::of(0), &file.statements, false, i > 0);
    }
    if !flat.lost {
        flat.draw_bonds();
    }
    flat
}

/// A full name: `motor.spring[3]`.
pub(super) fn full_name(prefix: &str, name: &str, indices: &[i64]) -> String {
    let mut full = String::with_capacity(prefix.len() + name.len() + 8 * indices.len());
    full.push_str(prefix);
    spell(&mut full, name, indices);
    full
}

/// Two components of one name. Of different files, the one that imports is told.
fn declared_twice(first: &ast::Name, again: &ast::Name) -> Diagnostic {
    let title = format!("component `{}` is declared twice", first.text);
    match first.span.file == again.span.file {
        true => Diagnostic::error(codes::N002, title, again.span, "again")
            .also(first.span, "declared first")
            .hint("give one of them another name"),
        false => Diagnostic::error(codes::N002, title, first.span, "declared here")
            .also(again.span, "and here, which is imported")
            .hint("give this one another name, or leave the import out"),
    }
}

impl<'a> Flat<'a> {
    /// Registers the components that are written in a scope, and its values that may shape it, before anything uses them.
    pub fn components(&mut self, scope: ScopeId, statements: &'a [ast::Statement]) {
        for statement in statements {
            match &statement.kind {
                StatementKind::Param(list) | StatementKind::Const(list) | StatementKind::Let(list) => {
                    let plain = list.iter().filter(|d| d.indices.is_empty());
                    self.names.ahead.extend(plain.map(|d| ((scope, d.name.text.as_str()), d)));
                }
                StatementKind::Component(c) => self.component(scope, c),
                StatementKind::PortKind(k) => self.port_kind(k),
                StatementKind::Domain(d) => self.components(scope, &d.body),
                _ => {}
            }
        }
    }

    fn component(&mut self, scope: ScopeId, c: &'a ast::Component) {
        let name = c.name.text.as_str();
        if Word::of(name).is_some() {
            let title = format!("`{name}` is a kind of element already");
            self.faults.push(Diagnostic::error(codes::N003, title, c.name.span, "here").hint("use another name"));
        }
        match self.names.scopes[scope].components.get(name) {
            Some(&first) => self.faults.push(declared_twice(&self.names.components[first].1.name, &c.name)),
            None => {
                self.names.scopes[scope].components.insert(name, self.names.components.len());
                self.names.components.push((scope, c));
            }
        }
    }

    /// Says which statements of an imported file cannot be used.
    fn refuse_in_import(&mut self, statements: &[ast::Statement]) {
        for statement in statements {
            let what = match &statement.kind {
                StatementKind::Chain(_) => "an element",
                StatementKind::Input(_) => "an input",
                StatementKind::Output(_) => "an output",
                StatementKind::State(_) => "a state",
                StatementKind::Constraint(_) => "a constraint",
                StatementKind::Guess(_) => "a guess",
                StatementKind::Discrete(_) => "a discrete variable",
                StatementKind::When(_) => "an event",
                StatementKind::Shape(_) => "a shape",
                StatementKind::Prefer(_) | StatementKind::Causality(_) | StatementKind::Stroke(_) => "causality",
                StatementKind::Domain(d) => {
                    self.refuse_in_import(&d.body);
                    continue;
                }
                StatementKind::For(l) => {
                    self.refuse_in_import(&l.body);
                    continue;
                }
                StatementKind::Choice(c) => {
                    self.refuse_in_import(&c.yes);
                    self.refuse_in_import(&c.no);
                    continue;
                }
                _ => continue,
            };
            let title = format!("{what} cannot be imported");
            self.faults.push(
                Diagnostic::error(codes::N014, title, statement.span, "outside of a component")
                    .note("an imported file gives components, parameters, constants, `let` values and functions")
                    .hint("put it into a component"),
            );
        }
    }

    /// Declares what the statements of a scope declare, instances and what is in them included.
    pub fn fill(&mut self, here: Here, statements: &'a [ast::Statement], pseudo: bool, imported: bool) {
        for statement in statements {
            match &statement.kind {
                StatementKind::Param(list) => self.parameters(here, list, false),
                StatementKind::Const(list) => self.parameters(here, list, true),
                StatementKind::Let(list) => self.lets(here, list, DeclKind::Let),
                StatementKind::Function(f) => {
                    let unit = f.unit.as_ref();
                    self.declare(here, here, (&f.name, &[]), DeclKind::Function(f), unit, f.doc.as_ref());
                }
                StatementKind::Domain(d) => self.fill(here, &d.body, pseudo || d.pseudo.is_some(), imported),
                StatementKind::For(l) => self.repeat(here, l, pseudo, imported),
                StatementKind::Choice(c) => self.choose(here, c, pseudo, imported),
                StatementKind::Import(i) if self.names.scopes[here.scope].instance.is_some() => self.faults.push(
                    Diagnostic::error(codes::N014, "a component cannot import", i.path.span, "here")
                        .hint("import at the top of the file"),
                ),
                _ if imported => {}
                StatementKind::Input(list) => {
                    list.iter().for_each(|d| self.declare_whole(here, here, d, DeclKind::Input(d.value.as_ref())));
                }
                // Outputs of the model are outputs; those inside an instance are named values.
                StatementKind::Output(list) if here.scope == 0 => self.lets(here, list, DeclKind::Output),
                StatementKind::Output(list) => self.lets(here, list, DeclKind::Let),
                StatementKind::State(s) => {
                    if let Some(indices) = self.indices(here, &s.indices) {
                        let (unit, doc) = (s.unit.as_ref(), s.doc.as_ref());
                        self.declare(here, here, (&s.name, &indices), DeclKind::State(s), unit, doc);
                    }
                }
                StatementKind::Prefer(paths) => self.prefer.extend(paths.iter().map(|p| (here, p))),
                StatementKind::Causality(list) => self.causality.extend(list.iter().map(|c| (here, c))),
                StatementKind::Stroke(s) => self.strokes.push((here, s, statement.span)),
                StatementKind::Guess(list) => self.guesses.extend(list.iter().map(|g| (here, g))),
                StatementKind::Constraint(c) => self.constraint(here, c, statement.span),
                StatementKind::Chain(chain) => self.chain(here, chain, pseudo),
                StatementKind::Import(_) | StatementKind::Component(_) | StatementKind::PortKind(_) => {}
                StatementKind::Discrete(list) => {
                    list.iter().for_each(|d| self.declare_whole(here, here, d, DeclKind::Discrete(d.value.as_ref())));
                }
                StatementKind::When(w) => self.clauses.push(Clause { here, ast: w, span: statement.span }),
                StatementKind::Shape(s) => self.shape(here, s),
            }
        }
    }

    fn constraint(&mut self, here: Here, c: &'a ast::Constraint, span: Span) {
        let Some(indices) = self.indices(here, &c.indices) else { return };
        let name = full_name(&self.names.scopes[here.scope].prefix, &c.name.text, &indices);
        self.place(here.scope, &c.name, &indices, Node::Constraint(self.constraints.len()));
        self.constraints.push(Held { name, here, ast: c, span });
    }

    fn shape(&mut self, here: Here, ast: &'a ast::Element) {
        let Some((indices, _)) = self.indices_and_ports(here, ast) else { return };
        let name = full_name(&self.names.scopes[here.scope].prefix, &ast.name.text, &indices);
        self.shapes.push(Pictured { name, here, ast });
    }

    /// Declares the nodes of a chain and keeps its bonds for later, when all nodes are known.
    fn chain(&mut self, here: Here, chain: &'a ast::Chain, pseudo: bool) {
        let nodes = std::iter::once(&chain.first).chain(chain.bonds.iter().map(|b| &b.to));
        nodes.for_each(|node| self.declare_node(here, node, pseudo));
        self.chains.push((here, chain, pseudo));
    }

    fn declare_node(&mut self, here: Here, node: &'a ast::Node, pseudo: bool) {
        match node {
            ast::Node::Declared(element) => self.element(here, element, pseudo),
            ast::Node::Joined(nodes, _) => nodes.iter().for_each(|node| self.declare_node(here, node, pseudo)),
            ast::Node::Named(_) | ast::Node::Missing(_) => {}
        }
    }

    fn element(&mut self, here: Here, element: &'a ast::Element, pseudo: bool) {
        if self.parts.len() >= self.repeats.most(MAX_PARTS)
            || self.names.scopes.len() >= self.repeats.most(MAX_INSTANCES)
        {
            self.too_large(element.span);
            return;
        }
        let Some((indices, ports)) = self.indices_and_ports(here, element) else { return };
        let Some(word) = Word::of(&element.kind.text) else {
            self.refuse_width(element);
            return self.instance(here, element, &indices, ports, pseudo);
        };
        if !element.widths.is_empty() {
            return self.wide_element(here, element, word, (&indices, ports), pseudo);
        }
        let node = Node::Part(self.parts.len());
        let name = full_name(&self.names.scopes[here.scope].prefix, &element.name.text, &indices);
        if self.place(here.scope, &element.name, &indices, node) {
            let (ports, width) = (Cow::Borrowed(ports), Width::One);
            self.parts.push(Part { name, here, word, ports, width, ast: element, pseudo });
        }
    }

    /// What stands in brackets behind the name of an element: its indices and its ports. Names alone are indices if they
    /// are numbers known here, else ports. `None` if they are at fault, which is said.
    pub fn indices_and_ports(&mut self, here: Here, element: &'a ast::Element) -> Option<(Indices, &'a [ast::Name])> {
        if element.ports.is_empty() || !element.indices.is_empty() {
            return Some((self.indices(here, &element.indices)?, &element.ports));
        }
        if element.ports.iter().all(|p| self.repeats.peek(&self.names, here, p).is_some()) {
            let index = |name| self.repeats.name_as_index(&self.names, here, name);
            return Some((element.ports.iter().map(index).collect::<Option<_>>()?, &[]));
        }
        let variable = |p: &ast::Name| self.repeats.variable(here.turn, &p.text).is_some();
        if !element.ports.iter().any(variable) {
            return Some((Indices::default(), &element.ports));
        }
        let port = element.ports.iter().find(|p| self.repeats.peek(&self.names, here, p).is_none())?;
        let (name, title) =
            (&element.name.text, format!("`{}` is no number known when the model is compiled", port.text));
        let d = Diagnostic::error(codes::N022, title, port.span, "beside an index");
        let hint = format!("ports stand in brackets of their own: `{name}[i][{}]`", port.text);
        self.faults.push(d.hint(hint));
        self.lost = true;
        None
    }

    pub fn too_large(&mut self, span: Span) {
        self.lost = true;
        if !self.full {
            self.full = true;
            let limits = format!("at most {MAX_PARTS} elements, {MAX_INSTANCES} instances of components");
            self.faults.push(
                Diagnostic::error(codes::N013, "the model is too large", span, "one more does not fit")
                    .note(format!("{limits} and {MAX_TURNS} turns of repetitions")),
            );
        }
    }
}
