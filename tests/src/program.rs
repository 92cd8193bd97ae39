//! The program, started as by its user.

use std::ffi::OsStr;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// The root of the project.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("the tests lie in the project")
        .to_owned()
}

/// The folder with the programs of the build that this program or test belongs to: `target/release` or `target/debug`.
fn programs() -> PathBuf {
    let own = std::env::current_exe().expect("a test has a file");
    let folder = own.parent().expect("a file lies in a folder");
    match folder.file_name() {
        Some(name) if name == "deps" => folder.parent().expect("tests are built into target/PROFILE/deps"),
        _ => folder,
    }
    .to_owned()
}

/// The program.
pub fn orchestrator() -> &'static Path {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    PROGRAM.get_or_init(|| built().join("escapement"))
}

/// A participant of the folder `tests/participants`, healthy or not.
pub fn participant(name: &str) -> PathBuf {
    built().join(name)
}

/// The program of `examples/spring`.
pub fn spring() -> PathBuf {
    built().join("spring")
}

static BUILT: OnceLock<PathBuf> = OnceLock::new();

/// Uses all programs as they are from now on: a process of the same build has built them.
pub fn all_built() {
    let _ = BUILT.set(programs());
}

/// The folder with everything that a test may start. Cargo builds only the programs of the package under test, so the others are built
/// here: once, and by one command for the whole workspace, because building a part of it would select other features of shared
/// dependencies.
pub fn built() -> &'static Path {
    BUILT.get_or_init(|| {
        let folder = programs();
        build(folder.ends_with("release"));
        folder
    })
}

/// Ensures that the programs are in `target/release`, where scenarios of the examples name them, whatever profile a test was built with.
pub fn built_as_shipped() {
    if !built().ends_with("release") {
        build(true);
    }
}

fn build(release: bool) {
    let mut cargo = Command::new(env!("CARGO"));
    cargo
        .current_dir(root())
        // With the libraries: plug-ins, and the library for programs in C.
        .args(["build", "--quiet", "--workspace", "--bins", "--lib"]);
    if release {
        cargo.arg("--release");
    }
    let status = cargo.stdout(Stdio::null()).status().expect("cargo can be started");
    assert!(status.success(), "the programs do not build");
}

/// Copies the program `from` to `to`, which can be started at once: another process writes the copy, so that none that this one starts
/// meanwhile holds it open for writing ("text file busy").
///
/// # Panics
/// When it cannot be copied.
pub fn copy_program(from: &Path, to: &Path) {
    let copied = Command::new("cp").arg("--").args([from, to]).status();
    assert!(
        copied.expect("cp is there").success(),
        "{} to {}",
        from.display(),
        to.display()
    );
}

/// A path as an argument.
pub fn text(path: &Path) -> &str {
    path.to_str().expect("paths of tests are text")
}

/// A folder that is removed with its content, unless it is kept.
pub struct Folder {
    path: PathBuf,
    kept: AtomicBool,
}

impl Folder {
    /// A new folder below the build's folder for temporary files.
    pub fn new(name: &str) -> Folder {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        let path = programs()
            .join("tmp")
            .join(format!("{name}-{}-{number}", std::process::id()));
        std::fs::create_dir_all(&path).expect("the build's folder can be written");
        Folder {
            path,
            kept: AtomicBool::new(false),
        }
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Keeps the folder, for a diagnosis.
    pub fn keep(&self) -> &Path {
        self.kept.store(true, Ordering::Relaxed);
        &self.path
    }

    /// Writes a file into the folder.
    pub fn write(&self, name: &str, text: &str) -> PathBuf {
        let path = self.path.join(name);
        std::fs::write(&path, text).expect("the folder can be written");
        path
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        if !self.kept.load(Ordering::Relaxed) {
            let _ = std::fs::remove_dir_all(&self.path);
        }
    }
}

/// The output of a finished program.
#[derive(Debug)]
pub struct ProgramOutput {
    /// The exit code; `None` when a signal ended it.
    pub code: Option<i32>,
    /// Standard output.
    pub out: String,
    /// Standard error.
    pub err: String,
}

impl From<Output> for ProgramOutput {
    fn from(output: Output) -> ProgramOutput {
        ProgramOutput {
            code: output.status.code(),
            out: String::from_utf8_lossy(&output.stdout).into_owned(),
            err: String::from_utf8_lossy(&output.stderr).into_owned(),
        }
    }
}

impl ProgramOutput {
    /// Standard output as JSON.
    pub fn json(&self) -> serde_json::Value {
        serde_json::from_str(&self.out).unwrap_or_else(|error| panic!("{error}: {self:?}"))
    }
}

/// Checks that `output` is an error message with all of `parts` and with none of `without`.
pub fn assert_refused(output: &ProgramOutput, parts: &[&str], without: &[&str]) {
    assert_eq!(output.code, Some(2), "{output:?}");
    for part in parts {
        assert!(output.err.contains(part), "`{part}` is not in: {}", output.err);
    }
    for part in without {
        assert!(!output.err.contains(part), "`{part}` is in: {}", output.err);
    }
}

/// Runs a scenario into the folder `run` in `folder`, in place of an earlier run.
pub fn run_anew(folder: &Folder, scenario: &Path, how: &[&str]) -> ProgramOutput {
    let out = folder.path().join("run");
    let _ = std::fs::remove_dir_all(&out);
    run_orchestrator(&[&["run", text(scenario), "--quiet", "--out", text(&out)], how].concat())
}

/// The digest of the tape of such a run, which must be complete.
pub fn digest_anew(folder: &Folder, scenario: &Path, how: &[&str]) -> String {
    let output = run_anew(folder, scenario, &[how, &["--json"]].concat());
    assert_eq!(output.code, Some(0), "{output:?}");
    output.json()["tape_digest"].as_str().expect("a digest").to_owned()
}

/// Runs `orchestrator` with `arguments` to its end. A test that hangs is ended after two minutes.
pub fn run_orchestrator(arguments: &[&str]) -> ProgramOutput {
    wait_for_output(start_orchestrator(arguments))
}

/// Starts `orchestrator` with `arguments`.
pub fn start_orchestrator(arguments: &[&str]) -> Child {
    start_program(orchestrator(), arguments)
}

/// Runs `program` with `arguments` to its end, as [`run_orchestrator`] does.
pub fn run_program(program: &Path, arguments: &[impl AsRef<OsStr>]) -> ProgramOutput {
    wait_for_output(start_program(program, arguments))
}

/// Starts `program` with `arguments`.
pub fn start_program(program: &Path, arguments: &[impl AsRef<OsStr>]) -> Child {
    let mut command = Command::new(program);
    command
        .args(arguments)
        .current_dir(root())
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command.spawn().expect("the program can be started")
}

/// Waits for the end of a started program, and reads its output meanwhile: a full pipe would block it.
pub fn wait_for_output(mut child: Child) -> ProgramOutput {
    let started = Instant::now();
    let out = child.stdout.take().map(drain);
    let err = child.stderr.take().map(drain);
    let mut hangs = false;
    let status = loop {
        if let Some(status) = child.try_wait().expect("a child can be waited for") {
            break status;
        }
        if started.elapsed() > Duration::from_secs(120) && !hangs {
            let _ = child.kill();
            hangs = true;
        }
        std::thread::sleep(Duration::from_millis(2));
    };
    let text = |from: Option<JoinHandle<Vec<u8>>>| from.map_or(Vec::new(), |from| from.join().unwrap_or_default());
    let (stdout, stderr) = (text(out), text(err));
    let output = ProgramOutput::from(Output { status, stdout, stderr });
    assert!(!hangs, "hangs: {output:?}");
    output
}

/// Reads to the end, in parallel with the wait.
fn drain(mut from: impl Read + Send + 'static) -> JoinHandle<Vec<u8>> {
    std::thread::spawn(move || {
        let mut all = Vec::new();
        let _ = from.read_to_end(&mut all);
        all
    })
}
