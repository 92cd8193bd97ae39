//! The motion of a run for the 3-D playback: a few thousand instants, evenly spaced.

use crate::scene::{BoundScene, Motion};
use tape::{ReadError, Source};

/// Maximum number of instants: 60 s then have one every 20 ms, and the page interpolates between them.
pub(crate) const MAX_FRAMES: u64 = 3000;

/// The motion of a scene, from the tape.
pub(crate) fn extract(source: &dyn Source, scene: &BoundScene) -> Result<Motion, ReadError> {
    let count = source.count(scene.lead);
    let stride = count.div_ceil(MAX_FRAMES).max(1);
    // The last sample is always included: readers look at the end of the run.
    let mut picks: Vec<u64> = (0..count).step_by(stride as usize).collect();
    if count > 0 && picks.last() != Some(&(count - 1)) {
        picks.push(count - 1);
    }
    scene.channels.at(source, scene.lead, &picks)
}
