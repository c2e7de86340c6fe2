//! What the terminal shows: text, JSON, errors, a progress bar.

use std::env;
use std::io::{self, IsTerminal, Write};
use std::time::{Duration, Instant};

use halfarrow::{Error, Found, Problem};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde_json::Value;

/// A run shorter than this shows no progress bar.
const PATIENCE: Duration = Duration::from_millis(700);

/// Prints text to stdout; a closed pipe is no error.
pub fn print(text: &str) -> Result<(), Problem> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(why) if why.kind() != io::ErrorKind::BrokenPipe => {
            Err(Problem::Unwritable { path: "stdout".into(), why: why.to_string() })
        }
        _ => Ok(()),
    }
}

/// Prints one JSON object.
pub fn print_json(value: &Value) -> Result<(), Problem> {
    print(&format!("{value:#}\n"))
}

/// Says something beside the result.
pub fn note(text: &str) {
    let _ = writeln!(io::stderr().lock(), "{text}");
}

/// Shows an error, with `json` on stdout too, and gives the exit status.
pub fn fail(error: &Error, json: bool) -> u8 {
    note(error.render(color(&io::stderr())).trim_end());
    match json.then(|| print_json(&error.to_json())) {
        Some(Err(problem)) => unprinted(&problem, error.exit_status()),
        _ => error.exit_status(),
    }
}

/// The exit status where the result could not be printed, and `status` would be right without that.
fn unprinted(problem: &Problem, status: u8) -> u8 {
    note(&format!("error: {problem}"));
    status.max(Error::Usage(problem.clone()).exit_status())
}

/// The exit status of a command whose last act is to print.
pub fn printed(result: Result<(), Problem>, status: u8) -> u8 {
    result.map_or_else(|problem| unprinted(&problem, status), |()| status)
}

/// Shows warnings.
pub fn warn(found: &Found) {
    if !found.diagnostics.0.is_empty() {
        note(found.render(color(&io::stderr())).trim_end());
    }
}

/// Whether to use colours: on a terminal, unless `NO_COLOR` is set.
fn color(stream: &impl IsTerminal) -> bool {
    stream.is_terminal() && env::var_os("NO_COLOR").is_none_or(|v| v.is_empty())
}

/// A number with six digits.
pub fn short(x: f64) -> String {
    let size = x.abs();
    if x == 0.0 || (1e-4..1e6).contains(&size) {
        let digits = if x == 0.0 { 0 } else { (5 - libm::log10(size).floor() as i32).clamp(0, 9) as usize };
        let text = format!("{x:.digits$}");
        match text.contains('.') {
            true => text.trim_end_matches('0').trim_end_matches('.').to_string(),
            false => text,
        }
    } else {
        format!("{x:.5e}")
    }
}

/// A time in ms, to a microsecond.
pub fn milliseconds(seconds: f64) -> String {
    format!("{:.3}", seconds * 1e3)
}

/// Time between two lines of progress where stderr is no terminal.
const SPELL: Duration = Duration::from_secs(5);

/// The progress of a run on stderr: a bar on a terminal, else a line now and then.
pub struct Progress {
    bar: Option<ProgressBar>,
    /// When a line is due where there is no bar.
    due: Duration,
    to: f64,
    /// What is told, from how far it has come and how far it goes.
    told: fn(f64, f64) -> String,
    begun: Instant,
}

impl Progress {
    /// Of a run to `to`, in s.
    pub fn new(to: f64) -> Progress {
        Progress::telling(to, |t, to| format!("t = {} s of {} s", short(t), short(to)))
    }

    /// Of so many sets of parameters.
    pub fn of_sets(sets: usize) -> Progress {
        Progress::telling(sets as f64, |done, sets| format!("{done} of {sets} sets"))
    }

    fn telling(to: f64, told: fn(f64, f64) -> String) -> Progress {
        let bar = io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::with_draw_target(Some(1000), ProgressDrawTarget::hidden());
            let style = ProgressStyle::with_template("{bar:40} {percent:>3} %  {msg}  {eta} left");
            bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
        });
        Progress { bar, due: SPELL, to, told, begun: Instant::now() }
    }

    /// It has come to `t`.
    pub fn reach(&mut self, t: f64) {
        let told = self.told;
        self.tell(t, |to| told(t, to));
        let Some(bar) = &self.bar else { return };
        if bar.is_hidden() {
            if self.begun.elapsed() < PATIENCE {
                return;
            }
            bar.set_draw_target(ProgressDrawTarget::stderr());
        }
        bar.set_position((t / self.to * 1000.0) as u64);
        bar.set_message((self.told)(t, self.to));
    }

    /// Says how far it has come where there is no bar, if a line is due.
    fn tell(&mut self, t: f64, what: impl Fn(f64) -> String) {
        let elapsed = self.begun.elapsed();
        if self.bar.is_none() && elapsed >= self.due {
            self.due = elapsed + SPELL;
            note(&format!("{:.0} %, after {:.0} s: {}", 100.0 * t / self.to, elapsed.as_secs_f64(), what(self.to)));
        }
    }

    /// A part of the work is done, and this is being done.
    pub fn part(&mut self, part: f64, what: &str) {
        self.tell(part * self.to, |_| what.to_string());
        self.reach(part * self.to);
        if let Some(bar) = &self.bar {
            bar.set_message(what.to_string());
        }
    }

    /// The run is over.
    pub fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::short;

    #[test]
    fn numbers_are_short() {
        let cases = [
            (0.0, "0"),
            (1.0, "1"),
            (-0.25, "-0.25"),
            (123456.7, "123457"),
            (1e6, "1.00000e6"),
            (0.000123456789, "0.000123457"),
            (1.0 / 3.0, "0.333333"),
            (1e-13, "1.00000e-13"),
        ];
        cases.iter().for_each(|(x, text)| assert_eq!(short(*x), *text));
    }
}
