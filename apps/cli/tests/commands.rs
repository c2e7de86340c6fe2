//! The program as its users see it: output, files, exit status.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

/// Runs `halfarrow` in a folder.
fn halfarrow(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_halfarrow"));
    command
        .current_dir(folder)
        .args(arguments)
        .env_remove("NO_COLOR")
        .env_remove("COLUMNS")
        .output()
        .expect("the program starts")
}

fn status(output: &Output) -> i32 {
    output.status.code().expect("an exit status")
}

fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).expect("UTF-8")
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).expect("UTF-8")
}

/// The JSON object of a run that went well.
fn json(output: &Output) -> Value {
    assert_eq!(status(output), 0, "{}", stderr(output));
    serde_json::from_slice(&output.stdout).expect("one JSON object")
}

/// The path of a model of the repository.
fn model(name: &str) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models").join(name);
    folder.join("model.bond").to_string_lossy().into_owned()
}

/// An empty folder of this test's own.
fn folder(test: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(test);
    let _ = fs::remove_dir_all(&path);
    fs::create_dir_all(&path).expect("a folder");
    path
}

fn write(folder: &Path, name: &str, text: &str) -> String {
    fs::write(folder.join(name), text).expect("a file");
    name.to_string()
}

const FAULTY: &str = "model M\nSe:battery(12 V) -> 0:n1\nSe:charger(14 V) -> n1\nn1 -> R:load(3 ohm)\n";

#[test]
fn a_new_model_runs_at_once() {
    let here = folder("new");
    let made = halfarrow(&here, &["new", "quarter-car"]);
    assert_eq!(status(&made), 0, "{}", stderr(&made));
    assert!(fs::read_to_string(here.join("quarter-car.bond")).unwrap().starts_with("model QuarterCar "));
    let checked = halfarrow(&here, &["check", "quarter-car.bond"]);
    assert_eq!((status(&checked), stderr(&checked).as_str()), (0, ""));
    let laid_out = halfarrow(&here, &["fmt", "--check", "quarter-car.bond"]);
    assert_eq!(status(&laid_out), 0, "{}", stderr(&laid_out));
    let run = halfarrow(&here, &["simulate", "quarter-car.bond", "--to", "10"]);
    assert_eq!(status(&run), 0, "{}", stderr(&run));
    assert!(stdout(&run).contains("travel") && stdout(&run).contains("audit"), "{}", stdout(&run));
    let again = halfarrow(&here, &["new", "quarter-car"]);
    assert_eq!(status(&again), 2);
    assert!(stderr(&again).contains("there already"));
}

#[test]
fn equations_of_what_is_asked_for() {
    let at = folder("only");
    assert_eq!(status(&halfarrow(&at, &["new", "--family", "ladder", "400"])), 0);
    let asked = halfarrow(&at, &["equations", "ladder.bond", "--only", "c[7].q,r[9].f", "--json"]);
    assert_eq!(status(&asked), 0, "{}", stderr(&asked));
    let told = json(&asked);
    assert_eq!(told["states"].as_array().map(Vec::len), Some(400));
    let lines = |field: &str| -> Vec<String> { serde_json::from_value(told[field].clone()).unwrap() };
    assert_eq!(lines("equations").len(), 1, "{:?}", lines("equations"));
    assert!(lines("equations")[0].starts_with("c[7].q' = "), "{:?}", lines("equations"));
    let definitions = lines("definitions");
    assert!(definitions.iter().any(|line| line.starts_with("r[9].f = ")), "{definitions:?}");
    // Down to the states, and nothing beside.
    assert!(definitions.len() < 20 && !definitions.iter().any(|line| line.contains("[300]")), "{definitions:?}");
    let unknown = halfarrow(&at, &["equations", "ladder.bond", "--only", "c[401].q"]);
    assert_eq!(status(&unknown), 2);
    assert!(stderr(&unknown).contains("c[401].q"), "{}", stderr(&unknown));
}

#[test]
fn families_of_any_size_are_written() {
    let at = folder("families");
    for family in ["ladder", "mesh", "beam", "chain", "grid", "fourbars"] {
        let output = halfarrow(&at, &["new", "--family", family, "3"]);
        assert_eq!(status(&output), 0, "{}", stderr(&output));
        let file = format!("{family}.bond");
        assert_eq!(status(&halfarrow(&at, &["fmt", "--check", &file])), 0, "{family}");
        let run = halfarrow(&at, &["simulate", &file, "--to", "0.01", "--set", "n=4"]);
        assert_eq!(status(&run), 0, "{family}: {}", stderr(&run));
    }
    let long =
        stdout(&halfarrow(&at, &["simulate", "ladder.bond", "--to", "1e-6", "--set", "n=70", "--record", "all"]));
    assert!(long.contains("more: name those of interest") && long.lines().count() < 80, "{long}");
    assert_eq!(status(&halfarrow(&at, &["new", "--family", "grid", "plate", "5"])), 0);
    let plate = std::fs::read_to_string(at.join("plate.bond")).unwrap();
    assert!(plate.starts_with("model Plate") && plate.contains("\nparam n = 5 "), "{plate}");
    for wrong in [
        &["new", "--family", "grid", "0"][..],
        &["new", "--family", "grid", "g", "x"],
        &["new", "--family", "tree", "3"],
    ] {
        assert_eq!(status(&halfarrow(&at, wrong)), 2, "{wrong:?}");
    }
}

#[test]
fn check_shows_all_faults_at_their_places() {
    let here = folder("check");
    let file = write(&here, "faulty.bond", FAULTY);
    let output = halfarrow(&here, &["check", &file]);
    assert_eq!(status(&output), 1);
    assert!(stderr(&output).contains("faulty.bond:") && stderr(&output).contains("error["), "{}", stderr(&output));
    assert!(!stderr(&output).contains('\u{1b}'), "no colours where there is no terminal");
    let output = halfarrow(&here, &["check", "--json", &file]);
    assert_eq!(status(&output), 1);
    let report: Value = serde_json::from_slice(&output.stdout).expect("one JSON object");
    assert_eq!(report["errors"], 1);
    assert_eq!(report["diagnostics"][0]["severity"], "error");
    assert!(report["diagnostics"][0]["primary"]["line"].as_u64() >= Some(2));
}

#[test]
fn fmt_prints_checks_and_writes() {
    let here = folder("fmt");
    let file = write(&here, "m.bond", "model M\nSe:a( 1 )->1:b\nb->I:c(2)\n");
    let laid_out = "model M\nSe:a(1) -> 1:b\nb -> I:c(2)\n";
    assert_eq!(stdout(&halfarrow(&here, &["fmt", &file])), laid_out);
    assert_eq!(status(&halfarrow(&here, &["fmt", "--check", &file])), 1);
    assert_eq!(json(&halfarrow(&here, &["fmt", "--json", &file]))["changed"], true);
    assert_eq!(status(&halfarrow(&here, &["fmt", "--write", &file])), 0);
    assert_eq!(fs::read_to_string(here.join(&file)).unwrap(), laid_out);
    assert_eq!(status(&halfarrow(&here, &["fmt", "--check", &file])), 0);
}

#[test]
fn show_prints_every_stage() {
    for stage in ["ast", "bond_graph", "causal_graph", "causal_paths", "equations", "program"] {
        let output = halfarrow(Path::new("."), &["show", stage, &model("class2")]);
        assert_eq!(status(&output), 0, "{stage}: {}", stderr(&output));
        assert!(stdout(&output).lines().count() > 3, "{stage}");
        let object = json(&halfarrow(Path::new("."), &["show", "--json", stage, &model("class2")]));
        assert_eq!((object["stage"].as_str(), object["text"].as_str()), (Some(stage), Some(stdout(&output).as_str())));
    }
}

#[test]
fn loops_tell_class_gain_and_breaks() {
    let forced = model("class2").replace("model.bond", "forced.bond");
    let report = json(&halfarrow(Path::new("."), &["loops", "--json", &forced]));
    let path = &report["paths"][0];
    assert_eq!(path["class"], 2);
    assert!((path["gain_value"].as_f64().expect("a number") + 0.6).abs() < 1e-15);
    assert_eq!(path["gain"], "-R1/R2");
    assert_eq!(path["elements"], serde_json::json!(["R1", "R2"]));
    assert_eq!(path["breaks"], serde_json::json!(["R1.e"]));
    assert!(path["resolution"].is_string());
    assert_eq!(report["storages"][0]["name"], "I");
    assert_eq!(report["storages"][0]["causality"], "integral");
    assert_eq!(report["storages"][0]["independent"], true);
    assert_eq!(report["counts"]["break"], serde_json::json!({"differential": 1, "algebraic": 1}));
    assert_eq!(report["counts"]["minimal"], serde_json::json!({"differential": 1, "algebraic": 0}));
    assert_eq!(report["dof"], 1);
    let changed = json(&halfarrow(Path::new("."), &["loops", "--json", &forced, "--set", "R2=6"]));
    assert_eq!(changed["paths"][0]["gain_value"], -0.5);
    let text = stdout(&halfarrow(Path::new("."), &["loops", &forced]));
    assert!(text.contains("-R1/R2") && text.contains("integral"), "{text}");
}

#[test]
fn timings_tell_time_and_memory_of_every_stage() {
    let at = folder("timings");
    let car = model("quarter_car");
    for (command, stages) in [
        (&["check", &car][..], &["ast", "bond_graph", "causal_graph", "equations"][..]),
        (&["loops", &car], &["causal_paths"]),
        (&["simulate", &car, "--to", "0.1", "--out", "t.csv"], &["program", "code", "start", "run", "write", "in all"]),
        (&["draw", &car, "--out", "t.svg"], &["causal_paths", "draw"]),
    ] {
        let output = halfarrow(&at, &[command, &["--timings"]].concat());
        assert_eq!(status(&output), 0, "{}", stderr(&output));
        for stage in stages {
            let told = stderr(&output);
            let line =
                told.lines().find(|line| line.starts_with(&format!("│ {stage} "))).unwrap_or_else(|| panic!("{told}"));
            let numbers: Vec<f64> = line.split(['│', '┆']).filter_map(|cell| cell.trim().parse().ok()).collect();
            let memory = usize::from(cfg!(target_os = "linux") && *stage != "in all");
            assert_eq!(numbers.len(), 1 + memory, "{line}");
            assert!(numbers.iter().all(|n| *n >= 0.0), "{line}");
        }
    }
}

#[test]
fn exec_says_what_evaluates_and_changes_nothing() {
    let at = folder("exec");
    let car = model("quarter_car");
    let run = |exec: &str, more: &[&str]| {
        let output = halfarrow(&at, &[&["simulate", &car, "--to", "0.1", "--exec", exec][..], more].concat());
        assert_eq!(status(&output), 0, "{}", stderr(&output));
        output
    };
    let [bytecode, machine] = ["bytecode", "machine"].map(|exec| json(&run(exec, &["--json"])));
    assert_eq!(bytecode["values"], machine["values"]);
    assert_eq!(bytecode["execution"][0]["routine"], "rates");
    assert_eq!(bytecode["execution"][0]["machine"], false);
    assert_eq!(machine["execution"][0]["machine"], true);
    assert_eq!(machine["execution"][0]["by_bytecode"], 0);
    let told = stderr(&run("auto", &["--timings"]));
    assert!(told.contains("would repay machine code"), "{told}");
    let rows = ["bytecode", "machine"].map(|exec| {
        let file = format!("{exec}.csv");
        let vary = ["--vary", "ks=lin(10e3,30e3,20)", "--to", "0.1", "--step", "1ms", "--out", &file, "--exec", exec];
        let output = halfarrow(&at, &[&["sweep", &car][..], &vary].concat());
        assert_eq!(status(&output), 0, "{}", stderr(&output));
        std::fs::read_to_string(at.join(file)).expect("rows")
    });
    assert_eq!(rows[0], rows[1]);
}

#[test]
fn equations_read_as_in_a_textbook() {
    let text = halfarrow(Path::new("."), &["equations", &model("pendulum")]);
    assert_eq!(stdout(&text), "(J + M a²) ω' = -M g a cos φ\nφ' = ω\n");
    let report = json(&halfarrow(Path::new("."), &["equations", &model("pendulum"), "--json"]));
    assert_eq!((report["form"].as_str(), report["index"].as_u64()), (Some("minimal"), Some(0)));
    assert_eq!(report["counts"], serde_json::json!({"differential": 1, "algebraic": 0}));
    let kinds: Vec<&str> = report["states"].as_array().unwrap().iter().filter_map(|s| s["kind"].as_str()).collect();
    assert_eq!(kinds, ["storage", "signal"]);
    let latex = stdout(&halfarrow(Path::new("."), &["equations", &model("pendulum"), "--format", "latex"]));
    assert!(latex.contains("\\cos") && latex.contains("&="), "{latex}");
}

#[test]
fn simulate_writes_what_is_recorded() {
    let here = folder("simulate");
    let file = model("class2");
    let arguments = ["simulate", &file, "--to", "10", "--every", "0.1", "--rtol", "1e-10", "--out", "x.csv"];
    let output = halfarrow(&here, &[&arguments[..], &["--plot", "x.svg", "--draw", "graph.svg"]].concat());
    assert_eq!(status(&output), 0, "{}", stderr(&output));
    let csv = fs::read_to_string(here.join("x.csv")).unwrap();
    assert_eq!(csv.lines().next(), Some("t,I.f,v,F1"));
    assert_eq!(csv.lines().count(), 102);
    let last: Vec<f64> = csv.lines().last().unwrap().split(',').map(|field| field.parse().unwrap()).collect();
    assert_eq!(last[0], 10.0);
    assert!((last[2] - 0.386823068113934).abs() < 1e-8);
    for picture in ["x.svg", "graph.svg"] {
        assert!(fs::read_to_string(here.join(picture)).unwrap().contains("<svg"), "{picture}");
    }
    let csv = stdout(&halfarrow(&here, &["simulate", &file, "--to", "1", "--record", "R1.f,I.p", "--out", "-"]));
    assert_eq!(csv.lines().next(), Some("t,R1.f,I.p"));
    let report = json(&halfarrow(&here, &["simulate", &file, "--to", "1", "--json"]));
    assert!(report["steps"].as_u64() > Some(0) && report["audit"]["power"]["value"].as_f64() < Some(1e-9), "{report}");
    let (times, values) = (report["t"].as_array().unwrap(), report["values"]["v"].as_array().unwrap());
    assert_eq!((times.len(), times.last().unwrap().as_f64()), (values.len(), Some(1.0)));
}

#[test]
fn every_solver_comes_to_the_same_end() {
    let here = folder("solvers");
    let end = |solver: &[&str]| {
        let arguments = ["simulate", &model("class2"), "--to", "1", "--json", "--solver"];
        let report = json(&halfarrow(&here, &[&arguments[..], solver].concat()));
        report["values"]["v"].as_array().unwrap().last().unwrap().as_f64().unwrap()
    };
    let exact = 1.99313146956953;
    for solver in ["auto", "explicit", "bdf", "radau"] {
        assert!((end(&[solver]) - exact).abs() < 1e-4, "{solver}");
    }
    for (solver, error) in [("euler", 1e-2), ("heun", 1e-5), ("rk4", 1e-9), ("implicit_midpoint", 1e-5)] {
        assert!((end(&[solver, "--step", "1e-3"]) - exact).abs() < error, "{solver}");
    }
    let output = halfarrow(&here, &["simulate", &model("class2"), "--to", "1", "--solver", "rk4"]);
    assert_eq!(status(&output), 2);
    assert!(stderr(&output).contains("--step"));
}

#[test]
fn inputs_come_from_csv() {
    let here = folder("inputs");
    write(&here, "push.csv", "t,push\n0,0\n1,2\n2,2\n");
    write(&here, "m.bond", "model M\ninput push : N = 0\nSe:force(push) -> I:mass(2 kg)\n");
    let run = ["simulate", "m.bond", "--to", "2", "--json", "--input"];
    let report = json(&halfarrow(&here, &[&run[..], &["push=push.csv"]].concat()));
    let end = report["values"]["mass.f"].as_array().unwrap().last().unwrap().as_f64().unwrap();
    assert!((end - 1.5).abs() < 1e-6, "{end}");
    for wrong in ["pull=push.csv", "push=none.csv", "push=m.bond"] {
        let output = halfarrow(&here, &[&run[..], &[wrong]].concat());
        assert_eq!(status(&output), 2, "{wrong}: {}", stderr(&output));
    }
}

#[test]
fn declared_units_hold_in_files() {
    let folder = folder("units");
    let text = "model Tank\ninput pump : L/min = 30\nSf:s(pump) -> 0:a -> C:c(1)\na -> R:r(1)\noutput f = s.f : mL/s\n";
    let file = write(&folder, "tank.bond", text);
    let series = write(&folder, "pump.csv", "t,pump\n0,60\n1,60\n");
    for (more, flow) in [(vec![], 500.0), (vec!["--input".to_string(), format!("pump={series}")], 1000.0)] {
        let mut arguments = vec!["simulate", &file, "--to", "1", "--every", "1", "--json", "--record", "f,s.f"];
        arguments.extend(more.iter().map(String::as_str));
        let run = json(&halfarrow(&folder, &arguments));
        assert_eq!(run["values"]["f"][0].as_f64().unwrap(), flow);
        assert_eq!(run["values"]["s.f"][0].as_f64().unwrap(), flow * 1e-6);
    }
}

#[test]
fn a_start_at_rest_stays_at_rest() {
    let here = folder("rest");
    write(&here, "m.bond", "model M\nSe:push(10) -> 1:v -> I:mass(2)\nv -> C:spring(k = 800)\nv -> R:damper(6)\n");
    let arguments = ["simulate", "m.bond", "--to", "5", "--start", "equilibrium", "--json"];
    let report = json(&halfarrow(&here, &arguments));
    for value in report["values"]["spring.q"].as_array().unwrap() {
        assert!((value.as_f64().unwrap() - 10.0 / 800.0).abs() < 1e-9, "{value}");
    }
}

#[test]
fn a_run_that_fails_keeps_what_it_has() {
    let here = folder("failure");
    write(&here, "m.bond", "model M\nstate x' = x^2 from 1\nSe:force(x) -> I:mass(1)\n");
    let output = halfarrow(&here, &["simulate", "m.bond", "--to", "2", "--out", "x.csv"]);
    assert_eq!(status(&output), 3, "{}", stderr(&output));
    assert!(stderr(&output).contains("t ="), "{}", stderr(&output));
    let csv = fs::read_to_string(here.join("x.csv")).unwrap();
    let last: f64 = csv.lines().last().unwrap().split(',').next().unwrap().parse().unwrap();
    assert!(last > 0.99 && last <= 1.01, "{last}");
}

#[test]
fn wrong_usage_is_said_with_the_remedy() {
    let here = folder("usage");
    let file = model("class2");
    let cases: [(&[&str], &str); 8] = [
        (&["simulate", &file, "--to", "1", "--record", "R1.g"], "R1"),
        (&["simulate", &file, "--to", "1", "--set", "R9=3"], "R9"),
        (&["simulate", &file, "--to", "-1"], "to"),
        (&["simulate", &file, "--to", "1", "--out", "x.xls"], ".csv"),
        (&["simulate", &file, "--to", "1", "--plot", "x.gif"], ".svg"),
        (&["draw", &file, "--out", "x"], ".svg"),
        (&["check", "none.bond"], "none.bond"),
        (&["loops", &file, "--set", "R1"], "name=value"),
    ];
    for (arguments, said) in cases {
        let output = halfarrow(&here, arguments);
        assert_eq!(status(&output), 2, "{arguments:?}: {}", stderr(&output));
        assert!(stderr(&output).contains(said), "{arguments:?}: {}", stderr(&output));
    }
    assert_eq!(status(&halfarrow(&here, &["frobnicate"])), 2);
}

#[test]
fn drawings_are_svg_or_png() {
    let here = folder("draw");
    let output = halfarrow(&here, &["draw", &model("pendulum"), "--out", "a.svg", "--out", "a.png"]);
    assert_eq!(status(&output), 0, "{}", stderr(&output));
    assert!(fs::read_to_string(here.join("a.svg")).unwrap().contains("MTFx"));
    assert!(fs::read(here.join("a.png")).unwrap().starts_with(b"\x89PNG"));
}

#[test]
fn help_has_an_example_for_every_command() {
    for command in ["new", "check", "fmt", "library", "show", "loops", "equations", "simulate", "draw"] {
        let help = stdout(&halfarrow(Path::new("."), &[command, "--help"]));
        assert!(help.contains("Example") && help.contains(&format!("halfarrow {command} ")), "{command}: {help}");
    }
}

#[test]
fn a_model_is_exported_as_c() {
    let here = folder("export");
    let car = model("quarter_car");
    let report = json(&halfarrow(&here, &["export", "c", &car, "--out", "car", "--method", "heun", "--json"]));
    assert_eq!(report["name"], "quarter_car");
    assert_eq!(
        report["written"],
        serde_json::json!(["car/quarter_car.h", "car/quarter_car.c", "car/main.c", "car/CMakeLists.txt"])
    );
    assert!(report["cost"]["operations"].as_u64().is_some_and(|n| n > 0));
    let header = fs::read_to_string(here.join("car/quarter_car.h")).unwrap();
    assert!(header.contains("QUARTER_CAR_U_road = 0") && header.contains("heun with a step of 0.001 s"), "{header}");
    let shown = halfarrow(&here, &["export", "c", &car, "--out", "car"]);
    assert!(stdout(&shown).contains("rk4") && stdout(&shown).contains("operations"), "{}", stdout(&shown));
    let latex = halfarrow(&here, &["export", "latex", &car, "--out", "car.tex"]);
    assert_eq!(status(&latex), 0, "{}", stderr(&latex));
    let text = fs::read_to_string(here.join("car.tex")).unwrap();
    assert!(text.starts_with("\\documentclass") && text.contains("\\dot{f}_{\\mathrm{wheel}}"), "{text}");
    let single = json(&halfarrow(&here, &["export", "c", &car, "--out", "single", "--real", "float", "--json"]));
    assert_eq!((&report["real"], &single["real"]), (&serde_json::json!("double"), &serde_json::json!("float")));
    let header = fs::read_to_string(here.join("single/quarter_car.h")).unwrap();
    assert!(header.contains("float x[4]; /* states */") && header.contains("double t; /* time, in s */"), "{header}");
    for wrong in [&["--step", "0"][..], &["--form", "lagrange"], &["--real", "float", "--set", "mu=1e-50"]] {
        let arguments = [&["export", "c", &car, "--out", "car"], wrong].concat();
        assert_eq!(status(&halfarrow(&here, &arguments)), 2, "{wrong:?}");
    }
    assert_eq!(status(&halfarrow(&here, &["export", "latex", &car, "--out", "car.txt"])), 2);
}

#[test]
fn a_model_is_exported_as_fmu() {
    let here = folder("fmu");
    let car = model("quarter_car");
    for version in ["fmu2", "fmu3"] {
        let report = json(&halfarrow(&here, &["export", version, &car, "--out", "car.fmu", "--json"]));
        let files: Vec<&str> = report["files"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
        assert!(
            files.contains(&"modelDescription.xml") && files.iter().any(|f| f.starts_with("binaries/")),
            "{files:?}"
        );
        assert!(fs::read(here.join("car.fmu")).unwrap().starts_with(b"PK"));
        let alone = json(&halfarrow(&here, &["export", version, &car, "--out", "car.fmu", "--json", "--source-only"]));
        let files: Vec<&str> = alone["files"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
        assert!(!files.iter().any(|f| f.starts_with("binaries/")), "{files:?}");
    }
    let mut command = Command::new(env!("CARGO_BIN_EXE_halfarrow"));
    command.current_dir(&here).env("CC", "no-such-compiler").args(["export", "fmu3", &car, "--out", "other.fmu"]);
    let without = command.output().expect("the program starts");
    assert_eq!(status(&without), 2);
    assert!(
        stderr(&without).contains("no-such-compiler") && stderr(&without).contains("--source-only"),
        "{}",
        stderr(&without)
    );
    assert!(!here.join("other.fmu").exists());
    assert_eq!(status(&halfarrow(&here, &["export", "fmu2", &car, "--out", "car.zip"])), 2);
    let single = halfarrow(&here, &["export", "fmu2", &car, "--out", "car.fmu", "--real", "float"]);
    assert!(
        status(&single) == 2 && stderr(&single).contains("`--real float` is for `export c`"),
        "{}",
        stderr(&single)
    );
}

/// Tables and equations are no wider than the page: 80 columns without a terminal, else as `COLUMNS` or `--width` say.
#[test]
fn tables_and_equations_fit_the_page() {
    let here = folder("width");
    let widest = |output: &Output| stdout(output).lines().map(|line| line.chars().count()).max().unwrap_or(0);
    let commands: [&[&str]; 4] = [&["loops"], &["equations"], &["equations", "--form", "lagrange"], &["linearize"]];
    for name in ["slider_crank", "rectifier", "gear_train", "quarter_car"] {
        let model = model(name);
        for command in commands {
            let mut arguments = command.to_vec();
            arguments.push(&model);
            let usual = halfarrow(&here, &arguments);
            assert_eq!(status(&usual), 0, "{}", stderr(&usual));
            assert!(widest(&usual) <= 80, "{arguments:?}\n{}", stdout(&usual));
            arguments.extend(["--width", "60"]);
            let narrow = halfarrow(&here, &arguments);
            assert!(widest(&narrow) <= 60, "{arguments:?}\n{}", stdout(&narrow));
            let mut program = Command::new(env!("CARGO_BIN_EXE_halfarrow"));
            let by_columns = program.args(&arguments[..arguments.len() - 2]).env("COLUMNS", "60").output();
            assert_eq!(stdout(&by_columns.expect("the program starts")), stdout(&narrow));
        }
    }
    let wide = halfarrow(&here, &["loops", &model("slider_crank"), "--width", "400"]);
    assert!(widest(&wide) > 100, "nothing is folded where there is room\n{}", stdout(&wide));
    let refused = halfarrow(&here, &["loops", &model("slider_crank"), "--width", "none"]);
    assert_eq!(status(&refused), 2);
}

#[test]
fn a_model_reads_only_what_is_allowed() {
    let folder = folder("allow");
    std::fs::create_dir_all(folder.join("lib")).expect("a folder");
    std::fs::create_dir_all(folder.join("car")).expect("a folder");
    std::fs::write(folder.join("lib/push.csv"), "0,1\n1,2\n").expect("a file");
    let text = "model T\nSe:push(table(\"../lib/push.csv\", t)) -> I:mass(2)\n";
    std::fs::write(folder.join("car/model.bond"), text).expect("a file");
    let refused = halfarrow(&folder, &["check", "car/model.bond"]);
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert_eq!(refused.status.code(), Some(1), "{said}");
    assert!(said.contains("allow its folder: `--allow lib`"), "{said}");
    let allowed = halfarrow(&folder, &["check", "car/model.bond", "--allow", "lib"]);
    assert_eq!(allowed.status.code(), Some(0), "{}", String::from_utf8_lossy(&allowed.stderr));
}

const ARMS: &str = "model Arms
import std.multibody
World:world -> Free:floating(x0 = [0, 0, 1]) -> 1[frame]:car
car -> Body:hull(m = 100, J = diag([10, 20, 30]), c = [0, 0, 0.7])
car -> Revolute:hinge(n = [1, 0, 0]) -> Body:arm(m = 2, J = diag([0.1, 0.2, 0.3]), c = [0, 0.5, 0])
";

/// Of multibonds: paths with the strands that they run between, storages in one line where all strands are alike, and no row
/// wider than the page.
#[test]
fn loops_of_multibonds_fit_the_page() {
    let here = folder("strands");
    let file = write(&here, "arms.bond", ARMS);
    for width in ["60", "80", "150"] {
        let text = stdout(&halfarrow(&here, &["loops", &file, "--width", width]));
        let widest = text.lines().map(|line| line.chars().count()).max().unwrap_or(0);
        assert!(widest <= width.parse().unwrap(), "{widest}\n{text}");
        for told in [
            "hull.inertia.x - hull.mass.y",
            "-0.049*hull.m",
            "hull.mass[3]",
            "hull.inertia[3]",
            "velocity transformation",
        ] {
            assert!(text.contains(told), "{told}\n{text}");
        }
        assert!(!text.contains("hull.mass.x.f ="), "{text}");
        let paths = text.matches("in minimal form: velocity transformation").count();
        assert!(paths == 10 || width == "150", "{paths}\n{text}");
    }
    let report = json(&halfarrow(&here, &["loops", &file, "--json"]));
    let elements = &report["paths"][0]["elements"];
    assert_eq!(elements, &serde_json::json!(["hull.inertia.x", "hull.mass.y"]));
    let mass = report["storages"].as_array().unwrap().iter().find(|s| s["name"] == "hull.mass.x").unwrap();
    assert!(mass["follows"].as_str().unwrap().len() > 400 && !mass["follows"].as_str().unwrap().contains('…'));
    assert_eq!(mass["from"][0], "hull.inertia.y.f", "{}", mass["from"]);
}

/// Gains that take pages are cut, and said to be.
#[test]
fn long_gains_are_cut() {
    let here = folder("long_gains");
    let names: Vec<String> = (0..60).map(|i| format!("reading_of_a_long_name_{i}")).collect();
    let law = names.iter().map(|n| format!("{n}*sin({n})")).collect::<Vec<_>>().join(" + ");
    let inputs: String = names.iter().map(|n| format!("input {n} = 1\n")).collect();
    let text = format!(
        "model Long\n{inputs}Se:s(1) -> 1:n -> R:a(e = ({law})*f)\nn -> TF:t(f_out = 2) -> 0:m -> R:b(3)\nm -> I:mass(1)\nn -> 0:k -> R:c(1)\nk -> R:d(e = ({law})*f)\n"
    );
    let file = write(&here, "long.bond", &text);
    let short = stdout(&halfarrow(&here, &["loops", &file]));
    assert!(short.contains('…') && short.contains("--json") && short.lines().count() < 60, "{short}");
    assert!(short.lines().all(|line| line.chars().count() <= 80), "{short}");
    let whole = stdout(&halfarrow(&here, &["loops", &file, "--json"]));
    assert!(whole.contains("reading_of_a_long_name_59") && !whole.contains('…'));
}

#[test]
fn components_alone_are_no_model() {
    let here = folder("components_alone");
    let file = write(&here, "parts.bond", "component Lamp(port p) \"lamp\" {\n    p -> R:wire(3 ohm)\n}\n");
    assert_eq!(status(&halfarrow(&here, &["check", &file])), 0);
    for command in ["loops", "equations", "simulate --to=1"] {
        let arguments: Vec<&str> = command.split(' ').chain([file.as_str()]).collect();
        let output = halfarrow(&here, &arguments);
        assert_eq!(status(&output), 2, "{command}");
        let told = stderr(&output);
        for part in ["there is no model in parts.bond", "`import \"parts.bond\"`", "`Lamp:name`"] {
            assert!(told.contains(part), "{command}: {told}");
        }
        assert!(output.stdout.is_empty(), "{command}");
    }
}

/// Of equations that nobody reads the size is told, and how to get them.
#[test]
fn long_equations_are_told_in_brief() {
    let here = folder("brief");
    assert_eq!(status(&halfarrow(&here, &["new", "--family", "ladder", "1200"])), 0);
    let brief = stdout(&halfarrow(&here, &["equations", "ladder.bond"]));
    assert!(brief.lines().count() < 700, "{}", brief.lines().count());
    for told in ["states", "┆ 1200", "operations of one evaluation", "--only NAME", "--all", "--out FILE", "q_c[1]' = "]
    {
        assert!(brief.contains(told), "{told}\n{brief}");
    }
    let all = stdout(&halfarrow(&here, &["equations", "ladder.bond", "--all"]));
    assert!(all.lines().count() > 2000 && !all.contains('…'), "{}", all.lines().count());
    let written = halfarrow(&here, &["equations", "ladder.bond", "--out", "all.txt"]);
    assert_eq!(stdout(&written), "all.txt is written\n");
    assert_eq!(fs::read_to_string(here.join("all.txt")).unwrap(), all);
    let report = json(&halfarrow(&here, &["equations", "ladder.bond", "--json"]));
    assert_eq!(report["equations"].as_array().map(Vec::len), Some(1200));
}

#[test]
fn a_number_is_differentiated_by_all_parameters() {
    let folder = folder("gradient");
    let car = model("quarter_car");
    let run = ["simulate", &car, "--to", "1", "--every", "0.01", "--gradient"];
    let told = stdout(&halfarrow(&folder, &[&run[..], &["rms(body.f)", "--width", "100"]].concat()));
    let table = told.split("rms(body.f) = ").nth(1).expect("the number");
    let header = table.lines().find(|line| line.contains("derivative")).expect("a table");
    assert!(["by", "unit", "of 1 %"].iter().all(|word| header.contains(word)), "{told}");
    assert!(["ms", "mu", "ks", "kt", "b", "g"].iter().all(|name| table.contains(&format!("│ {name} "))), "{told}");
    let object =
        json(&halfarrow(&folder, &[&run[..], &["max(travel)", "--sensitivity", "ks,road", "--json"]].concat()));
    let slopes = object["gradient"]["slopes"].as_array().expect("derivatives");
    assert_eq!(slopes.iter().map(|s| s["name"].as_str().expect("a name")).collect::<Vec<_>>(), ["ks", "road"]);
    assert!(slopes[0]["slope"].is_f64() && slopes[0]["at"] == 18000.0 && slopes[0]["unit"] == "N/m");
    let wrong = halfarrow(&folder, &[&run[..], &["time_of_max(travel)"]].concat());
    assert!(status(&wrong) == 2 && stderr(&wrong).contains("time_of_max has no derivative"), "{}", stderr(&wrong));
}

#[test]
fn several_measured_runs_are_fitted_at_once() {
    let folder = folder("fit");
    let car = write(
        &folder,
        "car.bond",
        "model Car\nparam k = 18e3, b = 900\ninput push = 0\nSe:p(push) -> 1:c -> I:body(300)\nc -> C:spring(k = k)\nc -> R:d(b)\n",
    );
    for (name, push) in [("a", 100.0), ("b", 250.0)] {
        let rows: String = (0..60).map(|i| format!("{},{push}\n", 0.02 * f64::from(i))).collect();
        let input = write(&folder, &format!("{name}_in.csv"), &format!("t,push\n{rows}"));
        let given = format!("push={input}");
        let run = [
            "simulate", &car, "--set", "k=25e3", "--set", "b=1500", "--to", "1.18", "--every", "0.02", "--rtol",
            "1e-11",
        ];
        let run = halfarrow(&folder, &[&run[..], &["--input", &given, "--record", "spring.q", "--out", "-"]].concat());
        let lines: Vec<String> = stdout(&run).lines().skip(1).map(|line| format!("{line},{push}")).collect();
        write(&folder, &format!("{name}.csv"), &format!("t,z,f\n{}\n", lines.join("\n")));
    }
    let fit = [
        "fit",
        &car,
        "--data",
        "a.csv",
        "--data",
        "b.csv",
        "--input",
        "push=@f",
        "--outputs",
        "spring.q=z",
        "--params",
    ];
    let fit = [&fit[..], &["k=5e3:80e3,b", "--starts", "3", "--profile", "b", "--sigma", "spring.q=1e-4"]].concat();
    let object = json(&halfarrow(&folder, &[&fit[..], &["--json", "--plot", "fit.svg"]].concat()));
    for (i, exact) in [25e3, 1500.0].into_iter().enumerate() {
        let value = object["parameters"][i]["value"].as_f64().expect("a value");
        assert!((value - exact).abs() < 1e-5 * exact, "{value} for {exact}");
    }
    assert_eq!((object["starts"].as_array().map(Vec::len), object["measurements"].as_u64()), (Some(3), Some(120)));
    assert!(object["profiles"][0]["interval"][1].as_f64() > Some(1500.0));
    assert!(fs::read_to_string(folder.join("fit.svg")).expect("a picture").contains("residual"));
    let told = stdout(&halfarrow(&folder, &fit));
    assert!(
        told.contains("3 searches, 3 from where the model runs") && told.contains("95 % interval of b by its profile"),
        "{told}"
    );
    let wrong = halfarrow(
        &folder,
        &["fit", &car, "--data", "a.csv", "--input", "push=@g", "--outputs", "spring.q=z", "--params", "k"],
    );
    assert!(status(&wrong) == 2 && stderr(&wrong).contains("no column `g`; there are f, z"), "{}", stderr(&wrong));
}

#[test]
fn a_model_is_exported_for_casadi() {
    let folder = folder("casadi");
    let told = stdout(&halfarrow(&folder, &["export", "casadi", &model("rc_bridge_cubic"), "--out", "bridge.py"]));
    assert!(told.contains("bridge.py"), "{told}");
    let text = fs::read_to_string(folder.join("bridge.py")).expect("a file");
    assert!(
        text.contains("import casadi as ca") && text.contains("def dae():") && text.contains("UNKNOWNS = [\""),
        "{text}"
    );
    let wrong = halfarrow(&folder, &["export", "casadi", &model("when_bouncing_ball"), "--out", "ball.py"]);
    assert!(status(&wrong) == 2 && stderr(&wrong).contains("have no memory"), "{}", stderr(&wrong));
}
