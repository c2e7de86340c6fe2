//! From expressions as written to exact ones, with their dimensions.

use super::builder::{Builder, Value};
use super::counted::Counted;
use super::dimension::Quantity;
use super::families::FamilyId;
use super::repeat::too_long;
use super::scope::{DeclKind, FUNCTIONS, Here, ScopeId, Valued};
use super::uses::Used;
use super::vectors::VECTOR_FUNCTIONS;
use crate::algebra::{Comparison, Expr, Function, Symbol};
use crate::ast::{self, BinaryOp, ExprKind, UnaryOp};
use crate::diagnostic::{Diagnostic, codes};
use crate::span::Span;
use crate::unit::{Dimension as Dim, WHOLE};

/// What text is for.
pub(super) const ONLY_FILES: &str = "text is only read by `table` and `number`, as the name of a file";

/// What an expression may read, and where it stands.
#[derive(Clone, Copy)]
pub(super) struct Reading<'r> {
    /// Where names are looked up.
    pub here: Here,
    /// Which element of it is asked for, if it is for all elements of an array.
    pub item: &'r [i64],
    /// That array.
    pub array: Option<FamilyId>,
    /// The part whose argument it is, if it is one.
    pub own: Option<usize>,
    /// Whether `e f q p` are the part's own before anything else.
    pub law: bool,
    /// Formal arguments, in the body of a function.
    pub formals: &'r [(&'r str, Symbol)],
    /// Whether signal blocks and derivatives have no place here: in functions.
    pub plain: bool,
    /// Name of what the expression belongs to, for the states of signal blocks.
    pub owner: &'r str,
}

impl<'r> Reading<'r> {
    /// An expression that belongs to a name.
    pub fn of(here: Here, owner: &'r str) -> Reading<'r> {
        Reading { here, item: &[], array: None, own: None, law: false, formals: &[], plain: false, owner }
    }
}

impl<'a> Builder<'a, '_> {
    /// Reads a number, not a truth value. `None` if it is at fault, which has been said.
    pub fn number(&mut self, cx: &Reading<'_>, e: &'a ast::Expr) -> Option<Value> {
        let value = self.read(cx, e)?;
        if value.truth {
            self.fault(
                Diagnostic::error(codes::N017, "a number is needed here", e.span, "this is true or false")
                    .hint("write `if … then 1 else 0`"),
            );
            return None;
        }
        Some(value)
    }

    /// Reads a truth value.
    pub fn truth(&mut self, cx: &Reading<'_>, e: &'a ast::Expr) -> Option<Value> {
        let value = self.read(cx, e)?;
        if !value.truth {
            self.fault(
                Diagnostic::error(codes::N017, "a condition is needed here", e.span, "this is a number")
                    .hint("compare it, such as `x > 0`"),
            );
            return None;
        }
        Some(value)
    }

    fn read(&mut self, cx: &Reading<'_>, e: &'a ast::Expr) -> Option<Value> {
        if let Some(found) = self.entry_of_shaped(cx, e) {
            return found;
        }
        match &e.kind {
            ExprKind::Number(n) => self.literal(cx, n, e.span),
            ExprKind::Path(path) => self.path(cx, path),
            ExprKind::Rate(inner) => self.rate(cx, inner, e.span),
            ExprKind::Call(call) => self.call(cx, call, e.span),
            ExprKind::Unary(u) => self.unary(cx, u),
            ExprKind::Binary(b) => self.binary(cx, b, e.span),
            ExprKind::If(i) => self.choice(cx, i, e.span),
            ExprKind::Text(_) => self.misplaced(e.span, "text", ONLY_FILES),
            ExprKind::List(list) if !cx.item.is_empty() => {
                let (first, rest) = cx.item.split_first()?;
                let entry = list.get(usize::try_from(first - 1).ok()?)?;
                self.read(&Reading { item: rest, ..*cx }, entry)
            }
            ExprKind::Repeated(list) if !cx.item.is_empty() => self.entry(cx, list),
            ExprKind::Sum(sum) => self.total(cx, sum, e.span),
            ExprKind::List(_) | ExprKind::Repeated(_) => self.misplaced(
                e.span,
                "a list",
                "lists are only read by `tf`, by matrices of fields and by arrays such as `param k[3] = [1, 2, 3]`",
            ),
            ExprKind::Missing => {
                self.incomplete = true;
                None
            }
        }
    }

    /// What is made of vectors or matrices: a number, or the entry that is asked for. The outer `None`: it is a number, or
    /// made of arrays entry by entry.
    #[allow(clippy::option_option)]
    fn entry_of_shaped(&mut self, cx: &Reading<'_>, e: &'a ast::Expr) -> Option<Option<Value>> {
        let of_vectors = match &e.kind {
            ExprKind::Call(call) => {
                let declared = self.flat.names.value(cx.here.scope, &call.function.text).is_some();
                !declared && VECTOR_FUNCTIONS.iter().any(|f| f.0 == call.function.text)
            }
            ExprKind::Binary(b) if !cx.item.is_empty() && b.op == BinaryOp::Mul => {
                self.has_other_shape(cx, &b.left) || self.has_other_shape(cx, &b.right)
            }
            ExprKind::Path(_) if cx.item.is_empty() => false,
            ExprKind::Path(path) => self.names_vector(cx, path),
            _ => false,
        };
        if !of_vectors {
            return None;
        }
        let Some(found) = self.shaped(&Reading { item: &[], array: None, ..*cx }, e) else { return Some(None) };
        if found.shape.is_empty() {
            return Some(found.items.into_iter().next());
        }
        let entry = found.entry(cx.item).cloned();
        if entry.is_none() {
            let needed = match cx.item.len() {
                0 => "a number".to_string(),
                1 => "another vector".to_string(),
                _ => "another array".to_string(),
            };
            let title = format!("{needed} is needed here, not {}", found.words());
            self.fault(Diagnostic::error(codes::L009, title, e.span, found.words()));
        }
        Some(entry)
    }

    /// Whether a name without indices is that of a vector or matrix, not of an array.
    fn names_vector(&mut self, cx: &Reading<'_>, path: &'a ast::Path) -> bool {
        let whole = path.parts.last().is_some_and(|last| last.indices.is_empty());
        let decl = if whole { self.decl_of(cx.here, path, (&[], &[])) } else { None };
        decl.is_some_and(|decl| self.shapes.contains_key(&decl))
    }

    /// Whether an expression has an array of another number of indices than the one it is read for.
    fn has_other_shape(&mut self, cx: &Reading<'_>, e: &'a ast::Expr) -> bool {
        match &e.kind {
            ExprKind::Path(path) => match path.parts.as_slice() {
                [one] if one.indices.is_empty() => match self.flat.names.value(cx.here.scope, &one.name.text) {
                    Some(Valued::Family(family)) => self.flat.names.value_families[family].rank() != cx.item.len(),
                    Some(Valued::One(decl)) => self.shapes.contains_key(&decl),
                    None => false,
                },
                _ => self.names_vector(cx, path),
            },
            ExprKind::Call(call) => {
                super::vectors::is_of_vectors(&call.function.text)
                    && !matches!(call.function.text.as_str(), "dot" | "norm")
            }
            ExprKind::Unary(u) => self.has_other_shape(cx, &u.operand),
            ExprKind::Binary(b) => self.has_other_shape(cx, &b.left) || self.has_other_shape(cx, &b.right),
            _ => false,
        }
    }

    /// The entry of a list with `for` that is asked for.
    fn entry(&mut self, cx: &Reading<'_>, list: &'a ast::Repeated) -> Option<Value> {
        let (first, rest) = cx.item.split_first()?;
        let from = self.whole(cx, &list.from, "where a list begins")?;
        let turn = self.repeats.turn(&list.variable, from + first - 1, cx.here);
        self.read(&Reading { item: rest, here: Here { turn, ..cx.here }, ..*cx }, &list.value)
    }

    /// `sum(i in 1..n, …)`.
    fn total(&mut self, cx: &Reading<'_>, sum: &'a ast::Repeated, span: Span) -> Option<Value> {
        let ends = (self.whole(cx, &sum.from, "where a sum begins"), self.whole(cx, &sum.to, "where a sum ends"));
        let blocks = self.open_blocks.len();
        let Some(values) = self.repeats.terms_of(ends.0?, ends.1?) else {
            self.fault(too_long(span));
            return None;
        };
        let mut terms: Vec<Expr> = Vec::new();
        let mut quantity = Quantity::Any;
        for value in values {
            let before = self.faults.len();
            let turn = self.repeats.turn(&sum.variable, value, cx.here);
            let term = self.number(&Reading { here: Here { turn, ..cx.here }, ..*cx }, &sum.value);
            self.met_in(Here { turn, ..cx.here }, before);
            let term = term?;
            self.equal(&quantity, &term.quantity, sum.value.span, "the terms of this sum");
            quantity = known_of(&quantity, &term.quantity);
            terms.push(term.expr);
            if self.open_blocks.len() == blocks {
                self.repeats.forget(turn);
            }
        }
        Some(Value::number(self.exprs.add(&terms), quantity))
    }

    /// A whole number that shapes the model; says so if it is none.
    pub fn whole(&mut self, cx: &Reading<'_>, e: &'a ast::Expr, what: &str) -> Option<i64> {
        match self.repeats.whole(&self.flat.names, cx.here, e, what) {
            Ok(value) => Some(value),
            Err(fault) => {
                self.incomplete |= fault.is_none();
                self.faults.maybe(fault.map(|f| *f));
                None
            }
        }
    }

    /// Says that something is no number.
    pub fn misplaced(&mut self, span: Span, what: &str, why: &str) -> Option<Value> {
        self.fault(
            Diagnostic::error(codes::N017, "a number is needed here", span, format!("this is {what}")).note(why),
        );
        None
    }

    fn literal(&mut self, cx: &Reading<'_>, n: &ast::Number, span: Span) -> Option<Value> {
        let Some(number) = self.exprs.decimal(&n.text) else {
            self.fault(Diagnostic::error(codes::N017, "this number cannot be read", span, "not a decimal number"));
            return None;
        };
        let Some(unit) = &n.unit else { return Some(Value::number(number, Quantity::Any)) };
        let scale = self.unit_of_number(cx, n, unit)?;
        Some(self.in_unit(number, &scale))
    }

    fn unary(&mut self, cx: &Reading<'_>, u: &'a ast::Unary) -> Option<Value> {
        match u.op {
            UnaryOp::Neg => {
                let v = self.number(cx, &u.operand)?;
                Some(Value { expr: self.exprs.neg(v.expr), ..v })
            }
            UnaryOp::Not => {
                let v = self.truth(cx, &u.operand)?;
                Some(Value { expr: self.exprs.not(v.expr), ..v })
            }
        }
    }

    fn binary(&mut self, cx: &Reading<'_>, b: &'a ast::Binary, span: Span) -> Option<Value> {
        if matches!(b.op, BinaryOp::And | BinaryOp::Or) {
            let (l, r) = (self.truth(cx, &b.left), self.truth(cx, &b.right));
            let (l, r) = (l?.expr, r?.expr);
            let expr = if b.op == BinaryOp::And { self.exprs.and(l, r) } else { self.exprs.or(l, r) };
            return Some(Value { expr, quantity: Quantity::NONE, truth: true });
        }
        let (l, r) = (self.number(cx, &b.left), self.number(cx, &b.right));
        let (l, r) = (l?, r?);
        match b.op {
            BinaryOp::Add => Some(self.sum(&l, &r, false, span)),
            BinaryOp::Sub => Some(self.sum(&l, &r, true, span)),
            BinaryOp::Mul => Some(Value::number(self.exprs.mul(&[l.expr, r.expr]), l.quantity.times(&r.quantity))),
            BinaryOp::Div => {
                let l = if is_one(&b.left) { Value { quantity: Quantity::NONE, ..l } } else { l };
                self.quotient(&l, &r, b.right.span)
            }
            BinaryOp::Pow => Some(self.power(&l, &r, b.right.span)),
            op => {
                self.equal(&l.quantity, &r.quantity, span, "the two sides");
                let expr = self.exprs.compare(comparison(op), l.expr, r.expr);
                Some(Value { expr, quantity: Quantity::NONE, truth: true })
            }
        }
    }

    pub fn sum(&mut self, l: &Value, r: &Value, minus: bool, span: Span) -> Value {
        self.equal(&l.quantity, &r.quantity, span, if minus { "what is subtracted" } else { "the terms of this sum" });
        let expr = if minus { self.exprs.sub(l.expr, r.expr) } else { self.exprs.add(&[l.expr, r.expr]) };
        Value::number(expr, known_of(&l.quantity, &r.quantity))
    }

    /// A quotient; says so where the divisor is 0.
    pub fn quotient(&mut self, l: &Value, r: &Value, span: Span) -> Option<Value> {
        if self.exprs.is_number(r.expr).is_some_and(|n| n.is_zero()) {
            self.fault(Diagnostic::error(codes::L008, "division by zero", span, "this is 0"));
            return None;
        }
        Some(Value::number(self.exprs.div(l.expr, r.expr), l.quantity.over(&r.quantity)))
    }

    pub fn power(&mut self, base: &Value, exponent: &Value, span: Span) -> Value {
        self.no_dimension(&exponent.quantity, span, "an exponent");
        let sixtieths = self.exprs.is_number(exponent.expr).and_then(|n| {
            let scaled = n.to_f64() * f64::from(WHOLE);
            (scaled == scaled.trunc() && scaled.abs() < 1e6).then_some(scaled as i32)
        });
        let quantity = match sixtieths {
            Some(n) => base.quantity.power(n),
            None if self.dims.value(&base.quantity) == Some(Dim::NONE) => Quantity::NONE,
            None => Quantity::Any,
        };
        Value::number(self.exprs.pow(base.expr, exponent.expr), quantity)
    }

    /// Requires a quantity to be a number or an angle.
    pub fn no_dimension(&mut self, quantity: &Quantity, span: Span, what: &str) {
        if let Some(dim) = self.dims.value(quantity).filter(|d| *d != Dim::NONE) {
            let title = format!("{what} has no unit, but this is in {dim}");
            let d = Diagnostic::error(codes::U006, title, span, format!("this is in {dim}"));
            return self.fault(d.hint("divide it by something of that unit"));
        }
        self.equal(quantity, &Quantity::NONE, span, what);
    }

    fn choice(&mut self, cx: &Reading<'_>, i: &'a ast::If, span: Span) -> Option<Value> {
        let counted = self.counted_truth(cx, &i.cond);
        let condition = if counted.is_some() { None } else { self.truth(cx, &i.cond).map(|value| value.expr) };
        let (yes, no) = (self.read(cx, &i.yes), self.read(cx, &i.no));
        let (yes, no) = (yes?, no?);
        if yes.truth != no.truth {
            self.fault(Diagnostic::error(
                codes::N017,
                "the two branches do not match",
                span,
                "one is a number, one a condition",
            ));
            return None;
        }
        self.equal(&yes.quantity, &no.quantity, span, "the two branches");
        let expr = match counted {
            Some(true) => yes.expr,
            Some(false) => no.expr,
            None => self.exprs.select(condition?, yes.expr, no.expr),
        };
        Some(Value { expr, quantity: known_of(&yes.quantity, &no.quantity), truth: yes.truth })
    }

    /// A comparison of variables of repetitions, with whole numbers added to them, as `i == 1`: it is no expression, so that
    /// turns in which it is alike have the same.
    fn counted_truth(&self, cx: &Reading<'_>, e: &ast::Expr) -> Option<bool> {
        match &e.kind {
            ExprKind::Unary(u) if u.op == UnaryOp::Not => Some(!self.counted_truth(cx, &u.operand)?),
            ExprKind::Binary(b) => match b.op {
                BinaryOp::And => Some(self.counted_truth(cx, &b.left)? & self.counted_truth(cx, &b.right)?),
                BinaryOp::Or => Some(self.counted_truth(cx, &b.left)? | self.counted_truth(cx, &b.right)?),
                BinaryOp::Add | BinaryOp::Sub | BinaryOp::Mul | BinaryOp::Div | BinaryOp::Pow => None,
                op => {
                    let (left, right) = (self.counted(cx, &b.left)?, self.counted(cx, &b.right)?);
                    self.repeats.counted.iter().for_each(|counted| counted.look_at_sides([&b.left, &b.right]));
                    Some(comparison(op).holds(&left, &right))
                }
            },
            _ => None,
        }
    }

    /// Something may be otherwise in a model with more cells.
    pub fn note_difference(&self) {
        self.repeats.counted.iter().for_each(Counted::note_difference);
    }

    /// There is an array of so many elements.
    pub fn note_array(&self, elements: usize) {
        self.repeats.counted.iter().for_each(|counted| counted.look_at_array(elements));
    }

    /// A whole number, the variable of a repetition, or their sum or difference.
    fn counted(&self, cx: &Reading<'_>, e: &ast::Expr) -> Option<i64> {
        match &e.kind {
            ExprKind::Number(n) if n.unit.is_none() => n.text.parse().ok(),
            ExprKind::Path(path) => match &path.parts[..] {
                [part] if part.indices.is_empty() => {
                    let name = part.name.text.as_str();
                    let is_other =
                        cx.formals.iter().any(|f| f.0 == name) || cx.law && matches!(name, "e" | "f" | "q" | "p");
                    self.repeats.variable(cx.here.turn, name).filter(|_| !is_other)
                }
                _ => None,
            },
            ExprKind::Binary(b) => {
                let (left, right) = (self.counted(cx, &b.left)?, self.counted(cx, &b.right)?);
                match b.op {
                    BinaryOp::Add => left.checked_add(right),
                    BinaryOp::Sub => left.checked_sub(right),
                    _ => None,
                }
            }
            _ => None,
        }
    }

    fn call(&mut self, cx: &Reading<'_>, call: &'a ast::Call, span: Span) -> Option<Value> {
        let name = call.function.text.as_str();
        let declared = self.flat.names.value(cx.here.scope, name);
        if let Some(Valued::One(decl)) = declared
            && let DeclKind::Function(f) = self.flat.names.decls[decl].kind
        {
            self.uses.add(Used::Value(decl), call.function.span);
            return self.call_declared(cx, decl, f, call, span);
        }
        let Some(&(_, least, most)) = FUNCTIONS.iter().find(|f| f.0 == name) else {
            self.unknown_function(cx, &call.function, declared.is_some());
            return None;
        };
        let positional = call.args.iter().filter(|a| a.label.is_none()).count();
        if positional < least || positional > most {
            let takes = if least == most { least.to_string() } else { format!("at least {least}") };
            let title =
                format!("`{name}` takes {takes} argument{}, not {positional}", if most == 1 { "" } else { "s" });
            self.fault(Diagnostic::error(codes::N007, title, span, "here").hint(usage(name)));
            return None;
        }
        match name {
            "table" => self.table_call(cx, call, span),
            "number" => self.number_call(cx, call),
            "pid" | "tf" | "delay" | "sample" => self.block(cx, name, call, span),
            _ => self.elementary(cx, name, call, span),
        }
    }

    fn unknown_function(&mut self, cx: &Reading<'_>, name: &ast::Name, is_value: bool) {
        let title = format!("there is no function `{}`", name.text);
        let d =
            Diagnostic::error(codes::N006, title, name.span, if is_value { "this is a value" } else { "not known" });
        let known = FUNCTIONS.iter().map(|f| f.0).chain(VECTOR_FUNCTIONS.iter().map(|f| f.0));
        let known = known.chain(self.visible_functions(cx.here.scope));
        self.fault(match crate::diagnostic::nearest(&name.text, known) {
            _ if is_value => d.hint(format!("write `{}*( … )` for a product", name.text)),
            _ if matches!(name.text.as_str(), "der" | "ddt" | "dot" | "derivative") => {
                d.hint("a time derivative is written with a prime: `x'`, `spring.q'`, `(a*x)'`")
            }
            Some(near) => d.hint(format!("did you mean `{near}`?")),
            None => d.hint("write `let f(x) = …` to declare one"),
        });
    }

    fn visible_functions(&self, scope: ScopeId) -> impl Iterator<Item = &'a str> + '_ {
        let names = &self.flat.names;
        names.visible_values(scope).filter(move |name| {
            matches!(names.value(scope, name), Some(Valued::One(d)) if matches!(names.decls[d].kind, DeclKind::Function(_)))
        })
    }

    fn call_declared(
        &mut self,
        cx: &Reading<'_>,
        decl: usize,
        f: &'a ast::Function,
        call: &'a ast::Call,
        span: Span,
    ) -> Option<Value> {
        let args: Vec<Option<Value>> = call.args.iter().map(|a| self.number(cx, &a.value)).collect();
        if let Some(labelled) = call.args.iter().find(|a| a.label.is_some()) {
            let title = format!("`{}` takes its arguments in order", f.name.text);
            self.fault(Diagnostic::error(codes::N007, title, labelled.span, "no name is needed here"));
            return None;
        }
        if args.len() != f.params.len() {
            let n = f.params.len();
            let title =
                format!("`{}` takes {n} argument{}, not {}", f.name.text, if n == 1 { "" } else { "s" }, args.len());
            let d = Diagnostic::error(codes::N007, title, span, "here").also(f.name.span, "declared here");
            self.fault(d);
            return None;
        }
        let args: Vec<Expr> = args.into_iter().map(|a| a.map(|v| v.expr)).collect::<Option<_>>()?;
        let (formals, body) = self.functions.get(&decl)?.clone();
        let map = formals.into_iter().zip(args).collect();
        let expr = self.exprs.substitute(body, &map);
        let quantity = match &f.unit {
            Some(unit) => self.unit(unit).map_or(Quantity::Any, |u| Quantity::of(u.dim)),
            None => Quantity::Any,
        };
        Some(Value::number(expr, quantity))
    }

    fn elementary(&mut self, cx: &Reading<'_>, name: &str, call: &'a ast::Call, span: Span) -> Option<Value> {
        if let Some(labelled) = call.args.iter().find(|a| a.label.is_some()) {
            self.fault(Diagnostic::error(
                codes::N007,
                format!("`{name}` takes no named argument"),
                labelled.span,
                "here",
            ));
            return None;
        }
        let args: Vec<Option<Value>> = call.args.iter().map(|a| self.number(cx, &a.value)).collect();
        let args: Vec<Value> = args.into_iter().collect::<Option<_>>()?;
        self.elementary_of(&args, call, span)
    }

    /// An elementary function of these numbers.
    pub fn elementary_of(&mut self, args: &[Value], call: &'a ast::Call, span: Span) -> Option<Value> {
        let name = call.function.text.as_str();
        let f = Function::named(if name == "ln" { "log" } else { name })?;
        let quantity = self.function_units(f, args, call, span);
        let exprs: Vec<Expr> = args.iter().map(|a| a.expr).collect();
        let expr = match exprs.as_slice() {
            [first, rest @ ..] if matches!(f, Function::Min | Function::Max) => {
                rest.iter().fold(*first, |a, b| self.exprs.call(f, &[a, *b]))
            }
            all => self.exprs.call(f, all),
        };
        Some(Value::number(expr, quantity))
    }

    fn function_units(&mut self, f: Function, args: &[Value], call: &ast::Call, span: Span) -> Quantity {
        use Function::*;
        match f {
            Sqrt => args[0].quantity.power(WHOLE / 2),
            Abs | Floor => args[0].quantity.clone(),
            Sign => Quantity::NONE,
            Min | Max | Mod | Atan2 => {
                let mut all = args[0].quantity.clone();
                for other in &args[1..] {
                    self.equal(&all, &other.quantity, span, "the arguments");
                    all = known_of(&all, &other.quantity);
                }
                if f == Atan2 { Quantity::NONE } else { all }
            }
            _ => {
                let what = format!("the argument of `{}`", f.name());
                self.no_dimension(&args[0].quantity, call.args[0].span, &what);
                // Of plain numbers it is a plain number.
                if args[0].quantity == Quantity::Any { Quantity::Any } else { Quantity::NONE }
            }
        }
    }
}

/// The one of two equal quantities that is known.
pub(super) fn known_of(a: &Quantity, b: &Quantity) -> Quantity {
    if *a == Quantity::Any { b.clone() } else { a.clone() }
}

fn comparison(op: BinaryOp) -> Comparison {
    match op {
        BinaryOp::Lt => Comparison::Lt,
        BinaryOp::Le => Comparison::Le,
        BinaryOp::Gt => Comparison::Gt,
        BinaryOp::Ge => Comparison::Ge,
        BinaryOp::Eq => Comparison::Eq,
        _ => Comparison::Ne,
    }
}

/// Whether it is the 1 of a reciprocal `1/x`, which has no unit; any other number may have one.
fn is_one(e: &ast::Expr) -> bool {
    matches!(&e.kind, ExprKind::Number(n) if n.unit.is_none() && n.text == "1")
}

/// How a function is written.
fn usage(name: &str) -> String {
    match name {
        "table" => "write `table(\"file.csv\", x)`".to_string(),
        "number" => "write `number(\"file.tir\", \"NAME\")`".to_string(),
        "pid" => "write `pid(u, kp, ki, kd)`".to_string(),
        "tf" => "write `tf(u, [num], [den])`, highest power of s first".to_string(),
        "delay" | "sample" => format!("write `{name}(u, T)`"),
        "min" | "max" | "mod" => format!("write `{name}(a, b)`"),
        "atan2" => "write `atan2(y, x)`".to_string(),
        _ => format!("write `{name}(x)`"),
    }
}
