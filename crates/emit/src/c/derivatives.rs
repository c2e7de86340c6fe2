//! Values and derivatives of single operations as C expressions.

use halfarrow_compiler::algebra::Function;
use halfarrow_compiler::for_each_op;
use halfarrow_compiler::program::calculus::{Calculus, Moving};
use halfarrow_compiler::program::elimination::Elimination;
use halfarrow_compiler::program::{ConditionId, Op};

use rustc_hash::FxHashSet;

use super::written::{Binds, Line, Needed, Series, Variable, Written, written};
use crate::Real;

/// Expressions, as numbers of the rules of derivatives.
pub(super) struct Expressions<'t> {
    all: Vec<Written>,
    /// Where the lines before the expression are written.
    lines: &'t mut Vec<Line>,
    /// What temporaries belong to, and their precision.
    series: Series,
    real: Real,
    /// How far lines are indented, and how many temporaries there are.
    pub indent: &'static str,
    kept: u32,
    /// Temporaries that change.
    open: FxHashSet<Expression>,
    /// What has to hold for the rest to count.
    pub asked: Vec<Written>,
}

/// An expression: its place among the others.
pub(super) type Expression = usize;

impl<'t> Expressions<'t> {
    pub fn new(lines: &'t mut Vec<Line>, series: Series, real: Real) -> Self {
        let (all, open, asked) = (Vec::new(), FxHashSet::default(), Vec::new());
        Expressions { all, lines, series, real, indent: "    ", kept: 0, open, asked }
    }

    /// An expression from elsewhere.
    pub fn push(&mut self, written: Written) -> Expression {
        self.all.push(written);
        self.all.len() - 1
    }

    pub fn written(&self, expression: Expression) -> Written {
        self.all[expression].clone()
    }

    /// Writes a line that declares so many numbers.
    pub fn line(&mut self, written: &Written, numbers: usize) {
        self.lines.push(Line::new(written!("{}{}", self.indent, written), numbers));
    }

    /// The next temporary.
    fn temporary(&mut self) -> Variable {
        self.kept += 1;
        Variable::Part(self.series, "", self.kept - 1)
    }

    /// Declares a temporary that stays as it is.
    fn declare(&mut self, variable: Variable, value: &Written) -> Written {
        let line = written!("{}const {} {} = {};", self.indent, self.real.kind(), variable, value);
        self.lines.push(Line::constant(variable, line, 1));
        written!("{}", variable)
    }

    /// `a sign b`, which is evaluated from the left.
    fn infix(&mut self, a: Expression, sign: &str, b: Expression, binds: Binds) -> Expression {
        let tighter = if binds == Binds::Sum { Binds::Product } else { Binds::Whole };
        let both = written!("{} {} {}", self.all[a].beside(binds), sign, self.all[b].beside(tighter));
        self.push(both.binding(binds))
    }

    /// A call of a function that there is for either precision.
    fn calling(&mut self, name: &str, arguments: &[Written]) -> Expression {
        let function = Needed(self.real.function(name).into());
        let call = written!("{}({})", function, Written::list(arguments));
        self.push(call)
    }

    /// 1 where something holds, else 0.
    fn truth(&mut self, holds: &Written) -> Expression {
        let truth = written!("{} ? {} : {}", holds, self.real.number(1.0), self.real.number(0.0));
        self.push(truth.binding(Binds::Choice))
    }

    /// Whether something is 0, or is not.
    fn beside_zero(&self, a: Expression, sign: &str) -> Written {
        written!("{} {} {}", self.all[a].beside(Binds::Sum), sign, self.real.number(0.0))
    }
}

/// What the table of operations writes, besides a calculus.
impl Expressions<'_> {
    fn pow(&mut self, a: Expression, b: Expression) -> Expression {
        self.calling("ha_pow", &[self.written(a), self.written(b)])
    }
    fn atan2(&mut self, a: Expression, b: Expression) -> Expression {
        self.calling("ha_atan2", &[self.written(a), self.written(b)])
    }
    fn positive(&mut self, a: Expression) -> Expression {
        self.truth(&self.beside_zero(a, ">"))
    }
    fn and(&mut self, a: Expression, b: Expression) -> Expression {
        self.truth(&written!("{} && {}", self.beside_zero(a, "!="), self.beside_zero(b, "!=")))
    }
    fn or(&mut self, a: Expression, b: Expression) -> Expression {
        self.truth(&written!("{} || {}", self.beside_zero(a, "!="), self.beside_zero(b, "!=")))
    }
    fn not(&mut self, a: Expression) -> Expression {
        self.truth(&self.beside_zero(a, "=="))
    }

    /// A plain operation.
    pub fn operation(&mut self, op: Op<Expression>) -> Expression {
        macro_rules! write_c {
            (($k:ident $value:ident)
             given $given:tt
             plain { $($(#[$plain_doc:meta])* $plain:ident($($part:ident: $kind:ty),*) [$($a:ident $da:ident $A:ident),*] {
                cost: $cost:ident, value: $meaning:expr, text: $text:literal, c: $c:expr, derivative: $derivative:expr,
             })* }
             held $held:tt) => {
                match op {
                    $(Op::$plain($($part,)* $($a),*) => {
                        let $k = self;
                        $c
                    })*
                    _ => unreachable!("written where it is given, or where its condition or table is"),
                }
            };
        }
        for_each_op!(write_c)
    }
}

impl Calculus for Expressions<'_> {
    type Number = Expression;
    fn number(&mut self, value: f64) -> Expression {
        self.push(Written::of(self.real.number(value)))
    }
    fn neg(&mut self, a: Expression) -> Expression {
        let opposite = written!("-{}", self.all[a].beside(Binds::Whole));
        self.push(opposite.binding(Binds::Sign))
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
    /// By repeated squaring, in the order of `math::powi`.
    fn powi(&mut self, a: Expression, n: u32) -> Expression {
        let mut square = self.all[a].beside(Binds::Whole);
        let (mut result, mut left, mut at) = (None::<Written>, n, 0);
        while left > 0 {
            if left & 1 == 1 {
                result = Some(match result {
                    None => square.clone(),
                    Some(before) => {
                        let product = written!("{} * {}", before, square).binding(Binds::Product);
                        if left == 1 {
                            return self.push(product);
                        }
                        self.declare(Variable::Part(self.series, "r", at), &product)
                    }
                });
            }
            left >>= 1;
            if left > 0 {
                at += 1;
                square = self.declare(Variable::Part(self.series, "s", at), &written!("{} * {}", square, square));
            }
        }
        let one = Written::of(self.real.number(1.0));
        self.push(result.unwrap_or(one).binding(Binds::Product))
    }
    fn call(&mut self, f: Function, a: Expression) -> Expression {
        let name = match f {
            Function::Sqrt => "sqrt".to_string(),
            Function::Abs => "fabs".to_string(),
            Function::Floor => "floor".to_string(),
            other => format!("ha_{}", other.name()),
        };
        self.calling(&name, &[self.written(a)])
    }
    fn select(&mut self, c: Expression, a: Expression, b: Expression) -> Expression {
        let choice = written!(
            "{} ? {} : {}",
            self.beside_zero(c, "!="),
            self.all[a].beside(Binds::Sum),
            self.all[b].beside(Binds::Sum)
        );
        self.push(choice.binding(Binds::Choice))
    }
    fn along(&mut self, slope: impl FnOnce(&mut Self) -> Expression, rate: Expression) -> Expression {
        let slope = slope(self);
        self.calling("ha_along", &[self.written(slope), self.written(rate)])
    }
    fn along_power(&mut self, value: Expression, (a, da): Moving<Self>, (b, db): Moving<Self>) -> Option<Expression> {
        let rate = |d: Option<Expression>| d.map_or(Written::of(self.real.number(0.0)), |d| self.written(d));
        let [da, db] = [da, db].map(rate);
        let [value, a, b] = [value, a, b].map(|e| self.written(e));
        Some(self.calling("ha_pow_along", &[value, a, da, b, db]))
    }
    fn table(&mut self, _: (u32, Option<ConditionId>), _: u32, _: Expression) -> Expression {
        unreachable!("tables are looked up with their derivative")
    }
}

impl Elimination for Expressions<'_> {
    fn sign_of(&mut self, a: Expression) -> Expression {
        let one = Written::of(self.real.number(1.0));
        self.calling("copysign", &[one, self.written(a)])
    }
    fn require(&mut self, pivot: Expression, least: Expression) {
        let [p, least] = [pivot, least].map(|e| self.all[e].beside(Binds::Product));
        let finite = Needed(self.real.function("ha_finite").into());
        let asked = written!("{} > {} && {} > {} && {}({})", p, self.real.number(0.0), p, least, finite, p);
        self.asked.push(asked);
    }
    fn keep(&mut self, a: Expression) -> Expression {
        let variable = self.temporary();
        let kept = self.declare(variable, &self.written(a));
        self.push(kept)
    }
    fn open(&mut self, a: Expression) -> Expression {
        let variable = self.temporary();
        let line = written!("{} {} = {};", self.real.kind(), variable, self.written(a));
        self.line(&line, 1);
        let open = self.push(written!("{}", variable));
        self.open.insert(open);
        open
    }
    fn take_off(&mut self, a: Expression, product: Expression) -> Expression {
        if !self.open.contains(&a) {
            let left = self.sub(a, product);
            return self.open(left);
        }
        let line = written!("{} -= {};", self.written(a), self.written(product));
        self.line(&line, 0);
        a
    }
}
