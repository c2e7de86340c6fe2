//! Improvement by small moves: a move is kept if it makes the drawing better, or worse by less than a threshold that
//! sinks to zero (threshold accepting). Integers and a fixed sequence of pseudo-random numbers: the same everywhere.

use super::board::Board;
use super::{Cell, Network, parts};

/// Upper bound on the moves tried, whatever the size of the graph.
const MOVES: usize = 300_000;
/// Upper bound on the cells and bonds looked at in one round.
const WORK: u64 = 60_000_000;
/// Largest graph that is drawn in a moment: fewer moves find as good a drawing.
const SMALL: usize = 16;
/// Largest graph whose branches are moved as a whole.
const BRANCHED: usize = 400;

/// Improves a placement of a connected graph.
pub fn improve(net: &Network, start: Vec<Cell>) -> Vec<Cell> {
    let n = net.nodes.len();
    let branches = if n <= BRANCHED { branches(net) } else { Vec::new() };
    let tries = (n * if n <= SMALL { 200 } else { 1500 }).min(MOVES);
    let mut best: Option<(i64, Vec<Cell>)> = None;
    let mut again = 0;
    for (round, &threshold) in thresholds(n).iter().enumerate() {
        let Some(mut board) = Board::new(net, start.clone()) else { return start };
        anneal(&mut board, &branches, tries, Dice::new(round), threshold);
        let all: Vec<usize> = (0..n).collect();
        let cost = board.cost(&all);
        match &best {
            Some((least, _)) if cost == *least => again += 1,
            Some((least, _)) if cost > *least => {}
            _ => (best, again) = (Some((cost, board.at)), 0),
        }
        // Found three times from different sides: it will hardly get better.
        if again == 2 {
            break;
        }
    }
    best.map_or(start, |b| b.1)
}

/// The worst deterioration accepted at the start of each round.
fn thresholds(nodes: usize) -> &'static [i64] {
    match nodes {
        _ if nodes <= SMALL => &[24, 48, 24, 48, 72, 72],
        0..=24 => &[0, 24, 48, 48, 48, 72],
        25..=60 => &[0, 12, 24, 48],
        61..=BRANCHED => &[0, 16],
        _ => &[0],
    }
}

/// A part of the graph that hangs at one node.
struct Branch {
    pivot: usize,
    nodes: Vec<usize>,
}

/// All parts that one node holds, except whole one-ports, up to half of the graph each.
fn branches(net: &Network) -> Vec<Branch> {
    let n = net.nodes.len();
    let mut found = Vec::new();
    for pivot in 0..n {
        let rest: Vec<[usize; 2]> = net.bonds.iter().filter(|b| !b.contains(&pivot)).copied().collect();
        let parts = parts(n, &rest).into_iter().filter(|p| p[..] != [pivot]);
        let small = parts.filter(|p| p.len() > 1 && 2 * p.len() <= n + 1);
        found.extend(small.map(|nodes| Branch { pivot, nodes }));
    }
    found
}

/// Tries moves while the threshold sinks, squeezes out what room is left, and tries on.
fn anneal(board: &mut Board, branches: &[Branch], tries: usize, mut dice: Dice, start: i64) {
    let warm = tries * 6 / 10;
    for i in 0..tries {
        if i == warm && board.net.nodes.len() <= BRANCHED {
            squeeze(board);
        }
        if board.work > WORK {
            break;
        }
        let threshold = start * warm.saturating_sub(i) as i64 / warm.max(1) as i64;
        if let Some(moves) = propose(board, branches, &mut dice) {
            attempt(board, &moves, threshold);
        }
    }
}

/// Pushes columns and rows together wherever that makes the drawing no worse.
fn squeeze(board: &mut Board) {
    for axis in 0..2 {
        let mut lines: Vec<i32> = board.at.iter().map(|c| c[axis]).collect();
        lines.sort_unstable();
        lines.dedup();
        for &line in lines.iter().skip(1).rev() {
            let beyond: Vec<usize> = (0..board.at.len()).filter(|&v| board.at[v][axis] >= line).collect();
            let mut by = [0, 0];
            by[axis] = -1;
            while carry(board, &beyond, |c| [c[0] + by[0], c[1] + by[1]])
                .is_some_and(|m| board.keeps_blocks(&m) && attempt(board, &m, 0))
            {}
        }
    }
}

/// Makes a move and takes it back if it costs too much.
fn attempt(board: &mut Board, moves: &[(usize, Cell)], threshold: i64) -> bool {
    let nodes: Vec<usize> = moves.iter().map(|m| m.0).collect();
    let back: Vec<(usize, Cell)> = nodes.iter().map(|&v| (v, board.at[v])).collect();
    let before = board.cost(&nodes);
    board.place(moves);
    let kept = board.cost(&nodes) - before <= threshold;
    if !kept {
        board.place(&back);
    }
    kept
}

/// A random move: one node, two nodes swapped, a node with its one-ports, a block of equal ones, or a branch.
fn propose(board: &Board, branches: &[Branch], dice: &mut Dice) -> Option<Vec<(usize, Cell)>> {
    let v = dice.below(board.net.nodes.len());
    if board.incident[v].len() > 24 {
        return None;
    }
    let moves = match dice.below(8) {
        0..=2 if board.block[v].is_some() && !branches.is_empty() => {
            pull(board, &branches[dice.below(branches.len())], dice)
        }
        _ if board.block[v].is_some() => shift(board, v, dice),
        0 | 1 => cluster(board, v, dice),
        2 if !branches.is_empty() => swing(board, &branches[dice.below(branches.len())], dice),
        _ => single(board, v, dice),
    };
    moves.filter(|moves| board.keeps_blocks(moves))
}

/// A block to where one of its nodes is in line with a neighbour outside, or a few cells on.
fn shift(board: &Board, v: usize, dice: &mut Dice) -> Option<Vec<(usize, Cell)>> {
    let block = board.block[v]?;
    let near = board.incident[v].iter().map(|&b| board.net.across(b, v)).find(|&u| board.block[u] != Some(block));
    let by = match (near, dice.below(3)) {
        (Some(u), 0 | 1) => {
            let far = 1 + dice.below(2) as i32;
            let [x, y] = [[far, 0], [-far, 0], [0, far], [0, -far]][dice.below(4)];
            [board.at[u][0] + x - board.at[v][0], board.at[u][1] + y - board.at[v][1]]
        }
        _ => [dice.step(2), dice.step(2)],
    };
    let nodes: Vec<usize> = (0..board.at.len()).filter(|&u| board.block[u] == Some(block)).collect();
    carry(board, &nodes, |c| [c[0] + by[0], c[1] + by[1]])
}

/// One node to a cell near one of its neighbours; if that is taken, the two change places.
fn single(board: &Board, v: usize, dice: &mut Dice) -> Option<Vec<(usize, Cell)>> {
    let bonds = &board.incident[v];
    let bond = *bonds.get(dice.below(bonds.len().max(1)))?;
    let near = board.at[board.net.across(bond, v)];
    let to = match dice.below(4) {
        0 => [near[0] + dice.step(2), near[1] + dice.step(2)],
        1 => [board.at[v][0] + dice.step(1), board.at[v][1] + dice.step(1)],
        _ => {
            let [x, y] = [[1, 0], [-1, 0], [0, 1], [0, -1]][dice.below(4)];
            [near[0] + x, near[1] + y]
        }
    };
    if to == board.at[v] || !board.holds(to) {
        return None;
    }
    match board.node_in(to) {
        None => Some(vec![(v, to)]),
        Some(u) if board.incident[u].len() <= 24 => Some(vec![(v, to), (u, board.at[v])]),
        Some(_) => None,
    }
}

/// A node with the one-ports at it, by a few cells.
fn cluster(board: &Board, v: usize, dice: &mut Dice) -> Option<Vec<(usize, Cell)>> {
    let by = [dice.step(2), dice.step(2)];
    let ones = board.incident[v].iter().map(|&b| board.net.across(b, v)).filter(|&u| board.hangs(u) && u != v);
    let nodes: Vec<usize> = ones.chain([v]).collect();
    carry(board, &nodes, |c| [c[0] + by[0], c[1] + by[1]])
}

/// A branch turned or mirrored about the node that holds it, or moved by a cell.
fn swing(board: &Board, branch: &Branch, dice: &mut Dice) -> Option<Vec<(usize, Cell)>> {
    let [px, py] = board.at[branch.pivot];
    let way = dice.below(10);
    let by = [[1, 0], [-1, 0], [0, 1], [0, -1]][way % 4];
    carry(board, &branch.nodes, |[x, y]| {
        let [x, y] = [x - px, y - py];
        let [x, y] = match way {
            0 => [-x, y],
            1 => [x, -y],
            2 => [-x, -y],
            3 => [y, x],
            4 => [-y, x],
            5 => [y, -x],
            _ => [x + by[0], y + by[1]],
        };
        [x + px, y + py]
    })
}

/// A branch to where it begins next to the node that holds it.
fn pull(board: &Board, branch: &Branch, dice: &mut Dice) -> Option<Vec<(usize, Cell)>> {
    let near = board.incident[branch.pivot].iter().map(|&b| board.net.across(b, branch.pivot));
    let first = near.into_iter().find(|u| branch.nodes.binary_search(u).is_ok())?;
    let far = 1 + dice.below(3) as i32;
    let [x, y] = [[far, 0], [-far, 0], [0, far], [0, -far]][dice.below(4)];
    let [from, to] = [board.at[first], board.at[branch.pivot]];
    carry(board, &branch.nodes, |c| [c[0] + to[0] + x - from[0], c[1] + to[1] + y - from[1]])
}

/// Moves these nodes (many: in order) together, if all target cells are free or left by them.
fn carry(board: &Board, nodes: &[usize], to: impl Fn(Cell) -> Cell) -> Option<Vec<(usize, Cell)>> {
    let moves: Vec<(usize, Cell)> = nodes.iter().map(|&v| (v, to(board.at[v]))).collect();
    let moved = |u: usize| if nodes.len() < 24 { nodes.contains(&u) } else { nodes.binary_search(&u).is_ok() };
    let free = |c: Cell| board.holds(c) && board.node_in(c).is_none_or(moved);
    moves.iter().all(|m| free(m.1)).then_some(moves)
}

/// A fixed sequence of pseudo-random numbers (xorshift64*).
struct Dice(u64);

impl Dice {
    fn new(round: usize) -> Dice {
        Dice(0x9E37_79B9_7F4A_7C15 ^ (round as u64 + 1).wrapping_mul(0xD134_2543_DE82_EF95))
    }
    fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        ((self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 33) % n as u64) as usize
    }
    /// From `-most` to `most`.
    fn step(&mut self, most: i32) -> i32 {
        self.below(2 * most as usize + 1) as i32 - most
    }
}
