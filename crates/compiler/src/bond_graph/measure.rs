//! Units as they are written in a model.

use super::builder::{Builder, Value};
use super::dimension::Quantity;
use super::value::Reading;
use crate::algebra::{Expr, Rational};
use crate::ast;
use crate::diagnostic::{Diagnostic, codes};
use crate::unit::{Dimension, Unit};

/// A unit with the way to SI as expressions.
pub(super) struct Scale {
    /// Its dimension.
    pub dim: Dimension,
    /// The unit.
    pub unit: Option<Unit>,
    factor: Expr,
    offset: Expr,
}

impl Builder<'_, '_> {
    /// Reads a unit; says so if it is none.
    pub fn unit(&mut self, text: &ast::UnitText) -> Option<Scale> {
        self.units_written = true;
        let unit = match Unit::parse(&text.text) {
            Ok(unit) => unit,
            Err(why) => {
                self.fault(why.at(text.span));
                return None;
            }
        };
        let rational = self.exprs.number(Rational::from_big(unit.rational.clone()));
        let pi = self.exprs.pi();
        let power = self.exprs.powi(pi, i64::from(unit.pi));
        let factor = self.exprs.mul(&[rational, power]);
        let offset = self.exprs.number(Rational::from_big(unit.offset.clone()));
        Some(Scale { dim: unit.dimension, unit: Some(unit), factor, offset })
    }

    /// A number in a unit, as a value in SI.
    pub fn in_unit(&mut self, number: Expr, scale: &Scale) -> Value {
        let scaled = self.exprs.mul(&[number, scale.factor]);
        Value::number(self.exprs.add(&[scaled, scale.offset]), Quantity::of(scale.dim))
    }

    /// `2 m` where a parameter `m` is declared could mean `2*m`.
    pub fn refuse_name_as_unit(&mut self, cx: &Reading<'_>, n: &ast::Number, unit: &ast::UnitText) {
        let symbol = Unit::first_symbol(&unit.text);
        let Some(decl) = self.flat.names.value(cx.scope, symbol) else { return };
        let number = &n.text;
        let title = format!("`{number} {}` can be read in two ways", unit.text);
        self.fault(
            Diagnostic::error(codes::U004, title, unit.span, format!("`{symbol}` is a unit, and a declared name"))
                .also(self.flat.names.decls[decl].span, format!("`{symbol}` is declared here"))
                .hint(format!(
                    "write `{number}*{symbol}` for the product; to use the unit, give the declared name another one"
                )),
        );
    }
}
