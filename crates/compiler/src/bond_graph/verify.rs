//! What holds of every graph that this stage gives; a breach is our fault, not the modeller's.

use std::collections::BTreeSet;

use super::{BondGraph, HeldSignal, IntegratedSignal, Kind, Meaning, PortRef};
use crate::algebra::{Expr, Symbol};
use crate::ids::Id;

/// Checks the invariants of a [`BondGraph`].
///
/// # Errors
/// The first breach, in words for us.
pub fn verify(graph: &BondGraph) -> Result<(), String> {
    bonds(graph)?;
    elements(graph)?;
    junctions(graph)?;
    names(graph)?;
    symbols(graph)
}

fn bonds(graph: &BondGraph) -> Result<(), String> {
    for (id, bond) in graph.bonds.iter() {
        let number = id.index() + 1;
        if bond.from == bond.to {
            return Err(format!("bond {number} joins a port to itself"));
        }
        for (end, inward) in [(bond.from, false), (bond.to, true)] {
            let port = graph.elements.get(end.element).and_then(|e| e.ports.get(end.port as usize));
            match port {
                Some(port) if port.bond == id && port.inward == inward => {}
                _ => return Err(format!("bond {number} ends at a port that does not know it")),
            }
        }
        let (effort, flow) = (graph.variables.get(&bond.effort), graph.variables.get(&bond.flow));
        let fits = effort.is_some_and(|v| v.meaning == Meaning::Effort(id))
            && flow.is_some_and(|v| v.meaning == Meaning::Flow(id));
        if !fits {
            return Err(format!("the variables of bond {number} mean something else"));
        }
    }
    Ok(())
}

fn elements(graph: &BondGraph) -> Result<(), String> {
    for (id, element) in graph.elements.iter() {
        let name = &element.name;
        for (i, port) in element.ports.iter().enumerate() {
            let at = PortRef { element: id, port: i as u32 };
            let bond = graph.bonds.get(port.bond).ok_or(format!("`{name}` has a port without a bond"))?;
            if at != if port.inward { bond.to } else { bond.from } {
                return Err(format!("port {i} of `{name}` is not an end of its bond"));
            }
        }
        let ports = element.ports.len();
        let fine = match &element.kind {
            Kind::Zero | Kind::One => ports > 0,
            Kind::Transformer { .. } | Kind::Gyrator { .. } => {
                ports == 2 && element.ports[0].inward && !element.ports[1].inward
            }
            Kind::MatrixTransformer(m) | Kind::MatrixGyrator(m) => {
                let (inputs, outputs) = element.ports.split_at(m.columns.min(ports));
                ports == m.columns + m.rows && inputs.iter().all(|p| p.inward) && !outputs.iter().any(|p| p.inward)
            }
            Kind::Inertance(s) | Kind::Compliance(s) => {
                ports > 0 && s.laws.len() == ports && s.stored.len() == ports && element.ports.iter().all(|p| p.inward)
            }
            Kind::Resistor(laws) | Kind::SkewGyrator(laws) => {
                ports > 0 && laws.len() == ports && element.ports.iter().all(|p| p.inward)
            }
            _ => ports == 1,
        };
        if !fine {
            return Err(format!("the ports of `{name}` do not fit a {}", element.kind.word()));
        }
        if let Kind::Inertance(storage) | Kind::Compliance(storage) = &element.kind {
            let stored = &storage.stored;
            for (i, symbol) in stored.iter().enumerate() {
                let at = PortRef { element: id, port: i as u32 };
                if graph.variables.get(symbol).is_none_or(|v| v.meaning != Meaning::Stored(at)) {
                    return Err(format!("what port {i} of `{name}` stores means something else"));
                }
            }
        }
    }
    Ok(())
}

/// The bond that stands for a junction is one of its own, and stands for no other that it joins to this one unless these
/// two touch nothing else.
fn junctions(graph: &BondGraph) -> Result<(), String> {
    for (&junction, &bond) in graph.common.iter() {
        let element = &graph.elements[junction];
        let name = &element.name;
        if !element.ports.iter().any(|p| p.bond == bond) {
            return Err(format!("`{name}` is stood for by a bond of others"));
        }
        let other = |bond| graph.far_end(bond, junction);
        let alike = |e| std::mem::discriminant(&graph.elements[e].kind) == std::mem::discriminant(&element.kind);
        let shared = other(bond) != junction && alike(other(bond)) && graph.common.get(&other(bond)) == Some(&bond);
        if shared && element.ports.iter().any(|p| !alike(other(p.bond))) {
            return Err(format!("one bond stands for `{name}` and for its neighbour"));
        }
    }
    Ok(())
}

/// Elements have names of their own, the ports of one element too, and so have bonds and signals.
fn names(graph: &BondGraph) -> Result<(), String> {
    let mut seen = BTreeSet::new();
    let elements = graph.elements.values().map(|e| &e.name);
    let bonds = graph.bonds.values().map(|b| &b.name).filter(|n| !n.is_empty());
    if let Some(name) = elements.chain(bonds).find(|n| !seen.insert(*n)) {
        return Err(format!("two elements or bonds are called `{name}`"));
    }
    for element in graph.elements.values().filter(|e| !matches!(e.kind, Kind::Zero | Kind::One)) {
        let mut seen = BTreeSet::new();
        if element.ports.iter().any(|p| !seen.insert(&p.name)) {
            return Err(format!("two ports of `{}` have one name", element.name));
        }
    }
    let mut seen = BTreeSet::new();
    let parameters = graph.parameters.values().map(|p| &p.name);
    let signals = graph.signals.values().map(|s| &s.name).chain(graph.held.values().map(|h| &h.name));
    let inputs = graph.inputs.values().map(|i| &i.name);
    match parameters.chain(signals).chain(inputs).find(|n| !seen.insert(*n)) {
        Some(name) => Err(format!("two parameters or signals are called `{name}`")),
        None => Ok(()),
    }
}

fn symbols(graph: &BondGraph) -> Result<(), String> {
    let known = |symbol: Symbol| graph.variables.contains_key(&symbol);
    let check = |e: Expr, what: &dyn Fn() -> String| match graph.exprs.symbols_of(e).into_iter().find(|s| !known(*s)) {
        Some(symbol) => Err(format!("{} reads `{}`, which means nothing", what(), graph.exprs.name(symbol))),
        None => Ok(()),
    };
    for e in graph.expressions() {
        check(e, &|| "an expression".to_string())?;
    }
    for p in graph.parameters.values() {
        check(p.value, &|| format!("parameter `{}`", p.name))?;
    }
    for HeldSignal { time, name, .. } in graph.held.values() {
        check(*time, &|| format!("`{name}`"))?;
    }
    for IntegratedSignal { symbol, name, .. } in graph.signals.values() {
        if !known(*symbol) {
            return Err(format!("signal `{name}` has no symbol"));
        }
    }
    Ok(())
}
