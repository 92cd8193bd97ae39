//! Arguments and exit codes of `tune`.

use std::path::PathBuf;

use clap::Args;
use synthesis::tuner::TuneError;

/// Exit code: no stabilising gain was found, or the computation failed.
pub const FAILED: i32 = 1;
/// Exit code: the specification is wrong.
pub const REFUSED: i32 = 2;
/// Exit code: gains were found, but the verification contradicts them or the validation set does not pass.
pub const NOT_MET: i32 = 3;

/// Tune gains by structured H-infinity and verify them.
///
/// SPEC is a specification of the robot's velocity loop (`.toml`, see `gains/*.spec.toml`), or a plant as plain matrices
/// (`.json` with the keys A, B1, B, C1, C, D11, D12, D21, and optionally D22 and K), for which a static output feedback
/// u = K y is tuned.
///
/// Ctrl-C ends the search and keeps the best gains so far; a second one ends the program.
///
/// Exit code 0: tuned and verified. 1: no stabilising gain found. 2: the specification is wrong. 3: the verification or the
/// validation set is not passed, or gamma falls without end as gains grow or a pole nears the axis.
#[derive(Debug, Args)]
pub struct TuneArgs {
    /// The specification
    pub spec: PathBuf,
    /// Where to write the gains; next to the specification when not given
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Take the configuration of the model from a recorded run, or from a scenario that is flown for it, at this instant;
    /// MODEL= may be left out where there is one model. The same as `at = "RUN:TIME"` of that model in the specification
    #[arg(long, value_name = "[MODEL=]RUN:TIME")]
    pub at: Vec<String>,
    /// Number of starts, in place of the specification's
    #[arg(long)]
    pub starts: Option<usize>,
    /// Seed of the search, in place of the specification's
    #[arg(long)]
    pub seed: Option<u64>,
    /// Write the generalised plant, the gains and what is claimed as plain matrices
    #[arg(long, value_name = "FILE.json")]
    pub export_problem: Option<PathBuf>,
    /// Write singular values against weights, sensitivity and mu as SVG into this folder
    #[arg(long, value_name = "FOLDER")]
    pub plots: Option<PathBuf>,
    /// Go on with links of the robot that no distribution of mass has; they are warned of
    #[arg(long)]
    pub allow_unphysical: bool,
    /// Leave out the margins
    #[arg(long)]
    pub no_margins: bool,
    /// Leave out the flights in the non-linear simulator
    #[arg(long)]
    pub no_flights: bool,
    /// Print one line for a table of several designs: gamma, full-order optimum, margins
    #[arg(long)]
    pub table: bool,
    /// Print the result as JSON
    #[arg(long)]
    pub json: bool,
}

/// The exit code for a tuner that returned no gains.
pub fn failure(error: &TuneError) -> i32 {
    match error {
        TuneError::NotStabilised { .. } | TuneError::Stopped(_) | TuneError::Linalg(_) => FAILED,
        _ => REFUSED,
    }
}
