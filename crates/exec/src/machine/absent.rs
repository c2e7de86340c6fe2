//! What stands in the place of machine code where it is left out.

use crate::bytecode::{Frame, Layout, Routine, SolveError};
use halfarrow_compiler::program::Program;
use std::fmt;

/// Why there is no machine code; the bytecode runs all the same.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum MachineError {
    /// The program was built without it.
    LeftOut,
}

impl fmt::Display for MachineError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("this program was built without machine code")
    }
}

impl std::error::Error for MachineError {}

/// There is none.
#[derive(Debug)]
pub(crate) enum MachineCode {}

impl MachineCode {
    pub fn run(&self, _: &mut Frame, _: &Routine) -> Result<(), SolveError> {
        match *self {}
    }
    pub fn rates(&self, _: &mut Frame, _: f64, _: &[f64], _: &mut [f64]) -> bool {
        match *self {}
    }
}

/// Makes none.
pub(crate) struct Generator;

impl Generator {
    pub fn new() -> Result<Generator, MachineError> {
        Err(MachineError::LeftOut)
    }
    pub fn compile(&self, _: &Program, _: &Layout, _: &Routine, _: bool) -> Result<MachineCode, MachineError> {
        Err(MachineError::LeftOut)
    }
}
