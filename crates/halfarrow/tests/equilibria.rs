//! Equilibria of families of models, at three sizes each, against closed forms and raw equations.

#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use std::collections::BTreeMap;

use halfarrow::{Error, Family, Linearize, Model, Point, Problem, Record, Run, Start};

fn run_at_rest(text: &str) -> Result<BTreeMap<String, f64>, Error> {
    let model = Model::from_text("rest.bond", text, &[])?;
    let run = Run { to: 1e-9, start: Start::Equilibrium, record: Record::All, ..Run::default() };
    let done = model.simulate(&run, &mut |_| true)?;
    Ok(done.trace.columns.iter().map(|c| (c.name.clone(), c.values[0])).collect())
}

fn at_rest(family: Family, size: usize) -> BTreeMap<String, f64> {
    run_at_rest(&family.model("Rest", size)).unwrap_or_else(|e| panic!("{family:?} {size}: {}", e.render(false)))
}

/// No current flows: every capacitor holds `c` times the voltage of the source, 1 V.
#[test]
fn capacitors_of_ladders_and_grids_are_full() {
    for (family, size) in [
        (Family::Ladder, 5),
        (Family::Ladder, 60),
        (Family::Ladder, 600),
        (Family::Grid, 3),
        (Family::Grid, 8),
        (Family::Grid, 24),
    ] {
        let rest = at_rest(family, size);
        let charges: Vec<f64> = rest.iter().filter(|(name, _)| name.ends_with(".q")).map(|(_, q)| *q).collect();
        assert_eq!(charges.len(), if family == Family::Grid { size * size } else { size });
        charges.iter().for_each(|q| assert!((q - 1e-3).abs() < 1e-13, "{family:?} {size}: {q:e}"));
    }
}

/// Potentials of the resistors alone, of 1 ohm each, from the raw equations of the nodes: capacitors take no current. A band
/// as wide as a row of nodes, whose pivots need no exchange.
fn potentials(n: usize) -> Vec<f64> {
    let size = n * n;
    let (mut matrix, mut right) = (vec![vec![0.0; 2 * n + 1]; size], vec![0.0; size]);
    let mut join = |a: usize, b: Option<usize>| {
        matrix[a][n] += 1.0;
        if let Some(b) = b {
            matrix[b][n] += 1.0;
            matrix[a][n + b - a] -= 1.0;
            matrix[b][n + a - b] -= 1.0;
        }
    };
    join(0, None);
    right[0] = 1.0;
    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        let node = i * n + j;
        if (i + 1) * n % 3 != (3 - (j + 1) % 3) % 3 {
            join(node, None);
        }
        if i > 0 {
            join(node - n, Some(node));
        }
        if j > 0 {
            join(node - 1, Some(node));
        }
    }
    for k in 0..size {
        for row in k + 1..size.min(k + n + 1) {
            let factor = matrix[row][n + k - row] / matrix[k][n];
            (k..size.min(k + n + 1)).for_each(|j| matrix[row][n + j - row] -= factor * matrix[k][n + j - k]);
            right[row] -= factor * right[k];
        }
    }
    for k in (0..size).rev() {
        let known: f64 = (k + 1..size.min(k + n + 1)).map(|j| matrix[k][n + j - k] * right[j]).sum();
        right[k] = (right[k] - known) / matrix[k][n];
    }
    right
}

/// Far from the source a capacitor holds less than the last digit of the nearest one.
#[test]
fn capacitors_of_a_mesh_hold_what_its_resistors_leave_them() {
    for size in [5, 12, 30] {
        let (rest, exact) = (at_rest(Family::Mesh, size), potentials(size));
        let mut found = 0;
        for (node, potential) in exact.iter().enumerate() {
            let name = format!("store[{},{}].e", node / size + 1, node % size + 1);
            let Some(e) = rest.get(&name) else { continue };
            found += 1;
            assert!((e - potential).abs() < 1e-15, "{size}: {name} is {e:e}, not {potential:e}");
        }
        assert!(found >= size * size / 3 - size, "{found}");
    }
}

/// The spring of each joint bears the load by its lever up to the tip: `k bend = -load · Σ l cos(angle)`.
#[test]
fn springs_of_a_beam_bear_its_load() {
    for size in [4, 12, 40] {
        let rest = at_rest(Family::Beam, size);
        let angle = |i: usize| rest[&format!("angle[{i}]")];
        let mut lever = 0.0;
        for i in (1..=size).rev() {
            lever += libm::cos(angle(i)) / size as f64;
            let bend = rest[&format!("spring[{i}].q")];
            let before = if i > 1 { angle(i - 1) } else { 0.0 };
            assert!((bend - (angle(i) - before)).abs() < 1e-13, "{size}: joint {i} bends by {bend}");
            assert!((50.0 * bend + 0.5 * lever).abs() < 1e-12, "{size}: joint {i} bends by {bend}");
            assert!(rest[&format!("rotor[{i}].f")].abs() < 1e-12);
        }
    }
}

/// A row of capacitors joined by resistors, with this at its near end.
fn row(count: usize, end: &str) -> String {
    format!(
        "model Row \"joined\"\n{end} -> node[1]\nfor i in 1..{count} {{\n    0:node[i] -> C:c[i](1 mF)\n    if i > 1 {{\n        node[i - 1] -> 1:wire[i] -> node[i]\n        wire[i] -> R:r[i](1 ohm)\n    }}\n}}\n"
    )
}

#[test]
fn a_net_that_fills_for_ever_has_no_equilibrium() {
    for count in [4, 100] {
        assert!(run_at_rest(&row(count, "Se:source(1 V) -> 1:feed -> R:input(1 ohm)\nfeed")).is_ok());
        match run_at_rest(&row(count, "Sf:source(1 mA)")) {
            Err(error @ Error::Usage(Problem::NoEquilibrium { .. })) => {
                let text = error.render(false);
                assert!(text.contains("still changes at") && text.contains("a source that drives it"), "{text}");
            }
            Err(other) => panic!("{}", other.render(false)),
            Ok(_) => panic!("{count}: it rests"),
        }
    }
}

/// Full matrices have a bound; a cart that rests anywhere beside a net is told.
#[test]
fn large_models_are_linearised_at_rest_or_refused_with_the_reason() {
    let linearize = |text: &str| {
        let model = Model::from_text("rest.bond", text, &[]).unwrap_or_else(|e| panic!("{}", e.render(false)));
        model.linearize(&Linearize { at: Point::Equilibrium, ..Linearize::default() })
    };
    let report = linearize(&Family::Ladder.model("Line", 80)).unwrap_or_else(|e| panic!("{}", e.render(false)));
    assert!(report.stable && report.notes.is_empty(), "{:?}", report.notes);
    let cart = "1:cart -> I:mass(1 kg)\ncart -> R:damper(1 N.s/m)\nstate x' = cart.f\n";
    let open = linearize(&(Family::Ladder.model("Line", 80) + cart));
    match open {
        Ok(report) => {
            assert!(report.notes.iter().any(|n| n.contains("a combination of states is free")), "{:?}", report.notes)
        }
        Err(error) => panic!("{}", error.render(false)),
    }
    match linearize(&Family::Ladder.model("Line", 2100)) {
        Err(error @ Error::Usage(Problem::NoMatrices { .. })) => {
            assert!(error.render(false).contains("2100 states are more than"), "{}", error.render(false));
        }
        Err(other) => panic!("{}", other.render(false)),
        Ok(_) => panic!("it is linearised"),
    }
}

/// Newton's method from where a diode hardly conducts, or conducts beyond measure; rates on the way say nothing of those at its end.
#[test]
fn rest_is_where_rates_vanish_and_not_where_they_are_small_beside_what_they_were() {
    let charge = |law: &str, source: &str| {
        let text = format!("model M\n{source}\no -> C:c(1e-6)\no -> R:d({law})\n");
        run_at_rest(&text).unwrap_or_else(|e| panic!("{}", e.render(false)))["c.q"]
    };
    let near =
        |found: f64, wanted: f64| assert!((found - wanted).abs() < 1e-9 * wanted.abs(), "{found} is not {wanted}");
    for current in [1e-6, 1e-3, 1e-2, 3.0] {
        let diode = charge("f = 1e-12*(exp(e/0.026) - 1)", &format!("Sf:i({current}) -> 0:o"));
        near(diode, 1e-6 * 0.026 * (current / 1e-12_f64).ln_1p());
        let varistor = charge("f = (abs(e)/100)^30*sign(e) + 1e-12*e", &format!("Sf:i({current}) -> 0:o"));
        let leak = 1e-12 * varistor * 1e6;
        assert!(((varistor * 1e4).powi(30) / (current - leak) - 1.0).abs() < 1e-6, "{varistor}");
    }
    // A diode over which a capacitor charges.
    let series = "model M\nSe:v(5) -> 1:l -> R:r(f = 1e-9*(exp(e/0.026) - 1))\nl -> C:c(1e-6)\n";
    near(run_at_rest(series).unwrap_or_else(|e| panic!("{}", e.render(false)))["c.q"], 5e-6);
    // A fan that hardly brakes at first.
    let fan = "model M\nSe:t(10) -> 1:w -> I:j(0.01)\nw -> R:fan(e = 1e-4*f*abs(f) + 1e-9*f)\n";
    let speed = run_at_rest(fan).unwrap_or_else(|e| panic!("{}", e.render(false)))["j.f"];
    assert!((speed - 1e5f64.sqrt()).abs() < 1e-6 * speed, "{speed}");
}

/// Forces that vanish at infinity alone are no rest.
#[test]
fn infinity_is_no_rest() {
    for law in ["e = exp(q), q0 = 0.5", "e = -1/q^2, q0 = 1", "e = 2*(1 - exp(-q))*exp(-q), q0 = 5"] {
        let text = format!("model M\n1:v -> I:m(1)\nv -> C:s({law})\nv -> R:r(1)\n");
        match run_at_rest(&text) {
            Err(Error::Usage(Problem::NoEquilibrium { .. })) => {}
            Err(other) => panic!("{}", other.render(false)),
            Ok(found) => assert!(found["s.q"].abs() < 1e-9, "{law}: {found:?}"),
        }
    }
}

/// A crank hangs on a slide that a spring pushes outward. At the dead centre nothing moves the slide, whatever the crank does:
/// that is no rest. Where it rests the potential energy has its least value, with or without the slide as what is independent.
#[test]
fn a_dead_centre_is_no_rest() {
    let crank = |q0: f64, more: &str| {
        format!(
            "model Crank\nimport std.planar\nPlanarWorld:world -> 1[plane]:ground\n\
             ground -> PlanarPrismatic:slide(n = [1, 0], q0 = {q0} m) -> 1[plane]:s\n\
             s -> PlanarBody:piston(m = 1 kg, J = 0.01 kg.m2)\n\
             ground -> PlanarRevolute:crank(q0 = 0.3 rad) -> 1[plane]:c\n\
             c -> PlanarBody:web(m = 1 kg, J = 0.01 kg.m2, c = [0.1, 0])\n\
             c -> PlanarTranslation:pin(d = [0.2, 0]) -> rod.a\ns -> rod.b\nPlanarRod:rod(l = 0.5)\n\
             1:sr -> slide.axis\nsr -> C:spring(k = 100 N/m, q0 = -1 m)\nsr -> R:damper(5 N.s/m)\n{more}"
        )
    };
    for more in ["", "prefer slide.rate.f\n", "prefer crank.rate.f\n"] {
        let text = crank(0.69, more);
        let rest = run_at_rest(&text).unwrap_or_else(|e| panic!("{more}: {}", e.render(false)));
        let (angle, way) = (rest["crank.q"], rest["slide.q"]);
        assert!((0.2 * angle.cos() + (0.25 - (0.2 * angle.sin()).powi(2)).sqrt() - way).abs() < 1e-12, "{way}");
        // Virtual work: the spring against the weight of the web, 0.1 m away from the axis.
        let moved = -0.2 * angle.sin() * (1.0 + 0.2 * angle.cos() / (0.25 - (0.2 * angle.sin()).powi(2)).sqrt());
        let work = 100.0 * rest["spring.q"] * moved + 9.81 * 0.1 * angle.cos();
        assert!(work.abs() < 1e-9 && (angle + 0.035374).abs() < 1e-5, "{more}: {angle}: {work:e}");
    }
}

/// Nothing holds them: far away, where no digit is left of what is between them, is no place of rest.
#[test]
fn what_falls_does_not_rest_far_away() {
    let machines = [
        "g -> Prismatic:hub -> 1[frame]:h\nh -> Body:wheel(m = 40 kg, J = diag([1, 1, 1]))\n\
         h -> Prismatic:strut(q0 = 0.5 m) -> 1[frame]:c\nc -> Body:car(m = 300 kg, J = diag([10, 10, 10]))\n",
        "g -> Prismatic:hub(n = [0.3, 0.1, 1]) -> 1[frame]:h\nh -> Body:wheel(m = 4 kg, J = diag([1, 1, 1]))\n\
         h -> Revolute:hinge(n = [1, 0, 0]) -> FixedTranslation:arm(d = [0, 0.5, 0.1]) -> 1[frame]:c\n\
         c -> Body:car(m = 3 kg, J = diag([1, 1, 1]), c = [0, 0.2, 0])\n",
    ];
    for machine in machines {
        let spring = "SpringDamper:s(k = 20 kN/m, l0 = 0.5, c = 1e3)\nh -> s.a\nc -> s.b\n";
        let text = format!("model Falls\nimport std.multibody\nWorld:world -> 1[frame]:g\n{machine}{spring}");
        let error = run_at_rest(&text).expect_err("it falls").render(false);
        assert!(error.contains("no equilibrium was found"), "{error}");
    }
}

/// A pendulum hangs where it swings to, not where it would be after turns: a step of Newton's method from near the place where its
/// slope vanishes leads far away.
#[test]
fn a_pendulum_hangs_where_it_swings_to() {
    for (begin, rest) in [(0.1, 0.5), (0.3, 0.5), (1.2, 0.5), (2.5, 0.5), (-1.0, -0.5)] {
        let text = format!(
            "model Pendulum\nimport std.multibody\n\
             World:world -> Revolute:r(n = [0, 1, 0], q0 = {begin}) -> Body:b(m = 1, J = diag([1, 1, 1]), c = [1, 0, 0])\n"
        );
        let found = run_at_rest(&text).unwrap_or_else(|e| panic!("{}", e.render(false)))["r.q"];
        assert!((found - rest * std::f64::consts::PI).abs() < 1e-9, "{begin}: {found}");
    }
}

/// A machine that falls, with a slide on it, has no rest: the search ends, and says what moves.
#[test]
fn a_search_for_rest_ends_where_there_is_none() {
    let text = "model Falling\nimport std.multibody\nWorld:world -> Free:j1(w0 = [1.37, 0.40, 1.67]) -> 1[frame]:f1\n\
                f1 -> Body:b1(m = 1.95 kg, J = diag([0.058, 0.053, 0.051]))\n\
                f1 -> Prismatic:j3(n = [-0.86, 0.87, 0.89], q0 = 0.23, v0 = -0.48) -> Body:b3(m = 1.11 kg, J = diag([0.090, 0.094, 0.058]))\n";
    assert!(matches!(run_at_rest(text), Err(Error::Usage(Problem::NoEquilibrium { .. }))));
}
