//! Which start conditions belong together, and which unknown each guess is for.

use std::collections::{BTreeMap, BTreeSet};

use super::{Program, StartGuess};

/// Start conditions that share unknowns.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct StartGroup {
    /// Indices into [`Program::start`], ascending.
    pub conditions: Vec<usize>,
    /// Indices of states and, after them, of conserved constants, ascending.
    pub unknowns: Vec<u32>,
}

impl Program {
    /// Start conditions in groups that share no unknown: first those that read none, then by the least unknown.
    pub fn start_groups(&self) -> Vec<StartGroup> {
        let n = self.states.len() + self.conserved.len();
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

    /// Gives each guess the unknown that it places: the only one that it reads which is not placed yet; where there is no
    /// such guess, the first one of the first guess. Brings the guesses into this order and leaves out those for which no
    /// unknown is left.
    pub(super) fn place_guesses(&mut self) {
        let mut left = std::mem::take(&mut self.guesses);
        let mut placed: BTreeSet<u32> = BTreeSet::new();
        loop {
            let open = |g: &StartGuess| g.reads.iter().filter(|u| !placed.contains(u)).count();
            left.retain(|g| open(g) > 0);
            if left.is_empty() {
                return;
            }
            let mut guess = left.remove(left.iter().position(|g| open(g) == 1).unwrap_or(0));
            guess.unknown = *guess.reads.iter().find(|u| !placed.contains(u)).expect("one is open");
            placed.insert(guess.unknown);
            self.guesses.push(guess);
        }
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
