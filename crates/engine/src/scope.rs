//! The part of the machine that belongs to one run, and what dead runs left behind.
//!
//! A run owns a folder that only the user can enter, named by 80 random bits, and every object in shared memory whose name
//! starts with the same bits. A lock on a file in the folder says that the run is alive; the kernel lifts it when the
//! orchestrator dies, however that happens. So everything under the bits of an unlocked folder can be removed, and so can objects
//! without a folder: a run creates its folder before all objects, and removes it after them.
//!
//! All names are drawn at random for one run. So neither another user nor a container, in which the same number is another user, can
//! hold one in advance.

use std::collections::BTreeSet;
use std::fs::{self, File, OpenOptions};
use std::io;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt, symlink};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use lockstep::transport::iceoryx::Address;
use rustix::fs::{FlockOperation, flock};
use tape::folder::private;

const SHARED_MEMORY: &str = "/dev/shm";
const MARK: &str = "esc_";
/// Where the folders of runs are, up to what is drawn for each of them.
pub const FOLDERS: &str = "/dev/shm/esc-";
/// What the names of runs' folders start with.
const FOLDER: &str = "esc-";
const LOCK: &str = "lock";
/// In a run's folder, the way to what it has on disk.
const SCRATCH: &str = "scratch";
/// Letters in the name of a run, five random bits each.
const ID: usize = 16;
/// The last two letters of a prefix are these: two others for each place in shared memory that a run uses one after the other.
const LETTERS: &[u8] = b"_0123456789abcdefghijklmnopqrstuvwxyz";
/// The places of a run.
const PLACES: usize = LETTERS.len() * LETTERS.len();

/// Why a run's place cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum ScopeError {
    /// The operating system refused.
    #[error("`{}`: {what}: {source}", .path.display())]
    Io {
        /// Where.
        path: PathBuf,
        /// What was tried.
        what: &'static str,
        /// Why not.
        source: io::Error,
    },
    /// Everybody was moved too often.
    #[error("the run was taken up {} times: it has no place left in shared memory; what fails again and again is not mended by a restart", PLACES - 1)]
    Exhausted,
}

fn io_error(path: &Path, what: &'static str) -> impl FnOnce(io::Error) -> ScopeError {
    let path = path.to_owned();
    move |source| ScopeError::Io { path, what, source }
}

/// An unguessable name, never drawn twice.
fn draw() -> Result<String, ScopeError> {
    let mut bits = [0_u8; ID];
    File::open("/dev/urandom")
        .and_then(|mut random| io::Read::read_exact(&mut random, &mut bits))
        .map_err(io_error(Path::new("/dev/urandom"), "cannot be read"))?;
    let letters = bits.iter();
    Ok(letters
        .map(|byte| char::from(b"abcdefghijklmnopqrstuvwxyz234567"[usize::from(byte % 32)]))
        .collect())
}

/// The folder of the run `id`. In memory: a run makes a file for each end of each link, which on a disk takes longer than all the
/// rest of its start.
fn folder_of(id: &str) -> PathBuf {
    Path::new(SHARED_MEMORY).join(format!("{FOLDER}{id}"))
}

/// A run's part of the machine. Everything in it is removed when this is dropped.
pub struct Scope {
    id: String,
    folder: PathBuf,
    place: usize,
    _lock: File,
}

impl Scope {
    /// Makes a new one, with a name that nobody can guess and that is never used again.
    pub fn create() -> Result<Scope, ScopeError> {
        let id = draw()?;
        let folder = folder_of(&id);
        private().create(&folder).map_err(io_error(&folder, "cannot be made"))?;
        let lock = folder.join(LOCK);
        // Locked under another name first: nobody ever sees the lock file of a living run unlocked.
        let unborn = folder.join("lock.new");
        let file = OpenOptions::new()
            .create_new(true)
            .write(true)
            .mode(0o600)
            .open(&unborn);
        let file = file.map_err(io_error(&unborn, "cannot be made"))?;
        flock(&file, FlockOperation::NonBlockingLockExclusive)
            .map_err(|error| io_error(&unborn, "cannot be locked")(error.into()))?;
        fs::rename(&unborn, &lock).map_err(io_error(&lock, "cannot be made"))?;
        Ok(Scope {
            id,
            folder,
            place: 0,
            _lock: file,
        })
    }

    /// Where participants find the run.
    pub fn address(&self) -> Address {
        Address {
            prefix: format!(
                "{MARK}{}{}{}",
                self.id,
                letter(self.place / LETTERS.len()),
                letter(self.place % LETTERS.len())
            ),
            folder: self.folder.clone(),
        }
    }

    /// Makes a folder on disk that only the user can enter, for what is too large for memory. It goes with the run, also when
    /// this process is killed; once for each scope.
    pub fn scratch(&self) -> Result<PathBuf, ScopeError> {
        // Not the run's own name, which any user can list in shared memory.
        self.scratch_at(std::env::temp_dir().join(format!("escapement-{}", draw()?)))
    }

    /// The same in the folder `parent`, under a name that begins with `mark`.
    pub fn scratch_in(&self, parent: &Path, mark: &str) -> Result<PathBuf, ScopeError> {
        let made = private().recursive(true).create(parent);
        made.map_err(io_error(parent, "cannot be made"))?;
        self.scratch_at(parent.join(format!("{mark}{}", draw()?)))
    }

    fn scratch_at(&self, folder: PathBuf) -> Result<PathBuf, ScopeError> {
        let folder = std::path::absolute(&folder).map_err(io_error(&folder, "cannot be named in full"))?;
        let link = self.folder.join(SCRATCH);
        // The link first: through it whoever clears up finds the folder.
        symlink(&folder, &link).map_err(io_error(&link, "cannot be made"))?;
        let made = private().create(&folder);
        made.map_err(io_error(&folder, "cannot be made"))?;
        Ok(folder)
    }

    /// Makes room for everybody to move to, so that nothing of a dead process can be met there.
    pub fn move_on(&mut self) -> Result<(), ScopeError> {
        if self.place + 1 == PLACES {
            return Err(ScopeError::Exhausted);
        }
        self.place += 1;
        Ok(())
    }

    /// Removes what is left of the place `address`, which everybody has left.
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

/// What the names of all of a run's objects start with. Identifiers are all of one length, so that no other run's do.
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

/// What a dead run left.
#[derive(Debug)]
pub struct Leftover {
    prefix: String,
    /// The run's folder; it may be gone already.
    pub folder: PathBuf,
    /// What it had on disk besides its run folder, if that is there.
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

/// Everything that dead runs of this user left behind.
pub fn leftovers() -> Vec<Leftover> {
    // Objects before folders: a folder precedes its objects, so an object without a folder belongs to a run that has ended.
    let orphans = ids(MARK, |about| about.is_file());
    let orphans = orphans.into_iter().filter(|id| !folder_of(id).exists());
    // A folder that others may enter, or a symbolic link, is not one of a run.
    let folders = ids(FOLDER, |about| about.is_dir() && about.mode() & 0o077 == 0);
    // Only a folder with a lock that nobody holds proves that a run is dead. Its objects go first and the folder last.
    let dead = folders.into_iter().filter(|id| dead(&folder_of(id)));
    let all: BTreeSet<String> = orphans.chain(dead).collect();
    all.iter().map(|id| leftover(id)).collect()
}

/// The names of runs of which this user owns an entry of shared memory: `mark`, then the name; entries that `kind` accepts.
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

/// Whether nobody holds the lock of a run's folder.
fn dead(folder: &Path) -> bool {
    match File::open(folder.join(LOCK)) {
        Ok(lock) => flock(&lock, FlockOperation::NonBlockingLockExclusive).is_ok(),
        // Without a lock file the run may be just about to make it.
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
        let id = draw().unwrap();
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
