//! What is known when a model is compiled: the turns of its repetitions, and the numbers that shape it.

use num_traits::Zero;
use rustc_hash::{FxHashMap, FxHashSet};

use super::scope::{DeclId, DeclKind, Here, Names, Node, ScopeId, TurnId, Valued};
use super::uses::{Used, Uses};
use crate::algebra::Rational;
use crate::ast::{self, BinaryOp, ExprKind, UnaryOp};
use crate::diagnostic::{Diagnostic, codes};
use crate::span::Span;

/// The greatest number of turns of all repetitions together, and of elements of arrays.
pub(super) const MAX_TURNS: usize = 4_000_000;

/// The greatest number of terms of all sums together.
const MAX_TERMS: usize = 16_000_000;

/// The greatest depth of expressions and names in a number that shapes a model.
const MAX_DEPTH: usize = 1500;

/// Words for what follows from something that is not known.
const FOLLOWS: &str = "this follows from what is not known";

/// One turn of a repetition: its variable and what that is.
#[derive(Debug, Clone, Copy)]
pub(super) struct Turn<'a> {
    /// The variable.
    pub variable: &'a ast::Name,
    /// Its value.
    pub value: i64,
    /// The scope that it stands in.
    pub scope: ScopeId,
    /// The turn of the repetition around it, in that scope.
    pub outer: TurnId,
}

/// Why something is not known when the model is compiled.
#[derive(Debug, Clone)]
pub(super) enum Unknown {
    /// Something that is read is not known: its place, and what it is.
    Reads(Span, String),
    /// What is read is at fault.
    Fault(Box<Diagnostic>),
    /// Nothing stands there, which the parser has said.
    Said,
}

impl Unknown {
    /// The fault, if it has not been said: `what` must be known.
    pub fn fault(self, what: &str) -> Option<Diagnostic> {
        match self {
            Unknown::Said => None,
            Unknown::Fault(fault) => Some(*fault),
            Unknown::Reads(span, why) => {
                let title = format!("{what} must be known when the model is compiled");
                let hint = "use whole numbers, loop variables, and parameters whose values are plain numbers";
                Some(Diagnostic::error(codes::N022, title, span, why).hint(hint))
            }
        }
    }
}

/// A named number that may shape the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Key<'a> {
    Declared(DeclId),
    /// One that is declared further down in a scope.
    Ahead(ScopeId, &'a str),
}

/// What is known of a named number.
#[derive(Clone)]
enum Known<'a> {
    /// It is being found out.
    Open,
    /// A number, made of others.
    Number(Rational, Vec<Key<'a>>),
    /// Something else, which the words tell.
    Other(String),
}

/// A number or a truth value.
enum Fixed {
    Number(Rational),
    Truth(bool),
}

/// The turns of all repetitions, and the numbers that shape the model.
#[derive(Clone)]
pub(super) struct Repeats<'a> {
    /// The turns. The first entry stands for the outside of all repetitions.
    turns: Vec<Option<Turn<'a>>>,
    known: FxHashMap<Key<'a>, Known<'a>>,
    /// The numbers that shape the model.
    shaping: FxHashSet<Key<'a>>,
    /// The named numbers that the expression reads.
    read: Vec<Key<'a>>,
    /// Where names are used in what shapes the model.
    uses: FxHashSet<(Key<'a>, Span)>,
    /// Whether a name is only looked up, which is no use of it.
    looking: bool,
    depth: usize,
    /// How many turns have been made, those that are forgotten with them.
    made: usize,
}

impl Default for Repeats<'_> {
    fn default() -> Self {
        let (known, shaping) = (FxHashMap::default(), FxHashSet::default());
        let (uses, looking) = (FxHashSet::default(), false);
        Repeats { turns: vec![None], known, shaping, read: Vec::new(), uses, looking, depth: 0, made: 0 }
    }
}

/// Turns.
impl<'a> Repeats<'a> {
    /// A new turn.
    pub fn turn(&mut self, variable: &'a ast::Name, value: i64, here: Here) -> TurnId {
        self.turns.push(Some(Turn { variable, value, scope: here.scope, outer: here.turn }));
        self.made += 1;
        self.turns.len() - 1
    }

    /// Takes back the last turn, which nothing refers to any more, and those after it.
    pub fn forget(&mut self, turn: TurnId) {
        self.turns.truncate(turn);
    }

    /// The values of the variable of a repetition of statements, of which there may be none; `None` if they are too many.
    pub fn turns_of(&self, from: i64, to: i64) -> Option<std::ops::RangeInclusive<i64>> {
        values_of(from, to, MAX_TURNS.checked_sub(self.turns.len())?)
    }

    /// The same for a sum.
    pub fn terms_of(&self, from: i64, to: i64) -> Option<std::ops::RangeInclusive<i64>> {
        values_of(from, to, MAX_TERMS.checked_sub(self.made)?)
    }

    /// All turns, in order.
    pub fn all(&self) -> impl Iterator<Item = &Turn<'a>> + '_ {
        self.turns.iter().flatten()
    }

    /// A turn and those around it, from within.
    pub fn around(&self, turn: TurnId) -> impl Iterator<Item = &Turn<'a>> + '_ {
        let at = |turn: TurnId| self.turns[turn].as_ref();
        std::iter::successors(at(turn), move |t| at(t.outer))
    }

    /// The value of a loop variable.
    pub fn variable(&self, turn: TurnId, name: &str) -> Option<i64> {
        self.around(turn).find(|t| t.variable.text == name).map(|t| t.value)
    }

    /// A turn in words: `i = 3, j = 1`.
    pub fn words(&self, turn: TurnId) -> String {
        let mut all: Vec<String> = self.around(turn).map(|t| format!("{} = {}", t.variable.text, t.value)).collect();
        all.reverse();
        all.join(", ")
    }
}

/// Numbers that shape the model.
impl<'a> Repeats<'a> {
    /// Indices behind a name.
    pub fn indices(
        &mut self,
        names: &Names<'a>,
        here: Here,
        list: &'a [ast::Expr],
    ) -> Result<Vec<i64>, Box<Diagnostic>> {
        let mut indices = Vec::with_capacity(list.len());
        for e in list {
            match self.whole(names, here, e, "an index") {
                Ok(index) => indices.push(index),
                Err(Some(fault)) => return Err(Box::new(fault)),
                // Brackets that are at fault, which the parser has said: the same words are said once.
                Err(None) => {
                    let fault = Diagnostic::error(codes::N021, "an index cannot be read", e.span, "here");
                    return Err(Box::new(fault));
                }
            }
        }
        Ok(indices)
    }

    /// A whole number that shapes the model; the fault if it is none, unless that has been said.
    pub fn whole(
        &mut self,
        names: &Names<'a>,
        here: Here,
        e: &'a ast::Expr,
        what: &str,
    ) -> Result<i64, Option<Diagnostic>> {
        let number = self.shaped(|r| r.number(names, here, e, &[])).map_err(|why| why.fault(what))?;
        number.as_integer().ok_or_else(|| {
            let title = format!("{what} must be a whole number");
            let d = Diagnostic::error(codes::N021, title, e.span, format!("this is {number}"));
            Some(d.hint("`floor` gives the whole number below"))
        })
    }

    /// A condition that shapes the model.
    pub fn condition(&mut self, names: &Names<'a>, here: Here, e: &'a ast::Expr) -> Result<bool, Unknown> {
        self.shaped(|r| r.truth(names, here, e))
    }

    /// The integer that a bare name stands for, if it does; it shapes the model only if [`whole`](Self::whole) asks.
    pub fn peek(&mut self, names: &Names<'a>, here: Here, name: &'a ast::Name) -> Option<i64> {
        if let Some(value) = self.variable(here.turn, &name.text) {
            return Some(value);
        }
        self.looking = true;
        let value = self.bare(names, here, name, &[]);
        self.looking = false;
        value.ok()?.as_integer()
    }

    /// A bare name as an index.
    pub fn name_as_index(&mut self, names: &Names<'a>, here: Here, name: &'a ast::Name) -> Option<i64> {
        let value = self.shaped(|r| r.bare(names, here, name, &[])).ok()?;
        value.as_integer()
    }

    /// How many values a list with `for` has, where that is known.
    pub fn length(&mut self, names: &Names<'a>, here: Here, list: &'a ast::Repeated) -> Option<i64> {
        let ends =
            self.range_end(names, here, &list.to).ok()?.checked_sub(self.range_end(names, here, &list.from).ok()?);
        Some(ends?.checked_add(1)?.max(0))
    }

    /// The declarations of numbers that shape the model.
    pub fn shaping<'s>(&'s self, names: &'s Names<'a>) -> impl Iterator<Item = DeclId> + 's {
        self.shaping.iter().filter_map(|key| match *key {
            Key::Declared(decl) => Some(decl),
            Key::Ahead(scope, name) => match names.scopes[scope].values.get(name) {
                Some(Valued::One(decl)) => Some(*decl),
                _ => None,
            },
        })
    }

    /// Adds where names are used in what shapes the model.
    pub fn add_uses(&self, names: &Names<'a>, uses: &mut Uses) {
        for &(key, span) in &self.uses {
            let used = match key {
                Key::Declared(decl) => names.used(decl),
                Key::Ahead(scope, name) => names.scopes[scope].values.get(name).map(|value| Used::of(*value)),
            };
            used.into_iter().for_each(|used| uses.add(used, span));
        }
    }

    /// What is read for this shapes the model.
    fn shaped<T>(&mut self, read: impl FnOnce(&mut Self) -> Result<T, Unknown>) -> Result<T, Unknown> {
        self.read.clear();
        let value = read(self)?;
        let mut found = std::mem::take(&mut self.read);
        while let Some(key) = found.pop() {
            if self.shaping.insert(key)
                && let Some(Known::Number(_, of)) = self.known.get(&key)
            {
                found.extend(of);
            }
        }
        self.read = found;
        Ok(value)
    }

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

    fn truth(&mut self, names: &Names<'a>, here: Here, e: &'a ast::Expr) -> Result<bool, Unknown> {
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

    fn range_end(&mut self, names: &Names<'a>, here: Here, e: &'a ast::Expr) -> Result<i64, Unknown> {
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
        let mut total = Rational::zero();
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

    fn bare(&mut self, names: &Names<'a>, here: Here, name: &'a ast::Name, item: &[i64]) -> Result<Rational, Unknown> {
        if let Some(value) = self.variable(here.turn, &name.text) {
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
            DeclKind::Parameter { value, .. } | DeclKind::Let(value) => value.filter(|_| d.unit.is_none()),
            _ => None,
        };
        let what = match d.kind {
            DeclKind::Input(_) => "this is an input",
            DeclKind::State(_) => "this is a state",
            DeclKind::Function(_) => "this is a function",
            DeclKind::Output(_) => "this is an output",
            _ if d.unit.is_some() => "this has a unit",
            _ => "this has no value",
        };
        self.named(names, Key::Declared(decl), value.map(|e| (d.reads, e, &*d.item)), what, span)
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
        self.named(names, Key::Ahead(scope, &d.name.text), value, "this has a unit", span)
    }

    /// The number that a name stands for, found out once.
    fn named(
        &mut self,
        names: &Names<'a>,
        key: Key<'a>,
        value: Option<(Here, &'a ast::Expr, &[i64])>,
        what: &str,
        span: Span,
    ) -> Result<Rational, Unknown> {
        if !self.looking {
            self.uses.insert((key, span));
        }
        match self.known.get(&key) {
            Some(Known::Number(number, _)) => {
                self.read.push(key);
                return Ok(number.clone());
            }
            Some(Known::Other(why)) => return Err(Unknown::Reads(span, why.clone())),
            Some(Known::Open) => return Err(Unknown::Reads(span, "defined by itself".to_string())),
            None => {}
        }
        let Some((reads, e, item)) = value else { return Err(Unknown::Reads(span, what.to_string())) };
        self.known.insert(key, Known::Open);
        let outside = std::mem::take(&mut self.read);
        let found = self.number(names, reads, e, item);
        let of = std::mem::replace(&mut self.read, outside);
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

/// The whole numbers from one to another, if they are no more than so many.
fn values_of(from: i64, to: i64, most: usize) -> Option<std::ops::RangeInclusive<i64>> {
    let count = i128::from(to) - i128::from(from) + 1;
    (count <= most as i128).then_some(from..=to)
}

/// The fault of a sum that is too long.
pub(super) fn too_long(span: Span) -> Diagnostic {
    let d = Diagnostic::error(codes::N013, "the sums are too long", span, "this many terms");
    d.note(format!("at most {MAX_TERMS} terms of all sums together"))
}

fn too_many(span: Span) -> Unknown {
    Unknown::Fault(Box::new(too_long(span)))
}

fn not_known(name: &ast::Name, why: &str) -> Unknown {
    Unknown::Reads(name.span, why.to_string())
}
