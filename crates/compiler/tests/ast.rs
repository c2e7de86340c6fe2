//! What the parser makes of texts: `tests/ast/*.bond` and beside each a `.txt` with its tree and its faults.
//! `UPDATE=1 cargo test -p halfarrow-compiler --test ast` rewrites them.

use halfarrow_compiler::ast::{Parsed, format, parse};
use halfarrow_compiler::diagnostic::Label;
use halfarrow_compiler::span::FileId;
use std::path::{Path, PathBuf};

fn bond_files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten() {
        let path = entry.expect("a folder that can be read").path();
        if path.is_dir() {
            files.extend(bond_files(&path));
        } else if path.extension().is_some_and(|e| e == "bond") {
            files.push(path);
        }
    }
    files.sort();
    files
}

fn place(text: &str, label: &Label) -> String {
    let before = &text[..label.span.start as usize];
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().unwrap_or("").chars().count() + 1;
    format!("{line}:{column} `{}` {}", &text[label.span.start as usize..label.span.end as usize], label.text)
}

fn shown(text: &str, parsed: &Parsed) -> String {
    let mut out = parsed.ast.to_string();
    for d in &parsed.diagnostics {
        out += &format!("\n{:?}[{}]: {}\n  {}\n", d.severity, d.code.name, d.title, place(text, &d.primary));
        for other in &d.others {
            out += &format!("  also {}\n", place(text, other));
        }
        for note in &d.notes {
            out += &format!("  note: {note}\n");
        }
        if let Some(hint) = &d.hint {
            out += &format!("  hint: {hint}\n");
        }
    }
    out
}

#[test]
fn trees_and_faults_are_the_golden_ones() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/ast");
    let mut wrong = Vec::new();
    for file in bond_files(&folder) {
        let text = std::fs::read_to_string(&file).expect("a text");
        let got = shown(&text, &parse(&text, FileId(0)));
        let golden = file.with_extension("txt");
        if std::env::var_os("UPDATE").is_some() {
            std::fs::write(&golden, &got).expect("a golden file that can be written");
        } else if std::fs::read_to_string(&golden).unwrap_or_default() != got {
            wrong.push(format!("{}:\n{got}", file.display()));
        }
    }
    assert!(wrong.is_empty(), "not the golden text:\n{}", wrong.join("\n"));
}

#[test]
fn all_models_of_the_repository_can_be_read() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let files: Vec<PathBuf> = ["models", "library"].iter().flat_map(|f| bond_files(&root.join(f))).collect();
    assert!(!files.is_empty());
    for file in files {
        let text = std::fs::read_to_string(&file).expect("a text");
        let parsed = parse(&text, FileId(0));
        assert!(parsed.diagnostics.is_empty(), "{}: {}", file.display(), shown(&text, &parsed));
    }
}

/// Checks what a layout must keep, and gives it.
fn laid_out(text: &str) -> Option<String> {
    let out = format(text).ok()?;
    let tree = |text: &str| parse(text, FileId(0)).ast.to_string();
    assert_eq!(tree(&out), tree(text), "the layout changed the meaning of\n{text}\ninto\n{out}");
    assert_eq!(format(&out).as_ref(), Ok(&out), "the layout of\n{text}\nis not stable");
    let dense = |text: &str| text.split_whitespace().collect::<String>();
    assert_eq!(dense(&out), dense(text), "something was lost or added");
    Some(out)
}

#[test]
fn layouts_are_the_golden_ones() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/format");
    let files = bond_files(&folder);
    assert!(!files.is_empty());
    for file in files {
        let text = std::fs::read_to_string(&file).expect("a text");
        let got = laid_out(&text).expect("a text without errors");
        let golden = file.with_extension("txt");
        if std::env::var_os("UPDATE").is_some() {
            std::fs::write(&golden, &got).expect("a golden file that can be written");
        } else {
            assert_eq!(std::fs::read_to_string(&golden).unwrap_or_default(), got, "{}", file.display());
        }
    }
}

#[test]
fn layouts_keep_the_meaning_of_all_texts() {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests");
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    for folder in [tests, root.join("models"), root.join("library")] {
        for file in bond_files(&folder) {
            laid_out(&std::fs::read_to_string(&file).expect("a text"));
        }
    }
}

#[test]
fn texts_with_errors_are_not_laid_out() {
    assert!(format("model M\nparam = 3\n").is_err());
    assert!(format("model M\nfor i in 1..3 { a -> b }\n").is_ok());
}
