//! Resolution of a scenario file into participants and a plan.

use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use lockstep::link::{Hold, Timing};
use lockstep::name::{NAME_MAX, is_name};
use lockstep::plan::PlanError;
use lockstep::time::Rational;
use report::view::View;
use toml::Table;

use super::entry::Entry;
use super::error::{Mistake, ScenarioError};
use super::failure::OnFailure;
use super::faults::{self, Faults, Substitution};
use super::fields;
use super::guards::{self, Guard};
use super::measures::{self, DeclaredMeasure};
use super::names::{Names, ORCHESTRATOR};
use super::ports::{ConnectionEnd, not_a_port, parse_port};
use super::program::Program;
use super::recorded::{self, RecordRequest};
use super::report_view;
use super::source::SourceContext;
use super::spec::{Changes, FOLDER, PartialScenario, ScenarioSpec};
use crate::builtins::{Builtins, HasBuiltins};
use crate::text::check_title;

/// A scenario that has been read and resolved, as far as possible without the participants.
#[derive(Clone)]
pub struct Scenario {
    /// The file's name without its ending.
    pub name: String,
    /// The one-line description.
    pub title: String,
    /// How long the run is.
    pub duration: Rational,
    /// The seed of every random stream.
    pub seed: u64,
    /// The participants in the order of their names.
    pub participants: Vec<Entry>,
    /// The table `assessment`, if there is one.
    pub assessment: Option<Table>,
    /// The substitutions in mid-run, in the order of time.
    pub substitutions: Vec<Substitution>,
    /// The participants' names.
    pub(super) names: Names,
    /// The unconnected inputs that their participants require, by participant.
    pub(super) inputs: Vec<(usize, String)>,
    pub(super) faults: Faults,
    pub(super) guards: Vec<Guard>,
    pub(super) measures: Vec<DeclaredMeasure>,
    pub(super) view: View,
    pub(super) record: Vec<RecordRequest>,
    /// The content of the scenario.
    pub(super) spec: ScenarioSpec,
    /// The content as a table, once it was asked for.
    table: OnceLock<Table>,
    pub(super) source: SourceContext,
}

impl Scenario {
    /// Reads `file` and applies `overrides`, each `key.path=value` or `faults+=key=value,…`.
    pub fn read(catalogue: &impl HasBuiltins, file: &Path, overrides: &[String]) -> Result<Scenario, ScenarioError> {
        Scenario::changed(catalogue, file, &overrides.into())
    }

    /// Reads `file` with `changes`.
    pub fn changed(catalogue: &impl HasBuiltins, file: &Path, changes: &Changes) -> Result<Scenario, ScenarioError> {
        Scenario::resolve(catalogue, PartialScenario::of_file(file, changes)?, file)
    }

    /// Resolves `text` as if it were the content of `file`.
    pub fn read_text(catalogue: &impl HasBuiltins, file: &Path, text: &str) -> Result<Scenario, ScenarioError> {
        Scenario::changed_text(catalogue, file, text, &Changes::default())
    }

    /// As [`Scenario::read_text`], with `changes`.
    pub fn changed_text(
        catalogue: &impl HasBuiltins,
        file: &Path,
        text: &str,
        changes: &Changes,
    ) -> Result<Scenario, ScenarioError> {
        Scenario::resolve(
            catalogue,
            PartialScenario::of_text(file, text.to_owned(), changes)?,
            file,
        )
    }

    /// Resolves `spec` as the scenario in `file`: relative paths are relative to the folder of `file`, its name without the ending
    /// is the scenario's name, and messages name it. The file need not exist.
    ///
    /// # Errors
    /// All mistakes in it, by key; by line too if it was read from a file.
    pub fn of(catalogue: &impl HasBuiltins, mut spec: ScenarioSpec, file: &Path) -> Result<Scenario, ScenarioError> {
        spec.origin.file = file.to_owned();
        let mut wrong = Vec::new();
        spec.for_each_time(&mut |key, time| {
            if let Err(error) = time.exact() {
                wrong.push((key, error.to_string()));
            }
        });
        if !wrong.is_empty() {
            let mistakes = wrong.iter().map(|(key, reason)| spec.origin.mistake(key, reason));
            return Err(spec.origin.error(mistakes.collect()));
        }
        let folder = spec.folder_at(file);
        spec.include_files(&folder)?;
        Scenario::resolve(catalogue, PartialScenario::of_spec(spec), file)
    }

    fn resolve(catalogue: &impl HasBuiltins, partial: PartialScenario, file: &Path) -> Result<Scenario, ScenarioError> {
        let PartialScenario {
            spec,
            unread,
            mut mistakes,
        } = partial;
        let source = SourceContext {
            builtins: catalogue.builtins().clone(),
            folder: spec.folder_at(file),
            origin: spec.origin.clone(),
        };
        if let Err(reason) = check_title(&spec.title) {
            mistakes.push(source.mistake("title", reason));
        }
        let name_mistakes = name_mistakes(&source, &spec);
        if !name_mistakes.is_empty() {
            // What refers to such a participant would be refused for another reason.
            mistakes.extend(name_mistakes);
            return Err(source.error(mistakes));
        }
        let mut all: Vec<&String> = spec.participants.keys().chain(&unread.participants).collect();
        all.sort();
        let names = Names::new(all.iter().map(|name| (*name).clone()));
        let mut resolved = Vec::new();
        for name in all {
            let Some(entry) = spec.participants.get(name) else {
                resolved.push(None);
                continue;
            };
            let entry = if name == ORCHESTRATOR {
                let reason = format!("the name `{name}` is the program's own: give the participant another one");
                Err(source.mistake(&format!("participants.{name}"), reason))
            } else {
                Entry::resolve(&source, name, entry, spec.seed)
            };
            resolved.push(entry.map_err(|mistake| mistakes.push(mistake)).ok());
        }
        let known = Names::new(spec.connections.keys().chain(&unread.connections).cloned());
        let faults = faults::read(&source, &names, &resolved, &known, &spec.faults, &unread.faults);
        let (faults, substitutions) = faults.unwrap_or_else(|wrong| {
            mistakes.extend(wrong);
            Default::default()
        });
        let mut refused = |wrong: Vec<Mistake>| mistakes.extend(wrong);
        let guards = guards::read(&source, &names, &spec.guards);
        let guards = guards.map_err(&mut refused).unwrap_or_default();
        let measures = measures::read(&source.origin, &spec.measures);
        let measures = measures.map_err(&mut refused).unwrap_or_default();
        let view = report_view::read(&source, &names, spec.report.as_ref(), spec.scene.as_ref());
        let view = view.map_err(&mut refused).unwrap_or_default();
        let record = recorded::read(&source, &names, &spec.record);
        let record = record.map_err(&mut refused).unwrap_or_default();
        let inputs = open_inputs(&source, &names, &spec.inputs);
        let inputs = inputs.map_err(&mut refused).unwrap_or_default();
        if !mistakes.is_empty() {
            return Err(source.error(mistakes));
        }
        let stem = file.file_stem().and_then(|stem| stem.to_str()).unwrap_or("run");
        Ok(Scenario {
            name: stem.to_owned(),
            title: spec.title.clone(),
            duration: spec.length(),
            seed: spec.seed,
            participants: resolved.into_iter().flatten().collect(),
            names,
            inputs,
            assessment: spec.assessment.clone(),
            substitutions,
            faults,
            guards,
            measures,
            view,
            record,
            spec,
            table: OnceLock::new(),
            source,
        })
    }

    /// The content of the scenario, with files and changes filled in.
    pub fn spec(&self) -> &ScenarioSpec {
        &self.spec
    }

    /// The participants and assessments that the scenario may name.
    pub fn builtins(&self) -> &Arc<Builtins> {
        &self.source.builtins
    }

    /// The links between whole ports as `(PARTICIPANT.OUTPUT, PARTICIPANT.INPUT, timing)`, in the order of their names.
    pub fn links(&self) -> impl Iterator<Item = (&str, &str, Timing)> {
        let whole = self
            .spec
            .connections
            .iter()
            .filter(|(_, connection)| !fields::names_fields(connection));
        whole.flat_map(|(_, connection)| {
            let to = connection.to.iter();
            to.map(|to| (connection.from.as_str(), to.as_str(), connection.timing()))
        })
    }

    /// The files that the scenario names, whose contents it now holds.
    pub fn files(&self) -> &[PathBuf] {
        &self.source.origin.files
    }

    /// The scenario with files and overrides filled in, as a table.
    pub fn resolved(&self) -> &Table {
        self.table.get_or_init(|| self.spec.to_table())
    }

    /// The content with the absolute folder for relative paths, so that it has the same meaning wherever it is stored, and with
    /// every default. A folder whose name is not valid text is left out.
    pub fn written(&self) -> ScenarioSpec {
        let folder = self.source.folder_in_full();
        let mut spec = self.spec.with_defaults();
        spec.folder = folder.as_deref().and_then(Path::to_str).map(str::to_owned);
        spec
    }

    /// Every program that may run: the participants' own, their substitutes', and those that take over after a failure.
    pub fn programs(&self) -> impl Iterator<Item = &Program> {
        let own = self.participants.iter().map(|entry| &entry.program);
        let substitutes = self
            .substitutions
            .iter()
            .map(|substitution| &substitution.entry.program);
        let policies = self.participants.iter().filter_map(|entry| match &entry.on_failure {
            OnFailure::Substitute(program) => Some(program),
            OnFailure::Stop | OnFailure::Restart => None,
        });
        own.chain(substitutes).chain(policies)
    }

    /// Whether the run may have to move: for a substitution, or after a failure of a participant.
    pub fn may_relocate(&self) -> bool {
        let mut policies = self.participants.iter().map(|entry| &entry.on_failure);
        !self.substitutions.is_empty() || policies.any(|policy| *policy != OnFailure::Stop)
    }

    /// Whether any participant is to be restarted when it fails.
    pub fn restarts(&self) -> bool {
        let mut policies = self.participants.iter().map(|entry| &entry.on_failure);
        policies.any(|policy| *policy == OnFailure::Restart)
    }

    /// The names of the guards, with their conditions as text.
    pub fn guards(&self) -> impl Iterator<Item = (&str, String)> {
        self.guards
            .iter()
            .map(|guard| (guard.name.as_str(), guard.description()))
    }

    /// Whether every sample is recorded.
    pub fn records_all(&self) -> bool {
        self.record.iter().all(RecordRequest::is_whole)
    }

    /// The error that `what` needs every sample, and the run does not keep every sample.
    pub(crate) fn needs_samples(&self, what: &str) -> ScenarioError {
        recorded::missing_samples_error(&self.record, &self.source, what)
    }

    /// Warnings about settings that are not wrong, but cannot have been intended.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        let mut warn = |key: &str, reason: String| {
            let mistake = self.source.mistake(key, reason);
            warnings.push(self.source.error(vec![mistake]).to_string());
        };
        let end = self.duration;
        for entry in &self.participants {
            if entry.offset >= end {
                let reason = format!("{} is not before the end at {end}: it is never activated", entry.offset);
                warn(&format!("participants.{}.offset", entry.setup.name), reason);
            }
        }
        for (participant, input) in &self.inputs {
            let port = format!("{}.{input}", self.participants[*participant].setup.name);
            warn(
                "inputs",
                format!("no output is connected to `{port}`: it is zero unless a program that drives the run sets it"),
            );
        }
        for (name, connection) in self.spec.connections.iter().filter(|(_, own)| own.hold == Hold::Linear) {
            let producer = ConnectionEnd::of(&connection.from).and_then(|from| self.names.number(from.participant));
            let period = producer.map(|number| self.participants[number].period);
            let delay = connection.timing().delay;
            if let Some(period) = period.filter(|period| delay < *period) {
                let reason = format!(
                    "with a delay of {delay} the next sample has often not been taken when it is needed, and the last one is held: a delay of \
                     at least the producer's period, {period}, is always interpolated"
                );
                warn(&format!("connections.{name}.hold"), reason);
            }
        }
        let faults = self.faults.start_times();
        let substitutions = self.substitutions.iter().map(|one| (one.key.clone(), one.at));
        let mut start_times: Vec<(String, Rational)> = faults.chain(substitutions).collect();
        start_times.sort();
        for (key, at) in start_times {
            if at >= end {
                let reason = format!("{at} is not before the end at {end}: it does not happen in this run");
                warn(&format!("{key}.at"), reason);
            }
        }
        for (key, time) in self.measures.iter().filter_map(|measure| measure.window_after_end(end)) {
            warn(
                &key,
                format!("{time} is after the end at {end}: nothing is measured in this run"),
            );
        }
        for (key, from) in self.record.iter().filter_map(|one| one.window_after_end(end)) {
            warn(
                &key,
                format!("{from} is after the end at {end}: nothing is recorded of it"),
            );
        }
        if let Some(folder) = self.spec.folder.as_ref().filter(|_| !self.source.folder.is_dir()) {
            let reason = format!(
                "there is no folder `{folder}`, to which relative paths are relative: this run needs none of them; write the folder that \
                 is meant, or leave the key out"
            );
            warn(FOLDER, reason);
        }
        if self
            .source
            .folder_in_full()
            .is_some_and(|folder| folder.to_str().is_none())
            && self.programs().any(|program| program.file().is_some())
        {
            let reason = "its name is not UTF-8, so that plan.toml cannot have it: there relative paths will be relative to the run \
                          folder";
            warn(FOLDER, reason.to_owned());
        }
        warnings
    }

    /// The error that a parameter of `entry` is refused, with its place in the file.
    pub fn refusal(&self, entry: &Entry, key: &str, reason: &str) -> ScenarioError {
        self.source.error(vec![self.refusal_mistake(entry, key, reason)])
    }

    /// The error that the value at `key` is refused.
    pub(crate) fn key_refusal(&self, key: &str, reason: &str) -> ScenarioError {
        self.source.error(vec![self.source.mistake(key, reason)])
    }

    /// The error that sample times of participants are refused, by number, with the reason: at the offset if only that was changed,
    /// otherwise at the period.
    pub(crate) fn sample_time_refusal(&self, wrong: &[(usize, String)]) -> ScenarioError {
        let mistakes = wrong.iter().map(|(number, reason)| {
            let key = |key: &str| format!("participants.{}.{key}", self.participants[*number].setup.name);
            let [period, offset] = ["period", "offset"].map(key);
            let moved = self.source.origin.is_changed(&offset) && !self.source.origin.is_changed(&period);
            self.source
                .mistake(if moved { &offset } else { &period }, reason.as_str())
        });
        self.source.error(mistakes.collect())
    }

    /// The error that the program of `entry` is refused.
    pub fn program_refusal(&self, entry: &Entry, reason: &str) -> ScenarioError {
        self.source.error(vec![self.source.mistake(&entry.run_key, reason)])
    }

    /// A mistake in the table `assessment`.
    pub fn assessment_refusal(&self, key: &str, reason: &str) -> ScenarioError {
        let key = if key.is_empty() {
            "assessment".to_owned()
        } else {
            format!("assessment.{key}")
        };
        self.source.error(vec![self.source.mistake(&key, reason)])
    }

    /// A mistake in a parameter. It stands at the parameter if the program that refuses it was written for it, and otherwise at the
    /// program that has taken the place of that one.
    pub(super) fn parameter_mistake(&self, entry: &Entry, key: &str, reason: &str) -> Mistake {
        let place = &entry.parameters_key;
        let key = if key.is_empty() {
            place.clone()
        } else {
            format!("{place}.{key}")
        };
        let own = self.source.mistake(&key, reason);
        if !self.has_foreign_parameters(entry) {
            return own;
        }
        let line = own.line.map_or(String::new(), |line| format!(" (line {line})"));
        let reason = format!("{} refuses `{key}`{line}: {}", entry.program, own.reason);
        self.source.mistake(&entry.run_key, reason)
    }

    /// Whether the program of `entry` has taken over the parameters of another one.
    fn has_foreign_parameters(&self, entry: &Entry) -> bool {
        let table = |key: &'static str, of: &str| of.strip_suffix(key).map(str::to_owned);
        let is_separate = table(".run", &entry.run_key) != table(".parameters", &entry.parameters_key);
        is_separate || self.source.origin.is_substituted(&entry.run_key)
    }
}

/// The mistakes in the names of participants.
fn name_mistakes(source: &SourceContext, spec: &ScenarioSpec) -> Vec<Mistake> {
    let is_valid = |name: &str| name.starts_with(|c: char| c.is_ascii_alphabetic()) && is_name(name, NAME_MAX);
    let invalid = spec.participants.keys().filter(|name| !is_valid(name));
    let mistakes = invalid.map(|name| {
        let reason = PlanError::Name(name.clone()).to_string();
        source.mistake(&format!("participants.{name}"), reason)
    });
    mistakes.collect()
}

/// The participants and the inputs that `inputs` names.
fn open_inputs(source: &SourceContext, names: &Names, ports: &[String]) -> Result<Vec<(usize, String)>, Vec<Mistake>> {
    let (mut inputs, mut mistakes) = (Vec::new(), Vec::new());
    for port in ports {
        match open_input(names, port) {
            Ok(input) => inputs.push(input),
            Err(reason) => mistakes.push(source.mistake("inputs", reason)),
        }
    }
    if mistakes.is_empty() { Ok(inputs) } else { Err(mistakes) }
}

/// The participant and the input that an entry of `inputs` names.
fn open_input(names: &Names, text: &str) -> Result<(usize, String), String> {
    let (participant, input) = parse_port(text).ok_or_else(|| not_a_port(text))?;
    let number = names.number(&participant);
    let number = number.ok_or_else(|| names.unknown("participant", &participant))?;
    Ok((number, input))
}
