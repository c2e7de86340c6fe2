//! Steps that come time after time with the same operations: cells of a chain, sections of a line. Where such repetitions
//! stand in code, so that whoever writes it may tell them once.

use super::routine::{Arg, Code, Local};
use rustc_hash::FxHashMap;
use std::collections::BinaryHeap;
use std::hash::Hash;

/// Repetitions of fewer turns are none.
const TURNS: usize = 8;
/// Nor are those that spare fewer steps.
const SPARED: usize = 100;
/// Lengths of the rows of steps by which periods are looked for: short ones for short bodies, long ones where parts of a
/// body are alike.
const ROWS: [usize; 3] = [3, 12, 48];
/// Periods tried for each of them, the most frequent first.
const PERIODS: usize = 24;
/// Turns at either end of a repetition that may read otherwise than the rest and then stand alone.
const ENDS: usize = 2;

/// Steps that are repeated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Repetition {
    /// The first step.
    pub first: usize,
    /// The number of steps of a turn.
    pub length: usize,
    /// The number of turns.
    pub turns: usize,
}

impl Repetition {
    /// The step behind it.
    pub fn end(&self) -> usize {
        self.first + self.length * self.turns
    }

    /// Steps that need not be written.
    fn spared(&self) -> usize {
        self.length * self.turns.saturating_sub(1)
    }

    /// Whether it is worth a loop.
    pub fn pays(&self) -> bool {
        self.turns >= TURNS && self.spared() >= SPARED
    }

    /// Whether there may be one that is among so many steps.
    pub fn may_pay(steps: usize) -> bool {
        steps > SPARED
    }

    /// The repetition with this period between two steps, if it pays.
    fn between(first: usize, end: usize, length: usize) -> Option<Repetition> {
        Some(Repetition { first, length, turns: end.saturating_sub(first) / length }).filter(Repetition::pays)
    }
}

impl Code {
    /// Where steps repeat each other, in order. Steps of one of the `kinds` differ in nothing but what they read and define.
    ///
    /// A turn begins where the fewest values are carried from one to the next. What it reads may depend on the turn in any
    /// way; where the first or last turns alone read otherwise than the rest they are left out.
    ///
    /// # Panics
    /// There is not a kind for each step.
    pub fn repetitions(&self, kinds: &[u32]) -> Vec<Repetition> {
        assert_eq!(kinds.len(), self.steps.len(), "a kind for each step");
        if !Repetition::may_pay(kinds.len()) {
            return Vec::new();
        }
        let reads = Reads::of(self);
        let found = largest_first(candidates(kinds), kinds.len()).into_iter();
        let mut fitted: Vec<Repetition> = found.filter_map(|(r, end)| reads.trimmed(reads.shifted(r, end)?)).collect();
        fitted.sort_unstable_by_key(|r| r.first);
        fitted
    }
}

/// Runs of kinds with a period, each with its end; they may overlap.
fn candidates(kinds: &[u32]) -> Vec<(Repetition, usize)> {
    let mut found = Vec::new();
    for period in periods(kinds) {
        let mut at = period;
        while at < kinds.len() {
            let from = at;
            while at < kinds.len() && kinds[at] == kinds[at - period] {
                at += 1;
            }
            found.extend(Repetition::between(from - period, at, period).map(|r| (r, at)));
            at += 1;
        }
    }
    found
}

/// Distances at which the same rows of steps come again, the most frequent ones for each length of a row.
fn periods(kinds: &[u32]) -> Vec<usize> {
    let fits = |distance: usize, _| distance * TURNS <= kinds.len();
    let mut all: Vec<usize> = ROWS.into_iter().flat_map(|row| frequent_distances(marks(kinds, row), fits)).collect();
    all.sort_unstable();
    all.dedup();
    all
}

/// Distances at which equal marks follow each other: of those that fit, by distance and how often it comes, the most frequent.
pub(crate) fn frequent_distances<M: Eq + Hash>(
    marks: impl Iterator<Item = M>,
    fits: impl Fn(usize, usize) -> bool,
) -> impl Iterator<Item = usize> {
    let mut before: FxHashMap<M, usize> = FxHashMap::default();
    let mut count: FxHashMap<usize, usize> = FxHashMap::default();
    for (at, mark) in marks.enumerate() {
        if let Some(last) = before.insert(mark, at) {
            *count.entry(at - last).or_default() += 1;
        }
    }
    let mut often: Vec<(usize, usize)> = count.into_iter().filter(|&(distance, times)| fits(distance, times)).collect();
    often.sort_unstable_by_key(|&(distance, times)| (std::cmp::Reverse(times), distance));
    often.into_iter().map(|(distance, _)| distance).take(PERIODS)
}

/// A number for each row of so many kinds; equal rows have the same.
fn marks(kinds: &[u32], row: usize) -> impl Iterator<Item = u64> + '_ {
    const BASE: u64 = 0x9E37_79B9_7F4A_7C15;
    let top = (0..row).fold(1u64, |power, _| power.wrapping_mul(BASE));
    let mut mark = 0u64;
    let next = move |at: usize| {
        mark = mark.wrapping_mul(BASE).wrapping_add(u64::from(kinds[at]) + 1);
        if at >= row {
            mark = mark.wrapping_sub(top.wrapping_mul(u64::from(kinds[at - row]) + 1));
        }
        mark
    };
    (0..kinds.len()).map(next).skip(row - 1)
}

/// Of candidates those that spare most; others take what is left between them, if that pays.
fn largest_first(candidates: Vec<(Repetition, usize)>, steps: usize) -> Vec<(Repetition, usize)> {
    let ranked =
        |(r, end): (Repetition, usize)| (r.spared(), std::cmp::Reverse(r.length), std::cmp::Reverse(r.first), end);
    let mut heap: BinaryHeap<_> = candidates.into_iter().map(ranked).collect();
    let (mut taken, mut chosen) = (vec![false; steps], Vec::new());
    while let Some((_, std::cmp::Reverse(length), std::cmp::Reverse(first), end)) = heap.pop() {
        let free = free_part(&taken, first, end);
        let Some(rest) = Repetition::between(free.0, free.1, length) else { continue };
        if free == (first, end) {
            taken[first..end].fill(true);
            chosen.push((rest, end));
        } else {
            heap.push(ranked((rest, free.1)));
        }
    }
    chosen
}

/// The longest part of some steps of which none is taken.
fn free_part(taken: &[bool], first: usize, end: usize) -> (usize, usize) {
    let (mut best, mut from) = ((first, first), first);
    for stop in (first..end).filter(|&at| taken[at]).chain([end]) {
        if stop - from > best.1 - best.0 {
            best = (from, stop);
        }
        from = stop + 1;
    }
    best
}

/// What steps read of what others define.
struct Reads {
    /// For each step how far before it that is defined; none for what no step defines.
    back: Vec<Vec<Option<usize>>>,
}

impl Reads {
    fn of(code: &Code) -> Reads {
        let mut definition = vec![0; code.values.len()];
        for (at, step) in code.steps.iter().enumerate() {
            step.defines().iter().for_each(|out| definition[out.0 as usize] = at);
        }
        let back = |(at, step): (usize, &super::routine::Step)| {
            let mut back = Vec::new();
            step.for_each_read(|a| {
                back.push(match a {
                    Arg::Local(Local(i)) => Some(at - definition[i as usize]),
                    _ => None,
                });
            });
            back
        };
        Reads { back: code.steps.iter().enumerate().map(back).collect() }
    }

    /// The same repetition with turns that begin where the fewest values are carried on.
    fn shifted(&self, r: Repetition, end: usize) -> Option<Repetition> {
        let length = r.length;
        let base = r.first + r.turns / 2 * length;
        let mut last = vec![0; length];
        for at in base..end.min(base + 2 * length) {
            for back in self.back[at].iter().flatten() {
                if let Some(from) = (at - back).checked_sub(base).filter(|&from| from < length) {
                    last[from] = (at - base - from).max(last[from]);
                }
            }
        }
        // How many values a turn is given that begins at each step.
        let mut change = vec![0i64; 2 * length + 1];
        for (from, &far) in last.iter().enumerate().filter(|(_, far)| **far < length) {
            change[from + 1] += 1;
            change[from + far + 1] -= 1;
        }
        let mut sum = 0;
        let mut carried = vec![0; length];
        for (at, change) in change[..2 * length].iter().enumerate() {
            sum += change;
            carried[at % length] += sum;
        }
        let shift = (0..length).min_by_key(|&shift| carried[shift]).unwrap_or(0);
        Repetition::between(r.first + shift, end, length).or_else(|| Repetition::between(r.first, end, length))
    }

    /// The same without first and last turns that read otherwise than the rest.
    fn trimmed(&self, r: Repetition) -> Option<Repetition> {
        let usual = self.near(&r, r.turns / 2);
        let odd = |&turn: &usize| self.near(&r, turn) != usual;
        let first = (0..ENDS).take_while(odd).count();
        let last = (0..ENDS).map(|i| r.turns - 1 - i).take_while(odd).count();
        let trimmed = Repetition { first: r.first + first * r.length, turns: r.turns - first - last, ..r };
        if trimmed.pays() { Some(trimmed) } else { Some(r) }
    }

    /// Where a turn finds what it or one of the few before it have defined.
    fn near(&self, r: &Repetition, turn: usize) -> Vec<Option<usize>> {
        let from = r.first + turn * r.length;
        let near = |back: &Option<usize>| back.filter(|&back| back <= ENDS * r.length);
        self.back[from..from + r.length].iter().flatten().map(near).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::program::op::Op;
    use crate::program::{Step, Value};

    fn given(i: u32) -> Arg {
        Arg::Given(Value(i))
    }

    /// Steps of one operation are of one kind.
    fn kinds(code: &Code) -> Vec<u32> {
        let kind = |step: &Step| match step {
            Step::Op { op: Op::Add(..), .. } => 0,
            Step::Op { op: Op::Sub(..), .. } => 1,
            Step::Op { op: Op::Mul(..), .. } => 2,
            Step::Op { op: Op::Neg(..), .. } => 3,
            _ => 4,
        };
        code.steps.iter().map(kind).collect()
    }

    fn found(code: &Code) -> Vec<Repetition> {
        code.repetitions(&kinds(code))
    }

    /// Sections of a line, each of which reads what the one before has found.
    fn line(sections: u32) -> Code {
        let mut code = Code::default();
        let mut before = code.push(Op::Neg(given(0)), None);
        for i in 0..sections {
            let u = code.push(Op::Mul(given(1), given(i + 2)), None);
            let f = code.push(Op::Sub(before, u), None);
            let square = code.push(Op::Mul(f, f), None);
            let law = code.push(Op::Mul(square, f), None);
            before = code.push(Op::Add(law, f), None);
        }
        code.outputs = vec![before];
        code
    }

    #[test]
    fn sections_of_a_line_are_a_repetition() {
        assert_eq!(found(&line(40)), [Repetition { first: 1, length: 5, turns: 40 }]);
        assert_eq!(found(&line(20)), [], "they spare too little");
    }

    #[test]
    fn what_stands_before_and_behind_is_left_out() {
        let mut code = Code::default();
        for i in 0..7 {
            code.push(Op::Neg(given(i)), None);
            code.push(Op::Sub(given(i), given(i)), None);
            code.push(Op::Add(given(i), given(i)), None);
        }
        let from = code.steps.len();
        for i in 0..60 {
            let square = code.push(Op::Mul(given(i), given(i)), None);
            code.push(Op::Sub(square, given(i)), None);
            code.push(Op::Add(square, given(i)), None);
        }
        code.push(Op::Mul(given(0), given(0)), None);
        code.push(Op::Neg(given(0)), None);
        assert_eq!(found(&code), [Repetition { first: from, length: 3, turns: 60 }]);
    }

    #[test]
    fn turns_begin_where_little_is_carried_on() {
        // A step before the first cell is the same as the last one of each cell.
        let mut code = Code::default();
        code.push(Op::Add(given(0), given(0)), None);
        for i in 0..50 {
            let a = code.push(Op::Sub(given(i), given(1)), None);
            let b = code.push(Op::Mul(a, a), None);
            code.push(Op::Add(a, b), None);
        }
        assert_eq!(found(&code), [Repetition { first: 1, length: 3, turns: 50 }]);
    }

    #[test]
    fn a_first_turn_that_reads_otherwise_stands_alone() {
        let mut code = Code::default();
        let mut before = given(0);
        for i in 0..60 {
            let u = code.push(Op::Sub(before, given(i)), None);
            before = code.push(Op::Mul(u, u), None);
        }
        assert_eq!(found(&code), [Repetition { first: 2, length: 2, turns: 59 }]);
    }

    #[test]
    fn parts_that_are_alike_within_a_cell_do_not_hide_it() {
        // Each cell begins with the same law twice; the laws alone follow each other at distances of 4 and 7.
        let mut code = Code::default();
        let cell = |code: &mut Code, i: u32| {
            let law = |code: &mut Code, e: Arg| {
                let square = code.push(Op::Mul(e, e), None);
                let cube = code.push(Op::Mul(square, e), None);
                let sum = code.push(Op::Add(cube, e), None);
                code.push(Op::Sub(sum, given(0)), None)
            };
            let (a, b) = (law(code, given(i)), law(code, given(i + 1)));
            let both = code.push(Op::Add(a, b), None);
            code.push(Op::Neg(both), None);
            code.push(Op::Neg(given(i)), None);
        };
        (0..30).for_each(|i| cell(&mut code, i));
        assert_eq!(found(&code), [Repetition { first: 0, length: 11, turns: 30 }]);
    }

    #[test]
    fn several_repetitions_stand_in_order() {
        let mut code = Code::default();
        for i in 0..70 {
            code.push(Op::Mul(given(i), given(i)), None);
            code.push(Op::Neg(given(i)), None);
        }
        (0..200).for_each(|i| {
            code.push(Op::Add(given(i), given(0)), None);
        });
        let [first, second] = found(&code)[..] else { panic!("two: {:?}", found(&code)) };
        assert_eq!((first.first, first.length, first.turns), (0, 2, 70));
        assert_eq!((second.first, second.length, second.turns), (140, 1, 200));
    }

    #[test]
    fn where_nothing_repeats_nothing_is_found() {
        let mut code = Code::default();
        let mut random = 1u32;
        for i in 0..2000 {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            match random >> 30 {
                0 => code.push(Op::Add(given(i), given(i)), None),
                1 => code.push(Op::Mul(given(i), given(i)), None),
                2 => code.push(Op::Sub(given(i), given(i)), None),
                _ => code.push(Op::Neg(given(i)), None),
            };
        }
        assert_eq!(found(&code), []);
    }
}
