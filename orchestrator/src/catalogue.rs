//! The catalogue of the program that runs.

use std::sync::{Arc, OnceLock};

use engine::Catalogue;

use crate::version;

static CATALOGUE: OnceLock<Arc<Catalogue>> = OnceLock::new();

/// What the program that runs contains; nothing when no program runs, as in a test.
pub fn catalogue() -> &'static Arc<Catalogue> {
    CATALOGUE.get_or_init(|| Arc::new(Catalogue::new(version::ESCAPEMENT)))
}

/// Makes `catalogue` the one of this process.
///
/// # Panics
/// When there is one already: a process is one program.
pub fn set(catalogue: Catalogue) {
    let known = CATALOGUE.set(Arc::new(catalogue));
    assert!(known.is_ok(), "a process is one program");
}
