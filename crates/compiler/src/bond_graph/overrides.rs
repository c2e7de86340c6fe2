//! Values of parameters that replace those of the model (`--set k=3`).

use super::decls::unit_of_literal;
use super::flatten::Flat;
use super::scope::DeclKind;
use crate::ast::{self, Expr, StatementKind};
use crate::diagnostic::nearest;
use crate::diagnostic::{Diagnostic, Sources, codes};
use crate::span::Span;

/// A new value of a parameter.
///
/// The value is an expression in the language, perhaps with a unit: it stands in the place of the one in the model, so
/// that a number without a unit is SI, or in the unit after the `:` of the declaration.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Override {
    /// Full name of the parameter, such as `k` or `motor.r`.
    pub name: String,
    /// Its value as text.
    pub value: String,
}

/// An override that has been read.
pub(super) struct Given {
    name: String,
    value: Expr,
    span: Span,
}

/// Reads the values. Each becomes a source of its own, so that faults have a place.
pub(super) fn parse(overrides: &[Override], sources: &mut Sources, faults: &mut Vec<Diagnostic>) -> Vec<Given> {
    let mut given = Vec::new();
    for o in overrides {
        // The parser reads models, so the value stands in one.
        let text = format!("model set\nparam value = {}", o.value);
        let file = sources.add(format!("--set {}", o.name), text.clone());
        let parsed = ast::parse(&text, file);
        let fine = !parsed.diagnostics.iter().any(Diagnostic::is_error);
        faults.extend(parsed.diagnostics);
        let span = Span { file, start: (text.len() - o.value.len()) as u32, end: text.len() as u32 };
        let mut statements = parsed.ast.statements.into_iter();
        let value = match (statements.next().map(|s| s.kind), statements.next()) {
            (Some(StatementKind::Param(list)), None) if list.len() == 1 => {
                list.into_iter().next().filter(|d| d.unit.is_none() && d.doc.is_none()).and_then(|d| d.value)
            }
            _ => None,
        };
        match value {
            Some(value) => given.push(Given { name: o.name.clone(), value, span }),
            None if fine => faults.push(
                Diagnostic::error(codes::N019, format!("no value for `{}`", o.name), span, "not one value")
                    .hint("write `name=value`, such as `k=3` or `k=18 kN/m`"),
            ),
            None => {}
        }
    }
    given
}

/// Puts the values in the place of those of the model.
pub(super) fn apply<'a>(given: &'a [Given], flat: &mut Flat<'a>, faults: &mut Vec<Diagnostic>) {
    for g in given {
        let decls = &mut flat.names.decls;
        let found = decls.iter_mut().find(|d| d.name == g.name);
        let fault = match found {
            Some(d) => match &mut d.kind {
                DeclKind::Parameter { value, constant: false } => {
                    d.replaced_unit = value.and_then(unit_of_literal);
                    *value = Some(&g.value);
                    d.reads = 0;
                    continue;
                }
                DeclKind::Parameter { .. } => {
                    let hint = "declare it with `param` to change it";
                    Diagnostic::error(codes::N019, format!("`{}` is a constant", g.name), g.span, "set here")
                        .also(d.span, "declared here")
                        .hint(hint)
                }
                _ => Diagnostic::error(codes::N019, format!("`{}` is no parameter", g.name), g.span, "set here")
                    .also(d.span, "declared here")
                    .hint("only parameters can be set; inputs are given as files or by their default"),
            },
            None => {
                let known = decls.iter().filter(|d| matches!(d.kind, DeclKind::Parameter { constant: false, .. }));
                let d =
                    Diagnostic::error(codes::N019, format!("there is no parameter `{}`", g.name), g.span, "set here");
                match nearest(&g.name, known.map(|d| d.name.as_str())) {
                    Some(near) => d.hint(format!("did you mean `{near}`?")),
                    None => d.hint("declare it in the model: `param name = …`"),
                }
            }
        };
        faults.push(fault);
    }
}
