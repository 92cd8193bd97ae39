//! The functions of FMI 2.0 for co-simulation.

use std::ffi::{CString, c_char, c_int, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use engine::Catalogue;

use crate::call::{self, Pointer};
use crate::instance::{Instance, Mode};
use crate::kind::{Native, Version};
use crate::log::{Log, LoggerFmi2};
use crate::refusal::{Refusal, Status};

const CO_SIMULATION: c_int = 1;
const LAST_SUCCESSFUL_TIME: c_int = 2;
const TERMINATED: c_int = 3;

/// `fmi2CallbackFunctions`, as far as it is used.
#[repr(C)]
pub struct Callbacks {
    logger: Option<LoggerFmi2>,
    allocate: *const c_void,
    free: *const c_void,
    step_finished: *const c_void,
    environment: *mut c_void,
}

/// `fmi2Instantiate`.
///
/// # Safety
/// The texts are null, or end with a zero byte; `callbacks` is null, or points to callbacks of the standard, which may be called until the
/// instance is freed.
pub unsafe fn instantiate(
    catalogue: fn() -> Arc<Catalogue>,
    name: *const c_char,
    kind: c_int,
    token: *const c_char,
    resources: *const c_char,
    callbacks: *const Callbacks,
) -> Pointer {
    // SAFETY: the caller guarantees that `out` points to null or to a state of this FMU, and can be written.
    let (name, token, resources, callbacks) = unsafe {
        (
            call::text(name),
            call::text(token),
            call::text(resources),
            callbacks.as_ref(),
        )
    };
    let name = CString::new(name).unwrap_or_default();
    let log = match callbacks {
        Some(own) => Log::Fmi2(own.logger, own.environment, name),
        None => Log::Fmi2(None, std::ptr::null_mut(), name),
    };
    if let Err(text) = call::check_processor() {
        log.write(Status::Error, &text);
        return std::ptr::null_mut();
    }
    if kind != CO_SIMULATION {
        log.write(Status::Error, "only co-simulation is supported");
        return std::ptr::null_mut();
    }
    let made = catch_unwind(AssertUnwindSafe(|| {
        Instance::new(
            &catalogue(),
            Version::Fmi2,
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

/// `fmi2SetupExperiment`.
///
/// # Safety
/// As for [`call::call`].
pub unsafe fn set_up(instance: Pointer, start: f64) -> c_int {
    // SAFETY: the caller guarantees that `instance` is null or was not freed.
    unsafe { call::call(instance, false, |own| own.set_up(start)) }
}

/// `fmi2EnterInitializationMode`.
///
/// # Safety
/// As for [`call::call`].
pub unsafe fn enter(instance: Pointer) -> c_int {
    // SAFETY: the caller guarantees that `instance` is null or was not freed.
    unsafe { call::call(instance, false, Instance::enter_initialisation) }
}

/// `fmi2ExitInitializationMode`.
///
/// # Safety
/// As for [`call::call`].
pub unsafe fn exit(instance: Pointer) -> c_int {
    // SAFETY: the caller guarantees that `instance` is null or was not freed.
    unsafe { call::call(instance, false, Instance::exit_initialisation) }
}

/// `fmi2Terminate`.
///
/// # Safety
/// As for [`call::call`].
pub unsafe fn terminate(instance: Pointer) -> c_int {
    // SAFETY: the caller guarantees that `instance` is null or was not freed.
    unsafe { call::call(instance, false, Instance::terminate) }
}

/// `fmi2Reset`.
///
/// # Safety
/// As for [`call::call`].
pub unsafe fn reset(instance: Pointer) -> c_int {
    let work = |own: &mut Instance| {
        own.reset();
        Ok(())
    };
    // SAFETY: the caller guarantees that `instance` is null or was not freed.
    unsafe { call::call(instance, true, work) }
}

/// `fmi2GetReal` and similar functions.
///
/// # Safety
/// As for [`call::get`].
pub unsafe fn get(instance: Pointer, native: Native, references: *const u32, count: usize, to: *mut c_void) -> c_int {
    // SAFETY: the caller guarantees `count` references and values; FMI 2.0 has scalars only.
    unsafe { call::get(instance, native, (references, count), to, count) }
}

/// `fmi2SetReal` and similar functions.
///
/// # Safety
/// As for [`call::set`].
pub unsafe fn set(
    instance: Pointer,
    native: Native,
    references: *const u32,
    count: usize,
    from: *const c_void,
) -> c_int {
    // SAFETY: the caller guarantees `count` references and values; FMI 2.0 has scalars only.
    unsafe { call::set(instance, native, (references, count), from, count) }
}

/// `fmi2DoStep`.
///
/// # Safety
/// As for [`call::call`].
pub unsafe fn step(instance: Pointer, from: f64, span: f64) -> c_int {
    // SAFETY: the caller guarantees that `instance` is null or was not freed.
    unsafe { call::call(instance, false, |own| own.step(from, span)) }
}

/// `fmi2GetRealStatus`: the instant up to which the instance has been stepped.
///
/// # Safety
/// As for [`call::call`]; `value` can be written.
pub unsafe fn real_status(instance: Pointer, which: c_int, value: *mut f64) -> c_int {
    let work = |own: &mut Instance| {
        if which != LAST_SUCCESSFUL_TIME || own.mode() == Mode::Instantiated {
            return Err(Refusal::discard(
                "there is no such status: steps are done when fmi2DoStep returns",
            ));
        }
        // SAFETY: the caller guarantees that `value` can be written.
        unsafe { value.write(own.time()) };
        Ok(())
    };
    // SAFETY: the caller guarantees that `instance` is null or was not freed.
    unsafe { call::call(instance, true, work) }
}

/// `fmi2GetBooleanStatus`: whether the end of the scenario has been reached.
///
/// # Safety
/// As for [`call::call`]; `value` can be written.
pub unsafe fn boolean_status(instance: Pointer, which: c_int, value: *mut c_int) -> c_int {
    let work = |own: &mut Instance| {
        if which != TERMINATED {
            return Err(Refusal::discard("there is no such status"));
        }
        // SAFETY: the caller guarantees that `value` can be written.
        unsafe { value.write(c_int::from(own.is_over())) };
        Ok(())
    };
    // SAFETY: the caller guarantees that `instance` is null or was not freed.
    unsafe { call::call(instance, true, work) }
}

/// A status that is not supported.
///
/// # Safety
/// As for [`call::call`].
pub unsafe fn no_status(instance: Pointer) -> c_int {
    let work = |_: &mut Instance| {
        Err(Refusal::discard(
            "nothing is pending: steps are done when fmi2DoStep returns",
        ))
    };
    // SAFETY: the caller guarantees that `instance` is null or was not freed.
    unsafe { call::call(instance, true, work) }
}
