//! The course of every bond between its two glyphs.

use std::collections::BTreeMap;

use crate::figure::Figure;
use crate::geometry::{Point, add, flow_side, leave_box, step, unit};
use crate::layout::Placement;

/// Distance between parallel bonds.
const PARALLEL: f64 = 15.0;

/// The course of a bond: a straight line, or a curve around a third point for a bond from a glyph to itself.
#[derive(Debug, Clone, PartialEq)]
pub struct Route {
    /// Its two ends, from and to.
    pub ends: [Point; 2],
    /// The point that a curve bends towards.
    pub bend: Option<Point>,
}

impl Route {
    /// The direction in which the course arrives at one of its ends (0 or 1), length 1.
    pub fn arrival(&self, end: usize) -> Point {
        let before = self.bend.unwrap_or(self.ends[1 - end]);
        unit(step(before, self.ends[end]))
    }
    /// The point at this fraction of the way.
    pub fn at(&self, t: f64) -> Point {
        let [a, b] = self.ends;
        let straight = add(a, t, step(a, b));
        let pull = |bend| add(straight, 2.0 * t * (1.0 - t), step(add(a, 0.5, step(a, b)), bend));
        self.bend.map_or(straight, pull)
    }
}

/// The courses of all bonds; bonds between the same two glyphs run side by side.
pub fn routes(figure: &Figure, placed: &Placement) -> Vec<Route> {
    let mut beside: BTreeMap<[usize; 2], Vec<usize>> = BTreeMap::new();
    for (i, bond) in figure.bonds.iter().enumerate() {
        let [a, b] = bond.ends;
        beside.entry([a.min(b), a.max(b)]).or_default().push(i);
    }
    let mut routes = vec![Route { ends: [[0.0; 2]; 2], bend: None }; figure.bonds.len()];
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
        let reach = 34.0 + 12.0 * turn as f64;
        let ends = [[a[0] + half_a[0], a[1] - 5.0], [a[0] + 4.0, a[1] - half_a[1]]];
        return Route { ends, bend: Some([a[0] + half_a[0] + reach, a[1] - half_a[1] - reach]) };
    }
    let along = unit(step(a, b));
    let shift = |p: Point| add(p, aside, flow_side(along));
    let ends = [leave_box(a, half_a, shift(a), along), leave_box(b, half_b, shift(b), [-along[0], -along[1]])];
    Route { ends, bend: None }
}
