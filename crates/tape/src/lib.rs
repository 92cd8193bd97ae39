//! The tape: every sample of every output port, bit for bit.
//!
//! A tape is a folder:
//!
//! | file | content |
//! |---|---|
//! | `index.json` | what the streams are: participant, port, descriptor, exact sample time, first index, record size. Written last at creation and never changed: where it is, all stream files are |
//! | `<participant>.<port>.bin` | one stream: records of fixed size without any header, each the stamp (little-endian `f64`, s) and the payload exactly as published |
//! | `events.jsonl` | one JSON object per line: faults, substitutions, failures with their simulated time |
//! | `seal.json` | counts and hashes; there only when the writer finished |
//!
//! Record k of a stream is sample `first_index + k`, and its stamp is the double nearest to `offset + index * period`.
//! Each stream file is a prefix of what an undisturbed run would have written, whatever killed the writer: the reader leaves out and
//! reports an incomplete last record. In Python, `numpy.fromfile(path, dtype=[("t", "<f8"), ("payload", [("p_NB_N", "<f8", 3), …])])`
//! reads a stream.
//!
//! The [`Digest`] identifies the content of a tape: it covers names, descriptors, sample times, counts and every byte of every stream, in
//! an order that does not depend on which stream arrived first. Events are not part of it, so a run that was interrupted and resumed can
//! be shown to have the tape of the undisturbed one.
//!
//! # Example
//!
//! ```
//! use lockstep::port::Message;
//! use lockstep::time::Rational;
//! use tape::{Reader, Records, Source, StreamSpec, Writer};
//!
//! lockstep::message! {
//!     /// What the tank reports.
//!     struct Level {
//!         /// Depth of the water.
//!         depth: f64 = "m",
//!     }
//! }
//!
//! let folder = std::env::temp_dir().join(format!("tape-example-{}", std::process::id()));
//! # std::fs::create_dir_all(&folder)?;
//! let (start, period): (Rational, Rational) = ("0 s".parse()?, "10 ms".parse()?);
//! let stream = StreamSpec::new("tank", "level", Level::descriptor(), start, period);
//! let mut writer = Writer::create(&folder, vec![stream])?;
//! for (index, (stamp_s, depth)) in [(0.0, 0.4_f64), (0.01, 0.3), (0.02, 0.2)].into_iter().enumerate() {
//!     writer.append(0, index as u64, stamp_s, &depth.to_le_bytes())?;
//! }
//! let digest = writer.finish()?;
//!
//! let reader = Reader::open(&folder)?;
//! assert_eq!(reader.sealed_digest(), Some(digest));
//! let mut records = Records::new(&reader, reader.stream("tank.level")?);
//! let first = records.next()?.expect("the tape has three samples");
//! assert_eq!((first.stamp_s, first.payload), (0.0, &0.4_f64.to_le_bytes()[..]));
//! # std::fs::remove_dir_all(&folder)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod atomic;
mod block_queue;
pub mod compare;
mod digest;
mod error;
mod events;
mod excerpt;
pub mod folder;
mod format;
mod hash;
mod memory;
mod reader;
mod regular;
mod selection;
mod sequence;
mod sink;
mod source;
mod spec;
mod stream_file;
#[cfg(test)]
mod testing;
mod writer;

pub use atomic::write_atomic;
pub use digest::{Digest, ParseDigestError};
pub use error::{AppendError, CreateError, ReadError, SpecError};
pub use events::{Event, EventKind};
pub use excerpt::{Excerpt, ExcerptSpec};
pub use format::FORMAT_VERSION;
pub use memory::{DigestSink, MemoryTape};
pub use reader::{IncompleteRecord, Reader, digest_of, is_file};
pub use regular::{open_regular, read_regular};
pub use selection::Selection;
pub use sink::Sink;
pub use source::{FieldRef, Record, Records, Source, split_record};
pub use spec::StreamSpec;
pub use writer::Writer;

#[cfg(test)]
pub(crate) use testing::scratch as scratch_for_tests;
