//! Parts solved by the roles of their ports, as large ones are, against elimination of expressions.

use std::collections::BTreeMap;
use std::fmt::Write;

use super::assign::{is_triangular, kept_variable, outer_ports};
use super::ports::{CausalityPreferences, Net, Solved, Virtual};
use super::strokes::parts;
use super::{Combination, Ports};
use crate::algebra::{Expr, Exprs, Node, PlainNames, Symbol, ascii};
use crate::ast::parse;
use crate::bond_graph::{BondGraph, ElementId, Kind, NoFiles, PortCausality, elaborate};
use crate::diagnostic::Sources;
use crate::ids::Map;

#[allow(dead_code, reason = "only the text of graphs is needed")]
#[path = "../../../exec/tests/random_graphs/graph.rs"]
mod plain;
#[allow(clippy::disallowed_methods, reason = "values of parameters")]
#[path = "../../../halfarrow/tests/wild/graph.rs"]
mod wild;

use plain::{Family, Random, composed, random_graph};

/// How many parts were compared, and how many of them are divided by something that is watched.
#[derive(Debug, Default)]
struct Seen {
    parts: usize,
    by_roles: usize,
    watched: usize,
    virtual_speeds: usize,
}

fn graph_of(text: &str) -> Option<BondGraph> {
    let mut sources = Sources::new();
    let file = sources.add("random.bond", text);
    elaborate(parse(text, file).into_result().ok()?, sources, &NoFiles, &[]).graph
}

/// What might be asked of a part, at random.
fn random_preferences(
    x: &mut Exprs,
    graph: &BondGraph,
    members: &[ElementId],
    dice: &mut Random,
) -> CausalityPreferences {
    let mut asked = CausalityPreferences { derivative_first: dice.percent(10), ..CausalityPreferences::default() };
    let changed = dice.percent(50);
    for port in outer_ports(graph, members) {
        match graph.elements[port.element].kind {
            Kind::Inertance(_) | Kind::Compliance(_) if changed && dice.percent(15) => asked.derivative.push(port),
            Kind::Inertance(_) | Kind::Compliance(_) if changed && dice.percent(15) => asked.independent.push(port),
            Kind::EffortSource { .. } | Kind::FlowSource { .. } if changed && dice.percent(20) => {
                asked.sources_as_laws.insert(port);
            }
            Kind::Resistor(_) => {
                let causality = dice.of(&[PortCausality::Resistive, PortCausality::Conductive]);
                asked.algebraic.insert(port, causality);
            }
            _ => {}
        }
    }
    for &junction in members {
        let kind = &graph.elements[junction].kind;
        if matches!(kind, Kind::Zero | Kind::One) && dice.percent(8) {
            let (speed, reaction) = kept_variable(x, graph, junction, matches!(kind, Kind::One));
            asked.virtual_speeds.push(Virtual { junction, speed, reaction, preferred: false });
        }
    }
    asked
}

/// Both ways of solving every part tell the same.
fn compare(
    text: &str,
    seed: u64,
    seen: &mut Seen,
    preferences: impl Fn(&mut Exprs, &BondGraph, &[ElementId], &mut Random) -> CausalityPreferences,
) -> Result<(), String> {
    let Some(graph) = graph_of(text) else { return Ok(()) };
    let dice = &mut Random::new(seed);
    for members in parts(&graph) {
        let mut x = graph.exprs.clone();
        let preferences = preferences(&mut x, &graph, &members, dice);
        let net = Net::new(&mut x, &graph, &members, &preferences);
        let before = x.assumed();
        let by_roles = net.solved_by_roles(&mut x, &preferences, None);
        seen.parts += 1;
        let Some(by_roles) = by_roles else { continue };
        seen.by_roles += 1;
        seen.watched += usize::from(!by_roles.watched.is_empty());
        seen.virtual_speeds += by_roles.virtual_speeds.len();
        x.suppose(before.clone());
        by_roles.watched.iter().for_each(|&e| x.assume_nonzero(e));
        let exposed =
            by_roles.definitions.iter().flat_map(|d| &d.1.0).find_map(|t| unwatched(&mut x, t.1, &by_roles.watched));
        if let Some(e) = exposed {
            let text = |&e: &Expr| ascii(&x, e, &PlainNames(&x));
            let watched: Vec<String> = by_roles.watched.iter().map(text).collect();
            return Err(format!("`{}` divides, watched are only {watched:?}", text(&e)));
        }
        x.suppose(before.clone());
        let exact = net.solved_exactly(&mut x, &preferences, before);
        same(&mut x, &net, &by_roles, &exact)?;
    }
    Ok(())
}

/// Something that is divided by, that may be zero, and that is no factor of what is watched.
fn unwatched(x: &mut Exprs, e: Expr, watched: &[Expr]) -> Option<Expr> {
    let mut open = vec![e];
    while let Some(e) = open.pop() {
        if let Node::Pow(base, n) = *x.node(e)
            && x.is_number(n).is_some_and(|n| *n < 0.into())
            && !x.is_known_nonzero(base)
            && !watched.iter().any(|&e| divides(x, base, e))
        {
            return Some(base);
        }
        x.node(e).for_each_child(|child| open.push(child));
    }
    None
}

fn divides(x: &mut Exprs, factor: Expr, e: Expr) -> bool {
    let quotient = x.div(e, factor);
    x.lowest_terms(quotient).is_some_and(|quotient| quotient.below.is_empty())
}

fn same(x: &mut Exprs, net: &Net, by_roles: &Solved, exact: &Solved) -> Result<(), String> {
    if by_roles.ports != exact.ports {
        return Err(format!("roles {:#?}\nexactly {:#?}", by_roles.ports, exact.ports));
    }
    let speeds = |solved: &Solved| -> Vec<Symbol> { solved.virtual_speeds.iter().map(|v| v.speed).collect() };
    if speeds(by_roles) != speeds(exact) {
        return Err("other junctions keep their variables".into());
    }
    if !exact.undetermined.is_empty() || !exact.demands.is_empty() {
        return Err("by roles it is regular".into());
    }
    if !is_triangular(&by_roles.definitions) {
        return Err("definitions lead back to themselves".into());
    }
    let mut resolved = [by_roles, exact].map(|solved| {
        let ports = Ports { definitions: solved.definitions.iter().cloned().collect(), ..Ports::default() };
        (ports, Map::new())
    });
    for &symbol in &net.symbols {
        let [one, other] = resolved.each_mut().map(|(ports, known)| ports.resolve(x, symbol, known));
        differing(x, &one, &other, exact.degenerate.is_empty())
            .map_or(Ok(()), |input| Err(format!("{} takes different parts of {}", x.label(symbol), x.label(input))))?;
    }
    Ok(())
}

/// The first symbol whose coefficients differ, `always` or at the given parameters: elimination of expressions may have
/// met what vanishes there only, where another order of elimination does not.
fn differing(x: &mut Exprs, one: &Combination, other: &Combination, always: bool) -> Option<Symbol> {
    let minus = x.int(-1);
    let mut terms = one.0.clone();
    terms.extend(other.0.iter().map(|&(s, e)| (s, x.mul(&[minus, e]))));
    let mut sums: BTreeMap<Symbol, Vec<Expr>> = BTreeMap::new();
    terms.into_iter().for_each(|(s, e)| sums.entry(s).or_default().push(e));
    sums.into_iter().find_map(|(s, terms)| {
        let sum = x.add(&terms);
        let zero = if always { x.is_zero(sum) } else { x.is_zero_given(sum) };
        (!zero).then_some(s)
    })
}

fn holds(seeds: impl Iterator<Item = u64>) -> Seen {
    let mut seen = Seen::default();
    let mut failed = String::new();
    for seed in seeds {
        let dice = &mut Random::new(seed);
        let text = match seed % 5 {
            4 => wild::Wild::new(seed).text(),
            n => {
                let family = [Family::Linear, Family::Nonlinear, Family::Varying, Family::Sensing][n as usize];
                random_graph(dice, family).text()
            }
        };
        if let Err(why) = compare(&text, seed, &mut seen, random_preferences) {
            let _ = writeln!(failed, "--- seed {seed}: {why}\n{text}");
        }
    }
    println!("{seen:?}");
    assert!(failed.is_empty(), "{failed}");
    seen
}

#[test]
fn roles_are_those_of_elimination() {
    let seen = holds(1..501);
    assert!(2 * seen.by_roles > seen.parts, "half of the parts must be solved by roles: {seen:?}");
}

/// Graphs on which it went wrong: a block divided by a pivot that another block had taken and that nobody watched.
#[test]
fn pivots_of_one_block_are_not_known_to_others() {
    holds([1_026_447].into_iter());
}

/// Whether every part is solved by its roles.
fn is_solved_by_roles(text: &str) -> bool {
    graph_of(text).is_some_and(|graph| {
        parts(&graph).iter().all(|members| {
            let mut x = graph.exprs.clone();
            let preferences = CausalityPreferences::default();
            Net::new(&mut x, &graph, members, &preferences).solved_by_roles(&mut x, &preferences, None).is_some()
        })
    })
}

#[test]
fn roles_of_large_parts_are_those_of_elimination() {
    let mut seen = Seen::default();
    for seed in 1..6 {
        let families = [Family::Linear, Family::Nonlinear, Family::Varying, Family::Sensing];
        let sound = |pair: &plain::Graph| is_solved_by_roles(&pair.text());
        let graph = composed(&mut Random::new(seed), &families, 700, sound);
        let text = graph.text();
        compare(&text, seed, &mut seen, |_, _, _, _| CausalityPreferences::default())
            .unwrap_or_else(|why| panic!("seed {seed}: {why}\n{text}"));
    }
    // Of one the parts are told by pairs of rows and variables, each by itself, but not all together.
    assert_eq!((seen.parts, seen.by_roles), (5, 4));
}

/// `GRAPHS=100000 FROM=1 cargo test --workspace --lib -- causal_graph::tests::many --ignored --nocapture`
#[test]
#[ignore = "takes hours; its figures stand in docs/TESTING.md"]
fn many() {
    let number = |name: &str, default| std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(default);
    let from = number("FROM", 1_000_000);
    holds(from..from + number("GRAPHS", 20_000));
}
