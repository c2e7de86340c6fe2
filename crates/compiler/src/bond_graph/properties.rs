//! Property files: numbers by their names, `NAME = value`, as files of tyres (`.tir`) have them.

use super::builder::{Builder, Value};
use super::dimension::Quantity;
use super::value::Reading;
use crate::ast::{Call, ExprKind};
use crate::diagnostic::{Diagnostic, codes, nearest};
use crate::span::Span;
use std::rc::Rc;

/// What may stand in the section `[UNITS]`, one or several: numbers are read as they are written, so they have to be SI.
const SI: [&str; 14] =
    ["meter", "metre", "m", "newton", "n", "radian", "rad", "kg", "kilogram", "second", "sec", "s", "pascal", "pa"];

/// A line `NAME = value`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Property {
    /// The name as written.
    pub name: String,
    /// What stands behind the sign of equality, without a comment.
    pub value: String,
    /// The line, from 1.
    pub line: usize,
}

/// The properties of a file, and the path under which it was found.
#[derive(Debug)]
pub(super) struct Properties {
    pub path: String,
    pub all: Vec<Property>,
}

/// Why a text is no property file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum PropertyError {
    /// It has no line `NAME = value`.
    Empty,
    /// Its section `[UNITS]` has this property, which is not SI.
    NotSi(Property),
}

impl std::fmt::Display for PropertyError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            PropertyError::Empty => f.write_str("there is no line `NAME = value` in it"),
            PropertyError::NotSi(p) => write!(f, "its {} in line {} is {}: only SI is read", p.name, p.line, p.value),
        }
    }
}

/// Reads a property file. `$`, `!` and `#` begin a comment, `[SECTION]` a section; lines without a sign of equality say
/// nothing.
pub(super) fn parse(text: &str) -> Result<Vec<Property>, PropertyError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut all = Vec::new();
    let mut in_units = false;
    for (i, line) in text.lines().enumerate() {
        let line = line.split(['$', '!', '#']).next().unwrap_or("").trim();
        if let Some(section) = line.strip_prefix('[') {
            in_units = section.trim_end_matches(']').trim().eq_ignore_ascii_case("units");
        }
        let Some((name, value)) = line.split_once('=') else { continue };
        let property = Property { name: name.trim().to_string(), value: value.trim().to_string(), line: i + 1 };
        let unit = property.value.trim_matches(['\'', '"']).to_ascii_lowercase();
        let singular = unit.strip_suffix('s').unwrap_or(&unit);
        if in_units && ![unit.as_str(), singular].iter().any(|unit| SI.contains(unit)) {
            return Err(PropertyError::NotSi(property));
        }
        all.push(property);
    }
    if all.is_empty() { Err(PropertyError::Empty) } else { Ok(all) }
}

impl<'a> Builder<'a, '_> {
    /// `number("file.tir", "NAME", default = 0)`.
    pub fn number_call(&mut self, cx: &Reading<'_>, call: &'a Call) -> Option<Value> {
        self.refuse_labels("number", call, &["default"])?;
        let mut positional = call.args.iter().filter(|a| a.label.is_none());
        let (file, name) = (positional.next()?, positional.next()?);
        let (path, span) = self.file_named(cx, &file.value, "number(\"file.tir\", \"NAME\")")?;
        let ExprKind::Text(wanted) = &name.value.kind else {
            let d = Diagnostic::error(codes::N017, "the name of a number is needed here", name.span, "not text");
            self.fault(d.hint("write `number(\"file.tir\", \"NAME\")`"));
            return None;
        };
        let properties = self.properties(path, span)?;
        let found: Vec<&Property> = properties.all.iter().filter(|p| p.name == *wanted).collect();
        let Some(first) = found.first() else {
            let Some(default) = super::blocks::labelled(call, "default") else {
                self.no_property(&properties, wanted, path, name.value.span);
                return None;
            };
            return self.number(cx, &default.value);
        };
        if let Some(other) = found.iter().find(|p| p.value != first.value) {
            let title = format!("`{path}` has several numbers `{wanted}`");
            let said = format!("in the lines {} and {}", first.line, other.line);
            self.fault(Diagnostic::error(codes::N020, title, name.value.span, said).hint("leave one of them"));
            return None;
        }
        let Some(number) = self.exprs.decimal(&first.value) else {
            let title = format!("`{wanted}` of `{path}` is no number");
            let said = format!("it is {} in line {}", first.value, first.line);
            self.fault(Diagnostic::error(codes::N020, title, name.value.span, said));
            return None;
        };
        Some(Value::number(number, Quantity::Any))
    }

    fn no_property(&mut self, properties: &Properties, wanted: &str, path: &str, span: Span) {
        let d = Diagnostic::error(codes::N020, format!("`{path}` has no `{wanted}`"), span, "not in this file");
        let near = nearest(wanted, properties.all.iter().map(|p| p.name.as_str()));
        self.fault(match near {
            Some(near) => d.hint(format!("did you mean `{near}`? `default = …` gives a value where there is none")),
            None => d.hint("`default = …` gives a value where there is none"),
        });
    }

    /// The properties of a file, read once.
    fn properties(&mut self, path: &str, span: Span) -> Option<Rc<Properties>> {
        let key = self.key_of_file(path, span);
        if let Some(known) = self.property_files.get(&key).cloned() {
            if let Some(known) = &known {
                self.uses.tables.push((known.path.clone(), span));
            }
            return known;
        }
        let read = self.read_file(path, span);
        let parsed = read.and_then(|(found, text)| match parse(&text) {
            Ok(all) => Some(Rc::new(Properties { path: found, all })),
            Err(why) => {
                let title = format!("`{path}` is no file of named numbers");
                let d = Diagnostic::error(codes::N020, title, span, why.to_string());
                self.fault(d.hint("give lines `NAME = value`, in SI units"));
                None
            }
        });
        if let Some(parsed) = &parsed {
            self.uses.tables.push((parsed.path.clone(), span));
        }
        self.property_files.insert(key, parsed.clone());
        parsed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_values_without_comments() {
        let text = "$---- tyre\n[UNITS]\nLENGTH ='meter'\n[MODEL]\nSIDE = 'LEFT' $side\n! A = 1\n{radial width}\n 1 0\nPEX4 = -3.7e-005 $x\n";
        let all = parse(text).expect("a property file");
        let plain: Vec<(&str, &str, usize)> = all.iter().map(|p| (&*p.name, &*p.value, p.line)).collect();
        assert_eq!(plain, [("LENGTH", "'meter'", 3), ("SIDE", "'LEFT'", 5), ("PEX4", "-3.7e-005", 9)]);
    }

    #[test]
    fn other_units_are_refused() {
        let why = parse("[UNITS]\nLENGTH = 'mm'\n").expect_err("millimetres");
        assert_eq!(why.to_string(), "its LENGTH in line 2 is 'mm': only SI is read");
        assert_eq!(parse("a b\n"), Err(PropertyError::Empty));
    }
}
