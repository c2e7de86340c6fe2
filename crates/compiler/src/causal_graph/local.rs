//! Definitions from strokes in a part without rings: each variable by those of the element that sets it.

use super::ports::{Virtual, imposes_effort};
use super::two_ports::{self, Given};
use super::{Combination, PortState, Role, Terms};
use crate::algebra::{Expr, Exprs, Symbol};
use crate::bond_graph::{BondGraph, ElementId, Kind, PortCausality, PortRef};

/// Definitions of variables, and their divisors that are not known to be nonzero.
pub type Definitions = (Vec<(Symbol, Combination)>, Vec<Expr>);

/// Whether the stroke of its bond sits at a port, where it is drawn.
pub type Drawn<'a> = &'a dyn Fn(PortRef) -> Option<bool>;

/// Definitions of the variables that junctions and two-ports set, one element at a time, and the moduli divided by.
///
/// The common variables of `kept` junctions are inputs, their conjugates the sums over their bonds. Triangular if there is no
/// causal loop, as on trees.
pub fn definitions(
    x: &mut Exprs,
    graph: &BondGraph,
    members: &[ElementId],
    drawn: Drawn,
    kept: &[Virtual],
) -> Definitions {
    let mut all = Vec::new();
    let mut divisors = Vec::new();
    let one = x.int(1);
    for &element in members {
        let ports = &graph.elements[element].ports;
        let at = |i: usize| drawn(PortRef { element, port: i as u32 }).expect("strokes are complete");
        let pair = |i: usize| {
            let bond = &graph.bonds[ports[i].bond];
            (bond.effort, bond.flow)
        };
        match graph.elements[element].kind {
            Kind::Zero | Kind::One => {
                let zero = matches!(graph.elements[element].kind, Kind::Zero);
                let common = |i: usize| if zero { pair(i).0 } else { pair(i).1 };
                let summed = |i: usize| if zero { pair(i).1 } else { pair(i).0 };
                if let Some(v) = kept.iter().find(|v| v.junction == element) {
                    let all_common = (0..ports.len()).map(|i| (common(i), Combination::of(v.speed, one)));
                    all.extend(all_common);
                    let sign = |i: usize| if ports[i].inward { 1 } else { -1 };
                    let mut sum: Vec<(Symbol, Expr)> = (0..ports.len()).map(|i| (summed(i), x.int(sign(i)))).collect();
                    sum.sort_by_key(|t| t.0);
                    all.push((v.reaction, Combination(sum.into())));
                    continue;
                }
                let strong = (0..ports.len()).find(|&i| at(i) == zero).expect("one bond determines a junction");
                let mut sum = Terms::with_capacity(ports.len() - 1);
                for i in (0..ports.len()).filter(|&i| i != strong) {
                    all.push((common(i), Combination::of(common(strong), one)));
                    let same = ports[i].inward == ports[strong].inward;
                    sum.push((summed(i), x.int(if same { -1 } else { 1 })));
                }
                sum.sort_by_key(|t| t.0);
                all.push((summed(strong), Combination(sum)));
            }
            Kind::Transformer { modulus } | Kind::Gyrator { modulus } => {
                let transformer = matches!(graph.elements[element].kind, Kind::Transformer { .. });
                let ((e_in, f_in), (e_out, f_out)) = (pair(0), pair(1));
                let (over, under) = x.over_and_under(modulus);
                let (factor, divisor) = if at(0) { (under, over) } else { (over, under) };
                if !x.nonzero(divisor) {
                    divisors.push(divisor);
                    x.assume_nonzero(divisor);
                }
                let factor = x.div(factor, divisor);
                let [(a, b), (c, d)] = match (transformer, at(0)) {
                    (true, false) => [(e_in, e_out), (f_out, f_in)],
                    (true, true) => [(e_out, e_in), (f_in, f_out)],
                    (false, false) => [(e_in, f_out), (e_out, f_in)],
                    (false, true) => [(f_out, e_in), (f_in, e_out)],
                };
                all.push((a, Combination::of(b, factor)));
                all.push((c, Combination::of(d, factor)));
            }
            Kind::MatrixTransformer(_) | Kind::MatrixGyrator(_) => {
                let rows = graph.elements[element].kind.two_port_rows();
                let of = |port: usize, effort: bool| if effort { pair(port).0 } else { pair(port).1 };
                let given = two_ports::given(&rows, &|port| Some(!at(port)));
                for (row, given) in rows.iter().zip(given) {
                    let own = of(row.port, row.effort);
                    let terms = row.terms.iter().map(|&(port, e)| (of(port, row.of_efforts), e));
                    let (set, mut sum): (Symbol, Vec<(Symbol, Expr)>) = match given {
                        Some(Given::Own) => (own, terms.collect()),
                        Some(Given::Term(k)) => {
                            let divisor = row.terms[k].1;
                            if !x.nonzero(divisor) {
                                divisors.push(divisor);
                                x.assume_nonzero(divisor);
                            }
                            let set = of(row.terms[k].0, row.of_efforts);
                            let others: Vec<_> = terms.filter(|t| t.0 != set).collect();
                            let mut sum: Vec<_> = others
                                .into_iter()
                                .map(|(symbol, e)| {
                                    let e = x.neg(e);
                                    (symbol, x.div(e, divisor))
                                })
                                .collect();
                            let one = x.int(1);
                            sum.push((own, x.div(one, divisor)));
                            (set, sum)
                        }
                        None => continue,
                    };
                    sum.sort_by_key(|t| t.0);
                    all.push((set, Combination(sum.into())));
                }
            }
            _ => {}
        }
    }
    (all, divisors)
}

/// The roles of the ports of a part as the strokes say.
pub fn roles(graph: &BondGraph, members: &[ElementId], drawn: Drawn) -> Vec<PortState> {
    let mut states = Vec::new();
    for &element in members.iter().filter(|&&m| !graph.elements[m].kind.is_inner()) {
        for index in 0..graph.elements[element].ports.len() as u32 {
            let port = PortRef { element, port: index };
            let bond = &graph.bonds[graph.bond_of(port)];
            let effort_in = drawn(port).expect("strokes are complete");
            let role = match (&graph.elements[element].kind, effort_in) {
                (Kind::Inertance(_), true) | (Kind::Compliance(_), false) => Role::Independent,
                (Kind::Inertance(_), false) | (Kind::Compliance(_), true) => Role::Dependent,
                (Kind::Resistor(_) | Kind::SkewGyrator(_), true) => Role::Algebraic(PortCausality::Conductive),
                (Kind::Resistor(_) | Kind::SkewGyrator(_), false) => Role::Algebraic(PortCausality::Resistive),
                _ => Role::Source,
            };
            let role = match imposes_effort(graph, port) {
                Some(effort) if effort != effort_in => Role::Source,
                // Its imposed variable is redundant; its conjugate is the input instead.
                Some(_) if effort_in => Role::Algebraic(PortCausality::Conductive),
                Some(_) => Role::Algebraic(PortCausality::Resistive),
                None => role,
            };
            let (input, output) = if effort_in { (bond.flow, bond.effort) } else { (bond.effort, bond.flow) };
            states.push(PortState { port, role, input, output });
        }
    }
    states
}
