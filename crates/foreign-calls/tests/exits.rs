//! A process whose foreign code calls `exit`: this test program once more, with the way to end in its environment.

use std::process::{Command, Output};

use foreign_calls::Guard;

const SCENARIO: &str = "EXIT_GUARD_WAY";

fn exit(status: i32) {
    // SAFETY: ends this process, which a test has started for that.
    unsafe { libc::exit(status) };
}

/// Not a test by itself: the child process of the tests below.
#[test]
fn exiting_child_process() {
    let Ok(scenario) = std::env::var(SCENARIO) else { return };
    let outer = Guard::new("outer", |function| format!("`{function}` called exit()"));
    let inner = Guard::new("inner", |function| format!("`{function}` called exit()"));
    match scenario.as_str() {
        "inside" => outer.call("step", || exit(0)),
        "nested" => outer.call("step", || inner.call("log", || exit(0))),
        "after a nested one" => outer.call("step", || {
            inner.call("log", || ());
            exit(7);
        }),
        "outside" => {
            let panicked = std::panic::catch_unwind(|| outer.call("step", || panic!("on purpose")));
            assert!(panicked.is_err());
            exit(7);
        }
        other => panic!("{other}"),
    }
}

fn run(scenario: &str) -> (Option<i32>, String) {
    let program = std::env::current_exe().expect("a test has a program");
    let mut command = Command::new(program);
    command
        .args(["--exact", "exiting_child_process", "--nocapture"])
        .env(SCENARIO, scenario);
    let Output { status, stderr, .. } = command.output().expect("the program can be started");
    (status.code(), String::from_utf8_lossy(&stderr).into_owned())
}

#[test]
fn exit_in_foreign_code_fails_with_its_name() {
    for (scenario, message) in [
        ("inside", "outer: `step` called exit()"),
        ("nested", "inner: `log` called exit()"),
        ("after a nested one", "outer: `step` called exit()"),
    ] {
        let (code, stderr) = run(scenario);
        assert_eq!(code, Some(1), "{scenario}: {stderr}");
        assert!(stderr.contains(message), "{scenario}: {stderr}");
    }
}

#[test]
fn exit_outside_foreign_code_is_unchanged() {
    let (code, stderr) = run("outside");
    assert_eq!(code, Some(7), "{stderr}");
    assert!(!stderr.contains("called exit()"), "{stderr}");
}
