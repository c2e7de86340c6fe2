//! Margins of set-valued laws: where a branch ends. It ends where its margin is below zero, or is zero and falls; a gap ends
//! where its rate is below zero as well, or zero, and that falls. What is zero is told beside what the graph holds: the
//! greatest effort or flow in the same unit, what the terms add up to, what the margin has been. What is zero throughout
//! keeps its branch, and so does noise: a margin that is zero is watched from below what is zero on.

use super::Model;
use super::modes::Extents;
use crate::bytecode::{Hold, Layout, Routine};
use halfarrow_compiler::program::{Bound, ConditionId, Margin, Program, Value};
use halfarrow_sim::Failure;
use std::ops::Range;

/// A margin that is zero, as part of what it is compared with.
const ZERO: f64 = 1e-12;
/// The rate of a gap that is zero, in the same measure.
const MEETS: f64 = 1e-10;
/// How a margin changes, or the rate of a gap, if it stays as it is, as part of the greatest such change.
const STEADY: f64 = 1e-9;
/// From where on below zero a margin is watched, in what is zero: it grows while a run goes on.
const BELOW: f64 = 2.0;
/// How soon, as part of the time that has passed, a change has to show in what it changes.
const SOON: f64 = 1e-6;
/// What rounding leaves of a sum, as part of its terms.
const ROUNDING: f64 = 2.0 * f64::EPSILON;
/// A height of flight that rounding decides on, in what it leaves of a gap, and a time of flight in what it leaves of time.
const SHORT: f64 = 32.0;
/// By what sides of a contact may overlap where a run begins, as part of what their displacements are.
const OVERLAP: f64 = 1e-9;

/// The bounds of the branches of a mode, as code.
#[derive(Debug, Clone)]
pub(super) struct Bounds {
    pub margins: Vec<Margin>,
    /// Bounds that are conditions, each with its clause.
    pub commands: Vec<(usize, Bound)>,
    /// Computes the margins, the rate of a gap behind it.
    routine: Routine,
    /// The branches of the mode.
    pub branches: Vec<u32>,
    /// Efforts and flows that are compared: computes them, and the places of each group among them.
    compared: Routine,
    groups: Vec<Range<usize>>,
    /// Computes the gaps of contacts that are closed.
    pub closed: Routine,
}

/// How a margin stands.
#[derive(Debug, Clone, Copy)]
pub(super) struct Standing {
    /// Its value, and that of the rate of a gap.
    pub value: f64,
    pub rate: f64,
    /// What is zero beside them.
    pub zero: f64,
    pub still: f64,
    /// What rounding leaves of the value.
    rounding: f64,
    /// How it changes, or the rate of a gap, where that has been asked for.
    pub change: f64,
    /// Whether the branch has ended.
    pub ended: bool,
    /// Whether it has because a contact that impulses have opened would fly for no time.
    pub brief: bool,
}

impl Standing {
    /// Whether a flight that begins with a rate, and is pulled back, is too short to be told from rounding at time `t`.
    fn is_short(&self, t: f64, back: f64) -> bool {
        let (rate, brief) = (self.rate.abs(), SHORT * ROUNDING * t.abs() * back);
        back > 0.0 && (rate * rate <= 2.0 * back * SHORT * self.rounding || rate <= brief)
    }
}

impl Bounds {
    pub fn of(program: &Program, layout: &Layout) -> Option<Bounds> {
        let bounds = program.bounds()?;
        let routine = layout.routine(program, &bounds.values());
        let ends = bounds.compared.iter().scan(0, |end, group| {
            *end += group.len();
            Some(*end - group.len()..*end)
        });
        let groups = ends.collect();
        let compared = layout.routine(program, &bounds.compared.concat());
        let closed: Vec<Value> = program.clauses.iter().filter_map(|c| c.bound?.closed).collect();
        let closed = layout.routine(program, &closed);
        let halfarrow_compiler::program::Bounds { margins, commands, branches, .. } = bounds;
        Some(Bounds { margins, commands, routine, branches, compared, groups, closed })
    }

    pub fn routines(&self) -> impl Iterator<Item = &Routine> {
        [&self.routine, &self.compared, &self.closed].into_iter()
    }
}

impl Model {
    /// Keeps in mind how great margins, states and what storages keep have been.
    pub(super) fn note_extents(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        let code = self.code.clone();
        let Some(bounds) = &code.bounds else { return Ok(()) };
        self.take_stored(t, x)?;
        self.place(t, x);
        self.frame.run(&bounds.routine).map_err(|error| self.failure(t, error))?;
        let Model { run, frame, events, .. } = self;
        for margin in &bounds.margins {
            let value = |place: usize| frame.r[bounds.routine.outputs[place] as usize];
            let most = run.extents.margins.entry(margin.key).or_default();
            most[0] = most[0].max(value(margin.place).abs());
            if margin.bound.gap.is_some() {
                most[1] = most[1].max(value(margin.place + 1).abs());
            }
            // What has risen is watched from zero on again.
            if let Some(condition) = margin.condition.filter(|_| margin.bound.gap.is_some()) {
                let floor = &mut run.floors[condition.0 as usize];
                *floor = if value(margin.place) > *floor { 0.0 } else { *floor };
            }
        }
        for (&symbol, x) in code.program.tracked.iter().zip(x) {
            Extents::note(&mut run.extents.states, symbol, *x);
        }
        let storages = code.program.jumps.iter().flat_map(|jumps| &jumps.storages);
        for (&symbol, &stored) in storages.zip(events.impulses.stored()) {
            Extents::note(&mut run.extents.stored, symbol, stored);
        }
        Ok(())
    }

    /// Keeps in mind how great the efforts and flows are with which margins are compared, and the rates of states.
    pub(super) fn note_compared(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        let code = self.code.clone();
        let Some(bounds) = &code.bounds else { return Ok(()) };
        self.note_extents(t, x)?;
        self.run.extents.gaps.1.clear();
        let standings = self.values_of_margins(t, x)?;
        let gaps = bounds.margins.iter().zip(standings).filter(|(m, _)| m.bound.gap.is_some());
        self.run.extents.gaps = (t, gaps.map(|(m, s)| (m.bound.law, s.zero)).collect());
        // What has no value in a mode that may not hold is compared with nothing.
        let moves = self.rates_at(t, x).is_ok();
        self.place(t, x);
        let known = self.frame.run(&bounds.compared).is_ok();
        let Model { run, frame, dx, .. } = self;
        run.extents.groups.resize(bounds.groups.len(), 0.0);
        for (most, group) in run.extents.groups.iter_mut().zip(&bounds.groups).filter(|_| known) {
            let values = bounds.compared.outputs[group.clone()].iter().map(|&r| frame.r[r as usize].abs());
            *most = values.filter(|value| value.is_finite()).fold(*most, f64::max);
        }
        for (&symbol, rate) in code.program.tracked.iter().zip(dx.iter()).filter(|_| moves) {
            Extents::note(&mut run.extents.rates, symbol, *rate);
        }
        Ok(())
    }

    /// Whether a margin is below zero where no event has told it.
    pub(super) fn is_margin_below(&mut self, t: f64, x: &[f64]) -> Result<bool, Failure> {
        let code = self.code.clone();
        let Some(bounds) = &code.bounds else { return Ok(false) };
        self.note_extents(t, x)?;
        let margin = |m: &Margin| self.frame.r[bounds.routine.outputs[m.place] as usize];
        if bounds.margins.iter().all(|m| margin(m) >= 0.0) {
            return Ok(false);
        }
        let standings = self.values_of_margins(t, x)?;
        Ok(standings.iter().any(|s| s.value.is_nan() || s.value < -s.zero))
    }

    /// The margins at `(t, x)` with what is zero beside them.
    pub(super) fn values_of_margins(&mut self, t: f64, x: &[f64]) -> Result<Vec<Standing>, Failure> {
        let code = self.code.clone();
        let Some(bounds) = &code.bounds else { return Ok(Vec::new()) };
        let been = |model: &Model| -> Vec<f64> {
            let most = |(symbol, x): (&_, &f64)| model.run.extents.states.get(symbol).map_or(0.0, |m| *m).max(x.abs());
            code.program.tracked.iter().zip(x).map(most).collect()
        };
        let way = been(self);
        let sizes = self.magnitudes_of_margins(bounds, t, x, &way)?;
        let present = self.magnitudes_of_margins(bounds, t, x, x)?;
        self.place(t, x);
        self.frame.run(&bounds.routine).map_err(|error| self.failure(t, error))?;
        let value = |place: usize| self.frame.r[bounds.routine.outputs[place] as usize];
        let extents = &self.run.extents;
        let standing = |m: &Margin| {
            let own = extents.margins.get(&m.key).copied().unwrap_or_default();
            let group = extents.groups.get(m.group).copied().unwrap_or(0.0);
            let finest = SHORT * ROUNDING * t.abs() * own[1];
            let gap = m.bound.gap.is_some();
            let rounding = ROUNDING * present[m.place];
            let zero = ZERO * own[0].max(sizes[m.place]).max(if gap { 0.0 } else { group });
            let still = if gap { MEETS * own[1].max(sizes[m.place + 1]).max(group) } else { 0.0 };
            let rate = if gap { value(m.place + 1) } else { 0.0 };
            let known = extents.gaps.1.get(&m.bound.law).filter(|_| gap && extents.gaps.0 == t);
            let zero = known.copied().unwrap_or(zero.max(rounding).max(finest));
            Standing {
                value: value(m.place),
                rate,
                zero,
                still,
                rounding,
                change: f64::NAN,
                ended: false,
                brief: false,
            }
        };
        Ok(bounds.margins.iter().map(standing).collect())
    }

    /// How the margins stand at `(t, x)`, and which branches have ended.
    pub(super) fn standings(&mut self, t: f64, x: &[f64]) -> Result<Vec<Standing>, Failure> {
        let code = self.code.clone();
        let Some(bounds) = &code.bounds else { return Ok(Vec::new()) };
        let mut all = self.values_of_margins(t, x)?;
        let mut open = Vec::new();
        for (number, (s, m)) in all.iter_mut().zip(&bounds.margins).enumerate() {
            let gap = m.bound.gap.is_some();
            let over = s.value.is_nan() || s.value < -s.zero || gap && s.value <= s.zero && s.rate < -s.still;
            s.ended = over;
            let rises = gap && s.rate > s.still;
            if !over && s.value <= s.zero && (!rises || self.run.extents.lets_go(t, m.bound.law)) {
                open.push(number);
            }
        }
        if open.is_empty() {
            return Ok(all);
        }
        let changes = self.changes_of_margins(t, x)?;
        let most = |symbol| self.run.extents.rates.get(symbol).copied().unwrap_or(0.0);
        let way: Vec<f64> =
            code.program.tracked.iter().zip(&self.dx).map(|(s, dx): (_, &f64)| most(s).max(dx.abs())).collect();
        let sizes = self.magnitudes_of_margins(bounds, t, x, &way)?;
        for number in open {
            let (s, m) = (&mut all[number], &bounds.margins[number]);
            let (place, level) = if m.bound.gap.is_some() { (m.place + 1, 2) } else { (m.place, 1) };
            s.change = changes[place];
            if m.bound.gap.is_some() && s.rate > s.still {
                s.brief = s.is_short(t, -s.change);
                s.ended = s.brief;
                continue;
            }
            let most = self.run.extents.margins.entry(m.key).or_default();
            most[level] = most[level].max(s.change.abs());
            // What would not show soon in what it changes is none yet.
            let below = if level == 2 { s.still } else { s.zero };
            let slow = if t == 0.0 { 0.0 } else { below / (SOON * t.abs()) };
            s.ended = s.change < -(STEADY * most[level]).max(ZERO * sizes[place]).max(slow);
        }
        Ok(all)
    }

    /// How margins, and the rates of gaps, change along the run.
    fn changes_of_margins(&mut self, t: f64, x: &[f64]) -> Result<Vec<f64>, Failure> {
        let code = self.code.clone();
        let Some(bounds) = &code.bounds else { return Ok(Vec::new()) };
        self.rates_at(t, x)?;
        self.place(t, x);
        self.move_along(t);
        self.frame.run_along(&bounds.routine).map_err(|error| self.failure(t, error))?;
        Ok(bounds.routine.outputs.iter().map(|&r| self.frame.d[r as usize]).collect())
    }

    /// On which side of their border the conditions of margins are at `(t, x)`, and from where on they are watched.
    pub(super) fn sides_of_bounds(&mut self, t: f64, x: &[f64]) -> Result<Vec<(ConditionId, bool)>, Failure> {
        let code = self.code.clone();
        let Some(bounds) = &code.bounds else { return Ok(Vec::new()) };
        let standings = self.standings(t, x)?;
        let mut sides = Vec::new();
        for (s, m) in standings.iter().zip(&bounds.margins) {
            let Some(condition) = m.condition else { continue };
            // What rises from a gap that is zero is watched from where it is: a floor further below would feed the next
            // impact.
            let rises = m.bound.gap.is_some() && s.rate > s.still;
            let floor = if rises { (-s.value).max(0.0) + s.rounding } else { BELOW * s.zero };
            let touches = !s.ended && s.value <= s.zero;
            self.run.floors[condition.0 as usize] = if touches { floor } else { 0.0 };
            sides.push((condition, s.ended));
        }
        Ok(sides)
    }

    /// Watches margins that are zero from below what is zero now.
    pub(super) fn watch_bounds(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        self.sides_of_bounds(t, x).map(|_| ())
    }

    /// The clauses of contacts whose sides meet at `(t, x)`, and of these the laws whose next flight would be too short to be
    /// told from rounding.
    pub(super) fn meeting(&mut self, t: f64, x: &[f64]) -> Result<(Vec<usize>, Vec<u32>), Failure> {
        let code = self.code.clone();
        let Some(bounds) = code.bounds.as_ref().filter(|b| b.margins.iter().any(|m| m.meets)) else {
            return Ok((Vec::new(), Vec::new()));
        };
        let standings = self.values_of_margins(t, x)?;
        let meets = |(_, (m, s)): &(usize, (&Margin, &Standing))| m.meets && s.value <= s.zero && s.rate < -s.still;
        let all: Vec<usize> = bounds.margins.iter().zip(&standings).enumerate().filter(meets).map(|(n, _)| n).collect();
        if all.is_empty() {
            return Ok((Vec::new(), Vec::new()));
        }
        let changes = self.changes_of_margins(t, x)?;
        let short = |&number: &usize| {
            // A flight that begins with the rate at most with which it ends.
            standings[number].is_short(t, -changes[bounds.margins[number].place + 1])
        };
        let laws = all.iter().filter(|n| short(n)).map(|&n| bounds.margins[n].bound.law).collect();
        Ok((all.into_iter().map(|n| bounds.margins[n].clause).collect(), laws))
    }

    /// How great the terms are that margins are the sum of, one for each state moved by its `way`.
    fn magnitudes_of_margins(&mut self, bounds: &Bounds, t: f64, x: &[f64], way: &[f64]) -> Result<Vec<f64>, Failure> {
        let mut sizes = vec![0.0f64; bounds.routine.outputs.len()];
        for (state, way) in way.iter().enumerate().filter(|(_, way)| **way != 0.0) {
            self.place(t, x);
            self.still();
            self.frame.d[self.code.layout.states as usize + state] = *way;
            self.frame.run_along(&bounds.routine).map_err(|error| self.failure(t, error))?;
            for (size, &register) in sizes.iter_mut().zip(&bounds.routine.outputs) {
                *size = size.max(self.frame.d[register as usize].abs());
            }
        }
        Ok(sizes)
    }

    /// The clauses of contacts whose gap is closed, or was before the round: what an impulse may act through.
    pub(super) fn contacts(&mut self, t: f64, x: &[f64]) -> Result<Vec<usize>, Failure> {
        let code = self.code.clone();
        let Some(bounds) = &code.bounds else { return Ok(Vec::new()) };
        if !bounds.margins.iter().any(|m| m.meets) {
            return Ok(Vec::new());
        }
        let standings = self.values_of_margins(t, x)?;
        let mut contacts = Vec::new();
        for (m, s) in bounds.margins.iter().zip(standings).filter(|(m, _)| m.meets) {
            let was_closed = self.run.extents.lets_go(t, m.bound.law);
            if s.value <= s.zero || self.events.fired[m.clause] || was_closed {
                let most = self.run.extents.margins.get(&m.key).map_or(0.0, |most| most[1]);
                let slow = s.rate.abs() <= super::modes::AT_REST * most;
                self.events.at_rest[m.clause] |= slow || self.events.short.contains(&m.bound.law);
                contacts.push(m.clause);
            }
        }
        Ok(contacts)
    }

    /// A run begins: sides of contacts that overlap there are refused.
    pub(super) fn begin_contacts(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        let code = self.code.clone();
        let Some(bounds) = &code.bounds else { return Ok(()) };
        let present = self.magnitudes_of_margins(bounds, t, x, x)?;
        let standings = self.values_of_margins(t, x)?;
        for (m, s) in bounds.margins.iter().zip(standings).filter(|(m, _)| m.bound.gap.is_some()) {
            if s.value < -s.zero && s.value < -OVERLAP * present[m.place] {
                let what = code.program.set_valued[m.bound.law as usize].name.clone();
                return Err(Failure::Overlap { time: t, what, gap: s.value });
            }
        }
        Ok(())
    }

    /// The greatest rate that the gap of a contact has had.
    pub(super) fn greatest_rate(&self, contact: usize) -> f64 {
        let Some(bounds) = &self.code.bounds else { return 0.0 };
        let margin = bounds.margins.iter().find(|m| m.clause == contact);
        margin.and_then(|m| self.run.extents.margins.get(&m.key)).map_or(0.0, |most| most[1])
    }

    /// The branches that have ended at `(t, x)`, with those beyond: by margins and by commands.
    pub(super) fn ended(&mut self, t: f64, x: &[f64]) -> Result<Vec<(u32, u32)>, Failure> {
        let code = self.code.clone();
        let Some(bounds) = &code.bounds else { return Ok(Vec::new()) };
        self.place(t, x);
        let holds = self.truth_of_clauses(t, Hold::Follow)?;
        let standings = self.standings(t, x)?;
        let margins = bounds.margins.iter().zip(&standings).filter(|(_, s)| s.ended).map(|(m, _)| m.bound);
        let commands = bounds.commands.iter().filter(|(clause, _)| holds[*clause]).map(|(_, bound)| *bound);
        let mut ended: Vec<(u32, u32)> = margins.chain(commands).map(|bound| (bound.law, bound.next)).collect();
        ended.sort_unstable();
        ended.dedup();
        Ok(ended)
    }
}
