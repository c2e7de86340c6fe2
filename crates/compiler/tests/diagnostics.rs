//! `docs/diagnostics.md` lists every code; `UPDATE=1 cargo test --test all diagnostics` rewrites it.

use halfarrow_compiler::diagnostic::codes::ALL;
use std::path::Path;

const HEAD: &str = "\
# Diagnostics

Every fault that is found in a model has a code. The letter is the stage that finds it. Those marked as warnings are
legal, but odd.

";

const STAGES: [(char, &str); 9] = [
    ('S', "Syntax"),
    ('N', "Names"),
    ('U', "Units"),
    ('B', "Bond graph structure"),
    ('C', "Causality"),
    ('L', "Laws"),
    ('I', "Initial values"),
    ('E', "Equations"),
    ('R', "Run"),
];

fn listed() -> String {
    let mut out = HEAD.to_owned();
    for (letter, stage) in STAGES {
        let codes: Vec<_> = ALL.iter().filter(|c| c.name.starts_with(letter)).collect();
        if !codes.is_empty() {
            out += &format!("## {stage}\n\n| code | meaning |\n|---|---|\n");
            codes.iter().for_each(|c| out += &format!("| {} | {} |\n", c.name, c.meaning));
            out.push('\n');
        }
    }
    out.truncate(out.trim_end().len());
    out + "\n"
}

#[test]
fn the_documentation_lists_every_code() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/diagnostics.md");
    if std::env::var_os("UPDATE").is_some() {
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder that can be made");
        std::fs::write(&path, listed()).expect("a file that can be written");
    }
    let written = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(written == listed(), "run `UPDATE=1 cargo test --test all diagnostics` and look at the change");
}
