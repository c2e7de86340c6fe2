//! Who may use whom: between crates, and between the stages inside the compiler.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Stages of the compiler in pipeline order: each uses only those before it.
const STAGES: [&str; 8] =
    ["algebra", "ast", "bond_graph", "causal_graph", "causal_paths", "equations", "program", "textbook"];

/// What the stages stand on; these use no stage but `algebra`.
const SHARED: [&str; 4] = ["diagnostic", "ids", "span", "unit"];

/// What each crate may depend on, by folder.
fn allowed() -> BTreeMap<&'static str, &'static [&'static str]> {
    BTreeMap::from([
        ("apps/cli", &["halfarrow"][..]),
        ("apps/python", &["halfarrow"]),
        ("crates/audit", &["halfarrow-compiler"]),
        ("crates/compiler", &["halfarrow-sparse"]),
        ("crates/draw", &["halfarrow-compiler"]),
        ("crates/emit", &["halfarrow-compiler"]),
        ("crates/exec", &["halfarrow-compiler", "halfarrow-sim"]),
        (
            "crates/halfarrow",
            &[
                "halfarrow-audit",
                "halfarrow-compiler",
                "halfarrow-draw",
                "halfarrow-emit",
                "halfarrow-exec",
                "halfarrow-sim",
                "halfarrow-trace",
            ],
        ),
        ("crates/sim", &["halfarrow-sparse"]),
        ("crates/sparse", &[]),
        ("crates/trace", &["halfarrow-sim"]),
    ])
}

#[test]
fn crates_depend_only_on_those_below_them() {
    let allowed = allowed();
    let folders: Vec<String> = ["apps", "crates"].iter().flat_map(|parent| manifests(parent)).collect();
    assert_eq!(
        folders,
        allowed.keys().copied().collect::<Vec<_>>(),
        "a crate without a rule, or a rule without a crate"
    );
    for folder in &folders {
        let manifest = read(&root().join(folder).join("Cargo.toml"));
        for used in dependencies(&manifest) {
            assert!(allowed[folder.as_str()].contains(&used.as_str()), "{folder} must not depend on {used}");
        }
    }
}

#[test]
fn stages_use_only_those_before_them() {
    let source = root().join("crates/compiler/src");
    let mut wrong = Vec::new();
    for (at, stage) in STAGES.iter().enumerate() {
        wrong.extend(foreign_uses(&source, stage, &[&STAGES[..=at], &SHARED[..]].concat()));
    }
    for shared in SHARED {
        wrong.extend(foreign_uses(&source, shared, &[&SHARED[..], &STAGES[..1]].concat()));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_dependency_has_its_reason_beside_it() {
    let mut bare = Vec::new();
    for folder in allowed().keys() {
        let manifest = read(&root().join(folder).join("Cargo.toml"));
        let mut section = "";
        let mut comment_above = false;
        for line in manifest.lines() {
            if line.starts_with('[') {
                section = line;
            }
            let named = section.ends_with("dependencies]") && line.contains('=') && !line.starts_with("halfarrow");
            if named && !line.contains('#') && !comment_above {
                bare.push(format!("{folder}: {line}"));
            }
            comment_above = line.starts_with('#') || (comment_above && named);
        }
    }
    assert!(bare.is_empty(), "dependencies without a reason:\n{}", bare.join("\n"));
}

#[test]
fn no_file_of_tests_is_forgotten() {
    let mut forgotten = Vec::new();
    for folder in allowed().keys().map(|folder| root().join(folder)) {
        let manifest = read(&folder.join("Cargo.toml"));
        if !manifest.contains("autotests = false") {
            continue;
        }
        let all = read(&folder.join("tests/all.rs"));
        for path in entries(&folder.join("tests")).iter().filter(|path| path.extension().is_some_and(|e| e == "rs")) {
            let name = path.file_stem().unwrap_or_default().to_string_lossy();
            if !all.contains(&format!("\nmod {name};")) && !manifest.contains(&format!("[[test]]\nname = \"{name}\"")) {
                forgotten.push(path.display().to_string());
            }
        }
    }
    assert!(forgotten.is_empty(), "tests that nobody runs: name them in all.rs beside them:\n{}", forgotten.join("\n"));
}

#[test]
fn unsafe_code_stays_in_exec() {
    for folder in allowed().keys().filter(|f| f.starts_with("crates/") && **f != "crates/exec") {
        let lib = read(&root().join(folder).join("src/lib.rs"));
        assert!(lib.contains("#![forbid(unsafe_code)]"), "{folder} does not forbid unsafe code");
    }
}

/// Folders with a manifest under `parent`, sorted.
fn manifests(parent: &str) -> Vec<String> {
    let mut found: Vec<String> = entries(&root().join(parent))
        .into_iter()
        .filter(|path| path.join("Cargo.toml").is_file())
        .map(|path| format!("{parent}/{}", path.file_name().unwrap().to_string_lossy()))
        .collect();
    found.sort();
    found
}

/// The workspace's own crates among the dependencies, those of tests not counted.
fn dependencies(manifest: &str) -> Vec<String> {
    let mut section = "";
    let mut found = Vec::new();
    for line in manifest.lines() {
        if line.starts_with('[') {
            section = line;
        }
        let name = line.split(['.', '=', ' ']).next().unwrap_or("");
        if section == "[dependencies]" && name.starts_with("halfarrow") {
            found.push(name.to_string());
        }
    }
    found
}

/// The uses of `crate::x` in a stage, where `x` is not among `known`; `lib.rs`, `compile.rs` and `continuation` may use all.
fn foreign_uses(source: &Path, stage: &str, known: &[&str]) -> Vec<String> {
    let mut wrong = Vec::new();
    let all: BTreeSet<&str> = STAGES.iter().chain(&SHARED).copied().chain(["compile", "continuation"]).collect();
    for file in files_of(source, stage) {
        let text = read(&file);
        for (at, line) in text.lines().enumerate().filter(|(_, l)| !l.trim_start().starts_with("//")) {
            for (start, _) in line.match_indices("crate::") {
                if line[..start].ends_with('$') {
                    continue;
                }
                let rest = &line[start + "crate::".len()..];
                let names: Vec<&str> = match rest.strip_prefix('{') {
                    Some(list) => list.split([',', '}']).map(first_word).collect(),
                    None => vec![first_word(rest)],
                };
                for name in names.into_iter().filter(|n| all.contains(n) && !known.contains(n)) {
                    wrong.push(format!("{}:{}: {stage} uses {name}", file.display(), at + 1));
                }
            }
        }
    }
    wrong
}

fn first_word(text: &str) -> &str {
    let text = text.trim_start();
    text.split(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap_or("")
}

/// All Rust files of a module: `name.rs` and everything under `name/`.
fn files_of(source: &Path, module: &str) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut folders = vec![source.join(module)];
    while let Some(folder) = folders.pop() {
        for path in entries(&folder) {
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                files.push(path);
            }
        }
    }
    let single = source.join(format!("{module}.rs"));
    files.extend(single.is_file().then_some(single));
    files
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    let listed = fs::read_dir(folder).into_iter().flatten();
    listed.map(|entry| entry.unwrap().path()).collect()
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|why| panic!("{}: {why}", path.display()))
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}
