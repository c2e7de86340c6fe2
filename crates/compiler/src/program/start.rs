//! Which start conditions belong together.

use std::collections::BTreeMap;

use super::Program;

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
}

/// The least unknown of the group of one, with the way to it shortened.
fn find(leader: &mut [u32], mut u: u32) -> u32 {
    while leader[u as usize] != u {
        leader[u as usize] = leader[leader[u as usize] as usize];
        u = leader[u as usize];
    }
    u
}
