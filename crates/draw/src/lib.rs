//! Bond graphs as pictures: half arrows, causal strokes, numbered bonds, causal paths in colour.
//!
//! [`layout`] says where everything stands, `svg` draws it. The pictures are self-contained SVG on a white ground.
#![forbid(unsafe_code)]

pub mod figure;
mod geometry;
pub mod layout;
mod overlay;
mod route;
mod svg;
pub mod text;

pub use svg::render;
