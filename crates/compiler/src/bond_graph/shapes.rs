//! What a picture of the machine shows: `shape`.

use std::collections::BTreeMap;

use super::Named;
use super::builder::{Builder, NamedDraft, Value};
use super::dimension::Quantity;
use super::families::spelled;
use super::files::beside;
use super::flatten::Pictured;
use super::value::Reading;
use super::vectors::Shaped;
use crate::ast;
use crate::diagnostic::{Diagnostic, codes, nearest};
use crate::span::Span;
use crate::unit::Dimension as Dim;

/// Something that a picture of the machine shows, placed by signals.
#[derive(Debug, Clone)]
pub struct Shape {
    /// Its full name, such as `hull.box`.
    pub name: String,
    /// What it is.
    pub kind: ShapeKind,
    /// The file of a [`Mesh`](ShapeKind::Mesh), seen from where the model's text is.
    pub file: Option<String>,
    /// What is given of it, each once: numbers, or the entries of vectors and matrices row by row.
    pub arguments: Vec<(ShapeArgument, Vec<Named>)>,
    /// Where it stands.
    pub span: Span,
}

impl Shape {
    /// What is given for an argument; nothing where it is left out.
    pub fn given(&self, argument: ShapeArgument) -> Option<&[Named]> {
        self.arguments.iter().find(|(a, _)| *a == argument).map(|(_, values)| values.as_slice())
    }

    /// All that is given of it.
    pub fn values(&self) -> impl Iterator<Item = &Named> {
        self.arguments.iter().flat_map(|(_, values)| values)
    }

    pub(super) fn values_mut(&mut self) -> impl Iterator<Item = &mut Named> {
        self.arguments.iter_mut().flat_map(|(_, values)| values)
    }
}

/// What a shape is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum ShapeKind {
    /// The three axes of a frame.
    Axes,
    /// A box; of given sides, or of a mass and an inertia.
    Box,
    /// A cylinder or tube about an axis; of given size, or of a mass and an inertia.
    Cylinder,
    /// A grid of lines across z, as the ground.
    Grid,
    /// A surface of triangles from a file (STL).
    Mesh,
    /// Nothing: what is drawn by another name goes.
    Nothing,
    /// A rod between two points.
    Rod,
    /// A sphere.
    Sphere,
    /// A coil between two points.
    Spring,
}

/// What is given of a shape.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum ShapeArgument {
    /// `r`: its place in the world, in m; in a plane, two numbers.
    Place,
    /// `R`: a matrix that turns its axes into those of the world; in a plane, an angle about z.
    Turn,
    /// `from`: where a rod begins, in m.
    From,
    /// `to`: where it ends, in m.
    To,
    /// `c`: its middle, seen from its place along its axes, in m.
    Centre,
    /// `axis`: along its axes, of any length.
    Axis,
    /// `size`: its sides, in m.
    Size,
    /// `radius`: in m.
    Radius,
    /// `inner`: radius of the hole, in m.
    Inner,
    /// `length`: in m.
    Length,
    /// `m`: mass, in kg.
    Mass,
    /// `J`: inertia about the middle, in kg.m2; a matrix, or a number about the axis.
    Inertia,
    /// `spin`: how fast it turns about its axis, in rad/s, beside what its axes do.
    Spin,
    /// `scale`: metres for a unit of the file.
    Scale,
    /// `color`: red, green, blue from 0 to 1.
    Color,
    /// `up`: what the picture has upward.
    Up,
}

use ShapeArgument::{
    Axis, Centre, Color, From, Inertia, Inner, Length, Mass, Place, Radius, Scale, Size, Spin, To, Turn, Up,
};

impl ShapeKind {
    const ALL: [ShapeKind; 9] = [
        ShapeKind::Axes,
        ShapeKind::Box,
        ShapeKind::Cylinder,
        ShapeKind::Grid,
        ShapeKind::Mesh,
        ShapeKind::Nothing,
        ShapeKind::Rod,
        ShapeKind::Sphere,
        ShapeKind::Spring,
    ];

    /// Its word in the language.
    pub fn word(self) -> &'static str {
        match self {
            ShapeKind::Axes => "axes",
            ShapeKind::Box => "box",
            ShapeKind::Cylinder => "cylinder",
            ShapeKind::Grid => "grid",
            ShapeKind::Mesh => "mesh",
            ShapeKind::Nothing => "nothing",
            ShapeKind::Rod => "rod",
            ShapeKind::Sphere => "sphere",
            ShapeKind::Spring => "spring",
        }
    }

    /// What it needs to be given, and what it takes beside that.
    fn takes(self) -> (&'static [ShapeArgument], &'static [ShapeArgument]) {
        match self {
            ShapeKind::Axes => (&[Place, Turn], &[Length]),
            ShapeKind::Box => (&[Place, Turn], &[Size, Mass, Inertia, Centre, Color]),
            ShapeKind::Cylinder => (&[Place, Turn], &[Axis, Radius, Inner, Length, Mass, Inertia, Centre, Spin, Color]),
            ShapeKind::Grid => (&[], &[Place, Turn, Up]),
            ShapeKind::Mesh => (&[Place, Turn], &[Scale, Centre, Color]),
            ShapeKind::Nothing => (&[], &[]),
            ShapeKind::Rod | ShapeKind::Spring => (&[From, To], &[Radius, Color]),
            ShapeKind::Sphere => (&[Place], &[Turn, Radius, Centre, Color]),
        }
    }
}

impl ShapeArgument {
    /// Its word in the language.
    pub fn word(self) -> &'static str {
        match self {
            Place => "r",
            Turn => "R",
            From => "from",
            To => "to",
            Centre => "c",
            Axis => "axis",
            Size => "size",
            Radius => "radius",
            Inner => "inner",
            Length => "length",
            Mass => "m",
            Inertia => "J",
            Spin => "spin",
            Scale => "scale",
            Color => "color",
            Up => "up",
        }
    }

    /// Whether it may have these extents, and what it has to be in words.
    fn fits(self, extents: &[usize]) -> Result<(), &'static str> {
        let (fine, words) = match self {
            Place | From | To | Centre => (matches!(extents, [2 | 3]), "a vector of 3, in a plane of 2"),
            Turn => (matches!(extents, [] | [3, 3]), "a matrix of 3 by 3, in a plane an angle"),
            Inertia => (matches!(extents, [] | [3, 3]), "a matrix of 3 by 3, or a number about the axis"),
            Axis | Size | Up => (matches!(extents, [3]), "a vector of 3"),
            Color => (matches!(extents, [3]), "a vector of 3: red, green and blue from 0 to 1"),
            Radius | Inner | Length | Mass | Spin | Scale => (extents.is_empty(), "a number"),
        };
        if fine { Ok(()) } else { Err(words) }
    }

    /// Its dimension, where it has one.
    fn dimension(self) -> Option<Dim> {
        match self {
            Place | From | To | Centre | Size | Radius | Inner | Length => Some(Dim::of(1, 0, 0, 0)),
            Mass => Some(Dim::of(0, 1, 0, 0)),
            Inertia => Some(Dim::of(2, 1, 0, 0)),
            Spin => Some(Dim::of(0, 0, -1, 0)),
            Turn | Axis | Scale | Color | Up => None,
        }
    }
}

/// A shape whose values have been read.
pub(super) struct ShapeDraft {
    name: String,
    kind: ShapeKind,
    file: Option<String>,
    arguments: Vec<(ShapeArgument, Vec<NamedDraft>)>,
    span: Span,
}

impl ShapeDraft {
    fn has(&self, argument: ShapeArgument) -> bool {
        self.arguments.iter().any(|(known, _)| *known == argument)
    }

    /// What it cannot do without and is not given.
    fn lacks(&self) -> Option<String> {
        let (needed, _) = self.kind.takes();
        if let Some(argument) = needed.iter().find(|a| !self.has(**a)) {
            return Some(format!("`{}`", argument.word()));
        }
        match self.kind {
            ShapeKind::Mesh if self.file.is_none() => Some("its file".to_string()),
            ShapeKind::Box if !(self.has(Size) || self.has(Mass) && self.has(Inertia)) => {
                Some("`size`, or `m` and `J`".to_string())
            }
            _ => None,
        }
    }
}

impl<'a> Builder<'a, '_> {
    /// All `shape` statements. One that has the name of an instance stands in the place of those within it.
    pub fn shapes(&mut self) -> Vec<ShapeDraft> {
        let flat = self.flat;
        let mut first: BTreeMap<&str, Span> = BTreeMap::new();
        let mut shapes = Vec::new();
        for written in &flat.shapes {
            if let Some(&before) = first.get(written.name.as_str()) {
                let title = format!("the shape `{}` is declared twice", written.name);
                let fault = Diagnostic::error(codes::N002, title, written.ast.name.span, "declared again");
                self.fault(fault.also(before, "declared first").hint("give one of them another name"));
                continue;
            }
            first.insert(&written.name, written.ast.name.span);
            let before = self.faults.len();
            let shape = self.shape(written);
            self.met_in(written.here, before);
            shapes.extend(shape);
        }
        let replaced = |name: &str| name.match_indices('.').any(|(at, _)| first.contains_key(&name[..at]));
        shapes.retain(|shape| !replaced(&shape.name));
        shapes
    }

    fn shape(&mut self, written: &Pictured<'a>) -> Option<ShapeDraft> {
        let ast = written.ast;
        let kind = self.kind_of_shape(&ast.kind)?;
        let cx = Reading::of(written.here, &written.name);
        let mut shape =
            ShapeDraft { name: written.name.clone(), kind, file: None, arguments: Vec::new(), span: ast.span };
        for arg in &ast.args {
            match &arg.label {
                None => shape.file = Some(self.file_of_shape(&cx, kind, arg, shape.file.is_some())?),
                Some(label) => {
                    let argument = self.argument_of_shape(&shape, label)?;
                    shape.arguments.push((argument, self.shape_value(&cx, argument, &arg.value)?));
                }
            }
        }
        if let Some(lacks) = shape.lacks() {
            let title = format!("the shape `{}` needs {lacks}", written.name);
            let fault = Diagnostic::error(codes::N009, title, ast.span, "not given here");
            let example = "shape box:hull(r = car.r, R = car.R, size = [4, 1.6, 1])";
            self.fault(fault.hint(format!("places come from the signals of frames: `{example}`")));
            return None;
        }
        Some(shape)
    }

    /// The argument that a label names, if the shape takes it and has it not yet; says so if not.
    fn argument_of_shape(&mut self, shape: &ShapeDraft, label: &ast::ArgLabel) -> Option<ShapeArgument> {
        let (needed, more) = shape.kind.takes();
        let known = || needed.iter().chain(more).copied();
        let Some(argument) = known().find(|a| a.word() == label.name.text && label.port.is_none()) else {
            let title = format!("the shape `{}` takes no `{}`", shape.kind.word(), label.name.text);
            let words: Vec<&str> = known().map(ShapeArgument::word).collect();
            let fault = Diagnostic::error(codes::N008, title, label.span, "not known");
            self.fault(fault.hint(format!("it takes: {}", words.join(", "))));
            return None;
        };
        if shape.has(argument) {
            let title = format!("`{}` is given twice", argument.word());
            self.fault(Diagnostic::error(codes::N002, title, label.span, "again").hint("keep one of them"));
            return None;
        }
        Some(argument)
    }

    fn kind_of_shape(&mut self, word: &ast::Name) -> Option<ShapeKind> {
        let found = ShapeKind::ALL.into_iter().find(|kind| kind.word() == word.text);
        if found.is_none() {
            let words = ShapeKind::ALL.map(ShapeKind::word);
            let fault = Diagnostic::error(codes::N005, format!("there is no shape `{}`", word.text), word.span, "");
            self.fault(match nearest(&word.text, words) {
                Some(near) => fault.hint(format!("did you mean `{near}`?")),
                None => fault.hint(format!("shapes are: {}", words.join(", "))),
            });
        }
        found
    }

    fn file_of_shape(&mut self, cx: &Reading<'_>, kind: ShapeKind, arg: &'a ast::Arg, again: bool) -> Option<String> {
        if kind != ShapeKind::Mesh || again {
            let title = "an argument of a shape needs its name";
            let fault = Diagnostic::error(codes::N007, title, arg.span, "which one?");
            self.fault(fault.hint("write `name = …`; the file of a `mesh` alone goes without"));
            return None;
        }
        let (path, span) = self.file_named(cx, &arg.value, "shape mesh:hull(\"hull.stl\", r = car.r, R = car.R)")?;
        Some(beside(self.file_around(span), path))
    }

    fn shape_value(&mut self, cx: &Reading<'_>, argument: ShapeArgument, e: &'a ast::Expr) -> Option<Vec<NamedDraft>> {
        let found: Shaped = self.shaped(cx, e)?;
        if let Err(needed) = argument.fits(&found.shape) {
            let title = format!("`{}` of a shape is {needed}, not {}", argument.word(), found.words());
            self.fault(Diagnostic::error(codes::L009, title, e.span, found.words()));
            return None;
        }
        if let Some(dimension) = argument.dimension() {
            let own = Quantity::of(dimension);
            let what = "what is given and what a shape needs";
            found.items.iter().for_each(|value| self.equal(&value.quantity, &own, e.span, what));
        }
        let indices = found.indices();
        let named = |(value, at): (Value, &Vec<i64>)| NamedDraft {
            name: spelled(&format!("{}.{}", cx.owner, argument.word()), at),
            value: value.expr,
            unit: None,
            unit_is_written: false,
            quantity: value.quantity,
            doc: String::new(),
            place: (e.span, 0),
        };
        Some(found.items.into_iter().zip(&indices).map(named).collect())
    }

    /// The shape, with the units that follow from its values.
    pub fn whole_shape(&self, draft: ShapeDraft) -> Shape {
        let ShapeDraft { name, kind, file, arguments, span } = draft;
        let whole = |(argument, values): (ShapeArgument, Vec<NamedDraft>)| (argument, self.whole_named(values));
        Shape { name, kind, file, arguments: arguments.into_iter().map(whole).collect(), span }
    }
}
