//! Reader of untrusted ZIP archives.
//!
//! Only the central directory is used, and only as far as it can be checked: names that stay inside the folder, no symbolic
//! links, no encryption, sizes within a stated bound, and contents with the size and the checksum that it states.

use std::collections::HashSet;
use std::fs;
use std::io::{self, Write};
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use miniz_oxide::inflate::decompress_to_vec_with_limit;

/// Maximum unpacked size of an archive, bytes: 2 GiB.
pub const UNPACKED_MAX: u64 = 2 << 30;
/// Maximum number of files and folders in an archive.
pub const ENTRIES_MAX: usize = 65_535;

const END: u32 = 0x0605_4b50;
const END_SIZE: usize = 22;
const CENTRAL: u32 = 0x0201_4b50;
const CENTRAL_SIZE: usize = 46;
const LOCAL: u32 = 0x0403_4b50;
const LOCAL_SIZE: usize = 30;

/// Why an archive is rejected.
#[derive(Debug, thiserror::Error)]
pub enum ZipError {
    /// The bytes are not a ZIP archive, or are truncated.
    #[error("it is not a ZIP archive: {0}")]
    NoArchive(&'static str),
    /// A file in the archive that is rejected.
    #[error("`{name}` in the archive: {reason}")]
    Entry {
        /// The file.
        name: String,
        /// The mistake.
        reason: String,
    },
    /// The unpacked size exceeds the maximum.
    #[error("it has {size} bytes when unpacked; at most {UNPACKED_MAX} are unpacked")]
    Size {
        /// The size, bytes.
        size: u64,
    },
    /// An error of the operating system.
    #[error("`{}`: {source}", .path.display())]
    Io {
        /// The file or folder that cannot be written.
        path: PathBuf,
        /// The error.
        source: io::Error,
    },
}

/// A file or folder in an archive.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entry {
    /// Its path inside the archive, with `/` between folders; the path of a folder ends with `/`.
    pub name: String,
    /// Its size when unpacked, bytes.
    pub size: u64,
    packed: u64,
    checksum: u32,
    method: u16,
    at: u64,
    executable: bool,
}

/// An archive whose directory has been read and checked.
#[derive(Debug)]
pub struct Archive {
    bytes: Vec<u8>,
    entries: Vec<Entry>,
}

fn read_u16(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_le_bytes(bytes.get(at..at.checked_add(2)?)?.try_into().ok()?))
}

fn read_u32(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(bytes.get(at..at.checked_add(4)?)?.try_into().ok()?))
}

fn read_u64(bytes: &[u8], at: usize) -> Option<u64> {
    Some(u64::from_le_bytes(bytes.get(at..at.checked_add(8)?)?.try_into().ok()?))
}

impl Archive {
    /// Reads and checks the directory of an archive.
    ///
    /// # Errors
    /// Names the first file that is rejected, or states that this is not an archive.
    pub fn read(bytes: Vec<u8>) -> Result<Archive, ZipError> {
        const CUT: ZipError = ZipError::NoArchive("its directory is cut off");
        let latest = bytes.len().checked_sub(END_SIZE);
        let latest = latest.ok_or(ZipError::NoArchive("it is too short"))?;
        let earliest = latest.saturating_sub(usize::from(u16::MAX));
        let end = (earliest..=latest).rev().find(|&at| {
            read_u32(&bytes, at) == Some(END)
                && read_u16(&bytes, at + 20).is_some_and(|comment| at + END_SIZE + usize::from(comment) == bytes.len())
        });
        let end = end.ok_or(ZipError::NoArchive("it has no directory at its end"))?;
        let count = read_u16(&bytes, end + 10).ok_or(CUT)?;
        let mut at = read_u32(&bytes, end + 16).ok_or(CUT)? as usize;
        if count == u16::MAX || at == u32::MAX as usize {
            return Err(ZipError::NoArchive(
                "it is larger than 4 GiB or has more than 65534 files (ZIP64)",
            ));
        }
        let mut archive = Archive {
            bytes,
            entries: Vec::new(),
        };
        let (mut names, mut total) = (HashSet::new(), 0_u64);
        for _ in 0..count {
            let (entry, next) = archive.entry(at)?;
            total = total.saturating_add(entry.size);
            if total > UNPACKED_MAX {
                return Err(ZipError::Size { size: total });
            }
            if !names.insert(entry.name.clone()) {
                return Err(refuse(&entry.name, "it is there twice"));
            }
            archive.entries.push(entry);
            at = next;
        }
        archive.check_folders()?;
        Ok(archive)
    }

    /// Checks that no file stands where others need a folder.
    fn check_folders(&self) -> Result<(), ZipError> {
        let mut names: Vec<&str> = self.entries.iter().map(|entry| entry.name.as_str()).collect();
        names.sort_unstable();
        for file in self.entries.iter().filter(|entry| !entry.name.ends_with('/')) {
            let folder = format!("{}/", file.name);
            let inside = names.get(names.partition_point(|name| *name < folder.as_str()));
            if let Some(inside) = inside.filter(|name| name.starts_with(&folder)) {
                let reason = format!(
                    "it is a file, and the folder of `{}`; export the FMU again, with one of the two under another name",
                    inside.escape_debug()
                );
                return Err(refuse(&file.name, reason));
            }
        }
        Ok(())
    }

    /// The entry of the directory that starts at `at`, and the position of the next one.
    fn entry(&self, at: usize) -> Result<(Entry, usize), ZipError> {
        const CUT: ZipError = ZipError::NoArchive("its directory is cut off");
        let bytes = &self.bytes;
        if read_u32(bytes, at) != Some(CENTRAL) {
            return Err(ZipError::NoArchive("its directory has something else in it"));
        }
        let field = |offset| read_u16(bytes, at + offset).ok_or(CUT);
        let (name_len, extra_len, comment_len) = (field(28)?, field(30)?, field(32)?);
        let name_at = at + CENTRAL_SIZE;
        let extra_at = name_at + usize::from(name_len);
        let name = bytes.get(name_at..extra_at).ok_or(CUT)?;
        let name =
            std::str::from_utf8(name).map_err(|_| refuse(&String::from_utf8_lossy(name), "its name is not UTF-8"))?;
        let name = name.strip_prefix("./").unwrap_or(name).to_owned();
        let comment_at = extra_at + usize::from(extra_len);
        let extra = bytes.get(extra_at..comment_at).ok_or(CUT)?;
        check_name(&name)?;
        let (flags, method) = (field(8)?, field(10)?);
        if flags & 1 != 0 {
            return Err(refuse(&name, "it is encrypted; export the FMU without"));
        }
        let folder = name.ends_with('/');
        if !folder && method != 0 && method != 8 {
            let reason = format!("it is packed by method {method}; only deflate and no packing at all are read");
            return Err(refuse(&name, reason));
        }
        // The upper half of the attributes is a Unix mode where the entry was created on a Unix system.
        let unix = field(4)? >> 8 == 3;
        let mode = if unix {
            read_u32(bytes, at + 38).ok_or(CUT)? >> 16
        } else {
            0
        };
        if mode & 0o170_000 == 0o120_000 {
            return Err(refuse(&name, "it is a symbolic link"));
        }
        let size = |offset| read_u32(bytes, at + offset).ok_or(CUT);
        let (packed, unpacked, local) = zip64_sizes(extra, size(20)?, size(24)?, size(42)?)
            .ok_or_else(|| refuse(&name, "its ZIP64 sizes are missing"))?;
        let entry = Entry {
            size: if folder { 0 } else { unpacked },
            packed,
            checksum: size(16)?,
            method,
            at: local,
            executable: mode & 0o100 != 0,
            name,
        };
        Ok((entry, comment_at + usize::from(comment_len)))
    }

    /// The entries of the archive.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// Whether there is a file of this name.
    pub fn has(&self, name: &str) -> bool {
        self.entries.iter().any(|entry| entry.name == name)
    }

    /// The contents of the file called `name`, if there is one.
    ///
    /// # Errors
    /// When the contents differ from the size or checksum in the directory.
    pub fn file(&self, name: &str) -> Option<Result<Vec<u8>, ZipError>> {
        let entry = self.entries.iter().find(|entry| entry.name == name)?;
        Some(self.contents(entry))
    }

    fn contents(&self, entry: &Entry) -> Result<Vec<u8>, ZipError> {
        let cut = || refuse(&entry.name, "it is cut off");
        let at = usize::try_from(entry.at).map_err(|_| cut())?;
        if read_u32(&self.bytes, at) != Some(LOCAL) {
            return Err(refuse(&entry.name, "there is something else where it should start"));
        }
        let (name, extra) = (read_u16(&self.bytes, at + 26), read_u16(&self.bytes, at + 28));
        let start = at + LOCAL_SIZE + usize::from(name.ok_or_else(cut)?) + usize::from(extra.ok_or_else(cut)?);
        let packed = usize::try_from(entry.packed)
            .ok()
            .and_then(|packed| start.checked_add(packed));
        let packed = packed.and_then(|end| self.bytes.get(start..end)).ok_or_else(cut)?;
        let size = usize::try_from(entry.size).map_err(|_| cut())?;
        let contents = match entry.method {
            0 => packed.to_vec(),
            _ => decompress_to_vec_with_limit(packed, size)
                .map_err(|error| refuse(&entry.name, format!("it cannot be unpacked to {size} bytes: {error}")))?,
        };
        if contents.len() != size {
            let reason = format!("it has {} bytes where the directory says {size}", contents.len());
            return Err(refuse(&entry.name, reason));
        }
        if crc32fast::hash(&contents) != entry.checksum {
            return Err(refuse(&entry.name, "its checksum is wrong: the archive is damaged"));
        }
        Ok(contents)
    }

    /// Unpacks all entries into the empty folder `into`, with access for this user only.
    ///
    /// # Errors
    /// The first file that differs from the directory, or cannot be written.
    pub fn unpack(&self, into: &Path) -> Result<(), ZipError> {
        let io = |path: &Path| {
            let path = path.to_owned();
            move |source| ZipError::Io { path, source }
        };
        let make = |folder: &Path| {
            let made = fs::DirBuilder::new().mode(0o700).recursive(true).create(folder);
            made.map_err(io(folder))
        };
        for entry in &self.entries {
            let path = into.join(&entry.name);
            if entry.name.ends_with('/') {
                make(&path)?;
                continue;
            }
            path.parent().map_or(Ok(()), make)?;
            let contents = self.contents(entry)?;
            let mode = if entry.executable { 0o700 } else { 0o600 };
            let file = fs::OpenOptions::new()
                .write(true)
                .create_new(true)
                .mode(mode)
                .open(&path);
            file.and_then(|mut file| file.write_all(&contents)).map_err(io(&path))?;
        }
        Ok(())
    }
}

fn refuse(name: &str, reason: impl Into<String>) -> ZipError {
    ZipError::Entry {
        name: name.escape_debug().to_string(),
        reason: reason.into(),
    }
}

/// Packed size, size and position; the extra field has those that do not fit into 32 bits, in the order size, packed size,
/// position.
fn zip64_sizes(extra: &[u8], packed: u32, unpacked: u32, local: u32) -> Option<(u64, u64, u64)> {
    let mut at = 0;
    let mut long_sizes: &[u8] = &[];
    while let (Some(id), Some(len)) = (read_u16(extra, at), read_u16(extra, at + 2)) {
        let end = at + 4 + usize::from(len);
        if id == 1 {
            long_sizes = extra.get(at + 4..end)?;
        }
        at = end;
    }
    let mut next = 0;
    let mut take = |short: u32| {
        if short != u32::MAX {
            return Some(u64::from(short));
        }
        next += 8;
        read_u64(long_sizes, next - 8)
    };
    let unpacked = take(unpacked)?;
    let packed = take(packed)?;
    Some((packed, unpacked, take(local)?))
}

/// A path that stays inside the folder into which it is unpacked.
fn check_name(name: &str) -> Result<(), ZipError> {
    let inside = name.strip_suffix('/').unwrap_or(name);
    let reason = if inside.starts_with('/') || inside.as_bytes().get(1) == Some(&b':') {
        "its name is an absolute path"
    } else if inside.contains('\\') {
        "its name has a backslash; the folders in a ZIP archive are separated by `/`"
    } else if inside.contains('\0') {
        "its name has a zero byte"
    } else if inside.split('/').any(|part| part == "..") {
        "its name leads out of the archive (`..`)"
    } else if inside.split('/').any(|part| part.is_empty() || part == ".") {
        "its name has an empty part"
    } else {
        return Ok(());
    };
    Err(refuse(name, reason))
}
