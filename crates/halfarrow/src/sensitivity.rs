//! Sensitivities of a run: what it is differentiated by, and the columns that come of that.

use halfarrow_compiler::diagnostic::nearest;
use halfarrow_compiler::unit::Unit;
use halfarrow_exec::{self as exec, Quantity};
use halfarrow_sim::{AbsoluteTolerance, Method, Options};

use crate::error::Problem;
use crate::run::Run;
use crate::sweep::known_parameter;

/// What a run is differentiated by.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct By {
    pub quantity: Quantity,
    pub name: String,
    /// Its SI unit as text; empty where it has none, or none is known.
    pub unit: String,
}

/// What is asked for, by names.
pub(crate) fn quantities(system: &exec::Model, run: &Run) -> Result<Vec<By>, Problem> {
    let bad = |reason: String| Err(Problem::BadOption { reason });
    if run.sensitivities.is_empty() {
        return Ok(Vec::new());
    }
    if run.project || run.minimum_norm {
        return bad(
            "sensitivities do not go with project or minimum-norm, which are not differentiated: leave that out".into(),
        );
    }
    if matches!(run.method, Method::Fixed(method) if !method.goes_back()) {
        return bad(
            "sensitivities do not go with linearly implicit methods, which would need second derivatives of the model: take \
             implicit-midpoint or radau"
                .into(),
        );
    }
    let mut all: Vec<By> = Vec::new();
    for name in &run.sensitivities {
        if all.iter().any(|by| by.name == *name) {
            return bad(format!("sensitivities by `{name}` are asked for twice"));
        }
        all.push(quantity(system, name)?);
    }
    Ok(all)
}

/// The parameter, input or start value of a name; that of a start value is the name of a variable with `(0)`.
fn quantity(system: &exec::Model, name: &str) -> Result<By, Problem> {
    let program = system.program();
    let text =
        |unit: Option<&Unit>| unit.map(|unit| unit.to_si_unit().to_string()).filter(|u| u != "1").unwrap_or_default();
    let by = |quantity, unit: Option<&Unit>| By { quantity, name: name.to_string(), unit: text(unit) };
    let parameter = program.parameters.iter().any(|p| p.name == name);
    if let Some(variable) = name.strip_suffix("(0)").filter(|_| !parameter) {
        let given = || program.start.iter().enumerate().filter(|(_, c)| !c.firm);
        let unit = program.observed.iter().find(|o| *o.name == *variable).and_then(|o| o.unit.as_ref());
        let open = |i: &usize| program.start.iter().all(|c| !c.reads.contains(&(*i as u32)));
        let free = || (0..program.states.len()).filter(open);
        if let Some(state) = free().find(|&i| program.states[i].name == variable) {
            return Ok(by(Quantity::State(state), unit));
        }
        let Some((index, _)) = given().find(|(_, c)| c.name == variable) else {
            let names = given().map(|(_, c)| &c.name).chain(free().map(|i| &program.states[i].name));
            let known: Vec<String> = names.map(|name| format!("{name}(0)")).collect();
            let known = if known.is_empty() { "none".to_string() } else { known.join(", ") };
            let reason =
                format!("a run does not begin with a value that is given for {variable}; such values are: {known}");
            return Err(Problem::BadOption { reason });
        };
        return Ok(by(Quantity::Start(index), unit));
    }
    if let Some(index) = program.inputs.iter().position(|input| input.name == name) {
        let input = &program.inputs[index];
        return Ok(by(Quantity::Input(index), input.unit.as_ref().or(input.deduced.as_ref())));
    }
    let index = program.parameters.iter().position(|p| p.name == name);
    match index.map(|index| (index, &program.parameters[index])) {
        Some((_, parameter)) if parameter.shapes => {
            let reason = format!("`{name}` shapes the model: there is no derivative by it");
            Err(Problem::BadOption { reason })
        }
        Some((index, parameter)) if !parameter.constant => Ok(by(Quantity::Parameter(index), parameter.unit.as_ref())),
        Some(_) => known_parameter(system, name).and_then(|()| {
            Err(Problem::BadOption { reason: format!("`{name}` is a constant: declare it as a param to vary it") })
        }),
        None => {
            let inputs = program.inputs.iter().map(|i| i.name.as_str());
            let known = program.parameters.iter().filter(|p| !p.constant).map(|p| p.name.as_str()).chain(inputs);
            let hint = nearest(name, known).map(|n| format!("; did you mean `{n}`?")).unwrap_or_default();
            let reason = format!(
                "the model has no parameter or input `{name}`{hint} (a start value is written with its variable: `body.q(0)`)"
            );
            Err(Problem::BadOption { reason })
        }
    }
}

/// Tells the system, whose parameters and inputs are set.
pub(crate) fn vary(system: &mut exec::Model, by: &[By]) -> Result<(), Problem> {
    if by.is_empty() {
        return Ok(());
    }
    let quantities: Vec<Quantity> = by.iter().map(|by| by.quantity).collect();
    let names: Vec<String> = by.iter().map(|by| by.name.clone()).collect();
    system.vary(&quantities, &names).map_err(|reason| Problem::BadOption { reason })
}

/// The options of a run of the states and their derivatives: an absolute tolerance given for all states is one for each
/// derivative times what it is by.
pub(crate) fn with_derivatives(system: &exec::Model, options: &Options, by: &[By], states: usize) -> Options {
    let AbsoluteTolerance::Same(atol) = options.atol else { return options.clone() };
    let share = |by: &By| match system.size_of(by.quantity) {
        size if size > 0.0 => atol / size,
        _ => atol,
    };
    let shares = std::iter::once(atol).chain(by.iter().map(share));
    let each = shares.flat_map(|atol| std::iter::repeat_n(atol, states)).collect();
    Options { atol: AbsoluteTolerance::Each(each), ..options.clone() }
}

/// Name and unit of the derivative of a column.
pub(crate) fn column(name: &str, unit: &str, by: &By) -> (String, String) {
    let unit = match (unit, by.unit.as_str()) {
        (unit, "") => unit.to_string(),
        ("" | "1", by) => format!("1/({by})"),
        (unit, by) => format!("({unit})/({by})"),
    };
    (format!("d({name})/d({})", by.name), unit)
}
