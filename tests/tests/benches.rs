//! `bench`, when one of its processes dies.

use std::fs;
use std::time::{Duration, Instant};

use escapement_tests::machine::send_signal;
use escapement_tests::program::{start_orchestrator, wait_for_output};
use rustix::process::Signal;

/// The child of `parent` that was started with the argument `argument`.
fn child_with(parent: u32, argument: &str) -> Option<u32> {
    let list = fs::read_to_string(format!("/proc/{parent}/task/{parent}/children")).ok()?;
    let mut children = list.split_whitespace().filter_map(|pid| pid.parse().ok());
    children.find(|pid| {
        let line = fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
        line.split(|byte| *byte == 0).any(|part| part == argument.as_bytes())
    })
}

#[test]
fn bench_ends_with_a_reason_when_its_child_dies() {
    let bench = start_orchestrator(&["bench", "--rounds", "1", "--participants", "2", "--deaths", "0"]);
    let started = Instant::now();
    let bench_child = loop {
        match child_with(bench.id(), "bench-pong") {
            Some(pid) => break pid,
            None => assert!(started.elapsed() < Duration::from_secs(100), "there is no far end"),
        }
        std::thread::sleep(Duration::from_millis(1));
    };
    assert!(send_signal(bench_child, Signal::KILL));
    let output = wait_for_output(bench);
    assert_eq!(output.code, Some(1), "{output:?}");
    assert!(output.err.contains("its far end was ended by signal 9"), "{output:?}");
}
