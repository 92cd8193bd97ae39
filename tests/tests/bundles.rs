//! Bundles: a campaign with everything that it needs runs on another machine, and yields the same table.

use std::path::Path;
use std::process::{Command, Stdio};

use escapement_tests::program::{Folder, Said, built, built_as_shipped, finish, orchestrate, orchestrator, root, text};

fn call(program: &Path, folder: &Path, arguments: &[&str]) -> Said {
    let child = Command::new(program)
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn();
    finish(child.expect("the program can be started"))
}

fn same(a: &Path, b: &Path) {
    for file in ["table.csv", "table.parquet", "figure.svg", "figure.png"] {
        let read = |folder: &Path| std::fs::read(folder.join(file)).unwrap_or_else(|error| panic!("{file}: {error}"));
        assert!(read(a) == read(b), "{file} differs");
    }
}

/// A campaign of a scenario with files in its folder and above it, and one of a scenario whose programs are elsewhere.
#[test]
fn bundle_that_is_moved_gives_the_same_table() {
    built_as_shipped();
    let folder = Folder::new("bundle");
    let out = |name: &str| folder.path().join(name);
    // The second scenario needs other settings and is rejected, with a reason that does not depend on where the scenario is.
    let gains = "participants.controller.parameters.gains={ file = \"../gains/pi-diagonal.toml\" },{ file = \"../gains/p-diagonal.toml\" }";
    let close = ["scenarios/close.toml", "--duration", "300 ms", "--vary", gains];
    let spring = [
        "examples/spring/spring.toml",
        "--vary",
        "connections.to-right.delay=0ms..20ms:10ms",
    ];
    for (name, campaign, code) in [("close", &close[..], Some(1)), ("spring", &spring[..], Some(0))] {
        let one = out(&format!("{name}-one"));
        let said = orchestrate(&[&["sweep"], campaign, &["--quiet", "--out", text(&one)]].concat());
        assert_eq!(said.code, code, "{said:?}");
        let bundle = out(&format!("{name}-bundle"));
        let said = orchestrate(&[&["sweep"], campaign, &["--bundle", text(&bundle)]].concat());
        assert_eq!((said.code, said.err.as_str()), (Some(0), ""), "{said:?}");
        // In another place, by the program in the bundle.
        let elsewhere = out(&format!("{name}-elsewhere/deep"));
        std::fs::create_dir_all(elsewhere.parent().unwrap()).unwrap();
        std::fs::rename(&bundle, &elsewhere).unwrap();
        let program = elsewhere.join("bin/escapement");
        let mut shards = Vec::new();
        for shard in ["1/2", "2/2"] {
            let place = out(&format!("{name}-{}", shard.replace('/', "-")));
            let arguments = [
                "sweep",
                "run",
                text(&elsewhere),
                "--shard",
                shard,
                "--quiet",
                "--out",
                text(&place),
            ];
            let said = call(&program, folder.path(), &arguments);
            assert_ne!(said.code, Some(2), "{said:?}");
            shards.push(place);
        }
        let whole = out(&format!("{name}-whole"));
        let said = orchestrate(&[
            "sweep",
            "merge",
            text(&whole),
            text(&shards[0]),
            text(&shards[1]),
            "--quiet",
        ]);
        assert_eq!(said.code, code, "{said:?}");
        same(&whole, &one);
        // The program outside is the same as the one inside, and a shard of the scenario itself is a shard of the bundle.
        let direct = out(&format!("{name}-direct"));
        let said = orchestrate(
            &[
                &["sweep"],
                campaign,
                &["--shard", "2/2", "--quiet", "--out", text(&direct)],
            ]
            .concat(),
        );
        assert_eq!(said.code, code, "{said:?}");
        let mixed = out(&format!("{name}-mixed"));
        let said = orchestrate(&[
            "sweep",
            "merge",
            text(&mixed),
            text(&shards[0]),
            text(&direct),
            "--quiet",
        ]);
        assert_eq!(said.code, code, "{said:?}");
        same(&mixed, &one);
    }
}

#[test]
fn bundle_includes_outside_files_and_lists_missing_ones() {
    let folder = Folder::new("outside");
    let out = |name: &str| folder.path().join(name);
    let python = folder.write("model.py", "print('no model')\n");
    std::fs::create_dir_all(out("in/here")).unwrap();
    let stock = std::fs::read_to_string(root().join("scenarios/close.toml")).unwrap();
    let stock = stock.replace("../", &format!("{}/", root().display()));
    std::fs::write(out("in/here/own.toml"), &stock).unwrap();
    let own = out("in/here/own.toml");
    let campaign = [text(&own), "--duration", "200 ms", "--vary", "seed=1,2"];
    let said = orchestrate(&[&["sweep"], &campaign[..], &["--quiet", "--out", text(&out("one"))]].concat());
    assert_eq!(said.code, Some(0), "{said:?}");
    let bundle = out("bundle");
    let include = ["--bundle", text(&bundle), "--include", text(&python)];
    let said = orchestrate(&[&["sweep"], &campaign[..], &include].concat());
    assert_eq!((said.code, said.err.as_str()), (Some(0), ""), "{said:?}");
    // No path of the bundle leads out of it, and it contains what was requested.
    let text_of = std::fs::read_to_string(bundle.join("campaign.json")).unwrap();
    assert!(text_of.contains("outside/1/"), "{text_of}");
    assert!(!text_of.contains(&format!("\"{}", root().display())), "{text_of}");
    assert!(bundle.join("tree/model.py").is_file());
    let said = call(
        &bundle.join("bin/escapement"),
        folder.path(),
        &["sweep", "run", "bundle", "--quiet", "--out", "two"],
    );
    assert_eq!(said.code, Some(0), "{said:?}");
    same(&out("one"), &out("two"));

    // Programs of the machine are not bundled, and the command reports this.
    let scenario = escapement_tests::world::oscillator(&folder, "damper");
    let second = out("second");
    let arguments = [
        "sweep",
        text(&scenario),
        "--vary",
        "participants.damper.period=10ms,20ms",
        "--bundle",
        text(&second),
    ];
    let said = orchestrate(&arguments);
    assert_eq!(said.code, Some(0), "{said:?}");
    assert_eq!(said.err.matches("warning: participants.").count(), 2, "{said:?}");
    assert!(said.err.contains("every machine must have the same one"), "{said:?}");

    // A changed bundle no longer matches its description.
    std::fs::write(
        bundle.join("tree/in/here/own.toml"),
        stock.replacen("title = \"", "title = \"Not the ", 1),
    )
    .unwrap();
    let arguments = ["sweep", "run", "bundle", "--quiet", "--out", "three"];
    let said = call(&bundle.join("bin/escapement"), folder.path(), &arguments);
    assert_eq!(said.code, Some(2), "{said:?}");
    assert!(said.err.contains("is not what the campaign was made of"), "{said:?}");
    // A folder with other content is left unchanged.
    let said = orchestrate(&[&["sweep"], &campaign[..], &["--bundle", text(&root().join("docs"))]].concat());
    assert_eq!(said.code, Some(2), "{said:?}");
    assert!(said.err.contains("no bundle"), "{said:?}");
}

#[test]
fn shell_gets_a_line_for_each_shard_that_is_missing() {
    let folder = Folder::new("shell");
    let out = |name: &str| folder.path().join(name);
    let campaign = [
        "sweep",
        "scenarios/close.toml",
        "--duration",
        "200 ms",
        "--vary",
        "seed=1..7",
        "--quiet",
        "--out",
    ];
    let one = out("one");
    // Second runs are compared by their tapes.
    let said = orchestrate(&[&campaign[..], &[text(&one), "--digest"]].concat());
    assert_eq!(said.code, Some(0), "{said:?}");
    let whole = out("whole with a 'quote'");
    let on = |more: &[&str]| orchestrate(&[&campaign[..], &[text(&whole), "--on", "shell"], more].concat());
    let said = on(&["--shards", "3", "--audit", "20%"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    let lines: Vec<String> = said.out.lines().map(str::to_owned).collect();
    assert_eq!(lines.len(), 3, "{said:?}");
    let shell = |line: &str| call(Path::new("/bin/sh"), Path::new("/"), &["-c", line]);
    assert_eq!(shell(&lines[1]).code, Some(0));
    let status = orchestrate(&["sweep", "status", text(&whole)]);
    assert_eq!(status.code, Some(1), "{status:?}");
    assert!(status.out.contains("shard 1/3  not started"), "{status:?}");
    // A complete shard is not run again.
    let said = on(&["--audit", "20%"]);
    assert_eq!(
        said.out.lines().collect::<Vec<_>>(),
        [&*lines[0], &*lines[2]],
        "{said:?}"
    );
    for line in [&lines[0], &lines[2], &lines[2]] {
        let said = shell(line);
        assert_eq!(said.code, Some(0), "{said:?}");
    }
    let said = on(&["--audit", "20%"]);
    assert_eq!((said.code, said.out.as_str()), (Some(0), ""), "{said:?}");
    same(&whole, &one);
    assert_eq!(orchestrate(&["sweep", "status", text(&whole)]).code, Some(0));
    let said = on(&["--shards", "4"]);
    assert!(said.err.contains("has 3 shards on shell"), "{said:?}");
    // Engines that do not exist.
    let nowhere = |engine: &str| {
        let child = Command::new(orchestrator())
            .args([&campaign[..], &[text(&out("no")), "--on", engine]].concat())
            .current_dir(root())
            .env("PATH", "/nowhere")
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn();
        finish(child.expect("the program can be started"))
    };
    for (engine, part) in [
        ("slurm", "Slurm's commands in PATH"),
        ("hyperqueue", "pip install hyperqueue"),
    ] {
        let said = nowhere(engine);
        assert_eq!(said.code, Some(1), "{said:?}");
        assert_eq!(said.err.matches("error:").count(), 1, "{said:?}");
        assert!(said.err.contains(part), "{said:?}");
    }
    let said = on(&["--on", "pbs"]);
    assert_eq!(said.code, Some(2), "{said:?}");
}

#[test]
fn engine_gets_points_until_the_stopping_rule_holds() {
    // The second system has a separate program.
    for (program, scenario) in [
        (orchestrator().to_owned(), "examples/spring/spring.toml"),
        (built().join("lander"), "examples/lander/lander.toml"),
    ] {
        let folder = Folder::new("enough");
        let (one, whole) = (folder.path().join("one"), folder.path().join("whole"));
        let campaign = [
            "sweep",
            scenario,
            "--duration",
            "200 ms",
            "--quiet",
            "--until",
            "met within 1 %",
        ];
        let sweep = |more: &[&str]| call(&program, &root(), &[&campaign[..], more].concat());
        // A share of none or all has that interval at 189 points (Wilson's): more than the engine gets at first, fewer than there are.
        let seeds = ["--seeds", "400"];
        let said = sweep(&[&seeds[..], &["--out", text(&one)]].concat());
        assert_eq!(said.code, Some(0), "{said:?}");
        let on = |more: &[&str]| sweep(&[more, &["--on", "shell", "--shards", "2", "--out", text(&whole)]].concat());
        let mut rounds = 0;
        loop {
            let said = on(&seeds);
            assert_eq!(said.code, Some(0), "{said:?}");
            if said.out.is_empty() {
                break;
            }
            rounds += 1;
            for line in said.out.lines() {
                let said = call(Path::new("/bin/sh"), Path::new("/"), &["-c", line]);
                assert_eq!(said.code, Some(0), "{said:?}");
            }
        }
        assert_eq!(rounds, 2, "128 points, then 256");
        same(&whole, &one);
        let table = std::fs::read_to_string(whole.join("table.csv")).unwrap();
        assert_eq!(table.lines().count(), 190, "{table}");
        // The first points of a grid are not those of a smaller one.
        let said = on(&["--vary", "seed=1,2"]);
        assert_eq!(said.code, Some(1), "{said:?}");
        assert!(said.err.contains("--until gives a campaign in parts"), "{said:?}");
    }
}
