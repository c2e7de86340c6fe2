//! Set-valued laws in all forms against the minimal one.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use std::collections::BTreeMap;

use halfarrow::{Form, Method, Model, Progress, Record, Run};

use crate::forms::{Values, apart};
use crate::set_valued_random::{Machine, machines};

const FORMS: [Form; 6] = [Form::Kane, Form::Lagrange, Form::Break, Form::Inverted, Form::Relaxed, Form::Stiff];
/// Agreement of every variable everywhere, relative to its greatest magnitude in the run.
const AGREES: f64 = 1e-9;
/// Steps that no machine needs.
const MOST_STEPS: usize = 50_000;

fn model(text: &str) -> Model {
    let text = if text.starts_with("model") { text.to_string() } else { format!("model Machine\n{text}") };
    Model::from_text("machine.bond", &text, &[]).unwrap_or_else(|e| panic!("{}", e.render(false)))
}

/// What a run comes to, at 40 times; in the error why not.
fn values(model: &Model, run: &Run) -> Result<Values, String> {
    let mut steps = 0;
    let mut goes_on = |_: Progress<'_>| {
        steps += 1;
        steps < MOST_STEPS
    };
    let done = model.simulate(run, &mut goes_on).map_err(|e| e.render(false))?;
    if let Some(warning) = done.report.audit.warnings.first() {
        return Err(format!("audit: {warning}"));
    }
    Ok(done.trace.columns.into_iter().map(|c| (c.name, c.values)).collect())
}

/// Models, and how long they run, in s. Each changes between modes with other states, multipliers or break variables.
const MACHINES: [(&str, &str, f64); 19] = [
    (
        "rectifier with a coil",
        "Se:src(10*sin(300*t)) -> 1:loop\nloop -> R:d(0 <= f, 0 <= -e)\nloop -> I:coil(0.1)\nloop -> R:load(20)\n",
        0.02,
    ),
    (
        "bridge",
        "import std.electrical\nSe:gnd(0) -> 0:n\n0:a\n0:b\n0:p\n1:source\nSe:src(10*sin(300*t)) -> source\n\
         b -> source -> a\nsource -> R:rs(1)\na -> IdealDiode:da -> p\nb -> IdealDiode:db -> p\n\
         n -> IdealDiode:dn -> a\nn -> IdealDiode:dm -> b\np -> 1:out -> n\nout -> 0:load\nload -> R:rl(50)\n\
         load -> C:cap(1e-3)\na -> R:leak(1e7)\n",
        0.05,
    ),
    (
        "buck converter",
        "Se:src(24) -> 1:in -> 0:sw\nin -> Sw:s(on = mod(t, 1e-5) < 0.4e-5)\nsw -> 1:free\n\
         free -> R:d(0 <= -f, 0 <= e)\nsw -> 1:coil -> 0:out\ncoil -> I:l(1e-4)\nout -> C:c(1e-5)\nout -> R:load(200)\n",
        1e-3,
    ),
    (
        "stick-slip",
        "Sf:belt(0.1) -> 0:contact\ncontact -> 1:rub -> R:pad(friction = 1, stiction = 1.5)\ncontact -> 1:block\n\
         block -> I:mass(1)\nblock -> C:spring(k = 10)\n",
        12.0,
    ),
    ("clutch", "1:a -> I:j1(1, f0 = 30)\n1:b -> I:j2(2)\na -> 0:slip -> b\nslip -> R:pad(friction = 10)\n", 5.0),
    (
        "bouncing ball",
        "Se:weight(-9.81) -> 1:v -> I:m(1)\nstate x' = v.f from 1\nconstraint floor: x >= 0 (restitution = 0.8)\n",
        5.0,
    ),
    (
        "three balls",
        "1:a -> I:ma(1, f0 = 1)\n1:b -> I:mb(1)\n1:c -> I:mc(1)\nstate xa' = a.f from -1\nstate xb' = b.f from 0\n\
         state xc' = c.f from 0\nconstraint ab: xb - xa >= 0 (restitution = 1)\n\
         constraint bc: xc - xb >= 0 (restitution = 1)\n",
        2.0,
    ),
    (
        "rod on a pin and a stop",
        "1:turn -> I:j(3*2^2/12)\n1:v -> I:m(3)\nSe:push(-1) -> turn\nstate th' = turn.f from 1\nstate y' = v.f\n\
         constraint pin: y - th = 0\nconstraint stop: th >= 0 (restitution = 0.5)\n",
        4.0,
    ),
    (
        "capacitors that a switch joins",
        "0:a -> C:c1(1e-6, e0 = 10)\n0:b -> C:c2(3e-6)\na -> 1:s -> b\ns -> Sw:key(on = t > 1)\n",
        2.0,
    ),
    (
        "block at a wall",
        "1:v -> I:m(2, f0 = 2)\nv -> R:pad(friction = 2)\nSe:pull(if t < 3 then 0 else -(t - 3)) -> v\n\
         state x' = v.f from 0\nconstraint wall: x <= 1.9 (restitution = 0)\n",
        7.0,
    ),
    (
        "stack",
        "Se:w1(-10) -> 1:v1 -> I:m1(1)\nSe:w2(-20) -> 1:v2 -> I:m2(2)\nstate x1' = v1.f from 0.5\n\
         state x2' = v2.f from 1\nconstraint floor: x1 >= 0 (restitution = 0.5)\n\
         constraint between: x2 - x1 >= 0.25 (restitution = 0.5)\n",
        12.0,
    ),
    (
        "more contacts than speeds",
        "1:a -> I:ma(1, f0 = 3)\n1:b -> I:mb(2)\n1:c -> I:mc(1)\nstate xa' = a.f from 0\nstate xb' = b.f from 1\n\
         state xc' = c.f from 2\nconstraint ab: xb - xa >= 1\nconstraint bc: xc - xb >= 1\n\
         constraint left: xa >= 0\nconstraint right: xc <= 2\n",
        1.0,
    ),
    (
        "library",
        "import std.mechanical\n1:u -> I:sledge(2 kg, f0 = 1)\n\
         u -> DryFriction:f(f_c = 1 N, f_s = 1.5 N) -> Sf:floor(0 m/s)\n\
         Se:pull(if t < 3 s then 0 N else 1.4 N) -> u\n1:a -> I:j1(1 kg.m2, f0 = 3)\n\
         a -> DryClutch:c(t_max = 1 N.m) -> 1:b -> I:j2(2 kg.m2)\n1:w -> I:j3(1 kg.m2, f0 = 3)\n\
         w -> DryBrake:brake(t_max = 1 N.m, press = 0.5)\n1:v -> I:m(1 kg, f0 = 1)\n\
         v -> HardStop:h(gap = 0.5 m, restitution = 0.5) -> Sf:wall(0 m/s)\n",
        8.0,
    ),
    (
        "check valve",
        "import std.hydraulic\nSe:pump(1e5*sin(3*t)) -> 1:pipe\npipe -> R:line(1e7)\npipe -> I:inertance(1e6)\n\
         pipe -> IdealCheckValve:valve(g = 1e-7, cracking = 2e4) -> 0:tank\ntank -> C:accumulator(1e-9, e0 = 0)\n\
         tank -> R:leak(1e9)\n",
        4.0,
    ),
    (
        "coils on a switch",
        "Se:src(10) -> 1:a\na -> R:ra(1)\na -> 0:n\n1:b -> I:lb(0.5)\n1:c -> I:lc(0.25)\na -> I:la(0.2)\nn -> b\n\
         n -> c\nb -> R:rb(2)\nc -> R:rc(3)\nn -> 1:short -> Sw:key(on = mod(t, 0.2) < 0.1)\nshort -> R:rs(0.5)\n",
        1.0,
    ),
    (
        "laws solved by iteration",
        "Se:src(5*sin(4*t)) -> 1:a\na -> R:r1(1)\na -> 0:n\nn -> R:cubic(f = e + e^3)\n\
         n -> 1:b -> R:d(0 <= f, 0 <= 0.3 - e)\nb -> 0:m\nm -> C:c1(0.1)\nm -> 1:x -> 0:k\n\
         x -> R:d2(0 <= f, 0 <= -e)\nk -> C:c2(0.2)\nk -> R:r2(3)\n",
        3.0,
    ),
    (
        "capacitors that leap",
        "Se:src(5*sin(4*t)) -> 1:a -> 0:n\na -> R:r1(1)\nn -> C:c1(0.1)\nn -> 1:b -> R:d(0 <= f, 0 <= 0.3 - e)\n\
         b -> 0:m\nm -> C:c2(0.3)\nm -> R:r2(3)\nm -> 1:x -> 0:k\nx -> Sw:s(on = mod(t, 0.5) < 0.2)\nk -> C:c3(0.2)\n\
         k -> R:r3(3)\n",
        3.0,
    ),
    (
        "sampled controller",
        "discrete u = 0\n1:v -> I:m(2, f0 = 1)\nv -> R:pad(friction = 0.5)\nSe:drive(u) -> v\nstate x' = v.f from 1\n\
         constraint wall: x >= -0.3 (restitution = 0.5)\nwhen every 50 ms { u = -8*x - 1*m.f }\n\
         when t > 3 { reset m.f = 1.5 }\n",
        6.0,
    ),
    (
        "slider-crank with a stop",
        "param r = 0.2, l = 0.5\nstate x' = s.f\nguess x = 0.69\nprefer crank.f\nstate phi' = w.f from 0.3\n\
         1:w -> I:crank(0.05, f0 = 6)\n1:s -> I:piston(1)\ns -> R:fr(friction = 0.5)\n\
         constraint rod: (x - r*cos(phi))^2 + (r*sin(phi))^2 = l^2\nconstraint stop: phi <= 2.0 (restitution = 0.6)\n",
        2.0,
    ),
];

/// All variables of a form against those of the minimal one: the greatest difference, and where.
fn miss(text: &str, to: f64, run: &Run) -> Result<(f64, String), String> {
    let model = model(text);
    let other = Run { stiffness: run.stiffness, ..run_of(run.form, to, 1e-12, &[]) };
    let mut minimal = values(&model, &run_of(Form::Minimal, to, 1e-12, &[]))?;
    // What a constraint is off is nothing to compare, and the last impulses of what comes to rest are chaotic: they count
    // beside the momenta.
    let greatest = |values: &[f64]| values.iter().fold(0.0f64, |most, v| most.max(v.abs()));
    let momenta = minimal.iter().filter(|(name, _)| name.ends_with(".p"));
    let momentum = momenta.fold(0.0, |most, (_, values)| greatest(values).max(most));
    let small = |name: &str, values: &[f64]| name.ends_with(".impulse") && greatest(values) < 1e-3 * momentum;
    minimal.retain(|name, values| !name.ends_with(".drift") && !small(name, values));
    Ok(apart(&minimal, &values(&model, &other)?))
}

#[test]
fn all_forms_agree() {
    let mut faults = Vec::new();
    for (name, text, to) in MACHINES {
        for form in FORMS.into_iter().filter(|form| *form != Form::Stiff) {
            match miss(text, to, &Run { form, ..Run::default() }) {
                Ok((miss, _)) if miss <= AGREES => {}
                Ok((miss, place)) => faults.push(format!("{name} {}: {place} is off by {miss:.1e}", form.name())),
                Err(why) => faults.push(format!("{name} {}: {}", form.name(), why.trim())),
            }
        }
    }
    assert!(faults.is_empty(), "{} faults\n{}", faults.len(), faults.join("\n"));
}

/// Springs in the places of constraints leave less open the stiffer they are, with order 1.
#[test]
fn springs_converge() {
    let pulled =
        "Se:weight(-10) -> 1:v -> I:m(1)\nSe:pull(5*t) -> v\nstate x' = v.f from 0\nconstraint floor: x >= 0\n";
    let geared = "Se:motor(2*sin(t)) -> 1:w1 -> I:j1(0.5)\nw1 -> TF:gear(f_out = 0.25) -> 1:w2 -> I:j2(3)\n\
                  w2 -> C:twist(k = 4)\nw2 -> R:pad(friction = 0.4, stiction = 0.7)\nstate th' = w1.f from 0\n\
                  constraint stop: th <= 0.6 (restitution = 0.3)\n";
    for (text, to) in [(pulled, 4.0), (geared, 10.0)] {
        let off = |stiffness: f64| {
            let run = Run { form: Form::Stiff, stiffness: Some(stiffness), ..Run::default() };
            miss(text, to, &run).unwrap_or_else(|e| panic!("{e}")).0
        };
        let (soft, stiff) = (off(1e6), off(1e7));
        assert!(soft < 1e-4 && stiff < 0.2 * soft, "{soft:.1e}, then {stiff:.1e}");
    }
}

/// How a form of a random machine compares.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Verdict {
    Same,
    Sensitive,
    /// The minimal form stops or is doubted.
    Without,
    Refused,
    Failed,
    Apart,
}

fn run_of(form: Form, to: f64, rtol: f64, names: &[String]) -> Run {
    // What bounces until it rests is chaotic: the same method meets the same impacts.
    let explicit = matches!(form, Form::Minimal | Form::Kane);
    let method = if explicit { Method::Radau } else { Method::Auto };
    let record = if names.is_empty() { Record::All } else { Record::Names(names.to_vec()) };
    Run { to, form, rtol, method, every: Some(to / 40.0), record, ..Run::default() }
}

/// What comes of a form of a random machine, beside the minimal form by the same method.
fn verdict((text, names): &Machine, to: f64, within: f64, form: Form) -> (Verdict, String) {
    const RTOL: f64 = 1e-9;
    let whole = model(text);
    let end = |model: &Model, form: Form, rtol: f64| -> Result<Vec<f64>, String> {
        let found = values(model, &run_of(form, to, rtol, names))?;
        Ok(names.iter().map(|name| *found[name].last().expect("a value")).collect())
    };
    let apart = |a: &[f64], b: &[f64]| a.iter().zip(b).fold(0.0f64, |most, (a, b)| most.max((a - b).abs()));
    let minimal = match end(&whole, Form::Minimal, RTOL).or_else(|_| end(&whole, Form::Minimal, 1e-12)) {
        Ok(minimal) => minimal,
        Err(why) => return (Verdict::Without, format!("minimal: {why}")),
    };
    let found = match end(&whole, form, RTOL).or_else(|_| end(&whole, form, 1e-12)) {
        Ok(found) => found,
        Err(why) if why.contains("this form") || why.contains("cannot be reset") => return (Verdict::Refused, why),
        Err(why) => return (Verdict::Failed, why),
    };
    if apart(&found, &minimal) <= within {
        return (Verdict::Same, String::new());
    }
    let told = format!("{found:?}, minimal {minimal:?}");
    // What a start that differs by next to nothing changes as much says nothing of forms.
    let beside = ["+ 1e-8", "- 1e-8"].map(|by| model(&text.replace("from 0.5\n", &format!("from 0.5 {by}\n"))));
    let moved = beside.iter().map(|m| end(m, Form::Minimal, RTOL)).chain([end(&whole, Form::Minimal, 1e-12)]);
    let sensitive = moved.into_iter().any(|other| other.is_ok_and(|other| apart(&other, &minimal) > within));
    (if sensitive { Verdict::Sensitive } else { Verdict::Apart }, told)
}

#[test]
fn some() {
    let mut faults = Vec::new();
    // In the last one scales of states came from rounding.
    for seed in (0..2).chain([553]) {
        for (kind, machine, within) in machines(seed) {
            for form in FORMS {
                let (verdict, told) = verdict(&machine, 4.0, within_of(form, within), form);
                if verdict != Verdict::Same {
                    faults.push(format!("{kind} {seed} {}: {verdict:?} {told}", form.name()));
                }
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// How near a form is to the minimal one. Springs leave something open.
fn within_of(form: Form, within: f64) -> f64 {
    if form == Form::Stiff { 100.0 * within } else { within }
}

/// As many as `GRAPHS` of each kind, from the seed `FROM` on, in all forms or one `FORM`; of one `KIND` if it is given.
#[test]
#[ignore = "a campaign"]
fn many() {
    let number = |name: &str| std::env::var(name).ok().and_then(|n| n.parse::<u64>().ok());
    let word = |name: &str| std::env::var(name).unwrap_or_default();
    let (from, count) = (number("FROM").unwrap_or(0), number("GRAPHS").unwrap_or(100));
    let (only, of) = (word("KIND"), word("FORM"));
    let mut counts: BTreeMap<(&str, &str, Verdict), usize> = BTreeMap::new();
    for seed in from..from + count {
        for (kind, machine, within) in machines(seed).into_iter().filter(|(kind, ..)| kind.starts_with(&only)) {
            for form in FORMS.into_iter().filter(|form| form.name().starts_with(&of)) {
                let (verdict, told) = verdict(&machine, 4.0, within_of(form, within), form);
                *counts.entry((form.name(), kind, verdict)).or_default() += 1;
                if verdict > Verdict::Without {
                    println!("{kind} {seed} {}: {verdict:?} {}", form.name(), told.trim());
                }
            }
        }
    }
    counts.iter().for_each(|((form, kind, verdict), count)| println!("{form} {kind} {verdict:?}: {count}"));
    assert!(counts.keys().all(|(_, _, verdict)| *verdict <= Verdict::Without));
}
