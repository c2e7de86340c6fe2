//! Steps: how many there are, what asks for them, and what is said before they are taken.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use std::path::{Path, PathBuf};

use halfarrow::{Error, FixedMethod, Form, Input, Method, Model, Record, Run, Simulated, Start, Verdict};

fn fault(name: &str) -> Model {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/faults").join(format!("{name}.bond"));
    Model::load(&path, &[]).unwrap_or_else(|error| panic!("{}", error.render(false)))
}

fn text(text: &str) -> Model {
    Model::from_text("text.bond", text, &[]).unwrap_or_else(|error| panic!("{}", error.render(false)))
}

fn run(model: &Model, run: Run) -> Simulated {
    model.simulate(&run, &mut |_| true).unwrap_or_else(|error| panic!("{}", error.render(false)))
}

fn refused(model: &Model, run: Run) -> String {
    match model.simulate(&run, &mut |_| false) {
        Err(error @ Error::Usage(_)) => error.render(false),
        other => panic!("not refused: {:?}", other.map(|done| done.report.steps)),
    }
}

#[test]
fn rounding_is_no_magnitude() {
    // A state that is zero but for rounding, as flows grow beside it.
    let report = run(&fault("atol"), Run { to: 3600.0, ..Run::default() }).report;
    assert!(report.steps <= 40, "{} steps", report.steps);
    let kept = report.tolerances.iter().find(|kept| kept.name == "tank.q").expect("a state");
    assert!(kept.scale >= 2000.0 && kept.absolute <= 1e-6 * kept.scale, "{kept:?}");
    // A chain that hangs at rest but for the rounding of a right angle.
    let report = run(&fault("chain_at_rest"), Run { to: 20.0, ..Run::default() }).report;
    assert!(report.steps <= 100, "{} steps", report.steps);
}

/// A law that hardly acts at the start would let a state grow by many decades until something holds it. Charge of a capacitor
/// beside a diode or a varistor, and speed of a fan, in closed form.
#[test]
fn a_law_that_hardly_acts_at_the_start_tells_no_magnitude() {
    let methods = [Method::Auto, Method::Explicit, Method::Radau, Method::Bdf];
    let solar = "Sf:cell(3) -> 0:n\nn -> R:d(f = 1e-9*(exp(e/0.026) - 1))\nn -> C:c(1e-4)\noutput y = n.e\n";
    let diode = |t: f64| {
        let (part, all) = (1e-9 / (3.0 + 1e-9), 3.0 + 1e-9);
        -0.026 * (part + (1.0 - part) * (-all * t / (1e-4 * 0.026)).exp()).ln()
    };
    let fan = |slope: f64| {
        format!("Se:t(10) -> 1:w -> I:j(0.01)\nw -> R:fan(e = 1e-4*f*abs(f) + {slope:e}*f)\noutput y = w.f\n")
    };
    let turns = |t: f64| 1e5f64.sqrt() * (1e-3f64.sqrt() / 0.01 * t).tanh();
    let varistor = "Sf:i(0.01) -> 0:o -> C:c(1e-6)\n\
                    o -> R:v(f = (abs(e)/100)^30*sign(e) + 1e-12*e)\noutput y = o.e\n";
    let held = 100.0 * 0.01f64.powf(1.0 / 30.0);
    for method in methods {
        let end = |text: &str, to: f64| {
            let done = run(&self::text(&format!("model M\n{text}")), Run { to, method, rtol: 1e-8, ..Run::default() });
            assert_eq!(done.report.audit.verdict, Verdict::Holds, "{method:?}\n{text}");
            *done.trace.columns.last().expect("an output").values.last().expect("an end")
        };
        let near = |found: f64, wanted: f64| {
            assert!((found - wanted).abs() < 2e-6 * wanted, "{method:?}: {found} is not {wanted}");
        };
        near(end(solar, 1.5e-5), diode(1.5e-5));
        near(end(solar, 1e-3), diode(1e-3));
        near(end(&fan(1e-9), 0.3), turns(0.3));
        near(end(&fan(1e-12), 2.0), turns(2.0));
        near(end(varistor, 0.05), held);
    }
}

/// What runs down a chain comes to its end as a ripple of some decades below, and rounding with it.
/// Where a machine would rest tells how great its states are only if it is near. The reference is the same machine by classical
/// Runge-Kutta with steps of 1e-4 s.
#[test]
fn a_rest_that_is_far_away_is_no_magnitude() {
    let model = fault("no_rest");
    let asked = |form, method, step| Run {
        to: 0.4,
        every: Some(0.1),
        rtol: 1e-9,
        form,
        method,
        step,
        record: Record::Names(vec!["y".into(), "m.p".into()]),
        ..Run::default()
    };
    let values = |asked: Run| -> Vec<f64> {
        run(&model, asked).trace.columns.iter().filter(|c| c.name != "t").flat_map(|c| c.values.clone()).collect()
    };
    let wanted = values(asked(Form::Minimal, Method::Fixed(FixedMethod::Rk4), Some(1e-4)));
    for form in [Form::Minimal, Form::Kane, Form::Break, Form::Lagrange] {
        for (value, wanted) in values(asked(form, Method::Auto, None)).into_iter().zip(&wanted) {
            assert!((value - wanted).abs() < 1e-8, "{form:?}: {value}, not {wanted}");
        }
    }
}

/// A rate that states change by rounding alone has no rest, however far. The reference is the same machine by classical Runge-Kutta
/// with steps of 1e-4 s.
#[test]
fn a_rest_by_rounding_is_no_magnitude() {
    let model = fault("rest_by_rounding");
    let asked = |method, step, rtol| Run {
        to: 0.3,
        every: Some(0.1),
        rtol,
        method,
        step,
        record: Record::Names(vec!["j0.q".into(), "j1.roll.q".into(), "j1.yaw.rate.f".into()]),
        ..Run::default()
    };
    let done = |asked: Run| -> (Vec<f64>, f64) {
        let done = run(&model, asked);
        let greatest = done.report.tolerances.iter().fold(0.0, |most: f64, kept| most.max(kept.scale));
        (done.trace.columns.iter().filter(|c| c.name != "t").flat_map(|c| c.values.clone()).collect(), greatest)
    };
    let (wanted, _) = done(asked(Method::Fixed(FixedMethod::Rk4), Some(1e-4), 1e-6));
    for method in [Method::Auto, Method::Explicit, Method::Bdf, Method::Radau] {
        for (rtol, within) in [(1e-6, 1e-4), (1e-12, 1e-9)] {
            let (values, greatest) = done(asked(method, None, rtol));
            assert!(greatest < 100.0, "{method:?}: a scale of {greatest:e}");
            for (value, wanted) in values.into_iter().zip(&wanted) {
                assert!((value - wanted).abs() < within, "{method:?}, {rtol:e}: {value}, not {wanted}");
            }
        }
    }
}

/// A body that nothing moves but the rounding of what others do to each other: its place is no better known than its speed. It took
/// 7,764 steps; 86 are enough where it moves.
#[test]
fn a_place_that_rounding_moves_is_known_as_its_speed_is() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/satellite/slew.bond");
    let text =
        std::fs::read_to_string(&path).expect("an example").replace(":satellite()", ":satellite(v0 = [0, 0, 0])");
    let folder = temp_dir::TempDir::new().expect("a folder");
    let at = |name: &str| folder.child(name);
    std::fs::write(at("slew.bond"), text).expect("written");
    std::fs::copy(path.with_file_name("satellite.bond"), at("satellite.bond")).expect("copied");
    let model = Model::load(&at("slew.bond"), &[]).unwrap_or_else(|error| panic!("{}", error.render(false)));
    let report = run(&model, Run { to: 3.0, ..Run::default() }).report;
    assert!(report.steps < 2000, "{} steps", report.steps);
}

#[test]
fn what_stands_still_takes_one_step() {
    let still = "-> 1:a -> R:r(2)\nSf:hold(0) -> a\n";
    let steps = |told: String| {
        let record = Record::Names(vec!["r.e".into(), "hold.e".into()]);
        let done = run(&text(&told), Run { to: 0.1, record, ..Run::default() });
        (done.report.steps, done.trace.columns.iter().find(|c| c.name == "hold.e").expect("recorded").values.clone())
    };
    let (taken, values) = steps(format!("model M\nSe:push(1) {still}"));
    assert!(taken == 1 && values.iter().all(|v| v.abs() == 1.0), "{taken} steps, {values:?}");
    // To a jump, and on from there.
    let (taken, values) = steps(format!("model M\nSe:push(if t < 0.05 then 1 else 2) {still}"));
    assert!(taken == 2 && values.last().is_some_and(|v| v.abs() == 2.0), "{taken} steps, {values:?}");
    let (taken, _) = steps(format!("model M\nSe:push(sample(t, 0.02)) {still}"));
    assert!(taken <= 6, "{taken} steps");
    // What moves is followed.
    for moving in ["sin(t)", "delay(t, 0.01)", "if sin(40*t) > 0.5 then 1 else 2"] {
        let (taken, _) = steps(format!("model M\nSe:push({moving}) {still}"));
        assert!(taken >= 3, "{moving}: {taken} steps");
    }
    let (taken, _) = steps(format!("model M\nSe:push(sin(t)) {still}"));
    assert!((1000..=1010).contains(&taken), "{taken} steps");
}

#[test]
fn a_chain_takes_the_steps_that_its_motion_asks_for() {
    let steps = [1e-8, 1e-9, 1e-10, 1e-11].map(|rtol| {
        run(&fault("chain"), Run { to: 1.0, rtol, method: Method::Explicit, ..Run::default() }).report.steps
    });
    for pair in steps.windows(2) {
        let growth = pair[1] as f64 / pair[0] as f64;
        assert!((1.2..2.0).contains(&growth), "{steps:?}");
    }
    assert!(steps[3] < 1000, "{steps:?}");
}

#[test]
fn a_double_zero_of_time_is_no_jump() {
    for (name, to) in [("clock_t", 20.0), ("clock_hang", 36000.0)] {
        let done = run(&fault(name), Run { to, ..Run::default() });
        assert_eq!(done.report.jumps, 0, "{name}");
        assert!(done.report.steps < 2000, "{name}: {} steps", done.report.steps);
    }
    // Real crossings beside it are still met: the sine changes its sign, 1 - cos only touches.
    let model = text("model M\nSf:a(abs(sin(t)) + abs(1 - cos(t))) -> 0:n -> C:c(1)\nn -> R:r(1)\n");
    let report = run(&model, Run { to: 10.0, ..Run::default() }).report;
    assert_eq!(report.jumps, 3, "at pi, 2 pi and 3 pi");
    // A shallow dip is a crossing.
    let model = text("model M\nSf:a(abs(1 + 1e-7 - cos(t)) + abs(cos(t) - 1 + 1e-6)) -> 0:n -> C:c(1)\nn -> R:r(1)\n");
    let report = run(&model, Run { to: 10.0, ..Run::default() }).report;
    assert_eq!(report.jumps, 3, "beside 0, and before and after 2 pi");
    // Rounding everywhere.
    let model = text("model M\nSf:a(1 + abs(sin(t)^2 + cos(t)^2 - 1)) -> 0:n -> C:c(1)\nn -> R:r(1)\n");
    let report = run(&model, Run { to: 1.0, ..Run::default() }).report;
    assert!(report.steps < 1000, "{} steps", report.steps);
}

/// On every model, by every method of variable step: a decade of tolerance takes about as many more steps as the one
/// before, down to 1e-12, and never fewer than a looser one.
#[test]
fn work_follows_the_tolerance() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models");
    let entries = std::fs::read_dir(folder).expect("models/").map(|entry| entry.expect("a folder").path());
    let mut models: Vec<PathBuf> = entries.filter(|path| path.join("reference.json").is_file()).collect();
    models.sort();
    assert!(models.len() >= 30);
    let faults: Vec<String> = models.iter().flat_map(|folder| work_faults(folder)).collect();
    assert!(faults.is_empty(), "{} of {}:\n{}", faults.len(), 3 * models.len(), faults.join("\n"));
}

/// Steps below which the start and jumps decide.
const FEW: usize = 60;

fn work_faults(folder: &Path) -> Vec<String> {
    let model = Model::load(&folder.join("model.bond"), &[]).expect("a model");
    let reference: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(folder.join("reference.json")).expect("a file")).expect("JSON");
    let times = reference["t"].as_array().expect("times");
    let last: f64 = times.last().and_then(|t| t.as_str()?.parse().ok()).expect("a time");
    let inputs = reference["inputs"].as_object().cloned().unwrap_or_default();
    let inputs: Vec<(String, Input)> =
        inputs.iter().map(|(name, file)| (name.clone(), folder.join(file.as_str().expect("a file")).into())).collect();
    let mut faults = Vec::new();
    for method in [Method::Explicit, Method::Bdf, Method::Radau] {
        let steps: Vec<usize> = (6..=12)
            .map(|digits| {
                let run = Run {
                    to: last.min(2.0),
                    rtol: format!("1e-{digits}").parse().expect("a number"),
                    method,
                    inputs: inputs.clone(),
                    record: Record::Names(Vec::new()),
                    ..Run::default()
                };
                model.simulate(&run, &mut |_| true).map_or(0, |done| done.report.steps)
            })
            .collect();
        let growth: Vec<f64> = steps.windows(2).map(|pair| pair[1] as f64 / pair[0].max(1) as f64).collect();
        let straight = growth.windows(2).zip(&steps).all(|(pair, &steps)| {
            let bend = pair[1] / pair[0];
            steps < FEW || (0.6..1.6).contains(&bend)
        });
        let sound = growth.iter().zip(&steps).all(|(growth, &steps)| (0.98..2.2).contains(growth) || steps < FEW);
        if !straight || !sound || steps.contains(&0) {
            faults.push(format!("{} {method:?}: {steps:?}", folder.file_name().expect("a name").to_string_lossy()));
        }
    }
    faults
}

const SPRING: &str = "model Spring\nparam k = 1e6, b = 2\n1:j -> I:m(1)\nj -> C:c(k = k, q0 = 1)\nj -> R:d(b)\n";

#[test]
fn a_step_that_is_too_long_is_told_with_the_state_that_asks_for_less() {
    let model = text(SPRING);
    let advice = |method, step| model.step_advice(Form::Minimal, method, step, Start::Given);
    let said = advice(FixedMethod::Rk4, 0.01).expect("ten radians in a step");
    assert!(said.contains("oscillates with 1000 rad/s") && said.contains("at most 0.0028 s"), "{said}");
    assert_eq!(advice(FixedMethod::Rk4, 1e-3), None);
    assert!(advice(FixedMethod::Rosenbrock, 0.01).is_some_and(|said| said.contains("do not follow")));
    // The same is among the notes of a run, before it is made.
    let mut told = Vec::new();
    let asked = Run { to: 0.02, method: Method::Fixed(FixedMethod::Rk4), step: Some(0.01), ..Run::default() };
    let _ = model.simulate(&asked, &mut |come| {
        told.extend(come.note.map(str::to_string));
        true
    });
    assert!(told.iter().any(|note| note.contains("at most 0.0028 s")), "{told:?}");
    // Stiff: a time constant of a microsecond beside slow ones.
    let stiff = text("model Stiff\nSe:e(1) -> 1:j -> R:r(1)\nj -> 0:n -> C:slow(1)\nj -> I:fast(1e-6)\n");
    let said = stiff.step_advice(Form::Minimal, FixedMethod::Heun, 1e-3, Start::Given).expect("too long");
    assert!(said.contains("fast") && said.contains("time constant of 1e-6 s") && said.contains("rosenbrock"), "{said}");
    assert_eq!(stiff.step_advice(Form::Minimal, FixedMethod::Rosenbrock, 1e-3, Start::Given), None);
}

#[test]
fn what_would_never_end_is_refused_with_its_cost() {
    let base = Run { to: 1.0, ..Run::default() };
    let held = |law: &str| text(&format!("model M\nSe:e(1 - {law}) -> 1:j -> R:r(1)\nj -> C:c(1)\n"));
    let said = refused(&held("delay(c.e, 1e-12)"), base.clone());
    assert!(said.contains("a delay of 1e-12 s") && said.contains("1.0e12 times"), "{said}");
    let said = refused(&held("sample(c.e, 1e-9)"), Run { to: 10.0, ..base.clone() });
    assert!(said.contains("a sampling period of 1e-9 s") && said.contains("1.0e10 times"), "{said}");
    let lossless = text("model Lossless\n1:j -> I:m(1)\nj -> C:c(k = 1, q0 = 1)\n");
    let said = refused(&lossless, Run { to: 1e300, ..base.clone() });
    assert!(said.contains("1.0e300 radians") && said.contains("--to"), "{said}");
    let said = refused(&lossless, Run { to: 1e6, every: Some(1e-8), ..base.clone() });
    assert!(said.contains("1.0e14 points") && said.contains("GB of memory"), "{said}");
    let fixed = Method::Fixed(FixedMethod::Rk4);
    let said = refused(&lossless, Run { to: 1e3, step: Some(1e-9), method: fixed, ..base.clone() });
    assert!(said.contains("1.0e12 steps"), "{said}");
    // What comes to rest may go on as long as it likes.
    let done = run(&held("c.e"), Run { to: 1e12, ..base });
    assert_eq!(done.report.reached, 1e12);
}

/// A road of 2,001 points: its rows are corners, at which slopes change and nothing is evaluated anew; a step in it is a
/// jump.
#[test]
fn rows_of_an_input_are_corners_and_no_jumps() {
    let path = std::env::temp_dir().join(format!("halfarrow_road_{}.csv", std::process::id()));
    let height = |t: f64| 0.02 * libm::sin(7.0 * t) + 0.01 * libm::sin(3.3 * t);
    let mut road = String::from("t,road\n");
    (0..=2000).map(|i| f64::from(i) * 0.005).for_each(|t| road += &format!("{t:?},{:?}\n", height(t)));
    let model = Model::from_text(
        "road.bond",
        "model Road\ninput road = 0\nSe:F(1000*road) -> 1:v -> I:m(1)\nv -> C:s(k = 40)\nv -> R:d(0.8)",
        &[],
    )
    .unwrap_or_else(|e| panic!("{}", e.render(false)));
    let run = |road: &str, method: Method, step: Option<f64>| {
        std::fs::write(&path, road).expect("a file");
        let inputs = vec![("road".to_string(), path.clone().into())];
        let run = Run { to: 10.0, every: Some(0.5), method, step, inputs, ..Run::default() };
        model.simulate(&run, &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false)))
    };
    let explicit = run(&road, Method::Explicit, None);
    let report = &explicit.report;
    assert_eq!((report.jumps, report.corners), (0, 2000));
    assert!(report.steps < 2100 && report.evaluations < 6 * report.steps + 40, "{report:?}");
    let radau = run(&road, Method::Radau, None);
    assert!(radau.report.steps < 2100 && radau.report.evaluations < 6 * radau.report.steps, "{:?}", radau.report);
    let fixed = run(&road, Method::Fixed(FixedMethod::Rk4), Some(1e-3));
    assert_eq!((fixed.report.jumps, fixed.report.corners), (0, 2000));
    for (a, b) in explicit.trace.columns.iter().zip(&radau.trace.columns) {
        let size = a.values.iter().fold(0.0f64, |most, v| most.max(v.abs()));
        let off = a.values.iter().zip(&b.values).fold(0.0f64, |most, (a, b)| most.max((a - b).abs()));
        assert!(off <= 1e-5 * size, "{}: {off} of {size}", a.name);
    }
    // A kerb: two rows at one time.
    let kerb = road.replace("\n5.0,", "\n5.0,0.1\n5.0,");
    let over = run(&kerb, Method::Explicit, None);
    assert_eq!((over.report.jumps, over.report.corners), (1, 1999));
    std::fs::remove_file(&path).expect("it is there");
}

/// Where equations become singular between two steps the trajectory ends, whatever a step that leads across has found.
#[test]
fn no_run_goes_on_behind_a_pole() {
    let fixed = [FixedMethod::Rk4, FixedMethod::Rosenbrock].map(Method::Fixed);
    let methods = [Method::Auto, Method::Bdf, Method::Radau].into_iter().chain(fixed);
    for (name, pole) in [("determinant", 2.0 / 3.0), ("determinant_net", 1.121925)] {
        for method in methods.clone() {
            let step = matches!(method, Method::Fixed(_)).then_some(0.01);
            let asked = Run { to: 6.0, method, step, rtol: 1e-8, ..Run::default() };
            let Err(Error::Run(stopped)) = fault(name).simulate(&asked, &mut |_| true) else {
                panic!("{name} {method:?} goes on");
            };
            let time = stopped.report.reached;
            assert!((time - pole).abs() < 0.011, "{name} {method:?} at {time}: {}", stopped.failure);
        }
    }
}

/// The last values of positions, after other speeds have become independent.
fn after_exchanges(model: &Model, rtol: f64, names: &[&str]) -> Vec<f64> {
    let record = Record::Names(names.iter().map(|n| (*n).into()).collect());
    let done = run(model, Run { to: 0.3, every: Some(0.3), rtol, record, ..Run::default() });
    assert!(done.report.exchanges > 0, "{:?}", done.report);
    assert_eq!(done.report.audit.verdict, Verdict::Holds, "{:?}", done.report.audit);
    let last =
        |name: &&str| *done.trace.columns.iter().find(|c| c.name == **name).expect(name).values.last().expect(name);
    names.iter().map(last).collect()
}

/// Divisors of rows are products of pivots, which are themselves divided by those before them. The values are those of Newton
/// and Euler in maximal coordinates (`multibody/random_trees.py`).
#[test]
fn a_four_bar_goes_on_where_its_independent_speed_turns_back() {
    let found = after_exchanges(&fault("turns_back"), 1e-12, &["j0.q", "j1.q", "j2.q"]);
    for (found, wanted) in found.iter().zip([-0.938181, -0.319575, -1.277230]) {
        assert!((found - wanted).abs() < 6e-7, "{found} is not {wanted}");
    }
}

#[test]
fn a_tighter_tolerance_misses_less_at_a_limit() {
    let model = fault("exchange_at_limit");
    let [rough, fine] = [1e-9, 1e-12].map(|rtol| after_exchanges(&model, rtol, &["j0.q", "j1.q"]));
    for (rough, fine) in rough.iter().zip(&fine) {
        assert!((rough - fine).abs() < 1e-9, "{rough} and {fine}");
    }
}

/// Implicit steps may step over what decays, and the samples leave much open then: half the step tells what they hide. A stop is
/// left faster than it is hit (by 2.6 m/s for 1.7), a damper lets through twenty times what it should.
#[test]
fn what_implicit_steps_of_fixed_length_hide_is_told_by_half_of_them() {
    let by = |name: &str, method: FixedMethod, step: f64| {
        let asked = Run { to: 0.5, method: Method::Fixed(method), step: Some(step), ..Run::default() };
        run(&fault(name), asked).report.audit
    };
    use FixedMethod::{LinearlyImplicitBdf2, Rosenbrock};
    for (name, method, step) in [
        ("one_sided_stop", Rosenbrock, 1.25e-3),
        ("one_sided_stop", LinearlyImplicitBdf2, 1.25e-3),
        ("one_sided_damper", LinearlyImplicitBdf2, 1e-3),
        ("one_sided_damper", Rosenbrock, 1e-2),
    ] {
        let audit = by(name, method, step);
        assert_ne!(audit.verdict, Verdict::Holds, "{name} {method:?}: {audit:?}");
    }
    for name in ["one_sided_stop", "one_sided_damper"] {
        let audit = by(name, Rosenbrock, 2e-5);
        assert!(audit.halved.as_ref().is_none_or(|miss| miss.value < 1e-3), "{name}: {audit:?}");
    }
}

/// A ball on a floor that is left within a step: the second bounce of 13 cm is one of 9 cm, and energy balances of the samples leave
/// all of that open.
#[test]
fn what_explicit_steps_of_fixed_length_hide_is_told_by_half_of_them() {
    let ball = text(
        "model Ball\n1:v -> I:m(0.5)\nstate h' = v.f from 0.3\nSe:w(-4.905) -> v\nlet depth = max(-h, 0)\nSe:floor(max(1e5*depth - 20*v.f*min(depth/1e-4, 1), 0)) -> v\n",
    );
    let by = |step: f64| {
        let method = Method::Fixed(FixedMethod::Rk4);
        run(&ball, Run { to: 2.0, every: Some(2e-3), method, step: Some(step), ..Run::default() }).report.audit
    };
    let audit = by(1e-3);
    assert!(audit.verdict == Verdict::Doubtful && audit.warnings[0].contains("half the step"), "{audit:?}");
    let audit = by(1e-5);
    assert!(audit.verdict == Verdict::Holds, "{audit:?}");
}

/// In a mode in which a crank is held its state stands still beside those of other modes.
#[test]
fn a_state_that_stands_still_in_a_mode_has_no_part_in_equations_and_matrices() {
    let model = fault("friction_in_a_loop");
    let report = model.equations_for(Form::Minimal, &[]).unwrap_or_else(|error| panic!("{}", error.render(false)));
    assert_eq!(report.states.len(), 2, "{:?}", report.states);
    let linear =
        model.linearize(&halfarrow::Linearize::default()).unwrap_or_else(|error| panic!("{}", error.render(false)));
    assert!(linear.outputs.iter().all(|output| !output.name.starts_with("idle")), "{:?}", linear.outputs);
    let kept = run(&model, Run { to: 0.5, ..Run::default() }).report.tolerances;
    assert!(kept.iter().all(|kept| !kept.name.starts_with("idle")), "{kept:?}");
}

/// A shock between two events, which begins and ends at 0 and finds everything at rest: steps that see only their ends missed it
/// as a whole, without a word.
#[test]
fn a_shock_after_rest_is_not_stepped_over() {
    let shock = |t0: f64, more: &str| {
        text(&format!(
            "model Shock
            Se:weight(-40*9.81) -> 1:v -> I:m(40)
            Se:shock(if t > {t0} and t < {t0} + 0.1 then 1000*sin(31.41592653589793*(t - {t0})) else 0) -> v
            v -> C:k(k = 1.7e5)
            v -> R:b(1100)
            {more}"
        ))
    };
    let spans = |done: &Simulated| {
        let values = &done.trace.columns.iter().find(|c| c.name == "k.q").expect("a column").values;
        [values.iter().fold(f64::INFINITY, |a, b| a.min(*b)), values.iter().fold(f64::NEG_INFINITY, |a, b| a.max(*b))]
    };
    let wanted = spans(&run(&shock(0.2, ""), Run { to: 1.0, method: Method::Radau, rtol: 1e-9, ..resting() }));
    assert!(wanted[1] > 5.6e-3, "{wanted:?}");
    let stiff = "Se:u(1) -> 1:el -> R:rr(1)\nel -> C:ce(1e-6)";
    for rtol in [1e-4, 1e-6, 1e-8, 1e-9] {
        for (t0, to, method, more) in [(0.2, 1.0, Method::Bdf, ""), (20.0, 25.0, Method::Auto, stiff)] {
            let found = spans(&run(&shock(t0, more), Run { to, method, rtol, ..resting() }));
            let off = (0..2).map(|k| (found[k] - wanted[k]).abs()).fold(0.0, f64::max);
            assert!(off < 1e-4, "{method:?} at {rtol:e}: {found:?}, not {wanted:?}");
        }
    }
}

fn resting() -> Run {
    Run { start: Start::Equilibrium, record: Record::All, ..Run::default() }
}

/// Half a wave into a coil through a diode: while it blocks, the Jacobian is so steep that any correction is short, and one of
/// them was believed where the diode begins to conduct: half of the pulses were missing, without a word. The reference is the
/// same equation by another program (SciPy's Radau, 1e-8 off).
#[test]
fn a_diode_that_begins_to_conduct_is_not_stepped_over() {
    let half = text(
        "model Half
        Se:ea(100*sin(314*t)) -> 1:l -> I:i(1e-3)
        l -> R:r(1)
        l -> R:d(f = 1e-9*(exp(e/0.02585) - 1) + 1e-5*e)",
    );
    for rtol in [1e-4, 1e-6, 1e-8] {
        for method in [Method::Radau, Method::Bdf] {
            let done = run(&half, Run { to: 0.03, method, rtol, ..Run::default() });
            let end = done.trace.columns.iter().find(|c| c.name == "i.f").and_then(|c| c.values.last()).copied();
            let off = (end.expect("a column") - 28.3817).abs();
            assert!(off < 1e-3 + 10.0 * rtol, "{method:?} at {rtol:e}: off by {off}");
        }
    }
}

/// The same law in words that an engineer may take for it.
const ORIFICES: [&str; 3] = [
    "f = k*sign(e)*sqrt(abs(e))",
    "f = sign(e)*k*sqrt(2)*sqrt(abs(e/2))",
    "f = if e > 0 then k*sqrt(e) else -k*sqrt(-e)",
];

/// Its slope is infinite where the levels meet, and there they stay: `sqrt(e) = sqrt(e0) - k t/c` until then.
#[test]
fn tanks_level_out_through_an_orifice() {
    let (k, c, before) = (3e-5, 1e-4, 15e3_f64);
    for law in ORIFICES {
        let model = text(&format!(
            "model Tanks\nparam k = {k}\n0:n1 -> C:t1(c = {c}, e0 = 20e3)\n0:n2 -> C:t2(c = {c}, e0 = 5e3)\nn1 -> 1:p -> n2\np -> R:o({law})\n"
        ));
        for (method, most) in [(Method::Auto, 200), (Method::Bdf, 250)] {
            let asked = Run {
                to: 1000.0,
                every: Some(100.0),
                method,
                record: Record::Names(vec!["o.e".into()]),
                ..Run::default()
            };
            let done = run(&model, asked);
            assert!(done.report.steps <= most, "{law}, {method:?}: {} steps", done.report.steps);
            let drop = &done.trace.columns.iter().find(|column| column.name == "o.e").expect("it is recorded").values;
            for (hundreds, drop) in drop.iter().enumerate() {
                let root = (before.sqrt() - k * 100.0 * hundreds as f64 / c).max(0.0);
                assert!((drop - root * root).abs() <= 1e-6 * 20e3, "{law}, {method:?}: {drop} at {hundreds}00 s");
            }
        }
    }
}

/// The inverse of a cube: no time constant is left where it goes through 0, driven back and forth, and at rest.
#[test]
fn a_law_of_infinite_slope_is_passed() {
    let rest = text("model Rest\n0:n -> C:c(1, q0 = 1)\nn -> R:r(e = 2*f^3)\n");
    for (model, methods) in
        [(fault("cube_root"), &[Method::Auto, Method::Bdf, Method::Radau][..]), (rest, &[Method::Auto, Method::Bdf])]
    {
        for &method in methods {
            let report = run(&model, Run { to: 4.0, method, ..Run::default() }).report;
            assert!(report.steps <= 1000, "{method:?}: {} steps", report.steps);
            assert_ne!(report.audit.verdict, Verdict::Refused, "{method:?}");
        }
    }
}

/// Levels that are equal from the start move all the same, and a row of tanks comes to rest one after the other.
#[test]
fn tanks_that_are_level_are_filled() {
    for law in ORIFICES {
        let row: String = (1..20)
            .map(|i| {
                format!("0:n{i} -> C:t{i}(c = 1e-4, e0 = 5e3)\nn{i} -> 1:p{i} -> n{}\np{i} -> R:o{i}({law})\n", i + 1)
            })
            .collect();
        let model = text(&format!(
            "model Row\nparam k = 3e-5\n{row}0:n20 -> C:t20(c = 1e-4, e0 = 5e3)\nSf:pump(if t > 100 and t < 300 then 0.5e-3 else 0) -> n1\n"
        ));
        for (method, step, most) in [
            (Method::Auto, None, 1000),
            (Method::Bdf, None, 1500),
            (Method::Fixed(FixedMethod::LinearlyImplicitBdf2), Some(0.25), 20_000),
        ] {
            let record = Record::Names(["t1.e", "t12.e", "t20.e"].map(String::from).to_vec());
            let done = run(&model, Run { to: 4000.0, every: Some(50.0), method, step, record, ..Run::default() });
            assert!(done.report.steps <= most, "{law}, {method:?}: {} steps", done.report.steps);
            for column in &done.trace.columns {
                let (first, last) = (column.values[1], column.values.last().expect("samples"));
                assert!((first - 5e3).abs() <= 1e-3, "{law}, {method:?}: {} at 50 s", first);
                assert!((last - (5e3 + 0.1 / 20.0 / 1e-4)).abs() <= 0.05, "{law}, {method:?}: {} at the end", last);
            }
        }
    }
}

/// A storage beside a jump of a source meets a corner of a law a few roundings later: each sample is on its own side of both.
#[test]
fn two_jumps_may_follow_each_other_by_a_few_roundings() {
    let model = text(
        "model Jumps\nparam k = 3e-5\n0:n1 -> C:t1(c = 1e-4, e0 = 5e3)\n0:n2 -> C:t2(c = 1e-4, e0 = 5e3)\nn1 -> 1:p -> n2\n\
         p -> R:o(f = if abs(e) > 1e-12 then k*e else 2*k*e)\nSf:pump(if t > 100 and t < 200 then 0.5e-3 else 0) -> n1\n",
    );
    let done = run(&model, Run { to: 300.0, method: Method::Bdf, ..Run::default() });
    assert!(done.trace.times.iter().any(|&t| t > 100.0 && t < 100.0 + 1e-12), "the corner is elsewhere");
    assert_eq!(done.report.audit.verdict, Verdict::Holds);
}

/// Where all laws of a net without storages pass their corners together, the iteration goes over them.
#[test]
fn a_net_without_storages_passes_its_corner() {
    let model = text(
        "model Net\nSe:v(3*sin(48*t)) -> 1:c -> R:r1(2)\nc -> 0:n -> R:r2(e = 3*f^3 + f)\nn -> R:r3(e = 2*max(f, 0) + 0.1*f)\n\
         n -> R:r4(f = e^3 + e)\n",
    );
    for (method, step) in [(Method::Auto, None), (Method::Fixed(FixedMethod::Rk4), Some(1e-3))] {
        let done = run(&model, Run { to: 1.0, method, step, ..Run::default() });
        assert_eq!(done.report.audit.verdict, Verdict::Holds, "{method:?}");
    }
}

/// The value at the end of a run, by name.
fn end_of(done: &Simulated, name: &str) -> f64 {
    let column = done.trace.columns.iter().find(|column| column.name == name).unwrap_or_else(|| panic!("{name}"));
    *column.values.last().expect("samples")
}

/// While a valve or a diode blocks, nothing that moves tells how a source swings: steps went over whole pulses, without a word.
/// References by SciPy's Radau with steps of a fraction of a period (3e-7 off).
#[test]
fn pulses_through_valves_and_diodes_are_not_stepped_over() {
    let rectifier = |law: &str| {
        text(&format!(
            "model Rectifier\nSe:v(10*sin(314*t)) -> 1:l -> R:d({law})\nl -> 0:o -> C:c(1e-3)\no -> R:load(1e4)\n"
        ))
    };
    let valve = |law: &str| {
        text(&format!(
            "model Valve\nSe:v(10*sin(7*t)) -> 1:l -> R:d({law})\nl -> 0:o -> C:c(0.2)\no -> R:out(f = 0.02*e)\n"
        ))
    };
    let diode = text(
        "model Diode\nSe:v(10*sin(2*pi*50*t)) -> 1:l -> R:r(1)\nl -> R:d(f = 1e-9*(exp(e/0.02585) - 1))\n\
         l -> 0:o -> C:c(1e-3)\no -> R:load(1e4)\n",
    );
    let pulses = text("model Pulses\nSe:v(sin(2*pi*t)^40) -> 1:l -> R:r(1)\nl -> 0:o -> C:c(10)\n");
    let cases = [
        (rectifier("f = if e > 0 then e else 0"), 2.0, 9.947406),
        (rectifier("f = max(e, 0)"), 2.0, 9.947406),
        (valve("f = 0.5*max(e, 0)"), 8.0, 7.643525),
        (valve("f = max(0.5*e, 0)"), 8.0, 7.643525),
        (diode, 2.0, 9.51068),
        (pulses, 100.0, 0.125352),
    ];
    for (model, to, wanted) in &cases {
        for method in [Method::Auto, Method::Radau, Method::Bdf] {
            for rtol in [1e-6, 1e-9] {
                let record = Record::Names(vec!["c.e".into()]);
                let done = run(model, Run { to: *to, method, rtol, record, ..Run::default() });
                let off = (end_of(&done, "c.e") - wanted).abs() / wanted;
                assert!(off <= 5e-6 + 100.0 * rtol, "{method:?} at {rtol:e}: {off:e} of {wanted}");
            }
        }
    }
}

/// A condition on the sine of an angle may hold many times within a step.
#[test]
fn every_tooth_of_a_wheel_is_counted() {
    for (bearing, to, teeth) in [("", 2.0, 32.0), ("w -> R:b(0.01)\n", 20.0, 289.0)] {
        let model = text(&format!(
            "model Tooth\ndiscrete n = 0\n1:w -> I:j(1, f0 = 10)\n{bearing}state th' = w.f\n\
             when sin(10*th) > 0.95 {{ n = n + 1 }}\noutput count = n\n"
        ));
        for method in [Method::Auto, Method::Radau, Method::Bdf, Method::Explicit] {
            for rtol in [1e-4, 1e-6, 1e-9] {
                let done = run(
                    &model,
                    Run { to, method, rtol, record: Record::Names(vec!["count".into()]), ..Run::default() },
                );
                assert_eq!(end_of(&done, "count"), teeth, "{method:?} at {rtol:e}");
            }
        }
    }
}

/// Nets of resistances that all are flat where nothing flows, driven through it: of a resistance `R` and two side by side the whole is
/// `R + 1/(1 + 1/sqrt(2))^2`.
#[test]
fn nets_of_squares_pass_zero() {
    let parallel = "R:r1(e = f*abs(f))\na -> 0:p -> R:r2(e = f*abs(f))\np -> R:r3(e = 2*f*abs(f))\n";
    for phase in [0.0, 0.5] {
        let model = text(&format!("model Par\nSe:v(sin(t + {phase})) -> 1:a -> {parallel}"));
        for (method, step) in [(Method::Auto, None), (Method::Fixed(FixedMethod::Rk4), Some(0.01))] {
            let asked = Run {
                to: 6.0,
                method,
                step,
                every: Some(0.1),
                record: Record::Names(vec!["r1.f".into()]),
                ..Run::default()
            };
            let done = run(&model, asked);
            let whole = 1.0 + (1.0 + 0.5_f64.sqrt()).powi(-2);
            let flow = &done.trace.columns[0].values;
            for (t, flow) in done.trace.times.iter().zip(flow) {
                let source = (t + phase).sin();
                let wanted = (source.abs() / whole).sqrt().copysign(source);
                assert!((flow - wanted).abs() <= 1e-7, "{method:?}: {flow}, not {wanted}, at {t} s");
            }
        }
    }
}

/// Tanks that level out through resistances which meet without a storage come to rest: at the mean level, where their capacitances
/// are weighed.
#[test]
fn tanks_level_out_through_resistances_in_a_row_and_in_a_star() {
    let row = "a -> 1:p -> 0:m -> 1:q -> 0:b -> C:c2(0.2)\np -> R:o1(e = 100*f*abs(f))\nq -> R:o2(e = 25*f*abs(f))\n";
    let one = "a -> 1:p -> 0:b -> C:c2(0.2)\np -> R:o1(e = 100*f*abs(f))\np -> R:o2(e = 25*f*abs(f))\n";
    let star = "a -> 1:p -> 0:m -> 1:q -> 0:b -> C:c2(0.2)\np -> R:o1(e = 100*f*abs(f))\nq -> R:o2(e = 25*f*abs(f))\n\
                m -> 1:s -> C:c3(0.1)\ns -> R:o3(e = 50*f*abs(f))\n";
    for (net, level) in [(row, 2.0 / 3.0), (one, 2.0 / 3.0), (star, 0.5)] {
        let model = text(&format!("model Net\n0:a -> C:c1(0.1, e0 = 2)\n{net}"));
        for method in [Method::Auto, Method::Bdf] {
            for rtol in [1e-6, 1e-9] {
                let record = Record::Names(vec!["c1.e".into(), "c2.e".into()]);
                let done = run(&model, Run { to: 10.0, method, rtol, record, ..Run::default() });
                assert!(done.report.steps <= 1500, "{method:?} at {rtol:e}: {} steps", done.report.steps);
                for name in ["c1.e", "c2.e"] {
                    assert!((end_of(&done, name) - level).abs() <= 100.0 * rtol, "{method:?} at {rtol:e}: {name}");
                }
            }
        }
    }
}

/// Both forms of a square with a sign are smooth, and no event; what jumps under a root is one.
#[test]
fn squares_are_no_events_and_jumps_under_roots_are() {
    let switches = |law: &str| {
        let model = text(&format!("model Law\n1:v -> I:m(1, f0 = 1)\nv -> C:k(1)\nv -> R:r({law})\n"));
        run(&model, Run { to: 10.0, ..Run::default() }).report.switches
    };
    for square in ["e = 0.1*f*abs(f)", "e = 0.1*sign(f)*f^2", "e = 0.2*f*abs(f)/2 + 0.01*f"] {
        assert_eq!(switches(square), 0, "{square}");
    }
    for jump in ["e = 0.1*f*sqrt(if f > 0 then 1 else 0)", "e = 0.1*sqrt(1 + sign(f))", "e = 0.1*max(f, 0)"] {
        assert!(switches(jump) >= 3, "{jump}: {}", switches(jump));
    }
}

/// A root that is 0 on one side, in an iteration: its slope has no end where the valve closes. The reference is the same by SciPy.
#[test]
fn a_valve_in_an_iteration_closes() {
    let model = text(
        "model Chk\nSe:b(2*sin(3*t + 1)) -> 1:y -> 0:n -> C:c(0.5)\ny -> R:cv(f = sqrt(max(e, 0)))\ny -> R:g(1)\n",
    );
    for (method, step) in [
        (Method::Auto, None),
        (Method::Bdf, None),
        (Method::Radau, None),
        (Method::Fixed(FixedMethod::Rk4), Some(1e-3)),
    ] {
        let done =
            run(&model, Run { to: 6.0, method, step, record: Record::Names(vec!["c.e".into()]), ..Run::default() });
        assert!((end_of(&done, "c.e") - 1.59354).abs() <= 5e-5, "{method:?}: {}", end_of(&done, "c.e"));
    }
    let halves =
        text("model Halves\nSe:s(1 + sin(t)) -> 1:x -> R:o(f = sqrt(max(e, 0)) - sqrt(max(-e, 0)))\nx -> R:r(1)\n");
    run(&halves, Run { to: 6.0, ..Run::default() });
}

/// Edges of pulses that a `when` moves are met by steps of fixed length, wherever they lie. The reference is the sum of exponentials.
#[test]
fn edges_that_events_move_are_met() {
    let model = text(
        "model Pwm\ndiscrete t0 = 0\nwhen every 0.1 ms { t0 = t }\n\
         Se:v(if t - t0 < 4.3e-5 then 12 else 0) -> 1:l -> I:l1(1 mH)\nl -> R:load(5)\n",
    );
    let (period, on, rate, full) = (1e-4_f64, 4.3e-5_f64, 5e3_f64, 12.0_f64 / 5.0);
    let pulse = |i: f64| (full + (i - full) * (-rate * on).exp()) * (-rate * (period - on)).exp();
    let wanted = (0..10).fold(0.0, |i, _| pulse(i));
    for step in [5e-6, 2e-6, 1e-6] {
        let record = Record::Names(vec!["l1.f".into()]);
        let method = Method::Fixed(FixedMethod::Rk4);
        let done = run(&model, Run { to: 1e-3, method, step: Some(step), record, ..Run::default() });
        let off = (end_of(&done, "l1.f") - wanted).abs();
        assert!(off <= 1e-8, "steps of {step} s: {off:e} off {wanted}");
    }
}
