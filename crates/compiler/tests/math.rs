//! Elementary functions: their errors against 320 bits, special values, and the same bits in lanes and in C.

#[path = "math/reference.rs"]
mod reference;

use halfarrow_compiler::algebra::{Function, math};
use reference::{Kernel, points};
use std::collections::BTreeSet;
use std::io::Write;
use std::process::{Command, Stdio};

use Function::*;

/// What the C program calls by number.
fn kernels() -> Vec<Kernel> {
    let one = [Sin, Cos, Tan, Asin, Acos, Atan, Exp, Log, Log10, Sqrt, Abs, Sign, Sinh, Cosh, Tanh, Floor];
    let two = [Atan2, Min, Max, Mod];
    one.map(Kernel::One).into_iter().chain(two.map(Kernel::Two)).chain([Kernel::Log2, Kernel::Power]).collect()
}

fn same(a: f64, b: f64) -> bool {
    a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan()
}

#[test]
fn errors_stay_below_their_bounds() {
    // The table in the documentation of `math`.
    let bounds = [
        (Kernel::One(Sin), 0.80),
        (Kernel::One(Cos), 0.80),
        (Kernel::One(Tan), 0.90),
        (Kernel::One(Exp), 0.55),
        (Kernel::One(Log), 0.51),
        (Kernel::Log2, 0.51),
        (Kernel::One(Log10), 0.51),
        (Kernel::Power, 0.55),
        (Kernel::One(Sinh), 0.80),
        (Kernel::One(Cosh), 0.90),
        (Kernel::One(Tanh), 0.60),
        (Kernel::One(Asin), 0.60),
        (Kernel::One(Acos), 0.60),
        (Kernel::One(Atan), 0.60),
        (Kernel::Two(Atan2), 0.60),
    ];
    for (kernel, bound) in bounds {
        let (mut worst, mut worst_small) = ((0.0, 0.0, 0.0), 0.0f64);
        for (x, y) in points(kernel, 700) {
            let value = kernel.value(x, y);
            let Some(error) = reference::error_in_last_places(kernel, (x, y), value) else { continue };
            // Two roundings below the normal numbers.
            match value.abs() < 2.0 * f64::MIN_POSITIVE {
                true => worst_small = worst_small.max(error),
                false if error > worst.0 => worst = (error, x, y),
                false => {}
            }
        }
        let (error, x, y) = worst;
        println!("{kernel:?}: {error:.4} at {x:e} {y:e}; {worst_small:.3} where small");
        assert!(error <= bound, "{kernel:?} is {error} off at {x:e} {y:e}, allowed are {bound}");
        assert!(error > 0.3, "{kernel:?}: too few points, the worst is {error}");
        assert!(worst_small <= 0.8, "{kernel:?} is {worst_small} off where results are small");
    }
}

#[test]
fn special_values_are_those_of_the_standard() {
    let (inf, nan) = (f64::INFINITY, f64::NAN);
    let one: &[(Function, f64, f64)] = &[
        (Sin, 0.0, 0.0),
        (Sin, -0.0, -0.0),
        (Sin, inf, nan),
        (Sin, 5e-324, 5e-324),
        (Cos, 0.0, 1.0),
        (Cos, -inf, nan),
        (Tan, -0.0, -0.0),
        (Exp, 0.0, 1.0),
        (Exp, inf, inf),
        (Exp, -inf, 0.0),
        (Exp, 709.782712893384, 1.7976931348622732e308),
        (Exp, 709.7827128933841, inf),
        (Exp, -745.1332191019411, 5e-324),
        (Exp, -745.1332191019413, 0.0),
        (Log, 1.0, 0.0),
        (Log, 0.0, -inf),
        (Log, -0.0, -inf),
        (Log, -1.0, nan),
        (Log, inf, inf),
        (Log10, 1e22, 22.0),
        (Log10, 1e-5, -5.0),
        (Asin, 1.0, std::f64::consts::FRAC_PI_2),
        (Asin, -0.0, -0.0),
        (Asin, 1.0000000000000002, nan),
        (Acos, 1.0, 0.0),
        (Acos, -1.0, std::f64::consts::PI),
        (Acos, 0.0, std::f64::consts::FRAC_PI_2),
        (Atan, inf, std::f64::consts::FRAC_PI_2),
        (Atan, -0.0, -0.0),
        (Sinh, -0.0, -0.0),
        (Sinh, -inf, -inf),
        (Sinh, 710.4758600739439, 1.7976931348621744e308),
        (Sinh, 710.475860073944, inf),
        (Cosh, -inf, inf),
        (Cosh, 0.0, 1.0),
        (Tanh, -0.0, -0.0),
        (Tanh, -inf, -1.0),
        (Sign, -0.0, 0.0),
        (Sign, -3.0, -1.0),
        (Floor, -0.5, -1.0),
    ];
    for &(f, x, value) in one {
        assert!(same(math::call(f, x), value), "{} of {x:e} is {:e}, not {value:e}", f.name(), math::call(f, x));
        assert!(math::call(f, nan).is_nan(), "{} of NaN", f.name());
    }
    let power: &[(f64, f64, f64)] = &[
        (2.0, 10.0, 1024.0),
        (10.0, 22.0, 1e22),
        (nan, 0.0, 1.0),
        (1.0, nan, 1.0),
        (nan, 1.0, nan),
        (-1.0, inf, 1.0),
        (0.5, inf, 0.0),
        (0.5, -inf, inf),
        (-2.0, 3.0, -8.0),
        (-2.0, 0.5, nan),
        (-0.0, -3.0, -inf),
        (-0.0, -2.0, inf),
        (-0.0, 3.0, -0.0),
        (-0.0, 0.5, 0.0),
        (0.0, -0.5, inf),
        (-inf, 3.0, -inf),
        (-inf, -3.0, -0.0),
        (-inf, 0.5, inf),
        (inf, -1.0, 0.0),
        (-3.0, 1e300, inf),
        (0.5, 1074.0, 5e-324),
        (0.5, 1076.0, 0.0),
        (1.0000000000000002, 1e300, inf),
        (4.0, 0.5, 2.0),
    ];
    for &(x, y, value) in power {
        assert!(same(math::pow(x, y), value), "{x:e}^{y:e} is {:e}, not {value:e}", math::pow(x, y));
    }
    let pi = std::f64::consts::PI;
    let angles: &[(f64, f64, f64)] = &[
        (0.0, 1.0, 0.0),
        (-0.0, 1.0, -0.0),
        (0.0, -1.0, pi),
        (-0.0, -0.0, -pi),
        (1.0, 0.0, 0.5 * pi),
        (inf, -inf, 0.75 * pi),
        (-1.0, -inf, -pi),
        (5e-324, 1e300, 0.0),
        (5e-324, 5e-324, 0.25 * pi),
        (1.0, nan, nan),
    ];
    for &(y, x, value) in angles {
        assert!(same(math::atan2(y, x), value), "atan2({y:e}, {x:e}) is {:e}, not {value:e}", math::atan2(y, x));
    }
}

#[test]
fn lanes_have_the_same_bits() {
    for kernel in kernels() {
        let all = points(kernel, 3000);
        for chunk in all.chunks_exact(8) {
            let x: [f64; 8] = std::array::from_fn(|i| chunk[i].0);
            let y: [f64; 8] = std::array::from_fn(|i| chunk[i].1);
            let lanes = match kernel {
                Kernel::One(f) => math::call_lanes(f, &x),
                Kernel::Power => math::pow_lanes(&x, &y),
                _ => continue,
            };
            for i in 0..8 {
                assert!(same(lanes[i], kernel.value(x[i], y[i])), "{kernel:?} of {:e} {:e}", x[i], y[i]);
            }
        }
    }
}

#[test]
fn c_has_the_same_bits() {
    let folder = std::path::PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    let (source, program) = (folder.join("kernels_test.c"), folder.join("kernels_test"));
    let main = include_str!("math/main.c");
    std::fs::write(&source, format!("{}\n{main}", math::C_SOURCE)).unwrap();
    let mut compiler = Command::new("cc");
    compiler.args("-std=c99 -O2 -Wall -Wextra -Wconversion -pedantic -Werror -o".split(' '));
    let compiled = compiler.arg(&program).arg(&source).arg("-lm").output().expect("a C compiler named cc is needed");
    assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));
    for (number, kernel) in kernels().into_iter().enumerate() {
        let all = points(kernel, 120_000);
        let mut input = Vec::with_capacity(all.len() * 16);
        for (x, y) in &all {
            input.extend(x.to_le_bytes());
            input.extend(y.to_le_bytes());
        }
        let mut child = Command::new(&program)
            .arg(number.to_string())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the program just compiled runs");
        let mut to = child.stdin.take().unwrap();
        let writer = std::thread::spawn(move || to.write_all(&input).unwrap());
        let output = child.wait_with_output().unwrap().stdout;
        writer.join().unwrap();
        assert_eq!(output.len(), all.len() * 8);
        for (&(x, y), bytes) in all.iter().zip(output.chunks_exact(8)) {
            let (ours, theirs) = (kernel.value(x, y), f64::from_le_bytes(bytes.try_into().unwrap()));
            assert!(same(ours, theirs), "{kernel:?} of {x:e} {y:e}: {ours:e} here, {theirs:e} in C");
        }
    }
}

/// What stands before an item of the C names just what it reads: whoever takes single ones has all that they need.
#[test]
fn items_of_c_say_what_they_read() {
    let text = math::C_SOURCE.to_string() + math::C_SOURCE_SINGLE;
    let mut items: Vec<(&str, BTreeSet<&str>, String)> = Vec::new();
    let mut inside = false;
    for line in text.lines() {
        if let Some(item) = line.strip_prefix("//item ") {
            let (name, needs) = item.split_once(": ").unwrap_or((item, ""));
            items.push((name, needs.split(' ').filter(|n| !n.is_empty()).collect(), String::new()));
        } else if let (Some(last), true) = (items.last_mut(), inside) {
            last.2 += &(line.to_string() + "\n");
        }
        inside = line.starts_with("//item ") || (inside && line != "//always");
    }
    let names: BTreeSet<&str> = items.iter().map(|item| item.0).collect();
    for function in ["ha_sin", "ha_pow", "ha_turnf", "ha_atan2f", "HA_FUNCTION"] {
        assert!(names.contains(function), "{function}");
    }
    for (name, needs, text) in &items {
        let code: String = text.split("/*").map(|part| part.split_once("*/").map_or(part, |(_, code)| code)).collect();
        let words = code.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_'));
        let read: BTreeSet<&str> = words.filter(|word| names.contains(word) && word != name).collect();
        assert_eq!(*needs, read, "{name}");
    }
}
