//! Detection of `exit` in foreign code: a library that calls `exit` would end the process, and with `exit(0)` as if it had succeeded.
//! This is reported, and the process fails.
//!
//! Only the thread that makes the call is guarded. `_exit`, and `exit` in a thread that the library has started, are not detected.

use std::cell::Cell;
use std::io::Write;
use std::ptr::null;
use std::sync::{Arc, Once};

/// What is called, for the message.
#[derive(Debug)]
struct Callee {
    name: String,
    message: fn(&str) -> String,
}

// A plain value: a value with a destructor no longer exists when the handler runs.
thread_local! {
    /// The callee whose function this thread is executing, and the function; a null pointer where there is none.
    static CURRENT_CALL: Cell<(*const Callee, &'static str)> = const { Cell::new((null(), "")) };
}

/// Guards the calls of the foreign code of one participant.
#[derive(Debug, Clone)]
pub struct Guard(Arc<Callee>);

impl Guard {
    /// A guard for the participant `name`; `message` gives the message for a function that called `exit`, which follows the name.
    pub fn new(name: &str, message: fn(&str) -> String) -> Guard {
        static REGISTER_HANDLER: Once = Once::new();
        REGISTER_HANDLER.call_once(|| {
            // SAFETY: the handler is a function of this program or library, and is removed with it. If it cannot be registered, only the
            // message is lost.
            unsafe { libc::atexit(report_exit) };
        });
        let name = name.to_owned();
        Guard(Arc::new(Callee { name, message }))
    }

    /// Makes a call of foreign code, in its function `function`.
    #[inline]
    pub fn call<T>(&self, function: &'static str, call: impl FnOnce() -> T) -> T {
        // The callee lives as long as `self`, which is borrowed until the previous value is back: also when the call panics.
        let _restore = RestoreCall(CURRENT_CALL.replace((Arc::as_ptr(&self.0), function)));
        call()
    }
}

/// Puts the previous value back.
struct RestoreCall((*const Callee, &'static str));

impl Drop for RestoreCall {
    #[inline]
    fn drop(&mut self) {
        CURRENT_CALL.set(self.0);
    }
}

extern "C" fn report_exit() {
    let (callee, function) = CURRENT_CALL.get();
    // SAFETY: the pointer is null, or the frame of `Guard::call` is below this one on the stack, and its callee lives.
    let Some(callee) = (unsafe { callee.as_ref() }) else {
        return;
    };
    let _ = writeln!(std::io::stderr(), "{}: {}", callee.name, (callee.message)(function));
    // SAFETY: ends the process at once, with a failure in place of the requested success.
    unsafe { libc::_exit(1) };
}
