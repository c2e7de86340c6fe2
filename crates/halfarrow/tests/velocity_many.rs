//! Drift from relations that only speeds keep, and positions that are put back, where there is no audit of each step: in
//! sweeps, on lanes and one by one, in runs in the caller's hands and against the clock.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use std::sync::atomic::AtomicBool;

use halfarrow::{
    Column, DriftReport, Execution, FixedMethod, Form, Method, Model, OnMiss, Override, RealTimeRun, Record, Reduce,
    Run, Simulated, Start, Statistics, Sweep, SweepReport, Vary,
};

/// A slider-crank as a textbook draws it: two transformers for either direction, and a guide.
fn slider_crank() -> String {
    let (r, l, theta) = (0.1f64, 0.3f64, 0.3f64);
    let phi = (r / l * theta.sin()).asin();
    format!(
        "model SliderCrank\nparam r = {r} m, l = {l} m, j = 0.002 kg.m2\nstate theta' = w.f from {theta:?} rad\nstate phi' = v.f from {phi:?} rad\n\
         state x' = slide.f from {:?} m\n1:w -> I:crank(j, f0 = 200 rad/s)\n1:v -> I:rod(0.001 kg.m2)\n\
         w -> TF:wx(f_out = -r*sin(theta)) -> 0:along\nv -> TF:vx(f_out = -l*sin(phi)) -> along\nalong -> 1:slide -> I:slider(0.5 kg)\n\
         w -> TF:wy(f_out = r*cos(theta)) -> 0:across\nv -> TF:vy(f_out = -l*cos(phi)) -> across\nacross -> ZC:guide\n",
        r * theta.cos() + l * phi.cos()
    )
}

fn model(text: &str, set: &[Override]) -> Model {
    Model::from_text("test.bond", text, set).unwrap_or_else(|e| panic!("{}\n{text}", e.render(false)))
}

const STATES: [&str; 3] = ["theta", "phi", "x"];
const VARIED: &str = "j=lin(0.001,0.004,19)";

fn sweep(run: &Run, vary: &str) -> Sweep {
    Sweep {
        run: run.clone(),
        vary: vec![Vary::parse(vary).unwrap()],
        samples: None,
        reduce: STATES.iter().map(|name| Reduce::parse(&format!("final({name})")).unwrap()).collect(),
        restart: false,
        units: false,
        part: None,
    }
}

fn swept(model: &Model, sweep: &Sweep) -> (Vec<Column>, SweepReport) {
    model.sweep_columns(sweep, &mut |_, _| true).unwrap_or_else(|e| panic!("{}", e.render(false)))
}

fn alone(text: &str, value: f64, run: &Run) -> Simulated {
    let set = [Override { name: "j".into(), value: format!("{value:?} kg.m2") }];
    let record = Record::Names(STATES.iter().map(ToString::to_string).collect());
    let run = Run { record, ..run.clone() };
    model(text, &set).simulate(&run, &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false)))
}

fn rk4(to: f64, project: bool) -> Run {
    Run { to, method: Method::Fixed(FixedMethod::Rk4), step: Some(5e-4), project, ..Run::default() }
}

fn value(drifts: &[DriftReport], relation: &str) -> f64 {
    drifts.iter().find(|d| d.relation == relation).and_then(|d| d.value).expect("it was measured")
}

#[test]
fn sets_of_a_sweep_drift_and_are_put_back_as_runs_alone() {
    let text = slider_crank();
    let runs = [false, true].map(|project| [rk4(0.3, project), Run { to: 0.3, rtol: 1e-4, project, ..Run::default() }]);
    for run in runs.as_flattened() {
        let (columns, report) = swept(&model(&text, &[]), &sweep(run, VARIED));
        assert_eq!((report.sets, report.failed, report.drift.len()), (19, 0, 2), "{:?}", report.failures);
        let mut greatest = [0.0f64; 2];
        for set in [0, 7, 18] {
            let done = alone(&text, columns[1].values[set], run);
            for (own, name) in done.trace.columns.iter().zip(STATES) {
                let column = columns.iter().find(|c| c.name == format!("final({name})")).expect("a column");
                let last = own.values.last().expect("a sample");
                assert_eq!(column.values[set].to_bits(), last.to_bits(), "{name} of set {set}, {:?}", run.method);
            }
            for (greatest, told) in greatest.iter_mut().zip(&report.drift) {
                let own = value(&done.report.audit.drift, &told.relation).abs();
                let most = told.greatest.expect("it was measured");
                assert!(own <= most + 1e-15, "{own:e} {most:e}");
                if told.set == Some(set + 1) {
                    assert!((own - most).abs() < 1e-15, "{own:e} {most:e}");
                }
                *greatest = greatest.max(most);
            }
        }
        assert_eq!(greatest.iter().all(|g| *g < 1e-14), run.project, "{greatest:?}");
        assert!(report.drift.iter().all(|d| d.kind == "closed" && d.sets == 19), "{:?}", report.drift);
    }
}

/// The file of a sweep that was stopped keeps what its sets have drifted by.
#[test]
fn a_sweep_that_goes_on_tells_the_drift_of_all() {
    let folder = temp_dir::TempDir::new().unwrap();
    let (text, out) = (slider_crank(), folder.path().join("r.csv"));
    let asked = sweep(&rk4(0.05, false), "j=lin(0.001,0.004,70)");
    let whole = swept(&model(&text, &[]), &asked).1;
    assert!(model(&text, &[]).sweep(&asked, &out, &mut |done, _| done == 0).is_err());
    let resumed = model(&text, &[]).sweep(&asked, &out, &mut |_, _| true).unwrap();
    assert!(resumed.resumed > 0 && resumed.resumed < 70, "{}", resumed.resumed);
    assert_eq!(resumed.drift, whole.drift);
}

#[test]
fn a_run_in_the_hands_of_the_caller_tells_its_drift_and_is_put_back() {
    let text = slider_crank();
    for project in [false, true] {
        let done = alone(&text, 0.002, &rk4(0.3, project));
        let compiled = model(&text, &[]).compile(Form::Minimal).unwrap();
        let mut run = compiled.stepper_projecting(FixedMethod::Rk4, 5e-4, Start::Given, project).unwrap();
        run.advance(400).unwrap();
        let saved = run.save();
        for _ in 0..2 {
            run.restore(&saved).unwrap();
            run.advance(200).unwrap();
            for (column, name) in done.trace.columns.iter().zip(STATES) {
                let last = column.values.last().expect("a sample");
                assert_eq!(run.read(name).unwrap().to_bits(), last.to_bits(), "{name} {project}");
            }
            for drift in run.drift() {
                let own = value(&done.report.audit.drift, &drift.relation);
                assert!((own - drift.value.expect("it was measured")).abs() < 1e-15, "{drift:?} {own:e}");
                assert_eq!(own.abs() < 1e-14, project);
            }
        }
    }
}

#[test]
fn a_run_against_the_clock_tells_its_drift_and_is_put_back() {
    let text = slider_crank();
    for project in [false, true] {
        let live = RealTimeRun {
            rate: 2000.0,
            length: Some(0.1),
            method: FixedMethod::Rk4,
            inputs: vec![],
            output: None,
            record: Record::Default,
            start: Start::Given,
            on_miss: OnMiss::CatchUp,
            bound: None,
            project,
            execution: Execution::Bytecode,
        };
        let told = model(&text, &[]).run_real_time(&live, &Statistics::default(), &AtomicBool::new(false)).unwrap();
        let done = alone(&text, 0.002, &rk4(0.1, project));
        assert_eq!((told.error, told.drift.len(), told.projections > 50), (None, 2, project));
        for drift in &told.drift {
            let own = value(&done.report.audit.drift, &drift.relation);
            assert!((own - drift.value.expect("it was measured")).abs() < 1e-15, "{drift:?} {own:e}");
        }
    }
}

/// What has no closed form is refused, and told by the sets that are audited.
#[test]
fn relations_without_a_closed_form_are_told_by_the_sets_that_are_audited() {
    let text = "model Arc\nparam j = 1\nstate theta' = w.f\nstate phi' = bead.f\nstate x' = bead.f\n1:w -> I:wheel(j, f0 = 3)\n\
        w -> TF:arc(f_out = sqrt(1 + 3*sin(theta)^2)) -> 1:bead -> I:mass(0.2)\n";
    let run = Run { step: Some(0.05), ..rk4(5.0, false) };
    let (_, report) = swept(&model(text, &[]), &sweep(&run, "j=lin(1,2,30)"));
    let open: Vec<_> = report.drift.iter().filter(|d| d.kind == "open").collect();
    assert!(
        !open.is_empty() && open.iter().all(|d| d.greatest.is_some() && d.set.is_none() && d.sets == 16),
        "{open:?}"
    );
    let asked = sweep(&Run { project: true, ..run }, "j=lin(1,2,30)");
    let refused = model(text, &[]).sweep_columns(&asked, &mut |_, _| true).expect_err("it is refused");
    assert!(refused.to_string().contains("no closed form"), "{refused}");
}
