//! Mistakes in a function table or a library: each gives one clear error, with file, line, participant and remedy, and never ends the
//! host program.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use escapement_tests::compiler::{NativeBuild, run_checked, syntax_check};
use escapement_tests::machine::{send_signal, wait_for_bytes};
use escapement_tests::program::{
    Folder, ProgramOutput, root, run_orchestrator, start_orchestrator, text, wait_for_output,
};

fn native_build() -> &'static NativeBuild {
    static NATIVE_BUILD: OnceLock<NativeBuild> = OnceLock::new();
    NATIVE_BUILD.get_or_init(|| NativeBuild::new("misuse"))
}

/// The participant with the mistake `misuse`, as a plug-in.
fn misuse(misuse: &str) -> PathBuf {
    let define = format!("-DMISUSE=\"{misuse}\"");
    native_build().plugin("tests/plugins/misuse.c", &format!("lib{misuse}.so"), &[&define])
}

/// A scenario with one participant, `counter`, whose `run` is in line 4.
fn scenario(folder: &Folder, run: &str) -> PathBuf {
    let text = format!(
        "title = \"One participant\"\nduration = \"1 s\"\n[participants.counter]\nrun = {run}\nperiod = \"10 ms\"\n"
    );
    folder.write("one.toml", &text)
}

fn run(folder: &Folder, scenario: &Path, how: &[&str]) -> ProgramOutput {
    let out = folder.path().join("run");
    let _ = std::fs::remove_dir_all(&out);
    run_orchestrator(&[&["run", text(scenario), "--quiet", "--out", text(&out)], how].concat())
}

/// Runs a library in a separate process and in this one, and expects `code` and all of `words` each time.
fn assert_plugin_refused(library: &Path, code: i32, words: &[&str]) {
    let folder = Folder::new("misuse");
    let file = scenario(&folder, &format!("{{ library = {:?} }}", text(library)));
    for how in [&[][..], &["--in-process"]] {
        let output = run(&folder, &file, how);
        assert_eq!(output.code, Some(code), "{}: {output:?}", library.display());
        for word in words {
            assert!(
                output.err.contains(word),
                "{} {how:?}: no `{word}` in {}",
                library.display(),
                output.err
            );
        }
        assert!(!output.err.contains("panicked"), "{}", output.err);
    }
}

#[test]
fn healthy_plugin_runs() {
    let folder = Folder::new("healthy");
    let library = misuse("nothing");
    let file = scenario(&folder, &format!("{{ library = {:?} }}", text(&library)));
    for how in [&[][..], &["--in-process"]] {
        let output = run(&folder, &file, how);
        assert_eq!(output.code, Some(0), "{output:?}");
    }
}

#[test]
fn plugin_knows_whether_its_output_is_seen() {
    let folder = Folder::new("unseen");
    let library = misuse("unseen");
    let file = scenario(&folder, &format!("{{ library = {:?} }}", text(&library)));
    for how in [&[][..], &["--in-process"]] {
        let output = run(&folder, &file, how);
        assert!(
            output.code == Some(1) && output.err.contains("the count is seen"),
            "{output:?}"
        );
        let output = run(&folder, &file, &[how, &["--set", "record.counter=false"]].concat());
        assert_eq!(output.code, Some(0), "{output:?}");
    }
}

#[test]
fn unusable_tables_are_refused_before_anything_runs() {
    for (wrong, words) in [
        (
            "version",
            &["ABI version 7", "compile it with this program's escapement.h"][..],
        ),
        ("size", &["16 bytes", "ESCAPEMENT_TABLE"]),
        ("null-step", &["`step` is NULL"]),
        ("half", &["`restore` is NULL", "`save` is not"]),
        ("no-name", &["has no name"]),
        ("state-size", &["state_size is 100 bytes", "own_size 16"]),
        ("empty", &["has no participant", "ESCAPEMENT_PLUGIN"]),
        ("no-kind", &["ESCAPEMENT_SAMPLED", "counter"]),
        ("port-twice", &["`count` is declared twice", "counter"]),
        ("padding", &["do not fill the payload", "counter"]),
        (
            "steering-field",
            &["port `odd`", r"field `width\u{a}`", "control character", "counter"],
        ),
        (
            "own-past-end",
            &["`describe` wrote past the end of its own memory", "16 bytes", "counter"],
        ),
    ] {
        assert_plugin_refused(
            &misuse(wrong),
            2,
            &[words, &["one.toml:4", "participants.counter.run"]].concat(),
        );
    }
    assert_plugin_refused(
        &misuse("no-reason"),
        2,
        &["one.toml", "participants.counter", "`describe` returned 7"],
    );
}

#[test]
fn wrong_result_of_a_step_is_the_participants_failure() {
    for (wrong, words) in [
        (
            "past-end",
            &[
                "counter",
                "`step` wrote past the end of output `count`",
                "16 bytes",
                "0.05",
            ][..],
        ),
        (
            "before-start",
            &["counter", "`step` wrote before the start of output `count`"],
        ),
        (
            "to-input",
            &["counter", "`step` wrote to input `other`, which is const", "0.05"],
        ),
        (
            "past-input",
            &["counter", "`step` wrote past the end of input `other`", "16 bytes"],
        ),
        ("fails", &["counter", "the count is 6; at most 5 are allowed", "0.05"]),
        // Cut in front of a character of two bytes of which only one fits.
        ("fails-at-length", &["counter", "aaaaaaaa", "0.05"]),
        (
            "fails-in-latin-1",
            &["counter", "the angle is 100\u{fffd}, too large", "0.05"],
        ),
        ("late-parameter", &["counter", "in `describe` only"]),
        ("exit", &["counter", "`step` called exit()"]),
    ] {
        assert_plugin_refused(&misuse(wrong), 1, words);
    }
}

#[test]
fn signal_during_a_step_is_reported_and_the_second_ends_the_run() {
    let folder = Folder::new("hangs");
    let file = scenario(&folder, &format!("{{ library = {:?} }}", text(&misuse("hangs"))));
    let out = folder.path().join("run");
    ends_at_second_signal(
        &["run", text(&file), "--quiet", "--in-process", "--out", text(&out)],
        &out,
    );
}

#[test]
fn signal_during_a_replayed_step_is_reported_and_ends_it() {
    let folder = Folder::new("hangs-in-replay");
    let file = scenario(&folder, &format!("{{ library = {:?} }}", text(&misuse("nothing"))));
    let output = run(&folder, &file, &[]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let hangs = format!("participants.counter.run={{ library = {:?} }}", text(&misuse("hangs")));
    let (recorded, out) = (folder.path().join("run"), folder.path().join("replay"));
    let replay = ["replay", text(&recorded), "--participant", "counter", "--set", &hangs];
    ends_at_second_signal(&[&replay[..], &["--quiet", "--out", text(&out)]].concat(), &out);
}

/// Starts a command whose participant `counter` hangs in a step in this process, and sends two signals.
fn ends_at_second_signal(command: &[&str], out: &Path) {
    let mut child = start_orchestrator(command);
    wait_for_bytes(&mut child, &out.join("log/counter.stderr"), 5);
    assert!(send_signal(child.id(), rustix::process::Signal::TERM));
    // The words come after one second.
    std::thread::sleep(std::time::Duration::from_secs(3));
    assert!(child.try_wait().is_ok_and(|ended| ended.is_none()));
    assert!(send_signal(child.id(), rustix::process::Signal::INT));
    let output = wait_for_output(child);
    assert_eq!(output.code, Some(1), "{output:?}");
    let words = "waiting for a participant in its step; again to end at once";
    assert!(output.err.contains(words), "{output:?}");
}

#[test]
fn failed_save_is_reported_with_its_message() {
    assert_save_fails("save-fails", &["its `save` failed: the file of the state is locked"]);
}

/// The size is refused before anything is read: there are not so many bytes.
#[test]
fn state_that_is_too_large_is_refused_with_its_size() {
    assert_save_fails(
        "save-much",
        &["its state has 68157440 bytes", "63 MiB", "or run without"],
    );
}

/// Saves the participant with the mistake `misuse` as a library in a process, in this one, and as a program.
fn assert_save_fails(misuse: &str, words: &[&str]) {
    let folder = Folder::new("unsaved");
    let define = format!("-DMISUSE=\"{misuse}\"");
    let program = native_build().program("tests/plugins/misuse.c", &format!("program-{misuse}"), &[&define]);
    let library = format!("{{ library = {:?} }}", text(&self::misuse(misuse)));
    let exe = format!("{{ exe = {:?} }}", text(&program));
    for (run, how) in [(&library, &[][..]), (&library, &["--in-process"]), (&exe, &[])] {
        let file = scenario(&folder, run);
        let output = self::run(&folder, &file, &[how, &["--checkpoint-at", "0.5 s"]].concat());
        assert_eq!(output.code, Some(1), "{output:?}");
        for word in [&["`counter`", "cannot save its state"], words].concat() {
            assert!(output.err.contains(word), "no `{word}` in {output:?}");
        }
        assert!(!output.err.contains("implement"), "{output:?}");
    }
}

#[test]
fn program_with_an_unusable_table_is_refused_by_its_name() {
    let folder = Folder::new("misuse-program");
    for (wrong, word) in [("version", "ABI version 7"), ("null-step", "`step` is NULL")] {
        let define = format!("-DMISUSE=\"{wrong}\"");
        let program = native_build().program("tests/plugins/misuse.c", &format!("program-{wrong}"), &[&define]);
        let file = scenario(&folder, &format!("{{ exe = {:?} }}", text(&program)));
        let output = run(&folder, &file, &[]);
        assert_eq!(output.code, Some(2), "{output:?}");
        for word in [word, "one.toml:4", "counter"] {
            assert!(output.err.contains(word), "{output:?}");
        }
        // The participant was not started for a run.
        let alone = std::process::Command::new(&program)
            .output()
            .expect("it can be started");
        assert_eq!(alone.status.code(), Some(2), "{alone:?}");
    }
}

#[test]
fn exceptions_become_failures_with_their_message() {
    let library = native_build().plugin("tests/plugins/throws.cpp", "libthrows.so", &[]);
    let folder = Folder::new("throws");
    let file = scenario(&folder, &format!("{{ library = {:?} }}", text(&library)));
    for (parameters, code, words) in [
        (
            "pair = \"[1, 2] m\"",
            1,
            &["counter", "the fifth step is one too many", "0.05"][..],
        ),
        (
            "pair = \"[1, 2] m\", something = true",
            1,
            &["counter", "no std::exception"],
        ),
        (
            "early = true",
            2,
            &["participants.counter", "it cannot be made on a Tuesday"],
        ),
        (
            "something = true",
            2,
            &["participants.counter.parameters.pair", "missing"],
        ),
        (
            "pair = \"[1, 2, 3] m\"",
            2,
            &["one.toml", "parameters.pair", "2 numbers"],
        ),
        ("pair = \"[1, 2] kg\"", 2, &["parameters.pair", "dimension"]),
        ("pair = \"[1, 2] m\", number = 4", 2, &["parameters.number", "it is 3"]),
        (
            "pair = \"[1, 2] m\", numbr = 3",
            2,
            &["parameters.numbr", "knows no such parameter", "`number`"],
        ),
    ] {
        let set = format!("participants.counter.parameters={{ {parameters} }}");
        for how in [&["--set", &set][..], &["--set", &set, "--in-process"]] {
            let output = run(&folder, &file, how);
            assert_eq!(output.code, Some(code), "{parameters}: {output:?}");
            for word in words {
                assert!(output.err.contains(word), "{parameters}: no `{word}` in {}", output.err);
            }
        }
    }
}

/// A member that would never be called, or would save nothing, does not compile.
#[test]
fn optional_members_with_another_signature_do_not_compile() {
    let include = native_build().path("prefix/include");
    for (member, remedy) in [
        ("void state(escapement::State &state) { state(mass); }", None),
        ("void initialise(double) { *motion = mass; }", None),
        ("void terminate(escapement::Termination) {}", None),
        // Data of the same name is no function that is never called.
        ("Motion state{};", None),
        (
            "void state(escapement::State state) { state(mass); }",
            Some("void state(escapement::State &state)"),
        ),
        ("void state() {}", Some("void state(escapement::State &state)")),
        ("void initialise() {}", Some("void initialise(double t)")),
        (
            "void terminate() {}",
            Some("void terminate(escapement::Termination why)"),
        ),
    ] {
        let compiler = syntax_check("c++", "-std=c++17", &include)
            .arg(format!("-DMEMBER={member}"))
            .arg(root().join("tests/plugins/optional.cpp"))
            .output()
            .expect("there is a compiler");
        let words = String::from_utf8_lossy(&compiler.stderr);
        assert_eq!(compiler.status.success(), remedy.is_none(), "{member}: {words}");
        if let Some(remedy) = remedy {
            assert!(words.contains(remedy), "{member}: no `{remedy}` in {words}");
        }
    }
}

#[test]
fn files_that_are_no_plugin_are_refused_with_line_and_key() {
    let (folder, native_build) = (Folder::new("no-plugin"), native_build());
    let text_file = folder.write("libtext.so", "this is a text and no library at all\n");
    let place = &["one.toml:4", "participants.counter.run"][..];
    let place = |words: &[&'static str]| [words, place].concat();
    assert_plugin_refused(&text_file, 2, &place(&["is not an ELF file"]));
    assert_plugin_refused(&folder.path().join("gone.so"), 2, &place(&["No such file"]));
    assert_plugin_refused(folder.path(), 2, &place(&["is not a file"]));
    let source = folder.write("other.c", "int other(void) { return 1; }\n");
    let object = folder.path().join("other.o");
    run_checked(
        std::process::Command::new("cc")
            .arg("-c")
            .arg(&source)
            .arg("-o")
            .arg(&object),
    );
    assert_plugin_refused(&object, 2, &place(&["not a shared library"]));
    let other = folder.path().join("libother.so");
    run_checked(
        std::process::Command::new("cc")
            .args(["-shared", "-fPIC"])
            .arg(&source)
            .arg("-o")
            .arg(&other),
    );
    assert_plugin_refused(
        &other,
        2,
        &place(&["no function `escapement_plugin`", "ESCAPEMENT_PLUGIN"]),
    );
    // A plug-in that still has its main requires the host of a program.
    let with_main = native_build.plugin("tests/plugins/misuse.c", "libmain.so", &["-DMISUSE=\"nothing\""]);
    let mut bytes = std::fs::read(&with_main).expect("it was just made");
    // Of another machine: e_machine is 183, AArch64, or 62 where this is one.
    bytes[18] = if bytes[18] == 183 { 62 } else { 183 };
    let foreign = folder.path().join("libforeign.so");
    std::fs::write(&foreign, &bytes).expect("the folder can be written");
    assert_plugin_refused(&foreign, 2, &place(&["compile it for this machine"]));
    let needy = folder.write(
        "needy.c",
        "extern int nobody_has_this(void);\nint other(void) { return nobody_has_this(); }\n",
    );
    let library = folder.path().join("libneedy.so");
    run_checked(
        std::process::Command::new("cc")
            .args(["-shared", "-fPIC"])
            .arg(&needy)
            .arg("-o")
            .arg(&library),
    );
    assert_plugin_refused(&library, 2, &place(&["nobody_has_this", "must be linked with it"]));
}

#[test]
fn invalid_run_tables_are_refused() {
    let folder = Folder::new("run-table");
    let library = misuse("nothing");
    let file = text(&library);
    for (run, word) in [
        (
            format!("{{ library = {file:?}, participant = \"other\" }}"),
            "it has `misuse`",
        ),
        (
            format!("{{ library = {file:?}, args = [\"x\"] }}"),
            "a library takes no args",
        ),
        (
            format!("{{ library = {file:?}, builtin = \"plant\" }}"),
            "library = \"FILE.so\"",
        ),
        (
            "{ builtin = \"plant\", participant = \"x\" }".to_owned(),
            "chooses one of a library",
        ),
    ] {
        let scenario = scenario(&folder, &run);
        let output = self::run(&folder, &scenario, &[]);
        assert_eq!(output.code, Some(2), "{output:?}");
        for word in [word, "one.toml:4"] {
            assert!(output.err.contains(word), "no `{word}` in {output:?}");
        }
    }
}

/// `escapement.h` and the types of the package `plugin` have the same sizes, offsets and numbers.
#[test]
fn header_agrees_with_the_library() {
    use std::mem::offset_of;

    use plugin::table::{Field, Host, Message, Step, Table};
    let mut lines: Vec<(String, usize)> = Vec::new();
    macro_rules! layout {
        ($($c:literal: $rust:ty { $($field:ident),* })*) => {$(
            lines.push((format!("sizeof({})", $c), size_of::<$rust>()));
            $(lines.push((format!("offsetof({}, {})", $c, stringify!($field)), offset_of!($rust, $field)));)*
        )*};
    }
    layout! {
        "escapement_field": Field { name, unit, frame, element, offset, rank, extents }
        "escapement_message": Message { name, fields, field_count, size }
        "escapement_step": Step { size, reserved, index, t, t_next, period }
        "escapement_host": Host {
            size, abi, name, seed, period, offset, kind, input, output, numbers, integer, flag, text, parameters, refuse, fail,
            log, state, uniform, normal, seen, termination
        }
        "escapement_participant": Table {
            size, abi, name, version, own_size, state_size, describe, initialise, step, save, restore, terminate
        }
    }
    for (name, value) in [
        ("ESCAPEMENT_ABI", plugin::table::ABI as usize),
        ("ESCAPEMENT_SAMPLED", plugin::table::SAMPLED as usize),
        ("ESCAPEMENT_CONTINUOUS", plugin::table::CONTINUOUS as usize),
        ("ESCAPEMENT_RANK_MAX", plugin::table::RANK_MAX),
        ("ESCAPEMENT_OK", plugin::table::OK as usize),
        ("ESCAPEMENT_FAILED", plugin::table::FAILED as usize),
        ("ESCAPEMENT_STATELESS", plugin::table::STATELESS as usize),
        ("ESCAPEMENT_SEEN_NOW", plugin::table::SEEN_NOW as usize),
        ("ESCAPEMENT_SEEN_EVER", plugin::table::SEEN_EVER as usize),
        ("ESCAPEMENT_FINISHED", plugin::table::FINISHED as usize),
        ("ESCAPEMENT_STOPPED", plugin::table::STOPPED as usize),
        ("ESCAPEMENT_REPLACED", plugin::table::REPLACED as usize),
    ] {
        lines.push((name.to_owned(), value));
    }
    for (at, element) in plugin::table::ELEMENTS.iter().enumerate() {
        lines.push((format!("ESCAPEMENT_{}", element.name().to_uppercase()), at + 1));
    }
    let asserts: String = lines
        .iter()
        .map(|(what, value)| format!("_Static_assert({what} == {value}ull, \"{what}\");\n"))
        .collect();
    let folder = Folder::new("header");
    let source = folder.write("layout.c", &format!("#include <escapement.h>\n{asserts}"));
    let include = native_build().path("prefix/include");
    let compile = |compiler: &str, standard: &str, source: &Path| {
        run_checked(syntax_check(compiler, standard, &include).arg(source))
    };
    compile("cc", "-std=c11", &source);
    // Both headers compile alone, and together in one file, in every language that they support.
    for (name, compiler, standards, header) in [
        ("alone.c", "cc", &["-std=c11", "-std=c17"][..], "escapement.h"),
        ("alone.cpp", "c++", &["-std=c++17", "-std=c++20"], "escapement.h"),
        ("over.cpp", "c++", &["-std=c++17", "-std=c++20"], "escapement.hpp"),
    ] {
        let twice = format!("#include <{header}>\n#include <{header}>\nint x(void);\n");
        let source = folder.write(name, &twice);
        standards.iter().for_each(|standard| {
            compile(compiler, standard, &source);
        });
    }
}
