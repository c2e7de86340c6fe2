//! Values and derivatives of single steps as C expressions.

use std::fmt::Write;

use halfarrow_compiler::algebra::Function;

use super::ssa::Act;
use super::write::number;

/// A whole power by repeated squaring, in the order of `math::powi`; gives the expression of the result.
pub(super) fn power(text: &mut String, (name, wide): (&str, bool), a: &str, n: u32) -> String {
    if n == 0 {
        return "1.0".into();
    }
    let kind = if wide { "ha_wide" } else { "double" };
    let (mut result, mut square, mut left, mut at) = (None::<String>, a.to_string(), n, 0);
    loop {
        if left & 1 == 1 {
            result = Some(match result {
                None => square.clone(),
                Some(before) if left == 1 => return format!("{before} * {square}"),
                Some(before) => {
                    let _ = writeln!(text, "    const {kind} {name}_r{at} = {before} * {square};");
                    format!("{name}_r{at}")
                }
            });
        }
        left >>= 1;
        if left == 0 {
            return result.unwrap_or_else(|| "1.0".into());
        }
        at += 1;
        let _ = writeln!(text, "    const {kind} {name}_s{at} = {square} * {square};");
        square = format!("{name}_s{at}");
    }
}

/// A function of one argument.
pub(super) fn call(f: Function, a: &str) -> String {
    match f {
        Function::Sqrt => format!("sqrt({a})"),
        Function::Abs => format!("fabs({a})"),
        Function::Floor => format!("floor({a})"),
        f => format!("ha_{}({a})", f.name()),
    }
}

/// The derivative of a plain step.
pub(super) fn rate_of(act: Act, a: &[String], d: &[Option<String>], value: &str) -> Option<String> {
    let along = |slope: &str, rate: &Option<String>| rate.as_ref().map(|r| format!("ha_along({slope}, {r})"));
    let zero = |rate: &Option<String>| rate.clone().unwrap_or_else(|| "0.0".into());
    let sum = |one: Option<String>, other: Option<String>| match (one, other) {
        (Some(one), Some(other)) => Some(format!("{one} + {other}")),
        (one, other) => one.or(other),
    };
    match act {
        Act::Neg => d[0].as_ref().map(|d| format!("-{d}")),
        Act::Add => sum(d[0].clone(), d[1].clone()),
        Act::Sub => match (&d[0], &d[1]) {
            (Some(one), Some(other)) => Some(format!("{one} - {other}")),
            (Some(one), None) => Some(one.clone()),
            (None, other) => other.as_ref().map(|other| format!("-{other}")),
        },
        Act::Mul => sum(along(&a[1], &d[0]), along(&a[0], &d[1])),
        Act::Div => Some(match (&d[0], along(value, &d[1])) {
            (Some(one), Some(other)) => format!("({one} - {other}) / {}", a[1]),
            (Some(one), None) => format!("{one} / {}", a[1]),
            (None, other) => format!("(0.0 - {}) / {}", other?, a[1]),
        }),
        Act::Pow => Some(format!("ha_pow_along({value}, {}, {}, {}, {})", a[0], zero(&d[0]), a[1], zero(&d[1]))),
        Act::Call(f) => along(&slope(f, &a[0], value)?, &d[0]),
        Act::Call2(f) => {
            let (x, y, dx, dy) = (&a[0], &a[1], zero(&d[0]), zero(&d[1]));
            Some(match f {
                Function::Atan2 => format!("({y} * {dx} - {x} * {dy}) / ({x} * {x} + {y} * {y})"),
                Function::Min => format!("{x} < {y} ? {dx} : {dy}"),
                Function::Max => format!("{x} > {y} ? {dx} : {dy}"),
                _ => format!("{dx} - {dy} * floor({x} / {y})"),
            })
        }
        Act::Select => Some(format!("{} != 0.0 ? {} : {}", a[0], zero(&d[1]), zero(&d[2]))),
        _ => None,
    }
}

fn slope(f: Function, a: &str, value: &str) -> Option<String> {
    use Function::*;
    Some(match f {
        Sin => format!("ha_cos({a})"),
        Cos => format!("-ha_sin({a})"),
        Tan => format!("1.0 + {value} * {value}"),
        Asin => format!("1.0 / sqrt(1.0 - {a} * {a})"),
        Acos => format!("-1.0 / sqrt(1.0 - {a} * {a})"),
        Atan => format!("1.0 / (1.0 + {a} * {a})"),
        Exp => value.to_string(),
        Log => format!("1.0 / {a}"),
        Log10 => format!("1.0 / ({a} * {})", number(std::f64::consts::LN_10)),
        Sqrt => format!("0.5 / {value}"),
        Abs => format!("ha_sign({a})"),
        Sinh => format!("ha_cosh({a})"),
        Cosh => format!("ha_sinh({a})"),
        Tanh => format!("1.0 - {value} * {value}"),
        Sign | Floor | Atan2 | Min | Max | Mod => return None,
    })
}
