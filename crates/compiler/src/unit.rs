//! Units: what their text means, exactly.
//!
//! Torque times angular velocity is a power, so an angle has no dimension here: a radian is remembered beside the
//! dimension (`angle`) and never decides whether two units fit.

mod dimension;
mod read;
mod table;

pub use dimension::{Dimension, Domain, WHOLE};

use crate::algebra::math;
use crate::diagnostic::{Diagnostic, codes};
use crate::span::Span;
use dashu_ratio::RBig;
use std::sync::Arc;

/// A unit: its dimension and the way from numbers in it to numbers in SI base units.
///
/// A number `x` in this unit is `(x * rational + offset) * pi^pi` in SI, where only temperatures alone (`degC`) have an
/// offset; a `degC` within a compound is a difference, a kelvin.
///
/// ```
/// use halfarrow_compiler::unit::{Dimension, Unit};
/// let stiffness = Unit::parse("kN/m").unwrap();
/// assert_eq!(stiffness.to_si_f64(18.0), 18000.0);
/// assert_eq!(stiffness.dimension, Unit::parse("J/m2").unwrap().dimension);
/// let power = Unit::parse("N.m").unwrap().dimension.times(Unit::parse("rpm").unwrap().dimension);
/// assert_eq!(power, Dimension::WATT);
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unit(Arc<Scale>);

/// What there is to know of a [`Unit`]: its fields.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Scale {
    /// Exponents of the base units.
    pub dimension: Dimension,
    /// Exponent of the radian, in sixtieths: 60 for `rad/s` and `rpm`, -60 for `N.m/rad`, 0 for `1/s`.
    pub angle: i32,
    /// The rational part of the factor to SI.
    pub rational: RBig,
    /// The power of pi in the factor to SI: 1 for `deg`, `rev` and `rpm`.
    pub pi: i32,
    /// What is added in SI units, for temperatures: 273.15 for `degC`.
    pub offset: RBig,
    text: String,
}

/// Why a text is no unit. Places are bytes in the text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum UnitError {
    /// There is no such unit.
    Unknown {
        /// Where the symbol stands.
        at: std::ops::Range<usize>,
        /// The symbol, without exponent.
        symbol: String,
        /// What may be meant.
        nearest: Option<String>,
    },
    /// Something other than a symbol, an exponent, `.`, `*` or `/` was found.
    Unreadable {
        /// Where.
        at: std::ops::Range<usize>,
    },
    /// `J/kg.K`, which some read as `J/(kg.K)` and some as `(J/kg).K`.
    Ambiguous {
        /// Where the product after the quotient stands.
        at: std::ops::Range<usize>,
    },
    /// A fractional power of a multiple, such as `mm^0.5`: its factor to SI is not exact.
    Root {
        /// Where.
        at: std::ops::Range<usize>,
    },
    /// An exponent that is absurd, or no multiple of 1/60.
    Exponent {
        /// Where.
        at: std::ops::Range<usize>,
    },
}

impl Unit {
    /// The unit that a text stands for.
    ///
    /// ```
    /// use halfarrow_compiler::unit::{Unit, UnitError};
    /// assert_eq!(Unit::parse("N.s3/m3").unwrap().to_string(), "N.s3/m3");
    /// assert!(matches!(Unit::parse("kNm"), Err(UnitError::Unknown { nearest: Some(n), .. }) if n == "kN.m"));
    /// ```
    pub fn parse(text: &str) -> Result<Unit, UnitError> {
        read::unit(text)
    }

    /// The unit 1.
    pub fn one() -> Unit {
        Unit::si(Dimension::NONE)
    }

    /// The SI unit of a dimension, under its usual name.
    pub fn si(dimension: Dimension) -> Unit {
        let text = dimension.to_string();
        Scale { dimension, angle: 0, rational: RBig::ONE, pi: 0, offset: RBig::ZERO, text }.into()
    }

    /// The SI unit with the dimension and the angle of this one: `rad/s` for `rpm`, `m` for `mm`.
    pub fn to_si_unit(&self) -> Unit {
        let text = dimension::with_angle(self.dimension, self.angle);
        Scale { angle: self.angle, text, ..Scale::clone(&Unit::si(self.dimension)) }.into()
    }

    /// Whether numbers in this unit are SI numbers.
    pub fn is_si(&self) -> bool {
        self.rational.is_one() && self.pi == 0 && self.offset.is_zero()
    }

    /// The exact SI value of a number in this unit, as a rational to be multiplied by `pi^self.pi`.
    pub fn to_si(&self, value: &RBig) -> RBig {
        value * &self.rational + &self.offset
    }

    /// The SI value of a number in this unit, to rounding.
    pub fn to_si_f64(&self, value: f64) -> f64 {
        match RBig::try_from(value) {
            Ok(exact) => float(&self.to_si(&exact)) * math::whole_power(std::f64::consts::PI, self.pi.into()),
            Err(_) => value,
        }
    }

    /// The number in this unit of an SI value, to rounding.
    pub fn from_si_f64(&self, si: f64) -> f64 {
        match RBig::try_from(si / math::whole_power(std::f64::consts::PI, self.pi.into())) {
            Ok(exact) => float(&((exact - &self.offset) / &self.rational)),
            Err(_) => si,
        }
    }

    /// The first symbol, without exponent.
    pub fn first_symbol(text: &str) -> &str {
        read::first_symbol(text)
    }
}

fn float(value: &RBig) -> f64 {
    value.to_f64().value()
}

impl std::ops::Deref for Unit {
    type Target = Scale;
    fn deref(&self) -> &Scale {
        &self.0
    }
}

impl From<Scale> for Unit {
    fn from(scale: Scale) -> Unit {
        Unit(Arc::new(scale))
    }
}

impl std::fmt::Display for Unit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.text)
    }
}

impl UnitError {
    /// The fault as it is told, for a unit that stands at `span`.
    pub fn at(&self, span: Span) -> Diagnostic {
        let (code, range, title, label) = match self {
            UnitError::Unknown { at, symbol, .. } => (codes::U001, at, format!("there is no unit `{symbol}`"), ""),
            UnitError::Unreadable { at } => (codes::U002, at, "this unit cannot be read".to_owned(), "from here on"),
            UnitError::Ambiguous { at } => (
                codes::U002,
                at,
                "a product after `/` in a unit can be read in two ways".to_owned(),
                "above or below the line?",
            ),
            UnitError::Root { at } => (codes::U002, at, "a root of a multiple of a unit is not exact".to_owned(), ""),
            UnitError::Exponent { at } => (codes::U002, at, "this exponent of a unit is not usable".to_owned(), ""),
        };
        let clamp = |n: usize| (span.start + n as u32).min(span.end);
        let place = Span { start: clamp(range.start), end: clamp(range.end), ..span };
        let fault = Diagnostic::error(code, title, place, label);
        match self.hint() {
            Some(hint) => fault.hint(hint),
            None => fault,
        }
    }

    fn hint(&self) -> Option<String> {
        Some(match self {
            UnitError::Unknown { nearest, .. } => format!("did you mean `{}`?", nearest.as_ref()?),
            UnitError::Unreadable { .. } => {
                "units look like `kN/m`, `N.s3/m3`, `kg.m2`, `m^0.5`, `J/(kg.K)`".to_owned()
            }
            UnitError::Ambiguous { .. } => {
                "put the product below the line into parentheses, as in `J/(kg.K)`".to_owned()
            }
            UnitError::Root { .. } => "use units without prefixes there, as in `m^0.5`".to_owned(),
            UnitError::Exponent { .. } => "exponents are small numbers such as 2, -1 or 0.5".to_owned(),
        })
    }
}

/// The integer as an exact rational.
fn whole(n: i64) -> RBig {
    RBig::from(n)
}

/// A whole power, of a base other than 0 where it is below 0.
fn whole_power(base: &RBig, exponent: i32) -> RBig {
    let power = base.pow(exponent.unsigned_abs() as usize);
    if exponent < 0 { RBig::ONE / power } else { power }
}

#[cfg(test)]
mod tests;
