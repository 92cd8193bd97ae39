//! ZIP archives, the format of FMUs: deterministic, so without timestamps.

use miniz_oxide::deflate::compress_to_vec;

/// 1 January 1980, the earliest date of the format.
const DATE: u16 = 0x21;
const DEFLATED: u16 = 8;
/// Names are UTF-8.
const FLAGS: u16 = 1 << 11;
/// Created on Unix, by version 2.0 of the format.
const MADE: u16 = 3 << 8 | 20;
const NEEDED: u16 = 20;
/// A compromise of speed and size: a library of ten megabytes takes a second.
const LEVEL: u8 = 6;

/// An archive under construction.
#[derive(Default)]
pub struct Pack {
    bytes: Vec<u8>,
    directory: Vec<u8>,
    count: u16,
}

impl Pack {
    /// Adds a file. `executable` is for libraries.
    ///
    /// # Errors
    /// When the archive would exceed the limits of the format.
    pub fn add(&mut self, name: &str, contents: &[u8], executable: bool) -> Result<(), String> {
        let refuse = || format!("the FMU with `{name}` is larger than 4 GiB");
        let packed = compress_to_vec(contents, LEVEL);
        let short = |size: usize| u32::try_from(size).map_err(|_| refuse());
        let (packed_size, size, at) = (short(packed.len())?, short(contents.len())?, short(self.bytes.len())?);
        let length = u16::try_from(name.len()).map_err(|_| refuse())?;
        let common = [
            &NEEDED.to_le_bytes()[..],
            &FLAGS.to_le_bytes(),
            &DEFLATED.to_le_bytes(),
            &0_u16.to_le_bytes(),
            &DATE.to_le_bytes(),
            &crc32fast::hash(contents).to_le_bytes(),
            &packed_size.to_le_bytes(),
            &size.to_le_bytes(),
            &length.to_le_bytes(),
            &0_u16.to_le_bytes(),
        ]
        .concat();
        for part in [&b"PK\x03\x04"[..], &common, name.as_bytes(), &packed] {
            self.bytes.extend_from_slice(part);
        }
        let mode: u32 = if executable { 0o100_755 } else { 0o100_644 };
        for part in [
            &b"PK\x01\x02"[..],
            &MADE.to_le_bytes(),
            &common,
            // Comment, disk and internal attributes.
            &[0; 6],
            &(mode << 16).to_le_bytes(),
            &at.to_le_bytes(),
            name.as_bytes(),
        ] {
            self.directory.extend_from_slice(part);
        }
        self.count += 1;
        Ok(())
    }

    /// The archive.
    pub fn finish(mut self) -> Vec<u8> {
        let (at, size) = (self.bytes.len() as u32, self.directory.len() as u32);
        self.bytes.append(&mut self.directory);
        for part in [
            &b"PK\x05\x06"[..],
            &[0; 4],
            &self.count.to_le_bytes(),
            &self.count.to_le_bytes(),
            &size.to_le_bytes(),
            &at.to_le_bytes(),
            &[0; 2],
        ] {
            self.bytes.extend_from_slice(part);
        }
        self.bytes
    }
}
