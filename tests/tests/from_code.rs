//! The examples that drive runs from code do what their pages state.

use std::process::Command;

use escapement_tests::program::built;

fn run_example(example: &str) -> String {
    let done = Command::new(built().join(example)).output();
    let done = done.unwrap_or_else(|error| panic!("{example}: {error}; build the workspace first"));
    let (out, err) = (
        String::from_utf8_lossy(&done.stdout),
        String::from_utf8_lossy(&done.stderr),
    );
    assert!(done.status.success() && err.is_empty(), "{example}: {out}{err}");
    out.into_owned()
}

/// The number in front of ` m` in the line that begins with `start`.
fn number_of_metres(out: &str, start: &str) -> f64 {
    let line = out.lines().find(|line| line.starts_with(start));
    let line = line.unwrap_or_else(|| panic!("no line `{start}`: {out}"));
    let words: Vec<&str> = line.split([' ', ',']).collect();
    let at = words.iter().rposition(|word| *word == "m").expect("a depth");
    words[at - 1].parse().expect("a number")
}

#[test]
fn code_that_closes_the_loop_holds_the_level() {
    let out = run_example("closed_loop");
    let last = number_of_metres(&out, "t = 120.0 s");
    assert!((last - 1.0).abs() < 0.02, "{out}");
    assert!(out.contains("Complete, tape "), "{out}");
    assert_eq!(run_example("closed_loop"), out, "the same every time");
}

#[test]
fn better_of_two_branches_is_kept() {
    let out = run_example("two_futures");
    let (idle, pumped) = (
        number_of_metres(&out, "with 0 m^3/s"),
        number_of_metres(&out, "with 0.012 m^3/s"),
    );
    assert!(idle < number_of_metres(&out, "at 60 s") && idle < pumped, "{out}");
    assert_eq!(number_of_metres(&out, "kept: 0 m^3/s"), idle, "{out}");
}

#[test]
fn scenario_built_in_code_gives_one_tape_in_every_way() {
    let out = run_example("without_file");
    let tapes: Vec<&str> = out.lines().filter(|line| line.starts_with("Complete, tape ")).collect();
    assert!(out.contains("the same tape in processes: true"), "{out}");
    assert_eq!(tapes.len(), 3, "{out}");
    assert!(tapes[0] == tapes[1] && tapes[1] != tapes[2], "{out}");
    let filled: Vec<f64> = out
        .lines()
        .filter_map(|line| {
            line.trim_start()
                .strip_prefix("ok")
                .or(line.trim_start().strip_prefix("!!"))
        })
        .filter_map(|line| line.split_whitespace().find_map(|word| word.parse().ok()))
        .collect();
    assert!(filled.len() >= 2 && filled[0] == filled[1], "{out}");
}
