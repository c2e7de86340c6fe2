//! From a causal graph and its paths to the figure that is drawn.

use std::collections::BTreeSet;

use halfarrow_compiler::algebra::{Expr, PlainNames, unicode};
use halfarrow_compiler::bond_graph::{BondGraph, Element, ElementId, Kind, Meaning, PortRef, SetValuedLaw};
use halfarrow_compiler::causal_graph::{CausalGraph, Stroke, kept_junctions};
use halfarrow_compiler::causal_paths::{CausalPaths, Path};
use halfarrow_compiler::ids::Id;

use crate::figure::{Figure, Form, Glyph, Line, Loop};
use crate::symbol::Symbol;
use crate::text::{typeset, wrap};
use crate::{DrawOptions, DrawnPaths};

/// Longest line of a law in characters, and most lines; longer laws stand in the legend.
const LAW: usize = 30;
const LINES: usize = 4;

/// What is drawn of a causal graph.
pub fn figure(causal: &CausalGraph, paths: &CausalPaths, options: &DrawOptions) -> Figure {
    let graph = &causal.graph;
    let derivative: BTreeSet<ElementId> = paths.dependent.iter().map(|p| p.element).collect();
    let mut laws = Vec::new();
    let kept = kept_junctions(causal);
    let glyph = |(id, element)| Glyph {
        kept: kept.contains(&id),
        ..glyph(graph, element, derivative.contains(&id), options.laws, &mut laws)
    };
    let glyphs = graph.elements.iter().map(glyph).collect();
    let (loops, note) = loops(graph, paths, &options.paths);
    Figure {
        title: graph.name.clone(),
        doc: graph.doc.clone(),
        glyphs,
        bonds: graph.bonds.ids().map(|id| line(causal, id)).collect(),
        loops,
        laws,
        note,
    }
}

/// The number of causal paths that can be drawn; those along the same bonds are one.
pub fn path_count(paths: &CausalPaths) -> usize {
    courses(paths).len()
}

fn glyph(graph: &BondGraph, element: &Element, derivative: bool, law: bool, long: &mut Vec<String>) -> Glyph {
    let branch = set_valued(graph, element);
    let kind = branch.map_or_else(|| kind_word(graph, &element.kind), |law| law.word.to_string());
    let text = if law { typeset(&element.label) } else { String::new() };
    let mut law = wrap(&text, LAW);
    let own = &element.name;
    let name = branch.map_or_else(|| own.clone(), |law| format!("{own} ({})", law.branch().name));
    if law.len() > LINES {
        long.push(format!("({})  {name}:  {text}", long.len() + 1));
        law = vec![format!("law ({})", long.len())];
    }
    let (name, law) = match &law[..] {
        [only] if name == *only => (name, Vec::new()),
        [only] if name == kind && !element.kind.is_inner() => (only.clone(), Vec::new()),
        _ => (name, law),
    };
    let value = if element.label.is_empty() { String::new() } else { format!(" ({})", element.label) };
    let causality = if derivative { ", derivative causality" } else { "" };
    let word = branch.map_or_else(|| element.kind.word(), |law| law.word);
    let tip = format!("{word}:{}{value}{causality}", element.name);
    let form = if branch.is_some() { Form::OnePort } else { form(element) };
    let symbol = Symbol::of(graph, element).filter(|_| form != Form::Field);
    Glyph { symbol, kind, name, law, tip, form, derivative, kept: false }
}

/// The set-valued law of an element that stands in the text, if it has one.
fn set_valued<'g>(graph: &'g BondGraph, element: &Element) -> Option<&'g SetValuedLaw> {
    let own = |law: &&SetValuedLaw| std::ptr::eq(&graph.elements[law.element], element);
    graph.set_valued.iter().find(own).filter(|law| law.constraint.is_none())
}

fn form(element: &Element) -> Form {
    match element.kind {
        Kind::Zero | Kind::One => Form::Junction,
        Kind::Transformer { .. } | Kind::Gyrator { .. } => Form::TwoPort,
        Kind::MatrixTransformer(_) | Kind::MatrixGyrator(_) => Form::TwoPort,
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
        Kind::EffortSource { value } | Kind::FlowSource { value } => follows(value, &outside),
        _ => kind.moduli().into_iter().any(|modulus| follows(modulus, &|m| matches!(m, Meaning::Parameter(_)))),
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
        number: id.index() + 1,
        ends: [bond.from.element.index(), bond.to.element.index()],
        ports: [port(bond.from), port(bond.to)],
        stroke: match causal.strokes[id] {
            Stroke::From => Some(0),
            Stroke::To => Some(1),
            Stroke::Undetermined => None,
        },
        name: bond.name.clone(),
        width: 1,
        mixed: false,
    }
}

/// Paths along the same bonds, which are drawn as one.
struct Course {
    class: u8,
    elements: Vec<ElementId>,
    bonds: Vec<usize>,
    gains: Vec<String>,
}

/// The paths to draw, and what is to be said about the others.
fn loops(graph: &BondGraph, paths: &CausalPaths, wanted: &DrawnPaths) -> (Vec<Loop>, String) {
    let all: Vec<Loop> = courses(paths).iter().enumerate().map(|(i, c)| legend(graph, c, i + 1)).collect();
    let count = all.len();
    let most = match wanted {
        DrawnPaths::First(most) => *most,
        DrawnPaths::Numbers(numbers) => {
            return (all.into_iter().filter(|l| numbers.contains(&l.number)).collect(), String::new());
        }
    };
    let drawn = all.into_iter().take(most).collect();
    let note = match (count.saturating_sub(most), paths.complete) {
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

fn legend(graph: &BondGraph, course: &Course, number: usize) -> Loop {
    let names: Vec<&str> = course.elements.iter().map(|&e| graph.elements[e].name.as_str()).collect();
    let text = format!("{},  gain {}", names.join(" – "), gains(&course.gains));
    Loop { number, class: course.class, bonds: course.bonds.clone(), text }
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
