//! `escapement doctor`: checks of this machine, and remains of dead runs.

use clap::Args;
use serde_json::json;

use engine::run::resources;
use engine::scope;

/// Arguments of `doctor`.
#[derive(Debug, Args)]
pub struct DoctorArgs {
    /// Remove what killed runs left behind
    #[arg(long)]
    pub remove: bool,
    /// Print the findings as JSON
    #[arg(long)]
    pub json: bool,
}

/// Inspects, reports, and removes if requested.
pub fn run(args: &DoctorArgs) -> anyhow::Result<i32> {
    let leftovers = scope::leftovers();
    let unpacked = fmu::leftovers();
    let cores = rustix::thread::sched_getaffinity(None)
        .map(|set| set.count())
        .unwrap_or(0);
    let shared = rustix::fs::statvfs("/dev/shm").ok();
    let free_mib = shared.map(|about| about.f_bavail * about.f_frsize / (1 << 20));
    let warning = resources::warning();
    if args.json {
        let found: Vec<_> = leftovers
            .iter()
            .map(|left| json!({ "folder": left.folder, "scratch": left.scratch, "objects": left.objects, "bytes": left.bytes }))
            .collect();
        let report = json!({ "cores": cores, "shared_memory_free_mib": free_mib, "shared_memory_warning": warning, "leftovers": found, "unpacked": unpacked, "removed": args.remove });
        println!("{}", serde_json::to_string_pretty(&report)?);
    } else {
        println!("cores this program may use: {cores}");
        if let Some(free) = free_mib {
            println!("shared memory free: {free} MiB in /dev/shm");
        }
        if let Some(warning) = &warning {
            println!("warning: {warning}");
        }
        println!(
            "each run keeps its files in a folder {}* of its own, which no other user can enter",
            scope::FOLDERS
        );
        for left in &leftovers {
            println!(
                "a dead run left {} objects ({} KiB) in shared memory, and {}",
                left.objects.len(),
                left.bytes >> 10,
                left.folder.display()
            );
            if let Some(scratch) = &left.scratch {
                println!("a dead run left the folder {}", scratch.display());
            }
        }
        for folder in &unpacked {
            println!("a dead process left an unpacked FMU in {}", folder.display());
        }
        match (leftovers.is_empty() && unpacked.is_empty(), args.remove) {
            (true, _) => println!("no dead run left anything behind"),
            (false, true) => println!("all of it is removed"),
            (false, false) => println!(
                "`escapement doctor --remove` removes it, and so does the next run with participants in processes"
            ),
        }
    }
    if args.remove {
        leftovers.iter().for_each(scope::Leftover::remove);
        fmu::remove_leftovers();
    }
    Ok(0)
}
