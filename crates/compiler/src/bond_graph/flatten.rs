//! From statements to flat lists: every instance of a component becomes a scope with its own elements and bonds.

use rustc_hash::FxHashMap;

use super::arrays::{self, Extents};
use super::decls::unit_of_literal;
use super::families::{Indices, spell, spelled};
use super::faults::Faults;
use super::overrides::Given;
use super::repeat::{MAX_TURNS, Repeats};
use super::scope::{Decl, DeclId, DeclKind, Here, Names, Node, Scope, ScopeId, Valued, no_indices};
use super::uses::{Used, Uses};
use crate::ast::{self, StatementKind};
use crate::diagnostic::nearest;
use crate::diagnostic::{Diagnostic, codes};
use crate::span::Span;

/// The greatest number of components inside one another.
const MAX_DEPTH: usize = 64;
/// The greatest number of elements and junctions of a model.
const MAX_PARTS: usize = 2_000_000;
/// The greatest number of statements that one repetition makes of those in it.
const MAX_STATEMENTS: usize = 16_000_000;
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
    pub here: Here,
    /// Its kind.
    pub word: Word,
    /// The ports of a field, empty when none are listed.
    pub ports: &'a [ast::Name],
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
    pub faults: Faults,
    /// Where names are used that say what there is and how it is joined.
    pub uses: Uses,
    /// The turns of repetitions, and what shapes the model.
    pub repeats: Repeats<'a>,
    /// Whether it is not known what there is: the rest of the model cannot be judged.
    pub lost: bool,
    chains: Vec<(Here, &'a ast::Chain, bool)>,
    full: bool,
}

/// Flattens the files of a model, the main one first, with new values of parameters.
pub(super) fn flatten<'a>(files: &'a [ast::Ast], given: &'a [Given]) -> Flat<'a> {
    let mut flat = Flat::default();
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
    for file in files {
        flat.components(0, &file.statements);
    }
    for (i, file) in files.iter().enumerate() {
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
fn full_name(prefix: &str, name: &str, indices: &[i64]) -> String {
    let mut full = String::with_capacity(prefix.len() + name.len() + 8 * indices.len());
    full.push_str(prefix);
    spell(&mut full, name, indices);
    full
}

impl<'a> Flat<'a> {
    /// Registers the components that are written in a scope, and its values that may shape it, before anything uses them.
    fn components(&mut self, scope: ScopeId, statements: &'a [ast::Statement]) {
        for statement in statements {
            match &statement.kind {
                StatementKind::Param(list) | StatementKind::Const(list) | StatementKind::Let(list) => {
                    let plain = list.iter().filter(|d| d.indices.is_empty());
                    self.names.ahead.extend(plain.map(|d| ((scope, d.name.text.as_str()), d)));
                }
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
    fn fill(&mut self, here: Here, statements: &'a [ast::Statement], pseudo: bool, imported: bool) {
        for statement in statements {
            match &statement.kind {
                StatementKind::Param(list) => self.parameters(here, list, false),
                StatementKind::Const(list) => self.parameters(here, list, true),
                StatementKind::Let(list) => self.lets(here, list, |value| DeclKind::Let(value)),
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
                StatementKind::Output(list) if here.scope == 0 => {
                    self.lets(here, list, |value| DeclKind::Output(value))
                }
                StatementKind::Output(list) => self.lets(here, list, |value| DeclKind::Let(value)),
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
                StatementKind::Import(_) | StatementKind::Component(_) => {}
                StatementKind::When(_) => {}
            }
        }
    }

    fn constraint(&mut self, here: Here, c: &'a ast::Constraint, span: Span) {
        let Some(indices) = self.indices(here, &c.indices) else { return };
        let name = full_name(&self.names.scopes[here.scope].prefix, &c.name.text, &indices);
        self.place(here.scope, &c.name, &indices, Node::Constraint(self.constraints.len()));
        self.constraints.push(Held { name, here, ast: c, span });
    }

    /// Repeats statements, once for each value of the variable.
    fn repeat(&mut self, here: Here, l: &'a ast::For, pseudo: bool, imported: bool) {
        if !self.repeatable(here, l) {
            self.lost = true;
            return;
        }
        let ends = (
            self.whole(here, &l.from, "where a repetition begins"),
            self.whole(here, &l.to, "where a repetition ends"),
        );
        let (Some(from), Some(to)) = ends else { return };
        let Some(values) =
            self.repeats.turns_of(from, to).filter(|v| v.clone().count() * l.body.len() <= MAX_STATEMENTS)
        else {
            self.too_large(l.from.span.to(l.to.span));
            return;
        };
        for value in values {
            let turn = self.repeats.turn(&l.variable, value, here);
            let before = self.faults.len();
            self.fill(Here { turn, ..here }, &l.body, pseudo, imported);
            self.faults.in_turn(before, || self.repeats.words(turn));
            if self.full {
                break;
            }
        }
    }

    /// Whether the variable and the statements of a repetition may be repeated; says so if not.
    fn repeatable(&mut self, here: Here, l: &'a ast::For) -> bool {
        let before = self.faults.len();
        if matches!(l.variable.text.as_str(), "t" | "pi") {
            let title = format!("`{}` cannot be a loop variable", l.variable.text);
            self.faults.push(Diagnostic::error(codes::N003, title, l.variable.span, "here").hint("use another name"));
        }
        if let Some(outer) = self.repeats.around(here.turn).find(|t| t.variable.text == l.variable.text) {
            let title = format!("`{}` is the variable of the repetition around this one", l.variable.text);
            let d = Diagnostic::error(codes::N002, title, l.variable.span, "again");
            self.faults.push(d.also(outer.variable.span, "the one around it").hint("use another name"));
        }
        self.refuse_repeated(&l.body, "repeated");
        self.faults.len() == before
    }

    /// Says which statements cannot be repeated, or be there on a condition.
    fn refuse_repeated(&mut self, body: &'a [ast::Statement], how: &str) {
        for statement in body {
            let what = match &statement.kind {
                StatementKind::Component(_) => "a component",
                StatementKind::Import(_) => "an import",
                StatementKind::Function(_) if how == "repeated" => "a function",
                _ => continue,
            };
            let d = Diagnostic::error(codes::N014, format!("{what} cannot be {how}"), statement.span, "in a block");
            self.faults.push(d.hint("write it outside of the block"));
        }
    }

    /// The statements that are there if a condition holds, or those that are there if not.
    fn choose(&mut self, here: Here, c: &'a ast::Choice, pseudo: bool, imported: bool) {
        let before = self.faults.len();
        self.refuse_repeated(&c.yes, "chosen");
        self.refuse_repeated(&c.no, "chosen");
        let holds = match self.repeats.condition(&self.names, here, &c.cond) {
            Ok(holds) => holds,
            Err(why) => {
                let fault = why.fault("whether statements are there");
                let hint = "a value that changes during the run is chosen in an expression: `if … then … else …`";
                self.faults.maybe(fault.map(|d| if d.code == codes::N022 { d.note(hint) } else { d }));
                self.lost = true;
                return;
            }
        };
        if self.faults.len() > before {
            return;
        }
        self.fill(here, if holds { &c.yes } else { &c.no }, pseudo, imported);
    }

    /// A whole number that shapes the model; says so if it is none.
    fn whole(&mut self, here: Here, e: &'a ast::Expr, what: &str) -> Option<i64> {
        match self.repeats.whole(&self.names, here, e, what) {
            Ok(value) => Some(value),
            Err(fault) => {
                self.faults.maybe(fault);
                self.lost = true;
                None
            }
        }
    }

    /// The indices of what is declared; says so if they are none.
    fn indices(&mut self, here: Here, list: &'a [ast::Expr]) -> Option<Indices> {
        list.iter().map(|e| self.whole(here, e, "an index")).collect()
    }

    /// Parameters, also whole arrays of them.
    fn parameters(&mut self, here: Here, list: &'a [ast::Declaration], constant: bool) {
        for d in list {
            self.declare_whole(here, here, d, DeclKind::Parameter { value: d.value.as_ref(), constant });
        }
    }

    /// Named values, each with the indices that it has.
    fn lets(&mut self, here: Here, list: &'a [ast::Declaration], kind: impl Fn(Option<&'a ast::Expr>) -> DeclKind<'a>) {
        for d in list {
            if let Some(indices) = self.indices(here, &d.indices) {
                let (unit, doc) = (d.unit.as_ref(), d.doc.as_ref());
                self.declare(here, here, (&d.name, &indices), kind(d.value.as_ref()), unit, doc);
            }
        }
    }

    /// Declares a value, or all elements of an array: brackets that read a loop variable are the indices of one element,
    /// others tell how many elements there are.
    fn declare_whole(&mut self, here: Here, reads: Here, d: &'a ast::Declaration, kind: DeclKind<'a>) {
        let (unit, doc) = (d.unit.as_ref(), d.doc.as_ref());
        let one = d.indices.iter().any(|e| arrays::reads_variable(&self.repeats, here.turn, e));
        let Some(indices) = self.indices(here, &d.indices) else { return };
        if one || indices.is_empty() {
            self.declare(here, reads, (&d.name, &indices), kind, unit, doc);
            return;
        }
        let Some(extents) = Extents::of(&indices).filter(|e| e.count() + self.names.decls.len() <= MAX_TURNS) else {
            self.too_large(d.span);
            return;
        };
        if let Some((value, reads)) = self.value_of_all(here.scope, reads, d, kind) {
            let fault = arrays::misshapen(value, &indices, &mut |r| self.repeats.length(&self.names, reads, r));
            self.faults.maybe(fault);
        }
        self.names.array(here.scope, &d.name, indices.len());
        let array = match self.names.scopes[here.scope].values.get(d.name.text.as_str()) {
            Some(Valued::Family(family)) => Some(*family),
            _ => None,
        };
        for item in extents {
            if let Some(decl) = self.declare(here, reads, (&d.name, &item), kind, unit, doc) {
                let decl = &mut self.names.decls[decl];
                if !decl.alone {
                    (decl.item, decl.array) = (item, array);
                }
            } else {
                break;
            }
        }
    }

    /// The value of all elements of an array, which may be a new one, and where it reads.
    fn value_of_all(
        &self,
        scope: ScopeId,
        reads: Here,
        d: &'a ast::Declaration,
        kind: DeclKind<'a>,
    ) -> Option<(&'a ast::Expr, Here)> {
        let full = || [self.names.scopes[scope].prefix.as_str(), &d.name.text].concat();
        let given = (!self.names.overrides.is_empty()).then(|| self.names.overrides.get(full().as_str())).flatten();
        match kind {
            DeclKind::Parameter { constant: false, .. } if given.is_some() => Some((given?, Here::of(0))),
            _ => Some((kind.value()?, reads)),
        }
    }

    /// Declares a value under a name with its indices, with the new value of a parameter that is overridden.
    fn declare(
        &mut self,
        here: Here,
        reads: Here,
        (name, indices): (&'a ast::Name, &[i64]),
        kind: DeclKind<'a>,
        unit: Option<&'a ast::UnitText>,
        doc: Option<&'a ast::Doc>,
    ) -> Option<DeclId> {
        let doc = doc.map_or("", |d| &d.text);
        let prefix = &self.names.scopes[here.scope].prefix;
        let full = full_name(prefix, &name.text, indices);
        let (item, array, replaced_unit, alone) = (Indices::default(), None, None, false);
        let (own, scope) = (name.text.as_str(), here.scope);
        let mut decl =
            Decl { name: full, own, scope, reads, item, array, alone, kind, unit, replaced_unit, doc, span: name.span };
        self.override_value(&mut decl, here.scope, name, indices);
        match self.names.declare(here.scope, name, indices, decl) {
            Ok(decl) => {
                if let Some(&value @ Valued::Family(family)) =
                    self.names.scopes[here.scope].values.get(name.text.as_str())
                    && self.names.value_families[family].span != name.span
                {
                    self.uses.add(Used::of(value), name.span);
                }
                Some(decl)
            }
            Err(fault) => {
                self.faults.push(*fault);
                None
            }
        }
    }

    /// Puts a new value in the place of that of a parameter: its own, or that of the array it belongs to.
    fn override_value(&self, decl: &mut Decl<'a>, scope: ScopeId, name: &ast::Name, indices: &[i64]) {
        let DeclKind::Parameter { value, constant: false } = decl.kind else { return };
        if self.names.overrides.is_empty() {
            return;
        }
        let own = self.names.overrides.get(decl.name.as_str());
        let whole =
            || self.names.overrides.get([self.names.scopes[scope].prefix.as_str(), &name.text].concat().as_str());
        let Some(new) = own.copied().or_else(|| whole().copied()) else { return };
        decl.alone = own.is_some();
        decl.replaced_unit = value.and_then(|value| unit_of_literal(value, indices));
        decl.kind = DeclKind::Parameter { value: Some(new), constant: false };
        decl.reads = Here::of(0);
    }

    /// Gives a node its name; false if the name is taken, which is said.
    fn place(&mut self, scope: ScopeId, name: &'a ast::Name, indices: &[i64], node: Node) -> bool {
        match self.names.place(scope, name, indices, node) {
            Ok(()) => {
                if let Some(&(Node::Family(family), first)) = self.names.scopes[scope].nodes.get(name.text.as_str())
                    && first != name.span
                {
                    self.uses.add(Used::Node(Node::Family(family)), name.span);
                }
                true
            }
            Err(fault) => {
                self.faults.push(*fault);
                false
            }
        }
    }

    /// Declares the nodes of a chain and keeps its bonds for later, when all nodes are known.
    fn chain(&mut self, here: Here, chain: &'a ast::Chain, pseudo: bool) {
        let nodes = std::iter::once(&chain.first).chain(chain.bonds.iter().map(|b| &b.to));
        for node in nodes {
            if let ast::Node::Declared(element) = node {
                self.element(here, element, pseudo);
            }
        }
        self.chains.push((here, chain, pseudo));
    }

    fn element(&mut self, here: Here, element: &'a ast::Element, pseudo: bool) {
        if self.parts.len() >= MAX_PARTS || self.names.scopes.len() >= MAX_INSTANCES {
            self.too_large(element.span);
            return;
        }
        let Some((indices, ports)) = self.indices_and_ports(here, element) else { return };
        let Some(word) = Word::of(&element.kind.text) else {
            return self.instance(here, element, &indices, ports, pseudo);
        };
        let node = Node::Part(self.parts.len());
        let name = full_name(&self.names.scopes[here.scope].prefix, &element.name.text, &indices);
        if self.place(here.scope, &element.name, &indices, node) {
            self.parts.push(Part { name, here, word, ports, ast: element, pseudo });
        }
    }

    /// What stands in brackets behind the name of an element: its indices and its ports. Names alone are indices if they
    /// are numbers known here, else ports. `None` if they are at fault, which is said.
    fn indices_and_ports(&mut self, here: Here, element: &'a ast::Element) -> Option<(Indices, &'a [ast::Name])> {
        if element.ports.is_empty() || !element.indices.is_empty() {
            return Some((self.indices(here, &element.indices)?, &element.ports));
        }
        let known = |r: &mut Repeats<'a>, names: &Names<'a>, name| r.peek(names, here, name).is_some();
        let number: Vec<bool> = element.ports.iter().map(|p| known(&mut self.repeats, &self.names, p)).collect();
        if number.iter().all(|known| *known) {
            let index = |name| self.repeats.name_as_index(&self.names, here, name);
            return Some((element.ports.iter().map(index).collect::<Option<_>>()?, &[]));
        }
        let variable = |p: &ast::Name| self.repeats.variable(here.turn, &p.text).is_some();
        if !element.ports.iter().any(variable) {
            return Some((Indices::default(), &element.ports));
        }
        let port = element.ports.iter().zip(&number).find(|(_, known)| !**known).map(|(p, _)| p)?;
        let (name, title) =
            (&element.name.text, format!("`{}` is no number known when the model is compiled", port.text));
        let d = Diagnostic::error(codes::N022, title, port.span, "beside an index");
        let hint = format!("ports stand in brackets of their own: `{name}[i][{}]`", port.text);
        self.faults.push(d.hint(hint));
        self.lost = true;
        None
    }

    fn too_large(&mut self, span: Span) {
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

    /// Makes a scope for an instance of a component and fills it.
    fn instance(
        &mut self,
        here: Here,
        element: &'a ast::Element,
        indices: &[i64],
        ports: &'a [ast::Name],
        pseudo: bool,
    ) {
        let scope = here.scope;
        let Some(used) = self.names.component(scope, &element.kind.text) else {
            return self.unknown_kind(scope, element, indices);
        };
        self.uses.add(Used::Component(used), element.kind.span);
        let (written, component) = self.names.components[used];
        if let Some(fault) = self.endless(scope, component, element) {
            self.faults.push(fault);
            self.place(scope, &element.name, indices, Node::Broken);
            return;
        }
        let id = self.names.scopes.len();
        if !self.place(scope, &element.name, indices, Node::Instance(id)) {
            return;
        }
        self.names.scopes.push(Scope {
            prefix: full_name(&self.names.scopes[scope].prefix, &element.name.text, indices) + ".",
            parent: Some(written),
            instance: Some((component, element.span)),
            user: here,
            depth: self.names.scopes[scope].depth + 1,
            values: FxHashMap::default(),
            nodes: FxHashMap::default(),
            components: FxHashMap::default(),
        });
        self.refuse_odd_arguments(component, element, ports);
        self.interface(id, here, component, element);
        self.components(id, &component.body);
        self.fill(Here::of(id), &component.body, pseudo, false);
        self.check_outs(id, component);
    }

    fn unknown_kind(&mut self, scope: ScopeId, element: &'a ast::Element, indices: &[i64]) {
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
        self.place(scope, &element.name, indices, Node::Broken);
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
            s = self.names.scopes[s].user.scope;
        }
        (self.names.scopes[scope].depth >= MAX_DEPTH).then(|| {
            Diagnostic::error(codes::N013, "components are nested too deeply", element.span, "this one is too deep")
                .note(format!("at most {MAX_DEPTH} inside one another"))
        })
    }

    /// Says which arguments of an instance belong to nothing.
    fn refuse_odd_arguments(
        &mut self,
        component: &'a ast::Component,
        element: &'a ast::Element,
        ports: &'a [ast::Name],
    ) {
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
        for port in ports {
            let title = format!("the ports of component `{}` are those of its declaration", component.name.text);
            self.faults.push(Diagnostic::error(codes::N007, title, port.span, "no list here"));
        }
    }

    /// Declares the parameters, inputs, outputs and ports of an instance, with the values that it is given.
    fn interface(&mut self, id: ScopeId, user: Here, component: &'a ast::Component, element: &'a ast::Element) {
        let own = Here::of(id);
        let given = |name: &str| {
            let labelled = element.args.iter().filter(|a| a.label.as_ref().is_some_and(|l| l.name.text == name));
            labelled.map(|a| &a.value).next()
        };
        for d in component.params.iter().chain(&component.ins) {
            let (value, reads) = match given(&d.name.text) {
                Some(value) => (Some(value), user),
                None => (d.value.as_ref(), own),
            };
            if value.is_none() {
                self.missing_argument(component, element, d);
            }
            let is_param = component.params.iter().any(|p| std::ptr::eq(p, d));
            let kind = match is_param {
                true => DeclKind::Parameter { value, constant: false },
                false => DeclKind::Let(value),
            };
            self.declare_whole(own, reads, d, kind);
        }
        self.labels_use(id, element);
        for d in component.outs.iter().filter(|d| d.value.is_some()) {
            self.declare_whole(own, own, d, DeclKind::Let(d.value.as_ref()));
        }
        for d in &component.ports {
            let Some(extents) = self.indices(own, &d.indices).and_then(|indices| Extents::of(&indices)) else {
                continue;
            };
            for indices in extents {
                let joint = self.joints.len();
                let name = spelled(&d.name.text, &indices);
                self.joints.push(Joint { instance: id, name, span: d.name.span });
                self.place(id, &d.name, &indices, Node::Joint(joint));
            }
        }
    }

    /// The label of an argument names what the instance declares.
    fn labels_use(&mut self, id: ScopeId, element: &ast::Element) {
        for label in element.args.iter().filter_map(|a| a.label.as_ref()) {
            if let Some(&value) = self.names.scopes[id].values.get(label.name.text.as_str()) {
                self.uses.add(Used::of(value), label.name.span);
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
            if let Some(&value) = self.names.scopes[id].values.get(d.name.text.as_str()) {
                self.uses.add(Used::of(value), d.name.span);
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
        chains.sort_by_key(|(here, _, _)| here.scope);
        for (here, chain, pseudo) in chains {
            let before = self.faults.len();
            self.draw_chain(here, chain, pseudo);
            if here.turn != 0 {
                self.faults.in_turn(before, || self.repeats.words(here.turn));
            }
        }
    }

    fn draw_chain(&mut self, here: Here, chain: &'a ast::Chain, pseudo: bool) {
        if chain.bonds.is_empty() {
            return self.lone_node(&chain.first);
        }
        let mut from = self.end(here, &chain.first);
        for bond in &chain.bonds {
            let to = self.end(here, &bond.to);
            self.drawn_bond(here, from, to, bond, pseudo);
            from = to;
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

    fn drawn_bond(&mut self, here: Here, from: End, to: End, bond: &'a ast::Bond, pseudo: bool) {
        let named = bond.name.as_ref().and_then(|b| Some((&b.name, self.indices(here, &b.indices)?)));
        let name = match named {
            Some((name, indices)) => {
                self.place(here.scope, name, &indices, Node::Bond(self.drawn.len()));
                full_name(&self.names.scopes[here.scope].prefix, &name.text, &indices)
            }
            None => String::new(),
        };
        self.drawn.push(Drawn { from, to, name, here, pseudo, span: from.span.to(to.span) });
    }

    /// What a node of a chain stands for as the end of a bond.
    fn end(&mut self, here: Here, node: &'a ast::Node) -> End {
        match node {
            ast::Node::Missing(span) => End { at: At::Broken, span: *span },
            ast::Node::Declared(element) => {
                let at = match self.declared_node(here, element) {
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
            ast::Node::Named(path) => End { at: self.named_end(here, path), span: path.span },
        }
    }

    /// What the name of an element stands for where it is declared.
    fn declared_node(&mut self, here: Here, element: &'a ast::Element) -> Option<(Node, Span)> {
        match self.names.scopes[here.scope].nodes.get(element.name.text.as_str()).copied()? {
            (Node::Family(family), _) => {
                let (indices, _) = self.indices_and_ports(here, element)?;
                self.names.node_families[family].element(&indices).copied()
            }
            found => Some(found),
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
            [port] if port.indices.is_empty() => match self.names.scopes[inner].nodes.get(port.name.text.as_str()) {
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
    fn named_end(&mut self, here: Here, path: &'a ast::Path) -> At {
        let uses = &mut self.uses;
        let visit = &mut |node, span| uses.add(Used::Node(node), span);
        let (node, used) = match self.names.walk(&mut self.repeats, here, path, visit) {
            Ok(found) => found,
            Err(fault) => {
                self.faults.push(*fault);
                return At::Broken;
            }
        };
        if let Some((part, index)) = path.parts[used..].iter().find_map(|p| Some((p, p.indices.first()?))) {
            self.faults.push(no_indices(&part.name, index.span));
            return At::Broken;
        }
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
            false => p.ports.iter().map(|n| n.text.as_str()).collect(),
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
