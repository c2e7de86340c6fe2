//! Lines, boxes and free places on paper. All in px, y downwards.

use std::collections::BTreeMap;

/// A point or vector.
pub type Point = [f64; 2];

/// `a + k b`.
pub fn add(a: Point, k: f64, b: Point) -> Point {
    [a[0] + k * b[0], a[1] + k * b[1]]
}

/// From `a` to `b`.
pub fn step(a: Point, b: Point) -> Point {
    [b[0] - a[0], b[1] - a[1]]
}

/// Length of a vector.
pub fn length(v: Point) -> f64 {
    (v[0] * v[0] + v[1] * v[1]).sqrt()
}

/// The vector with length 1; to the right if it has none.
pub fn unit(v: Point) -> Point {
    let l = length(v);
    if l > 1e-9 { [v[0] / l, v[1] / l] } else { [1.0, 0.0] }
}

/// The normal on which the half arrow and the flow are noted: below a bond, to the right of an upright one.
pub fn flow_side(direction: Point) -> Point {
    let n = [-direction[1], direction[0]];
    let upright = direction[0].abs() < 1e-3 * direction[1].abs();
    let turned = if upright { n[0] < 0.0 } else { n[1] < 0.0 };
    if turned { [-n[0], -n[1]] } else { n }
}

/// Where a ray from the centre of a box with these half sizes leaves it.
pub fn leave_box(centre: Point, half: Point, start: Point, direction: Point) -> Point {
    let reach = |k: usize| {
        if direction[k].abs() < 1e-9 {
            return f64::INFINITY;
        }
        (centre[k] + half[k] * direction[k].signum() - start[k]) / direction[k]
    };
    add(start, reach(0).min(reach(1)).max(0.0), direction)
}

/// A box by its corners.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Area {
    /// Upper left.
    pub min: Point,
    /// Lower right.
    pub max: Point,
}

impl Area {
    /// The box with this centre and size.
    pub fn around(centre: Point, size: Point) -> Area {
        Area { min: add(centre, -0.5, size), max: add(centre, 0.5, size) }
    }
    /// Whether two boxes share more than an edge.
    pub fn overlaps(&self, other: &Area) -> bool {
        (0..2).all(|k| self.min[k] < other.max[k] && other.min[k] < self.max[k])
    }
    /// Whether a straight line meets the box.
    pub fn meets(&self, from: Point, to: Point) -> bool {
        let [mut enter, mut exit] = [0.0_f64, 1.0_f64];
        for k in 0..2 {
            let d = to[k] - from[k];
            if d.abs() < 1e-12 {
                if from[k] <= self.min[k] || from[k] >= self.max[k] {
                    return false;
                }
                continue;
            }
            let [a, b] = [(self.min[k] - from[k]) / d, (self.max[k] - from[k]) / d];
            enter = enter.max(a.min(b));
            exit = exit.min(a.max(b));
        }
        enter < exit
    }
}

/// What is on the paper already, findable by place.
#[derive(Debug, Default)]
pub struct Paper {
    boxes: Vec<Area>,
    lines: Vec<[Point; 2]>,
    tiles: BTreeMap<[i64; 2], [Vec<usize>; 2]>,
}

impl Paper {
    const TILE: f64 = 64.0;

    /// Takes the place of a box.
    pub fn add_box(&mut self, area: Area) {
        let index = self.boxes.len();
        self.boxes.push(area);
        Self::tiles(area).for_each(|t| self.tiles.entry(t).or_default()[0].push(index));
    }
    /// Takes the place of a line.
    pub fn add_line(&mut self, from: Point, to: Point) {
        let index = self.lines.len();
        self.lines.push([from, to]);
        let steps = (length(step(from, to)) / Self::TILE).ceil().max(1.0);
        for i in 0..steps as usize {
            let [p, q] = [i as f64, i as f64 + 1.0].map(|k| add(from, k / steps, step(from, to)));
            let part = Area { min: [p[0].min(q[0]), p[1].min(q[1])], max: [p[0].max(q[0]), p[1].max(q[1])] };
            for t in Self::tiles(part) {
                let list = &mut self.tiles.entry(t).or_default()[1];
                if list.last() != Some(&index) {
                    list.push(index);
                }
            }
        }
    }
    /// How much is in the way of a box: 3 for every box, 2 for every line.
    pub fn crowding(&self, area: Area) -> usize {
        let mut met: [Vec<usize>; 2] = Default::default();
        for tile in Self::tiles(area).filter_map(|t| self.tiles.get(&t)) {
            met[0].extend(tile[0].iter().filter(|&&i| self.boxes[i].overlaps(&area)));
            met[1].extend(tile[1].iter().filter(|&&i| area.meets(self.lines[i][0], self.lines[i][1])));
        }
        met.iter_mut().for_each(|m| {
            m.sort_unstable();
            m.dedup();
        });
        3 * met[0].len() + 2 * met[1].len()
    }
    /// The first of the least crowded centres for a box of this size; its place is taken.
    pub fn settle(&mut self, centres: &[Point], size: Point) -> Point {
        let crowding = |c: &&Point| self.crowding(Area::around(**c, size));
        let best = centres.iter().min_by_key(crowding).copied().unwrap_or_default();
        self.add_box(Area::around(best, size));
        best
    }
    fn tiles(area: Area) -> impl Iterator<Item = [i64; 2]> {
        let tile = |x: f64| (x / Self::TILE).floor() as i64;
        let [x, y] = [0, 1].map(|k| tile(area.min[k])..=tile(area.max[k]));
        x.flat_map(move |i| y.clone().map(move |j| [i, j]))
    }
}
