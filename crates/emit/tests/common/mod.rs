//! Models in C, built and run beside the interpreter.
#![allow(dead_code)]

use halfarrow_compiler::bond_graph::{FileError, Files};
use halfarrow_compiler::compile::{Text, compile};
use halfarrow_compiler::equations::Form;
use halfarrow_emit::c::{Export, Written, write};
use halfarrow_emit::{EmitError, Method, Real, Start};
use halfarrow_exec::Model;
use halfarrow_sim::fixed_step::FixedMethod;
use halfarrow_sim::{Events as _, Options, Sink, Stepwise, System, simulate, tick};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

pub const DRIVER: &str = include_str!("driver.c");
/// Steps of the runs that are compared.
pub const STEPS: usize = 150;
pub const FLAGS: [&str; 7] =
    ["-std=c99", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror", "-ffp-contract=off"];

struct Disk;

impl Files for Disk {
    fn read(&self, path: &str) -> Result<String, FileError> {
        fs::read_to_string(path).map_err(|why| FileError::Unreadable(why.to_string()))
    }

    fn library(&self, name: &str) -> Option<String> {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../library");
        fs::read_to_string(root.join(name.replace('.', "/")).with_extension("bond")).ok()
    }
}

/// A model, written and ready to be run.
pub struct Exported {
    pub model: Model,
    pub start: Vec<f64>,
    pub at_start: Start,
    pub written: Written,
    pub method: Method,
    pub step: f64,
    pub outputs: Vec<String>,
    /// Whether positions are put back.
    pub project: bool,
}

/// Time and outputs at each step.
pub type Rows = Vec<Vec<f64>>;

/// All models of the repository that can be exported, and those of these tests.
pub fn models() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folders = fs::read_dir(root.join("../../models")).expect("models/");
    let mut all: Vec<PathBuf> = folders.map(|e| e.unwrap().path().join("model.bond")).filter(|p| p.is_file()).collect();
    let own = fs::read_dir(root.join("tests/models")).expect("models of the tests");
    all.extend(own.map(|e| e.unwrap().path()).filter(|p| p.extension().is_some_and(|e| e == "bond")));
    all.sort();
    all
}

/// A model of these tests.
pub fn own(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/models").join(format!("{name}.bond"))
}

/// Diodes: where rounding hides small unknowns, and where a law overflows at rest.
pub fn diodes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/common/diodes.bond")
}

/// A double wishbone: a loop in space that is solved by gains.
pub fn wishbone() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/common/wishbone.bond")
}

/// A slider-crank whose positions only speeds keep.
pub fn speeds() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/common/speeds.bond")
}

/// A model whose structure is another where two of its parameters differ.
pub fn difference() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/common/difference.bond")
}

/// The program of a model.
pub fn read_program(path: &Path) -> halfarrow_compiler::program::Program {
    let text = fs::read_to_string(path).expect("a model");
    let name = path.to_string_lossy();
    let reached = compile(Text { name: &name, text: &text, files: &Disk, overrides: &[] }, Form::Minimal);
    reached.unwrap_or_else(|found| panic!("{}", found.render(false))).ir
}

pub fn export(path: &Path, method: Method, step: f64) -> Exported {
    let mut program = read_program(path);
    program.name = format!("{}_{}", program.name, method.name());
    export_program(program, method, step, false)
}

/// A model with real numbers of single precision.
pub fn export_single(path: &Path, method: Method, step: f64) -> Exported {
    let mut program = read_program(path);
    program.name = format!("{}_{}_single", program.name, method.name());
    export_as(program, method, step, (false, Real::Float)).unwrap_or_else(|why| panic!("{}: {why}", path.display()))
}

pub fn export_program(
    program: halfarrow_compiler::program::Program,
    method: Method,
    step: f64,
    derivatives: bool,
) -> Exported {
    export_as(program, method, step, (derivatives, Real::Double)).expect("an explicit program")
}

/// A model whose steps put positions back that only speeds keep.
pub fn export_projecting(path: &Path, method: Method, step: f64) -> Exported {
    let mut program = read_program(path);
    program.name = format!("{}_{}_project", program.name, method.name());
    export_whole(program, method, step, (false, Real::Double, true)).expect("an explicit program")
}

/// With derivatives or not, and real numbers of this size.
pub fn export_as(
    program: halfarrow_compiler::program::Program,
    method: Method,
    step: f64,
    (derivatives, real): (bool, Real),
) -> Result<Exported, EmitError> {
    export_whole(program, method, step, (derivatives, real, false))
}

fn export_whole(
    program: halfarrow_compiler::program::Program,
    method: Method,
    step: f64,
    (derivatives, real, project): (bool, Real, bool),
) -> Result<Exported, EmitError> {
    let mut model = Model::new(program.clone()).expect("parameters have values");
    model.record_impulses();
    let mut x = model.initialise(0.0).expect("a start");
    let start = Start {
        states: x.clone(),
        conserved: model.conserved().to_vec(),
        positions: model.positions().to_vec(),
        scales: model.scales().to_vec(),
        grown: Vec::new(),
        times: program.held.iter().map(|h| model.constant(h.time).unwrap_or(f64::NAN)).collect(),
        parameters: program.parameters.iter().map(|p| model.parameter(&p.name).unwrap_or(f64::NAN)).collect(),
        derived: model.derived().to_vec(),
        inputs: program.inputs.iter().map(|i| model.constant(i.default).unwrap_or(0.0)).collect(),
        observed: vec![f64::NAN; model.observed()],
    };
    let recorded = model.recorded().to_vec();
    let written = write(&Export {
        program: &program,
        start: &start,
        method,
        step,
        recorded: &recorded,
        derivatives,
        real,
        modes: &[],
        independent: &[],
        project,
    })?;
    let outputs = recorded.iter().map(|&i| program.observed[i].name.to_string()).collect();
    x.truncate(program.states.len());
    Ok(Exported { model, start: x, at_start: start, written, method, step, outputs, project })
}

struct Collect(Rows);

impl Sink for Collect {
    fn sample(&mut self, t: f64, values: &[f64]) {
        self.0.push(std::iter::once(t).chain(values.iter().copied()).collect());
    }
}

impl Exported {
    /// The same run by the interpreter: the samples, and why it stopped early.
    pub fn simulate(&self, steps: usize) -> (Rows, Option<String>) {
        self.simulate_from(self.model.clone(), self.start.clone(), steps)
    }

    /// The same run, taken from step to step.
    pub fn step(&self, steps: usize) -> (Rows, Option<String>) {
        self.step_with(steps, |_, _| {})
    }

    /// The same where something is done before each step.
    pub fn step_with(&self, steps: usize, before: impl Fn(&mut Model, usize)) -> (Rows, Option<String>) {
        let (mut model, mut x) = (self.model.clone(), self.start.clone());
        let mut run = Stepwise::new(self.fixed_method(), 0.0, &model).projecting(self.project);
        let mut values = vec![0.0; model.observed()];
        let mut rows = Vec::new();
        for i in 0..=steps {
            let t = tick(0.0, self.step, i as f64);
            if i > 0 {
                before(&mut model, i - 1);
            }
            let done = if i == 0 { run.start(&mut model, &mut x) } else { run.advance(&mut model, t, &mut x) };
            if let Err(stopped) = done {
                return (rows, Some(stopped.to_string()));
            }
            model.observe(t, &x, &mut values).expect("values");
            rows.push(std::iter::once(t).chain(values.iter().copied()).collect());
        }
        (rows, None)
    }

    fn fixed_method(&self) -> FixedMethod {
        match self.method {
            Method::Euler => FixedMethod::Euler,
            Method::Heun => FixedMethod::Heun,
            Method::Rk4 => FixedMethod::Rk4,
            Method::ImplicitMidpoint => FixedMethod::ImplicitMidpoint,
            Method::LinearlyImplicitEuler => FixedMethod::LinearlyImplicitEuler,
            Method::LinearlyImplicitBdf2 => FixedMethod::LinearlyImplicitBdf2,
            Method::Rosenbrock => FixedMethod::Rosenbrock,
        }
    }

    /// The same with another model, from other start values.
    pub fn simulate_from(&self, mut model: Model, mut x: Vec<f64>, steps: usize) -> (Rows, Option<String>) {
        let method = self.fixed_method();
        let per_second = (1.0 / self.step).round();
        let to = if 1.0 / per_second == self.step { steps as f64 / per_second } else { steps as f64 * self.step };
        let (method, step) = (halfarrow_sim::Method::Fixed(method), Some(self.step));
        let options = Options { to, every: step, step, method, project: self.project, ..Options::default() };
        let mut sink = Collect(Vec::new());
        let outcome = simulate(&mut model, &options, &mut x, &mut sink);
        (sink.0, outcome.err().map(|stopped| stopped.to_string()))
    }
}

/// A program that was built.
pub struct Built(PathBuf);

impl Built {
    /// What it prints.
    pub fn run(&self, arguments: &[&str]) -> String {
        let out = Command::new(&self.0).args(arguments).output().expect("it runs");
        assert!(out.status.success(), "{:?}\n{}", out.status, String::from_utf8_lossy(&out.stderr));
        String::from_utf8(out.stdout).expect("text")
    }

    /// The path of the program.
    pub fn path(&self) -> &Path {
        &self.0
    }
}

/// A folder of this name for the files of a test, empty.
pub fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("emit").join(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).expect("a folder");
    folder
}

/// Writes models and a driver, compiles them on two threads, links them.
pub fn build(name: &str, all: &[Exported], driver: &str) -> Built {
    build_with(name, all, driver, &["-O0"])
}

pub fn build_with(name: &str, all: &[Exported], driver: &str, more: &[&str]) -> Built {
    build_by(&compiler(), name, all, driver, more)
}

fn compiler() -> String {
    std::env::var("CC").unwrap_or_else(|_| "cc".to_string())
}

/// The same with a compiler of this name.
pub fn build_by(compiler: &str, name: &str, all: &[Exported], driver: &str, more: &[&str]) -> Built {
    let folder = folder(name);
    let includes: String = all.iter().map(|e| format!("#include \"{}.h\"\n", e.written.name)).collect();
    fs::write(folder.join("driver.c"), includes + driver).expect("a file");
    let mut sources = vec!["driver.c".to_string()];
    for one in all {
        let w = &one.written;
        fs::write(folder.join(format!("{}.h", w.name)), &w.header).expect("a file");
        fs::write(folder.join(format!("{}.c", w.name)), &w.source).expect("a file");
        sources.push(format!("{}.c", w.name));
    }
    let half = sources.len().div_ceil(2);
    std::thread::scope(|scope| {
        for part in sources.chunks(half) {
            let folder = &folder;
            scope.spawn(move || cc(compiler, folder, |c| c.args(FLAGS).args(more).arg("-c").args(part)));
        }
    });
    let objects: Vec<String> = sources.iter().map(|s| s.replace(".c", ".o")).collect();
    cc(compiler, &folder, |c| c.args(more).args(&objects).args(["-o", "program", "-lm"]));
    Built(folder.join("program"))
}

/// Runs the C compiler.
pub fn cc(compiler: &str, folder: &Path, arguments: impl FnOnce(&mut Command) -> &mut Command) {
    let mut command = Command::new(compiler);
    let out = arguments(command.current_dir(folder)).output().expect("a C compiler: cc, or what CC names");
    let errors: String = String::from_utf8_lossy(&out.stderr).lines().take(40).map(|l| format!("{l}\n")).collect();
    assert!(out.status.success(), "{errors}");
}
