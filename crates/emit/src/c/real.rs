//! C text for real numbers of either size.
//!
//! Text is written as for double precision; what stays in it whatever numbers the model has is marked:
//!
//! - `ha_wide` is a type that always has double precision, `ha_real` one that has the precision of the model;
//! - `HA_WIDE(a)` is computed in double precision, with its literals and functions;
//! - `ha_narrow(a)` takes `a`, computed in double precision, to that of the model; `ha_widen(a)` goes the other way.
//!
//! Comments, texts in quotes and lines of the preprocessor stay as they are.

use crate::Real;

/// Functions and numbers of the library, and ours, in single precision.
const NARROW: [(&str, &str); 32] = [
    ("double", "float"),
    ("DBL_EPSILON", "FLT_EPSILON"),
    ("DBL_MIN", "FLT_MIN"),
    ("HUGE_VAL", "HUGE_VALF"),
    ("sqrt", "sqrtf"),
    ("fabs", "fabsf"),
    ("floor", "floorf"),
    ("round", "roundf"),
    ("copysign", "copysignf"),
    ("ha_sin", "ha_sinf"),
    ("ha_cos", "ha_cosf"),
    ("ha_tan", "ha_tanf"),
    ("ha_turn", "ha_turnf"),
    ("ha_asin", "ha_asinf"),
    ("ha_acos", "ha_acosf"),
    ("ha_atan", "ha_atanf"),
    ("ha_atan2", "ha_atan2f"),
    ("ha_exp", "ha_expf"),
    ("ha_log", "ha_logf"),
    ("ha_log2", "ha_log2f"),
    ("ha_log10", "ha_log10f"),
    ("ha_pow", "ha_powf"),
    ("ha_sinh", "ha_sinhf"),
    ("ha_cosh", "ha_coshf"),
    ("ha_tanh", "ha_tanhf"),
    ("ha_sign", "ha_signf"),
    ("ha_min", "ha_minf"),
    ("ha_max", "ha_maxf"),
    ("ha_finite", "ha_finitef"),
    ("ha_along", "ha_alongf"),
    ("ha_pow_along", "ha_pow_alongf"),
    ("ha_real", "float"),
];

/// A text as it is for a size of real numbers.
pub(super) fn of(text: &str, real: Real) -> String {
    rewrite(text, real, false)
}

/// A text in double precision throughout, but for what is marked.
pub(super) fn wide(text: &str, real: Real) -> String {
    rewrite(text, real, true)
}

/// The same calculus as the text, of which `wide` says whether it is in double precision.
fn rewrite(text: &str, real: Real, wide: bool) -> String {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(piece) = next(rest, out.is_empty() || out.ends_with('\n')) {
        rest = &rest[piece.len()..];
        let group = matches!(piece, "HA_WIDE" | "ha_narrow" | "ha_widen").then(|| group(rest)).flatten();
        match group {
            Some(inner) => {
                rest = &rest[inner.len() + 2..];
                let inside = rewrite(inner, real, piece != "ha_widen");
                let cast = match (piece, real) {
                    ("HA_WIDE", _) | (_, Real::Double) => "",
                    ("ha_narrow", Real::Float) => "(float)",
                    _ => "(double)",
                };
                let alone =
                    cast.is_empty() && (out.ends_with("= ") || out.ends_with("return ")) && rest.starts_with(';');
                let braces = !(alone || is_one(&inside));
                out += cast;
                out += &if braces { format!("({inside})") } else { inside };
            }
            None => out += &word(piece, real, wide),
        }
    }
    out
}

/// A word or a number.
fn word(piece: &str, real: Real, wide: bool) -> String {
    let always = match (piece, real) {
        ("ha_wide", _) => Some("double"),
        ("ha_real", Real::Double) => Some("double"),
        _ => None,
    };
    if let Some(always) = always {
        return always.to_string();
    }
    if real == Real::Double || (wide && piece != "ha_real") {
        return piece.to_string();
    }
    if let Some((_, narrow)) = NARROW.iter().find(|(name, _)| *name == piece) {
        return narrow.to_string();
    }
    let digits = piece.starts_with(|c: char| c.is_ascii_digit());
    match digits && !piece.starts_with("0x") && piece.contains(['.', 'e']) {
        true => format!("{piece}f"),
        false => piece.to_string(),
    }
}

/// The next word, number, comment, text in quotes, line of the preprocessor, or other character.
fn next(text: &str, line_begins: bool) -> Option<&str> {
    let first = text.chars().next()?;
    let up_to = |end: Option<usize>| &text[..end.unwrap_or(text.len())];
    let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    Some(match first {
        '#' if line_begins => up_to(text.find('\n')),
        '/' if text.starts_with("/*") => up_to(text.find("*/").map(|at| at + 2)),
        '"' => {
            let mut escaped = false;
            let end = text.char_indices().skip(1).find(|&(_, c)| {
                let ends = c == '"' && !escaped;
                escaped = c == '\\' && !escaped;
                ends
            });
            up_to(end.map(|(at, _)| at + 1))
        }
        c if c.is_ascii_digit() => {
            let mut before = ' ';
            up_to(text.find(|c: char| {
                let inside = is_word(c) || c == '.' || (matches!(c, '+' | '-') && matches!(before, 'e' | 'E'));
                before = c;
                !inside
            }))
        }
        c if is_word(c) => up_to(text.find(|c: char| !is_word(c))),
        c => &text[..c.len_utf8()],
    })
}

/// What stands in the brackets with which a text begins.
fn group(text: &str) -> Option<&str> {
    let mut depth = 0;
    for (at, c) in text.char_indices() {
        match c {
            '(' => depth += 1,
            ')' => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return (at > 0).then(|| &text[1..at]);
        }
    }
    None
}

/// Whether an expression needs no brackets beside an operator or behind a cast.
fn is_one(text: &str) -> bool {
    let mut depth = 0;
    let plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '.' | '[' | ']' | '>');
    text.chars().zip(text.chars().skip(1).chain(" ".chars())).all(|(c, after)| {
        match c {
            '(' | '[' => depth += 1,
            ')' | ']' => depth -= 1,
            _ => {}
        }
        depth > 0 || plain(c) || c == ')' || (c == '-' && after == '>')
    }) && !text.starts_with('(')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_marked_stays_wide() {
        let text = "#define A 1.0\nconst double a = 1e-9 * fabs(b); /* 1.0 */\nha_wide t = HA_WIDE(t0 + 2.5 * h);\n\
                    x = ha_narrow(t - 1.0) * 3; y = ha_widen(m->p[2]) + HA_WIDE(fabs(t)) + ha_narrow(v12); s = \"1.0\\\"2.0\"; i[1];\n";
        assert_eq!(
            of(text, Real::Double),
            "#define A 1.0\nconst double a = 1e-9 * fabs(b); /* 1.0 */\ndouble t = t0 + 2.5 * h;\n\
             x = (t - 1.0) * 3; y = m->p[2] + fabs(t) + v12; s = \"1.0\\\"2.0\"; i[1];\n"
        );
        assert_eq!(
            of(text, Real::Float),
            "#define A 1.0\nconst float a = 1e-9f * fabsf(b); /* 1.0 */\ndouble t = t0 + 2.5 * h;\n\
             x = (float)(t - 1.0) * 3; y = (double)m->p[2] + fabs(t) + (float)v12; s = \"1.0\\\"2.0\"; i[1];\n"
        );
        assert_eq!(
            wide("double a = 1.0; ha_real b = ha_narrow(a);", Real::Float),
            "double a = 1.0; float b = (float)a;"
        );
    }
}
