//! Width of text and its way into XML.

use halfarrow_compiler::algebra::unicode_name;

/// Families named in every drawing, the widest first: text is measured in DejaVu Sans and fits in the others.
pub const FAMILIES: &str = "DejaVu Sans, Verdana, Noto Sans, Segoe UI, Helvetica, Arial, sans-serif";

/// Advance widths of the characters from space to `~` in DejaVu Sans, in thousandths of the size.
const BOOK: [u16; 95] = [
    318, 401, 460, 838, 636, 950, 780, 275, 390, 390, 500, 838, 318, 361, 318, 337, 636, 636, 636, 636, 636, 636, 636,
    636, 636, 636, 337, 337, 838, 838, 838, 531, 1000, 684, 686, 698, 770, 632, 575, 775, 752, 295, 295, 656, 557, 863,
    748, 787, 603, 787, 695, 635, 611, 732, 684, 989, 685, 611, 685, 390, 337, 390, 838, 500, 500, 613, 635, 550, 635,
    615, 352, 635, 634, 278, 278, 579, 278, 974, 634, 612, 635, 635, 411, 521, 392, 634, 592, 818, 592, 592, 525, 636,
    337, 636, 838,
];
/// The same in DejaVu Sans Bold.
const BOLD: [u16; 95] = [
    348, 456, 521, 838, 696, 1002, 872, 306, 457, 457, 523, 838, 380, 415, 380, 365, 696, 696, 696, 696, 696, 696, 696,
    696, 696, 696, 400, 400, 838, 838, 838, 580, 1000, 774, 762, 734, 830, 683, 683, 821, 837, 372, 372, 775, 637, 995,
    837, 850, 733, 850, 770, 720, 682, 812, 774, 1103, 771, 724, 725, 457, 365, 457, 838, 500, 500, 675, 716, 593, 716,
    678, 435, 716, 712, 343, 343, 665, 343, 1042, 712, 687, 716, 716, 493, 595, 478, 712, 652, 924, 645, 652, 582, 712,
    365, 712, 838,
];

/// Width of a text in px at this font size in px.
pub fn width(text: &str, size: f64, bold: bool) -> f64 {
    let table = if bold { &BOLD } else { &BOOK };
    let advance = |c: char| match c {
        ' '..='~' => table[c as usize - 32],
        '\u{300}'..='\u{36f}' => 0,
        '·' => 318,
        '⁰'..='₉' | '²' | '³' | '¹' => 420,
        'Α'..='ω' => 680,
        _ => 838,
    };
    text.chars().map(|c| f64::from(advance(c))).sum::<f64>() * size / 1000.0
}

/// The text with what XML reserves written out, and without characters that XML forbids.
pub fn escape(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\n' | '\t' | '\r' => safe.push(' '),
            c if c.is_control() || c == '\u{fffe}' || c == '\u{ffff}' => safe.push('\u{fffd}'),
            c => safe.push(c),
        }
    }
    safe
}

/// What [`escape`] has written out, as it was.
pub fn unescape(text: &str) -> String {
    let text = text.replace("&lt;", "<").replace("&gt;", ">").replace("&quot;", "\"");
    text.replace("&amp;", "&")
}

/// A text in lines of at most `most` characters, broken at spaces, else behind signs of expressions; nothing is lost.
pub fn wrap(text: &str, most: usize) -> Vec<String> {
    let mut lines = Vec::new();
    let mut rest: Vec<char> = text.trim().chars().collect();
    while rest.len() > most.max(1) {
        let sign = |c: char| matches!(c, '·' | '/' | ',' | ')' | '(' | '+' | '−');
        let space = (most / 3..=most).rev().find(|&i| rest[i] == ' ');
        let cut = space.or_else(|| (most / 3..=most).rev().find(|&i| sign(rest[i - 1]))).unwrap_or(most);
        lines.push(rest[..cut].iter().collect::<String>().trim_end().to_string());
        rest = rest[cut..].iter().copied().skip_while(|c| *c == ' ').collect();
    }
    if !rest.is_empty() {
        lines.push(rest.into_iter().collect());
    }
    lines
}

/// An expression as written by the modeller, in the signs of print: `a*cos(phi)^2` becomes `a·cos(φ)²`.
pub fn typeset(expr: &str) -> String {
    let mut out = String::new();
    let mut rest = expr;
    while let Some(c) = rest.chars().next() {
        let word = rest.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(rest.len());
        let length = if c.is_alphabetic() || c == '_' {
            out.push_str(&unicode_name(&rest[..word], 0));
            word
        } else if c.is_ascii_digit() {
            let end = number_end(rest);
            out.push_str(&rest[..end]);
            end
        } else {
            typeset_sign(rest, c, &mut out)
        };
        rest = &rest[length..];
    }
    out
}

/// Typesets the sign at the start of `rest` and gives its length.
fn typeset_sign(rest: &str, c: char, out: &mut String) -> usize {
    match c {
        '*' => out.push('·'),
        '-' => out.push('−'),
        '^' => {
            let digits = rest[1..].find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len() - 1);
            let fraction = rest[1 + digits..].starts_with('.');
            if digits > 0 && !fraction {
                out.extend(rest[1..1 + digits].chars().map(raised));
                return 1 + digits;
            }
            out.push('^');
        }
        c => out.push(c),
    }
    c.len_utf8()
}

/// Where the number at the start of a text ends, its exponent included (`1e-9`).
fn number_end(text: &str) -> usize {
    let digits = |s: &str| s.find(|c: char| !(c.is_ascii_digit() || c == '.')).unwrap_or(s.len());
    let end = digits(text);
    let Some(exponent) = text[end..].strip_prefix(['e', 'E']) else { return end };
    let unsigned = exponent.strip_prefix(['-', '+']).unwrap_or(exponent);
    let sign = exponent.len() - unsigned.len();
    match digits(unsigned) {
        0 => end,
        n => end + 1 + sign + n,
    }
}

fn raised(digit: char) -> char {
    match digit {
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        d => char::from_u32('⁰' as u32 + (d as u32 - '0' as u32)).unwrap_or(d),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn laws_are_set_as_in_print() {
        for (written, set) in [
            ("e = b*f^3", "e = b·f³"),
            ("-a*sin(phi1)", "−a·sin(φ1)"),
            ("x^-2 + y^2.5", "x^−2 + y^2.5"),
            ("is*(exp(e/vt) - 1e-9)", "is·(exp(e/vt) − 1e-9)"),
            ("k = 18 kN/m", "k = 18 kN/m"),
            ("", ""),
        ] {
            assert_eq!(typeset(written), set);
        }
    }

    #[test]
    fn text_is_safe_in_xml() {
        assert_eq!(escape("a<b & \"c\"\u{1}"), "a&lt;b &amp; &quot;c&quot;\u{fffd}");
    }

    #[test]
    fn long_text_is_broken_and_nothing_is_lost() {
        assert_eq!(
            wrap("lb·cos(al) − cu·sin(ph) − xa − la·cos(au)", 24),
            ["lb·cos(al) − cu·sin(ph)", "− xa − la·cos(au)"]
        );
        assert_eq!(wrap("a·b·c·d", 4), ["a·b·", "c·d"]);
        assert_eq!(wrap("abcdefgh", 3), ["abc", "def", "gh"]);
        assert_eq!(wrap("spring", 6), ["spring"]);
        assert!(wrap("", 6).is_empty());
    }

    #[test]
    fn bold_and_greek_take_room() {
        assert!(width("I : m", 12.0, true) > width("I : m", 12.0, false));
        assert!(width("φ", 10.0, false) > 5.0);
    }
}
