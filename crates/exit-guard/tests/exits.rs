//! A process whose foreign code calls `exit`: this test program once more, with the way of ending in its environment.

use std::process::{Command, Output};

use exit_guard::Guard;

const SCENARIO: &str = "EXIT_GUARD_WAY";

fn exit(status: i32) {
    // SAFETY: ends this process, which a test has started for that.
    unsafe { libc::exit(status) };
}

/// Not a test by itself: what the child does.
#[test]
fn exiting_child_process() {
    let Ok(way) = std::env::var(SCENARIO) else { return };
    let outer = Guard::new("outer", |function| format!("`{function}` called exit()"));
    let inner = Guard::new("inner", |function| format!("`{function}` called exit()"));
    match way.as_str() {
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

fn run(way: &str) -> (Option<i32>, String) {
    let program = std::env::current_exe().expect("a test has a program");
    let mut command = Command::new(program);
    command.args(["--exact", "exiting_child_process", "--nocapture"]).env(SCENARIO, way);
    let Output { status, stderr, .. } = command.output().expect("the program can be started");
    (status.code(), String::from_utf8_lossy(&stderr).into_owned())
}

#[test]
fn exit_in_foreign_code_fails_with_its_name() {
    for (way, words) in [
        ("inside", "outer: `step` called exit()"),
        ("nested", "inner: `log` called exit()"),
        ("after a nested one", "outer: `step` called exit()"),
    ] {
        let (code, said) = run(way);
        assert_eq!(code, Some(1), "{way}: {said}");
        assert!(said.contains(words), "{way}: {said}");
    }
}

#[test]
fn exit_outside_foreign_code_is_unchanged() {
    let (code, said) = run("outside");
    assert_eq!(code, Some(7), "{said}");
    assert!(!said.contains("called exit()"), "{said}");
}
