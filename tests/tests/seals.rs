//! A tape whose bytes differ from the sealed ones is not used unless the reader requests it.

use std::path::Path;

use escapement_tests::fixture::RunFixture;
use escapement_tests::program::{run_orchestrator, text};

/// Flips one bit of the file `file`, in its middle.
fn flip_bit(file: &Path) {
    let mut bytes = std::fs::read(file).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(file, bytes).unwrap();
}

#[test]
fn flipped_bit_is_refused_by_every_reader() {
    let fixture = RunFixture::new("flipped", "damper");
    assert_eq!(fixture.run("saved", &["--checkpoint-at", "9 s"]).code, Some(0));
    let run = fixture.path("saved");
    let (run, undisturbed) = (text(&run), fixture.path("undisturbed"));
    let out = fixture.path("exported");
    let page = fixture.path("page.html");
    let readers: [&[&str]; 5] = [
        &["compare", text(&undisturbed), run],
        &["compare", run, text(&undisturbed)],
        &["report", run, "--out", text(&page)],
        &["export", run, "--to", "csv", "--out", text(&out)],
        &["replay", run, "--participant", "damper", "--quiet"],
    ];
    for reader in readers {
        assert_eq!(run_orchestrator(reader).code, Some(0), "{reader:?}");
    }
    let stream = fixture.path("saved/tape/plant.motion.bin");
    flip_bit(&stream);
    // The damper may or may not read the altered sample.
    let codes: [&[i32]; 5] = [&[3], &[3], &[0], &[0], &[0, 3]];
    for (reader, codes) in readers.iter().zip(codes) {
        let output = run_orchestrator(reader);
        assert_eq!(output.code, Some(2), "{reader:?}: {output:?}");
        for word in [
            "stream `plant.motion` is damaged",
            "BLAKE3",
            "seal.json",
            "--unverified",
        ] {
            assert!(output.err.contains(word), "{reader:?}: `{word}` is missing: {output:?}");
        }
        let output = run_orchestrator(&[reader, &["--unverified"][..]].concat());
        assert!(
            output.code.is_some_and(|code| codes.contains(&code)),
            "{reader:?}: {output:?}"
        );
        assert!(output.err.contains("stream `plant.motion` is damaged"), "{output:?}");
    }
    let output = fixture.resume("saved", "resumed", &[]);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(output.err.contains("stream `plant.motion` is damaged"), "{output:?}");
    assert!(!fixture.path("resumed").exists(), "a damaged tape was copied");
    assert_eq!(
        fixture.resume("saved", "resumed", &["--unverified"]).code,
        Some(2),
        "for reading alone"
    );
    // With the same bit flipped again, everything works as before.
    flip_bit(&stream);
    assert_eq!(fixture.resume("saved", "resumed", &[]).code, Some(0));
    fixture.assert_same_as_undisturbed("resumed");
}

#[test]
fn shortened_stream_is_refused_by_export() {
    let fixture = RunFixture::new("shortened", "damper");
    let stream = fixture.path("undisturbed/tape/damper.push.bin");
    let file = std::fs::OpenOptions::new().write(true).open(&stream).unwrap();
    file.set_len(24 * 999).unwrap();
    let output = run_orchestrator(&["export", text(&fixture.path("undisturbed")), "--to", "parquet"]);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(
        output
            .err
            .contains("it has 999 samples, and seal.json has 1000 samples"),
        "{output:?}"
    );
}

#[test]
fn unreadable_run_description_is_refused_where_it_is_used() {
    let fixture = RunFixture::new("plans", "damper");
    let run = fixture.path("undisturbed");
    let out = fixture.path("exported");
    let with = |command: &str, more: &[&str]| run_orchestrator(&[&[command, text(&run)], more].concat());
    let export = |to: &str| with("export", &["--to", to, "--out", text(&out)]);
    for (name, broken, expected) in [
        ("plan.toml", "seed = 7\nduration = \n", "line 2"),
        ("run.json", "{", "is not JSON"),
    ] {
        let path = run.join(name);
        let whole = std::fs::read(&path).unwrap();
        std::fs::write(&path, broken).unwrap();
        for output in [with("report", &[]), export("mcap"), export("mat"), export("parquet")] {
            assert_eq!(output.code, Some(2), "{output:?}");
            assert!(
                output.err.contains(text(&path)) && output.err.contains(expected),
                "{output:?}"
            );
        }
        // What does not use it is not kept from the samples.
        for output in [export("csv"), with("compare", &[text(&run)])] {
            assert_eq!(output.code, Some(0), "{output:?}");
        }
        std::fs::remove_file(&path).unwrap();
        assert_eq!(export("mcap").code, Some(0), "without {name}");
        std::fs::write(&path, whole).unwrap();
    }
    assert_eq!(with("report", &[]).code, Some(0));
}

#[test]
fn recorded_run_is_never_overwritten() {
    let fixture = RunFixture::new("kept", "damper");
    let run = fixture.path("undisturbed");
    let inside = |name: &str| run.join(name);
    let (index, plan, tape) = (inside("tape/index.json"), inside("plan.toml"), inside("tape/figures"));
    let (index, plan, tape) = (text(&index), text(&plan), text(&tape));
    let scenario = text(&fixture.scenario);
    let trace = fixture.path("traced");
    let read = || ["tape/index.json", "plan.toml"].map(|name| std::fs::read(inside(name)).unwrap());
    let before = read();
    let commands: [&[&str]; 6] = [
        &["report", text(&run), "--out", index],
        &["report", text(&run), "--out", plan],
        &["report", text(&run), "--figures", tape],
        &["export", text(&run), "--to", "csv", "--out", tape],
        &["run", scenario, "--out", text(&trace), "--trace", plan],
        &["resume", text(&run), "--out", text(&trace), "--trace", index],
    ];
    for command in commands {
        let output = run_orchestrator(command);
        assert_eq!(output.code, Some(2), "{command:?}: {output:?}");
        assert!(output.err.contains("is never written over"), "{command:?}: {output:?}");
        assert_eq!(read(), before, "{command:?}");
    }
    assert!(!trace.exists() && !Path::new(tape).exists());
    // The tape's folder stands for its run.
    let of_tape =
        |command: &[&str]| run_orchestrator(&[&[command[0], text(&run.join("tape"))], &command[1..]].concat());
    assert_eq!(of_tape(&["report"]).code, Some(0));
    assert_eq!(of_tape(&["export", "--to", "csv"]).code, Some(0));
    assert!(inside("report.html").is_file() && inside("export/plant.motion.csv").is_file());
}
