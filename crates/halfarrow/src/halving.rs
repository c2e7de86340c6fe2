//! How far apart two runs are that only their steps tell apart.

use std::collections::{BTreeMap, HashMap};

use halfarrow_trace::{Column, Trace};

use crate::audited::Deviation;

/// Columns below this part of what has their unit, or below [`NOTHING`] in their unit, are what rounding left.
const ROUNDING: f64 = 1e-9;
const NOTHING: f64 = 1e-10;

/// What differs most, on the average over the run: what lasts, not what comes a little sooner or later. Relative to the greatest
/// magnitude of its column. `None` if nothing can be compared.
pub(crate) fn apart(run: &Trace, other: &Trace) -> Option<Deviation> {
    let mut scales: BTreeMap<&str, f64> = BTreeMap::new();
    for column in &run.columns {
        let scale = scales.entry(&column.unit).or_insert(0.0);
        *scale = scale.max(greatest(column));
    }
    let named: HashMap<&str, &Column> = other.columns.iter().map(|column| (column.name.as_str(), column)).collect();
    let pairs = run.columns.iter().filter_map(|column| Some((column, *named.get(column.name.as_str())?)));
    let compared = pairs.filter_map(|(column, beside)| {
        let size = greatest(column).max(greatest(beside));
        let is_there = size > NOTHING && size > ROUNDING * scales[column.unit.as_str()];
        is_there.then(|| difference((&run.times, column), (&other.times, beside), size))
    });
    compared.flatten().max_by(|a, b| a.value.total_cmp(&b.value))
}

/// The mean difference of two columns in parts of `size`, and when it is greatest.
fn difference((times, column): (&[f64], &Column), beside: (&[f64], &Column), size: f64) -> Option<Deviation> {
    let apart: Vec<f64> = times.iter().zip(&column.values).map(|(&t, v)| (v - at(beside, t)).abs() / size).collect();
    let long = times.last()? - times.first()?;
    let area: f64 = (1..times.len()).map(|k| 0.5 * (times[k] - times[k - 1]) * (apart[k] + apart[k - 1])).sum();
    let worst = (0..times.len()).max_by(|&a, &b| apart[a].total_cmp(&apart[b]))?;
    let place = format!("{}, beside a run by half the step,", column.name);
    (long > 0.0).then(|| Deviation { value: area / long, time: times[worst], place, resolution: 0.0 })
}

/// A column at a time, on lines between its samples.
fn at((times, column): (&[f64], &Column), t: f64) -> f64 {
    let after = times.partition_point(|known| *known < t).min(times.len() - 1);
    let before = after.saturating_sub(1);
    let (a, b) = (column.values[before], column.values[after]);
    let length = times[after] - times[before];
    if length > 0.0 { a + (b - a) * ((t - times[before]) / length).clamp(0.0, 1.0) } else { b }
}

fn greatest(column: &Column) -> f64 {
    column.values.iter().fold(0.0, |most, v| most.max(v.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trace(times: &[f64], values: &[f64]) -> Trace {
        let mut trace = Trace::new([("v", "m/s"), ("idle", "V")]);
        trace.times = times.to_vec();
        trace.columns[0].values = values.to_vec();
        trace.columns[1].values = values.iter().enumerate().map(|(k, _)| 1e-17 * k as f64).collect();
        trace
    }

    #[test]
    fn what_lasts_counts_and_what_comes_a_little_later_does_not() {
        let times: Vec<f64> = (0..=100).map(|k| 0.01 * f64::from(k)).collect();
        let leap = |when: usize, to: f64| -> Vec<f64> { (0..=100).map(|k| if k < when { 1.0 } else { to }).collect() };
        let found = apart(&trace(&times, &leap(50, -1.0)), &trace(&times, &leap(51, -1.0))).expect("they are compared");
        assert!(found.value < 0.03, "{found:?}");
        let found = apart(&trace(&times, &leap(50, -1.5)), &trace(&times, &leap(50, -1.0))).expect("they are compared");
        assert!((found.value - 0.17).abs() < 0.01 && found.place.starts_with("v,"), "{found:?}");
    }
}
