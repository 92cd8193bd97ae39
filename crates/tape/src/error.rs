//! One error enum per family of operations.

use std::io;
use std::path::PathBuf;

use lockstep::port::DescriptorError;
use lockstep::time::{Rational, TickError};

/// Why a set of streams cannot be put on a tape.
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
    /// Two streams of the same name.
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
    /// The payload's description is unsound.
    #[error("stream `{stream}`: {source}")]
    Descriptor {
        /// The stream.
        stream: String,
        /// What is wrong.
        source: DescriptorError,
    },
    /// A name, unit or frame with a character that the descriptor's canonical text separates by.
    #[error("stream `{stream}`: `{}` contains `|` or a control character: choose another name, unit or frame", text.escape_debug())]
    Text {
        /// The stream.
        stream: String,
        /// The text.
        text: String,
    },
    /// More streams than any run has.
    #[error("{count} streams; at most {max} are allowed")]
    TooMany {
        /// How many.
        count: usize,
        /// The limit.
        max: usize,
    },
}

/// Why a tape could not be created.
#[derive(Debug, thiserror::Error)]
pub enum CreateError {
    /// The streams are not fit for a tape.
    #[error(transparent)]
    Spec(#[from] SpecError),
    /// There is a tape already.
    #[error("{} already holds a tape: choose another folder or remove it", path.display())]
    Exists {
        /// The folder.
        path: PathBuf,
    },
    /// The file system refused.
    #[error("{}: cannot {action}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What was tried.
        action: &'static str,
        /// What the system said.
        source: io::Error,
    },
}

/// Why a sample or an event was not recorded. Nothing of it is on the tape then, and what was there before is intact.
#[derive(Debug, thiserror::Error)]
pub enum AppendError {
    /// No such stream.
    #[error("there is no stream number {stream}; the tape has {count}")]
    Stream {
        /// The number.
        stream: usize,
        /// How many there are.
        count: usize,
    },
    /// A gap or a repetition.
    #[error("stream `{stream}`: sample {index} came where sample {expected} was due")]
    Index {
        /// The stream.
        stream: String,
        /// The index that came.
        index: u64,
        /// The index that was due.
        expected: u64,
    },
    /// The stamp is not the instant that belongs to the index.
    #[error("stream `{stream}`, sample {index}: stamped {stamp_s:?} s, but its sample time says {expected_s:?} s")]
    Stamp {
        /// The stream.
        stream: String,
        /// The index.
        index: u64,
        /// The stamp that came, s.
        stamp_s: f64,
        /// The instant of the index, s.
        expected_s: f64,
    },
    /// The payload has the wrong size.
    #[error("stream `{stream}`, sample {index}: {size} bytes came, its descriptor says {expected}")]
    Size {
        /// The stream.
        stream: String,
        /// The index.
        index: u64,
        /// The size that came, bytes.
        size: usize,
        /// The size of the descriptor, bytes.
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
        /// What the system said.
        source: io::Error,
    },
    /// The file system refused for another reason.
    #[error("{}: writing failed after {written} bytes: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// How many bytes of the file are on the disk.
        written: u64,
        /// What the system said.
        source: io::Error,
    },
}

/// Why a tape, or a part of it, cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// There is no index, so there is no tape.
    #[error("{} holds no tape (there is no index.json in it): name a run folder or its `tape` folder", path.display())]
    NoTape {
        /// The folder.
        path: PathBuf,
    },
    /// The file system refused.
    #[error("{}: cannot read: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// Another program's file, or another version's.
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
    /// A stream is not what was sealed when the run ended.
    #[error("{}: stream `{stream}` is damaged: it has {found}, and seal.json says {sealed}; take the tape from another copy, or run again", path.display())]
    Altered {
        /// The file.
        path: PathBuf,
        /// The stream.
        stream: String,
        /// What it has now.
        found: String,
        /// What it had.
        sealed: String,
    },
    /// The index describes streams that cannot be.
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
        /// The first record that is not there.
        record: u64,
        /// How many there are.
        count: u64,
    },
    /// A window of time that has no instant.
    #[error("the last instant, {to}, is before the first one, {from}: the window is empty")]
    Window {
        /// The first instant that was asked for.
        from: Rational,
        /// The last one.
        to: Rational,
    },
    /// No stream of that name or number.
    #[error("there is no stream `{name}`; the tape has {available}")]
    NoStream {
        /// What was asked for.
        name: String,
        /// What there is.
        available: String,
    },
    /// No field of that name.
    #[error("stream `{stream}` has no field `{field}`; it has {available}")]
    NoField {
        /// The stream.
        stream: String,
        /// What was asked for.
        field: String,
        /// What there is.
        available: String,
    },
}
