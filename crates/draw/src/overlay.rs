//! Causal paths as coloured lines along their bonds.

use std::fmt::Write;

use crate::figure::Figure;
use crate::geometry::{Point, add, step};
use crate::layout::Placement;
use crate::route::Route;
use crate::svg::n;

/// Colours that people who see few colours can tell apart, after Okabe and Ito.
const COLOURS: [&str; 8] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7a3e9d", "#8c8c2b"];
/// Greatest distance between paths on one bond, and the room that all of them have beside each other.
const LANE: f64 = 5.0;
const ALL: f64 = 28.0;
/// Dashes of the paths that share a colour, in turn.
const DASHES: [&str; 4] = ["", "11 8", "1 8", "18 8 1 8"];

/// The colour and the dashes of a path by its number: no two of the first 32 look the same.
pub fn look(number: usize) -> (&'static str, &'static str) {
    let i = number.saturating_sub(1);
    (COLOURS[i % COLOURS.len()], DASHES[i / COLOURS.len() % DASHES.len()])
}

/// Paths beside each other.
#[derive(Debug, Clone)]
pub struct Lanes {
    /// The lane of every path, such that no two share a lane on a bond: 0, 1, -1, 2, …
    of: Vec<i32>,
    /// Least and greatest lane on every bond with a path.
    on: Vec<Option<[i32; 2]>>,
    /// Distance between lanes.
    gap: f64,
}

impl Lanes {
    /// Width of a path.
    pub fn width(&self) -> f64 {
        self.gap - 0.5
    }
    /// How far paths reach to the left and right of a bond.
    pub fn bands(&self, bond: usize, route: &Route) -> [f64; 2] {
        let Some([least, most]) = self.on[bond] else { return [0.0; 2] };
        let reach = |lanes: i32| f64::from(lanes) * self.gap + self.gap / 2.0;
        let bands = [reach(most), reach(-least)].map(|b| b.max(0.0));
        if route.flow_hand() > 0.0 { bands } else { [bands[1], bands[0]] }
    }
}

/// The lane of every path: away from the half arrows first.
pub fn lanes(figure: &Figure) -> Lanes {
    let mut taken: Vec<Vec<usize>> = vec![Vec::new(); figure.bonds.len()];
    let mut on: Vec<Option<[i32; 2]>> = vec![None; figure.bonds.len()];
    let mut of = Vec::new();
    for path in &figure.loops {
        let free = |lane: &usize| path.bonds.iter().all(|&b| !taken[b].contains(lane));
        let lane = (0..).find(free).expect("there are lanes without end");
        let away = lane.div_ceil(2) as i32;
        let signed = if lane % 2 == 1 { away } else { -away };
        for &b in &path.bonds {
            taken[b].push(lane);
            on[b] = Some(on[b].map_or([signed; 2], |[low, high]| [low.min(signed), high.max(signed)]));
        }
        of.push(signed);
    }
    let most = taken.iter().flatten().max().map_or(1, |lane| lane + 1);
    Lanes { of, on, gap: LANE.min((ALL / most as f64).max(2.5)) }
}

/// The line of a path, as SVG path data.
pub fn course(figure: &Figure, placed: &Placement, routes: &[Route], lanes: &Lanes, path: usize) -> String {
    let legs = legs(figure, &figure.loops[path].bonds);
    let aside = f64::from(lanes.of[path]) * lanes.gap;
    let beside = |leg: &Leg| {
        let mut points = routes[leg.bond].beside(aside * routes[leg.bond].flow_hand());
        if leg.nodes != figure.bonds[leg.bond].ends {
            points.reverse();
        }
        points
    };
    let first = |leg: &Leg| beside(leg)[0];
    let last = |leg: &Leg| beside(leg).pop().unwrap_or_default();
    let mut data = String::new();
    for (i, leg) in legs.iter().enumerate() {
        let points = beside(leg);
        match i.checked_sub(1).map(|j| &legs[j]) {
            Some(before) if before.nodes[1] == leg.nodes[0] => {
                curve(&mut data, last(before), placed.anchors[leg.nodes[0]], points[0]);
            }
            _ => _ = write!(data, "M{} {}", n(points[0][0]), n(points[0][1])),
        }
        points[1..].iter().for_each(|p| _ = write!(data, "L{} {}", n(p[0]), n(p[1])));
    }
    if let Some(end) = legs.last()
        && let Some(back) = legs.iter().find(|l| l.nodes[0] == end.nodes[1])
    {
        curve(&mut data, last(end), placed.anchors[end.nodes[1]], first(back));
    }
    data
}

/// A bond of a path, with its glyphs in the sense of the path.
struct Leg {
    bond: usize,
    nodes: [usize; 2],
}

/// The bonds of a path, each in its sense; where two do not follow each other the path is interrupted.
fn legs(figure: &Figure, bonds: &[usize]) -> Vec<Leg> {
    let ends = |i: usize| figure.bonds[bonds[i]].ends;
    let mut legs: Vec<Leg> = Vec::new();
    for (i, &bond) in bonds.iter().enumerate() {
        let [a, b] = ends(i);
        let entry = legs.last().map(|l| l.nodes[1]).filter(|e| [a, b].contains(e));
        let exit = (i + 1 < bonds.len()).then(|| ends(i + 1));
        let reversed = match (entry, exit) {
            (Some(e), _) => e == b,
            (None, Some(next)) => next.contains(&a) && !next.contains(&b),
            (None, None) => false,
        };
        legs.push(Leg { bond, nodes: if reversed { [b, a] } else { [a, b] } });
    }
    legs
}

/// Continues a line around a glyph.
fn curve(data: &mut String, from: Point, around: Point, to: Point) {
    let middle = add(from, 0.5, step(from, to));
    let bend = add(around, 0.35, step(around, middle));
    _ = write!(data, "Q{} {} {} {}", n(bend[0]), n(bend[1]), n(to[0]), n(to[1]));
}
