//! What is kept of a run.

use halfarrow_compiler::unit::Unit;
use halfarrow_sim::Sink;

use crate::error::Problem;
use crate::pieces::{Quartic, STEP, WEIGHTS, is_smooth, is_step};

/// One number of one variable.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Reduce {
    /// Which number.
    pub reduction: Reduction,
    /// The variable, such as `body.f`.
    pub variable: String,
}

/// Which number is kept of a variable. Over time they are over the run: within steps of a method that has a solution there,
/// where those are [asked for](crate::Run::inside), and always in sweeps, over polynomials through samples inside; else over
/// straight lines from one sample to the next.
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

    /// Whether the run between its ends counts.
    pub(crate) fn is_over_time(self) -> bool {
        !matches!(self, Reduction::Initial | Reduction::Final)
    }

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

    /// A sink for one run, in which steps may have samples inside.
    pub fn begin(all: &[Reducers], inside: bool) -> Reducing<'_> {
        Reducing { all, last: None, begun: None, of: vec![Tally::default(); all.len()], inside, waiting: Vec::new() }
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
    inside: bool,
    /// Samples of which it is open whether they are inside of a step, the last one counted ahead of them.
    waiting: Vec<(f64, Vec<f64>)>,
}

impl Sink for Reducing<'_> {
    fn sample(&mut self, t: f64, values: &[f64]) {
        if !self.inside {
            return self.count(t, values);
        }
        if self.waiting.is_empty() {
            self.count(t, values);
        }
        self.waiting.push((t, values.to_vec()));
        if self.waiting.len() < STEP {
            return;
        }
        let times: Vec<f64> = self.waiting.iter().map(|sample| sample.0).collect();
        if is_step(&times) {
            for (k, tally) in self.of.iter_mut().enumerate() {
                tally.add_step(&times, std::array::from_fn(|i| self.waiting[i].1[k]));
            }
            self.last = Some(t);
            self.waiting.drain(..STEP - 1);
        } else {
            self.count_first_waiting();
        }
    }
}

impl Reducing<'_> {
    /// The first waiting sample is a line from the last one counted.
    fn count_first_waiting(&mut self) {
        self.waiting.remove(0);
        if let Some((t, values)) = self.waiting.first().cloned() {
            self.count(t, &values);
        }
    }

    fn count(&mut self, t: f64, values: &[f64]) {
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

    /// A step with its inside, from the last sample on.
    fn add_step(&mut self, times: &[f64], values: [f64; STEP]) {
        if !is_smooth(&values) {
            return (1..STEP).for_each(|k| self.add(times[k - 1], times[k], values[k]));
        }
        let h = times[STEP - 1] - times[0];
        for (weight, value) in WEIGHTS.iter().zip(values) {
            self.integral += h * weight * value;
            self.square += h * weight * value * value;
        }
        let quartic = Quartic::through(values);
        let least = values.into_iter().fold(self.min, f64::min);
        self.min = quartic.beyond(values, -1.0).map_or(least, |(_, value)| least.min(value));
        let samples = times.iter().copied().zip(values);
        let turn = quartic.beyond(values, 1.0).map(|(u, value)| (times[0] + 0.5 * h * (1.0 + u), value));
        for (t, value) in samples.chain(turn) {
            if value > self.max {
                (self.max, self.time_of_max) = (value, t);
            }
        }
        self.last = values[STEP - 1];
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
    pub fn finish(mut self) -> Vec<f64> {
        while self.waiting.len() > 1 {
            self.count_first_waiting();
        }
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
        let mut sink = Reducers::begin(&all, false);
        // From 2 down to -4 in 3 s, in steps of different length.
        for t in [0.0, 0.5, 2.0, 3.0] {
            sink.sample(t, &[2.0 - 2.0 * t]);
        }
        let kept = sink.finish();
        let expected = [2.0, -4.0, -4.0, 2.0, 4.0, -1.0, 2.0, 0.0];
        kept.iter().zip(expected).for_each(|(a, b)| assert!((a - b).abs() < 1e-14, "{kept:?}"));
    }

    #[test]
    fn steps_count_with_their_inside() {
        let all = [Reducers::new("x", None, Reduction::ALL.to_vec())];
        let mut sink = Reducers::begin(&all, true);
        // 2 t - t^2 from 0 to 3: a line, a step, a jump down by 1 with a line after it.
        let f = |t: f64| t * (2.0 - t);
        let [a, b, c] = halfarrow_sim::inside(0.0, 2.5);
        [0.0, a, b, c, 2.5].iter().for_each(|&t| sink.sample(t, &[f(t)]));
        sink.sample(2.5, &[f(2.5) - 1.0]);
        sink.sample(3.0, &[f(2.5) - 1.0]);
        let kept = sink.finish();
        let (mean, square): (f64, f64) =
            (6.25 - 15.625 / 3.0 - 2.25 * 0.5, 4.0 / 3.0 * 15.625 - 39.0625 + 0.2 * 97.65625);
        let expected = [0.0, -2.25, -2.25, 1.0, 2.25, mean / 3.0, ((square + 0.5 * 2.25 * 2.25) / 3.0).sqrt(), 1.0];
        kept.iter().zip(expected).for_each(|(a, b)| assert!((a - b).abs() < 1e-7, "{kept:?} is not {expected:?}"));
        assert!((kept[3] - 1.0).abs() < 1e-14 && (kept[5] - mean / 3.0).abs() < 1e-14);
    }

    #[test]
    fn results_are_in_declared_units() {
        let mm = Unit::parse("mm").unwrap();
        let all = [Reducers::new("x", Some(mm), vec![Reduction::Max, Reduction::TimeOfMax])];
        let mut sink = Reducers::begin(&all, true);
        sink.sample(0.0, &[0.001]);
        sink.sample(0.5, &[0.002]);
        assert_eq!(sink.finish(), [2.0, 0.5]);
        assert_eq!(all[0].columns("mm")[1], ("time_of_max(x)".to_string(), "s".to_string()));
    }
}
