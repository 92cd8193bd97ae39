//! Detection of `exit` in foreign code: a participant that calls `exit` would end the process with success. This is reported, and the
//! process fails.

use std::cell::Cell;
use std::io::Write;
use std::sync::Once;

/// The longest name of a participant.
const NAME_MAX: usize = 64;

// Both are plain values: a value with a destructor no longer exists when the handler runs.
thread_local! {
    /// The participant's function that this thread is executing.
    static INSIDE: Cell<Option<&'static str>> = const { Cell::new(None) };
    /// The participant's name, and its length.
    static WHO: Cell<([u8; NAME_MAX], usize)> = const { Cell::new(([0; NAME_MAX], 0)) };
}

/// A guard: while it exists, the thread is executing a function of a participant.
pub(crate) struct Inside(Option<&'static str>);

/// Enters the function `function` of the participant `name`.
pub(crate) fn enter(name: &str, function: &'static str) -> Inside {
    static WATCH: Once = Once::new();
    WATCH.call_once(|| {
        // SAFETY: the handler is a function of the program. If it cannot be registered, only the message is lost.
        unsafe { libc::atexit(ended) };
    });
    let mut who = [0; NAME_MAX];
    let length = name.len().min(NAME_MAX);
    who[..length].copy_from_slice(&name.as_bytes()[..length]);
    WHO.set((who, length));
    Inside(INSIDE.replace(Some(function)))
}

impl Drop for Inside {
    fn drop(&mut self) {
        INSIDE.set(self.0);
    }
}

extern "C" fn ended() {
    let Some(function) = INSIDE.get() else {
        return;
    };
    let (who, length) = WHO.get();
    let who = String::from_utf8_lossy(&who[..length]).into_owned();
    let _ = writeln!(
        std::io::stderr(),
        "{who}: its function `{function}` called exit(): a participant ends with its run; to give up, return escapement_fail(…)"
    );
    // SAFETY: ends the process at once, with a failure in place of the requested success.
    unsafe { libc::_exit(1) };
}
