//! The first zero crossing inside a step.

use super::Signs;
use super::signs::PLACES;
use crate::Failure;

/// Parts of a step at whose ends the signs are looked at: a pulse as short as one part is not missed.
const PARTS: usize = 4;

/// Halvings of the bracket of a crossing at most.
const MOST_BISECTIONS: usize = 80;

/// Part of a step within which crossings are not told apart, 2 to the power -62: what has passed since a start at time 0 can
/// be as small as you like, but what a state would be then is rounding of the step.
pub(crate) const FINEST: f64 = 2.168404344971009e-19;

/// Points inside a step that are looked at beside the ends of its parts, at most.
const MOST_LOOKS: usize = 240;

/// The first time in `(start, end]` at which an event indicator has another sign than that held, and which it is.
/// `crossed` says for a time inside the step what [`Signs::crossed`] says of the state there. The time returned is just
/// past the crossing, by a rounding error.
///
/// Two crossings of one function inside one part of the step are found where its values bend towards 0 there: the part is
/// halved until they do not any more.
pub(crate) fn first_crossing(
    signs: &mut Signs,
    start: f64,
    end: f64,
    mut crossed: impl FnMut(&mut Signs, f64) -> Result<Option<usize>, Failure>,
) -> Result<Option<(f64, usize)>, Failure> {
    if signs.is_empty() {
        return Ok(None);
    }
    let time = |part: usize| if part == PARTS { end } else { start + (end - start) * part as f64 / PARTS as f64 };
    crossed(signs, start)?;
    // Values at the begin of what is looked at stand in place 0, those at the ends of what is left of a part behind it.
    signs.keep(0);
    let (mut before, mut looks) = (start, 0);
    let mut ends = [0.0; PLACES];
    for part in 1..=PARTS {
        let finest = FINEST * (end - start);
        let found = crossed(signs, time(part))?;
        if found.is_some() {
            return bisect(signs, (before, time(part)), finest, found, &mut crossed);
        }
        signs.keep(1);
        let mut open = 1;
        ends[open] = time(part);
        while open > 0 {
            let middle = before + 0.5 * (ends[open] - before);
            let inside = middle > before && middle < ends[open] && looks < MOST_LOOKS;
            let found = if inside { crossed(signs, middle)? } else { None };
            looks += 1;
            if found.is_some() {
                return bisect(signs, (before, middle), finest, found, &mut crossed);
            }
            if inside && open + 1 < PLACES && signs.may_hide(0, open) {
                open += 1;
                signs.keep(open);
                ends[open] = middle;
            } else {
                before = ends[open];
                signs.keep_as(open, 0);
                open -= 1;
            }
        }
    }
    Ok(None)
}

/// Halves the bracket until it is as short as times can be told apart, or as `finest`.
fn bisect(
    signs: &mut Signs,
    (mut before, mut after): (f64, f64),
    finest: f64,
    mut found: Option<usize>,
    crossed: &mut impl FnMut(&mut Signs, f64) -> Result<Option<usize>, Failure>,
) -> Result<Option<(f64, usize)>, Failure> {
    for _ in 0..MOST_BISECTIONS {
        let middle = before + 0.5 * (after - before);
        if middle <= before || middle >= after || after - before <= finest {
            break;
        }
        match crossed(signs, middle)? {
            None => before = middle,
            there => (after, found) = (middle, there),
        }
    }
    Ok(found.map(|indicator| (after, indicator)))
}

#[cfg(test)]
#[allow(clippy::disallowed_methods, reason = "values to compare with")]
mod tests {
    use super::*;

    /// The first zero crossing of `g`, whose sign is held from 0, in (0, 1].
    fn first(g: impl Fn(f64) -> f64) -> Option<f64> {
        let mut signs = Signs::holding(g(0.0) > 0.0);
        let crossing = first_crossing(&mut signs, 0.0, 1.0, |signs, t| {
            signs.values[0] = g(t);
            Ok((signs.held[0] != (g(t) > 0.0)).then_some(0))
        });
        crossing.unwrap().map(|(time, _)| time)
    }

    #[test]
    fn finds_the_first_to_rounding() {
        assert_eq!(first(|t| t - 0.3), Some(0.3_f64.next_up()));
        assert_eq!(first(|t| 0.3 - t), Some(0.3));
        assert_eq!(first(|t| t - 1.0), None);
        assert_eq!(first(|t| 1.0 - t), Some(1.0));
    }

    #[test]
    fn finds_both_when_one_part_holds_two() {
        for middle in [0.1, 0.24, 0.26, 0.4, 0.5, 0.6, 0.74, 0.8, 0.9] {
            let half = 0.01_f64;
            let found = first(|t| (t - middle).powi(2) - half * half);
            assert!((found.unwrap() - (middle - half)).abs() < 1e-12, "{middle}: {found:?}");
        }
        assert_eq!(first(|t| (t - 0.4).powi(2) + 1e-9), None);
    }
}
