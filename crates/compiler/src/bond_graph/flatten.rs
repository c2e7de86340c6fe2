//! From statements to flat lists: every instance of a component becomes a scope with its own elements and bonds.

use rustc_hash::FxHashMap;

use super::scope::{Decl, DeclKind, Names, Node, Scope, ScopeId};
use super::uses::{Used, Uses};
use crate::ast::{self, StatementKind};
use crate::diagnostic::nearest;
use crate::diagnostic::{Diagnostic, codes};
use crate::span::Span;

/// The greatest number of components inside one another.
const MAX_DEPTH: usize = 64;
/// The greatest number of elements and junctions of a model.
const MAX_PARTS: usize = 2_000_000;
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
    Tf,
    Gy,
    Zc,
    ResidualSe,
    ResidualSf,
    De,
    Df,
}

/// All words for kinds, as written.
pub(super) const WORDS: [(&str, Word); 18] = [
    ("0", Word::Zero),
    ("1", Word::One),
    ("Se", Word::Se),
    ("Sf", Word::Sf),
    ("I", Word::I),
    ("C", Word::C),
    ("R", Word::R),
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
        WORDS.iter().find(|(_, kind)| *kind == self).map_or("", |(word, _)| word)
    }
    /// The word with its article.
    pub fn with_article(self) -> String {
        let article = if matches!(self, Word::I | Word::R | Word::Se | Word::Sf | Word::ResidualSe | Word::ResidualSf) {
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
    /// Whether it is an `I`, `C` or `R`: power is positive into it, and it may be a field.
    pub fn is_law(self) -> bool {
        matches!(self, Word::I | Word::C | Word::R)
    }
}

/// An element or junction.
pub(super) struct Part<'a> {
    /// Its full name.
    pub name: String,
    /// Where it belongs.
    pub scope: ScopeId,
    /// Its kind.
    pub word: Word,
    /// As written.
    pub ast: &'a ast::Element,
    /// Whether it stands in a `domain … pseudo`.
    pub pseudo: bool,
}

/// A port of an instance: where a bond from outside and one from inside become one.
pub(super) struct Joint<'a> {
    /// The scope of the instance.
    pub instance: ScopeId,
    /// Its name.
    pub name: &'a ast::Name,
}

/// A bond as drawn, perhaps ending at ports of components.
pub(super) struct Drawn {
    /// Where it starts.
    pub from: End,
    /// Where the half arrow points.
    pub to: End,
    /// Its name, else empty.
    pub name: String,
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
    /// Nothing that is known; said already.
    Broken,
}

/// A model as flat lists.
#[derive(Default)]
pub(super) struct Flat<'a> {
    pub names: Names<'a>,
    pub parts: Vec<Part<'a>>,
    pub joints: Vec<Joint<'a>>,
    pub drawn: Vec<Drawn>,
    pub prefer: Vec<(ScopeId, &'a ast::Path)>,
    pub causality: Vec<(ScopeId, &'a ast::ForcedCausality)>,
    pub strokes: Vec<(ScopeId, &'a ast::ForcedStroke, Span)>,
    pub guesses: Vec<(ScopeId, &'a ast::Guess)>,
    pub constraints: Vec<(ScopeId, &'a ast::Constraint, Span)>,
    pub faults: Vec<Diagnostic>,
    /// Where names are used that say what there is and how it is joined.
    pub uses: Uses,
    chains: Vec<(ScopeId, &'a ast::Chain, bool)>,
    full: bool,
}

/// Flattens the files of a model, the main one first.
pub(super) fn flatten<'a>(files: &'a [ast::Ast]) -> Flat<'a> {
    let mut flat = Flat::default();
    flat.names.scopes.push(Scope {
        prefix: String::new(),
        parent: None,
        instance: None,
        user: 0,
        depth: 0,
        values: FxHashMap::default(),
        nodes: FxHashMap::default(),
        components: FxHashMap::default(),
    });
    for file in files {
        flat.components(0, &file.statements);
    }
    for (i, file) in files.iter().enumerate() {
        if i > 0 {
            flat.refuse_in_import(&file.statements);
        }
        flat.fill(0, &file.statements, false, i > 0);
    }
    flat.draw_bonds();
    flat
}

/// Parts of a full name.
fn full_name(prefix: &str, name: &str) -> String {
    let mut full = String::with_capacity(prefix.len() + name.len());
    full.push_str(prefix);
    full.push_str(name);
    full
}

impl<'a> Flat<'a> {
    /// Registers the components that are written in a scope, before anything uses them.
    fn components(&mut self, scope: ScopeId, statements: &'a [ast::Statement]) {
        for statement in statements {
            match &statement.kind {
                StatementKind::Component(c) => self.component(scope, c),
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
            Some(&first) => self.faults.push(
                Diagnostic::error(codes::N002, format!("component `{name}` is declared twice"), c.name.span, "again")
                    .also(self.names.components[first].1.name.span, "declared first")
                    .hint("give one of them another name"),
            ),
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
                StatementKind::Prefer(_) | StatementKind::Causality(_) | StatementKind::Stroke(_) => "causality",
                StatementKind::Domain(d) => {
                    self.refuse_in_import(&d.body);
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
    fn fill(&mut self, scope: ScopeId, statements: &'a [ast::Statement], pseudo: bool, imported: bool) {
        for statement in statements {
            match &statement.kind {
                StatementKind::Param(list) => {
                    self.declare_all(scope, list, |d| DeclKind::Parameter { value: d.value.as_ref(), constant: false })
                }
                StatementKind::Const(list) => {
                    self.declare_all(scope, list, |d| DeclKind::Parameter { value: d.value.as_ref(), constant: true })
                }
                StatementKind::Let(list) => self.declare_all(scope, list, |d| DeclKind::Let(d.value.as_ref())),
                StatementKind::Function(f) => {
                    let unit = f.unit.as_ref();
                    self.declare(scope, &f.name, DeclKind::Function(f), unit, f.doc.as_ref());
                }
                StatementKind::Domain(d) => self.fill(scope, &d.body, pseudo || d.pseudo.is_some(), imported),
                StatementKind::Import(i) if self.names.scopes[scope].instance.is_some() => self.faults.push(
                    Diagnostic::error(codes::N014, "a component cannot import", i.path.span, "here")
                        .hint("import at the top of the file"),
                ),
                _ if imported => {}
                StatementKind::Input(list) => self.declare_all(scope, list, |d| DeclKind::Input(d.value.as_ref())),
                StatementKind::Output(list) => self.outputs(scope, list),
                StatementKind::State(s) => {
                    self.declare(scope, &s.name, DeclKind::State(s), s.unit.as_ref(), s.doc.as_ref());
                }
                StatementKind::Prefer(paths) => self.prefer.extend(paths.iter().map(|p| (scope, p))),
                StatementKind::Causality(list) => self.causality.extend(list.iter().map(|c| (scope, c))),
                StatementKind::Stroke(s) => self.strokes.push((scope, s, statement.span)),
                StatementKind::Guess(list) => self.guesses.extend(list.iter().map(|g| (scope, g))),
                StatementKind::Constraint(c) => {
                    let node = Node::Constraint(self.constraints.len());
                    self.place(scope, &c.name, node);
                    self.constraints.push((scope, c, statement.span));
                }
                StatementKind::Chain(chain) => self.chain(scope, chain, pseudo),
                StatementKind::Import(_) | StatementKind::Component(_) => {}
                StatementKind::When(_) | StatementKind::For(_) => {}
            }
        }
    }

    fn declare_all(
        &mut self,
        scope: ScopeId,
        list: &'a [ast::Declaration],
        kind: impl Fn(&'a ast::Declaration) -> DeclKind<'a>,
    ) {
        for d in list {
            self.declare(scope, &d.name, kind(d), d.unit.as_ref(), d.doc.as_ref());
        }
    }

    /// Outputs of the model are outputs; those inside an instance are named values.
    fn outputs(&mut self, scope: ScopeId, list: &'a [ast::Declaration]) {
        if scope == 0 {
            self.declare_all(scope, list, |d| DeclKind::Output(d.value.as_ref()));
        } else {
            self.declare_all(scope, list, |d| DeclKind::Let(d.value.as_ref()));
        }
    }

    fn declare(
        &mut self,
        scope: ScopeId,
        name: &'a ast::Name,
        kind: DeclKind<'a>,
        unit: Option<&'a ast::UnitText>,
        doc: Option<&'a ast::Doc>,
    ) {
        self.declare_reading(scope, scope, name, kind, unit, doc);
    }

    fn declare_reading(
        &mut self,
        scope: ScopeId,
        reads: ScopeId,
        name: &'a ast::Name,
        kind: DeclKind<'a>,
        unit: Option<&'a ast::UnitText>,
        doc: Option<&'a ast::Doc>,
    ) {
        let decl = Decl {
            name: full_name(&self.names.scopes[scope].prefix, &name.text),
            reads,
            kind,
            unit,
            replaced_unit: None,
            doc: doc.map_or("", |d| &d.text),
            span: name.span,
        };
        if let Err(fault) = self.names.declare(scope, name, decl) {
            self.faults.push(*fault);
        }
    }

    /// Gives a node its name; false if the name is taken, which is said.
    fn place(&mut self, scope: ScopeId, name: &'a ast::Name, node: Node) -> bool {
        match self.names.place(scope, name, node) {
            Ok(()) => true,
            Err(fault) => {
                self.faults.push(*fault);
                false
            }
        }
    }

    /// Declares the nodes of a chain and keeps its bonds for later, when all nodes are known.
    fn chain(&mut self, scope: ScopeId, chain: &'a ast::Chain, pseudo: bool) {
        let nodes = std::iter::once(&chain.first).chain(chain.bonds.iter().map(|b| &b.to));
        for node in nodes {
            if let ast::Node::Declared(element) = node {
                self.element(scope, element, pseudo);
            }
        }
        self.chains.push((scope, chain, pseudo));
    }

    fn element(&mut self, scope: ScopeId, element: &'a ast::Element, pseudo: bool) {
        if self.parts.len() >= MAX_PARTS || self.names.scopes.len() >= MAX_INSTANCES {
            self.too_large(element.span);
            return;
        }
        let Some(word) = Word::of(&element.kind.text) else {
            return self.instance(scope, element, pseudo);
        };
        let node = Node::Part(self.parts.len());
        let name = full_name(&self.names.scopes[scope].prefix, &element.name.text);
        if self.place(scope, &element.name, node) {
            self.parts.push(Part { name, scope, word, ast: element, pseudo });
        }
    }

    fn too_large(&mut self, span: Span) {
        if !self.full {
            self.full = true;
            self.faults.push(
                Diagnostic::error(codes::N013, "the model is too large", span, "one more does not fit")
                    .note(format!("at most {MAX_PARTS} elements and {MAX_INSTANCES} instances of components")),
            );
        }
    }

    /// Makes a scope for an instance of a component and fills it.
    fn instance(&mut self, scope: ScopeId, element: &'a ast::Element, pseudo: bool) {
        let Some(used) = self.names.component(scope, &element.kind.text) else {
            return self.unknown_kind(scope, element);
        };
        self.uses.add(Used::Component(used), element.kind.span);
        let (written, component) = self.names.components[used];
        if let Some(fault) = self.endless(scope, component, element) {
            self.faults.push(fault);
            self.place(scope, &element.name, Node::Broken);
            return;
        }
        let id = self.names.scopes.len();
        if !self.place(scope, &element.name, Node::Instance(id)) {
            return;
        }
        self.names.scopes.push(Scope {
            prefix: format!("{}{}.", self.names.scopes[scope].prefix, element.name.text),
            parent: Some(written),
            instance: Some((component, element.span)),
            user: scope,
            depth: self.names.scopes[scope].depth + 1,
            values: FxHashMap::default(),
            nodes: FxHashMap::default(),
            components: FxHashMap::default(),
        });
        self.refuse_odd_arguments(component, element);
        self.interface(id, scope, component, element);
        self.components(id, &component.body);
        self.fill(id, &component.body, pseudo, false);
        self.check_outs(id, component);
    }

    fn unknown_kind(&mut self, scope: ScopeId, element: &'a ast::Element) {
        let kind = &element.kind;
        let known = WORDS.iter().map(|w| w.0).chain(self.names.visible_components(scope));
        let title = format!("there is no kind of element `{}`", kind.text);
        let d = Diagnostic::error(codes::N005, title, kind.span, "neither a kind nor a component");
        let d = match nearest(&kind.text, known) {
            _ if usual_name(&kind.text).is_some() => {
                let (word, what) = usual_name(&kind.text).unwrap_or_default();
                d.hint(format!("write `{word}:{}(…)`: {what}", element.name.text))
            }
            Some(near) => d.hint(format!("did you mean `{near}`?")),
            None => {
                d.hint("kinds are 0 1 Se Sf I C R TF GY ZC rSe rSf De Df, and components that are declared or imported")
            }
        };
        self.faults.push(d);
        self.place(scope, &element.name, Node::Broken);
    }

    /// Whether a component contains itself, or components are nested too deeply.
    fn endless(&self, scope: ScopeId, component: &ast::Component, element: &ast::Element) -> Option<Diagnostic> {
        let mut around = Vec::new();
        let mut s = scope;
        while let Some((outer, span)) = self.names.scopes[s].instance {
            around.push((outer, span));
            if std::ptr::eq(outer, component) {
                let path: Vec<&str> = around.iter().rev().map(|(c, _)| c.name.text.as_str()).collect();
                let title = format!("component `{}` contains itself", component.name.text);
                let d = Diagnostic::error(codes::N012, title, element.span, "here it is used in itself");
                let d = if path.len() > 1 {
                    d.note(format!("{} -> {}", path.join(" -> "), component.name.text))
                } else {
                    d
                };
                return Some(d.also(component.name.span, "declared here").hint("take the use out of the component"));
            }
            s = self.names.scopes[s].user;
        }
        (self.names.scopes[scope].depth >= MAX_DEPTH).then(|| {
            Diagnostic::error(codes::N013, "components are nested too deeply", element.span, "this one is too deep")
                .note(format!("at most {MAX_DEPTH} inside one another"))
        })
    }

    /// Says which arguments of an instance belong to nothing.
    fn refuse_odd_arguments(&mut self, component: &'a ast::Component, element: &'a ast::Element) {
        let known: Vec<&str> = component.params.iter().chain(&component.ins).map(|d| d.name.text.as_str()).collect();
        let mut given: FxHashMap<&str, Span> = FxHashMap::default();
        for arg in &element.args {
            let Some(label) = &arg.label else {
                let example = known.first().copied().unwrap_or("a");
                self.faults.push(
                    Diagnostic::error(codes::N007, "an argument of a component needs its name", arg.span, "which one?")
                        .hint(format!("write `{example} = …`")),
                );
                continue;
            };
            let name = label.name.text.as_str();
            if !known.contains(&name) || label.port.is_some() {
                let title = format!("component `{}` has no parameter or input `{name}`", component.name.text);
                let d = Diagnostic::error(codes::N008, title, label.span, "not known");
                let d = d.also(component.name.span, "declared here");
                self.faults.push(match nearest(name, known.iter().copied()) {
                    Some(near) => d.hint(format!("did you mean `{near}`?")),
                    None => d.hint(format!("it takes: {}", known.join(", "))),
                });
            } else if let Some(first) = given.insert(name, label.span) {
                let title = format!("`{name}` is given twice");
                self.faults.push(Diagnostic::error(codes::N002, title, label.span, "again").also(first, "given first"));
            }
        }
        for port in &element.ports {
            let title = format!("the ports of component `{}` are those of its declaration", component.name.text);
            self.faults.push(Diagnostic::error(codes::N007, title, port.span, "no list here"));
        }
    }

    /// Declares the parameters, inputs, outputs and ports of an instance, with the values that it is given.
    fn interface(&mut self, id: ScopeId, scope: ScopeId, component: &'a ast::Component, element: &'a ast::Element) {
        let given = |name: &str| {
            let labelled = element.args.iter().filter(|a| a.label.as_ref().is_some_and(|l| l.name.text == name));
            labelled.map(|a| &a.value).next()
        };
        for d in component.params.iter().chain(&component.ins) {
            let (value, reads) = match given(&d.name.text) {
                Some(value) => (Some(value), scope),
                None => (d.value.as_ref(), id),
            };
            if value.is_none() {
                self.missing_argument(component, element, d);
            }
            let is_param = component.params.iter().any(|p| std::ptr::eq(p, d));
            let kind = match is_param {
                true => DeclKind::Parameter { value, constant: false },
                false => DeclKind::Let(value),
            };
            self.declare_reading(id, reads, &d.name, kind, d.unit.as_ref(), d.doc.as_ref());
        }
        self.labels_use(id, element);
        for d in component.outs.iter().filter(|d| d.value.is_some()) {
            self.declare(id, &d.name, DeclKind::Let(d.value.as_ref()), d.unit.as_ref(), d.doc.as_ref());
        }
        for d in &component.ports {
            let joint = self.joints.len();
            self.joints.push(Joint { instance: id, name: &d.name });
            self.place(id, &d.name, Node::Joint(joint));
        }
    }

    /// The label of an argument names what the instance declares.
    fn labels_use(&mut self, id: ScopeId, element: &ast::Element) {
        for label in element.args.iter().filter_map(|a| a.label.as_ref()) {
            if let Some(&decl) = self.names.scopes[id].values.get(label.name.text.as_str()) {
                self.uses.add(Used::Value(decl), label.name.span);
            }
        }
    }

    fn missing_argument(&mut self, component: &ast::Component, element: &ast::Element, d: &ast::Declaration) {
        let title = format!("`{}` needs a value for `{}`", element.name.text, d.name.text);
        self.faults.push(
            Diagnostic::error(codes::N009, title, element.span, "not given here")
                .also(d.name.span, format!("`{}` has no default in component `{}`", d.name.text, component.name.text))
                .hint(format!("write `{}:{}({} = …)`", component.name.text, element.name.text, d.name.text)),
        );
    }

    /// Says which outputs of a component have no value.
    fn check_outs(&mut self, id: ScopeId, component: &'a ast::Component) {
        for d in component.outs.iter().filter(|d| d.value.is_none()) {
            if let Some(&decl) = self.names.scopes[id].values.get(d.name.text.as_str()) {
                self.uses.add(Used::Value(decl), d.name.span);
            } else {
                let title =
                    format!("component `{}` gives no value to its output `{}`", component.name.text, d.name.text);
                let fault = Diagnostic::error(codes::N009, title, d.name.span, "declared here")
                    .hint(format!("write `let {} = …` in the component", d.name.text));
                if !self.faults.contains(&fault) {
                    self.faults.push(fault);
                }
            }
        }
    }

    /// Makes the bonds of all chains, those of the model before those inside its instances.
    fn draw_bonds(&mut self) {
        let mut chains = std::mem::take(&mut self.chains);
        chains.sort_by_key(|(scope, _, _)| *scope);
        for (scope, chain, pseudo) in chains {
            if chain.bonds.is_empty() {
                self.lone_node(&chain.first);
                continue;
            }
            let mut from = self.end(scope, &chain.first);
            for bond in &chain.bonds {
                let to = self.end(scope, &bond.to);
                self.drawn_bond(scope, from, to, bond, pseudo);
                from = to;
            }
        }
    }

    /// A chain without bonds has to declare something.
    fn lone_node(&mut self, node: &ast::Node) {
        if let ast::Node::Named(path) = node {
            self.faults.push(
                Diagnostic::error(codes::B008, "a name alone says nothing", path.span, "no bond starts here")
                    .hint("write `a -> b`, or `Kind:name` to declare an element"),
            );
        }
    }

    fn drawn_bond(&mut self, scope: ScopeId, from: End, to: End, bond: &'a ast::Bond, pseudo: bool) {
        let name = match &bond.name {
            Some(name) => {
                self.place(scope, name, Node::Bond(self.drawn.len()));
                full_name(&self.names.scopes[scope].prefix, &name.text)
            }
            None => String::new(),
        };
        self.drawn.push(Drawn { from, to, name, pseudo, span: from.span.to(to.span) });
    }

    /// What a node of a chain stands for as the end of a bond.
    fn end(&mut self, scope: ScopeId, node: &'a ast::Node) -> End {
        match node {
            ast::Node::Missing(span) => End { at: At::Broken, span: *span },
            ast::Node::Declared(element) => {
                let known = self.names.scopes[scope].nodes.get(element.name.text.as_str()).copied();
                let at = match known {
                    Some((node, span)) if span == element.name.span && element.port.is_some() => {
                        element.port.as_ref().map_or(At::Broken, |port| self.port_of(node, port))
                    }
                    Some((Node::Part(part), span)) if span == element.name.span => At::Part(part, None),
                    Some((Node::Instance(inner), span)) if span == element.name.span => {
                        self.only_port(inner, element.span)
                    }
                    _ => At::Broken,
                };
                End { at, span: element.span }
            }
            ast::Node::Named(path) => End { at: self.named_end(scope, path), span: path.span },
        }
    }

    /// A port of an element or of an instance, where the parser has told all that is wrong.
    fn port_of(&mut self, node: Node, port: &'a ast::Name) -> At {
        match node {
            Node::Part(part) => self.named_port(part, port),
            Node::Instance(inner) => match self.names.scopes[inner].nodes.get(port.text.as_str()) {
                Some(&(Node::Joint(joint), _)) => {
                    self.uses.add(Used::Node(Node::Joint(joint)), port.span);
                    At::Outside(joint)
                }
                _ => At::Broken,
            },
            _ => At::Broken,
        }
    }

    /// A component with one port can be written as a node; otherwise the port must be named.
    fn only_port(&mut self, inner: ScopeId, span: Span) -> At {
        let Some((component, _)) = self.names.scopes[inner].instance else { return At::Broken };
        match component.ports.as_slice() {
            [port] => match self.names.scopes[inner].nodes.get(port.name.text.as_str()) {
                Some(&(Node::Joint(joint), _)) => At::Outside(joint),
                _ => At::Broken,
            },
            ports => {
                let list: Vec<&str> = ports.iter().map(|p| p.name.text.as_str()).collect();
                let title = format!("which port of `{}`?", component.name.text);
                let name = self.names.scopes[inner].prefix.clone();
                let d = Diagnostic::error(codes::B009, title, span, "a bond ends at a port");
                self.faults.push(match list.first() {
                    Some(first) => d
                        .note(format!("its ports are {}", list.join(", ")))
                        .hint(format!("declare it on a line of its own and write `{name}{first}` here")),
                    None => d.note("it has no ports"),
                });
                At::Broken
            }
        }
    }

    /// What a path stands for as the end of a bond.
    fn named_end(&mut self, scope: ScopeId, path: &'a ast::Path) -> At {
        let (node, used) = match self.names.walk(scope, path, &mut |node, span| self.uses.add(Used::Node(node), span)) {
            Ok(found) => found,
            Err(fault) => {
                self.faults.push(*fault);
                return At::Broken;
            }
        };
        let rest = &path.parts[used..];
        match (node, rest) {
            (Node::Part(part), []) => At::Part(part, None),
            (Node::Part(part), [port]) => self.named_port(part, &port.name),
            (Node::Instance(inner), []) => self.only_port(inner, path.span),
            (Node::Joint(joint), []) if used == 1 => At::Inside(joint),
            (Node::Joint(joint), []) => At::Outside(joint),
            (Node::Broken, _) => At::Broken,
            _ => {
                let what = match node {
                    Node::Bond(_) => "a bond",
                    Node::Constraint(_) => "a constraint",
                    Node::Instance(_) => "a signal",
                    _ => "a variable",
                };
                let title = format!("a bond cannot end at {what}");
                self.faults
                    .push(Diagnostic::error(codes::B008, title, path.span, "here").hint("name an element or a port"));
                At::Broken
            }
        }
    }

    /// The port of an element by its name.
    fn named_port(&mut self, part: usize, port: &ast::Name) -> At {
        let p = &self.parts[part];
        let list: Vec<&str> = match p.word.is_two_port() {
            true => vec!["in", "out"],
            false => p.ast.ports.iter().map(|n| n.text.as_str()).collect(),
        };
        if let Some(at) = list.iter().position(|name| *name == port.text) {
            return At::Part(part, Some(at));
        }
        let title = format!("`{}` has no port `{}`", p.name, port.text);
        let d = Diagnostic::error(codes::N001, title, port.span, "not known").also(p.ast.span, "declared here");
        self.faults.push(match (nearest(&port.text, list.iter().copied()), list.is_empty()) {
            (Some(near), _) => d.hint(format!("did you mean `{near}`?")),
            (None, true) => d.hint(format!("write `{}`", p.ast.name.text)),
            (None, false) => d.hint(format!("its ports are {}", list.join(", "))),
        });
        At::Broken
    }
}

/// The kind that a word of one domain stands for, and what it is in a bond graph.
fn usual_name(word: &str) -> Option<(&'static str, &'static str)> {
    Some(match word {
        "L" | "Inductor" | "Coil" => ("I", "an inductance is an inertance"),
        "M" | "m" | "J" | "Mass" | "Inertia" => ("I", "a mass is an inertance"),
        "K" | "k" | "Spring" => ("C", "a spring is a compliance; `k = …` gives its stiffness"),
        "Capacitor" => ("C", "a capacitor is a compliance"),
        "B" | "b" | "D" | "Damper" | "Resistor" | "Friction" => ("R", "a damper is a resistor"),
        "G" => ("R", "a conductance is a resistor; `g = …` gives it"),
        "V" | "U" | "F" | "P" | "E" => ("Se", "a voltage, force or pressure is a source of effort"),
        "Q" => ("Sf", "a flow that is given is a source of flow"),
        "SE" | "se" => ("Se", "kinds are written like this"),
        "SF" | "sf" => ("Sf", "kinds are written like this"),
        "Gear" | "Lever" => ("TF", "its ratio is the modulus of a transformer"),
        _ => return None,
    })
}
