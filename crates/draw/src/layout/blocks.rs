//! Equal parts of a graph as blocks of cells that move as one.

use std::collections::{BTreeSet, HashSet};

use super::{Cell, Network, Node, Role, Room};

/// A part with the places of what it is bonded to outside, so that its bonds there stay free.
pub fn with_ends(net: &Network, part: &[usize]) -> Network {
    let room = Room { west: 10.0, east: 10.0, north: 10.0, south: 10.0 };
    let mut own = Network { nodes: part.iter().map(|&v| net.nodes[v].clone()).collect(), ..Network::default() };
    let index = |v: usize| part.iter().position(|&u| u == v);
    for bond in &net.bonds {
        let mut end = || {
            own.nodes.push(Node { role: Role::Open, room: [room; 4] });
            own.nodes.len() - 1
        };
        match bond.map(index) {
            [Some(a), Some(b)] => own.bonds.push([a, b]),
            [Some(a), None] => {
                let end = end();
                own.bonds.push([a, end]);
            }
            [None, Some(b)] => {
                let end = end();
                own.bonds.push([end, b]);
            }
            [None, None] => {}
        }
    }
    own
}

/// For every node the block it is in, and the number of nodes of each block.
pub fn membership(net: &Network) -> (Vec<Option<usize>>, Vec<usize>) {
    let mut block = vec![None; net.nodes.len()];
    let mut sizes = Vec::new();
    for part in net.alike.iter().flatten() {
        part.iter().for_each(|&v| block[v] = Some(sizes.len()));
        sizes.push(part.len());
    }
    (block, sizes)
}

/// Gives the nodes of equal parts the shape of their group, in a placement that gets the room for it.
pub fn gather(net: &Network, shapes: &[Vec<Cell>], mut cells: Vec<Cell>) -> Vec<Cell> {
    if net.alike.is_empty() {
        return cells;
    }
    let shapes: Vec<Vec<Cell>> =
        shapes.iter().zip(&net.alike).map(|(s, group)| close_up(&s[..group[0].len()])).collect();
    let widest = shapes.iter().flatten().flatten().copied().max().unwrap_or(0);
    let apart = 2 * widest + 3;
    let (block, _) = membership(net);
    let incident = net.incident();
    let hosts = net.hosts(&incident);
    let old = std::mem::take(&mut cells);
    cells = old.iter().map(|c| [apart * c[0], apart * c[1]]).collect();
    for (shape, group) in shapes.iter().zip(&net.alike) {
        for part in group {
            let first = cells[middle(net, &incident, part)];
            part.iter().zip(shape).for_each(|(&v, c)| cells[v] = [first[0] + c[0], first[1] + c[1]]);
        }
    }
    // One-ports of other nodes stay beside them.
    let mut taken: HashSet<Cell> = cells.iter().copied().collect();
    for v in 0..cells.len() {
        let Some(host) = hosts[v].filter(|u| block[v].is_none() && block[*u].is_none()) else { continue };
        let near = [0, 1].map(|k| cells[host][k] + (old[v][k] - old[host][k]).clamp(-1, 1));
        if taken.insert(near) {
            cells[v] = near;
        }
    }
    close_up(&cells)
}

/// The node of a part with most bonds to the outside: where the part is held.
fn middle(net: &Network, incident: &[Vec<usize>], part: &[usize]) -> usize {
    let outside = |v: usize| incident[v].iter().filter(|&&b| !part.contains(&net.across(b, v))).count();
    part.iter().copied().max_by_key(|&v| (outside(v), std::cmp::Reverse(v))).unwrap_or(part[0])
}

/// The same cells without empty columns and rows, from 0.
fn close_up(cells: &[Cell]) -> Vec<Cell> {
    let used = [0, 1].map(|k| cells.iter().map(|c| c[k]).collect::<BTreeSet<i32>>().into_iter().collect::<Vec<i32>>());
    let place = |c: &Cell| [0, 1].map(|k| used[k].partition_point(|x| *x < c[k]) as i32);
    cells.iter().map(place).collect()
}
