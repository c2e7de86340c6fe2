//! A model near one state: exact derivatives of rates and recorded values by states and inputs.

use super::Model;
use super::system::What;
use halfarrow_sim::{Events as _, Failure, System as _};

/// `x' = f + A dx + B du`, `y = g + C dx + D du` near a state: matrices row by row, in SI units.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Linearised {
    /// Derivatives of rates by states: as many rows and columns as states.
    pub a: Vec<Vec<f64>>,
    /// Derivatives of rates by inputs.
    pub b: Vec<Vec<f64>>,
    /// Derivatives of recorded values by states.
    pub c: Vec<Vec<f64>>,
    /// Derivatives of recorded values by inputs.
    pub d: Vec<Vec<f64>>,
    /// The rates there; at an equilibrium 0.
    pub rates: Vec<f64>,
    /// The recorded values there.
    pub values: Vec<f64>,
}

impl Model {
    /// Linearises at time `t` and state `x`, in the present mode: conditions keep their side, held signals their value,
    /// conserved constants theirs. `inputs` are indices into [`Program::inputs`](halfarrow_compiler::program::Program);
    /// outputs is what is recorded.
    ///
    /// # Errors
    /// As [`rates`](halfarrow_sim::System::rates).
    pub fn linearise(&mut self, t: f64, x: &[f64], inputs: &[usize]) -> Result<Linearised, Failure> {
        let mut linear = Linearised {
            rates: vec![0.0; x.len()],
            values: vec![0.0; self.recorded.chosen.len()],
            ..Linearised::default()
        };
        self.rates(t, x, &mut linear.rates)?;
        self.observe(t, x, &mut linear.values)?;
        let (states, first) = (self.code.layout.states as usize, self.code.layout.inputs as usize);
        let along_states = (0..x.len()).map(|i| states + i).collect();
        let along_inputs = inputs.iter().map(|i| first + i).collect();
        (linear.a, linear.c) = self.columns(t, x, along_states)?;
        (linear.b, linear.d) = self.columns(t, x, along_inputs)?;
        Ok(linear)
    }

    /// Derivatives of rates and of recorded values along each of these registers, row by row.
    #[allow(clippy::type_complexity, reason = "two matrices")]
    fn columns(&mut self, t: f64, x: &[f64], along: Vec<usize>) -> Result<(Vec<Vec<f64>>, Vec<Vec<f64>>), Failure> {
        let mut rates = vec![vec![0.0; along.len()]; x.len()];
        let mut values = vec![vec![0.0; along.len()]; self.recorded.chosen.len()];
        for (column, register) in along.into_iter().enumerate() {
            for (what, rows) in [(What::Rates, &mut rates), (What::Recorded, &mut values)] {
                self.place(t, x);
                self.still();
                self.frame.d[register] = 1.0;
                self.evaluate(what, true, t)?;
                let routine = if matches!(what, What::Rates) { &self.code.rates } else { &self.recorded.routine };
                for (row, &out) in rows.iter_mut().zip(&routine.outputs) {
                    row[column] = self.frame.d[out as usize];
                    if !row[column].is_finite() {
                        return Err(Failure::NotFinite { time: t, what: "a derivative by a state or an input".into() });
                    }
                }
            }
        }
        Ok((rates, values))
    }
}
