//! Values over many decades, and machines that start where a modulus vanishes: what is computed is right to nearly all
//! digits, whatever the order in which a model is written.
#![allow(clippy::disallowed_methods, clippy::excessive_precision, reason = "values to compare with")]

use std::path::Path;

use halfarrow::{Error, Linearize, Model, Record, Run, Simulated, Stability};

fn text_of(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/faults").join(format!("{name}.bond"));
    std::fs::read_to_string(path).expect("a model")
}

fn model(text: &str) -> Model {
    Model::from_text("test.bond", text, &[]).unwrap_or_else(|e| panic!("{}", e.render(false)))
}

fn tried(text: &str, to: f64, names: &[&str]) -> Result<Simulated, Error> {
    let record = Record::Names(names.iter().map(|n| n.to_string()).collect());
    model(text).simulate(&Run { to, rtol: 1e-10, record, ..Run::default() }, &mut |_| true)
}

/// Runs a model; the last values of what is recorded.
fn last(text: &str, to: f64, names: &[&str]) -> Vec<f64> {
    let done = tried(text, to, names).unwrap_or_else(|e| panic!("{text}\n{}", e.render(false)));
    let audit = &done.report.audit;
    assert!(audit.residual.as_ref().is_none_or(|miss| miss.value < 1e-11), "{audit:?}");
    names.iter().map(|n| *column(&done, n).last().expect("a sample")).collect()
}

fn column<'a>(done: &'a Simulated, name: &str) -> &'a [f64] {
    &done.trace.columns.iter().find(|c| c.name == name).expect("a column").values
}

fn near(found: f64, wanted: f64, tolerance: f64) {
    assert!((found - wanted).abs() <= tolerance * wanted.abs(), "{found} is not {wanted}");
}

/// Imaginary parts above 0, ascending, and real parts, with the verdict. References: `faults/raw.py`.
fn poles(name: &str) -> (Vec<f64>, Vec<f64>, Stability) {
    let told = model(&text_of(name)).linearize(&Linearize::default()).unwrap_or_else(|e| panic!("{}", e.render(false)));
    let mut turning: Vec<f64> = told.poles.iter().map(|p| p[1]).filter(|im| *im > 0.0).collect();
    turning.sort_by(f64::total_cmp);
    (turning, told.poles.iter().map(|p| p[0]).collect(), told.stability)
}

#[test]
fn poles_over_ten_decades_have_their_digits() {
    let (turning, real, stability) = poles("lossless_unstable");
    let wanted = [3.1219654760395028092e-9, 0.0011510968877780019193, 0.38866929553905173608, 835.75117293435574811];
    assert_eq!(turning.len(), wanted.len());
    turning.iter().zip(wanted).for_each(|(found, wanted)| near(*found, wanted, 1e-9));
    near(turning[3], wanted[3], 1e-13);
    assert!(real.iter().all(|re| re.abs() < 1e-12), "{real:?}");
    assert_eq!(stability, Stability::Marginal);

    let (turning, _, stability) = poles("false_singular");
    assert_eq!((turning.len(), stability), (1, Stability::Marginal));
    near(turning[0], 8404.0484253544320615, 1e-13);

    let (_, real, stability) = poles("one_pole_off");
    assert_eq!((real.len(), stability), (1, Stability::Asymptotic));
    near(real[0], -6.7164253287510917131e-17, 1e-13);
}

/// Every law of a net of resistors, transformers and gyrators over many decades. References: `faults/raw.py`.
#[test]
fn laws_hold_over_many_decades() {
    let small = [("R8x.f", 1.0), ("R8x.e", 1.0), ("R3x.f", -1.0), ("R7x.e", 4e-6), ("R7x.f", 8e-12)];
    let large = [
        ("R1x.e", 18012800.0),
        ("R2x.f", -0.16580467142807195),
        ("R3x.e", 4.4311058344010836e-11),
        ("R4x.f", 0.0008583877994269638),
        ("R5x.e", -1.6231159548506481e-06),
        ("R6x.e", 3.8688),
        ("R7x.f", 6.916513096916651e-08),
        ("R7x.e", 0.03513588653233659),
        ("R8x.f", 0.11796407183741808),
    ];
    for (name, wanted) in [("wrong_flow", &small[..]), ("wrong_flow_big", &large)] {
        let names: Vec<&str> = wanted.iter().map(|w| w.0).collect();
        let found = last(&text_of(name), 0.1, &names);
        found.iter().zip(wanted).for_each(|(found, (_, wanted))| near(*found, *wanted, 1e-12));
    }
}

/// The causality of a resistor is chosen by what it costs, whatever the resistances are.
#[test]
fn resistors_over_all_decades_share_what_drives_them() {
    for decade in (-12..=12).step_by(3) {
        let r = 10f64.powi(decade);
        let text = format!(
            "model Shared\nSe:s(1) -> 1:a -> R:ra(1)\na -> TF:t(1000) -> 0:n -> R:rb({r:e})\nn -> GY:g(0.001) -> 1:b -> R:rc(1)\n\
             b -> 0:m -> R:rd(1)\n"
        );
        let found = last(&text, 0.1, &["ra.f", "rb.e"]);
        // Behind the gyrator r²/(1 + 1), in parallel with rb; seen through the transformer its square times that.
        let behind = 1.0 / (1.0 / r + 2.0 / 1e-6);
        near(found[0], 1.0 / (1.0 + 1e6 * behind), 1e-12);
        near(found[1], 1e3 * behind * found[0], 1e-12);
    }
}

/// Numbers without a pattern, the same every time.
struct Dice(u64);

impl Dice {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 33) as usize % n
    }

    /// A value over twelve decades.
    fn value(&mut self) -> String {
        format!("{}e{}", 1 + self.below(999), self.below(11) as i32 - 7)
    }
}

/// A tree of junctions with a ring now and then, transformers and gyrators in between, and these elements on it.
fn random_graph(seed: u64, kinds: &[&str]) -> String {
    let mut dice = Dice(seed);
    let n = 2 + dice.below(5);
    let (mut text, mut bonds) = ("model Random\n".to_string(), String::new());
    (0..n).for_each(|i| text += &format!("{}:n{i}\n", dice.below(2)));
    let rings = dice.below(5).saturating_sub(2);
    for k in 1..n + rings {
        let (a, b) = if k < n { (k, dice.below(k)) } else { (k % n, (k % n + 1 + dice.below(n - 1)) % n) };
        match dice.below(5) {
            0 => bonds += &format!("n{a} -> n{b}\n"),
            kind => {
                text += &format!("{}:t{k}({})\n", ["TF", "GY"][kind % 2], dice.value());
                bonds += &format!("n{a} -> t{k} -> n{b}\n");
            }
        }
    }
    for (j, kind) in (0..3 + dice.below(5)).map(|j| (j, kinds[dice.below(kinds.len())])).collect::<Vec<_>>() {
        text += &format!("{kind}:x{j}({})\n", dice.value());
        let (node, source) = (dice.below(n), kind.starts_with('S'));
        bonds += &if source { format!("x{j} -> n{node}\n") } else { format!("n{node} -> x{j}\n") };
    }
    text + &bonds
}

#[test]
fn laws_hold_in_random_nets_over_many_decades() {
    let mut done = 0;
    for seed in 0..150 {
        let text = random_graph(seed, &["R", "R", "R", "Se", "Sf"]);
        // Sources may contradict each other, or nothing may determine a flow: that is said, and not counted here.
        let Ok(model) = Model::from_text("test.bond", &text, &[]) else { continue };
        let Ok(ran) = model.simulate(&Run { to: 0.1, ..Run::default() }, &mut |_| true) else { continue };
        let missed = ran.report.audit.residual.as_ref().map_or(0.0, |miss| miss.value);
        assert!(missed < 1e-7, "{missed}: {text}");
        done += 1;
    }
    assert!(done > 60, "{done}");
}

/// Without losses every pole is on the imaginary axis.
#[test]
fn random_graphs_without_losses_have_no_damping() {
    let mut done = 0;
    for seed in 1000..1150 {
        let text = random_graph(seed, &["I", "C"]);
        let Ok(model) = Model::from_text("test.bond", &text, &[]) else { continue };
        let told = model.linearize(&Linearize::default()).unwrap_or_else(|e| panic!("{text}{}", e.render(false)));
        if told.poles.is_empty() {
            continue;
        }
        let most = told.poles.iter().map(|p| libm::hypot(p[0], p[1])).fold(0.0, f64::max);
        assert!(told.poles.iter().all(|p| p[0].abs() <= 1e-10 * most), "{:?} {text}", told.poles);
        assert_eq!(told.stability, Stability::Marginal, "{:?} {text}", told.poles);
        done += 1;
    }
    assert!(done > 60, "{done}");
}

/// `n` windows in a row: upright rods of 1 m and 1 kg that stand on the floor, joined at their tops by level ones, so
/// that half of the moduli are 0 at the start. `turn`: which of nodes, bonds and states stand in reverse order.
fn windows(n: usize, by_constraint: bool, turn: usize) -> String {
    let (mut nodes, mut bonds, mut states, mut constraints) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for k in 0..=n {
        let start = if k == 0 { ", f0 = -1" } else { "" };
        nodes.extend([format!("1:wa{k}"), format!("I:ia{k}(m*l^2/3{start})")]);
        nodes.push(format!("Se:ga{k}(-m*g*l/2*cos(a{k}))"));
        bonds.extend([format!("wa{k} -> ia{k}"), format!("ga{k} -> wa{k}")]);
        states.push(format!("state a{k}' = wa{k}.f from pi/2"));
    }
    for k in 0..n {
        let next = k + 1;
        states.push(format!("state b{k}' = wb{k}.f{}", if by_constraint { "" } else { " from 0" }));
        nodes.extend([format!("1:wb{k}"), format!("I:ib{k}(m*l^2/12)"), format!("Se:gb{k}(-m*g)")]);
        bonds.extend([format!("wb{k} -> ib{k}"), format!("gb{k} -> vy{k}")]);
        for (axis, f, minus, back) in [("x", "sin", "-", ""), ("y", "cos", "", "-")] {
            let at = format!("{axis}{k}");
            nodes.extend([format!("TF:k{at}({minus}l*{f}(a{k}))"), format!("TF:d{at}({minus}l/2*{f}(b{k}))")]);
            nodes.extend([format!("0:p{at}"), format!("1:v{at}"), format!("I:m{at}(m)")]);
            bonds.extend([format!("wa{k} -> k{at} -> p{at} -> v{at} -> m{at}"), format!("wb{k} -> d{at} -> p{at}")]);
            if by_constraint {
                let f = if axis == "x" { "cos" } else { "sin" };
                let width = if axis == "x" { " - l" } else { "" };
                constraints.push(format!("constraint c{at}: l*{f}(a{k}) + l*{f}(b{k}) - l*{f}(a{next}){width} = 0"));
                continue;
            }
            nodes.extend([format!("0:q{at}"), format!("TF:t{at}({minus}l*{f}(a{k}))")]);
            nodes.extend([format!("TF:u{at}({minus}l*{f}(b{k}))"), format!("TF:w{at}({back}l*{f}(a{next}))")]);
            bonds.extend([format!("wa{k} -> t{at} -> q{at}"), format!("wb{k} -> u{at} -> q{at}")]);
            bonds.push(format!("wa{next} -> w{at} -> q{at}"));
        }
    }
    for (place, part) in [&mut nodes, &mut bonds, &mut states].into_iter().enumerate() {
        if turn >> place & 1 == 1 {
            part.reverse();
        }
    }
    let all: Vec<String> = [states, nodes, bonds, constraints].concat();
    format!("model Windows\nconst g = 9.81, l = 1, m = 1\n{}\n", all.join("\n"))
}

/// All uprights turn alike, so that energy tells their speed at every angle.
fn speed_of_windows(n: usize, angle: f64) -> f64 {
    let n = n as f64;
    let (inertia, weight) = ((n + 1.0) / 3.0 + n, 9.81 * ((n + 1.0) / 2.0 + n));
    -(1.0 + 2.0 * weight / inertia * (1.0 - libm::sin(angle))).sqrt()
}

#[test]
fn four_bars_in_a_row_start_where_moduli_vanish() {
    for (n, by_constraint, turn) in
        [(2, true, 0), (2, true, 7), (3, true, 1), (3, false, 1), (4, false, 3), (4, false, 0)]
    {
        let names = ["a0".to_string(), format!("a{n}"), "wa0.f".to_string(), format!("wa{n}.f")];
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let found = last(&windows(n, by_constraint, turn), 0.2, &names);
        assert!(found[0] < 1.4 && (found[0] - found[1]).abs() < 1e-9, "{found:?}");
        near(found[2], speed_of_windows(n, found[0]), 1e-8);
        near(found[3], found[2], 1e-8);
    }
}

const LEVEL: &str = "model Level \"a rod on two guides, level at the start\"
const l = 2, g = 9.81
state x' = along.f from l
state y' = up.f from 0
1:along -> I:mx(1)
1:up -> I:my(1)
Se:weight(-g) -> up
Se:push(0.5) -> along
";

#[test]
fn a_rod_that_starts_level_has_its_multiplier_whatever_is_preferred() {
    let by_constraint = "constraint K1: x^2 + y^2 - l^2 = 0\n";
    let by_transformers = "along -> TF:tx(2*x) -> 0:K1\nup -> TF:ty(2*y) -> K1\n";
    for rod in [by_constraint, by_transformers] {
        let reaction = |done: &Simulated| column(done, "K1.e").to_vec();
        let mut before: Option<Vec<f64>> = None;
        for prefer in ["", "prefer along.f\n", "prefer up.f\n"] {
            let text = format!("{LEVEL}{rod}{prefer}");
            let run =
                Run { to: 0.3, every: Some(0.1), rtol: 1e-11, record: names(&["x", "y", "K1.e"]), ..Run::default() };
            let done = model(&text).simulate(&run, &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false)));
            // Level, the push along the rod is all that the joint carries: 0.5 and 2 x λ balance each other.
            near(reaction(&done)[0].abs(), 0.125, 1e-13);
            let (x, y) = (column(&done, "x")[3], column(&done, "y")[3]);
            near(libm::hypot(x, y), 2.0, 1e-9);
            match &before {
                None => before = Some(reaction(&done)),
                Some(before) => before.iter().zip(reaction(&done)).for_each(|(a, b)| near(b, *a, 1e-8)),
            }
        }
    }
}

fn names(names: &[&str]) -> Record {
    Record::Names(names.iter().map(|n| n.to_string()).collect())
}

#[test]
fn a_preference_that_cannot_be_met_is_told() {
    let rod = "constraint K1: x^2 + y^2 - l^2 = 0\n";
    let warned = |prefer: &str| -> Vec<String> {
        let model = model(&format!("{LEVEL}{rod}{prefer}"));
        let found = model.check().unwrap_or_else(|e| panic!("{}", e.render(false)));
        let all = found.diagnostics.0.iter().map(|d| format!("{} {}", d.code.name, d.title));
        all.filter(|told| told.starts_with("C009")).collect()
    };
    assert_eq!(warned("prefer along.f\n"), ["C009 along.f does not stay independent"]);
    assert_eq!(warned("prefer up.f\n"), Vec::<String>::new());
}

/// Of rates without a storage of their own those stay independent that are preferred, in whatever order they stand in the model.
#[test]
fn a_preference_holds_among_rates_without_storages() {
    let text = "model Rates
1:a -> TF:ta(cos(qa)) -> 0:s
1:b -> TF:tb(cos(qb)) -> s
1:c -> TF:tc(cos(qc)) -> s
Sf:rest(0) -> s
a -> TF:ra(2 + cos(qa)) -> 0:na -> I:ia(1)
b -> TF:rb(2 + cos(qb)) -> 0:nb -> I:ib(1)
c -> TF:rc(2 + cos(qc)) -> 0:nc -> I:ic(1)
state qa' = a.f
state qb' = b.f
state qc' = c.f
";
    for (prefer, independent) in
        [("", ["a.f", "b.f"]), ("prefer c.f, b.f\n", ["b.f", "c.f"]), ("prefer c.f\n", ["a.f", "c.f"])]
    {
        let model = model(&format!("{text}{prefer}"));
        let states = model.equations(halfarrow::Form::Minimal).unwrap_or_else(|e| panic!("{}", e.render(false))).states;
        let mut rates: Vec<_> = states.into_iter().map(|s| s.name).filter(|name| name.ends_with(".f")).collect();
        rates.sort();
        assert_eq!(rates, independent, "{prefer}");
        let found = model.check().unwrap_or_else(|e| panic!("{}", e.render(false)));
        assert!(found.diagnostics.0.iter().all(|d| d.code.name != "C009"), "{prefer}");
    }
}

/// All rods of a window lie on the floor: it may fold either way, and no choice of variables helps.
#[test]
fn a_truly_singular_position_says_what_vanishes() {
    let flat = windows(1, false, 0).replace("from pi/2", "from 0");
    let Err(error) = tried(&flat, 0.1, &["a0"]) else { panic!("there is no motion to compute") };
    let told = error.render(false);
    assert!(told.contains("`prefer`") && told.contains("vanishes there"), "{told}");
    assert!(told.len() < 600, "{told}");
}

/// Two masses of 1 kg that move alike, one of them pushed by `t²`: each gets half of it, through the multiplier.
#[test]
fn the_rate_of_a_multiplier_is_that_of_an_effort() {
    let text = "model Coupled\nSe:push(t^2) -> 1:a -> I:m(1)\nSe:none(0) -> 1:b -> I:n(1)\nconstraint c: m.f = n.f\n\
                output rate = c.e'\noutput twice = 2*c.e\n";
    let found = last(text, 1.0, &["rate", "twice"]);
    near(found[0].abs(), 1.0, 1e-12);
    near(found[0], found[1], 1e-12);
}
