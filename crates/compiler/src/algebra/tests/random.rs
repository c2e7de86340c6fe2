//! What is rebuilt keeps its value: random expressions at random points.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use super::super::*;
use proptest::prelude::*;
use std::collections::BTreeMap;

const NAMES: [&str; 5] = ["x", "y", "z", "A", "B"];

/// How to build an expression; the pool builds it.
#[derive(Debug, Clone)]
enum Tree {
    Number(i64, i64),
    Name(usize),
    Sum(Vec<Tree>),
    Product(Vec<Tree>),
    Power(Box<Tree>, i64),
    Root(Box<Tree>),
    Call(Function, Box<Tree>),
    Choice(Box<Tree>, Box<Tree>, Box<Tree>),
}

fn tree() -> impl Strategy<Value = Tree> {
    let leaf = prop_oneof![
        ((-6i64..7), (1i64..4)).prop_map(|(n, d)| Tree::Number(n, d)),
        (0..NAMES.len()).prop_map(Tree::Name),
        (0..NAMES.len()).prop_map(Tree::Name),
    ];
    leaf.prop_recursive(4, 24, 3, |inner| {
        use Function::*;
        let function = prop::sample::select(vec![Sin, Cos, Exp, Tanh, Abs, Sign, Atan, Log, Sinh, Tan]);
        prop_oneof![
            prop::collection::vec(inner.clone(), 2..4).prop_map(Tree::Sum),
            prop::collection::vec(inner.clone(), 2..4).prop_map(Tree::Product),
            (inner.clone(), -2i64..4).prop_map(|(b, n)| Tree::Power(Box::new(b), n)),
            inner.clone().prop_map(|b| Tree::Root(Box::new(b))),
            (function, inner.clone()).prop_map(|(f, a)| Tree::Call(f, Box::new(a))),
            (inner.clone(), inner.clone(), inner).prop_map(|(c, a, b)| Tree::Choice(
                Box::new(c),
                Box::new(a),
                Box::new(b)
            )),
        ]
    })
}

fn build(x: &mut Exprs, tree: &Tree) -> Expr {
    match tree {
        Tree::Number(n, d) => x.ratio(*n, *d),
        Tree::Name(i) => {
            let symbol = super::reader::symbol(x, NAMES[*i]);
            x.sym(symbol)
        }
        Tree::Sum(parts) => {
            let parts: Vec<Expr> = parts.iter().map(|p| build(x, p)).collect();
            x.add(&parts)
        }
        Tree::Product(parts) => {
            let parts: Vec<Expr> = parts.iter().map(|p| build(x, p)).collect();
            x.mul(&parts)
        }
        Tree::Power(base, n) => {
            let base = build(x, base);
            x.powi(base, *n)
        }
        Tree::Root(base) => {
            let base = build(x, base);
            x.sqrt(base)
        }
        Tree::Call(f, a) => {
            let a = build(x, a);
            x.call(*f, &[a])
        }
        Tree::Choice(c, a, b) => {
            let [c, a, b] = [c, a, b].map(|p| build(x, p));
            let c = x.compare(Comparison::Lt, c, a);
            x.select(c, a, b)
        }
    }
}

/// The value as the tree says, without the pool, and a bound on its error (crude, from the sizes on the way).
fn direct(tree: &Tree, at: &dyn Fn(usize) -> f64) -> (f64, f64) {
    const EPS: f64 = 1e-15;
    let rounded = |v: f64, error: f64| (v, error + v.abs() * EPS);
    match tree {
        Tree::Number(n, d) => (*n as f64 / *d as f64, EPS),
        Tree::Name(i) => (at(*i), 0.0),
        Tree::Sum(parts) => {
            let parts: Vec<(f64, f64)> = parts.iter().map(|p| direct(p, at)).collect();
            let size: f64 = parts.iter().map(|p| p.0.abs()).sum();
            let (sum, error) = parts.iter().fold((0.0, 0.0), |s, p| (s.0 + p.0, s.1 + p.1));
            (sum, error + size * EPS)
        }
        Tree::Product(parts) => parts
            .iter()
            .map(|p| direct(p, at))
            .fold((1.0, 0.0), |a, b| rounded(a.0 * b.0, a.0.abs() * b.1 + b.0.abs() * a.1 + a.1 * b.1)),
        Tree::Power(base, n) => {
            let (b, error) = direct(base, at);
            // A power of 0 is 1 only where its base is defined.
            let value = if *n == 0 && !b.is_finite() { f64::NAN } else { b.powi(*n as i32) };
            let slope = (*n as f64 * b.powi(*n as i32 - 1)).abs();
            rounded(value, if *n == 0 { 0.0 } else { near(error, b) * slope })
        }
        Tree::Root(base) => {
            let (b, error) = direct(base, at);
            // At a root of zero the sign of a rounding error decides.
            let value = if b.abs() <= 8.0 * error { f64::NAN } else { b.sqrt() };
            rounded(value, near(error, b) / (2.0 * value))
        }
        Tree::Call(f, a) => {
            let (a, error) = direct(a, at);
            let value = f.value(a, 0.0);
            let slope = match f {
                Function::Exp | Function::Sinh => a.abs().exp(),
                Function::Tan => 1.0 + value * value,
                Function::Log => 1.0 / a,
                Function::Sign if a.abs() <= 8.0 * error => f64::NAN,
                Function::Sign => 0.0,
                _ => 1.0,
            };
            rounded(value, near(error, if *f == Function::Log { a } else { f64::INFINITY }) * slope)
        }
        Tree::Choice(c, a, b) => {
            let (c, a, b) = (direct(c, at), direct(a, at), direct(b, at));
            let error = 8.0 * (c.1 + a.1);
            if c.0.is_nan() || a.0.is_nan() || (c.0 - a.0).abs() <= error {
                return (f64::NAN, 0.0);
            }
            if c.0 < a.0 { a } else { b }
        }
    }
}

fn all(tree: &Tree, wanted: &dyn Fn(&Tree) -> bool) -> bool {
    wanted(tree)
        && match tree {
            Tree::Number(..) | Tree::Name(_) => true,
            Tree::Sum(parts) | Tree::Product(parts) => parts.iter().all(|p| all(p, wanted)),
            Tree::Power(a, _) | Tree::Root(a) | Tree::Call(_, a) => all(a, wanted),
            Tree::Choice(c, a, b) => [c, a, b].into_iter().all(|p| all(p, wanted)),
        }
}

fn smooth(tree: &Tree) -> bool {
    all(tree, &|t| !matches!(t, Tree::Choice(..) | Tree::Root(_) | Tree::Call(Function::Abs | Function::Sign, _)))
}

fn rational(tree: &Tree) -> bool {
    all(tree, &|t| match t {
        Tree::Number(_, d) => *d < 3,
        Tree::Name(_) | Tree::Sum(_) | Tree::Product(_) | Tree::Power(..) => true,
        Tree::Root(_) | Tree::Call(..) | Tree::Choice(..) => false,
    })
}

/// The error, unless it is as large as the value: then nothing is known.
fn near(error: f64, value: f64) -> f64 {
    if error < value.abs() * 1e-3 { 2.0 * error } else { f64::NAN }
}

fn agrees(a: f64, (b, error): (f64, f64)) -> bool {
    let doubtful = !b.is_finite() || !error.is_finite() || b.abs() > 1e12;
    doubtful || (a - b).abs() <= 1e3 * error + 1e-12 * b.abs()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]

    #[test]
    fn forms_have_one_value(tree in tree(), point in prop::array::uniform5(0.2f64..1.9), signs in prop::array::uniform3(any::<bool>())) {
        let mut x = Exprs::default();
        let e = build(&mut x, &tree);
        let value = |i: usize| if i < 3 && signs[i] { -point[i] } else { point[i] };
        let reference = direct(&tree, &value);
        let at = |x: &Exprs, e: Expr| {
            x.eval(e, &mut |s| value(NAMES.iter().position(|n| *n == x.name(s)).unwrap()))
        };
        let built = at(&x, e);
        prop_assert!(agrees(built, reference), "{}: {built} for {reference:?}", ascii(&x, e, &PlainNames(&x)));
        let short = x.simplify(e);
        prop_assert!(agrees(at(&x, short), reference), "{} to {}", ascii(&x, e, &PlainNames(&x)), ascii(&x, short, &PlainNames(&x)));
        prop_assert!(x.written_length(short) <= x.written_length(e).max(600));
        let long = x.expand(e);
        prop_assert!(agrees(at(&x, long), reference));
        let printed = x.textbook(e);
        prop_assert!(agrees(at(&x, printed), reference), "{} to {}", ascii(&x, e, &PlainNames(&x)), ascii(&x, printed, &PlainNames(&x)));
        prop_assert!(x.printed_length(printed) <= x.printed_length(e));
    }

    #[test]
    fn forms_differ_by_zero(tree in tree().prop_filter("smooth", smooth)) {
        let mut x = Exprs::default();
        let e = build(&mut x, &tree);
        let short = x.simplify(e);
        let difference = x.sub(e, short);
        prop_assert!(x.is_zero(difference) || !x.total(e), "{} and {}", ascii(&x, e, &PlainNames(&x)), ascii(&x, short, &PlainNames(&x)));
        let y = super::reader::read(&mut x, "y/1000003");
        let off = x.add(&[difference, y]);
        prop_assert!(!x.is_zero(off));
    }

    #[test]
    fn the_domain_stays(tree in tree().prop_filter("rational", rational), point in prop::array::uniform3(-1i8..3)) {
        let mut x = Exprs::default();
        let e = build(&mut x, &tree);
        let value = |i: usize| if i < 3 { f64::from(point[i]) } else { 1.0 };
        let reference = direct(&tree, &value).0;
        for form in [e, x.simplify(e), x.expand(e), x.textbook(e)] {
            let own = x.eval(form, &mut |s| value(NAMES.iter().position(|n| *n == x.name(s)).unwrap()));
            prop_assert!(reference.is_finite() || !own.is_finite(), "{} is {own}", ascii(&x, form, &PlainNames(&x)));
            prop_assert!(own.is_finite() || !reference.is_finite(), "{} is {own}", ascii(&x, form, &PlainNames(&x)));
        }
    }

    #[test]
    fn substitution_is_evaluation(tree in tree(), inner in tree(), point in prop::array::uniform5(0.2f64..1.9)) {
        let mut x = Exprs::default();
        let (e, inner_e) = (build(&mut x, &tree), build(&mut x, &inner));
        let symbol = super::reader::symbol(&mut x, "x");
        let replaced = x.substitute(e, &BTreeMap::from([(symbol, inner_e)]));
        let inside = direct(&inner, &|i| point[i]);
        prop_assume!(inside.0.is_finite() && inside.1 < 1e-13 && inside.0.abs() < 1e3);
        let reference = direct(&tree, &|i| if i == 0 { inside.0 } else { point[i] });
        let value = x.eval(replaced, &mut |s| point[NAMES.iter().position(|n| *n == x.name(s)).unwrap()]);
        // What the inner error does to the outer value: by a second evaluation nearby.
        let moved = direct(&tree, &|i| if i == 0 { inside.0 * (1.0 + 1e-12) + 1e-12 } else { point[i] }).0;
        let slack = (reference.0, reference.1 + (moved - reference.0).abs());
        prop_assert!(agrees(value, slack), "{value} for {reference:?}");
    }

    #[test]
    fn derivatives_are_limits(tree in tree(), point in prop::array::uniform5(0.2f64..1.9)) {
        let mut x = Exprs::default();
        let e = build(&mut x, &tree);
        let symbol = super::reader::symbol(&mut x, "x");
        let slope = x.derivative(e, symbol);
        let at = |h: f64| direct(&tree, &|i| if i == 0 { point[0] + h } else { point[i] }).0;
        let h = 1e-4;
        let quotient = |h: f64| (at(h) - at(-h)) / (2.0 * h);
        // Two steps of Richardson; where they disagree the difference says nothing.
        let (coarse, fine) = (quotient(2.0 * h), quotient(h));
        let limit = (4.0 * fine - coarse) / 3.0;
        prop_assume!(limit.is_finite() && (coarse - fine).abs() <= 1e-4 * (1.0 + fine.abs()) && at(0.0).abs() < 1e3);
        let value = x.eval(slope, &mut |s| point[NAMES.iter().position(|n| *n == x.name(s)).unwrap()]);
        prop_assume!(value.is_finite());
        prop_assert!((value - limit).abs() <= 1e-5 * (1.0 + limit.abs()), "{value} for {limit}");
    }

    #[test]
    fn solutions_solve(a in 0.3f64..2.0, b in 0.3f64..2.0, at in -1.4f64..1.4, law in 0usize..11) {
        // Near zero the powers lose what the roots would need.
        prop_assume!(at.abs() > 0.1);
        let text = [
            "A*x + B", "A*x^3", "A*x^5 - B", "B*(exp(x/A) - 1)", "A*sinh(x*B)", "tanh(A*x) + B", "A*atan(x/B)",
            "A*x*abs(x)", "A*x^3/B + A", "exp(sinh(A*x^3))", "A*sign(x)*abs(x)^(3/2)",
        ][law];
        let mut x = Exprs::default();
        let law = super::reader::read(&mut x, text);
        let symbol = super::reader::symbol(&mut x, "x");
        let y = super::reader::read(&mut x, "y");
        let zero = x.sub(y, law);
        let inverse = x.solve_for(zero, symbol).expect("a solution");
        let value = |y: f64, x0: f64| move |name: &str| match name { "A" => a, "B" => b, "y" => y, _ => x0 };
        let forward = { let v = value(0.0, at); x.eval(law, &mut |s| v(x.name(s))) };
        let back = { let v = value(forward, 0.0); x.eval(inverse, &mut |s| v(x.name(s))) };
        prop_assert!((back - at).abs() <= 1e-9, "{text}: {back} for {at}");
    }
}
