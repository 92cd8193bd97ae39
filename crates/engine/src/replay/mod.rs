//! Replay of one participant of a recorded run, with its recorded inputs.
//!
//! The plan determines which sample each activation reads, and the samples are on the tape. So a replay is a run of the participant
//! alone, with players in place of the participants that fed it. Everything else is the same: links, delays, random samples,
//! transport, and how a run ends.
//!
//! # Example
//!
//! ```
//! use std::sync::Arc;
//!
//! use engine::Catalogue;
//! use engine::replay::{Replay, Request};
//! use engine::run::Options;
//! use engine::scenario::Scenario;
//! use lockstep::participant::{Failure, Inputs, Interface, Kind, Outputs, ParameterError, Participant, Setup, Step};
//!
//! lockstep::message! {
//!     /// What the tank reports.
//!     struct Level {
//!         /// Depth of the water.
//!         depth: f64 = "m",
//!     }
//! }
//!
//! /// Loses a tenth of its content per second.
//! struct Tank(f64);
//!
//! impl Participant for Tank {
//!     fn interface(&self) -> Interface {
//!         Interface::new(Kind::Continuous).output::<Level>("level")
//!     }
//!
//!     fn step(&mut self, step: &Step, _: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
//!         self.0 -= 0.1 * step.period * self.0;
//!         *outputs.get_mut(0) = Level { depth: self.0 };
//!         Ok(())
//!     }
//! }
//!
//! fn tank(_: &Setup) -> Result<Box<dyn Participant>, ParameterError> {
//!     Ok(Box::new(Tank(0.4)))
//! }
//!
//! let catalogue = Arc::new(Catalogue::new("example").participant("tank", tank));
//! let text = "duration = \"1 s\"\n[participants.tank]\nrun = { builtin = \"tank\" }\nperiod = \"10 ms\"\n";
//! let scenario = Scenario::read_text(&catalogue, "tank.toml".as_ref(), text)?;
//! let folder = std::env::temp_dir().join(format!("replay-example-{}", std::process::id()));
//! let here = Options { in_process: true, ..Options::default() };
//! engine::run::run(&scenario, &Options { out: Some(folder.clone()), ..here.clone() })?;
//!
//! let request = Request {
//!     catalogue: &catalogue,
//!     folder: &folder,
//!     participant: "tank",
//!     overrides: &[],
//!     program: None,
//!     run: None,
//!     to: None,
//!     unverified: false,
//! };
//! let found = Replay::plan(&request)?.run(&here)?;
//! assert!(found.comparison?.identical);
//! # std::fs::remove_dir_all(&folder)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub(crate) mod player;
mod reduce;
mod request;

use std::path::PathBuf;
use std::sync::Arc;

use lockstep::participant::Interface;
use lockstep::time::Rational;
use tape::compare::{Comparison, compare};
use tape::folder::RunFolder;
use tape::{ReadError, Reader, Selection, Source, StreamSpec, is_file};

use crate::run::{Ending, Options, Run, RunFailure};
use crate::scenario::{Program, Scenario, ScenarioError, ScenarioSpec, port_of};
use crate::scope::{Scope, ScopeError};
use reduce::{StandIns, reduce};

pub use request::Request;

/// Why there is no replay, or no comparison.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The folder is not a run.
    #[error("{}: there is no plan.toml: name the folder of a run, such as runs/close-20260101T000000Z-1", .0.display())]
    NoRun(PathBuf),
    /// The tape cannot be read.
    #[error(transparent)]
    Tape(#[from] ReadError),
    /// The plan with the changes of the command line is invalid.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The request does not fit the recorded run.
    #[error("{0}")]
    Misfit(String),
    /// The run of the participant did not start.
    #[error(transparent)]
    Run(#[from] RunFailure),
    /// There is no place for the replay's own files.
    #[error(transparent)]
    Scope(#[from] ScopeError),
}

impl ReplayError {
    /// 2 when the user must change something, otherwise 1.
    pub fn exit_code(&self) -> i32 {
        match self {
            ReplayError::Run(failure) => failure.exit_code(),
            ReplayError::Scope(_) => 1,
            _ => 2,
        }
    }
}

/// The result of a replay.
pub struct Found {
    /// How the participant's run ended.
    pub ending: Ending,
    /// A is the recording, B the replay; both up to the shorter one. An error has the reason why no sample was compared.
    pub comparison: Result<Comparison, String>,
    /// Notes for a reader of the result.
    pub notes: Vec<String>,
    /// The instant before which all activations were replayed, s; the stamp of its newest sample for a replay that ended earlier.
    pub to_s: f64,
}

/// A recorded run, reduced to one participant.
pub struct Replay {
    reader: Reader,
    participant: String,
    scenario: Scenario,
    notes: Vec<String>,
    branch: Option<BranchInfo>,
}

impl Replay {
    /// Reads the recorded run and determines how far its samples reach.
    ///
    /// # Errors
    /// Everything that does not fit; nothing has been started then.
    pub fn plan(request: &Request<'_>) -> Result<Replay, ReplayError> {
        let file = RunFolder::open(request.folder).plan();
        if !is_file(&file)? {
            return Err(ReplayError::NoRun(request.folder.to_owned()));
        }
        let reader = Reader::open(request.folder)?;
        let mut notes = Vec::new();
        match reader.verify() {
            Err(error) if request.unverified => notes.push(error.to_string()),
            verified => verified?,
        }
        let mut spec = ScenarioSpec::read(&file, request.overrides)?;
        let stand_ins = reduce(&mut spec, request, &reader).map_err(ReplayError::Misfit)?;
        let mut scenario = Scenario::of(request.catalogue, spec.clone(), &file)?;
        check_sample_times(&spec, &scenario, &reader, &stand_ins)?;
        let made = scenario.make()?;
        let all = &scenario.participants;
        let at = all.iter().position(|entry| entry.setup.name == request.participant);
        let at = at.expect("it was kept");
        let interfaces: Vec<Option<Interface>> = made
            .iter()
            .map(|made| made.as_ref().map(|made| made.interface()))
            .collect();
        if let Some(interface) = &interfaces[at] {
            check_outputs(interface, &reader, request.participant)?;
        }
        let limit = find_end(&scenario, &interfaces, &reader, at, &stand_ins)?;
        let end = limit.end.min(request.to.unwrap_or(limit.end)).min(scenario.duration);
        if end < scenario.duration {
            notes.extend(limit.note.filter(|_| end == limit.end));
            spec.duration = end.into();
            scenario = Scenario::of(request.catalogue, spec, &file)?;
        }
        let changed_at = RunFolder::open(request.folder).changed_at();
        Ok(Replay {
            scenario,
            participant: request.participant.to_owned(),
            reader,
            notes,
            branch: changed_at.and_then(|at| at.parse().ok()).map(|at| BranchInfo {
                at,
                unchanged: request.overrides.is_empty() && request.program.is_none() && request.run.is_none(),
            }),
        })
    }

    /// Whether the participant, or its substitute, is an external program.
    pub fn external(&self) -> bool {
        let mut programs = self.scenario.programs();
        programs.any(Program::is_external)
    }

    /// No activation at or after this instant is replayed.
    pub fn end(&self) -> Rational {
        self.scenario.duration
    }

    /// Runs the participant and compares its outputs with the tape.
    pub fn run(self, options: &Options) -> Result<Found, ReplayError> {
        // The replay's own tape is not needed afterwards, and must be removed however this program ends.
        let scope = Scope::create()?;
        let mut options = options.clone();
        let out = options
            .out
            .get_or_insert_with(|| scope.address().folder.join("replay"))
            .clone();
        let duration_s = self.scenario.duration.seconds();
        let mut run = Run::begin(Arc::new(self.scenario), options, false)?;
        run.replay_inputs(&self.reader.events()?)?;
        let outcome = run.finish();
        let replayed = Reader::open(&out)?;
        let mut notes = self.notes;
        let subject_streams = |reader: &Reader| -> Vec<(usize, u64)> {
            let all = reader.streams().iter().enumerate();
            let streams = all.filter(|(_, spec)| spec.participant == self.participant);
            streams.map(|(stream, _)| (stream, reader.count(stream))).collect()
        };
        // Both are compared as far as both have samples; a note reports where one of them has more.
        let (mut recording, mut replay) = (subject_streams(&self.reader), subject_streams(&replayed));
        let to_s = match outcome.ending {
            Ending::Complete => duration_s,
            _ => newest_s(&replayed, &replay),
        };
        let uncompared = uncompared(&self.participant, &recording, to_s);
        replay.retain_mut(|(at, count)| {
            let spec = &replayed.streams()[*at];
            let recorded_stream = recording
                .iter_mut()
                .find(|(stream, _)| self.reader.streams()[*stream].port == spec.port);
            let Some((_, recorded)) = recorded_stream else {
                notes.push(format!("{} is not on the tape, so it was not compared", spec.name()));
                return false;
            };
            if *count > *recorded {
                let more = *count - *recorded;
                notes.push(format!("{} has {more} samples more than the tape", spec.name()));
            }
            *count = (*count).min(*recorded);
            *recorded = *count;
            true
        });
        let comparison = compare(
            &Selection::new(&self.reader, recording),
            &Selection::new(&replayed, replay),
        )?;
        if let (Some(branch), Some(first)) = (&self.branch, &comparison.first) {
            notes.push(branch.explain_difference(&self.reader, &self.participant, first.stamp_s)?);
        }
        if let Some(difference) = comparison.streams.first() {
            return Err(ReplayError::Misfit(format!(
                "participants.{}: it has other ports than when the tape was recorded: {difference}",
                self.participant
            )));
        }
        Ok(Found {
            ending: outcome.ending,
            comparison: match comparison.samples {
                0 => Err(uncompared),
                _ => Ok(comparison),
            },
            notes,
            to_s,
        })
    }
}

/// The newest stamp of streams of a tape, each with its number of samples, s; 0 without a sample.
fn newest_s(reader: &Reader, streams: &[(usize, u64)]) -> f64 {
    let stamp = |&(stream, count): &(usize, u64)| {
        let spec = &reader.streams()[stream];
        let last = i64::try_from(count.checked_sub(1)?).ok()?;
        spec.period.checked_mul(last)?.checked_add(spec.offset)
    };
    let newest = streams.iter().filter_map(stamp).max();
    newest.map_or(0.0, Rational::seconds)
}

/// Why no sample of `participant` was compared, whose streams on the tape are `recording`, each with its number of samples.
fn uncompared(participant: &str, recording: &[(usize, u64)], to_s: f64) -> String {
    let reason = if recording.is_empty() {
        format!("the tape has no output of `{participant}`; record a run whose [record] keeps one")
    } else if recording.iter().all(|(_, count)| *count == 0) {
        format!("the tape has no sample of `{participant}`; record a run in which it is activated")
    } else {
        format!("`{participant}` published no sample in its replay up to t = {to_s} s; replay it for longer")
    };
    format!("nothing was compared: {reason}")
}

/// A run that was resumed with changes: before these, a different plan from its `plan.toml` applied.
struct BranchInfo {
    /// The instant from which on the plan is that of the run.
    at: Rational,
    /// Whether the run is replayed without changes.
    unchanged: bool,
}

impl BranchInfo {
    /// The note for a replay that differs from `first` on, in seconds.
    ///
    /// # Errors
    /// When only the other plan can be the reason.
    fn explain_difference(&self, reader: &Reader, participant: &str, first: f64) -> Result<String, ReplayError> {
        let at = self.at;
        let why =
            format!("the run was resumed with changes at t = {at}: up to then it had another plan than its plan.toml");
        if !self.unchanged || first >= at.seconds() {
            return Ok(why);
        }
        Err(ReplayError::Misfit(format!(
            "{}: {why}, and `{participant}` differs from t = {first} s on. A participant is replayed from its start, where its state is known: \
             replay the run from which this one was resumed",
            reader.dir().display()
        )))
    }
}

/// Checks that the sample times on the tape match the plan, of the streams that are played or compared: another one may have been recorded
/// in part.
fn check_sample_times(
    reduced: &ScenarioSpec,
    scenario: &Scenario,
    reader: &Reader,
    stand_ins: &StandIns,
) -> Result<(), ReplayError> {
    let subject = &*stand_ins.subject;
    for spec in reader.streams() {
        let is_compared = spec.participant == subject && !spec.is_seen();
        if !is_compared && !is_played(reduced, stand_ins, spec) {
            continue;
        }
        let entry = |name: &str| scenario.participants.iter().find(|entry| entry.setup.name == name);
        // Participants that the replay has named itself are not on the tape.
        let is_stand_in = [&stand_ins.own_player, &stand_ins.listener].contains(&&spec.participant);
        let Some(entry) = entry(&spec.participant).filter(|_| !is_stand_in) else {
            continue;
        };
        if spec.first_index > 0 {
            return Err(ReplayError::Misfit(format!(
                "{}: stream `{}` begins with sample {}: what was before is not on this tape, and a participant has to be \
                 replayed from its start",
                reader.dir().display(),
                spec.name(),
                spec.first_index
            )));
        }
        if (entry.period, entry.offset) != (spec.period, spec.offset) {
            let name = &spec.participant;
            let remedy = if name == subject {
                "its samples could not be compared"
            } else {
                "its samples could not be played"
            };
            return Err(ReplayError::Misfit(format!(
                "participants.{name}: period {} and offset {}, but the tape was recorded with {} and {}: {remedy}",
                entry.period, entry.offset, spec.period, spec.offset
            )));
        }
    }
    Ok(())
}

/// Whether a player of the scenario `reduced` to one participant publishes the samples of a stream.
fn is_played(reduced: &ScenarioSpec, stand_ins: &StandIns, stream: &StreamSpec) -> bool {
    let port = format!("{}.{}", stand_ins.player(&stream.participant), stream.port);
    let sources = reduced.connections.values().map(|connection| &connection.from);
    sources.map(|from| port_of(from)).any(|from| from == port)
}

/// Checks that every recorded output still exists, unchanged.
fn check_outputs(interface: &Interface, reader: &Reader, subject: &str) -> Result<(), ReplayError> {
    let recorded = reader.streams().iter();
    for spec in recorded.filter(|spec| spec.participant == subject && !spec.is_seen()) {
        let output = interface.outputs.iter().find(|output| output.name == spec.port);
        let difference = match output {
            None => Some(format!("it has no output `{}`", spec.port)),
            Some(output) => {
                let difference = output.descriptor.difference(&spec.descriptor);
                difference.map(|difference| format!("output `{}`: {difference}", spec.port))
            }
        };
        if let Some(difference) = difference {
            return Err(ReplayError::Misfit(format!(
                "participants.{subject}: it has other ports than when the tape was recorded: {difference}"
            )));
        }
    }
    Ok(())
}

/// How far a tape can feed a participant.
struct ReplayEnd {
    /// No activation at or after this instant can be replayed.
    end: Rational,
    /// The reason, if it is the tape.
    note: Option<String>,
}

fn find_end(
    scenario: &Scenario,
    interfaces: &[Option<Interface>],
    reader: &Reader,
    subject: usize,
    stand_ins: &StandIns,
) -> Result<ReplayEnd, ReplayError> {
    let plan = scenario.assumed_plan(interfaces)?;
    let planned = &plan.participants[subject];
    let overflow = || {
        ReplayError::Misfit(format!(
            "{}: a time that needs more than 63 bits",
            reader.dir().display()
        ))
    };
    let instant = |period: Rational, offset: Rational, k: u64| {
        let k = i64::try_from(k).map_err(|_| overflow())?;
        let since = period.checked_mul(k).ok_or_else(overflow)?;
        since.checked_add(offset).ok_or_else(overflow)
    };
    let mut limit = ReplayEnd {
        end: scenario.duration,
        note: None,
    };
    for link in planned.inputs.iter().flatten() {
        let from = plan.links[*link].from;
        let producer = &plan.participants[from.0];
        let itself = producer.name == stand_ins.own_player;
        let played = if itself { &planned.name } else { &producer.name };
        let name = format!("{played}.{}", producer.interface.outputs[from.1].name);
        let count = reader.count(reader.stream(&name)?);
        let mut schedule = plan.schedule(*link);
        let missing = (0..planned.activations).find_map(|k| {
            let index = schedule.advance().samples().find(|&index| index >= count)?;
            Some((k, index))
        });
        let Some((k, index)) = missing else { continue };
        let at = instant(planned.period, planned.offset, k)?;
        if k == 0 {
            return Err(ReplayError::Misfit(format!(
                "{}: the tape has {count} samples of `{name}`, and the first activation of `{}` reads sample {index}: \
                 nothing can be replayed",
                reader.dir().display(),
                planned.name
            )));
        }
        if at < limit.end {
            limit.end = at;
            limit.note = Some(format!(
                "the tape has {count} samples of {name}: what `{}` reads at t = {at} is not on it, so the replay ends there",
                planned.name
            ));
        }
    }
    // For a run that ended early and whose inputs do not end the replay, the replay ends a little after the end of the tape, so
    // that an activation whose samples never reached the tape is repeated too.
    let mut newest = Rational::ZERO;
    let mut margin = planned.period;
    for (stream, spec) in reader.streams().iter().enumerate() {
        let last = reader.count(stream).saturating_sub(1);
        newest = newest.max(instant(spec.period, spec.offset, last)?);
        margin = margin.max(spec.period);
    }
    let end = newest
        .checked_add(margin)
        .and_then(|end| end.checked_add(planned.period))
        .ok_or_else(overflow)?;
    if end < limit.end {
        limit.end = end;
        limit.note = Some(format!(
            "the tape ends at t = {newest}, and the replay a little later, at t = {end}"
        ));
    }
    Ok(limit)
}
