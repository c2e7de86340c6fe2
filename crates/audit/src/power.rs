//! The junction structure makes no power.

use crate::regions::Classes;
use crate::values::Values;
use crate::{Finding, keep};
use halfarrow_compiler::bond_graph::{BondGraph, PortRef};
use std::collections::{BTreeMap, BTreeSet};

/// Greatest power made or eaten by a connected junction structure, relative to the greatest power at its ports.
pub(crate) fn power(graph: &BondGraph, values: &Values, unchecked: &mut Vec<String>) -> Option<Finding> {
    let parts = Classes::new(graph, |kind| kind.is_inner());
    let pseudo: BTreeSet<usize> = graph.bonds.iter().filter(|(_, b)| b.pseudo).map(|(id, _)| parts.of(id)).collect();
    let mut ports: BTreeMap<usize, Vec<PortRef>> = BTreeMap::new();
    for port in graph.outer_ports() {
        let part = parts.of(graph.bond_of(port));
        if !pseudo.contains(&part) {
            ports.entry(part).or_default().push(port);
        }
    }
    let mut greatest = None;
    for ports in ports.values() {
        let powers: Vec<Option<Vec<f64>>> = ports.iter().map(|&port| values.power(port)).collect();
        if let Some(missing) = powers.iter().position(Option::is_none) {
            let name = &graph.elements[ports[missing].element].name;
            unchecked.push(format!("the power balance of the part with {name}: its effort or flow is not known"));
            continue;
        }
        let powers: Vec<Vec<f64>> = powers.into_iter().flatten().collect();
        let most = powers.iter().flatten().fold(0.0f64, |most, p| most.max(p.abs()));
        for (sample, &time) in values.times.iter().enumerate() {
            let sum: f64 = powers.iter().map(|p| p[sample]).sum();
            let value = relative(sum, most);
            let place = format!("the part with {}", graph.elements[ports[0].element].name);
            if greatest.as_ref().is_none_or(|g: &Finding| value > g.value || value.is_nan()) {
                keep(&mut greatest, Finding { value, time, place, resolution: 0.0 });
            }
        }
    }
    greatest
}

/// The miss against a scale; what misses nothing is 0 even where nothing moves.
pub(crate) fn relative(miss: f64, scale: f64) -> f64 {
    if miss == 0.0 { 0.0 } else { miss.abs() / scale.max(f64::MIN_POSITIVE) }
}
