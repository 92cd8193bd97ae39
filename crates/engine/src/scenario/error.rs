//! Errors in a scenario, and where they are.

use std::fmt;
use std::path::PathBuf;

/// One mistake.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mistake {
    /// The line in the file, from 1, if it is known.
    pub line: Option<usize>,
    /// The dotted key; empty when the mistake concerns the whole file.
    pub key: String,
    /// What is wrong, with the value and the remedy.
    pub reason: String,
}

/// All mistakes in a scenario.
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
            // A scenario made in code has no file yet.
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
