//! `constraint` statements built into the graph: a zero compliance behind (modulated) transformers.
//!
//! A constraint on displacements says at velocity level `Σ a_k f_k + a_t = 0`. Its ZC stands at a new 0-junction, which
//! is fed from the 1-junction of every flow through a transformer of modulus `-a_k`, so that the effort `λ` of the ZC adds
//! `a_k λ` to the efforts that drive the flow: the gradient of the constraint times its multiplier.

use std::collections::BTreeMap;

use super::builder::{Builder, Pair};
use super::value::Reading;
use super::{Bond, BondGraph, BondId, Constraint, Element, ElementId, Kind, Meaning, Port, PortRef};
use crate::algebra::{Expr, Facts, MINUS_ONE, ONE, Symbol};
use crate::diagnostic::{Diagnostic, codes};
use crate::ids::Id;
use crate::span::Span;

/// A constraint whose sides have been read.
pub(super) struct Sides {
    /// Index into the constraints of the model.
    at: usize,
    /// Left side less right side.
    expr: Expr,
    span: Span,
}

/// A constraint as a relation between flows.
pub(super) struct Relation {
    at: usize,
    expr: Expr,
    holonomic: bool,
    /// Coefficients of flows.
    terms: Vec<(Symbol, Expr)>,
    /// What is left without flows.
    rest: Expr,
    span: Span,
}

impl Relation {
    /// The flows that it reads.
    pub fn flows(&self) -> impl Iterator<Item = Symbol> + '_ {
        self.terms.iter().map(|t| t.0)
    }
}

impl Builder<'_, '_> {
    /// Reads the sides of all constraints.
    pub fn constraint_sides(&mut self) -> Vec<Sides> {
        let flat = self.flat;
        let mut all = Vec::new();
        for (at, (scope, c, span)) in flat.constraints.iter().enumerate() {
            let cx = Reading::of(*scope, &c.name.text);
            let (left, right) = (self.number(&cx, &c.left), self.number(&cx, &c.right));
            if let (Some(left), Some(right)) = (left, right) {
                self.equal(&left.quantity, &right.quantity, *span, "the two sides");
                all.push(Sides { at, expr: self.exprs.sub(left.expr, right.expr), span: *span });
            }
        }
        all
    }

    /// The relations between flows that constraints ask for, with the rates of signals put in.
    pub fn relations(&mut self, sides: &[Sides], rates: &BTreeMap<Symbol, Expr>) -> Vec<Relation> {
        sides.iter().filter_map(|s| self.relation(s, rates)).collect()
    }

    fn relation(&mut self, sides: &Sides, rates: &BTreeMap<Symbol, Expr>) -> Option<Relation> {
        let expr = self.exprs.substitute(sides.expr, rates);
        let holonomic = !self.exprs.depends_on_any(expr, &|s| matches!(self.meaning(s), Some(Meaning::Flow(_))));
        let speed = if holonomic { self.speed_of(expr, rates, sides.span)? } else { expr };
        let symbols = self.exprs.symbols_of(speed);
        let flows: Vec<Symbol> =
            symbols.into_iter().filter(|s| matches!(self.meaning(*s), Some(Meaning::Flow(_)))).collect();
        let Some((coefficients, rest)) = self.exprs.linear_in(speed, &flows) else {
            let d = Diagnostic::error(codes::L007, "a constraint that is not linear in the flows", sides.span, "here");
            self.fault(d.hint("constrain displacements, or flows multiplied by what does not depend on flows"));
            return None;
        };
        for part in coefficients.iter().chain([&rest]) {
            self.refuse_unknown(*part, sides.span)?;
        }
        let terms = flows.into_iter().zip(coefficients);
        let terms: Vec<(Symbol, Expr)> = terms.filter(|(_, a)| !self.exprs.is_zero(*a)).collect();
        if terms.is_empty() {
            let d = Diagnostic::error(
                codes::L006,
                "a constraint on nothing that moves",
                sides.span,
                "reads no displacement or flow",
            );
            self.fault(d.hint("name displacements of elements (`spring.q`), or states whose rate is a flow"));
            return None;
        }
        Some(Relation { at: sides.at, expr, holonomic, terms, rest, span: sides.span })
    }

    /// The rate of an expression of displacements.
    fn speed_of(&mut self, expr: Expr, rates: &BTreeMap<Symbol, Expr>, span: Span) -> Option<Expr> {
        let mut terms = Vec::new();
        for symbol in self.exprs.symbols_of(expr) {
            let slope = self.exprs.derivative(expr, symbol);
            let rate = match self.meaning(symbol)? {
                Meaning::Signal(id) => {
                    let rate = self.signals[id].rate;
                    self.exprs.substitute(rate, rates)
                }
                Meaning::Stored(port) if self.part(port.element.index()).word == super::flatten::Word::I => {
                    self.not_a_displacement(symbol, "a momentum", span);
                    return None;
                }
                Meaning::Effort(_) => {
                    self.not_a_displacement(symbol, "an effort", span);
                    return None;
                }
                Meaning::Parameter(_) => continue,
                _ => {
                    let own = self.exprs.sym(symbol);
                    self.rate_of(own, span)?
                }
            };
            terms.push(self.exprs.mul(&[slope, rate]));
        }
        Some(self.exprs.add(&terms))
    }

    fn not_a_displacement(&mut self, symbol: Symbol, what: &str, span: Span) {
        let name = self.exprs.name(symbol).to_string();
        let d =
            Diagnostic::error(codes::L006, format!("a constraint cannot hold {what}"), span, format!("reads `{name}`"));
        self.fault(d.hint("constrain displacements or flows; for a relation between efforts use rSe, rSf or a law"));
    }

    /// Coefficients may read what is known at an instant: no efforts, flows or rates.
    fn refuse_unknown(&mut self, expr: Expr, span: Span) -> Option<()> {
        let bad = self.exprs.symbols_of(expr).into_iter().find(|s| match self.meaning(*s) {
            Some(Meaning::Effort(_) | Meaning::Flow(_)) => true,
            Some(Meaning::Rate(of)) => !matches!(self.meaning(of), Some(Meaning::Input(_))),
            _ => false,
        });
        match bad {
            None => Some(()),
            Some(symbol) => {
                self.not_a_displacement(symbol, "this", span);
                None
            }
        }
    }

    /// Builds the constraints into the graph, behind all bonds that are drawn.
    pub fn build_constraints(&mut self, graph: &mut BondGraph, relations: &[Relation]) {
        for relation in relations {
            self.build(graph, relation);
        }
    }

    fn build(&mut self, graph: &mut BondGraph, r: &Relation) {
        let (scope, c, _) = &self.flat.constraints[r.at];
        let name = format!("{}{}", self.flat.names.scopes[*scope].prefix, c.name.text);
        let minus_rest = self.exprs.neg(r.rest);
        let doc_label = self.sources.slice(c.left.span.to(c.right.span)).to_string();
        let node = new_element(graph, format!("{name}.0"), Kind::Zero, r.span, String::new());
        let zc = new_element(graph, name.clone(), Kind::ZeroCompliance { flow: minus_rest }, r.span, doc_label);
        for (n, (junction, a)) in self.by_junction(graph, r, &name).into_iter().enumerate() {
            let modulus = self.exprs.neg(a);
            match modulus {
                ONE => self.new_bond(graph, (junction, ""), (node, ""), r.span),
                MINUS_ONE => self.new_bond(graph, (node, ""), (junction, ""), r.span),
                _ => {
                    let tf = format!("{name}.tf{}", n + 1);
                    let tf = new_element(graph, tf, Kind::Transformer { modulus }, r.span, String::new());
                    self.new_bond(graph, (junction, ""), (tf, "in"), r.span);
                    self.new_bond(graph, (tf, "out"), (node, ""), r.span)
                }
            };
        }
        let bond = self.new_bond(graph, (zc, ""), (node, ""), r.span);
        let pair = self.reactions[r.at].clone();
        self.take_symbols(graph, bond, &pair);
        let multiplier = self.exprs.sym(pair.effort);
        graph.constraints.push(Constraint {
            name,
            expr: r.expr,
            holonomic: r.holonomic,
            element: zc,
            multiplier,
            span: r.span,
        });
    }

    /// The 1-junctions whose flows a relation reads, with their coefficients.
    fn by_junction(&mut self, graph: &mut BondGraph, r: &Relation, name: &str) -> Vec<(ElementId, Expr)> {
        let mut found: Vec<(ElementId, Expr)> = Vec::new();
        for (flow, a) in &r.terms {
            let Some(Meaning::Flow(bond)) = self.meaning(*flow) else { continue };
            let junction = self.one_junction(graph, bond, name, r.span);
            match found.iter_mut().find(|(j, _)| *j == junction) {
                Some((_, sum)) => *sum = self.exprs.add(&[*sum, *a]),
                None => found.push((junction, *a)),
            }
        }
        found.retain(|(_, a)| !self.exprs.is_zero(*a));
        found
    }

    /// The 1-junction to which the flow of a bond belongs; a new one in the bond if it belongs to none.
    fn one_junction(&mut self, graph: &mut BondGraph, bond: BondId, name: &str, span: Span) -> ElementId {
        if let Some(junction) = graph.junction_of(bond, true) {
            return junction;
        }
        let (from, to) = (graph.bonds[bond].from, graph.bonds[bond].to);
        let mut n = 1;
        let free = |n: usize| format!("{name}.1{}", if n == 1 { String::new() } else { format!("_{n}") });
        while graph.elements.values().any(|e| e.span == span && e.name == free(n)) {
            n += 1;
        }
        let junction = new_element(graph, free(n), Kind::One, span, String::new());
        let keeps_from = self.left_end(bond.index()).0 == to.element.index();
        let at = PortRef { element: junction, port: 0 };
        let new = BondId::new(graph.bonds.len());
        let moved = if keeps_from { to } else { from };
        graph.elements[junction].ports.push(Port { name: String::new(), bond, inward: keeps_from });
        let far = PortRef { element: junction, port: 1 };
        graph.elements[junction].ports.push(Port { name: String::new(), bond: new, inward: !keeps_from });
        if keeps_from {
            graph.bonds[bond].to = at
        } else {
            graph.bonds[bond].from = at
        };
        graph.elements[moved.element].ports[moved.port as usize].bond = new;
        let (new_from, new_to) = if keeps_from { (far, moved) } else { (moved, far) };
        let like = (graph.bonds[bond].effort, graph.bonds[bond].flow);
        let mut pair = self.internal_pair(new, like);
        if let Some(&(_, known)) = self.beyond.get(&bond.index()) {
            self.meanings[pair.effort.0 as usize] = None;
            self.mean(known, Meaning::Effort(new), pair.effort_in.clone());
            pair.effort = known;
        }
        graph.common.entry(moved.element).and_modify(|common| *common = if *common == bond { new } else { *common });
        let pseudo = graph.bonds[bond].pseudo;
        graph.bonds.push(Bond {
            from: new_from,
            to: new_to,
            name: String::new(),
            effort: pair.effort,
            flow: pair.flow,
            pseudo,
            span,
        });
        junction
    }

    /// Symbols for a bond that nobody drew, with the dimensions of others.
    fn internal_pair(&mut self, bond: BondId, like: (Symbol, Symbol)) -> Pair {
        let (effort_in, flow_in) = (self.quantity(like.0), self.quantity(like.1));
        let number = bond.index() + 1;
        let effort = self.fresh(&format!("e{number}"), Facts::default());
        let flow = self.fresh(&format!("f{number}"), Facts::default());
        self.mean(effort, Meaning::Effort(bond), effort_in.clone());
        self.mean(flow, Meaning::Flow(bond), flow_in.clone());
        Pair { effort, flow, effort_in, flow_in }
    }

    /// A new bond between two elements.
    fn new_bond(
        &mut self,
        graph: &mut BondGraph,
        from: (ElementId, &str),
        to: (ElementId, &str),
        span: Span,
    ) -> BondId {
        let bond = BondId::new(graph.bonds.len());
        let mut end = |(element, name): (ElementId, &str), inward: bool| {
            let ports = &mut graph.elements[element].ports;
            ports.push(Port { name: name.to_string(), bond, inward });
            PortRef { element, port: ports.len() as u32 - 1 }
        };
        let (from, to) = (end(from, false), end(to, true));
        let like = [from, to].into_iter().find_map(|p| {
            let first = graph.elements[p.element].ports.first()?.bond;
            graph
                .bonds
                .get(first)
                .filter(|_| matches!(graph.elements[p.element].kind, Kind::One))
                .map(|b| (b.effort, b.flow))
        });
        let pair = match like {
            Some(like) => self.internal_pair(bond, like),
            None => self.internal_pair(bond, (self.time, self.time)),
        };
        let bond_data =
            Bond { from, to, name: String::new(), effort: pair.effort, flow: pair.flow, pseudo: false, span };
        graph.bonds.push(bond_data)
    }

    /// Gives a bond the symbols that expressions have used for it already.
    fn take_symbols(&mut self, graph: &mut BondGraph, bond: BondId, pair: &Pair) {
        for old in [graph.bonds[bond].effort, graph.bonds[bond].flow] {
            self.meanings[old.0 as usize] = None;
        }
        graph.bonds[bond].effort = pair.effort;
        graph.bonds[bond].flow = pair.flow;
        self.mean(pair.effort, Meaning::Effort(bond), pair.effort_in.clone());
        self.mean(pair.flow, Meaning::Flow(bond), pair.flow_in.clone());
    }
}

fn new_element(graph: &mut BondGraph, name: String, kind: Kind, span: Span, label: String) -> ElementId {
    graph.elements.push(Element { name, kind, ports: Vec::new(), span, label })
}
