//! What the tests of this crate share; no test uses all of it.
#![allow(dead_code)]

pub mod formula;
pub mod paper;
pub mod sketch;
