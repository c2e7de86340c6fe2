//! SIMD batches of Newton blocks of one shape: each lane solves one of them.
//!
//! This is the fast path of [`newton`](super::newton): a solution is followed, every step is undamped, the Jacobian is
//! symmetric and definite. It takes the same operations in the same order, hence gives the same bits. A block that needs
//! anything else is left to the solver of single blocks.

use super::elimination::{BatchFactors, UpperPattern};
use super::frame::{Frame, Solver};
use super::instruction::{Register, Routine, Solve};
use super::newton::{CLOSE_TO_ROUNDING, CONTRACTION, CONVERGED, LEAST_CORRECTION};
use super::packed::Packed;
use super::registers::Layout;
use super::wide::{self, WideFrame};
use halfarrow_compiler::program::{self, Arg, Code, Method, Program, Step};
use halfarrow_compiler::sparse::Pattern;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Blocks that are solved at once: as many as it takes to keep the processor busy, since each step of an elimination
/// waits for the one before.
const LANES: usize = 16;
type Vector = wide::Vector<LANES>;

/// Iterations at most.
const ITERATIONS: usize = 8;
/// Evaluations of a block at most.
const EVALUATIONS: usize = ITERATIONS + 1;
/// Blocks of more unknowns are solved one at a time.
const LARGEST: usize = 32;
/// Fewer blocks are solved one at a time.
const FEWEST: usize = 3;

/// The blocks of a routine that are solved in batches.
#[derive(Debug, Default)]
pub(crate) struct BlockBatches {
    groups: Vec<BlockGroup>,
    /// The group of each block that has one.
    of: BTreeMap<u32, usize>,
}

/// Blocks of one shape, of which none reads the solution of another; all that they read is known before the first.
#[derive(Debug)]
struct BlockGroup {
    /// Number of unknowns.
    size: usize,
    members: Vec<Member>,
    /// Which of the [`FollowedLanes`] the first lanes have.
    first: usize,
    /// The inner code of all of them: guesses, then what is read from outside, then what is computed.
    packed: Packed,
    /// Where the entries of the matrix stand, which are the first outputs; residuals follow.
    pattern: Arc<Pattern>,
    rows: UpperPattern,
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
struct BlockShape {
    size: usize,
    /// The code, with inputs for all that it reads from outside.
    code: Code,
    pattern: Arc<Pattern>,
}

impl BlockBatches {
    /// The groups of a routine; `None` if there are none.
    pub fn of(program: &Program, layout: &Layout, routine: &Routine) -> Option<BlockBatches> {
        let mut defined_at = vec![0; routine.source.values.len()];
        let mut solves = routine.solves.iter();
        // Shape, position of the first and members.
        let mut open: Vec<(BlockShape, usize, Vec<Member>)> = Vec::new();
        for (at, step) in routine.source.steps.iter().enumerate() {
            step.defines().iter().for_each(|out| defined_at[out.0 as usize] = at);
            let Step::Solve(solve) = step else { continue };
            let there = solves.next().expect("as many solve blocks on registers");
            let Method::Newton { outer, .. } = &solve.method else { continue };
            let Some((shape, read)) = BlockShape::of(program, solve) else { continue };
            let known = |a: &Arg| if let Arg::Local(local) = a { Some(defined_at[local.0 as usize]) } else { None };
            let last = outer.iter().filter_map(known).max();
            let place = |a: Arg| match a {
                Arg::Given(value) => layout.registers[value],
                Arg::Outer(i) => there.outer[i as usize],
                Arg::Local(_) | Arg::Guess(_) => unreachable!("these stand inside"),
            };
            let member = Member {
                block: solve.block.0 as usize,
                inputs: read.iter().map(|&a| place(a)).collect(),
                outer: there.outer.clone(),
            };
            let alike = |(other, since, _): &&mut (BlockShape, usize, Vec<Member>)| {
                other.is(&shape) && last.is_none_or(|last| last < *since)
            };
            match open.iter_mut().rev().find(alike) {
                Some((_, _, members)) => members.push(member),
                None => open.push((shape, at, vec![member])),
            }
        }
        let mut first = 0;
        let together = open.into_iter().filter(|(_, _, members)| members.len() >= FEWEST);
        let groups: Vec<BlockGroup> = together
            .map(|(shape, _, members)| {
                let lanes = members.len().div_ceil(LANES);
                first += lanes;
                BlockGroup::of(shape, members, first - lanes)
            })
            .collect();
        let members = groups.iter().enumerate().flat_map(|(g, group)| group.members.iter().map(move |m| (m, g)));
        let of: BTreeMap<u32, usize> = members.map(|(member, g)| (member.block as u32, g)).collect();
        (!groups.is_empty()).then_some(BlockBatches { groups, of })
    }
}

impl BlockShape {
    /// The shape, and what the block reads from outside, in the order of the inputs; `None` if the block may take another
    /// way than the usual one, whatever its values.
    fn of(program: &Program, solve: &program::Solve) -> Option<(BlockShape, Vec<Arg>)> {
        let Method::Newton { code, .. } = &solve.method else { return None };
        let size = solve.unknowns.len();
        let symmetric = size == 1 || program.blocks[solve.block].is_symmetric();
        let conditions = code.steps.iter().any(|step| matches!(step, Step::Op { op, .. } if op.is_held()));
        let positions = program.positions.iter().any(|p| p.block == solve.block);
        if positions
            || !symmetric
            || size > LARGEST
            || program.blocks[solve.block].matrix().factors.is_some()
            || conditions
        {
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
        let outputs = matrix.iter().chain(right).map(|&a| named(a)).collect();
        let code = Code { steps, outputs, values: vec![None; code.values.len()] };
        Some((BlockShape { size, code, pattern: Arc::clone(&solve.pattern) }, read))
    }

    fn is(&self, other: &BlockShape) -> bool {
        self.size == other.size && self.pattern == other.pattern && self.code == other.code
    }
}

impl BlockGroup {
    fn of(shape: BlockShape, members: Vec<Member>, first: usize) -> BlockGroup {
        let n = shape.size;
        let fixed = (n + members[0].inputs.len()) as u32;
        let slot = |a: Arg| match a {
            Arg::Guess(i) => i,
            Arg::Outer(i) => n as u32 + i,
            Arg::Local(local) => fixed + local.0,
            Arg::Given(_) => unreachable!("inputs stand for what is given"),
        };
        let packed = Packed::of(&shape.code, fixed, &[], slot);
        let rows = UpperPattern::of(&shape.pattern);
        BlockGroup { size: n, members, first, packed, pattern: shape.pattern, rows }
    }
}

/// The previous solutions of lanes, and the entries of the Jacobian there.
#[derive(Debug, Clone, Default)]
struct FollowedLanes {
    /// The blocks, and the versions of their previous solutions that these are.
    of: [(usize, u64); LANES],
    start: Vec<Vector>,
    start_jacobian: Vec<Vector>,
}

/// Workspace: one number for each lane in every place.
#[derive(Debug, Clone, Default)]
pub(crate) struct BatchWorkspace {
    registers: WideFrame<LANES>,
    /// The solutions that lanes follow, one set for each batch of a group.
    followed_lanes: Vec<FollowedLanes>,
    /// Which of them is in use.
    lanes_in_use: usize,
    x: Vec<Vector>,
    scale: Vec<Vector>,
    weight: Vec<Vector>,
    first_weight: Vec<Vector>,
    correction: Vec<Vector>,
    simplified: Vec<Vector>,
    first_correction: Vec<Vector>,
    first_right: Vec<Vector>,
    factors: BatchFactors<LANES>,
    /// Solutions, and the entries of the Jacobian there.
    found: Vec<Vector>,
    jacobian: Vec<Vector>,
    /// The turn in which each group was tried last.
    tried: Vec<u64>,
    /// Evaluations of routines so far.
    pub turn: u64,
}

impl BatchWorkspace {
    /// Makes room for the groups of a routine.
    pub fn reserve(&mut self, batches: &BlockBatches) {
        let most = |of: &dyn Fn(&BlockGroup) -> usize| batches.groups.iter().map(of).max().unwrap_or(0);
        let (n, entries) = (most(&|g| g.size), most(&|g| g.pattern.len()));
        self.registers.reserve(most(&|g| g.packed.slots.max(g.size + g.members[0].inputs.len())));
        for vector in [
            &mut self.x,
            &mut self.scale,
            &mut self.weight,
            &mut self.first_weight,
            &mut self.correction,
            &mut self.simplified,
            &mut self.first_correction,
            &mut self.first_right,
            &mut self.found,
        ] {
            vector.resize(vector.len().max(n), Vector::default());
        }
        batches.groups.iter().for_each(|group| self.factors.reserve(&group.rows));
        self.jacobian.resize(self.jacobian.len().max(entries), Vector::default());
        self.tried.resize(self.tried.len().max(batches.groups.len()), 0);
        let followed_lanes = most(&|g| g.first + g.members.len().div_ceil(LANES));
        self.followed_lanes.resize(self.followed_lanes.len().max(followed_lanes), FollowedLanes::default());
        for memory in &mut self.followed_lanes {
            memory.start.resize(memory.start.len().max(n), Vector::default());
            memory.start_jacobian.resize(memory.start_jacobian.len().max(entries), Vector::default());
        }
    }
}

impl Frame {
    /// Solves the group of a block, if it has one that has not been tried in this turn.
    pub(super) fn solve_batch(&mut self, solve: &Solve) {
        let Some(batches) = &self.batches else { return };
        let Some(&number) = batches.of.get(&solve.block.0) else { return };
        if std::mem::replace(&mut self.workspace.tried[number], self.workspace.turn) == self.workspace.turn {
            return;
        }
        let batches = batches.clone();
        let group = &batches.groups[number];
        let arch = pulp::Arch::new();
        let Frame { r, solvers, workspace, .. } = self;
        for (members, memory) in group.members.chunks(LANES).zip(group.first..) {
            let follows = |m: &Member| {
                let newton = &solvers[m.block].newton;
                let rests = newton.rests(m.outer.iter().map(|&outer| r[outer as usize]));
                newton.following && newton.evaluation_limit / 4 > EVALUATIONS && !rests
            };
            if members.iter().filter(|m| follows(m)).count() < FEWEST {
                continue;
            }
            let mut good: [bool; LANES] = std::array::from_fn(|l| members.get(l).is_some_and(follows));
            workspace.lanes_in_use = memory;
            workspace.gather(group, members, r, solvers);
            arch.dispatch(FastPath { workspace, group, good: &mut good });
            workspace.scatter(group, members, r, solvers, &good);
        }
    }
}

impl BatchWorkspace {
    /// Gathers what the blocks read, and their previous solutions; lanes without a block do as the first.
    fn gather(&mut self, group: &BlockGroup, members: &[Member], r: &[f64], solvers: &[Solver]) {
        let n = group.size;
        for lane in 0..LANES {
            let member = members.get(lane).unwrap_or(&members[0]);
            let newton = &solvers[member.block].newton;
            for (place, &input) in member.inputs.iter().enumerate() {
                self.registers.r[n + place][lane] = r[input as usize];
            }
            let memory = &mut self.followed_lanes[self.lanes_in_use];
            let present = (member.block, newton.version);
            if memory.of[lane] != present {
                memory.of[lane] = present;
                (0..n).for_each(|i| memory.start[i][lane] = newton.previous[i]);
                for (entry, &previous) in memory.start_jacobian.iter_mut().zip(&newton.previous_jacobian) {
                    entry[lane] = previous;
                }
            }
        }
    }

    /// Scatters the solutions found to their blocks.
    fn scatter(&self, group: &BlockGroup, members: &[Member], r: &[f64], solvers: &mut [Solver], good: &[bool; LANES]) {
        let n = group.size;
        for (lane, member) in members.iter().enumerate().filter(|(lane, _)| good[*lane]) {
            let newton = &mut solvers[member.block].newton;
            (0..n).for_each(|i| newton.x[i] = self.found[i][lane]);
            for (own, jacobian) in newton.jacobian.iter_mut().zip(&self.jacobian) {
                *own = jacobian[lane];
            }
            newton.outer.iter_mut().zip(&member.outer).for_each(|(value, &outer)| *value = r[outer as usize]);
            newton.fresh = true;
        }
    }
}

/// The fast path, to be compiled for the SIMD vectors of the machine.
struct FastPath<'a> {
    workspace: &'a mut BatchWorkspace,
    group: &'a BlockGroup,
    good: &'a mut [bool; LANES],
}

impl pulp::WithSimd for FastPath<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        *self.good = self.workspace.solve(self.group, *self.good);
    }
}

const NONE: Vector = wide::Vector([0.0; LANES]);

#[inline(always)]
fn each(value: impl Fn(usize) -> f64) -> Vector {
    wide::Vector(std::array::from_fn(value))
}

/// 1 where something holds, 0 elsewhere: truth values that stay in the vectors of the machine.
#[inline(always)]
fn truth(holds: impl Fn(usize) -> bool) -> Vector {
    each(|l| if holds(l) { 1.0 } else { 0.0 })
}

/// The greater one; as `f64::max` where neither is NaN.
#[inline(always)]
fn greater(a: &Vector, b: &Vector) -> Vector {
    each(|l| if b[l] > a[l] { b[l] } else { a[l] })
}

/// The inverse of what a correction is scaled by: the magnitude of its unknown, its own, or the least number.
#[inline(always)]
fn weight(size: &Vector, step: &Vector) -> Vector {
    each(|l| {
        let most = if step[l] > size[l] { step[l] } else { size[l] };
        1.0 / if most > f64::MIN_POSITIVE { most } else { f64::MIN_POSITIVE }
    })
}

impl BatchWorkspace {
    /// Which lanes have converged; their solutions are left in `found`.
    #[inline(always)]
    fn solve(&mut self, group: &BlockGroup, used: [bool; LANES]) -> [bool; LANES] {
        let n = group.size;
        let mut good = truth(|l| used[l]);
        for (i, start) in self.followed_lanes[self.lanes_in_use].start[..n].iter().enumerate() {
            self.x[i] = *start;
            self.scale[i] = each(|l| start[l].abs());
        }
        let mut solved = [false; LANES];
        self.evaluate(group, false);
        for iteration in 0..ITERATIONS {
            let residual = self.residual(group);
            let mut there = truth(|l| (good[l] != 0.0) & (residual[l] == 0.0));
            if there.contains(&1.0) {
                good = each(|l| if there[l] != 0.0 { 0.0 } else { good[l] });
                if iteration > 0 {
                    self.is_continuation(group, iteration - 1, &mut there);
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
                self.first_right[..n].copy_from_slice(&self.simplified[..n]);
            }
            self.back(group);
            self.correction[..n].copy_from_slice(&self.simplified[..n]);
            if iteration == 0 {
                self.first_correction[..n].copy_from_slice(&self.simplified[..n]);
            }
            let mut size = NONE;
            for i in 0..n {
                let step = each(|l| self.correction[i][l].abs());
                let weight = weight(&self.scale[i], &step);
                self.weight[i] = weight;
                good = each(|l| if step[l] < f64::INFINITY { good[l] } else { 0.0 });
                if iteration == 0 {
                    // What rests is measured otherwise.
                    good = each(|l| if (step[l] == 0.0) & (self.scale[i][l] == 0.0) { 0.0 } else { good[l] });
                }
                size = greater(&size, &each(|l| step[l] * weight[l]));
            }
            let mut there = each(|l| if size[l] <= LEAST_CORRECTION { good[l] } else { 0.0 });
            if there.contains(&1.0) {
                good = each(|l| if there[l] != 0.0 { 0.0 } else { good[l] });
                self.add_correction(n, &there);
                if iteration > 0 {
                    self.is_continuation(group, iteration, &mut there);
                }
                self.keep(group, &mut there);
                (0..LANES).for_each(|l| solved[l] |= there[l] != 0.0);
                if !good.contains(&1.0) {
                    break;
                }
            }
            self.evaluate(group, true);
            self.right(group);
            self.back(group);
            let mut next = NONE;
            for i in 0..n {
                let (after, weight) = (each(|l| self.simplified[i][l].abs()), &self.weight[i]);
                good = each(|l| if after[l] < f64::INFINITY { good[l] } else { 0.0 });
                next = greater(&next, &each(|l| after[l] * weight[l]));
            }
            let shrinks = truth(|l| next[l] <= 0.75 * size[l]);
            let near = truth(|l| (next[l] <= CONTRACTION * size[l]) | (size[l] <= CLOSE_TO_ROUNDING));
            let finished = truth(|l| (near[l] != 0.0) & (next[l] * next[l] <= CONVERGED * size[l]));
            good = each(|l| good[l] * shrinks[l]);
            if iteration == 0 {
                // A first step that does not contract is not for the fast path.
                good = each(|l| good[l] * near[l]);
            }
            for i in 0..n {
                let trial = each(|l| self.x[i][l] + self.correction[i][l]);
                let moved = each(|l| if finished[l] != 0.0 { trial[l] + self.simplified[i][l] } else { trial[l] });
                let size = greater(&self.scale[i], &each(|l| trial[l].abs()));
                self.scale[i] = greater(&size, &each(|l| moved[l].abs()));
                self.x[i] = moved;
            }
            let mut there = each(|l| good[l] * finished[l]);
            if there.contains(&1.0) {
                self.is_continuation(group, iteration, &mut there);
                self.keep(group, &mut there);
                (0..LANES).for_each(|l| solved[l] |= there[l] != 0.0);
                good = each(|l| if finished[l] != 0.0 { 0.0 } else { good[l] });
            }
            if !good.contains(&1.0) {
                break;
            }
        }
        solved
    }

    /// Goes on by the correction, in these lanes.
    #[inline(always)]
    fn add_correction(&mut self, n: usize, there: &Vector) {
        for i in 0..n {
            let moved = each(|l| if there[l] != 0.0 { self.x[i][l] + self.correction[i][l] } else { self.x[i][l] });
            self.scale[i] = greater(&self.scale[i], &each(|l| moved[l].abs()));
            self.x[i] = moved;
        }
    }

    /// Keeps the solutions of the lanes that have converged, if all is finite there.
    #[inline(always)]
    fn keep(&mut self, group: &BlockGroup, there: &mut Vector) {
        for &slot in &group.packed.outputs {
            let value = &self.registers.r[slot as usize];
            *there = each(|l| if value[l].abs() < f64::INFINITY { there[l] } else { 0.0 });
        }
        for (found, x) in self.found.iter_mut().zip(&self.x[..group.size]) {
            *found = each(|l| if there[l] != 0.0 { x[l] } else { found[l] });
        }
        for (jacobian, &slot) in self.jacobian.iter_mut().zip(&group.packed.outputs[..group.pattern.len()]) {
            let value = &self.registers.r[slot as usize];
            *jacobian = each(|l| if there[l] != 0.0 { value[l] } else { jacobian[l] });
        }
    }

    /// Runs the inner code at `x`, or a correction from there.
    #[inline(always)]
    fn evaluate(&mut self, group: &BlockGroup, trial: bool) {
        for i in 0..group.size {
            self.registers.r[i] = match trial {
                true => each(|l| self.x[i][l] + self.correction[i][l]),
                false => self.x[i],
            };
        }
        let mut nobody: [Frame; 0] = [];
        self.registers.all(&[], &group.packed, &mut nobody, &mut [true; LANES]);
    }

    /// Greatest residual.
    #[inline(always)]
    fn residual(&self, group: &BlockGroup) -> Vector {
        let slots = &group.packed.outputs[group.pattern.len()..];
        slots.iter().fold(NONE, |most, &slot| {
            let value = &self.registers.r[slot as usize];
            greater(&most, &each(|l| value[l].abs()))
        })
    }

    /// Puts the right-hand side of the correction into `simplified`.
    #[inline(always)]
    fn right(&mut self, group: &BlockGroup) {
        let slots = &group.packed.outputs[group.pattern.len()..];
        for (next, &slot) in self.simplified.iter_mut().zip(slots) {
            let value = &self.registers.r[slot as usize];
            *next = each(|l| 0.0 - value[l]);
        }
    }

    /// Factors the matrix; `good` loses those that are not definite.
    #[inline(always)]
    fn factor(&mut self, group: &BlockGroup, good: &mut Vector) {
        let BatchWorkspace { factors, registers, .. } = self;
        factors.factor(&group.rows, |e| registers.r[group.packed.outputs[e] as usize], good);
    }

    /// Replaces `simplified` by the solution.
    #[inline(always)]
    fn back(&mut self, group: &BlockGroup) {
        self.factors.solve(&group.rows, &mut self.simplified);
    }

    /// Whether each solution is without doubt the continuation of the previous one; `last` iteration.
    #[inline(always)]
    fn is_continuation(&mut self, group: &BlockGroup, last: usize, good: &mut Vector) {
        let n = group.size;
        let mut most = wide::Vector([CLOSE_TO_ROUNDING; LANES]);
        let mut off = NONE;
        for i in 0..n {
            let first = each(|l| self.first_correction[i][l].abs());
            let weight = weight(&self.scale[i], &first);
            self.first_weight[i] = weight;
            most = greater(&most, &each(|l| first[l] * weight[l]));
            let start = &self.followed_lanes[self.lanes_in_use].start[i];
            self.simplified[i] = each(|l| self.x[i][l] - start[l]);
        }
        self.widen_distance(n, &mut off, good);
        // With the first Jacobian it would be the first correction again.
        if last > 0 {
            self.simplified[..n].copy_from_slice(&self.first_right[..n]);
            self.back(group);
            self.widen_distance(n, &mut off, good);
        }
        self.simplified[..n].fill(wide::Vector([-0.0; LANES]));
        let entries = self.followed_lanes[self.lanes_in_use].start_jacobian.iter();
        for (entry, (row, column)) in entries.zip(group.pattern.places()) {
            let first = &self.first_correction[column];
            self.simplified[row] = each(|l| self.simplified[row][l] + entry[l] * first[l]);
        }
        self.back(group);
        self.widen_distance(n, &mut off, good);
        *good = each(|l| if off[l] <= 0.5 * most[l] { good[l] } else { 0.0 });
    }

    /// Scaled distance of `simplified` from the first correction; `good` loses those where it is not finite.
    #[inline(always)]
    fn widen_distance(&self, n: usize, off: &mut Vector, good: &mut Vector) {
        for i in 0..n {
            let first = &self.first_correction[i];
            let away = each(|l| (self.simplified[i][l] - first[l]).abs() * self.first_weight[i][l]);
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

    /// A ladder of resistors with a compliance in every `every`th section.
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

    fn frame(program: &Program, layout: &Layout, routine: &Routine, batches: Option<&BlockBatches>) -> Frame {
        let preamble = layout.preamble(program);
        let mut frame = Frame::new(program, layout, layout.size);
        frame.reserve(routine);
        frame.reserve(&preamble);
        batches.into_iter().for_each(|a| frame.reserve_batches(a));
        frame.run(&preamble).unwrap();
        frame.r[layout.inputs as usize] = 1.0;
        frame
    }

    /// Along states that move by more and by less; how many blocks have been solved on lanes.
    fn same_bits(program: &Program) -> usize {
        let layout = Layout::new(program, &[]);
        let wanted: Vec<_> = program.states.iter().map(|s| s.rate).collect();
        let routine = layout.guarded_routine(program, &wanted);
        let batches = Arc::new(BlockBatches::of(program, &layout, &routine).expect("blocks of one shape"));
        let mut alone = frame(program, &layout, &routine, None);
        let mut together = frame(program, &layout, &routine, Some(&batches));
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
            together.begin(Some(&batches));
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
