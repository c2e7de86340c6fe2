//! Shapes as text, in one of the styles.

use super::names::Names;
use super::numbers;
use super::shape::Shape;
use crate::algebra::{Comparison, Rational};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Style {
    Ascii,
    Unicode,
    Latex,
}

/// How tightly a piece of text holds together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Binding {
    Choice,
    Or,
    And,
    Not,
    Relation,
    Sum,
    Product,
    /// A function whose argument has no brackets, a minus sign.
    Prefix,
    Power,
    Atom,
}

pub(super) fn render(shape: &Shape, names: &dyn Names, style: Style) -> String {
    Renderer { names, style, bare: true }.text(shape).0
}

#[derive(Clone, Copy)]
struct Renderer<'a> {
    names: &'a dyn Names,
    style: Style,
    /// Whether functions may stand without brackets.
    bare: bool,
}

impl Renderer<'_> {
    fn text(&self, shape: &Shape) -> (String, Binding) {
        match shape {
            Shape::Number(value) => self.number(value),
            Shape::Pi => (self.pick("pi", "π", "\\pi").into(), Binding::Atom),
            Shape::Name(s) => (self.name(*s), Binding::Atom),
            Shape::Sum(terms) => (self.sum(terms), Binding::Sum),
            Shape::Product(above, below) => self.product(above, below),
            Shape::Minus(inner) => (format!("-{}", self.at_least(inner, Binding::Product)), Binding::Sum),
            Shape::Power(base, n) => self.power(base, n),
            Shape::Root(inner) => self.root(inner),
            Shape::Abs(inner) => {
                let inner = self.text(inner).0;
                let text = match self.style {
                    Style::Ascii => format!("abs({inner})"),
                    Style::Unicode => format!("|{inner}|"),
                    Style::Latex => format!("\\left|{inner}\\right|"),
                };
                (text, Binding::Atom)
            }
            Shape::Call(name, x) => self.call(name, x, ""),
            Shape::Table(name, x) => {
                let name = if self.style == Style::Latex { format!("\\mathrm{{{name}}}") } else { name.clone() };
                (format!("{name}{}", self.brackets(&self.text(x).0)), Binding::Atom)
            }
            Shape::Relation(c, a, b) => {
                let (a, b) = (self.at_least(a, Binding::Sum), self.at_least(b, Binding::Sum));
                (format!("{a} {} {b}", self.relation(*c)), Binding::Relation)
            }
            Shape::And(a, b) => {
                let word = self.pick("and", "and", "\\land");
                let (a, b) = (self.at_least(a, Binding::And), self.at_least(b, Binding::And));
                (format!("{a} {word} {b}"), Binding::And)
            }
            Shape::Or(a, b) => {
                let word = self.pick("or", "or", "\\lor");
                let (a, b) = (self.at_least(a, Binding::Or), self.at_least(b, Binding::Or));
                (format!("{a} {word} {b}"), Binding::Or)
            }
            Shape::Not(a) => {
                (format!("{} {}", self.pick("not", "not", "\\lnot"), self.at_least(a, Binding::Atom)), Binding::Not)
            }
            Shape::Choice(c, a, b) => self.choice(c, a, b),
            Shape::LeftOut => (self.pick("…", "…", "\\dots").into(), Binding::Atom),
        }
    }

    fn pick<'t>(&self, ascii: &'t str, unicode: &'t str, latex: &'t str) -> &'t str {
        match self.style {
            Style::Ascii => ascii,
            Style::Unicode => unicode,
            Style::Latex => latex,
        }
    }

    fn name(&self, symbol: crate::algebra::Symbol) -> String {
        match self.style {
            Style::Ascii => self.names.ascii(symbol),
            Style::Unicode => self.names.unicode(symbol),
            Style::Latex => self.names.latex(symbol),
        }
    }

    fn brackets(&self, inner: &str) -> String {
        if self.style == Style::Latex { format!("\\left({inner}\\right)") } else { format!("({inner})") }
    }

    /// In brackets if it holds together less tightly.
    fn at_least(&self, shape: &Shape, binding: Binding) -> String {
        let (text, own) = self.text(shape);
        if own < binding { self.brackets(&text) } else { text }
    }

    fn number(&self, value: &Rational) -> (String, Binding) {
        let rounded = self.style != Style::Ascii;
        let Some((digits, exponent)) = numbers::decimal(value, rounded) else {
            return (value.to_string(), Binding::Atom);
        };
        match (numbers::layout(&digits, exponent), self.style) {
            ((mantissa, 0), _) => (mantissa, Binding::Atom),
            ((mantissa, power), Style::Ascii) => (format!("{mantissa}e{power}"), Binding::Atom),
            ((mantissa, power), Style::Unicode) => {
                (format!("{mantissa}·10{}", superscript(&power.to_string())), Binding::Product)
            }
            ((mantissa, power), Style::Latex) => (format!("{mantissa}\\cdot 10^{{{power}}}"), Binding::Product),
        }
    }

    fn sum(&self, terms: &[(bool, Shape)]) -> String {
        let mut text = String::new();
        for (i, (minus, term)) in terms.iter().enumerate() {
            text.push_str(match (i, minus) {
                (0, false) => "",
                (0, true) => "-",
                (_, false) => " + ",
                (_, true) => " - ",
            });
            text.push_str(&self.at_least(term, Binding::Product));
        }
        text
    }

    fn product(&self, above: &[Shape], below: &[Shape]) -> (String, Binding) {
        if below.is_empty() {
            return (self.factors(above, false), if above.len() == 1 { Binding::Atom } else { Binding::Product });
        }
        if self.style == Style::Latex {
            let whole = |side: &[Shape]| match side {
                [] => "1".into(),
                [single] => self.text(single).0,
                several => self.factors(several, false),
            };
            return (format!("\\frac{{{}}}{{{}}}", whole(above), whole(below)), Binding::Product);
        }
        let above = if above.is_empty() { "1".into() } else { self.factors(above, true) };
        let below = match below {
            [single] => self.at_least(single, Binding::Power),
            several => self.brackets(&self.factors(several, false)),
        };
        (format!("{above}/{below}"), Binding::Product)
    }

    /// `more`: a slash follows.
    fn factors(&self, factors: &[Shape], more: bool) -> String {
        let mut text = String::new();
        for (i, factor) in factors.iter().enumerate() {
            let function = |f: &Shape| match f {
                Shape::Call(..) => true,
                Shape::Power(base, _) => matches!(**base, Shape::Call(..)),
                _ => false,
            };
            let part = match factor {
                Shape::Number(_) => self.text(factor).0,
                // What follows must not be read on as part of the argument: `cos(φ) ω'`, `cos(t)/2`.
                _ if function(factor) && factors.get(i + 1).map_or(more, |next| !function(next)) => {
                    Renderer { bare: false, ..*self }.at_least(factor, Binding::Prefix)
                }
                // A quotient among factors needs brackets, and so does what could be read on as an argument.
                Shape::Product(..) => self.brackets(&self.text(factor).0),
                _ => self.at_least(factor, Binding::Prefix),
            };
            if i > 0 {
                let digits = part.starts_with(|c: char| c.is_ascii_digit());
                let words = text.ends_with('}') && last_is_word(&text) || part.starts_with("\\mathit");
                text.push_str(match digits {
                    true => self.pick("*", "·", " \\cdot "),
                    false => self.pick("*", " ", if words { " \\, " } else { " " }),
                });
            }
            text.push_str(&part);
        }
        text
    }

    fn power(&self, base: &Shape, n: &Shape) -> (String, Binding) {
        let exponent = self.text(n).0;
        let whole = exponent.bytes().all(|b| b.is_ascii_digit());
        let raised = match self.style {
            Style::Unicode if whole => superscript(&exponent),
            Style::Latex => format!("^{{{exponent}}}"),
            _ => format!("^{}", self.at_least(n, Binding::Atom)),
        };
        match base {
            Shape::Call(name, x) if whole && self.style != Style::Ascii && x.len() == 1 && *name != "exp" => {
                self.call(name, x, &raised)
            }
            _ => (format!("{}{raised}", self.at_least(base, Binding::Atom)), Binding::Power),
        }
    }

    fn root(&self, inner: &Shape) -> (String, Binding) {
        let text = match self.style {
            Style::Ascii => format!("sqrt({})", self.text(inner).0),
            Style::Unicode => format!("√{}", self.at_least_plain(inner)),
            Style::Latex => format!("\\sqrt{{{}}}", self.text(inner).0),
        };
        (text, Binding::Atom)
    }

    /// A name or a number as it is, all else in brackets.
    fn at_least_plain(&self, shape: &Shape) -> String {
        let text = self.text(shape).0;
        match shape {
            Shape::Name(_) | Shape::Number(_) | Shape::Pi => text,
            _ => self.brackets(&text),
        }
    }

    fn call(&self, name: &str, x: &[Shape], raised: &str) -> (String, Binding) {
        let arguments: Vec<String> = x.iter().map(|a| self.text(a).0).collect();
        let arguments = arguments.join(", ");
        let flat = arguments.matches("\\frac").count() < 2;
        if self.style == Style::Latex && name == "exp" && raised.is_empty() && flat {
            return (format!("e^{{{arguments}}}"), Binding::Power);
        }
        let name = match (self.style, name) {
            (Style::Latex, _) => latex_function(name),
            (Style::Unicode, "log") => "ln".into(),
            _ => name.to_owned(),
        };
        let bare = self.bare
            && self.style != Style::Ascii
            && matches!(x, [Shape::Name(_)])
            && name.ends_with(|c: char| c.is_alphabetic());
        if bare && TRIGONOMETRIC.contains(&name.trim_start_matches('\\')) {
            let space = if self.style == Style::Latex && arguments.starts_with('\\') { "" } else { " " };
            let space = if raised.is_empty() || self.style == Style::Unicode { space } else { "" };
            let space = if self.style == Style::Unicode { " " } else { space };
            return (format!("{name}{raised}{space}{arguments}"), Binding::Prefix);
        }
        (format!("{name}{raised}{}", self.brackets(&arguments)), Binding::Atom)
    }

    fn relation(&self, c: Comparison) -> &'static str {
        match (c, self.style) {
            (_, Style::Ascii) => c.sign(),
            (Comparison::Le, Style::Unicode) => "≤",
            (Comparison::Ge, Style::Unicode) => "≥",
            (Comparison::Ne, Style::Unicode) => "≠",
            (Comparison::Le, Style::Latex) => "\\le",
            (Comparison::Ge, Style::Latex) => "\\ge",
            (Comparison::Ne, Style::Latex) => "\\ne",
            (Comparison::Eq, _) => "=",
            (Comparison::Lt | Comparison::Gt, _) => c.sign(),
        }
    }

    fn choice(&self, c: &Shape, a: &Shape, b: &Shape) -> (String, Binding) {
        let c = self.at_least(c, Binding::Or);
        let [a, b] = [a, b].map(|s| self.text(s).0);
        if self.style == Style::Latex {
            let text = format!("\\begin{{cases}} {a} & \\text{{if }} {c} \\\\ {b} & \\text{{else}} \\end{{cases}}");
            return (text, Binding::Atom);
        }
        (format!("if {c} then {a} else {b}"), Binding::Choice)
    }
}

/// Whether LaTeX ends in a name of several letters: `\mathit{load}`.
fn last_is_word(latex: &str) -> bool {
    latex.rfind("\\mathit{").is_some_and(|at| latex[at..].find('}') == Some(latex.len() - at - 1))
}

/// Functions that take a name without brackets.
const TRIGONOMETRIC: [&str; 7] = ["sin", "cos", "tan", "sinh", "cosh", "tanh", "ln"];

fn latex_function(name: &str) -> String {
    match name {
        "sin" | "cos" | "tan" | "sinh" | "cosh" | "tanh" | "min" | "max" | "exp" => format!("\\{name}"),
        "log" => "\\ln".into(),
        "log10" => "\\log_{10}".into(),
        "asin" => "\\arcsin".into(),
        "acos" => "\\arccos".into(),
        "atan" => "\\arctan".into(),
        _ => format!("\\operatorname{{{name}}}"),
    }
}

fn superscript(digits: &str) -> String {
    const RAISED: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    digits.chars().map(|c| c.to_digit(10).map_or('⁻', |d| RAISED[d as usize])).collect()
}
