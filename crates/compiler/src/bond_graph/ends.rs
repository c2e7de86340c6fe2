//! What the ends of bonds are, when all nodes are known.

use smallvec::{SmallVec, smallvec};

use super::flatten::{At, Drawn, End, Flat, full_name};
use super::multibonds::{Width, part_name, strand_name};
use super::scope::{Here, Node, ScopeId, no_indices};
use super::uses::Used;
use crate::ast;
use crate::diagnostic::nearest;
use crate::diagnostic::{Diagnostic, codes};
use crate::span::Span;

/// One end of a bond, or of several side by side.
struct Ends {
    ends: SmallVec<[End; 1]>,
    /// Whether it is wide, even where it has one bond.
    wide: bool,
    span: Span,
    /// The port of some kind, or the junction of such, that it is.
    frame: Option<ScopeId>,
}

impl Ends {
    fn one(at: At, span: Span) -> Ends {
        Ends { ends: smallvec![End { at, span }], wide: false, span, frame: None }
    }

    fn is_broken(&self) -> bool {
        self.ends.iter().any(|end| end.at == At::Broken)
    }
}

impl<'a> Flat<'a> {
    /// Makes the bonds of all chains, those of the model before those inside its instances.
    pub fn draw_bonds(&mut self) {
        let mut chains = std::mem::take(&mut self.chains);
        chains.sort_by_key(|(here, _, _)| here.scope);
        self.drawn.reserve(chains.iter().map(|(_, chain, _)| chain.bonds.len()).sum());
        for (here, chain, pseudo) in chains {
            let before = self.faults.len();
            self.draw_chain(here, chain, pseudo);
            if here.turn != 0 {
                self.faults.in_turn(before, || self.repeats.words(here.turn));
            }
        }
        self.check_frames();
    }

    fn draw_chain(&mut self, here: Here, chain: &'a ast::Chain, pseudo: bool) {
        if chain.bonds.is_empty() {
            return self.lone_node(&chain.first);
        }
        let mut from = &chain.first;
        for bond in &chain.bonds {
            let (start, end) = (self.end(here, from, false), self.end(here, &bond.to, true));
            self.draw_side_by_side(here, &start, &end, bond, pseudo);
            from = &bond.to;
        }
    }

    /// Makes one bond, or several side by side.
    fn draw_side_by_side(&mut self, here: Here, from: &Ends, to: &Ends, bond: &'a ast::Bond, pseudo: bool) {
        if let (Some(from), Some(to)) = (from.frame, to.frame) {
            self.join_signals(here, from, to, bond.arrow);
        }
        let (n, m) = (from.ends.len(), to.ends.len());
        if n == m {
            let of = if from.wide || to.wide { Some(n) } else { None };
            for (at, (start, end)) in from.ends.iter().zip(&to.ends).enumerate() {
                self.drawn_bond(here, *start, *end, bond, (of.map(|of| (at, of)), pseudo));
            }
            return;
        }
        if !from.is_broken() && !to.is_broken() {
            let bonds = |n: usize| if n == 1 { "one bond".to_string() } else { format!("{n} bonds") };
            let title = format!("{} at one end, {} at the other", bonds(n), bonds(m));
            let d = Diagnostic::error(codes::B012, title, bond.arrow, "joined here");
            let d = d.also(from.span, bonds(n)).also(to.span, bonds(m));
            let hint = match (n, m) {
                (1, _) | (_, 1) => "name one of them: `v.x -> …` or `v[1] -> …`".to_string(),
                _ => format!(
                    "give both the same width, join some side by side, `[v, w] -> …`, or put a `TF[{m}, {n}]` between"
                ),
            };
            self.faults.push(d.hint(hint));
        }
        // What has no bond because of this is not told of again.
        for (end, starts) in from.ends.iter().map(|end| (*end, true)).chain(to.ends.iter().map(|end| (*end, false))) {
            let broken = End { at: At::Broken, span: end.span };
            let (from, to) = if starts { (end, broken) } else { (broken, end) };
            self.drawn.push(Drawn { from, to, name: String::new(), here, pseudo, span: end.span });
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

    /// One bond, perhaps one of several side by side.
    fn drawn_bond(
        &mut self,
        here: Here,
        from: End,
        to: End,
        bond: &'a ast::Bond,
        (strand, pseudo): (Option<(usize, usize)>, bool),
    ) {
        let named = bond.name.as_ref().and_then(|b| Some((&b.name, self.indices(here, &b.indices)?)));
        let name = match (named, strand) {
            (Some((name, indices)), None) => {
                self.place(here.scope, name, &indices, Node::Bond(self.drawn.len()));
                full_name(&self.names.scopes[here.scope].prefix, &name.text, &indices)
            }
            (Some((name, indices)), Some((at, of))) => {
                let own: Vec<i64> = indices.iter().copied().chain([at as i64 + 1]).collect();
                self.place(here.scope, name, &own, Node::Bond(self.drawn.len()));
                let whole = full_name(&self.names.scopes[here.scope].prefix, &name.text, &indices);
                part_name(&whole, &strand_name(at, of))
            }
            (None, _) => String::new(),
        };
        self.drawn.push(Drawn { from, to, name, here, pseudo, span: from.span.to(to.span) });
    }

    /// What a node of a chain stands for as the end of a bond, which points at it or not.
    fn end(&mut self, here: Here, node: &'a ast::Node, pointed_at: bool) -> Ends {
        match node {
            ast::Node::Missing(span) => Ends::one(At::Broken, *span),
            ast::Node::Declared(element) => {
                let span = element.span;
                match self.declared_node(here, element) {
                    Some((node, at)) if at == element.name.span && element.port.is_some() => {
                        Ends::one(element.port.as_ref().map_or(At::Broken, |port| self.port_of(node, port)), span)
                    }
                    Some((node, at)) if at == element.name.span => self.whole_node(here, node, span, pointed_at),
                    _ => Ends::one(At::Broken, span),
                }
            }
            ast::Node::Named(path) => self.named_end(here, path, pointed_at),
            ast::Node::Joined(nodes, span) => {
                let parts: Vec<Ends> = nodes.iter().map(|node| self.end(here, node, pointed_at)).collect();
                let ends = parts.into_iter().flat_map(|part| part.ends).collect();
                Ends { ends, wide: true, span: *span, frame: None }
            }
        }
    }

    /// A node as the end of a bond, or of several side by side.
    fn whole_node(&mut self, here: Here, node: Node, span: Span, pointed_at: bool) -> Ends {
        let wide = |ats: Vec<At>, frame| {
            let ends = ats.into_iter().map(|at| End { at, span }).collect();
            Ends { ends, wide: true, span, frame }
        };
        match node {
            Node::Part(part) if matches!(self.parts[part].width, Width::Matrix { .. }) => {
                wide(self.parts[part].side(pointed_at).map(|port| At::Part(part, Some(port))).collect(), None)
            }
            Node::Instance(scope) if self.frames.contains_key(&scope) => {
                let ends = self.bonds_of_frame(here, scope, span).into();
                Ends { ends, wide: true, span, frame: Some(scope) }
            }
            Node::Instance(inner) => match self.usual_frame(inner, pointed_at) {
                Some(scope) => self.whole_node(here, Node::Instance(scope), span, pointed_at),
                None => {
                    let node = self.usual_port(inner, span, pointed_at);
                    node.map_or(Ends::one(At::Broken, span), |node| self.whole_node(here, node, span, pointed_at))
                }
            },
            Node::Family(family) => {
                let family = &self.names.node_families[family];
                let row = family.row().map(|n| (1..=n as i64).filter_map(|at| family.element(&[at])));
                let nodes: Option<Vec<Node>> = row.map(|row| row.map(|(node, _)| *node).collect());
                match nodes {
                    Some(nodes) => wide(nodes.into_iter().map(|node| self.at_of(here, node)).collect(), None),
                    None => Ends::one(At::Broken, span),
                }
            }
            node => Ends::one(self.at_of(here, node), span),
        }
    }

    /// The port of an instance that has signals and takes or gives them, if there is one only.
    fn usual_frame(&self, inner: ScopeId, pointed_at: bool) -> Option<ScopeId> {
        let (component, _) = self.names.scopes[inner].instance?;
        let list = if pointed_at { &component.ins } else { &component.outs };
        let mut found = list.iter().filter(|d| self.kind_of_port(d).is_some());
        let (one, None) = (found.next()?, found.next()) else { return None };
        match self.names.scopes[inner].nodes.get(one.name.text.as_str()) {
            Some(&(Node::Instance(scope), _)) => Some(scope),
            _ => None,
        }
    }

    /// What the name of an element stands for where it is declared.
    fn declared_node(&mut self, here: Here, element: &'a ast::Element) -> Option<(Node, Span)> {
        match self.names.scopes[here.scope].nodes.get(element.name.text.as_str()).copied()? {
            (node @ Node::Family(family), span) => match &*self.indices_and_ports(here, element)?.0 {
                // The bonds of one node.
                [] if !element.widths.is_empty() => Some((node, span)),
                indices => self.names.node_families[family].element(indices).copied(),
            },
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
    fn usual_port(&mut self, inner: ScopeId, span: Span, pointed_at: bool) -> Option<Node> {
        let (component, _) = self.names.scopes[inner].instance?;
        let usual = match component.ports.as_slice() {
            [port] => Some(port),
            [first, second] => Some(if pointed_at { first } else { second }),
            _ => None,
        };
        match (usual, component.ports.as_slice()) {
            (Some(port), ports) if ports.iter().all(|p| p.indices.len() < 2) => {
                self.names.scopes[inner].nodes.get(port.name.text.as_str()).map(|(node, _)| *node)
            }
            (_, ports) => {
                let names = |list: &'a [ast::Declaration]| list.iter().map(|d| d.name.text.as_str());
                let [taken, given] = [&component.ins, &component.outs].map(|list| {
                    let with_signals = list.iter().filter(|d| self.kind_of_port(d).is_some());
                    with_signals.map(|d| d.name.text.as_str()).collect::<Vec<&str>>()
                });
                let list: Vec<&str> = names(ports).chain(taken.iter().copied()).chain(given.iter().copied()).collect();
                let title = format!("which port of `{}`?", component.name.text);
                let name = self.names.scopes[inner].prefix.clone();
                let d = Diagnostic::error(codes::B009, title, span, "a bond ends at a port");
                let here = names(ports).next().or_else(|| if pointed_at { &taken } else { &given }.first().copied());
                self.faults.push(match (here, list.first()) {
                    (Some(port), _) => d
                        .note(format!("its ports are {}", list.join(", ")))
                        .hint(format!("declare it on a line of its own and write `{name}{port}` here")),
                    // Half arrows of frames run from the ground outward, one way only.
                    (None, Some(_)) => d.note(format!("its ports are {}", list.join(", "))).hint(match taken.last() {
                        Some(port) => {
                            format!("half arrows point at its ports: write `… -> {name}{port}` on a line of its own")
                        }
                        None => format!(
                            "half arrows start at its ports: write `{name}{} -> …` on a line of its own",
                            list[0]
                        ),
                    }),
                    (None, None) => d.note("it has no ports"),
                });
                None
            }
        }
    }

    /// What a path stands for as the end of a bond.
    fn named_end(&mut self, here: Here, path: &'a ast::Path, pointed_at: bool) -> Ends {
        let uses = &mut self.uses;
        let visit = &mut |node, span| uses.add(Used::Node(node), span);
        let (node, used) = match self.names.walk_wide(&mut self.repeats, here, path, visit) {
            Ok(found) => found,
            Err(fault) => {
                self.faults.push(*fault);
                return Ends::one(At::Broken, path.span);
            }
        };
        let rest = &path.parts[used..];
        if let (Node::Part(part), [side]) = (node, rest)
            && let Width::Matrix { .. } = self.parts[part].width
            && matches!(side.name.text.as_str(), "in" | "out")
        {
            return self.named_side(here, part, side, path.span);
        }
        if let Some((part, index)) = rest.iter().find_map(|p| Some((p, p.indices.first()?))) {
            self.faults.push(no_indices(&part.name, index.span));
            return Ends::one(At::Broken, path.span);
        }
        if let (Node::Family(family), false) = (node, self.is_wide(node)) {
            let part = &path.parts[used - 1];
            if let Err(fault) = self.names.node_families.get(family, &part.name, &[]) {
                self.faults.push(*fault);
            }
            return Ends::one(At::Broken, path.span);
        }
        let at = match (node, rest) {
            (Node::Part(_) | Node::Port(..) | Node::Instance(_) | Node::Joint(_) | Node::Family(_), []) => {
                return self.whole_node(here, node, path.span, pointed_at);
            }
            (Node::Part(part), [port]) => self.named_port(part, &port.name),
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
        };
        Ends::one(at, path.span)
    }

    /// Whether several nodes of one name stand side by side at the end of a bond.
    fn is_wide(&self, node: Node) -> bool {
        let Node::Family(family) = node else { return false };
        let family = &self.names.node_families[family];
        let bond = |node: &Node| matches!(node, Node::Part(_) | Node::Port(..) | Node::Joint(_));
        family.row().is_some() && family.first().is_some_and(|(node, _)| bond(node))
    }

    /// `axis.in`, `axis.out[2]`: the bonds at one side of a wide two-port, or one of them.
    fn named_side(&mut self, here: Here, part: usize, side: &'a ast::PathPart, span: Span) -> Ends {
        let mut ports = self.parts[part].side(side.name.text == "in");
        let Some(index) = side.indices.first() else {
            let ends = ports.map(|port| End { at: At::Part(part, Some(port)), span }).collect();
            return Ends { ends, wide: true, span, frame: None };
        };
        let Some(at) = self.index(here, index) else { return Ends::one(At::Broken, span) };
        let count = ports.len();
        let port = usize::try_from(at - 1).ok().and_then(|at| ports.nth(at));
        if port.is_none() {
            let title = format!("there is no `{}[{at}]`", side.name.text);
            let d = Diagnostic::error(codes::N021, title, index.span, "no such bond");
            self.faults.push(d.note(format!("there are {count}")));
        }
        Ends::one(port.map_or(At::Broken, |port| At::Part(part, Some(port))), span)
    }

    /// The port of an element by its name.
    fn named_port(&mut self, part: usize, port: &ast::Name) -> At {
        let p = &self.parts[part];
        let list: Vec<&str> = match p.word.is_two_port() {
            true => vec!["in", "out"],
            false if matches!(p.width, Width::Field(_)) => Vec::new(),
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
