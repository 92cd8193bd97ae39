//! Calls of the C functions: pointers, panics and statuses.

use std::ffi::{CStr, c_char, c_int, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;

use crate::instance::{Instance, SavedState};
use crate::kind::Native;
use crate::log::{CATEGORIES, MESSAGES};
use crate::refusal::{Refusal, Status};

/// An instance, as the importer holds it.
pub type Pointer = *mut c_void;

/// The status after a panic: no instance can be used any more.
const FATAL: c_int = 4;

/// Calls `work` with the instance behind `pointer`, and returns the status in the importer's type. A failed instance executes `work` only
/// with `even_if_failed`.
///
/// # Safety
/// `pointer` is null, or an instance that was not freed.
pub unsafe fn call(
    pointer: Pointer,
    even_if_failed: bool,
    work: impl FnOnce(&mut Instance) -> Result<(), Refusal>,
) -> c_int {
    // SAFETY: the caller guarantees that it is null or was not freed; an importer calls an instance from one thread at a time, so that
    // nothing else refers to it.
    let Some(instance) = (unsafe { pointer.cast::<Instance>().as_mut() }) else {
        return Status::Error as c_int;
    };
    if instance.is_failed() && !even_if_failed {
        instance.log_message(
            Status::Error,
            "it has failed before: reset it, give it another state, or free it",
        );
        return Status::Error as c_int;
    }
    let done = catch_unwind(AssertUnwindSafe(|| {
        let done = work(instance);
        instance.forward_log_lines();
        match done {
            Ok(()) => Status::Ok as c_int,
            Err(refusal) => instance.record_refusal(&refusal) as c_int,
        }
    }));
    done.unwrap_or(FATAL)
}

/// Passes an instance to the importer.
pub fn into_pointer(instance: Instance) -> Pointer {
    Box::into_raw(Box::new(instance)).cast()
}

/// Frees an instance.
///
/// # Safety
/// As for [`call`].
pub unsafe fn free(pointer: Pointer) {
    if !pointer.is_null() {
        // SAFETY: it was returned by `into_pointer`.
        let mut instance = unsafe { Box::from_raw(pointer.cast::<Instance>()) };
        let _ = catch_unwind(AssertUnwindSafe(|| {
            // Participants may log something at their end.
            instance.reset();
            instance.forward_log_lines();
            drop(instance);
        }));
    }
}

/// A string of the importer.
///
/// # Safety
/// `at` is null, or ends with a zero byte.
pub unsafe fn text(at: *const c_char) -> String {
    if at.is_null() {
        return String::new();
    }
    // SAFETY: it is not null, so the caller guarantees a zero byte at its end.
    unsafe { CStr::from_ptr(at) }.to_string_lossy().into_owned()
}

/// A list of the importer; empty if there is none.
///
/// # Safety
/// `at` is null, or has `count` elements.
pub unsafe fn list<'a, T>(at: *const T, count: usize) -> &'a [T] {
    if at.is_null() || count == 0 {
        return &[];
    }
    // SAFETY: it is not null, so the caller guarantees `count` elements.
    unsafe { std::slice::from_raw_parts(at, count) }
}

/// `fmi2SetDebugLogging`, `fmi3SetDebugLogging`: errors are logged in any case.
///
/// # Safety
/// As for [`call`]; `categories` has `count` elements, which end with a zero byte.
pub unsafe fn set_debug_logging(pointer: Pointer, on: bool, categories: *const *const c_char, count: usize) -> c_int {
    let work = |instance: &mut Instance| {
        // SAFETY: each of the `count` categories ends with a zero byte, as the caller guarantees.
        let wanted: Vec<String> = unsafe { list(categories, count).iter().map(|at| text(*at)).collect() };
        if let Some(unknown) = wanted.iter().find(|name| !CATEGORIES.contains(&name.as_str())) {
            let all = CATEGORIES.join(", ");
            return Err(Refusal::error(format!(
                "there is no log category `{unknown}`; there are {all}"
            )));
        }
        instance.set_forwards_log(on && (wanted.is_empty() || wanted.iter().any(|name| name == MESSAGES)));
        Ok(())
    };
    // SAFETY: the caller guarantees that `pointer` is null or an instance that was not freed.
    unsafe { call(pointer, true, work) }
}

/// Reads variables into memory of the importer, which has room for `room` values, or for one per variable if `room` is not given.
///
/// # Safety
/// `pointer` is as for [`call`]; `references` has `count` elements; the memory of the importer has room for, or has, `room` values of the
/// type `native`.
pub unsafe fn get(
    pointer: Pointer,
    native: Native,
    (references, count): (*const u32, usize),
    to: *mut c_void,
    room: usize,
) -> c_int {
    let work = |instance: &mut Instance| {
        // SAFETY: the caller guarantees that there are `count` references.
        let references = unsafe { list(references, count) };
        let values = check_value_count(instance, references, native, room)?;
        let mut bytes = vec![0; values * native.size()];
        instance.get(references, native, &mut bytes)?;
        // SAFETY: there is room for as many values as there are.
        unsafe { std::ptr::copy_nonoverlapping(bytes.as_ptr(), to.cast::<u8>(), bytes.len()) };
        Ok(())
    };
    // SAFETY: the caller guarantees that `pointer` is null or an instance that was not freed.
    unsafe { call(pointer, false, work) }
}

/// Sets variables.
///
/// # Safety
/// As for [`get`].
pub unsafe fn set(
    pointer: Pointer,
    native: Native,
    (references, count): (*const u32, usize),
    from: *const c_void,
    room: usize,
) -> c_int {
    let work = |instance: &mut Instance| {
        // SAFETY: the caller guarantees that there are `count` references.
        let references = unsafe { list(references, count) };
        let values = check_value_count(instance, references, native, room)?;
        // SAFETY: there are as many values.
        let bytes = unsafe { list(from.cast::<u8>(), values * native.size()) };
        instance.set(references, native, bytes)
    };
    // SAFETY: the caller guarantees that `pointer` is null or an instance that was not freed.
    unsafe { call(pointer, false, work) }
}

fn check_value_count(instance: &Instance, references: &[u32], native: Native, room: usize) -> Result<usize, Refusal> {
    let values = instance.count(references, native)?;
    if values == room {
        return Ok(values);
    }
    let text = format!("{room} values were given for variables with {values} values together");
    Err(Refusal::error(text))
}

/// Reads texts.
///
/// # Safety
/// As for [`get`].
pub unsafe fn get_texts(
    pointer: Pointer,
    (references, count): (*const u32, usize),
    to: *mut *const c_char,
    room: usize,
) -> c_int {
    let work = |instance: &mut Instance| {
        // SAFETY: the caller guarantees that there are `count` references.
        let references = unsafe { list(references, count) };
        check_value_count(instance, references, Native::Text, room)?;
        let texts = instance.get_texts(references)?;
        for (number, text) in texts.iter().enumerate() {
            // SAFETY: there is room for as many texts as there are.
            unsafe { to.add(number).write(text.as_ptr()) };
        }
        Ok(())
    };
    // SAFETY: the caller guarantees that `pointer` is null or an instance that was not freed.
    unsafe { call(pointer, false, work) }
}

/// Sets texts.
///
/// # Safety
/// As for [`get`]; each of the texts is null, or ends with a zero byte.
pub unsafe fn set_texts(
    pointer: Pointer,
    (references, count): (*const u32, usize),
    from: *const *const c_char,
    room: usize,
) -> c_int {
    let work = |instance: &mut Instance| {
        // SAFETY: the caller guarantees that there are `count` references.
        let references = unsafe { list(references, count) };
        check_value_count(instance, references, Native::Text, room)?;
        // SAFETY: the caller guarantees `room` texts.
        let texts = unsafe { list(from, room) };
        let bytes = |at: &*const c_char| match at.is_null() {
            true => &[][..],
            // SAFETY: a text that is not null ends with a zero byte, as the caller guarantees.
            false => unsafe { CStr::from_ptr(*at) }.to_bytes(),
        };
        let contents: Vec<&[u8]> = texts.iter().map(bytes).collect();
        instance.set_contents(references, Native::Text, &contents)
    };
    // SAFETY: the caller guarantees that `pointer` is null or an instance that was not freed.
    unsafe { call(pointer, false, work) }
}

/// Reads binary variables, and their sizes into `sizes`.
///
/// # Safety
/// As for [`get`]; `sizes` has room for `room` sizes.
pub unsafe fn get_binaries(
    pointer: Pointer,
    (references, count): (*const u32, usize),
    sizes: *mut usize,
    to: *mut *const u8,
    room: usize,
) -> c_int {
    let work = |instance: &mut Instance| {
        // SAFETY: the caller guarantees that there are `count` references.
        let references = unsafe { list(references, count) };
        check_value_count(instance, references, Native::Binary, room)?;
        for (number, bytes) in instance.get_binaries(references)?.iter().enumerate() {
            // SAFETY: there is room for as many as there are.
            unsafe {
                to.add(number).write(bytes.as_ptr());
                sizes.add(number).write(bytes.len());
            }
        }
        Ok(())
    };
    // SAFETY: the caller guarantees that `pointer` is null or an instance that was not freed.
    unsafe { call(pointer, false, work) }
}

/// Sets binary variables.
///
/// # Safety
/// As for [`get`]; there are `room` sizes, and each pointer is null or has as many bytes as its size states.
pub unsafe fn set_binaries(
    pointer: Pointer,
    (references, count): (*const u32, usize),
    sizes: *const usize,
    from: *const *const u8,
    room: usize,
) -> c_int {
    let work = |instance: &mut Instance| {
        // SAFETY: the caller guarantees that there are `count` references.
        let references = unsafe { list(references, count) };
        check_value_count(instance, references, Native::Binary, room)?;
        // SAFETY: the caller guarantees `room` sizes and as many pointers.
        let (sizes, pointers) = unsafe { (list(sizes, room), list(from, room)) };
        // SAFETY: the caller guarantees that each pointer has as many bytes as its size states.
        let each = sizes.iter().zip(pointers).map(|(size, at)| unsafe { list(*at, *size) });
        let contents: Vec<&[u8]> = each.collect();
        instance.set_contents(references, Native::Binary, &contents)
    };
    // SAFETY: the caller guarantees that `pointer` is null or an instance that was not freed.
    unsafe { call(pointer, false, work) }
}

/// Saves the state: into the one that `out` points to, or into a new one.
///
/// # Safety
/// `pointer` is as for [`call`]; `out` points to null or a state of this FMU.
pub unsafe fn save(pointer: Pointer, out: *mut Pointer) -> c_int {
    let work = |instance: &mut Instance| {
        let state = Box::new(instance.save()?);
        // SAFETY: the caller guarantees that `out` points to null or to a state of this FMU, and can be written.
        unsafe {
            free_state(out);
            out.write(Box::into_raw(state).cast());
        }
        Ok(())
    };
    // SAFETY: the caller guarantees that `pointer` is null or an instance that was not freed.
    unsafe { call(pointer, false, work) }
}

/// Restores a state.
///
/// # Safety
/// `pointer` is as for [`call`]; `state` is null, or a state of this FMU.
pub unsafe fn restore(pointer: Pointer, state: Pointer) -> c_int {
    let work = |instance: &mut Instance| {
        // SAFETY: the caller guarantees that the state is null or was saved by this FMU and not freed.
        let state = unsafe { state.cast::<SavedState>().as_ref() };
        instance.restore(state.ok_or_else(|| Refusal::error("there is no state (NULL)"))?)
    };
    // SAFETY: the caller guarantees that `pointer` is null or an instance that was not freed.
    unsafe { call(pointer, true, work) }
}

/// Frees a state, and sets the importer's pointer to null.
///
/// # Safety
/// As for [`save`].
pub unsafe fn free_state(out: *mut Pointer) {
    // SAFETY: the caller guarantees that `out` is null or points to null or to a state, which `save` has boxed.
    unsafe {
        if !out.is_null() && !(*out).is_null() {
            drop(Box::from_raw((*out).cast::<SavedState>()));
            *out = std::ptr::null_mut();
        }
    }
}

/// Passes the bytes of a state, or their number, to `work`.
///
/// # Safety
/// `pointer` is as for [`call`]; `state` is null, or a state of this FMU; `work` is called at most once.
pub unsafe fn state_bytes(pointer: Pointer, state: Pointer, work: impl FnOnce(&[u8]) -> Result<(), Refusal>) -> c_int {
    let work = |_: &mut Instance| {
        // SAFETY: the caller guarantees that the state is null or was saved by this FMU and not freed.
        let state = unsafe { state.cast::<SavedState>().as_ref() };
        work(state.ok_or_else(|| Refusal::error("there is no state (NULL)"))?.bytes())
    };
    // SAFETY: the caller guarantees that `pointer` is null or an instance that was not freed.
    unsafe { call(pointer, true, work) }
}

/// The size of a state, bytes.
///
/// # Safety
/// As for [`state_bytes`]; `size` can be written.
pub unsafe fn state_size(pointer: Pointer, state: Pointer, size: *mut usize) -> c_int {
    // SAFETY: the caller guarantees that the instance and the state are null or were not freed, and that `size` can be written.
    unsafe {
        state_bytes(pointer, state, |bytes| {
            size.write(bytes.len());
            Ok(())
        })
    }
}

/// Copies a state into memory of the importer.
///
/// # Safety
/// As for [`state_bytes`]; `to` has room for `room` bytes.
pub unsafe fn serialise(pointer: Pointer, state: Pointer, to: *mut u8, room: usize) -> c_int {
    // SAFETY: the caller guarantees that the instance and the state are null or were not freed; `to` has room for the bytes, as is checked.
    unsafe {
        state_bytes(pointer, state, |bytes| {
            if room < bytes.len() {
                let text = format!("the state has {} bytes, and there is room for {room}", bytes.len());
                return Err(Refusal::error(text));
            }
            std::ptr::copy_nonoverlapping(bytes.as_ptr(), to, bytes.len());
            Ok(())
        })
    }
}

/// Makes a state from bytes.
///
/// # Safety
/// `pointer` and `out` are as for [`save`]; `from` has `size` bytes.
pub unsafe fn deserialise(pointer: Pointer, from: *const u8, size: usize, out: *mut Pointer) -> c_int {
    let work = |_: &mut Instance| {
        // SAFETY: the caller guarantees `size` bytes.
        let state = Box::new(SavedState::of_bytes(unsafe { list(from, size) })?);
        // SAFETY: the caller guarantees that `out` points to null or to a state of this FMU, and can be written.
        unsafe {
            free_state(out);
            out.write(Box::into_raw(state).cast());
        }
        Ok(())
    };
    // SAFETY: the caller guarantees that `pointer` is null or an instance that was not freed.
    unsafe { call(pointer, true, work) }
}

/// A function that the FMU does not support.
///
/// # Safety
/// As for [`call`].
pub unsafe fn unsupported(pointer: Pointer, name: &str) -> c_int {
    let work = |_: &mut Instance| {
        Err(Refusal::error(format!(
            "{name} is not there: it is an FMU for co-simulation without event mode, clocks, derivatives and structural parameters"
        )))
    };
    // SAFETY: the caller guarantees that `pointer` is null or an instance that was not freed.
    unsafe { call(pointer, true, work) }
}

/// The resource folder that an importer passes: in FMI 2.0 as a URI, in FMI 3.0 as a path.
pub fn resource_folder(location: &str) -> PathBuf {
    let Some(rest) = location.strip_prefix("file:") else {
        return PathBuf::from(location);
    };
    let path = match rest.strip_prefix("//") {
        Some(rest) => rest.find('/').map_or(rest, |slash| &rest[slash..]),
        None => rest,
    };
    let mut bytes = Vec::new();
    let mut left = path.as_bytes();
    while let Some((&byte, after)) = left.split_first() {
        let escaped = after.get(..2).and_then(|hex| std::str::from_utf8(hex).ok());
        match escaped.and_then(|hex| u8::from_str_radix(hex, 16).ok()) {
            Some(value) if byte == b'%' => {
                bytes.push(value);
                left = &after[2..];
            }
            _ => {
                bytes.push(byte);
                left = after;
            }
        }
    }
    use std::os::unix::ffi::OsStringExt;
    PathBuf::from(std::ffi::OsString::from_vec(bytes))
}

/// Rejects a processor that lacks a feature for which this library was compiled.
///
/// # Errors
/// Names what is missing.
pub fn check_processor() -> Result<(), String> {
    match engine::processor::missing() {
        None => Ok(()),
        Some(missing) => Err(format!(
            "it is compiled for x86-64-v3 processors (2013 and later), and this one lacks {missing}"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::resource_folder;
    use std::path::Path;

    #[test]
    fn resource_folder_is_found_in_every_spelling() {
        for location in [
            "file:///tmp/a%20b/resources",
            "file:/tmp/a%20b/resources",
            "file://localhost/tmp/a b/resources",
            "/tmp/a b/resources",
        ] {
            assert_eq!(resource_folder(location), Path::new("/tmp/a b/resources"), "{location}");
        }
        assert_eq!(resource_folder("/tmp/100%25/"), Path::new("/tmp/100%25/"));
    }
}
