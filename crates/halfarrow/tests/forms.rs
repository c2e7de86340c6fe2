//! Every form of every model comes to the same end, and `stiff` converges to it with the order it claims.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use halfarrow::{Error, Form, Model, Record, Run, Simulated};

/// Agreement of states at the end of a run, relative to the greatest magnitude of each in it.
const AGREES: f64 = 1e-8;
/// Agreement of all other variables: those that jump with every step of a multiplier have fewer digits.
const FOLLOWS: f64 = 1e-6;
/// Length of the runs, in s: long enough for every form to drift, short enough for a test.
const LENGTH: f64 = 0.25;

fn models() -> Vec<(String, Model)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models");
    let folders = fs::read_dir(root).expect("models/").map(|entry| entry.expect("a folder").path());
    let mut folders: Vec<PathBuf> = folders.filter(|path| path.join("model.bond").is_file()).collect();
    folders.sort();
    let name = |folder: &Path| folder.file_name().expect("a name").to_string_lossy().into_owned();
    let load = |folder: &PathBuf| Model::load(&folder.join("model.bond"), &[]).unwrap_or_else(|e| panic!("{e:?}"));
    folders.iter().map(|folder| (name(folder), load(folder))).collect()
}

/// Values at the end and the greatest ones on the way, by variable.
type Ends = BTreeMap<String, (f64, f64)>;

fn ends(done: &Simulated) -> Ends {
    let end = |values: &[f64]| {
        let greatest = values.iter().fold(0.0f64, |most, v| most.max(v.abs()));
        (*values.last().expect("a sample"), greatest)
    };
    done.trace.columns.iter().map(|c| (c.name.clone(), end(&c.values))).collect()
}

fn run(model: &Model, run: &Run) -> Result<Ends, Error> {
    model.simulate(run, &mut |_| true).map(|done| ends(&done))
}

/// The greatest difference of what both have among the wanted, relative to each variable.
fn apart(a: &Ends, b: &Ends, wanted: &dyn Fn(&str) -> bool) -> (f64, String) {
    let whole = a.values().fold(0.0f64, |most, v| most.max(v.1));
    let miss = |(name, (value, greatest)): (&String, &(f64, f64))| {
        let other = b.get(name)?;
        Some(((value - other.0).abs() / greatest.max(other.1).max(1e-3 * whole), name.clone()))
    };
    a.iter()
        .filter(|v| wanted(v.0))
        .filter_map(miss)
        .fold((0.0, String::new()), |most, m| if m.0 > most.0 || m.0.is_nan() { m } else { most })
}

fn state_names(model: &Model) -> Vec<String> {
    model.equations(Form::Minimal).expect("equations").states.iter().map(|s| s.name.clone()).collect()
}

#[test]
fn all_forms_come_to_the_same_end() {
    let mut faults = Vec::new();
    let mut compared = 0;
    for (name, model) in models() {
        let to = match name.as_str() {
            "electrostatic" => 1e-4,
            "rectifier" => 0.02,
            _ => LENGTH,
        };
        let base = Run { to, every: Some(to / 5.0), rtol: 1e-11, record: Record::All, ..Run::default() };
        let states = state_names(&model);
        let Ok(minimal) = run(&model, &base) else { panic!("{name} does not run") };
        for form in [Form::Kane, Form::Inverted, Form::Break, Form::Relaxed, Form::Lagrange] {
            if model.equations(form).is_err() {
                continue;
            }
            match run(&model, &Run { form, ..base.clone() }) {
                Ok(other) => {
                    compared += 1;
                    let state = |n: &str| states.iter().any(|s| s == n);
                    for (wanted, allowed) in [(true, AGREES), (false, FOLLOWS)] {
                        let (miss, place) = apart(&minimal, &other, &|n| !wanted || state(n));
                        if miss.is_nan() || miss > allowed {
                            faults.push(format!("{name} {}: {place} is off by {miss:.1e}", form.name()));
                        }
                    }
                }
                Err(error) => faults.push(format!("{name} {}: {}", form.name(), error.render(false).trim())),
            }
        }
    }
    assert!(faults.is_empty(), "{} of {compared}\n{}", faults.len(), faults.join("\n"));
    assert!(compared > 150, "only {compared}");
}

#[test]
fn the_stiff_form_converges_with_order_one_in_its_stiffness() {
    for name in ["pendulum", "double_pendulum", "gear_train"] {
        let (_, model) = models().into_iter().find(|m| m.0 == name).expect("the model");
        let states: Vec<String> =
            model.equations(Form::Minimal).expect("equations").states.iter().map(|s| s.name.clone()).collect();
        let base = Run { to: 0.5, rtol: 1e-10, record: Record::Names(states), ..Run::default() };
        let exact = run(&model, &base).expect("a run");
        let error = |stiffness: f64| {
            let stiff =
                Run { form: Form::Stiff, stiffness: Some(stiffness), method: halfarrow::Method::Radau, ..base.clone() };
            apart(&exact, &run(&model, &stiff).unwrap_or_else(|e| panic!("{}", e.render(false))), &|_| true).0
        };
        let (soft, hard) = (error(1e6), error(1e7));
        // Ten times as stiff, a tenth of the error: order 0.9 to 1.1.
        let ratio = soft / hard;
        assert!((7.9..12.6).contains(&ratio), "{name}: {soft:.2e}, then {hard:.2e}");
    }
}
