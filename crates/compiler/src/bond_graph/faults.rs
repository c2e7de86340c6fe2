//! Faults of what is repeated: each is told once, with the turn in which it was met first.

use rustc_hash::FxHashMap;

use crate::diagnostic::Diagnostic;
use crate::span::Span;

/// Faults in the order in which they are found.
#[derive(Default)]
pub(super) struct Faults {
    list: Vec<Diagnostic>,
    /// Faults of repetitions by place and code: how many there are beside the first.
    repeated: FxHashMap<(Span, &'static str), usize>,
    /// Up to here the turns have been told.
    told: usize,
}

impl Faults {
    pub fn push(&mut self, fault: Diagnostic) {
        self.list.push(fault);
    }

    /// A fault, if there is one that has not been said.
    pub fn maybe(&mut self, fault: Option<Diagnostic>) {
        self.list.extend(fault);
    }

    pub fn len(&self) -> usize {
        self.list.len()
    }

    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    pub fn contains(&self, fault: &Diagnostic) -> bool {
        self.list.contains(fault)
    }

    pub fn retain(&mut self, keep: impl FnMut(&Diagnostic) -> bool) {
        self.list.retain(keep);
        self.told = self.told.min(self.list.len());
    }

    /// Says of the faults since `before` in which turn they were found, in words such as `i = 3`.
    pub fn in_turn(&mut self, before: usize, words: impl FnOnce() -> String) {
        let since = before.max(self.told);
        if since >= self.list.len() {
            return;
        }
        let words = words();
        for fault in self.list.split_off(since) {
            let key = (fault.primary.span, fault.code.name);
            match self.repeated.get_mut(&key) {
                Some(more) => *more += 1,
                None => {
                    self.repeated.insert(key, 0);
                    self.list.push(fault.note(format!("for {words}")));
                }
            }
        }
        self.told = self.list.len();
    }

    /// Says of the faults since `before` that lie in another file than the instance in which they were met, where that
    /// stands. Of several instances with the same fault the first is told.
    pub fn in_instance(&mut self, before: usize, instance: Span) {
        for fault in self.list.split_off(before.min(self.list.len())) {
            let places = std::iter::once(&fault.primary).chain(&fault.others);
            if places.map(|label| label.span.file).any(|file| file == instance.file) {
                self.list.push(fault);
                continue;
            }
            let same = |f: &Diagnostic| f.primary == fault.primary && f.code == fault.code && f.title == fault.title;
            if !self.list.iter().any(same) {
                self.list.push(fault.also(instance, "met in this instance"));
            }
        }
        self.told = self.told.min(self.list.len());
    }

    /// All faults.
    pub fn into_list(mut self) -> Vec<Diagnostic> {
        for fault in &mut self.list {
            let key = (fault.primary.span, fault.code.name);
            let more = self.repeated.remove(&key).unwrap_or(0);
            if let Some(note) = fault.notes.last_mut().filter(|_| more > 0) {
                *note += &format!(", and so {more} more time{}", if more == 1 { "" } else { "s" });
            }
        }
        self.list
    }
}
