//! Where positions have several solutions a guess says which of them is meant.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use halfarrow::{Form, Model, Override, Record, Run};
use halfarrow_compiler::ast;
use halfarrow_compiler::bond_graph::{NoFiles, elaborate};
use halfarrow_compiler::diagnostic::Sources;

fn model(text: &str, set: &[(&str, f64)]) -> Model {
    let set = set.iter().map(|(name, value)| Override { name: (*name).into(), value: format!("{value:?}") });
    let set: Vec<Override> = set.collect();
    Model::from_text("test.bond", text, &set).unwrap_or_else(|e| panic!("{}\n{text}", e.render(false)))
}

fn four_bar() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/faults/four_bar.bond");
    fs::read_to_string(path).expect("the model is there")
}

/// All variables at the start of a run, or why there is none.
fn start_of(model: &Model, form: Form) -> Result<BTreeMap<String, f64>, String> {
    let run = Run { to: 1e-9, form, record: Record::All, ..Run::default() };
    let done = model.simulate(&run, &mut |_| true).map_err(|e| e.render(false))?;
    Ok(done.trace.columns.iter().map(|c| (c.name.clone(), c.values[0])).collect())
}

fn starts_at(text: &str, set: &[(&str, f64)], form: Form, wanted: &[(&str, f64)]) {
    let found = start_of(&model(text, set), form).unwrap_or_else(|e| panic!("{form:?}: {e}"));
    for &(name, value) in wanted {
        let is = found[name];
        assert!((is - value).abs() <= 1e-12 * value.abs().max(1.0), "{form:?}: {name} = {is}, not {value}");
    }
}

/// Angles of coupler and rocker of the model, above (`side = 1`) or below the line from crank pin to ground pivot.
fn closed(side: f64) -> (f64, f64) {
    let (a, b, c, d, th1) = (0.2f64, 0.5f64, 0.4f64, 0.5f64, 0.6f64);
    let (x, y) = (d - a * th1.cos(), -a * th1.sin());
    let length = x.hypot(y);
    let between = ((b * b + length * length - c * c) / (2.0 * b * length)).acos();
    let th2 = y.atan2(x) + side * between;
    let th3 = (a * th1.sin() + b * th2.sin()).atan2(a * th1.cos() + b * th2.cos() - d);
    (th2, th3)
}

#[test]
fn a_four_bar_closes_on_the_side_that_is_guessed() {
    for (side, guesses) in [(1.0, [(1.0, 1.5), (0.7, 1.2)]), (-1.0, [(-1.2, -2.0), (-1.0, -1.7)])] {
        let (th2, th3) = closed(side);
        for (coupler, rocker) in guesses {
            for form in [Form::Minimal, Form::Kane, Form::Lagrange] {
                let set = [("coupler0", coupler), ("rocker0", rocker)];
                starts_at(&four_bar(), &set, form, &[("th1", 0.6), ("th2", th2), ("th3", th3)]);
            }
        }
    }
}

/// One of the two angles is enough; the other is searched from 0.
#[test]
fn what_is_not_guessed_is_searched_from_zero() {
    let (th2, th3) = closed(-1.0);
    let text = four_bar().replace(", th3 = rocker0", "");
    starts_at(&text, &[("coupler0", -1.2)], Form::Minimal, &[("th2", th2), ("th3", th3)]);
}

/// An angle tells its sine, and not the other way round, in whatever order they are guessed.
#[test]
fn a_position_is_guessed_by_itself_before_what_follows_from_it() {
    let th: f64 = -2.617993877991494;
    for states in ["state y' = lift.f\nstate th' = arm.f\n", "state th' = arm.f\nstate y' = lift.f\n"] {
        let text = format!(
            "model Arm\n1:lift -> I:two(1)\n1:far -> I:three(1)\n1:arm -> I:one(1)\nstate x' = far.f\n{states}\
             guess y = {:?}, x = {:?}, th = {th:?}\nconstraint height: y = sin(th)\nconstraint way: x = cos(th)\n",
            th.sin(),
            th.cos()
        );
        for form in [Form::Minimal, Form::Kane, Form::Lagrange] {
            starts_at(&text, &[], form, &[("th", th), ("x", th.cos()), ("y", th.sin())]);
        }
    }
}

/// The angle itself may be the displacement of a spring, or that of a spring beside it.
#[test]
fn displacements_of_springs_are_guessed() {
    let springs = four_bar().replace("guess th2 = coupler0, th3 = rocker0", "guess bush.q = coupler0, pin.q = rocker0")
        + "coupler -> C:bush(k = 1 N.m/rad)\nrocker -> C:pin(e = 2*q)\n";
    let springs = springs.replace("cos(th2)", "cos(bush.q)").replace("sin(th2)", "sin(bush.q)");
    let springs = springs.replace("cos(th3)", "cos(pin.q)").replace("sin(th3)", "sin(pin.q)");
    let springs = springs.replace("state th2' = coupler.f\nstate th3' = rocker.f\n", "");
    for (side, coupler, rocker) in [(1.0, 1.0, 1.5), (-1.0, -1.2, -2.0)] {
        let (th2, th3) = closed(side);
        let set = [("coupler0", coupler), ("rocker0", rocker)];
        starts_at(&springs, &set, Form::Minimal, &[("bush.q", th2), ("pin.q", th3), ("bush.e", th2)]);
    }
}

const ROOTS: &str = "model Roots
param first = 1
state x' = w.f
state y' = v.f from 2
guess x = first
1:w -> I:m(1)
1:v -> I:n(1)
Se:F(1) -> w
constraint curve: x*x = y
";

/// Where one unknown is left in a condition, it is solved for by itself.
#[test]
fn a_single_unknown_is_searched_from_its_guess() {
    for first in [0.3, 1.0, 50.0, -0.3, -2.0] {
        starts_at(ROOTS, &[("first", first)], Form::Minimal, &[("x", 2f64.sqrt().copysign(first)), ("y", 2.0)]);
    }
    let not_finite = ROOTS.replace("= first", "= sqrt(first)");
    let said = start_of(&model(&not_finite, &[("first", -1.0)]), Form::Minimal).expect_err("no number");
    assert!(said.contains("I005") && said.contains("the start value of x comes to NaN"), "{said}");
}

/// A start value wins; what neither start values nor constraints determine stays where it is guessed, in every form alike.
#[test]
fn a_guess_is_no_condition() {
    let given = ROOTS.replace("x' = w.f", "x' = w.f from -3").replace(" from 2", "");
    starts_at(&given, &[("first", 1.0)], Form::Minimal, &[("x", -3.0), ("y", 9.0)]);
    let free = "model Free
Se:F(1 N) -> 1:w -> I:m(1 kg)
w -> C:spring(k = 10 N/m)
w -> C:other(k = 10 N/m)
state x' = 2*w.f
guess x = 3 m, other.q = 0.2 m, spring.q = 0.1 m
guess m.p = 1 kg.m/s
";
    for form in [Form::Minimal, Form::Kane, Form::Lagrange, Form::Break] {
        let wanted = [("x", 3.0), ("spring.q", 0.1), ("other.q", 0.2), ("m.p", 1.0), ("other.e", 2.0)];
        starts_at(free, &[], form, &wanted);
    }
    let one = free.replace(", spring.q = 0.1 m", "");
    starts_at(&one, &[], Form::Minimal, &[("other.q", 0.2), ("spring.q", 0.0), ("x", 3.0)]);
}

#[test]
fn a_guess_in_a_component_is_of_its_own_names() {
    let text = "model Two
component Rod(param first; port a) {
    state th' = j.f
    a -> 1:j -> I:J(2)
    guess th = first
}
Se:F(1) -> Rod:p(first = -1.5)
Se:G(1) -> Rod:q(first = 1.5)
constraint at: p.th^2 = 4
constraint too: q.th^2 = 9
";
    starts_at(text, &[], Form::Minimal, &[("p.th", -2.0), ("q.th", 3.0)]);
    let outside = text.replace("    guess th = first\n", "") + "guess p.th = 1, q.th = -1\n";
    starts_at(&outside, &[], Form::Minimal, &[("p.th", 2.0), ("q.th", -3.0)]);
}

/// Where no start is found, the words offer a guess of what is searched, and not without need.
#[test]
fn a_start_that_is_not_found_offers_a_guess() {
    let never = ROOTS.replace("x*x = y", "x*x + y*y = -1").replace(" from 2", "");
    let said = start_of(&model(&never, &[]), Form::Minimal).expect_err("no start");
    let offered = said.contains("`guess x = 0.4`") || said.contains("`guess y = 0.4`");
    assert!((said.contains("I003") || said.contains("I004")) && offered, "{said}");
    let far = four_bar().replace("from 0.6 rad", "from 0.6 rad\nparam far = 2 m").replace("= d + c", "= far + c");
    let said = start_of(&model(&far, &[]), Form::Minimal).expect_err("too far");
    assert!(said.contains("`guess th2 = 0.4`"), "{said}");
    let nothing_searched = "model M\nSe:F(1) -> 1:w -> I:m(1, p0 = 1, f0 = 2)\n";
    let said = start_of(&model(nothing_searched, &[]), Form::Minimal).expect_err("a contradiction");
    assert!(said.contains("I003") && !said.contains("guess"), "{said}");
}

/// The word begins a statement and is free as a name.
#[test]
fn an_element_may_be_called_guess() {
    let text = "model Named\nSe:F(1) -> 1:guess\nguess -> I:m(1)\nguess -> C:s(k = 1)\nguess s.q = 2\n";
    starts_at(text, &[], Form::Minimal, &[("guess.f", 0.0), ("s.q", 2.0)]);
}

#[test]
fn the_layout_keeps_guesses() {
    let text = "model M\nguess  th2=0.4rad ,a.q = -x : m   \"where it hangs\"\nguess p : rad=1\n";
    let laid = "model M\nguess th2 = 0.4 rad, a.q = -x : m  \"where it hangs\"\nguess p : rad = 1\n";
    assert_eq!(ast::format(text).expect("it is read"), laid);
    assert_eq!(ast::format(laid).expect("it is read"), laid);
}

#[test]
fn the_graph_shows_guesses() {
    let mut sources = Sources::new();
    let tree = ast::parse(ROOTS, sources.add("roots.bond", ROOTS)).ast;
    let graph = elaborate(tree, sources, &NoFiles, &[]).graph.expect("a graph");
    let shown = graph.to_string();
    assert!(shown.ends_with("\nguesses (SI)\n  x = first\n"), "{shown}");
}
