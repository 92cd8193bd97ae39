//! FMUs beside others in one process, which is not theirs alone: no one changes another one, and none ends the program.

use std::path::{Path, PathBuf};

use escapement_tests::fmus::TestFmu;
use escapement_tests::program::{Folder, digest_anew, run_anew, run_orchestrator, text};

/// A scenario with these FMUs as participants, `one` and `two`.
fn scenario(folder: &Folder, fmus: &[&Path]) -> PathBuf {
    let mut all = "duration = \"1 s\"\n".to_owned();
    for (name, file) in ["one", "two"].iter().zip(fmus) {
        all += &format!(
            "[participants.{name}]\nperiod = \"1 ms\"\nrun = {{ fmu = \"{}\", ports = {{ inputs = [] }} }}\n",
            text(file)
        );
    }
    folder.write("neighbours.toml", &all)
}

/// Several runs in the processes of a campaign.
fn assert_campaign_runs(folder: &Folder, scenario: &Path) {
    let out = folder.path().join("campaign");
    let _ = std::fs::remove_dir_all(&out);
    let vary = "participants.one.parameters.mass=1 kg,2 kg,3 kg,4 kg,5 kg,6 kg,7 kg,8 kg";
    let output = run_orchestrator(&["sweep", text(scenario), "--vary", vary, "--out", text(&out)]);
    assert_eq!(output.code, Some(0), "{output:?}");
}

#[test]
fn thread_that_outlives_its_instance_does_not_end_the_program() {
    for version in [2, 3] {
        let folder = Folder::new("thread");
        let recipe = TestFmu {
            fault: "THREAD",
            ..TestFmu::new(version)
        };
        let file = scenario(&folder, &[&recipe.build(&folder, "threads")]);
        assert_eq!(run_anew(&folder, &file, &["--in-process"]).code, Some(0));
        // The threads of a point have time to fail during the next ones.
        assert_campaign_runs(&folder, &file);
    }
}

#[test]
fn floating_point_modes_of_an_fmu_are_its_own() {
    for version in [2, 3] {
        let folder = Folder::new("modes");
        let bad = TestFmu {
            fault: "ROUNDS_UP",
            ..TestFmu::new(version)
        };
        let (bad, good) = (bad.build(&folder, "bad"), TestFmu::new(version).build(&folder, "good"));
        let file = scenario(&folder, &[&bad, &good]);
        let digest = |how: &[&str]| digest_anew(&folder, &file, how);
        assert_eq!(digest(&["--in-process"]), digest(&[]), "FMI {version}");
    }
}

#[test]
fn second_helper_library_of_one_name_is_refused_in_one_process() {
    let folder = Folder::new("helpers");
    let build = |name: &str, number| {
        let helper = Some(number);
        TestFmu {
            helper,
            ..TestFmu::new(2)
        }
        .build(&folder, name)
    };
    let (one, two) = (build("one", 1), build("two", 2));
    let alone = scenario(&folder, &[&one]);
    assert_eq!(run_anew(&folder, &alone, &["--in-process"]).code, Some(0));
    assert_campaign_runs(&folder, &alone);
    for other in [&one, &two] {
        let both = scenario(&folder, &[&one, other]);
        assert_eq!(run_anew(&folder, &both, &[]).code, Some(0));
        let output = run_anew(&folder, &both, &["--in-process"]);
        assert_eq!(output.code, Some(1), "{output:?}");
        for words in [
            "`two`",
            "it needs its own `",
            "libescapementhelper.so",
            "leave out --in-process",
        ] {
            assert!(output.err.contains(words), "`{words}`: {output:?}");
        }
    }
}
