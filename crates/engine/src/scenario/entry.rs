//! Entries: a participant's program with its sample time, parameters and failure policy.

use lockstep::participant::Setup;
use lockstep::time::Rational;
use toml::Table;

use super::error::Mistake;
use super::failure::OnFailure;
use super::program::Program;
use super::run_table::resolve_program;
use super::source::SourceContext;
use super::spec::{OnFailureSpec, ParticipantSpec, RunSpec, Time};

/// A program in a participant's place: the participant as the scenario declares it, or its substitute in mid-run.
#[derive(Debug, Clone)]
pub struct Entry {
    /// The program that runs.
    pub program: Program,
    /// The sample period.
    pub period: Rational,
    /// The first activation.
    pub offset: Rational,
    /// What the participant is given when it is made, such as its name and its parameters.
    pub setup: Setup,
    /// What happens when it fails.
    pub on_failure: OnFailure,
    /// How long its program may take to enter the run and to answer a request, if the scenario specifies it.
    pub start_within: Option<Rational>,
    /// Whether the program is there because another one failed.
    pub replaced: bool,
    /// The scenario's key that names the program.
    pub run_key: String,
    /// The scenario's key that has the parameters.
    pub parameters_key: String,
}

impl Entry {
    /// The participant `name` as the scenario has it.
    pub(super) fn resolve(
        source: &SourceContext,
        name: &str,
        entry: &ParticipantSpec,
        seed: u64,
    ) -> Result<Entry, Mistake> {
        let key = |below: &str| format!("participants.{name}.{below}");
        let runs = resolve_program(source, &key("run"), &entry.run)?;
        let on_failure = match &entry.on_failure {
            OnFailureSpec::Stop => OnFailure::Stop,
            OnFailureSpec::RestartFromCheckpoint => OnFailure::Restart,
            OnFailureSpec::Substitute(run) => {
                OnFailure::Substitute(resolve_program(source, &key("on-failure.substitute"), run)?)
            }
        };
        let (period, offset) = (entry.period.checked(), entry.offset.checked());
        if !period.is_positive() {
            let reason = format!("the period is {period}; it must be positive");
            return Err(source.mistake(&key("period"), reason));
        }
        let start_within = entry.start_within.as_ref().map(Time::checked);
        if let Some(time) = start_within.filter(|time| !time.is_positive()) {
            let reason = format!("the time is {time}; it must be positive, such as \"120 s\"");
            return Err(source.mistake(&key("start-within"), reason));
        }
        let setup = Setup {
            name: name.to_owned(),
            parameters: entry.parameters.clone(),
            seed,
            period: period.seconds(),
            offset: offset.seconds(),
        };
        Ok(Entry {
            program: runs,
            period,
            offset,
            setup,
            on_failure,
            start_within,
            replaced: false,
            run_key: key("run"),
            parameters_key: key("parameters"),
        })
    }

    /// The entry after the substitution at `key`: with its own program, and its own parameters or else those that the scenario
    /// declares for the participant, whatever was substituted for it before.
    pub(super) fn substituted(
        &self,
        source: &SourceContext,
        key: &str,
        run: &RunSpec,
        parameters: Option<Table>,
    ) -> Result<Entry, Mistake> {
        let run_key = format!("{key}.run");
        let mut entry = Entry {
            program: resolve_program(source, &run_key, run)?,
            run_key,
            ..self.clone()
        };
        if let Some(parameters) = parameters {
            entry.setup.parameters = parameters;
            entry.parameters_key = format!("{key}.parameters");
        }
        Ok(entry)
    }

    /// The entry after `program` of its `on-failure` has taken over.
    pub fn replaced_by(&self, program: &Program) -> Entry {
        Entry {
            program: program.clone(),
            on_failure: OnFailure::Stop,
            replaced: true,
            run_key: format!("participants.{}.on-failure.substitute", self.setup.name),
            ..self.clone()
        }
    }

    /// Whether it is the same program with the same parameters as `other`.
    pub fn runs_as(&self, other: &Entry) -> bool {
        (&self.program, &self.setup.parameters) == (&other.program, &other.setup.parameters)
    }
}
