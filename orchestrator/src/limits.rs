//! What the system grants this process and those it starts.

use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

/// A file that would get larger than `ulimit -f` allows is an error of the write, as on a full disk, and no reason to die of SIGXFSZ.
/// Programs that are started inherit that.
pub fn refuse_large_files() {
    // SAFETY: to ignore a signal installs no handler.
    unsafe { libc::signal(libc::SIGXFSZ, libc::SIG_IGN) };
}

/// Asks for as many open files as may be asked for. Each service in shared memory is a few of them, some forty for each participant,
/// and the usual limit of 1024 would end a run of thirty.
pub fn raise_open_files() {
    let Rlimit { maximum, .. } = getrlimit(Resource::Nofile);
    let all = Rlimit {
        current: maximum,
        maximum,
    };
    // A wish: what does not fit is named when it is opened.
    let _ = setrlimit(Resource::Nofile, all);
}
