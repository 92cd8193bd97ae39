//! A run folder reserved for a run that may still be rejected; it can replace another run's folder on request.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use super::outputs::{OUTPUTS_FILE, Outputs};
use super::paths::{
    FolderError, REQUIRED_FILES, RUN_ENTRIES, RunFolder, io_error, missing_required_file, private_dir_builder,
};
use super::utc::utc_compact;

/// The entries that an export and a report create in a run folder, and the list of what else was written into it on request.
const DERIVED_ENTRIES: [&str; 3] = ["export", "report.html", OUTPUTS_FILE];
/// The folder that holds the previous run until the new one has begun.
const PREVIOUS: &str = ".replaced";
/// Its name while it is removed.
const DISCARDED: &str = ".discarded";

/// Whether a run, its export or its report creates an entry of this name in its folder. A killed program may leave a draft.
fn is_own(name: &str) -> bool {
    let whole = name.strip_suffix(".part").unwrap_or(name);
    [PREVIOUS, DISCARDED].contains(&name) || RUN_ENTRIES.contains(&whole) || DERIVED_ENTRIES.contains(&whole)
}

/// The outermost ancestor of `path`, or `path` itself, that does not exist yet.
fn outermost_missing(path: &Path) -> Option<PathBuf> {
    let missing = path.ancestors().take_while(|folder| {
        let named = !folder.as_os_str().is_empty();
        named && fs::symlink_metadata(folder).is_err()
    });
    missing.last().map(Path::to_owned)
}

/// A run folder for a run that may still be rejected. Unless it is committed, dropping this restores the previous state: created entries
/// are removed, and previous entries are restored.
#[derive(Debug)]
pub struct Reservation {
    folder: RunFolder,
    /// The outermost folder that was created for it.
    created: Option<PathBuf>,
    /// Whether there is a run to replace.
    replaces: bool,
    committed: bool,
    /// Locked while a run uses it, so that no other run replaces that run.
    _lock: File,
}

impl Reservation {
    /// Creates the folder `root` with its parents, accessible only to the user, or takes an empty one unchanged. A folder that contains a
    /// run and nothing else is taken if `replace` is set; any other is rejected. If a program was killed after it had set a run aside and
    /// before its own run began, the run that was set aside is restored first.
    ///
    /// # Errors
    /// Names the obstacle; nothing else has been changed then.
    pub fn reserve(root: &Path, replace: bool) -> Result<Reservation, FolderError> {
        let created = outermost_missing(root);
        private_dir_builder()
            .recursive(true)
            .create(root)
            .map_err(|error| match fs::metadata(root) {
                Ok(metadata) if !metadata.is_dir() => FolderError::NotAFolder { path: root.to_owned() },
                _ => io_error(root, "create the folder")(error),
            })?;
        let lock = lock_folder(root)?;
        let mut entries = fs::read_dir(root).map_err(io_error(root, "list the folder"))?;
        let taken = entries.next().is_some();
        if taken && !replace {
            return Err(FolderError::NotEmpty { path: root.to_owned() });
        }
        if taken {
            recover_interrupted(root)?;
            validate_run_folder(root)?;
            for left in [PREVIOUS, DISCARDED] {
                remove_folder(&root.join(left))?;
            }
        }
        Reservation::prepare(root, created, taken, lock)
    }

    /// Takes the folder `root`, which was just created; `created` is the outermost folder created for it.
    fn for_created_folder(root: &Path, created: Option<PathBuf>) -> Result<Reservation, FolderError> {
        Reservation::prepare(root, created, false, lock_folder(root)?)
    }

    fn prepare(root: &Path, created: Option<PathBuf>, replaces: bool, lock: File) -> Result<Reservation, FolderError> {
        let reservation = Reservation {
            folder: RunFolder::open(root),
            created,
            replaces,
            committed: false,
            _lock: lock,
        };
        if replaces {
            reservation.set_aside_previous()?;
        }
        let log = root.join("log");
        fs::create_dir(&log).map_err(io_error(&log, "create the folder"))?;
        Ok(reservation)
    }

    /// The folder.
    pub fn folder(&self) -> &RunFolder {
        &self.folder
    }

    /// Whether a previous run is set aside for it.
    pub fn replaces(&self) -> bool {
        self.replaces
    }

    /// The run has begun: the folder stays, and the previous content is deleted.
    pub fn commit(&mut self) {
        self.committed = true;
        if std::mem::take(&mut self.replaces) {
            let [previous, discarded] = [PREVIOUS, DISCARDED].map(|name| self.folder.root.join(name));
            // A run in `.replaced` is restored later if this program is killed now: the name changes before anything is removed.
            let _ = fs::rename(&previous, &discarded).and_then(|()| fs::remove_dir_all(&discarded));
        }
    }

    /// Returns the folder, which stays.
    pub fn into_folder(mut self) -> RunFolder {
        self.commit();
        self.folder.clone()
    }

    fn set_aside_previous(&self) -> Result<(), FolderError> {
        let root = &self.folder.root;
        let previous = root.join(PREVIOUS);
        private_dir_builder()
            .create(&previous)
            .map_err(io_error(&previous, "create the folder"))?;
        for name in sort_for_moving(list_own_entries(root)?) {
            let path = root.join(&name);
            fs::rename(&path, previous.join(&name)).map_err(io_error(&path, "set the file aside"))?;
        }
        Ok(())
    }

    fn roll_back(&self) -> Result<(), FolderError> {
        let root = &self.folder.root;
        if self.replaces {
            restore_previous(root)?;
        } else {
            remove_own(root)?;
        }
        // Folders that were created for it, from the innermost outwards; one that another run has used in the meantime stays.
        if let Some(created) = &self.created {
            for folder in root.ancestors().take_while(|folder| folder.starts_with(created)) {
                if fs::remove_dir(folder).is_err() {
                    break;
                }
            }
        }
        Ok(())
    }
}

impl Drop for Reservation {
    fn drop(&mut self) {
        if !self.committed {
            let _ = self.roll_back();
        }
    }
}

/// The folder `root`, locked.
fn lock_folder(root: &Path) -> Result<File, FolderError> {
    let lock = File::open(root).map_err(io_error(root, "open the folder"))?;
    match lock.try_lock() {
        Ok(()) => Ok(lock),
        Err(_) => Err(FolderError::NotARun {
            path: root.to_owned(),
            reason: "a run is under way in it".to_owned(),
        }),
    }
}

/// The names of all entries in `folder`, apart from a previous run.
fn list_entries(folder: &Path) -> Result<Vec<String>, FolderError> {
    let entries = fs::read_dir(folder).map_err(io_error(folder, "list the folder"))?;
    let names = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    Ok(names
        .filter(|name| ![PREVIOUS, DISCARDED].contains(&name.as_str()))
        .collect())
}

/// Those of them that a run, or a command about it, has created.
fn list_own_entries(folder: &Path) -> Result<Vec<String>, FolderError> {
    let outputs = Outputs::read(folder);
    let mut names = list_entries(folder)?;
    names.retain(|name| is_own(name) || outputs.foreign_reason(folder, name).is_none());
    Ok(names)
}

/// The order in which the entries `names` of a run are set aside.
fn sort_for_moving(mut names: Vec<String>) -> Vec<String> {
    names.sort_by_key(|name| REQUIRED_FILES.iter().position(|mark| mark == name));
    names
}

fn remove_own(root: &Path) -> Result<(), FolderError> {
    for name in list_own_entries(root)? {
        let path = root.join(&name);
        let removed = if fs::symlink_metadata(&path).is_ok_and(|about| about.is_dir()) {
            fs::remove_dir_all(&path)
        } else {
            fs::remove_file(&path)
        };
        removed.map_err(io_error(&path, "remove it"))?;
    }
    Ok(())
}

/// Removes the folder `path` if it exists.
fn remove_folder(path: &Path) -> Result<(), FolderError> {
    match fs::remove_dir_all(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(io_error(path, "remove the folder")(error)),
        _ => Ok(()),
    }
}

/// Restores the run that is set aside in `root`, completely or in part. Only if it is complete does everything else in `root` belong to the
/// run that was to replace it, and is removed.
fn restore_previous(root: &Path) -> Result<(), FolderError> {
    let previous = root.join(PREVIOUS);
    if fs::symlink_metadata(&previous).is_err() {
        return Ok(());
    }
    if missing_required_file(&previous).is_none() {
        remove_own(root)?;
    }
    for name in sort_for_moving(list_entries(&previous)?).iter().rev() {
        fs::rename(previous.join(name), root.join(name)).map_err(io_error(&previous, "bring it back"))?;
    }
    fs::remove_dir(&previous).map_err(io_error(&previous, "remove the folder"))
}

/// Restores the run that a killed program has left set aside in `root`, unless that run has been replaced.
fn recover_interrupted(root: &Path) -> Result<(), FolderError> {
    let previous = root.join(PREVIOUS);
    if fs::symlink_metadata(&previous).is_err() {
        return Ok(());
    }
    let folder = RunFolder::open(root);
    let replaced = if missing_required_file(&previous).is_none() {
        // A run that has ended had begun.
        folder.summary().exists() || folder.tape().join("seal.json").exists()
    } else {
        // The parts of one run have different names.
        list_entries(&previous)?.iter().any(|name| root.join(name).exists())
    };
    if replaced { Ok(()) } else { restore_previous(root) }
}

/// Rejects a folder that is not a run folder, or contains an entry that no run has created.
fn validate_run_folder(root: &Path) -> Result<(), FolderError> {
    let refuse = |reason: String| FolderError::NotARun {
        path: root.to_owned(),
        reason,
    };
    if let Some(missing) = missing_required_file(root) {
        return Err(refuse(format!(
            "it is not the folder of a run, which has a file `{missing}`"
        )));
    }
    let outputs = Outputs::read(root);
    for entry in fs::read_dir(root).map_err(io_error(root, "list the folder"))? {
        let name = entry.map_err(io_error(root, "list the folder"))?.file_name();
        let foreign = match name.to_str() {
            Some(name) if is_own(name) => None,
            Some(name) => outputs.foreign_reason(root, name),
            None => Some(format!("`{}` in it does not belong to a run", name.display())),
        };
        if let Some(reason) = foreign {
            return Err(refuse(reason));
        }
    }
    Ok(())
}

impl RunFolder {
    /// Creates the folder `root` with its parents, accessible only to the user, or takes an empty one unchanged; rejects one that is not
    /// empty.
    pub fn create(root: &Path) -> Result<RunFolder, FolderError> {
        Reservation::reserve(root, false).map(Reservation::into_folder)
    }

    /// Creates `<runs>/<scenario>-<UTC time>-<n>` with the first n from 1 that is free. Runs that start in the same instant get different
    /// folders: a folder belongs to the run that creates it.
    pub fn create_default(runs: &Path, scenario: &str) -> Result<Reservation, FolderError> {
        let outermost = outermost_missing(runs);
        private_dir_builder()
            .recursive(true)
            .create(runs)
            .map_err(io_error(runs, "create the folder"))?;
        let safe_name: String = scenario
            .chars()
            .map(|c| if c.is_ascii_alphanumeric() || c == '_' { c } else { '-' })
            .collect();
        let safe_name = if safe_name.is_empty() { "run" } else { &safe_name };
        let time = utc_compact(SystemTime::now());
        let mut n = 1_u32;
        loop {
            let root = runs.join(format!("{safe_name}-{time}-{n}"));
            match private_dir_builder().create(&root) {
                Ok(()) => {
                    return Reservation::for_created_folder(&root, Some(outermost.unwrap_or_else(|| root.clone())));
                }
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => n += 1,
                Err(error) => return Err(io_error(&root, "create the folder")(error)),
            }
        }
    }
}

#[cfg(test)]
mod tests;
