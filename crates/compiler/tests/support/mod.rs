//! What the tests of this crate share.

pub mod formula;
pub mod paper;
