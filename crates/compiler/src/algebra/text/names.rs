//! How symbols are written.

use super::super::exprs::Exprs;
use super::super::node::Symbol;
use super::super::symbols::dotted;
use super::super::table::TableId;

/// How symbols and tables are written, and in what order they stand in a product.
pub trait Names {
    /// What it is called, and of what is called so how many time derivatives it is.
    fn called(&self, symbol: Symbol) -> (String, usize);

    /// In the model language.
    fn ascii(&self, symbol: Symbol) -> String {
        let (name, rates) = self.called(symbol);
        dotted(&name, rates)
    }

    /// In Unicode text.
    fn unicode(&self, symbol: Symbol) -> String {
        let (name, rates) = self.called(symbol);
        unicode_name(&name, rates)
    }

    /// In LaTeX.
    fn latex(&self, symbol: Symbol) -> String {
        let (name, rates) = self.called(symbol);
        latex_name(&name, rates)
    }

    /// In MathML.
    fn mathml(&self, symbol: Symbol) -> String {
        let (name, rates) = self.called(symbol);
        mathml_name(&name, rates)
    }

    /// Where it stands among others.
    fn place(&self, symbol: Symbol) -> Place;

    /// The name of a table, as of a function.
    fn table(&self, table: TableId) -> String {
        format!("table{}", table.0 + 1)
    }
}

/// Where a symbol stands in products and sums: smaller ones further left.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Place {
    /// What it is.
    pub sort: Sort,
    /// Among the factors of a product that are of the same sort the smaller family stands further left, and the sums of
    /// a family after its symbols: `(m1 + m2) g l`, `k2 (k1 + k3)`.
    pub family: u8,
    /// Its place among the factors of its family.
    pub factor: u32,
    /// Its place among the terms of its sort: parameters of all families, and variables of the first two, are one. Equal
    /// ones stand by name.
    pub term: u32,
}

/// What a symbol is to the reader of an equation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Sort {
    /// It keeps its value.
    Parameter,
    /// It varies, and is given from outside: time, an input, a source.
    Given,
    /// It varies with the motion.
    Variable,
    /// The rate of a state; it stands last in its term: `M a² ω'`.
    Rate,
}

/// Symbols by their labels, factors in the order in which they were made, parameters first.
pub struct PlainNames<'a>(
    /// The pool of the symbols.
    pub &'a Exprs,
);

impl Names for PlainNames<'_> {
    fn called(&self, symbol: Symbol) -> (String, usize) {
        let (of, rates) = self.0.undotted(symbol);
        (self.0.label(of).to_owned(), rates)
    }

    fn place(&self, symbol: Symbol) -> Place {
        let sort = if self.0.facts(symbol).given.is_some() { Sort::Parameter } else { Sort::Variable };
        Place { sort, family: 0, factor: symbol.0, term: 0 }
    }
}

const GREEK: [(&str, char, &str); 34] = [
    ("alpha", 'α', "alpha"),
    ("beta", 'β', "beta"),
    ("gamma", 'γ', "gamma"),
    ("delta", 'δ', "delta"),
    ("epsilon", 'ε', "varepsilon"),
    ("eps", 'ε', "varepsilon"),
    ("zeta", 'ζ', "zeta"),
    ("eta", 'η', "eta"),
    ("theta", 'θ', "theta"),
    ("kappa", 'κ', "kappa"),
    ("lambda", 'λ', "lambda"),
    ("mu", 'μ', "mu"),
    ("nu", 'ν', "nu"),
    ("xi", 'ξ', "xi"),
    ("pi", 'π', "pi"),
    ("rho", 'ρ', "rho"),
    ("sigma", 'σ', "sigma"),
    ("tau", 'τ', "tau"),
    ("upsilon", 'υ', "upsilon"),
    ("phi", 'φ', "varphi"),
    ("chi", 'χ', "chi"),
    ("psi", 'ψ', "psi"),
    ("omega", 'ω', "omega"),
    ("Gamma", 'Γ', "Gamma"),
    ("Delta", 'Δ', "Delta"),
    ("Theta", 'Θ', "Theta"),
    ("Lambda", 'Λ', "Lambda"),
    ("Xi", 'Ξ', "Xi"),
    ("Pi", 'Π', "Pi"),
    ("Sigma", 'Σ', "Sigma"),
    ("Phi", 'Φ', "Phi"),
    ("Psi", 'Ψ', "Psi"),
    ("Omega", 'Ω', "Omega"),
    ("iota", 'ι', "iota"),
];

/// A name of the model language in Unicode, with its time derivatives: `phi_1` once is `φ_1'`, `omega2` is `ω2`.
pub fn unicode_name(name: &str, rates: usize) -> String {
    let words: Vec<String> =
        name.split('.').map(|part| part.split('_').map(indexed_word).collect::<Vec<_>>().join("_")).collect();
    dotted(&words.join("."), rates)
}

/// A name of the model language in LaTeX, with its time derivatives: `phi_1` once is `\dot{\varphi}_{1}`, `w.f` is
/// `f_{\mathrm{w}}`.
pub fn latex_name(name: &str, rates: usize) -> String {
    let (owner, own) = match name.rsplit_once('.') {
        Some((owner, own)) => (Some(owner), own),
        None => (None, name),
    };
    let (own, indices) = split_indices(own);
    let mut parts = own.split('_').filter(|p| !p.is_empty());
    let (letters, digits) = split_digits(parts.next().unwrap_or(own));
    let mut below: Vec<String> = Vec::new();
    below.extend(Some(digits).filter(|d| !d.is_empty()).map(str::to_owned));
    below.extend(parts.map(latex_subscript));
    below.extend(Some(indices).filter(|i| !i.is_empty()).map(str::to_owned));
    below.extend(owner.map(|o| o.split('.').map(latex_part).collect::<Vec<_>>().join("\\,")));
    let base = latex_word(letters);
    let base = match rates {
        0 => base,
        1 => format!("\\dot{{{base}}}"),
        2 => format!("\\ddot{{{base}}}"),
        n => format!("{base}^{{({n})}}"),
    };
    if below.is_empty() { base } else { format!("{base}_{{{}}}", below.join(",")) }
}

/// A name of the model language in MathML, with its time derivatives: `phi_1` once is φ with a dot and the subscript 1,
/// `w.f` is f with the subscript w.
pub fn mathml_name(name: &str, rates: usize) -> String {
    let (owner, own) = match name.rsplit_once('.') {
        Some((owner, own)) => (Some(owner), own),
        None => (None, name),
    };
    let (own, indices) = split_indices(own);
    let mut parts = own.split('_').filter(|p| !p.is_empty());
    let (letters, digits) = split_digits(parts.next().unwrap_or(own));
    let mut below: Vec<String> = Vec::new();
    below.extend(Some(digits).filter(|d| !d.is_empty()).map(|digits| format!("<mn>{digits}</mn>")));
    below.extend(parts.map(mathml_subscript));
    below.extend(Some(indices).filter(|i| !i.is_empty()).map(mathml_indices));
    below.extend(owner.map(mathml_owner));
    let base = mathml_word(letters);
    let base = match rates {
        0 => base,
        n => format!("<mover>{base}<mo stretchy=\"false\">{}</mo></mover>", "˙".repeat(n)),
    };
    match below.len() {
        0 => base,
        _ => format!("<msub>{base}<mrow>{}</mrow></msub>", below.join("<mo>,</mo>")),
    }
}

/// The name of an element as a subscript.
pub fn mathml_owner(owner: &str) -> String {
    let upright = |text: &str| format!("<mi mathvariant=\"normal\">{}</mi>", super::mathml::escape(text));
    if !owner.contains('[') {
        return upright(owner);
    }
    let part = |part: &str| match split_indices(part) {
        (name, "") => upright(name),
        (name, indices) => format!("<msub>{}<mrow>{}</mrow></msub>", upright(name), mathml_indices(indices)),
    };
    format!("<mrow>{}</mrow>", owner.split('.').map(part).collect::<Vec<_>>().join("<mo>.</mo>"))
}

fn mathml_indices(indices: &str) -> String {
    let index = |index: &str| format!("<mn>{}</mn>", index.replace('-', "−"));
    indices.split(',').map(index).collect::<Vec<_>>().join("<mo>,</mo>")
}

/// The name of an element as an upright subscript: `motor.coil`, `spring[3]`.
pub fn latex_owner(owner: &str) -> String {
    let upright = |text: &str| format!("\\mathrm{{{}}}", text.replace('_', "\\_"));
    if !owner.contains('[') {
        return upright(owner);
    }
    let part = |part: &str| match split_indices(part) {
        (name, "") => upright(name),
        (name, indices) => format!("{}_{{{indices}}}", upright(name)),
    };
    owner.split('.').map(part).collect::<Vec<_>>().join(".")
}

/// A name and what stands in brackets behind it.
fn split_indices(name: &str) -> (&str, &str) {
    name.strip_suffix(']').and_then(|n| n.split_once('[')).unwrap_or((name, ""))
}

fn mathml_word(word: &str) -> String {
    match GREEK.iter().find(|g| g.0 == word) {
        Some(greek) => format!("<mi>{}</mi>", greek.1),
        None if word.chars().count() == 1 => format!("<mi>{}</mi>", super::mathml::escape(word)),
        None => format!("<mi class=\"word\">{}</mi>", super::mathml::escape(word)),
    }
}

fn mathml_subscript(word: &str) -> String {
    if word.bytes().all(|b| b.is_ascii_digit()) {
        return format!("<mn>{word}</mn>");
    }
    match GREEK.iter().any(|g| g.0 == word) || word.chars().count() == 1 {
        true => mathml_word(word),
        false => mathml_owner(word),
    }
}

fn split_digits(word: &str) -> (&str, &str) {
    let end = word.trim_end_matches(|c: char| c.is_ascii_digit()).len();
    if end == 0 { (word, "") } else { word.split_at(end) }
}

fn indexed_word(word: &str) -> String {
    match split_indices(word) {
        (_, "") => unicode_word(word),
        (name, indices) => format!("{}[{indices}]", unicode_word(name)),
    }
}

/// A part of the name of an element in a subscript.
fn latex_part(part: &str) -> String {
    let (name, indices) = split_indices(part);
    let name = name.split('_').map(latex_subscript).collect::<Vec<_>>().join("\\,");
    if indices.is_empty() { name } else { format!("{name}_{{{indices}}}") }
}

fn unicode_word(word: &str) -> String {
    let (letters, digits) = split_digits(word);
    match GREEK.iter().find(|g| g.0 == letters) {
        Some(greek) => format!("{}{digits}", greek.1),
        None => word.to_owned(),
    }
}

fn latex_word(word: &str) -> String {
    if let Some(greek) = GREEK.iter().find(|g| g.0 == word || word.chars().eq([g.1])) {
        return format!("\\{}", greek.2);
    }
    if word.chars().count() == 1 { word.to_owned() } else { format!("\\mathit{{{word}}}") }
}

fn latex_subscript(word: &str) -> String {
    if GREEK.iter().any(|g| g.0 == word) {
        return latex_word(word);
    }
    if word.chars().count() == 1 || word.bytes().all(|b| b.is_ascii_digit()) {
        return word.to_owned();
    }
    format!("\\mathrm{{{word}}}")
}
