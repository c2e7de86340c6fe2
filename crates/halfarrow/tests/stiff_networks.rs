//! Published networks with implicit laws, and large stiff ones: values, balances, work.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use std::path::Path;

use halfarrow::{Method, Model, Record, Run, Simulated, Stage};

fn fault(name: &str) -> Model {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/faults").join(format!("{name}.bond"));
    Model::load(&path, &[]).unwrap_or_else(|error| panic!("{}", error.render(false)))
}

fn run(model: &Model, run: Run) -> Simulated {
    model.simulate(&run, &mut |_| true).unwrap_or_else(|error| panic!("{}", error.render(false)))
}

fn last(done: &Simulated, name: &str) -> f64 {
    *done.trace.column(name).expect("a column").values.last().expect("an end")
}

/// Water tube system of Koren and van Beek, 18 pipes, 17 hours; pressures of the buffers as in the Test Set for IVP Solvers.
#[test]
fn pipes_with_implicit_friction_come_to_their_end() {
    let record = Record::Names(["buffer5.q", "buffer8.q", "R1_2.e", "I1_2.f"].map(String::from).to_vec());
    let hours = 17.0;
    let done = run(&fault("tubes"), Run { to: 3600.0 * hours, record, ..Run::default() });
    assert!(done.report.evaluations < 12_000, "{} evaluations", done.report.evaluations);
    let capacity = 200.0 / (1e3 * 9.8);
    let volumes = [last(&done, "buffer5.q"), last(&done, "buffer8.q")];
    for (volume, pressure) in volumes.iter().zip([0.1111268591478108e6, 0.1111270045592387e6]) {
        assert!((volume / capacity - pressure).abs() < 1e-2, "{} Pa, not {pressure}", volume / capacity);
    }
    // At rest at first, so that the sign of each flow is rounding: a method that solves for its steps comes through that too.
    let radau = run(&fault("tubes"), Run { to: 3600.0 * hours, method: Method::Radau, ..Run::default() });
    assert!((last(&radau, "buffer5.q") - volumes[0]).abs() < 1e-4, "{}", last(&radau, "buffer5.q"));
    // What has flowed in and not out is in the buffers.
    let inflow = |h: f64| {
        let near = 1.0 - f64::cos(f64::exp(-h) - 1.0);
        near / 200.0 + near / 80.0 - h * h * (3.0 * h * h - 92.0 * h + 720.0) / 1e6
    };
    let (parts, width) = (2000, hours / 2000.0);
    let simpson = |i: usize| {
        let h = i as f64 * width;
        (inflow(h) + 4.0 * inflow(h + 0.5 * width) + inflow(h + width)) * width / 6.0
    };
    let kept = 3600.0 * (0..parts).map(simpson).sum::<f64>();
    let stored = volumes[0] + volumes[1] - 2.0 * 109_800.0 * capacity;
    assert!((stored - kept).abs() < 1e-4, "{stored} m3 stored of {kept}");
    // The law of Colebrook and White holds: one over the root of the friction factor, by the flow and by the pressure.
    let (e, f, area) = (last(&done, "R1_2.e"), last(&done, "I1_2.f"), std::f64::consts::FRAC_PI_4);
    let reynolds = f / (1.31e-6 * area);
    let root = (e * area * area / (1e3 * 1e3 * f * f)).sqrt();
    let law = 1.74 - 2.0 * (2.0 * 2e-4 + 18.7 / (reynolds * root)).log10();
    assert!(reynolds < 2300.0 || (1.0 / root - law).abs() < 1e-9, "{} {law}", 1.0 / root);
}

/// The laws of pipes that do not wait for each other are blocks of their own, of one unknown each.
#[test]
fn laws_that_do_not_depend_on_each_other_are_blocks_of_their_own() {
    let program = Stage::Program.show_model(&fault("tubes")).unwrap_or_else(|error| panic!("{}", error.render(false)));
    let mut laws: Vec<&str> = program
        .lines()
        .filter_map(|line| line.split_once(" = newton block of "))
        .map(|(unknowns, law)| {
            assert!(!unknowns.contains(','), "one unknown: {unknowns}");
            law
        })
        .collect();
    laws.sort_unstable();
    laws.dedup();
    assert_eq!(laws.len(), 18, "{laws:?}");
}

/// Transistor amplifier of Hairer and Wanner; voltages at 0.2 s as in the Test Set for IVP Solvers.
#[test]
fn the_transistor_amplifier_gives_its_published_values() {
    let y = [
        0.0,
        -0.5562145012262709e-2,
        3.006522471903042,
        2.849958788608128,
        2.926422536206241,
        2.704617865010554,
        2.761837778393145,
        4.770927631616772,
        1.236995868091548,
    ];
    for method in [Method::Auto, Method::Radau] {
        let record = Record::Names((1..=8).map(|k| format!("n{k}.e")).collect());
        let done = run(&fault("amplifier"), Run { to: 0.2, rtol: 1e-8, method, record, ..Run::default() });
        assert!(done.report.evaluations < 60_000, "{} evaluations", done.report.evaluations);
        for (k, y) in y.iter().enumerate().skip(1) {
            let found = last(&done, &format!("n{k}.e"));
            assert!((found - y).abs() < 1e-5, "{method:?}, node {k}: {found} V, not {y}");
        }
    }
}

/// A law that changes its branch with its own effort, at a flow of time that starts as rounding: it comes to its end, where the
/// pressure has settled at what the flow asks for.
#[test]
fn a_tube_whose_flow_starts_as_rounding_comes_to_its_end() {
    for method in [Method::Auto, Method::Radau] {
        let options = Run { to: 61_200.0, method, record: Record::All, ..Run::default() };
        let done = run(&fault("tube_standstill"), options);
        // Laminar all the way, and what has flowed stands in the buffer.
        let (pressure, flow) = (last(&done, "R1.e"), last(&done, "R1.f"));
        let laminar = 32.0 * 1.31e-3 * 1e3 * flow / std::f64::consts::FRAC_PI_4;
        assert!((pressure / laminar - 1.0).abs() < 1e-9, "{method:?}: {pressure}, {laminar}");
        let given = |t: f64| (1.0 - libm::cos(libm::exp(-t / 3600.0) - 1.0)) / 80.0;
        let (parts, length) = (20_000, 61_200.0 / 20_000.0);
        let filled: f64 = (0..parts).map(|k| given((f64::from(k) + 0.5) * length) * length).sum();
        let level = 109_800.0 + filled * 9.8e3 / 200.0;
        assert!((last(&done, "buffer.e") / level - 1.0).abs() < 1e-5, "{method:?}: {level}");
    }
}

/// Capacitors around one node: a row of the Jacobian reads every state.
fn star(branches: usize) -> Model {
    let mut text = "model Star\nparam g = 1\nSe:source(1) -> 1:s -> 0:hub -> C:C0(1)\ns -> R:R0(1)\n".to_string();
    for k in 1..=branches {
        text += &format!("hub -> 1:b{k} -> R:R{k}(f = g*(e + e^3))\nb{k} -> 0:n{k} -> C:C{k}(1e-4)\n");
    }
    Model::from_text("star.bond", &text, &[]).unwrap_or_else(|error| panic!("{}", error.render(false)))
}

#[test]
fn a_node_with_many_neighbours_is_no_burden() {
    let work = [40, 400].map(|branches| {
        let done = run(&star(branches), Run { to: 1.0, every: Some(1.0), method: Method::Bdf, ..Run::default() });
        // By symmetry all of them stand at the voltage of the middle in the end, to the flow that fills it.
        let (hub, outer) = (last(&done, "C0.q"), last(&done, "C7.q") / 1e-4);
        assert!((hub - outer).abs() < 1e-3, "{hub} {outer}");
        assert_eq!(done.report.tangents, 0, "derivatives are had at once");
        done.report.evaluations
    });
    assert!(work[1] < 2 * work[0], "{work:?}");
}

/// A ladder of resistors and capacitors, charged from one end.
fn ladder(sections: usize) -> Model {
    let mut text = "model Ladder\nparam r = 1, c = 1e-3\nSe:source(1) -> 1:s1\n".to_string();
    for k in 1..=sections {
        if k > 1 {
            text += &format!("n{} -> 1:s{k}\n", k - 1);
        }
        text += &format!("s{k} -> R:R{k}(r)\ns{k} -> 0:n{k} -> C:C{k}(c)\n");
    }
    Model::from_text("ladder.bond", &text, &[]).unwrap_or_else(|error| panic!("{}", error.render(false)))
}

#[test]
fn a_large_stiff_ladder_hands_over_soon() {
    let done = run(&ladder(300), Run { to: 1.0, every: Some(0.5), ..Run::default() });
    assert!(done.report.stiff);
    assert!(
        done.report.steps < 280 && done.report.evaluations < 520,
        "{:?}",
        (done.report.steps, done.report.evaluations)
    );
    // The wave of diffusion: the charge of a half-infinite ladder grows with the root of time, 2 sqrt(t c/(π r)).
    let charge: f64 = (1..=300).map(|k| last(&done, &format!("C{k}.q"))).sum();
    let endless = 2.0 * (1e-3 / std::f64::consts::PI).sqrt();
    assert!((charge / endless - 1.0).abs() < 0.02, "{charge} C, {endless} C in the limit of fine sections");
}
