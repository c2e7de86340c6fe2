//! Relations between positions that the states keep by their rates alone, so that they drift: those onto which states may
//! be put back. Source: `method.md`, 5.4.

use std::collections::BTreeMap;

use super::definitions::{Definition, Definitions};
use super::{Position, State};
use crate::algebra::{Expr, PlainNames, Symbol, ascii};
use crate::bond_graph::{HeldKind, Integral, Meaning, VelocityRelation, velocity_relations};

/// Positions that follow from others, one after the other, at most.
const DEEP: usize = 32;

/// A relation between states that keeps its value, known in closed form.
#[derive(Debug, Clone)]
pub struct PositionRelation {
    /// It vanishes, or keeps the value that it has at the start.
    pub value: Expr,
    /// Whether it vanishes: it is a constraint.
    pub vanishes: bool,
    /// Its derivatives by the states that it reads.
    pub slopes: Vec<(Symbol, Expr)>,
    /// What keeps its value, as text, where positions may drift from it: not of constraints, which tell their drift
    /// themselves, nor of what every method keeps.
    pub told: Option<String>,
}

/// A relation between speeds onto which states are not put back.
#[derive(Debug, Clone)]
pub struct UnkeptRelation {
    /// The relation, as text.
    pub text: String,
    /// Why not.
    pub reason: Unkept,
}

/// Why states are not put back onto a relation.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Unkept {
    /// It is nonholonomic: no positions are beyond reach.
    Nonholonomic,
    /// It has no closed form here.
    NoClosedForm,
    /// It was not decided whether it is one of positions, since it reads what is none, or too many of them.
    Undecided,
    /// It reads this position, which constraints determine or other laws give.
    Reads(String),
}

impl std::fmt::Display for Unkept {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Unkept::Nonholonomic => f.write_str("it is nonholonomic: it binds speeds and no positions"),
            Unkept::NoClosedForm => f.write_str("it has no closed form that was found"),
            Unkept::Undecided => f.write_str("it is not known whether it binds positions: it reads what is none"),
            Unkept::Reads(what) => write!(f, "it reads {what}, which is no state but follows from others"),
        }
    }
}

/// The relations of a graph between positions: those that states can be put back onto, and the others with the reason.
pub(super) fn position_relations(
    d: &mut Definitions,
    states: &[State],
    positions: &[Position],
) -> (Vec<PositionRelation>, Vec<UnkeptRelation>) {
    let graph = d.graph;
    let (mut kept, mut unkept) = (Vec::new(), Vec::new());
    for relation in velocity_relations(&mut d.x, graph) {
        let reason = match relation.integral {
            // Its position is computed.
            Integral::Constraint(c) if positions.iter().any(|p| p.constraint == c) => continue,
            Integral::Constraint(c) => match in_states(d, states, graph.constraints[c].expr) {
                Ok(value) => {
                    kept.push(relation_of(d, states, value, None));
                    continue;
                }
                // It is on inputs and the like as well.
                Err(what) => Unkept::Reads(what),
            },
            Integral::Closed(value) => match in_states(d, states, value) {
                Ok(value) => {
                    kept.push(relation_of(d, states, value, Some(&relation)));
                    continue;
                }
                Err(what) => Unkept::Reads(what),
            },
            Integral::Open => Unkept::NoClosedForm,
            Integral::Nonholonomic => Unkept::Nonholonomic,
            Integral::Undecided => Unkept::Undecided,
        };
        if !relation.is_linear(&d.x) {
            unkept.push(UnkeptRelation { text: text_of(d, &relation), reason });
        }
    }
    kept.retain(|relation| !relation.slopes.is_empty());
    // What is linear alone every method keeps.
    let moving =
        |r: &PositionRelation| r.slopes.iter().any(|s| d.x.depends_on_any(s.1, &|s| d.x.facts(s).given.is_none()));
    if !kept.iter().any(moving) {
        kept.clear();
    }
    (kept, unkept)
}

fn text_of(d: &mut Definitions, relation: &VelocityRelation) -> String {
    let text = relation.expression(&mut d.x, d.graph);
    ascii(&d.x, text, &PlainNames(&d.x))
}

/// `between`: the speeds that it is one of the positions of; a constraint else.
fn relation_of(
    d: &mut Definitions,
    states: &[State],
    value: Expr,
    between: Option<&VelocityRelation>,
) -> PositionRelation {
    let read = d.x.symbols_of(value);
    let moved: Vec<Symbol> = states.iter().map(|s| s.symbol).filter(|s| read.contains(s)).collect();
    let slopes = moved.into_iter().map(|s| (s, d.x.derivative(value, s)));
    let slopes: Vec<_> = slopes.collect();
    let slopes = slopes.into_iter().filter(|s| !d.x.is_zero(s.1)).collect();
    let drifts = between.filter(|relation| !relation.is_linear(&d.x));
    let told = drifts.map(|relation| text_of(d, relation));
    PositionRelation { value, vanishes: between.is_none(), slopes, told }
}

/// An expression of positions in states, time, what is set from outside and what events set; what it reads else, if it does.
fn in_states(d: &mut Definitions, states: &[State], mut e: Expr) -> Result<Expr, String> {
    // Definitions may read each other in a circle.
    for _ in 0..DEEP {
        let mut known = BTreeMap::new();
        for symbol in d.x.symbols_of(e) {
            let outside = match d.meaning(symbol) {
                Some(Meaning::Parameter(_) | Meaning::Time | Meaning::Input(_)) => true,
                Some(Meaning::Held(held)) => d.graph.held[held].kind != HeldKind::Delay,
                _ => d.constants.contains(&symbol) || states.iter().any(|s| s.symbol == symbol),
            };
            // What a position follows from are positions; efforts and flows follow from laws.
            let position = matches!(d.meaning(symbol), Some(Meaning::Signal(_) | Meaning::Stored(_)));
            match d.of.get(&symbol) {
                _ if outside => {}
                Some(Definition::Explicit(value)) if position => _ = known.insert(symbol, *value),
                _ => return Err(d.x.name(symbol).to_string()),
            }
        }
        if known.is_empty() {
            return Ok(e);
        }
        e = d.x.substitute(e, &known);
    }
    Err("positions that follow from each other".into())
}
