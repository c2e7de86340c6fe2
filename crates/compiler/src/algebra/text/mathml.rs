//! Shapes as MathML Core, which browsers set without help.

use super::names::Names;
use super::numbers;
use super::shape::Shape;
use crate::algebra::{Comparison, Rational};

/// How tightly a piece holds together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Binding {
    Or,
    And,
    Not,
    Relation,
    Sum,
    Product,
    /// A function whose argument has no brackets.
    Prefix,
    Power,
    Atom,
}

/// Functions that take a name without brackets.
const BARE: [&str; 7] = ["sin", "cos", "tan", "sinh", "cosh", "tanh", "log"];

/// The elements of a shape, without the `math` around them.
pub(super) fn mathml(shape: &Shape, names: &dyn Names) -> String {
    Writer { names, bare: true }.piece(shape).0
}

#[derive(Clone, Copy)]
struct Writer<'a> {
    names: &'a dyn Names,
    /// Whether functions may stand without brackets.
    bare: bool,
}

impl Writer<'_> {
    fn piece(&self, shape: &Shape) -> (String, Binding) {
        match shape {
            Shape::Number(value) => number(value),
            Shape::Pi => ("<mi>π</mi>".into(), Binding::Atom),
            Shape::Name(symbol) => (self.names.mathml(*symbol), Binding::Atom),
            Shape::Sum(terms) => (self.sum(terms), Binding::Sum),
            Shape::Product(above, below) => self.product(above, below),
            Shape::Minus(inner) => (minus() + &self.at_least(inner, Binding::Product), Binding::Sum),
            Shape::Power(base, n) => self.power(base, n),
            Shape::Root(inner) => (format!("<msqrt>{}</msqrt>", self.piece(inner).0), Binding::Atom),
            Shape::Abs(inner) => (fenced("|", &self.piece(inner).0, "|"), Binding::Atom),
            Shape::Call(name, x) => self.call(name, x, None),
            Shape::Table(name, x) => {
                (format!("<mi>{}</mi>{}", escape(name), brackets(&self.piece(x).0)), Binding::Atom)
            }
            Shape::Relation(c, a, b) => {
                let (a, b) = (self.at_least(a, Binding::Sum), self.at_least(b, Binding::Sum));
                (format!("{a}<mo>{}</mo>{b}", relation(*c)), Binding::Relation)
            }
            Shape::And(a, b) => self.joined(a, b, "∧", Binding::And),
            Shape::Or(a, b) => self.joined(a, b, "∨", Binding::Or),
            Shape::Not(a) => (format!("<mo>¬</mo>{}", self.at_least(a, Binding::Atom)), Binding::Not),
            Shape::Choice(c, a, b) => {
                let [c, a, b] = [c, a, b].map(|s| self.piece(s).0);
                let row = |value: &str, when: &str| format!("<mtr><mtd>{value}</mtd><mtd>{when}</mtd></mtr>");
                let rows = row(&a, &format!("<mtext>if </mtext>{c}")) + &row(&b, "<mtext>else</mtext>");
                (format!("<mrow><mo>{{</mo><mtable class=\"cases\">{rows}</mtable></mrow>"), Binding::Atom)
            }
            Shape::LeftOut => ("<mi>…</mi>".into(), Binding::Atom),
        }
    }

    /// In brackets if it holds together less tightly.
    fn at_least(&self, shape: &Shape, binding: Binding) -> String {
        let (text, own) = self.piece(shape);
        if own < binding { brackets(&text) } else { text }
    }

    fn joined(&self, a: &Shape, b: &Shape, sign: &str, binding: Binding) -> (String, Binding) {
        let (a, b) = (self.at_least(a, binding), self.at_least(b, binding));
        (format!("{a}<mo>{sign}</mo>{b}"), binding)
    }

    fn sum(&self, terms: &[(bool, Shape)]) -> String {
        let mut text = String::new();
        for (i, (negative, term)) in terms.iter().enumerate() {
            match (i, negative) {
                (0, false) => {}
                (_, true) => text += &minus(),
                (_, false) => text += "<mo>+</mo>",
            }
            text += &self.at_least(term, Binding::Product);
        }
        text
    }

    fn product(&self, above: &[Shape], below: &[Shape]) -> (String, Binding) {
        if below.is_empty() {
            return (self.factors(above), if above.len() == 1 { Binding::Atom } else { Binding::Product });
        }
        let side = |side: &[Shape]| match side {
            [] => "<mn>1</mn>".to_string(),
            [single] => self.piece(single).0,
            several => self.factors(several),
        };
        (format!("<mfrac><mrow>{}</mrow><mrow>{}</mrow></mfrac>", side(above), side(below)), Binding::Product)
    }

    fn factors(&self, factors: &[Shape]) -> String {
        let mut text = String::new();
        for (i, factor) in factors.iter().enumerate() {
            let function = |f: &Shape| match f {
                Shape::Call(..) => true,
                Shape::Power(base, _) => matches!(**base, Shape::Call(..)),
                _ => false,
            };
            let part = match factor {
                // What follows must not be read on as part of the argument.
                _ if function(factor) && factors.get(i + 1).is_some_and(|next| !function(next)) => {
                    Writer { bare: false, ..*self }.at_least(factor, Binding::Prefix)
                }
                Shape::Product(_, below) if below.is_empty() => brackets(&self.piece(factor).0),
                Shape::Product(..) => self.piece(factor).0,
                _ => self.at_least(factor, Binding::Prefix),
            };
            if i > 0 {
                text += if part.starts_with("<mn>") {
                    "<mo>·</mo>"
                } else {
                    "<mo>\u{2062}</mo><mspace width=\"0.14em\"/>"
                };
            }
            text += &part;
        }
        text
    }

    fn power(&self, base: &Shape, n: &Shape) -> (String, Binding) {
        let exponent = self.piece(n).0;
        let whole = matches!(n, Shape::Number(_));
        match base {
            Shape::Call(name, x) if whole && x.len() == 1 && *name != "exp" => self.call(name, x, Some(&exponent)),
            _ => {
                let base = self.at_least(base, Binding::Atom);
                (format!("<msup><mrow>{base}</mrow><mrow>{exponent}</mrow></msup>"), Binding::Power)
            }
        }
    }

    fn call(&self, name: &str, x: &[Shape], raised: Option<&str>) -> (String, Binding) {
        let arguments: Vec<String> = x.iter().map(|a| self.piece(a).0).collect();
        let arguments = arguments.join("<mo>,</mo>");
        if name == "exp" && raised.is_none() {
            return (format!("<msup><mi>e</mi><mrow>{arguments}</mrow></msup>"), Binding::Power);
        }
        let shown = function(name);
        let head = match raised {
            Some(n) => format!("<msup>{shown}<mrow>{n}</mrow></msup>"),
            None => shown,
        };
        if self.bare && BARE.contains(&name) && matches!(x, [Shape::Name(_)]) {
            return (format!("{head}<mo>\u{2061}</mo><mspace width=\"0.17em\"/>{arguments}"), Binding::Prefix);
        }
        (format!("{head}<mo>\u{2061}</mo>{}", brackets(&arguments)), Binding::Atom)
    }
}

fn function(name: &str) -> String {
    match name {
        "log" => "<mi>ln</mi>".into(),
        "log10" => "<msub><mi>log</mi><mn>10</mn></msub>".into(),
        "asin" | "acos" | "atan" => format!("<mi>arc{}</mi>", &name[1..]),
        _ => format!("<mi>{}</mi>", escape(name)),
    }
}

fn relation(c: Comparison) -> &'static str {
    match c {
        Comparison::Lt => "&lt;",
        Comparison::Gt => "&gt;",
        Comparison::Le => "≤",
        Comparison::Ge => "≥",
        Comparison::Ne => "≠",
        Comparison::Eq => "=",
    }
}

fn number(value: &Rational) -> (String, Binding) {
    let Some((digits, exponent)) = numbers::decimal(value, true) else {
        return (format!("<mn>{value}</mn>"), Binding::Atom);
    };
    match numbers::layout(&digits, exponent) {
        (mantissa, 0) => (format!("<mn>{mantissa}</mn>"), Binding::Atom),
        (mantissa, power) => {
            let power = if power < 0 { format!("{}<mn>{}</mn>", minus(), -power) } else { format!("<mn>{power}</mn>") };
            let ten = format!("<msup><mn>10</mn><mrow>{power}</mrow></msup>");
            (format!("<mn>{mantissa}</mn><mo>·</mo>{ten}"), Binding::Product)
        }
    }
}

fn minus() -> String {
    "<mo>−</mo>".to_string()
}

fn brackets(inner: &str) -> String {
    fenced("(", inner, ")")
}

fn fenced(open: &str, inner: &str, close: &str) -> String {
    format!("<mrow><mo fence=\"true\">{open}</mo>{inner}<mo fence=\"true\">{close}</mo></mrow>")
}

/// The text with what XML reserves written out.
pub(super) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
