//! The resources that a run needs from the machine: bytes of shared memory and open files.
//!
//! Nearly every object of iceoryx2 in shared memory fits into one page, so the memory of services is counted in pages. The counts were
//! measured with iceoryx2 0.10.0; `tests/tests/scarce_resources.rs::rings_shrink_where_shared_memory_is_small` checks them.

use std::ops::RangeInclusive;

use super::link::ring_bytes;
use crate::plan::Plan;
use crate::transport::lock_free::entries::record_ring_bytes;

/// The allocation unit of shared memory.
const PAGE: u64 = 4096;
/// Pages of a run: its folder, the orchestrator's node, the clock.
const RUN: u64 = 10;
/// Pages of a participant: its services with the orchestrator's and its own ends, and its node.
const PARTICIPANT: u64 = 46;
/// Additional bytes for each other participant: its places in the services.
const PARTICIPANT_PAIR: u64 = 512;
/// Pages of a link besides its ring.
const LINK: u64 = 8;
/// The largest object of a participant besides its record, bytes. Only the part in use takes memory.
const CONTROL: u64 = 516 * 1024;

/// Open files of the orchestrator: for itself, for each participant, for each link, for each stream of the tape.
const FILES: [u64; 4] = [24, 32, 11, 1];
/// Open files of a participant: for itself, and for each end of a link.
const FILES_OF_PARTICIPANT: [u64; 2] = [50, 20];

/// The resources that a run needs from the machine.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Footprint {
    /// Shared memory of all services besides the rings of records, bytes.
    pub services: u64,
    /// The size of each participant's record, bytes: from the minimum that the participant needs to the optimum.
    pub records: Vec<RangeInclusive<u64>>,
    /// The largest object in shared memory besides records, bytes.
    pub largest: u64,
    /// Files that the orchestrator has open at the same time.
    pub files: u64,
    /// Files that the participant with the most links has open at the same time.
    pub participant_files: u64,
}

/// The footprint of a run of `plan`.
pub fn footprint(plan: &Plan) -> Footprint {
    let (participants, links) = (plan.participants.len(), plan.links.len());
    let count = participants as u64;
    let rings: Vec<u64> = (plan.links.iter())
        .map(|link| {
            let output = &plan.participants[link.from.0].interface.outputs[link.from.1];
            ring_bytes(output.descriptor.size as usize, link.capacity)
        })
        .collect();
    let mut ends = vec![0_u64; participants];
    let all = plan.links.iter().flat_map(|link| [link.from.0, link.to.0]);
    all.for_each(|end| ends[end] += 1);
    let [base, participant, link, stream] = FILES;
    let [own_files, end] = FILES_OF_PARTICIPANT;
    Footprint {
        services: PAGE * (RUN + PARTICIPANT * count + LINK * links as u64)
            + PARTICIPANT_PAIR * count * count
            + rings.iter().map(|ring| ring.next_multiple_of(PAGE)).sum::<u64>(),
        records: (0..participants)
            .map(|number| {
                let sizes: Vec<usize> = plan.recorded_sizes(number).collect();
                record_ring_bytes(&sizes, plan.participants[number].activations)
            })
            .collect(),
        largest: rings.iter().copied().max().unwrap_or(0).max(CONTROL),
        files: base + participant * count + link * links as u64 + stream * plan.stream_count() as u64,
        participant_files: own_files + end * ends.into_iter().max().unwrap_or(0),
    }
}

impl Footprint {
    /// Shared memory of a record with a ring of `ring` bytes.
    pub fn record(ring: u64) -> u64 {
        // One line for the count, and the overhead of iceoryx2 for a segment.
        (ring + 1024).next_multiple_of(PAGE)
    }

    /// The minimum shared memory of the run, bytes.
    pub fn minimum(&self) -> u64 {
        self.services
            + self
                .records
                .iter()
                .map(|room| Footprint::record(*room.start()))
                .sum::<u64>()
    }

    /// The shared memory of the run with rings of the optimum size, bytes.
    pub fn optimum(&self) -> u64 {
        self.services
            + self
                .records
                .iter()
                .map(|room| Footprint::record(*room.end()))
                .sum::<u64>()
    }
}
