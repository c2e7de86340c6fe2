//! The mode of set-valued laws: which branch each of them has. A mode is kept until a branch ends; then a mode is sought in
//! which no branch has ended, from what storages keep, by exchanging the branch with the least number that has (Murty's
//! principal pivoting), and where that leads in a circle or to a mode that cannot be, by the number of exchanges.
//! Source: K. G. Murty, Note on a Bard-type scheme for solving the complementarity problem, Opsearch 11 (1974).

use super::Model;
use super::clause_memory::{ClauseMemory, Condition};
use super::compiled::ModeId;
use super::margins::{Bounds, Standing};
use crate::bytecode::Hold;
use halfarrow_compiler::algebra::Symbol;
use halfarrow_compiler::program::{Clause, Exchanged, Margin, Program};
use halfarrow_sim::Failure;
use std::cell::LazyCell;
use std::collections::{BTreeMap, BTreeSet, VecDeque};

/// Modes that are tried at one instant at most.
const MOST_TRIED: usize = 2000;
/// Exchanges beyond which no mode is sought any more once one is known to which storages leap.
const FAR: usize = 2;
/// The rate with which sides meet that do not part again, as part of the greatest that the gap has had.
pub(super) const AT_REST: f64 = 1e-9;
/// What storages change by without a leap, as part of the most that they have kept.
const NO_LEAP: f64 = 1e-7;
/// The same where flights end that rounding decides on, in parts of the rates with which these begin, as parts of the greatest
/// of their gaps.
const NO_FLIGHT: f64 = 1e2;

/// A mode of a model as a program, with the variables that are independent in it where they may change.
#[derive(Debug, Clone)]
pub struct ModeProgram {
    /// The program.
    pub program: Program,
    /// What is recorded, in [`Program::observed`].
    pub recorded: Vec<usize>,
    /// The independent variables by which the mode is known, in ascending order.
    pub independent: Vec<Symbol>,
}

/// How far beside a start equations of other modes are made, in magnitudes of the states, where they cannot be there;
const BESIDE: [f64; 6] = [0.1, -0.1, 0.01, -0.01, 1e-4, -1e-4];
/// and the golden ratio, by which states are moved unequally.
const UNEQUAL: f64 = 0.618_033_988_749_894_9;

/// The sets of so many of these, if there are no more than `most`.
fn subsets(all: &[Symbol], size: usize, most: usize) -> Option<Vec<Vec<Symbol>>> {
    let mut sets: Vec<Vec<Symbol>> = vec![Vec::new()];
    for (i, &symbol) in all.iter().enumerate() {
        let left = all.len() - i;
        let with = sets.iter().filter(|set| set.len() < size).map(|set| [&set[..], &[symbol]].concat());
        let with: Vec<Vec<Symbol>> = with.collect();
        sets.extend(with);
        // What cannot be filled any more is left out.
        sets.retain(|set| set.len() + left > size);
        if sets.len() > 64 * most {
            return None;
        }
    }
    sets.retain(|set| set.len() == size);
    (sets.len() <= most).then_some(sets)
}

/// What a run remembers of set-valued laws: how great things have been.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Extents {
    /// Of margins, of their rates and of the rates of these, by law, branch and bound.
    pub margins: BTreeMap<(u32, u32, u32), [f64; 3]>,
    /// Of efforts and flows in groups of one unit.
    pub groups: Vec<f64>,
    /// What is zero of gaps, by law, at one time: the same in all modes.
    pub gaps: (f64, BTreeMap<u32, f64>),
    /// Of what storages keep.
    pub stored: BTreeMap<Symbol, f64>,
    /// Contacts that were closed and have been opened for impulses, and when that was.
    pub let_go: (f64, Vec<u32>),
    /// How many times several contacts have shared out impulses at one instant, and when and which that was first.
    pub shared: (usize, f64, Vec<u32>),
    /// Of states and of their rates, by the variables that they are.
    pub states: BTreeMap<Symbol, f64>,
    pub rates: BTreeMap<Symbol, f64>,
}

impl Extents {
    pub fn note(most: &mut BTreeMap<Symbol, f64>, symbol: Symbol, value: f64) {
        let most = most.entry(symbol).or_default();
        *most = if value.is_finite() { most.max(value.abs()) } else { *most };
    }

    /// Takes notice of contacts that have shared out impulses at one instant.
    pub fn note_shared(&mut self, t: f64, laws: Vec<u32>) {
        let (count, first, which) = &mut self.shared;
        if *count == 0 {
            (*first, *which) = (t, laws);
        }
        *count += 1;
    }

    /// Whether impulses of this instant have opened a contact.
    pub fn lets_go(&self, t: f64, law: u32) -> bool {
        self.let_go.0 == t && self.let_go.1.contains(&law)
    }
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
        let ended = self.ended(t, x)?;
        if ended.is_empty() {
            return Ok(false);
        }
        if self.variation.is_some() {
            return Err(self.undifferentiated_mode(t, ended.iter().map(|e| e.0)));
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

    /// How many times several contacts have shared out impulses at one instant; when that was first, and which they were.
    pub fn shared_impulses(&self) -> Option<(usize, f64, Vec<String>)> {
        let (count, first, laws) = &self.run.extents.shared;
        let name = |law: &u32| self.code.program.set_valued[*law as usize].name.clone();
        (*count > 0).then(|| (*count, *first, laws.iter().map(name).collect()))
    }

    /// The set-valued laws of which a branch has ended at `(t, x)`, by name.
    pub(super) fn laws_ended(&mut self, t: f64, x: &[f64]) -> Result<Vec<String>, Failure> {
        let ended = self.ended(t, x)?;
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

    /// No mode can be.
    fn no_mode(&self, time: f64, ended: &[(u32, u32)], tried: [usize; 2]) -> Failure {
        let laws = &self.code.program.set_valued;
        let name = |&(law, _): &(u32, u32)| {
            let law = &laws[law as usize];
            format!("{} (`{}`)", law.name, law.branches[law.present as usize])
        };
        let mut what: Vec<String> = ended.iter().map(name).collect();
        what.dedup();
        let without = self.compiled.why_without(&self.code.program.branches());
        let why = without.map(|(branches, why)| {
            let all = laws.iter().zip(branches).filter(|(law, branch)| law.present != *branch);
            let mode: Vec<String> =
                all.map(|(law, branch)| format!("{} is `{}`", law.name, law.branches[branch as usize])).collect();
            format!("where {}, {why}", mode.join(" and "))
        });
        Failure::NoMode { time, what: what.join(", "), tried, why }
    }

    /// Makes all modes that set-valued laws can have, so that none is made while a run goes on, if they are no more than `most`:
    /// how many there are and how many of them have equations.
    pub fn prepare_modes(&self, most: usize) -> Option<(usize, usize)> {
        let all = self.combinations(most)?;
        Some((all.len(), all.iter().filter(|branches| self.compiled.in_mode(branches).is_some()).count()))
    }

    /// The programs of all modes that a run from `(t, x)` may come to, the present one first: of each combination of branches
    /// that has equations and a value for all that is recorded, and with other independent variables where these may change
    /// and there are no more than `most_sets` choices of them. `None` if there are more than `most` combinations.
    pub fn programs_of_modes(&self, (t, x): (f64, &[f64]), most: usize, most_sets: usize) -> Option<Vec<ModeProgram>> {
        let all = self.combinations(most)?;
        let present: Vec<u32> = self.code.program.branches();
        let others = all.iter().filter(|branches| **branches != present);
        let points = LazyCell::new(|| self.points_near(t, x));
        let mut modes = Vec::new();
        for branches in std::iter::once(&present).chain(others) {
            let Some(first) = self.compiled.in_mode(branches) else { continue };
            let code = self.compiled.mode(first);
            let of = |exchanged: &[Exchanged]| exchanged.iter().map(|e| e.symbol).collect::<BTreeSet<Symbol>>();
            let exchanges = &code.program.exchanges;
            let (own, dependent) = (of(&exchanges.independent), of(&exchanges.dependent));
            modes.extend(self.program_of(first, own.iter().copied().collect()));
            if !self.compiled.has_alternatives() || code.exchanges.is_none() {
                continue;
            }
            // Other modes may know of more that could be independent.
            let mut symbols: BTreeSet<Symbol> = own.union(&dependent).copied().collect();
            let mut done = BTreeSet::from([own.iter().copied().collect::<Vec<Symbol>>()]);
            loop {
                let all: Vec<Symbol> = symbols.iter().copied().collect();
                let sets = subsets(&all, own.len(), most_sets).unwrap_or_default();
                let Some(wanted) = sets.into_iter().find(|set| !done.contains(set)) else { break };
                done.insert(wanted.clone());
                let Some(mode) = self.compiled.with_independent_near(&code, &wanted, &points) else { continue };
                let exchanges = &self.compiled.mode(mode).program.exchanges;
                symbols.extend(exchanges.independent.iter().chain(&exchanges.dependent).map(|e| e.symbol));
                modes.extend(self.program_of(mode, wanted));
            }
        }
        Some(modes)
    }

    /// The variables of the graph at `(t, x)`, and at positions beside it: some choice of independent variables may be singular
    /// where a machine begins, as along an axis.
    fn points_near(&self, t: f64, x: &[f64]) -> Vec<BTreeMap<Symbol, f64>> {
        let scales = &self.run.scales;
        let beside = |part: f64| {
            let moved = |(k, x): (usize, &f64)| {
                let size = scales.get(k).copied().filter(|size| *size > 0.0).unwrap_or(1.0);
                // No two states by the same.
                x + part * size * (1.0 + (UNEQUAL * k as f64).fract())
            };
            x.iter().enumerate().map(moved).collect::<Vec<f64>>()
        };
        let places = std::iter::once(x.to_vec()).chain(BESIDE.map(beside));
        places.filter_map(|x| self.clone().values_of_all(t, &x).ok()).collect()
    }

    /// The program of a mode, if all that is recorded has a value there.
    fn program_of(&self, mode: ModeId, independent: Vec<Symbol>) -> Option<ModeProgram> {
        let code = self.compiled.mode(mode);
        let observed = &self.code.program.observed;
        let names = self.recorded.chosen.iter().map(|&i| &*observed[i].name);
        let place = |name: &str| code.program.observed.iter().position(|o| *o.name == *name && o.value.is_ok());
        let recorded = names.map(place).collect::<Option<Vec<usize>>>()?;
        Some(ModeProgram { program: code.program.clone(), recorded, independent })
    }

    /// All combinations of branches, if they are no more than `most`.
    fn combinations(&self, most: usize) -> Option<Vec<Vec<u32>>> {
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
        Some((0..all).map(mode).collect())
    }

    /// Opens contacts and lets go what sticks, before impulses are shared out among all that move: what they take of it is
    /// found then.
    pub(super) fn release(&mut self, t: f64, x: &mut [f64]) -> Result<(), Failure> {
        let code = self.code.clone();
        let Some(bounds) = &code.bounds else { return Ok(()) };
        let laws = &code.program.set_valued;
        let free: Vec<u32> = laws.iter().map(|law| law.released.unwrap_or(law.present)).collect();
        let impulses = code
            .program
            .clauses
            .iter()
            .zip(&self.events.fired)
            .any(|(clause, fired)| *fired && clause.actions.iter().any(|action| action.target.takes_impulse()));
        if !impulses || free == bounds.branches {
            return Ok(());
        }
        self.take_stored(t, x)?;
        let (stored, values) = (self.stored_now(), self.values_of_all(t, x)?);
        let changes = |law: &usize| bounds.branches[*law] != free[*law];
        let released: Vec<u32> = (0..laws.len()).filter(changes).map(|law| law as u32).collect();
        let fired = std::mem::take(&mut self.events.fired);
        let (mut model, mut point) = (self.clone(), x.to_vec());
        let mode = self.compiled.in_mode_from(self.run.mode, &free, &values);
        let entered = match mode {
            Some(mode) => Instant { model: self, t, x, values, stored }.enter(&mut model, mode, &mut point)?,
            None => None,
        };
        if entered.is_none_or(|leap| leap > NO_LEAP) {
            let what = "what is stuck or in contact there".to_string();
            return Err(Failure::NoMode { time: t, what, tried: [1, 0], why: None });
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
        let let_go = &mut model.run.extents.let_go;
        if let_go.0 != t {
            *let_go = (t, Vec::new());
        }
        let_go.1.extend(released);
        model.events.short = std::mem::take(&mut self.events.short);
        model.switched = true;
        *self = model;
        x.copy_from_slice(&point);
        Ok(())
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

impl Instant<'_> {
    /// The mode in which the run goes on; in the error how many were tried, and in how many of them a branch ends at once.
    fn search(&self, ended: &[(u32, u32)]) -> Result<(Model, Vec<f64>), [usize; 2]> {
        let Some(bounds) = &self.model.code.bounds else { return Err([0, 0]) };
        let mut short = 0;
        let commanded = |law: u32| bounds.commands.iter().any(|(_, bound)| bound.law == law);
        let standings = self.model.clone().standings(self.t, self.x).map_err(|_| [0, 0])?;
        let apart = apart(bounds, &standings);
        let no_leap = self.no_leap(bounds, &standings);
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
                    for law in (0..mode.len()).filter(|&law| !commanded(law as u32) && !apart.contains(&(law as u32))) {
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
                Tried::Fits(found, leap) if leap <= no_leap => return Ok(*found),
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

    /// What storages may change by where the mode ends: contacts that would fly for no time keep a rate that is rounding.
    fn no_leap(&self, bounds: &Bounds, standings: &[Standing]) -> f64 {
        let brief = bounds.margins.iter().zip(standings).filter(|(_, s)| s.brief);
        let part = |(m, s): (&Margin, &Standing)| s.rate.abs() / self.model.greatest_rate(m.clause);
        brief.map(part).fold(NO_LEAP, |most, part| most.max(NO_FLIGHT * part))
    }

    /// Whether storages may leap on the way to a mode: not by what is bounded, nor by contacts, whose impulses are told.
    fn may_leap(&self, mode: &[u32], bounds: &Bounds) -> bool {
        let found = self.model.compiled.in_mode_from(self.model.run.mode, mode, &self.values);
        let Some(id) = found else { return false };
        let code = self.model.compiled.mode(id);
        let laws = code.program.set_valued.iter().zip(&bounds.branches);
        laws.clone().all(|(law, before)| law.released.is_none() || law.present == *before)
    }

    fn try_mode(&self, branches: &[u32]) -> Tried {
        let mode = self.model.compiled.in_mode_from(self.model.run.mode, branches, &self.values);
        let Some(mode) = mode else { return Tried::Impossible };
        let mut model = self.model.clone();
        let mut x = self.x.to_vec();
        match self.enter(&mut model, mode, &mut x) {
            Ok(Some(leap)) => match model.ended(self.t, &x) {
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
        model.handle_time_event(model.run.crossed);
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

/// The contacts whose sides are apart: no force closes these.
fn apart(bounds: &Bounds, standings: &[Standing]) -> Vec<u32> {
    let contacts = bounds.margins.iter().zip(standings).filter(|(m, _)| m.bound.gap.is_some());
    let apart = contacts.filter(|(_, s)| s.value > s.zero || s.rate.abs() > s.still && !s.brief);
    apart.map(|(m, _)| m.bound.law).collect()
}

impl Model {
    /// Which conditions of clauses are true now, as conditions are held.
    fn held_true(&mut self, t: f64, x: &[f64]) -> Result<Vec<bool>, Failure> {
        self.place(t, x);
        let hold = self.frame.conditions.state;
        self.truth_of_clauses(t, hold)
    }
}
