//! The options of a run: everything that is not in the scenario.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use lockstep::plan::Plan;
use lockstep::time::Rational;
use tape::folder::RunFolder;

use super::outcome::RunFailure;
use super::recording::store::Record;
use super::saved::checkpoint::Checkpoint;
use crate::live::Steering;
use crate::observer::{Event, Interrupt, Progress};

/// How participants wait, as the user chooses it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Wait {
    /// As the placement recommends.
    #[default]
    Auto,
    /// Spin: fastest with a core for each participant, and granted only there.
    Spin,
    /// Yield to other threads.
    Yield,
    /// Sleep until woken.
    Sleep,
}

impl Wait {
    /// All of them with their names.
    pub const ALL: [(&'static str, Wait); 4] = [
        ("auto", Wait::Auto),
        ("spin", Wait::Spin),
        ("yield", Wait::Yield),
        ("sleep", Wait::Sleep),
    ];
}

/// The other run and its checkpoint from which a run continues.
#[derive(Debug, Clone)]
pub struct Origin {
    /// The other run's folder.
    pub run: PathBuf,
    /// Its saved state.
    pub checkpoint: Checkpoint,
}

/// The reaction of a run that keeps pace with the wall clock when a step is completed only after the next one was due.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Overrun {
    /// The overrun is counted and reported.
    #[default]
    Report,
    /// The run ends.
    Stop,
}

impl Overrun {
    /// Both with their names.
    pub const ALL: [(&'static str, Overrun); 2] = [("report", Overrun::Report), ("stop", Overrun::Stop)];
}

/// The options of a run: everything that is not in the scenario.
#[derive(Clone)]
pub struct Options {
    /// Run all participants in this process.
    pub in_process: bool,
    /// What is recorded of the samples. Running without a folder is possible only in this process.
    pub record: Record,
    /// The run folder; chosen under `runs` when not given.
    pub out: Option<PathBuf>,
    /// Replace the run in that folder, if there is one.
    pub force: bool,
    /// Receives the events of the run.
    pub progress: Progress,
    /// Requests an orderly end of the run.
    pub interrupt: Interrupt,
    /// Simulated seconds per second of wall time; as fast as possible when not given.
    pub pace: Option<f64>,
    /// The reaction of a run with a pace when a step is completed only after the next one was due.
    pub overrun: Overrun,
    /// The file for the trace: what every participant did when, as JSON trace events; none when not given.
    pub trace: Option<PathBuf>,
    /// Pause at these instants and wait for the user.
    pub pause_at: Vec<Rational>,
    /// Save the state of the run in a file at this interval of simulated time.
    pub checkpoint_every: Option<Rational>,
    /// Save the state of the run in a file at these instants.
    pub checkpoint_at: Vec<Rational>,
    /// Continue from here; start at the beginning when not given.
    pub origin: Option<Origin>,
    /// How participants wait.
    pub wait: Wait,
    /// Leave the choice of cores to the operating system.
    pub no_placement: bool,
    /// How long a participant may compute without progress before the run is ended, s.
    pub patience_s: f64,
    /// How long each program may take to enter the run and to answer a request, instead of the value in the scenario.
    pub start_within: Option<Duration>,
    /// External control of the horizon, such as the live page.
    pub steering: Option<Arc<Steering>>,
}

impl Default for Options {
    /// Participants in processes, as fast as possible, with a run folder under `runs`, and a stall timeout of 60 s.
    fn default() -> Options {
        Options {
            in_process: false,
            record: Record::Folder,
            out: None,
            force: false,
            progress: Progress::default(),
            interrupt: Interrupt::default(),
            pace: None,
            overrun: Overrun::Report,
            trace: None,
            pause_at: Vec::new(),
            checkpoint_every: None,
            checkpoint_at: Vec::new(),
            origin: None,
            wait: Wait::Auto,
            no_placement: false,
            patience_s: 60.0,
            start_within: None,
            steering: None,
        }
    }
}

impl Options {
    /// Refuses options that a run without a folder cannot satisfy.
    pub(super) fn check_record(&self) -> Result<(), RunFailure> {
        if self.record == Record::Folder {
            return Ok(());
        }
        let refuse = |option: &'static str, value: String, reason: &str| {
            let reason = reason.to_owned();
            Err(RunFailure::Option { option, value, reason })
        };
        let record = format!("{:?}", self.record);
        if !self.in_process {
            let reason = "participants in processes of their own have logs and a tape in a folder: use `Record::Folder`, or run in this process";
            return refuse("record", record, reason);
        }
        if let Some(out) = &self.out {
            let reason = "names a folder, and the run is to have none: use `Record::Folder`";
            return refuse("out", out.display().to_string(), reason);
        }
        if self.checkpoint_every.is_some() || !self.checkpoint_at.is_empty() {
            let reason = "a checkpoint in a file needs a folder: use `Record::Folder`, or `Run::save`";
            return refuse("record", record, reason);
        }
        if self.steering.is_some() {
            return refuse(
                "record",
                record,
                "the live page reads the tape in a folder: use `Record::Folder`",
            );
        }
        Ok(())
    }

    /// [`Options::patience_s`] as a duration, limited to the longest one.
    pub(super) fn stall_timeout(&self) -> Duration {
        Duration::try_from_secs_f64(self.patience_s).unwrap_or(Duration::MAX)
    }

    /// Announces the run to the observer and the live page.
    pub(super) fn begin(&self, plan: &Plan, folder: Option<&RunFolder>) {
        let duration_s = plan.timebase.seconds(plan.end);
        self.progress.report(Event::Begun { duration_s });
        if let (Some(steering), Some(folder)) = (&self.steering, folder) {
            steering.begin(plan, folder.root().to_owned());
        }
    }
}
