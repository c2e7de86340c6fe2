//! Program to System: the register bytecode. The only crate that may hold `unsafe`.
#![deny(unsafe_code)]
