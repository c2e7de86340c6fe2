//! The scene: what is seen, and how it moves.

use std::collections::{BTreeMap, BTreeSet};

use halfarrow_compiler::bond_graph::{Named, Shape, ShapeArgument, ShapeKind};
use halfarrow_trace::Trace;
use serde::Serialize;

use super::frames::{Motions, thinned};
use super::mesh::Mesh;
use super::place::{about_z, continued, equivalent_box, equivalent_cylinder, quaternion};
use crate::error::Problem;
use crate::model::Model;

/// What is seen of a run. Lengths in m, times in s; numbers are rounded to single precision.
///
/// Invariant: every motion in the tables has one frame for each time, or a single one where nothing changes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Scene {
    /// Name of the model.
    pub model: String,
    /// What the picture has upward.
    pub up: [f32; 3],
    /// Whether everything moves in the plane of x and y.
    pub flat: bool,
    /// How large the machine is at the start, by which what has no size of its own is drawn.
    pub extent: f32,
    /// Times of the frames.
    pub times: Vec<f32>,
    /// How points move.
    pub points: Vec<Vec<[f32; 3]>>,
    /// How frames turn: quaternions `[w, x, y, z]` from their axes to those of the world.
    pub turns: Vec<Vec<[f32; 4]>>,
    /// How far what spins has turned, in rad.
    pub angles: Vec<Vec<[f32; 1]>>,
    /// Surfaces from files.
    pub meshes: Vec<Mesh>,
    /// What has a place and an orientation.
    pub bodies: Vec<Body>,
    /// What goes from point to point.
    pub links: Vec<Link>,
    /// What is recorded beside that, for plots; outputs first.
    pub curves: Vec<Curve>,
}

/// Something with a place and an orientation.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Body {
    /// The name of its shape.
    pub name: String,
    /// What it looks like.
    pub form: Form,
    /// Its place, in the table of points.
    pub place: usize,
    /// Its orientation, in the table of turns.
    pub turn: usize,
    /// Its middle, seen from its place along its axes.
    pub centre: [f32; 3],
    /// How it spins about its axis, in the table of angles.
    pub spin: Option<usize>,
    /// Red, green and blue from 0 to 1, if they are given.
    pub color: Option<[f32; 3]>,
    /// Whether its size is not given, but that of an even body of its mass and inertia.
    pub equivalent: bool,
}

/// What a body looks like.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum Form {
    /// The three axes of a frame.
    Axes {
        /// How long they are.
        length: f32,
    },
    /// A box.
    Box {
        /// Its sides.
        size: [f32; 3],
        /// How it is turned in its frame, a quaternion `[w, x, y, z]`.
        turned: [f32; 4],
    },
    /// A cylinder, or a tube.
    Cylinder {
        /// Its axis in its frame, of length 1.
        axis: [f32; 3],
        /// Radius.
        radius: f32,
        /// Radius of the hole, 0 if there is none.
        inner: f32,
        /// Length along the axis.
        length: f32,
    },
    /// A grid of lines across z, without an end.
    Grid,
    /// A surface.
    Mesh {
        /// Which, in the table of surfaces.
        mesh: usize,
    },
    /// A sphere.
    Sphere {
        /// Radius.
        radius: f32,
    },
}

/// Something that goes from point to point.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Link {
    /// The name of its shape.
    pub name: String,
    /// Whether it is a coil, not a rod.
    pub coil: bool,
    /// Where it begins, in the table of points.
    pub from: usize,
    /// Where it ends.
    pub to: usize,
    /// Radius of the rod or of the coil.
    pub radius: f32,
    /// Red, green and blue from 0 to 1, if they are given.
    pub color: Option<[f32; 3]>,
}

/// A recorded variable over the times of the frames.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Curve {
    /// Its name.
    pub name: String,
    /// Unit of the values, empty if none.
    pub unit: String,
    /// One value a frame; what is not finite is a gap.
    pub values: Vec<f32>,
}

/// Sizes of what has none of its own, in parts of the extent of the machine.
mod parts {
    pub const AXES: f64 = 0.06;
    pub const ROD: f64 = 0.0045;
    pub const COIL: f64 = 0.02;
    pub const PIN: [f64; 2] = [0.009, 0.04];
    pub const BALL: f64 = 0.012;
    pub const THIN: f64 = 0.01;
}
/// Length of a cylinder that has only a radius, in parts of it.
const LENGTH_OF_RADIUS: f64 = 0.4;

/// A trace with the shapes that it moves.
pub(super) struct Stage<'a> {
    model: &'a Model,
    trace: &'a Trace,
    columns: BTreeMap<&'a str, &'a [f64]>,
    /// The samples that are shown.
    rows: Vec<usize>,
    points: Motions<3>,
    turns: Motions<4>,
    angles: Motions<1>,
}

impl<'a> Stage<'a> {
    pub fn new(model: &'a Model, trace: &'a Trace) -> Result<Stage<'a>, Problem> {
        if trace.samples() == 0 {
            return Err(Problem::BadOption { reason: "there is nothing to show: the run recorded no sample".into() });
        }
        let columns = trace.columns.iter().map(|c| (c.name.as_str(), c.values.as_slice())).collect();
        let (points, turns, angles) = Default::default();
        Ok(Stage { model, trace, columns, rows: thinned(&trace.times), points, turns, angles })
    }

    /// The scene. Curves are of the columns that are not `pictured`.
    pub fn scene(mut self, pictured: &[String]) -> Result<Scene, Problem> {
        let model = self.model;
        let shapes = &model.graph.shapes;
        let meshes = shapes.iter().filter(|s| s.kind == ShapeKind::Mesh).map(|s| self.mesh(s));
        let meshes: Vec<Mesh> = meshes.collect::<Result<_, _>>()?;
        let extent = self.extent(&meshes)?;
        let (mut bodies, mut links, mut surfaces) = (Vec::new(), Vec::new(), 0..);
        for shape in shapes {
            match shape.kind {
                ShapeKind::Nothing => {}
                ShapeKind::Rod | ShapeKind::Spring => links.push(self.link(shape, extent)?),
                _ => bodies.push(self.body(shape, extent, &mut surfaces)?),
            }
        }
        let flat = self.points.all.iter().flatten().all(|p| p[2] == 0.0)
            && self.turns.all.iter().flatten().all(|q| q[1] == 0.0 && q[2] == 0.0);
        let up = self.up()?.unwrap_or(if flat { [0.0, 1.0, 0.0] } else { [0.0, 0.0, 1.0] });
        let pictured: BTreeSet<&str> = pictured.iter().map(String::as_str).collect();
        let outputs: BTreeSet<&str> = model.graph.outputs.iter().map(|o| o.name.as_str()).collect();
        let columns = self.trace.columns.iter().filter(|c| !pictured.contains(c.name.as_str()));
        let (first, rest): (Vec<_>, Vec<_>) = columns.partition(|c| outputs.contains(c.name.as_str()));
        let curve = |c: &halfarrow_trace::Column| Curve {
            name: c.name.clone(),
            unit: c.unit.clone(),
            values: self.rows.iter().map(|&row| c.values[row] as f32).collect(),
        };
        Ok(Scene {
            model: model.name().to_string(),
            up: up.map(|x| x as f32),
            flat,
            extent: extent as f32,
            times: self.rows.iter().map(|&row| self.trace.times[row] as f32).collect(),
            curves: first.into_iter().chain(rest).map(curve).collect(),
            points: self.points.all,
            turns: self.turns.all,
            angles: self.angles.all,
            meshes,
            bodies,
            links,
        })
    }

    /// All samples of a variable.
    fn samples(&self, named: &Named) -> Result<&'a [f64], Problem> {
        let missing = || Problem::Unavailable {
            name: named.name.clone(),
            reason: "the picture needs it, and the run did not record it".to_string(),
        };
        self.columns.get(named.name.as_str()).copied().ok_or_else(missing)
    }

    /// The values that an argument has at the start; nothing where it is left out.
    fn at_start(&self, shape: &Shape, argument: ShapeArgument) -> Result<Option<Vec<f64>>, Problem> {
        let Some(values) = shape.given(argument) else { return Ok(None) };
        values.iter().map(|named| Ok(self.samples(named)?[0])).collect::<Result<_, _>>().map(Some)
    }

    fn number(&self, shape: &Shape, argument: ShapeArgument) -> Result<Option<f64>, Problem> {
        Ok(self.at_start(shape, argument)?.map(|values| values[0]))
    }

    /// A vector at the start; one of a plane lies in it.
    fn vector(&self, shape: &Shape, argument: ShapeArgument) -> Result<Option<[f64; 3]>, Problem> {
        Ok(self.at_start(shape, argument)?.map(|values| in_space(&values)))
    }

    /// The values of an argument in every frame.
    fn frames(&self, shape: &Shape, argument: ShapeArgument) -> Result<Option<Vec<Vec<f64>>>, Problem> {
        let Some(values) = shape.given(argument) else { return Ok(None) };
        let columns: Vec<&[f64]> = values.iter().map(|named| self.samples(named)).collect::<Result<_, _>>()?;
        Ok(Some(self.rows.iter().map(|&row| columns.iter().map(|c| c[row]).collect()).collect()))
    }

    fn point(&mut self, shape: &Shape, argument: ShapeArgument) -> Result<usize, Problem> {
        let frames = self.frames(shape, argument)?.unwrap_or_else(|| vec![vec![0.0; 3]]);
        Ok(self.points.add(frames.iter().map(|p| in_space(p).map(|x| x as f32)).collect()))
    }

    fn turn(&mut self, shape: &Shape) -> Result<usize, Problem> {
        let frames = self.frames(shape, ShapeArgument::Turn)?.unwrap_or_else(|| vec![vec![0.0]]);
        let turn = |values: &Vec<f64>| match <&[f64; 9]>::try_from(values.as_slice()) {
            Ok(matrix) => quaternion(matrix),
            Err(_) => about_z(values[0]),
        };
        let turns = continued(frames.iter().map(turn).collect());
        Ok(self.turns.add(turns.into_iter().map(|q| q.map(|x| x as f32)).collect()))
    }

    /// The angle that a speed has come to in every frame, from all samples by the trapezoidal rule.
    fn spin(&mut self, shape: &Shape) -> Result<Option<usize>, Problem> {
        let Some([speed]) = shape.given(ShapeArgument::Spin) else { return Ok(None) };
        let (speed, times) = (self.samples(speed)?, &self.trace.times);
        let mut angle = vec![0.0; times.len()];
        for i in 1..times.len() {
            angle[i] = angle[i - 1] + (times[i] - times[i - 1]) * (speed[i - 1] + speed[i]) / 2.0;
        }
        Ok(Some(self.angles.add(self.rows.iter().map(|&row| [angle[row] as f32]).collect())))
    }

    fn color(&self, shape: &Shape) -> Result<Option<[f32; 3]>, Problem> {
        Ok(self.vector(shape, ShapeArgument::Color)?.map(|c| c.map(|x| x.clamp(0.0, 1.0) as f32)))
    }

    /// What the first ground that says so has upward.
    fn up(&self) -> Result<Option<[f64; 3]>, Problem> {
        for shape in &self.model.graph.shapes {
            if let Some(up) = self.vector(shape, ShapeArgument::Up)?.and_then(unit) {
                return Ok(Some(up));
            }
        }
        Ok(None)
    }

    /// The diagonal of what is seen at the start, grids left out; 1 if that has no size.
    fn extent(&self, meshes: &[Mesh]) -> Result<f64, Problem> {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        let mut surfaces = meshes.iter();
        for shape in self.model.graph.shapes.iter().filter(|s| s.kind != ShapeKind::Grid) {
            let around = self.reach(shape, &mut surfaces)?;
            for argument in [ShapeArgument::Place, ShapeArgument::From, ShapeArgument::To] {
                let Some(p) = self.vector(shape, argument)? else { continue };
                for i in 0..3 {
                    low[i] = low[i].min(p[i] - around);
                    high[i] = high[i].max(p[i] + around);
                }
            }
        }
        let diagonal = low.iter().zip(&high).map(|(l, h)| (h - l) * (h - l)).sum::<f64>().sqrt();
        Ok(if diagonal.is_finite() && diagonal > 0.0 { diagonal } else { 1.0 })
    }

    /// How far a shape reaches from its place by its own size.
    fn reach<'m>(&self, shape: &Shape, meshes: &mut impl Iterator<Item = &'m Mesh>) -> Result<f64, Problem> {
        let half_diagonal = |size: [f64; 3]| size.iter().map(|x| x * x).sum::<f64>().sqrt() / 2.0;
        let centre = self.vector(shape, ShapeArgument::Centre)?.map_or(0.0, |c| 2.0 * half_diagonal(c));
        let own = match shape.kind {
            ShapeKind::Box => half_diagonal(self.box_of(shape)?.0),
            ShapeKind::Cylinder => self.cylinder_of(shape)?.0.unwrap_or(0.0),
            ShapeKind::Sphere => self.number(shape, ShapeArgument::Radius)?.unwrap_or(0.0),
            ShapeKind::Mesh => meshes.next().map_or(0.0, Mesh::reach),
            _ => 0.0,
        };
        Ok(own + centre)
    }

    /// Sides and turn of a box, and whether they are those of its mass and inertia.
    fn box_of(&self, shape: &Shape) -> Result<([f64; 3], [f64; 4], bool), Problem> {
        let straight = [1.0, 0.0, 0.0, 0.0];
        if let Some(size) = self.vector(shape, ShapeArgument::Size)? {
            return Ok((size.map(f64::abs), straight, false));
        }
        let mass = self.number(shape, ShapeArgument::Mass)?.unwrap_or(0.0);
        let inertia = self.at_start(shape, ShapeArgument::Inertia)?.unwrap_or_default();
        let same = inertia.first().copied().unwrap_or(0.0);
        let inertia = <[f64; 9]>::try_from(inertia)
            .unwrap_or_else(|_| std::array::from_fn(|i| if i % 4 == 0 { same } else { 0.0 }));
        let (size, turned) = equivalent_box(mass, &inertia);
        Ok((size, turned, true))
    }

    /// Radius and length of a cylinder as far as they are known, and whether they are those of its mass and inertia.
    fn cylinder_of(&self, shape: &Shape) -> Result<(Option<f64>, Option<f64>, bool), Problem> {
        let length = self.number(shape, ShapeArgument::Length)?;
        if let Some(radius) = self.number(shape, ShapeArgument::Radius)? {
            return Ok((Some(radius), Some(length.unwrap_or(LENGTH_OF_RADIUS * radius)), false));
        }
        let (Some(mass), Some(inertia)) =
            (self.number(shape, ShapeArgument::Mass)?, self.at_start(shape, ShapeArgument::Inertia)?)
        else {
            return Ok((None, length, false));
        };
        let axis = self.axis(shape)?;
        let (about, across) = match <[f64; 9]>::try_from(inertia.as_slice()) {
            Ok(j) => {
                let about: f64 = (0..9).map(|i| axis[i / 3] * j[i] * axis[i % 3]).sum();
                (about, Some((j[0] + j[4] + j[8] - about) / 2.0))
            }
            Err(_) => (inertia[0], None),
        };
        let (radius, own) = equivalent_cylinder(mass, about, across);
        Ok((Some(radius), length.or(own), true))
    }

    fn axis(&self, shape: &Shape) -> Result<[f64; 3], Problem> {
        Ok(self.vector(shape, ShapeArgument::Axis)?.and_then(unit).unwrap_or([0.0, 0.0, 1.0]))
    }

    fn mesh(&self, shape: &Shape) -> Result<Mesh, Problem> {
        let scale = self.number(shape, ShapeArgument::Scale)?.unwrap_or(1.0);
        Ok(self.model.mesh(shape)?.scaled(scale))
    }

    fn body(
        &mut self,
        shape: &Shape,
        extent: f64,
        surfaces: &mut impl Iterator<Item = usize>,
    ) -> Result<Body, Problem> {
        let own_size = |x: f64| if x > 0.0 { x } else { parts::THIN * extent };
        let single = |x: f64| x as f32;
        let mut equivalent = false;
        let form = match shape.kind {
            ShapeKind::Box => {
                let (size, turned, of_mass) = self.box_of(shape)?;
                equivalent = of_mass;
                match size {
                    [0.0, 0.0, 0.0] => Form::Sphere { radius: single(parts::BALL * extent) },
                    size => Form::Box { size: size.map(own_size).map(single), turned: turned.map(single) },
                }
            }
            ShapeKind::Cylinder => {
                let (radius, length, of_mass) = self.cylinder_of(shape)?;
                equivalent = of_mass;
                let axis = self.axis(shape)?.map(single);
                let inner = single(self.number(shape, ShapeArgument::Inner)?.unwrap_or(0.0));
                let [thin, long] = parts::PIN;
                // What only tells its inertia about the axis is as a sheet.
                let length = length.unwrap_or(if radius.is_some() { 0.0 } else { long * extent });
                let (radius, length) = (own_size(radius.unwrap_or(thin * extent)), own_size(length));
                Form::Cylinder { axis, radius: single(radius), inner, length: single(length) }
            }
            ShapeKind::Sphere => {
                let radius = self.number(shape, ShapeArgument::Radius)?;
                Form::Sphere { radius: single(radius.unwrap_or(parts::BALL * extent)) }
            }
            ShapeKind::Mesh => Form::Mesh { mesh: surfaces.next().unwrap_or(0) },
            ShapeKind::Grid => Form::Grid,
            _ => {
                let length = self.number(shape, ShapeArgument::Length)?;
                Form::Axes { length: single(length.unwrap_or(parts::AXES * extent)) }
            }
        };
        Ok(Body {
            name: shape.name.clone(),
            form,
            place: self.point(shape, ShapeArgument::Place)?,
            turn: self.turn(shape)?,
            centre: self.vector(shape, ShapeArgument::Centre)?.unwrap_or([0.0; 3]).map(single),
            spin: self.spin(shape)?,
            color: self.color(shape)?,
            equivalent,
        })
    }

    fn link(&mut self, shape: &Shape, extent: f64) -> Result<Link, Problem> {
        let coil = shape.kind == ShapeKind::Spring;
        let radius = self.number(shape, ShapeArgument::Radius)?;
        let radius = radius.unwrap_or(extent * if coil { parts::COIL } else { parts::ROD });
        Ok(Link {
            name: shape.name.clone(),
            coil,
            from: self.point(shape, ShapeArgument::From)?,
            to: self.point(shape, ShapeArgument::To)?,
            radius: radius as f32,
            color: self.color(shape)?,
        })
    }
}

/// A vector of space; one of the plane of x and y lies in it.
fn in_space(values: &[f64]) -> [f64; 3] {
    std::array::from_fn(|i| values.get(i).copied().unwrap_or(0.0))
}

/// The vector of length 1 along another one; none along 0.
fn unit(v: [f64; 3]) -> Option<[f64; 3]> {
    let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    (length > 0.0 && length.is_finite()).then(|| v.map(|x| x / length))
}
