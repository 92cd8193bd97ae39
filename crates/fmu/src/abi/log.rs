//! Log messages of FMUs: the callback that formats, limits and collects them.

use std::collections::{BTreeMap, VecDeque};
use std::ffi::{CStr, c_char, c_int, c_void};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Number of newest messages that are retained.
const NEWEST_MAX: usize = 8;

/// Maximum number of messages of one step that are reported.
const REPORTED_MAX: usize = 64;

/// The log of one instance.
#[derive(Debug, Default)]
struct Shared {
    /// Whether there are unreported messages: checked at every step.
    has_unreported: AtomicBool,
    messages: Mutex<LogMessages>,
}

/// The messages of one instance.
#[derive(Debug, Default)]
struct LogMessages {
    newest: VecDeque<String>,
    /// The unreported messages, and the number of further ones beyond the maximum.
    unreported: Vec<String>,
    omitted: usize,
}

/// The environment pointers of living instances. They are numbers: an FMU that mixes them up cannot write to our memory.
static LOGS: Mutex<BTreeMap<usize, Arc<Shared>>> = Mutex::new(BTreeMap::new());
static NEXT: AtomicUsize = AtomicUsize::new(1);
static TO_STANDARD_ERROR: AtomicBool = AtomicBool::new(false);

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// From now on, warnings and errors that FMUs of this process log also go to standard error: for a program that is a single
/// participant.
pub fn to_standard_error() {
    TO_STANDARD_ERROR.store(true, Ordering::Relaxed);
}

/// The warnings and errors of one instance.
#[derive(Debug)]
pub struct Log {
    number: usize,
    shared: Arc<Shared>,
}

impl Default for Log {
    fn default() -> Log {
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let shared = Arc::new(Shared::default());
        locked(&LOGS).insert(number, shared.clone());
        Log { number, shared }
    }
}

impl Drop for Log {
    fn drop(&mut self) {
        locked(&LOGS).remove(&self.number);
    }
}

impl Log {
    /// The environment pointer that is passed to an instance.
    pub(super) fn environment(&self) -> *mut c_void {
        std::ptr::without_provenance_mut(self.number)
    }

    /// Returns the messages as a continuation of a sentence, and clears them.
    pub fn take(&self) -> String {
        let lines: Vec<String> = locked(&self.shared.messages).newest.drain(..).collect();
        if lines.is_empty() {
            return String::new();
        }
        format!("; its log: {}", lines.join(" | "))
    }

    /// The messages since the last call, for the participant's own log. Empty where they went to standard error.
    pub fn report_new(&self, mut say: impl FnMut(&str)) {
        if !self.shared.has_unreported.load(Ordering::Relaxed) {
            return;
        }
        let (lines, more) = {
            let mut messages = locked(&self.shared.messages);
            self.shared.has_unreported.store(false, Ordering::Relaxed);
            (
                std::mem::take(&mut messages.unreported),
                std::mem::take(&mut messages.omitted),
            )
        };
        lines.iter().for_each(|line| say(line));
        if more > 0 {
            say(&format!("FMU: {more} more messages"));
        }
    }
}

fn record(environment: *mut c_void, status: i32, category: &str, text: &str) {
    if status <= 0 {
        return;
    }
    let line = text.trim().to_owned();
    let message = format!("FMU, {category}: {line}");
    let aloud = TO_STANDARD_ERROR.load(Ordering::Relaxed);
    if aloud {
        eprintln!("{message}");
    }
    let shared = locked(&LOGS).get(&environment.addr()).cloned();
    if let Some(shared) = shared {
        let mut messages = locked(&shared.messages);
        if messages.newest.len() == NEWEST_MAX {
            messages.newest.pop_front();
        }
        messages.newest.push_back(line);
        if aloud {
            return;
        }
        match messages.unreported.len() < REPORTED_MAX {
            true => messages.unreported.push(message),
            false => messages.omitted += 1,
        }
        shared.has_unreported.store(true, Ordering::Relaxed);
    }
}

/// # Safety
/// `text` is null or zero-terminated.
unsafe fn text_of(text: *const c_char) -> String {
    if text.is_null() {
        return String::new();
    }
    // SAFETY: see above.
    unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned()
}

/// The formatted message of an FMI 2.0 FMU, from `logger.c`.
#[unsafe(no_mangle)]
unsafe extern "C" fn escapement_fmu_log(
    environment: *mut c_void,
    status: c_int,
    category: *const c_char,
    text: *const c_char,
) {
    // SAFETY: according to the standard both are texts; the logger formats the second.
    let (category, text) = unsafe { (text_of(category), text_of(text)) };
    record(environment, status, &category, &text);
}

/// `fmi3LogMessageCallback`.
pub(super) unsafe extern "C" fn log_message(
    environment: *mut c_void,
    status: c_int,
    category: *const c_char,
    text: *const c_char,
) {
    // SAFETY: according to the standard both are texts.
    let (category, text) = unsafe { (text_of(category), text_of(text)) };
    record(environment, status, &category, &text);
}
