//! Inputs and outputs chosen by the size of pivots at the start (threshold pivoting), where the usual order of priority
//! amplifies rounding errors or divides by zero there. Source: `method.md`, 5.1 and 5.2.

use std::collections::BTreeMap;

use super::Role;
use super::digits::{self, slope};
use super::ports::{CausalityPreferences, Net, Offer, Solved, Way};
use crate::algebra::{Eliminator, Exprs, NumericPoint};
use crate::bond_graph::{BondGraph, ElementId, PortCausality};

/// Threshold: a variable is eliminated in the order of priority if its pivot is at least this fraction of the largest one of
/// its class in the row.
const GOOD: f64 = 0.1;
/// The same for variables with priority: preferred by the modeller, or with integrals in moduli.
const ASKED_FOR: f64 = 1e-6;

/// Solves the junction structure of one connected part as [`solve_part`](super::ports::solve_part) does, with storages
/// and laws chosen by size at a point. `None` if no choice by size is complete.
fn solve_part_by_size(
    x: &mut Exprs,
    graph: &BondGraph,
    members: &[ElementId],
    preferences: &CausalityPreferences,
    point: &NumericPoint,
) -> Option<Solved> {
    let net = Net::new(x, graph, members, preferences);
    let outputs = x.tried(|x| chosen(x, graph, &net, preferences, point));
    express(x, &net, outputs, preferences, point)
}

/// The same, if it tells as much as a solution that is there and amplifies rounding errors less than that one does.
pub(super) fn better_by_size(
    x: &mut Exprs,
    graph: &BondGraph,
    members: &[ElementId],
    preferences: &CausalityPreferences,
    point: &mut NumericPoint,
    (solved, cost): (&Solved, f64),
) -> Option<Solved> {
    let found = solve_part_by_size(x, graph, members, preferences, point)?;
    (found.tells_as_much_as(solved) && digits::cost(x, graph, &found, point) < cost).then_some(found)
}

/// The roles of the ports, inputs and outputs chosen by size.
fn chosen(
    x: &mut Exprs,
    graph: &BondGraph,
    net: &Net,
    preferences: &CausalityPreferences,
    point: &NumericPoint,
) -> BTreeMap<usize, Role> {
    let mut choice = Choice::new(x, graph, net, point);
    choice.work.eliminate(x, &net.inner);
    let mut outputs: BTreeMap<usize, Role> = BTreeMap::new();
    for p in net.ports_where(|o| matches!(o, Offer::Imposed(_))) {
        let determined = choice.work.eliminate(x, &[net.ports[p].conjugate()]) == 1;
        outputs.insert(p, if determined { Role::Source } else { Role::Redundant });
    }
    let independent = choice.independent(x, preferences);
    for (p, causality) in choice.laws(x, preferences) {
        outputs.insert(p, Role::Algebraic(causality));
    }
    for p in net.storage_order(preferences) {
        outputs.insert(p, if independent.contains(&p) { Role::Independent } else { Role::Dependent });
    }
    outputs
}

/// Expresses the outputs so chosen, in whatever order has the simplest pivots: what is divided by then vanishes only
/// where the choice itself is singular.
fn express(
    x: &mut Exprs,
    net: &Net,
    outputs: BTreeMap<usize, Role>,
    preferences: &CausalityPreferences,
    point: &NumericPoint,
) -> Option<Solved> {
    let wanted = outputs.iter().filter(|(_, role)| **role != Role::Redundant);
    let columns: Vec<usize> = wanted.map(|(&p, &role)| net.ports[p].output(role)).collect();
    let both: Vec<usize> = net.inner.iter().chain(&columns).copied().collect();
    for classes in [vec![both], vec![net.inner.clone(), columns.clone()]] {
        let expressed = x.if_found(|x| {
            let mut work = Eliminator::new(x, net.rows.clone(), net.symbols.len()).near(point.clone());
            classes.iter().for_each(|class| _ = work.eliminate(x, class));
            let done = work.finish();
            let all = columns.iter().all(|c| done.pivots.iter().any(|pivot| pivot.column == *c));
            all.then(|| net.solved(x, done, &outputs, preferences, Way::BySize))
        });
        if expressed.is_some() {
            return expressed;
        }
    }
    None
}

/// Elimination under way.
struct Choice<'a> {
    net: &'a Net,
    work: Eliminator,
    /// Factors by which effort and flow of ports of storages and laws get the unit of the square root of power. Coefficients
    /// are divided by them.
    weights: Vec<Option<(f64, f64)>>,
}

impl<'a> Choice<'a> {
    fn new(x: &mut Exprs, graph: &BondGraph, net: &'a Net, point: &NumericPoint) -> Choice<'a> {
        let weight = |x: &Exprs, p: usize| {
            let port = &net.ports[p];
            let size = port.port.and_then(|port| slope(x, graph, point, port)).map_or(1.0, |s| s.size.sqrt());
            // Of a storage it is the co-energy variable that is multiplied by the root of `X/z`, and its rate divided.
            match port.offer {
                Offer::Law => Some((1.0 / size, size)),
                Offer::Imposed(_) => None,
                _ if port.given() == port.effort => Some((size, 1.0 / size)),
                _ => Some((1.0 / size, size)),
            }
        };
        let weights = (0..net.ports.len()).map(|p| weight(x, p)).collect();
        let work = Eliminator::new(x, net.rows.clone(), net.symbols.len()).near(point.clone());
        Choice { net, work, weights }
    }

    /// The scale factor of a column.
    fn weight(&self, p: usize, column: usize) -> f64 {
        let (effort, flow) = self.weights[p].unwrap_or((1.0, 1.0));
        1.0 / if column == self.net.ports[p].effort { effort } else { flow }
    }

    /// The storages that become independent: their rates follow from the structure.
    fn independent(&mut self, x: &mut Exprs, preferences: &CausalityPreferences) -> Vec<usize> {
        let mut open = self.net.storage_order(preferences);
        let asked = |p: &usize| match self.net.ports[*p].port {
            None => true,
            Some(port) => preferences.independent.contains(&port),
        };
        let weights: BTreeMap<usize, f64> = open
            .iter()
            .map(|&p| (self.net.ports[p].conjugate(), self.weight(p, self.net.ports[p].conjugate())))
            .collect();
        let mut found = Vec::new();
        for patience in [false, true] {
            let mut at = 0;
            while at < open.len() {
                let column = self.net.ports[open[at]].conjugate();
                let least = if patience {
                    0.0
                } else if asked(&open[at]) {
                    ASKED_FOR
                } else {
                    GOOD
                };
                match self.work.heaviest(x, column, &weights).filter(|(share, _)| *share >= least) {
                    Some((_, row)) => {
                        self.work.eliminate_by(x, column, row);
                        found.push(open.remove(at));
                        // A pivot rejected before may pass the threshold now.
                        at = 0;
                    }
                    None => at += 1,
                }
            }
        }
        found
    }

    /// The causality of each law: the one preferred for unless its pivot is small.
    fn laws(&mut self, x: &mut Exprs, preferences: &CausalityPreferences) -> Vec<(usize, PortCausality)> {
        let mut open = self.net.ports_where(|o| o == Offer::Law);
        let columns = open.iter().flat_map(|&p| [self.net.ports[p].effort, self.net.ports[p].flow].map(|c| (p, c)));
        let weights: BTreeMap<usize, f64> = columns.map(|(p, c)| (c, self.weight(p, c))).collect();
        let mut found = Vec::new();
        for least in [GOOD, 0.0] {
            let mut at = open.len();
            while at > 0 {
                at -= 1;
                let port = &self.net.ports[open[at]];
                let wish =
                    port.port.and_then(|p| preferences.algebraic.get(&p).copied()).unwrap_or(PortCausality::Resistive);
                let other = match wish {
                    PortCausality::Resistive => PortCausality::Conductive,
                    _ => PortCausality::Resistive,
                };
                let taken = [wish, other].into_iter().find_map(|causality| {
                    let column = port.column(causality == PortCausality::Conductive);
                    let (share, row) = self.work.heaviest(x, column, &weights)?;
                    (share >= least).then_some((causality, column, row))
                });
                if let Some((causality, column, row)) = taken {
                    self.work.eliminate_by(x, column, row);
                    found.push((open.remove(at), causality));
                    at = open.len();
                }
            }
        }
        // A law whose causality the structure leaves open.
        found.extend(open.into_iter().map(|p| (p, PortCausality::Resistive)));
        found
    }
}
