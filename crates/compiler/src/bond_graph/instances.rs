//! Instances of components: each becomes a scope with its own elements and bonds.

use rustc_hash::FxHashMap;

use super::arrays::Extents;
use super::families::spelled;
use super::flatten::{Flat, Joint, WORDS, full_name};
use super::port_kinds::Way;
use super::repeat::MAX_TURNS;
use super::scope::{DeclKind, Here, Node, Scope, ScopeId};
use super::uses::Used;
use crate::ast::{self, ExprKind, StatementKind};
use crate::diagnostic::nearest;
use crate::diagnostic::{Diagnostic, codes};
use crate::span::{FileId, Span};

/// The greatest number of components inside one another.
const MAX_DEPTH: usize = 64;

/// The kind of a declaration with its value.
type KindOf<'a> = fn(Option<&'a ast::Expr>) -> DeclKind<'a>;

impl<'a> Flat<'a> {
    /// Makes a scope for an instance of a component and fills it.
    pub fn instance(
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
        let near = nearest(&kind.text, known);
        let plain = |(word, what): (&str, &str)| format!("write `{word}:{}(…)`: {what}", element.name.text);
        let d = match (usual_name(&kind.text).map(plain), self.offered(&kind.text)) {
            (Some(plain), None) => d.hint(plain),
            (Some(plain), Some(library)) => {
                d.hint(format!("{plain}; or write `import {library}` above, which has a component of this name"))
            }
            (None, Some(library)) => d.hint(format!("write `import {library}` above, which has it")),
            (None, None) => match near {
                Some(near) => d.hint(format!("did you mean `{near}`?")),
                None => d.hint(
                    "kinds are 0 1 Se Sf I C R TF GY ZC rSe rSf De Df, and components that are declared or imported",
                ),
            },
        };
        self.faults.push(d);
        self.place(scope, &element.name, indices, Node::Broken);
    }

    /// The library that has a component of this name.
    fn offered(&self, component: &str) -> Option<String> {
        let files = self.files?;
        files.libraries().into_iter().find(|name| {
            let parsed = files.library(name).map(|text| ast::parse(&text, FileId(0)));
            let statements = parsed.map(|p| p.ast.statements).unwrap_or_default();
            statements.iter().any(|s| matches!(&s.kind, StatementKind::Component(c) if c.name.text == component))
        })
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
        let known: Vec<&str> = component.arguments().map(|d| d.name.text.as_str()).collect();
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
        let [params, consts, ins] = [&component.params, &component.consts, &component.ins];
        let param = |value| DeclKind::Parameter { value, constant: false };
        let groups: [(_, KindOf<'a>); 3] = [(params, param), (consts, DeclKind::MadeFor), (ins, DeclKind::Let)];
        for (d, kind_of) in groups.into_iter().flat_map(|(list, kind_of)| list.iter().map(move |d| (d, kind_of))) {
            if let Some(kind) = self.kind_of_port(d) {
                self.port_of_kind(id, d, kind, Way::Arrives);
                continue;
            }
            let (value, reads) = match given(&d.name.text) {
                Some(value) => (Some(value), user),
                None => (d.value.as_ref(), own),
            };
            if value.is_none() {
                self.missing_argument(component, element, d);
            }
            self.declare_whole(own, reads, d, kind_of(value));
        }
        self.labels_use(id, element);
        for d in &component.outs {
            match (self.kind_of_port(d), d.value.as_ref()) {
                (Some(kind), _) => self.port_of_kind(id, d, kind, Way::Leaves),
                (None, Some(value)) => self.declare_whole(own, own, d, DeclKind::Let(Some(value))),
                (None, None) => {}
            }
        }
        for d in &component.ports {
            let Some(indices) = self.sizes(own, &d.indices) else { continue };
            let Some(extents) = Extents::of(&indices).filter(|e| e.count() + self.joints.len() <= MAX_TURNS) else {
                self.too_large(d.span);
                return;
            };
            for indices in extents {
                let joint = self.joints.len();
                let name = spelled(&d.name.text, &indices);
                let open = self.is_open(d);
                self.joints.push(Joint { instance: id, name, span: d.name.span, open });
                self.place(id, &d.name, &indices, Node::Joint(joint));
            }
        }
    }

    /// Whether a port may be left alone: `port axis = open`.
    fn is_open(&mut self, d: &ast::Declaration) -> bool {
        let Some(value) = &d.value else { return false };
        if let ExprKind::Path(path) = &value.kind
            && let [one] = path.parts.as_slice()
            && one.name.text == "open"
        {
            return true;
        }
        let fault = Diagnostic::error(codes::N007, "a port has no value", value.span, "not known here");
        let fault = fault.hint(format!("write `port {0} = open` if nothing needs to be joined to it", d.name.text));
        if !self.faults.contains(&fault) {
            self.faults.push(fault);
        }
        false
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
            if self.kind_of_port(d).is_some() {
                continue;
            }
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
