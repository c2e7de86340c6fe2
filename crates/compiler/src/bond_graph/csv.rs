//! Tables as text: columns of numbers, perhaps with a line of names above them.

/// The columns of a table.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Columns {
    /// Names from the first line, or none.
    pub names: Vec<String>,
    /// The columns, all of one length.
    pub columns: Vec<Vec<f64>>,
}

/// A table, and the path under which it was found.
#[derive(Debug)]
pub(super) struct Table {
    pub path: String,
    pub columns: Columns,
}

/// Why a text is no table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum CsvError {
    /// It has no line with numbers.
    Empty,
    /// A line (from 1) has another number of entries than the first.
    Ragged(usize),
    /// An entry in a line (from 1) is no number.
    NotANumber(usize, String),
}

impl std::fmt::Display for CsvError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            CsvError::Empty => f.write_str("there are no numbers in it"),
            CsvError::Ragged(line) => write!(f, "line {line} has another number of columns than the first"),
            CsvError::NotANumber(line, entry) => write!(f, "`{entry}` in line {line} is no number"),
        }
    }
}

/// Reads a table. Entries are parted by commas, semicolons, tabs or blanks; `#` begins a comment.
pub(super) fn parse(text: &str) -> Result<Columns, CsvError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let lines = text.lines().enumerate().map(|(i, l)| (i + 1, l.split('#').next().unwrap_or("").trim()));
    let mut lines = lines.filter(|(_, l)| !l.is_empty()).peekable();
    let Some((_, first)) = lines.peek() else { return Err(CsvError::Empty) };
    let names = entries(first);
    let names = if names.iter().all(|n| n.parse::<f64>().is_err()) { names } else { Vec::new() };
    let names: Vec<String> = names.iter().map(|n| n.trim_matches('"').to_string()).collect();
    if !names.is_empty() {
        lines.next();
    }
    let mut columns: Vec<Vec<f64>> = Vec::new();
    for (number, line) in lines {
        let row = entries(line);
        if columns.is_empty() {
            columns = vec![Vec::new(); row.len()];
        }
        if row.len() != columns.len() || (!names.is_empty() && row.len() != names.len()) {
            return Err(CsvError::Ragged(number));
        }
        for (column, entry) in columns.iter_mut().zip(row) {
            let value = entry.parse::<f64>().map_err(|_| CsvError::NotANumber(number, entry.to_string()))?;
            column.push(value);
        }
    }
    if columns.is_empty() { Err(CsvError::Empty) } else { Ok(Columns { names, columns }) }
}

fn entries(line: &str) -> Vec<&str> {
    let sign = [',', ';', '\t'].into_iter().find(|s| line.contains(*s));
    match sign {
        Some(sign) => line.split(sign).map(str::trim).collect(),
        None => line.split_whitespace().collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_have_names_or_not() {
        let t = parse("t, force\n0, 1\n# later\n1, 2.5\n").unwrap();
        assert_eq!((t.names, t.columns), (vec!["t".into(), "force".into()], vec![vec![0.0, 1.0], vec![1.0, 2.5]]));
        assert_eq!(parse("0 1\n1 2\n").unwrap().columns, vec![vec![0.0, 1.0], vec![1.0, 2.0]]);
        assert_eq!(parse("t;x\n1;2;3\n"), Err(CsvError::Ragged(2)));
        assert_eq!(parse("1,2\n1,x\n"), Err(CsvError::NotANumber(2, "x".into())));
        assert_eq!(parse("# nothing\n"), Err(CsvError::Empty));
    }
}
