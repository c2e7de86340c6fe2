//! Drawings are clear: no bond through a text or a sign, no text on another, equal parts alike, what was placed stays.
#![allow(clippy::disallowed_methods, reason = "places to compare with")]

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use halfarrow_compiler::ast::parse;
use halfarrow_compiler::bond_graph::{NoFiles, elaborate};
use halfarrow_compiler::causal_graph::{CausalGraph, assign_causality};
use halfarrow_compiler::causal_paths::{CausalPaths, find_paths};
use halfarrow_compiler::diagnostic::Sources;
use halfarrow_draw::text::width;
use halfarrow_draw::{DrawOptions, DrawnPaths, draw, path_count, positions};
use roxmltree::{Document, Node};

fn here(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn read(file: &Path) -> String {
    std::fs::read_to_string(file).unwrap_or_else(|e| panic!("{}: {e}", file.display()))
}

/// A model with its causality and paths; `None` if it needs files.
fn causal(text: &str) -> Option<(CausalGraph, CausalPaths)> {
    let mut sources = Sources::new();
    let id = sources.add("model.bond", text);
    let graph = elaborate(parse(text, id).ast, sources, &NoFiles, &[]).graph?;
    let causal = assign_causality(&graph).ok()?;
    let paths = find_paths(&causal);
    Some((causal, paths))
}

fn drawn(text: &str, options: &DrawOptions) -> String {
    let (causal, paths) = causal(text).expect("a model");
    draw(&causal, &paths, options)
}

/// Left, top, right, bottom.
type Area = [f64; 4];

fn number(node: &Node, key: &str, otherwise: f64) -> f64 {
    let own = |n: Node| n.attribute(key).and_then(|v| v.parse().ok());
    node.ancestors().find_map(own).unwrap_or(otherwise)
}

/// A text and the room that it takes.
fn text(node: &Node) -> (String, Area) {
    let size = number(node, "font-size", 12.0);
    let mut wide = 0.0;
    for piece in node.descendants().filter(Node::is_text) {
        let parent = piece.parent().expect("an element");
        let bold = parent.ancestors().find_map(|n| n.attribute("font-weight")) == Some("bold");
        wide += width(piece.text().unwrap_or_default(), number(&parent, "font-size", size), bold);
    }
    wide += node.children().filter_map(|n| n.attribute("dx")?.parse::<f64>().ok()).sum::<f64>();
    let [x, y] = ["x", "y"].map(|key| number(node, key, f64::NAN));
    let left = match node.ancestors().find_map(|n| n.attribute("text-anchor")) {
        Some("middle") => x - wide / 2.0,
        Some("end") => x - wide,
        _ => x,
    };
    let whole: String = node.descendants().filter(Node::is_text).filter_map(|n| n.text()).collect();
    (whole, [left + 0.5, y - 0.72 * size + 0.5, left + wide - 0.5, y + 0.5])
}

fn meets(area: &Area, p: [f64; 2], q: [f64; 2]) -> bool {
    let (mut enter, mut exit) = (0.0_f64, 1.0_f64);
    for k in 0..2 {
        let d = q[k] - p[k];
        if d.abs() < 1e-12 {
            if p[k] <= area[k] || p[k] >= area[k + 2] {
                return false;
            }
            continue;
        }
        let [a, b] = [(area[k] - p[k]) / d, (area[k + 2] - p[k]) / d];
        (enter, exit) = (enter.max(a.min(b)), exit.min(a.max(b)));
    }
    enter < exit
}

/// The corners of a bond, without its half arrow.
fn course(bond: &Node) -> Vec<[f64; 2]> {
    let shaft = bond.children().find(|n| n.attribute("class") == Some("shaft")).expect("a shaft");
    let data = shaft.attribute("d").unwrap_or_default();
    let point = |p: &str| p.split_once(' ').and_then(|(x, y)| Some([x.parse().ok()?, y.parse().ok()?]));
    let mut points: Vec<[f64; 2]> = data.split(['M', 'L']).filter_map(point).collect();
    if shaft.attribute("stroke-dasharray").is_none() {
        points.pop();
    }
    points
}

/// Bonds through texts and signs, and texts on others.
fn faults(svg: &str) -> Vec<String> {
    let xml = Document::parse(svg).expect("XML");
    let of = |classes: &[&str]| {
        let layer = |n: &Node| n.attribute("class").is_some_and(|c| classes.contains(&c));
        xml.descendants().filter(layer).collect::<Vec<Node>>()
    };
    let layers = of(&["elements", "moduli", "junctions", "numbers"]);
    let texts: Vec<(String, Area)> =
        layers.iter().flat_map(|g| g.descendants()).filter(|n| n.has_tag_name("text")).map(|n| text(&n)).collect();
    let mut faults = Vec::new();
    for bond in of(&["bond"]) {
        let points = course(&bond);
        let hit = |(_, area): &&(String, Area)| points.windows(2).any(|w| meets(area, w[0], w[1]));
        let name = bond.attribute("data-bond").unwrap_or_default();
        faults.extend(texts.iter().filter(hit).map(|(text, _)| format!("bond {name} runs through `{text}`")));
    }
    for (i, (one, a)) in texts.iter().enumerate() {
        let over = |b: &Area| (0..2).all(|k| a[k] < b[k + 2] && b[k] < a[k + 2]);
        faults.extend(texts[..i].iter().filter(|t| over(&t.1)).map(|(other, _)| format!("`{one}` on `{other}`")));
    }
    faults
}

/// All models, and graphs that are hard to draw.
fn all() -> Vec<(String, String)> {
    let models =
        std::fs::read_dir(here("../../models")).expect("models").flatten().map(|e| e.path().join("model.bond"));
    let graphs = std::fs::read_dir(here("tests/graphs")).expect("graphs").flatten().map(|e| e.path());
    let mut files: Vec<PathBuf> = models.chain(graphs).filter(|f| f.is_file()).collect();
    files.sort();
    files.iter().map(|f| (f.display().to_string(), read(f))).collect()
}

#[test]
fn no_bond_runs_through_a_text_and_no_text_stands_on_another() {
    for (name, text) in all() {
        let Some((causal, paths)) = causal(&text) else { continue };
        let svg = draw(&causal, &paths, &DrawOptions::default());
        assert_eq!(faults(&svg), Vec::<String>::new(), "{name}");
        if causal.graph.elements.len() < 40 {
            let bare = DrawOptions { laws: false, paths: DrawnPaths::Numbers(vec![]), ..DrawOptions::default() };
            assert_eq!(faults(&draw(&causal, &paths, &bare)), Vec::<String>::new(), "{name} without laws");
        }
    }
}

#[test]
fn the_check_sees_a_bond_through_a_text() {
    let svg = drawn(&read(&here("tests/graphs/dq_motor.bond")), &DrawOptions::default());
    let moved = svg.replacen("class=\"shaft\" d=\"M", "class=\"shaft\" d=\"M0 0L900 420L", 1);
    assert!(!faults(&moved).is_empty());
}

/// The way from a node of an instance to the next one, as signs of columns and rows.
fn shape(places: &BTreeMap<String, [f64; 2]>, instance: &str) -> Vec<[i32; 2]> {
    let dotted = format!("{instance}.");
    let own: Vec<[f64; 2]> = places.iter().filter(|p| p.0.starts_with(&dotted)).map(|p| *p.1).collect();
    assert!(own.len() > 1, "{instance}");
    let sign = |x: f64| if x.abs() < 0.2 { 0 } else { x.signum() as i32 };
    own.iter().flat_map(|a| own.iter().map(move |b| [sign(b[0] - a[0]), sign(b[1] - a[1])])).collect()
}

#[test]
fn instances_of_a_component_are_drawn_alike() {
    for (file, groups) in [
        ("tests/graphs/dq_motor.bond", vec![vec!["fd", "fq"], vec!["d", "q"], vec!["driving", "driven"]]),
        ("../../models/rectifier/model.bond", vec![vec!["d1", "d2", "d3", "d4"]]),
    ] {
        let places = positions(&drawn(&read(&here(file)), &DrawOptions::default()));
        for group in groups {
            let shapes: BTreeSet<Vec<[i32; 2]>> = group.iter().map(|instance| shape(&places, instance)).collect();
            assert_eq!(shapes.len(), 1, "{file}: {group:?}");
        }
    }
}

#[test]
fn what_was_placed_stays_and_what_is_new_finds_a_place() {
    let text = read(&here("../../models/quarter_car/model.bond"));
    let before = positions(&drawn(&text, &DrawOptions::default()));
    let longer = format!(
        "{text}\n1:seat -> I:driver(80 kg)\n0:cushion -> seat\ncushion -> C:foam(k = 9e3)\n1:lift -> cushion\nSf:floor(0) -> lift\n"
    );
    let options = DrawOptions { keep: before.clone(), ..DrawOptions::default() };
    let svg = drawn(&longer, &options);
    assert_eq!(faults(&svg), Vec::<String>::new());
    let after = positions(&svg);
    assert_eq!(after.len(), before.len() + 7 - 1, "one cushion, seat, lift and three at them");
    let (first, from) = before.iter().next().expect("an element");
    let by = [0, 1].map(|k| after[first][k] - from[k]);
    for (name, place) in &before {
        assert!((0..2).all(|k| (after[name][k] - place[k] - by[k]).abs() < 0.11), "{name} has moved");
    }
    let again = drawn(&text, &DrawOptions { keep: before, ..DrawOptions::default() });
    assert_eq!(faults(&again), Vec::<String>::new());
}

#[test]
fn an_element_that_is_added_is_placed_beside_its_junction() {
    let text = read(&here("../../models/quarter_car/model.bond"));
    let before = positions(&drawn(&text, &DrawOptions::default()));
    let (causal, _) = causal(&text).expect("a model");
    let junction = causal.graph.elements.iter().find(|e| e.1.kind.word() == "1").expect("a junction").1.name.clone();
    let longer = format!("{text}\n{junction} -> R:added(3)\n");
    let svg = drawn(&longer, &DrawOptions { keep: before, ..DrawOptions::default() });
    assert_eq!(faults(&svg), Vec::<String>::new());
    let after = positions(&svg);
    let far = (0..2).map(|k| (after["added"][k] - after[&junction][k]).abs()).sum::<f64>();
    assert!(far < 330.0, "{far}");
}

#[test]
fn every_path_has_a_look_of_its_own_and_laws_stand_in_full() {
    let text = read(&here("tests/graphs/wishbone.bond"));
    let svg = drawn(&text, &DrawOptions { paths: DrawnPaths::First(20), ..DrawOptions::default() });
    let xml = Document::parse(&svg).expect("XML");
    let layer = xml.descendants().find(|n| n.attribute("class") == Some("paths")).expect("paths");
    let looks: Vec<_> = layer
        .children()
        .filter(Node::is_element)
        .map(|n| (n.attribute("stroke"), n.attribute("stroke-dasharray")))
        .collect();
    assert_eq!(looks.iter().collect::<BTreeSet<_>>().len(), looks.len(), "{looks:?}");
    assert!(looks.len() == 20 && !svg.contains('…'), "nothing is left out");
}

#[test]
fn paths_and_laws_can_be_chosen() {
    let text = read(&here("tests/graphs/wishbone.bond"));
    let (causal, paths) = causal(&text).expect("a model");
    let numbers = |svg: &str| {
        let xml = Document::parse(svg).expect("XML");
        xml.descendants().filter_map(|n| n.attribute("data-path").map(String::from)).collect::<Vec<_>>()
    };
    let chosen = DrawOptions { paths: DrawnPaths::Numbers(vec![3, 1]), laws: false, ..DrawOptions::default() };
    let svg = draw(&causal, &paths, &chosen);
    assert_eq!(numbers(&svg), ["1", "3"]);
    assert!(!svg.contains(">k = ks<") && svg.contains("spring") && path_count(&paths) == 20);
    let none = draw(&causal, &paths, &DrawOptions { paths: DrawnPaths::Numbers(vec![]), ..DrawOptions::default() });
    assert!(numbers(&none).is_empty() && !none.contains("more causal paths"));
}

#[test]
fn of_cells_alike_the_first_alone_is_drawn_where_that_is_asked_for() {
    let text = "model Row
        Se:push(1) -> 1:v[1]
        for i in 1..9 {
            if i > 1 { v[i - 1] -> 0:x[i] -> 1:v[i]
                x[i] -> C:spring[i](1) }
            v[i] -> I:body[i](1)
        }
        v[9] -> R:drag(1)
    ";
    let all = drawn(text, &DrawOptions::default());
    let few = drawn(text, &DrawOptions { first_cells: true, ..DrawOptions::default() });
    let named = |svg: &str, name: &str| svg.contains(&format!(">{name}<")) || svg.contains(&format!(": {name}<"));
    assert!(named(&all, "body[9]") && named(&all, "spring[5]"));
    for name in ["push", "v[1]", "body[1]", "x[2]", "body[2]", "drag"] {
        assert!(few.contains(name), "{name}");
    }
    assert!(!few.contains("body[3]") && !few.contains("spring[9]"));
    assert!(few.contains("x[3]") && few.contains("v[9]"), "where the graph goes on");
    assert!(few.contains("i = 2: drawn for i = 3..9 too"), "{few}");
    // Numbers of bonds are those of the graph.
    assert!(few.contains("data-bond=\"35\""), "{few}");
}
