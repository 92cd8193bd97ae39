//! The scenario as a value: all sections of its file, with methods to build, change and write it.

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

/// The complete content of a scenario as a value: read from a file or created in code, changed, and written again.
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
/// Mistakes are reported when [`Scenario::of`](crate::scenario::Scenario::of) makes a scenario of it: by key and, if it was read
/// from a file, by line.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ScenarioSpec {
    /// The one-line description.
    pub title: String,
    /// The folder for relative paths, as given in the file; the file's own folder unless given.
    pub folder: Option<String>,
    /// How long the run is.
    pub duration: Time,
    /// The seed of every random stream.
    pub seed: u64,
    /// The participants.
    pub participants: Entries<ParticipantSpec>,
    /// The connections.
    pub connections: Entries<ConnectionSpec>,
    /// Unconnected inputs that their participants require: a program that drives the run sets them.
    pub inputs: Vec<String>,
    /// The assessment of the run, in the form of its `kind`.
    pub assessment: Option<Table>,
    /// The faults.
    pub faults: Vec<FaultSpec>,
    /// The guards.
    pub guards: Entries<GuardSpec>,
    /// The measures: figures and their limits.
    pub measures: Entries<MeasureSpec>,
    /// The figures in the report, in the form of [`crate::view::View`].
    pub report: Option<Table>,
    /// The playback, in the form of [`crate::scene::Scene`].
    pub scene: Option<Table>,
    /// What a campaign varies: no run depends on it.
    pub campaign: Option<Table>,
    /// Which samples are recorded of a `PARTICIPANT`, a `PARTICIPANT.OUTPUT`, or of what is seen at an input, `PARTICIPANT.seen.INPUT`.
    /// Streams that are not named are recorded whole; for a whole participant only all or nothing can be recorded.
    pub record: Entries<RecordSpec>,
    pub(in crate::scenario) origin: Origin,
}

impl ScenarioSpec {
    /// A scenario for a run of this length, without participants yet.
    pub fn new(duration: impl Into<Time>) -> ScenarioSpec {
        ScenarioSpec {
            duration: duration.into(),
            seed: 1,
            ..ScenarioSpec::default()
        }
    }

    /// Sets the one-line description.
    #[must_use]
    pub fn title(mut self, title: &str) -> ScenarioSpec {
        self.title = title.to_owned();
        self
    }

    /// Sets the seed of every random stream.
    #[must_use]
    pub fn seed(mut self, seed: u64) -> ScenarioSpec {
        self.seed = seed;
        self
    }

    /// Adds a participant, or replaces the one of that name.
    #[must_use]
    pub fn participant(mut self, name: &str, participant: ParticipantSpec) -> ScenarioSpec {
        self.participants.insert(name.to_owned(), participant);
        self
    }

    /// Adds a connection, or replaces the one of that name.
    #[must_use]
    pub fn connection(mut self, name: &str, connection: ConnectionSpec) -> ScenarioSpec {
        self.connections.insert(name.to_owned(), connection);
        self
    }

    /// Adds `PARTICIPANT.INPUT` to the inputs that a program driving the run sets.
    #[must_use]
    pub fn input(mut self, port: &str) -> ScenarioSpec {
        self.inputs.push(port.to_owned());
        self
    }

    /// Sets the assessment of the run, from any value that serde serialises as a table.
    ///
    /// # Errors
    /// When serde does not serialise it as a table.
    pub fn assessment(mut self, assessment: &impl Serialize) -> Result<ScenarioSpec, toml::ser::Error> {
        self.assessment = Some(Table::try_from(assessment)?);
        Ok(self)
    }

    /// Adds a fault.
    #[must_use]
    pub fn fault(mut self, fault: FaultSpec) -> ScenarioSpec {
        self.faults.push(fault);
        self
    }

    /// Adds a guard, or replaces the one of that name.
    #[must_use]
    pub fn guard(mut self, name: &str, guard: GuardSpec) -> ScenarioSpec {
        self.guards.insert(name.to_owned(), guard);
        self
    }

    /// Adds a measure, or replaces the one of that name.
    #[must_use]
    pub fn measure(mut self, name: &str, measure: MeasureSpec) -> ScenarioSpec {
        self.measures.insert(name.to_owned(), measure);
        self
    }

    /// Sets which samples are recorded of a `PARTICIPANT`, a `PARTICIPANT.OUTPUT` or a `PARTICIPANT.seen.INPUT`.
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

    /// The folder for relative paths when this is the content of `file`.
    pub(in crate::scenario) fn folder_at(&self, file: &Path) -> PathBuf {
        folder_of(file, self.folder.as_deref())
    }

    /// Calls `visit` with every time and its key.
    pub(in crate::scenario) fn for_each_time(&mut self, visit: &mut dyn FnMut(String, &mut Time)) {
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

    /// How long the run is, once all times have been checked.
    pub(in crate::scenario) fn length(&self) -> Rational {
        self.duration.checked()
    }
}

/// The folder for relative paths of a scenario in `file`: the file's own unless the scenario names another.
pub(super) fn folder_of(file: &Path, named: Option<&str>) -> PathBuf {
    let own = file.parent().unwrap_or(Path::new(""));
    named.map_or_else(|| own.to_owned(), |named| own.join(named))
}

/// A seed in TOML, whose integers end at 2^63.
pub(super) fn seed_value(seed: u64) -> Value {
    i64::try_from(seed).map_or_else(|_| Value::String(seed.to_string()), Value::Integer)
}
