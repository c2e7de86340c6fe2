//! The moves that a leaf allows at a state, as sparse equations: their size is that of the rows, and no basis is formed.

use super::open_equations::{Entry, OpenEquations, greatest};

/// Rows of a leaf at a state: quantities by states in parts of their sizes, and by drives.
pub(super) struct Tangent {
    pub rows: usize,
    pub states: usize,
    pub drives: usize,
    /// Row, state and value.
    pub moves: Vec<Entry>,
    /// Row, drive and value.
    pub by: Vec<Entry>,
}

impl Tangent {
    /// Of entries of which those in one place add up.
    pub fn new((rows, states, drives): (usize, usize, usize), moves: Vec<Entry>, by: Vec<Entry>) -> Tangent {
        Tangent { rows, states, drives, moves: added_up(moves), by: added_up(by) }
    }

    /// The same with a greatest move of 1 in each row, and what each drive does at most 1.
    pub fn balanced(mut self) -> Tangent {
        let rows = greatest(self.rows, self.moves.iter().map(|e| (e.0, e.2)));
        self.moves.iter_mut().chain(&mut self.by).for_each(|e| e.2 *= rows[e.0]);
        let drives = greatest(self.drives, self.by.iter().map(|e| (e.1, e.2)));
        self.by.iter_mut().for_each(|e| e.2 *= drives[e.1]);
        self
    }

    /// How far the drives, each by 1, take every state that stands in a row with them; 0 where they do not.
    pub fn reaches(&self) -> Vec<f64> {
        let mut most = vec![0.0f64; self.rows];
        self.by.iter().for_each(|&(row, _, c)| most[row] = most[row].max(c.abs()));
        let mut reaches = vec![0.0f64; self.states];
        for &(row, state, v) in self.moves.iter().filter(|e| e.2 != 0.0) {
            reaches[state] = reaches[state].max(most[row] / v.abs());
        }
        reaches
    }

    /// What of a direction is in the leaf: the nearest `y` to it with `moves · y = by · drives`.
    pub fn within(&self, direction: &[f64]) -> Option<Vec<f64>> {
        let unit = (0..self.states).map(|i| (i, i, 1.0));
        let equations = self.equations(unit, direction.iter().copied());
        Some(equations.solve(self.states)?.x)
    }

    /// Square equations for a move in the leaf: these for the states, but for a part that no move in the leaf can take up.
    pub fn equations(&self, entries: impl Iterator<Item = Entry>, right: impl Iterator<Item = f64>) -> OpenEquations {
        // Unknowns: the move, the drives, and the part beside the leaf as a combination of the rows.
        let (drives, rows) = (self.states, self.states + self.drives);
        let moves = self.moves.iter().flat_map(|&(i, j, v)| [(rows + i, j, v), (j, rows + i, v)]);
        let by = self.by.iter().flat_map(|&(i, k, v)| [(rows + i, drives + k, -v), (drives + k, rows + i, -v)]);
        let nothing = std::iter::repeat_n(0.0, self.drives + self.rows);
        OpenEquations { entries: entries.chain(moves).chain(by).collect(), right: right.chain(nothing).collect() }
    }
}

/// Entries in the order of their places, one in each.
fn added_up(mut entries: Vec<Entry>) -> Vec<Entry> {
    entries.sort_by_key(|e| (e.0, e.1));
    entries.dedup_by(|next, own| {
        let same = (next.0, next.1) == (own.0, own.1);
        if same {
            own.2 += next.2;
        }
        same
    });
    entries
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An angle and a spring behind a lever of 2 move by one speed: of a direction what is along (1, 2) is left.
    #[test]
    fn the_nearest_move_is_taken() {
        let (moves, by) = (vec![(0, 0, 1.0), (1, 1, 1.0)], vec![(0, 0, 1.0), (1, 0, 2.0)]);
        let tangent = Tangent::new((2, 3, 1), moves, by).balanced();
        let inside = tangent.within(&[1.0, 0.0, 7.0]).expect("regular");
        assert!(inside.iter().zip([0.2, 0.4, 7.0]).all(|(a, b)| (a - b).abs() < 1e-14), "{inside:?}");
    }
}
