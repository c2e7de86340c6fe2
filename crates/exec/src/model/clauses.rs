//! What happens at events (`when`): which clauses happen, and what they change.
//!
//! All that happens at one instant happens in rounds. The clauses of a round read what there is before it and change it at
//! once, so that their order says nothing; a clause whose condition becomes true by that happens in the next round.

use super::clause_memory::{ClauseMemory, Condition};
use super::compiled::Mode;
use super::impulses::{ImpulseBalance, ImpulseWork};
use super::positions::PositionConstraints;
use super::{DelayOrSample, Model};
use crate::bytecode::{Hold, Layout, Routine};
use halfarrow_compiler::program::{Program, Target, Trigger, Value};
use halfarrow_sim::{Affected, Failure};

/// Rounds at one instant at most.
const MOST_ROUNDS: usize = 200;
/// The clauses of a program as code.
#[derive(Debug, Clone)]
pub(super) struct Clauses {
    /// Those with conditions, and the routine that computes these.
    pub conditional: Vec<usize>,
    becomes: Routine,
    /// The registers of the periods of the others.
    periods: Vec<Option<u32>>,
    /// The new values of each.
    values: Vec<Routine>,
    /// Where those of each begin among all.
    first: Vec<usize>,
    /// Of contacts the register of the value with which they are at rest.
    still: Vec<Option<u32>>,
}

impl Clauses {
    pub fn of(program: &Program, layout: &Layout) -> Clauses {
        let conditions = program.clauses.iter().enumerate().filter_map(|(i, c)| match c.trigger {
            Trigger::Becomes(condition) => Some((i, condition)),
            Trigger::Every(_) => None,
        });
        let (conditional, conditions): (Vec<usize>, Vec<Value>) = conditions.unzip();
        let period = |trigger| match trigger {
            Trigger::Becomes(_) => None,
            Trigger::Every(period) => layout.registers.get(period),
        };
        let still = |c: &halfarrow_compiler::program::Clause| c.bound.and_then(|b| b.gap).map(|(_, still)| still);
        let values = |c: &halfarrow_compiler::program::Clause| {
            let own = c.actions.iter().map(|a| a.value);
            layout.routine(program, &own.chain(still(c).filter(|_| !c.actions.is_empty())).collect::<Vec<_>>())
        };
        let values: Vec<Routine> = program.clauses.iter().map(values).collect();
        let still = program
            .clauses
            .iter()
            .zip(&values)
            .map(|(c, routine)| still(c).and_then(|_| routine.outputs.get(c.actions.len()).copied()));
        let lengths = program.clauses.iter().map(|c| c.actions.len());
        let first = lengths.scan(0, |sum, n| {
            *sum += n;
            Some(*sum - n)
        });
        Clauses {
            conditional,
            becomes: layout.routine(program, &conditions),
            periods: program.clauses.iter().map(|c| period(c.trigger)).collect(),
            still: still.collect(),
            values,
            first: first.collect(),
        }
    }

    /// Where the new value of an action of a clause stands among all.
    pub fn place(&self, clause: usize, action: usize) -> usize {
        self.first[clause] + action
    }

    pub fn routines(&self) -> impl Iterator<Item = &Routine> {
        std::iter::once(&self.becomes).chain(&self.values)
    }
}

/// A condition on one number that has made something happen, holds still, and is about to hold no longer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Return {
    clause: usize,
    /// When it happened, in s.
    since: f64,
    /// The value of the number then, and the way that it goes.
    value: f64,
    way: f64,
}

/// Room for what is computed at events.
#[derive(Debug, Clone, Default)]
pub(super) struct EventWork {
    /// Which clauses happen in this round.
    pub fired: Vec<bool>,
    /// The new values of all actions, clause by clause.
    pub values: Vec<f64>,
    pub impulses: ImpulseWork,
    /// By how much constraints on displacements are missed before the round.
    pub misses: Vec<f64>,
    /// Contacts that come to rest, since their impacts accumulate.
    pub at_rest: Vec<bool>,
    /// Laws whose next flight would be too short.
    pub short: Vec<u32>,
    /// The clauses of contacts that take part in impulses.
    pub contacts: Vec<usize>,
}

impl EventWork {
    pub fn of(mode: &Mode) -> EventWork {
        let clauses = &mode.program.clauses;
        EventWork {
            fired: vec![false; clauses.len()],
            at_rest: vec![false; clauses.len()],
            contacts: Vec::new(),
            short: Vec::new(),
            values: vec![0.0; clauses.iter().map(|c| c.actions.len()).sum()],
            misses: vec![0.0; mode.positions.as_ref().map_or(0, PositionConstraints::len)],
            impulses: mode.impulses.as_ref().map_or_else(ImpulseWork::default, ImpulseBalance::work),
        }
    }
}

impl Model {
    /// Clauses before a run.
    pub(super) fn clauses_at_rest(&self) -> Vec<ClauseMemory> {
        let memory = |register: &Option<u32>| match register {
            Some(register) => ClauseMemory::Every { period: self.frame.r[*register as usize], next: f64::INFINITY },
            None => ClauseMemory::Becomes(Condition::begin(false, 0.0)),
        };
        self.code.clauses.periods.iter().map(memory).collect()
    }

    /// A run begins: conditions that hold have not become true, multiples of periods count from time 0.
    pub(super) fn begin_clauses(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        if self.run.clauses.is_empty() {
            return Ok(());
        }
        self.find_fired(t, x, &[])?;
        for (memory, fired) in self.run.clauses.iter_mut().zip(&mut self.events.fired) {
            match memory {
                ClauseMemory::Becomes(condition) => {
                    (*condition, *fired) = (Condition::begin(condition.holds, t), false)
                }
                ClauseMemory::Every { period, next } => {
                    *next = (t / *period).floor();
                    *next += f64::from(u8::from(*next * *period < t));
                    *fired = t >= *next * *period;
                    *next += f64::from(u8::from(*fired));
                }
            }
        }
        self.find_meeting(t, x)
    }

    /// Which conditions hold at `(t, x)`, as held, and which clauses happen: conditions that have become true, periods that
    /// are over, and those that are told.
    pub(super) fn find_fired(&mut self, t: f64, x: &[f64], told: &[bool]) -> Result<(), Failure> {
        if self.run.clauses.is_empty() {
            return Ok(());
        }
        self.place(t, x);
        let code = self.code.clone();
        self.frame.run(&code.clauses.becomes).map_err(|error| self.failure(t, error))?;
        let Model { run, events, frame, .. } = self;
        events.fired.fill(false);
        for (&clause, &register) in code.clauses.conditional.iter().zip(&code.clauses.becomes.outputs) {
            let ClauseMemory::Becomes(condition) = &mut run.clauses[clause] else { continue };
            let seen = told.get(clause).copied().unwrap_or(false);
            let holds = frame.r[register as usize] != 0.0 || seen;
            events.fired[clause] = holds && !condition.holds;
            condition.holds = holds;
        }
        self.find_meeting(t, x)?;
        let Model { run, events, .. } = self;
        for (memory, fired) in run.clauses.iter_mut().zip(&mut events.fired) {
            if let ClauseMemory::Every { period, next } = memory {
                while t >= *next * *period {
                    (*fired, *next) = (true, *next + 1.0);
                }
            }
        }
        Ok(())
    }

    /// Contacts take an impact where their sides meet, whatever the sign of a gap that is zero.
    fn find_meeting(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        let code = self.code.clone();
        let Some(bounds) = &code.bounds else { return Ok(()) };
        let (meeting, short) = self.meeting(t, x)?;
        for margin in bounds.margins.iter().filter(|m| m.meets) {
            self.events.fired[margin.clause] = meeting.contains(&margin.clause);
        }
        self.events.short = short;
        Ok(())
    }

    /// Notes which conditions have made something happen at `(t, x)` and are about to hold no longer: a ball that has hit the
    /// floor leaves it. Where none has, what is to return from before is watched further on.
    pub(super) fn note_returns(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        let code = self.code.clone();
        let happened = |clause: &usize| match self.run.clauses[*clause] {
            ClauseMemory::Becomes(condition) => condition.holds_since(t),
            ClauseMemory::Every { .. } => false,
        };
        let own = code.clauses.conditional.iter().copied().filter(|c| code.program.clauses[*c].bound.is_none());
        let mut watched = own.filter(happened).filter(|clause| code.sign_of(*clause).is_some()).peekable();
        if watched.peek().is_none() {
            return Ok(());
        }
        let mut returns = std::mem::take(&mut self.run.returns);
        returns.clear();
        returns.extend(watched.map(|clause| Return { clause, since: t, value: 0.0, way: 0.0 }));
        self.rates_at(t, x)?;
        self.place(t, x);
        self.move_along(t);
        self.frame.run_along(&code.indicators).map_err(|error| self.failure(t, error))?;
        returns.retain_mut(|r| {
            let register = code.sign_of(r.clause).expect("it is watched") as usize;
            let rate = self.frame.d[register];
            (r.value, r.way) = (self.frame.r[register], rate.signum());
            rate != 0.0 && r.value * rate <= 0.0
        });
        self.run.returns = returns;
        Ok(())
    }

    /// What was about to return and is further beyond at the end of a step has been lost. What has not moved at all is watched
    /// further on.
    pub(super) fn watch_returns(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        if self.run.returns.is_empty() || self.run.returns.iter().any(|r| r.since == t) {
            return Ok(());
        }
        let code = self.code.clone();
        self.place(t, x);
        self.frame.run(&code.indicators).map_err(|error| self.failure(t, error))?;
        let Model { run, frame, .. } = self;
        let mut lost = None;
        run.returns.retain(|r| {
            let Some(register) = code.sign_of(r.clause) else { return true };
            let value = frame.r[register as usize];
            let beyond = value * r.way < 0.0;
            lost = lost.or((beyond && value.abs() > r.value.abs()).then_some(*r));
            value == r.value
        });
        lost.map_or(Ok(()), |r| {
            let what = code.program.clauses[r.clause].name.clone();
            Err(Failure::Lost { time: t, what, since: r.since })
        })
    }

    /// Which conditions become true at `(t, x)`, without taking notice of it.
    pub(super) fn becoming(&mut self, t: f64, x: &[f64]) -> Result<Vec<bool>, Failure> {
        let code = self.code.clone();
        let mut becoming = vec![false; code.program.clauses.len()];
        if code.clauses.conditional.is_empty() {
            return Ok(becoming);
        }
        self.place(t, x);
        self.run_becomes(t, Hold::Follow)?;
        for (&clause, &register) in code.clauses.conditional.iter().zip(&code.clauses.becomes.outputs) {
            let ClauseMemory::Becomes(condition) = self.run.clauses[clause] else { continue };
            becoming[clause] = self.frame.r[register as usize] != 0.0 && !condition.holds;
        }
        Ok(becoming)
    }

    /// Computes the conditions of clauses at what is placed.
    fn run_becomes(&mut self, t: f64, hold: Hold) -> Result<(), Failure> {
        let held = std::mem::replace(&mut self.frame.conditions.state, hold);
        let run = self.frame.run(&self.code.clauses.becomes);
        self.frame.conditions.state = held;
        run.map_err(|error| self.failure(t, error))
    }

    /// Which conditions of clauses are true at what is placed.
    pub(super) fn truth_of_clauses(&mut self, t: f64, hold: Hold) -> Result<Vec<bool>, Failure> {
        let code = self.code.clone();
        self.run_becomes(t, hold)?;
        let mut truth = vec![false; code.program.clauses.len()];
        for (&clause, &register) in code.clauses.conditional.iter().zip(&code.clauses.becomes.outputs) {
            truth[clause] = self.frame.r[register as usize] != 0.0;
        }
        Ok(truth)
    }

    /// Lets happen what has been found to happen, and what follows from that at the same instant.
    pub(super) fn run_clauses(&mut self, t: f64, x: &mut [f64]) -> Result<(), Failure> {
        if self.led {
            self.events.fired.fill(false);
        }
        for round in 0..MOST_ROUNDS {
            if !self.events.fired.contains(&true) {
                return Ok(());
            }
            self.release(t, x)?;
            self.notice(t)?;
            self.events.contacts = self.contacts(t, x)?;
            self.new_values(t, x)?;
            self.refuse_conflicts(t)?;
            self.change(t, x, round == 0)?;
            self.leave_solutions();
            self.take_signs_of_leaps(t, x)?;
            self.find_fired(t, x, &[])?;
        }
        let fired = self.code.program.clauses.iter().zip(&self.events.fired).filter(|(_, fired)| **fired);
        let what: Vec<String> = fired.map(|(c, _)| format!("`{}`", c.name)).collect();
        Err(Failure::Livelock { time: t, what: what.join(", ") })
    }

    /// Takes the signs of conditions anew after discrete variables have changed; ratios that leap with them act by impulses.
    fn take_signs_of_leaps(&mut self, t: f64, x: &mut [f64]) -> Result<(), Failure> {
        let leaps = self.code.impulses.as_ref().is_some_and(ImpulseBalance::leaps);
        if leaps {
            self.events.fired.fill(false);
            self.take_stored(t, x)?;
        }
        self.take_signs(t, x)?;
        if leaps && self.balance_leaps(t, x)? {
            self.take_signs(t, x)?;
        }
        Ok(())
    }

    /// These conditions hold, whatever rounding says.
    pub(super) fn let_hold(&mut self, which: &[bool]) {
        for (memory, _) in self.run.clauses.iter_mut().zip(which).filter(|(_, holds)| **holds) {
            if let ClauseMemory::Becomes(condition) = memory {
                condition.holds = true;
            }
        }
    }

    /// Takes over discrete variables from another form of the model; whether any differs.
    pub(super) fn take_discretes(&mut self, from: &Model) -> bool {
        let mut differ = false;
        for (own, other) in self.run.delays_and_samples.iter_mut().zip(&from.run.delays_and_samples) {
            if matches!(other, DelayOrSample::Discrete(_)) && own != other {
                own.clone_from(other);
                differ = true;
            }
        }
        differ
    }

    /// Looks whether events accumulate.
    fn notice(&mut self, t: f64) -> Result<(), Failure> {
        let Model { run, events, code, .. } = self;
        events.at_rest.fill(false);
        for (i, memory) in run.clauses.iter_mut().enumerate() {
            if !events.fired[i] {
                continue;
            }
            if let ClauseMemory::Becomes(condition) = memory
                && let Some((interval, end)) = condition.happens(t)
            {
                if code.program.clauses[i].bound.is_some_and(|b| b.gap.is_some()) {
                    events.at_rest[i] = true;
                    continue;
                }
                let what = code.program.clauses[i].name.clone();
                return Err(Failure::Accumulation { time: t, what, interval, end });
            }
        }
        Ok(())
    }

    /// The new values of the clauses of the round, from what there is before it.
    fn new_values(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        let code = self.code.clone();
        self.place(t, x);
        for (i, routine) in code.clauses.values.iter().enumerate() {
            if !(self.events.fired[i] || self.events.contacts.contains(&i)) {
                continue;
            }
            self.frame.run(routine).map_err(|error| self.failure(t, error))?;
            for (k, &register) in routine.outputs.iter().take(code.program.clauses[i].actions.len()).enumerate() {
                let still = code.clauses.still[i].filter(|_| self.events.at_rest[i]);
                let value = self.frame.r[still.unwrap_or(register) as usize];
                if !value.is_finite() {
                    let clause = &code.program.clauses[i];
                    let what = format!("the value that `{}` gives {}", clause.name, clause.actions[k].name);
                    return Err(Failure::NotFinite { time: t, what: Affected::Other(what) });
                }
                self.events.values[code.clauses.first[i] + k] = value;
            }
            if self.variation.is_some() {
                let actions = code.program.clauses[i].actions.len();
                let still = code.clauses.still[i].filter(|_| self.events.at_rest[i]).map(|_| actions);
                let outputs: Vec<usize> = (0..actions).map(|k| still.unwrap_or(k)).collect();
                self.vary_values(t, x, routine, (code.clauses.first[i], &outputs))?;
            }
        }
        Ok(())
    }

    /// The actions of the round, with their clause and the place of their new value.
    pub(super) fn actions<'m>(
        code: &'m Mode,
        work: &'m EventWork,
    ) -> impl Iterator<Item = (usize, usize, &'m halfarrow_compiler::program::Action)> + 'm {
        let clauses = code.program.clauses.iter().enumerate().filter(|(i, _)| work.fired[*i]);
        clauses
            .flat_map(move |(i, c)| c.actions.iter().enumerate().map(move |(k, a)| (i, code.clauses.first[i] + k, a)))
    }

    /// Two clauses may change one thing if they give it one value.
    fn refuse_conflicts(&self, t: f64) -> Result<(), Failure> {
        let (code, work) = (&*self.code, &self.events);
        for (i, at, action) in Model::actions(code, work) {
            for (j, other, earlier) in Model::actions(code, work).take_while(|(j, ..)| *j < i) {
                if earlier.target == action.target && work.values[other] != work.values[at] {
                    let name = |clause: usize| code.program.clauses[clause].name.clone();
                    let by = Box::new([(name(j), work.values[other]), (name(i), work.values[at])]);
                    return Err(Failure::Conflict { time: t, what: action.name.clone(), by });
                }
            }
        }
        Ok(())
    }

    /// Changes what the round changes: discrete variables and signals, then what storages keep.
    fn change(&mut self, t: f64, x: &mut [f64], first: bool) -> Result<(), Failure> {
        let code = self.code.clone();
        self.take_stored(t, x)?;
        self.take_misses(t, x)?;
        let sums = if code.impulses.is_none() { self.sums(t, x)? } else { Vec::new() };
        let (work, mut set) = (std::mem::take(&mut self.events), false);
        for (_, at, action) in Model::actions(&code, &work) {
            self.vary_change(action.target, at);
            match action.target {
                Target::Discrete(i) => {
                    self.run.delays_and_samples[i as usize] = DelayOrSample::Discrete(work.values[at]);
                    set = true;
                }
                Target::Signal(i) => {
                    x[i as usize] = work.values[at];
                    set = true;
                }
                Target::Moved { .. } | Target::HeldByBranch => {}
            }
        }
        self.events = work;
        // What storages keep is shared out by the ratios that hold from now on, not by those of conditions that have changed.
        if set && (code.impulses.is_some() || code.kept.is_some()) {
            self.take_signs(t, x)?;
        }
        match code.impulses {
            Some(_) => self.balance_impulses(t, x, first)?,
            None => _ = self.conserve_sums(t, x, &sums)?,
        }
        self.refuse_broken_positions(t, x)
    }
}
