//! How commands end: output that cannot be written, signals, audits that are not met, two sweeps at once.
#![cfg(unix)]

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

const MODEL: &str = "model Osc\nparam k = 1e4\n1:a -> I:mass(1, f0 = 1)\na -> C:spring(k = k)\na -> R:d(0.1)\noutput speed = mass.f : km/h\n";

fn folder(test: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(test);
    let _ = fs::remove_dir_all(&path);
    fs::create_dir_all(&path).expect("a folder");
    fs::write(path.join("osc.bond"), MODEL).expect("a file");
    path
}

fn command(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_halfarrow"));
    command.current_dir(folder).args(arguments);
    command
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap_or_else(|why| panic!("{why}: {}", stderr(output)))
}

#[test]
#[cfg(target_os = "linux")]
fn every_command_says_that_its_output_cannot_be_written() {
    let here = folder("full");
    let commands: [&[&str]; 19] = [
        &["new", "other"],
        &["check", "osc.bond"],
        &["check", "osc.bond", "--json"],
        &["fmt", "osc.bond"],
        &["fmt", "osc.bond", "--json"],
        &["show", "ast", "osc.bond"],
        &["loops", "osc.bond"],
        &["equations", "osc.bond"],
        &["linearize", "osc.bond"],
        &["simulate", "osc.bond", "--to", "0.1", "--out", "-"],
        &["simulate", "osc.bond", "--to", "0.1", "--json"],
        &["simulate", "osc.bond", "--to", "0.1"],
        &["report", "osc.bond", "--to", "0.01", "--without-comparison", "--out", "osc.html"],
        &["sweep", "osc.bond", "--vary", "k=list(1,2)", "--to", "0.1", "--step", "1e-3", "--out", "osc.csv"],
        &["run", "osc.bond", "--rate", "1kHz", "--for", "0.005"],
        &["draw", "osc.bond", "--out", "osc.svg"],
        &["export", "c", "osc.bond", "--out", "osc"],
        &["--help"],
        &["--version"],
    ];
    for arguments in commands {
        let full = File::options().write(true).open("/dev/full").expect("the full device");
        let output = command(&here, arguments).stdout(full).output().expect("it starts");
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {}", stderr(&output));
        assert!(stderr(&output).contains("stdout cannot be written"), "{arguments:?}: {}", stderr(&output));
    }
}

#[test]
fn a_closed_pipe_is_no_error() {
    let here = folder("pipe");
    let arguments = ["simulate", "osc.bond", "--to", "1", "--every", "1e-5", "--out", "-"];
    let mut child = command(&here, &arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(!stderr(&output).contains("error"), "{}", stderr(&output));
}

/// Waits until a condition holds, for at most 60 s.
fn wait(what: &str, holds: impl Fn() -> bool) {
    let begun = Instant::now();
    while !holds() {
        assert!(begun.elapsed() < Duration::from_secs(60), "{what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Whether a process catches a signal, by the table of the system.
fn catches(child: &Child, signal: u32) -> bool {
    let status = fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigCgt:")).unwrap_or("0");
    u64::from_str_radix(mask.trim(), 16).is_ok_and(|mask| mask >> (signal - 1) & 1 == 1)
}

/// Starts a command, lets it run a while, sends a signal, and gives what came of it.
fn stopped(folder: &Path, arguments: &[&str], (name, signal): (&str, u32)) -> Output {
    let child = command(folder, arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    wait("signals are caught", || catches(&child, signal));
    std::thread::sleep(Duration::from_millis(500));
    let sent = Command::new("kill").args([&format!("-{name}"), &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
    child.wait_with_output().unwrap()
}

const SIGNALS: [(&str, u32); 3] = [("INT", 2), ("TERM", 15), ("HUP", 1)];

#[test]
#[cfg(target_os = "linux")]
fn signals_end_runs_in_order() {
    let here = folder("signals");
    for signal in SIGNALS {
        let arguments = ["simulate", "osc.bond", "--to", "1e6", "--every", "1", "--json"];
        let output = stopped(&here, &arguments, signal);
        let report = json(&output);
        assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
        assert!(report["error"].as_str().unwrap().contains("as asked") && report["complete"] == false, "{report}");
        assert!(report["reached"].as_f64() > Some(0.0) && report["steps"].as_u64() > Some(0));
        assert!(report["t"].as_array().is_some_and(|t| !t.is_empty()), "what was computed is there");

        let output = stopped(&here, &["run", "osc.bond", "--rate", "500Hz", "--json"], signal);
        let report = json(&output);
        assert_eq!(output.status.code(), Some(0), "without --for it runs until then: {}", stderr(&output));
        assert!(report["ticks"].as_u64() > Some(0) && report["error"].is_null(), "{report}");
    }
    let output = stopped(&here, &["run", "osc.bond", "--rate", "500Hz", "--for", "1000", "--json"], SIGNALS[0]);
    let report = json(&output);
    assert_eq!(output.status.code(), Some(3));
    assert!(report["ticks"].as_u64() > Some(0) && report["error"].as_str().unwrap().contains("as asked"), "{report}");
}

/// Where nobody listens for a while, as before a run has begun, a signal ends the program nevertheless.
#[test]
#[cfg(target_os = "linux")]
fn a_signal_ends_what_takes_long_before_a_run() {
    let here = folder("long");
    let family = ["new", "--family", "fourbars", "long", "640"];
    assert!(command(&here, &family).output().unwrap().status.success());
    let output = stopped(&here, &["simulate", "long.bond", "--to", "1"], SIGNALS[1]);
    assert_eq!(output.status.code(), Some(128 + 15), "{}", stderr(&output));
    assert!(stderr(&output).contains("ended as asked, before there was a result"), "{}", stderr(&output));
}

#[test]
#[cfg(target_os = "linux")]
fn a_sweep_keeps_others_away_and_goes_on_after_a_signal() {
    let here = folder("sweeps");
    let arguments =
        ["sweep", "osc.bond", "--vary", "k=lin(1,1000,400)", "--to", "20", "--step", "1e-3", "--out", "r.csv"];
    let json_too = [&arguments[..], &["--json"]].concat();
    let first = command(&here, &json_too).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    wait("a first chunk", || fs::metadata(here.join("r.csv.partial")).is_ok_and(|file| file.len() > 100));
    for more in [&[][..], &["--restart"]] {
        let second = command(&here, &[&arguments[..], more].concat()).output().unwrap();
        assert_eq!(second.status.code(), Some(2));
        assert!(stderr(&second).contains("another sweep is writing r.csv"), "{}", stderr(&second));
    }
    assert!(Command::new("kill").args(["-TERM", &first.id().to_string()]).status().unwrap().success());
    let output = first.wait_with_output().unwrap();
    let report = json(&output);
    if output.status.code() == Some(3) {
        assert!(report["error"].as_str().unwrap().contains("goes on from there"), "{report}");
        assert!(report["done"].as_u64() < Some(400) && report["sets"] == 400, "{report}");
        assert!(!here.join("r.csv").exists());
    }
    let short =
        ["sweep", "osc.bond", "--vary", "k=list(1,2)", "--to", "0.1", "--step", "1e-3", "--out", "r.csv", "--restart"];
    assert_eq!(command(&here, &short).output().unwrap().status.code(), Some(0), "the lock is gone");
}

#[test]
fn what_the_audit_finds_decides_the_exit_status() {
    let here = folder("verdicts");
    let run = |step: &str| {
        let arguments = ["simulate", "osc.bond", "--to", "1", "--solver", "heun", "--json", "--step", step];
        command(&here, &arguments).output().unwrap()
    };
    let fine = run("1e-5");
    let (fine, said) = (json(&fine), stderr(&fine));
    assert!(fine["audit"]["verdict"] == "holds" && fine["error"].is_null() && said.is_empty(), "{said}");
    let doubtful = run("2e-4");
    assert_eq!(doubtful.status.code(), Some(0));
    assert!(stderr(&doubtful).contains("warning: audit: ") && stderr(&doubtful).contains("shorten --step"));
    assert_eq!(json(&doubtful)["audit"]["verdict"], "doubtful");
    let refused = run("1e-2");
    assert_eq!(refused.status.code(), Some(3), "{}", stderr(&refused));
    let report = json(&refused);
    assert_eq!(report["audit"]["verdict"], "refused");
    assert!(report["error"].as_str().unwrap().contains("do not use it"), "{report}");
    let sweep =
        ["sweep", "osc.bond", "--vary", "k=list(1e4,2e4)", "--to", "1", "--solver", "heun", "--out", "r.csv", "--json"];
    let fine = command(&here, &[&sweep[..], &["--step", "1e-5"]].concat()).output().unwrap();
    assert_eq!((fine.status.code(), json(&fine)["audit"]["sets"].as_u64()), (Some(0), Some(2)));
    let refused = command(&here, &[&sweep[..], &["--step", "1e-2"]].concat()).output().unwrap();
    let report = json(&refused);
    assert_eq!((refused.status.code(), report["audit"]["refused"].as_u64()), (Some(3), Some(2)), "{report}");
    assert!(stderr(&refused).contains("2 of the 2 sets"), "{}", stderr(&refused));
}

#[test]
fn units_stand_in_a_second_line_and_are_those_of_exported_code() {
    let here = folder("units");
    let run = ["simulate", "osc.bond", "--to", "0.002", "--solver", "rk4", "--step", "1e-3", "--units", "--out", "-"];
    let output = command(&here, &run).output().unwrap();
    let csv = String::from_utf8(output.stdout).unwrap();
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!(lines[..3], ["t,mass.f,spring.q,speed", "s,m/s,m,km/h", "0.0,1.0,0.0,3.6"]);
    let sweep = ["sweep", "osc.bond", "--vary", "k=list(1)", "--to", "0.1", "--step", "1e-3", "--reduce", "max(speed)"];
    assert!(command(&here, &[&sweep[..], &["--units", "--out", "r.csv"]].concat()).status().unwrap().success());
    let rows = fs::read_to_string(here.join("r.csv")).unwrap();
    assert_eq!(rows.lines().take(2).collect::<Vec<_>>(), ["set,k,max(speed),failed", ",,km/h,"]);
    assert!(command(&here, &["export", "c", "osc.bond", "--out", "c"]).output().unwrap().status.success());
    let header = fs::read_to_string(here.join("c/osc.h")).unwrap();
    assert!(header.contains("speed, in m/s (declared in km/h)"), "{header}");
    let mut cc = Command::new("cc");
    cc.current_dir(here.join("c")).args(["-std=c99", "main.c", "osc.c", "-lm", "-o", "osc"]);
    assert!(cc.status().expect("a C compiler").success());
    let output = Command::new(here.join("c/osc")).args(["0.002", "1", "units"]).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    for (ours, theirs) in text.lines().zip(&lines).skip(2) {
        let numbers = |line: &str| line.split(',').map(|f| f.parse::<f64>().unwrap()).collect::<Vec<_>>();
        for (a, b) in numbers(ours).into_iter().zip(numbers(theirs)) {
            assert!((a - b).abs() <= 1e-15 * b.abs(), "{ours} {theirs}");
        }
    }
    assert_eq!(text.lines().take(2).collect::<Vec<_>>(), lines[..2]);
    assert_eq!(text.lines().count(), lines.len());
}
