//! Which start conditions belong together, and which unknown each guess is for.

use super::op::Op;
use super::values::{Reads, Values};
use super::{Position, Program, StartCondition, Value};
use rustc_hash::FxHashSet;
use std::collections::{BTreeMap, BTreeSet};

/// Start conditions that share unknowns.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct StartGroup {
    /// Indices into [`Program::start`], ascending.
    pub conditions: Vec<usize>,
    /// Indices of states and, after them, of conserved constants and of positions, ascending.
    pub unknowns: Vec<u32>,
}

impl Program {
    /// Constraints on displacements that states may miss, by their numbers among the start conditions: those that read
    /// computed positions hold by these.
    pub fn constraints_on_states(&self) -> impl Iterator<Item = (usize, &StartCondition)> {
        let first = (self.states.len() + self.conserved.len()) as u32;
        self.start.iter().enumerate().filter(move |(_, c)| c.firm && c.reads.iter().all(|&u| u < first))
    }

    /// Start conditions in groups that share no unknown: first those that read none, then by the least unknown.
    pub fn start_groups(&self) -> Vec<StartGroup> {
        let n = self.start_unknowns();
        let mut leader: Vec<u32> = (0..n as u32).collect();
        for pair in self.start.iter().flat_map(|c| c.reads.windows(2)) {
            let (a, b) = (find(&mut leader, pair[0]), find(&mut leader, pair[1]));
            leader[a.max(b) as usize] = a.min(b);
        }
        let mut groups: BTreeMap<Option<u32>, StartGroup> = BTreeMap::new();
        for (index, condition) in self.start.iter().enumerate() {
            let of = condition.reads.first().map(|&u| find(&mut leader, u));
            groups.entry(of).or_default().conditions.push(index);
        }
        for u in 0..n as u32 {
            if let Some(group) = groups.get_mut(&Some(find(&mut leader, u))) {
                group.unknowns.push(u);
            }
        }
        groups.into_values().collect()
    }
}

/// Whether a value is linear in states and positions: one step of Newton then tells where it vanishes.
pub(super) fn is_linear(values: &Values, positions: &[Position], value: Value) -> bool {
    let (mut open, mut seen) = (vec![value], FxHashSet::default());
    while let Some(v) = open.pop() {
        if values.reads(v) == Reads::PARAMETERS || !seen.insert(v) || positions.iter().any(|p| p.value == v) {
            continue;
        }
        let fixed = |v| values.reads(v) == Reads::PARAMETERS;
        match values.op(v) {
            Op::State(_) | Op::Conserved(_) => {}
            Op::Neg(a) => open.push(a),
            Op::Add(a, b) | Op::Sub(a, b) => open.extend([a, b]),
            Op::Mul(a, b) if fixed(a) => open.push(b),
            Op::Mul(a, b) | Op::Div(a, b) if fixed(b) => open.push(a),
            _ => return false,
        }
    }
    true
}

/// Where guesses go that read these unknowns, in the order in which they are placed: the number of the guess and its
/// unknown. A guess places the only unknown that it reads which is not placed yet, first those that read fewest, of these
/// those that are linear: what is guessed of an unknown itself goes before what others have it follow from. Where there is no
/// such guess, the first guess places the first such. Guesses for which no unknown is left are left out.
pub(super) fn place_guesses(reads: &[&[u32]], linear: &[bool]) -> Vec<(usize, u32)> {
    let mut left: Vec<usize> = (0..reads.len()).collect();
    let mut placed: BTreeSet<u32> = BTreeSet::new();
    let mut places = Vec::new();
    loop {
        let open = |guess: usize| reads[guess].iter().copied().filter(|u| !placed.contains(u));
        left.retain(|&g| open(g).next().is_some());
        if left.is_empty() {
            return places;
        }
        let telling = (0..left.len()).filter(|&at| open(left[at]).count() == 1);
        let fewest = telling.min_by_key(|&at| (reads[left[at]].len(), !linear[left[at]]));
        let guess = left.remove(fewest.unwrap_or(0));
        let unknown = open(guess).next().expect("one is open");
        placed.insert(unknown);
        places.push((guess, unknown));
    }
}

/// The least unknown of the group of one, with the way to it shortened.
fn find(leader: &mut [u32], mut u: u32) -> u32 {
    while leader[u as usize] != u {
        leader[u as usize] = leader[leader[u as usize] as usize];
        u = leader[u as usize];
    }
    u
}

#[cfg(test)]
mod tests {
    use super::place_guesses;

    #[test]
    fn a_guess_places_the_only_unknown_that_is_left() {
        let place = |reads: &[&[u32]]| place_guesses(reads, &vec![true; reads.len()]);
        assert_eq!(place(&[&[0, 1], &[1], &[]]), [(1, 1), (0, 0)]);
        assert_eq!(place(&[&[0, 1], &[0, 1], &[0]]), [(2, 0), (0, 1)]);
        assert_eq!(place(&[&[2, 3], &[2, 3]]), [(0, 2), (1, 3)]);
        assert_eq!(place(&[&[0], &[0, 1], &[1]]), [(0, 0), (2, 1)]);
        // An angle and a place that follows from it.
        assert_eq!(place_guesses(&[&[0], &[0], &[1]], &[false, true, true]), [(1, 0), (2, 1)]);
    }
}
