//! Runs driven by a program in C.

use std::process::Command;
use std::sync::OnceLock;

use escapement_tests::compiler::{NativeBuild, run_checked, syntax_check};
use escapement_tests::program::{Folder, root};

fn native_build() -> &'static NativeBuild {
    static NATIVE_BUILD: OnceLock<NativeBuild> = OnceLock::new();
    NATIVE_BUILD.get_or_init(|| NativeBuild::new("callers"))
}

/// The mass of the example, computed by the test: position after 2 s, and the farthest one.
fn expected_motion() -> (f64, f64) {
    let (mut position, mut velocity, mut farthest) = (0.02_f64, 0.0, 0.02_f64);
    for step in 0..2000 {
        let neighbour = 0.002 * f64::from(step / 10 % 50);
        let pull = 20.0 * (neighbour - position) - 40.0 * position;
        velocity += 0.001 * (pull - 0.5 * velocity);
        position += 0.001 * velocity;
        farthest = farthest.max(position.abs());
    }
    (position, farthest)
}

#[test]
fn program_in_c_drives_a_run_and_goes_back() {
    let program = native_build().caller("examples/c/drive.c", "drive");
    let output = run_checked(Command::new(program).arg(root().join("examples/c/drive.toml")));
    let lines: Vec<&str> = output.lines().collect();
    assert_eq!(lines.len(), 4, "{output}");
    assert_eq!(
        (lines[0], lines[1]),
        (lines[2], lines[3]),
        "the second run went back: {output}"
    );
    let number = |line: &str, before: &str| {
        let (_, rest) = line
            .split_once(before)
            .unwrap_or_else(|| panic!("no `{before}` in {line}"));
        let end = rest.find(" m").expect("a unit");
        rest[..end].parse::<f64>().expect("a number")
    };
    let (position, farthest) = expected_motion();
    assert_eq!(number(lines[0], "position "), position);
    assert_eq!(number(lines[1], "farthest "), farthest);
    assert!(lines[0].starts_with("t = 2 s"), "{output}");
    let program = native_build().caller("examples/cpp/drive.cpp", "drive-cpp");
    let also = run_checked(Command::new(program).arg(root().join("examples/c/drive.toml")));
    assert_eq!(also.lines().collect::<Vec<_>>(), lines[..2], "in C++");
    assert!(lines[1].contains("complete 1"), "{output}");
}

#[test]
fn misuse_by_a_caller_is_refused_with_the_reason() {
    let program = native_build().caller("tests/plugins/caller.c", "caller");
    let folder = Folder::new("caller");
    let output = run_checked(
        Command::new(program)
            .current_dir(folder.path())
            .arg(root().join("examples/c/drive.toml")),
    );
    for expected in [
        "no file: nowhere.toml: cannot be read",
        "after that: there is no run",
        "no name: the name of the scenario is NULL",
        "small options: the options say that they have 4 bytes",
        "drive.toml: participants.mass.period: ",
        "it must be positive",
        "no run: there is no run (NULL)",
        "unknown output: `mass.motto`",
        "there is `mass.motion`",
        "unknown field: ",
        "wrong count: `mass.motion.position` has 1 elements, and 2",
        "no place: the place of the values is NULL",
        "unknown log: ",
        "there is no such participant; there is `mass`",
        "small sample: the sample says that it has 8 bytes",
        "unknown input: ",
        "it has `neighbour`",
        "wrong size: ",
        "has 16 bytes, not 8",
        "not a number: ",
        "a value must be finite",
        "unknown figure: there is no figure `nearest`; there is `farthest`",
        "no instant: NaN s is no instant",
        "back: ",
        "has passed",
        "behind the end: ",
        "no checkpoint: the checkpoint is NULL",
        "another one's checkpoint: ",
        "of another run",
        "nothing kept: ",
        "Record::Memory",
        "small outcome: the outcome says that it has 4 bytes",
        "after the end: there is no run any more",
        "failed run: participant `mass`: ",
        "28 refused",
    ] {
        assert!(output.contains(expected), "no `{expected}` in:\n{output}");
    }
    assert!(!output.contains("TAKEN"), "{output}");
}

#[test]
fn wrapper_in_cpp_returns_the_reason_of_a_struct_that_does_not_fit() {
    let program = native_build().caller("tests/plugins/caller.cpp", "caller-cpp");
    let output = run_checked(Command::new(program).arg(root().join("examples/c/drive.toml")));
    let expected = "`mass.motion` has 16 bytes, and the struct has 8: declare its fields as the message does";
    assert_eq!(output.lines().collect::<Vec<_>>(), [expected, "then none"]);
}

#[test]
fn run_header_agrees_with_the_library() {
    use std::mem::offset_of;

    use run_c::{Options, Outcome, Sample};
    let mut lines: Vec<(String, usize)> = vec![("ESCAPEMENT_RUN_ABI".into(), run_c::ABI as usize)];
    macro_rules! layout {
        ($($c:literal: $rust:ty { $($field:ident),* })*) => {$(
            lines.push((format!("sizeof({})", $c), size_of::<$rust>()));
            $(lines.push((format!("offsetof({}, {})", $c, stringify!($field)), offset_of!($rust, $field)));)*
        )*};
    }
    layout! {
        "escapement_run_options": Options { size, record, folder, changes, change_count, reserved }
        "escapement_run_sample": Sample { size, reserved, index, stamp, bytes, byte_count }
        "escapement_run_outcome": Outcome { size, complete, met, reserved, simulated, digest }
    }
    let asserts = lines
        .iter()
        .map(|(what, value)| format!("_Static_assert({what} == {value}ull, \"{what}\");\n"));
    let folder = Folder::new("run-header");
    let text = format!(
        "#include <stddef.h>\n#include <escapement-run.h>\n{}",
        asserts.collect::<String>()
    );
    let source = folder.write("layout.c", &text);
    let include = native_build().path("prefix/include");
    for (compiler, standard) in [("cc", "-std=c11"), ("c++", "-std=c++17")] {
        // In C++ the header alone is used.
        let source = if compiler == "cc" {
            source.clone()
        } else {
            folder.write("layout.cpp", "#include <escapement-run.h>\n")
        };
        run_checked(syntax_check(compiler, standard, &include).arg(source));
    }
}
