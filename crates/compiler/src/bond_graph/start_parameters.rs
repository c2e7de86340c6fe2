//! Start values as parameters: what a fit searches.

use super::{BondGraph, Initial, Kind, Meaning, Parameter, ParameterId, ParameterKind, Variable};
use crate::algebra::{Facts, Symbol};
use crate::ids::Id;
use crate::span::Span;

impl BondGraph {
    /// Makes the start value of a variable a parameter, `spring.q(0)` for `spring.q`, whose value is that of the model: of an
    /// integrated signal, of what a start value is given for, or of a storage that has none.
    ///
    /// # Errors
    /// It is none of these: in words.
    pub fn make_start_parameter(&mut self, variable: &str) -> Result<(), String> {
        let name = format!("{variable}(0)");
        if self.parameters.values().any(|p| p.name == name) {
            return Ok(());
        }
        let signal = self.signals.iter().find(|(_, s)| s.name == variable).map(|(id, _)| id);
        if let Some(id) = signal {
            let zero = self.exprs.int(0);
            let (symbol, value) = (self.signals[id].symbol, self.signals[id].initial.unwrap_or(zero));
            let parameter = self.start_parameter(name, symbol, value);
            self.signals[id].initial = Some(self.exprs.sym(parameter));
            return Ok(());
        }
        let (element, symbol) = self.start_variable(variable)?;
        let (Kind::Inertance(storage) | Kind::Compliance(storage)) = &self.elements[element].kind else {
            return Err(format!("`{variable}` is no variable of a storage"));
        };
        let given = storage.initial.iter().position(|initial| initial.symbol == symbol);
        let value = match given {
            Some(at) => storage.initial[at].value,
            None if storage.initial.is_empty() => self.exprs.int(0),
            None => {
                let given: Vec<&str> = storage.initial.iter().map(|i| self.exprs.name(i.symbol)).collect();
                return Err(format!("the model gives a start value for {}: take that", given.join(", ")));
            }
        };
        let parameter = self.start_parameter(name, symbol, value);
        let value = self.exprs.sym(parameter);
        if let Kind::Inertance(storage) | Kind::Compliance(storage) = &mut self.elements[element].kind {
            match given {
                Some(at) => storage.initial[at].value = value,
                None => storage.initial.push(Initial { symbol, value, span: Span::default() }),
            }
        }
        Ok(())
    }

    /// The storage that a variable belongs to, with its symbol.
    fn start_variable(&self, variable: &str) -> Result<(super::ElementId, Symbol), String> {
        for (id, element) in self.elements.iter() {
            let (Kind::Inertance(storage) | Kind::Compliance(storage)) = &element.kind else { continue };
            let given = storage.initial.iter().map(|initial| initial.symbol);
            let mut known = storage.stored.iter().copied().chain(given);
            if let Some(symbol) = known.find(|s| self.exprs.name(*s) == variable) {
                return Ok((id, symbol));
            }
            // Effort or flow of its only bond.
            let of_bond = |(symbol, own): (&Symbol, &Variable)| {
                let bond = match own.meaning {
                    Meaning::Effort(bond) | Meaning::Flow(bond) => bond,
                    _ => return None,
                };
                let ends = [self.bonds[bond].from.element, self.bonds[bond].to.element];
                (ends.contains(&id) && self.exprs.name(*symbol) == variable).then_some(*symbol)
            };
            if variable.strip_prefix(element.name.as_str()).is_some_and(|rest| rest == ".e" || rest == ".f")
                && let Some(symbol) = self.variables.iter().find_map(of_bond)
            {
                return Ok((id, symbol));
            }
        }
        Err(format!(
            "`{variable}` is neither an integrated signal nor a variable of a storage, which begin with a value"
        ))
    }

    fn start_parameter(&mut self, name: String, of: Symbol, value: crate::algebra::Expr) -> Symbol {
        let facts = Facts { nonzero: false, positive: false, given: Some(value) };
        let symbol = self.exprs.symbol(&name, facts);
        let unit = self.variables.get(&of).and_then(|v| v.unit.clone());
        let meaning = Meaning::Parameter(ParameterId::new(self.parameters.len()));
        self.variables.insert(symbol, Variable { meaning, unit: unit.clone() });
        self.parameters.push(Parameter {
            name,
            symbol,
            value,
            constant: false,
            shapes: false,
            kind: ParameterKind::Declared,
            unit,
            doc: "a start value".to_string(),
            span: Span::default(),
        });
        symbol
    }
}
