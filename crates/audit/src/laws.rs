//! Every law of every junction and element, at every sample.

use crate::power::relative;
use crate::regions::Regions;
use crate::values::Values;
use crate::{Finding, keep};
use halfarrow_compiler::algebra::{Expr, Node};
use halfarrow_compiler::bond_graph::{BondGraph, BondId, Element, ElementId, Kind, PortRef, ResistorLaw, StorageLaw};

/// A law in values: what stands against what, and how great its terms are.
enum Law<'a> {
    /// Two recorded columns are equal up to the factor.
    Equal { left: &'a [f64], right: &'a [f64], what: &'static str, scale: f64 },
    /// A recorded column has the value of an expression.
    Value { left: &'a [f64], right: Expr, what: &'static str, scale: f64 },
    /// A column is an expression times another.
    Product { left: &'a [f64], factor: Expr, right: &'a [f64], what: &'static str, scale: f64 },
    /// Signed columns sum to zero.
    Sum { terms: Vec<(f64, &'a [f64])>, what: &'static str, scale: f64 },
    /// An expression vanishes.
    Zero { expr: Expr, what: &'static str },
}

/// The law whose miss is greatest.
pub(crate) fn residual(
    graph: &BondGraph,
    values: &Values,
    regions: &Regions,
    unchecked: &mut Vec<String>,
) -> Option<Finding> {
    let mut greatest = None;
    for (name, left, right) in &values.same {
        let scale = left.iter().chain(*right).fold(0.0f64, |most, v| most.max(v.abs()));
        let mut miss = Miss { name, times: values.times, greatest: &mut greatest };
        (0..left.len()).for_each(|i| miss.note(i, left[i] - right[i], scale, "two names of one variable"));
    }
    for (id, element) in graph.elements.iter() {
        let mut laws = Laws { graph, values, regions, laws: Vec::new(), missing: false };
        laws.of(id, element);
        if laws.missing {
            unchecked.push(format!("laws of {}: not all of its efforts and flows are known", element.name));
        }
        for law in laws.laws {
            if let Err(missing) = check(graph, values, &element.name, &law, &mut greatest) {
                unchecked.push(format!("a law of {}: {missing} is not known", element.name));
            }
        }
    }
    greatest
}

/// Collects the laws of an element.
struct Laws<'a, 'b> {
    graph: &'b BondGraph,
    values: &'b Values<'a>,
    regions: &'b Regions,
    laws: Vec<Law<'a>>,
    missing: bool,
}

impl<'a> Laws<'a, '_> {
    fn of(&mut self, id: ElementId, element: &Element) {
        let bond = |port: usize| element.ports[port].bond;
        match &element.kind {
            Kind::Zero => {
                self.common(element, false);
                self.sum(element, true);
            }
            Kind::One => {
                self.common(element, true);
                self.sum(element, false);
            }
            Kind::EffortSource { value } => self.value(bond(0), false, *value, "its effort"),
            Kind::FlowSource { value } => self.value(bond(0), true, *value, "its flow"),
            Kind::ZeroCompliance { flow } => self.value(bond(0), true, *flow, "the flow it holds"),
            Kind::ResidualEffort { residual: Some(expr) } | Kind::ResidualFlow { residual: Some(expr) } => {
                self.laws.push(Law::Zero { expr: *expr, what: "its residual" });
            }
            Kind::ResidualEffort { residual: None } | Kind::EffortDetector => self.vanishes(bond(0), true, "its flow"),
            Kind::ResidualFlow { residual: None } | Kind::FlowDetector => self.vanishes(bond(0), false, "its effort"),
            Kind::Transformer { modulus } => {
                self.two_port(bond(0), bond(1), *modulus, false);
            }
            Kind::Gyrator { modulus } => {
                self.two_port(bond(0), bond(1), *modulus, true);
            }
            Kind::Resistor(laws) => {
                for (port, law) in laws.iter().enumerate() {
                    match *law {
                        ResistorLaw::Resistive(e) => self.value(bond(port), false, e, "its law"),
                        ResistorLaw::Conductive(f) => self.value(bond(port), true, f, "its law"),
                        ResistorLaw::Implicit(expr) => self.laws.push(Law::Zero { expr, what: "its law" }),
                    }
                }
            }
            Kind::Inertance(storage) | Kind::Compliance(storage) => {
                let flow_is_z = matches!(element.kind, Kind::Inertance(_));
                for (port, law) in storage.laws.iter().enumerate() {
                    let place = PortRef { element: id, port: port as u32 };
                    match *law {
                        StorageLaw::Integral(z) => self.value(bond(port), flow_is_z, z, "its law"),
                        StorageLaw::Derivative(x) => self.stored(place, storage.stored[port], x),
                        StorageLaw::Implicit(expr) => self.laws.push(Law::Zero { expr, what: "its law" }),
                        StorageLaw::Known { displacement, law } => {
                            self.stored(place, storage.stored[port], displacement);
                            self.value(bond(port), flow_is_z, law, "its law");
                        }
                    }
                }
            }
        }
    }

    fn column(&mut self, bond: BondId, flow: bool) -> Option<&'a [f64]> {
        let column = if flow { self.values.flow(bond) } else { self.values.effort(bond) };
        self.missing |= column.is_none();
        column
    }

    fn scale(&self, bond: BondId, flow: bool) -> f64 {
        if flow { self.regions.flow(bond) } else { self.regions.effort(bond) }
    }

    fn common(&mut self, element: &Element, flow: bool) {
        let what = if flow { "its common flow" } else { "its common effort" };
        let scale = self.scale(element.ports[0].bond, flow);
        let columns: Vec<&[f64]> = element.ports.iter().filter_map(|p| self.column(p.bond, flow)).collect();
        for pair in columns.windows(2) {
            self.laws.push(Law::Equal { left: pair[0], right: pair[1], what, scale });
        }
    }

    fn sum(&mut self, element: &Element, flow: bool) {
        let what = if flow { "the sum of its flows" } else { "the sum of its efforts" };
        let sign = |inward: bool| if inward { 1.0 } else { -1.0 };
        let terms: Vec<Option<(f64, &[f64])>> =
            element.ports.iter().map(|p| Some((sign(p.inward), self.column(p.bond, flow)?))).collect();
        if terms.iter().all(Option::is_some) {
            let scale = self.scale(element.ports[0].bond, flow);
            self.laws.push(Law::Sum { terms: terms.into_iter().flatten().collect(), what, scale });
        }
    }

    fn value(&mut self, bond: BondId, flow: bool, right: Expr, what: &'static str) {
        if let Some(left) = self.column(bond, flow) {
            self.laws.push(Law::Value { left, right, what, scale: self.scale(bond, flow) });
        }
    }

    fn vanishes(&mut self, bond: BondId, flow: bool, what: &'static str) {
        if let Some(column) = self.column(bond, flow) {
            self.laws.push(Law::Sum { terms: vec![(1.0, column)], what, scale: self.scale(bond, flow) });
        }
    }

    fn stored(&mut self, _place: PortRef, symbol: halfarrow_compiler::algebra::Symbol, right: Expr) {
        match self.values.column(symbol) {
            Some(left) => {
                let scale = left.iter().fold(0.0f64, |most, v| most.max(v.abs()));
                self.laws.push(Law::Value { left, right, what: "its stored quantity", scale });
            }
            None => self.missing = true,
        }
    }

    /// `e_in = m e_out, f_out = m f_in`, or `e_in = r f_out, e_out = r f_in`.
    fn two_port(&mut self, input: BondId, output: BondId, factor: Expr, gyrator: bool) {
        debug_assert!(self.graph.bonds.get(input).is_some());
        let rows = match gyrator {
            false => [(input, false, output, false), (output, true, input, true)],
            true => [(input, false, output, true), (output, false, input, true)],
        };
        for (left, left_flow, right, right_flow) in rows {
            let (scale, what) = (self.scale(left, left_flow), if left_flow { "its flows" } else { "its efforts" });
            if let (Some(left), Some(right)) = (self.column(left, left_flow), self.column(right, right_flow)) {
                self.laws.push(Law::Product { left, factor, right, what, scale });
            }
        }
    }
}

fn check(
    graph: &BondGraph,
    values: &Values,
    name: &str,
    law: &Law,
    greatest: &mut Option<Finding>,
) -> Result<(), String> {
    let mut miss = Miss { name, times: values.times, greatest };
    match law {
        Law::Equal { left, right, what, scale } => {
            (0..left.len()).for_each(|i| miss.note(i, left[i] - right[i], *scale, what));
        }
        Law::Sum { terms, what, scale } => {
            for i in 0..values.times.len() {
                miss.note(i, terms.iter().map(|(sign, column)| sign * column[i]).sum(), *scale, what);
            }
        }
        Law::Value { left, right, what, scale } => {
            values.evaluate(&[*right], |i, v| miss.note(i, left[i] - v[0], *scale, what))?;
        }
        Law::Product { left, factor, right, what, scale } => {
            values.evaluate(&[*factor], |i, v| miss.note(i, left[i] - v[0] * right[i], *scale, what))?;
        }
        Law::Zero { expr, what } => {
            let terms = match graph.exprs.node(*expr) {
                Node::Add(terms) => terms.to_vec(),
                _ => vec![*expr],
            };
            let mut rows = Vec::new();
            values.evaluate(&terms, |i, v| {
                rows.push((i, v.iter().sum::<f64>(), v.iter().fold(0.0f64, |most, v| most.max(v.abs()))));
            })?;
            let scale = rows.iter().fold(0.0f64, |most, r| most.max(r.2));
            rows.iter().for_each(|&(i, sum, _)| miss.note(i, sum, scale, what));
        }
    }
    Ok(())
}

struct Miss<'a> {
    name: &'a str,
    times: &'a [f64],
    greatest: &'a mut Option<Finding>,
}

impl Miss<'_> {
    fn note(&mut self, sample: usize, miss: f64, scale: f64, what: &str) {
        let value = relative(miss, scale);
        if self.greatest.as_ref().is_none_or(|g| value > g.value || value.is_nan()) {
            let place = format!("{}: {what}", self.name);
            keep(self.greatest, Finding { value, time: self.times[sample], place, resolution: 0.0 });
        }
    }
}
