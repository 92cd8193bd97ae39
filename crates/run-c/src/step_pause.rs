//! The C functions for a participant that is paused before its step.

use std::ffi::{CString, c_char, c_void};

use crate::run::{Run, Sample, error_text, text, with_active_run, with_run, write_sample};

/// `escapement_run_to_step`.
///
/// # Safety
/// `pointer` is null, or a run that was not freed; `participant` is null, or ends with a zero byte; `reached` is null, or can be written.
pub unsafe fn to_step(pointer: *mut Run, participant: *const c_char, reached: *mut u32) -> i32 {
    let work = |run: &mut engine::run::Run| {
        // SAFETY: the name is null or ends with a zero byte, and the place is null or can be written, as the caller guarantees.
        let (participant, reached) = unsafe {
            (
                text(participant, "the name of the participant")?,
                reached.as_mut().ok_or("`reached` is NULL")?,
            )
        };
        *reached = 0;
        *reached = u32::from(run.run_to_step(participant).map_err(error_text)?);
        Ok(())
    };
    // SAFETY: the caller guarantees that `pointer` is null or a run that was not freed.
    unsafe { with_active_run(pointer, work) }
}

/// `escapement_run_read_input`.
///
/// # Safety
/// `pointer` is null, or a run that was not freed; `port` is null, or ends with a zero byte; `place` is null, or a
/// sample that begins with its size and has as many bytes.
pub unsafe fn read_input(pointer: *mut Run, port: *const c_char, place: *mut Sample) -> i32 {
    let work = |own: &mut Run| {
        // SAFETY: the caller guarantees that each name is null or ends with a zero byte.
        let port = unsafe { text(port, "the name of the input") }?;
        // SAFETY: the caller guarantees that `place` is null or a sample of the size that it states.
        unsafe { write_sample(own, place, |run| run.read_input(port)) }
    };
    // SAFETY: the caller guarantees that `pointer` is null or a run that was not freed.
    unsafe { with_run(pointer, work) }
}

/// `escapement_run_log`.
///
/// # Safety
/// `pointer` is null, or a run that was not freed; `participant` is null, or ends with a zero byte.
pub unsafe fn log(pointer: *mut Run, participant: *const c_char) -> *const c_char {
    let work = |own: &mut Run| {
        // SAFETY: the caller guarantees that each name is null or ends with a zero byte.
        let participant = unsafe { text(participant, "the name of the participant") }?;
        let run = own.run.as_ref().ok_or("there is no run any more")?;
        own.log = CString::new(run.log(participant).map_err(error_text)?.replace('\0', " ")).unwrap_or_default();
        Ok(())
    };
    // SAFETY: the caller guarantees that `pointer` is null or a run that was not freed.
    match unsafe { with_run(pointer, work) } {
        // SAFETY: the run is there: it was just asked.
        0 => unsafe { (*pointer).log.as_ptr() },
        _ => std::ptr::null(),
    }
}

/// `escapement_run_set_output`.
///
/// # Safety
/// `pointer` is null, or a run that was not freed; `port` is null, or ends with a zero byte; `bytes` is null, or has `size` bytes.
pub unsafe fn set_output(pointer: *mut Run, port: *const c_char, bytes: *const c_void, size: u64) -> i32 {
    let work = |run: &mut engine::run::Run| {
        // SAFETY: the caller guarantees that each name is null or ends with a zero byte.
        let port = unsafe { text(port, "the name of the output") }?;
        if bytes.is_null() {
            return Err("the message is NULL".to_owned());
        }
        let size = usize::try_from(size).map_err(error_text)?;
        // SAFETY: it is not null, so the caller guarantees `size` bytes.
        let bytes = unsafe { std::slice::from_raw_parts(bytes.cast::<u8>(), size) };
        run.set_output_bytes(port, bytes).map_err(error_text)
    };
    // SAFETY: the caller guarantees that `pointer` is null or a run that was not freed.
    unsafe { with_active_run(pointer, work) }
}
