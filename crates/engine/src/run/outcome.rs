//! How a run ended.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Instant;

use lockstep::control::Timing;
use serde::Serialize;
use serde_json::{Map, Value, json};
use tape::folder::FolderError;
use tape::{AppendError, CreateError, Digest, ReadError};

use super::checkpoint::CheckpointError;
use super::punctuality::Punctuality;
use super::traced::Traced;
use crate::scenario::{ORCHESTRATOR, ScenarioError};
use crate::scope::ScopeError;

/// Why a run cannot be started, or cannot be recorded.
#[derive(Debug, thiserror::Error)]
pub enum RunFailure {
    /// The scenario is wrong.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The run folder cannot be made.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// The tape cannot be made.
    #[error(transparent)]
    Tape(#[from] CreateError),
    /// The tape cannot be written.
    #[error("the run cannot be recorded: {0}")]
    Append(#[from] AppendError),
    /// The tape cannot be read back.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A checkpoint cannot be written or read.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// The run's part of the machine cannot be made.
    #[error(transparent)]
    Scope(#[from] ScopeError),
    /// Shared memory cannot be set up.
    #[error(transparent)]
    Domain(#[from] lockstep::transport::iceoryx::DomainError),
    /// A participant cannot be started or does not answer.
    #[error("participant `{participant}`: {reason}")]
    Participant {
        /// Who.
        participant: String,
        /// Why.
        reason: String,
    },
    /// The machine has too little of what the run takes.
    #[error("{0}")]
    Room(String),
    /// The program of a substitute cannot be started or does not answer, when it is asked before the run.
    #[error("participant `{participant}`: {reason}")]
    Substitute {
        /// Whose place it may take.
        participant: String,
        /// Why.
        reason: String,
    },
    /// An option does not fit the run.
    #[error("{option} {value}: {reason}")]
    Option {
        /// The option.
        option: &'static str,
        /// Its value.
        value: String,
        /// What is wrong with it, and the remedy.
        reason: String,
    },
    /// A port that code names is not there, or not as it is used.
    #[error("`{port}`: {reason}")]
    Port {
        /// `PARTICIPANT.PORT`.
        port: String,
        /// What is wrong, and the remedy.
        reason: String,
    },
    /// An instant that code names is none that the run can go to.
    #[error("t = {time} {reason}")]
    Instant {
        /// The instant.
        time: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The run goes no further.
    #[error("the run is over: {how}")]
    Over {
        /// How it ended.
        how: String,
    },
    /// Somebody asked for an end before the run began.
    #[error("interrupted before the run began")]
    Interrupted,
    /// Something else.
    #[error("{0}")]
    Other(String),
}

impl RunFailure {
    /// The exit code of the program: 2 when the user must change something, else 1.
    pub fn exit_code(&self) -> i32 {
        match self {
            RunFailure::Scenario(_)
            | RunFailure::Option { .. }
            | RunFailure::Checkpoint(CheckpointError::None { .. })
            | RunFailure::Folder(
                FolderError::NotEmpty { .. } | FolderError::NotAFolder { .. } | FolderError::NotARun { .. },
            ) => 2,
            _ => 1,
        }
    }
}

/// How a run that was recorded ended.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(tag = "status", rename_all = "kebab-case")]
pub enum Ending {
    /// All activations are complete.
    Complete,
    /// The user ended it.
    Stopped {
        /// At which simulated time, and by what.
        reason: String,
    },
    /// A participant failed.
    Failed {
        /// Who.
        participant: String,
        /// When, why, and its last words.
        reason: String,
    },
}

impl Ending {
    /// The orchestrator itself failed.
    pub(super) fn own(reason: String) -> Ending {
        let participant = ORCHESTRATOR.into();
        Ending::Failed { participant, reason }
    }

    /// For people: who failed, and why; nothing where all went well.
    pub fn words(&self) -> Option<String> {
        match self {
            Ending::Complete => None,
            Ending::Stopped { reason } => Some(reason.clone()),
            Ending::Failed { participant, reason } if participant == ORCHESTRATOR => Some(reason.clone()),
            Ending::Failed { participant, reason } => Some(format!("participant `{participant}`: {reason}")),
        }
    }
}

/// A run that was recorded.
pub struct Outcome {
    /// The run folder, if the run has one.
    pub folder: Option<PathBuf>,
    /// How it ended.
    pub ending: Ending,
    /// Simulated time reached, s.
    pub simulated_s: f64,
    /// Wall time between the first activation and the last sample on the tape, s.
    pub wall_s: f64,
    /// When the orchestrator knew how the run ends.
    pub known: Instant,
    /// The digest of the tape; nothing when it could not be finished, or when nothing was kept.
    pub digest: Option<Digest>,
    /// What became of participants that failed, in the words of the tape's events: where the run went back to or who took over
    /// depends on wall time.
    pub recovered: Vec<String>,
    /// The figures of merit.
    pub figures: Option<crate::assessment::Figures>,
    /// How the pace of the wall clock was kept, where it was to be.
    pub punctuality: Option<Punctuality>,
    /// What the tape has of the streams of which it does not have everything, in words.
    pub partial: Vec<String>,
    /// What became of the trace, where there is one.
    pub traced: Option<Traced>,
    /// Where everybody's wall time went.
    pub timing: BTreeMap<String, Timing>,
    /// Who feeds each input of each participant in `timing`.
    pub sources: BTreeMap<String, Vec<String>>,
    /// The choice of cores in words.
    pub placement: String,
    /// What participants have said, by name, where the run is in one process and has no folder: the newest 64 KiB of each, at least.
    pub logs: BTreeMap<String, String>,
}

impl Outcome {
    /// The ending and the tape's digest, when the tape was finished like this: a tape that cannot be written ends a run that
    /// nothing else has ended.
    pub(super) fn sealed(ending: Ending, digest: Result<Option<Digest>, AppendError>) -> (Ending, Option<Digest>) {
        match (digest, ending) {
            (Ok(digest), ending) => (ending, digest),
            (Err(error), Ending::Complete) => (Ending::own(error.to_string()), None),
            (Err(_), ending) => (ending, None),
        }
    }

    /// Simulated time over wall time.
    pub fn real_time_factor(&self) -> f64 {
        if self.wall_s > 0.0 {
            self.simulated_s / self.wall_s
        } else {
            0.0
        }
    }

    /// 0 criteria met; 1 the run failed or was stopped by a signal; 3 a criterion is not met.
    pub fn exit_code(&self) -> i32 {
        match (&self.ending, &self.figures) {
            (Ending::Failed { .. }, _) => 1,
            (Ending::Stopped { .. }, _) => 1,
            (Ending::Complete, Some(figures)) if !figures.met() => 3,
            (Ending::Complete, _) => 0,
        }
    }

    /// `summary.json`: figures of merit, how the run ended, and what it cost.
    pub fn summary(&self) -> Value {
        let mut all = Map::new();
        if let Some(figures) = &self.figures {
            all.extend(figures.json());
            if matches!(self.ending, Ending::Complete) {
                all.insert("verdict".into(), json!(figures.verdict()));
            }
        }
        all.insert("ending".into(), json!(self.ending));
        all.insert("simulated_time_s".into(), json!(self.simulated_s));
        all.insert("wall_time_s".into(), json!(self.wall_s));
        all.insert("real_time_factor".into(), json!(self.real_time_factor()));
        all.insert(
            "tape_digest".into(),
            json!(self.digest.map(|digest| digest.to_string())),
        );
        if let Some(folder) = &self.folder {
            all.insert("run_folder".into(), json!(folder.display().to_string()));
        }
        if !self.recovered.is_empty() {
            all.insert("recovered".into(), json!(self.recovered));
        }
        if !self.partial.is_empty() {
            all.insert("tape_has_only".into(), json!(self.partial));
        }
        if let Some(punctuality) = &self.punctuality {
            all.insert("pace".into(), json!(punctuality));
        }
        if let Some(traced) = &self.traced {
            let Traced {
                path,
                spans,
                missing,
                error,
            } = traced;
            let trace =
                json!({ "file": path.display().to_string(), "spans": spans, "missing": missing, "error": error });
            all.insert("trace".into(), trace);
        }
        all.insert("placement".into(), json!(self.placement));
        all.insert("timing".into(), self.timing());
        Value::Object(all)
    }

    /// Where wall time went; waiting for samples by who had to send them.
    fn timing(&self) -> Value {
        let mut timing = json!(self.timing);
        for (name, sources) in &self.sources {
            let Some(inputs) = timing.get_mut(name).and_then(|own| own.get_mut("inputs_ns")) else {
                continue;
            };
            let spent = inputs.as_array().cloned().unwrap_or_default();
            let mut named = Map::new();
            for (source, ns) in sources.iter().zip(spent) {
                // Two inputs may read one output.
                let before = named.get(source).and_then(Value::as_u64).unwrap_or(0);
                named.insert(source.clone(), json!(before + ns.as_u64().unwrap_or(0)));
            }
            *inputs = Value::Object(named);
        }
        timing
    }
}
