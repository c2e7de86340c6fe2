//! Functions of a routine, each made by itself: so they are made on all cores, and the bytes do not depend on how many.

use super::arithmetic::Writer;
use super::chunk::{Chunk, ChunkContext, ChunkItem, Direct};
use super::memory::{ArrayLengths, CodeBuffer, EntryPoint, ExecutablePages, Operands};
use super::{Generator, MachineError};
use crate::bytecode::Register;
use cranelift_codegen::Context;
use cranelift_codegen::control::ControlPlane;
use cranelift_codegen::ir::{AbiParam, Function, Signature, Type, UserFuncName, Value, types};
use cranelift_codegen::isa::TargetIsa;
use cranelift_frontend::{FunctionBuilder, FunctionBuilderContext};
use rayon::prelude::*;

/// Fewer functions than this for each core are sooner made than handed out.
const FEW: usize = 2;

/// A function to be made.
pub(super) struct Plan<'a> {
    pub items: Vec<ChunkItem<'a>>,
    pub ends: Ends<'a>,
    /// With derivatives along a direction.
    pub along: bool,
    /// With elementary functions written out.
    pub inline: bool,
}

/// What a function does with what it has computed.
pub(super) enum Ends<'a> {
    /// Puts these in their registers.
    Stores(Vec<Register>),
    /// Writes these as rates where it is told; it reads time and states where it is told, too.
    Rates(&'a [Register]),
}

/// Functions that are made.
#[derive(Debug, Clone)]
pub(super) struct Functions {
    pages: ExecutablePages,
    starts: std::sync::Arc<[EntryPoint]>,
    lengths: ArrayLengths,
}

impl Functions {
    /// Makes them for arrays of these lengths, in this order.
    ///
    /// # Errors
    /// The generator refuses, or there is no executable memory.
    pub fn new(
        generator: &Generator,
        context: &ChunkContext,
        plans: &[Plan],
        lengths: ArrayLengths,
    ) -> Result<Functions, MachineError> {
        let isa = &*generator.isa;
        let made: Vec<_> = plans
            .par_iter()
            .with_min_len(FEW)
            .map_init(Maker::new, |maker, plan| maker.function(isa, context, plan))
            .collect();
        let mut buffer = CodeBuffer::default();
        let starts = made.into_iter().map(|code| Ok(buffer.push(&code?))).collect::<Result<_, MachineError>>()?;
        let pages = buffer.seal().map_err(|why| MachineError::Memory(why.to_string()))?;
        Ok(Functions { pages, starts, lengths })
    }

    /// Runs a function, by its number: 0 if all went well, else its status.
    #[inline]
    pub fn enter(&self, function: usize, on: Operands<'_>) -> u64 {
        self.pages.enter(self.starts[function], self.lengths, on)
    }

    /// The same for one that writes rates.
    #[inline]
    pub fn enter_rates(&self, function: usize, on: Operands<'_>, given: (f64, &[f64], &mut [f64])) -> u64 {
        self.pages.enter_rates(self.starts[function], self.lengths, on, given)
    }
}

/// Makes one function after the other.
pub(super) struct Maker {
    context: Context,
    builders: FunctionBuilderContext,
}

impl Maker {
    pub fn new() -> Maker {
        Maker { context: Context::new(), builders: FunctionBuilderContext::new() }
    }

    /// The code of a function: it stands by itself, wherever it is put.
    pub fn function(
        &mut self,
        isa: &dyn TargetIsa,
        context: &ChunkContext,
        plan: &Plan,
    ) -> Result<Vec<u8>, MachineError> {
        match &plan.ends {
            Ends::Stores(registers) => self.made(isa, &[types::I64; 5], |writer, arguments| {
                let parameters = std::array::from_fn(|i| arguments[i]);
                let mut chunk = Chunk::new(writer, parameters, context, plan.along, plan.inline);
                if !plan.items.iter().any(|item| item.may_fail(plan.inline)) {
                    chunk.stores_at_once(registers, &plan.items);
                }
                chunk.items(&plan.items);
                chunk.end(registers)
            }),
            Ends::Rates(outputs) => {
                let mut kinds = [types::I64; 7];
                kinds[6] = types::F64;
                self.made(isa, &kinds, |writer, arguments| {
                    let [values, held, tables, keep, x, dx, t] = std::array::from_fn(|i| arguments[i]);
                    let parameters = [values, values, held, tables, keep];
                    let mut chunk = Chunk::new(writer, parameters, context, plan.along, plan.inline);
                    let (time, states) = ((context.time, t), (context.states.clone(), x));
                    chunk.reads_directly(Direct { time, states, rates: dx });
                    chunk.items(&plan.items);
                    chunk.end_with_rates(outputs)
                })
            }
        }
    }

    fn made(
        &mut self,
        isa: &dyn TargetIsa,
        kinds: &[Type],
        body: impl for<'f> FnOnce(Writer<'f>, &[Value]) -> Writer<'f>,
    ) -> Result<Vec<u8>, MachineError> {
        let convention = isa.default_call_conv();
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
        writer.builder.finalize(isa.frontend_config());
        let compiled = self.context.compile(isa, &mut ControlPlane::default());
        let compiled = compiled.map_err(|why| MachineError::Generator(format!("{:?}", why.inner)))?;
        if !compiled.buffer.relocs().is_empty() {
            return Err(MachineError::Generator("code refers to what is outside of it".to_string()));
        }
        Ok(compiled.code_buffer().to_vec())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bytecode::Layout;
    use halfarrow_compiler::bond_graph::NoFiles;
    use halfarrow_compiler::compile::{Text, compile};
    use halfarrow_compiler::equations::Form;

    const LADDER: &str = "model Ladder\nparam n = 400\nfor i in 1..n {\n1:wire[i] -> R:r[i](1)\n\
        wire[i] -> 0:node[i] -> C:c[i](1)\nif i == 1 {\nSe:source(1) -> wire[i]\n} else {\nnode[i - 1] -> wire[i]\n}\n}\n";

    #[test]
    fn the_bytes_do_not_depend_on_how_many_cores_make_them() {
        let text = Text { name: "ladder.bond", text: LADDER, files: &NoFiles, overrides: &[] };
        let program = compile(text, Form::Minimal).unwrap_or_else(|found| panic!("{}", found.render(false))).ir;
        let layout = Layout::new(&program, &[]);
        let rates: Vec<_> = program.states.iter().map(|s| s.rate).collect();
        let routine = layout.guarded_routine(&program, &rates);
        let generator = Generator::new().expect("machine code for this processor");
        let made_by = |cores: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(cores).build().expect("threads");
            let code = pool.install(|| generator.compile(&program, &layout, &routine, true));
            code.expect("machine code").functions().pages.bytes().to_vec()
        };
        let alone = made_by(1);
        assert!(alone.len() > 8 * super::super::CHUNK, "several chunks");
        assert!([2, 5].into_iter().all(|cores| made_by(cores) == alone));
    }
}
