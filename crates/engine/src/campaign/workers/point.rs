//! One point: a run in this process that keeps figures, and the tape only on request.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use lockstep::plan::Plan;
use serde::{Deserialize, Serialize};
use tape::folder::RunFolder;

use crate::Catalogue;
use crate::campaign::figures::Figures;
use crate::run::{self, BatchedRun, Ending, RunFailure};
use crate::scenario::{Program, Scenario, ScenarioSpec};

/// The outcome of a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// It ran, and every criterion is met.
    Met,
    /// It ran, and a criterion is not met.
    NotMet,
    /// It ran, and the scenario has no criteria.
    Complete,
    /// The scenario with these changes is refused.
    Refused,
    /// A participant failed.
    Failed,
    /// The process that ran it ended abnormally.
    Crashed,
}

impl Outcome {
    /// The name in the table.
    pub fn name(self) -> &'static str {
        match self {
            Outcome::Met => "met",
            Outcome::NotMet => "not-met",
            Outcome::Complete => "complete",
            Outcome::Refused => "refused",
            Outcome::Failed => "failed",
            Outcome::Crashed => "crashed",
        }
    }

    /// Whether the run reached its end.
    pub fn ran(self) -> bool {
        matches!(self, Outcome::Met | Outcome::NotMet | Outcome::Complete)
    }

    /// Whether the run reached its end and missed no criterion.
    pub fn good(self) -> bool {
        matches!(self, Outcome::Met | Outcome::Complete)
    }
}

/// The result of a point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Result {
    /// The outcome.
    pub outcome: Outcome,
    /// Why it did not run, or which criteria are not met.
    pub reason: Option<String>,
    /// The figures of merit, if it has any.
    pub figures: Option<Figures>,
    /// The digest of its tape, the same as that of a single run, where requested.
    pub tape: Option<String>,
}

impl Result {
    /// A point without figures.
    pub fn without(outcome: Outcome, reason: impl Into<String>) -> Result {
        Result {
            outcome,
            reason: Some(reason.into()),
            figures: None,
            tape: None,
        }
    }

    /// The figures of merit of a run that reached its end. Those of a run that ended before are of a part of it: they stand in the
    /// table, and enter no statistics and no picture.
    pub fn final_figures(&self) -> Option<&Figures> {
        self.figures.as_ref().filter(|_| self.outcome.ran())
    }

    /// The first difference between `self` and `other`, as text for each: the tape, the outcome, or the first figure.
    pub fn difference(&self, other: &Result) -> Option<(String, String)> {
        if let (Some(own), Some(its)) = (&self.tape, &other.tape)
            && own != its
        {
            let words = |tape: &str| format!("tape {}…", tape.get(..10).unwrap_or(tape));
            return Some((words(own), words(its)));
        }
        if self.outcome != other.outcome {
            return Some((self.outcome.name().into(), other.outcome.name().into()));
        }
        self.figures.as_ref()?.difference(other.figures.as_ref()?)
    }

    /// The result of a run.
    pub fn of_run(run: &run::Outcome) -> Result {
        let figures = run.figures.as_ref();
        let (outcome, reason) = match (&run.ending, figures) {
            (Ending::Failed { participant, .. }, _) => {
                let last_output = run.logs.get(participant).map(|lines| run::last_lines(lines));
                (
                    Outcome::Failed,
                    run.ending
                        .reason()
                        .map(|words| words + &last_output.unwrap_or_default()),
                )
            }
            (Ending::Stopped { reason }, _) => (Outcome::Crashed, Some(reason.clone())),
            (Ending::Complete, None) => (Outcome::Complete, None),
            (Ending::Complete, Some(figures)) if figures.met() => match figures.criteria[..] {
                [] => (Outcome::Complete, None),
                _ => (Outcome::Met, None),
            },
            (Ending::Complete, Some(figures)) => {
                let missed = figures.criteria.iter().filter(|criterion| !criterion.met);
                let missed: Vec<&str> = missed.map(|criterion| criterion.name.as_str()).collect();
                (
                    Outcome::NotMet,
                    Some(figures.incomplete.clone().unwrap_or_else(|| missed.join(" "))),
                )
            }
        };
        Result {
            outcome,
            reason,
            figures: figures.map(Figures::of),
            tape: run.digest.map(|digest| digest.to_string()),
        }
    }
}

/// A point to be run.
#[derive(Debug, Clone)]
pub struct PointRequest {
    /// The scenario file.
    pub file: PathBuf,
    /// The specification that all points share.
    pub spec: ScenarioSpec,
    /// The point's own changes to it.
    pub changes: Vec<String>,
    /// The run folder, if it is kept.
    pub keep: Option<PathBuf>,
    /// The path where a temporary run folder may be made.
    pub scratch: PathBuf,
    /// Whether the result has the digest of the tape.
    pub digests: bool,
}

/// A point that was begun.
pub enum StartedPoint {
    /// The point is already over.
    Finished(Result),
    /// The point runs beside others.
    Batched(Box<BatchedRun>),
}

impl PointRequest {
    /// Begins the point. A point that can run beside others has advanced no step on return; any other point, and every
    /// point begun with `alone`, is over.
    pub fn start(&self, catalogue: &Arc<Catalogue>, alone: bool) -> StartedPoint {
        catch_panic(|| self.start_unguarded(catalogue, alone)).unwrap_or_else(StartedPoint::Finished)
    }

    fn start_unguarded(&self, catalogue: &Arc<Catalogue>, alone: bool) -> StartedPoint {
        let mut spec = self.spec.clone();
        let changed = spec.vary(&self.changes);
        let scenario = match changed.and_then(|()| Scenario::of(catalogue, spec, &self.file)) {
            Ok(scenario) => scenario,
            Err(error) => return StartedPoint::Finished(self.refused(&error)),
        };
        let in_process = !scenario.programs().any(Program::is_external);
        let mut options = run::Options {
            in_process,
            no_placement: true,
            ..run::Options::default()
        };
        let scenario = Arc::new(scenario);
        let result = if in_process && self.keep.is_none() {
            // Outputs that no figure reads are not recorded, and need not be computed.
            options.record = if self.digests {
                run::Record::Digest
            } else {
                run::Record::Nothing
            };
            match alone {
                true => run_to_end(scenario, options),
                false => match BatchedRun::begin(scenario, options) {
                    Ok(run) => return StartedPoint::Batched(Box::new(run)),
                    Err(failure) => Err(failure),
                },
            }
        } else {
            // Because the folder is requested, or because a participant is an external program.
            let out = self.keep.as_ref().unwrap_or(&self.scratch);
            // Remains of an interrupted campaign are incomplete.
            let _ = std::fs::remove_dir_all(out);
            options.out = Some(out.to_owned());
            let result = run_to_end(scenario, options);
            if self.keep.is_none() {
                let _ = std::fs::remove_dir_all(out);
            }
            result
        };
        StartedPoint::Finished(result.map_or_else(
            |failure| self.failed(&failure),
            |result| self.with_requested_digest(result),
        ))
    }

    /// The result of a run that has reached its end.
    pub fn finish(&self, run: Box<BatchedRun>) -> Result {
        catch_panic(|| self.with_requested_digest(Result::of_run(&run.conclude()))).unwrap_or_else(|panic| panic)
    }

    /// A result with the digest, where requested.
    fn with_requested_digest(&self, result: Result) -> Result {
        Result {
            tape: result.tape.filter(|_| self.digests),
            ..result
        }
    }

    fn failed(&self, failure: &RunFailure) -> Result {
        match failure.exit_code() {
            2 => self.refused(failure),
            _ => Result::without(Outcome::Failed, failure.to_string()),
        }
    }

    fn refused(&self, error: &dyn std::fmt::Display) -> Result {
        Result::without(Outcome::Refused, without_location(&self.file, &error.to_string()))
    }
}

/// The result of `work`, or a failed point where it panics.
pub fn catch_panic<T>(work: impl FnOnce() -> T) -> std::result::Result<T, Result> {
    // The process's panic hook prints the message; it is needed here as well.
    let message = Arc::new(Mutex::new(String::new()));
    let panic_message = message.clone();
    std::panic::set_hook(Box::new(move |panic| {
        *panic_message.lock().unwrap_or_else(PoisonError::into_inner) = panic.to_string();
    }));
    let result = catch_unwind(AssertUnwindSafe(work));
    let _ = std::panic::take_hook();
    result.map_err(|_| {
        let message = message.lock().unwrap_or_else(PoisonError::into_inner);
        Result::without(Outcome::Failed, message.replace('\n', " "))
    })
}

/// A message about the scenario `file`, made independent of its place, because a row must not depend on that.
fn without_location(file: &Path, message: &str) -> String {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let folder = file.parent().unwrap_or(Path::new("")).display().to_string();
    let message = message.replace(&file.display().to_string(), &name);
    // Paths in it are quoted.
    message.replace(&format!("`{folder}/"), "`")
}

/// Runs to the end, and writes the summary to the folder if there is one.
fn run_to_end(scenario: Arc<Scenario>, options: run::Options) -> std::result::Result<Result, RunFailure> {
    let outcome = run::run_shared(scenario, options)?;
    if let Some(folder) = &outcome.folder {
        let folder = RunFolder::open(folder);
        if let Err(error) = folder.write_json(&folder.summary(), &outcome.summary()) {
            return Ok(Result::without(Outcome::Crashed, error.to_string()));
        }
    }
    Ok(Result::of_run(&outcome))
}

/// The figures of merit and the criteria of runs of `scenario`, without values.
pub fn figures_of(scenario: &Scenario, plan: &Plan) -> Figures {
    let assessment = scenario.assess(&run::streams(plan)).ok().flatten();
    let none = || Figures::new(Vec::new(), Vec::new());
    assessment.map_or_else(none, |mut assessment| Figures::of(&assessment.finish(Vec::new())))
}

/// The name of the outcome of a point, also where it was not run.
pub fn outcome_name(result: Option<&Result>) -> &'static str {
    result.map_or("not run", |result| result.outcome.name())
}
