//! A system whose every step is recorded for the audit.

use std::collections::BTreeMap;

use halfarrow_audit::{self as audit, Audit, Finding, audit, wanted};
use halfarrow_compiler::bond_graph::BondGraph;
use halfarrow_exec as exec;
use halfarrow_sim::{Failure, ImplicitSystem, Sparsity, System};
use serde::Serialize;

use crate::run::Recording;

/// Samples audited at once: bounds the memory of long runs.
const CHUNK: usize = 4096;

/// Greatest misses that the audit found.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct AuditReport {
    /// Power made or eaten by the junction structure.
    pub power: Option<Miss>,
    /// Stored less initial, supplied plus dissipated energy.
    pub energy: Option<Miss>,
    /// Laws of junctions and elements.
    pub residual: Option<Miss>,
    /// Stored quantities and integrated signals against the integrals of their rates.
    pub rates: Option<Miss>,
    /// Storages that make or eat energy, and why.
    pub notes: Vec<String>,
    /// What could not be checked, and why.
    pub unchecked: Vec<String>,
}

/// The greatest miss of a kind.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Miss {
    /// Relative to the greatest magnitude of its kind around its place.
    pub value: f64,
    /// When, in s.
    pub time: f64,
    /// Where, and what was missed there.
    pub place: String,
    /// Below this a miss says nothing; 0 where nothing is integrated.
    pub resolution: f64,
}

/// A model that records for the audit what it hands out no one else.
pub struct Audited<'a, M> {
    model: &'a mut M,
    book: Book<'a>,
}

/// What is recorded.
struct Book<'a> {
    graph: &'a BondGraph,
    parameters: BTreeMap<String, f64>,
    names: Vec<String>,
    times: Vec<f64>,
    columns: Vec<Vec<f64>>,
    /// Where the recorded values of the user stand among all.
    shown: Vec<usize>,
    values: Vec<f64>,
    report: AuditReport,
}

impl<'a, M: Recording + Parameters> Audited<'a, M> {
    /// Audits what `model` computes; what it records stays what it is.
    pub fn new(model: &'a mut M, graph: &'a BondGraph) -> Audited<'a, M> {
        let observed = &model.program().observed;
        let asked: Vec<String> = model.recorded().iter().map(|&i| observed[i].name.clone()).collect();
        let available = |name: &String| observed.iter().any(|o| o.name == *name && o.value.is_ok());
        let names: Vec<String> = wanted(graph).into_iter().filter(available).collect();
        let all: Vec<&str> = names.iter().chain(&asked).map(String::as_str).collect();
        let count = all.len();
        // Every name is known to have a value, so this cannot fail.
        let _ = model.record(&all);
        let known = graph.parameters.values().map(|p| p.name.clone());
        let book = Book {
            parameters: known.filter_map(|name| model.parameter(&name).map(|value| (name, value))).collect(),
            shown: (names.len()..count).collect(),
            columns: vec![Vec::new(); names.len()],
            values: vec![0.0; count],
            times: Vec::new(),
            report: AuditReport::default(),
            graph,
            names,
        };
        Audited { model, book }
    }

    /// What was found.
    pub fn finish(mut self) -> AuditReport {
        self.book.audit();
        self.book.report
    }
}

/// What knows the values of parameters.
pub trait Parameters {
    /// The present value of a parameter.
    fn parameter(&self, name: &str) -> Option<f64>;
}

impl Parameters for exec::Model {
    fn parameter(&self, name: &str) -> Option<f64> {
        self.parameter(name)
    }
}

impl Parameters for exec::ImplicitModel {
    fn parameter(&self, name: &str) -> Option<f64> {
        self.reference().parameter(name)
    }
}

impl Book<'_> {
    /// Keeps the values just observed at `t`.
    fn keep(&mut self, t: f64) {
        self.times.push(t);
        self.columns.iter_mut().zip(&self.values).for_each(|(column, value)| column.push(*value));
        if self.times.len() >= CHUNK {
            self.audit();
        }
    }

    /// The values that the user asked for.
    fn hand_out(&self, out: &mut [f64]) {
        out.iter_mut().zip(&self.shown).for_each(|(value, &i)| *value = self.values[i]);
    }

    /// Audits what has been recorded, and keeps the last sample to go on from.
    fn audit(&mut self) {
        if self.times.len() < 2 {
            return;
        }
        let columns = self.names.iter().cloned().zip(self.columns.iter().map(Vec::as_slice)).collect();
        let run = audit::Run { times: &self.times, columns: &columns, parameters: &self.parameters };
        self.report.take(audit(self.graph, &run));
        let last = self.times.len() - 1;
        self.times.drain(..last);
        self.columns.iter_mut().for_each(|column| drop(column.drain(..last)));
    }
}

impl AuditReport {
    /// Keeps the greater misses.
    fn take(&mut self, audit: Audit) {
        let pairs = [
            (&mut self.power, audit.power),
            (&mut self.energy, audit.energy),
            (&mut self.residual, audit.residual),
            (&mut self.rates, audit.rates),
        ];
        for (greatest, found) in pairs {
            let miss = found.map(Miss::from);
            let above = |m: &Miss| greatest.as_ref().is_none_or(|g| m.value > g.value || m.value.is_nan());
            if let Some(miss) = miss.filter(above) {
                *greatest = Some(miss);
            }
        }
        for (all, more) in [(&mut self.notes, audit.notes), (&mut self.unchecked, audit.unchecked)] {
            all.extend(more);
            all.sort();
            all.dedup();
        }
    }
}

impl From<Finding> for Miss {
    fn from(f: Finding) -> Miss {
        Miss { value: f.value, time: f.time, place: f.place, resolution: f.resolution }
    }
}

impl System for Audited<'_, exec::Model> {
    fn states(&self) -> usize {
        self.model.states()
    }
    fn state_name(&self, state: usize) -> String {
        self.model.state_name(state)
    }
    fn switch_name(&self, switch: usize) -> String {
        self.model.switch_name(switch)
    }
    fn observed_name(&self, value: usize) -> String {
        self.model.observed_name(self.book.shown[value])
    }
    fn scales(&self) -> &[f64] {
        self.model.scales()
    }
    fn rates(&mut self, t: f64, x: &[f64], dx: &mut [f64]) -> Result<(), Failure> {
        self.model.rates(t, x, dx)
    }
    fn tangent(&mut self, t: f64, x: &[f64], v: &[f64], jv: &mut [f64]) -> Result<(), Failure> {
        self.model.tangent(t, x, v, jv)
    }
    fn jacobian(&mut self, t: f64, x: &[f64], values: &mut [f64]) -> Result<bool, Failure> {
        self.model.jacobian(t, x, values)
    }
    fn drift(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        self.model.drift(t, x, out)
    }
    fn sparsity(&self) -> &Sparsity {
        self.model.sparsity()
    }
    fn observe(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        self.model.observe(t, x, &mut self.book.values)?;
        self.book.hand_out(out);
        Ok(())
    }
    fn observed(&self) -> usize {
        self.book.shown.len()
    }
    fn next_jump(&mut self, t: f64) -> Option<f64> {
        self.model.next_jump(t)
    }
    fn cross_jump(&mut self, t: f64, x: &mut [f64]) -> Result<(), Failure> {
        self.model.cross_jump(t, x)?;
        self.model.observe(t, x, &mut self.book.values)?;
        self.book.keep(t);
        Ok(())
    }
    fn accept(&mut self, t: f64, x: &[f64]) -> Result<(), Failure> {
        self.model.accept(t, x)?;
        if self.book.times.last() != Some(&t) {
            self.model.observe(t, x, &mut self.book.values)?;
            self.book.keep(t);
        }
        Ok(())
    }
    fn switches(&self) -> usize {
        self.model.switches()
    }
    fn switch_values(&mut self, t: f64, x: &[f64], g: &mut [f64]) -> Result<(), Failure> {
        self.model.switch_values(t, x, g)
    }
}

impl ImplicitSystem for Audited<'_, exec::ImplicitModel> {
    fn unknowns(&self) -> usize {
        self.model.unknowns()
    }
    fn unknown_name(&self, unknown: usize) -> String {
        self.model.unknown_name(unknown)
    }
    fn equation_name(&self, equation: usize) -> String {
        self.model.equation_name(equation)
    }
    fn switch_name(&self, switch: usize) -> String {
        self.model.switch_name(switch)
    }
    fn observed_name(&self, value: usize) -> String {
        self.model.observed_name(self.book.shown[value])
    }
    fn scales(&self) -> &[f64] {
        self.model.scales()
    }
    fn index(&self, unknown: usize) -> u8 {
        self.model.index(unknown)
    }
    fn residual(&mut self, t: f64, y: &[f64], yp: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        self.model.residual(t, y, yp, out)
    }
    fn sparsity(&self) -> &Sparsity {
        self.model.sparsity()
    }
    fn jacobian(&mut self, t: f64, y: &[f64], yp: &[f64], dy: &mut [f64], dyp: &mut [f64]) -> Result<(), Failure> {
        self.model.jacobian(t, y, yp, dy, dyp)
    }
    fn semi_explicit(&self) -> Option<&[bool]> {
        self.model.semi_explicit()
    }
    fn observe(&mut self, t: f64, y: &[f64], yp: &[f64], out: &mut [f64]) -> Result<(), Failure> {
        self.model.observe(t, y, yp, &mut self.book.values)?;
        self.book.hand_out(out);
        Ok(())
    }
    fn observed(&self) -> usize {
        self.book.shown.len()
    }
    fn next_jump(&mut self, t: f64) -> Option<f64> {
        self.model.next_jump(t)
    }
    fn cross_jump(&mut self, t: f64, y: &mut [f64], yp: &mut [f64]) -> Result<(), Failure> {
        self.model.cross_jump(t, y, yp)?;
        self.model.observe(t, y, yp, &mut self.book.values)?;
        self.book.keep(t);
        Ok(())
    }
    fn accept(&mut self, t: f64, y: &[f64], yp: &[f64]) -> Result<(), Failure> {
        self.model.accept(t, y, yp)?;
        if self.book.times.last() != Some(&t) {
            self.model.observe(t, y, yp, &mut self.book.values)?;
            self.book.keep(t);
        }
        Ok(())
    }
    fn switches(&self) -> usize {
        self.model.switches()
    }
    fn switch_values(&mut self, t: f64, y: &[f64], yp: &[f64], g: &mut [f64]) -> Result<(), Failure> {
        self.model.switch_values(t, y, yp, g)
    }
}
