//! Resource limits of this process and its children.

use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

/// Makes exceeding `ulimit -f` a write error, as on a full disk, instead of a fatal SIGXFSZ. Children inherit this.
pub fn refuse_large_files() {
    // SAFETY: ignoring a signal installs no handler.
    unsafe { libc::signal(libc::SIGXFSZ, libc::SIG_IGN) };
}

/// Raises the limit of open files to the maximum. Each service in shared memory needs a few of them, about forty for each
/// participant, and the usual limit of 1024 would end a run of thirty participants.
pub fn raise_open_files() {
    let Rlimit { maximum, .. } = getrlimit(Resource::Nofile);
    let all = Rlimit {
        current: maximum,
        maximum,
    };
    // Best effort: a limit that is too low is reported when a file is opened.
    let _ = setrlimit(Resource::Nofile, all);
}
