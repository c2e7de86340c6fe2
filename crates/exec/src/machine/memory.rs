//! Executable pages: the only place where machine code is entered.
#![allow(unsafe_code)]

use halfarrow_compiler::algebra::Table1d;
use memmap2::{Mmap, MmapMut};
use std::sync::Arc;

/// What code reads and writes: values, derivatives, held conditions, tables, and which conditions are kept; all of the
/// lengths that the code was made for. 0 if all went well, else a [status](super::chunk).
type ChunkFunction = extern "C" fn(*mut f64, *mut f64, *const f64, *const Table1d, u64) -> u64;

/// The same for rates: values, held conditions, tables, which are kept, states, rates, time.
type RatesFunction = extern "C" fn(*const f64, *const f64, *const Table1d, u64, *const f64, *mut f64, f64) -> u64;

/// Functions start at multiples of this many bytes: constants beside them are aligned.
const ALIGNMENT: usize = 64;

/// `vzeroupper`, before every function where the processor has AVX. Upper halves of vector registers that someone else
/// left in use, as kernels of linear algebra do, slow code of the kind that is made here down 27 times on some processors.
const CLEAN: [u8; 3] = [0xc5, 0xf8, 0x77];

/// Pages of executable code, unmapped when the last user of them is gone.
#[derive(Debug, Clone)]
pub(super) struct ExecutablePages(Arc<Mmap>);

/// Code that is being assembled.
#[derive(Debug, Default)]
pub(super) struct CodeBuffer(Vec<u8>);

/// Where a function begins in the pages.
#[derive(Debug, Clone, Copy)]
pub(super) struct EntryPoint(usize);

impl CodeBuffer {
    /// Appends a function without relocations.
    pub fn push(&mut self, code: &[u8]) -> EntryPoint {
        let before = if has_avx() { &CLEAN[..] } else { &[] };
        let function = (self.0.len() + before.len()).next_multiple_of(ALIGNMENT);
        let start = EntryPoint(function - before.len());
        self.0.resize(start.0, 0xcc);
        self.0.extend_from_slice(before);
        self.0.extend_from_slice(code);
        start
    }

    /// Maps it executable, and no longer writable.
    pub fn seal(self) -> std::io::Result<ExecutablePages> {
        let mut pages = MmapMut::map_anon(self.0.len().max(1))?;
        pages[..self.0.len()].copy_from_slice(&self.0);
        let pages = pages.make_exec()?;
        fetch_anew(&pages)?;
        Ok(ExecutablePages(Arc::new(pages)))
    }
}

/// Cores that keep instructions apart from data read these anew.
#[cfg(not(target_arch = "x86_64"))]
fn fetch_anew(pages: &Mmap) -> std::io::Result<()> {
    use wasmtime_internal_jit_icache_coherence::{clear_cache, pipeline_flush_mt};
    // SAFETY: the pages are mapped, all of them.
    unsafe { clear_cache(pages.as_ptr().cast(), pages.len()) }.map_err(std::io::Error::other)?;
    pipeline_flush_mt().map_err(std::io::Error::other)
}

#[cfg(target_arch = "x86_64")]
fn fetch_anew(_: &Mmap) -> std::io::Result<()> {
    Ok(())
}

#[cfg(target_arch = "x86_64")]
fn has_avx() -> bool {
    is_x86_feature_detected!("avx")
}

#[cfg(not(target_arch = "x86_64"))]
fn has_avx() -> bool {
    false
}

/// The arrays that a function works on.
pub(super) struct Operands<'a> {
    pub values: &'a mut [f64],
    pub derivatives: &'a mut [f64],
    pub held: &'a [f64],
    pub tables: &'a [Table1d],
    /// Bit 0: conditions of time are kept; bit 1: those of the state.
    pub keep: u64,
}

/// The least lengths of the arrays.
#[derive(Debug, Clone, Copy)]
pub(super) struct ArrayLengths {
    pub registers: usize,
    pub conditions: usize,
    pub tables: usize,
    pub states: usize,
}

impl ExecutablePages {
    /// The code itself.
    #[cfg(test)]
    pub fn bytes(&self) -> &[u8] {
        &self.0
    }

    /// Runs the function that begins at `start`, which was made by [`chunk`](super::chunk) for a program that reaches
    /// this far.
    pub fn enter(&self, start: EntryPoint, lengths: ArrayLengths, on: Operands<'_>) -> u64 {
        assert!(on.values.len() >= lengths.registers && on.derivatives.len() >= lengths.registers);
        assert!(on.held.len() >= lengths.conditions && on.tables.len() >= lengths.tables && start.0 < self.0.len());
        // SAFETY: `start` comes from `CodeBuffer::push` of these very pages, at which the compiler put a function of this
        // signature and the calling convention of C. The pages are executable and live as long as `self`.
        let function: ChunkFunction =
            unsafe { std::mem::transmute::<*const u8, ChunkFunction>(self.0.as_ptr().add(start.0)) };
        // The function reads and writes registers, conditions and tables below the numbers in `lengths`, which the arrays
        // have; it keeps no pointer.
        function(on.values.as_mut_ptr(), on.derivatives.as_mut_ptr(), on.held.as_ptr(), on.tables.as_ptr(), on.keep)
    }
}

impl ExecutablePages {
    /// The same for a function of rates, from `t` and `x` to `dx`.
    #[inline]
    pub fn enter_rates(
        &self,
        start: EntryPoint,
        lengths: ArrayLengths,
        on: Operands<'_>,
        (t, x, dx): (f64, &[f64], &mut [f64]),
    ) -> u64 {
        assert!(on.values.len() >= lengths.registers && x.len() >= lengths.states && dx.len() >= lengths.states);
        assert!(on.held.len() >= lengths.conditions && on.tables.len() >= lengths.tables && start.0 < self.0.len());
        // SAFETY: as in `enter`; `start` is that of a function of rates.
        let function: RatesFunction =
            unsafe { std::mem::transmute::<*const u8, RatesFunction>(self.0.as_ptr().add(start.0)) };
        // It reads what `lengths` says, writes `dx`, and keeps no pointer.
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
