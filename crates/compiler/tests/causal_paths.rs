//! Causal paths of the worked examples of the paper: lists, classes, gains, break variables, counts.

use crate::support;

use std::collections::BTreeSet;

use halfarrow_compiler::algebra::{Expr, Exprs};
use halfarrow_compiler::bond_graph::Kind;
use halfarrow_compiler::causal_graph::{CausalGraph, assign_causality};
use halfarrow_compiler::causal_paths::{CausalPaths, Path, counts, find_paths, find_paths_capped, invert};
use serde_json::Value;
use support::formula::formula;
use support::paper::{bond_graph, causal_graph, example, examples, strokes};

fn name(value: &Value) -> &str {
    value["name"].as_str().expect("a name")
}

fn names(causal: &CausalGraph, path: &Path) -> BTreeSet<String> {
    path.elements.iter().map(|&e| causal.graph.elements[e].name.clone()).collect()
}

fn equal(exprs: &mut Exprs, a: Expr, b: Expr) -> bool {
    let difference = exprs.sub(a, b);
    exprs.is_zero(difference)
}

/// The gain, or for a loop in the junction structure that of the other turn.
fn same_gain(exprs: &mut Exprs, path: &Path, gain: &str) -> bool {
    let gain = formula(gain, exprs);
    let turned = {
        let one = exprs.int(1);
        exprs.div(one, gain)
    };
    equal(exprs, path.gain, gain) || path.class == 4 && equal(exprs, path.gain, turned)
}

/// Every expected path is found once, and nothing else.
fn assert_paths(what: &str, causal: &CausalGraph, paths: &CausalPaths, expected: &Value) {
    let mut exprs = paths.exprs.clone();
    let expected = expected.as_array().expect("a list of paths");
    let mut left: Vec<&Path> = paths.paths.iter().collect();
    for entry in expected {
        let between: BTreeSet<String> =
            entry["between"].as_array().expect("elements").iter().map(|e| e.as_str().expect("a name").into()).collect();
        let gain = entry["gain"].as_str().expect("a gain");
        let found = left.iter().position(|path| {
            u64::from(path.class) == entry["class"].as_u64().expect("a class")
                && names(causal, path) == between
                && same_gain(&mut exprs, path, gain)
        });
        let found = found.unwrap_or_else(|| panic!("{what}: no path {entry} among {:#?}", paths.paths));
        left.remove(found);
    }
    assert!(left.is_empty(), "{what}: unexpected {left:#?}");
    assert!(paths.complete);
}

fn break_count(paths: &CausalPaths) -> u64 {
    assert!(paths.components.iter().all(|c| c.exact && c.lower_bound == c.breaks.len()));
    paths.components.iter().map(|c| c.breaks.len() as u64).sum()
}

#[test]
fn the_examples_have_the_paths_of_the_paper() {
    for example in examples() {
        let causal = causal_graph(&example, strokes(&example));
        let paths = find_paths(&causal);
        assert_paths(name(&example), &causal, &paths, &example["zcp"]);
        let breaks = example["structural_breaks"].as_u64().unwrap_or(0);
        assert_eq!(break_count(&paths), breaks, "{}", name(&example));
    }
}

#[test]
fn the_inverted_examples_have_the_paths_of_the_paper() {
    for example in examples().iter().filter(|e| e["strokes_after_inversion"].is_array()) {
        let causal = causal_graph(example, "strokes_after_inversion");
        let paths = find_paths(&causal);
        assert_paths(name(example), &causal, &paths, &example["zcp_after_inversion"]);
        assert_eq!(break_count(&paths), example["structural_breaks_after"].as_u64().expect("a number"));
    }
}

#[test]
fn the_pendulum_with_multipliers_has_no_path() {
    let causal = causal_graph(&example("pendulum"), "strokes_fig23");
    let paths = find_paths(&causal);
    assert!(paths.paths.is_empty() && paths.dependent.is_empty());
    let counts = counts(&causal, &paths);
    assert_eq!((counts.break_form.differential, counts.break_form.algebraic), (3, 2));
}

#[test]
fn the_counts_are_those_of_the_paper() {
    for example in examples() {
        let causal = causal_graph(&example, strokes(&example));
        let counts = counts(&causal, &find_paths(&causal));
        let expected = |form: &str| {
            let entry = &example["counts"][form];
            (entry["differential"].as_u64().expect("a number"), entry["algebraic"].as_u64().expect("a number"))
        };
        let found =
            |count: halfarrow_compiler::causal_paths::Count| (count.differential as u64, count.algebraic as u64);
        assert_eq!(found(counts.break_form), expected("break_variable_form"), "{}", name(&example));
        assert_eq!(found(counts.inverted), expected("reduced"), "{}", name(&example));
    }
}

#[test]
fn inverting_leaves_as_many_breaks_as_in_the_paper() {
    for example in examples() {
        let causal = causal_graph(&example, strokes(&example));
        let strokes = invert(&causal).strokes;
        let turned = CausalGraph { strokes, ..causal };
        let breaks = example["breaks"]["paper_method"].as_u64().expect("a number");
        assert_eq!(break_count(&find_paths(&turned)), breaks, "{}", name(&example));
    }
}

#[test]
fn only_the_loop_of_gain_one_is_singular() {
    for example in examples() {
        let causal = causal_graph(&example, strokes(&example));
        let paths = find_paths(&causal);
        let singular = paths.components.iter().any(|c| c.singular);
        assert_eq!(singular, name(&example) == "unity_gain", "{}", name(&example));
        assert!(paths.components.iter().all(|c| c.determinant.is_some()));
    }
}

#[test]
fn break_variables_are_outputs_of_resistors_or_common_to_a_junction() {
    for example in examples() {
        let causal = causal_graph(&example, strokes(&example));
        let paths = find_paths(&causal);
        for symbol in paths.components.iter().flat_map(|c| &c.breaks) {
            let bonds = causal.graph.bonds.values();
            let bond = bonds.clone().find(|b| b.effort == *symbol || b.flow == *symbol).expect("a bond variable");
            let at_resistor = matches!(causal.graph.elements[bond.to.element].kind, Kind::Resistor(_));
            let effort = bond.effort == *symbol;
            let common = [bond.from, bond.to].iter().any(|end| {
                matches!((&causal.graph.elements[end.element].kind, effort), (Kind::Zero, true) | (Kind::One, false))
            });
            assert!(at_resistor || common, "{}: {}", name(&example), causal.graph.exprs.name(*symbol));
        }
    }
}

#[test]
fn over_the_cap_every_break_variable_keeps_a_path() {
    for example in examples() {
        let causal = causal_graph(&example, strokes(&example));
        let all = find_paths(&causal);
        let capped = find_paths_capped(&causal, all.paths.len().saturating_sub(1));
        assert_eq!(capped.complete, all.paths.is_empty());
        for symbol in all.components.iter().flat_map(|c| &c.breaks) {
            assert!(capped.paths.iter().any(|path| path.breaks.contains(symbol)));
        }
        assert!(capped.paths.len() <= all.paths.len());
        for port in &all.dependent {
            assert!(capped.paths.iter().any(|path| path.class == 1 && path.elements.contains(&port.element)));
        }
    }
}

#[test]
fn free_choice_of_resistor_causality_needs_no_more_breaks_than_the_best() {
    for example in examples().iter().filter(|e| e["structural_breaks"].is_u64()) {
        let causal = assign_causality(&bond_graph(example)).expect("a causality exists");
        let least = example["least_structural_breaks_over_resistor_choices"].as_u64().expect("a number");
        assert!(break_count(&find_paths(&causal)) <= least, "{}", name(example));
    }
}

#[test]
fn the_text_is_stable() {
    let example = example("class2");
    let causal = causal_graph(&example, strokes(&example));
    let expected = "\
causal_paths class2

paths
  class 2  R1 - R2
    gain   -R1/R2
    along  b2.e b3.e b3.f b2.f
    meets  R1 0 R2 0
    breaks b2.e

components
  4 signals, broken at b2.e
    determinant 1 + R1/R2
";
    assert_eq!(find_paths(&causal).text(&causal), expected);
}
