//! Set-valued laws: complementarity, switches, Coulomb friction. An element with such a law has several branches, of which
//! one holds at a time; with one branch chosen for each, the graph is a graph like any other, a *mode* of the model.

use super::builder::Builder;
use super::value::Reading;
use super::{Action, BondGraph, Clause, Constraint, ElementId, Kind, ResistorLaw, Trigger};
use crate::algebra::{Comparison, Expr, Symbol};
use crate::ast::{self, Arg, BinaryOp, ExprKind};
use crate::diagnostic::{Diagnostic, codes};
use crate::ids::Id;
use crate::span::Span;

/// A law that is a relation with corners: on each branch it is an ordinary law, and bounds say where the branch ends.
#[derive(Debug, Clone)]
pub struct SetValuedLaw {
    /// The element.
    pub element: ElementId,
    /// Its keyword in the text, `R` or `Sw`.
    pub word: &'static str,
    /// Its branches, at least two.
    pub branches: Vec<Branch>,
    /// The branch that the element has in this graph.
    pub present: usize,
    /// The constraint that holds on the first branch, of a constraint on one side.
    pub constraint: Option<Constraint>,
    /// Where it stands.
    pub span: Span,
}

/// One branch of a set-valued law.
#[derive(Debug, Clone)]
pub struct Branch {
    /// Its name: `on` and `off`, of friction `stick`, `forward` and `backward`.
    pub name: &'static str,
    /// What the element is on the branch.
    pub kind: Kind,
    /// Where it ends.
    pub bounds: Vec<Bound>,
    /// The branch instead of it while impulses are shared out: an effort that is bounded makes none, and contacts make those
    /// that fit.
    pub released: Option<usize>,
}

/// An end of a branch.
#[derive(Debug, Clone)]
pub struct Bound {
    /// What ends it.
    pub kind: BoundKind,
    /// The branch beyond it.
    pub next: usize,
    /// What happens there, if storages take an impulse.
    pub impact: Option<Impact>,
}

/// Two sides of a gap meet.
#[derive(Debug, Clone)]
pub struct Impact {
    /// The rate of the gap.
    pub rate: Expr,
    /// The flow of the element after the impact: that before it, turned round by the coefficient of restitution.
    pub action: Action,
    /// The flow with which the gap stays as it is.
    pub still: Expr,
}

/// What ends a branch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BoundKind {
    /// A number that is never negative while the branch holds.
    Margin(Expr),
    /// A condition, true where the branch does not hold.
    Command(Expr),
}

impl BoundKind {
    /// The number or the condition.
    pub fn expr(self) -> Expr {
        let (BoundKind::Margin(e) | BoundKind::Command(e)) = self;
        e
    }
}

impl SetValuedLaw {
    /// The branch that the element has.
    pub fn branch(&self) -> &Branch {
        &self.branches[self.present]
    }

    pub(super) fn expressions(&self) -> Vec<Expr> {
        let mut all = Vec::new();
        self.clone().for_each_expr(&mut |e| all.push(*e));
        all
    }

    pub(super) fn for_each_expr(&mut self, visit: &mut dyn FnMut(&mut Expr)) {
        for branch in &mut self.branches {
            branch.kind.for_each_expr(visit);
            for bound in &mut branch.bounds {
                let (BoundKind::Margin(e) | BoundKind::Command(e)) = &mut bound.kind;
                visit(e);
                if let Some(impact) = &mut bound.impact {
                    visit(&mut impact.rate);
                    visit(&mut impact.action.value);
                    visit(&mut impact.still);
                }
            }
        }
        self.constraint.iter_mut().for_each(|c| visit(&mut c.expr));
    }
}

impl BondGraph {
    /// The keyword of an element in the text.
    pub fn word(&self, element: ElementId) -> &'static str {
        let law = self.set_valued.iter().find(|law| law.element == element && law.constraint.is_none());
        law.map_or_else(|| self.elements[element].kind.word(), |law| law.word)
    }

    /// The branch that each set-valued law has, in their order.
    pub fn mode(&self) -> Vec<usize> {
        self.set_valued.iter().map(|law| law.present).collect()
    }

    /// The same model with these branches of its set-valued laws, one for each.
    ///
    /// # Panics
    /// A law has no such branch.
    #[must_use]
    pub fn in_mode(&self, branches: &[usize]) -> BondGraph {
        let mut graph = self.clone();
        graph.clauses.retain(|clause| clause.bound.is_none());
        for (at, &branch) in branches.iter().enumerate() {
            let law = &mut graph.set_valued[at];
            law.present = branch;
            graph.elements[law.element].kind = law.branches[branch].kind.clone();
            if let Some(constraint) = &law.constraint {
                graph.constraints.retain(|c| c.element != constraint.element);
                graph.constraints.extend((branch == CLOSED).then(|| constraint.clone()));
            }
        }
        let bounds = graph.bounds_of_branches();
        graph.clauses.extend(bounds);
        graph
    }

    /// The events at which the present branches end.
    fn bounds_of_branches(&mut self) -> Vec<Clause> {
        let mut clauses = Vec::new();
        for (at, law) in self.set_valued.iter().enumerate() {
            let branch = law.branch();
            for (number, bound) in branch.bounds.iter().enumerate() {
                let condition = match bound.kind {
                    BoundKind::Command(condition) => condition,
                    BoundKind::Margin(margin) => {
                        let zero = self.exprs.int(0);
                        self.exprs.compare(Comparison::Lt, margin, zero)
                    }
                };
                let name = format!("{} ends `{}`", self.elements[law.element].name, branch.name);
                let (trigger, span) = (Trigger::Becomes(condition), law.span);
                let actions = bound.impact.iter().map(|impact| impact.action.clone()).collect();
                clauses.push(Clause { name, trigger, actions, bound: Some((at, number)), span });
            }
        }
        clauses
    }

    /// What a mode is called: `d1 on, d2 off`.
    pub fn mode_name(&self) -> String {
        let name = |law: &SetValuedLaw| format!("{} {}", self.elements[law.element].name, law.branch().name);
        self.set_valued.iter().map(name).collect::<Vec<_>>().join(", ")
    }
}

/// The branch on which a constraint on one side holds.
const CLOSED: usize = 0;
const OPEN: usize = 1;

/// Whether an argument says that something is never negative.
fn is_comparison(arg: &Arg) -> bool {
    let compares = |e: &ast::Expr| match &e.kind {
        ExprKind::Binary(b) => matches!(b.op, BinaryOp::Le | BinaryOp::Ge | BinaryOp::Lt | BinaryOp::Gt),
        _ => false,
    };
    arg.label.is_none() && compares(&arg.value)
}

fn label_of(arg: &Arg) -> Option<&str> {
    arg.label.as_ref().filter(|l| l.port.is_none()).map(|l| l.name.text.as_str())
}

/// Whether the law of a resistor is set-valued.
pub(super) fn is_set_valued(args: &[Arg]) -> bool {
    args.iter().any(|a| is_comparison(a) || matches!(label_of(a), Some("friction" | "stiction")))
}

impl<'a> Builder<'a, '_> {
    /// Reads a complementarity or a friction law of a resistor.
    pub(super) fn set_valued_resistor(&mut self, part: usize) -> Option<Kind> {
        let p = self.part(part);
        if let Some(port) = p.ports.first() {
            let title = format!("a set-valued law belongs to one port, and R `{}` has a list of them", p.name);
            let fault = Diagnostic::error(codes::L014, title, port.span, "no list here");
            self.fault(fault.hint("give each port an element of its own"));
            return None;
        }
        let args = &p.ast.args;
        match args.iter().any(is_comparison) {
            true => self.complementarity(part, args),
            false => self.friction(part, args),
        }
    }

    fn odd_law(&mut self, span: Span, why: &str, hint: &str) -> Option<Kind> {
        let fault = Diagnostic::error(codes::L014, "a set-valued law that cannot be read", span, why);
        self.fault(fault.hint(hint));
        None
    }

    /// `R:d(0 <= f, 0 <= -e)`: both are never negative, and one of them is zero.
    fn complementarity(&mut self, part: usize, args: &'a [Arg]) -> Option<Kind> {
        const FORM: &str = "write two numbers of which neither is negative and one is zero: `R:diode(0 <= f, 0 <= -e)`";
        let span = self.part(part).ast.span;
        let [first, second] = args else {
            return self.odd_law(span, "a complementarity has two sides", FORM);
        };
        if let Some(odd) = [first, second].into_iter().find(|a| !is_comparison(a)) {
            return self.odd_law(odd.span, "this says of nothing that it is never negative", FORM);
        }
        let margins = [self.margin(part, &first.value), self.margin(part, &second.value)];
        let [a, b] = [margins[0]?, margins[1]?];
        let kinds = [self.vanishing(part, a, first.span), self.vanishing(part, b, second.span)];
        let [a_kind, b_kind] = kinds;
        let (a_kind, b_kind) = (a_kind?, b_kind?);
        let off_is_second = matches!(b_kind, Kind::FlowSource { .. }) && !matches!(a_kind, Kind::FlowSource { .. })
            || matches!(a_kind, Kind::EffortSource { .. }) && !matches!(b_kind, Kind::EffortSource { .. });
        let names = if off_is_second { ["on", "off"] } else { ["off", "on"] };
        let branch = |name, kind, margin, next| Branch {
            name,
            kind,
            bounds: vec![Bound { kind: BoundKind::Margin(margin), next, impact: None }],
            released: None,
        };
        let branches = vec![branch(names[0], a_kind, b, 1), branch(names[1], b_kind, a, 0)];
        Some(self.add_set_valued(part, "R", branches))
    }

    /// The greater side less the smaller one.
    fn margin(&mut self, part: usize, e: &'a ast::Expr) -> Option<Expr> {
        let ExprKind::Binary(b) = &e.kind else { return None };
        let p = self.part(part);
        let cx = Reading { own: Some(part), law: true, ..Reading::of(p.here, &p.name) };
        let (left, right) = (self.number(&cx, &b.left), self.number(&cx, &b.right));
        let (left, right) = (left?, right?);
        self.equal(&left.quantity, &right.quantity, e.span, "the two sides");
        let up = matches!(b.op, BinaryOp::Le | BinaryOp::Lt);
        let (small, great) = if up { (left.expr, right.expr) } else { (right.expr, left.expr) };
        Some(self.exprs.sub(great, small))
    }

    /// What an element is while this vanishes: a source if it reads one of effort and flow alone, else a resistor.
    fn vanishing(&mut self, part: usize, margin: Expr, span: Span) -> Option<Kind> {
        let pair = self.pairs[self.wire_at(part, 0)?].clone();
        let reads = [pair.effort, pair.flow].map(|s| self.exprs.depends_on(margin, s));
        let own = match reads {
            [false, false] => {
                let why = "this reads neither the effort nor the flow of the element";
                let hint = "a gap that closes is a constraint: `constraint stop: gap >= 0`";
                return self.odd_law(span, why, hint);
            }
            [true, true] => None,
            [true, false] => Some(pair.effort),
            [false, true] => Some(pair.flow),
        };
        let alone = own.and_then(|own| {
            let (factors, rest) = self.exprs.linear_in(margin, &[own])?;
            let (rest, factor) = (self.exprs.neg(rest), *factors.first()?);
            Some((own, self.exprs.div(rest, factor)))
        });
        Some(match alone {
            Some((own, value)) if own == pair.effort => Kind::EffortSource { value },
            Some((_, value)) => Kind::FlowSource { value },
            None => Kind::Resistor(vec![ResistorLaw::Implicit(margin)]),
        })
    }

    /// `R:pad(friction = mu*N)`: an effort against the motion, and while it sticks any effort up to that.
    fn friction(&mut self, part: usize, args: &'a [Arg]) -> Option<Kind> {
        const FORM: &str = "write the effort of friction, and where more is needed to set it moving that too: \
                            `R:pad(friction = mu*N, stiction = mu0*N)`";
        let mut found: [Option<Expr>; 2] = [None, None];
        for arg in args {
            let slot = match label_of(arg) {
                Some("friction") => 0,
                Some("stiction") => 1,
                _ => return self.odd_law(arg.span, "friction takes no such value", FORM),
            };
            if found[slot].is_some() {
                return self.odd_law(arg.span, "this is given twice", FORM);
            }
            let p = self.part(part);
            let cx = Reading { own: Some(part), ..Reading::of(p.here, &p.name) };
            let value = self.number(&cx, &arg.value)?;
            let quantity = self.pairs[self.wire_at(part, 0)?].effort_in.clone();
            self.equal_by_law(&value.quantity, &quantity, part);
            found[slot] = Some(value.expr);
        }
        let Some(slide) = found[0] else {
            return self.odd_law(self.part(part).ast.span, "the effort of friction is missing", FORM);
        };
        let stick = found[1].unwrap_or(slide);
        let pair = self.pairs[self.wire_at(part, 0)?].clone();
        let (e, f) = (self.exprs.sym(pair.effort), self.exprs.sym(pair.flow));
        let (back, minus_f) = (self.exprs.neg(slide), self.exprs.neg(f));
        let (above, below) = (self.exprs.sub(stick, e), self.exprs.add(&[stick, e]));
        let margin = |margin, next| Bound { kind: BoundKind::Margin(margin), next, impact: None };
        let slides = |name, value, bound| Branch {
            name,
            kind: Kind::EffortSource { value },
            bounds: vec![bound],
            released: None,
        };
        let still = Kind::FlowSource { value: self.exprs.int(0) };
        let branches = vec![
            slides("forward", slide, margin(f, 1)),
            Branch { name: "stick", kind: still, bounds: vec![margin(above, 0), margin(below, 2)], released: Some(0) },
            slides("backward", back, margin(minus_f, 1)),
        ];
        Some(self.add_set_valued(part, "R", branches))
    }

    /// `Sw:s(on = t > 1)`: no effort while it is on, no flow while it is off.
    pub(super) fn switch(&mut self, part: usize) -> Option<Kind> {
        let args = &self.part(part).ast.args;
        let hint = "write when it is on: `Sw:s(on = t > 1 s)`";
        let [arg] = &args[..] else {
            return self.odd_law(self.part(part).ast.span, "a switch takes one condition", hint);
        };
        if !matches!(label_of(arg), None | Some("on")) {
            return self.odd_law(arg.span, "a switch takes no such value", hint);
        }
        let p = self.part(part);
        let cx = Reading { own: Some(part), law: true, ..Reading::of(p.here, &p.name) };
        let on = self.truth(&cx, &arg.value)?.expr;
        let (off, zero) = (self.exprs.not(on), self.exprs.int(0));
        let branch = |name, kind, ends, next| Branch {
            name,
            kind,
            bounds: vec![Bound { kind: BoundKind::Command(ends), next, impact: None }],
            released: None,
        };
        let branches = vec![
            branch("on", Kind::EffortSource { value: zero }, off, 1),
            branch("off", Kind::FlowSource { value: zero }, on, 0),
        ];
        Some(self.add_set_valued(part, "Sw", branches))
    }

    /// A constraint on one side, built as `constraint` with the flow of its ZC: `rest` is the part of the rate of its gap that
    /// this flow does not tell.
    pub(super) fn one_sided(&mut self, constraint: &Constraint, rest: Expr, flow: Symbol, restitution: Expr) {
        let own = self.exprs.sym(flow);
        let rate = self.exprs.add(&[own, rest]);
        let still = self.exprs.neg(rest);
        let impact = constraint.holonomic.then(|| {
            let back = self.exprs.mul(&[restitution, rate]);
            let value = self.exprs.sub(still, back);
            let name = format!("{}.f", constraint.name);
            let impulse = Some(self.impulse_of(&name, flow, constraint.span));
            Impact { rate, action: Action { name, target: flow, value, impulse, span: constraint.span }, still }
        });
        let zero = self.exprs.int(0);
        let margin = if constraint.holonomic { constraint.expr } else { rate };
        let bound = |margin, next, impact| vec![Bound { kind: BoundKind::Margin(margin), next, impact }];
        let branches = vec![
            Branch {
                name: "closed",
                kind: Kind::ZeroCompliance { flow: still },
                bounds: bound(constraint.multiplier, OPEN, None),
                released: Some(OPEN),
            },
            Branch {
                name: "open",
                kind: Kind::EffortSource { value: zero },
                bounds: bound(margin, CLOSED, impact),
                released: None,
            },
        ];
        self.set_valued.push(SetValuedLaw {
            element: constraint.element,
            word: "constraint",
            branches,
            present: CLOSED,
            constraint: Some(constraint.clone()),
            span: constraint.span,
        });
    }

    fn add_set_valued(&mut self, part: usize, word: &'static str, branches: Vec<Branch>) -> Kind {
        let kind = branches[0].kind.clone();
        let (element, span) = (ElementId::new(part), self.part(part).ast.span);
        self.set_valued.push(SetValuedLaw { element, word, branches, present: 0, constraint: None, span });
        kind
    }
}
