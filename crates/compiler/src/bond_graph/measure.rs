//! Units as they are written in a model.

use super::builder::{Builder, Value};
use super::dimension::Quantity;
use super::value::Reading;
use crate::algebra::{Expr, Rational};
use crate::ast;
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

    /// Reads the unit of a number; where there is no such unit but a declared name, a product is meant.
    pub fn unit_of_number(&mut self, cx: &Reading<'_>, n: &ast::Number, unit: &ast::UnitText) -> Option<Scale> {
        let names = [unit.text.as_str(), Unit::first_symbol(&unit.text)];
        let declared = |name: &str| Some((name.to_string(), self.flat.names.value(cx.here.scope, name)?));
        match (Unit::parse(&unit.text), names.into_iter().find_map(declared)) {
            (Err(why), Some((symbol, decl))) => {
                let declared = self.flat.names.span_of(decl);
                let hint = format!("write `{}*{symbol}` for the product", n.text);
                self.fault(why.at(unit.span).also(declared, format!("`{symbol}` is declared here")).hint(hint));
                None
            }
            _ => self.unit(unit),
        }
    }
}
