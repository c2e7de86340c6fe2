//! Which equations a set of parameters is run with: those of the model as it stands, or others, where its values break
//! what these rest on, or shape the model otherwise.

use std::collections::BTreeMap;

use halfarrow_compiler::bond_graph::Override;
use halfarrow_compiler::unit::Unit;
use halfarrow_exec::{self as exec, ParameterError};
use halfarrow_sim::Options;

use super::Sweep;
use super::plan::Plan;
use crate::error::Error;
use crate::input::connect;
use crate::model::Model;
use crate::run::{Record, choose, options, projected};

/// A model whose equations hold for some of the sets.
pub(super) struct Structure {
    pub model: Model,
    pub system: exec::Model,
}

/// All that the sets need, each derived once, at the first set that needs it.
pub(super) struct Structures {
    all: Vec<Structure>,
    /// The sets that are not run with the first one: with which, or why with none.
    others: BTreeMap<usize, Result<usize, String>>,
}

impl Structures {
    /// Goes over the sets in their order, so that what they are run with does not depend on who runs them.
    pub fn of(model: &Model, system: &exec::Model, sweep: &Sweep, plan: &Plan) -> Structures {
        let first = Structure { model: model.clone(), system: system.clone() };
        let mut structures = Structures { all: vec![first], others: BTreeMap::new() };
        for set in 0..plan.sets() {
            let known = structures.all.iter_mut().position(|s| holds(&mut s.system, plan, set));
            let found = match known {
                Some(0) => continue,
                Some(index) => Ok(index),
                None => structures.derive(sweep, plan, set),
            };
            structures.others.insert(set, found);
        }
        structures
    }

    /// With which equations a set is run, by their number; an error where there are none.
    pub fn number(&self, set: usize) -> Result<usize, String> {
        self.others.get(&set).cloned().unwrap_or(Ok(0))
    }

    /// The equations with a number.
    pub fn get(&self, number: usize) -> &Structure {
        &self.all[number]
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.all.len()
    }

    /// The equations that hold with the values of a set.
    fn derive(&mut self, sweep: &Sweep, plan: &Plan, set: usize) -> Result<usize, String> {
        let mut structure = derived(&self.all[0], sweep, plan, set).map_err(|error| error.to_string())?;
        set_all(&mut structure.system, plan, set)?;
        if let Some(failure) = structure.system.broken() {
            return Err(failure.to_string());
        }
        self.all.push(structure);
        Ok(self.all.len() - 1)
    }
}

fn derived(first: &Structure, sweep: &Sweep, plan: &Plan, set: usize) -> Result<Structure, Error> {
    let model = first.model.with(&overrides(plan, set))?;
    let mut system = model.system_in(sweep.run.form)?;
    connect(&system.program().inputs.clone(), &sweep.run.inputs, |name, t, v| system.connect(name, t, v))?;
    let observed = &first.system.program().observed;
    let recorded = first.system.recorded().iter().map(|&i| observed[i].name.to_string()).collect();
    choose(&mut system, &Record::Names(recorded))?;
    let options: Options = options(&sweep.run)?;
    let bad = |failure: halfarrow_sim::Failure| crate::error::Problem::BadOption { reason: failure.to_string() };
    options.check(system.program().states.len()).map_err(bad)?;
    projected(system.program(), sweep.run.project, sweep.run.method)?;
    Ok(Structure { model, system })
}

/// The values of a set as they would be given to the model itself.
fn overrides(plan: &Plan, set: usize) -> Vec<Override> {
    let text = |value: f64, unit: &Option<Unit>| match unit {
        Some(unit) => format!("{value:?} {unit}").trim_end().to_string(),
        None => format!("{value:?}"),
    };
    let named = plan.names().iter().zip(plan.units()).zip(plan.values(set));
    named.map(|((name, unit), value)| Override { name: name.clone(), value: text(value, unit) }).collect()
}

/// Whether the equations are those of a set. A set that cannot be set at all is left to its run, which says so.
fn holds(system: &mut exec::Model, plan: &Plan, set: usize) -> bool {
    match system.set_parameters(plan.names().iter().map(String::as_str).zip(plan.values(set))) {
        Ok(()) => system.broken().is_none(),
        Err(ParameterError::Unsolvable(_) | ParameterError::Shapes(_)) => false,
        Err(_) => true,
    }
}

/// Sets all parameters of a set.
pub(super) fn set_all(system: &mut exec::Model, plan: &Plan, set: usize) -> Result<(), String> {
    let values = plan.values(set);
    let named = plan.names().iter().map(String::as_str).zip(values.iter().copied());
    system.set_parameters(named).map_err(|why| {
        let all: Vec<String> =
            plan.names().iter().zip(&values).map(|(name, value)| format!("{name} = {value}")).collect();
        format!("{}: {why}", all.join(", "))
    })
}
