//! Reading the text of a unit.

use super::table::{PREFIXES, SYMBOLS, Symbol, sixtieths};
use super::*;
use dashu_base::BitTest;
use dashu_int::IBig;
use std::ops::Range;

/// Exponents beyond this are absurd.
const MAX_EXPONENT: i32 = 100;

/// A factor of a unit, to be multiplied up.
struct Factor {
    dimension: Dimension,
    angle: i32,
    rational: RBig,
    pi: i32,
}

pub(super) fn unit(text: &str) -> Result<Unit, UnitError> {
    let mut reader = Reader { text, pos: 0 };
    let product = reader.product(false)?;
    if reader.pos < text.len() {
        return Err(reader.unreadable());
    }
    let offset = match SYMBOLS.iter().find(|s| s.name == text) {
        Some(symbol) => number(symbol.offset),
        None => RBig::ZERO,
    };
    let Factor { dimension, angle, rational, pi } = product;
    Ok(Scale { dimension, angle, rational, pi, offset, text: text.to_owned() }.into())
}

pub(super) fn first_symbol(text: &str) -> &str {
    let mut reader = Reader { text, pos: 0 };
    reader.eat("1/");
    let start = reader.pos;
    reader.letters();
    &text[start..reader.pos]
}

struct Reader<'t> {
    text: &'t str,
    pos: usize,
}

impl<'t> Reader<'t> {
    fn rest(&self) -> &'t str {
        &self.text[self.pos..]
    }

    fn eat(&mut self, what: &str) -> bool {
        let found = self.rest().starts_with(what);
        if found {
            self.pos += what.len();
        }
        found
    }

    fn take(&mut self, fits: impl Fn(char) -> bool) -> Range<usize> {
        let start = self.pos;
        self.pos += self.rest().find(|c| !fits(c)).unwrap_or(self.rest().len());
        start..self.pos
    }

    /// The letters of a symbol, which has no digits.
    fn letters(&mut self) -> Range<usize> {
        if self.eat("%") {
            return self.pos - 1..self.pos;
        }
        let sign = self.pos;
        self.eat("°");
        let letters = self.take(|c| c.is_alphabetic() || c == '_');
        sign..letters.end
    }

    fn unreadable(&self) -> UnitError {
        UnitError::Unreadable { at: self.pos..self.text.len() }
    }

    /// Factors joined by `.`, `*`, `·` and `/`; `inside` parentheses.
    fn product(&mut self, inside: bool) -> Result<Factor, UnitError> {
        let mut product = self.first(inside)?;
        let mut divided = false;
        loop {
            let start = self.pos;
            let times = [".", "*", "·", "⋅"].iter().any(|sign| self.eat(sign));
            if times && divided {
                return Err(UnitError::Ambiguous { at: start..self.text.len() });
            }
            let over = !times && self.eat("/");
            if !times && !over {
                return Ok(product);
            }
            divided |= over;
            let factor = self.factor(inside)?;
            product.multiply(factor, if over { -1 } else { 1 }).ok_or(UnitError::Exponent { at: start..self.pos })?;
        }
    }

    /// The first factor, which may be the 1 of `1/s`.
    fn first(&mut self, inside: bool) -> Result<Factor, UnitError> {
        let one = self.rest() == "1" || self.rest().starts_with("1/");
        if one {
            self.pos += 1;
            return Ok(Factor::one());
        }
        self.factor(inside)
    }

    fn factor(&mut self, inside: bool) -> Result<Factor, UnitError> {
        let start = self.pos;
        if !inside && self.eat("(") {
            let group = self.product(true)?;
            return if self.eat(")") { Ok(group) } else { Err(self.unreadable()) };
        }
        let letters = self.letters();
        if letters.is_empty() {
            return Err(self.unreadable());
        }
        let base = symbol(&self.text[letters.clone()]).ok_or_else(|| self.unknown(letters))?;
        let exponent = self.exponent(start)?;
        base.power(exponent).map_err(|root| {
            let at = start..self.pos;
            if root { UnitError::Root { at } } else { UnitError::Exponent { at } }
        })
    }

    fn unknown(&self, at: Range<usize>) -> UnitError {
        let symbol = self.text[at.clone()].to_owned();
        let nearest = nearest(&symbol);
        UnitError::Unknown { at, symbol, nearest }
    }

    /// `2`, `^2`, `^-0.5`, `^(1/2)`, `²`, in sixtieths; 60 if there is none.
    fn exponent(&mut self, start: usize) -> Result<i32, UnitError> {
        let raised = self.eat("^");
        let text = if raised && self.eat("(") {
            let range = self.take(|c| c != ')');
            if !self.eat(")") {
                return Err(self.unreadable());
            }
            self.text[range].to_owned()
        } else if raised {
            let sign = if self.eat("-") { "-" } else { "" };
            let whole = self.take(|c| c.is_ascii_digit());
            let mut text = format!("{sign}{}", &self.text[whole]);
            if self.rest().strip_prefix('.').is_some_and(|r| r.starts_with(|c: char| c.is_ascii_digit())) {
                self.pos += 1;
                let part = self.take(|c| c.is_ascii_digit());
                text = format!("{text}.{}", &self.text[part]);
            }
            text
        } else {
            let range = self.take(|c| c.is_ascii_digit() || superscript(c).is_some());
            self.text[range].chars().map(|c| superscript(c).unwrap_or(c)).collect()
        };
        if text.is_empty() && !raised {
            return Ok(WHOLE);
        }
        let at = start..self.pos;
        to_sixtieths(&text).ok_or(UnitError::Exponent { at })
    }
}

fn superscript(c: char) -> Option<char> {
    let digit = "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().position(|s| s == c);
    match digit {
        Some(n) => char::from_digit(n as u32, 10),
        None => (c == '⁻').then_some('-'),
    }
}

/// An exponent such as `-2`, `0.5` or `1/2` in sixtieths.
fn to_sixtieths(text: &str) -> Option<i32> {
    let (negative, size) = match text.strip_prefix('-') {
        Some(size) => (true, size),
        None => (false, text),
    };
    let plain = size.len() <= 12 && size.bytes().all(|b| b.is_ascii_digit() || b == b'.' || b == b'/');
    let value = if plain { checked_number(size)? } else { return None };
    let sixtieths = value * whole(i64::from(WHOLE));
    if !sixtieths.is_int() || sixtieths > whole(i64::from(MAX_EXPONENT * WHOLE)) {
        return None;
    }
    let n = i32::try_from(sixtieths.numerator()).ok()?;
    Some(if negative { -n } else { n })
}

impl Factor {
    fn one() -> Factor {
        Factor { dimension: Dimension::NONE, angle: 0, rational: RBig::ONE, pi: 0 }
    }

    /// The power with an exponent in sixtieths; `Err(true)` if a root is not exact, `Err(false)` if it is absurd.
    fn power(self, sixtieths: i32) -> Result<Factor, bool> {
        if sixtieths == WHOLE {
            return Ok(self);
        }
        let dimension = self.dimension.power(sixtieths).ok_or(false)?;
        let angle = Dimension([self.angle, 0, 0, 0, 0, 0, 0]).power(sixtieths).ok_or(false)?.0[0];
        let plain = self.rational.is_one() && self.pi == 0;
        let (rational, pi) = match sixtieths % WHOLE {
            0 => (whole_power(&self.rational, sixtieths / WHOLE), self.pi * (sixtieths / WHOLE)),
            _ if plain => (self.rational, 0),
            _ => return Err(true),
        };
        Ok(Factor { dimension, angle, rational, pi })
    }

    /// Multiplies by `factor` or, with `sign` -1, by one over it. `None` if that gets absurd.
    fn multiply(&mut self, factor: Factor, sign: i32) -> Option<()> {
        let factor = factor.power(sign * WHOLE).ok()?;
        self.dimension = self.dimension.times(factor.dimension);
        self.angle = self.angle.checked_add(factor.angle)?;
        self.rational *= factor.rational;
        self.pi = self.pi.checked_add(factor.pi)?;
        let exponents = self.dimension.0.iter().all(|e| e.abs() <= MAX_EXPONENT * WHOLE);
        let size = self.rational.numerator().bit_len() + self.rational.denominator().bit_len();
        (exponents && size < 4000).then_some(())
    }
}

/// A symbol with or without a prefix.
fn symbol(text: &str) -> Option<Factor> {
    if let Some(symbol) = SYMBOLS.iter().find(|s| s.name == text) {
        return Some(scaled(symbol, 0));
    }
    PREFIXES.iter().find_map(|(prefix, power)| {
        let symbol = SYMBOLS.iter().find(|s| Some(s.name) == text.strip_prefix(prefix))?;
        let letter = if *power == -6 { "u" } else { prefix };
        symbol.prefixes.contains(letter).then(|| scaled(symbol, *power))
    })
}

fn scaled(symbol: &Symbol, power: i32) -> Factor {
    let (exponents, angle) = sixtieths(symbol);
    let rational = number(symbol.factor) * whole_power(&whole(10), power);
    Factor { dimension: Dimension(exponents), angle, rational, pi: symbol.pi }
}

/// A number of the table.
fn number(text: &str) -> RBig {
    checked_number(text).expect("the numbers of the table can be read")
}

/// A decimal, or two with a `/` between them.
fn checked_number(text: &str) -> Option<RBig> {
    match text.split_once('/') {
        Some((over, under)) => {
            let under = decimal(under)?;
            if under.is_zero() { None } else { Some(decimal(over)? / under) }
        }
        None => decimal(text),
    }
}

fn decimal(text: &str) -> Option<RBig> {
    let (mantissa, exponent) = text.split_once('e').unwrap_or((text, "0"));
    let (before, after) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    let digits = IBig::from_str_radix(&format!("{before}{after}"), 10).ok()?;
    let exponent = exponent.parse::<i32>().ok()? - i32::try_from(after.len()).ok()?;
    Some(RBig::from(digits) * whole_power(&whole(10), exponent))
}

/// What may be meant by a symbol that is not known: two known ones without their dot, other case, or a misspelling.
fn nearest(text: &str) -> Option<String> {
    let splits = text.char_indices().skip(1).map(|(i, _)| text.split_at(i));
    let parts = splits.filter(|(a, b)| symbol(a).is_some() && symbol(b).is_some()).last();
    if let Some((a, b)) = parts {
        return Some(format!("{a}.{b}"));
    }
    let words =
        [("sec", "s"), ("Newton", "N"), ("hour", "h"), ("degree", "deg"), ("percent", "%"), ("Celsius", "degC")];
    if let Some((_, unit)) = words.iter().find(|(word, _)| text.to_lowercase().starts_with(&word.to_lowercase())) {
        return Some((*unit).to_owned());
    }
    let known = SYMBOLS.iter().flat_map(|s| {
        let prefixed = s.prefixes.chars().map(move |p| format!("{p}{}", s.name));
        std::iter::once(s.name.to_owned()).chain(prefixed)
    });
    let known: Vec<String> = known.filter(|k| text.chars().count() > 1 || k.eq_ignore_ascii_case(text)).collect();
    crate::diagnostic::nearest(text, known.iter().map(String::as_str)).map(str::to_owned)
}
