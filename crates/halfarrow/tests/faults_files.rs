//! Tables that are read: their units, their faults; and what is odd about a model, told where a user sees it.

use std::path::{Path, PathBuf};

use halfarrow::{Error, Model, Run, Simulated, csv_text, read_trace, write_csv};

const ROAD: &str = "model Road
input road : cm = 0
Sf:ground(10*road/(1 s)) -> 0:tyre -> C:k(k = 2000 N/m)
tyre -> 1:body -> I:m(3 kg)
body -> R:d(40 N.s/m)
output y = k.q : mm
output force = k.e : kN";

/// A file for one test, away when that is over.
struct Table(PathBuf);

impl Table {
    fn new(name: &str, text: &str) -> Table {
        let path = std::env::temp_dir().join(format!("halfarrow_{name}_{}.csv", std::process::id()));
        std::fs::write(&path, text).expect("a file");
        Table(path)
    }
}

impl Drop for Table {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

fn model(text: &str) -> Model {
    Model::from_text("test.bond", text, &[]).unwrap_or_else(|e| panic!("{}", e.render(false)))
}

fn run_with(model: &Model, path: &Path) -> Result<Simulated, Error> {
    let inputs = vec![("road".to_string(), path.into())];
    model.simulate(&Run { to: 0.4, every: Some(0.02), inputs, ..Run::default() }, &mut |_| true)
}

fn run(name: &str, text: &str) -> Vec<Vec<f64>> {
    let table = Table::new(name, text);
    let done = run_with(&model(ROAD), &table.0).unwrap_or_else(|e| panic!("{}", e.render(false)));
    done.trace.columns.into_iter().map(|c| c.values).collect()
}

fn refused(name: &str, text: &str) -> String {
    let table = Table::new(name, text);
    match run_with(&model(ROAD), &table.0) {
        Err(error @ Error::Usage(_)) => error.render(false),
        other => panic!("{:?}", other.map(|done| done.report)),
    }
}

#[test]
fn an_input_is_in_the_unit_that_its_file_says() {
    let plain = run("plain", "t,road\n0,0\n0.1,2\n0.3,-1\n");
    assert!(plain.iter().any(|column| column.iter().any(|v| v.abs() > 1e-6)));
    // 0.1 s is a float that milliseconds meet to rounding.
    for (name, table) in [
        ("same", "t,road\ns,cm\n0,0\n0.1,2\n0.3,-1\n"),
        ("unsaid", "t,road\ns,\n0,0\n0.1,2\n0.3,-1\n"),
        ("milli", "t,road\nms,mm\n0,0\n100,20\n300,-10\n"),
    ] {
        for (a, b) in run(name, table).iter().zip(&plain) {
            let size = b.iter().fold(0.0f64, |most, v| most.max(v.abs()));
            assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-9 * size), "{name}: {a:?}, not {b:?}");
        }
    }
}

#[test]
fn what_measures_something_else_is_refused() {
    let told = refused("force", "t,road\ns,N\n0,0\n1,1\n");
    assert!(told.contains("line 2: `road` is in N here and in cm in the model"), "{told}");
    // What is declared without a unit has that of its value, in SI.
    let undeclared = ROAD.replace("road : cm = 0", "road = 0 m");
    let table = Table::new("undeclared", "t,road\ns,N\n0,0\n1,1\n");
    let told = run_with(&model(&undeclared), &table.0).expect_err("newtons").render(false);
    assert!(told.contains("`road` is in N here and in m in the model"), "{told}");
    assert!(refused("time", "t,road\nm,cm\n0,0\n1,1\n").contains("line 2: the time is in m"));
    assert!(
        refused("none", "t,road\ns,furlong\n0,0\n1,1\n").contains("`furlong` of `road` is neither a number nor a unit")
    );
    // A number in it: no line of units.
    assert!(refused("number", "t,road\ns,1\n0,0\n1,1\n").contains("line 2: 's' in column 't' is not a finite number"));
}

#[test]
fn a_run_that_was_written_with_units_is_read_in_those_of_another() {
    let table = Table::new("again", "t,road\n0,0\n0.1,2\n0.3,-1\n");
    let done = run_with(&model(ROAD), &table.0).unwrap_or_else(|e| panic!("{}", e.render(false)));
    let written = Table::new("written", "");
    write_csv(&done.trace, &written.0, true).expect("it can be written");
    let again = read_trace(&written.0, &done.trace).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(again.times, done.trace.times);
    for column in &again.columns {
        let own = done.trace.columns.iter().find(|c| c.name == column.name).expect("the same columns");
        assert_eq!(column.unit, own.unit);
        assert!(column.values.iter().zip(&own.values).all(|(a, b)| (a - b).abs() <= 1e-12 * b.abs()), "{}", own.name);
    }
    // The same in other units, and something else under one of its names.
    let text = csv_text(&done.trace, true);
    let factor = |unit: &str| if unit == "mm" { 1e-3 } else { 1.0 };
    let mut trace = done.trace.clone();
    trace.columns.iter_mut().filter(|c| c.unit == "mm").for_each(|c| {
        c.values.iter_mut().for_each(|v| *v *= factor("mm"));
        c.unit = "m".into();
    });
    write_csv(&trace, &written.0, true).expect("it can be written");
    let again = read_trace(&written.0, &done.trace).unwrap_or_else(|e| panic!("{e}"));
    let (y, own) = (column(&again, "y"), column(&done.trace, "y"));
    assert!(y.iter().zip(own).all(|(a, b)| (a - b).abs() <= 1e-12 * b.abs()));
    std::fs::write(&written.0, text.replacen("mm", "kg", 1)).expect("a file");
    let told = read_trace(&written.0, &done.trace).expect_err("kilograms").to_string();
    assert!(told.contains("`y` is in kg"), "{told}");
}

/// A value that is written with its unit is one of it.
#[test]
fn the_value_of_an_input_says_what_it_measures() {
    let text = "model Push\ninput push = 3 m\nSe:F(push) -> 1:v -> I:m(1 kg)\nv -> R:d(2 N.s/m)";
    let words = Model::from_text("test.bond", text, &[]).expect_err("a length is no force").render(false);
    assert!(words.contains("test.bond:3:"), "{words}");
    model(&text.replace("3 m", "-3 N"));
    model(&text.replace("3 m", "3"));
}

fn column<'t>(trace: &'t halfarrow::Trace, name: &str) -> &'t [f64] {
    &trace.columns.iter().find(|c| c.name == name).expect("a column").values
}

#[test]
fn a_file_full_of_faults_tells_some_and_how_many_more() {
    let told = refused("full", &format!("t,road\n0,0\n{}", "1,x\n".repeat(2000)));
    assert!(told.contains("and 1990 more faults") && told.lines().count() < 15, "{told}");
}

/// What `bond_graph` finds odd is a warning of the model, and nobody has to ask a stage for it.
#[test]
fn what_is_odd_about_a_graph_is_told() {
    let codes =
        |text: &str| -> Vec<&str> { model(text).warnings().diagnostics.0.iter().map(|d| d.code.name).collect() };
    let drop = "model Two\nSe:a(1) -> 1:x -> I:m(1)\nx -> R:r(1)\n";
    assert_eq!(codes(drop), Vec::<&str>::new());
    let two = format!("{drop}Se:b(1) -> 1:y -> I:n(2)\ny -> R:s(1)\n");
    assert_eq!(codes(&two), ["B020"]);
    // Who compares two in one output has put them beside each other.
    assert_eq!(codes(&format!("{two}output ahead = m.f - n.f\n")), Vec::<&str>::new());
    assert_eq!(codes(&format!("{drop}x -> 0:dead\n")), ["B021"]);
}
