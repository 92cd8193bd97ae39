//! The text of a scenario, parsed into a table.

use std::ops::Range;
use std::path::Path;

use toml::Table;

use crate::scenario::error::{Mistake, ScenarioError};

/// The text of `file`.
pub(super) fn read(file: &Path) -> Result<String, ScenarioError> {
    std::fs::read_to_string(file).map_err(|error| file_error(file, None, format!("cannot be read: {error}")))
}

/// Parses `text`, the content of `file`, into a table.
pub(super) fn parse(file: &Path, text: &str) -> Result<Table, ScenarioError> {
    text.parse::<Table>().map_err(|error| {
        let line = error.span().map(|span| line_of(text, &span));
        file_error(file, line, format!("is not TOML: {}", error.message()))
    })
}

/// A mistake of the whole file.
fn file_error(file: &Path, line: Option<usize>, reason: String) -> ScenarioError {
    ScenarioError {
        file: file.to_owned(),
        mistakes: vec![Mistake {
            line,
            key: String::new(),
            reason,
        }],
    }
}

/// The line where `span` begins, from 1.
pub(super) fn line_of(text: &str, span: &Range<usize>) -> usize {
    text.as_bytes()[..span.start.min(text.len())]
        .iter()
        .filter(|&&byte| byte == b'\n')
        .count()
        + 1
}
