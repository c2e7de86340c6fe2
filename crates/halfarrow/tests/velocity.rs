//! Relations that only speeds keep: how far positions drift from them, and runs that put them back.
#![allow(clippy::disallowed_methods, reason = "values to compare with")]

use halfarrow::{Error, FixedMethod, Form, Method, Model, Record, Run, Simulated};

fn model(text: &str) -> Model {
    Model::from_text("test.bond", text, &[]).unwrap_or_else(|e| panic!("{}\n{text}", e.render(false)))
}

fn run(text: &str, run: &Run) -> Simulated {
    let run = Run { record: Record::All, ..run.clone() };
    model(text).simulate(&run, &mut |_| true).unwrap_or_else(|e| panic!("{}\n{text}", e.render(false)))
}

fn refusal(text: &str, run: &Run) -> String {
    match model(text).simulate(run, &mut |_| true) {
        Ok(_) => panic!("it is not refused"),
        Err(Error::Run(stopped)) => stopped.to_string(),
        Err(error) => error.render(false),
    }
}

fn column<'a>(done: &'a Simulated, name: &str) -> &'a [f64] {
    let found = done.trace.columns.iter().find(|c| c.name == name);
    &found.unwrap_or_else(|| panic!("nothing called {name}")).values
}

fn last(done: &Simulated, name: &str) -> f64 {
    *column(done, name).last().expect("there are samples")
}

fn greatest(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(0.0, |most, v| v.abs().max(most))
}

/// The drifts told, by their relations.
fn told(done: &Simulated) -> Vec<(&str, &str, f64)> {
    done.report.audit.drift.iter().map(|d| (d.relation.as_str(), d.kind, d.value.unwrap_or(f64::NAN))).collect()
}

/// Methods with a step of each kind, at which a hundred turns drift by 1e-10 and more.
fn coarse(to: f64) -> [Run; 3] {
    let run = |method, step, rtol| Run { to, method, step, rtol, every: Some(to / 999.0), ..Run::default() };
    [
        run(Method::Explicit, None, 1e-7),
        run(Method::Fixed(FixedMethod::Rk4), Some(to / 20_000.0), 1e-6),
        run(Method::Radau, None, 1e-7),
    ]
}

const R: f64 = 0.1;
const L: f64 = 0.3;

/// A slider-crank as a textbook draws it: two transformers for either direction, and a guide.
fn slider_crank(drive: &str) -> String {
    let (theta, phi) = (0.3f64, (R / L * 0.3f64.sin()).asin());
    format!(
        "model SliderCrank\nparam r = {R} m, l = {L} m\nstate theta' = w.f from {theta:?} rad\nstate phi' = v.f from {phi:?} rad\n\
         state x' = slide.f from {:?} m\n{drive}1:v -> I:rod(0.001 kg.m2)\n\
         w -> TF:wx(f_out = -r*sin(theta)) -> 0:along\nv -> TF:vx(f_out = -l*sin(phi)) -> along\nalong -> 1:slide -> I:slider(0.5 kg)\n\
         w -> TF:wy(f_out = r*cos(theta)) -> 0:across\nv -> TF:vy(f_out = -l*cos(phi)) -> across\nacross -> ZC:guide\n\
         output E = 0.001*w.f^2 + 0.0005*v.f^2 + 0.25*slide.f^2\n",
        R * theta.cos() + L * phi.cos()
    )
}

const FREE: &str = "1:w -> I:crank(0.002 kg.m2, f0 = 200 rad/s)\n";
const DRIVEN: &str = "Sf:motor(100 rad/s) -> 1:w\n";

/// The drift told is that of the closed form, whatever the method; with projection there is none, and what it changes costs
/// no energy.
#[test]
fn a_slider_crank_of_transformers_drifts_and_is_put_back() {
    for (drive, to) in [(DRIVEN, std::f64::consts::TAU), (FREE, 6.5)] {
        let text = slider_crank(drive);
        for coarse in coarse(to) {
            let done = run(&text, &coarse);
            assert!(last(&done, "theta") > 100.0 * std::f64::consts::TAU - 1e-6, "{}", last(&done, "theta"));
            let [theta, phi, x] = ["theta", "phi", "x"].map(|name| last(&done, name));
            let along = L * phi.cos() - x + R * theta.cos();
            let across = R * theta.sin() - L * phi.sin();
            assert_eq!(told(&done).len(), 2, "{:?}", told(&done));
            for (relation, kind, drift) in told(&done) {
                let wanted = if relation.contains('x') { along } else { across };
                assert_eq!(kind, "closed");
                assert!((drift.abs() - wanted.abs()).abs() < 1e-14, "{relation}: {drift:e} {wanted:e}");
            }
            assert!(greatest([along, across]) > 1e-10, "{:?}: {along:e} {across:e}", coarse.method);
            let done = run(&text, &Run { project: true, every: None, ..coarse.clone() });
            let places = column(&done, "theta").iter().zip(column(&done, "x"));
            let exact = |theta: f64| R * theta.cos() + (L * L - (R * theta.sin()).powi(2)).sqrt();
            let error = greatest(places.map(|(&theta, x)| x - exact(theta)));
            assert!(error < 1e-12, "{:?}: {error:e}", coarse.method);
            assert!(greatest(told(&done).iter().map(|t| t.2)) < 1e-12, "{:?}", told(&done));
            assert!(done.report.projections > done.report.steps / 2);
        }
        let fine = Run { to, rtol: 1e-12, project: true, ..Run::default() };
        let done = run(&text, &fine);
        if drive == FREE {
            let energy = column(&done, "E");
            assert!(greatest(energy.iter().map(|e| e / energy[0] - 1.0)) < 1e-9);
        }
    }
}

/// Angles of coupler and rocker from that of the crank: the joint between them is where two circles meet.
fn crank_rocker(th1: f64) -> (f64, f64) {
    let (a, b, c, d) = (0.2, 0.5, 0.4, 0.55);
    let (x, y) = (a * th1.cos(), a * th1.sin());
    let (dx, dy) = (d - x, -y);
    let square = dx * dx + dy * dy;
    let part = (square + b * b - c * c) / (2.0 * square);
    let high = (b * b / square - part * part).sqrt();
    let (jx, jy) = (x + part * dx - high * dy, y + part * dy + high * dx);
    ((jy - y).atan2(jx - x), jy.atan2(jx - d))
}

/// A four-bar of transformers alone, two at each junction that closes the loop.
fn four_bar(drive: &str) -> String {
    let th1 = 0.6;
    let (th2, th3) = crank_rocker(th1);
    format!(
        "model FourBar\nparam a = 0.2 m, b = 0.5 m, c = 0.4 m\nstate th1' = crank.f from {th1:?}\nstate th2' = coupler.f from {th2:?}\n\
         state th3' = rocker.f from {th3:?}\n{drive}1:coupler -> I:I2(0.002 kg.m2)\n1:rocker -> I:I3(0.01 kg.m2)\n\
         crank -> TF:ax(f_out = -a*sin(th1)) -> 0:along\ncoupler -> TF:bx(f_out = -b*sin(th2)) -> along\n\
         rocker -> TF:cx(f_out = c*sin(th3)) -> along\nalong -> ZC:pinx\n\
         crank -> TF:ay(f_out = a*cos(th1)) -> 0:across\ncoupler -> TF:by(f_out = b*cos(th2)) -> across\n\
         rocker -> TF:cy(f_out = -c*cos(th3)) -> across\nacross -> ZC:piny\n\
         output E = 0.005*crank.f^2 + 0.001*coupler.f^2 + 0.005*rocker.f^2\n"
    )
}

#[test]
fn a_four_bar_of_transformers_drifts_and_is_put_back() {
    let driven = "Sf:motor(20 rad/s) -> 1:crank\n";
    let free = "1:crank -> I:I1(0.01 kg.m2, f0 = 20)\n";
    for (drive, to) in [(driven, 10.0 * std::f64::consts::PI), (free, 34.0)] {
        let text = four_bar(drive);
        for coarse in coarse(to) {
            let done = run(&text, &coarse);
            assert!(last(&done, "th1") > 100.0 * std::f64::consts::TAU, "{}", last(&done, "th1"));
            let (a, b, c, d) = (0.2, 0.5, 0.4, 0.55);
            let [one, two, three] = ["th1", "th2", "th3"].map(|name| last(&done, name));
            let along = a * one.cos() + b * two.cos() - c * three.cos() - d;
            let across = a * one.sin() + b * two.sin() - c * three.sin();
            assert_eq!(told(&done).len(), 2, "{:?}", told(&done));
            for (relation, kind, drift) in told(&done) {
                let wanted = if relation.contains("cos") { along } else { across };
                assert_eq!(kind, "closed");
                assert!((drift.abs() - wanted.abs()).abs() < 1e-14, "{relation}: {drift:e} {wanted:e}");
            }
            let done = run(&text, &Run { project: true, every: None, ..coarse.clone() });
            let mut worst = 0.0f64;
            for (k, th1) in column(&done, "th1").iter().enumerate() {
                let (th2, th3) = crank_rocker(*th1);
                worst = worst.max((column(&done, "th2")[k] - th2).abs()).max((column(&done, "th3")[k] - th3).abs());
            }
            assert!(worst < 1e-11, "{:?}: {worst:e}", coarse.method);
        }
        if drive == free {
            let done = run(&text, &Run { to, rtol: 1e-12, project: true, ..Run::default() });
            let energy = column(&done, "E");
            assert!(greatest(energy.iter().map(|e| e / energy[0] - 1.0)) < 1e-9);
        }
    }
}

const SLEIGH: &str = "model Sleigh
param m = 2, j = 0.3, l = 0.4
state phi' = w.f from 0.3
state x' = u.f
state y' = v.f
1:w -> I:turn(j, f0 = 1.5)
1:u -> I:Iu(m, f0 = 1)
1:v -> I:Iv(m)
constraint edge: v.f*cos(phi) - u.f*sin(phi) = l*w.f
";

/// An edge binds speeds and no positions: that is said, and nothing is put back.
#[test]
fn a_nonholonomic_relation_is_said_to_be_one_and_left_alone() {
    let plain = Run { to: 3.0, ..Run::default() };
    let (free, asked) = (run(SLEIGH, &plain), run(SLEIGH, &Run { project: true, ..plain.clone() }));
    for done in [&free, &asked] {
        let [drift] = &done.report.audit.drift[..] else { panic!("{:?}", told(done)) };
        assert_eq!((drift.kind, drift.value), ("nonholonomic", None), "{drift:?}");
    }
    assert!(asked.report.notes.iter().any(|note| note.contains("nonholonomic")), "{:?}", asked.report.notes);
    assert_eq!(free.trace, asked.trace);
}

/// A disc that rolls where it is steered has two such relations; the way that it rolls along a straight line is one of
/// positions.
#[test]
fn rolling_is_holonomic_on_a_line_alone() {
    let steered = "model Disc\nparam r = 0.25\nstate phi' = turn.f from 0.3\nstate x' = u.f\nstate y' = v.f\nstate s' = spin.f\n\
        1:turn -> I:It(0.1, f0 = 0.7)\n1:spin -> I:Is(0.2, f0 = 9)\n1:u -> I:Iu(2)\n1:v -> I:Iv(2)\n\
        constraint ahead: u.f = r*cos(phi)*spin.f\nconstraint aside: v.f = r*sin(phi)*spin.f\n";
    let done = run(steered, &Run { to: 1.0, ..Run::default() });
    assert!(done.report.audit.drift.iter().all(|d| d.kind == "nonholonomic"), "{:?}", told(&done));
    assert_eq!(told(&done).len(), 2);
    // Nothing turns it: the ratios are constant, and every method keeps what they bind.
    let straight = steered.replace("state phi' = turn.f from 0.3\n", "param phi = 0.3\n");
    assert_eq!(told(&run(&straight, &Run { to: 1.0, ..Run::default() })), []);
}

/// The length of an ellipse's arc has no closed form: its drift is measured along the run, and it is not put back.
#[test]
fn a_relation_without_a_closed_form_is_measured_along_the_run() {
    let text = "model Arc\nstate th' = w.f\nstate s' = bead.f\n1:w -> I:wheel(1, f0 = 3)\n\
        w -> TF:arc(f_out = sqrt(1 + 3*sin(th)^2)) -> 1:bead -> I:mass(0.2)\n";
    let coarse = Run { to: 20.0, method: Method::Fixed(FixedMethod::Rk4), step: Some(0.05), ..Run::default() };
    let done = run(text, &coarse);
    let (&[(_, kind, drift)], resolution) = (&told(&done)[..], done.report.audit.drift[0].resolution) else { panic!() };
    assert_eq!(kind, "open");
    // The arc by Gauss's rule on many small pieces.
    let speed = |th: f64| (1.0 + 3.0 * th.sin() * th.sin()).sqrt();
    let (th, pieces) = (last(&done, "th"), 4000);
    let node = (0.6f64).sqrt();
    let arc: f64 = (0..pieces)
        .map(|k| {
            let (h, mid) = (0.5 * th / pieces as f64, th * (k as f64 + 0.5) / pieces as f64);
            h * (5.0 * speed(mid - h * node) + 8.0 * speed(mid) + 5.0 * speed(mid + h * node)) / 9.0
        })
        .sum();
    let wanted = last(&done, "s") - arc;
    assert!(
        wanted.abs() > 1e-6 && (drift.abs() - wanted.abs()).abs() < resolution + 0.1 * wanted.abs(),
        "{drift:e} {wanted:e} {resolution:e}"
    );
    let said = refusal(text, &Run { project: true, ..coarse });
    assert!(said.contains("no closed form") && said.contains("constraint"), "{said}");
}

/// What events do to positions is no drift, and stays when they are put back.
#[test]
fn a_reset_position_is_no_drift() {
    let text = slider_crank(FREE) + "when theta > 20 { reset x = x + 0.05 }\n";
    let coarse = Run { to: 1.0, method: Method::Fixed(FixedMethod::Rk4), step: Some(5e-4), ..Run::default() };
    for project in [false, true] {
        let done = run(&text, &Run { project, ..coarse.clone() });
        let [theta, phi, x] = ["theta", "phi", "x"].map(|name| last(&done, name));
        let along = L * phi.cos() - x + R * theta.cos() + 0.05;
        let drift = greatest(told(&done).iter().filter(|t| t.0.contains('x')).map(|t| t.2));
        assert!((drift - along.abs()).abs() < 1e-14, "{drift:e} {along:e}");
        assert_eq!(project, drift < 1e-13, "{drift:e}");
    }
}

/// The multiplier forms hold their relations themselves, and formulas of many steps cannot go on from another point.
#[test]
fn what_cannot_be_put_back_is_refused() {
    let text = slider_crank(FREE);
    let said = refusal(&text, &Run { project: true, method: Method::Bdf, ..Run::default() });
    assert!(said.contains("bdf") && said.contains("radau"), "{said}");
    let said = refusal(&text, &Run { project: true, form: Form::Lagrange, ..Run::default() });
    assert!(said.contains("lagrange") && said.contains("minimal"), "{said}");
    let done = run("model Mass\n1:v -> I:m(1)\n", &Run { project: true, ..Run::default() });
    assert!(done.report.notes.iter().any(|note| note.contains("nothing to do")), "{:?}", done.report.notes);
}

/// The length of a spring from the end of a chain back to the ground follows from the angles, though no closed form is found for
/// it: that is told of many joints as of few.
#[test]
fn the_spring_along_a_chain_binds_positions() {
    for size in [5, 26] {
        let text = format!(
            "model Chain\nimport std.multibody\nWorld:world -> 1[frame]:link[0]\nfor i in 1..{size} {{\n\
             Revolute:hinge[i](n = if mod(i, 2) == 1 then [0, 1, 0] else [1, 0, 0], q0 = 0.1*i)\n\
             link[i - 1] -> hinge[i] -> FixedTranslation:arm[i](d = [0.1, 0.2, -0.3]) -> 1[frame]:link[i]\n\
             link[i] -> Body:body[i](m = 1, J = diag([0.1, 0.2, 0.15]))\n}}\n\
             Line:line\nlink[0] -> line.a\nlink[{size}] -> line.b\n0:tension -> line.axis\ntension -> C:spring(e = 10*q)\n"
        );
        let method = Method::Fixed(FixedMethod::Rk4);
        let done = run(&text, &Run { to: 1e-3, method, step: Some(1e-3), ..Run::default() });
        let kinds: Vec<&str> = done.report.audit.drift.iter().map(|d| d.kind).collect();
        assert_eq!(kinds, ["open"], "{size}");
    }
}
