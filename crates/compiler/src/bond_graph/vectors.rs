//! Vectors and matrices in expressions: unrolled to numbers while they are read.

use super::builder::{Builder, Value};
use super::dimension::Quantity;
use super::families::FamilyId;
use super::multibonds::Width;
use super::repeat::too_long;
use super::scope::{DeclId, DeclKind, Here, Node, Valued};
use super::uses::Used;
use super::value::{Reading, known_of};
use crate::algebra::{Function, MINUS_ONE, Rational, unit_vector};
use crate::ast::{self, BinaryOp, ExprKind, UnaryOp};
use crate::diagnostic::{Diagnostic, codes};
use crate::span::Span;
use crate::unit::WHOLE;

/// Functions of vectors and matrices, with the numbers of their arguments.
pub(super) const VECTOR_FUNCTIONS: [(&str, usize); 8] =
    [("dot", 2), ("cross", 2), ("transpose", 1), ("skew", 1), ("norm", 1), ("unit", 1), ("diag", 1), ("identity", 1)];

/// A number, a vector or a matrix: its extents, and its entries row by row.
#[derive(Debug, Clone)]
pub(super) struct Shaped {
    /// How many entries there are each way; empty for a number.
    pub shape: Vec<usize>,
    /// The entries, the last index fastest.
    pub items: Vec<Value>,
}

impl Shaped {
    fn scalar(value: Value) -> Shaped {
        Shaped { shape: Vec::new(), items: vec![value] }
    }

    fn is_scalar(&self) -> bool {
        self.shape.is_empty()
    }

    /// What it is, in words.
    pub fn words(&self) -> String {
        match self.shape.as_slice() {
            [] => "a number".to_string(),
            [n] => format!("a vector of {n}"),
            [r, c] => format!("a matrix of {r} by {c}"),
            more => {
                let list: Vec<String> = more.iter().map(usize::to_string).collect();
                format!("an array of {}", list.join(" by "))
            }
        }
    }

    /// The entry of these indices, from 1.
    pub fn entry(&self, indices: &[i64]) -> Option<&Value> {
        if indices.len() != self.shape.len() {
            return None;
        }
        let mut at = 0;
        for (index, extent) in indices.iter().zip(&self.shape) {
            let index = usize::try_from(index - 1).ok().filter(|i| i < extent)?;
            at = at * extent + index;
        }
        self.items.get(at)
    }

    /// All indices of its entries, in order.
    pub fn indices(&self) -> Vec<Vec<i64>> {
        self.shape.iter().fold(vec![Vec::new()], |all, extent| {
            let longer =
                |i: &Vec<i64>| (1..=*extent as i64).map(|at| [i.as_slice(), &[at]].concat()).collect::<Vec<_>>();
            all.iter().flat_map(longer).collect()
        })
    }
}

impl<'a> Builder<'a, '_> {
    /// Reads a number, a vector or a matrix. `None` if it is at fault, which has been said.
    pub fn shaped(&mut self, cx: &Reading<'_>, e: &'a ast::Expr) -> Option<Shaped> {
        match &e.kind {
            ExprKind::List(list) => {
                let rows: Vec<Option<Shaped>> = list.iter().map(|entry| self.shaped(cx, entry)).collect();
                self.stacked(rows.into_iter().collect::<Option<_>>()?, e.span)
            }
            ExprKind::Repeated(list) => self.listed(cx, list, e.span),
            ExprKind::Path(path) => self.shaped_path(cx, path),
            ExprKind::Call(call) => self.shaped_call(cx, call, e),
            ExprKind::Rate(inner) => {
                let inner = self.shaped(cx, inner)?;
                let items = inner.items.into_iter().map(|value| self.rate_of_value(cx, &value, e.span));
                let items = items.collect::<Option<_>>()?;
                Some(Shaped { shape: inner.shape, items })
            }
            ExprKind::Unary(u) if u.op == UnaryOp::Neg => {
                let Shaped { shape, items } = self.shaped(cx, &u.operand)?;
                let items = items.into_iter().map(|v| Value { expr: self.exprs.neg(v.expr), ..v }).collect();
                Some(Shaped { shape, items })
            }
            ExprKind::Binary(b) if is_arithmetic(b.op) && self.may_be_shaped(cx, e) => self.shaped_binary(cx, b, e),
            ExprKind::If(i) if self.may_be_shaped(cx, e) => {
                let condition = self.truth(cx, &i.cond);
                let (yes, no) = (self.shaped(cx, &i.yes), self.shaped(cx, &i.no));
                let (condition, yes, no) = (condition?, yes?, no?);
                self.alike(&yes, &no, e.span, "the two branches")?;
                let pairs: Vec<(Value, Value)> = yes.items.into_iter().zip(no.items).collect();
                let items = pairs.into_iter().map(|(y, n)| {
                    self.equal(&y.quantity, &n.quantity, e.span, "the two branches");
                    let expr = self.exprs.select(condition.expr, y.expr, n.expr);
                    Value::number(expr, known_of(&y.quantity, &n.quantity))
                });
                Some(Shaped { items: items.collect(), shape: yes.shape })
            }
            ExprKind::Sum(sum) if self.may_be_shaped(cx, e) => self.shaped_total(cx, sum, e.span),
            _ => self.number(cx, e).map(Shaped::scalar),
        }
    }

    /// Reads what is given for one of so many strands: a number for all, or a vector with an entry for each.
    pub fn strand_of(&mut self, cx: &Reading<'_>, e: &'a ast::Expr, at: usize, of: usize) -> Option<Value> {
        let found = self.shaped(cx, e)?;
        match found.shape.as_slice() {
            [] => found.items.into_iter().next(),
            [n] if *n == of => found.items.into_iter().nth(at),
            _ => {
                let title = format!("a number or a vector of {of} is needed, not {}", found.words());
                let d = Diagnostic::error(codes::L009, title, e.span, found.words());
                self.fault(d.hint("give one value for all bonds, or one for each: `[a, b, c]`"));
                None
            }
        }
    }

    /// Whether an expression may be more than a number: it has a list, a function of vectors or a name of several values in it.
    pub fn may_be_shaped(&mut self, cx: &Reading<'_>, e: &'a ast::Expr) -> bool {
        match &e.kind {
            ExprKind::List(_) | ExprKind::Repeated(_) => true,
            ExprKind::Number(_) | ExprKind::Text(_) | ExprKind::Missing => false,
            ExprKind::Path(path) => self.names_several(cx, path),
            ExprKind::Rate(inner) => self.may_be_shaped(cx, inner),
            ExprKind::Call(call) => {
                is_of_vectors(&call.function.text)
                    || is_of_one(&call.function.text) && call.args.iter().any(|a| self.may_be_shaped(cx, &a.value))
            }
            ExprKind::Unary(u) => self.may_be_shaped(cx, &u.operand),
            ExprKind::Binary(b) => {
                is_arithmetic(b.op) && (self.may_be_shaped(cx, &b.left) || self.may_be_shaped(cx, &b.right))
            }
            ExprKind::If(i) => self.may_be_shaped(cx, &i.yes) || self.may_be_shaped(cx, &i.no),
            // What is added up may read the variable of the sum, which is not known here.
            ExprKind::Sum(sum) => self.reads_several(cx, &sum.value),
        }
    }

    /// The same, without looking at indices.
    fn reads_several(&mut self, cx: &Reading<'_>, e: &'a ast::Expr) -> bool {
        match &e.kind {
            ExprKind::Path(path) if path.parts.iter().any(|p| !p.indices.is_empty()) => false,
            ExprKind::Call(call) if matches!(call.function.text.as_str(), "dot" | "norm") => false,
            ExprKind::Unary(u) => self.reads_several(cx, &u.operand),
            ExprKind::Binary(b) => self.reads_several(cx, &b.left) || self.reads_several(cx, &b.right),
            _ => self.may_be_shaped(cx, e),
        }
    }

    /// Whether a name without indices stands for several values.
    fn names_several(&mut self, cx: &Reading<'_>, path: &'a ast::Path) -> bool {
        let Some(last) = path.parts.last() else { return false };
        if !last.indices.is_empty() {
            return false;
        }
        if let [one] = path.parts.as_slice() {
            let text = one.name.text.as_str();
            if cx.formals.iter().any(|(n, _)| *n == text) || self.repeats.variable(cx.here.turn, text).is_some() {
                return false;
            }
            if self.own_width(cx, text).is_some() {
                return true;
            }
            return match self.flat.names.value(cx.here.scope, text) {
                Some(Valued::Family(_)) => true,
                Some(Valued::One(decl)) => self.shapes.contains_key(&decl),
                None => false,
            };
        }
        match self.flat.names.walk_wide(&mut self.repeats, cx.here, path, &mut |_, _| {}) {
            Ok((Node::Family(_), used)) => used + 1 == path.parts.len(),
            Ok((Node::Instance(inner), used)) if used + 1 == path.parts.len() => {
                match self.flat.names.scopes[inner].values.get(last.name.text.as_str()) {
                    Some(Valued::Family(_)) => true,
                    Some(Valued::One(decl)) => self.shapes.contains_key(decl),
                    None => false,
                }
            }
            Ok((Node::Part(part), used)) => {
                let whole = used + 2 == path.parts.len() && path.parts[used].indices.is_empty();
                whole && matches!(self.part(part).width, Width::Matrix { .. })
            }
            _ => false,
        }
    }

    /// How many bonds the element has whose own variable a bare name is.
    fn own_width(&self, cx: &Reading<'_>, name: &str) -> Option<(usize, usize)> {
        let part = cx.own.filter(|_| cx.law)?;
        let p = self.part(part);
        let has = match name {
            "e" | "f" => true,
            "q" => p.word == super::flatten::Word::C,
            "p" => p.word == super::flatten::Word::I,
            _ => false,
        };
        match p.width {
            Width::Field(n) if has => Some((part, n)),
            _ => None,
        }
    }

    fn shaped_path(&mut self, cx: &Reading<'_>, path: &'a ast::Path) -> Option<Shaped> {
        if !self.names_several(cx, path) {
            return self.path(cx, path).map(Shaped::scalar);
        }
        let last = path.parts.last()?;
        if let [one] = path.parts.as_slice() {
            let text = one.name.text.as_str();
            if let Some((part, n)) = self.own_width(cx, text) {
                let items = (0..n).map(|port| self.port_variable(part, port, text)).collect::<Option<_>>()?;
                return Some(Shaped { shape: vec![n], items });
            }
            let value = self.flat.names.value(cx.here.scope, text)?;
            return self.whole_value(value, one);
        }
        let uses = &mut self.uses;
        let visit = &mut |node, span| uses.add(Used::Node(node), span);
        let (node, used) = self.flat.names.walk_wide(&mut self.repeats, cx.here, path, visit).ok()?;
        match node {
            Node::Family(family) => self.whole_family(family, path, used),
            Node::Instance(inner) => {
                let value = *self.flat.names.scopes[inner].values.get(last.name.text.as_str())?;
                self.whole_value(value, last)
            }
            Node::Part(part) => self.side_variable(part, &path.parts[used].name, &last.name),
            _ => None,
        }
    }

    /// The variables at one side of a wide two-port: `axis.out.f`.
    fn side_variable(&mut self, part: usize, side: &'a ast::Name, variable: &'a ast::Name) -> Option<Shaped> {
        let fits = matches!(side.text.as_str(), "in" | "out") && matches!(variable.text.as_str(), "e" | "f");
        if !fits {
            let title = format!("`{}` has no `{}.{}`", self.part(part).name, side.text, variable.text);
            let d = Diagnostic::error(codes::N018, title, variable.span, "not a variable of this element");
            self.fault(d.hint("it has in.e, in.f, out.e and out.f, each a vector"));
            return None;
        }
        let ports = self.part(part).side(side.text == "in");
        let n = ports.len();
        let items = ports.map(|port| self.port_variable(part, port, &variable.text)).collect::<Option<_>>()?;
        Some(Shaped { shape: vec![n], items })
    }

    /// A variable of all of several nodes side by side: `v.f`, `body.p`.
    fn whole_family(&mut self, family: FamilyId, path: &'a ast::Path, used: usize) -> Option<Shaped> {
        let nodes = &self.flat.names.node_families[family];
        let Some(n) = nodes.row() else {
            let d = Diagnostic::error(codes::N021, "which of them?", path.parts[used - 1].name.span, "it has indices");
            self.fault(d.note("several side by side have the indices 1, 2, … without a gap"));
            return None;
        };
        let nodes: Vec<Node> = (1..=n as i64).filter_map(|at| nodes.element(&[at])).map(|(node, _)| *node).collect();
        let variable = &path.parts[used].name;
        let items = nodes.into_iter().map(|node| self.variable_of(node, variable)).collect::<Option<_>>()?;
        Some(Shaped { shape: vec![n], items })
    }

    /// All elements of a named array, or the entries of a named vector or matrix.
    fn whole_value(&mut self, value: Valued, part: &'a ast::PathPart) -> Option<Shaped> {
        self.uses.add(Used::of(value), part.name.span);
        match value {
            Valued::One(decl) => self.shapes.get(&decl).cloned(),
            Valued::Family(family) => {
                let whole = &self.flat.names.value_families[family];
                let Some(shape) = whole.shape() else {
                    let title = format!("`{}` is no whole array", part.name.text);
                    let d = Diagnostic::error(codes::N021, title, part.name.span, "used as a vector");
                    self.fault(d.note(whole.words(&part.name.text)).hint("its indices begin at 1, without a gap"));
                    return None;
                };
                let indices = Shaped { shape: shape.clone(), items: Vec::new() }.indices();
                let decls: Vec<DeclId> = indices.iter().filter_map(|i| whole.element(i)).copied().collect();
                self.note_array(decls.len());
                let items = decls.into_iter().map(|decl| self.declared(decl, part.name.span)).collect::<Option<_>>()?;
                Some(Shaped { shape, items })
            }
        }
    }

    /// Entries side by side become a vector, rows a matrix.
    fn stacked(&mut self, rows: Vec<Shaped>, span: Span) -> Option<Shaped> {
        let first = rows.first().map_or(Vec::new(), |row| row.shape.clone());
        if let Some(odd) = rows.iter().find(|row| row.shape != first) {
            let title = format!("the entries of a list are alike, not {} and {}", rows[0].words(), odd.words());
            let d = Diagnostic::error(codes::L009, title, span, "this list");
            self.fault(d.hint("a matrix is a list of rows of one length: `[[a, b], [c, d]]`"));
            return None;
        }
        let shape = std::iter::once(rows.len()).chain(first).collect();
        Some(Shaped { shape, items: rows.into_iter().flat_map(|row| row.items).collect() })
    }

    /// `[… for i in 1..n]`.
    fn listed(&mut self, cx: &Reading<'_>, list: &'a ast::Repeated, span: Span) -> Option<Shaped> {
        let mut rows = Vec::new();
        self.in_turns(cx, list, span, &mut |b, cx| {
            rows.push(b.shaped(cx, &list.value)?);
            Some(())
        })?;
        self.stacked(rows, span)
    }

    /// A sum of vectors or matrices.
    fn shaped_total(&mut self, cx: &Reading<'_>, sum: &'a ast::Repeated, span: Span) -> Option<Shaped> {
        let mut total: Option<Shaped> = None;
        self.in_turns(cx, sum, span, &mut |b, cx| {
            let term = b.shaped(cx, &sum.value)?;
            total = Some(match total.take() {
                None => term,
                Some(before) => b.added(before, term, false, span)?,
            });
            Some(())
        })?;
        Some(total.unwrap_or_else(|| Shaped::scalar(Value::number(self.exprs.int(0), Quantity::Any))))
    }

    /// Reads something for each value of the variable of a list or sum.
    fn in_turns(
        &mut self,
        cx: &Reading<'_>,
        list: &'a ast::Repeated,
        span: Span,
        read: &mut dyn FnMut(&mut Self, &Reading<'_>) -> Option<()>,
    ) -> Option<()> {
        let from = self.whole(cx, &list.from, "where a list begins")?;
        let to = self.whole(cx, &list.to, "where a list ends")?;
        let blocks = self.open_blocks.len();
        let Some(values) = self.repeats.terms_of(from, to) else {
            self.fault(too_long(span));
            return None;
        };
        for value in values {
            let turn = self.repeats.turn(&list.variable, value, cx.here);
            read(self, &Reading { here: Here { turn, ..cx.here }, ..*cx })?;
            if self.open_blocks.len() == blocks {
                self.repeats.forget(turn);
            }
        }
        Some(())
    }

    fn alike(&mut self, a: &Shaped, b: &Shaped, span: Span, what: &str) -> Option<()> {
        if a.shape == b.shape {
            return Some(());
        }
        let title = format!("{what} differ in shape: {} and {}", a.words(), b.words());
        self.fault(Diagnostic::error(codes::L009, title, span, "here"));
        None
    }

    fn added(&mut self, a: Shaped, b: Shaped, minus: bool, span: Span) -> Option<Shaped> {
        self.alike(&a, &b, span, if minus { "what is subtracted" } else { "the terms of this sum" })?;
        let pairs: Vec<(Value, Value)> = a.items.into_iter().zip(b.items).collect();
        let items = pairs.iter().map(|(a, b)| self.sum(a, b, minus, span)).collect();
        Some(Shaped { shape: a.shape, items })
    }

    fn product(&mut self, a: &Value, b: &Value) -> Value {
        Value::number(self.exprs.mul(&[a.expr, b.expr]), a.quantity.times(&b.quantity))
    }

    /// The sum of products of entries.
    fn inner_product(&mut self, pairs: &[(&Value, &Value)], span: Span) -> Value {
        let mut total = Value::number(self.exprs.int(0), Quantity::Any);
        for (a, b) in pairs {
            let zero = |v: &Value, x: &crate::algebra::Exprs| x.is_number(v.expr).is_some_and(|n| n.is_zero());
            if zero(a, &self.exprs) || zero(b, &self.exprs) {
                continue;
            }
            let term = self.product(a, b);
            total = self.sum(&total, &term, false, span);
        }
        Value { expr: self.exprs.whole(total.expr), ..total }
    }

    fn shaped_binary(&mut self, cx: &Reading<'_>, b: &'a ast::Binary, e: &'a ast::Expr) -> Option<Shaped> {
        let (l, r) = (self.shaped(cx, &b.left), self.shaped(cx, &b.right));
        let (l, r) = (l?, r?);
        let span = e.span;
        match b.op {
            BinaryOp::Add => self.added(l, r, false, span),
            BinaryOp::Sub => self.added(l, r, true, span),
            BinaryOp::Mul => self.multiplied(&l, &r, span),
            BinaryOp::Div => self.entrywise(&l, &r, span, "a quotient", &mut |b, l, r| b.quotient(l, r, span)),
            _ => self.entrywise(&l, &r, span, "a power", &mut |b, l, r| Some(b.power(l, r, span))),
        }
    }

    /// Entry by entry, where one of the two is a number or both are vectors of one length.
    fn entrywise(
        &mut self,
        l: &Shaped,
        r: &Shaped,
        span: Span,
        what: &str,
        of: &mut dyn FnMut(&mut Self, &Value, &Value) -> Option<Value>,
    ) -> Option<Shaped> {
        let shape = match (l.is_scalar(), r.is_scalar()) {
            (_, true) => l.shape.clone(),
            (true, false) if r.shape.len() == 1 => r.shape.clone(),
            _ if l.shape == r.shape && l.shape.len() == 1 => l.shape.clone(),
            _ => {
                let title = format!("there is no such thing as {what} of {} and {}", l.words(), r.words());
                self.fault(Diagnostic::error(codes::L009, title, span, "here"));
                return None;
            }
        };
        let count = l.items.len().max(r.items.len());
        let entry = |s: &Shaped, at: usize| s.items[if s.is_scalar() { 0 } else { at }].clone();
        let items = (0..count).map(|at| of(self, &entry(l, at), &entry(r, at))).collect::<Option<_>>()?;
        Some(Shaped { shape, items })
    }

    fn multiplied(&mut self, l: &Shaped, r: &Shaped, span: Span) -> Option<Shaped> {
        if l.is_scalar() || r.is_scalar() {
            let (factor, other) = if l.is_scalar() { (l, r) } else { (r, l) };
            let items = other.items.iter().map(|item| self.product(&factor.items[0], item)).collect();
            return Some(Shaped { shape: other.shape.clone(), items });
        }
        match (l.shape.as_slice(), r.shape.as_slice()) {
            ([n], [m]) if n == m => {
                let items = l.items.iter().zip(&r.items).map(|(a, b)| self.product(a, b)).collect();
                Some(Shaped { shape: l.shape.clone(), items })
            }
            ([rows, inner], [n, rest @ ..]) if inner == n && rest.len() < 2 => {
                let columns = rest.first().copied().unwrap_or(1);
                let mut items = Vec::with_capacity(rows * columns);
                for row in 0..*rows {
                    for column in 0..columns {
                        let pairs: Vec<(&Value, &Value)> =
                            (0..*inner).map(|k| (&l.items[row * inner + k], &r.items[k * columns + column])).collect();
                        items.push(self.inner_product(&pairs, span));
                    }
                }
                let shape = std::iter::once(*rows).chain(rest.iter().copied()).collect();
                Some(Shaped { shape, items })
            }
            _ => {
                let title = format!("{} cannot be multiplied by {}", l.words(), r.words());
                let d = Diagnostic::error(codes::L009, title, span, "here");
                let hint = match (l.shape.len(), r.shape.len()) {
                    (1, 2) => "a vector stands on the right of a matrix: `transpose(M)*v`",
                    (1, 1) => "products of vectors are `dot(a, b)` and `cross(a, b)`",
                    _ => "the left one has as many columns as the right one has rows",
                };
                self.fault(d.hint(hint));
                None
            }
        }
    }

    fn shaped_call(&mut self, cx: &Reading<'_>, call: &'a ast::Call, e: &'a ast::Expr) -> Option<Shaped> {
        let name = call.function.text.as_str();
        let own = VECTOR_FUNCTIONS.iter().find(|f| f.0 == name);
        if self.flat.names.value(cx.here.scope, name).is_some() || own.is_none() && !self.may_be_shaped(cx, e) {
            return self.number(cx, e).map(Shaped::scalar);
        }
        let Some(&(_, needed)) = own else { return self.entry_by_entry(cx, call, e.span) };
        if call.args.len() != needed || call.args.iter().any(|a| a.label.is_some()) {
            let plural = if needed == 1 { "" } else { "s" };
            let title = format!("`{name}` takes {needed} argument{plural}, not {}", call.args.len());
            self.fault(Diagnostic::error(codes::N007, title, e.span, "here"));
            return None;
        }
        if name == "identity" {
            let n = self.whole(cx, &call.args[0].value, "the size of a matrix")?;
            let n = usize::try_from(n).ok().filter(|n| (1..=1000).contains(n))?;
            let (one, zero) = (self.exprs.int(1), self.exprs.int(0));
            let entry = |at: usize| Value::number(if at / n == at % n { one } else { zero }, Quantity::Any);
            return Some(Shaped { shape: vec![n, n], items: (0..n * n).map(entry).collect() });
        }
        let args: Vec<Option<Shaped>> = call.args.iter().map(|a| self.shaped(cx, &a.value)).collect();
        let args: Vec<Shaped> = args.into_iter().collect::<Option<_>>()?;
        self.vector_function(name, &args, e.span)
    }

    fn vector_function(&mut self, name: &str, args: &[Shaped], span: Span) -> Option<Shaped> {
        let zero = || Value::number(crate::algebra::ZERO, Quantity::Any);
        let negative = |b: &mut Self, v: &Value| Value { expr: b.exprs.neg(v.expr), ..v.clone() };
        match (name, args) {
            ("dot", [a, b]) if a.shape.len() == 1 && a.shape == b.shape => {
                let pairs: Vec<(&Value, &Value)> = a.items.iter().zip(&b.items).collect();
                Some(Shaped::scalar(self.inner_product(&pairs, span)))
            }
            ("norm", [a]) if a.shape.len() == 1 => {
                let pairs: Vec<(&Value, &Value)> = a.items.iter().zip(&a.items).collect();
                let square = self.inner_product(&pairs, span);
                let expr = match self.exprs.is_number(square.expr).map(Rational::to_f64) {
                    // Roots that are kept exactly would stand in everything that is turned about an axis.
                    Some(square) => self.exprs.float(square.sqrt()),
                    None => self.exprs.call(Function::Sqrt, &[square.expr]),
                };
                Some(Shaped::scalar(Value::number(expr, square.quantity.power(WHOLE / 2))))
            }
            ("unit", [a]) if a.shape.len() == 1 => self.direction(a, span),
            ("cross", [a, b]) if a.shape == [3] && b.shape == [3] => {
                let mut items = Vec::with_capacity(3);
                for k in 0..3 {
                    let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                    let minus = negative(self, &a.items[j]);
                    items.push(self.inner_product(&[(&a.items[i], &b.items[j]), (&minus, &b.items[i])], span));
                }
                Some(Shaped { shape: vec![3], items })
            }
            ("skew", [a]) if a.shape == [3] => {
                let [x, y, z] = [0, 1, 2].map(|k| a.items[k].clone());
                let [nx, ny, nz] = [&x, &y, &z].map(|v| negative(self, v));
                Some(Shaped { shape: vec![3, 3], items: vec![zero(), nz, y, z, zero(), nx, ny, x, zero()] })
            }
            ("transpose", [a]) if a.shape.len() == 2 => {
                let [rows, columns] = [a.shape[0], a.shape[1]];
                let items = (0..rows * columns).map(|at| a.items[at % rows * columns + at / rows].clone()).collect();
                Some(Shaped { shape: vec![columns, rows], items })
            }
            ("diag", [a]) if a.shape.len() == 1 => {
                let n = a.shape[0];
                let entry = |at: usize| if at / n == at % n { a.items[at / n].clone() } else { zero() };
                Some(Shaped { shape: vec![n, n], items: (0..n * n).map(entry).collect() })
            }
            _ => {
                let found: Vec<String> = args.iter().map(Shaped::words).collect();
                let needs = match name {
                    "dot" => "two vectors of one length",
                    "cross" => "two vectors of 3",
                    "skew" => "a vector of 3",
                    "transpose" => "a matrix",
                    _ => "a vector",
                };
                let title = format!("`{name}` takes {needs}, not {}", found.join(" and "));
                self.fault(Diagnostic::error(codes::L009, title, span, "here"));
                None
            }
        }
    }

    /// The direction of a vector. Of numbers, the squares of its entries add up to 1 exactly: where they did so to rounding
    /// alone, loops would depend by rounding on joints outside of them.
    fn direction(&mut self, a: &Shaped, span: Span) -> Option<Shaped> {
        let pairs: Vec<(&Value, &Value)> = a.items.iter().zip(&a.items).collect();
        let square = self.inner_product(&pairs, span);
        let length = square.quantity.power(WHOLE / 2);
        let numbers: Option<Vec<Rational>> = a.items.iter().map(|v| self.exprs.is_number(v.expr).cloned()).collect();
        let exact = numbers.and_then(|numbers| unit_vector(&numbers));
        let less_one = self.exprs.add(&[square.expr, MINUS_ONE]);
        let items = match exact {
            Some(exact) => exact.into_iter().map(|n| self.exprs.number(n)).collect(),
            None if self.exprs.is_zero(less_one) => a.items.iter().map(|v| v.expr).collect(),
            None => {
                let length = Value::number(self.exprs.call(Function::Sqrt, &[square.expr]), length.clone());
                let parts = a.items.iter().map(|v| self.quotient(v, &length, span).map(|v| v.expr));
                parts.collect::<Option<Vec<_>>>()?
            }
        };
        let quantities = a.items.iter().map(|v| v.quantity.over(&length));
        let items = items.into_iter().zip(quantities).map(|(expr, quantity)| Value::number(expr, quantity)).collect();
        Some(Shaped { shape: a.shape.clone(), items })
    }

    /// A function of numbers, of every entry of a vector or matrix.
    fn entry_by_entry(&mut self, cx: &Reading<'_>, call: &'a ast::Call, span: Span) -> Option<Shaped> {
        let [arg] = call.args.as_slice() else { return None };
        let Shaped { shape, items } = self.shaped(cx, &arg.value)?;
        let items = items.into_iter().map(|item| self.elementary_of(&[item], call, span)).collect::<Option<_>>()?;
        Some(Shaped { shape, items })
    }

    /// The value of a signal that comes along half arrows.
    pub fn joined_signal(&mut self, decl: DeclId) -> Option<()> {
        let d = &self.flat.names.decls[decl];
        let DeclKind::Joined(Some(from)) = d.kind else { return None };
        let value = *self.flat.names.scopes[from].values.get(d.own)?;
        match value {
            Valued::One(source) if !self.shapes.contains_key(&source) => {
                self.values[decl] = self.values[source].clone();
            }
            Valued::One(source) => {
                let shaped = self.shapes[&source].clone();
                self.shapes.insert(decl, shaped);
            }
            Valued::Family(_) => return None,
        }
        Some(())
    }

    /// What a signal of a port is read from.
    pub fn source_of_joined(&self, decl: DeclId) -> Option<(DeclId, Span)> {
        let d = &self.flat.names.decls[decl];
        let DeclKind::Joined(Some(from)) = d.kind else { return None };
        match self.flat.names.scopes[from].values.get(d.own) {
            Some(&Valued::One(source)) => Some((source, d.span)),
            _ => None,
        }
    }
}

fn is_arithmetic(op: BinaryOp) -> bool {
    matches!(op, BinaryOp::Add | BinaryOp::Sub | BinaryOp::Mul | BinaryOp::Div | BinaryOp::Pow)
}

/// Whether a function takes vectors or matrices as wholes.
pub(super) fn is_of_vectors(name: &str) -> bool {
    VECTOR_FUNCTIONS.iter().any(|f| f.0 == name)
}

/// Whether a function takes one number, and so every entry of a vector.
fn is_of_one(name: &str) -> bool {
    matches!(
        name,
        "sin"
            | "cos"
            | "tan"
            | "asin"
            | "acos"
            | "atan"
            | "sinh"
            | "cosh"
            | "tanh"
            | "exp"
            | "log"
            | "ln"
            | "log10"
            | "sqrt"
            | "abs"
            | "sign"
            | "floor"
    )
}
