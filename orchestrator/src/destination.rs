//! Where commands write the files that the user names: never over a recorded run, and never half.

use std::io;
use std::path::{Path, PathBuf};

use anyhow::anyhow;
use tape::folder::{OUTPUTS_FILE, REQUIRED_FILES, RUN_ENTRIES};

use crate::refusal::Refusal;

/// Checks that the file or folder `path`, the value of `option`, is no part of a recorded run.
///
/// # Errors
/// The part of the run that it is, or that it lies in.
pub fn check(option: &str, path: &Path) -> Result<(), Refusal> {
    let Some(reason) = part_of_run(&resolved(path)) else {
        return Ok(());
    };
    let path = path.display();
    Err(Refusal::of(anyhow!(
        "{option} {path}: {reason}, which is never written over; name another place"
    )))
}

/// Checks the same of a file that is written beside a new run in the folder `run`: it must not be a file of that run either.
///
/// # Errors
/// The part of the run that it would be.
pub fn check_beside(option: &str, path: &Path, run: Option<&Path>) -> Result<(), Refusal> {
    check(option, path)?;
    let Some(run) = run else {
        return Ok(());
    };
    let resolved_path = resolved(path);
    let within = resolved_path.strip_prefix(resolved(run)).ok();
    let first = within.and_then(|within| within.components().next());
    let name = first.map_or("".into(), |first| first.as_os_str().to_string_lossy());
    if RUN_ENTRIES.contains(&&*name) || name == OUTPUTS_FILE {
        let (path, run) = (path.display(), run.display());
        return Err(Refusal::of(anyhow!(
            "{option} {path}: the new run in {run} has its own `{name}`; name another place"
        )));
    }
    Ok(())
}

/// Checks that no destination is a file that the command reads, or another destination, under this or another path. Each file comes with
/// the option or the key that names it.
///
/// # Errors
/// The first two that are the same.
#[cfg(feature = "capture")]
pub fn check_distinct(read: &[(&str, &Path)], written: &[(&str, &Path)]) -> Result<(), Refusal> {
    for (index, (option, path)) in written.iter().enumerate() {
        let others = read.iter().chain(&written[..index]);
        let Some((other, _)) = others.into_iter().find(|(_, other)| is_same(path, other)) else {
            continue;
        };
        let path = path.display();
        return Err(Refusal::of(anyhow!(
            "{option} {path}: this is also {other}, which would be lost; name another file"
        )));
    }
    Ok(())
}

/// Whether two paths lead to one file. A device or a pipe takes what several write.
#[cfg(feature = "capture")]
fn is_same(one: &Path, other: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    match (std::fs::metadata(one), std::fs::metadata(other)) {
        (Ok(one), _) if !one.is_file() => false,
        (Ok(one), Ok(other)) => (one.dev(), one.ino()) == (other.dev(), other.ino()),
        _ => resolved(one) == resolved(other),
    }
}

/// The run folder of `run`, which may also be the `tape` folder in it; a tape without a run folder is its own.
pub fn folder_of(run: &Path) -> PathBuf {
    let above = match run.file_name() {
        Some(_) => run.parent().unwrap_or(run).to_owned(),
        None => run.join(".."),
    };
    let within = run.join("index.json").is_file() && REQUIRED_FILES.iter().any(|name| above.join(name).is_file());
    if within { above } else { run.to_owned() }
}

/// Writes the file `path` completely or not at all: a full disk leaves the previous content. A device or a pipe has none, and gets the
/// bytes as they are.
///
/// # Errors
/// Those of the file system.
pub fn write(path: &Path, content: impl AsRef<[u8]>) -> io::Result<()> {
    match std::fs::metadata(path) {
        Ok(about) if !about.is_file() => std::fs::write(path, content),
        // A link to a file stays one.
        Ok(_) => tape::write_atomic(&std::fs::canonicalize(path)?, content),
        Err(_) => tape::write_atomic(path, content),
    }
}

/// `path` without links, as far as it exists.
fn resolved(path: &Path) -> PathBuf {
    let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    for there in path.ancestors() {
        if let (Ok(real), Ok(rest)) = (std::fs::canonicalize(there), path.strip_prefix(there)) {
            return real.join(rest);
        }
    }
    path
}

/// The part of a run that `path` is or lies in. The innermost run folder decides: that of a shadow lies in the folder of its run.
fn part_of_run(path: &Path) -> Option<String> {
    if let Some(folder) = path.parent().filter(|folder| is_tape(folder))
        && let Some(name) = path.file_name().map(|name| name.to_string_lossy())
        && (name.ends_with(".bin") || ["index.json", "seal.json", "events.jsonl"].contains(&&*name))
    {
        return Some(format!("it is a file of the tape in {}", folder.display()));
    }
    let is_run = |folder: &&Path| REQUIRED_FILES.iter().all(|name| folder.join(name).is_file());
    let folder = path.ancestors().skip(1).find(is_run)?;
    let first = path.strip_prefix(folder).ok()?.components().next()?;
    let name = first.as_os_str().to_string_lossy();
    let part = RUN_ENTRIES.contains(&&*name);
    part.then(|| format!("`{name}` is part of the run in {}", folder.display()))
}

fn is_tape(folder: &Path) -> bool {
    ["index.json", "events.jsonl"]
        .iter()
        .all(|name| folder.join(name).is_file())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder with the files of a run, of its shadow and of a bare tape.
    fn runs(name: &str) -> PathBuf {
        let root = std::env::temp_dir().join(format!("escapement-destinations-{}-{name}", std::process::id()));
        let _ = std::fs::remove_dir_all(&root);
        for file in [
            "run/plan.toml",
            "run/run.json",
            "run/tape/index.json",
            "run/tape/events.jsonl",
            "run/shadow/a/plan.toml",
            "run/shadow/a/run.json",
            "bare/index.json",
            "bare/events.jsonl",
        ] {
            let file = root.join(file);
            std::fs::create_dir_all(file.parent().unwrap()).unwrap();
            std::fs::write(file, "recorded").unwrap();
        }
        root
    }

    #[test]
    fn destination_inside_recorded_run_is_refused() {
        let root = runs("parts");
        std::os::unix::fs::symlink(root.join("run/plan.toml"), root.join("link")).unwrap();
        for part in [
            "run/plan.toml",
            "run/summary.json",
            "run/tape/index.json",
            "run/tape/new/page.html",
            "run/tape",
            "run/checkpoints/1s.checkpoint",
            "run/shadow/a/run.json",
            "run/../run/run.json",
            "bare/index.json",
            "bare/a.x.bin",
            "link",
        ] {
            let error = check("--out", &root.join(part)).unwrap_err().to_string();
            assert!(
                error.starts_with("--out ") && error.contains("never written over"),
                "{part}: {error}"
            );
        }
        for free in [
            "run/report.html",
            "run/export",
            "run/shadow/a/report.html",
            "bare/page.html",
            "new/tape/x",
        ] {
            check("--out", &root.join(free)).unwrap_or_else(|error| panic!("{free}: {error}"));
        }
        let new = root.join("new");
        for part in [
            "new/plan.toml",
            "new/tape/a.x.bin",
            "new/outputs.json",
            "new/log/../tape/x",
        ] {
            let error = check_beside("--trace", &root.join(part), Some(&new))
                .unwrap_err()
                .to_string();
            assert!(
                error.starts_with("--trace ") && error.contains("has its own `"),
                "{part}: {error}"
            );
        }
        for free in ["new/trace.json", "newer/plan.toml", "trace.json"] {
            check_beside("--trace", &root.join(free), Some(&new)).unwrap_or_else(|error| panic!("{free}: {error}"));
        }
        check_beside("--trace", &root.join("run/plan.toml"), None).unwrap_err();
        let folders = ["run", "run/tape", "bare"].map(|name| folder_of(&root.join(name)));
        assert_eq!(folders, ["run", "run", "bare"].map(|name| root.join(name)));
        std::fs::remove_dir_all(&root).unwrap();
    }

    #[cfg(feature = "capture")]
    #[test]
    fn destination_that_is_another_file_is_refused() {
        let root = runs("distinct");
        let (plant, link, hard) = (root.join("plant"), root.join("link"), root.join("hard"));
        std::fs::write(&plant, "plant").unwrap();
        std::os::unix::fs::symlink(&plant, &link).unwrap();
        std::fs::hard_link(&plant, &hard).unwrap();
        let new = root.join("new");
        for (read, out, export) in [
            (&plant, &plant, None),
            (&plant, &root.join("run/../plant"), None),
            (&plant, &link, None),
            (&link, &plant, None),
            (&plant, &hard, None),
            (&plant, &new, Some(&plant)),
            (&plant, &new, Some(&new)),
            (&plant, &new, Some(&root.join("run/../new"))),
        ] {
            let mut written = vec![("--out", out.as_path())];
            written.extend(export.map(|path| ("--export", path.as_path())));
            let error = check_distinct(&[("the plant", read)], &written)
                .unwrap_err()
                .to_string();
            assert!(
                error.contains("would be lost") && error.contains("this is also"),
                "{error}"
            );
        }
        let null = Path::new("/dev/null");
        check_distinct(
            &[("the plant", &plant)],
            &[("--out", &new), ("--export", null), ("--more", null)],
        )
        .unwrap();
        std::fs::remove_dir_all(&root).unwrap();
    }

    #[test]
    fn write_keeps_link_and_does_not_replace_folder() {
        let root = runs("links");
        let (page, link) = (root.join("page"), root.join("link"));
        std::fs::write(&page, "old").unwrap();
        std::os::unix::fs::symlink(&page, &link).unwrap();
        write(&link, "new").unwrap();
        assert!(link.is_symlink());
        assert_eq!(std::fs::read_to_string(&page).unwrap(), "new");
        assert!(write(&root.join("run"), "x").is_err());
        write(Path::new("/dev/null"), "x").unwrap();
        assert!(!Path::new("/dev/null").is_file());
        std::fs::remove_dir_all(&root).unwrap();
    }
}
