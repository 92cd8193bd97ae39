//! The program as its user starts it.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

/// The root of the project.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .expect("the tests lie in the project")
        .to_owned()
}

/// The folder with the programs of the build that this test belongs to: `target/release` or `target/debug`.
fn programs() -> PathBuf {
    let own = std::env::current_exe().expect("a test has a file");
    own.parent()
        .and_then(Path::parent)
        .expect("tests are built into target/PROFILE/deps")
        .to_owned()
}

/// The program. Cargo builds only the programs of the package that is tested, so this one is built here, once.
pub fn orchestrator() -> &'static Path {
    static BUILT: OnceLock<PathBuf> = OnceLock::new();
    BUILT.get_or_init(|| build("orchestrator", &["-p", "orchestrator", "--bin", "orchestrator"]))
}

/// A participant of the folder `tests/participants`, healthy or not.
pub fn participant(name: &str) -> PathBuf {
    static BUILT: OnceLock<PathBuf> = OnceLock::new();
    let folder = BUILT.get_or_init(|| build("", &["-p", "escapement-tests", "--bins"]));
    folder.join(name)
}

fn build(program: &str, what: &[&str]) -> PathBuf {
    let folder = programs();
    let mut cargo = Command::new(env!("CARGO"));
    cargo.current_dir(root()).arg("build").arg("--quiet").args(what);
    if folder.ends_with("release") {
        cargo.arg("--release");
    }
    let built = cargo.stdout(Stdio::null()).status().expect("cargo can be started");
    assert!(built.success(), "{what:?} does not build");
    folder.join(program)
}

/// A path as an argument.
pub fn text(path: &Path) -> &str {
    path.to_str().expect("paths of tests are text")
}

/// A folder that is removed with everything in it.
pub struct Folder(PathBuf);

impl Folder {
    /// A new one under the build's folder for temporary files.
    pub fn new(name: &str) -> Folder {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        let path = programs()
            .join("tmp")
            .join(format!("{name}-{}-{number}", std::process::id()));
        std::fs::create_dir_all(&path).expect("the build's folder can be written");
        Folder(path)
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// Writes a file into it.
    pub fn write(&self, name: &str, text: &str) -> PathBuf {
        let path = self.0.join(name);
        std::fs::write(&path, text).expect("the folder can be written");
        path
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// What a finished program said.
#[derive(Debug)]
pub struct Said {
    /// The exit code; `None` when a signal ended it.
    pub code: Option<i32>,
    /// Standard output.
    pub out: String,
    /// Standard error.
    pub err: String,
}

impl From<Output> for Said {
    fn from(output: Output) -> Said {
        Said {
            code: output.status.code(),
            out: String::from_utf8_lossy(&output.stdout).into_owned(),
            err: String::from_utf8_lossy(&output.stderr).into_owned(),
        }
    }
}

impl Said {
    /// Standard output as JSON.
    pub fn json(&self) -> serde_json::Value {
        serde_json::from_str(&self.out).unwrap_or_else(|error| panic!("{error}: {self:?}"))
    }
}

/// `orchestrator` with `arguments`, to its end. A test that could hang is ended after two minutes.
pub fn orchestrate(arguments: &[&str]) -> Said {
    finish(start(arguments))
}

/// `orchestrator` with `arguments`, still running.
pub fn start(arguments: &[&str]) -> Child {
    let mut command = Command::new(orchestrator());
    command
        .args(arguments)
        .current_dir(root())
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command.spawn().expect("the orchestrator can be started")
}

/// Waits for the end of a started program.
pub fn finish(mut child: Child) -> Said {
    let started = Instant::now();
    // Output is small enough for the pipes' buffers, so looking at the end alone is enough.
    while child.try_wait().expect("a child can be waited for").is_none() {
        if started.elapsed() > Duration::from_secs(120) {
            let _ = child.kill();
            let said = Said::from(child.wait_with_output().expect("a killed child has an end"));
            panic!("hangs: {said:?}");
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    child.wait_with_output().expect("the child has ended").into()
}
