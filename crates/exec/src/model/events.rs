//! Events of a model: what is held between them, and what happens where one is handled.

use super::system::What;
use super::{Held, Model};
use crate::bytecode::Hold;
use halfarrow_sim::{Events, Failure};

impl Model {
    /// Goes on with the Newton solutions at `(t, x)`: those that rates need, and those that only recorded values need.
    fn follow_solutions(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        if self.rates.solves.iter().any(|solve| !solve.guess.is_empty()) {
            let states = &self.frame.r[self.layout.states as usize..][..x.len()];
            if self.rated != Some(t) || states != x {
                self.rates_at(t, x)?;
            }
            self.rated = None;
            let blocks = self.rates.solves.iter().map(|solve| solve.block);
            blocks.for_each(|block| self.frame.solvers[block.0 as usize].newton.accept());
        }
        if !self.shown_blocks.is_empty() {
            self.place(t, x);
            self.evaluate(What::Recorded, false, t)?;
            let blocks = self.shown_blocks.iter();
            blocks.for_each(|block| self.frame.solvers[block.0 as usize].newton.accept());
        }
        Ok(())
    }

    /// Values and rates of what is delayed or sampled, in the registers of `sources`; the rates of `dx` along the run.
    fn run_sources(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        self.rates_at(t, x)?;
        self.still();
        self.let_time_pass(t);
        let Model { frame, layout, dx, .. } = self;
        frame.d[layout.states as usize..][..dx.len()].copy_from_slice(dx);
        let run = self.frame.run_along(&self.sources);
        run.map_err(|trouble| self.failure(t, trouble))
    }

    fn source(&self, i: usize) -> (f64, f64) {
        let register = self.sources.outputs[i] as usize;
        (self.frame.r[register], self.frame.d[register])
    }

    /// Held signals at the start of a run. They may read each other: passes until nothing changes.
    pub(super) fn begin_held(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        for _ in 0..self.held.len() {
            self.place(t, x);
            self.run_sources(t, x)?;
            for i in 0..self.held.len() {
                let (value, slope) = self.source(i);
                match &mut self.held[i] {
                    Held::Delay(delay) => delay.begin(t, value, slope),
                    Held::Sample(sample) => sample.begin(t, value),
                }
            }
        }
        self.place(t, x);
        Ok(())
    }

    /// Takes the samples that are due, in order: each sees those taken before it.
    fn take_samples(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        for i in 0..self.held.len() {
            if matches!(&self.held[i], Held::Sample(sample) if sample.is_due(t)) {
                self.place(t, x);
                self.run_sources(t, x)?;
                let (value, _) = self.source(i);
                if let Held::Sample(sample) = &mut self.held[i] {
                    sample.value = value;
                    sample.pass(t);
                }
            }
        }
        Ok(())
    }

    fn take_signs(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        self.place(t, x);
        if self.switches.is_empty() {
            self.frame.conditions.state = Hold::Keep;
            return Ok(());
        }
        self.frame.conditions.state = Hold::Take;
        let run = self.frame.run(&self.switching);
        let frame = &mut self.frame;
        for (&condition, &register) in self.switches.iter().zip(&self.switching.outputs) {
            frame.conditions.value(condition, frame.r[register as usize], &frame.tables);
        }
        frame.conditions.state = Hold::Keep;
        self.sides_taken = Some(t);
        run.map_err(|trouble| self.failure(t, trouble))
    }

    pub(super) fn has_delays(&self) -> bool {
        self.held.iter().any(|h| matches!(h, Held::Delay(_)))
    }
}

impl Events for Model {
    fn next_time_event(&mut self, t: f64) -> Option<f64> {
        let inputs = self.inputs.iter().filter_map(|signal| signal.next_corner(t));
        let held = self.held.iter().filter_map(|held| match held {
            Held::Delay(delay) => delay.next_time_event(t),
            Held::Sample(sample) => Some(sample.next_time()),
        });
        inputs.chain(held).chain(self.clock.next).filter(|&next| next > t).reduce(f64::min)
    }

    fn is_corner(&mut self, t: f64) -> bool {
        let held = self.held.iter().any(|held| match held {
            Held::Delay(delay) => delay.next_time_event(self.crossed) == Some(t),
            Held::Sample(sample) => sample.is_due(t),
        });
        !held && self.clock.next != Some(t) && !self.inputs.iter().any(|signal| signal.jumps_at(t))
    }

    fn handle_event(&mut self, t: f64, x: &mut [f64]) -> Result<(), Failure> {
        if t < self.crossed {
            self.restart();
        }
        if let Some(failure) = self.broken().filter(|_| !self.begun) {
            return Err(failure);
        }
        let sums = if self.begun { self.sums(t, x)? } else { Vec::new() };
        self.crossed = t;
        self.rated = None;
        self.inputs.iter_mut().for_each(|signal| signal.hold(t));
        self.frame.conditions.state = Hold::Follow;
        // A solution may leap where something jumps.
        self.frame.solvers.iter_mut().for_each(|s| s.newton.leave());
        self.clock.cross(&mut self.frame, t);
        if !self.begun {
            self.begin_held(t, x)?;
            self.begun = true;
            self.take_signs(t, x)?;
        } else {
            self.keep_sums(t, x, &sums)?;
            self.take_samples(t, x)?;
            self.keep_sums(t, x, &sums)?;
            self.take_signs(t, x)?;
            if self.keep_sums(t, x, &sums)? {
                self.take_signs(t, x)?;
            }
        }
        if self.has_delays() {
            self.run_sources(t, x)?;
            for i in 0..self.held.len() {
                let (value, slope) = self.source(i);
                if let Held::Delay(delay) = &mut self.held[i] {
                    delay.jump(t, value, slope);
                }
            }
        }
        self.follow_solutions(t, x)
    }

    fn accept(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        if self.has_delays() {
            self.place(t, x);
            self.run_sources(t, x)?;
            for i in 0..self.held.len() {
                let (value, slope) = self.source(i);
                if let Held::Delay(delay) = &mut self.held[i] {
                    delay.append(t, value, slope);
                }
            }
        }
        self.follow_solutions(t, x)
    }

    fn indicators(&self) -> usize {
        self.switches.iter().map(|&c| self.program.conditions[c].kind.switches()).sum()
    }

    fn event_indicators(&mut self, t: f64, x: &[f64], g: &mut [f64]) -> Result<(), Failure> {
        self.place(t, x);
        self.evaluate(What::Switches, false, t)?;
        let frame = &self.frame;
        let mut next = 0;
        for (&condition, &register) in self.switches.iter().zip(&self.switching.outputs) {
            let mut beyond = frame.conditions.beyond(condition, frame.r[register as usize], &frame.tables);
            if self.sides_taken == Some(t) {
                frame.conditions.confirm(condition, &mut beyond);
            }
            let count = self.program.conditions[condition].kind.switches();
            g[next..next + count].copy_from_slice(&beyond[..count]);
            next += count;
        }
        Ok(())
    }

    fn observed(&self) -> usize {
        self.recorded.len()
    }

    fn observed_name(&self, value: usize) -> String {
        self.program.observed[self.recorded[value]].name.clone()
    }

    fn observe(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        self.place(t, x);
        self.evaluate(What::Recorded, false, t)?;
        out.iter_mut().zip(&self.observe.outputs).for_each(|(out, &r)| *out = self.frame.r[r as usize]);
        match out.iter().position(|value| value.is_nan()).or(out.iter().position(|value| value.is_infinite())) {
            // What a modeller computes for himself may be infinite, what a law gives may not.
            Some(value) if out[value].is_infinite() => self.explain(t).map_or(Ok(()), Err)?,
            Some(value) => {
                let not_finite = Failure::NotFinite { time: t, what: self.observed_name(value) };
                return Err(self.explain(t).unwrap_or(not_finite));
            }
            None => {}
        }
        Ok(())
    }
}
