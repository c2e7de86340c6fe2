//! A bond graph reduced to what is drawn: glyphs, bonds and paths, as plain text and indices.

use crate::alike::alike;
use crate::layout::{Network, Node, Role, Room, Side};
use crate::symbol::Symbol;
use crate::text::width;

/// Font sizes in px.
pub const KIND: f64 = 16.0;
/// Of the names of elements.
pub const NAME: f64 = 12.5;
/// Of laws and of the names of junctions.
pub const LAW: f64 = 10.5;
/// Of numbers of bonds and names of ports.
pub const NUMBER: f64 = 9.0;
/// Height of a line of small text.
pub const LEADING: f64 = 13.0;

/// Room that the frame of a storage in derivative causality takes beside its sign.
pub const FRAME: f64 = 4.0;

/// What is drawn.
#[derive(Debug, Clone, Default)]
pub struct Figure {
    /// Name of the model.
    pub title: String,
    /// Its documentation.
    pub doc: String,
    /// Elements and junctions.
    pub glyphs: Vec<Glyph>,
    /// Bonds, numbered for people from 1.
    pub bonds: Vec<Line>,
    /// Causal paths to be drawn.
    pub loops: Vec<Loop>,
    /// Laws that are too long for their place, each with the mark that stands there.
    pub laws: Vec<String>,
    /// What is to be said about the paths that are not drawn, if any.
    pub note: String,
}

/// An element or junction.
#[derive(Debug, Clone)]
pub struct Glyph {
    /// Its keyword.
    pub kind: String,
    /// What is drawn in the place of the keyword, if anything is.
    pub symbol: Option<Symbol>,
    /// Its name.
    pub name: String,
    /// Its law or value in lines; may be empty.
    pub law: Vec<String>,
    /// What to show when pointed at.
    pub tip: String,
    /// How it is drawn.
    pub form: Form,
    /// Whether it is a storage in derivative causality.
    pub derivative: bool,
    /// Whether it is a junction whose variable no bond sets: it is independent, as if a source gave it.
    pub kept: bool,
}

/// How an element is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Form {
    /// `0`, `1`: a bare sign with a small name beside it.
    Junction,
    /// `TF`, `GY`: a sign with modulus and name above it.
    TwoPort,
    /// A field: a centred block of text.
    Field,
    /// A one-port: `Kind : name`, away from its junction.
    OnePort,
    /// A one-port that gives power.
    Source,
}

/// A bond.
#[derive(Debug, Clone)]
pub struct Line {
    /// Its number for people, from 1.
    pub number: usize,
    /// Indices of the glyphs, from and to (where the half arrow is).
    pub ends: [usize; 2],
    /// Names of the ports of fields, else empty.
    pub ports: [String; 2],
    /// The causal stroke: at end 0 (from) or 1 (to), `None` if undetermined.
    pub stroke: Option<usize>,
    /// Its name, may be empty.
    pub name: String,
    /// How many bonds side by side it stands for.
    pub width: usize,
    /// Whether these have their strokes at different ends.
    pub mixed: bool,
}

/// A causal path, as bonds in order.
#[derive(Debug, Clone)]
pub struct Loop {
    /// Its number among all paths, from 1.
    pub number: usize,
    /// 1 to 4.
    pub class: u8,
    /// Indices of the bonds in the order in which the path first meets them.
    pub bonds: Vec<usize>,
    /// Its line in the legend: elements and gains.
    pub text: String,
}

impl Figure {
    /// What the layout needs to know.
    pub fn network(&self) -> Network {
        Network {
            nodes: self.glyphs.iter().map(Glyph::node).collect(),
            bonds: self.bonds.iter().map(|b| b.ends).collect(),
            alike: alike(self),
        }
    }
}

impl Line {
    /// Its number, or those of all bonds that it stands for, with how many there are.
    pub fn label(&self) -> String {
        match self.width {
            1 => self.number.to_string(),
            width => format!("{} [{width}]", self.number),
        }
    }
}

impl Glyph {
    fn node(&self) -> Node {
        let role = match self.form {
            Form::Junction | Form::Field => Role::Centre,
            Form::TwoPort => Role::TwoPort,
            Form::Source => Role::Source,
            Form::OnePort => Role::OnePort,
        };
        let sides = [Side::East, Side::North, Side::West, Side::South];
        Node { role, room: sides.map(|s| self.room(s)) }
    }
    /// Half the width and height of the part that bonds end at.
    pub fn core(&self) -> [f64; 2] {
        match self.form {
            Form::Junction => [9.0, 11.0],
            Form::Field => {
                [self.main_width().max(self.law_width()) / 2.0 + 4.0, 10.0 + self.law.len() as f64 * LEADING / 2.0]
            }
            _ => [self.sign_width() / 2.0 + 4.0, 10.5],
        }
    }
    /// Width of the keyword, or of the symbol in its place.
    pub fn sign_width(&self) -> f64 {
        self.symbol.map_or_else(|| width(&self.kind, KIND, true), |_| Symbol::WIDTH)
    }
    /// Width of `Kind : name`.
    pub fn main_width(&self) -> f64 {
        self.sign_width() + self.name_width()
    }
    /// Width of ` : name`.
    pub fn name_width(&self) -> f64 {
        let frame = if self.derivative { FRAME } else { 0.0 };
        if self.name.is_empty() { 0.0 } else { frame + width(" : ", NAME, false) + width(&self.name, NAME, false) }
    }
    /// The small lines of a two-port: modulus, then name.
    pub fn small_lines(&self) -> Vec<&str> {
        self.law.iter().chain([&self.name]).map(String::as_str).filter(|l| !l.is_empty()).collect()
    }
    /// Width of the longest small line.
    pub fn small_width(&self) -> f64 {
        self.small_lines().iter().map(|l| width(l, LAW, false)).fold(0.0, f64::max)
    }
    /// Room around the anchor if the (first) neighbour is on this side.
    fn room(&self, neighbour: Side) -> Room {
        let [w, h] = self.core();
        let frame = if self.derivative { 3.0 } else { 0.0 };
        let even = Room { west: w + frame, east: w + frame, north: h + frame, south: h + frame };
        match self.form {
            Form::Junction => {
                let name = (width(&self.name, LAW, false) - 34.0).max(0.0);
                Room { east: even.east + name, ..even }
            }
            Form::Field => even,
            Form::TwoPort => self.two_port_room(even, neighbour),
            Form::OnePort | Form::Source => self.one_port_room(even, neighbour),
        }
    }
    fn two_port_room(&self, even: Room, neighbour: Side) -> Room {
        let lines = self.small_lines().len() as f64;
        let text = self.small_width();
        match neighbour {
            Side::East | Side::West => {
                let half = even.east.max(text / 2.0 + 2.0);
                Room { north: even.north + lines * LEADING, west: half, east: half, ..even }
            }
            Side::North | Side::South => Room { east: even.east + text + 2.0, ..even },
        }
    }
    /// Width of the longest line of the law.
    pub fn law_width(&self) -> f64 {
        self.law.iter().map(|l| width(l, LAW, false)).fold(0.0, f64::max)
    }
    /// Where the law of a one-port begins, from the edge of the sign where its name begins.
    pub fn law_indent(&self, neighbour: Side) -> f64 {
        let sign = self.sign_width();
        match neighbour {
            _ if self.name.is_empty() => sign / 2.0 + 4.0,
            Side::North | Side::South => sign / 2.0 + 8.0,
            Side::East | Side::West => sign + 6.0,
        }
    }
    fn one_port_room(&self, even: Room, neighbour: Side) -> Room {
        let law = self.law.len() as f64 * LEADING;
        let sign = self.sign_width();
        let long = self.law_indent(neighbour) + self.law_width();
        let text = if self.law.is_empty() { self.main_width() } else { long.max(self.main_width()) };
        let out = even.east.max(text - sign / 2.0 + 2.0);
        let below = Room { south: even.south + law, ..even };
        match neighbour {
            Side::East => Room { west: out, ..below },
            Side::West | Side::North => Room { east: out, ..below },
            Side::South => Room { east: out, north: even.north + law, ..even },
        }
    }
}
