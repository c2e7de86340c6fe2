//! The names of a model: who declares them, who uses them.

use rustc_hash::FxHashMap;
use std::collections::BTreeMap;

use super::flatten::Flat;
use super::scope::{ComponentId, Decl, DeclKind, Node, Scope, Valued};
use super::uses::{Used, Uses};
use crate::algebra::natural_order;
use crate::ast::Ast;
use crate::diagnostic::Sources;
use crate::span::{FileId, Span};

/// What a name stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum NameKind {
    /// The model.
    Model,
    /// A file that is imported.
    File,
    /// A file with a table.
    Table,
    /// A component: a type of instances.
    Component,
    /// A parameter.
    Parameter,
    /// A constant.
    Constant,
    /// An input.
    Input,
    /// A signal that is integrated.
    State,
    /// A variable that events alone change.
    Discrete,
    /// A named expression.
    Let,
    /// An output.
    Output,
    /// A function.
    Function,
    /// An element that is no junction.
    Element,
    /// A junction.
    Junction,
    /// An instance of a component.
    Instance,
    /// A port of an instance.
    Port,
    /// A bond that has a name.
    Bond,
    /// A constraint.
    Constraint,
}

impl NameKind {
    /// The kind in a word.
    pub fn word(self) -> &'static str {
        match self {
            NameKind::Model => "model",
            NameKind::File => "file",
            NameKind::Table => "table",
            NameKind::Component => "component",
            NameKind::Parameter => "parameter",
            NameKind::Constant => "constant",
            NameKind::Input => "input",
            NameKind::State => "state",
            NameKind::Discrete => "discrete",
            NameKind::Let => "let",
            NameKind::Output => "output",
            NameKind::Function => "function",
            NameKind::Element => "element",
            NameKind::Junction => "junction",
            NameKind::Instance => "instance",
            NameKind::Port => "port",
            NameKind::Bond => "bond",
            NameKind::Constraint => "constraint",
        }
    }

    /// Whether expressions name it bare; what has parts or variables is named with a dot behind it. One name may be declared
    /// once as either.
    pub fn is_value(self) -> bool {
        use NameKind::{Constant, Discrete, Function, Input, Let, Output, Parameter, State};
        matches!(self, Parameter | Constant | Input | State | Discrete | Let | Output | Function)
    }
}

/// A name that the text of a model declares, and the places at which the text uses it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Name {
    /// The name, within instances with theirs before it: `crane.motor.r`. Of files the path. Elements with indices have
    /// one name together: `spring` for `spring[1]` to `spring[9]`.
    pub name: String,
    /// What it stands for.
    pub kind: NameKind,
    /// Where the name is declared. What a component declares stands there for each of its instances. `None` for tables,
    /// which are no model text; a file that is imported is declared by its beginning.
    pub declared: Option<Span>,
    /// Where it is used, and where further elements of it are declared: its name alone, without what stands before or behind
    /// the dots. In the order of the files and of their text, each place once. A place inside a component counts for each
    /// instance that names something else by it.
    pub uses: Vec<Span>,
}

/// The names of a model, those of one kind in the order of the text.
pub(super) fn table(
    main: &Ast,
    flat: &Flat<'_>,
    mut uses: Uses,
    imports: &[(FileId, Span)],
    sources: &Sources,
) -> Vec<Name> {
    uses.places.extend(&flat.uses.places);
    flat.repeats.add_uses(&flat.names, &mut uses);
    uses.places.sort_unstable();
    uses.places.dedup();
    let mut places: FxHashMap<Used, Vec<Span>> = FxHashMap::default();
    for (used, span) in uses.places {
        places.entry(used).or_default().push(span);
    }
    let mut of = |used: Used| places.remove(&used).unwrap_or_default();
    let mut all: Vec<Name> = main.header.iter().map(model).collect();
    all.extend(files(imports, sources));
    all.extend(tables(uses.tables));
    all.extend(values(flat, &mut of));
    all.extend(nodes(flat, &mut of));
    all.extend(components(flat, &mut of));
    let by_name = |a: &Name, b: &Name| natural_order(&a.name, &b.name);
    all.sort_by(|a, b| (a.kind, a.declared).cmp(&(b.kind, b.declared)).then_with(|| by_name(a, b)));
    all
}

fn model(header: &crate::ast::Header) -> Name {
    let declared = Some(header.name.span);
    Name { name: header.name.text.clone(), kind: NameKind::Model, declared, uses: Vec::new() }
}

fn files(imports: &[(FileId, Span)], sources: &Sources) -> Vec<Name> {
    let mut uses: BTreeMap<FileId, Vec<Span>> = BTreeMap::new();
    imports.iter().for_each(|(file, span)| uses.entry(*file).or_default().push(*span));
    let name = |(file, uses): (FileId, Vec<Span>)| {
        let declared = Some(Span { file, start: 0, end: 0 });
        Name { name: sources.name(file).to_string(), kind: NameKind::File, declared, uses: in_order(uses) }
    };
    uses.into_iter().map(name).collect()
}

fn tables(read: Vec<(String, Span)>) -> Vec<Name> {
    let mut uses: BTreeMap<String, Vec<Span>> = BTreeMap::new();
    read.into_iter().for_each(|(path, span)| uses.entry(path).or_default().push(span));
    let name = |(name, uses)| Name { name, kind: NameKind::Table, declared: None, uses: in_order(uses) };
    uses.into_iter().map(name).collect()
}

fn in_order(mut places: Vec<Span>) -> Vec<Span> {
    places.sort_unstable();
    places.dedup();
    places
}

fn values(flat: &Flat<'_>, uses: &mut dyn FnMut(Used) -> Vec<Span>) -> Vec<Name> {
    let names = &flat.names;
    let mut all = Vec::with_capacity(names.decls.len());
    for scope in &names.scopes {
        for (own, &value) in &scope.values {
            let first = match value {
                Valued::One(decl) => Some(decl),
                Valued::Family(family) => names.value_families[family].first().copied(),
            };
            if let Some(decl) = first {
                let (kind, declared) = (kind_of(&names.decls[decl]), Some(names.span_of(value)));
                all.push(Name { name: [&scope.prefix, *own].concat(), kind, declared, uses: uses(Used::of(value)) });
            }
        }
    }
    all
}

fn kind_of(decl: &Decl<'_>) -> NameKind {
    match decl.kind {
        DeclKind::Parameter { constant: false, .. } => NameKind::Parameter,
        DeclKind::Parameter { constant: true, .. } => NameKind::Constant,
        DeclKind::Input(_) => NameKind::Input,
        DeclKind::Let(_) | DeclKind::MadeFor(_) | DeclKind::Joined(_) => NameKind::Let,
        DeclKind::Output(_) => NameKind::Output,
        DeclKind::State(_) => NameKind::State,
        DeclKind::Discrete(_) => NameKind::Discrete,
        DeclKind::Function(_) => NameKind::Function,
    }
}

fn nodes(flat: &Flat<'_>, uses: &mut dyn FnMut(Used) -> Vec<Span>) -> Vec<Name> {
    flat.names.scopes.iter().flat_map(|scope| nodes_of(flat, scope, uses)).collect()
}

fn nodes_of(flat: &Flat<'_>, scope: &Scope<'_>, uses: &mut dyn FnMut(Used) -> Vec<Span>) -> Vec<Name> {
    let mut all = Vec::with_capacity(scope.nodes.len());
    for (own, &(node, declared)) in &scope.nodes {
        let one = match node {
            Node::Family(family) => flat.names.node_families[family].first().map(|(node, _)| *node),
            node => Some(node),
        };
        let kind = match one {
            Some(Node::Part(part)) if flat.parts[part].word.is_junction() => NameKind::Junction,
            Some(Node::Part(_) | Node::Port(..)) => NameKind::Element,
            Some(Node::Instance(_)) => NameKind::Instance,
            Some(Node::Joint(_)) => NameKind::Port,
            Some(Node::Bond(_)) => NameKind::Bond,
            Some(Node::Constraint(_)) => NameKind::Constraint,
            Some(Node::Broken | Node::Family(_)) | None => continue,
        };
        let name = [&scope.prefix, *own].concat();
        all.push(Name { name, kind, declared: Some(declared), uses: uses(Used::Node(node)) });
    }
    all
}

fn components(flat: &Flat<'_>, uses: &mut dyn FnMut(Used) -> Vec<Span>) -> Vec<Name> {
    let name = |(id, &(scope, c)): (ComponentId, &(usize, &crate::ast::Component))| {
        let name = [&flat.names.scopes[scope].prefix, c.name.text.as_str()].concat();
        let declared = Some(c.name.span);
        Name { name, kind: NameKind::Component, declared, uses: uses(Used::Component(id)) }
    };
    flat.names.components.iter().enumerate().map(name).collect()
}
