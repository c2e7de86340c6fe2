//! Every folder of `models/`: what each stage says about the model, and its reference values.
//!
//! `UPDATE=1 cargo test -p halfarrow --test models` rewrites the texts; review the difference.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use halfarrow::{Error, Form, Method, Model, Record, Run, Stage};
use serde_json::Value;

#[test]
fn every_stage_says_what_its_golden_text_says() {
    check_all(&models(), |folder| {
        let model = load(folder)?;
        let faults: Vec<String> = Stage::ALL
            .iter()
            .filter_map(|stage| {
                let text = stage.show_model(&model).map_err(|error| error.render(false));
                text.and_then(|text| golden(&folder.join(format!("{}.txt", stage.name())), &text)).err()
            })
            .collect();
        if faults.is_empty() { Ok(()) } else { Err(faults.join("\n")) }
    });
}

#[test]
fn every_form_says_what_its_golden_text_says() {
    check_all(&models(), |folder| {
        let model = load(folder)?;
        let faults: Vec<String> = Form::ALL
            .iter()
            .filter(|form| **form != Form::Minimal)
            .filter_map(|form| {
                // Where a form does not apply its text says why, without places.
                let why = |error: Error| format!("{}\n", error.render(false).lines().next().unwrap_or_default());
                let text = model.form_text(*form).unwrap_or_else(why);
                golden(&folder.join(format!("equations_{}.txt", form.name())), &text).err()
            })
            .collect();
        if faults.is_empty() { Ok(()) } else { Err(faults.join("\n")) }
    });
}

#[test]
fn references_are_met() {
    let with_reference: Vec<PathBuf> =
        models().into_iter().filter(|folder| folder.join("reference.json").is_file()).collect();
    assert!(with_reference.len() >= 35, "only {} references", with_reference.len());
    check_all(&with_reference, |folder| {
        let reference = Reference::read(folder);
        [Method::Auto, Method::Radau].iter().try_for_each(|&method| reference.check(folder, method))
    });
}

/// At every step: power and every law to rounding, energy and rates as far as the steps resolve.
#[test]
fn audits_are_clean() {
    check_all(&models(), |folder| {
        let run =
            Run { every: None, method: Method::Auto, record: Record::Default, ..Reference::read(folder).run(folder) };
        let model = load(folder)?;
        let done = model.simulate(&run, &mut |_| true).map_err(|error| error.render(false))?;
        let audit = done.report.audit;
        let exact = [("power", &audit.power), ("residual", &audit.residual)].map(|(name, miss)| (name, miss, 1e-12));
        let integrated = [("energy", &audit.energy), ("rates", &audit.rates)].map(|(name, miss)| (name, miss, 1e-9));
        let above = exact.iter().chain(&integrated).filter_map(|(name, miss, bound)| {
            let miss = miss.as_ref()?;
            let fine = miss.value < bound + miss.resolution && miss.resolution < 1e-4;
            (!fine).then(|| format!("{name} {miss:?}"))
        });
        let above: Vec<String> = above.collect();
        if above.is_empty() { Ok(()) } else { Err(above.join("\n")) }
    });
}

/// States of 1e-13 and 1e-6 that start at rest, one pulled by the square of the other: no method stumbles over them.
#[test]
fn every_method_closes_the_electrostatic_gap() {
    use halfarrow::FixedMethod::{Euler, Heun, ImplicitMidpoint, Rk4};
    let folder = root().join("electrostatic");
    let reference = Reference::read(&folder);
    let fixed = [(Euler, 1e-2), (Heun, 1e-4), (Rk4, 1e-8), (ImplicitMidpoint, 1e-4)];
    let fixed = fixed.map(|(method, bound)| (Method::Fixed(method), Some(1e-7), bound));
    let variable = [Method::Explicit, Method::Bdf, Method::Radau, Method::Auto].map(|method| (method, None, 1e-9));
    for (method, step, bound) in fixed.into_iter().chain(variable) {
        let run = Run { method, step, ..reference.run(&folder) };
        reference.check_run(&folder, &run, bound).unwrap_or_else(|fault| panic!("{method:?}: {fault}"));
    }
}

/// `reference.json` of a model.
struct Reference {
    times: Vec<String>,
    values: BTreeMap<String, Vec<f64>>,
    tolerance: f64,
    inputs: BTreeMap<String, String>,
}

impl Reference {
    fn read(folder: &Path) -> Reference {
        let json: Value = serde_json::from_str(&read(&folder.join("reference.json"))).expect("JSON");
        let strings = |v: &Value| -> Vec<String> {
            v.as_array().expect("a list").iter().map(|s| s.as_str().expect("a string").to_string()).collect()
        };
        let numbers = |v: &Value| strings(v).iter().map(|s| s.parse().expect("a number")).collect();
        let entries = |key: &str| json[key].as_object().cloned().unwrap_or_default();
        Reference {
            times: strings(&json["t"]),
            values: entries("values").iter().map(|(name, v)| (name.clone(), numbers(v))).collect(),
            tolerance: json["tolerance"].as_f64().expect("a tolerance"),
            inputs: entries("inputs").iter().map(|(k, v)| (k.clone(), v.as_str().expect("a file").into())).collect(),
        }
    }

    /// The run that its values are from, recorded where they are.
    fn run(&self, folder: &Path) -> Run {
        let times: Vec<f64> = self.times.iter().map(|t| t.parse().expect("a time")).collect();
        Run {
            to: times.last().copied().expect("a time"),
            every: Some(common_step(&self.times)),
            rtol: 1e-12,
            inputs: self.inputs.iter().map(|(name, file)| (name.clone(), folder.join(file).into())).collect(),
            record: Record::Names(self.values.keys().cloned().collect()),
            ..Run::default()
        }
    }

    /// Each value within `tolerance` of the greatest magnitude of its variable.
    fn check(&self, folder: &Path, method: Method) -> Result<(), String> {
        self.check_run(folder, &Run { method, ..self.run(folder) }, self.tolerance)
    }

    fn check_run(&self, folder: &Path, run: &Run, tolerance: f64) -> Result<(), String> {
        let done = load(folder)?.simulate(run, &mut |_| true).map_err(|error| error.render(false))?;
        let method = run.method;
        let mut faults = Vec::new();
        for (name, wanted) in &self.values {
            let found = &done.trace.column(name).expect("it was recorded").values;
            let scale = found.iter().chain(wanted).fold(0.0f64, |m, v| m.max(v.abs()));
            for (t, wanted) in self.times.iter().zip(wanted) {
                let at: f64 = t.parse().expect("a time");
                let sample = done.trace.times.iter().position(|s| (s - at).abs() < 1e-9 * at).expect("a sample");
                let error = (found[sample] - wanted).abs() / scale;
                if error.is_nan() || error > tolerance {
                    faults.push(format!(
                        "{method:?}: {name}({t}) = {}, but {wanted}: {error:.1e} of {scale}",
                        found[sample]
                    ));
                }
            }
        }
        if faults.is_empty() { Ok(()) } else { Err(faults.join("\n")) }
    }
}

/// The longest time of which all these decimal numbers are multiples.
fn common_step(times: &[String]) -> f64 {
    let decimals = times.iter().map(|t| t.split('.').nth(1).map_or(0, str::len)).max().unwrap_or(0);
    let unit = 10u64.pow(decimals as u32);
    let whole = |t: &String| (t.parse::<f64>().expect("a time") * unit as f64).round() as u64;
    let gcd = times.iter().map(whole).fold(0, |a, b| {
        let (mut a, mut b) = (a, b);
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a
    });
    gcd as f64 / unit as f64
}

/// Runs a check on every folder, on two threads, and reports all that fail.
fn check_all(folders: &[PathBuf], check: impl Fn(&Path) -> Result<(), String> + Sync) {
    let next = AtomicUsize::new(0);
    let failed = Mutex::new(BTreeMap::new());
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                while let Some(folder) = folders.get(next.fetch_add(1, Ordering::Relaxed)) {
                    if let Err(fault) = check(folder) {
                        failed.lock().expect("no check panics").insert(folder.clone(), fault);
                    }
                }
            });
        }
    });
    let failed = failed.into_inner().expect("no check panics");
    let name = |folder: &PathBuf| folder.file_name().unwrap().to_string_lossy().into_owned();
    let all: Vec<String> = failed.iter().map(|(folder, fault)| format!("== {}\n{fault}", name(folder))).collect();
    assert!(all.is_empty(), "{} of {} models\n{}", all.len(), folders.len(), all.join("\n"));
}

/// Compares with a file, or writes it if `UPDATE` is set.
fn golden(path: &Path, text: &str) -> Result<(), String> {
    if std::env::var_os("UPDATE").is_some() {
        return fs::write(path, text).map_err(|why| why.to_string());
    }
    let name = path.file_name().unwrap().to_string_lossy();
    let wanted = fs::read_to_string(path).map_err(|why| format!("{name}: {why}"))?;
    if wanted == text {
        return Ok(());
    }
    let differs = wanted.lines().zip(text.lines()).position(|(a, b)| a != b);
    let line = differs.unwrap_or(wanted.lines().count().min(text.lines().count()));
    let at = |text: &str| text.lines().nth(line).unwrap_or("(nothing)").chars().take(200).collect::<String>();
    Err(format!("{name}:{}\n  golden {}\n  now    {}", line + 1, at(&wanted), at(text)))
}

fn load(folder: &Path) -> Result<Model, String> {
    Model::load(&folder.join("model.bond"), &[]).map_err(|error| error.render(false))
}

fn models() -> Vec<PathBuf> {
    let entries = fs::read_dir(root()).expect("models/").map(|entry| entry.unwrap().path());
    let mut folders: Vec<PathBuf> = entries.filter(|path| path.join("model.bond").is_file()).collect();
    folders.sort();
    folders
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models")
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|why| panic!("{}: {why}", path.display()))
}
