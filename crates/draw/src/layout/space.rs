//! From cells to pixels: rows and columns get the room that labels and bonds need, no more.

use std::collections::{BTreeMap, BTreeSet};

use super::{Cell, Network, Placement, Role, Room, Side};
use crate::geometry::Area;

/// Shortest horizontal bond between neighbours, in px.
const ALONG: f64 = 46.0;
/// Shortest vertical bond between neighbours.
const DOWN: f64 = 36.0;
/// Between text and anything else.
const CLEAR: f64 = 9.0;
/// Texts less than this above each other count as side by side.
const LEVEL: f64 = 5.0;

/// Turns cells into positions: as close as possible without a bond through a text, as far as turning texts to the other
/// side will do. Bonds get more room by the factor `wider`.
pub fn space(net: &Network, cells: &[Cell], wider: f64) -> Placement {
    let mut grid = Grid::new(net, cells, wider);
    let mut best: Option<(usize, Placement)> = None;
    for _ in 0..2 {
        let anchors = grid.anchors();
        let struck = grid.struck(&anchors);
        if best.as_ref().is_none_or(|b| struck.len() < b.0) {
            best = Some((struck.len(), grid.fit(anchors)));
        }
        if struck.is_empty() || !grid.mirror(&struck) {
            break;
        }
    }
    best.map(|b| b.1).unwrap_or_default()
}

/// Nodes in rows and columns without empty ones.
struct Grid<'a> {
    net: &'a Network,
    cells: Vec<Cell>,
    rooms: Vec<Room>,
    facing: Vec<Side>,
    mirrored: Vec<bool>,
    /// Factor on the gaps that bonds need.
    wider: f64,
    /// Bonds by their cells: pairs of neighbouring nodes that are bonded.
    bonded: BTreeSet<[usize; 2]>,
    size: [usize; 2],
}

impl<'a> Grid<'a> {
    fn new(net: &'a Network, cells: &[Cell], wider: f64) -> Grid<'a> {
        let index = |k: usize| -> BTreeMap<i32, i32> {
            let used: BTreeSet<i32> = cells.iter().map(|c| c[k]).collect();
            used.into_iter().zip(0..).collect()
        };
        let [columns, rows] = [index(0), index(1)];
        let cells: Vec<Cell> = cells.iter().map(|c| [columns[&c[0]], rows[&c[1]]]).collect();
        let mut facing = vec![Side::East; net.nodes.len()];
        for (v, bonds) in net.incident().iter().enumerate() {
            if let Some(&bond) = bonds.first() {
                let u = net.across(bond, v);
                facing[v] = Side::of([cells[u][0] - cells[v][0], cells[u][1] - cells[v][1]]);
            }
        }
        let rooms = net.nodes.iter().zip(&facing).map(|(n, &f)| n.room[f as usize]).collect();
        let bonded = net.bonds.iter().map(|&[a, b]| [a.min(b), a.max(b)]).collect();
        let mirrored = vec![false; net.nodes.len()];
        Grid { net, cells, rooms, facing, mirrored, wider, bonded, size: [columns.len(), rows.len()] }
    }
    fn anchors(&self) -> Vec<[f64; 2]> {
        let rows = self.rows();
        let columns = self.columns(&rows);
        self.cells.iter().map(|c| [columns[c[0] as usize], rows[c[1] as usize]]).collect()
    }
    /// Moves everything so that it starts at 0, and measures it.
    fn fit(&self, mut anchors: Vec<[f64; 2]>) -> Placement {
        let rooms = &self.rooms;
        let least = |f: &dyn Fn(usize) -> f64| (0..rooms.len()).map(f).fold(f64::INFINITY, f64::min);
        let [left, top] = [least(&|v| anchors[v][0] - rooms[v].west), least(&|v| anchors[v][1] - rooms[v].north)];
        anchors.iter_mut().for_each(|a| *a = [a[0] - left, a[1] - top]);
        let most = |f: &dyn Fn(usize) -> f64| (0..rooms.len()).map(f).fold(0.0, f64::max);
        let size = [most(&|v| anchors[v][0] + rooms[v].east), most(&|v| anchors[v][1] + rooms[v].south)];
        Placement { anchors, facing: self.facing.clone(), mirrored: self.mirrored.clone(), corner: [0.0; 2], size }
    }
    /// The nodes whose room a foreign bond runs through. Not looked for in very large graphs.
    fn struck(&self, anchors: &[[f64; 2]]) -> Vec<usize> {
        const SEARCHED: usize = 1500;
        if anchors.len() > SEARCHED {
            return Vec::new();
        }
        let area = |v: usize| {
            let ([x, y], room) = (anchors[v], self.rooms[v]);
            Area { min: [x - room.west, y - room.north], max: [x + room.east, y + room.south] }
        };
        let foreign = |v: usize, b: &[usize; 2]| !b.contains(&v) && area(v).meets(anchors[b[0]], anchors[b[1]]);
        (0..anchors.len()).filter(|&v| self.net.bonds.iter().any(|b| foreign(v, b))).collect()
    }
    /// Turns the texts of these one-ports to the other side, where they have one. Whether there was any.
    fn mirror(&mut self, struck: &[usize]) -> bool {
        let turns = |v: &&usize| {
            let one_port = matches!(self.net.nodes[**v].role, Role::OnePort | Role::Source);
            one_port && matches!(self.facing[**v], Side::North | Side::South)
        };
        let turned: Vec<usize> = struck.iter().filter(turns).copied().collect();
        for &v in &turned {
            self.mirrored[v] = !self.mirrored[v];
            self.rooms[v] = self.rooms[v].mirrored();
        }
        !turned.is_empty()
    }
    fn bonded(&self, a: usize, b: usize) -> bool {
        self.bonded.contains(&[a.min(b), a.max(b)])
    }
    /// The nodes of every row, from left to right.
    fn by_row(&self) -> Vec<Vec<usize>> {
        let mut rows = vec![Vec::new(); self.size[1]];
        (0..self.cells.len()).for_each(|v| rows[self.cells[v][1] as usize].push(v));
        rows.iter_mut().for_each(|r| r.sort_by_key(|&v| self.cells[v][0]));
        rows
    }
    /// The height of every row: far enough from the one above for all pairs that could meet.
    fn rows(&self) -> Vec<f64> {
        let by_row = self.by_row();
        let mut y = vec![0.0; self.size[1]];
        for r in 1..self.size[1] {
            let [upper, lower] = [&by_row[r - 1], &by_row[r]];
            let mut apart: f64 = 24.0;
            let mut first = 0;
            for &b in lower {
                while first < upper.len() && self.cells[upper[first]][0] < self.cells[b][0] - 1 {
                    first += 1;
                }
                let near = upper[first..].iter().take_while(|&&a| self.cells[a][0] <= self.cells[b][0] + 1);
                for &a in near {
                    apart = apart.max(self.rooms[a].south + self.rooms[b].north + self.gap_down(a, b));
                }
            }
            y[r] = y[r - 1] + apart;
        }
        y
    }
    fn gap_down(&self, a: usize, b: usize) -> f64 {
        match (self.bonded(a, b), self.cells[a][0] == self.cells[b][0]) {
            (true, true) => DOWN * self.wider,
            (true, false) => 22.0 * self.wider,
            (false, true) => CLEAR * self.wider,
            (false, false) => 0.0,
        }
    }
    /// The place of every column: right of all that stands to the left at the same height.
    fn columns(&self, y: &[f64]) -> Vec<f64> {
        let mut items: Vec<Vec<Item>> = vec![Vec::new(); self.size[0]];
        for (v, c) in self.cells.iter().enumerate() {
            let room = self.rooms[v];
            let at = y[c[1] as usize];
            items[c[0] as usize].push(Item {
                row: c[1] as usize,
                node: Some(v),
                top: at - room.north,
                bottom: at + room.south,
                room,
            });
        }
        self.vertical_bonds(y, &mut items);
        let mut x = vec![0.0_f64; self.size[0]];
        let mut last: Vec<Option<(usize, Item)>> = vec![None; self.size[1]];
        for column in 0..self.size[0] {
            let mut place = if column == 0 { 0.0 } else { x[column - 1] + 12.0 };
            for item in &items[column] {
                let near = item.row.saturating_sub(2)..(item.row + 3).min(self.size[1]);
                for (c, left) in last[near].iter().flatten() {
                    if left.top < item.bottom + LEVEL && item.top < left.bottom + LEVEL {
                        place = place.max(x[*c] + left.room.east + item.room.west + self.gap_along(left, item));
                    }
                }
            }
            x[column] = place;
            for item in &items[column] {
                let keep = |old: &(usize, Item)| x[old.0] + old.1.room.east > place + item.room.east;
                if !last[item.row].as_ref().is_some_and(keep) {
                    last[item.row] = Some((column, item.clone()));
                }
            }
        }
        x
    }
    /// Adds the rows that vertical bonds pass, so that text stays off them.
    fn vertical_bonds(&self, y: &[f64], items: &mut [Vec<Item>]) {
        for &[a, b] in &self.net.bonds {
            let [a, b] = [self.cells[a], self.cells[b]];
            if a[0] == b[0] {
                for row in a[1].min(b[1]) + 1..a[1].max(b[1]) {
                    let at = y[row as usize];
                    let room = Room { west: 3.0, east: 3.0, north: 12.0, south: 12.0 };
                    items[a[0] as usize].push(Item {
                        row: row as usize,
                        node: None,
                        top: at - 12.0,
                        bottom: at + 12.0,
                        room,
                    });
                }
            }
        }
    }
    fn gap_along(&self, left: &Item, right: &Item) -> f64 {
        match (left.node, right.node) {
            (Some(a), Some(b)) if self.bonded(a, b) => {
                if left.row == right.row {
                    ALONG * self.wider
                } else {
                    20.0 * self.wider
                }
            }
            _ => CLEAR * self.wider,
        }
    }
}

/// What takes room in a row.
#[derive(Clone)]
struct Item {
    row: usize,
    node: Option<usize>,
    top: f64,
    bottom: f64,
    room: Room,
}
