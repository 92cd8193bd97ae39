//! The export as a C function: the program calls its own library, so that FMUs are exported by the code that runs in them.

use std::ffi::{CString, c_char, c_int, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use engine::Catalogue;

use crate::call::text;
use crate::export::{Request, export};

/// Callback for output: `context`, whether the text is an error (1) or not (0), and the text, which is valid during the call.
pub type Say = unsafe extern "C" fn(*mut c_void, c_int, *const c_char);

/// Exports what `request`, a TOML document, specifies. Returns the exit code.
///
/// # Safety
/// `request` is a text; `say` may be called with `context`.
pub unsafe fn export_by(
    catalogue: fn() -> Arc<Catalogue>,
    request: *const c_char,
    context: *mut c_void,
    say: Say,
) -> c_int {
    // SAFETY: the caller guarantees that the request ends with a zero byte.
    let request = unsafe { text(request) };
    let done = catch_unwind(AssertUnwindSafe(|| match toml::from_str::<Request>(&request) {
        Ok(request) => match export(&catalogue(), &request) {
            Ok(text) => (0, text),
            Err(error) => (if error.refused { 2 } else { 1 }, error.text),
        },
        Err(error) => (1, format!("the request cannot be read: {}", error.message())),
    }));
    let (code, text) = done.unwrap_or_else(|_| (1, "the export panicked".to_owned()));
    let text = CString::new(text.replace('\0', " ")).unwrap_or_default();
    // SAFETY: the caller guarantees that `say` may be called with `context`; the text lives until it returns.
    unsafe { say(context, c_int::from(code != 0), text.as_ptr()) };
    code
}
