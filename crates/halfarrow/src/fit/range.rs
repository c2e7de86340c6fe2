//! Parameters as a search has them.

use super::Fit;
use crate::compiled::Compiled;
use crate::error::{Error, Problem};

/// A parameter as the search has it: without bounds by `value = scale · u`, between bounds by the sine of `u`. Source: [MINUIT].
#[derive(Debug, Clone, Copy)]
pub(super) enum Range {
    Free { scale: f64 },
    Between { low: f64, high: f64 },
}

impl Range {
    pub fn value(self, u: f64) -> f64 {
        match self {
            Range::Free { scale } => scale * u,
            Range::Between { low, high } => low + 0.5 * (high - low) * (1.0 + libm::sin(u)),
        }
    }

    pub fn slope(self, u: f64) -> f64 {
        match self {
            Range::Free { scale } => scale,
            Range::Between { low, high } => 0.5 * (high - low) * libm::cos(u),
        }
    }

    pub fn place(self, value: f64) -> f64 {
        match self {
            Range::Free { scale } => value / scale,
            Range::Between { low, high } => libm::asin((2.0 * (value - low) / (high - low) - 1.0).clamp(-1.0, 1.0)),
        }
    }
}

/// Ranges of the parameters, and where the search begins.
pub(super) fn ranges(fit: &Fit, compiled: &Compiled) -> Result<(Vec<Range>, Vec<f64>), Error> {
    let (mut ranges, mut begin) = (Vec::new(), Vec::new());
    for parameter in &fit.parameters {
        let own = compiled.parameter(&parameter.name);
        let range = match &parameter.bounds {
            None => Range::Free { scale: own.filter(|v| *v != 0.0).map_or(1.0, f64::abs) },
            Some((low, high)) => {
                let (low, high) = (compiled.quantity(&parameter.name, low)?, compiled.quantity(&parameter.name, high)?);
                if low >= high || !(low.is_finite() && high.is_finite()) {
                    let reason = format!("`{}` is given the bounds {low} and {high}", parameter.name);
                    return Err(Problem::BadOption { reason }.into());
                }
                Range::Between { low, high }
            }
        };
        let value = match range {
            Range::Between { low, high } => match own.filter(|own| low < *own && *own < high) {
                Some(own) => own,
                None if low > 0.0 => (low * high).sqrt(),
                None => 0.5 * (low + high),
            },
            Range::Free { .. } => own.unwrap_or(0.0),
        };
        begin.push(value);
        ranges.push(range);
    }
    Ok((ranges, begin))
}

/// Where searches begin: at the first guesses, then spread evenly between the bounds; where there are none, from a tenth to ten
/// times the guess. Source of the points: [Roberts].
pub(super) fn beginnings(ranges: &[Range], guesses: &[f64], count: usize) -> Vec<Vec<f64>> {
    // The number with φ^(d + 1) = φ + 1, whose powers are the least rational steps through a cube of d dimensions.
    let d = ranges.len() as i32;
    let phi = (0..64).fold(2.0f64, |phi, _| libm::pow(1.0 + phi, 1.0 / f64::from(d + 1)));
    let point = |k: usize| {
        let along = |(j, (range, &guess)): (usize, (&Range, &f64))| {
            let step = libm::pow(phi, -(j as f64 + 1.0));
            let part = (0.5 + k as f64 * step).fract();
            let (low, high) = match *range {
                Range::Between { low, high } => (low, high),
                Range::Free { scale } if guess == 0.0 => (-scale, scale),
                Range::Free { .. } => (0.1 * guess, 10.0 * guess),
            };
            // Ranges of more than a decade are walked by their logarithm.
            match low * high > 0.0 && high / low > 10.0 {
                true => low * libm::pow(high / low, part),
                false => low + part * (high - low),
            }
        };
        ranges.iter().zip(guesses).enumerate().map(along).collect()
    };
    std::iter::once(guesses.to_vec()).chain((1..count).map(point)).collect()
}
