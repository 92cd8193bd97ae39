//! Bindings to FMI 2.0.

use std::ffi::{CString, c_char, c_int, c_void};
use std::os::unix::ffi::OsStrExt;
use std::path::Path;

use foreign_calls::Guard;

use super::interface::{Instance, Native, StateError, Status, Stepped, Texts, Values, failure_categories};
use super::library::{Library, LoadError, functions};
use super::log::Log;
use crate::description::Description;

type Component = *mut c_void;
type Get = unsafe extern "C" fn(Component, *const u32, usize, *mut c_void) -> c_int;

#[repr(C)]
struct Callbacks {
    logger: *const c_void,
    allocate: unsafe extern "C" fn(usize, usize) -> *mut c_void,
    free: unsafe extern "C" fn(*mut c_void),
    step_finished: *const c_void,
    environment: *mut c_void,
}

unsafe extern "C" {
    /// Defined in `logger.c`: variadic, and called by the FMU only.
    fn escapement_fmi2_logger();
}

functions! {
    Functions {
        instantiate = "fmi2Instantiate": fn(*const c_char, c_int, *const c_char, *const c_char, *const Callbacks, c_int, c_int) -> Component;
        free_instance = "fmi2FreeInstance": fn(Component);
        setup_experiment = "fmi2SetupExperiment": fn(Component, c_int, f64, f64, c_int, f64) -> c_int;
        enter_initialisation = "fmi2EnterInitializationMode": fn(Component) -> c_int;
        exit_initialisation = "fmi2ExitInitializationMode": fn(Component) -> c_int;
        terminate = "fmi2Terminate": fn(Component) -> c_int;
        get_real = "fmi2GetReal": fn(Component, *const u32, usize, *mut c_void) -> c_int;
        get_integer = "fmi2GetInteger": fn(Component, *const u32, usize, *mut c_void) -> c_int;
        get_boolean = "fmi2GetBoolean": fn(Component, *const u32, usize, *mut c_void) -> c_int;
        set_real = "fmi2SetReal": fn(Component, *const u32, usize, *mut c_void) -> c_int;
        set_integer = "fmi2SetInteger": fn(Component, *const u32, usize, *mut c_void) -> c_int;
        set_boolean = "fmi2SetBoolean": fn(Component, *const u32, usize, *mut c_void) -> c_int;
        set_string = "fmi2SetString": fn(Component, *const u32, usize, *const *const c_char) -> c_int;
        do_step = "fmi2DoStep": fn(Component, f64, f64, c_int) -> c_int;
        get_real_status = "fmi2GetRealStatus": fn(Component, c_int, *mut f64) -> c_int;
        get_boolean_status = "fmi2GetBooleanStatus": fn(Component, c_int, *mut c_int) -> c_int;
    }
}

functions! {
    /// Loaded only where texts are read.
    TextFunctions {
        get_string = "fmi2GetString": fn(Component, *const u32, usize, *mut *const c_char) -> c_int;
    }
}

functions! {
    /// Loaded only where the description declares them.
    StateFunctions {
        get = "fmi2GetFMUstate": fn(Component, *mut *mut c_void) -> c_int;
        set = "fmi2SetFMUstate": fn(Component, *mut c_void) -> c_int;
        free = "fmi2FreeFMUstate": fn(Component, *mut *mut c_void) -> c_int;
        size = "fmi2SerializedFMUstateSize": fn(Component, *mut c_void, *mut usize) -> c_int;
        serialise = "fmi2SerializeFMUstate": fn(Component, *mut c_void, *mut c_char, usize) -> c_int;
        deserialise = "fmi2DeSerializeFMUstate": fn(Component, *const c_char, usize, *mut *mut c_void) -> c_int;
    }
}

const LAST_SUCCESSFUL_TIME: c_int = 2;
const TERMINATED: c_int = 3;
const CO_SIMULATION: c_int = 1;

/// An instance.
pub struct Fmi2Instance {
    component: Component,
    functions: Functions,
    state: Option<StateFunctions>,
    texts: Option<TextFunctions>,
    // The FMU keeps pointers to these.
    _callbacks: Box<Callbacks>,
    /// Must be the last field: the library is unloaded after everything else.
    _library: Library,
}

// SAFETY: an instance is used by one thread at a time, as the standard requires; the thread may change.
unsafe impl Send for Fmi2Instance {}

/// A folder as a URI, which the standard requires for the resources.
fn uri(folder: &Path) -> String {
    let bytes = folder.as_os_str().as_bytes().iter();
    let escaped = bytes.map(|&byte| match byte {
        b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'/' | b'-' | b'_' | b'.' | b'~' => char::from(byte).to_string(),
        other => format!("%{other:02X}"),
    });
    format!("file://{}", escaped.collect::<String>())
}

impl Fmi2Instance {
    pub(super) fn new(
        description: &Description,
        library: &Path,
        folder: &Path,
        name: &str,
        log: &Log,
        guard: Guard,
    ) -> Result<Fmi2Instance, LoadError> {
        let names = [Functions::NAMES, StateFunctions::NAMES, TextFunctions::NAMES];
        let loaded = Library::load(library, &names, guard)?;
        let functions = Functions::load(&loaded)?;
        let state = description
            .capabilities
            .serialise
            .then(|| StateFunctions::load(&loaded))
            .transpose()?;
        let callbacks = Box::new(Callbacks {
            logger: escapement_fmi2_logger as *const c_void,
            allocate: libc::calloc,
            free: libc::free,
            step_finished: std::ptr::null(),
            environment: log.environment(),
        });
        let text = |text: &str| CString::new(text).map_err(|_| LoadError::Path(folder.to_owned()));
        let (name, token) = (text(name)?, text(&description.token)?);
        let resources = text(&uri(&folder.join("resources")))?;
        // SAFETY: the types are those of the standard; the texts outlive the call and the callbacks the instance.
        let component = unsafe {
            (functions.instantiate)(
                name.as_ptr(),
                CO_SIMULATION,
                token.as_ptr(),
                resources.as_ptr(),
                &raw const *callbacks,
                0,
                1,
            )
        };
        if component.is_null() {
            return Err(LoadError::Instantiate(log.take()));
        }
        let two = Fmi2Instance {
            component,
            functions,
            state,
            texts: TextFunctions::load(&loaded).ok(),
            _callbacks: callbacks,
            _library: loaded,
        };
        two.log_failures_only(description);
        Ok(two)
    }

    /// Where the FMU supports log categories, it then formats only messages that are used.
    fn log_failures_only(&self, description: &Description) {
        type SetLogging = unsafe extern "C" fn(Component, c_int, usize, *const *const c_char) -> c_int;
        let categories = failure_categories(description);
        if let (false, Ok(address)) = (categories.is_empty(), self._library.function("fmi2SetDebugLogging")) {
            let pointers: Vec<*const c_char> = categories.iter().map(|name| name.as_ptr()).collect();
            // SAFETY: the standard defines the type of the function with this name; the texts outlive the call.
            unsafe {
                let set = std::mem::transmute::<*mut c_void, SetLogging>(address);
                set(self.component, 1, pointers.len(), pointers.as_ptr());
            }
        }
    }

    fn transfer(&self, values: &mut Values, real: Get, integer: Get, boolean: Get) -> Status {
        let function = match values.native {
            Native::F64 => real,
            Native::I32 => integer,
            Native::Bool32 => boolean,
            _ => return Status::Error,
        };
        let (references, pointer) = (values.references.as_ptr(), values.pointer());
        // SAFETY: FMI 2.0 has scalars only: there is one value for each reference, in suitably aligned memory.
        Status::of(unsafe { function(self.component, references, values.references.len(), pointer) })
    }
}

impl Instance for Fmi2Instance {
    fn configure(&mut self, _entering: bool) -> Status {
        Status::Ok
    }

    fn enter_initialisation(&mut self, start: f64, tolerance: Option<f64>) -> Result<(), (&'static str, Status)> {
        let (defined, tolerance) = (tolerance.is_some().into(), tolerance.unwrap_or(0.0));
        // SAFETY: the instance is alive.
        let status = unsafe { (self.functions.setup_experiment)(self.component, defined, tolerance, start, 0, 0.0) };
        if !Status::of(status).succeeded() {
            return Err(("fmi2SetupExperiment", Status::of(status)));
        }
        // SAFETY: the instance is alive.
        match Status::of(unsafe { (self.functions.enter_initialisation)(self.component) }) {
            status if status.succeeded() => Ok(()),
            status => Err(("fmi2EnterInitializationMode", status)),
        }
    }

    fn exit_initialisation(&mut self) -> Status {
        // SAFETY: the instance is alive.
        Status::of(unsafe { (self.functions.exit_initialisation)(self.component) })
    }

    fn get(&mut self, values: &mut Values) -> Status {
        if values.native == Native::Text {
            let Some(texts) = &self.texts else { return Status::Error };
            let (references, count) = (values.references.as_ptr(), values.references.len());
            let mut given = values.no_pointers();
            // SAFETY: there is space for one pointer for each reference; the texts are copied before the next call of the
            // FMU.
            return unsafe {
                let pointers = given.pointers.as_mut_ptr();
                let status = Status::of((texts.get_string)(self.component, references, count, pointers.cast()));
                if status.succeeded() {
                    values.take(&given);
                }
                status
            };
        }
        let own = &self.functions;
        self.transfer(values, own.get_real, own.get_integer, own.get_boolean)
    }

    fn set(&mut self, values: &mut Values) -> Status {
        let own = &self.functions;
        if values.native == Native::Text {
            let (references, count) = (values.references.as_ptr(), values.references.len());
            let given = values.pointers();
            // SAFETY: one zero-terminated text for each reference.
            return Status::of(unsafe {
                (own.set_string)(self.component, references, count, given.pointers.as_ptr().cast())
            });
        }
        self.transfer(values, own.set_real, own.set_integer, own.set_boolean)
    }

    fn set_text(&mut self, reference: u32, text: Texts<'_>) -> Status {
        let Texts::String(text) = text else {
            return Status::Error;
        };
        // SAFETY: one reference and one text.
        Status::of(unsafe { (self.functions.set_string)(self.component, &raw const reference, 1, &text.as_ptr()) })
    }

    fn step(&mut self, t: f64, step: f64) -> Stepped {
        // SAFETY: the instance is alive and initialised.
        let status = Status::of(unsafe { (self.functions.do_step)(self.component, t, step, 1) });
        let (mut last, mut terminated) = (0.0, 0);
        let mut reached = None;
        if status == Status::Discard {
            // SAFETY: the instance is alive; the standard defines these two functions for exactly this case.
            unsafe {
                let known = (self.functions.get_real_status)(self.component, LAST_SUCCESSFUL_TIME, &raw mut last);
                reached = Status::of(known).succeeded().then_some(last);
                (self.functions.get_boolean_status)(self.component, TERMINATED, &raw mut terminated);
            }
        }
        Stepped {
            status,
            terminate: terminated != 0,
            early: false,
            last: reached,
        }
    }

    fn serialise(&self) -> Result<Vec<u8>, StateError> {
        let Some(own) = &self.state else {
            return Err(StateError::Status("fmi2SerializeFMUstate", Status::Error));
        };
        let check = |name, status: c_int| match Status::of(status) {
            status if status.succeeded() => Ok(()),
            status => Err(StateError::Status(name, status)),
        };
        let mut state = std::ptr::null_mut();
        // SAFETY: the instance is alive; the buffer has the size that the FMU states; the state is freed on every path.
        unsafe {
            check("fmi2GetFMUstate", (own.get)(self.component, &raw mut state))?;
            let mut size = 0;
            let sized = check(
                "fmi2SerializedFMUstateSize",
                (own.size)(self.component, state, &raw mut size),
            );
            let done = sized.and_then(|()| StateError::buffer(size)).and_then(|mut bytes| {
                let status = (own.serialise)(self.component, state, bytes.as_mut_ptr().cast(), size);
                check("fmi2SerializeFMUstate", status).map(|()| bytes)
            });
            (own.free)(self.component, &raw mut state);
            done
        }
    }

    fn deserialise(&mut self, bytes: &[u8]) -> Result<(), (&'static str, Status)> {
        let Some(own) = &self.state else {
            return Err(("fmi2DeSerializeFMUstate", Status::Error));
        };
        let mut state = std::ptr::null_mut();
        // SAFETY: the instance is alive; the bytes are those of an instance of the same FMU, which the caller has checked.
        unsafe {
            let made = (own.deserialise)(self.component, bytes.as_ptr().cast(), bytes.len(), &raw mut state);
            if !Status::of(made).succeeded() {
                return Err(("fmi2DeSerializeFMUstate", Status::of(made)));
            }
            let set = Status::of((own.set)(self.component, state));
            (own.free)(self.component, &raw mut state);
            if set.succeeded() {
                Ok(())
            } else {
                Err(("fmi2SetFMUstate", set))
            }
        }
    }

    fn terminate(&mut self) -> Status {
        // SAFETY: the instance is alive.
        Status::of(unsafe { (self.functions.terminate)(self.component) })
    }

    fn free(&mut self) {
        // SAFETY: the instance is alive, and is not used afterwards.
        unsafe { (self.functions.free_instance)(self.component) }
    }
}
