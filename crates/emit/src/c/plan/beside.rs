//! The columns of a Jacobian by rates beside a state: what these have in common is computed once.

use std::cmp::Reverse;
use std::collections::BTreeMap;

use halfarrow_compiler::ids::Id;
use halfarrow_compiler::program::elimination::products;
use halfarrow_compiler::program::{BlockId, Method, Program, Routine, Step, Value};

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
    /// Which kinds of work these states ask for.
    kinds: Vec<bool>,
    work: u64,
}

impl Part {
    fn of(groups: Vec<usize>, kinds: Vec<bool>, works: &[u64]) -> Part {
        let work = kinds.iter().zip(works).filter(|(asked, _)| **asked).map(|(_, work)| work).sum();
        Part { groups, kinds, work }
    }

    fn with(&self, other: &Part, works: &[u64]) -> Part {
        let kinds = self.kinds.iter().zip(&other.kinds).map(|(a, b)| *a || *b).collect();
        Part::of([&self.groups[..], &other.groups].concat(), kinds, works)
    }

    /// What it costs to compute all its columns, and to have its code.
    fn price(&self) -> u64 {
        self.work * (self.groups.len() as u64 + PRICE_OF_CODE)
    }

    /// What is saved where both are one, if that saves something.
    fn saved_with(&self, other: &Part, works: &[u64]) -> Option<u64> {
        (self.price() + other.price()).checked_sub(self.with(other, works).price())
    }
}

/// Puts parts together as long as that pays, those first that save most.
fn put_together(parts: Vec<Part>, works: &[u64]) -> Vec<Part> {
    let mut parts: Vec<Option<Part>> = parts.into_iter().map(Some).collect();
    let saved = |parts: &[Option<Part>], a: usize, b: usize| parts[a].as_ref()?.saved_with(parts[b].as_ref()?, works);
    let row = |b: usize| (0..b).map(|a| saved(&parts, a, b)).collect();
    // What is saved by each pair: by the later one, then by the earlier one.
    let mut table: Vec<Vec<Option<u64>>> = (0..parts.len()).map(row).collect();
    loop {
        let pairs = (0..parts.len()).flat_map(|b| (0..b).map(move |a| (a, b)));
        let known = pairs.filter_map(|(a, b)| Some((table[b][a]?, (Reverse(b), Reverse(a)))));
        let Some((_, (Reverse(b), Reverse(a)))) = known.max() else { break };
        let other = parts[b].take();
        parts[a] = parts[a].as_ref().zip(other.as_ref()).map(|(part, other)| part.with(other, works));
        for i in (0..parts.len()).filter(|i| *i != a && *i != b) {
            table[a.max(i)][a.min(i)] = saved(&parts, a.min(i), a.max(i));
            table[b.max(i)][b.min(i)] = None;
        }
        table[b][a] = None;
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
        let (parts, left) = parts_of(program, rates, &groups)?;
        if left > MOST_LEFT {
            return None;
        }
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

/// Groups of columns in parts, each with whether code of its own is written for it, and the part of all operations that this leaves.
fn parts_of(program: &Program, rates: &Routine, groups: &[Vec<usize>]) -> Option<(Vec<(Part, bool)>, f64)> {
    // Kinds of work: by which groups move it.
    let moved: Vec<Vec<bool>> = groups.iter().map(|states| program.moved_by_states(states)).collect();
    let mut kinds: BTreeMap<Vec<bool>, u64> = BTreeMap::new();
    for step in &rates.code.steps {
        let values: Vec<Value> = step.defines().iter().filter_map(|out| rates.code.values[out.0 as usize]).collect();
        let by = moved.iter().map(|moved| values.iter().any(|v| moved[v.index()])).collect();
        *kinds.entry(by).or_default() += weight(program, step);
    }
    let works: Vec<u64> = kinds.values().copied().collect();
    let all: u64 = works.iter().sum();
    let own = |group: usize| Part::of(vec![group], kinds.keys().map(|by| by[group]).collect(), &works);
    let is_written = |part: &Part| part.price() < all * part.groups.len() as u64;
    let parts = put_together((0..groups.len()).map(own).collect(), &works);
    let parts: Vec<(Part, bool)> = parts.into_iter().map(|part| (part.clone(), is_written(&part))).collect();
    let work: u64 = parts
        .iter()
        .map(|(part, is_written)| part.groups.len() as u64 * if *is_written { part.work } else { all })
        .sum();
    (all > 0).then(|| (parts, work as f64 / (all * groups.len() as u64) as f64))
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
