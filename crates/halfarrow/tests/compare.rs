//! All forms beside each other: what the table says holds.

use std::path::{Path, PathBuf};

use halfarrow::{Compare, CompareReport, Error, Form, Model, Problem, Row};

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models").join(name)
}

fn load(name: &str) -> Model {
    Model::load(&folder(name).join("model.bond"), &[]).expect("a model")
}

fn compared(name: &str, to: f64) -> CompareReport {
    let compare = Compare { to: Some(to), error: 1e-4, repeats: 1, ..Compare::default() };
    load(name).compare(&compare, &mut |_, _| true).expect("a table")
}

fn row(report: &CompareReport, form: Form) -> &Row {
    report.rows.iter().find(|row| row.form == form).expect("a row")
}

#[test]
fn every_form_has_a_row_whose_numbers_hold() {
    let report = compared("pendulum", 2.0);
    let model = load("pendulum");
    assert!(report.reference.as_ref().is_some_and(|r| r.confirmed_to < 1e-9), "{:?}", report.reference);
    let forms: Vec<&str> = report.rows.iter().map(|row| row.form.name()).collect();
    assert_eq!(forms, ["minimal", "kane", "inverted", "break", "relaxed", "lagrange", "stiff"]);
    for row in &report.rows {
        let equations = model.equations(row.form).expect("equations");
        let counts = (equations.counts.differential, equations.counts.algebraic, equations.index);
        assert_eq!((row.differential, row.algebraic, row.index), (Some(counts.0), Some(counts.1), Some(counts.2)));
        assert_eq!(row.reason, None, "{}", row.form);
        assert!(row.flops.is_some_and(|n| n > 0) && row.steps.is_some_and(|n| n > 0), "{}", row.form);
        assert!(row.seconds_per_second.is_some_and(|s| s > 0.0), "{}", row.form);
        if row.form != Form::Stiff {
            assert!(
                row.max_error.is_some_and(|e| e < 1e-8),
                "{}: {:?} {:?}",
                row.form,
                row.max_error,
                row.max_error_in
            );
        }
        // Runs at tighter tolerances are more exact: three decades of tolerance are at least one of error.
        let exact = |solver: &str| row.runs.iter().filter(|r| r.solver == solver).map(|r| r.error).collect::<Vec<_>>();
        for solver in ["explicit", "bdf", "radau"] {
            let errors = exact(solver);
            for pair in errors.iter().zip(errors.iter().skip(3)).filter(|_| row.form != Form::Stiff) {
                assert!(pair.1 < &(0.1 * pair.0), "{} {solver}: {errors:?}", row.form);
            }
        }
    }
    // An explicit equation of one speed takes fewer operations than five equations.
    assert!(row(&report, Form::Minimal).flops < row(&report, Form::Break).flops);
    assert_eq!(row(&report, Form::Minimal).times_minimal, Some(1.0));
}

#[test]
fn stiff_springs_converge_with_order_one() {
    let report = compared("pendulum", 2.0);
    let stiff = row(&report, Form::Stiff);
    let order = stiff.order.expect("an order");
    assert!((0.9..1.1).contains(&order), "{order}: {:?}", stiff.convergence);
    assert!(stiff.convergence.len() > 3);
}

#[test]
fn a_form_that_does_not_apply_says_why() {
    let report = compared("gearbox_ratio", 0.5);
    for row in report.rows.iter().filter(|row| row.differential.is_none()) {
        assert!(row.reason.as_ref().is_some_and(|reason| reason.len() > 10), "{}: {:?}", row.form, row.reason);
    }
    let json = serde_json::to_value(&report).expect("JSON");
    let first = &json["rows"][0];
    for field in ["form", "differential", "algebraic", "index", "flops", "seconds_per_second", "max_error"] {
        assert!(!first[field].is_null(), "{field}");
    }
    assert!(report.plot().svg.contains("minimal ("));
}

#[test]
fn jumps_and_switches_are_met_by_all_forms() {
    let report = compared("source_jumps", 1.0);
    for row in report.rows.iter().filter(|row| row.differential.is_some() && row.form != Form::Stiff) {
        assert!(row.max_error.is_some_and(|e| e < 1e-8), "{}: {:?} {:?}", row.form, row.max_error, row.max_error_in);
    }
}

#[test]
fn options_without_sense_are_refused() {
    let model = load("class2");
    for compare in [Compare { to: Some(-1.0), ..Compare::default() }, Compare { error: 2.0, ..Compare::default() }] {
        let refused = model.compare(&compare, &mut |_, _| true);
        assert!(matches!(refused, Err(Error::Usage(Problem::BadOption { .. }))));
    }
}
