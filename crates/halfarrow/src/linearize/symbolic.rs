//! Matrices and transfer functions as expressions.

use std::collections::BTreeMap;

use halfarrow_compiler::algebra::{
    Expr, Exprs, ONE, PlainNames, SparseRow, Symbol, ZERO, ascii, back_substitute, eliminate, latex, unicode,
};
use halfarrow_compiler::equations::{EquationStep, Equations, LinearBlock};
use serde::Serialize;

use crate::error::Problem;

/// States up to which transfer functions are told.
const MODEST: usize = 8;
/// States and steps up to which matrices are told.
const STATES: usize = 30;
const STEPS: usize = 2_000;
/// Unknowns of a linear block that is solved in symbols.
const BLOCK: usize = 8;

/// Matrices and transfer functions as expressions in the model language.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SymbolicReport {
    /// Derivatives of rates by states.
    pub a: Vec<Vec<String>>,
    /// Derivatives of rates by inputs.
    pub b: Vec<Vec<String>>,
    /// Derivatives of outputs by states.
    pub c: Vec<Vec<String>>,
    /// Derivatives of outputs by inputs.
    pub d: Vec<Vec<String>>,
    /// One for each output and input, outputs first; empty where the matrices vary with the state, or with more than 8
    /// states.
    pub transfer: Vec<TransferFunction>,
    /// Why there is none.
    pub note: Option<String>,
}

/// A transfer function, a quotient of polynomials in `s`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TransferFunction {
    /// Name of the output.
    pub output: String,
    /// Name of the input.
    pub input: String,
    /// Coefficients above the bar, highest power first.
    pub numerator: Vec<String>,
    /// Coefficients below the bar, highest power first.
    pub denominator: Vec<String>,
    /// The coefficients in numbers, at the given parameters.
    pub numerator_values: Vec<f64>,
    /// The same below the bar.
    pub denominator_values: Vec<f64>,
    /// In Unicode.
    pub text: String,
    /// In LaTeX.
    pub latex: String,
}

type Matrix = Vec<Vec<Expr>>;

/// Derives them from the steps of the minimal form.
pub(super) fn matrices(equations: Equations, inputs: &[String], outputs: &[String]) -> Result<SymbolicReport, Problem> {
    let refused = |reason: &str| Problem::NoMatrices { reason: format!("no symbolic matrices: {reason}") };
    if equations.states.len() > STATES || equations.steps.len() > STEPS {
        return Err(refused("the model is too large for that"));
    }
    if !equations.implicit.is_empty() {
        return Err(refused("a law is solved by iteration"));
    }
    let mut equations = equations;
    let mut x = std::mem::take(&mut equations.graph.exprs);
    let known = expansions(&mut x, &equations).ok_or_else(|| refused("a block of equations is too large for that"))?;
    let states: Vec<Symbol> = equations.states.iter().map(|s| s.symbol).collect();
    let of = |name: &String| equations.graph.inputs.values().find(|i| i.name == *name).map(|i| i.symbol);
    let forces: Vec<Symbol> = inputs.iter().filter_map(of).collect();
    let value = |name: &String| equations.observed.iter().find(|o| *o.name == **name)?.value.clone().ok();
    let seen: Vec<Expr> = outputs.iter().filter_map(value).collect();
    let rates: Vec<Expr> = equations.states.iter().map(|s| known.get(&s.rate).copied().unwrap_or(ZERO)).collect();
    let seen: Vec<Expr> = seen.into_iter().map(|e| x.substitute(e, &known)).collect();
    let mut slopes = |of: &[Expr], by: &[Symbol]| -> Matrix {
        let mut entry = |e: Expr, s: Symbol| {
            let slope = x.derivative(e, s);
            tidy(&mut x, slope)
        };
        of.iter().map(|&e| by.iter().map(|&s| entry(e, s)).collect()).collect()
    };
    let (a, b) = (slopes(&rates, &states), slopes(&rates, &forces));
    let (c, d) = (slopes(&seen, &states), slopes(&seen, &forces));
    let text = |m: &Matrix| m.iter().map(|row| row.iter().map(|&e| ascii(&x, e, &PlainNames(&x))).collect()).collect();
    let mut report =
        SymbolicReport { a: text(&a), b: text(&b), c: text(&c), d: text(&d), transfer: Vec::new(), note: None };
    let varies = [&a, &b, &c, &d].into_iter().flatten().flatten().any(|&e| x.given_value(e).is_none());
    if varies {
        report.note = Some("the matrices vary with the state or with time: there is no transfer function".into());
    } else if states.len() > MODEST {
        report.note = Some(format!("transfer functions are told for up to {MODEST} states"));
    } else {
        report.transfer = transfer_functions(&mut x, [&a, &b, &c, &d], (inputs, outputs));
    }
    Ok(report)
}

/// Every symbol that the steps define, in states, inputs, time and parameters. `None` if a block cannot be solved so.
fn expansions(x: &mut Exprs, equations: &Equations) -> Option<BTreeMap<Symbol, Expr>> {
    let mut known: BTreeMap<Symbol, Expr> = BTreeMap::new();
    for step in &equations.steps {
        match step {
            EquationStep::Assign { symbol, value } => {
                let value = x.substitute(*value, &known);
                known.insert(*symbol, value);
            }
            EquationStep::Linear(block) => {
                let LinearBlock { unknowns, matrix, right, .. } = &**block;
                if unknowns.len() > BLOCK {
                    return None;
                }
                let n = unknowns.len();
                let mut rows = Vec::with_capacity(n);
                for (row, &right) in matrix.rows().zip(right) {
                    let mut entries: Vec<(usize, Expr)> = Vec::new();
                    for (column, &e) in row {
                        let e = x.substitute(e, &known);
                        if e != ZERO {
                            entries.push((column, e));
                        }
                    }
                    let right = x.substitute(right, &known);
                    let right = x.neg(right);
                    if right != ZERO {
                        entries.push((n, right));
                    }
                    rows.push(SparseRow(entries));
                }
                let done = eliminate(x, rows, &[(0..n).collect()]);
                if done.pivots.len() < n {
                    return None;
                }
                let mut back = back_substitute(&done);
                for (column, &symbol) in unknowns.iter().enumerate() {
                    let row = back.express(x, column);
                    let value = row.0.iter().find(|entry| entry.0 == n).map_or(ZERO, |entry| entry.1);
                    known.insert(symbol, value);
                }
            }
            EquationStep::Newton(_) => return None,
            EquationStep::Guard { .. } => {}
        }
    }
    Some(known)
}

fn tidy(x: &mut Exprs, e: Expr) -> Expr {
    let e = x.simplify(e);
    x.textbook(e)
}

fn times(x: &mut Exprs, a: &Matrix, b: &Matrix) -> Matrix {
    let columns = b.first().map_or(0, Vec::len);
    let mut product = vec![vec![ZERO; columns]; a.len()];
    for (i, row) in a.iter().enumerate() {
        for j in 0..columns {
            let terms: Vec<Expr> = row.iter().zip(b).map(|(&e, other)| x.mul(&[e, other[j]])).collect();
            let sum = x.add(&terms);
            product[i][j] = x.simplify(sum);
        }
    }
    product
}

/// By the recursion of Faddeev and Leverrier: coefficients of `det(s - A)` and of `C adj(s - A) B + D det(s - A)`.
fn transfer_functions(
    x: &mut Exprs,
    [a, b, c, d]: [&Matrix; 4],
    names: (&[String], &[String]),
) -> Vec<TransferFunction> {
    let (inputs, outputs) = names;
    let n = a.len();
    let mut below = vec![ONE];
    let mut above: Vec<Matrix> = Vec::with_capacity(n);
    let mut adjoint: Matrix = (0..n).map(|i| (0..n).map(|j| if i == j { ONE } else { ZERO }).collect()).collect();
    for k in 1..=n {
        let seen = times(x, c, &adjoint);
        above.push(times(x, &seen, b));
        let moved = times(x, a, &adjoint);
        let diagonal: Vec<Expr> = (0..n).map(|i| moved[i][i]).collect();
        let trace = x.add(&diagonal);
        let share = x.ratio(-1, k as i64);
        let coefficient = x.mul(&[share, trace]);
        let coefficient = x.simplify(coefficient);
        below.push(coefficient);
        adjoint = moved;
        for (i, row) in adjoint.iter_mut().enumerate() {
            let sum = x.add(&[row[i], coefficient]);
            row[i] = x.simplify(sum);
        }
    }
    let mut found = Vec::new();
    for (i, output) in outputs.iter().enumerate() {
        for (j, input) in inputs.iter().enumerate() {
            // Highest power first: feedthrough times the denominator, and the rest one power lower.
            let mut numerator: Vec<Expr> = below.iter().map(|&e| x.mul(&[d[i][j], e])).collect();
            for (k, m) in above.iter().enumerate() {
                numerator[k + 1] = x.add(&[numerator[k + 1], m[i][j]]);
            }
            found.push(quotient(x, output, input, numerator, below.clone()));
        }
    }
    found
}

fn quotient(x: &mut Exprs, output: &str, input: &str, above: Vec<Expr>, below: Vec<Expr>) -> TransferFunction {
    let (above, below) = without_fractions(x, above, below);
    let lead = above.iter().position(|&e| e != ZERO).unwrap_or(above.len().saturating_sub(1));
    let above = above[lead..].to_vec();
    let pool: &Exprs = x;
    let coefficients = |list: &[Expr]| list.iter().map(|&e| ascii(pool, e, &PlainNames(pool))).collect();
    let values = |list: &[Expr]| list.iter().map(|&e| pool.given_value(e).unwrap_or(f64::NAN)).collect();
    let names = PlainNames(pool);
    let plain = |list: &[Expr]| polynomial(list, &|e| unicode(pool, e, &names), &|p| power(p));
    let set = |list: &[Expr]| {
        polynomial(list, &|e| latex(pool, e, &names), &|p| if p == 1 { "s".into() } else { format!("s^{{{p}}}") })
    };
    TransferFunction {
        output: output.to_string(),
        input: input.to_string(),
        numerator: coefficients(&above),
        denominator: coefficients(&below),
        numerator_values: values(&above),
        denominator_values: values(&below),
        text: format!("({}) / ({})", plain(&above), plain(&below)),
        latex: format!("\\frac{{{}}}{{{}}}", set(&above), set(&below)),
    }
}

/// Both multiplied by what their coefficients have below the bar.
fn without_fractions(x: &mut Exprs, above: Vec<Expr>, below: Vec<Expr>) -> (Vec<Expr>, Vec<Expr>) {
    let mut factor = ONE;
    for &e in above.iter().chain(&below) {
        let raised = x.mul(&[e, factor]);
        let raised = x.simplify(raised);
        let left = x.denominator(raised);
        factor = x.mul(&[factor, left]);
    }
    let mut multiply = |list: Vec<Expr>| -> Vec<Expr> {
        let raised = |e: Expr, x: &mut Exprs| {
            let product = x.mul(&[e, factor]);
            let product = x.simplify(product);
            x.textbook(product)
        };
        list.into_iter().map(|e| raised(e, x)).collect()
    };
    (multiply(above), multiply(below))
}

/// `m s² + b s + k`, highest power first.
fn polynomial(list: &[Expr], text: &dyn Fn(Expr) -> String, power: &dyn Fn(usize) -> String) -> String {
    let mut out = String::new();
    for (i, &e) in list.iter().enumerate().filter(|(_, e)| **e != ZERO) {
        let degree = list.len() - 1 - i;
        let coefficient = text(e);
        let sum = coefficient.contains(" + ") || coefficient.contains(" - ");
        let term = match (degree, coefficient.as_str()) {
            (0, _) => coefficient.clone(),
            (_, "1") => power(degree),
            _ if sum => format!("({coefficient}) {}", power(degree)),
            _ => format!("{coefficient} {}", power(degree)),
        };
        let term = match (out.is_empty(), term.strip_prefix('-')) {
            (true, _) => term,
            (false, Some(rest)) if degree > 0 || !sum => format!(" - {rest}"),
            (false, _) => format!(" + {term}"),
        };
        out += &term;
    }
    if out.is_empty() { "0".into() } else { out }
}

fn power(degree: usize) -> String {
    const RAISED: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    match degree {
        1 => "s".into(),
        _ => format!("s{}", degree.to_string().bytes().map(|d| RAISED[usize::from(d - b'0')]).collect::<String>()),
    }
}
