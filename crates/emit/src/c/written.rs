//! C as it is written: text with a note of what it reads and which functions it calls.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::fmt::{self, Display};

/// Which numbers of a function a temporary belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Series {
    /// A value, by number of the local.
    Value(u32),
    /// The derivative of one.
    Rate(u32),
    /// What a value, or its derivative, was in the turn before.
    Before(u32),
    RateBefore(u32),
    /// An elimination that is written out.
    Elimination,
}

impl Display for Series {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Series::Value(i) => write!(f, "v{i}"),
            Series::Rate(i) => write!(f, "d{i}"),
            Series::Before(i) => write!(f, "b{i}"),
            Series::RateBefore(i) => write!(f, "r{i}"),
            Series::Elimination => f.write_str("e"),
        }
    }
}

/// A variable of a function in C.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Variable {
    /// What a call that may fail gives.
    Status,
    /// The turn of a loop.
    Turn,
    /// A value or a derivative.
    Number(Series),
    /// One of the temporaries on the way to it: letters and number tell them apart.
    Part(Series, &'static str, u32),
    /// An array: of which kind, and of which step.
    Array(&'static str, usize),
}

impl Display for Variable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Variable::Status => f.write_str("status"),
            Variable::Turn => f.write_str("k"),
            Variable::Number(series) => write!(f, "{series}"),
            Variable::Part(series, kind, at) => write!(f, "{series}_{kind}{at}"),
            Variable::Array(kind, step) => write!(f, "{kind}{step}"),
        }
    }
}

/// The name of a fragment: of a function, a table or a macro of the file.
pub(crate) type FragmentName = Cow<'static, str>;

/// What a piece of C reads and calls.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Notes {
    pub reads: Vec<Variable>,
    pub needs: BTreeSet<FragmentName>,
}

/// What can stand in a piece of C.
pub(super) trait Part: Display {
    /// Notes what it reads and calls.
    fn note(&self, _: &mut Notes) {}
}

impl Part for str {}
impl Part for String {}
impl Part for usize {}
impl Part for u32 {}
impl Part for u64 {}
impl<P: Part + ?Sized> Part for &P {
    fn note(&self, notes: &mut Notes) {
        (**self).note(notes);
    }
}
impl Part for Variable {
    fn note(&self, notes: &mut Notes) {
        notes.reads.push(*self);
    }
}

/// A function or table of the file, where it is called or read.
#[derive(Debug, Clone)]
pub(super) struct Needed(pub FragmentName);

impl Display for Needed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl Part for Needed {
    fn note(&self, notes: &mut Notes) {
        notes.needs.insert(self.0.clone());
    }
}

/// One that is always called the same.
pub(super) fn needed(name: &'static str) -> Needed {
    Needed(Cow::Borrowed(name))
}

/// How closely the parts of an expression hang together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Binds {
    Choice,
    Sum,
    Product,
    Sign,
    Whole,
}

/// A piece of C.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Written {
    pub text: String,
    pub notes: Notes,
    pub binds: Binds,
}

impl Display for Written {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl Part for Written {
    fn note(&self, notes: &mut Notes) {
        notes.reads.extend(&self.notes.reads);
        notes.needs.extend(self.notes.needs.iter().cloned());
    }
}

impl Written {
    /// What needs no brackets, and reads nothing of the function that it stands in.
    pub fn of(text: impl Into<String>) -> Written {
        Written { text: text.into(), notes: Notes::default(), binds: Binds::Whole }
    }

    /// The same as one that hangs together so.
    pub fn binding(self, binds: Binds) -> Written {
        Written { binds, ..self }
    }

    /// In brackets unless it hangs together as closely.
    pub fn beside(&self, least: Binds) -> Written {
        match self.binds >= least {
            true => self.clone(),
            false => Written { text: format!("({})", self.text), notes: self.notes.clone(), binds: Binds::Whole },
        }
    }

    /// Several with commas between them.
    pub fn list(all: &[Written]) -> Written {
        let mut list = Written::of("");
        for (i, one) in all.iter().enumerate() {
            list.text += if i == 0 { "" } else { ", " };
            list.text += &one.text;
            one.note(&mut list.notes);
        }
        list
    }
}

/// A piece of C by a format and its parts, of which it notes what they read and call.
macro_rules! written {
    ($format:literal $(, $part:expr)* $(,)?) => {{
        #[allow(unused_mut)]
        let mut notes = $crate::c::written::Notes::default();
        $($crate::c::written::Part::note(&$part, &mut notes);)*
        $crate::c::written::Written {
            text: format!($format $(, $part)*),
            notes,
            binds: $crate::c::written::Binds::Whole,
        }
    }};
}
pub(super) use written;

/// A line, or several that belong together, of a function.
#[derive(Debug, Clone)]
pub(super) struct Line {
    pub written: Written,
    /// The variable that it declares or sets, and does nothing else.
    pub declares: Option<Variable>,
    /// How many numbers it takes of the stack.
    pub numbers: usize,
}

impl Line {
    /// One that does something, and declares so many numbers.
    pub fn new(written: Written, numbers: usize) -> Line {
        Line { written, declares: None, numbers }
    }

    /// One that declares a constant of so many numbers.
    pub fn constant(variable: Variable, written: Written, numbers: usize) -> Line {
        Line { written, declares: Some(variable), numbers }
    }
}

/// The lines without those that only set what no line reads that stays; what a turn of a loop leaves to the next one is read
/// by lines before.
pub(super) fn without_the_unread(lines: Vec<Line>) -> Vec<Line> {
    let mut left_to_turns = rustc_hash::FxHashSet::default();
    loop {
        let mut read = rustc_hash::FxHashSet::default();
        let mut stays = vec![true; lines.len()];
        for (line, stays) in lines.iter().zip(&mut stays).rev() {
            *stays = line.declares.is_none_or(|variable| read.contains(&variable) || left_to_turns.contains(&variable));
            if *stays {
                read.extend(line.written.notes.reads.iter().copied());
            }
        }
        let gone = lines.iter().zip(&stays).filter(|(_, stays)| !**stays).filter_map(|(line, _)| line.declares);
        let known = left_to_turns.len();
        left_to_turns.extend(gone.filter(|variable| read.contains(variable)));
        if left_to_turns.len() == known {
            let mut stays = stays.into_iter();
            return lines.into_iter().filter(|_| stays.next() == Some(true)).collect();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_notes_what_it_reads_and_calls() {
        let [a, b, c] = [1, 2, 3].map(|i| Variable::Number(Series::Value(i)));
        let declare = |v: Variable, value: Written| Line::constant(v, written!("const double {} = {};", v, value), 1);
        let sum = written!("{} + {}", a, b).binding(Binds::Sum);
        assert_eq!(sum.beside(Binds::Product).text, "(v1 + v2)");
        let call = written!("{}({})", needed("ha_exp"), sum);
        assert_eq!(call.notes.needs, BTreeSet::from(["ha_exp".into()]));
        let lines = vec![
            declare(a, Written::of("x[0]")),
            declare(b, Written::of("x[1]")),
            declare(c, written!("{}", b)),
            Line::new(written!("out[0] = {};", a), 0),
        ];
        let kept: Vec<String> = without_the_unread(lines).into_iter().map(|l| l.written.text).collect();
        assert_eq!(kept, ["const double v1 = x[0];", "out[0] = v1;"]);
    }

    #[test]
    fn what_a_turn_leaves_to_the_next_one_stays_if_that_reads_it() {
        let [v, w] = [1, 2].map(|i| Variable::Number(Series::Value(i)));
        let [b, c] = [1, 2].map(|i| Variable::Number(Series::Before(i)));
        let set = |to: Variable, from: Variable| Line::constant(to, written!("{} = {};", to.to_string(), from), 0);
        // w goes round in a circle, out of which nothing comes.
        let lines = vec![
            Line::constant(b, Written::of("b1 = 0;"), 1),
            Line::constant(c, Written::of("b2 = 0;"), 1),
            Line::constant(v, written!("v1 = {};", b), 1),
            Line::constant(w, written!("v2 = {} + {};", c, v), 1),
            Line::new(written!("out = {};", v), 0),
            set(b, v),
            set(c, w),
        ];
        let kept: Vec<String> = without_the_unread(lines).into_iter().map(|l| l.written.text).collect();
        assert_eq!(kept, ["b1 = 0;", "v1 = b1;", "out = v1;", "b1 = v1;"]);
    }
}
