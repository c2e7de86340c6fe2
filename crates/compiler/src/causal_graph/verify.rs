//! What holds of every causal graph that this stage gives; a breach is our fault, not the modeller's.

use std::collections::{BTreeMap, BTreeSet};

use super::assign::imposes;
use super::rules::{around, in_order, kept_junctions, sits_at};
use super::strokes::{parts, sits_here};
use super::{CausalGraph, Role, Stroke};
use crate::algebra::Symbol;
use crate::bond_graph::{BondGraph, ElementId, Kind, Meaning, PortCausality, PortRef};
use crate::ids::Id;

/// Checks the invariants of a [`CausalGraph`]: every rule of strokes (sources, two-ports, junctions with and without a
/// kept variable, forced causality), strokes of storages and laws against the truth about their ports, and ports with
/// definitions that end at inputs.
///
/// # Errors
/// The first breach, in words for us.
pub fn verify(causal: &CausalGraph) -> Result<(), String> {
    ports(causal)?;
    definitions(causal)?;
    forced(causal)?;
    let kept = kept_junctions(causal);
    let asked: BTreeSet<ElementId> = forced_elements(&causal.graph);
    for members in parts(&causal.graph) {
        let part = CheckedPart {
            causal,
            kept: &kept,
            open: is_open(causal, &members),
            forced: members.iter().any(|m| asked.contains(m)),
        };
        members.iter().try_for_each(|&element| part.element(element))?;
    }
    Ok(())
}

/// Every port outside of the junction structure has one state, with effort and flow of its bond.
fn ports(causal: &CausalGraph) -> Result<(), String> {
    let graph = &causal.graph;
    if causal.strokes.len() != graph.bonds.len() {
        return Err("not every bond has an entry among the strokes".into());
    }
    let stated: Vec<PortRef> = causal.ports.ports.iter().map(|p| p.port).collect();
    if stated != graph.outer_ports() {
        return Err("the ports are not those of the graph, in order".into());
    }
    for state in &causal.ports.ports {
        let bond = &graph.bonds[graph.bond_of(state.port)];
        let own: BTreeSet<Symbol> = [bond.effort, bond.flow].into();
        if own != [state.input, state.output].map(|s| graph.exprs.untwinned(s)).into() {
            return Err(format!("{} does not have effort and flow of its bond", graph.port_name(state.port)));
        }
    }
    Ok(())
}

/// Definitions lead to no input, and none leads back to itself.
fn definitions(causal: &CausalGraph) -> Result<(), String> {
    let name = |s: Symbol| causal.graph.exprs.label(s);
    let of = &causal.ports.definitions;
    if let Some(state) = causal.ports.ports.iter().find(|p| p.role != Role::Redundant && of.contains_key(&p.input)) {
        return Err(format!("`{}` is given by its element and by the junctions", name(state.input)));
    }
    let mut done: BTreeMap<Symbol, bool> = BTreeMap::new();
    for &start in of.keys() {
        let mut stack = vec![start];
        while let Some(&top) = stack.last() {
            if done.insert(top, false).is_some() || of.get(&top).is_none() {
                done.insert(top, true);
                stack.pop();
                continue;
            }
            for read in of[&top].0.iter().map(|t| t.0) {
                match done.get(&read) {
                    None => stack.push(read),
                    Some(false) => return Err(format!("the definition of `{}` leads back to it", name(read))),
                    Some(true) => {}
                }
            }
        }
    }
    Ok(())
}

/// What the modeller asks of strokes is drawn.
fn forced(causal: &CausalGraph) -> Result<(), String> {
    let graph = &causal.graph;
    for forced in &graph.forced_strokes {
        let asked = if forced.at_to { Stroke::To } else { Stroke::From };
        if causal.strokes[forced.bond] != asked {
            return Err(format!("the stroke of bond {} is not where it is asked for", forced.bond.index() + 1));
        }
    }
    for forced in &graph.forced_causality {
        let inertance = matches!(graph.elements[forced.port.element].kind, Kind::Inertance(_));
        if sits_at(graph, &causal.strokes, forced.port) != Some(sits_here(forced.causality, inertance)) {
            return Err(format!("{} does not have the causality asked for", graph.port_name(forced.port)));
        }
    }
    Ok(())
}

fn forced_elements(graph: &BondGraph) -> BTreeSet<ElementId> {
    let ends = |bond| [graph.bonds[bond].from.element, graph.bonds[bond].to.element];
    let strokes = graph.forced_strokes.iter().flat_map(|f| ends(f.bond));
    graph.forced_causality.iter().map(|f| f.port.element).chain(strokes).collect()
}

/// Whether something in a part is not determined, or imposed twice: then strokes need not fit everywhere. Nor need they beside
/// wide two-ports, which have many ways to give half of their variables: they are drawn as far as a search finds them.
fn is_open(causal: &CausalGraph, members: &[ElementId]) -> bool {
    let wide =
        |e: &ElementId| matches!(causal.graph.elements[*e].kind, Kind::MatrixTransformer(_) | Kind::MatrixGyrator(_));
    if members.iter().any(wide) {
        return true;
    }
    let inside = |e: ElementId| members.binary_search(&e).is_ok();
    let of_bond = |s: &Symbol| match causal.graph.variables.get(s).map(|v| v.meaning) {
        Some(Meaning::Effort(bond) | Meaning::Flow(bond)) => inside(causal.graph.bonds[bond].from.element),
        // The twin of a variable, on a bond that two elements share.
        _ => true,
    };
    causal.ports.undetermined.iter().any(of_bond)
}

/// A connected part.
struct CheckedPart<'a> {
    causal: &'a CausalGraph,
    kept: &'a BTreeSet<ElementId>,
    /// Whether something in it is not determined.
    open: bool,
    /// Whether the modeller forces a stroke in it.
    forced: bool,
}

impl CheckedPart<'_> {
    fn element(&self, element: ElementId) -> Result<(), String> {
        let graph = &self.causal.graph;
        let (name, kind) = (&graph.elements[element].name, &graph.elements[element].kind);
        let sits = |port| sits_at(graph, &self.causal.strokes, port);
        let (here, away) = around(element, graph, &sits);
        let whole = here + away == graph.elements[element].ports.len();
        if !whole && !self.open {
            return Err(format!("a bond of {name} has no stroke, and all is determined"));
        }
        if whole && !in_order(kind, here, away, self.kept.contains(&element)) {
            return Err(format!("the {} {name} has {here} strokes at it and {away} away from it", kind.word()));
        }
        let virtual_one = self.causal.ports.virtual_speeds.iter().any(|v| v.junction == element);
        if virtual_one && !self.kept.contains(&element) && !self.forced && !self.open {
            return Err(format!("{name} keeps its variable, and a bond sets it"));
        }
        (0..graph.elements[element].ports.len() as u32).try_for_each(|port| self.port(PortRef { element, port }))
    }

    /// Sources and laws have the stroke that what they impose or give asks for.
    fn port(&self, port: PortRef) -> Result<(), String> {
        let graph = &self.causal.graph;
        let kind = &graph.elements[port.element].kind;
        let Some(state) = self.causal.ports.of(port) else { return Ok(()) };
        let Some(here) = sits_at(graph, &self.causal.strokes, port) else { return Ok(()) };
        let inertance = matches!(kind, Kind::Inertance(_));
        let asked = match (imposes(graph, port), state.role) {
            (Some(effort), Role::Source | Role::Redundant) => Some(!effort),
            (_, _) if self.forced => None,
            (_, Role::Algebraic(causality)) => Some(sits_here(causality, false)),
            (_, Role::Independent) => Some(sits_here(PortCausality::Integral, inertance)),
            (_, Role::Dependent) => Some(sits_here(PortCausality::Derivative, inertance)),
            (None, _) => None,
        };
        match asked {
            Some(asked) if asked != here && !self.open => {
                Err(format!("the stroke at {} sits at the wrong end", graph.port_name(port)))
            }
            _ => Ok(()),
        }
    }
}
