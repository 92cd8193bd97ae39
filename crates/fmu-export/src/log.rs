//! The importer's log: the callbacks of both versions of the standard.

use std::ffi::{CStr, CString, c_char, c_int, c_void};

use crate::refusal::Status;

/// `fmi2CallbackLogger`: formats as printf does.
pub type LoggerFmi2 = unsafe extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char, ...);
/// `fmi3LogMessageCallback`.
pub type LoggerFmi3 = unsafe extern "C" fn(*mut c_void, c_int, *const c_char, *const c_char);

/// Log lines of the FMU's participants.
pub const MESSAGES: &str = "logMessages";

/// The log categories.
pub const CATEGORIES: [&str; 3] = [MESSAGES, "logStatusDiscard", "logStatusError"];

/// The destination of messages.
pub enum Log {
    /// FMI 2.0, with the importer's environment and the instance's name.
    Fmi2(Option<LoggerFmi2>, *mut c_void, CString),
    /// FMI 3.0.
    Fmi3(Option<LoggerFmi3>, *mut c_void),
}

fn category(status: Status) -> &'static CStr {
    match status {
        Status::Ok => c"logMessages",
        Status::Discard => c"logStatusDiscard",
        Status::Error => c"logStatusError",
    }
}

impl Log {
    /// Passes on a message.
    pub fn write(&self, status: Status, text: &str) {
        // A zero byte would terminate it.
        let text = text.replace('\0', " ");
        match self {
            Log::Fmi2(Some(write), environment, name) => {
                // The text is passed as the format itself: some importers print the format unchanged.
                let format = CString::new(text.replace('%', "%%")).unwrap_or_default();
                // SAFETY: the importer's function has the type of the standard; all texts outlive the call.
                unsafe {
                    write(
                        *environment,
                        name.as_ptr(),
                        status as c_int,
                        category(status).as_ptr(),
                        format.as_ptr(),
                    )
                }
            }
            Log::Fmi3(Some(write), environment) => {
                let text = CString::new(text).unwrap_or_default();
                // SAFETY: as above.
                unsafe { write(*environment, status as c_int, category(status).as_ptr(), text.as_ptr()) }
            }
            Log::Fmi2(None, ..) | Log::Fmi3(None, _) => {}
        }
    }
}
