//! Writing a tape during a run.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Seek, Write};
use std::path::{Path, PathBuf};

use super::atomic::write_atomic;
use super::block_queue::BlockQueue;
use super::hash::combine_hashes;
use super::sequence::SequenceChecker;
use super::spec::{Index, STAMP_BYTES, Seal, SealEntry, validate_all};
use super::stream_file::{Block, StreamFile, write_error};
use super::{AppendError, CreateError, Digest, Event, Sink, StreamSpec};

/// The number of bytes that one stream collects before they are written to its file. Large enough that hashing and the system call are
/// cheap per byte, small enough that a hundred streams stay in the cache.
const BLOCK_BYTES: usize = 1 << 16;

/// Writes a tape into a folder.
///
/// A sample that [`Writer::append`] accepted is in the process's memory until some blocks are full, or [`Writer::flush`] is called; from
/// then on it survives a `kill -9` of the process. It survives a loss of power once the operating system has written it back.
#[derive(Debug)]
pub struct Writer {
    dir: PathBuf,
    buffers: Vec<StreamBuffer>,
    block_queue: BlockQueue,
    events: File,
    events_bytes: u64,
}

#[derive(Debug)]
struct StreamBuffer {
    checker: SequenceChecker,
    /// The samples that have not been passed to the block queue yet.
    block: Block,
}

impl Writer {
    /// Creates the folder `dir` (its parent must exist) and an empty tape of `streams` in it. The number of a stream is its position in
    /// `streams`. Their order is free: it does not affect the tape.
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
        let (mut buffers, mut files) = (Vec::with_capacity(streams.len()), Vec::with_capacity(streams.len()));
        for spec in streams {
            let path = dir.join(spec.file_name());
            files.push(StreamFile::new(path.clone(), create(&path)?));
            buffers.push(StreamBuffer {
                block: Block::new(BLOCK_BYTES.max(spec.stride())),
                checker: SequenceChecker::new(spec)?,
            });
        }
        let block_sizes = buffers.iter().map(|buffer| buffer.block.room).collect();
        let events = create(&dir.join("events.jsonl"))?;
        let path = dir.join("index.json");
        write_json(&path, &index).map_err(io(&path, "write the index"))?;
        Ok(Writer {
            dir: dir.to_owned(),
            buffers,
            block_queue: BlockQueue::new(files, block_sizes, BLOCK_BYTES),
            events,
            events_bytes: 0,
        })
    }

    /// From now on a thread of the writer hashes and writes, if this process may use another core for it: the appending thread only
    /// copies. An error is then reported by a later call, at the latest by the next [`Writer::flush`].
    pub fn with_thread(mut self) -> Writer {
        if std::thread::available_parallelism().is_ok_and(|cores| cores.get() > 1) {
            self.block_queue.start_thread();
        }
        self
    }

    /// Appends sample `index` of stream number `stream`: the next index of that stream, its exact stamp in seconds and a
    /// payload of the descriptor's size. Does not allocate. After an error the sample is not on the tape and may be
    /// appended again, for example when there is space on the disk again.
    #[inline]
    pub fn append(&mut self, stream: usize, index: u64, stamp_s: f64, payload: &[u8]) -> Result<(), AppendError> {
        let count = self.buffers.len();
        let buffer = self
            .buffers
            .get_mut(stream)
            .ok_or(AppendError::Stream { stream, count })?;
        buffer.checker.check(index, stamp_s, payload)?;
        if !buffer.block.has_room_for(STAMP_BYTES + payload.len()) {
            self.block_queue.enqueue(stream, &mut buffer.block)?;
        }
        buffer.block.push(stamp_s, payload);
        buffer.checker.advance();
        Ok(())
    }

    /// Appends an event; it is in the file when this call returns.
    pub fn event(&mut self, event: &Event) -> Result<(), AppendError> {
        let line = event.to_json_line();
        let path = || self.dir.join("events.jsonl");
        // One call for the whole line, so that a crash leaves all of it or nothing.
        self.events
            .write_all(&line)
            .map_err(|source| write_error(path(), self.events_bytes, source))?;
        self.events_bytes += line.len() as u64;
        Ok(())
    }

    /// Passes every complete sample to the operating system: from here on a crash of this process does not lose it. Every stream is
    /// tried; the first error is returned.
    pub fn flush(&mut self) -> Result<(), AppendError> {
        let mut first = self.block_queue.drain();
        for (stream, buffer) in self.buffers.iter_mut().enumerate() {
            if !self.block_queue.has_failed(stream) {
                first = first.and(self.block_queue.file(stream).write_block(&mut buffer.block));
            }
        }
        first
    }

    /// Keeps the first `counts` samples of each stream, in the order of their numbers, and no event: the tape is again that of a run that
    /// has reached this point. The data that is kept is read once, for its hash.
    pub fn truncate(&mut self, counts: &[u64]) -> Result<(), AppendError> {
        self.flush()?;
        for (stream, (buffer, &count)) in self.buffers.iter_mut().zip(counts).enumerate() {
            buffer.checker.truncate(count);
            let kept = buffer.checker.count() * buffer.checker.spec().stride() as u64;
            self.block_queue.file(stream).truncate(kept)?;
        }
        let path = || self.dir.join("events.jsonl");
        let cut = self.events.set_len(0).and_then(|()| self.events.rewind());
        cut.map_err(|source| write_error(path(), 0, source))?;
        self.events_bytes = 0;
        Ok(())
    }

    /// The folder of the tape.
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    /// How many samples stream number `stream` has, on disk and in memory; `None` when there is no such stream.
    pub fn count(&self, stream: usize) -> Option<u64> {
        self.buffers.get(stream).map(|buffer| buffer.checker.count())
    }

    /// Flushes everything, writes `seal.json` and returns the digest of the tape.
    pub fn finish(mut self) -> Result<Digest, AppendError> {
        self.flush()?;
        let hashes = (0..self.buffers.len()).map(|stream| self.block_queue.file(stream).hash());
        let parts = self.buffers.iter().map(|buffer| &buffer.checker).zip(hashes);
        let mut parts: Vec<(&SequenceChecker, Digest)> = parts.collect();
        parts.sort_by(|a, b| a.0.spec().key().cmp(&b.0.spec().key()));
        let digest = combine_hashes(
            parts
                .iter()
                .map(|(checker, hash)| (checker.spec(), checker.count(), *hash)),
        );
        let entry = |(checker, hash): &(&SequenceChecker, Digest)| SealEntry {
            stream: checker.spec().name(),
            count: checker.count(),
            blake3: *hash,
        };
        let streams = parts.iter().map(entry).collect();
        let seal = Seal { digest, streams };
        let path = self.dir.join("seal.json");
        write_json(&path, &seal).map_err(|source| write_error(path, 0, source))?;
        Ok(digest)
    }
}

impl Sink for Writer {
    fn sample(&mut self, stream: usize, index: u64, stamp_s: f64, payload: &[u8]) -> Result<(), AppendError> {
        self.append(stream, index, stamp_s, payload)
    }
}

impl Drop for Writer {
    /// A run that ends early keeps its samples; a caller that needs to know whether they were written calls [`Writer::finish`].
    fn drop(&mut self) {
        let _ = self.flush();
    }
}

fn write_json(path: &Path, content: &impl serde::Serialize) -> io::Result<()> {
    let mut text = serde_json::to_vec_pretty(content)?;
    text.push(b'\n');
    write_atomic(path, text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{sample, scratch, spec};
    use crate::{Reader, Source, digest_of};

    #[test]
    fn truncated_tape_equals_tape_of_shorter_run() {
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
        // A count beyond the end leaves the stream unchanged.
        writer.truncate(&[1234, 4000]).unwrap();
        assert_eq!((writer.count(0), writer.count(1)), (Some(1234), Some(3000)));
        (1234..2000).for_each(|index| put(&mut writer, 0, index));
        (0..2000).for_each(|index| put(&mut other, 0, index));
        (0..3000).for_each(|index| put(&mut other, 1, index));
        let digest = writer.finish().unwrap();
        assert_eq!(digest, other.finish().unwrap());
        assert_eq!(digest_of(&cut).unwrap(), digest);
    }

    fn put(writer: &mut Writer, stream: usize, index: u64, doubles: u64) -> Result<(), AppendError> {
        let (stamp, payload) = sample(index, doubles);
        writer.append(stream, index, stamp, &payload)
    }

    /// Streams at different rates, one of them with payloads that are larger than the usual block.
    #[test]
    fn writer_thread_gives_same_tape_as_direct_writes() {
        const DOUBLES: [u64; 3] = [2, 30, 9000];
        let (alone, beside) = (scratch("alone"), scratch("beside"));
        let streams = || {
            ["x", "y", "z"]
                .iter()
                .zip(DOUBLES)
                .map(|(port, n)| spec("a", port, n as u32))
                .collect()
        };
        let mut writers = [&alone, &beside].map(|dir| Writer::create(dir, streams()).unwrap());
        writers[1].block_queue.start_thread();
        for index in 0..30_000 {
            for writer in &mut writers {
                put(writer, 0, index, DOUBLES[0]).unwrap();
                put(writer, 1, index, DOUBLES[1]).unwrap();
                if index % 500 == 0 {
                    put(writer, 2, index / 500, DOUBLES[2]).unwrap();
                }
            }
            if index % 7_000 == 0 {
                writers[1].flush().unwrap();
                let reader = Reader::open(&beside).unwrap();
                let counts = ["a.x", "a.y", "a.z"].map(|name| reader.count(reader.stream(name).unwrap()));
                assert_eq!(counts, [index + 1, index + 1, index / 500 + 1]);
            }
        }
        let [one, other] = writers.map(|writer| writer.finish().unwrap());
        assert_eq!(one, other);
        assert_eq!(digest_of(&beside).unwrap(), one);
    }

    #[test]
    fn dropped_writer_keeps_samples_and_frees_thread_and_file() {
        let dir = scratch("dropped");
        let mut writer = Writer::create(&dir, vec![spec("a", "x", 30)]).unwrap();
        writer.block_queue.start_thread();
        (0..5000).for_each(|index| put(&mut writer, 0, index, 30).unwrap());
        let open = || {
            let all = fs::read_dir("/proc/self/fd").unwrap().flatten();
            let names = all.filter_map(|one| fs::read_link(one.path()).ok());
            names.filter(|name| name.starts_with(&dir)).count()
        };
        let owner_count = writer.block_queue.owner_count();
        assert!(open() > 0 && owner_count() > 0);
        drop(writer);
        assert_eq!((open(), owner_count()), (0, 0));
        assert_eq!(Reader::open(&dir).unwrap().count(0), 5000);
    }

    /// A device that is always full, behind a thread: the error is reported, no other stream is held up, and nothing is lost once there
    /// is space again.
    #[test]
    fn writer_thread_reports_full_disk_per_stream() {
        let dir = scratch("full-beside");
        let mut writer = Writer::create(&dir, vec![spec("a", "x", 2), spec("b", "y", 30)]).unwrap();
        let disk = std::mem::replace(&mut writer.block_queue.file(1).file, File::create("/dev/full").unwrap());
        writer.block_queue.start_thread();
        // Without a flush the error is reported as well, before all memory for blocks is used up.
        let error = (0..100_000)
            .find_map(|index| put(&mut writer, 1, index, 30).err())
            .unwrap();
        assert!(matches!(error, AppendError::DiskFull { written: 0, .. }), "{error}");
        for _ in 0..2 {
            let text = writer.flush().unwrap_err().to_string();
            assert!(text.contains("b.y.bin"), "{text}");
        }
        let count = writer.count(1).unwrap();
        assert!(put(&mut writer, 0, 0, 2).is_ok() && writer.flush().is_err());
        let reader = Reader::open(&dir).unwrap();
        assert_eq!((reader.count(0), reader.count(1)), (1, 0));
        writer.block_queue.file(1).file = disk;
        put(&mut writer, 1, count, 30).unwrap();
        let digest = writer.finish().unwrap();
        assert_eq!(digest_of(&dir).unwrap(), digest);
        assert_eq!(Reader::open(&dir).unwrap().count(1), count + 1);
    }

    /// A device that is always full replaces the stream's file.
    #[test]
    fn writer_names_full_file_and_keeps_tape_readable() {
        let dir = scratch("full");
        let mut writer = Writer::create(&dir, vec![spec("a", "x", 2), spec("b", "y", 3)]).unwrap();
        let disk = std::mem::replace(&mut writer.block_queue.file(1).file, File::create("/dev/full").unwrap());
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
        // With space again, the rejected sample can be appended, and the tape is that of an undisturbed run.
        writer.block_queue.file(1).file = disk;
        let (stamp, payload) = sample(index, 3);
        writer.append(1, index, stamp, &payload).unwrap();
        let digest = writer.finish().unwrap();
        assert_eq!(digest_of(&dir).unwrap(), digest);
        assert_eq!(Reader::open(&dir).unwrap().count(1), index + 1);
    }
}
