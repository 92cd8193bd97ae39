//! Another user of the machine can neither read nor write what belongs to a run, whatever the user's umask.

use std::fs;
use std::os::unix::fs::{FileTypeExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use escapement_tests::fixture::write_oscillator;
use escapement_tests::program::{Folder, orchestrator, root, run_orchestrator, text, wait_for_output};

/// A run that lasts until it is ended, started with all permissions for all users.
struct Running {
    child: Child,
    folder: PathBuf,
    prefix: String,
    files: Folder,
}

impl Running {
    fn start() -> Running {
        let files = Folder::new("open");
        let scenario = write_oscillator(&files, "damper");
        let child = Command::new("sh")
            .args(["-c", "umask 0; exec \"$@\"", "sh"])
            .arg(orchestrator())
            .arg("run")
            .arg(&scenario)
            .args(["--real-time=0.1", "--duration", "1 h", "--out"])
            .arg(files.path().join("run"))
            .current_dir(root())
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the orchestrator can be started");
        let mut running = Running {
            child,
            folder: PathBuf::new(),
            prefix: String::new(),
            files,
        };
        let started = Instant::now();
        // Both participants run, so all files and objects of the run exist.
        loop {
            let addresses = addresses(running.child.id());
            let samples = fs::metadata(running.files.path().join("run/tape/plant.motion.bin"));
            if let (true, [address, _]) = (samples.is_ok_and(|about| about.len() > 0), &addresses[..]) {
                let (prefix, folder) = address.split_once('@').expect("an address has two parts");
                (running.prefix, running.folder) = (prefix.to_owned(), PathBuf::from(folder));
                return running;
            }
            assert!(started.elapsed() < Duration::from_secs(100), "the run does not start");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// All files of the run: its folder with its content, and its objects in shared memory.
    fn objects(&self) -> Vec<PathBuf> {
        let mut found = vec![self.folder.clone()];
        let mut at = 0;
        while let Some(folder) = found.get(at).cloned() {
            let inside = fs::read_dir(&folder).into_iter().flatten().flatten();
            found.extend(inside.map(|entry| entry.path()));
            at += 1;
        }
        let memory = fs::read_dir("/dev/shm").into_iter().flatten().flatten();
        let own = memory.filter(|entry| entry.file_name().to_string_lossy().starts_with(&self.prefix));
        found.extend(own.map(|entry| entry.path()));
        found
    }

    fn end(mut self) {
        let pid = self.child.id().to_string();
        let _ = Command::new("kill").args(["-INT", &pid]).status();
        let child = std::mem::replace(&mut self.child, Command::new("true").spawn().expect("`true` runs"));
        wait_for_output(child);
        let _ = self.child.wait();
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The run's address in the environment of the children of `parent`.
fn addresses(parent: u32) -> Vec<String> {
    let entries = fs::read_dir("/proc").into_iter().flatten().flatten();
    let processes = entries.filter(|entry| entry.file_name().to_string_lossy().parse::<u32>().is_ok());
    let address = |process: &Path| {
        let status = fs::read_to_string(process.join("status")).ok()?;
        let line = status.lines().find_map(|line| line.strip_prefix("PPid:"))?;
        if line.trim().parse::<u32>().ok()? != parent {
            return None;
        }
        let environment = fs::read(process.join("environ")).ok()?;
        let text = String::from_utf8_lossy(&environment).into_owned();
        text.split('\0')
            .find_map(|entry| entry.strip_prefix("ESCAPEMENT_RUN="))
            .map(str::to_owned)
    };
    processes.filter_map(|entry| address(&entry.path())).collect()
}

#[test]
fn files_and_objects_of_a_run_are_private_to_its_user() {
    let running = Running::start();
    let mut objects = running.objects();
    let memory = objects
        .iter()
        .filter(|path| path.parent() == Some(Path::new("/dev/shm")))
        .count();
    assert!(memory >= 10 && objects.len() - memory >= 5, "{objects:?}");
    // Only its owner can enter the folder, so its content is out of reach; the folder and every object outside it must deny access to
    // other users by themselves.
    let mut open = Vec::new();
    for path in &objects {
        let Ok(about) = fs::symlink_metadata(path) else {
            continue;
        };
        let inside = path.starts_with(&running.folder) && *path != running.folder;
        let shut = about.mode() & 0o077 == 0;
        if !shut && !inside {
            open.push(format!("{} has mode {:o}", path.display(), about.mode() & 0o7777));
        }
        assert!(!about.file_type().is_block_device());
    }
    // Everything that the run leaves behind is below a folder that other users cannot enter.
    let kept = running.files.path().join("run");
    let mode = fs::metadata(&kept).expect("the run folder is there").mode();
    if mode & 0o077 != 0 {
        open.push(format!("{} has mode {:o}", kept.display(), mode & 0o7777));
    }
    objects.push(kept.join("tape"));
    // As root the access can be tried: it is denied.
    if rustix::process::getuid().is_root() {
        for path in &objects {
            for test in ["-r", "-w"] {
                let mut command = Command::new("setpriv");
                command.args(["--reuid=65534", "--regid=65534", "--clear-groups", "test", test]);
                let Ok(status) = command.arg(path).status() else { break };
                if status.success() {
                    open.push(format!("{} is open to nobody: test {test}", path.display()));
                }
            }
        }
    }
    running.end();
    assert!(open.is_empty(), "{}", open.join("\n"));
}

/// Runs the orchestrator as another user, without privileges. `None` where that is impossible.
fn as_another_user(arguments: &[&str]) -> Option<std::process::Output> {
    let user = ["--reuid=65534", "--regid=65534", "--clear-groups"];
    let setpriv = || {
        let mut command = Command::new("setpriv");
        command.args(user).stdin(Stdio::null()).current_dir("/");
        command
    };
    let may = setpriv().args(["test", "-x"]).arg(orchestrator()).status();
    if !rustix::process::getuid().is_root() || !may.is_ok_and(|status| status.success()) {
        return None;
    }
    Some(
        setpriv()
            .arg(orchestrator())
            .args(arguments)
            .output()
            .expect("it can be started"),
    )
}

#[test]
fn folders_of_another_user_do_not_block_a_run() {
    let files = Folder::new("guessed");
    let scenario = write_oscillator(&files, "damper");
    // Guessable names: a name made from the number of a user, held by another user for each of the two.
    let guessed = ["esc-0", "esc-65534"].map(|name| Path::new("/dev/shm").join(name));
    for (folder, owner) in guessed.iter().zip([65534, 0]) {
        let _ = fs::create_dir(folder);
        let _ = std::os::unix::fs::chown(folder, Some(owner), Some(owner));
    }
    let out = files.path().join("run");
    let output = run_orchestrator(&["run", text(&scenario), "--out", text(&out), "--duration", "1 s"]);
    std::os::unix::fs::chown(files.path(), Some(65534), Some(65534)).unwrap_or_default();
    let out = files.path().join("nobody");
    let other = as_another_user(&["run", text(&scenario), "--out", text(&out), "--duration", "1 s"]);
    guessed.iter().for_each(|folder| drop(fs::remove_dir(folder)));
    assert_eq!(output.code, Some(0), "{output:?}");
    if let Some(other) = other {
        assert_eq!(other.status.code(), Some(0), "{other:?}");
    }
}

#[test]
fn doctor_leaves_the_objects_of_another_user() {
    let running = Running::start();
    if let Some(output) = as_another_user(&["doctor", "--remove", "--json"]) {
        let found = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(
            output.status.success() && !found.contains(&running.prefix),
            "{output:?}"
        );
    }
    assert!(running.objects().len() >= 10, "{:?}", running.objects());
    running.end();
}

#[test]
fn run_of_another_user_is_refused_with_the_actual_reason() {
    let files = Folder::new("of-another");
    let scenario = write_oscillator(&files, "damper");
    let out = files.path().join("run");
    let output = run_orchestrator(&["run", text(&scenario), "--out", text(&out), "--duration", "1 s"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let run = text(&out);
    for arguments in [
        &["compare", run, run][..],
        &["report", run],
        &["export", run, "--to", "csv"],
        &["replay", run, "-p", "damper"],
        &["resume", run],
        &["measure", run],
    ] {
        let Some(output) = as_another_user(arguments) else {
            return;
        };
        let words = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {words}");
        assert!(
            words.contains("Permission denied") && words.contains("chmod"),
            "{arguments:?}: {words}"
        );
    }
}

#[test]
fn existing_folder_keeps_its_mode() {
    let files = Folder::new("modes");
    let scenario = write_oscillator(&files, "damper");
    let out = files.path().join("run");
    fs::create_dir(&out).unwrap();
    for (mode, force) in [(0o755, &[][..]), (0o755, &["--force"]), (0o750, &["--force"])] {
        fs::set_permissions(&out, fs::Permissions::from_mode(mode)).unwrap();
        let arguments = ["run", text(&scenario), "--out", text(&out), "--duration", "1 s"];
        let output = run_orchestrator(&[&arguments[..], force].concat());
        assert_eq!(output.code, Some(0), "{output:?}");
        assert_eq!(fs::metadata(&out).unwrap().mode() & 0o7777, mode);
    }
}
