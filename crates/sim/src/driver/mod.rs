//! The driver: takes a run from event to event, whatever the method, and hands what it computes to a [`Sink`].

mod grid;
mod position;
mod sink;
mod stepper;

pub(crate) use grid::Grid;
pub use position::Position;
pub use sink::{Crawl, Sink, Stopped, Summary};
pub(crate) use stepper::{Flow, Stepper, Stop, is_at};

use std::ops::ControlFlow;

use crate::events::{Chatter, Events, Signs, first_crossing};
use crate::{Failure, Options};

/// Parts of a step by which it is made to go beyond a zero crossing.
const MARGINS: [f64; 2] = [1e-3, 1e-6];

/// Why the driver looks up at the end of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StopReason {
    /// Nothing happens there.
    StepEnd,
    /// A time event, or a mere corner.
    TimeEvent {
        /// Neither values nor rates jump.
        corner: bool,
    },
    /// The sign of an event indicator has changed, with or without a time event.
    ZeroCrossing,
}

/// Where samples are taken.
enum Samples {
    /// At the end of every step, and on both sides of every event.
    EveryStep,
    /// At these times.
    Grid(Grid),
    /// Nowhere: somebody else does.
    Nowhere,
}

/// A run on its way: where it stands, the signs of its event indicators, what it has taken so far.
pub(crate) struct Run<'a> {
    pub(crate) options: &'a Options,
    /// How far the run has come: its point belongs to this time.
    pub(crate) time: f64,
    /// Where it ends.
    pub(crate) to: f64,
    pub(crate) counts: Summary,
    signs: Signs,
    chatter: Chatter,
    sink: &'a mut dyn Sink,
    /// Whether the sink wants to see every step.
    watched: bool,
    /// When it saw the last one.
    seen: Option<f64>,
    samples: Samples,
    values: Vec<f64>,
    /// A point inside a step.
    inside: Vec<f64>,
}

impl<'a> Run<'a> {
    /// A run that stands at its start.
    pub(crate) fn new(options: &'a Options, sink: &'a mut dyn Sink, events: &dyn Events) -> Run<'a> {
        Run {
            options,
            time: options.from,
            to: options.to,
            counts: Summary::default(),
            signs: Signs::new(events.indicators()),
            chatter: Chatter::new(options.to - options.from),
            watched: sink.watches(),
            seen: None,
            sink,
            samples: options.every.map_or(Samples::EveryStep, |every| Samples::Grid(Grid::new(options.from, every))),
            values: vec![0.0; events.observed()],
            inside: Vec::new(),
        }
    }

    /// A run of which nobody takes samples, from where it stands.
    pub(crate) fn unsampled(options: &'a Options, sink: &'a mut dyn Sink, position: Position) -> Run<'a> {
        let Position { time, signs, counts } = position;
        let chatter = Chatter::new(options.to - options.from);
        let (values, inside) = (Vec::new(), Vec::new());
        let (samples, watched, seen) = (Samples::Nowhere, false, None);
        Run { options, time, to: options.to, counts, signs, chatter, sink, watched, seen, samples, values, inside }
    }

    /// Where it stands.
    pub(crate) fn into_position(self) -> Position {
        Position { time: self.time, signs: self.signs, counts: self.counts }
    }

    /// The start counts as an event.
    pub(crate) fn start(&mut self, events: &mut dyn Events, point: &mut [f64]) -> Result<(), Failure> {
        self.handle(events, point)?;
        self.accept(events, point)?;
        self.settle(events, point)
    }

    /// Integrates to the end, or until the stepper hands over.
    pub(crate) fn drive<S: Stepper>(&mut self, stepper: &mut S, point: &mut [f64]) -> Result<Flow, Failure> {
        while self.time < self.to {
            let stop = self.next_stop(&mut *stepper.events());
            if S::DENSE && is_at(self.time, stop.time, self.time) {
                self.skip_to(stepper, stop, point)?;
            } else if self.piece(stepper, stop, point)? == Flow::HandOver {
                return Ok(Flow::HandOver);
            }
        }
        Ok(Flow::GoOn)
    }

    /// The next time event, or the end of the run.
    pub(crate) fn next_stop(&self, events: &mut dyn Events) -> Stop {
        let event = events.next_time_event(self.time).filter(|&event| event <= self.to);
        Stop { time: event.unwrap_or(self.to), is_event: event.is_some() }
    }

    /// Over to a stop that is where the run stands, to rounding.
    fn skip_to<S: Stepper>(&mut self, stepper: &mut S, stop: Stop, point: &mut [f64]) -> Result<(), Failure> {
        let reason = self.reach(&mut *stepper.events(), stop.time, stop, false, point)?;
        self.report_progress()?;
        stepper.forget();
        self.go_over(&mut *stepper.events(), reason, point)
    }

    /// From here to the stop, or to a zero crossing before it.
    fn piece<S: Stepper>(&mut self, stepper: &mut S, stop: Stop, point: &mut [f64]) -> Result<Flow, Failure> {
        if stepper.set_off(self, stop.time, point)? == Flow::HandOver {
            return Ok(Flow::HandOver);
        }
        while self.time < stop.time {
            match self.step(stepper, stop, point)? {
                StopReason::ZeroCrossing => break,
                _ => {
                    if stepper.supervise(self, stop.time, point)? == Flow::HandOver {
                        return Ok(Flow::HandOver);
                    }
                }
            }
        }
        Ok(Flow::GoOn)
    }

    /// One step, with what happens at its end.
    fn step<S: Stepper>(&mut self, stepper: &mut S, stop: Stop, point: &mut [f64]) -> Result<StopReason, Failure> {
        let end = stepper.step(self.time, self.next_sample(), stop.time, point)?;
        self.counts.steps += 1;
        let (end, crossed) = self.accept_step(stepper, end, point)?;
        let reason = self.reach(&mut *stepper.events(), end, stop, crossed, point)?;
        self.report_progress()?;
        if S::DENSE {
            self.samples_before(stepper, end)?;
        }
        if let StopReason::TimeEvent { corner } = reason {
            stepper.before_event(corner)?;
        }
        self.go_over(&mut *stepper.events(), reason, point)?;
        if let StopReason::TimeEvent { corner } = reason {
            stepper.after_event(corner, point);
        }
        Ok(reason)
    }

    /// Writes the point that the step has led to: its end, or a zero crossing before it. Gives when that is, and whether an
    /// event indicator has changed its sign there.
    fn accept_step<S: Stepper>(
        &mut self,
        stepper: &mut S,
        end: f64,
        point: &mut [f64],
    ) -> Result<(f64, bool), Failure> {
        if !S::DENSE {
            stepper.accept(end, point);
            let crossed = self.signs.crossed(&mut *stepper.events(), end, point)?;
            return Ok((end, crossed.is_some()));
        }
        self.inside.resize(point.len(), 0.0);
        match self.exact_crossing(stepper, end)? {
            (end, None) => {
                stepper.accept(end, point);
                Ok((end, false))
            }
            (_, Some((time, indicator))) => {
                if self.chatter.is_one(time) {
                    let what = stepper.events().indicator_name(indicator);
                    return Err(Failure::Chattering { time, what });
                }
                stepper.land(time, point);
                Ok((time, true))
            }
        }
    }

    /// The first zero crossing in the step that ends at `end`, which it is, and where the step ends now: where its end is
    /// more exact than its inside, it is made again to just beyond the crossing.
    fn exact_crossing<S: Stepper>(
        &mut self,
        stepper: &mut S,
        mut end: f64,
    ) -> Result<(f64, Option<(f64, usize)>), Failure> {
        let mut crossing = self.crossing(stepper, end)?;
        for margin in MARGINS {
            let Some((time, _)) = crossing else { break };
            let beyond = time + margin * (time - self.time);
            if beyond >= end || !stepper.shorten(beyond) {
                break;
            }
            end = beyond;
            crossing = self.crossing(stepper, end)?;
        }
        Ok((end, crossing))
    }

    /// The first zero crossing in the step that ends at `end`, by its dense output, and which it is.
    fn crossing<S: Stepper>(&mut self, stepper: &mut S, end: f64) -> Result<Option<(f64, usize)>, Failure> {
        let Run { signs, inside, time, .. } = self;
        first_crossing(signs, *time, end, |signs, t| {
            stepper.interpolate(t, inside);
            signs.crossed(&mut *stepper.events(), t, inside)
        })
    }

    /// A step to `(end, point)` is accepted; what happens there.
    pub(crate) fn reach(
        &mut self,
        events: &mut dyn Events,
        end: f64,
        stop: Stop,
        crossed: bool,
        point: &[f64],
    ) -> Result<StopReason, Failure> {
        self.time = end;
        let at_event = stop.is_event && end == stop.time;
        let corner = at_event && events.is_corner(end);
        self.accept(events, point)?;
        self.counts.crossings += usize::from(crossed);
        self.counts.corners += usize::from(corner);
        self.counts.jumps += usize::from(at_event && !corner);
        Ok(match (crossed, at_event) {
            (true, _) => StopReason::ZeroCrossing,
            (false, true) => StopReason::TimeEvent { corner },
            (false, false) => StopReason::StepEnd,
        })
    }

    /// Goes over what happens where the run stands, and samples: on a grid what is true after it, else both.
    pub(crate) fn go_over(
        &mut self,
        events: &mut dyn Events,
        reason: StopReason,
        point: &mut [f64],
    ) -> Result<(), Failure> {
        if reason != StopReason::StepEnd {
            if matches!(self.samples, Samples::EveryStep) {
                self.record(events, self.time, self.time, point)?;
            }
            self.handle(events, point)?;
        }
        self.settle(events, point)
    }

    fn handle(&mut self, events: &mut dyn Events, point: &mut [f64]) -> Result<(), Failure> {
        events.handle_event(self.time, point)?;
        self.show(events, point)?;
        self.signs.take(events, self.time, point)
    }

    fn accept(&mut self, events: &mut dyn Events, point: &[f64]) -> Result<(), Failure> {
        events.accept(self.time, point)?;
        if self.seen == Some(self.time) { Ok(()) } else { self.show(events, point) }
    }

    /// Shows the sink where the run stands, if it wants to see every step.
    fn show(&mut self, events: &mut dyn Events, point: &[f64]) -> Result<(), Failure> {
        if !self.watched {
            return Ok(());
        }
        self.seen = Some(self.time);
        events.observe(self.time, point, &mut self.values)?;
        self.sink.watch(self.time, &self.values)
    }

    fn report_progress(&mut self) -> Result<(), Failure> {
        match self.sink.progress(self.time) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(Failure::Interrupted { time: self.time }),
        }
    }

    /// Says how exact each state is kept.
    pub(crate) fn tell_tolerances(&mut self, magnitudes: &[f64], absolute: &[f64]) {
        self.sink.tolerances(magnitudes, absolute);
    }

    /// Says that the run crawls.
    pub(crate) fn tell_crawl(&mut self, crawl: &Crawl) {
        self.sink.crawls(crawl);
    }

    /// As which time a sample is due where the run stands, if it is. On a grid the sample bears the time of the grid, from
    /// which the run may be a rounding error away.
    pub(crate) fn due(&self) -> Option<f64> {
        let due = match &self.samples {
            Samples::Nowhere => return None,
            Samples::EveryStep => Some(self.time),
            Samples::Grid(grid) => grid.is_due(self.time).then(|| grid.next()),
        };
        (self.time >= self.to).then_some(self.to).or(due)
    }

    /// Samples where the run stands, if that is due.
    fn settle(&mut self, events: &mut dyn Events, point: &[f64]) -> Result<(), Failure> {
        self.due().map_or(Ok(()), |label| self.record(events, label, self.time, point))
    }

    /// The next time of the grid.
    pub(crate) fn next_sample(&self) -> f64 {
        if let Samples::Grid(grid) = &self.samples { grid.next() } else { f64::INFINITY }
    }

    /// Samples of the grid inside the last step, clearly before `end`.
    fn samples_before<S: Stepper>(&mut self, stepper: &mut S, end: f64) -> Result<(), Failure> {
        while let Samples::Grid(grid) = &self.samples
            && grid.next() + grid.slack() < end
        {
            let t = grid.next();
            let mut inside = std::mem::take(&mut self.inside);
            stepper.sample(t, &mut inside);
            let recorded = self.record(&mut *stepper.events(), t, t, &inside);
            self.inside = inside;
            recorded?;
        }
        Ok(())
    }

    /// Hands over the values at `(t, point)` as the sample of time `label`.
    fn record(&mut self, events: &mut dyn Events, label: f64, t: f64, point: &[f64]) -> Result<(), Failure> {
        events.observe(t, point, &mut self.values)?;
        if let Some(value) = self.values.iter().position(|value| value.is_nan()) {
            return Err(Failure::NotFinite { time: t, what: events.observed_name(value) });
        }
        self.hand_over(label);
        Ok(())
    }

    /// Hands over values that were observed elsewhere, as the sample that is due.
    pub(crate) fn record_values(&mut self, label: f64, values: impl Iterator<Item = f64>) {
        self.values.iter_mut().zip(values).for_each(|(own, value)| *own = value);
        self.hand_over(label);
    }

    fn hand_over(&mut self, label: f64) {
        self.sink.sample(label, &self.values);
        if let Samples::Grid(grid) = &mut self.samples {
            grid.pass(label);
        }
    }

    /// Whether there are event indicators.
    pub(crate) fn has_indicators(&self) -> bool {
        !self.signs.is_empty()
    }

    /// Whether an event indicator has another sign at `(t, point)` than that held.
    pub(crate) fn has_crossed(&mut self, events: &mut dyn Events, t: f64, point: &[f64]) -> Result<bool, Failure> {
        self.signs.crossed(events, t, point).map(|crossed| crossed.is_some())
    }

    /// What came of it.
    #[allow(clippy::result_large_err, reason = "a run fails once")]
    pub(crate) fn ended<T>(&self, end: Result<T, Failure>) -> Result<Summary, Stopped> {
        let (time, summary) = (self.time, self.counts);
        end.map(|_| summary).map_err(|failure| Stopped { failure, time, summary, without_rates: None })
    }
}
