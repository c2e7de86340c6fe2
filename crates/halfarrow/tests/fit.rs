//! Fits: what made the data is found again, start values too; what the data do not tell is told.

use std::fmt::Write as _;

use halfarrow::{Error, Fit, FitParameter, FitReport, Input, Loss, Model, Run, Sigma};
use temp_dir::TempDir;

const CAR: &str = "model Car
param m = 300 kg, k = 18 kN/m, b = 900 N.s/m, q0 = 50 mm
Se:push(if t < 0.3 s then 200 N else 0 N) -> 1:c -> I:body(m)
c -> C:spring(k = k, q0 = q0)
c -> R:damper(b)
output travel = spring.q : mm
";

/// Data of a run with other parameters.
fn data(folder: &TempDir, set: &[(&str, f64)], unit: &str) -> std::path::PathBuf {
    let model = Model::from_text("car.bond", CAR, &[]).expect("a model");
    let mut compiled = model.compile(halfarrow::Form::Minimal).expect("equations");
    compiled.set_all(set.iter().copied()).expect("values");
    let run = Run { to: 2.0, every: Some(0.05), rtol: 1e-11, ..Run::default() };
    let trace = compiled.simulate(&run, &mut |_| true).expect("a run").trace;
    let travel = &trace.columns.iter().find(|c| c.name == "travel").expect("recorded").values;
    let factor = if unit == "m" { 1e-3 } else { 1.0 };
    let mut text = format!("t,z\ns,{unit}\n");
    for (t, z) in trace.times.iter().zip(travel) {
        writeln!(text, "{t},{}", factor * z).expect("text");
    }
    let path = folder.child("data.csv");
    std::fs::write(&path, text).expect("a file");
    path
}

fn fitted(data: std::path::PathBuf, parameters: &[&str]) -> Result<FitReport, Error> {
    let model = Model::from_text("car.bond", CAR, &[]).expect("a model");
    let parameters = parameters.iter().map(|text| FitParameter::parse(text)).collect::<Result<_, _>>()?;
    let run = Run { to: f64::INFINITY, rtol: 1e-10, ..Run::default() };
    let outputs = vec![("travel".to_string(), "z".to_string())];
    model.fit(&Fit { run, data: vec![data], outputs, parameters, tolerance: 1e-12, ..Fit::default() }, &mut |_| true)
}

#[test]
fn what_made_the_data_is_found() {
    let folder = TempDir::new().expect("a folder");
    for unit in ["mm", "m"] {
        let data = data(&folder, &[("k", 25e3), ("b", 1500.0), ("q0", 0.03)], unit);
        let report = fitted(data, &["k=5 kN/m:50 kN/m", "b", "spring.q(0)", "body.f(0)=-1:1"]).expect("a fit");
        assert!(report.success && report.rank == 4 && report.unidentified.is_empty(), "{report:?}");
        for (estimate, exact) in report.parameters.iter().zip([25e3, 1500.0, 0.03, 0.0]) {
            assert!((estimate.value - exact).abs() < 1e-5 * exact.abs().max(1e-2), "{estimate:?} for {exact}");
            assert!(estimate.error.is_some_and(|error| error < 1e-4 * exact.abs().max(1.0)), "{estimate:?}");
        }
        assert_eq!(report.parameters[2].unit.as_deref(), Some("m"));
        assert!(report.jacobians < report.evaluations && report.evaluations < 60);
    }
}

#[test]
fn what_the_data_do_not_tell_is_told() {
    let folder = TempDir::new().expect("a folder");
    let text = CAR.replace("200 N else", "0*200 N else");
    let model = Model::from_text("car.bond", &text, &[]).expect("a model");
    let data = data(&folder, &[("k", 25e3)], "mm");
    // Without a load only ratios count.
    let parameters = ["k", "b", "m"].map(|name| FitParameter { name: name.into(), bounds: None }).to_vec();
    let run = Run { to: 2.0, rtol: 1e-10, ..Run::default() };
    let outputs = vec![("travel".to_string(), "z".to_string())];
    let sigma = vec![("travel".into(), Sigma::Number(0.1))];
    let fit = Fit { run, data: vec![data], outputs, sigma, parameters, tolerance: 1e-12, ..Fit::default() };
    let report = model.fit(&fit, &mut |_| true).expect("a fit");
    assert!(report.rank == 2 && report.variance == 1.0 && report.parameters.iter().all(|p| p.error.is_none()));
    let shares: Vec<f64> = report.unidentified[0].iter().map(|share| share.1).collect();
    assert!(shares.len() == 3 && shares.iter().all(|s| (s - 1.0 / 3.0f64.sqrt()).abs() < 1e-3), "{shares:?}");
}

#[test]
fn what_cannot_be_fitted_is_refused() {
    let folder = TempDir::new().expect("a folder");
    let refused = |parameters: &[&str]| {
        let error = fitted(data(&folder, &[], "mm"), parameters).expect_err("refused");
        error.to_string()
    };
    assert!(refused(&[]).contains("what is fitted"));
    assert!(refused(&["kk"]).contains("kk"));
    assert!(refused(&["k=3"]).contains("no bounds"));
    assert!(refused(&["k=3:1"]).contains("bounds 3 and 1"));
    assert!(refused(&["damper.f(0)"]).contains("neither an integrated signal nor"));
    assert!(refused(&["spring.e(0)"]).contains("take that"));
    let kg = data(&folder, &[], "kg");
    assert!(matches!(fitted(kg, &["k"]), Err(Error::Usage(_))));
}

const PUSHED: &str = "model Car
param m = 300 kg, k = 18 kN/m, b = 900 N.s/m
input push : N = 0
Se:push_(push) -> 1:c -> I:body(m)
c -> C:spring(k = k)
c -> R:damper(b)
output travel = spring.q : mm
";

/// Data of runs with `k = 25 kN/m`, `b = 1500 N.s/m`: the push, the travel with noise, its deviation.
fn pushed(folder: &TempDir, name: &str, push: f64, blunder: bool) -> std::path::PathBuf {
    let model = Model::from_text("car.bond", PUSHED, &[]).expect("a model");
    let mut compiled = model.compile(halfarrow::Form::Minimal).expect("equations");
    compiled.set_all([("k", 25e3), ("b", 1500.0)]).expect("values");
    let times: Vec<f64> = (0..81).map(|i| 0.025 * f64::from(i)).collect();
    let force: Vec<f64> = times.iter().map(|t| push * (1.0 + libm::sin(7.0 * t))).collect();
    let input = Input::Series { times: times.clone(), values: force.clone() };
    let run = Run { to: 2.0, at: times, rtol: 1e-11, inputs: vec![("push".into(), input)], ..Run::default() };
    let trace = compiled.simulate(&run, &mut |_| true).expect("a run").trace;
    let travel = &trace.columns.iter().find(|c| c.name == "travel").expect("recorded").values;
    let (mut state, mut text) = (17u64, "t,f,z,s\n".to_string());
    for (i, ((t, z), f)) in trace.times.iter().zip(travel).zip(&force).enumerate() {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        let noise = 0.05 * ((state >> 11) as f64 / (1u64 << 52) as f64 - 1.0);
        let off = if blunder && i % 20 == 7 { 30.0 } else { 0.0 };
        writeln!(text, "{t},{f},{},{}", z + noise + off, 0.03 + 0.001 * i as f64).expect("text");
    }
    let path = folder.child(name);
    std::fs::write(&path, text).expect("a file");
    path
}

fn of_pushes(data: Vec<std::path::PathBuf>, more: Fit) -> Result<FitReport, Error> {
    let model = Model::from_text("car.bond", PUSHED, &[]).expect("a model");
    let parameters = ["k=5 kN/m:80 kN/m", "b"].map(|text| FitParameter::parse(text).expect("a parameter")).to_vec();
    let columns = vec![("push".to_string(), "f".to_string())];
    let outputs = vec![("travel".to_string(), "z".to_string())];
    model.fit(&Fit { data, columns, outputs, parameters, ..more }, &mut |_| true)
}

#[test]
fn several_runs_are_fitted_at_once_with_inputs_from_their_files() {
    let folder = TempDir::new().expect("a folder");
    let data = vec![pushed(&folder, "a.csv", 100.0, false), pushed(&folder, "b.csv", 300.0, false)];
    let sigma = vec![("travel".to_string(), Sigma::Column("s".into()))];
    let both = of_pushes(data.clone(), Fit { sigma, starts: 5, profiles: vec!["k".into()], ..Fit::default() });
    let both = both.expect("a fit");
    assert_eq!((both.measurements, both.variance, both.starts.len()), (162, 1.0, 5));
    let one = of_pushes(data[..1].to_vec(), Fit::default()).expect("a fit");
    for (estimate, exact) in both.parameters.iter().zip([25e3, 1500.0]) {
        let error = estimate.error.expect("it is told");
        assert!((estimate.value - exact).abs() < 3.0 * error, "{estimate:?}");
        let (low, high) = estimate.interval.expect("it is told");
        assert!((high - low - 2.0 * 1.959_963_984_540_054 * error).abs() < 1e-9 * error);
    }
    assert!(one.parameters[0].error > both.parameters[0].error);
    // All searches come to the same place, from wherever they begin.
    assert!(both.starts.iter().all(|s| s.cost.is_some_and(|cost| (cost - both.cost).abs() < 1e-6 * both.cost)));
    // Nearly linear: the profile is the parabola of the standard error.
    let (profile, k) = (&both.profiles[0], &both.parameters[0]);
    let (low, high) = profile.interval;
    let (a, b) = k.interval.expect("it is told");
    let near = |x: f64, y: f64| (x - y).abs() < 0.03 * (b - a);
    assert!(near(low.expect("crossed"), a) && near(high.expect("crossed"), b), "{profile:?} {k:?}");
    assert!(profile.values.is_sorted() && profile.sums.iter().all(|sum| *sum >= both.cost * (1.0 - 1e-9)));
    // What is left over is what the sum is made of, but for the errors of runs.
    let left = both.runs.iter().flat_map(|run| &run.measured.columns[1].values).map(|r| r * r).sum::<f64>();
    assert!((left - both.cost).abs() < 1e-6 * both.cost);
}

#[test]
fn blunders_count_less_by_a_robust_loss() {
    let folder = TempDir::new().expect("a folder");
    let data = vec![pushed(&folder, "a.csv", 100.0, true)];
    let sigma = || vec![("travel".to_string(), Sigma::Number(0.05))];
    let off = |loss: Loss, scale: f64| {
        let fit = Fit { sigma: sigma(), loss: (loss, scale), ..Fit::default() };
        let report = of_pushes(data.clone(), fit).expect("a fit");
        (report.parameters[0].value / 25e3 - 1.0).abs()
    };
    let linear = off(Loss::Linear, 1.0);
    // Blunders are of 600 deviations. Where no residual counts more than a bound, those at the first guess have to count.
    for (loss, scale) in [(Loss::SoftL1, 1.0), (Loss::Huber, 1.0), (Loss::Cauchy, 1.0), (Loss::Arctan, 100.0)] {
        assert!(off(loss, scale) < 0.05 * linear, "{loss:?}: {} beside {linear}", off(loss, scale));
    }
}

#[test]
fn what_is_no_experiment_is_refused() {
    let folder = TempDir::new().expect("a folder");
    let data = vec![pushed(&folder, "a.csv", 100.0, false)];
    let refused = |more: Fit| of_pushes(data.clone(), more).expect_err("refused").to_string();
    let sigma = |name: &str, of: Sigma| vec![(name.to_string(), of)];
    assert!(refused(Fit { sigma: sigma("z", Sigma::Number(1.0)), ..Fit::default() }).contains("is not compared"));
    let column = refused(Fit { sigma: sigma("travel", Sigma::Column("w".into())), ..Fit::default() });
    assert!(column.contains("there is no column `w`; there are f, s, z"), "{column}");
    assert!(refused(Fit { profiles: vec!["m".into()], ..Fit::default() }).contains("not fitted"));
    assert!(refused(Fit { loss: (Loss::Huber, 0.0), ..Fit::default() }).contains("scale of the loss"));
}
