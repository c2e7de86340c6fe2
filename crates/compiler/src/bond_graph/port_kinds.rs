//! Kinds of ports: several bonds with signals that go along their half arrows.

use rustc_hash::FxHashMap;

use super::families::spelled;
use super::flatten::{At, End, Flat, Joint, Word};
use super::scope::{DeclKind, Here, Node, Scope, ScopeId, Valued};
use crate::ast;
use crate::diagnostic::{Diagnostic, codes};
use crate::span::Span;

/// Which way the signals of a port go.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Way {
    /// Into the component: `in a : frame`.
    Arrives,
    /// Out of it: `out b : frame`.
    Leaves,
    /// Through a junction: `1[frame]:hub`.
    Passes,
}

/// A port of some kind, or a junction of such ports. Its bonds and signals have a scope of their own.
pub(super) struct Frame<'a> {
    pub kind: &'a ast::PortKind,
    pub way: Way,
    /// The scope that it belongs to.
    pub owner: ScopeId,
    /// Where it is declared.
    pub span: Span,
    /// The bond by which its signals come.
    pub parent: Option<Span>,
}

impl<'a> Flat<'a> {
    /// Registers a kind of port.
    pub fn port_kind(&mut self, kind: &'a ast::PortKind) {
        let name = kind.name.text.as_str();
        if let Some(first) = self.names.port_kinds.insert(name, kind)
            && !std::ptr::eq(first, kind)
        {
            let title = format!("the kind of port `{name}` is declared twice");
            let fault = Diagnostic::error(codes::N002, title, kind.name.span, "again");
            self.faults.push(fault.also(first.name.span, "declared first").hint("give one of them another name"));
        }
    }

    /// The kind of port that a declaration in the head of a component names.
    pub fn kind_of_port(&self, d: &ast::Declaration) -> Option<&'a ast::PortKind> {
        self.names.port_kinds.get(d.unit.as_ref()?.text.as_str()).copied()
    }

    /// Makes a port of an instance whose bonds and signals are those of a kind.
    pub fn port_of_kind(&mut self, owner: ScopeId, d: &'a ast::Declaration, kind: &'a ast::PortKind, way: Way) {
        let Some(scope) = self.frame(Here::of(owner), (&d.name, &[]), kind, way) else { return };
        for bond in &kind.bonds {
            let Some(widths) = self.sizes(Here::of(0), &bond.indices) else { return };
            let joint = |flat: &mut Self, indices: &[i64]| {
                let name = format!("{}.{}", d.name.text, spelled(&bond.name.text, indices));
                flat.place(scope, &bond.name, indices, Node::Joint(flat.joints.len()));
                flat.joints.push(Joint { instance: owner, name, span: d.name.span, open: false });
            };
            match *widths {
                [] => joint(self, &[]),
                [width] => (1..=width).for_each(|at| joint(self, &[at])),
                _ => self.faults.push(
                    Diagnostic::error(codes::N021, "a bond has one width", bond.span, "several")
                        .hint("write `bond twist[6]`"),
                ),
            }
        }
        if way == Way::Arrives {
            self.signals_to_come(scope, kind);
        }
    }

    /// `1[frame]:hub`: a junction for every bond of the kind, through which its signals pass.
    pub fn junction_of_kind(
        &mut self,
        here: Here,
        (element, indices): (&'a ast::Element, &[i64]),
        word: Word,
        kind: &'a ast::PortKind,
        pseudo: bool,
    ) {
        let Some(scope) = self.frame(here, (&element.name, indices), kind, Way::Passes) else { return };
        for bond in &kind.bonds {
            let width = match bond.indices.first() {
                Some(width) => self.width(Here::of(0), width),
                None => Some(1),
            };
            let Some(width) = width else { return };
            self.strands_named(Here::of(scope), element, &bond.name, word, width, pseudo);
        }
        self.signals_to_come(scope, kind);
    }

    fn frame(
        &mut self,
        here: Here,
        (name, indices): (&'a ast::Name, &[i64]),
        kind: &'a ast::PortKind,
        way: Way,
    ) -> Option<ScopeId> {
        let scope = self.names.scopes.len();
        if !self.place(here.scope, name, indices, Node::Instance(scope)) {
            return None;
        }
        let around = &self.names.scopes[here.scope];
        let (prefix, instance, depth) =
            (format!("{}{}.", around.prefix, spelled(&name.text, indices)), around.instance, around.depth);
        self.names.scopes.push(Scope {
            prefix,
            parent: Some(here.scope),
            instance,
            user: here,
            depth,
            values: FxHashMap::default(),
            nodes: FxHashMap::default(),
            components: FxHashMap::default(),
        });
        let frame = Frame { kind, way, owner: here.scope, span: name.span, parent: None };
        self.frames.insert(scope, frame);
        Some(scope)
    }

    fn signals_to_come(&mut self, scope: ScopeId, kind: &'a ast::PortKind) {
        for d in &kind.signals {
            self.declare(
                Here::of(scope),
                Here::of(scope),
                (&d.name, &[]),
                DeclKind::Joined(None),
                None,
                d.doc.as_ref(),
            );
        }
    }

    /// `let b.R = …`: gives a signal of a port through which it leaves.
    pub fn give_signal(&mut self, here: Here, owner: &'a ast::Name, d: &'a ast::Declaration) {
        let scope = match self.names.scopes[here.scope].nodes.get(owner.text.as_str()) {
            Some(&(Node::Instance(scope), _)) if self.frames.contains_key(&scope) => scope,
            _ => {
                let title = format!("`{}` is no port with signals", owner.text);
                let fault = Diagnostic::error(codes::N001, title, owner.span, "no signal can be given to it");
                self.faults.push(fault.hint(format!(
                    "write `let {} = …`, or declare the port: `out {} : frame`",
                    d.name.text, owner.text
                )));
                return;
            }
        };
        let frame = &self.frames[&scope];
        if frame.way != Way::Leaves || frame.owner != here.scope {
            let title = format!("the signals of `{}` come from outside", owner.text);
            let fault =
                Diagnostic::error(codes::N014, title, owner.span, "given here").also(frame.span, "declared here");
            self.faults.push(fault.hint(format!("read them: `{}.{}`", owner.text, d.name.text)));
            return;
        }
        if !frame.kind.signals.iter().any(|s| s.name.text == d.name.text) {
            let known: Vec<&str> = frame.kind.signals.iter().map(|s| s.name.text.as_str()).collect();
            let title = format!("ports of kind `{}` have no signal `{}`", frame.kind.name.text, d.name.text);
            let fault = Diagnostic::error(codes::N001, title, d.name.span, "not known");
            self.faults.push(fault.hint(format!("they have: {}", known.join(", "))));
            return;
        }
        let kind = DeclKind::Let(d.value.as_ref());
        self.declare(Here::of(scope), here, (&d.name, &[]), kind, d.unit.as_ref(), d.doc.as_ref());
    }

    /// The bonds of a port of some kind, or of the junction of such, in order, as seen from a scope.
    pub fn bonds_of_frame(&self, here: Here, scope: ScopeId, span: Span) -> Vec<End> {
        let mut ends = Vec::new();
        for bond in &self.frames[&scope].kind.bonds {
            match self.names.scopes[scope].nodes.get(bond.name.text.as_str()) {
                Some(&(Node::Family(family), _)) => {
                    let family = &self.names.node_families[family];
                    let nodes = (1..=family.row().unwrap_or(0)).filter_map(|at| family.element(&[at as i64]));
                    ends.extend(nodes.map(|(node, _)| End { at: self.at_of(here, *node), span }));
                }
                Some(&(node, _)) => ends.push(End { at: self.at_of(here, node), span }),
                None => {}
            }
        }
        ends
    }

    /// What a node with one bond is as the end of it.
    pub fn at_of(&self, here: Here, node: Node) -> At {
        match node {
            Node::Part(part) => At::Part(part, None),
            Node::Port(part, port) => At::Part(part, Some(port)),
            Node::Joint(joint) if self.joints[joint].instance == here.scope => At::Inside(joint),
            Node::Joint(joint) => At::Outside(joint),
            _ => At::Broken,
        }
    }

    /// Signals go along the half arrow of a bond between ports of one kind.
    pub fn join_signals(&mut self, here: Here, from: ScopeId, to: ScopeId, span: Span) {
        let (source, target) = (&self.frames[&from], &self.frames[&to]);
        let name = |scope: ScopeId| self.names.scopes[scope].prefix.trim_end_matches('.').to_string();
        if !std::ptr::eq(source.kind, target.kind) {
            let (a, b) = (&source.kind.name.text, &target.kind.name.text);
            let title = format!("a port of kind `{a}` meets one of kind `{b}`");
            self.faults.push(Diagnostic::error(codes::B012, title, span, "joined here"));
            return;
        }
        let inside = |frame: &Frame<'_>| frame.owner == here.scope;
        let gives = match source.way {
            Way::Passes => true,
            Way::Arrives => inside(source),
            Way::Leaves => !inside(source),
        };
        let takes = match target.way {
            Way::Passes => true,
            Way::Arrives => !inside(target),
            Way::Leaves => inside(target),
        };
        if !gives || !takes {
            let (wrong, does) = if gives { (to, "leave it") } else { (from, "arrive at it") };
            let title = format!("the half arrow is the wrong way round: the signals of `{}` {does}", name(wrong));
            let fault = Diagnostic::error(codes::B013, title, span, "drawn this way here");
            self.faults.push(fault.also(self.frames[&wrong].span, "declared here").hint("turn the bond round"));
            return;
        }
        if let Some(first) = target.parent {
            let title = format!("`{}` has two parents", name(to));
            let fault = Diagnostic::error(codes::B013, title, span, "the second bond that brings its signals");
            self.faults.push(
                fault
                    .also(first, "the first")
                    .note("signals such as orientations are computed once, along the half arrows of a tree")
                    .hint("close the loop by a cut joint, a component both of whose ports take such a bond"),
            );
            return;
        }
        let (kind, way) = (target.kind, target.way);
        if let Some(target) = self.frames.get_mut(&to) {
            target.parent = Some(span);
        }
        for d in &kind.signals {
            match self.names.scopes[to].values.get(d.name.text.as_str()) {
                Some(&Valued::One(decl)) if way != Way::Leaves => {
                    self.names.decls[decl].kind = DeclKind::Joined(Some(from));
                }
                _ => {
                    let (scope, kind) = (Here::of(to), DeclKind::Joined(Some(from)));
                    self.declare(scope, scope, (&d.name, &[]), kind, None, d.doc.as_ref());
                }
            }
        }
    }

    /// Says which signals nothing gives.
    pub fn check_frames(&mut self) {
        let mut scopes: Vec<ScopeId> = self.frames.keys().copied().collect();
        scopes.sort_unstable();
        for scope in scopes {
            let frame = &self.frames[&scope];
            let name = self.names.scopes[scope].prefix.trim_end_matches('.');
            let missing = |d: &&ast::Declaration| !self.names.scopes[scope].values.contains_key(d.name.text.as_str());
            let fault = match (frame.way, frame.parent, frame.kind.signals.iter().find(missing)) {
                (Way::Leaves, _, Some(d)) => {
                    let title = format!("nothing gives the signal `{}` of port `{name}`", d.name.text);
                    let own = name.rsplit('.').next().unwrap_or(name);
                    Diagnostic::error(codes::N009, title, frame.span, "it leaves here")
                        .hint(format!("write `let {own}.{} = …` in the component", d.name.text))
                }
                (Way::Arrives | Way::Passes, None, _) if !frame.kind.signals.is_empty() => {
                    let title = format!("nothing brings the signals of `{name}`");
                    Diagnostic::error(codes::B013, title, frame.span, "no bond points at it")
                        .hint(format!("write `… -> {name}`; half arrows run from the ground outward"))
                }
                _ => continue,
            };
            if !self.faults.contains(&fault) {
                self.faults.push(fault);
            }
        }
    }
}
