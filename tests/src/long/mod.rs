//! Long tests: random signals, undisturbed starts and suspensions, as many rounds as time allows.
//!
//! A round is a function of a seed and its number, as far as the machine's scheduling allows, so that a failed round can be repeated
//! alone. The program `long` runs the rounds; the ordinary tests run a few of them.

mod campaign;
mod case;
mod inspect;
mod rng;
mod round;
mod signals;
mod start;
pub mod work;

use case::Case;
use rng::Rng;

/// The result of a check, or the reason why the round failed.
pub type CheckResult<T> = Result<T, String>;

/// The kinds of rounds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RoundKind {
    /// Runs and campaigns whose processes get random signals at random instants, and are resumed.
    Killer,
    /// Short undisturbed runs.
    Starts,
    /// Runs whose processes are stopped and continued, for less and for more than `--patience`.
    Suspensions,
}

impl RoundKind {
    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            RoundKind::Killer => "killer",
            RoundKind::Starts => "starts",
            RoundKind::Suspensions => "suspensions",
        }
    }
}

/// The work done, apart from checking.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Tally {
    /// Runs and campaigns that were started.
    pub runs: u64,
    /// Signals that reached a process.
    pub signals: u64,
    /// Runs that were resumed, and campaigns that were continued.
    pub resumes: u64,
}

impl std::ops::AddAssign for Tally {
    fn add_assign(&mut self, other: Tally) {
        self.runs += other.runs;
        self.signals += other.signals;
        self.resumes += other.resumes;
    }
}

fn ensure_equal<T: PartialEq + std::fmt::Debug>(what: &str, found: &T, right: &T) -> CheckResult<()> {
    if found == right {
        Ok(())
    } else {
        Err(format!("{what} is {found:?}, not {right:?}"))
    }
}

fn ensure(holds: bool, otherwise: impl FnOnce() -> String) -> CheckResult<()> {
    if holds { Ok(()) } else { Err(otherwise()) }
}
