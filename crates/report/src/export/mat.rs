//! MAT files of version 5, the subset that a tape needs: structs of arrays and of texts; no compression.
//!
//! A file is a header of 128 bytes and elements, each with a tag of its type and its length. An array is an element that
//! contains other elements: array flags, dimensions, name, numbers. See MathWorks' "MAT-File Format", "Level 5 MAT-Files".
//!
//! Arrays are stored column by column, and a tape sample by sample. All lengths are known before the first sample is read,
//! so the place of each number in the file is known, and the tape is read once.

use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::os::unix::fs::FileExt;

use lockstep::port::{Content, Element, Field};
use tape::{Source, StreamSpec};

use super::columns::{distinct, fields, is_wide};
use super::file::{Metadata, WriteError};

// Types of elements.
const INT8: u32 = 1;
const INT32: u32 = 5;
const UINT32: u32 = 6;
const DOUBLE: u32 = 9;
const MATRIX: u32 = 14;
const UTF16: u32 = 17;

// Classes of arrays.
const STRUCT: u32 = 2;
const CHAR: u32 = 4;
const DOUBLES: u32 = 6;
/// Array flag: the numbers are truth values.
const LOGICAL: u32 = 0x200;

/// Maximum length of the name of a variable or field.
const NAME: usize = 63;
/// Size of a field name, including the terminating byte.
const NAME_ROOM: usize = NAME + 1;
/// The maximum size of a variable, bytes: the size is a 32-bit field, and readers treat it as signed.
const LARGEST: u64 = i32::MAX as u64;
/// Bytes of records read at a time.
const CHUNK: usize = 8 << 20;

/// Type and class of a field's numbers.
fn types(element: Element) -> (u32, u32) {
    match element {
        Element::F64 => (DOUBLE, DOUBLES),
        Element::F32 => (7, 7),
        Element::I64 => (12, 14),
        Element::I32 => (INT32, 12),
        Element::U64 => (13, 15),
        Element::U32 => (UINT32, 13),
        Element::I16 => (3, 10),
        Element::U16 => (4, 11),
        Element::I8 => (INT8, 8),
        // The number of an enumeration's value.
        Element::U8 | Element::Enum => (2, 9),
        Element::Bool => (2, 9 | LOGICAL),
        // Struct values are stored as texts; bytes are preceded by their number.
        Element::Text(_) => (UTF16, CHAR),
        Element::Bytes(_) => (2, 9),
    }
}

/// The content of a variable or of a field of a struct.
enum Value<'a> {
    Text(&'a str),
    Struct(Vec<(String, Value<'a>)>),
    /// The stamps; number of samples.
    Stamps(u64),
    /// The values of a field; number of samples.
    Samples(&'a Field, u64),
}

impl Value<'_> {
    /// The header of an array: array flags, dimensions and name, before the content.
    fn head(&self, name: &str) -> Vec<u8> {
        let (class, extents) = match self {
            Value::Text(text) => (CHAR, vec![1, units(text).count() as u64]),
            Value::Struct(_) => (STRUCT, vec![1, 1]),
            Value::Stamps(samples) => (DOUBLES, vec![*samples, 1]),
            Value::Samples(field, samples) => (types(field.element).1, extents(field, *samples)),
        };
        let mut head = Vec::new();
        element(&mut head, UINT32, &[class.to_le_bytes(), [0; 4]].concat());
        let extents: Vec<u8> = (extents.iter())
            .flat_map(|&extent| (extent as u32).to_le_bytes())
            .collect();
        element(&mut head, INT32, &extents);
        element(&mut head, INT8, name.as_bytes());
        head
    }

    /// Type and length, bytes, of the numbers of an array.
    fn numbers(&self) -> Option<(u32, u64)> {
        match self {
            Value::Stamps(samples) => Some((DOUBLE, 8 * samples)),
            Value::Samples(field, samples) => {
                let (parts, size) = parts(field.element);
                let bytes = (field.len() * parts.unwrap_or(1) * size) as u64;
                Some((types(field.element).0, bytes * samples))
            }
            Value::Text(_) | Value::Struct(_) => None,
        }
    }

    /// The length of the element, bytes, after its tag.
    fn size(&self, name: &str) -> u64 {
        let head = self.head(name).len() as u64;
        head + match self {
            Value::Text(text) => 8 + padded(2 * units(text).count() as u64),
            Value::Struct(fields) => {
                let names = 8 + 8 + padded((NAME_ROOM * fields.len()) as u64);
                names + fields.iter().map(|(_, value)| 8 + value.size("")).sum::<u64>()
            }
            Value::Stamps(_) | Value::Samples(..) => 8 + padded(self.numbers().map_or(0, |(_, bytes)| bytes)),
        }
    }

    /// Writes everything but the numbers of arrays, and records in `offsets` where those belong.
    fn write(&self, name: &str, out: &mut BufWriter<File>, offsets: &mut Vec<u64>) -> io::Result<()> {
        out.write_all(&tag(MATRIX, self.size(name)))?;
        out.write_all(&self.head(name))?;
        match self {
            Value::Text(text) => {
                let mut whole = Vec::new();
                let bytes: Vec<u8> = units(text).flat_map(u16::to_le_bytes).collect();
                element(&mut whole, UTF16, &bytes);
                out.write_all(&whole)
            }
            Value::Struct(fields) => {
                // The length of names uses the short form: type and length share a word with the data.
                out.write_all(&(INT32 | 4 << 16).to_le_bytes())?;
                out.write_all(&(NAME_ROOM as u32).to_le_bytes())?;
                let mut names = vec![0; NAME_ROOM * fields.len()];
                for (room, (name, _)) in names.chunks_mut(NAME_ROOM).zip(fields) {
                    room[..name.len()].copy_from_slice(name.as_bytes());
                }
                let mut whole = Vec::new();
                element(&mut whole, INT8, &names);
                out.write_all(&whole)?;
                fields.iter().try_for_each(|(_, value)| value.write("", out, offsets))
            }
            Value::Stamps(_) | Value::Samples(..) => {
                let (kind, bytes) = self.numbers().unwrap_or_default();
                out.write_all(&tag(kind, bytes))?;
                let at = out.stream_position()?;
                offsets.push(at);
                out.seek(SeekFrom::Start(at + padded(bytes))).map(|_| ())
            }
        }
    }
}

/// The number of numbers of an element in the file, where it is not stored as one, and the bytes of each of them.
fn parts(element: Element) -> (Option<usize>, usize) {
    match element {
        Element::Text(room) => (Some(room as usize), 2),
        Element::Bytes(_) => (Some(element.size()), 1),
        number => (None, number.size()),
    }
}

/// The samples of a field are along the first dimension, as in tables; along the last one where each sample is a picture or
/// similar.
fn extents(field: &Field, samples: u64) -> Vec<u64> {
    let own = field.shape.iter().map(|&extent| u64::from(extent));
    if let (Some(parts), _) = parts(field.element) {
        let own = std::iter::once(samples).chain(own);
        return own.chain([parts as u64]).collect();
    }
    match (is_wide(field), &field.shape[..]) {
        (true, _) => own.chain([samples]).collect(),
        (false, []) => vec![samples, 1],
        (false, _) => std::iter::once(samples).chain(own).collect(),
    }
}

/// The UTF-16 of a text. A character outside the basic plane is replaced, because readers differ in counting it as one or
/// two.
fn units(text: &str) -> impl Iterator<Item = u16> {
    text.chars()
        .map(|letter| u16::try_from(u32::from(letter)).unwrap_or(0xfffd))
}

fn padded(bytes: u64) -> u64 {
    bytes.next_multiple_of(8)
}

fn tag(kind: u32, bytes: u64) -> [u8; 8] {
    let mut tag = [0; 8];
    tag[..4].copy_from_slice(&kind.to_le_bytes());
    tag[4..].copy_from_slice(&(bytes as u32).to_le_bytes());
    tag
}

fn element(out: &mut Vec<u8>, kind: u32, bytes: &[u8]) {
    out.extend(tag(kind, bytes.len() as u64));
    out.extend(bytes);
    out.resize(out.len().next_multiple_of(8), 0);
}

/// Reserved words of MATLAB.
const KEYWORDS: [&str; 20] = [
    "break",
    "case",
    "catch",
    "classdef",
    "continue",
    "else",
    "elseif",
    "end",
    "for",
    "function",
    "global",
    "if",
    "otherwise",
    "parfor",
    "persistent",
    "return",
    "spmd",
    "switch",
    "try",
    "while",
];

/// Unique names that MATLAB allows: letters, digits and underscores, starting with a letter.
fn valid(names: &[&str]) -> Vec<String> {
    let plain = |name: &str, room: usize| {
        let safe = |letter: char| if letter.is_ascii_alphanumeric() { letter } else { '_' };
        let plain: String = name.chars().map(safe).collect();
        let named = plain.starts_with(|letter: char| letter.is_ascii_alphabetic()) && !KEYWORDS.contains(&&*plain);
        let mut plain = if named { plain } else { format!("x{plain}") };
        plain.truncate(room);
        plain
    };
    let wanted = names.iter().map(|name| plain(name, NAME)).collect();
    distinct(wanted, |at, n| {
        let number = format!("_{n}");
        plain(names[at], NAME - number.len()) + &number
    })
}

/// The variable of a stream: its stamps and fields as arrays, and their description.
fn variable<'a>(spec: &'a StreamSpec, name: &'a str, samples: u64) -> Value<'a> {
    let fields: Vec<&Field> = fields(spec).collect();
    // The names that every stream has are reserved before those of the fields.
    let own = ["t", "info", "stream"];
    let wanted: Vec<&str> = own.into_iter().chain(fields.iter().map(|field| &*field.name)).collect();
    let names = valid(&wanted).split_off(own.len());
    let about = |field: &'a Field| {
        Value::Struct(vec![
            ("name".into(), Value::Text(&field.name)),
            ("unit".into(), Value::Text(&field.unit)),
            ("frame".into(), Value::Text(&field.frame)),
        ])
    };
    let info = names.iter().cloned().zip(fields.iter().copied().map(about)).collect();
    let arrays = fields.iter().copied().map(|field| Value::Samples(field, samples));
    let mut all = vec![("t".into(), Value::Stamps(samples))];
    all.extend(names.into_iter().zip(arrays));
    all.push(("info".into(), Value::Struct(info)));
    all.push(("stream".into(), Value::Text(name)));
    Value::Struct(all)
}

/// The first stream that is too large for a variable, with its length, bytes.
pub(super) fn too_large(source: &dyn Source) -> Option<(String, u64)> {
    let sizes = source.streams().iter().enumerate().map(|(stream, spec)| {
        let name = spec.name();
        let size = variable(spec, &name, source.count(stream)).size(&name);
        (name, size)
    });
    sizes.into_iter().find(|(_, size)| *size > LARGEST)
}

/// Writes a file with a variable for each stream, and `escapement` for the information about the run.
pub(super) fn write(source: &dyn Source, about: &Metadata, file: &mut BufWriter<File>) -> Result<(), WriteError> {
    let text = "MATLAB 5.0 MAT-file, written by Escapement";
    write!(file, "{text:<124}")?;
    file.write_all(&0x0100_u16.to_le_bytes())?;
    file.write_all(b"IM")?;
    let names: Vec<String> = source.streams().iter().map(StreamSpec::name).collect();
    let wanted: Vec<&str> = std::iter::once("escapement")
        .chain(names.iter().map(|name| &**name))
        .collect();
    let variables = valid(&wanted);
    let known = about.iter().map(|(key, value)| ((*key).to_owned(), Value::Text(value)));
    Value::Struct(known.collect()).write(&variables[0], file, &mut Vec::new())?;
    let mut all = Vec::new();
    for (stream, spec) in source.streams().iter().enumerate() {
        let mut offsets = Vec::new();
        let value = variable(spec, &names[stream], source.count(stream));
        value.write(&variables[1 + stream], file, &mut offsets)?;
        all.push(offsets);
    }
    file.flush()?;
    let mut file = file.get_ref();
    // The file may end with numbers that are not yet written.
    file.set_len(file.stream_position()?)?;
    for (stream, offsets) in all.iter().enumerate() {
        write_numbers(source, stream, offsets, file)?;
    }
    Ok(())
}

/// Writes the numbers of a stream to their `offsets`: those of the stamps and of each field.
fn write_numbers(source: &dyn Source, stream: usize, offsets: &[u64], file: &File) -> Result<(), WriteError> {
    let spec = &source.streams()[stream];
    let (stride, samples) = (spec.stride(), source.count(stream));
    let stamps = Column {
        start: 0,
        size: 8,
        at: offsets[0],
        part: None,
        room: 0,
    };
    let mut columns = vec![stamps];
    let mut wide = Vec::new();
    for (field, &at) in fields(spec).zip(&offsets[1..]) {
        let (start, size) = (8 + field.offset as usize, field.element.size());
        let offsets = column_major(field);
        if let (Some(parts), each) = parts(field.element) {
            let columns_of = (0..parts).flat_map(|part| offsets.iter().map(move |offset| (part, offset)));
            columns.extend(columns_of.enumerate().map(|(number, (part, offset))| Column {
                start: start + offset * size,
                size: each,
                at: at + number as u64 * samples * each as u64,
                part: Some(part),
                room: size,
            }));
            continue;
        }
        if is_wide(field) {
            wide.push((start, size, offsets, at));
            continue;
        }
        columns.extend(offsets.iter().enumerate().map(|(number, offset)| Column {
            start: start + offset * size,
            size,
            at: at + number as u64 * samples * size as u64,
            part: None,
            room: size,
        }));
    }
    let room = (CHUNK / stride).max(1) as u64;
    let (mut first, mut records, mut bytes) = (0, Vec::new(), Vec::new());
    while first < samples {
        let count = room.min(samples - first);
        records.resize(count as usize * stride, 0);
        source.read(stream, first, &mut records)?;
        for column in &columns {
            bytes.clear();
            for record in records.chunks_exact(stride) {
                column.put(record, &mut bytes);
            }
            file.write_all_at(&bytes, column.at + first * column.size as u64)?;
        }
        for (start, size, offsets, at) in &wide {
            for (record, number) in records.chunks_exact(stride).zip(first..) {
                bytes.clear();
                for offset in offsets {
                    let from = start + offset * size;
                    bytes.extend_from_slice(&record[from..from + size]);
                }
                file.write_all_at(&bytes, at + number * bytes.len() as u64)?;
            }
        }
        first += count;
    }
    Ok(())
}

/// The values of one element of a field, contiguous in the file.
struct Column {
    /// Offset in a record, and size, bytes.
    start: usize,
    size: usize,
    /// Offset in the file.
    at: u64,
    /// For a text or bytes: the number of the character or byte of this column, and the size of the element in the record.
    part: Option<usize>,
    room: usize,
}

impl Column {
    /// Appends the column's part of a record. A text is padded with zeros.
    fn put(&self, record: &[u8], out: &mut Vec<u8>) {
        match (self.part, self.size) {
            (None, size) => out.extend_from_slice(&record[self.start..self.start + size]),
            (Some(part), 2) => {
                let text = Element::Text(self.room as u32).content(&record[self.start..self.start + self.room]);
                let unit = match text {
                    Ok(Content::Text(text)) => units(text).nth(part),
                    _ => None,
                };
                out.extend_from_slice(&unit.unwrap_or(0).to_le_bytes());
            }
            (Some(part), _) => out.push(record[self.start + part]),
        }
    }
}

/// The row-major offsets (last dimension fastest) of the elements in column-major order (first dimension fastest).
fn column_major(field: &Field) -> Vec<usize> {
    let offset = |mut number: usize| {
        let mut offset = 0;
        for &extent in &field.shape {
            let extent = extent as usize;
            offset = offset * extent + number % extent;
            number /= extent;
        }
        offset
    };
    (0..field.len()).map(offset).collect()
}
