//! A routine for several sets of parameters at once: each instruction works on a lane for every set.
//!
//! The same operations in the same order as one at a time, hence the same bits. Solve blocks, conditions and tables go
//! through the frame of each lane.

use super::frame::Frame;
use super::packed::{Block, Kind, Packed, Run};
use crate::math;
use halfarrow_compiler::program::{ConditionId, Instruction, Routine};

/// What has a frame of its own.
pub(crate) trait Lane {
    /// The frame.
    fn frame(&mut self) -> &mut Frame;
}

/// A number for each lane, in cache lines of its own.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(crate) struct Line<const N: usize>(pub [f64; N]);

impl<const N: usize> Default for Line<N> {
    fn default() -> Line<N> {
        Line([0.0; N])
    }
}

impl<const N: usize> std::ops::Deref for Line<N> {
    type Target = [f64; N];

    #[inline(always)]
    fn deref(&self) -> &[f64; N] {
        &self.0
    }
}

impl<const N: usize> std::ops::DerefMut for Line<N> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [f64; N] {
        &mut self.0
    }
}

/// The registers of all lanes.
#[derive(Debug, Clone, Default)]
pub(crate) struct WideFrame<const N: usize> {
    pub r: Vec<Line<N>>,
    arch: pulp::Arch,
}

/// A routine to be run with the vectors of the machine. A type of its own, not a closure: only then is all of it compiled
/// for them.
struct All<'a, L, const N: usize> {
    registers: &'a mut WideFrame<N>,
    routine: &'a Routine,
    packed: &'a Packed,
    frames: &'a mut [L],
    good: &'a mut [bool; N],
}

impl<L: Lane, const N: usize> pulp::WithSimd for All<'_, L, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        self.registers.all(self.routine, self.packed, self.frames, self.good);
    }
}

impl<const N: usize> WideFrame<N> {
    /// Makes room for a routine.
    pub fn reserve(&mut self, registers: usize) {
        self.r.resize(self.r.len().max(registers), Line::default());
    }

    /// Runs a routine, packed, for all lanes; `good` loses those that run into trouble. The fixed registers have been
    /// filled.
    pub fn run<L: Lane>(&mut self, routine: &Routine, packed: &Packed, frames: &mut [L], good: &mut [bool; N]) {
        // The widest vectors that the machine has; they round as narrow ones do.
        self.arch.dispatch(All { registers: self, routine, packed, frames, good });
    }

    /// The same where the vectors of the machine are in use already.
    #[inline(always)]
    pub(super) fn all<L: Lane>(&mut self, routine: &Routine, packed: &Packed, frames: &mut [L], good: &mut [bool; N]) {
        for run in &packed.runs {
            match run {
                Run::Many(Kind::Add, all) => self.many(all, |a, b| a + b),
                Run::Many(Kind::Sub, all) => self.many(all, |a, b| a - b),
                Run::Many(Kind::Mul, all) => self.many(all, |a, b| a * b),
                Run::Many(Kind::Div, all) => self.many(all, |a, b| a / b),
                Run::Many(Kind::Neg, all) => self.many(all, |a, _| -a),
                Run::Solve(block) => self.solve(routine, block, frames, good),
                Run::One(Instruction::Watch { pivot, scale, .. }) => {
                    let (pivot, scale) = (self.r[*pivot as usize], self.r[*scale as usize]);
                    (0..N).for_each(|l| good[l] &= Frame::stands(pivot[l], scale[l]));
                }
                Run::One(plain) => self.step(plain, frames),
            }
        }
    }

    #[inline(always)]
    fn many(&mut self, all: &[[u32; 3]], value: impl Fn(f64, f64) -> f64) {
        for &[out, a, b] in all {
            let (a, b) = (self.r[a as usize], self.r[b as usize]);
            self.r[out as usize] = Line(std::array::from_fn(|l| value(a[l], b[l])));
        }
    }

    #[inline(never)]
    fn solve<L: Lane>(&mut self, routine: &Routine, block: &Block, frames: &mut [L], good: &mut [bool; N]) {
        for lane in 0..N {
            if !good[lane] {
                continue;
            }
            let frame = frames[lane].frame();
            block.reads.iter().for_each(|&(slot, r)| frame.r[r as usize] = self.r[slot as usize][lane]);
            good[lane] = frame.solve::<false>(&routine.solves[block.solve]).is_ok();
            block.finds.iter().for_each(|&(slot, r)| self.r[slot as usize][lane] = frame.r[r as usize]);
        }
    }

    #[inline(always)]
    fn each(&mut self, out: u32, value: impl Fn(usize) -> f64) {
        self.r[out as usize] = Line(std::array::from_fn(value));
    }

    #[inline(always)]
    fn step<L: Lane>(&mut self, instruction: &Instruction, frames: &mut [L]) {
        use Instruction::*;
        let r = |i: u32| self.r[i as usize].0;
        let truth = f64::from;
        match *instruction {
            Powi { out, a, n } => {
                let a = r(a);
                self.r[out as usize] = Line(powers(a, n));
            }
            Pow { out, a, b } => self.r[out as usize] = Line(math::pow_lanes(&r(a), &r(b))),
            Call { f, out, a } => self.r[out as usize] = Line(math::call_lanes(f, &r(a))),
            Call2 { f, out, a, b } => {
                let (a, b) = (r(a), r(b));
                self.each(out, |l| math::call2(f, a[l], b[l]));
            }
            Positive { out, a } => {
                let a = r(a);
                self.each(out, |l| truth(a[l] > 0.0));
            }
            Side { out, a, condition } | Floor { out, a, condition } => {
                let a = r(a);
                for (lane, frame) in frames.iter_mut().enumerate() {
                    self.r[out as usize][lane] = frame.frame().condition_at(condition, a[lane]);
                }
            }
            And { out, a, b } => {
                let (a, b) = (r(a), r(b));
                self.each(out, |l| truth(a[l] != 0.0 && b[l] != 0.0));
            }
            Or { out, a, b } => {
                let (a, b) = (r(a), r(b));
                self.each(out, |l| truth(a[l] != 0.0 || b[l] != 0.0));
            }
            Not { out, a } => {
                let a = r(a);
                self.each(out, |l| truth(a[l] == 0.0));
            }
            Select { out, c, a, b } => {
                let (c, a, b) = (r(c), r(a), r(b));
                self.each(out, |l| if c[l] != 0.0 { a[l] } else { b[l] });
            }
            Table { out, a, table, piece } => self.table(frames, (out, a), (table, piece), 0),
            TableSlope { out, a, table, piece } => self.table(frames, (out, a), (table, piece), 1),
            TableCurvature { out, a, table, piece } => self.table(frames, (out, a), (table, piece), 2),
            Parameter { .. } => unreachable!("parameters are set lane by lane"),
            Add { .. } | Sub { .. } | Mul { .. } | Div { .. } | Neg { .. } => unreachable!("arithmetic is packed"),
            Solve { .. } | Watch { .. } => unreachable!("solve blocks and watches stand at the top level"),
        }
    }

    /// A table, or its derivative of some order.
    #[inline(never)]
    fn table<L: Lane>(
        &mut self,
        frames: &mut [L],
        (out, a): (u32, u32),
        (table, piece): (u32, Option<ConditionId>),
        order: usize,
    ) {
        let a = self.r[a as usize];
        for (lane, frame) in frames.iter_mut().enumerate() {
            self.r[out as usize][lane] = frame.frame().table_at(a[lane], table, piece)[order];
        }
    }
}

/// [`math::powi`] for each lane.
#[inline(always)]
fn powers<const N: usize>(x: [f64; N], n: u32) -> [f64; N] {
    let (mut result, mut square, mut left) = ([1.0; N], x, n);
    while left > 0 {
        if left & 1 == 1 {
            (0..N).for_each(|l| result[l] *= square[l]);
        }
        (0..N).for_each(|l| square[l] *= square[l]);
        left >>= 1;
    }
    result
}
