//! Which start conditions are solved one by one, and which together.

use std::collections::{BTreeMap, BTreeSet};

use halfarrow_compiler::program::{Program, StartGroup};

/// Conditions and unknowns of a group at most: what is solved together is dense.
pub(super) const MOST_TOGETHER: usize = 40;

/// Conditions in which one unknown is left, each with it.
pub(super) struct Pass {
    pub unknowns: Vec<u32>,
    pub conditions: Vec<usize>,
}

/// Conditions that share unknowns.
pub(super) struct Group {
    pub conditions: Vec<usize>,
    pub unknowns: Vec<u32>,
    /// How many of the conditions are given; those after them give way.
    pub given: usize,
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
    let group = |StartGroup { conditions, unknowns }: StartGroup| {
        let small = conditions.len().max(unknowns.len()) <= MOST_TOGETHER;
        // Freedom that was taken one by one may have to give way.
        let weak = conditions.iter().filter(|&&c| program.start[c].weak).count();
        let gives_way = weak > 0 && weak < conditions.len();
        let together = small && (gives_way || conditions.iter().any(|c| !met.contains(c)));
        let given = conditions.len() - weak;
        Group { conditions, unknowns, given, together }
    };
    let groups = program.start_groups().into_iter().map(group).collect();
    (passes, groups)
}
