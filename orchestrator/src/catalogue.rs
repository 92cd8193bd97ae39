//! The catalogue of the running program.

use std::sync::{Arc, OnceLock};

use engine::Catalogue;

use crate::version;

static CATALOGUE: OnceLock<Arc<Catalogue>> = OnceLock::new();

/// The contents of the running program; empty when none is set, as in a test.
pub fn catalogue() -> &'static Arc<Catalogue> {
    CATALOGUE.get_or_init(|| Arc::new(Catalogue::new(version::ESCAPEMENT)))
}

/// Sets the catalogue of this process to `catalogue`.
///
/// # Panics
/// When it is already set: a process is one program.
pub fn set(catalogue: Catalogue) {
    let known = CATALOGUE.set(Arc::new(catalogue));
    assert!(known.is_ok(), "a process is one program");
}
