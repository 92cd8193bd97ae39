//! Atomic writing of files.

use std::io;
use std::path::{Path, PathBuf};

/// Writes `content` to `path` atomically: a reader sees all of it or the previous content. A program that is killed in the meantime
/// leaves a draft with the suffix `.part` after `path`.
pub fn write_atomic(path: &Path, content: impl AsRef<[u8]>) -> io::Result<()> {
    let mut draft = path.as_os_str().to_owned();
    draft.push(".part");
    let draft = PathBuf::from(draft);
    let written = std::fs::write(&draft, content).and_then(|()| std::fs::rename(&draft, path));
    written.inspect_err(|_| {
        let _ = std::fs::remove_file(&draft);
    })
}
