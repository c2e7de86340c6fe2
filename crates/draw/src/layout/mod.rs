//! Where everything stands: a bond graph drawn as a textbook would draw it.
//!
//! The junction structure lies on a grid, in line where it is a chain and as a rectangle where it is a ring; one-ports
//! stand around their junction in the free compass directions; bonds are straight. A first placement in layers
//! (`start`) is improved by small moves (`improve`), then rows and columns get the room that the labels need
//! (`space`). All choices are made in integers, so the same graph gives the same picture everywhere.

mod beside;
mod blocks;
mod board;
mod improve;
mod parts;
mod space;
mod start;

pub use beside::place_beside;
pub use parts::parts;

/// A graph to lay out.
#[derive(Debug, Clone, Default)]
pub struct Network {
    /// The nodes.
    pub nodes: Vec<Node>,
    /// The bonds, from and to; the half arrow is at the second. Parallel bonds and bonds from a node to itself are
    /// allowed.
    pub bonds: Vec<[usize; 2]>,
    /// Groups of equal parts, which are laid out alike: for each group its parts, for each part its nodes in the same
    /// order. No node is in two of them; each part is connected.
    pub alike: Vec<Vec<Vec<usize>>>,
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
    /// The place of something outside: a bond goes on there.
    Open,
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
    /// Upper left corner of the whole, in px; 0, 0 unless something was placed before.
    pub corner: [f64; 2],
    /// Size of the whole, in px; every node with its room lies between the corner and this far from it.
    pub size: [f64; 2],
}

/// A cell of the grid: column, row.
type Cell = [i32; 2];

/// Lays out a graph. Deterministic; the effort grows linearly with the size beyond a few hundred nodes.
pub fn lay_out(net: &Network) -> Placement {
    Plan::new(net).placement(1.0)
}

/// Lays out a graph of which some nodes have a place already, in px: these stay there. If there are none, everything is
/// laid out anew.
pub fn layout(net: &Network, pinned: &[Option<[f64; 2]>]) -> Placement {
    match pinned.iter().any(Option::is_some) {
        true => place_beside(net, pinned),
        false => lay_out(net),
    }
}

/// A graph on a grid, before it gets its measures.
pub struct Plan {
    nodes: usize,
    /// The connected parts: their nodes, each part as a graph, its cells.
    parts: Vec<(Vec<usize>, Network, Vec<Cell>)>,
}

impl Plan {
    /// Puts every node into a cell.
    pub fn new(net: &Network) -> Plan {
        let cells = |nodes: Vec<usize>| {
            let part = part_of(net, &nodes);
            let cells = cells(&part);
            (nodes, part, cells)
        };
        Plan { nodes: net.nodes.len(), parts: parts(net.nodes.len(), &net.bonds).into_iter().map(cells).collect() }
    }
    /// Turns cells into px; bonds get more room by this factor.
    pub fn placement(&self, wider: f64) -> Placement {
        let laid: Vec<_> =
            self.parts.iter().map(|(nodes, net, cells)| (nodes, space::space(net, cells, wider))).collect();
        pack(self.nodes, &laid)
    }
}

/// The cells of a connected graph: equal parts first, then all together.
fn cells(net: &Network) -> Vec<Cell> {
    let start = start::start(net);
    let shapes: Vec<Vec<Cell>> = net.alike.iter().map(|group| cells(&blocks::with_ends(net, &group[0]))).collect();
    let start = blocks::gather(net, &shapes, start);
    improve::improve(net, start)
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
        alike: alike_in(net, &index),
    }
}

/// The groups of equal parts that lie in a part of the graph, by the new numbers of its nodes.
fn alike_in(net: &Network, index: &[usize]) -> Vec<Vec<Vec<usize>>> {
    let inside = |nodes: &&Vec<usize>| nodes.iter().all(|&v| index[v] != usize::MAX);
    let renumbered = |nodes: &Vec<usize>| nodes.iter().map(|&v| index[v]).collect();
    let group = |group: &Vec<Vec<usize>>| group.iter().filter(inside).map(renumbered).collect::<Vec<Vec<usize>>>();
    net.alike.iter().map(group).filter(|group| !group.is_empty()).collect()
}

/// Sets separate parts beside and below each other, like words on a page.
fn pack(nodes: usize, laid: &[(&Vec<usize>, Placement)]) -> Placement {
    const GAP: f64 = 36.0;
    let (anchors, facing, mirrored) = (vec![[0.0; 2]; nodes], vec![Side::East; nodes], vec![false; nodes]);
    let mut whole = Placement { anchors, facing, mirrored, corner: [0.0; 2], size: [0.0; 2] };
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
            let keeps = u == v || self.nodes[v].role == Role::Open || (pair && (centre(v), u) > (centre(u), v));
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
