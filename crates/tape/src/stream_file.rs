//! The file of one stream during writing.

use std::fs::File;
use std::io::{self, Seek, Write};
use std::path::PathBuf;

use super::{AppendError, Digest};

/// A growing file, and the hash of exactly its content.
#[derive(Debug)]
pub(crate) struct StreamFile {
    path: PathBuf,
    pub(crate) file: File,
    written: u64,
    hasher: blake3::Hasher,
}

/// Whole records of one stream, the first `done` bytes of which are in the file already (after a partial write).
#[derive(Debug)]
pub(crate) struct Block {
    bytes: Vec<u8>,
    done: usize,
    /// The capacity, bytes.
    pub(crate) room: usize,
}

impl Block {
    /// An empty block. A block never grows.
    pub(crate) fn new(room: usize) -> Block {
        Block {
            bytes: Vec::with_capacity(room),
            done: 0,
            room,
        }
    }

    pub(crate) fn has_room_for(&self, bytes: usize) -> bool {
        self.bytes.len() + bytes <= self.room
    }

    #[inline]
    pub(crate) fn push(&mut self, stamp_s: f64, payload: &[u8]) {
        self.bytes.extend_from_slice(&stamp_s.to_le_bytes());
        self.bytes.extend_from_slice(payload);
    }
}

impl StreamFile {
    /// `file` must be empty, and be the one at `path`.
    pub(crate) fn new(path: PathBuf, file: File) -> StreamFile {
        StreamFile {
            path,
            file,
            written: 0,
            hasher: blake3::Hasher::new(),
        }
    }

    /// Passes `block` to the operating system and hashes it; it is empty afterwards. After an error it contains what is not in the file.
    pub(crate) fn write_block(&mut self, block: &mut Block) -> Result<(), AppendError> {
        while block.done < block.bytes.len() {
            let rest = &block.bytes[block.done..];
            let result = match self.file.write(rest) {
                Ok(0) => Err(io::Error::from(io::ErrorKind::WriteZero)),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                result => result,
            };
            let taken = result.map_err(|source| write_error(self.path.clone(), self.written, source))?;
            self.hasher.update(&rest[..taken]);
            block.done += taken;
            self.written += taken as u64;
        }
        block.bytes.clear();
        block.done = 0;
        Ok(())
    }

    /// Keeps the first `kept` bytes, which are read to compute their hash.
    pub(crate) fn truncate(&mut self, kept: u64) -> Result<(), AppendError> {
        let mut hasher = blake3::Hasher::new();
        let mut cut = || {
            self.file.set_len(kept)?;
            self.file.rewind()?;
            // The file is read to its end, where writing continues.
            hasher.update_reader(&self.file).map(drop)
        };
        cut().map_err(|source| write_error(self.path.clone(), self.written, source))?;
        (self.hasher, self.written) = (hasher, kept);
        Ok(())
    }

    /// The hash of the content of the file.
    pub(crate) fn hash(&self) -> Digest {
        self.hasher.finalize().into()
    }
}

/// The error for a write to the file at `path` that failed after its first `written` bytes.
pub(crate) fn write_error(path: PathBuf, written: u64, source: io::Error) -> AppendError {
    use io::ErrorKind::{FileTooLarge, QuotaExceeded, StorageFull};
    if matches!(source.kind(), StorageFull | QuotaExceeded | FileTooLarge) {
        AppendError::DiskFull { path, written, source }
    } else {
        AppendError::Io { path, written, source }
    }
}
