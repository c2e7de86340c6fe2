//! Where the entries of a sequence come turn by turn.

use std::hash::{Hash, Hasher};

use rustc_hash::FxHasher;

use super::rule::pieces;
use super::tree::Tree;
use crate::program::frequent_distances;

/// The fewest turns that count as such.
const TURNS: usize = 6;

/// Lengths of the rows of entries by which periods are looked for: short ones for short turns, long ones where parts of a
/// turn are alike.
const ROWS: [usize; 3] = [1, 3, 12];
/// Periods up to this one are tried in any case.
const SHORT: usize = 12;

/// Entries that come turn by turn, or a single one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Segment {
    /// The first entry.
    pub first: usize,
    /// The entries of a turn.
    pub period: usize,
    /// The number of turns; 1 for a single entry.
    pub turns: usize,
}

/// The shape of a tree, and the numbers in it.
struct Outline {
    shape: u64,
    numbers: Vec<i64>,
}

impl Outline {
    fn of(tree: &Tree) -> Outline {
        let (mut shape, mut numbers) = (FxHasher::default(), Vec::new());
        outline(tree, &mut shape, &mut numbers);
        Outline { shape: shape.finish(), numbers }
    }
}

fn outline(tree: &Tree, shape: &mut FxHasher, numbers: &mut Vec<i64>) {
    match tree {
        Tree::Whole(number) => {
            0u8.hash(shape);
            numbers.push(*number);
        }
        Tree::Real(bits) => (1u8, bits).hash(shape),
        Tree::Text(text) => {
            2u8.hash(shape);
            pieces(text).for_each(|(piece, number)| match number {
                Some(number) => numbers.push(number),
                None => piece.hash(shape),
            });
        }
        Tree::Kept(place) => (3u8, place).hash(shape),
        Tree::Group(name, parts) => {
            (4u8, name).hash(shape);
            parts.iter().for_each(|part| outline(part, shape, numbers));
        }
        Tree::Row(parts) => {
            (5u8, parts.len()).hash(shape);
            parts.iter().for_each(|part| outline(part, shape, numbers));
        }
        Tree::Other => 6u8.hash(shape),
    }
}

/// The segments of a sequence, in order, the longest taken where several begin; those of the shortest turns among them.
pub(super) fn segments(row: &[Tree]) -> Vec<Segment> {
    let outlines: Vec<Outline> = row.iter().map(Outline::of).collect();
    let runs: Vec<(usize, Vec<u32>)> =
        periods(&outlines).into_iter().map(|period| (period, runs(&outlines, period))).collect();
    let (mut all, mut at) = (Vec::new(), 0);
    while at < row.len() {
        let here = runs.iter().map(|(period, run)| (*period, run[at] as usize / period + 2));
        let longest = here.filter(|&(_, turns)| turns >= TURNS).max_by_key(|&(p, turns)| (p * turns, turns));
        let segment = match longest {
            Some((period, turns)) => Segment { first: at, period, turns },
            None => Segment { first: at, period: 1, turns: 1 },
        };
        all.push(segment);
        at += segment.period * segment.turns;
    }
    all
}

/// Distances at which entries come again, by their shapes, and by the steps from each to the one behind it: the most frequent
/// for rows of each length.
fn periods(outlines: &[Outline]) -> Vec<usize> {
    let shapes: Vec<u64> = outlines.iter().map(|outline| outline.shape).collect();
    let steps: Vec<u64> = outlines.windows(2).map(|two| step(&two[0], &two[1]).unwrap_or(two[0].shape)).collect();
    let mut all: Vec<usize> = (1..=SHORT).filter(|period| period * TURNS <= outlines.len()).collect();
    let fits = |distance: usize, times: usize| distance * TURNS <= outlines.len() && times >= TURNS - 1;
    for marks in [&shapes, &steps] {
        all.extend(ROWS.into_iter().flat_map(|row| frequent_distances(marks.windows(row), fits)));
    }
    all.sort_unstable();
    all.dedup();
    all
}

/// What leads from an entry to another of its shape.
fn step(from: &Outline, to: &Outline) -> Option<u64> {
    (from.shape == to.shape && from.numbers.len() == to.numbers.len()).then(|| {
        let mut hasher = FxHasher::default();
        from.numbers.iter().zip(&to.numbers).for_each(|(a, b)| b.wrapping_sub(*a).hash(&mut hasher));
        hasher.finish()
    })
}

/// For each entry the number of entries from it on that the two at the distances of one and two periods behind them
/// continue in a straight line.
fn runs(outlines: &[Outline], period: usize) -> Vec<u32> {
    let steps: Vec<Option<u64>> = outlines.iter().zip(&outlines[period..]).map(|(a, b)| step(a, b)).collect();
    let mut runs = vec![0; outlines.len()];
    for at in (0..steps.len()).rev() {
        let is_straight = steps[at].is_some() && steps.get(at + period).is_some_and(|next| *next == steps[at]);
        if is_straight {
            runs[at] = 1 + runs.get(at + 1).copied().unwrap_or(0);
        }
    }
    runs
}
