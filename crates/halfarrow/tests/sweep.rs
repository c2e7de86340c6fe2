//! Sweeps: rows in order, the same as runs alone, kept over an interruption, failures by row.

use std::path::Path;

use halfarrow::{
    Column, FixedMethod, Form, Method, Model, Override, Part, Record, Reduce, Run, Samples, Sweep, SweepReport, Vary,
};

const MODEL: &str = "model Oscillator\nparam k = 4 N/m, load = 1 kg, b = 0.1 N.s/m\nconst g = 9.81 m/s2\n1:a -> I:mass(load)\na -> C:spring(k = k, q0 = 10 cm)\na -> R:damper(b)\noutput x = spring.q : mm\n";

fn model() -> Model {
    Model::from_text("oscillator.bond", MODEL, &[]).expect("a model")
}

fn sweep(method: Method) -> Sweep {
    let reduce = ["max(x)", "final(mass.f)", "rms(x)"].map(|text| Reduce::parse(text).expect("a reduction"));
    Sweep {
        run: Run { to: 1.0, method, step: Some(0.01), ..Run::default() },
        vary: vec![Vary::parse("k=lin(1,9,9)").unwrap(), Vary::parse("b=log(0.01,1,10)").unwrap()],
        samples: None,
        reduce: reduce.to_vec(),
        restart: false,
        units: false,
        part: None,
    }
}

fn run(model: &Model, sweep: &Sweep, out: &Path) -> SweepReport {
    model.sweep(sweep, out, &mut |_, _| true).unwrap_or_else(|e| panic!("{}", e.render(false)))
}

fn rows(path: &Path) -> (Vec<String>, Vec<Vec<f64>>) {
    let text = std::fs::read_to_string(path).expect("a file");
    let mut lines = text.lines();
    let header = lines.next().expect("a header").split(',').map(str::to_string).collect();
    (header, lines.map(|line| line.split(',').map(|f| f.parse().expect("a number")).collect()).collect())
}

#[test]
fn rows_are_those_of_runs_alone() {
    let folder = temp_dir::TempDir::new().unwrap();
    for method in [Method::Fixed(FixedMethod::Rk4), Method::Fixed(FixedMethod::ImplicitMidpoint), Method::Auto] {
        let (model, sweep, out) = (model(), sweep(method), folder.path().join("r.csv"));
        let report = run(&model, &sweep, &out);
        assert_eq!((report.sets, report.failed, report.resumed), (90, 0, 0));
        let (header, rows) = rows(&out);
        assert_eq!(header, ["set", "k", "b", "max(x)", "rms(x)", "final(mass.f)", "failed"]);
        assert_eq!(header, report.columns);
        for (i, row) in rows.iter().enumerate() {
            assert_eq!((row[0], row[6]), ((i + 1) as f64, 0.0));
        }
        assert_eq!((rows[0][1], rows[9][1], rows[10][1], rows[89][1]), (1.0, 1.0, 2.0, 9.0));
        assert_eq!((rows[0][2], rows[9][2]), (0.01, 1.0));
        let row = &rows[47];
        let set = |name: &str, value: f64| Override { name: name.into(), value: format!("{value:?}") };
        let alone = Model::from_text("oscillator.bond", MODEL, &[set("k", row[1]), set("b", row[2])]).unwrap();
        let record = Record::Names(vec!["x".into(), "mass.f".into()]);
        let trace = alone.simulate(&Run { record, ..sweep.run.clone() }, &mut |_| true).unwrap().trace;
        let greatest = trace.columns[0].values.iter().copied().fold(f64::MIN, f64::max);
        let last = *trace.columns[1].values.last().unwrap();
        // Values in the declared unit, mm, are rounded once more.
        assert!((row[3] - greatest).abs() <= 1e-13 * greatest && (row[5] - last).abs() <= 1e-12, "{row:?} {last}");
    }
}

#[test]
fn an_interrupted_sweep_goes_on() {
    let folder = temp_dir::TempDir::new().unwrap();
    let (model, sweep) = (model(), sweep(Method::Fixed(FixedMethod::Heun)));
    let (whole, parts) = (folder.path().join("whole.parquet"), folder.path().join("parts.parquet"));
    run(&model, &sweep, &whole);
    let stopped = model.sweep(&sweep, &parts, &mut |done, _| done == 0);
    assert!(stopped.is_err() && !parts.exists());
    assert!(folder.path().join("parts.parquet.partial").exists());
    let report = run(&model, &sweep, &parts);
    assert!(report.resumed > 0 && report.resumed < 90, "{}", report.resumed);
    assert_eq!(std::fs::read(&whole).unwrap(), std::fs::read(&parts).unwrap(), "to the last byte");
    assert!(!folder.path().join("parts.parquet.partial").exists());
}

#[test]
fn sets_that_fail_are_told_by_row() {
    let folder = temp_dir::TempDir::new().unwrap();
    let (model, out) = (model(), folder.path().join("r.csv"));
    let table = folder.path().join("sets.csv");
    std::fs::write(&table, "load,k\n1 kg,4\n0,4\n500 g,-4\n").unwrap();
    let sweep =
        Sweep { samples: Some(Samples::read(&table).unwrap()), vary: vec![], ..sweep(Method::Fixed(FixedMethod::Rk4)) };
    let report = run(&model, &sweep, &out);
    let (_, rows) = rows(&out);
    assert_eq!(rows.iter().map(|row| row[1]).collect::<Vec<_>>(), [1.0, 0.0, 0.5]);
    assert_eq!(rows.iter().map(|row| row[6]).collect::<Vec<_>>(), [0.0, 1.0, 0.0]);
    assert!(rows[1][3].is_nan());
    assert_eq!((report.failed, report.failures[0].set), (1, 2));
    assert!(report.failures[0].reason.contains("mass"), "{}", report.failures[0].reason);
}

#[test]
fn what_makes_no_sense_is_refused() {
    let folder = temp_dir::TempDir::new().unwrap();
    let (model, out) = (model(), folder.path().join("r.csv"));
    let with = |vary: &str| Sweep { vary: vec![Vary::parse(vary).unwrap()], ..sweep(Method::Fixed(FixedMethod::Rk4)) };
    for (sweep, says) in [
        (with("q=lin(1,2,3)"), "no parameter `q`"),
        (with("g=lin(1,2,3)"), "constant"),
        (Sweep { vary: vec![], ..with("k=list(1)") }, "nothing varies"),
        (Sweep { reduce: vec![Reduce::parse("max(mas.f)").unwrap()], ..with("k=list(1)") }, "mas.f"),
        (Sweep { run: Run { to: -1.0, ..with("k=list(1)").run }, ..with("k=list(1)") }, "to"),
    ] {
        let error = model.sweep(&sweep, &out, &mut |_, _| true).expect_err(says).to_string();
        assert!(error.contains(says), "{error}");
    }
}

#[test]
fn columns_in_memory_are_those_of_the_file() {
    let folder = temp_dir::TempDir::new().unwrap();
    let (model, sweep, out) = (model(), sweep(Method::Fixed(FixedMethod::Rk4)), folder.path().join("r.csv"));
    let written = run(&model, &sweep, &out);
    let (columns, report) = model.sweep_columns(&sweep, &mut |_, _| true).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(report, written);
    let (header, rows) = rows(&out);
    assert_eq!(columns.iter().map(|c| c.name.as_str()).collect::<Vec<_>>(), header);
    for (i, row) in rows.iter().enumerate() {
        assert!(columns.iter().zip(row).all(|(column, value)| column.values[i].to_bits() == value.to_bits()));
    }
}

fn bits(columns: &[Column]) -> Vec<(String, String, Vec<u64>)> {
    let of = |c: &Column| (c.name.clone(), c.unit.clone(), c.values.iter().map(|v| v.to_bits()).collect());
    columns.iter().map(of).collect()
}

#[test]
fn parts_of_a_sweep_are_the_whole_one() {
    let model = model();
    let compiled = model.compile(Form::Minimal).expect("equations");
    for method in [Method::Fixed(FixedMethod::Rk4), Method::Auto] {
        let sweep = Sweep { vary: vec![Vary::parse("k=list(-1,1,2,3,4,5,6,7,8,9)").unwrap()], ..sweep(method) };
        let (whole, report) = model.sweep_columns(&sweep, &mut |_, _| true).expect("rows");
        for size in [1, 3, 10] {
            let mut columns: Vec<Column> = Vec::new();
            let (mut audited, mut misses) = (0, Vec::new());
            for (first, values) in sweep.vary[0].values.chunks(size).enumerate() {
                let samples = Samples { names: vec!["k".into()], rows: values.iter().map(|&v| vec![v]).collect() };
                let part = Part { first: first * size, of: 10 };
                let sweep = Sweep { vary: Vec::new(), samples: Some(samples), part: Some(part), ..sweep.clone() };
                let table = compiled.sweep(&sweep, &mut |_, _| true).expect("rows");
                assert!(table.complete);
                audited += table.report.audit.sets;
                misses.extend(table.report.audit.misses);
                match columns.is_empty() {
                    true => columns = table.columns,
                    false => columns.iter_mut().zip(table.columns).for_each(|(c, more)| c.values.extend(more.values)),
                }
            }
            assert_eq!(bits(&columns), bits(&whole), "{method:?} in parts of {size}");
            assert_eq!((audited, misses), (report.audit.sets, report.audit.misses.clone()));
        }
        let outside = Sweep { part: Some(Part { first: 1, of: 10 }), ..sweep };
        assert!(compiled.sweep(&outside, &mut |_, _| true).is_err(), "ten sets from the second on are eleven");
    }
}

#[test]
fn a_compiled_model_sweeps_with_what_was_set() {
    let sweep = Sweep { vary: vec![Vary::parse("k=list(1,4)").unwrap()], ..sweep(Method::Fixed(FixedMethod::Rk4)) };
    let mut compiled = model().compile(Form::Minimal).expect("equations");
    compiled.set("load", compiled.quantity("load", "2500 g").expect("a mass")).expect("a parameter");
    let set = [Override { name: "load".into(), value: "2.5 kg".into() }];
    let heavy = Model::from_text("oscillator.bond", MODEL, &set).expect("a model");
    let table = compiled.sweep(&sweep, &mut |_, _| true).expect("rows");
    assert_eq!(bits(&table.columns), bits(&heavy.sweep_columns(&sweep, &mut |_, _| true).expect("rows").0));
    for (text, why) in [("3 s", "measures something else than kg"), ("much", "write a number")] {
        let refused = compiled.quantity("load", text).expect_err("no mass").to_string();
        assert!(refused.contains(why), "{refused}");
    }
}

#[test]
fn a_sweep_in_memory_that_is_stopped_keeps_what_is_done() {
    let sweep = Sweep { vary: vec![Vary::parse("k=lin(1,9,5000)").unwrap()], ..sweep(Method::Fixed(FixedMethod::Rk4)) };
    let compiled = model().compile(Form::Minimal).expect("equations");
    let table = compiled.sweep(&sweep, &mut |done, _| done < 100).expect("what is done");
    let done = table.columns[0].values.len();
    assert!(!table.complete && (100..5000).contains(&done), "{done} sets");
    assert_eq!((table.report.sets, table.report.audit.sets), (5000, 0));
    let k = |set: f64| 1.0 + (set - 1.0) / 4999.0 * 8.0;
    assert!(
        table.columns[0]
            .values
            .iter()
            .zip(&table.columns[1].values)
            .all(|(&set, &found)| (k(set) - found).abs() < 1e-12)
    );
}
