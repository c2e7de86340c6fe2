//! `constraint` statements built into the graph: a zero compliance behind (modulated) transformers.
//!
//! A constraint on displacements says at velocity level `Σ a_k f_k + a_t = 0`. Its ZC stands at a new 0-junction, which
//! is fed from the 1-junction of every flow through a transformer of modulus `-a_k`, so that the effort `λ` of the ZC adds
//! `a_k λ` to the efforts that drive the flow: the gradient of the constraint times its multiplier.

use std::collections::{BTreeMap, BTreeSet};

use super::assemble::cell_of;
use super::builder::{Builder, Pair, Role};
use super::dimension::Quantity;
use super::flatten::Held;
use super::structure::Structure;
use super::value::Reading;
use super::{BondId, Constraint, ElementId, Kind, Meaning};
use crate::algebra::{Expr, Exprs, Facts, MINUS_ONE, Node, ONE, Symbol, ZERO};
use crate::ast;
use crate::diagnostic::{Diagnostic, codes};
use crate::ids::Id;
use crate::span::Span;

/// A constraint whose sides have been read.
pub(super) struct Sides {
    /// Index into the constraints of the model.
    at: usize,
    /// Left side less right side; of an inequality the greater side less the other.
    expr: Expr,
    /// The coefficient of restitution, of an inequality.
    restitution: Option<Expr>,
    span: Span,
}

/// A displacement that a drawn zero compliance holds at zero: its bonds say on what it acts.
pub(super) struct HeldDisplacement {
    /// The element.
    pub part: usize,
    /// The displacement, whose rate is the flow of its bond.
    pub expr: Expr,
    /// Where it stands.
    pub span: Span,
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
    /// The coefficient of restitution, of an inequality.
    restitution: Option<Expr>,
    span: Span,
}

impl Relation {
    /// The flows that it reads.
    pub fn flows(&self) -> impl Iterator<Item = Symbol> + '_ {
        self.terms.iter().map(|t| t.0)
    }
}

impl<'a> Builder<'a, '_> {
    /// Reads the sides of all constraints.
    pub fn constraint_sides(&mut self) -> Vec<Sides> {
        let flat = self.flat;
        let mut all = Vec::new();
        for (at, Held { name, here, ast: c, span }) in flat.constraints.iter().enumerate() {
            let before = self.faults.len();
            let cx = Reading::of(*here, name);
            let (left, right) = (self.number(&cx, &c.left), self.number(&cx, &c.right));
            if let (Some(left), Some(right)) = (left, right) {
                self.equal(&left.quantity, &right.quantity, *span, "the two sides");
                let (greater, smaller) = match c.sides {
                    ast::Sides::AtMost => (right.expr, left.expr),
                    _ => (left.expr, right.expr),
                };
                let expr = self.exprs.sub(greater, smaller);
                if let Some(restitution) = self.restitution(&cx, c) {
                    all.push(Sides { at, expr, restitution, span: *span });
                }
            }
            self.met_in(*here, before);
        }
        all
    }

    /// Takes displacements out of laws and constraints that do not depend on them, as those of points of one body do not
    /// depend on where it is: otherwise they would be divided by what vanishes wherever the constraint is met.
    pub fn leave_out_idle(&mut self, kinds: &mut [Option<Kind>], sides: &mut [Sides]) {
        let mut wholes: Vec<Expr> = Vec::new();
        let mut visit = |x: &Exprs, e: Expr| wholes.extend(x.has_wholes(e).then_some(e));
        kinds.iter_mut().flatten().for_each(|kind| kind.for_each_expr(&mut |e| visit(&self.exprs, *e)));
        sides.iter().for_each(|side| visit(&self.exprs, side.expr));
        self.held_displacements.iter().for_each(|held| visit(&self.exprs, held.expr));
        self.carried.values().for_each(|&e| visit(&self.exprs, e));
        let displacement =
            |s: Symbol| matches!(self.role(s), Some(Role::Known(Meaning::Signal(_) | Meaning::Stored(_))));
        let idle: BTreeSet<Symbol> =
            wholes.iter().flat_map(|&e| self.exprs.symbols_of(e)).filter(|&s| displacement(s)).collect();
        let short = self.exprs.without_idle(&wholes, &|s| idle.contains(&s));
        let short: BTreeMap<Expr, Expr> = wholes.into_iter().zip(short).collect();
        let mut put = |e: &mut Expr| *e = short.get(e).copied().unwrap_or(*e);
        kinds.iter_mut().flatten().for_each(|kind| kind.for_each_expr(&mut put));
        sides.iter_mut().for_each(|side| put(&mut side.expr));
        self.held_displacements.iter_mut().for_each(|held| put(&mut held.expr));
        self.carried.values_mut().for_each(put);
    }

    /// The coefficient of restitution of an inequality, 0 if none is given. The outer `None`: at fault.
    #[allow(clippy::option_option)]
    fn restitution(&mut self, cx: &Reading<'_>, c: &'a ast::Constraint) -> Option<Option<Expr>> {
        const HINT: &str = "write a number from 0 to 1: `(restitution = 0.8)`";
        if c.sides == ast::Sides::Equal {
            return Some(None);
        }
        let title = "a constraint on one side that cannot be read";
        let mut found = self.exprs.int(0);
        for (number, arg) in c.args.iter().enumerate() {
            let known = arg.label.as_ref().is_some_and(|l| l.port.is_none() && l.name.text == "restitution");
            if !known || number > 0 {
                let why = if known { "this is given twice" } else { "it takes no such value" };
                self.fault(Diagnostic::error(codes::L014, title, arg.span, why).hint(HINT));
                return None;
            }
            let value = self.number(cx, &arg.value)?;
            self.equal(&value.quantity, &Quantity::NONE, arg.span, "a coefficient and a number");
            if !self.only_parameters(value.expr, arg.value.span, "a coefficient of restitution") {
                return None;
            }
            if self.value_of(value.expr).is_some_and(|e| !(0.0..=1.0).contains(&e)) {
                let why = "at the given parameters it is not between 0 and 1";
                self.fault(Diagnostic::error(codes::L014, title, arg.span, why).hint(HINT));
                return None;
            }
            found = value.expr;
        }
        Some(Some(found))
    }

    /// The relations between flows that constraints ask for, with the rates of signals put in.
    pub fn relations(&mut self, sides: &[Sides], rates: &BTreeMap<Symbol, Expr>) -> Vec<Relation> {
        let relation = |s: &Sides| {
            let before = self.faults.len();
            let relation = self.relation(s, rates);
            self.met_in(self.flat.constraints[s.at].here, before);
            relation
        };
        sides.iter().filter_map(relation).collect()
    }

    fn relation(&mut self, sides: &Sides, rates: &BTreeMap<Symbol, Expr>) -> Option<Relation> {
        let expr = self.exprs.substitute(sides.expr, rates);
        let holonomic = !self.exprs.depends_on_any(expr, &|s| matches!(self.meaning(s), Some(Meaning::Flow(_))));
        if holonomic && self.jumps_in_time(expr) {
            let d = Diagnostic::error(
                codes::L015,
                "a constraint on displacements that jumps",
                sides.span,
                "from one instant to the next it asks for other places",
            );
            self.fault(d.hint("no force moves a body at once: let it change over some time, `min(t/0.1 s, 1)`"));
            return None;
        }
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
        // What holds whatever moves, as the closure of a plane loop across its plane does, carries nothing.
        if terms.is_empty() && !(self.exprs.is_zero(expr) && sides.restitution.is_none()) {
            let missed = self.value_of(expr).filter(|missed| *missed != 0.0 && sides.restitution.is_none());
            let why = missed.map_or("reads no displacement or flow".to_string(), |missed| {
                format!("its sides are {} apart, whatever moves", missed.abs())
            });
            let hint = match missed {
                Some(_) => {
                    "name displacements of elements (`spring.q`), or states whose rate is a flow; \
                     a loop of bodies that move in a plane has to fit across it"
                }
                None => "name displacements of elements (`spring.q`), or states whose rate is a flow",
            };
            let d = Diagnostic::error(codes::L006, "a constraint on nothing that moves", sides.span, why);
            self.fault(d.hint(hint));
            return None;
        }
        // Numbers whose sum is 0 are not so in floats.
        let expr = if terms.is_empty() { ZERO } else { expr };
        Some(Relation { at: sides.at, expr, holonomic, terms, rest, restitution: sides.restitution, span: sides.span })
    }

    /// Whether an expression is known to jump while nothing moves: where a condition on time changes its side, it is another by a
    /// number. What is another by what varies, as a ramp that begins at an instant, may begin with 0.
    pub(super) fn jumps_in_time(&mut self, expr: Expr) -> bool {
        let conditions: BTreeSet<Expr> = self
            .exprs
            .below(&[expr], &|_| true)
            .into_iter()
            .filter_map(|part| match *self.exprs.node(part) {
                Node::Select(condition, ..) => Some(condition),
                _ => None,
            })
            .collect();
        conditions.into_iter().any(|condition| {
            if !self.reads_only(condition, true) {
                return false;
            }
            let [before, after] = [false, true].map(|holds| self.exprs.in_branch(expr, condition, holds));
            let difference = self.exprs.sub(after, before);
            !self.exprs.is_zero(difference) && self.reads_only(difference, false)
        })
    }

    /// Whether an expression reads parameters alone; with `time`, nothing but these and time, which it reads.
    fn reads_only(&self, expr: Expr, time: bool) -> bool {
        let symbols = self.exprs.symbols_of(expr);
        let fixed = |s: &Symbol| matches!(self.meaning(*s), Some(Meaning::Parameter(_)));
        let told = |s: &Symbol| fixed(s) || time && matches!(self.meaning(*s), Some(Meaning::Time));
        symbols.iter().all(told) && (!time || !symbols.iter().all(fixed))
    }

    /// The rate of an expression of displacements.
    fn speed_of(&mut self, expr: Expr, rates: &BTreeMap<Symbol, Expr>, span: Span) -> Option<Expr> {
        let mut terms = Vec::new();
        for symbol in self.exprs.symbols_of(expr) {
            let slope = self.exprs.derivative(expr, symbol);
            let rate = match self.role(symbol)? {
                Role::Known(Meaning::Signal(id)) => {
                    let rate = self.signals[id].rate?;
                    self.exprs.substitute(rate, rates)
                }
                Role::Known(Meaning::Stored(port))
                    if self.part(port.element.index()).word == super::flatten::Word::I =>
                {
                    self.not_a_displacement(symbol, "a momentum", span);
                    return None;
                }
                Role::Known(Meaning::Effort(_)) => {
                    self.not_a_displacement(symbol, "an effort", span);
                    return None;
                }
                Role::Reaction => {
                    self.not_a_displacement(symbol, "what belongs to a constraint", span);
                    return None;
                }
                Role::Known(Meaning::Parameter(_)) => continue,
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
        let bad = self.exprs.symbols_of(expr).into_iter().find(|s| match self.role(*s) {
            Some(Role::Known(Meaning::Effort(_) | Meaning::Flow(_)) | Role::Reaction) => true,
            Some(Role::Known(Meaning::Rate(of))) => !matches!(self.meaning(of), Some(Meaning::Input(_))),
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

    /// Builds the constraints into the structure, behind all bonds that are drawn.
    pub fn build_constraints(&mut self, structure: &mut Structure, relations: &[Relation]) -> Vec<Constraint> {
        let mut all: Vec<Constraint> = relations.iter().map(|relation| self.build(structure, relation)).collect();
        for HeldDisplacement { part, expr, span } in std::mem::take(&mut self.held_displacements) {
            let element = ElementId::new(part);
            let bond = structure.elements[element].ports[0].bond;
            let multiplier = self.exprs.sym(structure.bonds[bond].effort);
            let name = self.part(part).name.clone();
            // As in a plane loop across its plane: numbers whose sum is 0 are not so in floats.
            let expr = if self.exprs.is_zero(expr) { ZERO } else { expr };
            all.push(Constraint { name, expr, holonomic: true, drawn: true, element, multiplier, span });
        }
        all
    }

    fn build(&mut self, structure: &mut Structure, r: &Relation) -> Constraint {
        let Held { name, ast: c, here, .. } = &self.flat.constraints[r.at];
        let name = name.clone();
        let first = structure.elements.len();
        let minus_rest = self.exprs.neg(r.rest);
        let label = self.sources.slice(c.left.span.to(c.right.span)).to_string();
        let node = structure.add(format!("{name}.0"), Kind::Zero, r.span, String::new());
        let zc = structure.add(name.clone(), Kind::ZeroCompliance { flow: minus_rest }, r.span, label);
        for (n, (junction, a)) in self.by_junction(structure, r, &name).into_iter().enumerate() {
            let modulus = self.exprs.neg(a);
            match modulus {
                ONE => self.new_bond(structure, (junction, ""), (node, ""), r.span),
                MINUS_ONE => self.new_bond(structure, (node, ""), (junction, ""), r.span),
                _ => {
                    let tf = format!("{name}.tf{}", n + 1);
                    let tf = structure.add(tf, Kind::Transformer { modulus }, r.span, String::new());
                    self.new_bond(structure, (junction, ""), (tf, "in"), r.span);
                    self.new_bond(structure, (tf, "out"), (node, ""), r.span);
                }
            }
        }
        let Pair { effort, flow, effort_in, flow_in } = self.reactions[r.at].clone();
        let bond = structure.join((zc, ""), (node, ""), (effort, flow), r.span);
        self.mean(effort, Meaning::Effort(bond), effort_in);
        self.mean(flow, Meaning::Flow(bond), flow_in);
        let cell = cell_of(self.flat.names.turn_around(*here));
        (first..structure.elements.len()).for_each(|at| structure.elements[ElementId::new(at)].cell = cell);
        let multiplier = self.exprs.sym(effort);
        let constraint = Constraint {
            name,
            expr: r.expr,
            holonomic: r.holonomic,
            drawn: false,
            element: zc,
            multiplier,
            span: r.span,
        };
        if let Some(restitution) = r.restitution {
            self.one_sided(&constraint, r.rest, flow, restitution);
        }
        constraint
    }

    /// The 1-junctions whose flows a relation reads, with their coefficients.
    fn by_junction(&mut self, structure: &mut Structure, r: &Relation, name: &str) -> Vec<(ElementId, Expr)> {
        let mut found: Vec<(ElementId, Expr)> = Vec::new();
        for (flow, a) in &r.terms {
            let Some(Meaning::Flow(bond)) = self.meaning(*flow) else { continue };
            let junction = self.one_junction(structure, bond, name, r.span);
            match found.iter_mut().find(|(j, _)| *j == junction) {
                Some((_, sum)) => *sum = self.exprs.add(&[*sum, *a]),
                None => found.push((junction, *a)),
            }
        }
        found.retain(|(_, a)| !self.exprs.is_zero(*a));
        found
    }

    /// The 1-junction to which the flow of a bond belongs; a new one in the bond if it belongs to none.
    fn one_junction(&mut self, structure: &mut Structure, bond: BondId, name: &str, span: Span) -> ElementId {
        if let Some(junction) = structure.junction_of(bond, true) {
            return junction;
        }
        let keeps_from = self.left_end(bond.index()).0 == structure.bonds[bond].to.element.index();
        let name = structure.unused(&format!("{name}.1"), span);
        let new = BondId::new(structure.bonds.len());
        let (effort, flow) = (structure.bonds[bond].effort, structure.bonds[bond].flow);
        let pair = match self.beyond.get(&bond.index()).copied() {
            Some((_, known)) => {
                self.mean(known, Meaning::Effort(new), self.quantity(effort));
                (known, self.internal_flow(new, flow))
            }
            None => self.internal_pair(new, (effort, flow)),
        };
        structure.split(bond, name, keeps_from, pair, span)
    }

    /// Symbols for a bond that nobody drew, with the dimensions of others.
    fn internal_pair(&mut self, bond: BondId, like: (Symbol, Symbol)) -> (Symbol, Symbol) {
        let effort_in = self.quantity(like.0);
        let effort = self.fresh(&format!("e{}", bond.index() + 1), Facts::default());
        self.mean(effort, Meaning::Effort(bond), effort_in);
        (effort, self.internal_flow(bond, like.1))
    }

    fn internal_flow(&mut self, bond: BondId, like: Symbol) -> Symbol {
        let flow_in = self.quantity(like);
        let flow = self.fresh(&format!("f{}", bond.index() + 1), Facts::default());
        self.mean(flow, Meaning::Flow(bond), flow_in);
        flow
    }

    /// A new bond between two elements, with the dimensions of a 1-junction at one of its ends.
    fn new_bond(&mut self, structure: &mut Structure, from: (ElementId, &str), to: (ElementId, &str), span: Span) {
        let bond = BondId::new(structure.bonds.len());
        let like = [from.0, to.0].into_iter().find_map(|element| structure.variables_of_one(element));
        let pair = self.internal_pair(bond, like.unwrap_or((self.time, self.time)));
        structure.join(from, to, pair, span);
    }
}
