//! Files of a run folder that describe the run. Each of them may be missing: a bare tape has none, and a run that was killed has no
//! summary. A file that is there and cannot be read is an error, because a page or an export without its content looks complete.

use std::io;
use std::path::Path;

use serde_json::Value;
use tape::folder::RunFolder;
use toml::Table;

use super::error::ReportError;

/// The plan of a run.
#[derive(Debug, Clone, Default)]
pub struct PlanFile {
    /// The text of `plan.toml`; empty where there is none.
    pub text: String,
    /// The content.
    pub table: Table,
}

impl PlanFile {
    /// Reads the plan of the run in `folder`.
    ///
    /// # Errors
    /// A `plan.toml` that cannot be read or is not TOML.
    pub fn read(folder: &RunFolder) -> Result<PlanFile, ReportError> {
        let path = folder.plan();
        let Some(bytes) = content(&path)? else {
            return Ok(PlanFile::default());
        };
        let damaged = |line: Option<usize>, reason: &str| {
            let line = line.map(|line| format!("line {line}: ")).unwrap_or_default();
            let remedy = "put the plan of a copy of the run in its place, or move it away to do without a plan";
            file_error(&path, format!("{line}{reason}: {remedy}"))
        };
        let line_of = |at: usize| {
            bytes[..at.min(bytes.len())]
                .iter()
                .filter(|&&byte| byte == b'\n')
                .count()
                + 1
        };
        let text = String::from_utf8(bytes.clone())
            .map_err(|error| damaged(Some(line_of(error.utf8_error().valid_up_to())), "it is not UTF-8"))?;
        let table = text.parse::<Table>().map_err(|error| {
            let line = error.span().map(|span| line_of(span.start));
            damaged(line, &format!("it is not TOML: {}", error.message()))
        })?;
        Ok(PlanFile { text, table })
    }
}

/// The content of a JSON file; null where there is none.
///
/// # Errors
/// A file that cannot be read or is not JSON.
pub fn read_json(path: &Path) -> Result<Value, ReportError> {
    match content(path)? {
        Some(text) => serde_json::from_slice(&text).map_err(|error| file_error(path, format!("is not JSON: {error}"))),
        None => Ok(Value::Null),
    }
}

/// The bytes of the file `path`; `None` where there is none.
fn content(path: &Path) -> Result<Option<Vec<u8>>, ReportError> {
    match tape::read_regular(path) {
        Ok(bytes) => Ok(Some(bytes)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(file_error(path, format!("cannot be read: {error}"))),
    }
}

fn file_error(path: &Path, reason: String) -> ReportError {
    ReportError::File {
        path: path.to_owned(),
        reason,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unreadable_plan_is_refused_with_its_line() {
        let root = std::env::temp_dir().join(format!("report-plans-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&root);
        std::fs::create_dir_all(&root).unwrap();
        let folder = RunFolder::open(&root);
        assert_eq!(PlanFile::read(&folder).unwrap().text, "");
        let path = folder.plan();
        std::fs::write(&path, "seed = 7\n").unwrap();
        assert_eq!(PlanFile::read(&folder).unwrap().table["seed"].as_integer(), Some(7));
        let broken: [(&[u8], &str); 2] = [
            (b"seed = 7\nduration = \n", "line 2"),
            (b"seed = 7\n\n# \xff\n", "line 3"),
        ];
        for (bytes, line) in broken {
            std::fs::write(&path, bytes).unwrap();
            let error = PlanFile::read(&folder).unwrap_err().to_string();
            let parts = [&*path.to_string_lossy(), line, "copy of the run"];
            assert!(parts.iter().all(|part| error.contains(part)), "{error}");
        }
        std::fs::remove_file(&path).unwrap();
        std::fs::create_dir(&path).unwrap();
        let error = PlanFile::read(&folder).unwrap_err().to_string();
        assert!(error.contains("not a regular file"), "{error}");
        std::fs::remove_dir_all(&root).unwrap();
    }
}
