//! Calls of foreign code, guarded against what it may do to the process that it shares with others.
//!
//! A library that calls `exit` would end the process, and with `exit(0)` as if it had succeeded. This is reported, and the process fails.
//! A library that changes the [floating-point modes](FloatModes) would change the numbers of others: each callee has modes of its own.
//! Before a library is loaded, [`check_helpers`] finds out whether it would share its own helper libraries with another one.
//!
//! Only the thread that makes the call is guarded. `_exit`, and `exit` in a thread that the library has started, are not detected.

mod elf;
mod float_modes;
mod helpers;

use std::cell::Cell;
use std::io::Write;
use std::ptr::null;
use std::sync::{Arc, Once};

pub use float_modes::{FloatModes, with_default_modes};
pub use helpers::{HelperConflict, check_helpers};

use float_modes::OwnModes;

/// What is called.
#[derive(Debug)]
struct Callee {
    name: String,
    /// The message for a function that called `exit`; none where it may.
    message: Option<fn(&str) -> String>,
    modes: OwnModes,
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
        Guard::of(name, Some(message))
    }

    /// A guard for foreign code that may call `exit`, because nothing else depends on the process. It has floating-point modes of its own
    /// nevertheless, so that its numbers, and those of its host, are the same as in any other process.
    pub fn allowing_exit() -> Guard {
        Guard::of("", None)
    }

    fn of(name: &str, message: Option<fn(&str) -> String>) -> Guard {
        Guard(Arc::new(Callee {
            name: name.to_owned(),
            message,
            modes: OwnModes::new(),
        }))
    }

    /// The floating-point modes with which the next call begins: those that the last one left, at first the default ones.
    pub fn modes(&self) -> FloatModes {
        self.0.modes.get()
    }

    /// Lets the next call begin with these floating-point modes.
    pub fn set_modes(&self, modes: FloatModes) {
        self.0.modes.set(modes);
    }

    /// Makes a call of foreign code, in its function `function`, with the callee's floating-point modes: `call` itself computes no
    /// floating-point numbers.
    #[inline]
    pub fn call<T>(&self, function: &'static str, call: impl FnOnce() -> T) -> T {
        // The callee lives as long as `self`, which is borrowed until the previous value is back: also when the call panics.
        let _restore = RestoreCall(CURRENT_CALL.replace((Arc::as_ptr(&self.0), function)));
        let _modes = self.0.modes.enter();
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
    let Some((name, message)) = (unsafe { callee.as_ref() }).and_then(|callee| Some((&callee.name, callee.message?)))
    else {
        return;
    };
    let _ = writeln!(std::io::stderr(), "{name}: {}", message(function));
    // SAFETY: ends the process at once, with a failure in place of the requested success.
    unsafe { libc::_exit(1) };
}
