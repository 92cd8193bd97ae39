//! Number of points that one worker runs side by side.

use crate::scenario::{Program, Scenario};

/// The number of points that one core runs most efficiently side by side.
const SIDE_BY_SIDE: usize = if cfg!(target_arch = "x86_64") { 4 } else { 1 };

/// The efficient number of points of `scenario` to run side by side.
pub fn efficient_lanes(scenario: &Scenario) -> usize {
    let is_in_process = !scenario.programs().any(Program::is_external);
    let participants = if is_in_process {
        scenario.make().unwrap_or_default()
    } else {
        Vec::new()
    };
    let batched = participants
        .into_iter()
        .flatten()
        .any(|mut participant| participant.batch_member().is_some());
    if batched { SIDE_BY_SIDE } else { 1 }
}
