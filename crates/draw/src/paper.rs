//! What is on the paper already, findable by place.

use std::collections::BTreeMap;

use crate::geometry::{Area, Point, add, cross, length, step};

/// Room that a bond keeps from texts and signs.
const AWAY: f64 = 2.0;
const TILE: f64 = 64.0;

/// Boxes and lines.
#[derive(Debug, Default, Clone)]
pub struct Paper {
    /// Boxes; the sign of a node belongs to it, texts belong to nobody.
    boxes: Vec<(Area, Option<usize>)>,
    lines: Vec<[Point; 2]>,
    tiles: BTreeMap<[i64; 2], [Vec<usize>; 2]>,
}

impl Paper {
    /// Takes the place of a box; bonds may end at that of their own node.
    pub fn add_box(&mut self, area: Area, node: Option<usize>) {
        let index = self.boxes.len();
        self.boxes.push((area, node));
        tiles(area.grown(AWAY)).for_each(|t| self.tiles.entry(t).or_default()[0].push(index));
    }
    /// Takes the place of a line.
    pub fn add_line(&mut self, from: Point, to: Point) {
        let index = self.lines.len();
        self.lines.push([from, to]);
        for t in along(from, to) {
            let list = &mut self.tiles.entry(t).or_default()[1];
            if list.last() != Some(&index) {
                list.push(index);
            }
        }
    }
    /// How much is in the way of a box: 3 for every box, 2 for every line.
    pub fn crowding(&self, area: Area) -> usize {
        let mut met: [Vec<usize>; 2] = Default::default();
        for tile in tiles(area).filter_map(|t| self.tiles.get(&t)) {
            met[0].extend(tile[0].iter().filter(|&&i| self.boxes[i].0.overlaps(&area)));
            met[1].extend(tile[1].iter().filter(|&&i| area.meets(self.lines[i][0], self.lines[i][1])));
        }
        met.iter_mut().for_each(|m| {
            m.sort_unstable();
            m.dedup();
        });
        3 * met[0].len() + 2 * met[1].len()
    }
    /// The first of the least crowded centres for a box of this size, and how crowded it is; its place is taken.
    pub fn settle(&mut self, centres: &[Point], size: Point) -> (Point, usize) {
        let crowded = centres.iter().map(|&c| (self.crowding(Area::around(c, size)), c));
        let mut best = (usize::MAX, [0.0; 2]);
        for found in crowded {
            if found.0 < best.0 {
                best = found;
            }
            if best.0 == 0 {
                break;
            }
        }
        self.add_box(Area::around(best.1, size), None);
        (best.1, best.0)
    }
    /// Whether a line between signs of these nodes comes too near to any other sign or any text.
    pub fn blocked(&self, from: Point, to: Point, own: [usize; 2]) -> bool {
        let mut tiles = along(from, to).filter_map(|t| self.tiles.get(&t));
        tiles.any(|tile| {
            tile[0].iter().any(|&i| {
                let (area, node) = self.boxes[i];
                node.is_none_or(|v| !own.contains(&v)) && area.grown(AWAY).meets(from, to)
            })
        })
    }
    /// Whether a point lies too near to a box.
    pub fn covers(&self, p: Point) -> bool {
        let tile = p.map(|x| (x / TILE).floor() as i64);
        self.tiles.get(&tile).is_some_and(|t| t[0].iter().any(|&i| self.boxes[i].0.grown(AWAY).holds(p)))
    }
    /// The number of lines that a line crosses.
    pub fn crossings(&self, from: Point, to: Point) -> usize {
        let mut met: Vec<usize> =
            along(from, to).filter_map(|t| self.tiles.get(&t)).flat_map(|t| &t[1]).copied().collect();
        met.sort_unstable();
        met.dedup();
        met.into_iter().filter(|&i| cross(from, to, self.lines[i][0], self.lines[i][1])).count()
    }
    /// The boxes that reach into a window, in order.
    pub fn boxes_in(&self, window: Area) -> Vec<Area> {
        let mut met: Vec<usize> =
            tiles(window).filter_map(|t| self.tiles.get(&t)).flat_map(|t| &t[0]).copied().collect();
        met.sort_unstable();
        met.dedup();
        met.into_iter().map(|i| self.boxes[i].0).filter(|a| a.overlaps(&window)).collect()
    }
}

fn tiles(area: Area) -> impl Iterator<Item = [i64; 2]> {
    let tile = |x: f64| (x / TILE).floor() as i64;
    let [x, y] = [0, 1].map(|k| tile(area.min[k])..=tile(area.max[k]));
    x.flat_map(move |i| y.clone().map(move |j| [i, j]))
}

/// The tiles that a line passes, some of them twice.
fn along(from: Point, to: Point) -> impl Iterator<Item = [i64; 2]> {
    let steps = (length(step(from, to)) / TILE).ceil().max(1.0);
    (0..steps as usize).flat_map(move |i| {
        let [p, q] = [i as f64, i as f64 + 1.0].map(|k| add(from, k / steps, step(from, to)));
        tiles(Area { min: [p[0].min(q[0]), p[1].min(q[1])], max: [p[0].max(q[0]), p[1].max(q[1])] })
    })
}
