//! `std.vehicle` against values of others and closed forms.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use std::collections::BTreeMap;

use halfarrow::{Column, FixedMethod, Form, Method, Model, Override, Record, Run, Simulated, Source, Start};

const SEDAN: &str = include_str!("vehicles/sedan_tyre.tir");

/// Tables of roads, steering, paths and an engine.
const TABLES: [(&str, &str); 5] = [
    ("boost.csv", "torque,force\n-12,-4000\n-2,0\n2,0\n12,4000\n"),
    ("road.csv", "x,h\n0,0\n1,0\n2,0.05\n3,0.05\n4,0\n5,0\n"),
    ("steer.csv", "t,angle\n0,0\n1,0\n1.5,0.02\n10,0.02\n"),
    ("path.csv", "x,y\n-100,0\n0,0\n20,0\n40,3\n60,3\n2000,3\n"),
    ("engine.csv", "w,full,closed\n0,100,-10\n500,100,-60\n"),
];

fn model_with(text: &str, more: &[(&str, &str)]) -> Model {
    let text = format!("model Machine\nimport std.multibody\nimport std.vehicle\n{text}");
    let files = TABLES.iter().chain([("sedan.tir", SEDAN)].iter()).chain(more);
    let files: BTreeMap<String, String> = files.map(|(path, text)| ((*path).into(), (*text).into())).collect();
    let source = Source::text("machine.bond", &text).with_files(files);
    Model::new(source, &[]).unwrap_or_else(|e| panic!("{}\n{text}", e.render(false)))
}

fn run(text: &str, run: &Run) -> Simulated {
    let run = Run { record: Record::All, ..run.clone() };
    model_with(text, &[]).simulate(&run, &mut |_| true).unwrap_or_else(|e| panic!("{}\n{text}", e.render(false)))
}

fn exact(to: f64) -> Run {
    Run { to, rtol: 1e-10, every: Some(to / 100.0), ..Run::default() }
}

fn column<'a>(done: &'a Simulated, name: &str) -> &'a [f64] {
    let found = done.trace.columns.iter().find(|c| c.name == name);
    &found.unwrap_or_else(|| panic!("nothing called {name}")).values
}

fn last(done: &Simulated, name: &str) -> f64 {
    *column(done, name).last().expect("there are samples")
}

#[track_caller]
fn close(found: f64, expected: f64, off: f64) {
    assert!((found - expected).abs() <= off, "{found} instead of {expected}: off by {:.1e}", (found - expected).abs());
}

/// What signals are, of which none changes.
fn still(text: &str, more: &[(&str, &str)]) -> impl Fn(&str) -> f64 + use<> {
    let model = model_with(&format!("{text}Se:push(0) -> I:mass(1)\n"), more);
    let run = Run { to: 1e-3, record: Record::All, ..Run::default() };
    let done = model.simulate(&run, &mut |_| true).unwrap_or_else(|e| panic!("{}\n{text}", e.render(false)));
    move |name| last(&done, name)
}

/// All rows of an independent implementation.
#[test]
fn the_magic_formula_gives_the_forces_of_another_implementation() {
    let table = include_str!("vehicles/tyre_vectors.csv");
    let rows = table.lines().filter(|l| !l.starts_with('#')).skip(1);
    let rows: Vec<Vec<f64>> = rows.map(|l| l.split(',').map(|x| x.parse().expect("a number")).collect()).collect();
    assert_eq!(rows.len(), 36);
    let largest = rows.iter().flat_map(|row| &row[4..]).fold(0.0f64, |most, f| most.max(f.abs()));
    for row in &rows {
        let [fz, kappa, alpha, gamma] = row[..4] else { panic!() };
        let of = |name: &str, kappa: f64, alpha: f64| {
            format!(
                "MagicFormula:{name}(file = \"sedan.tir\", Fz = {fz}, kappa = {kappa}, alpha = {alpha}, gamma = {gamma}, Vx = 20)\n"
            )
        };
        let read = still(&(of("both", kappa, alpha) + &of("long", kappa, 0.0) + &of("wide", 0.0, alpha)), &[]);
        for (name, expected) in
            [("long.load*Fx0", row[4]), ("wide.load*Fy0", row[5]), ("both.Fx", row[6]), ("both.Fy", row[7])]
        {
            let found = match name.split_once('*') {
                Some((load, pure)) => read(load) * read(&load.replace("load", pure)),
                None => read(name),
            };
            close(found, expected, 1e-9 * largest);
        }
    }
}

/// Mx and My by the formulas of Besselink, Schmeitz and Pacejka (2010), written down anew; and what a file says in radians.
#[test]
fn overturning_and_rolling_resistance_go_as_published() {
    let numbers = [
        ("FITTYP", 61.0),
        ("UNLOADED_RADIUS", 0.3),
        ("FNOMIN", 4000.0),
        ("PCX1", 1.5),
        ("PDX1", 1.0),
        ("PKX1", 20.0),
        ("PCY1", 1.3),
        ("PDY1", 1.0),
        ("PKY1", -15.0),
        ("PKY2", 1.7),
        ("QSX1", 0.01),
        ("QSX2", 0.8),
        ("QSX3", 0.02),
        ("QSX4", 5.0),
        ("QSX5", 1.0),
        ("QSX6", 2.0),
        ("QSX7", 0.7),
        ("QSX8", 0.3),
        ("QSX9", 0.6),
        ("QSX10", 0.2),
        ("QSX11", 4.0),
        ("QSX12", 0.4),
        ("QSX13", 0.05),
        ("QSX14", 0.6),
        ("QSY1", 0.01),
        ("QSY2", 0.1),
        ("QSY3", 0.002),
        ("QSY4", 1e-4),
        ("QSY5", 0.1),
        ("QSY6", 0.05),
        ("QSY7", 0.9),
    ];
    let lines: String = numbers.iter().map(|(name, value)| format!("{name} = {value}\n")).collect();
    let file = format!("[UNITS]\nLENGTH = 'meter'\nANGLE = 'radians'\n[MODEL]\n{lines}");
    let c = |name: &str| numbers.iter().find(|n| n.0 == name).expect("it is there").1;
    for (fz, alpha, camber) in [(2000.0, 0.05, 0.05), (5000.0, -0.1, -0.1), (3000.0, 0.0, 0.0)] {
        let text = format!(
            "MagicFormula:m(file = \"six.tir\", Fz = {fz}, kappa = 0.05, alpha = {alpha}, gamma = {camber}, Vx = 20)\n"
        );
        let read = still(&text, &[("six.tir", &file)]);
        let (fx, fy, g) = (read("m.Fx"), read("m.Fy"), f64::sin(camber));
        let (r, f0) = (c("UNLOADED_RADIUS"), c("FNOMIN"));
        let [fy0, fz0] = [fy / f0, fz / f0];
        let steep = f64::cos(c("QSX5") * (c("QSX6") * fz0).powi(2).atan())
            * f64::sin(c("QSX7") * g + c("QSX8") * (c("QSX9") * fy0).atan());
        let by_load = c("QSX1") - c("QSX2") * g - c("QSX12") * g * g.abs()
            + c("QSX3") * fy0
            + c("QSX4") * steep
            + c("QSX10") * (c("QSX11") * fz0).atan() * g;
        let overturning = r * (fz * by_load + fy * (c("QSX13") + c("QSX14") * g.abs()));
        let speed = 20.0 / 16.6;
        let rolling = c("QSY1")
            + c("QSY2") * fx / f0
            + c("QSY3") * speed
            + c("QSY4") * f64::powi(speed, 4)
            + (c("QSY5") + c("QSY6") * fz0) * g * g;
        close(read("m.Mx"), overturning, 1e-12 * r * fz);
        close(read("m.My"), -r * f0 * rolling * fz0.powf(c("QSY7")), 1e-12 * r * fz);
    }
}

/// What a component reads by a name that its user gives goes with the model, as tables do.
#[test]
fn a_model_takes_its_tyre_with_it() {
    let text = "param tyre = \"sedan.tir\"\nMagicFormula:m(file = tyre, Fz = 3000, kappa = 0.1, alpha = 0, gamma = 0, Vx = 20)\nSe:push(m.Fx) -> I:mass(1)\n";
    let model = model_with(
        text,
        &[("ice.tir", &SEDAN.replace("LMUX                     = 1 ", "LMUX                     = 0.1 "))],
    );
    assert_eq!(model.files().keys().collect::<Vec<_>>(), ["sedan.tir"]);
    let again = Model::new(model.source(), &[]).unwrap_or_else(|e| panic!("{}", e.render(false)));
    let end = |model: &Model| {
        let run = Run { to: 1.0, record: Record::Names(vec!["mass.f".into()]), ..Run::default() };
        let done = model.simulate(&run, &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false)));
        *done.trace.columns[0].values.last().expect("a value")
    };
    assert_eq!(end(&again).to_bits(), end(&model).to_bits());
    let set = [Override { name: "tyre".into(), value: "\"ice.tir\"".into() }];
    let ice = model.with(&set).unwrap_or_else(|e| panic!("{}", e.render(false)));
    assert!(end(&ice) < 0.2 * end(&model), "{} {}", end(&ice), end(&model));
}

/// Without load there is no force; with hardly any it goes with the load; and a wheel that rolls backward or not at all has
/// finite ones.
#[test]
fn a_tyre_has_forces_at_no_load_and_no_speed() {
    let tyre = |name: &str, fz: f64, vx: f64, kappa: f64, alpha: f64| {
        format!(
            "MagicFormula:{name}(file = \"sedan.tir\", Fz = {fz}, kappa = {kappa}, alpha = {alpha}, gamma = 0.02, Vx = {vx})\n"
        )
    };
    let read = still(
        &[
            tyre("none", 0.0, 0.0, 0.1, 0.1),
            tyre("below", -5.0, 1.0, 0.0, 0.0),
            tyre("little", 1e-3, 1.0, 0.1, 0.1),
            tyre("less", 1e-4, 1.0, 0.1, 0.1),
            tyre("stands", 3000.0, 0.0, 0.0, 0.0),
            tyre("ahead", 3000.0, 10.0, 0.0, 0.05),
            tyre("back", 3000.0, -10.0, 0.0, 0.05),
        ]
        .concat(),
        &[],
    );
    for force in ["Fx", "Fy", "Mx", "My", "Mz"] {
        assert_eq!(read(&format!("none.{force}")).abs() + read(&format!("below.{force}")).abs(), 0.0);
        close(read(&format!("little.{force}")), 10.0 * read(&format!("less.{force}")), 1e-6);
        assert!(read(&format!("stands.{force}")).is_finite());
    }
    assert!(read("little.Fy").abs() > 1e-4);
    close(read("back.Fy"), read("ahead.Fy"), 1e-9);
    // The trail lies behind the contact, whichever way it goes.
    let trail = |name: &str| read(&format!("{name}.trail"));
    close(trail("back"), -trail("ahead"), 1e-12);
}

/// A tyre of version 6 with hardly more than its stiffnesses: lateral force per camber and slip, and what pressure makes of them.
#[test]
fn version_six_has_camber_stiffness_and_pressure() {
    let tir = "[DIMENSION]\nUNLOADED_RADIUS = 0.3\n[OPERATING_CONDITIONS]\nNOMPRES = 220000\nINFLPRES = 220000\n[VERTICAL]\nFNOMIN = 4000\n[MODEL]\nFITTYP = 61\nLONGVL = 16.7\n\
PCX1 = 1.6\nPDX1 = 1.1\nPKX1 = 20\nPCY1 = 1.3\nPDY1 = 1\nPKY1 = -15\nPKY2 = 1.5\nPKY4 = 2\nPKY6 = -1.2\nPKY7 = 0.3\nPPY1 = 0.5\nPPY5 = -0.4\nQCZ1 = 1.1\nQDZ1 = 0.1\nQBZ1 = 8\nQSX2 = 0.7\n";
    let tyre = |name: &str, alpha: f64, gamma: f64, p: &str| {
        format!(
            "MagicFormula:{name}(file = \"six.tir\", Fz = 3000, kappa = 0, alpha = {alpha}, gamma = {gamma}, Vx = 20{p})\n"
        )
    };
    let text = [
        tyre("slips", 1e-6, 0.0, ""),
        tyre("leans", 0.0, 1e-6, ""),
        tyre("slips_hard", 1e-6, 0.0, ", p = 242000"),
        tyre("leans_hard", 0.0, 1e-6, ", p = 242000"),
        tyre("slides", 1.4, 0.0, ""),
    ];
    let read = still(&text.concat(), &[("six.tir", tir)]);
    let stiffness = |dp: f64| -15.0 * 4000.0 * (1.0 + 0.5 * dp) * (2.0 * f64::atan(3000.0 / (1.5 * 4000.0))).sin();
    let camber = |dp: f64| (-1.2 - 0.3 * 0.25) * 3000.0 * (1.0 - 0.4 * dp);
    close(read("slips.Fy"), 1e-6 * stiffness(0.0), 1e-9);
    close(read("leans.Fy"), 1e-6 * camber(0.0), 1e-9);
    close(read("slips_hard.Fy"), 1e-6 * stiffness(0.1), 1e-9);
    close(read("leans_hard.Fy"), 1e-6 * camber(0.1), 1e-9);
    let trail = 0.3 / 4000.0 * 0.1 * 3000.0;
    close(read("slips.Mz"), -trail * read("slips.Fy"), 1e-9);
    close(read("leans.Mx"), -0.7 * 1e-6 * 3000.0 * 0.3, 1e-9);
    let b = stiffness(0.0) / (1.3 * 3000.0);
    close(read("slides.Fy"), 3000.0 * (1.3 * (b * f64::tan(1.4)).atan()).sin(), 1e-8);
}

const QUARTER: &str = "World:world(g = [-9.81*slope, 0, -9.81]) -> Prismatic:x(n = [1, 0, 0], v0 = v0) -> Prismatic:z(q0 = z0) -> 1[frame]:carrier -> Body:car(m = 300, J = diag([10, 20, 30]))
carrier -> Wheel:wheel(m = 20, J_axle = 1, J_across = 0.6, w0 = v0/0.33) -> Tyre:tyre(file = \"sedan.tir\")
";

/// A driven wheel: Newton's and Euler's equations with the forces it tells, and the load of the weight.
#[test]
fn a_driven_wheel_obeys_newton() {
    let text = format!(
        "param slope = 0, v0 = 10, z0 = 0.33\nSe:motor(200) -> wheel.axle\n{QUARTER}output a = x.rate.f'\noutput b = wheel.rate.f'\n"
    );
    let done = run(&text, &exact(4.0));
    for k in 50..=100 {
        let [fx, r] = ["tyre.Fx", "tyre.radius"].map(|name| column(&done, name)[k]);
        close(column(&done, "a")[k], fx / 320.0, 1e-8);
        close(column(&done, "b")[k], 200.0 - fx * r, 1e-6);
    }
    close(last(&done, "tyre.Fz"), 320.0 * 9.81, 1e-3);
    close(last(&done, "tyre.radius"), 0.344 - 320.0 * 9.81 / 280835.2941, 1e-8);
    assert!(last(&done, "x.speed") > 17.0);
}

/// A wheel that is spun up far beyond what the road takes: a real-time step of 1 ms follows the deflection, which ends where
/// its law balances, V x + S (x - 1.5) x = S with x = u/s_x.
#[test]
fn a_wheel_spins_up_at_a_step_of_a_millisecond() {
    for (torque, fast) in [(900.0, 2.0e3), (3000.0, 7.5e3)] {
        let text = format!(
            "World:world -> Prismatic:forward(n = [1, 0, 0], v0 = 10 m/s) -> Prismatic:up(q0 = 0.335 m, fixed = 1) -> wheel
Wheel:wheel(m = 60, J_axle = 1.08, J_across = 0.6, w0 = 30) -> Tyre:tyre(file = \"sedan.tir\")
Se:engine({torque}) -> 1:axle -> wheel.axle
output x = tyre.u/tyre.s_x, slides = -tyre.sx
"
        );
        let step = Run {
            to: 3.0,
            every: Some(0.1),
            method: Method::Fixed(FixedMethod::Rk4),
            step: Some(1e-3),
            ..Run::default()
        };
        let (stepped, precise) = (run(&text, &step), run(&text, &exact(3.0)));
        let [x, slides, u] = ["x", "slides", "tyre.u"].map(|name| last(&stepped, name));
        let speed = last(&stepped, "forward.speed");
        assert!(last(&stepped, "wheel.speed") > fast);
        close(speed * x + slides * (x - 1.5) * x, slides, 1e-3 * slides);
        close(u, last(&precise, "tyre.u"), 1e-6);
        close(speed, last(&precise, "forward.speed"), 1e-3);
        let largest = column(&stepped, "tyre.u").iter().fold(0.0_f64, |m, u| m.max(u.abs()));
        assert!(largest < 0.5, "{largest}");
    }
}

/// On a slope with its brake closed a wheel comes to rest and stays there; the tyre carries the weight along the slope.
#[test]
fn a_wheel_stands_still_on_a_slope() {
    let text = format!(
        "param slope = 0.05, v0 = 5, z0 = 0.3328\nHoldingBrake:brake(t_max = 1500)\n1:shaft -> wheel.axle\nshaft -> brake\n{QUARTER}"
    );
    let done = run(&text, &Run { to: 10.0, rtol: 1e-8, every: Some(0.1), ..Run::default() });
    close(last(&done, "x.speed"), 0.0, 1e-4);
    close(last(&done, "wheel.speed"), 0.0, 1e-4);
    close(last(&done, "tyre.Fx"), 320.0 * 9.81 * 0.05, 0.1);
    let way = column(&done, "x.way");
    close(way[100], way[80], 2e-4);
    assert!(way[100] > 1.0);
}

/// A wheel that is lifted has no force and flies; what it lands on pushes, never pulls.
#[test]
fn a_wheel_that_flies_has_no_load() {
    let text = format!("param slope = 0, v0 = 5, z0 = 0.4\n{QUARTER}");
    let done = run(&text, &exact(1.0));
    for k in 0..10 {
        let t = 0.01 * k as f64;
        close(column(&done, "z.way")[k], 0.4 - 4.905 * t * t, 1e-9);
        assert_eq!(column(&done, "tyre.Fz")[k], 0.0);
    }
    assert!(column(&done, "tyre.Fz").iter().all(|load| *load >= 0.0));
    close(last(&done, "x.speed"), 5.0, 0.1);
}

/// Moved aside at constant speeds a tyre builds its slip up over the relaxation length.
#[test]
fn slip_builds_up_over_the_relaxation_length() {
    let text = "World:world -> Prismatic:x(n = [1, 0, 0]) -> Prismatic:y(n = [0, 1, 0]) -> Prismatic:z(q0 = 0.33, fixed = 1) -> Wheel:wheel(m = 20, J_axle = 1, J_across = 0.6) -> Tyre:tyre(file = \"sedan.tir\")
Sf:ahead(10) -> x.axis
Sf:aside(0.2) -> y.axis
Sf:level(0) -> z.axis
Sf:roll(10/tyre.Re) -> wheel.axle
output length = tyre.s_y
";
    let done = run(text, &exact(0.2));
    let load = 280835.2941 * 0.014;
    let f0 = 4850.0 * 0.81;
    let length = 2.1439 * f64::sin(2.0 * f64::atan(load / (1.9829 * f0))) * 0.344 * 0.81;
    close(last(&done, "length"), length, 1e-12);
    for k in 0..=100 {
        let t = 0.002 * k as f64;
        let tan = 0.02 * (1.0 - (-10.0 * t / length).exp());
        close(column(&done, "tyre.v")[k], tan * length, 1e-9);
        close(column(&done, "tyre.u")[k], 0.0, 1e-9);
    }
    assert!(last(&done, "tyre.Fy") < -300.0);
}

/// A tyre of version 6 has its relaxation lengths from the stiffness of its carcass; on the other side of a car it is its image.
#[test]
fn tyres_have_a_carcass_and_a_side() {
    let six = "FITTYP = 61\nUNLOADED_RADIUS = 0.3\nFNOMIN = 4000\nVERTICAL_STIFFNESS = 2e5\nLONGITUDINAL_STIFFNESS = 3e5\nLATERAL_STIFFNESS = 1e5\nPCX1 = 1.6\nPDX1 = 1.1\nPKX1 = 20\nPCY1 = 1.3\nPDY1 = 1\nPKY1 = -15\nPKY2 = 1.5\nPVY1 = 0.05\nQBZ1 = 8\nQCZ1 = 1.1\nQDZ1 = 0.1\nQSX1 = 0.01\n";
    let corner = |name: &str, lean: f64, speed: f64, more: &str| {
        format!(
            "ground -> Prismatic:y{name}(n = [0, 1, 0]) -> FixedRotation:r{name}(n = [1, 0, 0], angle = {lean}) -> Wheel:w{name}(m = 20, J_axle = 1, J_across = 0.6) -> Tyre:t{name}(file = \"six.tir\"{more})\nSf:a{name}({speed}) -> y{name}.axis\nSf:s{name}(10/t{name}.Re) -> w{name}.axle\n"
        )
    };
    let text = "World:world -> Prismatic:x(n = [1, 0, 0]) -> Prismatic:z(q0 = 0.29, fixed = 1) -> 1[frame]:ground\nSf:ahead(10) -> x.axis\nSf:level(0) -> z.axis\n";
    let text = [text, &corner("left", 0.05, 0.3, ""), &corner("right", -0.05, -0.3, ", mirrored = 1")].concat();
    let model = model_with(&text, &[("six.tir", six)]);
    let done = model.simulate(&Run { record: Record::All, ..exact(0.5) }, &mut |_| true);
    let done = done.unwrap_or_else(|e| panic!("{}", e.render(false)));
    let load = last(&done, "tleft.Fz");
    close(load, 2e5 * (0.3 - 0.29 / f64::cos(0.05)), 1e-8);
    close(last(&done, "tleft.s_x"), 20.0 * load / 3e5, 1e-12);
    let stiffness = 15.0 * 4000.0 * (2.0 * f64::atan(load / 6000.0)).sin();
    close(last(&done, "tleft.s_y"), stiffness / 1e5, 1e-12);
    for (variable, sign) in
        [("Fx", 1.0), ("Fy", -1.0), ("Fz", 1.0), ("Mz", -1.0), ("alpha", -1.0), ("gamma", -1.0), ("kappa", 1.0)]
    {
        let [left, right] = ["left", "right"].map(|side| column(&done, &format!("t{side}.{variable}")));
        left.iter().zip(right).for_each(|(l, r)| close(*r, sign * l, 1e-9 * load));
    }
    assert!(last(&done, "tleft.Fy") < -500.0);
}

/// A car on four tyres: with those of one side mirrored it runs straight, its weight stands on them as the levers say, and
/// steered it goes round.
#[test]
fn a_car_runs_straight_and_goes_round() {
    let corner = |name: &str, px: f64, py: f64, mirrored: u8, turned: &str| {
        format!(
            "chassis -> FixedTranslation:m{name}(d = [{px}, {py}, -0.22]) -> Prismatic:s{name} -> 1[frame]:c{name}\n1:r{name} -> s{name}.axis\nr{name} -> C:k{name}(k = 30e3, q = s{name}.way + 0.0981)\nr{name} -> R:d{name}(2500)\nc{name} -> {turned} -> Wheel:w{name}(m = 25, J_axle = 1.2, J_across = 0.7, w0 = 20/0.333) -> Tyre:{name}(file = \"sedan.tir\", mirrored = {mirrored})\n"
        )
    };
    let text = [
        "param hands = \"still.csv\"\nSteerTable:steer(file = hands)\nWorld:world -> Prismatic:x(n = [1, 0, 0], v0 = 20) -> Prismatic:y(n = [0, 1, 0]) -> Prismatic:z(q0 = 0.55) -> Revolute:yaw -> Revolute:pitch(n = [0, 1, 0]) -> Revolute:roll(n = [1, 0, 0]) -> 1[frame]:chassis\nchassis -> Body:body(m = 1200, J = diag([400, 1500, 1700]))\n",
        &corner("fl", 1.2, 0.75, 0, "DrivenRotation:tfl(angle = steer.angle)"),
        &corner("fr", 1.2, -0.75, 1, "DrivenRotation:tfr(angle = steer.angle)"),
        &corner("rl", -1.4, 0.75, 0, "FixedRotation:trl(n = [0, 0, 1], angle = 0)"),
        &corner("rr", -1.4, -0.75, 1, "FixedRotation:trr(n = [0, 0, 1], angle = 0)"),
    ];
    let model = model_with(&text.concat(), &[("still.csv", "t,angle\n0,0\n10,0\n")]);
    let drive = |model: &Model| {
        let run = Run { to: 4.0, every: Some(0.1), record: Record::All, ..Run::default() };
        model.simulate(&run, &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false)))
    };
    let straight = drive(&model);
    close(last(&straight, "y.way"), 0.0, 1e-9);
    close(last(&straight, "yaw.angle"), 0.0, 1e-9);
    let load = |done: &Simulated, wheels: &[&str]| wheels.iter().map(|w| last(done, &format!("{w}.Fz"))).sum::<f64>();
    close(load(&straight, &["fl", "fr", "rl", "rr"]), 1300.0 * 9.81, 1.0);
    close(load(&straight, &["fl", "fr"]), (1200.0 * 1.4 / 2.6 + 50.0) * 9.81, 20.0);
    let set = [Override { name: "hands".into(), value: "\"steer.csv\"".into() }];
    let round = drive(&model.with(&set).unwrap_or_else(|e| panic!("{}", e.render(false))));
    close(load(&round, &["fl", "fr", "rl", "rr"]), 1300.0 * 9.81, 20.0);
    // What the tyres push sideways is what the curve needs.
    let side: f64 = ["fl", "fr", "rl", "rr"].iter().map(|w| last(&round, &format!("{w}.Fy"))).sum();
    let [u, v] = ["x.speed", "y.speed"].map(|name| last(&round, name));
    let needed = 1300.0 * f64::hypot(u, v) * last(&round, "yaw.speed");
    assert!((side / needed - 1.0).abs() < 0.02, "{side} {needed}");
    // The outer side carries more, and a left turn leans to the right.
    assert!(load(&round, &["fr", "rr"]) > 1.3 * load(&round, &["fl", "rl"]));
    assert!(last(&round, "yaw.angle") > 0.3 && last(&round, "roll.angle") > 0.01);
}

/// A wheel in axes that do not spin is the body that spins, on an arm that goes round and tilts.
#[test]
fn a_wheel_is_a_body_that_spins() {
    let text = "World:world -> 1[frame]:ground
ground -> Revolute:a1(w0 = 0.3) -> Revolute:a2(n = [1, 0, 0], q0 = 0.4, w0 = 0.2) -> FixedTranslation:a3(d = [0.1, 0.4, 0]) -> Wheel:a(m = 2, J_axle = 0.5, J_across = 0.3, w0 = 20) -> FrameSensor:tip
ground -> Revolute:b1(w0 = 0.3) -> Revolute:b2(n = [1, 0, 0], q0 = 0.4, w0 = 0.2) -> FixedTranslation:b3(d = [0.1, 0.4, 0]) -> Revolute:b4(n = [0, 1, 0], w0 = 20) -> Body:b(m = 2, J = diag([0.3, 0.5, 0.3]))
";
    let done = run(text, &Run { rtol: 1e-12, ..exact(2.0) });
    for k in 0..=100 {
        for (a, b) in [("a1.q", "b1.q"), ("a2.q", "b2.q"), ("a.speed", "b4.speed")] {
            close(column(&done, a)[k], column(&done, b)[k], 1e-8);
        }
    }
    assert!((last(&done, "a1.q") - 0.6).abs() > 0.1);
}

/// A tyre on a hub that spins and on one that only takes its motion from a wheel.
#[test]
fn a_tyre_stands_on_hubs_that_spin() {
    let start = "-> FixedRotation:t{}(n = [0, 0, 1], angle = 0.03) ->";
    let corner = |name: &str| {
        format!(
            "ground -> Prismatic:x{name}(n = [1, 0, 0], v0 = 10) -> Prismatic:z{name}(q0 = 0.33) {}",
            start.replace("{}", name)
        )
    };
    let text = [
        "World:world -> 1[frame]:ground\n",
        &corner("a"),
        " Wheel:wheel(m = 320, J_axle = 1, J_across = 0.6, w0 = 30) -> Tyre:a(file = \"sedan.tir\")\n",
        &corner("b"),
        " Revolute:spin(n = [0, 1, 0], w0 = 30) -> 1[frame]:hub -> Body:rim(m = 320, J = diag([0.6, 1, 0.6]))\nhub -> Tyre:b(file = \"sedan.tir\")\n",
    ];
    let done = run(&text.concat(), &exact(2.0));
    for (a, b, off) in [
        ("xa.way", "xb.way", 1e-7),
        ("wheel.speed", "spin.speed", 1e-5),
        ("a.Fx", "b.Fx", 1e-2),
        ("a.Fy", "b.Fy", 1e-2),
    ] {
        close(last(&done, b), last(&done, a), off);
    }
    assert!(last(&done, "spin.angle") > 50.0 && last(&done, "a.Fy") > 500.0);
}

/// The contact of a leaning wheel: where it lies, how it moves, and what a force there does to the hub.
#[test]
fn a_contact_lies_in_the_plane_of_the_wheel() {
    let text = "World:world(g = [0, 0, 0]) -> Revolute:yaw(q0 = 0.3, w0 = 0.2) -> Prismatic:out(n = [1, 0, 0], q0 = 2, v0 = 3) -> Prismatic:up(q0 = 0.4, v0 = 0.1) -> Revolute:lean(n = [1, 0, 0], q0 = 0.5, w0 = 0.7) -> 1[frame]:hub -> Body:b(m = 2, J = diag([0.1, 0.2, 0.1]))
Wheel:wheel(m = 1, J_axle = 0.1, J_across = 0.05, w0 = 10)
hub -> wheel.a
RoadContact:road(h = 0.1*t, force = [5, 7, 11], torque = [0, 0, 2])
wheel.b -> road
";
    let done = run(text, &exact(0.1));
    let at = |name: &str| column(&done, name)[0];
    let (sin, cos) = 0.5f64.sin_cos();
    close(at("road.gamma"), 0.5, 1e-12);
    close(at("road.radius"), 0.4 / cos, 1e-12);
    close(at("road.spin"), 10.0 + 0.2 * sin, 1e-12);
    // The speed of the centre, and of the contact about it: (lean + yaw + spin) x rho, with rho = l (0, sin, -cos).
    let (l, spin) = (0.4 / cos, 10.0);
    close(at("road.Vx"), 3.0, 1e-12);
    close(at("road.slide[1]"), 3.0 - l * (0.2 * sin + spin), 1e-12);
    close(at("road.slide[2]"), 2.0 * 0.2 + 0.7 * l * cos, 1e-12);
    close(at("road.slide[3]"), 0.1 + 0.7 * l * sin, 1e-12);
    let radius = column(&done, "road.radius");
    let slope = (radius[1] - radius[0]) / 1e-3;
    close(at("road.closing"), -slope, 1e-2);
    close(at("road.closing"), -(0.1 + 0.7 * l * sin - 0.1) / cos, 1e-12);
}

/// The Calspan tyre: stiffness of slip, what friction can hold, camber, and a wheel that stands on it.
#[test]
fn the_calspan_tyre_has_its_stiffness_and_its_limit() {
    let (fz, a0, a1, a2, a3, a4) = (3829.6, 2625.0, 14.47, 12930.0, 2.29, 18175.0);
    let tyre = |name: &str, fz: f64, alpha: f64, gamma: f64| {
        format!("CalspanTyre:{name}(Fz = {fz}, alpha = {alpha}, gamma = {gamma})\n")
    };
    let text = [
        tyre("small", fz, 1e-7, 0.0),
        tyre("great", fz, -1.0, 0.0),
        tyre("leans", fz, 0.0, 1e-7),
        tyre("none", 0.0, 0.1, 0.1),
    ];
    let read = still(&text.concat(), &[]);
    let slope = (a1 * fz * (fz - a2) - a0 * a2) / a2;
    close(read("small.Fy"), 1e-7 * slope, 1e-8);
    let limit = (-4.64e-5 * fz + 1.216 + 2.18e-11 * fz * fz) * 1.0274 * fz;
    close(read("great.Fy"), limit, 1e-9);
    close(read("great.Mz"), 1.71e-5 * (limit - fz) * limit, 1e-9);
    close(read("leans.Fy"), -1e-7 * a3 * (a4 - fz) * fz / a4, 1e-8);
    close(read("none.Fy"), 0.0, 0.0);
    let text = "World:world -> Prismatic:x(n = [1, 0, 0], v0 = 10) -> Prismatic:y(n = [0, 1, 0], v0 = 0.5) -> Prismatic:z(q0 = 0.36) -> 1[frame]:hub -> Body:car(m = 380, J = diag([10, 20, 30]))
CalspanWheel:tyre(radius = 0.364325, k = 460000, c = 5000)
hub -> tyre.a
output a = y.rate.f'
";
    let done = run(text, &exact(2.0));
    close(last(&done, "z.way"), 0.364325 - 380.0 * 9.81 / 460000.0, 1e-8);
    close(column(&done, "a")[10], column(&done, "tyre.Fy")[10] / 380.0, 1e-8);
    close(last(&done, "x.speed"), 10.0, 1e-12);
    close(last(&done, "y.speed"), 0.0, 1e-6);
}

/// Roads: rows of a file, waves that get shorter, and random ones whose spectrum is that of their class.
#[test]
fn roads_have_their_profiles() {
    let text = "RoadProfile:bump(file = \"road.csv\", x = 1 m/s*t)
SweptRoad:swept(length = 50, x = 1 m/s*t)
RandomRoad:one(x = 100 m/s*t)
RandomRoad:two(seed = 2, x = 100 m/s*t)
RandomRoad:rough(class = 3, x = 100 m/s*t)
Se:push(0) -> I:mass(1)
";
    let done = run(text, &Run { to: 60.0, every: Some(0.0025), step: None, ..Run::default() });
    let at = |name: &str, t: f64| column(&done, name)[(t / 0.0025).round() as usize];
    for (x, h) in [(1.0, 0.0), (2.0, 0.05), (3.0, 0.05), (4.0, 0.0), (10.0, 0.0)] {
        close(at("bump.h", x), h, 1e-12);
    }
    close(at("bump.slope", 0.5), 0.0, 1e-2);
    let [across, up] = ["bump.n[1]", "bump.n[3]"].map(|name| at(name, 1.5));
    close(across / up, -at("bump.slope", 1.5), 1e-12);
    close(across.hypot(up), 1.0, 1e-12);
    // Over a footprint of 10 cm the slope is that of the heights at its ends.
    close(at("bump.slope", 1.5), (at("bump.h", 1.55) - at("bump.h", 1.45)) / 0.1, 1e-12);
    for x in [0.0, 3.7, 21.0, 49.9, 55.0] {
        let way = f64::min(x, 50.0);
        close(
            at("swept.h", x),
            0.01 * (2.0 * std::f64::consts::PI * (0.1 * way + 1.9 * way * way / 100.0)).sin(),
            1e-9,
        );
    }
    // The integral of 16e-6 4^2 (0.1/n)^2 from 0.01 to 4, by its waves.
    let square = |name: &str| column(&done, name).iter().map(|h| h * h).sum::<f64>() / column(&done, name).len() as f64;
    let whole = 256e-6 * 0.01 * (1.0 / 0.01 - 1.0 / 4.0);
    close(square("one.h") / whole, 1.0, 0.05);
    close(square("rough.h") / square("one.h"), 4.0, 1e-9);
    let product = column(&done, "one.h").iter().zip(column(&done, "two.h")).map(|(a, b)| a * b).sum::<f64>();
    assert!(product.abs() / column(&done, "one.h").len() as f64 / whole < 0.9);
}

/// A driver follows a lane change, another one steers as a file says.
#[test]
fn drivers_steer() {
    let text = "World:world -> RollingWheel:rear(radius = 0.3, speed0 = 50) -> 1[frame]:car -> Body:body(m = 1000, J = diag([1, 1, 1500]))
PathFollower:driver(file = \"path.csv\", wheelbase = 2.7, x = rear.x, y = rear.y, yaw = rear.yaw, speed = 15)
Sf:turn(15/2.7*tan(driver.steer)) -> rear.steer
SteerTable:hands(file = \"steer.csv\")
";
    let done = run(text, &exact(12.0));
    close(last(&done, "rear.y"), 3.0, 1e-3);
    close(last(&done, "rear.yaw"), 0.0, 1e-3);
    let x = column(&done, "rear.x");
    let before = x.iter().position(|x| *x > 10.0).expect("it drives");
    close(column(&done, "rear.y")[before], 0.0, 0.1);
    close(column(&done, "hands.angle")[10], 0.008, 1e-12);
    close(last(&done, "hands.angle"), 0.02, 1e-12);
}

/// A body that only air slows down: 1/v grows linearly.
#[test]
fn air_slows_down() {
    let text = "World:world(g = [0, 0, 0]) -> Prismatic:x(n = [1, 0, 0], v0 = 30) -> 1[frame]:hub -> Body:car(m = 1000, J = diag([1, 1, 1]))
AerodynamicDrag:air(c_w = 0.3, A = 2, wind = [-5, 0, 0])
hub -> air.a
";
    let done = run(text, &exact(20.0));
    close(1.0 / (last(&done, "x.speed") + 5.0), 1.0 / 35.0 + 1.2 * 2.0 * 0.3 / 2000.0 * 20.0, 1e-9);
    let u = last(&done, "x.speed") + 5.0;
    close(last(&done, "air.drag"), 0.36 * u * u, 1e-6);
}

/// A brake that stops a flywheel by its torque, and then holds it against another one by giving way a little.
#[test]
fn a_brake_holds_what_stands() {
    let text = "1:shaft -> I:flywheel(2, f0 = 10)
shaft -> HoldingBrake:brake(t_max = 40)
Se:load(if t < 1 then 0 else 12) -> shaft
";
    let done = run(text, &Run { to: 3.0, rtol: 1e-9, every: Some(0.01), ..Run::default() });
    // The damping while it gives way takes b z_0 of the momentum; until then the torque is less, for some z_0/u.
    let late = 1e-3 / (10.0 / 11.0);
    close(column(&done, "shaft.f")[20], 10.0 - 20.0 * (0.2 - late) - 0.05, 3e-3);
    close(last(&done, "shaft.f"), 0.0, 1e-9);
    close(last(&done, "brake.z"), 12.0 / 40.0 * 1e-3, 1e-9);
    close(last(&done, "brake.torque"), 12.0, 1e-6);
}

/// An engine at full throttle through gearbox and differential: all inertias seen from the engine.
#[test]
fn engine_gearbox_and_differential() {
    let text = "Engine:engine(file = \"engine.csv\", j = 0.2, w0 = 100, throttle = if t < 2 then 1 else 0)
Gearbox:box(gear = 2)
engine.shaft -> box.from
Differential:axle(ratio = 4)
box.to -> axle.drive
axle.left -> 1:left -> I:left_wheel(3)
axle.right -> 1:right -> I:right_wheel(6)
";
    let done = run(text, &exact(2.0));
    // Both wheels get the same torque: w_l' = T/3, w_r' = T/6, and the engine turns at 2.1 4 times their mean.
    let ratio = 2.1 * 4.0;
    let rate = 100.0 / (0.2 + 1.0 / (ratio / 2.0 * ratio / 2.0 * (1.0 / 3.0 + 1.0 / 6.0)));
    close(last(&done, "engine.w"), 100.0 + rate * 2.0, 1e-8);
    close(last(&done, "engine.w"), ratio * (last(&done, "left.f") + last(&done, "right.f")) / 2.0, 1e-9);
    let [l, r] = ["left.f", "right.f"].map(|name| last(&done, name) - column(&done, name)[0]);
    close(l, 2.0 * r, 1e-9);
    close(column(&done, "engine.torque")[10], 100.0, 1e-12);
}

/// A gear change: the sides meet at the new ratio with the momentum of both.
#[test]
fn a_gear_change_keeps_momentum() {
    let text = "discrete gear = 1
when t > 1 { gear = 3 }
Gearbox:box(gear = gear)
1:from -> I:rotor(0.5, f0 = 36)
from -> box.from
box.to -> 1:to -> I:load(2)
";
    let done = run(text, &exact(2.0));
    close(column(&done, "to.f")[10], 10.0, 1e-9);
    // (1.4^2 j + J) w = 1.4 j w_from + J w_to.
    close(last(&done, "to.f"), (1.4 * 0.5 * 36.0 + 2.0 * 10.0) / (1.96 * 0.5 + 2.0), 1e-9);
}

/// With hinges along the car and a tie rod beside the lower arm, the upright turns as the coupler of a plane four-bar.
#[test]
fn a_double_wishbone_is_a_four_bar_across_the_car() {
    let text = "World:world -> 1[frame]:car
DoubleWishbone:arms(
    lower_front = [0.2, 0.42, -0.27], lower_back = [-0.2, 0.42, -0.27], lower_outer = [0, 0.77, -0.32],
    upper_front = [0.1, 0.47, 0.1], upper_back = [-0.1, 0.47, 0.1], upper_outer = [0, 0.7, 0.12],
    tie_inner = [-0.15, 0.42, -0.27], tie_outer = [-0.15, 0.77, -0.32], spindle = [0, 0.8, -0.12],
    spring_top = [0, 0.52, 0.23], spring_foot = [0, 0.62, -0.3],
    m_lower = 1.6, c_lower = [0, 0.61, -0.29], J_lower = [0.015, 0.02, 0.035],
    m_upper = 1, c_upper = [0, 0.6, 0.11], J_upper = [0.006, 0.002, 0.008],
    m_upright = 2.5, c_upright = [0, 0.77, -0.1], J_upright = [0.014, 0.015, 0.003],
    k = 60000, l0 = 0.56, c = 0
)
car -> arms.body
car -> arms.rack
arms.hub -> Body:wheel(m = 25, J = diag([0.35, 0.68, 0.35]))
output camber = asin(arms.upright.R[3, 2])
output toe = arms.upright.R[2, 1]
";
    let done = run(text, &exact(1.0));
    let (pivot, outer, hinge, top) = ([0.42, -0.27], [0.77, -0.32], [0.47, 0.1], [0.7, 0.12]);
    let length = |a: [f64; 2], b: [f64; 2]| f64::hypot(b[0] - a[0], b[1] - a[1]);
    let (kingpin, upper) = (length(outer, top), length(hinge, top));
    let angle_of = |a: [f64; 2], b: [f64; 2]| f64::atan2(b[1] - a[1], b[0] - a[0]);
    let turned = column(&done, "arms.lower.angle");
    assert!(turned.iter().any(|q| q.abs() > 0.1), "it moves");
    for (k, q) in turned.iter().enumerate() {
        let (sin, cos) = q.sin_cos();
        let arm = [outer[0] - pivot[0], outer[1] - pivot[1]];
        // The hinge points backward: a positive angle lowers the arm.
        let foot = [pivot[0] + cos * arm[0] + sin * arm[1], pivot[1] - sin * arm[0] + cos * arm[1]];
        let d = length(foot, hinge);
        let inner = ((kingpin * kingpin + d * d - upper * upper) / (2.0 * kingpin * d)).acos();
        let camber = angle_of(foot, hinge) - inner - angle_of(outer, top);
        close(column(&done, "camber")[k], camber, 1e-9);
        close(column(&done, "toe")[k], 0.0, 1e-9);
    }
}

/// A suspension of the examples, with changes to its text, moved up and down on its bench: how the wheel stands and what holds it
/// there, against what its points alone say.
fn on_the_bench(text: &str, expected: &str) {
    let bench = ("bench.bond".to_string(), include_str!("../../../examples/suspensions/bench.bond").to_string());
    let source = Source::text("machine.bond", text).with_files(BTreeMap::from([bench]));
    let model = Model::new(source, &[]).unwrap_or_else(|e| panic!("{}\n{text}", e.render(false)));
    let run = Run { to: 12.0, rtol: 1e-9, every: Some(1.0), record: Record::All, ..Run::default() };
    let done = model.simulate(&run, &mut |_| true).unwrap_or_else(|e| panic!("{}\n{text}", e.render(false)));
    let mut rows: Vec<Vec<f64>> = Vec::new();
    for line in include_str!("../../../examples/suspensions/kinematics.csv").lines() {
        if let Some(("", row)) = line.strip_prefix(expected).map(|rest| rest.split_once(',').unwrap_or((rest, ""))) {
            rows.push(row.split(',').map(|x| x.parse().expect("a number")).collect());
        }
    }
    assert_eq!(rows.len(), 9, "{expected}");
    let travels = column(&done, "travel");
    for row in rows {
        let k = travels.iter().position(|z| (z - row[0]).abs() < 1e-8).expect("the wheel comes there");
        for (name, value) in ["camber", "toe", "track"].into_iter().zip(&row[1..]) {
            close(column(&done, name)[k], *value, 1e-8);
        }
        close(column(&done, "force")[k], row[4], 1e-2);
        if row[5] != 0.0 {
            close(column(&done, "twist")[k], row[5], 1e-7);
            close(column(&done, "link")[k], row[6], 1e-3);
        }
    }
}

/// `text` with the suspension on the right side.
fn on_the_right(text: &str, suspension: &str) -> String {
    let right = text.replace(suspension, &format!("{suspension}side = -1, "));
    right.replace("Bench:bench(", "Bench:bench(side = -1, ")
}

#[test]
fn a_double_wishbone_stands_as_its_points_say() {
    let text = include_str!("../../../examples/suspensions/double_wishbone.bond");
    on_the_bench(text, "double_wishbone");
}

#[test]
fn a_mcpherson_strut_stands_as_its_points_say() {
    let text = include_str!("../../../examples/suspensions/mcpherson.bond");
    on_the_bench(text, "mcpherson");
    on_the_bench(&on_the_right(text, "McPherson:arms("), "mcpherson");
}

/// Its height stays, the rack goes to the left and to the right.
#[test]
fn a_mcpherson_strut_is_steered_as_its_points_say() {
    let text = include_str!("../../../examples/suspensions/mcpherson.bond");
    let text =
        text.replace("Bench:bench(", "Bench:bench(stride = 0, ").replace("travel = bench.travel", "travel = rack.way");
    let rack = "car -> Prismatic:rack(n = [0, 1, 0], fixed = 1) -> arms.rack
Sf:pinion((if t < 4 then 1 else -1)*20e-3*(1 - cos(2*pi*t))) -> rack.axis";
    let text = text.replace("car -> arms.rack", rack);
    on_the_bench(&text, "mcpherson_steered");
}

#[test]
fn a_semi_trailing_arm_stands_as_its_points_say() {
    let text = include_str!("../../../examples/suspensions/trailing_arm.bond");
    on_the_bench(text, "trailing_arm");
    on_the_bench(&on_the_right(text, "TrailingArm:arms("), "trailing_arm");
}

#[test]
fn five_links_stand_as_their_points_say() {
    let text = include_str!("../../../examples/suspensions/five_link.bond");
    on_the_bench(text, "five_link");
    on_the_bench(&on_the_right(text, "FiveLink:arms("), "five_link");
}

/// A `RigidAxle:` on four links with an `AntiRollBar:`, whose wheels go up together or one against the other.
#[test]
fn a_rigid_axle_stands_as_its_points_say() {
    let text = include_str!("../../../examples/suspensions/rigid_axle.bond");
    on_the_bench(text, "rigid_axle");
    on_the_bench(&text.replace("opposite = 0", "opposite = 1"), "rigid_axle_opposite");
}

/// A steering column with a universal joint moves a rack against a spring: Newton's and Euler's equations, the closed form of
/// the joint, and the curve of the power assistance.
#[test]
fn a_column_steers_a_rack() {
    let text = "Se:hands(4*sin(3*t)) -> column.wheel
Column:column(j = 0.03, k = 90, c = 0.8, r = 0.008, bend = 0.4, phase = 0.3, assist = table(\"boost.csv\", column.torque, outside = clamp))
World:world -> Prismatic:guide(n = [0, 1, 0]) -> Body:rod(m = 3, J = diag([1, 1, 1]))
column.rack -> 1:rack -> guide.axis
rack -> C:tyres(k = 2e5)
rack -> R:friction(900)
output boost = table(\"boost.csv\", column.torque, outside = clamp)
output a = guide.rate.f'
output b = column.hands.f'
";
    let done = run(text, &exact(4.0));
    let (sin, cos) = 0.4f64.sin_cos();
    // The angle of the shaft after the joint.
    let after = |a: f64| f64::atan2(a.sin(), cos * a.cos());
    assert!(column(&done, "column.torque").iter().any(|torque| torque.abs() > 3.0));
    assert!(column(&done, "column.angle").iter().any(|angle| angle.abs() > 0.3));
    for k in 0..=100 {
        let at = |name: &str| column(&done, name)[k];
        let (q, torque) = (at("column.angle"), at("column.torque"));
        let ratio = cos / (1.0 - (sin * (q + 0.3).cos()).powi(2));
        let twist = after(q + 0.3) - after(0.3) - at("guide.way") / 0.008;
        let rate = ratio * at("column.hands.f") - at("guide.speed") / 0.008;
        close(torque, 90.0 * twist + 0.8 * rate, 1e-6);
        close(0.03 * at("b"), 4.0 * (3.0 * 0.04 * k as f64).sin() - ratio * torque, 1e-6);
        let boost = torque.signum() * 400.0 * (torque.abs() - 2.0).clamp(0.0, 10.0);
        close(at("boost"), boost, 1e-9);
        close(3.0 * at("a"), torque / 0.008 + boost - 2e5 * at("guide.way") - 900.0 * at("guide.speed"), 1e-4);
    }
}

/// A wheel that hangs on its suspension comes to rest while its spin, on which nothing depends then, stays as it is.
#[test]
fn an_equilibrium_leaves_a_free_wheel_its_spin() {
    let text = "World:world -> Prismatic:up(n = [0, 0, 1]) -> 1[frame]:car
car -> Body:hull(m = 400, J = diag([1, 1, 1]))
1:z -> up.axis
z -> C:k(1/2e4)
DoubleWishbone:arms(
    lower_front = [0.2, 0.42, -0.27], lower_back = [-0.2, 0.47, -0.265], lower_outer = [0, 0.77, -0.32],
    upper_front = [-0.1, 0.47, 0.105], upper_back = [-0.25, 0.51, 0.11], upper_outer = [-0.04, 0.695, 0.105],
    tie_inner = [-0.2, 0.42, -0.12], tie_outer = [-0.15, 0.77, -0.12], spindle = [0, 0.7979, -0.1199],
    spring_top = [-0.04, 0.52, 0.23], spring_foot = [0, 0.62, -0.27],
    m_lower = 1.611, c_lower = [0.0048, 0.6112, -0.2932], J_lower = [0.0151, 0.0207, 0.0355],
    m_upper = 1.032, c_upper = [-0.1083, 0.5972, 0.1063], J_upper = [0.00591, 0.0019, 0.00769],
    m_upright = 2.5, c_upright = [-0.0125, 0.7695, -0.1154], J_upright = [0.01428, 0.0151, 0.00331],
    k = 73574.1, l0 = 0.61331, c = 15054.5
)
car -> arms.body
car -> arms.rack
Wheel:wheel(m = 24.7, J_axle = 1.08, J_across = 0.35, w0 = 7)
arms.hub -> wheel -> Body:cap(m = 0.1, J = diag([1e-3, 1e-3, 1e-3]))
output spin = wheel.speed
";
    let done = run(text, &Run { to: 0.1, start: Start::Equilibrium, record: Record::All, ..Run::default() });
    // The spring carries everything, and nothing moves.
    let weight = 9.81 * (400.0 + 1.611 + 1.032 + 2.5 + 24.7 + 0.1);
    for (spring, spin) in column(&done, "k.e").iter().zip(column(&done, "spin")) {
        close(*spring, -weight, 1e-6);
        close(*spin, 7.0, 1e-9);
    }
}

/// A car of the examples.
fn sedan_of(text: &str) -> Model {
    let files = [
        ("car.bond", include_str!("../../../examples/sedan/car.bond")),
        ("corner.bond", include_str!("../../../examples/sedan/corner.bond")),
        ("lanes.csv", include_str!("../../../examples/sedan/lanes.csv")),
        ("sedan_tyre.tir", include_str!("../../../examples/sedan/sedan_tyre.tir")),
    ];
    let files: BTreeMap<String, String> = files.into_iter().map(|(path, text)| (path.into(), text.into())).collect();
    let source = Source::text("sedan.bond", text).with_files(files);
    Model::new(source, &[]).unwrap_or_else(|e| panic!("{}", e.render(false)))
}

/// Strokes lead through moduli that are 0 where the bodies stand straight: forms of a car, of a steered corner of it and of an axle on
/// four links begin there and go as the minimal one does.
#[test]
fn forms_of_a_suspension_begin_where_it_stands_straight() {
    let corner = "model Straight\nimport std.multibody\nimport \"corner.bond\"\nWorld:world -> 1[frame]:car\n\
                  Corner:fl(side = 1, w0 = 10)\ncar -> fl.body\ncar -> fl.rack\noutput load = fl.tyre.Fz\n\
                  output up = fl.wheel.a.r[3], turned = fl.wheel.a.R[1, 2]\n";
    let bench = ("bench.bond".to_string(), include_str!("../../../examples/suspensions/bench.bond").to_string());
    let axle = Source::text("axle.bond", include_str!("../../../examples/suspensions/rigid_axle.bond"));
    let axle =
        Model::new(axle.with_files(BTreeMap::from([bench])), &[]).unwrap_or_else(|e| panic!("{}", e.render(false)));
    let sedan = sedan_of(include_str!("../../../examples/sedan/sedan.bond"));
    let forms = |all: &[Form]| all.to_vec();
    let cases = [
        (sedan_of(corner), 0.02, 1e-6, forms(&[Form::Break, Form::Inverted])),
        (axle, 0.02, 1e-7, forms(&[Form::Lagrange])),
        (sedan, 0.005, 1e-6, forms(&[Form::Break])),
    ];
    for (model, to, off, forms) in cases {
        let run = |form| Run { to, form, rtol: 1e-8, every: Some(to / 4.0), ..Run::default() };
        let of = |form| model.simulate(&run(form), &mut |_| true);
        let minimal = of(Form::Minimal).unwrap_or_else(|e| panic!("{}", e.render(false)));
        for form in forms {
            let other = of(form).unwrap_or_else(|e| panic!("{} {form}: {}", model.name(), e.render(false)));
            let shared = |column: &&Column| minimal.trace.columns.iter().any(|own| own.name == column.name);
            for theirs in other.trace.columns.iter().filter(shared) {
                let own = column(&minimal, &theirs.name);
                let most = own.iter().fold(1e-3f64, |most, v| most.max(v.abs()));
                for (a, b) in own.iter().zip(&theirs.values) {
                    let name = &theirs.name;
                    assert!((a - b).abs() <= off * most, "{} {form}: {name} is {b}, not {a}", model.name());
                }
            }
        }
    }
}

/// A car of the examples, by explicit steps of a millisecond.
fn sedan(text: &str, to: f64) -> Simulated {
    let model = sedan_of(text);
    let (method, step) = (Method::Fixed(FixedMethod::Rk4), Some(1e-3));
    let run = Run { to, every: Some(0.01), record: Record::All, method, step, ..Run::default() };
    model.simulate(&run, &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false)))
}

/// What it weighs, in N.
const WEIGHT: f64 = 9.81 * (1550.0 + 1.889 + 4.0 * (1.611 + 1.032 + 2.5 + 24.7));

/// The forces of the tyres forward, along the axes of the road: toe turns them.
fn forward(done: &Simulated, sample: usize) -> f64 {
    let at = |name: String| column(done, &name)[sample];
    let of = |w: &str| {
        let (cos, sin) = (at(format!("car.{w}.wheel.b.R[2,2]")), -at(format!("car.{w}.wheel.b.R[1,2]")));
        (at(format!("car.{w}.tyre.Fx")) * cos - at(format!("car.{w}.tyre.Fy")) * sin) / cos.hypot(sin)
    };
    ["fl", "fr", "rl", "rr"].iter().map(|w| of(w)).sum()
}

/// It runs straight, carried by its tyres.
#[test]
fn the_sedan_runs_straight_on_its_wheels() {
    let done = sedan(include_str!("../../../examples/sedan/sedan.bond"), 1.5);
    let load: f64 = ["fl", "fr", "rl", "rr"].iter().map(|w| last(&done, &format!("load_{w}"))).sum();
    close(load, WEIGHT, 1e-2 * WEIGHT);
    close(last(&done, "y"), 0.0, 1e-6);
    close(last(&done, "yaw_rate"), 0.0, 1e-6);
    close(last(&done, "x"), 30.0, 0.05);
    close(last(&done, "roll"), 0.0, 1e-6);
}

/// It slips to neither side but for rounding, which no step is made shorter for.
#[test]
fn rounding_at_the_sides_of_a_straight_run_is_no_event() {
    let run = Run { to: 0.02, method: Method::Radau, ..Run::default() };
    let done = sedan_of(include_str!("../../../examples/sedan/sedan.bond")).simulate(&run, &mut |_| true);
    let report = done.unwrap_or_else(|e| panic!("{}", e.render(false))).report;
    assert!(report.steps < 200 && report.switches < 100, "{} steps, {} switches", report.steps, report.switches);
}

/// Braked, it slows down by the forces of its tyres, and wheels that roll by what is left of the torques.
#[test]
fn the_sedan_brakes_as_its_torques_say() {
    let done = sedan(include_str!("../../../examples/sedan/braking.bond"), 2.5);
    let change = |name: &str| column(&done, name)[250] - column(&done, name)[150];
    let force = forward(&done, 200);
    close(WEIGHT / 9.81 * change("speed"), force, 2e-3 * force.abs());
    for w in ["fl", "rr"] {
        let of = |name: &str| column(&done, &format!("car.{w}.{name}"))[200];
        let torques = of("tyre.law.My") - of("tyre.Fx") * of("tyre.radius");
        let brake = column(&done, &format!("car.brake_{w}.torque"))[200];
        close(1.08 * change(&format!("car.{w}.wheel.rate.f")), torques - brake, 5e-3 * brake);
    }
    assert!(change("speed") < -4.0 && last(&done, "car.floating.y.q").abs() < 1e-3);
}

/// Brakes hold what pulls it down.
#[test]
fn the_sedan_stands_on_a_slope() {
    let done = sedan(include_str!("../../../examples/sedan/slope.bond"), 5.0);
    let pull = WEIGHT * 0.15 / f64::hypot(1.0, 0.15);
    // It rocks on its tyres: over the last second.
    close((400..500).map(|k| forward(&done, k)).sum::<f64>() / 100.0, pull, 5e-3 * pull);
    close(last(&done, "speed"), 0.0, 5e-3);
    close(last(&done, "x"), 0.0, 0.02);
}

/// The driver keeps to the lanes.
#[test]
fn the_sedan_changes_lanes() {
    let done = sedan(include_str!("../../../examples/sedan/lane_change.bond"), 5.5);
    let (x, y) = (column(&done, "x"), column(&done, "y"));
    let at = |place: f64| y[x.iter().position(|x| *x >= place).expect("it gets there")];
    close(at(60.0), 3.5, 0.1);
    close(at(105.0), 0.0, 0.1);
    let lateral = column(&done, "lateral").iter().fold(0.0f64, |most, a| most.max(a.abs()));
    assert!((4.0..8.0).contains(&lateral), "{lateral}");
}

/// The car at rest where nothing moves it, to rounding: no run settles it.
fn at_rest(text: &str) -> Simulated {
    let run = Run { to: 0.05, start: Start::Equilibrium, record: Record::All, ..Run::default() };
    sedan_of(text).simulate(&run, &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false)))
}

/// Without brakes it stands on level ground, as high on its left as on its right: nothing pushes it on, or holds a wheel.
#[test]
fn the_sedan_has_an_equilibrium_on_level_ground() {
    let done = at_rest(&include_str!("../../../examples/sedan/sedan.bond").replace("u0 = 20 m/s", "u0 = 0 m/s"));
    for sample in [0, column(&done, "z").len() - 1] {
        let at = |name: &str| column(&done, name)[sample];
        close(["fl", "fr", "rl", "rr"].iter().map(|w| at(&format!("load_{w}"))).sum(), WEIGHT, 1e-9 * WEIGHT);
        close(at("load_fl"), at("load_fr"), 1e-9 * WEIGHT);
        close(at("load_rl"), at("load_rr"), 1e-9 * WEIGHT);
        close(at("roll"), 0.0, 1e-12);
        close(at("speed"), 0.0, 1e-12);
        close(forward(&done, sample), 0.0, 1e-9 * WEIGHT);
        for w in ["fl", "rr"] {
            close(
                at(&format!("car.{w}.tyre.law.My")),
                at(&format!("car.{w}.tyre.Fx")) * at(&format!("car.{w}.tyre.radius")),
                1e-6,
            );
        }
    }
}

/// Braked on a slope it stands where its tyres have given way as far as they hold it, both sides alike, each by less than a
/// hundredth of a metre.
#[test]
fn the_sedan_has_an_equilibrium_on_a_slope() {
    let done = at_rest(include_str!("../../../examples/sedan/slope.bond"));
    let pull = WEIGHT * 0.15 / f64::hypot(1.0, 0.15);
    for sample in [0, column(&done, "x").len() - 1] {
        let at = |name: &str| column(&done, name)[sample];
        close(forward(&done, sample), pull, 1e-9 * WEIGHT);
        close(at("speed"), 0.0, 1e-10);
        assert!((-0.01..-1e-3).contains(&at("x")) && at("car.y").abs() < 1e-6, "{} {}", at("x"), at("car.y"));
        for name in ["u", "v"] {
            let [left, right] = ["fl", "fr"].map(|w| at(&format!("car.{w}.tyre.{name}")));
            close(left, right, 1e-7);
            assert!((0.0..0.01).contains(&left), "{name}: {left}");
        }
    }
}
