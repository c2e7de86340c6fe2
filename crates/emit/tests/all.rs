//! All tests in one program, which is linked once: `cargo test --test all NAME` runs those of one file.

mod common;

#[path = "c.rs"]
mod c;
#[path = "fmu.rs"]
mod fmu;
#[path = "obligations.rs"]
mod obligations;
#[path = "rolled.rs"]
mod rolled;
#[path = "single.rs"]
mod single;
