//! A routine for a SIMD batch: several sets of parameters at once, one to a lane.
//!
//! The same operations in the same order as one at a time, hence the same bits. Solve blocks, conditions and tables go
//! through the frame of each lane that is good: others may be those of another mode.

use super::frame::Frame;
use super::instruction::{Operation, Routine, Solve};
use super::packed::{Arithmetic, Packed, PackedSolve, PackedStep};
use crate::math;
use halfarrow_compiler::for_each_op;
use halfarrow_compiler::program::{ConditionId, Op};

/// The model of a lane, with its own frame.
pub(crate) trait HasFrame {
    /// The frame.
    fn frame(&mut self) -> &mut Frame;
}

/// A SIMD vector: a number for each lane, aligned to a cache line.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(crate) struct Vector<const N: usize>(pub [f64; N]);

impl<const N: usize> Default for Vector<N> {
    fn default() -> Vector<N> {
        Vector([0.0; N])
    }
}

impl<const N: usize> std::ops::Deref for Vector<N> {
    type Target = [f64; N];

    #[inline(always)]
    fn deref(&self) -> &[f64; N] {
        &self.0
    }
}

impl<const N: usize> std::ops::DerefMut for Vector<N> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [f64; N] {
        &mut self.0
    }
}

/// The registers of all lanes.
#[derive(Debug, Clone, Default)]
pub(crate) struct WideFrame<const N: usize> {
    pub r: Vec<Vector<N>>,
    arch: pulp::Arch,
}

/// A routine to be run with the SIMD vectors of the machine. A type of its own, not a closure: only then is all of it
/// compiled for them.
struct AllLanes<'a, L, const N: usize> {
    registers: &'a mut WideFrame<N>,
    solves: &'a [Solve],
    packed: &'a Packed,
    frames: &'a mut [L],
    good: &'a mut [bool; N],
}

impl<L: HasFrame, const N: usize> pulp::WithSimd for AllLanes<'_, L, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        self.registers.all(self.solves, self.packed, self.frames, self.good);
    }
}

impl<const N: usize> WideFrame<N> {
    /// Makes room for a routine.
    pub fn reserve(&mut self, registers: usize) {
        self.r.resize(self.r.len().max(registers), Vector::default());
    }

    /// Runs a routine, packed, for all lanes; `good` loses those that fail. The fixed registers have been
    /// filled.
    pub fn run<L: HasFrame>(&mut self, routine: &Routine, packed: &Packed, frames: &mut [L], good: &mut [bool; N]) {
        // The widest vectors that the machine has; they round as narrow ones do.
        self.arch.dispatch(AllLanes { registers: self, solves: &routine.solves, packed, frames, good });
    }

    /// The same where the vectors of the machine are in use already.
    #[inline(always)]
    pub(super) fn all<L: HasFrame>(
        &mut self,
        solves: &[Solve],
        packed: &Packed,
        frames: &mut [L],
        good: &mut [bool; N],
    ) {
        for run in &packed.runs {
            match run {
                PackedStep::Many(Arithmetic::Add, all) => self.many(all, |a, b| a + b),
                PackedStep::Many(Arithmetic::Sub, all) => self.many(all, |a, b| a - b),
                PackedStep::Many(Arithmetic::Mul, all) => self.many(all, |a, b| a * b),
                PackedStep::Many(Arithmetic::Div, all) => self.many(all, |a, b| a / b),
                PackedStep::Many(Arithmetic::Neg, all) => self.many(all, |a, _| -a),
                PackedStep::Solve(block) => self.solve(solves, block, frames, good),
                PackedStep::Guard { pivot, scale } => {
                    let (pivot, scale) = (self.r[*pivot as usize], self.r[*scale as usize]);
                    (0..N).for_each(|l| good[l] &= Frame::is_pivot(pivot[l], scale[l]));
                }
                PackedStep::One(operation) => self.step(operation, frames, good),
            }
        }
    }

    #[inline(always)]
    fn many(&mut self, all: &[[u32; 3]], value: impl Fn(f64, f64) -> f64) {
        for &[out, a, b] in all {
            let (a, b) = (self.r[a as usize], self.r[b as usize]);
            self.r[out as usize] = Vector(std::array::from_fn(|l| value(a[l], b[l])));
        }
    }

    #[inline(never)]
    fn solve<L: HasFrame>(&mut self, solves: &[Solve], block: &PackedSolve, frames: &mut [L], good: &mut [bool; N]) {
        for lane in 0..N {
            if !good[lane] {
                continue;
            }
            let frame = frames[lane].frame();
            block.reads.iter().for_each(|&(slot, r)| frame.r[r as usize] = self.r[slot as usize][lane]);
            good[lane] = frame.solve::<false>(&solves[block.solve]).is_ok();
            block.finds.iter().for_each(|&(slot, r)| self.r[slot as usize][lane] = frame.r[r as usize]);
        }
    }

    #[inline(always)]
    fn each(&mut self, out: u32, value: impl Fn(usize) -> f64) {
        self.r[out as usize] = Vector(std::array::from_fn(value));
    }

    /// One operation: what has a way of its own for lanes, else lane by lane as the table says.
    #[inline(always)]
    #[allow(unreachable_patterns, unused_variables, reason = "the table has what has a way of its own as well")]
    fn step<L: HasFrame>(&mut self, operation: &Operation, frames: &mut [L], good: &[bool; N]) {
        let out = operation.out;
        macro_rules! compute {
            (($k:ident $value:ident)
             given { $($(#[$given_doc:meta])* $given:ident $(($($given_part:ident: $given_kind:ty),*))?;)* }
             plain { $($(#[$plain_doc:meta])* $plain:ident($($part:ident: $kind:ty),*) [$($a:ident $da:ident $A:ident),*] {
                cost: $cost:ident, value: $meaning:expr, text: $text:literal, c: $c:expr, derivative: $derivative:expr,
             })* }
             held $held:tt) => {
                match operation.op {
                    Op::Powi(n, a) => self.r[out as usize] = Vector(powers(self.r[a as usize].0, n)),
                    Op::Pow(a, b) => {
                        self.r[out as usize] = Vector(math::pow_lanes(&self.r[a as usize].0, &self.r[b as usize].0));
                    }
                    Op::Call(f, a) => self.r[out as usize] = Vector(math::call_lanes(f, &self.r[a as usize].0)),
                    Op::Sign(condition, a) | Op::Floor(condition, a) => {
                        let a = self.r[a as usize];
                        for (lane, frame) in frames.iter_mut().enumerate().filter(|(lane, _)| good[*lane]) {
                            self.r[out as usize][lane] = frame.frame().condition_at(condition, a[lane]);
                        }
                    }
                    Op::Table(table, piece, a) => self.table((frames, good), (out, a), (table, piece), 0),
                    Op::TableSlope(table, piece, a) => self.table((frames, good), (out, a), (table, piece), 1),
                    Op::TableCurvature(table, piece, a) => self.table((frames, good), (out, a), (table, piece), 2),
                    $(Op::$given { .. })|* => unreachable!("given before the routine runs"),
                    $(Op::$plain($($part,)* $($a),*) => {
                        $(let $a = self.r[$a as usize].0;)*
                        self.each(out, |l| {
                            $(let $a = $a[l];)*
                            $meaning
                        });
                    })*
                }
            };
        }
        for_each_op!(compute);
    }

    /// A table, or its derivative of some order.
    #[inline(never)]
    fn table<L: HasFrame>(
        &mut self,
        (frames, good): (&mut [L], &[bool; N]),
        (out, a): (u32, u32),
        (table, piece): (u32, Option<ConditionId>),
        order: usize,
    ) {
        let a = self.r[a as usize];
        for (lane, frame) in frames.iter_mut().enumerate().filter(|(lane, _)| good[*lane]) {
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
