//! Every model with a reference, from its text to its trajectory: values met, audit passed.

use halfarrow_audit::{Audit, Run, audit, wanted};
use halfarrow_compiler::ast;
use halfarrow_compiler::bond_graph::{self, BondGraph, NoFiles};
use halfarrow_compiler::causal_graph::assign_causality;
use halfarrow_compiler::diagnostic::{Sources, render};
use halfarrow_compiler::equations::{Form, derive_equations};
use halfarrow_compiler::program::schedule;
use halfarrow_exec::Model;
use halfarrow_sim::{Failure, Method, Options, Sink, simulate};
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

fn models() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models")
}

fn build(folder: &Path) -> Result<(BondGraph, Model), String> {
    let text = std::fs::read_to_string(folder.join("model.bond")).map_err(|e| e.to_string())?;
    let mut sources = Sources::new();
    let file = sources.add("model.bond", &text);
    let parsed = ast::parse(&text, file);
    let result = bond_graph::elaborate(parsed.ast, sources, &NoFiles, &[]);
    let said = |d: &_| render(d, &result.sources, false);
    let graph = result.graph.as_ref().ok_or_else(|| said(&result.diagnostics))?;
    let causal = assign_causality(graph).map_err(|d| said(&d))?;
    let equations = derive_equations(&causal, Form::Minimal).map_err(|d| said(&d))?;
    let model = Model::new(schedule(&equations)).map_err(|e| e.to_string())?;
    Ok((graph.clone(), model))
}

#[derive(Default)]
struct Samples {
    times: Vec<f64>,
    rows: Vec<Vec<f64>>,
}

impl Sink for Samples {
    fn sample(&mut self, t: f64, values: &[f64]) {
        self.times.push(t);
        self.rows.push(values.to_vec());
    }
    /// A few hundred steps are enough to judge.
    fn progress(&mut self, _t: f64) -> ControlFlow<()> {
        if self.times.len() < 300 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    }
}

fn run(model: &mut Model, to: f64) -> Result<Samples, String> {
    let mut x = model.initialise(0.0).map_err(|e| e.to_string())?;
    let mut samples = Samples::default();
    let options = Options { to, rtol: 1e-12, method: Method::Explicit, ..Options::default() };
    match simulate(model, &options, &mut x, &mut samples).map_err(|stopped| stopped.failure) {
        Ok(_) | Err(Failure::Interrupted { .. }) => Ok(samples),
        Err(failure) => Err(failure.to_string()),
    }
}

fn audit_of(graph: &BondGraph, model: &mut Model, to: f64) -> Result<Audit, String> {
    let program = model.program();
    let names: Vec<String> = wanted(graph)
        .into_iter()
        .filter(|n| program.observed.iter().any(|o| o.name == *n && o.value.is_ok()))
        .collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    model.record(&names).map_err(|e| e.to_string())?;
    let samples = run(model, to)?;
    let columns: Vec<Vec<f64>> = (0..names.len()).map(|j| samples.rows.iter().map(|r| r[j]).collect()).collect();
    let columns = names.iter().zip(&columns).map(|(n, c)| (n.to_string(), c.as_slice())).collect();
    let values = |name: &String| Some((name.clone(), model.parameter(name)?));
    let parameters: BTreeMap<String, f64> = graph.parameters.values().filter_map(|p| values(&p.name)).collect();
    Ok(audit(graph, &Run { times: &samples.times, columns: &columns, parameters: &parameters }))
}

/// What an audit must not find.
fn judge(name: &str, found: &Audit) -> String {
    println!("{name}\n{found}");
    let exact = [&found.power, &found.residual].into_iter().flatten().filter(|f| !(f.value < 1e-12));
    let integrated = [&found.energy, &found.rates].into_iter().flatten();
    let integrated = integrated.filter(|f| !(f.value < 1e-9 + f.resolution) || !(f.resolution < 1e-4));
    exact.chain(integrated).map(|f| format!("{name}: {f}\n")).collect()
}

#[test]
fn every_model_runs_and_passes_the_audit() {
    let mut folders: Vec<PathBuf> = std::fs::read_dir(models()).unwrap().map(|e| e.unwrap().path()).collect();
    // Pulled in and beyond its gap before the end; a constraint that cannot be built yet.
    let out = ["electrostatic", "slider_crank"];
    folders.retain(|f| f.join("model.bond").exists() && !out.iter().any(|o| f.ends_with(o)));
    folders.sort();
    let mut faults = String::new();
    for folder in folders {
        let name = folder.file_name().unwrap().to_string_lossy().to_string();
        match build(&folder).and_then(|(graph, mut model)| audit_of(&graph, &mut model, 0.5)) {
            Err(said) => faults.push_str(&format!("{name}: {said}\n")),
            Ok(found) => faults.push_str(&judge(&name, &found)),
        }
    }
    assert!(faults.is_empty(), "{faults}");
}
