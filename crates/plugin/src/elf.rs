//! A check of a library's ELF header before loading, because loading runs code.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::LoadError;

/// The size of the part of an ELF header that is checked.
const HEADER: usize = 20;
const SHARED: u16 = 3;

/// The machine type of this program, as an ELF number, and its name.
const OWN_MACHINE: (u16, &str) = if cfg!(target_arch = "x86_64") {
    (62, "x86-64")
} else if cfg!(target_arch = "aarch64") {
    (183, "AArch64")
} else if cfg!(target_arch = "riscv64") {
    (243, "RISC-V")
} else {
    (0, "this machine")
};

/// Checks that `file` can be a library for this machine.
///
/// # Errors
/// When it cannot be read, is not a shared library, or is one for another machine.
pub fn look(file: &Path) -> Result<(), LoadError> {
    let wrong = |reason: String| LoadError::NoLibrary {
        file: file.to_owned(),
        reason,
    };
    let opened = File::open(file).and_then(|file| file.metadata().map(|about| (file, about)));
    let (opened, about) = opened.map_err(|error| wrong(error.to_string()))?;
    if !about.is_file() {
        return Err(wrong("is not a file".into()));
    }
    let mut header = Vec::new();
    let read = opened.take(HEADER as u64).read_to_end(&mut header);
    read.map_err(|error| wrong(error.to_string()))?;
    if header.len() < HEADER || !header.starts_with(b"\x7fELF") {
        return Err(wrong("is not an ELF file".into()));
    }
    let machine = u16::from_le_bytes([header[18], header[19]]);
    // 64 bits, little-endian.
    if (header[4], header[5]) != (2, 1) || (OWN_MACHINE.0 != 0 && machine != OWN_MACHINE.0) {
        return Err(LoadError::Machine {
            file: file.to_owned(),
            found: machine_name(header[4], machine),
            own: OWN_MACHINE.1,
        });
    }
    if u16::from_le_bytes([header[16], header[17]]) != SHARED {
        return Err(wrong("is an object or a program, not a shared library".into()));
    }
    Ok(())
}

fn machine_name(class: u8, machine: u16) -> String {
    let known = match machine {
        3 => "x86",
        40 => "Arm",
        62 => "x86-64",
        183 => "AArch64",
        243 => "RISC-V",
        _ => return format!("ELF machine {machine}"),
    };
    let bits = if class == 1 { ", 32 bits" } else { "" };
    format!("{known}{bits}")
}
