//! Numbers as people write them.

use super::super::rational::Rational;
use dashu_base::UnsignedAbs;
use dashu_int::{IBig, UBig};

/// Digits of a decimal that stands for a number exactly: more than a float has.
const MOST: usize = 17;
/// Digits in texts for people of a number that no decimal is exactly.
const ROUNDED: usize = 5;

/// The digits and the power of ten of a number of 0 or more: `digits * 10^exponent`, no zeros at the end. `None` if it is
/// a fraction of integers that are shorter than a decimal, and no decimal of at most 17 digits. Of longer ones the digits of
/// the nearest float, with which is computed, or where it is `rounded` for people the first few of them.
pub(super) fn decimal(value: &Rational, rounded: bool) -> Option<(String, i32)> {
    let of_text = |text: &str| Rational::from_decimal(text).and_then(|v| exact_decimal(&v));
    exact_decimal(value).or_else(|| {
        let float = value.to_f64();
        let short = value.small().is_some_and(|(above, below)| digits(above) + digits(below) <= MOST);
        match Rational::from_f64(float).as_ref() == Some(value) {
            false if short => None,
            false if rounded => of_text(&format!("{float:.*e}", ROUNDED - 1)),
            _ => of_text(&format!("{float:e}")),
        }
    })
}

fn digits(n: i64) -> usize {
    n.unsigned_abs().checked_ilog10().map_or(1, |log| log as usize + 1)
}

fn exact_decimal(value: &Rational) -> Option<(String, i32)> {
    // A denominator 2^a 5^b is that of a decimal with max(a, b) digits behind the point, and no other is one.
    let below = value.denominator().unsigned_abs();
    let twos = below.trailing_zeros()?;
    let mut rest = below >> twos;
    let fives = rest.remove(&UBig::from(5u8)).unwrap_or(0);
    let power = twos.max(fives);
    if rest != UBig::ONE || power > 340 {
        return None;
    }
    let missing = UBig::from(2u8).pow(power - twos) * UBig::from(5u8).pow(power - fives);
    let above = value.numerator() * IBig::from(missing);
    let digits = above.to_string();
    let kept = digits.trim_end_matches('0');
    let zeros = digits.len() - kept.len();
    if kept.is_empty() {
        return Some(("0".into(), 0));
    }
    let exponent = i32::try_from(zeros).ok()? - i32::try_from(power).ok()?;
    (kept.len() <= MOST).then(|| (kept.to_owned(), exponent))
}

/// A decimal as plain text if that is short, else with a power of ten: the mantissa and the exponent, 0 for none.
pub(super) fn layout(digits: &str, exponent: i32) -> (String, i32) {
    let len = digits.len() as i32;
    let leading = len + exponent;
    if exponent >= 0 && leading <= 9 {
        return (format!("{digits}{}", "0".repeat(exponent as usize)), 0);
    }
    if exponent < 0 && leading > 0 {
        let (whole, part) = digits.split_at(leading as usize);
        return (format!("{whole}.{part}"), 0);
    }
    if exponent < 0 && leading > -3 {
        return (format!("0.{}{digits}", "0".repeat(-leading as usize)), 0);
    }
    let (whole, part) = digits.split_at(1);
    (if part.is_empty() { whole.to_owned() } else { format!("{whole}.{part}") }, leading - 1)
}
