//! What values depend on, exactly: from the operations that compute them.

use std::collections::BTreeSet;

use halfarrow_compiler::bond_graph::HeldKind;
use halfarrow_compiler::ids::Id;
use halfarrow_compiler::program::{Op, Program, Target, Trigger, Value};

/// What values read, through everything between.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Knowns {
    pub time: bool,
    pub states: BTreeSet<u32>,
    pub inputs: BTreeSet<u32>,
    pub parameters: BTreeSet<u32>,
    pub conserved: BTreeSet<u32>,
    /// Positions that iterations determine: which of several they are follows from the start.
    pub positions: BTreeSet<usize>,
}

impl Knowns {
    fn add(&mut self, other: &Knowns) {
        self.time |= other.time;
        self.states.extend(&other.states);
        self.inputs.extend(&other.inputs);
        self.parameters.extend(&other.parameters);
        self.conserved.extend(&other.conserved);
        self.positions.extend(&other.positions);
    }
}

/// What some values read together. A delayed or sampled signal comes from an earlier time: of it only time is read.
pub(super) fn knowns_of(p: &Program, wanted: &[Value]) -> Knowns {
    let mut knowns = Knowns::default();
    let mut seen = vec![false; p.values.len()];
    let mut open: Vec<Value> = wanted.to_vec();
    while let Some(v) = open.pop() {
        if std::mem::replace(&mut seen[v.index()], true) {
            continue;
        }
        match p.values.op(v) {
            Op::Time => knowns.time = true,
            Op::State(i) => {
                knowns.states.insert(i);
            }
            Op::Input(i) => {
                knowns.inputs.insert(i);
            }
            Op::Conserved(i) => {
                knowns.conserved.insert(i);
            }
            Op::Parameter(i) => {
                knowns.parameters.insert(i);
                open.push(p.parameters[i as usize].default);
            }
            Op::Held(i) => knowns.time |= p.held[i as usize].kind == HeldKind::Delay,
            Op::Solution(block, _) => {
                knowns.positions.extend(p.positions.iter().position(|position| position.value == v));
                open.extend(p.blocks[block].reads());
            }
            Op::Guess(..) | Op::Constant(_) | Op::Rate(_) => {}
            op => op.for_each_operand(|v| open.push(v)),
        }
    }
    knowns
}

/// What each unknown of the start (states, then conserved constants, then positions) follows from: the start conditions,
/// and guesses, that it shares with others.
pub(super) fn starts(p: &Program) -> Vec<Knowns> {
    let n = p.start_unknowns();
    let mut leader: Vec<usize> = (0..n).collect();
    fn find(leader: &[usize], mut u: usize) -> usize {
        while leader[u] != u {
            u = leader[u];
        }
        u
    }
    let reads = p.start.iter().map(|c| &c.reads).chain(p.guesses.iter().map(|g| &g.reads));
    for pair in reads.flat_map(|reads| reads.windows(2)) {
        let (a, b) = (find(&leader, pair[0] as usize), find(&leader, pair[1] as usize));
        leader[a.max(b)] = a.min(b);
    }
    let mut groups = vec![Knowns::default(); n];
    for condition in &p.start {
        if let Some(&first) = condition.reads.first() {
            let knowns = knowns_of(p, &[condition.residual, condition.asked]);
            groups[find(&leader, first as usize)].add(&knowns);
        }
    }
    for guess in &p.guesses {
        groups[find(&leader, guess.unknown as usize)].add(&knowns_of(p, &[guess.residual]));
    }
    // Held signals start with what the start makes of them: all of it.
    if !p.held.is_empty() {
        let sources: Vec<Value> = p.held.iter().map(|h| h.source).collect();
        let reads_held = |g: &Knowns| g.time;
        let held = knowns_of(p, &sources);
        groups.iter_mut().filter(|g| reads_held(g)).for_each(|g| g.add(&held));
    }
    let given = |u: usize| {
        let mut knowns = groups[find(&leader, u)].clone();
        (knowns.states, knowns.conserved, knowns.positions) = Default::default();
        knowns
    };
    let mut starts: Vec<Knowns> = (0..n).map(given).collect();
    let at_events = at_start(p, &starts, &events_at_start(p));
    changed_at_events(p).into_iter().for_each(|u| starts[u as usize].add(&at_events));
    starts
}

/// What is read by what happens at the start: events with a period, and those that follow from them.
fn events_at_start(p: &Program) -> Vec<Value> {
    if !p.clauses.iter().any(|c| matches!(c.trigger, Trigger::Every(_))) {
        return Vec::new();
    }
    p.clauses.iter().flat_map(|c| c.values()).chain(p.jumps.iter().flat_map(|j| j.values())).collect()
}

/// The states and conserved constants that events can change.
fn changed_at_events(p: &Program) -> Vec<u32> {
    let signals = p.clauses.iter().flat_map(|c| &c.actions).filter_map(|a| match a.target {
        Target::Signal(state) => Some(state),
        _ => None,
    });
    signals.chain(p.jumps.iter().flat_map(|j| j.unknowns.iter().copied())).collect()
}

/// What values depend on at the start: inputs, parameters, time, with what states and held signals start from.
pub(super) fn at_start(p: &Program, starts: &[Knowns], wanted: &[Value]) -> Knowns {
    let mut knowns = knowns_of(p, wanted);
    if !p.held.is_empty() {
        let sources: Vec<Value> = p.held.iter().map(|h| h.source).collect();
        let held = knowns_of(p, &sources);
        knowns.add(&held);
        if p.held.iter().any(|h| h.kind.is_discrete()) {
            knowns.add(&knowns_of(p, &events_at_start(p)));
        }
    }
    let (states, conserved) = (std::mem::take(&mut knowns.states), std::mem::take(&mut knowns.conserved));
    let first = p.states.len();
    let positions = std::mem::take(&mut knowns.positions).into_iter().map(|k| first + p.conserved.len() + k);
    let conserved = conserved.iter().map(|&i| first + i as usize);
    for u in states.iter().map(|&i| i as usize).chain(conserved).chain(positions) {
        knowns.add(&starts[u]);
    }
    knowns
}
