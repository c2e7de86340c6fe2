//! Events of a model: what is held between them, and what happens where one is handled.

use super::clause_memory::ClauseMemory;
use super::impulses::ImpulseBalance;
use super::modes::Extents;
use super::positions::Motion;
use super::system::What;
use super::{DelayOrSample, Model};
use crate::bytecode::{Frame, Hold, SolveError};
use halfarrow_compiler::bond_graph::HeldKind;
use halfarrow_compiler::ids::Id;
use halfarrow_compiler::program::{ConditionId, EventTrigger, Op, Reads, Value};
use halfarrow_sim::{Affected, Events, Failure, StepEnd};
use std::collections::{BTreeMap, BTreeSet};

/// Modes that one instant leads through at most.
const MOST_MODES: usize = 200;
/// As many variables tell which condition is meant.
const MOST_NAMES: usize = 3;

impl Model {
    /// Goes on with the Newton solutions at `(t, x)`: those that rates need, and those that only recorded values need.
    pub(super) fn follow_solutions(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        if let Some(solutions) = self.code.clone().solutions.as_ref() {
            let states = &self.frame.r[self.code.layout.states as usize..][..x.len()];
            if self.rated != Some(t) || states != x {
                self.solve_at(t, x)?;
            }
            self.rated = None;
            let newton = solutions.solves.iter().filter(|solve| !solve.guess.is_empty());
            let blocks = newton.map(|solve| solve.block);
            blocks.for_each(|block| self.frame.solvers[block.0 as usize].newton.accept());
            let code = self.code.clone();
            self.follow_motion(t, x, code.motion.as_ref(), true)?;
        }
        if !self.recorded.blocks.is_empty() {
            self.place(t, x);
            self.evaluate(What::Recorded, false, t)?;
            let blocks = self.recorded.blocks.iter();
            blocks.for_each(|block| self.frame.solvers[block.0 as usize].newton.accept());
            let recorded = self.recorded.clone();
            self.follow_motion(t, x, recorded.motion.as_ref(), false)?;
        }
        Ok(())
    }

    /// Notes how computed positions move at `(t, x)`: `own` those that the rates need, else those of recorded values.
    fn follow_motion(&mut self, t: f64, x: &[f64], motion: Option<&Motion>, own: bool) -> Result<(), Failure> {
        let Some(motion) = motion else { return Ok(()) };
        motion.blocks.iter().for_each(|(block, _)| self.frame.solvers[block.0 as usize].newton.arrive(t));
        self.place(t, x);
        let run = if own { self.once(What::Motion, false).map(|_| ()) } else { self.frame.run(&motion.rates) };
        run.map_err(|error| self.failure(t, error))?;
        for (block, rates) in &motion.blocks {
            let Frame { r, solvers, .. } = &mut self.frame;
            let rates = motion.rates.outputs[rates.clone()].iter().map(|&rate| r[rate as usize]);
            let newton = &mut solvers[block.0 as usize].newton;
            if rates.clone().any(|rate| !rate.is_finite()) {
                newton.motion.known = false;
            } else if !newton.note_rates(rates) {
                return Err(self.failure(t, SolveError::OffMotion { block: block.0 }));
            }
        }
        Ok(())
    }

    /// Sets the direction of derivatives to that of the run, with the rates that were computed last.
    pub(super) fn move_along(&mut self, t: f64) {
        self.still();
        self.let_time_pass(t);
        let Model { frame, code, dx, .. } = self;
        frame.d[code.layout.states as usize..][..dx.len()].copy_from_slice(dx);
    }

    /// Values and rates of what is delayed or sampled, in the registers of `sources`; the rates of `dx` along the run.
    fn run_sources(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        self.rates_at(t, x)?;
        self.move_along(t);
        let run = self.frame.run_along(&self.code.sources);
        run.map_err(|error| self.failure(t, error))
    }

    fn source(&self, i: usize) -> (f64, f64) {
        let register = self.code.sources.outputs[i] as usize;
        (self.frame.r[register], self.frame.d[register])
    }

    /// Delays and samples at the start of a run. They may read each other: passes until nothing changes.
    pub(super) fn begin_delays_and_samples(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        for _ in 0..self.run.delays_and_samples.len() {
            self.place(t, x);
            self.run_sources(t, x)?;
            for i in 0..self.run.delays_and_samples.len() {
                let (value, slope) = self.source(i);
                match &mut self.run.delays_and_samples[i] {
                    DelayOrSample::Delay(delay) => delay.begin(t, value, slope),
                    DelayOrSample::Sample(sample) => sample.begin(t, value),
                    DelayOrSample::Discrete(own) => *own = value,
                }
            }
        }
        self.place(t, x);
        Ok(())
    }

    /// Takes the samples that are due, in order: each sees those taken before it.
    fn take_samples(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        for i in 0..self.run.delays_and_samples.len() {
            if matches!(&self.run.delays_and_samples[i], DelayOrSample::Sample(sample) if sample.is_due(t)) {
                self.place(t, x);
                self.run_sources(t, x)?;
                let (value, _) = self.source(i);
                if let DelayOrSample::Sample(sample) = &mut self.run.delays_and_samples[i] {
                    sample.value = value;
                    sample.pass(t);
                }
                self.vary_sample(t, x, i)?;
            }
        }
        Ok(())
    }

    pub(super) fn take_signs(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        self.place(t, x);
        if self.code.switching.is_empty() {
            self.frame.conditions.state = Hold::Keep;
            return Ok(());
        }
        // What stands at the end of a branch is on the side to which it moves.
        let sides = self.sides_of_bounds(t, x)?;
        self.place(t, x);
        self.frame.conditions.state = Hold::Take;
        let run = self.frame.run(&self.code.indicators);
        let frame = &mut self.frame;
        for (&condition, &register) in self.code.switching.iter().zip(&self.code.indicators.outputs) {
            frame.conditions.value(condition, frame.r[register as usize], &frame.tables);
        }
        sides.into_iter().for_each(|(condition, ended)| frame.conditions.take(condition, f64::from(ended)));
        frame.conditions.state = Hold::Keep;
        self.run.signs_taken = Some(t);
        run.map_err(|error| self.failure(t, error))
    }

    /// Whether all conditions of the state are on the sides that are held, where the model has been placed.
    pub(super) fn holds_its_sides(&mut self, t: f64) -> Result<bool, Failure> {
        let run = self.frame.run(&self.code.indicators);
        run.map_err(|error| self.failure(t, error))?;
        let (frame, floors) = (&self.frame, &self.run.floors);
        let holds = |(&id, &register): (&ConditionId, &u32)| {
            let operand = frame.r[register as usize];
            let beyond = frame.conditions.beyond(id, operand, &frame.tables)[0];
            beyond.abs() <= floors[id.0 as usize] || !frame.conditions.has_left(id, operand, &frame.tables)
        };
        Ok(self.code.switching.iter().zip(&self.code.indicators.outputs).all(holds))
    }

    /// Handles an event. `told` says of some clauses that they happen, of those that another form of the model has seen.
    pub(super) fn handle(&mut self, t: f64, x: &mut [f64], told: &[bool]) -> Result<(), Failure> {
        self.frame.forget_orientations();
        if t < self.run.crossed {
            self.restart();
        }
        if let Some(failure) = self.broken().filter(|_| !self.run.begun) {
            return Err(failure);
        }
        let leaps = self.code.impulses.as_ref().is_some_and(ImpulseBalance::leaps);
        let sums = if self.run.begun && !leaps { self.sums(t, x)? } else { Vec::new() };
        if self.run.begun && leaps {
            self.events.fired.fill(false);
            self.take_stored(t, x)?;
        }
        self.run.crossed = t;
        // Positions may be others after it.
        self.run.steepest = None;
        self.rated = None;
        let inputs = &self.setup.inputs;
        self.run.pieces.iter_mut().zip(inputs).for_each(|(piece, signal)| *piece = signal.piece(t));
        self.frame.conditions.state = Hold::Follow;
        // Solutions of nonlinear laws may jump at an event.
        self.leave_solutions();
        self.handle_time_event(t);
        if !self.run.begun {
            self.begin_delays_and_samples(t, x)?;
            self.vary_begin(t, x)?;
            self.run.begun = true;
            self.note_compared(t, x)?;
            self.take_signs(t, x)?;
            self.begin_contacts(t, x)?;
            self.begin_clauses(t, x)?;
        } else {
            let conserve = |model: &mut Model, x: &mut [f64]| match leaps {
                true => model.balance_leaps(t, x),
                false => model.conserve_sums(t, x, &sums),
            };
            conserve(self, x)?;
            self.take_samples(t, x)?;
            conserve(self, x)?;
            self.take_signs(t, x)?;
            if conserve(self, x)? {
                self.take_signs(t, x)?;
            }
            self.find_fired(t, x, told)?;
        }
        self.settle_all(t, x)?;
        if self.has_delays() {
            self.run_sources(t, x)?;
            for i in 0..self.run.delays_and_samples.len() {
                let (value, slope) = self.source(i);
                if let DelayOrSample::Delay(delay) = &mut self.run.delays_and_samples[i] {
                    delay.jump(t, value, slope);
                }
            }
        }
        self.note_returns(t, x)?;
        self.follow_solutions(t, x)
    }

    /// Lets happen what has been found to happen, and goes on in the mode that holds after it.
    pub(super) fn settle_all(&mut self, t: f64, x: &mut [f64]) -> Result<(), Failure> {
        self.note_compared(t, x)?;
        self.run_clauses(t, x)?;
        for _ in 0..MOST_MODES {
            if !self.settle_mode(t, x)? {
                return Ok(());
            }
            self.switched = true;
            self.find_fired(t, x, &[])?;
            self.run_clauses(t, x)?;
        }
        let what = self.laws_ended(t, x)?.join(", ");
        Err(Failure::Livelock { time: t, what })
    }

    /// Goes on in another mode: where the present one has ended, or with other independent variables.
    fn exchange_or_settle(&mut self, t: f64, x: &mut [f64], step: StepEnd) -> Result<bool, Failure> {
        if std::mem::take(&mut self.switched) {
            return Ok(true);
        }
        if step != StepEnd::Failed && self.is_margin_below(t, x)? {
            self.keeping(t, x, |model, x| {
                model.find_fired(t, x, &[])?;
                model.settle_all(t, x)
            })?;
            if std::mem::take(&mut self.switched) {
                return Ok(true);
            }
        }
        self.exchange(t, x, step)
    }

    pub(super) fn has_delays(&self) -> bool {
        self.run.delays_and_samples.iter().any(|h| matches!(h, DelayOrSample::Delay(_)))
    }
}

impl Model {
    /// Whether time, an input or a delay reaches one of these values but through a condition, which changes at an event.
    fn moves_with_time(&self, seen: &[Value]) -> bool {
        let program = &self.code.program;
        let has_event = |condition| program.conditions[condition].trigger != EventTrigger::RecordedOnly;
        let varies = |value: &Value| program.values.reads(*value) != Reads::PARAMETERS;
        let mut reached = vec![false; program.values.len()];
        seen.iter().for_each(|value| reached[value.index()] = true);
        for (value, op) in program.values.iter().rev().filter(|(value, _)| varies(value)) {
            if !reached[value.index()] {
                continue;
            }
            match op {
                Op::Time => return true,
                Op::Input(input) if !self.inputs()[input as usize].is_constant() => return true,
                Op::Held(held) if program.held[held as usize].kind == HeldKind::Delay => return true,
                Op::Sign(condition, _) | Op::Floor(condition, _) if has_event(condition) => {}
                Op::Solution(block, _) => program.blocks[block].reads().for_each(|read| reached[read.index()] = true),
                _ => op.for_each_operand(|read| reached[read.index()] = true),
            }
        }
        false
    }

    /// Takes conditions on time as they are just after `t`, and looks when the first of them changes.
    pub(super) fn handle_time_event(&mut self, t: f64) {
        self.code.clock.handle_time_event(&mut self.frame, t, &mut self.run.clock_event);
        self.run.longest_step = self.code.clock.longest_step(&mut self.frame, t);
    }
}

impl Events for Model {
    fn next_time_event(&mut self, t: f64) -> Option<f64> {
        let inputs = self.inputs().iter().filter_map(|signal| signal.next_corner(t));
        let held = self.run.delays_and_samples.iter().filter_map(|held| match held {
            DelayOrSample::Delay(delay) => delay.next_time_event(t),
            DelayOrSample::Sample(sample) => Some(sample.next_time()),
            DelayOrSample::Discrete(_) => None,
        });
        let periods = self.run.clauses.iter().filter_map(ClauseMemory::next_time);
        inputs.chain(held).chain(periods).chain(self.run.clock_event).filter(|&next| next > t).reduce(f64::min)
    }

    fn is_corner(&mut self, t: f64) -> bool {
        let held = self.run.delays_and_samples.iter().any(|held| match held {
            DelayOrSample::Delay(delay) => delay.next_time_event(self.run.crossed) == Some(t),
            DelayOrSample::Sample(sample) => sample.is_due(t),
            DelayOrSample::Discrete(_) => false,
        }) || self.run.clauses.iter().any(|c| c.is_due(t));
        !held && self.run.clock_event != Some(t) && !self.inputs().iter().any(|signal| signal.jumps_at(t))
    }

    fn passed_pole(&mut self, t: f64) -> Result<(), Failure> {
        match self.frame.passed_pole() {
            Some(block) => Err(self.failure(t, SolveError::Singular { block })),
            None => Ok(()),
        }
    }

    fn handle_event(&mut self, t: f64, x: &mut [f64]) -> Result<(), Failure> {
        self.keeping(t, x, |model, x| model.handle(t, x, &[]))
    }

    fn exchange_independent(&mut self, t: f64, x: &mut [f64], step: StepEnd) -> Result<bool, Failure> {
        self.exchange_or_settle(t, x, step)
    }

    fn project(&mut self, t: f64, x: &mut [f64]) -> Result<bool, Failure> {
        self.put_back(t, x)
    }

    fn try_end(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        if self.code.motion.is_some() {
            self.solve_at(t, x)?;
        }
        let recorded = self.recorded.clone();
        let Some(motion) = &recorded.motion else { return Ok(()) };
        self.place(t, x);
        self.frame.run(&motion.rates).map_err(|error| self.failure(t, error))
    }

    fn longest_step(&self) -> f64 {
        let idle = self.code.motion.iter().chain(&self.recorded.motion).flat_map(|motion| &motion.idle);
        let longest = idle.map(|block| self.frame.solvers[block.0 as usize].newton.longest_way());
        longest.fold(self.run.longest_step, f64::min)
    }

    fn stands_still(&self) -> bool {
        let program = &self.code.program;
        let recorded = self.recorded.chosen.iter().filter_map(|&i| program.observed[i].value.clone().ok());
        let watched = program.conditions.values().filter(|condition| condition.trigger == EventTrigger::State);
        let rates = program.states.iter().map(|state| state.rate);
        let seen: Vec<Value> = recorded.chain(watched.map(|condition| condition.operand)).chain(rates).collect();
        !self.moves_with_time(&seen)
    }

    fn note_magnitudes(&mut self, t: f64, x: &[f64], magnitudes: &[f64]) -> Result<(), Failure> {
        if self.code.bounds.is_none() {
            return Ok(());
        }
        let code = self.code.clone();
        for (&symbol, &magnitude) in code.program.tracked.iter().zip(magnitudes) {
            Extents::note(&mut self.run.extents.states, symbol, magnitude);
        }
        self.watch_bounds(t, x)
    }

    fn looks_between(&self) -> bool {
        self.code.bounds.is_some()
    }

    fn locates_crossings(&self) -> bool {
        !self.code.clauses.conditional.is_empty() || self.code.moved_edges
    }

    fn accept(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        self.watch_returns(t, x)?;
        if self.has_delays() {
            self.place(t, x);
            self.run_sources(t, x)?;
            for i in 0..self.run.delays_and_samples.len() {
                let (value, slope) = self.source(i);
                if let DelayOrSample::Delay(delay) = &mut self.run.delays_and_samples[i] {
                    delay.append(t, value, slope);
                }
            }
        }
        self.follow_solutions(t, x)?;
        self.note_kept(t, x)
    }

    fn indicators(&self) -> usize {
        self.code.switching.iter().map(|&c| self.code.program.conditions[c].kind.switches()).sum()
    }

    fn indicator_name(&self, indicator: usize) -> String {
        let program = &self.code.program;
        let switches =
            self.code.switching.iter().flat_map(|&c| std::iter::repeat_n(c, program.conditions[c].kind.switches()));
        let operand = switches.map(|c| program.conditions[c].operand).nth(indicator);
        // The variables with names that it is nearest to.
        let named: BTreeMap<Value, &str> =
            program.observed.iter().rev().filter_map(|o| Some((*o.value.as_ref().ok()?, &*o.name))).collect();
        let (mut level, mut seen): (Vec<Value>, BTreeSet<Value>) = (operand.into_iter().collect(), BTreeSet::new());
        while !level.is_empty() {
            let names: BTreeSet<&str> = level.iter().filter_map(|value| named.get(value).copied()).collect();
            if !names.is_empty() {
                let names: Vec<String> = names.into_iter().take(MOST_NAMES).map(|name| format!("`{name}`")).collect();
                return format!("a condition on {}", names.join(", "));
            }
            let mut below = Vec::new();
            level.iter().for_each(|&value| program.values.op(value).for_each_operand(|operand| below.push(operand)));
            level = below.into_iter().filter(|&value| seen.insert(value)).collect();
        }
        format!("condition {}", indicator + 1)
    }

    fn event_indicators(&mut self, t: f64, x: &[f64], g: &mut [f64]) -> Result<(), Failure> {
        self.place(t, x);
        self.evaluate(What::Indicators, false, t)?;
        let frame = &self.frame;
        let mut next = 0;
        for (&condition, &register) in self.code.switching.iter().zip(&self.code.indicators.outputs) {
            let mut beyond = frame.conditions.beyond(condition, frame.r[register as usize], &frame.tables);
            let floor = self.run.floors[condition.0 as usize];
            if self.run.signs_taken == Some(t) || floor > 0.0 && beyond[0].abs() <= floor {
                frame.conditions.confirm(condition, &mut beyond);
                // What rounding makes of a zero bends nothing.
                beyond[0] = floor.max(beyond[0].abs()).copysign(beyond[0]);
            }
            let count = self.code.program.conditions[condition].kind.switches();
            g[next..next + count].copy_from_slice(&beyond[..count]);
            next += count;
        }
        Ok(())
    }

    fn angles(&self, angles: &mut Vec<f64>) {
        let registers = &self.code.indicators.outputs[self.code.switching.len()..];
        angles.clear();
        angles.extend(registers.iter().map(|&register| self.frame.r[register as usize]));
    }

    fn observed(&self) -> usize {
        self.recorded.chosen.len()
    }

    fn observed_name(&self, value: usize) -> String {
        self.code.program.observed[self.recorded.chosen[value]].name.to_string()
    }

    fn observe(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        self.place(t, x);
        self.place_shares(t)?;
        self.evaluate(What::Recorded, false, t)?;
        out.iter_mut().zip(&self.recorded.routine.outputs).for_each(|(out, &r)| *out = self.frame.r[r as usize]);
        match out.iter().position(|value| value.is_nan()).or(out.iter().position(|value| value.is_infinite())) {
            // What a modeller computes for himself may be infinite, what a law gives may not.
            Some(value) if out[value].is_infinite() => self.explain(t).map_or(Ok(()), Err)?,
            Some(value) => {
                let not_finite = Failure::NotFinite { time: t, what: Affected::variable(self.observed_name(value)) };
                return Err(self.explain(t).unwrap_or(not_finite));
            }
            None => {}
        }
        Ok(())
    }
}
