//! Linear models against closed forms, and what must hold for all of them.

use std::fs;
use std::path::{Path, PathBuf};

use halfarrow::{Error, Linearize, LinearizeReport, Model, Point, Problem};

fn model(text: &str) -> Model {
    Model::from_text("test.bond", text, &[]).unwrap_or_else(|e| panic!("{}", e.render(false)))
}

fn linearized(model: &Model, wanted: &Linearize) -> LinearizeReport {
    model.linearize(wanted).unwrap_or_else(|e| panic!("{}", e.render(false)))
}

fn at(point: Point) -> Linearize {
    Linearize { at: point, ..Linearize::default() }
}

fn folders() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models");
    let mut all: Vec<PathBuf> = fs::read_dir(root).expect("models/").map(|e| e.expect("a folder").path()).collect();
    all.retain(|path| path.join("model.bond").is_file());
    all.sort();
    all
}

fn near(found: f64, wanted: f64, tolerance: f64) {
    assert!((found - wanted).abs() <= tolerance * wanted.abs().max(1e-300), "{found} is not {wanted}");
}

/// Poles with an imaginary part of at least 0, by real, then imaginary part.
fn upper(report: &LinearizeReport) -> Vec<[f64; 2]> {
    report.poles.iter().copied().filter(|p| p[1] >= 0.0).collect()
}

const CIRCUIT: &str = "model Circuit
param L = 2 mH, C = 50 uF, R = 3 ohm
input u : V = 0
Se:supply(u) -> 1:loop -> I:coil(L)
loop -> C:cap(C)
loop -> R:load(R)
output i = loop.f : A
";

#[test]
fn a_circuit_has_the_poles_of_its_polynomial() {
    let report = linearized(&model(CIRCUIT), &Linearize { symbolic: true, ..at(Point::Start) });
    let (l, c, r) = (2e-3, 50e-6, 3.0);
    let pole = upper(&report)[0];
    near(pole[0], -r / (2.0 * l), 1e-12);
    near(pole[1], (1.0 / (l * c) - (r / (2.0 * l)) * (r / (2.0 * l))).sqrt(), 1e-12);
    near(report.modes[0].natural_frequency, (1.0 / (l * c)).sqrt(), 1e-12);
    near(report.modes[0].damping, r / 2.0 * (c / l).sqrt(), 1e-12);
    assert!(report.stable);
    // i/u = C s / (L C s^2 + R C s + 1): a zero at the origin.
    let zeros = report.zeros.clone().expect("zeros");
    assert!(zeros.len() == 1 && size(zeros[0]) < 1e-6 * report.modes[0].natural_frequency, "{zeros:?}");
    let transfer = &report.symbolic.as_ref().expect("symbols").transfer[0];
    assert_eq!(transfer.text, "(C s) / (L C s² + C R s + 1)");
    let resonance = report.transfer([0.0, (1.0 / (l * c)).sqrt()]).expect("no pole")[0][0];
    near(resonance[0], 1.0 / r, 1e-9);
    assert_eq!((report.controllability.rank, report.controllability.structural_rank), (Some(2), Some(2)));
    assert_eq!((report.observability.rank, report.observability.structural_rank), (Some(2), Some(2)));
}

/// Masses in a row, joined by springs with dampers: what a force at the first does to the speed of the last passes all
/// joints but the one to the ground, and only where a joint carries nothing (s = -k/d) is it lost. At rest the last one
/// stands still, whatever the force.
#[test]
fn a_row_of_masses_loses_what_a_joint_does_not_carry() {
    for decades in [1.0, 4.0, 9.0] {
        for seed in 0..12_u32 {
            let mut noise = 17 * seed + 1;
            let mut drawn = || {
                noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                libm::pow(10.0, decades * (f64::from(noise) / f64::from(u32::MAX) - 0.5))
            };
            let joints = 2 + seed as usize % 3;
            let mut text = "model Row\ninput F : N = 0\nSe:force(F) -> v0\n1:v0 -> C:s(k = 2 N/m)\n".to_string();
            let mut wanted = vec![0.0];
            text += &format!("v0 -> I:m0({})\n", drawn());
            for i in 1..=joints {
                let (k, d) = (drawn(), drawn());
                wanted.push(-k / d);
                text += &format!("v{} -> 0:j{i} -> 1:v{i} -> I:m{i}({})\nj{i} -> 1:g{i}\n", i - 1, drawn());
                text += &format!("g{i} -> C:s{i}(k = {k})\ng{i} -> R:d{i}({d})\n");
            }
            text += &format!("output y = v{joints}.f\n");
            let report = linearized(&model(&text), &at(Point::Start));
            wanted.sort_by(f64::total_cmp);
            let found = report.zeros.expect("zeros");
            assert_eq!(found.len(), wanted.len(), "{decades} decades, {seed}: {found:?} is not {wanted:?}");
            for (found, wanted) in found.iter().zip(&wanted) {
                let off = (found[0] - wanted).abs().max(found[1].abs());
                assert!(off <= 1e-7 * wanted.abs(), "{decades} decades, {seed}: {found:?} is not {wanted}");
            }
            let (order, reached) = (report.controllability.order, report.controllability.rank);
            assert_eq!((reached, report.observability.rank), (Some(order), Some(order)), "{decades} decades, {seed}");
        }
    }
}

#[test]
fn a_motor_has_the_gain_and_the_poles_of_its_data() {
    let motor = model(
        "model Motor
param R = 1 ohm, L = 2 mH, k = 0.05 N.m/A, J = 0.01 kg.m2, b = 0.003 N.m.s
Se:supply(0 V) -> 1:loop -> I:coil(L)
loop -> R:winding(R)
loop -> GY:torque(k) -> 1:axle -> I:rotor(J)
axle -> R:bearing(b)
output speed = axle.f : rad/s
",
    );
    // No input is declared: the source is one.
    let report = linearized(&motor, &Linearize { symbolic: true, ..at(Point::Equilibrium) });
    assert_eq!(report.inputs[0].name, "supply");
    let (r, l, k, j, b) = (1.0_f64, 2e-3, 0.05, 0.01, 0.003);
    let (trace, product) = (r / l + b / j, (r * b + k * k) / (l * j));
    let root = (trace * trace / 4.0 - product).sqrt();
    near(report.poles[0][0], -trace / 2.0 - root, 1e-12);
    near(report.poles[1][0], -trace / 2.0 + root, 1e-11);
    near(report.transfer([0.0, 0.0]).expect("no pole")[0][0][0], k / (r * b + k * k), 1e-12);
    assert_eq!(report.zeros, Some(vec![]));
    let transfer = &report.symbolic.as_ref().expect("symbols").transfer[0];
    assert_eq!(transfer.numerator, ["k"]);
    assert_eq!(transfer.denominator.len(), 3);
}

#[test]
fn a_pendulum_swings_below_and_falls_above() {
    let text = |start: f64| {
        format!(
            "model Pendulum
param J = 0.3 kg.m2, M = 2 kg, a = 0.75 m, g = 9.81 m/s2
state phi' = w.f from {start} rad
1:w -> I:IJ(J)
w -> MTF:MTFx(-a*sin(phi)) -> 0:n0x -> 1:n1u -> I:Iu(M)
ZC:ZCx -> n0x
w -> MTF:MTFy(a*cos(phi)) -> 0:n0y -> 1:n1v -> I:Iv(M)
ZC:ZCy -> n0y
Se:Se(-M*g) -> n1v
output x = phi : rad
"
        )
    };
    let rate = (2.0 * 9.81 * 0.75 / (0.3 + 2.0 * 0.75 * 0.75_f64)).sqrt();
    let below = linearized(&model(&text(-1.0)), &at(Point::Equilibrium));
    near(upper(&below)[0][1], rate, 1e-9);
    assert!(upper(&below)[0][0].abs() < 1e-9 * rate && !below.stable);
    let above = linearized(&model(&text(1.5)), &at(Point::Equilibrium));
    near(above.poles[0][0], -rate, 1e-9);
    near(above.poles[1][0], rate, 1e-9);
    let phi = above.states.iter().find(|s| s.name == "phi").expect("the angle");
    near(phi.value, std::f64::consts::FRAC_PI_2, 1e-9);
}

#[test]
fn a_quarter_car_at_rest_is_a_chain_of_two_masses() {
    let folder = folders().into_iter().find(|f| f.ends_with("quarter_car")).expect("the model");
    let report = linearized(&Model::load(&folder.join("model.bond"), &[]).expect("a model"), &at(Point::Equilibrium));
    let (ms, mu, ks, kt) = (320.0_f64, 40.0, 18e3, 190e3);
    // The cubic damper does nothing at rest.
    let half = (ms * (kt + ks) + mu * ks) / (2.0 * ms * mu);
    let root = (half * half - ks * kt / (ms * mu)).sqrt();
    let mut frequencies: Vec<f64> = upper(&report).iter().map(|p| p[1]).collect();
    frequencies.sort_by(f64::total_cmp);
    near(frequencies[0], (half - root).sqrt(), 1e-9);
    near(frequencies[1], (half + root).sqrt(), 1e-9);
}

#[test]
fn matrices_in_symbols_are_those_in_numbers_on_all_linear_models() {
    let mut compared = 0;
    for folder in folders() {
        let model = Model::load(&folder.join("model.bond"), &[]).expect("a model");
        if model.loops().expect("loops").state_matrix.is_none() {
            continue;
        }
        let wanted = Linearize { symbolic: true, ..at(Point::Start) };
        // Some outputs need the rate of an input; those models are asked for their states.
        let report = match model.linearize(&wanted) {
            Ok(report) => report,
            Err(_) => {
                let states = model.equations(halfarrow::Form::Minimal).expect("equations").states;
                let outputs = Some(states.into_iter().map(|s| s.name).collect());
                match model.linearize(&Linearize { outputs, ..wanted }) {
                    Ok(report) => report,
                    Err(error) => {
                        println!("{}: {}", folder.display(), error.render(false));
                        continue;
                    }
                }
            }
        };
        let symbolic = report.symbolic.as_ref().expect("symbols");
        for transfer in &symbolic.transfer {
            compared += 1;
            let (output, input) = (place(&report.outputs, &transfer.output), place(&report.inputs, &transfer.input));
            let fastest = report.poles.iter().map(|p| size(*p)).fold(1e-3, f64::max);
            for s in [[0.3 * fastest, 0.7 * fastest], [-0.2 * fastest, 1.1 * fastest]] {
                let (above, below) = (value(&transfer.numerator_values, s), value(&transfer.denominator_values, s));
                let numbers = report.transfer(s).expect("no pole")[output][input];
                let symbols = divided(above, below);
                let apart = size([numbers[0] - symbols[0], numbers[1] - symbols[1]]);
                let whole = size(numbers).max(1e-12);
                assert!(apart < 1e-9 * whole, "{}: {} {numbers:?} {symbols:?}", folder.display(), transfer.text);
            }
            // Poles are where the denominator vanishes.
            for pole in &report.poles {
                let terms = transfer.denominator_values.iter().rev().enumerate();
                let most: f64 = terms.map(|(k, c)| c.abs() * libm::pow(size(*pole), k as f64)).sum();
                let left = value(&transfer.denominator_values, *pole);
                assert!(size(left) <= 1e-9 * most, "{}: {pole:?} {left:?} of {most}", folder.display());
            }
        }
    }
    assert!(compared > 40, "only {compared}");
}

fn place(list: &[halfarrow::Terminal], name: &str) -> usize {
    list.iter().position(|t| t.name == name).expect("it is there")
}

fn size(z: [f64; 2]) -> f64 {
    libm::hypot(z[0], z[1])
}

fn times(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]]
}

fn divided(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    let size = b[0] * b[0] + b[1] * b[1];
    let product = times(a, [b[0], -b[1]]);
    [product[0] / size, product[1] / size]
}

/// A polynomial, highest power first.
fn value(coefficients: &[f64], s: [f64; 2]) -> [f64; 2] {
    coefficients.iter().fold([0.0, 0.0], |sum, c| {
        let [re, im] = times(sum, s);
        [re + c, im]
    })
}

const TWINS: &str = "model Twins
param r1 = 1 ohm, r2 = 1 ohm, c1 = 1 F, c2 = 1 F
input u : V = 0
Se:supply(u) -> 0:rail -> 1:a -> R:r1(r1)
a -> C:c1(c1)
rail -> 1:b -> R:r2(r2)
b -> C:c2(c2)
output v = c1.e : V
";

#[test]
fn structure_and_numbers_differ_where_parameters_are_special() {
    let report = linearized(&model(TWINS), &Linearize::default());
    let control = &report.controllability;
    assert_eq!((control.rank, control.structural_rank), (Some(1), Some(2)));
    assert!(control.note.as_ref().is_some_and(|note| note.contains("special")), "{control:?}");
    // One capacitor does not act on the other: no path leads from it to the output.
    let observe = &report.observability;
    assert_eq!((observe.rank, observe.structural_rank), (Some(1), Some(1)));
    assert_eq!(observe.unattained, ["c2"]);
    let other = linearized(&model(&TWINS.replace("c2 = 1 F", "c2 = 2 F")), &Linearize::default());
    assert_eq!((other.controllability.rank, other.controllability.structural_rank), (Some(2), Some(2)));
}

#[test]
fn capacitors_in_series_are_not_controllable_in_structure() {
    // The charge between two capacitors stays: one of them cannot take derivative causality by the source alone.
    let report = linearized(
        &model(
            "model Series
input i : A = 0
Sf:pump(i) -> 1:loop -> C:a(1)
loop -> C:b(2)
loop -> R:r(1)
output v = a.e : V
",
        ),
        &Linearize::default(),
    );
    let control = &report.controllability;
    assert!(control.structural_rank < control.structural_order, "{control:?}");
}

#[test]
fn matrices_along_a_run_and_what_is_refused() {
    let folder = folders().into_iter().find(|f| f.ends_with("quarter_car")).expect("the model");
    let car = Model::load(&folder.join("model.bond"), &[]).expect("a model");
    let series = vec![("road".to_string(), folder.join("input.csv").into())];
    let moving = linearized(&car, &Linearize { at: Point::Time(0.6), series, ..Linearize::default() });
    assert!(moving.states.iter().any(|s| s.rate.abs() > 1e-3));
    assert!(moving.notes.iter().any(|n| n.contains("not at rest")), "{:?}", moving.notes);
    // The damper works once it moves.
    assert!(moving.modes.iter().any(|m| m.damping > 1e-4), "{:?}", moving.modes);
    let late = CIRCUIT.replace("Se:supply(u)", "Se:supply(delay(u, 0.1))");
    assert!(matches!(model(&late).linearize(&Linearize::default()), Err(Error::Usage(Problem::NoMatrices { .. }))));
    let unknown = Linearize { inputs: Some(vec!["nothing".into()]), ..Linearize::default() };
    assert!(matches!(car.linearize(&unknown), Err(Error::Usage(Problem::UnknownInput { .. }))));
    let unknown = Linearize { outputs: Some(vec!["nothing".into()]), ..Linearize::default() };
    assert!(matches!(car.linearize(&unknown), Err(Error::Usage(Problem::UnknownVariable { .. }))));
}

#[test]
fn plots_are_of_finite_numbers() {
    let report = linearized(&model(CIRCUIT), &Linearize::default());
    for picture in [report.bode(), report.nyquist()] {
        assert!(picture.svg.contains("class=\"curve\"") && !picture.svg.contains("NaN"));
    }
    let phases = report.responses()[0].phases();
    assert!((phases[0] - 90.0).abs() < 5.0 && (phases[phases.len() - 1] + 90.0).abs() < 5.0, "{phases:?}");
}
