//! Text that fits the terminal: tables, equations, lines.

use std::collections::{BTreeMap, BTreeSet};
use std::env;
use std::io::{self, IsTerminal};

use console::Term;

use crate::arguments::PageArguments;

/// Columns without a terminal.
const USUAL: usize = 80;
/// Less is not legible.
const LEAST: usize = 40;
/// What stands alone below a row of a table is no shorter than this.
const CELL: usize = 12;

/// How wide text may be.
#[derive(Debug, Clone, Copy)]
pub struct Page {
    width: usize,
}

impl Page {
    /// As wide as asked, else as `COLUMNS` says, else as the terminal is, else 80 columns.
    pub fn of(arguments: &PageArguments) -> Page {
        let columns = || env::var("COLUMNS").ok().and_then(|c| c.trim().parse::<usize>().ok()).filter(|&c| c > 0);
        Page { width: arguments.width.or_else(columns).or_else(terminal).unwrap_or(USUAL).max(LEAST) }
    }

    /// As wide as pages are where nobody says.
    pub fn usual() -> Page {
        Page { width: USUAL }
    }

    /// Lines, each folded where it is too long.
    pub fn lines(self, text: &str) -> String {
        text.lines().map(|line| self.line(line)).collect()
    }

    /// A line of words or an equation, folded where it is too long; what follows is indented. Lines of tables stay.
    pub fn line(self, line: &str) -> String {
        match line.starts_with(['┌', '│', '╞', '└']) {
            true => format!("{line}\n"),
            false => fold(line, self.width).join("\n") + "\n",
        }
    }

    /// A table with a header. Where it is too wide, long cells move below their rows; where that does not help, columns go
    /// into a table of their own, beside the first.
    pub fn table<const N: usize>(self, header: [&str; N], rows: impl IntoIterator<Item = [String; N]>) -> String {
        let header = header.map(str::to_string).to_vec();
        self.wide_table(header, rows.into_iter().map(|row| row.to_vec()))
    }

    /// The same with cells of at most so many lines below their rows: what is longer ends with `…`.
    pub fn brief_table<const N: usize>(
        self,
        header: [&str; N],
        rows: impl IntoIterator<Item = [String; N]>,
        lines: usize,
    ) -> String {
        let header = header.map(str::to_string).to_vec();
        let rows = rows.into_iter().map(|row| Row::of(row.to_vec())).collect();
        Table { header, rows, lines }.fitting(self.width).iter().map(Table::text).collect()
    }

    /// A table with as many columns as its header; see [`Page::table`].
    pub fn wide_table(self, header: Vec<String>, rows: impl IntoIterator<Item = Vec<String>>) -> String {
        let table = Table { header, rows: rows.into_iter().map(Row::of).collect(), lines: usize::MAX };
        table.fitting(self.width).iter().map(Table::text).collect()
    }

    /// How many columns it has.
    pub fn columns(self) -> usize {
        self.width
    }

    /// Characters on so many lines.
    pub fn room(self, lines: usize) -> usize {
        self.width.saturating_mul(lines)
    }

    /// A line as [`Page::line`] has it, on at most so many lines: what is longer ends with `…`.
    pub fn brief_line(self, line: &str, lines: usize) -> String {
        cut(fold_whole(line, self.width), lines, self.width).join("\n") + "\n"
    }
}

/// The columns of the terminal that text goes to.
fn terminal() -> Option<usize> {
    let terminal = io::stdout().is_terminal().then(Term::stdout);
    terminal.and_then(|terminal| terminal.size_checked()).map(|(_, columns)| usize::from(columns))
}

/// A row: its cells, and lines below it.
#[derive(Debug, Clone)]
struct Row {
    cells: Vec<String>,
    below: Vec<String>,
}

impl Row {
    fn of(cells: Vec<String>) -> Row {
        Row { cells, below: Vec::new() }
    }

    /// The same row with some cells, with or without what stands below.
    fn with(&self, cells: Vec<String>, below: bool) -> Row {
        Row { cells, below: if below { self.below.clone() } else { Vec::new() } }
    }
}

#[derive(Debug, Clone)]
struct Table {
    header: Vec<String>,
    rows: Vec<Row>,
    /// Lines that a cell takes at most below its row.
    lines: usize,
}

impl Table {
    /// The widths of the columns.
    fn widths(&self) -> Vec<usize> {
        let widest = |column: usize| {
            let cells = self.rows.iter().map(|row| width(&row.cells[column]));
            cells.max().unwrap_or(0).max(width(&self.header[column]))
        };
        (0..self.header.len()).map(widest).collect()
    }

    fn width(&self) -> usize {
        self.widths().iter().map(|w| w + 3).sum::<usize>() + 1
    }

    /// The width without some columns.
    fn width_without(&self, columns: &BTreeSet<usize>) -> usize {
        let widths = self.widths().into_iter().enumerate().filter(|(column, _)| !columns.contains(column));
        widths.map(|(_, w)| w + 3).sum::<usize>() + 1
    }

    /// The same in one table or several that are not wider than this, where that goes.
    fn fitting(mut self, most: usize) -> Vec<Table> {
        let mut moved: BTreeMap<usize, Vec<String>> = BTreeMap::new();
        while self.width() > most {
            let widths = self.widths();
            let longer = |&column: &usize| widths[column] > width(&self.header[column]).max(CELL);
            let Some(column) = (1..widths.len()).filter(longer).max_by_key(|&c| (widths[c], c)) else { break };
            moved.insert(column, self.take(column));
        }
        // Where that is not enough, the short cells of these columns follow.
        let mut emptied: BTreeSet<usize> = BTreeSet::new();
        while self.width_without(&emptied) > most {
            let widths = self.widths();
            let left = moved.keys().copied().filter(|column| !emptied.contains(column));
            let Some(column) = left.max_by_key(|&c| (widths[c], c)) else { break };
            emptied.insert(column);
            for (row, cell) in self.rows.iter_mut().zip(moved.get_mut(&column).expect("it was moved")) {
                if cell.is_empty() {
                    *cell = std::mem::take(&mut row.cells[column]);
                }
            }
        }
        let own = self.width_without(&emptied);
        let parted = own > most && self.header.len() - emptied.len() > 2;
        let room = if parted { most } else { own.max(most.min(USUAL)) } - 4;
        for (column, cells) in moved {
            let label = self.header[column].clone();
            for (row, cell) in self.rows.iter_mut().zip(cells).filter(|(_, cell)| !cell.is_empty()) {
                let label = if label.is_empty() { String::new() } else { format!("{label}: ") };
                row.below.extend(cut(fold_whole(&format!("  {label}{cell}"), room), self.lines, room));
            }
        }
        for &column in emptied.iter().rev() {
            self.remove(column);
        }
        let table = self.without_empty_columns();
        if parted { table.in_parts(most) } else { vec![table] }
    }

    /// Takes the long cells out of a column.
    fn take(&mut self, column: usize) -> Vec<String> {
        let longest = width(&self.header[column]).max(CELL);
        let take = |row: &mut Row| match width(&row.cells[column]) > longest {
            true => std::mem::take(&mut row.cells[column]),
            false => String::new(),
        };
        self.rows.iter_mut().map(take).collect()
    }

    /// Without the columns whose cells all stand below their rows.
    fn without_empty_columns(mut self) -> Table {
        for column in (1..self.header.len()).rev() {
            let empty = self.rows.iter().all(|row| row.cells[column].is_empty());
            if empty && self.rows.iter().any(|row| !row.below.is_empty()) {
                self.remove(column);
            }
        }
        self
    }

    fn remove(&mut self, column: usize) {
        self.header.remove(column);
        self.rows.iter_mut().for_each(|row| _ = row.cells.remove(column));
    }

    /// Columns in tables of their own, each with the first column.
    fn in_parts(&self, most: usize) -> Vec<Table> {
        let widths = self.widths();
        let mut parts: Vec<Vec<usize>> = Vec::new();
        let mut used = usize::MAX;
        for column in 1..widths.len() {
            if used.saturating_add(widths[column] + 3) > most {
                parts.push(vec![0]);
                used = widths[0] + 4;
            }
            parts.last_mut().expect("a part").push(column);
            used += widths[column] + 3;
        }
        let pick = |cells: &[String], columns: &[usize]| columns.iter().map(|&c| cells[c].clone()).collect();
        // What stands below its row stands in the first of them.
        let part = |(at, columns): (usize, &Vec<usize>)| Table {
            header: pick(&self.header, columns),
            rows: self.rows.iter().map(|row| row.with(pick(&row.cells, columns), at == 0)).collect(),
            lines: self.lines,
        };
        parts.iter().enumerate().map(part).collect()
    }

    fn text(&self) -> String {
        let mut widths = self.widths();
        let below = self.rows.iter().flat_map(|row| &row.below).map(|line| width(line) + 4).max().unwrap_or(0);
        let missing = below.saturating_sub(self.width());
        *widths.last_mut().expect("a column") += missing;
        let border = |left: char, line: char, between: char, right: char| {
            let parts: Vec<String> = widths.iter().map(|w| line.to_string().repeat(w + 2)).collect();
            format!("{left}{}{right}\n", parts.join(&between.to_string()))
        };
        let row = |cells: &[String]| {
            let cells = cells.iter().zip(&widths).map(|(cell, &w)| format!(" {cell}{} ", " ".repeat(w - width(cell))));
            format!("│{}│\n", cells.collect::<Vec<_>>().join("┆"))
        };
        let mut text = border('┌', '─', '┬', '┐') + &row(&self.header) + &border('╞', '═', '╪', '╡');
        let room = widths.iter().map(|w| w + 3).sum::<usize>() - 3;
        for r in &self.rows {
            text += &row(&r.cells);
            for line in &r.below {
                text += &format!("│ {line}{} │\n", " ".repeat(room - width(line)));
            }
        }
        text + &border('└', '─', '┴', '┘')
    }
}

/// Columns that a text takes.
fn width(text: &str) -> usize {
    text.chars().count()
}

/// A line in pieces that are not longer than this, where that goes: broken before operators, outside brackets rather than
/// inside. What follows is indented, the further the deeper in brackets it stands.
pub fn fold(line: &str, most: usize) -> Vec<String> {
    let own = line.len() - line.trim_start().len();
    let mut pieces = Vec::new();
    let mut rest: Vec<char> = line.chars().collect();
    let mut depth = 0;
    let mut indent = 0;
    while indent + rest.len() > most {
        let Some((at, inside)) = best_break(&rest, most.saturating_sub(indent)) else { break };
        let tail: Vec<char> = rest.split_off(at);
        pieces.push(" ".repeat(indent) + rest.iter().collect::<String>().trim_end());
        rest = tail.into_iter().skip_while(|c| *c == ' ').collect();
        depth += inside;
        indent = own + 4 + 2 * usize::try_from(depth).unwrap_or(0).min(6);
    }
    pieces.push(" ".repeat(indent) + rest.iter().collect::<String>().trim_end());
    pieces
}

/// As [`fold`], with nothing longer: what has no place to break is broken anywhere.
fn fold_whole(line: &str, most: usize) -> Vec<String> {
    let chunks = |piece: String| {
        let letters: Vec<char> = piece.chars().collect();
        letters.chunks(most.max(1)).map(|chunk| chunk.iter().collect()).collect::<Vec<String>>()
    };
    fold(line, most).into_iter().flat_map(chunks).collect()
}

/// The first pieces, the last ending with `…` if there are more.
fn cut(mut pieces: Vec<String>, lines: usize, most: usize) -> Vec<String> {
    if pieces.len() > lines {
        pieces.truncate(lines);
        if let Some(last) = pieces.last_mut() {
            *last = format!("{}…", last.chars().take(most.saturating_sub(1)).collect::<String>().trim_end());
        }
    }
    pieces
}

/// What makes a place to break worse: beyond the width, in the first third, in brackets, at a product, farther left.
type Merit = (bool, bool, isize, u8, std::cmp::Reverse<usize>);

/// Where to break, and how many brackets are open there: the least of them first, a sum before a product, and as far on
/// the right as goes, but not in the first third if there is another place.
fn best_break(text: &[char], most: usize) -> Option<(usize, isize)> {
    let start = text.iter().take_while(|c| **c == ' ').count();
    let mut depth = 0isize;
    let mut best: Option<(Merit, usize, isize)> = None;
    for (at, &c) in text.iter().enumerate() {
        if at > most && best.is_some_and(|b| !b.0.0) {
            break;
        }
        match c {
            '(' | '[' => depth += 1,
            ')' | ']' => depth -= 1,
            ' ' if at > start => {
                let kind = match text.get(at + 1) {
                    Some('=') => 0,
                    Some('+' | '-') if text.get(at + 2) == Some(&' ') => 0,
                    _ if text[at - 1] == ',' => 0,
                    _ if after_operator(&text[..at]) || after_function(&text[..at]) => continue,
                    _ => 1,
                };
                let key = (at > most, 3 * at < most, depth, kind, std::cmp::Reverse(at));
                if best.is_none_or(|b| key < b.0) {
                    best = Some((key, at, depth));
                }
            }
            _ => {}
        }
    }
    best.map(|b| (b.1, b.2))
}

/// Whether the text ends in an operator, to which what follows belongs.
fn after_operator(text: &[char]) -> bool {
    matches!(text, [.., ' ', '+' | '-' | '='] | ['+' | '-' | '='])
}

/// Whether the text ends in the name of a function without brackets: `sin φ`.
fn after_function(text: &[char]) -> bool {
    let word: String =
        text.iter().rev().take_while(|c| c.is_alphabetic()).collect::<Vec<_>>().into_iter().rev().collect();
    ["sin", "cos", "tan", "sinh", "cosh", "tanh", "ln"].contains(&word.as_str())
}

#[cfg(test)]
mod tests {
    use super::{Page, Row, Table, fold, width};

    fn table(rows: &[[&str; 4]]) -> Table {
        let header = ["class", "between", "gain", "value"].map(str::to_string).to_vec();
        Table {
            header,
            rows: rows.iter().map(|row| Row::of(row.map(str::to_string).to_vec())).collect(),
            lines: usize::MAX,
        }
    }

    #[test]
    fn lines_break_at_operators_outside_brackets() {
        let line = "(a + b) x' = -(c + d + e) y - (f + g) (h + i) z + k";
        assert_eq!(fold(line, 60), [line]);
        let folded = ["(a + b) x' = -(c + d + e) y", "    - (f + g) (h + i) z + k"];
        assert_eq!(fold(line, 40), folded);
        assert_eq!(fold("    a = b cos φ + c sin φ", 18), ["    a = b cos φ", "        + c sin φ"]);
        let long = "x = ".to_string() + &"v".repeat(90);
        assert_eq!(fold(&long, 40).len(), 2, "what has no operator stays whole");
    }

    #[test]
    fn nothing_is_lost_and_nothing_is_too_long() {
        let terms: Vec<String> = (0..60).map(|i| format!("k{i} (x{i} - x{} cos φ{i})/(a{i} + b)", i + 1)).collect();
        let line = format!("m x'' = {}", terms.join(" - "));
        let squeezed = |text: &str| text.chars().filter(|c| *c != ' ').collect::<String>();
        for most in [40, 60, 80, 120] {
            let folded = fold(&line, most);
            assert!(folded.iter().all(|piece| width(piece) <= most), "{most}");
            assert_eq!(squeezed(&folded.concat()), squeezed(&line));
        }
    }

    #[test]
    fn long_cells_move_below_their_rows() {
        let gain = "-(a + b)/(c + d) - (e + f)/(g + h) - (i + j)/(k + l)";
        let fits = table(&[["2", "R1 - R2", "-R1/R2", "-0.6"]]).fitting(80);
        assert_eq!(fits[0].text().lines().count(), 5);
        let text = table(&[["2", "R1 - R2", gain, "-0.6"]]).fitting(60)[0].text();
        assert!(text.lines().all(|line| width(line) <= 60), "{text}");
        assert!(text.contains("gain: -(a + b)/(c + d)") && !text.contains("┆ gain"), "{text}");
        let name = "machine.platform.inertia.x - machine.platform.mass.y";
        let rows = [["1", name, gain, "-0.6"], ["1", "a - b", "-1", "-0.123456789012"]];
        let parts = table(&rows).fitting(40);
        let text: String = parts.iter().map(Table::text).collect();
        assert!(text.lines().all(|line| width(line) <= 40), "{text}");
        let told = ["platform.mass.y", "┆ a - b", "┆ -1", "-0.6", "value: -0.123456789012", "(k + l)"];
        assert!(told.iter().all(|told| text.contains(told)), "{text}");
        let long = "member".repeat(3);
        let rows: Vec<[&str; 4]> = (0..3).map(|_| ["1", long.as_str(), "x", long.as_str()]).collect();
        let parts = table(&rows).fitting(30);
        assert!(parts.iter().all(|part| part.width() <= 30), "{parts:?}");
    }

    #[test]
    fn brief_tables_and_lines_are_cut() {
        let page = Page { width: 60 };
        let gain: Vec<String> = (0..500).map(|i| format!("k{i}*x{i}")).collect();
        let long = [gain.join(" + "), "v".repeat(700)];
        for cell in long {
            let text = page.brief_table(["class", "gain"], [["2".to_string(), cell.clone()]], 4);
            assert!(text.lines().all(|line| width(line) <= 60), "{text}");
            assert!(text.lines().count() == 9 && text.contains('…'), "{text}");
            let line = page.brief_line(&cell, 2);
            assert!(line.lines().count() == 2 && line.ends_with("…\n"), "{line}");
        }
        assert_eq!(page.brief_line("a = b", 2), "a = b\n");
    }
}
