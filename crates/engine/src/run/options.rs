//! What is said about a run besides the scenario.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use lockstep::plan::Plan;
use lockstep::time::Rational;
use tape::folder::RunFolder;

use super::checkpoint::Checkpoint;
use super::outcome::RunFailure;
use super::store::Record;
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
    /// Let others run.
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

/// Where a run goes on that was begun by another one.
#[derive(Debug, Clone)]
pub struct Origin {
    /// The other run's folder.
    pub run: PathBuf,
    /// Its state.
    pub checkpoint: Checkpoint,
}

/// What becomes of a run that keeps pace with the wall clock when a step is complete only after the next one was due.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Overrun {
    /// It is counted, and reported.
    #[default]
    Report,
    /// The run ends.
    Stop,
}

impl Overrun {
    /// Both with their names.
    pub const ALL: [(&'static str, Overrun); 2] = [("report", Overrun::Report), ("stop", Overrun::Stop)];
}

/// What is said about a run besides the scenario.
#[derive(Clone)]
pub struct Options {
    /// All participants in this process.
    pub in_process: bool,
    /// What is kept of the samples. Without a folder only in this process.
    pub record: Record,
    /// The run folder; chosen under `runs` when not given.
    pub out: Option<PathBuf>,
    /// Replace the run in that folder, if there is one.
    pub force: bool,
    /// Receives what happens.
    pub progress: Progress,
    /// Asks for an end in order.
    pub interrupt: Interrupt,
    /// Simulated seconds per second of wall time; as fast as possible when not given.
    pub pace: Option<f64>,
    /// What becomes of a run with a pace when a step is complete only after the next one was due.
    pub overrun: Overrun,
    /// The file that says what every participant did when, as JSON trace events; none when not given.
    pub trace: Option<PathBuf>,
    /// Come to rest here and wait for the user.
    pub pause_at: Vec<Rational>,
    /// Keep the state of the run in a file this often, simulated.
    pub checkpoint_every: Option<Rational>,
    /// Keep the state of the run in a file at these instants.
    pub checkpoint_at: Vec<Rational>,
    /// Go on from here; from the beginning when not given.
    pub origin: Option<Origin>,
    /// How participants wait.
    pub wait: Wait,
    /// Leave the choice of cores to the operating system.
    pub no_placement: bool,
    /// How long a participant may compute without progress before the run is given up, s.
    pub patience_s: f64,
    /// How long each program may take to enter the run and to answer a request, whatever the scenario says of it.
    pub start_within: Option<Duration>,
    /// What moves the horizon from outside, such as the live page.
    pub steering: Option<Arc<Steering>>,
}

impl Default for Options {
    /// In processes, as fast as possible, with a run folder under `runs`, and 60 s of patience.
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
    /// Refuses what a run without a folder cannot do.
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

    /// [`Options::patience_s`] as far as a duration goes.
    pub(super) fn patience(&self) -> Duration {
        Duration::try_from_secs_f64(self.patience_s).unwrap_or(Duration::MAX)
    }

    /// Tells the observer and the live page that there is a run.
    pub(super) fn begin(&self, plan: &Plan, folder: Option<&RunFolder>) {
        let duration_s = plan.timebase.seconds(plan.end);
        self.progress.report(Event::Begun { duration_s });
        if let (Some(steering), Some(folder)) = (&self.steering, folder) {
            steering.begin(plan, folder.root().to_owned());
        }
    }
}
