//! Every form of every model comes to the same end, and `stiff` converges to it with the order it claims.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use halfarrow::{Error, Form, Model, Record, Run, Simulated};

/// Agreement of every variable everywhere, relative to its greatest magnitude in the run.
const AGREES: f64 = 1e-8;
/// A variable counts as at least this part of the greatest one of its kind, so that what is zero by law has a magnitude.
const FLOOR: f64 = 1e-3;
/// Longest runs, in s: long enough for every form to drift, short enough for a test.
const LONGEST: f64 = 3.0;

fn models() -> Vec<(String, Model)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models");
    let folders = fs::read_dir(root).expect("models/").map(|entry| entry.expect("a folder").path());
    let mut folders: Vec<PathBuf> = folders.filter(|path| path.join("model.bond").is_file()).collect();
    folders.sort();
    let name = |folder: &Path| folder.file_name().expect("a name").to_string_lossy().into_owned();
    let load = |folder: &PathBuf| Model::load(&folder.join("model.bond"), &[]).unwrap_or_else(|e| panic!("{e:?}"));
    folders.iter().map(|folder| (name(folder), load(folder))).collect()
}

/// Values on the way, by variable.
pub(crate) type Values = BTreeMap<String, Vec<f64>>;

pub(crate) fn run(model: &Model, run: &Run) -> Result<Values, Error> {
    let done: Simulated = model.simulate(run, &mut |_| true)?;
    // Every law of the graph holds, whatever the form.
    if run.form != Form::Stiff {
        for miss in [&done.report.audit.residual, &done.report.audit.power].into_iter().flatten() {
            assert!(miss.value <= AGREES, "{} {}: {miss:?}", model.name(), run.form.name());
        }
    }
    Ok(done.trace.columns.into_iter().map(|c| (c.name, c.values)).collect())
}

/// What a variable is of like size with: efforts, flows, stored quantities; all else by itself.
fn kind(name: &str) -> &str {
    match name.rsplit_once('.') {
        Some((_, letter @ ("e" | "f" | "q" | "p"))) => letter,
        // What a constraint is off is nothing beside what it relates.
        Some((_, "drift")) => "q",
        _ => name,
    }
}

/// The greatest difference of what both have at any time, relative to the greatest magnitude of the variable.
pub(crate) fn apart(a: &Values, b: &Values) -> (f64, String) {
    let greatest = |values: &[f64]| values.iter().fold(0.0f64, |most, v| most.max(v.abs()));
    let mut kinds: BTreeMap<&str, f64> = BTreeMap::new();
    for (name, values) in a {
        let most = kinds.entry(kind(name)).or_default();
        *most = most.max(greatest(values));
    }
    let miss = |(name, values): (&String, &Vec<f64>)| {
        let other = b.get(name)?;
        let scale = greatest(values).max(FLOOR * kinds[kind(name)]).max(1e-300);
        let differences = values.iter().zip(other).map(|(a, b)| (a - b).abs() / scale);
        let worst = differences.fold(0.0f64, |most, d| if d > most || d.is_nan() { d } else { most });
        Some((if values.len() == other.len() { worst } else { f64::NAN }, name.clone()))
    };
    a.iter().filter_map(miss).fold((0.0, String::new()), |most, m| if m.0 > most.0 || m.0.is_nan() { m } else { most })
}

/// Forms that end by themselves, and before when, in s.
const SINGULAR: [(&str, Form, f64); 3] = [
    // They ask the law of a diode for its effort: where it blocks, the flow is that of saturation to all digits.
    ("rc_bridge_diode", Form::Inverted, 1.3),
    ("rc_bridge_diode", Form::Relaxed, 1.3),
    // It divides by the sine of an angle that passes through zero at 0.3 s.
    ("point_pendulum", Form::Lagrange, 0.3),
];

/// How far the reference of a model goes, within bounds: the time in which something happens.
fn length(name: &str) -> f64 {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models").join(name).join("reference.json");
    let reference: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(path).expect("a reference")).expect("JSON");
    let times = reference["t"].as_array().expect("times").iter();
    let last = times.filter_map(|t| t.as_str()?.parse::<f64>().ok()).fold(0.0, f64::max);
    last.min(LONGEST)
}

/// As many values as the other run has.
fn cut(whole: &Values, part: &Values) -> Values {
    let samples = part.values().next().map_or(0, Vec::len);
    whole.iter().map(|(name, values)| (name.clone(), values[..samples.min(values.len())].to_vec())).collect()
}

/// What differs between the forms of a model, and how many were compared.
fn disagreements(name: &str, model: &Model) -> (usize, Vec<String>) {
    let to = length(name);
    let base = Run { to, every: Some(to / 20.0), rtol: 1e-12, record: Record::All, ..Run::default() };
    let Ok(minimal) = run(model, &base) else { return (0, vec![format!("{name} does not run")]) };
    let (mut faults, mut compared) = (Vec::new(), 0);
    for form in [Form::Kane, Form::Inverted, Form::Break, Form::Relaxed, Form::Lagrange] {
        if model.equations(form).is_err() {
            continue;
        }
        let singular = SINGULAR.iter().find(|s| (s.0, s.1) == (name, form)).filter(|s| s.2 <= to);
        let end = |to: f64| base.every.map_or(to, |every| every * ((to / every).ceil() - 1.0));
        let to = singular.map_or(to, |s| end(s.2));
        match run(model, &Run { form, to, ..base.clone() }) {
            Ok(other) => {
                compared += 1;
                let (miss, place) = apart(&cut(&minimal, &other), &other);
                if miss.is_nan() || miss > AGREES {
                    faults.push(format!("{name} {}: {place} is off by {miss:.1e}", form.name()));
                }
            }
            Err(error) => faults.push(format!("{name} {}: {}", form.name(), error.render(false).trim())),
        }
    }
    (compared, faults)
}

#[test]
fn all_forms_agree_everywhere_on_the_way() {
    let all = models();
    let next = std::sync::atomic::AtomicUsize::new(0);
    let work = || {
        let mut found = Vec::new();
        while let Some((name, model)) = all.get(next.fetch_add(1, std::sync::atomic::Ordering::Relaxed)) {
            found.push(disagreements(name, model));
        }
        found
    };
    let found: Vec<(usize, Vec<String>)> = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..4).map(|_| scope.spawn(work)).collect();
        workers.into_iter().flat_map(|worker| worker.join().expect("no panic")).collect()
    });
    let compared: usize = found.iter().map(|f| f.0).sum();
    let mut faults: Vec<String> = found.into_iter().flat_map(|f| f.1).collect();
    faults.sort();
    assert!(faults.is_empty(), "{} of {compared}\n{}", faults.len(), faults.join("\n"));
    assert!(compared > 150, "only {compared}");
}

#[test]
fn the_stiff_form_converges_with_order_one_in_its_stiffness() {
    for name in ["pendulum", "double_pendulum", "gear_train"] {
        let (_, model) = models().into_iter().find(|m| m.0 == name).expect("the model");
        let states: Vec<String> =
            model.equations(Form::Minimal).expect("equations").states.iter().map(|s| s.name.clone()).collect();
        let base = Run { to: 0.5, every: Some(0.05), rtol: 1e-10, record: Record::Names(states), ..Run::default() };
        let exact = run(&model, &base).expect("a run");
        let error = |stiffness: f64| {
            let stiff =
                Run { form: Form::Stiff, stiffness: Some(stiffness), method: halfarrow::Method::Radau, ..base.clone() };
            apart(&exact, &run(&model, &stiff).unwrap_or_else(|e| panic!("{}", e.render(false)))).0
        };
        let (soft, hard) = (error(1e6), error(1e7));
        // Ten times as stiff, a tenth of the error: order 0.9 to 1.1.
        let ratio = soft / hard;
        assert!((7.9..12.6).contains(&ratio), "{name}: {soft:.2e}, then {hard:.2e}");
    }
}

/// A capacitor that a source holds carries nothing: its flow is the difference of charges over a step, which rounding leaves
/// far from nothing when steps are short. That is no error, and no reason for shorter steps.
#[test]
fn what_a_source_holds_takes_no_steps() {
    let held = [
        "Se:s(0.461) -> 0:n -> C:c(1.471)\nn -> 1:l -> R:r(0.28)\nl -> I:i(3.654)\n",
        "0:j0 -> TF:t0(e_out = 1.822) -> 1:j1\nj1 -> TF:t1(e_out = 1.36) -> 0:j2\nj0 -> C:c1(0.715)\nj1 -> C:c2(2.236)\n\
         Se:s4(1.48) -> j2\n",
        "Se:s(1.48) -> 0:a -> C:c(2)\na -> TF:t(e_out = 1.3) -> 0:b -> C:d(0.7)\nb -> 1:l -> R:r(3)\nl -> I:i(2)\n",
    ];
    for text in held {
        let model = Model::from_text("held.bond", &format!("model Held\n{text}"), &[]).expect("a model");
        let run = |form| {
            let run = Run { to: 2.0, form, record: Record::All, rtol: 1e-8, ..Run::default() };
            model.simulate(&run, &mut |_| true).unwrap_or_else(|e| panic!("{form:?}: {}\n{text}", e.render(false)))
        };
        let minimal = run(Form::Minimal);
        for form in [Form::Break, Form::Relaxed, Form::Lagrange, Form::Inverted] {
            let found = run(form);
            assert!(found.report.steps < 100, "{form:?}: {} steps\n{text}", found.report.steps);
            for column in &minimal.trace.columns {
                let Some(other) = found.trace.column(&column.name) else { continue };
                let (a, b) = (column.values.last().expect("an end"), other.values.last().expect("an end"));
                assert!((a - b).abs() < 1e-6, "{form:?} {}: {a} {b}\n{text}", column.name);
            }
        }
    }
}
