//! Diagnostics under the lines of the model, and as JSON.

use super::{Diagnostic, Diagnostics, Label, Severity, Sources};
use crate::span::{FileId, Span};
use annotate_snippets::{Annotation, AnnotationKind, Group, Level, Renderer, Snippet, normalize_untrusted_str};
use serde_json::{Value, json};
use std::ops::Range;

/// Lines of the text that are shown to the renderer before and after those with labels.
const CONTEXT_LINES: usize = 1;

/// All diagnostics as they are printed for people, each with its lines of the model; `color` adds terminal colours.
///
/// ```
/// use halfarrow_compiler::{ast::parse, diagnostic::{Diagnostics, Sources, render}};
/// let mut sources = Sources::new();
/// let file = sources.add("motor.bond", "model M\nparm r = 3\n");
/// let faults = Diagnostics(parse(sources.text(file), file).diagnostics);
/// assert!(render(&faults, &sources, false).contains("motor.bond:2:1"));
/// ```
pub fn render(diagnostics: &Diagnostics, sources: &Sources, color: bool) -> String {
    let renderer = if color { Renderer::styled() } else { Renderer::plain() };
    let mut out = String::new();
    for diagnostic in &diagnostics.0 {
        out += &renderer.render(&groups(diagnostic, sources));
        out += "\n\n";
    }
    out
}

fn groups<'s>(diagnostic: &'s Diagnostic, sources: &'s Sources) -> Vec<Group<'s>> {
    let level = if diagnostic.is_error() { Level::ERROR } else { Level::WARNING };
    let title = level.primary_title(diagnostic.title.as_str()).id(diagnostic.code.name);
    let mut group = Group::with_title(title);
    for (file, labels) in by_file(diagnostic) {
        group = group.element(snippet(file, &labels, sources));
    }
    for note in &diagnostic.notes {
        group = group.element(Level::NOTE.message(normalize_untrusted_str(note)));
    }
    if let Some(hint) = &diagnostic.hint {
        group = group.element(Level::HELP.with_name("hint").message(normalize_untrusted_str(hint)));
    }
    vec![group]
}

type Marked<'s> = (AnnotationKind, &'s Label);

/// The labels by file, that of the primary label first.
fn by_file(diagnostic: &Diagnostic) -> Vec<(FileId, Vec<Marked<'_>>)> {
    let primary = &diagnostic.primary;
    let mut files = vec![(primary.span.file, vec![(AnnotationKind::Primary, primary)])];
    for other in &diagnostic.others {
        let marked = (AnnotationKind::Context, other);
        match files.iter_mut().find(|(file, _)| *file == other.span.file) {
            Some((_, labels)) => labels.push(marked),
            None => files.push((other.span.file, vec![marked])),
        }
    }
    files
}

/// The part of a file that its labels stand in.
fn snippet<'s>(file: FileId, labels: &[Marked<'s>], sources: &'s Sources) -> Snippet<'s, Annotation<'s>> {
    let text = sources.text(file);
    let ranges: Vec<Range<usize>> = labels.iter().map(|(_, label)| clamped(text, label.span)).collect();
    let first = ranges.iter().map(|r| r.start).min().unwrap_or(0);
    let last = ranges.iter().map(|r| r.end).max().unwrap_or(0);
    let window = window(text, first, last);
    let line = 1 + text[..window.start].matches('\n').count();
    let annotations = labels.iter().zip(&ranges).map(|((kind, label), range)| {
        let annotation = kind.span(range.start - window.start..range.end - window.start);
        if label.text.is_empty() { annotation } else { annotation.label(label.text.as_str()) }
    });
    Snippet::source(&text[window.clone()]).path(sources.name(file)).line_start(line).annotations(annotations)
}

/// The bytes of a span, moved to character boundaries inside the text.
fn clamped(text: &str, span: Span) -> Range<usize> {
    let start = text.floor_char_boundary(span.start as usize);
    let end = text.ceil_char_boundary(span.end as usize);
    start..end.max(start)
}

/// Whole lines around `first..last`, with a little context.
fn window(text: &str, first: usize, last: usize) -> Range<usize> {
    let start = text[..first].rmatch_indices('\n').nth(CONTEXT_LINES).map_or(0, |(i, _)| i + 1);
    let end = text[last..].match_indices('\n').nth(CONTEXT_LINES).map_or(text.len(), |(i, _)| last + i);
    start..end
}

/// All diagnostics for programs: an array of objects `severity`, `code`, `title`, `primary`, `others`, `notes`, `hint`.
/// A label has `file`, `line`, `column` (from 1, in characters), `end_line`, `end_column`, `start`, `end` (bytes), `text`.
pub fn to_json(diagnostics: &Diagnostics, sources: &Sources) -> Value {
    diagnostics.0.iter().map(|d| diagnostic_json(d, sources)).collect()
}

fn diagnostic_json(d: &Diagnostic, sources: &Sources) -> Value {
    json!({
        "severity": match d.severity { Severity::Error => "error", Severity::Warning => "warning" },
        "code": d.code.name,
        "title": d.title,
        "primary": label_json(&d.primary, sources),
        "others": d.others.iter().map(|l| label_json(l, sources)).collect::<Vec<_>>(),
        "notes": d.notes,
        "hint": d.hint,
    })
}

fn label_json(label: &Label, sources: &Sources) -> Value {
    let (line, column) = sources.line_column(label.span);
    let end = Span { start: label.span.end, ..label.span };
    let (end_line, end_column) = sources.line_column(end);
    json!({
        "file": sources.name(label.span.file),
        "line": line,
        "column": column,
        "end_line": end_line,
        "end_column": end_column,
        "start": label.span.start,
        "end": label.span.end,
        "text": label.text,
    })
}

impl Sources {
    /// Line and column where a place begins, both from 1, the column in characters.
    pub fn line_column(&self, span: Span) -> (usize, usize) {
        let text = self.text(span.file);
        let before = &text[..text.floor_char_boundary(span.start as usize)];
        let line = 1 + before.matches('\n').count();
        let column = 1 + before.rsplit('\n').next().unwrap_or("").chars().count();
        (line, column)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnostic::codes;

    fn model() -> (Sources, FileId) {
        let mut sources = Sources::new();
        let file = sources.add("motor.bond", "model M\n\nSe:µ(12 V) -> 0:n1\n\n\n\nSe:charger(14 V) -> n1\n");
        (sources, file)
    }

    fn span(file: FileId, start: u32, end: u32) -> Span {
        Span { file, start, end }
    }

    #[test]
    fn places_reasons_and_remedies_are_shown() {
        let (mut sources, file) = model();
        let library = sources.add("lib/parts.bond", "component X { }\n");
        let fault =
            Diagnostic::error(codes::S001, "two sources set the effort of n1", span(file, 32, 48), "the second")
                .also(span(file, 9, 20), "the first")
                .also(span(library, 10, 11), "a part")
                .note("the effort of a 0-junction has one master")
                .hint("put an R between them");
        let shown = render(&fault.into(), &sources, false);
        let golden = "\
error[S001]: two sources set the effort of n1
 --> motor.bond:7:1
  |
3 | Se:µ(12 V) -> 0:n1
  | ---------- the first
...
7 | Se:charger(14 V) -> n1
  | ^^^^^^^^^^^^^^^^ the second
  |
 ::: lib/parts.bond:1:11
  |
1 | component X { }
  |           - a part
  |
  = note: the effort of a 0-junction has one master
  = hint: put an R between them

";
        assert_eq!(shown, golden);
    }

    #[test]
    fn places_outside_the_text_do_no_harm() {
        let (sources, file) = model();
        for (start, end) in [(0, 0), (13, 13), (12, 13), (55, 55), (900, 1000), (20, 10)] {
            let fault = Diagnostic::warning(codes::S001, "t", span(file, start, end), "here");
            assert!(render(&fault.clone().into(), &sources, true).contains("S001"));
            assert!(to_json(&fault.into(), &sources)[0]["primary"]["line"].is_u64());
        }
        let lost = Diagnostic::error(codes::S001, "t", span(FileId(7), 3, 4), "here");
        assert!(render(&lost.into(), &sources, false).contains("S001"));
    }

    #[test]
    fn json_counts_characters_from_one() {
        let (sources, file) = model();
        let fault = Diagnostic::error(codes::S001, "t", span(file, 17, 18), "");
        let json = to_json(&fault.into(), &sources);
        assert_eq!((&json[0]["primary"]["line"], &json[0]["primary"]["column"]), (&json!(3), &json!(8)));
        assert_eq!(json[0]["hint"], Value::Null);
    }
}
