//! The library as others use it: models in memory and below a folder, inputs that are no files, a model that is kept.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use halfarrow::{
    Compiled, Disk, FixedMethod, Form, Input, Method, Model, NameKind, Override, Record, Run, Simulated, Source, Start,
    Stepper,
};

const PARTS: &str = "component Load(port p) { p -> 1:axis -> I:mass(2 kg) }\n";
const LOADED: &str = "model Loaded\nimport \"parts.bond\"\nSe:weight(9.81 N) -> 1:axis\naxis -> Load:load\n";

/// A folder of its own for a test, empty.
fn folder(test: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("api").join(test);
    let _ = fs::remove_dir_all(&path);
    fs::create_dir_all(&path).expect("a folder");
    path
}

fn file(path: PathBuf, text: &str) -> PathBuf {
    fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
    fs::write(&path, text).expect("a file");
    path
}

fn words(source: Source) -> String {
    Model::new(source, &[]).expect_err("a file that it may not read").render(false)
}

fn last(done: &Simulated) -> Vec<u64> {
    done.trace.columns.iter().map(|c| c.values.last().expect("a value").to_bits()).collect()
}

fn run(model: &Compiled, run: &Run) -> Simulated {
    model.simulate(run, &mut |_| true).unwrap_or_else(|e| panic!("{}", e.render(false)))
}

#[test]
fn models_come_from_memory_and_go_elsewhere_with_their_files() {
    let files = BTreeMap::from([("parts.bond".to_string(), PARTS.to_string())]);
    let model = Model::new(Source::text("loaded.bond", LOADED).with_files(files), &[]).expect("a model");
    let again = Model::new(model.source(), model.overrides()).expect("the same model");
    let run = Run::default();
    let [one, two] = [&model, &again].map(|m| last(&m.simulate(&run, &mut |_| true).expect("a run")));
    assert_eq!(one, two);
    let alone = Model::from_text("loaded.bond", LOADED, &[]).expect_err("it has no files").render(false);
    assert!(alone.contains("`parts.bond` cannot be read"), "{alone}");
}

#[test]
fn a_model_reads_nothing_outside_of_its_folder_unless_that_is_allowed() {
    let folder = folder("outside");
    let secret = file(folder.join("secret/parts.bond"), PARTS);
    let inside = file(folder.join("car/model.bond"), LOADED);
    assert!(words(Source::open(&inside).expect("a file")).contains("there is no such file"));
    file(folder.join("car/parts.bond"), PARTS);
    assert!(Model::load(&inside, &[]).is_ok());

    let up = file(folder.join("car/up.bond"), &LOADED.replace("parts.bond", "../secret/parts.bond"));
    let whole = file(folder.join("car/whole.bond"), &LOADED.replace("parts.bond", &secret.to_string_lossy()));
    let missing = file(folder.join("car/missing.bond"), &LOADED.replace("parts.bond", "../secret/none.bond"));
    for path in [&up, &whole, &missing] {
        let said = words(Source::open(path).expect("a file"));
        assert!(said.contains("error[N010]") && said.contains("it does not lie in the folder of the model"), "{said}");
        assert!(said.contains("--allow") && said.contains("bond:2:8"), "{said}");
        assert!(!said.contains("no such file"), "what there is elsewhere is nobody's business: {said}");
    }
    for path in [&up, &whole] {
        let source = Source::open_allowing(path, &[folder.join("secret")]).expect("a file");
        assert!(Model::new(source, &[]).is_ok());
    }
    let table = "model T\nSe:push(table(\"../secret/push.csv\", t)) -> I:mass(2)\n";
    file(folder.join("secret/push.csv"), "0,1\n1,2\n");
    let table = file(folder.join("car/table.bond"), table);
    let said = words(Source::open(&table).expect("a file"));
    assert!(said.contains("error[N020]") && said.contains("--allow"), "{said}");
}

#[cfg(unix)]
#[test]
fn links_that_lead_out_are_not_followed() {
    let folder = folder("links");
    file(folder.join("secret/parts.bond"), PARTS);
    let model = file(folder.join("car/model.bond"), LOADED);
    std::os::unix::fs::symlink(folder.join("secret/parts.bond"), folder.join("car/parts.bond")).expect("a link");
    let said = words(Source::open(&model).expect("a file"));
    assert!(said.contains("it does not lie in the folder of the model"), "{said}");
    let disk = Disk::below(&folder).expect("a folder");
    let text = Source::text(model.to_string_lossy(), LOADED);
    assert!(Model::new(text.with_files(disk), &[]).is_ok(), "within the folder links are followed");
}

#[test]
fn inputs_are_files_texts_series_or_functions() {
    let text = "model Pushed\ninput force : kN = 0\nSe:push(force) -> I:mass(2 kg)\noutput speed = mass.f\n";
    let model = Model::from_text("pushed.bond", text, &[]).and_then(|m| m.compile(Form::Minimal)).expect("a model");
    let csv = "t,force\ns,N\n0,0\n1,1000\n2,0\n";
    let path = file(folder("inputs").join("force.csv"), csv);
    let (times, values) = (vec![0.0, 1.0, 2.0], vec![0.0, 1.0, 0.0]);
    let hat = |t: f64| 1.0 - (t - 1.0).abs();
    let inputs =
        [Input::File(path), Input::Csv(csv.into()), Input::Series { times, values }, Input::sampled(2.0, 1.0, hat)];
    let with = |input: Input| Run { to: 2.0, inputs: vec![("force".into(), input)], ..Run::default() };
    let ends: Vec<Vec<u64>> = inputs.into_iter().map(|input| last(&run(&model, &with(input)))).collect();
    assert!(ends.iter().all(|end| *end == ends[0]));
    let constant = run(&model, &with(Input::Constant(1.0)));
    let speed = constant.trace.column("speed").expect("a column").values.last().copied().expect("a value");
    assert!((speed - 1000.0).abs() < 1e-6, "{speed}");
    let crooked = Input::Series { times: vec![1.0, 0.0], values: vec![0.0, 0.0] };
    let said = model.simulate(&with(crooked), &mut |_| true).expect_err("time runs backwards").to_string();
    assert!(said.contains("what is given for `force`"), "{said}");
}

#[test]
fn a_compiled_model_runs_as_a_new_one_with_whatever_parameters() {
    // At a = b the couplings cancel: there the structure is another one.
    let text = "model Ratios\nparam a = 1, b = 1\nSe:s(1) -> 1:j\nj -> I:one(1)\nj -> TF:x(a) -> 1:k\nk -> R:r(0.3)\n\
                k -> TF:y(1/b) -> 1:l\nl -> I:two(2)\nl -> R:q(0.1)\n";
    let all = Run { to: 3.0, record: Record::All, ..Run::default() };
    for form in [Form::Minimal, Form::Lagrange] {
        let all = Run { form, ..all.clone() };
        let mut kept = Model::from_text("ratios.bond", text, &[]).and_then(|m| m.compile(form)).expect("a model");
        for (a, b) in [(1.0, 1.0), (2.0, 1.0), (2.0, 0.5), (0.0, 3.0), (1.0, 1.0)] {
            kept.set_all([("a", a), ("b", b)]).unwrap_or_else(|e| panic!("{}", e.render(false)));
            let set = [("a", a), ("b", b)].map(|(n, v)| Override { name: n.into(), value: format!("{v:?}") });
            let fresh = Model::from_text("ratios.bond", text, &set).expect("a model");
            let fresh = fresh.simulate(&all, &mut |_| true).expect("a run");
            let (kept, names) =
                (run(&kept, &all), |s: &Simulated| s.trace.columns.iter().map(|c| c.name.clone()).collect::<Vec<_>>());
            assert_eq!(names(&kept), names(&fresh));
            for (k, f) in kept.trace.columns.iter().zip(&fresh.trace.columns) {
                let (k, f) = (k.values.last().expect("a value"), f.values.last().expect("a value"));
                assert!((k - f).abs() <= 1e-5 * f.abs().max(1.0), "{form:?} {a} {b}: {k} {f}");
            }
        }
        assert!(kept.set("c", 1.0).is_err() && kept.set("a", f64::NAN).is_err());
        assert_eq!(kept.parameter("a"), Some(1.0));
    }
}

/// Steps, a jump of time, a switch, a delay and a law that is solved: all that a run remembers.
const CRANE: &str = "model Crane
param m = 2 kg, k = 40 N/m
input pull : kN = 0
Se:drive(if t < 0.31 then 2 N else 5 N) -> 1:axis -> I:mass(m)
Se:hand(pull) -> axis
axis -> C:rope(e = if q > 0.01 m then k*q else 0.1*k*q)
axis -> R:drag(f = (1 m/s)*((e/(1 N))^3 + e/(1 N)))
output force = delay(rope.e, 53 ms) : N
output speed = mass.f
";

fn crane() -> Compiled {
    Model::from_text("crane.bond", CRANE, &[])
        .and_then(|m| m.compile(Form::Minimal))
        .unwrap_or_else(|e| panic!("{}", e.render(false)))
}

#[test]
fn step_by_step_a_run_has_the_bits_of_a_whole_one() {
    let crane = crane();
    for method in [FixedMethod::Heun, FixedMethod::Rk4, FixedMethod::Rosenbrock] {
        let whole =
            run(&crane, &Run { method: Method::Fixed(method), step: Some(1e-2), every: Some(1.0), ..Run::default() });
        let mut steps = crane.stepper(method, 1e-2, Start::Given).expect("a start");
        for part in [1, 9, 40, 50] {
            steps.advance(part).expect("steps");
        }
        assert_eq!(steps.time(), 1.0);
        for name in ["speed", "force"] {
            let wanted = whole.trace.column(name).and_then(|c| c.values.last().copied()).expect("a value");
            assert_eq!(steps.read(name).expect("a value").to_bits(), wanted.to_bits(), "{method:?} {name}");
        }
    }
}

#[test]
fn what_is_saved_goes_on_with_the_same_bits() {
    let crane = crane();
    let mut one = crane.stepper(FixedMethod::Rk4, 1e-2, Start::Given).expect("a start");
    one.set_input("pull", 0.001).expect("an input");
    one.advance(20).expect("steps");
    one.set_parameter("k", 60.0).expect("a parameter");
    one.advance(3).expect("steps");
    let saved = one.save();
    let go_on = |run: &mut Stepper| {
        run.advance(30).expect("steps");
        run.set_input("pull", -0.002).expect("an input");
        run.advance(30).expect("steps");
        ["speed", "force", "rope.q", "mass.f"].map(|name| run.read(name).expect("a value").to_bits())
    };
    let first = go_on(&mut one);
    one.set_parameter("m", 7.0).expect("a parameter");
    let mut other = crane.stepper(FixedMethod::Rk4, 1e-2, Start::Given).expect("a start");
    for run in [&mut one, &mut other] {
        run.restore(&saved).expect("what was saved");
        assert_eq!((run.parameter("k"), run.parameter("m")), (Some(60.0), Some(2.0)));
        assert_eq!(go_on(run), first);
    }
}

#[test]
fn a_snapshot_is_of_one_model_method_and_step() {
    let text = |k: f64| format!("model A\nparam k = {k}\nSe:p(1) -> 1:v -> I:m(2)\nv -> C:c(k = k)\n");
    let model = |text: &str| {
        let model = Model::from_text("a.bond", text, &[]).unwrap_or_else(|e| panic!("{}", e.render(false)));
        model.compile(Form::Minimal).unwrap_or_else(|e| panic!("{}", e.render(false)))
    };
    let begun = |compiled: &Compiled, method, step| compiled.stepper(method, step, Start::Given).expect("a start");
    let one = model(&text(50.0));
    let saved = begun(&one, FixedMethod::Rk4, 1e-3).save();
    let refused = |mut run: Stepper| run.restore(&saved).expect_err("it fits nothing").to_string();
    let other = model("model B\nparam k = 50\nSe:p(1) -> 1:v -> I:l(2)\nv -> R:r(3)\nv -> C:z(1)\n");
    assert!(refused(begun(&other, FixedMethod::Rk4, 1e-3)).contains("another model, `A`"));
    assert!(refused(begun(&model(&text(51.0)), FixedMethod::Rk4, 1e-3)).contains("another model"));
    assert!(refused(begun(&one, FixedMethod::Heun, 1e-3)).contains("another method"));
    assert!(refused(begun(&one, FixedMethod::Rk4, 2e-3)).contains("steps of 0.001 s"));
    // The same text compiled once more is the same model.
    begun(&model(&text(50.0)), FixedMethod::Rk4, 1e-3).restore(&saved).expect("it fits");
}

#[test]
fn a_stepper_refuses_what_there_is_not() {
    let crane = crane();
    let mut run = crane.stepper(FixedMethod::Rk4, 1e-2, Start::Given).expect("a start");
    run.advance(5).expect("steps");
    let before = run.read("speed").expect("a value").to_bits();
    for (name, value) in [("push", 1.0), ("pull", f64::NAN)] {
        assert!(run.set_input(name, value).is_err());
    }
    assert!(run.set_parameter("kk", 1.0).expect_err("no such").to_string().contains("no parameter `kk`"));
    assert!(run.set_parameter("m", f64::INFINITY).is_err());
    let unknown = run.read("sped").expect_err("no such").to_string();
    assert!(unknown.contains("did you mean `speed`?"), "{unknown}");
    assert_eq!(run.read("speed").expect("a value").to_bits(), before);
    assert!(crane.stepper(FixedMethod::Rk4, 0.0, Start::Given).is_err());
    assert!(run.readable().any(|(name, _)| name == "speed"));
}

#[test]
fn names_tell_where_they_are_declared_and_who_reads_them() {
    let model = Model::from_text("crane.bond", CRANE, &[]).expect("a model");
    let names = model.names();
    let of = |name: &str| names.iter().find(|n| n.name == name).unwrap_or_else(|| panic!("{name} is not there"));
    let m = of("m");
    assert_eq!(
        (m.kind, m.declared.file.as_str(), m.declared.line, m.declared.column),
        (NameKind::Parameter, "crane.bond", 2, 7)
    );
    assert_eq!(&CRANE[m.declared.start..m.declared.end], "m");
    assert_eq!(m.read_by, ["mass"]);
    assert_eq!(of("k").read_by, ["rope"]);
    assert_eq!((of("pull").kind, of("pull").read_by.as_slice()), (NameKind::Input, ["hand".to_string()].as_slice()));
    assert_eq!(of("mass").declared.line, 4);
    assert_eq!((of("mass").kind, of("speed").kind), (NameKind::Element, NameKind::Output));
    assert!(of("mass").read_by.contains(&"speed".to_string()), "{:?}", of("mass"));
    assert!(of("speed").read_by.is_empty());
}
