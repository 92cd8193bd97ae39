//! Opening files of a run folder, which is not trusted.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;

/// Opens the regular file `path` for reading. Anything else of that name is refused without being opened: opening a named pipe waits
/// for a writer, possibly for ever, and opening a device may have side effects.
///
/// # Errors
/// Those of the file system, and the kind of entry that is found in place of the file.
pub fn open_regular(path: &Path) -> io::Result<File> {
    let about = fs::metadata(path)?;
    if about.is_file() {
        return File::open(path);
    }
    let kind = if about.is_dir() {
        "folder"
    } else {
        "pipe, socket or device"
    };
    let reason = format!("it is a {kind}, not a regular file: put the file of a copy of the run in its place");
    Err(io::Error::new(io::ErrorKind::InvalidInput, reason))
}

/// The content of the regular file `path`, under the rule of [`open_regular`].
///
/// # Errors
/// As there.
pub fn read_regular(path: &Path) -> io::Result<Vec<u8>> {
    let mut content = Vec::new();
    open_regular(path)?.read_to_end(&mut content)?;
    Ok(content)
}
