//! Drawings of the models: well-formed, complete, strokes and half arrows at the right ends, and as they were.
//! `UPDATE=1 cargo test -p halfarrow-draw --test models` rewrites `models/<name>/graph.svg`.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use std::path::{Path, PathBuf};

use halfarrow_compiler::ast::parse;
use halfarrow_compiler::bond_graph::{NoFiles, elaborate};
use halfarrow_compiler::causal_graph::{CausalGraph, Stroke, assign_causality};
use halfarrow_compiler::causal_paths::{CausalPaths, find_paths};
use halfarrow_compiler::diagnostic::Sources;
use halfarrow_compiler::ids::Id;
use halfarrow_draw::{DrawOptions, DrawnPaths, draw};
use roxmltree::{Document, Node};

/// The models whose drawings are kept: the worked examples, and what the README shows.
const KEPT: [&str; 14] = [
    "class2",
    "class2_class4_one_I",
    "class2_class4_one_I_variant_B",
    "class2_class4_two_I",
    "class2_class4_two_I_variant_B",
    "class3",
    "class4",
    "dc_motor_pid",
    "parallel_bonds",
    "pendulum",
    "quarter_car",
    "two_class3_C",
    "two_class3_CI",
    "unity_gain",
];

fn folder(model: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models").join(model)
}

/// A model file with its causality and paths.
fn causal(file: &Path) -> (CausalGraph, CausalPaths) {
    let text = std::fs::read_to_string(file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    let mut sources = Sources::new();
    let id = sources.add("model.bond", text.as_str());
    let elaborated = elaborate(parse(&text, id).ast, sources, &NoFiles, &[]);
    let graph = elaborated.graph.unwrap_or_else(|| panic!("{}: {:?}", file.display(), elaborated.diagnostics));
    let causal = assign_causality(&graph).unwrap_or_else(|e| panic!("{}: {e:?}", file.display()));
    let paths = find_paths(&causal);
    (causal, paths)
}

fn class<'a>(node: &Node<'a, 'a>, name: &str) -> bool {
    node.attribute("class") == Some(name)
}

/// The points of path data made of absolute moves and lines.
fn points(path: &Node) -> Vec<[f64; 2]> {
    let data = path.attribute("d").unwrap_or_default();
    let pairs = data.split(['M', 'L', 'Q']).filter(|p| !p.is_empty());
    let number = |x: &str| x.parse::<f64>().unwrap_or_else(|_| panic!("{data}"));
    pairs.map(|p| p.split_once(' ').map(|(x, y)| [number(x), number(y)]).unwrap_or_else(|| panic!("{data}"))).collect()
}

fn near(a: [f64; 2], b: [f64; 2], most: f64) -> bool {
    (a[0] - b[0]).hypot(a[1] - b[1]) <= most
}

/// Checks one bond: stroke in the middle of the right end, barb at the end of the half arrow.
fn check_bond(causal: &CausalGraph, node: &Node) {
    let number: usize = node.attribute("data-bond").and_then(|n| n.parse().ok()).expect("a number");
    let stroke = causal.strokes[Id::new(number - 1)];
    let shaft = node.children().find(|c| class(c, "shaft")).expect("a shaft");
    let mut line = points(&shaft);
    let drawn: Vec<Node> = node.children().filter(|c| class(c, "stroke")).collect();
    let end = match stroke {
        Stroke::From => 0,
        Stroke::To => 1,
        Stroke::Undetermined => {
            assert!(drawn.is_empty() && shaft.attribute("stroke-dasharray").is_some(), "bond {number} is dotted");
            return;
        }
    };
    let barb = line.pop().expect("a half arrow");
    let last = line.len() - 1;
    let (at, before) = if end == 0 { (line[0], line[1]) } else { (line[last], line[last - 1]) };
    let bar = points(&drawn[0]);
    let middle = [(bar[0][0] + bar[1][0]) / 2.0, (bar[0][1] + bar[1][1]) / 2.0];
    assert!(near(middle, at, 0.2), "the stroke of bond {number} sits at {middle:?}, not at {at:?}");
    let along = [at[0] - before[0], at[1] - before[1]];
    let across = [bar[1][0] - bar[0][0], bar[1][1] - bar[0][1]];
    let skew = (along[0] * across[0] + along[1] * across[1]).abs() / along[0].hypot(along[1]);
    assert!(skew < 0.3, "the stroke of bond {number} is perpendicular to it");
    assert!(near(barb, line[last], 11.0), "the half arrow of bond {number} is at its end");
}

fn check(svg: &str, causal: &CausalGraph) {
    let xml = Document::parse(svg).unwrap_or_else(|e| panic!("{e}"));
    let all = |name: &str| xml.descendants().filter(|n| class(n, name)).count();
    assert_eq!(all("bond"), causal.graph.bonds.len());
    assert_eq!(all("element"), causal.graph.elements.len());
    xml.descendants().filter(|n| class(n, "bond")).for_each(|n| check_bond(causal, &n));
    for (name, value) in xml.descendants().flat_map(|n| n.attributes()).map(|a| (a.name(), a.value())) {
        assert!(!value.contains("NaN") && !value.contains("inf"), "{name}=\"{value}\"");
    }
}

#[test]
fn drawings_of_the_models_are_complete_and_as_kept() {
    let mut changed = Vec::new();
    for model in KEPT {
        let (causal, paths) = causal(&folder(model).join("model.bond"));
        let svg = draw(&causal, &paths, &DrawOptions::default());
        check(&svg, &causal);
        let kept = folder(model).join("graph.svg");
        if std::env::var_os("UPDATE").is_some() {
            std::fs::write(&kept, &svg).expect("a drawing that can be written");
        } else if std::fs::read_to_string(&kept).unwrap_or_default() != svg {
            changed.push(model);
        }
    }
    assert!(changed.is_empty(), "drawings have changed (UPDATE=1 rewrites them): {changed:?}");
}

#[test]
fn the_pendulum_shows_its_paths_and_dependent_storages() {
    let (causal, paths) = causal(&folder("pendulum").join("model.bond"));
    let svg = draw(&causal, &paths, &DrawOptions::default());
    let xml = Document::parse(&svg).unwrap();
    let storages = xml.descendants().filter(|n| class(n, "element") && n.children().any(|c| class(&c, "derivative")));
    assert_eq!(storages.count(), 2, "two inertances in derivative causality");
    assert!(svg.contains("MTF") && svg.contains("−a·sin(φ)") && svg.contains("class 1"));
    let courses = xml.descendants().find(|n| class(n, "paths")).expect("coloured paths");
    assert_eq!(courses.children().filter(|n| n.is_element()).count(), 2);
    let none = draw(&causal, &paths, &DrawOptions { paths: DrawnPaths::First(0), ..DrawOptions::default() });
    assert!(none.contains("and 2 more causal paths") && !none.contains("class=\"paths\""));
}

#[test]
fn a_junction_that_keeps_its_flow_is_marked() {
    for (model, kept) in [("double_pendulum", 2), ("point_pendulum", 1), ("pendulum", 0)] {
        let (causal, paths) = causal(&folder(model).join("model.bond"));
        let svg = draw(&causal, &paths, &DrawOptions::default());
        check(&svg, &causal);
        let xml = Document::parse(&svg).unwrap();
        let rings = |name: &str| {
            let groups = xml.descendants().filter(|n| class(n, name));
            groups.flat_map(|g| g.children()).filter(|n| class(n, "kept")).count()
        };
        assert_eq!((rings("element"), rings("legend")), (kept, kept.min(1)), "{model}");
    }
}
