//! What happens at events: `when`.

use std::collections::BTreeMap;

use super::builder::{Builder, HeldDraft, Value};
use super::dimension::Quantity;
use super::flatten::Clause as Written;
use super::value::Reading;
use super::{Action, Clause, HeldKind, Meaning, Trigger};
use crate::algebra::{Comparison, Expr, Facts, Node, Symbol};
use crate::ast;
use crate::diagnostic::{Diagnostic, codes};
use crate::ids::Id;
use crate::span::Span;
use crate::unit::{Dimension as Dim, Unit};

impl<'a> Builder<'a, '_> {
    /// All `when` statements.
    pub fn clauses(&mut self) -> Vec<Clause> {
        let flat = self.flat;
        let mut impulses: BTreeMap<String, Symbol> = BTreeMap::new();
        let mut clauses = Vec::new();
        for written in &flat.clauses {
            let before = self.faults.len();
            let name = self.clause_name(written);
            let clause = self.clause(written, name, &mut impulses);
            self.met_in(written.here, before);
            clauses.extend(clause);
        }
        clauses
    }

    /// A clause as it begins in the text, with the instance and the turn that it stands in.
    fn clause_name(&self, written: &Written<'a>) -> String {
        let trigger = &written.ast.trigger;
        let text = self.sources.slice(trigger.expr().span).split_whitespace().collect::<Vec<_>>().join(" ");
        let every = if matches!(trigger, ast::Trigger::Every(_)) { "every " } else { "" };
        let instance = self.flat.names.scopes[written.here.scope].prefix.trim_end_matches('.');
        let within = if instance.is_empty() { String::new() } else { format!(" in {instance}") };
        let turn = self.repeats.words(self.flat.names.turn_around(written.here));
        let turn = if turn.is_empty() { turn } else { format!(" ({turn})") };
        format!("when {every}{text}{within}{turn}")
    }

    fn clause(
        &mut self,
        written: &Written<'a>,
        name: String,
        impulses: &mut BTreeMap<String, Symbol>,
    ) -> Option<Clause> {
        let cx = Reading::of(written.here, &name);
        let trigger = match &written.ast.trigger {
            ast::Trigger::Becomes(condition) => self.becomes(&cx, condition),
            ast::Trigger::Every(period) => self.positive(&cx, period, "the period of an event").map(Trigger::Every),
        };
        let read: Vec<Option<Action>> = written.ast.actions.iter().map(|a| self.action(&cx, a, impulses)).collect();
        let actions: Vec<Action> = read.into_iter().collect::<Option<_>>()?;
        self.refuse_twice(&actions);
        Some(Clause { name, trigger: trigger?, actions, bound: None, span: written.span })
    }

    /// A condition that can become true as time goes on.
    fn becomes(&mut self, cx: &Reading<'_>, condition: &'a ast::Expr) -> Option<Trigger> {
        let expr = self.truth(cx, condition)?.expr;
        let varies = |b: &Self, e: Expr| {
            let fixed = |s| match b.meaning(s) {
                Some(Meaning::Parameter(_)) => true,
                Some(Meaning::Held(id)) => b.held[id].kind.is_discrete(),
                _ => false,
            };
            b.exprs.depends_on_any(e, &|s| !fixed(s))
        };
        let equality = |e: &Expr| match *self.exprs.node(*e) {
            Node::Compare(Comparison::Eq | Comparison::Ne, l, r) => varies(self, l) || varies(self, r),
            _ => false,
        };
        let title = "a condition that no crossing makes true";
        if self.exprs.below(&[expr], &|_| true).iter().any(equality) {
            let why = "what varies steadily has one value for no time at all";
            let fault = Diagnostic::error(codes::L011, title, condition.span, why);
            self.fault(fault.hint("compare with `<` or `>`: an event is where the condition becomes true"));
            return None;
        }
        if !self.exprs.depends_on_any(expr, &|s| !matches!(self.meaning(s), Some(Meaning::Parameter(_)))) {
            let title = "a condition that never changes";
            let fault = Diagnostic::error(codes::L011, title, condition.span, "this reads nothing that varies");
            self.fault(fault.hint("compare something that varies: an event is where the condition becomes true"));
            return None;
        }
        Some(Trigger::Becomes(expr))
    }

    fn action(
        &mut self,
        cx: &Reading<'_>,
        action: &'a ast::Action,
        impulses: &mut BTreeMap<String, Symbol>,
    ) -> Option<Action> {
        let own = self.path(cx, &action.target)?;
        let symbol = self.changed(&own, action)?;
        let value = self.number(cx, &action.value)?;
        self.equal(&value.quantity, &own.quantity, action.span, "the new value and the variable");
        if value.quantity == Quantity::Any
            && let Some(unit) = self.declared_unit(symbol)
        {
            self.plain_numbers(value.expr, &unit, action.value.span);
        }
        let name = format!("{}{}", self.flat.names.scopes[cx.here.scope].prefix, self.written(cx.here, &action.target));
        let impulse = match self.meaning(symbol) {
            Some(Meaning::Signal(_) | Meaning::Held(_)) => None,
            _ => Some(self.impulse(&name, symbol, action.span, impulses)),
        };
        if !matches!(self.meaning(symbol), Some(Meaning::Held(_))) {
            self.reset.insert(symbol);
        }
        Some(Action { name, target: symbol, value: value.expr, impulse, span: action.span })
    }

    /// The unit that a discrete variable or state is declared with.
    fn declared_unit(&self, symbol: Symbol) -> Option<Unit> {
        match self.meaning(symbol)? {
            Meaning::Held(id) => self.held[id].unit.clone(),
            Meaning::Signal(id) => self.signals[id].unit.clone(),
            _ => None,
        }
    }

    /// The variable that tells the impulse of a law.
    pub(super) fn impulse_of(&mut self, name: &str, target: Symbol, span: Span) -> Symbol {
        self.impulse(name, target, span, &mut BTreeMap::new())
    }

    /// The variable that tells the impulse of a reset: `ball.impulse` of `ball.f` and `ball.p`.
    fn impulse(&mut self, name: &str, target: Symbol, span: Span, impulses: &mut BTreeMap<String, Symbol>) -> Symbol {
        let own = name.rsplit_once('.').map_or(name, |(own, _)| own);
        let name = format!("{own}.impulse");
        if let Some(&known) = impulses.get(&name) {
            return known;
        }
        let second = Quantity::of(Dim::SECOND);
        let quantity = match self.meaning(target) {
            Some(Meaning::Flow(bond)) => self.pairs.get(bond.index()).map(|p| p.effort_in.times(&second)),
            Some(Meaning::Effort(bond)) => self.pairs.get(bond.index()).map(|p| p.flow_in.times(&second)),
            _ => Some(self.quantity(target)),
        };
        let symbol = self.fresh(&name, Facts::default());
        let (zero, one) = (self.exprs.int(0), self.exprs.int(1));
        let (own, kind) = (self.exprs.name(symbol).to_string(), HeldKind::Impulse);
        let draft = HeldDraft { name: own, symbol, source: Some(zero), time: one, kind, unit: None, span };
        let id = self.held.push(draft);
        self.mean(symbol, Meaning::Held(id), quantity.unwrap_or(Quantity::Any));
        impulses.insert(name, symbol);
        symbol
    }

    /// The symbol, if an event can change what it stands for in this way.
    fn changed(&mut self, own: &Value, action: &ast::Action) -> Option<Symbol> {
        let symbol = match self.exprs.node(own.expr) {
            Node::Symbol(symbol) => Some(*symbol),
            _ => None,
        };
        let meaning = symbol.and_then(|s| self.meaning(s));
        let title = match action.reset {
            true => "a reset is for a state, the `p` or `f` of an I, the `q` or `e` of a C, a flow or effort they set",
            false => "what an event sets without `reset` is a discrete variable",
        };
        let (why, hint) = match (meaning, action.reset) {
            (Some(Meaning::Held(id)), false) if self.held[id].kind == HeldKind::Discrete => return symbol,
            (Some(Meaning::Signal(_) | Meaning::Stored(_) | Meaning::Effort(_) | Meaning::Flow(_)), true) => {
                return symbol;
            }
            (Some(Meaning::Held(id)), true) if self.held[id].kind == HeldKind::Discrete => {
                ("this is a discrete variable", "leave out `reset`")
            }
            (Some(Meaning::Signal(_) | Meaning::Stored(_) | Meaning::Effort(_) | Meaning::Flow(_)), false) => {
                ("this is a variable of the machine", "write `reset` before it")
            }
            (Some(Meaning::Parameter(_)), _) => ("a parameter stays as it is", "declare it with `discrete` instead"),
            (Some(Meaning::Input(_)), _) => ("an input is given from outside", "set a discrete variable, and add it"),
            (Some(Meaning::Time), _) => ("this is time", "keep the time of an event in a discrete variable: `t0 = t`"),
            _ => ("this follows from other variables", "change the variables that it follows from"),
        };
        self.fault(Diagnostic::error(codes::L012, title, action.target.span, why).hint(hint));
        None
    }

    fn refuse_twice(&mut self, actions: &[Action]) {
        let mut first: BTreeMap<Symbol, Span> = BTreeMap::new();
        for action in actions {
            let key = action.impulse.unwrap_or(action.target);
            let Some(before) = first.insert(key, action.span) else { continue };
            let title = format!("`{}` is changed twice by one event", action.name);
            let fault = Diagnostic::error(codes::L013, title, action.span, "again").also(before, "first");
            self.fault(fault.hint("all of one event happens at once: keep one of them"));
        }
    }
}
