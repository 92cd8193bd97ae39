//! The host's side of the ABI: the functions offered to a participant, and what the participant has reported.

use std::cell::{Cell, RefCell};
use std::ffi::{CString, c_char, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};

use foreign_calls::{Guard, with_default_modes};
use lockstep::participant::{Input, Interface, Kind, Log, Output, ParameterError, Setup, state::too_large};
use lockstep::port::Descriptor;
use lockstep::random::Stream;

use crate::message::descriptor;
use crate::parameters::{Found, Parameters};
use crate::table::{self, CONTINUOUS, FAILED, Host, Message, OK, SAMPLED, SEEN_EVER, SEEN_NOW, Status};

/// The host structure of a participant, with the data behind it. Foreign code sees only the first field.
#[repr(C)]
pub(crate) struct HostContext {
    pub(crate) host: Host,
    pub(crate) data: HostData,
}

/// What a participant has reported, and the data that it may read.
pub(crate) struct HostData {
    pub(crate) name: String,
    /// For the calls of its functions.
    pub(crate) guard: Guard,
    /// The text that the host's `name` points to.
    _c_name: CString,
    seed: u64,
    parameters: Parameters,
    document: CString,
    texts: RefCell<Vec<CString>>,
    /// Whether `describe` is running.
    pub(crate) describing: Cell<bool>,
    pub(crate) kind: Cell<Option<Kind>>,
    pub(crate) inputs: RefCell<Vec<Input>>,
    pub(crate) outputs: RefCell<Vec<Output>>,
    /// The first rejection.
    pub(crate) refusal: RefCell<Option<ParameterError>>,
    /// Why the current call fails.
    pub(crate) failure: RefCell<Option<String>>,
    /// The state that `save` returned.
    pub(crate) state: RefCell<Option<Vec<u8>>>,
    /// Why the last `save` failed.
    pub(crate) unsaved: RefCell<Option<String>>,
    /// The instant of the current call, s.
    pub(crate) now: Cell<Option<f64>>,
    /// For each output, whether the sample being written is seen, and whether any is, as bits.
    pub(crate) seen: RefCell<Vec<u32>>,
    /// The destination of log lines of the current call; `None` outside of a run.
    pub(crate) log: RefCell<Option<Log>>,
    /// Why the participant was terminated.
    pub(crate) termination: Cell<u32>,
}

impl HostContext {
    pub(crate) fn new(setup: &Setup) -> HostContext {
        let c_name = CString::new(setup.name.as_str()).unwrap_or_default();
        let parameters = Parameters::new(setup.parameters.clone());
        let document = CString::new(parameters.text()).unwrap_or_default();
        HostContext {
            host: Host {
                size: size_of::<Host>() as u32,
                abi: table::ABI,
                name: c_name.as_ptr(),
                seed: setup.seed,
                period: setup.period,
                offset: setup.offset,
                kind,
                input,
                output,
                numbers,
                integer,
                flag,
                text,
                parameters: whole,
                refuse,
                fail,
                log,
                state,
                uniform,
                normal,
                seen,
                termination,
            },
            data: HostData {
                name: setup.name.clone(),
                guard: Guard::new(&setup.name, |function| {
                    format!(
                        "its function `{function}` called exit(): a participant ends with its run; to give up, return escapement_fail(…)"
                    )
                }),
                _c_name: c_name,
                seed: setup.seed,
                parameters,
                document,
                texts: RefCell::default(),
                describing: Cell::new(false),
                kind: Cell::new(None),
                inputs: RefCell::default(),
                outputs: RefCell::default(),
                refusal: RefCell::default(),
                failure: RefCell::default(),
                state: RefCell::default(),
                unsaved: RefCell::default(),
                now: Cell::new(None),
                seen: RefCell::default(),
                log: RefCell::default(),
                termination: Cell::new(0),
            },
        }
    }
}

impl HostData {
    /// Keeps the first rejection: later ones may follow from it.
    fn refuse(&self, error: ParameterError) -> Status {
        self.refusal.borrow_mut().get_or_insert(error);
        FAILED
    }

    /// Writes a line to the log, at the instant of the current call.
    pub(crate) fn log_line(&self, text: &str) {
        let log = self.log.borrow().clone();
        let log = log.unwrap_or_else(|| Log::new(&self.name, None));
        match self.now.get() {
            Some(t) => log.at(t).write(text),
            None => log.write(text),
        }
    }

    /// The interface that the participant has described, or why it cannot be used.
    pub(crate) fn interface(&self) -> Result<Interface, ParameterError> {
        if let Some(refusal) = self.refusal.take() {
            return Err(refusal);
        }
        let Some(kind) = self.kind.get() else {
            let reason = "its `describe` does not say how outputs depend on inputs: call host->kind(host, ESCAPEMENT_SAMPLED) or \
                          ESCAPEMENT_CONTINUOUS";
            return Err(ParameterError::new(crate::NO_PARTICIPANT, reason));
        };
        if let Some(unknown) = self.parameters.unknown() {
            return Err(unknown);
        }
        let interface = Interface {
            kind,
            inputs: self.inputs.borrow().clone(),
            outputs: self.outputs.borrow().clone(),
        };
        match interface.validate() {
            Ok(()) => Ok(interface),
            Err(error) => {
                let reason = format!("it describes invalid ports: {error}");
                Err(ParameterError::new(crate::NO_PARTICIPANT, reason))
            }
        }
    }

    fn refuse_ports(&self, reason: impl Into<String>) -> Status {
        self.refuse(ParameterError::new(crate::NO_PARTICIPANT, reason.into()))
    }

    /// Delivers a value that foreign code requests by calling `put`, if there is one.
    fn deliver<T>(&self, found: impl FnOnce() -> Found<T>, put: impl FnOnce(T)) -> Status {
        if !self.describing.get() {
            return self.fail("parameters can be read in `describe` only");
        }
        match found() {
            Ok(value) => {
                if let Some(value) = value {
                    put(value);
                }
                OK
            }
            Err(error) => self.refuse(error),
        }
    }

    fn fail(&self, reason: &str) -> Status {
        self.failure.borrow_mut().get_or_insert_with(|| reason.to_owned());
        FAILED
    }
}

/// Does `work` for the participant behind `host`, not with its floating-point modes. Panics do not propagate into foreign code.
///
/// # Safety
/// `host` must be the one that the participant was given.
unsafe fn with_data(host: *const Host, work: impl FnOnce(&HostData) -> Status) -> Status {
    if host.is_null() {
        return FAILED;
    }
    // SAFETY: every host that foreign code has is the first field of a host context, which lives until the end of `terminate`.
    let data = unsafe { &(*host.cast::<HostContext>()).data };
    catch_unwind(AssertUnwindSafe(|| with_default_modes(|| work(data)))).unwrap_or(FAILED)
}

/// Reads a text of foreign code.
///
/// # Safety
/// As for [`table::text`].
unsafe fn foreign_text<'a>(at: *const c_char) -> Option<&'a str> {
    // SAFETY: the caller guarantees that it is null or ends with a zero byte.
    unsafe { table::text(at) }
}

unsafe extern "C" fn kind(host: *const Host, kind: u32) -> Status {
    let work = |data: &HostData| {
        data.kind.set(match kind {
            SAMPLED => Some(Kind::Sampled),
            CONTINUOUS => Some(Kind::Continuous),
            other => return data.refuse_ports(format!("its kind is {other}: 1 is sampled, 2 is continuous")),
        });
        OK
    };
    // SAFETY: foreign code passes the host that it was given.
    unsafe { with_data(host, work) }
}

/// Adds a port by calling `put` with its name and descriptor.
///
/// # Safety
/// All arguments must satisfy the ABI.
unsafe fn port(
    host: *const Host,
    name: *const c_char,
    message: *const Message,
    what: &str,
    put: impl FnOnce(&HostData, String, Descriptor),
) -> Status {
    let work = |data: &HostData| {
        if !data.describing.get() {
            return data.fail("ports can be added in `describe` only");
        }
        // SAFETY: the name is null or ends with a zero byte and the message satisfies the ABI, as the caller guarantees.
        let (name, descriptor) = unsafe { (foreign_text(name), descriptor(message)) };
        let Some(name) = name else {
            return data.refuse_ports(format!("an {what} has no name (it is NULL, or not UTF-8)"));
        };
        match descriptor {
            Ok(descriptor) => put(data, name.to_owned(), descriptor),
            Err(reason) => return data.refuse_ports(format!("{what} `{name}`: {reason}")),
        }
        OK
    };
    // SAFETY: the caller guarantees that the host is null or the one that it was given.
    unsafe { with_data(host, work) }
}

unsafe extern "C" fn input(host: *const Host, name: *const c_char, message: *const Message, required: u32) -> Status {
    let put = |data: &HostData, name, descriptor| {
        data.inputs.borrow_mut().push(Input {
            name,
            descriptor,
            required: required != 0,
        });
    };
    // SAFETY: foreign code keeps the rules of the ABI.
    unsafe { port(host, name, message, "input", put) }
}

unsafe extern "C" fn output(host: *const Host, name: *const c_char, message: *const Message) -> Status {
    let put = |data: &HostData, name, descriptor| data.outputs.borrow_mut().push(Output { name, descriptor });
    // SAFETY: foreign code keeps the rules of the ABI.
    unsafe { port(host, name, message, "output", put) }
}

/// Reads the key of a parameter.
///
/// # Safety
/// As for [`table::text`].
unsafe fn key<'a>(key: *const c_char) -> Result<&'a str, ParameterError> {
    // SAFETY: the caller guarantees that the key is null or ends with a zero byte.
    unsafe { foreign_text(key) }.ok_or_else(|| {
        ParameterError::new(
            crate::NO_PARTICIPANT,
            "it asks for a parameter whose key is NULL or not UTF-8",
        )
    })
}

unsafe extern "C" fn numbers(
    host: *const Host,
    name: *const c_char,
    unit: *const c_char,
    required: u32,
    values: *mut f64,
    count: u32,
) -> Status {
    let work = |data: &HostData| {
        // SAFETY: texts satisfy the ABI.
        let found = || unsafe {
            let unit = foreign_text(unit).unwrap_or_default();
            data.parameters.numbers(key(name)?, unit, required != 0, count as usize)
        };
        let put = |found: Vec<f64>| {
            // SAFETY: there is room for as many as were requested, and exactly that many were found.
            unsafe { std::ptr::copy_nonoverlapping(found.as_ptr(), values, found.len()) };
        };
        data.deliver(found, put)
    };
    // SAFETY: foreign code passes the host that it was given.
    unsafe { with_data(host, work) }
}

unsafe extern "C" fn integer(host: *const Host, name: *const c_char, required: u32, value: *mut i64) -> Status {
    let work = |data: &HostData| {
        // SAFETY: texts and places satisfy the ABI.
        let found = || unsafe { data.parameters.integer(key(name)?, required != 0) };
        // SAFETY: as above.
        data.deliver(found, |found| unsafe { value.write(found) })
    };
    // SAFETY: foreign code passes the host that it was given.
    unsafe { with_data(host, work) }
}

unsafe extern "C" fn flag(host: *const Host, name: *const c_char, required: u32, value: *mut u8) -> Status {
    let work = |data: &HostData| {
        // SAFETY: texts and places satisfy the ABI.
        let found = || unsafe { data.parameters.flag(key(name)?, required != 0) };
        // SAFETY: as above.
        data.deliver(found, |found| unsafe { value.write(found.into()) })
    };
    // SAFETY: foreign code passes the host that it was given.
    unsafe { with_data(host, work) }
}

unsafe extern "C" fn text(host: *const Host, name: *const c_char, required: u32, value: *mut *const c_char) -> Status {
    let work = |data: &HostData| {
        // SAFETY: texts and places satisfy the ABI.
        let key = unsafe { key(name) };
        let found = || {
            let key = key?;
            let found = data.parameters.string(key, required != 0)?;
            let own = found.map(CString::new).transpose();
            own.map_err(|_| ParameterError::new(key, "the text has a zero byte in it"))
        };
        data.deliver(found, |found| {
            // SAFETY: the place is one for an address; the text does not move when the list grows.
            unsafe { value.write(found.as_ptr()) };
            data.texts.borrow_mut().push(found);
        })
    };
    // SAFETY: foreign code passes the host that it was given.
    unsafe { with_data(host, work) }
}

unsafe extern "C" fn whole(host: *const Host) -> *const c_char {
    let mut document = std::ptr::null();
    let work = |data: &HostData| {
        data.parameters.all_are_read();
        document = data.document.as_ptr();
        OK
    };
    // SAFETY: foreign code passes the host that it was given.
    unsafe { with_data(host, work) };
    document
}

unsafe extern "C" fn refuse(host: *const Host, name: *const c_char, reason: *const c_char) -> Status {
    let work = |data: &HostData| {
        // SAFETY: texts satisfy the ABI.
        let (key, reason) = unsafe { (foreign_text(name).unwrap_or_default(), table::lossy_text(reason)) };
        data.refuse(ParameterError::new(
            key,
            reason.unwrap_or("refused without a reason".into()),
        ))
    };
    // SAFETY: foreign code passes the host that it was given.
    unsafe { with_data(host, work) }
}

unsafe extern "C" fn fail(host: *const Host, reason: *const c_char) -> Status {
    // SAFETY: texts satisfy the ABI; foreign code passes the host that it was given.
    unsafe {
        with_data(host, |data| {
            data.fail(&table::lossy_text(reason).unwrap_or("without a reason".into()))
        })
    }
}

unsafe extern "C" fn log(host: *const Host, text: *const c_char) {
    let work = |data: &HostData| {
        // SAFETY: texts satisfy the ABI.
        let text = unsafe { table::lossy_text(text) }.unwrap_or("(NULL in the place of a text)".into());
        data.log_line(&text);
        OK
    };
    // SAFETY: foreign code passes the host that it was given.
    unsafe { with_data(host, work) };
}

unsafe extern "C" fn seen(host: *const Host, output: u32) -> u32 {
    // An unknown output counts as seen.
    let mut seen = SEEN_NOW | SEEN_EVER;
    let work = |data: &HostData| {
        seen = data.seen.borrow().get(output as usize).copied().unwrap_or(seen);
        OK
    };
    // SAFETY: foreign code passes the host that it was given.
    unsafe { with_data(host, work) };
    seen
}

unsafe extern "C" fn termination(host: *const Host) -> u32 {
    let mut why = 0;
    let work = |data: &HostData| {
        why = data.termination.get();
        OK
    };
    // SAFETY: foreign code passes the host that it was given.
    unsafe { with_data(host, work) };
    why
}

unsafe extern "C" fn state(host: *const Host, bytes: *const c_void, size: u64) -> Status {
    let work = |data: &HostData| {
        if let Some(reason) = too_large(size) {
            // Also so that a wrong size does not make the host read what is not there.
            return data.fail(&reason);
        }
        let bytes = match (bytes.is_null(), usize::try_from(size)) {
            (true, Ok(0)) => Vec::new(),
            // SAFETY: there are as many bytes as foreign code states.
            (false, Ok(size)) => unsafe { std::slice::from_raw_parts(bytes.cast::<u8>(), size) }.to_vec(),
            _ => return data.fail("its `save` gave a state at NULL"),
        };
        *data.state.borrow_mut() = Some(bytes);
        OK
    };
    // SAFETY: foreign code passes the host that it was given.
    unsafe { with_data(host, work) }
}

/// A draw from a random stream of the run's seed.
///
/// # Safety
/// As for [`with_data`].
unsafe fn draw(host: *const Host, stream: *const c_char, number: impl FnOnce(&Stream) -> f64) -> f64 {
    let mut drawn = f64::NAN;
    let work = |data: &HostData| {
        // SAFETY: texts satisfy the ABI.
        let Some(name) = (unsafe { foreign_text(stream) }) else {
            return data.fail("it draws from a stream whose name is NULL or not UTF-8");
        };
        drawn = number(&Stream::new(data.seed, name));
        OK
    };
    // SAFETY: the caller guarantees that the host is null or the one that it was given.
    unsafe { with_data(host, work) };
    drawn
}

unsafe extern "C" fn uniform(host: *const Host, stream: *const c_char, index: u64) -> f64 {
    // SAFETY: foreign code passes the host that it was given.
    unsafe { draw(host, stream, |stream| stream.uniform(index)) }
}

unsafe extern "C" fn normal(host: *const Host, stream: *const c_char, index: u64) -> f64 {
    // SAFETY: foreign code passes the host that it was given.
    unsafe { draw(host, stream, |stream| stream.normal(index)) }
}
