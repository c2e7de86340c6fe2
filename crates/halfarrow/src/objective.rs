//! How the number that is kept of a variable follows its samples.

use halfarrow_trace::Trace;

use crate::error::{Error, Problem};
use crate::gradient::Weighed;
use crate::pieces::{Quartic, STEP, WEIGHTS, pieces};
use crate::sweep::{Reduce, Reduction};

/// A number with its derivatives by the samples of a variable, and by their instants, where these move.
struct Number {
    value: f64,
    by_sample: Vec<f64>,
    by_time: Vec<f64>,
}

impl Reduce {
    /// The number itself as an objective of [`Model::gradient`](crate::Model::gradient): what is recorded has to hold its variable.
    ///
    /// # Errors
    /// The variable is not recorded, or the number has no derivative by values at given times.
    pub fn objective(&self, trace: &Trace) -> Result<Weighed, Error> {
        let bad = |reason: String| Error::from(Problem::BadOption { reason });
        let Some(at) = trace.columns.iter().position(|c| c.name == self.variable) else {
            return Err(bad(format!("`{}` is not recorded", self.variable)));
        };
        let (times, values) = (&trace.times[..], &trace.columns[at].values[..]);
        let (Some(&first), Some(&last)) = (times.first(), times.last()) else {
            return Err(bad("nothing was recorded".into()));
        };
        let greatest = |sign: f64| Number::greatest(times, values, sign);
        let number = match self.reduction {
            Reduction::Initial => Number::sample(values, 0),
            Reduction::Final => Number::sample(values, values.len() - 1),
            Reduction::Min => greatest(-1.0),
            Reduction::Max => greatest(1.0),
            Reduction::MaxAbs => {
                let (most, least) = (greatest(1.0), greatest(-1.0));
                if -least.value > most.value { least.times(-1.0) } else { most }
            }
            Reduction::Mean => Number::integral(times, values, false).times(1.0 / (last - first)),
            Reduction::Rms => {
                let square = Number::integral(times, values, true).times(1.0 / (last - first));
                let rms = square.value.sqrt();
                Number { value: rms, ..square.times(if rms > 0.0 { 0.5 / rms } else { 0.0 }) }
            }
            Reduction::TimeOfMax => {
                let reason = "time_of_max has no derivative: it is one of the times at which the run is recorded";
                return Err(bad(reason.into()));
            }
        };
        let mut samples = vec![vec![0.0; times.len()]; trace.columns.len()];
        samples[at] = number.by_sample;
        Ok(Weighed { value: number.value, samples, times: Some(number.by_time) })
    }
}

impl Number {
    /// One sample.
    fn sample(values: &[f64], at: usize) -> Number {
        let mut by_sample = vec![0.0; values.len()];
        by_sample[at] = 1.0;
        Number { value: values[at], by_sample, by_time: vec![0.0; values.len()] }
    }

    fn times(mut self, factor: f64) -> Number {
        self.by_sample.iter_mut().chain(&mut self.by_time).for_each(|slope| *slope *= factor);
        Number { value: factor * self.value, ..self }
    }

    /// The greatest value (`sign` 1), or the least (`sign` -1): a sample, or a turn inside of a step that goes beyond them all.
    /// The place of a turn is at rest, whatever moves the ends of its step along the curve.
    fn greatest(times: &[f64], values: &[f64], sign: f64) -> Number {
        let best = (0..values.len()).fold(0, |best, i| if sign * values[i] > sign * values[best] { i } else { best });
        let steps = pieces(times, values).filter(|piece| piece.len() == STEP);
        let turns = steps.filter_map(|piece| {
            let samples: [f64; STEP] = std::array::from_fn(|k| values[piece.start + k]);
            let (u, value) = Quartic::through(samples).beyond(samples, sign)?;
            (sign * value > sign * values[best]).then_some((piece, u, value))
        });
        let Some((piece, u, value)) = turns.max_by(|a, b| (sign * a.2).total_cmp(&(sign * b.2))) else {
            return Number::sample(values, best);
        };
        let mut number = Number { value, by_sample: vec![0.0; values.len()], by_time: vec![0.0; values.len()] };
        let (first, last, counts) = (piece.start, piece.end - 1, Quartic::counts(u));
        let slopes = slopes_at_ends(&values[piece], times[last] - times[first]);
        number.by_sample[first..=last].copy_from_slice(&counts);
        number.by_time[first] = -counts[0] * slopes[0];
        number.by_time[last] = -counts[STEP - 1] * slopes[1];
        number
    }

    /// The integral of a variable over time, or of its square.
    fn integral(times: &[f64], values: &[f64], squared: bool) -> Number {
        let mut number = Number { value: 0.0, by_sample: vec![0.0; times.len()], by_time: vec![0.0; times.len()] };
        let of = |v: f64| if squared { v * v } else { v };
        let slope_of = |v: f64| if squared { 2.0 * v } else { 1.0 };
        for piece in pieces(times, values) {
            let (first, last) = (piece.start, piece.end - 1);
            let (h, [a, b]) = (times[last] - times[first], [values[first], values[last]]);
            if piece.len() == STEP {
                // What is beyond the end of a step does not count, nor how its end moves along the curve.
                let slopes = slopes_at_ends(&values[piece.clone()], h);
                for (i, weight) in piece.zip(WEIGHTS) {
                    number.value += h * weight * of(values[i]);
                    number.by_sample[i] += h * weight * slope_of(values[i]);
                }
                number.by_time[first] -= of(a) + h * WEIGHTS[0] * slope_of(a) * slopes[0];
                number.by_time[last] += of(b) - h * WEIGHTS[STEP - 1] * slope_of(b) * slopes[1];
                continue;
            }
            let (mean, [by_a, by_b]) = match squared {
                true => ((a * a + a * b + b * b) / 3.0, [(2.0 * a + b) / 3.0, (2.0 * b + a) / 3.0]),
                false => (0.5 * (a + b), [0.5; 2]),
            };
            number.value += h * mean;
            number.by_sample[first] += h * by_a;
            number.by_sample[last] += h * by_b;
            number.by_time[first] -= mean;
            number.by_time[last] += mean;
        }
        number
    }
}

/// How fast a variable moves at both ends of a step of this length, by its samples.
fn slopes_at_ends(values: &[f64], h: f64) -> [f64; 2] {
    let quartic = Quartic::through(std::array::from_fn(|k| values[k]));
    [-1.0, 1.0].map(|u| quartic.slope(u) * 2.0 / h)
}
