//! Newton blocks of one shape, several at once: each lane solves one of them.
//!
//! Only the usual way of [`newton`](super::newton) is gone here: a solution is followed, every step is taken whole, the
//! matrix is symmetric and definite. It takes the same operations in the same order, hence gives the same bits. A block
//! that needs anything else is left to the solver of single blocks.

use super::frame::{Frame, Solver};
use super::instruction::{Register, Routine, Solve};
use super::newton::{CLOSE_TO_ROUNDING, CONTRACTION, CONVERGED};
use super::packed::Packed;
use super::registers::Layout;
use super::wide::{self, WideFrame};
use halfarrow_compiler::program::{self, Arg, Code, Method, Program, Step};
use std::collections::BTreeMap;

/// Blocks that are solved at once: as many as it takes to keep the processor busy, since each step of an elimination
/// waits for the one before.
const LANES: usize = 16;
type Line = wide::Line<LANES>;

/// Iterations at most.
const ITERATIONS: usize = 8;
/// Evaluations of a block that may come to pass here.
const EVALUATIONS: usize = ITERATIONS + 1;
/// Blocks of more unknowns are left alone.
const LARGEST: usize = 32;
/// Fewer blocks are solved one at a time.
const FEWEST: usize = 3;

/// The blocks of a routine that are solved together.
#[derive(Debug, Default)]
pub(crate) struct Abreast {
    groups: Vec<Group>,
    /// The group of each block that has one.
    of: BTreeMap<u32, usize>,
}

/// Blocks of one shape, of which none reads what another finds, with what they read there before the first.
#[derive(Debug)]
struct Group {
    /// Number of unknowns.
    size: usize,
    members: Vec<Member>,
    /// Which memory the first lanes have.
    first: usize,
    /// The inner code of all of them: guesses, then what is read from outside, then what is computed.
    packed: Packed,
    /// The places of the matrix that are not 0, row by row, in the order of the first outputs; residuals follow.
    entries: Vec<u32>,
    rows: Vec<Row>,
}

/// A row of `U`, and what elimination by it does.
#[derive(Debug)]
struct Row {
    /// The entry of the matrix on the diagonal.
    diagonal: Option<usize>,
    /// Where its places right of the diagonal begin.
    start: usize,
    /// These: column, and the entry of the matrix that stands there.
    right: Vec<(usize, Option<usize>)>,
    /// For each of them, in the row of that column, where the places of the columns after it stand.
    below: Vec<Vec<usize>>,
}

#[derive(Debug)]
struct Member {
    block: usize,
    /// Where the routine has what the block reads from outside.
    inputs: Vec<Register>,
    /// What of it varies, as [`Solve::outer`] has it.
    outer: Vec<Register>,
}

/// What a block computes, whatever it reads: inputs in the order in which it reads them.
struct Shape {
    size: usize,
    /// The code, with inputs for all that it reads from outside.
    code: Code,
    entries: Vec<u32>,
}

impl Abreast {
    /// The groups of a routine; `None` if there are none.
    pub fn of(program: &Program, layout: &Layout, routine: &Routine) -> Option<Abreast> {
        let mut defined_at = vec![0; routine.source.values.len()];
        let mut solves = routine.solves.iter();
        // Shape, position of the first and members.
        let mut open: Vec<(Shape, usize, Vec<Member>)> = Vec::new();
        for (at, step) in routine.source.steps.iter().enumerate() {
            step.defines().iter().for_each(|out| defined_at[out.0 as usize] = at);
            let Step::Solve(solve) = step else { continue };
            let there = solves.next().expect("as many solve blocks on registers");
            let Method::Newton { outer, .. } = &solve.method else { continue };
            let Some((shape, read)) = Shape::of(program, solve) else { continue };
            let known = |a: &Arg| if let Arg::Local(local) = a { Some(defined_at[local.0 as usize]) } else { None };
            let last = outer.iter().filter_map(known).max();
            let place = |a: Arg| match a {
                Arg::Given(value) => layout.registers[&value],
                Arg::Outer(i) => there.outer[i as usize],
                Arg::Local(_) | Arg::Guess(_) => unreachable!("these stand inside"),
            };
            let member = Member {
                block: solve.block.0 as usize,
                inputs: read.iter().map(|&a| place(a)).collect(),
                outer: there.outer.clone(),
            };
            let alike = |(other, since, _): &&mut (Shape, usize, Vec<Member>)| {
                other.is(&shape) && last.is_none_or(|last| last < *since)
            };
            match open.iter_mut().rev().find(alike) {
                Some((_, _, members)) => members.push(member),
                None => open.push((shape, at, vec![member])),
            }
        }
        let mut first = 0;
        let together = open.into_iter().filter(|(_, _, members)| members.len() >= FEWEST);
        let groups: Vec<Group> = together
            .map(|(shape, _, members)| {
                let lanes = members.len().div_ceil(LANES);
                first += lanes;
                Group::of(shape, members, first - lanes)
            })
            .collect();
        let members = groups.iter().enumerate().flat_map(|(g, group)| group.members.iter().map(move |m| (m, g)));
        let of: BTreeMap<u32, usize> = members.map(|(member, g)| (member.block as u32, g)).collect();
        (!groups.is_empty()).then_some(Abreast { groups, of })
    }
}

impl Shape {
    /// The shape, and what the block reads from outside, in the order of the inputs; `None` if the block may take another
    /// way than the usual one, whatever its values.
    fn of(program: &Program, solve: &program::Solve) -> Option<(Shape, Vec<Arg>)> {
        let Method::Newton { code, .. } = &solve.method else { return None };
        let size = solve.unknowns.len();
        let symmetric = size == 1 || program.blocks[solve.block].is_symmetric();
        let conditions = code.steps.iter().any(|step| matches!(step, Step::Op { op, .. } if op.is_held()));
        if !symmetric || size > LARGEST || conditions {
            return None;
        }
        let mut read: Vec<Arg> = Vec::new();
        let mut named = |a: Arg| match a {
            Arg::Local(_) | Arg::Guess(_) => a,
            Arg::Given(_) | Arg::Outer(_) => {
                let known = read.iter().position(|&r| r == a);
                Arg::Outer(known.unwrap_or_else(|| {
                    read.push(a);
                    read.len() - 1
                }) as u32)
            }
        };
        let steps = code.steps.iter().map(|step| match step {
            Step::Op { out, op } => Step::Op { out: *out, op: op.map_operands(&mut named) },
            _ => unreachable!("the code of a Newton block is plain"),
        });
        let steps = steps.collect();
        // The entries of the matrix, then the residuals.
        let (right, matrix) = code.outputs.split_at(size);
        let outputs = solve.entries.iter().map(|&place| matrix[place as usize]).chain(right.iter().copied());
        let outputs = outputs.map(named).collect();
        let code = Code { steps, outputs, values: vec![None; code.values.len()] };
        Some((Shape { size, code, entries: solve.entries.clone() }, read))
    }

    fn is(&self, other: &Shape) -> bool {
        self.size == other.size && self.entries == other.entries && self.code == other.code
    }
}

impl Group {
    fn of(shape: Shape, members: Vec<Member>, first: usize) -> Group {
        let n = shape.size;
        let fixed = (n + members[0].inputs.len()) as u32;
        let slot = |a: Arg| match a {
            Arg::Guess(i) => i,
            Arg::Outer(i) => n as u32 + i,
            Arg::Local(local) => fixed + local.0,
            Arg::Given(_) => unreachable!("inputs stand for what is given"),
        };
        let packed = Packed::of(&shape.code, fixed, &[], slot);
        let entry = |i: usize, j: usize| shape.entries.iter().position(|&place| place as usize == i * n + j);
        // What elimination fills.
        let mut full: Vec<Vec<bool>> = (0..n).map(|i| (0..n).map(|j| entry(i, j).is_some()).collect()).collect();
        for k in 0..n {
            let row: Vec<usize> = (k + 1..n).filter(|&j| full[k][j]).collect();
            for &i in &row {
                row.iter().filter(|&&j| j >= i).for_each(|&j| full[i][j] = true);
            }
        }
        let columns: Vec<Vec<usize>> = (0..n).map(|i| (i + 1..n).filter(|&j| full[i][j]).collect()).collect();
        let starts: Vec<usize> = (0..n).map(|i| columns[..i].iter().map(Vec::len).sum()).collect();
        let place = |i: usize, j: usize| starts[i] + columns[i].iter().position(|&c| c == j).expect("filled");
        let row = |i: usize| {
            let right = columns[i].iter().map(|&j| (j, entry(i, j))).collect();
            let after = |a: usize| columns[i][a + 1..].iter().map(|&j| place(columns[i][a], j)).collect();
            let below = (0..columns[i].len()).map(after).collect();
            Row { diagonal: entry(i, i), start: starts[i], right, below }
        };
        let rows = (0..n).map(row).collect();
        Group { size: n, members, first, packed, entries: shape.entries, rows }
    }
}

/// The solutions that lanes follow, and the entries of the Jacobian there.
#[derive(Debug, Clone, Default)]
struct Memory {
    /// The blocks, and the versions of their memories that these are.
    of: [(usize, u64); LANES],
    kept: Vec<Line>,
    base: Vec<Line>,
}

/// Working space: one number for each lane in every place.
#[derive(Debug, Clone, Default)]
pub(crate) struct Space {
    registers: WideFrame<LANES>,
    /// What lanes remember, for each time that a group is gone through with all lanes.
    memories: Vec<Memory>,
    /// Which of them is in use.
    memory: usize,
    x: Vec<Line>,
    size: Vec<Line>,
    step: Vec<Line>,
    next: Vec<Line>,
    lead: Vec<Line>,
    opening: Vec<Line>,
    /// Factors: above the diagonal, row by row, and the inverse diagonal.
    upper: Vec<Line>,
    inverse: Vec<Line>,
    /// Solutions, and the entries of the Jacobian there.
    found: Vec<Line>,
    jacobian: Vec<Line>,
    /// Where each group was tried last.
    tried: Vec<u64>,
    /// Evaluations of routines so far.
    pub turn: u64,
}

impl Space {
    /// Makes room for the groups of a routine.
    pub fn reserve(&mut self, abreast: &Abreast) {
        let most = |of: &dyn Fn(&Group) -> usize| abreast.groups.iter().map(of).max().unwrap_or(0);
        let (n, entries) = (most(&|g| g.size), most(&|g| g.entries.len()));
        let upper = most(&|g| g.rows.iter().map(|row| row.right.len()).sum());
        self.registers.reserve(most(&|g| g.packed.slots.max(g.size + g.members[0].inputs.len())));
        for line in [
            &mut self.x,
            &mut self.size,
            &mut self.step,
            &mut self.next,
            &mut self.lead,
            &mut self.opening,
            &mut self.inverse,
            &mut self.found,
        ] {
            line.resize(line.len().max(n), Line::default());
        }
        self.upper.resize(self.upper.len().max(upper), Line::default());
        self.jacobian.resize(self.jacobian.len().max(entries), Line::default());
        self.tried.resize(self.tried.len().max(abreast.groups.len()), 0);
        let memories = most(&|g| g.first + g.members.len().div_ceil(LANES));
        self.memories.resize(self.memories.len().max(memories), Memory::default());
        for memory in &mut self.memories {
            memory.kept.resize(memory.kept.len().max(n), Line::default());
            memory.base.resize(memory.base.len().max(entries), Line::default());
        }
    }
}

impl Frame {
    /// Solves the group of a block, if it has one that has not been tried in this turn.
    pub(super) fn solve_abreast(&mut self, solve: &Solve) {
        let Some(abreast) = &self.abreast else { return };
        let Some(&number) = abreast.of.get(&solve.block.0) else { return };
        if std::mem::replace(&mut self.space.tried[number], self.space.turn) == self.space.turn {
            return;
        }
        let abreast = abreast.clone();
        let group = &abreast.groups[number];
        let arch = pulp::Arch::new();
        let Frame { r, solvers, space, .. } = self;
        for (members, memory) in group.members.chunks(LANES).zip(group.first..) {
            let follows = |m: &Member| {
                let newton = &solvers[m.block].newton;
                newton.following && newton.evaluation_limit / 4 > EVALUATIONS
            };
            if members.iter().filter(|m| follows(m)).count() < FEWEST {
                continue;
            }
            let mut good: [bool; LANES] = std::array::from_fn(|l| members.get(l).is_some_and(follows));
            space.memory = memory;
            space.gather(group, members, r, solvers);
            arch.dispatch(Usual { space, group, good: &mut good });
            space.hand_over(group, members, r, solvers, &good);
        }
    }
}

impl Space {
    /// Takes up what the blocks read, and where they are; lanes without a block do as the first.
    fn gather(&mut self, group: &Group, members: &[Member], r: &[f64], solvers: &[Solver]) {
        let n = group.size;
        for lane in 0..LANES {
            let member = members.get(lane).unwrap_or(&members[0]);
            let newton = &solvers[member.block].newton;
            for (place, &input) in member.inputs.iter().enumerate() {
                self.registers.r[n + place][lane] = r[input as usize];
            }
            let memory = &mut self.memories[self.memory];
            let present = (member.block, newton.version);
            if memory.of[lane] != present {
                memory.of[lane] = present;
                (0..n).for_each(|i| memory.kept[i][lane] = newton.previous[i]);
                for (base, &place) in memory.base.iter_mut().zip(&group.entries) {
                    base[lane] = newton.previous_jacobian[place as usize];
                }
            }
        }
    }

    /// Gives the blocks what has been found.
    fn hand_over(&self, group: &Group, members: &[Member], r: &[f64], solvers: &mut [Solver], good: &[bool; LANES]) {
        let n = group.size;
        for (lane, member) in members.iter().enumerate().filter(|(lane, _)| good[*lane]) {
            let newton = &mut solvers[member.block].newton;
            (0..n).for_each(|i| newton.x[i] = self.found[i][lane]);
            for (jacobian, &place) in self.jacobian.iter().zip(&group.entries) {
                newton.jacobian[place as usize] = jacobian[lane];
            }
            newton.outer.iter_mut().zip(&member.outer).for_each(|(value, &outer)| *value = r[outer as usize]);
            newton.fresh = true;
        }
    }
}

/// The usual way, to be gone with the vectors of the machine.
struct Usual<'a> {
    space: &'a mut Space,
    group: &'a Group,
    good: &'a mut [bool; LANES],
}

impl pulp::WithSimd for Usual<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        *self.good = self.space.solve(self.group, *self.good);
    }
}

const NONE: Line = wide::Line([0.0; LANES]);

#[inline(always)]
fn each(value: impl Fn(usize) -> f64) -> Line {
    wide::Line(std::array::from_fn(value))
}

/// 1 where something holds, 0 elsewhere: truth values that stay in the vectors of the machine.
#[inline(always)]
fn truth(holds: impl Fn(usize) -> bool) -> Line {
    each(|l| if holds(l) { 1.0 } else { 0.0 })
}

/// The greater one; as `f64::max` where neither is NaN.
#[inline(always)]
fn greater(a: &Line, b: &Line) -> Line {
    each(|l| if b[l] > a[l] { b[l] } else { a[l] })
}

/// What a step is measured by: the magnitude of its unknown, its own, or the least number.
#[inline(always)]
fn scale(size: &Line, step: &Line) -> Line {
    each(|l| {
        let most = if step[l] > size[l] { step[l] } else { size[l] };
        if most > f64::MIN_POSITIVE { most } else { f64::MIN_POSITIVE }
    })
}

impl Space {
    /// Which lanes have come to their solution, which is left in `found`.
    #[inline(always)]
    fn solve(&mut self, group: &Group, used: [bool; LANES]) -> [bool; LANES] {
        let n = group.size;
        let mut good = truth(|l| used[l]);
        for (i, kept) in self.memories[self.memory].kept[..n].iter().enumerate() {
            self.x[i] = *kept;
            self.size[i] = each(|l| kept[l].abs());
        }
        let mut solved = [false; LANES];
        self.evaluate(group, false);
        for iteration in 0..ITERATIONS {
            let residual = self.residual(group);
            let mut there = truth(|l| (good[l] != 0.0) & (residual[l] == 0.0));
            if there.contains(&1.0) {
                good = each(|l| if there[l] != 0.0 { 0.0 } else { good[l] });
                if iteration > 0 {
                    self.goes_on(group, iteration - 1, &mut there);
                }
                self.keep(group, &mut there);
                (0..LANES).for_each(|l| solved[l] |= there[l] != 0.0);
                if !good.contains(&1.0) {
                    break;
                }
            }
            self.factor(group, &mut good);
            self.right(group);
            if iteration == 0 {
                self.opening[..n].copy_from_slice(&self.next[..n]);
            }
            self.back(group);
            self.step[..n].copy_from_slice(&self.next[..n]);
            if iteration == 0 {
                self.lead[..n].copy_from_slice(&self.next[..n]);
            }
            let mut size = NONE;
            for i in 0..n {
                let step = each(|l| self.step[i][l].abs());
                let scale = scale(&self.size[i], &step);
                good = each(|l| if step[l] < f64::INFINITY { good[l] } else { 0.0 });
                if iteration == 0 {
                    // What rests is measured otherwise.
                    good = each(|l| if (step[l] == 0.0) & (self.size[i][l] == 0.0) { 0.0 } else { good[l] });
                }
                size = greater(&size, &each(|l| step[l] / scale[l]));
            }
            self.evaluate(group, true);
            self.right(group);
            self.back(group);
            let mut next = NONE;
            for i in 0..n {
                let (step, after) = (each(|l| self.step[i][l].abs()), each(|l| self.next[i][l].abs()));
                let scale = scale(&self.size[i], &step);
                good = each(|l| if after[l] < f64::INFINITY { good[l] } else { 0.0 });
                next = greater(&next, &each(|l| after[l] / scale[l]));
            }
            let shrinks = truth(|l| (next[l] <= 0.75 * size[l]) | (size[l] <= 2.0 * f64::EPSILON));
            let near = truth(|l| (next[l] <= CONTRACTION * size[l]) | (size[l] <= CLOSE_TO_ROUNDING));
            let finished = truth(|l| (near[l] != 0.0) & (next[l] * next[l] <= CONVERGED * size[l]));
            let done = truth(|l| (finished[l] != 0.0) | (size[l] <= 4.0 * f64::EPSILON));
            good = each(|l| good[l] * shrinks[l]);
            if iteration == 0 {
                // A first step that leaves much to do is no usual one.
                good = each(|l| good[l] * near[l]);
            }
            for i in 0..n {
                let trial = each(|l| self.x[i][l] + self.step[i][l]);
                let moved = each(|l| if finished[l] != 0.0 { trial[l] + self.next[i][l] } else { trial[l] });
                let size = greater(&self.size[i], &each(|l| trial[l].abs()));
                self.size[i] = greater(&size, &each(|l| moved[l].abs()));
                self.x[i] = moved;
            }
            let mut there = each(|l| good[l] * done[l]);
            if there.contains(&1.0) {
                self.goes_on(group, iteration, &mut there);
                self.keep(group, &mut there);
                (0..LANES).for_each(|l| solved[l] |= there[l] != 0.0);
                good = each(|l| if done[l] != 0.0 { 0.0 } else { good[l] });
            }
            if !good.contains(&1.0) {
                break;
            }
        }
        solved
    }

    /// Takes note of the lanes that are where they should be, if all is finite there.
    #[inline(always)]
    fn keep(&mut self, group: &Group, there: &mut Line) {
        for &slot in &group.packed.outputs {
            let value = &self.registers.r[slot as usize];
            *there = each(|l| if value[l].abs() < f64::INFINITY { there[l] } else { 0.0 });
        }
        for (found, x) in self.found.iter_mut().zip(&self.x[..group.size]) {
            *found = each(|l| if there[l] != 0.0 { x[l] } else { found[l] });
        }
        for (jacobian, &slot) in self.jacobian.iter_mut().zip(&group.packed.outputs[..group.entries.len()]) {
            let value = &self.registers.r[slot as usize];
            *jacobian = each(|l| if there[l] != 0.0 { value[l] } else { jacobian[l] });
        }
    }

    /// Runs the inner code at `x`, or a step from there.
    #[inline(always)]
    fn evaluate(&mut self, group: &Group, trial: bool) {
        for i in 0..group.size {
            self.registers.r[i] = match trial {
                true => each(|l| self.x[i][l] + self.step[i][l]),
                false => self.x[i],
            };
        }
        let mut nobody: [Frame; 0] = [];
        self.registers.all(&[], &group.packed, &mut nobody, &mut [true; LANES]);
    }

    /// Greatest residual.
    #[inline(always)]
    fn residual(&self, group: &Group) -> Line {
        let slots = &group.packed.outputs[group.entries.len()..];
        slots.iter().fold(NONE, |most, &slot| {
            let value = &self.registers.r[slot as usize];
            greater(&most, &each(|l| value[l].abs()))
        })
    }

    /// Puts the right-hand side of the Newton step into `next`.
    #[inline(always)]
    fn right(&mut self, group: &Group) {
        let slots = &group.packed.outputs[group.entries.len()..];
        for (next, &slot) in self.next.iter_mut().zip(slots) {
            let value = &self.registers.r[slot as usize];
            *next = each(|l| 0.0 - value[l]);
        }
    }

    /// Factors the matrix, as `Lu` does; `good` loses those that are not definite.
    #[inline(always)]
    fn factor(&mut self, group: &Group, good: &mut Line) {
        let n = group.size;
        let entry =
            |this: &Self, e: Option<usize>| e.map_or(NONE, |e| this.registers.r[group.packed.outputs[e] as usize]);
        if n == 1 {
            let a = entry(self, group.rows[0].diagonal);
            let size = each(|l| a[l].abs());
            let weight = each(|l| size[l] / if size[l] > f64::MIN_POSITIVE { size[l] } else { f64::MIN_POSITIVE });
            *good = each(|l| {
                let stands = (weight[l] > f64::EPSILON) & (weight[l] < f64::INFINITY);
                if stands { good[l] } else { 0.0 }
            });
            self.inverse[0] = a;
            return;
        }
        for (i, row) in group.rows.iter().enumerate() {
            self.inverse[i] = entry(self, row.diagonal);
            for (upper, &(_, e)) in self.upper[row.start..].iter_mut().zip(&row.right) {
                *upper = e.map_or(NONE, |e| self.registers.r[group.packed.outputs[e] as usize]);
            }
        }
        let first = self.inverse[0];
        let sign = each(|l| 1f64.copysign(first[l]));
        let least = f64::EPSILON * n as f64;
        for (k, row) in group.rows.iter().enumerate() {
            let (pivot, diagonal) = (self.inverse[k], entry(self, row.diagonal));
            *good = each(|l| {
                let (size, entry) = (sign[l] * pivot[l], sign[l] * diagonal[l]);
                let stands = (size > 0.0) & (size > least * entry) & (size < f64::INFINITY);
                if stands { good[l] } else { 0.0 }
            });
            let inverse = each(|l| 1.0 / pivot[l]);
            for (a, (&(i, _), below)) in row.right.iter().zip(&row.below).enumerate() {
                let u = self.upper[row.start + a];
                let factor = each(|l| u[l] * inverse[l]);
                self.inverse[i] = each(|l| self.inverse[i][l] - factor[l] * u[l]);
                for (&at, other) in below.iter().zip(row.start + a + 1..) {
                    let other = self.upper[other];
                    self.upper[at] = each(|l| self.upper[at][l] - factor[l] * other[l]);
                }
            }
            for u in &mut self.upper[row.start..][..row.right.len()] {
                *u = each(|l| u[l] * inverse[l]);
            }
            self.inverse[k] = inverse;
        }
    }

    /// Replaces `next` by the solution.
    #[inline(always)]
    fn back(&mut self, group: &Group) {
        let n = group.size;
        if n == 1 {
            self.next[0] = each(|l| self.next[0][l] / self.inverse[0][l]);
            return;
        }
        self.next[..n].iter_mut().for_each(|b| *b = each(|l| b[l] + 0.0));
        for (k, row) in group.rows.iter().enumerate() {
            let done = self.next[k];
            for (u, &(j, _)) in self.upper[row.start..].iter().zip(&row.right) {
                self.next[j] = each(|l| self.next[j][l] - u[l] * done[l]);
            }
        }
        for (next, inverse) in self.next[..n].iter_mut().zip(&self.inverse) {
            *next = each(|l| next[l] * inverse[l] + 0.0);
        }
        // What an unknown takes off those before it, from the last one on.
        for (k, row) in group.rows.iter().enumerate().rev() {
            let mut value = self.next[k];
            for (u, &(j, _)) in self.upper[row.start..][..row.right.len()].iter().zip(&row.right).rev() {
                let done = &self.next[j];
                value = each(|l| value[l] - u[l] * done[l]);
            }
            self.next[k] = value;
        }
    }

    /// Whether each solution is without doubt the one that goes on from where the lane began; `last` iteration.
    #[inline(always)]
    fn goes_on(&mut self, group: &Group, last: usize, good: &mut Line) {
        let n = group.size;
        let mut most = wide::Line([CLOSE_TO_ROUNDING; LANES]);
        let mut off = NONE;
        for i in 0..n {
            let lead = each(|l| self.lead[i][l].abs());
            let scale = scale(&self.size[i], &lead);
            most = greater(&most, &each(|l| lead[l] / scale[l]));
            let kept = &self.memories[self.memory].kept[i];
            self.next[i] = each(|l| self.x[i][l] - kept[l]);
        }
        self.widen(n, &mut off, good);
        // With the first Jacobian it would be the first step again.
        if last > 0 {
            self.next[..n].copy_from_slice(&self.opening[..n]);
            self.back(group);
            self.widen(n, &mut off, good);
        }
        self.next[..n].fill(wide::Line([-0.0; LANES]));
        for (base, &place) in self.memories[self.memory].base.iter().zip(&group.entries) {
            let (row, column) = (place as usize / n, place as usize % n);
            let lead = &self.lead[column];
            self.next[row] = each(|l| self.next[row][l] + base[l] * lead[l]);
        }
        self.back(group);
        self.widen(n, &mut off, good);
        *good = each(|l| if off[l] <= 0.5 * most[l] { good[l] } else { 0.0 });
    }

    /// How far `next` is from the first step; `good` loses those of which nobody knows.
    #[inline(always)]
    fn widen(&self, n: usize, off: &mut Line, good: &mut Line) {
        for i in 0..n {
            let lead = &self.lead[i];
            let scale = scale(&self.size[i], &each(|l| lead[l].abs()));
            let away = each(|l| (self.next[i][l] - lead[l]).abs() / scale[l]);
            *good = each(|l| if away[l] < f64::INFINITY { good[l] } else { 0.0 });
            *off = greater(off, &away);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use halfarrow_compiler::bond_graph::NoFiles;
    use halfarrow_compiler::compile::{Text, compile};
    use halfarrow_compiler::equations::Form;
    use std::sync::Arc;

    /// A ladder of resistors with a compliance in every so manieth section.
    fn mesh(sections: usize, every: usize, law: &str) -> Program {
        let mut text = String::from("model Mesh\nparam g = 1, c = 0.1\ninput u = 1\nSe:source(u) -> 1:s0\n");
        for k in 1..=sections {
            let from = if k == 1 { "s0".to_string() } else { format!("n{} -> 1:s{k}", k - 1) };
            let to = if k == 1 { "s0".to_string() } else { format!("s{k}") };
            text += &format!("{from} -> R:R{k}({law})\n{to} -> 0:n{k} -> R:G{k}({law})\n");
            if k % every == 0 {
                text += &format!("n{k} -> C:C{k}(c)\n");
            }
        }
        let text = Text { name: "mesh.bond", text: &text, files: &NoFiles, overrides: &[] };
        compile(text, Form::Minimal).unwrap_or_else(|found| panic!("{}", found.render(false))).ir
    }

    fn frame(program: &Program, layout: &Layout, routine: &Routine, abreast: Option<&Abreast>) -> Frame {
        let preamble = layout.preamble(program);
        let mut frame = Frame::new(program, layout, layout.size);
        frame.reserve(routine);
        frame.reserve(&preamble);
        abreast.into_iter().for_each(|a| frame.reserve_abreast(a));
        frame.run(&preamble).unwrap();
        frame.r[layout.inputs as usize] = 1.0;
        frame
    }

    /// Along states that move by more and by less; how many blocks have been solved on lanes.
    fn same_bits(program: &Program) -> usize {
        let layout = Layout::new(program, &[]);
        let wanted: Vec<_> = program.states.iter().map(|s| s.rate).collect();
        let routine = layout.watched_routine(program, &wanted);
        let abreast = Arc::new(Abreast::of(program, &layout, &routine).expect("blocks of one shape"));
        let mut alone = frame(program, &layout, &routine, None);
        let mut together = frame(program, &layout, &routine, Some(&abreast));
        let n = program.states.len();
        let (mut seed, mut on_lanes) = (1.0f64, 0);
        let mut x = vec![0.0; n];
        for turn in 0..60 {
            let reach = [0.0, 1e-9, 1e-4, 1e-2, 0.1][turn % 5];
            for x in &mut x {
                seed = (seed * 16807.0) % 2147483647.0;
                *x += reach * (seed / 2147483647.0 - 0.4);
            }
            for frame in [&mut alone, &mut together] {
                frame.r[layout.states as usize..][..n].copy_from_slice(&x);
            }
            let versions: Vec<bool> = together.solvers.iter().map(|s| s.newton.following).collect();
            together.begin(Some(&abreast));
            together.solvers.iter_mut().for_each(|s| s.newton.evaluations = usize::MAX);
            let (a, b) = (alone.run(&routine), together.run(&routine));
            assert_eq!(a, b, "turn {turn}");
            if a.is_err() {
                continue;
            }
            let untouched = |(s, f): (&Solver, &bool)| s.newton.evaluations == usize::MAX && *f;
            on_lanes += together.solvers.iter().zip(&versions).filter(|p| untouched((p.0, p.1))).count();
            for &out in &routine.outputs {
                let (a, b) = (alone.r[out as usize], together.r[out as usize]);
                assert_eq!(a.to_bits(), b.to_bits(), "turn {turn}: {a} and {b}");
            }
            for (a, b) in alone.solvers.iter_mut().zip(&mut together.solvers) {
                assert_eq!(a.newton.x, b.newton.x, "turn {turn}");
                assert_eq!(a.newton.jacobian, b.newton.jacobian, "turn {turn}");
                if turn % 3 != 2 {
                    a.newton.accept();
                    b.newton.accept();
                }
            }
        }
        on_lanes
    }

    #[test]
    fn blocks_side_by_side_have_the_bits_of_single_ones() {
        // Blocks of one, four and nine unknowns; more blocks than lanes, and fewer.
        for (sections, every, law, least) in [
            (60, 2, "f = g*(e + e^3)", 1000),
            (50, 5, "f = g*(e + e^3)", 300),
            (80, 10, "f = g*(e + e^3)", 200),
            (40, 5, "f = g*sinh(2*e)", 200),
            (30, 3, "f = g*(exp(e) - 1)", 200),
        ] {
            let on_lanes = same_bits(&mesh(sections, every, law));
            assert!(on_lanes >= least, "{sections} {every} {law}: {on_lanes}");
        }
    }
}
