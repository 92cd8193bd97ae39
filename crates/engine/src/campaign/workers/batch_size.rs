//! Number of points that one worker runs side by side.

use crate::scenario::{Program, Scenario};

/// The efficient number of points of `scenario` to run side by side.
pub fn efficient_lanes(scenario: &Scenario) -> usize {
    let is_in_process = !scenario.programs().any(Program::is_external);
    let participants = if is_in_process {
        scenario.make().unwrap_or_default()
    } else {
        Vec::new()
    };
    let sizes = participants
        .into_iter()
        .flatten()
        .filter_map(|mut participant| participant.batch_member().map(|member| member.efficient_size()));
    sizes.max().unwrap_or(1)
}
