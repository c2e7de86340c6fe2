//! Numbers with units, as options give them.

use halfarrow_compiler::unit::Unit;

/// A frequency in Hz from text such as `1kHz`, `500 Hz` or `500`; `None` if it is none.
///
/// ```
/// assert_eq!(halfarrow::frequency("1kHz"), Some(1000.0));
/// assert_eq!(halfarrow::frequency("2.5"), Some(2.5));
/// assert_eq!(halfarrow::frequency("3 m"), None);
/// ```
pub fn frequency(text: &str) -> Option<f64> {
    number_in(text, "Hz")
}

/// A time in s from text such as `10ms`, `2 min` or `0.5`; `None` if it is none.
///
/// ```
/// assert_eq!(halfarrow::duration("10ms"), Some(0.01));
/// assert_eq!(halfarrow::duration("1e-3"), Some(1e-3));
/// assert_eq!(halfarrow::duration("3 m"), None);
/// ```
pub fn duration(text: &str) -> Option<f64> {
    number_in(text, "s")
}

/// A number in SI units from text such as `20 kN/m` or `3`; what it measures is told by `unit`.
pub(crate) fn quantity(text: &str, unit: Option<&Unit>) -> Result<f64, String> {
    let (number, own) = number_and_unit(text).ok_or("write a number, or a number and a unit, as in `20 kN/m`")?;
    match (own, unit) {
        (None, _) => Ok(number),
        (Some(own), Some(unit)) if own.dimension != unit.dimension => {
            Err(format!("it measures something else than {unit}, which is the unit of the parameter"))
        }
        (Some(own), _) => Ok(own.to_si_f64(number)),
    }
}

/// A number, and the unit behind it if there is one.
pub(crate) fn number_and_unit(text: &str) -> Option<(f64, Option<Unit>)> {
    let text = text.trim();
    if let Ok(value) = text.parse() {
        return Some((value, None));
    }
    // The longest beginning that is a number, so that `2e3` is not taken for 2 of a unit `e3`.
    let ends = text.char_indices().map(|(i, _)| i).rev().find(|&i| text[..i].trim().parse::<f64>().is_ok())?;
    let unit = Unit::parse(text[ends..].trim()).ok()?;
    Some((text[..ends].trim().parse().ok()?, Some(unit)))
}

/// A number with a unit of that dimension, or in `si` if none is written.
fn number_in(text: &str, si: &str) -> Option<f64> {
    let text = text.trim();
    let end = text.find(|c: char| c.is_alphabetic() && c != 'e' && c != 'E').unwrap_or(text.len());
    let number: f64 = text[..end].trim().parse().ok()?;
    let unit = text[end..].trim();
    if unit.is_empty() {
        return Some(number);
    }
    let unit = Unit::parse(unit).ok()?;
    (unit.dimension == Unit::parse(si).ok()?.dimension).then(|| unit.to_si_f64(number))
}
