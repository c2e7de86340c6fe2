//! Events: their instant moves with what is varied, and so does what they leave (saltation). Up to the event the run moves by
//! `s`, at its instant `τ` by `s + f⁻ dτ`; what the event makes of that is differentiated step by step as it is computed; after
//! it the run moves by what this gives less `f⁺ dτ`. Source: [GalanFeeheryBarton].

use super::super::impulses::ImpulseBalance;
use super::super::jumps::ConservedSums;
use super::super::minimum_norm;
use super::super::{DelayOrSample, Model};
use halfarrow_compiler::ids::Id;
use halfarrow_compiler::program::{ConditionId, Op, Target, Trigger};
use halfarrow_sim::{Events, Failure, System};

/// Instants of several conditions that differ by less than this part are one.
const SAME: f64 = 1e-6;
/// Rates that differ by less than this part do not jump.
pub(super) const SMOOTH: f64 = 1e-9;
/// What equations for derivatives may miss, as part of their terms.
const MET: f64 = 1e-8;

/// How the instant of an event moves with a quantity.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Instant {
    /// Nothing tells.
    Unknown,
    Moves(f64),
    /// Conditions reach their borders together, and would not any longer; or one touches its border only.
    Parts,
}

impl Instant {
    fn and(self, moves: f64) -> Instant {
        match self {
            _ if !moves.is_finite() => Instant::Parts,
            Instant::Unknown => Instant::Moves(moves),
            Instant::Moves(own) if (own - moves).abs() <= SAME * own.abs().max(moves.abs()) => self,
            Instant::Moves(_) | Instant::Parts => Instant::Parts,
        }
    }
}

impl Model {
    /// Handles an event, and differentiates what it does: `s` are the derivatives of the states, quantity by quantity.
    pub(super) fn handle_varied(&mut self, t: f64, x: &mut [f64], s: &mut [f64]) -> Result<(), Failure> {
        let n = x.len();
        let begins = !self.run.begun || t < self.run.crossed;
        let mut before = vec![0.0; n];
        let mut instants = vec![Instant::Moves(0.0); self.varied_by().len()];
        let mut crossed = Vec::new();
        if !begins {
            self.rates(t, x, &mut before)?;
            crossed = self.crossed(t, x)?;
            instants = self.instants(t, x, s, &before, &crossed)?;
        }
        let variation = self.variation.as_mut().expect("it is varied");
        for (j, instant) in instants.iter().enumerate() {
            let moves = if let Instant::Moves(moves) = instant { *moves } else { 0.0 };
            variation.instant[j] = moves;
            for i in 0..n {
                variation.states[j][i] = s[j * n + i] + if moves == 0.0 { 0.0 } else { before[i] * moves };
            }
        }
        let (held, old) = (self.run.delays_and_samples.clone(), x.to_vec());
        self.handle_event(t, x)?;
        let mut after = vec![0.0; n];
        self.rates(t, x, &mut after)?;
        if !begins && instants.iter().any(|i| !matches!(i, Instant::Moves(_))) {
            let is_same = |(a, b): (&f64, &f64)| (a - b).abs() <= SMOOTH * a.abs().max(b.abs());
            let smooth = old == *x && held == self.run.delays_and_samples && before.iter().zip(&after).all(is_same);
            if !smooth {
                return Err(self.apart(t, &crossed));
            }
        }
        let variation = self.variation.as_mut().expect("it is varied");
        for j in 0..instants.len() {
            let moves = std::mem::replace(&mut variation.instant[j], 0.0);
            variation.passed[j] = moves;
            for i in 0..n {
                s[j * n + i] = variation.states[j][i] - if moves == 0.0 { 0.0 } else { after[i] * moves };
            }
        }
        match s.iter().position(|slope| !slope.is_finite()) {
            None => Ok(()),
            Some(at) => {
                let what = format!("{} by {}", self.state_name(at % n), self.varied_by()[at / n]);
                Err(Model::without_derivative(t, what, "it is not a finite number after the event"))
            }
        }
    }

    /// That derivatives are not taken over into another mode, where branches of these laws have ended.
    pub(in crate::model) fn undifferentiated_mode(&self, time: f64, ended: impl Iterator<Item = u32>) -> Failure {
        let mut laws: Vec<&str> = ended.map(|law| self.code.program.set_valued[law as usize].name.as_str()).collect();
        laws.dedup();
        let (what, reason) = match laws.is_empty() {
            true => (
                "the motion".to_string(),
                "it goes on in other independent variables or branches, and derivatives are not taken over",
            ),
            false => {
                (laws.join(", "), "another branch holds from there on, and derivatives are not taken over into it")
            }
        };
        Model::without_derivative(time, what, reason)
    }

    /// That the instant of an event is no differentiable function of what is varied.
    fn apart(&self, time: f64, crossed: &[(ConditionId, usize, bool)]) -> Failure {
        let values = &self.code.program.values;
        let reads = |clause: &halfarrow_compiler::program::Clause| match clause.trigger {
            Trigger::Becomes(value) => match values.op(value) {
                Op::Sign(condition, _) => crossed.iter().any(|c| c.0 == condition),
                _ => true,
            },
            Trigger::Every(_) => false,
        };
        let clauses = self.code.program.clauses.iter().filter(|clause| clause.bound.is_none() && reads(clause));
        let names: Vec<String> = clauses.map(|clause| format!("`{}`", clause.name)).collect();
        let what = if names.is_empty() { "what switches there".to_string() } else { names.join(", ") };
        let reason = match crossed.len() {
            0 => "nothing tells how the instant of what happens there moves",
            1 => "its border is only touched there, not crossed",
            _ => "conditions reach their borders together there, and one before the other where parameters move",
        };
        Model::without_derivative(time, what, reason)
    }

    /// The conditions that change where the run stands, before the event is handled: with their operand among the outputs of
    /// its routine, and whether they are of time alone.
    fn crossed(&mut self, t: f64, x: &[f64]) -> Result<Vec<(ConditionId, usize, bool)>, Failure> {
        let code = self.code.clone();
        let mut crossed = Vec::new();
        self.place(t, x);
        self.frame.run(&code.indicators).map_err(|error| self.failure(t, error))?;
        for (output, (&condition, &register)) in code.switching.iter().zip(&code.indicators.outputs).enumerate() {
            if self.frame.conditions.has_left(condition, self.frame.r[register as usize], &self.frame.tables) {
                crossed.push((condition, output, false));
            }
        }
        if self.run.clock_event.is_some_and(|event| event <= t) {
            let kept = self.frame.conditions.held();
            let mut next = self.run.clock_event;
            let before = self.frame.conditions.held.clone();
            code.clock.handle_time_event(&mut self.frame, t, &mut next);
            let after = self.frame.conditions.held.clone();
            self.frame.conditions.hold_again(&kept);
            for (output, condition) in code.clock.conditions().enumerate() {
                if before[condition.index()] != after[condition.index()] {
                    crossed.push((condition, output, true));
                }
            }
        }
        Ok(crossed)
    }

    /// How the instant moves with each quantity.
    fn instants(
        &mut self,
        t: f64,
        x: &[f64],
        s: &[f64],
        rates: &[f64],
        crossed: &[(ConditionId, usize, bool)],
    ) -> Result<Vec<Instant>, Failure> {
        let (code, n) = (self.code.clone(), x.len());
        let mut instants = vec![Instant::Unknown; self.varied_by().len()];
        // What is given beforehand does not move, but for what is due after so many periods.
        if self.inputs().iter().any(|signal| signal.is_corner_at(t)) {
            instants.iter_mut().for_each(|instant| *instant = instant.and(0.0));
        }
        let samples = self.run.delays_and_samples.iter().zip(&code.program.held);
        let samples = samples.filter(|(held, _)| matches!(held, DelayOrSample::Sample(sample) if sample.is_due(t)));
        let periods = samples.map(|(_, held)| held.time);
        let clauses = self.run.clauses.iter().zip(&code.program.clauses).filter(|(memory, _)| memory.is_due(t));
        let due: Vec<_> = periods.chain(clauses.map(|(_, clause)| clause.trigger.value())).collect();
        for period in due {
            let Some(register) = code.layout.registers.get(period) else { continue };
            let whole = (t / self.frame.r[register as usize]).round();
            for (j, instant) in instants.iter_mut().enumerate() {
                let slope = self.variation.as_ref().expect("it is varied").fixed[j][register as usize];
                *instant = instant.and(whole * slope);
            }
        }
        for clock in [false, true] {
            let of = || crossed.iter().filter(move |c| c.2 == clock);
            if of().next().is_none() {
                continue;
            }
            let routine = if clock { code.clock.routine() } else { &code.indicators };
            // Along the motion.
            self.place(t, x);
            self.still();
            self.let_time_pass(t);
            self.frame.d[code.layout.states as usize..][..n].copy_from_slice(rates);
            self.frame.run_along(routine).map_err(|error| self.failure(t, error))?;
            let along: Vec<f64> = of().map(|c| self.frame.d[routine.outputs[c.1] as usize]).collect();
            for (j, instant) in instants.iter_mut().enumerate() {
                let slopes = self.run_varied(j, (t, x), (&s[j * n..][..n], 0.0), routine)?;
                for (c, along) in of().zip(&along) {
                    *instant = instant.and(-slopes[c.1] / along);
                }
            }
        }
        Ok(instants)
    }

    /// Derivatives of what a routine gives, quantity by quantity, while an event is handled.
    fn outputs_varied(
        &mut self,
        t: f64,
        x: &[f64],
        routine: &crate::bytecode::Routine,
    ) -> Result<Vec<Vec<f64>>, Failure> {
        let mut all = Vec::new();
        for j in 0..self.varied_by().len() {
            let (states, instant) = (self.states_of(j), self.instant_of(j));
            all.push(self.run_varied(j, (t, x), (&states, instant), routine)?);
        }
        Ok(all)
    }

    /// Differentiates the sums that a jump of a source conserves.
    pub(in crate::model) fn vary_sums(&mut self, t: f64, x: &[f64], kept: &ConservedSums) -> Result<(), Failure> {
        if self.variation.is_some() {
            let sums = self.outputs_varied(t, x, kept.routine())?;
            self.variation.as_mut().expect("it is varied").sums = sums;
        }
        Ok(())
    }

    /// Differentiates the speeds that keep them, after these were found.
    pub(in crate::model) fn vary_conserved(&mut self, t: f64, x: &[f64], kept: &ConservedSums) -> Result<(), Failure> {
        if self.variation.is_none() {
            return Ok(());
        }
        let now = self.outputs_varied(t, x, kept.routine())?;
        let n = kept.states().len();
        let mut matrix = vec![0.0; n * n];
        for (column, &state) in kept.states().iter().enumerate() {
            self.place(t, x);
            self.still();
            self.frame.d[self.code.layout.states as usize + state] = 1.0;
            self.frame.run_along(kept.routine()).map_err(|error| self.failure(t, error))?;
            for (row, &register) in kept.routine().outputs.iter().enumerate() {
                matrix[row * n + column] = self.frame.d[register as usize];
            }
        }
        for (j, now) in now.iter().enumerate() {
            let variation = self.variation.as_mut().expect("it is varied");
            let missed: Vec<f64> = now.iter().zip(&variation.sums[j]).map(|(now, before)| now - before).collect();
            let step = minimum_norm::step(&matrix, &missed, n).filter(|step| step.rank == n);
            let Some(step) = step else {
                return Err(Model::without_derivative(
                    t,
                    "the speeds after a jump of a source or a law",
                    "they do not follow uniquely",
                ));
            };
            kept.states().iter().zip(&step.step).for_each(|(&i, step)| variation.states[j][i] += step);
        }
        Ok(())
    }

    /// Differentiates what storages keep before a round.
    pub(in crate::model) fn vary_stored(&mut self, t: f64, x: &[f64], balance: &ImpulseBalance) -> Result<(), Failure> {
        if self.variation.is_some() {
            let stored = self.outputs_varied(t, x, balance.stored())?;
            self.variation.as_mut().expect("it is varied").stored = stored;
        }
        Ok(())
    }

    /// Differentiates a signal that is sampled.
    pub(in crate::model) fn vary_sample(&mut self, t: f64, x: &[f64], i: usize) -> Result<(), Failure> {
        if self.variation.is_some() {
            let code = self.code.clone();
            let sources = self.outputs_varied(t, x, &code.sources)?;
            let held = &mut self.variation.as_mut().expect("it is varied").held;
            held.iter_mut().zip(sources).for_each(|(held, sources)| held[i] = sources[i]);
        }
        Ok(())
    }

    /// Differentiates the new values of a clause, which are these outputs of its routine.
    pub(in crate::model) fn vary_values(
        &mut self,
        t: f64,
        x: &[f64],
        routine: &crate::bytecode::Routine,
        (first, outputs): (usize, &[usize]),
    ) -> Result<(), Failure> {
        for j in 0..self.varied_by().len() {
            let (states, instant) = (self.states_of(j), self.instant_of(j));
            let slopes = self.run_varied(j, (t, x), (&states, instant), routine)?;
            let values = &mut self.variation.as_mut().expect("it is varied").values[j][first..];
            values.iter_mut().zip(outputs).for_each(|(value, &output)| *value = slopes[output]);
        }
        Ok(())
    }

    /// Gives discrete variables and signals the derivatives of their new values.
    pub(in crate::model) fn vary_change(&mut self, target: Target, at: usize) {
        let Some(variation) = &mut self.variation else { return };
        for j in 0..variation.by.len() {
            match target {
                Target::Discrete(i) => variation.held[j][i as usize] = variation.values[j][at],
                Target::Signal(i) => variation.states[j][i as usize] = variation.values[j][at],
                Target::Moved { .. } | Target::HeldByBranch => {}
            }
        }
    }

    /// Differentiates states, conserved constants and impulses after a balance; the impulses are told from here where they
    /// are `told`, as of the `first` round.
    pub(in crate::model) fn vary_balance(
        &mut self,
        t: f64,
        x: &[f64],
        balance: &ImpulseBalance,
        (told, first): (bool, bool),
    ) -> Result<(), Failure> {
        if self.variation.is_none() {
            return Ok(());
        }
        let mut work = std::mem::take(&mut self.events.impulses);
        let balanced = self.balanced(t, x, balance, &mut work);
        let (matrix, m) = (work.equations().matrix.clone(), balance.unknowns() + work.resets());
        let mut steps = Vec::new();
        for j in 0..self.varied_by().len() {
            let (states, instant) = (self.states_of(j), self.instant_of(j));
            let moves = self.run_varied(j, (t, x), (&states, instant), balance.all())?;
            let variation = self.variation.as_ref().expect("it is varied");
            let slopes =
                balance.residuals_along(&work, (&self.frame, &moves), &variation.stored[j], &variation.values[j]);
            let step = minimum_norm::step(&matrix, &slopes, m).filter(|step| step.rank == m);
            steps.push(step.filter(|step| step.meets(&matrix, &slopes, MET)));
        }
        let impulses: Vec<usize> = work.asked_impulses(balance).collect();
        self.events.impulses = work;
        balanced?;
        for (j, step) in steps.into_iter().enumerate() {
            let Some(step) = step.map(|step| step.step) else {
                let what = self.what_is_reset();
                return Err(Model::without_derivative(
                    t,
                    what,
                    "impulses do not follow uniquely from what is asked for",
                ));
            };
            let variation = self.variation.as_mut().expect("it is varied");
            for (&u, step) in balance.unknown_numbers().iter().zip(&step) {
                match (u as usize).checked_sub(x.len()) {
                    None => variation.states[j][u as usize] += step,
                    Some(constant) => variation.conserved[j][constant] += step,
                }
            }
            if told {
                if first {
                    impulses.iter().for_each(|&held| variation.held[j][held] = 0.0);
                }
                let own = impulses.iter().zip(&step[balance.unknowns()..]);
                own.for_each(|(&held, step)| variation.held[j][held] += step);
            }
        }
        Ok(())
    }

    /// Differentiates signals that are held where a run begins.
    pub(in crate::model) fn vary_begin(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        self.vary_held(t, x).map(|_| ())
    }
}
