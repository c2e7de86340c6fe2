//! What all pictures share: numbers and texts as SVG wants them, fonts, colours.

/// Fonts by preference; the first comes with the program.
pub(crate) const FAMILIES: &str = "DejaVu Sans, Verdana, Noto Sans, Segoe UI, Helvetica, Arial, sans-serif";

/// Colours that people who see few colours can tell apart, after Okabe and Ito.
pub(crate) const COLOURS: [&str; 10] =
    ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7a3e9d", "#8c8c2b", "#444444", "#b22222"];

/// A number for SVG: two decimals at most, the shortest way.
pub(crate) fn n(x: f64) -> String {
    let text = format!("{x:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_string() } else { text.to_string() }
}

/// At most `most` characters; a longer text ends in an ellipsis.
pub(crate) fn shorten(text: &str, most: usize) -> String {
    if text.chars().count() <= most {
        return text.to_string();
    }
    let kept: String = text.chars().take(most - 1).collect();
    format!("{}…", kept.trim_end())
}

/// The text with what XML reserves written out, and without characters that XML forbids.
pub(crate) fn escape(text: &str) -> String {
    let written = |c: char| match c {
        '&' => "&amp;".to_string(),
        '<' => "&lt;".to_string(),
        '>' => "&gt;".to_string(),
        '"' => "&quot;".to_string(),
        c if c.is_control() || c == '\u{fffe}' || c == '\u{ffff}' => " ".to_string(),
        c => c.to_string(),
    };
    text.chars().map(written).collect()
}
