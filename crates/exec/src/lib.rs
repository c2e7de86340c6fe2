//! Runs a [`Program`](halfarrow_compiler::program::Program): [`Model`] is the [`System`](halfarrow_sim::System) that it
//! becomes, with parameters that can be set, inputs that can be connected, and start values that fit.
//!
//! The bytecode is the meaning of a program; [`Model::execute`] says when it is turned into machine code with the same bits. Elementary functions come from [`math`] alone.
#![deny(unsafe_code)]

mod bytecode;
#[cfg(feature = "machine")]
mod machine;
#[cfg(not(feature = "machine"))]
#[path = "machine/absent.rs"]
mod machine;
mod model;

pub use halfarrow_compiler::algebra::math;
pub use machine::MachineError;
pub use model::{
    Alternatives, Compiled, Drifted, Equilibrium, EquilibriumError, Evaluated, Executed, Execution, Expected,
    ImplicitMemory, ImplicitModel, InputError, Linearised, Memory, ModeId, ModeProgram, Model, Operations,
    ParameterError, Quantity, Reason, RecordError, SampleWeights, Setup, StartConflict, StartError, StartValue, Tape,
    Taped, Varied, WideModel,
};
