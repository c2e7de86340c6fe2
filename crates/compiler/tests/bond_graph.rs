//! Models to bond graphs.

use halfarrow_compiler::ast;
use halfarrow_compiler::bond_graph::{self, BondGraph, Elaborated, Files, NoFiles, Override};
use halfarrow_compiler::diagnostic::{Diagnostics, Sources, render};
use std::path::{Path, PathBuf};

/// Elaborates a text that stands alone.
fn elaborate(text: &str) -> Elaborated {
    elaborate_with("main.bond", text, &NoFiles, &[])
}

fn elaborate_with(name: &str, text: &str, files: &dyn Files, overrides: &[Override]) -> Elaborated {
    let mut sources = Sources::new();
    let file = sources.add(name, text);
    let parsed = ast::parse(text, file);
    let mut result = bond_graph::elaborate(parsed.ast, sources, files, overrides);
    let mut all = parsed.diagnostics;
    all.append(&mut result.diagnostics.0);
    result.diagnostics = Diagnostics(all);
    result
}

/// The graph of a text without faults.
fn graph(text: &str) -> BondGraph {
    let result = elaborate(text);
    let said = render(&result.diagnostics, &result.sources, false);
    let graph = result.graph.unwrap_or_else(|| panic!("{said}"));
    bond_graph::verify(&graph).unwrap();
    graph
}

fn models() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models")
}

/// Every model text below a folder.
fn model_files(folder: &Path, found: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() && path.file_name().is_some_and(|n| n != "faulty") {
            model_files(&path, found);
        } else if path.extension().is_some_and(|e| e == "bond") {
            found.push(path);
        }
    }
}

#[test]
fn every_model_elaborates() {
    let mut files = Vec::new();
    model_files(&models(), &mut files);
    assert!(files.len() > 20);
    let mut faults = String::new();
    for path in files {
        let text = std::fs::read_to_string(&path).unwrap();
        if text.contains("\nconstraint ") {
            continue;
        }
        let result = elaborate_with(&path.display().to_string(), &text, &Disk, &[]);
        faults += &render(&result.diagnostics, &result.sources, false);
        if let Some(graph) = result.graph {
            bond_graph::verify(&graph).unwrap();
        }
    }
    assert!(faults.is_empty(), "{faults}");
}

/// The files of this machine.
struct Disk;

impl Files for Disk {
    fn read(&self, path: &str) -> Result<String, bond_graph::FileError> {
        std::fs::read_to_string(path).map_err(|_| bond_graph::FileError::NotFound)
    }
}

#[test]
fn a_model_has_its_elements_in_order() {
    let g = graph("model M\nparam m = 2 kg\nSe:push(3 N) -> 1:cart -> I:mass(m)\ncart -> R:drag(0.5)\n");
    let names: Vec<&str> = g.elements.values().map(|e| e.name.as_str()).collect();
    assert_eq!(names, ["push", "cart", "mass", "drag"]);
    assert_eq!(g.bonds.len(), 3);
    assert_eq!(g.exprs.name(g.bonds.values().nth(1).unwrap().flow), "mass.f");
}
