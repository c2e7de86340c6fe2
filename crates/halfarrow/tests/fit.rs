//! Fits: what made the data is found again, start values too; what the data do not tell is told.

use std::fmt::Write as _;

use halfarrow::{Error, Fit, FitParameter, FitReport, Model, Run};
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
    model.fit(&Fit { run, data, outputs, sigma: Vec::new(), parameters, tolerance: 1e-12 }, &mut |_| true)
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
    let fit = Fit { run, data, outputs, sigma: vec![("travel".into(), 0.1)], parameters, tolerance: 1e-12 };
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
