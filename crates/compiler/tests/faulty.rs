//! Faulty models: every fault stands as a comment on its line, and what the modeller reads stands beside the model.
//!
//! `UPDATE=1 cargo test --test all faulty` rewrites both.

use halfarrow_compiler::ast;
use halfarrow_compiler::bond_graph::{self, FileError, Files};
use halfarrow_compiler::diagnostic::{Diagnostic, Diagnostics, Sources, render};
use std::path::{Path, PathBuf};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/faulty")
}

/// Files seen from the folder of the faulty models.
struct Folder;

impl Files for Folder {
    fn read(&self, path: &str) -> Result<String, FileError> {
        std::fs::read_to_string(folder().join(path)).map_err(|_| FileError::NotFound)
    }
}

/// All that is said about a model text: faults, or else warnings.
fn diagnose(name: &str, text: &str) -> (Diagnostics, Sources) {
    let mut sources = Sources::new();
    let file = sources.add(name, text);
    let parsed = ast::parse(text, file);
    let mut all = parsed.diagnostics;
    let syntax = all.iter().any(Diagnostic::is_error);
    let mut result = bond_graph::elaborate(parsed.ast, sources, &Folder, &[]);
    if !syntax {
        all.append(&mut result.diagnostics.0);
    }
    if let Some(graph) = result.graph.filter(|_| !syntax) {
        bond_graph::verify(&graph).unwrap();
        all.extend(bond_graph::warnings(&graph));
    }
    (Diagnostics(all), result.sources)
}

/// The text without the comments that name faults.
fn without_comments(text: &str) -> String {
    let plain = |line: &str| match line.find("// error ").or_else(|| line.find("// warning ")) {
        Some(at) => line[..at].trim_end().to_string(),
        None => line.to_string(),
    };
    text.lines().map(|l| plain(l) + "\n").collect()
}

/// The text with a comment for every fault on its line.
fn with_comments(text: &str, diagnostics: &Diagnostics, sources: &Sources) -> String {
    let mut lines: Vec<String> = text.lines().map(str::to_string).collect();
    for d in &diagnostics.0 {
        let severity = if d.is_error() { "error" } else { "warning" };
        let elsewhere = d.primary.span.file.0 != 0;
        let (line, _) = if elsewhere { (1, 0) } else { sources.line_column(d.primary.span) };
        lines[line - 1] += &format!("  // {severity} {}: {}", d.code.name, d.title);
    }
    lines.join("\n") + "\n"
}

#[test]
fn every_fault_is_found_where_it_is() {
    let update = std::env::var_os("UPDATE").is_some();
    let mut paths: Vec<PathBuf> = std::fs::read_dir(folder()).unwrap().map(|e| e.unwrap().path()).collect();
    paths.retain(|p| p.extension().is_some_and(|e| e == "bond"));
    paths.sort();
    let mut wrong = String::new();
    for path in &paths {
        let name = path.file_name().unwrap().to_str().unwrap();
        let text = std::fs::read_to_string(path).unwrap();
        let plain = without_comments(&text);
        let (diagnostics, sources) = diagnose(name, &plain);
        assert!(!diagnostics.0.is_empty(), "nothing is found in {name}");
        let commented = with_comments(&plain, &diagnostics, &sources);
        let rendered = render(&diagnostics, &sources, false);
        let golden = path.with_extension("txt");
        if update {
            std::fs::write(path, &commented).unwrap();
            std::fs::write(&golden, &rendered).unwrap();
            continue;
        }
        if text != commented {
            wrong += &format!("{name}: expected\n{text}\nfound\n{commented}\n");
        }
        if std::fs::read_to_string(&golden).ok().as_ref() != Some(&rendered) {
            wrong += &format!("{name}: it is said\n{rendered}\n");
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
    assert!(paths.len() >= 60, "{} faulty models", paths.len());
}
