//! A first placement: the junction structure in layers from one end to the other, long ones folded like a text into
//! lines, and one-ports in free cells around their junction.

use std::collections::{HashSet, VecDeque};

use super::{Cell, Network, Role};

/// Longest line of layers before it is folded.
const LINE: usize = 20;

/// A first placement of a connected graph: one cell a node, no cell twice.
pub fn start(net: &Network) -> Vec<Cell> {
    let incident = net.incident();
    let hosts = net.hosts(&incident);
    let inner: Vec<usize> = (0..net.nodes.len()).filter(|&v| hosts[v].is_none()).collect();
    let near: Vec<Vec<usize>> = neighbours(net, &incident, &hosts);
    let layers = order(&near, layer(net, &near, &inner));
    let mut cells = vec![[0, 0]; net.nodes.len()];
    spread(&layers, &near, &mut cells);
    hang(net, &hosts, &near, &mut cells);
    cells
}

/// Distinct inner neighbours of every inner node, in order.
fn neighbours(net: &Network, incident: &[Vec<usize>], hosts: &[Option<usize>]) -> Vec<Vec<usize>> {
    let of = |v: usize| {
        let mut near: Vec<usize> = incident[v].iter().map(|&b| net.across(b, v)).collect();
        near.retain(|&u| hosts[u].is_none() && u != v);
        near.sort_unstable();
        near.dedup();
        near
    };
    (0..net.nodes.len()).map(|v| if hosts[v].is_none() { of(v) } else { Vec::new() }).collect()
}

/// Layers by distance from one end of the graph, turned so that most half arrows point onwards.
fn layer(net: &Network, near: &[Vec<usize>], inner: &[usize]) -> Vec<Vec<usize>> {
    let far = |from: usize| *distances(near, from).1.last().expect("the start itself");
    let end = far(far(inner[0]));
    let (distance, reached) = distances(near, end);
    let mut layers = vec![Vec::new(); distance[*reached.last().expect("the end itself")] + 1];
    reached.iter().for_each(|&v| layers[distance[v]].push(v));
    let onwards = |b: &[usize; 2]| match [distance[b[0]], distance[b[1]]] {
        [usize::MAX, _] | [_, usize::MAX] => 0,
        [a, b] => (a < b) as i64 - (a > b) as i64,
    };
    if net.bonds.iter().map(onwards).sum::<i64>() < 0 {
        layers.reverse();
    }
    layers
}

/// Distances from a node (`usize::MAX` if not reached), and the nodes in the order in which they are reached.
fn distances(near: &[Vec<usize>], from: usize) -> (Vec<usize>, Vec<usize>) {
    let mut distance = vec![usize::MAX; near.len()];
    distance[from] = 0;
    let mut reached = vec![from];
    let mut queue = VecDeque::from([from]);
    while let Some(v) = queue.pop_front() {
        for &u in &near[v] {
            if distance[u] == usize::MAX {
                distance[u] = distance[v] + 1;
                reached.push(u);
                queue.push_back(u);
            }
        }
    }
    (distance, reached)
}

/// Orders each layer by the mean place of its neighbours, a few times to and fro.
fn order(near: &[Vec<usize>], mut layers: Vec<Vec<usize>>) -> Vec<Vec<usize>> {
    let mut place = vec![0.0_f64; near.len()];
    let settle = |layer: &[usize], place: &mut [f64]| {
        let middle = (layer.len() as f64 - 1.0) / 2.0;
        layer.iter().enumerate().for_each(|(i, &v)| place[v] = i as f64 - middle);
    };
    layers.iter().for_each(|l| settle(l, &mut place));
    for sweep in 0..8 {
        for step in 0..layers.len() {
            let l = if sweep % 2 == 0 { step } else { layers.len() - 1 - step };
            let mean = |v: usize| near[v].iter().map(|&u| place[u]).sum::<f64>() / near[v].len().max(1) as f64;
            let mut keyed: Vec<(f64, usize)> = layers[l].iter().map(|&v| (mean(v), v)).collect();
            keyed.sort_by(|a, b| a.0.total_cmp(&b.0));
            layers[l] = keyed.into_iter().map(|(_, v)| v).collect();
            settle(&layers[l], &mut place);
        }
    }
    layers
}

/// Gives the inner nodes their cells: layers become columns, each node near the row of its earlier neighbours.
fn spread(layers: &[Vec<usize>], near: &[Vec<usize>], cells: &mut [Cell]) {
    const ROWS: i32 = 3;
    let tallest = ((layers.iter().map(Vec::len).sum::<usize>() as f64).sqrt() * 1.2).ceil().max(8.0) as usize;
    let mut columns: Vec<&[usize]> = Vec::new();
    layers.iter().for_each(|l| columns.extend(l.chunks(tallest)));
    let mut row: Vec<Option<i32>> = vec![None; near.len()];
    for column in &columns {
        let wish = |v: usize, row: &[Option<i32>]| {
            let known: Vec<i32> = near[v].iter().filter_map(|&u| row[u]).collect();
            if known.is_empty() { 0 } else { known.iter().sum::<i32>().div_euclid(known.len() as i32) }
        };
        let wishes: Vec<i32> = column.iter().map(|&v| wish(v, &row)).collect();
        let mut rows: Vec<i32> = Vec::new();
        for w in &wishes {
            rows.push(rows.last().map_or(*w, |r| (*w).max(r + ROWS)));
        }
        let shift = wishes.iter().zip(&rows).map(|(w, r)| w - r).sum::<i32>().div_euclid(rows.len() as i32);
        column.iter().zip(rows).for_each(|(&v, r)| row[v] = Some(r + shift));
    }
    fold(&columns, &row, cells);
}

/// Folds a long row of columns into lines, to and fro, so that neighbours stay neighbours.
fn fold(columns: &[&[usize]], row: &[Option<i32>], cells: &mut [Cell]) {
    let height = |c: &[usize]| {
        let rows = || c.iter().filter_map(|&v| row[v]);
        [rows().min().unwrap_or(0), rows().max().unwrap_or(0)]
    };
    let tall = columns.iter().map(|c| height(c)[1] - height(c)[0] + 4).max().unwrap_or(4) as usize;
    let line = LINE.max((columns.len() as f64 * tall as f64 * 1.2).sqrt().ceil() as usize);
    let lines = columns.len().div_ceil(line);
    let line = columns.len().div_ceil(lines);
    let mut top = 0;
    for (l, part) in columns.chunks(line).enumerate() {
        let lowest = part.iter().map(|c| height(c)[0]).min().unwrap_or(0);
        let highest = part.iter().map(|c| height(c)[1]).max().unwrap_or(0);
        for (i, column) in part.iter().enumerate() {
            let x = if l % 2 == 0 { i } else { line - 1 - i } as i32;
            for &v in *column {
                cells[v] = [x, row[v].unwrap_or(0) - lowest + top];
            }
        }
        top += highest - lowest + 4;
    }
}

/// Puts the one-ports into free cells around their hosts: above and below first, then at the sides, then further out.
fn hang(net: &Network, hosts: &[Option<usize>], near: &[Vec<usize>], cells: &mut [Cell]) {
    let mut taken: HashSet<Cell> = HashSet::new();
    let mut hung: Vec<Vec<usize>> = vec![Vec::new(); near.len()];
    for (v, host) in hosts.iter().enumerate() {
        match host {
            Some(u) => hung[*u].push(v),
            None => _ = taken.insert(cells[v]),
        }
    }
    for (u, ones) in hung.iter_mut().enumerate() {
        ones.sort_by_key(|&v| (net.nodes[v].role != Role::Source, v));
        let mut free = around();
        for &v in ones.iter() {
            let step = |c: Cell| [cells[u][0] + c[0], cells[u][1] + c[1]];
            let cell = free.by_ref().map(step).find(|c| !taken.contains(c)).expect("the plane has free cells");
            taken.insert(cell);
            cells[v] = cell;
        }
    }
}

/// Steps to all cells around one, near ones first.
fn around() -> impl Iterator<Item = Cell> {
    let first = [[0, -1], [0, 1], [-1, 0], [1, 0], [-1, -1], [1, -1], [-1, 1], [1, 1]];
    let ring = |r: i32| {
        let side = move |d: i32| [[d, -r], [d, r], [-r, d], [r, d]];
        (-r..=r).flat_map(side)
    };
    first.into_iter().chain((2..).flat_map(ring))
}
