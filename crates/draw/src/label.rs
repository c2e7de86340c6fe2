//! Where the texts of glyphs stand, and places where those of others may stand.

use crate::figure::{Form, Glyph, KIND, LAW, LEADING, NUMBER};
use crate::geometry::{Area, Point, add};
use crate::layout::Side;
use crate::route::Route;
use crate::text::width;

/// A line of text by its base line.
pub struct Placed {
    /// Start, middle or end of the base line, as `anchor` says.
    pub at: Point,
    /// As in SVG: `start`, `middle`, `end`.
    pub anchor: &'static str,
}

/// Whether the text of a one-port runs to the left of its sign.
pub fn to_left(facing: Side, mirrored: bool) -> bool {
    facing == Side::East || mirrored
}

/// Where `Kind : name` stands.
pub fn main_line(glyph: &Glyph, at: Point, facing: Side, mirrored: bool) -> Placed {
    let y = at[1] + 0.36 * KIND;
    let half = glyph.sign_width() / 2.0;
    match glyph.form {
        Form::Field => Placed { at: [at[0], y - glyph.law.len() as f64 * LEADING / 2.0], anchor: "middle" },
        _ if to_left(facing, mirrored) => Placed { at: [at[0] + half, y], anchor: "end" },
        _ => Placed { at: [at[0] - half, y], anchor: "start" },
    }
}

/// Where the lines of the law of a field or one-port stand.
pub fn law_lines(glyph: &Glyph, at: Point, facing: Side, mirrored: bool) -> Vec<Placed> {
    let main = main_line(glyph, at, facing, mirrored);
    let count = glyph.law.len() as f64;
    let place = |i: usize| {
        let below = main.at[1] + LEADING * (i as f64 + 1.0);
        let above = main.at[1] - 3.0 - LEADING * (count - i as f64);
        match (glyph.form, main.anchor) {
            (Form::Field, anchor) => Placed { at: [at[0], below], anchor },
            (_, anchor) => {
                let indent = if anchor == "end" { -glyph.law_indent(facing) } else { glyph.law_indent(facing) };
                Placed { at: [main.at[0] + indent, if facing == Side::South { above } else { below }], anchor }
            }
        }
    };
    (0..glyph.law.len()).map(place).collect()
}

/// The room that a small line of text takes.
pub fn small_area(text: &str, placed: &Placed) -> Area {
    let wide = width(text, LAW, false);
    let centre = match placed.anchor {
        "start" => placed.at[0] + wide / 2.0,
        "end" => placed.at[0] - wide / 2.0,
        _ => placed.at[0],
    };
    Area::around([centre, placed.at[1] - 4.0], [wide, LEADING - 1.0])
}

/// The room of all that a glyph says beside its sign; that of two-ports and junctions is found later.
pub fn text_areas(glyph: &Glyph, at: Point, facing: Side, mirrored: bool) -> Vec<Area> {
    if !matches!(glyph.form, Form::OnePort | Form::Source) {
        return Vec::new();
    }
    let half = glyph.sign_width() / 2.0;
    let out = if to_left(facing, mirrored) { -1.0 } else { 1.0 };
    let text = glyph.name_width();
    let name = Area::around([at[0] + out * (half + text / 2.0), at[1]], [text, 16.0]);
    let laws = law_lines(glyph, at, facing, mirrored);
    let laws = glyph.law.iter().zip(&laws).map(|(line, placed)| small_area(line, placed));
    (text > 0.0).then_some(name).into_iter().chain(laws).collect()
}

/// Places for the text of a two-port, best first: above or to the right, then around it.
pub fn beside_two_port(at: Point, core: Point, size: Point, facing: Side) -> Vec<Point> {
    let [x, y] = [core[0] + size[0] / 2.0, core[1] + size[1] / 2.0];
    let mut straight = [[0.0, -y], [0.0, y], [x, 0.0], [-x, 0.0]];
    if matches!(facing, Side::North | Side::South) {
        straight.rotate_left(2);
    }
    let corners = [[x - 4.0, -y], [x - 4.0, y], [4.0 - x, -y], [4.0 - x, y]];
    let near = straight.iter().chain(&corners).map(|s| [at[0] + s[0], at[1] + s[1]]);
    near.chain(around(at, core, size)).collect()
}

/// Places for a junction's name, best first: the four corners, then further out.
pub fn corners(at: Point, core: Point, size: Point) -> Vec<Point> {
    let corner = |far: f64| {
        let x = core[0] - 2.0 + size[0] / 2.0;
        let y = core[1] - 1.0 + size[1] / 2.0 - 2.0 + far;
        [[1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]].map(|s| [at[0] + s[0] * x, at[1] + s[1] * y])
    };
    let straight = [[at[0], at[1] - core[1] - 6.0], [at[0], at[1] + core[1] + 6.0]];
    [corner(0.0).to_vec(), corner(5.0).to_vec(), straight.to_vec(), around(at, core, size)].concat()
}

/// Places on a rectangle around a sign, near ones first, then on wider ones.
fn around(at: Point, core: Point, size: Point) -> Vec<Point> {
    let mut places = Vec::new();
    for far in [2.0, 8.0, 14.0, 22.0] {
        let [x, y] = [core[0] + size[0] / 2.0 + far, core[1] + size[1] / 2.0 + far];
        for part in [0.0, 0.25, 0.5, 0.75, 1.0] {
            let level = [[part * x, -y], [part * x, y], [-part * x, -y], [-part * x, y]];
            let upright = [[x, -part * y], [x, part * y], [-x, -part * y], [-x, part * y]];
            places.extend(level.into_iter().chain(upright).map(|s| [at[0] + s[0], at[1] + s[1]]));
        }
    }
    places
}

/// Places for a small text beside a bond, the first of these fractions of the way first; `bands` is what lies beside the
/// bond to the left and right of it already, in px.
pub fn beside_bond(route: &Route, ways: [f64; 2], bands: [f64; 2], size: Point) -> Vec<Point> {
    let hand = route.flow_hand();
    let mut places = Vec::new();
    for off in [0.0, 5.0, 11.0] {
        for t in [ways[0], ways[1], 1.0 - ways[1], 0.5, 0.42, 0.58, 0.28, 0.72, 0.2, 0.8] {
            let (p, d) = route.at(t);
            let left = [d[1], -d[0]];
            let half = (left[0] * size[0]).abs() / 2.0 + (left[1] * size[1]).abs() / 2.0;
            // First where no half arrow is.
            for side in [hand, -hand] {
                let band = if side > 0.0 { bands[0] } else { bands[1] };
                places.push(add(p, side * (3.0 + off + band + half), left));
            }
        }
    }
    places
}

/// Size of a bond's number or a port's name.
pub fn number_size(text: &str) -> Point {
    [width(text, NUMBER, false) + 1.5, NUMBER]
}
