//! What must hold of every graph, by numbers.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};

use halfarrow_compiler::causal_graph::CausalGraph;
use halfarrow_compiler::diagnostic::{Diagnostics, Sources};
use halfarrow_compiler::equations::{Form, StateKind, derive_equations};
use halfarrow_compiler::program::{Unavailable, schedule};
use halfarrow_compiler::{ast, bond_graph, causal_graph, equations};
use halfarrow_exec::{Model, StartError};
use halfarrow_sim::fixed_step::FixedMethod;
use halfarrow_sim::{Events, Failure, Method, Options, Sink, System, simulate};

use crate::exact::{self, Count, float};
use crate::forms::check_forms;
use crate::graph::{Graph, Kind, Modulus, Number, Random, Reading, Resisting, Signal};

/// A property that a graph does not have.
#[derive(Debug, Clone, PartialEq)]
pub struct Fault {
    /// Which, in a word or two: graphs are made smaller as long as it stays the same.
    pub what: String,
    /// The details.
    pub details: String,
}

pub fn fault<T>(what: impl Into<String>, details: impl Into<String>) -> Result<T, Fault> {
    Err(Fault { what: what.into(), details: details.into() })
}

/// What was seen on the way, for statistics.
#[derive(Debug, Clone, Default)]
pub struct Seen {
    pub refused: usize,
    pub ran: usize,
    pub states: usize,
    pub conserved: usize,
    pub undetermined: usize,
    pub start_conflicts: usize,
    pub no_point: usize,
    pub refused_forms: BTreeMap<&'static str, usize>,
    /// Forms without a value at the point drawn.
    pub singular_forms: BTreeMap<&'static str, usize>,
    pub worst: BTreeMap<&'static str, f64>,
}

impl Seen {
    fn note(&mut self, what: &'static str, value: f64) {
        let worst = self.worst.entry(what).or_insert(0.0);
        *worst = worst.max(value);
    }

    /// Refuses values above what is allowed; notes all others.
    pub fn within(
        &mut self,
        what: &'static str,
        value: f64,
        allowed: f64,
        details: impl Fn() -> String,
    ) -> Result<(), Fault> {
        if value.is_nan() || value > allowed {
            return fault(what, format!("{value:e} above {allowed:e}: {}", details()));
        }
        self.note(what, value);
        Ok(())
    }
}

/// A graph that has become a model.
struct Built {
    causal: CausalGraph,
    model: Model,
    states: usize,
    conserved: usize,
    dof: usize,
}

/// Where states are drawn of size 1, variables beyond this stand beside a pole of a modulus.
const POLE: f64 = 1e10;

enum Outcome {
    /// Its parameters leave it no value.
    Without,
    Refused {
        stage: &'static str,
        faults: Diagnostics,
    },
    Built(Box<Built>),
}

/// Model text to model; `constant` if no modulus reads a state.
fn build(text: &str, constant: bool) -> Result<Outcome, Fault> {
    let mut sources = Sources::new();
    let file = sources.add("random.bond", text);
    let tree = match ast::parse(text, file).into_result() {
        Ok(tree) => tree,
        Err(faults) => return fault("parse", faults.to_string()),
    };
    let elaborated = bond_graph::elaborate(tree, sources, &bond_graph::NoFiles, &[]);
    let Some(graph) = elaborated.graph else { return fault("elaborate", elaborated.diagnostics.to_string()) };
    let causal = match causal_graph::assign_causality(&graph) {
        Ok(causal) => causal,
        Err(faults) => return Ok(Outcome::Refused { stage: "causality", faults }),
    };
    let _ = causal_graph::warnings(&causal);
    let drawn = bond_graph::verify(&graph).and_then(|()| causal_graph::verify(&causal));
    if let Err(why) = drawn {
        return fault("stroke rules", why);
    }
    let equations = match derive_equations(&causal, Form::Minimal) {
        Ok(equations) => equations,
        Err(faults) => return Ok(Outcome::Refused { stage: "equations", faults }),
    };
    if let Err(why) = equations::verify(&equations) {
        return fault("names and symbols", why);
    }
    let states = equations.states.iter().filter(|s| s.kind != StateKind::Signal).count();
    let (conserved, dof) = (equations.conserved.len(), equations.dof);
    match Model::new(schedule(&equations)) {
        Ok(model) => Ok(Outcome::Built(Box::new(Built { causal, model, states, conserved, dof }))),
        // A modulus that reads what a source fixes: no value fits, or the structure degenerates there.
        Err(Failure::OutOfDomain { .. } | Failure::Singular { .. } | Failure::Vanished { .. }) if !constant => {
            Ok(Outcome::Without)
        }
        Err(failure) => fault("model", failure.to_string()),
    }
}

/// Checks a graph. Panics become faults.
pub fn check(graph: &Graph, seed: u64, seen: &mut Seen) -> Result<(), Fault> {
    caught(|| check_all(graph, seed, seen))
}

/// Checks a graph of linear or cubic laws that is too large to be counted in exact numbers, and whose sources hold together:
/// all equations at a random point and along a short run.
pub fn check_large(graph: &Graph, seed: u64, seen: &mut Seen) -> Result<(), Fault> {
    caught(|| {
        let mut random = Random::new(seed ^ 0xabcd);
        let mut built = match build(&graph.text(), true)? {
            Outcome::Built(built) => built,
            Outcome::Refused { faults, .. } => return fault("refused", faults.to_string()),
            Outcome::Without => return fault("no value", "of constant moduli"),
        };
        let Some((t, x)) = random_point(graph, &mut built, &mut random, seen)? else { return Ok(()) };
        check_point(graph, &mut built.model, t, &x, seen)?;
        check_run(graph, &mut built.model, &x, seen)?;
        seen.ran += 1;
        seen.states += built.states;
        Ok(())
    })
}

/// Whether all is determined, and nothing is contradicted or repeated.
pub fn is_regular(graph: &Graph, seed: u64) -> bool {
    let count = exact::count(graph, &mut Random::new(seed));
    count.consistent && count.regular && count.determined.iter().all(|&both| both == (true, true))
}

fn caught(run: impl FnOnce() -> Result<(), Fault>) -> Result<(), Fault> {
    let run = catch_unwind(AssertUnwindSafe(run));
    run.unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<String>().cloned();
        let text = text.or_else(|| panic.downcast_ref::<&str>().map(|s| s.to_string()));
        fault("panic", text.unwrap_or_default())
    })
}

fn check_all(graph: &Graph, seed: u64, seen: &mut Seen) -> Result<(), Fault> {
    let mut random = Random::new(seed ^ 0xabcd);
    let count = exact::count(graph, &mut random);
    let mut built = match build(&graph.text(), graph.has_constant_structure())? {
        Outcome::Without => {
            seen.no_point += 1;
            return Ok(());
        }
        Outcome::Refused { stage, faults } => {
            seen.refused += 1;
            let codes: Vec<&str> = faults.0.iter().filter(|d| d.is_error()).map(|d| d.code.name).collect();
            if stage == "causality" && !count.consistent {
                return Ok(());
            }
            if refused_for_cause(graph, &count, &codes) {
                return Ok(());
            }
            return fault(format!("refused {}", codes.join(" ")), faults.to_string());
        }
        Outcome::Built(built) => built,
    };
    if !count.consistent {
        return fault("accepted a contradiction", "the raw equations contradict each other");
    }
    if !count.regular {
        return fault("accepted a singular pencil", "det(s E - A) vanishes");
    }
    check_counts(&built, &count, seen)?;
    check_available(graph, &built.model, &count, seen)?;
    let Some((t, x)) = random_point(graph, &mut built, &mut random, seen)? else { return Ok(()) };
    if graph.is_linear() {
        check_polynomial(&mut built, &count, t, &x, &mut random, seen)?;
    }
    if !graph.has_constant_structure() && is_beside_a_pole(&mut built.model, t, &x) {
        seen.no_point += 1;
        return Ok(());
    }
    check_point(graph, &mut built.model, t, &x, seen)?;
    check_forms(&built.causal, &built.model, (t, &x), graph.has_constant_structure(), seen)?;
    check_run(graph, &mut built.model, &x, seen)?;
    seen.ran += 1;
    Ok(())
}

/// Refusals that are no contradiction of sources.
fn refused_for_cause(graph: &Graph, count: &Count, codes: &[&str]) -> bool {
    // A source that reads what it acts on may make the equations singular; or it could be found only by giving up that
    // it is a source.
    let without_freedom = || codes.iter().all(|code| ["C001", "C002"].contains(code));
    if graph.senses() && (!count.consistent || !count.regular || without_freedom() || codes == ["E002"]) {
        return true;
    }
    // A modulus that turns with a source's value makes its rate count, and so does a source that reads what an input sets.
    if codes == ["E001"] && !graph.inputs().is_empty() && (graph.senses() || !graph.has_constant_structure()) {
        return true;
    }
    // What is integrated has to be determined.
    let flow = |&j: &usize| !count.determined[graph.bonds_at(j)[0].0].1;
    codes == ["E002"] && graph.integrals().iter().any(flow)
}

fn check_counts(built: &Built, count: &Count, seen: &mut Seen) -> Result<(), Fault> {
    let degree = count.degree();
    if built.states + built.conserved != degree || built.dof != degree {
        let (states, conserved, dof) = (built.states, built.conserved, built.dof);
        let details = format!("{states} states, {conserved} conserved, dof {dof}; the pencil has {degree}");
        return fault("count", details);
    }
    seen.states += built.states;
    seen.conserved += built.conserved;
    Ok(())
}

/// Bond variables have a value exactly where the raw equations determine them.
fn check_available(graph: &Graph, model: &Model, count: &Count, seen: &mut Seen) -> Result<(), Fault> {
    let observed: BTreeMap<&str, Option<&Unavailable>> =
        model.program().observed.iter().map(|o| (&*o.name, o.value.as_ref().err())).collect();
    for b in 0..graph.bonds.len() {
        for (name, expected) in [(format!("b{b}.e"), count.determined[b].0), (format!("b{b}.f"), count.determined[b].1)]
        {
            let Some(&why) = observed.get(name.as_str()) else { return fault("not observed", name) };
            let found = why != Some(&Unavailable::Undetermined);
            let both = !graph.inputs().is_empty() && matches!(why, Some(Unavailable::NeedsRateOf(_)));
            if found != expected && !both {
                let what = if expected { "undetermined without need" } else { "determined without reason" };
                return fault(what, name);
            }
            seen.undetermined += usize::from(!found);
        }
    }
    let wrong = model.program().observed.iter().find_map(|o| match &o.value {
        Err(Unavailable::NeedsRateOf(_)) if graph.inputs().is_empty() => Some(o.name.clone()),
        Err(Unavailable::Unsolvable) => Some(o.name.clone()),
        _ => None,
    });
    wrong.map_or(Ok(()), |name| fault("no value", &*name))
}

/// A random time and state near a start that the model accepts; `None` if there is none.
fn random_point(
    graph: &Graph,
    built: &mut Built,
    random: &mut Random,
    seen: &mut Seen,
) -> Result<Option<(f64, Vec<f64>)>, Fault> {
    let x0 = match built.model.initialise(0.0) {
        Ok(x0) => x0,
        Err(StartError::Conflict(_)) => {
            seen.start_conflicts += 1;
            let mut free = graph.clone();
            free.nodes.iter_mut().for_each(|n| n.start = None);
            let again = match build(&free.text(), graph.has_constant_structure())? {
                Outcome::Built(again) => again,
                // Without the start a state takes another value, at which a modulus reads an input.
                Outcome::Refused { faults, .. }
                    if !graph.has_constant_structure() && faults.0.iter().any(|d| d.code.name == "E001") =>
                {
                    seen.no_point += 1;
                    return Ok(None);
                }
                _ => return fault("start", "refused without starts"),
            };
            *built = *again;
            match built.model.initialise(0.0) {
                Ok(x0) => x0,
                Err(StartError::Failure(failure)) if !graph.has_constant_structure() => {
                    let _ = failure;
                    seen.no_point += 1;
                    return Ok(None);
                }
                Err(error) => return fault("start without start values", error.to_string()),
            }
        }
        Err(_) if !graph.has_constant_structure() => {
            seen.no_point += 1;
            vec![0.0; built.model.states()]
        }
        Err(error) => return fault("start", error.to_string()),
    };
    let model = &mut built.model;
    let mut x: Vec<f64> = x0.iter().map(|x| x + random.unit()).collect();
    let t = 0.0;
    if let Err(failure) = model.handle_event(t, &mut x) {
        if graph.has_constant_structure() {
            return fault("crossing", failure.to_string());
        }
        seen.no_point += 1;
        return Ok(None);
    }
    let mut dx = vec![0.0; x.len()];
    match model.rates(t, &x, &mut dx) {
        Ok(()) => Ok(Some((t, x))),
        Err(failure) if graph.has_constant_structure() => fault("rates", failure.to_string()),
        Err(_) => {
            seen.no_point += 1;
            Ok(None)
        }
    }
}

type Complex = (f64, f64);

fn times(a: Complex, b: Complex) -> Complex {
    (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0)
}

fn size(a: Complex) -> f64 {
    a.0.hypot(a.1)
}

/// `det(s I - J) s^c` is `det(s E - A)` up to a constant factor.
fn check_polynomial(
    built: &mut Built,
    count: &Count,
    t: f64,
    x: &[f64],
    random: &mut Random,
    seen: &mut Seen,
) -> Result<(), Fault> {
    let n = x.len();
    let mut jacobian = vec![vec![0.0; n]; n];
    for j in 0..n {
        let (mut v, mut jv) = (vec![0.0; n], vec![0.0; n]);
        v[j] = 1.0;
        if let Err(failure) = built.model.directional_derivative(t, x, &v, &mut jv) {
            return fault("tangent", failure.to_string());
        }
        (0..n).for_each(|i| jacobian[i][j] = jv[i]);
    }
    let leading = count.polynomial.last().expect("regular").clone();
    let coefficients: Vec<f64> = count.polynomial.iter().map(|c| float(&(c / &leading))).collect();
    for radius in [0.1, 1.0, 10.0] {
        let angle = random.unit() * 3.0;
        let s = (radius * angle.cos(), radius * angle.sin());
        let mut wanted = (0.0, 0.0);
        let mut terms = 0.0;
        for &c in coefficients.iter().rev() {
            wanted = times(wanted, s);
            wanted.0 += c;
            terms = terms * radius + c.abs();
        }
        let mut found = shifted_determinant(&jacobian, s);
        (0..built.conserved).for_each(|_| found = times(found, s));
        let error = size((found.0 - wanted.0, found.1 - wanted.1)) / terms;
        seen.within("eigenvalues", error, 1e-10, || format!("at s = {s:?}: {found:?}, not {wanted:?}"))?;
    }
    Ok(())
}

/// `det(s I - J)`.
fn shifted_determinant(jacobian: &[Vec<f64>], s: Complex) -> Complex {
    let n = jacobian.len();
    let entry = |i: usize, j: usize| if i == j { (s.0 - jacobian[i][j], s.1) } else { (-jacobian[i][j], 0.0) };
    let mut m: Vec<Vec<Complex>> = (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect();
    let mut result = (1.0, 0.0);
    for k in 0..n {
        let pivot = (k..n).max_by(|&a, &b| size(m[a][k]).total_cmp(&size(m[b][k]))).expect("rows are left");
        if size(m[pivot][k]) == 0.0 {
            return (0.0, 0.0);
        }
        if pivot != k {
            m.swap(pivot, k);
            result = (-result.0, -result.1);
        }
        result = times(result, m[k][k]);
        let head = m[k].clone();
        let norm = head[k].0 * head[k].0 + head[k].1 * head[k].1;
        let inverse = (head[k].0 / norm, -head[k].1 / norm);
        for row in &mut m[k + 1..] {
            let factor = times(row[k], inverse);
            for (value, &above) in row[k + 1..].iter_mut().zip(&head[k + 1..]) {
                let change = times(factor, above);
                *value = (value.0 - change.0, value.1 - change.1);
            }
        }
    }
    result
}

/// Values of the variables that have one, by name.
struct Values {
    of: BTreeMap<String, f64>,
}

impl Values {
    fn get(&self, name: &str) -> Option<f64> {
        self.of.get(name).copied()
    }

    fn effort(&self, bond: usize) -> Option<f64> {
        self.get(&format!("b{bond}.e"))
    }

    fn flow(&self, bond: usize) -> Option<f64> {
        self.get(&format!("b{bond}.f"))
    }
}

fn observe(model: &mut Model, t: f64, x: &[f64]) -> Result<Values, Fault> {
    let mut out = vec![0.0; model.observed()];
    if let Err(failure) = model.observe(t, x, &mut out) {
        return fault("observe", failure.to_string());
    }
    let names = (0..out.len()).map(|i| model.observed_name(i));
    let of: BTreeMap<String, f64> = names.zip(out.iter().copied()).collect();
    match of.iter().find(|(_, v)| !v.is_finite()) {
        Some((name, value)) => fault("not finite", format!("{name} = {value}")),
        None => Ok(Values { of }),
    }
}

/// Whether a modulus all but vanishes at a point: some variable is infinite, or has no digits left of the others.
fn is_beside_a_pole(model: &mut Model, t: f64, x: &[f64]) -> bool {
    model.record_all();
    let mut out = vec![0.0; model.observed()];
    match model.observe(t, x, &mut out) {
        Ok(()) => out.iter().any(|v| v.is_nan() || v.abs() > POLE),
        Err(Failure::NotFinite { .. }) => true,
        Err(_) => false,
    }
}

/// All raw equations, power and rates at one point.
fn check_point(graph: &Graph, model: &mut Model, t: f64, x: &[f64], seen: &mut Seen) -> Result<(), Fault> {
    model.record_all();
    let values = observe(model, t, x)?;
    check_equations(graph, &values, t, seen)?;
    check_power(graph, &values, seen)?;
    check_rates(graph, model, &values, t, x, seen)
}

fn check_equations(graph: &Graph, values: &Values, t: f64, seen: &mut Seen) -> Result<(), Fault> {
    let most =
        |of: &dyn Fn(usize) -> Option<f64>| (0..graph.bonds.len()).filter_map(of).fold(0.0f64, |a, b| a.max(b.abs()));
    let floor = 1e-3 * most(&|b| values.effort(b)).max(most(&|b| values.flow(b)));
    for node in 0..graph.nodes.len() {
        for terms in equations(graph, node, values, t) {
            let Some(terms) = terms.into_iter().collect::<Option<Vec<f64>>>() else { continue };
            let sum: f64 = terms.iter().sum();
            let scale: f64 = terms.iter().map(|t| t.abs()).sum::<f64>() + floor;
            let error = if sum == 0.0 { 0.0 } else { sum.abs() / scale };
            seen.within("equation", error, 1e-10, || format!("{} {terms:?}", graph.name(node)))?;
        }
    }
    Ok(())
}

type Terms = Vec<Option<f64>>;

/// The raw equations of a node as terms that sum to zero.
fn equations(graph: &Graph, node: usize, values: &Values, t: f64) -> Vec<Terms> {
    let at = graph.bonds_at(node);
    let Some(&(first, _)) = at.first() else { return Vec::new() };
    let (e, f) = (|b: usize| values.effort(b), |b: usize| values.flow(b));
    let minus = |v: Option<f64>| v.map(|v| -v);
    let signed = |v: Option<f64>, inward: bool| if inward { v } else { v.map(|v| -v) };
    let stored = values.get(&graph.stored_name(node));
    let cubic = |c: Option<Number>, x: f64| c.map_or(0.0, |c| c.value() * x * x * x);
    match graph.nodes[node].kind {
        Kind::Zero => {
            let mut all: Vec<Terms> = at[1..].iter().map(|&(b, _)| vec![e(first), minus(e(b))]).collect();
            all.push(at.iter().map(|&(b, inward)| signed(f(b), inward)).collect());
            all
        }
        Kind::One => {
            let mut all: Vec<Terms> = at[1..].iter().map(|&(b, _)| vec![f(first), minus(f(b))]).collect();
            all.push(at.iter().map(|&(b, inward)| signed(e(b), inward)).collect());
            all
        }
        Kind::Transformer(m) | Kind::Gyrator(m) => {
            let input = at.iter().find(|b| b.1).expect("a bond in").0;
            let output = at.iter().find(|b| !b.1).expect("a bond out").0;
            let m = modulus(graph, m, values);
            let by = |v: Option<f64>| v.and_then(|v| m.map(|m| -m * v));
            if matches!(graph.nodes[node].kind, Kind::Transformer(_)) {
                vec![vec![e(input), by(e(output))], vec![f(output), by(f(input))]]
            } else {
                vec![vec![e(input), by(f(output))], vec![e(output), by(f(input))]]
            }
        }
        Kind::Effort(s) => vec![vec![e(first), minus(signal(graph, s, values, t))]],
        Kind::Flow(s) => vec![vec![f(first), minus(signal(graph, s, values, t))]],
        Kind::Held => vec![vec![f(first)]],
        Kind::Inertance(law) => {
            let value = stored.map(|p| -(p / law.size.value() + cubic(law.cubic, p)));
            vec![vec![f(first), value]]
        }
        Kind::Compliance(law) => {
            let value = stored.map(|q| -(q * law.size.value() + cubic(law.cubic, q)));
            vec![vec![e(first), value]]
        }
        Kind::Resistor(law) => match law {
            Resisting::Resistance(r) => vec![vec![e(first), f(first).map(|f| -r.value() * f)]],
            Resisting::Conductance(g) => vec![vec![f(first), e(first).map(|e| -g.value() * e)]],
            Resisting::CubicEffort(a, b) => {
                vec![vec![e(first), f(first).map(|f| -a.value() * f - b.value() * f * f * f)]]
            }
            Resisting::CubicFlow(a, b) => {
                vec![vec![f(first), e(first).map(|e| -a.value() * e - b.value() * e * e * e)]]
            }
        },
    }
}

fn signal(graph: &Graph, signal: Signal, values: &Values, t: f64) -> Option<f64> {
    Some(match signal {
        Signal::Waving(a, b) => a.value() + b.value() * t.sin(),
        Signal::Input(default) => default.value(),
        Signal::Sensed(a, b, junction) => {
            let read = if matches!(graph.nodes[junction].kind, Kind::Zero) { "e" } else { "f" };
            a.value() + b.value() * values.get(&format!("{}.{read}", graph.name(junction)))?
        }
    })
}

fn modulus(graph: &Graph, modulus: Modulus, values: &Values) -> Option<f64> {
    match modulus {
        Modulus::Constant(number) => Some(number.value()),
        Modulus::Varying { a, b, of, sine } => {
            let name = match of {
                Reading::Stored(n) => graph.stored_name(n),
                Reading::Integral(n) => format!("phi{n}"),
            };
            let x = values.get(&name)?;
            Some(a.value() + b.value() * if sine { x.sin() } else { x })
        }
    }
}

/// No junction structure keeps or loses power: what sources and laws bring sums to zero.
fn check_power(graph: &Graph, values: &Values, seen: &mut Seen) -> Result<(), Fault> {
    let variables = (0..graph.bonds.len()).flat_map(|b| [values.effort(b), values.flow(b)]).flatten();
    let largest = variables.fold(0.0f64, |most, v| most.max(v.abs()));
    // An effort that should be 0 and is what rounding left of others makes no power to speak of.
    let (mut sum, mut scale) = (0.0, 1e-3 * largest * largest);
    for (node, it) in graph.nodes.iter().enumerate() {
        let Some(bond) = graph.bond_of(node) else { continue };
        if matches!(it.kind, Kind::Zero | Kind::One | Kind::Transformer(_) | Kind::Gyrator(_)) {
            continue;
        }
        let (e, f) = (values.effort(bond), values.flow(bond));
        let power = match (e, f) {
            (Some(e), Some(f)) => e * f,
            (Some(z), None) | (None, Some(z)) if z == 0.0 => 0.0,
            _ => return Ok(()),
        };
        let signed = if graph.bonds[bond].to == node { power } else { -power };
        sum += signed;
        scale += signed.abs();
    }
    let error = if sum == 0.0 { 0.0 } else { f64::abs(sum) / scale };
    seen.within("power", error, 1e-12, || format!("{sum} of {scale}"))
}

/// The stored quantity of every storage moves as its bond says, by differences along the rates of the model.
fn check_rates(
    graph: &Graph,
    model: &mut Model,
    values: &Values,
    t: f64,
    x: &[f64],
    seen: &mut Seen,
) -> Result<(), Fault> {
    let mut dx = vec![0.0; x.len()];
    if let Err(failure) = model.rates(t, x, &mut dx) {
        return fault("rates", failure.to_string());
    }
    let fastest = dx.iter().fold(1.0f64, |a, b| a.max(b.abs()));
    let mut best: BTreeMap<usize, (f64, String)> = BTreeMap::new();
    for h in [0.02, 0.002, 0.0002].map(|h| h / fastest) {
        let Some(errors) = differences(graph, model, values, (t, x, &dx), h)? else { return Ok(()) };
        for (node, error, details) in errors {
            let best = best.entry(node).or_insert((f64::INFINITY, String::new()));
            if error < best.0 {
                *best = (error, details);
            }
        }
        if best.values().all(|b| b.0 < 1e-9) {
            break;
        }
    }
    for (error, details) in best.values() {
        seen.within("rate", *error, 1e-7, || details.clone())?;
    }
    Ok(())
}

type Errors = Vec<(usize, f64, String)>;

/// Rates of stored quantities by differences of order six: storage, relative error, what was found. `None` where the
/// model has no value nearby.
fn differences(
    graph: &Graph,
    model: &mut Model,
    values: &Values,
    (t, x, dx): (f64, &[f64], &[f64]),
    h: f64,
) -> Result<Option<Errors>, Fault> {
    let fastest = dx.iter().fold(1.0f64, |a, b| a.max(b.abs()));
    let mut around = Vec::new();
    for k in [-3.0, -2.0, -1.0, 1.0, 2.0, 3.0] {
        let moved: Vec<f64> = x.iter().zip(dx).map(|(x, d)| x + k * h * d).collect();
        match observe(model, t + k * h, &moved) {
            Ok(values) => around.push(values),
            Err(_) if !graph.has_constant_structure() => return Ok(None),
            Err(fault) => return Err(fault),
        }
    }
    let weights = [-1.0, 9.0, -45.0, 45.0, -9.0, 1.0];
    let mut errors = Errors::new();
    for node in graph.storages() {
        let name = graph.stored_name(node);
        let bond = graph.bond_of(node).expect("used");
        let inertance = matches!(graph.nodes[node].kind, Kind::Inertance(_));
        let expected = if inertance { values.effort(bond) } else { values.flow(bond) };
        let stored: Option<Vec<f64>> = around.iter().map(|v| v.get(&name)).collect();
        let (Some(expected), Some(stored)) = (expected, stored) else { continue };
        let found: f64 = weights.iter().zip(&stored).map(|(w, v)| w * v).sum::<f64>() / (60.0 * h);
        let largest = stored.iter().fold(0.0f64, |a, b| a.max(b.abs()));
        if largest > POLE && !graph.has_constant_structure() {
            return Ok(None);
        }
        let error = (found - expected).abs() / (expected.abs() + fastest + largest);
        errors.push((node, error, format!("{name}' = {found} by differences, {expected} by its bond")));
    }
    Ok(Some(errors))
}

struct Last(Vec<(f64, Vec<f64>)>);

impl Sink for Last {
    fn sample(&mut self, t: f64, values: &[f64]) {
        self.0.push((t, values.to_vec()));
    }
}

/// A short run: the raw equations and power hold on the way.
fn check_run(graph: &Graph, model: &mut Model, x: &[f64], seen: &mut Seen) -> Result<(), Fault> {
    model.record_all();
    let mut dx = vec![0.0; x.len()];
    if let Err(failure) = model.rates(0.0, x, &mut dx) {
        return fault("rates", failure.to_string());
    }
    let step = 1e-3 / dx.iter().fold(1.0f64, |a, b| a.max(b.abs()));
    let method = Method::Fixed(FixedMethod::Rk4);
    let options = Options { method, to: 5.0 * step, step: Some(step), ..Options::default() };
    let (mut x, mut samples) = (x.to_vec(), Last(Vec::new()));
    if let Err(stopped) = simulate(model, &options, &mut x, &mut samples) {
        return if graph.has_constant_structure() { fault("run", stopped.to_string()) } else { Ok(()) };
    }
    let names: Vec<String> = (0..model.observed()).map(|i| model.observed_name(i)).collect();
    for (t, sample) in samples.0 {
        let values = Values { of: names.iter().cloned().zip(sample).collect() };
        check_equations(graph, &values, t, seen)?;
        check_power(graph, &values, seen)?;
    }
    Ok(())
}
