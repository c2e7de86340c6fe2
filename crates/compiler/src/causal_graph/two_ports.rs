//! Wide two-ports: which equation gives which of the variables that strokes leave to the element.

use crate::bond_graph::TwoPortRow;

/// What an equation of a wide two-port gives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Given {
    /// The variable that it is written for.
    Own,
    /// The variable of one of its terms, divided by its coefficient.
    Term(usize),
}

/// What each equation gives, where the strokes ask for it: a matching, with its own variable if possible. `sets_effort` tells
/// of a port whether the element sets the effort there, `None` without a stroke. `None` for an equation that gives nothing.
pub fn given(rows: &[TwoPortRow], sets_effort: &dyn Fn(usize) -> Option<bool>) -> Vec<Option<Given>> {
    let own = |row: &TwoPortRow| sets_effort(row.port) == Some(row.effort);
    let mut given: Vec<Option<Given>> = rows.iter().map(|row| own(row).then_some(Given::Own)).collect();
    let ports = rows.iter().flat_map(|r| r.terms.iter().map(|t| t.0).chain([r.port])).max().map_or(0, |p| p + 1);
    let mut taken: Vec<Option<usize>> = vec![None; ports];
    let left: Vec<usize> = (0..rows.len()).filter(|&row| given[row].is_none()).collect();
    for row in left {
        take(rows, sets_effort, row, &mut taken, &mut vec![false; ports]);
    }
    for (port, row) in taken.iter().enumerate() {
        if let Some(row) = *row {
            given[row] = rows[row].terms.iter().position(|t| t.0 == port).map(Given::Term);
        }
    }
    given
}

/// Finds a term for a row, if need be by giving other rows other ones. Ports are told apart by their numbers alone: a row of
/// flows and a row of efforts never want the same one, since the element sets one of the two there.
fn take(
    rows: &[TwoPortRow],
    sets_effort: &dyn Fn(usize) -> Option<bool>,
    row: usize,
    taken: &mut [Option<usize>],
    tried: &mut [bool],
) -> bool {
    for &(port, _) in &rows[row].terms {
        if sets_effort(port) != Some(rows[row].of_efforts) || std::mem::replace(&mut tried[port], true) {
            continue;
        }
        if taken[port].is_none_or(|other| take(rows, sets_effort, other, taken, tried)) {
            taken[port] = Some(row);
            return true;
        }
    }
    false
}
