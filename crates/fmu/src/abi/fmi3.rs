//! Bindings to FMI 3.0.

use std::ffi::{CString, c_char, c_int, c_void};
use std::os::unix::ffi::OsStrExt;
use std::path::Path;

use foreign_calls::Guard;

use super::interface::{Instance, Native, StateError, Status, Stepped, Texts, Values, failure_categories};
use super::library::{Library, LoadError, functions};
use super::log::{Log, log_message};
use crate::description::Description;

type Pointer = *mut c_void;
type LogMessage = unsafe extern "C" fn(Pointer, c_int, *const c_char, *const c_char);
/// Values of any type: references, their number, the values, their number.
type Transfer = unsafe extern "C" fn(Pointer, *const u32, usize, *mut c_void, usize) -> c_int;

functions! {
    Functions {
        instantiate = "fmi3InstantiateCoSimulation": fn(*const c_char, *const c_char, *const c_char, bool, bool, bool, bool, *const u32, usize, Pointer, LogMessage, *const c_void) -> Pointer;
        free_instance = "fmi3FreeInstance": fn(Pointer);
        enter_initialisation = "fmi3EnterInitializationMode": fn(Pointer, bool, f64, f64, bool, f64) -> c_int;
        exit_initialisation = "fmi3ExitInitializationMode": fn(Pointer) -> c_int;
        terminate = "fmi3Terminate": fn(Pointer) -> c_int;
        do_step = "fmi3DoStep": fn(Pointer, f64, f64, bool, *mut u8, *mut u8, *mut u8, *mut f64) -> c_int;
        set_string = "fmi3SetString": fn(Pointer, *const u32, usize, *const *const c_char, usize) -> c_int;
        set_binary = "fmi3SetBinary": fn(Pointer, *const u32, usize, *const usize, *const *const u8, usize) -> c_int;
        get_f64 = "fmi3GetFloat64": fn(Pointer, *const u32, usize, *mut c_void, usize) -> c_int;
        get_f32 = "fmi3GetFloat32": fn(Pointer, *const u32, usize, *mut c_void, usize) -> c_int;
        get_i8 = "fmi3GetInt8": fn(Pointer, *const u32, usize, *mut c_void, usize) -> c_int;
        get_u8 = "fmi3GetUInt8": fn(Pointer, *const u32, usize, *mut c_void, usize) -> c_int;
        get_i16 = "fmi3GetInt16": fn(Pointer, *const u32, usize, *mut c_void, usize) -> c_int;
        get_u16 = "fmi3GetUInt16": fn(Pointer, *const u32, usize, *mut c_void, usize) -> c_int;
        get_i32 = "fmi3GetInt32": fn(Pointer, *const u32, usize, *mut c_void, usize) -> c_int;
        get_u32 = "fmi3GetUInt32": fn(Pointer, *const u32, usize, *mut c_void, usize) -> c_int;
        get_i64 = "fmi3GetInt64": fn(Pointer, *const u32, usize, *mut c_void, usize) -> c_int;
        get_u64 = "fmi3GetUInt64": fn(Pointer, *const u32, usize, *mut c_void, usize) -> c_int;
        get_boolean = "fmi3GetBoolean": fn(Pointer, *const u32, usize, *mut c_void, usize) -> c_int;
        set_f64 = "fmi3SetFloat64": fn(Pointer, *const u32, usize, *mut c_void, usize) -> c_int;
        set_f32 = "fmi3SetFloat32": fn(Pointer, *const u32, usize, *mut c_void, usize) -> c_int;
        set_i8 = "fmi3SetInt8": fn(Pointer, *const u32, usize, *mut c_void, usize) -> c_int;
        set_u8 = "fmi3SetUInt8": fn(Pointer, *const u32, usize, *mut c_void, usize) -> c_int;
        set_i16 = "fmi3SetInt16": fn(Pointer, *const u32, usize, *mut c_void, usize) -> c_int;
        set_u16 = "fmi3SetUInt16": fn(Pointer, *const u32, usize, *mut c_void, usize) -> c_int;
        set_i32 = "fmi3SetInt32": fn(Pointer, *const u32, usize, *mut c_void, usize) -> c_int;
        set_u32 = "fmi3SetUInt32": fn(Pointer, *const u32, usize, *mut c_void, usize) -> c_int;
        set_i64 = "fmi3SetInt64": fn(Pointer, *const u32, usize, *mut c_void, usize) -> c_int;
        set_u64 = "fmi3SetUInt64": fn(Pointer, *const u32, usize, *mut c_void, usize) -> c_int;
        set_boolean = "fmi3SetBoolean": fn(Pointer, *const u32, usize, *mut c_void, usize) -> c_int;
        enter_configuration = "fmi3EnterConfigurationMode": fn(Pointer) -> c_int;
        exit_configuration = "fmi3ExitConfigurationMode": fn(Pointer) -> c_int;
    }
}

functions! {
    /// Loaded only where texts or bytes are read.
    ContentFunctions {
        get_string = "fmi3GetString": fn(Pointer, *const u32, usize, *mut *const c_char, usize) -> c_int;
        get_binary = "fmi3GetBinary": fn(Pointer, *const u32, usize, *mut usize, *mut *const u8, usize) -> c_int;
    }
}

functions! {
    /// Loaded only where the description declares them.
    StateFunctions {
        get = "fmi3GetFMUState": fn(Pointer, *mut Pointer) -> c_int;
        set = "fmi3SetFMUState": fn(Pointer, Pointer) -> c_int;
        free = "fmi3FreeFMUState": fn(Pointer, *mut Pointer) -> c_int;
        size = "fmi3SerializedFMUStateSize": fn(Pointer, Pointer, *mut usize) -> c_int;
        serialise = "fmi3SerializeFMUState": fn(Pointer, Pointer, *mut u8, usize) -> c_int;
        deserialise = "fmi3DeserializeFMUState": fn(Pointer, *const u8, usize, *mut Pointer) -> c_int;
    }
}

/// The bits of an instant that the FMU has not written: a NaN that no computation gives.
const UNWRITTEN: u64 = 0x7ff8_6e6f_7468_696e;

/// An instance.
pub struct Fmi3Instance {
    instance: Pointer,
    functions: Functions,
    state: Option<StateFunctions>,
    contents: Option<ContentFunctions>,
    /// Must be the last field: the library is unloaded after everything else.
    library: Library,
}

// SAFETY: an instance is used by one thread at a time, as the standard requires; the thread may change.
unsafe impl Send for Fmi3Instance {}

impl Fmi3Instance {
    pub(super) fn new(
        description: &Description,
        library: &Path,
        folder: &Path,
        name: &str,
        log: &Log,
        guard: Guard,
    ) -> Result<Fmi3Instance, LoadError> {
        let names = [Functions::NAMES, StateFunctions::NAMES, ContentFunctions::NAMES];
        let loaded = Library::load(library, &names, guard)?;
        let functions = Functions::load(&loaded)?;
        let state = description
            .capabilities
            .serialise
            .then(|| StateFunctions::load(&loaded))
            .transpose()?;
        let wrong = |_| LoadError::Path(folder.to_owned());
        let (name, token) = (
            CString::new(name).map_err(wrong)?,
            CString::new(description.token.as_str()).map_err(wrong)?,
        );
        // A native path with a trailing separator.
        let mut resources = folder.join("resources").as_os_str().as_bytes().to_vec();
        resources.push(b'/');
        let resources = CString::new(resources).map_err(wrong)?;
        // SAFETY: the types are those of the standard; the texts outlive the call. Event mode and early return are
        // declined, so no intermediate update is called.
        let instance = unsafe {
            (functions.instantiate)(
                name.as_ptr(),
                token.as_ptr(),
                resources.as_ptr(),
                false,
                true,
                false,
                false,
                std::ptr::null(),
                0,
                log.environment(),
                log_message,
                std::ptr::null(),
            )
        };
        if instance.is_null() {
            return Err(LoadError::Instantiate(log.take()));
        }
        let three = Fmi3Instance {
            instance,
            functions,
            state,
            contents: ContentFunctions::load(&loaded).ok(),
            library: loaded,
        };
        three.log_failures_only(description);
        Ok(three)
    }

    /// Where the FMU supports log categories, it then formats only messages that are used.
    fn log_failures_only(&self, description: &Description) {
        type SetLogging = unsafe extern "C" fn(Pointer, bool, usize, *const *const c_char) -> c_int;
        let categories = failure_categories(description);
        if let (false, Ok(address)) = (categories.is_empty(), self.library.function("fmi3SetDebugLogging")) {
            let pointers: Vec<*const c_char> = categories.iter().map(|name| name.as_ptr()).collect();
            // SAFETY: the standard defines the type of the function with this name; the texts outlive the call.
            unsafe {
                let set = std::mem::transmute::<*mut c_void, SetLogging>(address);
                set(self.instance, true, pointers.len(), pointers.as_ptr());
            }
        }
    }

    fn transfer(&self, function: Transfer, values: &mut Values) -> Status {
        let (references, pointer) = (values.references.as_ptr(), values.pointer());
        // SAFETY: the memory has space for `count` values of the function's type; an FMU that expects another number must
        // report an error.
        Status::of(unsafe {
            function(
                self.instance,
                references,
                values.references.len(),
                pointer,
                values.count,
            )
        })
    }
}

impl Fmi3Instance {
    fn get_contents(&self, values: &mut Values) -> Status {
        let Some(own) = &self.contents else {
            return Status::Error;
        };
        let (references, count) = (values.references.as_ptr(), values.references.len());
        let mut given = values.no_pointers();
        let (pointers, sizes, room) = (given.pointers.as_mut_ptr(), given.sizes.as_mut_ptr(), values.count);
        // SAFETY: there is space for `count` pointers and sizes; the data they point to is copied before the next call of
        // the FMU.
        unsafe {
            let status = Status::of(match values.native {
                Native::Text => (own.get_string)(self.instance, references, count, pointers.cast(), room),
                _ => (own.get_binary)(self.instance, references, count, sizes, pointers, room),
            });
            if status.succeeded() {
                values.take(&given);
            }
            status
        }
    }

    fn set_contents(&self, values: &Values) -> Status {
        let own = &self.functions;
        let (references, count) = (values.references.as_ptr(), values.references.len());
        let given = values.pointers();
        let (pointers, sizes, room) = (given.pointers.as_ptr(), given.sizes.as_ptr(), values.count);
        // SAFETY: texts are zero-terminated, and the size of bytes is passed as well.
        Status::of(unsafe {
            match values.native {
                Native::Text => (own.set_string)(self.instance, references, count, pointers.cast(), room),
                _ => (own.set_binary)(self.instance, references, count, sizes, pointers, room),
            }
        })
    }
}

impl Instance for Fmi3Instance {
    fn configure(&mut self, entering: bool) -> Status {
        let own = &self.functions;
        let function = if entering {
            own.enter_configuration
        } else {
            own.exit_configuration
        };
        // SAFETY: the instance is alive.
        Status::of(unsafe { function(self.instance) })
    }

    fn enter_initialisation(&mut self, start: f64, tolerance: Option<f64>) -> Result<(), (&'static str, Status)> {
        let (defined, tolerance) = (tolerance.is_some(), tolerance.unwrap_or(0.0));
        let enter = self.functions.enter_initialisation;
        // SAFETY: the instance is alive.
        match Status::of(unsafe { enter(self.instance, defined, tolerance, start, false, 0.0) }) {
            status if status.succeeded() => Ok(()),
            status => Err(("fmi3EnterInitializationMode", status)),
        }
    }

    fn exit_initialisation(&mut self) -> Status {
        // SAFETY: the instance is alive.
        Status::of(unsafe { (self.functions.exit_initialisation)(self.instance) })
    }

    fn get(&mut self, values: &mut Values) -> Status {
        let own = &self.functions;
        let function = match values.native {
            Native::F64 => own.get_f64,
            Native::F32 => own.get_f32,
            Native::I8 => own.get_i8,
            Native::U8 => own.get_u8,
            Native::I16 => own.get_i16,
            Native::U16 => own.get_u16,
            Native::I32 => own.get_i32,
            Native::U32 => own.get_u32,
            Native::I64 => own.get_i64,
            Native::U64 => own.get_u64,
            Native::Bool8 => own.get_boolean,
            Native::Bool32 => return Status::Error,
            Native::Text | Native::Binary => return self.get_contents(values),
        };
        self.transfer(function, values)
    }

    fn set(&mut self, values: &mut Values) -> Status {
        let own = &self.functions;
        let function = match values.native {
            Native::F64 => own.set_f64,
            Native::F32 => own.set_f32,
            Native::I8 => own.set_i8,
            Native::U8 => own.set_u8,
            Native::I16 => own.set_i16,
            Native::U16 => own.set_u16,
            Native::I32 => own.set_i32,
            Native::U32 => own.set_u32,
            Native::I64 => own.set_i64,
            Native::U64 => own.set_u64,
            Native::Bool8 => own.set_boolean,
            Native::Bool32 => return Status::Error,
            Native::Text | Native::Binary => return self.set_contents(values),
        };
        self.transfer(function, values)
    }

    fn set_text(&mut self, reference: u32, text: Texts<'_>) -> Status {
        let reference = &raw const reference;
        // SAFETY: one reference and one text or one byte array, whose size is passed as well.
        Status::of(unsafe {
            match text {
                Texts::String(text) => (self.functions.set_string)(self.instance, reference, 1, &text.as_ptr(), 1),
                Texts::Binary(bytes) => {
                    (self.functions.set_binary)(self.instance, reference, 1, &bytes.len(), &bytes.as_ptr(), 1)
                }
            }
        })
    }

    fn step(&mut self, t: f64, step: f64) -> Stepped {
        // Bytes, not `bool`: the FMU may write any value. An instant that it does not write stays unknown; one that it writes may be NaN too.
        let (mut event, mut terminate, mut early, mut last) = (0_u8, 0_u8, 0_u8, UNWRITTEN);
        let do_step = self.functions.do_step;
        // SAFETY: the instance is alive and initialised.
        let status = unsafe {
            do_step(
                self.instance,
                t,
                step,
                true,
                &raw mut event,
                &raw mut terminate,
                &raw mut early,
                (&raw mut last).cast(),
            )
        };
        Stepped {
            status: Status::of(status),
            terminate: terminate != 0,
            early: early != 0,
            last: (last != UNWRITTEN).then(|| f64::from_bits(last)),
        }
    }

    fn serialise(&self) -> Result<Vec<u8>, StateError> {
        let Some(own) = &self.state else {
            return Err(StateError::Status("fmi3SerializeFMUState", Status::Error));
        };
        let check = |name, status: c_int| match Status::of(status) {
            status if status.succeeded() => Ok(()),
            status => Err(StateError::Status(name, status)),
        };
        let mut state = std::ptr::null_mut();
        // SAFETY: the instance is alive; the buffer has the size that the FMU states; the state is freed on every path.
        unsafe {
            check("fmi3GetFMUState", (own.get)(self.instance, &raw mut state))?;
            let mut size = 0;
            let sized = check(
                "fmi3SerializedFMUStateSize",
                (own.size)(self.instance, state, &raw mut size),
            );
            let done = sized.and_then(|()| StateError::buffer(size)).and_then(|mut bytes| {
                let status = (own.serialise)(self.instance, state, bytes.as_mut_ptr(), size);
                check("fmi3SerializeFMUState", status).map(|()| bytes)
            });
            (own.free)(self.instance, &raw mut state);
            done
        }
    }

    fn deserialise(&mut self, bytes: &[u8]) -> Result<(), (&'static str, Status)> {
        let Some(own) = &self.state else {
            return Err(("fmi3DeserializeFMUState", Status::Error));
        };
        let mut state = std::ptr::null_mut();
        // SAFETY: the instance is alive; the bytes are those of an instance of the same FMU, which the caller has checked.
        unsafe {
            let made = (own.deserialise)(self.instance, bytes.as_ptr(), bytes.len(), &raw mut state);
            if !Status::of(made).succeeded() {
                return Err(("fmi3DeserializeFMUState", Status::of(made)));
            }
            let set = Status::of((own.set)(self.instance, state));
            (own.free)(self.instance, &raw mut state);
            if set.succeeded() {
                Ok(())
            } else {
                Err(("fmi3SetFMUState", set))
            }
        }
    }

    fn terminate(&mut self) -> Status {
        // SAFETY: the instance is alive.
        Status::of(unsafe { (self.functions.terminate)(self.instance) })
    }

    fn free(&mut self) {
        // SAFETY: the instance is alive, and is not used afterwards.
        unsafe { (self.functions.free_instance)(self.instance) }
    }
}
