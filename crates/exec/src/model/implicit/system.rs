//! A form as a system to integrate.

use std::collections::BTreeMap;

use super::ImplicitModel;
use halfarrow_compiler::program::{Observed, State};
use halfarrow_sim::{Events, Failure, ImplicitSystem, Sparsity, StepEnd, System as _, halves, halves_mut};

impl ImplicitModel {
    /// Of the clauses that happen, those that rounding leaves before their border in the reference. Where no state moves, they
    /// have happened nevertheless.
    pub(super) fn late(&mut self, t: f64, told: &[bool]) -> Result<Vec<bool>, Failure> {
        let x = std::mem::take(&mut self.x);
        let seen = self.reference.becoming(t, &x);
        self.x = x;
        Ok(told.iter().zip(seen?).map(|(told, seen)| *told && !seen).collect())
    }
}

impl ImplicitSystem for ImplicitModel {
    fn unknowns(&self) -> usize {
        self.form.code.program.states.len()
    }

    fn unknown_name(&self, unknown: usize) -> String {
        self.form.code.program.states[unknown].name.clone()
    }

    fn equation_name(&self, equation: usize) -> String {
        let name = &self.form.code.program.states[equation].name;
        if self.map.equations.explicit[equation] {
            format!("the rate of {name}")
        } else {
            format!("the equation of {name}")
        }
    }

    /// Those of the minimal form where it has the same unknown.
    fn scales(&mut self, t: f64, span: f64) -> Result<Vec<f64>, Failure> {
        let ImplicitModel { reference, form, x, scaled, .. } = self;
        // In the modes that follow, what has been tells more than what passes through 0 there.
        let known = match std::mem::replace(scaled, !reference.code.program.set_valued.is_empty()) {
            false => halfarrow_sim::magnitudes(reference, (t, x), span)?,
            true => reference.run.scales.clone(),
        };
        let (tracked, been) = (&reference.code.program.tracked, &reference.run.extents.states);
        let been = |symbol| been.get(symbol).copied().unwrap_or(0.0);
        let of =
            |symbol| tracked.iter().position(|tracked| tracked == symbol).map_or(0.0, |k| known[k]).max(been(symbol));
        Ok(form.code.program.tracked.iter().map(of).collect())
    }

    fn sorts(&self) -> Vec<usize> {
        let program = &self.form.code.program;
        let told: BTreeMap<&str, &Observed> = program.observed.iter().map(|o| (&*o.name, o)).collect();
        let mut known = BTreeMap::new();
        let sort = |state: &State| {
            let observed = told.get(state.name.as_str());
            let unit = state.unit.as_ref().or_else(|| observed?.unit.as_ref());
            let count = known.len();
            *known.entry((observed.map(|o| o.kind), unit.map(ToString::to_string))).or_insert(count)
        };
        program.states.iter().map(sort).collect()
    }

    fn index(&self, unknown: usize) -> u8 {
        self.map.equations.indices[unknown].clamp(1, 3)
    }

    fn residual(&mut self, t: f64, y: &[f64], yp: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        self.run_rates(t, y, yp, out)?;
        for (i, out) in out.iter_mut().enumerate() {
            if self.map.equations.explicit[i] {
                *out = yp[i] - *out;
            }
        }
        Ok(())
    }

    fn sparsity(&self) -> &Sparsity {
        &self.map.sparsity
    }

    fn jacobian(&mut self, t: f64, y: &[f64], yp: &[f64], dy: &mut [f64], dyp: &mut [f64]) -> Result<(), Failure> {
        let n = y.len();
        let (mut along, mut product) = (vec![0.0; n], vec![0.0; n]);
        self.place_rates(yp);
        for group in &self.map.groups {
            along.fill(0.0);
            group.iter().for_each(|&column| along[column] = 1.0);
            self.form.directional_derivative(t, y, &along, &mut product)?;
            for &column in group {
                for (place, &row) in self.map.sparsity.places(column).zip(self.map.sparsity.column(column)) {
                    let explicit = self.map.equations.explicit[row];
                    dy[place] = if explicit { -product[row] } else { product[row] };
                    dyp[place] = f64::from(u8::from(explicit && row == column));
                }
            }
            let free = |c: &&usize| self.map.equations.differential[**c] && !self.map.equations.explicit[**c];
            if group.iter().any(|c| free(&c)) {
                along.iter_mut().enumerate().for_each(|(c, a)| *a = if free(&&c) { *a } else { 0.0 });
                self.form.derivative_by_rates(t, y, &along, &mut product)?;
                for &column in group.iter().filter(free) {
                    for (place, &row) in self.map.sparsity.places(column).zip(self.map.sparsity.column(column)) {
                        let explicit = self.map.equations.explicit[row];
                        dyp[place] += if explicit { -product[row] } else { product[row] };
                    }
                }
            }
        }
        Ok(())
    }

    fn changes_unknowns(&self) -> bool {
        self.has_modes()
    }

    fn new_point(&mut self) -> Option<Vec<f64>> {
        self.entered.take()
    }

    fn semi_explicit(&self) -> Option<&[bool]> {
        let free = |(explicit, differential): (&bool, &bool)| *differential && !explicit;
        let none = !self.map.equations.explicit.iter().zip(&self.map.equations.differential).any(free);
        none.then_some(&self.map.equations.explicit[..])
    }
}

impl Events for ImplicitModel {
    fn passed_pole(&mut self, t: f64) -> Result<(), Failure> {
        self.form.passed_pole(t)
    }

    fn next_time_event(&mut self, t: f64) -> Option<f64> {
        let own = self.form.next_time_event(t);
        // Only the minimal form obeys switches.
        let there = if self.has_modes() { self.reference.next_time_event(t) } else { None };
        own.into_iter().chain(there).reduce(f64::min)
    }

    fn is_corner(&mut self, t: f64) -> bool {
        self.form.is_corner(t) && (!self.has_modes() || self.reference.is_corner(t))
    }

    fn indicators(&self) -> usize {
        self.form.indicators() + if self.has_modes() { self.reference.indicators() } else { 0 }
    }

    fn indicator_name(&self, indicator: usize) -> String {
        match indicator.checked_sub(self.form.indicators()) {
            None => self.form.indicator_name(indicator),
            Some(there) => self.reference.indicator_name(there),
        }
    }

    fn longest_step(&self) -> f64 {
        self.form.longest_step()
    }

    fn angles(&self, angles: &mut Vec<f64>) {
        self.form.angles(angles);
    }

    /// Those of the form, then, where there are bounds of branches, those of the minimal form.
    fn event_indicators(&mut self, t: f64, point: &[f64], g: &mut [f64]) -> Result<(), Failure> {
        let entered = self.entered.clone();
        let (y, yp) = halves(entered.as_deref().unwrap_or(point));
        self.place_rates(yp);
        let (own, there) = g.split_at_mut(self.form.indicators());
        self.form.event_indicators(t, y, own)?;
        if self.has_modes() {
            self.follow_back(t, y, yp)?;
            self.reference.event_indicators(t, &self.x, there)?;
        }
        Ok(())
    }

    fn handle_event(&mut self, t: f64, point: &mut [f64]) -> Result<(), Failure> {
        if self.has_modes() {
            return self.handle_modes(t, point);
        }
        let (y, yp) = halves_mut(point);
        let implicit = self.form.code.program.implicit.is_some();
        if !self.begun || !implicit {
            self.begun = true;
            self.place_rates(yp);
            self.form.handle_event(t, y)?;
            if !implicit {
                return self.take_rates(t, y, yp);
            }
            self.reference.handle_event(t, &mut self.x)?;
            self.form.take_discretes(&self.reference);
        } else {
            // What is sampled at an event, and the sign of a condition, are those of the unknowns after it.
            self.follow_back(t, y, yp)?;
            let told = self.form.becoming(t, y)?;
            let late = self.late(t, &told)?;
            let before = self.x.clone();
            self.reference.handle(t, &mut self.x, &told)?;
            self.form.take_discretes(&self.reference);
            self.take_over(t, y)?;
            self.form.handle_event(t, y)?;
            if self.x == before {
                [&mut self.reference, &mut self.form].into_iter().for_each(|model| model.let_hold(&late));
            }
        }
        self.take_over(t, y)?;
        self.take_rates(t, y, yp)?;
        self.settle(t, y, yp)
    }

    fn exchange_independent(&mut self, t: f64, point: &mut [f64], step: StepEnd) -> Result<bool, Failure> {
        if self.has_modes() && self.entered.is_none() && step != StepEnd::Failed {
            let (y, yp) = halves(point);
            self.settle_untold(t, y, yp)?;
        }
        Ok(self.entered.is_some())
    }

    fn note_magnitudes(&mut self, t: f64, point: &[f64], _: &[f64]) -> Result<(), Failure> {
        if !self.has_modes() {
            return Ok(());
        }
        let (y, yp) = halves(point);
        self.note_unknowns(y);
        self.follow_back(t, y, yp)?;
        self.reference.watch_bounds(t, &self.x)
    }

    fn looks_between(&self) -> bool {
        self.has_modes()
    }

    fn locates_crossings(&self) -> bool {
        self.reference.locates_crossings()
    }

    fn accept(&mut self, t: f64, point: &[f64]) -> Result<(), Failure> {
        let entered = self.entered.clone();
        let (y, yp) = halves(entered.as_deref().unwrap_or(point));
        self.place_rates(yp);
        self.form.accept(t, y)?;
        let observed = !self.map.uncontrolled.is_empty() && !self.form.recorded().is_empty();
        if self.has_modes() || self.reference.has_delays() || observed && self.reference.follows_solutions_at_all() {
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
        let entered = self.entered.clone();
        let (y, yp) = halves(entered.as_deref().unwrap_or(point));
        let (y, yp) = match (self.form.recorded().is_empty(), self.map.uncontrolled.is_empty()) {
            (true, _) => (y.to_vec(), yp.to_vec()),
            (false, true) => self.consistent(t, y, yp)?,
            (false, false) => self.controlled(t, y, yp)?,
        };
        self.place_rates(&yp);
        self.form.observe(t, &y, out)
    }
}
