//! Bond graphs as pictures: half arrows, causal strokes, numbered bonds, causal paths in colour.
//!
//! [`layout`] says where everything stands, `svg` draws it. The pictures are self-contained SVG on a white ground.
#![forbid(unsafe_code)]

mod causal;
pub mod figure;
mod geometry;
pub mod layout;
mod overlay;
mod route;
mod svg;
pub mod text;

use causal::figure;
pub use svg::render;

use halfarrow_compiler::causal_graph::CausalGraph;
use halfarrow_compiler::causal_paths::CausalPaths;

/// What is drawn of a bond graph.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DrawOptions {
    /// Most causal paths drawn; the legend says how many there are besides.
    pub paths: usize,
}

impl Default for DrawOptions {
    /// 12 causal paths.
    fn default() -> Self {
        DrawOptions { paths: 12 }
    }
}

/// Draws a bond graph with its strokes and causal paths, as SVG.
///
/// Half arrows have their barb on the side of the flow, strokes sit where the effort runs to, bonds are numbered from 1.
/// Storages in derivative causality have a dashed frame, bonds whose stroke is undetermined are dotted. Equal graphs
/// give equal texts.
pub fn draw(causal: &CausalGraph, paths: &CausalPaths, options: &DrawOptions) -> String {
    render(&figure(causal, paths, options))
}
