//! What an FMU writes into its log.

use std::collections::{BTreeMap, VecDeque};
use std::ffi::{CStr, c_char, c_int, c_void};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// How many of the newest messages are kept.
const KEPT: usize = 8;

/// How many messages of one step are told.
const TOLD: usize = 64;

/// What one instance writes into.
#[derive(Debug, Default)]
struct Shared {
    /// Whether something is untold: asked at every step.
    fresh: AtomicBool,
    written: Mutex<Written>,
}

/// What one instance has written.
#[derive(Debug, Default)]
struct Written {
    newest: VecDeque<String>,
    /// What was not told yet, and how many more there were than are told.
    untold: Vec<String>,
    more: usize,
}

/// The environment pointers of living instances. They are numbers: an FMU that mixes them up writes into no memory of ours.
static LOGS: Mutex<BTreeMap<usize, Arc<Shared>>> = Mutex::new(BTreeMap::new());
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
    /// What an instance is given as its environment.
    pub(super) fn environment(&self) -> *mut c_void {
        std::ptr::without_provenance_mut(self.number)
    }

    /// The messages as a continuation of a sentence, and forgets them.
    pub fn take(&self) -> String {
        let lines: Vec<String> = locked(&self.shared.written).newest.drain(..).collect();
        if lines.is_empty() {
            return String::new();
        }
        format!("; its log: {}", lines.join(" | "))
    }

    /// What was written since this was asked for last, for the participant's own log. Nothing where it went to standard error.
    pub fn tell(&self, mut say: impl FnMut(&str)) {
        if !self.shared.fresh.load(Ordering::Relaxed) {
            return;
        }
        let (lines, more) = {
            let mut written = locked(&self.shared.written);
            self.shared.fresh.store(false, Ordering::Relaxed);
            (std::mem::take(&mut written.untold), std::mem::take(&mut written.more))
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
    let told = format!("FMU, {category}: {line}");
    let aloud = ALOUD.load(Ordering::Relaxed);
    if aloud {
        eprintln!("{told}");
    }
    let shared = locked(&LOGS).get(&environment.addr()).cloned();
    if let Some(shared) = shared {
        let mut written = locked(&shared.written);
        if written.newest.len() == KEPT {
            written.newest.pop_front();
        }
        written.newest.push_back(line);
        if aloud {
            return;
        }
        match written.untold.len() < TOLD {
            true => written.untold.push(told),
            false => written.more += 1,
        }
        shared.fresh.store(true, Ordering::Relaxed);
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
