//! A linear system in numbers of which is known what roundings make of them.
//!
//! Which inputs reach what, and where outputs vanish, hangs on which entries vanish, and masses and springs of one model
//! range over decades, so that no size tells it. Every entry is [`Known`] to what roundings of the matrices make of it, and
//! what is no more than these vanishes. Eliminations leave alone what they need not touch, where orthogonal transformations
//! would mix large rows into small ones.

use nalgebra::DMatrix;
use nalgebra::linalg::balancing::balance_parlett_reinsch;

use halfarrow_exec::Linearised;

use super::known::Known;

/// An entry this part of others in its row and of others in its column is what rounding left of nothing.
const NOTHING: f64 = 4.0 * f64::EPSILON;

/// Rows of a matrix.
pub(super) type Rows = Vec<Vec<Known>>;

/// A system in matrices: `x' = a x + b u`, `y = c x + d u`. States that are held stay in their places: outputs have nothing of
/// them, and nobody looks at the others' parts of them any more.
#[derive(Clone)]
pub(super) struct StateSpace {
    pub(super) a: Rows,
    pub(super) b: Rows,
    pub(super) c: Rows,
    pub(super) d: Rows,
    pub(super) inputs: usize,
    /// The states that are left.
    pub(super) free: Vec<usize>,
}

/// The two largest entries of a row or column off the diagonal.
#[derive(Default)]
struct Largest {
    place: usize,
    most: f64,
    next: f64,
}

impl Largest {
    fn of(diagonal: usize, entries: &mut dyn Iterator<Item = &f64>) -> Largest {
        let mut found = Largest::default();
        for (place, size) in entries.map(|entry| entry.abs()).enumerate().filter(|(place, _)| *place != diagonal) {
            if size > found.most {
                found = Largest { place, most: size, next: found.most };
            } else {
                found.next = found.next.max(size);
            }
        }
        found
    }

    /// The largest one beside that of this place.
    fn beside(&self, place: usize) -> f64 {
        if place == self.place { self.next } else { self.most }
    }
}

impl StateSpace {
    /// The system with rows, columns and states of like size, which neither zeros nor ranks notice, so that sizes tell good
    /// pivots. `None` if an entry is no number.
    pub(super) fn scaled(linear: &Linearised) -> Option<StateSpace> {
        let inputs = linear.b.first().or(linear.d.first()).map_or(0, Vec::len);
        let (n, outputs) = (linear.a.len(), linear.d.len());
        // Inputs and outputs as if each output drove an input: what lies on the way from one to the other is scaled with it.
        let entry = |i: usize, j: usize| match (i < n, j < n) {
            (true, true) => linear.a[i][j],
            (true, false) if j - n < inputs => linear.b[i][j - n],
            (false, true) if i - n < outputs => linear.c[i - n][j],
            (false, false) if i - n < outputs && j - n < inputs => linear.d[i - n][j - n],
            _ => 0.0,
        };
        let mut all = DMatrix::from_fn(n + inputs.max(outputs), n + inputs.max(outputs), entry);
        if all.iter().any(|entry| !entry.is_finite()) {
            return None;
        }
        // Powers of two, which lose no digit.
        balance_parlett_reinsch(&mut all);
        let power_of_two = |size: f64| if size > 0.0 { libm::exp2(libm::log2(size).round()) } else { 1.0 };
        let size = power_of_two(all.view((0, 0), (n, n)).iter().fold(0.0, |most: f64, entry| most.max(entry.abs())));
        for j in n..all.ncols() {
            let factor = size / power_of_two(all.column(j).amax());
            all.column_mut(j).scale_mut(factor);
        }
        for i in n..all.nrows() {
            let factor = size / power_of_two(all.row(i).amax());
            all.row_mut(i).scale_mut(factor);
        }
        let in_rows: Vec<_> = (0..all.nrows()).map(|i| Largest::of(i, &mut all.row(i).iter())).collect();
        let in_columns: Vec<_> = (0..all.ncols()).map(|j| Largest::of(j, &mut all.column(j).iter())).collect();
        let others = |i: usize, j: usize| if i == j { 0.0 } else { in_rows[i].beside(j).min(in_columns[j].beside(i)) };
        let mut noise = 1;
        let mut part = |rows: std::ops::Range<usize>, columns: std::ops::Range<usize>| -> Rows {
            let row = |i: usize| {
                let entry = |j: usize| match all[(i, j)] {
                    entry if entry == 0.0 || entry.abs() <= NOTHING * others(i, j) => Known::ZERO,
                    entry => Known::rounded(entry, &mut noise),
                };
                columns.clone().map(entry).collect()
            };
            rows.map(row).collect()
        };
        let (states, last_input, last_output) = (0..n, n + inputs, n + outputs);
        let system = StateSpace {
            a: part(states.clone(), states.clone()),
            b: part(states.clone(), n..last_input),
            c: part(n..last_output, states),
            d: part(n..last_output, n..last_input),
            inputs,
            free: (0..n).collect(),
        };
        let finite =
            [&system.a, &system.b, &system.c, &system.d].iter().all(|m| m.iter().flatten().all(Known::is_finite));
        finite.then_some(system)
    }

    /// The system of the states that are left with inputs and outputs exchanged, which has the same zeros.
    pub(super) fn transposed(&self) -> StateSpace {
        let every: Vec<usize> = (0..self.d.len()).collect();
        let of = |rows: &Rows, which: &[usize], columns: &[usize]| -> Rows {
            columns.iter().map(|&j| which.iter().map(|&i| rows[i][j]).collect()).collect()
        };
        let (free, inputs) = (&self.free, (0..self.inputs).collect::<Vec<usize>>());
        StateSpace {
            a: of(&self.a, free, free),
            b: of(&self.c, &every, free),
            c: of(&self.b, free, &inputs),
            d: of(&self.d, &every, &inputs),
            inputs: self.d.len(),
            free: (0..free.len()).collect(),
        }
    }

    /// How many states, in suitable coordinates, the outputs see: those that they hold, and what acts on the rates of these.
    pub(super) fn seen(mut self) -> usize {
        let all = self.free.len();
        loop {
            let outputs = std::mem::take(&mut self.c);
            let seen = self.held_by(outputs);
            if seen.is_empty() {
                return all - self.free.len();
            }
            self.hold(&seen);
        }
    }

    /// Holds states, whose rates are outputs then.
    pub(super) fn hold(&mut self, states: &[usize]) {
        self.free.retain(|state| !states.contains(state));
        for &state in states {
            let row = &mut self.a[state];
            let mut output = vec![Known::ZERO; row.len()];
            self.free.iter().for_each(|&j| output[j] = row[j]);
            self.c.push(output);
            self.d.push(std::mem::take(&mut self.b[state]));
        }
        self.c.iter_mut().for_each(|output| states.iter().for_each(|&state| output[state] = Known::ZERO));
    }

    /// Coordinates in which each of these combinations of states is a state, up to a factor, or nothing: which states.
    pub(super) fn held_by(&mut self, mut combinations: Rows) -> Vec<usize> {
        let mut seen = Vec::new();
        for at in 0..combinations.len() {
            let Some(state) = largest(&combinations[at]) else { continue };
            seen.push(state);
            let pivot = combinations[at][state];
            let parts: Vec<(usize, Known)> = combinations[at]
                .iter()
                .enumerate()
                .filter(|(k, part)| *k != state && !part.is_zero())
                .map(|(k, part)| (k, part.over(pivot)))
                .collect();
            // The state is the combination less the others.
            let without = |row: &mut Vec<Known>| {
                let factor = row[state];
                parts.iter().for_each(|(k, part)| row[*k] = row[*k].less(factor, *part));
            };
            self.free.iter().for_each(|&i| without(&mut self.a[i]));
            self.c.iter_mut().chain(&mut combinations).for_each(without);
            // And its rate that of the combination.
            for rows in [&mut self.a, &mut self.b] {
                let mut sum = std::mem::take(&mut rows[state]);
                for (k, part) in &parts {
                    sum.iter_mut().zip(&rows[*k]).for_each(|(sum, entry)| *sum = sum.less(part.negative(), *entry));
                }
                rows[state] = sum;
            }
            // What other combinations have of it is zero with it.
            combinations[at + 1..].iter_mut().for_each(|row| row[state] = Known::ZERO);
        }
        seen
    }
}

/// Where a row has most; `None` if it has nothing.
pub(super) fn largest(row: &[Known]) -> Option<usize> {
    let nonzero = (0..row.len()).filter(|&j| !row[j].is_zero());
    nonzero.max_by(|&a, &b| row[a].size().total_cmp(&row[b].size()))
}
