//! Linear loops: what the unknowns at which a loop is torn make of its other variables.
//!
//! Variables are gone through in the order in which they are defined by each other, each as a linear form in the
//! unknowns. What gets long on the way keeps a name and is evaluated once, so that a chain takes operations in
//! proportion to its length: written out, its last variable would hold all those before it.

use std::collections::BTreeMap;

use crate::algebra::{Expr, Exprs, Symbol, ZERO};

/// A part that is written longer than this keeps a name,
const NAMED: u64 = 120;
/// and in loops with at least this many unknowns
const MANY: usize = 6;
/// one that is longer than this: such loops are not read as a whole.
const NAMED_OF_MANY: u64 = 24;

/// `Σ coefficient · unknown + rest`, coefficients by the number of the unknown.
#[derive(Debug, Clone)]
pub struct LinearForm {
    /// The coefficients that are not zero.
    pub coefficients: BTreeMap<usize, Expr>,
    /// What is left where all unknowns are zero.
    pub rest: Expr,
}

/// The linear forms of a loop.
#[derive(Debug, Default)]
pub struct LinearForms {
    of: BTreeMap<Symbol, LinearForm>,
    /// Names of parts, each with its value, in variables and in names before it.
    pub named: Vec<(Symbol, Expr)>,
}

impl LinearForms {
    /// The forms of the variables of a loop, in order of evaluation; `None` if one of them is no linear form.
    pub fn new(x: &mut Exprs, unknowns: &[Symbol], body: &[(Symbol, Expr)]) -> Option<LinearForms> {
        LinearForms::of(x, unknowns, body, LinearForms::with_names)
    }

    /// The same with wholes in the place of names.
    pub fn of_wholes(x: &mut Exprs, unknowns: &[Symbol], body: &[(Symbol, Expr)]) -> Option<LinearForms> {
        LinearForms::of(x, unknowns, body, |_, x, _, _, mut form| {
            form.coefficients.values_mut().for_each(|e| *e = x.whole(*e));
            form.rest = x.whole(form.rest);
            form
        })
    }

    fn of(
        x: &mut Exprs,
        unknowns: &[Symbol],
        body: &[(Symbol, Expr)],
        short: impl Fn(&mut LinearForms, &mut Exprs, Symbol, &[Symbol], LinearForm) -> LinearForm,
    ) -> Option<LinearForms> {
        let mut forms = LinearForms::default();
        for (k, &unknown) in unknowns.iter().enumerate() {
            let coefficients = BTreeMap::from([(k, x.int(1))]);
            forms.of.insert(unknown, LinearForm { coefficients, rest: ZERO });
        }
        for &(symbol, value) in body {
            let form = forms.of_expr(x, value)?;
            let form = short(&mut forms, x, symbol, unknowns, form);
            forms.of.insert(symbol, form);
        }
        Some(forms)
    }

    /// An expression as a linear form; `None` if it is none.
    pub fn of_expr(&self, x: &mut Exprs, e: Expr) -> Option<LinearForm> {
        let read: Vec<Symbol> = x.symbols_of(e).into_iter().filter(|s| self.of.contains_key(s)).collect();
        let (own, rest) = x.sparse_linear_in(e, &read)?;
        let mut terms: BTreeMap<usize, Vec<Expr>> = BTreeMap::new();
        let mut rests = vec![rest];
        for (place, factor) in own {
            let form = &self.of[&read[place]];
            for (&k, &coefficient) in &form.coefficients {
                terms.entry(k).or_default().push(x.mul(&[factor, coefficient]));
            }
            rests.push(x.mul(&[factor, form.rest]));
        }
        let mut coefficients: BTreeMap<usize, Expr> = terms.into_iter().map(|(k, t)| (k, x.add(&t))).collect();
        coefficients.retain(|_, e| *e != ZERO);
        Some(LinearForm { coefficients, rest: x.add(&rests) })
    }

    fn with_names(&mut self, x: &mut Exprs, symbol: Symbol, unknowns: &[Symbol], mut form: LinearForm) -> LinearForm {
        let longest = if unknowns.len() < MANY { NAMED } else { NAMED_OF_MANY };
        for (&k, coefficient) in &mut form.coefficients {
            if x.is_longer(*coefficient, longest) {
                let gain = x.gain(symbol, unknowns[k]);
                *coefficient = self.name(x, gain, *coefficient);
            }
        }
        if x.is_longer(form.rest, longest) {
            let bias = x.bias(symbol);
            form.rest = self.name(x, bias, form.rest);
        }
        form
    }

    fn name(&mut self, x: &mut Exprs, symbol: Symbol, value: Expr) -> Expr {
        self.named.push((symbol, value));
        x.sym(symbol)
    }
}
