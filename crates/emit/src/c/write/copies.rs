//! What is wanted as it stands: copies, as loops where many follow each other.

use std::ops::Range;

use halfarrow_compiler::program::Repetition;

use super::{Body, Place, Spot, Writer};

/// A copy from one place, which may be in double precision, to another.
pub(super) struct Copied {
    pub to: Place,
    pub from: (Spot, bool),
}

/// Copies, with those that follow each other.
pub(super) struct Runs {
    all: Vec<Copied>,
    runs: Vec<Range<usize>>,
}

impl Runs {
    pub fn of(all: Vec<Copied>) -> Runs {
        let (mut runs, mut first) = (Vec::new(), 0);
        while first < all.len() {
            let end = (first + 1..all.len()).find(|&at| !follows(&all[first..=at])).unwrap_or(all.len());
            if (Repetition { first, length: 1, turns: end - first }).pays() {
                runs.push(first..end);
            }
            first = end;
        }
        Runs { all, runs }
    }
}

/// Whether the last of some copies goes on with what those before it do.
fn follows(copies: &[Copied]) -> bool {
    let [.., before, last] = copies else { return true };
    let next = last.to.array == before.to.array && last.to.index == before.to.index + 1;
    next && last.from.1 == before.from.1
        && match (&copies[0].from.0, &copies[1].from.0, &before.from.0, &last.from.0) {
            (_, _, Spot::Number(a), Spot::Number(b)) => a.to_bits() == b.to_bits(),
            (Spot::Place(a), Spot::Place(b), Spot::Place(c), Spot::Place(d)) => {
                a.array == d.array
                    && c.array == d.array
                    && b.index as i64 - a.index as i64 == d.index as i64 - c.index as i64
            }
            _ => false,
        }
}

impl Writer<'_> {
    /// Writes the copy of this number, or the loop of which it is the first.
    pub(super) fn copy(&self, f: &mut Body, list: &Runs, at: usize) {
        let Some(copied) = list.all.get(at) else { return };
        let run = list.runs.iter().find(|run| run.contains(&at)).cloned().unwrap_or(at..at + 1);
        if at > run.start {
            return;
        }
        let all = &list.all[run.clone()];
        let to = self.series(f, all.iter().map(|c| (Spot::Place(c.to), false)).collect(), false);
        let from = self.series(f, all.iter().map(|c| c.from.clone()).collect(), f.shape.wide);
        if run.len() == 1 {
            return f.assign(&copied.to, &from);
        }
        let before = std::mem::take(&mut f.lines);
        f.assign(&to, &from);
        let body = std::mem::replace(&mut f.lines, before);
        self.in_loop(f, run.len(), body);
    }
}
