//! Curves that can be zoomed and read off in the page: the data, and the program that draws them.

use halfarrow_trace::{Column, Trace};

/// uPlot 1.6, MIT, as it comes (`uplot/README.md`).
pub(crate) const LIBRARY: &str = include_str!("uplot/uPlot.iife.min.js");
/// Its style.
pub(crate) const LIBRARY_STYLE: &str = include_str!("uplot/uPlot.min.css");
/// One panel a unit, all over the same time; without this program the page keeps its still picture.
pub(super) const SCRIPT: &str = include_str!("curves.js");
/// Curves in a panel.
const MOST: usize = 16;

/// A trace as a JavaScript object: times, and for each unit the names and values.
pub(super) fn data(trace: &Trace) -> String {
    let mut units: Vec<&str> = Vec::new();
    for column in &trace.columns {
        if !units.contains(&column.unit.as_str()) {
            units.push(&column.unit);
        }
    }
    let panel = |unit: &&str| {
        let own: Vec<&Column> = trace.columns.iter().filter(|c| c.unit == **unit).take(MOST).collect();
        let names: Vec<String> = own.iter().map(|c| quoted(&c.name)).collect();
        let values: Vec<String> = own.iter().map(|c| list(&c.values)).collect();
        format!("{{unit:{},names:[{}],values:[{}]}}", quoted(unit), names.join(","), values.join(","))
    };
    let panels: Vec<String> = units.iter().map(panel).collect();
    format!("{{t:{},panels:[{}]}}", list(&trace.times), panels.join(",\n"))
}

/// Numbers with the seven digits that a picture can show; what is not finite is a gap.
fn list(values: &[f64]) -> String {
    let number = |x: &f64| if x.is_finite() { format!("{:?}", *x as f32) } else { "null".to_string() };
    let number = |x: &f64| number(x).replace("inf", "1e38");
    format!("[{}]", values.iter().map(number).collect::<Vec<_>>().join(","))
}

/// A text in JavaScript that cannot end the script it stands in.
fn quoted(text: &str) -> String {
    let safe = |c: char| match c {
        '"' | '\\' | '<' | '>' | '&' | '/' => format!("\\u{:04x}", c as u32),
        c if c.is_control() || c == '\u{2028}' || c == '\u{2029}' => " ".to_string(),
        c => c.to_string(),
    };
    format!("\"{}\"", text.chars().map(safe).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_is_sound_whatever_the_names_and_values() {
        let column = Column { name: "a</script>\"".into(), unit: "N/m".into(), values: vec![1.0, f64::NAN, 1e300] };
        let text = data(&Trace { times: vec![0.0, 1.0, 2.0], columns: vec![column] });
        assert!(!text.contains("</") && text.contains("[1.0,null,1e38]"), "{text}");
        assert!(text.contains("t:[0.0,1.0,2.0]") && text.contains("a\\u003c\\u002fscript\\u003e\\u0022"), "{text}");
    }
}
