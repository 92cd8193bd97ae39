//! What is wrong with a scenario, and where.

use std::fmt;
use std::path::PathBuf;

/// One mistake.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mistake {
    /// The line in the file, from 1, where one can be told.
    pub line: Option<usize>,
    /// The key, dotted; empty when it is about the whole file.
    pub key: String,
    /// What is wrong, with the value and the remedy.
    pub reason: String,
}

/// Everything that is wrong with a scenario.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub struct ScenarioError {
    /// The file; empty where there is none.
    pub file: PathBuf,
    /// The mistakes.
    pub mistakes: Vec<Mistake>,
}

impl fmt::Display for ScenarioError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (number, mistake) in self.mistakes.iter().enumerate() {
            if number > 0 {
                writeln!(f)?;
            }
            // What code has made has no file yet.
            if !self.file.as_os_str().is_empty() {
                write!(f, "{}", self.file.display())?;
                if let Some(line) = mistake.line {
                    write!(f, ":{line}")?;
                }
                f.write_str(": ")?;
            }
            if !mistake.key.is_empty() {
                write!(f, "{}: ", mistake.key)?;
            }
            f.write_str(&mistake.reason)?;
        }
        Ok(())
    }
}
