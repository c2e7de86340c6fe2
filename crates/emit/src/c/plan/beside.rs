//! The columns of a Jacobian by rates beside a state: what these have in common is computed once.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

use halfarrow_compiler::ids::Id;
use halfarrow_compiler::program::elimination::products;
use halfarrow_compiler::program::{BlockId, Local, Method, Program, Routine, Step, Value};

use super::Plan;
use super::events::cases_of;
use super::routines::newton_of;
use crate::Real;
use crate::c::cost::OperationCount;
use crate::c::write::Place;
use crate::c::written::Written;

/// How many executions a line of code is worth that is not written.
const PRICE_OF_CODE: u64 = 2;

/// The part of all operations that are left at most, where code is written again for it.
const MOST_LEFT: f64 = 0.7;

/// Iterations of a Newton block, for an estimate.
const ITERATIONS: u64 = 3;

/// What rates beside a state have in common.
#[derive(Debug, Clone)]
pub(in crate::c) struct Beside {
    /// The part of the code that computes the rates of each group; none where nearly all of them is another one.
    pub parts: Vec<Option<usize>>,
    /// What stands behind the rates at the state.
    common: Vec<Value>,
    /// Newton blocks that are solved there.
    pub blocks: Vec<BlockId>,
    states: usize,
}

/// Its code: at the state, and that of each part.
#[derive(Debug, Clone)]
pub(super) struct BesideRoutines {
    pub common: Routine,
    pub parts: Vec<Routine>,
}

/// Groups of columns whose rates one routine computes.
#[derive(Debug, Clone)]
struct Part {
    groups: Vec<usize>,
    /// Which kinds of work these states ask for: all bits of what is asked for.
    kinds: Vec<u32>,
    work: u64,
}

impl Part {
    fn of(groups: Vec<usize>, kinds: Vec<u32>, works: &[u32]) -> Part {
        let work = kinds.iter().zip(works).map(|(asked, work)| asked & work).sum::<u32>().into();
        Part { groups, kinds, work }
    }

    fn with(&self, other: &Part, works: &[u32]) -> Part {
        let kinds = self.kinds.iter().zip(&other.kinds).map(|(a, b)| a | b).collect();
        Part::of([&self.groups[..], &other.groups].concat(), kinds, works)
    }

    fn price(&self) -> u64 {
        price(self.work, self.groups.len())
    }

    /// What is saved where both are one, if that saves something.
    fn saved_with(&self, other: &Part, works: &[u32]) -> Option<u64> {
        let asked = self.kinds.iter().zip(&other.kinds).zip(works);
        let work: u32 = asked.map(|((a, b), work)| (a | b) & work).sum();
        (self.price() + other.price()).checked_sub(price(work.into(), self.groups.len() + other.groups.len()))
    }
}

/// What it costs to compute so many groups of columns, and to have the code.
fn price(work: u64, groups: usize) -> u64 {
    work * (groups as u64 + PRICE_OF_CODE)
}

/// Puts parts together as long as that pays, those first that save most.
fn put_together(parts: Vec<Part>, works: &[u32]) -> Vec<Part> {
    // How often each has become another one: what was told of it before counts no more.
    let mut changes = vec![0; parts.len()];
    let mut parts: Vec<Option<Part>> = parts.into_iter().map(Some).collect();
    let mut pairs = BinaryHeap::new();
    let pair = |parts: &[Option<Part>], changes: &[u32], a: usize, b: usize| {
        let saved = parts[a].as_ref()?.saved_with(parts[b].as_ref()?, works)?;
        Some((saved, Reverse(b), Reverse(a), [changes[a], changes[b]]))
    };
    for b in 0..parts.len() {
        pairs.extend((0..b).filter_map(|a| pair(&parts, &changes, a, b)));
    }
    while let Some((_, Reverse(b), Reverse(a), told)) = pairs.pop() {
        if told != [changes[a], changes[b]] {
            continue;
        }
        let other = parts[b].take();
        parts[a] = parts[a].as_ref().zip(other.as_ref()).map(|(part, other)| part.with(other, works));
        [a, b].into_iter().for_each(|i| changes[i] += 1);
        let others = (0..parts.len()).filter(|i| *i != a);
        pairs.extend(others.filter_map(|i| pair(&parts, &changes, a.min(i), a.max(i))));
    }
    parts.into_iter().flatten().collect()
}

impl Beside {
    /// What the rates of a plan have in common beside a state, if that saves much. What is refined when it is sought again, as in
    /// single precision, is nothing that they have in common.
    pub(super) fn of(plan: &Plan, rates: &Routine) -> Option<(Beside, BesideRoutines)> {
        if !plan.compares_rates() || plan.export.real == Real::Float {
            return None;
        }
        let program = plan.program;
        let groups = plan.column_groups();
        let parts = parts_of(program, rates, &groups)?;
        let states =
            |part: &Part| part.groups.iter().flat_map(|&group| groups[group].iter().copied()).collect::<Vec<_>>();
        let found: Vec<_> =
            parts.iter().filter(|part| part.1).map(|(part, _)| program.rates_beside(&states(part))).collect();
        let mut common: Vec<Value> = found.iter().flat_map(|part| part.known.iter().copied()).collect();
        common.sort_unstable();
        common.dedup();
        let wanted: Vec<Value> = rates.wanted.iter().chain(&common).copied().collect();
        let routine = program.guarded_routine(&wanted);
        let blocks = newton_of(&routine.code).map(|solve| solve.block).collect();
        let mut of_group = vec![None; groups.len()];
        let written = parts.iter().filter(|part| part.1).enumerate();
        written.for_each(|(number, (part, _))| part.groups.iter().for_each(|&group| of_group[group] = Some(number)));
        let beside = Beside { parts: of_group, states: program.states.len(), common, blocks };
        Some((beside, BesideRoutines { common: routine, parts: found.into_iter().map(|part| part.rest).collect() }))
    }

    /// How many numbers are found at the state: the rates, and what they have in common beside it.
    pub fn size(&self) -> usize {
        self.states + self.common.len()
    }

    /// Where the latter stand.
    pub fn places(&self) -> impl Iterator<Item = (Value, Place)> + '_ {
        let places = (self.states..).map(|index| Place { array: "m->common", index });
        self.common.iter().copied().zip(places)
    }

    /// The cases of the function that calls the code of a part.
    pub fn cases(&self) -> Written {
        let parts = self.parts.iter().flatten().max().map_or(0, |last| last + 1);
        cases_of((0..parts).map(|part| (String::new(), code_of(part))))
    }
}

/// Groups of columns in parts, each with whether code of its own is written for it; none where that leaves too much of all operations.
fn parts_of(program: &Program, rates: &Routine, groups: &[Vec<usize>]) -> Option<Vec<(Part, bool)>> {
    // By which groups each step is moved.
    let mut moved = vec![vec![false; groups.len()]; rates.code.steps.len()];
    for (group, states) in groups.iter().enumerate() {
        let moves = program.moved_by_states(states);
        let is_moved = |out: &Local| rates.code.values[out.0 as usize].is_some_and(|value| moves[value.index()]);
        for (step, by) in rates.code.steps.iter().zip(&mut moved) {
            by[group] = step.defines().iter().any(is_moved);
        }
    }
    // Kinds of work: what the same groups move.
    let mut kinds: BTreeMap<Vec<bool>, u64> = BTreeMap::new();
    for (step, by) in rates.code.steps.iter().zip(moved) {
        *kinds.entry(by).or_default() += weight(program, step);
    }
    let all: u64 = kinds.values().sum();
    // Sums of them are no more.
    u32::try_from(all).ok()?;
    let works: Vec<u32> = kinds.values().map(|work| *work as u32).collect();
    let asked = |group: usize| kinds.keys().map(|by| if by[group] { u32::MAX } else { 0 }).collect();
    let own = |group: usize| Part::of(vec![group], asked(group), &works);
    let left = |work: u64| work as f64 / (all * groups.len() as u64) as f64;
    let apart: Vec<Part> = (0..groups.len()).map(own).collect();
    // Put together they take no less.
    if all == 0 || left(apart.iter().map(|part| part.work).sum()) > MOST_LEFT {
        return None;
    }
    let is_written = |part: &Part| part.price() < all * part.groups.len() as u64;
    let parts = put_together(apart, &works);
    let parts: Vec<(Part, bool)> = parts.into_iter().map(|part| (part.clone(), is_written(&part))).collect();
    let work: u64 = parts
        .iter()
        .map(|(part, is_written)| part.groups.len() as u64 * if *is_written { part.work } else { all })
        .sum();
    (left(work) <= MOST_LEFT).then_some(parts)
}

/// What a step takes, for an estimate.
fn weight(program: &Program, step: &Step) -> u64 {
    match step {
        Step::Solve(solve)
            if matches!(solve.method, Method::Linear { .. }) && program.blocks[solve.block].is_symmetric() =>
        {
            2 * products(&solve.pattern) as u64
        }
        _ => OperationCount::of_step(program, step).total(ITERATIONS),
    }
}

/// The name of the function of a part.
pub(super) fn code_of(part: usize) -> String {
    format!("ha_rates_part_{part}")
}
