//! Exporting participants written in Rust as a plug-in: the participant's side of the ABI.

use std::cell::Cell;
use std::ffi::{CString, c_void};
use std::mem::offset_of;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use lockstep::participant::{
    Inputs, Interface, Kind, Line, Log, Outputs, ParameterError, Participant, Setup, Sink, Step, Termination,
};
use lockstep::port::{Descriptor, Element};

use crate::table::{self, Field, Host, Message, OK, RANK_MAX, Status};

/// Makes a plug-in of participants: each has a name and a function that creates it from its setup.
///
/// ```no_run
/// use lockstep::participant::{ParameterError, Participant, Setup};
///
/// # fn make(_: &Setup) -> Result<Box<dyn Participant>, ParameterError> { Err(ParameterError::new("", "an example")) }
/// plugin::export! {
///     "lander" => make,
/// }
/// ```
///
/// The library's `Cargo.toml` needs `crate-type = ["cdylib"]`, and a scenario `run = { library = "…/libmine.so" }`.
#[macro_export]
macro_rules! export {
    ($($name:literal => $make:expr),+ $(,)?) => {
        /// The tables of this library's participants, for the host that loads it.
        #[unsafe(no_mangle)]
        pub extern "C" fn escapement_plugin(index: u32) -> *const $crate::table::Table {
            static TABLES: &[$crate::table::Table] = &[$({
                enum Own {}
                impl $crate::__private::Export for Own {
                    fn make(
                        setup: &$crate::__private::Setup,
                    ) -> Result<Box<dyn $crate::__private::Participant>, $crate::__private::ParameterError> {
                        ($make)(setup)
                    }
                }
                $crate::__private::table::<Own>(
                    concat!($name, "\0"),
                    concat!(env!("CARGO_PKG_VERSION"), "\0"),
                )
            }),+];
            TABLES.get(index as usize).map_or(std::ptr::null(), std::ptr::from_ref)
        }
    };
}

#[doc(hidden)]
pub mod __private {
    pub use lockstep::participant::{ParameterError, Participant, Setup};

    use crate::table::{ABI, Table};

    /// A participant of a plug-in.
    pub trait Export {
        /// Creates the participant.
        ///
        /// # Errors
        /// A parameter that it rejects.
        fn make(setup: &Setup) -> Result<Box<dyn Participant>, ParameterError>;
    }

    /// The participant's table. Both texts must end with a zero byte.
    pub const fn table<E: Export>(name: &'static str, version: &'static str) -> Table {
        Table {
            size: size_of::<Table>() as u32,
            abi: ABI,
            name: name.as_ptr().cast(),
            version: version.as_ptr().cast(),
            own_size: 0,
            state_size: 0,
            describe: Some(super::describe::<E>),
            initialise: Some(super::initialise),
            step: Some(super::step),
            save: Some(super::save),
            restore: Some(super::restore),
            terminate: Some(super::terminate),
        }
    }
}

/// A participant with its own buffers.
struct PluginInstance {
    participant: Box<dyn Participant>,
    interface: Interface,
    inputs: Inputs,
    outputs: Outputs,
    /// Whether the participant has panicked: its state may be inconsistent, so it is not called again.
    panicked: Cell<bool>,
}

/// The log of the host, which adds the name and the time.
struct HostLog(*const Host);

// SAFETY: the host exists until the end of `terminate`, at the same address, and only the participant's own calls write to it, which are
// sequential.
unsafe impl Send for HostLog {}
// SAFETY: as above.
unsafe impl Sync for HostLog {}

impl Sink for HostLog {
    fn write_line(&self, line: &Line<'_>) {
        // SAFETY: the host exists, and copies the text.
        unsafe { ((*self.0).log)(self.0, text(&line.text.to_string()).as_ptr()) }
    }
}

/// Why the participant is terminated; `None` for one that was not initialised. An older host without this function counts as `STOPPED`.
///
/// # Safety
/// The host must be the one of the call.
unsafe fn termination(host: *const Host) -> Option<Termination> {
    // SAFETY: every host has a `size`.
    let size = unsafe { (*host).size } as usize;
    if size <= offset_of!(Host, termination) {
        return Some(Termination::Stopped);
    }
    // SAFETY: the host is large enough to have the function.
    match unsafe { ((*host).termination)(host) } {
        0 => None,
        table::FINISHED => Some(Termination::Finished),
        table::REPLACED => Some(Termination::Replaced),
        _ => Some(Termination::Stopped),
    }
}

/// Text for C; zero bytes, which a C string cannot contain, are removed.
fn text(text: &str) -> CString {
    CString::new(text.replace('\0', "")).unwrap_or_default()
}

/// Does `work` and reports a failure to the host. Panics do not propagate.
fn catch_failure(host: *const Host, work: impl FnOnce() -> Result<(), String>) -> Status {
    let failure = match catch_unwind(AssertUnwindSafe(work)) {
        Ok(Ok(())) => return OK,
        Ok(Err(failure)) => failure,
        Err(panic) => {
            let message = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
            let message = message.or_else(|| panic.downcast_ref::<String>().cloned());
            format!("it panicked: {}", message.as_deref().unwrap_or("without a message"))
        }
    };
    // SAFETY: the host is the one of the call, and copies the text.
    unsafe { ((*host).fail)(host, text(&failure).as_ptr()) }
}

/// # Safety
/// `own` must be the pointer that `describe` returned.
unsafe fn instance_at<'a>(own: *mut c_void) -> &'a mut PluginInstance {
    // SAFETY: the caller guarantees the pointer of `describe`; the host's calls are sequential, so nothing else refers to it.
    unsafe { &mut *own.cast::<PluginInstance>() }
}

impl PluginInstance {
    fn unless_panicked(&mut self, work: impl FnOnce(&mut PluginInstance) -> Result<(), String>) -> Result<(), String> {
        if self.panicked.replace(true) {
            return Err("it panicked before".into());
        }
        let done = work(self);
        self.panicked.set(false);
        done
    }
}

unsafe extern "C-unwind" fn describe<E: __private::Export>(host: *const Host, place: *mut *mut c_void) -> Status {
    let work = || {
        // SAFETY: the host exists during the call and longer.
        let offered = unsafe { &*host };
        // SAFETY: the host provides texts.
        let (name, document) = unsafe { (table::text(offered.name), table::text((offered.parameters)(host))) };
        let parameters = document.unwrap_or_default().parse::<toml::Table>();
        let setup = Setup {
            name: name.unwrap_or_default().to_owned(),
            parameters: parameters.map_err(|error| error.to_string())?,
            seed: offered.seed,
            period: offered.period,
            offset: offered.offset,
        };
        let participant = match E::make(&setup) {
            Ok(participant) => participant,
            Err(ParameterError { key, reason }) => {
                // SAFETY: the host copies the texts.
                unsafe { (offered.refuse)(host, text(&key).as_ptr(), text(&reason).as_ptr()) };
                return Err(reason);
            }
        };
        let interface = participant.interface();
        // SAFETY: the host is the one of the call.
        unsafe { report_ports(host, offered, &interface)? };
        let (inputs, mut outputs) = (Inputs::zeroed(&interface), Outputs::zeroed(&interface));
        outputs.set_log(Log::new(&setup.name, Some(Arc::new(HostLog(host)))));
        let own = Box::new(PluginInstance {
            participant,
            interface,
            inputs,
            outputs,
            panicked: Cell::new(false),
        });
        // SAFETY: the host provides the place.
        unsafe { place.write(Box::into_raw(own).cast()) };
        Ok(())
    };
    catch_failure(host, work)
}

/// Reports the ports to the host.
///
/// # Safety
/// The host must be the one of the call.
unsafe fn report_ports(host: *const Host, offered: &Host, interface: &Interface) -> Result<(), String> {
    let kind = match interface.kind {
        Kind::Sampled => table::SAMPLED,
        Kind::Continuous => table::CONTINUOUS,
    };
    // SAFETY: the host is the one of the call.
    let mut status = unsafe { (offered.kind)(host, kind) };
    for port in &interface.inputs {
        let name = text(&port.name);
        status |= with_message(&port.descriptor, |message| {
            // SAFETY: the host copies everything.
            unsafe { (offered.input)(host, name.as_ptr(), message, port.required.into()) }
        })?;
    }
    for port in &interface.outputs {
        let name = text(&port.name);
        status |= with_message(&port.descriptor, |message| {
            // SAFETY: the host copies everything.
            unsafe { (offered.output)(host, name.as_ptr(), message) }
        })?;
    }
    if status == OK {
        Ok(())
    } else {
        Err("its ports are refused".into())
    }
}

fn with_message(descriptor: &Descriptor, give: impl FnOnce(*const Message) -> Status) -> Result<Status, String> {
    let words: Vec<[CString; 3]> = (descriptor.fields.iter())
        .map(|field| {
            // The values of an enumeration are in the place of the unit.
            let unit = match &field.values[..] {
                [] => text(&field.unit),
                values => {
                    let each: Vec<String> = values
                        .iter()
                        .map(|one| format!("{} = {}", one.name, one.value))
                        .collect();
                    text(&each.join(", "))
                }
            };
            [text(&field.name), unit, text(&field.frame)]
        })
        .collect();
    let mut fields = Vec::new();
    for (field, [name, unit, frame]) in descriptor.fields.iter().zip(&words) {
        // The room of a text is its last extent.
        let room = field.element.room().map(|room| room as u32);
        let shape: Vec<u32> = field.shape.iter().copied().chain(room).collect();
        let mut extents = [0; RANK_MAX];
        let Some(places) = extents.get_mut(..shape.len()) else {
            return Err(format!("field `{}` has more than {RANK_MAX} extents", field.name));
        };
        places.copy_from_slice(&shape);
        let element = match field.element {
            Element::Text(_) => table::TEXT,
            Element::Bytes(_) => table::BYTES,
            other => {
                let place = table::ELEMENTS.iter().position(|element| *element == other);
                place.map_or(0, |place| place as u32 + 1)
            }
        };
        fields.push(Field {
            name: name.as_ptr(),
            unit: unit.as_ptr(),
            frame: frame.as_ptr(),
            element,
            offset: field.offset,
            rank: shape.len() as u32,
            extents,
        });
    }
    let name = text(&descriptor.name);
    let message = Message {
        name: name.as_ptr(),
        fields: fields.as_ptr(),
        field_count: fields.len() as u32,
        size: descriptor.size,
    };
    Ok(give(&raw const message))
}

/// Copies the outputs from the host's buffers to the participant's, does `work`, and copies them back.
///
/// # Safety
/// `places` must be those of the call.
unsafe fn with_outputs(
    own: &mut PluginInstance,
    places: *const *mut c_void,
    work: impl FnOnce(&mut PluginInstance) -> Result<(), String>,
) -> Result<(), String> {
    let size = |own: &PluginInstance, port: usize| own.interface.outputs[port].descriptor.size as usize;
    for port in 0..own.interface.outputs.len() {
        // SAFETY: the host provides a buffer of the size of each output.
        let place = unsafe { std::slice::from_raw_parts((*places.add(port)).cast::<u8>(), size(own, port)) };
        own.outputs.bytes_mut(port).copy_from_slice(place);
    }
    work(own)?;
    for port in 0..own.interface.outputs.len() {
        // SAFETY: as above.
        let place = unsafe { std::slice::from_raw_parts_mut((*places.add(port)).cast::<u8>(), size(own, port)) };
        place.copy_from_slice(own.outputs.bytes_mut(port));
    }
    Ok(())
}

unsafe extern "C-unwind" fn initialise(
    host: *const Host,
    at: *mut c_void,
    t: f64,
    outputs: *const *mut c_void,
) -> Status {
    let start = |own: &mut PluginInstance| {
        own.participant
            .initialise(t, &mut own.outputs)
            .map_err(|error| error.to_string())
    };
    // SAFETY: the arguments are those of the call.
    catch_failure(host, || unsafe {
        instance_at(at).unless_panicked(|own| with_outputs(own, outputs, start))
    })
}

unsafe extern "C-unwind" fn step(
    host: *const Host,
    at: *mut c_void,
    step: *const table::Step,
    inputs: *const *const c_void,
    outputs: *const *mut c_void,
) -> Status {
    let go = |own: &mut PluginInstance| {
        // SAFETY: the step is the one of the call.
        let step = unsafe { &*step };
        for (port, about) in own.interface.inputs.iter().enumerate() {
            let size = about.descriptor.size as usize;
            // SAFETY: the host provides the bytes of each input.
            let place = unsafe { std::slice::from_raw_parts((*inputs.add(port)).cast::<u8>(), size) };
            own.inputs.bytes_mut(port).copy_from_slice(place);
        }
        let step = Step {
            index: step.index,
            t: step.t,
            t_next: step.t_next,
            period: step.period,
        };
        let done = own.participant.step(&step, &own.inputs, &mut own.outputs);
        done.map_err(|error| error.to_string())
    };
    // SAFETY: the arguments are those of the call.
    catch_failure(host, || unsafe {
        instance_at(at).unless_panicked(|own| with_outputs(own, outputs, go))
    })
}

unsafe extern "C-unwind" fn save(host: *const Host, at: *mut c_void) -> Status {
    catch_failure(host, || {
        // SAFETY: the arguments are those of the call.
        let own = unsafe { instance_at(at) };
        own.unless_panicked(|own| {
            let Some(state) = own.participant.save() else {
                return own.participant.save_failure().map_or(Ok(()), Err);
            };
            // SAFETY: the host copies the bytes.
            unsafe { ((*host).state)(host, state.as_ptr().cast(), state.len() as u64) };
            Ok(())
        })
    })
}

unsafe extern "C-unwind" fn restore(host: *const Host, at: *mut c_void, bytes: *const c_void, size: u64) -> Status {
    catch_failure(host, || {
        // SAFETY: the arguments are those of the call.
        let (own, state) = unsafe {
            (
                instance_at(at),
                std::slice::from_raw_parts(bytes.cast::<u8>(), size as usize),
            )
        };
        own.unless_panicked(|own| own.participant.restore(state).map_err(|error| error.to_string()))
    })
}

unsafe extern "C-unwind" fn terminate(host: *const Host, at: *mut c_void) {
    catch_failure(host, || {
        // SAFETY: `describe` created it from a box, and it is not used again.
        let mut own = unsafe { Box::from_raw(at.cast::<PluginInstance>()) };
        // SAFETY: the host is the one of the call.
        let why = unsafe { termination(host) };
        if let Some(why) = why.filter(|_| !own.panicked.get()) {
            let log = own.outputs.log_of().clone();
            own.participant.terminate(why, &log);
        }
        Ok(())
    });
}
