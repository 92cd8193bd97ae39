//! A tape whose bytes differ from the sealed ones is not used unless the reader requests it.

use std::path::Path;

use escapement_tests::program::{orchestrate, text};
use escapement_tests::world::World;

/// Flips one bit of the file `file`, in its middle.
fn flip(file: &Path) {
    let mut bytes = std::fs::read(file).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(file, bytes).unwrap();
}

#[test]
fn flipped_bit_is_refused_by_every_reader() {
    let world = World::new("flipped", "damper");
    assert_eq!(world.run("saved", &["--checkpoint-at", "9 s"]).code, Some(0));
    let run = world.path("saved");
    let (run, undisturbed) = (text(&run), world.path("undisturbed"));
    let out = world.path("exported");
    let page = world.path("page.html");
    let readers: [&[&str]; 5] = [
        &["compare", text(&undisturbed), run],
        &["compare", run, text(&undisturbed)],
        &["report", run, "--out", text(&page)],
        &["export", run, "--to", "csv", "--out", text(&out)],
        &["replay", run, "--participant", "damper", "--quiet"],
    ];
    for reader in readers {
        assert_eq!(orchestrate(reader).code, Some(0), "{reader:?}");
    }
    let stream = world.path("saved/tape/plant.motion.bin");
    flip(&stream);
    // The damper may or may not read the altered sample.
    let codes: [&[i32]; 5] = [&[3], &[3], &[0], &[0], &[0, 3]];
    for (reader, codes) in readers.iter().zip(codes) {
        let said = orchestrate(reader);
        assert_eq!(said.code, Some(2), "{reader:?}: {said:?}");
        for word in [
            "stream `plant.motion` is damaged",
            "BLAKE3",
            "seal.json",
            "--unverified",
        ] {
            assert!(said.err.contains(word), "{reader:?}: `{word}` is missing: {said:?}");
        }
        let said = orchestrate(&[reader, &["--unverified"][..]].concat());
        assert!(
            said.code.is_some_and(|code| codes.contains(&code)),
            "{reader:?}: {said:?}"
        );
        assert!(said.err.contains("stream `plant.motion` is damaged"), "{said:?}");
    }
    let said = world.resume("saved", "resumed", &[]);
    assert_eq!(said.code, Some(2), "{said:?}");
    assert!(said.err.contains("stream `plant.motion` is damaged"), "{said:?}");
    assert!(!world.path("resumed").exists(), "a damaged tape was copied");
    assert_eq!(
        world.resume("saved", "resumed", &["--unverified"]).code,
        Some(2),
        "for reading alone"
    );
    // With the same bit flipped again, everything works as before.
    flip(&stream);
    assert_eq!(world.resume("saved", "resumed", &[]).code, Some(0));
    world.same_as_undisturbed("resumed");
}

#[test]
fn shortened_stream_is_refused_by_export() {
    let world = World::new("shortened", "damper");
    let stream = world.path("undisturbed/tape/damper.push.bin");
    let file = std::fs::OpenOptions::new().write(true).open(&stream).unwrap();
    file.set_len(24 * 999).unwrap();
    let said = orchestrate(&["export", text(&world.path("undisturbed")), "--to", "parquet"]);
    assert_eq!(said.code, Some(2), "{said:?}");
    assert!(
        said.err.contains("it has 999 samples, and seal.json has 1000 samples"),
        "{said:?}"
    );
}

#[test]
fn unreadable_run_description_is_refused_where_it_is_used() {
    let world = World::new("plans", "damper");
    let run = world.path("undisturbed");
    let out = world.path("exported");
    let with = |command: &str, more: &[&str]| orchestrate(&[&[command, text(&run)], more].concat());
    let export = |to: &str| with("export", &["--to", to, "--out", text(&out)]);
    for (name, broken, told) in [
        ("plan.toml", "seed = 7\nduration = \n", "line 2"),
        ("run.json", "{", "is not JSON"),
    ] {
        let path = run.join(name);
        let whole = std::fs::read(&path).unwrap();
        std::fs::write(&path, broken).unwrap();
        for said in [with("report", &[]), export("mcap"), export("mat"), export("parquet")] {
            assert_eq!(said.code, Some(2), "{said:?}");
            assert!(said.err.contains(text(&path)) && said.err.contains(told), "{said:?}");
        }
        // What does not use it is not kept from the samples.
        for said in [export("csv"), with("compare", &[text(&run)])] {
            assert_eq!(said.code, Some(0), "{said:?}");
        }
        std::fs::remove_file(&path).unwrap();
        assert_eq!(export("mcap").code, Some(0), "without {name}");
        std::fs::write(&path, whole).unwrap();
    }
    assert_eq!(with("report", &[]).code, Some(0));
}

#[test]
fn recorded_run_is_never_overwritten() {
    let world = World::new("kept", "damper");
    let run = world.path("undisturbed");
    let inside = |name: &str| run.join(name);
    let (index, plan, tape) = (inside("tape/index.json"), inside("plan.toml"), inside("tape/figures"));
    let (index, plan, tape) = (text(&index), text(&plan), text(&tape));
    let scenario = text(&world.scenario);
    let trace = world.path("traced");
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
        let said = orchestrate(command);
        assert_eq!(said.code, Some(2), "{command:?}: {said:?}");
        assert!(said.err.contains("is never written over"), "{command:?}: {said:?}");
        assert_eq!(read(), before, "{command:?}");
    }
    assert!(!trace.exists() && !Path::new(tape).exists());
    // The tape's folder stands for its run.
    let of_tape = |command: &[&str]| orchestrate(&[&[command[0], text(&run.join("tape"))], &command[1..]].concat());
    assert_eq!(of_tape(&["report"]).code, Some(0));
    assert_eq!(of_tape(&["export", "--to", "csv"]).code, Some(0));
    assert!(inside("report.html").is_file() && inside("export/plant.motion.csv").is_file());
}
