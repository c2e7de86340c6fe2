//! Models in C with real numbers of single precision: the trajectory of the interpreter, to what they hold.

use crate::common;

use common::{Exported, FLAGS, Rows, build_with, diodes, export_as, export_single, models, own, read_program};
use halfarrow_compiler::algebra::math;
use halfarrow_emit::{EmitError, Method, Real};
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

const STEPS: usize = 400;
/// No number of double precision comes in by accident, and none is cut.
const STRICT: [&str; 3] = ["-O1", "-Wdouble-promotion", "-Wfloat-conversion"];
/// What is not compared: speeds that are rounding, at rest under great loads; models that fail or diverge with this step in
/// double precision too.
const LEFT_OUT: [&str; 3] = ["quarter_car", "leakless", "electrostatic"];

/// A run: when it begins, how many steps it makes, of which each how many-th is printed, a parameter and its value.
#[derive(Clone, Copy)]
struct Run {
    from: f64,
    steps: usize,
    every: usize,
    set: (i32, f64),
}

const PLAIN: Run = Run { from: 0.0, steps: STEPS, every: 1, set: (-1, 0.0) };

fn driver(all: &[Exported], run: &dyn Fn(&Exported) -> Run) -> String {
    let mut text = String::from(include_str!("common/driver_single.c"));
    for one in all {
        let name = &one.written.name;
        let _ = writeln!(text, "RUN({name}, {})", name.to_uppercase());
    }
    text += "int main(void)\n{\n";
    for one in all {
        let Run { from, steps, every, set } = run(one);
        let name = &one.written.name;
        let _ = writeln!(text, "    run_{name}({from:?}, {steps}, {every}, {}, {:?});", set.0, set.1);
    }
    text + "    return 0;\n}\n"
}

/// What each model printed, and what it said when it failed.
fn outputs(text: &str) -> Vec<(Rows, Option<String>)> {
    let of = |text: &str| {
        let numbers = |line: &str| line.split_whitespace().map(|w| w.parse().expect("a number")).collect();
        let rows = text.lines().skip(1).filter(|line| !line.starts_with('!')).map(numbers).collect();
        (rows, text.lines().find_map(|line| line.strip_prefix("! ")).map(str::to_string))
    };
    text.split("== ").skip(1).map(of).collect()
}

/// The greatest difference of a column, each by the greatest value in it, with its name.
fn difference(one: &Exported, found: &Rows, wanted: &Rows) -> (f64, String) {
    let column = |rows: &Rows, k: usize| rows.iter().map(|row| row[k]).collect::<Vec<f64>>();
    let of = |k: usize| {
        let (found, wanted) = (column(found, k), column(wanted, k));
        // Below this a `float` loses digits on the way: the far end of a line that nothing has reached yet.
        let least = f64::from(f32::MIN_POSITIVE / f32::EPSILON);
        let scale = wanted.iter().fold(0.0_f64, |most, v| most.max(v.abs())).max(least);
        let off =
            |(a, b): (&f64, &f64)| if (a - b).abs() <= f64::INFINITY { (a - b).abs() / scale } else { f64::INFINITY };
        found.iter().zip(&wanted).map(off).fold(0.0, f64::max)
    };
    let all = (0..wanted[0].len()).map(|k| (of(k), if k == 0 { "t" } else { &one.outputs[k - 1] }.to_string()));
    all.fold((0.0, String::new()), |worst, one| if one.0 > worst.0 { one } else { worst })
}

/// Methods for which single precision has digits enough.
fn methods() -> Vec<Method> {
    Method::ALL.into_iter().filter(|method| !method.keeps_steps()).collect()
}

#[test]
fn differences_ask_for_double_precision() {
    let program = common::read_program(&own("slow"));
    let refused = export_as(program, Method::LinearlyImplicitBdf2, 1e-3, (false, Real::Float)).map(|_| ());
    let said = refused.expect_err("too few digits").to_string();
    assert!(said.contains("--real double"), "{said}");
}

#[test]
fn floats_follow_the_interpreter() {
    let mut all = Vec::new();
    // Those with repetition, with events, with ratios that leap, and later ones last: each model keeps the method that it has
    // had.
    let has = |path: &PathBuf, what: &str| fs::read_to_string(path).expect("a model").contains(what);
    let later =
        ["operating_points", "flat_start", "ladder_of_four", "driven_orifice", "levels", "pulse_width", "when_gearbox"];
    let came = |path: &PathBuf| later.iter().position(|name| path.file_stem().is_some_and(|stem| stem == *name));
    let mut ordered = models();
    let kind = |path: &PathBuf| (has(path, "Ratios that leap"), has(path, "\nwhen "), has(path, "for i in "));
    ordered.sort_by_key(|path| (came(path), kind(path)));
    let methods = methods();
    for (i, path) in ordered.iter().enumerate() {
        let folder = path.parent().and_then(|p| p.file_name()).unwrap_or_default().to_string_lossy().to_string();
        let name =
            if path.ends_with("model.bond") { folder } else { path.file_stem().unwrap().to_string_lossy().to_string() };
        // Its diodes turn over within a millisecond.
        let step = if name == "rectifier" { 1e-5 } else { 1e-3 };
        if !LEFT_OUT.contains(&name.as_str()) {
            all.push(export_single(path, methods[i % methods.len()], step));
        }
    }
    for name in ["bridge", "delay", "tables", "closure", "mesh", "net_cubic"] {
        all.push(export_single(&own(name), Method::ImplicitMidpoint, 0.9e-3));
    }
    all.extend([Method::Rk4, Method::Rosenbrock].map(|method| export_single(&diodes(), method, 1e-3)));
    assert!(all.len() >= 50, "{} models", all.len());
    let text = build_with("single", &all, &driver(&all, &|_| PLAIN), &STRICT).run(&[]);
    let mut faults = Vec::new();
    for (one, (rows, said)) in all.iter().zip(outputs(&text)) {
        let (wanted, failure) = one.simulate(STEPS);
        let (off, what) = difference(one, &rows, &wanted);
        let as_long = rows.len() == wanted.len() && said.is_some() == failure.is_some();
        // The currents of 62 equations all but cancel in what is stored.
        let bound = if one.written.name.starts_with("net_linearly") { 5e-5 } else { 1.2e-5 };
        if !(off <= bound && as_long) {
            faults.push(format!(
                "{}: {what} off by {off:e}, {} rows of {}: {said:?}",
                one.written.name,
                rows.len(),
                wanted.len()
            ));
        }
    }
    assert!(faults.is_empty(), "{} of {}\n{}", faults.len(), all.len(), faults.join("\n"));
}

/// Parameters keep the digits with which they are set: times of delays and samples fall on steps.
#[test]
fn floats_follow_parameters() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models");
    let model = |name: &str| root.join(name).join("model.bond");
    let cases = [
        (model("slider_crank"), "l", 0.61),
        (model("rc_bridge_cubic"), "r1", 900.0),
        (own("delay"), "dead", 0.0331),
        (own("sampled"), "period", 5e-3),
        (own("bridge"), "c", 2e-6),
    ];
    let all: Vec<Exported> = cases.iter().map(|(path, ..)| export_single(path, Method::Heun, 1e-3)).collect();
    let case = |one: &Exported| {
        let at = all.iter().position(|e| e.written.name == one.written.name).expect("one of them");
        (cases[at].1, cases[at].2)
    };
    let run = |one: &Exported| {
        let (name, value) = case(one);
        let place = one.model.program().parameters.iter().position(|p| p.name == name).expect("a parameter");
        Run { set: (place as i32, value), ..PLAIN }
    };
    let text = build_with("single_parameters", &all, &driver(&all, &run), &STRICT).run(&[]);
    for (one, (rows, said)) in all.iter().zip(outputs(&text)) {
        let mut model = one.model.clone();
        let (name, value) = case(one);
        model.set_parameter(name, value).expect("it can be set");
        let start = model.initialise(0.0).expect("a start");
        let (wanted, _) = one.simulate_from(model, start, STEPS);
        let (off, what) = difference(one, &rows, &wanted);
        assert!(off <= 1e-5 && rows.len() == wanted.len(), "{}: {what} off by {off:e}: {said:?}", one.written.name);
    }
}

/// A state that a step changes by less than its last digit moves all the same, by every method; time does not stand still, and
/// what follows from it has its digits.
#[test]
fn long_runs_do_not_stand_still() {
    let all: Vec<Exported> = methods().into_iter().map(|method| export_single(&own("slow"), method, 1e-3)).collect();
    let run = |_: &Exported| Run { from: 1e5, steps: 200_003, every: 200_003, ..PLAIN };
    let text =
        build_with("single_slow", &all, &driver(&all, &run), &["-O2", "-Wdouble-promotion", "-Wfloat-conversion"])
            .run(&[]);
    for (one, (rows, said)) in all.iter().zip(outputs(&text)) {
        let last = rows.last().unwrap_or_else(|| panic!("{said:?}"));
        let column = |name: &str| last[1 + one.outputs.iter().position(|o| o == name).expect("an output")];
        assert!((last[0] - 100_200.003).abs() < 1e-9, "{}: {:?}", one.written.name, last[0]);
        let level = 1.0 - math::exp(-200.003 / 1000.0);
        assert!(
            (column("level") - level).abs() <= 1e-6 * level,
            "{}: {} but {level}",
            one.written.name,
            column("level")
        );
        let pumped = math::sin(100.0 * std::f64::consts::PI * last[0]);
        assert!((column("pumped") - pumped).abs() <= 2e-7, "{}: {} but {pumped}", one.written.name, column("pumped"));
    }
}

/// Where no source depends on time, and what parameters determine is computed, nothing but floats is left for a step.
#[test]
fn equations_without_time_have_no_double() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models");
    for path in [root.join("quarter_car/model.bond"), root.join("double_pendulum/model.bond"), own("draining")] {
        let source = export_single(&path, Method::Heun, 1e-3).written.source;
        let functions =
            source.split("\n}\n").filter(|f| f.contains("int ha_rates_code") || f.contains("int ha_observe_code"));
        assert_eq!(functions.clone().count(), 2);
        for function in functions {
            let body = function.split_once("\n{\n").expect("a body").1;
            assert!(!body.contains("double"), "{body}");
        }
    }
}

/// What does not fit is refused, with its name and what would help.
#[test]
fn what_does_not_fit_is_refused() {
    let folder = common::folder("single_refused");
    let refused = |given: &str, law: &str| {
        let text = format!(
            "model Range\nparam k = {given}\nSe:source(sin(t)) -> 1:loop -> C:spring(k = k)\nloop -> R:r({law})\nloop -> I:mass(1)\n"
        );
        let path = folder.join("range.bond");
        std::fs::write(&path, text).expect("a model");
        export_as(read_program(&path), Method::Rk4, 1e-3, (false, Real::Float)).err()
    };
    assert_eq!(refused("1", "1"), None);
    assert_eq!(refused("1e-30", "1e30"), None);
    for (given, law, what) in [
        ("1e39", "1", "the parameter k is 1e39 "),
        ("1e-39", "1", "the parameter k is 1e-39 "),
        ("1e30", "k*k", "what follows from parameters in the equations is"),
        ("1", "e = 1e-60*f^3", "a number of the equations is 1e-60 "),
    ] {
        let why = refused(given, law).map(|why| why.to_string()).unwrap_or_default();
        assert!(
            why.starts_with(what) && why.contains("does not fit `float`") && why.contains("--real double"),
            "{why}"
        );
        assert!(matches!(refused(given, law), Some(EmitError::Range(..))));
    }
}

/// A parameter that is set to what does not fit fails, and so does one from which that follows.
#[test]
fn what_is_set_has_to_fit() {
    let one = export_single(&own("bridge"), Method::Heun, 1e-3);
    let place = one.model.program().parameters.iter().position(|p| p.name == "c").expect("a parameter") as i32;
    for value in [1e300, 1e-60] {
        let run = |_: &Exported| Run { set: (place, value), ..PLAIN };
        let all = std::slice::from_ref(&one);
        let text = build_with("single_set", all, &driver(all, &run), &STRICT).run(&[]);
        let said = outputs(&text)[0].1.clone().unwrap_or_default();
        assert!(said.starts_with("the parameter c does not fit float"), "{said}");
    }
}

/// Errors of elementary functions in units of the last place.
#[test]
fn elementary_functions_keep_their_bounds() {
    let folder = common::folder("single_accuracy");
    let text = format!(
        "#include <string.h>\n{}{}{}",
        math::C_SOURCE,
        math::C_SOURCE_SINGLE,
        include_str!("common/accuracy.c")
    );
    std::fs::write(folder.join("accuracy.c"), text).expect("a file");
    let points = format!("-DPOINTS={}", 300_000);
    common::cc("cc", &folder, |c| {
        c.args(FLAGS).args(STRICT).args(["-O2", &points, "accuracy.c", "-o", "accuracy", "-lm"])
    });
    let out = Command::new(folder.join("accuracy")).output().expect("it runs");
    let text = String::from_utf8_lossy(&out.stdout).to_string();
    assert!(!text.contains('!'), "{text}");
    for line in text.lines() {
        let (name, worst) = line.split_once(' ').expect("a name");
        let bound = match name {
            "sin" | "cos" | "exp" => 0.9,
            "log" | "log2" | "log10" => 0.6,
            "pow" => 1.5,
            "asin" | "acos" => 1.2,
            "sinh" | "cosh" | "tanh" => 1.7,
            "tan" => 2.3,
            _ => 2.4,
        };
        assert!(worst.parse::<f64>().is_ok_and(|w| w > 0.4 && w <= bound), "{line}");
    }
    assert_eq!(text.lines().count(), 15);
}

/// No undefined behaviour, nothing read that was not written; clang sees no warning and gives the same bits.
#[test]
fn floats_are_clean() {
    let all: Vec<Exported> = ["contact", "bridge", "tables", "delay", "mesh", "net", "net_cubic"]
        .iter()
        .zip([Method::ImplicitMidpoint, Method::Rosenbrock].into_iter().cycle())
        .map(|(name, method)| export_single(&own(name), method, 1e-3))
        .collect();
    let driver = driver(&all, &|_| Run { steps: 150, ..PLAIN });
    let strict = |more: &[&'static str]| [&STRICT[1..], more].concat();
    let sanitized = strict(&["-O0", "-g", "-fsanitize=undefined", "-fno-sanitize-recover=all"]);
    let wanted = build_with("single_undefined", &all, &driver, &sanitized).run(&[]);
    let required = std::env::var_os("HALFARROW_C_TOOLS").is_some();
    let there = |tool: &str| Command::new(tool).arg("--version").output().is_ok_and(|out| out.status.success());
    if required || there("clang") {
        let with_clang = common::build_by("clang", "single_clang", &all, &driver, &strict(&["-O2"]));
        assert!(with_clang.run(&[]) == wanted, "clang gives other bits");
    }
    if required || there("valgrind") {
        let plain = build_with("single_plain", &all, &driver, &strict(&["-O1", "-g"]));
        assert!(plain.run(&[]) == wanted, "-O1 gives other bits");
        let out = Command::new("valgrind").args(["--error-exitcode=9", "--quiet"]).arg(plain.path()).output();
        let out = out.expect("valgrind runs");
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    }
}
