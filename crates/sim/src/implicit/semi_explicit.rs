//! A semi-explicit system as one of states, some of which are algebraic.

use crate::{Events, Failure, HybridImplicitSystem, Sparsity, System, halves, halves_mut};

/// `M y' = f(t, y)` with ones and zeros in `M`: the rates are `f`, which is 0 for algebraic unknowns.
pub(super) struct SemiExplicit<'a> {
    system: &'a mut dyn HybridImplicitSystem,
    differential: Vec<bool>,
    scales: Vec<f64>,
    /// Rates that the residual is asked at, always 0, so that it is `-f`.
    rest: Vec<f64>,
    /// All unknowns, then their rates, where they were asked for last.
    point: Vec<f64>,
    dy: Vec<f64>,
    dyp: Vec<f64>,
    /// Where `dy` was taken: time and unknowns.
    taken: Option<(f64, Vec<f64>)>,
}

impl<'a> SemiExplicit<'a> {
    pub(super) fn new(
        system: &'a mut dyn HybridImplicitSystem,
        differential: Vec<bool>,
        scales: Vec<f64>,
    ) -> SemiExplicit<'a> {
        let (size, nonzeros) = (differential.len(), system.sparsity().nonzeros());
        SemiExplicit {
            system,
            differential,
            scales,
            rest: vec![0.0; size],
            point: vec![0.0; 2 * size],
            dy: vec![0.0; nonzeros],
            dyp: vec![0.0; nonzeros],
            taken: None,
        }
    }

    /// The rates where they were asked for last.
    pub(super) fn last_rates(&self) -> &[f64] {
        halves(&self.point).1
    }

    /// Completes `y` by its rates; those of algebraic unknowns are 0.
    fn complete(&mut self, t: f64, y: &[f64]) -> Result<(), Failure> {
        let (unknowns, rates) = self.point.split_at_mut(y.len());
        unknowns.copy_from_slice(y);
        self.system.residual(t, y, &self.rest, rates)?;
        for (rate, differential) in rates.iter_mut().zip(&self.differential) {
            *rate = if *differential { -*rate } else { 0.0 };
        }
        Ok(())
    }

    /// Takes the derivatives, unless that was done there.
    fn linearise(&mut self, t: f64, y: &[f64]) -> Result<(), Failure> {
        if self.taken.as_ref().is_some_and(|(time, unknowns)| *time == t && unknowns == y) {
            return Ok(());
        }
        self.taken = None;
        self.system.jacobian(t, y, &self.rest, &mut self.dy, &mut self.dyp)?;
        self.taken = Some((t, y.to_vec()));
        Ok(())
    }
}

impl System for SemiExplicit<'_> {
    fn states(&self) -> usize {
        self.differential.len()
    }
    fn state_name(&self, state: usize) -> String {
        self.system.unknown_name(state)
    }
    fn scales(&self) -> &[f64] {
        &self.scales
    }
    fn rates(&mut self, t: f64, x: &[f64], dx: &mut [f64]) -> Result<(), Failure> {
        self.system.residual(t, x, &self.rest, dx)?;
        dx.iter_mut().for_each(|rate| *rate = -*rate);
        Ok(())
    }
    fn directional_derivative(&mut self, t: f64, x: &[f64], v: &[f64], jv: &mut [f64]) -> Result<(), Failure> {
        self.linearise(t, x)?;
        jv.fill(0.0);
        let entries = self.system.sparsity().entries().zip(&self.dy);
        entries.for_each(|((row, column), dy)| jv[row] -= dy * v[column]);
        Ok(())
    }
    fn time_derivative(&mut self, t: f64, _: &[f64], _: &mut [f64]) -> Result<(), Failure> {
        // Only methods of fixed step ask for it, which no implicit form has.
        Err(Failure::NotFinite { time: t, what: "the derivative by time of an implicit form".into() })
    }
    fn sparsity(&self) -> &Sparsity {
        self.system.sparsity()
    }
}

impl Events for SemiExplicit<'_> {
    fn passed_pole(&mut self, t: f64) -> Result<(), Failure> {
        self.system.passed_pole(t)
    }

    fn next_time_event(&mut self, t: f64) -> Option<f64> {
        self.system.next_time_event(t)
    }
    fn is_corner(&mut self, t: f64) -> bool {
        self.system.is_corner(t)
    }
    fn indicators(&self) -> usize {
        self.system.indicators()
    }
    fn indicator_name(&self, indicator: usize) -> String {
        self.system.indicator_name(indicator)
    }
    fn longest_step(&self) -> f64 {
        self.system.longest_step()
    }
    fn angles(&self, angles: &mut Vec<f64>) {
        self.system.angles(angles);
    }
    fn event_indicators(&mut self, t: f64, x: &[f64], g: &mut [f64]) -> Result<(), Failure> {
        self.complete(t, x)?;
        self.system.event_indicators(t, &self.point, g)
    }
    fn handle_event(&mut self, t: f64, x: &mut [f64]) -> Result<(), Failure> {
        self.taken = None;
        halves_mut(&mut self.point).0.copy_from_slice(x);
        self.system.handle_event(t, &mut self.point)?;
        x.copy_from_slice(halves(&self.point).0);
        Ok(())
    }
    fn accept(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        self.complete(t, x)?;
        self.system.accept(t, &self.point)
    }
    fn observed(&self) -> usize {
        self.system.observed()
    }
    fn observed_name(&self, value: usize) -> String {
        self.system.observed_name(value)
    }
    fn observe(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        self.complete(t, x)?;
        self.system.observe(t, &self.point, out)
    }
}
