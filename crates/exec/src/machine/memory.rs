//! Executable pages: the only place where machine code is entered.
#![allow(unsafe_code)]

use halfarrow_compiler::algebra::Table1d;
use memmap2::{Mmap, MmapMut};
use std::sync::Arc;

/// What code reads and writes: values, derivatives, held conditions, tables, and which conditions are kept; all of the
/// lengths that the code was made for. 0 if all went well, else a [status](super::chunk).
type Function = extern "C" fn(*mut f64, *mut f64, *const f64, *const Table1d, u64) -> u64;

/// The same for rates: values, held conditions, tables, which are kept, states, rates, time.
type Rates = extern "C" fn(*const f64, *const f64, *const Table1d, u64, *const f64, *mut f64, f64) -> u64;

/// Functions start at multiples of this many bytes: constants beside them are aligned.
const ALIGNMENT: usize = 64;

/// Code that may be run; its pages are given back when the last user of them is gone.
#[derive(Debug, Clone)]
pub(super) struct Memory(Arc<Mmap>);

/// Code that is being gathered.
#[derive(Debug, Default)]
pub(super) struct Gathered(Vec<u8>);

/// Where a function begins.
#[derive(Debug, Clone, Copy)]
pub(super) struct Start(usize);

impl Gathered {
    /// Takes a function that needs nothing but what stands in its own bytes.
    pub fn push(&mut self, code: &[u8]) -> Start {
        self.0.resize(self.0.len().next_multiple_of(ALIGNMENT), 0xcc);
        let start = Start(self.0.len());
        self.0.extend_from_slice(code);
        start
    }

    /// Makes it executable, and no longer writable.
    pub fn seal(self) -> std::io::Result<Memory> {
        let mut pages = MmapMut::map_anon(self.0.len().max(1))?;
        pages[..self.0.len()].copy_from_slice(&self.0);
        Ok(Memory(Arc::new(pages.make_exec()?)))
    }
}

/// The arrays that a function works on.
pub(super) struct Arrays<'a> {
    pub values: &'a mut [f64],
    pub slopes: &'a mut [f64],
    pub held: &'a [f64],
    pub tables: &'a [Table1d],
    /// Bit 0: conditions of time are kept; bit 1: those of the state.
    pub keep: u64,
}

/// The least lengths of the arrays.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reach {
    pub registers: usize,
    pub conditions: usize,
    pub tables: usize,
    pub states: usize,
}

impl Memory {
    /// Runs the function that begins at `start`, which was made by [`chunk`](super::chunk) for a program that reaches
    /// this far.
    pub fn enter(&self, start: Start, reach: Reach, on: Arrays<'_>) -> u64 {
        assert!(on.values.len() >= reach.registers && on.slopes.len() >= reach.registers);
        assert!(on.held.len() >= reach.conditions && on.tables.len() >= reach.tables && start.0 < self.0.len());
        // SAFETY: `start` comes from `Gathered::push` of these very pages, at which the compiler put a function of this
        // signature and the calling convention of C. The pages are executable and live as long as `self`.
        let function: Function = unsafe { std::mem::transmute::<*const u8, Function>(self.0.as_ptr().add(start.0)) };
        // The function reads and writes registers, conditions and tables below the numbers in `reach`, which the arrays
        // have; it keeps no pointer.
        function(on.values.as_mut_ptr(), on.slopes.as_mut_ptr(), on.held.as_ptr(), on.tables.as_ptr(), on.keep)
    }
}

impl Memory {
    /// The same for a function of rates, from `t` and `x` to `dx`.
    #[inline]
    pub fn enter_rates(
        &self,
        start: Start,
        reach: Reach,
        on: Arrays<'_>,
        (t, x, dx): (f64, &[f64], &mut [f64]),
    ) -> u64 {
        assert!(on.values.len() >= reach.registers && x.len() >= reach.states && dx.len() >= reach.states);
        assert!(on.held.len() >= reach.conditions && on.tables.len() >= reach.tables && start.0 < self.0.len());
        // SAFETY: as in `enter`; `start` is that of a function of rates.
        let function: Rates = unsafe { std::mem::transmute::<*const u8, Rates>(self.0.as_ptr().add(start.0)) };
        // It reads what `reach` says, writes `dx`, and keeps no pointer.
        let (values, held, tables) = (on.values.as_ptr(), on.held.as_ptr(), on.tables.as_ptr());
        function(values, held, tables, on.keep, x.as_ptr(), dx.as_mut_ptr(), t)
    }
}

/// A table of the program; code passes the pointer it was given and a number below the program's number of tables.
///
/// # Safety
/// `tables` points at more than `index` tables that nobody writes to.
pub(super) unsafe fn table_at<'a>(tables: *const Table1d, index: u64) -> &'a Table1d {
    // SAFETY: as the caller promises.
    unsafe { &*tables.add(index as usize) }
}
