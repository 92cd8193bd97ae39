//! Arguments and exit codes of `tune`.

use std::path::{Path, PathBuf};

use clap::Args;
use synthesis::tuner::TuneError;

/// Exit code: no stabilising gain was found, or the computation failed.
pub const FAILED: i32 = 1;
/// Exit code: the specification is wrong.
pub const REFUSED: i32 = 2;
/// Exit code: gains were found, but the verification contradicts them or the validation set does not pass.
pub const NOT_MET: i32 = 3;

/// Arguments of `tune`.
#[derive(Debug, Args)]
pub struct TuneArgs {
    /// The specification
    pub spec: PathBuf,
    /// The file for the gains; by default next to the specification
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Take the configuration of the model from a recorded run, or from a scenario that is run for it, at this instant;
    /// MODEL= may be omitted if there is one model. The same as `at = "RUN:TIME"` of that model in the specification
    #[arg(long, value_name = "[MODEL=]RUN:TIME")]
    pub at: Vec<String>,
    /// Number of starts, instead of that of the specification
    #[arg(long)]
    pub starts: Option<usize>,
    /// Seed of the search, instead of that of the specification
    #[arg(long)]
    pub seed: Option<u64>,
    /// Write the generalised plant, the gains and what is claimed as plain matrices
    #[arg(long, value_name = "FILE.json")]
    pub export_problem: Option<PathBuf>,
    /// Write singular values against weights, sensitivity and mu as SVG into this folder
    #[arg(long, value_name = "FOLDER")]
    pub plots: Option<PathBuf>,
    /// Accept links of the robot with inertias that no distribution of mass has, with a warning
    #[arg(long)]
    pub allow_unphysical: bool,
    /// Leave out the margins
    #[arg(long)]
    pub no_margins: bool,
    /// Leave out the closed-loop runs in the non-linear simulator
    #[arg(long)]
    pub no_closed_loop: bool,
    /// Print one line for a table of several designs: gamma, full-order optimum, margins
    #[arg(long)]
    pub table: bool,
    /// Print the result as JSON
    #[arg(long)]
    pub json: bool,
}

impl TuneArgs {
    /// The first option given that applies to the specification of a robot alone.
    pub fn option_of_robot(&self) -> Option<&'static str> {
        let given = [
            ("--at", !self.at.is_empty()),
            ("--plots", self.plots.is_some()),
            ("--allow-unphysical", self.allow_unphysical),
            ("--no-margins", self.no_margins),
            ("--no-closed-loop", self.no_closed_loop),
            ("--table", self.table),
        ];
        given.into_iter().find(|(_, given)| *given).map(|(option, _)| option)
    }

    /// Whether the specification is a plant of matrices.
    pub fn is_of_matrices(&self) -> bool {
        self.spec.extension().is_some_and(|e| e == "json")
    }

    /// The file for the gains: `--out`; without it, for a robot alone, `x.toml` of `x.spec.toml`, and `x.gains.toml` of any other name.
    pub fn gains_path(&self) -> Option<PathBuf> {
        if self.out.is_some() || self.is_of_matrices() {
            return self.out.clone();
        }
        let name = self.spec.file_name().map(|name| name.to_string_lossy());
        Some(match name.as_deref().and_then(|name| name.strip_suffix(".spec.toml")) {
            Some(stem) => self.spec.with_file_name(format!("{stem}.toml")),
            None => self.spec.with_extension("gains.toml"),
        })
    }

    /// The files that are written, with the options that name them; `gains` is [`Self::gains_path`].
    pub fn destinations<'a>(&'a self, gains: Option<&'a Path>) -> Vec<(&'static str, &'a Path)> {
        let name = if self.out.is_some() {
            "--out"
        } else {
            "the file of gains"
        };
        let gains = gains.map(|path| (name, path));
        let export = self.export_problem.as_deref().map(|path| ("--export-problem", path));
        gains.into_iter().chain(export).collect()
    }
}

/// The exit code for a tuner that returned no gains.
pub fn failure(error: &TuneError) -> i32 {
    match error {
        TuneError::NotStabilised { .. } | TuneError::Stopped(_) | TuneError::Linalg(_) => FAILED,
        _ => REFUSED,
    }
}
