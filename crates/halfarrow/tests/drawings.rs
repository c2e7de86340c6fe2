//! Symbols of the fields in drawings.

use std::collections::BTreeSet;
use std::path::Path;

use halfarrow::{DrawOptions, Model};

fn here(path: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// Names of elements, without their branches, with the symbols that they are drawn with.
fn symbols(svg: &str) -> BTreeSet<(String, String)> {
    let quoted = |text: &str, key: &str| {
        let from = text.find(key)? + key.len();
        Some(text[from..].split('"').next().unwrap_or_default().to_string())
    };
    let elements = svg.split("<g class=\"element\"").skip(1);
    let name = |e: &str| Some(quoted(e, "data-name=\"")?.split(" (").next().unwrap_or_default().to_string());
    elements.filter_map(|e| Some((name(e)?, quoted(e, "data-symbol=\"")?))).collect()
}

fn drawn(file: &str, mode: &str) -> BTreeSet<(String, String)> {
    let model = Model::load(&here(file), &[]).and_then(|model| model.in_mode(&[mode.to_string()]));
    let model = model.unwrap_or_else(|e| panic!("{}", e.render(false)));
    let picture = model.draw(&DrawOptions::default()).unwrap_or_else(|e| panic!("{}", e.render(false)));
    symbols(&picture.svg)
}

fn pairs(list: &[(&str, &str)]) -> BTreeSet<(String, String)> {
    list.iter().map(|(a, b)| ((*a).to_string(), (*b).to_string())).collect()
}

#[test]
fn set_valued_laws_have_symbols_of_their_branches() {
    let file = "../draw/tests/graphs/set_valued.bond";
    let common = [("floor", "stop"), ("pad", "friction"), ("diode", "diode"), ("valve", "diode")];
    for (mode, key) in [("key=on", "closed switch"), ("key=off", "open switch")] {
        assert_eq!(drawn(file, mode), pairs(&[&common[..], &[("key", key)]].concat()));
    }
}

#[test]
fn parts_of_the_library_have_their_symbols() {
    let wanted = [
        ("d1.junction", "diode"),
        ("s1.contact", "closed switch"),
        ("m1.torque", "motor"),
        ("p1.stroke", "pump"),
        ("t1.fluid", "tank"),
        ("relief.law", "relief valve"),
        ("check.valve", "check valve"),
        ("o1.law", "orifice"),
        ("cyl.side_a", "cylinder"),
        ("stop.wall", "stop"),
        ("rub.law", "friction"),
        ("clutch.law", "clutch"),
        ("brake.law", "brake"),
    ];
    assert_eq!(drawn("tests/drawings/parts.bond", "s1.contact=on"), pairs(&wanted));
}

/// Each part that is drawn with a symbol is there, with the element that has it.
#[test]
fn symbols_belong_to_parts_that_there_are() {
    let library = here("../../library/std");
    let files = std::fs::read_dir(library).expect("the library").flatten();
    let text: String = files.map(|file| std::fs::read_to_string(file.path()).expect("a text")).collect();
    for (component, element) in halfarrow_draw::parts_with_symbols() {
        let from = text.find(&format!("component {component}(")).unwrap_or_else(|| panic!("no {component}"));
        let own = text[from..].split("\n}\n").next().unwrap_or_default();
        let declares = [format!(":{element}("), format!("constraint {element}:")];
        assert!(declares.iter().any(|d| own.contains(d)), "{component} has no {element}");
    }
}
