//! The functions of FMI 3.0 for co-simulation, as far as they differ from those of FMI 2.0.

use std::ffi::{c_char, c_int, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use engine::Catalogue;

use crate::call::{self, Pointer};
use crate::instance::Instance;
use crate::kind::{Native, Version};
use crate::log::{Log, LoggerFmi3};
use crate::refusal::{Refusal, Status};

/// The dependency kind of all dependencies: arbitrary.
const DEPENDENT: c_int = 5;

/// `fmi3InstantiateCoSimulation`.
///
/// # Safety
/// `token` and `resources` are null, or end with a zero byte; `logger` has the type of the standard and may be called with `environment`
/// until the instance is freed.
pub unsafe fn instantiate(
    catalogue: fn() -> Arc<Catalogue>,
    token: *const c_char,
    resources: *const c_char,
    environment: *mut c_void,
    logger: Option<LoggerFmi3>,
) -> Pointer {
    // SAFETY: the importer's strings are null or end with a zero byte, and its callbacks live as long as the instance.
    let (token, resources) = unsafe { (call::text(token), call::text(resources)) };
    let log = Log::Fmi3(logger, environment);
    if let Err(text) = call::check_processor() {
        log.write(Status::Error, &text);
        return std::ptr::null_mut();
    }
    let made = catch_unwind(AssertUnwindSafe(|| {
        Instance::new(
            &catalogue(),
            Version::Fmi3,
            &call::resource_folder(&resources),
            &token,
            log,
        )
    }));
    match made {
        Ok(Ok(instance)) => call::into_pointer(instance),
        Ok(Err((log, text))) => {
            log.write(Status::Error, &text);
            std::ptr::null_mut()
        }
        Err(_) => std::ptr::null_mut(),
    }
}

/// The instantiation of an interface type that the FMU does not support.
///
/// # Safety
/// `logger` has the type of the standard.
pub unsafe fn no_instance(environment: *mut c_void, logger: Option<LoggerFmi3>) -> Pointer {
    Log::Fmi3(logger, environment).write(Status::Error, "only co-simulation is supported");
    std::ptr::null_mut()
}

/// `fmi3EnterInitializationMode`.
///
/// # Safety
/// As for [`call::call`].
pub unsafe fn enter(instance: Pointer, start: f64) -> c_int {
    let work = |own: &mut Instance| {
        own.set_up(start)?;
        own.enter_initialisation()
    };
    // SAFETY: the caller guarantees that `instance` is null or was not freed.
    unsafe { call::call(instance, false, work) }
}

/// `fmi3GetFloat64` and similar functions.
///
/// # Safety
/// As for [`call::get`].
pub unsafe fn get(
    instance: Pointer,
    native: Native,
    references: *const u32,
    count: usize,
    to: *mut c_void,
    room: usize,
) -> c_int {
    // SAFETY: the caller guarantees the lists and the room that `call::get` and `call::set` require.
    unsafe { call::get(instance, native, (references, count), to, room) }
}

/// `fmi3SetFloat64` and similar functions.
///
/// # Safety
/// As for [`call::set`].
pub unsafe fn set(
    instance: Pointer,
    native: Native,
    references: *const u32,
    count: usize,
    from: *const c_void,
    room: usize,
) -> c_int {
    // SAFETY: the caller guarantees the lists and the room that `call::get` and `call::set` require.
    unsafe { call::set(instance, native, (references, count), from, room) }
}

/// A get or set function for a type of which the FMU has no variables.
///
/// # Safety
/// As for [`call::call`].
pub unsafe fn none_of(instance: Pointer, what: &str, count: usize) -> c_int {
    let work = |_: &mut Instance| match count {
        0 => Ok(()),
        _ => Err(Refusal::error(format!("it has no variables of the type {what}"))),
    };
    // SAFETY: the caller guarantees that `instance` is null or was not freed.
    unsafe { call::call(instance, false, work) }
}

/// `fmi3DoStep`.
///
/// # Safety
/// As for [`call::call`]; each place is null, or can be written.
pub unsafe fn step(
    instance: Pointer,
    from: f64,
    span: f64,
    event: *mut bool,
    terminate: *mut bool,
    early: *mut bool,
    last: *mut f64,
) -> c_int {
    let work = |own: &mut Instance| {
        let done = own.step(from, span);
        // SAFETY: the caller guarantees that each place can be written if it is not null; some importers pass null for results that they do not need.
        unsafe {
            if let Some(event) = event.as_mut() {
                *event = false;
            }
            if let Some(terminate) = terminate.as_mut() {
                *terminate = done.is_err() && own.is_over();
            }
            if let Some(early) = early.as_mut() {
                *early = false;
            }
            if let Some(last) = last.as_mut() {
                *last = own.time();
            }
        }
        done
    };
    // SAFETY: the caller guarantees that `instance` is null or was not freed.
    unsafe { call::call(instance, false, work) }
}

/// `fmi3GetNumberOfVariableDependencies`.
///
/// # Safety
/// As for [`call::call`]; `count` can be written.
pub unsafe fn dependency_count(instance: Pointer, reference: u32, count: *mut usize) -> c_int {
    let work = |own: &mut Instance| {
        let found = own.dependencies(reference)?;
        // SAFETY: the caller guarantees that `count` can be written.
        unsafe { count.write(found.len()) };
        Ok(())
    };
    // SAFETY: the caller guarantees that `instance` is null or was not freed.
    unsafe { call::call(instance, false, work) }
}

/// `fmi3GetVariableDependencies`.
///
/// # Safety
/// As for [`call::call`]; each of the lists has room for `room` elements.
pub unsafe fn dependencies(
    instance: Pointer,
    reference: u32,
    [element, other]: [*mut usize; 2],
    independents: *mut u32,
    kinds: *mut c_int,
    room: usize,
) -> c_int {
    let work = |own: &mut Instance| {
        let found = own.dependencies(reference)?;
        if found.len() != room {
            let text = format!(
                "variable {reference} has {} dependencies, and there is room for {room}",
                found.len()
            );
            return Err(Refusal::error(text));
        }
        for (number, independent) in found.into_iter().enumerate() {
            // SAFETY: the caller guarantees that each list has room for `room` elements. Element 0 stands for all elements.
            unsafe {
                element.add(number).write(0);
                independents.add(number).write(independent);
                other.add(number).write(0);
                kinds.add(number).write(DEPENDENT);
            }
        }
        Ok(())
    };
    // SAFETY: the caller guarantees that `instance` is null or was not freed.
    unsafe { call::call(instance, false, work) }
}
