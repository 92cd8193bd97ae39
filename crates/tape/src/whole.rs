//! Files that are there whole or not at all.

use std::io;
use std::path::{Path, PathBuf};

/// Writes `content` to `path`, so that a reader sees all of it or what was there before. A program that is killed meanwhile leaves a draft,
/// `path` with `.part` behind it.
pub fn write_whole(path: &Path, content: impl AsRef<[u8]>) -> io::Result<()> {
    let mut draft = path.as_os_str().to_owned();
    draft.push(".part");
    let draft = PathBuf::from(draft);
    let written = std::fs::write(&draft, content).and_then(|()| std::fs::rename(&draft, path));
    written.inspect_err(|_| {
        let _ = std::fs::remove_file(&draft);
    })
}
