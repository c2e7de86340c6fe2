//! C with gaps: the texts of `runtime/`, and how they are filled.
//!
//! Lines of their own say what stands there:
//!
//! - `//if flag`, `//else`, `//end`: only under a condition;
//! - `//item name: others`: a function, table or macro that is put in only where it is needed, and needs others;
//! - `//entry name`: an item by which a mode of the model is entered;
//! - `//public name`: a function of the header, put in whether anybody needs it or not;
//! - `//always`: what is put in whether anybody needs it or not;
//! - `//section`: a heading, put in where something stands under it.
//!
//! Within a line `$` marks what depends on the model or on its real numbers:
//!
//! - `$WORD`: what the model has for the word;
//! - `$model`, `$model_step`, `$MODEL_OK`: a name of the model;
//! - `$real`, `$1e-9`, `$fabs`, `$DBL_EPSILON`: the type of its real numbers, a literal of it, a function or number for it;
//! - `$narrow a`, `$widen a`: a cast from double precision to it, or back, where these are not the same;
//! - `$ha_name`: an item, which is needed then; `$$ha_name` the one for double precision.

use std::borrow::Cow;
use std::collections::BTreeMap;

use super::flags::Flags;
use super::fragment::{Fragment, Kind};
use super::written::{Needed, Part, Written};
use crate::Real;

/// What stands in the place of words.
pub(crate) type Words = BTreeMap<&'static str, Written>;

/// What templates are filled with.
pub(crate) struct Filling<'a> {
    pub flags: Flags,
    pub words: Words,
    /// The name of the model in C.
    pub model: &'a str,
    /// Its real numbers.
    pub real: Real,
}

impl Filling<'_> {
    /// The fragments of a template.
    ///
    /// # Panics
    /// It has a word or a flag that there is not.
    pub fn fragments(&self, template: &'static str) -> Vec<Fragment> {
        let mut fragments = vec![Fragment::new(Kind::Always)];
        let mut open: Vec<bool> = Vec::new();
        for line in template.lines() {
            if let Some(flag) = line.strip_prefix("//if ") {
                open.push(self.flags.holds(flag));
            } else if line == "//else" {
                let last = open.last_mut().expect("a condition before `//else`");
                *last = !*last;
            } else if line == "//end" {
                open.pop().expect("a condition before `//end`");
            } else if open.contains(&false) {
            } else if line == "//always" {
                fragments.push(Fragment::new(Kind::Always));
            } else if line == "//section" {
                fragments.push(Fragment::new(Kind::Section));
            } else if let Some(item) = line.strip_prefix("//item ") {
                fragments.push(self.item(item));
            } else if let Some(entry) = line.strip_prefix("//entry ") {
                fragments.push(Fragment::new(Kind::Entry(Cow::Borrowed(entry))));
            } else if let Some(public) = line.strip_prefix("//public ") {
                fragments.push(Fragment::new(Kind::Public(self.line(public).text.into())));
            } else {
                let line = self.line(line);
                fragments.last_mut().expect("one at least").line(&line);
            }
        }
        assert!(open.is_empty(), "a condition without end");
        fragments
    }

    /// The text of a template without items.
    ///
    /// # Panics
    /// As [`Filling::fragments`].
    pub fn text(&self, template: &'static str) -> String {
        super::fragment::assembled(&self.fragments(template))
    }

    fn item(&self, declared: &'static str) -> Fragment {
        let (name, needs) = declared.split_once(": ").unwrap_or((declared, ""));
        let name = match name.strip_prefix('$') {
            Some(name) => self.real.function(name).into(),
            None => Cow::Borrowed(name),
        };
        let mut item = Fragment::new(Kind::Item(name));
        item.needs.extend(needs.split_whitespace().map(Cow::Borrowed));
        item
    }

    /// A line with its gaps filled.
    fn line(&self, line: &str) -> Written {
        let mut parts = line.split('$');
        let mut filled = Written::of(parts.next().unwrap_or_default());
        let mut plain = false;
        for part in parts {
            let (token, rest) = part.split_at(token_length(part));
            match (token, plain) {
                ("", true) => filled.text += "$$",
                ("", false) if rest.is_empty() => {
                    plain = true;
                    continue;
                }
                ("", false) => filled.text.push('$'),
                (name, true) => self.put(&mut filled, &Needed(name.to_string().into())),
                (token, false) => self.gap(&mut filled, token),
            }
            plain = false;
            filled.text += if matches!(token, "narrow" | "widen") { rest.trim_start() } else { rest };
        }
        filled
    }

    fn put(&self, filled: &mut Written, part: &dyn Part) {
        filled.text += &part.to_string();
        part.note(&mut filled.notes);
    }

    /// What stands behind one `$`.
    fn gap(&self, filled: &mut Written, token: &str) {
        if let Some(word) = self.words.get(token) {
            return self.put(filled, word);
        }
        let single = self.real == Real::Float;
        let function = self.real.function(token);
        match token {
            "real" => filled.text += self.real.kind(),
            "narrow" => filled.text += if single { "(float)" } else { "" },
            "widen" => filled.text += if single { "(double)" } else { "" },
            _ if token.starts_with(|c: char| c.is_ascii_digit()) => filled.text += &self.real.literal(token),
            _ if token.starts_with("model") => {
                filled.text += self.model;
                filled.text += &token["model".len()..];
            }
            _ if token.starts_with("MODEL") => {
                filled.text += &self.model.to_ascii_uppercase();
                filled.text += &token["MODEL".len()..];
            }
            _ if token.starts_with("ha_") => self.put(filled, &Needed(Cow::Owned(function))),
            _ if token.starts_with(|c: char| c.is_ascii_lowercase()) => filled.text += &function,
            _ => filled.text += self.real.named(token),
        }
    }
}

/// How far a word or a number goes.
fn token_length(text: &str) -> usize {
    let number = text.starts_with(|c: char| c.is_ascii_digit());
    let mut before = ' ';
    let mut inside = |c: char| {
        let exponent = number && matches!(c, '+' | '-') && before == 'e';
        before = c;
        c.is_ascii_alphanumeric() || c == '_' || (number && c == '.') || exponent
    };
    text.find(|c: char| !inside(c)).unwrap_or(text.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filling(real: Real, states: bool) -> Filling<'static> {
        let words = Words::from([("COUNT", Written::of("3"))]);
        Filling { flags: Flags { states, ..Flags::default() }, words, model: "car", real }
    }

    #[test]
    fn gaps_are_filled() {
        let template = "$model *m; $model_rates($MODEL_OK, $COUNT, \"$model.h\", ${X});\n//if states\n\
                        $real a = $1e-9 * $fabs(b) + 2.5; double t = $widen m->x[$COUNT] + $$ha_max(a, $narrow(t - 1.0));\n\
                        //else\nnone\n//end\n";
        assert_eq!(
            filling(Real::Double, true).text(template),
            "car *m; car_rates(CAR_OK, 3, \"car.h\", ${X});\n\
             double a = 1e-9 * fabs(b) + 2.5; double t = m->x[3] + ha_max(a, (t - 1.0));\n"
        );
        assert_eq!(
            filling(Real::Float, true).text(template),
            "car *m; car_rates(CAR_OK, 3, \"car.h\", ${X});\n\
             float a = 1e-9f * fabsf(b) + 2.5; double t = (double)m->x[3] + ha_max(a, (float)(t - 1.0));\n"
        );
        assert!(filling(Real::Double, false).text(template).ends_with("\nnone\n"));
    }

    #[test]
    fn items_are_there_where_they_are_needed() {
        let template = "//section\n/* ---- a ---- */\n\n//item ha_one\none\n\n//section\n/* ---- b ---- */\n\n\
                        //item $ha_min\nmin $ha_max\n\n//item $ha_max: HA_FUNCTION\nmax\n\n//item HA_FUNCTION\nmacro\n\n\
                        //always\n$ha_min\n";
        let text = filling(Real::Float, true).text(template);
        assert_eq!(text, "/* ---- b ---- */\n\nmin ha_maxf\n\nmax\n\nmacro\n\nha_minf\n");
    }

    #[test]
    #[should_panic(expected = "flag")]
    fn unknown_flags_are_faults_of_the_template() {
        filling(Real::Double, true).text("//if nothing\n//end\n");
    }
}
