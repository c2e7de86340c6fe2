//! All tests in one program, which is linked once: `cargo test --test all NAME` runs those of one file.

mod support;

#[path = "ast.rs"]
mod ast;
#[path = "bond_graph.rs"]
mod bond_graph;
#[path = "causal_paths.rs"]
mod causal_paths;
#[path = "causal_paths_laws.rs"]
mod causal_paths_laws;
#[path = "diagnostics.rs"]
mod diagnostics;
#[path = "faulty.rs"]
mod faulty;
#[path = "forms.rs"]
mod forms;
#[path = "math.rs"]
mod math;
#[path = "repeated.rs"]
mod repeated;
#[path = "shown.rs"]
mod shown;
