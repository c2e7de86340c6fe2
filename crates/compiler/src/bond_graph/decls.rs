//! Parameters, inputs, signals and functions: brought into an order in which each reads only what is known.

use std::collections::BTreeMap;

use super::builder::{Builder, HeldDraft, InputDraft, NamedDraft, OpenSignal, Role, SignalDraft, Value};
use super::dimension::Quantity;
use super::families::{FamilyId, spelled};
use super::scope::{self, DeclId, DeclKind, Here, Valued};
use super::value::Reading;
use super::vectors::Shaped;
use super::{HeldId, HeldKind, InputId, Meaning, Parameter, ParameterKind};
use crate::algebra::{Expr, Facts, Node, Symbol};
use crate::ast::{self, BinaryOp, ExprKind};
use crate::diagnostic::{Diagnostic, codes};
use crate::ids::Id;
use crate::span::Span;
use crate::unit::Unit;

/// How far a declaration has got.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stage {
    Waiting,
    Open,
    Done,
}

impl<'a> Builder<'a, '_> {
    /// Gives every declaration its value.
    pub fn make_values(&mut self) {
        let decls = self.flat.names.decls.len();
        for decl in 0..decls {
            self.symbol_of_signal(decl);
        }
        let mut stage = vec![Stage::Waiting; decls];
        for decl in 0..decls {
            self.reach(decl, &mut stage);
        }
        self.make_rates();
    }

    /// Inputs and states have their symbols before anything reads them.
    fn symbol_of_signal(&mut self, decl: DeclId) {
        let d = &self.flat.names.decls[decl];
        let (meaning, quantity) = match d.kind {
            DeclKind::Input(default) => {
                let declared = d.unit.and_then(|u| self.unit(u)).map(|u| u.dim);
                let written = default.and_then(|e| unit_of_literal(e, &d.item));
                let of_number = || Some(Unit::parse(&written?.text).ok()?.dimension);
                let dimension = declared.or_else(of_number);
                let quantity = dimension.map_or(Quantity::Any, Quantity::of);
                (Meaning::Input(InputId::new(self.inputs.len())), quantity)
            }
            DeclKind::State(_) => {
                let quantity = match d.unit.and_then(|u| self.unit(u)) {
                    Some(u) => Quantity::of(u.dim),
                    None => Quantity::var(self.dims.unknown()),
                };
                (Meaning::Signal(super::SignalId::new(self.signals.len())), quantity)
            }
            DeclKind::Discrete(_) => {
                let declared = d.unit.and_then(|u| self.unit(u)).map(|u| u.dim);
                let quantity = declared.map_or_else(|| Quantity::var(self.dims.unknown()), Quantity::of);
                (Meaning::Held(HeldId::new(self.held.len())), quantity)
            }
            _ => return,
        };
        let symbol = self.fresh(&d.name, Facts::default());
        self.mean(symbol, meaning, quantity.clone());
        let unit = d.unit.and_then(|u| self.unit(u)).and_then(|u| u.unit);
        match d.kind {
            DeclKind::State(state) => {
                let name = d.name.clone();
                let id = self.signals.push(SignalDraft { name, symbol, rate: None, initial: None, unit, span: d.span });
                self.open_signals.push(OpenSignal { id, state, decl });
            }
            DeclKind::Discrete(_) => {
                let (name, kind, time, span) = (d.name.clone(), HeldKind::Discrete, self.exprs.int(1), d.span);
                self.held.push(HeldDraft { name, symbol, source: None, time, kind, unit, span });
            }
            _ => {
                let (name, doc) = (d.name.clone(), d.doc.to_string());
                self.inputs.push(InputDraft { name, symbol, default: None, unit, doc, span: d.span });
            }
        }
        self.values[decl] = Some(Value::number(self.exprs.sym(symbol), quantity));
    }

    /// Gives a declaration its value, and before it those that it reads. Depth first, without recursion: models may have
    /// long chains of declarations.
    fn reach(&mut self, start: DeclId, stage: &mut [Stage]) {
        if stage[start] != Stage::Waiting {
            return;
        }
        stage[start] = Stage::Open;
        let mut stack = vec![(start, self.reads(start).into_iter())];
        while let Some((decl, rest)) = stack.last_mut() {
            let decl = *decl;
            match rest.next() {
                None => {
                    stack.pop();
                    self.evaluate(decl);
                    stage[decl] = Stage::Done;
                }
                Some((next, span)) => match stage[next] {
                    Stage::Done => {}
                    Stage::Waiting => {
                        stage[next] = Stage::Open;
                        stack.push((next, self.reads(next).into_iter()));
                    }
                    Stage::Open => {
                        let around: Vec<DeclId> = stack.iter().map(|(d, _)| *d).skip_while(|d| *d != next).collect();
                        self.circle(&around, span);
                    }
                },
            }
        }
    }

    /// Names that define one another.
    fn circle(&mut self, around: &[DeclId], span: Span) {
        let decls = &self.flat.names.decls;
        let names: Vec<&str> = around.iter().map(|d| decls[*d].name.as_str()).collect();
        let function = around.iter().all(|d| matches!(decls[*d].kind, DeclKind::Function(_)));
        let title = match names.as_slice() {
            [one] if function => format!("function `{one}` calls itself"),
            [one] => format!("`{one}` is defined by itself"),
            many => format!("{} are defined by one another", many.join(", ")),
        };
        let mut d = Diagnostic::error(codes::N004, title, span, format!("reads `{}` again", names[0]));
        for decl in around {
            d = d.also(decls[*decl].span, "declared here");
        }
        let parameters = around.iter().all(|d| matches!(decls[*d].kind, DeclKind::Parameter { .. }));
        let hint = if parameters {
            "give one of them a number"
        } else if function {
            "functions cannot call themselves; write the result out"
        } else {
            "a `state` breaks such a circle, since it is known before its rate; so do `delay`, `sample` and `discrete`"
        };
        self.fault(d.hint(hint));
    }

    /// The declarations that must be known before this one, and where it reads them.
    fn reads(&mut self, decl: DeclId) -> Vec<(DeclId, Span)> {
        let d = &self.flat.names.decls[decl];
        let mut found = Vec::new();
        match d.kind {
            DeclKind::Function(f) => {
                let formals: Vec<&str> = f.params.iter().map(|p| p.text.as_str()).collect();
                self.collect(d.reads, &f.body, (&formals, &[]), &mut found);
            }
            DeclKind::State(_) => {}
            DeclKind::Joined(_) => found.extend(self.source_of_joined(decl)),
            _ => {
                if let Some(value) = d.kind.value() {
                    self.collect(d.reads, value, (&[], &d.item), &mut found);
                }
            }
        }
        found
    }

    /// The declarations that an expression reads at once: not through a state, a delay, a sample or a transfer function
    /// without direct path. Given are the formal arguments of a function, and which element of an array is asked for.
    fn collect(&mut self, here: Here, e: &'a ast::Expr, own: (&[&str], &[i64]), found: &mut Vec<(DeclId, Span)>) {
        match &e.kind {
            ExprKind::Path(path) => {
                if let Some(decl) = self.decl_of(here, path, own) {
                    if !self.flat.names.decls[decl].kind.is_known_before() {
                        found.push((decl, path.span));
                    }
                } else if let Some(family) = self.family_of(here, path, own.0) {
                    let whole = &self.flat.names.value_families[family];
                    let known = |decl: &DeclId| self.flat.names.decls[*decl].kind.is_known_before();
                    found.extend(whole.all().filter(|decl| !known(decl)).map(|decl| (*decl, path.span)));
                }
            }
            ExprKind::Call(call) => {
                if let Some(Valued::One(decl)) = self.flat.names.value(here.scope, &call.function.text) {
                    found.push((decl, call.function.span));
                }
                let skip = usize::from(super::blocks::is_lagging(call));
                let whole = super::vectors::is_of_vectors(&call.function.text);
                let item = if whole { &[] } else { own.1 };
                for arg in call.args.iter().skip(skip) {
                    self.collect(here, &arg.value, (own.0, item), found);
                }
            }
            ExprKind::Rate(inner) => self.collect(here, inner, own, found),
            ExprKind::List(list) => match own.1.split_first() {
                Some((first, rest)) => {
                    let entry = usize::try_from(first - 1).ok().and_then(|at| list.get(at));
                    entry.into_iter().for_each(|e| self.collect(here, e, (own.0, rest), found));
                }
                None => list.iter().for_each(|e| self.collect(here, e, own, found)),
            },
            ExprKind::Repeated(list) => {
                if let (Some((first, rest)), Some(from)) = (own.1.split_first(), self.known_whole(here, &list.from)) {
                    self.collect_turn(here, list, from + first - 1, (own.0, rest), found);
                }
            }
            ExprKind::Sum(sum) => {
                let ends = self.known_whole(here, &sum.from).zip(self.known_whole(here, &sum.to));
                let values = ends.and_then(|(from, to)| self.repeats.terms_of(from, to));
                values.into_iter().flatten().for_each(|value| self.collect_turn(here, sum, value, own, found));
            }
            ExprKind::Unary(u) => self.collect(here, &u.operand, own, found),
            ExprKind::Binary(b) => {
                let item = match b.op {
                    // Each entry of a product of matrices reads whole rows and columns.
                    BinaryOp::Mul if self.may_be_matrix(here, e, own.0) => &[],
                    _ => own.1,
                };
                self.collect(here, &b.left, (own.0, item), found);
                self.collect(here, &b.right, (own.0, item), found);
            }
            ExprKind::If(i) => {
                for part in [&i.cond, &i.yes, &i.no] {
                    self.collect(here, part, own, found);
                }
            }
            ExprKind::Number(_) | ExprKind::Text(_) | ExprKind::Missing => {}
        }
    }

    /// Whether an expression may have a matrix in it, by its names alone: shapes are not known yet.
    fn may_be_matrix(&mut self, here: Here, e: &'a ast::Expr, formals: &[&str]) -> bool {
        let mut any = |parts: &[&'a ast::Expr]| parts.iter().any(|part| self.may_be_matrix(here, part, formals));
        match &e.kind {
            ExprKind::Path(path) => match self.decl_of(here, path, (formals, &[])) {
                Some(decl) => {
                    let kind = &self.flat.names.decls[decl].kind;
                    matches!(kind, DeclKind::Let(_) | DeclKind::MadeFor(_) | DeclKind::Output(_) | DeclKind::Joined(_))
                }
                None => self
                    .family_of(here, path, formals)
                    .is_some_and(|family| self.flat.names.value_families[family].rank() > 1),
            },
            ExprKind::List(list) => list.iter().any(|e| matches!(e.kind, ExprKind::List(_))),
            ExprKind::Call(call) => super::vectors::is_of_vectors(&call.function.text),
            ExprKind::Unary(u) => any(&[&u.operand]),
            ExprKind::Binary(b) => any(&[&b.left, &b.right]),
            ExprKind::If(i) => any(&[&i.yes, &i.no]),
            ExprKind::Repeated(_) | ExprKind::Sum(_) | ExprKind::Rate(_) => true,
            ExprKind::Number(_) | ExprKind::Text(_) | ExprKind::Missing => false,
        }
    }

    /// The same of what is repeated, for one value of its variable.
    fn collect_turn(
        &mut self,
        here: Here,
        repeated: &'a ast::Repeated,
        value: i64,
        own: (&[&str], &[i64]),
        found: &mut Vec<(DeclId, Span)>,
    ) {
        let turn = self.repeats.turn(&repeated.variable, value, here);
        self.collect(Here { turn, ..here }, &repeated.value, own, found);
        self.repeats.forget(turn);
    }

    /// A whole number, if it is known; what is wrong with it is said where its expression is read.
    fn known_whole(&mut self, here: Here, e: &'a ast::Expr) -> Option<i64> {
        self.repeats.whole(&self.flat.names, here, e, "").ok()
    }

    /// The declaration that a path names, if it names one.
    pub fn decl_of(&mut self, here: Here, path: &'a ast::Path, (formals, item): (&[&str], &[i64])) -> Option<DeclId> {
        let names = &self.flat.names;
        let (value, part) = match path.parts.as_slice() {
            [one] if one.indices.is_empty() && self.is_bound(here, formals, &one.name.text) => return None,
            [one] => (names.value(here.scope, &one.name.text)?, one),
            [.., last] => match names.node(&mut self.repeats, here, path) {
                Ok((scope::Node::Instance(inner), used)) if used + 1 == path.parts.len() => {
                    (*names.scopes[inner].values.get(last.name.text.as_str())?, last)
                }
                _ => return None,
            },
            [] => return None,
        };
        match value {
            // Its indices are those of a vector or matrix.
            Valued::One(decl) => Some(decl),
            Valued::Family(_) => names.decl_of(&mut self.repeats, here, value, part, item).ok(),
        }
    }

    /// The array that a path names as a whole, if it names one.
    fn family_of(&mut self, here: Here, path: &'a ast::Path, formals: &[&str]) -> Option<FamilyId> {
        let names = &self.flat.names;
        let value = match path.parts.as_slice() {
            [one] if !one.indices.is_empty() || self.is_bound(here, formals, &one.name.text) => return None,
            [one] => names.value(here.scope, &one.name.text)?,
            [.., last] if last.indices.is_empty() => match names.node(&mut self.repeats, here, path) {
                Ok((scope::Node::Instance(inner), used)) if used + 1 == path.parts.len() => {
                    *names.scopes[inner].values.get(last.name.text.as_str())?
                }
                _ => return None,
            },
            _ => return None,
        };
        match value {
            Valued::Family(family) => Some(family),
            Valued::One(_) => None,
        }
    }

    /// Whether a name is a formal argument or the variable of a repetition.
    fn is_bound(&self, here: Here, formals: &[&str], name: &str) -> bool {
        formals.contains(&name) || self.repeats.variable(here.turn, name).is_some()
    }

    fn evaluate(&mut self, decl: DeclId) {
        let before = self.faults.len();
        self.now = self.flat.names.decls[decl].reads;
        self.evaluate_one(decl);
        self.met_in(self.flat.names.decls[decl].reads, before);
    }

    fn evaluate_one(&mut self, decl: DeclId) {
        let d = &self.flat.names.decls[decl];
        if let DeclKind::Parameter { value: Some(e), .. } | DeclKind::Let(Some(e)) | DeclKind::MadeFor(Some(e)) = d.kind
            && d.item.is_empty()
            && let Some(text) = self.text_of(d.reads, e)
        {
            self.texts.insert(decl, text);
            return;
        }
        match d.kind {
            DeclKind::Parameter { value, constant } => self.parameter(decl, value, constant),
            DeclKind::Input(value) => self.input_default(decl, value),
            DeclKind::Discrete(value) => self.discrete(decl, value),
            DeclKind::Let(value) | DeclKind::MadeFor(value) => self.named(decl, value, false),
            DeclKind::Output(value) => self.named(decl, value, true),
            DeclKind::Function(f) => self.function(decl, f),
            DeclKind::State(_) => {}
            DeclKind::Joined(_) => {
                self.joined_signal(decl);
            }
        }
    }

    /// The text that an expression is, as the name of a file, and where it stands: what a value is that names another one
    /// is found before it.
    pub fn text_of(&mut self, here: Here, e: &'a ast::Expr) -> Option<(&'a str, Span)> {
        match &e.kind {
            ExprKind::Text(text) => Some((text, e.span)),
            ExprKind::Path(path) => {
                let decl = self.decl_of(here, path, (&[], &[]))?;
                let text = self.texts.get(&decl).copied()?;
                let used = self.flat.names.used(decl);
                used.into_iter().for_each(|used| self.uses.add(used, path.parts[path.parts.len() - 1].name.span));
                Some(text)
            }
            _ => None,
        }
    }

    fn missing_value(&mut self, decl: DeclId) {
        let d = &self.flat.names.decls[decl];
        let in_component = self.flat.names.scopes[d.reads.scope].instance.is_some();
        if !in_component {
            let fault = Diagnostic::error(codes::N009, format!("`{}` has no value", d.name), d.span, "declared here")
                .hint(format!("write `{} = …`", d.name));
            self.fault(fault);
        }
    }

    fn parameter(&mut self, decl: DeclId, value: Option<&'a ast::Expr>, constant: bool) {
        let Some(e) = value else { return self.missing_value(decl) };
        let d = &self.flat.names.decls[decl];
        let Some(value) = self.number(&d.reading(), e) else { return };
        if !self.only_parameters(value.expr, e.span, "a parameter") {
            return;
        }
        if let Some(alias) = self.alias(decl, &value) {
            self.values[decl] = Some(alias);
            return;
        }
        let value = self.with_unit(value, d.unit, e.span);
        let value = self.like_replaced(value, d.replaced_unit, e.span);
        let number = self.value_of(value.expr).unwrap_or(f64::NAN);
        if !number.is_finite() {
            let title = format!("`{}` has no finite value", d.name);
            self.fault(Diagnostic::error(codes::N016, title, e.span, format!("this is {number}")));
            return;
        }
        let facts = Facts { nonzero: number != 0.0, positive: number > 0.0, given: Some(value.expr) };
        let symbol = self.fresh(&d.name, facts);
        let written = d.unit.or(d.replaced_unit).or(unit_of_literal(e, &d.item));
        let unit = written.and_then(|u| self.unit(u)).and_then(|u| u.unit);
        let (name, doc) = (d.name.clone(), d.doc.to_string());
        let parameter = Parameter {
            name,
            symbol,
            value: value.expr,
            constant,
            shapes: false,
            kind: ParameterKind::Declared,
            unit,
            doc,
            span: d.span,
        };
        let id = self.parameters.push(parameter);
        self.numbers.push(number);
        self.mean(symbol, Meaning::Parameter(id), value.quantity.clone());
        self.values[decl] = Some(Value::number(self.exprs.sym(symbol), value.quantity));
    }

    /// A parameter of an instance that is given another parameter is that parameter.
    fn alias(&mut self, decl: DeclId, value: &Value) -> Option<Value> {
        let d = &self.flat.names.decls[decl];
        let is_symbol = matches!(self.exprs.node(value.expr), Node::Symbol(_));
        let inside = d.name.contains('.');
        (inside && is_symbol).then(|| self.with_unit(value.clone(), d.unit, d.span))
    }

    /// Whether an expression reads parameters only; says so if not.
    pub fn only_parameters(&mut self, expr: Expr, span: Span, what: &str) -> bool {
        let Some((name, kind)) = self.no_parameter(expr) else { return true };
        let title = format!("{what} must be known before the run, but reads `{name}`");
        self.fault(
            Diagnostic::error(codes::N016, title, span, format!("`{name}` is {kind}"))
                .hint("use numbers and parameters; for a value that varies write `let`"),
        );
        false
    }

    /// What an expression reads beside parameters, and what that is.
    fn no_parameter(&self, expr: Expr) -> Option<(String, &'static str)> {
        let is_parameter = |s: &Symbol| matches!(self.meaning(*s), Some(Meaning::Parameter(_)));
        let other = self.exprs.symbols_of(expr).into_iter().find(|s| !is_parameter(s))?;
        let kind = match self.meaning(other) {
            Some(Meaning::Time) => "time",
            Some(Meaning::Input(_)) => "an input",
            Some(Meaning::Held(id)) if self.held[id].kind.is_discrete() => "a discrete variable",
            Some(Meaning::Signal(_) | Meaning::Held(_)) => "a signal",
            _ if self.role(other) == Some(Role::Reaction) => "a variable of a constraint",
            _ => "a variable of an element",
        };
        Some((self.exprs.name(other).to_string(), kind))
    }

    /// Says that what an instance is given for a `const` of its component varies, if it does.
    fn refuse_varying(&mut self, decl: DeclId, value: Expr, span: Span) {
        let d = &self.flat.names.decls[decl];
        let Some((read, kind)) = self.no_parameter(value).filter(|_| matches!(d.kind, DeclKind::MadeFor(_))) else {
            return;
        };
        let title = format!("`{}` must not vary, but reads `{read}`", d.name);
        let fault = Diagnostic::error(codes::N016, title, span, format!("`{read}` is {kind}"));
        let fault = fault.also(d.span, "a `const` of the component");
        self.fault(fault.hint(
            "use numbers and parameters: what moves has a velocity too, as joints have whose axes sources drive, and \
             `DrivenTranslation` and `DrivenRotation` of std.multibody",
        ));
    }

    /// Says that one number stands for a whole vector or matrix of a component, if it does: 0.1 is no matrix of inertia.
    fn refuse_one_for_all(&mut self, decl: DeclId, value: &Value, e: &'a ast::Expr) {
        let d = &self.flat.names.decls[decl];
        let is_given = d.reads.scope != d.scope && d.item.iter().all(|&i| i == 1);
        if !is_given || self.exprs.is_zero(value.expr) || !self.is_one_number(d.reads, e) {
            return;
        }
        let d = &self.flat.names.decls[decl];
        let (what, hint) = match d.item.len() {
            1 => ("a vector", "write it with its entries, `[x, y, z]`"),
            _ => ("a matrix", "write it with its rows, or its diagonal: `diag([a, b, c])`"),
        };
        let whole = d.name.rsplit_once('[').map_or(&*d.name, |(whole, _)| whole);
        let title = format!("`{whole}` is {what}, and one number is given for all of it");
        let fault = Diagnostic::error(codes::N007, title, e.span, "one number").also(d.span, "declared here");
        self.fault(fault.hint(hint));
    }

    /// Whether an expression is a single number, as far as its text tells.
    fn is_one_number(&mut self, here: Here, e: &'a ast::Expr) -> bool {
        match &e.kind {
            ExprKind::Number(_) => true,
            ExprKind::Unary(u) => self.is_one_number(here, &u.operand),
            ExprKind::Binary(b) => self.is_one_number(here, &b.left) && self.is_one_number(here, &b.right),
            ExprKind::Path(path) => {
                let Some(decl) = self.decl_of(here, path, (&[], &[])) else {
                    return matches!(&path.parts[..], [one] if ["t", "pi"].contains(&one.name.text.as_str()));
                };
                let d = &self.flat.names.decls[decl];
                match d.kind {
                    DeclKind::Parameter { .. } | DeclKind::Input(_) | DeclKind::Discrete(_) => d.item.is_empty(),
                    DeclKind::Let(Some(value)) | DeclKind::MadeFor(Some(value)) => {
                        d.item.is_empty() && self.is_one_number(d.reads, value)
                    }
                    _ => false,
                }
            }
            ExprKind::Call(call) => {
                let of_numbers = call.args.iter().all(|arg| self.is_one_number(here, &arg.value));
                of_numbers && !super::vectors::is_of_vectors(&call.function.text)
            }
            _ => false,
        }
    }

    /// A value with the unit that stands after `:`. A value without a unit is a number of it.
    pub fn with_unit(&mut self, value: Value, unit: Option<&ast::UnitText>, span: Span) -> Value {
        let Some(scale) = unit.and_then(|u| self.unit(u)) else { return value };
        if value.quantity == Quantity::Any && self.exprs.symbols_of(value.expr).is_empty() {
            return self.in_unit(value.expr, &scale);
        }
        if value.quantity == Quantity::Any
            && let Some(unit) = &scale.unit
        {
            self.plain_numbers(value.expr, unit, span);
        }
        self.equal(&value.quantity, &Quantity::of(scale.dim), span, "the value and its unit");
        Value { quantity: Quantity::of(scale.dim), ..value }
    }

    /// Numbers without a unit are SI, and stand where the unit is another one: who writes `if late then 5 else 3 : kN` may
    /// mean 5 kN.
    pub fn plain_numbers(&mut self, value: Expr, unit: &Unit, span: Span) {
        if unit.is_si() || self.exprs.is_zero(value) {
            return;
        }
        let si = unit.dimension;
        let title = format!("the numbers here are in {si}, not in {unit}");
        let warning = Diagnostic::warning(codes::U008, title, span, "none of them has a unit");
        self.warnings.push(warning.hint(format!(
            "write the unit with the numbers, as in `5 {unit}`; a unit behind `:` counts for a single number only, else it says in \
             what results are told"
        )));
    }

    /// The value of an override has the dimension of what it replaces; without a unit it is SI.
    fn like_replaced(&mut self, value: Value, unit: Option<&ast::UnitText>, span: Span) -> Value {
        let Some(scale) = unit.and_then(|u| self.unit(u)) else { return value };
        self.equal(&value.quantity, &Quantity::of(scale.dim), span, "the new value and the one in the model");
        Value { quantity: Quantity::of(scale.dim), ..value }
    }

    fn input_default(&mut self, decl: DeclId, value: Option<&'a ast::Expr>) {
        let Some(id) = self.values[decl].as_ref().and_then(|v| self.input_of(v.expr)) else { return };
        let Some(e) = value else {
            self.inputs[id].default = Some(self.exprs.int(0));
            return;
        };
        let d = &self.flat.names.decls[decl];
        let Some(value) = self.number(&d.reading(), e) else { return };
        if !self.only_parameters(value.expr, e.span, "the default of an input") {
            return;
        }
        self.inputs[id].default = Some(self.with_unit(value, d.unit, e.span).expr);
    }

    /// The value of a discrete variable at the start.
    fn discrete(&mut self, decl: DeclId, value: Option<&'a ast::Expr>) {
        let Some(own) = self.values[decl].clone() else { return };
        let Node::Symbol(symbol) = *self.exprs.node(own.expr) else { return };
        let Some(Meaning::Held(id)) = self.meaning(symbol) else { return };
        let Some(e) = value else { return self.missing_value(decl) };
        let d = &self.flat.names.decls[decl];
        let Some(value) = self.number(&d.reading(), e) else { return };
        if !self.only_parameters(value.expr, e.span, "the start value of a discrete variable") {
            return;
        }
        let value = self.with_unit(value, d.unit, e.span);
        self.equal(&value.quantity, &own.quantity, e.span, "the start value and the variable");
        self.held[id].source = Some(value.expr);
    }

    fn input_of(&self, value: Expr) -> Option<InputId> {
        let Node::Symbol(symbol) = *self.exprs.node(value) else { return None };
        match self.meaning(symbol)? {
            Meaning::Input(id) => Some(id),
            _ => None,
        }
    }

    fn named(&mut self, decl: DeclId, value: Option<&'a ast::Expr>, output: bool) {
        let Some(e) = value else { return self.missing_value(decl) };
        let d = &self.flat.names.decls[decl];
        if !d.item.is_empty() {
            let Some(value) = self.number(&d.reading(), e) else { return };
            self.refuse_one_for_all(decl, &value, e);
            self.values[decl] = Some(self.name_value(decl, value, &[], e.span, output));
            return;
        }
        let Some(found) = self.shaped(&d.reading(), e) else { return };
        if found.shape.is_empty() {
            let Some(value) = found.items.into_iter().next() else { return };
            self.values[decl] = Some(self.name_value(decl, value, &[], e.span, output));
            return;
        }
        let indices = found.indices();
        let entries = found.items.into_iter().zip(&indices);
        let items = entries.map(|(value, at)| self.name_value(decl, value, at, e.span, output)).collect();
        self.note_array(found.shape.iter().product());
        self.shapes.insert(decl, Shaped { shape: found.shape, items });
    }

    /// Gives a name to a value, or to an entry of a vector or matrix.
    fn name_value(&mut self, decl: DeclId, value: Value, indices: &[i64], span: Span, output: bool) -> Value {
        self.refuse_varying(decl, value.expr, span);
        let d = &self.flat.names.decls[decl];
        let mut value = self.with_unit(value, d.unit, span);
        if !indices.is_empty() {
            value.expr = self.exprs.whole(value.expr);
        }
        let unit = d.unit.and_then(|u| self.unit(u)).and_then(|u| u.unit);
        let (name, doc) = (spelled(&d.name, indices), d.doc.to_string());
        let unit_is_written = unit.is_some();
        let quantity = value.quantity.clone();
        let place = (d.span, decl);
        let named = NamedDraft { name, value: value.expr, unit, unit_is_written, quantity, doc, place };
        if output {
            self.outputs.push(named)
        } else {
            self.lets.push(named)
        }
        value
    }

    fn function(&mut self, decl: DeclId, f: &'a ast::Function) {
        let d = &self.flat.names.decls[decl];
        let mut formals: Vec<(&str, crate::algebra::Symbol)> = Vec::new();
        for p in &f.params {
            if let Some((_, _)) = formals.iter().find(|(n, _)| *n == p.text) {
                let title = format!("`{}` is an argument twice", p.text);
                self.fault(
                    Diagnostic::error(codes::N002, title, p.span, "again").hint("give one of them another name"),
                );
                return;
            }
            let symbol = self.fresh(&format!("{}({})", d.name, p.text), Facts::default());
            formals.push((&p.text, symbol));
        }
        let cx = Reading { formals: &formals, plain: true, ..Reading::of(d.reads, &d.name) };
        if let Some(body) = self.number(&cx, &f.body) {
            let symbols = formals.iter().map(|(_, s)| *s).collect();
            self.functions.insert(decl, (symbols, body.expr));
        }
    }

    /// Rates and start values of states, when all names are known.
    fn make_rates(&mut self) {
        for open in std::mem::take(&mut self.open_signals) {
            let before = self.faults.len();
            self.now = self.flat.names.decls[open.decl].reads;
            self.make_rate(&open);
            self.met_in(self.flat.names.decls[open.decl].reads, before);
        }
    }

    fn make_rate(&mut self, open: &OpenSignal<'a>) {
        let cx = self.flat.names.decls[open.decl].reading();
        let own = self.quantity(self.signals[open.id].symbol);
        let rate = self.number(&cx, &open.state.rate);
        let start = open.state.start.as_ref().and_then(|start| Some((start, self.number(&cx, start)?)));
        if let Some(rate) = rate {
            let symbol = self.signals[open.id].symbol;
            let plain = start.as_ref().is_none_or(|(_, value)| value.quantity == Quantity::Any);
            let without_unit = plain && open.state.unit.is_none() && self.exprs.depends_on(rate.expr, symbol);
            self.equal_over_time(&rate.quantity, &own, open.state.rate.span, without_unit);
            self.signals[open.id].rate = Some(rate.expr);
        }
        if let Some((start, value)) = start
            && self.only_parameters(value.expr, start.span, "a start value")
        {
            let value = self.with_unit(value, open.state.unit.as_ref(), start.span);
            self.equal(&value.quantity, &own, start.span, "the start value and the signal");
            self.signals[open.id].initial = Some(value.expr);
        }
    }

    /// Puts the rates of integrated signals in where expressions ask for them. Gives the map of what is replaced; says so
    /// if rates define one another.
    pub fn rates_of_signals(&mut self) -> BTreeMap<crate::algebra::Symbol, Expr> {
        let asked: BTreeMap<_, _> = self.rate_symbols.iter().map(|(s, id)| (*s, *id)).collect();
        let mut known = BTreeMap::new();
        let mut left: Vec<_> = asked.into_iter().collect();
        while !left.is_empty() {
            let before = known.len();
            let mut later = Vec::new();
            for (symbol, id) in left {
                // One without a rate is at fault, which has been said.
                let Some(rate) = self.signals[id].rate else { continue };
                let rate = self.exprs.substitute(rate, &known);
                let open = self.exprs.depends_on_any(rate, &|s| self.rate_symbols.contains_key(&s));
                if open {
                    later.push((symbol, id));
                } else {
                    known.insert(symbol, rate);
                }
            }
            if known.len() == before && !later.is_empty() {
                self.rates_in_a_circle(&later);
                break;
            }
            left = later;
        }
        known
    }

    fn rates_in_a_circle(&mut self, signals: &[(crate::algebra::Symbol, super::SignalId)]) {
        let names: Vec<String> = signals.iter().map(|(_, id)| format!("{}'", self.signals[*id].name)).collect();
        let span = self.signals[signals[0].1].span;
        let mut d = Diagnostic::error(
            codes::N004,
            format!("{} are defined by one another", names.join(", ")),
            span,
            "declared here",
        );
        for (_, id) in &signals[1..] {
            d = d.also(self.signals[*id].span, "declared here");
        }
        self.fault(d.hint("write the rates without one another"));
    }
}

/// The unit that stands at a value which is one number; that of its element `item` in a list.
pub(super) fn unit_of_literal<'a>(e: &'a ast::Expr, item: &[i64]) -> Option<&'a ast::UnitText> {
    match (&e.kind, item) {
        (ExprKind::Number(n), _) => n.unit.as_ref(),
        (ExprKind::Unary(u), _) => unit_of_literal(&u.operand, item),
        (ExprKind::List(list), [first, rest @ ..]) => {
            unit_of_literal(list.get(usize::try_from(first - 1).ok()?)?, rest)
        }
        _ => None,
    }
}
