//! What an ELF file asks the dynamic linker for, read from the file: loading it would execute code of it.

use std::ffi::CString;
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::Path;

/// The most bytes of a table that are read: a library has a few kilobytes of each.
const TABLE_MAX: u64 = 16 << 20;

const LOAD: u32 = 1;
const DYNAMIC: u32 = 2;
const NEEDED: u64 = 1;
const STRINGS: u64 = 5;

/// The names of the libraries that the library in `file` needs. None where it is not a library of 64 bits: the dynamic linker then says what
/// is wrong with it.
pub(crate) fn needed(file: &Path) -> Vec<CString> {
    File::open(file)
        .ok()
        .and_then(|file| read_needed(&file))
        .unwrap_or_default()
}

/// A part of the file that is mapped to memory.
struct Segment {
    kind: u32,
    offset: u64,
    address: u64,
    size: u64,
}

fn bytes(file: &File, offset: u64, size: u64) -> Option<Vec<u8>> {
    let mut bytes = vec![0; usize::try_from(size).ok().filter(|_| size <= TABLE_MAX)?];
    file.read_exact_at(&mut bytes, offset).ok()?;
    Some(bytes)
}

fn word(bytes: &[u8], at: usize) -> Option<u64> {
    Some(u64::from_le_bytes(bytes.get(at..at + 8)?.try_into().ok()?))
}

fn half(bytes: &[u8], at: usize) -> Option<u64> {
    Some(u64::from(u16::from_le_bytes(bytes.get(at..at + 2)?.try_into().ok()?)))
}

fn segments(file: &File) -> Option<Vec<Segment>> {
    let header = bytes(file, 0, 64)?;
    // 64 bits, little-endian.
    if !header.starts_with(b"\x7fELF\x02\x01") {
        return None;
    }
    let (start, size, count) = (word(&header, 32)?, half(&header, 54)?, half(&header, 56)?);
    let table = bytes(file, start, size * count)?;
    let entries = table.chunks_exact(usize::try_from(size).ok().filter(|size| *size >= 56)?);
    let segments = entries.map(|entry| {
        Some(Segment {
            kind: u32::from_le_bytes(entry[..4].try_into().ok()?),
            offset: word(entry, 8)?,
            address: word(entry, 16)?,
            size: word(entry, 32)?,
        })
    });
    segments.collect()
}

fn read_needed(file: &File) -> Option<Vec<CString>> {
    let segments = segments(file)?;
    let dynamic = segments.iter().find(|segment| segment.kind == DYNAMIC)?;
    let table = bytes(file, dynamic.offset, dynamic.size)?;
    let entries: Vec<(u64, u64)> = (table.chunks_exact(16))
        .map(|entry| Some((word(entry, 0)?, word(entry, 8)?)))
        .collect::<Option<_>>()?;
    let (_, address) = entries.iter().find(|(tag, _)| *tag == STRINGS)?;
    let holds = |segment: &&Segment| {
        let inside = address.checked_sub(segment.address);
        segment.kind == LOAD && inside.is_some_and(|inside| inside < segment.size)
    };
    let segment = segments.iter().find(holds)?;
    let inside = address - segment.address;
    // To the end of the segment, whose rest is more than the texts.
    let texts = bytes(
        file,
        segment.offset.checked_add(inside)?,
        (segment.size - inside).min(TABLE_MAX),
    )?;
    let names = entries.iter().filter(|(tag, _)| *tag == NEEDED).map(|(_, at)| {
        let text = texts.get(usize::try_from(*at).ok()?..)?;
        CString::new(text.split(|byte| *byte == 0).next()?).ok()
    });
    names.collect()
}
