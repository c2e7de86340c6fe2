//! Numbers that are known when the model is compiled, calculated exactly.

use super::repeat::{Key, Known, Repeats, Unknown, too_long};
use super::scope::{DeclId, DeclKind, Here, Names, Node, ScopeId, Valued};
use crate::algebra::Rational;
use crate::ast::{self, BinaryOp, ExprKind, UnaryOp};
use crate::diagnostic::{Diagnostic, codes};
use crate::span::Span;

/// The greatest depth of expressions and names in a number that shapes a model.
const MAX_DEPTH: usize = 1500;

/// Words for what follows from something that is not known.
const FOLLOWS: &str = "this follows from what is not known";

/// A number or a truth value.
enum Fixed {
    Number(Rational),
    Truth(bool),
}

impl<'a> Repeats<'a> {
    /// The number that an expression is. Of one for all elements of an array, that of the element `item`.
    pub fn number(
        &mut self,
        names: &Names<'a>,
        here: Here,
        e: &'a ast::Expr,
        item: &[i64],
    ) -> Result<Rational, Unknown> {
        match self.fixed(names, here, e, item)? {
            Fixed::Number(number) => Ok(number),
            Fixed::Truth(_) => Err(Unknown::Reads(e.span, "this is true or false".to_string())),
        }
    }

    pub fn truth(&mut self, names: &Names<'a>, here: Here, e: &'a ast::Expr) -> Result<bool, Unknown> {
        match self.fixed(names, here, e, &[])? {
            Fixed::Truth(truth) => Ok(truth),
            Fixed::Number(_) => {
                let d = Diagnostic::error(codes::N017, "a condition is needed here", e.span, "this is a number");
                Err(Unknown::Fault(Box::new(d.hint("compare it, such as `i == 1`"))))
            }
        }
    }

    fn fixed(&mut self, names: &Names<'a>, here: Here, e: &'a ast::Expr, item: &[i64]) -> Result<Fixed, Unknown> {
        self.depth += 1;
        let value = match self.depth > MAX_DEPTH {
            true => Err(Unknown::Reads(e.span, "too many names lead from one to another".to_string())),
            false => self.fixed_of(names, here, e, item),
        };
        self.depth -= 1;
        value
    }

    fn fixed_of(&mut self, names: &Names<'a>, here: Here, e: &'a ast::Expr, item: &[i64]) -> Result<Fixed, Unknown> {
        let other = |what: &str| Err(Unknown::Reads(e.span, what.to_string()));
        match &e.kind {
            ExprKind::Number(n) if n.unit.is_some() => other("this has a unit"),
            ExprKind::Number(n) => match Rational::from_decimal(&n.text) {
                Some(number) => Ok(Fixed::Number(number)),
                None => other("this number cannot be read"),
            },
            ExprKind::Path(path) => self.path(names, here, path, item).map(Fixed::Number),
            ExprKind::Unary(u) if u.op == UnaryOp::Not => Ok(Fixed::Truth(!self.truth(names, here, &u.operand)?)),
            ExprKind::Unary(u) => Ok(Fixed::Number(-&self.number(names, here, &u.operand, item)?)),
            ExprKind::Binary(b) => self.binary(names, here, b, item),
            ExprKind::If(i) => {
                let chosen = if self.truth(names, here, &i.cond)? { &i.yes } else { &i.no };
                self.fixed(names, here, chosen, item)
            }
            ExprKind::Call(call) => self.call(names, here, call, e.span, item).map(Fixed::Number),
            ExprKind::Sum(sum) => self.sum(names, here, sum, item).map(Fixed::Number),
            ExprKind::List(list) => match item.split_first() {
                Some((first, rest)) => match usize::try_from(first - 1).ok().and_then(|at| list.get(at)) {
                    Some(entry) => self.fixed(names, here, entry, rest),
                    None => Err(Unknown::Said),
                },
                None => other("this is a list"),
            },
            ExprKind::Repeated(list) => match item.split_first() {
                Some((first, rest)) => {
                    let from = self.range_end(names, here, &list.from)?;
                    let turn = self.turn(&list.variable, from + first - 1, here);
                    self.fixed(names, Here { turn, ..here }, &list.value, rest)
                }
                None => other("this is a list"),
            },
            ExprKind::Rate(_) => other("this is a rate"),
            ExprKind::Text(_) => other("this is text"),
            ExprKind::Missing => Err(Unknown::Said),
        }
    }

    pub fn range_end(&mut self, names: &Names<'a>, here: Here, e: &'a ast::Expr) -> Result<i64, Unknown> {
        let number = self.number(names, here, e, &[])?;
        number.as_integer().ok_or_else(|| Unknown::Reads(e.span, format!("this is {number}, no whole number")))
    }

    fn binary(&mut self, names: &Names<'a>, here: Here, b: &'a ast::Binary, item: &[i64]) -> Result<Fixed, Unknown> {
        if matches!(b.op, BinaryOp::And | BinaryOp::Or) {
            let left = self.truth(names, here, &b.left)?;
            let decided = left == (b.op == BinaryOp::Or);
            return Ok(Fixed::Truth(if decided { left } else { self.truth(names, here, &b.right)? }));
        }
        let left = self.number(names, here, &b.left, item)?;
        let right = self.number(names, here, &b.right, item)?;
        let undefined = |what: &str| Unknown::Reads(b.right.span, what.to_string());
        Ok(match b.op {
            BinaryOp::Add => Fixed::Number(&left + &right),
            BinaryOp::Sub => Fixed::Number(&left - &right),
            BinaryOp::Mul => Fixed::Number(&left * &right),
            BinaryOp::Div => Fixed::Number(left.over(&right).ok_or_else(|| undefined("this is 0"))?),
            BinaryOp::Pow => {
                let power = right.as_integer().and_then(|n| left.powi(n));
                Fixed::Number(power.ok_or_else(|| undefined("not a power that is known exactly"))?)
            }
            BinaryOp::Lt => Fixed::Truth(left < right),
            BinaryOp::Le => Fixed::Truth(left <= right),
            BinaryOp::Gt => Fixed::Truth(left > right),
            BinaryOp::Ge => Fixed::Truth(left >= right),
            BinaryOp::Eq => Fixed::Truth(left == right),
            _ => Fixed::Truth(left != right),
        })
    }

    fn call(
        &mut self,
        names: &Names<'a>,
        here: Here,
        call: &'a ast::Call,
        span: Span,
        item: &[i64],
    ) -> Result<Rational, Unknown> {
        let mut values = Vec::with_capacity(call.args.len());
        for arg in &call.args {
            values.push(self.number(names, here, &arg.value, item)?);
        }
        let unknown = |why: &str| Unknown::Reads(span, why.to_string());
        match (call.function.text.as_str(), values.as_slice()) {
            ("floor", [x]) => Ok(x.floor()),
            ("abs", [x]) => Ok(x.abs()),
            ("sign", [x]) => Ok(Rational::from(i64::from(x.signum()))),
            ("min", [first, rest @ ..]) if !rest.is_empty() => Ok(rest.iter().fold(first, Ord::min).clone()),
            ("max", [first, rest @ ..]) if !rest.is_empty() => Ok(rest.iter().fold(first, Ord::max).clone()),
            ("mod", [a, b]) => {
                let whole = a.over(b).ok_or_else(|| unknown("division by 0"))?.floor();
                Ok(a - &(b * &whole))
            }
            _ => Err(unknown("of functions only floor, abs, sign, min, max and mod are known then")),
        }
    }

    fn sum(
        &mut self,
        names: &Names<'a>,
        here: Here,
        sum: &'a ast::Repeated,
        item: &[i64],
    ) -> Result<Rational, Unknown> {
        let (from, to) = (self.range_end(names, here, &sum.from)?, self.range_end(names, here, &sum.to)?);
        let mut total = Rational::from(0);
        let turns = self.turns.len();
        for value in self.terms_of(from, to).ok_or_else(|| too_many(sum.to.span))? {
            let turn = self.turn(&sum.variable, value, here);
            total = &total + &self.number(names, Here { turn, ..here }, &sum.value, item)?;
            self.turns.truncate(turns);
        }
        Ok(total)
    }

    fn path(&mut self, names: &Names<'a>, here: Here, path: &'a ast::Path, item: &[i64]) -> Result<Rational, Unknown> {
        match path.parts.as_slice() {
            [one] if one.indices.is_empty() => self.bare(names, here, &one.name, item),
            [one] => match names.value(here.scope, &one.name.text) {
                Some(value) => self.valued(names, here, value, one, item),
                None => Err(not_known(&one.name, "not declared before")),
            },
            [.., last] => match names.node(self, here, path).map_err(Unknown::Fault)? {
                (Node::Instance(inner), used) if used + 1 == path.parts.len() => {
                    match names.scopes[inner].values.get(last.name.text.as_str()).copied() {
                        Some(value) => self.valued(names, here, value, last, item),
                        None => Err(not_known(&last.name, "not declared in the component")),
                    }
                }
                _ => Err(Unknown::Reads(path.span, "this is a variable of an element".to_string())),
            },
            [] => Err(Unknown::Said),
        }
    }

    pub fn bare(
        &mut self,
        names: &Names<'a>,
        here: Here,
        name: &'a ast::Name,
        item: &[i64],
    ) -> Result<Rational, Unknown> {
        if let Some(value) = self.variable(here.turn, &name.text) {
            if self.is_counted(here.turn, &name.text) {
                self.counted.iter_mut().for_each(|counted| {
                    counted.reads.count = true;
                    counted.reads.variable = true;
                });
            }
            return Ok(Rational::from(value));
        }
        for scope in names.around(here.scope) {
            match names.scopes[scope].values.get(name.text.as_str()) {
                Some(Valued::One(decl)) => return self.declared(names, *decl, name.span),
                Some(Valued::Family(family)) => {
                    let found = names.value_families.get(*family, name, item).map_err(Unknown::Fault)?;
                    return self.declared(names, *found, name.span);
                }
                None => {}
            }
            if let Some(d) = names.ahead.get(&(scope, name.text.as_str())) {
                return self.ahead(names, scope, d, name.span);
            }
        }
        Err(not_known(name, "not declared"))
    }

    /// The value of a name with its indices.
    fn valued(
        &mut self,
        names: &Names<'a>,
        here: Here,
        value: Valued,
        part: &'a ast::PathPart,
        item: &[i64],
    ) -> Result<Rational, Unknown> {
        let decl = names.decl_of(self, here, value, part, item).map_err(Unknown::Fault)?;
        self.declared(names, decl, part.name.span)
    }

    fn declared(&mut self, names: &Names<'a>, decl: DeclId, span: Span) -> Result<Rational, Unknown> {
        let d = &names.decls[decl];
        let value = match d.kind {
            DeclKind::Parameter { value, .. } | DeclKind::Let(value) | DeclKind::MadeFor(value) => {
                value.filter(|_| d.unit.is_none())
            }
            _ => None,
        };
        let what = match d.kind {
            DeclKind::Input(_) => "this is an input",
            DeclKind::State(_) => "this is a state",
            DeclKind::Discrete(_) => "this is a discrete variable",
            DeclKind::Function(_) => "this is a function",
            DeclKind::Output(_) => "this is an output",
            _ if d.unit.is_some() => "this has a unit",
            _ => "this has no value",
        };
        let counted = self.counted_as(&d.name);
        self.named(names, Key::Declared(decl), counted, value.map(|e| (d.reads, e, &*d.item)), what, span)
    }

    fn ahead(
        &mut self,
        names: &Names<'a>,
        scope: ScopeId,
        d: &'a ast::Declaration,
        span: Span,
    ) -> Result<Rational, Unknown> {
        let full = [names.scopes[scope].prefix.as_str(), &d.name.text].concat();
        let (value, reads) = match names.overrides.get(full.as_str()) {
            Some(value) => (Some(*value), Here::of(0)),
            None => (d.value.as_ref(), Here::of(scope)),
        };
        let value = value.filter(|_| d.unit.is_none()).map(|e| (reads, e, &[][..]));
        let counted = self.counted_as(&full);
        self.named(names, Key::Ahead(scope, &d.name.text), counted, value, "this has a unit", span)
    }

    /// How many turns a parameter counts whatever its value, by its full name.
    fn counted_as(&self, full: &str) -> Option<i64> {
        self.counted.as_ref().filter(|counted| counted.is.name == full).map(|counted| counted.is.turns)
    }

    /// A named number was read, which counts if it is `counted`.
    fn note_named(&mut self, number: &Rational, counted: Option<i64>) {
        if let Some(all) = &mut self.counted {
            match counted {
                Some(_) => all.reads.count = true,
                None => all.read(number),
            }
        }
    }

    /// The number that a name stands for, found out once; of what counts how many turns.
    fn named(
        &mut self,
        names: &Names<'a>,
        key: Key<'a>,
        counted: Option<i64>,
        value: Option<(Here, &'a ast::Expr, &[i64])>,
        what: &str,
        span: Span,
    ) -> Result<Rational, Unknown> {
        if !self.looking {
            self.uses.insert((key, span));
        }
        match self.known.get(&key) {
            Some(Known::Number(number, _)) => {
                let number = number.clone();
                self.read.push(key);
                self.note_named(&number, counted);
                return Ok(number);
            }
            Some(Known::Other(why)) => return Err(Unknown::Reads(span, why.clone())),
            Some(Known::Open) => return Err(Unknown::Reads(span, "defined by itself".to_string())),
            None => {}
        }
        let Some((reads, e, item)) = value else { return Err(Unknown::Reads(span, what.to_string())) };
        self.known.insert(key, Known::Open);
        let outside = std::mem::take(&mut self.read);
        let (mut found, _) = self.reading(
            |r| r.number(names, reads, e, item),
            |counted, _| {
                // What follows from what counts tells another number in a model of another size.
                if counted.reads.count {
                    counted.note_difference();
                }
            },
        );
        let of = std::mem::replace(&mut self.read, outside);
        if let (Some(turns), Ok(number)) = (counted, &mut found) {
            *number = Rational::from(turns);
        }
        found.iter().for_each(|number| self.note_named(number, counted));
        let known = match &found {
            Ok(number) => Known::Number(number.clone(), of),
            Err(Unknown::Reads(_, why)) if why.starts_with(FOLLOWS) => Known::Other(why.clone()),
            Err(Unknown::Reads(_, why)) => Known::Other(format!("{FOLLOWS}: {why}")),
            Err(Unknown::Fault(fault)) => Known::Other(format!("{FOLLOWS}: {}", fault.title)),
            Err(Unknown::Said) => Known::Other("it cannot be read".to_string()),
        };
        let why = match &known {
            Known::Other(why) => why.clone(),
            _ => String::new(),
        };
        self.known.insert(key, known);
        self.read.push(key);
        found.map_err(|_| Unknown::Reads(span, why))
    }
}

fn too_many(span: Span) -> Unknown {
    Unknown::Fault(Box::new(too_long(span)))
}

fn not_known(name: &ast::Name, why: &str) -> Unknown {
    Unknown::Reads(name.span, why.to_string())
}
