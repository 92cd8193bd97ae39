//! Errors of a package that is rejected.

use std::fmt;
use std::path::PathBuf;

use fmu::{FmuError, ZipError};

/// A problem in a package, or something that a scenario cannot express, with its location.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problem {
    /// The file inside the package.
    pub file: String,
    /// The line, from 1.
    pub line: u32,
    /// The problem, with the element and the remedy.
    pub reason: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}: {}", self.file, self.line, self.reason)
    }
}

/// The reason why a package is rejected.
#[derive(Debug, thiserror::Error)]
pub enum SspError {
    /// The package cannot be read.
    #[error("`{}`: {source}", .path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
    /// The archive is rejected.
    #[error("`{}`: {source}; an SSP is a ZIP archive with a SystemStructure.ssd in it", .path.display())]
    Zip {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: ZipError,
    },
    /// The file is not a package.
    #[error("`{}`: {reason}", .path.display())]
    Missing {
        /// The file.
        path: PathBuf,
        /// What is missing.
        reason: String,
    },
    /// An FMU of the package is rejected.
    #[error(transparent)]
    Fmu(#[from] FmuError),
    /// The content is wrong, or a scenario cannot express it.
    #[error("{}", listed(.path, .problems))]
    Refused {
        /// The file.
        path: PathBuf,
        /// All problems, in the order of the files.
        problems: Vec<Problem>,
    },
}

/// One line for each problem.
fn listed(path: &std::path::Path, problems: &[Problem]) -> String {
    let lines = problems.iter().map(|problem| format!("{}: {problem}", path.display()));
    lines.collect::<Vec<_>>().join("\n")
}
