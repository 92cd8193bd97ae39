//! Reading a tape, which may be damaged or still being written.

use std::fs::{self, File};
use std::io::{self, ErrorKind, Read};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use super::format::FORMAT_NAME;
use super::hash::combine_hashes;
use super::regular::open_regular;
use super::source::hash_stream;
use super::spec::{Index, Seal, validate_all};
use super::{Digest, Event, FORMAT_VERSION, ReadError, Source, StreamSpec};

/// A larger index or event file is not part of a tape.
const MAX_TEXT_BYTES: u64 = 1 << 28;

/// A tape in a folder. Nothing in the folder is trusted: an inconsistent file is an error, never a panic.
///
/// Records are read in place (`pread`), so memory use does not depend on the length of the tape, several threads may read one `Reader`,
/// and a file that shrinks in the meantime is an error instead of a signal.
#[derive(Debug)]
pub struct Reader {
    dir: PathBuf,
    streams: Vec<StreamSpec>,
    open_streams: Vec<OpenStream>,
    seal: Option<Seal>,
}

#[derive(Debug)]
struct OpenStream {
    path: PathBuf,
    file: File,
    count: u64,
    incomplete_bytes: u64,
}

/// An incomplete last record on the disk.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct IncompleteRecord {
    /// The stream, `participant.port`.
    pub stream: String,
    /// How many complete records come before it.
    pub complete: u64,
    /// How many bytes of the incomplete record there are.
    pub bytes: u64,
}

/// Whether there is a regular file at `path`.
///
/// # Errors
/// When a folder of the path cannot be read.
pub fn is_file(path: &Path) -> Result<bool, ReadError> {
    let path = path.to_owned();
    match fs::metadata(&path) {
        Ok(about) => Ok(about.is_file()),
        Err(source) if source.kind() == ErrorKind::PermissionDenied => Err(ReadError::NoAccess { path, source }),
        Err(source) if matches!(source.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => Ok(false),
        Err(source) => Err(ReadError::Io { path, source }),
    }
}

impl Reader {
    /// Opens the tape in `dir`, which is a `tape` folder or a run folder that contains one.
    pub fn open(dir: &Path) -> Result<Reader, ReadError> {
        let mut found = None;
        for folder in [dir.join("tape"), dir.to_owned()] {
            if found.is_none() && is_file(&folder.join("index.json"))? {
                found = Some(folder);
            }
        }
        let dir = found.ok_or_else(|| ReadError::NoTape { path: dir.to_owned() })?;
        let path = dir.join("index.json");
        let streams = read_index(&path)?;
        let mut open_streams = Vec::with_capacity(streams.len());
        for spec in &streams {
            let path = dir.join(spec.file_name());
            let io = |source| ReadError::Io {
                path: path.clone(),
                source,
            };
            let file = open_regular(&path).map_err(io)?;
            open_streams.push(OpenStream {
                path,
                file,
                count: 0,
                incomplete_bytes: 0,
            });
        }
        let mut reader = Reader {
            seal: read_seal(&dir)?,
            dir,
            streams,
            open_streams,
        };
        reader.refresh()?;
        Ok(reader)
    }

    /// The tape's folder.
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    /// Updates the lengths of the streams, which grow on a tape that is being written.
    pub fn refresh(&mut self) -> Result<(), ReadError> {
        for (spec, open) in self.streams.iter().zip(&mut self.open_streams) {
            let metadata = open.file.metadata().map_err(|source| ReadError::Io {
                path: open.path.clone(),
                source,
            })?;
            let stride = spec.stride() as u64;
            open.count = metadata.len() / stride;
            open.incomplete_bytes = metadata.len() % stride;
        }
        Ok(())
    }

    /// Streams that end with an incomplete record.
    pub fn incomplete_records(&self) -> Vec<IncompleteRecord> {
        let open_streams = self.streams.iter().zip(&self.open_streams);
        open_streams
            .filter(|(_, open)| open.incomplete_bytes > 0)
            .map(|(spec, open)| IncompleteRecord {
                stream: spec.name(),
                complete: open.count,
                bytes: open.incomplete_bytes,
            })
            .collect()
    }

    /// The digest that the writer recorded when it finished; `None` when it never did. [`Source::digest`] computes it from the samples.
    pub fn sealed_digest(&self) -> Option<Digest> {
        self.seal.as_ref().map(|seal| seal.digest)
    }

    /// Compares every byte with the digest that the writer recorded when it finished, in one pass and in constant memory. A tape without
    /// a seal, that of a run that was killed, has nothing to compare with.
    ///
    /// # Errors
    /// [`ReadError::Altered`] with the first stream that differs from what was sealed.
    pub fn verify(&self) -> Result<(), ReadError> {
        let Some(seal) = &self.seal else { return Ok(()) };
        if seal.streams.len() != self.streams.len() {
            let path = self.dir.join("seal.json");
            return Err(damaged(
                &path,
                format!("it lists {} streams of {}", seal.streams.len(), self.streams.len()),
            ));
        }
        let mut parts = Vec::with_capacity(seal.streams.len());
        for entry in &seal.streams {
            let stream = self.stream(&entry.stream)?;
            let open = &self.open_streams[stream];
            let altered = |found: String, sealed: String| ReadError::Altered {
                path: open.path.clone(),
                stream: entry.stream.clone(),
                found,
                sealed,
            };
            if open.count != entry.count || open.incomplete_bytes != 0 {
                let torn = match open.incomplete_bytes {
                    0 => String::new(),
                    bytes => format!(" and {bytes} bytes of another"),
                };
                let found = format!("{} samples{torn}", open.count);
                return Err(altered(found, format!("{} samples", entry.count)));
            }
            let hash = hash_stream(self, stream)?;
            if hash != entry.blake3 {
                let of = |hash| format!("the BLAKE3 hash {hash}");
                return Err(altered(of(hash), of(entry.blake3)));
            }
            parts.push((&self.streams[stream], open.count, hash));
        }
        if combine_hashes(parts.into_iter()) != seal.digest {
            return Err(damaged(
                &self.dir.join("index.json"),
                "it is not the index that was written",
            ));
        }
        Ok(())
    }

    /// The events, in the order of writing. An incomplete last line is left out.
    pub fn events(&self) -> Result<Vec<Event>, ReadError> {
        let path = self.dir.join("events.jsonl");
        let text = match read_text(&path) {
            Err(ReadError::Io { source, .. }) if source.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
            result => result?,
        };
        Event::parse_lines(&text).map_err(|(line, error)| damaged(&path, format!("line {line}: {error}")))
    }
}

impl Source for Reader {
    fn streams(&self) -> &[StreamSpec] {
        &self.streams
    }

    fn count(&self, stream: usize) -> u64 {
        self.open_streams[stream].count
    }

    fn read(&self, stream: usize, first: u64, records: &mut [u8]) -> Result<(), ReadError> {
        let stride = self.check_range(stream, first, records.len())?;
        let open = &self.open_streams[stream];
        open.file
            .read_exact_at(records, first * stride as u64)
            .map_err(|source| ReadError::Io {
                path: open.path.clone(),
                source,
            })
    }
}

fn damaged(path: &Path, reason: impl Into<String>) -> ReadError {
    ReadError::Damaged {
        path: path.to_owned(),
        reason: reason.into(),
    }
}

fn read_text(path: &Path) -> Result<Vec<u8>, ReadError> {
    let io = |source| ReadError::Io {
        path: path.to_owned(),
        source,
    };
    let file = open_regular(path).map_err(io)?;
    let mut text = Vec::new();
    // The read is limited, instead of checking the length first: the file may grow meanwhile.
    file.take(MAX_TEXT_BYTES + 1).read_to_end(&mut text).map_err(io)?;
    if text.len() as u64 > MAX_TEXT_BYTES {
        return Err(damaged(path, format!("it is longer than {MAX_TEXT_BYTES} bytes")));
    }
    Ok(text)
}

fn read_index(path: &Path) -> Result<Vec<StreamSpec>, ReadError> {
    /// The fields of every version of the format.
    #[derive(serde::Deserialize)]
    struct Head {
        format: String,
        version: u32,
    }
    let text = read_text(path)?;
    let not_json = |error: serde_json::Error| damaged(path, error.to_string());
    let head: Head = serde_json::from_slice(&text).map_err(not_json)?;
    if head.format != FORMAT_NAME || head.version != FORMAT_VERSION {
        return Err(ReadError::Format {
            path: path.to_owned(),
            format: head.format,
            version: head.version,
        });
    }
    let index: Index = serde_json::from_slice(&text).map_err(not_json)?;
    let mut streams = Vec::with_capacity(index.streams.len());
    for entry in index.streams {
        // The names are checked below, before any of them becomes part of a path; these two are for other readers, and a contradiction
        // means that the file was edited.
        if entry.file != entry.spec.file_name() || entry.record_bytes != entry.spec.stride() as u64 {
            return Err(damaged(
                path,
                format!(
                    "file or record size of stream `{}` contradict the rest",
                    entry.spec.name()
                ),
            ));
        }
        streams.push(entry.spec);
    }
    validate_all(&streams).map_err(|source| ReadError::Spec {
        path: path.to_owned(),
        source,
    })?;
    Ok(streams)
}

fn read_seal(dir: &Path) -> Result<Option<Seal>, ReadError> {
    let path = dir.join("seal.json");
    if !fs::exists(&path).unwrap_or(false) {
        return Ok(None);
    }
    let text = read_text(&path)?;
    serde_json::from_slice(&text)
        .map(Some)
        .map_err(|error| damaged(&path, error.to_string()))
}

/// The digest of the tape in the folder `dir`, from its bytes; the digest that the writer recorded when it finished is not used.
pub fn digest_of(dir: &Path) -> Result<Digest, ReadError> {
    let reader = Reader::open(dir)?;
    reader.digest()
}
