//! Signals read from CSV.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

use halfarrow_sim::{Signal, SignalError};

/// Faults reported of one file; more say nothing new.
const MOST_ERRORS: usize = 10;

/// What is wrong with an input file. `line` counts from 1, the header included.
#[derive(Clone, Debug, PartialEq)]
pub enum InputError {
    /// The file cannot be read.
    Unreadable {
        /// What the system says.
        reason: String,
    },
    /// There is no header, no column beside the time, or no sample.
    Empty,
    /// The first column is not the time.
    NoTime {
        /// What it is called.
        found: String,
    },
    /// The header seems to be separated by something else than commas.
    Separator {
        /// By what.
        found: char,
    },
    /// Two columns have the same name.
    Double {
        /// The name.
        name: String,
    },
    /// A line has more or fewer fields than the header.
    Fields {
        /// Where.
        line: u64,
        /// Fields of the header.
        expected: usize,
        /// Fields of the line.
        found: usize,
    },
    /// A field is not a finite number.
    Number {
        /// Where.
        line: u64,
        /// Name of the column.
        column: String,
        /// What stands there.
        found: String,
    },
    /// Time runs backwards.
    Backwards {
        /// Where.
        line: u64,
        /// The time there, in s.
        time: f64,
        /// The time of the sample before, in s.
        before: f64,
    },
    /// There are more faults of single fields and lines.
    More {
        /// How many.
        count: usize,
    },
    /// More than two samples stand at the same time.
    Crowded {
        /// Where the third one stands.
        line: u64,
        /// Their time, in s.
        time: f64,
    },
}

/// The signals of a CSV file.
#[derive(Clone, Debug, PartialEq)]
pub struct InputTable {
    /// The unit of the times, if the file says one; else they are in s. The times of the signals are as they stand there.
    pub time_unit: Option<String>,
    /// The columns beside the time, by name.
    pub columns: BTreeMap<String, InputColumn>,
}

/// A signal of a CSV file.
#[derive(Clone, Debug, PartialEq)]
pub struct InputColumn {
    /// Its points.
    pub signal: Signal,
    /// Its unit, if the file says one.
    pub unit: Option<String>,
}

/// Reads the signals of a CSV file. See [`parse_inputs`].
///
/// # Errors
/// All faults found, in the order of their lines.
pub fn read_inputs(path: &Path) -> Result<InputTable, Vec<InputError>> {
    let text = std::fs::read_to_string(path);
    parse_inputs(&text.map_err(|error| vec![InputError::Unreadable { reason: error.to_string() }])?)
}

/// The signals of a CSV text, by name: a header of `t` and the names, if wanted a line of units, then a line for each
/// sample, times ascending, in s unless there is a unit. Signals are straight between samples; two samples at the same time
/// make a jump. Empty lines and lines that start with `#` are skipped.
///
/// ```
/// let table = halfarrow_trace::parse_inputs("t,road\ns,mm\n0,0\n1,0.2\n1,0\n").unwrap();
/// let road = &table.columns["road"];
/// assert_eq!(road.signal.next_corner(0.0), Some(1.0));
/// assert_eq!(road.unit.as_deref(), Some("mm"));
/// ```
///
/// # Errors
/// The first faults found, in the order of their lines, and how many more there are.
pub fn parse_inputs(text: &str) -> Result<InputTable, Vec<InputError>> {
    let text = text.trim_start_matches('\u{feff}');
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let mut records = reader.records().map_while(Result::ok).peekable();
    let header: Vec<String> = records.next().iter().flatten().map(str::to_owned).collect();
    check_header(&header).map_err(|error| vec![error])?;
    let units = records.next_if(|record| are_units(&header, record));
    let mut table = Table { lines: vec![], columns: vec![vec![]; header.len()] };
    let mut errors = Vec::new();
    let mut more = 0;
    for record in records {
        errors.extend(table.add(&header, &record));
        more += errors.len().saturating_sub(MOST_ERRORS);
        errors.truncate(MOST_ERRORS);
    }
    if errors.is_empty() {
        return table.signals(&header, units.as_ref());
    }
    errors.extend((more > 0).then_some(InputError::More { count: more }));
    Err(errors)
}

/// Whether the line below the header has a unit for the time, and no number.
fn are_units(header: &[String], record: &csv::StringRecord) -> bool {
    let no_number = |field: &str| field.parse::<f64>().is_err();
    record.len() == header.len() && record.get(0).is_some_and(|time| !time.is_empty()) && record.iter().all(no_number)
}

fn check_header(header: &[String]) -> Result<(), InputError> {
    let first = header.first().ok_or(InputError::Empty)?;
    if let Some(found) = first.chars().find(|c| [';', '\t', ' '].contains(c)).filter(|_| header.len() == 1) {
        return Err(InputError::Separator { found });
    }
    if first != "t" {
        return Err(InputError::NoTime { found: first.clone() });
    }
    if header.len() == 1 {
        return Err(InputError::Empty);
    }
    match header.iter().enumerate().find(|(i, name)| header[..*i].contains(name)) {
        Some((_, name)) => Err(InputError::Double { name: name.clone() }),
        None => Ok(()),
    }
}

/// What was read so far.
struct Table {
    /// Where each sample stands.
    lines: Vec<u64>,
    /// The time first.
    columns: Vec<Vec<f64>>,
}

impl Table {
    /// Adds a line, or says what is wrong with it.
    fn add(&mut self, header: &[String], record: &csv::StringRecord) -> Vec<InputError> {
        let line = record.position().map_or(0, csv::Position::line);
        if record.len() != header.len() {
            return vec![InputError::Fields { line, expected: header.len(), found: record.len() }];
        }
        let mut errors = vec![];
        for ((name, field), column) in header.iter().zip(record).zip(&mut self.columns) {
            match field.parse::<f64>() {
                Ok(number) if number.is_finite() => column.push(number),
                _ => {
                    errors.push(InputError::Number { line, column: name.clone(), found: field.to_owned() });
                    column.push(0.0);
                }
            }
        }
        self.lines.push(line);
        errors
    }

    fn signals(self, header: &[String], units: Option<&csv::StringRecord>) -> Result<InputTable, Vec<InputError>> {
        let (times, columns) = self.columns.split_first().ok_or(vec![InputError::Empty])?;
        let unit = |i: usize| units.and_then(|u| u.get(i)).filter(|unit| !unit.is_empty()).map(str::to_owned);
        let mut table = InputTable { time_unit: unit(0), columns: BTreeMap::new() };
        for (i, (name, values)) in header[1..].iter().zip(columns).enumerate() {
            let signal = Signal::new(times.clone(), values.clone());
            let signal = signal.map_err(|error| vec![located(error, &self.lines, times)])?;
            table.columns.insert(name.clone(), InputColumn { signal, unit: unit(i + 1) });
        }
        Ok(table)
    }
}

/// The fault of a signal at its line.
fn located(error: SignalError, lines: &[u64], times: &[f64]) -> InputError {
    match error {
        SignalError::Backwards { sample } => {
            InputError::Backwards { line: lines[sample], time: times[sample], before: times[sample - 1] }
        }
        SignalError::Crowded { sample } => InputError::Crowded { line: lines[sample], time: times[sample] },
        SignalError::Length { .. } | SignalError::NotFinite { .. } => InputError::Empty,
    }
}

impl InputError {
    /// The line it stands at, from 1; `None` if it concerns the file as a whole.
    pub fn line(&self) -> Option<u64> {
        match self {
            InputError::Fields { line, .. }
            | InputError::Number { line, .. }
            | InputError::Backwards { line, .. }
            | InputError::Crowded { line, .. } => Some(*line),
            InputError::NoTime { .. } | InputError::Separator { .. } | InputError::Double { .. } => Some(1),
            InputError::Unreadable { .. } | InputError::Empty | InputError::More { .. } => None,
        }
    }
}

impl fmt::Display for InputError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(line) = self.line() {
            write!(f, "line {line}: ")?;
        }
        match self {
            InputError::Unreadable { reason } => write!(f, "the file cannot be read: {reason}"),
            InputError::Empty => {
                write!(
                    f,
                    "there is no signal: the header has to name t and at least one signal, and a sample has to follow"
                )
            }
            InputError::NoTime { found } => {
                write!(f, "the first column is '{found}': put the time there and call it t")
            }
            InputError::Separator { found } => {
                write!(f, "the columns are separated by {found:?}: use commas, and points in numbers")
            }
            InputError::Double { name } => write!(f, "two columns are called '{name}': rename one"),
            InputError::Fields { expected, found, .. } => {
                write!(f, "{found} fields where the header has {expected}: give each column one number")
            }
            InputError::Number { column, found, .. } => {
                write!(
                    f,
                    "'{found}' in column '{column}' is not a finite number: write it like 0.2 or 1e-3, without a unit"
                )
            }
            InputError::Backwards { time, before, .. } => {
                write!(f, "the time goes back from {before} s to {time} s: sort the lines by time")
            }
            InputError::More { count } => write!(f, "and {count} more faults of this kind"),
            InputError::Crowded { time, .. } => {
                write!(f, "a third sample at {time} s: a jump takes two, the value before and the value after")
            }
        }
    }
}

impl std::error::Error for InputError {}

#[cfg(test)]
mod tests {
    use super::*;

    fn messages(text: &str) -> Vec<String> {
        parse_inputs(text).unwrap_err().iter().map(InputError::to_string).collect()
    }

    #[test]
    fn reads_signals_by_name() {
        let signals =
            parse_inputs("\u{feff}t, road ,\"a,b\"\r\n# measured\r\n0,0,1\r\n\r\n0.5,2e-1,3\r\n").unwrap().columns;
        assert_eq!(signals.keys().collect::<Vec<_>>(), ["a,b", "road"]);
        let road = &signals["road"].signal;
        assert_eq!(road.value(road.piece(0.0), 0.25), 0.1);
    }

    #[test]
    fn says_what_is_wrong_and_where() {
        assert_eq!(
            messages("t,u\n0,zero\n1\n2,nan\n"),
            [
                "line 2: 'zero' in column 'u' is not a finite number: write it like 0.2 or 1e-3, without a unit",
                "line 3: 1 fields where the header has 2: give each column one number",
                "line 4: 'nan' in column 'u' is not a finite number: write it like 0.2 or 1e-3, without a unit",
            ]
        );
        assert_eq!(
            messages("t,u\n0,0\n\n2,0\n1,0\n"),
            ["line 5: the time goes back from 2 s to 1 s: sort the lines by time"]
        );
        assert_eq!(
            messages("t,u\n1,0\n1,1\n1,2\n"),
            ["line 4: a third sample at 1 s: a jump takes two, the value before and the value after"]
        );
        assert_eq!(messages("time,u\n0,0\n"), ["line 1: the first column is 'time': put the time there and call it t"]);
        assert_eq!(
            messages("t;u\n0;0\n"),
            ["line 1: the columns are separated by ';': use commas, and points in numbers"]
        );
        assert_eq!(messages("t,u,u\n0,0,0\n"), ["line 1: two columns are called 'u': rename one"]);
        let nothing =
            "there is no signal: the header has to name t and at least one signal, and a sample has to follow";
        ["", "t\n0\n", "t,u\n"].iter().for_each(|text| assert_eq!(messages(text), [nothing]));
        assert!(messages(&format!("t,u\n0,0\n{}", "x,y\n".repeat(100))).len() == 11);
        assert_eq!(messages(&format!("t,u\n0,0\n{}", "x,y\n".repeat(100)))[10], "and 190 more faults of this kind");
        assert!(read_inputs(Path::new("/no/such/file.csv")).is_err());
    }

    #[test]
    fn the_same_signal_comes_back() {
        use halfarrow_sim::Sink;
        let mut trace = crate::Trace::new([("u", "V")]);
        [(0.0, 0.1), (1.0, 0.3), (1.0, -2.0), (4.0, 1e-9)].iter().for_each(|&(t, u)| trace.sample(t, &[u]));
        let signal = Signal::new(trace.times.clone(), trace.columns[0].values.clone()).unwrap();
        let plain = parse_inputs(&crate::csv_text(&trace, false)).unwrap();
        assert_eq!((&plain.columns["u"].signal, &plain.columns["u"].unit, plain.time_unit), (&signal, &None, None));
        let table = parse_inputs(&crate::csv_text(&trace, true)).unwrap();
        assert_eq!((&table.columns["u"].signal, table.columns["u"].unit.as_deref()), (&signal, Some("V")));
        assert_eq!(table.time_unit.as_deref(), Some("s"));
    }
}
