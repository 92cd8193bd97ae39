//! The part of the machine that belongs to one run, and what dead runs left behind.
//!
//! A run owns a folder that only the user can enter, named by 80 random bits, and every object in shared memory whose name
//! starts with the same bits. A lock on a file in the folder says that the run is alive; the kernel lifts it when the
//! orchestrator dies, however that happens. So everything under the bits of an unlocked folder is nobody's and can go.

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
const LOCK: &str = "lock";
/// In a run's folder, the way to what it has on disk.
const SCRATCH: &str = "scratch";
/// Letters in the name of a run, five random bits each.
const ID: usize = 16;
/// The last letter of a prefix: one for each place in shared memory that a run uses one after the other.
const PLACES: &[u8] = b"_0123456789abcdefghijklmnopqrstuvwxyz";

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
    #[error("the run was taken up {} times: it has no place left in shared memory; what fails again and again is not mended by a restart", PLACES.len() - 1)]
    Exhausted,
    /// The common folder is not the user's own.
    #[error("`{}` belongs to somebody else or can be entered by others: remove it, or let its owner do so", .0.display())]
    Untrusted(PathBuf),
}

fn io_error(path: &Path, what: &'static str) -> impl FnOnce(io::Error) -> ScopeError {
    let path = path.to_owned();
    move |source| ScopeError::Io { path, what, source }
}

/// The folder in which the folders of all of this user's runs stand. In memory: a run makes a file for each end of each link,
/// which on a disk takes longer than all the rest of its start. The same for all of a user's runs: whoever looks for dead runs
/// must see the locks of the living ones.
pub fn base() -> PathBuf {
    Path::new(SHARED_MEMORY).join(format!("esc-{}", rustix::process::getuid().as_raw()))
}

/// Refuses a common folder that is not the user's own.
fn trust(base: &Path) -> Result<(), ScopeError> {
    let about = fs::symlink_metadata(base).map_err(io_error(base, "cannot be read"))?;
    let own = about.uid() == rustix::process::getuid().as_raw();
    if !about.is_dir() || !own || about.mode() & 0o077 != 0 {
        return Err(ScopeError::Untrusted(base.to_owned()));
    }
    Ok(())
}

/// Makes the folder `id` in the common folder, and that if there is none.
fn make_folder(id: &str) -> Result<PathBuf, ScopeError> {
    let base = base();
    let folder = base.join(id);
    let make = |folder: &Path| match private().create(folder) {
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists && folder == base => Ok(()),
        made => made.map_err(io_error(folder, "cannot be made")),
    };
    let mut tries = 0;
    loop {
        let made = make(&base).and_then(|()| trust(&base)).and_then(|()| make(&folder));
        tries += 1;
        match made {
            // Another run has ended just now, as the last one, and has taken the common folder away.
            Err(ScopeError::Io { source, .. }) if source.kind() == io::ErrorKind::NotFound && tries < 100 => {}
            made => return made.map(|()| folder),
        }
    }
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
        let mut bits = [0_u8; ID];
        File::open("/dev/urandom")
            .and_then(|mut random| io::Read::read_exact(&mut random, &mut bits))
            .map_err(io_error(Path::new("/dev/urandom"), "cannot be read"))?;
        let id: String = bits
            .iter()
            .map(|byte| char::from(b"abcdefghijklmnopqrstuvwxyz234567"[usize::from(byte % 32)]))
            .collect();
        let folder = make_folder(&id)?;
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
            prefix: format!("{MARK}{}{}", self.id, char::from(PLACES[self.place])),
            folder: self.folder.clone(),
        }
    }

    /// Makes a folder on disk that only the user can enter, for what is too large for memory. It goes with the run, also when
    /// this process is killed; once for each scope.
    pub fn scratch(&self) -> Result<PathBuf, ScopeError> {
        let folder = std::env::temp_dir().join(format!("escapement-{}", self.id));
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
        if self.place + 1 == PLACES.len() {
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
    for object in objects(prefix) {
        let _ = fs::remove_file(object);
    }
    if let Ok(scratch) = fs::read_link(folder.join(SCRATCH)) {
        let _ = fs::remove_dir_all(scratch);
    }
    let _ = fs::remove_dir_all(folder);
    // The common folder goes with the last run: while there is another one it is not empty.
    if let Some(base) = folder.parent() {
        let _ = fs::remove_dir(base);
    }
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
    let base = base();
    if trust(&base).is_err() {
        return Vec::new();
    }
    // Only a folder with a lock that nobody holds proves that a run is dead. Its objects go first and the folder last.
    let ids: Vec<String> = fs::read_dir(&base)
        .into_iter()
        .flatten()
        .flatten()
        .filter_map(|entry| entry.file_name().into_string().ok())
        .collect();
    ids.into_iter()
        .filter(|id| id.len() == ID && dead(&base.join(id)))
        .map(|id| leftover(&base, &id))
        .collect()
}

fn leftover(base: &Path, id: &str) -> Leftover {
    let prefix = prefix(id);
    let objects = objects(&prefix);
    let bytes = objects
        .iter()
        .filter_map(|object| fs::metadata(object).ok())
        .map(|about| 512 * about.blocks())
        .sum();
    Leftover {
        prefix,
        folder: base.join(id),
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
