//! The junction structure makes no power.

use crate::energy::pseudo_parts;
use crate::scales::{Scales, Settled, Term};
use crate::values::Values;
use crate::worst::{Raw, Worst};
use halfarrow_compiler::bond_graph::{BondGraph, PortRef};

/// Greatest power made or eaten by a connected junction structure, relative to the greatest power at its ports.
pub(crate) fn power(
    graph: &BondGraph,
    values: &Values,
    (scales, settled): (&Scales, &Settled),
    worst: &mut Worst,
    unchecked: &mut Vec<String>,
) {
    let pseudo = pseudo_parts(graph, scales);
    let mut ports: Vec<Vec<PortRef>> = vec![Vec::new(); scales.part_count()];
    for port in graph.outer_ports() {
        let part = scales.part(graph, port);
        if !pseudo.contains(&part) {
            ports[part].push(port);
        }
    }
    for ports in ports.iter().filter(|ports| !ports.is_empty()) {
        let natural = Term::of(scales.power(graph, ports[0]), 1.0);
        let (mut misses, mut all) =
            (vec![-0.0; values.times.len()], vec![settled.scale(&[natural]); values.times.len()]);
        let missing = ports.iter().find(|&&port| {
            let power = values.power(port);
            power.iter().flatten().zip(&mut misses).for_each(|(power, sum)| *sum += power);
            let bond = graph.bond_of(port);
            for flow in [false, true] {
                let weights = if flow { values.effort(bond) } else { values.flow(bond) }.unwrap_or_default();
                let own = settled.scale(&[Term::of(scales.of_bond(bond, flow), 1.0)]);
                weights.iter().zip(&mut all).for_each(|(weight, scale)| *scale = scale.beside(weight.abs(), own));
            }
            power.is_none()
        });
        if let Some(port) = missing {
            let name = &graph.elements[port.element].name;
            unchecked.push(format!("the power balance of the part with {name}: its effort or flow is not known"));
            continue;
        }
        let place = format!("the part with {}", graph.elements[ports[0].element].name);
        for (sample, (&time, &miss)) in values.times.iter().zip(&misses).enumerate() {
            worst.note(miss, all[sample], settled, || {
                let mut terms = vec![natural];
                ports.iter().for_each(|&port| terms.extend(changes(graph, values, scales, port, sample)));
                Raw { miss, resolution: 0.0, time, place: place.clone(), terms }
            });
        }
    }
}

/// By how much the power at a port changes with its effort and its flow.
fn changes(graph: &BondGraph, values: &Values, scales: &Scales, port: PortRef, sample: usize) -> [Term; 2] {
    let bond = graph.bond_of(port);
    let weight = |column: Option<&[f64]>| column.map_or(0.0, |c| c[sample].abs());
    [
        Term::beside(scales.of_bond(bond, false), weight(values.flow(bond))),
        Term::beside(scales.of_bond(bond, true), weight(values.effort(bond))),
    ]
}
