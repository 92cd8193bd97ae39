//! What an FMU writes into its log.

use std::collections::{BTreeMap, VecDeque};
use std::ffi::{CStr, c_char, c_int, c_void};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// How many of the newest messages are kept.
const KEPT: usize = 8;

/// The environment pointers of living instances. They are numbers: an FMU that mixes them up writes into no memory of ours.
static LOGS: Mutex<BTreeMap<usize, Arc<Mutex<VecDeque<String>>>>> = Mutex::new(BTreeMap::new());
static NEXT: AtomicUsize = AtomicUsize::new(1);
static ALOUD: AtomicBool = AtomicBool::new(false);

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// From now on everything that FMUs of this process write into their logs, warnings or worse, goes to standard error too: for a program
/// that is one participant.
pub fn to_standard_error() {
    ALOUD.store(true, Ordering::Relaxed);
}

/// The newest warnings and errors of one instance.
#[derive(Debug)]
pub struct Log {
    number: usize,
    lines: Arc<Mutex<VecDeque<String>>>,
}

impl Default for Log {
    fn default() -> Log {
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let lines = Arc::new(Mutex::new(VecDeque::new()));
        locked(&LOGS).insert(number, lines.clone());
        Log { number, lines }
    }
}

impl Drop for Log {
    fn drop(&mut self) {
        locked(&LOGS).remove(&self.number);
    }
}

impl Log {
    /// What an instance is given as its environment.
    pub(super) fn environment(&self) -> *mut c_void {
        std::ptr::without_provenance_mut(self.number)
    }

    /// The messages as a continuation of a sentence, and forgets them.
    pub fn take(&self) -> String {
        let lines: Vec<String> = locked(&self.lines).drain(..).collect();
        if lines.is_empty() {
            return String::new();
        }
        format!("; its log: {}", lines.join(" | "))
    }
}

fn record(environment: *mut c_void, status: i32, category: &str, text: &str) {
    if status <= 0 {
        return;
    }
    let line = text.trim().to_owned();
    if ALOUD.load(Ordering::Relaxed) {
        eprintln!("FMU, {category}: {line}");
    }
    let lines = locked(&LOGS).get(&environment.addr()).cloned();
    if let Some(lines) = lines {
        let mut lines = locked(&lines);
        if lines.len() == KEPT {
            lines.pop_front();
        }
        lines.push_back(line);
    }
}

/// # Safety
/// `text` is null or ends with zero.
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
    // SAFETY: the standard says that both are texts; the logger formats the second.
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
    // SAFETY: the standard says that both are texts.
    let (category, text) = unsafe { (text_of(category), text_of(text)) };
    record(environment, status, &category, &text);
}
