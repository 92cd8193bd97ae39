//! The types of the C ABI. `escapement.h` has the same types with the same names in C; a test compares sizes and offsets.
//!
//! A struct that may grow begins with its size: its reader must not use a field that lies beyond that size. [`Field`] and [`Message`] are
//! elements of lists and never change within one version. Texts are UTF-8 and end with a zero byte.

use std::borrow::Cow;
use std::ffi::{CStr, c_char, c_void};

/// The version of the ABI. A table of another version is rejected.
pub const ABI: u32 = 1;

/// What a function returns: [`OK`] or [`FAILED`].
pub type Status = i32;
/// The call succeeded.
pub const OK: Status = 0;
/// The call failed; [`Host::fail`] or [`Host::refuse`] gives the reason. Any other value means the same.
pub const FAILED: Status = 1;

/// Computes at t from the inputs at t: [`lockstep::participant::Kind::Sampled`].
pub const SAMPLED: u32 = 1;
/// Integrates from t to the next instant: [`lockstep::participant::Kind::Continuous`].
pub const CONTINUOUS: u32 = 2;

/// The element types of fields: f64, f32, i64, i32, u64, u32, u8, i8, i16, u16, bool, enum are 1 to 12, text and bytes [`TEXT`] and
/// [`BYTES`].
pub const ELEMENTS: [lockstep::port::Element; 12] = {
    use lockstep::port::Element;
    [
        Element::F64,
        Element::F32,
        Element::I64,
        Element::I32,
        Element::U64,
        Element::U32,
        Element::U8,
        Element::I8,
        Element::I16,
        Element::U16,
        Element::Bool,
        Element::Enum,
    ]
};

/// The element type of texts. The last extent of a field is the room of each text, bytes.
pub const TEXT: u32 = 13;
/// The element type of bytes, whose number (32 bits) precedes their room.
pub const BYTES: u32 = 14;

/// The most extents that a field may have.
pub const RANK_MAX: usize = 4;

/// A field of a message.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct Field {
    /// Its name, unique in the message.
    pub name: *const c_char,
    /// The unit of every element; `1` for a dimensionless number and for a truth value. For an enumeration, its values with their names:
    /// `closed = 0, open = 1`.
    pub unit: *const c_char,
    /// The frame in which a vector's components are given; empty or null where a frame has no meaning.
    pub frame: *const c_char,
    /// The type of each element: its position in [`ELEMENTS`] plus one, or [`TEXT`] or [`BYTES`].
    pub element: u32,
    /// The offset of the field in the payload, bytes.
    pub offset: u32,
    /// The number of extents; 0 for a scalar.
    pub rank: u32,
    /// The extents, outermost first.
    pub extents: [u32; RANK_MAX],
}

/// The description of a payload.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct Message {
    /// The name of the message type.
    pub name: *const c_char,
    /// The fields in the order of their offsets, without gaps between them.
    pub fields: *const Field,
    /// The number of fields.
    pub field_count: u32,
    /// The size of a payload, bytes.
    pub size: u32,
}

/// The instant of an activation.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct Step {
    /// The size of this struct, bytes.
    pub size: u32,
    /// Zero.
    pub reserved: u32,
    /// The number of the activation, from 0.
    pub index: u64,
    /// Its instant, s.
    pub t: f64,
    /// The next instant, s.
    pub t_next: f64,
    /// The period, s.
    pub period: f64,
}

/// The host's services for a participant. It exists from the call of `describe` to the end of `terminate`, at the same address, and for
/// this participant alone.
#[repr(C)]
#[derive(Debug)]
pub struct Host {
    /// The size of this struct, bytes.
    pub size: u32,
    /// The host's [`ABI`].
    pub abi: u32,
    /// The participant's name in the scenario.
    pub name: *const c_char,
    /// The seed of the run.
    pub seed: u64,
    /// The sample period, s.
    pub period: f64,
    /// The instant of the first activation, s.
    pub offset: f64,
    /// In `describe`: sets how outputs depend on inputs, [`SAMPLED`] or [`CONTINUOUS`]. This call is required.
    pub kind: unsafe extern "C" fn(host: *const Host, kind: u32) -> Status,
    /// In `describe`: adds an input, which the scenario must connect if `required` is not 0. The message is copied.
    pub input:
        unsafe extern "C" fn(host: *const Host, name: *const c_char, message: *const Message, required: u32) -> Status,
    /// In `describe`: adds an output. The message is copied.
    pub output: unsafe extern "C" fn(host: *const Host, name: *const c_char, message: *const Message) -> Status,
    /// In `describe`: reads `count` numbers below the dotted `key`. With a `unit`, the scenario gives them as text with any unit of its
    /// dimension; without one (null, empty, `1`) as plain numbers. A `count` of 0 means one number without brackets.
    pub numbers: unsafe extern "C" fn(
        host: *const Host,
        key: *const c_char,
        unit: *const c_char,
        required: u32,
        values: *mut f64,
        count: u32,
    ) -> Status,
    /// In `describe`: reads an integer.
    pub integer: unsafe extern "C" fn(host: *const Host, key: *const c_char, required: u32, value: *mut i64) -> Status,
    /// In `describe`: reads true (1) or false (0).
    pub flag: unsafe extern "C" fn(host: *const Host, key: *const c_char, required: u32, value: *mut u8) -> Status,
    /// In `describe`: reads a text, which the host owns and keeps until the end of `terminate`.
    pub text:
        unsafe extern "C" fn(host: *const Host, key: *const c_char, required: u32, value: *mut *const c_char) -> Status,
    /// All parameters as a TOML document, for a participant that reads them itself. The host owns the text and keeps it.
    pub parameters: unsafe extern "C" fn(host: *const Host) -> *const c_char,
    /// In `describe`: rejects the parameter `key`; null or empty when the rejection concerns all of them. Both texts are copied. Returns
    /// [`FAILED`].
    pub refuse: unsafe extern "C" fn(host: *const Host, key: *const c_char, reason: *const c_char) -> Status,
    /// Reports why the current call fails. The text is copied. Returns [`FAILED`].
    pub fail: unsafe extern "C" fn(host: *const Host, reason: *const c_char) -> Status,
    /// Writes a line to the participant's log, with the simulated time; mainly for `initialise`, `step` and `terminate`.
    pub log: unsafe extern "C" fn(host: *const Host, text: *const c_char),
    /// In `save`: passes the state. The bytes are copied.
    pub state: unsafe extern "C" fn(host: *const Host, bytes: *const c_void, size: u64) -> Status,
    /// Draw number `index` of the random stream `stream` of the run's seed, uniform in [0, 1).
    pub uniform: unsafe extern "C" fn(host: *const Host, stream: *const c_char, index: u64) -> f64,
    /// The same with the standard normal distribution.
    pub normal: unsafe extern "C" fn(host: *const Host, stream: *const c_char, index: u64) -> f64,
    /// In `initialise` and `step`: whether the sample of output number `output` that is being written is seen (bit [`SEEN_NOW`]), and
    /// whether any sample of it in the run is (bit [`SEEN_EVER`]). Older hosts do not have this function: check `size`.
    pub seen: unsafe extern "C" fn(host: *const Host, output: u32) -> u32,
    /// In `terminate`: why the participant's part in the run is over, [`FINISHED`], [`STOPPED`] or [`REPLACED`]; 0 for one that has never
    /// begun, and in every other function. Older hosts do not have this function: check `size`.
    pub termination: unsafe extern "C" fn(host: *const Host) -> u32,
}

/// The participant has done all of its activations.
pub const FINISHED: u32 = 1;
/// The run ends earlier.
pub const STOPPED: u32 = 2;
/// Another participant replaces it.
pub const REPLACED: u32 = 3;

/// See [`Host::seen`].
pub const SEEN_NOW: u32 = 1;
/// See [`Host::seen`].
pub const SEEN_EVER: u32 = 2;

/// A participant: its name and its functions. `own` is the participant's own data.
///
/// The calls for one participant are sequential, but not always from the same thread; those for different participants may be concurrent.
/// So all data belongs into `own`, not into globals.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct Table {
    /// The size of this struct, bytes.
    pub size: u32,
    /// The [`ABI`] for which the table was compiled.
    pub abi: u32,
    /// The name of the participant.
    pub name: *const c_char,
    /// Its version.
    pub version: *const c_char,
    /// The number of bytes that the host allocates as `own`: zeroed, aligned to 16, freed by the host after `terminate`. With 0 the
    /// participant creates `own` itself in `describe`.
    pub own_size: u64,
    /// The number of leading bytes of `own` that are the whole state: saved and restored unchanged, so without pointers. With
    /// [`STATELESS`] there is nothing to save; with 0, unless there is a `save`, the participant cannot be saved.
    pub state_size: u64,
    /// Creates the participant: describes its ports and reads its parameters. Must not be null. On failure it frees what it has created.
    pub describe: Option<unsafe extern "C-unwind" fn(host: *const Host, own: *mut *mut c_void) -> Status>,
    /// Called once before the first step; a continuous participant writes its outputs at t. May be null.
    pub initialise: Option<
        unsafe extern "C-unwind" fn(host: *const Host, own: *mut c_void, t: f64, outputs: *const *mut c_void) -> Status,
    >,
    /// One activation: reads the inputs, in the order in which they were added, and writes the outputs. Must not be null.
    pub step: Option<
        unsafe extern "C-unwind" fn(
            host: *const Host,
            own: *mut c_void,
            step: *const Step,
            inputs: *const *const c_void,
            outputs: *const *mut c_void,
        ) -> Status,
    >,
    /// Passes the whole state to [`Host::state`]. May be null.
    pub save: Option<unsafe extern "C-unwind" fn(host: *const Host, own: *mut c_void) -> Status>,
    /// Restores a state from `save`, possibly in another process, and checks it: it may come from a file. Null exactly if `save` is.
    pub restore: Option<
        unsafe extern "C-unwind" fn(host: *const Host, own: *mut c_void, bytes: *const c_void, size: u64) -> Status,
    >,
    /// The participant's part is over, for the reason of [`Host::termination`]. Frees what `describe` has created, and is called once for
    /// each participant that `describe` has created. May be null.
    pub terminate: Option<unsafe extern "C-unwind" fn(host: *const Host, own: *mut c_void)>,
}

// SAFETY: a table is read-only, and its functions may be called from any thread: that is part of its contract.
unsafe impl Sync for Table {}
// SAFETY: as above.
unsafe impl Send for Table {}

/// The function by which a library provides its tables: number `index`, null after the last one. Called `escapement_plugin`.
pub type Plugin = unsafe extern "C" fn(index: u32) -> *const Table;

/// Why a table cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum TableError {
    /// There is no table.
    #[error("the table of its functions is NULL")]
    Missing,
    /// It was compiled for another version.
    #[error("its table is of ABI version {0}, and this program has {ABI}: compile it with this program's escapement.h")]
    Version(u32),
    /// It is too small for its version.
    #[error(
        "its table says that it has {0} bytes, and one of ABI version {ABI} has {size}: begin it with ESCAPEMENT_TABLE of \
         escapement.h",
        size = size_of::<Table>()
    )]
    Size(u32),
    /// A name that is missing or not valid text.
    #[error("its table has no {0} (it is NULL, or not UTF-8)")]
    Text(&'static str),
    /// A required function is missing.
    #[error("its function `{0}` is NULL: every participant needs `describe` and `step`")]
    Function(&'static str),
    /// One of two functions that belong together is missing.
    #[error("its function `{missing}` is NULL, but `{there}` is not: give both or none")]
    Half {
        /// The function that is present.
        there: &'static str,
        /// The function that is missing.
        missing: &'static str,
    },
    /// An implausible size.
    #[error("its own_size is {0} bytes; at most {OWN_MAX} are allowed: make `own` in `describe`, with own_size 0")]
    Own(u64),
    /// A state that is larger than `own`.
    #[error("its state_size is {state} bytes, and its own_size {own}: the state is the beginning of `own`")]
    State {
        /// `state_size`, bytes.
        state: u64,
        /// `own_size`, bytes.
        own: u64,
    },
}

/// The largest `own_size`, bytes.
pub const OWN_MAX: u64 = 1 << 30;

/// A `state_size`: the participant has no state.
pub const STATELESS: u64 = u64::MAX;

/// Checks whether a table can be used.
///
/// # Errors
/// The first thing that is wrong with it.
///
/// # Safety
/// `table` must be null, or point to a table whose first two fields can be read, and all of it if they are right; it must exist to the
/// end.
pub unsafe fn check(table: *const Table) -> Result<&'static Table, TableError> {
    if table.is_null() {
        return Err(TableError::Missing);
    }
    // SAFETY: the caller guarantees that the first two fields can be read.
    let (size, abi) = unsafe { ((*table).size, (*table).abi) };
    if abi != ABI {
        return Err(TableError::Version(abi));
    }
    if (size as usize) < size_of::<Table>() {
        return Err(TableError::Size(size));
    }
    // SAFETY: they are right, so all of it can be read.
    let table = unsafe { &*table };
    // SAFETY: texts of a table end with a zero byte and stay valid.
    unsafe {
        text(table.name).ok_or(TableError::Text("name"))?;
        text(table.version).ok_or(TableError::Text("version"))?;
    }
    let missing = [("describe", table.describe.is_none()), ("step", table.step.is_none())];
    if let Some((function, _)) = missing.into_iter().find(|(_, missing)| *missing) {
        return Err(TableError::Function(function));
    }
    let half = |there, missing| Err(TableError::Half { there, missing });
    match (table.save.is_some(), table.restore.is_some()) {
        (true, false) => half("save", "restore"),
        (false, true) => half("restore", "save"),
        _ if table.own_size > OWN_MAX => Err(TableError::Own(table.own_size)),
        _ if table.state_size != STATELESS && table.state_size > table.own_size => Err(TableError::State {
            state: table.state_size,
            own: table.own_size,
        }),
        _ => Ok(table),
    }
}

impl Table {
    /// The name of the participant.
    pub fn name(&self) -> &str {
        // SAFETY: checked in `check`.
        unsafe { text(self.name) }.unwrap_or_default()
    }

    /// Name and version.
    pub fn program(&self) -> String {
        // SAFETY: checked in `check`.
        let version = unsafe { text(self.version) }.unwrap_or_default();
        format!("{} {version}", self.name())
    }
}

/// A text for people at `at`, with the replacement character where it is not UTF-8; `None` when it is null.
///
/// # Safety
/// As for [`text`].
pub(crate) unsafe fn lossy_text<'a>(at: *const c_char) -> Option<Cow<'a, str>> {
    // SAFETY: read only if it is not null; then the caller guarantees a zero byte at its end.
    (!at.is_null()).then(|| unsafe { CStr::from_ptr(at) }.to_string_lossy())
}

/// The text at `at`; `None` when it is null or not UTF-8.
///
/// # Safety
/// `at` must be null or point to bytes with a zero at their end, which do not change for the lifetime `'a`.
pub(crate) unsafe fn text<'a>(at: *const c_char) -> Option<&'a str> {
    if at.is_null() {
        return None;
    }
    // SAFETY: it is not null, so the caller guarantees a zero byte at its end.
    unsafe { CStr::from_ptr(at) }.to_str().ok()
}
