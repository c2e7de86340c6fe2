//! What the ends of bonds are, when all nodes are known.

use super::flatten::{At, Drawn, End, Flat, full_name};
use super::scope::{Here, Node, ScopeId, no_indices};
use super::uses::Used;
use crate::ast;
use crate::diagnostic::nearest;
use crate::diagnostic::{Diagnostic, codes};
use crate::span::Span;

impl<'a> Flat<'a> {
    /// Makes the bonds of all chains, those of the model before those inside its instances.
    pub fn draw_bonds(&mut self) {
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
        let mut from = &chain.first;
        for bond in &chain.bonds {
            let (start, end) = (self.end(here, from, false), self.end(here, &bond.to, true));
            self.drawn_bond(here, start, end, bond, pseudo);
            from = &bond.to;
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

    /// What a node of a chain stands for as the end of a bond, which points at it or not.
    fn end(&mut self, here: Here, node: &'a ast::Node, pointed_at: bool) -> End {
        match node {
            ast::Node::Missing(span) => End { at: At::Broken, span: *span },
            ast::Node::Declared(element) => {
                let at = match self.declared_node(here, element) {
                    Some((node, span)) if span == element.name.span && element.port.is_some() => {
                        element.port.as_ref().map_or(At::Broken, |port| self.port_of(node, port))
                    }
                    Some((Node::Part(part), span)) if span == element.name.span => At::Part(part, None),
                    Some((Node::Instance(inner), span)) if span == element.name.span => {
                        self.usual_port(inner, element.span, pointed_at)
                    }
                    _ => At::Broken,
                };
                End { at, span: element.span }
            }
            ast::Node::Named(path) => End { at: self.named_end(here, path, pointed_at), span: path.span },
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

    /// A component with one port can be written as a node, and one with two as a `TF`: the bond that points at it ends at
    /// the first, the other starts at the second. Otherwise the port must be named.
    fn usual_port(&mut self, inner: ScopeId, span: Span, pointed_at: bool) -> At {
        let Some((component, _)) = self.names.scopes[inner].instance else { return At::Broken };
        let usual = match component.ports.as_slice() {
            [port] => Some(port),
            [first, second] => Some(if pointed_at { first } else { second }),
            _ => None,
        };
        match (usual, component.ports.as_slice()) {
            (Some(port), ports) if ports.iter().all(|p| p.indices.is_empty()) => {
                match self.names.scopes[inner].nodes.get(port.name.text.as_str()) {
                    Some(&(Node::Joint(joint), _)) => At::Outside(joint),
                    _ => At::Broken,
                }
            }
            (_, ports) => {
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
    fn named_end(&mut self, here: Here, path: &'a ast::Path, pointed_at: bool) -> At {
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
            (Node::Instance(inner), []) => self.usual_port(inner, path.span, pointed_at),
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
