//! From a causal graph and its paths to the figure that is drawn.

use std::collections::BTreeSet;

use halfarrow_compiler::algebra::{Expr, PlainNames, unicode};
use halfarrow_compiler::bond_graph::{BondGraph, Element, ElementId, Kind, Meaning, PortRef};
use halfarrow_compiler::causal_graph::{CausalGraph, Stroke};
use halfarrow_compiler::causal_paths::{CausalPaths, Path};
use halfarrow_compiler::ids::Id;

use crate::DrawOptions;
use crate::figure::{Figure, Form, Glyph, Line, Loop};
use crate::text::{shorten, typeset};

/// Longest law and name in characters; the whole stands in the tip.
const LAW: usize = 30;
const NAME: usize = 24;
/// Longest line of the legend.
const LEGEND: usize = 96;

/// What is drawn of a causal graph.
pub fn figure(causal: &CausalGraph, paths: &CausalPaths, options: &DrawOptions) -> Figure {
    let graph = &causal.graph;
    let derivative: BTreeSet<ElementId> = paths.dependent.iter().map(|p| p.element).collect();
    let glyph = |(id, element)| glyph(graph, element, derivative.contains(&id));
    let (loops, note) = loops(graph, paths, options.paths);
    Figure {
        title: graph.name.clone(),
        doc: shorten(&graph.doc, LEGEND),
        glyphs: graph.elements.iter().map(glyph).collect(),
        bonds: graph.bonds.ids().map(|id| line(causal, id)).collect(),
        loops,
        note,
    }
}

fn glyph(graph: &BondGraph, element: &Element, derivative: bool) -> Glyph {
    let kind = kind_word(graph, &element.kind);
    let law = shorten(&typeset(&element.label), LAW);
    let name = shorten(&element.name, NAME);
    let (name, law) = match () {
        _ if name == law => (name, String::new()),
        _ if name == kind && !law.is_empty() && !element.kind.is_inner() => (law, String::new()),
        _ => (name, law),
    };
    let value = if element.label.is_empty() { String::new() } else { format!(" ({})", element.label) };
    let causality = if derivative { ", derivative causality" } else { "" };
    let tip = format!("{}:{}{value}{causality}", element.kind.word(), element.name);
    Glyph { kind, name, law, tip, form: form(element), derivative }
}

fn form(element: &Element) -> Form {
    match element.kind {
        Kind::Zero | Kind::One => Form::Junction,
        Kind::Transformer { .. } | Kind::Gyrator { .. } => Form::TwoPort,
        _ if element.ports.len() > 1 => Form::Field,
        Kind::EffortSource { .. } | Kind::FlowSource { .. } => Form::Source,
        _ => Form::OnePort,
    }
}

/// The keyword, with the `M` of the textbooks if the value follows the state of the system.
fn kind_word(graph: &BondGraph, kind: &Kind) -> String {
    let outside = |m: Meaning| matches!(m, Meaning::Parameter(_) | Meaning::Time | Meaning::Input(_));
    let follows = |e: Expr, fixed: &dyn Fn(Meaning) -> bool| {
        let symbols = graph.exprs.symbols_of(e);
        symbols.iter().filter_map(|s| graph.variables.get(s)).any(|v| !fixed(v.meaning))
    };
    let modulated = match *kind {
        Kind::Transformer { modulus } | Kind::Gyrator { modulus } => {
            follows(modulus, &|m| matches!(m, Meaning::Parameter(_)))
        }
        Kind::EffortSource { value } | Kind::FlowSource { value } => follows(value, &outside),
        _ => false,
    };
    if modulated { format!("M{}", kind.word()) } else { kind.word().to_string() }
}

fn line(causal: &CausalGraph, id: halfarrow_compiler::bond_graph::BondId) -> Line {
    let graph = &causal.graph;
    let bond = &graph.bonds[id];
    let port = |p: PortRef| {
        let element = &graph.elements[p.element];
        let field = !element.kind.is_inner() && element.ports.len() > 1;
        if field { element.ports[p.port as usize].name.clone() } else { String::new() }
    };
    Line {
        ends: [bond.from.element.index(), bond.to.element.index()],
        ports: [port(bond.from), port(bond.to)],
        stroke: match causal.strokes[id] {
            Stroke::From => Some(0),
            Stroke::To => Some(1),
            Stroke::Undetermined => None,
        },
        name: bond.name.clone(),
    }
}

/// Paths along the same bonds, which are drawn as one.
struct Course {
    class: u8,
    elements: Vec<ElementId>,
    bonds: Vec<usize>,
    gains: Vec<String>,
}

/// The paths to draw, at most `most`, and what is to be said about the others.
fn loops(graph: &BondGraph, paths: &CausalPaths, most: usize) -> (Vec<Loop>, String) {
    let courses = courses(paths);
    let drawn = courses.iter().take(most).map(|c| legend(graph, c)).collect();
    let more = courses.len().saturating_sub(most);
    let note = match (more, paths.complete) {
        (0, true) => String::new(),
        (0, false) => "There are more causal paths; one is drawn for every break variable.".to_string(),
        (n, true) => format!("and {n} more causal paths"),
        (n, false) => format!("and at least {n} more causal paths"),
    };
    (drawn, note)
}

/// The paths by their courses, in order.
fn courses(paths: &CausalPaths) -> Vec<Course> {
    let mut courses: Vec<Course> = Vec::new();
    let mut keys: std::collections::BTreeMap<(u8, BTreeSet<ElementId>, BTreeSet<usize>), usize> = Default::default();
    for path in &paths.paths {
        let bonds = bonds_of(path);
        let gain = unicode(&paths.exprs, path.gain, &PlainNames(&paths.exprs)).replace('-', "−");
        let ends = if path.class == 4 { BTreeSet::new() } else { path.elements.iter().copied().collect() };
        let known = *keys.entry((path.class, ends, bonds.iter().copied().collect())).or_insert(courses.len());
        match courses.get_mut(known) {
            Some(course) if course.gains.contains(&gain) => {}
            Some(course) => course.gains.push(gain),
            None => {
                courses.push(Course { class: path.class, elements: path.elements.clone(), bonds, gains: vec![gain] })
            }
        }
    }
    courses
}

/// The bonds of a path in the order in which it first meets them.
fn bonds_of(path: &Path) -> Vec<usize> {
    let mut seen = BTreeSet::new();
    path.signals.iter().map(|s| s.0.index()).filter(|&b| seen.insert(b)).collect()
}

fn legend(graph: &BondGraph, course: &Course) -> Loop {
    let names: Vec<&str> = course.elements.iter().map(|&e| graph.elements[e].name.as_str()).collect();
    let text = format!("{},  gain {}", shorten(&names.join(" – "), LEGEND / 2), gains(&course.gains));
    Loop { class: course.class, bonds: course.bonds.clone(), text: shorten(&text, LEGEND) }
}

/// Gains of paths along the same bonds: `±G/R1` for a pair of opposite ones.
fn gains(gains: &[String]) -> String {
    let opposite = |a: &str, b: &str| a.strip_prefix('−') == Some(b);
    match gains {
        [a, b] if opposite(a, b) => format!("±{b}"),
        [a, b] if opposite(b, a) => format!("±{a}"),
        _ => gains.join(", "),
    }
}
