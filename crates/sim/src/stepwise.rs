//! A run that the caller takes from one time to the next.

use crate::driver::{Flow, Nobody, Position, Run};
use crate::fixed_step::{FixedMethod, FixedStep, History, Ticks};
use crate::shared::Counted;
use crate::simulate::check_start;
use crate::{Failure, HybridSystem, Method, Options, Stopped, Summary};

/// A run by a method of fixed step that goes no further than the caller says: a step to there, shorter ones where events
/// come before. Between two steps the system may be read and set.
///
/// What the run remembers beside the state and the memory of the system is its [`Position`], and the [`History`] of a method of
/// more than one step: all of these together saved and restored, it goes on with the same bits. No step takes memory.
pub struct Stepwise {
    method: FixedStep,
    options: Options,
    position: Position,
    /// Room for a point inside a step.
    inside: Vec<f64>,
}

impl Stepwise {
    /// A run of `system` that stands at `from`, in s.
    pub fn new(method: FixedMethod, from: f64, system: &dyn HybridSystem) -> Stepwise {
        let options = Options { method: Method::Fixed(method), from, to: f64::INFINITY, ..Options::default() };
        Stepwise {
            method: FixedStep::new(method, system.sparsity()),
            position: Position::new(from, system.indicators()),
            inside: vec![0.0; system.sparsity().states()],
            options,
        }
    }

    /// The same with the state [projected](crate::Events::project) where a step ends.
    #[must_use]
    pub fn projecting(mut self, project: bool) -> Stepwise {
        self.options.project = project;
        self
    }

    /// The start, which counts as an event.
    ///
    /// # Errors
    /// What the system reports, or a state that is not finite.
    #[allow(clippy::result_large_err, reason = "a run fails once")]
    pub fn start(&mut self, system: &mut dyn HybridSystem, x: &mut [f64]) -> Result<(), Stopped> {
        let checked = check_start(system, self.position.time(), x);
        self.run(|run, _| checked.and_then(|()| run.start(system, x)))
    }

    /// Goes on to `to`, in s, and leaves the state there in `x`.
    ///
    /// # Errors
    /// What the system reports: the run has stopped there, and `x` holds the last state reached.
    #[allow(clippy::result_large_err, reason = "a run fails once")]
    pub fn advance(&mut self, system: &mut dyn HybridSystem, to: f64, x: &mut [f64]) -> Result<(), Stopped> {
        let Method::Fixed(kind) = self.options.method else { unreachable!("it is made with one") };
        self.run(|run, method| {
            run.to = to;
            // Where it hands over, the states of the system are others.
            while run.drive(&mut Ticks::one(method, Counted::new(system)), x)? == Flow::HandOver {
                *method = FixedStep::new(kind, system.sparsity());
            }
            Ok(())
        })
    }

    /// Does beforehand what only the first step, of length `h` in s, takes.
    pub(crate) fn prepare(&mut self, system: &mut dyn HybridSystem, h: f64, x: &[f64]) {
        self.method.prepare(system, self.position.time(), h, x);
    }

    /// A step of length `h` in s from where the run stands, which moves nothing but `x`.
    ///
    /// # Errors
    /// What the system reports.
    pub(crate) fn try_step(&mut self, system: &mut dyn HybridSystem, h: f64, x: &mut [f64]) -> Result<(), Failure> {
        self.method.rehearse(system, self.position.time(), h, x)
    }

    /// How far the run has come, in s.
    pub fn time(&self) -> f64 {
        self.position.time()
    }

    /// What it took so far, without evaluations.
    pub fn summary(&self) -> Summary {
        self.position.summary()
    }

    /// Where the run stands, to go on from later.
    pub fn position(&self) -> &Position {
        &self.position
    }

    /// What the method remembers of earlier steps, if it does.
    pub fn history(&self) -> Option<&History> {
        self.method.history()
    }

    /// Goes on from there.
    pub fn restore(&mut self, position: &Position, history: Option<&History>) {
        self.position.clone_from(position);
        history.into_iter().for_each(|history| self.method.restore(history));
    }

    /// A failure where the run stands.
    pub(crate) fn stopped(&self, failure: Failure) -> Stopped {
        Stopped { failure, time: self.time(), summary: self.summary(), without_rates: None }
    }

    #[allow(clippy::result_large_err, reason = "a run fails once")]
    fn run(&mut self, work: impl FnOnce(&mut Run<'_>, &mut FixedStep) -> Result<(), Failure>) -> Result<(), Stopped> {
        let mut nobody = Nobody;
        let (position, inside) = (std::mem::take(&mut self.position), std::mem::take(&mut self.inside));
        let mut run = Run::unsampled(&self.options, &mut nobody, position, inside);
        let done = work(&mut run, &mut self.method);
        let done = run.ended(done).map(|_| ());
        (self.position, self.inside) = run.into_position();
        done
    }
}
