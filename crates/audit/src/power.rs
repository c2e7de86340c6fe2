//! The junction structure makes no power.

use crate::energy::pseudo_parts;
use crate::on_all_cores::on_all_cores;
use crate::scales::{Scale, Scales, Settled, Term};
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
        let least = settled.scale(&[natural]);
        let parts = on_all_cores(ports, values, |ports, values| passed(ports, graph, values, (scales, settled), least));
        let all = parts.into_iter().reduce(|all, more| Ok(with(all?, more?)));
        let misses = match all.expect("there are ports") {
            Ok(misses) => misses,
            Err(port) => {
                let name = &graph.elements[port.element].name;
                unchecked.push(format!("the power balance of the part with {name}: its effort or flow is not known"));
                continue;
            }
        };
        let relative = |k: usize| misses[k].1.relative(misses[k].0);
        let stands_out =
            |k: usize, most: usize| relative(k) > relative(most) || (relative(k).is_nan() && !relative(most).is_nan());
        let most = (0..misses.len()).reduce(|most, k| if stands_out(k, most) { k } else { most });
        let Some(sample) = most else { continue };
        let (miss, scale) = misses[sample];
        worst.note(miss, scale, settled, || {
            let mut terms = vec![natural];
            ports.iter().for_each(|&port| terms.extend(changes(graph, values, scales, port, sample)));
            let place = format!("the part with {}", graph.elements[ports[0].element].name);
            Raw { miss, resolution: 0.0, time: values.times[sample], place, terms }
        });
    }
}

/// What passes ports, added up, and what it counts relative to, sample by sample.
type Passed = Vec<(f64, Scale)>;

/// What passes some ports; the first whose power is not known.
fn passed(
    ports: &[PortRef],
    graph: &BondGraph,
    values: &Values,
    (scales, settled): (&Scales, &Settled),
    least: Scale,
) -> Result<Passed, PortRef> {
    let (mut all, mut power) = (vec![(-0.0, least); values.times.len()], Vec::new());
    for &port in ports {
        values.power(port, &mut power).ok_or(port)?;
        all.iter_mut().zip(&power).for_each(|((sum, _), power)| *sum += power);
        let bond = graph.bond_of(port);
        for flow in [false, true] {
            let weights = if flow { values.effort(bond) } else { values.flow(bond) }.unwrap_or_default();
            let own = settled.scale(&[Term::of(scales.of_bond(bond, flow), 1.0)]);
            all.iter_mut().zip(weights).for_each(|((_, scale), weight)| *scale = scale.beside(weight.abs(), own));
        }
    }
    Ok(all)
}

/// What passes these ports and others.
fn with(mut all: Passed, more: Passed) -> Passed {
    for ((sum, scale), (power, other)) in all.iter_mut().zip(more) {
        (*sum, *scale) = (*sum + power, scale.or(other));
    }
    all
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
