//! Writing a tape while the run goes on.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Seek, Write};
use std::path::{Path, PathBuf};

use super::hash::combine;
use super::spec::{Index, Seal, SealEntry, validate_all};
use super::track::Track;
use super::whole::write_whole;
use super::{AppendError, CreateError, Digest, Event, Sink, StreamSpec};

/// Bytes that one stream collects before they go to its file. Large enough that hashing and the system call are cheap
/// per byte, small enough that a hundred streams stay in the cache.
const BUFFER_BYTES: usize = 1 << 16;

/// Writes a tape into a folder.
///
/// A sample that [`Writer::append`] took is in the process's memory until its stream's buffer is full or
/// [`Writer::flush`] is called; from then on it survives a `kill -9` of the process. It survives the loss of power once
/// the operating system has written it back.
#[derive(Debug)]
pub struct Writer {
    dir: PathBuf,
    lanes: Vec<Lane>,
    events: File,
    events_bytes: u64,
}

#[derive(Debug)]
struct Lane {
    track: Track,
    path: PathBuf,
    file: File,
    /// What is on the disk; the hash covers exactly these bytes.
    written: u64,
    hasher: blake3::Hasher,
    /// Whole records, the first `buffer_start` bytes of which are on the disk already (after a write that failed halfway).
    buffer: Vec<u8>,
    buffer_start: usize,
    capacity: usize,
}

impl Writer {
    /// Creates the folder `dir` (its parent must exist) and an empty tape of `streams` in it. The number of a stream is
    /// its position in `streams`, whose order is free: it has no influence on the tape.
    pub fn create(dir: &Path, streams: Vec<StreamSpec>) -> Result<Writer, CreateError> {
        validate_all(&streams)?;
        let index = Index::of(&streams);
        let io = |path: &Path, action: &'static str| {
            let path = path.to_owned();
            move |source: io::Error| CreateError::Io { path, action, source }
        };
        match fs::create_dir(dir) {
            Ok(()) => {}
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                if fs::read_dir(dir).map_err(io(dir, "list the folder"))?.next().is_some() {
                    return Err(CreateError::Exists { path: dir.to_owned() });
                }
            }
            Err(error) => return Err(io(dir, "create the folder")(error)),
        }
        let create = |path: &Path| {
            let mut options = OpenOptions::new();
            options
                .read(true)
                .write(true)
                .create_new(true)
                .open(path)
                .map_err(io(path, "create the file"))
        };
        let mut lanes = Vec::with_capacity(streams.len());
        for spec in streams {
            let path = dir.join(spec.file_name());
            let capacity = BUFFER_BYTES.max(spec.stride());
            lanes.push(Lane {
                file: create(&path)?,
                path,
                written: 0,
                hasher: blake3::Hasher::new(),
                buffer: Vec::with_capacity(capacity),
                buffer_start: 0,
                capacity,
                track: Track::new(spec)?,
            });
        }
        let events = create(&dir.join("events.jsonl"))?;
        let path = dir.join("index.json");
        write_json(&path, &index).map_err(io(&path, "write the index"))?;
        Ok(Writer {
            dir: dir.to_owned(),
            lanes,
            events,
            events_bytes: 0,
        })
    }

    /// Appends sample `index` of stream number `stream`: the next index of that stream, its exact stamp in seconds and a
    /// payload of the descriptor's size. Does not allocate. After an error the sample is not on the tape and may be
    /// appended again, for example when there is space on the disk again.
    #[inline]
    pub fn append(&mut self, stream: usize, index: u64, stamp_s: f64, payload: &[u8]) -> Result<(), AppendError> {
        let count = self.lanes.len();
        let lane = self
            .lanes
            .get_mut(stream)
            .ok_or(AppendError::Stream { stream, count })?;
        lane.track.check(index, stamp_s, payload)?;
        if lane.buffer.len() + lane.track.spec().stride() > lane.capacity {
            lane.flush()?;
        }
        lane.buffer.extend_from_slice(&stamp_s.to_le_bytes());
        lane.buffer.extend_from_slice(payload);
        lane.track.advance();
        Ok(())
    }

    /// Appends an event; it is in the file when this returns.
    pub fn event(&mut self, event: &Event) -> Result<(), AppendError> {
        let line = event.line();
        let path = || self.dir.join("events.jsonl");
        // One call for the whole line, so that a crash leaves it out or in.
        self.events
            .write_all(&line)
            .map_err(|source| failed(path(), self.events_bytes, source))?;
        self.events_bytes += line.len() as u64;
        Ok(())
    }

    /// Hands every complete sample to the operating system: from here on a crash of this process does not lose it.
    /// Every stream is tried; the first error is given.
    pub fn flush(&mut self) -> Result<(), AppendError> {
        let mut first = Ok(());
        for lane in &mut self.lanes {
            first = first.and(lane.flush());
        }
        first
    }

    /// Keeps the first `counts` samples of each stream, in the order of their numbers, and no event: the tape is again that of a
    /// run that has come so far. What is kept is read once, for its hash.
    pub fn cut_back(&mut self, counts: &[u64]) -> Result<(), AppendError> {
        self.flush()?;
        for (lane, &count) in self.lanes.iter_mut().zip(counts) {
            lane.cut_back(count)?;
        }
        let path = || self.dir.join("events.jsonl");
        let cut = self.events.set_len(0).and_then(|()| self.events.rewind());
        cut.map_err(|source| failed(path(), 0, source))?;
        self.events_bytes = 0;
        Ok(())
    }

    /// The folder of the tape.
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    /// How many samples stream number `stream` has, on disk and in memory; `None` when there is no such stream.
    pub fn count(&self, stream: usize) -> Option<u64> {
        self.lanes.get(stream).map(|lane| lane.track.count())
    }

    /// How many bytes of samples are in files so far.
    pub fn written_bytes(&self) -> u64 {
        self.lanes.iter().map(|lane| lane.written).sum()
    }

    /// Flushes everything, writes `seal.json` and gives the digest of the tape.
    pub fn finish(mut self) -> Result<Digest, AppendError> {
        self.flush()?;
        let hashes: Vec<Digest> = self.lanes.iter().map(|lane| lane.hasher.finalize().into()).collect();
        let parts = self.lanes.iter().zip(&hashes);
        let digest = combine(parts.map(|(lane, hash)| (lane.track.spec(), lane.track.count(), *hash)));
        let mut streams: Vec<&Lane> = self.lanes.iter().collect();
        streams.sort_by(|a, b| a.track.spec().key().cmp(&b.track.spec().key()));
        let seal = Seal {
            digest,
            streams: streams
                .into_iter()
                .map(|lane| SealEntry {
                    stream: lane.track.spec().name(),
                    count: lane.track.count(),
                    blake3: lane.hasher.finalize().into(),
                })
                .collect(),
        };
        let path = self.dir.join("seal.json");
        write_json(&path, &seal).map_err(|source| failed(path, 0, source))?;
        Ok(digest)
    }
}

impl Sink for Writer {
    fn sample(&mut self, stream: usize, index: u64, stamp_s: f64, payload: &[u8]) -> Result<(), AppendError> {
        self.append(stream, index, stamp_s, payload)
    }
}

impl Drop for Writer {
    /// A run that ends early keeps what it has; whoever needs to know that it got there calls [`Writer::finish`].
    fn drop(&mut self) {
        let _ = self.flush();
    }
}

impl Lane {
    /// Everything is in the file: keeps the first `count` records.
    fn cut_back(&mut self, count: u64) -> Result<(), AppendError> {
        self.track.cut_back(count);
        let kept = self.track.count() * self.track.spec().stride() as u64;
        let mut hasher = blake3::Hasher::new();
        let mut cut = || {
            self.file.set_len(kept)?;
            self.file.rewind()?;
            // The file is read to its end, which is where writing goes on.
            hasher.update_reader(&self.file).map(drop)
        };
        cut().map_err(|source| failed(self.path.clone(), self.written, source))?;
        (self.hasher, self.written) = (hasher, kept);
        Ok(())
    }

    fn flush(&mut self) -> Result<(), AppendError> {
        while self.buffer_start < self.buffer.len() {
            let rest = &self.buffer[self.buffer_start..];
            let result = match self.file.write(rest) {
                Ok(0) => Err(io::Error::from(io::ErrorKind::WriteZero)),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                result => result,
            };
            let taken = result.map_err(|source| failed(self.path.clone(), self.written, source))?;
            self.hasher.update(&rest[..taken]);
            self.buffer_start += taken;
            self.written += taken as u64;
        }
        self.buffer.clear();
        self.buffer_start = 0;
        Ok(())
    }
}

fn failed(path: PathBuf, written: u64, source: io::Error) -> AppendError {
    use io::ErrorKind::{FileTooLarge, QuotaExceeded, StorageFull};
    if matches!(source.kind(), StorageFull | QuotaExceeded | FileTooLarge) {
        AppendError::DiskFull { path, written, source }
    } else {
        AppendError::Io { path, written, source }
    }
}

fn write_json(path: &Path, content: &impl serde::Serialize) -> io::Result<()> {
    let mut text = serde_json::to_vec_pretty(content)?;
    text.push(b'\n');
    write_whole(path, text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{sample, scratch, spec};
    use crate::{Reader, Source, digest_of};

    #[test]
    fn a_tape_that_was_cut_back_is_that_of_a_run_that_came_so_far() {
        let (cut, whole) = (scratch("cut-back"), scratch("cut-back-whole"));
        let streams = || vec![spec("a", "x", 2), spec("b", "y", 3)];
        let (mut writer, mut other) = (
            Writer::create(&cut, streams()).unwrap(),
            Writer::create(&whole, streams()).unwrap(),
        );
        let put = |writer: &mut Writer, stream: usize, index: u64| {
            let (stamp, payload) = sample(index, 2 + stream as u64);
            writer.append(stream, index, stamp, &payload).unwrap();
        };
        (0..5000).for_each(|index| put(&mut writer, 0, index));
        (0..3000).for_each(|index| put(&mut writer, 1, index));
        // More than there is leaves the stream as it is.
        writer.cut_back(&[1234, 4000]).unwrap();
        assert_eq!((writer.count(0), writer.count(1)), (Some(1234), Some(3000)));
        (1234..2000).for_each(|index| put(&mut writer, 0, index));
        (0..2000).for_each(|index| put(&mut other, 0, index));
        (0..3000).for_each(|index| put(&mut other, 1, index));
        let digest = writer.finish().unwrap();
        assert_eq!(digest, other.finish().unwrap());
        assert_eq!(digest_of(&cut).unwrap(), digest);
    }

    /// A device that is always full stands in for the stream's file.
    #[test]
    fn a_full_disk_is_named_and_the_tape_stays_readable() {
        let dir = scratch("full");
        let mut writer = Writer::create(&dir, vec![spec("a", "x", 2), spec("b", "y", 3)]).unwrap();
        let disk = std::mem::replace(&mut writer.lanes[1].file, File::create("/dev/full").unwrap());
        let mut index = 0;
        let error = loop {
            let (stamp, payload) = sample(index, 3);
            match writer.append(1, index, stamp, &payload) {
                Ok(()) => index += 1,
                Err(error) => break error,
            }
            let (stamp, payload) = sample(index - 1, 2);
            writer.append(0, index - 1, stamp, &payload).unwrap();
        };
        let text = error.to_string();
        assert!(matches!(error, AppendError::DiskFull { written: 0, .. }), "{text}");
        assert!(text.contains("b.y.bin") && text.contains("free some space"), "{text}");
        assert!(writer.flush().is_err());
        let reader = Reader::open(&dir).unwrap();
        assert_eq!((reader.count(0), reader.count(1)), (index, 0));
        // Space again: the refused sample can be appended, and the tape is the one of a run without the accident.
        writer.lanes[1].file = disk;
        let (stamp, payload) = sample(index, 3);
        writer.append(1, index, stamp, &payload).unwrap();
        let digest = writer.finish().unwrap();
        assert_eq!(digest_of(&dir).unwrap(), digest);
        assert_eq!(Reader::open(&dir).unwrap().count(1), index + 1);
    }
}
