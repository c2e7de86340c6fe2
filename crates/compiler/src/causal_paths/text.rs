//! Causal paths as text.

use super::{CausalPaths, Component, Path};
use crate::algebra::{Expr, PlainNames, Symbol, ascii};
use crate::bond_graph::{BondGraph, ElementId};
use crate::causal_graph::CausalGraph;

impl CausalPaths {
    /// All that is known of the paths, one fact a line; `causal` is the graph that they were found in.
    pub fn text(&self, causal: &CausalGraph) -> String {
        let shown = Shown { graph: &causal.graph, paths: self };
        let mut text = format!("causal_paths {}\n", causal.graph.name);
        section(&mut text, "paths", self.paths.iter().map(|path| shown.path(path)));
        if !self.complete {
            text.push_str("  there are more: shown is one for every break variable and for every dependent storage\n");
        }
        section(&mut text, "components", self.components.iter().map(|component| shown.component(component)));
        section(&mut text, "derivative storages", self.dependent.iter().map(|&place| causal.graph.port_name(place)));
        text
    }
}

fn section(text: &mut String, title: &str, entries: impl Iterator<Item = String>) {
    let entries: Vec<String> = entries.collect();
    if entries.is_empty() {
        return;
    }
    text.push_str(&format!("\n{title}\n"));
    entries.iter().for_each(|entry| text.push_str(&format!("  {entry}\n")));
}

struct Shown<'a> {
    graph: &'a BondGraph,
    paths: &'a CausalPaths,
}

impl Shown<'_> {
    fn path(&self, path: &Path) -> String {
        let along: Vec<&str> = path.signals.iter().map(|(_, symbol)| self.symbol(*symbol)).collect();
        let mut text = format!("class {}  {}\n", path.class, self.elements(&path.elements, " - "));
        text.push_str(&format!("    gain   {}\n", self.expr(path.gain)));
        text.push_str(&format!("    along  {}\n", along.join(" ")));
        text.push_str(&format!("    meets  {}", self.elements(&path.route, " ")));
        if !path.breaks.is_empty() {
            text.push_str(&format!("\n    breaks {}", self.symbols(&path.breaks)));
        }
        text
    }

    fn component(&self, component: &Component) -> String {
        let mut text = format!("{} signals, broken at {}", component.signals.len(), self.symbols(&component.breaks));
        if !component.exact {
            let (found, least) = (component.breaks.len(), component.lower_bound);
            text.push_str(&format!(" ({found}; at least {least} are needed)"));
        }
        if let Some(determinant) = component.determinant {
            text.push_str(&format!("\n    determinant {}", self.expr(determinant)));
        }
        if component.singular {
            text.push_str("\n    singular");
        }
        text
    }

    fn elements(&self, elements: &[ElementId], between: &str) -> String {
        let names: Vec<&str> = elements.iter().map(|&element| self.graph.elements[element].name.as_str()).collect();
        names.join(between)
    }

    fn symbols(&self, symbols: &[Symbol]) -> String {
        let names: Vec<&str> = symbols.iter().map(|&symbol| self.symbol(symbol)).collect();
        names.join(", ")
    }

    fn symbol(&self, symbol: Symbol) -> &str {
        self.paths.exprs.name(symbol)
    }

    fn expr(&self, e: Expr) -> String {
        ascii(&self.paths.exprs, e, &PlainNames(&self.paths.exprs))
    }
}
