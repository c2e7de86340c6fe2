//! What is set before a run: values of parameters, what is connected to inputs.

use super::compiled::{Compiled, Mode, ModeId};
use super::inputs::InputSignal;
use super::{InputError, ParameterError};

/// Parameters and inputs of a model, for each of its modes.
#[derive(Debug, Clone)]
pub struct Setup {
    modes: Vec<Given>,
}

/// What is given to one mode.
#[derive(Debug, Clone)]
pub(super) struct Given {
    /// Values of parameters that have been set, in SI units.
    pub parameters: Vec<Option<f64>>,
    /// What is connected to each input.
    pub inputs: Vec<InputSignal>,
}

impl Setup {
    /// All parameters at their defaults, nothing connected.
    pub fn new(compiled: &Compiled) -> Setup {
        let given = |mode: &Mode| Given {
            parameters: vec![None; mode.program.parameters.len()],
            inputs: mode.program.inputs.iter().map(|_| InputSignal::default()).collect(),
        };
        Setup { modes: compiled.modes().map(given).collect() }
    }

    /// Sets a parameter, in SI units, in every mode that has it.
    ///
    /// # Errors
    /// There is no such parameter, it is a constant, it shapes the model and this is another value, or the value is not
    /// finite.
    pub fn set_parameter(&mut self, compiled: &Compiled, name: &str, value: f64) -> Result<(), ParameterError> {
        let mut known = false;
        for (mode, given) in compiled.modes().zip(&mut self.modes) {
            let parameters = &mode.program.parameters;
            let Some(index) = parameters.iter().position(|p| p.name == name) else { continue };
            if parameters[index].shapes {
                known |= mode.program.values.constant(parameters[index].default) == Some(value);
                match known {
                    true => continue,
                    false => return Err(ParameterError::Shapes(name.to_string())),
                }
            }
            if parameters[index].constant {
                return Err(ParameterError::Constant(name.to_string()));
            }
            if !value.is_finite() {
                return Err(ParameterError::NotFinite(name.to_string()));
            }
            given.parameters[index] = Some(value);
            known = true;
        }
        if known { Ok(()) } else { Err(ParameterError::Unknown(name.to_string())) }
    }

    /// Connects a table of values over time to an input, in every mode that has it: straight lines between the points, the
    /// first value before them, the last one after them. A time given twice is a jump.
    ///
    /// # Errors
    /// There is no such input, or the points are no function of time.
    pub fn connect(
        &mut self,
        compiled: &Compiled,
        input: &str,
        times: &[f64],
        values: &[f64],
    ) -> Result<(), InputError> {
        let signal = InputSignal::table(times, values);
        let mut known = false;
        for (mode, given) in compiled.modes().zip(&mut self.modes) {
            let Some(index) = mode.program.inputs.iter().position(|i| i.name == input) else { continue };
            given.inputs[index] = signal.clone().map_err(|why| InputError::Points(input.to_string(), why))?;
            known = true;
        }
        if known { Ok(()) } else { Err(InputError::Unknown(input.to_string())) }
    }

    pub(super) fn given(&self, mode: ModeId) -> &Given {
        &self.modes[mode.0 as usize]
    }

    pub(super) fn given_mut(&mut self, mode: ModeId) -> &mut Given {
        &mut self.modes[mode.0 as usize]
    }
}
