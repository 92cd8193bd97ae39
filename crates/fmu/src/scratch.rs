//! Scratch folders: the private folder on disk in which an FMU is unpacked, and the clean-up after dead processes.
//!
//! A lock on a file in the folder shows that its process is alive; the kernel releases it however the process ends. A
//! folder without a lock can therefore be removed: creating a new folder does so, and every run with participants in processes, and
//! `doctor --remove`.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use rustix::fs::{FlockOperation, flock};
use rustix::rand::{GetRandomFlags, getrandom};

/// The prefix of the folders' names.
pub const FOLDER: &str = "escapement-fmu-";
const LOCK: &str = "lock";
/// A folder younger than this without a lock file may be under construction.
const LOCK_GRACE: Duration = Duration::from_secs(10);

/// A private folder, removed when this is dropped.
#[derive(Debug)]
pub struct Scratch {
    folder: PathBuf,
    _lock: File,
}

impl Scratch {
    /// Creates a folder where the system keeps temporary files (`TMPDIR`, else `/tmp`), and removes those of dead
    /// processes.
    ///
    /// # Errors
    /// The operating system's error, with the folder.
    pub fn create() -> io::Result<Scratch> {
        remove_leftovers();
        let mut random = [0_u8; 12];
        getrandom(&mut random, GetRandomFlags::empty())?;
        let name: String = random.iter().map(|byte| format!("{byte:02x}")).collect();
        let folder = std::path::absolute(std::env::temp_dir().join(format!("{FOLDER}{name}")))?;
        let named = |error: io::Error| {
            let text = format!("{}: {error} (TMPDIR names another place)", folder.display());
            io::Error::new(error.kind(), text)
        };
        fs::DirBuilder::new().mode(0o700).create(&folder).map_err(named)?;
        let lock = OpenOptions::new()
            .create_new(true)
            .write(true)
            .mode(0o600)
            .open(folder.join("lock.new"));
        let lock = lock.map_err(named)?;
        flock(&lock, FlockOperation::NonBlockingLockExclusive)?;
        fs::rename(folder.join("lock.new"), folder.join(LOCK)).map_err(named)?;
        let scratch = Scratch { folder, _lock: lock };
        for part in [scratch.unpacked(), scratch.working_directory()] {
            fs::DirBuilder::new().mode(0o700).create(part)?;
        }
        Ok(scratch)
    }

    /// The path where the FMU is unpacked.
    pub fn unpacked(&self) -> PathBuf {
        self.folder.join("fmu")
    }

    /// An empty working directory: an FMU that leaves files in its working directory leaves them here.
    pub fn working_directory(&self) -> PathBuf {
        self.folder.join("work")
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.folder);
    }
}

/// The folders of this user that dead processes left.
pub fn leftovers() -> Vec<PathBuf> {
    let user = rustix::process::getuid().as_raw();
    let entries = fs::read_dir(std::env::temp_dir()).into_iter().flatten().flatten();
    let own = entries.filter(|entry| {
        let named = entry.file_name().to_str().is_some_and(|name| name.starts_with(FOLDER));
        named
            && entry
                .metadata()
                .is_ok_and(|about| about.is_dir() && about.uid() == user)
    });
    own.map(|entry| entry.path())
        .filter(|folder| is_abandoned(folder))
        .collect()
}

/// Removes the folders of this user that dead processes left.
pub fn remove_leftovers() {
    for folder in leftovers() {
        let _ = fs::remove_dir_all(folder);
    }
}

fn is_abandoned(folder: &Path) -> bool {
    match File::open(folder.join(LOCK)) {
        Ok(lock) => flock(&lock, FlockOperation::NonBlockingLockExclusive).is_ok(),
        Err(_) => {
            let made = fs::metadata(folder).and_then(|about| about.modified());
            made.is_ok_and(|made| SystemTime::now().duration_since(made).is_ok_and(|age| age > LOCK_GRACE))
        }
    }
}
