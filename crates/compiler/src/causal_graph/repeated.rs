//! Constraints on displacements that others keep wherever the machine can be, as those of a third crank under a
//! parallelogram do. The rows of their slopes are independent almost everywhere and depend on each other only where the
//! loops are closed: rank is found at assembled positions, and has to stay the same along the motion. So is what moves nothing
//! that a cut joint holds, as the spin of a rod about the ball at its end does: off the assembled positions it would. Source:
//! `method.md`, 5.4.

use std::collections::{BTreeMap, BTreeSet};

use super::start_point::{least_step, start_values};
use crate::algebra::{Expr, Exprs, Symbol, ZERO};
use crate::bond_graph::{BondGraph, Constraint, ElementId, Kind, Meaning};
use crate::ids::Map;

/// A row that is so much shorter without what the others have of it depends on them.
const DEPENDENT: f64 = 1e-8;
/// Slopes below this part of the greatest ones are rounding.
const STILL: f64 = 1e-9;
/// A constraint is kept that is missed by less than this.
const KEPT: f64 = 1e-10;
/// How far the machine is moved to see whether they still depend on each other there.
const MOVES: [f64; 4] = [0.02, -0.02, 0.05, -0.05];
/// Of such a move at least this part has to be left when the loops are closed again.
const LEFT: f64 = 0.3;
const ITERATIONS: usize = 30;
/// More constraints are not examined.
const MOST: usize = 300;

/// The graph with efforts of 0 in the place of constraints that repeat others, and which they are, by their numbers; and with
/// moduli of 0 where what moves does not move what a joint holds.
pub(super) fn without_repeated(graph: &BondGraph) -> (BondGraph, Vec<usize>) {
    let mut x = graph.exprs.clone();
    let (repeated, idle) = repeated(&mut x, graph);
    let mut left = graph.clone();
    for transformer in idle {
        left.elements[transformer].kind = Kind::Transformer { modulus: ZERO };
    }
    for &constraint in &repeated {
        let element = &mut left.elements[graph.constraints[constraint].element];
        element.kind = Kind::EffortSource { value: x.int(0) };
    }
    (left.with_exprs(x), repeated.into_iter().collect())
}

/// The constraints at a point.
struct Loops<'a> {
    x: &'a Exprs,
    constraints: Vec<Expr>,
    /// The slopes of each by what moves: positions that have one rate move together.
    slopes: Vec<Vec<Vec<Expr>>>,
    together: Vec<Vec<Symbol>>,
}

/// Constraints that repeat others, and the transformers by which nothing that moves acts on a joint.
fn repeated(x: &mut Exprs, graph: &BondGraph) -> (BTreeSet<usize>, Vec<ElementId>) {
    let none = (BTreeSet::new(), Vec::new());
    let held = |c: &Constraint| matches!(graph.elements[c.element].kind, Kind::ZeroCompliance { .. });
    let acts = |c: &usize| graph.constraints[*c].holonomic && held(&graph.constraints[*c]);
    let numbers: Vec<usize> = (0..graph.constraints.len()).filter(acts).collect();
    if !(2..=MOST).contains(&numbers.len()) {
        return none;
    }
    let constraints: Vec<Expr> = numbers.iter().map(|&c| graph.constraints[c].expr).collect();
    let mut together: BTreeMap<Expr, Vec<Symbol>> = BTreeMap::new();
    let read: BTreeSet<Symbol> = constraints.iter().flat_map(|&e| x.symbols_of(e)).collect();
    for symbol in read {
        if let Some(rate) = rate(x, graph, symbol) {
            together.entry(rate).or_default().push(symbol);
        }
    }
    let together: Vec<Vec<Symbol>> = together.into_values().collect();
    let mut slope = |e: Expr| together.iter().map(|t| t.iter().map(|&s| x.derivative(e, s)).collect()).collect();
    let slopes: Vec<Vec<Vec<Expr>>> = constraints.iter().map(|&e| slope(e)).collect();
    let loops = Loops { x, constraints, slopes, together };
    let start = start_values(x, graph);
    if loops.missed(&start).iter().any(|m| m.is_nan() || m.abs() > KEPT) {
        return none;
    }
    let (mut found, basis) = loops.dependent(&start);
    let mut idle = acting(graph, &numbers);
    idle.retain(|joint| loops.is_still(&start, joint));
    if found.is_empty() && idle.is_empty() {
        return none;
    }
    let Some(way) = loops.free_way(&basis) else { return none };
    for size in MOVES {
        let Some(there) = loops.moved(&start, &way, size) else { return none };
        if !found.is_empty() {
            let (dependent, _) = loops.dependent(&there);
            found.retain(|row| dependent.contains(row));
        }
        idle.retain(|joint| loops.is_still(&there, joint));
    }
    let idle = idle.into_iter().flat_map(|joint| joint.own.into_iter().map(|own| own.0)).collect();
    (found.into_iter().map(|row| numbers[row]).collect(), idle)
}

/// Transformers with their moduli.
type Transformers = Vec<(ElementId, Expr)>;

/// How one thing that moves acts on the constraints of one joint.
struct Acting {
    /// By which transformers.
    own: Transformers,
    /// The moduli by which all else acts on the joint.
    all: Vec<Expr>,
}

/// All that acts through transformers on constraints, joint by joint.
fn acting(graph: &BondGraph, constraints: &[usize]) -> Vec<Acting> {
    let mut joints: BTreeMap<&str, BTreeMap<ElementId, Transformers>> = BTreeMap::new();
    let neighbours = |element: ElementId| {
        let bonds = graph.elements[element].ports.iter().map(|port| &graph.bonds[port.bond]);
        bonds.map(move |bond| if bond.from.element == element { bond.to.element } else { bond.from.element })
    };
    for constraint in constraints.iter().map(|&c| &graph.constraints[c]).filter(|c| !c.drawn) {
        // Those that stand in one component, or beside each other in the model.
        let joint = constraint.name.rsplit_once('.').map_or("", |(joint, _)| joint);
        for node in neighbours(constraint.element) {
            for transformer in neighbours(node) {
                let Kind::Transformer { modulus } = graph.elements[transformer].kind else { continue };
                let what = neighbours(transformer).find(|&end| end != node);
                joints.entry(joint).or_default().entry(what.unwrap_or(node)).or_default().push((transformer, modulus));
            }
        }
    }
    let of_joint = |joint: BTreeMap<ElementId, Transformers>| {
        let all: Vec<Expr> = joint.values().flatten().map(|own| own.1).collect();
        joint.into_values().map(move |own| Acting { own, all: all.clone() }).collect::<Vec<_>>()
    };
    joints.into_values().flat_map(of_joint).collect()
}

/// The rate of a position, as an expression.
fn rate(x: &mut Exprs, graph: &BondGraph, symbol: Symbol) -> Option<Expr> {
    match graph.variables.get(&symbol)?.meaning {
        Meaning::Signal(signal) => Some(graph.signals[signal].rate),
        Meaning::Stored(port) => graph.storage_symbols(port).map(|(_, rate)| x.sym(rate)),
        _ => None,
    }
}

impl Loops<'_> {
    fn at(&self, values: &Map<Symbol, f64>, e: Expr) -> f64 {
        self.x.eval(e, &mut |s| values.get(&s).copied().unwrap_or(1.0))
    }

    fn missed(&self, values: &Map<Symbol, f64>) -> Vec<f64> {
        self.constraints.iter().map(|&e| self.at(values, e)).collect()
    }

    /// Whether what acts on a joint does not move it at a position.
    fn is_still(&self, values: &Map<Symbol, f64>, joint: &Acting) -> bool {
        let most = joint.all.iter().map(|&e| self.at(values, e).abs()).fold(0.0, f64::max);
        joint.own.iter().all(|&(_, e)| self.at(values, e).abs() <= STILL * most)
    }

    fn jacobian(&self, values: &Map<Symbol, f64>) -> Vec<Vec<f64>> {
        let sum = |slopes: &Vec<Expr>| slopes.iter().map(|&e| self.at(values, e)).sum();
        self.slopes.iter().map(|row| row.iter().map(sum).collect()).collect()
    }

    /// Rows that depend on those before them, and an orthonormal basis of the others.
    fn dependent(&self, values: &Map<Symbol, f64>) -> (BTreeSet<usize>, Vec<Vec<f64>>) {
        let mut found = BTreeSet::new();
        let mut basis: Vec<Vec<f64>> = Vec::new();
        let rows = self.jacobian(values);
        let most = rows.iter().map(|row| length(row)).fold(0.0, f64::max);
        for (number, mut row) in rows.into_iter().enumerate() {
            let before = length(&row);
            take_off(&mut row, &basis);
            let after = length(&row);
            // Where no slope is left the constraint is in a singular position by itself.
            if before > 0.0 && (after <= DEPENDENT * before || before <= STILL * most) {
                // What is left of slopes that are rounding, as those of parallel axes are, is no direction.
                found.insert(number);
            } else if after > 0.0 {
                row.iter_mut().for_each(|v| *v /= after);
                basis.push(row);
            }
        }
        (found, basis)
    }

    /// A way along which all constraints are kept, of length 1.
    fn free_way(&self, basis: &[Vec<f64>]) -> Option<Vec<f64>> {
        // No combination of positions is favoured.
        let mut way: Vec<f64> = (0..self.together.len()).map(|k| 1.0 + ((7 * k + 3) % 11) as f64 / 11.0).collect();
        let before = length(&way);
        take_off(&mut way, basis);
        let after = length(&way);
        way.iter_mut().for_each(|v| *v /= after);
        (after > DEPENDENT * before).then_some(way)
    }

    /// The assembled position near a move; `None` if the loops cannot follow.
    fn moved(&self, start: &Map<Symbol, f64>, way: &[f64], size: f64) -> Option<Map<Symbol, f64>> {
        let mut values = start.clone();
        let mut gone: Vec<f64> = way.iter().map(|v| size * v).collect();
        self.place(&mut values, start, &gone);
        for _ in 0..ITERATIONS {
            let missed = self.missed(&values);
            if missed.iter().all(|m| m.abs() <= KEPT) {
                break;
            }
            let step = least_step(&self.jacobian(&values), &missed)?;
            gone.iter_mut().zip(&step).for_each(|(g, s)| *g -= s);
            self.place(&mut values, start, &gone);
        }
        let kept = self.missed(&values).iter().all(|m| m.abs() <= KEPT);
        let along: f64 = gone.iter().zip(way).map(|(g, v)| g * v).sum();
        (kept && along / size >= LEFT).then_some(values)
    }

    fn place(&self, values: &mut Map<Symbol, f64>, start: &Map<Symbol, f64>, gone: &[f64]) {
        for (together, gone) in self.together.iter().zip(gone) {
            together.iter().for_each(|s| _ = values.insert(*s, start.get(s).copied().unwrap_or(0.0) + gone));
        }
    }
}

fn length(row: &[f64]) -> f64 {
    row.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// Takes off what a basis has of a row, twice, for what rounding leaves.
fn take_off(row: &mut [f64], basis: &[Vec<f64>]) {
    for _ in 0..2 {
        for known in basis {
            let share: f64 = row.iter().zip(known).map(|(a, b)| a * b).sum();
            row.iter_mut().zip(known).for_each(|(v, k)| *v -= share * k);
        }
    }
}
