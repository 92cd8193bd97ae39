//! Common interface to both versions of the standard: statuses, values, and the calls of an instance.

use std::ffi::{CStr, c_void};

use lockstep::participant::state::too_large;
use lockstep::port::Element;

use crate::description::{Description, Type, Version};

/// The status of a call.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// Success.
    Ok,
    /// Success, with a warning in the log.
    Warning,
    /// Rejected; the FMU is unchanged.
    Discard,
    /// Failed; this instance is unusable.
    Error,
    /// Failed, and all instances of this FMU are unusable.
    Fatal,
    /// Pending, which is never requested, or an undefined status.
    Unknown(i32),
}

impl Status {
    pub(super) fn of(number: i32) -> Status {
        match number {
            0 => Status::Ok,
            1 => Status::Warning,
            2 => Status::Discard,
            3 => Status::Error,
            4 => Status::Fatal,
            other => Status::Unknown(other),
        }
    }

    /// Whether the call succeeded.
    pub fn succeeded(self) -> bool {
        matches!(self, Status::Ok | Status::Warning)
    }

    /// "returned Error".
    pub fn text(self) -> String {
        match self {
            Status::Unknown(5) => "returned Pending: it works asynchronously, which nobody has asked it for".to_owned(),
            Status::Unknown(other) => format!("returned {other}, which is no status"),
            status => format!("returned {status:?}"),
        }
    }
}

/// The types of values with a separate function of the library each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[allow(missing_docs, reason = "the names are the standard's")]
pub enum Native {
    F64,
    F32,
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    /// `fmi2Boolean`, an int.
    Bool32,
    /// `fmi3Boolean`, a byte.
    Bool8,
    /// Pointers to zero-terminated texts.
    Text,
    /// Pointers to bytes, with separate sizes.
    Binary,
}

impl Native {
    /// The function for variables of `kind`; none for clocks.
    pub fn of(version: Version, kind: Type) -> Option<Native> {
        Some(match (version, kind) {
            (_, Type::Float64) => Native::F64,
            (Version::Fmi2, Type::Int32 | Type::Enumeration) => Native::I32,
            (Version::Fmi2, Type::Boolean) => Native::Bool32,
            (Version::Fmi3, Type::Float32) => Native::F32,
            (Version::Fmi3, Type::Int8) => Native::I8,
            (Version::Fmi3, Type::UInt8) => Native::U8,
            (Version::Fmi3, Type::Int16) => Native::I16,
            (Version::Fmi3, Type::UInt16) => Native::U16,
            (Version::Fmi3, Type::Int32) => Native::I32,
            (Version::Fmi3, Type::UInt32) => Native::U32,
            (Version::Fmi3, Type::Int64 | Type::Enumeration) => Native::I64,
            (Version::Fmi3, Type::UInt64) => Native::U64,
            (Version::Fmi3, Type::Boolean) => Native::Bool8,
            (_, Type::String) => Native::Text,
            (Version::Fmi3, Type::Binary) => Native::Binary,
            _ => return None,
        })
    }

    /// The number type of a field with the same byte representation; none for values that are not numbers.
    pub const fn element(self) -> Option<Element> {
        Some(match self {
            Native::F64 => Element::F64,
            Native::F32 => Element::F32,
            Native::I8 => Element::I8,
            Native::U8 => Element::U8,
            Native::I16 => Element::I16,
            Native::U16 => Element::U16,
            Native::I32 => Element::I32,
            Native::U32 => Element::U32,
            Native::I64 => Element::I64,
            Native::U64 => Element::U64,
            Native::Bool32 | Native::Bool8 | Native::Text | Native::Binary => return None,
        })
    }

    /// Bytes of one value; texts and bytes have no fixed size.
    pub const fn size(self) -> usize {
        match self {
            Native::F64 | Native::I64 | Native::U64 => 8,
            Native::F32 | Native::I32 | Native::U32 | Native::Bool32 => 4,
            Native::I16 | Native::U16 => 2,
            Native::I8 | Native::U8 | Native::Bool8 => 1,
            Native::Text | Native::Binary => 0,
        }
    }
}

/// Values of variables of one type, in suitably aligned memory.
#[derive(Debug, Clone)]
pub struct Values {
    /// The function that reads or sets them.
    pub native: Native,
    /// The variables.
    pub references: Vec<u32>,
    /// The total number of their values.
    pub count: usize,
    words: Vec<u64>,
    /// Zero-terminated texts, or bytes.
    contents: Vec<Vec<u8>>,
    /// The number of bytes of each that the FMU has given: of a longer one than `content_max` nothing is copied.
    lengths: Vec<usize>,
    content_max: usize,
}

/// Pointers to texts or bytes in the form that functions expect and return, with the sizes.
pub(crate) struct Pointers {
    pub(crate) pointers: Vec<*const u8>,
    pub(crate) sizes: Vec<usize>,
}

impl Values {
    /// Creates values that are all zero.
    pub fn new(native: Native, references: Vec<u32>, count: usize) -> Values {
        let mut values = Values {
            native,
            references,
            count: 0,
            words: Vec::new(),
            contents: Vec::new(),
            lengths: Vec::new(),
            content_max: 0,
        };
        values.grow(count);
        values
    }

    /// Adds a variable with `count` values that are zero.
    pub fn push(&mut self, reference: u32, count: usize) {
        self.references.push(reference);
        self.grow(count);
    }

    fn grow(&mut self, count: usize) {
        self.count += count;
        self.words.resize((self.count * self.native.size()).div_ceil(8), 0);
        if let Native::Text | Native::Binary = self.native {
            let empty = Vec::from_iter((self.native == Native::Text).then_some(0));
            self.contents.resize(self.count, empty);
            self.lengths.resize(self.count, 0);
        }
    }

    /// Pointers to the texts or bytes, which must not be changed while the pointers are used.
    pub(super) fn pointers(&self) -> Pointers {
        Pointers {
            pointers: self.contents.iter().map(|one| one.as_ptr()).collect(),
            sizes: self.contents.iter().map(Vec::len).collect(),
        }
    }

    /// Space for the pointers that a function returns.
    pub(crate) fn no_pointers(&self) -> Pointers {
        Pointers {
            pointers: vec![std::ptr::null(); self.count],
            sizes: vec![0; self.count],
        }
    }

    /// Lets texts and bytes of so many bytes be copied from the FMU, which states the sizes, and may be wrong by any factor.
    pub fn make_room(&mut self, bytes: usize) {
        self.content_max = self.content_max.max(bytes);
    }

    /// Copies the texts or bytes that a function returned, unless they are too long. A null pointer is an empty value.
    ///
    /// # Safety
    /// Each pointer is null, or points to a zero-terminated text, or to as many bytes as its size states, or to any place where that is more
    /// than the limit.
    pub(crate) unsafe fn take(&mut self, given: &Pointers) {
        let own = self.contents.iter_mut().zip(&mut self.lengths);
        for ((content, length), (pointer, size)) in own.zip(given.pointers.iter().zip(&given.sizes)) {
            let terminated = self.native == Native::Text;
            *length = match (pointer.is_null(), terminated) {
                (true, _) => 0,
                // SAFETY: it is not null, and the caller guarantees that a text ends with a zero byte.
                (false, true) => unsafe { CStr::from_ptr(pointer.cast()) }.count_bytes(),
                (false, false) => *size,
            };
            content.clear();
            if *length > 0 && *length <= self.content_max {
                // SAFETY: the caller guarantees as many bytes as the length, which is within the limit.
                content.extend(unsafe { std::slice::from_raw_parts(*pointer, *length) });
            }
            content.extend(terminated.then_some(0));
        }
    }

    /// The number of bytes of text or bytes number `index` that the FMU has given, where they are too many to be copied.
    pub fn excess(&self, index: usize) -> Option<usize> {
        Some(self.lengths[index]).filter(|length| *length > self.content_max)
    }

    /// Text or bytes number `index`.
    pub fn content(&self, index: usize) -> &[u8] {
        let own = &self.contents[index];
        &own[..own.len() - usize::from(self.native == Native::Text)]
    }

    /// Sets text or bytes number `index`. A text must contain no zero.
    pub fn put_content(&mut self, index: usize, content: &[u8]) {
        let own = &mut self.contents[index];
        own.clear();
        own.extend(content);
        own.extend((self.native == Native::Text).then_some(0));
    }

    pub(super) fn pointer(&mut self) -> *mut c_void {
        self.words.as_mut_ptr().cast()
    }

    /// All values that are not texts, concatenated.
    pub fn as_bytes(&self) -> &[u8] {
        bytemuck::cast_slice(&self.words)
    }

    /// The same, mutable.
    pub fn as_bytes_mut(&mut self) -> &mut [u8] {
        bytemuck::cast_slice_mut(&mut self.words)
    }

    /// Value number `index` as bytes, in its own size.
    pub fn bytes(&self, index: usize) -> [u8; 8] {
        let (size, mut bytes) = (self.native.size(), [0; 8]);
        let at = index * size;
        let word = self.words[at / 8].to_ne_bytes();
        bytes[..size].copy_from_slice(&word[at % 8..at % 8 + size]);
        bytes
    }

    /// Sets value number `index`.
    pub fn put(&mut self, index: usize, bytes: &[u8]) {
        let size = self.native.size();
        let at = index * size;
        let mut word = self.words[at / 8].to_ne_bytes();
        word[at % 8..at % 8 + size].copy_from_slice(&bytes[..size]);
        self.words[at / 8] = u64::from_ne_bytes(word);
    }
}

/// The values of text variables to be set.
pub enum Texts<'a> {
    /// A string.
    String(&'a std::ffi::CStr),
    /// Bytes (FMI 3.0).
    Binary(&'a [u8]),
}

/// The result of a step.
#[derive(Debug, Clone, Copy)]
pub struct Stepped {
    /// The status.
    pub status: Status,
    /// The FMU requests the end of the simulation.
    pub terminate: bool,
    /// The step ended early at [`Stepped::last`], which is not permitted.
    pub early: bool,
    /// The instant that the FMU reached, s, where it reports it.
    pub last: Option<f64>,
}

/// Why an instance has no serialised state.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum StateError {
    /// The function that failed, and its status.
    Status(&'static str, Status),
    /// The state is too large.
    Size(String),
}

impl StateError {
    /// Memory for a state of the size that the FMU states, which may be wrong by any factor.
    pub(super) fn buffer(size: usize) -> Result<Vec<u8>, StateError> {
        match too_large(size as u64) {
            Some(reason) => Err(StateError::Size(reason)),
            None => Ok(vec![0; size]),
        }
    }
}

/// One instance of an FMU for co-simulation.
pub trait Instance: Send {
    /// Enters configuration mode, or leaves it if `entering` is false (FMI 3.0).
    fn configure(&mut self, entering: bool) -> Status;
    /// Sets the start time, and enters initialization mode.
    fn enter_initialisation(&mut self, start: f64, tolerance: Option<f64>) -> Result<(), (&'static str, Status)>;
    /// Leaves initialization mode.
    fn exit_initialisation(&mut self) -> Status;
    /// Reads values.
    fn get(&mut self, values: &mut Values) -> Status;
    /// Sets values.
    fn set(&mut self, values: &mut Values) -> Status;
    /// Sets the variable `reference` to text or bytes.
    fn set_text(&mut self, reference: u32, text: Texts<'_>) -> Status;
    /// From `t` to `t + step`, s.
    fn step(&mut self, t: f64, step: f64) -> Stepped;
    /// The serialised state.
    fn serialise(&self) -> Result<Vec<u8>, StateError>;
    /// Restores the state.
    fn deserialise(&mut self, bytes: &[u8]) -> Result<(), (&'static str, Status)>;
    /// Terminates the simulation, if it has begun.
    fn terminate(&mut self) -> Status;
    /// Frees the instance. No function may be called afterwards.
    fn free(&mut self);
}

/// The log categories for failures: messages of all others would be formatted and discarded.
pub(super) fn failure_categories(description: &Description) -> Vec<std::ffi::CString> {
    let words = ["error", "fatal", "discard", "warning"];
    let failures = description.log_categories.iter().filter(|name| {
        let name = name.to_lowercase();
        words.iter().any(|word| name.contains(word))
    });
    failures
        .filter_map(|name| std::ffi::CString::new(name.as_str()).ok())
        .collect()
}
