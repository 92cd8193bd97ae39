//! The resources of a run in shared memory and open files: compared with what is available before anything is started, and
//! reserved.
//!
//! What a participant records goes through a ring buffer in shared memory. Its size affects no result: a larger one lets the
//! participant continue while the recorder is not scheduled. Where shared memory is small, as in a container, all rings are reduced
//! as far as necessary.

use std::fs::File;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::ExitStatus;

use lockstep::plan::Plan;
use lockstep::transport::iceoryx::{Footprint, footprint};
use rustix::fs::{Access, FallocateFlags, access, fallocate, statvfs};
use rustix::io::Errno;
use rustix::process::{Resource, getrlimit};

use crate::run::outcome::RunFailure;

const SHARED_MEMORY: &str = "/dev/shm";
/// Bytes that are left for other programs.
const SPARE_BYTES: u64 = 256 << 10;
/// A run of a few participants needs about this much free shared memory, with which its rings are already at their smallest.
const SMALL_RUN_BYTES: u64 = 4 << 20;

/// A size in words.
fn mib(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20))
}

/// The capacity of shared memory and the free part of it.
#[derive(Debug, Clone, Copy)]
struct SharedMemory {
    /// Total bytes.
    size: u64,
    /// Free bytes.
    free: u64,
}

impl SharedMemory {
    /// The present state.
    fn now() -> SharedMemory {
        let about = statvfs(SHARED_MEMORY);
        // If the system cannot be asked, a shortage shows when the memory is used.
        about.map_or(
            SharedMemory {
                size: u64::MAX,
                free: u64::MAX,
            },
            |about| SharedMemory {
                size: about.f_blocks * about.f_frsize,
                free: about.f_bavail * about.f_frsize,
            },
        )
    }
}

/// Why no run with processes can use shared memory as it is now, whatever it needs, with the remedy.
fn unusable() -> Option<String> {
    let reason = refused(access(SHARED_MEMORY, Access::WRITE_OK | Access::EXEC_OK).err()?);
    Some(format!(
        "shared memory: {SHARED_MEMORY} {reason}; --in-process runs without it"
    ))
}

/// What the error of an attempt to use the folder of shared memory means, with the remedy.
fn refused(error: Errno) -> String {
    match error {
        Errno::ROFS => {
            format!("is mounted read-only: make it writable, such as with mount -o remount,rw {SHARED_MEMORY}")
        }
        Errno::ACCESS => {
            format!("may not be written by this user: give all users access, such as with chmod 1777 {SHARED_MEMORY}")
        }
        Errno::NOENT => format!("is not there: mount it, such as with mount -t tmpfs tmpfs {SHARED_MEMORY}"),
        error => format!("cannot be used: {error}"),
    }
}

/// What is wrong with shared memory for runs with processes in general, with the remedy: it cannot be used, or is so full that
/// hardly any run fits. [`describe`] compares it with what a certain run needs.
pub fn warning() -> Option<String> {
    let memory = SharedMemory::now();
    let small = || {
        (memory.free < SMALL_RUN_BYTES).then(|| {
            format!(
                "shared memory is too small for most runs with processes: {}",
                free_memory_text()
            )
        })
    };
    unusable().or_else(small)
}

/// The shared memory that a plan needs, in one line.
pub fn describe(plan: &Plan) -> String {
    let (needs, memory) = (footprint(plan), SharedMemory::now());
    format!(
        "shared memory: {} in {SHARED_MEMORY} at least, {} if there is enough; {} of {} are free",
        mib(needs.minimum()),
        mib(needs.optimum()),
        mib(memory.free),
        mib(memory.size)
    )
}

/// The same as figures for programs.
pub fn figures(plan: &Plan) -> serde_json::Value {
    let (needs, memory) = (footprint(plan), SharedMemory::now());
    serde_json::json!({
        "least_bytes": needs.minimum(),
        "best_bytes": needs.optimum(),
        "free_bytes": memory.free,
        "open_files": needs.files,
    })
}

/// The state of shared memory when a page of it was missing, in words that follow what happened.
pub(crate) fn free_memory_text() -> String {
    let memory = SharedMemory::now();
    format!(
        "{} of {} in {SHARED_MEMORY} are free: end what else uses it, or make it larger, such as with docker run --shm-size",
        mib(memory.free),
        mib(memory.size)
    )
}

/// The most likely cause when a process was ended by SIGBUS; empty for other ends.
pub(crate) fn bus_error_hint(status: ExitStatus) -> String {
    match status.signal() {
        Some(libc::SIGBUS) => format!(" (shared memory may have been full; {})", free_memory_text()),
        _ => String::new(),
    }
}

/// The failure that shared memory was full.
pub(crate) fn memory_full() -> RunFailure {
    RunFailure::SharedMemory(format!("shared memory is full: {}", free_memory_text()))
}

/// Refuses a run that exceeds the limits of this process. `domains` is how many domains in shared memory the orchestrator holds at a
/// time: two if the run may move.
fn check_limits(needs: &Footprint, domains: u64) -> Result<(), RunFailure> {
    let refuse = |reason: String| Err(RunFailure::SharedMemory(reason));
    if let Some(most) = getrlimit(Resource::Nofile).current {
        let files = (domains * needs.files).max(needs.participant_files);
        if files > most {
            return refuse(format!(
                "open files: the run needs about {files} in one process, and a process may open {most}: raise the limit (ulimit -n {files}, \
                 or docker run --ulimit nofile={files})"
            ));
        }
    }
    if let Some(most) = getrlimit(Resource::Fsize).current {
        let records = needs.records.iter().map(|sizes| Footprint::record(*sizes.start()));
        let largest = records.max().unwrap_or(0).max(needs.largest);
        if largest > most {
            return refuse(format!(
                "shared memory: the run needs an object of {} KiB, and files may have {} KiB: raise the limit (ulimit -f {})",
                largest.div_ceil(1024),
                most / 1024,
                largest.div_ceil(1024)
            ));
        }
    }
    Ok(())
}

/// Shared memory that is reserved for a run until the run itself allocates it. It is removed with the run's folder.
pub(crate) struct Reservation {
    file: File,
    path: PathBuf,
    /// The size of each participant's ring, bytes.
    rings: Vec<u32>,
    /// The size of all rings.
    records: u64,
}

/// The sizes of rings when `free` bytes are free: all rings are reduced from the best size by the same fraction, and they use at
/// most half of what the least sizes leave, because other runs may start.
fn ring_sizes(needs: &Footprint, free: u64) -> Vec<u32> {
    let spare = free.saturating_sub(needs.minimum()) / 2;
    let extra = (needs.optimum() - needs.minimum()).max(1);
    let share = |sizes: &std::ops::RangeInclusive<u64>| {
        let more = (sizes.end() - sizes.start()) as u128 * u128::from(spare.min(extra)) / u128::from(extra);
        // Rounding down to whole pages keeps the sum within `spare`.
        let ring = sizes.start() + more as u64 / 4096 * 4096;
        ring.min(u64::from(u32::MAX / 64 * 64)) as u32
    };
    needs.records.iter().map(share).collect()
}

/// Refuses to move a run of `plan` to another domain in shared memory if there is no room for its services in addition to the old
/// ones.
pub(crate) fn check_relocation(plan: &Plan) -> Result<(), RunFailure> {
    let (needs, memory) = (footprint(plan), SharedMemory::now());
    if needs.services > memory.free {
        return Err(RunFailure::SharedMemory(format!(
            "shared memory: to be resumed the run needs {}, and {}",
            mib(needs.services),
            free_memory_text()
        )));
    }
    Ok(())
}

/// The size of each participant's ring, bytes, in a run of `plan` that has its services already.
pub(crate) fn ring_sizes_now(plan: &Plan) -> Result<Vec<u32>, RunFailure> {
    let (mut needs, memory) = (footprint(plan), SharedMemory::now());
    needs.services = 0;
    if needs.minimum() > memory.free {
        return Err(RunFailure::SharedMemory(format!(
            "shared memory: what participants record needs {}, and {}",
            mib(needs.minimum()),
            free_memory_text()
        )));
    }
    Ok(ring_sizes(&needs, memory.free.saturating_sub(SPARE_BYTES)))
}

/// Refuses a run of `plan` if the machine does not have enough resources, before anything is created.
pub(crate) fn check(plan: &Plan, relocatable: bool) -> Result<(), RunFailure> {
    let (needs, memory) = (footprint(plan), SharedMemory::now());
    check_limits(&needs, 1 + u64::from(relocatable))?;
    if let Some(reason) = unusable() {
        return Err(RunFailure::SharedMemory(reason));
    }
    let least = least(&needs, relocatable);
    if least > memory.free {
        return Err(too_little_memory(plan, &needs, least, memory));
    }
    Ok(())
}

/// The least free shared memory with which a run starts.
fn least(needs: &Footprint, relocatable: bool) -> u64 {
    needs.minimum() + SPARE_BYTES + if relocatable { needs.services } else { 0 }
}

/// Checks that there is room for a run of `plan`, and reserves it in a file in `folder`. `relocatable` says that the run may be resumed,
/// for which it briefly holds two domains at once.
pub(crate) fn reserve(plan: &Plan, folder: &Path, relocatable: bool) -> Result<Reservation, RunFailure> {
    let needs = footprint(plan);
    let (memory, least) = (SharedMemory::now(), least(&needs, relocatable));
    let more = least - needs.minimum();
    if least > memory.free {
        return Err(too_little_memory(plan, &needs, least, memory));
    }
    let rings = ring_sizes(&needs, memory.free - more);
    let records: u64 = rings.iter().map(|&ring| Footprint::record(u64::from(ring))).sum();
    let path = folder.join("reserved");
    let failed = |source: std::io::Error| RunFailure::SharedMemory(format!("`{}`: {source}", path.display()));
    let file = File::create_new(&path).map_err(failed)?;
    let mut reserved_bytes: u64 = needs.services + records;
    if let Some(most) = getrlimit(Resource::Fsize).current {
        reserved_bytes = reserved_bytes.min(most);
    }
    match fallocate(&file, FallocateFlags::empty(), 0, reserved_bytes) {
        Ok(()) | Err(Errno::OPNOTSUPP) => Ok(Reservation {
            file,
            path,
            rings,
            records,
        }),
        Err(Errno::NOSPC) => Err(too_little_memory(plan, &needs, least, SharedMemory::now())),
        Err(error) => Err(failed(error.into())),
    }
}

impl Reservation {
    /// Releases the memory of the services, which are about to be created.
    pub(crate) fn release_services(&self) {
        // If less was reserved than the rings need, this does not increase it.
        if let Ok(about) = self.file.metadata() {
            let _ = self.file.set_len(about.len().min(self.records));
        }
    }

    /// Releases the rest: participants are about to create their rings, of these sizes. `plan` is the one that runs, with the ports
    /// that programs described.
    pub(crate) fn release_rings(self, plan: &Plan) -> Vec<u32> {
        let _ = std::fs::remove_file(&self.path);
        let least = footprint(plan).records.into_iter().map(|sizes| *sizes.start());
        let rings = self.rings.into_iter().zip(least);
        rings
            .map(|(ring, least)| ring.max(u32::try_from(least).unwrap_or(u32::MAX / 64 * 64)))
            .collect()
    }
}

fn too_little_memory(plan: &Plan, needs: &Footprint, least: u64, memory: SharedMemory) -> RunFailure {
    let (participants, links) = (plan.participants.len() as u64, plan.links.len());
    let fit = participants * memory.free.saturating_sub(SPARE_BYTES) / least;
    let used = memory.size - memory.free.min(memory.size);
    let size = (used + least.max(needs.minimum() + SPARE_BYTES)).div_ceil(1 << 20);
    RunFailure::SharedMemory(format!(
        "shared memory: {participants} participants with {links} links need {} in {SHARED_MEMORY}, and {} of {} are free, enough for about {fit} of \
         the participants: make it {size} MiB, such as with docker run --shm-size={size}m or mount -o remount,size={size}m {SHARED_MEMORY}",
        mib(least),
        mib(memory.free),
        mib(memory.size)
    ))
}
