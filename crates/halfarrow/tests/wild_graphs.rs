//! Random models of all that the language has, by the way of a user: text in, results out. Nothing panics, names are
//! unique, the audit has nothing to say, all forms agree, what rests stays.
#![allow(clippy::disallowed_methods, clippy::excessive_precision, reason = "values to compare with")]

#[path = "wild/check.rs"]
mod check;
#[path = "wild/graph.rs"]
mod graph;

use check::{Fault, Seen, check};
use graph::Wild;

/// Leaves out lines as long as the same property fails.
fn shrink(model: Wild, what: &'static str) -> (Wild, Option<Fault>) {
    let mut best = (model, None);
    loop {
        let before = best.0.lines.len();
        let mut i = 0;
        while i < best.0.lines.len() {
            let mut fewer = best.0.clone();
            fewer.lines.remove(i);
            match check(&fewer.text(), &mut Seen::default()) {
                Err(fault) if fault.what == what => best = (fewer, Some(fault)),
                _ => i += 1,
            }
        }
        if best.0.lines.len() == before {
            return best;
        }
    }
}

fn holds(from: u64, count: u64, limit: usize) {
    let mut seen = Seen::default();
    let mut failed = Vec::new();
    for seed in from..from + count {
        let model = Wild::new(seed);
        if let Err(fault) = check(&model.text(), &mut seen) {
            let (small, again) = shrink(model, fault.what);
            let fault = again.unwrap_or(fault);
            println!("--- seed {seed}: {}\n{}\n{}", fault.what, fault.details, small.text());
            failed.push(seed);
            if failed.len() >= limit {
                break;
            }
        }
    }
    println!("{seen:?}, {} failed: {failed:?}", failed.len());
    assert!(failed.is_empty());
    assert!(seen.ran * 3 > seen.models, "a third of the models must come to a run: {seen:?}");
}

#[test]
fn wild_models() {
    holds(1, 75, 3);
}

#[test]
fn more_wild_models() {
    holds(76, 75, 3);
}

/// `GRAPHS=1000 FROM=1 cargo test … --test all -- --ignored wild_graphs::many --nocapture`.
#[test]
#[ignore = "takes hours; its figures stand in docs/TESTING.md"]
fn many() {
    let number = |name: &str, default| std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(default);
    holds(number("FROM", 1_000_000), number("GRAPHS", 1_000), number("LIMIT", 1_000_000) as usize);
}
