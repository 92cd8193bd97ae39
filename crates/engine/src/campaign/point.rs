//! One point: a run in this process that keeps figures and no tape, unless the tape is wanted.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use lockstep::executor::{InLoop, assemble};
use lockstep::participant::Participant;
use lockstep::plan::Plan;
use lockstep::transport::{Broken, Header, Recording};
use serde::{Deserialize, Serialize};
use tape::folder::RunFolder;
use tape::{DigestSink, Sink};

use super::figures::{Figures, Number};
use crate::Catalogue;
use crate::assessment::{self, Assessment};
use crate::run::{self, Ending};
use crate::scenario::{Program, Scenario};

/// What became of a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// Every criterion is met.
    Met,
    /// It ran, and a criterion is not met.
    NotMet,
    /// It ran, and the scenario has no criteria.
    Complete,
    /// The scenario with these changes is refused.
    Refused,
    /// A participant failed.
    Failed,
    /// The process that ran it is gone.
    Crashed,
}

impl Outcome {
    /// As it stands in the table.
    pub fn word(self) -> &'static str {
        match self {
            Outcome::Met => "met",
            Outcome::NotMet => "not-met",
            Outcome::Complete => "complete",
            Outcome::Refused => "refused",
            Outcome::Failed => "failed",
            Outcome::Crashed => "crashed",
        }
    }

    /// Whether the run came to its end.
    pub fn ran(self) -> bool {
        matches!(self, Outcome::Met | Outcome::NotMet | Outcome::Complete)
    }

    /// Whether it came to its end and missed no criterion.
    pub fn good(self) -> bool {
        matches!(self, Outcome::Met | Outcome::Complete)
    }
}

/// The result of a point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Result {
    /// What became of it.
    pub outcome: Outcome,
    /// Why it did not run, or which criteria are not met.
    pub reason: Option<String>,
    /// The figures of merit, if it has any.
    pub figures: Option<Figures>,
    /// The digest of its tape: that of the same run by itself.
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

    fn of(ending: &Ending, figures: Option<assessment::Figures>, tape: String) -> Result {
        let (outcome, reason) = match (ending, &figures) {
            (Ending::Failed { .. }, _) => (Outcome::Failed, ending.words()),
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
            figures: figures.as_ref().map(Figures::of),
            tape: Some(tape),
        }
    }
}

/// Runs a point. `keep` names the run folder, if it is kept; `scratch` is where one may be made and removed.
pub fn run_point(
    catalogue: &Arc<Catalogue>,
    file: &Path,
    changes: &[String],
    keep: Option<&Path>,
    scratch: &Path,
) -> Result {
    // The hook of the process writes the message; it is wanted here as well.
    let message = Arc::new(Mutex::new(String::new()));
    let heard = message.clone();
    std::panic::set_hook(Box::new(move |panic| {
        *heard.lock().unwrap_or_else(PoisonError::into_inner) = panic.to_string();
    }));
    let result = catch_unwind(AssertUnwindSafe(|| judged(catalogue, file, changes, keep, scratch)));
    let _ = std::panic::take_hook();
    result.unwrap_or_else(|_| {
        let message = message.lock().unwrap_or_else(PoisonError::into_inner);
        Result::without(Outcome::Failed, message.replace('\n', " "))
    })
}

fn judged(catalogue: &Arc<Catalogue>, file: &Path, changes: &[String], keep: Option<&Path>, scratch: &Path) -> Result {
    let refused = |error: &dyn std::fmt::Display| Result::without(Outcome::Refused, error.to_string());
    let scenario = match Scenario::read(catalogue, file, changes) {
        Ok(scenario) => scenario,
        Err(error) => return refused(&error),
    };
    let made = match scenario.make_here() {
        Ok(made) => made,
        Err(error) => return refused(&error),
    };
    let here: Option<Vec<Box<dyn Participant>>> = made.into_iter().collect();
    // Who is replaced in mid-run, and what is guarded, is for the whole machinery of a run.
    let whole = scenario.substitutions.is_empty() && scenario.guards().next().is_none();
    let here = here.filter(|_| whole);
    match (here, keep) {
        (Some(participants), None) => match tapeless(&scenario, participants) {
            Ok(result) => result,
            Err(reason) => refused(&reason),
        },
        (_, keep) => {
            let in_process = !scenario.programs().any(Program::is_external);
            with_tape(&scenario, in_process, keep, scratch)
        }
    }
}

/// What a run in one process needs of a tape when only its digest and the figures matter.
struct Watch {
    sink: DigestSink,
    assessment: Option<Box<dyn Assessment>>,
    timebase: lockstep::time::Timebase,
}

struct Ear(Arc<Mutex<Watch>>);

impl Recording for Ear {
    fn try_append(&mut self, stream: u32, header: Header, payload: &[u8]) -> std::result::Result<bool, Broken> {
        let mut watch = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let stamp = watch.timebase.seconds(header.stamp);
        watch
            .sink
            .sample(stream as usize, header.index, stamp, payload)
            .map_err(|error| Broken(error.to_string()))?;
        if let Some(assessment) = &mut watch.assessment {
            assessment.sample(stream as usize, stamp, payload);
        }
        Ok(true)
    }
}

fn tapeless(scenario: &Scenario, participants: Vec<Box<dyn Participant>>) -> std::result::Result<Result, String> {
    let plan = run::check_here(scenario).map_err(|error| error.to_string())?.plan;
    let streams = run::streams(&plan);
    let assessment = scenario.assess(&streams).map_err(|error| error.to_string())?;
    let watch = Arc::new(Mutex::new(Watch {
        sink: DigestSink::new(streams).map_err(|error| error.to_string())?,
        assessment,
        timebase: plan.timebase,
    }));
    let parts = assemble(&plan, participants, |_| Box::new(Ear(watch.clone())));
    let mut looped = InLoop::new(&plan, parts);
    let ending = match looped.run_to(plan.end, |_| {}) {
        Ok(_) => Ending::Complete,
        Err(error) => error.into(),
    };
    drop(looped);
    let mut watch = watch.lock().unwrap_or_else(PoisonError::into_inner);
    let figures = watch.assessment.as_mut().map(|assessment| assessment.finish());
    Ok(Result::of(&ending, figures, watch.sink.digest().to_string()))
}

/// With a run folder: because it is wanted, or because a participant is a program of its own.
fn with_tape(scenario: &Scenario, in_process: bool, keep: Option<&Path>, scratch: &Path) -> Result {
    let out: PathBuf = keep.unwrap_or(scratch).to_owned();
    // What an interrupted campaign left there is not whole.
    let _ = std::fs::remove_dir_all(&out);
    let options = run::Options {
        in_process,
        out: Some(out.clone()),
        no_placement: true,
        patience_s: 60.0,
        ..run::Options::default()
    };
    let result = match run::run(scenario, &options) {
        Ok(outcome) => {
            let folder = RunFolder::open(&outcome.folder);
            match folder.write_json(&folder.summary(), &outcome.summary()) {
                Ok(()) => {
                    let digest = outcome.digest.map(|digest| digest.to_string());
                    Result::of(&outcome.ending, outcome.figures, digest.unwrap_or_default())
                }
                Err(error) => Result::without(Outcome::Crashed, error.to_string()),
            }
        }
        Err(failure) if failure.exit_code() == 2 => Result::without(Outcome::Refused, failure.to_string()),
        Err(failure) => Result::without(Outcome::Failed, failure.to_string()),
    };
    if keep.is_none() {
        let _ = std::fs::remove_dir_all(&out);
    }
    result
}

/// The figures of merit that runs of `scenario` have, without values: those with a criterion first.
pub fn figures_of(scenario: &Scenario, plan: &Plan) -> Vec<Number> {
    let made = scenario.assess(&run::streams(plan)).ok().flatten();
    let figures = made.map(|mut assessment| Figures::of(&assessment.finish()));
    figures.map_or(Vec::new(), |figures| figures.ordered())
}
