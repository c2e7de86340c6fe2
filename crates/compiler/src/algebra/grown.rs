//! Sequences that only grow, cheap to copy.

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

impl<T> Index<usize> for Grown<T> {
    type Output = T;
    fn index(&self, at: usize) -> &T {
        match self.full.get(at / CHUNK) {
            Some(chunk) => &chunk[at % CHUNK],
            None => &self.last[at % CHUNK],
        }
    }
}
