//! Starts and equilibria that were wrong without a word, and the classes that they are examples of.
#![allow(clippy::disallowed_methods, clippy::excessive_precision, reason = "values to compare with")]

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use halfarrow::{Error, Form, Linearize, LinearizeReport, Model, Point, Problem, Record, Run, Start};

fn fault(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/faults").join(format!("{name}.bond"));
    fs::read_to_string(path).expect("the model is there")
}

fn model(text: &str) -> Model {
    Model::from_text("test.bond", text, &[]).unwrap_or_else(|e| panic!("{}\n{text}", e.render(false)))
}

fn at_rest(model: &Model) -> LinearizeReport {
    let wanted = Linearize { at: Point::Equilibrium, ..Linearize::default() };
    model.linearize(&wanted).unwrap_or_else(|e| panic!("{}", e.render(false)))
}

/// All variables at the start of a run.
fn start_of(model: &Model, form: Form, start: Start) -> BTreeMap<String, f64> {
    let run = Run { to: 1e-9, form, start, record: Record::All, ..Run::default() };
    let done = model.simulate(&run, &mut |_| true).unwrap_or_else(|e| panic!("{form:?}: {}", e.render(false)));
    done.trace.columns.iter().map(|c| (c.name.clone(), c.values[0])).collect()
}

fn refused(text: &str) -> String {
    let wanted = Linearize { at: Point::Equilibrium, ..Linearize::default() };
    match model(text).linearize(&wanted) {
        Err(error @ Error::Usage(Problem::NoEquilibrium { .. })) => error.render(false),
        Err(other) => panic!("{}", other.render(false)),
        Ok(report) => panic!("{:?}", report.states.iter().map(|s| (&s.name, s.value)).collect::<Vec<_>>()),
    }
}

fn near(what: &str, found: f64, wanted: f64) {
    assert!((found - wanted).abs() <= 1e-10 * wanted.abs().max(1e-2), "{what}: {found} is not {wanted}");
}

fn rests_at(report: &LinearizeReport, wanted: &[(&str, f64)]) {
    for &(name, value) in wanted {
        let states = report.states.iter().map(|s| (&s.name, s.value));
        let mut all = states.chain(report.positions.iter().map(|p| (&p.name, p.value)));
        let (_, found) = all.find(|v| v.0 == name).unwrap_or_else(|| panic!("nothing called {name}"));
        near(name, found, value);
    }
    assert!(report.states.iter().all(|s| s.rate.abs() < 1e-9), "{:?}", report.states);
}

/// `T = k l² sin θ cos θ`: `sin 2θ = 0.8`. The spring is `l sin θ` long though nothing says so but the transformer.
#[test]
fn a_spring_behind_a_lever_rests_where_its_lever_does() {
    let report = at_rest(&model(&fault("equilibrium_lever")));
    let th = 0.8f64.asin() / 2.0;
    rests_at(&report, &[("th", th), ("spring.q", 0.5 * th.sin()), ("J.f", 0.0)]);
    let fastest = report.modes.iter().map(|m| m.natural_frequency).fold(0.0, f64::max);
    near("natural frequency", fastest, 300.0f64.sqrt());
    assert!(report.notes.is_empty(), "it stands alone: {:?}", report.notes);
    let values = start_of(&model(&fault("equilibrium_lever")), Form::Minimal, Start::Equilibrium);
    near("th of a run", values["th"], th);
}

#[test]
fn all_forms_start_at_the_same_rest() {
    for name in ["equilibrium_lever", "equilibrium_two_links", "wishbone"] {
        let model = model(&fault(name));
        let minimal = start_of(&model, Form::Minimal, Start::Equilibrium);
        for form in [Form::Kane, Form::Break, Form::Lagrange, Form::Inverted] {
            for (variable, value) in start_of(&model, form, Start::Equilibrium) {
                let same = minimal.get(&variable).is_none_or(|m| (m - value).abs() <= 1e-9 * m.abs().max(1.0));
                assert!(same, "{name}, {form:?}: {variable} = {value}, not {:?}", minimal.get(&variable));
            }
        }
    }
}

/// What rests has speeds that are rounding: neither they nor directions that nothing but rounding couples tell how exact a run
/// has to be.
#[test]
fn what_rests_stays_in_all_forms() {
    let model = model(&fault("wishbone"));
    for form in [Form::Minimal, Form::Kane, Form::Break, Form::Lagrange, Form::Inverted] {
        let run = Run { to: 1.0, form, start: Start::Equilibrium, record: Record::All, ..Run::default() };
        let done = model.simulate(&run, &mut |_| true).unwrap_or_else(|e| panic!("{form:?}: {}", e.render(false)));
        assert!(done.report.steps < 100, "{form:?}: {} steps", done.report.steps);
        for state in &done.report.tolerances {
            assert!((1e-6..1e4).contains(&state.scale), "{form:?}: {state:?}");
        }
        for column in done.trace.columns.iter().filter(|c| ["zs", "al", "au", "ph"].contains(&c.name.as_str())) {
            let moved = (column.values[0] - column.values[column.values.len() - 1]).abs();
            assert!(moved < 1e-8, "{form:?}: {} by {moved:e}", column.name);
        }
    }
}

/// The end of the links hangs below the pivot: positions that only constraints join go along.
#[test]
fn links_hang_down() {
    let report = at_rest(&model(&fault("equilibrium_two_links")));
    rests_at(&report, &[("th1", 0.0), ("x1", 0.0), ("y1", -0.5), ("J.f", 0.0)]);
    let inertia = 0.1 + 0.25;
    near("frequency", report.modes[0].natural_frequency, (9.81f64 * 0.5 / inertia).sqrt());
}

/// Values by `mpmath`: the potential energy on the constraints is stationary.
#[test]
fn a_double_wishbone_rests_on_its_springs() {
    let report = at_rest(&model(&fault("wishbone")));
    let wanted = [
        ("zs", -0.162191678247791541),
        ("al", 0.433717254075664913),
        ("au", 0.596396374534962978),
        ("ph", 0.218711639176588094),
        ("spring.q", 0.084049354226579437),
        ("tread.q", 0.0161865),
    ];
    rests_at(&report, &wanted);
}

/// A torque on a crank that nothing holds: the words say what still moves.
#[test]
fn a_driven_crank_is_never_at_rest() {
    let words = refused(&fault("equilibrium_crank"));
    assert!(words.contains("no equilibrium was found") && words.contains("J.f still changes"), "{words}");
}

/// `k q1 l1 cos θ = k q2 l2 sin θ` and both springs follow the angle, from an angle that is not 0.
#[test]
fn two_springs_on_one_lever_follow_its_angle() {
    let text = "model Two
param l1 = 0.4, l2 = 0.7
state th' = w.f from 0.3
1:w -> I:J(0.2)
w -> R:b(0.5)
Se:T(3) -> w
w -> TF:one(l1*cos(th)) -> C:s1(k = 80, q0 = 0.05)
w -> TF:two(-l2*sin(th)) -> C:s2(k = 50, q0 = -0.02)";
    let report = at_rest(&model(text));
    let of = |name: &str| report.states.iter().find(|s| s.name == name).expect(name).value;
    let th = of("th");
    near("s1", of("s1.q"), 0.05 + 0.4 * (th.sin() - 0.3f64.sin()));
    near("s2", of("s2.q"), -0.02 + 0.7 * (th.cos() - 0.3f64.cos()));
    near("torque", 80.0 * of("s1.q") * 0.4 * th.cos() - 50.0 * of("s2.q") * 0.7 * th.sin(), 3.0);
}

/// A coil without resistance keeps `p + ∫ k(θ) dθ`; beside it a mesh of capacitors keeps its charge.
#[test]
fn flux_and_charge_are_kept() {
    let text = "model Flux
state th' = w.f from 0.2
1:loop -> I:coil(0.5, f0 = 4)
1:w -> I:J(0.1)
w -> R:b(0.3)
w -> C:stiff(k = 10)
loop -> GY:machine(2*cos(th)) -> w
0:n -> C:c1(2, q0 = 3)
n -> R:leak(5) -> 0:m
m -> C:c2(4)";
    let text = text.replace("n -> R:leak(5) -> 0:m", "n -> 1:j -> R:leak(5)\nj -> 0:m");
    let report = at_rest(&model(&text));
    let all = start_of(&model(&text), Form::Minimal, Start::Equilibrium);
    let th = all["th"];
    // Along the bond the flux falls by what the machine takes: p' = -2 cos θ w.
    near("flux", all["coil.p"], 0.5 * 4.0 - 2.0 * (th.sin() - 0.2f64.sin()));
    near("spring", all["stiff.q"], th - 0.2);
    near("torque", 2.0 * th.cos() * all["coil.f"], 10.0 * all["stiff.q"]);
    near("charge", all["c1.q"] + all["c2.q"], 3.0);
    near("voltage", all["c1.e"], all["c2.e"]);
    assert!(report.states.iter().all(|s| s.rate.abs() < 1e-9));
}

/// Sources and laws that move a displacement freely leave it free: a servo, a spring with a damper in series.
#[test]
fn what_moves_by_a_law_of_its_own_is_not_tied() {
    let servo = "model Servo
state th' = w.f from 0.5
Sf:drive(3*(0.2 - th)) -> 1:w -> C:s(k = 4)
w -> R:b(1)";
    rests_at(&at_rest(&model(servo)), &[("th", 0.2)]);
    let creep = "model Creep
state x' = v.f from 0.1
Se:pull(6) -> 1:v -> I:m(1)
v -> C:hold(k = 20)
v -> 0:n -> C:s(k = 5, q0 = 0.4)
n -> R:pot(2)";
    rests_at(&at_rest(&model(creep)), &[("x", 0.4), ("hold.q", 0.3), ("s.q", 0.0)]);
}

/// A speed controller with an integrator, without offset: where the load is held, the angle has gone as far as the
/// integral says.
#[test]
fn an_integral_of_a_speed_goes_with_the_angle() {
    let text = "model Loop
state th' = w.f from 0
state s' = -2*w.f from 1
Se:motor(s - 3*w.f) -> 1:w -> I:J(0.1)
w -> C:load(k = 4)";
    rests_at(&at_rest(&model(text)), &[("th", 1.0 / 6.0), ("s", 2.0 / 3.0), ("load.q", 1.0 / 6.0)]);
}

/// What a generator of random numbers says next, in -1 .. 1.
fn next(seed: &mut u64) -> f64 {
    *seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
    (*seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

/// `g(θ) = Σ a_i sin(θ_i + b_i) + c θ_0 θ_last`, for springs that sit behind transformers and for constraints.
struct Reach {
    a: Vec<f64>,
    b: Vec<f64>,
    c: f64,
}

impl Reach {
    fn random(n: usize, seed: &mut u64) -> Reach {
        let mut some = |_| (0..n).map(|_| next(seed)).collect::<Vec<f64>>();
        let (a, b) = (some(0), some(1));
        Reach { a, b, c: if n > 1 { 0.3 * next(seed) } else { 0.0 } }
    }
    fn at(&self, th: &[f64]) -> f64 {
        let bend: f64 = th.iter().zip(&self.a).zip(&self.b).map(|((t, a), b)| a * (t + b).sin()).sum();
        bend + self.c * th[0] * th[th.len() - 1]
    }
    fn slope(&self, th: &[f64], i: usize) -> f64 {
        let last = th.len() - 1;
        let cross = if i == 0 {
            th[last]
        } else if i == last {
            th[0]
        } else {
            0.0
        };
        self.a[i] * (th[i] + self.b[i]).cos() + self.c * cross
    }
    fn slope_text(&self, n: usize, i: usize) -> String {
        let cross = if i == 0 { format!("th{}", n - 1) } else { "th0".to_string() };
        let cross = if i == 0 || i == n - 1 { format!(" + {:?}*{cross}", self.c) } else { String::new() };
        format!("{:?}*cos(th{i} + {:?}){cross}", self.a[i], self.b[i])
    }
    fn text(&self, n: usize) -> String {
        let terms: Vec<String> = (0..n).map(|i| format!("{:?}*sin(th{i} + {:?})", self.a[i], self.b[i])).collect();
        format!("{} + {:?}*th0*th{}", terms.join(" + "), self.c, n - 1)
    }
}

/// Angles with springs, dampers and torques of their own; springs behind transformers that read the angles, and masses
/// behind constraints. At rest each spring is as long as the angles make it and all torques balance.
#[test]
fn random_mechanisms_rest_where_their_relations_hold() {
    let mut seed = 20;
    for round in 0..24 {
        let n = 1 + round % 3;
        let (springs, masses) = (1 + round % 2, (round / 2) % 2);
        let start: Vec<f64> = (0..n).map(|_| 0.5 * next(&mut seed)).collect();
        let torque: Vec<f64> = (0..n).map(|_| 4.0 * next(&mut seed)).collect();
        let reach: Vec<Reach> = (0..springs + masses).map(|_| Reach::random(n, &mut seed)).collect();
        let mut text = format!("model Random{round}\n");
        for i in 0..n {
            text += &format!(
                "state th{i}' = w{i}.f from {:?}\nSe:T{i}({:?}) -> 1:w{i} -> I:J{i}(1)\nw{i} -> C:k{i}(k = 5)\nw{i} -> R:b{i}(1)\n",
                start[i], torque[i]
            );
        }
        for (j, reach) in reach.iter().enumerate() {
            match j < springs {
                true => {
                    text += &format!("0:n{j} -> C:s{j}(k = 3)\n");
                    for i in 0..n {
                        text += &format!("w{i} -> TF:t{j}_{i}({}) -> n{j}\n", reach.slope_text(n, i));
                    }
                }
                false => {
                    text += &format!(
                        "state x{j}' = v{j}.f\nSe:weight{j}(-2) -> 1:v{j} -> I:m{j}(0.5)\nconstraint c{j}: x{j} - ({}) = 0\n",
                        reach.text(n)
                    );
                }
            }
        }
        let all = start_of(&model(&text), Form::Minimal, Start::Equilibrium);
        let th: Vec<f64> = (0..n).map(|i| all[&format!("th{i}")]).collect();
        for (j, reach) in reach.iter().enumerate() {
            match j < springs {
                true => near(&format!("{text}s{j}"), all[&format!("s{j}.q")], reach.at(&th) - reach.at(&start)),
                false => near(&format!("{text}x{j}"), all[&format!("x{j}")], reach.at(&th)),
            }
        }
        for i in 0..n {
            near(&format!("{text}k{i}"), all[&format!("k{i}.q")], th[i] - start[i]);
            let force = |j: usize| if j < springs { 3.0 * all[&format!("s{j}.q")] } else { 2.0 };
            let taken: f64 = reach.iter().enumerate().map(|(j, r)| force(j) * r.slope(&th, i)).sum();
            let left = torque[i] - 5.0 * (th[i] - start[i]) - taken;
            assert!(left.abs() < 1e-9, "{text}torque {i} is left: {left}");
        }
    }
}

/// The words of the fault that a model has at its start.
fn fault_at_start(text: &str) -> String {
    match model(text).simulate(&Run { to: 1e-9, ..Run::default() }, &mut |_| true) {
        Err(error @ Error::Model(_)) => error.render(false),
        Err(other) => panic!("{}", other.render(false)),
        Ok(done) => panic!("{:?}", done.trace.columns.iter().map(|c| (&c.name, c.values[0])).collect::<Vec<_>>()),
    }
}

/// The storage whose variable has no value is the one that is blamed, be its name the beginning of another's.
#[test]
fn a_value_that_is_not_finite_is_blamed_on_the_storage_that_has_it() {
    let text = "model M\nC:gas(k = 2)\nC:gas2(e = 1/q)\n1:a -> I:m(2)\na -> gas\na -> gas2\n";
    let Err(stopped) = model(text).simulate(&Run::default(), &mut |_| true) else { panic!("1/0") };
    let said = stopped.to_string();
    let told = "gas2.e, where gas2.q starts at 0 since `gas2` gives no `q0`, is not a finite number";
    assert!(said.contains(told), "{said}");
}

const FORMS: [Form; 4] = [Form::Minimal, Form::Kane, Form::Break, Form::Lagrange];

/// Storages that start from something, beside others of which nothing is said: those are empty, in every form.
#[test]
fn freedom_is_zero_in_the_storages() {
    let given_first = "model GivenFirst
1:n -> C:C1(k = 2, q0 = 1)
n -> C:C2(k = 3)
n -> R:r(1)";
    let moved = "model Moved
Sf:drive(2 + sin(t)) -> 0:n -> 1:a -> I:free(3)
n -> 1:b -> I:tied(2)
a -> R:r(1)";
    // Where an effort is given the charge is not 0, nor is the one that is kept with it.
    let poured = "model Poured
0:a -> C:c1(1e-6, e0 = 10)
a -> 1:l -> R:r(5)
l -> 0:b -> C:c2(1e-6)";
    let bent = poured.replace("C:c2(1e-6)", "C:c2(e = 2e6*q + 1e17*q^3)");
    let geared = poured.replace("l -> 0:b", "l -> TF:t(e_out = 2) -> 0:b");
    let between = "model Between
0:a -> C:c1(1e-6)
a -> 1:l -> R:r(5)
l -> 0:b -> C:c2(1e-6, e0 = 10)
b -> 1:m -> R:s(5)
m -> 0:c -> C:c3(1e-6)";
    let cases: [(&str, &[(&str, f64)]); 8] = [
        (poured, &[("c1.e", 10.0), ("c2.q", 0.0)]),
        (&bent, &[("c1.e", 10.0), ("c2.q", 0.0)]),
        (&geared, &[("c1.e", 10.0), ("c2.q", 0.0)]),
        (between, &[("c1.q", 0.0), ("c2.e", 10.0), ("c3.q", 0.0)]),
        (&fault("start_free"), &[("I1.f", 0.0), ("I2.f", 1.0)]),
        (&fault("start_free2"), &[("C1.q", 0.0), ("C2.q", 1.0)]),
        (given_first, &[("C1.q", 1.0), ("C2.q", 0.0)]),
        (moved, &[("free.f", 0.0), ("tied.f", 2.0)]),
    ];
    for (text, wanted) in cases {
        for form in FORMS {
            let all = start_of(&model(text), form, Start::Given);
            for &(name, value) in wanted {
                assert!((all[name] - value).abs() < 1e-15, "{form:?}: {name} = {}, not {value}\n{text}", all[name]);
            }
        }
    }
}

/// A run that starts at rest: all variables at its beginning, and at its end.
fn at_rest_in_a_run(text: &str) -> [BTreeMap<String, f64>; 2] {
    let run = Run { to: 1.0, start: Start::Equilibrium, record: Record::All, ..Run::default() };
    let done = model(text).simulate(&run, &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false)));
    let at =
        |sample: fn(&[f64]) -> f64| done.trace.columns.iter().map(|c| (c.name.clone(), sample(&c.values))).collect();
    [at(|values| values[0]), at(|values| values[values.len() - 1])]
}

/// `100 x = 50 (0.3 - x) - 19.62`, also where the controller sees its position late; a controller that sets its force at the first
/// tick has to know it before.
#[test]
fn what_is_held_is_at_rest_with_the_others() {
    let text = |force: &str, more: &str| {
        format!(
            "model Held\n{more}\n1:v -> I:m(2)\nstate x' = v.f from 0\nv -> C:s(k = 100)\nv -> R:d(3)\nSe:w(-19.62) -> v\nSe:act({force}) -> v\n"
        )
    };
    for force in ["sample(50*(0.3 - x), 0.01)", "delay(50*(0.3 - x), 0.02)"] {
        for all in at_rest_in_a_run(&text(force, "")) {
            assert!((all["x"] + 0.0308).abs() < 1e-9 && (all["act.e"] - 16.54).abs() < 1e-7, "{force}: {all:?}");
        }
    }
    let set = |u: f64| text("u", &format!("discrete u = {u:?}\nwhen every 0.01 {{ u = 50*(0.3 - x) }}"));
    let run = Run { to: 1.0, start: Start::Equilibrium, ..Run::default() };
    let words = model(&set(0.0)).simulate(&run, &mut |_| true).expect_err("it is set in motion").render(false);
    assert!(words.contains("what is held (u)") && words.contains("the value of rest"), "{words}");
    near("known", at_rest_in_a_run(&set(16.54))[1]["x"], -0.0308);
}

/// A block on a spring that friction holds is at rest where it starts.
#[test]
fn what_sticks_is_at_rest_where_it_is() {
    for (force, pad) in [(0.0, -10.0), (20.0, 10.0)] {
        let text = format!(
            "model Sticks\n1:v -> I:m(2)\nstate x' = v.f from 0.1\nv -> C:sp(k = 100, q0 = 0.1)\nv -> R:pad(friction = 15)\nSe:push({force:?}) -> v\n"
        );
        for all in at_rest_in_a_run(&text) {
            near("x", all["x"], 0.1);
            near("pad", all["pad.e"], pad);
        }
    }
}

/// Nets of like storages with resistors between, some with a start value: the others are empty in every form.
#[test]
fn random_nets_start_alike_in_every_form() {
    let mut seed = 6;
    for round in 0..12 {
        let n = 3 + round % 3;
        let (kind, law) = if round % 2 == 0 { ("I", "f0") } else { ("C", "q0") };
        let junction = if round % 4 < 2 { "0" } else { "1" };
        let mut text = format!("model Net{round}\n{junction}:n -> R:r(2)\n");
        let given: Vec<Option<f64>> =
            (0..n).map(|i| (i == 0 || next(&mut seed) > 0.0).then(|| next(&mut seed)).filter(|_| i != 1)).collect();
        let storages: Vec<String> = given
            .iter()
            .enumerate()
            .map(|(i, g)| {
                format!("{kind}:s{i}({}{})", 1.0 + i as f64, g.map_or(String::new(), |g| format!(", {law} = {g:?}")))
            })
            .collect();
        // All of them have their own flow (effort), so that none depends on another.
        if (kind == "I") == (junction == "0") {
            storages.iter().for_each(|s| text += &format!("n -> {s}\n"));
        } else {
            let other = if junction == "0" { "1" } else { "0" };
            for (i, s) in storages.iter().enumerate() {
                text += &format!("n -> {other}:m{i} -> {s}\nm{i} -> R:r{i}({})\n", 1 + i);
            }
        }
        let variable = if kind == "I" { "f" } else { "q" };
        for form in FORMS {
            let all = start_of(&model(&text), form, Start::Given);
            for (i, g) in given.iter().enumerate() {
                let found = all[&format!("s{i}.{variable}")];
                assert!((found - g.unwrap_or(0.0)).abs() < 1e-12, "{form:?}: s{i} = {found}\n{text}");
            }
        }
    }
}

/// Rows that are independent of those before, with the right sides they come to, in the order given.
fn solution(rows: &[(Vec<f64>, f64)]) -> Vec<f64> {
    let n = rows[0].0.len();
    let mut known: Vec<(usize, Vec<f64>, f64)> = Vec::new();
    for (row, right) in rows {
        let (mut row, mut right) = (row.clone(), *right);
        let size = row.iter().fold(0.0f64, |most, v| most.max(v.abs()));
        for (pivot, other, value) in &known {
            let factor = row[*pivot];
            row.iter_mut().zip(other).for_each(|(r, o)| *r -= factor * o);
            right -= factor * value;
        }
        let pivot = (0..n).max_by(|&i, &j| row[i].abs().total_cmp(&row[j].abs())).expect("a column");
        if row[pivot].abs() < 1e-10 * size {
            continue;
        }
        let by = row[pivot];
        row.iter_mut().for_each(|r| *r /= by);
        for (_, other, value) in &mut known {
            let factor = other[pivot];
            other.iter_mut().zip(&row).for_each(|(o, r)| *o -= factor * r);
            *value -= factor * right / by;
        }
        known.push((pivot, row, right / by));
    }
    let mut found = vec![0.0; n];
    known.into_iter().for_each(|(pivot, _, value)| found[pivot] = value);
    found
}

/// Inertias whose speeds are sums of those of others, by gears of any ratio: some of both start with a speed. What that
/// leaves free is zero in the inertias, one after the other as they stand in the model, whatever is preferred.
#[test]
fn freedom_behind_dependent_start_values_is_zero_in_the_order_of_the_model() {
    let mut seed = 77;
    for round in 0..16 {
        let (n, tied) = (2 + round % 3, 1 + round % 2);
        let decades = [0.0, 3.0][round % 2];
        let mut rows: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| f64::from(u8::from(i == j))).collect()).collect();
        rows.extend((0..tied).map(|_| (0..n).map(|_| 10f64.powf(decades * next(&mut seed))).collect::<Vec<_>>()));
        // The order of the model is any.
        let mut order: Vec<usize> = (0..n + tied).collect();
        (1..order.len()).rev().for_each(|i| order.swap(i, ((next(&mut seed) + 1.0) * 0.5 * (i + 1) as f64) as usize));
        let mut given: Vec<(usize, f64)> = vec![(n, next(&mut seed))];
        given.extend((0..n - 1).filter(|_| next(&mut seed) > 0.3).map(|i| (i, 0.0)));
        given.truncate(n - 1);
        given.iter_mut().for_each(|g| g.1 = next(&mut seed));
        let mut text = format!("model Tied{round}\n");
        for &i in &order {
            let start = given.iter().find(|g| g.0 == i).map_or(String::new(), |g| format!(", f0 = {:?}", g.1));
            text += &format!("1:v{i} -> I:m{i}({}{start})\nv{i} -> R:r{i}(1)\n", 1 + i);
        }
        for (j, ratios) in rows.iter().enumerate().skip(n) {
            text += &format!("0:n{j}\n");
            (0..n).for_each(|i| text += &format!("v{i} -> TF:t{i}_{j}(f_out = {:?}) -> n{j}\n", ratios[i]));
            text += &format!("n{j} -> v{j}\n");
        }
        if round % 3 == 1 {
            text += &format!("prefer m{n}.f\n");
        }
        let conditions = given.iter().copied().chain(order.iter().map(|&i| (i, 0.0)));
        let speeds = solution(&conditions.map(|(i, value)| (rows[i].clone(), value)).collect::<Vec<_>>());
        // The iteration of break variables gives up where some vanish beside others: see the known faults in docs/TESTING.md.
        let forms = if decades > 0.0 { &FORMS[..2] } else { &FORMS };
        for &form in forms {
            let all = start_of(&model(&text), form, Start::Given);
            for (i, row) in rows.iter().enumerate() {
                let wanted: f64 = row.iter().zip(&speeds).map(|(r, s)| r * s).sum();
                let size: f64 = row.iter().zip(&speeds).map(|(r, s)| (r * s).abs()).sum();
                let found = all[&format!("m{i}.f")];
                assert!(
                    (found - wanted).abs() <= 1e-10 * size.max(1e-3),
                    "{form:?}: m{i} = {found}, not {wanted}\n{text}"
                );
            }
        }
    }
}

/// A spring that another one cannot be short enough for is not empty: what is given goes first.
#[test]
fn freedom_gives_way_to_what_is_given() {
    let text = "model GivesWay
1:a -> I:m1(1)
a -> R:r1(3)
a -> C:s1(k = 4)
1:b -> I:m2(2)
b -> R:r2(3)
b -> C:s2(k = 5)
constraint gap: s1.q*s2.q = 2";
    for form in FORMS {
        let all = start_of(&model(text), form, Start::Given);
        assert!((all["s1.q"] * all["s2.q"] - 2.0).abs() < 1e-12 && all["s1.q"].abs() > 0.1, "{form:?}: {all:?}");
        let beside = start_of(&model(&text.replace("s1.q*s2.q", "(s1.q + 1)*s2.q")), form, Start::Given);
        assert!(beside["s1.q"] == 0.0 && (beside["s2.q"] - 2.0).abs() < 1e-12, "{form:?}: {beside:?}");
    }
}

#[test]
fn a_start_value_that_is_no_number_is_a_fault_at_its_place() {
    let words = fault_at_start(&fault("start_nan"));
    assert!(words.contains("I005") && words.contains("test.bond:3:") && words.contains("a.f"), "{words}");
    let words = fault_at_start("model Big\nparam x = 0\nSe:s(1) -> 1:j -> I:a(1)\nj -> C:c(1, q0 = 1/x)");
    assert!(words.contains("c.q comes to inf"), "{words}");
}

/// Laws without a slope at zero: what is asked is looked for beyond.
#[test]
fn start_values_are_found_where_a_law_has_a_slope() {
    let square = start_of(&model(&fault("start_square")), Form::Minimal, Start::Given);
    assert!((square["a.q"].abs() - 2.0).abs() < 1e-12 && (square["a.e"] - 4.0).abs() < 1e-12);
    let cubic = fault("break_cubic").replace("e = q^3", "e = q^3, e0 = 8");
    for form in FORMS {
        let all = start_of(&model(&cubic), form, Start::Given);
        assert!((all["c1.q"] - 2.0).abs() < 1e-12 && (all["c2.q"] - 8.0).abs() < 1e-12, "{form:?}");
    }
    let none = "model None\nSe:s(1) -> 1:j -> C:a(e = q^2, e0 = -4)\nj -> I:m(1)";
    let words = fault_at_start(none);
    assert!(words.contains("I003") && words.contains("a.e = -4 asked"), "{words}");
}

/// A rolling wheel with its heading and all four of its speeds given, at headings where rows of the conditions are rounding.
#[test]
fn more_start_values_than_unknowns_agree() {
    for heading in ["0", "1e-9", "0.7", "pi/2", "pi", "-2.5"] {
        for kept in ["roll.f", "turn.f, roll.f"] {
            let text = format!(
                "model Wheel
param r = 0.3, w0 = 2, a0 = {heading}
state psi' = turn.f from a0
state x' = x.f from 0
1:x -> I:mx(10, f0 = r*w0*cos(a0))
1:y -> I:my(10, f0 = r*w0*sin(a0))
1:roll -> I:Jr(0.4, f0 = w0)
1:turn -> I:Jt(0.2, f0 = 1)
constraint cx: x.f - r*cos(psi)*roll.f = 0
constraint cy: y.f - r*sin(psi)*roll.f = 0
prefer {kept}"
            );
            let all = start_of(&model(&text), Form::Minimal, Start::Given);
            assert!((all["Jr.f"] - 2.0).abs() < 1e-12 && (all["Jt.f"] - 1.0).abs() < 1e-12, "{heading}: {all:?}");
            assert!((all["mx.f"] - 0.6 * all["psi"].cos()).abs() < 1e-12, "{heading}");
            assert!((all["my.f"] - 0.6 * all["psi"].sin()).abs() < 1e-12, "{heading}");
            assert!(all["mx.e"].abs() < 100.0 && all["my.e"].abs() < 100.0, "{heading}: {all:?}");
        }
    }
    let text = "model Conflict
state psi' = turn.f from 0.7
1:x -> I:mx(10, f0 = 0.6)
1:roll -> I:Jr(0.4, f0 = 2)
1:turn -> I:Jt(0.2, f0 = 1)
constraint cx: x.f - 0.3*cos(psi)*roll.f = 0
prefer roll.f";
    assert!(fault_at_start(text).contains("I003"));
}

/// Laws of infinite slope where pressures are equal, as they are when nothing is known of them. Pressures by SciPy's `fsolve`.
#[test]
fn pipes_find_their_pressures() {
    let start = start_of(&model(&fault("pipes")), Form::Minimal, Start::Given);
    let wanted = [
        ("a.e", 9.256558695382685),
        ("b.e", 4.991449199300263),
        ("c.e", 4.992505057797692),
        ("d.e", 1.8586032615432873),
    ];
    for (name, wanted) in wanted {
        assert!((start[name] - wanted).abs() < 1e-13, "{name}: {:e} but {wanted:e}", start[name]);
    }
}

/// What fits where the search begins, at 0, but for rounding of the constants that conditions subtract, stays there.
#[test]
fn what_fits_at_zero_stays_there() {
    let text = "model Start
state x' = vx.f
state y' = vy.f
state z' = vz.f
1:vx -> I:ix(1)
1:vy -> I:iy(1)
1:vz -> I:iz(1)
constraint rod: (0.41 + x)^2 + (0.025 + y - 0.1*z)^2 = 0.41^2 + 0.025^2
constraint rod2: (0.44 + x)^2 + (-0.25 + y + 0.3*z)^2 = 0.44^2 + 0.25^2
";
    let hold = "constraint hold: (0.3 + x)^2 + (0.1 + 0.7*y + z)^2 = 0.3^2 + 0.1^2\n";
    for text in [text.to_string(), format!("{text}{hold}")] {
        let model = Model::from_text("m.bond", &text, &[]).unwrap_or_else(|e| panic!("{}", e.render(false)));
        let run = Run { to: 1e-6, record: Record::All, ..Run::default() };
        let done = model.simulate(&run, &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false)));
        for name in ["x", "y", "z"] {
            let column = done.trace.columns.iter().find(|c| c.name == name).expect("it is recorded");
            assert!(column.values[0].abs() < 1e-14, "{name} {}\n{text}", column.values[0]);
        }
    }
}

/// Three of the constraints that close a four-bar read nothing that moves, wherever its base leans to.
#[test]
fn a_leaning_four_bar_starts() {
    let text = fault("leaning");
    let start = |angle: &str| {
        let text = text.replace("angle = 0.02", &format!("angle = {angle}"));
        start_of(&model(&text), Form::Minimal, Start::Given)
    };
    let level = start("0");
    for angle in ["0.01", "0.02", "0.1", "0.3", "1.3"] {
        let leaning = start(angle);
        for joint in ["j1.q", "j2.q", "j3.q"] {
            assert!((leaning[joint] - level[joint]).abs() < 1e-13, "{angle}: {} {}", leaning[joint], level[joint]);
        }
    }
}

/// A bridge of four exponential diodes, from a few volts to where all exponentials overflow while nothing is known yet: at rest at
/// once, or with a capacitor that has yet to be charged. Those that block carry their saturation current to rounding, and their law
/// is never asked which voltage belongs to that.
#[test]
fn bridges_of_diodes_start_at_any_voltage() {
    let (is, vt, rs, rl) = (1e-9, 25e-3, 10.0, 1e3);
    let bridge = |v0: f64, beside: &str| {
        format!(
            "model Bridge
            param is = {is}, vt = {vt}, v0 = {v0}
            component Diode(port from, to) {{
              from -> 1:through -> to
              through -> R:junction(f = is*(exp(e/vt) - 1))
            }}
            Diode:d1; Diode:d2; Diode:d3; Diode:d4
            Se:mains(v0) -> 1:feed -> 0:left; feed -> R:Rs({rs}); 0:right -> feed
            0:minus -> d3.from; d3.to -> left; left -> d1.from; d1.to -> 0:plus
            minus -> d4.from; d4.to -> right; right -> d2.from; d2.to -> plus
            plus -> 1:out -> minus; out -> 0:load -> R:Rl({rl}); Se:ground(0) -> minus{beside}"
        )
        .replace("; ", "\n")
    };
    for v0 in [4.0, 6.0, 12.0, 24.0, 60.0, 110.0, 230.0, 311.0, 690.0f64] {
        let mut i = v0 / (rs + rl);
        for _ in 0..50 {
            let left = rs * (i + is) + 2.0 * vt * (i / is + 1.0).ln() + rl * (i - is) - v0;
            i -= left / (rs + rl + 2.0 * vt / (i + is));
        }
        for form in [Form::Minimal, Form::Kane, Form::Lagrange] {
            for way in [v0, -v0] {
                let found = start_of(&model(&bridge(way, "")), form, Start::Given);
                near(&format!("{form:?} {way}"), found["Rl.e"], rl * (i - is));
                let found = start_of(&model(&bridge(way, "; load -> C:filter(10e-6)")), form, Start::Given);
                near(&format!("{form:?} {way}"), found["Rl.e"], 0.0);
                assert!(found["Rs.f"].abs() > 0.9 * (v0 - 2.0) / rs, "{form:?} {way}: {}", found["Rs.f"]);
            }
        }
    }
}

/// Nets of pipes whose laws are written by what drives the flow, with an infinite slope at rest, are the same as nets written the
/// other way round.
#[test]
fn nets_of_orifices_start_as_nets_of_pipes_do() {
    for seed in 1..=12u64 {
        let mut state = seed;
        let mut real = |low: f64, high: f64| low + (high - low) * 0.5 * (1.0 + next(&mut state));
        let nodes = 4 + (seed % 6) as usize;
        let mut lines = vec!["model Net\nSe:feed(5e5) -> 0:n0".to_string()];
        lines.extend((1..nodes).map(|i| format!("0:n{i}\nSf:take{i}({}) -> n{i}", real(-1e-3, 2e-4))));
        let mut pipes = Vec::new();
        for i in 1..nodes {
            for from in 0..i {
                if from + 1 == i || real(0.0, 1.0) < 0.6 {
                    pipes.push((from, i, real(1e-6, 1e-5)));
                }
            }
        }
        let net = |law: &dyn Fn(f64) -> String| {
            let pipes = pipes
                .iter()
                .enumerate()
                .map(|(k, &(from, to, g))| format!("n{from} -> 1:p{k} -> n{to}\np{k} -> R:r{k}({})", law(g)));
            lines.iter().cloned().chain(pipes).collect::<Vec<_>>().join("\n")
        };
        let [orifices, inverse] =
            [net(&|g| format!("f = {g}*sqrt(abs(e))*sign(e)")), net(&|g| format!("e = {}*f*abs(f)", 1.0 / (g * g)))]
                .map(|text| start_of(&model(&text), Form::Minimal, Start::Given));
        for i in 1..nodes {
            near(&format!("n{i} of {seed}"), orifices[&format!("n{i}.e")], inverse[&format!("n{i}.e")]);
        }
    }
}

/// Rest is found from where laws are flat, or infinitely steep: the slope there says nothing of what is further on.
#[test]
fn rest_is_found_from_where_laws_are_flat() {
    let models = [
        ("Se:res(50) -> 1:p -> I:q(20)\np -> R:fr(e = 3*f*abs(f))", "q.f", (50.0_f64 / 3.0).sqrt()),
        ("Se:s(5) -> 1:w -> I:m(2)\nw -> C:k(e = 4*q^3)\nw -> R:d(1)", "k.q", 1.25_f64.cbrt()),
        ("Sf:s(0.3) -> 0:a -> C:c1(1)\na -> R:w(f = 1.5*max(e - 0.8, 0)^1.5)", "c1.e", 0.8 + 0.2_f64.powf(2.0 / 3.0)),
        ("Sf:s(100) -> 0:a -> C:c1(100)\na -> R:w(f = 2*sign(e)*abs(e)^1.25)", "c1.e", 50.0_f64.powf(0.8)),
        (
            "Sf:s(0.3) -> 0:a -> C:c1(1)\na -> 1:x -> 0:b -> C:c2(2)\nx -> R:o(f = 0.2*sign(e)*sqrt(abs(e)))\nb -> R:o2(1)",
            "c1.e",
            2.55,
        ),
    ];
    for (model, name, wanted) in models {
        let model = Model::from_text("text.bond", &format!("model M\n{model}\n"), &[]).expect("a model");
        let asked =
            Run { to: 1.0, start: Start::Equilibrium, record: Record::Names(vec![name.into()]), ..Run::default() };
        let done = model.simulate(&asked, &mut |_| true).unwrap_or_else(|error| panic!("{}", error.render(false)));
        let found = done.trace.columns[0].values[0];
        assert!((found - wanted).abs() <= 1e-5 * wanted, "{name}: {found}, not {wanted}");
    }
}

/// What nobody asks for gives way rather than that an angle goes to where nothing is told any more: at infinity, or at so many turns
/// that its sine is rounding.
#[test]
fn a_start_that_nobody_asks_for_is_not_sought_at_infinity() {
    let gear = |ratio: &str| {
        let text = format!(
            "model M\n1:w -> I:i(1, f0 = 1)\nstate th' = w.f\nw -> TF:g(f_out = {ratio}) -> 1:u -> I:j(2)\noutput f = w.f\n"
        );
        start_of(&model(&text), Form::Minimal, Start::Given)
    };
    for ratio in ["1 + 0.6*sin(th)", "1 + 0.7*sin(th)", "exp(-1.84*th)", "(th + 0.3)/sqrt(1 + (th + 0.3)^2) + 1"] {
        let start = gear(ratio);
        assert!(start["th"] == 0.0 && (start["f"] - 1.0).abs() < 1e-12, "{ratio}: {start:?}");
    }
    // Where an angle at which the second mass stands still is to be had, it is taken.
    let start = gear("1 + 2*sin(th)");
    assert!((start["th"] + std::f64::consts::FRAC_PI_6).abs() < 1e-9, "{start:?}");
    let two = "model M\n1:w1 -> I:i1(1, f0 = 1)\nstate t1' = w1.f\n\
               w1 -> TF:g1(f_out = 2 + 0.187*cos(t1)) -> 1:w2 -> I:i2(1)\nstate t2' = w2.f\n\
               w2 -> TF:g2(f_out = 2 + 1.457*sin(t2 + t1)) -> 1:w3 -> I:i3(3)\n";
    let start = start_of(&model(two), Form::Minimal, Start::Given);
    assert!((start["i1.f"] - 1.0).abs() < 1e-12 && start["t1"] == 0.0 && start["t2"] == 0.0, "{start:?}");
}
