//! Definitions as sparse as the constitutive rows of the elements.
//!
//! Elimination finds the dependent variables, but fills its last rows in: the force at the root of a chain becomes a sum over
//! all its links. Once the dependent variables are known, each row of the junction structure is matched to one of them that
//! occurs in it, and defines it as it stands. Where such definitions depend on each other cyclically (a ring of junctions),
//! elimination is confined to the rows of that cycle. The blocks are those of the block triangular form (Duff and Reid, ACM Transactions on Mathematical Software 4, 1978).

use std::collections::{BTreeMap, BTreeSet};

use petgraph::algo::tarjan_scc;
use petgraph::graph::DiGraph;

use super::ports::{regular_rows, settled};
use crate::algebra::{Elimination, Eliminator, Expr, Exprs, NumericPoint, ONE, Residue, SparseRow, eliminate};
use crate::sparse::Matching;

/// A column as a linear combination of others.
pub(super) type Row = (usize, Vec<(usize, Expr)>);

/// Each pivot column of an elimination as a combination of other columns, from the original rows. `None` if that requires a
/// divisor that is neither known to be nonzero nor a divisor of the elimination.
pub(super) fn matched_rows(x: &mut Exprs, rows: &[SparseRow], done: &Elimination) -> Option<Vec<Row>> {
    let rows: Vec<&SparseRow> = done.pivots.iter().map(|p| &rows[p.source]).collect();
    let row_of = matching(x, &rows, done, false)?;
    let mut definitions = Vec::with_capacity(row_of.len());
    for columns in blocks(&rows, &row_of) {
        match columns[..] {
            [column] => definitions.push((column, solved_for(x, rows[row_of[&column]], column))),
            _ => {
                let own = columns.iter().map(|column| rows[row_of[column]].clone()).collect();
                definitions.extend(circle_solved(x, own, columns, done)?);
            }
        }
    }
    Some(definitions)
}

/// The columns of a block, each with the row of the junction structure that it is matched to.
pub(super) type Block = Vec<(usize, SparseRow)>;

/// Definitions block by block.
pub(super) struct BlockRows {
    pub rows: Vec<Row>,
    /// Blocks of several columns, as the elements write their rows.
    pub loops: Vec<Block>,
    /// What the blocks are divided by; none of them may vanish.
    pub divisors: Vec<Expr>,
    /// The values of the divisors, of either sign.
    residues: BTreeSet<Residue>,
}

impl BlockRows {
    /// Adds a divisor, unless it is one of them up to its sign: the loops of efforts and of flows have one in common.
    fn add(&mut self, x: &mut Exprs, divisor: Expr) {
        let opposite = x.neg(divisor);
        let residue = x.residue(divisor);
        if residue.is_none_or(|residue| !self.residues.contains(&residue)) {
            self.residues.extend(residue.into_iter().chain(x.residue(opposite)));
            self.divisors.push(divisor);
        }
    }
}

/// Each pivot column of an elimination as a combination of columns of its block, of blocks before it and of columns that are
/// no pivots. The determinant of the whole is the product of those of the blocks, so that what they are divided by is what
/// has to be watched: each loop of a chain has a divisor of its own. `None` also if a block has more than `most` columns. Pivots are such as are not small at `point`, as far as there are any.
pub(super) fn block_rows(
    x: &mut Exprs,
    rows: &[SparseRow],
    done: &Elimination,
    most: usize,
    point: Option<&NumericPoint>,
) -> Option<BlockRows> {
    let rows: Vec<&SparseRow> = done.pivots.iter().map(|p| &rows[p.source]).collect();
    let row_of = matching(x, &rows, done, true)?;
    let mut found = BlockRows {
        rows: Vec::with_capacity(row_of.len()),
        loops: Vec::new(),
        divisors: Vec::new(),
        residues: BTreeSet::new(),
    };
    let blocks = blocks(&rows, &row_of);
    if blocks.iter().any(|columns| columns.len() > most) {
        return None;
    }
    let mut point = point.cloned();
    for mut columns in blocks {
        columns.sort_unstable();
        let own: Vec<&SparseRow> = columns.iter().map(|column| rows[row_of[column]]).collect();
        let before = (columns.len() > 1).then(|| x.assumed());
        if columns.len() > 1 {
            found.loops.push(columns.iter().copied().zip(own.iter().map(|&row| row.clone())).collect());
        }
        // A block takes what its own columns take, however many there are in all.
        let (read, own) = numbered(&own);
        let own_columns: Vec<usize> = columns.iter().filter_map(|column| read.binary_search(column).ok()).collect();
        let mut work = Eliminator::new(x, own, read.len()).near(point.take());
        work.eliminate(x, &own_columns);
        point = work.take_point();
        let own = work.finish();
        if own.pivots.len() < columns.len() || !own.degenerate.is_empty() {
            return None;
        }
        let named = |(column, row): Row| (read[column], row.into_iter().map(|(k, e)| (read[k], e)).collect());
        // A single pivot is no quotient.
        let regular = before.and_then(|before| Some((x.if_found(|x| regular_rows(x, &own))?, before)));
        match regular {
            Some((regular, before)) => {
                // Of the pivots only the product is watched: another block may not take them as known.
                x.forget_unwatched(&before);
                x.assume_nonzero(regular.determinant);
                found.add(x, regular.determinant);
                found.rows.extend(own.pivots.iter().zip(regular.rows).map(|(pivot, row)| named((pivot.column, row.0))));
            }
            None => {
                own.watched.iter().for_each(|&divisor| found.add(x, divisor));
                let solved = own.pivots.iter().map(|pivot| (pivot.column, solved_for(x, &pivot.row, pivot.column)));
                found.rows.extend(solved.map(named));
            }
        }
    }
    Some(found)
}

/// The columns that rows read, ascending, and the rows with columns by their places among these.
pub(super) fn numbered<E: Copy>(rows: &[&SparseRow<E>]) -> (Vec<usize>, Vec<SparseRow<E>>) {
    let mut read: Vec<usize> = rows.iter().flat_map(|row| row.0.iter().map(|e| e.0)).collect();
    read.sort_unstable();
    read.dedup();
    let place = |column: usize| read.binary_search(&column).expect("a row reads it");
    let own = rows.iter().map(|row| SparseRow(row.0.iter().map(|&(c, e)| (place(c), e)).collect())).collect();
    (read, own)
}

/// The columns of every cycle of matched rows, those first that others read.
pub(super) fn blocks<E>(rows: &[&SparseRow<E>], row_of: &BTreeMap<usize, usize>) -> Vec<Vec<usize>> {
    let mut graph = DiGraph::<usize, ()>::new();
    let nodes: BTreeMap<usize, _> = row_of.keys().map(|&column| (column, graph.add_node(column))).collect();
    for (column, &row) in row_of {
        let read = rows[row].0.iter().filter(|e| e.0 != *column).filter_map(|e| nodes.get(&e.0));
        read.for_each(|&read| _ = graph.add_edge(nodes[column], read, ()));
    }
    let columns = |circle: Vec<_>| circle.into_iter().map(|node| graph[node]).collect();
    tarjan_scc(&graph).into_iter().map(columns).collect()
}

/// The columns of a cycle, each as a combination of later ones and of columns outside.
fn circle_solved(x: &mut Exprs, rows: Vec<SparseRow>, mut columns: Vec<usize>, done: &Elimination) -> Option<Vec<Row>> {
    columns.sort_unstable();
    let own = eliminate(x, rows, &[columns.clone()]);
    let as_before = own.watched.iter().all(|e| done.watched.contains(e));
    if own.pivots.len() < columns.len() || !as_before || own.degenerate.iter().any(|e| !done.degenerate.contains(e)) {
        return None;
    }
    Some(own.pivots.iter().map(|pivot| (pivot.column, solved_for(x, &pivot.row, pivot.column))).collect())
}

/// A column as a combination of the others in its row.
fn solved_for(x: &mut Exprs, row: &SparseRow, column: usize) -> Vec<(usize, Expr)> {
    let divisor = row.0.iter().find(|e| e.0 == column).map_or(ONE, |e| e.1);
    let mut terms = Vec::with_capacity(row.0.len() - 1);
    for &(other, e) in row.0.iter().filter(|e| e.0 != column) {
        let quotient = if divisor == ONE { e } else { x.div(e, divisor) };
        terms.push((other, settled(x, quotient)));
    }
    terms
}

/// An entry of a row, its column by the number of its pivot.
struct Edge {
    row: usize,
    column: usize,
    coefficient: Expr,
}

/// A matching of rows to pivot columns in which each coefficient is a number, or else the divisor of the elimination, or else
/// a nonzero parameter, or else, if `any` may be matched, one that is not always zero. `None` if there is no complete
/// matching.
fn matching(x: &Exprs, rows: &[&SparseRow], done: &Elimination, any: bool) -> Option<BTreeMap<usize, usize>> {
    let place: BTreeMap<usize, usize> = done.pivots.iter().enumerate().map(|(i, p)| (p.column, i)).collect();
    let constant = |e: Expr| !x.depends_on_any(e, &|s| x.facts(s).given.is_none());
    let levels: [&dyn Fn(&Edge) -> bool; 4] = [
        &|edge| x.is_number(edge.coefficient).is_some(),
        &|edge| edge.row == edge.column && edge.coefficient == done.pivots[edge.row].divisor,
        &|edge| constant(edge.coefficient) && x.nonzero(edge.coefficient),
        &|edge| !x.is_zero(edge.coefficient),
    ];
    let mut allowed: Vec<Vec<usize>> = vec![Vec::new(); rows.len()];
    let mut found = Matching::new(rows.len());
    for level in &levels[..if any { 4 } else { 3 }] {
        for (row, entries) in rows.iter().enumerate() {
            for &(column, coefficient) in &entries.0 {
                let Some(&column) = place.get(&column) else { continue };
                if !allowed[row].contains(&column) && level(&Edge { row, column, coefficient }) {
                    allowed[row].push(column);
                }
            }
            if found.column_of[row].is_none() && found.row_of[row].is_none() && allowed[row].contains(&row) {
                found.join(row, row);
            }
        }
        found.complete(&allowed);
    }
    let all: Option<Vec<usize>> = found.row_of.into_iter().collect();
    Some(done.pivots.iter().map(|p| p.column).zip(all?).collect())
}
