//! Errors of tapes: one enumeration for each family of operations.

use std::io;
use std::path::PathBuf;

use lockstep::port::DescriptorError;
use lockstep::time::{Rational, TickError};

/// Why a set of streams cannot be recorded on a tape.
#[derive(Debug, thiserror::Error)]
pub enum SpecError {
    /// A name that is not safe as part of a file name.
    #[error("`{name}` is not the name of a {what}: use 1 to 96 ASCII letters, digits, `_` and `-`")]
    Name {
        /// `participant` or `port`.
        what: &'static str,
        /// The name.
        name: String,
    },
    /// Two streams with the same name.
    #[error("stream `{stream}` is declared twice: give one of the two ports another name")]
    Repeated {
        /// The stream.
        stream: String,
    },
    /// A period of zero or less.
    #[error("stream `{stream}`: the period is {period} and must be positive")]
    Period {
        /// The stream.
        stream: String,
        /// Its period.
        period: Rational,
    },
    /// A first index that no run reaches.
    #[error("stream `{stream}`: the first index {index} is beyond 2^62")]
    FirstIndex {
        /// The stream.
        stream: String,
        /// The index.
        index: u64,
    },
    /// Offset and period have no common tick.
    #[error("stream `{stream}`: {source}")]
    SampleTime {
        /// The stream.
        stream: String,
        /// What is wrong.
        source: TickError,
    },
    /// The payload's descriptor is invalid.
    #[error("stream `{stream}`: {source}")]
    Descriptor {
        /// The stream.
        stream: String,
        /// What is wrong.
        source: DescriptorError,
    },
    /// A name, unit or frame with a character that is a separator in the descriptor's canonical text.
    #[error("stream `{stream}`: `{}` contains `|` or a control character: choose another name, unit or frame", text.escape_debug())]
    Text {
        /// The stream.
        stream: String,
        /// The text.
        text: String,
    },
    /// More streams than allowed.
    #[error("{count} streams; at most {max} are allowed")]
    TooMany {
        /// The number of streams.
        count: usize,
        /// The limit.
        max: usize,
    },
}

/// Why a tape could not be created.
#[derive(Debug, thiserror::Error)]
pub enum CreateError {
    /// The streams are invalid.
    #[error(transparent)]
    Spec(#[from] SpecError),
    /// A tape already exists.
    #[error("{} already holds a tape: choose another folder or remove it", path.display())]
    Exists {
        /// The folder.
        path: PathBuf,
    },
    /// The file system returned an error.
    #[error("{}: cannot {action}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The operation.
        action: &'static str,
        /// The system's error.
        source: io::Error,
    },
}

/// Why a sample or an event was not recorded. No part of it is on the tape then, and what was there before is intact.
#[derive(Debug, thiserror::Error)]
pub enum AppendError {
    /// No such stream.
    #[error("there is no stream number {stream}; the tape has {count}")]
    Stream {
        /// The number.
        stream: usize,
        /// How many streams there are.
        count: usize,
    },
    /// A gap or a repetition in the indices.
    #[error("stream `{stream}`: sample {index} came where sample {expected} was due")]
    Index {
        /// The stream.
        stream: String,
        /// The received index.
        index: u64,
        /// The expected index.
        expected: u64,
    },
    /// The stamp is not the instant that belongs to the index.
    #[error("stream `{stream}`, sample {index}: stamped {stamp_s:?} s, but its sample time requires {expected_s:?} s")]
    Stamp {
        /// The stream.
        stream: String,
        /// The index.
        index: u64,
        /// The received stamp, s.
        stamp_s: f64,
        /// The instant of the index, s.
        expected_s: f64,
    },
    /// The payload has the wrong size.
    #[error("stream `{stream}`, sample {index}: {size} bytes came, its descriptor has {expected}")]
    Size {
        /// The stream.
        stream: String,
        /// The index.
        index: u64,
        /// The received size, bytes.
        size: usize,
        /// The size according to the descriptor, bytes.
        expected: usize,
    },
    /// No space on the device or in the quota. The tape stays readable up to the last complete record on the disk.
    #[error(
        "{}: no more than {written} bytes of this file can be written ({source}): free some space, raise the limit on the size of files \
         (ulimit -f), or record to another disk; what is on the tape can be read",
        path.display()
    )]
    DiskFull {
        /// The file.
        path: PathBuf,
        /// How many bytes of the file are on the disk.
        written: u64,
        /// The system's error.
        source: io::Error,
    },
    /// The file system returned another error.
    #[error("{}: writing failed after {written} bytes: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// How many bytes of the file are on the disk.
        written: u64,
        /// The system's error.
        source: io::Error,
    },
}

/// Why a tape, or a part of it, cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// There is no index, and so no tape.
    #[error("{} holds no tape (there is no index.json in it): name a run folder or its `tape` folder", path.display())]
    NoTape {
        /// The folder.
        path: PathBuf,
    },
    /// The user has no permission to read the folder.
    #[error("{}: cannot be read: {source}; a run folder is accessible only to the user who recorded it, until that user runs \
        `chmod a+rx` on it", path.display())]
    NoAccess {
        /// The required file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// The file system returned an error.
    #[error("{}: cannot read: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// A file of another program or of another version.
    #[error("{}: format `{format}` version {version}; this program reads `{expected}` version {expected_version}: use the program that recorded it",
        path.display(), expected = super::format::FORMAT_NAME, expected_version = super::FORMAT_VERSION)]
    Format {
        /// The file.
        path: PathBuf,
        /// The format it states.
        format: String,
        /// The version it states.
        version: u32,
    },
    /// A file is damaged.
    #[error("{} is damaged: {reason}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// A stream differs from what was sealed when the run ended.
    #[error("{}: stream `{stream}` is damaged: it has {found}, and seal.json has {sealed}; take the tape from another copy, or run again", path.display())]
    Altered {
        /// The file.
        path: PathBuf,
        /// The stream.
        stream: String,
        /// The current content.
        found: String,
        /// The sealed content.
        sealed: String,
    },
    /// The index describes invalid streams.
    #[error("{} is damaged: {source}", path.display())]
    Spec {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: SpecError,
    },
    /// Records beyond the end.
    #[error("stream `{stream}` has {count} records; number {record} was asked for")]
    Range {
        /// The stream.
        stream: String,
        /// The first record that does not exist.
        record: u64,
        /// How many records there are.
        count: u64,
    },
    /// A time window that contains no instant.
    #[error("the last instant, {to}, is before the first one, {from}: the window is empty")]
    Window {
        /// The first requested instant.
        from: Rational,
        /// The last requested instant.
        to: Rational,
    },
    /// A time window without any sample, on a tape that has samples.
    #[error(
        "no sample {}: the selected streams have samples from {first_s:?} s to {last_s:?} s; choose a window that contains one of their instants",
        window(requested)
    )]
    Outside {
        /// The first and the last requested instant, if any.
        requested: Box<[Option<Rational>; 2]>,
        /// The first instant with a sample, s.
        first_s: f64,
        /// The last instant with a sample, s.
        last_s: f64,
    },
    /// No stream of that name or number.
    #[error("there is no stream `{name}`; the tape has {available}")]
    NoStream {
        /// The requested name.
        name: String,
        /// The names that exist.
        available: String,
    },
    /// No field of that name.
    #[error("stream `{stream}` has no field `{field}`; it has {available}")]
    NoField {
        /// The stream.
        stream: String,
        /// The requested field.
        field: String,
        /// The names that exist.
        available: String,
    },
}

/// Where a requested window lies.
fn window(requested: &[Option<Rational>; 2]) -> String {
    match requested {
        [Some(from), Some(to)] => format!("lies from {from} to {to}"),
        [Some(from), None] => format!("lies at or after {from}"),
        [None, Some(to)] => format!("lies at or before {to}"),
        [None, None] => "is selected".to_owned(),
    }
}
