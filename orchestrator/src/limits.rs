//! What the system grants this process and those it starts.

use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

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
