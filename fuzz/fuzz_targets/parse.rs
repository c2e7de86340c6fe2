//! Any text has a tree and faults that can be shown; one without faults has a layout that keeps its meaning.
#![no_main]

use halfarrow_compiler::ast::{format, parse};
use halfarrow_compiler::diagnostic::{Diagnostics, Sources, render};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    let mut sources = Sources::new();
    let file = sources.add("fuzz.bond", text);
    let parsed = parse(text, file);
    let tree = parsed.ast.to_string();
    let few = Diagnostics(parsed.diagnostics.into_iter().take(5).collect());
    render(&few, &sources, true);
    if let Ok(laid_out) = format(text) {
        assert_eq!(parse(&laid_out, file).ast.to_string(), tree, "the layout changed the meaning");
        assert_eq!(format(&laid_out).as_deref(), Ok(laid_out.as_str()), "the layout is not stable");
    }
});
