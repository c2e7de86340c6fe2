//! All tests in one program, which is linked once: `cargo test --test all NAME` runs those of one file.

mod common;
mod recipes;

#[path = "equilibria.rs"]
mod equilibria;
#[path = "evaluation.rs"]
mod evaluation;
#[cfg(feature = "machine")]
#[path = "execution.rs"]
mod execution;
#[path = "forms.rs"]
mod forms;
#[path = "jacobian.rs"]
mod jacobian;
#[cfg(feature = "machine")]
#[path = "machine.rs"]
mod machine;
#[path = "memory.rs"]
mod memory;
#[path = "nets.rs"]
mod nets;
#[path = "random.rs"]
mod random;
#[path = "start.rs"]
mod start;
#[path = "stops.rs"]
mod stops;
#[path = "time.rs"]
mod time;
#[path = "wide.rs"]
mod wide;
