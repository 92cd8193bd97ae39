//! How a run ended.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Instant;

use lockstep::control::WallTimeBreakdown;
use serde::Serialize;
use serde_json::{Map, Value, json};
use tape::folder::FolderError;
use tape::{AppendError, CreateError, Digest, ReadError};

use super::pace::report::PaceReport;
use super::pace::traced::TraceSummary;
use super::saved::checkpoint::CheckpointError;
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
    /// The run's resources on this machine cannot be created.
    #[error(transparent)]
    Scope(#[from] ScopeError),
    /// Shared memory cannot be set up.
    #[error(transparent)]
    Domain(#[from] lockstep::transport::iceoryx::DomainError),
    /// A participant cannot be started or does not answer.
    #[error("participant `{participant}`: {reason}")]
    Participant {
        /// Its name.
        participant: String,
        /// The reason.
        reason: String,
    },
    /// The machine does not have the resources that the run needs.
    #[error("{0}")]
    SharedMemory(String),
    /// The program of a substitute cannot be started or does not answer when it is queried before the run.
    #[error("participant `{participant}`: {reason}")]
    Substitute {
        /// The participant that it may replace.
        participant: String,
        /// The reason.
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
    /// A port named in code does not exist, or is not used as it is.
    #[error("`{port}`: {reason}")]
    Port {
        /// `PARTICIPANT.PORT`.
        port: String,
        /// What is wrong, and the remedy.
        reason: String,
    },
    /// The run cannot go to an instant named in code.
    #[error("t = {time} {reason}")]
    Instant {
        /// The instant.
        time: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The run is over.
    #[error("the run is over: {how}")]
    Over {
        /// How it ended.
        how: String,
    },
    /// An end was requested before the run began.
    #[error("interrupted before the run began")]
    Interrupted,
    /// Something else.
    #[error("{0}")]
    Other(String),
}

impl RunFailure {
    /// The exit code of the program: 2 when the user must change something, otherwise 1.
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

/// How a recorded run ended.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(tag = "status", rename_all = "kebab-case")]
pub enum Ending {
    /// All activations are complete.
    Complete,
    /// The user ended the run, or a step was too late under `--overrun stop`.
    Stopped {
        /// The simulated time, and the cause.
        reason: String,
    },
    /// A participant failed.
    Failed {
        /// Its name.
        participant: String,
        /// The time, the reason, and the participant's last log lines.
        reason: String,
    },
}

impl Ending {
    /// The orchestrator itself failed.
    pub(super) fn orchestrator_failed(reason: String) -> Ending {
        let participant = ORCHESTRATOR.into();
        Ending::Failed { participant, reason }
    }

    /// The reason for messages, with the participant that failed; `None` if all went well.
    pub fn reason(&self) -> Option<String> {
        match self {
            Ending::Complete => None,
            Ending::Stopped { reason } => Some(reason.clone()),
            Ending::Failed { participant, reason } if participant == ORCHESTRATOR => Some(reason.clone()),
            Ending::Failed { participant, reason } => Some(format!("participant `{participant}`: {reason}")),
        }
    }
}

/// A recorded run.
pub struct Outcome {
    /// The run folder, if the run has one.
    pub folder: Option<PathBuf>,
    /// How it ended.
    pub ending: Ending,
    /// Simulated time reached, s.
    pub simulated_s: f64,
    /// For a run from a checkpoint, the instant of the checkpoint, s.
    pub resumed_s: Option<f64>,
    /// Wall time between the first activation and the last sample on the tape, s.
    pub wall_s: f64,
    /// When the orchestrator determined how the run ends.
    pub ended_at: Instant,
    /// The digest of the tape; `None` when it could not be finished, or when nothing was recorded.
    pub digest: Option<Digest>,
    /// How failures of participants were handled, in the words of the tape's events: where the run went back to, or which program
    /// took over, depends on wall time.
    pub recovered: Vec<String>,
    /// The figures of merit.
    pub figures: Option<crate::assessment::Figures>,
    /// Whether the pace of the wall clock was met, if the run had a pace.
    pub pace: Option<PaceReport>,
    /// For each stream of which the tape does not have every sample: what it has, in words.
    pub partial: Vec<String>,
    /// The result of the trace, if there is one.
    pub traced: Option<TraceSummary>,
    /// How each participant spent its wall time.
    pub timing: BTreeMap<String, WallTimeBreakdown>,
    /// The source of each input of each participant in `timing`.
    pub sources: BTreeMap<String, Vec<String>>,
    /// The reason for the choice of cores, in words.
    pub placement: String,
    /// The logs of the participants, by name, if the run is in one process and has no folder: at least the newest 64 KiB of each.
    pub logs: BTreeMap<String, String>,
}

impl Outcome {
    /// The ending and the tape's digest, after the tape was finished with this result: a tape that cannot be written fails a run
    /// that would otherwise be complete.
    pub(super) fn sealed(ending: Ending, digest: Result<Option<Digest>, AppendError>) -> (Ending, Option<Digest>) {
        match (digest, ending) {
            (Ok(digest), ending) => (ending, digest),
            (Err(error), Ending::Complete) => (Ending::orchestrator_failed(error.to_string()), None),
            (Err(_), ending) => (ending, None),
        }
    }

    /// The time that this run itself simulated, s.
    pub fn own_simulated_s(&self) -> f64 {
        self.simulated_s - self.resumed_s.unwrap_or(0.0)
    }

    /// The time that this run simulated over wall time.
    pub fn real_time_factor(&self) -> f64 {
        if self.wall_s > 0.0 {
            self.own_simulated_s() / self.wall_s
        } else {
            0.0
        }
    }

    /// 0: all criteria met; 1: the run failed or was stopped; 3: a criterion is not met.
    pub fn exit_code(&self) -> i32 {
        match (&self.ending, &self.figures) {
            (Ending::Failed { .. }, _) => 1,
            (Ending::Stopped { .. }, _) => 1,
            (Ending::Complete, Some(figures)) if !figures.met() => 3,
            (Ending::Complete, _) => 0,
        }
    }

    /// The content of `summary.json`: figures of merit, how the run ended, and what it cost.
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
        if let Some(resumed) = self.resumed_s {
            all.insert("resumed_from_s".into(), json!(resumed));
        }
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
        if let Some(pace) = &self.pace {
            all.insert("pace".into(), json!(pace));
        }
        if let Some(traced) = &self.traced {
            let TraceSummary {
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

    /// How wall time was spent; waiting for samples is listed by their producers.
    fn timing(&self) -> Value {
        let mut timing = json!(self.timing);
        for (name, sources) in &self.sources {
            let Some(inputs) = timing
                .get_mut(name)
                .and_then(|participant_timing| participant_timing.get_mut("inputs_ns"))
            else {
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
