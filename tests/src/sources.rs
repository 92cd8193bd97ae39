//! The lines of the sources, for rules about what certain files must not contain.

use std::path::{Path, PathBuf};

use crate::program::root;
use crate::workspace::Package;

/// A line of a source file.
pub struct Line {
    /// The file, from the root of the workspace.
    pub path: String,
    /// From 1 on.
    pub number: usize,
    /// The whole line.
    pub whole: String,
    /// The line without its `//` comment.
    pub code: String,
    /// Its position relative to `#[cfg(test)]`.
    pub test: bool,
}

/// The position of a line.
#[derive(Clone, Copy, PartialEq)]
enum LineKind {
    Shipped,
    /// The line `#[cfg(test)]`, or another attribute below it.
    Marked,
    /// In a module or function of tests.
    Test,
    /// The only line, or the last line, that belongs to the tests.
    Single,
}

/// The files with the given extension below `folder`, without build products.
pub fn files(folder: &Path, ending: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).into_iter().flatten().flatten() {
            let path = entry.path();
            let name = entry.file_name().to_string_lossy().into_owned();
            if path.is_dir() {
                if !matches!(name.as_str(), "target" | "runs") && !name.starts_with('.') {
                    folders.push(path);
                }
            } else if name.ends_with(ending) {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

/// The lines of a file.
///
/// # Panics
/// When it cannot be read.
pub fn lines(path: &Path) -> Vec<Line> {
    let text = std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let shown = path.strip_prefix(root()).unwrap_or(path).display().to_string();
    let mut kind = LineKind::Shipped;
    let numbered = text.lines().enumerate().map(|(number, whole)| {
        kind = match kind {
            LineKind::Shipped | LineKind::Single if whole == "#[cfg(test)]" => LineKind::Marked,
            LineKind::Marked if whole.starts_with('#') => LineKind::Marked,
            LineKind::Marked if whole.ends_with('{') => LineKind::Test,
            LineKind::Marked => LineKind::Single,
            LineKind::Test if whole == "}" => LineKind::Single,
            LineKind::Single => LineKind::Shipped,
            other => other,
        };
        let test = kind != LineKind::Shipped;
        // Two slashes after a colon are part of an address, not a comment.
        let comment = whole.match_indices("//").find(|&(at, _)| !whole[..at].ends_with(':'));
        Line {
            path: shown.clone(),
            number: number + 1,
            code: comment.map_or(whole, |(at, _)| &whole[..at]).to_owned(),
            whole: whole.to_owned(),
            test,
        }
    });
    numbered.collect()
}

/// The lines of the sources that a package ships.
pub fn shipped_lines(package: &Package) -> Vec<Line> {
    files(&package.folder.join("src"), ".rs")
        .iter()
        .flat_map(|path| lines(path))
        .collect()
}

/// Every Rust source of the workspace.
pub fn sources() -> Vec<PathBuf> {
    files(&root(), ".rs")
}

/// Fails with the file and line of every finding.
///
/// # Panics
/// When there is a finding.
pub fn assert_none(rule: &str, found: impl IntoIterator<Item = (Line, String)>) {
    let found: Vec<String> = found
        .into_iter()
        .map(|(line, what)| format!("  {}:{}: {what}: {}", line.path, line.number, line.whole.trim()))
        .collect();
    assert!(found.is_empty(), "{rule}\n{}", found.join("\n"));
}

/// The words of `words` that occur in `text` as whole words, in any case.
pub fn find_word<'a>(text: &str, words: &[&'a str]) -> Option<&'a str> {
    let lower = text.to_lowercase();
    let parts: Vec<&str> = lower.split(|c: char| !c.is_ascii_alphanumeric()).collect();
    // A plural is the same word.
    words
        .iter()
        .find(|word| {
            parts
                .iter()
                .any(|part| part.strip_suffix('s').unwrap_or(part) == **word || part == *word)
        })
        .copied()
}
