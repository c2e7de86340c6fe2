//! Units as the interface writes them: SI units by their base units, declared ones beside them for display.

use std::collections::BTreeMap;

use halfarrow_compiler::unit::{Unit, WHOLE};

/// Units by name: their base units, and display units with factor and offset.
#[derive(Debug, Clone, Default)]
pub(super) struct Units(BTreeMap<String, BaseUnit>);

#[derive(Debug, Clone, Default)]
struct BaseUnit {
    /// Attributes of the base unit; none if an exponent is no whole number.
    base: Option<String>,
    display: BTreeMap<String, (f64, f64)>,
}

impl Units {
    /// Takes note of a unit; gives the names of the SI unit and, if it is another one, of the unit itself.
    pub fn note(&mut self, unit: &Unit) -> (String, Option<String>) {
        let si = unit.to_si_unit();
        let name = match si.to_string() {
            text if text.is_empty() => "1".to_string(),
            text => text,
        };
        let entry = self.0.entry(name.clone()).or_insert_with(|| BaseUnit { base: base(&si), ..BaseUnit::default() });
        if unit.is_si() {
            return (name, None);
        }
        let offset = unit.from_si_f64(0.0);
        let factor = unit.from_si_f64(1.0) - offset;
        let display = unit.to_string();
        entry.display.insert(display.clone(), (factor, offset));
        (name, Some(display))
    }

    /// The elements, a line each.
    pub fn lines(&self) -> Vec<String> {
        let mut lines = Vec::new();
        for (name, entry) in &self.0 {
            if entry.base.is_none() && entry.display.is_empty() {
                lines.push(format!("<Unit name=\"{}\"/>", super::description::escaped(name)));
                continue;
            }
            lines.push(format!("<Unit name=\"{}\">", super::description::escaped(name)));
            lines.extend(entry.base.iter().map(|base| format!("  <BaseUnit{base}/>")));
            for (display, (factor, offset)) in &entry.display {
                let offset = if *offset == 0.0 { String::new() } else { format!(" offset=\"{offset:?}\"") };
                let display = super::description::escaped(display);
                lines.push(format!("  <DisplayUnit name=\"{display}\" factor=\"{factor:?}\"{offset}/>"));
            }
            lines.push("</Unit>".to_string());
        }
        lines
    }
}

fn base(si: &Unit) -> Option<String> {
    let names = ["m", "kg", "s", "A", "K", "mol", "cd", "rad"];
    let exponents = si.dimension.0.iter().copied().chain([si.angle]);
    let mut text = String::new();
    for name in ["kg", "m", "s", "A", "K", "mol", "cd", "rad"] {
        let exponent = names.iter().zip(exponents.clone()).find(|(n, _)| **n == name).map_or(0, |(_, e)| e);
        if exponent % WHOLE != 0 {
            return None;
        }
        if exponent != 0 {
            text += &format!(" {name}=\"{}\"", exponent / WHOLE);
        }
    }
    Some(text)
}
