//! Where everything stands: a bond graph drawn as a textbook would draw it.
//!
//! The junction structure lies on a grid, in line where it is a chain and as a rectangle where it is a ring; one-ports
//! stand around their junction in the free compass directions; bonds are straight. A first placement in layers
//! (`start`) is improved by small moves (`improve`), then rows and columns get the room that the labels need
//! (`space`). All choices are made in integers, so the same graph gives the same picture everywhere.

mod board;
mod improve;
mod parts;
mod space;
mod start;

pub use parts::parts;

/// A graph to lay out.
#[derive(Debug, Clone, Default)]
pub struct Network {
    /// The nodes.
    pub nodes: Vec<Node>,
    /// The bonds, from and to; the half arrow is at the second. Parallel bonds and bonds from a node to itself are
    /// allowed.
    pub bonds: Vec<[usize; 2]>,
}

/// A node, as far as the layout is concerned.
#[derive(Debug, Clone)]
pub struct Node {
    /// How it wants to stand.
    pub role: Role,
    /// Room that its glyph and text take around its anchor, for each side that its neighbour can be on
    /// (index: [`Side`] as `usize`). Inner nodes have four equal entries.
    pub room: [Room; 4],
}

/// How a node wants to stand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// A junction or a field: bonds in all directions.
    Centre,
    /// Its two bonds want to be in line.
    TwoPort,
    /// A one-port that gives power, at the start of a chain if possible.
    Source,
    /// Any other one-port, above or below its junction if possible.
    OnePort,
}

/// A compass direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// To the right.
    East,
    /// Up.
    North,
    /// To the left.
    West,
    /// Down.
    South,
}

/// Room around an anchor, in px.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Room {
    /// To the left.
    pub west: f64,
    /// To the right.
    pub east: f64,
    /// Up.
    pub north: f64,
    /// Down.
    pub south: f64,
}

/// Where everything stands.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Placement {
    /// Anchor of every node, in px, y downwards.
    pub anchors: Vec<[f64; 2]>,
    /// For every node the side on which its neighbour is (its first, if it has several).
    pub facing: Vec<Side>,
    /// Whether the text of a one-port above or below its neighbour stands to the left of its anchor: `room` mirrored.
    pub mirrored: Vec<bool>,
    /// Size of the whole, in px; every node with its room lies between 0 and this.
    pub size: [f64; 2],
}

/// A cell of the grid: column, row.
type Cell = [i32; 2];

/// Lays out a graph. Deterministic; the effort grows linearly with the size beyond a few hundred nodes.
pub fn lay_out(net: &Network) -> Placement {
    let whole = parts(net.nodes.len(), &net.bonds);
    let laid = whole.iter().map(|part| (part, lay_out_part(&part_of(net, part)))).collect::<Vec<_>>();
    pack(net.nodes.len(), &laid)
}

/// Lays out a connected graph.
fn lay_out_part(net: &Network) -> Placement {
    let cells = improve::improve(net, start::start(net));
    space::space(net, &cells)
}

/// The part of `net` on these nodes, renumbered in their order.
fn part_of(net: &Network, part: &[usize]) -> Network {
    if part.len() == net.nodes.len() {
        return net.clone();
    }
    let mut index = vec![usize::MAX; net.nodes.len()];
    part.iter().enumerate().for_each(|(i, &v)| index[v] = i);
    let inside = |b: &&[usize; 2]| index[b[0]] != usize::MAX;
    Network {
        nodes: part.iter().map(|&v| net.nodes[v].clone()).collect(),
        bonds: net.bonds.iter().filter(inside).map(|b| [index[b[0]], index[b[1]]]).collect(),
    }
}

/// Sets separate parts beside and below each other, like words on a page.
fn pack(nodes: usize, laid: &[(&Vec<usize>, Placement)]) -> Placement {
    const GAP: f64 = 36.0;
    let (anchors, facing, mirrored) = (vec![[0.0; 2]; nodes], vec![Side::East; nodes], vec![false; nodes]);
    let mut whole = Placement { anchors, facing, mirrored, size: [0.0; 2] };
    let widest = laid.iter().map(|(_, p)| p.size[0]).fold(0.0, f64::max);
    let area: f64 = laid.iter().map(|(_, p)| (p.size[0] + GAP) * (p.size[1] + GAP)).sum();
    let line = widest.max((1.6 * area).sqrt());
    let [mut x, mut y, mut height] = [0.0_f64; 3];
    for (part, placed) in laid {
        if x > 0.0 && x + placed.size[0] > line {
            (x, y, height) = (0.0, y + height + GAP, 0.0);
        }
        for (i, &v) in part.iter().enumerate() {
            whole.anchors[v] = [placed.anchors[i][0] + x, placed.anchors[i][1] + y];
            whole.facing[v] = placed.facing[i];
            whole.mirrored[v] = placed.mirrored[i];
        }
        whole.size = [whole.size[0].max(x + placed.size[0]), whole.size[1].max(y + placed.size[1])];
        x += placed.size[0] + GAP;
        height = height.max(placed.size[1]);
    }
    whole
}

impl Network {
    /// The bonds at every node.
    fn incident(&self) -> Vec<Vec<usize>> {
        let mut at = vec![Vec::new(); self.nodes.len()];
        for (b, ends) in self.bonds.iter().enumerate() {
            at[ends[0]].push(b);
            if ends[1] != ends[0] {
                at[ends[1]].push(b);
            }
        }
        at
    }
    /// The other end of a bond.
    fn across(&self, bond: usize, node: usize) -> usize {
        let [from, to] = self.bonds[bond];
        if from == node { to } else { from }
    }
    /// For every one-port that hangs at another node: that node. At a pair of one-ports the first is the centre.
    fn hosts(&self, incident: &[Vec<usize>]) -> Vec<Option<usize>> {
        let host = |v: usize| {
            let [bond] = incident[v][..] else { return None };
            let u = self.across(bond, v);
            let pair = incident[u].len() == 1;
            let centre = |w: usize| matches!(self.nodes[w].role, Role::Centre | Role::TwoPort);
            let keeps = u == v || (pair && (centre(v), u) > (centre(u), v));
            (!keeps).then_some(u)
        };
        (0..self.nodes.len()).map(host).collect()
    }
}

impl Room {
    /// The same room with left and right exchanged.
    fn mirrored(self) -> Room {
        Room { west: self.east, east: self.west, ..self }
    }
}

impl Side {
    /// The side that a step of columns and rows goes to; diagonal steps go to the side.
    fn of(step: Cell) -> Side {
        if step[1].abs() > step[0].abs() {
            if step[1] < 0 { Side::North } else { Side::South }
        } else if step[0] < 0 {
            Side::West
        } else {
            Side::East
        }
    }
}

#[cfg(test)]
mod tests;
