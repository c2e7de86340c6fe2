//! A run against the wall clock.

use std::io::{BufRead, Write};
use std::net::{SocketAddr, UdpSocket};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::time::Duration;

use crate::table_file::ReadTable;
use halfarrow_compiler::equations::Form;
use halfarrow_compiler::unit::Unit;
use halfarrow_exec::{self as exec, Execution};
use halfarrow_sim::fixed_step::FixedMethod;
use halfarrow_sim::real_time::{Exchange, Histogram, OnMiss, Pace, Statistics, run_real_time};
use halfarrow_sim::{Failure, Method, Nobody, Options, System as _};
use serde::Serialize;

use crate::audited::{AuditReport, Audited};
use crate::cost;
use crate::drift::{DriftReport, drifts_at};
use crate::error::{Error, Problem};
use crate::input::{Input, connect};
use crate::model::Model;
use crate::names::listed;
use crate::run::{Record, Run, Start, choose, projected, units};
use crate::verdict::Made;
use crate::wall_clock::WallClock;

/// Evaluations of a block of nonlinear equations at most in one solution, where none are given.
const MOST_EVALUATIONS: usize = 50;
/// Steps that are audited before a run.
const REHEARSED: f64 = 100.0;
/// Modes of set-valued laws that are made before a run at most.
const MOST_MODES: usize = 256;
/// The clock spins for this long before a tick.
const SPIN: Duration = Duration::from_micros(200);
/// Ticks over which the stops that delays and samples ask for are counted.
const TICKS: f64 = 1000.0;
/// Bytes of a datagram at most.
const DATAGRAM: usize = 1472;

/// A run against the wall clock. Inputs and outputs are in the units that their declarations give.
#[derive(Debug, Clone, PartialEq)]
pub struct RealTimeRun {
    /// Ticks a second; above 0. Each is one step of the method.
    pub rate: f64,
    /// How long, in s of the model; `None`: until it is interrupted.
    pub length: Option<f64>,
    /// The method.
    pub method: FixedMethod,
    /// Where inputs come from. What none of these gives keeps its default.
    pub inputs: Vec<Feed>,
    /// Where recorded values are sent after every tick: one datagram of text, `t` and the values with commas between.
    pub output: Option<SocketAddr>,
    /// What is recorded.
    pub record: Record,
    /// Where to start.
    pub start: Start,
    /// What to do when a tick takes too long.
    pub on_miss: OnMiss,
    /// Evaluations of a block of nonlinear equations at most in one solution; `None`: 50.
    pub bound: Option<usize>,
    /// Whether positions that only speeds keep together are put back onto the relations between them after each step.
    pub project: bool,
    /// Bytecode or machine code; `Auto`: machine code wherever there is any, made before the clock starts.
    pub execution: Execution,
}

/// Where inputs come from.
#[derive(Debug, Clone, PartialEq)]
pub enum Feed {
    /// Datagrams of text: values in the order of the model's inputs, or `name=value`, with commas between. The last one
    /// before a tick counts.
    Udp(SocketAddr),
    /// The same in lines of stdin.
    Stdin,
    /// A CSV file for one input, against the time of the model.
    File(String, PathBuf),
    /// A CSV file with columns called as inputs.
    Table(PathBuf),
}

/// What a run against the wall clock has shown. Times in s.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RealTimeReport {
    /// Name of the model.
    pub model: String,
    /// Ticks a second asked for.
    pub rate: f64,
    /// The time that the model reached.
    pub reached: f64,
    /// Ticks that are over.
    pub ticks: u64,
    /// Ticks that ended after the next one was due.
    pub misses: u64,
    /// What was done then: `catch_up` or `skip`.
    pub on_miss: &'static str,
    /// Ticks left out.
    pub skipped: u64,
    /// Time from when a tick was due to its begin.
    pub jitter: Durations,
    /// Time that a step took.
    pub step: Durations,
    /// Inputs taken.
    pub received: u64,
    /// Datagrams or lines that could not be read.
    pub rejected: u64,
    /// Datagrams sent.
    pub sent: u64,
    /// Datagrams that could not be sent.
    pub lost: u64,
    /// Whether the model ran as machine code.
    pub machine: bool,
    /// Names of the values sent, after `t`.
    pub outputs: Vec<String>,
    /// The modes of set-valued laws, if there are any.
    pub modes: Option<ModesReport>,
    /// How often positions were put back onto relations that their speeds keep.
    pub projections: usize,
    /// How far positions have drifted from such relations at the end.
    pub drift: Vec<DriftReport>,
    /// What is to be known of the run.
    pub notes: Vec<String>,
    /// What the audit found in the first steps, taken before the run and without its live inputs.
    pub audit: AuditReport,
    /// Why it stopped before its end, if it did.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
}

/// How long something took, in s.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Durations {
    /// Half of all took at most this long.
    pub median: f64,
    /// 99 of 100.
    pub p99: f64,
    /// 999 of 1000.
    pub p999: f64,
    /// All.
    pub max: f64,
    /// Upper ends of classes, and how many are in each.
    pub histogram: Vec<(f64, u64)>,
}

/// The modes of set-valued laws in a run against the clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct ModesReport {
    /// How many set-valued laws there are.
    pub laws: usize,
    /// How many modes these can have; `None` if they are too many to be made before the run: each is made where the run first
    /// comes to it, and that tick is late.
    pub all: Option<usize>,
    /// How many of them have equations.
    pub possible: Option<usize>,
}

impl Durations {
    fn of(histogram: &Histogram) -> Durations {
        Durations {
            median: histogram.quantile(0.5),
            p99: histogram.quantile(0.99),
            p999: histogram.quantile(0.999),
            max: histogram.most(),
            histogram: histogram.buckets(),
        }
    }
}

impl Model {
    /// Runs the model against the wall clock. `statistics` can be read from another thread meanwhile; the run ends in order
    /// when `stop` becomes true. A run that has begun and stops before its end has its reason in [`RealTimeReport::error`].
    ///
    /// # Errors
    /// The model has errors, something is asked that cannot be, the run cannot start, or its first steps do not satisfy the
    /// model.
    pub fn run_real_time(
        &self,
        run: &RealTimeRun,
        statistics: &Statistics,
        stop: &AtomicBool,
    ) -> Result<RealTimeReport, Error> {
        let pace = pace(run)?;
        let mut system = self.system_in(Form::Minimal)?;
        if run.method.takes_jacobian() {
            system.prepare_derivatives().map_err(|failure| self.stopped(failure))?;
        }
        connect(&system.program().inputs.clone(), &files(run, &system)?, |name, t, v| system.connect(name, t, v))?;
        choose(&mut system, &run.record)?;
        let notes = projected(system.program(), run.project, Method::Fixed(run.method))?;
        cost::held(&system, TICKS / run.rate)?;
        let mut x = self.start(&mut system, run.start)?;
        system.begin_at_positions(0.0, &mut x);
        system.bound_iterations(run.bound.unwrap_or(MOST_EVALUATIONS));
        let modes = self.prepared_modes(&system);
        let audit = self.rehearse(&system, run, &x)?;
        let machine = make_ready(&mut system, run)?;
        system.tell_drift(true);
        let mut ports = Channels::open(run, &system, stop)?;
        let mut clock = WallClock::new(SPIN);
        let end = run_real_time(&mut system, run.method, &pace, &mut x, &mut clock, &mut ports, statistics);
        let projections = end.as_ref().map_or_else(|stopped| stopped.summary.projections, |done| done.projections);
        let drift = drifts_at(&mut system, statistics.time(), &x);
        let error = match end {
            Err(stopped) if statistics.ticks() == 0 => return Err(self.stopped_at(stopped)),
            Err(stopped) => Some(stopped.to_string()),
            Ok(_) if pace.ticks.is_some_and(|ticks| statistics.ticks() < ticks) => {
                Some(Failure::Interrupted { time: statistics.time() }.to_string())
            }
            Ok(_) => None,
        };
        Ok(RealTimeReport {
            model: self.name().to_string(),
            rate: run.rate,
            reached: statistics.time(),
            ticks: statistics.ticks(),
            misses: statistics.misses(),
            on_miss: match run.on_miss {
                OnMiss::CatchUp => "catch_up",
                OnMiss::Skip => "skip",
            },
            skipped: statistics.skipped(),
            jitter: Durations::of(&statistics.jitter),
            step: Durations::of(&statistics.step),
            received: ports.received,
            rejected: ports.rejected,
            sent: ports.sent,
            lost: ports.lost,
            machine,
            outputs: system.recorded().iter().map(|&i| system.program().observed[i].name.to_string()).collect(),
            modes,
            projections,
            drift,
            notes,
            audit,
            error,
        })
    }

    /// Makes the modes that set-valued laws can have, before the clock runs; what is to be known of them.
    fn prepared_modes(&self, system: &exec::Model) -> Option<ModesReport> {
        let laws = self.graph.set_valued.len();
        (laws > 0).then(|| match system.prepare_modes(MOST_MODES) {
            Some((all, possible)) => ModesReport { laws, all: Some(all), possible: Some(possible) },
            None => ModesReport { laws, all: None, possible: None },
        })
    }

    /// Audits the first steps, as they would be without live inputs: in the run itself there is no time for it.
    fn rehearse(&self, system: &exec::Model, run: &RealTimeRun, x: &[f64]) -> Result<AuditReport, Error> {
        let (mut system, mut x) = (system.clone(), x.to_vec());
        // Nothing needs to be recorded, which cannot fail.
        let _ = system.record(&[]);
        let step = 1.0 / run.rate;
        let to = run.length.unwrap_or(f64::INFINITY).min(REHEARSED * step).max(step);
        let options = Options {
            method: Method::Fixed(run.method),
            to,
            step: Some(step),
            project: run.project,
            ..Options::default()
        };
        let mut audited = Audited::new(&mut system, &self.graph);
        // What stops it stops the run itself, which tells it.
        let _ = audited.simulate(&options, &mut x, &mut Nobody);
        let mut report = audited.finish();
        let made = Made::by(&Run { method: options.method, step: options.step, ..Run::default() });
        report.judge(&made);
        // Steps that are too long are the modeller's choice; laws that do not hold are nobody's.
        let laws =
            AuditReport { power: report.power.clone(), residual: report.residual.clone(), ..AuditReport::default() };
        match laws.refusal(&made) {
            Some(failure) => Err(self.stopped(failure)),
            None => Ok(report),
        }
    }
}

fn pace(run: &RealTimeRun) -> Result<Pace, Problem> {
    let bad = |reason: String| Err(Problem::BadOption { reason });
    if !(run.rate.is_finite() && run.rate > 0.0) {
        return bad(format!("the rate is {} Hz: it has to be above 0", run.rate));
    }
    if run.length.is_some_and(|length| !(length.is_finite() && length > 0.0)) {
        return bad("the length of the run has to be above 0 s".into());
    }
    let ticks = run.length.map(|length| (length * run.rate).round().max(1.0) as u64);
    Ok(Pace { step: 1.0 / run.rate, ticks, on_miss: run.on_miss, project: run.project })
}

/// Makes all machine code that a tick may need; whether there is any. Without it for this processor the bytecode runs on,
/// unless machine code is asked for.
fn make_ready(system: &mut exec::Model, run: &RealTimeRun) -> Result<bool, Problem> {
    let made = match run.execution {
        Execution::Bytecode => return Ok(false),
        Execution::Auto | Execution::Machine => system.compile_machine(),
    };
    let differentiates = run.method.takes_jacobian() || (run.method.is_implicit() && !system.compares_rates());
    let made = made.and_then(|()| if differentiates { system.compile_directional() } else { Ok(()) });
    match made {
        Err(why) if run.execution == Execution::Machine => Err(Problem::BadOption { reason: why.to_string() }),
        made => Ok(made.is_ok()),
    }
}

/// The files among the sources, an input each.
fn files(run: &RealTimeRun, system: &exec::Model) -> Result<Vec<(String, Input)>, Problem> {
    let mut inputs = Vec::new();
    for source in &run.inputs {
        match source {
            Feed::File(name, path) => inputs.push((name.clone(), path.clone().into())),
            Feed::Table(path) => {
                let bad = |faults| Problem::BadInput { path: path.clone(), faults };
                let columns = ReadTable::open(path)?.columns;
                let known = |name: &String| system.program().inputs.iter().any(|i| i.name == *name);
                let found: Vec<String> = columns.into_keys().filter(known).collect();
                if found.is_empty() {
                    return Err(bad(vec!["no column is called as an input of the model".into()]));
                }
                inputs.extend(found.into_iter().map(|name| (name, path.clone().into())));
            }
            Feed::Udp(_) | Feed::Stdin => {}
        }
    }
    Ok(inputs)
}

/// A number in a declared unit, to SI or back: `factor · value + offset`.
#[derive(Clone, Copy)]
struct UnitConversion {
    factor: f64,
    offset: f64,
}

impl UnitConversion {
    fn to_si(unit: Option<&Unit>) -> UnitConversion {
        let at = |value: f64| unit.map_or(value, |unit| unit.to_si_f64(value));
        UnitConversion { factor: at(1.0) - at(0.0), offset: at(0.0) }
    }
    fn from_si(unit: Option<&Unit>) -> UnitConversion {
        let at = |value: f64| unit.map_or(value, |unit| unit.from_si_f64(value));
        UnitConversion { factor: at(1.0) - at(0.0), offset: at(0.0) }
    }
    fn of(self, value: f64) -> f64 {
        self.factor * value + self.offset
    }
}

/// What stands between a run and the outside. All memory is taken when it is opened.
struct Channels<'s> {
    /// Whether to end the run.
    stop: &'s AtomicBool,
    names: Vec<String>,
    scales: Vec<UnitConversion>,
    from: Option<UdpSocket>,
    stdin: Option<Arc<Lines>>,
    to: Option<UdpSocket>,
    shown: Vec<UnitConversion>,
    buffer: Box<[u8; DATAGRAM]>,
    values: Vec<f64>,
    received: u64,
    rejected: u64,
    sent: u64,
    lost: u64,
}

/// The values of the last line of stdin, shared with the thread that reads it.
struct Lines {
    /// Bits of the values; those of NaN where none came yet.
    values: Vec<AtomicU64>,
    received: AtomicU64,
    rejected: AtomicU64,
}

impl<'s> Channels<'s> {
    fn open(run: &RealTimeRun, system: &exec::Model, stop: &'s AtomicBool) -> Result<Channels<'s>, Problem> {
        let program = system.program();
        let names: Vec<String> = program.inputs.iter().map(|i| i.name.clone()).collect();
        let wants = |wanted: &Feed| matches!(wanted, Feed::Udp(_) | Feed::Stdin);
        if names.is_empty() && run.inputs.iter().any(wants) {
            return Err(Problem::BadOption { reason: "the model has no inputs to feed".into() });
        }
        let refused = |what: &str, at: SocketAddr, why: std::io::Error| Problem::BadOption {
            reason: format!("{what} udp://{at} cannot be opened: {why}"),
        };
        let mut ports = Channels {
            stop,
            scales: program.inputs.iter().map(|i| UnitConversion::to_si(i.unit.as_ref())).collect(),
            from: None,
            stdin: None,
            to: None,
            shown: units(system).iter().map(|unit| UnitConversion::from_si(unit.as_ref())).collect(),
            buffer: Box::new([0; DATAGRAM]),
            values: vec![f64::NAN; names.len()],
            names,
            received: 0,
            rejected: 0,
            sent: 0,
            lost: 0,
        };
        for source in &run.inputs {
            match *source {
                Feed::Udp(at) => {
                    let socket = UdpSocket::bind(at).map_err(|why| refused("the input", at, why))?;
                    socket.set_nonblocking(true).map_err(|why| refused("the input", at, why))?;
                    ports.from = Some(socket);
                }
                Feed::Stdin => ports.stdin = Some(Lines::read(ports.names.clone())),
                _ => {}
            }
        }
        if let Some(at) = run.output {
            let any = if at.is_ipv4() { "0.0.0.0:0" } else { "[::]:0" };
            let socket = UdpSocket::bind(any).and_then(|socket| {
                socket.connect(at)?;
                socket.set_nonblocking(true)?;
                Ok(socket)
            });
            ports.to = Some(socket.map_err(|why| refused("the output", at, why))?);
        }
        Ok(ports)
    }

    /// Takes the last datagram that has come.
    fn take_datagrams(&mut self) {
        let Some(socket) = &self.from else { return };
        while let Ok(size) = socket.recv(&mut self.buffer[..]) {
            let text = std::str::from_utf8(&self.buffer[..size]).unwrap_or("?");
            match parse(text, &self.names, &mut |i, value| self.values[i] = value) {
                true => self.received += 1,
                false => self.rejected += 1,
            }
        }
    }

    fn take_lines(&mut self) {
        let Some(lines) = &self.stdin else { return };
        for (value, bits) in self.values.iter_mut().zip(&lines.values) {
            let new = f64::from_bits(bits.load(Relaxed));
            if !new.is_nan() {
                *value = new;
            }
        }
        self.received = lines.received.load(Relaxed);
        self.rejected = lines.rejected.load(Relaxed);
    }
}

impl Exchange<exec::Model> for Channels<'_> {
    fn input(&mut self, _: f64, system: &mut exec::Model) -> bool {
        self.take_datagrams();
        self.take_lines();
        for (i, (value, scale)) in self.values.iter_mut().zip(&self.scales).enumerate() {
            if !value.is_nan() {
                system.set_input(i, scale.of(*value));
            }
        }
        !self.stop.load(Relaxed)
    }

    fn output(&mut self, t: f64, values: &[f64]) {
        let Some(socket) = &self.to else { return };
        let mut rest = &mut self.buffer[..];
        let mut whole = write!(rest, "{t:?}").is_ok();
        for (value, scale) in values.iter().zip(&self.shown) {
            whole &= write!(rest, ",{:?}", scale.of(*value)).is_ok();
        }
        whole &= rest.write_all(b"\n").is_ok();
        let size = DATAGRAM - rest.len();
        match whole && socket.send(&self.buffer[..size]).is_ok() {
            true => self.sent += 1,
            false => self.lost += 1,
        }
    }
}

impl Lines {
    /// Starts a thread that reads stdin to its end.
    fn read(names: Vec<String>) -> Arc<Lines> {
        let lines = Arc::new(Lines {
            values: names.iter().map(|_| AtomicU64::new(f64::NAN.to_bits())).collect(),
            received: AtomicU64::new(0),
            rejected: AtomicU64::new(0),
        });
        let shared = Arc::clone(&lines);
        std::thread::spawn(move || {
            for line in std::io::stdin().lock().lines().map_while(Result::ok) {
                let good = parse(&line, &names, &mut |i, value| shared.values[i].store(value.to_bits(), Relaxed));
                let count = if good { &shared.received } else { &shared.rejected };
                count.fetch_add(1, Relaxed);
            }
        });
        lines
    }
}

/// Reads values in order, or by name, with commas between; tells whether all of it could be read. Nothing is put if not.
fn parse(text: &str, names: &[String], put: &mut dyn FnMut(usize, f64)) -> bool {
    let read = |put: &mut dyn FnMut(usize, f64)| {
        listed(text.trim()).into_iter().enumerate().all(|(place, field)| {
            let (index, number) = match field.split_once('=') {
                Some((name, number)) => (names.iter().position(|known| known == name.trim()), number),
                None => (Some(place).filter(|&place| place < names.len()), field),
            };
            match (index, number.trim().parse::<f64>()) {
                (Some(index), Ok(value)) if value.is_finite() => {
                    put(index, value);
                    true
                }
                _ => false,
            }
        })
    };
    read(&mut |_, _| {}) && read(put)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Option<Vec<(usize, f64)>> {
        let names = ["road".to_string(), "brake".to_string()];
        let mut found = Vec::new();
        parse(text, &names, &mut |i, value| found.push((i, value))).then_some(found)
    }

    #[test]
    fn inputs_in_order_or_by_name() {
        assert_eq!(read("0.5, 2e3\n"), Some(vec![(0, 0.5), (1, 2000.0)]));
        assert_eq!(read("0.5"), Some(vec![(0, 0.5)]));
        assert_eq!(read("brake = -1"), Some(vec![(1, -1.0)]));
        for bad in ["", "x", "1,2,3", "clutch=1", "nan", "inf", "1,,2", "brake="] {
            assert_eq!(read(bad), None, "{bad}");
        }
    }
}
