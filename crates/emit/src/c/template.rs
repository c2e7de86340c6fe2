//! C text with gaps: parts that stand only under a condition, words to be replaced, functions that nobody calls.

use std::collections::{BTreeMap, BTreeSet};

/// The lines whose conditions hold: `//if word`, `//else` and `//end` stand on lines of their own.
pub(crate) fn choose(text: &str, holds: impl Fn(&str) -> bool) -> String {
    let mut out = String::with_capacity(text.len());
    let mut open: Vec<bool> = Vec::new();
    for line in text.lines() {
        if let Some(flag) = line.strip_prefix("//if ") {
            open.push(holds(flag.trim()));
        } else if line == "//else" {
            if let Some(last) = open.last_mut() {
                *last = !*last;
            }
        } else if line == "//end" {
            open.pop();
        } else if open.iter().all(|&holds| holds) {
            out.push_str(line);
            out.push('\n');
        }
    }
    debug_assert!(open.is_empty(), "a condition without end");
    out
}

/// Puts texts in the place of words.
pub(crate) fn fill(text: &str, words: &BTreeMap<String, String>) -> String {
    let mut out = String::with_capacity(text.len());
    for (word, is_word) in pieces(text) {
        match words.get(word).filter(|_| is_word) {
            Some(instead) => out.push_str(instead),
            None => out.push_str(word),
        }
    }
    out
}

/// `MODEL_rates` and `MODEL` become names of the model, `MODEL_OK` one in capitals.
pub(crate) fn name(text: &str, lower: &str) -> String {
    let upper = lower.to_ascii_uppercase();
    let mut out = String::with_capacity(text.len());
    for (word, is_word) in pieces(text) {
        match word.strip_prefix("MODEL").filter(|rest| is_word && (rest.is_empty() || rest.starts_with('_'))) {
            Some(rest) if rest[1.min(rest.len())..].starts_with(|c: char| c.is_ascii_uppercase()) => {
                out.push_str(&upper);
                out.push_str(rest);
            }
            Some(rest) => {
                out.push_str(lower);
                out.push_str(rest);
            }
            None => out.push_str(word),
        }
    }
    out
}

/// Words and what stands between them.
fn pieces(text: &str) -> impl Iterator<Item = (&str, bool)> {
    let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let mut rest = text;
    std::iter::from_fn(move || {
        let first = rest.chars().next()?;
        let word = is_word(first);
        let end = rest.find(|c: char| is_word(c) != word).unwrap_or(rest.len());
        let (piece, after) = rest.split_at(end);
        rest = after;
        Some((piece, word))
    })
}

/// The text without static functions, tables and macros that nothing else reads, with the comments above them.
pub(super) fn without_the_uncalled(text: &str) -> String {
    let parts = parts(text);
    let mut kept = vec![true; parts.len()];
    loop {
        let mut words: BTreeMap<&str, BTreeSet<usize>> = BTreeMap::new();
        for (i, part) in parts.iter().enumerate().filter(|(i, _)| kept[*i]) {
            for (word, is_word) in pieces(part.text) {
                if is_word {
                    words.entry(word).or_default().insert(i);
                }
            }
        }
        let mut changed = false;
        for (i, part) in parts.iter().enumerate() {
            let Some(name) = part.name else { continue };
            let read_elsewhere = words.get(name).is_some_and(|at| at.iter().any(|&j| parts[j].name != Some(name)));
            if kept[i] && !read_elsewhere {
                kept[i] = false;
                changed = true;
            }
        }
        if !changed {
            break;
        }
    }
    parts.iter().zip(&kept).filter(|(_, kept)| **kept).map(|(part, _)| part.text).collect()
}

/// The text without headings that nothing stands under.
pub(super) fn without_empty_sections(text: &str) -> String {
    let is_heading = |line: &str| line.starts_with("/* ---- ") && line.ends_with(" ---- */");
    let lines: Vec<&str> = text.lines().collect();
    let empty = |i: usize| {
        let next = lines[i + 1..].iter().find(|line| !line.is_empty());
        is_heading(lines[i]) && next.is_none_or(|line| is_heading(line))
    };
    (0..lines.len()).filter(|&i| !empty(i)).flat_map(|i| [lines[i], "\n"]).collect()
}

/// A piece of a source file; a static function or table has a name.
struct TopLevelItem<'a> {
    name: Option<&'a str>,
    text: &'a str,
}

/// Cuts a source at its top level.
fn parts(text: &str) -> Vec<TopLevelItem<'_>> {
    let mut parts = Vec::new();
    let (mut start, mut at) = (0, 0);
    let mut name = None;
    let mut inside = false;
    for line in text.split_inclusive('\n') {
        let bare = line.trim_end();
        let end = at + line.len();
        if let Some(define) = bare.strip_prefix("#define ").filter(|_| !inside && !bare.ends_with('\\')) {
            parts.push(TopLevelItem { name: None, text: &text[start..at] });
            let word = define.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).unwrap_or(define.len());
            parts.push(TopLevelItem { name: Some(&define[..word]), text: &text[at..end] });
            start = end;
        }
        if !inside
            && name.is_none()
            && ["static ", "HA_FUNCTION ", "HA_INLINE ", "HA_SELDOM ", "HA_DATA "]
                .iter()
                .any(|word| bare.starts_with(word))
        {
            // The comment above goes with it.
            let above = comment_above(&text[start..at]);
            if above > 0 {
                parts.push(TopLevelItem { name: None, text: &text[start..start + above] });
                start += above;
            }
            name = name_of(bare);
            inside = !bare.ends_with(';');
            if !inside {
                parts.push(TopLevelItem { name, text: &text[start..end] });
                (start, name) = (end, None);
            }
        } else if inside && (bare == "}" || bare == "};") {
            inside = false;
            parts.push(TopLevelItem { name, text: &text[start..end] });
            (start, name) = (end, None);
        }
        at = end;
    }
    parts.push(TopLevelItem { name: None, text: &text[start..] });
    parts
}

/// Where the comment that ends this text begins.
fn comment_above(text: &str) -> usize {
    let trimmed = text.trim_end_matches('\n');
    let blank_between = text.len() > trimmed.len() + 1;
    match trimmed.rfind("/*") {
        Some(at) if trimmed.ends_with("*/") && !blank_between && (at == 0 || text[..at].ends_with('\n')) => at,
        _ => text.len(),
    }
}

/// The name that a line declares: the word before its first bracket.
fn name_of(line: &str) -> Option<&str> {
    let end = line.find(['(', '[', '=', ';'])?;
    let before = line[..end].trim_end();
    let start = before.rfind(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).map_or(0, |at| at + 1);
    Some(&before[start..]).filter(|name| !name.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_and_words_are_chosen() {
        let text = "a\n//if x\nb\n//if y\nc\n//else\nd\n//end\n//else\ne\n//end\nf\n";
        assert_eq!(choose(text, |word| word == "x"), "a\nb\nd\nf\n");
        assert_eq!(choose(text, |word| word == "y"), "a\ne\nf\n");
        assert_eq!(name("MODEL *m; MODEL_rates(MODEL_OK, MODELLED)", "car"), "car *m; car_rates(CAR_OK, MODELLED)");
        let words = BTreeMap::from([("N".to_string(), "3".to_string())]);
        assert_eq!(fill("a[N] NN", &words), "a[3] NN");
    }

    #[test]
    fn what_nobody_calls_is_left_out() {
        let text = "int f(void);\n\n/* Adds. */\nstatic int add(int a)\n{\n    return a;\n}\n\n/* Adds twice. */\n\
                    static int twice(int a)\n{\n    return add(a);\n}\n\nstatic const int t[] = {\n    1\n};\nint f(void)\n{\n    return t[0];\n}\n";
        let left = without_the_uncalled(text);
        assert!(
            !left.contains("add") && !left.contains("Adds") && left.contains("t[] = {") && left.contains("return t[0]")
        );
    }
}
