//! Tests of reserved run folders: which are accepted, what is restored, and what is never removed.

use super::super::outputs::record_outputs;
use super::*;

fn names(root: &Path) -> Vec<String> {
    let entries = fs::read_dir(root).unwrap();
    let mut names: Vec<String> = entries
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

/// A folder that looks like that of a finished run.
fn run(root: &Path, plan: &str) {
    let folder = RunFolder::create(root).unwrap();
    folder.write(&folder.plan(), plan).unwrap();
    folder.write(&folder.run(), "{}").unwrap();
    fs::create_dir(folder.tape()).unwrap();
    fs::write(folder.tape().join("index.json"), plan).unwrap();
}

#[test]
fn dropped_reservation_removes_created_entries() {
    let root = crate::scratch_for_tests("refused").join("deep/down");
    let outermost = root.parent().unwrap().parent().unwrap().to_owned();
    fs::create_dir_all(&outermost).unwrap();
    let reservation = Reservation::reserve(&root, false).unwrap();
    reservation.folder().write(&reservation.folder().plan(), "x").unwrap();
    drop(reservation);
    assert_eq!(names(&outermost), Vec::<String>::new());
    // An existing empty folder still exists, and is empty.
    fs::create_dir_all(&root).unwrap();
    drop(Reservation::reserve(&root, true).unwrap());
    assert_eq!(names(&root), Vec::<String>::new());
}

#[test]
fn previous_run_is_restored_unless_new_run_begins() {
    let root = crate::scratch_for_tests("replaced");
    run(&root, "old");
    let reservation = Reservation::reserve(&root, true).unwrap();
    reservation.folder().write(&reservation.folder().plan(), "new").unwrap();
    assert!(!reservation.folder().tape().exists());
    let error = Reservation::reserve(&root, true).unwrap_err().to_string();
    assert!(error.contains("under way"), "{error}");
    drop(reservation);
    assert_eq!(fs::read_to_string(root.join("plan.toml")).unwrap(), "old");
    assert_eq!(fs::read_to_string(root.join("tape/index.json")).unwrap(), "old");
    assert_eq!(names(&root), ["log", "plan.toml", "run.json", "tape"]);
    let reservation = Reservation::reserve(&root, true).unwrap();
    reservation.folder().write(&reservation.folder().plan(), "new").unwrap();
    reservation.into_folder();
    assert_eq!(fs::read_to_string(root.join("plan.toml")).unwrap(), "new");
    assert_eq!(names(&root), ["log", "plan.toml"]);
}

/// The content of the plan and the tape in `root`.
fn contents(root: &Path) -> [String; 2] {
    ["plan.toml", "tape/index.json"].map(|name| fs::read_to_string(root.join(name)).unwrap())
}

#[test]
fn run_set_aside_by_killed_program_is_restored() {
    let root = crate::scratch_for_tests("killed");
    let previous = root.join(PREVIOUS);
    let back = || {
        drop(Reservation::reserve(&root, true).unwrap());
        assert_eq!(contents(&root), ["old", "old"]);
        assert_eq!(names(&root), ["log", "plan.toml", "run.json", "tape"]);
    };
    run(&root, "old");
    // Killed while the folder was created, and just before the run began.
    for count in 0..=3 {
        let mut reservation = Reservation::reserve(&root, true).unwrap();
        reservation.committed = true;
        let folder = reservation.folder().clone();
        drop(reservation);
        if count > 0 {
            folder.write(&folder.plan(), "new").unwrap();
        }
        if count > 1 {
            folder.write(&folder.run(), "{}").unwrap();
        }
        if count > 2 {
            fs::create_dir(folder.tape()).unwrap();
            fs::write(folder.tape().join("index.json"), "new").unwrap();
        }
        back();
    }
    // Killed while the run was set aside, or restored.
    for moved in 0..=3 {
        fs::create_dir(&previous).unwrap();
        for name in &sort_for_moving(list_own_entries(&root).unwrap())[..moved] {
            fs::rename(root.join(name), previous.join(name)).unwrap();
        }
        back();
    }
}

#[test]
fn replaced_run_is_never_restored() {
    let root = crate::scratch_for_tests("discarded");
    run(&root, "new");
    // Killed while the previous run was removed.
    for name in [PREVIOUS, DISCARDED] {
        fs::create_dir(root.join(name)).unwrap();
        fs::write(root.join(name).join("run.json"), "{}").unwrap();
        drop(Reservation::reserve(&root, true).unwrap());
        assert_eq!(contents(&root), ["new", "new"]);
        assert_eq!(names(&root), ["log", "plan.toml", "run.json", "tape"]);
    }
    // A previous run that could not be removed.
    fs::create_dir(root.join(PREVIOUS)).unwrap();
    for name in REQUIRED_FILES {
        fs::write(root.join(PREVIOUS).join(name), "old").unwrap();
    }
    fs::write(root.join("summary.json"), "{}").unwrap();
    drop(Reservation::reserve(&root, true).unwrap());
    assert_eq!(contents(&root), ["new", "new"]);
}

#[test]
fn reservation_replaces_only_run_folders() {
    let root = crate::scratch_for_tests("precious");
    let refused = |part: &str| {
        let previous = names(&root);
        let error = Reservation::reserve(&root, true).unwrap_err().to_string();
        assert!(error.contains(part), "{error}");
        assert_eq!(names(&root), previous);
    };
    fs::create_dir_all(&root).unwrap();
    fs::write(root.join("precious.txt"), "work of years").unwrap();
    refused("`plan.toml`");
    fs::write(root.join("plan.toml"), "").unwrap();
    refused("`run.json`");
    fs::create_dir(root.join("run.json")).unwrap();
    refused("`run.json`");
    fs::remove_dir(root.join("run.json")).unwrap();
    fs::write(root.join("run.json"), "{}").unwrap();
    refused("`precious.txt` in it does not belong to a run");
    assert_eq!(fs::read_to_string(root.join("precious.txt")).unwrap(), "work of years");
    fs::remove_file(root.join("precious.txt")).unwrap();
    drop(Reservation::reserve(&root, true).unwrap());
    assert_eq!(names(&root), ["plan.toml", "run.json"]);
}

#[test]
fn reservation_replaces_recorded_outputs_only() {
    let root = crate::scratch_for_tests("outputs");
    run(&root, "old");
    let at = |name: &str| root.join(name);
    fs::create_dir_all(at("figures/small")).unwrap();
    let files = ["trace.json", "figures/a.svg", "figures/small/b.png"].map(at);
    for file in &files {
        fs::write(file, "drawn").unwrap();
    }
    record_outputs(&files[..1], true).unwrap();
    fs::write(&files[0], "longer").unwrap();
    record_outputs(&files[1..], false).unwrap();
    // The outputs are restored with the run that was set aside.
    let all = names(&root);
    drop(Reservation::reserve(&root, true).unwrap());
    assert_eq!(names(&root), all);
    record_outputs(&files, false).unwrap();
    let refused = |part: &str| {
        let error = Reservation::reserve(&root, true).unwrap_err().to_string();
        assert!(error.contains(part), "{error}");
        assert_eq!(names(&root), all);
    };
    fs::write(at("figures/notes.txt"), "work of years").unwrap();
    refused("`figures/notes.txt` in it does not belong to a run");
    fs::remove_file(at("figures/notes.txt")).unwrap();
    fs::write(&files[1], "drawn anew").unwrap();
    refused("`figures/a.svg` in it was changed");
    record_outputs(&files[1..2], false).unwrap();
    let reservation = Reservation::reserve(&root, true).unwrap();
    assert_eq!(names(&root), [PREVIOUS, "log"]);
    reservation.into_folder();
    assert_eq!(names(&root), ["log"]);
}

#[test]
fn run_folder_rejects_non_empty_folder() {
    let root = crate::scratch_for_tests("folder");
    let first = RunFolder::create(&root).unwrap();
    first.write_json(&first.run(), &serde_json::json!({"a": 1})).unwrap();
    let text = RunFolder::create(&root).unwrap_err().to_string();
    assert!(text.contains("not empty") && text.contains("--out"), "{text}");
    assert!(first.run().is_file());
    let error = RunFolder::create(&first.run()).unwrap_err();
    assert!(matches!(error, FolderError::NotAFolder { .. }), "{error}");
}

#[test]
fn simultaneous_runs_get_distinct_folders() {
    let runs = crate::scratch_for_tests("runs");
    let roots: Vec<PathBuf> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..8)
            .map(|_| {
                scope.spawn(|| {
                    (0..20)
                        .map(|_| RunFolder::create_default(&runs, "a/b é").unwrap())
                        .map(|reservation| reservation.into_folder().root().to_owned())
                        .collect::<Vec<_>>()
                })
            })
            .collect();
        threads.into_iter().flat_map(|thread| thread.join().unwrap()).collect()
    });
    let unique: std::collections::HashSet<_> = roots.iter().collect();
    assert_eq!(unique.len(), 160);
    assert!(roots.iter().all(|root| root.parent() == Some(runs.as_path())));
}
