//! What stands at the head of exported C is true, line by line, of every kind of model.

use crate::common;

use common::{Exported, FLAGS, export, export_single, own};
use halfarrow_emit::Method;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Functions of the C library that code may call.
const LIBRARY: [&str; 17] = [
    "sqrt", "fabs", "floor", "ceil", "trunc", "rint", "round", "ldexp", "frexp", "fma", "memcpy", "memset", "memmove",
    "sqrtf", "fabsf", "floorf", "roundf",
];

fn models() -> Vec<Exported> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models");
    let of = |name: &str| root.join(name).join("model.bond");
    let mut all: Vec<Exported> =
        ["contact", "bridge", "tables", "delay", "sampled", "mesh", "net", "net_cubic", "links", "clock"]
            .iter()
            .zip(Method::ALL.iter().cycle())
            .map(|(name, &method)| export(&own(name), method, 1e-3))
            .collect();
    for (name, method) in [
        ("slider_crank", Method::Rk4),
        ("chain_of_pendulums", Method::Heun),
        ("rc_bridge_diode", Method::ImplicitMidpoint),
        ("rlc_ladder", Method::Rosenbrock),
    ] {
        all.push(export(&of(name), method, 1e-3));
    }
    for (name, method) in
        [("when_beam", Method::Rk4), ("when_order", Method::Heun), ("when_relay", Method::ImplicitMidpoint)]
    {
        all.push(export(&own(name), method, 1e-3));
    }
    for (name, method) in [
        ("contact", Method::ImplicitMidpoint),
        ("bridge", Method::Rosenbrock),
        ("delay", Method::Rk4),
        ("tables", Method::Heun),
        ("closure", Method::Euler),
        ("when_four_bar", Method::Heun),
        ("when_sampled", Method::Rosenbrock),
    ] {
        all.push(export_single(&own(name), method, 1e-3));
    }
    all.push(common::export_projecting(&common::speeds(), Method::Rk4, 4e-3));
    all
}

/// The number in a line of the head: `stack: at most 1234 bytes`.
fn claimed(source: &str, what: &str) -> u64 {
    let head = source.split("*/").next().expect("a head");
    let line = head.lines().find(|line| line.contains(&format!("{what}:"))).unwrap_or_else(|| panic!("no {what}"));
    line.split_whitespace().find_map(|word| word.parse().ok()).unwrap_or_else(|| panic!("no number: {line}"))
}

fn folder() -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("obligations");
    fs::create_dir_all(&path).expect("a folder");
    path
}

/// The object file and the graph of calls with stack usage.
fn compiled(one: &Exported) -> (PathBuf, String) {
    let (folder, name) = (folder(), &one.written.name);
    fs::write(folder.join(format!("{name}.h")), &one.written.header).expect("the header");
    fs::write(folder.join(format!("{name}.c")), &one.written.source).expect("the source");
    let out = Command::new("gcc")
        .current_dir(&folder)
        .args(FLAGS)
        .args(["-O2", "-fno-pic", "-Wvla", "-fcallgraph-info=su", "-c"])
        .arg(format!("{name}.c"))
        .output()
        .expect("gcc runs");
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let graph = fs::read_to_string(folder.join(format!("{name}.ci"))).expect("the graph of calls");
    (folder.join(format!("{name}.o")), graph)
}

/// Functions with their stack in bytes, and who calls whom.
struct Calls {
    stack: BTreeMap<String, u64>,
    calls: BTreeMap<String, BTreeSet<String>>,
}

impl Calls {
    fn of(graph: &str) -> Calls {
        let quoted = |line: &str, key: &str| {
            let rest = line.split(&format!("{key}: \"")).nth(1)?;
            rest.split('"').next().map(str::to_string)
        };
        let mut found = Calls { stack: BTreeMap::new(), calls: BTreeMap::new() };
        for line in graph.lines() {
            if line.starts_with("node:") {
                let (title, label) = (quoted(line, "title").unwrap(), quoted(line, "label").unwrap_or_default());
                let bytes = label.split("\\n").find_map(|part| part.split(" bytes (static)").next()?.parse().ok());
                assert!(!label.contains("dynamic"), "{label}");
                found.stack.insert(title, bytes.unwrap_or(0));
            } else if line.starts_with("edge:") {
                let (from, to) = (quoted(line, "sourcename").unwrap(), quoted(line, "targetname").unwrap());
                found.calls.entry(from).or_default().insert(to);
            }
        }
        found
    }

    /// The greatest stack of a chain of calls from here. Panics on recursion.
    fn deepest(&self, from: &str, open: &mut Vec<String>, known: &mut BTreeMap<String, u64>) -> u64 {
        if let Some(&known) = known.get(from) {
            return known;
        }
        assert!(!open.iter().any(|f| f == from), "recursion: {open:?}");
        open.push(from.to_string());
        // What is called through the table of blocks.
        let blocks = |name: &String| name.contains("ha_block_");
        let of_blocks: Vec<String> = match from.contains("__indirect_call") {
            true => self.stack.keys().filter(|name| blocks(name)).cloned().collect(),
            false => Vec::new(),
        };
        let called = self.calls.get(from).into_iter().flatten().chain(&of_blocks);
        let below = called.map(|to| self.deepest(to, open, known)).max().unwrap_or(0);
        open.pop();
        let all = self.stack.get(from).copied().unwrap_or(0) + 8 + below;
        known.insert(from.to_string(), all);
        all
    }
}

#[test]
fn the_head_says_what_is_so() {
    if Command::new("gcc").arg("--version").output().is_err() {
        assert!(std::env::var_os("HALFARROW_C_TOOLS").is_none(), "gcc has to be there");
        return;
    }
    for one in models() {
        let (name, source) = (&one.written.name, &one.written.source);
        let (object, graph) = compiled(&one);
        let calls = Calls::of(&graph);
        let mut known = BTreeMap::new();
        let deepest = calls.stack.keys().map(|f| calls.deepest(f, &mut Vec::new(), &mut known)).max().unwrap();
        let stack = claimed(source, "stack");
        assert!(deepest <= stack, "{name}: {deepest} bytes of stack, {stack} claimed");
        assert!(stack <= 40 * deepest + 8192, "{name}: {stack} bytes of stack claimed, {deepest} taken");
        let indirect = calls.stack.keys().any(|f| f.contains("__indirect_call"));
        assert!(!(indirect && source.contains("indirect calls:   none")), "{name}: indirect calls");
        symbols(name, &object);
        no_forbidden_words(name, source);
        assert!(
            source.contains(if name.ends_with("_single") {
                "real numbers:     float;"
            } else {
                "real numbers:     double\n"
            }),
            "{name}"
        );
        size(&one, claimed(source, "state"));
    }
}

/// Nothing of the library but what does arithmetic and moves memory, no data that are written.
fn symbols(name: &str, object: &Path) {
    let out = Command::new("nm").arg(object).output().expect("nm runs");
    for line in String::from_utf8_lossy(&out.stdout).lines() {
        let mut words = line.split_whitespace().rev();
        let (symbol, kind) = (words.next().unwrap(), words.next().unwrap());
        match kind {
            "U" => assert!(LIBRARY.contains(&symbol), "{name} calls {symbol}"),
            "T" | "t" | "R" | "r" => {}
            other => panic!("{name}: {symbol} is of kind {other}"),
        }
    }
}

/// What C has for control flow and memory that the head excludes; loops have conditions.
fn no_forbidden_words(name: &str, source: &str) {
    let mut code = String::new();
    for (i, part) in source.split("/*").enumerate() {
        code += if i == 0 { part } else { part.split_once("*/").map_or("", |(_, rest)| rest) };
    }
    let words: BTreeSet<&str> = code.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).collect();
    for word in
        ["goto", "union", "malloc", "calloc", "realloc", "free", "setjmp", "longjmp", "va_list", "signal", "errno"]
    {
        assert!(!words.contains(word), "{name}: {word}");
    }
    for mark in ["HA_WIDE", "ha_wide", "ha_real", "ha_narrow", "ha_widen"] {
        assert!(!words.contains(mark), "{name}: {mark}");
    }
    for endless in ["for (;;)", "while (1)", "while (true)"] {
        assert!(!code.contains(endless), "{name}: {endless}");
    }
}

/// The size of the model, by the compiler.
fn size(one: &Exported, claimed: u64) {
    let (folder, name) = (folder(), &one.written.name);
    let test = format!("#include \"{name}.h\"\ntypedef char fits[sizeof({name}) <= {claimed} ? 1 : -1];\n");
    let tight = format!("typedef char tight[{claimed} <= sizeof({name}) + 512 ? 1 : -1];\n");
    fs::write(folder.join("size.c"), test + &tight + "typedef fits use_fits;\ntypedef tight use_tight;\n")
        .expect("a test");
    let out = Command::new("gcc").current_dir(&folder).args(["-std=c99", "-fsyntax-only", "size.c"]).output();
    let out = out.expect("gcc runs");
    assert!(out.status.success(), "{name}: {claimed} bytes claimed: {}", String::from_utf8_lossy(&out.stderr));
}

/// Values that have a name in the model are told with it.
#[test]
fn values_have_the_names_of_the_model() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models");
    let one = export(&root.join("slider_crank/model.bond"), Method::Heun, 1e-3);
    let rates = one.written.source.split("int ha_rates_code(").nth(1).expect("the rates");
    let rates = rates.split("\n}\n").next().expect("their end");
    for name in ["slide.f", "spring.e", "crank.f'"] {
        let named = |line: &str| line.contains("const double v") && line.contains("/*") && line.contains(name);
        assert!(rates.lines().any(named), "{name}:\n{rates}");
    }
    // Names of the generated code are names like others to a modeller, and no text is mistaken for what it looks like.
    for name in ["v12", "x", "MODEL_OK", "status", "ha_fill", "fabs", "double"] {
        let text = format!("model M\n1:{name} -> I:{name}_i(2)\n{name} -> R:r(e = 3*f^3)\nSe:s(sin(t)) -> {name}\n");
        let path = folder().join("named.bond");
        fs::write(&path, text).expect("a model");
        for one in [export(&path, Method::Heun, 1e-3), export_single(&path, Method::Heun, 1e-3)] {
            compiled(&one);
            assert!(one.written.source.contains(&format!("/* {name}_i.")), "{name}:\n{}", one.written.source);
        }
    }
}
