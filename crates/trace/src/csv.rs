//! A trace as comma-separated values.

use std::borrow::Cow;
use std::io::{self, Write};
use std::ops::Range;
use std::path::Path;

use crate::{Trace, WriteError, write_whole};
use rayon::prelude::*;

/// Writes a trace as CSV: a header of `t` and the names, with `units` a line of the units of the columns, then a line for each
/// sample. Numbers have as many digits as it takes to read the same number back. The file is written whole or not at all.
///
/// # Errors
/// The file cannot be written.
pub fn write_csv(trace: &Trace, path: &Path, units: bool) -> Result<(), WriteError> {
    write_whole(path, |out| write(trace, units, out))
}

/// A trace as CSV text, as [`write_csv`] writes it.
///
/// ```
/// use halfarrow_sim::Sink;
/// let mut trace = halfarrow_trace::Trace::new([("m.p", "N.s")]);
/// trace.sample(0.1, &[1e-13]);
/// assert_eq!(halfarrow_trace::csv_text(&trace, false), "t,m.p\n0.1,1e-13\n");
/// assert_eq!(halfarrow_trace::csv_text(&trace, true), "t,m.p\ns,N.s\n0.1,1e-13\n");
/// ```
pub fn csv_text(trace: &Trace, units: bool) -> String {
    let mut text = Vec::new();
    // Writing to memory does not fail.
    let _ = write(trace, units, &mut text);
    String::from_utf8_lossy(&text).into_owned()
}

fn write(trace: &Trace, units: bool, out: &mut dyn Write) -> io::Result<()> {
    let names = std::iter::once("t").chain(trace.columns.iter().map(|column| column.name.as_str()));
    let mut table = CsvTable::new(out, names)?;
    if units {
        table.line(std::iter::once("s").chain(trace.columns.iter().map(|column| column.unit.as_str())))?;
    }
    let columns = std::iter::once(&trace.times).chain(trace.columns.iter().map(|column| &column.values));
    table.rows(&columns.map(Vec::as_slice).collect::<Vec<_>>())
}

/// Columns of numbers as CSV while they are written, some rows at a time.
pub struct CsvTable<W: Write> {
    out: W,
}

impl<W: Write> CsvTable<W> {
    /// Begins with a header of these names.
    ///
    /// # Errors
    /// Nothing can be written to `out`.
    pub fn new<'n>(out: W, names: impl IntoIterator<Item = &'n str>) -> io::Result<Self> {
        let mut table = CsvTable { out };
        table.line(names)?;
        Ok(table)
    }

    /// Adds a line of texts, such as the units of the columns.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn line<'n>(&mut self, texts: impl IntoIterator<Item = &'n str>) -> io::Result<()> {
        let texts: Vec<Cow<str>> = texts.into_iter().map(quoted).collect();
        writeln!(self.out, "{}", texts.join(","))
    }

    /// Adds rows: the values of each column, all of one length.
    ///
    /// # Errors
    /// They cannot be written.
    pub fn rows(&mut self, columns: &[&[f64]]) -> io::Result<()> {
        let rows = columns.first().map_or(0, |column| column.len());
        let at_once = AT_ONCE.div_ceil(columns.len().max(1));
        if rows <= at_once {
            return self.out.write_all(&text_of(columns, 0..rows));
        }
        let parts: Vec<Range<usize>> = (0..rows).step_by(at_once).map(|row| row..rows.min(row + at_once)).collect();
        for parts in parts.chunks(TOGETHER) {
            let texts: Vec<Vec<u8>> = parts.par_iter().map(|part| text_of(columns, part.clone())).collect();
            texts.iter().try_for_each(|text| self.out.write_all(text))?;
        }
        Ok(())
    }
}

/// So many numbers are written by one thread, and so many threads' worth of them before they leave memory.
const AT_ONCE: usize = 1 << 16;
const TOGETHER: usize = 16;

/// Some rows as text.
fn text_of(columns: &[&[f64]], rows: Range<usize>) -> Vec<u8> {
    let mut text = Vec::new();
    for row in rows {
        for (i, column) in columns.iter().enumerate() {
            let comma = if i == 0 { "" } else { "," };
            // Writing to memory does not fail.
            let _ = write!(text, "{comma}{:?}", column[row]);
        }
        text.push(b'\n');
    }
    text
}

/// A name as a field: in quotes if it holds a comma, a quote or a line break.
fn quoted(name: &str) -> Cow<'_, str> {
    match name.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", name.replace('"', "\"\"")).into(),
        false => name.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use halfarrow_sim::Sink;

    #[test]
    fn every_number_comes_back() {
        let numbers = [0.1 + 0.2, -0.0, 5e-324, 1.7976931348623157e308, 1.0 / 3.0, 123456789.0, 1e-13, 1e22];
        let mut trace = Trace::new([("max(a, b)", ""), ("say \"x\"", "")]);
        numbers.iter().for_each(|&x| trace.sample(x, &[x, -x]));
        let text = csv_text(&trace, false);
        let mut lines = text.lines();
        assert_eq!(lines.next(), Some("t,\"max(a, b)\",\"say \"\"x\"\"\""));
        for (line, x) in lines.zip(numbers) {
            let read: Vec<u64> = line.split(',').map(|field| field.parse::<f64>().unwrap().to_bits()).collect();
            assert_eq!(read, [x.to_bits(), x.to_bits(), (-x).to_bits()]);
        }
    }

    /// Many numbers are written by several threads, in their order.
    #[test]
    fn long_and_wide_tables_are_whole() {
        for (rows, columns) in [(40_000, 3), (3, 70_000), (1000, 500)] {
            let value = |row: usize, column: usize| (row * 7 + column) as f64 / 8.0;
            let all: Vec<Vec<f64>> = (0..columns).map(|c| (0..rows).map(|r| value(r, c)).collect()).collect();
            let mut text = Vec::new();
            let mut table = CsvTable::new(&mut text, ["x"]).unwrap();
            table.rows(&all.iter().map(Vec::as_slice).collect::<Vec<_>>()).unwrap();
            let text = String::from_utf8(text).unwrap();
            assert_eq!(text.lines().count(), rows + 1);
            for (row, line) in text.lines().skip(1).enumerate() {
                let fields = line.split(',').enumerate();
                assert_eq!(fields.filter(|(c, f)| f.parse() == Ok(value(row, *c))).count(), columns, "row {row}");
            }
        }
    }

    #[test]
    fn the_file_holds_the_text() {
        let folder = temp_dir::TempDir::new().unwrap();
        let path = folder.path().join("x.csv");
        let mut trace = Trace::new([("x", "m")]);
        trace.sample(0.5, &[2.0]);
        write_csv(&trace, &path, false).unwrap();
        assert_eq!(std::fs::read_to_string(path).unwrap(), "t,x\n0.5,2.0\n");
    }
}
