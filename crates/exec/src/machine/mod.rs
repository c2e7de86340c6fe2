//! Machine code of routines, bit for bit what the bytecode computes.
//!
//! A routine is cut into chunks of some 250 instructions, which are compiled on all cores. A chunk is one function without branches: it loads, computes,
//! and stores what is read after it, unless something is wrong (a guarded divisor vanishes) or unusual (a sine of a huge
//! angle, a pivot that must be sought). Then it stores nothing, and the bytecode runs the chunk. Between chunks stand
//! the solve blocks, which the bytecode's solver solves, with inner code that is compiled as well; small ones are written
//! out in the chunk.
//!
//! Unsafe code stands in `memory` alone.

mod arithmetic;
mod chunk;
mod code;
mod functions;
mod inline;
mod kernels;
mod live;
mod memory;

pub(crate) use code::MachineCode;

use cranelift_codegen::isa::OwnedTargetIsa;
use cranelift_codegen::settings;
use cranelift_codegen::settings::Configurable;
use std::fmt;

/// Something is unusual: the bytecode is to run the chunk.
const RARE: u64 = u64::MAX;
/// A guarded divisor vanishes: this and its number.
const STATUS_OF_GUARD: u64 = 1;
/// Instructions in a chunk: beyond some hundreds the time to compile grows faster than the code.
const CHUNK: usize = 250;
/// Calls of functions that are written out in a routine, at most: many take long to compile.
const INLINE: usize = 48;

/// Why there is no machine code; the bytecode runs all the same.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum MachineError {
    /// It is made for x86-64 and AArch64 only.
    Processor(String),
    /// The code generator refuses.
    Generator(String),
    /// No executable memory is to be had.
    Memory(String),
}

impl fmt::Display for MachineError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            MachineError::Processor(why) => write!(f, "there is no machine code for this processor: {why}"),
            MachineError::Generator(why) => write!(f, "the code generator failed: {why}"),
            MachineError::Memory(why) => write!(f, "no executable memory: {why}"),
        }
    }
}

impl std::error::Error for MachineError {}

/// Turns chunks into machine code for this processor.
pub(crate) struct Generator {
    isa: OwnedTargetIsa,
}

impl Generator {
    /// # Errors
    /// The processor is none that code is made for.
    pub fn new() -> Result<Generator, MachineError> {
        if !cfg!(any(target_arch = "x86_64", target_arch = "aarch64")) {
            return Err(MachineError::Processor(std::env::consts::ARCH.to_string()));
        }
        let mut flags = settings::builder();
        for (name, value) in
            [("opt_level", "speed"), ("enable_verifier", if cfg!(debug_assertions) { "true" } else { "false" })]
        {
            flags.set(name, value).map_err(|why| MachineError::Generator(why.to_string()))?;
        }
        let isa = cranelift_native::builder().map_err(|why| MachineError::Processor(why.to_string()))?;
        let isa = isa.finish(settings::Flags::new(flags)).map_err(|why| MachineError::Generator(why.to_string()))?;
        Ok(Generator { isa })
    }
}
