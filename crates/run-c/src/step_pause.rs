//! The C functions for a participant that is paused before its step.

use std::ffi::{CString, c_char, c_void};

use crate::run::{Run, Sample, error_text, text, with_active_run, with_run, write_sample};

/// `escapement_run_to_step`.
///
/// # Safety
/// As the header says.
pub unsafe fn to_step(pointer: *mut Run, participant: *const c_char, reached: *mut u32) -> i32 {
    let work = |run: &mut engine::run::Run| {
        // SAFETY: as the caller says.
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
    // SAFETY: as the caller says.
    unsafe { with_active_run(pointer, work) }
}

/// `escapement_run_read_input`.
///
/// # Safety
/// As the header says.
pub unsafe fn read_input(pointer: *mut Run, port: *const c_char, place: *mut Sample) -> i32 {
    let work = |own: &mut Run| {
        // SAFETY: as the caller says.
        let port = unsafe { text(port, "the name of the input") }?;
        // SAFETY: as the caller says.
        unsafe { write_sample(own, place, |run| run.read_input(port)) }
    };
    // SAFETY: as the caller says.
    unsafe { with_run(pointer, work) }
}

/// `escapement_run_log`.
///
/// # Safety
/// As the header says.
pub unsafe fn log(pointer: *mut Run, participant: *const c_char) -> *const c_char {
    let work = |own: &mut Run| {
        // SAFETY: as the caller says.
        let participant = unsafe { text(participant, "the name of the participant") }?;
        let run = own.run.as_ref().ok_or("there is no run any more")?;
        own.log = CString::new(run.log(participant).map_err(error_text)?.replace('\0', " ")).unwrap_or_default();
        Ok(())
    };
    // SAFETY: as the caller says.
    match unsafe { with_run(pointer, work) } {
        // SAFETY: the run is there: it was just asked.
        0 => unsafe { (*pointer).log.as_ptr() },
        _ => std::ptr::null(),
    }
}

/// `escapement_run_set_output`.
///
/// # Safety
/// As the header says.
pub unsafe fn set_output(pointer: *mut Run, port: *const c_char, bytes: *const c_void, size: u64) -> i32 {
    let work = |run: &mut engine::run::Run| {
        // SAFETY: as the caller says.
        let port = unsafe { text(port, "the name of the output") }?;
        if bytes.is_null() {
            return Err("the message is NULL".to_owned());
        }
        let size = usize::try_from(size).map_err(error_text)?;
        // SAFETY: the message is as large as the caller says.
        let bytes = unsafe { std::slice::from_raw_parts(bytes.cast::<u8>(), size) };
        run.set_output_bytes(port, bytes).map_err(error_text)
    };
    // SAFETY: as the caller says.
    unsafe { with_active_run(pointer, work) }
}
