//! Values and derivatives of single operations as C expressions.

use std::fmt::{self, Display, Write};

use halfarrow_compiler::algebra::Function;
use halfarrow_compiler::for_each_op;
use halfarrow_compiler::program::calculus::{Calculus, Moving};
use halfarrow_compiler::program::elimination::Elimination;
use halfarrow_compiler::program::{ConditionId, Op};

use super::write::number;

/// A whole power by repeated squaring, in the order of `math::powi`; gives the expression of the result.
pub(super) fn power(text: &mut String, (name, wide): (&str, bool), a: &str, n: u32) -> String {
    if n == 0 {
        return "1.0".into();
    }
    let kind = if wide { "ha_wide" } else { "double" };
    let (mut result, mut square, mut left, mut at) = (None::<String>, a.to_string(), n, 0);
    loop {
        if left & 1 == 1 {
            result = Some(match result {
                None => square.clone(),
                Some(before) if left == 1 => return format!("{before} * {square}"),
                Some(before) => {
                    let _ = writeln!(text, "    const {kind} {name}_r{at} = {before} * {square};");
                    format!("{name}_r{at}")
                }
            });
        }
        left >>= 1;
        if left == 0 {
            return result.unwrap_or_else(|| "1.0".into());
        }
        at += 1;
        let _ = writeln!(text, "    const {kind} {name}_s{at} = {square} * {square};");
        square = format!("{name}_s{at}");
    }
}

/// What is fixed in an operation, in C.
struct InC<T>(T);

impl Display for InC<Function> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Function::Sqrt => f.write_str("sqrt"),
            Function::Abs => f.write_str("fabs"),
            Function::Floor => f.write_str("floor"),
            other => write!(f, "ha_{}", other.name()),
        }
    }
}

impl Display for InC<u32> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.0)
    }
}

/// A plain operation as a C expression.
pub(super) fn expression<A: Copy + Display>(op: Op<A>) -> String {
    macro_rules! write_c {
        (($k:ident $value:ident)
         given $given:tt
         plain { $($(#[$plain_doc:meta])* $plain:ident($($part:ident: $kind:ty),*) [$($a:ident $da:ident $A:ident),*] {
            cost: $cost:ident, value: $meaning:expr, text: $text:literal, c: $c:literal, derivative: $derivative:expr,
         })* }
         held $held:tt) => {
            match op {
                $(Op::$plain($($part,)* $($a),*) => {
                    $(let $part = InC($part);)*
                    format!($c)
                })*
                _ => unreachable!("written where it is given, or where its condition or table is"),
            }
        };
    }
    for_each_op!(write_c)
}

/// How closely the parts of an expression hang together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Binds {
    Choice,
    Sum,
    Product,
    Sign,
    Whole,
}

/// Expressions, as numbers of the rules of derivatives.
pub(super) struct Expressions<'t> {
    all: Vec<(String, Binds)>,
    /// Where the lines before the expression are written.
    lines: &'t mut String,
    /// How temporaries are called, and whether they are in double precision whatever real numbers are.
    name: String,
    wide: bool,
    /// How far lines are indented, and how many temporaries there are.
    pub indent: &'static str,
    kept: usize,
    /// What has to hold for the rest to count.
    pub asked: Vec<String>,
}

/// An expression: its place among the others.
pub(super) type Expression = usize;

impl<'t> Expressions<'t> {
    pub fn new(lines: &'t mut String, name: String, wide: bool) -> Self {
        Expressions { all: Vec::new(), lines, name, wide, indent: "    ", kept: 0, asked: Vec::new() }
    }

    /// A name, or what else needs no brackets.
    pub fn whole(&mut self, text: &str) -> Expression {
        self.push(text.to_string(), Binds::Whole)
    }

    pub fn text(&self, expression: Expression) -> String {
        self.all[expression].0.clone()
    }

    /// Writes a line.
    pub fn line(&mut self, text: &str) {
        let _ = writeln!(self.lines, "{}{text}", self.indent);
    }

    fn push(&mut self, text: String, binds: Binds) -> Expression {
        self.all.push((text, binds));
        self.all.len() - 1
    }

    /// An expression beside an operator that asks so much of it.
    fn part(&self, expression: Expression, least: Binds) -> String {
        let (text, binds) = &self.all[expression];
        if *binds >= least { text.clone() } else { format!("({text})") }
    }

    /// `a sign b`, which is evaluated from the left.
    fn infix(&mut self, a: Expression, sign: &str, b: Expression, binds: Binds) -> Expression {
        let tighter = if binds == Binds::Sum { Binds::Product } else { Binds::Whole };
        let text = format!("{} {sign} {}", self.part(a, binds), self.part(b, tighter));
        self.push(text, binds)
    }
}

impl Calculus for Expressions<'_> {
    type Number = Expression;
    fn number(&mut self, value: f64) -> Expression {
        self.push(number(value), Binds::Whole)
    }
    fn neg(&mut self, a: Expression) -> Expression {
        let text = format!("-{}", self.part(a, Binds::Whole));
        self.push(text, Binds::Sign)
    }
    fn add(&mut self, a: Expression, b: Expression) -> Expression {
        self.infix(a, "+", b, Binds::Sum)
    }
    fn sub(&mut self, a: Expression, b: Expression) -> Expression {
        self.infix(a, "-", b, Binds::Sum)
    }
    fn mul(&mut self, a: Expression, b: Expression) -> Expression {
        self.infix(a, "*", b, Binds::Product)
    }
    fn div(&mut self, a: Expression, b: Expression) -> Expression {
        self.infix(a, "/", b, Binds::Product)
    }
    fn powi(&mut self, a: Expression, n: u32) -> Expression {
        let a = self.part(a, Binds::Whole);
        let text = power(self.lines, (&self.name, self.wide), &a, n);
        self.push(text, Binds::Product)
    }
    fn call(&mut self, f: Function, a: Expression) -> Expression {
        let text = expression(Op::Call(f, &self.all[a].0));
        self.push(text, Binds::Whole)
    }
    fn select(&mut self, c: Expression, a: Expression, b: Expression) -> Expression {
        let [c, a, b] = [c, a, b].map(|e| self.part(e, Binds::Sum));
        self.push(expression(Op::Select(&c, &a, &b)), Binds::Choice)
    }
    fn along(&mut self, slope: impl FnOnce(&mut Self) -> Expression, rate: Expression) -> Expression {
        let slope = slope(self);
        let text = format!("ha_along({}, {})", self.all[slope].0, self.all[rate].0);
        self.push(text, Binds::Whole)
    }
    fn along_power(&mut self, value: Expression, (a, da): Moving<Self>, (b, db): Moving<Self>) -> Option<Expression> {
        let rate = |d: Option<Expression>| d.map_or("0.0".to_string(), |d| self.text(d));
        let [value, a, b] = [value, a, b].map(|e| self.text(e));
        let text = format!("ha_pow_along({value}, {a}, {}, {b}, {})", rate(da), rate(db));
        Some(self.push(text, Binds::Whole))
    }
    fn table(&mut self, _: (u32, Option<ConditionId>), _: u32, _: Expression) -> Expression {
        unreachable!("tables are looked up with their derivative")
    }
}

impl Elimination for Expressions<'_> {
    fn sign_of(&mut self, a: Expression) -> Expression {
        let text = format!("copysign(1.0, {})", self.all[a].0);
        self.push(text, Binds::Whole)
    }
    fn require(&mut self, pivot: Expression, least: Expression) {
        let [p, least] = [pivot, least].map(|e| self.part(e, Binds::Product));
        self.asked.push(format!("{p} > 0.0 && {p} > {least} && ha_finite({p})"));
    }
    fn keep(&mut self, a: Expression) -> Expression {
        let (name, text) = (format!("{}_{}", self.name, self.kept), self.text(a));
        self.kept += 1;
        self.line(&format!("const double {name} = {text};"));
        self.whole(&name)
    }
}
