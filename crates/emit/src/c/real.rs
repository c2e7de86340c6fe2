//! How real numbers of either size are written in C: types, literals, names of functions and of what the library defines.

use crate::Real;

/// Functions of the library and ours that there are for either size: those for floats end with `f`.
const FUNCTIONS: [&str; 29] = [
    "sqrt",
    "fabs",
    "floor",
    "round",
    "copysign",
    "ha_sin",
    "ha_cos",
    "ha_tan",
    "ha_turn",
    "ha_asin",
    "ha_acos",
    "ha_atan",
    "ha_atan2",
    "ha_exp",
    "ha_log",
    "ha_log2",
    "ha_log10",
    "ha_pow",
    "ha_sinh",
    "ha_cosh",
    "ha_tanh",
    "ha_sign",
    "ha_min",
    "ha_max",
    "ha_finite",
    "ha_along",
    "ha_pow_along",
    "ha_powi",
    "ha_mod",
];

impl Real {
    /// Its type in C.
    pub(super) fn kind(self) -> &'static str {
        self.name()
    }

    /// A number as C reads it back to the bit, or to the nearest float.
    pub(super) fn number(self, value: f64) -> String {
        match value {
            v if v.is_nan() => format!("(({})NAN)", self.kind()),
            v if v == f64::INFINITY => self.named("HUGE_VAL").into(),
            v if v == f64::NEG_INFINITY => format!("(-{})", self.named("HUGE_VAL")),
            v if v.is_sign_negative() => format!("({})", self.literal(&format!("{v:?}"))),
            v => self.literal(&format!("{v:?}")),
        }
    }

    /// A number written as for double precision.
    pub(super) fn literal(self, digits: &str) -> String {
        match self {
            Real::Double => digits.to_string(),
            Real::Float => format!("{digits}f"),
        }
    }

    /// Numbers as the lines of a table.
    pub(super) fn numbers(self, values: &[f64]) -> String {
        let row = |row: &[f64]| format!("    {}", row.iter().map(|&v| self.number(v)).collect::<Vec<_>>().join(", "));
        match values {
            [] => format!("    {}", self.number(0.0)),
            values => values.chunks(4).map(row).collect::<Vec<_>>().join(",\n"),
        }
    }

    /// The function that is called `name` for doubles; one that there is only once has its own name.
    pub(super) fn function(self, name: &str) -> String {
        match self == Real::Float && FUNCTIONS.contains(&name) {
            true => format!("{name}f"),
            false => name.to_string(),
        }
    }

    /// What the library defines of real numbers.
    pub(super) fn named(self, of_double: &str) -> &str {
        match (self, of_double) {
            (Real::Float, "DBL_EPSILON") => "FLT_EPSILON",
            (Real::Float, "DBL_MIN") => "FLT_MIN",
            (Real::Float, "HUGE_VAL") => "HUGE_VALF",
            _ => of_double,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_names_are_of_their_size() {
        let of = |real: Real| [1.0, -1e-9, f64::NEG_INFINITY, f64::NAN].map(|v| real.number(v));
        assert_eq!(of(Real::Double), ["1.0", "(-1e-9)", "(-HUGE_VAL)", "((double)NAN)"]);
        assert_eq!(of(Real::Float), ["1.0f", "(-1e-9f)", "(-HUGE_VALF)", "((float)NAN)"]);
        assert_eq!(["fabs", "ha_max", "ha_fail"].map(|f| Real::Float.function(f)), ["fabsf", "ha_maxf", "ha_fail"]);
        assert_eq!(Real::Double.function("ha_max"), "ha_max");
    }
}
