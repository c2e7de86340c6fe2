//! The grid with everything on it, and what a placement costs.
//!
//! A good drawing has short bonds, horizontal or vertical, none across another or through a node; two-ports in line;
//! one-ports above and below; power from left to right.

use std::collections::BTreeMap;

use super::blocks::membership;
use super::{Cell, Network, Role};

/// Free cells around the first placement.
const MARGIN: i32 = 6;

/// Nodes on a grid.
pub struct Board<'a> {
    pub net: &'a Network,
    pub incident: Vec<Vec<usize>>,
    pub at: Vec<Cell>,
    hangs: Vec<bool>,
    /// The block of equal ones that a node is in, and the number of nodes of each.
    pub block: Vec<Option<usize>>,
    blocks: Vec<usize>,
    /// The two inner neighbours of a node that has exactly two: a chain runs through it.
    run: Vec<Option<[usize; 2]>>,
    corner: Cell,
    size: Cell,
    /// Node in each cell.
    node: Vec<Option<u32>>,
    /// Bonds through each cell.
    through: Vec<Vec<u32>>,
    /// The last evaluation that saw each bond, and each node.
    seen: [Vec<u64>; 2],
    now: u64,
    /// Cells and bonds looked at so far: a measure of time that is the same on every machine.
    pub work: u64,
}

impl<'a> Board<'a> {
    /// The board with a placement; `None` if the placement is too sprawling for a dense grid, or its bonds too long.
    pub fn new(net: &'a Network, at: Vec<Cell>) -> Option<Board<'a>> {
        let edge = |k: usize, f: fn(i32, i32) -> i32| at.iter().map(|c| c[k]).reduce(f).unwrap_or(0);
        let corner = [edge(0, i32::min) - MARGIN, edge(1, i32::min) - MARGIN];
        let size = [edge(0, i32::max) + MARGIN + 1 - corner[0], edge(1, i32::max) + MARGIN + 1 - corner[1]];
        let area = usize::try_from(i64::from(size[0]) * i64::from(size[1])).ok().filter(|&a| a <= 4_000_000)?;
        let incident = net.incident();
        let hangs: Vec<bool> = net.hosts(&incident).iter().map(Option::is_some).collect();
        let run = (0..net.nodes.len()).map(|v| run(net, &incident, &hangs, v)).collect();
        let seen = [vec![0; net.bonds.len()], vec![0; net.nodes.len()]];
        let (block, blocks) = membership(net);
        let mut board = Board {
            net,
            block,
            blocks,
            incident,
            at,
            hangs,
            run,
            corner,
            size,
            node: vec![None; area],
            through: vec![Vec::new(); area],
            seen,
            now: 0,
            work: 0,
        };
        for v in 0..net.nodes.len() {
            let cell = board.index(board.at[v]);
            board.node[cell] = Some(v as u32);
        }
        for bond in 0..net.bonds.len() {
            board.draw_bond(bond);
            if board.work > 20_000_000 {
                return None;
            }
        }
        Some(board)
    }
    /// Whether a node hangs at another as its one-port.
    pub fn hangs(&self, v: usize) -> bool {
        self.hangs[v]
    }
    /// Whether a cell is on the board.
    pub fn holds(&self, c: Cell) -> bool {
        (0..2).all(|k| (self.corner[k]..self.corner[k] + self.size[k]).contains(&c[k]))
    }
    /// The node in a cell.
    pub fn node_in(&self, c: Cell) -> Option<usize> {
        self.node[self.index(c)].map(|v| v as usize)
    }
    /// Whether moves leave the shape of every block as it is.
    pub fn keeps_blocks(&self, moves: &[(usize, Cell)]) -> bool {
        if self.blocks.is_empty() {
            return true;
        }
        let mut moved: BTreeMap<usize, (Cell, usize)> = BTreeMap::new();
        for &(v, to) in moves {
            let Some(block) = self.block[v] else { continue };
            let by = [to[0] - self.at[v][0], to[1] - self.at[v][1]];
            let known = moved.entry(block).or_insert((by, 0));
            if known.0 != by {
                return false;
            }
            known.1 += 1;
        }
        moved.iter().all(|(&block, &(_, count))| count == self.blocks[block])
    }
    /// Moves nodes to cells that are free or left by these nodes.
    pub fn place(&mut self, moves: &[(usize, Cell)]) {
        self.each_bond(moves, Self::rub_out_bond);
        for &(v, _) in moves {
            let cell = self.index(self.at[v]);
            self.node[cell] = None;
        }
        for &(v, to) in moves {
            self.at[v] = to;
            let cell = self.index(to);
            self.node[cell] = Some(v as u32);
        }
        self.each_bond(moves, Self::draw_bond);
    }
    /// Does something once to every bond of these nodes.
    fn each_bond(&mut self, moves: &[(usize, Cell)], act: fn(&mut Self, usize)) {
        self.now += 1;
        for &(v, _) in moves {
            for i in 0..self.incident[v].len() {
                let bond = self.incident[v][i];
                if std::mem::replace(&mut self.seen[0][bond], self.now) != self.now {
                    act(self, bond);
                }
            }
        }
    }
    /// What the bonds and cells of these nodes cost: all that can change when they move.
    pub fn cost(&mut self, nodes: &[usize]) -> i64 {
        self.now += 1;
        let mut total = 0;
        for &v in nodes {
            for i in 0..self.incident[v].len() {
                let bond = self.incident[v][i];
                if std::mem::replace(&mut self.seen[0][bond], self.now) != self.now {
                    total += self.bond_cost(bond);
                }
                total += self.corner_cost_once(self.net.across(bond, v));
            }
            total += self.corner_cost_once(v);
        }
        total + nodes.iter().map(|&v| self.intruders(v)).sum::<i64>()
    }
    fn index(&self, c: Cell) -> usize {
        (c[1] - self.corner[1]) as usize * self.size[0] as usize + (c[0] - self.corner[0]) as usize
    }
    fn ends(&self, bond: usize) -> [Cell; 2] {
        self.net.bonds[bond].map(|v| self.at[v])
    }
    fn draw_bond(&mut self, bond: usize) {
        let [a, b] = self.ends(bond);
        for c in line(a, b) {
            let cell = self.index(c);
            self.through[cell].push(bond as u32);
            self.work += 1;
        }
    }
    fn rub_out_bond(&mut self, bond: usize) {
        let [a, b] = self.ends(bond);
        for c in line(a, b) {
            let cell = self.index(c);
            let list = &mut self.through[cell];
            self.work += 1 + list.len() as u64 / 8;
            if let Some(i) = list.iter().position(|&x| x == bond as u32) {
                list.swap_remove(i);
            }
        }
    }
    /// Cost of a bond: its shape, what it crosses and what it passes.
    fn bond_cost(&mut self, bond: usize) -> i64 {
        let [from, to] = self.net.bonds[bond];
        let [a, b] = self.ends(bond);
        let mut total = self.shape_cost(bond);
        let mut crossed: Vec<u32> = Vec::new();
        for c in line(a, b) {
            let cell = self.index(c);
            self.work += 1 + self.through[cell].len() as u64;
            if let Some(v) = self.node[cell].map(|v| v as usize)
                && v != from
                && v != to
            {
                total += passing(self.at[v], a, b);
            }
            for &other in &self.through[cell] {
                let counted = self.seen[0][other as usize] == self.now && (other as usize) < bond;
                if other as usize != bond && !counted && !crossed.contains(&other) && self.cross(bond, other as usize) {
                    crossed.push(other);
                }
            }
        }
        total + 70 * crossed.len() as i64
    }
    /// Whether two bonds without a common end cross.
    fn cross(&self, one: usize, other: usize) -> bool {
        let [p, q] = [self.net.bonds[one], self.net.bonds[other]];
        if p.iter().any(|v| q.contains(v)) {
            return false;
        }
        let ([a, b], [c, d]) = (self.ends(one), self.ends(other));
        let side = |p, q, r| turn(p, q, r).signum();
        side(a, b, c) * side(a, b, d) < 0 && side(c, d, a) * side(c, d, b) < 0
    }
    /// Cost of length, slope and direction.
    fn shape_cost(&self, bond: usize) -> i64 {
        let [from, to] = self.net.bonds[bond];
        let [a, b] = self.ends(bond);
        let [dx, dy] = [i64::from(b[0] - a[0]), i64::from(b[1] - a[1])];
        let (long, short) = (dx.abs().max(dy.abs()), dx.abs().min(dy.abs()));
        let skew = if short == 0 { 0 } else { 8 * short + if short == long { 6 } else { 16 } };
        12 * (long - 1)
            + skew
            + if self.hangs[from] || self.hangs[to] { self.hang_cost(bond) } else { run_cost(dx, dy) }
    }
    /// Cost of the side on which a one-port hangs.
    fn hang_cost(&self, bond: usize) -> i64 {
        let [from, to] = self.net.bonds[bond];
        let (one, host) = if self.hangs[from] { (from, to) } else { (to, from) };
        let [dx, dy] = [self.at[one][0] - self.at[host][0], self.at[one][1] - self.at[host][1]];
        let source = self.net.nodes[one].role == Role::Source;
        if self.incident[host].len() == 1 {
            return i64::from(dy != 0 || dx < 0);
        }
        match (source, dx.signum(), dy.signum()) {
            (true, -1, 0) => 0,
            (true, 1, 0) => 3,
            (true, ..) => 1,
            (false, 0, -1) => 0,
            (false, 0, 1) => 1,
            (false, 1, _) => 2,
            (false, ..) => 3,
        }
    }
    fn corner_cost_once(&mut self, v: usize) -> i64 {
        if std::mem::replace(&mut self.seen[1][v], self.now) == self.now { 0 } else { self.corner_cost(v) }
    }
    /// Cost of bonds at one node that lie over or close to each other, and of a two-port that is not in line.
    fn corner_cost(&self, v: usize) -> i64 {
        let bonds = &self.incident[v];
        if bonds.len() < 2 || bonds.len() > 12 {
            return 0;
        }
        let here = self.at[v];
        let straight = |p, q| turn(here, p, q) == 0 && dot(here, p, q) < 0;
        let mut total = match (self.net.nodes[v].role, self.run[v]) {
            (Role::TwoPort, Some([p, q])) if !straight(self.at[p], self.at[q]) => 16,
            (_, Some([p, q])) if !straight(self.at[p], self.at[q]) => 7,
            _ => 0,
        };
        for (i, &one) in bonds.iter().enumerate() {
            let p = self.at[self.net.across(one, v)];
            for &other in &bonds[..i] {
                let q = self.at[self.net.across(other, v)];
                let across = turn(here, p, q);
                let along = dot(here, p, q);
                total += match (across == 0, along > 0) {
                    (true, true) if p != q => 60,
                    (false, true) if along > across.abs() => 10,
                    _ => 0,
                };
            }
        }
        total
    }
    /// Cost of foreign bonds through or close to the cell of a node.
    fn intruders(&self, v: usize) -> i64 {
        let through = self.through[self.index(self.at[v])].iter().map(|&b| b as usize);
        let foreign = through.filter(|&b| !self.net.bonds[b].contains(&v) && self.seen[0][b] != self.now);
        foreign.map(|b| passing(self.at[v], self.at[self.net.bonds[b][0]], self.at[self.net.bonds[b][1]])).sum()
    }
}

/// The two inner neighbours of a node, if it has exactly two.
fn run(net: &Network, incident: &[Vec<usize>], hangs: &[bool], v: usize) -> Option<[usize; 2]> {
    let mut near: Vec<usize> = incident[v].iter().map(|&b| net.across(b, v)).filter(|&u| u != v && !hangs[u]).collect();
    near.sort_unstable();
    near.dedup();
    near.try_into().ok()
}

/// Cost of the direction of an inner bond: horizontal to the right is best.
fn run_cost(dx: i64, dy: i64) -> i64 {
    match (dx.signum(), dy.signum()) {
        (1, 0) => 0,
        (0, 1) => 2,
        (1, _) => 1,
        _ => 3,
    }
}

/// Cost of a bond from `a` to `b` that passes a node at `p`.
fn passing(p: Cell, a: Cell, b: Cell) -> i64 {
    let length = dot(a, b, b);
    let away = turn(a, b, p);
    let along = dot(a, b, p);
    match () {
        _ if along < 0 || along > length => 0,
        _ if away == 0 => 90,
        _ if 4 * away * away < length => 30,
        _ if 16 * away * away <= 9 * length => 4,
        _ => 0,
    }
}

/// Twice the area of the triangle `p q r`, signed.
fn turn(p: Cell, q: Cell, r: Cell) -> i64 {
    let d = |a: i32, b: i32| i64::from(a) - i64::from(b);
    d(q[0], p[0]) * d(r[1], p[1]) - d(q[1], p[1]) * d(r[0], p[0])
}

/// The product of the steps from `p` to `q` and to `r`.
fn dot(p: Cell, q: Cell, r: Cell) -> i64 {
    let d = |a: i32, b: i32| i64::from(a) - i64::from(b);
    d(q[0], p[0]) * d(r[0], p[0]) + d(q[1], p[1]) * d(r[1], p[1])
}

/// The cells that a straight line passes, its ends included.
fn line(a: Cell, b: Cell) -> impl Iterator<Item = Cell> {
    let long = if (b[0] - a[0]).abs() >= (b[1] - a[1]).abs() { 0 } else { 1 };
    let (start, end) = if a[long] <= b[long] { (a, b) } else { (b, a) };
    let steps = end[long] - start[long];
    let rise = end[1 - long] - start[1 - long];
    (0..=steps).flat_map(move |i| {
        let cross = |half: i32| {
            let half = half.clamp(0, 2 * steps);
            if steps == 0 { 0 } else { (half * rise + steps).div_euclid(2 * steps) }
        };
        let (p, q) = (cross(2 * i - 1), cross(2 * i + 1));
        let (low, high) = (p.min(q), p.max(q));
        (low..=high).map(move |k| {
            let mut c = [0, 0];
            c[long] = start[long] + i;
            c[1 - long] = start[1 - long] + k;
            c
        })
    })
}
