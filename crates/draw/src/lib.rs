//! Bond graphs as pictures: half arrows, causal strokes, numbered bonds, causal paths in colour.
//!
//! [`layout`] says where everything stands, `svg` draws it. The pictures are self-contained SVG on a white ground.
#![forbid(unsafe_code)]

mod alike;
mod causal;
mod cells;
mod detour;
pub mod figure;
mod geometry;
mod kept;
mod label;
pub mod layout;
mod multibonds;
mod overlay;
mod paper;
mod route;
mod scene;
mod svg;
mod symbol;
pub mod text;

use std::collections::BTreeMap;

use causal::figure;
pub use causal::path_count;
use cells::first_cells;
pub use kept::positions;
use multibonds::joined;
pub use svg::render;
pub use symbol::parts_with_symbols;

use halfarrow_compiler::causal_graph::CausalGraph;
use halfarrow_compiler::causal_paths::CausalPaths;

/// What is drawn of a bond graph.
#[derive(Debug, Clone, PartialEq)]
pub struct DrawOptions {
    /// Which causal paths.
    pub paths: DrawnPaths,
    /// Whether laws and values stand at the elements.
    pub laws: bool,
    /// Whether of the cells of a repetition that are made alike the first alone is drawn.
    pub first_cells: bool,
    /// Whether multibonds are drawn bond by bond.
    pub expand: bool,
    /// Where elements stand already, in px by their names: they stay there, as seen from each other. From
    /// [`positions`] of an earlier drawing, or from an editor.
    pub keep: BTreeMap<String, [f64; 2]>,
}

/// Which causal paths are drawn.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum DrawnPaths {
    /// At most so many; the legend says how many there are besides.
    First(usize),
    /// Those with these numbers in the legend, from 1; none of an empty list.
    Numbers(Vec<usize>),
}

impl Default for DrawOptions {
    /// 12 causal paths, laws, all cells, thick bonds for multibonds, nothing kept.
    fn default() -> Self {
        DrawOptions {
            paths: DrawnPaths::First(12),
            laws: true,
            first_cells: false,
            expand: false,
            keep: BTreeMap::new(),
        }
    }
}

/// Draws a bond graph with its strokes and causal paths, as SVG.
///
/// Half arrows have their barb on the side of the flow, strokes sit where the effort runs to, bonds are numbered from 1.
/// Storages in derivative causality have a dashed frame, junctions whose variable is independent without a storage a
/// ring, set-valued laws and parts of the library the symbol of their field in the place of the keyword, bonds whose stroke is undetermined are dotted. Equal graphs
/// give equal texts.
pub fn draw(causal: &CausalGraph, paths: &CausalPaths, options: &DrawOptions) -> String {
    let all = figure(causal, paths, options);
    let wide = causal.graph.elements.values().any(|e| e.strand.is_some());
    let drawn = match options.first_cells {
        true => first_cells(all, &causal.graph),
        false if wide && !options.expand => joined(all, &causal.graph),
        false => all,
    };
    render(&drawn, &options.keep)
}
