//! The profile of a parameter: how much worse the best fit gets where it has other values. Source: [RaueTimmer].

use serde::Serialize;

use super::search::Task;
use super::{FitReport, Range, reach};
use crate::error::Error;

/// Values to each side, and how many standard errors they reach.
const POINTS: usize = 12;
const REACH: f64 = 3.0;

/// The least sum for each value of one parameter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Profile {
    /// The parameter.
    pub name: String,
    /// Its values, in SI units, ascending.
    pub values: Vec<f64>,
    /// The least sums, all other parameters fitted.
    pub sums: Vec<f64>,
    /// The sum at the ends of the interval.
    pub bound: f64,
    /// Where the sum stays below that, each end `null` if it was not met.
    pub interval: (Option<f64>, Option<f64>),
    /// How often such intervals hold the true value.
    pub level: f64,
}

/// Values and sums to one side, and where the bound was crossed.
type Side = (Vec<(f64, f64)>, Option<f64>);

/// The profile of the parameter `at`, around where it was found.
pub(super) fn profile(
    task: &Task<'_>,
    report: &FitReport,
    at: usize,
    (known, level): (bool, f64),
) -> Result<Profile, Error> {
    let estimate = &report.parameters[at];
    let best: Vec<f64> = report.parameters.iter().map(|p| p.value).collect();
    // One parameter alone: the square of the normal or of Student's distribution.
    let wide = reach(known, report.freedom, level);
    let bound = report.cost + report.variance * wide * wide;
    let near = if best[at] == 0.0 { 1.0 } else { best[at].abs() };
    let step = estimate.error.unwrap_or(near) * REACH / POINTS as f64;
    let others: Vec<usize> = (0..best.len()).filter(|&j| j != at).collect();
    let inside = |value: f64| match task.ranges[at] {
        Range::Free { .. } => true,
        Range::Between { low, high } => (low..=high).contains(&value),
    };
    let side = |sign: f64| -> Result<Side, Error> {
        let (mut found, mut from, mut before) = (Vec::new(), best.clone(), (best[at], report.cost));
        for k in 1..=POINTS {
            let value = best[at] + sign * k as f64 * step;
            if !inside(value) {
                break;
            }
            from[at] = value;
            if !others.is_empty() {
                from = task.search(&from, &others).0;
            }
            let sum = task.cost(&task.residuals(&task.columns(&from, &[])?));
            found.push((value, sum));
            if sum > bound {
                // A parabola through the least sum tells where the bound was crossed.
                let root = |sum: f64| (sum - report.cost).max(0.0).sqrt();
                let part = (root(bound) - root(before.1)) / (root(sum) - root(before.1));
                return Ok((found, Some(before.0 + part * (value - before.0))));
            }
            before = (value, sum);
        }
        Ok((found, None))
    };
    let ((mut all, low), (above, high)) = (side(-1.0)?, side(1.0)?);
    all.reverse();
    all.push((best[at], report.cost));
    all.extend(above);
    let (values, sums) = all.into_iter().unzip();
    Ok(Profile { name: estimate.name.clone(), values, sums, bound, interval: (low, high), level })
}
