//! Leftovers of runs on the machine: objects in shared memory, folders and processes.

use std::fs;
use std::io::Read;
use std::path::Path;
use std::process::Child;
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};

/// Everything left by runs that are no longer alive: objects in shared memory and folders.
///
/// Tests run in parallel, so everything that belongs to a living run may be another test's and is left out.
pub fn leftovers() -> Vec<String> {
    let output = crate::program::run_orchestrator(&["doctor", "--json"]).json();
    let found = output["leftovers"].as_array().cloned().unwrap_or_default();
    found.iter().map(ToString::to_string).chain(orphans()).collect()
}

/// Objects in shared memory whose run has no folder any more, so that they could never be found. Read from the machine itself,
/// independently of what the program reports. A run removes its objects first and its folder last.
pub fn orphans() -> Vec<String> {
    let memory = Path::new("/dev/shm");
    let entries = fs::read_dir(memory).into_iter().flatten().flatten();
    let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
    let orphan = |name: &String| {
        let id = name.strip_prefix("esc_").and_then(|rest| rest.get(..16));
        id.is_some_and(|id| !memory.join(format!("esc-{id}")).exists()) && memory.join(name).exists()
    };
    names.filter(orphan).collect()
}

/// The processes whose command line contains `folder`, or a path in it.
pub fn processes_of(folder: &std::path::Path) -> Vec<String> {
    let name = folder.as_os_str().as_encoded_bytes();
    // Folders of tests end with a number, and one number may be a prefix of another (2 and 20).
    let continues_name = |line: &[u8], at: usize| line.get(at + name.len()).is_some_and(u8::is_ascii_alphanumeric);
    let contains_name = |line: &[u8]| {
        let mut places = line.windows(name.len()).enumerate();
        places.any(|(at, part)| part == name && !continues_name(line, at))
    };
    let entries = fs::read_dir("/proc").into_iter().flatten().flatten();
    let numbers = entries.filter_map(|entry| entry.file_name().to_str()?.parse::<u32>().ok());
    numbers
        .filter_map(|pid| {
            let line = fs::read(format!("/proc/{pid}/cmdline")).ok()?;
            let found = pid != std::process::id() && contains_name(&line);
            found.then(|| format!("{pid}: {}", String::from_utf8_lossy(&line).replace('\0', " ")))
        })
        .collect()
}

/// Sends `signal` to the process `pid`; returns whether it existed.
pub fn send_signal(pid: u32, signal: Signal) -> bool {
    let pid = Pid::from_raw(pid as i32).expect("a process has a number");
    kill_process(pid, signal).is_ok()
}

/// Waits until `done`. If the run ends earlier, the wait fails with the run's output.
pub fn wait_until(run: &mut Child, what: &str, done: impl Fn() -> bool) {
    let started = Instant::now();
    loop {
        // Check for the end first: what was done just before it counts.
        let ended = run.try_wait().expect("a child can be waited for");
        if done() {
            return;
        }
        let late = started.elapsed() > Duration::from_secs(120);
        if ended.is_some() || late {
            let _ = run.kill();
            let _ = run.wait();
            let how = ended.map_or("hangs".to_owned(), |status| format!("has ended ({status})"));
            panic!("{what}: the run {how}: {}", read_output(run));
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// The output of a run that has ended.
fn read_output(run: &mut Child) -> String {
    let mut all = Vec::new();
    let _ = run.stderr.take().map(|mut pipe| pipe.read_to_end(&mut all));
    let _ = run.stdout.take().map(|mut pipe| pipe.read_to_end(&mut all));
    String::from_utf8_lossy(&all).into_owned()
}

/// Waits until the file at `path`, which `run` writes, has at least `bytes`.
pub fn wait_for_bytes(run: &mut Child, path: &Path, bytes: u64) {
    let what = format!("{} does not grow to {bytes} bytes", path.display());
    wait_until(run, &what, || {
        fs::metadata(path).map_or(0, |about| about.len()) >= bytes
    });
}

/// The process that writes `log`, the first process of a participant in a run folder.
pub fn writer_of(log: &Path) -> Option<u32> {
    let participant = log.file_stem()?.to_str()?;
    let run = log.parent()?.parent()?.as_os_str().as_encoded_bytes();
    let wanted = format!("ESCAPEMENT_PARTICIPANT={participant}");
    let processes = fs::read_dir("/proc").into_iter().flatten().flatten();
    let mut numbers = processes.filter_map(|entry| entry.file_name().to_str()?.parse::<u32>().ok());
    numbers.find(|pid| {
        let read = |pid: u32, what: &str| fs::read(format!("/proc/{pid}/{what}")).unwrap_or_default();
        let environment = read(*pid, "environ");
        if !environment.split(|byte| *byte == 0).any(|one| one == wanted.as_bytes()) {
            return false;
        }
        // Its orchestrator was started with the name of the run folder.
        let status = String::from_utf8_lossy(&read(*pid, "status")).into_owned();
        let parent = status.lines().find_map(|line| line.strip_prefix("PPid:"));
        let parent = parent.and_then(|parent| parent.trim().parse().ok()).unwrap_or(0);
        read(parent, "cmdline").split(|byte| *byte == 0).any(|part| part == run)
    })
}

#[cfg(test)]
mod tests {
    use std::process::{Command, Stdio};

    use super::*;

    #[test]
    #[should_panic(expected = "the licence is gone")]
    fn wait_fails_with_the_output_of_an_ended_run() {
        let mut shell = Command::new("sh");
        shell.args(["-c", "echo the licence is gone >&2; exit 1"]);
        let mut run = shell
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("a shell");
        wait_for_bytes(&mut run, Path::new("/nowhere/file"), 1);
    }
}
