//! Any form of a graph as a system `F(t, y, y') = 0`, with the minimal form beside it: that knows what is consistent.

use super::{InputError, Model, Operations, ParameterError, RecordError, StartError};
use crate::bytecode::Trouble;
use halfarrow_compiler::algebra::Symbol;
use halfarrow_compiler::program::{Implicit, Op, Program, Routine, Unavailable, Value};
use halfarrow_sim::{Events, Failure, ImplicitSystem, Sparsity, System, halves, halves_mut};
use std::collections::BTreeMap;

/// Passes of Newton on states of the minimal form.
const ITERATIONS: usize = 30;
/// What rounding leaves of a slope whose terms cancel, against the greatest slope by the same unknown.
const CANCELLED: f64 = 1e-14;
/// A relative step of theirs that has to shrink faster, or is what rounding leaves; before it, a law may be steep.
const NOISE: f64 = 1e-6;
/// A relative step of theirs that is rounding.
const SETTLED: f64 = 4.0 * f64::EPSILON;
/// Passes of Newton on what is recorded, and unknowns up to which there are any.
const REFINEMENTS: usize = 4;
const MOST_REFINED: usize = 60;

/// What takes the rate of an input has no value in any form: in a form whose unknowns it is among it stands for nothing.
fn without_rates_of_inputs(program: &mut Program, reference: &Program) {
    let without = reference.observed.iter().filter(|o| matches!(o.value, Err(Unavailable::NeedsRateOf(_))));
    let without: BTreeMap<&str, &Unavailable> =
        without.filter_map(|o| Some((o.name.as_str(), o.value.as_ref().err()?))).collect();
    for observed in &mut program.observed {
        if let Some(&why) = without.get(observed.name.as_str()) {
            observed.value = Err(why.clone());
        }
    }
}

/// A form of a graph as a system in implicit form.
///
/// The same bytecode and the same exact derivatives serve every form: explicit ones are `y' - f(t, y)`. Consistent values
/// come from the minimal form of the same graph, the `reference`: the forms share the variables of the graph, so that
/// each unknown, multipliers and break variables included, is evaluated there.
#[derive(Debug, Clone)]
pub struct ImplicitModel {
    form: Model,
    reference: Model,
    /// The state of the reference.
    x: Vec<f64>,
    equations: Implicit,
    sparsity: Sparsity,
    groups: Vec<Vec<usize>>,
    /// States of the reference that the form can tell, and what they are there: variables, and sums of stored quantities.
    states: Vec<usize>,
    seen: Routine,
    /// Unknowns as the reference has them, with the routine that computes these.
    known: Vec<usize>,
    told: Routine,
    /// Unknowns that it does not have, and all variables that both have: here, and there.
    untold: Vec<usize>,
    common: Routine,
    common_there: Routine,
    /// Unknowns of Newton blocks of the form (block, place) that the reference has, with the routine that computes them.
    guesses: Vec<(usize, usize)>,
    guessed: Routine,
    /// What the bonds of states with a free rate carry: in the form, and in the reference.
    free: Vec<usize>,
    carried: Routine,
    carried_there: Routine,
    /// The form is the minimal one itself: its unknowns are the states of the reference.
    twin: bool,
    /// Algebraic unknowns of a higher index, whose errors nothing controls while running.
    uncontrolled: Vec<usize>,
    /// Whether the form tells every state of the reference.
    all_told: bool,
    begun: bool,
}

impl ImplicitModel {
    /// Makes a form ready to run. `reference` is the minimal form of the same graph.
    ///
    /// # Errors
    /// Equations of parameters alone that have no solution.
    pub fn new(mut program: Program, mut reference: Model) -> Result<ImplicitModel, Failure> {
        let n = program.states.len();
        without_rates_of_inputs(&mut program, &reference.program);
        let mut form = Model::new(program)?;
        let equations = form.program.implicit.clone().unwrap_or_else(|| Implicit {
            explicit: vec![true; n],
            differential: vec![true; n],
            indices: vec![1; n],
            carried: Vec::new(),
        });
        let there = |s: &Symbol| reference.program.variables.get(s).copied();
        // States of the reference that the form can tell; the others keep the value they have.
        let mut pairs: Vec<(usize, Value)> = Vec::new();
        for (k, symbol) in reference.program.tracked.iter().enumerate() {
            let own = reference.layout.states + k as u32;
            let is_state = there(symbol).and_then(|v| reference.layout.registers.get(&v).copied()) == Some(own);
            let told = if is_state { &form.program.variables } else { &form.program.momenta };
            pairs.extend(told.get(symbol).map(|&value| (k, value)));
        }
        let known = |i: &usize| there(&form.program.tracked[*i]).is_some();
        let known: Vec<usize> = (0..n).filter(known).collect();
        let untold: Vec<usize> = (0..n).filter(|i| !known.contains(i)).collect();
        let both = form.program.variables.iter().filter_map(|(s, v)| Some((*v, there(s)?)));
        let (common, common_there): (Vec<Value>, Vec<Value>) = both.filter(|_| !untold.is_empty()).unzip();
        let told: Vec<Value> = known.iter().filter_map(|&i| there(&form.program.tracked[i])).collect();
        let carried: Vec<(usize, Value, Value)> =
            equations.carried.iter().filter_map(|(i, s, v)| Some((*i as usize, *v, there(s)?))).collect();
        let solution = |(s, v): (&Symbol, &Value)| match form.program.values.op(*v) {
            Op::Solution(block, i) => Some(((block.0 as usize, i as usize), there(s)?)),
            _ => None,
        };
        let newton = |((block, i), _): &((usize, usize), Value)| form.frame.solvers[*block].newton.memory.len() > *i;
        let guessed = form.program.variables.iter().filter_map(solution).filter(newton);
        let (guesses, guessed): (Vec<(usize, usize)>, Vec<Value>) = guessed.unzip();
        let seen: Vec<Value> = pairs.iter().map(|p| p.1).collect();
        let carried_here: Vec<Value> = carried.iter().map(|c| c.1).collect();
        let carried_there: Vec<Value> = carried.iter().map(|c| c.2).collect();
        let sparsity = sparsity_of(&form.program, &equations);
        let names = |p: &Program| p.states.iter().map(|s| s.name.clone()).collect::<Vec<_>>();
        let twin = form.program.implicit.is_none()
            && form.program.tracked == reference.program.tracked
            && form.program.conserved == reference.program.conserved
            && names(&form.program) == names(&reference.program);
        let algebraic = |i: &usize| !equations.differential[*i] && equations.indices[*i] > 1;
        let all_told = pairs.len() == reference.program.states.len();
        let mut model = ImplicitModel {
            all_told,
            uncontrolled: (0..n).filter(|i| all_told && algebraic(i)).collect(),
            seen: form.routine_for(&seen),
            states: pairs.iter().map(|p| p.0).collect(),
            told: reference.routine_for(&told),
            common: form.routine_for(&common),
            common_there: reference.routine_for(&common_there),
            untold,
            guesses,
            guessed: reference.routine_for(&guessed),
            carried: form.routine_for(&carried_here),
            carried_there: reference.routine_for(&carried_there),
            free: carried.iter().map(|c| c.0).collect(),
            x: vec![0.0; reference.program.states.len()],
            groups: sparsity.groups(),
            sparsity,
            known,
            equations,
            form,
            reference,
            twin,
            begun: false,
        };
        model.form.restart();
        Ok(model)
    }

    /// The program of the form.
    pub fn program(&self) -> &Program {
        &self.form.program
    }

    /// What one evaluation of the residuals takes.
    pub fn operations(&self) -> Operations {
        let mut counted = self.form.operations();
        counted.additions += self.equations.explicit.iter().filter(|explicit| **explicit).count();
        counted
    }

    /// As [`Model::floating`].
    pub fn floating(&self) -> Vec<String> {
        self.form.floating()
    }

    /// The minimal form beside it.
    pub fn reference(&self) -> &Model {
        &self.reference
    }

    /// The minimal form beside it, to start it: [`start_at`](ImplicitModel::start_at) goes on from its state.
    pub fn reference_mut(&mut self) -> &mut Model {
        &mut self.reference
    }

    /// The fastest rate of the minimal form linearised at the state `x`, in 1/s: of one state by itself, or of two that
    /// exchange energy. `None` where it has none.
    pub fn fastest_rate(&mut self, t: f64, x: &[f64]) -> Option<f64> {
        let n = x.len();
        let (_, jacobian) = self.reference.at_rest(t, x).ok()?;
        let pair = |i: usize, j: usize| (jacobian[i * n + j] * jacobian[j * n + i]).abs().sqrt();
        let fastest =
            (0..n).flat_map(|i| (0..=i).map(move |j| (i, j))).fold(0.0f64, |most, (i, j)| most.max(pair(i, j)));
        (fastest > 0.0 && fastest.is_finite()).then_some(fastest)
    }

    /// The form alone, as it stands. A form with explicit equations is a [`System`]; others are not.
    pub fn into_form(self) -> Model {
        self.form
    }

    /// As [`Model::set_parameter`], for both forms. A parameter that only the form has is set there.
    ///
    /// # Errors
    /// As [`Model::set_parameter`].
    pub fn set_parameter(&mut self, name: &str, value: f64) -> Result<(), ParameterError> {
        self.begun = false;
        match self.reference.set_parameter(name, value) {
            Ok(()) | Err(ParameterError::Unknown(_)) => self.form.set_parameter(name, value),
            Err(error) => Err(error),
        }
    }

    /// As [`Model::set_parameter`], for a parameter that the form alone has; the minimal form keeps its state.
    ///
    /// # Errors
    /// As [`Model::set_parameter`].
    pub fn set_form_parameter(&mut self, name: &str, value: f64) -> Result<(), ParameterError> {
        self.begun = false;
        self.form.set_parameter(name, value)
    }

    /// The present value of a parameter of the form, by its number.
    pub fn parameter(&self, index: usize) -> Option<f64> {
        let name = &self.form.program.parameters.get(index)?.name;
        self.form.parameter(name)
    }

    /// As [`Model::connect`], for both forms.
    ///
    /// # Errors
    /// As [`Model::connect`].
    pub fn connect(&mut self, input: &str, times: &[f64], values: &[f64]) -> Result<(), InputError> {
        self.begun = false;
        self.reference.connect(input, times, values)?;
        self.form.connect(input, times, values)
    }

    /// As [`Model::record`].
    ///
    /// # Errors
    /// As [`Model::record`].
    pub fn record(&mut self, names: &[&str]) -> Result<(), RecordError> {
        self.form.record(names)
    }

    /// As [`Model::record_all`].
    pub fn record_all(&mut self) {
        self.form.record_all();
    }

    /// Indices into [`Program::observed`] of what is recorded.
    pub fn recorded(&self) -> &[usize] {
        self.form.recorded()
    }

    /// Unknowns and their rates at the start of a run at `t`, those of the minimal form. Unknowns that it does not know (a
    /// reaction to an input whose rate nobody gives) are 0.
    ///
    /// # Errors
    /// As [`Model::initialise`].
    pub fn initialise(&mut self, t: f64) -> Result<(Vec<f64>, Vec<f64>), StartError> {
        let x = self.reference.initialise(t)?;
        self.start_at(t, &x).map_err(StartError::Failure)
    }

    /// Unknowns and their rates where the minimal form has the state `x` at the start of a run.
    ///
    /// # Errors
    /// As [`Model::rates`](System::rates).
    pub fn start_at(&mut self, t: f64, x: &[f64]) -> Result<(Vec<f64>, Vec<f64>), Failure> {
        self.form.restart();
        if let Some(failure) = self.form.broken() {
            return Err(failure);
        }
        self.begun = false;
        self.x.copy_from_slice(x);
        let n = self.unknowns();
        let (mut y, mut yp) = (vec![0.0; n], vec![0.0; n]);
        if self.twin {
            self.form.conserved.copy_from_slice(&self.reference.conserved);
        }
        self.reference.handle_event(t, &mut self.x)?;
        self.guess(t)?;
        self.take_over(t, &mut y)?;
        self.form.handle_event(t, &mut y)?;
        self.take_rates(t, &y, &mut yp)?;
        self.settle(t, &mut y, &mut yp)?;
        self.begun = true;
        Ok((y, yp))
    }

    /// Unknowns and their rates where the minimal form has the state `x`, in the present mode of both.
    ///
    /// # Errors
    /// As [`Model::rates`](System::rates).
    pub fn at(&mut self, t: f64, x: &[f64], y: &mut [f64], yp: &mut [f64]) -> Result<(), Failure> {
        self.x.copy_from_slice(x);
        // The state may be far from the last one.
        for model in [&mut self.reference, &mut self.form] {
            model.frame.solvers.iter_mut().for_each(|s| s.newton.leave());
        }
        self.guess(t)?;
        self.take_over(t, y)?;
        self.take_rates(t, y, yp)?;
        self.settle(t, y, yp)
    }

    /// Newton blocks of the form begin where the reference is: where their equations have several solutions, at its own.
    fn guess(&mut self, t: f64) -> Result<(), Failure> {
        let ImplicitModel { reference, form, guesses, guessed, x, .. } = self;
        reference.place(t, x);
        reference.frame.run(guessed).map_err(|trouble| reference.failure(t, trouble))?;
        for (&(block, i), &register) in guesses.iter().zip(&guessed.outputs) {
            let value = reference.frame.r[register as usize];
            if value.is_finite() {
                form.frame.solvers[block].newton.start_at(i, value);
            }
        }
        Ok(())
    }

    /// Unknowns from the state of the reference.
    fn take_over(&mut self, t: f64, y: &mut [f64]) -> Result<(), Failure> {
        if self.twin {
            y.copy_from_slice(&self.x);
            return Ok(());
        }
        let ImplicitModel { reference, told, x, known, .. } = self;
        reference.place(t, x);
        reference.frame.run(told).map_err(|trouble| reference.failure(t, trouble))?;
        for (&i, &register) in known.iter().zip(&told.outputs) {
            let value = reference.frame.r[register as usize];
            if value.is_finite() {
                y[i] = value;
            }
        }
        if self.untold.is_empty() { Ok(()) } else { self.infer(t, y) }
    }

    /// Unknowns that the reference does not have, such as one of two reactions of which it knows the sum: the least that
    /// makes all other variables right.
    fn infer(&mut self, t: f64, y: &mut [f64]) -> Result<(), Failure> {
        let ImplicitModel { reference, common_there, x, .. } = self;
        reference.place(t, x);
        reference.frame.run(common_there).map_err(|trouble| reference.failure(t, trouble))?;
        let wanted: Vec<f64> = common_there.outputs.iter().map(|&r| reference.frame.r[r as usize]).collect();
        let (rows, columns) = (wanted.len(), self.untold.len());
        let (mut matrix, mut miss) = (vec![0.0; rows * columns], vec![0.0; rows]);
        let still = vec![0.0; y.len()];
        self.untold.iter().for_each(|&i| y[i] = 0.0);
        let mut before = f64::INFINITY;
        for _ in 0..ITERATIONS {
            for column in 0..columns {
                self.place(t, y, &still);
                self.form.still();
                self.form.frame.d[self.form.layout.states as usize + self.untold[column]] = 1.0;
                self.form.frame.run_along(&self.common).map_err(|trouble| self.form.failure(t, trouble))?;
                for (row, &register) in self.common.outputs.iter().enumerate() {
                    matrix[row * columns + column] = self.form.frame.d[register as usize];
                    miss[row] = self.form.frame.r[register as usize] - wanted[row];
                }
            }
            // What does not read them, or only by what rounding leaves of terms that cancel, says nothing about them.
            let mut greatest = vec![0.0f64; columns];
            for row in matrix.chunks(columns) {
                greatest.iter_mut().zip(row).for_each(|(most, s)| *most = most.max(s.abs()));
            }
            for row in 0..rows {
                let slopes = &mut matrix[row * columns..][..columns];
                let good = miss[row].is_finite() && slopes.iter().all(|s| s.is_finite());
                if !good || slopes.iter().zip(&greatest).all(|(s, most)| s.abs() <= CANCELLED * most) {
                    slopes.fill(0.0);
                    miss[row] = 0.0;
                }
            }
            // Most of what they carry is linear in them: the second step is rounding then.
            let Some(step) = super::minimum_norm::step(&matrix, &miss, columns) else { break };
            let relative = |(&i, s): (&usize, &f64)| s.abs() / y[i].abs().max(s.abs()).max(f64::MIN_POSITIVE);
            let length = self.untold.iter().zip(&step.step).map(relative).fold(0.0, f64::max);
            if !length.is_finite() || length < NOISE && length >= 0.5 * before {
                break;
            }
            self.untold.iter().zip(&step.step).for_each(|(&i, s)| y[i] += s);
            if length <= SETTLED {
                break;
            }
            before = length;
        }
        Ok(())
    }

    /// Free rates from what the bonds carry in the reference, then the explicit ones.
    fn take_rates(&mut self, t: f64, y: &[f64], yp: &mut [f64]) -> Result<(), Failure> {
        yp.fill(0.0);
        let free = self.free.len();
        if free > 0 {
            let ImplicitModel { reference, carried_there, x, .. } = self;
            reference.place(t, x);
            reference.frame.run(carried_there).map_err(|trouble| reference.failure(t, trouble))?;
            let wanted: Vec<f64> = carried_there.outputs.iter().map(|&r| reference.frame.r[r as usize]).collect();
            // What a bond carries is linear in the rates: one step of Newton.
            let mut matrix = vec![0.0; free * free];
            let mut right = wanted;
            for column in 0..free {
                self.place(t, y, yp);
                self.form.still();
                self.form.frame.d[self.form.layout.rates as usize + self.free[column]] = 1.0;
                let run = self.form.frame.run_along(&self.carried);
                run.map_err(|trouble: Trouble| self.form.failure(t, trouble))?;
                for (row, &register) in self.carried.outputs.iter().enumerate() {
                    matrix[row * free + column] = self.form.frame.d[register as usize];
                    if column == 0 {
                        right[row] -= self.form.frame.r[register as usize];
                    }
                }
            }
            if let Some(step) = super::minimum_norm::step(&matrix, &right, free) {
                self.free.iter().zip(&step.step).for_each(|(&i, s)| yp[i] = -s);
            }
        }
        let mut out = vec![0.0; y.len()];
        self.run_rates(t, y, yp, &mut out)?;
        for (i, value) in out.into_iter().enumerate() {
            if self.equations.explicit[i] {
                yp[i] = value;
            }
        }
        Ok(())
    }

    /// Where equations are missed since the reference does not have what a bond carries (it would take the rate of an
    /// input): rates as the unknowns move along the run of the reference, then the unknowns that it does not have.
    fn settle(&mut self, t: f64, y: &mut [f64], yp: &mut [f64]) -> Result<(), Failure> {
        let n = y.len();
        let open: Vec<usize> = (0..n).filter(|&i| !self.equations.explicit[i]).collect();
        if self.twin || self.are_met(t, y, yp, &open)? {
            return Ok(());
        }
        let ImplicitModel { reference, told, x, known, .. } = self;
        reference.rates_at(t, x)?;
        let dx = reference.dx.clone();
        reference.place(t, x);
        reference.still();
        reference.let_time_pass(t);
        let states = reference.layout.states as usize;
        reference.frame.d[states..states + dx.len()].copy_from_slice(&dx);
        reference.frame.run_along(told).map_err(|trouble| reference.failure(t, trouble))?;
        for (&i, &register) in known.iter().zip(&told.outputs) {
            if self.equations.differential[i] && !self.equations.explicit[i] {
                yp[i] = reference.frame.d[register as usize];
            }
        }
        let columns = self.untold.len();
        for _ in 0..if columns == 0 { 0 } else { REFINEMENTS } {
            let (mut matrix, mut miss) = (vec![0.0; open.len() * columns], vec![0.0; open.len()]);
            for column in 0..columns {
                self.place(t, y, yp);
                self.form.still();
                self.form.frame.d[self.form.layout.states as usize + self.untold[column]] = 1.0;
                let form = &mut self.form;
                form.frame.run_along(&form.rates).map_err(|trouble| form.failure(t, trouble))?;
                for (row, &i) in open.iter().enumerate() {
                    let register = form.rates.outputs[i] as usize;
                    matrix[row * columns + column] = form.frame.d[register];
                    miss[row] = form.frame.r[register];
                }
            }
            let Some(step) = super::minimum_norm::step(&matrix, &miss, columns) else { break };
            self.untold.iter().zip(&step.step).for_each(|(&i, s)| y[i] += s);
        }
        let mut out = vec![0.0; n];
        self.run_rates(t, y, yp, &mut out)?;
        let explicit = (0..n).filter(|&i| self.equations.explicit[i]);
        explicit.for_each(|i| yp[i] = out[i]);
        Ok(())
    }

    /// Whether the equations that are not explicit are met.
    fn are_met(&mut self, t: f64, y: &[f64], yp: &[f64], open: &[usize]) -> Result<bool, Failure> {
        let mut out = vec![0.0; y.len()];
        self.run_rates(t, y, yp, &mut out)?;
        let size = y.iter().chain(yp).fold(1e-3f64, |most, v| most.max(v.abs()));
        Ok(open.iter().all(|&i| out[i].abs() <= 1e-9 * size))
    }

    /// The unknowns and their rates with those that nothing controls computed from the others: errors of a multiplier of
    /// a higher index do not act back on the motion, so that no step is made shorter for them.
    fn controlled(&mut self, t: f64, y: &[f64], yp: &[f64]) -> Result<(Vec<f64>, Vec<f64>), Failure> {
        self.follow_back(t, y, yp)?;
        let (mut whole, mut rates) = (y.to_vec(), yp.to_vec());
        self.take_over(t, &mut whole)?;
        for i in (0..y.len()).filter(|i| !self.uncontrolled.contains(i)) {
            whole[i] = y[i];
        }
        self.take_rates(t, &whole, &mut rates)?;
        self.settle(t, &mut whole, &mut rates)?;
        Ok((whole, rates))
    }

    /// The unknowns and their rates with free rates and algebraic unknowns made to fit the states: the integrator leaves of
    /// its Newton what its tolerance allows, divided by the step for rates. By the equations of this form alone, of
    /// index 1; as they are where Newton does not make them better.
    fn consistent(&mut self, t: f64, y: &[f64], yp: &[f64]) -> Result<(Vec<f64>, Vec<f64>), Failure> {
        let n = y.len();
        let (mut whole, mut rates) = (y.to_vec(), yp.to_vec());
        let rows: Vec<usize> = (0..n).filter(|&i| !self.equations.explicit[i]).collect();
        let higher = self.equations.indices.iter().any(|index| *index > 1);
        if rows.is_empty() || rows.len() > MOST_REFINED || higher {
            return Ok((whole, rates));
        }
        let (mut out, mut along, mut slope) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        let mut before = f64::INFINITY;
        for _ in 0..REFINEMENTS {
            self.run_rates(t, &whole, &rates, &mut out)?;
            let miss: Vec<f64> = rows.iter().map(|&row| out[row]).collect();
            let k = rows.len();
            let mut matrix = vec![0.0; k * k];
            for (column, &unknown) in rows.iter().enumerate() {
                along[unknown] = 1.0;
                match self.equations.differential[unknown] {
                    true => self.form.tangent_by_rates(t, &whole, &along, &mut slope)?,
                    false => self.form.tangent(t, &whole, &along, &mut slope)?,
                }
                along[unknown] = 0.0;
                (0..k).for_each(|row| matrix[row * k + column] = slope[rows[row]]);
            }
            let Some(step) = super::minimum_norm::step(&matrix, &miss, k) else { break };
            let length = step.step.iter().map(|s| s.abs()).fold(0.0, f64::max);
            if step.rank < k {
                // Rates that the equations hold only differentiated.
                return if self.all_told { self.controlled(t, y, yp) } else { Ok((y.to_vec(), yp.to_vec())) };
            }
            if !length.is_finite() || length >= before {
                break;
            }
            before = length;
            for (&unknown, s) in rows.iter().zip(&step.step) {
                let value = if self.equations.differential[unknown] { &mut rates } else { &mut whole };
                value[unknown] += s;
            }
            if length == 0.0 {
                break;
            }
        }
        Ok((whole, rates))
    }

    /// The state of the reference from the unknowns, both in the mode that ends here.
    fn follow_back(&mut self, t: f64, y: &[f64], yp: &[f64]) -> Result<(), Failure> {
        self.place(t, y, yp);
        self.form.frame.run(&self.seen).map_err(|trouble| self.form.failure(t, trouble))?;
        for (&k, &register) in self.states.iter().zip(&self.seen.outputs) {
            self.x[k] = self.form.frame.r[register as usize];
        }
        Ok(())
    }

    fn place(&mut self, t: f64, y: &[f64], yp: &[f64]) {
        self.form.place(t, y);
        self.place_rates(yp);
    }

    fn place_rates(&mut self, yp: &[f64]) {
        if self.form.program.implicit.is_some() {
            let rates = self.form.layout.rates as usize;
            self.form.frame.r[rates..rates + yp.len()].copy_from_slice(yp);
        }
    }

    /// Rates and residuals.
    fn run_rates(&mut self, t: f64, y: &[f64], yp: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        self.place_rates(yp);
        self.form.rates(t, y, out)
    }
}

/// Where derivatives by unknowns or their rates may be nonzero.
fn sparsity_of(program: &Program, equations: &Implicit) -> Sparsity {
    let mut columns = vec![Vec::new(); program.states.len()];
    for (row, reads) in program.dependence.iter().enumerate() {
        reads.iter().for_each(|&column| columns[column as usize].push(row));
        if equations.explicit[row] {
            columns[row].push(row);
        }
    }
    Sparsity::from_columns(columns)
}

impl ImplicitSystem for ImplicitModel {
    fn unknowns(&self) -> usize {
        self.form.program.states.len()
    }

    fn unknown_name(&self, unknown: usize) -> String {
        self.form.program.states[unknown].name.clone()
    }

    fn equation_name(&self, equation: usize) -> String {
        let name = &self.form.program.states[equation].name;
        if self.equations.explicit[equation] {
            format!("the rate of {name}")
        } else {
            format!("the equation of {name}")
        }
    }

    /// Those of the minimal form where it has the same unknown.
    fn scales(&mut self, t: f64, span: f64) -> Result<Vec<f64>, Failure> {
        let ImplicitModel { reference, form, x, .. } = self;
        let known = halfarrow_sim::magnitudes(reference, (t, x), span)?;
        let tracked = &reference.program.tracked;
        let of = |symbol| tracked.iter().position(|tracked| tracked == symbol).map_or(0.0, |k| known[k]);
        Ok(form.program.tracked.iter().map(of).collect())
    }

    fn index(&self, unknown: usize) -> u8 {
        self.equations.indices[unknown].clamp(1, 3)
    }

    fn residual(&mut self, t: f64, y: &[f64], yp: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        self.run_rates(t, y, yp, out)?;
        for (i, out) in out.iter_mut().enumerate() {
            if self.equations.explicit[i] {
                *out = yp[i] - *out;
            }
        }
        Ok(())
    }

    fn sparsity(&self) -> &Sparsity {
        &self.sparsity
    }

    fn jacobian(&mut self, t: f64, y: &[f64], yp: &[f64], dy: &mut [f64], dyp: &mut [f64]) -> Result<(), Failure> {
        let n = y.len();
        let (mut along, mut product) = (vec![0.0; n], vec![0.0; n]);
        self.place_rates(yp);
        for group in &self.groups {
            along.fill(0.0);
            group.iter().for_each(|&column| along[column] = 1.0);
            self.form.tangent(t, y, &along, &mut product)?;
            for &column in group {
                for (place, &row) in self.sparsity.places(column).zip(self.sparsity.column(column)) {
                    let explicit = self.equations.explicit[row];
                    dy[place] = if explicit { -product[row] } else { product[row] };
                    dyp[place] = f64::from(u8::from(explicit && row == column));
                }
            }
            let free = |c: &&usize| self.equations.differential[**c] && !self.equations.explicit[**c];
            if group.iter().any(|c| free(&c)) {
                along.iter_mut().enumerate().for_each(|(c, a)| *a = if free(&&c) { *a } else { 0.0 });
                self.form.tangent_by_rates(t, y, &along, &mut product)?;
                for &column in group.iter().filter(free) {
                    for (place, &row) in self.sparsity.places(column).zip(self.sparsity.column(column)) {
                        let explicit = self.equations.explicit[row];
                        dyp[place] += if explicit { -product[row] } else { product[row] };
                    }
                }
            }
        }
        Ok(())
    }

    fn semi_explicit(&self) -> Option<&[bool]> {
        let free = |(explicit, differential): (&bool, &bool)| *differential && !explicit;
        let none = !self.equations.explicit.iter().zip(&self.equations.differential).any(free);
        none.then_some(&self.equations.explicit[..])
    }
}

impl Events for ImplicitModel {
    fn next_time_event(&mut self, t: f64) -> Option<f64> {
        self.form.next_time_event(t)
    }

    fn is_corner(&mut self, t: f64) -> bool {
        self.form.is_corner(t)
    }

    fn indicators(&self) -> usize {
        self.form.indicators()
    }

    fn event_indicators(&mut self, t: f64, point: &[f64], g: &mut [f64]) -> Result<(), Failure> {
        let (y, yp) = halves(point);
        self.place_rates(yp);
        self.form.event_indicators(t, y, g)
    }

    fn handle_event(&mut self, t: f64, point: &mut [f64]) -> Result<(), Failure> {
        let (y, yp) = halves_mut(point);
        let implicit = self.form.program.implicit.is_some();
        if !self.begun || !implicit {
            self.begun = true;
            self.place_rates(yp);
            self.form.handle_event(t, y)?;
            if !implicit {
                return self.take_rates(t, y, yp);
            }
            self.reference.handle_event(t, &mut self.x)?;
        } else {
            // What is sampled at an event, and the sign of a condition, are those of the unknowns after it.
            self.follow_back(t, y, yp)?;
            self.reference.handle_event(t, &mut self.x)?;
            self.take_over(t, y)?;
            self.form.handle_event(t, y)?;
        }
        self.take_over(t, y)?;
        self.take_rates(t, y, yp)?;
        self.settle(t, y, yp)
    }

    fn accept(&mut self, t: f64, point: &[f64]) -> Result<(), Failure> {
        let (y, yp) = halves(point);
        self.place_rates(yp);
        self.form.accept(t, y)?;
        let observed = !self.uncontrolled.is_empty() && !self.form.recorded.is_empty();
        if self.reference.has_delays() || observed && self.reference.follows_solutions_at_all() {
            self.follow_back(t, y, yp)?;
            self.reference.accept(t, &self.x)?;
        }
        Ok(())
    }

    fn observed(&self) -> usize {
        self.form.observed()
    }

    fn observed_name(&self, value: usize) -> String {
        self.form.observed_name(value)
    }

    fn observe(&mut self, t: f64, point: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        let (y, yp) = halves(point);
        let (y, yp) = match (self.form.recorded.is_empty(), self.uncontrolled.is_empty()) {
            (true, _) => (y.to_vec(), yp.to_vec()),
            (false, true) => self.consistent(t, y, yp)?,
            (false, false) => self.controlled(t, y, yp)?,
        };
        self.place_rates(&yp);
        self.form.observe(t, &y, out)
    }
}
