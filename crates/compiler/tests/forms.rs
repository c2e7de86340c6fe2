//! The formulations of the worked examples: the equations of the paper up to arrangement, counts and indices.

use crate::support;

use std::collections::BTreeMap;

use halfarrow_compiler::algebra::{Expr, Exprs, Facts, SparseRow, Symbol, eliminate};
use halfarrow_compiler::bond_graph::{BondId, ElementId, Kind};
use halfarrow_compiler::equations::{EquationStep, Equations, Form, derive_equations};
use halfarrow_compiler::ids::Id;
use halfarrow_compiler::textbook::show;
use serde_json::Value;
use support::formula::formula;
use support::paper::{causal_graph, example, strokes};

/// The equations of the paper, corrected where they are misprinted.
fn papers() -> Vec<Value> {
    serde_json::from_str(include_str!("data/paper_equations.json")).expect("the data is valid")
}

fn text(value: &Value) -> &str {
    value.as_str().expect("a text")
}

fn derived(paper: &Value, form: Form) -> Equations {
    let example = example(text(&paper["name"]));
    let causal = causal_graph(&example, strokes(&example));
    derive_equations(&causal, form).unwrap_or_else(|faults| panic!("{}: {faults:?}", paper["name"]))
}

/// What the words of the paper mean: states, their rates, break variables.
fn dictionary(
    paper: &Value,
    equations: &Equations,
    known: &BTreeMap<Symbol, Expr>,
    x: &mut Exprs,
) -> BTreeMap<Symbol, Expr> {
    let graph = &equations.graph;
    let mut meaning = BTreeMap::new();
    let mut add = |x: &mut Exprs, word: &str, value: Expr| {
        let word = x.find_symbol(word).unwrap_or_else(|| x.symbol(word, Facts::default()));
        meaning.insert(word, value);
    };
    let rate_of = |symbol: Symbol| equations.states.iter().find(|s| s.symbol == symbol).map(|s| s.rate);
    for (word, element) in paper["states"].as_object().expect("states") {
        let (id, element) = graph.elements.iter().find(|(_, e)| e.name == text(element)).expect("an element");
        let bond = &graph.bonds[element.ports[0].bond];
        let (state, effort) = match &element.kind {
            Kind::Inertance(_) => (bond.flow, bond.effort),
            Kind::Compliance(storage) => (storage.stored[0], bond.flow),
            _ => panic!("no storage"),
        };
        let value = x.sym(state);
        add(x, word, value);
        // A dependent storage has no rate of its own; its bond has: p' = m v', q'.
        let rate = match rate_of(state) {
            Some(rate) => x.sym(rate),
            None => rate_by_bond(graph.elements[id].kind.clone(), effort, x, paper, id),
        };
        add(x, &format!("d{word}"), rate);
    }
    for (word, variable) in paper["break_variables"].as_object().expect("break variables") {
        let (kind, number) = text(variable).split_once('_').expect("a bond variable");
        let bond = &graph.bonds[BondId::new(number.parse::<usize>().expect("a number") - 1)];
        let symbol = if kind == "e" { bond.effort } else { bond.flow };
        let value = x.sym(symbol);
        add(x, word, known.get(&symbol).copied().unwrap_or(value));
    }
    if let Some(signal) = graph.signals.values().next() {
        let angle = x.sym(signal.symbol);
        let (sin, cos) = (formula("sin(phi)", x), formula("cos(phi)", x));
        let rate = x.sym(rate_of(signal.symbol).expect("the angle is integrated"));
        for (word, value) in [("s", sin), ("c", cos), ("dphi", rate), ("phi", angle)] {
            add(x, word, value);
        }
    }
    meaning
}

fn rate_by_bond(kind: Kind, carried: Symbol, x: &mut Exprs, paper: &Value, id: ElementId) -> Expr {
    let carried = x.sym(carried);
    match kind {
        Kind::Inertance(_) => {
            let example = example(text(&paper["name"]));
            let mass = formula(text(&example["elements"][id.index()]["parameter"]), x);
            x.div(carried, mass)
        }
        _ => carried,
    }
}

/// Everything that steps define, put in.
fn put_in(equations: &Equations, x: &mut Exprs) -> BTreeMap<Symbol, Expr> {
    let mut known = BTreeMap::new();
    for step in &equations.steps {
        match step {
            EquationStep::Assign { symbol, value } => {
                let value = x.substitute(*value, &known);
                known.insert(*symbol, value);
            }
            EquationStep::Guard { .. } => {}
            _ => panic!("the examples have no blocks left: {step:?}"),
        }
    }
    known
}

/// The rows of equations in rates, algebraic unknowns, states and sources, over parameters and angles.
struct Rows {
    columns: Vec<Symbol>,
    one: usize,
}

impl Rows {
    fn of(equations: &Equations) -> Rows {
        let mut columns: Vec<Symbol> = equations.states.iter().map(|s| s.rate).collect();
        columns.extend(equations.algebraic.iter().map(|a| a.symbol));
        let storages =
            equations.states.iter().filter(|s| equations.graph.signals.values().all(|g| g.symbol != s.symbol));
        columns.extend(storages.map(|s| s.symbol));
        columns.extend(equations.graph.inputs.values().map(|i| i.symbol));
        Rows { one: columns.len(), columns }
    }

    fn row(&self, x: &mut Exprs, zero: Expr) -> SparseRow {
        let zero = x.simplify(zero);
        let (coefficients, rest) = x.linear_in(zero, &self.columns).expect("a linear equation");
        let mut row: Vec<(usize, Expr)> = Vec::new();
        for (column, e) in coefficients.into_iter().chain([rest]).enumerate() {
            let e = x.simplify(e);
            if !x.is_zero(e) {
                row.push((column, e));
            }
        }
        SparseRow(row)
    }

    fn rank(&self, x: &mut Exprs, rows: &[SparseRow]) -> usize {
        eliminate(x, rows.to_vec(), &[(0..=self.one).collect()]).pivots.len()
    }
}

/// Parameters without given values: what vanishes, vanishes for all of them.
fn generic(equations: &Equations, x: &mut Exprs) -> BTreeMap<Symbol, Expr> {
    let facts = Facts { nonzero: true, positive: true, given: None };
    let mut free = BTreeMap::new();
    for parameter in equations.graph.parameters.values() {
        let symbol = x.symbol(&format!("any {}", parameter.name), facts);
        free.insert(parameter.symbol, x.sym(symbol));
    }
    free
}

/// The equations of a form say what those of the paper say, and nothing else.
fn assert_same(paper: &Value, equations: &Equations, key: &str) {
    let what = format!("{} {key}", text(&paper["name"]));
    let mut x = equations.graph.exprs.clone();
    let (known, generic) = (put_in(equations, &mut x), generic(equations, &mut x));
    let meaning = dictionary(paper, equations, &known, &mut x);
    let rows = Rows::of(equations);
    let free: Vec<Symbol> = equations.states.iter().map(|s| s.rate).filter(|r| !known.contains_key(r)).collect();
    let mut ours = Vec::new();
    let add = |x: &mut Exprs, zero: Expr, list: &mut Vec<SparseRow>| {
        let zero = x.substitute(zero, &generic);
        list.push(rows.row(x, zero));
    };
    for state in equations.states.iter().filter(|s| !free.contains(&s.rate)) {
        let (rate, value) = (x.sym(state.rate), known[&state.rate]);
        let zero = x.sub(rate, value);
        add(&mut x, zero, &mut ours);
    }
    for &residual in &equations.residuals {
        let zero = x.substitute(residual, &known);
        add(&mut x, zero, &mut ours);
    }
    // The rates of the paper are unknowns; all else that is defined is put in.
    let rates: Vec<Symbol> = equations.states.iter().map(|s| s.rate).collect();
    let inner: BTreeMap<Symbol, Expr> =
        known.iter().filter(|(s, _)| !rates.contains(s)).map(|(&s, &e)| (s, e)).collect();
    let mut theirs = Vec::new();
    for line in paper[key].as_array().expect("equations") {
        let (left, right) = text(line).split_once('=').expect("an equation");
        let (left, right) = (formula(left, &mut x), formula(right, &mut x));
        let zero = x.sub(left, right);
        let zero = x.substitute(zero, &meaning);
        let zero = x.substitute(zero, &inner);
        add(&mut x, zero, &mut theirs);
    }
    let both: Vec<SparseRow> = ours.iter().chain(&theirs).cloned().collect();
    let ranks = (rows.rank(&mut x, &ours), rows.rank(&mut x, &theirs), rows.rank(&mut x, &both));
    assert_eq!(ranks, (ours.len(), ours.len(), ours.len()), "{what}\n{}", show(equations.clone()));
}

fn counts(equations: &Equations) -> (u64, u64) {
    (equations.counts.differential as u64, equations.counts.algebraic as u64)
}

fn asked(paper: &Value, key: &str) -> (u64, u64) {
    let counts = &paper["counts"][key];
    (counts["differential"].as_u64().expect("a number"), counts["algebraic"].as_u64().expect("a number"))
}

#[test]
fn the_classical_form_is_that_of_the_paper() {
    for paper in papers() {
        let equations = derived(&paper, Form::Break);
        assert_same(&paper, &equations, "break_variable_form");
        assert_eq!(counts(&equations), asked(&paper, "break_variable_form"), "{}", paper["name"]);
        assert_eq!(
            u64::from(equations.index),
            paper["index"]["break_variable_form"].as_u64().unwrap(),
            "{}",
            paper["name"]
        );
        assert_eq!(equations.breaks.number, equations.breaks.at_least, "{}", paper["name"]);
    }
}

#[test]
fn the_inverted_form_is_that_of_the_paper() {
    for paper in papers() {
        let equations = derived(&paper, Form::Inverted);
        assert_same(&paper, &equations, "reduced");
        assert_eq!(counts(&equations), asked(&paper, "reduced"), "{}", paper["name"]);
        assert_eq!(u64::from(equations.index), paper["index"]["reduced"].as_u64().unwrap(), "{}", paper["name"]);
    }
}

/// From model text, with the causality that the program chooses.
fn of_text(text: &str, form: Form) -> Equations {
    use halfarrow_compiler::bond_graph::NoFiles;
    use halfarrow_compiler::compile::{Text, to_equations};
    let text = Text { name: "model.bond", text, files: &NoFiles, overrides: &[] };
    to_equations(text, form).unwrap_or_else(|found| panic!("{}", found.render(false))).ir
}

const PENDULUM: &str = include_str!("../../../models/pendulum/model.bond");
const RIGID: &str = "model Rigid\nSe:s(1) -> 1:j\nj -> I:a(1)\nj -> I:b(2)\nj -> R:r(3)\n";

#[test]
fn every_constraint_has_its_multiplier() {
    let pendulum = of_text(PENDULUM, Form::Lagrange);
    assert_eq!((counts(&pendulum), pendulum.index), ((3, 2), 2));
    let names: Vec<&str> = pendulum.algebraic.iter().map(|a| a.name.as_str()).collect();
    assert_eq!(names, ["ZCx.e", "ZCy.e"]);
    assert_eq!(pendulum.indices, [1, 1, 1, 1, 2, 2]);
    let rigid = of_text(RIGID, Form::Lagrange);
    assert_eq!((counts(&rigid), rigid.index), ((2, 1), 2));
}

#[test]
fn stiff_forms_are_explicit_with_a_spring_for_each_constraint() {
    for (text, springs) in [(PENDULUM, 2), (RIGID, 1)] {
        let (rigid, stiff) = (of_text(text, Form::Lagrange), of_text(text, Form::Stiff));
        assert_eq!(stiff.states.len(), rigid.states.len() + springs);
        assert!(stiff.residuals.is_empty() && stiff.index == 0);
    }
}

#[test]
fn speeds_alone_are_the_states_of_kane() {
    let kane = of_text(PENDULUM, Form::Kane);
    let names: Vec<&str> = kane.states.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(names, ["IJ.f", "phi"]);
    assert_eq!((counts(&kane), kane.index), ((1, 0), 0));
}

#[test]
fn the_rank_of_the_state_matrix_is_read_from_derivative_causality() {
    use halfarrow_compiler::bond_graph::NoFiles;
    use halfarrow_compiler::causal_graph::state_rank;
    use halfarrow_compiler::compile::{Text, to_causal_graph};
    let rank = |text: &str| {
        let text = Text { name: "model.bond", text, files: &NoFiles, overrides: &[] };
        let causal = to_causal_graph(text).unwrap_or_else(|found| panic!("{}", found.render(false))).ir;
        state_rank(&causal).map(|found| (found.order, found.rank))
    };
    // A mass with a damper comes to rest only where nothing pulls; one with a spring always does.
    assert_eq!(rank("model A\nSe:s(1) -> 1:j\nj -> I:m(1)\nj -> C:c(k = 1)\n"), Some((2, 2)));
    assert_eq!(rank("model B\nSe:s(1) -> 1:j\nj -> I:m(1)\nj -> R:r(1)\n"), Some((1, 1)));
    assert_eq!(rank("model C\nSe:s(1) -> 1:j\nj -> I:m(1)\n"), Some((1, 0)));
    assert_eq!(rank("model D\nSe:s(1) -> 1:j\nj -> C:a(k = 1)\nj -> C:b(k = 2)\nj -> R:r(3)\n"), Some((2, 1)));
    assert_eq!(rank(RIGID), Some((1, 1)));
    assert_eq!(rank("model E\nSe:s(1) -> 1:j\nj -> I:m(1)\nj -> R:r(e = f^3)\n"), None);
}

#[test]
fn an_inversion_says_what_it_opens_and_what_it_cannot() {
    for paper in papers() {
        let equations = derived(&paper, Form::Inverted);
        let certificate = equations.certificate.clone().expect("the inverted form has one");
        let example = example(text(&paper["name"]));
        let breaks = example["breaks"]["paper_method"].as_u64().expect("a number");
        assert_eq!(certificate.left.len() as u64, breaks, "{}", paper["name"]);
        assert!(certificate.inverted.iter().all(|o| !o.paths.is_empty()), "{}: {certificate:?}", paper["name"]);
        // Where a break variable is left the causality of resistors alone can come as far.
        let storage = breaks == 0 && paper["name"] != "pendulum";
        assert!(!storage || !certificate.inverted.is_empty(), "{}", paper["name"]);
    }
}

#[test]
fn an_inversion_tells_its_reasons_apart() {
    use halfarrow_compiler::causal_paths::Refusal;
    let refusals = |text: &str| -> Vec<(String, Refusal)> {
        let equations = of_text(text, Form::Inverted);
        let certificate = equations.certificate.clone().expect("the inverted form has one");
        let name = |port: halfarrow_compiler::bond_graph::PortRef| equations.graph.elements[port.element].name.clone();
        certificate.refused.iter().map(|&(port, why)| (name(port), why)).collect()
    };
    for (text, wanted) in [(UNINVERTIBLE, "law"), (RATE_IN_MODULUS, "modulus"), (SINGULAR_RING, "determinant")] {
        let found = refusals(text);
        let right = found.iter().any(|(_, why)| match wanted {
            "law" => matches!(why, Refusal::LawNotInvertible(_)),
            "determinant" => matches!(why, Refusal::DeterminantZero),
            _ => matches!(why, Refusal::ModulusOfRate(_)),
        });
        assert!(right, "{wanted}: {found:?}");
    }
}

/// Three resistors in two loops, one inertance: it opens one loop at most, and all resistors have laws in one direction.
const UNINVERTIBLE: &str = "model U
Sf:s(1) -> 0:a
a -> R:r1(e = f + f^3 + sin(f))
a -> 1:b
b -> R:r2(e = f + f^5)
b -> 0:c
c -> R:r3(e = f + f^3)
c -> 1:d
d -> R:r4(e = 2*f + f^3)
d -> I:m(1)
";

/// The modulus of a transformer on the loop reads the inertance that would open it.
const RATE_IN_MODULUS: &str = "model M
Sf:s(1) -> 0:a
a -> R:r1(2)
a -> TF:t(2 + m.f)
t -> 1:b
b -> R:r2(3)
b -> 0:c
c -> R:r3(4)
c -> 1:d
d -> R:r4(5)
d -> I:m(1)
";

/// A ring of two 0-junctions and one 1-junction: with the inertance turned its loops alone have no unique solution.
const SINGULAR_RING: &str = "model S
0:a
0:b
1:c
a -> b
b -> c
c -> a
a -> R:r1(3)
b -> R:r2(3)
c -> I:m(3)
Sf:s(1) -> a
";
