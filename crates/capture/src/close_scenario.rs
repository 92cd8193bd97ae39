//! The close capture for tests of warnings.

use std::path::Path;

use engine::Catalogue;
use engine::scenario::Scenario;

/// The close capture with changed parameters of its plant.
pub(crate) fn close_with(changes: &[&str]) -> Scenario {
    let catalogue = Catalogue::new("0")
        .participant("plant", plant_proc::factory)
        .participant("controller", controller_proc::factory)
        .participant("guidance", guidance_proc::factory)
        .assessment("capture", crate::assessment::from_setup);
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/close.toml");
    let changes: Vec<String> = changes
        .iter()
        .map(|change| format!("participants.plant.parameters.{change}"))
        .collect();
    Scenario::read(&catalogue, &file, &changes).unwrap()
}
