//! Places for new nodes of a drawing whose other nodes stay where they are.

use super::{Network, Placement, Role, Room, Side, lay_out, part_of, parts};
use crate::geometry::{Area, Point, add, cross};

/// Between a new node and its neighbour, along a bond, and between texts.
const BOND: Point = [46.0, 36.0];
const CLEAR: f64 = 8.0;

/// Lays out what has no place yet around what has: each node near its neighbours, on nothing else.
pub fn place_beside(net: &Network, pinned: &[Option<Point>]) -> Placement {
    let mut table = Table::new(net, pinned);
    table.all_beside();
    table.new_parts();
    table.turn_texts();
    table.placement()
}

/// Nodes with and without a place.
struct Table<'n> {
    net: &'n Network,
    incident: Vec<Vec<usize>>,
    hangs: Vec<bool>,
    at: Vec<Option<Point>>,
    mirrored: Vec<bool>,
}

impl<'n> Table<'n> {
    fn new(net: &'n Network, pinned: &[Option<Point>]) -> Table<'n> {
        let incident = net.incident();
        let hangs = net.hosts(&incident).iter().map(Option::is_some).collect();
        let at = (0..net.nodes.len()).map(|v| pinned.get(v).copied().flatten()).collect();
        Table { net, incident, hangs, at, mirrored: vec![false; net.nodes.len()] }
    }
    /// Places neighbours of placed nodes, those with most placed neighbours first, one-ports last.
    fn all_beside(&mut self) {
        loop {
            let known = |v: usize| self.neighbours(v).filter(|&u| self.at[u].is_some()).count();
            let open = (0..self.at.len()).filter(|&v| self.at[v].is_none() && known(v) > 0);
            let Some(v) = open.min_by_key(|&v| (self.hangs[v], usize::MAX - known(v), v)) else { return };
            self.at[v] = Some(self.place(v));
        }
    }
    fn neighbours(&self, v: usize) -> impl Iterator<Item = usize> + '_ {
        self.incident[v].iter().map(move |&b| self.net.across(b, v)).filter(move |&u| u != v)
    }
    /// The best of the places around the placed neighbours of a node.
    fn place(&self, v: usize) -> Point {
        let near: Vec<Point> = self.neighbours(v).filter_map(|u| self.at[u]).collect();
        let places = near.iter().flat_map(|p| around(*p, self.net.nodes[v].room));
        let cost = |p: &Point| self.cost(v, *p, &near);
        let found = places.map(|p| (cost(&p), p)).min_by(|a, b| a.0.total_cmp(&b.0));
        found.map_or(near[0], |f| f.1)
    }
    /// Length, crossings, and what stands in the way.
    fn cost(&self, v: usize, p: Point, near: &[Point]) -> f64 {
        let own = self.area(v, p).grown(CLEAR / 2.0);
        let others = (0..self.at.len()).filter_map(|u| Some((u, self.at[u]?)));
        let mut cost = 0.0;
        for (u, at) in others {
            let area = self.area(u, at);
            cost += if own.overlaps(&area.grown(CLEAR / 2.0)) { 4000.0 } else { 0.0 };
            let foreign = |n: &&Point| **n != at && area.meets(p, **n);
            cost += 800.0 * near.iter().filter(foreign).count() as f64;
        }
        for bond in &self.net.bonds {
            let [Some(a), Some(b)] = bond.map(|w| self.at[w]) else { continue };
            cost += if own.meets(a, b) { 1500.0 } else { 0.0 };
            cost += 250.0 * near.iter().filter(|n| cross(p, **n, a, b)).count() as f64;
        }
        for n in near {
            let [dx, dy] = [(p[0] - n[0]).abs(), (p[1] - n[1]).abs()];
            cost += dx + dy + if dx.min(dy) > 0.5 { 60.0 } else { 0.0 };
        }
        let inner = !matches!(self.net.nodes[v].role, Role::OnePort);
        let level = near.iter().any(|n| (p[1] - n[1]).abs() < 0.5);
        cost + if inner == level { 0.0 } else { 15.0 }
    }
    fn side(&self, v: usize, p: Point) -> Side {
        let near = self.neighbours(v).find_map(|u| self.at[u]);
        near.map_or(Side::East, |n| Side::of([(n[0] - p[0]).round() as i32, (n[1] - p[1]).round() as i32]))
    }
    fn area(&self, v: usize, p: Point) -> Area {
        let room = self.net.nodes[v].room[self.side(v, p) as usize];
        let room = if self.mirrored[v] { room.mirrored() } else { room };
        Area { min: [p[0] - room.west, p[1] - room.north], max: [p[0] + room.east, p[1] + room.south] }
    }
    /// Parts of which nothing has a place are laid out on their own, below the rest.
    fn new_parts(&mut self) {
        let new = parts(self.net.nodes.len(), &self.net.bonds).into_iter().filter(|p| self.at[p[0]].is_none());
        for nodes in new.collect::<Vec<_>>() {
            let placed = lay_out(&part_of(self.net, &nodes));
            let (corner, size) = self.extent();
            let from = [corner[0], corner[1] + size[1] + 36.0];
            for (i, &v) in nodes.iter().enumerate() {
                self.at[v] = Some(add(from, 1.0, placed.anchors[i]));
                self.mirrored[v] = placed.mirrored[i];
            }
        }
    }
    /// Turns the text of a one-port above or below its neighbour to the other side where that frees it.
    fn turn_texts(&mut self) {
        for v in 0..self.at.len() {
            let Some(p) = self.at[v].filter(|_| self.hangs[v]) else { continue };
            if !matches!(self.side(v, p), Side::North | Side::South) {
                continue;
            }
            let before = self.met(v, p);
            self.mirrored[v] = !self.mirrored[v];
            if before <= self.met(v, p) {
                self.mirrored[v] = !self.mirrored[v];
            }
        }
    }
    /// How much the room of a node meets: other nodes, and bonds that do not end there.
    fn met(&self, v: usize, p: Point) -> usize {
        let own = self.area(v, p);
        let others = (0..self.at.len()).filter(|&u| u != v).filter_map(|u| Some(self.area(u, self.at[u]?)));
        let foreign = self.net.bonds.iter().filter(|b| !b.contains(&v));
        let lines = foreign.filter_map(|b| Some([self.at[b[0]]?, self.at[b[1]]?]));
        others.filter(|a| a.overlaps(&own)).count() + lines.filter(|[a, b]| own.meets(*a, *b)).count()
    }
    fn extent(&self) -> (Point, Point) {
        let areas = (0..self.at.len()).filter_map(|v| Some(self.area(v, self.at[v]?)));
        let whole = areas.reduce(|a, b| Area {
            min: [a.min[0].min(b.min[0]), a.min[1].min(b.min[1])],
            max: [a.max[0].max(b.max[0]), a.max[1].max(b.max[1])],
        });
        whole.map_or(([0.0; 2], [0.0; 2]), |w| (w.min, [w.max[0] - w.min[0], w.max[1] - w.min[1]]))
    }
    fn placement(self) -> Placement {
        let (corner, size) = self.extent();
        let anchors: Vec<Point> = self.at.iter().map(|p| p.unwrap_or_default()).collect();
        let facing = (0..anchors.len()).map(|v| self.side(v, anchors[v])).collect();
        Placement { anchors, facing, mirrored: self.mirrored, corner, size }
    }
}

/// Places around a node for a neighbour with this room on each of its sides, near ones first.
fn around(p: Point, room: [Room; 4]) -> Vec<Point> {
    let mut places = Vec::new();
    for ring in 0..4 {
        for (dx, dy) in
            [(1.0, 0.0), (0.0, 1.0), (0.0, -1.0), (-1.0, 0.0), (1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)]
        {
            let far = 1.0 + 0.75 * f64::from(ring);
            let side = Side::of([-dx as i32, -dy as i32]);
            let own = room[side as usize];
            let x = if dx > 0.0 { own.west } else { own.east };
            let y = if dy > 0.0 { own.north } else { own.south };
            places.push([p[0] + dx * (far * BOND[0] + 14.0 + x.min(14.0)), p[1] + dy * (far * BOND[1] + 12.0 + y)]);
        }
    }
    places
}
