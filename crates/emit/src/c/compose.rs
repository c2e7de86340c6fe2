//! One file for all modes of a model: what is the same in all of them stands once, what differs stands once for each of them,
//! with the number of the mode behind its name. Entries that differ call that of the present mode.
//!
//! Names are looked for in what is written: fragments are few and small, and what reads what need not be noted twice.

use std::collections::{BTreeMap, BTreeSet};

use super::fragment::{Fragment, Kind};

/// A name of C in a text: where it begins and ends.
fn names(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let mut quoted = false;
    let mut rest = text;
    std::iter::from_fn(move || {
        loop {
            let start = rest.find(|c: char| matches!(c, '"' | '\\' | '_' | '/') || c.is_ascii_alphabetic())?;
            let at = text.len() - rest.len() + start;
            rest = &rest[start..];
            match rest.as_bytes()[0] {
                b'"' => {
                    quoted = !quoted;
                    rest = &rest[1..];
                }
                b'\\' => rest = rest.get(2..).unwrap_or_default(),
                b'/' if rest.starts_with("/*") && !quoted => rest = rest.split_once("*/").map_or("", |r| r.1),
                b'/' => rest = &rest[1..],
                _ => {
                    let end = rest.find(|c: char| c != '_' && !c.is_ascii_alphanumeric()).unwrap_or(rest.len());
                    let name = &rest[..end];
                    rest = &rest[end..];
                    if !quoted {
                        return Some((at, name));
                    }
                }
            }
        }
    })
}

/// What a piece declares: functions, tables, enumerators and types.
fn declared(text: &str) -> BTreeSet<&str> {
    let of_line = |line: &'_ str| line.find(['(', '[', '=', ';']).map(|end| line[..end].trim_end().len());
    let last = |line| Some(of_line(line)?).and_then(|end: usize| names(&line[..end]).last().map(|n| n.1));
    let mut all: BTreeSet<&str> = text.lines().filter(|line| line.starts_with("static ")).filter_map(last).collect();
    let listed = text.contains("enum {");
    for (at, name) in names(text) {
        let before = text[..at].trim_end();
        let after = text[at + name.len()..].trim_start();
        let enumerator = name.starts_with("HA_") && listed && (before.ends_with(['{', ',']) || before.ends_with("*/"));
        let kind = name.starts_with("ha_") && before.ends_with('}') && after.starts_with(';');
        let function = name.starts_with("ha_") && before.ends_with("(*") && after.starts_with(")(");
        if enumerator || kind || function {
            all.insert(name);
        }
    }
    all
}

/// The file that fragments of modes make, with those in common behind what the modes share.
pub(super) struct Composition<'f> {
    modes: &'f [Vec<Fragment>],
    common: &'f [Fragment],
    /// Places of the fragments that stand, for each mode and for what is in common.
    standing: Vec<BTreeSet<usize>>,
    /// Names that have another meaning in each mode.
    differing: BTreeSet<&'f str>,
}

/// The names by which a fragment is known.
fn known_by(fragment: &Fragment) -> BTreeSet<&str> {
    let mut known = declared(&fragment.text);
    known.extend(name_of(fragment));
    known
}

/// Its own name.
fn name_of(fragment: &Fragment) -> Option<&str> {
    match &fragment.kind {
        Kind::Item(name) | Kind::Entry(name) | Kind::Public(name) => Some(name.as_ref()),
        Kind::Always | Kind::Section => None,
    }
}

fn is_entry(fragment: &Fragment) -> bool {
    matches!(fragment.kind, Kind::Entry(_) | Kind::Public(_))
}

impl<'f> Composition<'f> {
    pub fn new(modes: &'f [Vec<Fragment>], common: &'f [Fragment]) -> Composition<'f> {
        let mut composition = Composition { modes, common, standing: Vec::new(), differing: BTreeSet::new() };
        composition.find_standing();
        composition.find_differing();
        composition
    }

    /// All lists of fragments, what is in common last.
    fn lists(&self) -> impl Iterator<Item = (usize, &'f [Fragment])> + use<'f> {
        self.modes.iter().map(|mode| &mode[..]).chain([self.common]).enumerate()
    }

    /// What stands: what always does, and what that needs. An entry that is needed stands in all modes that have it.
    fn find_standing(&mut self) {
        let mut places: Vec<BTreeMap<&str, Vec<usize>>> = Vec::new();
        let mut open: Vec<(usize, usize)> = Vec::new();
        for (list, fragments) in self.lists() {
            let mut own: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
            for (i, fragment) in fragments.iter().enumerate() {
                match &fragment.kind {
                    Kind::Always | Kind::Public(_) if !fragment.text.is_empty() => open.push((list, i)),
                    kind => kind.item().into_iter().for_each(|name| own.entry(name.as_ref()).or_default().push(i)),
                }
            }
            places.push(own);
        }
        let lists: Vec<&[Fragment]> = self.lists().map(|l| l.1).collect();
        let common = lists.len() - 1;
        let mut standing = vec![BTreeSet::new(); lists.len()];
        while let Some((list, i)) = open.pop() {
            if !standing[list].insert(i) {
                continue;
            }
            for name in &lists[list][i].needs {
                for (other, own) in places.iter().enumerate() {
                    // What is in common begins runs, in the first mode.
                    let near = other == list || other == common || list == common && other == 0;
                    let of_name = own.get(name.as_ref()).into_iter().flatten();
                    open.extend(of_name.filter(|&&i| near || is_entry(&lists[other][i])).map(|&i| (other, i)));
                }
            }
        }
        self.standing = standing;
    }

    fn stands(&self, list: usize) -> impl Iterator<Item = &'f Fragment> + '_ {
        let fragments = self.lists().nth(list).expect("a list").1;
        self.standing[list].iter().map(move |&i| &fragments[i])
    }

    /// Names that modes give other meanings, or that read such names.
    fn find_differing(&mut self) {
        // What several pieces define, as macros by compiler, differs where their order or one of them does.
        let mut texts: BTreeMap<&'f str, BTreeMap<usize, Vec<&'f str>>> = BTreeMap::new();
        let mut reads: BTreeMap<&'f str, BTreeSet<&'f str>> = BTreeMap::new();
        let mut together: Vec<BTreeSet<&'f str>> = Vec::new();
        let mut entries: BTreeSet<&'f str> = BTreeSet::new();
        for mode in 0..self.modes.len() {
            for fragment in self.stands(mode) {
                let known = known_by(fragment);
                for &name in &known {
                    texts.entry(name).or_default().entry(mode).or_default().push(&fragment.text);
                    reads.entry(name).or_default().extend(names(&fragment.text).map(|n| n.1));
                }
                entries.extend(name_of(fragment).filter(|_| is_entry(fragment)));
                together.push(known);
            }
        }
        let several = |of: &BTreeMap<usize, Vec<&str>>| of.values().any(|other| Some(other) != of.values().next());
        // An entry that some modes lack is one of the present mode.
        let lacks = |name: &str| entries.contains(name) && texts[name].len() < self.modes.len();
        let differ = |(name, of): (&&'f str, &_)| (several(of) || lacks(name)).then_some(*name);
        let mut differing: BTreeSet<&str> = texts.iter().filter_map(differ).collect();
        loop {
            let before = differing.len();
            for (name, reads) in &reads {
                if reads.iter().any(|read| read != name && differing.contains(read) && !entries.contains(read)) {
                    differing.insert(name);
                }
            }
            for known in &together {
                if known.iter().any(|name| differing.contains(name)) {
                    differing.extend(known);
                }
            }
            if differing.len() == before {
                break;
            }
        }
        self.differing = differing;
    }

    /// Whether a fragment of a mode has another text in another one.
    fn differs(&self, fragment: &Fragment) -> bool {
        known_by(fragment).iter().any(|name| self.differing.contains(name))
    }

    /// The text of a fragment as it stands for a mode: names that differ have its number behind them, but entries that are
    /// called, which lead to the present mode.
    fn of_mode(&self, fragment: &Fragment, mode: usize, entries: &BTreeSet<&str>) -> String {
        let own = known_by(fragment);
        let mut text = String::with_capacity(fragment.text.len());
        let mut from = 0;
        for (at, name) in names(&fragment.text) {
            let defines = own.contains(name);
            if self.differing.contains(name) && (defines || !entries.contains(name)) {
                text += &fragment.text[from..at + name.len()];
                text += &behind(mode);
                from = at + name.len();
            }
        }
        text += &fragment.text[from..];
        match &fragment.kind {
            Kind::Public(name) if self.differing.contains(name.as_ref()) => {
                let head = text
                    .find(&format!("{name}{}(", behind(mode)))
                    .map_or(0, |at| text[..at].rfind('\n').map_or(0, |n| n + 1));
                text.insert_str(head, "static ");
                text
            }
            _ => text,
        }
    }

    /// The whole file.
    pub fn text(&self) -> String {
        let entries: BTreeSet<&str> =
            self.lists().flat_map(|(list, _)| self.stands(list)).filter(|f| is_entry(f)).filter_map(name_of).collect();
        let mut shared: Vec<&Fragment> = Vec::new();
        for mode in 0..self.modes.len() {
            let mut at = 0;
            for fragment in self.stands(mode).filter(|f| !self.differs(f)) {
                match shared.iter().position(|f| f.kind == fragment.kind && f.text == fragment.text) {
                    Some(known) => at = known + 1,
                    None => {
                        shared.insert(at, fragment);
                        at += 1;
                    }
                }
            }
        }
        let heads = self.heads();
        let mut parts: Vec<String> = shared.iter().map(|f| f.text.clone()).collect();
        let prototypes: String = heads.values().filter(|h| h.is_static).map(|h| format!("{};\n", h.head)).collect();
        let model = parts.iter().position(|part| part.ends_with(" ha_model;\n")).expect("the model is declared");
        parts.insert(model + 1, prototypes);
        for mode in 0..self.modes.len() {
            parts.push(format!("/* ---- mode {mode} ---- */\n"));
            let own = self.stands(mode).filter(|f| self.differs(f));
            parts.extend(own.map(|f| self.of_mode(f, mode, &entries)));
        }
        parts.push("/* ---- of all modes ---- */\n".to_string());
        parts.extend(self.stands(self.modes.len()).map(|f| self.of_mode(f, 0, &entries)));
        parts.extend(
            self.differing.iter().filter(|name| entries.contains(*name)).map(|name| self.dispatch(name, &heads[name])),
        );
        parts.retain(|part| !part.is_empty());
        parts.join("\n")
    }

    /// How the entries are declared.
    fn heads(&self) -> BTreeMap<&'f str, Head> {
        let mut heads = BTreeMap::new();
        for (list, _) in self.lists() {
            for fragment in self.stands(list).filter(|f| is_entry(f)) {
                let name = name_of(fragment).expect("an entry has a name");
                heads.entry(name).or_insert_with(|| Head::of(&fragment.text, name));
            }
        }
        heads
    }

    /// The function that calls that of the present mode.
    fn dispatch(&self, name: &str, head: &Head) -> String {
        let has = |mode: &usize| self.stands(*mode).any(|f| is_entry(f) && name_of(f) == Some(name));
        let gives = if head.head.contains("void ") && !head.head.contains("int ") { "" } else { "return " };
        let mut text = format!("{}\n{{\n    switch (m->mode) {{\n", head.head);
        for mode in (0..self.modes.len()).filter(has) {
            let end = if gives.is_empty() { "\n        break;" } else { "" };
            text += &format!(
                "    case {mode}:\n        {gives}{name}{}({});{end}\n",
                behind(mode),
                head.arguments.join(", ")
            );
        }
        let unused: String = head.arguments.iter().map(|a| format!("        (void){a};\n")).collect();
        let last = match gives {
            "" => "        break;\n".to_string(),
            _ if head.head.starts_with("const char") => "        return \"\";\n".to_string(),
            _ if head.head.starts_with("double") => "        return HUGE_VAL;\n".to_string(),
            _ => "        return 0;\n".to_string(),
        };
        text + &format!("    default:\n{unused}{last}    }}\n}}\n")
    }
}

/// What stands behind a name of a mode.
fn behind(mode: usize) -> String {
    format!("_m{mode}")
}

/// How a function is declared, and what its parameters are called.
struct Head {
    head: String,
    arguments: Vec<String>,
    is_static: bool,
}

impl Head {
    fn of(text: &str, name: &str) -> Head {
        let at = names(text).find(|n| n.1 == name && text[n.0 + name.len()..].starts_with('(')).map_or(0, |n| n.0);
        let start = text[..at].rfind('\n').map_or(0, |n| n + 1);
        let end = at + text[at..].find(')').map_or(0, |n| n + 1);
        let head = text[start..end].to_string();
        let inside = &text[at + name.len() + 1..end - 1];
        let argument = |one: &str| names(one).last().map(|n| n.1.to_string());
        Head {
            is_static: head.starts_with("static "),
            arguments: inside.split(',').filter_map(argument).collect(),
            head,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn item(name: &'static str, text: &str) -> Fragment {
        let needs = names(text).map(|n| n.1.to_string().into()).collect();
        Fragment::item(name.into(), text.into(), needs)
    }

    fn entry(name: &'static str, text: &str) -> Fragment {
        let mut entry = item(name, text);
        entry.kind = Kind::Entry(name.into());
        entry
    }

    #[test]
    fn what_differs_stands_for_each_mode() {
        let mode = |n: usize| {
            vec![
                item("ha_same", "static int ha_same(int a)\n{\n    return a;\n}\n"),
                item("ha_code", &format!("static int ha_code(ha_model *m)\n{{\n    return ha_same({n});\n}}\n")),
                entry("ha_rates", "static int ha_rates(ha_model *m, double t)\n{\n    return ha_code(m);\n}\n"),
                item("ha_idle", "static int ha_idle(void)\n"),
            ]
        };
        let mut run = Fragment::new(Kind::Always);
        run.line(&super::super::written::Written::of("int run(ha_model *m)\n{\n    return ha_rates(m, 0.0);\n}"));
        run.needs.insert("ha_rates".into());
        let mut model = Fragment::new(Kind::Always);
        model.line(&super::super::written::Written::of("typedef car ha_model;"));
        let with_model = |n: usize| [vec![model.clone()], mode(n)].concat();
        let text = Composition::new(&[with_model(0), with_model(1)], &[run]).text();
        assert_eq!(text.matches("static int ha_same(int a)").count(), 1);
        assert!(text.contains("static int ha_code_m0(ha_model *m)") && text.contains("return ha_code_m1(m);"));
        assert!(text.contains("    case 1:\n        return ha_rates_m1(m, t);"));
        assert!(!text.contains("ha_idle"), "what nobody needs is left out");
    }

    #[test]
    fn names_in_texts_are_none() {
        let found: Vec<&str> = names("a1 = \"b \\\" c\" + HA_D[2];").map(|n| n.1).collect();
        assert_eq!(found, ["a1", "HA_D"]);
    }

    #[test]
    fn enumerators_and_types_are_declared() {
        let text = "enum { HA_A, HA_B = HA_NX + 1 };\ntypedef struct {\n    int n;\n} ha_table;\n";
        assert_eq!(declared(text), BTreeSet::from(["HA_A", "HA_B", "ha_table"]));
    }
}
