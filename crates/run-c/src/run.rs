//! The C functions of a run: start, advance, read, set, save, restore and end.

use std::ffi::{CStr, CString, c_char, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Arc;

use engine::Catalogue;
use engine::campaign::Figures;
use engine::run::{self, Ending, Record};
use engine::scenario::Scenario;
use fmu_export::exact;

const OK: i32 = 0;
const FAILED: i32 = 1;
/// Bytes of a digest as text: with a terminating zero byte and spare bytes.
const DIGEST: usize = 72;

/// `escapement_run_options`.
#[repr(C)]
pub struct Options {
    /// Of this struct.
    pub size: u32,
    /// What is kept: memory, nothing, a folder.
    pub record: u32,
    /// The folder, or null.
    pub folder: *const c_char,
    /// Changes of the scenario.
    pub changes: *const *const c_char,
    /// How many there are.
    pub change_count: u32,
    /// Zero.
    pub reserved: u32,
}

/// `escapement_run_sample`.
#[repr(C)]
pub struct Sample {
    /// Of this struct.
    pub size: u32,
    /// Zero.
    pub reserved: u32,
    /// From 0.
    pub index: u64,
    /// s.
    pub stamp: f64,
    /// Owned by the run.
    pub bytes: *const c_void,
    /// How many.
    pub byte_count: u64,
}

/// `escapement_run_outcome`.
#[repr(C)]
pub struct Outcome {
    /// Of this struct.
    pub size: u32,
    /// 1 at the end of the scenario.
    pub complete: u32,
    /// 1 when all criteria are met.
    pub met: u32,
    /// Zero.
    pub reserved: u32,
    /// s.
    pub simulated: f64,
    /// Hexadecimal.
    pub digest: [c_char; DIGEST],
}

/// `escapement_run`.
#[derive(Default)]
pub struct Run {
    pub(crate) run: Option<run::Run>,
    error: CString,
    /// The log of the participant that was last asked for.
    pub(crate) log: CString,
    /// The sample that was last read.
    sample: Option<run::Sample>,
}

/// `escapement_run_checkpoint`.
pub struct Checkpoint(run::Checkpoint);

/// A string of the caller.
///
/// # Safety
/// `at` is null, or ends with a zero byte.
pub(crate) unsafe fn text<'a>(at: *const c_char, what: &str) -> Result<&'a str, String> {
    if at.is_null() {
        return Err(format!("{what} is NULL"));
    }
    // SAFETY: it is not null, so the caller guarantees a zero byte at its end.
    let text = unsafe { CStr::from_ptr(at) };
    text.to_str().map_err(|_| format!("{what} is not UTF-8"))
}

/// Calls `work` with the run behind `pointer`.
///
/// # Safety
/// `pointer` is null, or a run that was not freed.
pub(crate) unsafe fn with_run(pointer: *mut Run, work: impl FnOnce(&mut Run) -> Result<(), String>) -> i32 {
    // SAFETY: the pointer is null or a run that was not freed; only one thread calls a run, so nothing else refers to it.
    let Some(own) = (unsafe { pointer.as_mut() }) else {
        return FAILED;
    };
    own.sample = None;
    let done = catch_unwind(AssertUnwindSafe(|| work(own))).unwrap_or_else(|_| Err("it panicked".to_owned()));
    match done {
        Ok(()) => OK,
        Err(reason) => {
            own.error = CString::new(reason.replace('\0', " ")).unwrap_or_default();
            FAILED
        }
    }
}

/// Calls `work` with the run behind `pointer`, which must have been started and not ended.
///
/// # Safety
/// `pointer` is null, or a run that was not freed.
pub(crate) unsafe fn with_active_run(pointer: *mut Run, work: impl FnOnce(&mut run::Run) -> Result<(), String>) -> i32 {
    let work = |own: &mut Run| {
        let run = own.run.as_mut();
        work(run.ok_or("there is no run any more: it was ended, or could not be started")?)
    };
    // SAFETY: the caller guarantees that `pointer` is null or a run that was not freed.
    unsafe { with_run(pointer, work) }
}

pub(crate) fn error_text(failure: impl ToString) -> String {
    failure.to_string()
}

/// `escapement_run_start`.
///
/// # Safety
/// `scenario` is null, or ends with a zero byte; `options` is null, or begins with its size, and its texts end with
/// a zero byte; `place` is null, or can be written.
pub unsafe fn start(
    catalogue: fn() -> Arc<Catalogue>,
    scenario: *const c_char,
    options: *const Options,
    place: *mut *mut Run,
) -> i32 {
    if place.is_null() {
        return FAILED;
    }
    let pointer = Box::into_raw(Box::<Run>::default());
    // SAFETY: it is not null, and the caller guarantees that it can be written.
    unsafe { place.write(pointer) };
    let work = |own: &mut Run| {
        // SAFETY: the name ends with a zero byte, and the options are valid, as the caller guarantees.
        let (file, (options, changes)) =
            unsafe { (text(scenario, "the name of the scenario")?, run_options(options)?) };
        let scenario = Scenario::read(&catalogue(), Path::new(file), &changes).map_err(error_text)?;
        own.run = Some(run::Run::start(&scenario, &options).map_err(error_text)?);
        Ok(())
    };
    // SAFETY: the run was made here.
    unsafe { with_run(pointer, work) }
}

/// The options and changes that the caller's options denote.
///
/// # Safety
/// `options` is null, or begins with its size; its folder and each of its `change_count` changes end with a zero byte.
unsafe fn run_options(options: *const Options) -> Result<(run::Options, Vec<String>), String> {
    let mut chosen = run::Options {
        in_process: true,
        record: Record::Memory,
        no_placement: true,
        ..run::Options::default()
    };
    // SAFETY: the options are null or valid, and do not change during the call.
    let Some(own) = (unsafe { options.as_ref() }) else {
        return Ok((chosen, Vec::new()));
    };
    if (own.size as usize) < size_of::<Options>() {
        return Err(format!(
            "the options say that they have {} bytes, not {}",
            own.size,
            size_of::<Options>()
        ));
    }
    chosen.record = match own.record {
        0 => Record::Memory,
        1 => Record::Nothing,
        2 => Record::Folder,
        other => return Err(format!("the options ask for the record {other}; there are 0, 1 and 2")),
    };
    if !own.folder.is_null() {
        // SAFETY: the folder of valid options ends with a zero byte.
        chosen.out = Some(unsafe { text(own.folder, "the folder") }?.into());
    }
    let mut changes = Vec::new();
    for number in 0..own.change_count as usize {
        if own.changes.is_null() {
            return Err("the list of changes is NULL".to_owned());
        }
        // SAFETY: the list is as long as it says.
        changes.push(unsafe { text(own.changes.add(number).read(), "a change") }?.to_owned());
    }
    Ok((chosen, changes))
}

/// `escapement_run_error`.
///
/// # Safety
/// `pointer` is null, or a run that was not freed.
pub unsafe fn error(pointer: *const Run) -> *const c_char {
    // SAFETY: the pointer is null or a run that was not freed; only one thread calls a run, so nothing else refers to it.
    unsafe { pointer.as_ref() }.map_or(c"there is no run (NULL)".as_ptr(), |own| own.error.as_ptr())
}

/// `escapement_run_now`.
///
/// # Safety
/// `pointer` is null, or a run that was not freed.
pub unsafe fn now(pointer: *const Run) -> f64 {
    // SAFETY: the pointer is null or a run that was not freed; only one thread calls a run, so nothing else refers to it.
    let run = unsafe { pointer.as_ref() }.and_then(|own| own.run.as_ref());
    run.map_or(f64::NAN, run::Run::now_s)
}

/// `escapement_run_is_over`.
///
/// # Safety
/// `pointer` is null, or a run that was not freed.
pub unsafe fn is_over(pointer: *const Run) -> u32 {
    // SAFETY: the pointer is null or a run that was not freed; only one thread calls a run, so nothing else refers to it.
    let run = unsafe { pointer.as_ref() }.and_then(|own| own.run.as_ref());
    u32::from(run.is_none_or(run::Run::is_over))
}

/// `escapement_run_to`.
///
/// # Safety
/// `pointer` is null, or a run that was not freed.
pub unsafe fn to(pointer: *mut Run, time: f64) -> i32 {
    // SAFETY: the caller guarantees that `pointer` is null or a run that was not freed.
    unsafe { with_active_run(pointer, |run| run.run_to(exact(time)?).map_err(error_text)) }
}

/// `escapement_run_step`.
///
/// # Safety
/// `pointer` is null, or a run that was not freed.
pub unsafe fn step(pointer: *mut Run) -> i32 {
    // SAFETY: the caller guarantees that `pointer` is null or a run that was not freed.
    unsafe { with_active_run(pointer, |run| run.step().map_err(error_text)) }
}

/// `escapement_run_newest`.
///
/// # Safety
/// `pointer` is null, or a run that was not freed; `port` is null, or ends with a zero byte; `place` is null, or a
/// sample that begins with its size and has as many bytes.
pub unsafe fn newest(pointer: *mut Run, port: *const c_char, place: *mut Sample) -> i32 {
    let work = |own: &mut Run| {
        // SAFETY: the caller guarantees that each name is null or ends with a zero byte.
        let port = unsafe { text(port, "the name of the output") }?;
        // SAFETY: the caller guarantees that `place` is null or a sample of the size that it states.
        unsafe { write_sample(own, place, |run| run.newest(port)) }
    };
    // SAFETY: the caller guarantees that `pointer` is null or a run that was not freed.
    unsafe { with_run(pointer, work) }
}

/// Puts the sample that `find` finds into `place`.
///
/// # Safety
/// `place` is null, or a sample that begins with its size and has as many bytes; nothing else refers to it.
pub(crate) unsafe fn write_sample(
    own: &mut Run,
    place: *mut Sample,
    find: impl FnOnce(&run::Run) -> Result<run::Sample, run::RunFailure>,
) -> Result<(), String> {
    // SAFETY: the caller guarantees that `place` is null or can be written, and that nothing else refers to it.
    let place = unsafe { place.as_mut() }.ok_or("the sample is NULL")?;
    if (place.size as usize) < size_of::<Sample>() {
        return Err(format!(
            "the sample says that it has {} bytes, not {}",
            place.size,
            size_of::<Sample>()
        ));
    }
    let run = own.run.as_ref().ok_or("there is no run any more")?;
    let found = own.sample.insert(find(run).map_err(error_text)?);
    (place.index, place.stamp) = (found.index(), found.stamp_s());
    (place.bytes, place.byte_count) = (found.bytes().as_ptr().cast(), found.bytes().len() as u64);
    Ok(())
}

/// `escapement_run_field`.
///
/// # Safety
/// `pointer` is null, or a run that was not freed; `port` and `field` are null, or end with a zero byte; `values` is null, or has room for
/// `count` numbers.
pub unsafe fn field(pointer: *mut Run, port: *const c_char, field: *const c_char, values: *mut f64, count: u32) -> i32 {
    let work = |run: &mut run::Run| {
        // SAFETY: the caller guarantees that each name is null or ends with a zero byte.
        let (port, field) = unsafe {
            (
                text(port, "the name of the output")?,
                text(field, "the name of the field")?,
            )
        };
        let found = run
            .newest(port)
            .and_then(|sample| sample.field(field))
            .map_err(error_text)?;
        if values.is_null() {
            return Err("the place of the values is NULL".to_owned());
        }
        if found.len() != count as usize {
            return Err(format!(
                "`{port}.{field}` has {} elements, and {count} were requested",
                found.len()
            ));
        }
        // SAFETY: it is not null, the caller guarantees room for `count` numbers, and there are as many.
        unsafe { std::ptr::copy_nonoverlapping(found.as_ptr(), values, found.len()) };
        Ok(())
    };
    // SAFETY: the caller guarantees that `pointer` is null or a run that was not freed.
    unsafe { with_active_run(pointer, work) }
}

/// `escapement_run_set`.
///
/// # Safety
/// `pointer` is null, or a run that was not freed; `port` is null, or ends with a zero byte; `bytes` is null, or has `size` bytes.
pub unsafe fn set(pointer: *mut Run, port: *const c_char, bytes: *const c_void, size: u64) -> i32 {
    let work = |run: &mut run::Run| {
        // SAFETY: the caller guarantees that each name is null or ends with a zero byte.
        let port = unsafe { text(port, "the name of the input") }?;
        if bytes.is_null() {
            return Err("the message is NULL".to_owned());
        }
        let size = usize::try_from(size).map_err(error_text)?;
        // SAFETY: it is not null, so the caller guarantees `size` bytes.
        let bytes = unsafe { std::slice::from_raw_parts(bytes.cast::<u8>(), size) };
        run.set_bytes(port, bytes).map_err(error_text)
    };
    // SAFETY: the caller guarantees that `pointer` is null or a run that was not freed.
    unsafe { with_active_run(pointer, work) }
}

/// `escapement_run_figure`.
///
/// # Safety
/// `pointer` is null, or a run that was not freed; `name` is null, or ends with a zero byte; `value` is null, or can be written.
pub unsafe fn figure(pointer: *mut Run, name: *const c_char, value: *mut f64) -> i32 {
    let work = |run: &mut run::Run| {
        // SAFETY: the name is null or ends with a zero byte, and the place is null or can be written, as the caller guarantees.
        let (name, value) = unsafe {
            (
                text(name, "the name of the figure")?,
                value.as_mut().ok_or("the value is NULL")?,
            )
        };
        let figures = run.figures().map(|figures| Figures::of(&figures));
        let numbers: Vec<_> = figures.iter().flat_map(Figures::numbers).collect();
        let found = numbers
            .iter()
            .find(|number| number.key == name || number.name == name)
            .ok_or_else(|| {
                let all: Vec<String> = numbers.iter().map(|number| format!("`{}`", number.name)).collect();
                format!("there is no figure `{name}`; there is {}", all.join(", "))
            })?;
        *value = found.value.ok_or_else(|| format!("`{name}` is not known yet"))?;
        Ok(())
    };
    // SAFETY: the caller guarantees that `pointer` is null or a run that was not freed.
    unsafe { with_active_run(pointer, work) }
}

/// `escapement_run_save`.
///
/// # Safety
/// `pointer` is null, or a run that was not freed; `place` is null, or can be written.
pub unsafe fn save(pointer: *mut Run, place: *mut *mut Checkpoint) -> i32 {
    let work = |run: &mut run::Run| {
        // SAFETY: the caller guarantees that `place` is null or can be written, and that nothing else refers to it.
        let place = unsafe { place.as_mut() }.ok_or("the place of the checkpoint is NULL")?;
        *place = std::ptr::null_mut();
        *place = Box::into_raw(Box::new(Checkpoint(run.save().map_err(error_text)?)));
        Ok(())
    };
    // SAFETY: the caller guarantees that `pointer` is null or a run that was not freed.
    unsafe { with_active_run(pointer, work) }
}

/// `escapement_run_restore`.
///
/// # Safety
/// `pointer` is null, or a run that was not freed; `checkpoint` is null, or was saved and not freed.
pub unsafe fn restore(pointer: *mut Run, checkpoint: *const Checkpoint) -> i32 {
    let work = |run: &mut run::Run| {
        // SAFETY: the caller guarantees that the checkpoint is null or was saved and not freed.
        let checkpoint = unsafe { checkpoint.as_ref() }.ok_or("the checkpoint is NULL")?;
        run.restore(&checkpoint.0).map_err(error_text)
    };
    // SAFETY: the caller guarantees that `pointer` is null or a run that was not freed.
    unsafe { with_active_run(pointer, work) }
}

/// `escapement_run_checkpoint_free`.
///
/// # Safety
/// `checkpoint` is null, or was saved and not freed.
pub unsafe fn checkpoint_free(checkpoint: *mut Checkpoint) {
    if !checkpoint.is_null() {
        // SAFETY: it is a checkpoint that `save` has boxed and that was not freed, as the caller guarantees.
        drop(unsafe { Box::from_raw(checkpoint) });
    }
}

/// `escapement_run_end`.
///
/// # Safety
/// `pointer` is null, or a run that was not freed; `place` is null, or an outcome that begins with its size and has as many bytes.
pub unsafe fn end(pointer: *mut Run, place: *mut Outcome) -> i32 {
    let work = |own: &mut Run| {
        // SAFETY: the caller guarantees that `place` is null or can be written, and that nothing else refers to it.
        let place = unsafe { place.as_mut() };
        if let Some(place) = &place
            && (place.size as usize) < size_of::<Outcome>()
        {
            return Err(format!(
                "the outcome says that it has {} bytes, not {}",
                place.size,
                size_of::<Outcome>()
            ));
        }
        let run = own
            .run
            .take()
            .ok_or("there is no run any more: it was ended, or could not be started")?;
        let outcome = run.end().map_err(error_text)?;
        if let Some(place) = place {
            place.complete = u32::from(outcome.ending == Ending::Complete);
            place.met = u32::from(outcome.exit_code() == 0);
            place.simulated = outcome.simulated_s;
            place.digest = [0; DIGEST];
            let digest = outcome.digest.map(error_text).unwrap_or_default();
            for (to, from) in place.digest.iter_mut().take(DIGEST - 1).zip(digest.bytes()) {
                *to = from as c_char;
            }
        }
        match outcome.ending {
            Ending::Failed { participant, reason } => Err(format!("participant `{participant}`: {reason}")),
            Ending::Complete | Ending::Stopped { .. } => Ok(()),
        }
    };
    // SAFETY: the caller guarantees that `pointer` is null or a run that was not freed.
    unsafe { with_run(pointer, work) }
}

/// `escapement_run_free`.
///
/// # Safety
/// `pointer` is null, or a run that was not freed.
pub unsafe fn free(pointer: *mut Run) {
    if !pointer.is_null() {
        // SAFETY: it is a run that `start` has boxed and that was not freed, as the caller guarantees.
        let own = unsafe { Box::from_raw(pointer) };
        let _ = catch_unwind(AssertUnwindSafe(|| drop(own)));
    }
}
