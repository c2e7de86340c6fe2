//! What a variable does between its samples: a straight line, or within a step of a method that has a solution there a
//! polynomial of degree four through the samples at both ends and at [`INSIDE`].

use std::borrow::Cow;
use std::ops::Range;

use halfarrow_sim::{INSIDE, inside};
use halfarrow_trace::{Column, Trace};

/// Samples of a step with those inside.
pub(crate) const STEP: usize = INSIDE.len() + 2;
/// What samples at these places count in the integral over a step of length 1: Lobatto's quadrature, exact to degree 7.
pub(crate) const WEIGHTS: [f64; STEP] = [1.0 / 20.0, 49.0 / 180.0, 16.0 / 45.0, 49.0 / 180.0, 1.0 / 20.0];
/// The square of the inner places, from -1 to 1.
const INNER: f64 = 3.0 / 7.0;
/// How far off its neighbours the middle of a smooth step may be, as part of what it ranges over.
const SMOOTH: f64 = 0.05;
/// Parts into which a step is divided for pictures: even, so that its middle is a point.
const POINTS: usize = 16;
/// Where the slope is looked at for a change of its sign.
const LOOKS: usize = 16;
/// Halvings of the stretch in which it changes.
const HALVINGS: usize = 52;

/// Whether these are the times of one step with its inside.
pub(crate) fn is_step(times: &[f64]) -> bool {
    times.len() == STEP && times[STEP - 1] > times[0] && times[1..STEP - 1] == inside(times[0], times[STEP - 1])
}

/// The pieces of a variable between its samples: lines from one to the next, and steps with their inside where it is smooth.
pub(crate) fn pieces<'t>(times: &'t [f64], values: &'t [f64]) -> impl Iterator<Item = Range<usize>> + 't {
    let mut at = 0;
    std::iter::from_fn(move || {
        let whole = times.get(at..at + STEP).is_some_and(is_step) && is_smooth(&values[at..at + STEP]);
        let end = at + if whole { STEP } else { 2 };
        let piece = at..end;
        at = end - 1;
        (end <= times.len()).then_some(piece)
    })
}

/// Whether samples of a step are those of something smooth: the one in the middle is near to what a cubic through the others
/// says. What jumps or has a corner inside of a step, as an output that no rate reads may, is not.
pub(crate) fn is_smooth(v: &[f64]) -> bool {
    let (ends, inner) = (0.5 * (v[0] + v[4]), 0.5 * (v[1] + v[3]));
    let cubic = (inner - INNER * ends) / (1.0 - INNER);
    let [least, greatest] = v.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[l, g], &v| [l.min(v), g.max(v)]);
    (v[2] - cubic).abs() <= SMOOTH * (greatest - least)
}

/// The polynomial of a step, over a variable from -1 at its start to 1 at its end.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Quartic([f64; STEP]);

impl Quartic {
    /// Through the samples of a step.
    pub(crate) fn through(v: [f64; STEP]) -> Quartic {
        let (even, inner) = (0.5 * (v[0] + v[4]) - v[2], 0.5 * (v[1] + v[3]) - v[2]);
        let fourth = (inner / INNER - even) / (INNER - 1.0);
        let (odd, slope) = (0.5 * (v[4] - v[0]), 0.5 * (v[3] - v[1]) / INNER.sqrt());
        let third = (slope - odd) / (INNER - 1.0);
        Quartic([v[2], odd - third, even - fourth, third, fourth])
    }

    /// Its value.
    pub(crate) fn at(&self, u: f64) -> f64 {
        self.0.iter().rev().fold(0.0, |sum, c| sum * u + c)
    }

    /// Its slope.
    pub(crate) fn slope(&self, u: f64) -> f64 {
        let [_, a, b, c, d] = self.0;
        a + u * (2.0 * b + u * (3.0 * c + u * 4.0 * d))
    }

    /// Where it is greatest (`sign` 1) or least (`sign` -1) inside, if it goes beyond all samples there by more than rounding.
    pub(crate) fn beyond(&self, samples: [f64; STEP], sign: f64) -> Option<(f64, f64)> {
        let most = samples.iter().map(|v| sign * v).fold(f64::NEG_INFINITY, f64::max);
        let size = samples.iter().fold(0.0f64, |most, v| most.max(v.abs()));
        let place = |k: usize| 2.0 * k as f64 / LOOKS as f64 - 1.0;
        let turns = (0..LOOKS).filter(|&k| sign * self.slope(place(k)) > 0.0 && sign * self.slope(place(k + 1)) <= 0.0);
        let found = turns.map(|k| {
            let (mut low, mut high) = (place(k), place(k + 1));
            for _ in 0..HALVINGS {
                let middle = 0.5 * (low + high);
                *(if sign * self.slope(middle) > 0.0 { &mut low } else { &mut high }) = middle;
            }
            (low, self.at(low))
        });
        let best = found.max_by(|a, b| (sign * a.1).total_cmp(&(sign * b.1)))?;
        (sign * best.1 > most + 4.0 * f64::EPSILON * size).then_some(best)
    }

    /// What each sample counts in the value at a place.
    pub(crate) fn counts(u: f64) -> [f64; STEP] {
        std::array::from_fn(|k| {
            let mut one = [0.0; STEP];
            one[k] = 1.0;
            Quartic::through(one).at(u)
        })
    }
}

/// The least and the greatest value of a variable, also inside of steps of which samples tell. Of none: infinities.
pub fn extremes(times: &[f64], values: &[f64]) -> [f64; 2] {
    let mut found = values.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[l, g], &v| [l.min(v), g.max(v)]);
    for piece in pieces(times, values).filter(|piece| piece.len() == STEP) {
        let samples: [f64; STEP] = std::array::from_fn(|k| values[piece.start + k]);
        let quartic = Quartic::through(samples);
        let turn = |sign| quartic.beyond(samples, sign).map(|(_, value)| value);
        found = [turn(-1.0).map_or(found[0], |v| v.min(found[0])), turn(1.0).map_or(found[1], |v| v.max(found[1]))];
    }
    found
}

/// The same curves with more points for pictures, where samples inside of steps tell how they go between.
pub(crate) fn smooth(trace: &Trace) -> Cow<'_, Trace> {
    let all: Vec<Range<usize>> = pieces(&trace.times, &trace.times).collect();
    if all.iter().all(|piece| piece.len() < STEP) {
        return Cow::Borrowed(trace);
    }
    let part = |k: usize| k as f64 / POINTS as f64;
    let refined = |values: &[f64], between: &dyn Fn(&[f64], f64) -> f64| {
        let mut points: Vec<f64> = values.first().copied().into_iter().collect();
        for piece in &all {
            let own = &values[piece.clone()];
            if own.len() == STEP {
                points.extend((1..POINTS).map(|k| between(own, part(k))));
            }
            points.extend(own.last());
        }
        points
    };
    let on_line = |own: &[f64], part: f64| own[0] + part * (own[STEP - 1] - own[0]);
    let on_curve = |own: &[f64], part: f64| match is_smooth(own) {
        true => Quartic::through(std::array::from_fn(|k| own[k])).at(2.0 * part - 1.0),
        false => {
            let places = inside(0.0, 1.0);
            let place = |k: usize| if k == 0 { 0.0 } else { places.get(k - 1).copied().unwrap_or(1.0) };
            let k = (1..STEP - 1).take_while(|&k| place(k) <= part).count();
            own[k] + (part - place(k)) / (place(k + 1) - place(k)) * (own[k + 1] - own[k])
        }
    };
    let columns = trace.columns.iter().map(|column| Column {
        name: column.name.clone(),
        unit: column.unit.clone(),
        values: refined(&column.values, &on_curve),
    });
    Cow::Owned(Trace { times: refined(&trace.times, &on_line), columns: columns.collect() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_get_smooth_within_steps() {
        let f = |t: f64| t * (2.0 - t);
        let [a, b, c] = inside(0.5, 2.5);
        let times = vec![0.0, 0.5, a, b, c, 2.5, 2.5, 3.0];
        let mut values: Vec<f64> = times.iter().map(|&t| f(t)).collect();
        values[6] = -9.0;
        let column = Column { name: "x".into(), unit: "m".into(), values };
        let trace = Trace { times, columns: vec![column] };
        let fine = smooth(&trace);
        assert_eq!(fine.times.len(), 2 + POINTS + 2);
        assert_eq!([fine.times[0], fine.times[1], fine.times[1 + POINTS]], [0.0, 0.5, 2.5]);
        assert_eq!(fine.columns[0].values[2 + POINTS], -9.0);
        for (t, x) in fine.times.iter().zip(&fine.columns[0].values).take(2 + POINTS) {
            assert!((x - f(*t)).abs() < 1e-14, "{t}: {x}");
        }
        let lines = Trace { times: vec![0.0, 1.0, 2.0], columns: Vec::new() };
        assert!(matches!(smooth(&lines), Cow::Borrowed(_)));
    }

    /// A quartic at the samples of the step from 2 to 5.
    fn sampled(f: impl Fn(f64) -> f64) -> [f64; STEP] {
        let [a, b, c] = inside(2.0, 5.0);
        [2.0, a, b, c, 5.0].map(f)
    }

    #[test]
    fn a_quartic_goes_through_what_it_is_made_of() {
        let f = |t: f64| 1.0 + t * (0.5 + t * (-0.3 + t * (0.2 - 0.03 * t)));
        let quartic = Quartic::through(sampled(f));
        for k in 0..=10 {
            let u = f64::from(k) / 5.0 - 1.0;
            assert!((quartic.at(u) - f(3.5 + 1.5 * u)).abs() < 1e-13, "{u}");
            let counted: f64 = Quartic::counts(u).iter().zip(sampled(f)).map(|(c, v)| c * v).sum();
            assert!((counted - quartic.at(u)).abs() < 1e-13, "{u}");
        }
        let integral = |t: f64| t + t * t * (0.25 + t * (-0.1 + t * (0.05 - 0.006 * t)));
        let sum: f64 = WEIGHTS.iter().zip(sampled(f)).map(|(w, v)| 3.0 * w * v).sum();
        assert!((sum - (integral(5.0) - integral(2.0))).abs() < 1e-13);
    }

    #[test]
    fn extremes_are_found_where_they_are() {
        let parabola = sampled(|t| 7.0 - (t - 3.1) * (t - 3.1));
        let (u, most) = Quartic::through(parabola).beyond(parabola, 1.0).unwrap();
        assert!((3.5 + 1.5 * u - 3.1).abs() < 1e-7 && (most - 7.0).abs() < 1e-14);
        assert!(Quartic::through(parabola).beyond(parabola, -1.0).is_none(), "the least is a sample");
        let still = sampled(|_| 0.1);
        assert!(Quartic::through(still).beyond(still, 1.0).is_none());
    }

    #[test]
    fn steps_are_told_from_single_samples() {
        let [a, b, c] = inside(0.3, 0.5);
        let times = [0.0, 0.1, 0.3, a, b, c, 0.5, 0.5, 0.6];
        let found: Vec<_> = pieces(&times, &times).collect();
        assert_eq!(found, [0..2, 1..3, 2..7, 6..8, 7..9]);
        assert!(pieces(&[0.0], &[0.0]).next().is_none() && pieces(&[], &[]).next().is_none());
        // What jumps within, at whatever place, and what has a corner.
        for at in 1..STEP {
            let jump: Vec<f64> = (0..times.len()).map(|k| if k < 2 + at { 0.0 } else { 1.0 }).collect();
            assert!(pieces(&times, &jump).all(|piece| piece.len() == 2), "{at}");
        }
        assert!(!is_smooth(&times[2..7].iter().map(|t| (t - 0.4).abs()).collect::<Vec<_>>()));
        assert!(is_smooth(&times[2..7].iter().map(|t| (t - 0.37) * (t - 0.37)).collect::<Vec<_>>()));
    }
}
