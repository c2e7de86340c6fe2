//! The audit is obeyed, and raises no false alarm: models that went wrong, runs made wrong on purpose, random sound graphs.
#![allow(clippy::disallowed_methods, clippy::excessive_precision, reason = "values to compare with")]

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;
use std::sync::Arc;

use halfarrow::{
    AuditReport, Compare, Error, Failure, FixedMethod, Form, Method, Model, Override, RealTimeRun, Record, Reduce, Run,
    Simulated, Start, Stopped, Sweep, Vary, Verdict,
};
use halfarrow_compiler::ast;
use halfarrow_compiler::bond_graph::{self, BondGraph, FileError, Files};
use halfarrow_compiler::diagnostic::Sources;

fn fault(name: &str) -> Model {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/faults").join(format!("{name}.bond"));
    Model::load(&path, &[]).unwrap_or_else(|e| panic!("{}", e.render(false)))
}

fn text(text: &str) -> Model {
    Model::from_text("m.bond", text, &[]).unwrap_or_else(|e| panic!("{}", e.render(false)))
}

/// The audit of a run that came to its end, or why it stopped.
fn run(model: &Model, run: &Run) -> Result<Simulated, Box<Stopped>> {
    match model.simulate(run, &mut |_| true) {
        Ok(done) => Ok(done),
        Err(Error::Run(stopped)) => Err(stopped),
        Err(error) => panic!("{}", error.render(false)),
    }
}

const FORMS: [Form; 6] = [Form::Minimal, Form::Kane, Form::Inverted, Form::Break, Form::Relaxed, Form::Lagrange];

fn laws(audit: &AuditReport) -> f64 {
    [&audit.residual, &audit.power].into_iter().flatten().fold(0.0f64, |most, miss| most.max(miss.value))
}

#[test]
fn a_law_that_is_broken_is_refused_in_every_form() {
    for name in ["wrong_flow", "wrong_flow_big"] {
        let model = fault(name);
        for form in FORMS.into_iter().filter(|form| model.equations(*form).is_ok()) {
            match run(&model, &Run { form, ..Run::default() }) {
                Ok(done) => {
                    let audit = done.report.audit;
                    assert!(laws(&audit) < 1e-6 && audit.verdict == Verdict::Holds, "{name} {form:?}: {audit:?}");
                }
                Err(stopped) => {
                    assert!(matches!(stopped.failure, Failure::Untrue { .. }), "{name} {form:?}: {}", stopped.failure);
                    assert_eq!(stopped.report.audit.verdict, Verdict::Refused);
                    assert!(stopped.to_string().contains("do not use it: "), "{stopped}");
                }
            }
        }
    }
}

#[test]
fn what_is_zero_but_for_rounding_raises_no_alarm() {
    for name in ["false_alarm", "false_alarm_lagrange"] {
        let model = fault(name);
        for form in FORMS.into_iter().filter(|form| model.equations(*form).is_ok()) {
            let audit = match run(&model, &Run { form, to: 2.0, ..Run::default() }) {
                Ok(done) => done.report.audit,
                // A law with several solutions may end a run; its audit is clean up to there.
                Err(stopped) => {
                    assert!(!matches!(stopped.failure, Failure::Untrue { .. }), "{name} {form:?}: {}", stopped.failure);
                    stopped.report.audit
                }
            };
            assert!(laws(&audit) < 1e-9 && audit.verdict == Verdict::Holds, "{name} {form:?}: {audit:?}");
        }
    }
}

/// Compliances in parallel, one of which is flat at 0, where all of them start: its inverse has an infinite slope there.
#[test]
fn a_dependent_storage_with_a_flat_law_runs_in_its_own_variable() {
    let model = fault("field_nonlinear");
    let end = |form: Form, method: Method| {
        let wanted = Run { to: 2.0, form, method, rtol: 1e-9, record: Record::All, ..Run::default() };
        let done = run(&model, &wanted).unwrap_or_else(|stopped| panic!("{form:?}: {}", stopped.failure));
        let column =
            |name: &str| done.trace.columns.iter().find(|c| c.name == name).map(|c| c.values[c.values.len() - 1]);
        ["x1s", "I1x.f", "C1x.e"].map(|name| column(name).unwrap_or(f64::NAN))
    };
    let wanted = end(Form::Minimal, Method::Auto);
    for (form, method) in [(Form::Minimal, Method::Radau), (Form::Break, Method::Auto), (Form::Lagrange, Method::Auto)]
    {
        for (value, wanted) in end(form, method).into_iter().zip(wanted) {
            assert!((value - wanted).abs() <= 1e-6 * wanted.abs(), "{form:?}: {value}, not {wanted}");
        }
    }
}

#[test]
fn a_pole_stops_the_run_with_the_name_of_its_source() {
    let model = fault("pole");
    for form in [Form::Minimal, Form::Lagrange] {
        for every in [None, Some(0.25)] {
            let stopped = run(&model, &Run { form, every, ..Run::default() }).expect_err("1/0 at its end");
            let Failure::NotFinite { time, what } = &stopped.failure else { panic!("{}", stopped.failure) };
            assert!(*time == 1.0 && what.to_string().contains("s.e"), "{}", stopped.failure);
            let finite = stopped.trace.columns.iter().flat_map(|c| &c.values).all(|v| v.is_finite());
            assert!(finite && stopped.report.audit.verdict != Verdict::Refused, "what came before is kept");
        }
    }
    let fixed = Run { to: 2.0, method: Method::Fixed(FixedMethod::Rk4), step: Some(0.125), ..Run::default() };
    let stopped = run(&model, &fixed).expect_err("1/0 on the way");
    let said = stopped.to_string();
    assert!(said.contains("t = 1 s") && said.contains("s.e"), "{said}");
    // A step of variable length never gets there, but says what grows.
    let stopped = run(&model, &Run { to: 2.0, ..Run::default() }).expect_err("it cannot pass");
    assert!(stopped.report.notes.iter().any(|note| note.contains("s.e grows without bound")), "{:?}", stopped.report);
    // What leaps over the pole misses the law of the mass.
    let over = Run { to: 3.0, method: Method::Fixed(FixedMethod::Rk4), step: Some(0.3), ..Run::default() };
    let stopped = run(&model, &over).expect_err("no step of 0.3 s follows it");
    assert!(matches!(stopped.failure, Failure::Untrue { .. }), "{}", stopped.failure);
}

#[test]
fn an_output_that_is_infinite_is_said() {
    let model = text("model M\n1:a -> I:m(1, f0 = 0)\nSe:s(1) -> a\noutput ratio = 1 / m.f\n");
    let done = run(&model, &Run::default()).unwrap_or_else(|stopped| panic!("{stopped}"));
    assert!(done.report.notes.iter().any(|note| note.contains("`ratio` is infinite at t = 0 s")), "{:?}", done.report);
}

/// 1 kg on a spring of 100 N/m: 10 rad/s.
const OSCILLATOR: &str = "model M\nparam k = 100\n1:a -> I:m(1, f0 = 1)\na -> C:spring(k = k)\na -> R:d(0.1)\n";

#[test]
fn a_step_that_is_too_long_is_said_and_refused() {
    let model = text(OSCILLATOR);
    let with = |method, step| Run { to: 2.0, method: Method::Fixed(method), step: Some(step), ..Run::default() };
    let verdict = |method, step| match run(&model, &with(method, step)) {
        Ok(done) => {
            let said = done.report.notes.iter().any(|note| note.contains("shorten --step"));
            assert_eq!(said, done.report.audit.verdict == Verdict::Doubtful, "{:?}", done.report);
            done.report.audit.verdict
        }
        Err(stopped) => {
            assert!(stopped.to_string().contains("shorten --step"), "{stopped}");
            Verdict::Refused
        }
    };
    assert_eq!(verdict(FixedMethod::Rk4, 1e-3), Verdict::Holds);
    assert_eq!(verdict(FixedMethod::Heun, 1e-2), Verdict::Doubtful);
    assert_eq!(verdict(FixedMethod::Euler, 2e-2), Verdict::Refused);
}

#[test]
fn a_long_rest_before_a_motion_raises_no_alarm() {
    // More than a chunk of samples at rest, with rounding errors, before anything moves.
    let model = text(
        "model M\n1:a -> I:m(3)\na -> C:spring(k = 7)\na -> R:d(0.3)\nSe:s(0.1 + 0.2 - 0.3 + if t < 9 then 0 else 5) -> a\n",
    );
    let step = Run { to: 10.0, method: Method::Fixed(FixedMethod::Rk4), step: Some(1e-3), ..Run::default() };
    for wanted in [step, Run { to: 10.0, ..Run::default() }] {
        let done = run(&model, &wanted).unwrap_or_else(|stopped| panic!("{stopped}"));
        assert_eq!(done.report.audit.verdict, Verdict::Holds, "{:?}", done.report.audit);
    }
}

/// Where everything is 0, a root law too, that is the solution, and rounding of it is no miss.
#[test]
fn where_all_is_zero_all_is_well() {
    let dead = text(
        "model Dead\n0:z\n0:y\n1:o\ny -> TF:t(1.203) -> z\nz -> R:a(f = 2*sign(e)*sqrt(abs(e)))\n\
         y -> R:b(e = 0.389*tanh(1.490*f) + 0.2*f)\no -> I:m(1, p0 = 0.5)\n",
    );
    let resting = text(
        "model Rest\n0:z\n1:o\n1:p\nstate phi' = p.f from 1.239\nz -> GY:g(0.5 + 0.2*cos(phi)) -> o\n\
         I:f[x, y](m = [[3, 2], [2, 4]])\np -> f.x\no -> f.y\nz -> C:c(e = 2.193*sinh(q))\nz -> I:m(1.758)\n\
         o -> I:n(1, p0 = 0.5)\n",
    );
    for (model, start) in [(&dead, Start::Given), (&resting, Start::Equilibrium)] {
        let asked = Run { to: 0.4, every: Some(0.05), rtol: 1e-9, start, record: Record::All, ..Run::default() };
        let done = run(model, &asked).unwrap_or_else(|stopped| panic!("{}", stopped.failure));
        assert_eq!(done.report.audit.verdict, Verdict::Holds, "{:?}", done.report.audit.warnings);
    }
}

/// What a controller holds against its weight moves by what the tolerance leaves of either.
#[test]
fn what_is_held_at_rest_raises_no_alarm() {
    let held = "model Held\nimport std.signals\n1:v -> I:m(2)\nstate x' = v.f from 0\nSe:w(-19.62) -> v\nPID:pid(error = 0.3 - x, kp = 200, ki = 50, kd = 20)\nSe:act(pid.u) -> v\n";
    let cruise = "model Cruise\nimport std.signals\n1:v -> I:m(1000)\nPID:pid(error = 20 - v.f, kp = 500, ki = 50)\nSe:act(pid.u) -> v\nv -> R:drag(e = 0.5*f*abs(f))\nSe:hill(-1000*9.81*sin(0.05)) -> v\n";
    for model in [text(held), text(cruise)] {
        for to in [0.5, 1.0, 10.0] {
            let audit =
                run(&model, &Run { to, start: Start::Equilibrium, ..Run::default() }).expect("it rests").report.audit;
            assert_eq!(audit.verdict, Verdict::Holds, "{to} s: {audit:?}");
        }
    }
}

#[test]
fn what_comes_to_rest_raises_no_alarm() {
    let model = text("model M\n1:a -> I:m(1, f0 = 1)\na -> R:d(50)\na -> C:spring(k = 3, q0 = 1)\nSe:w(3) -> a\n");
    for form in [Form::Minimal, Form::Lagrange, Form::Break] {
        let done =
            run(&model, &Run { to: 2000.0, form, ..Run::default() }).unwrap_or_else(|stopped| panic!("{stopped}"));
        assert_eq!(done.report.audit.verdict, Verdict::Holds, "{form:?} {:?}", done.report.audit);
    }
}

#[test]
fn sweeps_audit_a_sample_of_their_sets() {
    let folder = temp_dir::TempDir::new().unwrap();
    let out = folder.path().join("r.csv");
    let of = |vary: &str| Sweep {
        run: Run { to: 2.0, method: Method::Fixed(FixedMethod::Heun), step: Some(5e-3), ..Run::default() },
        vary: vec![Vary::parse(vary).unwrap()],
        samples: None,
        reduce: vec![Reduce::parse("final(m.f)").unwrap()],
        restart: true,
        units: false,
        part: None,
    };
    let sweep = |vary: &str| {
        text(OSCILLATOR)
            .sweep(&of(vary), &out, &mut |_, _| true)
            .unwrap_or_else(|e| panic!("{}", e.render(false)))
            .audit
    };
    let fine = sweep("k=lin(1e-3,2e-3,40)");
    assert_eq!((fine.sets, fine.doubtful, fine.refused, fine.misses.len()), (16, 0, 0, 0), "{fine:?}");
    let wrong = sweep("k=lin(1e-3,1e4,40)");
    assert!(wrong.sets == 16 && wrong.refused > 8 && wrong.greatest.verdict == Verdict::Refused, "{wrong:?}");
    let last = wrong.misses.last().expect("a miss");
    assert_eq!((last.set, last.verdict), (40, Verdict::Refused));
    assert!(last.warnings[0].contains("shorten --step"), "{last:?}");
}

#[test]
fn compare_and_real_time_and_reports_obey_the_audit() {
    let model = fault("wrong_flow");
    let refused = run(&model, &Run::default()).is_err();
    let compared = model.compare(&Compare { to: Some(1.0), repeats: 1, ..Compare::default() }, &mut |_, _| true);
    let compared = compared.unwrap_or_else(|e| panic!("{}", e.render(false)));
    assert_eq!(compared.refused().contains(&"minimal"), refused, "{:?}", compared.notes);
    assert!(!compared.refused().contains(&"lagrange"), "{:?}", compared.notes);
    let stop = std::sync::atomic::AtomicBool::new(false);
    let live = RealTimeRun {
        rate: 1000.0,
        length: Some(0.01),
        method: FixedMethod::Heun,
        inputs: vec![],
        output: None,
        record: Record::Default,
        start: halfarrow::Start::Given,
        on_miss: halfarrow::OnMiss::CatchUp,
        project: false,
        bound: None,
        execution: halfarrow::Execution::Auto,
    };
    let outcome = model.run_real_time(&live, &halfarrow::Statistics::default(), &stop);
    assert_eq!(outcome.is_err(), refused);
    let wanted = halfarrow::Report { to: Some(1.0), compare: false, ..halfarrow::Report::default() };
    let page = model.report(&wanted, &mut |_, _| true).unwrap_or_else(|e| panic!("{}", e.render(false)));
    assert_eq!(page.failure.is_some(), refused);
}

#[test]
fn what_is_zero_but_for_rounding_is_no_disagreement() {
    // Both sides pull alike: what flows through the damper is rounding.
    let model = text(
        "model M\nSe:a(0.3) -> 1:x -> R:d(1)\nx -> 0:n\nSe:b(0.1 + 0.2) -> 1:y -> R:e(2)\ny -> n\nn -> C:c(k = 3, q0 = 0.1)\n",
    );
    let compared = model.compare(&Compare { to: Some(50.0), repeats: 1, ..Compare::default() }, &mut |_, _| true);
    for row in compared.unwrap_or_else(|e| panic!("{}", e.render(false))).rows {
        let apart = row.max_error.unwrap_or(0.0);
        assert!(apart < 1e-6, "{}: {apart:e} in {:?}", row.form, row.max_error_in);
    }
}

/// A small generator of random numbers (splitmix64).
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }
    /// Over two decades up and down.
    fn size(&mut self) -> f64 {
        let exponent = (self.bits() >> 11) as f64 / (1u64 << 53) as f64 * 4.0 - 2.0;
        (10f64.powf(exponent) * 1e4).round() / 1e4 + 1e-3
    }
}

/// A random tree of junctions with two-ports on the way and elements of all sorts at its ends.
fn random_graph(random: &mut Random) -> String {
    let mut text = String::from("model Random\n");
    let junctions = 2 + random.below(6);
    let zero: Vec<bool> = (0..junctions).map(|_| random.below(2) == 0).collect();
    let node = |i: usize, declared: bool| match (declared, zero[i]) {
        (false, _) => format!("j{i}"),
        (true, true) => format!("0:j{i}"),
        (true, false) => format!("1:j{i}"),
    };
    let _ = writeln!(text, "{} -> R:r(r = {})", node(0, true), random.size());
    for i in 1..junctions {
        let from = random.below(i);
        let size = random.size();
        let _ = match random.below(4) {
            0 => writeln!(text, "j{from} -> TF:t{i}({size})\nt{i} -> {}", node(i, true)),
            1 => writeln!(text, "j{from} -> GY:g{i}({size})\ng{i} -> {}", node(i, true)),
            _ => writeln!(text, "j{from} -> {}", node(i, true)),
        };
    }
    let mut sources = 0;
    for (i, zero) in zero.iter().enumerate() {
        for k in 0..1 + random.below(2) {
            let size = random.size();
            let _ = match random.below(7) {
                0 => writeln!(text, "j{i} -> R:r{i}{k}(r = {size})"),
                1 => writeln!(text, "j{i} -> R:n{i}{k}(f = {size}*e + 0.1*e^3)"),
                2 | 3 => writeln!(text, "j{i} -> I:i{i}{k}({size}, f0 = {})", random.size()),
                4 => writeln!(text, "j{i} -> C:c{i}{k}(k = {size}, q0 = {})", random.size()),
                5 => writeln!(text, "j{i} -> C:h{i}{k}(e = {size}*q + q^3)"),
                _ => {
                    sources += 1;
                    let kind = if *zero { "Sf" } else { "Se" };
                    writeln!(text, "{kind}:s{i}{k}({size} + sin(3*t)) -> j{i}")
                }
            };
        }
    }
    if sources == 0 {
        let kind = if zero[0] { "Sf" } else { "Se" };
        let _ = writeln!(text, "{kind}:s({}) -> j0", random.size());
    }
    text
}

fn elaborated(text: &str, set: &[Override]) -> BondGraph {
    let mut sources = Sources::new();
    let file = sources.add("m.bond", text);
    let parsed = ast::parse(text, file);
    bond_graph::elaborate(parsed.ast, sources, &Library, set).graph.expect("a graph")
}

/// The libraries as they stand in the repository, and no other file.
struct Library;

impl Files for Library {
    fn read(&self, _path: &str) -> Result<String, FileError> {
        Err(FileError::NotFound)
    }

    fn library(&self, name: &str) -> Option<String> {
        let name = name.replace('.', "/");
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../library");
        std::fs::read_to_string(folder.join(format!("{name}.bond"))).ok()
    }
}

type Columns = BTreeMap<String, Vec<f64>>;

fn audited(graph: &BondGraph, times: &[f64], columns: &Columns) -> halfarrow_audit::Audit {
    let names: Vec<Arc<str>> = columns.keys().map(|name| name.as_str().into()).collect();
    let columns: Vec<&[f64]> = columns.values().map(Vec::as_slice).collect();
    let run = halfarrow_audit::Run { times, names: &names, columns: &columns, parameters: &BTreeMap::new() };
    halfarrow_audit::audit(graph, &run)
}

fn greatest(column: &[f64]) -> f64 {
    column.iter().fold(0.0, |most, v| most.max(v.abs()))
}

/// What an audit finds of laws and rates, above what samples resolve.
fn found(audit: &halfarrow_audit::Audit) -> f64 {
    let all = [&audit.power, &audit.residual, &audit.rates];
    all.into_iter().flatten().map(|f| f.value - f.resolution).fold(0.0, f64::max)
}

/// Random sound graphs raise no alarm in any form; a column made wrong, and a law made wrong, is refused.
#[test]
fn what_is_sound_passes_and_what_is_made_wrong_is_caught() {
    let mut random = Random(20_261_122);
    let (mut sound, mut columns_caught, mut laws_caught) = (0, 0, 0);
    for _ in 0..150 {
        let source = random_graph(&mut random);
        let Ok(model) = Model::from_text("m.bond", &source, &[]) else { continue };
        let base = Run { to: 0.5, every: None, record: Record::All, ..Run::default() };
        let Ok(done) = model.simulate(&base, &mut |_| true) else {
            // A graph whose sources contradict each other is refused before it runs; none is refused by its audit.
            let refused = matches!(run_or_none(&model, &base), Some(Failure::Untrue { .. }));
            assert!(!refused, "{source}");
            continue;
        };
        assert_eq!(done.report.audit.verdict, Verdict::Holds, "{source}{:?}", done.report.audit);
        sound += 1;
        let form = FORMS[1 + random.below(FORMS.len() - 1)];
        if let Ok(other) = model.simulate(&Run { form, ..base.clone() }, &mut |_| true) {
            assert_eq!(other.report.audit.verdict, Verdict::Holds, "{form:?} {source}{:?}", other.report.audit);
        }
        let graph = elaborated(&source, &[]);
        let wanted = halfarrow_audit::wanted(&graph);
        let columns: Columns = done.trace.columns.iter().map(|c| (c.name.clone(), c.values.clone())).collect();
        let columns: Columns = columns.into_iter().filter(|(name, _)| wanted.contains(name)).collect();
        columns_caught += wrong_columns(&source, &graph, &done.trace.times, &columns, &mut random);
        laws_caught += wrong_laws(&source, &done.trace.times, &columns);
    }
    assert!(sound > 60 && columns_caught > 300 && laws_caught > 100, "{sound} {columns_caught} {laws_caught}");
}

/// A body meets a wall in free flight. All that it has after that may be taken times a number: every law holds then, and the
/// energy says whether a wall at rest can have done it.
/// In machines whose lever arms, turns and sideways motions are zero but for rounding too.
#[test]
fn what_is_made_wrong_beside_rounding_is_caught() {
    let mut random = Random(7);
    for body in [
        "World:world -> Free:free(v0 = [3, 0, 0], w0 = [0.1, 3, 0.2]) -> Body:body(m = 1, J = diag([1, 2, 3]))",
        "World:world -> Free:free(v0 = [9, 0, 0]) -> 1[frame]:car -> Body:hull(m = 50, J = diag([5, 7, 9]))\n\
         car -> FixedTranslation:out(d = [0, 0.7, -0.2]) -> Wheel:wheel(m = 4, J_axle = 1, J_across = 0.4, w0 = 20) \
         -> Body:hub(m = 1, J = diag([0.1, 0.1, 0.1]))",
    ] {
        let source = format!("model Thrown\nimport std.multibody\nimport std.vehicle\n{body}\n");
        let base = Run { to: 0.5, every: None, record: Record::All, ..Run::default() };
        let done = text(&source).simulate(&base, &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false)));
        assert_eq!(done.report.audit.verdict, Verdict::Holds, "{source}{:?}", done.report.audit);
        let graph = elaborated(&source, &[]);
        let wanted = halfarrow_audit::wanted(&graph);
        let columns: Columns = done.trace.columns.iter().map(|c| (c.name.clone(), c.values.clone())).collect();
        let columns: Columns = columns.into_iter().filter(|(name, _)| wanted.contains(name)).collect();
        assert!(wrong_columns(&source, &graph, &done.trace.times, &columns, &mut random) > 20);
    }
}

/// What dies away, comes late or is a pulse has no pole.
#[test]
fn what_decays_does_not_grow_without_bound() {
    for source in ["exp(-50*t)", "exp(-(t - 3)^2/0.02)", "if t < 5 then 1e-15 else 1e3"] {
        let model = text(&format!("model Kick\nSe:kick({source}) -> I:mass(1)\n"));
        let asked = Run { to: 6.0, every: Some(0.02), ..Run::default() };
        let done = model.simulate(&asked, &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false)));
        assert!(done.report.notes.is_empty(), "{source}: {:?}", done.report.notes);
    }
}

/// What changes its side over and over is told by the name of what it asks for.
#[test]
fn a_condition_that_chatters_is_named() {
    let model = text("model Chatter\n1:v -> I:m(1, f0 = 0.5)\nv -> R:dry(e = 2*sign(f))\n");
    let failure = run_or_none(&model, &Run { to: 2.0, ..Run::default() }).expect("it stands still").to_string();
    assert!(failure.contains("a condition on `m.f` changes its side over and over"), "{failure}");
}

#[test]
fn an_impact_that_gives_energy_is_caught() {
    let source = "model Wall\n1:v -> I:m(2, f0 = -1)\nstate x' = v.f from 0.5\n\
                  constraint wall: x >= 0 (restitution = 0.5)\n";
    let done =
        text(source).simulate(&Run { to: 1.0, every: None, record: Record::All, ..Run::default() }, &mut |_| true);
    let trace = done.unwrap_or_else(|e| panic!("{}", e.render(false))).trace;
    let graph = elaborated(source, &[]);
    let wanted = halfarrow_audit::wanted(&graph);
    let after = (1..trace.times.len()).find(|&k| trace.times[k] == trace.times[k - 1] && k > 1).expect("an impact");
    let times = |by: f64| -> Columns {
        let own = trace.columns.iter().filter(|c| wanted.contains(&c.name));
        let scaled = |(k, v): (usize, &f64)| if k < after { *v } else { by * v };
        own.map(|c| (c.name.clone(), c.values.iter().enumerate().map(scaled).collect())).collect()
    };
    let energy = |by: f64| audited(&graph, &trace.times, &times(by)).energy.map_or(0.0, |energy| energy.value);
    // From half the speed to the whole of it, and beyond.
    for (by, gives) in [(0.5, false), (1.0, false), (2.0, false), (2.1, true), (4.0, true)] {
        assert_eq!(energy(by) > 1e-3, gives, "{by}: {}", energy(by));
    }
}

fn run_or_none(model: &Model, run: &Run) -> Option<Failure> {
    match model.simulate(run, &mut |_| true) {
        Err(Error::Run(stopped)) => Some(stopped.failure),
        _ => None,
    }
}

/// Doubles columns of some size from the middle on; each has to be found.
fn wrong_columns(source: &str, graph: &BondGraph, times: &[f64], columns: &Columns, random: &mut Random) -> usize {
    let letter = |name: &str| name.rsplit_once('.').map_or(String::new(), |(_, letter)| letter.to_string());
    let mut caught = 0;
    for (name, column) in columns {
        let alike = columns.iter().filter(|(other, _)| letter(other) == letter(name));
        let most = alike.map(|(_, c)| greatest(c)).fold(0.0, f64::max);
        let from = times.len() / 2 + random.below(times.len() / 4 + 1);
        if greatest(&column[from..]) < 0.1 * most || most == 0.0 {
            continue;
        }
        let mut wrong = columns.clone();
        wrong.get_mut(name).expect("it is there")[from..].iter_mut().for_each(|v| *v *= 2.0);
        let audit = audited(graph, times, &wrong);
        assert!(found(&audit) > 1e-2, "{name} is wrong from {} s on\n{source}{audit}", times[from]);
        caught += 1;
    }
    caught
}

/// Doubles the value of an element, whose law the recorded values then miss.
fn wrong_laws(source: &str, times: &[f64], columns: &Columns) -> usize {
    let mut caught = 0;
    for line in source.lines().filter(|line| line.contains("-> R:r") || line.contains("-> C:c")) {
        let name = line.split(':').next_back().and_then(|rest| rest.split('(').next()).expect("a name");
        let most = columns.iter().filter(|(n, _)| n.ends_with(".e")).map(|(_, c)| greatest(c)).fold(0.0, f64::max);
        if greatest(&columns[&format!("{name}.e")]) < 0.1 * most {
            continue;
        }
        let wrong = line.replace("r = ", "r = 2*").replace("k = ", "k = 2*");
        let graph = elaborated(&source.replace(line, &wrong), &[]);
        let audit = audited(&graph, times, columns);
        assert!(found(&audit) > 1e-2, "{wrong}\n{source}{audit}");
        caught += 1;
    }
    caught
}

/// A table that ends where the run ends has its last value there.
#[test]
fn a_table_may_end_with_the_run() {
    let folder = std::env::temp_dir().join(format!("halfarrow_table_{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    std::fs::write(folder.join("rows.csv"), "t,u\n0,1\n4,2\n10,1\n").expect("a table");
    let text = "model Table\nSf:s(table(\"rows.csv\", t)) -> 0:a -> C:c(1)\na -> R:r(1)\n";
    std::fs::write(folder.join("table.bond"), text).expect("a model");
    let model = Model::load(&folder.join("table.bond"), &[]).unwrap_or_else(|e| panic!("{}", e.render(false)));
    assert!(run_or_none(&model, &Run { to: 10.0, ..Run::default() }).is_none());
    std::fs::remove_dir_all(&folder).expect("the folder is there");
}
