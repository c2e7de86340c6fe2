//! Makes a graph that fails small.

use crate::check::{Fault, Seen, check};
use crate::graph::{Graph, Kind, Modulus, Number, Resisting, Signal};

/// The smallest graph found that fails in the same way.
pub fn shrink(mut graph: Graph, mut fault: Fault, seed: u64) -> (Graph, Fault) {
    loop {
        let smaller = candidates(&graph).into_iter().find_map(|candidate| {
            let found = check(&candidate, seed, &mut Seen::default()).err()?;
            (found.what == fault.what).then_some((candidate, found))
        });
        match smaller {
            Some(found) => (graph, fault) = found,
            None => return (graph, fault),
        }
    }
}

fn candidates(graph: &Graph) -> Vec<Graph> {
    let mut all: Vec<Graph> = (0..graph.bonds.len()).map(|b| graph.without(vec![b])).collect();
    all.extend((0..graph.nodes.len()).filter_map(|n| bypass(graph, n)));
    if !graph.preferred.is_empty() {
        all.push(Graph { preferred: Vec::new(), ..graph.clone() });
    }
    for n in (0..graph.nodes.len()).filter(|&n| graph.is_used(n)) {
        for kind in simpler(graph.nodes[n].kind) {
            let mut next = graph.clone();
            next.nodes[n].kind = kind;
            all.push(next);
        }
        if graph.nodes[n].start.is_some() {
            let mut next = graph.clone();
            next.nodes[n].start = None;
            all.push(next);
        }
    }
    all.retain(|g| g.is_whole() && g != graph);
    all
}

/// The graph without a node that has one bond in and one out: the two become one.
fn bypass(graph: &Graph, node: usize) -> Option<Graph> {
    let at = graph.bonds_at(node);
    let [(a, _), (b, _)] = at[..] else { return None };
    let (input, output) = match (at[0].1, at[1].1) {
        (true, false) => (a, b),
        (false, true) => (b, a),
        _ => return None,
    };
    let (from, to) = (graph.bonds[input].from, graph.bonds[output].to);
    if from == to {
        return None;
    }
    let mut next = graph.clone();
    next.bonds[input].to = to;
    next.bonds.remove(output);
    Some(next)
}

fn simpler(kind: Kind) -> Vec<Kind> {
    let one = Number { top: 1, bottom: 1, declared: false };
    let zero = Number { top: 0, bottom: 1, declared: false };
    let plain = |number: Number| {
        let undeclared = Number { declared: false, ..number };
        [one, undeclared].into_iter().filter(move |&n| n != number && number != one)
    };
    match kind {
        Kind::Transformer(Modulus::Constant(m)) => plain(m).map(|m| Kind::Transformer(Modulus::Constant(m))).collect(),
        Kind::Gyrator(Modulus::Constant(m)) => plain(m).map(|m| Kind::Gyrator(Modulus::Constant(m))).collect(),
        Kind::Transformer(_) => vec![Kind::Transformer(Modulus::Constant(one))],
        Kind::Gyrator(_) => vec![Kind::Gyrator(Modulus::Constant(one))],
        Kind::Effort(s) if s != Signal::Waving(zero, zero) => vec![Kind::Effort(Signal::Waving(zero, zero))],
        Kind::Flow(s) if s != Signal::Waving(zero, zero) => vec![Kind::Flow(Signal::Waving(zero, zero))],
        Kind::Inertance(s) if s.cubic.is_some() => vec![Kind::Inertance(crate::graph::Storing { cubic: None, ..s })],
        Kind::Compliance(s) if s.cubic.is_some() => vec![Kind::Compliance(crate::graph::Storing { cubic: None, ..s })],
        Kind::Inertance(s) => plain(s.size).map(|size| Kind::Inertance(crate::graph::Storing { size, ..s })).collect(),
        Kind::Compliance(s) => {
            plain(s.size).map(|size| Kind::Compliance(crate::graph::Storing { size, ..s })).collect()
        }
        Kind::Resistor(Resisting::Resistance(r)) => {
            plain(r).map(|r| Kind::Resistor(Resisting::Resistance(r))).collect()
        }
        Kind::Resistor(law) if law != Resisting::Resistance(one) => vec![Kind::Resistor(Resisting::Resistance(one))],
        _ => Vec::new(),
    }
}
