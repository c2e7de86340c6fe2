//! What a compiled model takes and gives, by name.

use halfarrow_compiler::unit::Unit;
use serde::Serialize;

use crate::compiled::Compiled;

/// What a compiled model takes and gives.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Interface {
    /// Parameters and constants.
    pub parameters: Vec<InterfaceParameter>,
    /// Inputs.
    pub inputs: Vec<InterfaceInput>,
    /// Names of the states, in order.
    pub states: Vec<String>,
    /// All that can be recorded: states and outputs first.
    pub variables: Vec<InterfaceVariable>,
}

/// A parameter or constant.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct InterfaceParameter {
    /// Its name.
    pub name: String,
    /// Its value, in SI units.
    pub value: f64,
    /// SI unit, where known.
    pub unit: Option<String>,
    /// Whether it is a constant, which cannot be set.
    pub constant: bool,
    /// Whether it shapes the model, which is compiled anew for another value.
    pub shapes: bool,
}

/// An input.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct InterfaceInput {
    /// Its name.
    pub name: String,
    /// The unit of the values that it is given: the declared one, else the SI unit that follows, where known.
    pub unit: Option<String>,
}

/// A variable that can be recorded.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct InterfaceVariable {
    /// Its name.
    pub name: String,
    /// The unit of its values in results, where known.
    pub unit: Option<String>,
    /// Whether it is recorded without being asked for.
    pub default: bool,
}

impl Compiled {
    /// What it takes and gives.
    ///
    /// ```
    /// use halfarrow::{Form, Model};
    /// let text = "model Drop\nparam m = 2 kg\nSe:weight(9.81 N) -> I:mass(m)\n";
    /// let drop = Model::from_text("drop.bond", text, &[])?.compile(Form::Minimal)?.interface();
    /// assert_eq!((drop.parameters[0].value, drop.parameters[0].unit.as_deref()), (2.0, Some("kg")));
    /// assert_eq!((drop.states[0].as_str(), drop.variables[0].unit.as_deref()), ("mass.f", Some("m/s")));
    /// # Ok::<(), halfarrow::Error>(())
    /// ```
    pub fn interface(&self) -> Interface {
        let system = self.minimal();
        let program = system.program();
        let text = |unit: Option<&Unit>| unit.map(ToString::to_string);
        let known = program.parameters.iter().filter_map(|p| Some((p, system.parameter(&p.name)?)));
        Interface {
            parameters: known
                .map(|(p, value)| InterfaceParameter {
                    name: p.name.clone(),
                    value,
                    unit: text(p.unit.as_ref().map(Unit::to_si_unit).as_ref()),
                    constant: p.constant && !p.shapes,
                    shapes: p.shapes,
                })
                .collect(),
            inputs: (program.inputs.iter())
                .map(|i| InterfaceInput { name: i.name.clone(), unit: text(i.unit.as_ref().or(i.deduced.as_ref())) })
                .collect(),
            states: program.states.iter().map(|s| s.name.clone()).collect(),
            variables: (program.observed.iter().filter(|o| o.value.is_ok()))
                .map(|o| InterfaceVariable {
                    name: o.name.to_string(),
                    unit: text(o.unit.as_ref()),
                    default: o.default,
                })
                .collect(),
        }
    }
}
