//! The causal graph as text.

use std::fmt::{Display, Formatter, Result};

use super::{CausalGraph, Combination, Role, Stroke};
use crate::algebra::{Expr, Exprs, PlainNames, ascii};
use crate::bond_graph::{PortCausality, PortRef};
use crate::ids::Id;

impl Display for CausalGraph {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let graph = &self.graph;
        writeln!(f, "causal_graph {}", graph.name)?;
        writeln!(f, "\nbonds")?;
        for (id, bond) in graph.bonds.iter() {
            let name = |p: PortRef| &graph.elements[p.element].name;
            let arrow = match self.strokes[id] {
                Stroke::From => "|->",
                Stroke::To => "->|",
                Stroke::Undetermined => "-?->",
            };
            writeln!(f, "  {:>3}  {} {arrow} {}", id.index() + 1, name(bond.from), name(bond.to))?;
        }
        writeln!(f, "\nports")?;
        for state in &self.ports.ports {
            let role = match state.role {
                Role::Source => "imposed",
                Role::Redundant => "imposed again",
                Role::Independent => "independent",
                Role::Dependent => "dependent",
                Role::Algebraic(PortCausality::Conductive) => "effort in, flow out",
                Role::Algebraic(_) => "flow in, effort out",
            };
            let x = &graph.exprs;
            writeln!(
                f,
                "  {:<12} {role:<20} gives {}, takes {}",
                graph.port_name(state.port),
                x.label(state.input),
                x.label(state.output)
            )?;
        }
        section(f, "virtual speeds", self.ports.virtual_speeds.iter().map(|v| graph.exprs.label(v.speed).to_string()))?;
        let mut x = graph.exprs.clone();
        let mut definitions: Vec<String> = Vec::new();
        for (symbol, combination) in &self.ports.definitions {
            definitions.push(format!("{} = {}", graph.exprs.label(*symbol), sum(&mut x, combination)));
        }
        definitions.sort();
        section(f, "junction structure", definitions)?;
        let plain = |e: &Expr| ascii(&graph.exprs, *e, &PlainNames(&graph.exprs));
        section(f, "divided by", self.ports.watched.iter().map(plain))?;
        section(f, "zero at the given parameters", self.ports.degenerate.iter().map(plain))?;
        section(f, "undetermined", self.ports.undetermined.iter().map(|&s| graph.exprs.label(s).to_string()))
    }
}

fn section(f: &mut Formatter<'_>, title: &str, lines: impl IntoIterator<Item = String>) -> Result {
    let mut lines = lines.into_iter().peekable();
    if lines.peek().is_some() {
        writeln!(f, "\n{title}")?;
    }
    lines.try_for_each(|line| writeln!(f, "  {line}"))
}

fn sum(x: &mut Exprs, combination: &Combination) -> String {
    if combination.0.is_empty() {
        return "0".into();
    }
    let e = combination.expr(x);
    ascii(x, e, &PlainNames(x))
}
