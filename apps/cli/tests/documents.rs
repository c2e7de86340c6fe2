//! What the documents show is true: models in them compile, commands print what stands there, JSON has the fields.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn document(path: &str) -> String {
    fs::read_to_string(root().join(path)).expect("the document")
}

/// Standard output of a run that went well.
fn halfarrow(folder: &Path, arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_halfarrow"))
        .current_dir(folder)
        .args(arguments)
        .env_remove("COLUMNS")
        .output();
    let output = output.expect("the program starts");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "halfarrow {}\n{errors}", arguments.join(" "));
    String::from_utf8(output.stdout).expect("UTF-8")
}

/// The fenced blocks of a language, each with what stands in a comment `<!-- bond … -->` right before it: the part of the
/// model that a reader needs not see.
fn blocks(text: &str, language: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut hidden = String::new();
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        if line == "<!-- bond" {
            hidden = lines.by_ref().take_while(|l| *l != "-->").map(|l| format!("{l}\n")).collect();
        } else if line == format!("```{language}") {
            let shown: String = lines.by_ref().take_while(|l| *l != "```").map(|l| format!("{l}\n")).collect();
            found.push(shown + &std::mem::take(&mut hidden));
        } else if line.starts_with("```") {
            lines.by_ref().find(|l| *l == "```");
        }
    }
    found
}

/// Every model and every part of one in a document runs.
fn snippets_run(path: &str, expected: usize) {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("snippets_{}", path.replace('/', "_")));
    fs::create_dir_all(&folder).expect("a folder");
    fs::write(folder.join("motors.bond"), "component Brake(param r; port shaft) { shaft -> 1:w -> R:drag(r) }\n")
        .unwrap();
    fs::write(folder.join("tyre.tir"), "[UNITS]\nFORCE = 'newton'\n[VERTICAL]\nVERTICAL_STIFFNESS = 2.0e+005 $ N/m\n")
        .unwrap();
    let snippets = blocks(&document(path), "bond");
    assert_eq!(snippets.len(), expected, "models in {path}");
    for (i, snippet) in snippets.iter().enumerate() {
        let name = format!("snippet{i}.bond");
        let whole = if snippet.starts_with("model ") { snippet.clone() } else { format!("model Snippet\n{snippet}") };
        fs::write(folder.join(&name), whole).unwrap();
        halfarrow(&folder, &["check", &name]);
        halfarrow(&folder, &["equations", &name]);
        halfarrow(&folder, &["simulate", &name, "--to", "0.001", "--out", "out.csv"]);
    }
}

#[test]
fn models_in_the_readme_run() {
    snippets_run("README.md", 1);
}

#[test]
fn models_in_the_language_document_run() {
    snippets_run("docs/language.md", 19);
}

#[test]
fn models_in_the_multibody_document_run() {
    snippets_run("docs/multibody.md", 8);
}

#[test]
fn the_multibody_document_shows_the_library() {
    let library = document("library/std/multibody.bond");
    let snippets = blocks(&document("docs/multibody.md"), "bond");
    let shown = snippets.iter().filter(|s| s.starts_with("component ") || s.starts_with("port "));
    let parts: Vec<_> = shown.map(|s| s.split_once("\n}").expect("a closing brace").0).collect();
    assert_eq!(parts.len(), 2);
    for part in parts {
        assert!(library.contains(part), "{part}");
    }
}

#[test]
fn the_readme_shows_what_is_printed() {
    let shown = blocks(&document("README.md"), "text");
    let commands: Vec<_> = shown.iter().filter_map(|b| b.strip_prefix("$ halfarrow ")).collect();
    assert!(!commands.is_empty());
    for command in commands {
        let (arguments, expected) = command.split_once('\n').expect("what is printed");
        let arguments: Vec<&str> = arguments.split(' ').collect();
        assert_eq!(halfarrow(&root(), &arguments), expected);
    }
}

/// All keys of all objects in a value.
fn keys(value: &Value, found: &mut BTreeSet<String>) {
    match value {
        Value::Object(fields) => fields.iter().for_each(|(key, value)| {
            found.insert(key.clone());
            keys(value, found);
        }),
        Value::Array(values) => values.iter().for_each(|value| keys(value, found)),
        _ => {}
    }
}

/// The keys in the block that describes a command's JSON: what stands between quotes before a colon.
fn documented(text: &str, command: &str) -> BTreeSet<String> {
    let section = text.split("\n## ").find(|s| s.starts_with(&format!("`{command}`"))).expect("a section");
    let block: Vec<&str> = section.lines().filter(|l| l.starts_with("    ")).collect();
    let block = block.join("\n");
    let parts: Vec<&str> = block.split('"').collect();
    let key = |i: usize| parts.get(i + 1).is_some_and(|after| after.starts_with(':'));
    (1..parts.len()).step_by(2).filter(|&i| key(i)).map(|i| parts[i].to_string()).collect()
}

#[test]
fn json_has_the_documented_fields() {
    let text = document("docs/json.md");
    for command in ["loops", "equations"] {
        let mut found = BTreeSet::new();
        for model in ["class2", "pendulum", "unity_gain", "series_springs"] {
            let file = format!("models/{model}/model.bond");
            let forms: &[&[&str]] = if command == "equations" { &[&[], &["--form", "break"]] } else { &[&[]] };
            for form in forms {
                let printed = halfarrow(&root(), &[&[command, &file, "--json"], *form].concat());
                let value: Value = serde_json::from_str(&printed).expect("one JSON object");
                keys(&value, &mut found);
            }
        }
        assert_eq!(documented(&text, command), found, "{command}");
    }
}
