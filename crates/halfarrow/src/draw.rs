//! The picture of a model.

use halfarrow_compiler::causal_paths::find_paths;
use halfarrow_draw::DrawOptions;

use halfarrow_trace::{Trace, plot, png};

use crate::error::{Error, Problem};
use crate::model::Model;

/// Pixels of a PNG for each unit of length of the drawing.
const SCALE: f32 = 2.0;

/// A picture as SVG text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    /// The SVG document.
    pub svg: String,
}

impl Picture {
    /// The same as PNG.
    ///
    /// # Errors
    /// It is too large.
    pub fn to_png(&self) -> Result<Vec<u8>, Problem> {
        png(&self.svg, SCALE).map_err(|why| Problem::NoPng { why: why.to_string() })
    }
}

impl Model {
    /// What was recorded, over time.
    pub fn plot(&self, trace: &Trace) -> Picture {
        let title = if self.graph.doc.is_empty() { &self.graph.name } else { &self.graph.doc };
        Picture { svg: plot(trace, title) }
    }

    /// The bond graph with causal strokes, numbered bonds and causal paths.
    ///
    /// # Errors
    /// The model has errors.
    pub fn draw(&self) -> Result<Picture, Error> {
        let causal = self.causal_graph()?;
        let paths = find_paths(&causal);
        Ok(Picture { svg: halfarrow_draw::draw(&causal, &paths, &DrawOptions::default()) })
    }
}
