//! A form in the modes of set-valued laws: the minimal form beside it watches the bounds and chooses the mode that comes next,
//! the form goes on in its own equations of that mode, from the values that the variables of the graph have there.

use super::super::compiled::ModeId;
use super::super::minimum_norm;
use super::super::modes::Extents;
use super::ImplicitModel;
use super::state_map::StateMap;
use halfarrow_compiler::bond_graph::ParameterKind;
use halfarrow_compiler::program::{Program, Unavailable};
use halfarrow_sim::{Failure, halves};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Passes of Newton on displacements.
const CLOSING: usize = 3;

/// What the form and the minimal one know of each other in the modes of both, made when these are first met.
#[derive(Debug, Default)]
pub(super) struct Maps(Mutex<BTreeMap<(ModeId, ModeId), Arc<StateMap>>>);

impl ImplicitModel {
    /// Whether there are set-valued laws.
    pub(super) fn has_modes(&self) -> bool {
        !self.reference.code.program.set_valued.is_empty()
    }

    /// Brings the form into the mode of the minimal one; whether it was in another one.
    ///
    /// # Errors
    /// The form has no equations in that mode, or none that tell what is recorded.
    pub(super) fn follow_mode(&mut self, t: f64) -> Result<bool, Failure> {
        if !self.has_modes() {
            return Ok(false);
        }
        let branches: Vec<u32> = self.reference.code.program.branches();
        let before = self.form.run.mode;
        let Some(mode) = self.form.compiled.in_mode(&branches) else {
            return Err(self.no_form(t, "this form has no equations there".into()));
        };
        if mode != before {
            self.refuse_unrecorded(t, &self.form.compiled.mode(mode).program)?;
            self.form.enter(mode)?;
            if let Some(failure) = self.form.broken() {
                return Err(failure);
            }
        }
        self.take_map(t)?;
        Ok(mode != before)
    }

    /// Refuses a mode in which something that is recorded has no value.
    fn refuse_unrecorded(&self, t: f64, next: &Program) -> Result<(), Failure> {
        let present = &self.form.code.program.observed;
        let reason = |program: &Program, name: &str| match program.observed.iter().find(|o| *o.name == *name)?.value {
            Ok(_) => None,
            Err(ref why) => Some(why.clone()),
        };
        for name in self.form.recorded.chosen.iter().map(|&i| &*present[i].name) {
            // What takes the rate of an input stands for nothing, as in `without_rates_of_inputs`.
            let there = reason(&self.reference.code.program, name);
            let there = there.filter(|why| matches!(why, Unavailable::NeedsRateOf(_)));
            if let Some(why) = reason(next, name).or(there) {
                return Err(self.no_form(t, format!("`{name}`, which is recorded, has no value in this form: {why}")));
            }
        }
        Ok(())
    }

    /// What both know of each other in their present modes.
    pub(super) fn take_map(&mut self, t: f64) -> Result<(), Failure> {
        let key = (self.form.run.mode, self.reference.run.mode);
        let maps = self.maps.clone();
        let mut maps = maps.0.lock().unwrap_or_else(PoisonError::into_inner);
        let map = match maps.get(&key) {
            Some(map) => map.clone(),
            None => Arc::new(StateMap::new(&mut self.form, &mut self.reference)),
        };
        map.reserve(&mut self.form, &mut self.reference);
        maps.insert(key, map.clone());
        self.map = map;
        match self.map.untold.first() {
            None => Ok(()),
            Some(state) => Err(self.no_form(t, format!("this form does not tell {state}"))),
        }
    }

    /// The mode in which the form has no equations.
    fn no_form(&self, time: f64, reason: String) -> Failure {
        let laws = self.reference.code.program.set_valued.iter();
        let name = |law: &halfarrow_compiler::program::SetValued| {
            format!("{} is {}", law.name, law.branches[law.present as usize])
        };
        Failure::NoForm { time, mode: laws.map(name).collect::<Vec<_>>().join(", "), reason }
    }

    /// What is wrong where no mode can be: of a form with springs these may be, which leave contacts a little open.
    fn or_springs(&self, t: f64, failure: Failure) -> Failure {
        let springs = self.form.code.program.parameter_of(ParameterKind::SpringStiffness).is_some();
        match failure {
            Failure::NoMode { what, .. } if springs => {
                let reason = format!(
                    "{what} ends, and what the springs of this form leave open fits no branch beyond that (a greater \
                     stiffness leaves less)"
                );
                self.no_form(t, reason)
            }
            failure => failure,
        }
    }

    /// Unknowns and rates in the mode of the minimal form, which stands at `t` where an event has left it. `before`: those in
    /// this mode before the event.
    pub(super) fn enter_mode(&mut self, t: f64, before: Option<&[f64]>) -> Result<(), Failure> {
        let n = self.form.code.program.states.len();
        let mut point = before.map_or(vec![0.0; 2 * n], <[f64]>::to_vec);
        let (y, yp) = point.split_at_mut(n);
        if before.is_none() {
            self.guess(t)?;
        }
        self.take_over(t, y)?;
        self.form.handle(t, y, &[])?;
        self.take_over(t, y)?;
        self.take_rates(t, y, yp)?;
        self.settle(t, y, yp)?;
        self.entered = Some(point);
        Ok(())
    }

    /// Handles an event. The minimal form tells all that happens; where the mode stays the point moves, else there is another.
    pub(super) fn handle_modes(&mut self, t: f64, point: &mut [f64]) -> Result<(), Failure> {
        let before = self.entered.take();
        let present = before.as_deref().unwrap_or(point);
        let (y, yp) = halves(present);
        let told = match self.begun {
            false => Vec::new(),
            true => {
                self.follow_back(t, y, yp)?;
                self.close_gaps(t)?;
                self.form.becoming(t, y)?
            }
        };
        self.begun = true;
        let late = self.late(t, &told)?;
        let x = self.x.clone();
        let handled = self.reference.handle(t, &mut self.x, &told);
        handled.map_err(|failure| self.or_springs(t, failure))?;
        self.form.take_discretes(&self.reference);
        let changed = self.follow_mode(t)?;
        self.enter_mode(t, Some(present).filter(|_| !changed))?;
        if self.x == x && !changed {
            [&mut self.reference, &mut self.form].into_iter().for_each(|model| model.let_hold(&late));
        }
        if !changed && before.is_none() {
            point.copy_from_slice(&self.entered.take().unwrap_or_default());
        }
        Ok(())
    }

    /// Looks, where a step has ended at `(t, y, y')`, whether a branch has ended that no event has told, and goes on beyond it.
    pub(super) fn settle_untold(&mut self, t: f64, y: &[f64], yp: &[f64]) -> Result<(), Failure> {
        self.follow_back(t, y, yp)?;
        self.close_gaps(t)?;
        let mut x = self.x.clone();
        if !self.reference.is_margin_below(t, &x)? {
            return Ok(());
        }
        self.reference.find_fired(t, &x, &[])?;
        let settled = self.reference.settle_all(t, &mut x);
        settled.map_err(|failure| self.or_springs(t, failure))?;
        let moved = std::mem::replace(&mut self.x, x) != self.x;
        self.form.take_discretes(&self.reference);
        let changed = self.follow_mode(t)?;
        if !(changed || moved) {
            return Ok(());
        }
        let before = [y, yp].concat();
        self.enter_mode(t, Some(&before[..]).filter(|_| !changed))
    }

    /// Closes the gaps of contacts that are closed, which a form that holds their rates, or has springs in their places, leaves
    /// a little open: the least change of displacements that does it.
    fn close_gaps(&mut self, t: f64) -> Result<(), Failure> {
        let code = self.reference.code.clone();
        let Some(bounds) = code.bounds.as_ref().filter(|bounds| !bounds.closed.outputs.is_empty()) else {
            return Ok(());
        };
        let ImplicitModel { reference, x, .. } = self;
        let (rows, columns) = (bounds.closed.outputs.len(), code.program.tracked.len());
        let (mut matrix, mut gaps) = (vec![0.0; rows * columns], vec![0.0; rows]);
        for _ in 0..CLOSING {
            for column in 0..columns {
                reference.place(t, x);
                reference.still();
                reference.frame.d[code.layout.states as usize + column] = 1.0;
                let run = reference.frame.run_along(&bounds.closed);
                run.map_err(|error| reference.failure(t, error))?;
                for (row, &register) in bounds.closed.outputs.iter().enumerate() {
                    matrix[row * columns + column] = reference.frame.d[register as usize];
                    gaps[row] = reference.frame.r[register as usize];
                }
            }
            let Some(step) = minimum_norm::step(&matrix, &gaps, columns) else { break };
            x.iter_mut().zip(&step.step).for_each(|(x, step)| *x += step);
        }
        Ok(())
    }

    /// How great unknowns and the states of the minimal form are, kept in all modes.
    pub(super) fn note_unknowns(&mut self, y: &[f64]) {
        let run = &mut self.reference.run;
        let unknowns = self.form.code.program.tracked.iter().zip(y);
        let states = self.reference.code.program.tracked.iter().zip(&run.scales);
        for (&symbol, &value) in unknowns.chain(states) {
            Extents::note(&mut run.extents.states, symbol, value);
        }
    }
}
