//! The part of shared memory that belongs to one run.

use std::ffi::OsStr;
use std::fmt;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path as StdPath, PathBuf};
use std::str::FromStr;

use iceoryx2::prelude::*;
use iceoryx2::service::builder::Builder;

use super::ipc::Ipc;

/// How many connections whose other end has gone a receiving end keeps, until what they hold is read or returned. At most one of them has
/// memory that is in use, that of a ring; with two, iceoryx2 never has to give up that one.
const EXPIRED_CONNECTIONS_MAX: usize = 2;

/// Why a run's part of shared memory cannot be set up.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum DomainError {
    /// The text is not a domain's address.
    #[error("`{0}` is not the address of a run: it reads PREFIX@FOLDER")]
    Address(String),
    /// There is no run at the address.
    #[error("there is no such run: {0}: it is over, or the address is wrong (the orchestrator sets it for each run)")]
    NoRun(Address),
    /// The run at the address has no participant of this name.
    #[error("there is no such run or participant: `{name}` at {address}")]
    NoParticipant {
        /// The address.
        address: Address,
        /// The name.
        name: String,
    },
    /// Another process is this participant.
    #[error("`{name}` is already in this run, {address}: a participant is one process")]
    NameInUse {
        /// The address.
        address: Address,
        /// The participant.
        name: String,
    },
    /// The path is too long for shared memory.
    #[error("the folder `{}` has a name that shared memory cannot use: it is too long or has other characters than letters, digits, `/`, `_` and `-`", .0.display())]
    Folder(PathBuf),
    /// iceoryx2 returned an error.
    #[error("shared memory of the run under `{}`: {what} failed: {reason}", .folder.display())]
    Service {
        /// The run's folder for the files that are not shared memory.
        folder: PathBuf,
        /// The operation.
        what: String,
        /// The message of iceoryx2.
        reason: String,
    },
}

/// The address of a run in shared memory: an unguessable prefix of every name, and a folder that only the user can enter.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Address {
    /// The prefix of every shared memory object of the run.
    pub prefix: String,
    /// The folder of the files that are not shared memory.
    pub folder: PathBuf,
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}@{}", self.prefix, self.folder.display())
    }
}

impl FromStr for Address {
    type Err = DomainError;
    fn from_str(text: &str) -> Result<Address, DomainError> {
        let (prefix, folder) = text
            .split_once('@')
            .ok_or_else(|| DomainError::Address(text.to_owned()))?;
        let plain = |c: char| c.is_ascii_alphanumeric() || c == '_';
        if prefix.is_empty() || !prefix.chars().all(plain) || !StdPath::new(folder).is_absolute() {
            return Err(DomainError::Address(text.to_owned()));
        }
        Ok(Address {
            prefix: prefix.to_owned(),
            folder: PathBuf::from(folder),
        })
    }
}

/// A process's access to a run's part of shared memory.
pub struct Domain {
    address: Address,
    node: Node<Ipc>,
}

/// Removes all permissions of other users from the run's objects in shared memory. iceoryx2 restricts its objects to the user, except for
/// one counter that the first node of a prefix creates, which all users may write whatever the umask is.
fn restrict_permissions(prefix: &str) -> std::io::Result<()> {
    use std::os::unix::fs::{MetadataExt, PermissionsExt};
    for entry in std::fs::read_dir("/dev/shm")? {
        let entry = entry?;
        if !entry.file_name().as_encoded_bytes().starts_with(prefix.as_bytes()) {
            continue;
        }
        // An object that has been removed in the meantime needs no change.
        let Ok(about) = entry.metadata() else { continue };
        if about.mode() & 0o077 != 0 {
            std::fs::set_permissions(entry.path(), std::fs::Permissions::from_mode(about.mode() & 0o700))?;
        }
    }
    Ok(())
}

/// Which resource of the machine is exhausted, if one is: iceoryx2 reports that as a corrupted service or an internal failure.
fn exhausted_resource() -> String {
    use rustix::io::Errno;
    match std::fs::File::open("/dev/null")
        .err()
        .and_then(|error| Errno::from_io_error(&error))
    {
        Some(Errno::MFILE) => {
            let most = rustix::process::getrlimit(rustix::process::Resource::Nofile).current;
            let most = most.map_or("no more".to_owned(), |most| most.to_string());
            return format!("; this process may open {most} files at a time, and has: raise the limit (ulimit -n)");
        }
        Some(Errno::NFILE) => {
            return "; the system has as many open files as it allows: raise fs.file-max".into();
        }
        _ => {}
    }
    let full = rustix::fs::statvfs("/dev/shm").is_ok_and(|about| about.f_bavail == 0 || about.f_favail == 0);
    if full {
        return "; /dev/shm is full: make it larger, such as with docker run --shm-size".into();
    }
    String::new()
}

/// The configuration of iceoryx2 for the domain at `address`.
fn configuration(address: &Address) -> Result<Config, DomainError> {
    let folder = |_| DomainError::Folder(address.folder.clone());
    let mut config = Config::default();
    config.global.prefix = FileName::new(address.prefix.as_bytes()).map_err(folder)?;
    let bytes = address.folder.as_os_str().as_encoded_bytes();
    config.global.set_root_path(&Path::new(bytes).map_err(folder)?);
    // Only the orchestrator finds and reports dead processes; no other process cleans up in the meantime.
    config.global.node.cleanup_dead_nodes_on_creation = false;
    config.global.node.cleanup_dead_nodes_on_destruction = false;
    config.global.service.cleanup_dead_nodes_on_open = false;
    // Each receiving end allocates and writes a slot for every one of these, 128 unless specified.
    config.defaults.publish_subscribe.subscriber_expired_connection_buffer = EXPIRED_CONNECTIONS_MAX;
    config.defaults.request_response.client_expired_connection_buffer = EXPIRED_CONNECTIONS_MAX;
    config.defaults.request_response.server_expired_connection_buffer = EXPIRED_CONNECTIONS_MAX;
    Ok(config)
}

impl Domain {
    /// Enters the domain of a run under way at `address`, as the participant `process`. Nothing is created where there is no run: a node
    /// would create its folders, and no process would remove them.
    pub fn join(address: Address, process: &str) -> Result<Domain, DomainError> {
        // The orchestrator has a node and services before it starts a participant.
        let global = configuration(&address)?.global;
        let required_folders = [global.node_dir(), global.service_dir()];
        let exists = |folder: &Path| StdPath::new(OsStr::from_bytes(folder.as_bytes())).is_dir();
        match required_folders.iter().all(exists) {
            true => Domain::enter(address, process),
            false => Err(DomainError::NoRun(address)),
        }
    }

    /// Enters the domain at `address` under the name `process`.
    pub fn enter(address: Address, process: &str) -> Result<Domain, DomainError> {
        // Messages of iceoryx2 reach the user as the errors of this crate.
        set_log_level(LogLevel::Fatal);
        let config = configuration(&address)?;
        let failed = |what: &str, reason: String| DomainError::Service {
            folder: address.folder.clone(),
            what: what.to_owned(),
            reason: reason + &exhausted_resource(),
        };
        let name = NodeName::new(process).map_err(|error| failed("naming the process", format!("{error:?}")))?;
        let node = NodeBuilder::new()
            .name(&name)
            .config(&config)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<Ipc>()
            .map_err(|error| failed("joining", format!("{error:?}")))?;
        restrict_permissions(&address.prefix).map_err(|error| failed("shutting others out", error.to_string()))?;
        Ok(Domain { address, node })
    }

    /// The address that is passed to participants.
    pub fn address(&self) -> &Address {
        &self.address
    }

    pub(super) fn service(&self, name: &str) -> Result<Builder<Ipc>, DomainError> {
        let name = ServiceName::new(name).map_err(|error| self.failed(name, error))?;
        Ok(self.node.service_builder(&name))
    }

    pub(super) fn failed(&self, what: impl fmt::Display, error: impl fmt::Debug) -> DomainError {
        DomainError::Service {
            folder: self.address.folder.clone(),
            what: what.to_string(),
            reason: format!("{error:?}{}", exhausted_resource()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::status::{StatusService, StatusWriter};
    use super::super::test_domain::TestDomain;
    use super::*;

    #[test]
    fn join_of_missing_run_creates_nothing() {
        let folder = StdPath::new("/dev/shm").join(format!("gone_{}", std::process::id()));
        let address = Address {
            prefix: format!("gone_{}_", std::process::id()),
            folder: folder.clone(),
        };
        let error_text = Domain::join(address.clone(), "left")
            .err()
            .map(|error| error.to_string());
        assert!(error_text.is_some_and(|words| words.starts_with(&format!("there is no such run: {address}"))));
        assert!(!folder.exists());
    }

    #[test]
    fn domain_rejects_unknown_names_and_second_process() {
        let test = TestDomain::new();
        let _service = StatusService::create(&test.domain, "left", 2).unwrap();
        let domain = Domain::join(test.domain.address().clone(), "left").unwrap();
        let error_text = |name: &str| StatusWriter::open(&domain, name).err().map(|error| error.to_string());
        assert!(
            error_text("lift")
                .is_some_and(|words| words.starts_with("there is no such run or participant: `lift` at "))
        );
        let _first = StatusWriter::open(&domain, "left").unwrap();
        assert!(error_text("left").is_some_and(|words| words.starts_with("`left` is already in this run")));
    }
}
