//! The picture of a model.

use halfarrow_compiler::diagnostic::nearest;
use halfarrow_draw::{DrawOptions, DrawnPaths, path_count};
use halfarrow_trace::{PlotOptions, Trace, plot, plot_runs, png};

use crate::error::{Error, Problem};
use crate::model::Model;
use crate::pieces::smooth;

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

/// Runs beside each other: what each is called, and what it recorded.
pub type NamedRuns<'r> = [(&'r str, &'r Trace)];

impl Model {
    /// What was recorded, over time.
    pub fn plot(&self, trace: &Trace) -> Picture {
        Picture { svg: plot(&smooth(trace), self.title()) }
    }

    /// Chosen variables of one or several runs, over time or over each other. The first run is the one of this model; the
    /// units are its own.
    ///
    /// # Errors
    /// No run has a variable of this name.
    pub fn plot_runs(&self, runs: &NamedRuns, options: &PlotOptions) -> Result<Picture, Problem> {
        let unknown = |name: String| {
            let known = runs.iter().flat_map(|(_, trace)| &trace.columns).map(|c| c.name.as_str());
            Problem::UnknownVariable { nearest: nearest(&name, known).map(str::to_string), name }
        };
        let fine: Vec<_> = runs.iter().map(|(name, trace)| (*name, smooth(trace))).collect();
        let runs: Vec<(&str, &Trace)> = fine.iter().map(|(name, trace)| (*name, trace.as_ref())).collect();
        plot_runs(&runs, self.title(), options).map(|svg| Picture { svg }).map_err(unknown)
    }

    /// What a picture of the model is called.
    pub(crate) fn title(&self) -> &str {
        if self.graph.doc.is_empty() { &self.graph.name } else { &self.graph.doc }
    }

    /// The bond graph with causal strokes, numbered bonds and causal paths.
    ///
    /// # Errors
    /// The model has errors, or a path is asked for that it does not have.
    pub fn draw(&self, options: &DrawOptions) -> Result<Picture, Error> {
        let causal = self.causal_graph()?;
        let paths = self.paths_of(&causal);
        let count = path_count(&paths);
        if let DrawnPaths::Numbers(numbers) = &options.paths
            && let Some(none) = numbers.iter().find(|n| !(1..=count).contains(*n))
        {
            let known = match count {
                0 => "the model has no causal path to draw".to_string(),
                n => format!("the drawing numbers them from 1 to {n}"),
            };
            return Err(Problem::BadOption { reason: format!("there is no path {none}: {known}") }.into());
        }
        Ok(Picture { svg: self.watch.time("draw", || halfarrow_draw::draw(&causal, &paths, options)) })
    }
}
