//! Modes in exported C, with other branches of set-valued laws or other independent variables: the modes that a run comes to,
//! and all that is recorded, to the bits of a run by the same steps.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use std::path::{Path, PathBuf};
use std::process::Command;

use halfarrow::{Export, FixedMethod, Method, Model, Record, Run, Target};

use super::set_valued_random::{circuit, row};

/// What a machine is, how it is stepped, and how far.
struct Case {
    name: &'static str,
    text: String,
    method: FixedMethod,
    step: f64,
    to: f64,
}

fn case(name: &'static str, text: impl Into<String>, method: FixedMethod, to: f64) -> Case {
    Case { name, text: text.into(), method, step: 1e-3, to }
}

fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("modes_in_c").join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder");
    folder
}

fn model(text: &str) -> Model {
    Model::from_text("machine.bond", text, &[]).unwrap_or_else(|e| panic!("{}", e.render(false)))
}

/// The rows that the exported program prints, and what it says at its end.
fn by_c(case: &Case) -> (Vec<String>, Vec<Vec<f64>>, String) {
    by_c_of(case, &Export::default())
}

/// The same with other options.
fn by_c_of(case: &Case, options: &Export) -> (Vec<String>, Vec<Vec<f64>>, String) {
    let options = Export { target: Target::C, method: case.method, step: case.step, ..options.clone() };
    let written = model(&case.text).export(&options).unwrap_or_else(|e| panic!("{}: {}", case.name, e.render(false)));
    let folder = folder(case.name);
    for file in &written.files {
        std::fs::write(folder.join(&file.path), &file.bytes).expect("a file");
    }
    let sources = written.files.iter().filter(|f| f.path.ends_with(".c")).map(|f| f.path.as_str());
    // Files of many modes take most of the time to compile; the bits are the same without optimisation.
    let flags = [
        "-std=c99",
        "-O0",
        "-Wall",
        "-Wextra",
        "-Wconversion",
        "-pedantic",
        "-Werror",
        "-ffp-contract=off",
        "-Wno-overlength-strings",
    ];
    let compiler = std::env::var("CC").unwrap_or_else(|_| "cc".to_string());
    let mut compile = Command::new(compiler);
    let compile = compile.current_dir(&folder).args(flags).args(sources).args(["-o", "program", "-lm"]);
    let out = compile.output().expect("a C compiler: cc, or what CC names");
    assert!(out.status.success(), "{}: {}", case.name, String::from_utf8_lossy(&out.stderr));
    let out = Command::new(folder.join("program")).arg(case.to.to_string()).output().expect("it runs");
    let text = String::from_utf8(out.stdout).expect("text");
    let mut lines = text.lines();
    let names = lines.next().expect("names").split(',').skip(1).map(str::to_string).collect();
    let rows = lines.map(|line| line.split(',').map(|v| v.parse().expect("a number")).collect()).collect();
    (names, rows, String::from_utf8_lossy(&out.stderr).into_owned())
}

/// Where C and a run by the same steps differ by more than a part of the greatest value.
fn difference(case: &Case, within: f64) -> Option<String> {
    let (names, rows, said) = by_c(case);
    let run = Run {
        to: case.to,
        method: Method::Fixed(case.method),
        step: Some(case.step),
        every: Some(case.step),
        record: Record::Names(names.clone()),
        ..Run::default()
    };
    let result = match model(&case.text).simulate(&run, &mut |_| true) {
        Ok(result) => result,
        Err(why) => {
            return (said.is_empty()).then(|| format!("{}: only `simulate` stops: {}", case.name, why.render(false)));
        }
    };
    if !said.is_empty() || rows.len() != result.trace.times.len() {
        return Some(format!("{}: {} rows for {}: {said}", case.name, rows.len(), result.trace.times.len()));
    }
    let most = |values: &[f64]| values.iter().fold(0.0f64, |most, v| most.max(v.abs()));
    let allowed: Vec<f64> = result.trace.columns.iter().map(|c| within * most(&c.values)).collect();
    for (k, row) in rows.iter().enumerate() {
        let expected = result.trace.columns.iter().map(|c| c.values[k]);
        let met = |j: usize, wanted: f64| (row[j + 1] - wanted).abs() <= allowed[j];
        let off = |(j, wanted): &(usize, f64)| !met(*j, *wanted);
        if let Some((j, wanted)) = expected.enumerate().find(off) {
            return Some(format!("{} at {}: {} is {:?}, not {wanted:?}", case.name, row[0], names[j], row[j + 1]));
        }
    }
    None
}

fn check(cases: &[Case]) {
    check_within(cases, 0.0);
}

fn check_within(cases: &[Case], within: f64) {
    let half = cases.len().div_ceil(2);
    let faults: Vec<String> = std::thread::scope(|scope| {
        let parts: Vec<_> = cases
            .chunks(half)
            .map(|part| scope.spawn(move || part.iter().filter_map(|c| difference(c, within)).collect::<Vec<_>>()))
            .collect();
        parts.into_iter().flat_map(|part| part.join().expect("it ends")).collect()
    });
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// Three phases and six diodes: no storage, nothing but modes.
fn three_phases() -> String {
    let mut text = String::from("model Three\nSe:ground(0) -> 0:star\n0:p\n0:n\n");
    for k in 0..3 {
        text += &format!("star -> 1:phase{k} -> 0:line{k}\nSe:u{k}(100*sin(300*t - {k}*2*pi/3)) -> phase{k}\n");
        text += &format!("line{k} -> 1:up{k} -> p\nup{k} -> R:du{k}(0 <= f, 0 <= -e)\n");
        text += &format!("n -> 1:down{k} -> line{k}\ndown{k} -> R:dd{k}(0 <= f, 0 <= -e)\n");
    }
    text + "p -> 1:out -> n\nout -> R:load(10)\noutput u = load.e\n"
}

/// Diodes, switches, friction, clutches, contacts that open, close, bounce, accumulate and share out impulses.
#[test]
fn machines() {
    use FixedMethod::{Heun, ImplicitMidpoint, LinearlyImplicitEuler, Rk4, Rosenbrock};
    check(&[
        case(
            "coil",
            "model Coil\nSe:src(10*sin(300*t)) -> 1:loop\nloop -> R:d(0 <= f, 0 <= -e)\nloop -> I:coil(0.1)\n\
             loop -> R:load(20)\noutput i = coil.f, u = d.e\n",
            Rk4,
            0.1,
        ),
        case("three", three_phases(), Heun, 0.05),
        case(
            "buck",
            "model Buck\nSe:src(24) -> 1:in -> 0:sw\nin -> Sw:s(on = mod(t, 1e-2) < 0.4e-2)\nsw -> 1:free\n\
             free -> R:d(0 <= -f, 0 <= e)\nsw -> 1:coil -> 0:out\ncoil -> I:l(1e-1)\nout -> C:c(1e-2)\n\
             out -> R:load(20)\n",
            Rosenbrock,
            1.0,
        ),
        case(
            "belt",
            "model Belt\nSf:belt(0.1) -> 0:contact\ncontact -> 1:rub -> R:pad(friction = 1, stiction = 1.5)\n\
             contact -> 1:block\nblock -> I:mass(1)\nblock -> C:spring(k = 10)\ndiscrete n = 0\n\
             when spring.e > 1.5 - 1e-9 { n = n + 1 }\n",
            Rk4,
            6.0,
        ),
        case(
            "clutch",
            "model Clutch\n1:a -> I:j1(1, f0 = 30)\n1:b -> I:j2(2)\na -> 0:slip -> b\nslip -> R:pad(friction = 10)\n",
            LinearlyImplicitEuler,
            3.0,
        ),
        // Impulses let go what sticks, also where it takes all that is reset with it.
        case(
            "kick",
            "model Kick\nSe:push(3) -> 1:v -> I:mass(2)\nv -> R:pad(friction = 5)\nv -> TF:gear(2) -> 1:w -> I:big(5)\n\
             1:a -> I:free(1)\na -> 0:between -> v\nbetween -> C:spring(k = 30)\n\
             when t > 1.0005 { reset big.f = 0.2 }\nwhen every 0.7 { reset free.f = free.f - 0.3 }\n",
            Rk4,
            4.0,
        ),
        case(
            "ball",
            "model Ball\nSe:weight(-9.81) -> 1:v -> I:m(1)\nstate x' = v.f from 1\n\
             constraint floor: x >= 0 (restitution = 0.8)\noutput force = floor.e\n",
            Rk4,
            5.0,
        ),
        case(
            "stack",
            "model Stack\nSe:w1(-10) -> 1:v1 -> I:m1(1)\nSe:w2(-20) -> 1:v2 -> I:m2(2)\nstate x1' = v1.f from 0.5\n\
             state x2' = v2.f from 1\nconstraint floor: x1 >= 0 (restitution = 0.5)\n\
             constraint between: x2 - x1 >= 0.25 (restitution = 0.5)\n",
            Heun,
            4.0,
        ),
        case(
            "walls",
            "model Walls\n1:a -> I:ma(1, f0 = 3)\n1:b -> I:mb(2)\n1:c -> I:mc(1)\nstate xa' = a.f from 0\n\
             state xb' = b.f from 1\nstate xc' = c.f from 2\nconstraint ab: xb - xa >= 1\nconstraint bc: xc - xb >= 1\n\
             constraint left: xa >= 0\nconstraint right: xc <= 2\n",
            ImplicitMidpoint,
            1.0,
        ),
        case(
            "cubes",
            "model Cubes\nSe:src(8*sin(20*t)) -> 1:in -> 0:n\nin -> R:rs(e = 2*f + f^3)\nn -> 1:up\n\
             up -> R:d(0 <= f, 0 <= 0.7 - e)\nup -> R:rd(e = f^3 + f)\nn -> C:cap(0.01)\n",
            Rk4,
            2.0,
        ),
        case(
            "brief",
            "model Brief\n1:v -> I:m(1)\nv -> C:spring(k = 1, q0 = 1)\nstate x' = v.f from 1\n\
             constraint wall: x >= -0.9999 (restitution = 1)\n",
            Rk4,
            5.0,
        ),
    ]);
}

/// A slider-crank with a weight on its slide.
fn crank(more: &str) -> String {
    format!(
        "model Crank\nparam r = 0.2, l = 0.5\n1:crank -> I:j(0.05, f0 = 12)\n1:slide -> I:m(1.5)\n1:rod -> I:jr(0.02)\n\
         Se:g(-4) -> slide\nstate th' = crank.f from 0.4\nstate s' = slide.f\nstate ph' = rod.f\n\
         constraint along: r*cos(th) + l*cos(ph) = s\nconstraint across: r*sin(th) = l*sin(ph)\n\
         guess s = 0.6, ph = 0.15\n{more}"
    )
}

/// Other variables become independent where those that are do not tell the motion any more: dead centres, limits of a rocker, a
/// pendulum by `x` and `y` that turns over; also beside friction and walls.
#[test]
fn exchanges() {
    use FixedMethod::{Heun, Rk4, Rosenbrock};
    let pendulum = "1:vx -> I:mx(1, f0 = 3)\n1:vy -> I:my(1)\nSe:w(-9.81) -> vy\nstate x' = vx.f from 0.3\n\
                    state y' = vy.f from 0.4\nconstraint rod: x^2 + y^2 = 0.25\n";
    let rocker = "model Rocker\nparam a = 0.5, b = 0.2, c = 0.45, d = 0.6\n1:in -> I:j1(0.1, f0 = 2)\n\
                  1:coup -> I:j2(0.05)\n1:out -> I:j3(0.2)\nSe:w(-3) -> in\nstate t1' = in.f from 1.2\n\
                  state t2' = coup.f\nstate t3' = out.f\nconstraint x: a*cos(t1) + b*cos(t2) = d + c*cos(t3)\n\
                  constraint y: a*sin(t1) + b*sin(t2) = c*sin(t3)\nguess t2 = 0.3, t3 = 1.7\n";
    let wall = format!("model Wall\n{pendulum}constraint wall: x >= -0.3 (restitution = 0.5)\n");
    let trammel = "model Trammel\n1:x -> I:mx(1, f0 = 0.5)\n1:y -> I:my(2)\nstate px' = x.f from 0.3\nstate py' = y.f\n\
                   guess py = 0.9\nconstraint bar: px^2 + py^2 = 1\nx -> R:fx(friction = 0.1)\ny -> C:s(k = 30)\n";
    let cases = [
        case("pendulum", format!("model Pendulum\n{pendulum}"), Rk4, 3.0),
        case("rocker", rocker, Heun, 3.0),
        case("crank", crank(""), Rosenbrock, 3.0),
        case("rub", crank("slide -> R:pad(friction = 2)\n"), Rk4, 3.0),
        case("wall", wall, Rk4, 3.0),
        // Friction turns round where the speed that it goes with tells nothing.
        case("trammel", trammel, Rk4, 3.0),
        case("dead_centre", super::set_valued::DEAD_CENTRE, Heun, 2.0),
    ];
    // Where variables are exchanged other eliminations take the last digits.
    check_within(&cases, 1e-13);
    // Where these begin, one of the choices is singular; they exchange variables at other steps.
    check_within(&[case("hangs", HANGS, Rk4, 3.0), case("sleigh", SLEIGH, Rk4, 4.0)], 1e-6);
}

/// A pendulum that hangs at the start and turns over.
const HANGS: &str = "model Hangs\n1:vx -> I:mx(2, f0 = 8)\n1:vy -> I:my(2)\nSe:w(-19.62) -> vy\nstate x' = vx.f from 0\n\
                     state y' = vy.f\nguess y = -1\nconstraint rod: x^2 + y^2 = 1.21\n";

/// Chaplygin's sleigh, which begins along an axis and turns away from it.
const SLEIGH: &str = "model Sleigh\nparam a = 0.3\n1:vx -> I:mx(2, f0 = 2)\n1:vy -> I:my(2)\n1:w -> I:turn(0.4, f0 = 6)\n\
                      state th' = w.f from 0\nstate x' = vx.f\nstate y' = vy.f\n\
                      constraint blade: vy.f*cos(th) - vx.f*sin(th) = a*w.f\n";

/// A four-bar of bodies whose rocker turns round: the steps before its limit are long beside the way to it. Energy and the angle of
/// the crank in C and in a run by the same steps, which exchange variables at other places.
#[test]
fn a_limit_that_steps_come_near() {
    let bars = "model Bars\nimport std.planar\nPlanarCutRevolute:joint\n\
                PlanarWorld:world(g = [0, -9.81]) -> 1[plane]:ground\n\
                ground -> PlanarRevolute:crank(q0 = 0.8, w0 = 5 rad/s) -> 1[plane]:a\n\
                a -> PlanarBody:bar(m = 1 kg, J = 0.01, c = [0.15, 0])\n\
                a -> PlanarTranslation:pin(d = [0.3, 0]) -> PlanarRevolute:knee(q0 = -0.5 rad) -> 1[plane]:b\n\
                b -> PlanarBody:coupler(m = 0.6 kg, J = 0.005, c = [0.12, 0.02])\n\
                b -> PlanarTranslation:tip(d = [0.25, 0]) -> joint.a\n\
                ground -> PlanarTranslation:base(d = [0.5, 0]) -> PlanarRevolute:rocker(q0 = 1.5 rad) -> 1[plane]:c\n\
                c -> PlanarBody:swing(m = 1.2 kg, J = 0.02, c = [0.15, 0.01])\n\
                c -> PlanarTranslation:top(d = [0.3, 0]) -> joint.b\noutput turned = crank.angle\n";
    // Of 0.9 rad to either side, and of a third of its energy without a look ahead.
    check_within(&[Case { step: 5e-4, ..case("bars", bars, FixedMethod::Rk4, 3.0) }], 5e-3);
}

/// A crank longer than its rod: what its speeds are divided by near the dead centre is the determinant of two equations, no divisor
/// of its own. Steps of fixed length against an exact run, and C against these.
#[test]
fn a_dead_centre_of_equations_that_are_solved_together() {
    let text = "model Long\n1:crank -> I:j(0.05, f0 = -1.22)\n1:slide -> I:m(1.5)\n1:rod -> I:jr(0.02)\nSe:g(-4) -> slide\n\
                state th' = crank.f from 0\nstate s' = slide.f\nstate ph' = rod.f\n\
                constraint along: 0.474*cos(th) + 0.165*cos(ph) = s\nconstraint across: 0.474*sin(th) = 0.165*sin(ph)\n\
                guess s = 0.639, ph = 0.1\n";
    let run =
        Run { to: 2.0, every: Some(0.1), record: Record::Names(vec!["th".into(), "ph".into()]), ..Run::default() };
    let fixed = Run { method: Method::Fixed(FixedMethod::Rk4), step: Some(1e-3), ..run.clone() };
    let of = |run: &Run| model(text).simulate(run, &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false)));
    let (exact, fixed) = (of(&Run { rtol: 1e-10, ..run.clone() }), of(&fixed));
    for (exact, fixed) in exact.trace.columns.iter().zip(&fixed.trace.columns) {
        for (a, b) in exact.values.iter().zip(&fixed.values) {
            assert!((a - b).abs() < 1e-3, "{}: {b}, not {a}", exact.name);
        }
    }
    check_within(&[case("long", text, FixedMethod::Rk4, 2.0)], 1e-9);
}

/// Code that keeps its independent variables stops where a position has been passed at which they do not tell the motion.
#[test]
fn a_position_that_is_passed() {
    for (name, text) in [("hangs_single", HANGS), ("sleigh_single", SLEIGH)] {
        let single = Export { real: halfarrow::Real::Float, ..Export::default() };
        let (_, rows, said) = by_c_of(&case(name, text, FixedMethod::Rk4, 6.0), &single);
        let told =
            ["the motion does not follow from", "have no unique solution"].iter().any(|what| said.contains(what));
        assert!(told, "{name}: {said}");
        assert!(rows.len() < 5000, "{name}: {} rows", rows.len());
        let told = model(text).export(&single).expect("it is written").report.cost_text.join("\n");
        assert!(told.contains("one choice of independent variables"), "{name}: {told}");
    }
}

/// A random circuit and a random row of bodies.
#[test]
fn random() {
    use FixedMethod::{LinearlyImplicitBdf2, Rosenbrock};
    let of = |name, (text, _): (String, Vec<String>), method| Case { step: 5e-3, ..case(name, text, method, 3.0) };
    check(&[of("circuit", circuit(3000), Rosenbrock), of("row", row(3001, true), LinearlyImplicitBdf2)]);
}

/// A line of so many cells that its rates are compared where short models have derivatives.
#[test]
fn rates_compared() {
    let text = "model Line\nSe:u(2 + sin(3*t)) -> 1:in -> 0:n[1]\nin -> R:ri(1)\nfor i in 1..1600 {\n\
                n[i] -> C:c[i](0.5)\nn[i] -> R:g[i](f = 0.1*e + e^3)\n\
                if i < 1600 {\nn[i] -> 1:b[i] -> 0:n[i + 1]\nb[i] -> R:r[i](1)\n}\n}\n";
    check(&[case("line", text, FixedMethod::LinearlyImplicitBdf2, 0.05)]);
}

/// What exported code does not know is refused.
#[test]
fn refusals() {
    let many: String = (0..9).map(|k| format!("v -> R:d{k}(friction = 1)\n")).collect();
    let text = format!("model Many\nSe:pull(3*sin(2*t)) -> 1:v -> I:m(1)\n{many}");
    let told = model(&text).export(&Export::default()).expect_err("a refusal").render(false);
    assert!(told.contains("more than 256 combinations"), "{told}");
    let text = "model Single\nSe:pull(3*sin(2*t)) -> 1:v -> I:m(1)\nv -> R:pad(friction = 1)\n";
    let single = Export { real: halfarrow::Real::Float, ..Export::default() };
    let told = model(text).export(&single).expect_err("a refusal").render(false);
    assert!(told.contains("double precision"), "{told}");
}
