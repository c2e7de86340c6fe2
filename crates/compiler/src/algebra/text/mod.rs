//! Expressions as people write them: in the model language, as Unicode text, as LaTeX, as MathML.

mod mathml;
mod names;
mod numbers;
mod render;
mod shape;

pub use names::{Names, Place, PlainNames, Sort, latex_name, latex_owner, mathml_name, mathml_owner, unicode_name};

use super::exprs::Exprs;
use super::node::Expr;
use render::Style;

/// The expression in the model language: `-R1/R2`, `x^2`, `if c then a else b`.
///
/// Terms and factors stand in human order ([`Place`]): a positive term first where there is one, what is given before
/// what moves; numbers before parameters before states before functions before rates. Parts nested deeper than 200 levels, and what comes after 20,000 parts, are left out as `…`.
///
/// ```
/// use halfarrow_compiler::algebra::{Exprs, Facts, PlainNames, ascii};
/// let mut x = Exprs::default();
/// let [a, b] = ["a", "b"].map(|name| x.symbol(name, Facts::default()));
/// let [a, b] = [a, b].map(|s| x.sym(s));
/// let e = x.sub(b, a);
/// let e = x.div(e, b);
/// assert_eq!(ascii(&x, e, &PlainNames(&x)), "(b - a)/b");
/// ```
pub fn ascii(x: &Exprs, e: Expr, names: &dyn Names) -> String {
    print(x, e, names, Style::Ascii)
}

/// The expression as a textbook sets it in plain text: `M g a cos φ`, `x²`.
pub fn unicode(x: &Exprs, e: Expr, names: &dyn Names) -> String {
    print(x, e, names, Style::Unicode)
}

/// The expression in LaTeX, for math mode.
pub fn latex(x: &Exprs, e: Expr, names: &dyn Names) -> String {
    print(x, e, names, Style::Latex)
}

/// The expression in MathML Core, for pages: elements without the `math` around them.
///
/// ```
/// use halfarrow_compiler::algebra::{Exprs, Facts, PlainNames, mathml};
/// let mut x = Exprs::default();
/// let [a, b] = ["a", "omega"].map(|name| x.symbol(name, Facts::default()));
/// let [a, b] = [a, b].map(|s| x.sym(s));
/// let e = x.div(a, b);
/// assert_eq!(mathml(&x, e, &PlainNames(&x)), "<mfrac><mrow><mi>a</mi></mrow><mrow><mi>ω</mi></mrow></mfrac>");
/// ```
pub fn mathml(x: &Exprs, e: Expr, names: &dyn Names) -> String {
    mathml_within(x, e, names, usize::MAX)
}

/// As [`mathml`], up to so many parts: `…` stands for each that is left out.
pub fn mathml_within(x: &Exprs, e: Expr, names: &dyn Names, most: usize) -> String {
    mathml::mathml(&shape::shape(x, e, names, most), names)
}

/// As [`ascii`], up to so many characters: what is longer ends with `…`. What is left out is not put into words first.
pub fn ascii_within(x: &Exprs, e: Expr, names: &dyn Names, most: usize) -> String {
    within(x, e, names, Style::Ascii, most)
}

/// As [`unicode`], up to so many characters: what is longer ends with `…`.
pub fn unicode_within(x: &Exprs, e: Expr, names: &dyn Names, most: usize) -> String {
    within(x, e, names, Style::Unicode, most)
}

fn print(x: &Exprs, e: Expr, names: &dyn Names, style: Style) -> String {
    let shape = shape::shape(x, e, names, usize::MAX);
    render::render(&shape, names, style)
}

fn within(x: &Exprs, e: Expr, names: &dyn Names, style: Style, most: usize) -> String {
    if most == usize::MAX {
        return print(x, e, names, style);
    }
    // A part has at least one character, and is seldom put into shape more than once.
    let shape = shape::shape(x, e, names, most.saturating_mul(4));
    let text = render::render(&shape, names, style);
    let end = text.char_indices().nth(most).map(|(at, _)| at);
    match [text.find('…'), end].into_iter().flatten().min() {
        Some(end) => format!("{}…", text[..end].trim_end()),
        None => text,
    }
}
