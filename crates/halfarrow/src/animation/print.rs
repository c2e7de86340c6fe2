//! The scene as text, for people and tests.

use std::fmt::{self, Display, Formatter};

use super::{Body, Form, Link, Scene};

impl Display for Scene {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Scene { model, up, extent, times, .. } = self;
        let flat = if self.flat { ", in a plane" } else { "" };
        writeln!(f, "scene {model}: up {}, extent {}{flat}", list(up), short(*extent))?;
        writeln!(f, "times {}", list(times))?;
        for body in &self.bodies {
            self.body(f, body)?;
        }
        for link in &self.links {
            self.link(f, link)?;
        }
        for (word, motions) in [("point", frames(&self.points)), ("turn", frames(&self.turns))] {
            motions.iter().enumerate().try_for_each(|(i, text)| writeln!(f, "{word} {i}: {text}"))?;
        }
        frames(&self.angles).iter().enumerate().try_for_each(|(i, text)| writeln!(f, "angle {i}: {text}"))?;
        for curve in &self.curves {
            writeln!(f, "curve {} [{}]: {}", curve.name, curve.unit, list(&curve.values))?;
        }
        Ok(())
    }
}

impl Scene {
    fn body(&self, f: &mut Formatter<'_>, body: &Body) -> fmt::Result {
        let Body { name, form, place, turn, centre, spin, color, equivalent } = body;
        let form = match form {
            Form::Axes { length } => format!("axes {name}: length {}", short(*length)),
            Form::Box { size, turned: [1.0, 0.0, 0.0, 0.0] } => format!("box {name}: size {}", list(size)),
            Form::Box { size, turned } => format!("box {name}: size {}, turned {}", list(size), list(turned)),
            Form::Cylinder { axis, radius, inner, length } => {
                let hole = if *inner > 0.0 { format!(", inner {}", short(*inner)) } else { String::new() };
                let [radius, length] = [*radius, *length].map(short);
                format!("cylinder {name}: axis {}, radius {radius}{hole}, length {length}", list(axis))
            }
            Form::Grid => format!("grid {name}:"),
            Form::Mesh { mesh } => {
                format!("mesh {name}: {} triangles", self.meshes.get(*mesh).map_or(0, |m| m.corners.len() / 9))
            }
            Form::Sphere { radius } => format!("sphere {name}: radius {}", short(*radius)),
        };
        write!(f, "{form} at point {place}, turn {turn}")?;
        if *centre != [0.0; 3] {
            write!(f, ", centre {}", list(centre))?;
        }
        spin.iter().try_for_each(|spin| write!(f, ", angle {spin}"))?;
        color.iter().try_for_each(|color| write!(f, ", color {}", list(color)))?;
        writeln!(f, "{}", if *equivalent { " (of its mass and inertia)" } else { "" })
    }

    fn link(&self, f: &mut Formatter<'_>, link: &Link) -> fmt::Result {
        let Link { name, coil, from, to, radius, color } = link;
        let word = if *coil { "spring" } else { "rod" };
        write!(f, "{word} {name}: radius {} from point {from} to point {to}", short(*radius))?;
        color.iter().try_for_each(|color| write!(f, ", color {}", list(color)))?;
        writeln!(f)
    }
}

/// Each motion on a line.
fn frames<const N: usize>(motions: &[Vec<[f32; N]>]) -> Vec<String> {
    motions.iter().map(|motion| motion.iter().map(|x| list(x)).collect::<Vec<_>>().join("; ")).collect()
}

fn list(numbers: &[f32]) -> String {
    numbers.iter().map(|x| short(*x)).collect::<Vec<_>>().join(" ")
}

/// Five digits; what lies below rounding is 0.
fn short(x: f32) -> String {
    let x = if x.abs() < 1e-7 { 0.0 } else { x };
    format!("{x:.4e}").parse::<f32>().map_or_else(|_| x.to_string(), |x| x.to_string())
}
