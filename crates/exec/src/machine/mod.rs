//! Machine code of routines, bit for bit what the bytecode computes.
//!
//! A routine is cut into chunks of some 250 instructions. A chunk is one function without branches: it loads, computes,
//! and stores what is read after it, unless something is wrong (a guarded divisor vanishes) or unusual (a sine of a huge
//! angle, a pivot that must be sought). Then it stores nothing, and the bytecode runs the chunk. Between chunks stand
//! the solve blocks, which the bytecode's solver solves, with inner code that is compiled as well; small ones are written
//! out in the chunk.
//!
//! Unsafe code stands in `memory` alone.

mod arithmetic;
mod chunk;
mod code;
mod inline;
mod kernels;
mod live;
mod memory;

pub(crate) use code::MachineCode;

use crate::bytecode::Register;
use arithmetic::Writer;
use chunk::{Chunk, ChunkContext, ChunkItem, Direct};
use cranelift_codegen::control::ControlPlane;
use cranelift_codegen::ir::{AbiParam, Function, Signature, Type, UserFuncName, Value, types};
use cranelift_codegen::isa::OwnedTargetIsa;
use cranelift_codegen::settings::Configurable;
use cranelift_codegen::{Context, settings};
use cranelift_frontend::{FunctionBuilder, FunctionBuilderContext};
use memory::{CodeBuffer, EntryPoint};
use std::fmt;

/// Something is unusual: the bytecode is to run the chunk.
const RARE: u64 = u64::MAX;
/// A guarded divisor vanishes: this and its number.
const STATUS_OF_GUARD: u64 = 1;
/// Instructions in a chunk: beyond some hundreds the time to compile grows faster than the code.
const CHUNK: usize = 250;
/// Linear blocks of up to this many unknowns are written out.
const WRITTEN_OUT: usize = 12;
/// Calls of functions that are written out in a routine, at most: many take long to compile.
const INLINE: usize = 48;

/// Why there is no machine code; the bytecode runs all the same.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum MachineError {
    /// It is made for x86-64 only.
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
    context: Context,
    builders: FunctionBuilderContext,
}

impl Generator {
    /// # Errors
    /// The processor is none that code is made for.
    pub fn new() -> Result<Generator, MachineError> {
        if !cfg!(target_arch = "x86_64") {
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
        Ok(Generator { isa, context: Context::new(), builders: FunctionBuilderContext::new() })
    }

    /// The function of a chunk; `live` are the registers that are read after it.
    fn chunk(
        &mut self,
        into: &mut CodeBuffer,
        setting: &ChunkContext,
        items: &[ChunkItem],
        live: &[Register],
        (along, inline): (bool, bool),
    ) -> Result<EntryPoint, MachineError> {
        self.function(into, &[types::I64; 5], |writer, arguments| {
            let arguments = std::array::from_fn(|i| arguments[i]);
            let mut chunk = Chunk::new(writer, arguments, setting, along, inline);
            items.iter().for_each(|&item| chunk.item(item));
            chunk.end(live.iter().copied())
        })
    }

    /// The function of a routine of one chunk that reads time and states, and writes what is wanted, where it is told.
    fn rates(
        &mut self,
        into: &mut CodeBuffer,
        setting: &ChunkContext,
        items: &[ChunkItem],
        outputs: &[Register],
        inline: bool,
    ) -> Result<EntryPoint, MachineError> {
        let mut kinds = [types::I64; 7];
        kinds[6] = types::F64;
        self.function(into, &kinds, |writer, arguments| {
            let [values, held, tables, keep, x, dx, t] = std::array::from_fn(|i| arguments[i]);
            let mut chunk = Chunk::new(writer, [values, values, held, tables, keep], setting, false, inline);
            let (time, states) = ((setting.time, t), (setting.states.clone(), x));
            chunk.reads_directly(Direct { time, states, rates: dx });
            items.iter().for_each(|&item| chunk.item(item));
            chunk.end_with_rates(outputs)
        })
    }

    fn function(
        &mut self,
        into: &mut CodeBuffer,
        kinds: &[Type],
        body: impl for<'f> FnOnce(Writer<'f>, &[Value]) -> Writer<'f>,
    ) -> Result<EntryPoint, MachineError> {
        let convention = self.isa.default_call_conv();
        let mut signature = Signature::new(convention);
        signature.params.extend(kinds.iter().map(|&kind| AbiParam::new(kind)));
        signature.returns.push(AbiParam::new(types::I64));
        self.context.clear();
        self.context.func = Function::with_name_signature(UserFuncName::default(), signature);
        let mut builder = FunctionBuilder::new(&mut self.context.func, &mut self.builders);
        let entry = builder.create_block();
        builder.append_block_params_for_function_params(entry);
        builder.switch_to_block(entry);
        let arguments = builder.block_params(entry).to_vec();
        let mut writer = body(Writer::new(builder, convention), &arguments);
        writer.builder.seal_all_blocks();
        writer.builder.finalize(self.isa.frontend_config());
        let compiled = self.context.compile(&*self.isa, &mut ControlPlane::default());
        let compiled = compiled.map_err(|why| MachineError::Generator(format!("{:?}", why.inner)))?;
        if !compiled.buffer.relocs().is_empty() {
            return Err(MachineError::Generator("code refers to what is outside of it".to_string()));
        }
        Ok(into.push(compiled.code_buffer()))
    }
}
