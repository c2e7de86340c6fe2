//! Any text becomes a sound bond graph or faults that can be shown.
#![no_main]

use halfarrow_compiler::ast::parse;
use halfarrow_compiler::bond_graph::{NoFiles, elaborate, verify};
use halfarrow_compiler::diagnostic::{Diagnostics, Sources, render};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    let mut sources = Sources::new();
    let file = sources.add("fuzz.bond", text);
    let parsed = parse(text, file);
    let result = elaborate(parsed.ast, sources, &NoFiles, &[]);
    let few = Diagnostics(result.diagnostics.0.into_iter().take(5).collect());
    render(&few, &result.sources, true);
    if let Some(graph) = result.graph {
        verify(&graph).expect("a sound graph");
    }
});
