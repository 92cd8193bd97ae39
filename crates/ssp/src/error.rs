//! Why a package is refused.

use std::fmt;
use std::path::PathBuf;

use fmu::{FmuError, ZipError};

/// Something that is wrong, or that a scenario cannot express, with its place.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problem {
    /// The file inside the package.
    pub file: String,
    /// The line, from 1.
    pub line: u32,
    /// What is wrong, with the element, and the remedy.
    pub reason: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}: {}", self.file, self.line, self.reason)
    }
}

/// Why a package is refused.
#[derive(Debug, thiserror::Error)]
pub enum SspError {
    /// It cannot be read.
    #[error("`{}`: {source}", .path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// Its archive is refused.
    #[error("`{}`: {source}; an SSP is a ZIP archive with a SystemStructure.ssd in it", .path.display())]
    Zip {
        /// The file.
        path: PathBuf,
        /// Why.
        source: ZipError,
    },
    /// It is no package at all.
    #[error("`{}`: {reason}", .path.display())]
    Missing {
        /// The file.
        path: PathBuf,
        /// What is missing.
        reason: String,
    },
    /// An FMU in it is refused.
    #[error(transparent)]
    Fmu(#[from] FmuError),
    /// What stands in it is wrong, or cannot be expressed.
    #[error("{}", listed(.path, .problems))]
    Refused {
        /// The file.
        path: PathBuf,
        /// Everything that was found, in the order of the files.
        problems: Vec<Problem>,
    },
}

/// One line for each problem.
fn listed(path: &std::path::Path, problems: &[Problem]) -> String {
    let lines = problems.iter().map(|problem| format!("{}: {problem}", path.display()));
    lines.collect::<Vec<_>>().join("\n")
}
