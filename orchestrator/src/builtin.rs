//! What this program contains: the stock participants, those of its benches, and the assessment of a capture.

use std::sync::{Arc, OnceLock};

use engine::Catalogue;

use crate::bench;

/// The catalogue of this program.
pub fn catalogue() -> &'static Arc<Catalogue> {
    static CATALOGUE: OnceLock<Arc<Catalogue>> = OnceLock::new();
    CATALOGUE.get_or_init(|| {
        let catalogue = Catalogue::new(env!("CARGO_PKG_VERSION"))
            .participant("plant", plant_proc::factory)
            .participant("controller", controller_proc::factory)
            .participant("guidance", guidance_proc::factory)
            .assessment("capture", capture::assessment::from_table);
        Arc::new(bench::register(catalogue))
    })
}
