//! Why a run stopped.

use std::fmt;

/// Why a run stopped: the time in s, the element or equation, the reason. `Display` speaks to the modeller.
#[derive(Clone, Debug, PartialEq)]
pub enum Failure {
    /// A value is NaN or infinite.
    NotFinite {
        /// When, in s; NaN, here and below, if it is so at any time.
        time: f64,
        /// Which value.
        what: Affected,
    },
    /// A block of linear equations has no unique solution: a pivot vanished and there is no other choice.
    Singular {
        /// When, in s.
        time: f64,
        /// Which equations, by their elements or unknowns.
        what: String,
    },
    /// The equations divide by something that vanishes.
    Vanished {
        /// When, in s.
        time: f64,
        /// Which equations, by their elements or unknowns.
        what: String,
        /// What they divide by.
        divisor: String,
    },
    /// An iteration did not converge.
    NoConvergence {
        /// When, in s.
        time: f64,
        /// What was iterated, by its elements or unknowns.
        what: String,
        /// Iterations made.
        iterations: usize,
        /// What was left of the greatest residual, in the unit of its equation.
        residual: f64,
    },
    /// Equations have more than one solution, and the one that the run has followed goes on no further, or moves too far in
    /// one step to be told from the others.
    Branch {
        /// When, in s.
        time: f64,
        /// Which equations, by their elements.
        what: String,
        /// What would happen in another solution.
        leap: Box<Leap>,
    },
    /// Positions that constraints determine are not found where their motion leads.
    OffMotion {
        /// When, in s.
        time: f64,
        /// Which positions.
        what: String,
    },
    /// Equations were not solved within the bound on evaluations.
    Bound {
        /// When, in s.
        time: f64,
        /// Which equations, by their elements.
        what: String,
        /// The bound.
        most: usize,
    },
    /// A law was asked for a value where it has none.
    OutOfDomain {
        /// When, in s.
        time: f64,
        /// Which law or function.
        what: String,
        /// Why it has none there, such as `the current -2 A is below -is`.
        reason: String,
    },
    /// Parameters have been set to values for which the equations are others than those that were derived.
    Structure {
        /// What held when they were derived and holds no longer, such as `a - b is zero`.
        assumed: String,
    },
    /// No step is short enough: the solution grows without bound or is not smooth here.
    StepTooSmall {
        /// When, in s.
        time: f64,
        /// The step that was still too long, in s.
        step: f64,
    },
    /// Switching conditions change their side over and over without time going on.
    Chattering {
        /// When, in s.
        time: f64,
        /// Which condition changed last.
        what: String,
    },
    /// Events make each other happen at one instant, without end.
    Livelock {
        /// When, in s.
        time: f64,
        /// The events, as they begin in the model.
        what: String,
    },
    /// Events come ever faster, towards an instant beyond which nothing is known.
    Accumulation {
        /// When, in s.
        time: f64,
        /// The event, as it begins in the model.
        what: String,
        /// What passed since the last one, in s.
        interval: f64,
        /// The instant, in s.
        end: f64,
    },
    /// What an event sends back is beyond its border at the end of the next step, and was never seen to return.
    Lost {
        /// The end of the step, in s.
        time: f64,
        /// The event, as it begins in the model.
        what: String,
        /// When it happened last, in s.
        since: f64,
    },
    /// Two events at one instant give something different values.
    Conflict {
        /// When, in s.
        time: f64,
        /// What they change.
        what: String,
        /// The events, as they begin in the model, each with the value that it gives.
        by: Box<[(String, f64); 2]>,
    },
    /// A run that is differentiated comes to where there is no derivative.
    NotDifferentiable {
        /// When, in s.
        time: f64,
        /// What has none.
        what: String,
        /// Why.
        reason: String,
    },
    /// What an event asks for cannot be.
    Reset {
        /// When, in s.
        time: f64,
        /// What is reset.
        what: String,
        /// Why it cannot be.
        reason: String,
    },
    /// Set-valued laws have no branches that hold together.
    NoMode {
        /// When, in s.
        time: f64,
        /// The laws whose branches end there, with these branches.
        what: String,
        /// How many modes were tried, and in how many of them no branch holds for long; the others have no equations.
        tried: [usize; 2],
        /// Why one of these modes has no equations.
        why: Option<String>,
    },
    /// A form has no equations that go on in the mode of set-valued laws that holds from here on.
    NoForm {
        /// When, in s.
        time: f64,
        /// The mode: each law with its branch.
        mode: String,
        /// What is wrong there.
        reason: String,
    },
    /// A contact begins with its sides through each other.
    Overlap {
        /// When, in s.
        time: f64,
        /// The contact.
        what: String,
        /// Its gap, below 0.
        gap: f64,
    },
    /// An option of the run makes no sense.
    BadOption {
        /// Name of the option.
        option: &'static str,
        /// The value it has.
        value: f64,
        /// What it has to be.
        expected: &'static str,
    },
    /// The method of the run does not fit the system.
    BadMethod {
        /// What it has to be.
        expected: &'static str,
    },
    /// What was computed does not satisfy the model, as an audit found.
    Untrue {
        /// When, in s.
        time: f64,
        /// Which law is not met.
        what: String,
        /// By how much, relative to the greatest magnitude of its kind.
        miss: f64,
        /// What may be done about it.
        remedy: String,
    },
    /// The receiver of the samples asked to stop.
    Interrupted {
        /// When, in s.
        time: f64,
    },
}

/// How an unknown would leap from one solution to another.
#[derive(Clone, Debug, PartialEq)]
pub struct Leap {
    /// The unknown.
    pub unknown: String,
    /// Its value when the last step was accepted.
    pub from: f64,
    /// Its value in another solution.
    pub to: f64,
}

/// What is not finite.
#[derive(Clone, Debug, PartialEq)]
pub enum Affected {
    /// Variables, by their names.
    Variables(Vec<String>),
    /// The rate of a state, by its name.
    Rate(String),
    /// A variable, by its name, and something else with it.
    Through(String, Box<Affected>),
    /// Something else, in words.
    Other(String),
}

impl Affected {
    /// A variable.
    pub fn variable(name: String) -> Affected {
        Affected::Variables(vec![name])
    }
}

impl fmt::Display for Affected {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Affected::Variables(names) => f.write_str(&names.join(", ")),
            Affected::Rate(state) => write!(f, "the rate of {state}"),
            Affected::Through(variable, other) => write!(f, "{variable}, and with it {other},"),
            Affected::Other(words) => f.write_str(words),
        }
    }
}

impl From<&str> for Affected {
    fn from(words: &str) -> Affected {
        Affected::Other(words.to_string())
    }
}

impl Failure {
    /// When it happened, in s; `None` if the run never began, or if it is so at any time.
    pub fn time(&self) -> Option<f64> {
        match self {
            Failure::NotFinite { time, .. }
            | Failure::Singular { time, .. }
            | Failure::Vanished { time, .. }
            | Failure::NoConvergence { time, .. }
            | Failure::OutOfDomain { time, .. }
            | Failure::StepTooSmall { time, .. }
            | Failure::Chattering { time, .. }
            | Failure::Livelock { time, .. }
            | Failure::Accumulation { time, .. }
            | Failure::Lost { time, .. }
            | Failure::Conflict { time, .. }
            | Failure::Reset { time, .. }
            | Failure::NotDifferentiable { time, .. }
            | Failure::NoMode { time, .. }
            | Failure::NoForm { time, .. }
            | Failure::Overlap { time, .. }
            | Failure::Branch { time, .. }
            | Failure::OffMotion { time, .. }
            | Failure::Bound { time, .. }
            | Failure::Untrue { time, .. }
            | Failure::Interrupted { time } => Some(*time).filter(|time| !time.is_nan()),
            Failure::Structure { .. } | Failure::BadOption { .. } | Failure::BadMethod { .. } => None,
        }
    }
}

/// How a message begins: with the time, if there is one.
struct When(f64);

impl fmt::Display for When {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.is_nan() { f.write_str("with these parameters") } else { write!(f, "at t = {} s", self.0) }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Failure::NotFinite { time, what } => write!(
                f,
                "{} {what} is not a finite number: look for a division by zero, or for a value that grows without bound",
                When(*time)
            ),
            Failure::NotDifferentiable { time, what, reason } => {
                write!(f, "{} {what} has no derivative: {reason}", When(*time))
            }
            Failure::Singular { time, what } => write!(
                f,
                "{} the equations of {what} have no unique solution: the machine is in a singular position or a modulus vanishes there",
                When(*time)
            ),
            Failure::Vanished { time, what, divisor } => write!(
                f,
                "{} the equations of {what} have no unique solution: they divide by {divisor}, which vanishes there; the \
                 machine is in a singular position, unless another variable may stay independent: name it with `prefer`",
                When(*time)
            ),
            Failure::NoConvergence { time, what, iterations, residual } => write!(
                f,
                "{} the iteration for {what} did not converge: after {iterations} iterations a residual of {residual:e} is left; \
                 a law may have no solution there, the step may be too long, or laws saturate so that nothing tells the \
                 unknowns any more (then give them a leakage: an R of large resistance beside them)",
                When(*time)
            ),
            Failure::OutOfDomain { time, what, reason } => {
                write!(f, "{} {what} is asked for a value where it has none: {reason}", When(*time))
            }
            Failure::Structure { assumed } => write!(
                f,
                "with these parameters the equations are others: they were derived where {assumed}; load the model with \
                 these values, as by `--set`, so that they are derived anew"
            ),
            Failure::Branch { time, what, leap } => write!(
                f,
                "{} the equations of {what} have two solutions: {} would leap from {} to {}; the solution that the run has \
                 followed ends here, or a step is too long to follow it",
                When(*time),
                leap.unknown,
                leap.from,
                leap.to
            ),
            Failure::OffMotion { time, what } => write!(
                f,
                "{} the positions {what} cannot be followed: a step is too long for that, the machine is at its limit, or \
                 another motion leads through the same position; take a shorter --step or a tighter --rtol",
                When(*time)
            ),
            Failure::Bound { time, what, most } => write!(
                f,
                "{} the equations of {what} are not solved after {most} evaluations, which is the bound; shorten the step, or allow more \
                 where steps have a deadline (`run --bound`)",
                When(*time)
            ),
            Failure::StepTooSmall { time, step } => write!(
                f,
                "at t = {time} s even a step of {step:e} s misses the tolerance: the solution grows without bound or is not smooth there"
            ),
            Failure::Chattering { time, what } => write!(
                f,
                "at t = {time} s {what} changes its side over and over and time stands still: give the law a finite slope at the switch"
            ),
            Failure::Livelock { time, what } => write!(
                f,
                "at t = {time} s events make each other happen over and over and time stands still: {what}; let one of them leave \
                 the condition of the other as it is, or put a gap between the conditions (hysteresis)"
            ),
            Failure::Accumulation { time, what, interval, end } => write!(
                f,
                "at t = {time} s `{what}` happens ever faster, {interval:.1e} s after the last time: its events accumulate at \
                 t = {end} s, and what is beyond that the model does not say; end the run before it, or let a law take over \
                 where it gets fast, such as a spring and a damper"
            ),
            Failure::Lost { time, what, since } => write!(
                f,
                "at t = {time} s `{what}` holds further on after it has happened at t = {since} s, and the way back that it began \
                 with was shorter than a step can tell: shorten the step or tighten --rtol, end the run before it, or let a law \
                 take over where events get fast, such as a contact (`constraint gap: x >= 0`)"
            ),
            Failure::Conflict { time, what, by } => write!(
                f,
                "at t = {time} s two events give {what} different values: `{}` gives {}, `{}` gives {}; say in one of them what \
                 holds where both happen",
                by[0].0, by[0].1, by[1].0, by[1].1
            ),
            Failure::Reset { time, what, reason } => write!(f, "at t = {time} s {what} cannot be reset: {reason}"),
            Failure::NoForm { time, mode, reason } => {
                write!(f, "from t = {time} s on {mode}: {reason}; another form may go on there, minimal does")
            }
            Failure::NoMode { time, what, tried: [tried, ended], why } => {
                write!(
                    f,
                    "at t = {time} s {what} ends, and no branches of the set-valued laws hold together beyond that: "
                )?;
                write!(
                    f,
                    "of {tried} modes tried, in {ended} a branch ends at once, and {} have no equations",
                    tried.saturating_sub(*ended)
                )?;
                match why {
                    Some(why) => write!(f, " ({why})")?,
                    None => f.write_str(" (sources joined with nothing between them, a flow with nowhere to go)")?,
                }
                f.write_str("; give what has to yield a resistance or an inertance, and friction no effort below 0")
            }
            Failure::Overlap { time, what, gap } => write!(
                f,
                "at t = {time} s the sides of the contact {what} overlap, its gap is {gap}: begin where it is 0 or above"
            ),
            Failure::BadOption { option, value, expected } => {
                write!(f, "{option} is {value}, but it must be {expected}")
            }
            Failure::BadMethod { expected } => write!(f, "this method does not fit the equations: use {expected}"),
            Failure::Untrue { time, what, miss, remedy } => write!(
                f,
                "at t = {time} s the result does not satisfy the model: {what} is missed by {miss:.0e} of what is there, as the \
                 audit found; do not use it: {remedy}"
            ),
            Failure::Interrupted { time } => write!(f, "stopped at t = {time} s as asked"),
        }
    }
}

impl std::error::Error for Failure {}
