//! The named entries of a scenario's sections.

use std::collections::{BTreeMap, btree_map};
use std::ops::{Deref, DerefMut, Index, IndexMut};

use crate::scenario::names::unknown;

/// Entries in the order of their names: a `BTreeMap` whose entries can also be changed as `entries["name"]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Entries<T>(BTreeMap<String, T>);

impl<T> Default for Entries<T> {
    fn default() -> Entries<T> {
        Entries(BTreeMap::new())
    }
}

impl<T> Deref for Entries<T> {
    type Target = BTreeMap<String, T>;

    fn deref(&self) -> &BTreeMap<String, T> {
        &self.0
    }
}

impl<T> DerefMut for Entries<T> {
    fn deref_mut(&mut self) -> &mut BTreeMap<String, T> {
        &mut self.0
    }
}

impl<T> Index<&str> for Entries<T> {
    type Output = T;

    /// # Panics
    /// When there is no such entry; `get` checks for that.
    fn index(&self, name: &str) -> &T {
        match self.0.get(name) {
            Some(entry) => entry,
            None => panic!("{}", unknown("entry", name, self.0.keys())),
        }
    }
}

impl<T> IndexMut<&str> for Entries<T> {
    /// # Panics
    /// When there is no such entry; `get_mut` checks for that.
    fn index_mut(&mut self, name: &str) -> &mut T {
        let none = (!self.0.contains_key(name)).then(|| unknown("entry", name, self.0.keys()));
        match self.0.get_mut(name) {
            Some(entry) => entry,
            None => panic!("{}", none.unwrap_or_default()),
        }
    }
}

impl<T> FromIterator<(String, T)> for Entries<T> {
    fn from_iter<I: IntoIterator<Item = (String, T)>>(entries: I) -> Entries<T> {
        Entries(entries.into_iter().collect())
    }
}

impl<T> IntoIterator for Entries<T> {
    type Item = (String, T);
    type IntoIter = btree_map::IntoIter<String, T>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.into_iter()
    }
}

impl<'a, T> IntoIterator for &'a Entries<T> {
    type Item = (&'a String, &'a T);
    type IntoIter = btree_map::Iter<'a, String, T>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.iter()
    }
}

impl<'a, T> IntoIterator for &'a mut Entries<T> {
    type Item = (&'a String, &'a mut T);
    type IntoIter = btree_map::IterMut<'a, String, T>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.iter_mut()
    }
}
