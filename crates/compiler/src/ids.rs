//! Typed ids and the tables keyed by them.

use std::marker::PhantomData;
use std::sync::Arc;

/// An id: a small integer with a type.
pub trait Id: Copy + Ord {
    /// The id with this index.
    fn new(index: usize) -> Self;
    /// Its index.
    fn index(self) -> usize;
}

/// Declares an id type.
macro_rules! id {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub struct $name(pub u32);
        impl $crate::ids::Id for $name {
            fn new(index: usize) -> Self {
                $name(u32::try_from(index).expect("fewer than 2^32 ids"))
            }
            fn index(self) -> usize {
                self.0 as usize
            }
        }
    };
}
pub(crate) use id;

/// A table with one entry per id, in the order of the ids. Copies share their entries until one of them is changed.
#[derive(Debug, PartialEq, Eq)]
pub struct Table<K, V> {
    entries: Arc<Vec<V>>,
    key: PhantomData<K>,
}

impl<K, V> Clone for Table<K, V> {
    fn clone(&self) -> Self {
        Table { entries: self.entries.clone(), key: PhantomData }
    }
}

impl<K, V> Default for Table<K, V> {
    fn default() -> Self {
        Table { entries: Arc::default(), key: PhantomData }
    }
}

impl<K: Id, V> Table<K, V> {
    /// An empty table.
    pub fn new() -> Self {
        Self::default()
    }
    /// A table of `n` equal entries.
    pub fn filled(n: usize, value: V) -> Self
    where
        V: Clone,
    {
        Table { entries: Arc::new(vec![value; n]), key: PhantomData }
    }
    /// Adds an entry and gives its id.
    pub fn push(&mut self, value: V) -> K
    where
        V: Clone,
    {
        Arc::make_mut(&mut self.entries).push(value);
        K::new(self.entries.len() - 1)
    }
    /// Number of entries.
    pub fn len(&self) -> usize {
        self.entries.len()
    }
    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }
    /// The ids in order.
    pub fn ids(&self) -> impl DoubleEndedIterator<Item = K> + use<K, V> {
        (0..self.entries.len()).map(K::new)
    }
    /// Ids and entries in order.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = (K, &V)> {
        self.entries.iter().enumerate().map(|(i, v)| (K::new(i), v))
    }
    /// Ids and entries in order, to change.
    pub fn iter_mut(&mut self) -> impl DoubleEndedIterator<Item = (K, &mut V)>
    where
        V: Clone,
    {
        Arc::make_mut(&mut self.entries).iter_mut().enumerate().map(|(i, v)| (K::new(i), v))
    }
    /// The entries in order.
    pub fn values(&self) -> std::slice::Iter<'_, V> {
        self.entries.iter()
    }
    /// The entries in order, taken out.
    pub fn into_values(self) -> std::vec::IntoIter<V>
    where
        V: Clone,
    {
        Arc::unwrap_or_clone(self.entries).into_iter()
    }
    /// The entry, if the id is in range.
    pub fn get(&self, id: K) -> Option<&V> {
        self.entries.get(id.index())
    }
}

impl<K: Id, V> std::ops::Index<K> for Table<K, V> {
    type Output = V;
    fn index(&self, id: K) -> &V {
        &self.entries[id.index()]
    }
}

impl<K: Id, V: Clone> std::ops::IndexMut<K> for Table<K, V> {
    fn index_mut(&mut self, id: K) -> &mut V {
        &mut Arc::make_mut(&mut self.entries)[id.index()]
    }
}

impl<K: Id, V> From<Vec<V>> for Table<K, V> {
    fn from(entries: Vec<V>) -> Self {
        Table { entries: Arc::new(entries), key: PhantomData }
    }
}

impl<K: Id, V> FromIterator<V> for Table<K, V> {
    fn from_iter<I: IntoIterator<Item = V>>(values: I) -> Self {
        Table { entries: Arc::new(values.into_iter().collect()), key: PhantomData }
    }
}

/// A map keyed by ids most of which are present: as a `BTreeMap`, with one place per id. Copies share their values until
/// one of them is changed.
#[derive(Debug, PartialEq, Eq)]
pub struct Map<K, V> {
    places: Arc<Vec<Option<(K, V)>>>,
    len: usize,
}

impl<K, V> Clone for Map<K, V> {
    fn clone(&self) -> Self {
        Map { places: self.places.clone(), len: self.len }
    }
}

impl<K, V> Default for Map<K, V> {
    fn default() -> Self {
        Map { places: Arc::default(), len: 0 }
    }
}

impl<K: Id, V: Clone> Map<K, V> {
    /// An empty map.
    pub fn new() -> Self {
        Self::default()
    }
    /// An empty map with room for ids below a number.
    pub fn with_capacity(count: usize) -> Self {
        Map { places: Arc::new(Vec::with_capacity(count)), len: 0 }
    }
    /// Puts a value in the place of an id; gives what was there.
    pub fn insert(&mut self, id: K, value: V) -> Option<V> {
        let places = Arc::make_mut(&mut self.places);
        if places.len() == id.index() {
            places.push(Some((id, value)));
            self.len += 1;
            return None;
        }
        if places.len() < id.index() {
            places.resize_with(id.index() + 1, || None);
        }
        let before = places[id.index()].replace((id, value));
        self.len += usize::from(before.is_none());
        before.map(|(_, value)| value)
    }
    /// Takes a value out.
    pub fn remove(&mut self, id: &K) -> Option<V> {
        let (_, value) = Arc::make_mut(&mut self.places).get_mut(id.index())?.take()?;
        self.len -= 1;
        Some(value)
    }
    /// The value of an id.
    pub fn get(&self, id: &K) -> Option<&V> {
        self.places.get(id.index())?.as_ref().map(|(_, value)| value)
    }
    /// The value of an id, to change.
    pub fn get_mut(&mut self, id: &K) -> Option<&mut V> {
        Arc::make_mut(&mut self.places).get_mut(id.index())?.as_mut().map(|(_, value)| value)
    }
    /// Whether the id has a value.
    pub fn contains_key(&self, id: &K) -> bool {
        self.get(id).is_some()
    }
    /// Number of values.
    pub fn len(&self) -> usize {
        self.len
    }
    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }
    /// Ids and values in order.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = (&K, &V)> + Clone {
        self.places.iter().flatten().map(|(id, value)| (id, value))
    }
    /// The ids that have values, in order.
    pub fn keys(&self) -> impl DoubleEndedIterator<Item = &K> + Clone {
        self.iter().map(|(id, _)| id)
    }
    /// The values in order.
    pub fn values(&self) -> impl DoubleEndedIterator<Item = &V> + Clone {
        self.iter().map(|(_, value)| value)
    }
    /// The values in order, to change.
    pub fn values_mut(&mut self) -> impl DoubleEndedIterator<Item = &mut V> {
        Arc::make_mut(&mut self.places).iter_mut().flatten().map(|(_, value)| value)
    }
    /// Keeps only the values for which `keep` holds.
    pub fn retain(&mut self, mut keep: impl FnMut(&K, &mut V) -> bool) {
        for place in Arc::make_mut(&mut self.places) {
            if place.as_mut().is_some_and(|(id, value)| !keep(id, value)) {
                *place = None;
                self.len -= 1;
            }
        }
    }
}

impl<K: Id, V: Clone> std::ops::Index<&K> for Map<K, V> {
    type Output = V;
    fn index(&self, id: &K) -> &V {
        self.get(id).expect("the id has a value")
    }
}

impl<'a, K: Id, V: Clone> IntoIterator for &'a Map<K, V> {
    type Item = (&'a K, &'a V);
    type IntoIter =
        std::iter::Map<std::iter::Flatten<std::slice::Iter<'a, Option<(K, V)>>>, fn(&'a (K, V)) -> (&'a K, &'a V)>;
    fn into_iter(self) -> Self::IntoIter {
        self.places.iter().flatten().map(|(id, value)| (id, value))
    }
}

impl<K: Id, V: Clone> Extend<(K, V)> for Map<K, V> {
    fn extend<I: IntoIterator<Item = (K, V)>>(&mut self, pairs: I) {
        pairs.into_iter().for_each(|(id, value)| {
            self.insert(id, value);
        });
    }
}

impl<K: Id, V: Clone> FromIterator<(K, V)> for Map<K, V> {
    fn from_iter<I: IntoIterator<Item = (K, V)>>(pairs: I) -> Self {
        let pairs = pairs.into_iter();
        let mut map = Map::with_capacity(pairs.size_hint().0);
        map.extend(pairs);
        map
    }
}

impl<K: Id, V: Clone, const N: usize> From<[(K, V); N]> for Map<K, V> {
    fn from(pairs: [(K, V); N]) -> Self {
        pairs.into_iter().collect()
    }
}
