//! The course of every bond between its two glyphs.

use std::collections::BTreeMap;

use crate::detour::detour;
use crate::figure::Figure;
use crate::geometry::{Area, Point, add, flow_side, leave_box, length, step, unit};
use crate::layout::Placement;
use crate::paper::Paper;

/// Bonds led around something; of more in one drawing nobody could follow each.
const MOST: usize = 400;
/// Distance between parallel bonds.
const PARALLEL: f64 = 15.0;

/// The course of a bond: a line, straight or with bends.
#[derive(Debug, Clone, PartialEq)]
pub struct Route {
    /// From its start to its half arrow, at least two.
    pub points: Vec<Point>,
}

impl Route {
    /// Its straight pieces.
    pub fn pieces(&self) -> impl Iterator<Item = [Point; 2]> + '_ {
        self.points.windows(2).map(|w| [w[0], w[1]])
    }
    /// Its ends, from and to.
    pub fn end(&self, end: usize) -> Point {
        if end == 0 { self.points[0] } else { self.points[self.points.len() - 1] }
    }
    /// The direction in which the course arrives at one of its ends (0 or 1), length 1.
    pub fn arrival(&self, end: usize) -> Point {
        let last = self.points.len() - 1;
        if end == 0 {
            unit(step(self.points[1], self.points[0]))
        } else {
            unit(step(self.points[last - 1], self.points[last]))
        }
    }
    /// The point at this fraction of the way, and the direction there.
    pub fn at(&self, t: f64) -> (Point, Point) {
        let whole: f64 = self.pieces().map(|[a, b]| length(step(a, b))).sum();
        let mut left = t * whole;
        for [a, b] in self.pieces() {
            let long = length(step(a, b));
            if left <= long && long > 0.0 {
                return (add(a, left / long, step(a, b)), unit(step(a, b)));
            }
            left -= long;
        }
        (self.end(1), self.arrival(1))
    }
    /// The barb of the half arrow, on the side of the flow.
    pub fn barb(&self) -> [Point; 2] {
        let along = self.arrival(1);
        let tip = self.end(1);
        [tip, add(add(tip, -9.0, along), 5.5, flow_side(along))]
    }
    /// The causal stroke at an end.
    pub fn stroke(&self, end: usize) -> [Point; 2] {
        let along = self.arrival(end);
        [6.5, -6.5].map(|k| add(self.end(end), k, [-along[1], along[0]]))
    }
    /// The course moved by this distance to its left.
    pub fn beside(&self, by: f64) -> Vec<Point> {
        let left = |[a, b]: [Point; 2]| unit(step(a, b));
        let directions: Vec<Point> = self.pieces().map(left).collect();
        let moved = |(i, p): (usize, &Point)| {
            let before = directions[i.saturating_sub(1)];
            let after = directions[i.min(directions.len() - 1)];
            let sum = [before[0] + after[0], before[1] + after[1]];
            let square = (sum[0] * sum[0] + sum[1] * sum[1]).max(1.0);
            add(*p, 2.0 * by / square, [sum[1], -sum[0]])
        };
        self.points.iter().enumerate().map(moved).collect()
    }
    /// The normal on which half arrow and flow are noted, to the left (-1) or right (1) of the way.
    pub fn flow_hand(&self) -> f64 {
        let d = self.arrival(1);
        let side = flow_side(d);
        (-d[1] * side[0] + d[0] * side[1]).signum()
    }
}

/// The courses of all bonds as straight lines; bonds between the same two glyphs run side by side.
pub fn straight(figure: &Figure, placed: &Placement) -> Vec<Route> {
    let mut beside: BTreeMap<[usize; 2], Vec<usize>> = BTreeMap::new();
    for (i, bond) in figure.bonds.iter().enumerate() {
        let [a, b] = bond.ends;
        beside.entry([a.min(b), a.max(b)]).or_default().push(i);
    }
    let mut routes = vec![Route { points: vec![[0.0; 2]; 2] }; figure.bonds.len()];
    for bonds in beside.values() {
        for (k, &i) in bonds.iter().enumerate() {
            let aside = (k as f64 - (bonds.len() as f64 - 1.0) / 2.0) * PARALLEL;
            routes[i] = route(figure, placed, i, aside, k);
        }
    }
    routes
}

fn route(figure: &Figure, placed: &Placement, bond: usize, aside: f64, turn: usize) -> Route {
    let [from, to] = figure.bonds[bond].ends;
    let [a, b] = [placed.anchors[from], placed.anchors[to]];
    let [half_a, half_b] = [figure.glyphs[from].core(), figure.glyphs[to].core()];
    if from == to {
        let reach = 22.0 + 12.0 * turn as f64;
        let [right, top] = [a[0] + half_a[0], a[1] - half_a[1]];
        let corners = [[right + reach, a[1] - 5.0], [right + reach, top - reach], [a[0] + 4.0, top - reach]];
        return Route { points: vec![[right, a[1] - 5.0], corners[0], corners[1], corners[2], [a[0] + 4.0, top]] };
    }
    let along = unit(step(a, b));
    let shift = |p: Point| add(p, aside, flow_side(along));
    let ends = [leave_box(a, half_a, shift(a), along), leave_box(b, half_b, shift(b), [-along[0], -along[1]])];
    Route { points: ends.to_vec() }
}

/// Leads the bonds whose straight line runs through a sign or a text around it, in order, and notes them on the paper.
/// How many there is no way for.
pub fn lead_around(
    figure: &Figure,
    placed: &Placement,
    routes: &mut [Route],
    paper: &mut Paper,
    bonds: &[usize],
) -> usize {
    let mut lost = 0;
    for (count, &bond) in bonds.iter().enumerate() {
        let ends = figure.bonds[bond].ends;
        let [a, b] = ends.map(|v| placed.anchors[v]);
        let found = if count < MOST { detour(paper, a, b, ends) } else { None };
        match found {
            Some(bends) if !bends.is_empty() => {
                let leave = |v: usize, towards: Point| {
                    let at = placed.anchors[v];
                    leave_box(at, figure.glyphs[v].core(), at, unit(step(at, towards)))
                };
                let mut points = vec![leave(ends[0], bends[0])];
                points.extend(&bends);
                points.push(leave(ends[1], bends[bends.len() - 1]));
                // Others keep off the bends, so that no two courses look like one.
                bends.iter().for_each(|&p| paper.add_box(Area::around(p, [4.0, 4.0]), None));
                routes[bond] = Route { points };
            }
            _ => lost += 1,
        }
        routes[bond].pieces().for_each(|[p, q]| paper.add_line(p, q));
    }
    lost
}
