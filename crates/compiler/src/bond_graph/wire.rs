//! From drawn bonds to bonds between ports of elements: ports of components vanish, every port gets its bond.

use std::collections::BTreeSet;

use smallvec::{SmallVec, smallvec};

use super::faults::Faults;
use super::flatten::{At, End, Flat, Joint, Part, Word};
use super::multibonds::Width;
use super::scope::{Here, Names};
use crate::diagnostic::{Diagnostic, codes};
use crate::span::Span;

/// A bond between two ports of elements: pairs of part and port.
pub(super) struct Wire {
    /// Where it starts.
    pub from: (usize, usize),
    /// Where its half arrow points.
    pub to: (usize, usize),
    /// Its name, else empty.
    pub name: String,
    /// Whether it stands in a `domain … pseudo`.
    pub pseudo: bool,
    /// Where it is written.
    pub span: Span,
}

/// The bonds of a model.
#[derive(Default)]
pub(super) struct Wiring {
    /// The bonds, in the order written.
    pub wires: Vec<Wire>,
    /// The ports of every part, each with its bond and whether the half arrow points at the part. In the order of
    /// [`Element::ports`](super::Element::ports); a place is empty if the model is at fault there.
    pub ports: Vec<Vec<Option<(usize, bool)>>>,
    /// What every drawn bond has become.
    pub of_drawn: Vec<Option<usize>>,
    /// The bond at every port of an instance.
    pub of_joint: Vec<Option<usize>>,
    /// What is wrong with the drawing.
    pub faults: Faults,
    /// Whether a bond ends at nothing, which has been said.
    pub broken: bool,
    /// Parts with more bonds than fit.
    crowded_parts: Vec<usize>,
}

/// The drawn bonds that make one bond.
type Chain = SmallVec<[usize; 2]>;

/// A side of a joint: the drawn bond there, and whether the bond starts at the joint.
type Side = Option<(usize, bool)>;

/// The two sides of every joint.
#[derive(Default, Clone, Copy)]
struct Sides {
    outside: Side,
    inside: Side,
    /// Whether something is wrong with it that has been said.
    broken: bool,
}

/// Connects the drawn bonds of a model.
pub(super) fn wire(flat: &Flat<'_>) -> Wiring {
    let mut wiring = Wiring {
        wires: Vec::with_capacity(flat.drawn.len()),
        ports: flat.parts.iter().map(|p| vec![None; slots(p)]).collect(),
        of_drawn: vec![None; flat.drawn.len()],
        of_joint: vec![None; flat.joints.len()],
        ..Wiring::default()
    };
    let sides = wiring.sides(flat);
    let mut touched = vec![false; flat.parts.len()];
    let mut done = vec![false; flat.drawn.len()];
    for i in 0..flat.drawn.len() {
        if !done[i] {
            let before = wiring.faults.len();
            wiring.join(flat, &sides, i, &mut done, &mut touched);
            wiring.met_in(flat, flat.drawn[i].here, before);
        }
    }
    wiring.check_ports(flat, &touched);
    wiring
}

/// How many ports a part has before its bonds are known.
fn slots(part: &Part<'_>) -> usize {
    match part.word {
        w if w.is_junction() => 0,
        w if w.is_two_port() => part.side(true).len() + part.side(false).len(),
        _ => part.ports.len().max(1),
    }
}

/// The name of a port of a component, and what of it one of its strands is: `a` and `.v[2]`.
fn own_name(name: &str) -> (&str, &str) {
    name.split_at(name.find(['.', '[']).unwrap_or(name.len()))
}

impl Wiring {
    /// What is at both sides of every joint.
    fn sides(&mut self, flat: &Flat<'_>) -> Vec<Sides> {
        let mut sides = vec![Sides::default(); flat.joints.len()];
        // Where the strands of one port are crowded that is said once.
        let mut told: BTreeSet<(usize, Span)> = BTreeSet::new();
        for (i, drawn) in flat.drawn.iter().enumerate() {
            for (end, starts) in [(drawn.from, true), (drawn.to, false)] {
                let (joint, outside) = match end.at {
                    At::Outside(joint) => (joint, true),
                    At::Inside(joint) => (joint, false),
                    _ => continue,
                };
                let side = if outside { &mut sides[joint].outside } else { &mut sides[joint].inside };
                match *side {
                    None => *side = Some((i, starts)),
                    Some((first, _)) => {
                        sides[joint].broken = true;
                        if told.insert((flat.joints[joint].instance, end.span)) {
                            let before = self.faults.len();
                            self.crowded(flat, joint, end, flat.drawn[first].span, outside);
                            self.met_in(flat, drawn.here, before);
                        }
                    }
                }
            }
        }
        let port = |joint: usize| (flat.joints[joint].instance, own_name(&flat.joints[joint].name).0);
        let reached: BTreeSet<(usize, &str)> =
            (0..sides.len()).filter(|&joint| sides[joint].outside.is_some()).map(port).collect();
        let mut said: BTreeSet<(usize, &str)> = BTreeSet::new();
        for (joint, side) in sides.iter_mut().enumerate() {
            let before = self.faults.len();
            // Where no strand of a port is connected that is said once.
            let whole = !reached.contains(&port(joint));
            let is_free = side.inside.is_some() && !side.broken && !flat.joints[joint].open;
            if whole && is_free && !said.insert(port(joint)) {
                side.broken = true;
                continue;
            }
            self.check_joint(flat, joint, side, whole);
            self.met_in(flat, Here::of(flat.joints[joint].instance), before);
        }
        sides
    }

    /// Two bonds at one side of a port of a component.
    fn crowded(&mut self, flat: &Flat<'_>, joint: usize, end: End, first: Span, outside: bool) {
        let port = &flat.joints[joint];
        let (own, strand) = own_name(&port.name);
        let title = match outside {
            true => format!("two bonds at port `{}{own}` from outside", flat.names.scopes[port.instance].prefix),
            false => format!("two bonds at port `{own}` in the component"),
        };
        let hint = match strand.starts_with('.') {
            true => "join them with a junction as wide as the port, `1[frame]:hub` for a frame, and that with the port",
            false => "join them with a 0- or 1-junction, and the junction with the port",
        };
        self.fault(
            Diagnostic::error(codes::B002, title, end.span, "the second bond")
                .also(first, "the first bond")
                .note("a port takes one bond")
                .hint(hint),
        );
    }

    /// `whole`: nothing is connected with the port that it is a strand of.
    fn check_joint(&mut self, flat: &Flat<'_>, joint: usize, sides: &mut Sides, whole: bool) {
        let port = &flat.joints[joint];
        let Some((component, used)) = flat.names.scopes[port.instance].instance else { return };
        let name = &port.name;
        let instance = flat.names.scopes[port.instance].prefix.trim_end_matches('.');
        match (sides.outside, sides.inside) {
            _ if sides.broken => {}
            (Some((outer, out_starts)), Some((inner, in_starts))) if out_starts == in_starts => {
                sides.broken = true;
                let (way, remedy) = match in_starts {
                    false => ("out of", format!("write `{instance}.{name} -> …`")),
                    true => ("into", format!("write `… -> {instance}.{name}`")),
                };
                let title = format!("half arrows meet head on at port `{instance}.{name}`");
                self.fault(
                    Diagnostic::error(codes::B006, title, flat.drawn[outer].span, "drawn this way here")
                        .also(flat.drawn[inner].span, format!("in the component power flows {way} this port"))
                        .hint(remedy),
                );
            }
            (Some(_), Some(_)) => {}
            (None, None) if port.open => sides.broken = true,
            (_, None) => {
                sides.broken = true;
                let title = format!("port `{name}` of component `{}` leads nowhere", component.name.text);
                self.fault(
                    Diagnostic::error(codes::B005, title, port.span, "no bond in the component ends here")
                        .hint(format!("write `{name} -> …` or `… -> {name}` in the component")),
                );
            }
            (None, Some(_)) if port.open => {}
            (None, Some((_, in_starts))) => {
                sides.broken = true;
                let (own, strand) = own_name(name);
                let name = if whole { own } else { name };
                let own_strands = |j: &Joint| j.instance == port.instance && own_name(&j.name).0 == own;
                let free = match strand.chars().next() {
                    Some('.') => String::new(),
                    Some(_) if whole => {
                        let count = flat.joints.iter().filter(|j| own_strands(j)).count();
                        format!("; for a free end, join `Se[{count}]:free(0)` to it")
                    }
                    _ => "; for a free end, join `Se:free(0)` to it".into(),
                };
                let title = format!("port `{instance}.{name}` is not connected");
                self.fault(
                    Diagnostic::error(codes::B005, title, used, "no bond ends at this port")
                        .also(port.span, "declared here")
                        .hint(match in_starts {
                            true => format!("write `… -> {instance}.{name}`{free}"),
                            false => format!("write `{instance}.{name} -> …`{free}"),
                        }),
                );
            }
        }
    }

    /// Says of the faults since `before` in which turn of a repetition they were found.
    fn met_in(&mut self, flat: &Flat<'_>, here: Here, before: usize) {
        let turn = flat.names.turn_around(here);
        if turn != 0 {
            self.faults.in_turn(before, || flat.repeats.words(turn));
        }
    }

    /// Reports a fault once: instances of one component have the same faults inside.
    fn fault(&mut self, fault: Diagnostic) {
        if !self.faults.contains(&fault) {
            self.faults.push(fault);
        }
    }

    /// Joins the drawn bonds that meet at ports of components to one bond.
    fn join(&mut self, flat: &Flat<'_>, sides: &[Sides], i: usize, done: &mut [bool], touched: &mut [bool]) {
        let mut chain: Chain = smallvec![i];
        let from = follow(flat, sides, i, true, &mut chain);
        let to = follow(flat, sides, i, false, &mut chain);
        for &piece in &chain {
            done[piece] = true;
        }
        for end in [from, to].into_iter().flatten() {
            if let At::Part(part, _) = end.at {
                touched[part] = true;
            }
        }
        let (Some(from), Some(to)) = (from, to) else {
            return self.circle(flat, &chain, from.is_none() && to.is_none());
        };
        if from.at == At::Open || to.at == At::Open {
            return self.left_open(flat, from, to);
        }
        let (At::Part(a, from_port), At::Part(b, to_port)) = (from.at, to.at) else {
            self.broken = true;
            return;
        };
        if a == b {
            return self.self_bond(flat, a, flat.drawn[i].span);
        }
        let bond = self.wires.len();
        let a_port = self.attach(&flat.parts, a, from_port, bond, false, from.span, flat.drawn[i].span);
        let b_port = self.attach(&flat.parts, b, to_port, bond, true, to.span, flat.drawn[i].span);
        let (Some(a_port), Some(b_port)) = (a_port, b_port) else {
            // The place of this bond stays taken, so that what is said later fits the numbers that people see.
            self.wires.push(wire_of(flat, &chain, (a, a_port.unwrap_or(0)), (b, b_port.unwrap_or(0)), i));
            return;
        };
        for &piece in &chain {
            self.of_drawn[piece] = Some(bond);
            for end in [flat.drawn[piece].from, flat.drawn[piece].to] {
                if let At::Outside(joint) | At::Inside(joint) = end.at {
                    self.of_joint[joint] = Some(bond);
                }
            }
        }
        self.wires.push(wire_of(flat, &chain, (a, a_port), (b, b_port), i));
    }

    /// A bond to a port that is left open: at a junction it is not there.
    fn left_open(&mut self, flat: &Flat<'_>, from: End, to: End) {
        let end = if from.at == At::Open { to } else { from };
        if let At::Part(part, _) = end.at
            && !flat.parts[part].word.is_junction()
        {
            let title = format!("a port that may be left open leads to `{}`", flat.parts[part].name);
            let d = Diagnostic::error(codes::B005, title, end.span, "no junction");
            let d = d.note("where nothing is joined to it, the bond is left out");
            self.fault(d.hint("put a junction before the port"));
        }
    }

    fn circle(&mut self, flat: &Flat<'_>, chain: &[usize], closed: bool) {
        if closed {
            let span = flat.drawn[chain[0]].span;
            self.fault(
                Diagnostic::error(codes::B007, "this bond runs in a circle through ports", span, "it meets no element")
                    .hint("put an element between the ports"),
            );
        }
    }

    fn self_bond(&mut self, flat: &Flat<'_>, part: usize, span: Span) {
        let p = &flat.parts[part];
        self.fault(
            Diagnostic::error(
                codes::B007,
                format!("a bond joins `{}` to itself", p.name),
                span,
                "both ends are the same",
            )
            .hint("put an element or another junction between the two ends"),
        );
    }

    /// Gives a bond its place at a part: the index of the port there.
    #[allow(clippy::too_many_arguments)]
    fn attach(
        &mut self,
        parts: &[Part<'_>],
        part: usize,
        named: Option<usize>,
        bond: usize,
        inward: bool,
        end: Span,
        drawn: Span,
    ) -> Option<usize> {
        let p = &parts[part];
        if p.word.is_junction() {
            self.ports[part].push(Some((bond, inward)));
            return Some(self.ports[part].len() - 1);
        }
        let slot = match p.word {
            w if w.is_two_port() => match (p.width, named) {
                (Width::Matrix { .. }, Some(port)) if p.side(inward).contains(&port) => port,
                (_, named) => {
                    let named = named.map(|port| usize::from(!p.side(true).contains(&port)));
                    self.two_port_slot(p, named, inward, end)?
                }
            },
            _ => self.outer_slot(p, named, inward, end)?,
        };
        match self.ports[part][slot] {
            None => {
                self.ports[part][slot] = Some((bond, inward));
                Some(slot)
            }
            Some((first, _)) => {
                let first = self.wires.get(first).map_or(p.ast.span, |w| w.span);
                self.crowded_parts.push(part);
                self.fault(taken(p, slot, drawn, first));
                None
            }
        }
    }

    fn two_port_slot(&mut self, p: &Part<'_>, named: Option<usize>, inward: bool, end: Span) -> Option<usize> {
        let slot = usize::from(!inward);
        if named.is_some_and(|n| n != slot) {
            let (this, that) = if inward { ("out", "points at") } else { ("in", "leaves") };
            let title = format!("the half arrow {that} `{}.{this}`", p.name);
            self.fault(
                Diagnostic::error(codes::B003, title, end, "the wrong way round")
                    .note(format!("`in` of a {} is the bond that points at it, `out` the other", p.word.text()))
                    .hint(format!("write `… -> {0}.in` and `{0}.out -> …`", p.ast.name.text)),
            );
            return None;
        }
        Some(slot)
    }

    fn outer_slot(&mut self, p: &Part<'_>, named: Option<usize>, inward: bool, end: Span) -> Option<usize> {
        if p.word.is_law() && !inward {
            let name = &p.ast.name.text;
            self.fault(
                Diagnostic::error(
                    codes::B001,
                    format!("a half arrow points out of {} `{}`", p.word.text(), p.name),
                    end,
                    "out of it here",
                )
                .note("power is positive into I, C and R, so that energy and dissipation have the right sign")
                .hint(format!("turn the bond: `… -> {name}`")),
            );
            return None;
        }
        match (p.ports.len(), named) {
            (0 | 1, _) => Some(0),
            (_, Some(slot)) => Some(slot),
            (_, None) => {
                let list: Vec<&str> = p.ports.iter().map(|n| n.text.as_str()).collect();
                let name = &p.ast.name.text;
                self.fault(
                    Diagnostic::error(codes::B009, format!("which port of `{}`?", p.name), end, "it has several")
                        .note(format!("its ports are {}", list.join(", ")))
                        .hint(format!("declare it on a line of its own and write `{name}.{}` here", list[0])),
                );
                None
            }
        }
    }

    /// Says which ports have no bond.
    fn check_ports(&mut self, flat: &Flat<'_>, touched: &[bool]) {
        for (i, p) in flat.parts.iter().enumerate() {
            let found = self.ports[i].iter().flatten().count();
            if p.word.is_junction() && found > 0 || !p.word.is_junction() && found == self.ports[i].len() {
                continue;
            }
            let before = self.faults.len();
            if !touched[i] && found == 0 {
                self.fault(unconnected(p, &flat.names));
            } else if p.word.is_two_port() && p.width == Width::One && found == 1 && !self.crowded_parts.contains(&i) {
                self.fault(half_connected(p, self.ports[i][0].is_none()));
            } else if matches!(p.width, Width::Matrix { .. } | Width::Field(_)) && found > 0 {
                let of = self.ports[i].len();
                let empty = (0..of).filter(|&port| self.ports[i][port].is_none()).map(|port| p.port_name(port));
                let names: Vec<String> = empty.collect();
                let title = format!("{} of the {of} bonds of {} `{}` are missing", names.len(), p.word.text(), p.name);
                let d = Diagnostic::error(codes::B011, title, p.ast.span, format!("no bond at {}", names.join(", ")));
                self.fault(d.hint("join what is as wide, `v -> …`, or every strand of it"));
            } else if p.ports.len() > 1 && found > 0 {
                let ports = self.ports[i].clone();
                let empty = p.ports.iter().zip(&ports).enumerate().filter(|(_, (_, found))| found.is_none());
                let named_before = |i: usize, name: &str| p.ports[..i].iter().any(|port| port.text == name);
                for (_, (port, _)) in empty.filter(|(i, (port, _))| !named_before(*i, &port.text)) {
                    self.fault(
                        Diagnostic::error(
                            codes::B011,
                            format!("port `{}.{}` has no bond", p.name, port.text),
                            port.span,
                            "no bond ends here",
                        )
                        .hint(format!(
                            "write `… -> {}.{}`; a free port has a `Se` of 0 (or `Sf` of 0)",
                            p.ast.name.text, port.text
                        )),
                    );
                }
            }
            self.met_in(flat, p.here, before);
        }
    }
}

/// The bond that pieces make: it has the place of the first, and the first name among them.
fn wire_of(flat: &Flat<'_>, chain: &[usize], from: (usize, usize), to: (usize, usize), i: usize) -> Wire {
    let drawn = &flat.drawn[i];
    let pieces = || chain.iter().map(|&c| &flat.drawn[c]);
    let name = pieces().map(|d| d.name.as_str()).find(|n| !n.is_empty());
    Wire { from, to, name: name.unwrap_or("").to_string(), pseudo: pieces().any(|d| d.pseudo), span: drawn.span }
}

/// The end of a bond at an element, through the ports of components; `None` if it ends nowhere.
fn follow(flat: &Flat<'_>, sides: &[Sides], start: usize, backward: bool, chain: &mut Chain) -> Option<End> {
    let mut at = start;
    loop {
        let drawn = &flat.drawn[at];
        let end = if backward { drawn.from } else { drawn.to };
        let (joint, outside) = match end.at {
            At::Outside(joint) => (joint, true),
            At::Inside(joint) => (joint, false),
            _ => return Some(end),
        };
        let sides = &sides[joint];
        let next = if outside { sides.inside } else { sides.outside };
        match next {
            Some((next, _)) if !sides.broken && next != start => {
                chain.push(next);
                at = next;
            }
            Some((next, _)) if !sides.broken && next == start => return None,
            None if !sides.broken && !outside && flat.joints[joint].open => {
                return Some(End { at: At::Open, span: end.span });
            }
            _ => return Some(End { at: At::Broken, span: end.span }),
        }
    }
}

/// A second bond at a port that has one.
fn taken(p: &Part<'_>, slot: usize, drawn: Span, first: Span) -> Diagnostic {
    if p.word.is_two_port() {
        let (way, port, remedy) = match slot {
            0 => ("point at", "in", format!("turn one of them: `{} -> …`", p.ast.name.text)),
            _ => ("leave", "out", format!("turn one of them: `… -> {}`", p.ast.name.text)),
        };
        let title = format!("two half arrows {way} {} `{}`", p.word.text(), p.name);
        return Diagnostic::error(codes::B003, title, drawn, format!("the second bond at `{port}`"))
            .also(first, "the first")
            .note("one bond points at a TF or GY, one leaves it")
            .hint(remedy);
    }
    let port = p.ports.get(slot).map_or(String::new(), |n| format!(".{}", n.text));
    Diagnostic::error(
        codes::B002,
        format!("a second bond at {} `{}{port}`", p.word.text(), p.name),
        drawn,
        "the second bond",
    )
    .also(first, "the first bond")
    .note("this port takes one bond")
    .hint("join the bonds with a 0- or 1-junction, and the junction with the element")
}

fn unconnected(p: &Part<'_>, names: &Names<'_>) -> Diagnostic {
    let name = &p.ast.name.text;
    let what = if p.word.is_junction() { format!("{}-junction", p.word.text()) } else { p.word.text().to_string() };
    let around = if names.scopes[p.here.scope].instance.is_some() { " in the component" } else { "" };
    let remedy = match p.word {
        Word::Se | Word::Sf | Word::Zc | Word::ResidualSe | Word::ResidualSf => format!("write `{name} -> …`{around}"),
        w if w.is_two_port() => format!("write `… -> {name} -> …`{around}"),
        w if w.is_law() && p.ports.len() > 1 => {
            format!("write `… -> {name}.{}`{around}", p.ports[0].text)
        }
        _ => format!("write `… -> {name}`{around}"),
    };
    Diagnostic::error(codes::B004, format!("{what} `{}` has no bond", p.name), p.ast.span, "not connected")
        .hint(format!("{remedy}, or remove it"))
}

fn half_connected(p: &Part<'_>, no_in: bool) -> Diagnostic {
    let name = &p.ast.name.text;
    let (missing, remedy) = match no_in {
        true => ("no half arrow points at", format!("write `… -> {name}`")),
        false => ("no half arrow leaves", format!("write `{name} -> …`")),
    };
    Diagnostic::error(
        codes::B003,
        format!("{missing} {} `{}`", p.word.text(), p.name),
        p.ast.span,
        "one bond is missing",
    )
    .note("one bond points at a TF or GY, one leaves it")
    .hint(remedy)
}
