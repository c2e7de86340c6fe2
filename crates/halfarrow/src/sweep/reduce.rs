//! What is kept of a run.

use halfarrow_compiler::unit::Unit;
use halfarrow_sim::Sink;

use crate::error::Problem;

/// One number of one variable.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Reduce {
    /// Which number.
    pub reduction: Reduction,
    /// The variable, such as `body.f`.
    pub variable: String,
}

/// Which number is kept of a variable. Over time they are over the samples of the run; means count each stretch between
/// two samples by its length, as a straight line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reduction {
    /// The first value.
    Initial,
    /// The last value.
    Final,
    /// The least value.
    Min,
    /// The greatest value.
    Max,
    /// The greatest magnitude.
    MaxAbs,
    /// The mean over time.
    Mean,
    /// The root of the mean square over time.
    Rms,
    /// When it was greatest, in s.
    TimeOfMax,
}

impl Reduction {
    const ALL: [Reduction; 8] = [
        Reduction::Initial,
        Reduction::Final,
        Reduction::Min,
        Reduction::Max,
        Reduction::MaxAbs,
        Reduction::Mean,
        Reduction::Rms,
        Reduction::TimeOfMax,
    ];

    fn name(self) -> &'static str {
        match self {
            Reduction::Initial => "initial",
            Reduction::Final => "final",
            Reduction::Min => "min",
            Reduction::Max => "max",
            Reduction::MaxAbs => "max_abs",
            Reduction::Mean => "mean",
            Reduction::Rms => "rms",
            Reduction::TimeOfMax => "time_of_max",
        }
    }
}

impl Reduce {
    /// Reads `max(body.f)`.
    ///
    /// ```
    /// use halfarrow::{Reduce, Reduction};
    /// let wanted = Reduce { reduction: Reduction::Max, variable: "body.f".into() };
    /// assert_eq!(Reduce::parse("max(body.f)"), Ok(wanted));
    /// assert!(Reduce::parse("most(body.f)").is_err());
    /// ```
    ///
    /// # Errors
    /// The text is no reduction of a variable.
    pub fn parse(text: &str) -> Result<Reduce, Problem> {
        let parts = text.trim().strip_suffix(')').and_then(|text| text.split_once('('));
        let found = parts.and_then(|(name, variable)| {
            let reduction = Reduction::ALL.into_iter().find(|r| r.name() == name.trim())?;
            Some(Reduce { reduction, variable: variable.trim().to_string() })
        });
        found.filter(|r| !r.variable.is_empty()).ok_or_else(|| {
            let known = Reduction::ALL.map(|r| format!("{}(x)", r.name())).join(", ");
            Problem::BadOption { reason: format!("`{text}` is nothing that can be kept of a run: there are {known}") }
        })
    }
}

/// What is kept of one variable.
#[derive(Debug, Clone)]
pub struct Reducers {
    name: String,
    /// The declared unit, where it is not an SI unit.
    unit: Option<Unit>,
    wanted: Vec<Reduction>,
}

impl Reducers {
    pub fn new(name: &str, unit: Option<Unit>, wanted: Vec<Reduction>) -> Reducers {
        Reducers { name: name.to_string(), unit, wanted }
    }

    /// Number of reductions.
    pub fn reductions(&self) -> usize {
        self.wanted.len()
    }

    /// Names and units of the columns.
    pub fn columns(&self, unit: &str) -> Vec<(String, String)> {
        let column = |r: &Reduction| {
            let unit = if *r == Reduction::TimeOfMax { "s" } else { unit };
            (format!("{}({})", r.name(), self.name), unit.to_string())
        };
        self.wanted.iter().map(column).collect()
    }

    /// A sink for one run.
    pub fn begin(all: &[Reducers]) -> Reducing<'_> {
        Reducing { all, last: None, begun: None, of: vec![Tally::default(); all.len()] }
    }
}

/// Everything that can be kept of a variable, in SI units.
#[derive(Debug, Clone, Default)]
struct Tally {
    first: f64,
    last: f64,
    min: f64,
    max: f64,
    time_of_max: f64,
    /// Integrals over time of the value and of its square.
    integral: f64,
    square: f64,
}

/// What is kept of a run while it goes on.
#[derive(Debug, Clone)]
pub struct Reducing<'a> {
    all: &'a [Reducers],
    begun: Option<f64>,
    last: Option<f64>,
    of: Vec<Tally>,
}

impl Sink for Reducing<'_> {
    fn sample(&mut self, t: f64, values: &[f64]) {
        let before = self.last.replace(t);
        self.begun.get_or_insert(t);
        for (tally, &value) in self.of.iter_mut().zip(values) {
            match before {
                None => {
                    *tally =
                        Tally { first: value, last: value, min: value, max: value, time_of_max: t, ..Tally::default() }
                }
                Some(before) => tally.add(before, t, value),
            }
        }
    }
}

impl Tally {
    fn add(&mut self, before: f64, t: f64, value: f64) {
        let (h, a, b) = (t - before, self.last, value);
        self.integral += h * 0.5 * (a + b);
        self.square += h * (a * a + a * b + b * b) / 3.0;
        self.min = self.min.min(value);
        if value > self.max {
            (self.max, self.time_of_max) = (value, t);
        }
        self.last = value;
    }

    fn of(&self, reduction: Reduction, length: f64) -> f64 {
        let mean = |integral: f64, still: f64| if length > 0.0 { integral / length } else { still };
        match reduction {
            Reduction::Initial => self.first,
            Reduction::Final => self.last,
            Reduction::Min => self.min,
            Reduction::Max => self.max,
            Reduction::MaxAbs => self.max.abs().max(self.min.abs()),
            Reduction::Mean => mean(self.integral, self.last),
            Reduction::Rms => mean(self.square, self.last * self.last).sqrt(),
            Reduction::TimeOfMax => self.time_of_max,
        }
    }
}

impl Reducing<'_> {
    /// What is kept, in the declared units.
    pub fn finish(self) -> Vec<f64> {
        let length = self.last.zip(self.begun).map_or(0.0, |(end, start)| end - start);
        let mut kept = Vec::new();
        for (reducers, tally) in self.all.iter().zip(&self.of) {
            for &reduction in &reducers.wanted {
                let si = tally.of(reduction, length);
                let unit = reducers.unit.as_ref().filter(|_| reduction != Reduction::TimeOfMax);
                kept.push(unit.map_or(si, |unit| unit.from_si_f64(si)));
            }
        }
        kept
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_reduction_of_a_straight_line() {
        let all = [Reducers::new("x", None, Reduction::ALL.to_vec())];
        let mut sink = Reducers::begin(&all);
        // From 2 down to -4 in 3 s, in steps of different length.
        for t in [0.0, 0.5, 2.0, 3.0] {
            sink.sample(t, &[2.0 - 2.0 * t]);
        }
        let kept = sink.finish();
        let expected = [2.0, -4.0, -4.0, 2.0, 4.0, -1.0, 2.0, 0.0];
        kept.iter().zip(expected).for_each(|(a, b)| assert!((a - b).abs() < 1e-14, "{kept:?}"));
    }

    #[test]
    fn results_are_in_declared_units() {
        let mm = Unit::parse("mm").unwrap();
        let all = [Reducers::new("x", Some(mm), vec![Reduction::Max, Reduction::TimeOfMax])];
        let mut sink = Reducers::begin(&all);
        sink.sample(0.0, &[0.001]);
        sink.sample(0.5, &[0.002]);
        assert_eq!(sink.finish(), [2.0, 0.5]);
        assert_eq!(all[0].columns("mm")[1], ("time_of_max(x)".to_string(), "s".to_string()));
    }
}
