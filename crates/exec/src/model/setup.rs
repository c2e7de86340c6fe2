//! What is set before a run: values of parameters, what is connected to inputs.

use super::compiled::Compiled;
use super::inputs::InputSignal;
use super::{InputError, ParameterError};

/// Parameters and inputs of a model: the same in all its modes, which are made of one bond graph.
#[derive(Debug, Clone)]
pub struct Setup {
    /// Values of parameters that have been set, in SI units.
    pub(super) parameters: Vec<Option<f64>>,
    /// What is connected to each input.
    pub(super) inputs: Vec<InputSignal>,
}

impl Setup {
    /// All parameters at their defaults, nothing connected.
    pub fn new(compiled: &Compiled) -> Setup {
        let program = &compiled.first().program;
        Setup {
            parameters: vec![None; program.parameters.len()],
            inputs: program.inputs.iter().map(|_| InputSignal::default()).collect(),
        }
    }

    /// Sets a parameter, in SI units.
    ///
    /// # Errors
    /// There is no such parameter, it is a constant, it shapes the model and this is another value, or the value is not
    /// finite.
    pub fn set_parameter(&mut self, compiled: &Compiled, name: &str, value: f64) -> Result<(), ParameterError> {
        let mode = compiled.first();
        let parameters = &mode.program.parameters;
        let index = parameters.iter().position(|p| p.name == name);
        let index = index.ok_or_else(|| ParameterError::Unknown(name.to_string()))?;
        if parameters[index].shapes {
            let same = mode.program.values.constant(parameters[index].default) == Some(value);
            return if same { Ok(()) } else { Err(ParameterError::Shapes(name.to_string())) };
        }
        if parameters[index].constant {
            return Err(ParameterError::Constant(name.to_string()));
        }
        if !value.is_finite() {
            return Err(ParameterError::NotFinite(name.to_string()));
        }
        self.parameters[index] = Some(value);
        Ok(())
    }

    /// Connects a table of values over time to an input: straight lines between the points, the first value before them,
    /// the last one after them. A time given twice is a jump.
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
        let index = compiled.first().program.inputs.iter().position(|i| i.name == input);
        let index = index.ok_or_else(|| InputError::Unknown(input.to_string()))?;
        self.inputs[index] = signal.map_err(|why| InputError::Points(input.to_string(), why))?;
        Ok(())
    }
}
