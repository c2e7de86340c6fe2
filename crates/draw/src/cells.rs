//! Repetitions with one cell for all that are alike.

use std::collections::{BTreeMap, BTreeSet};

use halfarrow_compiler::bond_graph::{BondGraph, CellId, Repetition, RepetitionId};
use halfarrow_compiler::span::Span;

use crate::figure::{Figure, Form, Glyph, Line, Loop};

/// What a cell is made of: where its elements are declared, those of repetitions within it as well.
type Make = BTreeSet<Span>;

/// The figure with the first cell alone of all that are made alike, in each repetition, and a legend which tells for
/// which others it stands. Where a bond leads to a cell that is left out stands an ellipsis.
pub fn first_cells(figure: Figure, graph: &BondGraph) -> Figure {
    let stands_for = stands_for(graph);
    let shown = |mut cell: Option<CellId>| {
        while let Some(id) = cell {
            if !stands_for.contains_key(&id) {
                return false;
            }
            cell = graph.cells[id].outer;
        }
        true
    };
    let drawn: Vec<bool> = graph.elements.values().map(|e| shown(e.cell)).collect();
    let mut legend: Vec<String> = Vec::new();
    for (id, others) in &stands_for {
        if !others.is_empty() && shown(Some(*id)) {
            legend.push(words(graph, *id, others));
        }
    }
    reduced(figure, &drawn, legend)
}

/// The first of the cells that are made alike, each with the values of the variable for which it stands besides its own.
fn stands_for(graph: &BondGraph) -> BTreeMap<CellId, Vec<i64>> {
    let mut makes: Vec<Make> = vec![Make::new(); graph.cells.len()];
    for element in graph.elements.values() {
        let mut cell = element.cell;
        while let Some(id) = cell {
            makes[id.0 as usize].insert(element.span);
            cell = graph.cells[id].outer;
        }
    }
    let mut first: BTreeMap<(RepetitionId, Option<CellId>, &Make), CellId> = BTreeMap::new();
    let mut found: BTreeMap<CellId, Vec<i64>> = BTreeMap::new();
    for (id, cell) in graph.cells.iter() {
        let alike = *first.entry((cell.repetition, cell.outer, &makes[id.0 as usize])).or_insert(id);
        let others = found.entry(alike).or_default();
        if alike != id {
            others.push(cell.value);
        }
    }
    found
}

/// `i = 2, as for i = 3..9`, with the variables around it.
fn words(graph: &BondGraph, id: CellId, others: &[i64]) -> String {
    let cell = graph.cells[id];
    let Repetition { variable, within, .. } = &graph.repetitions[cell.repetition];
    let together = others.windows(2).all(|pair| pair[1] == pair[0] + 1);
    let others = match others {
        [one] => one.to_string(),
        [first, .., last] if together => format!("{first}..{last}"),
        [first, .., last] => format!("{} between {first} and {last}", others.len()),
        [] => String::new(),
    };
    let mut around = Vec::new();
    let mut outer = cell.outer;
    while let Some(id) = outer {
        let cell = graph.cells[id];
        around.push(format!("{} = {}", graph.repetitions[cell.repetition].variable, cell.value));
        outer = cell.outer;
    }
    let around: String = around.iter().rev().map(|a| format!("{a}, ")).collect();
    let within = if within.is_empty() { String::new() } else { format!("{within}: ") };
    format!("{within}{around}{variable} = {}: drawn for {variable} = {others} too", cell.value)
}

/// The figure of what is drawn, with an ellipsis for each element at the other end of a bond.
fn reduced(figure: Figure, drawn: &[bool], legend: Vec<String>) -> Figure {
    let mut place: Vec<Option<usize>> = vec![None; drawn.len()];
    let mut glyphs: Vec<Glyph> = Vec::new();
    let mut take = |at: usize, glyph: Glyph, place: &mut Vec<Option<usize>>| {
        place[at] = Some(glyphs.len());
        glyphs.push(glyph);
    };
    for (at, glyph) in figure.glyphs.iter().enumerate().filter(|(at, _)| drawn[*at]) {
        take(at, glyph.clone(), &mut place);
    }
    let mut bonds: Vec<Line> = Vec::new();
    let mut bond_at: Vec<Option<usize>> = vec![None; figure.bonds.len()];
    for (at, bond) in figure.bonds.iter().enumerate() {
        if !bond.ends.iter().any(|end| drawn[*end]) {
            continue;
        }
        for end in bond.ends {
            if place[end].is_none() {
                take(end, ellipsis(&figure.glyphs[end]), &mut place);
            }
        }
        let [Some(from), Some(to)] = bond.ends.map(|end| place[end]) else { continue };
        bond_at[at] = Some(bonds.len());
        bonds.push(Line { ends: [from, to], ..bond.clone() });
    }
    let whole = |l: Loop| Some(Loop { bonds: l.bonds.iter().map(|b| bond_at[*b]).collect::<Option<_>>()?, ..l });
    let count = figure.loops.len();
    let loops: Vec<Loop> = figure.loops.into_iter().filter_map(whole).collect();
    let left_out = count - loops.len();
    let mut note = figure.note;
    if left_out > 0 {
        let own = format!("{left_out} causal path{} through what is not drawn", if left_out == 1 { "" } else { "s" });
        note = if note.is_empty() { own } else { format!("{note}; {own}") };
    }
    let laws = figure.laws.into_iter().chain(legend).collect();
    Figure { glyphs, bonds, loops, laws, note, title: figure.title, doc: figure.doc }
}

/// What stands where the graph goes on.
fn ellipsis(glyph: &Glyph) -> Glyph {
    let (kind, name) = ("…".to_string(), glyph.name.clone());
    let tip = format!("{}, in a cell that is not drawn", glyph.tip);
    Glyph { kind, symbol: None, name, law: Vec::new(), tip, form: Form::Junction, derivative: false, kept: false }
}
