//! A model near a point: matrices, poles, zeros, what inputs reach and outputs see.

mod known;
mod picture;
mod response;
mod stability;
mod state_space;
mod structure;
mod symbolic;
mod zeros;

use std::sync::Arc;

use halfarrow_compiler::bond_graph::{self, BondGraph, ElementId, HeldKind, InputId, Kind, Meaning, Variable};
use halfarrow_compiler::equations::{Equations, Form, Position};
use halfarrow_compiler::program::{Observed, Program};
use halfarrow_exec::{self as exec, Linearised};
use halfarrow_sim::{Events as _, Failure, Nobody, Options, simulate};
use serde::Serialize;

use crate::error::{Error, Problem};
use crate::input::{Input, connect};
use crate::linear_algebra::{Complex, eigenvalues};
use crate::model::Model;
use crate::run::{Start, one_of_many};

use state_space::StateSpace;

pub use response::Response;
pub use stability::Stability;
pub use structure::ReachReport;
pub use symbolic::{SymbolicReport, TransferFunction};

/// Tolerance of the run to the time at which is linearised.
const RTOL: f64 = 1e-10;
/// Matrices of more states are not formed: poles take the cube of their number.
const MOST_STATES: usize = 2000;

/// Where to linearise, and between what.
#[derive(Debug, Clone, PartialEq)]
pub struct Linearize {
    /// Where.
    pub at: Point,
    /// Inputs: declared ones, and sources, to whose value the input is added. `None`: the declared ones; if there are
    /// none, the sources that are written in the model itself, not within its parts.
    pub inputs: Option<Vec<String>>,
    /// Outputs: anything that can be recorded. `None`: the declared ones; if there are none, the states.
    pub outputs: Option<Vec<String>>,
    /// Whether matrices and transfer functions are to be told as expressions too.
    pub symbolic: bool,
    /// Inputs that are given: their names and what they are over time.
    pub series: Vec<(String, Input)>,
}

impl Default for Linearize {
    /// At the start, between declared inputs and outputs, in numbers.
    fn default() -> Linearize {
        Linearize { at: Point::Start, inputs: None, outputs: None, symbolic: false, series: Vec::new() }
    }
}

/// A point of the motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Point {
    /// The start.
    Start,
    /// Where a run is at this time, in s.
    Time(f64),
    /// At rest, near the start.
    Equilibrium,
}

/// What `halfarrow linearize` tells: `x' = f + A dx + B du`, `y = g + C dx + D du`. SI units.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LinearizeReport {
    /// Name of the model.
    pub model: String,
    /// `start`, `time` or `equilibrium`.
    pub at: &'static str,
    /// The time, in s.
    pub t: f64,
    /// States, with their values and rates at the point.
    pub states: Vec<StateAt>,
    /// Positions that constraints compute from these, with their values at the point.
    pub positions: Vec<PositionAt>,
    /// Inputs.
    pub inputs: Vec<Terminal>,
    /// Outputs.
    pub outputs: Vec<Terminal>,
    /// Derivatives of rates by states.
    pub a: Vec<Vec<f64>>,
    /// Derivatives of rates by inputs.
    pub b: Vec<Vec<f64>>,
    /// Derivatives of outputs by states.
    pub c: Vec<Vec<f64>>,
    /// Derivatives of outputs by inputs.
    pub d: Vec<Vec<f64>>,
    /// Eigenvalues of `a`: real and imaginary part.
    pub poles: Vec<Complex>,
    /// What the poles mean; a pair counts once.
    pub modes: Vec<Mode>,
    /// Invariant zeros, in 1/s: where inputs can move the states and no output sees it, or states move that no input
    /// reaches; `None` if they do not come out.
    pub zeros: Option<Vec<Complex>>,
    /// Whether all poles are left of the imaginary axis.
    pub stable: bool,
    /// On which side of the imaginary axis the poles are, beyond what rounding leaves open.
    pub stability: Stability,
    /// What the inputs reach.
    pub controllability: ReachReport,
    /// What the outputs see.
    pub observability: ReachReport,
    /// Matrices and transfer functions as expressions, if asked for.
    pub symbolic: Option<SymbolicReport>,
    /// What is to be known.
    pub notes: Vec<String>,
}

/// A state at the point.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StateAt {
    /// Its name.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Its rate.
    pub rate: f64,
    /// SI unit, where known.
    pub unit: Option<String>,
}

/// A computed position at the point.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PositionAt {
    /// Its name.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// SI unit, where known.
    pub unit: Option<String>,
}

/// An input or output.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Terminal {
    /// Its name.
    pub name: String,
    /// SI unit, where known.
    pub unit: Option<String>,
}

/// A real pole or a pair of complex ones.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Mode {
    /// Real and imaginary part, the latter at least 0.
    pub pole: Complex,
    /// Its magnitude, in rad/s.
    pub natural_frequency: f64,
    /// Part of critical damping: 1 for a pole on the negative real axis, negative if it grows; 0 for a pole at 0.
    pub damping: f64,
    /// Time in which it falls to 1/e, in s; `None` if it does not fall.
    pub time_constant: Option<f64>,
}

impl Model {
    /// Linearises with exact derivatives.
    ///
    /// # Errors
    /// The model has errors, an input or output does not exist, there is no such point, or the model holds a delay, which
    /// has no matrices.
    pub fn linearize(&self, wanted: &Linearize) -> Result<LinearizeReport, Error> {
        if let Some(delayed) = self.graph.held.values().find(|h| h.kind == HeldKind::Delay) {
            return Err(Problem::NoMatrices { reason: delay(&delayed.name) }.into());
        }
        let (names, model) = self.with_inputs(wanted.inputs.as_deref())?;
        model.linearize_between(wanted, &names)
    }

    /// The names of the inputs, and the model in which they are all declared.
    fn with_inputs(&self, wanted: Option<&[String]>) -> Result<(Vec<String>, Model), Error> {
        let declared = || self.graph.inputs.values().map(|i| i.name.clone()).collect::<Vec<_>>();
        let sources = || {
            let sources = self.graph.elements.iter().filter(|(id, _)| is_source(&self.graph, *id));
            sources.map(|(_, e)| e.name.clone()).collect::<Vec<_>>()
        };
        let names = match wanted {
            Some(names) => names.to_vec(),
            // A source within a part is that part's own.
            None if self.graph.inputs.is_empty() => sources().into_iter().filter(|name| !name.contains('.')).collect(),
            None => declared(),
        };
        let mut model = self.clone();
        for name in names.iter().filter(|name| !declared().contains(*name)) {
            if !add_input(Arc::make_mut(&mut model.graph), name) {
                let known = declared().into_iter().chain(sources()).collect();
                return Err(Problem::UnknownInput { name: name.clone(), known }.into());
            }
        }
        Ok((names, model))
    }

    fn linearize_between(&self, wanted: &Linearize, inputs: &[String]) -> Result<LinearizeReport, Error> {
        let equations = self.equations_in(Form::Minimal)?;
        let mut system = self.system(&equations)?;
        let size = system.program().states.len();
        if size > MOST_STATES {
            return Err(Problem::NoMatrices { reason: too_many(size) }.into());
        }
        connect(&system.program().inputs.clone(), &wanted.series, |name, t, v| system.connect(name, t, v))?;
        let outputs = wanted.outputs.clone().unwrap_or_else(|| default_outputs(&self.graph, system.program()));
        let names: Vec<&str> = outputs.iter().map(String::as_str).collect();
        system.record(&names).map_err(|error| crate::run::refused(&system, error))?;
        let mut notes = Vec::new();
        let (at, t, mut x) = self.go_to(&mut system, wanted.at, &mut notes)?;
        // From here on in the mode of that point.
        let present = self.as_in(&system);
        let equations =
            if self.graph.set_valued.is_empty() { equations } else { present.equations_in(Form::Minimal)? };
        x.truncate(system.program().own_states().len());
        if !self.graph.set_valued.is_empty() {
            notes
                .push(format!("set-valued laws keep the branches that they have there: {}", present.graph.mode_name()));
        }
        let of = |name: &String| system.program().inputs.iter().position(|i| i.name == *name);
        let places: Vec<usize> = inputs.iter().filter_map(of).collect();
        let linear = system.linearise(t, &x, &places).map_err(|failure| self.stopped(failure))?;
        let Some(poles) = eigenvalues(&linear.a) else {
            return Err(Problem::NoMatrices { reason: "the eigenvalues do not come out".into() }.into());
        };
        let (stability, uncertain) = stability::stability(&linear.a, &poles);
        notes.extend(uncertain);
        let scaled = StateSpace::scaled(&linear);
        let (zeros, uncertain) = zeros::zeros(scaled.as_ref());
        notes.extend(uncertain);
        notes.extend(self.what_holds(&system, &linear, at));
        let symbolic =
            if wanted.symbolic { Some(symbolic::matrices(equations.clone(), inputs, &outputs)?) } else { None };
        let positions = positions(&mut system, &equations, t, &x).map_err(|failure| self.stopped(failure))?;
        let program = system.program();
        let (controllability, observability) = present.reaches((scaled, linear.a.len()), inputs, &outputs)?;
        Ok(LinearizeReport {
            model: self.name().to_string(),
            at,
            t,
            states: states(program, &x, &linear.rates),
            positions,
            inputs: inputs.iter().map(|name| terminal(name, input_unit(program, name))).collect(),
            outputs: outputs
                .iter()
                .map(|name| terminal(name, observed(program, name).and_then(|o| unit(&o.unit))))
                .collect(),
            modes: modes(&poles),
            zeros,
            stable: stability == Stability::Asymptotic,
            stability,
            poles,
            controllability,
            observability,
            symbolic,
            notes,
            a: linear.a,
            b: linear.b,
            c: linear.c,
            d: linear.d,
        })
    }

    /// Brings the system to the point: what it is called, time and state. The system is in the mode of that point.
    fn go_to(
        &self,
        system: &mut exec::Model,
        at: Point,
        notes: &mut Vec<String>,
    ) -> Result<(&'static str, f64, Vec<f64>), Error> {
        let (start, name) = match at {
            Point::Equilibrium => (Start::Equilibrium, "equilibrium"),
            _ => (Start::Given, "start"),
        };
        let (mut x, free) = self.start_with_freedom(system, start)?;
        match at {
            Point::Start | Point::Equilibrium => {
                system.handle_event(0.0, &mut x).map_err(|failure| self.stopped(failure))?;
                notes.extend(one_of_many(free));
                Ok((name, 0.0, x))
            }
            Point::Time(t) if t.is_finite() && t >= 0.0 => {
                if t == 0.0 {
                    return self.go_to(system, Point::Start, notes).map(|(_, t, x)| ("time", t, x));
                }
                let options = Options { to: t, rtol: RTOL, every: Some(t), ..Options::default() };
                let run = simulate(system, &options, &mut x, &mut Nobody);
                run.map_err(|stopped| self.stopped(stopped.failure))?;
                Ok(("time", t, x))
            }
            Point::Time(t) => {
                Err(Problem::BadOption { reason: format!("at is {t}: it has to be a time of 0 or above") }.into())
            }
        }
    }

    /// What the matrices are true of.
    fn what_holds(&self, system: &exec::Model, linear: &Linearised, at: &str) -> Vec<String> {
        let mut notes = Vec::new();
        let program = system.program();
        if at != "equilibrium" && linear.rates.iter().any(|&rate| rate != 0.0) {
            notes.push(
                "the model is not at rest there: the matrices tell how motions near this one part from it".into(),
            );
        }
        if !program.conserved.is_empty() {
            let names = program.conserved.join(", ");
            notes.push(format!("{names} keep their value: each stands for one more pole at 0"));
        }
        if system.indicators() > 0 {
            notes.push(format!(
                "conditions of the state keep the side they have there ({} of them)",
                system.indicators()
            ));
        }
        if !program.clauses.is_empty() {
            notes.push("discrete variables keep their value: the matrices hold between two events".into());
        }
        if program.held.iter().any(|h| h.kind == HeldKind::Sample) {
            notes.push("sampled signals keep their value: the matrices hold between two samples".into());
        }
        notes
    }
}

fn too_many(states: usize) -> String {
    format!(
        "{states} states are more than the {MOST_STATES} of which full matrices and all poles are computed: linearise a model with fewer cells; where it rests, `simulate --start equilibrium` tells"
    )
}

fn delay(name: &str) -> String {
    format!(
        "`{name}` is delayed, and a delay has no matrices of finite size: put a transfer function in its place, as in `tf(u, [-T/2, 1], [T/2, 1])`"
    )
}

fn is_source(graph: &BondGraph, element: ElementId) -> bool {
    let imposes = matches!(graph.elements[element].kind, Kind::EffortSource { .. } | Kind::FlowSource { .. });
    imposes && graph.set_valued.iter().all(|law| law.element != element)
}

/// Adds an input to the value of a source; whether there is such a source.
fn add_input(graph: &mut BondGraph, name: &str) -> bool {
    let Some(element) = graph.elements.iter().find(|(id, e)| e.name == name && is_source(graph, *id)).map(|(id, _)| id)
    else {
        return false;
    };
    let symbol = graph.exprs.symbol(&format!("{name}.input"), Default::default());
    let (own, default) = (graph.exprs.sym(symbol), graph.exprs.int(0));
    let bond = &graph.bonds[graph.elements[element].ports[0].bond];
    let (effort, flow) = (bond.effort, bond.flow);
    let span = graph.elements[element].span;
    let conjugate = match &mut graph.elements[element].kind {
        Kind::EffortSource { value } => {
            *value = graph.exprs.add(&[*value, own]);
            effort
        }
        Kind::FlowSource { value } => {
            *value = graph.exprs.add(&[*value, own]);
            flow
        }
        _ => return false,
    };
    let unit = graph.variables.get(&conjugate).and_then(|v| v.unit.clone());
    let id: InputId = graph.inputs.push(bond_graph::Input {
        name: name.to_string(),
        symbol,
        default,
        unit: unit.clone(),
        doc: String::new(),
        span,
    });
    graph.variables.insert(symbol, Variable { meaning: Meaning::Input(id), unit });
    true
}

/// The declared outputs; without any the states.
fn default_outputs(graph: &BondGraph, program: &Program) -> Vec<String> {
    match graph.outputs.is_empty() {
        true => program.own_states().iter().map(|s| s.name.clone()).collect(),
        false => graph.outputs.iter().map(|o| o.name.clone()).collect(),
    }
}

fn observed<'p>(program: &'p Program, name: &str) -> Option<&'p Observed> {
    program.observed.iter().find(|o| *o.name == *name)
}

fn unit(unit: &Option<halfarrow_compiler::unit::Unit>) -> Option<String> {
    unit.as_ref().map(|unit| unit.to_si_unit().to_string()).filter(|unit| !unit.is_empty())
}

fn input_unit(program: &Program, name: &str) -> Option<String> {
    program.inputs.iter().find(|i| i.name == name).and_then(|i| unit(&i.unit))
}

fn terminal(name: &str, unit: Option<String>) -> Terminal {
    Terminal { name: name.to_string(), unit }
}

fn states(program: &Program, x: &[f64], rates: &[f64]) -> Vec<StateAt> {
    let state = |((state, value), rate): ((&halfarrow_compiler::program::State, &f64), &f64)| StateAt {
        name: state.name.clone(),
        value: *value,
        rate: *rate,
        unit: unit(&state.unit),
    };
    program.own_states().iter().zip(x).zip(rates).map(state).collect()
}

/// The values of computed positions, which from now on are what is recorded.
fn positions(
    system: &mut halfarrow_exec::Model,
    equations: &Equations,
    t: f64,
    x: &[f64],
) -> Result<Vec<PositionAt>, Failure> {
    let names: Vec<&str> = equations.positions.iter().map(|p| p.name.as_str()).collect();
    system.record(&names).expect("positions have names and values");
    let mut values = vec![0.0; names.len()];
    system.observe(t, x, &mut values)?;
    let position = |(p, value): (&Position, f64)| PositionAt { name: p.name.clone(), value, unit: unit(&p.unit) };
    Ok(equations.positions.iter().zip(values).map(position).collect())
}

fn modes(poles: &[Complex]) -> Vec<Mode> {
    let mode = |&pole: &Complex| {
        let size = libm::hypot(pole[0], pole[1]);
        Mode {
            pole,
            natural_frequency: size,
            damping: if size > 0.0 { -pole[0] / size } else { 0.0 },
            time_constant: (pole[0] < 0.0).then(|| -1.0 / pole[0]),
        }
    };
    poles.iter().filter(|pole| pole[1] >= 0.0).map(mode).collect()
}
