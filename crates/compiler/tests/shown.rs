//! What is shown is what is computed, and is set without fault.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use halfarrow_compiler::algebra::{Expr, Exprs, Symbol};
use halfarrow_compiler::bond_graph::{Meaning, NoFiles};
use halfarrow_compiler::compile::{Text, to_equations};
use halfarrow_compiler::equations::{EquationStep, Equations, Form, LinearBlock, NewtonBlock};
use halfarrow_compiler::textbook::{Shown, Style, only, print, print_dependent, print_meanings, show};

fn models() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models");
    let entries = std::fs::read_dir(folder).expect("the models").map(|e| e.expect("an entry").path());
    let mut models: Vec<PathBuf> = entries.filter(|p| p.join("model.bond").exists()).collect();
    models.sort();
    models
}

fn shown(folder: &Path) -> Shown {
    let text = std::fs::read_to_string(folder.join("model.bond")).expect("a model");
    shown_of(&text)
}

fn shown_of(text: &str) -> Shown {
    let text = Text { name: "model.bond", text, files: &NoFiles, overrides: &[] };
    show(to_equations(text, Form::Minimal).expect("no fault").ir)
}

/// Values of all symbols somewhere in the space of states.
fn values(equations: &Equations, (first, step): (f64, f64)) -> BTreeMap<Symbol, f64> {
    let x = &equations.graph.exprs;
    let mut known = BTreeMap::new();
    let mut next = 0.2;
    for (&symbol, variable) in &equations.graph.variables {
        if let Meaning::Parameter(_) = variable.meaning {
            let e = x.facts(symbol).given.expect("the value of a parameter");
            known.insert(symbol, x.given_value(e).expect("a number"));
        } else {
            next += 0.07;
            known.insert(symbol, next);
        }
    }
    for (i, symbol) in
        equations.conserved.iter().map(|c| c.symbol).chain(equations.states.iter().map(|s| s.symbol)).enumerate()
    {
        known.insert(symbol, first + step * i as f64);
    }
    for step in &equations.steps {
        match step {
            EquationStep::Assign { symbol, value } => {
                let value = at(x, *value, &known);
                known.insert(*symbol, value);
            }
            EquationStep::Linear(block) => {
                let LinearBlock { unknowns, matrix, right, .. } = &**block;
                let (full, right) = (matrix.map(|&e| at(x, e, &known)).dense(0.0), right.iter());
                let row = |(row, &r): (&[f64], &Expr)| [row, &[at(x, r, &known)]].concat();
                let solution = solved(full.chunks(unknowns.len()).zip(right).map(row).collect());
                known.extend(unknowns.iter().copied().zip(solution));
            }
            // What is shown holds for any value of what stays implicit.
            EquationStep::Newton(block) => {
                let NewtonBlock { unknowns, body, .. } = &**block;
                known.extend(unknowns.iter().enumerate().map(|(i, &u)| (u, 0.17 + 0.31 * i as f64)));
                for &(symbol, value) in body {
                    let value = at(x, value, &known);
                    known.insert(symbol, value);
                }
            }
            EquationStep::Guard { .. } => {}
        }
    }
    known
}

fn at(x: &Exprs, e: Expr, known: &BTreeMap<Symbol, f64>) -> f64 {
    x.eval(e, &mut |s| known.get(&s).copied().unwrap_or(f64::NAN))
}

/// The solution of linear equations, each with its right-hand side at the end.
fn solved(mut rows: Vec<Vec<f64>>) -> Vec<f64> {
    let n = rows.len();
    for k in 0..n {
        let pivot = (k..n).max_by(|&a, &b| rows[a][k].abs().total_cmp(&rows[b][k].abs())).expect("a row");
        rows.swap(k, pivot);
        let top = rows[k].clone();
        for (i, row) in rows.iter_mut().enumerate().filter(|(i, _)| *i != k) {
            let _ = i;
            let factor = row[k] / top[k];
            row.iter_mut().zip(&top).for_each(|(e, t)| *e -= factor * t);
        }
    }
    (0..n).map(|k| rows[k][n] / rows[k][k]).collect()
}

#[test]
fn what_is_shown_is_what_is_computed() {
    for folder in models() {
        let shown = shown(&folder);
        assert!(shown.definitions.is_empty(), "{}: it fits a page", folder.display());
        is_computed(&shown, &folder, (3.1e-4, 5e-5));
    }
}

/// Models that do not fit the page of a textbook: parts have names, which are worth what they stand for. The pool of
/// expressions tells how much was tried on the way.
#[test]
fn names_are_worth_what_they_stand_for() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../halfarrow/tests/faults");
    for name in ["squeezer", "two_four_bars", "beam_relative", "beam_absolute", "wishbone"] {
        let path = folder.join(format!("{name}.bond"));
        let shown = shown_of(&std::fs::read_to_string(&path).expect("a model"));
        assert!(!shown.definitions.is_empty(), "{name}");
        assert!(shown.equations.graph.exprs.len() < 80_000, "{name}: {:?}", shown.equations.graph.exprs);
        is_computed(&shown, &path, (0.31, 0.17));
        let lines = [print(&shown, Style::Latex), print_meanings(&shown, Style::Latex)];
        lines.concat().iter().for_each(|line| assert!(well_set(line), "{name}: {line}"));
    }
}

/// `states`: the value of the first, and how far they are apart.
fn is_computed(shown: &Shown, of: &Path, states: (f64, f64)) {
    let x = &shown.equations.graph.exprs;
    let mut known = values(&shown.equations, states);
    for &(symbol, value) in &shown.sources {
        let value = at(x, value, &known);
        known.entry(symbol).or_insert(value);
    }
    let same = |a: Expr, b: Expr, known: &BTreeMap<Symbol, f64>| {
        let (a, b) = (at(x, a, known), at(x, b, known));
        assert!((a - b).abs() <= 1e-9 * (a.abs() + b.abs() + 1e-6), "{}: {a} for {b}", of.display());
    };
    for definition in &shown.definitions {
        let value = at(x, definition.value, &known);
        let own = *known.entry(definition.symbol).or_insert(value);
        assert!((own - value).abs() <= 1e-9 * (own.abs() + 1e-6), "{}: {}", of.display(), x.name(definition.symbol));
        same(definition.value, definition.closed, &known);
    }
    for equation in shown.display.iter().take(shown.equations.states.len()) {
        same(equation.left, equation.right, &known);
        same(equation.closed.0, equation.closed.1, &known);
    }
    for row in &shown.dependent {
        let variable = known[&row.variable];
        let value = at(x, row.value, &known);
        assert!((variable - value).abs() <= 1e-9 * (value.abs() + 1e-6), "{}", of.display());
    }
}

/// Every bracket is closed, `\left` has its `\right`, and nothing stands in it that TeX does not know.
fn well_set(line: &str) -> bool {
    let count = |what: &str| line.matches(what).count();
    let depth = line.chars().try_fold(0i32, |depth, c| match c {
        '{' => Some(depth + 1),
        '}' => Some(depth - 1).filter(|d| *d >= 0),
        _ => Some(depth),
    });
    depth == Some(0)
        && count("\\left") == count("\\right")
        && line.is_ascii()
        && !line.contains("__")
        && !line.contains("^^")
}

#[test]
fn latex_is_well_set() {
    for folder in models() {
        let shown = shown(&folder);
        let lines =
            [print(&shown, Style::Latex), print_meanings(&shown, Style::Latex), print_dependent(&shown, Style::Latex)];
        for line in lines.concat() {
            assert!(well_set(&line), "{}: {line}", folder.display());
        }
    }
}

fn text(model: &str) -> Vec<String> {
    print(&shown_of(model), Style::Unicode)
}

#[test]
fn weights_stand_before_arms() {
    let text = text(
        "model Bar\nparam J = 1, M = 2, a = 3, g = 9.81\nstate phi' = w.f from 0\n1:w -> I:IJ(J)\n\
         w -> TF:x(-a*sin(phi)) -> I:Iu(M)\nw -> TF:y(a*cos(phi)) -> 1:v -> I:Iv(M)\nSe:weight(-M*g) -> v\n",
    );
    assert_eq!(text, ["(J + M a²) f_IJ' = -M g a cos φ", "φ' = f_IJ"]);
}

#[test]
fn fractions_stand_over_one_denominator() {
    let parallel =
        "model P\nparam R1 = 2, R2 = 3, m = 1\nSf:s(1) -> 0:n -> R:R1(R1)\nn -> R:R2(R2)\nn -> 1:b -> I:I(m)\n";
    assert_eq!(text(parallel), ["m f_I' = R1 R2 (1 - f_I)/(R1 + R2)"]);
}

#[test]
fn strands_that_are_alike_are_one_equation_of_vectors() {
    let ball = |mass: &str, rest: &str| {
        format!(
            "model Ball\nparam b = 0.3\n1[3]:v -> I[3]:m({mass}, f0 = [10, 0, 12])\nv -> R[3]:drag(b)\n\
             Se[3]:gravity([0, 0, -19.62]) -> v\nv -> C[3]:rope(k = 5)\n{rest}"
        )
    };
    let whole = ["2 f_m' = -b f_m - 5 q_rope + [0, 0, -19.62]", "q_rope' = f_m"];
    let alike = shown_of(&ball("2", ""));
    assert_eq!(print(&alike, Style::Unicode), whole);
    // Programs are given an equation for each state.
    assert_eq!(print(&alike, Style::Ascii).len(), 6);
    assert!(print(&alike, Style::Latex).iter().all(|line| well_set(line)));
    assert_eq!(print(&only(alike, &[]), Style::Unicode), [""; 0]);
    // Another mass in one strand, and another force.
    let text_of = |mass: &str, rest: &str| text(&ball(mass, rest));
    assert_eq!(text_of("diag([2, 2, 3])", ""), [&format!("diag([2, 2, 3]) f_m'{}", &whole[0][6..]), whole[1]]);
    let pushed = "input push = 0\nSe:wind(push) -> v.x\n";
    assert_eq!(text_of("2", pushed)[0], "2 f_m' = -b f_m - 5 q_rope + [push, 0, -19.62]");
    // What has a name of its own keeps it.
    assert_eq!(text_of("2", "output vx = v.x.f : m/s\n")[3], "q_rope.x' = vx");
    // What reads another strand, or a strand otherwise than in proportion, is no vector.
    let across = "v.x -> R:one(e = 2*f*abs(f))\n";
    assert_eq!(text_of("2", across).len(), 4);
}

#[test]
fn strands_that_turn_into_each_other_are_one_equation_of_vectors() {
    let body = |inertia: &str, rest: &str| {
        shown_of(&format!(
            "model Body\nparam m = 2, J1 = 1, J2 = 2, J3 = 3\n1[3]:v -> I[3]:mass(m, f0 = [1, 0, 0])\n\
             1[3]:w -> I[3]:body({inertia}, f0 = [0, 0.1, 1])\nw -> GY[3]:ejs(skew(body.p))\n\
             v -> GY[3]:turn(m*skew(w.f))\nw -> R[3]:drag(0.5)\nSe[3]:push([0, 0, 3]) -> v\n{rest}"
        ))
    };
    // Newton and Euler, along the axes of the body.
    let euler = body("diag([J1, J2, J3])", "");
    let lines = [
        "m f_mass' = -(m f_mass) × f_body + [0, 0, 3]",
        "diag([J1, J2, J3]) f_body' = -f_body/2 + (diag([J1, J2, J3]) f_body) × f_body",
    ];
    assert_eq!(print(&euler, Style::Unicode), lines);
    assert_eq!(print(&euler, Style::Ascii).len(), 6);
    assert!(print(&euler, Style::Latex).iter().all(|line| well_set(line)));
    let full = "[[2, 0.1, 0], [0.1, 1, 0], [0, 0, 3]]";
    let expected = format!("{full} f_body' = -f_body/2 + ({full} f_body) × f_body");
    assert_eq!(print(&body(full, ""), Style::Unicode)[1], expected);
    let latex = &print(&body(full, ""), Style::Latex)[1];
    assert!(
        latex.starts_with(r"\begin{bmatrix} 2 & 0.1 & 0 \\ 0.1 & 1 & 0 \\ 0 & 0 & 3 \end{bmatrix} \, \dot{f}"),
        "{latex}"
    );
    // A lever from the speeds to others: a matrix.
    let lever = "w -> TF[3, 3]:lever([[0, 1, 0], [-1, 0, 0.5], [0, 0, 0.2]]) -> 1[3]:u -> R[3]:r(2)\n";
    let expected = "diag([J1, J2, J3]) f_body' = -[[2.5, 0, -1], [0, 2.5, 0], [-1, 0, 1.08]] f_body \
                    + (diag([J1, J2, J3]) f_body) × f_body";
    assert_eq!(print(&body("diag([J1, J2, J3])", lever), Style::Unicode)[1], expected);
    // A force that one strand makes of another one otherwise: rows stay.
    assert_eq!(print(&body("diag([J1, J2, J3])", "w.x -> R:one(e = 2*f*abs(f))\n"), Style::Unicode).len(), 4);
    // Vectors of more than three strands.
    let wide = text("model Wide\n1[6]:six -> R[6]:mount(3)\nsix -> I[6]:mass(4)\n");
    assert_eq!(wide, ["4 f_mass' = -3 f_mass"]);
}

/// The unknowns of a page: what it names that is neither given, nor a state, nor defined on it.
fn open_symbols(shown: &Shown) -> BTreeSet<Symbol> {
    let equations = &shown.equations;
    let x = &equations.graph.exprs;
    let given = |s: &Symbol| {
        let meaning = equations.graph.variables.get(s).map(|variable| variable.meaning);
        matches!(meaning, Some(Meaning::Time | Meaning::Parameter(_) | Meaning::Input(_) | Meaning::Held(_)))
    };
    let mut told: BTreeSet<Symbol> = equations.states.iter().map(|s| s.symbol).collect();
    told.extend(equations.conserved.iter().map(|c| c.symbol));
    told.extend(shown.definitions.iter().map(|d| d.symbol));
    let sides = shown.display.iter().flat_map(|equation| [equation.closed.0, equation.closed.1]);
    let values = shown.definitions.iter().filter(|d| !d.of_dependent).map(|d| d.closed);
    let read = sides.chain(values).flat_map(|e| x.symbols_of(e));
    read.filter(|s| !told.contains(s) && !given(s)).collect()
}

/// Pendulums on each other, so many that their rates stand in one block with the reactions between them.
fn pendulums(links: usize) -> String {
    let mut text = String::from("model Pendulum\nparam m = 1, l = 1, g = 9.81\n");
    for i in 1..=links {
        text += &format!("1:w{i}\nstate a{i}' = w{i}.f from {i}/10\n1:x{i} -> I:mx{i}(m)\n1:y{i} -> I:my{i}(m)\n");
        text += &format!("Se:G{i}(-m*g) -> y{i}\n");
        for (way, factor) in [("x", "cos"), ("y", "sin")] {
            let hung = if i == 1 { format!("{way}1") } else { format!("j{way}{i}") };
            if i > 1 {
                text += &format!("0:{hung} -> {way}{i}\n{way}{} -> {hung}\n", i - 1);
            }
            text += &format!("w{i} -> TF:c{way}{i}(l*{factor}(a{i})) -> {hung}\n");
        }
    }
    text
}

#[test]
fn a_page_has_as_many_equations_as_unknowns() {
    let mut pages: Vec<(String, Shown)> =
        models().iter().map(|folder| (folder.display().to_string(), shown(folder))).collect();
    pages.push(("40 pendulums".into(), shown_of(&pendulums(40))));
    for (name, shown) in pages {
        let open = open_symbols(&shown);
        let named = || open.iter().map(|&s| shown.equations.graph.exprs.label(s)).collect::<Vec<_>>();
        assert_eq!(shown.display.len(), open.len(), "{name}: unknown are {:?}", named());
    }
}
