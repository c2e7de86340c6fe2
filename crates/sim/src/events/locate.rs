//! The first zero crossing inside a step.

use super::Signs;
use super::signs::INSIDE;
use crate::Failure;

/// Parts of a step at whose ends the signs are looked at: a pulse as short as one part is not missed.
const PARTS: usize = 4;

/// What angles may go on by in a piece of a step, in rad, so that a part of it shows what indicators do that read their sines.
const TURN: f64 = std::f64::consts::FRAC_PI_2;

/// Pieces of a step at most.
const MOST_PIECES: f64 = 1e6;

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
/// Two crossings of one function inside one part of the step are found where its values bend towards 0 there, at the vertex
/// of a parabola or, where systems ask for it, by halving the part until they do not bend so any more.
pub(crate) fn first_crossing(
    signs: &mut Signs,
    start: f64,
    end: f64,
    mut crossed: impl FnMut(&mut Signs, f64) -> Result<Option<usize>, Failure>,
) -> Result<Option<(f64, usize)>, Failure> {
    if signs.is_empty() {
        return Ok(None);
    }
    let pieces = pieces(signs, (start, end), &mut crossed)?;
    let time = |piece: usize| if piece == pieces { end } else { start + (end - start) * piece as f64 / pieces as f64 };
    for piece in 0..pieces {
        if piece > 0 {
            crossed(signs, time(piece))?;
        }
        if let Some(found) = first_in_piece(signs, time(piece), time(piece + 1), &mut crossed)? {
            return Ok(Some(found));
        }
    }
    Ok(None)
}

/// How many pieces of a step show all that indicators do that read sines of angles. Ends with an evaluation at the start.
fn pieces(
    signs: &mut Signs,
    (start, end): (f64, f64),
    crossed: &mut impl FnMut(&mut Signs, f64) -> Result<Option<usize>, Failure>,
) -> Result<usize, Failure> {
    signs.sharpen(None);
    if signs.angles.is_empty() {
        crossed(signs, start)?;
        return Ok(1);
    }
    // Beyond a crossing there need be no values.
    let has_end = crossed(signs, end).is_ok();
    std::mem::swap(&mut signs.angles, &mut signs.angles_at_end);
    crossed(signs, start)?;
    let ways = signs.angles.iter().zip(&signs.angles_at_end).map(|(start, end)| (end - start).abs());
    let turned = if has_end { ways.fold(0.0, f64::max) } else { 0.0 };
    Ok((turned / TURN).ceil().clamp(1.0, MOST_PIECES) as usize)
}

/// The same in a piece of a step, at whose start the indicators were evaluated last.
fn first_in_piece(
    signs: &mut Signs,
    start: f64,
    end: f64,
    crossed: &mut impl FnMut(&mut Signs, f64) -> Result<Option<usize>, Failure>,
) -> Result<Option<(f64, usize)>, Failure> {
    let time = |part: usize| if part == PARTS { end } else { start + (end - start) * part as f64 / PARTS as f64 };
    let finest = FINEST * (end - start);
    let (thorough, mut looks) = (signs.thorough, 0);
    signs.keep(0);
    for part in 1..=PARTS {
        let found = crossed(signs, time(part))?;
        if found.is_some() {
            return bisect(signs, (time(part - 1), time(part)), finest, found, crossed);
        }
        signs.keep(part);
        if thorough {
            let ends = (part, time(part - 1), time(part));
            if let Some((before, middle, found)) = hidden(signs, ends, &mut looks, crossed)? {
                return bisect(signs, (before, middle), finest, Some(found), crossed);
            }
            continue;
        }
        for indicator in 0..signs.len() {
            let Some(turn) = signs.turn(indicator, part) else { continue };
            let extremum = start + (end - start) * turn / PARTS as f64;
            let found = crossed(signs, extremum)?;
            if found.is_some() {
                let before = if turn < (part - 1) as f64 { time(part - 2) } else { time(part - 1) };
                return bisect(signs, (before, extremum), finest, found, crossed);
            }
        }
    }
    Ok(None)
}

/// A crossing inside a part of a step at whose ends there is none, found by halving the part wherever an indicator may hide
/// one: it lies between the two times.
#[allow(clippy::type_complexity, reason = "two times and an indicator")]
fn hidden(
    signs: &mut Signs,
    (part, begin, end): (usize, f64, f64),
    looks: &mut usize,
    crossed: &mut impl FnMut(&mut Signs, f64) -> Result<Option<usize>, Failure>,
) -> Result<Option<(f64, f64, usize)>, Failure> {
    // Values at the begin of what is left stand in one place, those between in the next, those at ends behind them.
    const BEGIN: usize = PARTS + 1;
    const MIDDLE: usize = BEGIN + 1;
    const FIRST: usize = MIDDLE + 1;
    let mut before = begin;
    let mut ends = [0.0; INSIDE];
    signs.keep_as(part - 1, BEGIN);
    signs.keep_as(part, FIRST);
    let mut open = FIRST;
    ends[open] = end;
    while open >= FIRST {
        let middle = before + 0.5 * (ends[open] - before);
        let inside = middle > before && middle < ends[open] && *looks < MOST_LOOKS;
        if inside {
            *looks += 1;
            if let Some(found) = crossed(signs, middle)? {
                return Ok(Some((before, middle, found)));
            }
            signs.keep(MIDDLE);
        }
        if inside && open + 1 < INSIDE && signs.may_hide(BEGIN, MIDDLE, open) {
            open += 1;
            signs.keep_as(MIDDLE, open);
            ends[open] = middle;
        } else {
            before = ends[open];
            signs.keep_as(open, BEGIN);
            open -= 1;
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
        // That it is zero somewhere here is certain, and where is told to rounding.
        signs.sharpen(found);
        match crossed(signs, middle)? {
            None => before = middle,
            there => (after, found) = (middle, there),
        }
    }
    signs.sharpen(None);
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
