//! The stages as text.

use halfarrow_compiler::ast;
use halfarrow_compiler::compile::Found;
use halfarrow_compiler::diagnostic::{Diagnostics, Sources};
use halfarrow_compiler::equations::Form;
use halfarrow_compiler::textbook::show;

use crate::Override;
use crate::error::Error;
use crate::model::Model;
use crate::source::Source;

/// A stage of the compiler whose result can be shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// The syntax tree.
    Ast,
    /// Elements, bonds and laws, flattened, in SI.
    BondGraph,
    /// The same with causality.
    CausalGraph,
    /// Zero-order causal paths.
    CausalPaths,
    /// Equations in evaluation order, minimal form.
    Equations,
    /// What is evaluated while running.
    Program,
}

impl Stage {
    /// All of them, in order.
    pub const ALL: [Stage; 6] =
        [Stage::Ast, Stage::BondGraph, Stage::CausalGraph, Stage::CausalPaths, Stage::Equations, Stage::Program];

    /// Its name: that of its folder, of its golden text and of `halfarrow show`.
    pub fn name(self) -> &'static str {
        match self {
            Stage::Ast => "ast",
            Stage::BondGraph => "bond_graph",
            Stage::CausalGraph => "causal_graph",
            Stage::CausalPaths => "causal_paths",
            Stage::Equations => "equations",
            Stage::Program => "program",
        }
    }

    /// What it makes of a source, as text.
    ///
    /// # Errors
    /// The model has errors; the syntax tree is shown only of a text without errors.
    pub fn show(self, source: Source, set: &[Override]) -> Result<String, Error> {
        match self {
            Stage::Ast => {
                let mut sources = Sources::new();
                let file = sources.add(source.name(), source.content());
                let parsed = ast::parse(sources.text(file), file);
                let diagnostics = Diagnostics(parsed.diagnostics);
                match diagnostics.has_errors() {
                    true => Err(Error::Model(Found { diagnostics, sources, ..Found::default() })),
                    false => Ok(parsed.ast.to_string()),
                }
            }
            _ => self.show_model(&Model::new(source, set)?),
        }
    }

    /// What it makes of a source with these branches of its set-valued laws: see [`Model::in_mode`].
    ///
    /// # Errors
    /// As [`show`](Stage::show) and [`Model::in_mode`].
    pub fn show_in(self, source: Source, set: &[Override], branches: &[String]) -> Result<String, Error> {
        match branches.is_empty() {
            true => self.show(source, set),
            false => self.show_model(&Model::new(source, set)?.in_mode(branches)?),
        }
    }

    /// What it makes of a model, as text. The syntax tree of a model is that of its main file.
    ///
    /// # Errors
    /// The model has errors.
    pub fn show_model(self, model: &Model) -> Result<String, Error> {
        Ok(match self {
            Stage::Ast => {
                let text = model.found.sources.text(Default::default());
                ast::parse(text, Default::default()).ast.to_string()
            }
            Stage::BondGraph => model.graph.to_string(),
            Stage::CausalGraph => model.causal_graph()?.to_string(),
            Stage::CausalPaths => {
                let causal = model.causal_graph()?;
                model.paths_of(&causal).text(&causal)
            }
            Stage::Equations => show(model.equations_in(Form::Minimal)?).to_string(),
            Stage::Program => model.program_of(&model.equations_in(Form::Minimal)?).to_string(),
        })
    }
}
