//! Laws of causal paths on small made graphs and on random ones.

use crate::support;

use std::collections::BTreeSet;

use halfarrow_compiler::algebra::{Expr, Exprs, Symbol};
use halfarrow_compiler::bond_graph::{BondGraph, ElementId, Kind, Preference, ResistorLaw};
use halfarrow_compiler::causal_graph::{
    CausalGraph, Ports, Stroke, as_drawn, assign_causality, by_hand, kept_junctions, verify,
};
use halfarrow_compiler::causal_paths::{CausalPaths, Count, counts, find_paths, invert};
use halfarrow_compiler::ids::Table;
use proptest::prelude::*;
use support::formula::formula;
use support::paper::bond_graph;
use support::sketch::sketch;

fn value(paths: &CausalPaths, e: Expr) -> f64 {
    let exprs = &paths.exprs;
    let of = |symbol: Symbol| exprs.facts(symbol).given.and_then(|given| exprs.given_value(given)).unwrap_or(0.7);
    exprs.eval(e, &mut { of })
}

fn assigned(bonds: &str) -> CausalGraph {
    assign_causality(&bond_graph(&sketch(bonds, |at| 0.5 + at as f64))).expect("a causality exists")
}

fn drawn(graph: BondGraph, strokes: &str) -> CausalGraph {
    let strokes: Table<_, _> = strokes.chars().map(|c| if c == 't' { Stroke::To } else { Stroke::From }).collect();
    CausalGraph { graph, strokes, ports: Ports::default() }
}

fn element(graph: &BondGraph, name: &str) -> ElementId {
    graph.elements.iter().find(|(_, e)| e.name == name).expect("known element").0
}

fn classes(paths: &CausalPaths) -> Vec<u8> {
    paths.paths.iter().map(|path| path.class).collect()
}

/// `Se>1; 1>R1; 1>R2`, in which one resistor gives the flow, with the laws replaced.
fn two_resistors(laws: impl Fn(&mut Exprs, [Symbol; 4]) -> [ResistorLaw; 2]) -> CausalPaths {
    let mut graph = bond_graph(&sketch("Se>1; 1>R1; 1>R2", |_| 2.0));
    let (first, second) = (element(&graph, "R1"), element(&graph, "R2"));
    let ends = [graph.elements[first].ports[0].bond, graph.elements[second].ports[0].bond];
    let [a, b] = ends.map(|bond| (graph.bonds[bond].effort, graph.bonds[bond].flow));
    let [one, two] = laws(&mut graph.exprs, [a.0, a.1, b.0, b.1]);
    graph.elements[first].kind = Kind::Resistor(vec![one]);
    graph.elements[second].kind = Kind::Resistor(vec![two]);
    find_paths(&drawn(graph, "ttf"))
}

fn assert_gain(paths: &CausalPaths, gain: &str) {
    assert_eq!(classes(paths), [2]);
    let mut exprs = paths.exprs.clone();
    let expected = formula(gain, &mut exprs);
    let difference = exprs.sub(paths.paths[0].gain, expected);
    assert!(exprs.is_zero(difference), "{:?} is not {gain}", paths.paths[0]);
}

#[test]
fn a_nonlinear_law_has_its_local_gain() {
    let paths = two_resistors(|x, [_, f1, _, f2]| {
        let cubed = formula("r2*b3.f**3", x);
        assert_eq!(x.name(f2), "b3.f");
        let r1 = formula("r1", x);
        let flow = x.sym(f1);
        [ResistorLaw::Resistive(x.mul(&[r1, flow])), ResistorLaw::Resistive(cubed)]
    });
    assert_gain(&paths, "-3*r2*b3.f**2/r1");
}

#[test]
fn implicit_laws_and_laws_met_backwards_have_gains() {
    let paths = two_resistors(|x, _| {
        let conductive = formula("b3.e/r2", x);
        let implicit = formula("b2.e - r1*b2.f - b2.f**3", x);
        [ResistorLaw::Implicit(implicit), ResistorLaw::Conductive(conductive)]
    });
    assert_gain(&paths, "-r2/(r1 + 3*b2.f**2)");
}

#[test]
fn a_law_that_reads_another_element_makes_a_path_of_class_2() {
    // The resistance of R1 grows with the effort of R2, which follows from the flow that R1 gives.
    let mut graph = bond_graph(&sketch("Se>1; 1>R1; 1>GY; GY>R2", |_| 2.0));
    let law = formula("r1*b2.f + b4.e", &mut graph.exprs);
    let at = element(&graph, "R1");
    graph.elements[at].kind = Kind::Resistor(vec![ResistorLaw::Resistive(law)]);
    // R1 gives the flow, and so does R2 behind the gyrator.
    let paths = find_paths(&drawn(graph, "ttft"));
    let read = paths.paths.iter().find(|path| path.elements == [at]).expect("the path of what is read");
    assert_eq!((read.class, read.breaks.is_empty()), (2, false));
}

#[test]
fn a_source_that_reads_what_it_drives_is_an_algebraic_cycle() {
    let mut graph = bond_graph(&sketch("Se>1; 1>R; 1>I", |_| 2.0));
    let value = formula("-3*b2.e", &mut graph.exprs);
    let at = element(&graph, "Se");
    graph.elements[at].kind = Kind::EffortSource { value };
    // All integral: the resistor's effort follows from the flow of I, so there is no cycle.
    assert!(find_paths(&drawn(graph.clone(), "tft")).paths.is_empty());
    // A source that reads the effort of I reads what itself drives.
    let value = formula("-3*b3.e", &mut graph.exprs);
    graph.elements[at].kind = Kind::EffortSource { value };
    let paths = find_paths(&drawn(graph, "tft"));
    assert_eq!(classes(&paths), [2]);
    assert_eq!(value_of_gain(&paths), -3.0);
    assert_eq!(paths.components[0].determinant.map(|d| self::value(&paths, d)), Some(4.0));
}

fn value_of_gain(paths: &CausalPaths) -> f64 {
    value(paths, paths.paths[0].gain)
}

#[test]
fn the_ports_of_a_resistive_field_are_joined_by_paths() {
    let mut graph = bond_graph(&sketch("Se>1; 1>R1; 1>R2; 1>I", |_| 2.0));
    let laws = [formula("3*b2.f + 5*b3.f", &mut graph.exprs), formula("5*b2.f + 7*b3.f", &mut graph.exprs)];
    let (first, second) = (element(&graph, "R1"), element(&graph, "R2"));
    // Both ports at R1; R2 is left without a port and without a part in anything.
    let moved = graph.elements[second].ports.remove(0);
    let bond = moved.bond;
    graph.elements[first].ports.push(moved);
    graph.bonds[bond].to = halfarrow_compiler::bond_graph::PortRef { element: first, port: 1 };
    graph.elements[first].kind = Kind::Resistor(laws.map(ResistorLaw::Resistive).to_vec());
    graph.elements[second].kind = Kind::Zero;
    // I gives the flow: both ports are resistive, nothing closes.
    assert!(find_paths(&drawn(graph.clone(), "tfft")).paths.is_empty());
    // The second port gives the flow of all, I is derivative: a cycle inside the field, and one along the junction.
    let paths = find_paths(&drawn(graph, "tftf"));
    assert!(!paths.paths.is_empty());
    assert!(paths.paths.iter().all(|path| path.elements == [first] && path.class == 2));
}

#[test]
fn touching_cycles_of_gain_one_half_are_singular() {
    let bonds = "Se>1a; 1a>C1; 1a>0s; 0s>I1; 1a>0u; 0u>I2; 1a>0w; 0w>I3; 0u>TFu; TFu>1b; 1b>C2; 0w>TFw; TFw>1c; \
                 1c>C3; 0s>1b; 0s>1c";
    let mut graph = bond_graph(&sketch(bonds, |_| 2.0));
    for name in ["TFu", "TFw"] {
        let at = element(&graph, name);
        let half = formula("1/2", &mut graph.exprs);
        graph.elements[at].kind = Kind::Transformer { modulus: half };
    }
    // All storages integral: 1a sets the effort of 0s, which runs on to 1b and 1c and from there back to 1a.
    let paths = find_paths(&drawn(graph, "tfttftftfffffftt"));
    assert_eq!(classes(&paths), [4, 4]);
    assert!(paths.paths.iter().all(|path| value(&paths, path.gain) == 0.5));
    assert_eq!(paths.components.len(), 2);
    for component in &paths.components {
        assert_eq!(component.determinant.map(|d| value(&paths, d)), Some(0.0));
        assert!(component.singular && component.breaks.len() == 1);
    }
}

#[test]
fn a_resistor_network_of_many_sections_is_broken_with_a_bound() {
    let sections = 200;
    let mut bonds = String::from("Se>1a0");
    for i in 0..sections {
        bonds += &format!("; 1a{i}>Rs{i}; 1a{i}>0b{i}; 0b{i}>Rp{i}; 0b{i}>1a{}", i + 1);
    }
    bonds += &format!("; 1a{sections}>I");
    let causal = assigned(&bonds);
    let paths = find_paths(&causal);
    let breaks: usize = paths.components.iter().map(|c| c.breaks.len()).sum();
    let bound: usize = paths.components.iter().map(|c| c.lower_bound).sum();
    assert!(bound <= breaks);
    assert!(!paths.components.iter().any(|c| c.singular));
    for symbol in paths.components.iter().flat_map(|c| &c.breaks) {
        assert!(paths.paths.iter().any(|path| path.breaks.contains(symbol)));
    }
}

#[test]
fn a_ladder_without_cycles_has_no_path_and_counts_at_once() {
    let sections = 400;
    let mut bonds = String::from("Se>1a0");
    for i in 0..sections {
        bonds += &format!("; 1a{i}>Rs{i}; 1a{i}>0b{i}; 0b{i}>C{i}; 0b{i}>1a{}", i + 1);
    }
    bonds += &format!("; 1a{sections}>I");
    let graph = bond_graph(&sketch(&bonds, |_| 2.0));
    let causal = drawn(graph, &format!("t{}t", "tfft".repeat(sections)));
    let paths = find_paths(&causal);
    let counts = counts(&causal, &paths);
    let ode = Count { differential: sections + 1, algebraic: 0 };
    assert_eq!((counts.break_form, counts.inverted), (ode, ode));
    assert!(paths.complete && paths.paths.is_empty() && paths.components.is_empty());
}

/// Bonds of a random graph: a tree of junctions with some rings, transformers and gyrators, and elements at them.
fn random_graph() -> impl Strategy<Value = String> {
    let junctions = 2usize..7;
    junctions.prop_flat_map(|n| {
        let parents = proptest::collection::vec((0usize..100, 0u8..6), n - 1);
        let rings = proptest::collection::vec((0..n, 0..n, 0u8..6), 0..3);
        let elements = proptest::collection::vec((0..n, 0u8..9), 2..7);
        (Just(n), proptest::collection::vec(any::<bool>(), n), parents, rings, elements).prop_map(written)
    })
}

type Sketch = (usize, Vec<bool>, Vec<(usize, u8)>, Vec<(usize, usize, u8)>, Vec<(usize, u8)>);

fn written((_, zero, parents, rings, elements): Sketch) -> String {
    let name = |i: usize| format!("{}j{i}", if zero[i] { "0" } else { "1" });
    let mut bonds = Vec::new();
    let mut join = |from: String, to: String, way: u8, number: usize| match way {
        0 => bonds.extend([format!("{from}>TF{number}"), format!("TF{number}>{to}")]),
        1 => bonds.extend([format!("{from}>GY{number}"), format!("GY{number}>{to}")]),
        2 => bonds.push(format!("{to}>{from}")),
        _ => bonds.push(format!("{from}>{to}")),
    };
    for (i, (parent, way)) in parents.iter().enumerate() {
        join(name(parent % (i + 1)), name(i + 1), *way, i);
    }
    for (i, (from, to, way)) in rings.iter().enumerate().filter(|(_, (from, to, _))| from != to) {
        join(name(*from), name(*to), *way, 50 + i);
    }
    for (i, (at, what)) in elements.iter().enumerate() {
        bonds.push(match what {
            0 => format!("Se{i}>{}", name(*at)),
            1 => format!("Sf{i}>{}", name(*at)),
            2 | 3 => format!("{}>C{i}", name(*at)),
            4 | 5 => format!("{}>I{i}", name(*at)),
            _ => format!("{}>R{i}", name(*at)),
        });
    }
    bonds.join("; ")
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn random_graphs_obey_the_laws_of_causal_paths(bonds in random_graph()) {
        let graph = bond_graph(&sketch(&bonds, |at| 0.6 + 0.37 * at as f64));
        let Ok(causal) = assign_causality(&graph) else { return Ok(()) };
        let paths = find_paths(&causal);
        let breaks: BTreeSet<Symbol> = paths.components.iter().flat_map(|c| c.breaks.clone()).collect();
        for path in paths.paths.iter().filter(|path| path.class > 1) {
            prop_assert!(path.signals.iter().any(|(_, symbol)| breaks.contains(symbol)), "{bonds}");
            prop_assert!(!path.breaks.is_empty() && path.component.is_some());
        }
        for symbol in &breaks {
            prop_assert!(paths.paths.iter().any(|path| path.breaks.contains(symbol)), "{bonds}");
        }
        // Class 3: the two turns have opposite gains.
        let class_3 = paths.paths.iter().filter(|path| path.class == 3).map(|path| value(&paths, path.gain));
        if paths.complete {
            prop_assert!(class_3.sum::<f64>().abs() < 1e-9, "{bonds}");
        }
        let counted = counts(&causal, &paths);
        prop_assert!(counted.inverted.differential <= counted.break_form.differential);
        prop_assert_eq!(counted.break_form.algebraic, paths.dependent.len() + breaks.len());
    }

    #[test]
    fn strokes_obey_their_rules_where_junctions_are_asked_to_keep_their_variables(
        bonds in random_graph(),
        asked in proptest::collection::vec(0usize..8, 1..4),
    ) {
        let mut graph = bond_graph(&sketch(&bonds, |at| 0.6 + 0.37 * at as f64));
        let junctions: Vec<ElementId> =
            graph.elements.iter().filter(|(_, e)| matches!(e.kind, Kind::Zero | Kind::One)).map(|(id, _)| id).collect();
        for at in asked {
            let element = &graph.elements[junctions[at % junctions.len()]];
            let bond = &graph.bonds[element.ports[0].bond];
            let symbol = if matches!(element.kind, Kind::Zero) { bond.effort } else { bond.flow };
            graph.preferences.push(Preference { name: element.name.clone(), symbol, span: element.span });
        }
        let Ok(causal) = assign_causality(&graph) else { return Ok(()) };
        prop_assert_eq!(verify(&causal), Ok(()), "{}", bonds);
        let hand = CausalGraph { strokes: by_hand(&causal), ..causal.clone() };
        prop_assert!(hand.graph.elements.ids().all(|e| !kept_junctions(&hand).contains(&e)) || hand.strokes == causal.strokes);
        // What the strokes say of the ports is what elimination has found.
        let drawn = as_drawn(&causal, &causal.strokes);
        for state in &drawn.ports.ports {
            prop_assert_eq!(causal.ports.of(state.port).map(|p| p.role), Some(state.role), "{}", bonds);
        }
    }

    #[test]
    fn inversion_keeps_every_junction_in_order_and_removes_breaks(bonds in random_graph()) {
        let graph = bond_graph(&sketch(&bonds, |at| 0.6 + 0.37 * at as f64));
        let Ok(causal) = assign_causality(&graph) else { return Ok(()) };
        let before: usize = find_paths(&causal).components.iter().map(|c| c.breaks.len()).sum();
        let turned = CausalGraph { strokes: invert(&causal).strokes, ..causal };
        let after: usize = find_paths(&turned).components.iter().map(|c| c.breaks.len()).sum();
        prop_assert!(after <= before, "{bonds}");
        for element in turned.graph.elements.values() {
            let drawn = element.ports.iter().filter(|port| turned.strokes[port.bond] != Stroke::Undetermined);
            let into = drawn.clone().filter(|port| (turned.strokes[port.bond] == Stroke::To) == port.inward).count();
            let all = drawn.count() == element.ports.len();
            match element.kind {
                Kind::Zero if all => prop_assert_eq!(into, 1),
                Kind::One if all => prop_assert_eq!(into, element.ports.len() - 1),
                Kind::Transformer { .. } if all => prop_assert_eq!(into, 1),
                Kind::Gyrator { .. } if all => prop_assert_ne!(into, 1),
                _ => {}
            }
        }
    }
}
