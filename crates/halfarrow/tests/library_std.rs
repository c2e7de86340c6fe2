//! The components that come with the program: each against a closed form, and what is told about them.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use std::collections::BTreeSet;
use std::f64::consts::PI;

use halfarrow::{Library, Model, Record, Run, Source, format_text};

/// The values of variables at the end of a run of a model, whose text begins after its first line.
fn at(to: f64, text: &str, names: &[&str]) -> Vec<f64> {
    let model = Model::from_text("machine.bond", &format!("model Machine\n{text}"), &[]);
    let model = model.unwrap_or_else(|e| panic!("{}", e.render(false)));
    // Several machines stand in one text.
    assert!(model.warnings().diagnostics.0.iter().all(|d| d.code.name == "B020"), "{}", model.warnings().render(false));
    let record = Record::Names(names.iter().map(|n| (*n).to_string()).collect());
    let run = Run { to, rtol: 1e-11, record, ..Run::default() };
    let result = model.simulate(&run, &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false)));
    result.trace.columns.iter().map(|c| *c.values.last().expect("a value")).collect()
}

/// Both agree to a part of the greater of `of` and the expected value.
#[track_caller]
fn close(found: f64, expected: f64, part: f64) {
    let off = (found - expected).abs() / expected.abs();
    assert!(off <= part, "{found} instead of {expected}: off by {off:.1e}");
}

// Electrical

#[test]
fn sources_resistor_capacitor_inductor() {
    let text = "import std.electrical
0:minus -> VoltageSource:mains(v = 12 V) -> 0:plus
minus -> Se:ground(0 V)
plus -> Resistor:r1(r = 2 ohm) -> 0:mid -> Capacitor:c1(c = 0.5 F, v0 = 1 V) -> minus
plus -> Resistor:r2(r = 3 ohm) -> Inductor:l(l = 2 H, i0 = 1 A) -> minus
minus -> CurrentSource:pump(i = 2 A) -> 0:top -> Capacitor:c2(c = 4 F) -> minus
";
    let [v1, i2, v2, across, i] = at(1.5, text, &["c1.v", "l.i", "c2.v", "pump.v", "mains.i"])[..] else { panic!() };
    close(v1, 12.0 - 11.0 * (-1.5f64).exp(), 1e-10);
    close(i2, 4.0 - 3.0 * (-2.25f64).exp(), 1e-10);
    close(v2, 0.75, 1e-10);
    close(across, -0.75, 1e-10);
    close(i, (12.0 - v1) / 2.0 + i2, 1e-12);
}

#[test]
fn diodes() {
    let text = "import std.electrical
Se:a(5 V) -> Resistor:r(r = 1 kohm) -> Diode:d(i_s = 1 nA, v_t = 50 mV) -> Se:b(0 V)
Sf:c(1 mA) -> 0:n -> Diode:e -> Se:f(0 V)
Se:g(0.6 V) -> LeakyDiode:h(g = 1 mS) -> Se:k(0 V)
Se:l(-2 V) -> LeakyDiode:m(g = 1 mS) -> Se:o(0 V)
";
    let [i, v, e, h, m] = at(1.0, text, &["d.i", "d.v", "e.v", "h.i", "m.i"])[..] else { panic!() };
    close(1000.0 * i + v, 5.0, 1e-12);
    close(v, 0.05 * (i / 1e-9).ln_1p(), 1e-12);
    close(e, 25.85e-3 * (1e-3f64 / 1e-12).ln_1p(), 1e-12);
    close(h, 1e-12 * (0.6f64 / 25.85e-3).exp_m1() + 0.6e-3, 1e-12);
    close(m, -1e-12 - 2e-3, 1e-12);
}

#[test]
fn ideal_diodes_and_switches() {
    let text = "import std.electrical
Se:a(5 V) -> Resistor:r(r = 1 kohm) -> IdealDiode:d(v_f = 0.7 V) -> Se:b(0 V)
Se:c(-5 V) -> Resistor:s(r = 1 kohm) -> IdealDiode:e -> Se:f(0 V)
Se:g(5 V) -> Resistor:h(r = 1 kohm) -> Switch:k(on = if t < 1 s then 0 else 1) -> Se:o(0 V)
Se:p(5 V) -> Resistor:q(r = 1 kohm) -> Switch:u(on = if t < 1 s then 1 else 0) -> Se:w(0 V)
";
    let names = ["d.i", "d.v", "e.i", "e.v", "k.i", "k.v", "u.i", "u.v"];
    let ends = at(2.0, text, &names);
    for (found, expected) in ends.iter().zip([4.3e-3, 0.7, 0.0, -5.0, 5e-3, 0.0, 0.0, 5.0]) {
        assert!((found - expected).abs() < 1e-15, "{ends:?}");
    }
}

#[test]
fn operational_amplifier() {
    let text = "import std.electrical
OpAmp:a(gbw = 1 kHz, v_max = 1e6 V)
Se:u(0.5 V) -> a.plus
a.out -> 0:o
o -> a.minus
OpAmp:b
Se:w(1 mV) -> b.plus
Se:z(0 V) -> b.minus
b.out -> 0:far -> Sf:none(0 A)
";
    let (w, rho, gain, t) = (2e3 * PI, 1e-4, 1e5, 2e-4);
    let rate = 1.0 / (1.0 + rho) + 1.0 / gain;
    let inner = 0.5 / (1.0 + rho) / rate * -(-w * rate * t).exp_m1();
    close(at(t, text, &["o.e"])[0], (inner + rho * 0.5) / (1.0 + rho), 1e-10);
    close(at(1.0, text, &["far.e"])[0], 12.0 * (100.0f64 / 12.0).tanh(), 1e-12);
}

#[test]
fn dc_motor_with_gear_and_load() {
    let text = "import std.electrical
import std.mechanical
Se:battery(24 V) -> DCMotor:motor(r = 1 ohm, l = 2 mH, k = 0.05 N.m/A, j = 1e-4 kg.m2, b = 1e-5 N.m.s) -> Gear:gear(ratio = 10) -> Inertia:load(j = 0.01 kg.m2)
";
    let (r, l, k, j, b, u, t) = (1.0, 2e-3, 0.05, 2e-4, 1e-5, 24.0, 0.05);
    // w'' + p w' + q w = k u/(j l), from rest.
    let (p, q): (f64, f64) = (r / l + b / j, (r * b + k * k) / (j * l));
    let root = (p * p / 4.0 - q).sqrt();
    let (s1, s2) = (-p / 2.0 + root, -p / 2.0 - root);
    let end = k * u / (r * b + k * k);
    let w = end * (1.0 + (s2 * (s1 * t).exp() - s1 * (s2 * t).exp()) / (s1 - s2));
    let rate = end * s1 * s2 * ((s1 * t).exp() - (s2 * t).exp()) / (s1 - s2);
    let found = at(t, text, &["motor.w", "load.w", "motor.i"]);
    close(found[0], w, 1e-10);
    close(found[1], w / 10.0, 1e-10);
    close(found[2], (j * rate + b * w) / k, 1e-10);
}

#[test]
fn synchronous_motor() {
    let text = "import std.electrical
PMSM:m(r = 0.2 ohm, l_d = 2 mH, l_q = 3 mH, psi = 0.1 Wb, p = 4, j = 0.01 kg.m2, b = 0.05 N.m.s)
Sf:d(-5 A) -> m.d
Sf:q(10 A) -> m.q
m.shaft -> Se:free(0 N.m)
";
    let (psi_d, psi_q) = (0.1 - 5.0 * 2e-3, 10.0 * 3e-3);
    let torque = 4.0 * (psi_d * 10.0 - psi_q * -5.0);
    let w = torque / 0.05 * -(-5.0f64 * 0.3).exp_m1();
    let found = at(0.3, text, &["m.w", "d.e", "q.e", "m.i_d", "m.i_q"]);
    close(found[0], w, 1e-10);
    close(found[1], 0.2 * -5.0 - 4.0 * w * psi_q, 1e-10);
    close(found[2], 0.2 * 10.0 + 4.0 * w * psi_d, 1e-10);
    assert_eq!((found[3], found[4]), (-5.0, 10.0));
}

#[test]
fn transformers() {
    let text = "import std.electrical
Se:mains(12 V) -> 1:feed -> IdealTransformer:t(n = 3) -> Resistor:load(r = 6 ohm) -> Se:ground(0 V)
Se:step(2 V) -> Transformer:x(l_1 = 0.5 H, l_2 = 0.5 H, k = 0.6, r_1 = 1 ohm, r_2 = 1 ohm) -> Se:short(0 V)
";
    let found = at(1.0, text, &["feed.f", "load.i", "x.first.f", "x.second.f"]);
    close(found[0], 18.0, 1e-14);
    close(found[1], 6.0, 1e-14);
    let sum = 2.0 * -(-1.0f64 / 0.8).exp_m1();
    let difference = 2.0 * -(-1.0f64 / 0.2).exp_m1();
    close(found[2], (sum + difference) / 2.0, 1e-10);
    close(found[3], (sum - difference) / 2.0, 1e-10);
}

// Mechanical

/// A free oscillation of `m x'' + b x' + k x = 0` from the speed `v0` through zero: position and speed.
fn oscillation([m, b, k]: [f64; 3], v0: f64, t: f64) -> (f64, f64) {
    let (a, w) = (b / (2.0 * m), (k / m - b * b / (4.0 * m * m)).sqrt());
    let decay = (-a * t).exp();
    (v0 / w * decay * (w * t).sin(), v0 * decay * ((w * t).cos() - a / w * (w * t).sin()))
}

#[test]
fn masses_springs_dampers() {
    let text = "import std.mechanical
Mass:m(m = 2 kg, v0 = 3 m/s)
1:body -> m
body -> Spring:s(k = 50 N/m) -> Sf:wall(0 m/s)
body -> Damper:d(b = 1.5 N.s/m) -> Sf:floor(0 m/s)
Inertia:j(j = 2 kg.m2, w0 = 3 rad/s)
1:axle -> j
axle -> TorsionSpring:ts(k = 50 N.m/rad) -> Sf:frame(0 rad/s)
axle -> TorsionDamper:td(b = 1.5 N.m.s/rad) -> Sf:rest(0 rad/s)
";
    let (x, v) = oscillation([2.0, 1.5, 50.0], 3.0, 4.2);
    let found = at(4.2, text, &["s.x", "m.v", "ts.x", "j.w", "d.force", "td.torque", "s.force", "ts.torque"]);
    for (found, expected) in found.iter().zip([x, v, x, v, 1.5 * v, 1.5 * v, 50.0 * x, 50.0 * x]) {
        close(*found, expected, 1e-10);
    }
}

#[test]
fn levers_gears_racks_belts() {
    let text = "import std.mechanical
Se:push(10 N) -> 1:a -> Mass:m1(m = 1 kg)
a -> Lever:lever(ratio = -2) -> Mass:m2(m = 3 kg)
Se:turn(10 N.m) -> 1:b -> Inertia:j1(j = 1 kg.m2)
b -> Gear:gear(ratio = 4) -> Inertia:j2(j = 8 kg.m2)
Se:drive(10 N.m) -> Rack:rack(r = 0.2 m/rad) -> Mass:m3(m = 5 kg)
Inertia:j3(j = 2 kg.m2, w0 = 7 rad/s)
1:c -> j3
c -> Belt:belt(r_from = 0.1 m, r_to = 0.3 m, k = 4 kN/m, b = 10 N.s/m) -> Inertia:j4(j = 6 kg.m2)
";
    let names = ["m1.v", "m2.v", "j1.w", "j2.w", "m3.v", "belt.elasticity.q", "j3.w", "j4.w", "belt.tension"];
    let found = at(1.0, text, &names);
    let (a, b) = (10.0 / 13.0, 10.0 / 1.5);
    for (found, expected) in found.iter().zip([a, -2.0 * a, b, b / 4.0, 10.0 / 0.2 / 5.0]) {
        close(*found, expected, 1e-10);
    }
    let softness = 0.01 / 2.0 + 0.09 / 6.0;
    let (x, v) = oscillation([1.0 / softness, 10.0, 4000.0], 0.7, 1.0);
    close(found[5], x, 1e-9);
    close(found[8], 4000.0 * x + 10.0 * v, 1e-9);
    // Momentum of each wheel over its radius: what one loses the other gains.
    close(found[6] * 2.0 / 0.1 + found[7] * 6.0 / 0.3, 140.0, 1e-10);
}

/// Energy in a rounded stop, from its law integrated.
fn stop_energy(k: f64, y: f64, s: f64) -> f64 {
    let root = (y * y + s * s).sqrt();
    k / 4.0 * (y * y + y * root + s * s * (y / s).asinh())
}

#[test]
fn stops() {
    let text = "import std.mechanical
1:body -> Mass:m(m = 2 kg, v0 = 3 m/s)
body -> Stop:s(k = 1 kN/m, gap = 0.1 m, s = 1 cm) -> Sf:wall(0 m/s)
1:axle -> Inertia:j(j = 2 kg.m2, w0 = 3 rad/s)
axle -> TorsionStop:t(k = 1 kN.m/rad, gap = 0.1 rad, s = 0.01 rad) -> Sf:frame(0 rad/s)
";
    let energy = 9.0 + stop_energy(1000.0, -0.1, 0.01);
    for t in [0.05, 0.1, 0.3] {
        let found = at(t, text, &["s.x", "m.v", "t.x", "j.w"]);
        close(found[1] * found[1] + stop_energy(1000.0, found[0] - 0.1, 0.01), energy, 1e-10);
        close(found[3] * found[3] + stop_energy(1000.0, found[2] - 0.1, 0.01), energy, 1e-10);
    }
    close(at(0.5, text, &["m.v"])[0], -3.0, 1e-2);
}

/// What is left of a difference of speeds `w` under friction that takes `rate tanh(w/w_0)` from it.
fn slip(w: f64, w_0: f64, rate: f64, t: f64) -> f64 {
    w_0 * ((w / w_0).sinh() * (-rate * t / w_0).exp()).asinh()
}

#[test]
fn dry_friction_clutch_brake_and_stop() {
    let text = "import std.mechanical
1:u -> I:sledge(2 kg, f0 = 1)
u -> DryFriction:f(f_c = 1 N, f_s = 1.5 N) -> Sf:floor(0 m/s)
Se:pull(if t < 3 s then 0 N else 1.4 N) -> u
1:a -> I:j1(1 kg.m2, f0 = 3)
a -> DryClutch:c(t_max = 1 N.m) -> 1:b -> I:j2(2 kg.m2)
1:w -> I:j3(1 kg.m2, f0 = 3)
w -> DryBrake:brake(t_max = 1 N.m, press = 0.5)
1:v -> I:m(1 kg, f0 = 1)
v -> HardStop:h(gap = 0.5 m, restitution = 0.5) -> Sf:wall(0 m/s)
";
    let early = at(1.0, text, &["sledge.f", "j1.f", "j2.f", "j3.f", "m.f", "h.force"]);
    for (found, expected) in early.iter().zip([0.5, 2.0, 0.5, 2.5, -0.5, 0.0]) {
        assert!((found - expected).abs() < 1e-12, "{early:?}");
    }
    let late = at(8.0, text, &["sledge.f", "f.force", "j1.f", "j2.f", "c.torque", "j3.f", "brake.torque"]);
    for (found, expected) in late.iter().zip([0.0, 1.4, 1.0, 1.0, 0.0, 0.0, 0.0]) {
        assert!((found - expected).abs() < 1e-12, "{late:?}");
    }
}

#[test]
fn friction_clutch_brake() {
    let text = "import std.mechanical
1:body -> Mass:m(m = 2 kg, v0 = 3 m/s)
body -> Friction:f(f_c = 4 N, v_0 = 0.5 m/s) -> Sf:floor(0 m/s)
Inertia:j1(j = 2 kg.m2, w0 = 3 rad/s)
1:a -> j1
a -> Clutch:c(t_max = 8 N.m, w_0 = 0.5 rad/s, press = 0.5) -> Inertia:j2(j = 4 kg.m2, w0 = -1 rad/s)
1:b -> Inertia:j3(j = 2 kg.m2, w0 = 3 rad/s)
b -> Brake:k(t_max = 4 N.m, w_0 = 0.5 rad/s)
";
    let found = at(2.0, text, &["m.v", "j1.w", "j2.w", "j3.w", "f.force", "c.torque", "k.torque"]);
    let v = slip(3.0, 0.5, 2.0, 2.0);
    let w = slip(4.0, 0.5, 3.0, 2.0);
    for (found, expected) in found.iter().zip(
        [v, (2.0 + 4.0 * w) / 6.0, (2.0 - 2.0 * w) / 6.0, v]
            .into_iter()
            .chain([v, w, v].map(|v| 4.0 * (v / 0.5).tanh())),
    ) {
        close(*found, expected, 1e-8);
    }
}

#[test]
fn stribeck_friction() {
    let text = "import std.mechanical
Sf:v(0.3 m/s*sin(t)) -> StribeckFriction:f(f_c = 2 N, f_s = 5 N, v_s = 0.1 m/s, b = 3 N.s/m, v_0 = 1 cm/s) -> Sf:floor(0 m/s)
Sf:w(0.3 rad/s*sin(t)) -> StribeckBearing:g(t_c = 2 N.m, t_s = 5 N.m, w_s = 0.1 rad/s, b = 3 N.m.s/rad, w_0 = 0.01 rad/s)
";
    for t in [0.02, 0.4, PI, 3.5] {
        let v = 0.3 * f64::sin(t);
        let expected = (2.0 + 3.0 * (-(v / 0.1) * (v / 0.1)).exp()) * (v / 0.01).tanh() + 3.0 * v;
        for found in at(t, text, &["f.force", "g.torque"]) {
            close(found, expected, 1e-12);
        }
    }
}

// Hydraulic

/// The flow through an orifice of 1 mm² whose transition is at 1 kPa.
fn through(p: f64) -> f64 {
    1e-6 * 0.62 * (2.0f64 / 870.0).sqrt() * p / (p * p + 1e6).powf(0.25)
}

#[test]
fn ideal_check_valve() {
    let text = "import std.hydraulic
Se:a(2 bar) -> IdealCheckValve:v(g = 1e-9 m3/s/Pa, cracking = 0.5 bar) -> Se:b(0 bar)
Se:c(0.4 bar) -> IdealCheckValve:w(g = 1e-9 m3/s/Pa, cracking = 0.5 bar) -> Se:d(0 bar)
";
    let [open, closed] = at(1.0, text, &["v.flow", "w.flow"])[..] else { panic!() };
    close(open, 1.5e-4, 1e-14);
    assert_eq!(closed, 0.0);
}

#[test]
fn orifices_and_valves() {
    let text = "import std.hydraulic
Se:a(2 MPa*cos(t)) -> Orifice:o(a = 1 mm2) -> Se:b(0 Pa)
Se:c(2 MPa*cos(t)) -> Valve:v(a = 1 mm2, opening = 0.3) -> Se:d(0 Pa)
Se:e(40 kPa*cos(t)) -> CheckValve:k(a = 1 mm2) -> Se:f(0 Pa)
Se:g(2 MPa*cos(t)) -> ReliefValve:r(p_set = 1 MPa, g = 1e-9 m3/s/Pa) -> Se:h(0 Pa)
";
    for t in [0.1, 0.9, 1.57, 3.0] {
        let found = at(t, text, &["o.flow", "v.flow", "k.flow", "r.flow"]);
        let (p, low) = (2e6 * f64::cos(t), 40e3 * f64::cos(t));
        close(found[0], through(p), 1e-12);
        close(found[1], 0.3 * through(p), 1e-12);
        let nearly_closed = (1.0 + ((low - 20e3) / 5e3).tanh()) / 2.0 * through(low);
        assert!((found[2] - nearly_closed).abs() <= 1e-15 * through(low).abs(), "{} {nearly_closed}", found[2]);
        let y = p - 1e6;
        close(found[3], 1e-9 * (y + y.hypot(1e3)) / 2.0, 1e-8);
    }
    let slope = 1e-6 * 0.62 * (2.0f64 / 870.0).sqrt() / 1e3f64.sqrt();
    let text = "import std.hydraulic
Se:a(1 uPa) -> Orifice:o(a = 1 mm2) -> Se:b(0 Pa)
";
    close(at(1.0, text, &["o.flow"])[0], slope * 1e-6, 1e-12);
}

#[test]
fn a_tank_runs_empty_as_torricelli_says_and_a_pipe_fills_as_its_inertia_says() {
    let text = "import std.hydraulic
Tank:t(area = 0.5 m2, level_0 = 2 m, rho = 1000 kg/m3)
0:bottom -> t
bottom -> Orifice:o(a = 10 cm2, cd = 0.6, rho = 1000 kg/m3, dp = 1 mPa) -> Se:air(0 Pa)
Se:main(1 kPa) -> Pipe:p(length = 10 m, d = 2 cm) -> Se:end(0 Pa)
";
    let found = at(100.0, text, &["t.level", "p.flow"]);
    let root = 2.0f64.sqrt() - 0.6 * 1e-3 / 0.5 * (9.80665f64 / 2.0).sqrt() * 100.0;
    close(found[0], root * root, 1e-10);
    let (r, i) = (128.0 * 0.04 * 10.0 / (PI * 1.6e-7), 4.0 * 870.0 * 10.0 / (PI * 4e-4));
    close(found[1], 1000.0 / r * -(-r / i * 100.0).exp_m1(), 1e-10);
    close(at(0.5, text, &["p.flow"])[0], 1000.0 / r * -(-r / i * 0.5).exp_m1(), 1e-10);
}

#[test]
fn cylinder_ram_pump_accumulator() {
    let text = "import std.hydraulic
import std.mechanical
Sf:feed(1e-5 m3/s) -> 0:in
Cylinder:c(a_a = 10 cm2, a_b = 6 cm2, v_a = 0.2 L, v_b = 0.3 L)
in -> c.a
Sf:shut(0 m3/s) -> c.b
c.rod -> Mass:m(m = 50 kg)
Se:p(1 MPa) -> Ram:r(a = 2 cm2) -> Mass:n(m = 4 kg)
Pump:u(d = 2e-6 m3/rad, g = 1e-12 m3/s/Pa)
Sf:motor(150 rad/s) -> u.shaft
Se:tank(1e5 Pa) -> u.from
u.to -> Se:line(5.1 MPa)
Sf:gas(1e-5 m3/s) -> Accumulator:acc(v_0 = 1 L, p_0 = 5 MPa, n = 1.3, q_0 = 0.1 L)
";
    let t = 0.0123;
    let found = at(t, text, &["c.v", "n.v", "line.f", "motor.e", "gas.e", "acc.volume"]);
    let (a, b) = (1e-3 * 1.4e9 / 0.2e-3, 6e-4 * 1.4e9 / 0.3e-3);
    let squared: f64 = (1e-3 * a + 6e-4 * b) / 50.0;
    close(found[0], 1e-5 * a / 50.0 / squared * (1.0 - (squared.sqrt() * t).cos()), 1e-10);
    close(found[1], 200.0 / 4.0 * t, 1e-10);
    close(found[2], 3e-4 - 5e-6, 1e-12);
    close(found[3], 10.0, 1e-12);
    let q = 1e-4 + 1e-5 * t;
    close(found[4], 5_101_325.0 * (1e-3 / (1e-3 - q)).powf(1.3) - 101_325.0, 1e-10);
    close(found[5], q, 1e-12);
}

// Thermal

#[test]
fn heat_flows_from_hot_to_cold_in_both_notations() {
    let text = "import std.thermal
HeatCapacity:hot(c = 2 J/K, t0 = 400 K)
HeatCapacity:cold(c = 3 J/K, t0 = 280 K)
0:h -> hot
0:k -> cold
h -> Conduction:wall(g = 0.5 W/K) -> k
PseudoHeatCapacity:warm(c = 2 J/K, t0 = 400 K)
PseudoHeatCapacity:cool(c = 3 J/K, t0 = 280 K)
0:w -> warm
0:c -> cool
w -> PseudoConduction:plate(g = 0.5 W/K) -> c
";
    let t = 1.7;
    let left = 120.0 * (-0.5f64 * (1.0 / 2.0 + 1.0 / 3.0) * t).exp();
    let mean = (800.0 + 840.0) / 5.0;
    let names =
        ["hot.temperature", "cold.temperature", "warm.temperature", "cool.temperature", "wall.heat", "plate.heat"];
    let found = at(t, text, &names);
    let (hot, cold) = (mean + left * 0.6, mean - left * 0.4);
    for (found, expected) in found.iter().zip([hot, cold, hot, cold, 0.5 * left, 0.5 * left]) {
        close(*found, expected, 1e-9);
    }
    // Entropy of both together, which only grows.
    let entropy = |t: f64| at(t, text, &["hot.law.q", "cold.law.q"]).iter().sum::<f64>();
    let made = |hot: f64, cold: f64| 2.0 * (hot / 400.0).ln() + 3.0 * (cold / 280.0).ln();
    close(entropy(t) - entropy(1e-9), made(hot, cold), 1e-8);
    assert!(made(hot, cold) > 0.0);
}

#[test]
fn a_body_cools_by_radiation() {
    let text = "import std.thermal
HeatCapacity:body(c = 100 J/K, t0 = 1000 K)
0:b -> body
b -> Radiation:r(a = 0.1 m2) -> Se:room(300 K)
";
    let (t, room) = (60.0, 300.0);
    let found = at(t, text, &["body.temperature", "r.heat"]);
    let sigma = 5.670_374_419e-8 * 0.1;
    // The time that it takes is known for each temperature.
    let clock = |x: f64| ((x + room) / (x - room)).ln() + 2.0 * (x / room).atan();
    close(100.0 / (4.0 * sigma * room.powi(3)) * (clock(found[0]) - clock(1000.0)), t, 1e-10);
    close(found[1], sigma * (found[0].powi(4) - room.powi(4)), 1e-12);
}

#[test]
fn sources_of_heat() {
    let text = "import std.thermal
HeatSource:flame(heat = 20 W)
flame -> HeatCapacity:a(c = 5 J/K, t0 = 290 K)
Sf:current(2 A) -> Heater:coil(r = 3 ohm) -> HeatCapacity:b(c = 5 J/K, t0 = 290 K)
PseudoHeatSource:lamp(heat = 20 W)
lamp -> PseudoHeatCapacity:c(c = 5 J/K, t0 = 290 K)
";
    let found = at(3.0, text, &["a.temperature", "b.temperature", "c.temperature", "coil.heat", "current.e"]);
    for (found, expected) in found.iter().zip([302.0, 290.0 + 12.0 * 3.0 / 5.0, 302.0, 12.0, 6.0]) {
        close(*found, expected, 1e-10);
    }
}

// Signals

#[test]
fn hysteresis() {
    let text = "import std.signals
Hysteresis:h(lower = -0.5, upper = 0.5, u = sin(t/(1 s)))
state changes' = h.y from 0
";
    // High from the sixth part of pi on until one and one sixth of pi.
    let [y, time] = at(2.0 * PI, text, &["h.y", "changes"])[..] else { panic!() };
    assert_eq!(y, 0.0);
    close(time, PI, 1e-10);
}

#[test]
fn steps_ramps_pulses_chirps_limits() {
    let text = "import std.signals
Step:s(at = 0.4 s, high = 2, low = -1)
Ramp:r(slope = 3, begin = 0.5 s, end = 1.5 s, low = 1)
Pulse:p(period = 0.5 s, part = 0.3, high = 4, low = 1)
Chirp:c(amplitude = 2, f_0 = 1 Hz, f_1 = 3 Hz, duration = 4 s)
Limit:l(u = r.y, low = 1.5, high = 2.5)
state step' = s.y
state ramp' = r.y
state pulse' = p.y
Sf:idle(0) -> C:still(1)
";
    let found = at(2.0, text, &["step", "ramp", "pulse", "c.y", "l.y", "r.y"]);
    let phase = 2.0 * PI * (2.0 + 2.0 * 4.0 / 8.0);
    for (found, expected) in found.iter().zip([-0.4 + 3.2, 2.0 + 1.5 + 1.5, 4.0 * 0.6 + 1.4, 1.0, 2.5, 4.0]) {
        if expected != 1.0 {
            close(*found, expected, 1e-10);
        }
    }
    assert!((found[3] - 2.0 * phase.sin()).abs() < 1e-13);
    close(at(0.3, text, &["c.y"])[0], 2.0 * (2.0 * PI * (0.3 + 2.0 * 0.09 / 8.0)).sin(), 1e-12);
}

#[test]
fn noise_is_the_same_everywhere_and_uniform() {
    let text = "import std.signals
Noise:n(period = 1 ms, seed = 42, mean = 3, deviation = 2)
Sf:idle(0) -> C:still(1)
";
    let model = Model::from_text("noise.bond", &format!("model Noise\n{text}"), &[]).expect("a model");
    let record = Record::Names(vec!["n.y".into()]);
    let run = Run { to: 4.0005, every: Some(1e-3), record, ..Run::default() };
    let found = model.simulate(&run, &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false))).trace;
    let p = 67_108_859u64;
    let value = |n: u64| {
        let mut x = (n * 1_664_525 + 42 * 22_695_477) % p;
        for add in [n, 42, 12_345] {
            x = (x * x + add) % p;
        }
        3.0 + 2.0 * 12.0f64.sqrt() * (x as f64 / p as f64 - 0.5)
    };
    let mut seen = Vec::new();
    for n in 0..4000u64 {
        let middle = n as f64 * 1e-3 + 0.2e-3;
        let at = found.times.partition_point(|t| *t < middle) - 1;
        close(found.columns[0].values[at], value(n), 1e-14);
        seen.push((value(n) - 3.0) / 2.0);
    }
    let mean = |of: &dyn Fn(usize) -> f64, n: usize| (0..n).map(of).sum::<f64>() / n as f64;
    let three = 3.0 / 4000f64.sqrt();
    assert!(mean(&|i| seen[i], 4000).abs() < three);
    assert!((mean(&|i| seen[i] * seen[i], 4000) - 1.0).abs() < three * 0.9);
    for lag in [1, 2, 5] {
        assert!(mean(&|i| seen[i] * seen[i + lag], 4000 - lag).abs() < three, "lag {lag}");
    }
}

#[test]
fn pid_with_limits() {
    let text = "import std.signals
PID:free(error = 2, kp = 3, ki = 0.5, kd = 0.1, t_d = 0.2 s)
PID:full(error = 2, kp = 3, ki = 0.5, high = 4, t_t = 0.8 s)
Sf:idle(0) -> C:still(1)
";
    let t = 0.7;
    let found = at(t, text, &["free.u", "free.v", "full.u", "full.v"]);
    let u = 6.0 + 1.0 * t + 0.1 * 2.0 / 0.2 * (-t / 0.2f64).exp();
    close(found[0], u, 1e-10);
    close(found[1], u, 1e-10);
    close(found[2], 4.0, 1e-14);
    let rest = 4.0 - 6.0 + 1.0 * 0.8;
    close(found[3], 6.0 + rest * -(-t / 0.8f64).exp_m1(), 1e-10);
}

// Machines

#[test]
fn a_press_comes_to_rest_where_its_balance_is() {
    let text = "import std.hydraulic
import std.mechanical
import std.signals
Pump:pump(d = 1.6e-6 m3/rad, g = 1e-13 m3/s/Pa)
Sf:motor(150 rad/s) -> pump.shaft
Se:suction(0 Pa) -> pump.from
pump.to -> 0:line -> Accumulator:gas(v_0 = 1 L, p_0 = 6 MPa, q_0 = 0.1 L)
line -> ReliefValve:relief(p_set = 10 MPa, g = 1e-9 m3/s/Pa) -> Se:tank_1(0 Pa)
Step:open(at = 0.5 s)
Cylinder:cylinder(a_a = 10 cm2, a_b = 6 cm2, v_a = 0.2 L, v_b = 0.2 L)
line -> Valve:supply(a = 5 mm2, opening = open.y) -> cylinder.a
0:back -> cylinder.b
back -> Orifice:exhaust(a = 5 mm2) -> Se:tank_2(0 Pa)
cylinder.rod -> 1:load -> Mass:mass(m = 200 kg)
load -> Spring:spring(k = 50 kN/m) -> Sf:frame(0 m/s)
load -> Damper:guide(b = 2 kN.s/m) -> Sf:bed(0 m/s)
";
    let [p, x, relief, v] = at(20.0, text, &["line.e", "spring.x", "relief.flow", "mass.v"])[..] else { panic!() };
    close(50e3 * x, 1e-3 * p, 1e-7);
    close(relief + 1e-13 * p, 1.6e-6 * 150.0, 1e-8);
    let y = p - 10e6;
    close(1e-9 * (y + y.hypot(1e3)) / 2.0, relief, 1e-8);
    assert!(v.abs() < 1e-8);
}

#[test]
fn a_bridge_rectifier_obeys_the_equation_of_its_symmetry() {
    let text = "import std.electrical
0:right -> VoltageSource:mains(v = 10 V*sin(2*pi*50 Hz*t)) -> Resistor:rs(r = 10 ohm) -> 0:left
left -> LeakyDiode:d1(i_s = 1 nA, v_t = 50 mV, g = 1 uS) -> 0:plus
right -> LeakyDiode:d2(i_s = 1 nA, v_t = 50 mV, g = 1 uS) -> plus
0:minus -> LeakyDiode:d3(i_s = 1 nA, v_t = 50 mV, g = 1 uS) -> left
minus -> LeakyDiode:d4(i_s = 1 nA, v_t = 50 mV, g = 1 uS) -> right
plus -> Capacitor:c(c = 10 uF) -> minus
plus -> Resistor:load(r = 1 kohm) -> minus
minus -> Se:ground(0 V)
";
    let g = |u: f64| 1e-9 * (u / 0.05).exp_m1() + 1e-6 * u;
    for t in [0.004, 0.013, 0.0237] {
        let [u, i] = at(t, text, &["c.v", "rs.i"])[..] else { panic!() };
        let v = 10.0 * (100.0 * PI * t).sin();
        let (x, y) = ((v - 10.0 * i - u) / 2.0, (-v + 10.0 * i - u) / 2.0);
        assert!((g(x) - g(y) - i).abs() < 1e-9 * i.abs() + 1e-12, "{i} at {t}");
    }
}

// What is told

/// What a model is refused with.
fn refused(text: &str) -> String {
    let error = Model::from_text("machine.bond", text, &[]).expect_err("a fault");
    error.render(false)
}

#[test]
fn an_unknown_library_is_refused_with_those_that_there_are() {
    let told = refused("model M\nimport std.hydraulics\nSe:a(1) -> R:r(1)\n");
    assert!(told.contains("there is no library `std.hydraulics`"), "{told}");
    assert!(told.contains("machine.bond:2:8") && told.contains("did you mean `std.hydraulic`?"), "{told}");
    assert!(
        told.contains("std.electrical, std.hydraulic, std.mechanical, std.multibody, std.planar, std.signals, std.thermal, std.vehicle"),
        "{told}"
    );
    let told = refused("model M\nimport motors\nSe:a(1) -> R:r(1)\n");
    assert!(told.contains("in quotes: `import \"file.bond\"`"), "{told}");
}

#[test]
fn a_component_without_its_import_is_refused_with_the_import() {
    let told = refused("model M\nSe:a(1 V) -> DCMotor:m(r = 1) -> R:b(1)\n");
    assert!(told.contains("write `import std.electrical` above"), "{told}");
}

#[test]
fn a_component_of_ones_own_does_not_replace_one_of_a_library_silently() {
    let own = "component Pump(port p) { p -> R:r(1) }\n";
    let told = refused(&format!("model M\nimport std.hydraulic\n{own}Se:a(1) -> Pump:p\n"));
    assert!(told.contains("component `Pump` is declared twice") && told.contains("machine.bond:3:11"), "{told}");
    assert!(told.contains("std.hydraulic:") && told.contains("give this one another name"), "{told}");
    let apart = format!("model M\nimport std.electrical\n{own}Se:a(1) -> Pump:p\n");
    Model::from_text("machine.bond", &apart, &[]).unwrap_or_else(|e| panic!("{}", e.render(false)));
}

#[test]
fn faults_name_the_place_in_the_library_and_in_the_model() {
    let told = refused("model M\nimport std.electrical\nSe:a(1 V) -> Resistor:r(r = 2 kg) -> Se:b(0 V)\n");
    assert!(told.contains("units do not agree: kg and ohm") && told.contains("machine.bond:3:29"), "{told}");
    let pid = "PID:c(error = w.f, kp = 2 N, ki = 3 V)\nSf:a(1 m/s) -> 1:w -> R:b(1)\nSf:i(c.u) -> R:d(1)\n";
    let told = refused(&format!("model M\nimport std.signals\n{pid}"));
    assert!(told.contains("std.signals:") && told.contains("machine.bond:3:1"), "{told}");
    assert!(told.contains("met in this instance"), "{told}");
    let told = refused("model M\nimport std.electrical\nSe:a(1 V) -> Resistor:r -> Se:b(0 V)\n");
    assert!(told.contains("machine.bond:3") && told.contains("std.electrical:"), "{told}");
}

#[test]
fn all_libraries_stand_beside_each_other_and_go_with_a_model() {
    let all: String = Library::all().iter().map(|l| format!("import {}\n", l.name)).collect();
    let text = format!("model M\n{all}{all}Se:a(1 V) -> Resistor:r(r = 2 ohm) -> Se:b(0 V)\n");
    let model = Model::new(Source::text("m.bond", text), &[]).unwrap_or_else(|e| panic!("{}", e.render(false)));
    Model::new(model.source(), &[]).unwrap_or_else(|e| panic!("{}", e.render(false)));
}

#[test]
fn every_component_is_documented_and_tested_here() {
    let tests = [
        include_str!("library_std.rs"),
        include_str!("multibonds.rs"),
        include_str!("planar.rs"),
        include_str!("vehicles.rs"),
    ]
    .concat();
    let mut seen = BTreeSet::new();
    for library in Library::all() {
        assert!(!library.about.is_empty());
        let text = Library::text(&library.name).expect("its text");
        assert_eq!(format_text(&library.name, text).expect("sound text"), text, "{} needs `fmt`", library.name);
        for c in &library.components {
            assert!(seen.insert(c.name.clone()), "{} is there twice", c.name);
            assert!(tests.contains(&format!("{}:", c.name)), "{} has no test", c.name);
            assert!(!c.doc.is_empty() && c.law.starts_with("Law: ") && c.law.contains("\nSource: "), "{}", c.name);
            let told = c.parameters.iter().chain(&c.constants).chain(&c.inputs).chain(&c.outputs);
            told.for_each(|e| assert!(!e.doc.is_empty(), "{}: what is {}?", c.name, e.name));
            let source = c.law.rsplit("Source: ").next().unwrap_or_default();
            let keys = source.split('[').skip(1).filter_map(|rest| rest.split_once(']')).map(|(key, _)| key);
            for key in keys {
                let known = include_str!("../../../docs/sources.md").contains(&format!("| [{key}] |"));
                assert!(known, "{}: [{key}] is not among the sources", c.name);
            }
        }
    }
}

#[test]
fn libraries_and_components_are_found_by_name() {
    let names = |name: &str| {
        let found = Library::named(name).unwrap_or_else(|e| panic!("{e}"));
        found.into_iter().map(|l| (l.name, l.components.len())).collect::<Vec<_>>()
    };
    assert_eq!(names("").len(), 8);
    assert_eq!(names("std.thermal"), names("thermal"));
    for name in ["DCMotor", "electrical.DCMotor", "std.electrical.DCMotor"] {
        assert_eq!(names(name), [("std.electrical".to_string(), 1)]);
    }
    let unknown = Library::named("electrical.DCMotro").expect_err("no such component").to_string();
    assert!(unknown.contains("did you mean `electrical.DCMotor`?"), "{unknown}");
    let unknown = Library::named("pneumatics").expect_err("no such library").to_string();
    assert!(
        unknown.contains("there are electrical, mechanical, multibody, planar, vehicle, hydraulic, thermal, signals"),
        "{unknown}"
    );
}

/// The page about all components.
fn page() -> String {
    let mut page = String::from(
        "# Components\n\nModel text that comes with the program, in `library/`. `import std.electrical` brings in what a library has; its components are then kinds, as those of the model are: `Resistor:r1(r = 2 ohm)`. `halfarrow library electrical.DCMotor` shows one with its text. This page is made of that text (`UPDATE=1 cargo test --workspace --test all -- library_std::`). Keys such as [KMR] are those of [sources.md](sources.md).\n",
    );
    for library in Library::all() {
        page += &format!("\n## `{}`\n\n{}\n", library.name, library.about);
        for c in &library.components {
            page += &format!("\n### {}\n\n{}: `{}`\n\n{}\n\n", c.name, c.doc, c.usage(), c.law.replace('\n', "\n\n"));
            page += "| | | unit | default | |\n|---|---|---|---|---|\n";
            for (what, e) in c.groups().into_iter().flat_map(|(what, list)| list.iter().map(move |e| (what, e))) {
                let [unit, default] = [&e.unit, &e.default].map(|text| text.clone().unwrap_or_default());
                page += &format!("| {what} | `{}` | {unit} | {default} | {} |\n", e.name, e.doc);
            }
        }
    }
    page
}

#[test]
fn the_page_about_components_is_true() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/library.md");
    if std::env::var_os("UPDATE").is_some() {
        std::fs::write(path, page()).expect("it can be written");
    }
    assert_eq!(std::fs::read_to_string(path).unwrap_or_default(), page(), "UPDATE=1 writes docs/library.md anew");
}
