//! Values of parameters that replace those of the model (`--set k=3`).

use std::collections::BTreeMap;

use rustc_hash::FxHashMap;

use super::flatten::Flat;
use super::scope::{Decl, DeclId, DeclKind, Valued};
use crate::ast::{self, Expr, StatementKind};
use crate::diagnostic::nearest;
use crate::diagnostic::{Diagnostic, Sources, codes};
use crate::span::Span;

/// How the names of the sources of new values begin.
pub(super) const SET: &str = "--set ";

/// A new value of a parameter.
///
/// The value is an expression in the language, perhaps with a unit: it stands in the place of the one in the model, so
/// that a number without a unit is SI, or in the unit after the `:` of the declaration.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Override {
    /// Full name of the parameter, such as `k`, `motor.r` or `k[3]`; `k` sets all of an array.
    pub name: String,
    /// Its value as text.
    pub value: String,
}

/// An override that has been read.
pub(super) struct Given {
    /// Full name of the parameter, or of an array of parameters.
    pub name: String,
    /// Its value.
    pub value: Expr,
    span: Span,
}

/// Reads the values. Each becomes a source of its own, so that faults have a place.
pub(super) fn parse(overrides: &[Override], sources: &mut Sources, faults: &mut Vec<Diagnostic>) -> Vec<Given> {
    let mut given = Vec::new();
    for o in overrides {
        // The parser reads models, so the value stands in one.
        let text = format!("model set\nparam value = {}", o.value);
        let file = sources.add(format!("{SET}{}", o.name), text.clone());
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
            Some(value) => {
                let name = o.name.split_whitespace().collect();
                given.push(Given { name, value, span });
            }
            None if fine => faults.push(
                Diagnostic::error(codes::N019, format!("no value for `{}`", o.name), span, "not one value")
                    .hint("write `name=value`, such as `k=3` or `k=18 kN/m`"),
            ),
            None => {}
        }
    }
    given
}

/// Says which values have no parameter to be put in place of.
pub(super) fn refuse_idle(given: &[Given], flat: &Flat<'_>, faults: &mut Vec<Diagnostic>) {
    if given.is_empty() {
        return;
    }
    let decls = &flat.names.decls;
    let by_name: FxHashMap<&str, DeclId> =
        decls.iter().enumerate().rev().map(|(id, d)| (d.name.as_str(), id)).collect();
    let arrays = arrays(flat);
    for g in given {
        let decl = by_name.get(g.name.as_str()).or_else(|| arrays.get(&g.name)).map(|id| &decls[*id]);
        faults.extend(idle(g, decl, flat, &arrays));
    }
}

/// A declaration of each array, by its name.
fn arrays(flat: &Flat<'_>) -> BTreeMap<String, DeclId> {
    let mut all = BTreeMap::new();
    for scope in &flat.names.scopes {
        for (name, value) in &scope.values {
            if let Valued::Family(family) = value
                && let Some(&first) = flat.names.value_families[*family].first()
            {
                all.insert([&scope.prefix, *name].concat(), first);
            }
        }
    }
    all
}

fn idle(g: &Given, decl: Option<&Decl<'_>>, flat: &Flat<'_>, arrays: &BTreeMap<String, DeclId>) -> Option<Diagnostic> {
    let fault = |title: String| Diagnostic::error(codes::N019, title, g.span, "set here");
    Some(match decl {
        Some(Decl { kind: DeclKind::Parameter { constant: false, .. }, .. }) => return None,
        Some(d @ Decl { kind: DeclKind::Parameter { .. }, .. }) => fault(format!("`{}` is a constant", g.name))
            .also(d.span, "declared here")
            .hint("declare it with `param` to change it"),
        Some(d) => fault(format!("`{}` is no parameter", g.name))
            .also(d.span, "declared here")
            .hint("only parameters can be set; inputs are given as files or by their default"),
        None => {
            let free = |d: &&Decl<'_>| matches!(d.kind, DeclKind::Parameter { constant: false, .. });
            let known = flat.names.decls.iter().filter(free).map(|d| d.name.as_str());
            let fault = fault(format!("there is no parameter `{}`", g.name));
            match nearest(&g.name, known.chain(arrays.keys().map(String::as_str))) {
                Some(near) => fault.hint(format!("did you mean `{near}`?")),
                None => fault.hint("declare it in the model: `param name = …`"),
            }
        }
    })
}
