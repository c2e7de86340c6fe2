//! Multibonds: several bonds side by side, and the elements and junctions that they end at.
//!
//! A wide junction, source or sensor is one element for each bond, called a strand; a wide `I`, `C`, `R` and a gyrator of
//! one port is one element with a port for each; a wide `TF` or `GY` is one with ports at both sides. Further on all bonds
//! are single ones.

use std::borrow::Cow;

use super::flatten::{Flat, Part, Word, full_name};
use super::scope::{Here, Node};
use crate::ast::{self, ExprKind};
use crate::diagnostic::{Diagnostic, codes};

/// The greatest number of bonds side by side.
const MAX_WIDTH: i64 = 1000;

/// How many bonds side by side end at an element.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Width {
    /// One, at each port.
    One,
    /// One of so many: the element is one of several, counted from 0.
    Strand(usize, usize),
    /// So many, at one element with a port for each.
    Field(usize),
    /// Of a two-port with a matrix: so many at `out`, its rows, and at `in`, its columns.
    Matrix {
        /// Bonds at `out`.
        rows: usize,
        /// Bonds at `in`.
        columns: usize,
    },
}

/// The name of a strand behind that of what it belongs to: `x`, `y`, `z` of up to three, else its number in brackets.
pub(crate) fn strand_name(at: usize, of: usize) -> String {
    match ["x", "y", "z"].get(at).filter(|_| of <= 3) {
        Some(letter) => (*letter).to_string(),
        None => format!("[{}]", at + 1),
    }
}

/// The strand that a letter stands for, counted from 0.
pub(super) fn strand_of(letter: &str) -> Option<usize> {
    ["x", "y", "z"].iter().position(|l| *l == letter)
}

/// The name of a part of something: `gap.el`, `twist[4]`.
pub(crate) fn part_name(of: &str, part: &str) -> String {
    match part.is_empty() || part.starts_with('[') {
        true => [of, part].concat(),
        false => [of, ".", part].concat(),
    }
}

impl Part<'_> {
    /// The name of a port, behind that of the element; empty where it has one only.
    pub fn port_name(&self, port: usize) -> String {
        let side = |name: &str, at, of| match of {
            1 => name.to_string(),
            of => part_name(name, &strand_name(at, of)),
        };
        match self.width {
            Width::Matrix { columns, .. } if port < columns => side("in", port, columns),
            Width::Matrix { rows, columns } => side("out", port - columns, rows),
            _ if self.word.is_two_port() => ["in", "out"][port].to_string(),
            _ => self.ports.get(port).map_or(String::new(), |n| n.text.clone()),
        }
    }

    /// The ports at the `in` or the `out` of a two-port.
    pub fn side(&self, inward: bool) -> std::ops::Range<usize> {
        match (self.width, inward) {
            (Width::Matrix { columns, .. }, true) => 0..columns,
            (Width::Matrix { rows, columns }, false) => columns..columns + rows,
            (_, true) => 0..1,
            (_, false) => 1..2,
        }
    }
}

impl<'a> Flat<'a> {
    /// Declares an element with a width behind its kind.
    pub fn wide_element(
        &mut self,
        here: Here,
        element: &'a ast::Element,
        word: Word,
        (indices, ports): (&[i64], &'a [ast::Name]),
        pseudo: bool,
    ) {
        if let ([ast::Expr { kind: ExprKind::Path(path), .. }], true) = (element.widths.as_slice(), word.is_junction())
            && let [one] = path.parts.as_slice()
            && let Some(&kind) = self.names.port_kinds.get(one.name.text.as_str())
        {
            return self.junction_of_kind(here, (element, indices), word, kind, pseudo);
        }
        let widths: Option<Vec<usize>> = element.widths.iter().map(|e| self.width(here, e)).collect();
        let Some(widths) = widths else { return };
        if let Some(port) = ports.first() {
            let title = format!("`{}` has its ports by its width", element.name.text);
            let fault = Diagnostic::error(codes::N007, title, port.span, "no list here");
            self.faults.push(fault.hint("leave the list out: the bonds are called x, y and z, or [1], [2], …"));
        }
        if !indices.is_empty() {
            let title = format!("`{}` has a width and indices", element.name.text);
            let fault = Diagnostic::error(codes::N021, title, element.name.span, "both");
            self.faults.push(fault.hint("put it into a component, of which there may be several with indices"));
            return;
        }
        let width = match (word, widths.as_slice()) {
            (Word::Tf, [n]) => Width::Matrix { rows: *n, columns: *n },
            (Word::Tf | Word::Gy, [rows, columns]) => Width::Matrix { rows: *rows, columns: *columns },
            (Word::I | Word::C | Word::R | Word::Gy, [n]) => Width::Field(*n),
            (_, [n]) => Width::Strand(0, *n),
            _ => {
                let title = format!("{} has one width", word.with_article());
                let fault = Diagnostic::error(codes::L009, title, element.span, "two are given");
                self.faults
                    .push(fault.hint("rows and columns belong to the matrix of a TF or GY: `TF[6, 1]:axis(m = S)`"));
                return;
            }
        };
        match width {
            Width::Strand(_, of) => self.strands(here, element, word, of, pseudo),
            Width::Field(of) => self.wide_field(here, element, word, of, pseudo),
            _ => {
                let node = Node::Part(self.parts.len());
                let name = full_name(&self.names.scopes[here.scope].prefix, &element.name.text, &[]);
                if self.place(here.scope, &element.name, &[], node) {
                    let ports = Cow::Borrowed(&[] as &[ast::Name]);
                    self.parts.push(Part { name, here, word, ports, width, ast: element, pseudo });
                }
            }
        }
    }

    /// An element for each of so many bonds.
    pub fn strands(&mut self, here: Here, element: &'a ast::Element, word: Word, of: usize, pseudo: bool) {
        self.strands_named(here, element, &element.name, word, of, pseudo);
    }

    /// The same under another name, in the junction of a kind of port.
    pub fn strands_named(
        &mut self,
        here: Here,
        element: &'a ast::Element,
        own: &'a ast::Name,
        word: Word,
        of: usize,
        pseudo: bool,
    ) {
        let whole = full_name(&self.names.scopes[here.scope].prefix, &own.text, &[]);
        for at in 0..of {
            let node = Node::Part(self.parts.len());
            if !self.place(here.scope, own, &[at as i64 + 1], node) {
                return;
            }
            let name = part_name(&whole, &strand_name(at, of));
            let (ports, width) = (Cow::Borrowed(&[] as &[ast::Name]), Width::Strand(at, of));
            self.parts.push(Part { name, here, word, ports, width, ast: element, pseudo });
        }
    }

    /// One element with a port for each of so many bonds.
    fn wide_field(&mut self, here: Here, element: &'a ast::Element, word: Word, of: usize, pseudo: bool) {
        let part = self.parts.len();
        for at in 0..of {
            if !self.place(here.scope, &element.name, &[at as i64 + 1], Node::Port(part, at)) {
                return;
            }
        }
        let name = full_name(&self.names.scopes[here.scope].prefix, &element.name.text, &[]);
        let port = |at| ast::Name { text: strand_name(at, of), span: element.name.span };
        let ports = Cow::Owned((0..of).map(port).collect());
        let word = if word == Word::Gy { Word::Skew } else { word };
        self.parts.push(Part { name, here, word, ports, width: Width::Field(of), ast: element, pseudo });
    }

    /// A number of bonds side by side.
    pub fn width(&mut self, here: Here, e: &'a ast::Expr) -> Option<usize> {
        let width = self.whole(here, e, "a width")?;
        if !(1..=MAX_WIDTH).contains(&width) {
            let title = format!("a width is a number from 1 to {MAX_WIDTH}");
            self.faults.push(Diagnostic::error(codes::N021, title, e.span, format!("this is {width}")));
            self.lost = true;
            return None;
        }
        Some(width as usize)
    }

    /// Components have the widths of their ports.
    pub fn refuse_width(&mut self, element: &ast::Element) {
        if let Some(width) = element.widths.first() {
            let title = format!("component `{}` has the width of its ports", element.kind.text);
            let fault = Diagnostic::error(codes::N007, title, width.span, "no width here");
            self.faults.push(fault.hint("leave it out; a width that may differ is a parameter of the component"));
        }
    }
}
