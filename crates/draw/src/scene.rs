//! Where everything on the paper stands: glyphs, bonds, texts. Bonds run straight where nothing is in the way, else around
//! it; texts stand where it is free. Where that does not come out, everything gets more room.

use std::collections::BTreeMap;

use crate::figure::{Figure, Form, LAW, LEADING};
use crate::geometry::{Area, Point, add};
use crate::label::{beside_bond, beside_two_port, corners, number_size, text_areas};
use crate::layout::{Placement, Plan, place_beside};
use crate::overlay::{Lanes, lanes};
use crate::paper::Paper;
use crate::route::{Route, lead_around, straight};
use crate::text::width;

/// Factors on the room that bonds get, tried in turn.
const WIDER: [f64; 4] = [1.0, 1.3, 1.7, 2.3];
/// Graphs with more nodes are drawn at the first of these.
const LARGE: usize = 1500;

/// A figure with places.
#[derive(Debug, Clone)]
pub struct Scene {
    pub placed: Placement,
    pub routes: Vec<Route>,
    pub lanes: Lanes,
    /// Centres of the texts of two-ports, and of the names of junctions, by glyph.
    pub names: Vec<(usize, Point)>,
    /// Centres of numbers and port names, with what is written.
    pub numbers: Vec<(String, Point)>,
    /// Bonds through texts or signs, and texts on others.
    pub faults: usize,
}

/// Finds places for a figure. Glyphs whose places are known by their names stay there, as seen from each other.
pub fn scene(figure: &Figure, keep: &BTreeMap<String, Point>) -> Scene {
    let network = figure.network();
    let pinned: Vec<Option<Point>> = figure.glyphs.iter().map(|g| keep.get(&g.name).copied()).collect();
    if pinned.iter().any(Option::is_some) {
        return arrange(figure, place_beside(&network, &pinned));
    }
    let plan = Plan::new(&network);
    let tries = if figure.glyphs.len() > LARGE { 1 } else { WIDER.len() };
    let mut best: Option<Scene> = None;
    for wider in &WIDER[..tries] {
        let scene = arrange(figure, plan.placement(*wider));
        if best.as_ref().is_none_or(|b| scene.faults < b.faults) {
            best = Some(scene);
        }
        if best.as_ref().is_some_and(|b| b.faults == 0) {
            break;
        }
    }
    best.expect("one try at least")
}

impl Scene {
    /// The corners of all that is drawn.
    pub fn extent(&self, figure: &Figure) -> (Point, Point) {
        let (mut low, mut high) = (self.placed.corner, self.placed.corner);
        let mut take = |p: Point| {
            low = [low[0].min(p[0]), low[1].min(p[1])];
            high = [high[0].max(p[0]), high[1].max(p[1])];
        };
        take(add(self.placed.corner, 1.0, self.placed.size));
        self.routes.iter().flat_map(|r| &r.points).for_each(|&p| take(p));
        let names = self.names.iter().map(|&(v, c)| Area::around(c, name_size(figure, v)));
        let numbers = self.numbers.iter().map(|(text, c)| Area::around(*c, number_size(text)));
        names.chain(numbers).flat_map(|a| a.corners()).for_each(take);
        (low, high)
    }
    /// The same, moved.
    pub fn moved(mut self, by: Point) -> Scene {
        let shift = |p: &mut Point| *p = add(*p, 1.0, by);
        self.placed.anchors.iter_mut().for_each(shift);
        self.routes.iter_mut().flat_map(|r| &mut r.points).for_each(shift);
        self.names.iter_mut().for_each(|n| shift(&mut n.1));
        self.numbers.iter_mut().for_each(|n| shift(&mut n.1));
        self
    }
}

/// Bonds and texts for a placement.
fn arrange(figure: &Figure, placed: Placement) -> Scene {
    let lanes = lanes(figure);
    let mut paper = glyphs(figure, &placed);
    let mut routes = straight(figure, &placed);
    let meets =
        |paper: &Paper, route: &Route, i: usize| route.pieces().any(|[p, q]| paper.blocked(p, q, figure.bonds[i].ends));
    let (mut around, plain): (Vec<usize>, Vec<usize>) = (0..routes.len()).partition(|&i| meets(&paper, &routes[i], i));
    let mut with_lines = paper.clone();
    plain.iter().flat_map(|&i| routes[i].pieces()).for_each(|[p, q]| with_lines.add_line(p, q));
    let (names, _) = names(figure, &placed, &mut with_lines);
    // What a text could not keep off is led around it.
    names.iter().for_each(|&(v, c)| paper.add_box(Area::around(c, name_size(figure, v)), None));
    let plain: Vec<usize> = plain
        .into_iter()
        .filter(|&i| {
            let hit = meets(&paper, &routes[i], i);
            if hit {
                around.push(i);
            }
            !hit
        })
        .collect();
    plain.iter().flat_map(|&i| routes[i].pieces()).for_each(|[p, q]| paper.add_line(p, q));
    let mut faults = lead_around(figure, &placed, &mut routes, &mut paper, &around);
    faults += overlaps(figure, &placed, &names);
    marks(&routes, figure, &mut paper);
    let (numbers, crowded) = numbers(figure, &routes, &lanes, &mut paper);
    Scene { placed, routes, lanes, names, numbers, faults: faults + crowded }
}

/// The signs and texts whose places follow from those of the glyphs.
fn glyphs(figure: &Figure, placed: &Placement) -> Paper {
    let mut paper = Paper::default();
    for (v, glyph) in figure.glyphs.iter().enumerate() {
        let [w, h] = glyph.core();
        let at = placed.anchors[v];
        paper.add_box(Area::around(at, [2.0 * w - 2.0, 2.0 * h - 2.0]), Some(v));
        for area in text_areas(glyph, at, placed.facing[v], placed.mirrored[v]) {
            paper.add_box(area, None);
        }
    }
    paper
}

/// Room of the text of a two-port, or of the name of a junction.
pub fn name_size(figure: &Figure, v: usize) -> Point {
    let glyph = &figure.glyphs[v];
    match glyph.form {
        Form::TwoPort => [glyph.small_width() + 2.0, glyph.small_lines().len() as f64 * LEADING],
        _ => [width(&glyph.name, LAW, false) + 2.0, 11.0],
    }
}

/// Texts of two-ports, then names of junctions.
fn names(figure: &Figure, placed: &Placement, paper: &mut Paper) -> (Vec<(usize, Point)>, usize) {
    let of = |form: Form| figure.glyphs.iter().enumerate().filter(move |g| g.1.form == form);
    let two_ports = of(Form::TwoPort).filter(|g| !g.1.small_lines().is_empty());
    let junctions = of(Form::Junction).filter(|(_, g)| !g.name.is_empty() && g.name != g.kind);
    let mut crowded = 0;
    let mut settle = |v: usize| {
        let (glyph, at, size) = (&figure.glyphs[v], placed.anchors[v], name_size(figure, v));
        let places = match glyph.form {
            Form::TwoPort => beside_two_port(at, glyph.core(), size, placed.facing[v]),
            _ => corners(at, glyph.core(), size),
        };
        let (centre, how) = paper.settle(&places, size);
        crowded += usize::from(how > 0);
        (v, centre)
    };
    let names = two_ports.chain(junctions).map(|(v, _)| settle(v)).collect();
    (names, crowded)
}

/// How many texts of two-ports and junctions stand on another text or sign.
fn overlaps(figure: &Figure, placed: &Placement, names: &[(usize, Point)]) -> usize {
    let mut paper = glyphs(figure, placed);
    names
        .iter()
        .filter(|&&(v, centre)| {
            let area = Area::around(centre, name_size(figure, v));
            let met = paper.crowding(area) > 0;
            paper.add_box(area, None);
            met
        })
        .count()
}

/// Notes half arrows and strokes.
fn marks(routes: &[Route], figure: &Figure, paper: &mut Paper) {
    for (route, bond) in routes.iter().zip(&figure.bonds) {
        let [tip, barb] = route.barb();
        paper.add_line(tip, barb);
        if let Some(end) = bond.stroke {
            let [p, q] = route.stroke(end);
            paper.add_line(p, q);
        }
    }
}

/// Numbers of bonds and names of ports, beside the bonds.
fn numbers(figure: &Figure, routes: &[Route], lanes: &Lanes, paper: &mut Paper) -> (Vec<(String, Point)>, usize) {
    let mut found = Vec::new();
    let mut crowded = 0;
    for (i, (bond, route)) in figure.bonds.iter().zip(routes).enumerate() {
        let ports = bond.ports.iter().enumerate().filter(|p| !p.1.is_empty());
        let ports = ports.map(|(end, port)| (if end == 0 { [0.16, 0.3] } else { [0.84, 0.7] }, port.clone()));
        for (ways, text) in ports.chain([([0.5, 0.36], bond.label())]) {
            let size = number_size(&text);
            let (centre, how) = paper.settle(&beside_bond(route, ways, lanes.bands(i, route), size), size);
            crowded += usize::from(how > 0);
            found.push((text, centre));
        }
    }
    (found, crowded)
}
