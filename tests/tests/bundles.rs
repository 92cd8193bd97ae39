//! Bundles: a campaign with everything that it needs runs on another machine, and yields the same table.

use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Command, Stdio};

use escapement_tests::program::{
    Folder, ProgramOutput, built, built_as_shipped, orchestrator, root, run_orchestrator, text, wait_for_output,
};

fn run_in_folder(program: &Path, folder: &Path, arguments: &[&str]) -> ProgramOutput {
    let child = Command::new(program)
        .args(arguments)
        .current_dir(folder)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn();
    wait_for_output(child.expect("the program can be started"))
}

fn assert_same_tables(a: &Path, b: &Path) {
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
        let output = run_orchestrator(&[&["sweep"], campaign, &["--quiet", "--out", text(&one)]].concat());
        assert_eq!(output.code, code, "{output:?}");
        let bundle = out(&format!("{name}-bundle"));
        let output = run_orchestrator(&[&["sweep"], campaign, &["--bundle", text(&bundle)]].concat());
        assert_eq!((output.code, output.err.as_str()), (Some(0), ""), "{output:?}");
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
            let output = run_in_folder(&program, folder.path(), &arguments);
            assert_ne!(output.code, Some(2), "{output:?}");
            shards.push(place);
        }
        let whole = out(&format!("{name}-whole"));
        let output = run_orchestrator(&[
            "sweep",
            "merge",
            text(&whole),
            text(&shards[0]),
            text(&shards[1]),
            "--quiet",
        ]);
        assert_eq!(output.code, code, "{output:?}");
        assert_same_tables(&whole, &one);
        // The program outside is the same as the one inside, and a shard of the scenario itself is a shard of the bundle.
        let direct = out(&format!("{name}-direct"));
        let output = run_orchestrator(
            &[
                &["sweep"],
                campaign,
                &["--shard", "2/2", "--quiet", "--out", text(&direct)],
            ]
            .concat(),
        );
        assert_eq!(output.code, code, "{output:?}");
        let mixed = out(&format!("{name}-mixed"));
        let output = run_orchestrator(&[
            "sweep",
            "merge",
            text(&mixed),
            text(&shards[0]),
            text(&direct),
            "--quiet",
        ]);
        assert_eq!(output.code, code, "{output:?}");
        assert_same_tables(&mixed, &one);
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
    let output = run_orchestrator(&[&["sweep"], &campaign[..], &["--quiet", "--out", text(&out("one"))]].concat());
    assert_eq!(output.code, Some(0), "{output:?}");
    let bundle = out("bundle");
    let include = ["--bundle", text(&bundle), "--include", text(&python)];
    let output = run_orchestrator(&[&["sweep"], &campaign[..], &include].concat());
    assert_eq!((output.code, output.err.as_str()), (Some(0), ""), "{output:?}");
    // No path of the bundle leads out of it, and it contains what was requested.
    let text_of = std::fs::read_to_string(bundle.join("campaign.json")).unwrap();
    assert!(text_of.contains("outside/1/"), "{text_of}");
    assert!(!text_of.contains(&format!("\"{}", root().display())), "{text_of}");
    assert!(bundle.join("tree/model.py").is_file());
    let output = run_in_folder(
        &bundle.join("bin/escapement"),
        folder.path(),
        &["sweep", "run", "bundle", "--quiet", "--out", "two"],
    );
    assert_eq!(output.code, Some(0), "{output:?}");
    assert_same_tables(&out("one"), &out("two"));

    // Programs of the machine are not bundled, and the command reports this.
    let scenario = escapement_tests::fixture::write_oscillator(&folder, "damper");
    let second = out("second");
    let arguments = [
        "sweep",
        text(&scenario),
        "--vary",
        "participants.damper.period=10ms,20ms",
        "--bundle",
        text(&second),
    ];
    let output = run_orchestrator(&arguments);
    assert_eq!(output.code, Some(0), "{output:?}");
    assert_eq!(output.err.matches("warning: participants.").count(), 2, "{output:?}");
    assert!(
        output.err.contains("every machine must have the same one"),
        "{output:?}"
    );

    // A changed bundle no longer matches its description.
    std::fs::write(
        bundle.join("tree/in/here/own.toml"),
        stock.replacen("title = \"", "title = \"Not the ", 1),
    )
    .unwrap();
    let arguments = ["sweep", "run", "bundle", "--quiet", "--out", "three"];
    let output = run_in_folder(&bundle.join("bin/escapement"), folder.path(), &arguments);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(
        output.err.contains("is not what the campaign was made of"),
        "{output:?}"
    );
    // A folder with other content is left unchanged.
    let output = run_orchestrator(&[&["sweep"], &campaign[..], &["--bundle", text(&root().join("docs"))]].concat());
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(output.err.contains("no bundle"), "{output:?}");
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
    let output = run_orchestrator(&[&campaign[..], &[text(&one), "--digest"]].concat());
    assert_eq!(output.code, Some(0), "{output:?}");
    let whole = out("whole with a 'quote'");
    let on = |more: &[&str]| run_orchestrator(&[&campaign[..], &[text(&whole), "--on", "shell"], more].concat());
    let output = on(&["--shards", "3", "--audit", "20%"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let lines: Vec<String> = output.out.lines().map(str::to_owned).collect();
    assert_eq!(lines.len(), 3, "{output:?}");
    let shell = |line: &str| run_in_folder(Path::new("/bin/sh"), Path::new("/"), &["-c", line]);
    assert_eq!(shell(&lines[1]).code, Some(0));
    let status = run_orchestrator(&["sweep", "status", text(&whole)]);
    assert_eq!(status.code, Some(1), "{status:?}");
    assert!(status.out.contains("shard 1/3  not started"), "{status:?}");
    // A complete shard is not run again.
    let output = on(&["--audit", "20%"]);
    assert_eq!(
        output.out.lines().collect::<Vec<_>>(),
        [&*lines[0], &*lines[2]],
        "{output:?}"
    );
    for line in [&lines[0], &lines[2], &lines[2]] {
        let output = shell(line);
        assert_eq!(output.code, Some(0), "{output:?}");
    }
    let output = on(&["--audit", "20%"]);
    assert_eq!((output.code, output.out.as_str()), (Some(0), ""), "{output:?}");
    assert_same_tables(&whole, &one);
    let status = || run_orchestrator(&["sweep", "status", text(&whole)]);
    assert_eq!(status().code, Some(0));
    // The whole has all results, so a folder of a shard is not needed any more.
    std::fs::remove_dir_all(whole.join("shards/2-of-3")).unwrap();
    let removed = status();
    assert_eq!(removed.code, Some(0), "{removed:?}");
    assert!(!removed.out.contains("not started"), "{removed:?}");
    let output = on(&["--audit", "20%"]);
    assert_eq!((output.code, output.out.as_str()), (Some(0), ""), "{output:?}");
    assert_same_tables(&whole, &one);
    let output = on(&["--shards", "4"]);
    assert!(output.err.contains("has 3 shards on shell"), "{output:?}");
    // Engines that do not exist.
    let nowhere = |engine: &str| {
        let child = Command::new(orchestrator())
            .args([&campaign[..], &[text(&out("no")), "--on", engine]].concat())
            .current_dir(root())
            .env("PATH", "/nowhere")
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn();
        wait_for_output(child.expect("the program can be started"))
    };
    for (engine, part) in [
        ("slurm", "Slurm's commands in PATH"),
        ("hyperqueue", "pip install hyperqueue"),
    ] {
        let output = nowhere(engine);
        assert_eq!(output.code, Some(1), "{output:?}");
        assert_eq!(output.err.matches("error:").count(), 1, "{output:?}");
        assert!(output.err.contains(part), "{output:?}");
    }
    let output = on(&["--on", "pbs"]);
    assert_eq!(output.code, Some(2), "{output:?}");
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
        let sweep = |more: &[&str]| run_in_folder(&program, &root(), &[&campaign[..], more].concat());
        // A share of none or all has that interval at 189 points (Wilson's): more than the engine gets at first, fewer than there are.
        let seeds = ["--seeds", "400"];
        let output = sweep(&[&seeds[..], &["--out", text(&one)]].concat());
        assert_eq!(output.code, Some(0), "{output:?}");
        let on = |more: &[&str]| sweep(&[more, &["--on", "shell", "--shards", "2", "--out", text(&whole)]].concat());
        let mut rounds = 0;
        loop {
            let output = on(&seeds);
            assert_eq!(output.code, Some(0), "{output:?}");
            if output.out.is_empty() {
                break;
            }
            rounds += 1;
            for line in output.out.lines() {
                let output = run_in_folder(Path::new("/bin/sh"), Path::new("/"), &["-c", line]);
                assert_eq!(output.code, Some(0), "{output:?}");
            }
        }
        assert_eq!(rounds, 2, "128 points, then 256");
        assert_same_tables(&whole, &one);
        let table = std::fs::read_to_string(whole.join("table.csv")).unwrap();
        assert_eq!(table.lines().count(), 190, "{table}");
        let loud: Vec<&str> = campaign.iter().copied().filter(|word| *word != "--quiet").collect();
        let on_shell = ["--on", "shell", "--shards", "2", "--out", text(&whole)];
        let output = run_in_folder(&program, &root(), &[&loud[..], &seeds, &on_shell].concat());
        assert!(output.out.contains("reached after 189 of 400 points"), "{output:?}");
        // The first points of a grid are not those of a smaller one.
        let output = on(&["--vary", "seed=1,2"]);
        assert_eq!(output.code, Some(1), "{output:?}");
        assert!(output.err.contains("--until gives a campaign in parts"), "{output:?}");
    }
}

/// What a bundle is for comes along; what concerns a run or a folder of results has no effect and is refused.
#[test]
fn bundle_has_the_stopping_rule_and_the_audit() {
    let folder = Folder::new("bundle-options");
    let out = |name: &str| folder.path().join(name);
    let bundle = out("bundle");
    let campaign = [
        "sweep",
        "scenarios/close.toml",
        "--duration",
        "50 ms",
        "--seeds",
        "60",
        "--bundle",
    ];
    let make = |more: &[&str]| run_orchestrator(&[&campaign[..], &[text(&bundle)], more].concat());
    for option in [
        &["--keep", "all"][..],
        &["--out", "elsewhere"],
        &["--json"],
        &["--figure", "position_error_at_grasp"],
        &["--workers", "1"],
        &["--lanes", "1"],
    ] {
        let output = make(option);
        assert_eq!(output.code, Some(2), "{output:?}");
        assert!(
            output.err.contains(option[0]) && output.err.contains("--bundle"),
            "{output:?}"
        );
        assert!(!bundle.exists(), "{option:?}");
    }
    let output = make(&["--until", "met within 20 %", "--audit", "10%"]);
    assert_eq!((output.code, output.err.as_str()), (Some(0), ""), "{output:?}");
    let name = orchestrator().file_name().unwrap();
    let run = |more: &[&str]| {
        let own = ["sweep", "run", text(&bundle), "--quiet"];
        let output = run_in_folder(
            &bundle.join("bin").join(name),
            Path::new("/"),
            &[&own[..], more].concat(),
        );
        assert_eq!(output.code, Some(0), "{output:?}");
    };
    let identity = |name: &str| -> serde_json::Value {
        let text = std::fs::read_to_string(out(name).join("campaign.json")).unwrap();
        serde_json::from_str(&text).unwrap()
    };
    run(&["--out", text(&out("whole"))]);
    assert_eq!(identity("whole")["until"], "met within 20 %");
    let table = std::fs::read_to_string(out("whole/table.csv")).unwrap();
    assert!(table.lines().count() < 40, "{table}");
    run(&["--out", text(&out("shard")), "--shard", "2/3"]);
    assert_eq!(identity("shard")["audit"], 0.1);
}

/// Slurm as three scripts: the tasks in a file wait or run.
#[test]
fn status_of_the_whole_follows_from_its_shards() {
    let folder = Folder::new("slurm-status");
    let alive = folder.write("alive", "0\n1\n");
    let tools = folder.path().join("tools");
    std::fs::create_dir(&tools).unwrap();
    for (name, script) in [
        (
            "sbatch",
            "case \"$1\" in --version) echo slurm 1;; *) echo 42;; esac".to_owned(),
        ),
        ("scontrol", "echo 'MaxArraySize = 1001'".to_owned()),
        ("squeue", format!("cat '{}'", text(&alive))),
    ] {
        let path = tools.join(name);
        std::fs::write(&path, format!("#!/bin/sh\n{script}\n")).unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
    }
    let path = format!("{}:{}", text(&tools), std::env::var("PATH").unwrap());
    let run = |arguments: &[&str]| {
        let mut command = Command::new(orchestrator());
        command.args(arguments).current_dir(root()).env("PATH", &path);
        let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
        wait_for_output(child.expect("the program can be started"))
    };
    let out = folder.path().join("out");
    let output = run(&[
        "sweep",
        "scenarios/close.toml",
        "--duration",
        "50 ms",
        "--seeds",
        "4",
        "--on",
        "slurm",
        "--shards",
        "2",
        "--out",
        text(&out),
    ]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let status = |word: &str| {
        let output = run(&["sweep", "status", text(&out)]);
        assert_eq!(output.code, Some(1), "{output:?}");
        assert!(
            output.out.contains(&format!("all  0 of 4 points  {word}")),
            "{output:?}"
        );
        // Here it would run what the engine has.
        assert!(!output.out.contains("continue with"), "{output:?}");
        assert!(output.out.contains("by the command that gave it"), "{output:?}");
        let json = run(&["sweep", "status", text(&out), "--json"]).json();
        assert_eq!(json["parts"][0]["state"], word, "{json}");
    };
    status("waiting");
    std::fs::write(&alive, "").unwrap();
    status("stopped");
}
