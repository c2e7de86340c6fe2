//! All forms of a random graph at one point: their variables agree with the minimal form, their equations hold.

use halfarrow_compiler::causal_graph::CausalGraph;
use halfarrow_compiler::equations::{Form, derive_equations};
use halfarrow_compiler::program::{Program, schedule};
use halfarrow_exec::{ImplicitModel, Model};
use halfarrow_sim::{Events, Failure, ImplicitSystem};

use crate::check::{Fault, Seen, fault};

/// Agreement, relative to the greatest variable.
const AGREES: f64 = 1e-8;

/// Checks every form that applies where the minimal one has the state `x`.
/// `constant` if no modulus reads a state.
pub fn check_forms(
    causal: &CausalGraph,
    model: &Model,
    (t, x): (f64, &[f64]),
    constant: bool,
    seen: &mut Seen,
) -> Result<(), Fault> {
    for form in Form::ALL.into_iter().filter(|f| *f != Form::Minimal) {
        let equations = match derive_equations(causal, form) {
            Ok(equations) => equations,
            // Rates of inputs, or of algebraic unknowns, that a form would need and does not have.
            Err(faults) if faults.0.iter().any(|d| d.code.name == "E001") => continue,
            // On some singular rings the choices of a form leave a variable to itself: refused, with the reason.
            Err(faults) if faults.0.iter().any(|d| d.code.name == "E002") => {
                *seen.refused_forms.entry(form.name()).or_default() += 1;
                continue;
            }
            Err(faults) => return fault(format!("form {}", form.name()), faults.to_string()),
        };
        let made = ImplicitModel::new(schedule(&equations), model.clone());
        let mut other = made.or_else(|f| fault(format!("form {}", form.name()), f.to_string()))?;
        if !constant && is_singular(&mut other, t, x) {
            *seen.singular_forms.entry(form.name()).or_default() += 1;
            continue;
        }
        compare(form, &mut other, &mut model.clone(), t, x, seen)?;
    }
    Ok(())
}

/// Whether a form has no value at a point: where a modulus vanishes, more equations degenerate than in the minimal form.
fn is_singular(other: &mut ImplicitModel, t: f64, x: &[f64]) -> bool {
    matches!(
        other.start_at(t, x),
        Err(Failure::Singular { .. } | Failure::Vanished { .. } | Failure::OutOfDomain { .. })
    )
}

fn compare(
    form: Form,
    other: &mut ImplicitModel,
    model: &mut Model,
    t: f64,
    x: &[f64],
    seen: &mut Seen,
) -> Result<(), Fault> {
    let what = |place: &str| format!("form {} {place}", form.name());
    let (here, there) = (observed(other.program()), observed(model.program()));
    let common: Vec<&str> = here.iter().filter(|n| there.contains(n)).map(String::as_str).collect();
    other.record(&common).expect("they have values");
    model.record(&common).expect("they have values");
    let (y, yp) = match other.start_at(t, x) {
        Ok(start) => start,
        Err(failure) => return fault(what("start"), failure.to_string()),
    };
    let (mut ours, mut theirs) = (vec![0.0; common.len()], vec![0.0; common.len()]);
    model.handle_event(t, &mut x.to_vec()).or_else(|f| fault(what("minimal"), f.to_string()))?;
    model.observe(t, x, &mut theirs).or_else(|f| fault(what("minimal"), f.to_string()))?;
    other.observe(t, &[&y[..], &yp].concat(), &mut ours).or_else(|f| fault(what("values"), f.to_string()))?;
    if std::env::var_os("SHOW").is_some() {
        for (n, (a, b)) in common.iter().zip(ours.iter().zip(&theirs)) {
            println!("{form:?} {n} {a} {b}");
        }
        println!("{}", other.program());
        println!(
            "x {x:?} y {y:?} yp {yp:?} {:?}",
            other.program().states.iter().map(|s| s.name.clone()).collect::<Vec<_>>()
        );
    }
    let greatest = theirs.iter().fold(1e-3f64, |most, v| most.max(v.abs()));
    for (name, (a, b)) in common.iter().zip(ours.iter().zip(&theirs)) {
        let apart = (a - b).abs() / greatest;
        seen.within(form.name(), apart, AGREES, || format!("{name}: {a} and {b}, greatest {greatest}"))?;
    }
    let mut out = vec![0.0; y.len()];
    other.residual(t, &y, &yp, &mut out).or_else(|f| fault(what("residual"), f.to_string()))?;
    let greatest = y.iter().chain(&yp).fold(greatest, |most, v| most.max(v.abs()));
    for (i, miss) in out.iter().enumerate() {
        let name = other.equation_name(i);
        seen.within(form.name(), miss.abs() / greatest, AGREES, || format!("{name} misses by {miss} of {greatest}"))?;
    }
    Ok(())
}

fn observed(program: &Program) -> Vec<String> {
    program.observed.iter().filter(|o| o.value.is_ok()).map(|o| o.name.to_string()).collect()
}
