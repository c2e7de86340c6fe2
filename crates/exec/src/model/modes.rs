//! The mode of set-valued laws: which branch each of them has. A mode is kept until a branch ends; then a mode is sought in
//! which no branch has ended, from what storages keep, by exchanging the branch with the least number that has (Murty's
//! principal pivoting), and where that leads in a circle or to a mode that cannot be, by the number of exchanges.
//! Source: K. G. Murty, Note on a Bard-type scheme for solving the complementarity problem, Opsearch 11 (1974).

use super::Model;
use super::clause_memory::{ClauseMemory, Condition};
use super::compiled::ModeId;
use crate::bytecode::{Hold, Layout, Routine};
use halfarrow_compiler::algebra::Symbol;
use halfarrow_compiler::program::{Bound, Clause, ConditionId, EventTrigger, Op, Program, Target, Value};
use halfarrow_sim::Failure;
use std::collections::{BTreeMap, BTreeSet, VecDeque};

/// Modes that are tried at one instant at most.
const MOST_TRIED: usize = 2000;
/// Exchanges beyond which no mode is sought any more once one is known to which storages leap.
const FAR: usize = 2;
/// A margin that is zero, as part of the greatest that it has been.
const ROUNDING: f64 = 1e-9;
/// What rounding may leave of a sum that is zero, as part of its greatest term.
const NOISE: f64 = 1e-13;
/// By what sides of a contact may overlap where a run begins, as part of what their displacements are.
const OVERLAP: f64 = 1e-9;
/// A margin below zero by less, as part of the greatest that it has been, has not ended.
const FLOOR: f64 = 1e-12;
/// The rate with which sides meet that do not part again, as part of the greatest that the gap has had.
const AT_REST: f64 = 1e-9;
/// What storages change by without a leap, as part of the most that they have kept.
const NO_LEAP: f64 = 1e-7;

/// The bounds of the branches of a mode.
#[derive(Debug, Clone)]
pub(super) struct Bounds {
    /// Each with the number of its clause and its place among the margins; the rate of a gap stands behind it.
    all: Vec<(usize, Bound, Option<usize>)>,
    /// Of each the condition that its margin is below zero.
    conditions: Vec<Option<ConditionId>>,
    /// Computes the margins.
    margins: Routine,
    /// The branches of the mode.
    branches: Vec<u32>,
    /// Margins of all branches: law, branch and number of the bound, and what computes them.
    keys: Vec<(u32, u32, usize)>,
    everywhere: Routine,
}

impl Bounds {
    pub fn of(program: &Program, layout: &Layout) -> Option<Bounds> {
        if program.set_valued.is_empty() {
            return None;
        }
        let bounds = program.clauses.iter().enumerate().filter_map(|(i, c)| Some((i, c.bound?)));
        let mut values: Vec<Value> = Vec::new();
        let place = |(clause, bound): (usize, Bound)| {
            let place = bound.margin.map(|margin| {
                values.push(margin);
                let place = values.len() - 1;
                values.extend(bound.gap.map(|(rate, _)| rate));
                place
            });
            (clause, bound, place)
        };
        let all: Vec<(usize, Bound, Option<usize>)> = bounds.map(place).collect();
        let condition = |clause: usize| match program.values.op(program.clauses[clause].trigger.value()) {
            Op::Sign(condition, _) => Some(condition).filter(|c| program.conditions[*c].trigger == EventTrigger::State),
            _ => None,
        };
        let conditions = all.iter().map(|(clause, bound, _)| bound.margin.and_then(|_| condition(*clause))).collect();
        let branches = program.set_valued.iter().map(|law| law.present).collect();
        let laws = program.set_valued.iter().enumerate();
        let everywhere =
            laws.flat_map(|(law, l)| l.margins.iter().map(move |&(b, n, m)| ((law as u32, b, n as usize), m)));
        let (keys, found): (Vec<(u32, u32, usize)>, Vec<Value>) = everywhere.unzip();
        let everywhere = layout.routine(program, &found);
        Some(Bounds { all, conditions, margins: layout.routine(program, &values), branches, keys, everywhere })
    }

    pub fn routines(&self) -> impl Iterator<Item = &Routine> {
        [&self.margins, &self.everywhere].into_iter()
    }
}

/// What a run remembers of set-valued laws: how great things have been.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Extents {
    /// Of margins, of their rates and of the rates of these, by law, branch and bound.
    margins: BTreeMap<(u32, u32, usize), [f64; 3]>,
    /// Of what storages keep.
    stored: BTreeMap<Symbol, f64>,
    /// Of states, by the variables that they are.
    states: BTreeMap<Symbol, f64>,
}

/// Where a run stands when its mode ends.
struct Instant<'m> {
    model: &'m Model,
    t: f64,
    x: &'m [f64],
    values: BTreeMap<Symbol, f64>,
    stored: BTreeMap<Symbol, f64>,
}

/// A model in another mode, and its state there.
type Entered = Box<(Model, Vec<f64>)>;

/// A mode that has been tried.
enum Tried {
    /// It can be: the model in it, the state there, and by how much storages leap.
    Fits(Entered, f64),
    /// These branches have ended in it: the law with the branch beyond.
    Ended(Vec<(u32, u32)>),
    /// It has no equations, or none that can be entered.
    Impossible,
}

impl Model {
    /// Goes on in another mode if a branch of a set-valued law has ended at `(t, x)`; then what storages keep is what it was,
    /// or has changed by what the junction structure lets through. Whether the mode is another.
    pub(super) fn settle_mode(&mut self, t: f64, x: &mut [f64]) -> Result<bool, Failure> {
        if self.code.bounds.is_none() {
            return Ok(false);
        }
        let ended = self.ended(t, x, true)?;
        if ended.is_empty() {
            return Ok(false);
        }
        self.take_stored(t, x)?;
        let stored = self.stored_now();
        let values = self.values_of_all(t, x)?;
        let instant = Instant { model: self, t, x, values, stored };
        let (next, point) = instant.search(&ended).map_err(|tried| self.no_mode(t, &ended, tried))?;
        *self = next;
        x.copy_from_slice(&point);
        Ok(true)
    }

    /// Whether a branch has ended between events, which no event has told.
    pub(super) fn has_mode_ended(&mut self, t: f64, x: &[f64]) -> Result<bool, Failure> {
        if self.code.bounds.is_none() {
            return Ok(false);
        }
        self.note_extents(t, x)?;
        Ok(!self.ended(t, x, false)?.is_empty())
    }

    /// The set-valued laws of which a branch has ended at `(t, x)`, by name.
    pub(super) fn laws_ended(&mut self, t: f64, x: &[f64]) -> Result<Vec<String>, Failure> {
        let ended = self.ended(t, x, true)?;
        let mut names: Vec<String> =
            ended.into_iter().map(|(law, _)| self.code.program.set_valued[law as usize].name.clone()).collect();
        names.dedup();
        Ok(names)
    }

    /// What storages keep, as it was noted last.
    fn stored_now(&self) -> BTreeMap<Symbol, f64> {
        let symbols = self.code.program.jumps.iter().flat_map(|jumps| &jumps.storages);
        symbols.copied().zip(self.events.impulses.stored().iter().copied()).collect()
    }

    /// Keeps in mind how great margins and what storages keep have been.
    fn note_extents(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        self.take_stored(t, x)?;
        let code = self.code.clone();
        let Some(bounds) = &code.bounds else { return Ok(()) };
        self.place(t, x);
        self.frame.run(&bounds.everywhere).map_err(|error| self.failure(t, error))?;
        for (&key, &register) in bounds.keys.iter().zip(&bounds.everywhere.outputs) {
            let margin = self.frame.r[register as usize].abs();
            let most = self.run.extents.margins.entry(key).or_default();
            most[0] = if margin.is_finite() { most[0].max(margin) } else { most[0] };
        }
        self.frame.run(&bounds.margins).map_err(|error| self.failure(t, error))?;
        let Model { run, frame, events, .. } = self;
        for (number, (_, bound, place)) in bounds.all.iter().enumerate() {
            let Some(place) = place else { continue };
            let value = |place: usize| frame.r[bounds.margins.outputs[place] as usize].abs();
            let most = run.extents.margins.entry(key(bounds, bound, number)).or_default();
            most[0] = most[0].max(value(*place));
            if bound.gap.is_some() {
                most[1] = most[1].max(value(place + 1));
            }
        }
        for (&symbol, x) in code.program.tracked.iter().zip(x) {
            let most = run.extents.states.entry(symbol).or_default();
            *most = most.max(x.abs());
        }
        let storages = code.program.jumps.iter().flat_map(|jumps| &jumps.storages);
        for (&symbol, stored) in storages.zip(events.impulses.stored()) {
            let most = run.extents.stored.entry(symbol).or_default();
            *most = most.max(stored.abs());
        }
        Ok(())
    }

    /// The branches that have ended at `(t, x)`, with those beyond. `at_event`: those that end there are among them.
    fn ended(&mut self, t: f64, x: &[f64], at_event: bool) -> Result<Vec<(u32, u32)>, Failure> {
        let code = self.code.clone();
        let Some(bounds) = &code.bounds else { return Ok(Vec::new()) };
        self.place(t, x);
        let holds = if at_event { self.truth_of_clauses(t, Hold::Follow)? } else { Vec::new() };
        let margins = self.margins_ended(t, x, at_event)?;
        let ended = |(bound, margin): (&(usize, Bound, Option<usize>), Option<bool>)| match margin {
            Some(ended) => ended,
            None => holds.get(bound.0).copied().unwrap_or(false),
        };
        let all = bounds.all.iter().zip(margins).filter(|(bound, margin)| ended((bound, *margin)));
        let mut ended: Vec<(u32, u32)> = all.map(|((_, bound, _), _)| (bound.law, bound.next)).collect();
        ended.sort_unstable();
        ended.dedup();
        Ok(ended)
    }

    /// On which side of their border the conditions of margins are at `(t, x)`.
    pub(super) fn sides_of_bounds(&mut self, t: f64, x: &[f64]) -> Result<Vec<(ConditionId, bool)>, Failure> {
        let code = self.code.clone();
        let Some(bounds) = &code.bounds else { return Ok(Vec::new()) };
        let margins = self.margins_ended(t, x, true)?;
        self.place(t, x);
        self.frame.run(&bounds.margins).map_err(|error| self.failure(t, error))?;
        for (number, (_, bound, place)) in bounds.all.iter().enumerate() {
            let (Some(condition), Some(place)) = (bounds.conditions[number], place) else { continue };
            let most = self.run.extents.margins.get(&key(bounds, bound, number)).map_or(0.0, |most| most[0]);
            let margin = self.frame.r[bounds.margins.outputs[*place] as usize];
            // What is zero as it stands does not end a little further on. A gap opens from where it is: a floor below it
            // would feed the next impact.
            let stands = if margins[number] == Some(false) { 4.0 * (-margin).max(0.0) } else { 0.0 };
            let floor = if bound.gap.is_some() { 0.0 } else { stands.max(FLOOR * most) };
            self.events.floors[condition.0 as usize] = floor;
        }
        let sides = bounds.conditions.iter().zip(margins);
        Ok(sides.filter_map(|(condition, ended)| Some(((*condition)?, ended?))).collect())
    }

    /// Of each bound whether its margin is below zero, or is zero and falls: of what is a gap its rate is looked at, then how
    /// that changes. `None` of conditions.
    fn margins_ended(&mut self, t: f64, x: &[f64], at_event: bool) -> Result<Vec<Option<bool>>, Failure> {
        let code = self.code.clone();
        let Some(bounds) = &code.bounds else { return Ok(Vec::new()) };
        self.place(t, x);
        self.frame.run(&bounds.margins).map_err(|error| self.failure(t, error))?;
        let margins: Vec<f64> = bounds.margins.outputs.iter().map(|&r| self.frame.r[r as usize]).collect();
        // While a run steps, a margin that is not below zero has not ended, however small it is.
        let sizes = match at_event || margins.iter().any(|margin| margin.is_nan() || *margin < 0.0) {
            true => self.magnitudes_of_margins(bounds, t, x, x)?,
            false => vec![0.0; margins.len()],
        };
        let zero = |place: usize, most: f64| ROUNDING * most + NOISE * sizes[place];
        let mut ended: Vec<Option<bool>> = Vec::with_capacity(bounds.all.len());
        let mut open = Vec::new();
        for (number, (_, bound, place)) in bounds.all.iter().enumerate() {
            let Some(place) = *place else {
                ended.push(None);
                continue;
            };
            let most = self.run.extents.margins.get(&key(bounds, bound, number)).copied().unwrap_or_default();
            let margin = margins[place];
            let mut over = margin.is_nan() || margin < -zero(place, most[0]);
            if at_event && !over && margin <= zero(place, most[0]) {
                match bound.gap.map(|_| margins[place + 1]) {
                    None => open.push((number, place, 1)),
                    Some(rate) if rate < -zero(place + 1, most[1]) => over = true,
                    Some(rate) if rate <= zero(place + 1, most[1]) => open.push((number, place + 1, 2)),
                    Some(_) => {}
                }
            }
            ended.push(Some(over));
        }
        if !open.is_empty() {
            self.rates_at(t, x)?;
            self.place(t, x);
            self.move_along(t);
            let along = self.frame.run_along(&bounds.margins);
            along.map_err(|error| self.failure(t, error))?;
            let rates: Vec<f64> = bounds.margins.outputs.iter().map(|&r| self.frame.d[r as usize]).collect();
            let dx = self.dx.clone();
            let sizes = self.magnitudes_of_margins(bounds, t, x, &dx)?;
            for (number, place, level) in open {
                let rate = rates[place];
                let bound = &bounds.all[number].1;
                let most = self.run.extents.margins.entry(key(bounds, bound, number)).or_default();
                most[level] = most[level].max(rate.abs());
                // What would not show in as much time as has passed is none.
                let slow = if t == 0.0 { 0.0 } else { ROUNDING * most[level - 1] / t.abs() };
                ended[number] = Some(rate < -ROUNDING * most[level] - NOISE * sizes[place] - slow);
            }
        }
        Ok(ended)
    }

    /// How great the terms are that margins are the sum of, one for each state moved by its `way`.
    fn magnitudes_of_margins(&mut self, bounds: &Bounds, t: f64, x: &[f64], way: &[f64]) -> Result<Vec<f64>, Failure> {
        let mut sizes = vec![0.0f64; bounds.margins.outputs.len()];
        for (state, way) in way.iter().enumerate().filter(|(_, way)| **way != 0.0) {
            self.place(t, x);
            self.still();
            self.frame.d[self.code.layout.states as usize + state] = *way;
            self.frame.run_along(&bounds.margins).map_err(|error| self.failure(t, error))?;
            for (size, &register) in sizes.iter_mut().zip(&bounds.margins.outputs) {
                *size = size.max(self.frame.d[register as usize].abs());
            }
        }
        Ok(sizes)
    }

    /// No mode can be.
    fn no_mode(&self, time: f64, ended: &[(u32, u32)], tried: [usize; 2]) -> Failure {
        let laws = &self.code.program.set_valued;
        let name = |&(law, _): &(u32, u32)| {
            let law = &laws[law as usize];
            format!("{} (`{}`)", law.name, law.branches[law.present as usize])
        };
        let mut what: Vec<String> = ended.iter().map(name).collect();
        what.dedup();
        Failure::NoMode { time, what: what.join(", "), tried }
    }

    /// Makes all modes that set-valued laws can have, so that none is made while a run goes on, if they are no more than `most`:
    /// how many there are and how many of them have equations.
    pub fn prepare_modes(&self, most: usize) -> Option<(usize, usize)> {
        let laws = &self.code.program.set_valued;
        let counts: Vec<usize> = laws.iter().map(|law| law.branches.len()).collect();
        let all = counts.iter().try_fold(1usize, |all, count| all.checked_mul(*count)).filter(|all| *all <= most)?;
        let mode = |number: usize| {
            let mut rest = number;
            let branch = |count: &usize| {
                let branch = rest % count;
                rest /= count;
                branch as u32
            };
            counts.iter().map(branch).collect::<Vec<u32>>()
        };
        Some((all, (0..all).filter(|&number| self.compiled.in_mode(&mode(number)).is_some()).count()))
    }

    /// Opens contacts and lets go what sticks, before impulses are shared out among all that move: what they take of it is
    /// found then.
    pub(super) fn release(&mut self, t: f64, x: &mut [f64]) -> Result<(), Failure> {
        let code = self.code.clone();
        let Some(bounds) = &code.bounds else { return Ok(()) };
        let laws = &code.program.set_valued;
        let free: Vec<u32> = laws.iter().map(|law| law.released.unwrap_or(law.present)).collect();
        let impulses = code.program.clauses.iter().zip(&self.events.fired).any(|(clause, fired)| {
            *fired && clause.actions.iter().any(|action| matches!(action.target, Target::Moved { .. }))
        });
        if !impulses || free == bounds.branches {
            return Ok(());
        }
        self.take_stored(t, x)?;
        let (stored, values) = (self.stored_now(), self.values_of_all(t, x)?);
        let fired = std::mem::take(&mut self.events.fired);
        let (mut model, mut point) = (self.clone(), x.to_vec());
        let mode = self.compiled.in_mode(&free);
        let entered = match mode {
            Some(mode) => Instant { model: self, t, x, values, stored }.enter(&mut model, mode, &mut point)?,
            None => None,
        };
        if entered.is_none_or(|leap| leap > NO_LEAP) {
            let what = "what is stuck or in contact there".to_string();
            return Err(Failure::NoMode { time: t, what, tried: [1, 0] });
        }
        for (clause, fired) in code.program.clauses.iter().zip(fired).filter(|(_, fired)| *fired) {
            let same = |c: &&Clause| match (c.bound, clause.bound) {
                (Some(own), Some(other)) => (own.law, own.next) == (other.law, other.next),
                (None, None) => c.span == clause.span && c.name == clause.name,
                _ => false,
            };
            if let Some(place) = model.code.program.clauses.iter().position(|c| same(&c)) {
                model.events.fired[place] = fired;
            }
        }
        model.switched = true;
        *self = model;
        x.copy_from_slice(&point);
        Ok(())
    }

    /// The clauses of contacts whose gap is closed: what an impulse may act through.
    pub(super) fn contacts(&mut self, t: f64, x: &[f64]) -> Result<Vec<usize>, Failure> {
        let code = self.code.clone();
        let Some(bounds) = &code.bounds else { return Ok(Vec::new()) };
        self.place(t, x);
        self.frame.run(&bounds.margins).map_err(|error| self.failure(t, error))?;
        let mut contacts = Vec::new();
        for (number, (clause, bound, place)) in bounds.all.iter().enumerate() {
            let (Some(place), Some(_)) = (place, bound.gap) else { continue };
            let greatest = self.run.extents.margins.get(&key(bounds, bound, number)).copied().unwrap_or_default();
            let most = greatest[0];
            let gap = self.frame.r[bounds.margins.outputs[*place] as usize];
            let moved = code.program.clauses[*clause].actions.iter().any(|a| matches!(a.target, Target::Moved { .. }));
            if moved && (gap <= ROUNDING * most || self.events.fired[*clause]) {
                let rate = self.frame.r[bounds.margins.outputs[place + 1] as usize].abs();
                self.events.at_rest[*clause] |= rate <= AT_REST * greatest[1];
                contacts.push(*clause);
            }
        }
        Ok(contacts)
    }

    /// A run begins: contacts whose sides meet there take an impact. Sides that overlap are refused.
    pub(super) fn begin_contacts(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        let code = self.code.clone();
        let Some(bounds) = &code.bounds else { return Ok(()) };
        self.note_extents(t, x)?;
        let ended = self.margins_ended(t, x, true)?;
        let sizes = self.magnitudes_of_margins(bounds, t, x, x)?;
        self.place(t, x);
        self.frame.run(&bounds.margins).map_err(|error| self.failure(t, error))?;
        for ((clause, bound, place), ended) in bounds.all.iter().zip(ended) {
            let (Some(place), Some(_), Some(true)) = (place, bound.gap, ended) else { continue };
            let gap = self.frame.r[bounds.margins.outputs[*place] as usize];
            if gap < -OVERLAP * sizes[*place] {
                let what = code.program.set_valued[bound.law as usize].name.clone();
                return Err(Failure::Overlap { time: t, what, gap });
            }
            self.events.fired[*clause] = self.frame.r[bounds.margins.outputs[place + 1] as usize] < 0.0;
        }
        Ok(())
    }

    /// The greatest rate that the gap of a contact has had.
    pub(super) fn greatest_rate(&self, contact: usize) -> f64 {
        let Some(bounds) = &self.code.bounds else { return 0.0 };
        let of = bounds.all.iter().enumerate().find(|(_, (clause, ..))| *clause == contact);
        let most = of.and_then(|(number, (_, bound, _))| self.run.extents.margins.get(&key(bounds, bound, number)));
        most.map_or(0.0, |most| most[1])
    }

    /// Clauses of another mode: those of the modeller go on, bounds begin anew.
    fn begin_bounds(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        let code = self.code.clone();
        let own = code.program.clauses.iter().filter(|c| c.bound.is_none()).count();
        self.run.clauses.truncate(own);
        let fresh = ClauseMemory::Becomes(Condition::begin(false, t));
        self.run.clauses.resize(code.program.clauses.len(), fresh);
        let holds = self.held_true(t, x)?;
        for (memory, holds) in self.run.clauses.iter_mut().zip(holds).skip(own) {
            *memory = ClauseMemory::Becomes(Condition::begin(holds, t));
        }
        Ok(())
    }
}

fn key(bounds: &Bounds, bound: &Bound, number: usize) -> (u32, u32, usize) {
    let first = bounds.all.iter().position(|(_, b, _)| b.law == bound.law).unwrap_or(0);
    (bound.law, bounds.branches[bound.law as usize], number - first)
}

impl Instant<'_> {
    /// The mode in which the run goes on; in the error how many were tried, and in how many of them a branch ends at once.
    fn search(&self, ended: &[(u32, u32)]) -> Result<(Model, Vec<f64>), [usize; 2]> {
        let Some(bounds) = &self.model.code.bounds else { return Err([0, 0]) };
        let mut short = 0;
        let commanded = |law: u32| bounds.all.iter().any(|(_, b, place)| b.law == law && place.is_none());
        let counts: Vec<u32> = self.model.code.program.set_valued.iter().map(|l| l.branches.len() as u32).collect();
        // Commands are obeyed by whatever mode.
        let mut first = bounds.branches.clone();
        ended.iter().filter(|(law, _)| commanded(*law)).for_each(|&(law, next)| first[law as usize] = next);
        let mut next = first.clone();
        ended.iter().rev().for_each(|&(law, beyond)| next[law as usize] = beyond);
        let mut tried: BTreeSet<Vec<u32>> = BTreeSet::new();
        let mut queue = VecDeque::from([first.clone()]);
        let mut seen: BTreeSet<Vec<u32>> = BTreeSet::from([first.clone()]);
        let mut leaping: Option<(f64, Entered)> = None;
        let mut pivot = Some(next);
        while tried.len() < MOST_TRIED {
            let mode = match pivot.take() {
                Some(mode) => mode,
                None => {
                    let Some(mode) = queue.pop_front() else { break };
                    let distance = mode.iter().zip(&first).filter(|(a, b)| a != b).count();
                    if leaping.is_some() && distance > FAR {
                        break;
                    }
                    for law in (0..mode.len()).filter(|&law| !commanded(law as u32)) {
                        for branch in 0..counts[law] {
                            let mut other = mode.clone();
                            other[law] = branch;
                            if seen.insert(other.clone()) {
                                queue.push_back(other);
                            }
                        }
                    }
                    if tried.contains(&mode) {
                        if queue.is_empty() {
                            break;
                        }
                        continue;
                    }
                    mode
                }
            };
            tried.insert(mode.clone());
            match self.try_mode(&mode) {
                Tried::Fits(found, leap) if leap <= NO_LEAP => return Ok(*found),
                Tried::Fits(found, leap) => {
                    if self.may_leap(&mode, bounds) && leaping.as_ref().is_none_or(|(least, _)| leap < *least) {
                        leaping = Some((leap, found));
                    }
                }
                Tried::Ended(ended) => {
                    short += 1;
                    let exchanged = ended.first().map(|&(law, beyond)| {
                        let mut other = mode.clone();
                        other[law as usize] = beyond;
                        other
                    });
                    pivot = exchanged.filter(|other| !tried.contains(other));
                }
                Tried::Impossible => {}
            }
            if pivot.is_none() && queue.is_empty() {
                break;
            }
        }
        leaping.map(|(_, found)| *found).ok_or([tried.len(), short])
    }

    /// Whether storages may leap on the way to a mode: not by what is bounded, nor by contacts, whose impulses are told.
    fn may_leap(&self, mode: &[u32], bounds: &Bounds) -> bool {
        let Some(id) = self.model.compiled.in_mode(mode) else { return false };
        let code = self.model.compiled.mode(id);
        let laws = code.program.set_valued.iter().zip(&bounds.branches);
        laws.clone().all(|(law, before)| law.released.is_none() || law.present == *before)
    }

    fn try_mode(&self, branches: &[u32]) -> Tried {
        let Some(mode) = self.model.compiled.in_mode(branches) else { return Tried::Impossible };
        let mut model = self.model.clone();
        let mut x = self.x.to_vec();
        match self.enter(&mut model, mode, &mut x) {
            Ok(Some(leap)) => match model.ended(self.t, &x, true) {
                Ok(ended) if ended.is_empty() => Tried::Fits(Box::new((model, x)), leap),
                Ok(ended) => Tried::Ended(ended),
                Err(_) => Tried::Impossible,
            },
            Ok(None) | Err(_) => Tried::Impossible,
        }
    }

    /// Goes on in a mode from what storages keep; by how much that changes. `None` if that cannot be.
    fn enter(&self, model: &mut Model, mode: ModeId, x: &mut [f64]) -> Result<Option<f64>, Failure> {
        let t = self.t;
        let recorded = model.recorded.chosen.len();
        model.enter(mode)?;
        if model.broken.is_some() || model.recorded.chosen.len() != recorded {
            return Ok(None);
        }
        model.frame.conditions.clock = Hold::Follow;
        model.frame.conditions.state = Hold::Follow;
        let code = model.code.clone();
        code.clock.handle_time_event(&mut model.frame, model.run.crossed, &mut model.run.clock_event);
        model.start_solutions_at(&self.values);
        let value = |symbol: &Symbol| self.values.get(symbol).copied().filter(|v| v.is_finite()).unwrap_or(0.0);
        x.fill(0.0);
        x.iter_mut().zip(&code.program.tracked).for_each(|(x, symbol)| *x = value(symbol));
        model.run.conserved = code.program.replaced.iter().map(value).collect();
        let Some(jumps) = &code.program.jumps else { return Ok(None) };
        // A spring whose displacement follows from others keeps nothing by itself, but has a displacement.
        let kept = jumps.storages.iter().map(|s| self.stored.get(s).or_else(|| self.values.get(s)).copied());
        let kept: Option<Vec<f64>> = kept.collect();
        let Some(kept) = kept else { return Ok(None) };
        model.events.impulses.keep_stored(&kept);
        model.balance_leaps(t, x)?;
        model.take_signs(t, x)?;
        model.follow_solutions(t, x)?;
        model.run.scales = model.magnitudes(t, x);
        // What a state has been tells its size, not what it begins with.
        let known = code.program.tracked.iter().map(|s| model.run.extents.states.get(s).copied().unwrap_or(0.0));
        model.run.scales.iter_mut().zip(known).for_each(|(scale, known)| *scale = scale.max(known));
        model.follow_solutions(t, x)?;
        model.take_stored(t, x)?;
        let most = |symbol: &Symbol| model.run.extents.stored.get(symbol).copied().unwrap_or(0.0);
        let pairs = jumps.storages.iter().zip(&kept).zip(model.events.impulses.stored());
        let leaps = pairs.map(|((symbol, before), after)| {
            let size = most(symbol).max(before.abs()).max(after.abs());
            if size == 0.0 { 0.0 } else { (after - before).abs() / size }
        });
        let leap = leaps.fold(0.0, f64::max);
        model.begin_bounds(t, x)?;
        Ok(Some(leap))
    }
}

impl Model {
    /// Which conditions of clauses are true now, as conditions are held.
    fn held_true(&mut self, t: f64, x: &[f64]) -> Result<Vec<bool>, Failure> {
        self.place(t, x);
        let hold = self.frame.conditions.state;
        self.truth_of_clauses(t, hold)
    }
}
