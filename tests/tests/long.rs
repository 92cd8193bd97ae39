//! A small part of the long tests, by their own command. `docs/hazards.md` describes a round and the checks after it.

use std::process::{Command, Stdio};

use escapement_tests::program::participant;

/// Some rounds of `kind`, all of which succeed.
fn rounds(kind: &str, count: &str, more: &[&str]) {
    let output = Command::new(participant("long"))
        .args([kind, "--rounds", count, "--jobs", "4"])
        .args(more)
        .stdin(Stdio::null())
        .output()
        .expect("the program can be started");
    let (out, err) = (
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr),
    );
    assert!(output.status.success(), "{out}{err}");
}

#[test]
fn random_signals_lose_no_data_and_leave_nothing() {
    rounds("killer", "48", &[]);
}

#[test]
fn suspensions_fail_no_healthy_run() {
    rounds("suspensions", "12", &[]);
}

#[test]
fn undisturbed_starts_all_succeed() {
    rounds("starts", "100", &["--beside-load"]);
}
