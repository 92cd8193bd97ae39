//! The scope of a run: its resources on the machine, and the remains of dead runs.
//!
//! A run owns a folder that only the user can enter, named by 80 random bits, and every object in shared memory whose name starts
//! with the same bits. A lock on a file in the folder shows that the run is alive; the kernel releases it when the orchestrator
//! dies, however that happens. So everything under the bits of an unlocked folder can be removed, and so can objects without a
//! folder: a run creates its folder before all objects, and removes it after them.
//!
//! All names are drawn at random for one run. So no other user, and no container in which the same number is another user, can
//! claim a name in advance.

use std::collections::BTreeSet;
use std::fs::{self, File, OpenOptions};
use std::io;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt, symlink};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use lockstep::transport::iceoryx::Address;
use rustix::fs::{FlockOperation, flock};
use tape::folder::private_dir_builder;

const SHARED_MEMORY: &str = "/dev/shm";
const MARK: &str = "esc_";
/// The prefix of the paths of runs' folders; a random part follows.
pub const FOLDERS: &str = "/dev/shm/esc-";
/// The prefix of the names of runs' folders.
const FOLDER: &str = "esc-";
const LOCK: &str = "lock";
/// In a run's folder, the link to its folder on disk.
const SCRATCH: &str = "scratch";
/// The number of letters in the name of a run, five random bits each.
const ID: usize = 16;
/// The last two letters of a prefix are from these: a new pair for each domain in shared memory that a run uses in turn.
const LETTERS: &[u8] = b"_0123456789abcdefghijklmnopqrstuvwxyz";
/// The most domains of a run.
const DOMAINS_MAX: usize = LETTERS.len() * LETTERS.len();

/// Why a run's scope cannot be created.
#[derive(Debug, thiserror::Error)]
pub enum ScopeError {
    /// The operating system returned an error.
    #[error("`{}`: {what}: {source}", .path.display())]
    Io {
        /// The path.
        path: PathBuf,
        /// The operation.
        what: &'static str,
        /// The error.
        source: io::Error,
    },
    /// The participants were moved too often.
    #[error("the run was restarted {} times, and no address is left in shared memory: correct the cause of the failure, which a restart does not remove", DOMAINS_MAX - 1)]
    Exhausted,
}

fn io_error(path: &Path, what: &'static str) -> impl FnOnce(io::Error) -> ScopeError {
    let path = path.to_owned();
    move |source| ScopeError::Io { path, what, source }
}

/// An unguessable name, never drawn twice.
fn random_name() -> Result<String, ScopeError> {
    let mut bits = [0_u8; ID];
    File::open("/dev/urandom")
        .and_then(|mut random| io::Read::read_exact(&mut random, &mut bits))
        .map_err(io_error(Path::new("/dev/urandom"), "cannot be read"))?;
    let letters = bits.iter();
    Ok(letters
        .map(|byte| char::from(b"abcdefghijklmnopqrstuvwxyz234567"[usize::from(byte % 32)]))
        .collect())
}

/// The folder of the run `id`, in memory: a run creates a file for each end of each link, which on a disk takes longer than the
/// rest of its start.
fn folder_of(id: &str) -> PathBuf {
    Path::new(SHARED_MEMORY).join(format!("{FOLDER}{id}"))
}

/// A run's resources on the machine. All of them are removed when this is dropped.
pub struct Scope {
    id: String,
    folder: PathBuf,
    domain_number: usize,
    _lock: File,
}

impl Scope {
    /// Creates a scope with an unguessable name that is never used again.
    pub fn create() -> Result<Scope, ScopeError> {
        let id = random_name()?;
        let folder = folder_of(&id);
        private_dir_builder()
            .create(&folder)
            .map_err(io_error(&folder, "cannot be made"))?;
        let lock = folder.join(LOCK);
        // Locked under another name first, so that the lock file of a living run is never seen unlocked.
        let unlocked = folder.join("lock.new");
        let file = OpenOptions::new()
            .create_new(true)
            .write(true)
            .mode(0o600)
            .open(&unlocked);
        let file = file.map_err(io_error(&unlocked, "cannot be made"))?;
        flock(&file, FlockOperation::NonBlockingLockExclusive)
            .map_err(|error| io_error(&unlocked, "cannot be locked")(error.into()))?;
        fs::rename(&unlocked, &lock).map_err(io_error(&lock, "cannot be made"))?;
        Ok(Scope {
            id,
            folder,
            domain_number: 0,
            _lock: file,
        })
    }

    /// The address at which participants find the run.
    pub fn address(&self) -> Address {
        Address {
            prefix: format!(
                "{MARK}{}{}{}",
                self.id,
                letter(self.domain_number / LETTERS.len()),
                letter(self.domain_number % LETTERS.len())
            ),
            folder: self.folder.clone(),
        }
    }

    /// Creates a folder on disk that only the user can enter, for data that is too large for memory. It is removed with the run,
    /// also when this process is killed. Can be called once for each scope.
    pub fn scratch(&self) -> Result<PathBuf, ScopeError> {
        // Not the run's own name, which any user can list in shared memory.
        self.scratch_at(std::env::temp_dir().join(format!("escapement-{}", random_name()?)))
    }

    /// As [`Scope::scratch`], in the folder `parent`, under a name that begins with `mark`.
    pub fn scratch_in(&self, parent: &Path, mark: &str) -> Result<PathBuf, ScopeError> {
        let made = private_dir_builder().recursive(true).create(parent);
        made.map_err(io_error(parent, "cannot be made"))?;
        self.scratch_at(parent.join(format!("{mark}{}", random_name()?)))
    }

    fn scratch_at(&self, folder: PathBuf) -> Result<PathBuf, ScopeError> {
        let folder = std::path::absolute(&folder).map_err(io_error(&folder, "cannot be named in full"))?;
        let link = self.folder.join(SCRATCH);
        // The link first: a clean-up finds the folder through it.
        symlink(&folder, &link).map_err(io_error(&link, "cannot be made"))?;
        let made = private_dir_builder().create(&folder);
        made.map_err(io_error(&folder, "cannot be made"))?;
        Ok(folder)
    }

    /// Moves on to a new domain for all participants, so that no object of a dead process can be found there.
    pub fn next_domain(&mut self) -> Result<(), ScopeError> {
        if self.domain_number + 1 == DOMAINS_MAX {
            return Err(ScopeError::Exhausted);
        }
        self.domain_number += 1;
        Ok(())
    }

    /// Removes the objects that are left in the domain `address`, which all participants have left.
    pub fn clear(&self, address: &Address) {
        for object in objects(&address.prefix) {
            let _ = fs::remove_file(object);
        }
    }
}

fn letter(number: usize) -> char {
    char::from(LETTERS[number])
}

impl Drop for Scope {
    fn drop(&mut self) {
        remove(&prefix(&self.id), &self.folder);
    }
}

/// The prefix of the names of all of a run's objects. All run names have the same length, so no other run's objects have it.
fn prefix(id: &str) -> String {
    format!("{MARK}{id}")
}

fn remove(prefix: &str, folder: &Path) {
    let clear = || objects(prefix).iter().for_each(|object| drop(fs::remove_file(object)));
    clear();
    if let Ok(scratch) = fs::read_link(folder.join(SCRATCH)) {
        let _ = fs::remove_dir_all(scratch);
    }
    let _ = fs::remove_dir_all(folder);
    // A dying process of the run may have created one more. An even later one has no folder, and the next clean-up removes it.
    clear();
}

/// The objects in shared memory whose names start with `prefix`.
fn objects(prefix: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten();
    let named = entries.filter(|entry| entry.file_name().as_encoded_bytes().starts_with(prefix.as_bytes()));
    named.map(|entry| entry.path()).collect()
}

/// The remains of a dead run.
#[derive(Debug)]
pub struct Leftover {
    prefix: String,
    /// The run's folder; it may have been removed already.
    pub folder: PathBuf,
    /// Its folder on disk apart from its run folder, if that exists.
    pub scratch: Option<PathBuf>,
    /// Its objects in shared memory.
    pub objects: Vec<PathBuf>,
    /// Their size, bytes.
    pub bytes: u64,
}

impl Leftover {
    /// Removes all of it.
    pub fn remove(&self) {
        remove(&self.prefix, &self.folder);
    }
}

/// The remains of all dead runs of this user.
pub fn leftovers() -> Vec<Leftover> {
    // Objects before folders: a folder precedes its objects, so an object without a folder belongs to a run that has ended.
    let orphans = ids(MARK, |about| about.is_file());
    let orphans = orphans.into_iter().filter(|id| !folder_of(id).exists());
    // A folder that others may enter, or a symbolic link, is not a run's folder.
    let folders = ids(FOLDER, |about| about.is_dir() && about.mode() & 0o077 == 0);
    // Only a folder with an unlocked lock file proves that a run is dead. Its objects are removed first and the folder last.
    let dead = folders.into_iter().filter(|id| is_dead(&folder_of(id)));
    let all: BTreeSet<String> = orphans.chain(dead).collect();
    all.iter().map(|id| leftover(id)).collect()
}

/// The names of runs of which this user owns an entry of shared memory that is named `mark` followed by the run's name, and that
/// `kind` accepts.
fn ids(mark: &str, kind: impl Fn(&fs::Metadata) -> bool) -> BTreeSet<String> {
    let user = rustix::process::getuid().as_raw();
    let entries = fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten();
    entries
        .filter_map(|entry| {
            let name = entry.file_name().into_string().ok()?;
            let id = name.strip_prefix(mark)?.get(..ID)?.to_owned();
            let drawn = id.bytes().all(|byte| matches!(byte, b'a'..=b'z' | b'2'..=b'7'));
            let about = drawn.then(|| entry.metadata().ok())??;
            (about.uid() == user && kind(&about)).then_some(id)
        })
        .collect()
}

fn leftover(id: &str) -> Leftover {
    let prefix = prefix(id);
    let objects = objects(&prefix);
    let bytes = objects
        .iter()
        .filter_map(|object| fs::metadata(object).ok())
        .map(|about| 512 * about.blocks())
        .sum();
    let folder = folder_of(id);
    let scratch = fs::read_link(folder.join(SCRATCH)).ok();
    Leftover {
        prefix,
        folder,
        scratch: scratch.filter(|scratch| scratch.exists()),
        objects,
        bytes,
    }
}

/// Whether the lock of a run's folder is not held.
fn is_dead(folder: &Path) -> bool {
    match File::open(folder.join(LOCK)) {
        Ok(lock) => flock(&lock, FlockOperation::NonBlockingLockExclusive).is_ok(),
        // Without a lock file, the run may be about to create it.
        Err(_) => {
            let made = fs::metadata(folder).and_then(|about| about.modified());
            made.map_or(true, |made| {
                SystemTime::now()
                    .duration_since(made)
                    .is_ok_and(|age| age > Duration::from_secs(10))
            })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn object_without_a_folder_is_removed() {
        let id = random_name().unwrap();
        let object = Path::new(SHARED_MEMORY).join(format!("{}0_late", prefix(&id)));
        fs::write(&object, "left").unwrap();
        // A run of another test may have removed it already.
        leftovers().iter().for_each(Leftover::remove);
        assert!(!object.exists());
    }

    #[test]
    fn objects_of_a_living_run_are_no_leftovers() {
        let scope = Scope::create().unwrap();
        let object = Path::new(SHARED_MEMORY).join(format!("{}_x", prefix(&scope.id)));
        fs::write(&object, "used").unwrap();
        leftovers().iter().for_each(Leftover::remove);
        assert!(object.exists() && scope.folder.exists());
        let folder = scope.folder.clone();
        drop(scope);
        assert!(!object.exists() && !folder.exists());
    }
}
