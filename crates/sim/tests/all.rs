//! All tests in one program, which is linked once: `cargo test --test all NAME` runs those of one file.

mod systems;

#[path = "fixed_step.rs"]
mod fixed_step;
#[path = "implicit.rs"]
mod implicit;
#[path = "real_time.rs"]
mod real_time;
#[path = "sparse.rs"]
mod sparse;
#[path = "variable_step.rs"]
mod variable_step;
