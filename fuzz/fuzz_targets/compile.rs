//! Any text becomes a program or faults that can be shown.
#![no_main]

use halfarrow_compiler::ast::parse;
use halfarrow_compiler::bond_graph::{NoFiles, elaborate};
use halfarrow_compiler::causal_graph::assign_causality;
use halfarrow_compiler::causal_paths::find_paths;
use halfarrow_compiler::diagnostic::{Diagnostics, Sources, render};
use halfarrow_compiler::equations::{Form, derive_equations};
use halfarrow_compiler::program::schedule;
use libfuzzer_sys::fuzz_target;

/// Longest text, in bytes: work grows with the model, and a small one has every construct.
const LONGEST: usize = 4096;

fuzz_target!(|text: &str| {
    if text.len() > LONGEST {
        return;
    }
    let mut sources = Sources::new();
    let file = sources.add("fuzz.bond", text);
    let parsed = parse(text, file);
    if !parsed.diagnostics.is_empty() {
        return; // the other targets show these
    }
    let result = elaborate(parsed.ast, sources, &NoFiles, &[]);
    let Some(graph) = result.graph else { return };
    let compiled = assign_causality(&graph).and_then(|causal| {
        find_paths(&causal);
        derive_equations(&causal, Form::Minimal).map(|equations| schedule(&equations))
    });
    if let Err(faults) = compiled {
        let few = Diagnostics(faults.0.into_iter().take(5).collect());
        render(&few, &result.sources, true);
    }
});
