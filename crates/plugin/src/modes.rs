//! The floating-point modes with which the participants of a table begin: what the start-up code of its library or program has set.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use foreign_calls::FloatModes;

use crate::table::Table;

/// By the addresses of the tables, which exist to the end.
static MODES: Mutex<BTreeMap<usize, FloatModes>> = Mutex::new(BTreeMap::new());

/// Keeps the modes for `table`, unless it has some: the start-up code runs only once, and later loads of the library do not show its modes.
pub(crate) fn keep(table: &'static Table, modes: FloatModes) {
    let mut all = MODES.lock().unwrap_or_else(PoisonError::into_inner);
    all.entry(std::ptr::from_ref(table).addr()).or_insert(modes);
}

/// The modes for `table`.
pub(crate) fn of(table: &'static Table) -> FloatModes {
    let all = MODES.lock().unwrap_or_else(PoisonError::into_inner);
    all.get(&std::ptr::from_ref(table).addr()).copied().unwrap_or_default()
}
