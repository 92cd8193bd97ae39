//! A scenario as a value.

use std::path::{Path, PathBuf};

use lockstep::time::Rational;
use serde::Serialize;
use toml::{Table, Value};

use super::connection::ConnectionSpec;
use super::entries::Entries;
use super::fault::FaultSpec;
use super::guard::GuardSpec;
use super::measure::MeasureSpec;
use super::origin::Origin;
use super::participant::{OnFailureSpec, ParticipantSpec};
use super::record::RecordSpec;
use super::run::RunSpec;
use super::time::Time;
use crate::scenario::names::fault_name;

/// The key of the folder that relative paths are relative to.
pub(in crate::scenario) const FOLDER: &str = "folder";

/// Everything that a scenario says, as a value: read from a file, or made in code, changed, and written again.
///
/// ```
/// use engine::scenario::{ConnectionSpec, GuardSpec, ParticipantSpec, ScenarioSpec};
///
/// let mut spec = ScenarioSpec::new("10 s")
///     .title("A tank and its pump")
///     .participant("tank", ParticipantSpec::builtin("tank").every("1 ms").parameter("depth", 0.4))
///     .participant("pump", ParticipantSpec::builtin("pump").every("100 ms"))
///     .connection("level", ConnectionSpec::new("tank.level", "pump.level").delay("10 ms"))
///     .connection("flow", ConnectionSpec::new("pump.flow", "tank.flow"))
///     .guard("full", GuardSpec::new("tank.level").field("depth").range("[0, 2] m"));
/// spec.connections["level"].delay = "20 ms".into();
///
/// let again = ScenarioSpec::of_text("tank.toml".as_ref(), &spec.to_text())?;
/// assert_eq!(again, spec);
/// # Ok::<(), engine::scenario::ScenarioError>(())
/// ```
///
/// What is wrong with it is told when [`Scenario::of`](crate::scenario::Scenario::of) makes a scenario of it, by key and, where it was
/// read from a file, by line.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ScenarioSpec {
    /// The one-line description.
    pub title: String,
    /// The folder that relative paths are relative to, as the file says; the file's own unless given.
    pub folder: Option<String>,
    /// How long the run is.
    pub duration: Time,
    /// The seed of every random stream.
    pub seed: u64,
    /// The participants.
    pub participants: Entries<ParticipantSpec>,
    /// The connections.
    pub connections: Entries<ConnectionSpec>,
    /// Inputs that nothing feeds though their participants need them: a program that drives the run sets them.
    pub inputs: Vec<String>,
    /// What the run is judged by, as the assessment of that `kind` understands it.
    pub assessment: Option<Table>,
    /// What goes wrong.
    pub faults: Vec<FaultSpec>,
    /// What must never happen.
    pub guards: Entries<GuardSpec>,
    /// Figures and their limits.
    pub measures: Entries<MeasureSpec>,
    /// Which figures the report draws, as [`crate::view::View`] reads it.
    pub report: Option<Table>,
    /// What the playback shows, as [`crate::scene::Scene`] reads it.
    pub scene: Option<Table>,
    /// What varies in a campaign: no run depends on it.
    pub campaign: Option<Table>,
    /// What is kept of the samples of a `PARTICIPANT`, a `PARTICIPANT.OUTPUT`, or of what is seen at an input,
    /// `PARTICIPANT.seen.INPUT`. What is not named is kept whole; of all of a participant there is everything or nothing.
    pub record: Entries<RecordSpec>,
    pub(in crate::scenario) origin: Origin,
}

impl ScenarioSpec {
    /// A run of this length, without participants yet.
    pub fn new(duration: impl Into<Time>) -> ScenarioSpec {
        ScenarioSpec {
            duration: duration.into(),
            seed: 1,
            ..ScenarioSpec::default()
        }
    }

    /// The one-line description.
    #[must_use]
    pub fn title(mut self, title: &str) -> ScenarioSpec {
        self.title = title.to_owned();
        self
    }

    /// The seed of every random stream.
    #[must_use]
    pub fn seed(mut self, seed: u64) -> ScenarioSpec {
        self.seed = seed;
        self
    }

    /// One more participant, or another one of that name.
    #[must_use]
    pub fn participant(mut self, name: &str, participant: ParticipantSpec) -> ScenarioSpec {
        self.participants.insert(name.to_owned(), participant);
        self
    }

    /// One more connection, or another one of that name.
    #[must_use]
    pub fn connection(mut self, name: &str, connection: ConnectionSpec) -> ScenarioSpec {
        self.connections.insert(name.to_owned(), connection);
        self
    }

    /// `PARTICIPANT.INPUT`, which a program that drives the run sets.
    #[must_use]
    pub fn input(mut self, port: &str) -> ScenarioSpec {
        self.inputs.push(port.to_owned());
        self
    }

    /// What the run is judged by: whatever serde makes a table of.
    ///
    /// # Errors
    /// When serde makes no table of it.
    pub fn assessment(mut self, assessment: &impl Serialize) -> Result<ScenarioSpec, toml::ser::Error> {
        self.assessment = Some(Table::try_from(assessment)?);
        Ok(self)
    }

    /// One more thing that goes wrong.
    #[must_use]
    pub fn fault(mut self, fault: FaultSpec) -> ScenarioSpec {
        self.faults.push(fault);
        self
    }

    /// One more guard.
    #[must_use]
    pub fn guard(mut self, name: &str, guard: GuardSpec) -> ScenarioSpec {
        self.guards.insert(name.to_owned(), guard);
        self
    }

    /// One more figure.
    #[must_use]
    pub fn measure(mut self, name: &str, measure: MeasureSpec) -> ScenarioSpec {
        self.measures.insert(name.to_owned(), measure);
        self
    }

    /// What is kept of a `PARTICIPANT`, a `PARTICIPANT.OUTPUT` or a `PARTICIPANT.seen.INPUT`.
    #[must_use]
    pub fn record(mut self, of: &str, part: RecordSpec) -> ScenarioSpec {
        self.record.insert(of.to_owned(), part);
        self
    }

    /// All programs that the scenario names: those of participants, those that take over after a failure, and substitutes.
    pub fn runs_mut(&mut self) -> impl Iterator<Item = &mut RunSpec> {
        let own = self.participants.values_mut().flat_map(|own| {
            let after = match &mut own.on_failure {
                OnFailureSpec::Substitute(run) => Some(&mut **run),
                OnFailureSpec::Stop | OnFailureSpec::RestartFromCheckpoint => None,
            };
            std::iter::once(&mut own.run).chain(after)
        });
        own.chain(self.faults.iter_mut().filter_map(|fault| fault.run.as_mut()))
    }

    /// The folder that relative paths are relative to when this is what `file` says.
    pub(in crate::scenario) fn folder_at(&self, file: &Path) -> PathBuf {
        folder_of(file, self.folder.as_deref())
    }

    /// Shows `visit` every time with its key.
    pub(in crate::scenario) fn each_time(&mut self, visit: &mut dyn FnMut(String, &mut Time)) {
        visit("duration".into(), &mut self.duration);
        let mut below = |section: &str, name: &str, times: &mut [(&str, Option<&mut Time>)]| {
            for (key, time) in times {
                if let Some(time) = time {
                    visit(format!("{section}.{name}.{key}"), time);
                }
            }
        };
        for (name, own) in &mut self.participants {
            let (period, offset) = (Some(&mut own.period), Some(&mut own.offset));
            let mut times = [
                ("period", period),
                ("offset", offset),
                ("start-within", own.start_within.as_mut()),
            ];
            below("participants", name, &mut times);
        }
        for (name, own) in &mut self.connections {
            let mut times = [("delay", Some(&mut own.delay)), ("jitter", Some(&mut own.jitter))];
            below("connections", name, &mut times);
        }
        for (position, own) in self.faults.iter_mut().enumerate() {
            let name = fault_name(own.name.as_deref(), position);
            let (at, until) = (Some(&mut own.at), own.until.as_mut());
            let mut times = [("at", at), ("until", until), ("extra-delay", own.extra_delay.as_mut())];
            below("faults", &name, &mut times);
        }
        for (name, own) in &mut self.guards {
            below("guards", name, &mut [("frozen-for", own.frozen_for.as_mut())]);
        }
        for (name, own) in &mut self.measures {
            let (from, to) = (own.from.as_mut(), own.to.as_mut());
            below(
                "measures",
                name,
                &mut [("from", from), ("to", to), ("at", own.at.as_mut())],
            );
        }
        for (name, own) in &mut self.record {
            if let RecordSpec::Part(part) = own {
                let (every, from) = (part.every.as_mut(), part.from.as_mut());
                below(
                    "record",
                    name,
                    &mut [("every", every), ("from", from), ("to", part.to.as_mut())],
                );
            }
        }
    }

    /// How long the run is, once all times have been looked at.
    pub(in crate::scenario) fn length(&self) -> Rational {
        self.duration.checked()
    }
}

/// The folder that relative paths of a scenario in `file` are relative to: the file's own unless the scenario names another.
pub(super) fn folder_of(file: &Path, named: Option<&str>) -> PathBuf {
    let own = file.parent().unwrap_or(Path::new(""));
    named.map_or_else(|| own.to_owned(), |named| own.join(named))
}

/// A seed as TOML has it, whose whole numbers end at 2^63.
pub(super) fn seed_value(seed: u64) -> Value {
    i64::try_from(seed).map_or_else(|_| Value::String(seed.to_string()), Value::Integer)
}
