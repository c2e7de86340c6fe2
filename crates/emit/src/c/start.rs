//! Which start conditions are solved one by one, and which together.

use std::collections::{BTreeMap, BTreeSet};

use halfarrow_compiler::program::Program;

/// Conditions and unknowns of a group at most: what is solved together is dense.
pub(super) const MOST_TOGETHER: usize = 40;

/// Conditions in which one unknown is left, each with it.
pub(super) struct Pass {
    pub unknowns: Vec<u32>,
    pub conditions: Vec<usize>,
}

/// Conditions that share unknowns.
#[derive(Default)]
pub(super) struct Group {
    pub conditions: Vec<usize>,
    pub unknowns: Vec<u32>,
    /// Whether some of them may have to be solved together.
    pub together: bool,
}

/// The passes of the interpreter where each of them succeeds, then the groups.
pub(super) fn plan(program: &Program) -> (Vec<Pass>, Vec<Group>) {
    let mut known: BTreeSet<u32> = BTreeSet::new();
    let mut met: BTreeSet<usize> = BTreeSet::new();
    let mut passes = Vec::new();
    loop {
        let mut chosen: BTreeMap<u32, usize> = BTreeMap::new();
        for (index, condition) in program.start.iter().enumerate() {
            let mut open = condition.reads.iter().filter(|u| !known.contains(u));
            if let (Some(&only), None) = (open.next(), open.next()) {
                chosen.entry(only).or_insert(index);
            }
        }
        if chosen.is_empty() {
            break;
        }
        known.extend(chosen.keys());
        met.extend(chosen.values());
        let (unknowns, conditions) = chosen.into_iter().unzip();
        passes.push(Pass { unknowns, conditions });
    }
    let mut groups = groups(program);
    for group in &mut groups {
        let small = group.conditions.len().max(group.unknowns.len()) <= MOST_TOGETHER;
        group.together = small && group.conditions.iter().any(|c| !met.contains(c));
    }
    (passes, groups)
}

fn groups(program: &Program) -> Vec<Group> {
    let n = program.states.len() + program.conserved.len();
    let mut leader: Vec<u32> = (0..n as u32).collect();
    fn find(leader: &mut [u32], mut u: u32) -> u32 {
        while leader[u as usize] != u {
            leader[u as usize] = leader[leader[u as usize] as usize];
            u = leader[u as usize];
        }
        u
    }
    for pair in program.start.iter().flat_map(|c| c.reads.windows(2)) {
        let (a, b) = (find(&mut leader, pair[0]), find(&mut leader, pair[1]));
        leader[a.max(b) as usize] = a.min(b);
    }
    let mut groups: BTreeMap<Option<u32>, Group> = BTreeMap::new();
    for (index, condition) in program.start.iter().enumerate() {
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
