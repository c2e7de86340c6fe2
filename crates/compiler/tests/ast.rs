//! What the parser makes of texts: `tests/ast/*.bond` and beside each a `.txt` with its tree and its faults.
//! `UPDATE=1 cargo test --test all ast` rewrites them.

use halfarrow_compiler::ast::{MAX_DIAGNOSTICS, Parsed, format, parse};
use halfarrow_compiler::diagnostic::{Diagnostics, Label, Sources, render};
use halfarrow_compiler::span::FileId;
use proptest::prelude::*;
use std::path::{Path, PathBuf};

/// The model texts below a folder, but not those with faults on purpose.
fn bond_files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten() {
        let path = entry.expect("a folder that can be read").path();
        if path.is_dir() {
            let sound = !path.ends_with("faulty");
            files.extend(if sound { bond_files(&path) } else { Vec::new() });
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

/// Checks what holds for every text whatever.
fn survives(text: &str) {
    let parsed = parse(text, FileId(0));
    let inside = |span: halfarrow_compiler::span::Span| {
        let (start, end) = (span.start as usize, span.end as usize);
        assert!(start <= end && text.get(start..end).is_some(), "{start}..{end} in {text:?}");
    };
    for d in &parsed.diagnostics {
        inside(d.primary.span);
        d.others.iter().for_each(|l| inside(l.span));
    }
    parsed.ast.statements.iter().for_each(|s| inside(s.span));
    assert!(parsed.diagnostics.len() <= MAX_DIAGNOSTICS);
    let mut sources = Sources::new();
    sources.add("any.bond", text);
    let few = Diagnostics(parsed.diagnostics.into_iter().take(3).collect());
    render(&few, &sources, false);
    laid_out(text);
}

#[test]
fn nothing_exhausts_the_stack() {
    let many = 30_000;
    let inner = [
        "(",
        "[",
        "{",
        "-",
        "not ",
        "x^",
        "if ",
        "if a then ",
        "if a then b else ",
        "f(",
        "x[",
        "a + ",
        "a.",
        "x'",
        "'",
        "1 + (",
        "-(",
        "[[",
        "a -> ",
        "R:r(",
        "I[",
        "component X {",
        "component X(param a = ",
        "for i in 1..2 {",
        "domain d {",
        "when a {",
        "0:n[",
        "\"",
        "/",
        "}",
        ")",
        ",",
        "2 m/(",
        "2 m/",
        "2 m^",
        "f(a = ",
        "c(0.a = ",
        "constraint a: ",
        "prefer a,",
        "let f(",
        "if (",
        "(-",
        "((x)'",
        "x'(",
        "sin -",
    ];
    for piece in inner {
        for prefix in ["", "model M\nlet y = ", "model M\nR:r("] {
            let text = format!("{prefix}{}", piece.repeat(many));
            let parsed = parse(&text, FileId(0));
            drop(parsed.ast.clone());
            assert!(!parsed.ast.to_string().is_empty() || !parsed.diagnostics.is_empty());
        }
    }
}

#[test]
fn a_tree_is_never_too_high() {
    let sum = |n: usize| format!("model M\nlet y = {}x\n", "x + ".repeat(n));
    assert!(parse(&sum(500), FileId(0)).diagnostics.is_empty());
    let long = parse(&sum(600), FileId(0)).diagnostics;
    assert!(long.len() == 1 && long[0].code.name == "S006", "{long:?}");
    let nested = |n: usize| format!("model M\nlet y = {}x{}\nlet z = \n", "(".repeat(n), ")".repeat(n));
    assert_eq!(parse(&nested(100), FileId(0)).diagnostics.len(), 1);
    let deep: Vec<&str> = parse(&nested(1000), FileId(0)).diagnostics.iter().map(|d| d.code.name).collect();
    assert_eq!(deep, ["S006", "S001"], "one error for the depth, and what follows is read");
}

/// Pieces that texts are made of, sound and unsound.
const PIECES: &[&str] = &[
    "model M\n",
    "param ",
    "const ",
    "input ",
    "output ",
    "let ",
    "state ",
    "import ",
    "component X",
    "prefer ",
    "causality ",
    "stroke ",
    "constraint ",
    "domain ",
    "when ",
    "for ",
    "pseudo ",
    "from ",
    "as ",
    "at ",
    "in ",
    "port ",
    "a",
    "b3",
    "x",
    "φ",
    "gap.el",
    "Se:s",
    "0:n",
    "1:",
    "R:r",
    "2",
    "1.5e-3",
    "0",
    "2 m",
    "18 kN/m",
    "5 1/s",
    "3 W/(m.K)",
    ".5",
    "\"text\"",
    "\"open",
    " -> ",
    "->",
    " = ",
    " : ",
    ":",
    ",",
    ", ",
    ";",
    "(",
    ")",
    "[",
    "]",
    "{",
    "}",
    "{\n",
    "\n}\n",
    "\n",
    "\n",
    "\n\n\n",
    "// c\n",
    "  ",
    "+",
    " - ",
    "-",
    "*",
    "/",
    "^",
    "'",
    ".",
    "..",
    "<",
    " <= ",
    "==",
    "!=",
    "and ",
    "or ",
    "not ",
    "if ",
    " then ",
    " else ",
    "sin(",
    "integral",
    "§",
    "µ",
    "°C",
    "%",
    "²",
    "reset ",
    "for i in 1..n {\n",
    "if i == 1 {",
    "} else ",
    "[i]",
    "[i, j + 1]",
    "sum(i in 1..3, ",
    " for i in ",
    "(a = 1)",
    "(x)",
    "e = ",
    "0 = ",
    "f.a = ",
];

fn soup() -> impl Strategy<Value = String> {
    prop::collection::vec(prop::sample::select(PIECES), 0..60).prop_map(|pieces| pieces.concat())
}

/// White space between tokens, where any is allowed.
fn gap() -> impl Strategy<Value = &'static str> {
    prop::sample::select(&["", " ", "  "][..])
}

fn expr() -> impl Strategy<Value = String> {
    let leaf = prop::sample::select(
        &[
            "x",
            "m.e",
            "gap.el.q",
            "2",
            "1.5e-3",
            "2 m",
            "3 N.s/m",
            "x'",
            "table(\"f.csv\", x, column = 2)",
            "[1, [a, b]]",
            "m[i].f",
            "x[i, j - 1]",
            "[2*i for i in 1..n]",
        ][..],
    );
    leaf.prop_map(str::to_owned).prop_recursive(5, 40, 3, |inner| {
        let op = prop::sample::select(&["+", "-", "*", "/", "^", "+\n", " -\n// c\n "][..]);
        let loose = prop::sample::select(&[" < ", "==", "and", " or\n", ">="][..]);
        prop_oneof![
            (inner.clone(), gap(), op, gap(), inner.clone()).prop_map(|(a, g, op, h, b)| format!("({a}){g}{op}{h}{b}")),
            (inner.clone(), loose, inner.clone()).prop_map(|(a, op, b)| format!("(({a}){op}({b}))")),
            (inner.clone(), gap()).prop_map(|(a, g)| format!("(-{g}{a})")),
            inner.clone().prop_map(|a| format!("(not {a})")),
            (inner.clone(), inner.clone(), inner.clone()).prop_map(|(a, b, c)| format!("(if {a} then {b} else\n{c})")),
            (inner.clone(), gap(), inner.clone()).prop_map(|(a, g, b)| format!("sum(i{g} in 1{g}..{g}{a},{g}{b})")),
            (inner.clone(), gap(), inner.clone()).prop_map(|(a, g, b)| format!("[{g}{a} for i in {b}..\n3]")),
            (inner.clone(), inner).prop_map(|(a, b)| format!("f({a},\n\n\n k={b})")),
        ]
    })
}

fn statement() -> impl Strategy<Value = String> {
    prop_oneof![
        (expr(), gap(), gap()).prop_map(|(e, g, h)| format!("param{g} a{h}={g}{e},b=2kg{h}\"doc\"")),
        (expr(), gap()).prop_map(|(e, g)| format!("output y={e}{g}:{g}N.m/rad")),
        (expr(), expr()).prop_map(|(a, b)| format!("state z' = {a} from {b}")),
        (expr(), gap()).prop_map(|(e, g)| format!("R:r{g}(e={g}{e})->0:n\n// c\n->1:k \"doc\"")),
        (expr(), gap())
            .prop_map(|(e, g)| format!("C:c[a,{g}b](energy={e},q0.a=1) as b3 \"bond\"").replace(") as", ") -> n as")),
        expr().prop_map(|e| format!("constraint h:{e}=0 // why")),
        expr().prop_map(|e| format!("component X(param a={e};port p){{\n\n\na->b{g}\n}}", g = " // c")),
        gap().prop_map(|g| format!("domain d pseudo{{{g}x->y{g}}}")),
        (expr(), gap()).prop_map(|(e, g)| format!("for i in 1..n{g}{{\n\n1:m[i]->x[{e}]{g}as b[i]\n}}")),
        (expr(), gap()).prop_map(|(e, g)| format!("if {e}==1{g}{{a->b}}{g}else{g}{{\n// c\nstate x[1,{e}]'=1}}")),
        (expr(), expr()).prop_map(|(e, f)| format!("if {e} {{a->b\n}}\nelse if {f}{{param k[2]=[1,2]}}")),
        Just("stroke a->b at b\n\n\n".to_owned()),
        Just("  // alone".to_owned()),
    ]
}

proptest! {
    #[test]
    fn any_text_is_survived(text in "\\PC{0,200}|(?s:.{0,60})") {
        survives(&text);
    }

    #[test]
    fn any_soup_of_tokens_is_survived(text in soup()) {
        survives(&text);
    }

    #[test]
    fn any_change_of_a_model_is_survived(from in 0usize..3000, length in 0usize..40, to in 0usize..3000) {
        let text = include_str!("ast/language.bond");
        let cut = |n: usize| text.floor_char_boundary(n.min(text.len()));
        let (a, b, c) = (cut(from), cut(from + length), cut(to));
        survives(&format!("{}{}", &text[..a], &text[b..]));
        survives(&format!("{}{}{}", &text[..c], &text[a..b], &text[c..]));
    }

    #[test]
    fn sound_models_are_read_without_a_fault_and_laid_out(statements in prop::collection::vec(statement(), 0..6)) {
        let text = format!("model M\n{}\n", statements.join("\n"));
        let parsed = parse(&text, FileId(0));
        prop_assert!(parsed.diagnostics.is_empty(), "{}", shown(&text, &parsed));
        prop_assert!(laid_out(&text).is_some());
    }
}

#[test]
fn a_layout_keeps_tokens_apart() {
    // Where reserved syntax stands anything may follow; without the space two slashes would begin a comment.
    let found = include_str!("../../../fuzz/corpus/parse/two_slashes_in_reserved_syntax");
    for text in [found, "\"\"\" +x1,e(\"+/ /0\n\na"] {
        assert!(laid_out(text).is_some(), "{text:?} has a layout");
    }
}
