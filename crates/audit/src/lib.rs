//! Checks a run against the bond graph it came from: power, energy and every law, by code that shares nothing with the
//! formulations but the [`BondGraph`]. Source: `method.md`, section 7.
//!
//! - **Power**: at every sample the powers at the ports of a connected junction structure sum to zero.
//! - **Residual**: at every sample every junction, two-port, source, resistor and storage law holds.
//! - **Energy and rates**: between samples, stored quantities and energies change by the integrals of their rates. The
//!   integrals are taken over the samples themselves, by quintics through neighbouring ones between jumps, and come
//!   with an estimate of their own error ([`Finding::resolution`], the difference to quartics): what is found below it
//!   says nothing about the run. Samples at every step of the integrator resolve about as much as its steps do.
//!
//! What is undetermined or was not recorded is not checked, and listed in [`Audit::unchecked`]; pseudo-bonds are exempt
//! from power and energy.
#![forbid(unsafe_code)]

mod energy;
mod laws;
mod power;
mod quadrature;
mod regions;
mod values;

use halfarrow_compiler::bond_graph::BondGraph;
use std::collections::BTreeMap;
use std::fmt;

pub use values::wanted;

/// What is audited: samples of a run, with the variables of [`wanted`] that have a value.
#[derive(Debug, Clone, Copy)]
pub struct Run<'a> {
    /// Times in s, never decreasing; a time given twice is a jump, its two sides.
    pub times: &'a [f64],
    /// Columns by name, each as long as `times`, in SI units.
    pub columns: &'a BTreeMap<String, &'a [f64]>,
    /// Parameters and constants by name, in SI units.
    pub parameters: &'a BTreeMap<String, f64>,
}

/// The greatest miss of a kind.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// The miss, relative to the greatest magnitude of its kind around its place.
    pub value: f64,
    /// When, in s.
    pub time: f64,
    /// Where: an element, a junction or a part of the graph, and what was missed there.
    pub place: String,
    /// Below this a miss says nothing; 0 where nothing is integrated.
    pub resolution: f64,
}

/// What an audit finds.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Audit {
    /// Power made or eaten by the junction structure, relative to the greatest power at a port of the connected part.
    pub power: Option<Finding>,
    /// Stored less initial, supplied plus dissipated energy, relative to the greatest energy held or moved at a port.
    pub energy: Option<Finding>,
    /// Laws of junctions and elements, relative to the greatest effort or flow in the joined region.
    pub residual: Option<Finding>,
    /// Stored quantities and integrated signals against the integrals of their rates, relative to their range.
    pub rates: Option<Finding>,
    /// Storages that make or eat energy, and why.
    pub notes: Vec<String>,
    /// What could not be checked, and why.
    pub unchecked: Vec<String>,
}

/// Audits a run.
///
/// # Panics
/// If a column is not as long as the times.
pub fn audit(graph: &BondGraph, run: &Run) -> Audit {
    assert!(run.columns.values().all(|c| c.len() == run.times.len()), "every column has one value a sample");
    let values = values::Values::new(graph, run);
    let mut audit = Audit { notes: energy::notes(graph), ..Audit::default() };
    let regions = regions::Regions::new(graph, &values);
    audit.power = power::power(graph, &values, &mut audit.unchecked);
    audit.residual = laws::residual(graph, &values, &regions, &mut audit.unchecked);
    audit.rates = energy::rates(graph, &values, &mut audit.unchecked);
    audit.energy = energy::energy(graph, &values, &mut audit.unchecked);
    audit.unchecked.sort();
    audit.unchecked.dedup();
    audit
}

/// Keeps the greater of two findings.
fn keep(greatest: &mut Option<Finding>, finding: Finding) {
    // NaN counts as greatest: it is never right.
    let above = |old: &Finding| finding.value > old.value || (finding.value.is_nan() && !old.value.is_nan());
    if greatest.as_ref().is_none_or(above) {
        *greatest = Some(finding);
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.1e} at t = {} s, {}", self.value, self.time, self.place)?;
        if self.resolution > 0.0 {
            write!(f, " (samples resolve {:.1e})", self.resolution)?;
        }
        Ok(())
    }
}

impl fmt::Display for Audit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lines =
            [("power", &self.power), ("energy", &self.energy), ("residual", &self.residual), ("rates", &self.rates)];
        for (name, finding) in lines {
            match finding {
                Some(finding) => writeln!(f, "{name}: {finding}")?,
                None => writeln!(f, "{name}: nothing to check")?,
            }
        }
        self.notes.iter().try_for_each(|note| writeln!(f, "note: {note}"))?;
        self.unchecked.iter().try_for_each(|what| writeln!(f, "not checked: {what}"))
    }
}
