//! Models with repetition: what shapes them is compiled anew for each value, and their elements are named alike everywhere.

use halfarrow::{
    Compiled, Export, FixedMethod, Form, Method, Model, NameKind, Override, Record, Reduce, Run, Start, Sweep, Target,
    Vary,
};

const ROD: &str = "model Rod
param n = 4, c = 2, r[n] = [0.1*i for i in 1..n], twice = 2*n
0:v[0]
Se:hot(100) -> v[0]
for i in 1..n {
    v[i - 1] -> 1:w[i] -> R:r[i](r[i])
    w[i] -> 0:v[i] -> C:heat[i](c)
}
output last = heat[n].e
output mean = sum(i in 1..n, heat[i].e)/n
output pairs = twice
";

fn model(set: &[(&str, &str)]) -> Model {
    let set: Vec<Override> =
        set.iter().map(|(name, value)| Override { name: (*name).into(), value: (*value).into() }).collect();
    Model::from_text("rod.bond", ROD, &set).unwrap_or_else(|e| panic!("{}", e.render(false)))
}

fn run() -> Run {
    let record = Record::Names(["last", "mean", "pairs"].map(String::from).to_vec());
    let method = Method::Fixed(FixedMethod::Rk4);
    Run { to: 1.0, every: Some(0.5), method, step: Some(0.01), record, ..Run::default() }
}

/// The last values of what is recorded.
fn ends(model: &Model) -> Vec<u64> {
    let trace = model.simulate(&run(), &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false))).trace;
    trace.columns.iter().map(|c| c.values.last().expect("a value").to_bits()).collect()
}

#[test]
fn a_sweep_over_what_shapes_a_model_compiles_each_value() {
    let folder = temp_dir::TempDir::new().expect("a folder");
    let out = folder.path().join("sweep.csv");
    let sweep = Sweep {
        run: run(),
        vary: vec![Vary::parse("n=list(2,4,7,2.5)").unwrap(), Vary::parse("c=list(2,3)").unwrap()],
        samples: None,
        reduce: ["final(last)", "final(mean)", "final(pairs)"].map(|r| Reduce::parse(r).unwrap()).to_vec(),
        restart: false,
        units: false,
        part: None,
    };
    let report = model(&[]).sweep(&sweep, &out, &mut |_, _| true).unwrap_or_else(|e| panic!("{}", e.render(false)));
    assert_eq!((report.sets, report.failed), (8, 2));
    let text = std::fs::read_to_string(&out).expect("a file");
    for line in text.lines().skip(1).take(6) {
        let row: Vec<f64> = line.split(',').map(|f| f.parse().expect("a number")).collect();
        let alone = model(&[("n", &format!("{}", row[1])), ("c", &format!("{:?}", row[2]))]);
        let found: Vec<u64> = row[3..6].iter().map(|v| v.to_bits()).collect();
        assert_eq!(found, ends(&alone), "{line}");
    }
}

#[test]
fn what_shapes_a_model_is_not_set_while_it_runs() {
    let mut rod: Compiled = model(&[]).compile(Form::Minimal).unwrap_or_else(|e| panic!("{}", e.render(false)));
    let mut steps = rod.stepper(FixedMethod::Rk4, 0.01, Start::Given).expect("a start");
    let refused = steps.set_parameter("n", 5.0).expect_err("it shapes the model").to_string();
    assert!(refused.contains("`n` shapes the model"), "{refused}");
    steps.set_parameter("n", 4.0).expect("the value that it has");
    steps.set_parameter("r[2]", 5.0).expect("an element of an array");
    assert_eq!(steps.parameter("r[2]"), Some(5.0));
    rod.set("n", 6.0).unwrap_or_else(|e| panic!("{}", e.render(false)));
    let trace = rod.simulate(&run(), &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false))).trace;
    let found: Vec<u64> = trace.columns.iter().map(|c| c.values.last().expect("a value").to_bits()).collect();
    assert_eq!(found, ends(&model(&[("n", "6")])));
    assert!(rod.set("n", 2.5).is_err());
}

#[test]
fn exports_do_not_offer_what_shapes_the_model() {
    for target in [Target::C, Target::Fmu2, Target::Fmu3] {
        let export = Export { target, ..Export::default() };
        let written = model(&[]).export(&export).unwrap_or_else(|e| panic!("{}", e.render(false)));
        assert_eq!(written.report.parameters, ["c", "r[1]", "r[2]", "r[3]", "r[4]", "twice"], "{target:?}");
        assert_eq!(written.report.states[1], "heat[2].q");
    }
}

#[test]
fn elements_with_indices_have_one_name_together() {
    let names = model(&[]).names();
    let one = |name: &str| names.iter().find(|n| n.name == name).unwrap_or_else(|| panic!("{name}"));
    assert!(names.iter().all(|n| !n.name.contains('[')), "{names:?}");
    let v = one("v");
    let places: Vec<(usize, usize)> = v.uses.iter().map(|p| (p.line, p.column)).collect();
    assert_eq!((v.kind, v.declared.line, places), (NameKind::Junction, 3, vec![(4, 16), (6, 5), (7, 15)]));
    let n: Vec<(usize, usize)> = one("n").uses.iter().map(|p| (p.line, p.column)).collect();
    assert_eq!(n, [(2, 23), (2, 47), (2, 61), (5, 13), (9, 20), (10, 27), (10, 41)]);
    assert_eq!(one("heat").read_by, ["last", "mean"]);
    assert_eq!((one("r").kind, one("n").kind), (NameKind::Parameter, NameKind::Parameter));
}

#[test]
fn one_element_of_an_array_is_set_or_all_of_them() {
    let value = |set: &[(&str, &str)], name: &str| {
        let rod = model(set).compile(Form::Minimal).unwrap_or_else(|e| panic!("{}", e.render(false)));
        rod.parameter(name)
    };
    assert_eq!(value(&[], "r[3]").map(|v| (v * 10.0).round()), Some(3.0));
    assert_eq!(value(&[("r[3]", "7")], "r[3]"), Some(7.0));
    assert_eq!(value(&[("r", "8"), ("r[3]", "7")], "r[3]"), Some(7.0));
    assert_eq!(value(&[("r", "8"), ("r[3]", "7")], "r[4]"), Some(8.0));
    assert_eq!(value(&[("r", "[i^2 for i in 1..n]"), ("n", "9")], "r[9]"), Some(81.0));
    let set = |name: &str, value: &str| Override { name: name.into(), value: value.into() };
    let refused = |o| Model::from_text("rod.bond", ROD, &[o]).expect_err("a fault").to_string();
    assert!(refused(set("r[5]", "1")).contains("there is no parameter `r[5]`"));
    assert!(refused(set("r", "[1, 2]")).contains("4 values are needed, not 2"));
    assert!(refused(set("n", "2.5")).contains("must be a whole number"));
}
