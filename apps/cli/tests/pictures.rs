//! Options of drawings, plots and reports on the command line.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const QUARTER_CAR: &str = "../../models/quarter_car/model.bond";

/// A folder of its own for a test.
fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("halfarrow-pictures-{}-{name}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    folder
}

fn halfarrow(at: &Path, arguments: &[&str]) -> Output {
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join(QUARTER_CAR);
    let (command, rest) = arguments.split_first().expect("a command");
    let mut program = Command::new(env!("CARGO_BIN_EXE_halfarrow"));
    program.current_dir(at).arg(command).arg(model).args(rest).output().expect("it runs")
}

fn read(at: &Path, file: &str) -> String {
    std::fs::read_to_string(at.join(file)).unwrap_or_else(|e| panic!("{file}: {e}"))
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn a_drawing_shows_what_is_asked_for_and_keeps_places() {
    let at = folder("draw");
    assert!(halfarrow(&at, &["draw", "--out", "old.svg"]).status.success());
    assert!(
        halfarrow(&at, &["draw", "--out", "new.svg", "--no-laws", "--no-paths", "--keep", "old.svg"]).status.success()
    );
    let (old, new) = (read(&at, "old.svg"), read(&at, "new.svg"));
    assert!(old.contains(">k = kt<") && !new.contains(">k = kt<") && new.contains("tread"));
    let none = halfarrow(&at, &["draw", "--out", "x.svg", "--paths", "1"]);
    assert!(none.status.code() == Some(2) && said(&none).contains("no causal path"), "{}", said(&none));
    let both = halfarrow(&at, &["draw", "--out", "x.svg", "--paths", "1", "--no-paths"]);
    assert_eq!(both.status.code(), Some(2));
    std::fs::write(at.join("other.svg"), "<svg/>").expect("a file");
    let other = halfarrow(&at, &["draw", "--out", "x.svg", "--keep", "other.svg"]);
    assert!(other.status.code() == Some(2) && said(&other).contains("no drawing by"), "{}", said(&other));
}

#[test]
fn plots_lay_runs_over_each_other() {
    let at = folder("plot");
    let run = |more: &[&str]| halfarrow(&at, &[&["simulate", "--to", "1", "--every", "0.05"], more].concat());
    assert!(run(&["--out", "soft.csv", "--set", "ks=9e3"]).status.success());
    let done = run(&[
        "--plot",
        "a.svg",
        "--plot-vars",
        "damper.e,body.f",
        "--overlay",
        "soft.csv",
        "--overlay",
        "ks=30e3,b=500",
    ]);
    assert!(done.status.success(), "{}", said(&done));
    let svg = read(&at, "a.svg");
    assert!(svg.contains("body.f · soft.csv") && svg.contains("damper.e · ks=30e3,b=500"), "{svg}");
    // The file does not hold the effort of the damper.
    assert_eq!(svg.matches("class=\"curve\"").count(), 5);
    let phase = run(&["--plot", "b.svg", "--plot-vars", "body.f", "--plot-x", "spring.q", "--plot-log", "x"]);
    assert!(phase.status.success() && read(&at, "b.svg").contains("spring.q in m"), "{}", said(&phase));
    let bad = run(&["--plot", "c.svg", "--overlay", "soft"]);
    assert!(bad.status.code() == Some(2) && said(&bad).contains("neither a .csv file nor"), "{}", said(&bad));
    assert_eq!(run(&["--plot-x", "spring.q"]).status.code(), Some(2), "there is no plot");
}

#[test]
fn an_animation_is_written_beside_the_rest() {
    let at = folder("animate");
    let text = "model Fall\nimport std.multibody\nWorld:world -> Prismatic:guide -> Body:stone(m = 1 kg, J = diag([1, 1, 1]))\n";
    std::fs::write(at.join("fall.bond"), text).expect("a file");
    let run = |more: &[&str]| {
        let mut program = Command::new(env!("CARGO_BIN_EXE_halfarrow"));
        program.current_dir(&at).args(["simulate", "fall.bond", "--to", "1"]).args(more).output().expect("it runs")
    };
    let done = run(&["--animate", "fall.html", "--out", "film.csv", "--solver", "rk4", "--step", "0.01"]);
    assert!(done.status.success(), "{}", said(&done));
    assert!(read(&at, "fall.html").contains("\"stone.solid\""));
    // Of the steps every second one, and no columns of the picture; the rows are those of a run without it.
    assert!(run(&["--out", "plain.csv", "--solver", "rk4", "--step", "0.01", "--every", "0.02"]).status.success());
    assert_eq!(read(&at, "film.csv"), read(&at, "plain.csv"));
    assert!(
        run(&["--animate", "all.htm", "--record", "guide.q,stone.solid.r[3]", "--out", "own.csv"]).status.success()
    );
    assert!(read(&at, "own.csv").starts_with("t,guide.q,stone.solid.r[3]\n"));
    assert!(read(&at, "own.csv").lines().count() == 62);
    let other = run(&["--animate", "fall.svg"]);
    assert!(other.status.code() == Some(2) && said(&other).contains(".html"), "{}", said(&other));
    let bare = halfarrow(&at, &["simulate", "--to", "1", "--animate", "x.html"]);
    assert!(bare.status.code() == Some(2) && said(&bare).contains("nothing to show"), "{}", said(&bare));
}
