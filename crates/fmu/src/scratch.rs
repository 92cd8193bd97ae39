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
        remove(&self.folder);
    }
}

/// The folders of this user that dead processes left.
pub fn leftovers() -> Vec<PathBuf> {
    abandoned_folders().map(|(folder, _)| folder).collect()
}

/// Removes the folders of this user that dead processes left.
pub fn remove_leftovers() {
    // The lock is held meanwhile: another process that cleans up at the same moment leaves the folder to this one. Two that removed the same
    // files would both give up where one is gone, and leave the folder half empty.
    abandoned_folders().for_each(|(folder, _lock)| remove(&folder));
}

/// Removes a folder whose lock this process has. The lock is removed last: without it, a folder that is left here by the end of this process
/// would count as one that is being made.
fn remove(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if entry.file_name() == LOCK {
            continue;
        }
        let _ = match entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            true => fs::remove_dir_all(path),
            false => fs::remove_file(path),
        };
    }
    // What could not be removed keeps its lock file, and so the next one tries again.
    let rest = fs::read_dir(folder).into_iter().flatten().flatten();
    if rest.filter(|entry| entry.file_name() != LOCK).count() == 0 {
        let _ = fs::remove_file(folder.join(LOCK));
        let _ = fs::remove_dir(folder);
    }
}

/// The folders of this user that dead processes left, each with its lock, if it has one.
fn abandoned_folders() -> impl Iterator<Item = (PathBuf, Option<File>)> {
    let user = rustix::process::getuid().as_raw();
    let entries = fs::read_dir(std::env::temp_dir()).into_iter().flatten().flatten();
    let own = entries.filter(move |entry| {
        let named = entry.file_name().to_str().is_some_and(|name| name.starts_with(FOLDER));
        named
            && entry
                .metadata()
                .is_ok_and(|about| about.is_dir() && about.uid() == user)
    });
    own.filter_map(|entry| {
        let folder = entry.path();
        let lock = lock_of_abandoned(&folder)?;
        Some((folder, lock))
    })
}

/// The lock of a folder without a living process; `None` for the folder of a living one, and for one that another process is removing.
fn lock_of_abandoned(folder: &Path) -> Option<Option<File>> {
    match File::open(folder.join(LOCK)) {
        Ok(lock) => (flock(&lock, FlockOperation::NonBlockingLockExclusive).is_ok()).then_some(Some(lock)),
        Err(_) => {
            let made = fs::metadata(folder).and_then(|about| about.modified());
            let old = made.is_ok_and(|made| SystemTime::now().duration_since(made).is_ok_and(|age| age > LOCK_GRACE));
            old.then_some(None)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder with many files, as a process leaves it that dies: its lock is released.
    fn leftover() -> PathBuf {
        let scratch = Scratch::create().expect("the folder can be written");
        for number in 0..2000 {
            fs::write(scratch.unpacked().join(number.to_string()), "").expect("the folder can be written");
        }
        flock(&scratch._lock, FlockOperation::Unlock).expect("it is locked");
        let folder = scratch.folder.clone();
        std::mem::forget(scratch);
        folder
    }

    #[test]
    fn lock_of_a_folder_is_held_and_there_until_the_folder_is_empty() {
        let folder = leftover();
        let (lock, deadline) = (folder.join(LOCK), SystemTime::now() + Duration::from_secs(20));
        std::thread::scope(|scope| {
            // Several processes that start at once.
            (0..3).for_each(|_| drop(scope.spawn(remove_leftovers)));
            while folder.exists() && SystemTime::now() < deadline {
                // In this order: what is removed in between is there in none of the two.
                let locked = lock.exists();
                let others = fs::read_dir(folder.join("fmu")).map_or(0, Iterator::count);
                assert!(locked || others == 0, "without a lock, {others} files are left");
                std::thread::yield_now();
            }
        });
        assert!(!folder.exists(), "{} is left", folder.display());
    }
}
