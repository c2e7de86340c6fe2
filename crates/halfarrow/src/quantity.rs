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
