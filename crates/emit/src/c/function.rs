//! Functions in C: how they are declared, what they call, and what they take of the stack.

use std::collections::BTreeSet;

use super::written::{FragmentName, Line};
use crate::Real;

/// Bytes of a frame besides its variables.
const FRAME: usize = 96;

/// A parameter of a function.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Parameter {
    /// The model, by its pointer.
    Model,
    /// The model, which is only read.
    ConstModel,
    /// A whole number.
    Int(&'static str),
    /// A number.
    Real(&'static str),
    /// A number of double precision.
    Wide(&'static str),
    /// Numbers that are read.
    Reals(&'static str),
    /// Numbers that are written.
    RealsOut(&'static str),
    /// Such in double precision.
    WideOut(&'static str),
}

impl Parameter {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Parameter::Model | Parameter::ConstModel => "m",
            Parameter::Int(name)
            | Parameter::Real(name)
            | Parameter::Wide(name)
            | Parameter::Reals(name)
            | Parameter::RealsOut(name)
            | Parameter::WideOut(name) => name,
        }
    }

    fn declared(self, real: Real) -> String {
        match self {
            Parameter::Model => "ha_model *m".into(),
            Parameter::ConstModel => "const ha_model *m".into(),
            Parameter::Int(name) => format!("int {name}"),
            Parameter::Real(name) => format!("{} {name}", real.kind()),
            Parameter::Wide(name) => format!("{} {name}", Real::Double.kind()),
            Parameter::Reals(name) => format!("const {} *{name}", real.kind()),
            Parameter::RealsOut(name) => format!("{} *{name}", real.kind()),
            Parameter::WideOut(name) => format!("{} *{name}", Real::Double.kind()),
        }
    }
}

/// What a function gives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Gives {
    Nothing,
    Status,
}

/// How a function is declared, without a semicolon.
pub(super) fn declaration(name: &str, gives: Gives, parameters: &[Parameter], real: Real) -> String {
    let kind = if gives == Gives::Nothing { "void" } else { "int" };
    let parameters: Vec<String> = parameters.iter().map(|p| p.declared(real)).collect();
    format!("static {kind} {name}({})", parameters.join(", "))
}

/// A function that was written.
#[derive(Debug, Clone)]
pub(super) struct Function {
    pub name: String,
    pub text: String,
    /// The functions and tables that it needs.
    pub needs: BTreeSet<FragmentName>,
    /// Bytes that it takes of the stack.
    pub stack: usize,
}

impl Function {
    pub fn new(name: String, gives: Gives, parameters: &[Parameter], real: Real, lines: &[Line]) -> Function {
        let mut text = declaration(&name, gives, parameters, real) + "\n{\n";
        let mut needs = BTreeSet::new();
        for line in lines {
            text += &line.written.text;
            text.push('\n');
            needs.extend(line.written.notes.needs.iter().cloned());
        }
        // Each number in a place of its own, as wide as the widest.
        let stack = FRAME + 8 * lines.iter().map(|line| line.numbers).sum::<usize>();
        Function { name, text: text + "}\n", needs, stack }
    }
}
