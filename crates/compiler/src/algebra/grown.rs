//! Sequences and texts that only grow, cheap to copy.

use std::ops::Index;
use std::sync::Arc;

/// Entries in a chunk.
const CHUNK: usize = 512;

/// A sequence that only grows. Copies share the chunks that are full.
#[derive(Clone)]
pub(super) struct Grown<T> {
    full: Vec<Arc<[T]>>,
    last: Vec<T>,
}

impl<T> Default for Grown<T> {
    fn default() -> Self {
        Grown { full: Vec::new(), last: Vec::new() }
    }
}

impl<T> Grown<T> {
    /// Adds an entry at the end.
    pub fn push(&mut self, entry: T) {
        self.last.push(entry);
        if self.last.len() == CHUNK {
            self.full.push(self.last.drain(..).collect());
        }
    }
    /// Number of entries.
    pub fn len(&self) -> usize {
        self.full.len() * CHUNK + self.last.len()
    }
    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Bytes in a part of texts.
const PART: usize = 1 << 16;

/// From where to where a text stands among others.
pub(super) type Place = (u32, u32);

/// Texts one after the other, none of them across the border of a part. Copies share the parts that are full.
#[derive(Clone, Default)]
pub(super) struct GrownTexts {
    full: Vec<Arc<str>>,
    last: String,
}

impl GrownTexts {
    /// Adds what `write` writes, of so many bytes at most.
    pub fn add(&mut self, most: usize, write: impl FnOnce(&mut String)) -> Place {
        if self.last.len() + most > PART {
            self.close();
        }
        let start = self.last.len();
        write(&mut self.last);
        let before = self.full.len() * PART;
        (place(before + start), place(before + self.last.len()))
    }

    /// Ends the part; one that is longer than others takes the numbers of those after it.
    fn close(&mut self) {
        let parts = self.last.len().div_ceil(PART);
        self.full.extend((parts > 0).then(|| std::mem::take(&mut self.last).into()));
        self.full.resize(self.full.len() + parts.saturating_sub(1), "".into());
    }

    /// The text that was added at a place, or a part of it.
    pub fn at(&self, (start, end): Place) -> &str {
        let (part, start, length) = (start as usize / PART, start as usize % PART, (end - start) as usize);
        let text = self.full.get(part).map_or(&*self.last, |text| &**text);
        &text[start..start + length]
    }
}

/// A place in texts.
pub(super) fn place(length: usize) -> u32 {
    u32::try_from(length).expect("names of less than 4 GiB")
}

impl<T> Index<usize> for Grown<T> {
    type Output = T;
    fn index(&self, at: usize) -> &T {
        match self.full.get(at / CHUNK) {
            Some(chunk) => &chunk[at % CHUNK],
            None => &self.last[at % CHUNK],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{GrownTexts, PART};

    #[test]
    fn texts_stand_where_they_were_put_however_long_they_are() {
        let mut texts = GrownTexts::default();
        let lengths = [3, PART - 5, 7, 0, 3 * PART + 1, 2, PART, PART + 1, 1];
        let all: Vec<String> = lengths.iter().enumerate().map(|(i, &n)| i.to_string().repeat(n)).collect();
        let places: Vec<_> = all.iter().map(|text| texts.add(text.len(), |out| out.push_str(text))).collect();
        let copy = texts.clone();
        all.iter().zip(places).for_each(|(text, place)| assert!(copy.at(place) == text));
    }
}
