//! The driver: takes a run from event to event, whatever the method, and hands what it computes to a [`Sink`].

mod crossing;
mod grid;
mod position;
mod recording;
mod sink;
mod stepper;

pub(crate) use grid::Grid;
pub use grid::{INSIDE, inside, tick};
pub use position::Position;
pub use sink::{Crawl, Nobody, Sink, Stopped, Summary};
pub(crate) use stepper::{Flow, Stepper, Stop, is_at};

use std::ops::ControlFlow;

use crate::events::{Chatter, Events, Signs, StepEnd};
use crate::{Failure, Method, Options};
use recording::Samples;

/// What is not told apart where signs are looked at coarsely: part of the tolerance of a state, and of its magnitude.
const FINE: f64 = 1e-3;
const ROUNDING: f64 = 2e-12;

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
    /// The system goes on in other variables.
    Exchange,
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
    /// Of zero crossings, and of time events.
    chatter: Chatter,
    ticking: Chatter,
    sink: &'a mut dyn Sink,
    /// Whether the sink wants to see every step.
    watched: bool,
    /// When it saw the last one.
    seen: Option<f64>,
    samples: Samples,
    values: Vec<f64>,
    /// The time that the values belong to, as long as nothing has happened to the point or to the system since.
    observed: Option<f64>,
    /// A point inside a step.
    inside: Vec<f64>,
    /// Whether an event has been handled where the run stands.
    handled: bool,
    /// Steps in a row that were made again for a crossing that was none then.
    vanished: usize,
    /// Where a step has failed and other variables were tried.
    exchanged_at: Option<f64>,
}

/// How far a step may go beyond the longest one where that ends an interval.
const STRETCH: f64 = 1.1;

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
            ticking: Chatter::of_times(),
            watched: sink.watches(),
            seen: None,
            sink,
            samples: match options.every {
                _ if !options.at.is_empty() => Samples::Grid(Grid::at(options.at.clone())),
                None => Samples::EveryStep,
                Some(every) => Samples::Grid(Grid::new(options.from, every)),
            },
            values: vec![0.0; events.observed()],
            observed: None,
            inside: Vec::new(),
            handled: false,
            vanished: 0,
            exchanged_at: None,
        }
    }

    /// A run of which nobody takes samples, from where it stands, with room for a point inside a step.
    pub(crate) fn unsampled(
        options: &'a Options,
        sink: &'a mut dyn Sink,
        position: Position,
        inside: Vec<f64>,
    ) -> Run<'a> {
        let Position { time, signs, counts } = position;
        let (chatter, ticking) = (Chatter::new(options.to - options.from), Chatter::of_times());
        let values = Vec::new();
        let (samples, watched, seen) = (Samples::Nowhere, false, None);
        let to = options.to;
        let handled = true;
        Run {
            options,
            time,
            to,
            counts,
            signs,
            chatter,
            ticking,
            sink,
            watched,
            seen,
            samples,
            values,
            observed: None,
            inside,
            handled,
            vanished: 0,
            exchanged_at: None,
        }
    }

    /// Where it stands, and its room.
    pub(crate) fn into_position(self) -> (Position, Vec<f64>) {
        (Position { time: self.time, signs: self.signs, counts: self.counts }, self.inside)
    }

    /// The start counts as an event.
    pub(crate) fn start(&mut self, events: &mut dyn Events, point: &mut [f64]) -> Result<(), Failure> {
        self.handle(events, point)?;
        self.project(events, self.time, point)?;
        self.accept(events, point)?;
        self.settle(events, point)
    }

    /// Integrates to the end, or until the stepper hands over.
    pub(crate) fn drive<S: Stepper>(&mut self, stepper: &mut S, point: &mut [f64]) -> Result<Flow, Failure> {
        while self.time < self.to {
            let stop = self.next_stop(&mut *stepper.events());
            if S::DENSE && is_at(self.time, stop.time, self.time) {
                if self.skip_to(stepper, stop, point)? == Flow::HandOver {
                    return Ok(Flow::HandOver);
                }
            } else if self.drive_to_stop(stepper, stop, point)? == Flow::HandOver {
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
    fn skip_to<S: Stepper>(&mut self, stepper: &mut S, stop: Stop, point: &mut [f64]) -> Result<Flow, Failure> {
        let reason = self.arrive(&mut *stepper.events(), stop.time, stop, false, point)?;
        self.report_progress()?;
        stepper.forget();
        self.handle_stop(&mut *stepper.events(), reason, point)?;
        let exchanged = self.exchange(&mut *stepper.events(), point, false)?;
        Ok(if exchanged { Flow::HandOver } else { Flow::GoOn })
    }

    /// From here to the stop, or to a zero crossing before it.
    fn drive_to_stop<S: Stepper>(&mut self, stepper: &mut S, stop: Stop, point: &mut [f64]) -> Result<Flow, Failure> {
        if stepper.begin_interval(self, stop.time, point)? == Flow::HandOver {
            return Ok(Flow::HandOver);
        }
        while self.time < stop.time {
            match self.step(stepper, stop, point)? {
                StopReason::ZeroCrossing => break,
                StopReason::Exchange => return Ok(Flow::HandOver),
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
        let reason = self.reach(stepper, stop, point)?;
        if reason == StopReason::Exchange {
            return Ok(reason);
        }
        self.handle_stop(&mut *stepper.events(), reason, point)?;
        if let StopReason::TimeEvent { corner } = reason {
            stepper.after_event(corner, point);
        }
        if reason != StopReason::StepEnd {
            stepper.after_change();
        }
        let exchanged = self.exchange(&mut *stepper.events(), point, false)?;
        Ok(if exchanged { StopReason::Exchange } else { reason })
    }

    /// One step to its end, where nothing has been handled or sampled yet.
    pub(crate) fn reach<S: Stepper>(
        &mut self,
        stepper: &mut S,
        stop: Stop,
        point: &mut [f64],
    ) -> Result<StopReason, Failure> {
        let longest = if S::DENSE { stepper.events().longest_step() } else { f64::INFINITY };
        // What would be left for the last step is divided with it.
        let latest = if stop.time - self.time <= STRETCH * longest { stop.time } else { self.time + longest };
        let start = self.time;
        let end = match stepper.step(self.time, self.next_sample(), latest, point) {
            Ok(end) => end,
            // Where other variables have been tried already they do not help.
            Err(failure) if self.exchanged_at == Some(self.time) => return Err(failure),
            Err(failure) => {
                let exchanged = self.exchange(&mut *stepper.events(), point, true)?;
                self.exchanged_at = Some(self.time);
                return if exchanged { Ok(StopReason::Exchange) } else { Err(failure) };
            }
        };
        self.counts.steps += 1;
        let (end, crossed) = self.accept_step(stepper, end, point)?;
        self.project(&mut *stepper.events(), end, point)?;
        let reason = self.arrive(&mut *stepper.events(), end, stop, crossed, point)?;
        self.report_progress()?;
        if S::DENSE {
            self.samples_inside(stepper, start, end)?;
        }
        if let StopReason::TimeEvent { corner } = reason {
            stepper.before_event(corner)?;
        }
        Ok(reason)
    }

    /// Puts the point back onto what its rates keep, if the run is to do so.
    fn project(&mut self, events: &mut dyn Events, t: f64, point: &mut [f64]) -> Result<(), Failure> {
        self.observed = None;
        if self.options.project && events.project(t, point)? {
            self.counts.projections += 1;
        }
        Ok(())
    }

    /// Goes on in other variables if these tell the motion better.
    pub(crate) fn exchange(
        &mut self,
        events: &mut dyn Events,
        point: &mut [f64],
        failed: bool,
    ) -> Result<bool, Failure> {
        let step = match (failed, self.options.method) {
            (true, _) => StepEnd::Failed,
            (false, Method::Fixed(_)) => StepEnd::Fixed,
            (false, _) => StepEnd::Controlled,
        };
        self.observed = None;
        let exchanged = events.exchange_independent(self.time, point, step)?;
        if exchanged {
            self.counts.exchanges += 1;
            self.signs.renew(events.indicators());
            self.signs.take(events, self.time, point)?;
        }
        Ok(exchanged)
    }

    /// A step to `(end, point)` is accepted; what happens there.
    pub(crate) fn arrive(
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
        if at_event && self.ticking.is_one(end) {
            return Err(Failure::Chattering { time: end, what: "a condition on time".into() });
        }
        Ok(match (crossed, at_event) {
            (true, _) => StopReason::ZeroCrossing,
            (false, true) => StopReason::TimeEvent { corner },
            (false, false) => StopReason::StepEnd,
        })
    }

    /// Goes over what happens where the run stands, and samples: on a grid what is true after it, else both.
    pub(crate) fn handle_stop(
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
        self.observed = None;
        events.handle_event(self.time, point)?;
        if self.signs.len() != events.indicators() {
            self.signs.renew(events.indicators());
        }
        self.handled = true;
        self.show(events, point)?;
        self.signs.take(events, self.time, point)
    }

    fn accept(&mut self, events: &mut dyn Events, point: &[f64]) -> Result<(), Failure> {
        self.observed = None;
        events.accept(self.time, point)?;
        if self.seen == Some(self.time) { Ok(()) } else { self.show(events, point) }
    }

    fn report_progress(&mut self) -> Result<(), Failure> {
        match self.sink.progress(self.time) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(Failure::Interrupted { time: self.time }),
        }
    }

    /// Says how exact each state is kept.
    pub(crate) fn report_tolerances(&mut self, magnitudes: &[f64], absolute: &[f64]) {
        let resolution = |(magnitude, absolute): (&f64, &f64)| (FINE * absolute).max(ROUNDING * magnitude);
        self.signs.resolve(magnitudes.iter().zip(absolute).map(resolution));
        self.sink.tolerances(magnitudes, absolute);
    }

    /// Says that the run crawls.
    pub(crate) fn report_crawl(&mut self, crawl: &Crawl) {
        self.sink.crawls(crawl);
    }

    /// What came of it.
    #[allow(clippy::result_large_err, reason = "a run fails once")]
    pub(crate) fn ended<T>(&self, end: Result<T, Failure>) -> Result<Summary, Stopped> {
        let (time, summary) = (self.time, self.counts);
        end.map(|_| summary).map_err(|failure| Stopped { failure, time, summary, without_rates: None })
    }
}
