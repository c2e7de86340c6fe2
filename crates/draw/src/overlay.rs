//! Causal paths as coloured lines along their bonds.

use std::fmt::Write;

use crate::figure::{Figure, Loop};
use crate::geometry::{Point, add, flow_side, step, unit};
use crate::layout::Placement;
use crate::route::Route;
use crate::svg::n;

/// Colours that people who see few colours can tell apart, after Okabe and Ito.
pub const COLOURS: [&str; 8] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7a3e9d", "#8c8c2b"];
/// Distance between paths on one bond.
const LANE: f64 = 5.0;

/// The lane of every path, such that no two share a lane on a bond: 0, 1, -1, 2, …
pub fn lanes(figure: &Figure) -> Vec<i32> {
    let mut taken: Vec<Vec<usize>> = vec![Vec::new(); figure.bonds.len()];
    let mut lanes = Vec::new();
    for path in &figure.loops {
        let free = |lane: &usize| path.bonds.iter().all(|&b| !taken[b].contains(lane));
        let lane = (0..).find(free).expect("there are lanes without end");
        path.bonds.iter().for_each(|&b| taken[b].push(lane));
        let away = lane.div_ceil(2) as i32;
        lanes.push(if lane % 2 == 1 { away } else { -away });
    }
    lanes
}

/// The line of a path, as SVG path data.
pub fn course(figure: &Figure, placed: &Placement, routes: &[Route], path: &Loop, lane: i32) -> String {
    let legs = legs(figure, &path.bonds);
    let beside = |leg: &Leg| {
        let [a, b] = routes[leg.bond].ends;
        let aside = f64::from(lane) * LANE;
        let [p, q] = [a, b].map(|p| add(p, -aside, flow_side(unit(step(a, b)))));
        if leg.nodes == figure.bonds[leg.bond].ends { [p, q] } else { [q, p] }
    };
    let mut data = String::new();
    for (i, leg) in legs.iter().enumerate() {
        let [start, end] = beside(leg);
        match i.checked_sub(1).map(|j| &legs[j]) {
            Some(before) if before.nodes[1] == leg.nodes[0] => {
                curve(&mut data, beside(before)[1], placed.anchors[leg.nodes[0]], start);
            }
            _ => _ = write!(data, "M{} {}", n(start[0]), n(start[1])),
        }
        match routes[leg.bond].bend {
            Some(bend) => _ = write!(data, "Q{} {} {} {}", n(bend[0]), n(bend[1]), n(end[0]), n(end[1])),
            None => _ = write!(data, "L{} {}", n(end[0]), n(end[1])),
        }
    }
    if let Some(last) = legs.last()
        && let Some(back) = legs.iter().find(|l| l.nodes[0] == last.nodes[1])
    {
        curve(&mut data, beside(last)[1], placed.anchors[last.nodes[1]], beside(back)[0]);
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
