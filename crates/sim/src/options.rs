//! What to run and how exactly.

use crate::Failure;
use crate::fixed_step::FixedMethod;

/// How to integrate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// A step of fixed length, [`Options::step`].
    Fixed(FixedMethod),
    /// An explicit Runge-Kutta pair of order 5(4) with variable step, for systems that are not stiff.
    Explicit,
    /// Backward differentiation formulas of order 1 to 5 with variable step, for stiff systems.
    Bdf,
    /// The implicit Runge-Kutta method Radau IIA of order 5 with variable step, for stiff systems and the only one for
    /// systems of index 2 and 3.
    Radau,
    /// Explicit until the system proves stiff, then backward differentiation formulas to the end. Stiff is a system
    /// whose steps times the spectral radius of its Jacobian stay above what accuracy allows, look after look, while many
    /// steps are still to come, or one in which no explicit step is short enough.
    Auto,
}

impl Method {
    /// Whether it asks for derivatives of the rates by all states at once, or may come to.
    pub fn asks_for_derivatives(self) -> bool {
        match self {
            Method::Fixed(method) => method.takes_jacobian(),
            Method::Explicit => false,
            Method::Bdf | Method::Radau | Method::Auto => true,
        }
    }
}

/// Absolute error allowed in a step of a variable-step method, on top of the relative one.
#[derive(Clone, Debug, PartialEq)]
pub enum AbsoluteTolerance {
    /// A part of the magnitude of each state: `rtol / 1000`, or 1e-15 where that is less. The magnitude is the system's scale
    /// of the state or, if larger, the greatest value so far, and at least a small part of what those states make of it with
    /// which it exchanges energy; where the state is 0 and its scale not known, it is guessed from the rates and from how
    /// the states act on each other. What rounding of the rates makes of a state is allowed in any case.
    Scaled,
    /// The same number for every state, each in its own unit.
    Same(f64),
    /// One for each state, each in its own unit.
    Each(Vec<f64>),
}

/// What to run and how exactly. Times in s.
///
/// ```
/// use halfarrow_sim::{Method, Options};
/// let options = Options { to: 10.0, every: Some(0.01), rtol: 1e-9, ..Options::default() };
/// assert_eq!((options.method, options.from), (Method::Auto, 0.0));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// How to integrate.
    pub method: Method,
    /// Start, in s.
    pub from: f64,
    /// End, in s; above `from`.
    pub to: f64,
    /// Time between samples, in s; above 0. `None`: a sample after every step and on both sides of every jump. Start and
    /// end are always sampled.
    pub every: Option<f64>,
    /// Times of the samples in the place of these, in s, ascending; the end is always sampled. Empty: as `every` says.
    pub at: Vec<f64>,
    /// In how many steps at most, from the first one on, samples at every step are taken at [`INSIDE`](crate::INSIDE) of them
    /// as well, by methods that have a solution there: those of variable step.
    pub inside: usize,
    /// Step of a fixed-step method, in s; above 0. Only steps that end at a jump, a sample or the end are shorter.
    /// Other methods take it for the longest step, if given.
    pub step: Option<f64>,
    /// Relative error allowed in a step of a variable-step method; from 1e-13 to 0.1.
    pub rtol: f64,
    /// Absolute error allowed in a step of a variable-step method.
    pub atol: AbsoluteTolerance,
    /// Whether the point is [projected](crate::Events::project) where a step ends. Backward differentiation formulas, which
    /// go on with their history, do not: `Auto` then takes `Radau` for systems that are stiff.
    pub project: bool,
}

impl Default for Options {
    /// From 0 to 1 s, `Auto`, `rtol` 1e-6, scaled absolute tolerances, every step sampled.
    fn default() -> Options {
        Options {
            method: Method::Auto,
            from: 0.0,
            to: 1.0,
            every: None,
            at: Vec::new(),
            inside: 0,
            step: None,
            rtol: 1e-6,
            atol: AbsoluteTolerance::Scaled,
            project: false,
        }
    }
}

impl Options {
    /// Whether the run can be made, for a system of `states` states.
    ///
    /// # Errors
    /// The first option that makes no sense.
    pub fn check(&self, states: usize) -> Result<(), Failure> {
        let bad = |option, value, expected| Err(Failure::BadOption { option, value, expected });
        if !self.from.is_finite() {
            return bad("from", self.from, "a finite time");
        }
        if !(self.to.is_finite() && self.to > self.from) {
            return bad("to", self.to, "a finite time after the start");
        }
        if self.project && self.method == Method::Bdf {
            return bad("project", f64::NAN, "left out with bdf, whose steps go on with their history: take radau");
        }
        if let Some(every) = self.every.filter(|&every| !(every.is_finite() && every > 0.0)) {
            return bad("every", every, "a positive time");
        }
        let outside = |t: &&f64| !(t.is_finite() && **t >= self.from && **t <= self.to);
        if let Some(&time) = self.at.iter().find(outside) {
            return bad("at", time, "a time within the run");
        }
        if let Some(pair) = self.at.windows(2).find(|pair| pair[0] >= pair[1]) {
            return bad("at", pair[1], "after the time before it");
        }
        if let Some(step) = self.step.filter(|&step| !(step.is_finite() && step > 0.0)) {
            return bad("step", step, "a positive time");
        }
        match (self.method, self.step) {
            (Method::Fixed(_), None) => bad("step", f64::NAN, "given for a method of fixed step"),
            (Method::Fixed(_), Some(_)) => Ok(()),
            _ => self.check_tolerances(states),
        }
    }

    fn check_tolerances(&self, states: usize) -> Result<(), Failure> {
        let bad = |option, value, expected| Err(Failure::BadOption { option, value, expected });
        if !(1e-13..=0.1).contains(&self.rtol) {
            return bad("rtol", self.rtol, "from 1e-13 to 0.1");
        }
        let positive = |atol: &f64| atol.is_finite() && *atol > 0.0;
        match &self.atol {
            AbsoluteTolerance::Scaled => Ok(()),
            AbsoluteTolerance::Same(atol) if positive(atol) => Ok(()),
            AbsoluteTolerance::Same(atol) => bad("atol", *atol, "above 0"),
            AbsoluteTolerance::Each(atol) if atol.len() != states => {
                bad("atol", atol.len() as f64, "as many values as there are states")
            }
            AbsoluteTolerance::Each(atol) => match atol.iter().find(|atol| !positive(atol)) {
                Some(&atol) => bad("atol", atol, "above 0"),
                None => Ok(()),
            },
        }
    }
}
