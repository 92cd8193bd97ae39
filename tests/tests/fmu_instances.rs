//! FMUs are created and dropped in one process, as by the points of a campaign in a worker: nothing of them remains. The figures come from
//! the C library's allocator and from `/proc/self`; no other test of this file disturbs them, and they do not depend on time.

use std::path::Path;

use escapement_tests::fmus::TestFmu;
use escapement_tests::program::Folder;
use lockstep::participant::{Inputs, Outputs, Setup, Step};

/// By then, caches and tables have their final size.
const FIRST: u64 = 100;
const MANY: u64 = 1000;
/// Tolerance for other allocations: the first block that an instance of the smallest FMU would leak a thousand times is larger.
const SLACK: usize = 64 << 10;

/// Creates an FMU, steps it a few times, saves it and drops it.
fn use_instance(file: &Path, number: u64) {
    let setup = Setup {
        name: format!("it-{number}"),
        parameters: toml::Table::new(),
        seed: number,
        period: 0.01,
        offset: 0.0,
    };
    let mut it = fmu::participant(file, "", &setup, false).expect("it is healthy");
    let interface = it.interface();
    let (inputs, mut outputs) = (Inputs::zeroed(&interface), Outputs::zeroed(&interface));
    it.initialise(0.0, &mut outputs).expect("it starts");
    for index in 0..5 {
        let step = Step {
            index,
            t: index as f64 * 0.01,
            t_next: (index + 1) as f64 * 0.01,
            period: 0.01,
        };
        it.step(&step, &inputs, &mut outputs).expect("it steps");
    }
    let state = it.save().expect("it is saved");
    it.restore(&state).expect("it goes back");
}

/// Heap bytes, including those of FMU libraries; pages of the process; mappings of FMUs; open files.
fn resource_usage() -> (usize, usize, usize, usize) {
    // SAFETY: it only reads the allocator's counters.
    let heap = unsafe { libc::mallinfo2() };
    let statm = std::fs::read_to_string("/proc/self/statm").expect("Linux has it");
    let pages = statm.split_whitespace().nth(1).and_then(|pages| pages.parse().ok());
    let maps = std::fs::read_to_string("/proc/self/maps").expect("Linux has it");
    let mapped = maps.lines().filter(|line| line.contains(fmu::FOLDER)).count();
    let files = std::fs::read_dir("/proc/self/fd").expect("Linux has it").count();
    (heap.uordblks + heap.hblkhd, pages.expect("a number"), mapped, files)
}

#[test]
fn thousand_instances_leave_nothing_behind() {
    let folder = Folder::new("instances");
    // One that can save its state, and one that is restored by a restart; with a thread that each instance ends before it ends itself.
    for (version, state, fault) in [
        (2, true, "NO_FAULT"),
        (3, false, "NO_FAULT"),
        (2, true, "JOINED_THREAD"),
    ] {
        let recipe = TestFmu {
            state,
            fault,
            ..TestFmu::new(version)
        };
        let file = recipe.build(&folder, &format!("spring-{version}-{fault}"));
        (0..FIRST).for_each(|number| use_instance(&file, number));
        let before = resource_usage();
        (0..MANY).for_each(|number| use_instance(&file, number));
        let after = resource_usage();
        let shown = format!("FMI {version}, {fault}, state functions: {state}: {before:?}, then {after:?}");
        assert!(after.0 <= before.0 + SLACK, "bytes of the heap: {shown}");
        // 16 MiB of 4 KiB pages: a library that stays loaded takes 5 of them.
        assert!(after.1 <= before.1 + 4096, "pages: {shown}");
        assert_eq!(
            (after.2, after.3),
            (0, before.3),
            "mapped libraries and open files: {shown}"
        );
    }
}
